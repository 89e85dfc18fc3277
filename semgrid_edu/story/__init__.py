"""Why does a cell get its class? Every stage's part in the answer, in numbers that add up (paper, Fig. 2).

`cell_story` follows one cell of one frame. `contribution_maps` does the costliest part for all cells at once.
"""

from semgrid_edu.story.cell_evidence import CellScan, cell_scan, place_history
from semgrid_edu.story.cell_story import CellStory, cell_story
from semgrid_edu.story.contributions import ContributionMaps, Contributions, cell_contributions, contribution_maps
from semgrid_edu.story.crf_messages import NeighbourPull, neighbour_pull, weights_of_cell

__all__ = [
    "CellScan",
    "CellStory",
    "ContributionMaps",
    "Contributions",
    "NeighbourPull",
    "cell_contributions",
    "cell_scan",
    "cell_story",
    "contribution_maps",
    "neighbour_pull",
    "place_history",
    "weights_of_cell",
]

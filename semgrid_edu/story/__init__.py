"""Why does a cell get its class? Every stage's part in the answer, in numbers that add up (paper, Fig. 2).

`cell_story` follows one cell of one frame. `contribution_maps` does the costliest part for all cells at once.
"""

from semgrid_edu.story.contributions import Contributions, cell_contributions
from semgrid_edu.story.maps import ContributionMaps, contribution_maps
from semgrid_edu.story.place import place_history
from semgrid_edu.story.pull import NeighbourPull, neighbour_pull, weights_of_cell
from semgrid_edu.story.said import CellScan, cell_scan
from semgrid_edu.story.tell import CellStory, cell_story

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

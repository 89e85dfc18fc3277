"""Why does a cell get its class? Every stage's part in the answer, in numbers that add up (paper, Fig. 2).

`cell_story` follows one cell of one frame. `contribution_maps` does the costliest part for all cells at once.
"""

from semgrid_edu.story.cell_evidence import CellScan, ScanMaps, cell_scan, place_history, scan_maps
from semgrid_edu.story.cell_story import CellStory, cell_story
from semgrid_edu.story.contributions import ContributionMaps, Contributions, cell_contributions, contribution_maps
from semgrid_edu.story.crf_messages import (
    NeighbourPull,
    neighbour_messages,
    neighbour_pull,
    strongest_neighbours,
    weights_of_cell,
)

__all__ = [
    "CellScan",
    "CellStory",
    "ContributionMaps",
    "Contributions",
    "NeighbourPull",
    "ScanMaps",
    "cell_contributions",
    "cell_scan",
    "cell_story",
    "contribution_maps",
    "neighbour_messages",
    "neighbour_pull",
    "place_history",
    "scan_maps",
    "strongest_neighbours",
    "weights_of_cell",
]

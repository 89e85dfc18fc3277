"""Why does a cell get its class? Every stage's part in the answer, in numbers that add up (paper, Fig. 2).

`cell_story` follows one cell of one frame, and printed it says in words which stage went wrong. `contribution_maps`
does the costliest part for all cells at once, and `what_if` says what cells would be called with other inputs.
"""

from semgrid_edu.story.cell_evidence import (
    CellMemory,
    CellScan,
    ScanMaps,
    cell_scan,
    last_sight,
    place_history,
    scan_maps,
)
from semgrid_edu.story.cell_story import CellStory, cell_story
from semgrid_edu.story.contributions import ContributionMaps, Contributions, cell_contributions, contribution_maps
from semgrid_edu.story.crf_messages import (
    NeighbourPull,
    neighbour_messages,
    neighbour_pull,
    strongest_neighbours,
    weights_of_cell,
)
from semgrid_edu.story.what_if import what_if
from semgrid_edu.story.words import story_text

__all__ = [
    "CellMemory",
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
    "last_sight",
    "neighbour_messages",
    "neighbour_pull",
    "place_history",
    "scan_maps",
    "story_text",
    "strongest_neighbours",
    "weights_of_cell",
    "what_if",
]

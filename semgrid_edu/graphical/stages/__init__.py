"""The model of each stage of the paper, at toy size, built from the functions that the pipeline itself calls."""

from semgrid_edu.graphical.stages.cell import exact_cell, one_cell, package_cell, read_scans
from semgrid_edu.graphical.stages.line import bayes_on_a_line
from semgrid_edu.graphical.stages.log_odds_cell import one_log_odds_cell, package_log_odds_cell
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph

__all__ = [
    "CutEdge",
    "StageGraph",
    "bayes_on_a_line",
    "exact_cell",
    "one_cell",
    "one_log_odds_cell",
    "package_cell",
    "package_log_odds_cell",
    "read_scans",
]

"""Each stage of the paper as a model of toy size, built from the functions that the pipeline itself calls."""

from semgrid_edu.graphical.stages.beam import BeamWorld, beam_over_cells
from semgrid_edu.graphical.stages.beam_beliefs import beam_beliefs
from semgrid_edu.graphical.stages.bof import bof_stage
from semgrid_edu.graphical.stages.cell import exact_cell, one_cell, package_cell
from semgrid_edu.graphical.stages.cell_scans import read_scans
from semgrid_edu.graphical.stages.cmcdot_graph import cmcdot_stage
from semgrid_edu.graphical.stages.crf import crf_stage
from semgrid_edu.graphical.stages.line import bayes_on_a_line
from semgrid_edu.graphical.stages.log_odds_cell import one_log_odds_cell, package_log_odds_cell
from semgrid_edu.graphical.stages.made_label import LabelWorld, made_label_stage, wrong_label
from semgrid_edu.graphical.stages.shared_error import count_rings, scan_with_pose_error
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph
from semgrid_edu.graphical.stages.system import whole_system
from semgrid_edu.graphical.stages.system_gain import system_gain
from semgrid_edu.graphical.stages.system_world import SystemWorld
from semgrid_edu.graphical.stages.thick_walls import thick_walls

__all__ = [
    "BeamWorld",
    "CutEdge",
    "LabelWorld",
    "StageGraph",
    "SystemWorld",
    "bayes_on_a_line",
    "beam_beliefs",
    "beam_over_cells",
    "bof_stage",
    "cmcdot_stage",
    "count_rings",
    "crf_stage",
    "exact_cell",
    "made_label_stage",
    "one_cell",
    "one_log_odds_cell",
    "package_cell",
    "package_log_odds_cell",
    "read_scans",
    "scan_with_pose_error",
    "system_gain",
    "thick_walls",
    "whole_system",
    "wrong_label",
]

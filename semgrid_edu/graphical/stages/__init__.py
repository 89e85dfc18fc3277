"""The model of each stage of the paper, at toy size, built from the functions that the pipeline itself calls."""

from semgrid_edu.graphical.stages.bof import bof_stage
from semgrid_edu.graphical.stages.cmcdot_graph import cmcdot_stage
from semgrid_edu.graphical.stages.crf import crf_stage
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph

__all__ = ["CutEdge", "StageGraph", "bof_stage", "cmcdot_stage", "crf_stage"]

"""The stages of the system, to be called by `run_frame`, exchanged, and checked by `run_pipeline`."""

from semgrid_edu.stages.checks import StageError
from semgrid_edu.stages.hints import REMEMBER, STAGES
from semgrid_edu.stages.stages import Stages, class_memory

__all__ = ["REMEMBER", "STAGES", "StageError", "Stages", "class_memory"]

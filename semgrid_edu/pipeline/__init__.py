"""One frame through every stage, from LIDAR scan and image to the refined semantic grid (paper, Fig. 2).

`Stages` holds the paper's five stages, and a memory, as functions that can be exchanged, `run_pipeline` sends frames
through them and checks what each hands to the next, and `load_stages` reads a student's own functions from a file.
"""

from semgrid_edu.pipeline.checks import StageError
from semgrid_edu.pipeline.hints import load_stages
from semgrid_edu.pipeline.run import FrameResult, network_image, run_pipeline, run_side_by_side
from semgrid_edu.pipeline.stages import REMEMBER, STAGES, Stages

__all__ = [
    "REMEMBER",
    "STAGES",
    "FrameResult",
    "StageError",
    "Stages",
    "load_stages",
    "network_image",
    "run_pipeline",
    "run_side_by_side",
]

"""Each stage of the paper as a model of toy size, built from the functions that the pipeline itself calls.

In the order of the lectures: `line` (01); `cell` (02, 04), `beam`, `thick_walls` (02); `cells_in_a_row`, `joint_row`,
`bof` (03); `cmcdot`, `cmcdot_graph` (04); `pixel_ray` (05 to 07); `late_fusion` (08); `ground_truth_label` (09); `crf`
(10); the whole, `system_world` and `system`; and `class_memory`, an edge that the whole cuts. Each stage is a
`StageGraph`: a model, its drawing, and the edges that are cut. `prices` measures what a cut costs, and
`stage_graph.ledger` lists all of these prices.
"""

from semgrid_edu.stage_models.beam import BeamWorld, beam_over_cells
from semgrid_edu.stage_models.bof import bof_stage
from semgrid_edu.stage_models.cell import (
    exact_cell,
    one_cell,
    one_log_odds_cell,
    package_cell,
    package_log_odds_cell,
    read_scans,
)
from semgrid_edu.stage_models.class_memory import MemoryWorld, class_over_time, memory_price
from semgrid_edu.stage_models.cmcdot_graph import cmcdot_stage
from semgrid_edu.stage_models.crf import crf_stage
from semgrid_edu.stage_models.ground_truth_label import (
    LabelWorld,
    count_rings,
    lidar_label_stage,
    scan_with_pose_error,
    wrong_label,
)
from semgrid_edu.stage_models.late_fusion import TwoSensors, car_by_both, late_fusion
from semgrid_edu.stage_models.line import bayes_on_a_line
from semgrid_edu.stage_models.pixel_ray import RayWorld, pixel_height, pixel_ray, post_pixels, shared_pixel
from semgrid_edu.stage_models.stage_graph import CutEdge, LedgerLine, Price, StageGraph, ledger, ledger_table
from semgrid_edu.stage_models.system import system_gain, whole_system
from semgrid_edu.stage_models.system_world import SystemWorld
from semgrid_edu.stage_models.thick_walls import beam_beliefs, thick_walls

__all__ = [
    "BeamWorld",
    "CutEdge",
    "LabelWorld",
    "LedgerLine",
    "MemoryWorld",
    "Price",
    "RayWorld",
    "StageGraph",
    "SystemWorld",
    "TwoSensors",
    "bayes_on_a_line",
    "beam_beliefs",
    "beam_over_cells",
    "bof_stage",
    "car_by_both",
    "class_over_time",
    "cmcdot_stage",
    "count_rings",
    "crf_stage",
    "exact_cell",
    "late_fusion",
    "ledger",
    "ledger_table",
    "lidar_label_stage",
    "memory_price",
    "one_cell",
    "one_log_odds_cell",
    "package_cell",
    "package_log_odds_cell",
    "pixel_height",
    "pixel_ray",
    "post_pixels",
    "read_scans",
    "scan_with_pose_error",
    "shared_pixel",
    "system_gain",
    "thick_walls",
    "whole_system",
    "wrong_label",
]

"""Ground truth as the paper makes it: image labels carried to the grid by LIDAR, and what people do differently (4)."""

from semgrid_edu.datasets.ground_truth.carrying import carry_labels, close_and_spread, close_gaps
from semgrid_edu.datasets.ground_truth.flaws import NO_FLAWS, TruthFlaws, flawed_drive
from semgrid_edu.datasets.ground_truth.making import drive_truth, lidar_truth
from semgrid_edu.datasets.ground_truth.policy import TruthPolicy
from semgrid_edu.datasets.ground_truth.window import Moment, gather_returns

__all__ = [
    "NO_FLAWS",
    "Moment",
    "TruthFlaws",
    "TruthPolicy",
    "carry_labels",
    "close_and_spread",
    "close_gaps",
    "drive_truth",
    "flawed_drive",
    "gather_returns",
    "lidar_truth",
]

"""Ground truth as the paper makes it: image labels carried to the grid by LIDAR (section 4)."""

from semgrid_edu.datasets.ground_truth.making import (
    carry_labels,
    close_and_spread,
    close_gaps,
    drive_truth,
    lidar_truth,
)
from semgrid_edu.datasets.ground_truth.window import Moment, TruthPolicy, gather_returns

__all__ = [
    "Moment",
    "TruthPolicy",
    "carry_labels",
    "close_and_spread",
    "close_gaps",
    "drive_truth",
    "gather_returns",
    "lidar_truth",
]

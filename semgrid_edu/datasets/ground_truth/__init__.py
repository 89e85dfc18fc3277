"""Ground truth as the paper makes it: image labels carried to the grid by LIDAR, and what people do differently (4)."""

from semgrid_edu.datasets.ground_truth.carrying import (
    CLOSING_REACH,
    GROUND_REACH,
    THING_REACH,
    carry_labels,
    close_and_spread,
    close_gaps,
    unknown_numbers,
)
from semgrid_edu.datasets.ground_truth.flaws import (
    NO_FLAWS,
    TruthFlaws,
    flawed_drive,
    flawed_frame,
    flawed_labels,
    miscalibrated,
)
from semgrid_edu.datasets.ground_truth.making import drive_truth, in_sight, lidar_truth
from semgrid_edu.datasets.ground_truth.policy import TruthPolicy
from semgrid_edu.datasets.ground_truth.sweep import EgoVelocity, deskew_scan, ego_velocity, skew_scan, sweep_times
from semgrid_edu.datasets.ground_truth.window import LabelledReturns, Moment, gather_returns

__all__ = [
    "CLOSING_REACH",
    "GROUND_REACH",
    "NO_FLAWS",
    "THING_REACH",
    "EgoVelocity",
    "LabelledReturns",
    "Moment",
    "TruthFlaws",
    "TruthPolicy",
    "carry_labels",
    "close_and_spread",
    "close_gaps",
    "deskew_scan",
    "drive_truth",
    "ego_velocity",
    "flawed_drive",
    "flawed_frame",
    "flawed_labels",
    "gather_returns",
    "in_sight",
    "lidar_truth",
    "miscalibrated",
    "skew_scan",
    "sweep_times",
    "unknown_numbers",
]

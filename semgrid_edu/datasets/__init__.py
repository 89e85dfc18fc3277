"""Readers of drives, labels and data sets, the cached training set, and the shipped samples (paper, section 4)."""

from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame, load_index
from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.kitti_tracking import KittiTrackingRun
from semgrid_edu.datasets.semantic_kitti import SemanticKittiSequence
from semgrid_edu.datasets.synthia import SynthiaSequence
from semgrid_edu.datasets.truth import grid_truth
from semgrid_edu.datasets.zhang import ZhangDrive, zhang_raw_drive
from semgrid_edu.datasets.zhang_labels import ZhangLabels

__all__ = [
    "DatasetIndex",
    "KittiRawDrive",
    "KittiTrackingRun",
    "LabelledFrame",
    "SemanticKittiSequence",
    "SynthiaSequence",
    "ZhangDrive",
    "ZhangLabels",
    "grid_truth",
    "load_index",
    "zhang_raw_drive",
]

"""Readers of drives, labels and data sets, the cached training set, and the shipped samples (paper, section 4)."""

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame, load_index
from semgrid_edu.datasets.readers.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.readers.kitti_tracking import KittiTrackingRun
from semgrid_edu.datasets.readers.pandaset import PandasetScene
from semgrid_edu.datasets.readers.semantic_kitti import SemanticKittiSequence
from semgrid_edu.datasets.readers.synthia import SynthiaSequence
from semgrid_edu.datasets.readers.zhang import ZhangDrive, ZhangLabels

__all__ = [
    "DatasetIndex",
    "KittiRawDrive",
    "KittiTrackingRun",
    "LabelledFrame",
    "PandasetScene",
    "SemanticKittiSequence",
    "SynthiaSequence",
    "ZhangDrive",
    "ZhangLabels",
    "grid_truth",
    "load_index",
]

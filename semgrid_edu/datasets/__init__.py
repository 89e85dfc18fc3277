"""Readers of drives, labels and data sets, the cached training set, and the shipped samples (paper, section 4)."""

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame, load_index
from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.pandaset import PandasetScene
from semgrid_edu.datasets.semantic_kitti import SemanticKittiSequence

__all__ = [
    "DatasetIndex",
    "KittiRawDrive",
    "LabelledFrame",
    "PandasetScene",
    "SemanticKittiSequence",
    "grid_truth",
    "load_index",
]

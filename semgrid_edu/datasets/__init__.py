"""Readers of drives, labels and data sets, the cached training set, and the shipped samples (paper, section 4)."""

from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame, load_index
from semgrid_edu.datasets.kitti_raw import KittiRawDrive
from semgrid_edu.datasets.truth import grid_truth

__all__ = ["DatasetIndex", "KittiRawDrive", "LabelledFrame", "grid_truth", "load_index"]

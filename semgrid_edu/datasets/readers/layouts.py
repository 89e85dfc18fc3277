"""Folders that look like another data set, or like this one seen from a wrong place: what they are and what to do."""

from pathlib import Path
from typing import NamedTuple


class Layout(NamedTuple):
    """How a layout is recognised.

    Parameters
    ----------
    pattern : str
        What a path in it matches, as `Path.glob` takes it; relative to the folder that was given.
    advice : str
        What it is, and what to do.
    """

    pattern: str
    advice: str


_UNSYNCED = (
    "unsynchronised drives (_extract), whose images are neither rectified nor taken together with the scans: fetch the "
    "archives whose names end in _sync"
)

LAYOUTS = (
    Layout("*/*_drive_*_extract", _UNSYNCED),
    Layout("*_drive_*_extract", _UNSYNCED),
    Layout("*_drive_*_sync", "the drives of one day: give the folder above it, which holds the dates"),
    Layout("velodyne_points", "one drive: give the folder two levels above it, which holds the dates"),
    Layout("*/*/*_drive_*_sync", "a folder above the one that holds the dates: give that one"),
    Layout("sequences/*/velodyne", "KITTI odometry or SemanticKITTI: SemanticKittiSequence reads it, from Python"),
    Layout("sequences/*/image_2", "KITTI odometry: fetch its scans too, or the raw drives"),
    Layout("training/velodyne", "KITTI tracking or object detection: KittiTrackingRun reads tracking, from Python"),
    Layout("data_3d_raw", "KITTI-360, which keeps calibration and times in other files: it has no reader here"),
    Layout("v1.0-*", "nuScenes, which keeps scans and calibration in other files: it has no reader here"),
)
"""The layouts that are mistaken for KITTI's raw one, the surest sign first."""


def what_is(folder: Path) -> str:
    """Say what a folder is that holds no drives in KITTI's raw layout where they are looked for.

    Parameters
    ----------
    folder : Path
        The folder that was given in the place of the one that holds the dates.

    Returns
    -------
    str
        What it looks like and what to do, one of the advices of `LAYOUTS`; empty when it looks like none of them.
    """
    return next((layout.advice for layout in LAYOUTS if any(folder.glob(layout.pattern))), "")

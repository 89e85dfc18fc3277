"""Folder layouts that are mistaken for KITTI's raw layout, and what to do about each."""

from pathlib import Path

_UNSYNCED = (
    "unsynchronised drives (_extract), whose images are neither rectified nor taken together with the scans: fetch the "
    "archives whose names end in _sync"
)

FROM_BAG = (
    "a bag of ROS: first type semgrid-edu data from-bag BAG DIR --image TOPIC --points TOPIC --odometry TOPIC "
    "--lidar-height METRES"
)
"""What to do about a recording of ROS."""

BAGS = (".bag", ".db3", ".mcap")
"""How the names of its files end."""

LAYOUTS = {
    "*/*_drive_*_extract": _UNSYNCED,
    "*_drive_*_extract": _UNSYNCED,
    "*_drive_*_sync": "the drives of one day: give the folder above it, which holds the dates",
    "velodyne_points": "one drive: give the folder two levels above it, which holds the dates",
    "*/*/*_drive_*_sync": "a folder above the one that holds the dates: give that one",
    "sequences/*/velodyne": "KITTI odometry or SemanticKITTI: SemanticKittiSequence reads it, from Python",
    "sequences/*/image_2": "KITTI odometry: fetch its scans too, or the raw drives",
    "training/velodyne": "KITTI tracking or object detection: KittiTrackingRun (semgrid_edu.workshop.paper.datasets) "
    "reads tracking, from Python",
    "data_3d_raw": "KITTI-360, which keeps calibration and times in other files: it has no reader here",
    "v1.0-*": "nuScenes, which keeps scans and calibration in other files: it has no reader here",
    **{f"*{suffix}": FROM_BAG for suffix in BAGS},
}
"""Advice for a folder that matches a pattern of `Path.glob`; the surest sign comes first."""


def what_is(folder: Path) -> str:
    """Identify the layout of a folder without drives in KITTI's raw layout, and say what to do about it.

    Parameters
    ----------
    folder : Path
        The folder that was given instead of the folder with the dates.

    Returns
    -------
    str
        One of the texts of `LAYOUTS`; empty if none fits.
    """
    return next((advice for pattern, advice in LAYOUTS.items() if any(folder.glob(pattern))), "")

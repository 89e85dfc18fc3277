"""What is doubtful about a drive and can be seen without reading its scans: its layout, sizes of files, and poses."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.readers.oxts import mercator_pose, mercator_scale
from semgrid_edu.errors import DataError

SHORT_SCAN = 0.6
"""A scan smaller than this share of the drive's median scan was probably cut short: sound ones differ less."""

FEWEST_RETURNS = 100
"""Any scan of a street has this many returns, even that of a LIDAR with 16 beams."""

RETURN = 16
"""Bytes of a return on disk: four floats."""

FASTEST = 100.0
"""Metres per second. No car drives faster."""

_UNSYNCED = (
    "unsynchronised drives (_extract), whose images are neither rectified nor taken together with the scans: fetch the "
    "archives whose names end in _sync"
)

LAYOUTS = {
    "*/*_drive_*_extract": _UNSYNCED,
    "*_drive_*_extract": _UNSYNCED,
    "*_drive_*_sync": "the drives of one day: give the folder above it, which holds the dates",
    "velodyne_points": "one drive: give the folder two levels above it, which holds the dates",
    "*/*/*_drive_*_sync": "a folder above the one that holds the dates: give that one",
    "sequences/*/velodyne": "KITTI odometry or SemanticKITTI: SemanticKittiSequence reads it, from Python",
    "sequences/*/image_2": "KITTI odometry: fetch its scans too, or the raw drives",
    "training/velodyne": "KITTI tracking or object detection: KittiTrackingRun reads tracking, from Python",
    "data_3d_raw": "KITTI-360, which keeps calibration and times in other files: it has no reader here",
    "v1.0-*": "nuScenes, which keeps scans and calibration in other files: it has no reader here",
}
"""What is mistaken for KITTI's raw layout, and what to do, by a pattern for `Path.glob`; the surest sign first."""


def short_scans(paths: Iterable[Path]) -> list[str]:
    """Name the scans that were probably cut short: much smaller than the drive's median scan, or all but empty.

    Parameters
    ----------
    paths : iterable of Path
        The files of a drive's scans; those that are missing don't count.

    Returns
    -------
    list of str
        One line for each such scan.
    """
    sizes = {path: path.stat().st_size for path in paths if path.is_file()}
    median = np.median(list(sizes.values())) if sizes else 0
    about, least = f"a scan about as large as the drive's others, {median:g} bytes", FEWEST_RETURNS * RETURN
    short = [DataError(path, about, size) for path, size in sizes.items() if least <= size < SHORT_SCAN * median]
    tiny = [
        DataError(path, f"a scan of at least {FEWEST_RETURNS} points", size // RETURN)
        for path, size in sizes.items()
        if 0 < size < least and size % RETURN == 0  # else the reader names it
    ]
    return [str(error) for error in (*tiny, *short)]


def jumps(packets: Mapping[Path, NDArray], seconds: NDArray) -> list[str]:
    """Name the packets whose place no car can have reached since the packet before.

    Parameters
    ----------
    packets : mapping of Path to (30,) float
        The packets of a drive, in order, from `read_packet`.
    seconds : (N,) float
        Time of each packet; steps that aren't positive or not known don't count.

    Returns
    -------
    list of str
        One line for each such packet.
    """
    if len(packets) < 2:
        return []
    scale = mercator_scale(next(iter(packets.values())))
    places = np.array([mercator_pose(packet, scale)[:3, 3] for packet in packets.values()])
    metres, steps = np.linalg.norm(np.diff(places, axis=0), axis=1), np.diff(seconds)
    with np.errstate(invalid="ignore"):
        too_far = (steps > 0) & (metres > FASTEST * steps)
    return [
        str(DataError(path, f"a place within {FASTEST * step:.0f} m of the packet before", f"{far:.0f} m"))
        for path, far, step, wrong in zip(list(packets)[1:], metres, steps, too_far, strict=True)
        if wrong
    ]


def what_is(folder: Path) -> str:
    """Say what a folder looks like in which no drives in KITTI's raw layout were found, and what to do.

    Parameters
    ----------
    folder : Path
        The folder that was given in the place of the one that holds the dates.

    Returns
    -------
    str
        One of the texts of `LAYOUTS`; empty when it looks like none of them.
    """
    return next((advice for pattern, advice in LAYOUTS.items() if any(folder.glob(pattern))), "")

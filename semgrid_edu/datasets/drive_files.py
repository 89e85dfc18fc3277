"""What folders of drives are like: missing scans, clips, JPEGs, and layouts that are mistaken for KITTI's raw one."""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.frame import Frame

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG")
"""How the names of photographs may end."""

T = TypeVar("T")

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


class DriveFiles:
    """The files of a drive, as far as a reader knows them. `k` counts the frames from 0, also in a clip."""

    folder: Path
    poses_file = ""
    _numbers: Sequence[int] | None = None

    @property
    def numbers(self) -> Sequence[int]:
        """The number of each frame in the names of its files; a clip cut from a drive may begin at 100."""
        return range(len(self)) if self._numbers is None else self._numbers

    def scan_file(self, k: int) -> Path | None:
        """Return the file of a frame's scan, whether it exists or not; None for a reader that doesn't know it.

        Parameters
        ----------
        k : int
            The frame.
        """
        return None

    def image_file(self, k: int) -> Path | None:
        """Return the file of a frame's image, or None. Parameters are those of `DriveFiles.scan_file`."""
        return None

    @cached_property
    def gaps(self) -> tuple[int, ...]:
        """The frames without a scan: they have no points, so the filter only predicts. No frame if no scan is there."""
        files = [self.scan_file(k) for k in range(len(self))]
        missing = tuple(k for k, file in enumerate(files) if file is not None and not os.path.lexists(file))
        return missing if len(missing) < len(files) else ()

    def packets(self) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
        """Return the readable GPS packets, (30,), by where they are, and their times, (N,) seconds, where known."""
        return {}, np.empty(0)

    def path(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return poses, (N, 4, 4) T_world_from_vehicle with x forward, and their times, (N,) seconds.

        None for a drive with packets, or whose reader doesn't say.
        """
        return np.empty((0, 4, 4)), np.empty(0)

    def pose_name(self, k: int) -> str:
        """Return where pose k of the path is. Parameters are those of `DriveFiles.scan_file`."""
        return f"{self.folder / self.poses_file}, pose {k}"


def numbers_in(folder: Path, suffixes: Sequence[str], digits: int = 6) -> set[int]:
    """Return the numbers of files with names such as 000000.png; none if there is no such folder.

    Parameters
    ----------
    folder : Path
        The folder with one file per frame; files of some frames may be missing.
    suffixes : sequence of str
        The ends of their names, such as ".png".
    digits : int
        Number of digits in a name.
    """
    form = re.compile(rf"([0-9]{{{digits}}})({'|'.join(map(re.escape, suffixes))})")
    names = (path.name for path in folder.iterdir()) if folder.is_dir() else ()
    return {int(match[1]) for match in map(form.fullmatch, names) if match}


def frame_numbers(folder: Path, what: str, suffixes: Sequence[str], digits: int = 6) -> tuple[int, ...]:
    """Return the numbers of files with names such as 000000.png, in ascending order; an error if there is none.

    Parameters not named here are those of `numbers_in`.

    Parameters
    ----------
    what : str
        What the files contain, such as "images", for the error.
    """
    numbers = sorted(numbers_in(folder, suffixes, digits))
    if not numbers:
        raise DataError(folder, f"{what} such as {0:0{digits}}{suffixes[0]}", what_is_in(folder))
    return tuple(numbers)


def what_is_in(folder: Path) -> str:
    """Return what is in a folder in place of what was expected, for an error.

    Parameters
    ----------
    folder : Path
        The folder, whether it exists or not.
    """
    if not folder.is_dir():
        return "no folder"
    names = sorted(path.name for path in folder.iterdir())
    return f"none, but {len(names)} others, such as {names[0]}" if names else "none"


def photograph(folder: Path, stem: str, suffixes: Sequence[str] = IMAGE_SUFFIXES) -> Path:
    """Return the file of an image, whatever its format; with the first suffix if there is none.

    Parameters
    ----------
    folder : Path
        The folder of the images.
    stem : str
        The file's name without its end, such as "000000".
    suffixes : sequence of str
        The ends that the name may have, the usual one first.
    """
    files = [folder / f"{stem}{suffix}" for suffix in suffixes]
    return next((file for file in files if os.path.lexists(file)), files[0])


def lines_of(path: Path, lines: Sequence[T], numbers: Sequence[int], or_more: bool = False) -> Sequence[T]:
    """Return the line of each frame, from a file with one line a frame, of the clip or of the drive it was cut from.

    Parameters
    ----------
    path : Path
        The file, for the error.
    lines : sequence
        Its lines.
    numbers : sequence of int
        The number of each frame, without gaps.
    or_more : bool
        Whether the file of a drive that begins at 0 may be longer.
    """
    if len(lines) > numbers[-1] and (numbers[0] > 0 or or_more):
        return lines[numbers[0] : numbers[-1] + 1]
    if len(lines) != len(numbers):
        raise DataError(path, f"{'at least ' * or_more}{len(numbers)} lines, one per frame", f"{len(lines)}")
    return lines


def first_sound(read: Callable[[int], T], numbers: Iterable[int]) -> T:
    """Return what can be read of the first frame that is sound; if none is, raise the first one's error.

    Parameters
    ----------
    read : callable
        Reads something of frame k.
    numbers : iterable of int
        The frames.
    """
    first = None
    for k in numbers:
        try:
            return read(k)
        except DataError as error:
            first = first or error
    raise first


def sound_frames(
    drive: Sequence[Frame], numbers: Iterable[int], skipped: Callable[[int, DataError], None] | None = None
) -> Iterator[Frame]:
    """Read frames one by one; the damaged ones are left out, so that the filter predicts a little longer.

    Parameters
    ----------
    drive : sequence of Frame
        The drive.
    numbers : iterable of int
        The frames to read.
    skipped : callable, optional
        Is called with each frame that is left out, and its error. Without it, a damaged frame raises its error.

    Yields
    ------
    Frame
        Each frame that can be read.

    Raises
    ------
    DataError
        When a frame can't be read, and `skipped` isn't given or no frame at all can be read.
    """
    first = None
    any_sound = False
    for k in numbers:
        try:
            frame = drive[k]
        except DataError as error:
            if skipped is None:
                raise
            first = first or error
            skipped(k, error)
            continue
        any_sound = True
        yield frame
    if first is not None and not any_sound:
        raise first


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

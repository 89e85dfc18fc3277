"""What is doubtful about a drive, as its layout, sizes of files, poses and a few of its frames show it at once."""

import filecmp
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import project, transform_points
from semgrid_edu.datasets.readers.oxts import mercator_pose, mercator_scale
from semgrid_edu.errors import DataError
from semgrid_edu.frame import Frame

LIDAR_RANGE = 250.0
"""Largest coordinate of a return, metres. KITTI's HDL-64E sees 120 m, so what lies twice as far is no measurement."""

SHORT_SCAN = 0.6
"""A scan smaller than this share of the drive's median scan was probably cut short: sound ones differ less."""

FEWEST_RETURNS = 100
"""Any scan of a street has this many returns, even that of a LIDAR with 16 beams."""

RETURN = 16
"""Bytes of a return on disk: four floats."""

FASTEST = 100.0
"""Metres per second. No car drives faster."""

LEVEL = (0.5, 0.05)
"""How far the ground may lie above or below its level under the vehicle: metres, and metres per metre of distance."""

FEWEST_ON_GROUND = 0.05
"""The smallest share of a street's returns near the level of the ground: 0.7 to 0.9 in KITTI and in the sample."""

MISTAKES: dict[str, Callable[[NDArray], NDArray]] = {
    "are they in kilometres?": lambda points: 1000 * points,
    "are they in millimetres?": lambda points: points / 1000,
    "are they in camera axes (x right, y down, z ahead)?": lambda points: points[:, [2, 0, 1]] * (1, -1, -1),
    "were three columns read as four?": lambda points: points.ravel()[: points.size // 3 * 3].reshape(-1, 3),
}
"""Changes of the returns (N, 4) that undo a common mistake, by the question to ask when one puts them on the ground."""

LIKELY = 0.4
"""A mistake is named when undoing it puts at least this share of the returns on the ground, and 1.5 times as many."""

FEWEST_SEEN = 1e-3
"""The smallest share of a street's returns that lie ahead, or in the image: 0.14 to 0.26 in KITTI and in the sample."""

CONTRAST = 8
"""An image in each of whose channels the levels differ by no more than this shows nothing."""

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


def frame_doubts(
    frames: Sequence[Frame], place: object = "frames", read: Callable[[int], Frame] | None = None
) -> list[str]:
    """Say what can't be right about three pairs of successive frames: the first, one in the middle and the last.

    The ground lies about a LIDAR's height below it, some returns lie ahead and in the image, the image shows something,
    and no scan or image is that of the frame before. What can't be read is an error of its frame, and no doubt.

    Parameters
    ----------
    frames : sequence of Frame
        The frames of a drive.
    place : object
        What the lines begin with: the folder of the drive, or the name of the argument.
    read : callable, optional
        Reads frame k where that is quicker than `frames[k]`, for example without labels.

    Returns
    -------
    list of str
        One line for each kind of doubt, which names the first of these frames that gives rise to it.
    """
    found: dict[str, str] = {}
    read, n = read or frames.__getitem__, len(frames)
    for k in sorted({0, n // 2, max(n - 2, 0)} & set(range(n))):
        with suppress(DataError):
            for expected, what in _doubts_of(read, k, n):
                found.setdefault(expected, f"{what} (frame {k})")
    return [str(DataError(place, expected, what)) for expected, what in found.items()]


def repeats(paths: Iterable[Path], what: str) -> list[str]:
    """Name each file, anywhere in a drive, from which on files are equal to the one before them.

    Parameters
    ----------
    paths : iterable of Path
        The files of one sensor in order; those that are missing are passed over.
    what : str
        What the files hold, in the plural.

    Returns
    -------
    list of str
        One line for each run of such files, which names the first and the last.
    """
    found = []
    for same, run in groupby(pairwise(path for path in paths if path.is_file()), key=_equal):
        (before, first), (_, last) = (pairs := list(run))[0], pairs[-1]
        if same:
            found.append(str(DataError(first, f"{what} that differ", f"{before.name} again, up to {last.name}")))
    return found


def _equal(pair: tuple[Path, Path]) -> bool:
    """Whether two files hold the same; what gzip packed is compared by the checksum and the length at its end."""
    if pair[0].suffix == ".gz":
        return len({path.read_bytes()[-8:] for path in pair}) == 1
    return filecmp.cmp(*pair, shallow=False)


def _doubts_of(read: Callable[[int], Frame], k: int, n_frames: int) -> Iterator[tuple[str, str]]:
    """Yield what was expected of frame k, and what was found."""
    frame = read(k)
    R, image = frame.camera.T_camera_from_lidar[:3, :3], frame.image
    if not R[1, 2] < -0.5:
        found = "the identity" if np.allclose(R, np.eye(3)) else R.round(3).tolist()
        yield "a rotation from LIDAR to camera that turns up (z) into up (-y)", found
    elif len(frame.points):
        yield from _scan_doubts(frame)
    if image is not None and np.ptp(image, axis=(0, 1)).max() <= CONTRAST:
        yield "an image that shows something", f"one colour, all levels from {image.min()} to {image.max()}"
    if k + 1 < n_frames:
        after = read(k + 1)
        if len(frame.points) and np.array_equal(frame.points, after.points):
            yield "scans that differ", "the same scan again in the next frame"
        if image is not None and np.array_equal(image, after.image):
            yield "images that differ", "the same image again in the next frame"


def _scan_doubts(frame: Frame) -> Iterator[tuple[str, str]]:
    """Yield the first doubt about a scan: only zeros, no ground where it should lie, nothing ahead or in the image."""
    points, height = frame.points, frame.camera.lidar_height
    if not points[:, :3].any():
        yield "returns from places around the LIDAR", "only zeros"
        return
    share, n = _on_ground(points, height), len(points)
    other, mistake = max((_on_ground(undo(points), height), ask) for ask, undo in MISTAKES.items())
    half = f"half of them lie below z = {np.median(points[:, 2]):.3g} m"
    hint = mistake if other > max(LIKELY, 1.5 * share) else half if share < FEWEST_ON_GROUND else ""
    in_image = project(transform_points(frame.camera.T_camera_from_lidar, points[:, :3]), frame.camera)[1]
    if hint:
        yield f"ground about {height:.3g} m below the LIDAR", f"{share:.0%} of the returns near there: {hint}"
    elif (points[:, 0] > 0).mean() < FEWEST_SEEN:
        yield "returns ahead of the LIDAR (x > 0)", f"{np.sum(points[:, 0] > 0)} of {n}: do all lie behind?"
    elif in_image.mean() < FEWEST_SEEN:
        yield "returns in the image", f"{in_image.sum()} of {n}: is the calibration that of this camera?"


def _on_ground(points: NDArray, height: float) -> float:
    """Return the share of returns (N, 3+) in range and near the ground, which lies `height` metres below the LIDAR."""
    distance = np.hypot(points[:, 0], points[:, 1])
    near = np.abs(points[:, 2] + height) < LEVEL[0] + LEVEL[1] * distance
    return float(np.mean(near & (distance < LIDAR_RANGE)))


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

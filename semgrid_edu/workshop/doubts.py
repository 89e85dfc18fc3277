"""Data that can be read but can't be right: frozen sensors, wrong units or axes, jumping poses, scans cut short."""

import filecmp
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import project, transform_points
from semgrid_edu.datasets.frames import LIDAR_RANGE, FrameSequence
from semgrid_edu.errors import DataError
from semgrid_edu.frame import Frame
from semgrid_edu.occupancy.sensor import edge_of_splits
from semgrid_edu.workshop.pose_doubts import packet_doubts, path_doubts

SHORT_SCAN = 0.6
"""A scan smaller than this fraction of the drive's median scan was probably cut short: sound ones differ less."""

FEWEST_RETURNS = 100
"""Any scan of a street has this many returns, even that of a LIDAR with 16 beams."""

RETURN_BYTES = 16
"""Size of a return on disk: four floats."""

LEVEL = (0.5, 0.05)
"""How far the ground may be above or below its level under the vehicle: metres, and metres per metre of distance."""

FEWEST_ON_GROUND = 0.05
"""The smallest plausible fraction of returns near the level of the ground: 0.7 to 0.9 in KITTI and in the sample."""

MISTAKES: dict[str, Callable[[NDArray, float], NDArray]] = {
    "are they in kilometres?": lambda points, _: 1000 * points,
    "are they in millimetres?": lambda points, _: points / 1000,
    "are they in camera axes (x right, y down, z ahead)?": lambda points, _: points[:, [2, 0, 1]] * (1, -1, -1),
    "does y point up, as in computer graphics?": lambda points, _: points[:, [2, 0, 1]] * (-1, -1, 1),
    "does z point down?": lambda points, _: points[:, :3] * (1, -1, -1),
    "does x point up?": lambda points, _: points[:, [1, 2, 0]],
    "does x point down?": lambda points, _: points[:, [1, 2, 0]] * (1, -1, -1),
    "is z the height above the ground?": lambda points, height: points[:, :3] - (0, 0, height),
    "were three columns read as four?": lambda points, _: _in_columns(points, 3),
    "were five columns read as four?": lambda points, _: _in_columns(points, 5),
    "were six columns read as four?": lambda points, _: _in_columns(points, 6),
}
"""How to undo common mistakes on the returns (N, 4), given the LIDAR's height above the ground, metres.

If undoing one puts the returns on the ground, its question is asked."""

LIKELY = 0.4
"""A mistake is named if fewer than this fraction of returns are on the ground, and undoing it puts more there.

It has to put at least 1.5 times as many there."""

SHARP_LEVEL = (0.2, 0.01)
"""Like `LEVEL`, but for telling mistakes apart: the true ground is sharper than a slice of the walls at that height,
and nothing is below it."""

ALIKE = 0.97
"""Two mistakes fit alike if undoing one makes the ground at least this part as clear as undoing the other."""

NEAREST = 1.0
"""Returns closer than this don't count, metres: else a scan in kilometres, whose z is moved, would be on the ground."""

BRIGHTEST = 1.01
"""Reflectances above this aren't fractions."""

FEWEST_SEEN = 1e-3
"""The smallest plausible fraction of returns ahead, or in the image: 0.14 to 0.26 in KITTI and in the sample."""

CONTRAST = 8
"""An image whose levels differ by no more than this in every channel shows nothing."""


def drive_doubts(drive: FrameSequence) -> list[str]:
    """List what is doubtful about a drive: its files, as far as the reader is known, and a few of its frames.

    Parameters
    ----------
    drive : FrameSequence
        The drive.

    Returns
    -------
    list of str
        One line for each doubt, which names the file or folder: missing and short scans, files that repeat the one
        before, poses that no car can have (`pose_doubts`), and the doubts of `frame_doubts`.
    """
    files = getattr(drive, "drive", drive)  # a `ZhangDrive` adds labels to the files of another drive
    return [*_file_doubts(files), *_pose_doubts(files), *frame_doubts(drive, drive.folder, drive.without_labels)]


def _file_doubts(drive: FrameSequence) -> list[str]:
    scans = [file for k in range(len(drive)) if (file := drive.scan_file(k))]
    images = [file for k in range(len(drive)) if (file := drive.image_file(k))]
    gaps = [DataError(drive.scan_file(k), "a scan", "none: the filter predicts over the gap") for k in drive.gaps]
    spacing = min(np.diff(drive.numbers), default=1)
    expected = f"an image, since there is one every {spacing} frames"
    for number in sorted(set(range(drive.numbers[0], drive.numbers[-1], spacing)) - set(drive.numbers)):
        gaps.append(DataError(drive.image_file(0).with_stem(f"{number:02d}"), expected, "none"))
    short = short_scans(scan for scan in scans if scan.suffix == ".bin")
    return [*map(str, gaps), *repeats(scans, "scans"), *repeats(images, "images"), *short]


def _pose_doubts(drive: FrameSequence) -> list[str]:
    """Check the poses of a drive; what can't be read is an error, not a doubt."""
    try:
        packets, seconds = drive.packets()
        if packets:
            return packet_doubts(packets, seconds)
        poses, seconds = drive.path()
    except DataError:
        return []
    return path_doubts(poses, seconds, [drive.pose_name(k) for k in range(len(poses))])


def short_scans(paths: Iterable[Path]) -> list[str]:
    """Name the scans that were probably cut short: much smaller than the drive's median scan, or almost empty.

    Parameters
    ----------
    paths : iterable of Path
        The files of a drive's scans; missing ones are skipped.

    Returns
    -------
    list of str
        One line for each such scan.
    """
    sizes = {path: path.stat().st_size for path in paths if path.is_file()}
    median = np.median(list(sizes.values())) if sizes else 0
    fewest_bytes = FEWEST_RETURNS * RETURN_BYTES
    found = []
    for path, size in sizes.items():
        if size < fewest_bytes:
            if size > 0 and size % RETURN_BYTES == 0:  # otherwise the reader raises an error
                expected = f"a scan of at least {FEWEST_RETURNS} points"
                found.append(str(DataError(path, expected, size // RETURN_BYTES)))
        elif size < SHORT_SCAN * median:
            found.append(str(DataError(path, f"a scan about as large as the drive's others, {median:g} bytes", size)))
    return found


def repeats(paths: Iterable[Path], what: str) -> list[str]:
    """Name every run of files, anywhere in a drive, that are equal to the file before them.

    Parameters
    ----------
    paths : iterable of Path
        The files of one sensor in order; missing ones are skipped.
    what : str
        What the files hold, in the plural.

    Returns
    -------
    list of str
        One line for each run, which names its first and its last file.
    """
    found = []
    pairs = pairwise(path for path in paths if path.is_file())
    for equal, run in groupby(pairs, key=_equal):
        if equal:
            run = list(run)
            before, first = run[0]
            last = run[-1][1]
            found.append(str(DataError(first, f"{what} that differ", f"{before.name} again, up to {last.name}")))
    return found


def _equal(pair: tuple[Path, Path]) -> bool:
    """Compare two files; gzip files by the checksum and the length at their end, since their headers have a date."""
    if pair[0].suffix == ".gz":
        return pair[0].read_bytes()[-8:] == pair[1].read_bytes()[-8:]
    return filecmp.cmp(*pair, shallow=False)


def frame_doubts(
    frames: Sequence[Frame], place: object = "frames", read: Callable[[int], Frame] | None = None
) -> list[str]:
    """List what can't be right about three pairs of successive frames: the first, one in the middle and the last.

    The ground is about a LIDAR's height below it, some returns are ahead and in the image, the image shows something,
    and no scan or image repeats the one before. Frames that can't be read are skipped.

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
        One line for each kind of doubt, which names the first of these frames that causes it.
    """
    read = read or frames.__getitem__
    n = len(frames)
    found: dict[str, str] = {}
    for k in sorted({0, n // 2, max(n - 2, 0)} & set(range(n))):
        with suppress(DataError):
            for expected, what in _doubts_of(read, k, n):
                found.setdefault(expected, f"{what} (frame {k})")
    return [str(DataError(place, expected, what)) for expected, what in found.items()]


def _doubts_of(read: Callable[[int], Frame], k: int, n_frames: int) -> Iterator[tuple[str, str]]:
    """Yield what was expected of frame k, and what was found."""
    frame = read(k)
    R = frame.camera.T_camera_from_lidar[:3, :3]
    image = frame.image
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
    """Yield the first doubt about a scan: only zeros, no ground where it should be, nothing ahead or in the image."""
    points = frame.points
    height = frame.camera.lidar_height
    n = len(points)
    if not points[:, :3].any():
        yield "returns from places around the LIDAR", "only zeros"
        return
    on_ground = _on_ground(points, height)
    hint = ""
    if on_ground < LIKELY:
        clear = {question: _ground_clarity(undo(points, height), height) for question, undo in MISTAKES.items()}
        # Of questions that fit alike, the first: every second point of a scan with three columns fits six, too.
        best = max(*clear.values(), 0.0)
        question = next((question for question, value in clear.items() if value >= ALIKE * best), "")
        undone = _on_ground(MISTAKES[question](points, height), height) if question else 0.0
        if undone > LIKELY and undone > 1.5 * on_ground and best > _ground_clarity(points, height):
            hint = question
    if not hint and on_ground < FEWEST_ON_GROUND:
        hint = f"half of them lie below z = {np.median(points[:, 2]):.3g} m"
    strongest = np.abs(points[:, 3]).max()
    if not hint and (strongest > BRIGHTEST or points[:, 3].min() < 0):
        found = f"{points[:, 3].min():.3g} to {points[:, 3].max():.3g}"
        yield "reflectances from 0 to 1", f"{found}: are they bytes?" if strongest <= 255 else found
    if frame.vehicle_returns is None and not edge_of_splits(points, edge=1.0):  # the filter's own rule
        dark = np.mean(points[:, 3] == 0)
        found = f"0 for {dark:.0%} of them: beams that the vehicle's own edge splits can't be told from obstacles"
        yield "returns with a reflectance", found
    in_image = project(transform_points(frame.camera.T_camera_from_lidar, points[:, :3]), frame.camera)[1]
    if hint:
        yield f"ground about {height:.3g} m below the LIDAR", f"{on_ground:.0%} of the returns near there: {hint}"
    elif (points[:, 0] > 0).mean() < FEWEST_SEEN:
        yield "returns ahead of the LIDAR (x > 0)", f"{np.sum(points[:, 0] > 0)} of {n}: do all lie behind?"
    elif in_image.mean() < FEWEST_SEEN:
        yield "returns in the image", f"{in_image.sum()} of {n}: is the calibration that of this camera?"


def _in_columns(points: NDArray, n_columns: int) -> NDArray:
    """Return the numbers of a scan in rows of another length."""
    return points.ravel()[: points.size // n_columns * n_columns].reshape(-1, n_columns)


def _on_ground(points: NDArray, height: float) -> float:
    """Return the fraction of returns (N, 3+) in range and near the ground, `height` metres below the LIDAR."""
    return _near_and_below(points, height, LEVEL)[0]


def _ground_clarity(points: NDArray, height: float) -> float:
    """Return the fraction of returns on a sharp ground less the fraction below it, where nothing can be."""
    on_ground, below = _near_and_below(points, height, SHARP_LEVEL)
    return on_ground - below


def _near_and_below(points: NDArray, height: float, level: tuple[float, float]) -> tuple[float, float]:
    """Return the fractions of returns (N, 3+) in range that are near the ground, and below it."""
    if not len(points):
        return 0.0, 0.0
    distance = np.hypot(points[:, 0], points[:, 1])
    in_range = (distance > NEAREST) & (distance < LIDAR_RANGE)
    tolerance = level[0] + level[1] * distance
    above = points[:, 2] + height
    return float(np.mean(in_range & (np.abs(above) < tolerance))), float(np.mean(in_range & (above <= -tolerance)))

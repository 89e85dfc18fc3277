"""Checks that every drive should pass before use: time stamps, calibration, the ground, the vehicle's motion."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from semgrid_edu.camera import Camera, project, rigid_transform, transform_points
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.oxts import read_timestamps
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.workshop.course.street import motion_between, standing_points

LANE = (3.0, 20.0, 1.5)
"""Where the ground of the vehicle's own lane is looked for: from and to this far ahead, and to each side, metres."""
GROUND_ERROR = 0.1
"""A return further than this from the fitted ground isn't part of it, metres."""


def time_gaps(times: ArrayLike, factor: float = 1.5) -> NDArray[np.int64]:
    """Find where frames are missing: steps of time that are much longer than the drive's median step.

    Parameters
    ----------
    times : (N,) float
        Time of each frame, seconds, N > 1.
    factor : float
        A step of more than this many medians is a gap.

    Returns
    -------
    (n,) int64
        k for each gap between frame k and frame k + 1.

    Raises
    ------
    ArgumentError
        When there are fewer than two times, or time doesn't increase.

    Examples
    --------
    >>> time_gaps([0.0, 0.1, 0.2, 0.4, 0.5])
    array([2])
    """
    steps = np.diff(np.asarray(times, dtype=np.float64))
    if steps.ndim != 1 or len(steps) == 0 or steps.min() <= 0:
        raise ArgumentError("times", "two or more seconds that increase", times)
    return np.flatnonzero(steps > factor * np.median(steps))


def sensor_delays(drive: KittiRawDrive) -> dict[str, NDArray[np.float64]]:
    """Return each sensor's delay after the scan, for each frame.

    Parameters
    ----------
    drive : KittiRawDrive
        A drive; its files of time stamps are read.

    Returns
    -------
    dict of str to (N,) float64
        Seconds, by the names of the sensors' folders; NaN where a time is missing.
    """
    files = sorted(drive.folder.glob("*/timestamps.txt"))
    times = {path.parent.name: read_timestamps(path, len(drive)) for path in files}
    return {name: (at - times["velodyne_points"]) / np.timedelta64(1, "s") for name, at in times.items()}


def share_on_image(points: NDArray, camera: Camera) -> float:
    """Return the share of the returns ahead of the vehicle (x > 0) that fall on the image, 0..1; NaN of none.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the LIDAR frame, metres.
    camera : Camera
        The calibration to check.
    """
    ahead = points[points[:, 0] > 0, :3]
    if len(ahead) == 0:
        return float("nan")
    return float(project(transform_points(camera.T_camera_from_lidar, ahead), camera)[1].mean())


class GroundPlane(NamedTuple):
    """A plane below the LIDAR.

    Parameters
    ----------
    height : float
        Height of the LIDAR above it, metres.
    pitch : float
        How much it rises ahead, degrees.
    roll : float
        How much it rises to the left, degrees.
    """

    height: float
    pitch: float
    roll: float


def ground_plane(points: NDArray, height: float) -> GroundPlane:
    """Fit a plane to the ground of the vehicle's lane by least squares, without the objects on it.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the LIDAR frame, metres.
    height : float
        Height of the LIDAR above the ground as the calibration says, metres: where the search begins.

    Raises
    ------
    ArgumentError
        When fewer than ten returns can be the ground of the lane.
    """
    x, y, z = np.asarray(points[:, :3], dtype=np.float64).T
    start, end, side = LANE
    in_lane = (x > start) & (x < end) & (np.abs(y) < side) & (np.abs(z + height) < 0.05 * x + 3 * GROUND_ERROR)
    if in_lane.sum() < 10:
        raise ArgumentError("points", f"ten or more returns on the ground, {start:g} to {end:g} m ahead", in_lane.sum())
    plane, _ = _robust_plane(x[in_lane], y[in_lane], z[in_lane], 10, GROUND_ERROR)
    return GroundPlane(-plane[0], *np.degrees(np.arctan(plane[1:])))


def _robust_plane(a: NDArray, b: NDArray, c: NDArray, rounds: int, least: float) -> tuple[NDArray, NDArray]:
    """Fit c = p0 + p1 a + p2 b without outliers; return p and the distances of all points."""
    columns = np.column_stack([np.ones(len(a)), a, b])
    kept = np.ones(len(a), np.bool_)
    for _ in range(rounds):
        plane = np.linalg.lstsq(columns[kept], c[kept])[0]
        error = np.abs(c - columns @ plane)
        kept = error < max(least, float(np.median(error)))
    return plane, error


def wall_lean(frame: Frame, box: tuple[float, float, float, float]) -> float:
    """Fit a plane to a wall beside the road, and return the LIDAR's tilt, assuming that the wall is vertical.

    The ground seems to rise to the left both when the street does and when the LIDAR leans to the right. A wall leans
    in the second case alone, by the same angle.

    Parameters
    ----------
    frame : Frame
        Its scan is used, from 1 to 8 m above the ground.
    box : (float, float, float, float)
        The box around the wall: least and largest x, least and largest y, metres.

    Returns
    -------
    float
        Degrees; positive when the ground seems to rise to the left because of it.

    Raises
    ------
    ArgumentError
        When fewer than 100 returns lie in the box, or fewer than half of them within 10 cm of one plane.
    """
    x, y, z = frame.points_grid[:, :3].T.astype(np.float64)
    x_min, x_max, y_min, y_max = box
    inside = (x > x_min) & (x < x_max) & (y > y_min) & (y < y_max) & (z > 1) & (z < 8)
    if inside.sum() < 100:
        raise ArgumentError("box", "a place with 100 or more returns from a wall", f"{inside.sum()} in {box}")
    plane, error = _robust_plane(x[inside], z[inside], y[inside], 30, GROUND_ERROR / 2)
    if (share := (error < GROUND_ERROR).mean()) < 0.5:
        raise ArgumentError("box", "a wall, most of it within 10 cm of a plane", f"{share:.0%} of the returns in {box}")
    return float(np.degrees(np.arctan(-plane[2])))


def with_scan(frames: Sequence[Frame]) -> list[Frame]:
    """Return the frames that have a scan; frames in a gap of a drive have none.

    Parameters
    ----------
    frames : sequence of Frame
        Frames of a drive.
    """
    return [frame for frame in frames if len(frame.points)]


def overlay_error(before: Frame, now: Frame, T_before_from_now: NDArray) -> float:
    """Overlay two scans and return the median distance to the nearest return.

    Most upright things don't move, so a wrong motion makes the median large, but a few moving things don't.

    Parameters
    ----------
    before, now : Frame
        Two frames of a drive.
    T_before_from_now : (4, 4) float
        The motion to try, metres.

    Returns
    -------
    float
        Metres; it isn't 0 for the true motion, because the beams hit other places.
    """
    return _median_distance(KDTree(standing_points(before)), standing_points(now), T_before_from_now)


def _median_distance(before: KDTree, points: NDArray, T_before_from_now: NDArray) -> float:
    return float(np.median(before.query(transform_points(T_before_from_now, points))[0]))


def _in_axes(rotation: ArrayLike) -> Callable[[NDArray], NDArray]:
    """Return a function that expresses a motion in turned or mirrored axes."""
    M = rigid_transform(np.array(rotation, dtype=np.float64), np.zeros(3))
    return lambda T: M @ T @ M.T


AXES: dict[str, Callable[[NDArray], NDArray]] = {
    "as the poses say": lambda T: T,
    "left and right swapped": _in_axes(np.diag([1, -1, 1])),
    "backwards": _in_axes(np.diag([-1, -1, 1])),
    "a quarter turn": _in_axes([[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "no motion": lambda T: np.eye(4),
}
"""Common mistakes with axes, by name: each maps a motion to the wrong one, (4, 4) -> (4, 4)."""


def axes_errors(frames: Sequence[Frame], apart: int = 5, thin: int = 1) -> dict[str, float]:
    """Overlay scans by the motion of the poses, and by the wrong motions that mistakes with axes give.

    Parameters
    ----------
    frames : sequence of Frame
        Successive frames of a drive, more than `apart`.
    apart : int
        How many frames lie between two scans that are compared: a longer way shows a wrong motion better.
    thin : int
        Of the later scan, only each return of this number is looked up: sooner, and nearly the same median.

    Returns
    -------
    dict of str to float
        For each entry of `AXES` the mean over all pairs of frames of `overlay_error`, metres.

    Raises
    ------
    ArgumentError
        When there are too few frames.
    """
    pairs = list(pairwise(frames[::apart])) if apart > 0 else []
    if not pairs:
        raise ArgumentError("apart", f"1 to {len(frames) - 1} for {len(frames)} frames", apart)
    errors = []
    for before, now in pairs:
        tree = KDTree(standing_points(before))
        points = standing_points(now)[::thin]
        T = motion_between(before, now)
        errors.append([_median_distance(tree, points, mistake(T)) for mistake in AXES.values()])
    return dict(zip(AXES, np.mean(errors, axis=0).tolist(), strict=True))

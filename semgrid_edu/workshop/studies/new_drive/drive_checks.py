"""What every drive should pass before it is used: time stamps, calibration, the ground, its own motion."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_gradient_magnitude, map_coordinates
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.readers.oxts import read_timestamps
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame

LANE = (3.0, 20.0, 1.5)
"""Where the ground of the vehicle's own lane is looked for: from and to this far ahead, and to each side, metres."""
GROUND_ERROR = 0.1
"""A return further than this from the fitted ground isn't part of it, metres."""
ONE_COLUMN = 1.5
"""Two successive returns closer than this, degrees, are neighbours on a ring of the scanner."""
TALL = (0.5, 3.0)
"""Heights above the ground, metres, between which returns come from things that stand up, such as walls and poles."""
NEAREST, FARTHEST = 3.0, 40.0
"""Distances between which returns are compared, metres: beyond, neighbouring beams are too far apart."""


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
    """Return how much later than its scan each sensor took each frame.

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
    """Fit a plane to the ground of the vehicle's own lane, by least squares, leaving out what stands on it.

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
    columns, z = np.column_stack([np.ones(in_lane.sum()), x[in_lane], y[in_lane]]), z[in_lane]
    ground = np.ones(len(z), np.bool_)
    for _ in range(10):
        plane = np.linalg.lstsq(columns[ground], z[ground])[0]
        error = np.abs(z - columns @ plane)
        ground = error < max(GROUND_ERROR, float(np.median(error)))
    return GroundPlane(-plane[0], *np.degrees(np.arctan(plane[1:])))


def depth_edges(points: NDArray, jump: float = 0.5) -> NDArray[np.float64]:
    """Find the returns (n, 3) at the left and right borders of things: the near ones where the distance jumps.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the LIDAR frame, metres, ring by ring as KITTI's files hold them.
    jump : float
        Least difference of distance to the next return on the ring, metres.
    """
    points = np.asarray(points[:, :3], dtype=np.float64)
    distance = np.linalg.norm(points, axis=1)
    direction = points / np.maximum(distance, 1e-6)[:, None]
    neighbours = (direction[1:] * direction[:-1]).sum(axis=1) > np.cos(np.radians(ONE_COLUMN))
    nearer, edge = np.diff(distance) * neighbours, np.zeros(len(points), np.bool_)
    edge[1:] |= nearer < -jump
    edge[:-1] |= nearer > jump
    return points[edge]


def with_scan(frames: Sequence[Frame]) -> list[Frame]:
    """Return the frames that have a scan; frames in a gap of a drive have none.

    Parameters
    ----------
    frames : sequence of Frame
        Frames of a drive.
    """
    return [frame for frame in frames if len(frame.points)]


def edge_contrast(frame: Frame, yaws: ArrayLike) -> NDArray[np.float64]:
    """Return how much the image changes where the scan has borders of things, for a camera turned to and fro.

    With the right calibration a border in the scan falls on a border in the image (Levinson and Thrun, RSS 2013).
    The scan's rings run sideways, so this checks the camera's yaw, and much less its pitch and roll.

    Parameters
    ----------
    frame : Frame
        A frame with an image.
    yaws : (n,) float
        Turns of the camera to try, degrees; 0 is the calibration as it is.

    Returns
    -------
    (n,) float64
        Mean gradient of the image at the borders over its mean gradient everywhere; 1 says that they have nothing
        to do with each other.
    """
    image, camera = frame.need_image(), frame.camera
    gradient = gaussian_gradient_magnitude(image.mean(axis=2), 1.6e-3 * camera.size[1])
    in_camera = transform_points(camera.T_camera_from_lidar, depth_edges(frame.points))
    found = []
    for yaw in np.atleast_1d(yaws):
        turned = in_camera @ Rotation.from_rotvec([0, yaw, 0], degrees=True).as_matrix().T
        pixels, visible = project(turned, camera)
        found.append(map_coordinates(gradient, pixels[visible, ::-1].T, order=1).mean() / gradient.mean())
    return np.array(found)


def standing_points(frame: Frame) -> NDArray[np.float64]:
    """Return the returns from things that stand up, (n, 3), metres in the LIDAR frame; moving cars are among them.

    Parameters
    ----------
    frame : Frame
        Its scan and the LIDAR's height are used.
    """
    height, distance = frame.points_grid[:, 2], np.hypot(*frame.points[:, :2].T)
    chosen = (height > TALL[0]) & (height < TALL[1]) & (distance > NEAREST) & (distance < FARTHEST)
    return frame.points[chosen, :3].astype(np.float64)


def motion_between(before: Frame, now: Frame) -> NDArray[np.float64]:
    """Return the motion of the LIDAR between two frames according to their poses: T_before_from_now, (4, 4), metres.

    Parameters
    ----------
    before, now : Frame
        Two frames of a drive.
    """
    return invert_rigid(before.T_world_from_lidar) @ now.T_world_from_lidar


def overlay_error(before: Frame, now: Frame, T_before_from_now: NDArray) -> float:
    """Lay one scan over another and return how far apart they are: the median distance to the nearest return.

    Most of what stands up doesn't move, so a wrong motion makes the median large, and a few moving things don't.

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
"""What a motion becomes by mistakes that one makes with axes, (4, 4) -> (4, 4), by name."""


def axes_errors(frames: Sequence[Frame], apart: int = 5) -> dict[str, float]:
    """Lay scans over each other by the motion of the poses, and by what mistakes with axes turn it into.

    Parameters
    ----------
    frames : sequence of Frame
        Successive frames of a drive, more than `apart`.
    apart : int
        How many frames lie between two scans that are compared: a longer way shows a wrong motion better.

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
        tree, points, T = KDTree(standing_points(before)), standing_points(now), motion_between(before, now)
        errors.append([_median_distance(tree, points, mistake(T)) for mistake in AXES.values()])
    return dict(zip(AXES, np.mean(errors, axis=0).tolist(), strict=True))

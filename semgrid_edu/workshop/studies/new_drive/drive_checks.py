"""What every drive should pass before anything is made of it: time stamps, calibration, the ground."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_gradient_magnitude, map_coordinates
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, project, transform_points
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
    """Return the share of the returns ahead of the vehicle that fall on the image, 0..1.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the LIDAR frame, metres.
    camera : Camera
        The calibration to check.

    Returns
    -------
    float
        NaN when there is no return ahead (x > 0).
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

    Returns
    -------
    GroundPlane

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
    """Find the returns at the left and right borders of things: the near ones where the distance jumps along a ring.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the LIDAR frame, metres, ring by ring as KITTI's files hold them.
    jump : float
        Least difference of distance, metres.

    Returns
    -------
    (n, 3) float64
        Metres.
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
    """Return the frames that have a scan; those in a gap of a drive have none.

    Parameters
    ----------
    frames : sequence of Frame
        Frames of a drive.

    Returns
    -------
    list of Frame
        In the same order.
    """
    return [frame for frame in frames if len(frame.points)]


def edge_contrast(frame: Frame, yaws: ArrayLike) -> NDArray[np.float64]:
    """Return how much the image changes where the scan has borders of things, for a camera turned to and fro.

    With the right calibration a border in the scan falls on a border in the image (Levinson and Thrun, RSS 2013).
    The scan's rings run sideways, so this tells about the camera's yaw, much less about its pitch and roll.

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

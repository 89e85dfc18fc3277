"""Borders of things in a scan and in its image: with the right calibration they coincide."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_gradient_magnitude, map_coordinates
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import project, transform_points
from semgrid_edu.frame import Frame

ONE_COLUMN = 1.5
"""Two successive returns closer than this, degrees, are neighbours on a ring of the scanner."""
STRIP = 0.2
"""Height of a strip of elevation, degrees, in which returns of a scan that isn't ring by ring are put side by side."""


def ring_by_ring(points: NDArray) -> NDArray:
    """Return a scan in an order in which neighbours on a ring follow each other.

    KITTI's files have this order and stay as they are. PandaSet's are sorted by time: all lasers fire at once, so the
    next line is another laser's. Such returns are sorted by strips of elevation, and within a strip from left to right.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the LIDAR frame, metres.

    Returns
    -------
    (N, 3+) float
        The same returns.
    """
    if len(points) < 2 or _successive_neighbours(points).mean() > 0.5:
        return points
    x, y, z = points[:, :3].T
    strip = np.round(np.degrees(np.arctan2(z, np.hypot(x, y))) / STRIP)
    return points[np.lexsort((-np.arctan2(y, x), strip))]


def _successive_neighbours(points: NDArray) -> NDArray[np.bool_]:
    """Return whether each return but the last and its successor are less than `ONE_COLUMN` apart, (N - 1,)."""
    direction = points[:, :3] / np.maximum(np.linalg.norm(points[:, :3], axis=1), 1e-6)[:, None]
    return (direction[1:] * direction[:-1]).sum(axis=1) > np.cos(np.radians(ONE_COLUMN))


def depth_edges(points: NDArray, jump: float = 0.5) -> NDArray[np.float64]:
    """Find the returns (n, 3) at the left and right borders of things: the near ones where the distance jumps.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the LIDAR frame, metres, in any order, see `ring_by_ring`.
    jump : float
        Least difference of distance to the next return on the ring, metres.
    """
    points = ring_by_ring(np.asarray(points[:, :3], dtype=np.float64))
    distance = np.linalg.norm(points, axis=1)
    nearer = np.diff(distance) * _successive_neighbours(points)
    edge = np.zeros(len(points), np.bool_)
    edge[1:] |= nearer < -jump
    edge[:-1] |= nearer > jump
    return points[edge]


def on_image(borders: NDArray, frame: Frame, yaw: float = 0.0) -> NDArray[np.float64]:
    """Return the pixels (n, 2), columns u and v, of the borders in the image of a camera turned by some degrees.

    Parameters
    ----------
    borders : (m, 3) float
        Places in the LIDAR frame, metres.
    frame : Frame
        Its calibration is used.
    yaw : float
        The turn to the right, degrees; 0 is the calibration as it is.
    """
    in_camera = transform_points(frame.camera.T_camera_from_lidar, borders)
    turned = in_camera @ Rotation.from_rotvec([0, yaw, 0], degrees=True).as_matrix().T
    pixels, visible = project(turned, frame.camera)
    return pixels[visible]


def edge_contrast(
    frame: Frame, yaws: ArrayLike, borders_of: Callable[[NDArray], NDArray] = depth_edges
) -> NDArray[np.float64]:
    """Return how much the image changes where the scan has borders of things, for a camera turned to and fro.

    With the right calibration a border in the scan falls on a border in the image (Levinson and Thrun, RSS 2013).
    The scan's rings run sideways, so this checks the camera's yaw, and much less its pitch and roll.

    Parameters
    ----------
    frame : Frame
        A frame with an image.
    yaws : (n,) float
        Turns of the camera to try, degrees; 0 is the calibration as it is.
    borders_of : callable
        Finds the borders in a scan, as `depth_edges` does.

    Returns
    -------
    (n,) float64
        Mean gradient of the image at the borders over its mean gradient everywhere; 1 says that they have nothing
        to do with each other.
    """
    gradient = gaussian_gradient_magnitude(frame.need_image().mean(axis=2), 1.6e-3 * frame.camera.size[1])
    borders = borders_of(frame.points)
    at = [on_image(borders, frame, yaw)[:, ::-1].T for yaw in np.atleast_1d(yaws)]
    return np.array([map_coordinates(gradient, one, order=1).mean() for one in at]) / gradient.mean()

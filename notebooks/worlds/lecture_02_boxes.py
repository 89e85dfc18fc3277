"""A toy world of upright boxes on flat ground, and an exact LIDAR simulation that takes milliseconds."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT
from semgrid_edu.grid import GridSpec


class Box(NamedTuple):
    """An upright box on the ground.

    Parameters
    ----------
    x_min, x_max, y_min, y_max : float
        Its borders in the world, metres.
    height : float
        Its height above the ground, metres.
    """

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    height: float

    @classmethod
    def around(cls, x: float, y: float, length: float, width: float, height: float) -> "Box":
        """Return a box from its centre and its sides.

        Parameters
        ----------
        x, y : float
            Its centre in the world, metres.
        length, width, height : float
            Its sides along x, y and z, metres.
        """
        return cls(x - length / 2, x + length / 2, y - width / 2, y + width / 2, height)


def scan_boxes(
    boxes: list[Box], x: float = 0.0, y: float = 0.0, yaw: float = 0.0,
    columns: int = 300, rings: int = 64, field: float = 180.0,
    noise: float = 0.0, rng: np.random.Generator | None = None, farthest: float = 70.0,
) -> NDArray[np.float32]:  # fmt: skip
    """Scan boxes on flat ground: each ray ends where it first hits something.

    Parameters
    ----------
    boxes : list of Box
        The objects in the world.
    x, y, yaw : float
        Pose of the vehicle in the world, metres and rad; its LIDAR is as high as KITTI's.
    columns, rings : int
        Numbers of directions: `columns` azimuths over `field` degrees, symmetric about forward, times `rings`
        elevations from -24.8 to 2 degrees.
    field : float
        Horizontal field of view, degrees.
    noise : float
        Standard deviation of a range, metres; needs `rng`.
    rng : numpy.random.Generator, optional
        Source of the noise.
    farthest : float
        Longest range, metres.

    Returns
    -------
    (N, 3) float32
        Returns in the grid frame of the vehicle, metres.

    Examples
    --------
    >>> points = scan_boxes([Box.around(10, 0, 2, 2, 1.5)], columns=1, rings=20)
    >>> points[points[:, 2] > 0.3][:, 0].round(2).tolist()
    [9.0, 9.0, 9.0, 9.0, 9.0]
    """
    azimuth = np.radians((np.arange(columns) + 0.5) / columns * field - field / 2)
    elevation = np.radians(np.linspace(-24.8, 2.0, rings))
    azimuth, elevation = np.meshgrid(azimuth, elevation)
    azimuth = azimuth.ravel()
    elevation = elevation.ravel()
    flat = np.cos(elevation)
    ray = np.stack([flat * np.cos(azimuth + yaw), flat * np.sin(azimuth + yaw), np.sin(elevation)])
    ray[ray == 0] = 1e-12
    start = np.array([[x], [y], [KITTI_LIDAR_HEIGHT]])
    length = np.where(ray[2] < 0, -start[2] / ray[2], np.inf)
    for box in boxes:
        # A ray is in the box from the last entry to the first exit through the three pairs of faces.
        first = (np.array([[box.x_min], [box.y_min], [0]]) - start) / ray
        second = (np.array([[box.x_max], [box.y_max], [box.height]]) - start) / ray
        enters = np.minimum(first, second).max(axis=0)
        leaves = np.maximum(first, second).min(axis=0)
        length = np.where((enters > 0) & (enters < leaves), np.minimum(length, enters), length)
    hit = length < farthest
    length = length[hit] + (rng.normal(0, noise, hit.sum()) if noise else 0)
    points = (start * [[0], [0], [1]] + ray[:, hit] * length).T
    cos = np.cos(yaw)
    sin = np.sin(yaw)
    points[:, :2] = points[:, :2] @ np.array([[cos, -sin], [sin, cos]])
    return points.astype(np.float32)


def cells_in(box: Box, spec: GridSpec, x: float = 0.0, y: float = 0.0, margin: float = 0.0) -> NDArray[np.bool_]:
    """Return which cells have their centres in a box of the world, (H, W).

    Parameters
    ----------
    box : Box
        The box.
    spec : GridSpec
        The grid of a vehicle that looks along the world's x axis.
    x, y : float
        Where the vehicle is in the world, metres.
    margin : float
        By how much the box is widened on every side, metres.
    """
    low = np.array([box.x_min, box.y_min]) - margin
    high = np.array([box.x_max, box.y_max]) + margin
    centre = spec.centers() + np.array([x, y])
    return ((centre > low) & (centre < high)).all(axis=-1)

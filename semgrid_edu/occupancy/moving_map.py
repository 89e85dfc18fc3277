"""A map that scrolls under the vehicle by whole cells, so that memory stays sharp (paper, section 3.2, step 1)."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.cells import cell_of
from semgrid_edu.occupancy.planar_motion import PlanarMotion

MAX_YAW = np.radians(2)
"""The map turns with the vehicle when the vehicle has turned by this angle: a wider one would need a wider margin."""


def map_around(spec: GridSpec, max_yaw: float) -> GridSpec:
    """Return a map that covers the grid around the vehicle, however the vehicle moves before the map scrolls.

    Parameters
    ----------
    spec : GridSpec
        The grid around the vehicle.
    max_yaw : float
        The largest angle between vehicle and map, radians; the vehicle shifts by at most one cell.

    Returns
    -------
    GridSpec
        The map: cells of the same size, with a margin on every side of the grid.
    """
    farthest = np.hypot(max(abs(spec.x_min), abs(spec.x_max)), max(abs(spec.y_min), abs(spec.y_max)))
    margin = (np.ceil(farthest * np.sin(max_yaw) / spec.cell) + 1) * spec.cell
    return GridSpec(spec.x_min - margin, spec.x_max + margin, spec.y_min - margin, spec.y_max + margin, spec.cell)


def scroll(pose: PlanarMotion, cell: float, max_yaw: float) -> tuple[PlanarMotion, PlanarMotion]:
    """Decide how the map follows the vehicle.

    The map shifts by whole cells, which is exact, and the rest of the vehicle's displacement stays in the pose: nothing
    is interpolated. Only when the vehicle has turned by more than `max_yaw` does the map turn with it. Then each new
    cell is looked up once in the old map.

    Parameters
    ----------
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    cell : float
        Side of a cell, metres.
    max_yaw : float
        The largest angle between vehicle and map, radians.

    Returns
    -------
    shift : PlanarMotion
        Pose of the map's new frame in its old one.
    pose : PlanarMotion
        Pose of the vehicle in the map's new frame.

    Examples
    --------
    >>> scroll(PlanarMotion(1.25, 0.0, 0.01), cell=0.5, max_yaw=0.03)
    (PlanarMotion(dx=1.0, dy=0.0, dyaw=0.0), PlanarMotion(dx=0.25, dy=0.0, dyaw=0.01))
    """
    if abs(pose.dyaw) > max_yaw:
        return pose, PlanarMotion()
    dx, dy = math.remainder(pose.dx, cell), math.remainder(pose.dy, cell)
    return PlanarMotion(pose.dx - dx, pose.dy - dy), PlanarMotion(dx, dy, pose.dyaw)


def look_up(values: NDArray, outside: NDArray, source: GridSpec, target: GridSpec, pose: PlanarMotion) -> NDArray:
    """Give each cell of one grid the values of the cell of another that its centre lies in.

    Parameters
    ----------
    values : (K, H, W) float32
        K values of each cell of `source`.
    outside : (K,) float32
        The values of a cell whose centre lies outside `source`.
    source, target : GridSpec
        The two grids, (H, W) and (H', W') cells.
    pose : PlanarMotion
        Pose of the frame of `target` in that of `source`, metres and radians.

    Returns
    -------
    (K, H', W') float32
        K values of each cell of `target`.
    """
    corners = (source.x_max, source.y_max, source.cell, target.x_max, target.y_max, target.cell)
    return _look_up(np.ascontiguousarray(values), outside, *corners, target.shape, pose.dx, pose.dy, pose.dyaw)


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(values, outside, source_x, source_y, source_cell, x_max, y_max, cell, shape, dx, dy, dyaw):
    found = np.empty((len(values), *shape), np.float32)
    flat, place = values.reshape(len(values), -1), np.empty(shape[1], np.int32)
    cos, sin, size = np.cos(dyaw), np.sin(dyaw), values.shape[1:]
    for r in range(shape[0]):
        for c in range(shape[1]):
            x, y = x_max - (r + 0.5) * cell, y_max - (c + 0.5) * cell
            place[c] = cell_of(cos * x - sin * y + dx, sin * x + cos * y + dy, size, source_x, source_y, source_cell)
        for k in range(len(values)):
            for c in range(shape[1]):
                found[k, r, c] = flat[k, place[c]] if place[c] >= 0 else outside[k]  # faster than != OUTSIDE
    return found

"""The cell that contains a point, and the look-up of one grid's values in another grid, in compiled loops."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import OUTSIDE


@njit(cache=True, inline="always", error_model="numpy")
def cell_of(x, y, shape, x_max, y_max, cell):
    """Return the cell that contains a point, as an index into the flattened grid.

    Parameters
    ----------
    x, y : float
        The point, in the frame of the grid, metres.
    shape : (int, int)
        H, W of the grid.
    x_max, y_max, cell : float
        The grid's far and left border, and the side of a cell, metres.

    Returns
    -------
    int32
        row * W + column; `OUTSIDE` for a point outside the grid.
    """
    row = np.floor((x_max - x) / cell)
    col = np.floor((y_max - y) / cell)
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])  # `and` would branch, which is slower
    return np.int32(row * shape[1] + col if inside else OUTSIDE)


def look_up(values: NDArray, outside: NDArray, source: GridSpec, target: GridSpec, pose: PlanarMotion) -> NDArray:
    """Give each cell of one grid the values of the cell of another grid that contains its centre.

    Parameters are those of `look_up`.
    """
    grids = *source.corner, *target.corner, target.shape
    return _look_up(np.ascontiguousarray(values), outside, *grids, float(pose.dx), float(pose.dy), float(pose.dyaw))


@njit(cache=True, nogil=True, error_model="numpy")
def _look_up(values, outside, source_x, source_y, source_cell, x_max, y_max, cell, shape, dx, dy, dyaw):
    """Find the source cells of a row once, then copy all K values from them."""
    found = np.empty((len(values), *shape), np.float32)
    flat = values.reshape(len(values), -1)
    place = np.empty(shape[1], np.int32)
    size = values.shape[1:]
    cos = np.cos(dyaw)
    sin = np.sin(dyaw)
    for r in range(shape[0]):
        for c in range(shape[1]):
            x = x_max - (r + 0.5) * cell
            y = y_max - (c + 0.5) * cell
            place[c] = cell_of(cos * x - sin * y + dx, sin * x + cos * y + dy, size, source_x, source_y, source_cell)
        for k in range(len(values)):
            for c in range(shape[1]):
                found[k, r, c] = flat[k, place[c]] if place[c] >= 0 else outside[k]  # faster than != OUTSIDE
    return found

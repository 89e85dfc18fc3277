"""The compiled look-up of one grid's values in another grid."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy.cells import cell_of
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion


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

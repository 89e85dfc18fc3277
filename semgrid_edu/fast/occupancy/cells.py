"""The cell that contains a point, for compiled loops."""

import numpy as np
from numba import njit

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
    row, col = np.floor((x_max - x) / cell), np.floor((y_max - y) / cell)
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])  # `and` would branch, which is slower
    return np.int32(row * shape[1] + col if inside else OUTSIDE)

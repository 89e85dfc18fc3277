"""The cell that contains a place, for compiled loops."""

import numpy as np
from numba import njit

from semgrid_edu.occupancy.state import OUTSIDE


@njit(cache=True, inline="always", error_model="numpy")
def cell_of(x, y, shape, x_max, y_max, cell):
    """Return the cell that contains a place, as an index into the flattened grid.

    Parameters
    ----------
    x, y : float
        The place, in the frame of the grid, metres.
    shape : (int, int)
        H, W of the grid.
    x_max, y_max, cell : float
        The grid's far and left border, and the side of a cell, metres.

    Returns
    -------
    int32
        row * W + column; `OUTSIDE` for a place outside the grid.
    """
    row, col = np.floor((x_max - x) / cell), np.floor((y_max - y) / cell)
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])  # `and` would branch, and be slower
    return np.int32(row * shape[1] + col if inside else OUTSIDE)

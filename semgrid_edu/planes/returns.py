"""Heights of a scan's returns in each cell: what the four numbers of o leave out (l -> g)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.sensor import SensorModel, without_own_returns


def cell_heights(points: NDArray, spec: GridSpec) -> NDArray[np.float64]:
    """Return the lowest and the highest return of each cell, (2, H, W), metres above flat ground.

    NaN in a cell without a return. The vehicle's own returns are left out by the rule of the default `SensorModel`,
    whatever sensor the filter has: a network must see the heights that it was trained on.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame, as `Frame.points_grid` has them.
    spec : GridSpec
        The grid, (H, W) cells.

    Examples
    --------
    >>> cell_heights(np.array([[9.5, 0.5, 0.1], [9.2, 0.7, 1.4]]), GridSpec(9, 10, 0, 1, 1.0)).ravel()
    array([0.1, 1.4])
    """
    points = without_own_returns(points, SensorModel())
    rows, cols, inside = spec.cells(points)
    cells = rows[inside], cols[inside]
    z = points[inside, 2].astype(np.float64)
    lowest = np.full(spec.shape, np.inf)
    highest = np.full(spec.shape, -np.inf)
    np.minimum.at(lowest, cells, z)
    np.maximum.at(highest, cells, z)
    return np.where(np.isinf(lowest), np.nan, np.stack([lowest, highest]))

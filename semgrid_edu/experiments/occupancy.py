"""What moves and what stands: the occupancy filters scored where truth is known (paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec


def hit_cells(
    points: NDArray, spec: GridSpec, least: int = 2, low: float = 0.3, high: float = 1.6
) -> NDArray[np.bool_]:
    """Return which cells hold enough returns of what stands on the ground to be scored.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame, metres.
    spec : GridSpec
    least : int
        Returns that a cell needs.
    low, high : float
        The heights above flat ground between which they count, metres.

    Returns
    -------
    (H, W) bool
    """
    rows, cols, inside = spec.cells(points[(points[:, 2] >= low) & (points[:, 2] <= high)])
    count = np.zeros(spec.shape, int)
    np.add.at(count, (rows[inside], cols[inside]), 1)
    return count >= least

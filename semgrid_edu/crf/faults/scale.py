"""Costs that would come from a distribution if they were all multiplied by one number."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

SAMPLE = 500
"""Cells that are looked at."""


def scale_of(phi: NDArray) -> float | None:
    """Find the t for which sum_l exp(-t phi(l)) is 1 in every cell: log 10 for logarithms to base 10.

    In a cell whose costs are all positive the sum falls from C at t = 0 to 0, so there is one t, which is found by
    bisection. Only if it is the same in all cells do the costs come from a distribution.

    Parameters
    ----------
    phi : (C, H, W) float
        Costs.

    Returns
    -------
    float or None
        t; None when there is no such number.
    """
    cells = phi.reshape(len(phi), -1)
    cells = cells[:, :: max(1, cells.shape[1] // SAMPLE)]
    cells = cells[:, (cells.min(axis=0) > 1e-4) & (np.diff(np.sort(cells, axis=0)[:2], axis=0)[0] > 1e-3)]
    if cells.shape[1] < 16:
        return None
    low, high = np.full((2, cells.shape[1]), [[1e-3], [1e3]])
    for _ in range(60):
        middle = np.sqrt(low * high)
        above = logsumexp(-middle * cells, axis=0) > 0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    inner = np.quantile(low, [0.05, 0.5, 0.95])
    return float(inner[1]) if inner[2] < 1.02 * inner[0] else None

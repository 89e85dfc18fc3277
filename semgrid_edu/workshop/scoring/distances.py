"""Bands of distance from the LIDAR, by which cells are counted (section 4)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec


def distance_bands(spec: GridSpec, edges: Sequence[float]) -> NDArray[np.int64]:
    """Return the band of distance that each cell lies in.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    edges : sequence of B + 1 float
        Where the bands begin and end, metres, from near to far.

    Returns
    -------
    (H, W) int64
        Number of the band, 0 to B - 1, by the horizontal distance from the LIDAR to the cell's centre. What lies before
        the first edge is in the first band, what lies beyond the last one in the last.
    """
    return np.digitize(np.hypot(*np.moveaxis(spec.centers(), -1, 0)), edges[1:-1])


def band_names(edges: Sequence[float]) -> list[str]:
    """Name bands of distance.

    Parameters
    ----------
    edges : sequence of B + 1 float
        Where they begin and end, metres; the last one may be infinite.

    Returns
    -------
    list of B str

    Examples
    --------
    >>> band_names([0, 10, 20, np.inf])
    ['0-10 m', '10-20 m', 'beyond 20 m']
    """
    return [f"{low:g}-{high:g} m" if np.isfinite(high) else f"beyond {low:g} m" for low, high in pairwise(edges)]

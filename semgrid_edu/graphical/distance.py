"""How far apart two distributions are."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def total_variation(p: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return the distance of distributions, sum |p - q| / 2: the most by which they disagree about any event.

    Parameters
    ----------
    p, q : (..., K) float
        Distributions along the last axis.

    Returns
    -------
    (...) float64

    Examples
    --------
    >>> total_variation([0.5, 0.5], [0.9, 0.1]).round(6)
    np.float64(0.4)
    """
    return np.abs(np.asarray(p) - q).sum(axis=-1) / 2

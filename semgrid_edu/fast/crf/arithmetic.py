"""Arithmetic of the compiled loops: what the compiler may change about it, and an exponential."""

import numpy as np
from numba import njit

FAST = {"contract", "nnan", "nsz"}
"""What the compiler may do: round x y + z once, and take for granted that no number is NaN.

It may not change the order of a sum, as `fastmath=True` would let it: the order decides the last bits, and they should
be the same in every process.
"""

HALF = np.float32(0.5)
"""A factor of 0.5 alone would make the compiler compute in double precision."""


@njit(cache=True, fastmath=FAST, inline="always")
def exponential(x):
    """Compute exp(x) of a number that isn't positive, to 6 digits: the 64th power of the series of exp(x / 64).

    Unlike the exponential of the mathematical library, the compiler does this for many numbers at once.

    Parameters
    ----------
    x : float32
        The number; below -80 its exponential counts as 0.

    Returns
    -------
    float32
        The exponential.
    """
    y = max(x, np.float32(-80)) * np.float32(1 / 64)
    power = np.float32(1 / 120) * y + np.float32(1 / 24)
    power = (power * y + np.float32(1 / 6)) * y + np.float32(1 / 2)
    power = (power * y + np.float32(1)) * y + np.float32(1)
    for _ in range(6):
        power *= power
    return power if x > np.float32(-80) else np.float32(0)

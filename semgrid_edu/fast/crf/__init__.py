"""The CRF's fast twins in compiled loops; here, the compiler's fast-math flags and an exponential."""

import numpy as np
from numba import njit

FAST = {"contract", "nnan", "nsz"}
"""What the compiler may do: round x y + z once, and assume that no number is NaN.

It may not reorder a sum, as `fastmath=True` would allow: the order decides the last bits, which should be the same in
every process.
"""

HALF = np.float32(0.5)
"""A literal 0.5 would make the compiler compute in double precision."""


@njit(cache=True, fastmath=FAST, inline="always")
def exponential(x):
    """Compute exp(x) for x <= 0 to 6 digits: the 64th power of the series of exp(x / 64).

    The compiler vectorises this, unlike the math library's exponential.

    Parameters
    ----------
    x : float32
        The number; below -80 the result is 0.

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

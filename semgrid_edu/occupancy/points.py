"""What a scan has to be before anything is made of it: a table of finite coordinates (paper, section 3.2)."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError


def check_points(points: NDArray) -> NDArray:
    """Return the points of a scan as an array of floating-point numbers, or refuse them.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z up (m), in the grid frame of the vehicle; N may be 0.

    Returns
    -------
    (N, 3+) float32 or float64
        The same numbers.

    Raises
    ------
    ArgumentError
        When `points` isn't a table of finite coordinates.
    """
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] < 3:
        raise ArgumentError("points", "shape (N, 3+): x, y, z in metres", f"shape {points.shape}")
    if points.dtype.kind not in "biuf":
        raise ArgumentError("points", "real numbers", f"type {points.dtype}")
    single = np.can_cast(points.dtype, np.float32)
    points = points.astype(np.float32 if single else np.float64, copy=False)
    if not _all_finite(points):
        bad = int((~np.isfinite(points[:, :3]).all(axis=1)).sum())
        raise ArgumentError("points", "finite coordinates", f"{bad} of {len(points)} points with NaN or infinity")
    return points


@njit(cache=True, nogil=True)
def _all_finite(points):
    """Tell whether every x, y and z is finite; numpy, which makes arrays of the answers, takes five times as long."""
    finite = True
    for i in range(len(points)):
        finite &= np.isfinite(points[i, 0]) & np.isfinite(points[i, 1]) & np.isfinite(points[i, 2])
    return finite


def without_own_returns(points: NDArray, vehicle: tuple[float, float, float, float], low: float) -> NDArray:
    """Leave out the returns that come from the vehicle itself.

    They would travel along with the vehicle for ever, and hide what is behind them.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the grid frame of the vehicle, metres.
    vehicle : (float, float, float, float)
        Outline of the vehicle: x_min, x_max, y_min, y_max in its grid frame, metres.
    low : float
        Returns inside the outline are left out from this height on, metres; lower ones come from the ground.

    Returns
    -------
    (M, 3) float
        x, y and z of the other returns, in their order.
    """
    return _outside(points, *vehicle, low)


@njit(cache=True, nogil=True)
def _outside(points, x_min, x_max, y_min, y_max, low):
    """Copy the points that don't lie in a box without a lid."""
    others, n = np.empty((len(points), 3), points.dtype), 0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not (x_min < x < x_max and y_min < y < y_max and z >= low):
            others[n, 0], others[n, 1], others[n, 2] = x, y, z
            n += 1
    return others[:n]

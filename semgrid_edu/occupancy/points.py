"""What a scan has to be before anything is made of it: a table of finite coordinates (paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError


def check_points(points: NDArray) -> NDArray:
    """Return the points of a scan as an array, or refuse them.

    Parameters
    ----------
    points : (N, 3+) float
        Returns: x forward, y left, z above the ground (m), in the grid frame of the vehicle; N may be 0.

    Returns
    -------
    (N, 3+) float32 or float64
        The same numbers.

    Raises
    ------
    ArgumentError
        When it isn't a table of finite coordinates.
    """
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] < 3:
        raise ArgumentError("points", "shape (N, 3+): x, y, z in metres", f"shape {points.shape}")
    if points.dtype.kind not in "biuf":
        raise ArgumentError("points", "real numbers", f"type {points.dtype}")
    single = np.can_cast(points.dtype, np.float32)
    points = points.astype(np.float32 if single else np.float64, copy=False)
    if not np.isfinite(points[:, :3]).all():
        bad = int((~np.isfinite(points[:, :3]).all(axis=1)).sum())
        raise ArgumentError("points", "finite coordinates", f"{bad} of {len(points)} points with NaN or infinity")
    return points

"""One LIDAR scan on disk: KITTI's velodyne files, which KITTI raw, tracking and SemanticKITTI share (section 4)."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_bytes

LIDAR_RANGE = 250.0
"""Largest coordinate of a return, metres. KITTI's HDL-64E sees 120 m, so what lies twice as far is no measurement."""


def read_scan(path: Path) -> NDArray[np.float32]:
    """Read the returns of one scan.

    Parameters
    ----------
    path : Path
        A file of little-endian floats, four for each return.

    Returns
    -------
    (N, 4) float32
        x forward, y left, z up in the LIDAR frame (metres), and reflectance.

    Raises
    ------
    DataError
        When the file is missing or cut short, or a number is no measurement.
    """
    content = read_bytes(path)
    if len(content) % 16:
        raise DataError(path, "points of 4 x 4 bytes", f"{len(content)} bytes, {len(content) % 16} too many")
    points = np.frombuffer(content, dtype="<f4").reshape(-1, 4).astype(np.float32)
    strange = ~(np.abs(points[:, :3]) <= LIDAR_RANGE).all(axis=1) | ~np.isfinite(points[:, 3])
    if strange.any():
        first = strange.argmax()
        expected = f"finite coordinates within {LIDAR_RANGE:g} m and a finite reflectance"
        raise DataError(path, expected, f"{points[first].tolist()} at point {first}")
    return points

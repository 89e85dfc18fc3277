"""The calibration of KITTI's benchmarks: one file for all sensors of a sequence."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import rigid_transform
from semgrid_edu.datasets.calibration import check_rotation, entry_of, projection
from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import read_text

TRACKING_KEYS = ("R_rect", "Tr_velo_cam", "Tr_imu_velo")
"""The tracking benchmark's keys of the rectification, of the LIDAR in camera 0, and of the IMU in the LIDAR."""

OBJECT_KEYS = ("R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo")
"""The object benchmark's names of the same three."""


class BenchmarkCalibration(NamedTuple):
    """The calibration of the left colour camera, and the poses of the other sensors.

    Parameters
    ----------
    K : (3, 3) float64
        Intrinsic matrix of the left colour camera, pixels.
    T_camera_from_lidar : (4, 4) float64
        From the LIDAR to the left colour camera, metres.
    T_camera0_from_lidar : (4, 4) float64
        From the LIDAR to the rectified camera 0, in whose frame the odometry benchmark gives poses, metres.
    T_lidar_from_imu : (4, 4) float64 or None
        From the IMU to the LIDAR, metres; None in the odometry benchmark.
    """

    K: NDArray[np.float64]
    T_camera_from_lidar: NDArray[np.float64]
    T_camera0_from_lidar: NDArray[np.float64]
    T_lidar_from_imu: NDArray[np.float64] | None


def read_benchmark_calibration(path: Path) -> BenchmarkCalibration:
    """Read the calibration of a sequence.

    The odometry benchmark has the keys P0 to P3 and Tr, the LIDAR in the rectified camera 0. The tracking benchmark has
    P0 to P3, R_rect, Tr_velo_cam (the LIDAR in camera 0 before it is rectified) and Tr_imu_velo, the last three without
    a colon. The object benchmark calls these three R0_rect, Tr_velo_to_cam and Tr_imu_to_velo.

    Parameters
    ----------
    path : Path
        calib.txt of an odometry sequence, or the file of a tracking run.
    """
    entries = _benchmark_entries(path)
    K, T_camera_from_rectified = projection(path, entries, "P2")
    if "Tr" in entries:
        T_camera0_from_lidar = _rigid(path, entries, "Tr")
        T_lidar_from_imu = None
    else:
        rectify, from_lidar, from_imu = OBJECT_KEYS if OBJECT_KEYS[0] in entries else TRACKING_KEYS
        if rectify not in entries:
            expected = f"the key Tr of the odometry benchmark, or {rectify} and {from_lidar} of the tracking benchmark"
            raise DataError(path, expected, ", ".join(entries)[:200] or "no key")
        R = check_rotation(path, entry_of(path, entries, rectify, (3, 3)), rectify)
        T_camera0_from_lidar = rigid_transform(R, np.zeros(3)) @ _rigid(path, entries, from_lidar)
        T_lidar_from_imu = _rigid(path, entries, from_imu)
    T_camera_from_lidar = T_camera_from_rectified @ T_camera0_from_lidar
    return BenchmarkCalibration(K, T_camera_from_lidar, T_camera0_from_lidar, T_lidar_from_imu)


def parse_pose(path: Path, text: str, what: str) -> NDArray[np.float64]:
    """Return the rigid transform from twelve numbers, the three upper rows of its matrix.

    Parameters
    ----------
    path : Path
        Where the numbers come from, for the error.
    text : str
        The numbers.
    what : str
        What the transform is, for the error.

    Returns
    -------
    (4, 4) float64
        Metres.
    """
    return _rigid(path, {what: text}, what)


def _benchmark_entries(path: Path) -> dict[str, str]:
    """Return the values of each key; a colon may follow the key."""
    lines = [line.split(maxsplit=1) for line in read_text(path).splitlines() if line.strip()]
    return {key.rstrip(":"): (values[0] if values else "") for key, *values in lines}


def _rigid(path: Path, entries: dict[str, str], key: str) -> NDArray[np.float64]:
    matrix = entry_of(path, entries, key, (3, 4))
    return rigid_transform(check_rotation(path, matrix[:, :3], key), matrix[:, 3])

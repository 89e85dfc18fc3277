"""The calibration file of a sequence of KITTI's odometry and tracking benchmarks: one file for all sensors."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import rigid_transform
from semgrid_edu.datasets.readers.calibration import check_rotation, entry_of, projection
from semgrid_edu.storage.reading import read_text


class BenchmarkCalibration(NamedTuple):
    """What the file says of the left colour camera, and where the sensors stand.

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
    a colon.

    Parameters
    ----------
    path : Path
        calib.txt of an odometry sequence, or the file of a tracking run.
    """
    entries = _entries(path)
    K, T_camera_from_rectified = projection(path, entries, "P2")
    if "Tr" in entries:
        T_camera0_from_lidar, T_lidar_from_imu = _rigid(path, entries, "Tr"), None
    else:
        R = check_rotation(path, entry_of(path, entries, "R_rect", (3, 3)), "R_rect")
        T_camera0_from_lidar = rigid_transform(R, np.zeros(3)) @ _rigid(path, entries, "Tr_velo_cam")
        T_lidar_from_imu = _rigid(path, entries, "Tr_imu_velo")
    return BenchmarkCalibration(
        K, T_camera_from_rectified @ T_camera0_from_lidar, T_camera0_from_lidar, T_lidar_from_imu
    )


def parse_pose(path: Path, text: str, what: str) -> NDArray[np.float64]:
    """Return the rigid transform in twelve numbers, the three upper rows of its matrix.

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


def _entries(path: Path) -> dict[str, str]:
    """Return the values of each key; a colon may follow the key."""
    lines = [line.split(maxsplit=1) for line in read_text(path).splitlines() if line.strip()]
    return {key.rstrip(":"): (values[0] if values else "") for key, *values in lines}


def _rigid(path: Path, entries: dict[str, str], key: str) -> NDArray[np.float64]:
    matrix = entry_of(path, entries, key, (3, 4))
    return rigid_transform(check_rotation(path, matrix[:, :3], key), matrix[:, 3])

"""Write KITTI's calibration files; needs nothing of the simulated street."""

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, Camera
from semgrid_edu.datasets.calibration import LIDAR_HEIGHT
from semgrid_edu.storage.files import write_text


class Calibrated(Protocol):
    """What has KITTI's calibration; `Rig` says what each attribute is."""

    camera: Camera
    R_rect: NDArray[np.float64]
    T_camera0_from_lidar: NDArray[np.float64]
    T_lidar_from_imu: NDArray[np.float64]

    def P_rect(self, index: int) -> NDArray[np.float64]:
        """Return the projection matrix of a rectified camera. Parameters and result are those of `Rig.P_rect`."""


def _row(name: str, numbers: NDArray | tuple) -> str:
    return f"{name}: " + " ".join(f"{x:.12e}" for x in np.ravel(numbers)) + "\n"


def write_calibration(root: Path, rig: Calibrated, date: str) -> None:
    """Write KITTI's three calibration files. The cameras are ideal: undistorted and parallel.

    A LIDAR that isn't as high above the ground as KITTI's gets a line of its own, `LIDAR_HEIGHT`.

    Parameters
    ----------
    root : path-like
        Parent of the day's folder.
    rig : Calibrated
        The poses of camera, LIDAR and IMU.
    date : str
        The day, which is also the folder's name.
    """
    day = Path(root) / date
    time = "calib_time: 01-Jan-2026 09:00:00\n"
    height, width = rig.camera.size
    text = time + _row("corner_dist", (0.0995,))
    for index in range(4):
        P = rig.P_rect(index)
        baseline = rig.R_rect.T @ np.array([P[0, 3] / P[0, 0], 0.0, 0.0])
        rows = {"S": (width, height), "K": P[:, :3], "D": np.zeros(5), "R": np.eye(3), "T": baseline}
        rows |= {"S_rect": (width, height), "R_rect": rig.R_rect, "P_rect": P}
        text += "".join(_row(f"{name}_{index:02d}", numbers) for name, numbers in rows.items())
    write_text(day / "calib_cam_to_cam.txt", text)
    more = _row("delta_f", (0, 0)) + _row("delta_c", (0, 0))
    if rig.camera.lidar_height != KITTI_LIDAR_HEIGHT:
        more += _row(LIDAR_HEIGHT, (rig.camera.lidar_height,))
    for name, T, extra in (
        ("calib_velo_to_cam.txt", rig.T_camera0_from_lidar, more),
        ("calib_imu_to_velo.txt", rig.T_lidar_from_imu, ""),
    ):
        write_text(day / name, time + _row("R", T[:3, :3]) + _row("T", T[:3, 3]) + extra)

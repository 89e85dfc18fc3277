"""One run of KITTI's tracking benchmark: the images and scans that Zhang et al. labelled (section 4).

The layout follows the benchmark's development kit, with four of its archives unpacked into one folder:

    training/image_02/0009/000000.png    training/velodyne/0009/000000.bin
    training/calib/0009.txt              training/oxts/0009.txt (one packet per line)
"""

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera, invert_rigid
from semgrid_edu.datasets.calibration import BenchmarkCalibration, camera_from, read_benchmark_calibration
from semgrid_edu.datasets.frames import FrameSequence, frame_numbers, read_scan
from semgrid_edu.datasets.oxts import imu_pose, parse_packet
from semgrid_edu.errors import DataError
from semgrid_edu.frame import Frame
from semgrid_edu.storage.reading import read_png, read_text

TRACKING_PERIOD = 0.1
"""Seconds between frames. The benchmark has no timestamps; KITTI's LIDAR spins at 10 Hz."""


class KittiTrackingRun(FrameSequence):
    """The frames of a run, read and checked on access.

    A few scans of the benchmark were never recorded. These frames raise a missing-file error; the others can be read.

    Parameters
    ----------
    root : path-like
        Parent of the folder `training`.
    run : int
        Number of the run, 0 to 20.

    Raises
    ------
    DataError
        When the run has no images. `drive[k]` raises it when a file of the frame is missing or damaged.
    """

    def __init__(self, root: str | Path, run: int) -> None:
        self.folder = Path(root) / "training"
        self.name = f"{run:04d}"
        self._length = 1 + max(frame_numbers(self.folder / "image_02" / self.name, "images", ".png"))

    def __len__(self) -> int:
        """Return the number of frames, including those whose scans were never recorded."""
        return self._length

    def _frame(self, k: int) -> Frame:
        return Frame(
            image=read_png(self._image_file(k), "RGB", self.camera.size),
            points=read_scan(self.folder / "velodyne" / self.name / f"{k:06d}.bin"),
            camera=self.camera,
            T_world_from_lidar=self._pose(k),
            time=k * TRACKING_PERIOD,
        )

    @cached_property
    def camera(self) -> Camera:
        """The calibration of image_02, the same for all frames, at the size of the first image."""
        height, width = read_png(self._image_file(0), "RGB", None).shape[:2]
        K, T_camera_from_lidar, *_ = self._calibration
        return camera_from(self._calibration_file, K, T_camera_from_lidar, (height, width))

    @property
    def _calibration_file(self) -> Path:
        return self.folder / "calib" / f"{self.name}.txt"

    @cached_property
    def _calibration(self) -> BenchmarkCalibration:
        calibration = read_benchmark_calibration(self._calibration_file)
        if calibration.T_lidar_from_imu is None:
            raise DataError(self._calibration_file, "the key Tr_imu_velo", "a calibration of the odometry benchmark")
        return calibration

    def _image_file(self, k: int) -> Path:
        return self.folder / "image_02" / self.name / f"{k:06d}.png"

    @cached_property
    def _packets(self) -> list[NDArray[np.float64]]:
        path = self.folder / "oxts" / f"{self.name}.txt"
        lines = read_text(path).splitlines()
        if len(lines) != len(self):
            raise DataError(path, f"{len(self)} lines, one per frame", f"{len(lines)}")
        return [parse_packet(path, line) for line in lines]

    def _pose(self, k: int) -> NDArray[np.float64]:
        """Return T_world_from_lidar; the world frame is the IMU frame of the run's first packet."""
        return imu_pose(self._packets[0], self._packets[k]) @ invert_rigid(self._calibration.T_lidar_from_imu)

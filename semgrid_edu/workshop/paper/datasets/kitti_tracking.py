"""KITTI's tracking benchmark with the image labels of Zhang et al., the paper's training data (section 4).

A run of the benchmark follows its development kit, with four of the archives unpacked into one folder:

    training/image_02/0009/000000.png    training/velodyne/0009/000000.bin
    training/calib/0009.txt              training/oxts/0009.txt (one packet per line)

The labels are those of Zhang, Candra, Vetter and Zakhor, ICRA 2015. According to their readme (12 August 2015), 252
frames ("acquisitions") from eight runs of the training set are labelled, every tenth or twentieth frame: 140 in runs 9,
10, 11 and 19 for training, 112 in runs 0, 4, 5 and 13 for testing (the paper gives 142 and 110). They are MATLAB files
image_02/(trn or test)/(run)/(acquisition), each a matrix of the numbers in `ZHANG_CLASSES`.

We couldn't inspect the archive, so this reader assumes that files end in .mat, that file and run names are numbers with
or without leading zeros, and that the matrix is the only two-dimensional variable of its file.
"""

import io
import re
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera, invert_rigid
from semgrid_edu.datasets.calibration import BenchmarkCalibration, camera_from, read_benchmark_calibration
from semgrid_edu.datasets.drive_files import (
    IMAGE_SUFFIXES,
    first_sound,
    frame_numbers,
    lines_of,
    numbers_in,
    photograph,
)
from semgrid_edu.datasets.frames import ClassTable, FrameSequence, nothing_known, read_scan
from semgrid_edu.datasets.oxts import imu_pose, parse_packet
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.frame import Frame, FrameLabels
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.reading import read_bytes, read_image, read_lines

TRACKING_PERIOD = 0.1
"""Seconds between frames. The benchmark has no timestamps; KITTI's LIDAR spins at 10 Hz."""


class KittiTrackingRun(FrameSequence):
    """The frames of a run, read and checked on access.

    A few scans of the benchmark were never recorded: these frames (`gaps`) have no points, so the filter only predicts.
    A clip cut from a run may begin at any number; `run[0]` is its first frame.

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
        images = frame_numbers(self.folder / "image_02" / self.name, "images", IMAGE_SUFFIXES)
        recorded = numbers_in(self.folder / "velodyne" / self.name, [".bin"]).union(images)
        self._numbers = range(min(recorded), max(recorded) + 1)

    def __len__(self) -> int:
        """Return the number of frames, including those whose scans were never recorded."""
        return len(self._numbers)

    def scan_file(self, k: int) -> Path:
        """Return the file of a frame's scan. Parameters are those of `DriveFiles.scan_file`."""
        return self.folder / "velodyne" / self.name / f"{self.numbers[k]:06d}.bin"

    def image_file(self, k: int) -> Path:
        """Return the file of a frame's image. Parameters are those of `DriveFiles.scan_file`."""
        return photograph(self.folder / "image_02" / self.name, f"{self.numbers[k]:06d}")

    def packets(self) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
        """Return the packets, by line, and their times."""
        packets = self._packets
        return {self.pose_name(k): packet for k, packet in enumerate(packets)}, np.arange(len(self)) * TRACKING_PERIOD

    def pose_name(self, k: int) -> str:
        """Return where a packet is. Parameters are those of `DriveFiles.scan_file`."""
        return f"{self._oxts_file}, frame {self.numbers[k]}"

    def _frame(self, k: int) -> Frame:
        return Frame(
            image=read_image(self.image_file(k), self.camera.size),
            points=np.zeros((0, 4), np.float32) if k in self.gaps else read_scan(self.scan_file(k)),
            camera=self.camera,
            T_world_from_lidar=self._pose(k),
            time=k * TRACKING_PERIOD,
        )

    @cached_property
    def camera(self) -> Camera:
        """The calibration of image_02, the same for all frames, at the size of the first image that can be read."""
        image = first_sound(lambda k: read_image(self.image_file(k), None), range(len(self)))
        height, width = image.shape[:2]
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

    @property
    def _oxts_file(self) -> Path:
        return self.folder / "oxts" / f"{self.name}.txt"

    @cached_property
    def _packets(self) -> list[NDArray[np.float64]]:
        path = self._oxts_file
        lines = lines_of(path, read_lines(path, len(self)), self.numbers)
        return [parse_packet(path, line) for line in lines]

    def _pose(self, k: int) -> NDArray[np.float64]:
        """Return T_world_from_lidar; the world frame is the IMU frame of the run's first packet."""
        return imu_pose(self._packets[0], self._packets[k]) @ invert_rigid(self._calibration.T_lidar_from_imu)


ZHANG_CLASSES = ClassTable(
    KITTI_14,
    {
        0: None,  # not ground-truthed
        1: "building",
        2: "sky",
        3: "road",
        4: "vegetation",
        5: "sidewalk",
        6: "car",
        7: "pedestrian",
        8: "bicycle",  # cyclist
        9: "signage",
        10: "fence",
    },
)
"""KITTI-14's class of each number in the label matrices."""

ZHANG_RUNS = {"train": (9, 10, 11, 19), "test": (0, 4, 5, 13)}
"""Runs of KITTI's tracking training set in each split."""


class ZhangLabels:
    """The labelled images of the data set.

    Parameters
    ----------
    folder : path-like
        The unpacked archive, which contains image_02.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self._files: dict[tuple[int, int], Path] = {}
        for path in sorted(self.folder.glob("image_02/*/*/*.mat")):
            if re.fullmatch(r"\d+/\d+", f"{path.parent.name}/{path.stem}"):
                self._files[int(path.parent.name), int(path.stem)] = path
        if not self._files:
            expected = "labels such as image_02/trn/0009/000000.mat"
            raise DataError(self.folder, expected, "none" if self.folder.is_dir() else "no folder")

    def frames(self, split: str) -> list[tuple[int, int]]:
        """Return the available labelled frames of a split.

        Parameters
        ----------
        split : str
            "train" or "test".

        Returns
        -------
        list of (int, int)
            Run and frame number, in ascending order.
        """
        if split not in ZHANG_RUNS:
            raise ArgumentError("split", f"one of {', '.join(ZHANG_RUNS)}", repr(split))
        return sorted(key for key in self._files if key[0] in ZHANG_RUNS[split])

    def read(self, run: int, acquisition: int, image_size: tuple[int, int]) -> FrameLabels | None:
        """Read the labels of one image.

        Parameters
        ----------
        run : int
            Number of the run in KITTI's tracking training set.
        acquisition : int
            Number of the frame in the run.
        image_size : (int, int)
            Height and width of the image, pixels.

        Returns
        -------
        FrameLabels or None
            Image labels only. The data set has no depth and no bird's-eye labels, so depth is NaN and all cells are
            unlabelled and not visible. None for a frame without labels.
        """
        path = self._files.get((run, acquisition))
        if path is None:
            return None
        numbers = _matrix(path)
        if numbers.shape != image_size:
            raise DataError(path, "labels of {} x {} pixels".format(*image_size), "{} x {}".format(*numbers.shape))
        return replace(nothing_known(KITTI_14, image_size), image=ZHANG_CLASSES.classes(path, numbers))


def _matrix(path: Path) -> NDArray:
    """Read the only matrix of a MATLAB file."""
    from scipy.io import loadmat  # imported here because it is slow to load and no other reader needs it

    content = read_bytes(path)
    try:
        variables = {name: value for name, value in loadmat(io.BytesIO(content)).items() if not name.startswith("__")}
    except NotImplementedError:
        raise DataError(path, "a MATLAB file up to version 7.2", "version 7.3; save it again with `-v7`") from None
    except Exception as error:  # a damaged file raises anything in scipy: IndexError, zlib.error, ...
        raise DataError(path, "a MATLAB file", f"{type(error).__name__}: {error}") from error
    found = [value for value in variables.values() if isinstance(value, np.ndarray) and min(value.shape) > 1]
    if len(found) != 1 or found[0].ndim != 2 or found[0].dtype.kind not in "iufb":
        raise DataError(path, "one matrix of numbers", f"the variables {', '.join(variables) or '(none)'}")
    return found[0]


class ZhangDrive(FrameSequence):
    """The frames of a drive, with the labels of Zhang et al. where they exist.

    Parameters
    ----------
    drive : FrameSequence
        The frames of the run: a `KittiTrackingRun`, or a raw drive with the same first frame. Judging by the numbers of
        frames, runs 0, 4, 5, 10, 11 and 13 are probably drives 0005, 0014, 0015, 0056, 0059 and 0091 of 2011_09_26, and
        run 19 is drive 0071 of 2011_09_29. Check by overlaying some labels on their images.
    labels : ZhangLabels
        The labels of all runs.
    run : int
        Number of the run in KITTI's tracking training set.

    Examples
    --------
    >>> labels = ZhangLabels("zhang")                                               # doctest: +SKIP
    >>> drive = ZhangDrive(KittiTrackingRun("kitti_tracking", 9), labels, 9)        # doctest: +SKIP
    >>> [k for run, k in labels.frames("train") if run == 9][:3]                    # doctest: +SKIP
    """

    label_set = KITTI_14

    def __init__(self, drive: FrameSequence, labels: ZhangLabels, run: int) -> None:
        self.drive = drive
        self.labels = labels
        self.run = run
        self.name = f"run {run}"
        self.folder = labels.folder

    def __len__(self) -> int:
        """Return the number of frames, labelled or not."""
        return len(self.drive)

    @property
    def camera(self) -> Camera:
        """The calibration, the same for all frames."""
        return self.drive.camera

    def files(self) -> list[Path]:
        """Return the files of the drive and all label files."""
        return [*self.drive.files(), *super().files()]

    def _frame(self, k: int) -> Frame:
        frame = self.drive[k]
        return replace(frame, labels=self.labels.read(self.run, self.drive.numbers[k], frame.camera.size))

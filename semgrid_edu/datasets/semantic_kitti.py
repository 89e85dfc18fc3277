"""SemanticKITTI (Behley et al., ICCV 2019): labelled scans of KITTI's odometry sequences, and their truth from above.

    sequences/00/velodyne/000000.bin    sequences/00/labels/000000.label    sequences/00/image_2/000000.png (optional)
    sequences/00/calib.txt              sequences/00/poses.txt              sequences/00/times.txt

A pose is a row of twelve numbers: camera 0 of that frame in camera 0 of the first one. The camera is the left colour
camera of KITTI's odometry benchmark, whose archives hold image_2, calib.txt and times.txt.
"""

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, Camera, invert_rigid, lidar_from_grid, transform_points
from semgrid_edu.datasets.calibration import BenchmarkCalibration, camera_from, parse_pose, read_benchmark_calibration
from semgrid_edu.datasets.drive_files import (
    IMAGE_SUFFIXES,
    first_sound,
    frame_numbers,
    lines_of,
    numbers_in,
    photograph,
)
from semgrid_edu.datasets.frames import ClassTable, FrameSequence, nothing_known, read_scan
from semgrid_edu.datasets.project_lidar import birdseye_votes, seen_returns
from semgrid_edu.errors import DataError, check_text
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.storage.reading import parse_numbers, read_bytes, read_image, read_text

IMAGE_SIZES = {"00": (376, 1241), "01": (376, 1241), "02": (376, 1241), "03": (375, 1242)} | {
    f"{sequence:02d}": (370, 1226) for sequence in range(4, 11)
}
"""Height and width of the images of the sequences with labels, pixels: calib.txt doesn't give it."""


SEMANTIC_KITTI_CLASSES = ClassTable(
    KITTI_14,
    {
        **dict.fromkeys((40, 44, 60), "road"),  # road, parking, lane marking
        **dict.fromkeys((48,), "sidewalk"),
        **dict.fromkeys((70, 71, 72), "vegetation"),  # vegetation, trunk, terrain
        **dict.fromkeys((10, 13, 16, 18, 20), "car"),  # car, bus, on rails, truck, other vehicle
        **dict.fromkeys((252, 256, 257, 258, 259), "car"),  # the same, moving: car, on rails, bus, truck, other
        **dict.fromkeys((30, 254), "pedestrian"),
        **dict.fromkeys((11, 15, 31, 32, 253, 255), "bicycle"),  # bicycle, motorcycle, and their riders
        **dict.fromkeys((50,), "building"),
        **dict.fromkeys((80, 81), "signage"),  # pole, traffic sign
        **dict.fromkeys((51,), "fence"),
        **dict.fromkeys((0, 1, 49, 52, 99), None),  # unlabelled, outlier, other ground, other structure, other object
    },
)
"""KITTI-14's class of each number in the labels; the numbers come from the data set's semantic-kitti.yaml.

As in the rest of the package, poles are signage, a rider belongs to the bicycle, and grass is vegetation. KITTI-14 has
no classes for larger vehicles and for motorcycles, so they become cars and bicycles."""

FIRST_MOVING = 252
"""Classes with this number or a higher one are moving objects."""


def read_point_labels(path: Path, n_points: int) -> NDArray[np.int64]:
    """Read the number of each return's class.

    The file holds a little-endian uint32 for each return: the class in the lower 16 bits, the instance in the upper
    ones.

    Parameters
    ----------
    path : Path
        The file, such as labels/000000.label.
    n_points : int
        N, the number of returns of the scan.

    Returns
    -------
    (N,) int64
        Numbers of SemanticKITTI, which `SEMANTIC_KITTI_CLASSES` translates.
    """
    content = read_bytes(path)
    if len(content) != 4 * n_points:
        raise DataError(path, f"4 bytes for each of the scan's {n_points} returns", f"{len(content)} bytes")
    return (np.frombuffer(content, dtype="<u4") & 0xFFFF).astype(np.int64)


class SemanticKittiSequence(FrameSequence):
    """The frames of a sequence, each read and checked on access.

    Scans and their labels (`scan`, `classes`, `moving`, and `truth` of a single scan) need neither calibration nor
    poses. The `labels` of a `Frame` are the bird's-eye truth of this single scan, visible where the camera sees a
    return; the image isn't labelled. Without the folder image_2 frames have no image. The world is the LIDAR's frame at
    the first scan.

    Parameters
    ----------
    root : path-like
        The folder that holds the folder sequences.
    sequence : str
        Number of the sequence, such as "00".

    Raises
    ------
    ArgumentError
        When `sequence` isn't text.
    DataError
        When there are no scans of the sequence. `drive[k]` raises it when a file that the frame needs is missing or
        damaged.

    Examples
    --------
    >>> sequence = SemanticKittiSequence("semantickitti", "00")             # doctest: +SKIP
    >>> truth = sequence.truth(20, GridSpec.compact(), before=20, after=20) # doctest: +SKIP
    """

    label_set = KITTI_14
    poses_file = "poses.txt"

    def __init__(self, root: str | Path, sequence: str) -> None:
        check_text(sequence=(sequence, "00"))
        self.folder = Path(root) / "sequences" / sequence
        self.name = sequence
        scans = frame_numbers(self.folder / "velodyne", "scans", [".bin"])
        recorded = numbers_in(self.folder / "image_2", IMAGE_SUFFIXES).union(scans)
        self._numbers = range(min(recorded), max(recorded) + 1)

    def __len__(self) -> int:
        """Return the number of frames, including those without a scan."""
        return len(self._numbers)

    def scan_file(self, k: int) -> Path:
        """Return the file of a frame's scan. Parameters are those of `DriveFiles.scan_file`."""
        return self.folder / "velodyne" / f"{self.numbers[k]:06d}.bin"

    def image_file(self, k: int) -> Path | None:
        """Return the file of a frame's image, if there are images. Parameters are those of `DriveFiles.scan_file`."""
        return photograph(self.folder / "image_2", f"{self.numbers[k]:06d}") if self._has_images else None

    def scan(self, k: int) -> NDArray[np.float32]:
        """Read the returns of one scan.

        Parameters
        ----------
        k : int
            Number of the frame.

        Returns
        -------
        (N, 4) float32
            LIDAR frame, metres, and reflectance.
        """
        return np.zeros((0, 4), np.float32) if k in self.gaps else read_scan(self.scan_file(k))

    def classes(self, k: int) -> NDArray[np.uint8]:
        """Read the class of each return of one scan. Parameters are those of `SemanticKittiSequence.scan`.

        Returns
        -------
        (N,) uint8
            Classes of KITTI-14; 255 where unlabelled.
        """
        return SEMANTIC_KITTI_CLASSES.classes(self._label_file(k), self._point_labels(k))

    def moving(self, k: int) -> NDArray[np.bool_]:
        """Read which returns of one scan come from moving objects.

        Parameters and errors are those of `SemanticKittiSequence.scan`.

        Returns
        -------
        (N,) bool
        """
        return self._point_labels(k) >= FIRST_MOVING

    def truth(self, k: int, spec: GridSpec, before: int = 0, after: int = 0) -> NDArray[np.uint8]:
        """Return the bird's-eye truth of one frame, from its own scan or accumulated over several by their poses.

        Only the static points of the other scans are used, because moving things were elsewhere then. Scans that the
        sequence doesn't have are left out. To fill the rest of the grid as the paper does, take `np.where(truth ==
        IGNORE, unknown_classes(belief.probability), truth)`.

        Parameters
        ----------
        k : int
            Number of the frame.
        spec : GridSpec
            The grid, (H, W) cells.
        before, after : int
            How many scans before and after this one are accumulated.

        Returns
        -------
        (H, W) uint8
            Classes of KITTI-14; 255 in a cell in which there is no labelled return.
        """
        window = [
            j for j in range(max(0, k - before), min(len(self), k + after + 1)) if j == k or self.scan_file(j).exists()
        ]
        labelled = [self._labelled_points(j, k) for j in window]
        points, classes = (np.concatenate(arrays) for arrays in zip(*labelled, strict=True))
        return birdseye_votes(points, classes, spec, KITTI_14)

    def path(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the poses of the LIDAR, (N, 4, 4) T_world_from_lidar in metres, and their times, (N,) seconds."""
        return np.array(self._poses), np.array(self._times)

    def _labelled_points(self, j: int, k: int) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        """Return scan j in the grid frame of frame k, and its classes, without things that moved in between."""
        points = self.scan(j)[:, :3].astype(np.float64)
        classes = self.classes(j)
        if j != k:
            T_lidar_k_from_lidar_j = invert_rigid(self._poses[k]) @ self._poses[j]
            points = transform_points(T_lidar_k_from_lidar_j, points)
            classes = np.where(self.moving(j), np.uint8(IGNORE), classes)
        return transform_points(invert_rigid(lidar_from_grid(KITTI_LIDAR_HEIGHT)), points), classes

    def _frame(self, k: int) -> Frame:
        frame = self.without_labels(k)
        return replace(frame, labels=self._labels(k, frame))

    def without_labels(self, k: int) -> Frame:
        """Read a frame without its labels. Parameters are those of `FrameSequence.without_labels`."""
        image = read_image(self.image_file(k), self.camera.size) if self._has_images else None
        return Frame(image, self.scan(k), self.camera, self._poses[k], self._times[k])

    def _labels(self, k: int, frame: Frame) -> FrameLabels | None:
        """Return the truth of the scan, None in a sequence without labels."""
        if not (self.folder / "labels").exists():
            return None
        _, cells = seen_returns(frame, LABEL_GRID, self.camera.size)
        visible = np.zeros(LABEL_GRID.shape, dtype=np.bool_)
        visible.flat[cells] = True
        return replace(nothing_known(KITTI_14, self.camera.size), birdseye=self.truth(k, LABEL_GRID), visible=visible)

    def _label_file(self, k: int) -> Path:
        return self.folder / "labels" / f"{self.numbers[k]:06d}.label"

    def _point_labels(self, k: int) -> NDArray[np.int64]:
        if k in self.gaps:
            return np.zeros(0, np.int64)
        return read_point_labels(self._label_file(k), len(self.scan(k)))

    @property
    def _has_images(self) -> bool:
        return (self.folder / "image_2").exists()

    @cached_property
    def _calibration(self) -> BenchmarkCalibration:
        return read_benchmark_calibration(self.folder / "calib.txt")

    @cached_property
    def camera(self) -> Camera:
        """The calibration of image_2, the same for all frames; its size from an image or `IMAGE_SIZES`."""
        if self._has_images:
            height, width = first_sound(lambda k: read_image(self.image_file(k), None), range(len(self))).shape[:2]
        elif self.folder.name in IMAGE_SIZES:
            height, width = IMAGE_SIZES[self.folder.name]
        else:
            raise DataError(
                self.folder / "image_2" / "000000.png", "an image, to know the camera's size", "no folder image_2"
            )
        K, T_camera_from_lidar, *_ = self._calibration
        return camera_from(self.folder / "calib.txt", K, T_camera_from_lidar, (height, width))

    @cached_property
    def _poses(self) -> list[NDArray[np.float64]]:
        """T_world_from_lidar of each frame; the world is the LIDAR at the first one."""
        path = self.folder / "poses.txt"
        T_camera0_from_lidar = self._calibration.T_camera0_from_lidar
        lines = [(line, f"line {n}") for n, line in enumerate(read_text(path).splitlines(), 1)]
        poses = [parse_pose(path, *line) for line in lines_of(path, lines, self.numbers, or_more=True)]
        return [invert_rigid(T_camera0_from_lidar) @ T @ T_camera0_from_lidar for T in poses]

    @cached_property
    def _times(self) -> list[float]:
        """Seconds since the first scan: one number in each line, each above the one before."""
        path = self.folder / "times.txt"
        times: list[float] = []
        for number, line in enumerate(read_text(path).rstrip().splitlines(), 1):
            found = parse_numbers(path, line, f"the time in line {number}")
            if len(found) != 1:
                raise DataError(path, f"one time in line {number}", repr(line))
            if times and found[0] <= times[-1]:
                raise DataError(path, "increasing times", f"{line!r} in line {number}, not after the one before")
            times.append(float(found[0]))
        times = lines_of(path, times, self.numbers, or_more=True)
        return [time - times[0] for time in times]

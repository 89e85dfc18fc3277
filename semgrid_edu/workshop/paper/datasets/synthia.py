"""SYNTHIA's sequences as drives: image, labels, and depth instead of a LIDAR (section 4; Ros et al., CVPR 2016).

    SYNTHIA-SEQS-04-SPRING/RGB/Stereo_Left/Omni_F/000000.png          SYNTHIA-SEQS-04-SPRING/CameraParams/intrinsics.txt
    SYNTHIA-SEQS-04-SPRING/GT/LABELS/Stereo_Left/Omni_F/000000.png
    SYNTHIA-SEQS-04-SPRING/Depth/Stereo_Left/Omni_F/000000.png
    SYNTHIA-SEQS-04-SPRING/CameraParams/Stereo_Left/Omni_F/000000.txt

This reader uses the left forward camera out of eight, because the paper uses one pair of camera and depth.

The data set's readme (26 June 2016) specifies: 5 frames per second; channel 1 of a label PNG is the class, channel 2
the instance; depth is in centimetres, 16 bits, the same in all three channels. We couldn't inspect a sequence, so the
rest follows published readers: label PNGs have 16 bits per channel; intrinsics.txt contains focal length, principal
point (u, v) and stereo baseline; a pose is 16 numbers, the column-major matrix from camera to world, for a camera with
x right, y up and z *back*. If a sequence uses another pose convention, `SynthiaSequence.problems` reports that the
camera doesn't move forward.
"""

from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera, invert_rigid, lidar_from_grid, rigid_transform, transform_points
from semgrid_edu.datasets.calibration import camera_from, check_rotation
from semgrid_edu.datasets.drive_files import IMAGE_SUFFIXES, frame_numbers, photograph
from semgrid_edu.datasets.frames import ClassTable, FrameSequence, error_of
from semgrid_edu.datasets.project_lidar import birdseye_votes, depth_scan, points_from_depth
from semgrid_edu.errors import DataError
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.labels import IGNORE, SYNTHIA_10
from semgrid_edu.storage.reading import parse_numbers, read_image, read_png, read_text

SYNTHIA_CLASSES = ClassTable(
    SYNTHIA_10,
    {
        **dict.fromkeys((0, 1), "void"),  # nothing, sky
        2: "building",
        3: "road",
        4: "sidewalk",
        5: "fence",
        6: "vegetation",
        7: "pole",
        8: "car",
        9: "sign",
        12: "lane",
        **dict.fromkeys((10, 11, 13, 14, 15), "void"),  # pedestrian, bicycle, two reserved numbers, traffic light
    },
)
"""SYNTHIA-10's class of each number in the labels. The paper leaves out sky, people, bicycles and traffic lights."""

SYNTHIA_CAMERA_AXES = np.diag([1.0, -1.0, -1.0])
"""(3, 3): from this package's camera axes (x right, y down, z ahead) to SYNTHIA's camera axes."""

VIEW = "Stereo_Left/Omni_F"
"""The camera to read."""

SYNTHIA_PERIOD = 0.2
"""Seconds between frames: 5 frames per second according to the readme."""

LOWEST_CAMERA = 0.5
"""No car's camera is lower, metres."""

GROUND_RANGE = 20.0
"""Road pixels of the first image closer than this, metres, determine the height of the camera."""

STATIONARY_STEP = 0.05
"""A camera that moves less than this from frame to frame counts as stationary, metres."""

FORWARD_SHARE = 0.9
"""The smallest plausible forward share of a moving camera's steps (median)."""

_CAMERA_FROM_LIDAR = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From axes forward, left, up to camera axes."""

_UP_FROM_SYNTHIA = rigid_transform(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), np.zeros(3))
"""From SYNTHIA's world, whose y axis points up, to one whose z axis does."""


def read_synthia_labels(path: Path, size: tuple[int, int] | None) -> NDArray[np.uint8]:
    """Read the class of each pixel.

    Parameters
    ----------
    path : Path
        A file of GT/LABELS.
    size : (int, int) or None
        Required height and width, pixels; None for any size.

    Returns
    -------
    (h, w) uint8
        Classes of SYNTHIA-10.
    """
    return SYNTHIA_CLASSES.classes(path, read_png(path, "RGB;16", size)[..., 0].astype(np.int64))


def read_synthia_depth(path: Path, size: tuple[int, int] | None) -> NDArray[np.float32]:
    """Read the depth of each pixel.

    Parameters
    ----------
    path : Path
        A file of Depth.
    size : (int, int) or None
        Required height and width, pixels; None for any size.

    Returns
    -------
    (h, w) float32
        Metres along the optical axis; NaN where the file has 0 or 65535, which mean "no surface".
    """
    centimetres = read_png(path, "RGB;16", size)[..., 0]
    nothing = (centimetres == 0) | (centimetres == np.iinfo(np.uint16).max)
    return np.where(nothing, np.float32(np.nan), centimetres.astype(np.float32) * np.float32(0.01))


def read_synthia_intrinsics(path: Path) -> NDArray[np.float64]:
    """Read the intrinsic matrix, which all cameras share.

    Parameters
    ----------
    path : Path
        CameraParams/intrinsics.txt.

    Returns
    -------
    (3, 3) float64
        K, pixels.
    """
    numbers = parse_numbers(path, read_text(path), "focal length, principal point and baseline")
    if numbers.size != 4 or numbers[0] <= 0:
        raise DataError(path, "focal length (above 0), principal point u and v, baseline", numbers.tolist())
    focal, u, v, _ = numbers
    return np.array([[focal, 0, u], [0, focal, v], [0, 0, 1]])


def read_synthia_pose(path: Path) -> NDArray[np.float64]:
    """Read the pose of a camera in one frame.

    Parameters
    ----------
    path : Path
        A file of CameraParams/Stereo_Left/Omni_F.

    Returns
    -------
    (4, 4) float64
        T_world_from_camera, metres, for a camera with x right, y down and z ahead.
    """
    numbers = parse_numbers(path, read_text(path), "a pose")
    if numbers.size != 16 or not np.array_equal(numbers[3::4], [0, 0, 0, 1]):
        raise DataError(path, "16 numbers, every fourth of which is 0, 0, 0, 1", numbers.tolist())
    T = numbers.reshape(4, 4).T
    return rigid_transform(check_rotation(path, T[:3, :3], "the pose") @ SYNTHIA_CAMERA_AXES, T[:3, 3])


class SynthiaSequence(FrameSequence):
    """The frames of a sequence, read and checked on access.

    There is no LIDAR. The LIDAR frame is placed at the camera, with x forward, y left and z up, and `Frame.points` is
    the depth image thinned by `depth_scan`. The files don't contain the camera's height, so it is estimated from the
    road in the first image, assuming a horizontal camera. The bird's-eye truth projects the labels to the grid with the
    full depth image; cells that the camera doesn't see remain unlabelled. The world frame is the LIDAR frame of the
    first image.

    Parameters
    ----------
    root : path-like
        The folder with the sequences.
    sequence : str
        Name of the sequence's folder, such as "SYNTHIA-SEQS-04-SPRING".

    Raises
    ------
    DataError
        When the sequence has no images. `drive[k]` raises it when a file of the frame is missing or damaged.
    """

    label_set = SYNTHIA_10

    def __init__(self, root: str | Path, sequence: str) -> None:
        self.folder = Path(root) / sequence
        self.name = sequence
        images = frame_numbers(self.folder / "RGB" / VIEW, "images", IMAGE_SUFFIXES)
        self._numbers = range(images[0], images[-1] + 1)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._numbers)

    def image_file(self, k: int) -> Path:
        """Return the file of a frame's image. Parameters are those of `DriveFiles.scan_file`."""
        return photograph(self.folder / "RGB" / VIEW, f"{self.numbers[k]:06d}")

    def path(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the poses of the camera, (N, 4, 4) T_world_from_lidar in metres, z up, and their times, (N,)."""
        up = _UP_FROM_SYNTHIA
        return np.array([up @ self._pose(k) for k in range(len(self))]), np.arange(len(self)) * SYNTHIA_PERIOD

    def pose_name(self, k: int) -> str:
        """Return where a pose is. Parameters are those of `DriveFiles.scan_file`."""
        return str(self._file("CameraParams", k, ".txt"))

    def problems(self) -> list[str]:
        """Read every frame, and check that the camera moves forward, as on a driving car.

        Returns
        -------
        list of str
            One line for each problem; empty when there are none.
        """
        return super().problems() or list(filter(None, [error_of(self._check_motion)]))

    def _check_motion(self) -> None:
        """Reject poses with a camera that doesn't mostly move forward, because they use another convention."""
        poses = [self._pose(k) for k in range(len(self))]
        steps = np.array([(invert_rigid(a) @ b)[:3, 3] for a, b in pairwise(poses)]).reshape(-1, 3)
        lengths = np.linalg.norm(steps, axis=1)
        ahead = steps[lengths > STATIONARY_STEP, 0] / lengths[lengths > STATIONARY_STEP]
        if ahead.size and np.median(ahead) < FORWARD_SHARE:
            found = f"of a step of the camera {np.median(ahead):.2f} ahead (median)"
            raise DataError(self.folder / "CameraParams", f"steps of which at least {FORWARD_SHARE} are ahead", found)

    def _frame(self, k: int) -> Frame:
        size = self.camera.size
        depth = read_synthia_depth(self._file("Depth", k), size)
        points = depth_scan(depth, self.camera)
        return Frame(
            image=read_image(self.image_file(k), size),
            points=points,
            camera=self.camera,
            T_world_from_lidar=invert_rigid(self._pose(0)) @ self._pose(k),
            time=k * SYNTHIA_PERIOD,
            labels=self._labels(read_synthia_labels(self._file("GT/LABELS", k), size), depth),
            vehicle_returns=np.zeros(len(points), np.bool_),  # a depth image doesn't show the vehicle
        )

    @cached_property
    def camera(self) -> Camera:
        """The calibration, the same for all frames, at the size of the first image."""
        height, width = read_image(self.image_file(0), None).shape[:2]
        path = self.folder / "CameraParams" / "intrinsics.txt"
        K = read_synthia_intrinsics(path)
        T_camera_from_lidar = rigid_transform(_CAMERA_FROM_LIDAR, np.zeros(3))
        return camera_from(path, K, T_camera_from_lidar, (height, width), self._camera_height(K, (height, width)))

    def _camera_height(self, K: NDArray[np.float64], size: tuple[int, int]) -> float:
        """Return the median height of the camera above the nearby road in the first image."""
        path = self._file("GT/LABELS", 0)
        classes = read_synthia_labels(path, size)
        depth = read_synthia_depth(self._file("Depth", 0), size)
        road = np.isin(classes, [SYNTHIA_10.index("road"), SYNTHIA_10.index("lane")]) & (depth < GROUND_RANGE)
        rows = np.nonzero(road)[0]
        if not rows.size:
            raise DataError(path, f"road within {GROUND_RANGE:g} m, to know the camera's height", "none")
        height = float(np.median((rows - K[1, 2]) / K[1, 1] * depth[road]))
        if height <= 0:
            raise DataError(path, "road below the camera", f"road {-height:.2f} m above it")
        if height < LOWEST_CAMERA:
            expected = f"a camera at least {LOWEST_CAMERA} m above the road"
            raise DataError(path, expected, f"{height:.2g} m: is the depth in metres, not in centimetres?")
        return height

    def _labels(self, classes: NDArray[np.uint8], depth: NDArray[np.float32]) -> FrameLabels:
        """Project the labels of an image to the grid with its depth."""
        points, rows, cols = points_from_depth(depth, self.camera)
        points_grid = transform_points(invert_rigid(lidar_from_grid(self.camera.lidar_height)), points)
        birdseye = birdseye_votes(points_grid, classes[rows, cols], LABEL_GRID, SYNTHIA_10)
        return FrameLabels(SYNTHIA_10, classes, depth, birdseye, visible=birdseye != IGNORE)

    def _pose(self, k: int) -> NDArray[np.float64]:
        """Return the pose of the LIDAR in SYNTHIA's world frame."""
        return read_synthia_pose(self._file("CameraParams", k, ".txt")) @ self.camera.T_camera_from_lidar

    def _file(self, kind: str, k: int, suffix: str = ".png") -> Path:
        return self.folder / kind / VIEW / f"{self.numbers[k]:06d}{suffix}"

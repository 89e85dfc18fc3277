"""PandaSet (Xiao et al., ITSC 2021): scans whose returns all have a class, six cameras, and the truth of their streets.

002/lidar/00.pkl.gz                 002/lidar/poses.json                 002/lidar/timestamps.json
002/camera/front_camera/00.jpg      .../poses.json, timestamps.json, intrinsics.json
002/annotations/semseg/00.pkl.gz    002/annotations/cuboids/00.pkl.gz
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, invert_rigid, lidar_from_grid, rigid_transform, transform_points
from semgrid_edu.datasets import pandaset_files as files
from semgrid_edu.datasets.calibration import camera_from
from semgrid_edu.datasets.cuboids import LabelledScan, put_together
from semgrid_edu.datasets.drive_files import first_sound, frame_numbers, photograph
from semgrid_edu.datasets.frames import FrameSequence
from semgrid_edu.datasets.project_lidar import birdseye_votes, cells_in_view, paint_image, unhidden
from semgrid_edu.errors import ArgumentError, DataError, check_text, check_whole
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.reading import read_image

CAMERAS = ("front_camera", "front_left_camera", "front_right_camera", "left_camera", "right_camera", "back_camera")

SUFFIXES = (".jpg", ".jpeg", ".png", ".JPG", ".JPEG", ".PNG")
"""How the names of images may end, the published way first."""

IMAGE_SIZE = (1080, 1920)
"""Height and width of PandaSet's images, pixels."""

ROWS = slice(216, 796)
"""The image rows to keep. They have KITTI's aspect ratio; the sky above and the vehicle's bonnet below are cropped."""

_WINDOW = 20
"""Number of scans kept in memory, 7 MB each: a frame's scan, and nine before and after it."""


class PandasetScene(FrameSequence):
    """The frames of a scene as one of its cameras sees them, each read and checked on access.

    There is a frame for each image of the camera on disk; `numbers` has their published numbers. Frames
    have KITTI's form: the x axis points where the camera looks, along the ground, and the LIDAR is the Pandar64 at the
    instant of the image, when it faces the same way. Only its returns are in `Frame.points`; the labels use both
    LIDARs. The vehicle sways, so each frame has its own camera. The world is PandaSet's.

    The `labels` of a `Frame` come from its own scan: class and depth of the pixels with a return that the camera sees,
    the class of the cells with a return, and which of these cells the camera sees. `truth`, `visible` and
    `image_labels` use other scans too.

    Parameters
    ----------
    root : path-like
        The folder that holds the scenes.
    scene : str
        Number of the scene, such as "002".
    camera : str
        One of `CAMERAS`.

    Raises
    ------
    ArgumentError
        When `scene` isn't text, or there is no such camera.
    DataError
        When there is no such scene, or no image. `scene[k]` raises it when a file that the frame needs is missing or
        damaged.

    Examples
    --------
    >>> scene = PandasetScene("pandaset", "002")                          # doctest: +SKIP
    >>> truth = scene.truth(4, GridSpec.compact(), before=9, after=9)     # doctest: +SKIP
    """

    label_set = KITTI_14
    poses_file = "lidar/poses.json"
    credit = files.CREDIT

    def __init__(self, root: str | Path, scene: str, camera: str = CAMERAS[0]) -> None:
        check_text(scene=(scene, "002"))
        if camera not in CAMERAS:
            raise ArgumentError("camera", f"one of {', '.join(CAMERAS)}", repr(camera))
        self.folder = Path(root) / scene
        self.view = Path(root) / scene / "camera" / camera
        if not self.folder.is_dir():
            there = sorted(path.parent.name for path in Path(root).glob("*/lidar"))
            raise DataError(self.folder, "a scene", f"only {', '.join(there)}" if there else "no scene beside it")
        self.name = f"{scene} {camera}"
        self._opened = (root, scene, camera)
        self._numbers = frame_numbers(self.view, "images", SUFFIXES, digits=2)
        self._scan = lru_cache(_WINDOW)(partial(files.read_pandaset_scan, self.folder))

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.numbers)

    def __reduce__(self) -> tuple:
        """Pickle only the arguments: another process opens the scene and reads the scans itself."""
        return type(self), self._opened

    def scan_file(self, k: int) -> Path:
        """Return the file of a frame's scan. Parameters are those of `DriveFiles.scan_file`."""
        return self.folder / "lidar" / f"{self.numbers[k]:02d}.pkl.gz"

    def image_file(self, k: int) -> Path:
        """Return the file of a frame's image. Parameters are those of `DriveFiles.scan_file`."""
        return photograph(self.view, f"{self.numbers[k]:02d}", SUFFIXES)

    @cached_property
    def camera(self) -> Camera:
        """The calibration at the first frame."""
        return self._camera(0)

    @cached_property
    def lidar_height(self) -> float:
        """Height of the LIDAR above the road within 12 m, metres, at the first frame whose scan can be read."""
        with_scan = [k for k in range(len(self)) if k not in self.gaps]
        k, labelled = first_sound(lambda k: (k, self._scan(self.numbers[k]).labelled), with_scan)
        return files.above_the_road(labelled, self._T_world_from_lidar(k)[:3, 3])

    def truth(self, k: int, spec: GridSpec, before: int = 9, after: int = 9) -> NDArray[np.uint8]:
        """Return the class of each cell with a labelled return, seen by the camera or not.

        Objects outvote the ground below them (`birdseye_votes`). Returns of moving objects in other scans are moved
        with their cuboids to where the objects are at this frame.

        Parameters
        ----------
        k : int
            Number of the frame.
        spec : GridSpec
            The grid, (H, W) cells.
        before, after : int
            How many scans before and after this frame's are added.

        Returns
        -------
        (H, W) uint8
            Classes of KITTI-14; 255 in a cell without a labelled return.

        Raises
        ------
        ArgumentError
            When `before` or `after` is negative.
        DataError
            When a scan has no labels, or its files are damaged.
        """
        points, classes = self._cloud(k, before, after, partial(self._around, k, spec))
        return birdseye_votes(self._in_grid(points), classes, spec, KITTI_14)

    def visible(self, k: int, spec: GridSpec, before: int = 9, after: int = 9) -> NDArray[np.bool_]:
        """Return the cells in which the camera sees a return (`unhidden`), (H, W).

        Parameters and errors are those of `PandasetScene.truth`.
        """
        return self._visible(*self._cloud(k, before, after), self._camera(k), spec)

    def image_labels(self, k: int, size: tuple[int, int], before: int = 0, after: int = 0) -> NDArray[np.uint8]:
        """Return the class of each pixel of the resized image, from the closest return there that the camera sees.

        Labels of single pixels can't be resized like an image, so the returns are projected again for each size.
        Parameters not named here are those of `FrameSequence.image_labels`.

        Parameters
        ----------
        before, after : int
            How many scans before and after this frame's are added.

        Returns
        -------
        (h, w) uint8
            Classes of KITTI-14; 255 where there is no such return, or the closest one is unlabelled.
        """
        points, classes = self._cloud(k, before, after)
        return paint_image(points, classes, _standing(classes), self._camera(k).resized(size))[0]

    def undecided(self, k: int, spec: GridSpec) -> NDArray[np.bool_]:
        """Return the cells in view of the camera, (H, W); only some of them have a labelled return.

        Parameters are those of `FrameSequence.truth`.
        """
        return cells_in_view(self._camera(k), spec)

    def path(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the poses of the vehicle, (N, 4, 4) T_world_from_vehicle with x forward, and their times, (N,)."""
        forward = np.eye(4)
        forward[:2, :2] = [[0, -1], [1, 0]]  # the y axis of PandaSet's poses points ahead
        return self._poses @ forward, self._times

    def _frame(self, k: int) -> Frame:
        frame = self.without_labels(k)
        return replace(frame, labels=self._labels(k, frame.camera))

    def without_labels(self, k: int) -> Frame:
        """Read a frame without its labels. Parameters are those of `FrameSequence.without_labels`."""
        camera = self._camera(k)
        T_world_from_lidar = self._T_world_from_lidar(k)
        scan = self._scan_of(k)
        turning = scan.lidars == files.TURNING
        points = transform_points(invert_rigid(T_world_from_lidar), scan.points[turning])
        points = np.column_stack([points, scan.reflectance[turning]]).astype(np.float32)
        image = read_image(self.image_file(k), IMAGE_SIZE)[ROWS]
        start, now = self._camera_times[[self.numbers[0], self.numbers[k]]]
        on_vehicle = files.on_the_roof(scan.points[turning], self._poses[self.numbers[k]])
        return Frame(image, points, camera, T_world_from_lidar, float(now - start), vehicle_returns=on_vehicle)

    def _scan_of(self, k: int) -> files.PandasetScan:
        return files.NO_SCAN if k in self.gaps else self._scan(self.numbers[k])

    def _labels(self, k: int, camera: Camera) -> FrameLabels | None:
        if self._scan_of(k).labelled is None:
            return None
        points, classes = self._cloud(k)
        image, depth = paint_image(points, classes, _standing(classes), camera)
        birdseye = birdseye_votes(self._in_grid(points), classes, LABEL_GRID, KITTI_14)
        visible = self._visible(points, classes, camera, LABEL_GRID)
        return FrameLabels(KITTI_14, image, depth, birdseye, visible, cells_in_view(camera, LABEL_GRID))

    def _around(self, k: int, spec: GridSpec, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points in the world can be in the grid of frame k; most of a window of scans can't."""
        T_lidar_from_world = invert_rigid(self._T_world_from_lidar(k))
        x, y = (points @ row[:3] + row[3] for row in T_lidar_from_world[:2])
        return (x > spec.x_min - 1) & (x < spec.x_max + 1) & (y > spec.y_min - 1) & (y < spec.y_max + 1)

    def _cloud(
        self, k: int, before: int = 0, after: int = 0, wanted: Callable[[NDArray], NDArray[np.bool_]] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        """Return the returns of a window of scans in the LIDAR frame of frame k, and their classes."""
        check_whole(before=before, after=after)
        number = self.numbers[k]
        scans = frame_numbers(self.folder / "lidar", "scans", [".pkl.gz"], digits=2)
        earlier = [n for n in scans if n < number]
        later = [n for n in scans if n > number]
        others = earlier[max(len(earlier) - before, 0) :] + later[:after]
        now, *rest = (self._labelled_scan(n) for n in (number, *others))
        points, classes = put_together(now, rest, wanted)
        return transform_points(invert_rigid(self._T_world_from_lidar(k)), points), classes

    def _in_grid(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return transform_points(invert_rigid(lidar_from_grid(self.lidar_height)), points)

    def _visible(self, points: NDArray, classes: NDArray, camera: Camera, spec: GridSpec) -> NDArray[np.bool_]:
        seen = unhidden(points, _standing(classes), camera)
        rows, cols, inside = spec.cells(self._in_grid(points[seen]))
        visible = np.zeros(spec.shape, np.bool_)
        visible[rows[inside], cols[inside]] = True
        return visible

    def _labelled_scan(self, number: int) -> LabelledScan:
        labelled = self._scan(number).labelled
        if labelled is None:
            raise DataError(files.semseg_folder(self.folder), "the classes of the returns", "no folder")
        return labelled

    def _camera(self, k: int) -> Camera:
        """Return a frame's calibration for the cropped rows."""
        path = self.view / "intrinsics.json"
        K = files.read_intrinsics(path)
        K[1, 2] -= ROWS.start
        T = invert_rigid(self._camera_poses[self.numbers[k]]) @ self._T_world_from_lidar(k)
        return camera_from(path, K, T, (ROWS.stop - ROWS.start, IMAGE_SIZE[1]), self.lidar_height)

    def _T_world_from_lidar(self, k: int) -> NDArray[np.float64]:
        """Return the pose of the Pandar64 at the instant of the image, turned in the camera's direction."""
        number = self.numbers[k]
        poses = self._poses
        times = self._times
        places = poses[:, :3, :3] @ files.LIDAR_IN_POSE + poses[:, :3, 3]
        velocity = np.gradient(places, times, axis=0)[number]
        ahead = self._camera_poses[number][:3, 2]
        turn = Rotation.from_euler("z", np.arctan2(ahead[1], ahead[0])).as_matrix()
        return rigid_transform(turn, places[number] + velocity * (self._camera_times[number] - times[number]))

    @cached_property
    def _poses(self) -> NDArray[np.float64]:
        # A velocity needs two poses, even for a single frame.
        return files.read_poses(self.folder / "lidar" / "poses.json", max(self.numbers[-1] + 1, 2))

    @cached_property
    def _times(self) -> NDArray[np.float64]:
        return files.read_times(self.folder / "lidar" / "timestamps.json", len(self._poses))

    @cached_property
    def _camera_poses(self) -> NDArray[np.float64]:
        return files.read_poses(self.view / "poses.json", self.numbers[-1] + 1)

    @cached_property
    def _camera_times(self) -> NDArray[np.float64]:
        return files.read_times(self.view / "timestamps.json", len(self._camera_poses))


def _standing(classes: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which returns may hide something from a camera: all except the ground's."""
    return ~np.isin(classes, [KITTI_14.index(name) for name in ("road", "sidewalk")])

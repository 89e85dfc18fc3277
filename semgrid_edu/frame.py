"""A frame: the data of a vehicle's sensors at one instant of a drive, and the true labels, if they are known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet

LABEL_GRID = GridSpec(x_min=0.0, x_max=71.0, y_min=-15.5, y_max=15.5, cell=0.1)
"""The fine grid, (710, 310), in which true bird's-eye labels are kept; coarser grids are pooled from it."""


@dataclass(frozen=True, eq=False)
class FrameLabels:
    """The truth at one instant, from a simulator or an annotator.

    Parameters
    ----------
    label_set : LabelSet
        The classes of the numbers in `image` and `birdseye`.
    image : (h, w) uint8
        The class of each pixel; 255 where unlabelled.
    depth : (h, w) float32
        Depth of each pixel along the camera's z axis, metres; NaN where there is none (sky).
    birdseye : (710, 310) uint8
        The class of each 0.1 m cell of `LABEL_GRID`, seen or not; 255 where unlabelled.
    visible : (710, 310) bool
        Whether the camera sees what is in the cell.
    undecided : (710, 310) bool, optional
        For labels with gaps: whether the cell is in view of the camera, which may see something unlabelled there. None
        when everything that the camera sees is labelled.
    """

    label_set: LabelSet
    image: NDArray[np.uint8]
    depth: NDArray[np.float32]
    birdseye: NDArray[np.uint8]
    visible: NDArray[np.bool_]
    undecided: NDArray[np.bool_] | None = None

    def birdseye_on(self, spec: GridSpec) -> NDArray[np.uint8]:
        """Pool the bird's-eye labels to a coarser grid.

        A cell takes the class that `LabelSet.most_voted` finds among its fine cells: an object, even if it is a thin
        pole in a single fine cell, or else the ground. It is 255 where no fine cell is labelled.

        Parameters
        ----------
        spec : GridSpec
            The extent of `LABEL_GRID`, a multiple of its cell.
        """
        fine = np.moveaxis(blocks(self.birdseye, spec), -1, 0).copy()  # to add up a few maps, not many short rows
        counts = np.stack([(fine == c).sum(axis=0) for c in range(len(self.label_set))])
        return self.label_set.most_voted(counts, otherwise=IGNORE)

    def visible_on(self, spec: GridSpec) -> NDArray[np.bool_]:
        """Pool visibility to a coarser grid, (H, W) bool: a cell is visible when any part of it is.

        Parameters
        ----------
        spec : GridSpec
            The extent of `LABEL_GRID`, a multiple of its cell.
        """
        return blocks(self.visible, spec).any(axis=-1)

    def undecided_on(self, spec: GridSpec) -> NDArray[np.bool_]:
        """Pool `undecided` to a coarser grid, (H, W) bool: a cell is undecided when any part of it is.

        Parameters
        ----------
        spec : GridSpec
            The extent of `LABEL_GRID`, a multiple of its cell.
        """
        return np.zeros(spec.shape, np.bool_) if self.undecided is None else blocks(self.undecided, spec).any(axis=-1)


@dataclass(frozen=True, eq=False)
class Frame:
    """One instant of a drive.

    Parameters
    ----------
    image : (h, w, 3) uint8 or None
        The rectified camera image, RGB; None when the drive has no such camera folder.
    points : (N, 4) float32
        LIDAR returns: x forward, y left, z up in the LIDAR frame (metres), and reflectance 0..1.
    camera : Camera
        Calibration of the image, known even where there is no image.
    T_world_from_lidar : (4, 4) float64
        Pose of the LIDAR, metres. The world is the frame of the IMU at the first oxts packet of the drive (a reading of
        KITTI's GPS and IMU); readers of drives without oxts document theirs.
    time : float
        Seconds since the first LIDAR scan of the drive.
    labels : FrameLabels or None
        The truth, where it is known.
    vehicle_returns : (N,) bool or None
        Which returns hit the vehicle itself. None where the reader doesn't know; a filter then uses the vehicle's
        outline (`SensorModel.vehicle`), which is aligned with the grid.
    """

    image: NDArray[np.uint8] | None
    points: NDArray[np.float32]
    camera: Camera
    T_world_from_lidar: NDArray[np.float64]
    time: float
    labels: FrameLabels | None = None
    vehicle_returns: NDArray[np.bool_] | None = None

    def need_image(self) -> NDArray[np.uint8]:
        """Return the image, (h, w, 3) uint8, RGB; raise an error if there is none or its size isn't the camera's."""
        if self.image is None:
            raise ArgumentError("frame", "a frame with a camera image", "a frame without one")
        expected = (*self.camera.size, 3)
        if np.shape(self.image) != expected or self.image.dtype != np.uint8:
            found = f"{np.shape(self.image)} {getattr(self.image, 'dtype', type(self.image).__name__)}"
            raise ArgumentError("image", f"{expected} uint8, the size of its camera", found)
        return self.image

    @property
    def points_grid(self) -> NDArray[np.float32]:
        """(N, 4) float32: the returns in the grid frame, so that z is the height above flat ground.

        (N, 5) where `vehicle_returns` is known: it is the last column.
        """
        points = self.points + np.array([0, 0, self.camera.lidar_height, 0], dtype=self.points.dtype)
        if self.vehicle_returns is None:
            return points
        return np.column_stack([points, self.vehicle_returns])


def blocks(fine: NDArray, spec: GridSpec) -> NDArray:
    """Return the values of the fine cells in each cell of a coarser grid.

    Parameters
    ----------
    fine : (710, 310) of any type
        One value for each cell of `LABEL_GRID`.
    spec : GridSpec
        The coarser grid: the extent of `LABEL_GRID`, a multiple of its cell.

    Returns
    -------
    (H, W, n) of the same type
        The n fine values in each cell, row by row.
    """
    factor = round(spec.cell / LABEL_GRID.cell)
    height, width = spec.shape
    coarsening = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, LABEL_GRID.cell) == LABEL_GRID
    if not coarsening or (height * factor, width * factor) != LABEL_GRID.shape:
        raise ArgumentError("spec", f"a coarsening of {LABEL_GRID}", spec)
    return fine.reshape(height, factor, width, factor).swapaxes(1, 2).reshape(height, width, -1)


def resize_image(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Average an image over larger pixels; its calibration becomes `camera.resized(size)`.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    size : (int, int)
        The new height and width, pixels.

    Returns
    -------
    (size[0], size[1], 3) uint8
    """
    return np.asarray(Image.fromarray(image).resize(size[::-1], Image.Resampling.BOX))

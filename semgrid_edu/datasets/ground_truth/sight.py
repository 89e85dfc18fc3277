"""Which cells the camera sees, as far as a LIDAR scan tells: no farther than the last return in their direction (4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import invert_rigid, project, transform_points
from semgrid_edu.datasets.returns import seen_returns
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec

SIGHT_COLUMNS = 100
"""Number of directions into which the image is divided, as wide as one column of the coarse simulated LIDAR."""


def in_sight(frame: Frame, spec: GridSpec) -> NDArray[np.bool_]:
    """Return which cells lie in the sight of the camera.

    The image is divided into upright strips. In each strip the camera sees as far as the farthest of the returns that
    the camera sees (`seen_returns`).

    Parameters
    ----------
    frame : Frame
        The frame; its points and its calibration are used.
    spec : GridSpec
        The grid.

    Returns
    -------
    (H, W) bool
    """
    centers = np.concatenate([spec.centers(), np.full((*spec.shape, 1), frame.camera.lidar_height)], axis=-1)
    T_camera_from_grid = frame.camera.T_camera_from_grid
    pixels, ahead = project(transform_points(T_camera_from_grid, centers), frame.camera)
    height, width = frame.camera.size
    strips = np.where(ahead, np.nan_to_num(pixels[..., 0]) * SIGHT_COLUMNS / width, 0).astype(int)
    eye = invert_rigid(T_camera_from_grid)[:2, 3]
    distance = np.hypot(*np.moveaxis(spec.centers() - eye, -1, 0))
    seen_pixels, seen_cells = seen_returns(frame, spec, (height, width))
    farthest = np.zeros(SIGHT_COLUMNS)
    np.maximum.at(farthest, seen_pixels % width * SIGHT_COLUMNS // width, distance.ravel()[seen_cells])
    return ahead & (distance <= farthest[strips])

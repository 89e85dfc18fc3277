"""The pixel and the cell of each LIDAR return that the camera sees: how image labels reach the grid (section 4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import project, transform_points
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec


def closest_returns(frame: Frame) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the returns that the camera sees: the closest one at each pixel.

    The LIDAR stands above the camera, so it looks over things that hide from the camera what is behind them. Such a
    hidden return is left out when it shares its pixel with a return of what hides it, which is closer. With few returns
    most share no pixel, and stay.

    Parameters
    ----------
    frame : Frame
        The frame; its points and its calibration are used, its image isn't.

    Returns
    -------
    returns : (N,) int64
        Numbers of the points that are seen.
    uv : (N, 2) int64
        The pixel of each, u to the right and v down, at the camera's own resolution.
    """
    in_camera = transform_points(frame.camera.T_camera_from_lidar, frame.points[:, :3])
    uv, visible = project(in_camera, frame.camera)
    seen = np.flatnonzero(visible)
    seen = seen[np.argsort(in_camera[seen, 2], kind="stable")]
    u, v = np.rint(uv[seen]).astype(np.int64).T
    _, closest = np.unique(v * frame.camera.size[1] + u, return_index=True)
    return seen[closest], np.stack([u[closest], v[closest]], axis=-1)


def seen_returns(
    frame: Frame, spec: GridSpec, image_size: tuple[int, int]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Find the pixel and the cell of each return that the camera sees, by `closest_returns`.

    Parameters
    ----------
    frame : Frame
        The frame; its points and its calibration are used, its image isn't.
    spec : GridSpec
        The grid, (H, W) cells.
    image_size : (int, int)
        Height and width of the resized image whose labels are to be carried to the grid, pixels.

    Returns
    -------
    pixels : (N,) int32
        Pixel in the resized image, row * width + column, of each return that is seen and lies in the grid.
    cells : (N,) int32
        Cell of each of these returns, row * W + column.
    """
    returns, uv = closest_returns(frame)
    rows, cols, inside = spec.cells(frame.points_grid[returns])
    u, v = uv[inside].T
    scale_v, scale_u = image_size[0] / frame.camera.size[0], image_size[1] / frame.camera.size[1]
    row, col = ((v + 0.5) * scale_v).astype(np.int32), ((u + 0.5) * scale_u).astype(np.int32)
    return row * image_size[1] + col, (rows * spec.shape[1] + cols)[inside].astype(np.int32)

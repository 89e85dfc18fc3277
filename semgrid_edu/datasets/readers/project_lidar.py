"""The pixel and the cell of each LIDAR return that the camera sees: how image labels reach the grid (section 4)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from semgrid_edu.camera import Camera, project, transform_points
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.planes import plane_heights, plane_pixels

HIDING_ANGLE = 0.2
"""Angle between two neighbouring returns of a scanner with 64 lasers, about, degrees."""

HIDING_BLOCKS = (5, 3)
"""Rows and columns of blocks, `HIDING_ANGLE` wide, in which a standing point in the middle one hides what is behind it.

There are more rows because the lasers lie farther apart than the returns of one laser."""


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


def cells_in_view(camera: Camera, spec: GridSpec) -> NDArray[np.bool_]:
    """Return the cells in view, (H, W): above its centre, a point of some plane lies in the image, hidden or not.

    Parameters
    ----------
    camera : Camera
        The camera.
    spec : GridSpec
        The grid, (H, W) cells.
    """
    return plane_pixels(spec, plane_heights(), camera)[1].any(axis=0)


def unhidden(points: NDArray, hiding: NDArray[np.bool_], camera: Camera) -> NDArray[np.bool_]:
    """Return which points the camera sees: in its image, and behind nothing that stands.

    The LIDAR stands elsewhere than the camera, and other scans were taken from other places. So some points lie behind
    things that hide them from the camera, but most of these share no pixel with a point of what hides them, as
    `closest_returns` would need. Therefore what stands is taken to have no gaps between its points: the image is
    divided into blocks, and a point is hidden if a standing one is 0.5 m and 3 % closer in its block or in a block
    around it (`HIDING_BLOCKS`). This also hides a narrow strip of what the camera sees just above a standing thing.

    Parameters
    ----------
    points : (N, 3) float
        LIDAR frame, metres.
    hiding : (N,) bool
        Whether the point is of something that stands and can hide others: the ground hides nothing.
    camera : Camera
        The camera.

    Returns
    -------
    (N,) bool
    """
    in_camera = transform_points(camera.T_camera_from_lidar, points)
    uv, seen = project(in_camera, camera)
    block = np.radians(HIDING_ANGLE) * camera.K[0, 0]
    rows, cols = (uv[seen, ::-1] // block).astype(np.int64).T
    depth = in_camera[seen, 2]
    closest = np.full([int(side // block) + 1 for side in camera.size], np.inf)
    np.minimum.at(closest, (rows[hiding[seen]], cols[hiding[seen]]), depth[hiding[seen]])
    seen[seen] = depth <= 1.03 * minimum_filter(closest, HIDING_BLOCKS, mode="nearest")[rows, cols] + 0.5
    return seen

"""LIDAR returns that the camera sees, the class of a cell by its labelled points, and depth images (section 4)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from semgrid_edu.camera import Camera, invert_rigid, project, transform_points
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet
from semgrid_edu.planes import plane_heights

HIDING_ANGLE = 0.2
"""Approximate angle between two neighbouring returns of a scanner with 64 lasers, degrees."""

HIDING_BLOCKS = (5, 3)
"""Rows and columns of blocks, `HIDING_ANGLE` wide, in which an object's point in the middle one hides what is behind.

There are more rows because the lasers are farther apart than the returns of one laser."""


def closest_returns(frame: Frame) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the returns that the camera sees: the closest one at each pixel.

    The LIDAR is above the camera, so it sees over objects that block the camera's view. An occluded return is dropped
    if a closer return has the same pixel. With few returns most don't share a pixel, and are kept.

    Parameters
    ----------
    frame : Frame
        The frame; its points and its calibration are used, its image isn't.

    Returns
    -------
    returns : (N,) int64
        Numbers of the points that are seen.
    uv : (N, 2) int64
        The pixel of each, u to the right and v down, at the camera's resolution.
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
        Pixel in the resized image, row * width + column, of each return that is seen and is in the grid.
    cells : (N,) int32
        Cell of each of these returns, row * W + column.
    """
    returns, uv = closest_returns(frame)
    rows, cols, inside = spec.cells(frame.points_grid[returns])
    u, v = uv[inside].T
    scale_v = image_size[0] / frame.camera.size[0]
    scale_u = image_size[1] / frame.camera.size[1]
    row = ((v + 0.5) * scale_v).astype(np.int32)
    col = ((u + 0.5) * scale_u).astype(np.int32)
    return row * image_size[1] + col, (rows * spec.shape[1] + cols)[inside].astype(np.int32)


def cells_in_view(camera: Camera, spec: GridSpec) -> NDArray[np.bool_]:
    """Return the cells in view, (H, W): a point above its centre, in some plane, is in the image, hidden or not.

    Parameters
    ----------
    camera : Camera
        The camera.
    spec : GridSpec
        The grid, (H, W) cells.
    """
    centers = spec.centers()
    in_view = np.zeros(spec.shape, np.bool_)
    for height in plane_heights():
        points = np.insert(centers[~in_view], 2, height, axis=1)  # skip cells of which a lower point is in the image
        in_view[~in_view] = project(transform_points(camera.T_camera_from_grid, points), camera)[1]
    return in_view


def unhidden(points: NDArray, hiding: NDArray[np.bool_], camera: Camera) -> NDArray[np.bool_]:
    """Return which points the camera sees: those in its image that no object occludes.

    The LIDAR and the camera are in different places, and other scans were taken from elsewhere. So some points are
    occluded, but most of these don't share a pixel with a point of the occluding object, as `closest_returns` would
    need. So we assume that objects have no gaps between their points: the image is divided into blocks, and a point is
    hidden if a point of an object is 0.5 m and 3 % closer in the same block or in a block around it (`HIDING_BLOCKS`).
    This also hides a narrow visible strip just above an object.

    Parameters
    ----------
    points : (N, 3) float
        LIDAR frame, metres.
    hiding : (N,) bool
        Whether the point belongs to an object, which can hide others: the ground hides nothing.
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


CLEARANCE = 2.5
"""Metres. A point this far above the lowest point of its cell overhangs it, as branches do. It is a vehicle's height,
and also the height up to which `SensorModel` counts returns as obstacles."""


def paint_image(
    points: NDArray, classes: NDArray[np.uint8], hiding: NDArray[np.bool_], camera: Camera
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return class and depth of the closest return on each pixel that the camera sees.

    Parameters
    ----------
    points : (N, 3) float
        LIDAR frame, metres.
    classes : (N,) uint8
        Class of each.
    hiding : (N,) bool
        Whether it can hide others, see `unhidden`.
    camera : Camera
        The camera.

    Returns
    -------
    classes : (h, w) uint8
        255 where there is no return.
    depth : (h, w) float32
        Metres along the optical axis; NaN where there is no return.
    """
    seen = unhidden(points, hiding, camera)
    points = points[seen]
    returns, uv = closest_returns(Frame(None, points, camera, np.eye(4), 0.0))
    u, v = uv.T
    image = np.full(camera.size, IGNORE, np.uint8)
    image[v, u] = classes[seen][returns]
    depth = np.full(camera.size, np.nan, np.float32)
    depth[v, u] = transform_points(camera.T_camera_from_lidar, points[returns])[:, 2]
    return image, depth


def birdseye_votes(
    points_grid: NDArray, classes: NDArray[np.uint8], spec: GridSpec, label_set: LabelSet
) -> NDArray[np.uint8]:
    """Compute the class of each cell by a vote of its labelled points.

    Branches and signs that hang over a road don't make it vegetation or signage: points more than `CLEARANCE` above the
    lowest labelled point in their cell have no vote. Among the others `LabelSet.most_voted` decides: an object
    outvotes the ground below it.

    Parameters
    ----------
    points_grid : (N, 3+) float
        Points in the grid frame, metres.
    classes : (N,) uint8
        The class of each point; 255 (unlabelled) has no vote.
    spec : GridSpec
        The grid, (H, W) cells.
    label_set : LabelSet
        The classes of the numbers.

    Returns
    -------
    (H, W) uint8
        255 in a cell without a labelled point.
    """
    rows, cols, inside = spec.cells(points_grid)
    kept = inside & (classes != IGNORE)
    cells = (rows * spec.shape[1] + cols)[kept]
    z = points_grid[kept, 2]
    classes = classes[kept]
    lowest = np.full(spec.shape[0] * spec.shape[1], np.inf, dtype=z.dtype)
    np.minimum.at(lowest, cells, z)
    below = z <= lowest[cells] + CLEARANCE
    votes = np.zeros((len(label_set), lowest.size), dtype=np.int64)
    np.add.at(votes, (classes[below], cells[below]), 1)
    return label_set.most_voted(votes.reshape(len(label_set), *spec.shape), otherwise=IGNORE)


LIDAR_ROW_STEP, LIDAR_COL_STEP = 4, 2
"""Every fourth row and every second column makes a depth image about as sparse as a LIDAR scan."""

DEPTH_RANGE = 80.0
"""Metres up to which a depth image is used: the range of a LIDAR on most surfaces."""


def points_from_depth(
    depth: NDArray, camera: Camera, row_step: int = 1, col_step: int = 1
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the points in space of the pixels of a depth image, up to `DEPTH_RANGE`.

    Parameters
    ----------
    depth : (h, w) float
        Metres along the optical axis; NaN where it isn't known.
    camera : Camera
        The camera that took it, of this size.
    row_step, col_step : int
        Every `row_step`-th row and every `col_step`-th column is kept, beginning with the first; 1 keeps all.

    Returns
    -------
    points : (N, 3) float64
        LIDAR frame, metres.
    rows, cols : (N,) int64
        The pixel of each point.
    """
    v, u = np.mgrid[: depth.shape[0] : row_step, : depth.shape[1] : col_step]
    sampled = depth[v, u]
    near = sampled < DEPTH_RANGE
    rays = np.stack([u[near], v[near], np.ones(near.sum())], axis=-1) @ np.linalg.inv(camera.K).T
    points = transform_points(invert_rigid(camera.T_camera_from_lidar), rays * sampled[near, None])
    return points, v[near], u[near]


def depth_scan(
    depth: NDArray, camera: Camera, row_step: int = LIDAR_ROW_STEP, col_step: int = LIDAR_COL_STEP
) -> NDArray[np.float32]:
    """Return a depth image thinned to a LIDAR's sparsity, in the form of a scan.

    As the paper says, this doesn't turn it into LIDAR data; it only reduces the amount of depth. By default every
    fourth row and every second column is kept, up to 80 m. The reflectance is 0, because a depth image has none.

    Parameters are those of `points_from_depth`.

    Returns
    -------
    (N, 4) float32
        x, y, z in the LIDAR frame, metres, and reflectance 0.
    """
    points, _, _ = points_from_depth(depth, camera, row_step, col_step)
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)

"""From labelled points to bird's-eye classes, and from a depth image to such points (section 4).

The readers of data sets whose truth isn't given from above use both: SYNTHIA has depth images, SemanticKITTI has scans.
"""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera, invert_rigid
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet

CLEARANCE = 2.5
"""Metres above the lowest point of a cell from which on a point hangs over what stands there: the top of a vehicle,
up to which `SensorModel` counts returns as obstacles too."""

LIDAR_ROW_STEP, LIDAR_COL_STEP = 4, 2
"""Every fourth row and every second column makes a depth image about as sparse as a LIDAR scan."""

DEPTH_RANGE = 80.0
"""Metres up to which a depth image is used: what a LIDAR reaches on most surfaces."""


def birdseye_votes(
    points_grid: NDArray, classes: NDArray[np.uint8], spec: GridSpec, label_set: LabelSet
) -> NDArray[np.uint8]:
    """Let labelled points vote on the class of the cells that they lie in.

    Branches and signs that hang over a road don't make it vegetation or signage: points more than `CLEARANCE` above the
    lowest labelled point in their cell have no vote. Among the others `LabelSet.most_voted` decides: what stands in a
    cell outvotes the ground below it.

    Parameters
    ----------
    points_grid : (N, 3+) float
        Points in the grid frame, metres.
    classes : (N,) uint8
        The class of each point; 255 (unlabelled) has no vote.
    spec : GridSpec
        The grid, (H, W) cells.
    label_set : LabelSet
        The classes that the numbers stand for.

    Returns
    -------
    (H, W) uint8
        255 in a cell without a labelled point.
    """
    rows, cols, inside = spec.cells(points_grid)
    kept = inside & (classes != IGNORE)
    cells, z, classes = (rows * spec.shape[1] + cols)[kept], points_grid[kept, 2], classes[kept]
    lowest = np.full(spec.shape[0] * spec.shape[1], np.inf, dtype=z.dtype)
    np.minimum.at(lowest, cells, z)
    below = z <= lowest[cells] + CLEARANCE
    votes = np.zeros((len(label_set), lowest.size), dtype=np.int64)
    np.add.at(votes, (classes[below], cells[below]), 1)
    return label_set.most_voted(votes.reshape(len(label_set), *spec.shape), otherwise=IGNORE)


def points_from_depth(
    depth: NDArray, camera: Camera, row_step: int = 1, col_step: int = 1
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the points in space that the pixels of a depth image show, up to `DEPTH_RANGE`.

    Parameters
    ----------
    depth : (h, w) float
        Metres along the optical axis; NaN where there is none.
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
    T = invert_rigid(camera.T_camera_from_lidar)
    points = (rays * sampled[near, None]) @ T[:3, :3].T + T[:3, 3]
    return points, v[near], u[near]


def depth_scan(
    depth: NDArray, camera: Camera, row_step: int = LIDAR_ROW_STEP, col_step: int = LIDAR_COL_STEP
) -> NDArray[np.float32]:
    """Return a depth image thinned to a LIDAR's sparsity, in the form of a scan.

    As the paper says, this doesn't make it LIDAR data; it only reduces the amount of depth. By default every fourth row
    and every second column is kept, up to 80 m. The reflectance is 0, because a depth image has none.

    Parameters
    ----------
    depth : (h, w) float
        Metres along the optical axis; NaN where there is none.
    camera : Camera
        The camera that took it, of this size.
    row_step, col_step : int
        As `points_from_depth` takes them.

    Returns
    -------
    (N, 4) float32
        x, y, z in the LIDAR frame, metres, and reflectance 0.
    """
    points, _, _ = points_from_depth(depth, camera, row_step, col_step)
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)

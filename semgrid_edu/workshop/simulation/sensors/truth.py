"""Bird's-eye ground truth: the kind of every 0.1 m cell, and whether the camera sees it."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.frame import LABEL_GRID
from semgrid_edu.workshop.simulation.sensors.camera import Picture
from semgrid_edu.workshop.simulation.sensors.rig import Rig
from semgrid_edu.workshop.simulation.street.footprints import stamp
from semgrid_edu.workshop.simulation.street.ground import ground_height, ground_kinds
from semgrid_edu.workshop.simulation.street.layout import Road, to_road
from semgrid_edu.workshop.simulation.things.materials import Kind

_SEEN_PIXELS = 12
"""If the image shows at least this many pixels of an object, its whole footprint counts as seen."""
_SOLID_DEPTH = 0.35
"""Facades and foliage count as seen to this depth behind their visible surface, metres."""

_LOOKS_LIKE = np.arange(256, dtype=np.uint8)
"""Kinds merged for the comparison: lane marks count as road, signs as poles."""
_LOOKS_LIKE[Kind.LANE] = Kind.ROAD
_LOOKS_LIKE[Kind.SIGN] = Kind.POLE


@dataclass(frozen=True, eq=False)
class BirdseyeTruth:
    """Bird's-eye ground truth at one instant over `LABEL_GRID`.

    Parameters
    ----------
    kinds : (710, 310) uint8
        The `Kind` of each cell.
    instances : (710, 310) int32
        Number of the car, pedestrian or bicycle in each cell; 0 for anything else.
    visible : (710, 310) bool or None
        Whether the camera sees each cell; None without a picture.
    """

    kinds: NDArray[np.uint8]
    instances: NDArray[np.int32]
    visible: NDArray[np.bool_] | None


def birdseye_truth(
    footprints: NDArray, road: Road, T_world_from_lidar: NDArray, rig: Rig, picture: Picture | None = None
) -> BirdseyeTruth:
    """Return the content of every cell: the object between the ground and 2.5 m, or else the ground.

    Parameters
    ----------
    footprints : (K, 9) float
        From `footprint_table`; where several overlap, the last one wins.
    road : Road
        The street, for the ground.
    T_world_from_lidar : (4, 4) float
        Pose of the LIDAR at that instant, metres.
    rig : Rig
        Gives the calibration of the camera, and the height of the LIDAR above the grid.
    picture : Picture, optional
        The picture that the camera took at that instant, to find out what it sees.
    """
    T_world_from_grid = T_world_from_lidar @ np.linalg.inv(rig.T_grid_from_lidar)
    on_plane = np.concatenate([LABEL_GRID.centers(), np.zeros((*LABEL_GRID.shape, 1))], axis=-1)
    cells = transform_points(T_world_from_grid, on_plane)[..., :2]
    which = np.full(LABEL_GRID.shape, -1, np.int32)
    stamp(footprints, cells, LABEL_GRID.cell, which)
    ground = ground_kinds(road, cells.reshape(-1, 2)).reshape(which.shape)
    kinds = np.where(which >= 0, footprints[which, 6].astype(np.uint8), ground)
    instances = np.where(which >= 0, footprints[which, 7], 0).astype(np.int32)
    visible = None
    if picture:
        T_camera_from_world = rig.camera.T_camera_from_lidar @ np.linalg.inv(T_world_from_lidar)
        visible = _visible_cells(cells, kinds, which, footprints, road, picture, T_camera_from_world, rig.camera.K)
    return BirdseyeTruth(kinds, instances, visible)


@njit(cache=True)
def _pixel(T, K, x, y, z):
    """Return u, v and depth of a world point, and X and Y in the camera frame; depth is 0 behind the camera."""
    X = T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]
    Y = T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]
    Z = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
    if Z < 0.3:
        return 0.0, 0.0, 0.0, X, Y
    return K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2], Z, X, Y


@njit(cache=True)
def _agrees(u, v, z, tolerance, reach, kind, kinds, depth):
    """Return whether a pixel within `reach` of (u, v) shows this kind at this depth."""
    height, width = depth.shape
    row = round(v)
    col = round(u)
    if row < 0 or col < 0 or row >= height or col >= width:
        return False
    for r in range(max(row - reach, 0), min(row + reach + 1, height)):
        for c in range(max(col - reach, 0), min(col + reach + 1, width)):
            if kinds[r, c] == kind and abs(depth[r, c] - z) < tolerance:
                return True
    return False


@njit(cache=True)
def _visible(cells, kinds, which, footprints, road, T, K, pixel_kinds, depth, seen, solid, out):
    """Write whether the camera sees each cell.

    A pixel has one depth for the whole surface patch that it shows, so the tolerance grows with the patch.
    """
    f = K[0, 0]
    # a compiled loop, because one pixel decides most cells, so the search ends early
    for r in range(cells.shape[0]):
        for c in range(cells.shape[1]):
            x, y = cells[r, c]
            s, d = to_road(road, x, y)
            ground = ground_height(road, s, d)
            k = which[r, c]
            if k < 0:
                u, v, z, _, below = _pixel(T, K, x, y, ground)
                patch = min(z * z / (f * max(below, 0.4)), 3.0)
                out[r, c] = z > 0 and _agrees(u, v, z, 0.15 + patch, 0, kinds[r, c], pixel_kinds, depth)
                continue
            instance = int(footprints[k, 7])
            if instance > 0:
                out[r, c] = seen[instance]
                continue
            for i in range(8):
                u, v, z, aside, _ = _pixel(T, K, x, y, ground + footprints[k, 8] * (0.06 + 0.13 * i))
                patch = min(0.7 * z * z / (f * max(abs(aside), 1.0)), 1.0)
                if z > 0 and _agrees(u, v, z, solid + patch, 1, kinds[r, c], pixel_kinds, depth):
                    out[r, c] = True
                    break


def _visible_cells(
    cells: NDArray, kinds: NDArray, which: NDArray, footprints: NDArray, road: Road,
    picture: Picture, T_camera_from_world: NDArray, K: NDArray,
) -> NDArray[np.bool_]:  # fmt: skip
    """Return whether the camera sees the content of each cell.

    A cell is seen if one of its points projects to a pixel with the same kind at the same depth. Bare ground has one
    such point, an object has eight at different heights. A numbered object (car, pedestrian, bicycle) counts as seen
    completely when the image shows 12 of its pixels. A house or hedge counts as seen to 0.35 m behind its surface.
    """
    highest = int(max(footprints[:, 7].max(initial=0), picture.instance.max()))
    seen = np.bincount(picture.instance.ravel(), minlength=highest + 1) >= _SEEN_PIXELS
    out = np.zeros(kinds.shape, np.bool_)
    depth = np.nan_to_num(picture.depth, nan=1e9)
    _visible(
        cells, _LOOKS_LIKE[kinds], which, footprints, road, T_camera_from_world, K,
        _LOOKS_LIKE[picture.kind], depth, seen, _SOLID_DEPTH, out,
    )  # fmt: skip
    return out

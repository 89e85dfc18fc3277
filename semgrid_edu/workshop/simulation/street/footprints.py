"""Footprints: the ground that each object covers, as outlines and as grid cells."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

ROUND, ROUNDED, SQUARE = 2.0, 6.0, 200.0
"""Exponents of outlines: an ellipse, a car seen from above, a rectangle."""


class Footprint(NamedTuple):
    """The superellipse |x/a|^p + |y/b|^p <= 1 that an object covers below 2.5 m.

    Parameters
    ----------
    x, y : float
        Its centre in the world, metres.
    half_length, half_width : float
        Half the side lengths, a and b, metres.
    yaw : float
        Direction of the long side in the world, rad from the x axis, counter-clockwise.
    exponent : float
        Shape of the outline, p: `ROUND`, `ROUNDED` or `SQUARE`.
    kind : int
        `Kind` of the object.
    instance : int
        Number of the car, pedestrian or bicycle; 0 for anything else.
    top : float
        Height above the ground, metres, at most 2.5.
    """

    x: float
    y: float
    half_length: float
    half_width: float
    yaw: float
    exponent: float
    kind: int
    instance: int
    top: float


@njit(cache=True)
def _inside(f, x, y):
    """Return whether the point (x, y) is inside the footprint f, a row of numbers."""
    c = np.cos(f[4])
    s = np.sin(f[4])
    u = abs(c * (x - f[0]) + s * (y - f[1])) / f[2]
    v = abs(c * (y - f[1]) - s * (x - f[0])) / f[3]
    if u > 1.0 or v > 1.0:
        return False
    return u ** f[5] + v ** f[5] <= 1.0


@njit(cache=True)
def stamp(footprints: NDArray, xy: NDArray, cell: float, which: NDArray) -> None:
    """Find the footprint that covers the centre of each cell.

    Parameters
    ----------
    footprints : (K, 9) float
        From `footprint_table`. Where several overlap, the last one wins.
    xy : (H, W, 2) float
        Cell centres in the world, metres, of a regular grid that may be rotated and shifted. The grid's x axis points
        from high rows to low ones, its y axis from high columns to low ones.
    cell : float
        Side of a cell, metres.
    which : (H, W) int32
        Written in place: row of the footprint that covers the cell; unchanged if none does.
    """
    height, width = which.shape
    ex = (xy[0, 0] - xy[1, 0]) / cell
    ey = (xy[0, 0] - xy[0, 1]) / cell
    origin = xy[0, 0]
    # a compiled loop, because each footprint visits only the few cells around it, not the whole grid
    for k in range(len(footprints)):
        f = footprints[k]
        dx = f[0] - origin[0]
        dy = f[1] - origin[1]
        row = -(dx * ex[0] + dy * ex[1]) / cell
        col = -(dx * ey[0] + dy * ey[1]) / cell
        reach = np.hypot(f[2], f[3]) / cell + 1.0
        for r in range(max(int(row - reach), 0), min(int(row + reach) + 2, height)):
            for c in range(max(int(col - reach), 0), min(int(col + reach) + 2, width)):
                if _inside(f, xy[r, c, 0], xy[r, c, 1]):
                    which[r, c] = k


def footprint_table(footprints: NDArray | list[Footprint]) -> NDArray[np.float64]:
    """Return footprints as rows of numbers, (K, 9), one column per field of `Footprint`.

    Parameters
    ----------
    footprints : list of Footprint or (K, 9) float
        K footprints, or none.
    """
    return np.asarray(footprints, dtype=np.float64).reshape(-1, len(Footprint._fields))


def outline(footprint: Footprint, margin: float = 0.0) -> NDArray[np.float64]:
    """Return points on the outline of a footprint.

    Parameters
    ----------
    footprint : Footprint
        The footprint.
    margin : float
        Widens the footprint on every side, metres.

    Returns
    -------
    (25, 2) float64
        24 points of the outline, then the centre: x and y in the world, metres.
    """
    f = footprint
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    c = np.cos(angle)
    s = np.sin(angle)
    radius = (np.abs(c) ** f.exponent + np.abs(s) ** f.exponent) ** (-1 / f.exponent)
    local = np.stack([(f.half_length + margin) * radius * c, (f.half_width + margin) * radius * s], axis=1)
    turn = np.array([[np.cos(f.yaw), np.sin(f.yaw)], [-np.sin(f.yaw), np.cos(f.yaw)]])
    return np.concatenate([local, [[0, 0]]]) @ turn + [f.x, f.y]


def collides(footprint: Footprint, others: NDArray | list[Footprint], margin: float = 0.0) -> bool:
    """Return whether a footprint overlaps any of several others.

    Parameters
    ----------
    footprint : Footprint
        The footprint to check.
    others : (K, 9) float or list of Footprint
        K other footprints, or none.
    margin : float
        Widens `footprint` on every side, metres.
    """
    f = footprint
    others = footprint_table(others)
    reach = np.hypot(others[:, 2], others[:, 3]) + np.hypot(f.half_length, f.half_width) + margin
    near = others[np.hypot(others[:, 0] - f.x, others[:, 1] - f.y) < reach]
    widened = footprint_table([f._replace(half_length=f.half_length + margin, half_width=f.half_width + margin)])[0]
    points = outline(f, margin)
    return any(_any_inside(other, points) or _any_inside(widened, outline(Footprint(*other))) for other in near)


@njit(cache=True)
def _any_inside(f, points):
    """Return whether any of the points is inside the footprint."""
    for i in range(len(points)):  # noqa: SIM110 (numba compiles no generator)
        if _inside(f, points[i, 0], points[i, 1]):
            return True
    return False

"""The ground as a mesh of triangles: fine where kerbs are, coarse elsewhere."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.street.ground import ground_height
from semgrid_edu.workshop.simulation.street.layout import Road, to_world
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, shape

_OUTWARD = np.array(
    [0.0, 0.03, 0.18, 0.6, 1.2, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 17.0, 24.0, 35.0, 50.0, 80.0, 130.0, 250.0]
)
"""Distances outside the asphalt's edge at which the mesh has vertices, metres."""


@dataclass(frozen=True)
class Extent:
    """How far a world reaches along its road.

    Parameters
    ----------
    start, end : float
        The first and the last place: s, metres.
    """

    start: float
    end: float


def _across(road: Road) -> NDArray[np.float64]:
    """Return the d of the mesh's lines: fine at kerbs and, at a junction, over its rounded corners."""
    rim = np.arange(0, road.corner + 0.3, 0.3) if road.side_half else []
    edges = road.left.edge, road.right.edge
    left, right = (np.concatenate([[edge / 2], edge + _OUTWARD, edge + np.asarray(rim)]) for edge in edges)
    return np.unique(np.round(np.concatenate([-right, [0.0], left]), 3))


def _along(road: Road, extent: Extent) -> NDArray[np.float64]:
    """Return the s of the mesh's lines."""
    lines = [np.arange(extent.start, extent.end + 4, 4.0)]
    if road.side_half:
        beyond = road.corner + np.array([1, 2, 3, 4, 6, 8, 11])
        out = np.concatenate([np.arange(0, road.corner + 0.3, 0.3), [0.03, 0.18], beyond])
        lines += [road.junction + side * (road.side_half + out) for side in (-1, 1)]
    return np.unique(np.round(np.concatenate(lines), 3))


@njit(cache=True)
def _vertices(road: Road, s: NDArray, d: NDArray) -> NDArray:
    """Return the mesh's vertices, (len(s), len(d), 3)."""
    out = np.empty((len(s), len(d), 3))
    # numba compiles the loop: the functions of a place that it calls take one place at a time
    for i in range(len(s)):
        for j in range(len(d)):
            x, y, _ = to_world(road, s[i], d[j])
            out[i, j] = x, y, ground_height(road, s[i], d[j])
    return out


def ground_mesh(road: Road, extent: Extent) -> Shape:
    """Make the ground of a street, in the world.

    All of it has one colour and one kind here: `shade` decides what the ground is where a ray meets it, so that lane
    marks need no triangles of their own.

    Parameters
    ----------
    road : Road
        The street.
    extent : Extent
        How far the ground reaches along the street.
    """
    s, d = _along(road, extent), _across(road)
    if road.curvature:
        inner = 0.8 / abs(road.curvature)
        d = d[np.sign(road.curvature) * d < inner]
    vertices = _vertices(road, s, d)
    index = np.arange(len(s) * len(d)).reshape(len(s), len(d))
    a, b, c, e = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.stack([a, b, c, a, c, e], axis=-1).reshape(-1, 3)
    return shape(vertices.reshape(-1, 3), faces, (0.2, 0.2, 0.2), Material.GROUND, Kind.ROAD)

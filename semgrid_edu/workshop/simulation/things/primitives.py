"""Boxes, ellipsoids, tubes and parallelograms, from which the things on a street are put together."""

from functools import cache

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, shape


@cache
def _primitive(name: str, detail: int) -> tuple[NDArray, NDArray]:
    """Return vertices and faces of a primitive of `trimesh`: radius 1 or side 1, about the origin."""
    if name == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=detail, radius=1.0)
    elif name == "cylinder":
        mesh = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=detail)
    else:
        mesh = trimesh.creation.box((1.0, 1.0, 1.0))
    return mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)


def box(centre: ArrayLike, size: ArrayLike, colour: ArrayLike, material: Material, kind: Kind) -> Shape:
    """Make a box whose sides lie along the axes.

    Parameters
    ----------
    centre : (3,) float
        Its middle, metres.
    size : (3,) float
        Its sides along x, y and z, metres.
    colour : (3,) float
        Linear albedo, 0..1.
    material : Material
        What it is made of.
    kind : Kind
        What it belongs to.

    Returns
    -------
    Shape
    """
    vertices, faces = _primitive("box", 0)
    return shape(vertices * np.asarray(size, np.float32) + np.asarray(centre), faces, colour, material, kind)


def ball(centre: ArrayLike, radii: ArrayLike, colour: ArrayLike, material: Material, kind: Kind, detail=1) -> Shape:
    """Make an ellipsoid whose axes lie along x, y and z.

    Parameters
    ----------
    centre : (3,) float
        Its middle, metres.
    radii : (3,) float
        Half its extent along x, y and z, metres.
    colour : (3,) float
        Linear albedo, 0..1.
    material : Material
        What it is made of.
    kind : Kind
        What it belongs to.
    detail : int
        How often the 20 faces of an icosahedron are divided by four.

    Returns
    -------
    Shape
    """
    vertices, faces = _primitive("sphere", detail)
    return shape(vertices * np.asarray(radii, np.float32) + np.asarray(centre), faces, colour, material, kind)


def tube(
    start: ArrayLike,
    end: ArrayLike,
    radii: tuple[float, float],
    colour: ArrayLike,
    material: Material,
    kind: Kind,
    sides: int = 7,
) -> Shape:
    """Make a cylinder or, with two different radii, a frustum.

    Parameters
    ----------
    start, end : (3,) float
        The two ends of its axis, metres.
    radii : (float, float)
        Radius at the start and at the end, metres.
    colour : (3,) float
        Linear albedo, 0..1.
    material : Material
        What it is made of.
    kind : Kind
        What it belongs to.
    sides : int
        Faces around the axis.

    Returns
    -------
    Shape
    """
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    vertices, faces = _primitive("cylinder", sides)
    axis = (end - start) / np.linalg.norm(end - start)
    side = np.cross(axis, [0, 0, 1] if abs(axis[2]) < 0.9 else [1, 0, 0])
    side /= np.linalg.norm(side)
    along = vertices[:, 2:] + 0.5
    radius = radii[0] + (radii[1] - radii[0]) * along
    ring = (vertices[:, :1] * side + vertices[:, 1:2] * np.cross(axis, side)) * radius
    return shape(start + along * (end - start) + ring, faces, colour, material, kind)


def quads(
    corner: ArrayLike, right: ArrayLike, up: ArrayLike, colour: ArrayLike, material: Material, kind: Kind
) -> Shape:
    """Make N parallelograms, each from a corner and two edges; their normals point along right x up.

    Parameters
    ----------
    corner, right, up : (N, 3) or (3,) float
        A corner of each parallelogram and the two edges that start there, metres; one row stands for all N.
    colour : (N, 3) or (3,) float
        Linear albedo, 0..1.
    material : Material
        What it is made of.
    kind : Kind
        What it belongs to.

    Returns
    -------
    Shape
    """
    corner, right, up = np.broadcast_arrays(*(np.atleast_2d(np.asarray(a, np.float32)) for a in (corner, right, up)))
    n = len(corner)
    vertices = np.stack([corner, corner + right, corner + right + up, corner + up], axis=1).reshape(-1, 3)
    faces = (np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(n)[:, None, None]).reshape(-1, 3)
    colours = np.repeat(np.broadcast_to(np.asarray(colour, np.float32), (n, 3)), 2, axis=0)
    return shape(vertices, faces, colours, material, kind)

"""Shapes: triangles that know their colour, material and kind; `trimesh` makes the primitives."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.simulation.things.materials import Kind, Material


@dataclass(frozen=True, eq=False)
class Shape:
    """A soup of triangles, F of them, over V vertices.

    Parameters
    ----------
    vertices : (V, 3) float32
        Metres; z up.
    faces : (F, 3) int32
    normals : (F, 3) float32
        Unit normals for shading, one a face (foliage takes those of its crown, not of its leaves).
    colour : (F, 3) float32
        Linear albedo, 0..1.
    material, kind : (F,) uint8
        Members of `Material` and `Kind`.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    normals: NDArray[np.float32]
    colour: NDArray[np.float32]
    material: NDArray[np.uint8]
    kind: NDArray[np.uint8]

    def placed(self, position: ArrayLike, yaw: float = 0.0, scale: ArrayLike = 1.0) -> "Shape":
        """Return the shape scaled, turned about z by `yaw` (rad), then moved to `position` (m)."""
        c, s = np.cos(yaw), np.sin(yaw)
        rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=np.float32)
        vertices = (self.vertices * np.asarray(scale, np.float32)) @ rotation.T + np.asarray(position, np.float32)
        return replace(self, vertices=vertices, normals=self.normals @ rotation.T)

    def recoloured(self, material: Material, colour: ArrayLike) -> "Shape":
        """Return the shape with the colour of all faces of one material replaced."""
        colours = self.colour.copy()
        colours[self.material == material] = colour
        return replace(self, colour=colours)

    def tinted(self, factor: ArrayLike) -> "Shape":
        """Return the shape with every colour multiplied."""
        return replace(self, colour=(self.colour * np.asarray(factor, np.float32)).clip(0, 1))


def shape(vertices: ArrayLike, faces: ArrayLike, colour: ArrayLike, material: Material, kind: Kind) -> Shape:
    """Make a shape of one colour (or one a face), with the faces' own normals."""
    vertices = np.asarray(vertices, dtype=np.float32)
    faces = np.asarray(faces, dtype=np.int32)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    n = len(faces)
    colours = np.broadcast_to(np.asarray(colour, dtype=np.float32), (n, 3))
    return Shape(vertices, faces, normals, colours, np.full(n, material, np.uint8), np.full(n, kind, np.uint8))


def merge(shapes: Iterable[Shape]) -> Shape:
    """Return one shape of all triangles of several."""
    shapes = list(shapes)
    offsets = np.cumsum([0] + [len(s.vertices) for s in shapes[:-1]])
    faces = np.concatenate([s.faces + o for s, o in zip(shapes, offsets, strict=True)]).astype(np.int32)
    rest = {
        name: np.concatenate([getattr(s, name) for s in shapes])
        for name in ("vertices", "normals", "colour", "material", "kind")
    }
    return Shape(faces=faces, **rest)


@cache
def _primitive(name: str, detail: int) -> tuple[NDArray, NDArray]:
    """Return vertices and faces of a unit primitive."""
    if name == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=detail, radius=1.0)
    elif name == "cylinder":
        mesh = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=detail)
    else:
        mesh = trimesh.creation.box((1.0, 1.0, 1.0))
    return mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)


def box(centre: ArrayLike, size: ArrayLike, colour: ArrayLike, material: Material, kind: Kind) -> Shape:
    """Make a box from its centre and its three sides (m)."""
    vertices, faces = _primitive("box", 0)
    return shape(vertices * np.asarray(size, np.float32) + np.asarray(centre), faces, colour, material, kind)


def ball(centre: ArrayLike, radii: ArrayLike, colour: ArrayLike, material: Material, kind: Kind, detail=1) -> Shape:
    """Make an ellipsoid from its centre and its radii (m)."""
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
    """Make a cylinder (or a frustum) between two points, `radii` at start and end (m)."""
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
    """Make N parallelograms from a corner and two edges each, (N, 3) or broadcast; they face right x up."""
    corner, right, up = np.broadcast_arrays(*(np.atleast_2d(np.asarray(a, np.float32)) for a in (corner, right, up)))
    n = len(corner)
    vertices = np.stack([corner, corner + right, corner + right + up, corner + up], axis=1).reshape(-1, 3)
    faces = (np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(n)[:, None, None]).reshape(-1, 3)
    colours = np.repeat(np.broadcast_to(np.asarray(colour, np.float32), (n, 3)), 2, axis=0)
    return shape(vertices, faces, colours, material, kind)

"""Shapes of triangles, each with a colour, a material and a kind: what all things on a street are built from."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.workshop.simulation.things.materials import Kind, Material


@dataclass(frozen=True, eq=False)
class Shape:
    """F triangles over V vertices.

    Parameters
    ----------
    vertices : (V, 3) float32
        Corners of the triangles, metres, z up: in the thing's own frame, or in the world once it is `placed`.
    faces : (F, 3) int32
        The rows of `vertices` that are the corners of each triangle, counter-clockwise as seen from outside.
    normals : (F, 3) float32
        Unit normal of each triangle, for shading. (Leaves take the normal of the crown that they are part of.)
    colour : (F, 3) float32
        Linear albedo of each triangle, red, green and blue, 0..1.
    material, kind : (F,) uint8
        The `Material` and the `Kind` of each triangle.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    normals: NDArray[np.float32]
    colour: NDArray[np.float32]
    material: NDArray[np.uint8]
    kind: NDArray[np.uint8]

    def placed(self, position: ArrayLike, yaw: float = 0.0, scale: ArrayLike = 1.0) -> "Shape":
        """Return the shape scaled, then turned about the z axis, then moved.

        Parameters
        ----------
        position : (3,) float
            Where its origin goes, metres.
        yaw : float
            Angle about the z axis, counter-clockwise, rad.
        scale : float or (3,) float
            Factor for all sides, or one for each of x, y and z.

        Returns
        -------
        Shape
        """
        c, s = np.cos(yaw), np.sin(yaw)
        rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=np.float32)
        vertices = (self.vertices * np.asarray(scale, np.float32)) @ rotation.T + np.asarray(position, np.float32)
        return replace(self, vertices=vertices, normals=self.normals @ rotation.T)

    def overturned(self, height: float) -> "Shape":
        """Return the shape turned about the x axis by half a turn, so that it stands on its top.

        Parameters
        ----------
        height : float
            Height of the shape, metres, by which it is lifted.

        Returns
        -------
        Shape
        """
        half_a_turn = np.array([1, -1, -1], np.float32)
        lifted = self.vertices * half_a_turn + np.array([0, 0, height], np.float32)
        return replace(self, vertices=lifted, normals=self.normals * half_a_turn)

    def recoloured(self, material: Material, colour: ArrayLike) -> "Shape":
        """Return the shape with another colour on all triangles of one material.

        Parameters
        ----------
        material : Material
            Which triangles change.
        colour : (3,) float
            Their new linear albedo, 0..1.

        Returns
        -------
        Shape
        """
        colours = self.colour.copy()
        colours[self.material == material] = colour
        return replace(self, colour=colours)

    def tinted(self, factor: ArrayLike) -> "Shape":
        """Return the shape with its colours multiplied.

        Parameters
        ----------
        factor : float, (3,) float or (F, 3) float
            Factor for all, for each of red, green and blue, or for each triangle; products above 1 become 1.

        Returns
        -------
        Shape
        """
        return replace(self, colour=(self.colour * np.asarray(factor, np.float32)).clip(0, 1))


def shape(vertices: ArrayLike, faces: ArrayLike, colour: ArrayLike, material: Material, kind: Kind) -> Shape:
    """Make a shape of one material, each triangle with its own normal.

    Parameters
    ----------
    vertices : (V, 3) float
        Corners, metres.
    faces : (F, 3) int
        The rows of `vertices` that are the corners of each triangle, counter-clockwise as seen from outside.
    colour : (3,) or (F, 3) float
        Linear albedo, 0..1: one for all triangles, or one for each.
    material : Material
        What it is made of.
    kind : Kind
        What it belongs to.

    Returns
    -------
    Shape
    """
    vertices = np.asarray(vertices, dtype=np.float32)
    faces = np.asarray(faces, dtype=np.int32)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    n = len(faces)
    colours = np.broadcast_to(np.asarray(colour, dtype=np.float32), (n, 3))
    return Shape(vertices, faces, normals, colours, np.full(n, material, np.uint8), np.full(n, kind, np.uint8))


def merge(shapes: Iterable[Shape]) -> Shape:
    """Join several shapes to one.

    Parameters
    ----------
    shapes : iterable of Shape
        At least one.

    Returns
    -------
    Shape
        All triangles, those of the first shape first.
    """
    shapes = list(shapes)
    offsets = np.cumsum([0] + [len(s.vertices) for s in shapes[:-1]])
    faces = np.concatenate([s.faces + o for s, o in zip(shapes, offsets, strict=True)]).astype(np.int32)
    rest = {
        name: np.concatenate([getattr(s, name) for s in shapes])
        for name in ("vertices", "normals", "colour", "material", "kind")
    }
    return Shape(faces=faces, **rest)

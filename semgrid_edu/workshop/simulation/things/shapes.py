"""Triangle meshes with a colour, a material and a kind per triangle: boxes, ellipsoids, tubes, parallelograms."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import needed
from semgrid_edu.workshop.simulation.things.materials import Kind, Material

UP = np.array([0.0, 0.0, 1.0])
"""The direction of the z axis."""


@dataclass(frozen=True, eq=False)
class Shape:
    """F triangles over V vertices.

    Parameters
    ----------
    vertices : (V, 3) float32
        Corners of the triangles, metres, z up: in local coordinates, or in the world once `placed`.
    faces : (F, 3) int32
        Vertex indices of each triangle, counter-clockwise as seen from outside.
    normals : (F, 3) float32
        Unit normal of each triangle, for shading. Leaves use the normal of their crown.
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

    def placed(
        self, position: ArrayLike, yaw: float = 0.0, scale: ArrayLike = 1.0, tilt: tuple[float, float] = (0.0, 0.0)
    ) -> "Shape":
        """Return the shape scaled, then rotated, then translated.

        Parameters
        ----------
        position : (3,) float
            New position of the origin, metres.
        yaw : float
            Rotation about the z axis, counter-clockwise, rad.
        scale : float or (3,) float
            One factor, or one each for x, y and z.
        tilt : (float, float)
            Roll and pitch, rad, see `rotation_matrix`.
        """
        rotation = rotation_matrix(*tilt, yaw).astype(np.float32)
        vertices = (self.vertices * np.asarray(scale, np.float32)) @ rotation.T + np.asarray(position, np.float32)
        return replace(self, vertices=vertices, normals=self.normals @ rotation.T)

    def overturned(self, height: float) -> "Shape":
        """Return the shape upside down: rotated by half a turn about the x axis, then lifted.

        Parameters
        ----------
        height : float
            Height of the shape, metres, by which it is lifted.
        """
        half_a_turn = np.array([1, -1, -1], np.float32)
        lifted = self.vertices * half_a_turn + np.array([0, 0, height], np.float32)
        return replace(self, vertices=lifted, normals=self.normals * half_a_turn)

    def recoloured(self, material: Material, colour: ArrayLike) -> "Shape":
        """Return the shape with another colour on all triangles of one material.

        Parameters
        ----------
        material : Material
            The material to recolour.
        colour : (3,) float
            The new linear albedo, 0..1.
        """
        colours = self.colour.copy()
        colours[self.material == material] = colour
        return replace(self, colour=colours)

    def tinted(self, factor: ArrayLike) -> "Shape":
        """Return the shape with its colours multiplied.

        Parameters
        ----------
        factor : float, (3,) float or (F, 3) float
            One factor, one each for red, green and blue, or three per triangle; products are clipped to 1.
        """
        return replace(self, colour=(self.colour * np.asarray(factor, np.float32)).clip(0, 1))


def cross(a: ArrayLike, b: ArrayLike) -> NDArray:
    """Return cross products: the same bits as numpy's, in a third of its time for a few vectors.

    Parameters
    ----------
    a, b : (3,) or (N, 3) float
        Vectors.
    """
    a_x, a_y, a_z = np.asarray(a).T
    b_x, b_y, b_z = np.asarray(b).T
    return np.stack([a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x], axis=-1)


def shape(vertices: ArrayLike, faces: ArrayLike, colour: ArrayLike, material: Material, kind: Kind) -> Shape:
    """Make a flat-shaded shape of one material.

    Parameters
    ----------
    vertices : (V, 3) float
        Corners, metres.
    faces : (F, 3) int
        Vertex indices of each triangle, counter-clockwise as seen from outside.
    colour : (3,) or (F, 3) float
        Linear albedo, 0..1: one for all triangles, or one for each.
    material : Material
        Its material.
    kind : Kind
        Its kind.
    """
    vertices = np.asarray(vertices, dtype=np.float32)
    faces = np.asarray(faces, dtype=np.int32)
    corners = vertices[faces]
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    n = len(faces)
    colours = np.broadcast_to(np.asarray(colour, dtype=np.float32), (n, 3))
    return Shape(vertices, faces, normals, colours, np.full(n, material, np.uint8), np.full(n, kind, np.uint8))


def rotation_matrix(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Return Rz(yaw) Ry(pitch) Rx(roll), (3, 3), the order of the angles in KITTI's oxts packets.

    Parameters
    ----------
    roll, pitch, yaw : float
        Angles about the x, y and z axes, rad.
    """
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    ahead = (cy * cp, sy * cp, -sp)
    left = (cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr)
    return np.column_stack([ahead, left, (cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr)])


def merge(shapes: Iterable[Shape]) -> Shape:
    """Merge several shapes into one.

    Parameters
    ----------
    shapes : iterable of Shape
        At least one; their triangles keep this order.
    """
    shapes = list(shapes)
    offsets = np.cumsum([0] + [len(s.vertices) for s in shapes[:-1]])
    faces = np.concatenate([s.faces + o for s, o in zip(shapes, offsets, strict=True)]).astype(np.int32)
    names = ("vertices", "normals", "colour", "material", "kind")
    return Shape(faces=faces, **{name: np.concatenate([getattr(s, name) for s in shapes]) for name in names})


@cache
def _primitive(name: str, **measures: float) -> tuple[NDArray, NDArray]:
    """Return vertices and faces of a `trimesh` primitive at the origin."""
    mesh = getattr(needed("trimesh.creation"), name)(**measures)
    return mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)


def box(centre: ArrayLike, size: ArrayLike, colour: ArrayLike, material: Material, kind: Kind) -> Shape:
    """Make an axis-aligned box. Parameters not named here are those of `shape`.

    Parameters
    ----------
    centre : (3,) float
        Its centre, metres.
    size : (3,) float
        Its sides along x, y and z, metres.
    """
    vertices, faces = _primitive("box")
    return shape(vertices * np.asarray(size, np.float32) + np.asarray(centre), faces, colour, material, kind)


def ball(centre: ArrayLike, radii: ArrayLike, colour: ArrayLike, material: Material, kind: Kind, detail=1) -> Shape:
    """Make an axis-aligned ellipsoid. Parameters not named here are those of `shape`.

    Parameters
    ----------
    centre : (3,) float
        Its centre, metres.
    radii : (3,) float
        Semi-axes along x, y and z, metres.
    detail : int
        Number of subdivisions of the icosahedron; each one splits every face into four.
    """
    vertices, faces = _primitive("icosphere", subdivisions=detail)
    return shape(vertices * np.asarray(radii, np.float32) + np.asarray(centre), faces, colour, material, kind)


def tube(
    start: ArrayLike, end: ArrayLike, radii: float | tuple[float, float],
    colour: ArrayLike, material: Material, kind: Kind, sides: int = 7,
) -> Shape:  # fmt: skip
    """Make a cylinder, or a frustum. Parameters not named here are those of `shape`.

    Parameters
    ----------
    start, end : (3,) float
        End points of the axis, metres.
    radii : float or (float, float)
        The radius, or the radii at start and end, metres.
    sides : int
        Number of faces around the axis.
    """
    start = np.asarray(start, dtype=np.float64)
    end = np.asarray(end, dtype=np.float64)
    first, last = radii if isinstance(radii, tuple) else (radii, radii)
    vertices, faces = _primitive("cylinder", radius=1.0, height=1.0, sections=sides)
    axis = (end - start) / np.linalg.norm(end - start)
    side = cross(axis, [0, 0, 1] if abs(axis[2]) < 0.9 else [1, 0, 0])
    side /= np.linalg.norm(side)
    along = vertices[:, 2:] + 0.5
    radius = first + (last - first) * along
    ring = (vertices[:, :1] * side + vertices[:, 1:2] * cross(axis, side)) * radius
    return shape(start + along * (end - start) + ring, faces, colour, material, kind)


def quads(
    corner: ArrayLike, right: ArrayLike, up: ArrayLike, colour: ArrayLike, material: Material, kind: Kind
) -> Shape:
    """Make N parallelograms, normal to right x up. Parameters not named here are those of `shape`.

    Parameters
    ----------
    corner, right, up : (N, 3) or (3,) float
        One corner of each parallelogram and its two edges from there, metres; a single row applies to all N.
    colour : (N, 3) or (3,) float
        Linear albedo, 0..1.
    """
    corner, right, up = np.broadcast_arrays(*(np.atleast_2d(np.asarray(a, np.float32)) for a in (corner, right, up)))
    n = len(corner)
    vertices = np.stack([corner, corner + right, corner + right + up, corner + up], axis=1).reshape(-1, 3)
    faces = (np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(n)[:, None, None]).reshape(-1, 3)
    colours = np.repeat(np.broadcast_to(np.asarray(colour, np.float32), (n, 3)), 2, axis=0)
    return shape(vertices, faces, colours, material, kind)

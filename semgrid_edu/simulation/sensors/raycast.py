"""Rays against triangles: `embreex` finds what each ray hits, and tables say what that is."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.simulation.things.shapes import Shape, merge

MISS = np.float32(1e30)
"""Distance that a ray which meets nothing is given, metres."""


@dataclass(frozen=True, eq=False)
class RayMesh:
    """Shapes that rays can be tried against.

    Parameters
    ----------
    shape : Shape
        All F triangles, in the world.
    instance : (F,) int32
        Number of the object that each triangle belongs to; 0 for scenery.
    embree : EmbreeScene
        The search tree over the triangles.
    """

    shape: Shape
    instance: NDArray[np.int32]
    embree: EmbreeScene

    @classmethod
    def of(cls, shapes: Sequence[Shape], instances: Sequence[int]) -> "RayMesh":
        """Build the search tree of several shapes.

        Parameters
        ----------
        shapes : sequence of Shape
            In the world; at least one.
        instances : sequence of int
            For each shape the number of its object; 0 for scenery.

        Returns
        -------
        RayMesh
        """
        whole = merge(shapes)
        sizes = [len(s.faces) for s in shapes]
        embree = EmbreeScene()
        TriangleMesh(embree, np.ascontiguousarray(whole.vertices), np.ascontiguousarray(whole.faces))
        return cls(whole, np.repeat(np.asarray(instances, np.int32), sizes), embree)


@njit(cache=True)
def turned(rays: NDArray, rotation: NDArray) -> NDArray:
    """Turn rays, with the same bits on any number of cores, which a call of BLAS doesn't promise.

    Parameters
    ----------
    rays : (N, 3) float
        Directions.
    rotation : (3, 3) float
        Rotation matrix.

    Returns
    -------
    (N, 3) float
        The turned directions, in the type of `rays`.
    """
    out = np.empty_like(rays)
    for i in range(len(rays)):
        for c in range(3):
            out[i, c] = rotation[c, 0] * rays[i, 0] + rotation[c, 1] * rays[i, 1] + rotation[c, 2] * rays[i, 2]
    return out


@njit(cache=True)
def _towards(origin, directions, spheres):
    """Return the rays from one point that pass through any of the spheres (centre, radius)."""
    chosen = np.empty(len(directions), np.int64)
    n = 0
    axis = np.empty((len(spheres), 4), np.float32)
    for k in range(len(spheres)):
        away = spheres[k, :3] - origin
        distance = np.sqrt((away**2).sum())
        axis[k, :3] = away / distance
        ratio = spheres[k, 3] / distance
        axis[k, 3] = np.sqrt(1.0 - ratio * ratio) if ratio < 1.0 else -1.0
    for i in range(len(directions)):
        for k in range(len(axis)):
            cosine = axis[k, 0] * directions[i, 0] + axis[k, 1] * directions[i, 1] + axis[k, 2] * directions[i, 2]
            if cosine >= axis[k, 3] - np.float32(1e-6):
                chosen[n] = i
                n += 1
                break
    return chosen[:n]


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays ended.

    Parameters
    ----------
    directions : (N, 3) float32
        Unit vectors of the rays, in the world.
    distance : (N,) float32
        Length of each ray, metres; `MISS` where it meets nothing.
    triangle : (N,) int32
        What it meets: a row in the tables of the `Instant`; -1 for nothing.
    position : (N, 3) float32
        Where it ends, in the world, metres; 10 km away where it meets nothing.
    """

    directions: NDArray[np.float32]
    distance: NDArray[np.float32]
    triangle: NDArray[np.int32]
    position: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Instant:
    """The world at one instant: what stands still, what moves, and tables of the F triangles of both.

    Parameters
    ----------
    static : RayMesh
        What stands still; its triangles come first in the tables.
    moving : RayMesh or None
        What moves, where it is at this instant; None when nothing moves.
    spheres : (M, 4) float64
        Centre in the world and radius, metres, of a sphere around each thing that moves: only rays through one of the
        spheres are tried against `moving`.
    """

    static: RayMesh
    moving: RayMesh | None
    spheres: NDArray[np.float64]

    @cached_property
    def normals(self) -> NDArray[np.float32]:
        """(F, 3) float32: the unit normal of each triangle, for shading."""
        return np.concatenate([mesh.shape.normals for mesh in self._meshes])

    @cached_property
    def colour(self) -> NDArray[np.float32]:
        """(F, 3) float32: the linear albedo of each triangle, 0..1."""
        return np.concatenate([mesh.shape.colour for mesh in self._meshes])

    @cached_property
    def material(self) -> NDArray[np.uint8]:
        """(F,) uint8: the `Material` of each triangle."""
        return np.concatenate([mesh.shape.material for mesh in self._meshes])

    @cached_property
    def kind(self) -> NDArray[np.uint8]:
        """(F,) uint8: the `Kind` of each triangle."""
        return np.concatenate([mesh.shape.kind for mesh in self._meshes])

    @cached_property
    def instance(self) -> NDArray[np.int32]:
        """(F,) int32: the number of the object that each triangle belongs to; 0 for scenery."""
        return np.concatenate([mesh.instance for mesh in self._meshes])

    @property
    def _meshes(self) -> list[RayMesh]:
        return [self.static, self.moving] if self.moving else [self.static]

    def cast(self, origin: NDArray, directions: NDArray) -> Hits:
        """Follow rays from one point to what they meet first.

        Parameters
        ----------
        origin : (3,) float
            Where the rays start, in the world, metres.
        directions : (N, 3) float32
            Unit vectors, in the world.

        Returns
        -------
        Hits
        """
        origins = np.empty_like(directions)
        origins[:] = origin
        hits = self.static.embree.run(origins, directions, output=1)
        distance, triangle = hits["tfar"], hits["primID"]
        distance[triangle < 0] = MISS
        if self.moving:
            near = _towards(np.asarray(origin, np.float64), directions, self.spheres)
            closer = self.moving.embree.run(origins[near], directions[near], output=1)
            nearer = (closer["primID"] >= 0) & (closer["tfar"] < distance[near])
            distance[near[nearer]] = closer["tfar"][nearer]
            triangle[near[nearer]] = closer["primID"][nearer] + len(self.static.instance)
        position = origins + np.minimum(distance, 1e4)[:, None] * directions
        return Hits(directions, distance, triangle, position)

    def blocked(self, origins: NDArray, directions: NDArray) -> NDArray[np.bool_]:
        """Find the rays that meet anything.

        Parameters
        ----------
        origins : (N, 3) float
            Where each ray starts, in the world, metres.
        directions : (N, 3) float
            Unit vectors, in the world.

        Returns
        -------
        (N,) bool
        """
        origins = np.ascontiguousarray(origins, dtype=np.float32)
        directions = np.ascontiguousarray(directions, dtype=np.float32)
        blocked = self.static.embree.run(origins, directions, query="OCCLUDED") >= 0
        if self.moving:
            blocked |= self.moving.embree.run(origins, directions, query="OCCLUDED") >= 0
        return blocked

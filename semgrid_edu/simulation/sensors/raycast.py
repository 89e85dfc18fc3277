"""Rays against triangles: `embreex` finds the hits, tables say what was hit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.simulation.things.shapes import Shape, merge

MISS = np.float32(1e30)
"""Distance of a ray that meets nothing."""


@dataclass(frozen=True, eq=False)
class RayMesh:
    """Shapes ready for rays; `instance` (F,) int32 numbers the object that each triangle belongs to."""

    shape: Shape
    instance: NDArray[np.int32]
    embree: EmbreeScene

    @classmethod
    def of(cls, shapes: Sequence[Shape], instances: Sequence[int]) -> "RayMesh":
        """Build the search tree of several shapes, each with the number of its object."""
        whole = merge(shapes)
        sizes = [len(s.faces) for s in shapes]
        embree = EmbreeScene()
        TriangleMesh(embree, np.ascontiguousarray(whole.vertices), np.ascontiguousarray(whole.faces))
        return cls(whole, np.repeat(np.asarray(instances, np.int32), sizes), embree)


@njit(cache=True)
def turned(rays: NDArray, rotation: NDArray) -> NDArray:
    """Return every ray (N, 3) turned by a rotation (3, 3): the same bits on any number of cores, unlike a BLAS call."""
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
        Unit vectors.
    distance : (N,) float32
        Metres; `MISS` for none.
    triangle : (N,) int32
        Row of the `Surfaces` table; -1 for none.
    position : (N, 3) float32
        In the world, metres.
    """

    directions: NDArray[np.float32]
    distance: NDArray[np.float32]
    triangle: NDArray[np.int32]
    position: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Instant:
    """The world at one instant: the static scene, the moving one (None when nothing moves), and their joint tables.

    Parameters
    ----------
    static : RayMesh
    moving : RayMesh or None
    spheres : (M, 4) float64
        Centre and radius around everything that moves: only rays through one of them are tried against `moving`.
    """

    static: RayMesh
    moving: RayMesh | None
    spheres: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Join the tables."""
        scenes = [self.static] + ([self.moving] if self.moving else [])
        for name in ("normals", "colour", "material", "kind"):
            object.__setattr__(self, name, np.concatenate([getattr(s.shape, name) for s in scenes]))
        object.__setattr__(self, "instance", np.concatenate([s.instance for s in scenes]))

    def cast(self, origin: NDArray, directions: NDArray) -> Hits:
        """Follow rays from one point to what they meet first.

        Parameters
        ----------
        origin : (3,) float
        directions : (N, 3) float32
            Unit vectors.
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
        """Return whether anything stands in each ray's way, (N,) bool."""
        origins = np.ascontiguousarray(origins, dtype=np.float32)
        directions = np.ascontiguousarray(directions, dtype=np.float32)
        blocked = self.static.embree.run(origins, directions, query="OCCLUDED") >= 0
        if self.moving:
            blocked |= self.moving.embree.run(origins, directions, query="OCCLUDED") >= 0
        return blocked

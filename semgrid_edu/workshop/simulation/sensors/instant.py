"""The world at one instant, and what stops the rays that are sent into it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.sensors.raycast import MISS, Hits, PorousMesh, RayMesh


def _column(name: str) -> cached_property:
    """Return a table of an `Instant`: an attribute of its shapes, one below the other."""
    return cached_property(lambda instant: np.concatenate([getattr(mesh.shape, name) for mesh in instant.meshes]))


@dataclass(frozen=True, eq=False)
class Instant:
    """The world at one instant: what stands still, what moves, and tables of the F triangles of both.

    Parameters
    ----------
    static : RayMesh
        What stands still; its triangles come first in the tables.
    moving : RayMesh or None
        What moves, where it is at this instant; None when nothing moves.
    porous : PorousMesh or None
        What lets a part of the rays through; its triangles come last in the tables.

    Attributes
    ----------
    normals : (F, 3) float32
        The unit normal of each triangle, for shading.
    colour : (F, 3) float32
        The linear albedo of each triangle, 0..1.
    material, kind : (F,) uint8
        The `Material` and the `Kind` of each triangle.
    """

    static: RayMesh
    moving: RayMesh | None
    porous: PorousMesh | None = None

    normals, colour, material, kind = (_column(name) for name in ("normals", "colour", "material", "kind"))

    @cached_property
    def instance(self) -> NDArray[np.int32]:
        """(F,) int32: the number of the object that each triangle belongs to; 0 for scenery."""
        return np.concatenate([mesh.instance for mesh in self.meshes])

    @property
    def meshes(self) -> list[RayMesh]:
        """What there is, in the order of the tables."""
        return [mesh for mesh in (self.static, self.moving, self.porous and self.porous.mesh) if mesh]

    def cast(self, origin: NDArray, directions: NDArray, rng: np.random.Generator) -> Hits:
        """Follow rays from one point to what stops them first.

        Parameters
        ----------
        origin : (3,) float
            Where the rays start, in the world, metres.
        directions : (N, 3) float32
            Unit vectors, in the world.
        rng : numpy.random.Generator
            Decides which rays pass what is porous; nothing is drawn where nothing is.
        """
        origins = np.empty_like(directions)
        origins[:] = origin
        hits = self.static.embree.run(origins, directions, output=1)
        distance, triangle = hits["tfar"], hits["primID"]
        distance[triangle < 0] = MISS
        if self.moving:
            closer = self.moving.embree.run(origins, directions, output=1)
            nearer = (closer["primID"] >= 0) & (closer["tfar"] < distance)
            distance[nearer] = closer["tfar"][nearer]
            triangle[nearer] = closer["primID"][nearer] + len(self.static.instance)
        if self.porous:
            rays, at, face = self.porous.stop(origins, directions, distance, rng)
            distance[rays], triangle[rays] = at, face + len(self.instance) - len(self.porous.opacity)
        position = origins + np.minimum(distance, 1e4)[:, None] * directions
        return Hits(directions, distance, triangle, position)

    def blocked(self, origins: NDArray, directions: NDArray) -> NDArray[np.bool_]:
        """Find the rays that meet anything solid.

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

"""Ray casting into the world at one instant. Porous objects let some rays through (Beer-Lambert law)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import needed
from semgrid_edu.workshop.simulation.things.materials import Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, merge

if TYPE_CHECKING:
    from embreex.rtcore_scene import EmbreeScene

MISS = np.float32(1e30)
"""Distance of a ray that hits nothing, metres."""
_GRAZING = np.float32(1e-3)
"""Lower bound for |cos| between a ray and the normal of a sheet."""
_STEP = np.float32(2e-3)
"""After a ray passes a surface, it restarts this far beyond it, metres."""


@dataclass(frozen=True, eq=False)
class RayMesh:
    """Shapes to cast rays at.

    Parameters
    ----------
    shape : Shape
        All F triangles, in world coordinates.
    instance : (F,) int32
        Object number of each triangle; 0 for scenery.
    """

    shape: Shape
    instance: NDArray[np.int32]

    @classmethod
    def of(cls, shapes: Sequence[Shape], instances: Sequence[int]) -> "RayMesh":
        """Merge several shapes.

        Parameters
        ----------
        shapes : sequence of Shape
            At least one, in world coordinates.
        instances : sequence of int
            Object number of each shape; 0 for scenery.
        """
        return cls(merge(shapes), np.repeat(np.asarray(instances, np.int32), [len(s.faces) for s in shapes]))

    @cached_property
    def embree(self) -> "EmbreeScene":
        """The search tree over the triangles, built at the first ray, because some streets are never rendered."""
        embree = needed("embreex.rtcore_scene").EmbreeScene()
        vertices, faces = (np.ascontiguousarray(part) for part in (self.shape.vertices, self.shape.faces))
        needed("embreex.mesh_construction").TriangleMesh(embree, vertices, faces)
        return embree


@dataclass(frozen=True, eq=False)
class PorousMesh(RayMesh):
    """Surfaces and volumes that stop a ray with some probability.

    A ray passes with probability exp(-depth), where `depth` is the optical depth along its path:

    - `Material.WIRE`, a sheet: opacity * distance / |cos|. A LIDAR beam or a pixel is a cone, so it covers more wires
      at a greater distance from the sensor and at a larger angle between ray and normal.
    - `Material.PANE`, a sheet: opacity / |cos|.
    - `Material.TWIGS`, a closed volume: opacity * length of the path inside it.

    Parameters
    ----------
    shape, instance
        As in `RayMesh`.
    opacity : (F,) float32
        Opacity of each triangle: 1/m for wire and twigs, dimensionless for panes.
    """

    opacity: NDArray[np.float32]

    @classmethod
    def of(cls, shapes: Sequence[Shape], opacities: Sequence[float]) -> "PorousMesh":
        """Merge several porous shapes.

        Parameters
        ----------
        shapes : sequence of Shape
            At least one, in world coordinates.
        opacities : sequence of float
            Opacity of each shape.
        """
        opacity = np.repeat(np.asarray(opacities, np.float32), [len(s.faces) for s in shapes])
        return cls(merge(shapes), np.zeros(len(opacity), np.int32), opacity)

    def stop(
        self, origins: NDArray, directions: NDArray, ends: NDArray, rng: np.random.Generator
    ) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int32]]:
        """Find the rays that stop here before they hit something solid.

        Each ray that hits a porous surface samples the optical depth at which it stops from an exponential distribution
        with mean 1. Every surface on its path uses up part of this budget.

        Parameters
        ----------
        origins, directions : (N, 3) float32
            Start points in the world, metres, and unit vectors.
        ends : (N,) float32
            Distance to the first solid surface, metres; `MISS` for none.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        rays : (M,) int64
            Indices of the rays that stop.
        distance : (M,) float32
            Distances at which they stop, metres.
        triangle : (M,) int32
            The triangles that stop them.
        """
        rays = np.arange(len(ends))
        start = np.zeros(len(ends), np.float32)
        rays, start, crossing, triangle = self._next(origins, directions, rays, start)
        budget = np.zeros(len(ends), np.float32)
        budget[rays] = rng.standard_exponential(len(rays), dtype=np.float32)
        found = [(rays[:0], start[:0], triangle[:0])]
        while len(rays):
            at, cost = self._spent(directions[rays], start, crossing, triangle, budget[rays])
            over = at < ends[rays]
            found.append((rays[over], at[over], triangle[over]))
            budget[rays] -= cost
            on = ~over & (crossing < ends[rays])
            rays, start, crossing, triangle = self._next(origins, directions, rays[on], crossing[on] + _STEP)
        return tuple(np.concatenate(part) for part in zip(*found, strict=True))

    def _next(self, origins: NDArray, directions: NDArray, rays: NDArray, start: NDArray) -> tuple[NDArray, ...]:
        """Return the rays that hit a surface beyond `start`, their start, and the surface's distance and triangle."""
        hits = self.embree.run(origins[rays] + start[:, None] * directions[rays], directions[rays], output=1)
        met = hits["primID"] >= 0
        return rays[met], start[met], start[met] + hits["tfar"][met], hits["primID"][met]

    def _spent(
        self, directions: NDArray, start: NDArray, crossing: NDArray, triangle: NDArray, budget: NDArray
    ) -> tuple:
        """Return where each ray's budget runs out before its next surface (`MISS` if it doesn't), and the cost.

        The path is inside a volume if the ray exits one at the next surface.
        """
        opacity = self.opacity[triangle]
        cosine = (self.shape.normals[triangle] * directions).sum(axis=1)
        material = self.shape.material[triangle]
        length = np.where(cosine > 0, crossing - start, np.float32(0))
        across = np.where(material == Material.WIRE, crossing, np.float32(1)) / np.maximum(np.abs(cosine), _GRAZING)
        volume = material == Material.TWIGS
        cost = opacity * np.where(volume, length, across)
        at = np.where(volume, start + budget / opacity, crossing)
        return np.where(budget < cost, at, MISS), cost


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays ended.

    Parameters
    ----------
    directions : (N, 3) float32
        Unit vectors of the rays, in the world.
    distance : (N,) float32
        Length of each ray, metres; `MISS` if it hits nothing.
    triangle : (N,) int32
        The triangle that it hits, a row in the tables of the `Instant`; -1 for none.
    position : (N, 3) float32
        End point in the world, metres; 10 km away if it hits nothing.
    """

    directions: NDArray[np.float32]
    distance: NDArray[np.float32]
    triangle: NDArray[np.int32]
    position: NDArray[np.float32]


def _column(name: str) -> cached_property:
    """Return a property of `Instant` that concatenates one attribute of all its shapes."""
    return cached_property(lambda instant: np.concatenate([getattr(mesh.shape, name) for mesh in instant.meshes]))


@dataclass(frozen=True, eq=False)
class Instant:
    """The world at one instant: static, moving and porous objects, and tables of all their F triangles.

    Parameters
    ----------
    static : RayMesh
        Static objects; first in the tables.
    moving : RayMesh or None
        Moving objects at their positions of this instant; None when nothing moves.
    porous : PorousMesh or None
        Porous objects; last in the tables.

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
        """(F,) int32: object number of each triangle; 0 for scenery."""
        return np.concatenate([mesh.instance for mesh in self.meshes])

    @property
    def meshes(self) -> list[RayMesh]:
        """All meshes, in the order of the tables."""
        return [mesh for mesh in (self.static, self.moving, self.porous) if mesh]

    def cast(self, origin: NDArray, directions: NDArray, rng: np.random.Generator) -> Hits:
        """Cast rays and return their first hits.

        Parameters
        ----------
        origin : (3,) or (N, 3) float
            One start point for all rays, or one for each, in the world, metres.
        directions : (N, 3) float32
            Unit vectors, in the world.
        rng : numpy.random.Generator
            Decides which rays pass porous objects; unused when there are none.
        """
        origins = np.empty_like(directions)
        origins[:] = origin
        hits = self.static.embree.run(origins, directions, output=1)
        distance = hits["tfar"]
        triangle = hits["primID"]
        distance[triangle < 0] = MISS
        if self.moving:
            closer = self.moving.embree.run(origins, directions, output=1)
            nearer = (closer["primID"] >= 0) & (closer["tfar"] < distance)
            distance[nearer] = closer["tfar"][nearer]
            triangle[nearer] = closer["primID"][nearer] + len(self.static.instance)
        if self.porous:
            rays, at, face = self.porous.stop(origins, directions, distance, rng)
            distance[rays] = at
            triangle[rays] = face + len(self.instance) - len(self.porous.opacity)
        position = origins + np.minimum(distance, 1e4)[:, None] * directions
        return Hits(directions, distance, triangle, position)

    def blocked(self, origins: NDArray, directions: NDArray) -> NDArray[np.bool_]:
        """Return which rays hit anything solid, (N,).

        Parameters
        ----------
        origins, directions : (N, 3) float32
            Start points in the world, metres, and unit vectors.
        """
        blocked = self.static.embree.run(origins, directions, query="OCCLUDED") >= 0
        if self.moving:
            blocked |= self.moving.embree.run(origins, directions, query="OCCLUDED") >= 0
        return blocked


def turned(rays: NDArray, rotation: NDArray) -> NDArray:
    """Rotate rays. The result is bitwise equal on any number of cores, which BLAS doesn't guarantee.

    Parameters
    ----------
    rays, rotation : (N, 3) float, (3, 3) or (N, 3, 3) float
        Directions, and one rotation matrix for all rays or one for each.
    """
    x, y, z = rays.T[:, :, None]
    return x * rotation[..., 0] + y * rotation[..., 1] + z * rotation[..., 2]

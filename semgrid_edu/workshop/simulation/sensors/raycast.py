"""Rays against the world at one instant, parts of which let some of them through (by the law of Beer and Lambert)."""

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
"""Distance that a ray which meets nothing is given, metres."""
_GRAZING = np.float32(1e-3)
"""Smallest |cos| between a ray and the normal of a sheet; a smaller one counts as this."""
_STEP = np.float32(2e-3)
"""By how much a ray starts beyond the surface that it has passed, metres."""


@dataclass(frozen=True, eq=False)
class RayMesh:
    """Shapes that rays can be tried against.

    Parameters
    ----------
    shape : Shape
        All F triangles, in the world.
    instance : (F,) int32
        Number of the object that each triangle belongs to; 0 for scenery.
    """

    shape: Shape
    instance: NDArray[np.int32]

    @classmethod
    def of(cls, shapes: Sequence[Shape], instances: Sequence[int]) -> "RayMesh":
        """Merge several shapes.

        Parameters
        ----------
        shapes : sequence of Shape
            In the world; at least one.
        instances : sequence of int
            For each shape the number of its object; 0 for scenery.
        """
        return cls(merge(shapes), np.repeat(np.asarray(instances, np.int32), [len(s.faces) for s in shapes]))

    @cached_property
    def embree(self) -> "EmbreeScene":
        """The search tree over the triangles, built when the first ray is tried: not every street is looked at."""
        embree = needed("embreex.rtcore_scene").EmbreeScene()
        vertices, faces = (np.ascontiguousarray(part) for part in (self.shape.vertices, self.shape.faces))
        needed("embreex.mesh_construction").TriangleMesh(embree, vertices, faces)
        return embree


@dataclass(frozen=True, eq=False)
class PorousMesh:
    """Surfaces and volumes that stop a ray by chance.

    A ray passes with probability exp(-depth), where `depth` is the optical depth that it has crossed:

    - `Material.WIRE`, a sheet: opacity * distance / |cos|. The light of a LIDAR or a pixel is a cone, so the number of
      wires in it grows with the distance from the sensor, and with the angle between ray and normal.
    - `Material.PANE`, a sheet: opacity / |cos|.
    - `Material.TWIGS`, a closed volume: opacity * length of the way inside it.

    Parameters
    ----------
    mesh : RayMesh
        All F triangles, in the world.
    opacity : (F,) float32
        Of each triangle: 1/m for wire and twigs, without unit for panes.
    """

    mesh: RayMesh
    opacity: NDArray[np.float32]

    @classmethod
    def of(cls, shapes: Sequence[Shape], opacities: Sequence[float]) -> "PorousMesh":
        """Build the search tree of several shapes.

        Parameters
        ----------
        shapes : sequence of Shape
            In the world; at least one.
        opacities : sequence of float
            For each shape its opacity.
        """
        faces = [len(shape.faces) for shape in shapes]
        return cls(RayMesh.of(shapes, [0] * len(shapes)), np.repeat(np.asarray(opacities, np.float32), faces))

    def stop(
        self, origins: NDArray, directions: NDArray, ends: NDArray, rng: np.random.Generator
    ) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int32]]:
        """Find the rays that end here before they meet something solid.

        Each ray that meets any of the surfaces draws the optical depth at which it ends, from the exponential
        distribution of mean 1, and spends it on its way.

        Parameters
        ----------
        origins, directions : (N, 3) float32
            Where the rays start in the world, metres, and unit vectors.
        ends : (N,) float32
            Distance of what is solid, metres; `MISS` for none.
        rng : numpy.random.Generator
            Source of chance.

        Returns
        -------
        rays : (M,) int64
            The rays that end.
        distance : (M,) float32
            Where they do, metres.
        triangle : (M,) int32
            What stops them: triangles of `mesh`.
        """
        rays, start = np.arange(len(ends)), np.zeros(len(ends), np.float32)
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
        """Return the rays that meet a surface from `start` on, with their starts, its distance and its triangle."""
        hits = self.mesh.embree.run(origins[rays] + start[:, None] * directions[rays], directions[rays], output=1)
        met = hits["primID"] >= 0
        return rays[met], start[met], start[met] + hits["tfar"][met], hits["primID"][met]

    def _spent(
        self, directions: NDArray, start: NDArray, crossing: NDArray, triangle: NDArray, budget: NDArray
    ) -> tuple:
        """Return where each ray's budget ends on the way to its next surface, `MISS` if beyond it, and the way's cost.

        The way lies inside a volume if the ray leaves one at its end.
        """
        shape, opacity = self.mesh.shape, self.opacity[triangle]
        cosine = (shape.normals[triangle] * directions).sum(axis=1)
        material = shape.material[triangle]
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
        """Follow rays to what stops them first.

        Parameters
        ----------
        origin : (3,) or (N, 3) float
            Where all rays start, or each of them, in the world, metres.
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

    def looked_up(self, name: str, triangle: NDArray[np.int32]) -> NDArray:
        """Return rows of one of the tables, without making the whole of it.

        Parameters
        ----------
        name : str
            "normals", "colour", "material" or "kind".
        triangle : (N,) int32
            The rows.
        """
        parts = [getattr(mesh.shape, name) for mesh in self.meshes]
        first = np.cumsum([0] + [len(part) for part in parts])
        out = np.empty((len(triangle), *parts[0].shape[1:]), parts[0].dtype)
        for part, start in zip(parts, first[:-1], strict=True):
            mine = (triangle >= start) & (triangle < start + len(part))
            out[mine] = part[triangle[mine] - start]
        return out

    def blocked(self, origins: NDArray, directions: NDArray) -> NDArray[np.bool_]:
        """Return which rays meet anything solid, (N,).

        Parameters
        ----------
        origins, directions : (N, 3) float32
            Where the rays start in the world, metres, and unit vectors.
        """
        blocked = self.static.embree.run(origins, directions, query="OCCLUDED") >= 0
        if self.moving:
            blocked |= self.moving.embree.run(origins, directions, query="OCCLUDED") >= 0
        return blocked


def turned(rays: NDArray, rotation: NDArray) -> NDArray:
    """Turn rays, with the same bits on any number of cores, which a call of BLAS doesn't promise.

    Parameters
    ----------
    rays, rotation : (N, 3) float, (3, 3) or (N, 3, 3) float
        Directions, and one rotation matrix or one for each ray.
    """
    x, y, z = rays.T[:, :, None]
    return x * rotation[..., 0] + y * rotation[..., 1] + z * rotation[..., 2]

"""Rays against triangles: `embreex` finds what each ray hits, and tables say what that is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.workshop.simulation.things.shapes import Shape, merge

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

"""Shapes of trees, bushes and hedges: trunks, and leaves that are lit as parts of the crown that they form."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.storage.files import named_rows, table_beside
from semgrid_edu.workshop.simulation.things import shapes
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, merge

_leaves = partial(shapes.shape, material=Material.LEAF, kind=Kind.PLANT)
_bark = partial(shapes.tube, material=Material.BARK, kind=Kind.PLANT)


_SPECIES = named_rows(table_beside(__file__))
TREES = tuple(_SPECIES)
"""The species that `tree` knows."""


def _foliage(points: NDArray, outward: NDArray, size: float, green: tuple, rng: np.random.Generator) -> Shape:
    """Scatter one leaf cluster (a triangle) at every point, shaded by the `outward` direction there."""
    n = len(points)
    corners = rng.normal(0, 1, (n, 3, 3))
    corners *= size * rng.uniform(0.5, 1.1, (n, 1, 1)) / np.linalg.norm(corners, axis=2, keepdims=True)
    light = 0.75 + 0.3 * outward[:, 2:] + rng.normal(0, 0.16, (n, 1))
    hue = 1 + rng.normal(0, 0.12, (n, 3)) * np.array([1.0, 0.4, 0.8])
    colour = (np.asarray(green) * light * hue).clip(0.01, 0.9)
    leaves = _leaves((points[:, None] + corners).reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), colour)
    normals = outward + rng.normal(0, 0.35, (n, 3)) + np.array([0, 0, 0.15])
    return replace(leaves, normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32))


def _crown(centre: NDArray, radii: NDArray, n: int, size: float, green: tuple, rng: np.random.Generator) -> Shape:
    """Fill a crown, (K, 3) blobs with (K, 3) radii, with n leaf clusters around dark cores."""
    surface = radii.prod(axis=1) ** (2 / 3)
    which = rng.choice(len(centre), n, p=surface / surface.sum())
    direction = rng.normal(0, 1, (n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    depth = rng.uniform(0.72, 1.08, (n, 1))
    points = centre[which] + direction * radii[which] * depth
    whole = points - centre.mean(axis=0)
    whole /= np.linalg.norm(whole, axis=1, keepdims=True)
    outward = (0.6 * direction + 0.4 * whole).astype(np.float32)
    core = tuple(0.35 * np.asarray(green))
    cores = [shapes.ball(c, 0.74 * r, core, Material.LEAF, Kind.PLANT) for c, r in zip(centre, radii, strict=True)]
    return merge([_foliage(points, outward, size, green, rng), *cores])


def _cone(n: int, size: float, green: tuple, rng: np.random.Generator) -> Shape:
    """Make the crown of a conifer from n leaf clusters around a dark core."""
    z = 0.8 + 7.5 * (1 - np.sqrt(rng.uniform(0, 1, n)))
    radius = (8.6 - z) * 0.27 * (0.75 + 0.25 * np.cos(z * 8)) * rng.uniform(0.8, 1.05, n)
    angle = rng.uniform(0, 2 * np.pi, n)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    outward = np.stack([np.cos(angle), np.sin(angle), np.full(n, 0.45)], axis=1).astype(np.float32)
    core = shapes.tube((0, 0, 0.9), (0, 0, 8.2), (1.55, 0.03), (0.012, 0.03, 0.013), Material.LEAF, Kind.PLANT, 9)
    return merge([_foliage(points, outward, size, green, rng), core])


@cache
def tree(species: str, variant: int, n_leaves: int = 1500) -> Shape:
    """Make a tree about 7 m high (the tall ones 10 m), its foot at the origin.

    Parameters
    ----------
    species : str
        One of `TREES`.
    variant : int
        Number of the variant: trees of one species and variant are the same.
    n_leaves : int
        Triangles of foliage; trees far away need fewer.
    """
    rng = np.random.default_rng([TREES.index(species), variant, 77])
    its, size = _SPECIES[species], 0.24 * (1500 / n_leaves) ** 0.5
    trunk = _bark((0, 0, -0.8), (0, 0, 4.2), (its.trunk * 1.2, its.trunk * 0.6), its.bark, sides=9)
    if not its.crown:
        return merge([_cone(n_leaves, size, its.leaf, rng), trunk])
    centre = rng.uniform(-1, 1, (7, 3)) * its.crown + [0, 0, its.height]
    radii = rng.uniform(0.95, 1.55, (7, 1)) * [1, 1, 0.85]
    foliage, fork = _crown(centre, radii, n_leaves, size, its.leaf, rng), (its.trunk * 0.5, its.trunk * 0.25)
    forks = [_bark((0, 0, 2.4), (*rng.uniform(-1.2, 1.2, 2), 4.6), fork, its.bark, sides=5) for _ in range(3)]
    return merge([foliage, trunk, *forks])


@cache
def bush(variant: int) -> Shape:
    """Make a bush about 2 m wide and 1.4 m high, its foot at the origin.

    Parameters
    ----------
    variant : int
        Number of the variant: bushes of one variant are the same.
    """
    rng = np.random.default_rng([variant, 78])
    centre = rng.uniform(-1, 1, (4, 3)) * [0.5, 0.5, 0.2] + [0, 0, 0.55]
    radii = rng.uniform(0.45, 0.7, (4, 1)) * [1, 1, 1]
    return _crown(centre, radii, 500, 0.13, (0.07, 0.14, 0.035), rng)


@cache
def hedge(variant: int) -> Shape:
    """Make one metre of hedge along x, 0.8 m thick and 1.3 m high, with the origin in its middle.

    Parameters
    ----------
    variant : int
        Number of the variant: hedges of one variant are the same.
    """
    rng = np.random.default_rng([variant, 79])
    n = 260
    points = rng.uniform(-1, 1, (n, 3)) * [0.5, 0.4, 0.65]
    face = rng.integers(0, 3, n)
    for number, (axis, side) in enumerate(((1, 0.4), (1, -0.4), (2, 0.65))):
        points[face == number, axis] = side
    outward = np.array([[0, 1, 0.2], [0, -1, 0.2], [0, 0, 1]], dtype=np.float32)[face]
    leaves = _foliage(points + rng.normal(0, 0.03, (n, 3)) + [0, 0, 0.65], outward, 0.1, (0.06, 0.13, 0.03), rng)
    core = shapes.box((0, 0, 0.6), (1, 0.7, 1.2), (0.02, 0.045, 0.012), Material.LEAF, Kind.PLANT)
    return merge([leaves, core])

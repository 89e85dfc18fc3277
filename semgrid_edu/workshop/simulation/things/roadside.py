"""Roadside objects: fences, signs, lamps, traffic lights, wire mesh, panes, posts, trees, bushes and hedges."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.storage.files import named_rows, table_beside
from semgrid_edu.workshop.simulation.things import shapes
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, ball, box, merge, quads, shape, tube

_STONE, _GREY, _ZINC = (0.36, 0.34, 0.31), (0.42, 0.43, 0.44), (0.33, 0.35, 0.35)
_TWIGS = (0.05, 0.11, 0.028)
_TABLES = table_beside(__file__, "furniture")
_FENCES, _FACES = named_rows(_TABLES["fences"]), _TABLES["signs"]
FENCES = (*_FENCES, "wall")
"""The styles of `fence`."""
SHEETS = named_rows(_TABLES["sheets"])
"""The styles of `sheet_fence`, by name."""
_fence_box, _fence_quads = partial(box, kind=Kind.FENCE), partial(quads, kind=Kind.FENCE)


@cache
def fence(style: str, length: float) -> Shape:
    """Make a straight piece of fence from the origin along x.

    Parameters
    ----------
    style : str
        One of `FENCES`; "wall" is a low stone garden wall, which both label sets count as fence.
    length : float
        Length of the piece, metres.
    """
    middle = length / 2
    if style == "wall":
        cap = _fence_box((middle, 0, 1.0), (length, 0.34, 0.1), (0.45, 0.43, 0.4), Material.PLASTER)
        return merge([_fence_box((middle, 0, 0.1), (length, 0.25, 1.8), _STONE, Material.BRICK), cap])
    spec = _FENCES[style]
    look = spec.colour, Material[spec.material]
    parts = [
        _fence_box((x, 0.03, spec.height / 2 - 0.4), (0.09, 0.09, spec.height + 0.9), *look)
        for x in np.linspace(0.0, length, max(round(length / 2.5), 1) + 1)
    ]
    if style == "mesh":
        z = np.arange(0.1, spec.height, 0.2)
        parts.append(_fence_quads(np.stack([0 * z, 0 * z, z], 1), [length, 0, 0], [0, 0, 0.02], *look))
    else:
        parts += [_fence_box((middle, 0.03, z), (length, 0.04, 0.07), *look) for z in (0.3, 0.92 * spec.height)]
    x = np.arange(spec.step / 2, length, spec.step)
    corner = np.stack([x - spec.width / 2, 0 * x, 0 * x + spec.low], axis=1)
    slats = _fence_quads(corner, [spec.width, 0, 0], [0, 0, spec.height - spec.low], spec.slats, look[1])
    return merge([*parts, slats])


@cache
def sheet_fence(style: str, length: float) -> tuple[Shape, Shape]:
    """Make a piece of a fence that is partly transparent, from the origin along x.

    Parameters
    ----------
    style : str
        One of `SHEETS`.
    length : float
        Its length, metres.

    Returns
    -------
    frame, sheet : Shape
        The post at the origin with the rails, and the porous sheet.
    """
    spec = SHEETS[style]
    metal = (spec.colour, Material.METAL)
    middle, size = spec.post
    post = _fence_box((0, 0, middle), (0.06, 0.06, size), *metal)
    rails = [_fence_box((length / 2, 0, z), (length, wide, high), *metal) for z, wide, high in spec.rails]
    bottom, height = spec.sheet
    porous = (spec.colour, Material[spec.material])
    sheet = _fence_quads((0, 0, bottom), (length, 0, 0), (0, 0, height), *porous)
    return merge([post, *rails]), sheet


def porous_hedge(length: float, thickness: float, height: float) -> Shape:
    """Make a piece of hedge from the origin along x, as a volume of `Material.TWIGS`.

    Parameters
    ----------
    length, thickness, height : float
        Its sides along x, y and z, metres.
    """
    size = (length, thickness, height + 0.5)
    return box((length / 2, 0, height / 2 - 0.25), size, _TWIGS, Material.TWIGS, Kind.PLANT)


@cache
def bollard(height: float, radius: float) -> Shape:
    """Make a free-standing post at the origin.

    Parameters
    ----------
    height, radius : float
        Its size above the ground, metres.
    """
    return tube((0, 0, -0.5), (0, 0, height), radius, np.multiply(_ZINC, 0.8), Material.METAL, Kind.POLE, 9)


def _plate(corners: ArrayLike, colour, x: float, material=Material.RETRO) -> Shape:
    """Make a convex plate in the plane x, from its corners (y, z), facing -x."""
    n = len(corners)
    vertices = np.column_stack([np.full(n, x), corners])
    return shape(vertices, [[0, i, i + 1] for i in range(1, n - 1)], colour, material, Kind.SIGN)


def _corners(face: dict) -> np.ndarray:
    """Return the corners of a face of a sign, relative to the centre of the sign."""
    n, radius, turn = face.get("regular", (0, 0, 0))
    angle = np.radians(turn) + 2 * np.pi * np.arange(n) / max(n, 1)
    return face.get("corners") or np.stack([-radius * np.cos(angle), radius * np.sin(angle)], axis=1)


SIGNS = tuple(_FACES)
"""The available traffic signs."""


@cache
def sign(name: str) -> Shape:
    """Make a traffic sign on its pole at the origin; it faces -x, towards a driver who drives along x.

    Parameters
    ----------
    name : str
        One of `SIGNS`.
    """
    faces = [(np.add(_corners(face), (0, 2.4)), face["colour"]) for face in _FACES[name]]
    pole = tube((0, 0, -0.5), (0, 0, 2.75), 0.035, _GREY, Material.METAL, Kind.POLE)
    back = _plate(faces[0][0][::-1], (0.3, 0.3, 0.3), -0.04, Material.METAL)
    return merge([pole, back, *(_plate(*face, -0.05 - 0.008 * i) for i, face in enumerate(faces))])


@cache
def lamp(height: float) -> Shape:
    """Make a street lamp at the origin with an arm of 1.5 m along y.

    Parameters
    ----------
    height : float
        Height of the lamp above the ground, metres.
    """
    metal = partial(tube, colour=(0.24, 0.25, 0.25), material=Material.METAL, kind=Kind.POLE)
    foot = metal((0, 0, -0.5), (0, 0, 1.2), (0.11, 0.10))
    post = metal((0, 0, 1.2), (0, 0, height - 0.4), (0.075, 0.055))
    arm = metal((0, 0, height - 0.4), (0, 1.5, height), (0.05, 0.04))
    head = box((0, 1.7, height), (0.22, 0.7, 0.12), (0.3, 0.3, 0.29), Material.METAL, Kind.POLE)
    return merge([foot, post, arm, head])


@cache
def traffic_light(green: bool) -> Shape:
    """Make a traffic light on its pole at the origin; it faces -x.

    Parameters
    ----------
    green : bool
        Whether it is green; otherwise it is red.
    """
    parts = [
        tube((0, 0, -0.5), (0, 0, 3.3), (0.06, 0.055), (0.2, 0.21, 0.2), Material.METAL, Kind.POLE),
        box((-0.12, 0, 2.75), (0.2, 0.32, 0.95), (0.025, 0.03, 0.028), Material.MATTE, Kind.SIGN),
    ]
    for i, colour in enumerate(((0.7, 0.02, 0.02), (0.5, 0.3, 0.02), (0.02, 0.6, 0.25))):
        lit = i == (2 if green else 0)
        colour, material = (colour, Material.LAMP) if lit else (np.multiply(0.12, colour), Material.MATTE)
        parts.append(ball((-0.22, 0, 3.04 - 0.29 * i), (0.04, 0.11, 0.11), colour, material, Kind.SIGN))
    return merge(parts)


_leaves = partial(shapes.shape, material=Material.LEAF, kind=Kind.PLANT)
_bark = partial(shapes.tube, material=Material.BARK, kind=Kind.PLANT)


_SPECIES = named_rows(table_beside(__file__, "plants"))
TREES = tuple(_SPECIES)
"""The available tree species."""


def _foliage(points: NDArray, outward: NDArray, size: float, green: tuple, rng: np.random.Generator) -> Shape:
    """Place one leaf cluster (a triangle) at every point, shaded by its `outward` direction."""
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
    """Make a tree about 7 m high (tall species 10 m), with its foot at the origin.

    Parameters
    ----------
    species : str
        One of `TREES`.
    variant : int
        Number of the variant; trees of one species and variant are identical.
    n_leaves : int
        Number of foliage triangles; distant trees need fewer.
    """
    rng = np.random.default_rng([TREES.index(species), variant, 77])
    spec = _SPECIES[species]
    size = 0.24 * (1500 / n_leaves) ** 0.5
    trunk = _bark((0, 0, -0.8), (0, 0, 4.2), (spec.trunk * 1.2, spec.trunk * 0.6), spec.bark, sides=9)
    if not spec.crown:
        return merge([_cone(n_leaves, size, spec.leaf, rng), trunk])
    centre = rng.uniform(-1, 1, (7, 3)) * spec.crown + [0, 0, spec.height]
    radii = rng.uniform(0.95, 1.55, (7, 1)) * [1, 1, 0.85]
    foliage = _crown(centre, radii, n_leaves, size, spec.leaf, rng)
    fork = (spec.trunk * 0.5, spec.trunk * 0.25)
    forks = [_bark((0, 0, 2.4), (*rng.uniform(-1.2, 1.2, 2), 4.6), fork, spec.bark, sides=5) for _ in range(3)]
    return merge([foliage, trunk, *forks])


@cache
def bush(variant: int) -> Shape:
    """Make a bush about 2 m wide and 1.4 m high, with its foot at the origin.

    Parameters
    ----------
    variant : int
        Number of the variant; bushes of one variant are identical.
    """
    rng = np.random.default_rng([variant, 78])
    centre = rng.uniform(-1, 1, (4, 3)) * [0.5, 0.5, 0.2] + [0, 0, 0.55]
    radii = rng.uniform(0.45, 0.7, (4, 1)) * [1, 1, 1]
    return _crown(centre, radii, 500, 0.13, (0.07, 0.14, 0.035), rng)


@cache
def hedge(variant: int) -> Shape:
    """Make one metre of hedge along x, 0.8 m thick and 1.3 m high, centred on the origin.

    Parameters
    ----------
    variant : int
        Number of the variant; hedges of one variant are identical.
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

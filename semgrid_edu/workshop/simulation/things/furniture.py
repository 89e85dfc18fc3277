"""Shapes of what stands beside a street: fences, walls, signs, lamps and traffic lights; wire mesh, panes and posts."""

from functools import cache, partial

import numpy as np
from numpy.typing import ArrayLike

from semgrid_edu.storage.files import named_rows, table_beside
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, ball, box, merge, quads, shape, tube

_STONE, _GREY, _ZINC = (0.36, 0.34, 0.31), (0.42, 0.43, 0.44), (0.33, 0.35, 0.35)
_TWIGS = (0.05, 0.11, 0.028)
_TABLES = table_beside(__file__)
_FENCES, _FACES = named_rows(_TABLES["fences"]), _TABLES["signs"]
FENCES = (*_FENCES, "wall")
"""The fences that `fence` knows."""
SHEETS = named_rows(_TABLES["sheets"])
"""The fences that `sheet_fence` knows."""
_fence_box, _fence_quads = partial(box, kind=Kind.FENCE), partial(quads, kind=Kind.FENCE)


@cache
def fence(style: str, length: float) -> Shape:
    """Make a straight piece of fence from the origin along x.

    Parameters
    ----------
    style : str
        One of `FENCES`; "wall" is a low garden wall of stone, a fence to both label sets.
    length : float
        Length of the piece, metres.
    """
    middle = length / 2
    if style == "wall":
        cap = _fence_box((middle, 0, 1.0), (length, 0.34, 0.1), (0.45, 0.43, 0.4), Material.PLASTER)
        return merge([_fence_box((middle, 0, 0.1), (length, 0.25, 1.8), _STONE, Material.BRICK), cap])
    its = _FENCES[style]
    look = its.colour, Material[its.material]
    parts = [
        _fence_box((x, 0.03, its.height / 2 - 0.4), (0.09, 0.09, its.height + 0.9), *look)
        for x in np.linspace(0.0, length, max(round(length / 2.5), 1) + 1)
    ]
    if style == "mesh":
        z = np.arange(0.1, its.height, 0.2)
        parts.append(_fence_quads(np.stack([0 * z, 0 * z, z], 1), [length, 0, 0], [0, 0, 0.02], *look))
    else:
        parts += [_fence_box((middle, 0.03, z), (length, 0.04, 0.07), *look) for z in (0.3, 0.92 * its.height)]
    x = np.arange(its.step / 2, length, its.step)
    corner = np.stack([x - its.width / 2, 0 * x, 0 * x + its.low], axis=1)
    slats = _fence_quads(corner, [its.width, 0, 0], [0, 0, its.height - its.low], its.slats, look[1])
    return merge([*parts, slats])


@cache
def sheet_fence(style: str, length: float) -> tuple[Shape, Shape]:
    """Make a piece of a fence that lets light through, from the origin along x.

    Parameters
    ----------
    style : str
        One of `SHEETS`.
    length : float
        Its length, metres.

    Returns
    -------
    frame, sheet : Shape
        The post at the origin with the rails, and what a part of the light passes.
    """
    its, look = SHEETS[style], (SHEETS[style].colour, Material.METAL)
    post = _fence_box((0, 0, its.post[0]), (0.06, 0.06, its.post[1]), *look)
    rails = [_fence_box((length / 2, 0, z), (length, wide, high), *look) for z, wide, high in its.rails]
    sheet = _fence_quads((0, 0, its.sheet[0]), (length, 0, 0), (0, 0, its.sheet[1]), its.colour, Material[its.material])
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
    """Make a post without a fence on the origin.

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
    """Return the corners of a face of a sign, about the middle of the sign."""
    n, radius, turn = face.get("regular", (0, 0, 0))
    angle = np.radians(turn) + 2 * np.pi * np.arange(n) / max(n, 1)
    return face.get("corners") or np.stack([-radius * np.cos(angle), radius * np.sin(angle)], axis=1)


SIGNS = tuple(_FACES)
"""The traffic signs that `sign` knows."""


@cache
def sign(name: str) -> Shape:
    """Make a traffic sign on its pole at the origin; it faces -x, so that a driver who goes along x sees it.

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
    """Make a street lamp on the origin, whose arm reaches 1.5 m along y.

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
        Whether it shows green; else red.
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

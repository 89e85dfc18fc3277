"""Shapes of what stands beside a street: fences, garden walls, traffic signs, lamps and traffic lights."""

from functools import cache

import numpy as np

from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.primitives import ball, box, quads, tube
from semgrid_edu.workshop.simulation.things.shapes import Shape, merge, shape

FENCES = ("planks", "bars", "mesh", "wall")
"""The fences that `fence` knows."""
_WOOD, _STEEL, _STONE = (0.26, 0.16, 0.09), (0.05, 0.09, 0.06), (0.36, 0.34, 0.31)


def _pickets(length: float, step: float, width: float, low: float, high: float, colour, material) -> Shape:
    """Stand a row of upright slats along x."""
    x = np.arange(step / 2, length, step)
    corner = np.stack([x - width / 2, 0 * x, 0 * x + low], axis=1)
    return quads(corner, [width, 0, 0], [0, 0, high - low], colour, material, Kind.FENCE)


@cache
def fence(style: str, length: float) -> Shape:
    """Make a straight piece of fence from the origin along x.

    Parameters
    ----------
    style : str
        One of `FENCES`; "wall" is a low garden wall of stone, a fence to both label sets.
    length : float
        Length of the piece, metres.

    Returns
    -------
    Shape
    """
    if style == "wall":
        cap = box((length / 2, 0, 1.0), (length, 0.34, 0.1), (0.45, 0.43, 0.4), Material.PLASTER, Kind.FENCE)
        return merge([box((length / 2, 0, 0.1), (length, 0.25, 1.8), _STONE, Material.BRICK, Kind.FENCE), cap])
    post = {"planks": _WOOD, "bars": (0.06,) * 3, "mesh": _STEEL}[style]
    material = Material.WOOD if style == "planks" else Material.METAL
    height = {"planks": 1.35, "bars": 1.4, "mesh": 1.8}[style]
    posts = [
        box((x, 0.03, height / 2 - 0.4), (0.09, 0.09, height + 0.9), post, material, Kind.FENCE)
        for x in np.linspace(0.0, length, max(round(length / 2.5), 1) + 1)
    ]
    rails = [box((length / 2, 0.03, z), (length, 0.04, 0.07), post, material, Kind.FENCE) for z in (0.3, 0.92 * height)]
    if style == "planks":
        return merge([*posts, *rails, _pickets(length, 0.15, 0.11, 0.12, height, (0.30, 0.19, 0.11), Material.WOOD)])
    if style == "bars":
        return merge([*posts, *rails, _pickets(length, 0.13, 0.025, 0.1, height, (0.06,) * 3, Material.METAL)])
    z = np.arange(0.1, height, 0.2)
    wires = quads(np.stack([0 * z, 0 * z, z], 1), [length, 0, 0], [0, 0, 0.02], _STEEL, Material.METAL, Kind.FENCE)
    return merge([*posts, wires, _pickets(length, 0.1, 0.016, 0.05, height, _STEEL, Material.METAL)])


def _plate(corners: np.ndarray, colour, x: float, material=Material.RETRO) -> Shape:
    """Make a convex plate in the plane x, from its corners (y, z), facing -x."""
    n = len(corners)
    vertices = np.column_stack([np.full(n, x), corners])
    return shape(vertices, [[0, i, i + 1] for i in range(1, n - 1)], colour, material, Kind.SIGN)


def _polygon(n: int, radius: float, turn: float = 0.0) -> np.ndarray:
    angle = turn + 2 * np.pi * np.arange(n) / n
    return np.stack([-radius * np.cos(angle), radius * np.sin(angle)], axis=1)


_RED, _WHITE, _BLUE, _YELLOW = (0.55, 0.01, 0.015), (0.85, 0.85, 0.83), (0.01, 0.06, 0.4), (0.8, 0.5, 0.01)
_FACES = {
    "limit": [(_polygon(16, 0.32), _RED), (_polygon(16, 0.25), _WHITE), (_polygon(4, 0.12), (0.05,) * 3)],
    "no-entry": [
        (_polygon(16, 0.32), _RED),
        (np.array([[-0.22, -0.06], [-0.22, 0.06], [0.22, 0.06], [0.22, -0.06]]), _WHITE),
    ],
    "priority": [(_polygon(4, 0.4, np.pi / 2), _WHITE), (_polygon(4, 0.3, np.pi / 2), _YELLOW)],
    "warning": [(_polygon(3, 0.46, np.pi / 2), _RED), (_polygon(3, 0.3, np.pi / 2), _WHITE)],
    "stop": [(_polygon(8, 0.34, np.pi / 8), _WHITE), (_polygon(8, 0.31, np.pi / 8), _RED)],
    "parking": [
        (_polygon(4, 0.43, np.pi / 4), _BLUE),
        (np.array([[-0.08, -0.2], [-0.08, 0.2], [0.1, 0.2], [0.1, 0.0]]), _WHITE),
    ],
    "direction": [
        (np.array([[-0.6, -0.22], [-0.6, 0.22], [0.6, 0.22], [0.6, -0.22]]), _YELLOW),
        (np.array([[-0.5, -0.06], [-0.5, 0.06], [0.3, 0.06], [0.3, -0.06]]), (0.03,) * 3),
    ],
}
SIGNS = tuple(_FACES)
"""The traffic signs that `sign` knows."""


@cache
def sign(name: str) -> Shape:
    """Make a traffic sign on its pole; it faces -x, so that a driver who goes along x sees it.

    Parameters
    ----------
    name : str
        One of `SIGNS`.

    Returns
    -------
    Shape
        The pole stands on the origin.
    """
    pole = tube((0, 0, -0.5), (0, 0, 2.75), (0.035, 0.035), (0.42, 0.43, 0.44), Material.METAL, Kind.POLE)
    plates = [_plate(np.add(c, (0, 2.4)), colour, -0.05 - 0.008 * i) for i, (c, colour) in enumerate(_FACES[name])]
    back = _plate(np.add(_FACES[name][0][0][::-1], (0, 2.4)), (0.3, 0.3, 0.3), -0.04, Material.METAL)
    return merge([pole, back, *plates])


@cache
def lamp(height: float) -> Shape:
    """Make a street lamp on the origin, whose arm reaches 1.5 m along y.

    Parameters
    ----------
    height : float
        Height of the lamp above the ground, metres.

    Returns
    -------
    Shape
    """
    grey = {"colour": (0.24, 0.25, 0.25), "material": Material.METAL, "kind": Kind.POLE}
    head = box((0, 1.7, height), (0.22, 0.7, 0.12), (0.3, 0.3, 0.29), Material.METAL, Kind.POLE)
    return merge(
        [
            tube((0, 0, -0.5), (0, 0, 1.2), (0.11, 0.10), **grey),
            tube((0, 0, 1.2), (0, 0, height - 0.4), (0.075, 0.055), **grey),
            tube((0, 0, height - 0.4), (0, 1.5, height), (0.05, 0.04), **grey),
            head,
        ]
    )


@cache
def traffic_light(green: bool) -> Shape:
    """Make a traffic light on its pole at the origin; it faces -x.

    Parameters
    ----------
    green : bool
        Whether it shows green; else red.

    Returns
    -------
    Shape
    """
    dark = (0.025, 0.03, 0.028)
    colours = [(0.7, 0.02, 0.02), (0.5, 0.3, 0.02), (0.02, 0.6, 0.25)]
    lit = 2 if green else 0
    parts = [
        tube((0, 0, -0.5), (0, 0, 3.3), (0.06, 0.055), (0.2, 0.21, 0.2), Material.METAL, Kind.POLE),
        box((-0.12, 0, 2.75), (0.2, 0.32, 0.95), dark, Material.MATTE, Kind.SIGN),
    ]
    for i, colour in enumerate(colours):
        shade = colour if i == lit else 0.12 * np.asarray(colour)
        parts.append(
            ball(
                (-0.22, 0, 3.04 - 0.29 * i),
                (0.04, 0.11, 0.11),
                shade,
                Material.LAMP if i == lit else Material.MATTE,
                Kind.SIGN,
            )
        )
    return merge(parts)

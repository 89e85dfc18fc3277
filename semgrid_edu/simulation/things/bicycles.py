"""Shapes of bicycles, made of tubes; they stand on z = 0 and point along x."""

import itertools
from functools import cache

import numpy as np

from semgrid_edu.simulation.things.cars import PAINTS
from semgrid_edu.simulation.things.materials import Kind, Material
from semgrid_edu.simulation.things.primitives import ball, quads, tube
from semgrid_edu.simulation.things.shapes import Shape, merge


def _wheel(x: float) -> list[Shape]:
    """Make a bicycle wheel: a ring of tubes, and spokes."""
    angle = np.linspace(0, 2 * np.pi, 17)
    rim = np.stack([x + 0.33 * np.cos(angle), 0 * angle, 0.35 + 0.33 * np.sin(angle)], axis=1)
    tyre = [
        tube(a, b, (0.025, 0.025), (0.02,) * 3, Material.RUBBER, Kind.BICYCLE, 4) for a, b in itertools.pairwise(rim)
    ]
    spokes = [
        tube(rim[i], rim[i + 8], (0.006, 0.006), (0.4,) * 3, Material.METAL, Kind.BICYCLE, 3) for i in range(0, 8, 2)
    ]
    return [*tyre, *spokes]


@cache
def bicycle() -> Shape:
    """Make a bicycle, 1.75 m long; its frame is of `Material.PAINT`, so that it can be recoloured.

    Returns
    -------
    Shape
    """
    paint = {"colour": PAINTS[5], "material": Material.PAINT, "kind": Kind.BICYCLE, "sides": 5}
    metal = {"colour": (0.25,) * 3, "material": Material.METAL, "kind": Kind.BICYCLE, "sides": 5}
    crank, saddle, head, rear, front = (
        (-0.08, 0, 0.32),
        (-0.22, 0, 0.9),
        (0.38, 0, 0.85),
        (-0.53, 0, 0.35),
        (0.53, 0, 0.35),
    )
    thick, thin = (0.024, 0.024), (0.015, 0.015)
    return merge(
        [
            *_wheel(-0.53),
            *_wheel(0.53),
            tube(crank, saddle, thick, **paint),
            tube(crank, head, thick, **paint),
            tube((-0.2, 0, 0.83), head, thick, **paint),
            tube(crank, rear, thin, **paint),
            tube((-0.2, 0, 0.83), rear, thin, **paint),
            tube((0.36, 0, 0.98), front, thick, **paint),
            tube((0.4, -0.28, 1.02), (0.4, 0.28, 1.02), (0.018, 0.018), **metal),
            ball((-0.24, 0, 0.93), (0.13, 0.08, 0.04), (0.02,) * 3, Material.RUBBER, Kind.BICYCLE),
            tube((-0.08, -0.12, 0.32), (-0.08, 0.12, 0.32), (0.07, 0.07), **metal),
            quads([-0.55, 0.0, 0.7], [0.1, 0, 0], [0, 0.03, 0.04], (0.5, 0.02, 0.02), Material.RETRO, Kind.BICYCLE),
        ]
    )

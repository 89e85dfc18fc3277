"""Shapes of cars, spanned between cross-sections; they stand on z = 0 and point along x."""

import itertools
import tomllib
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from semgrid_edu.workshop.simulation.things import shapes
from semgrid_edu.workshop.simulation.things.materials import PALETTES, Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, merge, shape


class _Body(NamedTuple):
    """A table of `cars.toml`, which says what each number is."""

    length: float
    width: float
    windows: list[int]
    screens: list[int]
    x: list[float]
    sill: list[float]
    shoulder: list[float]
    top: list[float]
    half: list[float]
    half_top: list[float]


_TABLE = Path(__file__).with_name("cars.toml")
_BODIES = {name: _Body(**body) for name, body in tomllib.loads(_TABLE.read_text(encoding="utf-8")).items()}
BODIES = tuple(_BODIES)
"""The car bodies that `car` knows."""
PAINTS = PALETTES["paint"]
"""Linear colours of car paint, the usual ones first."""
_GLASS, _DARK, _TYRE = (0.025, 0.03, 0.035), (0.02, 0.02, 0.022), (0.025, 0.025, 0.025)
_BUMPER, _PLATE = (0.04, 0.04, 0.04), (0.9, 0.9, 0.88)
_WHEEL = (
    (1.14, -0.012, 0.05, _DARK, Material.RUBBER, 14),
    (1.0, 0.005, 0.0, _TYRE, Material.RUBBER, 14),
    (0.6, 0.017, 0.0, (0.42, 0.43, 0.44), Material.METAL, 10),
    (0.22, 0.021, 0.0, (0.1, 0.1, 0.1), Material.METAL, 6),
)
"""Arch, tyre, rim and hub: radius over the tyre's; how far it stands out of the car's side and above the axle, metres;
colour, material and number of faces."""
_box, _tube = partial(shapes.box, kind=Kind.CAR), partial(shapes.tube, kind=Kind.CAR)


def car_size(body: str) -> tuple[float, float, float]:
    """Return length, width and height of a car body, metres.

    Parameters
    ----------
    body : str
        One of `BODIES`.
    """
    measures = _BODIES[body]
    return measures.length, measures.width, max(measures.top)


def _rings(body: _Body) -> list[list[tuple[float, float, float]]]:
    """Return the eight corners of each cross-section, from the left sill over the top to the right sill."""
    rings = []
    for x, sill, shoulder, top, half, half_top in zip(*body[4:], strict=True):
        w, t = half * body.width / 2, half_top * body.width / 2
        middle = 0.45 * sill + 0.55 * shoulder
        left = [(0.93 * w, sill), (w, middle), (0.97 * w, shoulder), (t, top)]
        rings.append([(x * body.length, y, z) for y, z in left] + [(x * body.length, -y, z) for y, z in left[::-1]])
    return rings


def _loft(body: _Body) -> list[Shape]:
    """Span the skin between the cross-sections of a body."""
    rings = _rings(body)
    parts: dict[Material, list] = {Material.PAINT: [], Material.GLASS: [], Material.RUBBER: []}
    for i, (a, b) in enumerate(itertools.pairwise(rings)):
        for j in range(8):
            window = (j in (2, 4) and i in body.windows) or (j == 3 and i in body.screens)
            material = Material.GLASS if window else Material.RUBBER if j == 7 else Material.PAINT
            k = (j + 1) % 8
            parts[material] += [(a[j], a[k], b[k]), (a[j], b[k], b[j])]
    for ring, order in ((rings[0], 1), (rings[-1], -1)):
        for j in range(3):
            a, b, c, d = [ring[j], ring[j + 1], ring[6 - j], ring[7 - j]][::-order]
            parts[Material.PAINT] += [(a, b, c), (a, c, d)]
    colour = {Material.PAINT: PAINTS[0], Material.GLASS: _GLASS, Material.RUBBER: _DARK}
    return [
        shape(np.reshape(triangles, (-1, 3)), np.arange(3 * len(triangles)).reshape(-1, 3), colour[m], m, Kind.CAR)
        for m, triangles in parts.items()
    ]


def _wheels(body: _Body, radius: float) -> list[Shape]:
    """Put four wheels with hubs, and the dark arches around them."""
    parts = []
    for x, side in itertools.product((-0.295 * body.length, 0.315 * body.length), (-1, 1)):
        for size, out, up, colour, material, faces in _WHEEL:
            inner, outer = (side * (body.width / 2 + y) for y in (-0.24, out))
            ends = (x, inner, radius + up), (x, outer, radius + up)
            parts.append(_tube(*ends, size * radius, colour, material, sides=faces))
    return parts


def _trim(body: _Body, side: int) -> list[Shape]:
    """Put lamps, a mirror and a door handle on one side of a body, 1 for the left."""
    length, half, y = body.length, body.width / 2, side * body.width / 2
    tail, head, mirror, handle = 0.86 * body.shoulder[1], 1.02 * body.shoulder[-1], body.shoulder[-4], body.shoulder[4]
    return [
        _box((-0.484 * length, 0.78 * y, tail), (0.036 * length, 0.2 * half, 0.17), (0.35, 0.01, 0.01), Material.LAMP),
        _box((0.4785 * length, 0.62 * y, head), (0.05 * length, 0.3 * half, 0.12), (0.62, 0.64, 0.64), Material.LAMP),
        _box((0.17 * length, 1.05 * y, mirror + 0.08), (0.09, 0.16, 0.11), _DARK, Material.MATTE),
        _box((-0.02 * length, 0.995 * y, handle - 0.1), (0.16, 0.02, 0.03), (0.2, 0.2, 0.2), Material.METAL),
    ]


def _ends(body: _Body) -> list[Shape]:
    """Put number plates, grille and bumpers at both ends."""
    length, width = body.length, body.width
    return [
        _box((0.01 - 0.5 * length, 0, 0.66), (0.03, 0.52, 0.12), _PLATE, Material.RETRO),
        _box((0.5 * length - 0.01, 0, 0.42), (0.03, 0.52, 0.11), _PLATE, Material.RETRO),
        _box((0.481 * length, 0, 0.52), (0.04 * length, 0.4 * width, 0.12), (0.03, 0.03, 0.03), Material.MATTE),
        _box((-0.492 * length, 0, 0.36), (0.03, 0.75 * width, 0.12), _BUMPER, Material.MATTE),
        _box((0.485 * length, 0, 0.30), (0.06, 0.725 * width, 0.10), _BUMPER, Material.MATTE),
    ]


def _van_doors(length: float) -> list[Shape]:
    """Put windows and the seam between the two doors on a van's rear."""
    x = -0.4985 * length
    windows = [_box((x, y, 1.52), (0.05, 0.62, 0.42), _GLASS, Material.GLASS) for y in (-0.42, 0.42)]
    return [_box((x, 0, 1.1), (0.03, 0.02, 1.5), _DARK, Material.MATTE), *windows]


@cache
def car(body: str) -> Shape:
    """Make a car; `Shape.recoloured(Material.PAINT, colour)` gives it another paint.

    Parameters
    ----------
    body : str
        One of `BODIES`.
    """
    measures = _BODIES[body]
    wheels = _wheels(measures, 0.35 if body in ("suv", "van") else 0.31)
    doors = _van_doors(measures.length) if body == "van" else []
    return merge([*_loft(measures), *wheels, *_trim(measures, -1), *_trim(measures, 1), *doors, *_ends(measures)])

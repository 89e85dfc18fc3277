"""Shapes of cars, spanned between cross-sections; they stand on z = 0 and point along x."""

import itertools
from functools import cache
from types import SimpleNamespace

import numpy as np

from semgrid_edu.storage.files import named_rows, table_beside
from semgrid_edu.workshop.simulation.things.materials import PALETTES, Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, box, merge, shape, tube

_TABLES = table_beside(__file__)
_BODIES = named_rows(_TABLES["bodies"])
BODIES = tuple(_BODIES)
"""The car bodies that `car` knows."""
PAINTS = PALETTES["paint"]
"""Linear colours of car paint, the usual ones first."""
_GLASS, _DARK = (0.025, 0.03, 0.035), (0.02, 0.02, 0.022)


def car_size(body: str) -> tuple[float, float, float]:
    """Return length, width and height of a car body, metres.

    Parameters
    ----------
    body : str
        One of `BODIES`.
    """
    measures = _BODIES[body]
    return measures.length, measures.width, max(measures.top)


def _rings(body: SimpleNamespace) -> list[list[tuple[float, float, float]]]:
    """Return the eight corners of each cross-section, from the left sill over the top to the right sill."""
    rings, rows = [], (body.x, body.sill, body.shoulder, body.top, body.half, body.half_top)
    for x, sill, shoulder, top, half, half_top in zip(*rows, strict=True):
        w, t = half * body.width / 2, half_top * body.width / 2
        middle = 0.45 * sill + 0.55 * shoulder
        left = [(0.93 * w, sill), (w, middle), (0.97 * w, shoulder), (t, top)]
        rings.append([(x * body.length, y, z) for y, z in left] + [(x * body.length, -y, z) for y, z in left[::-1]])
    return rings


def _loft(body: SimpleNamespace) -> list[Shape]:
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


def _wheels(body: SimpleNamespace) -> list[Shape]:
    """Put four wheels with hubs, and the dark arches around them."""
    parts = []
    for x, side in itertools.product((-0.295 * body.length, 0.315 * body.length), (-1, 1)):
        for ring in _TABLES["wheel"]:
            ends = [(x, side * (body.width / 2 + y), body.wheel + ring["up"]) for y in (-0.24, ring["out"])]
            style = ring["colour"], Material[ring["material"]], Kind.CAR, ring["faces"]
            parts.append(tube(*ends, ring["radius"] * body.wheel, *style))
    return parts


def _boxes(body: SimpleNamespace, names: tuple[str, ...], side: int = 1) -> list[Shape]:
    """Put the boxes of some tables on a body; 1 for the left side, where it matters."""
    parts, over = [], np.array([body.length, body.width / 2, 1.0])
    for row in itertools.chain.from_iterable(_TABLES[name] for name in names):
        section, factor = row.get("shoulder", (0, 0.0))
        at = over * [1, side, 1] * row["at"] + row.get("moved", 0.0) + [0, 0, factor * body.shoulder[section]]
        size = over * row.get("sides", 0.0) + row.get("metres", 0.0)
        parts.append(box(at, size, row["colour"], Material[row["material"]], Kind.CAR))
    return parts


@cache
def car(body: str) -> Shape:
    """Make a car; `Shape.recoloured(Material.PAINT, colour)` gives it another paint.

    Parameters
    ----------
    body : str
        One of `BODIES`.
    """
    its, rear = _BODIES[body], ("van", "ends") if body == "van" else ("ends",)
    sides = _boxes(its, ("side",), -1) + _boxes(its, ("side",))
    return merge([*_loft(its), *_wheels(its), *sides, *_boxes(its, rear)])

"""Shapes of cars, spanned between cross-sections; they stand on z = 0 and point along x."""

import itertools
from functools import cache

import numpy as np

from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.primitives import box, tube
from semgrid_edu.workshop.simulation.things.shapes import Shape, merge, shape

# A body has a length and a width (m), and cross-sections from rear to front. A cross-section is x / length, the heights
# of the sill, of the shoulder line and of the top (m), then the half-widths of body and top over half the car's width.
# Then come the numbers of the spans between two cross-sections whose sides are windows, and of those whose top is one.
_BODIES = {
    "hatchback": (
        (4.0, 1.74),
        [
            (-0.500, 0.36, 0.72, 0.78, 0.86, 0.78),
            (-0.480, 0.22, 0.92, 0.96, 0.96, 0.84),
            (-0.400, 0.20, 0.95, 1.38, 1.00, 0.70),
            (-0.170, 0.20, 0.94, 1.46, 1.00, 0.72),
            (-0.150, 0.20, 0.94, 1.46, 1.00, 0.72),
            (0.060, 0.20, 0.92, 1.42, 1.00, 0.71),
            (0.230, 0.20, 0.90, 0.95, 0.99, 0.82),
            (0.430, 0.20, 0.76, 0.80, 0.95, 0.76),
            (0.500, 0.30, 0.58, 0.64, 0.80, 0.66),
        ],
        (2, 4, 5),
        (1, 5),
    ),
    "sedan": (
        (4.6, 1.80),
        [
            (-0.500, 0.36, 0.74, 0.80, 0.84, 0.76),
            (-0.480, 0.24, 0.92, 0.98, 0.94, 0.82),
            (-0.340, 0.20, 0.96, 1.02, 0.99, 0.84),
            (-0.210, 0.20, 0.95, 1.40, 1.00, 0.68),
            (-0.070, 0.20, 0.94, 1.44, 1.00, 0.70),
            (-0.050, 0.20, 0.94, 1.44, 1.00, 0.70),
            (0.100, 0.20, 0.92, 1.40, 1.00, 0.69),
            (0.240, 0.20, 0.90, 0.96, 0.99, 0.82),
            (0.440, 0.20, 0.76, 0.80, 0.94, 0.76),
            (0.500, 0.30, 0.58, 0.64, 0.80, 0.66),
        ],
        (2, 3, 5, 6),
        (2, 6),
    ),
    "estate": (
        (4.7, 1.80),
        [
            (-0.500, 0.36, 0.74, 0.80, 0.88, 0.80),
            (-0.485, 0.22, 0.94, 0.98, 0.97, 0.86),
            (-0.430, 0.20, 0.96, 1.42, 1.00, 0.74),
            (-0.210, 0.20, 0.95, 1.47, 1.00, 0.74),
            (-0.195, 0.20, 0.95, 1.47, 1.00, 0.74),
            (0.090, 0.20, 0.92, 1.42, 1.00, 0.71),
            (0.240, 0.20, 0.90, 0.96, 0.99, 0.82),
            (0.440, 0.20, 0.76, 0.80, 0.94, 0.76),
            (0.500, 0.30, 0.58, 0.64, 0.80, 0.66),
        ],
        (2, 4, 5),
        (1, 5),
    ),
    "suv": (
        (4.5, 1.88),
        [
            (-0.500, 0.42, 0.86, 0.92, 0.88, 0.80),
            (-0.480, 0.30, 1.08, 1.12, 0.97, 0.88),
            (-0.430, 0.28, 1.10, 1.62, 1.00, 0.76),
            (-0.190, 0.28, 1.09, 1.70, 1.00, 0.78),
            (-0.170, 0.28, 1.09, 1.70, 1.00, 0.78),
            (0.080, 0.28, 1.07, 1.64, 1.00, 0.76),
            (0.220, 0.28, 1.05, 1.10, 1.00, 0.86),
            (0.440, 0.28, 0.94, 0.98, 0.96, 0.82),
            (0.500, 0.38, 0.72, 0.80, 0.84, 0.74),
        ],
        (2, 4, 5),
        (1, 5),
    ),
    "van": (
        (5.3, 1.98),
        [
            (-0.500, 0.36, 1.05, 1.85, 0.95, 0.86),
            (-0.490, 0.28, 1.08, 2.25, 0.99, 0.90),
            (-0.100, 0.28, 1.10, 2.34, 1.00, 0.92),
            (0.170, 0.28, 1.10, 2.32, 1.00, 0.90),
            (0.300, 0.28, 1.10, 2.10, 1.00, 0.84),
            (0.410, 0.28, 1.08, 1.14, 0.98, 0.84),
            (0.480, 0.28, 0.90, 0.96, 0.94, 0.80),
            (0.500, 0.36, 0.70, 0.80, 0.88, 0.76),
        ],
        (3, 4),
        (4,),
    ),
}
BODIES = tuple(_BODIES)
"""The car bodies that `car` knows."""
PAINTS = (
    (0.62, 0.63, 0.63),
    (0.85, 0.85, 0.84),
    (0.30, 0.31, 0.33),
    (0.02, 0.02, 0.025),
    (0.03, 0.06, 0.19),
    (0.35, 0.02, 0.02),
    (0.10, 0.11, 0.13),
    (0.05, 0.16, 0.10),
    (0.42, 0.38, 0.28),
    (0.08, 0.20, 0.42),
    (0.55, 0.22, 0.03),
)
"""Linear colours of car paint, the usual ones first."""
_GLASS, _DARK = (0.025, 0.03, 0.035), (0.02, 0.02, 0.022)


def car_size(body: str) -> tuple[float, float, float]:
    """Return length, width and height of a car body, metres.

    Parameters
    ----------
    body : str
        One of `BODIES`.
    """
    (length, width), sections, _, _ = _BODIES[body]
    return length, width, max(section[3] for section in sections)


def _loft(body: str) -> list[Shape]:
    """Span the skin between the cross-sections of a body."""
    (length, width), sections, glass, screen = _BODIES[body]
    rings = []
    for x, sill, shoulder, top, half, half_top in sections:
        w, t = half * width / 2, half_top * width / 2
        middle = 0.45 * sill + 0.55 * shoulder
        left = [(0.93 * w, sill), (w, middle), (0.97 * w, shoulder), (t, top)]
        rings.append([(x * length, y, z) for y, z in left] + [(x * length, -y, z) for y, z in reversed(left)])
    parts: dict[Material, list] = {Material.PAINT: [], Material.GLASS: [], Material.RUBBER: []}
    for i, (a, b) in enumerate(itertools.pairwise(rings)):
        for j in range(8):
            window = (j in (2, 4) and i in glass) or (j == 3 and i in screen)
            material = Material.GLASS if window else Material.RUBBER if j == 7 else Material.PAINT
            k = (j + 1) % 8
            parts[material] += [(a[j], a[k], b[k]), (a[j], b[k], b[j])]
    for ring, order in ((rings[0], 1), (rings[-1], -1)):
        for j in range(3):
            loop = [ring[j], ring[j + 1], ring[6 - j], ring[7 - j]][::-order]
            parts[Material.PAINT] += [(loop[0], loop[1], loop[2]), (loop[0], loop[2], loop[3])]
    colour = {Material.PAINT: PAINTS[0], Material.GLASS: _GLASS, Material.RUBBER: _DARK}
    return [
        shape(np.reshape(triangles, (-1, 3)), np.arange(3 * len(triangles)).reshape(-1, 3), colour[m], m, Kind.CAR)
        for m, triangles in parts.items()
    ]


def _wheels(length: float, width: float, radius: float) -> list[Shape]:
    """Put four wheels with hubs, and the dark arches around them."""
    parts = []
    for x in (-0.295 * length, 0.315 * length):
        for side in (-1, 1):
            outer = side * (width / 2 + 0.005)
            inner = side * (width / 2 - 0.24)
            arch = side * (width / 2 - 0.012)
            parts += [
                tube(
                    (x, inner, radius + 0.05),
                    (x, arch, radius + 0.05),
                    (1.14 * radius,) * 2,
                    _DARK,
                    Material.RUBBER,
                    Kind.CAR,
                    14,
                ),
                tube(
                    (x, inner, radius), (x, outer, radius), (radius,) * 2, (0.025,) * 3, Material.RUBBER, Kind.CAR, 14
                ),
                tube(
                    (x, inner, radius),
                    (x, outer + side * 0.012, radius),
                    (0.6 * radius,) * 2,
                    (0.42, 0.43, 0.44),
                    Material.METAL,
                    Kind.CAR,
                    10,
                ),
                tube(
                    (x, inner, radius),
                    (x, outer + side * 0.016, radius),
                    (0.22 * radius,) * 2,
                    (0.1,) * 3,
                    Material.METAL,
                    Kind.CAR,
                    6,
                ),
            ]
    return parts


def _van_doors(length: float) -> list[Shape]:
    """Put windows and the seam between the two doors on a van's rear."""
    x = -0.4985 * length
    return [
        box((x, 0, 1.1), (0.03, 0.02, 1.5), _DARK, Material.MATTE, Kind.CAR),
        *(box((x, y, 1.52), (0.05, 0.62, 0.42), _GLASS, Material.GLASS, Kind.CAR) for y in (-0.42, 0.42)),
    ]


def _trim(body: str, side: int) -> list[Shape]:
    """Put lamps, a mirror and a door handle on one side of a body, 1 for the left."""
    length, width, _ = car_size(body)
    sections = _BODIES[body][1]
    y, half = side * width / 2, width / 2
    tail, head = 0.86 * sections[1][2], 1.02 * sections[-1][2]
    red, white, steel = (0.35, 0.01, 0.01), (0.62, 0.64, 0.64), (0.2, 0.2, 0.2)
    return [
        box((-0.484 * length, 0.78 * y, tail), (0.036 * length, 0.2 * half, 0.17), red, Material.LAMP, Kind.CAR),
        box((0.4785 * length, 0.62 * y, head), (0.05 * length, 0.30 * half, 0.12), white, Material.LAMP, Kind.CAR),
        box((0.17 * length, 1.05 * y, sections[-4][2] + 0.08), (0.09, 0.16, 0.11), _DARK, Material.MATTE, Kind.CAR),
        box((-0.02 * length, 0.995 * y, sections[4][2] - 0.1), (0.16, 0.02, 0.03), steel, Material.METAL, Kind.CAR),
    ]


@cache
def car(body: str) -> Shape:
    """Make a car; `Shape.recoloured(Material.PAINT, colour)` gives it another paint.

    Parameters
    ----------
    body : str
        One of `BODIES`.

    Returns
    -------
    Shape
    """
    length, width, _ = car_size(body)
    half = width / 2
    parts = _loft(body) + _wheels(length, width, 0.31 if body not in ("suv", "van") else 0.35)
    parts += _trim(body, -1) + _trim(body, 1)
    if body == "van":
        parts += _van_doors(length)
    parts += [
        box((0.01 - 0.5 * length, 0, 0.66), (0.03, 0.52, 0.12), (0.9, 0.9, 0.88), Material.RETRO, Kind.CAR),
        box((0.5 * length - 0.01, 0, 0.42), (0.03, 0.52, 0.11), (0.9, 0.9, 0.88), Material.RETRO, Kind.CAR),
        box((0.481 * length, 0, 0.52), (0.04 * length, 0.8 * half, 0.12), (0.03,) * 3, Material.MATTE, Kind.CAR),
        box((-0.492 * length, 0, 0.36), (0.03, 1.5 * half, 0.12), (0.04,) * 3, Material.MATTE, Kind.CAR),
        box((0.485 * length, 0, 0.30), (0.06, 1.45 * half, 0.10), (0.04,) * 3, Material.MATTE, Kind.CAR),
    ]
    return merge(parts)

"""Cars, people and bicycles. The ground is z = 0, and they face along x."""

import itertools
from dataclasses import dataclass, replace
from functools import cache, partial
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.storage.files import named_rows, table_beside
from semgrid_edu.workshop.simulation.things.materials import PALETTES, Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape, ball, box, merge, quads, shape, tube

_TABLES = table_beside(__file__, "cars")
_BODIES = named_rows(_TABLES["bodies"])
BODIES = tuple(_BODIES)
"""The available car bodies."""
PAINTS = PALETTES["paint"]
"""Linear colours of car paint, common ones first."""
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
    """Return the eight corners of each cross-section, from the left sill over the roof to the right sill."""
    rings = []
    rows = (body.x, body.sill, body.shoulder, body.top, body.half, body.half_top)
    for x, sill, shoulder, top, half, half_top in zip(*rows, strict=True):
        w = half * body.width / 2
        t = half_top * body.width / 2
        middle = 0.45 * sill + 0.55 * shoulder
        left = [(0.93 * w, sill), (w, middle), (0.97 * w, shoulder), (t, top)]
        rings.append([(x * body.length, y, z) for y, z in left] + [(x * body.length, -y, z) for y, z in left[::-1]])
    return rings


def _loft(body: SimpleNamespace) -> list[Shape]:
    """Loft the skin between the cross-sections of a body."""
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
    """Make four wheels with hubs and dark wheel arches."""
    parts = []
    for x, side in itertools.product((-0.295 * body.length, 0.315 * body.length), (-1, 1)):
        for ring in _TABLES["wheel"]:
            ends = [(x, side * (body.width / 2 + y), body.wheel + ring["up"]) for y in (-0.24, ring["out"])]
            style = ring["colour"], Material[ring["material"]], Kind.CAR, ring["faces"]
            parts.append(tube(*ends, ring["radius"] * body.wheel, *style))
    return parts


def _boxes(body: SimpleNamespace, names: tuple[str, ...], side: int = 1) -> list[Shape]:
    """Make the boxes of some tables for a body; `side` is 1 for the left side and -1 for the right."""
    parts = []
    over = np.array([body.length, body.width / 2, 1.0])
    for row in itertools.chain.from_iterable(_TABLES[name] for name in names):
        section, factor = row.get("shoulder", (0, 0.0))
        at = over * [1, side, 1] * row["at"] + row.get("moved", 0.0) + [0, 0, factor * body.shoulder[section]]
        size = over * row.get("sides", 0.0) + row.get("metres", 0.0)
        parts.append(box(at, size, row["colour"], Material[row["material"]], Kind.CAR))
    return parts


@cache
def car(body: str) -> Shape:
    """Make a car; `Shape.recoloured(Material.PAINT, colour)` repaints it.

    Parameters
    ----------
    body : str
        One of `BODIES`.
    """
    spec = _BODIES[body]
    rear = ("van", "ends") if body == "van" else ("ends",)
    sides = _boxes(spec, ("side",), -1) + _boxes(spec, ("side",))
    return merge([*_loft(spec), *_wheels(spec), *sides, *_boxes(spec, rear)])


_BLACK, _GREY = (0.02, 0.02, 0.02), (0.25, 0.25, 0.25)
_BICYCLE = table_beside(__file__, "bicycle")


def _wheel(x: float) -> list[Shape]:
    """Make a bicycle wheel: a ring of tubes with spokes."""
    angle = np.linspace(0, 2 * np.pi, 17)
    rim = np.stack([x + 0.33 * np.cos(angle), 0 * angle, 0.35 + 0.33 * np.sin(angle)], axis=1)
    tyre = [tube(a, b, 0.025, _BLACK, Material.RUBBER, Kind.BICYCLE, 4) for a, b in itertools.pairwise(rim)]
    pairs = ((rim[i], rim[i + 8]) for i in range(0, 8, 2))
    return tyre + [tube(a, b, 0.006, (0.4, 0.4, 0.4), Material.METAL, Kind.BICYCLE, 3) for a, b in pairs]


@cache
def bicycle() -> Shape:
    """Make a bicycle, 1.75 m long; its frame has `Material.PAINT`, so it can be recoloured."""
    metal = partial(tube, colour=_GREY, material=Material.METAL, kind=Kind.BICYCLE, sides=5)
    frame = [tube(*measures, PAINTS[5], Material.PAINT, Kind.BICYCLE, 5) for measures in _BICYCLE["frame"]]
    bar, pedals = (metal((x, -y, z), (x, y, z), thick) for x, y, z, thick in _BICYCLE["bars"])
    saddle = ball((-0.24, 0, 0.93), (0.13, 0.08, 0.04), _BLACK, Material.RUBBER, Kind.BICYCLE)
    light = quads([-0.55, 0.0, 0.7], [0.1, 0, 0], [0, 0.03, 0.04], (0.5, 0.02, 0.02), Material.RETRO, Kind.BICYCLE)
    return merge([*_wheel(-0.53), *_wheel(0.53), *frame, bar, saddle, pedals, light])


_PHASES = 16
_TOP, _TROUSERS, _SKIN_SLOT, _HAIR_SLOT, _SHOES = range(5)


@dataclass(frozen=True)
class Person:
    """The appearance of a person.

    Parameters
    ----------
    height : float
        Body height, metres; 1.5 to 1.95 m for adults.
    top, trousers, skin, hair : (float, float, float)
        Linear albedo, red, green and blue, 0..1.
    frame : (float, float, float)
        Linear albedo of the bicycle's paint, for a cyclist.
    """

    height: float
    top: tuple[float, float, float]
    trousers: tuple[float, float, float]
    skin: tuple[float, float, float]
    hair: tuple[float, float, float]
    frame: tuple[float, float, float]

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Person":
        """Draw height, clothes, skin, hair and the paint of the bicycle.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        """
        clothes = PALETTES["clothes"]
        choices = (clothes, clothes[:4] + clothes[7:], PALETTES["skin"], PALETTES["hair"], PAINTS)
        top, trousers = (colours[rng.integers(len(colours))] for colours in choices[:2])
        height = rng.uniform(1.55, 1.92)
        return cls(height, top, trousers, *(colours[rng.integers(len(colours))] for colours in choices[2:]))


def _blob(centre: ArrayLike, radii: tuple, slot: int, kind: Kind, detail: int = 1) -> Shape:
    """Make an ellipsoid in the colour slot of one garment."""
    return ball(centre, radii, (slot,) * 3, Material.CLOTH, kind, detail)


def _limb(joints: list, radii: tuple, slot: int, kind: Kind) -> list[Shape]:
    """Make a chain of tubes through three joints, with a ball at the bend."""
    bones = zip(itertools.pairwise(joints), itertools.pairwise(radii), strict=True)
    parts = [tube(*ends, thick, (slot,) * 3, Material.CLOTH, kind) for ends, thick in bones]
    return [*parts, _blob(joints[1], (radii[1],) * 3, slot, kind, 0)]


def _trunk(hip: NDArray, shoulder: NDArray, kind: Kind) -> list[Shape]:
    """Make hips, chest, neck, head and hair."""
    face = np.add(shoulder, (0.03, 0, 0.17))
    return [
        tube(hip, shoulder, (0.145, 0.17), (_TOP,) * 3, Material.CLOTH, kind, 9),
        _blob(hip, (0.13, 0.165, 0.13), _TROUSERS, kind),
        _blob(hip + 0.92 * (shoulder - hip), (0.12, 0.21, 0.11), _TOP, kind),
        tube(shoulder - [0, 0, 0.03], face, 0.055, (_SKIN_SLOT,) * 3, Material.CLOTH, kind),
        _blob(face, (0.095, 0.08, 0.12), _SKIN_SLOT, kind),
        _blob(np.add(face, (-0.025, 0, 0.035)), (0.098, 0.09, 0.11), _HAIR_SLOT, kind),
    ]


@cache
def _walking(phase: int) -> Shape:
    """Make a person of 1.78 m in mid-stride; colours are garment numbers."""
    kind = Kind.PEDESTRIAN
    swing = np.sin(2 * np.pi * phase / _PHASES)
    hip = np.array([0.0, 0.0, 0.95])
    shoulder = np.array([0.03, 0.0, 1.45])
    parts = _trunk(hip, shoulder, kind)
    for side in (-1, 1):
        step = side * swing
        knee = np.array([0.22 * step + 0.05, 0.09 * side, 0.5])
        foot = np.array([0.36 * step - 0.04 + 0.05 * (step < 0), 0.09 * side, 0.07 + 0.06 * max(-step, 0)])
        parts += _limb([np.add(hip, (0, 0.09 * side, 0)), knee, foot], (0.095, 0.07, 0.05), _TROUSERS, kind)
        parts.append(_blob(np.add(foot, (0.06, 0, -0.02)), (0.13, 0.05, 0.05), _SHOES, kind, 0))
        elbow = np.array([-0.12 * step - 0.02, 0.24 * side, 1.17])
        hand = np.array([-0.26 * step + 0.1, 0.25 * side, 0.95])
        parts += _limb([np.add(shoulder, (0, 0.19 * side, -0.03)), elbow, hand], (0.06, 0.05, 0.038), _TOP, kind)
        parts.append(_blob(hand, (0.05, 0.04, 0.06), _SKIN_SLOT, kind, 0))
    return merge(parts)


@cache
def _riding(phase: int) -> Shape:
    """Make a cyclist without the bicycle; colours are garment numbers."""
    kind = Kind.BICYCLE
    hip = np.array([-0.22, 0.0, 0.98])
    shoulder = np.array([0.1, 0.0, 1.48])
    parts = _trunk(hip, shoulder, kind)
    for side in (-1, 1):
        turn = 2 * np.pi * phase / _PHASES + (np.pi if side > 0 else 0)
        foot = np.array([-0.08 + 0.17 * np.cos(turn), 0.11 * side, 0.34 - 0.17 * np.sin(turn)])
        knee = (hip + foot) / 2 + np.array([0.2, 0.02 * side, 0.06])
        parts += _limb([np.add(hip, (0, 0.09 * side, 0)), knee, foot], (0.09, 0.065, 0.05), _TROUSERS, kind)
        parts.append(_blob(np.add(foot, (0.05, 0, -0.03)), (0.12, 0.045, 0.04), _SHOES, kind, 0))
        elbow = np.array([0.22, 0.26 * side, 1.2])
        hand = np.array([0.4, 0.25 * side, 1.04])
        parts += _limb([np.add(shoulder, (0, 0.18 * side, -0.03)), elbow, hand], (0.055, 0.045, 0.035), _TOP, kind)
    return merge(parts)


def _dressed(body: Shape, person: Person) -> Shape:
    """Replace garment numbers with the person's colours."""
    palette = np.array([person.top, person.trousers, person.skin, person.hair, (0.03, 0.025, 0.02)], np.float32)
    return replace(body, colour=palette[body.colour[:, 0].astype(int)])


def walker(person: Person, distance: float) -> Shape:
    """Make a person in mid-stride.

    Parameters
    ----------
    person : Person
        Height and colours of the person.
    distance : float
        Distance walked so far, metres; the gait repeats every 1.45 m.
    """
    phase = round(distance / 1.45 * _PHASES) % _PHASES
    return _dressed(_walking(phase), person).placed((0, 0, 0), scale=person.height / 1.78)


def rider(person: Person, distance: float) -> Shape:
    """Make a cyclist on a bicycle.

    Parameters
    ----------
    person : Person
        The colours of clothes and bicycle; all riders have the same height.
    distance : float
        Distance ridden so far, metres; the pedals turn once every 5 m.
    """
    phase = round(distance / 5.0 * _PHASES) % _PHASES
    return merge([bicycle().recoloured(Material.PAINT, person.frame), _dressed(_riding(phase), person)])

"""The plan of a street: what a world is to be like, drawn at random except for what is asked for."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.simulation.street.ground import Extent
from semgrid_edu.workshop.simulation.street.layout import Road, Side
from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.things.roadside import FENCES

BORDERS = (*FENCES, "hedge", "none")
"""What may run along the gardens of a suburb."""
STYLES = ("town", "suburb", "park")
"""What lines a side of the road: facades at the sidewalk; houses in gardens; grass banks and trees."""
YARD = "yard"
"""A style that is only wished for, never drawn: a border of `YARD_BORDERS`, and open ground behind it."""
LAYOUTS = ("straight", "bend", "junction")
"""What a road may do."""
CROSSING = "crossing"
"""A layout that is only wished for, never drawn: a junction whose side road leaves on both sides."""


@dataclass(frozen=True)
class Wishes:
    """What is asked of a drive; whatever is None is drawn at random.

    Parameters
    ----------
    layout : str or None
        One of `LAYOUTS`, or `CROSSING`.
    lanes : (int, int) or None
        Lanes of the oncoming traffic and of ours.
    styles, borders : (str, str) or None
        Left and right, of `STYLES` and `BORDERS`; or `YARD` with one of `YARD_BORDERS`.
    parking : (bool, bool) or None
        Parking bays left and right.
    light : Light or None
        Sun, sky and exposure.
    density : float or None
        How much traffic and how many people there are, 0..1.
    speed : float or None
        Mean speed of the recording car, m/s.
    ego_lane : int or None
        Lane of the recording car; 0 is beside the centre line.
    cast : callable or None
        Function that takes the drive's `Traffic` and puts road users on the street, in place of `fill_street`.
    relief : dict or None
        Crown, grades and crest, as fields of `Road`. With {} all asphalt is one plane, on which the recording car
        hardly sways.
    """

    layout: str | None = None
    lanes: tuple[int, int] | None = None
    styles: tuple[str, str] | None = None
    borders: tuple[str, str] | None = None
    parking: tuple[bool, bool] | None = None
    light: Light | None = None
    density: float | None = None
    speed: float | None = None
    ego_lane: int | None = None
    cast: Callable | None = None
    relief: dict[str, float] | None = None


ANY = Wishes()
"""No wishes: everything is drawn."""


@dataclass(frozen=True)
class Plan:
    """What a world is to be like, before anything is built.

    Parameters
    ----------
    road : Road
        Its street.
    extent : Extent
        How far the world reaches along the street.
    styles : (str, str)
        Left and right side, members of `STYLES`, or `YARD`.
    borders : (str, str)
        What runs along the gardens of a suburb, left and right: a fence of `roadside.FENCES`, "hedge" or "none"; along
        a yard one of `YARD_BORDERS`.
    parking : (bool, bool)
        Whether there are parking bays left and right.
    light : Light
        Sun, sky and exposure.
    density : float
        How much traffic and how many people there are, 0..1.
    foliage : (float, float, float)
        Factor for red, green and blue of all leaves: the season.
    """

    road: Road
    extent: Extent
    styles: tuple[str, str]
    borders: tuple[str, str]
    parking: tuple[bool, bool]
    light: Light
    density: float
    foliage: tuple[float, float, float]

    def border(self, sign: int) -> str:
        """Return what runs along one side. Parameters are those of `Road.side`."""
        return self.borders[0 if sign > 0 else 1]


_SIDES = table_beside(__file__)  # how it may look beside the road in each style


def _side(style: str, lanes: int, lane: float, parking: bool, rng: np.random.Generator) -> Side:
    """Draw one side of the road."""
    edge = lanes * lane + (2.2 if parking else 0.35)
    looks = _SIDES[style]
    strip = rng.uniform(1.4, 2.6) if rng.random() < looks["grass"] else 0.0
    walk = rng.uniform(*looks["sidewalk"])
    if style == "park" and rng.random() < 0.4:
        strip, walk = 0.0, 0.0
    rise = rng.uniform(*looks["bank"]) if "bank" in looks else 0.0
    return Side(edge, strip, walk, rise, rng.uniform(2.5, 6.0))


def _road(rng: np.random.Generator, length: float, layout: str, lanes: tuple, styles: tuple, parking: tuple) -> Road:
    """Draw the geometry of a street on which the recording car drives `length` metres."""
    lane = rng.uniform(3.1, 3.6)
    start = 0.0
    curvature = 0.0
    arc = 0.0
    if layout == "bend":
        start = rng.uniform(15, 40) + 0.5 * length
        curvature = rng.choice([-1, 1]) / rng.uniform(75, 220)
        arc = rng.uniform(0.25, 0.9) / abs(curvature)
    junction = layout in ("junction", CROSSING)
    both = rng.random() < 0.6 or layout == CROSSING
    leaves = (True, True) if both else tuple(rng.permutation([True, False]).tolist())
    return Road(
        bend_start=float(start), bend_end=float(start + arc), curvature=float(curvature),
        lane=float(lane), lanes_left=lanes[0], lanes_right=lanes[1],
        left=_side(styles[0], lanes[0], lane, parking[0], rng), right=_side(styles[1], lanes[1], lane, parking[1], rng),
        junction=float(rng.uniform(18, 45) + length) if junction else 0.0,
        side_half=float(rng.uniform(3.0, 4.5)) if junction else 0.0,
        side_left=leaves[0], side_right=leaves[1], corner=float(rng.uniform(3.5, 6.0)),
        zebra=bool(rng.random() < 0.7), dashed=bool(rng.random() < 0.75),
    )  # fmt: skip


def _relief(rng: np.random.Generator, length: float) -> dict[str, float]:
    """Draw the crown and the grades of a road on which the recording car drives `length` metres, as fields of `Road`.

    Town roads are built with a cross fall of 2 % or a little more, grades of up to 6 %, and vertical curves that take 4
    to 12 m for each per cent by which the grade changes.
    """
    before, after = (float(grade) for grade in rng.normal(0, 0.025, 2).clip(-0.06, 0.06))
    half = 0.5 * max(10.0, 100 * abs(after - before) * rng.uniform(4.0, 12.0))
    middle = float(rng.uniform(-10, 60) + length)
    ends = {"crest_start": middle - half, "crest_end": middle + half}
    return {"crown": float(rng.uniform(0.015, 0.025)), "grade_before": before, "grade_after": after} | ends


def draw_plan(rng: np.random.Generator, length: float, wishes: Wishes) -> Plan:
    """Draw a world's plan.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of all that is drawn.
    length : float
        Distance that the recording car drives, metres.
    wishes : Wishes
        What isn't left to chance.
    """
    layout = wishes.layout or str(rng.choice(LAYOUTS, p=[0.3, 0.3, 0.4]))
    lanes = wishes.lanes or [(1, 1), (1, 1), (1, 2), (2, 2)][rng.integers(4)]
    styles = wishes.styles or tuple(map(str, rng.choice(STYLES, 2, p=[0.35, 0.4, 0.25])))
    borders = wishes.borders or tuple(map(str, rng.choice(BORDERS, 2, p=[0.2, 0.16, 0.16, 0.12, 0.24, 0.12])))
    parking = wishes.parking or tuple(bool(p) for p in rng.random(2) < 0.5)
    road = _road(rng, length, layout, lanes, styles, parking)
    road = road._replace(**(_relief(rng, length) if wishes.relief is None else wishes.relief))
    foliage = [(1.0, 1.0, 1.0), (1.35, 1.25, 0.9), (2.2, 1.05, 0.7)][rng.choice(3, p=[0.55, 0.3, 0.15])]
    light = wishes.light or Light.random(rng)
    drawn = float(rng.uniform(0.15, 1.0))
    density = drawn if wishes.density is None else wishes.density
    return Plan(road, Extent(-45.0, length + 210.0), styles, borders, parking, light, density, foliage)

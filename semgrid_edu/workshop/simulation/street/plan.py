"""The plan of a street: the properties of a world, random unless a wish fixes them; and the named streets."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.simulation.street.layout import Road, Side
from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.things.roadside import FENCES

BORDERS = (*FENCES, "hedge", "none")
"""The borders of suburban gardens."""
STYLES = ("town", "suburb", "park")
"""Styles of a roadside: facades at the sidewalk; houses in gardens; grass banks and trees."""
YARD = "yard"
"""A style that never comes up at random, only by wish: a border of `YARD_BORDERS` with open ground behind it."""
LAYOUTS = ("straight", "bend", "junction")
"""Random layouts of a road."""
CROSSING = "crossing"
"""A layout that never comes up at random, only by wish: a junction whose side road leaves to both sides."""


@dataclass(frozen=True)
class Wishes:
    """The fixed properties of a drive. Fields that are None are random.

    Parameters
    ----------
    layout : str or None
        One of `LAYOUTS`, or `CROSSING`.
    lanes : (int, int) or None
        Number of oncoming lanes and of lanes in our direction.
    styles, borders : (str, str) or None
        Left and right: from `STYLES` and `BORDERS`, or `YARD` with one of `YARD_BORDERS`.
    parking : (bool, bool) or None
        Parking bays left and right.
    light : Light or None
        Sun, sky and exposure.
    density : float or None
        Density of traffic and pedestrians, 0..1.
    speed : float or None
        Mean speed of the recording car, m/s.
    ego_lane : int or None
        Lane of the recording car; 0 is next to the centre line.
    cast : str or callable
        Function that takes the drive's `Traffic` and puts road users on the street, or its name in `road_users`.
    relief : dict or None
        Crown, grades and crest, as fields of `Road`. With {} the asphalt is flat, and the recording car hardly sways.
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
    cast: str | Callable = "fill_street"
    relief: dict[str, float] | None = None


RANDOM_STREET = Wishes()
"""No wishes: everything is random."""


@dataclass(frozen=True)
class Plan:
    """The plan of a world, before anything is built.

    Parameters
    ----------
    road : Road
        The street.
    start, end : float
        Smallest and largest s of the world, metres.
    styles : (str, str)
        Left and right side, members of `STYLES`, or `YARD`.
    borders : (str, str)
        Borders of suburban gardens, left and right: a fence from `roadside.FENCES`, "hedge" or "none". A yard has one
        of `YARD_BORDERS`.
    parking : (bool, bool)
        Whether there are parking bays left and right.
    light : Light
        Sun, sky and exposure.
    density : float
        Density of traffic and pedestrians, 0..1.
    foliage : (float, float, float)
        Factors for red, green and blue of all leaves, which depend on the season.
    """

    road: Road
    start: float
    end: float
    styles: tuple[str, str]
    borders: tuple[str, str]
    parking: tuple[bool, bool]
    light: Light
    density: float
    foliage: tuple[float, float, float]

    def border(self, sign: int) -> str:
        """Return the border of one side. Parameters are those of `Road.side`."""
        return self.borders[0 if sign > 0 else 1]


_SIDES = table_beside(__file__)  # ranges for the roadside of each style


def _side(style: str, lanes: int, lane: float, parking: bool, rng: np.random.Generator) -> Side:
    """Draw one side of the road."""
    edge = lanes * lane + (2.2 if parking else 0.35)
    looks = _SIDES[style]
    strip = rng.uniform(1.4, 2.6) if rng.random() < looks["grass"] else 0.0
    walk = rng.uniform(*looks["sidewalk"])
    if style == "park" and rng.random() < 0.4:
        strip = 0.0
        walk = 0.0
    rise = rng.uniform(*looks["bank"]) if "bank" in looks else 0.0
    return Side(edge, strip, walk, rise, rng.uniform(2.5, 6.0))


def _road(rng: np.random.Generator, length: float, layout: str, lanes: tuple, styles: tuple, parking: tuple) -> Road:
    """Draw the geometry of a street for a drive of `length` metres."""
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
    """Draw crown and grades of a road for a drive of `length` metres, as fields of `Road`.

    Urban roads have a cross fall of about 2 %, grades of up to 6 %, and vertical curves 4 to 12 m long per per cent of
    grade change.
    """
    before, after = (float(grade) for grade in rng.normal(0, 0.025, 2).clip(-0.06, 0.06))
    half = 0.5 * max(10.0, 100 * abs(after - before) * rng.uniform(4.0, 12.0))
    middle = float(rng.uniform(-10, 60) + length)
    ends = {"crest_start": middle - half, "crest_end": middle + half}
    return {"crown": float(rng.uniform(0.015, 0.025)), "grade_before": before, "grade_after": after} | ends


def draw_plan(rng: np.random.Generator, length: float, wishes: Wishes) -> Plan:
    """Draw the plan of a world.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    length : float
        Distance that the recording car drives, metres.
    wishes : Wishes
        The fixed properties.
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
    return Plan(road, -45.0, length + 210.0, styles, borders, parking, light, density, foliage)


_TABLES = table_beside(__file__, "streets")
_STREETS = {name: _TABLES[common] | row for name, (common, row) in _TABLES["streets"].items()}
"""Per street: fields of `Wishes`, and the range of the recording car's mean speed, m/s."""
TEST_STREETS = tuple(_STREETS)
"""The names of ten streets that are hard for occupancy filters, each for its own reason."""
SAMPLE_STREET = Wishes(**_TABLES["sample"], light=Light(**_TABLES["sunny"]))
"""The street of the shipped sample drive: it has one of everything that the course discusses."""


def draw_test_street(name: str, seed: int) -> tuple[np.random.SeedSequence, Wishes]:
    """Return seed and properties of a drive through a test street.

    On streets with a border, the recording car drives at 12 to 14 m/s, 3 to 6 m to the left of the border.

    Parameters
    ----------
    name : str
        One of `TEST_STREETS`.
    seed : int
        Seed for the drive. With the same seed, different names still give different streets.

    Raises
    ------
    ArgumentError
        When there is no such street.
    """
    if name not in _STREETS:
        raise ArgumentError("street", " or ".join(_STREETS), name)
    row = dict(_STREETS[name])
    speeds = row.pop("speeds")
    root = np.random.SeedSequence([seed, *name.encode()])
    speed = float(np.random.default_rng(root.spawn(1)[0]).uniform(*speeds))
    return root, Wishes(**row, speed=speed)

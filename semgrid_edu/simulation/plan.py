"""What a street is to be like: drawn at random, the same for the same seed."""

from dataclasses import dataclass

import numpy as np

from semgrid_edu.simulation.furniture import FENCES
from semgrid_edu.simulation.layout import Road, Side
from semgrid_edu.simulation.light import Light
from semgrid_edu.simulation.terrain import Extent

BORDERS = (*FENCES, "hedge", "none")
"""What may run along the gardens of a suburb."""
STYLES = ("town", "suburb", "park")
"""What lines a side of the road: facades at the sidewalk; houses in gardens; grass banks and trees."""


@dataclass(frozen=True)
class Plan:
    """What a world is to be like, before anything is built.

    Parameters
    ----------
    road : Road
    extent : Extent
    styles : (str, str)
        Left and right side, members of `STYLES`.
    borders : (str, str)
        What runs along the gardens of a suburb, left and right: a fence of `furniture.FENCES`, "hedge" or "none".
    parking : (bool, bool)
        Whether there are parking bays left and right.
    light : Light
    density : float
        0..1: how much traffic and how many people.
    foliage : (float, float, float)
        Tint of all leaves: the season.
    """

    road: Road
    extent: Extent
    styles: tuple[str, str]
    borders: tuple[str, str]
    parking: tuple[bool, bool]
    light: Light
    density: float
    foliage: tuple[float, float, float]


def _side(style: str, lanes: int, lane: float, parking: bool, rng: np.random.Generator) -> Side:
    """Draw one side of the road."""
    edge = lanes * lane + (2.2 if parking else 0.35)
    strip = rng.uniform(1.4, 2.6) if rng.random() < {"town": 0.25, "suburb": 0.5, "park": 0.7}[style] else 0.0
    walk = rng.uniform(*{"town": (2.6, 4.5), "suburb": (1.8, 2.6), "park": (1.6, 2.4)}[style])
    if style == "park" and rng.random() < 0.4:
        strip, walk = 0.0, 0.0
    rise = rng.uniform(0.35, 1.3) if style == "park" else rng.uniform(0.0, 0.25) if style == "suburb" else 0.0
    return Side(edge, strip, walk, rise, rng.uniform(2.5, 6.0))


def draw_plan(rng: np.random.Generator, length: float, **wishes) -> Plan:
    """Draw a world's plan.

    Parameters
    ----------
    rng : numpy.random.Generator
    length : float
        Metres that the ego vehicle drives.
    **wishes
        Fields of `Plan` or of `Road` to set instead of drawing them, `layout` and `lanes` among them.
    """
    layout = wishes.get("layout") or rng.choice(["straight", "bend", "junction"], p=[0.3, 0.3, 0.4])
    lanes = wishes.get("lanes") or [(1, 1), (1, 1), (1, 2), (2, 2)][rng.integers(4)]
    styles = wishes.get("styles") or tuple(map(str, rng.choice(STYLES, 2, p=[0.35, 0.4, 0.25])))
    borders = wishes.get("borders") or tuple(map(str, rng.choice(BORDERS, 2, p=[0.2, 0.16, 0.16, 0.12, 0.24, 0.12])))
    parking = wishes.get("parking") or tuple(bool(p) for p in rng.random(2) < 0.5)
    lane = rng.uniform(3.1, 3.6)
    bend = (
        (rng.uniform(15, 40) + 0.5 * length, rng.choice([-1, 1]) / rng.uniform(75, 220))
        if layout == "bend"
        else (0, 0.0)
    )
    arc = rng.uniform(0.25, 0.9) / abs(bend[1]) if bend[1] else 0.0
    junction = layout == "junction"
    leaves = (True, True) if rng.random() < 0.6 else tuple(rng.permutation([True, False]).tolist())
    road = Road(
        bend_start=float(bend[0]), bend_end=float(bend[0] + arc), curvature=float(bend[1]),
        lane=float(lane), lanes_left=lanes[0], lanes_right=lanes[1],
        left=_side(styles[0], lanes[0], lane, parking[0], rng), right=_side(styles[1], lanes[1], lane, parking[1], rng),
        junction=float(rng.uniform(18, 45) + length) if junction else 0.0,
        side_half=float(rng.uniform(3.0, 4.5)) if junction else 0.0,
        side_left=leaves[0], side_right=leaves[1], corner=float(rng.uniform(3.5, 6.0)),
        zebra=bool(rng.random() < 0.7), dashed=bool(rng.random() < 0.75),
    )  # fmt: skip
    season = rng.choice(3, p=[0.55, 0.3, 0.15])
    foliage = [(1.0, 1.0, 1.0), (1.35, 1.25, 0.9), (2.2, 1.05, 0.7)][season]
    light = wishes.get("light") or Light.random(rng)
    density = wishes.get("density", float(rng.uniform(0.15, 1.0)))
    return Plan(road, Extent(-45.0, length + 210.0), styles, borders, parking, light, density, foliage)

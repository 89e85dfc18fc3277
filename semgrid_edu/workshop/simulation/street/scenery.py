"""The scenery of a street: ground, houses, fences, trees, lamps and signs."""

from functools import partial

import numpy as np

from semgrid_edu.storage.files import named_rows, table_beside
from semgrid_edu.workshop.simulation.street import borders
from semgrid_edu.workshop.simulation.street.builder import Builder
from semgrid_edu.workshop.simulation.street.ground import ground_mesh
from semgrid_edu.workshop.simulation.street.plan import YARD, Plan
from semgrid_edu.workshop.simulation.things import roadside
from semgrid_edu.workshop.simulation.things.buildings import House, build_house
from semgrid_edu.workshop.simulation.things.materials import Kind, Material

_HOUSES = named_rows(table_beside(__file__))


def build_scenery(plan: Plan, rng: np.random.Generator) -> Builder:
    """Build everything static except parked vehicles, and return the builder, ready for road users.

    Parameters
    ----------
    plan : Plan
        The plan of the street.
    rng : numpy.random.Generator
        Source of randomness.
    """
    builder = Builder(plan, rng)
    builder.solid.append((ground_mesh(plan.road, plan.start, plan.end), 0))
    borders.add_junction_signs(builder)
    for sign, style in zip((1, -1), plan.styles, strict=True):
        borders.add_lamps(builder, sign)
        _street_trees(builder, sign)
        _LINE_SIDE[style](builder, sign)
        borders.add_signs(builder, sign)
    _side_street(builder)
    _horizon(builder)
    return builder


def _facing(sign: int) -> float:
    """Return the yaw for a front (-y) that faces the road."""
    return 0.0 if sign > 0 else np.pi


def _meets_side_road(builder: Builder, s0: float, s1: float, sign: int, margin: float) -> bool:
    """Return whether the stretch s0..s1 overlaps the side road and its sidewalks."""
    road = builder.road
    reach = road.side_half + margin
    return road.leaves(sign) and road.junction - reach < s1 and s0 < road.junction + reach


def _tree(builder: Builder, s: float, d: float, species: str | None = None) -> None:
    """Plant a tree; distant trees have fewer leaves."""
    rng = builder.rng
    plan = builder.plan
    species = species or str(rng.choice(roadside.TREES, p=[0.5, 0.15, 0.2, 0.15]))
    far = abs(d) > 35 or s > plan.end - 120
    shape = roadside.tree(species, int(rng.integers(3)), 350 if far else 1500)
    scale = rng.uniform(0.75, 1.25)
    season = (1, 1, 1) if species == "conifer" else plan.foliage
    tint = np.asarray(season) * rng.uniform(0.75, 1.25) * (1 + rng.normal(0, 0.08, 3))
    tinted = shape.tinted(np.where((shape.material == Material.LEAF)[:, None], tint, 1.0))
    if species != "conifer":
        builder.try_post(tinted, s, d, rng.uniform(0, 6.28), Kind.PLANT, 0.22 * scale, scale)
    elif foot := builder.spot(s, d, Kind.PLANT, 1.9 * scale, 2.5 * scale):
        builder.add(tinted, s, d, rng.uniform(0, 6.28), foot, scale)


def _bush(builder: Builder, s: float, d: float) -> None:
    """Plant a bush."""
    rng = builder.rng
    scale = rng.uniform(0.6, 1.3)
    if foot := builder.spot(s, d, Kind.PLANT, 0.95 * scale, 1.2 * scale, top=1.3 * scale):
        shape = roadside.bush(int(rng.integers(3))).tinted(np.asarray(builder.plan.foliage) * rng.uniform(0.7, 1.3))
        builder.add(shape, s, d, rng.uniform(0, 6.28), foot, scale)


def _house(builder: Builder, house: House, s: float, d: float, yaw: float, across_road: bool = False) -> None:
    """Put a house with the middle of its front at (s, d), if the place is free and off the asphalt or `across_road`."""
    half = (house.width / 2, house.depth / 2)
    foot = builder.footprint(s, d, yaw, Kind.BUILDING, half, offset=(0.0, house.depth / 2))
    if (across_road or builder.off_asphalt(foot)) and builder.free(foot, 0.05):
        builder.add(build_house(house), s, d, yaw, foot)


def _draw_house(style: str, rng: np.random.Generator) -> House:
    """Draw a house for a town or a suburb; in a town every second one has a shop."""
    spec = _HOUSES[style]
    seed = int(rng.integers(2**31))
    roof = str(rng.choice(list(spec.roofs), p=list(spec.roofs.values())))
    width = rng.uniform(*spec.width)
    depth = rng.uniform(*spec.depth)
    storeys = int(rng.integers(spec.storeys[0], spec.storeys[1] + 1))
    return House(width, depth, storeys, roof, style == "town" and bool(rng.random() < 0.5), seed)


def _house_row(builder: Builder, sign: int, town: bool) -> None:
    """Line one side with facades at the sidewalk, or with houses in gardens behind fences and hedges."""
    rng = builder.rng
    side = builder.road.side(sign)
    plan = builder.plan
    border = builder.plan.border(sign)
    line = side.strip + side.walk
    setback = rng.uniform(0.0, 0.4) if town else rng.uniform(3.5, 8.0)
    s = plan.start + rng.uniform(0, 8)
    while s < plan.end - 20:
        house = _draw_house("town" if town else "suburb", rng)
        gap = rng.uniform(2.5, 9.0) if not town else 0.02 if rng.random() < 0.75 else rng.uniform(2, 6)
        end = s + house.width + gap
        if not _meets_side_road(builder, s, s + house.width, sign, line + 0.8):
            front = side.edge + line + setback + rng.uniform(0, 1.0) * (not town)
            _house(builder, house, s + house.width / 2, sign * front, _facing(sign))
        if not town:
            border = str(rng.choice([*roadside.FENCES, "hedge"])) if rng.random() < 0.15 else border
            _border(builder, s, end, sign, side.edge + line + 0.35, border)
            _garden(builder, s, end, sign, side.edge + line + 1.2, setback)
        elif gap > 2 and rng.random() < 0.6:
            _tree(builder, s + house.width + gap / 2, sign * (side.edge + line + 3.0))
        s += house.width + gap
    if town or rng.random() < 0.5:
        _tall_houses(builder, sign, side.edge + line + setback + 24, (0, 10), 34.0, 10, 0.7)


def _tall_houses(
    builder: Builder, sign: int, line: float, behind: tuple, step: float, along: float, share: float
) -> None:
    """Scatter town houses `behind` a line along the road, metres, so that gaps show houses instead of nothing."""
    rng = builder.rng
    plan = builder.plan
    for s in np.arange(plan.start, plan.end, step):
        if rng.random() < share:
            house = _draw_house("town", rng)
            s = s + rng.uniform(0, along)
            _house(builder, house, s, sign * (line + rng.uniform(*behind)), _facing(sign))


def _border(builder: Builder, s0: float, s1: float, sign: int, offset: float, style: str) -> None:
    """Build a fence or a hedge from s0 to s1, in pieces that follow bends, with a gap for a gate."""
    if style == "none":
        return
    rng = builder.rng
    margin = offset - builder.road.side(sign).edge
    hedge = style == "hedge"
    step, half, kind = (1.0, 0.42, Kind.PLANT) if hedge else (2.5, 0.08, Kind.FENCE)
    gate = rng.uniform(s0, s1)
    for s in np.arange(s0, s1 - 0.5 * step, step):
        foot = builder.footprint(s, sign * offset, 0, kind, (step / 2, half), offset=(step / 2, 0.0), top=1.4)
        at_gate = abs(s + step / 2 - gate) < 1.3
        if at_gate or _meets_side_road(builder, s, s + step, sign, margin) or not builder.free(foot, -0.05):
            continue
        if hedge:
            piece = roadside.hedge(int(rng.integers(3))).placed((0.5, 0, 0)).tinted(rng.uniform(0.85, 1.15))
        else:
            piece = roadside.fence(style, step)
        builder.add(piece, s, sign * offset, 0.0, foot)


def _garden(builder: Builder, s0: float, s1: float, sign: int, offset: float, depth: float) -> None:
    """Plant the garden between border and house, and beside the house."""
    rng = builder.rng
    for _ in range(rng.integers(1, 4)):
        s = rng.uniform(s0, s1)
        d = sign * (offset + rng.uniform(0.6, max(depth - 1.5, 0.8)))
        (_bush if rng.random() < 0.6 else _tree)(builder, s, d)
    if rng.random() < 0.7:
        _tree(builder, s1 - 1.0, sign * (offset + depth + rng.uniform(2, 12)))


def _park(builder: Builder, sign: int) -> None:
    """Cover one side with trees and bushes on its bank, sometimes with a fence."""
    rng = builder.rng
    plan = builder.plan
    line = builder.road.side(sign).line
    if rng.random() < 0.65:
        style = str(rng.choice(roadside.FENCES, p=[0.2, 0.25, 0.4, 0.15]))
        _border(builder, plan.start, plan.start + 150, sign, line + rng.uniform(0.8, 2.5), style)
    for s in np.arange(plan.start, plan.end, 5.5):
        for _ in range(2):
            offset = line + rng.uniform(1.8, 26)
            (_tree if rng.random() < 0.62 else _bush)(builder, s + rng.uniform(0, 5), sign * offset)
    _tall_houses(builder, sign, line, (30, 40), 60.0, 30, 0.5)


def _yard(builder: Builder, sign: int) -> None:
    """Build a border along one side, and scatter bushes and trees behind it."""
    rng = builder.rng
    plan = builder.plan
    line = builder.road.side(sign).line + 0.35
    borders.YARD_BORDERS[builder.plan.border(sign)](builder, plan.start, plan.end - 60, sign * line)
    borders.add_pillars(builder, plan.start, plan.end - 60, sign * (line - rng.uniform(0.4, 0.8)))
    for s in np.arange(plan.start, plan.end, 6.0):
        _bush(builder, s + rng.uniform(0, 6), sign * (line + rng.uniform(3, 15)))
        _tree(builder, s + rng.uniform(0, 6), sign * (line + rng.uniform(6, 30)))


_LINE_SIDE = {
    "town": partial(_house_row, town=True),
    "suburb": partial(_house_row, town=False),
    "park": _park,
    YARD: _yard,
}
"""The builder of each roadside style: functions of builder and side, 1 for left and -1 for right."""


def _street_trees(builder: Builder, sign: int) -> None:
    """Plant a row of trees of one species in the strip beside the kerb."""
    rng = builder.rng
    side = builder.road.side(sign)
    plan = builder.plan
    if side.strip < 1.2:
        return
    species = str(rng.choice(["broad", "tall", "birch"]))
    step = rng.uniform(8, 15)
    for s in np.arange(plan.start + rng.uniform(0, step), plan.end, step):
        if rng.random() < 0.9:
            _tree(builder, s, sign * (side.edge + 0.55 * side.strip), species)


def _side_street(builder: Builder) -> None:
    """Line both flanks of the side road with houses."""
    road = builder.road
    rng = builder.rng
    for sign, style in zip((1, -1), builder.plan.styles, strict=True):
        if not road.leaves(sign):
            continue
        side = road.side(sign)
        town = style == "town"
        back = road.side_half + side.strip + side.walk + (0.3 if town else rng.uniform(2, 5))
        for flank in (-1, 1):
            d = side.edge + 8
            while d < 70:
                house = _draw_house("town" if town else "suburb", rng)
                place = (road.junction + flank * back, sign * (d + house.width / 2), -flank * np.pi / 2)
                _house(builder, house, *place)
                if rng.random() < 0.5:
                    _tree(builder, road.junction + flank * (back - 1.2), sign * (d + house.width + 1))
                d += house.width + rng.uniform(0.5, 5)


def _horizon(builder: Builder) -> None:
    """Close the horizon with distant trees and houses."""
    rng = builder.rng
    plan = builder.plan
    for _ in range(70):
        s = rng.uniform(plan.start, plan.end + 60)
        d = rng.choice([-1, 1]) * rng.uniform(38, 110)
        _tree(builder, s, d)
    for d in np.arange(-70, 70, 3.5):
        _tree(builder, plan.end - 8 + rng.uniform(-12, 10), d + rng.uniform(-1, 1))
    for d in np.arange(-60, 60, 17):
        s = plan.end - 2 + rng.uniform(0, 8)
        _house(builder, _draw_house("town", rng), s, d + rng.uniform(-4, 4), -np.pi / 2, across_road=True)

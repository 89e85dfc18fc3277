"""The scenery of a planned street: its ground, houses, fences, trees, lamps and signs."""

import numpy as np

from semgrid_edu.workshop.simulation.street.borders import (
    YARD_BORDERS,
    side_of,
    stand_lamps,
    stand_pillars,
    stand_signals,
    stand_signs,
)
from semgrid_edu.workshop.simulation.street.builder import Builder
from semgrid_edu.workshop.simulation.street.footprints import ROUND, outline
from semgrid_edu.workshop.simulation.street.layout import to_road
from semgrid_edu.workshop.simulation.street.plan import YARD, Plan
from semgrid_edu.workshop.simulation.street.terrain import ground_mesh
from semgrid_edu.workshop.simulation.things import furniture, plants
from semgrid_edu.workshop.simulation.things.buildings import House, build_house
from semgrid_edu.workshop.simulation.things.materials import Kind, Material

_TREE_RADIUS = 0.22
_HEDGE_HALF, _FENCE_HALF = 0.42, 0.08


def build_scenery(plan: Plan, rng: np.random.Generator) -> Builder:
    """Build all that never moves, but for parked cars and bicycles.

    Parameters
    ----------
    plan : Plan
        What the street is to be like.
    rng : numpy.random.Generator
        Source of all that is drawn.

    Returns
    -------
    Builder
        The world, ready to take road users.
    """
    builder = Builder(plan.road, rng)
    ground = ground_mesh(plan.road, plan.extent)
    builder.shapes.append(ground)
    builder.instances.append(0)
    stand_signals(builder)
    for sign, style in zip((1, -1), plan.styles, strict=True):
        stand_lamps(builder, plan, sign)
        _street_trees(builder, plan, sign)
        if style == "park":
            _park(builder, plan, sign)
        elif style == YARD:
            _yard(builder, plan, sign)
        else:
            _house_row(builder, plan, sign, style)
        stand_signs(builder, plan, sign)
    if plan.road.side_half:
        _side_street(builder, plan)
    _horizon(builder, plan)
    return builder


def _facing(sign: int) -> float:
    """Return the yaw that turns a front (-y) to the road."""
    return 0.0 if sign > 0 else np.pi


def _junction_gap(builder: Builder, s0: float, s1: float, sign: int, margin: float) -> bool:
    """Return whether the stretch s0..s1 meets the side road and its sidewalks."""
    road = builder.road
    crosses = road.side_left if sign > 0 else road.side_right
    reach = road.side_half + margin
    return bool(road.side_half and crosses and s1 > road.junction - reach and s0 < road.junction + reach)


def _tree(builder: Builder, plan: Plan, s: float, d: float, species: str | None = None) -> None:
    """Plant a tree; far ones have fewer leaves."""
    rng = builder.rng
    species = species or str(rng.choice(plants.TREES, p=[0.5, 0.15, 0.2, 0.15]))
    far = abs(d) > 35 or s > plan.extent.end - 120
    shape = plants.tree(species, int(rng.integers(3)), 350 if far else 1500)
    scale = rng.uniform(0.75, 1.25)
    tint = (
        np.asarray(plan.foliage if species != "conifer" else (1, 1, 1))
        * rng.uniform(0.75, 1.25)
        * (1 + rng.normal(0, 0.08, 3))
    )
    leaf = shape.material == Material.LEAF
    tinted = shape.tinted(np.where(leaf[:, None], tint, 1.0))
    if species == "conifer":
        foot = builder.footprint(s, d, 0, Kind.PLANT, (1.9 * scale, 1.9 * scale), ROUND)
        if builder.edge_distance(s, d) > 2.5 * scale and builder.free(foot):
            builder.add(tinted, s, d, rng.uniform(0, 6.28), scale, [foot])
        return
    builder.try_post(tinted, s, d, rng.uniform(0, 6.28), Kind.PLANT, _TREE_RADIUS * scale, scale)


def _bush(builder: Builder, plan: Plan, s: float, d: float) -> None:
    """Plant a bush."""
    scale = builder.rng.uniform(0.6, 1.3)
    foot = builder.footprint(s, d, 0, Kind.PLANT, (0.95 * scale, 0.95 * scale), ROUND, top=1.3 * scale)
    if builder.edge_distance(s, d) > 1.2 * scale and builder.free(foot):
        shape = plants.bush(int(builder.rng.integers(3))).tinted(
            np.asarray(plan.foliage) * builder.rng.uniform(0.7, 1.3)
        )
        builder.add(shape, s, d, builder.rng.uniform(0, 6.28), scale, [foot])


def _house(builder: Builder, house: House, s: float, d: float, yaw: float, across_road: bool = False) -> None:
    """Put a house with the middle of its front at (s, d) if the place is free; on asphalt only if it may."""
    half = (house.width / 2, house.depth / 2)
    foot = builder.footprint(s, d, yaw, Kind.BUILDING, half, offset=(0.0, house.depth / 2))
    corners = [to_road(builder.road, x, y) for x, y in outline(foot)]
    if not across_road and min(builder.edge_distance(*corner) for corner in corners) < 0.1:
        return
    if builder.free(foot, 0.05):
        builder.add(build_house(house), s, d, yaw, 1.0, [foot])


def _random_house(style: str, rng: np.random.Generator) -> House:
    seed = int(rng.integers(2**31))
    if style == "town":
        roof = str(rng.choice(["flat", "hip", "gable"], p=[0.45, 0.3, 0.25]))
        return House(
            rng.uniform(9, 17), rng.uniform(9, 12), int(rng.integers(2, 6)), roof, bool(rng.random() < 0.5), seed
        )
    roof = str(rng.choice(["gable", "hip", "flat"], p=[0.65, 0.25, 0.1]))
    return House(rng.uniform(8, 12), rng.uniform(7.5, 10.5), int(rng.integers(1, 3)), roof, False, seed)


def _house_row(builder: Builder, plan: Plan, sign: int, style: str) -> None:
    """Line one side with houses; in a suburb with gardens behind fences and hedges."""
    rng, side = builder.rng, side_of(builder, sign)
    line = side.strip + side.walk
    setback = rng.uniform(3.5, 8.0) if style == "suburb" else rng.uniform(0.0, 0.4)
    border = plan.borders[0 if sign > 0 else 1]
    s = plan.extent.start + rng.uniform(0, 8)
    while s < plan.extent.end - 20:
        house = _random_house(style, rng)
        gap = rng.uniform(2.5, 9.0) if style == "suburb" else (0.02 if rng.random() < 0.75 else rng.uniform(2, 6))
        if not _junction_gap(builder, s, s + house.width, sign, line + 0.8):
            middle, front = s + house.width / 2, side.edge + line + setback + rng.uniform(0, 1.0) * (style == "suburb")
            _house(builder, house, middle, sign * front, _facing(sign))
        if style == "suburb":
            if rng.random() < 0.15:
                border = str(rng.choice([*furniture.FENCES, "hedge"]))
            _border(builder, s, s + house.width + gap, sign, side.edge + line + 0.35, border)
            _garden(builder, plan, s, s + house.width + gap, sign, side.edge + line + 1.2, setback)
        elif gap > 2 and rng.random() < 0.6:
            _tree(builder, plan, s + house.width + gap / 2, sign * (side.edge + line + 3.0))
        s += house.width + gap
    if style == "town" or rng.random() < 0.5:
        _second_row(builder, plan, sign, side.edge + line + setback + 24)


def _second_row(builder: Builder, plan: Plan, sign: int, offset: float) -> None:
    """Scatter taller houses behind the first row, so that gaps don't end in nothing."""
    rng = builder.rng
    for s in np.arange(plan.extent.start, plan.extent.end, 34.0):
        if rng.random() < 0.7:
            house = _random_house("town", rng)
            _house(builder, house, s + rng.uniform(0, 10), sign * (offset + rng.uniform(0, 10)), _facing(sign))


def _border(builder: Builder, s0: float, s1: float, sign: int, offset: float, style: str) -> None:
    """Run a fence or a hedge along the road from s0 to s1, in pieces that follow bends; gates stay open."""
    if style == "none":
        return
    step = 1.0 if style == "hedge" else 2.5
    gate = builder.rng.uniform(s0, s1)
    for s in np.arange(s0, s1 - 0.5 * step, step):
        gap = abs(s + step / 2 - gate) < 1.3
        if gap or _junction_gap(builder, s, s + step, sign, offset - side_of(builder, sign).edge):
            continue
        half, kind = (_HEDGE_HALF, Kind.PLANT) if style == "hedge" else (_FENCE_HALF, Kind.FENCE)
        foot = builder.footprint(s, sign * offset, 0, kind, (step / 2, half), offset=(step / 2, 0.0), top=1.4)
        if not builder.free(foot, -0.05):
            continue
        piece = plants.hedge(int(builder.rng.integers(3))) if style == "hedge" else furniture.fence(style, step)
        if style == "hedge":
            piece = piece.placed((0.5, 0, 0)).tinted(builder.rng.uniform(0.85, 1.15))
        builder.add(piece, s, sign * offset, 0.0, 1.0, [foot])


def _garden(builder: Builder, plan: Plan, s0: float, s1: float, sign: int, offset: float, depth: float) -> None:
    """Plant the ground between border and house, and beside the house."""
    rng = builder.rng
    for _ in range(rng.integers(1, 4)):
        s, d = rng.uniform(s0, s1), sign * (offset + rng.uniform(0.6, max(depth - 1.5, 0.8)))
        (_bush if rng.random() < 0.6 else _tree)(builder, plan, s, d)
    if rng.random() < 0.7:
        _tree(builder, plan, s1 - 1.0, sign * (offset + depth + rng.uniform(2, 12)))


def _park(builder: Builder, plan: Plan, sign: int) -> None:
    """Cover one side with trees and bushes on its bank, perhaps a fence along it."""
    rng, side = builder.rng, side_of(builder, sign)
    line = side.edge + side.strip + side.walk
    if rng.random() < 0.65:
        style = str(rng.choice(furniture.FENCES, p=[0.2, 0.25, 0.4, 0.15]))
        _border(builder, plan.extent.start, plan.extent.start + 150, sign, line + rng.uniform(0.8, 2.5), style)
    for s in np.arange(plan.extent.start, plan.extent.end, 5.5):
        for _ in range(2):
            offset = line + rng.uniform(1.8, 26)
            (_tree if rng.random() < 0.62 else _bush)(builder, plan, s + rng.uniform(0, 5), sign * offset)
    for s in np.arange(plan.extent.start, plan.extent.end, 60.0):
        if rng.random() < 0.5:
            house = _random_house("town", rng)
            _house(builder, house, s + rng.uniform(0, 30), sign * (line + rng.uniform(30, 40)), _facing(sign))


def _yard(builder: Builder, plan: Plan, sign: int) -> None:
    """Run a border along one side, and scatter bushes and trees behind it."""
    rng, side = builder.rng, side_of(builder, sign)
    line = side.edge + side.strip + side.walk + 0.35
    border = YARD_BORDERS[plan.borders[0 if sign > 0 else 1]]
    border(builder, plan.extent.start, plan.extent.end - 60, sign * line)
    stand_pillars(builder, plan.extent.start, plan.extent.end - 60, sign * (line - rng.uniform(0.4, 0.8)))
    for s in np.arange(plan.extent.start, plan.extent.end, 6.0):
        _bush(builder, plan, s + rng.uniform(0, 6), sign * (line + rng.uniform(3, 15)))
        _tree(builder, plan, s + rng.uniform(0, 6), sign * (line + rng.uniform(6, 30)))


def _street_trees(builder: Builder, plan: Plan, sign: int) -> None:
    """Plant a row of trees of one species in the strip beside the kerb."""
    rng, side = builder.rng, side_of(builder, sign)
    if side.strip < 1.2:
        return
    species = str(rng.choice(["broad", "tall", "birch"]))
    step = rng.uniform(8, 15)
    for s in np.arange(plan.extent.start + rng.uniform(0, step), plan.extent.end, step):
        if rng.random() < 0.9:
            _tree(builder, plan, s, sign * (side.edge + 0.55 * side.strip), species)


def _side_street(builder: Builder, plan: Plan) -> None:
    """Line the side road with houses on both of its flanks."""
    road, rng = builder.road, builder.rng
    for sign, leaves, style in zip((1, -1), (road.side_left, road.side_right), plan.styles, strict=True):
        if not leaves:
            continue
        side = side_of(builder, sign)
        back = road.side_half + side.strip + side.walk + (rng.uniform(2, 5) if style != "town" else 0.3)
        for flank in (-1, 1):
            d = side.edge + 8
            while d < 70:
                house = _random_house("town" if style == "town" else "suburb", rng)
                yaw = -np.pi / 2 if flank > 0 else np.pi / 2
                _house(builder, house, road.junction + flank * back, sign * (d + house.width / 2), yaw)
                if rng.random() < 0.5:
                    _tree(builder, plan, road.junction + flank * (back - 1.2), sign * (d + house.width + 1))
                d += house.width + rng.uniform(0.5, 5)


def _horizon(builder: Builder, plan: Plan) -> None:
    """Close the view with trees and houses far away."""
    rng, extent = builder.rng, plan.extent
    for _ in range(70):
        s, d = rng.uniform(extent.start, extent.end + 60), rng.choice([-1, 1]) * rng.uniform(38, 110)
        _tree(builder, plan, s, d)
    for d in np.arange(-70, 70, 3.5):
        _tree(builder, plan, extent.end - 8 + rng.uniform(-12, 10), d + rng.uniform(-1, 1))
    for d in np.arange(-60, 60, 17):
        s = extent.end - 2 + rng.uniform(0, 8)
        _house(builder, _random_house("town", rng), s, d + rng.uniform(-4, 4), -np.pi / 2, across_road=True)

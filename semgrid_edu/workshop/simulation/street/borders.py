"""Borders and street furniture along one side of the road.

Borders that are hard for a LIDAR: wire mesh, porous hedges, glass panes, posts, and walls behind gaps. Also street
lamps, traffic signs, and the lights or priority signs of a junction.
"""

from collections.abc import Callable, Iterator

import numpy as np

from semgrid_edu.workshop.simulation.street.builder import Builder
from semgrid_edu.workshop.simulation.things import roadside
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import box, tube

_SIGNS = {"limit": 0.3, "no-entry": 0.2, "parking": 0.25, "warning": 0.15, "direction": 0.1}
"""Relative frequency of each sign."""
_THIN_HALF = 0.08
"""Half-width of the footprint of thin things, metres."""
_PLASTER = (0.62, 0.6, 0.56)
_PLANK = (0.26, 0.16, 0.09)


def add_lamps(builder: Builder, sign: int) -> None:
    """Put a row of street lamps at the kerb; one side in four, at random, has none.

    Parameters
    ----------
    builder : Builder
        Receives the lamps.
    sign : int
        1 for the left side, -1 for the right one.
    """
    rng = builder.rng
    plan = builder.plan
    if rng.random() < 0.25:
        return
    side = builder.road.side(sign)
    step = rng.uniform(22, 34)
    shape = roadside.lamp(float(rng.choice([5.5, 7.5])))
    for s in np.arange(plan.start + rng.uniform(0, step), plan.end, step):
        builder.try_post(shape, s, sign * (side.edge + 0.6), np.pi if sign > 0 else 0.0, Kind.POLE, 0.11)


def add_signs(builder: Builder, sign: int) -> None:
    """Put traffic signs at the kerb, facing the traffic on that side. Parameters are those of `add_lamps`."""
    rng = builder.rng
    plan = builder.plan
    d = sign * (builder.road.side(sign).edge + 0.75)
    yaw = 0.0 if sign < 0 else np.pi
    for s in np.arange(plan.start, plan.end, 16.0):
        if rng.random() < 0.45:
            shape = roadside.sign(str(rng.choice(list(_SIGNS), p=list(_SIGNS.values()))))
            builder.try_post(shape, s + rng.uniform(0, 12), d, yaw + rng.normal(0, 0.08), Kind.SIGN, 0.08)


def add_junction_signs(builder: Builder) -> None:
    """Put traffic lights or priority signs at the corners of the junction, if there is one.

    Parameters
    ----------
    builder : Builder
        Receives them.
    """
    road = builder.road
    rng = builder.rng
    if not road.side_half:
        return
    lights = rng.random() < 0.55
    green = bool(rng.random() < 0.5)
    back = road.side_half + road.corner + 0.4
    for sign, yaw in ((-1, 0.0), (1, np.pi)):
        shape = roadside.traffic_light(green) if lights else roadside.sign("priority")
        builder.try_post(shape, road.junction + sign * back, sign * (road.side(sign).edge + 0.5), yaw, Kind.SIGN, 0.09)
    for sign in filter(road.leaves, (1, -1)):
        shape = roadside.traffic_light(not green) if lights else roadside.sign("stop")
        s = road.junction + sign * (road.side_half + 0.5)
        d = sign * (road.side(sign).edge + road.corner + 0.5)
        builder.try_post(shape, s, d, -sign * np.pi / 2, Kind.SIGN, 0.09)


Piece = tuple[float, float, float, float]
"""A piece of a border: start (s, d), direction relative to the road, rad, and length, metres."""


def _pieces(s0: float, s1: float, d: float, jog: float, step: float, rng: np.random.Generator) -> Iterator[Piece]:
    """Split a line along the road into pieces of about `step`; every 12 to 30 m it shifts sideways by up to `jog`."""
    s = s0
    at = d
    while s < s1:
        run = rng.uniform(12, 30)
        to = d + np.sign(d) * rng.uniform(0, jog)
        for length, aside in ((run, 0.0), (2.5, to - at)):
            whole = float(np.hypot(length, aside))
            yaw = float(np.arctan2(aside, length))
            n = max(round(whole / step), 1)
            for k in range(n):
                yield s + k * length / n, at + k * aside / n, yaw, round(whole / n, 3)
            s = s + length
            at = at + aside


def _claim(builder: Builder, piece: Piece, kind: Kind, half_width: float, top: float) -> bool:
    """Reserve the ground for a piece of a border; return whether it was free and off the asphalt."""
    *place, length = piece
    foot = builder.footprint(*place, kind, (length / 2, half_width), offset=(length / 2, 0.0), top=top)
    fits = builder.off_asphalt(foot) and builder.free(foot, -0.1)
    if fits:
        builder.footprints.append(foot)
    return fits


def _try_fence(builder: Builder, piece: Piece, style: str, opacity: float) -> None:
    """Add a piece of wire mesh or a pane with its frame, if it fits."""
    *place, length = piece
    if _claim(builder, piece, Kind.FENCE, _THIN_HALF, roadside.SHEETS[style].height):
        frame, sheet = roadside.sheet_fence(style, length)
        builder.add_porous(sheet, opacity, *place)
        builder.add(frame, *place)


def _try_wall(builder: Builder, piece: Piece, height: float, *look) -> None:
    """Add a wall, 0.25 m thick, if it fits; `look` is its colour, material and kind."""
    *place, length = piece
    if _claim(builder, piece, look[-1], 0.13, height):
        builder.add(box((length / 2, 0, height / 2 - 0.3), (length, 0.25, height + 0.6), *look), *place)


def wire_mesh(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Build a wire-mesh fence: posts, a rail and a sheet of wire.

    KITTI's drive 0013 passes such a fence. Its posts are 2.5 m apart. It returns 7 % of the beams at 8 m and
    perpendicular incidence, and 60 % at 25 m and grazing incidence. That is an opacity of 0.01 to 0.02 /m.

    Parameters
    ----------
    builder : Builder
        Receives the fence.
    s0, s1 : float
        Start and end along the road, metres.
    d : float
        Distance to the left of the centre line, metres.
    """
    rng = builder.rng
    opacity = rng.uniform(0.008, 0.02)
    step = rng.choice([2.0, 2.5, 3.0])
    for piece in _pieces(s0, s1, d, 2.5, step, rng):
        _try_fence(builder, piece, "wire", opacity)


def twig_hedge(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Build a hedge that beams enter, so that returns come from inside it. Parameters are those of `wire_mesh`.

    The hedges along KITTI's drive 0013 return beams from 0.2 m inside on average. That is an opacity of 5 /m.
    """
    rng = builder.rng
    opacity = rng.uniform(2.0, 6.0)
    thickness = rng.uniform(0.6, 1.2)
    height = rng.uniform(1.4, 2.1)
    for piece in _pieces(s0, s1, d + np.sign(d) * thickness / 2, 0.6, 1.0, rng):
        if rng.random() > 0.04:
            wide = thickness * rng.uniform(0.8, 1.1)
            high = height * rng.uniform(0.9, 1.1)
            dense = opacity * rng.uniform(0.7, 1.4)
            if _claim(builder, piece, Kind.PLANT, wide / 2, high):
                builder.add_porous(roadside.porous_hedge(piece[3], wide, high), dense, *piece[:3])


def mesh_and_hedge(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Build wire mesh with hedges behind it, parallel to it or in rows across. Parameters are those of `wire_mesh`."""
    rng = builder.rng
    sign = np.sign(d)
    wire_mesh(builder, s0, s1, d)
    s = s0
    behind = d + sign * rng.uniform(0.5, 1.5)
    while s < s1:
        run = rng.uniform(15, 30)
        (twig_hedge if rng.random() < 0.5 else _rows)(builder, s, s + run, behind)
        s += run + rng.uniform(0, 15)


def _rows(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Plant hedges perpendicular to the road, one after the other, from `d` outwards."""
    rng = builder.rng
    opacity = rng.uniform(3.0, 6.0)
    height = rng.uniform(1.3, 1.9)
    length = rng.uniform(2.5, 4.0)
    for s in np.arange(s0, s1, rng.uniform(2.8, 4.0)):
        body = roadside.porous_hedge(round(length, 3), 0.7, height * rng.uniform(0.9, 1.1))
        piece = (s, d + np.sign(d) * 1.6, np.sign(d) * np.pi / 2, length)
        if _claim(builder, piece, Kind.PLANT, 0.35, height):
            builder.add_porous(body, opacity, *piece[:3])


def panes(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Build glass panes between thin posts, like a bus shelter. Parameters are those of `wire_mesh`."""
    rng = builder.rng
    opacity = rng.uniform(0.05, 0.15)
    step = rng.uniform(1.3, 2.2)
    for piece in _pieces(s0, s1, d, 0.8, step, rng):
        if rng.random() > 0.1:
            _try_fence(builder, piece, "pane", opacity)


def post_row(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Build a regular row of bare posts. Parameters are those of `wire_mesh`."""
    rng = builder.rng
    step = rng.uniform(1.4, 2.6)
    height = rng.uniform(1.0, 1.8)
    radius = rng.uniform(0.04, 0.09)
    post = roadside.bollard(height, radius)
    for s in np.arange(s0, s1, step):
        builder.try_post(post, s, d, 0.0, Kind.POLE, max(radius, _THIN_HALF))


def walls_behind_gaps(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Build a high wall with gaps, and cross walls behind the gaps. Parameters are those of `wire_mesh`.

    As the recording car passes, the cross walls appear from behind the edges of the gaps.
    """
    rng = builder.rng
    sign = np.sign(d)
    s = s0
    while s < s1:
        run = rng.uniform(4, 10)
        gap = rng.uniform(7, 15)
        _try_wall(builder, (s, d, 0.0, run), 2.2, _PLANK, Material.WOOD, Kind.FENCE)
        start = s + run + rng.uniform(0.3, 1.0) * gap
        yaw = sign * np.pi / 2 + rng.uniform(-0.5, 0.5)
        across = (start, d + sign * rng.uniform(0.5, 2.0), yaw, rng.uniform(5, 11))
        _try_wall(builder, across, rng.uniform(1.9, 3.0), _PLASTER, Material.PLASTER, Kind.BUILDING)
        s += run + gap


def add_pillars(builder: Builder, s0: float, s1: float, d: float) -> None:
    """Put thick pillars, such as overgrown trunks, in front of a border. Parameters are those of `wire_mesh`.

    As the recording car passes, the edge of a pillar's shadow sweeps along the border behind it.
    """
    rng = builder.rng
    s = s0
    while s < s1:
        radius = rng.uniform(0.3, 0.7)
        top = (0, 0, rng.uniform(1.9, 3.5))
        pillar = tube((0, 0, -0.5), top, radius, _PLASTER, Material.MATTE, Kind.POLE, 12)
        builder.try_post(pillar, s, d, 0.0, Kind.POLE, radius)
        s += rng.uniform(10, 30)


YARD_BORDERS: dict[str, Callable[[Builder, float, float, float], None]] = {
    "wire": wire_mesh,
    "wire and hedge": mesh_and_hedge,
    "twigs": twig_hedge,
    "panes": panes,
    "posts": post_row,
    "gaps": walls_behind_gaps,
}
"""The borders of a yard, by name: functions of builder, start, end, and distance from the centre line."""

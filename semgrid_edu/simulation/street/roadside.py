"""What stands at the kerb: street lamps, traffic signs, and the lights or priority signs of a junction."""

import numpy as np

from semgrid_edu.simulation.street.builder import Builder
from semgrid_edu.simulation.street.layout import Side
from semgrid_edu.simulation.street.plan import Plan
from semgrid_edu.simulation.things import furniture
from semgrid_edu.simulation.things.materials import Kind


def side_of(builder: Builder, sign: int) -> Side:
    """Return one side of the road.

    Parameters
    ----------
    builder : Builder
        The world that the road belongs to.
    sign : int
        1 for the left side, -1 for the right one.

    Returns
    -------
    Side
    """
    return builder.road.left if sign > 0 else builder.road.right


def stand_lamps(builder: Builder, plan: Plan, sign: int) -> None:
    """Put a row of street lamps at the kerb; one side in four, drawn by chance, has none.

    Parameters
    ----------
    builder : Builder
        The world that takes them.
    plan : Plan
        How far it reaches.
    sign : int
        1 for the left side, -1 for the right one.
    """
    if builder.rng.random() < 0.25:
        return
    side, step = side_of(builder, sign), builder.rng.uniform(22, 34)
    shape = furniture.lamp(float(builder.rng.choice([5.5, 7.5])))
    for s in np.arange(plan.extent.start + builder.rng.uniform(0, step), plan.extent.end, step):
        builder.try_post(shape, s, sign * (side.edge + 0.6), np.pi if sign > 0 else 0.0, Kind.POLE, 0.11)


def stand_signs(builder: Builder, plan: Plan, sign: int) -> None:
    """Put traffic signs at the kerb, facing the traffic on their side.

    Parameters
    ----------
    builder : Builder
        The world that takes them.
    plan : Plan
        How far it reaches.
    sign : int
        1 for the left side, -1 for the right one.
    """
    rng, side = builder.rng, side_of(builder, sign)
    yaw = 0.0 if sign < 0 else np.pi
    for s in np.arange(plan.extent.start, plan.extent.end, 16.0):
        if rng.random() < 0.45:
            name = str(
                rng.choice(["limit", "no-entry", "parking", "warning", "direction"], p=[0.3, 0.2, 0.25, 0.15, 0.1])
            )
            builder.try_post(
                furniture.sign(name),
                s + rng.uniform(0, 12),
                sign * (side.edge + 0.75),
                yaw + rng.normal(0, 0.08),
                Kind.SIGN,
                0.08,
            )


def stand_signals(builder: Builder) -> None:
    """Put traffic lights, or signs of priority, at the corners of the junction if there is one.

    Parameters
    ----------
    builder : Builder
        The world that takes them.
    """
    road, rng = builder.road, builder.rng
    if not road.side_half:
        return
    lights, green = rng.random() < 0.55, bool(rng.random() < 0.5)
    back = road.side_half + road.corner + 0.4
    for sign, yaw in ((-1, 0.0), (1, np.pi)):
        side = side_of(builder, sign)
        shape = furniture.traffic_light(green) if lights else furniture.sign("priority")
        s = road.junction + sign * back
        builder.try_post(shape, s, sign * (side.edge + 0.5), yaw, Kind.SIGN, 0.09)
    for sign, leaves in ((1, road.side_left), (-1, road.side_right)):
        if leaves:
            shape = furniture.traffic_light(not green) if lights else furniture.sign("stop")
            d = sign * (side_of(builder, sign).edge + road.corner + 0.5)
            builder.try_post(
                shape, road.junction + sign * (road.side_half + 0.5), d, -sign * np.pi / 2, Kind.SIGN, 0.09
            )

"""What the shipped sample drive shows: a street with one of everything that the course speaks of."""

import numpy as np

from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.workshop.simulation.street.road_users import fill_street
from semgrid_edu.workshop.simulation.street.traffic import Traffic
from semgrid_edu.workshop.simulation.street.trajectories import STAND, Pace


def _cast(traffic: Traffic) -> None:
    """Put an overtaking and an oncoming car, a cyclist and pedestrians where the camera sees them, then others."""
    road, ego, end = traffic.road, traffic.ego, traffic.duration
    here = ego.at(end)[0]
    overtaking, oncoming = Pace(ego.pace.mean + 6.0), Pace(9.0)
    red, blue = ("estate", (0.35, 0.02, 0.02)), ("hatchback", (0.05, 0.12, 0.35))
    traffic.drive_car(here + 9.0 - overtaking.distance(end), -0.5 * road.lane, 1, 0, overtaking, red)
    traffic.drive_car(here + 14.0 + oncoming.distance(end), 0.5 * road.lane, -1, 0, oncoming, blue)
    cyclist = Pace(5.0)
    traffic.ride(here + 9.0 - cyclist.distance(end), -(road.lanes_right * road.lane - 0.45), 1, cyclist)
    for sign, side, ahead in ((-1, road.right, 12.0), (1, road.left, 17.0)):
        walk = sign * (side.edge + side.strip + 0.6 * side.walk)
        traffic.walk(here + ahead, walk, sign, 0, Pace(1.4))
        traffic.walk(here + ahead + 9.0, walk, -sign, 0, STAND, 1.0)
    fill_street(traffic)


_SUN = np.array([0.45, 0.62, 0.64]) / np.linalg.norm([0.45, 0.62, 0.64])
_LIGHT = Light(
    sun=tuple(_SUN.tolist()),
    sun_colour=(1.55, 1.46, 1.27),
    sky_colour=(0.17, 0.31, 0.62),
    horizon_colour=(0.66, 0.75, 0.86),
    softness=0.012,
    clouds=0.4,
    haze=0.0012,
    exposure=1.1,
    balance=(1.0, 1.0, 1.0),
    phase=3.0,
)

SAMPLE_WISHES = Wishes(
    layout="bend",
    lanes=(1, 2),
    styles=("suburb", "suburb"),
    borders=("hedge", "planks"),
    parking=(True, False),
    density=0.45,
    speed=8.0,
    ego_lane=1,
    cast=_cast,
    light=_LIGHT,
)
"""What the sample drive shows."""

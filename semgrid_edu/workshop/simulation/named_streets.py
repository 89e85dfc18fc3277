"""Streets with a name: ten that are hard for occupancy filters, each in its own way, and the sample drive's street."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E, Rig
from semgrid_edu.workshop.simulation.street import road_users as casts
from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.street.plan import CROSSING, YARD, Wishes
from semgrid_edu.workshop.simulation.street.traffic import Traffic
from semgrid_edu.workshop.simulation.street.trajectories import STAND, Pace

KITTI_RIG = Rig(lidar=HDL64E, packet_interval=0.01)
"""An HDL-64E at 10 Hz, and poses from packets that come every 10 ms."""
FRAMES = 36
"""Number of frames of a test street, 3.5 s."""


def _yard(border: str) -> tuple[Wishes, tuple[float, float]]:
    """Wish for a border on the right, along which nothing moves, and for a speed of 12 to 14 m/s."""
    borders, styles = ("none", border), ("park", YARD)
    return Wishes("straight", (1, 1), styles, borders, parking=(False, False), cast=casts.park_cars), (12.0, 14.0)


def _town(cast: Callable, lanes: tuple[int, int] = (1, 1), layout: str = "straight") -> Wishes:
    """Wish for road users between houses, with parked cars on both sides; of two lanes ours is the right one."""
    ego_lane = 1 if lanes == (1, 2) else None
    return Wishes(layout, lanes, ("suburb", "town"), parking=(True, True), ego_lane=ego_lane, cast=cast)


_STREETS = {
    "mesh": _yard("wire"),
    "mesh and hedge": _yard("wire and hedge"),
    "hedge": _yard("twigs"),
    "glass": _yard("panes"),
    "posts": _yard("posts"),
    "walls": _yard("gaps"),
    "convoy": (_town(casts.convoys, (1, 2)), (7.0, 11.0)),
    "pedestrians": (_town(casts.pedestrians), (4.0, 10.0)),
    "slow starters": (_town(casts.slow_starters, (1, 2)), (0.0, 8.0)),
    "crossing cars": (_town(casts.crossing_cars, layout=CROSSING), (0.0, 8.0)),
}
"""What is wished for, and the slowest and the fastest mean speed of the recording car, m/s."""
TEST_STREETS = tuple(_STREETS)
"""The names of the test streets."""


def named_street(name: str, seed: int, frames: int = FRAMES, rig: Rig = KITTI_RIG) -> SimulatedDrive:
    """Return a drive through a test street.

    On the streets with a border the recording car drives at 12 to 14 m/s, 3 to 6 m to the left of it.

    Parameters
    ----------
    name : str
        One of `TEST_STREETS`.
    seed : int
        Seed for the drive; streets of different names differ for the same seed.
    frames : int
        Number of frames, ten a second. The street is as long as the distance driven, so with the same seed another
        number gives another street.
    rig : Rig
        The sensors on the recording car.

    Raises
    ------
    ArgumentError
        When there is no such street.
    """
    if name not in _STREETS:
        raise ArgumentError("name", " or ".join(_STREETS), name)
    wishes, speeds = _STREETS[name]
    root = np.random.SeedSequence([seed, *name.encode()])
    speed = np.random.default_rng(root.spawn(1)[0]).uniform(*speeds)
    return SimulatedDrive(root, frames, replace(wishes, speed=float(speed)), rig)


def _sample_cast(traffic: Traffic) -> None:
    """Put an overtaking and an oncoming car, a cyclist and pedestrians where the camera sees them, then others."""
    road, end = traffic.road, traffic.duration
    here = traffic.ends_at
    overtaking, oncoming, cycling = Pace(traffic.ego.pace.mean + 6.0), Pace(9.0), Pace(5.0)
    red, blue = ("estate", (0.35, 0.02, 0.02)), ("hatchback", (0.05, 0.12, 0.35))
    traffic.drive_car(here + 9.0 - overtaking.distance(end), -0.5 * road.lane, 1, 0, overtaking, red)
    traffic.drive_car(here + 14.0 + oncoming.distance(end), 0.5 * road.lane, -1, 0, oncoming, blue)
    traffic.ride(here + 9.0 - cycling.distance(end), -(road.lanes_right * road.lane - 0.45), 1, cycling)
    for sign, ahead in ((-1, 12.0), (1, 17.0)):
        side = road.side(sign)
        walk = sign * (side.edge + side.strip + 0.6 * side.walk)
        traffic.walk(here + ahead, walk, sign, 0, Pace(1.4))
        traffic.walk(here + ahead + 9.0, walk, -sign, 0, STAND, 1.0)
    casts.fill_street(traffic)


_SUN = np.array([0.45, 0.62, 0.64]) / np.linalg.norm([0.45, 0.62, 0.64])
_SUNNY = Light(
    sun=tuple(_SUN.tolist()), sun_colour=(1.55, 1.46, 1.27),
    sky_colour=(0.17, 0.31, 0.62), horizon_colour=(0.66, 0.75, 0.86),
    softness=0.012, clouds=0.4, haze=0.0012, exposure=1.1, balance=(1.0, 1.0, 1.0), phase=3.0,
)  # fmt: skip
SAMPLE_WISHES = Wishes(
    layout="bend", lanes=(1, 2), styles=("suburb", "suburb"), borders=("hedge", "planks"), parking=(True, False),
    density=0.45, speed=8.0, ego_lane=1, cast=_sample_cast, light=_SUNNY,
)  # fmt: skip
"""What the shipped sample drive shows: a street with one of everything that the course speaks of."""

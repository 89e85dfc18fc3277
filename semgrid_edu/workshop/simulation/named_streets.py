"""Named streets on which occupancy filters are tested: each has much of one thing that is hard for them."""

from dataclasses import replace

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E, Rig
from semgrid_edu.workshop.simulation.street import road_users as casts
from semgrid_edu.workshop.simulation.street.plan import CROSSING, YARD, Wishes
from semgrid_edu.workshop.simulation.street.road_users import park_cars

_NONE, _BOTH = (False, False), (True, True)
KITTI_RIG = Rig(lidar=HDL64E, packet_interval=0.01)
"""An HDL-64E at 10 Hz, and poses from packets that come every 10 ms."""
FRAMES = 36
"""Number of frames of a test street, 3.5 s."""


def _yard(border: str, lanes: tuple[int, int] = (1, 1)) -> Wishes:
    """Wish for a border on the right, along which nothing moves."""
    return Wishes(lanes=lanes, styles=("park", YARD), borders=("none", border), parking=_NONE, cast=park_cars)


def _town(cast, lanes: tuple[int, int] = (1, 1), ego_lane: int | None = None, layout: str = "straight") -> Wishes:
    """Wish for road users between houses, with parked cars on both sides."""
    return Wishes(layout=layout, lanes=lanes, styles=("suburb", "town"), parking=_BOTH, ego_lane=ego_lane, cast=cast)


_STREETS = {
    "mesh": (_yard("wire"), (12.0, 14.0)),
    "mesh and hedge": (_yard("wire and hedge"), (12.0, 14.0)),
    "hedge": (_yard("twigs"), (12.0, 14.0)),
    "glass": (_yard("panes"), (12.0, 14.0)),
    "posts": (_yard("posts"), (12.0, 14.0)),
    "walls": (_yard("gaps"), (12.0, 14.0)),
    "convoy": (_town(casts.convoys, (1, 2), 1), (7.0, 11.0)),
    "pedestrians": (_town(casts.pedestrians), (4.0, 10.0)),
    "slow starters": (_town(casts.slow_starters, (1, 2), 1), (0.0, 8.0)),
    "crossing cars": (_town(casts.crossing_cars, layout=CROSSING), (0.0, 8.0)),
}
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
        Number of frames, ten a second. The street is as long as the way driven, so with the same seed another number
        gives another street.
    rig : Rig
        The sensors on the recording car.

    Returns
    -------
    SimulatedDrive

    Raises
    ------
    ArgumentError
        When there is no such street.
    """
    if name not in _STREETS:
        raise ArgumentError("name", " or ".join(_STREETS), name)
    wishes, (low, high) = _STREETS[name]
    root = np.random.SeedSequence([seed, *name.encode()])
    speed, layout = np.random.default_rng(root.spawn(1)[0]).uniform(low, high), wishes.layout or "straight"
    return SimulatedDrive(root, frames, replace(wishes, speed=float(speed), layout=layout), rig)

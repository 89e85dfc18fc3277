"""Named streets: ten that are hard for occupancy filters, each for its own reason, and the sample drive's street."""

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E, Rig
from semgrid_edu.workshop.simulation.street import road_users as casts
from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.workshop.simulation.street.traffic import Traffic
from semgrid_edu.workshop.simulation.street.trajectories import STAND, ActorPace

KITTI_RIG = Rig(lidar=HDL64E, packet_interval=0.01)
"""An HDL-64E at 10 Hz, with a pose packet every 10 ms."""
FRAMES = 36
"""Number of frames of a test street, 3.5 s."""
_TABLES = table_beside(__file__, "streets")
_STREETS = {name: _TABLES[common] | row for name, (common, row) in _TABLES["streets"].items()}
"""Per street: fields of `Wishes`, the name of the cast, and the range of the recording car's mean speed, m/s."""
TEST_STREETS = tuple(_STREETS)
"""The names of the test streets."""


def wishes_of(row: dict) -> Wishes:
    """Return a table row as `Wishes`.

    Parameters
    ----------
    row : dict
        Fields of `Wishes`. The field `cast` is the name of a function in `street/road_users.py`.
    """
    return Wishes(**row | ({"cast": getattr(casts, row["cast"])} if "cast" in row else {}))


def named_street(name: str, seed: int, frames: int = FRAMES, rig: Rig = KITTI_RIG) -> SimulatedDrive:
    """Return a drive through a test street.

    On streets with a border, the recording car drives at 12 to 14 m/s, 3 to 6 m to the left of the border.

    Parameters
    ----------
    name : str
        One of `TEST_STREETS`.
    seed : int
        Seed for the drive. With the same seed, different names still give different streets.
    frames : int
        Number of frames, ten a second. The street is as long as the distance driven, so changing the number of frames
        changes the street, even with the same seed.
    rig : Rig
        The sensors on the recording car.

    Raises
    ------
    ArgumentError
        When there is no such street.
    """
    if name not in _STREETS:
        raise ArgumentError("name", " or ".join(_STREETS), name)
    row = dict(_STREETS[name])
    speeds = row.pop("speeds")
    root = np.random.SeedSequence([seed, *name.encode()])
    speed = np.random.default_rng(root.spawn(1)[0]).uniform(*speeds)
    return SimulatedDrive(root, frames, wishes_of(row | {"speed": float(speed)}), rig)


def _sample_cast(traffic: Traffic) -> None:
    """Put an overtaking and an oncoming car, a cyclist and pedestrians in view of the camera, then fill the street."""
    road = traffic.road
    end = traffic.duration
    here = traffic.ends_at
    overtaking = ActorPace(traffic.ego.pace.mean + 6.0)
    oncoming = ActorPace(9.0)
    cycling = ActorPace(5.0)
    red, blue = ("estate", (0.35, 0.02, 0.02)), ("hatchback", (0.05, 0.12, 0.35))
    traffic.drive_car(here + 9.0 - overtaking.distance(end), -0.5 * road.lane, 1, 0, overtaking, red)
    traffic.drive_car(here + 14.0 + oncoming.distance(end), 0.5 * road.lane, -1, 0, oncoming, blue)
    traffic.ride(here + 9.0 - cycling.distance(end), -(road.lanes_right * road.lane - 0.45), 1, cycling)
    for sign, ahead in ((-1, 12.0), (1, 17.0)):
        side = road.side(sign)
        walk = sign * (side.edge + side.strip + 0.6 * side.walk)
        traffic.walk(here + ahead, walk, sign, 0, ActorPace(1.4))
        traffic.walk(here + ahead + 9.0, walk, -sign, 0, STAND, 1.0)
    casts.fill_street(traffic)


SAMPLE_WISHES = Wishes(**_TABLES["sample"], cast=_sample_cast, light=Light(**_TABLES["sunny"]))
"""The street of the shipped sample drive: it has one of everything that the course discusses."""

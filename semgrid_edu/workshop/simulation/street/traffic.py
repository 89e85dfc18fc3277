"""Traffic: cars, cyclists and pedestrians, added to a drive only if they don't collide with anything."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.workshop.simulation.street import footprints
from semgrid_edu.workshop.simulation.street.builder import OVERHEAD, Builder
from semgrid_edu.workshop.simulation.street.ground import on_wheels
from semgrid_edu.workshop.simulation.street.layout import Road
from semgrid_edu.workshop.simulation.street.trajectories import ActorPace, Trajectory
from semgrid_edu.workshop.simulation.things.cars_and_people import (
    BODIES,
    PAINTS,
    Person,
    bicycle,
    car,
    car_size,
    rider,
    walker,
)
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import Shape

Look = tuple[str, tuple[float, float, float]] | Person
MOVING_SPEED = 0.05
"""Speed, m/s, above which an actor counts as moving."""
_EGO_SIZE = (4.5, 1.85, 1.5)
"""Length, width and height of the recording car, metres; its sensors don't see it."""


@dataclass(frozen=True)
class Actor:
    """A car, a cyclist, a pedestrian or a parked bicycle.

    Parameters
    ----------
    instance : int
        Its number in the world.
    kind : Kind
        Its kind; a cyclist is a `Kind.BICYCLE`.
    trajectory : Trajectory
        Its position over time.
    look : (str, (float, float, float)) or Person
        Body and paint of a car ("bicycle" for a parked bicycle); for a pedestrian or a cyclist, the person.
    phase : float
        Offset of the distance travelled, metres, so that people don't walk in step.
    overturned : bool
        Whether it is upside down, like a car after an accident.
    """

    instance: int
    kind: Kind
    trajectory: Trajectory
    look: Look
    phase: float = 0.0
    overturned: bool = False

    @property
    def size(self) -> tuple[float, float, float]:
        """Length, width and height, metres."""
        if isinstance(self.look, Person):
            return (0.7, 0.6, self.look.height) if self.kind == Kind.PEDESTRIAN else (1.78, 0.6, 1.8)
        model = self.look[0]
        return (1.78, 0.4, 1.05) if model == "bicycle" else car_size(model)

    def shape(self, road: Road, t: float) -> Shape:
        """Return its shape in the world at one instant.

        Parameters
        ----------
        road : Road
            The street.
        t : float
            Time, seconds.
        """
        travelled = self.phase + self.trajectory.pace.distance(t)
        if isinstance(self.look, Person):
            body = (walker if self.kind == Kind.PEDESTRIAN else rider)(self.look, travelled)
        else:
            model, paint = self.look
            body = (bicycle() if model == "bicycle" else car(model)).recoloured(Material.PAINT, paint)
        if self.overturned:
            body = body.overturned(self.size[2])
        (x, y, z), yaw = self.trajectory.pose(road, t)
        if self.kind == Kind.PEDESTRIAN:
            return body.placed((x, y, z), yaw)
        s, d = self.trajectory.at(t)
        height, roll, pitch = on_wheels(road, s, d, yaw, 0.6 * self.size[0], 0.8 * self.size[1])
        return body.placed((x, y, height), yaw, tilt=(roll if self.kind == Kind.CAR else 0.0, pitch))

    def footprint(self, road: Road, t: float) -> footprints.Footprint:
        """Return the ground that it covers at one instant. Parameters are those of `Actor.shape`."""
        return _footprint(self.kind, self.size, self.instance, *self.trajectory.pose(road, t))

    def middle(self, road: Road, t: float) -> NDArray[np.float64]:
        """Return the centre of its box in the world, (3,), metres. Parameters are those of `Actor.shape`."""
        return np.add(self.trajectory.pose(road, t)[0], (0, 0, self.size[2] / 2))

    def described(self, road: Road, t: float, T_grid_from_world: NDArray) -> dict[str, object]:
        """Describe it at one instant, in the format of the label files.

        Parameters not named here are those of `Actor.shape`.

        Parameters
        ----------
        T_grid_from_world : (4, 4) float
            Pose of the world in the grid frame at that instant, metres.

        Returns
        -------
        dict
            "id" and "class"; "centre" (x, y, z) and "size" (length, width, height) of its box, metres; "yaw", rad;
            "velocity" (x, y) over ground, m/s; and whether it is "moving". All are in the grid frame. The key
            "overturned" exists only if it is true.
        """
        yaw = self.trajectory.pose(road, t)[1]
        velocity = T_grid_from_world[:3, :2] @ self.trajectory.velocity(road, t)
        heading = T_grid_from_world[:3, :2] @ [np.cos(yaw), np.sin(yaw)]
        return {
            "id": self.instance,
            "class": self.kind.name.lower(),
            "centre": _rounded(transform_points(T_grid_from_world, self.middle(road, t))),
            "size": _rounded(self.size),
            "yaw": round(float(np.arctan2(heading[1], heading[0])), 4),
            "velocity": _rounded(velocity[:2]),
            "moving": bool(np.hypot(*velocity[:2]) > MOVING_SPEED),
            **({"overturned": True} if self.overturned else {}),
        }


def _footprint(kind: Kind, size: tuple, instance: int, position: NDArray, yaw: float) -> footprints.Footprint:
    """Return the ground that a road user covers."""
    exponent = {Kind.CAR: footprints.ROUNDED, Kind.PEDESTRIAN: footprints.ROUND}.get(kind, footprints.SQUARE)
    length, width, height = size
    x, y, _ = position
    return footprints.Footprint(x, y, length / 2, width / 2, yaw, exponent, int(kind), instance, min(height, OVERHEAD))


def _rounded(values: ArrayLike) -> list[float]:
    return [round(float(x), 3) for x in values]


class Traffic:
    """The actors of a drive.

    No actor collides with another, with the scenery or with the recording car. This is checked at 25 instants of the
    drive, or at 6 if it is shorter than 2 s.

    Parameters
    ----------
    builder : Builder
        The world with its scenery; receives parked cars and bicycles.
    ego : Trajectory
        Trajectory of the recording car.
    duration : float
        Duration of the drive, seconds.

    Attributes
    ----------
    moving, parked : list of Actor
        The actors so far. `moving` includes pedestrians who stand still.
    ends_at : float
        Position of the recording car at the end of the drive: s, metres.
    """

    def __init__(self, builder: Builder, ego: Trajectory, duration: float) -> None:
        self.builder = builder
        self.ego = ego
        self.duration = duration
        self.plan = builder.plan
        self.rng = builder.rng
        self.road = builder.road
        self.ends_at = ego.at(duration)[0]
        self.moving: list[Actor] = []
        self.parked: list[Actor] = []
        self._times = np.linspace(0, duration, 6 if duration < 2 else 25)
        self._others = [[_footprint(Kind.CAR, _EGO_SIZE, 0, *ego.pose(self.road, t))] for t in self._times]
        self._static = footprints.footprint_table(builder.footprints)

    def add(self, kind: Kind, trajectory: Trajectory, look: Look, margin: float = 0.25) -> bool:
        """Add a road user, unless it would collide with something; return whether it was added.

        Parameters
        ----------
        kind : Kind
            Its kind.
        trajectory : Trajectory
            Its position over time.
        look : (str, (float, float, float)) or Person
            As for `Actor`.
        margin : float
            Minimum distance to other road users, metres.
        """
        actor = Actor(self._next_instance(), kind, trajectory, look, float(self.rng.uniform(0, 3)))
        feet = [actor.footprint(self.road, t) for t in self._times]
        pairs = list(zip(feet, self._others, strict=True))
        collides = footprints.collides
        if any(collides(foot, others, margin) or collides(foot, self._static, 0.05) for foot, others in pairs):
            return False
        self.moving.append(actor)
        for foot, others in pairs:
            others.append(foot)
        return True

    def park(self, kind: Kind, trajectory: Trajectory, look: Look, overturned: bool = False) -> bool:
        """Park a car or a bicycle for the whole drive, unless the place is taken; return whether it was added.

        Parameters not named here are those of `Traffic.add`.

        Parameters
        ----------
        trajectory : Trajectory
            Its place, with the pace `STANDSTILL`.
        overturned : bool
            Whether it is upside down.
        """
        actor = Actor(self._next_instance(), kind, trajectory, look, overturned=overturned)
        foot = actor.footprint(self.road, 0.0)
        collides = footprints.collides
        if collides(foot, self._static, 0.1) or any(collides(foot, others, 0.2) for others in self._others):
            return False
        self.parked.append(actor)
        self.builder.solid.append((actor.shape(self.road, 0.0), actor.instance))
        self.builder.footprints.append(foot)
        self._static = footprints.footprint_table(self.builder.footprints)
        return True

    def _next_instance(self) -> int:
        return 1 + len(self.moving) + len(self.parked)

    def paint(self) -> tuple[float, float, float]:
        """Draw the paint of a car, (3,) linear albedo; common colours are more likely."""
        weights = 1 / (3.0 + np.arange(len(PAINTS)))
        return PAINTS[self.rng.choice(len(PAINTS), p=weights / weights.sum())]

    def body(self) -> str:
        """Draw a car body, one of `BODIES`."""
        return str(self.rng.choice(BODIES, p=[0.32, 0.22, 0.2, 0.16, 0.1]))

    def drive_car(
        self, s: float, d: float, along: float, across: float, pace: ActorPace, look: Look | None = None
    ) -> bool:
        """Add a driving car, unless it would collide with something; return whether it was added.

        Parameters
        ----------
        s, d : float
            Position at t = 0: distance along the road and to the left of its centre line, metres.
        along, across : float
            Direction in (s, d), as in `Trajectory`.
        pace : ActorPace
            Its speed over time; `STANDSTILL` for a car that doesn't move.
        look : (str, (float, float, float)), optional
            Body and paint; random by default.
        """
        look = look or (self.body(), self.paint())
        return self.add(Kind.CAR, Trajectory(s, d, along, across, pace), look, 0.3)

    def walk(self, s: float, d: float, along: float, across: float, pace: ActorPace, turn: float = 0.0) -> bool:
        """Add a walking or standing person, unless they would collide; return whether they were added.

        Parameters not named here are those of `Traffic.drive_car`.

        Parameters
        ----------
        turn : float
            Angle between this direction and the direction that the person faces, rad.
        """
        return self.add(Kind.PEDESTRIAN, Trajectory(s, d, along, across, pace, turn), Person.random(self.rng))

    def ride(self, s: float, d: float, along: float, pace: ActorPace) -> bool:
        """Add a cyclist who rides along the road, unless they would collide; return whether they were added.

        Parameters are those of `Traffic.drive_car`.
        """
        return self.add(Kind.BICYCLE, Trajectory(s, d, along, 0.0, pace), Person.random(self.rng))

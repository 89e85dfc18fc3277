"""Cars, cyclists and pedestrians: who is on the street, where, and how fast; nobody runs into anybody."""

from dataclasses import dataclass

import numpy as np

from semgrid_edu.simulation.street.builder import Builder
from semgrid_edu.simulation.street.footprints import ROUND, ROUNDED, SQUARE, Footprint, collides, footprint_table
from semgrid_edu.simulation.street.layout import Road
from semgrid_edu.simulation.street.plan import Plan
from semgrid_edu.simulation.street.trajectories import Pace, Trajectory
from semgrid_edu.simulation.things.bicycles import bicycle
from semgrid_edu.simulation.things.cars import BODIES, PAINTS, car, car_size
from semgrid_edu.simulation.things.materials import Kind, Material
from semgrid_edu.simulation.things.people import Person, rider, walker
from semgrid_edu.simulation.things.shapes import Shape

EGO_SIZE = (4.5, 1.85, 1.5)
"""Length, width and height of the recording car, metres; no sensor sees it."""


@dataclass(frozen=True)
class Actor:
    """A car, a cyclist, a pedestrian or a parked bicycle.

    Parameters
    ----------
    instance : int
        Its number in the world.
    kind : Kind
    size : (float, float, float)
        Length, width and height, metres.
    trajectory : Trajectory
    look : (str, tuple) or Person
        Body and paint of a car or a bicycle; who walks or rides.
    phase : float
        Metres added to the distance covered, so that not all walk in step.
    """

    instance: int
    kind: Kind
    size: tuple[float, float, float]
    trajectory: Trajectory
    look: object
    phase: float = 0.0

    def shape(self, road: Road, t: float) -> Shape:
        """Return its shape where it is at t seconds."""
        position, yaw = self.trajectory.pose(road, t)
        way = self.phase + self.trajectory.pace.distance(t)
        if isinstance(self.look, Person):
            body = walker(self.look, way) if self.kind == Kind.PEDESTRIAN else rider(self.look, way)
        else:
            model, paint = self.look
            body = (bicycle() if model == "bicycle" else car(model)).recoloured(Material.PAINT, paint)
        return body.placed(position, yaw)

    def footprint(self, road: Road, t: float) -> Footprint:
        """Return what it covers at t seconds."""
        position, yaw = self.trajectory.pose(road, t)
        exponent = {Kind.CAR: ROUNDED, Kind.PEDESTRIAN: ROUND}.get(self.kind, SQUARE)
        length, width, height = self.size
        return Footprint(
            position[0],
            position[1],
            length / 2,
            width / 2,
            yaw,
            exponent,
            int(self.kind),
            self.instance,
            min(height, 2.5),
        )


class Traffic:
    """Actors that never collide, with each other, with the scenery or with the recording car.

    Parameters
    ----------
    builder : Builder
        The scenery; parked cars and bicycles are added to it.
    plan : Plan
    ego : Trajectory
        Way of the recording car.
    duration : float
        Seconds that the drive lasts.
    """

    def __init__(self, builder: Builder, plan: Plan, ego: Trajectory, duration: float) -> None:
        self.builder, self.plan, self.ego, self.duration = builder, plan, ego, duration
        self.rng, self.road = builder.rng, plan.road
        self.moving: list[Actor] = []
        self.parked: list[Actor] = []
        self._times = np.linspace(0, duration, 6 if duration < 2 else 25)
        ego_actor = Actor(0, Kind.CAR, EGO_SIZE, ego, ("sedan", PAINTS[0]))
        self._taken = [[ego_actor.footprint(self.road, t)] for t in self._times]
        self._static = footprint_table(builder.footprints)

    def add(self, kind: Kind, size: tuple, trajectory: Trajectory, look: object, margin: float = 0.25) -> bool:
        """Let somebody take part, unless the way is blocked at any time."""
        actor = Actor(self.builder.next_instance, kind, size, trajectory, look, float(self.rng.uniform(0, 3)))
        feet = [actor.footprint(self.road, t) for t in self._times]
        for foot, taken in zip(feet, self._taken, strict=True):
            if collides(foot, footprint_table(taken), margin) or collides(foot, self._static, 0.05):
                return False
        self.builder.number()
        self.moving.append(actor)
        for foot, taken in zip(feet, self._taken, strict=True):
            taken.append(foot)
        return True

    def park(self, kind: Kind, size: tuple, trajectory: Trajectory, look: object) -> bool:
        """Stand something that never moves beside the road."""
        actor = Actor(self.builder.next_instance, kind, size, trajectory, look)
        foot = actor.footprint(self.road, 0.0)
        if collides(foot, self._static, 0.1) or any(
            collides(foot, footprint_table(taken), 0.2) for taken in self._taken
        ):
            return False
        self.builder.number()
        self.parked.append(actor)
        self.builder.shapes.append(actor.shape(self.road, 0.0))
        self.builder.instances.append(actor.instance)
        self.builder.footprints.append(foot)
        self._static = footprint_table(self.builder.footprints)
        return True

    def paint(self) -> tuple[float, float, float]:
        """Draw a colour of car paint, the usual ones more often."""
        weights = 1 / (3.0 + np.arange(len(PAINTS)))
        return PAINTS[self.rng.choice(len(PAINTS), p=weights / weights.sum())]

    def body(self) -> str:
        """Draw a car body."""
        return str(self.rng.choice(BODIES, p=[0.32, 0.22, 0.2, 0.16, 0.1]))

    def drive_car(self, s: float, d: float, along: float, across: float, pace: Pace, **look) -> bool:
        """Let a car drive."""
        body = look.get("body") or self.body()
        return self.add(
            Kind.CAR,
            car_size(body),
            Trajectory(s, d, along, across, pace),
            (body, look.get("paint") or self.paint()),
            0.3,
        )

    def walk(self, s: float, d: float, along: float, across: float, pace: Pace, turn: float = 0.0) -> bool:
        """Let somebody walk, or stand at pace 0."""
        person = Person.random(self.rng)
        return self.add(Kind.PEDESTRIAN, (0.7, 0.6, person.height), Trajectory(s, d, along, across, pace, turn), person)

    def ride(self, s: float, d: float, along: float, pace: Pace) -> bool:
        """Let somebody ride a bicycle."""
        return self.add(Kind.BICYCLE, (1.78, 0.6, 1.8), Trajectory(s, d, along, 0.0, pace), Person.random(self.rng))

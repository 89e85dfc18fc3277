"""The actors of a street: what a car, a cyclist or a pedestrian looks like and covers, at every instant."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.camera import transform_points
from semgrid_edu.workshop.simulation.street.footprints import ROUND, ROUNDED, SQUARE, Footprint
from semgrid_edu.workshop.simulation.street.layout import Road
from semgrid_edu.workshop.simulation.street.trajectories import Trajectory
from semgrid_edu.workshop.simulation.things.cars import car
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.people import Person, bicycle, rider, walker
from semgrid_edu.workshop.simulation.things.shapes import Shape

Size = tuple[float, float, float]
Look = tuple[str, tuple[float, float, float]] | Person
MOVING_SPEED = 0.05
"""Speed, m/s, above which something is said to move."""


@dataclass(frozen=True)
class Actor:
    """A car, a cyclist, a pedestrian or a parked bicycle.

    Parameters
    ----------
    instance : int
        Its number in the world.
    kind : Kind
        What it is; a cyclist is a `Kind.BICYCLE`.
    size : (float, float, float)
        Length, width and height, metres.
    trajectory : Trajectory
        Where it is at every instant.
    look : (str, (float, float, float)) or Person
        The body of a car ("bicycle" for a parked bicycle) and its paint; for a pedestrian or a cyclist, the person.
    phase : float
        Distance added to the one covered, metres, so that people don't walk in step.
    overturned : bool
        Whether it lies on its top, as a car may after an accident.
    """

    instance: int
    kind: Kind
    size: Size
    trajectory: Trajectory
    look: Look
    phase: float = 0.0
    overturned: bool = False

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
        return body.placed(*self.trajectory.pose(road, t))

    def footprint(self, road: Road, t: float) -> Footprint:
        """Return the ground that it covers at one instant. Parameters are those of `Actor.shape`."""
        (x, y, _), yaw = self.trajectory.pose(road, t)
        exponent = {Kind.CAR: ROUNDED, Kind.PEDESTRIAN: ROUND}.get(self.kind, SQUARE)
        length, width, height = self.size
        half, top = (length / 2, width / 2), min(height, 2.5)
        return Footprint(x, y, *half, yaw, exponent, int(self.kind), self.instance, top)

    def middle(self, road: Road, t: float) -> NDArray[np.float64]:
        """Return the middle of its box in the world, (3,), metres. Parameters are those of `Actor.shape`."""
        return np.add(self.trajectory.pose(road, t)[0], (0, 0, self.size[2] / 2))

    def described(self, road: Road, t: float, T_grid_from_world: NDArray) -> dict[str, object]:
        """Describe it at one instant, as a file of labels holds it.

        Parameters not named here are those of `Actor.shape`.

        Parameters
        ----------
        T_grid_from_world : (4, 4) float
            Pose of the world in the grid frame at that instant, metres.

        Returns
        -------
        dict
            "id" and "class"; "centre" (x, y, z) and "size" (length, width, height) of its box, metres; "yaw", rad;
            "velocity" (x, y) over ground, m/s; and whether it is "moving". All are in the grid frame. "overturned" is
            there only if it is true.
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


def _rounded(values: ArrayLike) -> list[float]:
    return [round(float(x), 3) for x in values]

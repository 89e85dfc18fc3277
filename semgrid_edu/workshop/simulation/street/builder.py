"""The builder of a world: adds objects beside the road one by one, and rejects places that are taken."""

import numpy as np

from semgrid_edu.workshop.simulation.street.footprints import ROUND, SQUARE, Footprint, collides, outline
from semgrid_edu.workshop.simulation.street.ground import on_ground
from semgrid_edu.workshop.simulation.street.layout import outside_asphalt, to_road
from semgrid_edu.workshop.simulation.street.plan import Plan
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.simulation.things.shapes import Shape

OVERHEAD = 2.5
"""Height above the ground, metres. Anything higher doesn't occupy a cell, because the car can drive under it."""
THIN = 0.072
"""Minimum half-width of a footprint, metres: at any rotation it covers the centre of a 0.1 m cell."""


class Builder:
    """A world under construction.

    Parameters
    ----------
    plan : Plan
        The plan of the street.
    rng : numpy.random.Generator
        Source of randomness.

    Attributes
    ----------
    solid : list of (Shape, int)
        The solid objects so far, in world coordinates, each with its object number; 0 for scenery.
    porous : list of (Shape, float)
        The porous objects, each with its opacity as in `PorousMesh`.
    footprints : list of Footprint
        The occupied ground.
    """

    def __init__(self, plan: Plan, rng: np.random.Generator) -> None:
        self.plan = plan
        self.road = plan.road
        self.rng = rng
        self.solid: list[tuple[Shape, int]] = []
        self.porous: list[tuple[Shape, float]] = []
        self.footprints: list[Footprint] = []

    def place(self, s: float, d: float, yaw: float = 0.0) -> tuple[np.ndarray, float]:
        """Return an object's pose in the world: its point on the ground, (3,), metres, and its direction, rad.

        Parameters
        ----------
        s, d : float
            Distance along the road and to the left of its centre line, metres.
        yaw : float
            Direction of the object relative to the road, rad, counter-clockwise.
        """
        position, heading = on_ground(self.road, s, d)
        return position, heading + yaw

    def footprint(
        self, s: float, d: float, yaw: float, kind: Kind, half: tuple[float, float],
        exponent: float = SQUARE, offset: tuple[float, float] = (0.0, 0.0), top: float = OVERHEAD,
    ) -> Footprint:  # fmt: skip
        """Return the footprint of a piece of scenery. Parameters not named here are those of `Builder.place`.

        Parameters
        ----------
        kind : Kind
            Kind of the object.
        half : (float, float)
            Half the length and half the width, metres; at least `THIN`.
        exponent : float
            Shape of the outline: `ROUND`, `ROUNDED` or `SQUARE`.
        offset : (float, float)
            Offset of the centre from the origin: ahead and to the left, metres.
        top : float
            Height of the object, metres.
        """
        position, angle = self.place(s, d, yaw)
        c = np.cos(angle)
        n = np.sin(angle)
        x = position[0] + c * offset[0] - n * offset[1]
        y = position[1] + n * offset[0] + c * offset[1]
        sides = [max(h, THIN) for h in half]
        return Footprint(x, y, *sides, angle, exponent, int(kind), 0, min(top, OVERHEAD))

    def free(self, footprint: Footprint, margin: float = 0.1) -> bool:
        """Return whether a place is free.

        Parameters
        ----------
        footprint : Footprint
            The place.
        margin : float
            Minimum distance to everything else, metres; a negative one allows some overlap.
        """
        return not collides(footprint, self.footprints, margin)

    def off_asphalt(self, footprint: Footprint) -> bool:
        """Return whether the whole footprint is more than 0.1 m off the asphalt.

        Parameters
        ----------
        footprint : Footprint
            The place.
        """
        return min(outside_asphalt(self.road, *to_road(self.road, x, y)) for x, y in outline(footprint)) > 0.1

    def spot(
        self, s: float, d: float, kind: Kind, radius: float, clear: float, yaw: float = 0.0, top: float = OVERHEAD
    ) -> Footprint | None:
        """Return a round footprint, or None if its place is taken or too close to the asphalt.

        Parameters not named here are those of `Builder.footprint` and `Builder.place`.

        Parameters
        ----------
        s, d : float
            Its centre: distance along the road and to the left of the centre line, metres.
        yaw : float
            Direction of the object relative to the road, rad.
        radius : float
            Its radius, metres.
        clear : float
            Minimum distance of its centre from the asphalt, metres.
        """
        foot = self.footprint(s, d, yaw, kind, (radius, radius), ROUND, top=top)
        return foot if outside_asphalt(self.road, s, d) > clear and self.free(foot) else None

    def add(self, shape: Shape, s: float, d: float, yaw: float, foot: Footprint | None = None, scale=1.0) -> None:
        """Add a piece of scenery. Parameters not named here are those of `Builder.place`.

        Parameters
        ----------
        shape : Shape
            Its shape in local coordinates.
        foot : Footprint, optional
            The ground that it occupies.
        scale : float
            Scale factor.
        """
        self.solid.append((shape.placed(*self.place(s, d, yaw), scale), 0))
        if foot:
            self.footprints.append(foot)

    def add_porous(self, shape: Shape, opacity: float, s: float, d: float, yaw: float) -> None:
        """Add a porous object.

        Parameters not named here are those of `Builder.place`.

        Parameters
        ----------
        shape : Shape
            Its shape in local coordinates, made of `Material.WIRE`, `Material.PANE` or `Material.TWIGS`.
        opacity : float
            As in `PorousMesh`.
        """
        self.porous.append((shape.placed(*self.place(s, d, yaw)), opacity))

    def try_post(self, shape: Shape, s: float, d: float, yaw: float, kind: Kind, radius: float, scale=1.0) -> None:
        """Add an object with a round foot, unless the place is on asphalt or taken.

        Parameters not named here are those of `Builder.add` and `Builder.place`.

        Parameters
        ----------
        s, d : float
            Position of the foot: distance along the road and to the left of the centre line, metres.
        yaw : float
            Direction relative to the road, rad.
        kind : Kind
            Kind of the object.
        radius : float
            Radius of the foot, metres.
        """
        if foot := self.spot(s, d, kind, radius, radius + 0.15, yaw):
            self.add(shape, s, d, yaw, foot, scale)

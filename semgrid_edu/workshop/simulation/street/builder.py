"""The builder of a world: puts things beside the road, one by one, and refuses places that are taken."""

import numpy as np

from semgrid_edu.workshop.simulation.street.footprints import ROUND, SQUARE, Footprint, collides, outline
from semgrid_edu.workshop.simulation.street.ground import on_ground
from semgrid_edu.workshop.simulation.street.layout import outside_asphalt, to_road
from semgrid_edu.workshop.simulation.street.plan import Plan
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.simulation.things.shapes import Shape

OVERHEAD = 2.5
"""Height above the ground, metres. Higher things don't occupy their cell, because the recording car passes below."""
THIN = 0.072
"""Smallest half-width of a footprint, metres: enough to cover the centre of a 0.1 m cell, however it is turned."""


class Builder:
    """A world in the making.

    Parameters
    ----------
    plan : Plan
        What the street is to be like.
    rng : numpy.random.Generator
        Source of all that is drawn while the world is built.

    Attributes
    ----------
    solid : list of (Shape, int)
        All that stands in the world so far, in its frame, with the number of its object; 0 for scenery.
    porous : list of (Shape, float)
        What lets a part of the light through, with its opacity, as `PorousMesh` takes it.
    footprints : list of Footprint
        The ground that is taken.
    next_instance : int
        The number that the next object gets.
    """

    def __init__(self, plan: Plan, rng: np.random.Generator) -> None:
        self.plan = plan
        self.road = plan.road
        self.rng = rng
        self.solid: list[tuple[Shape, int]] = []
        self.porous: list[tuple[Shape, float]] = []
        self.footprints: list[Footprint] = []
        self.next_instance = 1

    def place(self, s: float, d: float, yaw: float = 0.0) -> tuple[np.ndarray, float]:
        """Return where in the world something stands: its point on the ground, (3,), metres, and its direction, rad.

        Parameters
        ----------
        s, d : float
            Distance along the road and to the left of its centre line, metres.
        yaw : float
            Direction of the thing, rad from that of the road, counter-clockwise.
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
            What it is.
        half : (float, float)
            Half its length and half its width, metres; `THIN` at least.
        exponent : float
            Shape of its outline: `ROUND`, `ROUNDED` or `SQUARE`.
        offset : (float, float)
            Where its centre lies from its origin: ahead and to the left, metres.
        top : float
            Its height, metres.
        """
        position, angle = self.place(s, d, yaw)
        c, n = np.cos(angle), np.sin(angle)
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
            Distance that everything else must keep from it, metres; a negative one allows some overlap.
        """
        return not collides(footprint, self.footprints, margin)

    def off_asphalt(self, footprint: Footprint) -> bool:
        """Return whether all of a place lies more than 0.1 m outside the asphalt.

        Parameters
        ----------
        footprint : Footprint
            The place.
        """
        return min(outside_asphalt(self.road, *to_road(self.road, x, y)) for x, y in outline(footprint)) > 0.1

    def spot(
        self, s: float, d: float, kind: Kind, radius: float, clear: float, yaw: float = 0.0, top: float = OVERHEAD
    ) -> Footprint | None:
        """Return a round footprint, or None where its place is taken or too near the asphalt.

        Parameters not named here are those of `Builder.footprint` and `Builder.place`.

        Parameters
        ----------
        s, d : float
            Its middle: distance along the road and to the left of its centre line, metres.
        yaw : float
            Direction of the thing, rad from that of the road.
        radius : float
            Its radius, metres.
        clear : float
            How far its middle must lie from the asphalt, metres.
        """
        foot = self.footprint(s, d, yaw, kind, (radius, radius), ROUND, top=top)
        return foot if outside_asphalt(self.road, s, d) > clear and self.free(foot) else None

    def add(self, shape: Shape, s: float, d: float, yaw: float, foot: Footprint | None = None, scale=1.0) -> None:
        """Put a piece of scenery into the world. Parameters not named here are those of `Builder.place`.

        Parameters
        ----------
        shape : Shape
            What it looks like, in its own frame.
        foot : Footprint, optional
            The ground that it takes.
        scale : float
            Factor for its size.
        """
        self.solid.append((shape.placed(*self.place(s, d, yaw), scale), 0))
        if foot:
            self.footprints.append(foot)

    def add_porous(self, shape: Shape, opacity: float, s: float, d: float, yaw: float) -> None:
        """Put something into the world that lets a part of the light through.

        Parameters not named here are those of `Builder.place`.

        Parameters
        ----------
        shape : Shape
            What it looks like, in its own frame, of `Material.WIRE`, `Material.PANE` or `Material.TWIGS`.
        opacity : float
            As `PorousMesh` takes it.
        """
        self.porous.append((shape.placed(*self.place(s, d, yaw)), opacity))

    def try_post(self, shape: Shape, s: float, d: float, yaw: float, kind: Kind, radius: float, scale=1.0) -> None:
        """Put something on a round foot, unless the place is asphalt or taken.

        Parameters not named here are those of `Builder.add` and `Builder.place`.

        Parameters
        ----------
        s, d : float
            Where its foot goes: distance along the road and to the left of its centre line, metres.
        yaw : float
            Its direction, rad from that of the road.
        kind : Kind
            What it is.
        radius : float
            Radius of its foot, metres.
        """
        if foot := self.spot(s, d, kind, radius, radius + 0.15, yaw):
            self.add(shape, s, d, yaw, foot, scale)

"""The builder of a world: puts things beside the road, one by one, and refuses places that are taken."""

from dataclasses import dataclass, field

import numpy as np

from semgrid_edu.workshop.simulation.street.footprints import ROUND, SQUARE, Footprint, collides, footprint_table
from semgrid_edu.workshop.simulation.street.ground import ground_height
from semgrid_edu.workshop.simulation.street.layout import Road, outside_asphalt, to_world
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.simulation.things.shapes import Shape

OVERHEAD = 2.5
"""Height above the ground, metres. Higher things don't occupy their cell, because the recording car passes below."""
THIN = 0.072
"""Smallest half-width of a footprint, metres: enough to cover the centre of a 0.1 m cell, however it is turned."""


@dataclass(eq=False)
class Builder:
    """A world in the making.

    Parameters
    ----------
    road : Road
        The street beside which things are put.
    rng : numpy.random.Generator
        Source of all that is drawn while the world is built.

    Attributes
    ----------
    shapes : list of Shape
        All that stands in the world so far, in its frame.
    instances : list of int
        For each shape the number of its object; 0 for scenery.
    porous : list of Shape
        What lets a part of the light through, in the frame of the world.
    opacities : list of float
        For each shape of `porous` its opacity, as `PorousMesh` takes it.
    footprints : list of Footprint
        The ground that is taken.
    next_instance : int
        The number that the next object gets.
    """

    road: Road
    rng: np.random.Generator
    shapes: list[Shape] = field(default_factory=list, init=False)
    instances: list[int] = field(default_factory=list, init=False)
    porous: list[Shape] = field(default_factory=list, init=False)
    opacities: list[float] = field(default_factory=list, init=False)
    footprints: list[Footprint] = field(default_factory=list, init=False)
    next_instance: int = field(default=1, init=False)

    def place(self, s: float, d: float, yaw: float = 0.0) -> tuple[np.ndarray, float]:
        """Return where in the world something stands.

        Parameters
        ----------
        s, d : float
            Distance along the road and to the left of its centre line, metres.
        yaw : float
            Direction of the thing, rad from that of the road, counter-clockwise.

        Returns
        -------
        position : (3,) float64
            The point on the ground, metres.
        yaw : float
            Direction of the thing, rad from the world's x axis.
        """
        x, y, heading = to_world(self.road, s, d)
        return np.array([x, y, ground_height(self.road, s, d)]), heading + yaw

    def edge_distance(self, s: float, d: float) -> float:
        """Return how far a place lies outside the asphalt.

        Parameters
        ----------
        s, d : float
            Distance along the road and to the left of its centre line, metres.

        Returns
        -------
        float
            Metres; negative on the asphalt.
        """
        return outside_asphalt(self.road, s, d)

    def footprint(
        self, s: float, d: float, yaw: float, kind: Kind, half: tuple[float, float],
        exponent: float = SQUARE, offset: tuple[float, float] = (0.0, 0.0), top: float = OVERHEAD,
    ) -> Footprint:  # fmt: skip
        """Return the footprint of a piece of scenery.

        Parameters
        ----------
        s, d : float
            Where the thing's origin stands: distance along the road and to the left of its centre line, metres.
        yaw : float
            Direction of the thing, rad from that of the road.
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

        Returns
        -------
        Footprint
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

        Returns
        -------
        bool
        """
        return not collides(footprint, footprint_table(self.footprints), margin)

    def add(self, shape: Shape, s: float, d: float, yaw: float, scale=1.0, footprints=()) -> None:
        """Put a piece of scenery into the world.

        Parameters
        ----------
        shape : Shape
            What it looks like, in its own frame.
        s, d : float
            Where its origin goes: distance along the road and to the left of its centre line, metres.
        yaw : float
            Its direction, rad from that of the road.
        scale : float
            Factor for its size.
        footprints : sequence of Footprint
            The ground that it takes.
        """
        position, angle = self.place(s, d, yaw)
        self.shapes.append(shape.placed(position, angle, scale))
        self.instances.append(0)
        self.footprints.extend(footprints)

    def add_porous(self, shape: Shape, opacity: float, s: float, d: float, yaw: float) -> None:
        """Put something into the world that lets a part of the light through.

        Parameters
        ----------
        shape : Shape
            What it looks like, in its own frame, of one of `SEE_THROUGH`.
        opacity : float
            As `PorousMesh` takes it.
        s, d : float
            Where its origin goes: distance along the road and to the left of its centre line, metres.
        yaw : float
            Its direction, rad from that of the road.
        """
        position, angle = self.place(s, d, yaw)
        self.porous.append(shape.placed(position, angle))
        self.opacities.append(opacity)

    def try_post(self, shape: Shape, s: float, d: float, yaw: float, kind: Kind, radius: float, scale=1.0) -> bool:
        """Put something on a round foot, unless the place is asphalt or taken.

        Parameters
        ----------
        shape : Shape
            What it looks like, in its own frame.
        s, d : float
            Where its foot goes: distance along the road and to the left of its centre line, metres.
        yaw : float
            Its direction, rad from that of the road.
        kind : Kind
            What it is.
        radius : float
            Radius of its foot, metres.
        scale : float
            Factor for its size.

        Returns
        -------
        bool
            Whether it was put there.
        """
        foot = self.footprint(s, d, yaw, kind, (radius, radius), ROUND)
        if self.edge_distance(s, d) < radius + 0.15 or not self.free(foot):
            return False
        self.add(shape, s, d, yaw, scale, [foot])
        return True

    def number(self) -> int:
        """Return a number that no other object has."""
        self.next_instance += 1
        return self.next_instance - 1

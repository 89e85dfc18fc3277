"""Puts things beside the road, one by one, and refuses places that are taken."""

from dataclasses import dataclass, field

import numpy as np

from semgrid_edu.simulation.street.footprints import ROUND, SQUARE, Footprint, collides, footprint_table
from semgrid_edu.simulation.street.layout import Road, ground_height, outside_asphalt, to_world
from semgrid_edu.simulation.things.materials import Kind
from semgrid_edu.simulation.things.shapes import Shape

OVERHEAD = 2.5
"""Metres above the ground: what is higher leaves its cell to what lies below (the LIDAR car passes under it)."""
THIN = 0.072
"""Smallest half-width of a footprint, metres: whatever its direction it holds the centre of a 0.1 m cell."""


@dataclass(eq=False)
class Builder:
    """A world in the making.

    Parameters
    ----------
    road : Road
    rng : numpy.random.Generator
    """

    road: Road
    rng: np.random.Generator
    shapes: list[Shape] = field(default_factory=list)
    instances: list[int] = field(default_factory=list)
    footprints: list[Footprint] = field(default_factory=list)
    next_instance: int = 1

    def place(self, s: float, d: float, yaw: float = 0.0) -> tuple[np.ndarray, float]:
        """Return the position on the ground and the direction in the world of something at (s, d)."""
        x, y, heading = to_world(self.road, s, d)
        return np.array([x, y, ground_height(self.road, s, d)]), heading + yaw

    def edge_distance(self, s: float, d: float) -> float:
        """Return how far (s, d) lies outside the asphalt, metres."""
        return outside_asphalt(self.road, s, d)

    def footprint(
        self, s: float, d: float, yaw: float, kind: Kind, half: tuple[float, float],
        exponent: float = SQUARE, offset: tuple[float, float] = (0.0, 0.0), top: float = OVERHEAD, instance: int = 0,
    ) -> Footprint:  # fmt: skip
        """Return the footprint of something at (s, d), its centre `offset` metres along and left of its direction."""
        position, angle = self.place(s, d, yaw)
        c, n = np.cos(angle), np.sin(angle)
        x = position[0] + c * offset[0] - n * offset[1]
        y = position[1] + n * offset[0] + c * offset[1]
        sides = [max(h, THIN) for h in half]
        return Footprint(x, y, *sides, angle, exponent, int(kind), instance, min(top, OVERHEAD))

    def free(self, footprint: Footprint, margin: float = 0.1) -> bool:
        """Return whether nothing stands within `margin` metres of a footprint."""
        return not collides(footprint, footprint_table(self.footprints), margin)

    def add(self, shape: Shape, s: float, d: float, yaw: float, scale=1.0, footprints=(), instance: int = 0) -> None:
        """Put a shape at (s, d), with what it covers."""
        position, angle = self.place(s, d, yaw)
        self.shapes.append(shape.placed(position, angle, scale))
        self.instances.append(instance)
        self.footprints.extend(footprints)

    def try_post(self, shape: Shape, s: float, d: float, yaw: float, kind: Kind, radius: float, scale=1.0) -> bool:
        """Put something on a round foot at (s, d) unless it stands on asphalt or in something else's place."""
        foot = self.footprint(s, d, yaw, kind, (radius, radius), ROUND)
        if self.edge_distance(s, d) < radius + 0.15 or not self.free(foot):
            return False
        self.add(shape, s, d, yaw, scale, [foot])
        return True

    def number(self) -> int:
        """Return the number of the next object."""
        self.next_instance += 1
        return self.next_instance - 1

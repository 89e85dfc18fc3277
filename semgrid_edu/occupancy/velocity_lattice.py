"""The finitely many velocities that the BOF tells apart (Coue et al., IJRR 2006; paper, section 3.2)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError

FINEST = 100
"""Largest ratio of top speed to spacing: it makes some 30,000 velocities, for which only tiny grids fit into memory."""


@dataclass(frozen=True)
class VelocityLattice:
    """A square lattice of velocities, cut to a disc.

    Parameters
    ----------
    max_speed : float
        The top speed, m/s. The default, 16 m/s, is somewhat above what is allowed in a town.
    spacing : float
        Spacing of neighbouring velocities along an axis, m/s. By default 1 m/s, so that a pedestrian, who walks at
        1.4 m/s, is faster than the slowest moving velocities.

    Raises
    ------
    ArgumentError
        When zero would be the only velocity, or there would be more than a computer can hold.

    Examples
    --------
    >>> VelocityLattice(max_speed=1.0, spacing=1.0).velocities.tolist()
    [[0.0, 0.0], [-1.0, 0.0], [0.0, -1.0], [0.0, 1.0], [1.0, 0.0]]
    """

    max_speed: float = 16.0
    spacing: float = 1.0

    def __post_init__(self) -> None:
        """Refuse a lattice of no velocity but zero, or of too many."""
        if not (np.isfinite(self.spacing) and self.spacing > 0):
            raise ArgumentError("spacing", "a positive speed in m/s", self.spacing)
        if not self.spacing <= self.max_speed <= FINEST * self.spacing:
            expected = f"from 1 to {FINEST} times the spacing of {self.spacing} m/s"
            raise ArgumentError("max_speed", expected, self.max_speed)

    @cached_property
    def velocities(self) -> NDArray[np.float64]:
        """(V, 2): the velocities of the lattice, m/s, from slow to fast; the first is zero."""
        steps = int(self.max_speed / self.spacing + 1e-9)
        x, y = (axis.ravel() for axis in np.mgrid[-steps : steps + 1, -steps : steps + 1])
        order = np.lexsort((y, x, x**2 + y**2))
        lattice = np.stack([x, y], axis=1)[order] * float(self.spacing)
        return lattice[np.hypot(*lattice.T) <= self.max_speed * (1 + 1e-9)]

    @cached_property
    def prior(self) -> NDArray[np.float64]:
        """(V,): the prior over velocities of something of which nothing is known but that it moves; sums to 1.

        The density of `particles.draw_velocities`, any heading and a speed that is the square of a uniform
        number, is proportional to |v|^(-3/2) in the plane of velocities.
        """
        speed = np.hypot(*self.velocities.T)
        density = np.append(0, speed[1:] ** -1.5)
        return density / density.sum()

    @cached_property
    def neighbours(self) -> NDArray[np.int64]:
        """(V, 4): indices of the velocities one spacing ahead, behind, to the left and to the right of each.

        Where there is none, the velocity's own index stands in its place. Zero has no neighbours and is no neighbour of
        any other velocity, because what stands doesn't set off by accelerating a little.
        """
        steps = np.rint(self.velocities / self.spacing).astype(int)
        index = {tuple(step): k for k, step in enumerate(steps) if k > 0}
        around = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
        moving = [[index.get(tuple(step + side), k) for side in around] for k, step in enumerate(steps) if k > 0]
        return np.array([[0, 0, 0, 0], *moving])

    def change_probability(self, max_acceleration: float, dt: float) -> float:
        """Return the probability that mass changes to one given neighbouring velocity within `dt`.

        A particle of CMCDOT changes each component of its velocity by a uniform number up to a dt, of variance
        (a dt)^2 / 3. A step to either neighbour, with probability p each, has variance 2 p spacing^2.

        Parameters
        ----------
        max_acceleration : float
            Largest acceleration along each axis, a, m/s^2.
        dt : float
            The time step, seconds.

        Returns
        -------
        float
            p = (a dt)^2 / (6 spacing^2), but at most 1/5: then the velocity and its four neighbours are equally likely.
        """
        return min(max_acceleration * dt / self.spacing, 1.2**0.5) ** 2 / 6

    def __len__(self) -> int:
        """Return the number of velocities, V."""
        return len(self.velocities)

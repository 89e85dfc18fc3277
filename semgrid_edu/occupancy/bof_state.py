"""What the BOF believes about each cell, and the velocities that it separates (Coue et al., IJRR 2006; section 3.2)."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_fields
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.walls import Walls
from semgrid_edu.occupancy.world import WorldModel

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
        """Check that there is a velocity besides zero, and that there aren't too many."""
        check_fields(self, "a positive speed in m/s", lambda v: np.isfinite(v) and v > 0, "spacing")
        if not self.spacing <= self.max_speed <= FINEST * self.spacing:
            expected = f"from 1 to {FINEST} times the spacing of {self.spacing} m/s"
            raise ArgumentError("max_speed", expected, self.max_speed)

    @cached_property
    def velocities(self) -> NDArray[np.float64]:
        """(V, 2): the velocities of the lattice, m/s, from slow to fast; the first is zero."""
        steps = int(self.max_speed / self.spacing + 1e-9)
        x, y = (axis.ravel() for axis in np.mgrid[-steps : steps + 1, -steps : steps + 1])
        # lexsort sorts by its last key first: by speed, then by x, then by y.
        order = np.lexsort((y, x, x**2 + y**2))
        lattice = np.stack([x, y], axis=1)[order] * float(self.spacing)
        return lattice[np.hypot(*lattice.T) <= self.max_speed * (1 + 1e-9)]

    @cached_property
    def prior(self) -> NDArray[np.float64]:
        """(V,): the prior over velocities of something about which nothing is known except that it moves; sums to 1.

        The density of `state.draw_velocities`, any heading and a speed that is the square of a uniform number, is
        proportional to ``|v|^(-3/2)`` in the plane of velocities.
        """
        speed = np.hypot(*self.velocities.T)
        density = np.append(0, speed[1:] ** -1.5)
        return density / density.sum()

    @cached_property
    def neighbours(self) -> NDArray[np.int64]:
        """(V, 4): indices of the velocities one spacing ahead, behind, to the left and to the right of each.

        Where there is none, the velocity's own index is there instead. Zero has no neighbours and is no neighbour of
        any other velocity, because a standing thing doesn't set off by accelerating a little.
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


MOST_BYTES = 2e9
"""Memory that the mass of all velocities may take, in bytes; a step needs four times as much beside it."""


@dataclass(frozen=True)
class BofParams:
    """The parameters of the BOF: the same model of the world as CMCDOT's, and a lattice of velocities.

    Parameters
    ----------
    lattice : VelocityLattice
        The velocities that the filter tells apart.
    world : WorldModel
        What the filter assumes about the world and its sensor.
    """

    lattice: VelocityLattice = field(default_factory=VelocityLattice)
    world: WorldModel = field(default_factory=WorldModel)


@dataclass(frozen=True, eq=False)
class BofState:
    """What the BOF carries from step to step: a distribution over free, unknown and V velocities in each cell.

    Each velocity shifts its mass by whole cells, and remembers the rest of its displacement. So no mass is ever spread
    by interpolation, and slow things move too, by a cell every few steps. When the map turns, the lattice doesn't turn
    with it: its velocities are expressed in the new axes of the map.

    Parameters
    ----------
    free, unknown : (H, W) float32
        P(FREE) and P(UNKNOWN).
    occupied : (V, H, W) float32
        P(occupied, velocity). The first velocity is zero: its mass is STATIC, that of all other velocities DYNAMIC.
    velocity : (V, 2) float64
        The velocities of the lattice over ground, along the axes of the map, m/s.
    remainder : (V, 2) float64
        How far each velocity has displaced its mass beyond the whole cells by which it was shifted, along the axes of
        the map, metres.
    """

    free: NDArray[np.float32]
    unknown: NDArray[np.float32]
    occupied: NDArray[np.float32]
    velocity: NDArray[np.float64]
    remainder: NDArray[np.float64]

    @classmethod
    def nothing_known(cls, spec: GridSpec, lattice: VelocityLattice) -> "BofState":
        """Return the state before the first scan: UNKNOWN everywhere.

        Parameters
        ----------
        spec : GridSpec
            The cells, (H, W).
        lattice : VelocityLattice
            The V velocities that are told apart.

        Raises
        ------
        ArgumentError
            When V x H x W numbers don't fit into memory.
        """
        shape = (len(lattice), *spec.shape)
        if (size := 4 * float(np.prod(shape, dtype=float))) > MOST_BYTES:
            expected = f"velocities x cells that take at most {MOST_BYTES / 1e9:g} GB"
            raise ArgumentError("lattice", expected, "{} x {} x {}, ".format(*shape) + f"{size / 1e9:.1f} GB")
        free = np.zeros(spec.shape, np.float32)
        unknown = np.ones(spec.shape, np.float32)
        return cls(free, unknown, np.zeros(shape, np.float32), lattice.velocities, np.zeros((len(lattice), 2)))

    @property
    def probability(self) -> NDArray[np.floating]:
        """(4, H, W): P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN)."""
        return np.stack([self.free, self.occupied[0], self.occupied[1:].sum(axis=0), self.unknown])


def whole_cells(state: BofState, spec: GridSpec, dt: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return by how many whole cells each velocity shifts its mass, and the rest of its displacement.

    Parameters
    ----------
    state : BofState
        The belief; only its velocities and their remainders are used.
    spec : GridSpec
        The cells.
    dt : float
        The time step, seconds.

    Returns
    -------
    cells : (V, 2) int64
        Number of cells along the x and y axes of the map.
    remainder : (V, 2) float64
        The rest along the same axes, metres, at most half a cell.
    """
    displacement = state.remainder + state.velocity * dt
    remainder = (displacement + spec.cell / 2) % spec.cell - spec.cell / 2
    cells = np.rint((displacement - remainder) / spec.cell)
    farthest = max(spec.shape)  # mass that leaves the grid is lost, however far it goes
    return np.clip(cells, -farthest, farthest).astype(np.int64), remainder


def origins(velocity: NDArray, spec: GridSpec, walls: Walls, fraction: float = 1.0) -> NDArray[np.int64]:
    """Return how many cells away mass of each velocity was some time ago, when it was still in another place.

    Parameters
    ----------
    velocity : (V, 2) float
        The velocities along the axes of the map, m/s.
    spec : GridSpec
        The cells.
    walls : Walls
        How long ago: `clearing_time`, or for slow things the time that they need for `clearing_cells`.
    fraction : float
        Which fraction of `clearing_time` ago.

    Returns
    -------
    (V, 2) int64
        Number of whole cells along the x and y axes of the map, to the place where it was.
    """
    return np.rint(walls.displacement(velocity, spec.cell, -fraction) / spec.cell).astype(np.int64)

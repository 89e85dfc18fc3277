"""What real streets need beyond the paper: walls, hedges and wakes, as one object that the filters are handed.

A LIDAR sees a wall piece by piece and looks into the gaps of a hedge one after the other. To a filter that follows what
arrives in a cell, both look like motion. `Walls` decides how much of an arrival to doubt, and frees the places that
moving things have left out of sight. `CmcdotParams(walls=None)` is the paper's filter, without any of this.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from semgrid_edu.errors import check_fields, not_negative, types_named
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.state import (
    MAX_MOVE_PROBABILITY,
    OUTSIDE,
    Particles,
    State,
    at_cells,
    cells_of,
    ratio,
    weight_in_cells,
)

FREE, STATIC, DYNAMIC, UNKNOWN = State

WALL_EXPONENT = 4
"""To something fast, a cell is a wall by P(STATIC) to the power of this: 0.9 counts as 0.66, 0.5 as 0.06."""


@dataclass(frozen=True)
class Walls:
    """How far the filters look back and ahead along a path to tell a moving thing from a wall that comes into view.

    *Walls.* A particle is suspect if there is something STATIC where it was `clearing_time` ago, and the cell where it
    will be after `clearing_time` is not known to be free. Then its arrival in an unseen cell may be only the next piece
    of the wall. A pedestrian who sets off also comes out of a STATIC cell, but walks into free space. And the side of a
    long vehicle comes out of a cell where the vehicle moves.

    Above `running_speed` more is checked; slower things may be people, who walk close to walls. First, the cells beside
    that place count like the place, because a wall that crosses the grid at an angle is a staircase of cells. Second,
    nothing drives through a wall, so the cell where a particle was shortly before counts, too. Without this, particles
    that start in front of a parked car fly on inside it, where no beam contradicts them. Both checks also hit cells
    that the moving car itself covers, where P(STATIC) can be one half. So only what is nearly certain is a wall:
    P(STATIC)^4.

    *Hedges.* Hedges fake motion: as the car advances, gaps open along with it. For a particle that, seen from the car,
    is no faster than a standing thing (`keeps_pace`), a cell ahead that borders a STATIC one isn't free space; its own
    cells aren't there yet, so P(STATIC) counts as it is. While the car stands, this doesn't apply.

    *Wakes.* One thing can't be in two places. So what a moving particle occupied `clearing_time` ago is free now, even
    if no scan sees it.

    Parameters
    ----------
    clearing_time : float
        Time in which a moving thing leaves the place that it occupies, seconds: a car of 4.5 m at 9 m/s, a pedestrian
        of 0.5 m at 1 m/s. With 0 the filters look neither back nor ahead.
    clearing_cells : float
        Number of cells by which a thing must move before it counts as having left a place. Slow things are followed
        for longer than `clearing_time`, because a thing shows in more cells than it fills: a pedestrian doesn't get
        out of two cells of 0.5 m in half a second.
    running_speed : float
        Speed above which more of a particle's past is checked, m/s: faster than people walk.
    second_look : float
        Fraction of `clearing_time` at which its past position is checked again (0.4: two LIDAR revolutions).
    """

    clearing_time: float = 0.5
    clearing_cells: float = 3.0
    second_look: float = 0.4
    running_speed: float = 3.0

    @types_named
    def __post_init__(self) -> None:
        """Check that all are numbers."""
        names = "clearing_time", "clearing_cells", "second_look", "running_speed"
        check_fields(self, "a finite number, not negative", not_negative, *names)

    def displacement(self, velocity: NDArray, cell: float, fraction: float = 1.0) -> NDArray[np.float64]:
        """Return how far things move in `clearing_time`, but at least `clearing_cells`, (N, 2) metres.

        Parameters
        ----------
        velocity : (N, 2) float
            Their velocities, m/s. A thing at rest has no displacement.
        cell : float
            Side of a cell, metres.
        fraction : float
            Which fraction of this way; negative for the past.
        """
        path = self.clearing_time * velocity.astype(np.float64)
        # A path that is too short is stretched to the least length, in its own direction.
        length = np.linalg.norm(path, axis=1, keepdims=True)
        least = self.clearing_cells * cell
        return fraction * path * np.maximum(1, ratio(np.full_like(length, least), length))

    def keeps_pace(self, velocity: NDArray, car_velocity: NDArray, cell: float) -> NDArray[np.bool_]:
        """Return which things could be a gap that the car's own motion opens, (N,).

        ``|v - v_car| <= |v_car|``: seen from the car they are no faster than a standing thing. And they are fast enough
        to have left their cells within `second_look`. Nothing keeps pace with a car that stands.

        Parameters
        ----------
        velocity : (N, 2) float
            Velocities along the axes of the map, m/s.
        car_velocity : (2,) float
            Velocity of the vehicle along the axes of the map, m/s.
        cell : float
            Side of a cell, metres.
        """
        time = self.second_look * self.clearing_time
        car_speed = np.hypot(*car_velocity)
        if car_speed == 0 or time == 0:
            return np.zeros(len(velocity), bool)
        difference = np.hypot(*(velocity - car_velocity).T)  # unlike `norm`, without overflow
        speed = np.hypot(*velocity.T)
        return (difference <= car_speed) & (speed >= self.clearing_cells * cell / time)

    def doubt(
        self,
        particles: Particles,
        cells: NDArray,
        mixed: NDArray,
        unseen: NDArray,
        spec: GridSpec,
        driven: ArrayLike,
        dt: float,
    ) -> NDArray[np.float64]:
        """Return the probability that a particle's arrival in its cell is only a wall that comes into view, (N,).

        Parameters
        ----------
        particles : Particles
            N particles after their flight.
        cells : (N,) int
            The cell of each, from `cells_of`.
        mixed : (4, H, W) float
            The four states before particles flew.
        unseen : (H, W) float
            Probability that no scan has found the cell free: P(UNKNOWN), and what has only just left the cell.
        spec : GridSpec
            The cells, (H, W).
        driven : (2,) float
            How far the vehicle has driven during the flight, along the axes of the map, metres.
        dt : float
            How long the particles have flown, seconds.
        """
        runs = np.hypot(*particles.velocity.T) > self.running_speed
        keeps = self.keeps_pace(particles.velocity, velocity_of(driven, dt), spec.cell)
        before = self._other_cells(particles, cells, spec, -1)
        shortly_before = self._other_cells(particles, cells, spec, -self.second_look)
        ahead = self._other_cells(particles, cells, spec, 1)
        suspicion = from_a_wall(mixed[STATIC], before, shortly_before, runs)
        return suspicion * (1 - way_out(mixed, ahead, keeps)) * at_cells(unseen, cells)

    def clear_wakes(
        self, posterior: NDArray, particles: Particles, cells: NDArray, hidden: NDArray, spec: GridSpec
    ) -> NDArray[np.float64]:
        """Free the hidden cells that moving particles have left, by `strike_out_wakes`.

        Parameters
        ----------
        posterior : (4, H, W) float
            The four states given the scan.
        particles : Particles
            N particles, with their weights given the scan.
        cells : (N,) int
            The cell of each, from `cells_of`.
        hidden : (H, W) bool
            Cells about which the scan tells nothing.
        spec : GridSpec
            The cells, (H, W).
        """
        before = self._other_cells(particles, cells, spec, -1)
        return strike_out_wakes(posterior, weight_in_cells(particles.weight, before, spec.shape), hidden)

    def _other_cells(self, particles: Particles, cells: NDArray, spec: GridSpec, fraction: float) -> NDArray[np.int64]:
        """Return the cell of each particle at another time, (N,); `OUTSIDE` where it is the same cell as now."""
        then = cells_of(particles.position + self.displacement(particles.velocity, spec.cell, fraction), spec)
        return np.where(then == cells, OUTSIDE, then)


def from_a_wall(static: NDArray, before: NDArray, shortly_before: NDArray, runs: NDArray) -> NDArray[np.float64]:
    """Return the probability that a particle came out of a wall, or drove through one shortly before, (N,).

    Parameters
    ----------
    static : (H, W) float
        P(STATIC).
    before, shortly_before : (N,) int
        The cell of each particle `Walls.clearing_time` ago, and at the second look.
    runs : (N,) bool
        Whether it is faster than people walk. Of fast things only P(STATIC)^4 counts, but also that of the eight
        neighbours.
    """
    wall = static**WALL_EXPONENT
    out_of_a_wall = np.where(runs, at_cells(largest_nearby(wall), before), at_cells(static, before))
    through_a_wall = runs * at_cells(wall, shortly_before)
    return np.maximum(out_of_a_wall, through_a_wall)


def way_out(mixed: NDArray, ahead: NDArray, keeps: NDArray) -> NDArray[np.float64]:
    """Return the probability that the cell ahead of a particle is free, or holds something that moves, (N,).

    Parameters
    ----------
    mixed : (4, H, W) float
        The four states before particles flew.
    ahead : (N,) int
        The cell in which each particle will be after `Walls.clearing_time`.
    keeps : (N,) bool
        Whether it keeps pace with the car. To it, a gap beside a hedge is no way out.
    """
    gap = keeps * at_cells(mixed[FREE] * largest_nearby(mixed[STATIC]), ahead)
    return at_cells(mixed[FREE] + mixed[DYNAMIC], ahead) - gap


def velocity_of(driven: ArrayLike, dt: float) -> NDArray[np.float64]:
    """Return the velocity of a vehicle that has driven so far, (2,) m/s; 0 when no time has passed.

    Parameters
    ----------
    driven : (2,) float
        Displacement, metres.
    dt : float
        Time, seconds.
    """
    return ratio(np.asarray(driven, dtype=float), dt)


def strike_out_wakes(posterior: NDArray, left: NDArray, hidden: NDArray) -> NDArray[np.float64]:
    """Strike out that something stands where a moving thing has just been.

    "A thing has left this cell", with probability a, and "a thing stands here", with probability s, can't both be true.
    Without this combination P(STATIC) is (1 - a) s / (1 - a s), and FREE gets the difference.

    Parameters
    ----------
    posterior : (4, H, W) float
        The four states given the scan.
    left : (H, W) float
        Dynamic mass that has left each cell; a is at most `MAX_MOVE_PROBABILITY`.
    hidden : (H, W) bool
        Cells about which the scan tells nothing. Others stay as they are, because there the scan decides.
    """
    a = np.where(hidden, np.minimum(left, MAX_MOVE_PROBABILITY), 0)
    s = posterior[STATIC]
    static = (1 - a) * s / (1 - a * s)
    return np.stack([posterior[FREE] + (s - static), static, posterior[DYNAMIC], posterior[UNKNOWN]])


def largest_nearby(wall: NDArray) -> NDArray[np.floating]:
    """Return the largest value of each cell and its eight neighbours, (H, W).

    A wall that crosses the grid at an angle is a staircase of cells, so a path along it also leads through the cells
    beside them. And hedges are ragged and porous, so beams pass through cells of their face, which are hit once the car
    looks in from another place.

    Parameters
    ----------
    wall : (H, W) float
        How much each cell is a wall, 0 to 1.
    """
    return maximum_filter(wall, size=3, mode="constant")

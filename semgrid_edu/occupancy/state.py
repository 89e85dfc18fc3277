"""What the filter believes about each cell, and its particles: how they fly, and how they are drawn (section 3.2)."""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_shape, types_named
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion


class State(IntEnum):
    """The four states of a cell, in the order of every array that holds them."""

    FREE = 0
    STATIC = 1
    DYNAMIC = 2
    UNKNOWN = 3


N_STATES = len(State)
"""Number of states, and of planes of an occupancy grid."""


@dataclass(frozen=True, eq=False)
class Belief:
    """What a filter believes about the cells in front of the vehicle, in the grid frame of the current instant.

    Parameters
    ----------
    probability : (4, H, W) float32
        P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN) of each cell; they sum to 1.
    velocity : (2, H, W) float32
        Mean velocity over ground of what moves in the cell, along the grid's x and y axes, m/s. NaN in cells without
        dynamic mass, and where the map's cell has no particles.
    velocity_covariance : (2, 2, H, W) float32
        Covariance of that velocity along the same axes, m^2/s^2: how much it varies within the cell, and how uncertain
        it is. Symmetric and positive semi-definite; NaN where the velocity is NaN.
    steps : dict of str to (4, H, W) float32
        The four probabilities after "move", "predict", "update" and "resample", in this order, looked up at the centres
        of the same cells. Empty unless the filter was asked to keep them.
    """

    probability: NDArray[np.float32]
    velocity: NDArray[np.float32]
    velocity_covariance: NDArray[np.float32]
    steps: dict[str, NDArray[np.float32]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Particles:
    """Hypotheses of moving things: samples of the dynamic mass.

    Parameters
    ----------
    position : (N, 2) float
        x, y in the frame of the map, metres. All three arrays are float64 in the book and float32 in `fast`.
    velocity : (N, 2) float
        Velocity over ground along the axes of the map, m/s.
    weight : (N,) float
        Probability that each particle carries. The dynamic probability of a cell is the sum of the weights in it, and
        what is newborn.
    """

    position: NDArray[np.floating]
    velocity: NDArray[np.floating]
    weight: NDArray[np.floating]

    @types_named
    def __post_init__(self) -> None:
        """Check that there is one position and one velocity per weight; compiled loops would read past the end."""
        for name in ("position", "velocity"):
            check_shape(name, getattr(self, name), (*np.shape(self.weight), 2))

    @classmethod
    def none(cls) -> "Particles":
        """Return an empty set of particles."""
        return cls(np.empty((0, 2), np.float32), np.empty((0, 2), np.float32), np.empty(0, np.float32))

    def __len__(self) -> int:
        """Return their number, N."""
        return len(self.weight)


@dataclass(frozen=True, eq=False)
class FilterState:
    """What the filter carries from one of its steps to the next.

    The dynamic probability is stored twice, and the two agree: in each cell, `probability[DYNAMIC]` is `newborn` plus
    the sum of the weights of the particles there.

    Parameters
    ----------
    probability : (4, H, W) float
        P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN) of each cell of the map; they sum to 1. Both arrays are float64
        after a step of the book and float32 after one of `fast`.
    particles : Particles
        The dynamic mass whose velocity is estimated.
    newborn : (H, W) float
        Dynamic mass that has just appeared and has no particles yet. `resample` draws particles for it.
    """

    probability: NDArray[np.floating]
    particles: Particles
    newborn: NDArray[np.floating]

    @types_named
    def __post_init__(self) -> None:
        """Check that all planes have the same size; compiled loops would read past the end of the smaller ones."""
        check_shape("probability", self.probability, (N_STATES, *np.shape(self.newborn)))

    @classmethod
    def unknown(cls, spec: GridSpec) -> "FilterState":
        """Return the state before the first scan: UNKNOWN everywhere, and no particles.

        Parameters
        ----------
        spec : GridSpec
            The cells of the map, (H, W).
        """
        probability = np.zeros((4, *spec.shape), np.float32)
        probability[State.UNKNOWN] = 1
        return cls(probability, Particles.none(), np.zeros(spec.shape, np.float32))


OUTSIDE = -1
"""The cell index of anything outside the grid."""


def check_part(name: str, part: object, protocol: type, example: str) -> None:
    """Check that an object can serve as an exchangeable part of a filter, such as its sensor.

    Parameters
    ----------
    name : str
        Name of the argument, for the error.
    part : object
        The object.
    protocol : type
        The protocol that it must follow.
    example : str
        The method that it needs, and a class that has it.
    """
    expected = f"an object with a method {example}"
    if isinstance(part, type):
        raise ArgumentError(name, expected, f"the class {part.__name__} itself: write {part.__name__}()")
    if not isinstance(part, protocol):
        raise ArgumentError(name, expected, type(part).__name__)


MAX_MOVE_PROBABILITY = 1 - 1e-3
"""The largest probability with which something arrives in a cell or has left it: below 1, so a scan can contradict."""


TINY = float(np.finfo(np.float64).tiny)
"""The smallest double by which `ratio` divides: below it a quotient may overflow."""


def ratio(part: NDArray, whole: NDArray) -> NDArray[np.floating]:
    """Return part / whole cell by cell, and 0 where the divisor is 0 or so small that the quotient may overflow.

    Parameters
    ----------
    part, whole : (..., H, W) float
        Dividend and divisor; the divisor isn't negative.
    """
    out = np.zeros(np.broadcast_shapes(np.shape(part), np.shape(whole)), np.result_type(part, whole))
    return np.divide(part, whole, out=out, where=whole >= np.finfo(out.dtype).tiny)


def cells_of(position: NDArray, spec: GridSpec) -> NDArray[np.int64]:
    """Return the cell that each particle is in, (N,): row * W + column, or `OUTSIDE`.

    Parameters
    ----------
    position : (N, 2) float
        x and y of each particle in the frame of `spec`, metres.
    spec : GridSpec
        The cells, (H, W).
    """
    rows, cols, inside = spec.cells(position)
    return np.where(inside, rows * spec.shape[1] + cols, OUTSIDE)


def weight_in_cells(weight: NDArray, cells: NDArray, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Add up the weights in each cell, (H, W).

    Parameters
    ----------
    weight : (N,) float
        The weight of each particle.
    cells : (N,) int
        The cell of each particle, from `cells_of`.
    shape : (int, int)
        H, W.
    """
    inside = cells != OUTSIDE
    total = np.bincount(cells[inside], weights=weight[inside], minlength=shape[0] * shape[1])
    return total.astype(np.float64).reshape(shape)  # of no particles, bincount makes integers


def at_cells(plane: NDArray, cells: NDArray) -> NDArray[np.float64]:
    """Return for each particle the value of its cell, (N,), and 0 outside.

    Parameters
    ----------
    plane : (H, W) float
        One number per cell.
    cells : (N,) int
        The cell of each particle, from `cells_of`.
    """
    return np.where(cells == OUTSIDE, 0.0, plane.ravel()[cells])


def fly(particles: Particles, max_acceleration: float, dt: float, rng: np.random.Generator) -> Particles:
    """Let particles fly for a while, with noise: v' = v + a dt, x' = x + v dt + a dt^2 / 2.

    Parameters
    ----------
    particles : Particles
        N particles at the start of their flight.
    max_acceleration : float
        Largest acceleration along each axis, m/s^2. Each particle draws its acceleration uniformly, up to this in
        either direction, and keeps it during the flight.
    dt : float
        How long they fly, seconds.
    rng : numpy.random.Generator
        Source of the accelerations.
    """
    noise = rng.random((len(particles), 2), np.float32).astype(np.float64)
    a = max_acceleration * (2 * noise - 1)
    v = particles.velocity.astype(np.float64)
    x = particles.position + v * dt + a * dt**2 / 2
    return Particles(x, v + a * dt, particles.weight)


def moving_share(velocity: NDArray, stop_rate: float, stop_speed: float, dt: float) -> NDArray[np.floating]:
    """Return which share of its mass still moves after a time step, for each velocity, (N,).

    Something of speed v stops at the rate stop_rate exp(-v^2 / (2 stop_speed^2)), so after `dt` the share
    exp(-rate dt) still moves.

    Parameters
    ----------
    velocity : (N, 2) float
        Velocities at the start of the time step, m/s.
    stop_rate, stop_speed : float
        Rate of stopping at v = 0, 1/s, and the speed above which it falls, m/s.
    dt : float
        The time step, seconds.
    """
    speed = np.linalg.norm(velocity.astype(np.float64), axis=1)
    rate = stop_rate * np.exp(-(speed**2) / (2 * stop_speed**2))
    return np.exp(-rate * dt)


def transform(particles: Particles, motion: PlanarMotion) -> Particles:
    """Express particles in a new frame.

    Parameters
    ----------
    particles : Particles
        N particles in the old frame.
    motion : PlanarMotion
        Pose of the new frame in the old one, metres and radians.
    """
    position = motion.child_from_parent(particles.position.astype(np.float64))
    velocity = particles.velocity @ motion.rotation
    return Particles(position, velocity, particles.weight)


@runtime_checkable
class Resampling(Protocol):
    """How indices are drawn in proportion to weights. The package's default is `SystematicResampling`.

    `resample` calls it twice per step: for the particles that continue, by their weights, and for the cells in which
    new ones appear, by their newborn mass. All that are drawn get the same weight afterwards. So index i should be
    drawn count w_i / sum(w) times on average; otherwise the velocities are biased, and more dynamic mass becomes
    UNKNOWN because no particle was drawn for it. (Elsewhere `resample` restores P(DYNAMIC), whatever is drawn.)

    Examples
    --------
    Independent draws, which scatter more than systematic ones:

    >>> class Multinomial:
    ...     def draw(self, weight, count, rng):
    ...         return rng.choice(len(weight), count, p=weight / weight.sum())
    >>> isinstance(Multinomial(), Resampling)
    True
    """

    def draw(self, weight: NDArray, count: int, rng: np.random.Generator) -> NDArray:
        """Draw indices in proportion to weights.

        Parameters
        ----------
        weight : (N,) float64
            The weights: a copy, finite, not negative, with a sum that is above 0 but needn't be 1.
        count : int
            How many to draw, M, at least 1; M may be above or below N.
        rng : numpy.random.Generator
            The only source of random numbers, so that the filter's seed decides everything.

        Returns
        -------
        (M,) int
            Indices from 0 to N - 1, in any order.
        """
        ...


@dataclass(frozen=True)
class SystematicResampling:
    """Put equally spaced points on the weights laid end to end: one random number, and the least scatter."""

    def draw(self, weight: NDArray, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Draw indices by `systematic_resample`. Parameters and result are those of `Resampling.draw`."""
        return systematic_resample(weight, count, rng.random())


def systematic_resample(weight: NDArray, count: int, offset: float) -> NDArray[np.int64]:
    """Draw `count` indices in proportion to the weights, by systematic resampling.

    The weights are laid end to end, and `count` equally spaced points are put on them, shifted by one random offset. So
    index i is drawn as often as points fall on its weight: floor or ceil of count w_i / sum(w) times. For count = N
    this is `filterpy.monte_carlo.systematic_resample`, which draws its offset from numpy's global generator. Here the
    offset is an argument, so that a seed decides it.

    Parameters
    ----------
    weight : (N,) float
        The weights, not negative and not all zero; they need not sum to 1.
    count : int
        How many indices to draw, M.
    offset : float
        Position of the first point within the first of `count` equal intervals, from 0 to below 1.

    Returns
    -------
    (M,) int64
        The indices drawn, in ascending order.

    Examples
    --------
    >>> systematic_resample(np.array([0.1, 0.6, 0.3]), 4, 0.5)
    array([1, 1, 1, 2])
    """
    ends = np.cumsum(weight, dtype=np.float64)
    # On a line from 0 to the sum of all weights, index i owns the piece that ends at ends[i].
    points = (np.arange(count) + offset) / count * ends[-1]
    chosen = np.searchsorted(ends, points, side="right")
    last = np.flatnonzero(weight)[-1]
    return np.minimum(chosen, last)  # rounding can put the last point on the very end, behind which all weights are 0


def draw_again(particles: Particles, count: int, resampling: Resampling, rng: np.random.Generator) -> Particles:
    """Draw particles in proportion to their weights; all that are drawn get the same weight.

    Parameters
    ----------
    particles : Particles
        The N particles to draw from.
    count : int
        How many to draw, M.
    resampling : Resampling
        How to draw.
    rng : numpy.random.Generator
        Source of random numbers.

    Returns
    -------
    Particles
        M particles with the same sum of weights; none when that sum is zero.
    """
    chosen = draw_indices(resampling, particles.weight, count, rng)
    weight = equal_weights(particles.weight, len(chosen))
    return Particles(particles.position[chosen], particles.velocity[chosen], weight)


def draw_newborn(
    newborn: NDArray, spec: GridSpec, count: int, max_speed: float, resampling: Resampling, rng: np.random.Generator
) -> Particles:
    """Draw new particles in proportion to each cell's newborn mass; all of them get the same weight.

    Parameters
    ----------
    newborn : (H, W) float
        Dynamic mass that no particle carries yet.
    spec : GridSpec
        The cells.
    count : int
        How many to draw, M.
    max_speed : float
        Largest speed of the velocity prior, m/s.
    resampling : Resampling
        How to draw cells.
    rng : numpy.random.Generator
        Source of all random numbers.

    Returns
    -------
    Particles
        M particles anywhere in their cells, with velocities from the prior; none when there is no newborn mass.
    """
    chosen = draw_indices(resampling, newborn.ravel(), count, rng)
    corner = np.stack(np.unravel_index(chosen, spec.shape), axis=1)
    inside = rng.random(corner.shape, np.float32)
    # Row 0 and column 0 are at the largest x and y, so places are counted backwards from there.
    position = (spec.x_max, spec.y_max) - (corner + inside) * spec.cell
    velocity = draw_velocities(len(chosen), max_speed, rng)
    return Particles(position, velocity, equal_weights(newborn, len(chosen)))


def draw_velocities(count: int, max_speed: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw velocities for things about which nothing is known except that they move.

    The heading is uniform. The speed is `max_speed` times the square of a uniform number, so that slow things are more
    frequent than fast ones: of speeds up to 25 m/s, about one in four is no faster than a pedestrian's 1.4 m/s. If
    velocities were uniform in the plane, it would be one in three hundred.

    Parameters
    ----------
    count : int
        How many to draw, M.
    max_speed : float
        The largest speed, m/s.
    rng : numpy.random.Generator
        Source of speeds and headings.

    Returns
    -------
    (M, 2) float32
        Velocities along the x and y axes, m/s.
    """
    speed = max_speed * rng.random(count, np.float32) ** 2
    heading = np.float32(2 * np.pi) * rng.random(count, np.float32)
    return np.stack([speed * np.cos(heading), speed * np.sin(heading)], axis=1)


def draw_indices(resampling: Resampling, weight: NDArray, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw indices by a resampling, and check that they are M indices from 0 to N - 1.

    Parameters
    ----------
    resampling : Resampling
        How to draw.
    weight : (N,) float
        The weights, not negative.
    count : int
        How many to draw, M.
    rng : numpy.random.Generator
        Source of random numbers.

    Returns
    -------
    (M,) int64
        What `resampling.draw` returned; empty when the weights sum to 0.
    """
    if count == 0 or not weight.any():
        return np.empty(0, np.int64)
    drawn = np.asarray(resampling.draw(weight.astype(np.float64), count, rng))
    found = f"shape {drawn.shape}, type {drawn.dtype}"
    if drawn.shape == (count,) and drawn.dtype.kind in "iu":
        if drawn.min() >= 0 and drawn.max() < len(weight):
            return drawn.astype(np.int64, copy=False)
        found = f"indices from {drawn.min()} to {drawn.max()}"
    expected = f".draw(weight, count, rng) to return {count} whole numbers from 0 to {len(weight) - 1}"
    raise ArgumentError(type(resampling).__name__, expected, found)


def equal_weights(weight: NDArray, count: int) -> NDArray[np.float64]:
    """Return equal weights, (M,), with the same sum as given ones.

    Parameters
    ----------
    weight : (...) float
        The given weights.
    count : int
        How many, M.
    """
    return np.full(count, weight.sum(dtype=np.float64) / max(count, 1))

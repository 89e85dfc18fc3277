"""What the filter believes about each cell, and the particles that carry its dynamic mass (paper, section 3.2)."""

from dataclasses import dataclass, field
from enum import IntEnum

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
        dynamic mass, or with so little that no particle represents it.
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
        Probability that each particle carries. The dynamic probability of a cell is the sum of the weights in it.
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
        P(FREE), P(STATIC), P(DYNAMIC), P(UNKNOWN) of each cell of the map; they sum to 1. Both arrays are float64 in
        the book and float32 in `fast`.
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


CERTAIN = 1 - 1e-3
"""The largest probability with which something arrives in a cell or has left it: below 1, so a scan can contradict."""


def ratio(part: NDArray, whole: NDArray) -> NDArray[np.floating]:
    """Return part / whole cell by cell, and 0 where the divisor is 0.

    Parameters
    ----------
    part, whole : (..., H, W) float
        Dividend and divisor, not negative.
    """
    out = np.zeros(np.broadcast_shapes(np.shape(part), np.shape(whole)), np.result_type(part, whole))
    return np.divide(part, whole, out=out, where=whole > 0)


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


def slow_down(particles: Particles, stop_rate: float, stop_speed: float, dt: float) -> Particles:
    """Reduce each weight to the share that keeps moving.

    A particle of speed v stops at the rate stop_rate exp(-v^2 / (2 stop_speed^2)), so after `dt` the share
    exp(-rate dt) of its weight still moves.

    Parameters
    ----------
    particles : Particles
        N particles at the start of the time step.
    stop_rate, stop_speed : float
        Rate of stopping at v = 0, 1/s, and the speed above which it falls, m/s.
    dt : float
        The time step, seconds.
    """
    speed = np.linalg.norm(particles.velocity.astype(np.float64), axis=1)
    rate = stop_rate * np.exp(-(speed**2) / (2 * stop_speed**2))
    return Particles(particles.position, particles.velocity, particles.weight * np.exp(-rate * dt))


def transform(particles: Particles, motion: PlanarMotion) -> Particles:
    """Express particles in a new frame.

    Parameters
    ----------
    particles : Particles
        N particles in the old frame.
    motion : PlanarMotion
        Pose of the new frame in the old one, metres and radians.
    """
    position = motion.to_now(particles.position.astype(np.float64))
    velocity = particles.velocity @ motion.rotation
    return Particles(position, velocity, particles.weight)

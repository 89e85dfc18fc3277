"""Particles drawn again: where dynamic mass is, and where it has just appeared (section 3.2, step 4)."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.state import Particles


@runtime_checkable
class Resampling(Protocol):
    """How indices are drawn in proportion to weights. The package's default is `SystematicResampling`.

    `resample` calls it twice per step: for the particles that continue, by their weights, and for the cells in which
    new ones appear, by their newborn mass. All that are drawn get the same weight afterwards. So index i should be
    drawn count w_i / sum(w) times on average; otherwise the filter's probabilities are biased.

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

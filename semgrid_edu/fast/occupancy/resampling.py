"""Resampling in compiled loops."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import resampling
from semgrid_edu.occupancy.resampling import Resampling, draw_indices, draw_velocities
from semgrid_edu.occupancy.state import Particles


class SystematicResampling(resampling.SystematicResampling):
    """Systematic resampling in a compiled loop."""

    def draw(self, weight: NDArray, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Draw indices. Parameters and result are those of `Resampling.draw`."""
        return systematic_resample(weight, count, rng.random())


def compiled_resampling(how: Resampling) -> Resampling:
    """Return the compiled twin of the book's resampling; any other as it is.

    Parameters
    ----------
    how : Resampling
        How indices are drawn.
    """
    return SystematicResampling() if type(how) is resampling.SystematicResampling else how


@njit(cache=True, nogil=True)
def systematic_resample(weight, count, offset):
    """Draw indices in proportion to the weights. Parameters and result are those of `systematic_resample`."""
    total = 0.0
    for w in weight:  # summed in the same order as `below`, so that both end at the same number
        total += w
    points = (np.arange(count) + offset) / count * total
    chosen = np.zeros(count + 1, np.int64)
    first, below = 0, 0.0
    for i in range(len(weight)):
        chosen[first] = i  # a weight that no point hits is overwritten by the next
        below += weight[i]
        first = _points_below(below, points, below / total * count - offset)
    for m in range(1, count):
        chosen[m] = max(chosen[m], chosen[m - 1])
    return chosen[:count]


@njit(cache=True, nogil=True)
def _points_below(weight, points, expected):
    """Return how many points are below a weight: `expected`, corrected by one if rounding made it wrong."""
    n = min(max(math.ceil(expected), 0), len(points))
    while n > 0 and points[n - 1] >= weight:
        n -= 1
    while n < len(points) and points[n] < weight:
        n += 1
    return n


def draw_again(particles: Particles, count: int, resampling: Resampling, rng: np.random.Generator) -> Particles:
    """Draw particles in proportion to their weights. Parameters and result are those of `draw_again`."""
    chosen = draw_indices(resampling, particles.weight, count, rng)
    position, velocity = (np.take(values, chosen, axis=0) for values in (particles.position, particles.velocity))
    return Particles(position, velocity, equal_weights(particles.weight, len(chosen)))


def draw_newborn(
    newborn: NDArray, spec: GridSpec, count: int, max_speed: float, resampling: Resampling, rng: np.random.Generator
) -> Particles:
    """Draw new particles in proportion to newborn mass. Parameters and result are those of `draw_newborn`."""
    chosen = draw_indices(resampling, newborn.ravel(), count, rng)
    part = rng.random((len(chosen), 2), np.float32)
    position = _positions(chosen, part, spec.shape[1], *spec.corner)
    return Particles(position, draw_velocities(len(chosen), max_speed, rng), equal_weights(newborn, len(chosen)))


@njit(cache=True, nogil=True)
def _positions(cells, part, width, x_max, y_max, cell):
    """Return positions, (M, 2), from fractions of a cell, (M, 2), counted from its corner of largest x and y."""
    position = np.empty_like(part)
    for m in range(len(cells)):
        row, col = divmod(cells[m], width)
        position[m, 0] = x_max - (row + part[m, 0]) * cell
        position[m, 1] = y_max - (col + part[m, 1]) * cell
    return position


def equal_weights(weight: NDArray, count: int) -> NDArray[np.float32]:
    """Return equal weights with the same sum as the given ones. Parameters are those of `equal_weights`."""
    return np.full(count, weight.sum(dtype=np.float64) / max(count, 1), np.float32)

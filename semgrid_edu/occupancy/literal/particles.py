"""What particles do, in plain numpy: the literal twins of `particles` and `resampling` (paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.cellwise import ratio
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.resampling import Resampling, draw_indices, draw_velocities, equal_weights
from semgrid_edu.occupancy.state import OUTSIDE, Particles, State


def cells_of_literal(position: NDArray, spec: GridSpec) -> NDArray[np.int64]:
    """Return the cell that each particle is in: the literal twin of `cells_of`.

    Parameters and result are those of `cells_of`.
    """
    rows, cols, inside = spec.cells(position)
    return np.where(inside, rows * spec.shape[1] + cols, OUTSIDE)


def weight_in_cells_literal(weight: NDArray, cells: NDArray, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Add up the weights in each cell: the literal twin of `weight_in_cells`.

    Parameters and result are those of `weight_in_cells`.
    """
    total = np.zeros(shape)
    inside = cells != OUTSIDE
    np.add.at(total, np.unravel_index(cells[inside], shape), weight[inside])
    return total


def scale_in_cells_literal(weight: NDArray, cells: NDArray, factor: NDArray) -> NDArray[np.float64]:
    """Multiply each weight by the factor of its cell: the literal twin of `scale_in_cells`.

    Parameters and result are those of `scale_in_cells`.
    """
    return np.where(cells == OUTSIDE, 0, weight * factor.ravel()[cells])


def cells_at_literal(
    particles: Particles, cells: NDArray, spec: GridSpec, time: float, fewest: float
) -> NDArray[np.int64]:
    """Return the cell in which each particle is at another time, if it is another one: the literal twin of `cells_at`.

    Parameters and result are those of `cells_at`.
    """
    path = time * particles.velocity.astype(np.float64)
    length = np.linalg.norm(path, axis=1, keepdims=True)
    stretch = np.maximum(1, ratio(np.full_like(length, fewest * spec.cell), length))
    then = cells_of_literal(particles.position + stretch * path, spec)
    return np.where(then == cells, OUTSIDE, then)


def free_beside_static(mixed: NDArray) -> NDArray[np.float64]:
    """Return how much of P(FREE) lies beside what stands: P(FREE) times the largest P(STATIC) of the four neighbours.

    This is by how much the planes of `cellwise.open_space` differ.

    Parameters
    ----------
    mixed : (4, H, W) float
        The four states.
    """
    framed = np.pad(mixed[State.STATIC], 1)
    beside_x, beside_y = np.maximum(framed[:-2], framed[2:]), np.maximum(framed[:, :-2], framed[:, 2:])
    return mixed[State.FREE] * np.maximum(beside_x[:, 1:-1], beside_y[1:-1])


def transform_literal(particles: Particles, motion: PlanarMotion) -> Particles:
    """Express particles in a new frame: the literal twin of `transform`.

    Parameters and result are those of `transform`.
    """
    position = motion.to_now(particles.position.astype(np.float64))
    return Particles(position, particles.velocity @ motion.rotation, particles.weight.astype(np.float64))


def slow_down_literal(particles: Particles, stop_rate: float, stop_speed: float, dt: float) -> Particles:
    """Keep of each weight what goes on moving: the literal twin of `slow_down`.

    A particle of speed v stops at the rate stop_rate exp(-v^2 / (2 stop_speed^2)), so after `dt` the share
    exp(-rate dt) of it still moves. Parameters and result are those of `slow_down`.
    """
    speed = np.linalg.norm(particles.velocity.astype(np.float64), axis=1)
    rate = stop_rate * np.exp(-(speed**2) / (2 * stop_speed**2))
    return Particles(particles.position, particles.velocity, particles.weight * np.exp(-rate * dt))


def fly_literal(particles: Particles, max_acceleration: float, dt: float, rng: np.random.Generator) -> Particles:
    """Let particles fly for a while, at constant velocity plus noise: the literal twin of `fly`.

    Parameters and result are those of `fly`, and so are the random numbers that are drawn.
    """
    a = max_acceleration * (2 * rng.random((len(particles), 2), np.float32).astype(np.float64) - 1)
    v = particles.velocity.astype(np.float64)
    return Particles(particles.position + v * dt + a * dt**2 / 2, v + a * dt, particles.weight)


def systematic_resample_literal(weight: NDArray, count: int, offset: float) -> NDArray[np.int64]:
    """Draw indices in proportion to the weights: the literal twin of `systematic_resample`.

    The weights lie end to end, so that index i covers the interval between two partial sums. Of `count` points, equally
    spaced, each draws the index whose interval it falls into. Parameters and result are those of `systematic_resample`.
    """
    ends = np.cumsum(weight, dtype=np.float64)
    points = (np.arange(count) + offset) / count * ends[-1]
    return np.minimum(np.searchsorted(ends, points, side="right"), len(weight) - 1)


def draw_newborn_literal(
    newborn: NDArray, spec: GridSpec, count: int, max_speed: float, resampling: Resampling, rng: np.random.Generator
) -> Particles:
    """Draw new particles in proportion to each cell's newborn mass: the literal twin of `draw_newborn`.

    Parameters and result are those of `draw_newborn`, and so are the random numbers that are drawn.
    """
    chosen = draw_indices(resampling, newborn.ravel(), count, rng)
    corner = np.stack(np.unravel_index(chosen, spec.shape), axis=1)
    position = (spec.x_max, spec.y_max) - (corner + rng.random(corner.shape, np.float32)) * spec.cell
    velocity = draw_velocities(len(chosen), max_speed, rng)
    return Particles(position.astype(np.float32), velocity, equal_weights(newborn, len(chosen)))


class SystematicResamplingLiteral:
    """Draws as `SystematicResampling` does, by `systematic_resample_literal`."""

    def draw(self, weight: NDArray, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Draw indices. Parameters and result are those of `Resampling.draw`."""
        return systematic_resample_literal(weight, count, rng.random())

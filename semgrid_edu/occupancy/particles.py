"""What many particles do at once: fly, add up in cells, be drawn anew (paper, section 3.2, steps 1 and 4)."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.motion import PlanarMotion
from semgrid_edu.occupancy.state import Particles

OUTSIDE = -1
"""The cell of a particle that has left the map."""
SLOW = np.float32(16)
"""exp(-16) is nothing in single precision beside 1: exponentials beyond needn't be computed."""


def cells_of(position: NDArray, spec: GridSpec) -> NDArray[np.int32]:
    """Return the cell that each particle is in, as an index into the flattened grid.

    Parameters
    ----------
    position : (N, 2) float
        Metres, in the frame of `spec`.
    spec : GridSpec
        The cells.

    Returns
    -------
    (N,) int32
        row * W + column; `OUTSIDE` for a particle that has left.
    """
    return _cells_of(position, spec.shape, spec.x_max, spec.y_max, spec.cell)


@njit(cache=True)
def _cells_of(position, shape, x_max, y_max, cell):
    cells = np.empty(len(position), np.int32)
    for i in range(len(position)):
        row, col = np.floor((x_max - position[i, 0]) / cell), np.floor((y_max - position[i, 1]) / cell)
        inside = 0 <= row < shape[0] and 0 <= col < shape[1]
        cells[i] = int(row) * shape[1] + int(col) if inside else OUTSIDE
    return cells


def weight_in_cells(weight: NDArray, cells: NDArray, shape: tuple[int, ...]) -> NDArray:
    """Add the weights up in each cell.

    Parameters
    ----------
    weight : (N,) float
        What each particle carries.
    cells : (N,) int
        Where it is, from `cells_of`.
    shape : (int, int)
        H, W.

    Returns
    -------
    (H, W) float32
        Summed in the order of the particles, in double precision.
    """
    return _sum_in_cells(weight, cells, math.prod(shape)).reshape(shape).astype(np.float32)


@njit(cache=True)
def _sum_in_cells(values, cells, n_cells):
    total = np.zeros(n_cells)
    for i in range(len(cells)):
        if cells[i] != OUTSIDE:
            total[cells[i]] += values[i]
    return total


def scale_in_cells(weight: NDArray, cells: NDArray, factor: NDArray) -> NDArray[np.float32]:
    """Multiply each weight by the factor, (H, W), of its cell; what is outside gets zero."""
    return _scale_in_cells(weight, cells, factor.ravel())


@njit(cache=True)
def _scale_in_cells(weight, cells, factor):
    scaled = np.zeros(len(weight), np.float32)
    for i in range(len(weight)):
        if cells[i] != OUTSIDE:
            scaled[i] = weight[i] * factor[cells[i]]
    return scaled


def fly(particles: Particles, max_acceleration: float, dt: float, rng: np.random.Generator) -> Particles:
    """Let particles fly for a while: constant velocity plus noise.

    Parameters
    ----------
    particles : Particles
    max_acceleration : float
        Largest acceleration along each axis, m/s^2: uniform up to it, constant during the flight.
    dt : float
        Seconds.
    rng : numpy.random.Generator
        Where the accelerations come from.

    Returns
    -------
    Particles
        v' = v + a dt, x' = x + v dt + a dt^2 / 2.
    """
    noise = rng.random((len(particles), 2), np.float32)
    change = np.float32(max_acceleration * dt)
    position, velocity = _fly(particles.position, particles.velocity, noise, change, np.float32(dt))
    return Particles(position, velocity, particles.weight)


@njit(cache=True)
def _fly(position, velocity, noise, max_change, dt):
    flown, faster = np.empty_like(position), np.empty_like(velocity)
    half, two = np.float32(0.5), np.float32(2)
    for i in range(len(position)):
        for k in range(2):
            change = (two * noise[i, k] - np.float32(1)) * max_change
            flown[i, k] = position[i, k] + (velocity[i, k] + half * change) * dt
            faster[i, k] = velocity[i, k] + change
    return flown, faster


def slow_down(particles: Particles, stop_rate: float, stop_speed: float, dt: float) -> Particles:
    """Keep of each weight what goes on moving: a particle of speed v stops at a rate that falls with v.

    Parameters
    ----------
    particles : Particles
    stop_rate, stop_speed : float
        Rate of stopping at v = 0, 1/s, and the speed (m/s) above which it falls.
    dt : float
        Seconds.

    Returns
    -------
    Particles
        Weights times exp(-stop_rate dt exp(-v^2 / (2 stop_speed^2))).
    """
    stops, scale = np.float32(stop_rate * dt), np.float32(0.5 / stop_speed**2)
    weight = _slow_down(particles.velocity, particles.weight, stops, scale)
    return Particles(particles.position, particles.velocity, weight)


@njit(cache=True)
def _slow_down(velocity, weight, stops, scale):
    kept = np.empty_like(weight)
    for i in range(len(weight)):
        speed2 = velocity[i, 0] * velocity[i, 0] + velocity[i, 1] * velocity[i, 1]
        slowness = speed2 * scale
        kept[i] = weight[i]
        if slowness < SLOW:
            kept[i] *= np.exp(-stops * np.exp(-slowness))
    return kept


def transform(particles: Particles, motion: PlanarMotion) -> Particles:
    """Express particles in a new frame whose pose in the old one is `motion`."""
    T = (motion.dx, motion.dy, np.cos(motion.dyaw), np.sin(motion.dyaw))
    return Particles(*_transform(particles.position, particles.velocity, *T), particles.weight)


@njit(cache=True)
def _transform(position, velocity, dx, dy, cos, sin):
    moved, turned = np.empty_like(position), np.empty_like(velocity)
    for i in range(len(position)):
        x, y = position[i, 0] - dx, position[i, 1] - dy
        vx, vy = velocity[i]
        moved[i, 0], moved[i, 1] = cos * x + sin * y, cos * y - sin * x
        turned[i, 0], turned[i, 1] = cos * vx + sin * vy, cos * vy - sin * vx
    return moved, turned


def velocity_moments(
    particles: Particles, cells: NDArray, shape: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return mean and covariance of the velocities in each cell, weighed by what each particle carries.

    Parameters
    ----------
    particles : Particles
    cells : (N,) int
        The cell of each, from `cells_of`.
    shape : (int, int)
        H, W of the map.

    Returns
    -------
    mean : (2, H, W) float32
        sum(w v) / sum(w), along the axes of the map, m/s; NaN where no particle is.
    covariance : (2, 2, H, W) float32
        sum(w (v - mean) (v - mean)^T) / sum(w), m^2/s^2; zero for a single particle, NaN where none is.
    """
    mean, spread = _moments(particles.velocity, particles.weight, cells, math.prod(shape))
    return mean.T.reshape(2, *shape).copy(), spread.T[[[0, 1], [1, 2]]].reshape(2, 2, *shape)


@njit(cache=True, error_model="numpy")
def _moments(velocity, weight, cells, n_cells):
    total, mean, spread = np.zeros((n_cells, 1)), np.zeros((n_cells, 2)), np.zeros((n_cells, 3))
    for i in range(len(cells)):
        if cells[i] != OUTSIDE:
            w = np.float64(weight[i])
            total[cells[i], 0] += w
            mean[cells[i], 0] += w * velocity[i, 0]
            mean[cells[i], 1] += w * velocity[i, 1]
    mean /= total
    for i in range(len(cells)):
        if cells[i] != OUTSIDE:
            x, y = velocity[i, 0] - mean[cells[i], 0], velocity[i, 1] - mean[cells[i], 1]
            spread[cells[i], 0] += weight[i] * x * x
            spread[cells[i], 1] += weight[i] * x * y
            spread[cells[i], 2] += weight[i] * y * y
    return mean.astype(np.float32), (spread / total).astype(np.float32)


def turn_moments(mean: NDArray, covariance: NDArray, motion: PlanarMotion) -> tuple[NDArray, NDArray]:
    """Express mean (2, H, W) and covariance (2, 2, H, W) in the axes of a frame whose pose is `motion`: R^T C R."""
    R = motion.rotation.astype(mean.dtype)
    half_turned = np.einsum("ij,ikhw->jkhw", R, covariance)
    return np.einsum("ij,ihw->jhw", R, mean), np.einsum("jkhw,kl->jlhw", half_turned, R)


@njit(cache=True)
def systematic_resample(weight, count, offset):
    """Draw `count` indices in proportion to the weights, by systematic resampling.

    The weights are laid end to end and cut at `count` points, equally spaced, that one random offset
    places: index i is drawn floor or ceil of count w_i / sum(w) times. For count = N this is
    `filterpy.monte_carlo.systematic_resample`, which takes its offset from numpy's global generator;
    here it is an argument, so that a seed decides it.

    Parameters
    ----------
    weight : (N,) float
        Not negative, not all zero; they need not sum to 1.
    count : int
        How many to draw, M.
    offset : float
        In [0, 1).

    Returns
    -------
    (M,) int64
        Ascending.

    Examples
    --------
    >>> systematic_resample(np.array([0.1, 0.6, 0.3]), 4, 0.5)
    array([1, 1, 1, 2])
    """
    total = 0.0
    for w in weight:
        total += w
    chosen = np.empty(count, np.int64)
    last, below = 0, float(weight[0])
    for m in range(count):
        at = (m + offset) / count * total
        while below <= at and last < len(weight) - 1:
            last += 1
            below += weight[last]
        chosen[m] = last
    return chosen


def draw_velocities(count: int, max_speed: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw velocities of things of which nothing is known but that they move.

    Any heading; the speed is the square of a uniform number, so that slow is more frequent than fast and
    one in four is no faster than a pedestrian (uniform in the plane, it would be one in two hundred).

    Parameters
    ----------
    count : int
        M.
    max_speed : float
        m/s.
    rng : numpy.random.Generator

    Returns
    -------
    (M, 2) float32
        m/s.
    """
    speed = max_speed * rng.random(count, np.float32) ** 2
    heading = np.float32(2 * np.pi) * rng.random(count, np.float32)
    return np.stack([speed * np.cos(heading), speed * np.sin(heading)], axis=1)

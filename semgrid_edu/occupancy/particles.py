"""What particles do: add up in cells, fly, slow down, turn with the map (section 3.2, steps 1 and 2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import OUTSIDE, Particles


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

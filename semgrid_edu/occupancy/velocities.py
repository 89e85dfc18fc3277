"""Mean and covariance of the velocities in each cell (paper, section 3.2)."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.occupancy.motion import PlanarMotion
from semgrid_edu.occupancy.particles import OUTSIDE
from semgrid_edu.occupancy.state import Particles


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
    turned = np.einsum("jkhw,kl->jlhw", np.einsum("ij,ikhw->jkhw", R, covariance), R)
    turned[1, 0] = turned[0, 1]  # rounded differently
    return np.einsum("ij,ihw->jhw", R, mean), turned

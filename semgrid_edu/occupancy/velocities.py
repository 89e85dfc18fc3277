"""Mean and covariance of the velocities in each cell (paper, section 3.2)."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.occupancy.cells import OUTSIDE
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import Particles


def velocity_moments(
    particles: Particles, cells: NDArray, shape: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return mean and covariance of the velocities in each cell, weighted by the weights of the particles.

    Parameters
    ----------
    particles : Particles
        N particles on the map.
    cells : (N,) int
        The cell of each particle, from `cells_of`.
    shape : (int, int)
        H, W of the map.

    Returns
    -------
    mean : (2, H, W) float32
        sum(w v) / sum(w), along the axes of the map, m/s; NaN in cells without particles.
    covariance : (2, 2, H, W) float32
        sum(w (v - mean) (v - mean)^T) / sum(w), m^2/s^2; zero for a single particle, NaN in cells without particles.
    """
    mean, covariance = _moments(particles.velocity, particles.weight, cells, math.prod(shape))
    return mean.reshape(2, *shape), covariance.reshape(2, 2, *shape)


@njit(cache=True, nogil=True, error_model="numpy")
def _moments(velocity, weight, cells, n_cells):
    first, second = np.zeros((n_cells, 3)), np.zeros((n_cells, 3))
    for i in range(len(cells)):
        c = cells[i]
        if c != OUTSIDE:
            w = np.float64(weight[i])
            first[c, 0] += w
            first[c, 1] += w * velocity[i, 0]
            first[c, 2] += w * velocity[i, 1]
    for c in range(n_cells):
        first[c, 1] /= first[c, 0]
        first[c, 2] /= first[c, 0]
    for i in range(len(cells)):
        c = cells[i]
        if c != OUTSIDE:
            x, y = velocity[i, 0] - first[c, 1], velocity[i, 1] - first[c, 2]
            second[c, 0] += weight[i] * x * x
            second[c, 1] += weight[i] * x * y
            second[c, 2] += weight[i] * y * y
    mean, covariance = np.empty((2, n_cells), np.float32), np.empty((2, 2, n_cells), np.float32)
    for c in range(n_cells):
        mean[0, c], mean[1, c] = first[c, 1], first[c, 2]
        covariance[0, 0, c], covariance[1, 1, c] = second[c, 0] / first[c, 0], second[c, 2] / first[c, 0]
        covariance[0, 1, c] = covariance[1, 0, c] = second[c, 1] / first[c, 0]
    return mean, covariance


def turn_moments(mean: NDArray, covariance: NDArray, motion: PlanarMotion) -> tuple[NDArray, NDArray]:
    """Express moments of velocity in the axes of another frame: R^T mean, R^T C R.

    Parameters
    ----------
    mean : (2, H, W) float32
        Mean velocity along the axes of one frame, m/s.
    covariance : (2, 2, H, W) float32
        Covariance of the velocity along the same axes, m^2/s^2.
    motion : PlanarMotion
        Pose of the other frame in that one; R is its rotation.

    Returns
    -------
    mean : (2, H, W) float32
        Mean velocity along the axes of the other frame, m/s.
    covariance : (2, 2, H, W) float32
        Covariance along the same axes, m^2/s^2, symmetric to the last bit.
    """
    R = motion.rotation.astype(mean.dtype)
    turned = np.einsum("jkhw,kl->jlhw", np.einsum("ij,ikhw->jkhw", R, covariance), R)
    turned[1, 0] = turned[0, 1]  # rounded differently
    return np.einsum("ij,ihw->jhw", R, mean), turned

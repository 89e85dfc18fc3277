"""From the scrolling map to the vehicle's cells: what a scan says of both, and the belief handed out (section 3.2)."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence, Sensor, evidence_of, take_scan
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up
from semgrid_edu.occupancy.state import OUTSIDE, Belief, FilterState, Particles, State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN, update
from semgrid_edu.occupancy.world import WorldModel


class Observation(NamedTuple):
    """A scan, as a step of a filter uses it.

    Parameters
    ----------
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    on_map : Evidence
        What the scan says of the cells of the map, (H, W).
    in_grid : Evidence
        What the scan says of the cells of the grid around the vehicle, (H', W').
    """

    pose: PlanarMotion
    on_map: Evidence
    in_grid: Evidence


def observe(
    sensor: Sensor, points_grid: NDArray, pose: PlanarMotion, map_spec: GridSpec, spec: GridSpec
) -> Observation:
    """Ask the sensor what a scan says of the cells of the map, and of those around the vehicle.

    Parameters
    ----------
    sensor : Sensor
        Turns the scan into evidence.
    points_grid : (N, 3+) float
        The scan: x forward, y left, z above the ground (m), in the grid frame of the vehicle now.
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    map_spec, spec : GridSpec
        The cells of the map, (H, W), and those of the grid around the vehicle, (H', W').
    """
    measurement = take_scan(sensor, points_grid)
    in_grid = evidence_of(measurement, spec, PlanarMotion())
    return Observation(pose, evidence_of(measurement, map_spec, pose), in_grid)


def local_belief(
    predicted: NDArray,
    velocity: tuple[NDArray, NDArray],
    seen: Observation,
    map_spec: GridSpec,
    spec: GridSpec,
    world: WorldModel,
) -> Belief:
    """Look the map up in the vehicle's cells, and update those with the scan; nothing of this goes back to the map.

    The vehicle's cells don't coincide with the map's. Updating them with evidence of their own puts each return into
    the very cell that it hit, however the vehicle is turned in the map.

    Parameters
    ----------
    predicted : (4, H, W) float32
        The belief over the map before the scan.
    velocity : (2, H, W) and (2, 2, H, W) float32
        Mean and covariance of the velocity over the map, given the scan, along the axes of the map, m/s and m^2/s^2;
        NaN where nothing moves.
    seen : Observation
        The scan in the vehicle's cells, and the pose of the vehicle in the map.
    map_spec, spec : GridSpec
        The cells of the map, (H, W), and those of the vehicle, (H', W').
    world : WorldModel
        What `update` assumes.
    """
    here = look_up(predicted, NOTHING_KNOWN, map_spec, spec, seen.pose)
    prior = FilterState(here, Particles.none(), np.zeros(spec.shape, np.float32))
    probability = update(prior, spec, seen.in_grid, world).probability
    mean, covariance = velocity
    moments = np.concatenate([mean, covariance.reshape(4, *map_spec.shape)])
    moments = look_up(moments, np.full(6, np.nan, np.float32), map_spec, spec, seen.pose)
    moments[:, probability[State.DYNAMIC] == 0] = np.nan
    return Belief(probability, *turn_moments(moments[:2], moments[2:].reshape(2, 2, *spec.shape), seen.pose))


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
    """Add up in double precision, and twice: the covariance from differences to the mean, which keep their digits."""
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

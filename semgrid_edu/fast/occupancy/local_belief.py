"""The belief that the filter returns, in compiled loops and single precision."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgrid_edu.fast.occupancy.planar_motion import look_up
from semgrid_edu.fast.occupancy.sensor import SensorModel, compiled_twin
from semgrid_edu.fast.occupancy.steps import NOTHING_KNOWN, update
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Sensor, evidence_of, take_scan
from semgrid_edu.occupancy.local_belief import Observation, turn_moments
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import OUTSIDE, Belief, FilterState, Particles, State
from semgrid_edu.occupancy.world import WorldModel


def observe(
    sensor: Sensor, points_grid: NDArray, pose: PlanarMotion, map_spec: GridSpec, spec: GridSpec
) -> Observation:
    """Ask the sensor's compiled twin about the cells of the map, and about those around the vehicle.

    Parameters are those of `observe`.
    """
    sensor = compiled_twin(sensor)
    measurement = sensor.scan(points_grid) if type(sensor) is SensorModel else take_scan(sensor, points_grid)
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
    """Look up the map at the vehicle's cells and update them. Parameters are those of `local_belief`."""
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

    Parameters and result are those of `velocity_moments`; the result is float32.
    """
    mean, covariance = _moments(particles.velocity, particles.weight, cells, math.prod(shape))
    return mean.reshape(2, *shape), covariance.reshape(2, 2, *shape)


@njit(cache=True, nogil=True, error_model="numpy")
def _moments(velocity, weight, cells, n_cells):
    """Sum in double precision, in two passes: the covariance from differences to the mean, to keep its digits."""
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

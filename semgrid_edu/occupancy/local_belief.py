"""From the scrolling map to the vehicle's cells: what a scan tells about both, and the final belief (section 3.2)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence, Sensor, evidence_of, take_scan
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up
from semgrid_edu.occupancy.state import OUTSIDE, Belief, FilterState, Particles, State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN, update
from semgrid_edu.occupancy.world import WorldModel


class Observation(NamedTuple):
    """What a scan tells a filter in one step.

    Parameters
    ----------
    pose : PlanarMotion
        Pose of the vehicle in the frame of the map, metres and radians.
    on_map : Evidence
        What the scan tells about the cells of the map, (H, W).
    in_grid : Evidence
        What the scan tells about the cells of the grid around the vehicle, (H', W').
    """

    pose: PlanarMotion
    on_map: Evidence
    in_grid: Evidence


def observe(
    sensor: Sensor, points_grid: NDArray, pose: PlanarMotion, map_spec: GridSpec, spec: GridSpec
) -> Observation:
    """Ask the sensor what a scan tells about the cells of the map, and about those around the vehicle.

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

    The vehicle's cells don't coincide with the map's. Because they are updated with evidence on their own grid, each
    return counts for the very cell that it hit, however the vehicle is turned in the map.

    Parameters
    ----------
    predicted : (4, H, W) float
        The belief on the map before the scan.
    velocity : (2, H, W) and (2, 2, H, W) float
        Mean and covariance of the velocity on the map, given the scan, along the axes of the map, m/s and m^2/s^2;
        NaN where nothing moves.
    seen : Observation
        The scan in the vehicle's cells, and the pose of the vehicle in the map.
    map_spec, spec : GridSpec
        The cells of the map, (H, W), and those of the vehicle, (H', W').
    world : WorldModel
        What `update` assumes.
    """
    here = look_up(predicted, NOTHING_KNOWN, map_spec, spec, seen.pose)
    prior = FilterState(here, Particles.none(), np.zeros(spec.shape))
    probability = update(prior, spec, seen.in_grid, world).probability.astype(np.float32)
    mean, covariance = velocity
    moments = np.concatenate([mean, covariance.reshape(4, *map_spec.shape)]).astype(np.float32)
    moments = look_up(moments, np.full(6, np.nan, np.float32), map_spec, spec, seen.pose)
    moments[:, probability[State.DYNAMIC] == 0] = np.nan
    return Belief(probability, *turn_moments(moments[:2], moments[2:].reshape(2, 2, *spec.shape), seen.pose))


def velocity_moments(
    particles: Particles, cells: NDArray, shape: tuple[int, int]
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
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
    mean : (2, H, W) float64
        sum(w v) / sum(w), along the axes of the map, m/s; NaN in cells without particles.
    covariance : (2, 2, H, W) float64
        sum(w (v - mean) (v - mean)^T) / sum(w), m^2/s^2; zero for a single particle, NaN in cells without particles.
    """
    n_cells = shape[0] * shape[1]
    inside = cells != OUTSIDE
    cell = cells[inside]
    weight = particles.weight[inside].astype(np.float64)
    velocity = particles.velocity[inside].astype(np.float64)

    def average(values: NDArray) -> NDArray[np.float64]:
        return np.bincount(cell, weight * values, n_cells) / total

    with np.errstate(invalid="ignore"):  # 0 / 0 is NaN, as it should be in cells without particles
        total = np.bincount(cell, weight, n_cells)
        mean = np.stack([average(velocity[:, 0]), average(velocity[:, 1])])
        dx, dy = velocity.T - mean[:, cell]
        covariance = np.stack([average(dx * dx), average(dx * dy), average(dx * dy), average(dy * dy)])
    return mean.reshape(2, *shape), covariance.reshape(2, 2, *shape)


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

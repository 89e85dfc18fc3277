"""From the map to the vehicle's own cells: the belief that a filter hands out (paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.moving_map import look_up
from semgrid_edu.occupancy.observation import Observation
from semgrid_edu.occupancy.state import Belief, FilterState, Particles, State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN, update
from semgrid_edu.occupancy.velocities import turn_moments
from semgrid_edu.occupancy.world import WorldModel


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

    Returns
    -------
    Belief
        What is handed out: the belief in the vehicle's cells, (H', W'), in its grid frame.
    """
    here = look_up(predicted, NOTHING_KNOWN, map_spec, spec, seen.pose)
    prior = FilterState(here, Particles.none(), np.zeros(spec.shape, np.float32))
    probability = update(prior, spec, seen.in_grid, world).probability
    mean, covariance = velocity
    moments = np.concatenate([mean, covariance.reshape(4, *map_spec.shape)])
    here = look_up(moments, np.full(6, np.nan, np.float32), map_spec, spec, seen.pose)
    here[:, probability[State.DYNAMIC] == 0] = np.nan
    return Belief(probability, *turn_moments(here[:2], here[2:].reshape(2, 2, *spec.shape), seen.pose))

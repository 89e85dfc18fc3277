"""From the map to the vehicle's own cells: the belief that a tracker hands out (paper, section 3.2)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.moving_map import look_up
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import Belief, FilterState, Particles, State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN, update
from semgrid_edu.occupancy.velocities import turn_moments
from semgrid_edu.occupancy.world import WorldModel


def local_belief(
    predicted: NDArray,
    velocity: tuple[NDArray, NDArray],
    evidence: Evidence,
    map_spec: GridSpec,
    spec: GridSpec,
    pose: PlanarMotion,
    world: WorldModel,
) -> Belief:
    """Look the map up in the vehicle's cells, and update those with the scan once more; nothing of it goes back.

    So returns lie in the very cells that they hit, however the vehicle is turned in the map.

    Parameters
    ----------
    predicted : (4, H, W) float32
        The belief over the map before the scan.
    velocity : (2, H, W) and (2, 2, H, W) float32
        Mean and covariance over the map given the scan, m/s and m^2/s^2, NaN where nothing moves.
    evidence : Evidence
        Of the scan in the vehicle's cells, (H', W').
    map_spec, spec : GridSpec
        The map's cells and the vehicle's.
    pose : PlanarMotion
        Of the vehicle in the map.
    world : WorldModel
        What `update` assumes.

    Returns
    -------
    Belief
        In the grid frame of the vehicle.
    """
    here = look_up(predicted, NOTHING_KNOWN, map_spec, spec, pose)
    prior = FilterState(here, Particles.none(), np.zeros(spec.shape, np.float32))
    probability = update(prior, spec, evidence, world).probability
    mean, covariance = velocity
    moments = np.concatenate([mean, covariance.reshape(4, *map_spec.shape)])
    here = look_up(moments, np.full(6, np.nan, np.float32), map_spec, spec, pose)
    here[:, probability[State.DYNAMIC] == 0] = np.nan
    return Belief(probability, *turn_moments(here[:2], here[2:].reshape(2, 2, *spec.shape), pose))

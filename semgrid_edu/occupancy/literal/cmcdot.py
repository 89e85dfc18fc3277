"""CMCDOT's four steps in plain numpy, formula by formula: the literal twins of `steps` (section 3.2).

All arrays over cells are (H, W), or (4, H, W) in the order of `State`, in double precision. The fast twins do the same
in compiled loops and single precision; property tests hold the two equal.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.cellwise import ratio
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.literal.bof import clear_wakes_literal, relative_likelihoods, strike_out
from semgrid_edu.occupancy.literal.particles import (
    SystematicResamplingLiteral,
    cells_at_literal,
    cells_of_literal,
    draw_newborn_literal,
    fly_literal,
    free_beside_static,
    scale_in_cells_literal,
    slow_down_literal,
    transform_literal,
    weight_in_cells_literal,
)
from semgrid_edu.occupancy.particles import keeps_pace
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.resampling import SystematicResampling, draw_again
from semgrid_edu.occupancy.state import OUTSIDE, FilterState, Particles, State
from semgrid_edu.occupancy.world import HALT, CmcdotParams, WorldModel, transition_matrix

FREE, STATIC, DYNAMIC, UNKNOWN = State


def move_literal(state: FilterState, spec: GridSpec, motion: PlanarMotion) -> FilterState:
    """Step 1, move: each new cell looks up its old one, and particles are moved exactly. The literal twin of `move`.

    Particles decide how much of a cell is DYNAMIC: P(DYNAMIC) is the sum of their weights, at most 1, and the other
    states share the rest in their old proportions. Parameters, result and errors are those of `move`.
    """
    check_shape("state", state.newborn, spec.shape)
    probability = look_up_literal(state.probability, spec, motion)
    particles = transform_literal(state.particles, motion)
    cells = cells_of_literal(particles.position, spec)
    claimed = weight_in_cells_literal(particles.weight, cells, spec.shape)
    dynamic = np.minimum(claimed, 1)
    others = probability[FREE] + probability[STATIC] + probability[UNKNOWN]
    probability = probability * ratio(1 - dynamic, others)
    probability[DYNAMIC] = dynamic
    probability[UNKNOWN] += np.where(others > 0, 0, 1 - dynamic)
    weight = scale_in_cells_literal(particles.weight, cells, ratio(dynamic, claimed))
    return FilterState(probability, replace(particles, weight=weight), state.newborn)


def look_up_literal(probability: NDArray, spec: GridSpec, motion: PlanarMotion) -> NDArray[np.float64]:
    """Give each new cell the belief of the old cell that its centre lies in; what enters the map is UNKNOWN.

    Parameters
    ----------
    probability : (4, H, W) float
        The belief in the old frame.
    spec : GridSpec
        The cells, the same in both frames.
    motion : PlanarMotion
        The new frame in the old one, metres and radians.

    Returns
    -------
    (4, H, W) float64
        The belief in the new frame.
    """
    rows, cols, inside = spec.cells(motion.to_previous(spec.centers().reshape(-1, 2)))
    entering = np.eye(4)[UNKNOWN][:, None]
    return np.where(inside, probability[:, rows, cols], entering).reshape(4, *spec.shape)


def predict_literal(
    state: FilterState, spec: GridSpec, world: WorldModel, dt: float, rng: np.random.Generator, driven: float = 0.0
) -> FilterState:
    """Step 2, predict: cells mix, particles fly, and collide with what is there. The literal twin of `predict`.

    Parameters, result and errors are those of `predict`, and so are the random numbers that are drawn.
    """
    check_shape("state", state.newborn, spec.shape)
    M = transition_matrix(world, dt)
    particles = slow_down_literal(state.particles, world.stop_rate, world.stop_speed, dt)
    particles = replace(particles, weight=particles.weight * M[DYNAMIC, DYNAMIC])
    start = cells_of_literal(particles.position, spec)
    going = weight_in_cells_literal(particles.weight, start, spec.shape)
    mixed, newborn = mix_literal(state.probability, state.newborn, going, M)

    particles = fly_literal(particles, world.max_acceleration, dt, rng)
    end = cells_of_literal(particles.position, spec)
    time, fewest = world.clearing_time, world.clearing_cells
    back, halt, ahead = (cells_at_literal(particles, end, spec, part * time, fewest) for part in (-1, -HALT, 1))
    keeps = keeps_pace(*particles.velocity.astype(np.float64).T, world.pace(driven, dt, spec.cell))
    doubt = scale_in_cells_literal(particles.weight, back, mixed[STATIC])
    doubt = np.maximum(doubt, scale_in_cells_literal(keeps * particles.weight, halt, mixed[STATIC]))
    beside = scale_in_cells_literal(keeps * doubt, ahead, free_beside_static(mixed))
    doubt = doubt - scale_in_cells_literal(doubt, ahead, mixed[FREE] + mixed[DYNAMIC]) + beside
    came = np.where((end != start) & (end != OUTSIDE), end + going.size, end)  # the second of two planes of cells
    stays, arrives = weight_in_cells_literal(particles.weight, came, (2, *spec.shape))
    doubtful = weight_in_cells_literal(doubt, came, (2, *spec.shape))[1]
    probability, newborn, factor, less = collide_literal(mixed, newborn, going, stays, arrives, doubtful)
    weight = scale_in_cells_literal(particles.weight, came, factor) - scale_in_cells_literal(doubt, came, less)
    return FilterState(probability, replace(particles, weight=weight), newborn)


def mix_literal(
    probability: NDArray, newborn: NDArray, going: NDArray, M: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mix the states of each cell by the transition matrix: the literal twin of `cellwise.mix`.

    P(j) = sum_i M[i, j] P(i). Of the dynamic mass that particles carry, `going` is the part that still moves after the
    matrix and after some has stopped; what has stopped is STATIC. Parameters and result are those of `mix`.
    """
    mixed = np.einsum("ij,ihw->jhw", M, probability)
    carried = M[DYNAMIC, DYNAMIC] * (probability[DYNAMIC] - newborn.astype(np.float64))
    born = mixed[DYNAMIC] - carried
    mixed[STATIC] += np.maximum(carried - going, 0)
    mixed[DYNAMIC] = born + going
    return mixed, born


def collide_literal(
    mixed: NDArray, newborn: NDArray, going: NDArray, stays: NDArray, arrives: NDArray, doubtful: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Let the mass that arrives in a cell collide with what the cell holds: the literal twin of `cellwise.collide`.

    Two combinations are struck out (`strike_out`): "something arrives in a cell that is STATIC", and "something comes
    out of a wall and goes on along it, in a cell that hasn't been seen to be free". Parameters and result are those of
    `collide`.
    """
    vacated = going - stays
    own, sure, less = strike_out(mixed[STATIC], arrives, mixed[UNKNOWN] + vacated, doubtful)
    probability = own * mixed
    probability[FREE] += own * vacated  # what flew away leaves free space behind
    probability[DYNAMIC] = own * (newborn + stays) + sure * arrives - less * doubtful
    return probability, own * newborn, np.stack([own, sure]), np.stack([0 * less, less])


def update_literal(state: FilterState, spec: GridSpec, evidence: Evidence, world: WorldModel) -> FilterState:
    """Step 3, update by Bayes' rule: P(state | z) = P(z | state) P(state) / P(z). The literal twin of `update`.

    Parameters, result and errors are those of `update`.
    """
    check_shape("state", state.newborn, spec.shape)
    check_shape("evidence", evidence.free, spec.shape)
    prior = initialise_unknown_literal(state, evidence.occupied != evidence.free, world)
    of_occupied, of_free = relative_likelihoods(evidence)
    joint = np.stack([of_free, of_occupied, of_occupied, of_free]) * prior.probability
    p_z = joint.sum(axis=0)
    posterior = ratio(joint, p_z)
    posterior[UNKNOWN] += p_z == 0  # nothing that was held possible explains the scan
    factor = ratio(of_occupied, p_z)
    cells = cells_of_literal(state.particles.position, spec)
    weight = scale_in_cells_literal(state.particles.weight, cells, factor)
    origin = cells_at_literal(state.particles, cells, spec, -world.clearing_time, world.clearing_cells)
    left = weight_in_cells_literal(weight, origin, spec.shape)
    static = clear_wakes_literal(posterior[STATIC], left, evidence.occupied == evidence.free)
    posterior[FREE], posterior[STATIC] = posterior[FREE] + posterior[STATIC] - static, static
    return FilterState(posterior, replace(state.particles, weight=weight), prior.newborn * factor)


def initialise_unknown_literal(state: FilterState, seen: NDArray, world: WorldModel) -> FilterState:
    """Share the UNKNOWN mass of cells that are seen among the other states: the twin of `initialise_unknown`.

    Parameters and result are those of `initialise_unknown`.
    """
    probability = state.probability.astype(np.float64)
    unknown = np.where(seen, probability[UNKNOWN], 0)
    for i in (FREE, STATIC, DYNAMIC):
        probability[i] += world.first_sight[i] * unknown
    probability[UNKNOWN] -= unknown
    return FilterState(probability, state.particles, state.newborn + world.first_sight[DYNAMIC] * unknown)


def resample_literal(state: FilterState, spec: GridSpec, params: CmcdotParams, rng: np.random.Generator) -> FilterState:
    """Step 4, resample: draw particles where dynamic mass is, known and newborn. The literal twin of `resample`.

    Then each cell's weights are scaled to its dynamic probability; where no particle was drawn, that turns UNKNOWN.
    Parameters, result and errors are those of `resample`, and so are the random numbers that are drawn.
    """
    check_shape("state", state.newborn, spec.shape)
    births, how = round(params.birth_share * params.n_particles), params.resampling
    how = SystematicResamplingLiteral() if isinstance(how, SystematicResampling) else how
    old = draw_again(state.particles, params.n_particles - births, how, rng)
    new = draw_newborn_literal(state.newborn, spec, births, params.max_speed, how, rng)
    position, velocity = np.vstack([old.position, new.position]), np.vstack([old.velocity, new.velocity])
    weight, cells = np.append(old.weight, new.weight), cells_of_literal(position, spec)
    carried = weight_in_cells_literal(weight, cells, spec.shape)
    probability = state.probability.astype(np.float64)
    dynamic = probability[DYNAMIC].copy()
    probability[DYNAMIC] = np.where(carried > 0, dynamic, 0)
    probability[UNKNOWN] += np.where(carried > 0, 0, dynamic)
    weight = scale_in_cells_literal(weight, cells, ratio(dynamic, carried))
    return FilterState(probability, Particles(position, velocity, weight), np.zeros(spec.shape))

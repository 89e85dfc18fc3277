"""CMCDOT's four steps, each a pure function: move, predict, update, resample (paper, section 3.2).

Each refuses a state, or evidence, over cells other than `spec`.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.cellwise import bayes, clear_wakes, collide, mix, renormalise, rescale_weights
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.particles import (
    by_origin,
    cells_at,
    cells_of,
    doubt_arrivals,
    fly,
    scale_in_cells,
    slow_down,
    transform,
    weight_in_cells,
)
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up
from semgrid_edu.occupancy.resampling import draw_again, draw_newborn
from semgrid_edu.occupancy.state import FilterState, Particles, State
from semgrid_edu.occupancy.world import CmcdotParams, WorldModel, transition_matrix

FREE, STATIC, DYNAMIC, UNKNOWN = State

NOTHING_KNOWN = np.array([0, 0, 0, 1], dtype=np.float32)
"""The four probabilities of a cell of which nothing is known: all UNKNOWN."""


def move(state: FilterState, spec: GridSpec, motion: PlanarMotion) -> FilterState:
    """Step 1: express the belief in a new frame.

    Each new cell takes the belief of the old cell that its centre lies in, so a shift by whole cells is exact. What
    enters the map is UNKNOWN. Particles are moved exactly, and dynamic mass goes where they go.

    Parameters
    ----------
    state : FilterState
        The belief in the old frame, without newborn mass.
    spec : GridSpec
        The cells, (H, W), the same in both frames.
    motion : PlanarMotion
        Pose of the new frame in the old one, metres and radians.
    """
    check_shape("state", state.newborn, spec.shape)
    probability = look_up(state.probability, NOTHING_KNOWN, spec, spec, motion)
    particles = transform(state.particles, motion)
    cells = cells_of(particles.position, spec)
    probability, factor = renormalise(probability, weight_in_cells(particles.weight, cells, spec.shape))
    weight = scale_in_cells(particles.weight, cells, factor)
    return FilterState(probability, replace(particles, weight=weight), state.newborn)


def predict(
    state: FilterState, spec: GridSpec, world: WorldModel, dt: float, rng: np.random.Generator, driven: float = 0.0
) -> FilterState:
    """Step 2: predict what becomes of the belief while `dt` seconds pass without a scan.

    First each cell mixes by the transition matrix, and particles near zero speed become STATIC. Then the particles fly,
    and dynamic mass with them. Where it leaves, it leaves FREE behind, because nothing stands where something has moved
    away. Where it arrives with probability a, two statements meet: "something arrives", and what the cell itself holds.
    Some of their combinations can't be true, and are struck out of the joint distribution.

    - *It arrives, and the cell is STATIC.* Two solid things can't share a cell.
    - *It comes out of a wall and goes on along it, and the cell hasn't been seen to be free.* A particle does so when
      the place where it was `clearing_time` ago is STATIC now, and the place where it will be after `clearing_time` is
      STATIC or UNKNOWN. (Slow particles are followed over `clearing_cells` instead.) Such an arrival may be nothing but
      the next piece of the wall that comes into view. A pedestrian who sets off also comes out of a place where
      something stood, but walks into free space; and where the side of a long vehicle comes from, the vehicle moves.

    Many walls are ragged or porous, such as a hedge. As the vehicle drives on, it looks into one gap after another, so
    what it glimpses there seems to travel with the vehicle: what keeps pace with it beside a wall is probably the next
    piece of the wall. So more is doubted of a particle that keeps pace (`keeps_pace`): it comes out of a wall also if
    it has come past one, at the `HALT` on its way; and it goes on along a wall also where the place ahead is FREE
    beside something STATIC (`open_space`). To a vehicle that stands nothing of this applies.

    Let s and d be the cell's own static and dynamic probability, u the probability that it is UNKNOWN or that something
    has just left it, and b the part of a that comes out of a wall and goes on along it. What is left is

        P(DYNAMIC) = [a (1 - s) - b u + (1 - a) d] / (1 - a s - b u),   others = (1 - a) others / (1 - a s - b u)

    So what arrives in free space is DYNAMIC, a fence that is known to stand stays STATIC although particles cross it,
    and so does a wall that comes into view piece by piece.

    Parameters
    ----------
    state : FilterState
        The belief at the previous instant.
    spec : GridSpec
        The cells, (H, W).
    world : WorldModel
        Rates of change, how things stop, how they accelerate, and how soon they have left a place.
    dt : float
        Time since the previous instant, seconds, not negative.
    rng : numpy.random.Generator
        Source of the particles' accelerations.
    driven : float
        How far the vehicle has driven along the x axis since the previous instant, metres; negative backwards.
    """
    check_shape("state", state.newborn, spec.shape)
    M = transition_matrix(world, dt)
    before = cells_of(state.particles.position, spec)
    particles = slow_down(state.particles, world.stop_rate, world.stop_speed, dt)
    particles = replace(particles, weight=particles.weight * np.float32(M[DYNAMIC, DYNAMIC]))
    going = weight_in_cells(particles.weight, before, spec.shape)
    mixed, newborn = mix(state.probability, state.newborn, going, M)

    particles = fly(particles, world.max_acceleration, dt, rng)
    cells = cells_of(particles.position, spec)
    came = by_origin(before, cells, going.size)
    time, fewest = world.clearing_time, world.clearing_cells
    origin, ahead = (cells_at(particles, cells, spec, way * time, fewest) for way in (-1, 1))
    doubt = scale_in_cells(particles.weight, origin, mixed[STATIC])
    pace = world.pace(driven, dt, spec.cell)
    if pace.matters:
        doubt = doubt_arrivals(particles, cells, doubt, ahead, mixed, spec, pace)
    else:
        doubt -= scale_in_cells(doubt, ahead, mixed[FREE] + mixed[DYNAMIC])
    stays, arrives = weight_in_cells(particles.weight, came, (2, *spec.shape))
    doubtful = weight_in_cells(doubt, came, (2, *spec.shape))[1]
    probability, newborn, factor, less = collide(mixed, newborn, going, stays, arrives, doubtful)
    weight = scale_in_cells(particles.weight, came, factor) - scale_in_cells(doubt, came, less)
    return FilterState(probability, replace(particles, weight=np.maximum(weight, 0)), newborn)


def update(state: FilterState, spec: GridSpec, evidence: Evidence, world: WorldModel) -> FilterState:
    """Step 3: update each cell by Bayes' rule, P(state | z) = P(z | state) P(state) / P(z).

    STATIC and DYNAMIC share P(z | occupied), because one scan can't tell them apart. UNKNOWN means that no scan has
    said anything of the cell; as soon as one does, `initialise_unknown` shares its UNKNOWN mass among the others.

    A scan says nothing about a hidden cell, but what moves does: one thing can't be in two places. Where a thing was
    `clearing_time` ago (or, if it is slow, `clearing_cells` back) it isn't any more. So "it has come from there" and
    "it stands there" can't both be true, and this combination is struck out (`clear_wakes`). In this way the place of a
    car that was believed to be standing becomes free when the car drives off.

    Parameters
    ----------
    state : FilterState
        The belief before the scan.
    spec : GridSpec
        The cells, (H, W).
    evidence : Evidence
        What the scan says of each cell. However small the two likelihoods are, only their ratio counts. Where nothing
        that was held possible explains the scan, the cell becomes UNKNOWN.
    world : WorldModel
        What UNKNOWN cells turn out to be, `first_sight`, and how soon things have left a place.
    """
    check_shape("state", state.newborn, spec.shape)
    check_shape("evidence", evidence.free, spec.shape)
    seen = evidence.occupied != evidence.free
    prior = initialise_unknown(state, seen, world)
    posterior, factor = bayes(prior.probability, evidence.occupied, evidence.free)
    cells = cells_of(prior.particles.position, spec)
    weight = scale_in_cells(prior.particles.weight, cells, factor)
    origin = cells_at(prior.particles, cells, spec, -world.clearing_time, world.clearing_cells)
    left = weight_in_cells(weight, origin, spec.shape)
    cleared, newborn = clear_wakes(posterior, left, ~seen), (prior.newborn * factor).astype(np.float32)
    return FilterState(cleared, replace(prior.particles, weight=weight), newborn)


def initialise_unknown(state: FilterState, seen: NDArray, world: WorldModel) -> FilterState:
    """Share the UNKNOWN mass of cells that are seen among the other states, by the probabilities of first sight.

    Parameters
    ----------
    state : FilterState
        The belief before the scan.
    seen : (H, W) bool
        Whether the scan says anything of the cell.
    world : WorldModel
        What UNKNOWN cells turn out to be, `first_sight`; the dynamic part is newborn.
    """
    revealed = np.where(seen, state.probability[UNKNOWN], 0)
    shares = np.array([*world.first_sight, -1], dtype=revealed.dtype)
    probability = state.probability + shares[:, None, None] * revealed
    return FilterState(probability, state.particles, state.newborn + shares[DYNAMIC] * revealed)


def resample(state: FilterState, spec: GridSpec, params: CmcdotParams, rng: np.random.Generator) -> FilterState:
    """Step 4: resample, which spends the particles where dynamic mass is, and on newborn mass.

    There are two draws of fixed size, by `params.resampling`. The first draws particles in proportion to their weights.
    The second draws cells in proportion to their newborn mass, and puts a particle anywhere in each cell that it draws,
    with a velocity from the wide prior. Then the weights in each cell are scaled to its dynamic probability again.
    Dynamic mass so small that no particle was drawn for it becomes UNKNOWN.

    Parameters
    ----------
    state : FilterState
        The belief given the scan.
    spec : GridSpec
        The cells, (H, W).
    params : CmcdotParams
        Number of particles, share of births and their velocity prior, and how particles are drawn.
    rng : numpy.random.Generator
        Source of the draws, and of the newborn particles' places and velocities.

    Returns
    -------
    FilterState
        The same belief, carried by new particles, without newborn mass.

    Raises
    ------
    ArgumentError
        When the state is over cells other than `spec`, or the resampling doesn't return indices.
    """
    check_shape("state", state.newborn, spec.shape)
    births, how = round(params.birth_share * params.n_particles), params.resampling
    old = draw_again(state.particles, params.n_particles - births, how, rng)
    new = draw_newborn(state.newborn, spec, births, params.max_speed, how, rng)
    position, velocity = np.vstack([old.position, new.position]), np.vstack([old.velocity, new.velocity])
    weight, cells = np.append(old.weight, new.weight), cells_of(position, spec)
    probability, factor = rescale_weights(state.probability, weight_in_cells(weight, cells, spec.shape))
    particles = Particles(position, velocity, scale_in_cells(weight, cells, factor))
    return FilterState(probability, particles, np.zeros_like(state.newborn))

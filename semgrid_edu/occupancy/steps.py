"""CMCDOT's four steps, each a pure function: move, predict, update, resample (paper, section 3.2)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.cellwise import bayes, make_room, meet, mix, represent
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.moving_map import look_up
from semgrid_edu.occupancy.params import CmcdotParams
from semgrid_edu.occupancy.particles import (
    by_origin,
    cells_of,
    fly,
    scale_in_cells,
    slow_down,
    transform,
    weight_in_cells,
)
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.resampling import draw_again, draw_newborn
from semgrid_edu.occupancy.state import FilterState, Particles, State, check_shape
from semgrid_edu.occupancy.world import WorldModel, transition_matrix

DYNAMIC, UNKNOWN = State.DYNAMIC, State.UNKNOWN
NOTHING_KNOWN = np.array([0, 0, 0, 1], dtype=np.float32)


def move(state: FilterState, spec: GridSpec, motion: PlanarMotion) -> FilterState:
    """Step 1: express the belief in a new frame.

    Each new cell takes the belief of the old cell that its centre lies in, so a shift by whole cells is
    exact; what enters the map is UNKNOWN. Particles are moved exactly, and dynamic mass goes where they go.

    Parameters
    ----------
    state : FilterState
        In the old frame, without newborn mass.
    spec : GridSpec
        The cells, the same in both frames.
    motion : PlanarMotion
        The new frame, in the old one.

    Returns
    -------
    FilterState
        In the new frame.

    Raises
    ------
    ArgumentError
        When the state is over other cells than those of `spec`.
    """
    check_shape("state", state.newborn, spec.shape)
    probability = look_up(state.probability, NOTHING_KNOWN, spec, spec, motion)
    particles = transform(state.particles, motion)
    cells = cells_of(particles.position, spec)
    probability, factor = make_room(probability, weight_in_cells(particles.weight, cells, spec.shape))
    weight = scale_in_cells(particles.weight, cells, factor)
    return FilterState(probability, replace(particles, weight=weight), state.newborn)


def predict(state: FilterState, spec: GridSpec, world: WorldModel, dt: float, rng: np.random.Generator) -> FilterState:
    """Step 2: what becomes of the belief while `dt` seconds pass and nobody looks.

    First each cell mixes by the transition matrix, and particles near zero speed become STATIC. Then dynamic
    mass flies. What it leaves behind is FREE: nothing stood where something moved. Where it arrives with
    probability a, two opinions meet: "something arrives" (a) and the cell's own. They can't both be right where
    the cell is STATIC, so of the joint distribution that combination is struck out:

        P(DYNAMIC) = [a (1 - s) + (1 - a) d] / (1 - a s),   others = (1 - a) others / (1 - a s)

    with s and d the cell's own static and dynamic probability. So what arrives in free space is dynamic, and
    a standing fence isn't talked out of it by particles that cross it.

    Parameters
    ----------
    state : FilterState
        At the previous instant.
    spec : GridSpec
        The cells.
    world : WorldModel
        Rates of change, how things stop, and how they accelerate.
    dt : float
        Seconds, not negative.
    rng : numpy.random.Generator
        For the noise of the particles.

    Returns
    -------
    FilterState
        At the present instant, before its scan.

    Raises
    ------
    ArgumentError
        When the state is over other cells than those of `spec`, or `dt` is negative or not finite.
    """
    check_shape("state", state.newborn, spec.shape)
    M = transition_matrix(world, dt)
    before = cells_of(state.particles.position, spec)
    particles = slow_down(state.particles, world.stop_rate, world.stop_speed, dt)
    particles = replace(particles, weight=particles.weight * np.float32(M[DYNAMIC, DYNAMIC]))
    going = weight_in_cells(particles.weight, before, spec.shape)
    mixed, newborn = mix(state.probability, state.newborn, going, M)

    particles = fly(particles, world.max_acceleration, dt, rng)
    origin = by_origin(before, cells_of(particles.position, spec), going.size)
    stays, arrives = weight_in_cells(particles.weight, origin, (2, *spec.shape))
    probability, newborn, factor = meet(mixed, newborn, going, stays, arrives)
    weight = scale_in_cells(particles.weight, origin, factor)
    return FilterState(probability, replace(particles, weight=weight), newborn)


def update(state: FilterState, spec: GridSpec, evidence: Evidence, world: WorldModel) -> FilterState:
    """Step 3: Bayes' rule in each cell, P(state | z) = P(z | state) P(state) / P(z).

    STATIC and DYNAMIC share P(z | occupied): one scan can't tell them apart. UNKNOWN means unobserved, so
    a cell of which the scan says anything isn't that any more: `reveal` goes first.

    Parameters
    ----------
    state : FilterState
        Predicted.
    spec : GridSpec
        The cells.
    evidence : Evidence
        Of the scan; any numbers >= 0, for each cell is scaled by its best explanation first. Where nothing
        that was held possible explains the scan, nothing is known any more: UNKNOWN.
    world : WorldModel
        What UNKNOWN cells turn out to be, `first_sight`.

    Returns
    -------
    FilterState
        Given the scan.

    Raises
    ------
    ArgumentError
        When state or evidence are over other cells than those of `spec`.
    """
    check_shape("state", state.newborn, spec.shape)
    check_shape("evidence", evidence.free, spec.shape)
    prior = reveal(state, evidence.occupied != evidence.free, world)
    posterior, factor = bayes(prior.probability, evidence.occupied, evidence.free)
    particles = prior.particles
    weight = scale_in_cells(particles.weight, cells_of(particles.position, spec), factor)
    return FilterState(posterior, replace(particles, weight=weight), (prior.newborn * factor).astype(np.float32))


def reveal(state: FilterState, seen: NDArray, world: WorldModel) -> FilterState:
    """Share the UNKNOWN mass of cells that are seen among the other states, as they are found at first sight.

    Parameters
    ----------
    state : FilterState
        Predicted.
    seen : (H, W) bool
        Of which cells the scan says anything.
    world : WorldModel
        What UNKNOWN cells turn out to be, `first_sight`; the dynamic part is newborn.

    Returns
    -------
    FilterState
        UNKNOWN only where nobody looks.
    """
    revealed = np.where(seen, state.probability[UNKNOWN], 0)
    shares = np.array([*world.first_sight, -1], dtype=revealed.dtype)
    probability = state.probability + shares[:, None, None] * revealed
    return FilterState(probability, state.particles, state.newborn + shares[DYNAMIC] * revealed)


def resample(state: FilterState, spec: GridSpec, params: CmcdotParams, rng: np.random.Generator) -> FilterState:
    """Step 4: spend the particles where dynamic mass is, and on what is newborn.

    Two systematic draws of fixed size: particles in proportion to their weight, and cells in proportion to their
    newborn mass, each of which gets a particle anywhere in it with a velocity from the wide prior. Weights
    are then made to add up to each cell's dynamic probability again; where mass too small for a
    particle got none, it becomes UNKNOWN.

    Parameters
    ----------
    state : FilterState
        Given the scan.
    spec : GridSpec
        The cells.
    params : CmcdotParams
        Number of particles, share of births, their velocity prior.
    rng : numpy.random.Generator

    Returns
    -------
    FilterState
        The same belief, carried by new particles; no newborn mass.

    Raises
    ------
    ArgumentError
        When the state is over other cells than those of `spec`.
    """
    check_shape("state", state.newborn, spec.shape)
    births = round(params.birth_share * params.n_particles)
    drawn = (
        draw_again(state.particles, params.n_particles - births, rng),
        draw_newborn(state.newborn, spec, births, params.max_speed, rng),
    )
    position, velocity, weight = (
        np.concatenate([getattr(p, name) for p in drawn]) for name in ("position", "velocity", "weight")
    )
    cells = cells_of(position, spec)
    probability, factor = represent(state.probability, weight_in_cells(weight, cells, spec.shape))
    particles = Particles(position, velocity, scale_in_cells(weight, cells, factor))
    return FilterState(probability, particles, np.zeros_like(state.newborn))

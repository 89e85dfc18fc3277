"""CMCDOT's four steps in compiled loops and single precision."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.fast.occupancy.cellwise import bayes, clear_wakes, collide, mix, renormalise, rescale_weights
from semgrid_edu.fast.occupancy.particles import (
    by_origin,
    cells_at,
    cells_of,
    doubt_arrivals,
    fly,
    pace_of,
    scale_in_cells,
    slow_down,
    transform,
    weight_in_cells,
)
from semgrid_edu.fast.occupancy.planar_motion import look_up
from semgrid_edu.fast.occupancy.resampling import compiled_resampling, draw_again, draw_newborn
from semgrid_edu.fast.occupancy.transition import transition_matrix
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.state import FilterState, Particles, State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.occupancy.walls import Walls
from semgrid_edu.occupancy.world import CmcdotParams, WorldModel

FREE, STATIC, DYNAMIC, UNKNOWN = State


def move(state: FilterState, spec: GridSpec, motion: PlanarMotion) -> FilterState:
    """Step 1: express the belief in a new frame. Parameters are those of `move`."""
    state = _single_precision(state)
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
    """Step 2: predict. Parameters are those of `predict`."""
    state = _single_precision(state)
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
    walls = _walls_of(world)
    time, fewest = walls.clearing_time, walls.clearing_cells
    origin, ahead = (cells_at(particles, cells, spec, way * time, fewest) for way in (-1, 1))
    doubt = scale_in_cells(particles.weight, origin, mixed[STATIC])
    pace = pace_of(walls, driven, dt, spec.cell)
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
    """Step 3: update each cell by Bayes' rule. Parameters are those of `update`."""
    state = _single_precision(state)
    check_shape("state", state.newborn, spec.shape)
    check_shape("evidence", evidence.free, spec.shape)
    seen = evidence.occupied != evidence.free
    prior = initialise_unknown(state, seen, world)
    posterior, factor = bayes(prior.probability, evidence.occupied, evidence.free)
    cells = cells_of(prior.particles.position, spec)
    weight = scale_in_cells(prior.particles.weight, cells, factor)
    walls = _walls_of(world)
    origin = cells_at(prior.particles, cells, spec, -walls.clearing_time, walls.clearing_cells)
    left = weight_in_cells(weight, origin, spec.shape)
    cleared, newborn = clear_wakes(posterior, left, ~seen), (prior.newborn * factor).astype(np.float32)
    return FilterState(cleared, replace(prior.particles, weight=weight), newborn)


def initialise_unknown(state: FilterState, seen: NDArray, world: WorldModel) -> FilterState:
    """Distribute the UNKNOWN mass of observed cells. Parameters are those of `initialise_unknown`."""
    revealed = np.where(seen, state.probability[UNKNOWN], 0)
    shares = np.array([*world.first_sight, -1], dtype=revealed.dtype)
    probability = state.probability + shares[:, None, None] * revealed
    return FilterState(probability, state.particles, state.newborn + shares[DYNAMIC] * revealed)


def resample(state: FilterState, spec: GridSpec, params: CmcdotParams, rng: np.random.Generator) -> FilterState:
    """Step 4: resample. Parameters, result and errors are those of `resample`."""
    state = _single_precision(state)
    check_shape("state", state.newborn, spec.shape)
    births, how = round(params.birth_share * params.n_particles), compiled_resampling(params.resampling)
    old = draw_again(state.particles, params.n_particles - births, how, rng)
    new = draw_newborn(state.newborn, spec, births, params.max_speed, how, rng)
    position, velocity = np.vstack([old.position, new.position]), np.vstack([old.velocity, new.velocity])
    weight, cells = np.append(old.weight, new.weight), cells_of(position, spec)
    probability, factor = rescale_weights(state.probability, weight_in_cells(weight, cells, spec.shape))
    particles = Particles(position, velocity, scale_in_cells(weight, cells, factor))
    return FilterState(probability, particles, np.zeros_like(state.newborn))


def _single_precision(state: FilterState) -> FilterState:
    """Return a state in float32, for which the loops are compiled; states of `fast` already are."""
    if state.probability.dtype == state.newborn.dtype == state.particles.weight.dtype == np.float32:
        return state
    p = state.particles
    particles = Particles(*(a.astype(np.float32, copy=False) for a in (p.position, p.velocity, p.weight)))
    probability = state.probability.astype(np.float32, copy=False)
    return FilterState(probability, particles, state.newborn.astype(np.float32, copy=False))


def _walls_of(world: WorldModel) -> Walls:
    """Return the walls whose rules are compiled; without walls, the filter looks neither back nor ahead."""
    if world.walls is None:
        return Walls(clearing_time=0)
    if type(world.walls) is not Walls:
        found = f"{type(world.walls).__name__}: semgrid_edu.occupancy runs it"
        raise ArgumentError("walls", "Walls() or None, because fast has compiled their rules", found)
    return world.walls

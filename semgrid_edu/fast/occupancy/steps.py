"""CMCDOT's four steps in compiled loops and single precision."""

import math
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError, check_seconds, check_shape
from semgrid_edu.fast.occupancy.cells import look_up
from semgrid_edu.fast.occupancy.cellwise import bayes, clear_wakes, collide, mix, renormalise, rescale_weights
from semgrid_edu.fast.occupancy.particles import (
    by_origin,
    cells_at,
    cells_of,
    doubt_arrivals,
    fly,
    moving_share,
    scale_in_cells,
    transform,
    weight_in_cells,
)
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion
from semgrid_edu.occupancy.sensor import Evidence
from semgrid_edu.occupancy.state import (
    FilterState,
    Particles,
    Resampling,
    State,
    SystematicResampling,
    draw_indices,
    draw_velocities,
    equal_weights,
)
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.occupancy.walls import Walls, velocity_of
from semgrid_edu.occupancy.world import CmcdotParams, WorldModel

FREE, STATIC, DYNAMIC, UNKNOWN = State


def move(state: FilterState, spec: GridSpec, motion: PlanarMotion, to: GridSpec | None = None) -> FilterState:
    """Step 1: express the belief in a new frame. Parameters are those of `move`."""
    state = _single_precision(state)
    check_shape("state", state.newborn, spec.shape)
    to = to or spec
    probability = look_up(state.probability, NOTHING_KNOWN, spec, to, motion)
    particles = transform(state.particles, motion)
    cells = cells_of(particles.position, to)
    probability, factor = renormalise(probability, weight_in_cells(particles.weight, cells, to.shape))
    weight = scale_in_cells(particles.weight, cells, factor)
    return FilterState(probability, replace(particles, weight=weight), np.zeros(to.shape, np.float32))


def predict(
    state: FilterState,
    spec: GridSpec,
    world: WorldModel,
    dt: float,
    rng: np.random.Generator,
    driven: ArrayLike = (0.0, 0.0),
) -> FilterState:
    """Step 2: predict. Parameters are those of `predict`."""
    state = _single_precision(state)
    check_shape("state", state.newborn, spec.shape)
    M = transition_matrix(world, dt)
    before = cells_of(state.particles.position, spec)
    share = moving_share(state.particles.velocity, world.stop_rate, world.stop_speed, dt)
    particles = replace(state.particles, weight=state.particles.weight * share * np.float32(M[DYNAMIC, DYNAMIC]))
    going = weight_in_cells(particles.weight, before, spec.shape)
    mixed, newborn = mix(state.probability, state.newborn, going, M)

    particles = fly(particles, world.max_acceleration, dt, rng)
    cells = cells_of(particles.position, spec)
    came = by_origin(before, cells, going.size)
    walls = _walls_of(world)
    doubt = doubt_arrivals(particles, cells, mixed, spec, walls, velocity_of(driven, dt))
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
    prior, born = initialise_unknown(state.probability, evidence.seen, world)
    posterior, factor = bayes(prior, evidence.occupied, evidence.free)
    cells = cells_of(state.particles.position, spec)
    weight = scale_in_cells(state.particles.weight, cells, factor)
    walls = _walls_of(world)
    origin = cells_at(state.particles, cells, spec, -walls.clearing_time, walls.clearing_cells)
    left = weight_in_cells(weight, origin, spec.shape)
    cleared = clear_wakes(posterior, left, ~evidence.seen)
    newborn = ((state.newborn + born) * factor).astype(np.float32)
    return FilterState(cleared, replace(state.particles, weight=weight), newborn)


def initialise_unknown(probability: NDArray, seen: NDArray, world: WorldModel) -> tuple[NDArray, NDArray]:
    """Distribute the UNKNOWN mass of observed cells. Parameters are those of `initialise_unknown`."""
    revealed = np.where(seen, probability[UNKNOWN], 0)
    shares = np.array([*world.first_sight, -1], dtype=revealed.dtype)
    return probability + shares[:, None, None] * revealed, shares[DYNAMIC] * revealed


def resample(state: FilterState, spec: GridSpec, params: CmcdotParams, rng: np.random.Generator) -> FilterState:
    """Step 4: resample. Parameters, result and errors are those of `resample`."""
    state = _single_precision(state)
    check_shape("state", state.newborn, spec.shape)
    births = round(params.birth_share * params.n_particles)
    old = draw_again(state.particles, params.n_particles - births, params.resampling, rng)
    new = draw_newborn(state.newborn, spec, births, params.max_speed, params.resampling, rng)
    position = np.vstack([old.position, new.position])
    velocity = np.vstack([old.velocity, new.velocity])
    weight = np.append(old.weight, new.weight)
    cells = cells_of(position, spec)
    probability, factor = rescale_weights(state.probability, weight_in_cells(weight, cells, spec.shape))
    particles = Particles(position, velocity, scale_in_cells(weight, cells, factor))
    return FilterState(probability, particles, np.zeros_like(state.newborn))


@njit(cache=True, nogil=True)
def systematic_resample(weight, count, offset):
    """Draw indices in proportion to the weights. Parameters and result are those of `systematic_resample`."""
    total = 0.0
    for w in weight:  # summed in the same order as `below`, so that both end at the same number
        total += w
    points = (np.arange(count) + offset) / count * total
    chosen = np.zeros(count + 1, np.int64)
    first = 0
    below = 0.0
    last = 0
    for i in range(len(weight)):
        if weight[i] > 0:
            chosen[first] = i  # a weight that no point hits is overwritten by the next
            below += weight[i]
            first = _points_below(below, points, below / total * count - offset)
            last = i
    chosen[first] = last  # rounding can put the last point on the very end
    for m in range(1, count):
        chosen[m] = max(chosen[m], chosen[m - 1])
    return chosen[:count]


@njit(cache=True, nogil=True)
def _points_below(weight, points, expected):
    """Return how many points are below a weight: `expected`, corrected by one if rounding made it wrong."""
    n = min(max(math.ceil(expected), 0), len(points))
    while n > 0 and points[n - 1] >= weight:
        n -= 1
    while n < len(points) and points[n] < weight:
        n += 1
    return n


def draw_again(particles: Particles, count: int, resampling: Resampling, rng: np.random.Generator) -> Particles:
    """Draw particles in proportion to their weights. Parameters and result are those of `draw_again`."""
    chosen = _draw(resampling, particles.weight, count, rng)
    position = np.take(particles.position, chosen, axis=0)
    velocity = np.take(particles.velocity, chosen, axis=0)
    return Particles(position, velocity, equal_weights(particles.weight, len(chosen)).astype(np.float32))


def draw_newborn(
    newborn: NDArray, spec: GridSpec, count: int, max_speed: float, resampling: Resampling, rng: np.random.Generator
) -> Particles:
    """Draw new particles in proportion to newborn mass. Parameters and result are those of `draw_newborn`."""
    chosen = _draw(resampling, newborn.ravel(), count, rng)
    part = rng.random((len(chosen), 2), np.float32)
    position = _positions(chosen, part, spec.shape[1], *spec.corner)
    velocity = draw_velocities(len(chosen), max_speed, rng)
    return Particles(position, velocity, equal_weights(newborn, len(chosen)).astype(np.float32))


def _draw(resampling: Resampling, weight: NDArray, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw indices as `draw_indices` does, but by the compiled twin of the book's resampling."""
    if type(resampling) is SystematicResampling and count > 0 and weight.any():
        return systematic_resample(weight.astype(np.float64), count, rng.random())
    return draw_indices(resampling, weight, count, rng)


@njit(cache=True, nogil=True)
def _positions(cells, part, width, x_max, y_max, cell):
    """Return positions, (M, 2), from fractions of a cell, (M, 2), counted from its corner of largest x and y."""
    position = np.empty_like(part)
    for m in range(len(cells)):
        row, col = divmod(cells[m], width)
        position[m, 0] = x_max - (row + part[m, 0]) * cell
        position[m, 1] = y_max - (col + part[m, 1]) * cell
    return position


def transition_matrix(world: WorldModel, dt: float) -> NDArray[np.float64]:
    """Return the transition matrix of a time step, M = exp(R dt), by uniformisation, without BLAS and its threads.

    With r the largest rate at which a state is left, A = (R + r I) dt has no negative entry, and exp(R dt) is the sum
    of A^k / k! with its rows scaled to 1. The sum is taken over a small part of the time step, which is then doubled.
    `scipy.linalg.expm` wakes the threads of its BLAS, which keep spinning on the core that processes the scan: a step
    took 28 ms with it instead of 18. Parameters and result are those of `transition_matrix`.
    """
    check_seconds(dt)
    R = np.array(world.rates, dtype=np.float64)
    np.fill_diagonal(R, 0)
    leaving = R.sum(axis=1)
    np.fill_diagonal(R, leaving.max() - leaving)
    doublings = max(0, np.frexp(leaving.max())[1] + np.frexp(dt)[1] + 1)
    A = R * np.ldexp(dt, -doublings)
    M = np.eye(4)
    for k in range(14, 0, -1):
        M = np.eye(4) + A @ M / k
    M /= M.sum(axis=1, keepdims=True)
    for _ in range(doublings):
        M = M @ M
        M /= M.sum(axis=1, keepdims=True)
    return M


def _single_precision(state: FilterState) -> FilterState:
    """Return a state in float32, for which the loops are compiled; states of `fast` already are."""
    if state.probability.dtype == state.newborn.dtype == state.particles.weight.dtype == np.float32:
        return state
    p = state.particles
    particles = Particles(*(a.astype(np.float32, copy=False) for a in (p.position, p.velocity, p.weight)))
    probability = state.probability.astype(np.float32, copy=False)
    return FilterState(probability, particles, state.newborn.astype(np.float32, copy=False))


def _walls_of(world: WorldModel) -> Walls:
    """Return the walls; only the package's own have compiled rules."""
    if type(world.walls) is not Walls:
        found = f"{type(world.walls).__name__}: semgrid_edu.occupancy runs it"
        raise ArgumentError("walls", "Walls() or None, because fast has compiled their rules", found)
    return world.walls

"""CMCDOT's four steps, each a pure function: move, predict, update, resample (paper, section 3.2)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.motion import PlanarMotion
from semgrid_edu.occupancy.moving_map import look_up
from semgrid_edu.occupancy.params import CmcdotParams, transition_matrix
from semgrid_edu.occupancy.particles import (
    cells_of,
    draw_velocities,
    fly,
    scale_in_cells,
    slow_down,
    systematic_resample,
    transform,
    weight_in_cells,
)
from semgrid_edu.occupancy.state import FilterState, Particles, State

FREE, STATIC, DYNAMIC, UNKNOWN = State
NOTHING_KNOWN = np.array([0, 0, 0, 1], dtype=np.float32)
CERTAIN = np.float32(1 - 1e-3)
"""The most that arriving particles may claim of a cell: who is never quite certain can be contradicted."""


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
    """
    probability = look_up(state.probability, NOTHING_KNOWN, spec, spec, motion)
    particles = transform(state.particles, motion)
    cells = cells_of(particles.position, spec)
    claimed = weight_in_cells(particles.weight, cells, spec.shape)
    dynamic = np.minimum(claimed, 1)
    weight = scale_in_cells(particles.weight, cells, _ratio(dynamic, claimed))
    probability[DYNAMIC] = 0
    others = probability.sum(axis=0)  # not 1 - P(DYNAMIC), which has no digits left where dynamic mass is nearly all
    probability *= _ratio(1 - dynamic, others)
    probability[UNKNOWN] += np.where(others > 0, 0, 1 - dynamic)
    probability[DYNAMIC] = dynamic
    return FilterState(probability, replace(particles, weight=weight), state.newborn)


def predict(
    state: FilterState, spec: GridSpec, params: CmcdotParams, dt: float, rng: np.random.Generator
) -> FilterState:
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
    params : CmcdotParams
        Rates and noise.
    dt : float
        Seconds, not negative.
    rng : numpy.random.Generator
        For the noise of the particles.

    Returns
    -------
    FilterState
        At the present instant, before its scan.
    """
    M = transition_matrix(params, dt).astype(state.probability.dtype)
    before = cells_of(state.particles.position, spec)
    particles = slow_down(state.particles, params.stop_rate, params.stop_speed, dt)
    particles = replace(particles, weight=particles.weight * M[DYNAMIC, DYNAMIC])
    going = weight_in_cells(particles.weight, before, spec.shape)
    own = np.einsum("ij,ihw->jhw", M, state.probability)
    newborn = np.einsum("i,ihw->hw", M[:, DYNAMIC], _without_particles(state))
    own[STATIC] += np.maximum(own[DYNAMIC] - newborn - going, 0)

    particles = fly(particles, params.max_acceleration, dt, rng)
    after = cells_of(particles.position, spec)
    n_cells = going.size
    bucket = np.where((after != before) & (after >= 0), after + n_cells, after)
    stays, arrives = weight_in_cells(particles.weight, bucket, (2, *spec.shape))
    own[FREE] += going - stays
    own[DYNAMIC] = newborn + stays

    claim = np.minimum(arrives, CERTAIN)
    consistent = 1 - claim * own[STATIC]
    own_factor = (1 - claim) / consistent
    arrival_factor = _ratio(claim, arrives) * (1 - own[STATIC]) / consistent
    weight = scale_in_cells(particles.weight, bucket, np.stack([own_factor, arrival_factor]))
    probability = own * own_factor
    probability[DYNAMIC] += arrives * arrival_factor
    return FilterState(probability, replace(particles, weight=weight), newborn * own_factor)


def update(state: FilterState, spec: GridSpec, evidence: Evidence, params: CmcdotParams) -> FilterState:
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
    params : CmcdotParams
        For `first_sight`.

    Returns
    -------
    FilterState
        Given the scan.
    """
    prior = reveal(state, evidence.occupied != evidence.free, params)
    best = np.maximum(evidence.occupied, evidence.free)
    occupied, free = _ratio(evidence.occupied, best), _ratio(evidence.free, best)
    joint = prior.probability * np.stack([free, occupied, occupied, free])
    total = joint.sum(axis=0)
    explained = total > 0
    posterior = np.where(explained, joint / np.where(explained, total, 1), NOTHING_KNOWN[:, None, None])
    factor = _ratio(posterior[DYNAMIC], prior.probability[DYNAMIC])
    particles = prior.particles
    weight = scale_in_cells(particles.weight, cells_of(particles.position, spec), factor)
    return FilterState(posterior, replace(particles, weight=weight), prior.newborn * factor)


def reveal(state: FilterState, seen: NDArray, params: CmcdotParams) -> FilterState:
    """Share the UNKNOWN mass of cells that are seen among the other states, as they are found at first sight.

    Parameters
    ----------
    state : FilterState
        Predicted.
    seen : (H, W) bool
        Of which cells the scan says anything.
    params : CmcdotParams
        For `first_sight`; its dynamic part is newborn.

    Returns
    -------
    FilterState
        UNKNOWN only where nobody looks.
    """
    revealed = np.where(seen, state.probability[UNKNOWN], 0)
    shares = np.array([*params.first_sight, -1], dtype=revealed.dtype)
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
    """
    births = round(params.birth_share * params.particles)
    drawn = [_draw_again(state.particles, params.particles - births, rng)]
    drawn.append(_draw_newborn(state.newborn, spec, births, params.max_speed, rng))
    position, velocity, weight = (
        np.concatenate([getattr(p, name) for p in drawn]) for name in ("position", "velocity", "weight")
    )
    cells = cells_of(position, spec)
    represented = weight_in_cells(weight, cells, spec.shape)
    probability = state.probability.copy()
    lost = np.where(represented > 0, 0, probability[DYNAMIC])
    probability[DYNAMIC] -= lost
    probability[UNKNOWN] += lost
    weight = scale_in_cells(weight, cells, _ratio(probability[DYNAMIC], represented))
    return FilterState(probability, Particles(position, velocity, weight), np.zeros_like(state.newborn))


def _draw_again(particles: Particles, count: int, rng: np.random.Generator) -> Particles:
    """Draw particles by weight, each then carrying the same share."""
    total = particles.weight.sum(dtype=np.float64)
    if total == 0 or count == 0:
        return Particles.none()
    chosen = systematic_resample(particles.weight, count, rng.random())
    weight = np.full(count, total / count, np.float32)
    return Particles(particles.position.take(chosen, axis=0), particles.velocity.take(chosen, axis=0), weight)


def _draw_newborn(
    newborn: NDArray, spec: GridSpec, count: int, max_speed: float, rng: np.random.Generator
) -> Particles:
    """Draw new particles in cells by newborn mass, each carrying the same share."""
    total = newborn.sum(dtype=np.float64)
    if total == 0 or count == 0:
        return Particles.none()
    chosen = systematic_resample(newborn.ravel(), count, rng.random())
    corner = np.stack(np.divmod(chosen, spec.shape[1]), axis=1) + rng.random((count, 2), np.float32)
    position = (spec.x_max, spec.y_max) - corner * spec.cell
    weight = np.full(count, total / count, np.float32)
    return Particles(position.astype(np.float32), draw_velocities(count, max_speed, rng), weight)


def _without_particles(state: FilterState) -> NDArray:
    """Return the part of the belief that no particle carries, (4, H, W)."""
    return np.concatenate([state.probability[:DYNAMIC], state.newborn[None], state.probability[UNKNOWN:]])


def _ratio(part: NDArray, whole: NDArray) -> NDArray:
    """Divide, with 0 where the whole is 0."""
    return np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0)

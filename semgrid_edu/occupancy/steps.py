"""CMCDOT's four steps in double precision: move, predict, update, resample (section 3.2).

Each is a function from state to state that changes no argument, except that `predict` and `resample` draw from `rng`.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from semgrid_edu.errors import check_seconds, check_shape
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy.planar_motion import PlanarMotion, look_up
from semgrid_edu.occupancy.sensor import Evidence
from semgrid_edu.occupancy.state import (
    MAX_MOVE_PROBABILITY,
    TINY,
    FilterState,
    Particles,
    State,
    at_cells,
    cells_of,
    draw_again,
    draw_newborn,
    fly,
    moving_share,
    ratio,
    transform,
    weight_in_cells,
)
from semgrid_edu.occupancy.world import CmcdotParams, WorldModel

FREE, STATIC, DYNAMIC, UNKNOWN = State

NOTHING_KNOWN = np.array([0, 0, 0, 1], dtype=np.float32)
"""The four probabilities of a cell about which nothing is known: all UNKNOWN."""


def move(state: FilterState, spec: GridSpec, motion: PlanarMotion, to: GridSpec | None = None) -> FilterState:
    """Step 1: express the belief in a new frame.

    Each new cell takes the belief of the old cell that contains its centre, so a shift by whole cells is exact. Cells
    that enter the map are UNKNOWN. Particles are moved exactly and take the dynamic mass with them: P(DYNAMIC) is the
    sum of the weights in a cell, at most 1, and the other states share the rest in their old proportions.

    Parameters
    ----------
    state : FilterState
        The belief in the old frame, without newborn mass.
    spec : GridSpec
        The cells in the old frame, (H, W).
    motion : PlanarMotion
        Pose of the new frame in the old one, metres and radians.
    to : GridSpec, optional
        The cells in the new frame, (H', W'); by default those of `spec`.
    """
    check_shape("state", state.newborn, spec.shape)
    to = to or spec
    probability = look_up(state.probability, NOTHING_KNOWN, spec, to, motion)
    particles = transform(state.particles, motion)
    cells = cells_of(particles.position, to)
    # The weights in a cell may exceed 1 when two old cells empty their particles into it.
    claimed = weight_in_cells(particles.weight, cells, to.shape)
    dynamic = np.minimum(claimed, 1)
    # The particles have decided P(DYNAMIC). The other three states share the rest in their old proportions.
    others = probability[FREE] + probability[STATIC] + probability[UNKNOWN]
    probability = probability * ratio(1 - dynamic, others)
    probability[DYNAMIC] = dynamic
    probability[UNKNOWN] += np.where(others > 0, 0, 1 - dynamic)  # no other state was possible
    weight = particles.weight * at_cells(ratio(dynamic, claimed), cells)
    return FilterState(probability, replace(particles, weight=weight), np.zeros(to.shape))


def predict(
    state: FilterState,
    spec: GridSpec,
    world: WorldModel,
    dt: float,
    rng: np.random.Generator,
    driven: ArrayLike = (0.0, 0.0),
) -> FilterState:
    """Step 2: predict how the belief changes while `dt` seconds pass without a scan.

    First each cell mixes by the transition matrix, and particles near zero speed become STATIC. Then the particles fly,
    dynamic mass with them, and meet what their new cells hold (`collide`). `world.walls` doubts further arrivals, which
    may be only a wall that comes into view.

    Parameters
    ----------
    state : FilterState
        The belief at the previous instant.
    spec : GridSpec
        The cells, (H, W).
    world : WorldModel
        Rates of change, how things stop, how they accelerate, and which arrivals to doubt beside walls.
    dt, rng : float, numpy.random.Generator
        Time since the previous instant, seconds, not negative; source of the particles' accelerations.
    driven : (2,) float
        How far the vehicle has driven since the previous instant, along the axes of the map, metres.
    """
    check_shape("state", state.newborn, spec.shape)
    M = transition_matrix(world, dt)
    particles = stay_in_motion(state.particles, world, M, dt)
    start = cells_of(particles.position, spec)
    going = weight_in_cells(particles.weight, start, spec.shape)
    # So far nothing has left its cell: this is the world into which the particles fly.
    mixed, newborn = mix(state.probability, state.newborn, going, M)

    particles = fly(particles, world.max_acceleration, dt, rng)
    end = cells_of(particles.position, spec)
    vacated = weight_in_cells(particles.weight * (end != start), start, spec.shape)
    # Space that a thing has only just left was not seen free by any scan, so it counts as unseen.
    doubt = world.walls.doubt(particles, end, mixed, mixed[UNKNOWN] + vacated, spec, driven, dt)
    blocked = at_cells(mixed[STATIC], end) + doubt
    return collide(mixed, newborn, particles, start, end, vacated, blocked)


def update(state: FilterState, spec: GridSpec, evidence: Evidence, world: WorldModel) -> FilterState:
    """Step 3: update each cell by Bayes' rule, P(state | z) = P(z | state) P(state) / P(z).

    STATIC and DYNAMIC share P(z | occupied), because one scan can't tell them apart. UNKNOWN means that no scan has
    observed the cell yet. As soon as one does, `initialise_unknown` distributes its UNKNOWN mass over the other states.
    In hidden cells the particles are the only news: `world.walls` frees the cells that they have left.

    Parameters
    ----------
    state : FilterState
        The belief before the scan.
    spec : GridSpec
        The cells, (H, W).
    evidence : Evidence
        What the scan tells about each cell.
    world : WorldModel
        What UNKNOWN cells turn out to be, `first_sight`, and how soon things have left a place, `walls`.
    """
    check_shape("state", state.newborn, spec.shape)
    check_shape("evidence", evidence.free, spec.shape)
    # UNKNOWN isn't a thing that a beam could meet: a cell that is seen must be one of the other three.
    prior, born = initialise_unknown(state.probability, evidence.seen, world)
    posterior, factor = bayes(prior, evidence)
    cells = cells_of(state.particles.position, spec)
    # One factor for all particles of a cell, because a scan shows no velocities.
    particles = replace(state.particles, weight=state.particles.weight * at_cells(factor, cells))
    posterior = world.walls.clear_wakes(posterior, particles, cells, ~evidence.seen, spec)
    return FilterState(posterior, particles, (state.newborn + born) * factor)


def initialise_unknown(
    probability: NDArray, seen: NDArray[np.bool_], world: WorldModel
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """In cells that this scan observes, distribute the UNKNOWN mass over the other states.

    Parameters
    ----------
    probability : (4, H, W) float
        The four states before the scan.
    seen : (H, W) bool
        Whether the scan tells anything about the cell, `Evidence.seen`.
    world : WorldModel
        What UNKNOWN cells turn out to be, `first_sight`.

    Returns
    -------
    probability : (4, H, W) float64
        The four states; UNKNOWN is 0 in the cells that are seen.
    born : (H, W) float64
        What P(DYNAMIC) has gained: newborn mass, which has no particles.
    """
    revealed = np.where(seen, probability[UNKNOWN], 0).astype(np.float64)
    shares = np.array([*world.first_sight, -1.0])
    return probability + shares[:, None, None] * revealed, shares[DYNAMIC] * revealed


def resample(state: FilterState, spec: GridSpec, params: CmcdotParams, rng: np.random.Generator) -> FilterState:
    """Step 4: resample, which spends the particles where dynamic mass is, and on newborn mass.

    There are two draws of fixed size, by `params.resampling`. The first draws particles in proportion to their weights.
    The second draws cells in proportion to their newborn mass, and puts a particle anywhere in each cell that it draws,
    with a velocity from the wide prior. Then the weights in each cell are scaled to its dynamic probability again.
    Where no particle was drawn, dynamic mass becomes UNKNOWN. No newborn mass is left.

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

    Raises
    ------
    ArgumentError
        When the state covers cells other than `spec`, or the resampling doesn't return indices.
    """
    check_shape("state", state.newborn, spec.shape)
    # A fixed part of the particles goes to births, so that things just seen are never short of hypotheses.
    births = round(params.birth_share * params.n_particles)
    old = draw_again(state.particles, params.n_particles - births, params.resampling, rng)
    new = draw_newborn(state.newborn, spec, births, params.max_speed, params.resampling, rng)
    position = np.concatenate([old.position, new.position])
    velocity = np.concatenate([old.velocity, new.velocity])
    weight = np.concatenate([old.weight, new.weight])

    # Draws are random, so the weights drawn for a cell miss its dynamic probability by a little: scale them to it.
    cells = cells_of(position, spec)
    carried = weight_in_cells(weight, cells, spec.shape)
    probability = state.probability.astype(np.float64)
    dynamic = probability[DYNAMIC]
    factor = ratio(dynamic, carried)
    weight = weight * at_cells(factor, cells)
    probability[UNKNOWN] += np.where(factor > 0, 0, dynamic)  # too little mass for a single particle
    probability[DYNAMIC] = np.where(factor > 0, dynamic, 0)
    return FilterState(probability, Particles(position, velocity, weight), np.zeros(spec.shape))


LONGEST = 1e6
"""Longer times count as this, seconds: rates of 1/s have long mixed, and `expm` would lose its digits."""


def transition_matrix(world: WorldModel, dt: float) -> NDArray[np.float64]:
    """Return the transition matrix of a time step, M = exp(R dt).

    Parameters
    ----------
    world : WorldModel
        Its rates are the off-diagonal of R, whose rows sum to zero.
    dt : float
        The time step, seconds, not negative.

    Returns
    -------
    (4, 4) float64
        M[i, j] is the probability that a cell in state i is in state j after `dt`; rows sum to 1.

    Examples
    --------
    After three seconds without a scan, this is what a free cell has become:

    >>> transition_matrix(WorldModel(), dt=3.0)[0].round(2)
    array([0.37, 0.03, 0.01, 0.59])
    """
    check_seconds(dt)
    R = np.array(world.rates, dtype=np.float64)
    # What leaves a state arrives in another: each row of R sums to 0, so each row of exp(R dt) sums to 1.
    np.fill_diagonal(R, 0)
    np.fill_diagonal(R, -R.sum(axis=1))
    M = expm(R * min(dt, LONGEST))
    return M / M.sum(axis=1, keepdims=True)


def stay_in_motion(particles: Particles, world: WorldModel, M: NDArray, dt: float) -> Particles:
    """Reduce each weight to what is still DYNAMIC after a time step: by the matrix, and because slow things stop.

    Parameters
    ----------
    particles : Particles
        N particles at the start of the time step.
    world : WorldModel
        How things stop.
    M : (4, 4) float
        The transition matrix of the time step.
    dt : float
        The time step, seconds.
    """
    share = moving_share(particles.velocity, world.stop_rate, world.stop_speed, dt)
    return replace(particles, weight=particles.weight * share * M[DYNAMIC, DYNAMIC])


def mix(
    probability: NDArray, newborn: NDArray, going: NDArray, M: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mix the states of each cell by the transition matrix: P(j) = sum_i M[i, j] P(i).

    Parameters
    ----------
    probability : (4, H, W) float
        The four states at the previous instant.
    newborn : (H, W) float
        The part of P(DYNAMIC) that has no particles.
    going : (H, W) float
        Sum of the weights in each cell, after the matrix and after some particles have stopped. What stopped is STATIC.
    M : (4, 4) float
        Transition matrix, M[i, j] = P(state j now | state i before).

    Returns
    -------
    probability : (4, H, W) float64
        The four states now, with all particles still in their cells.
    newborn : (H, W) float64
        The part of P(DYNAMIC) that has no particles: what other states have become DYNAMIC is included.
    """
    mixed = np.einsum("ij,ihw->jhw", M, probability)
    # `going` counts the same particles after some have stopped; the difference is what now stands.
    carried = M[DYNAMIC, DYNAMIC] * (probability[DYNAMIC] - newborn)
    mixed[STATIC] += np.maximum(carried - going, 0)  # what has stopped
    # Only newborn mass in the third place: what particles carry is in `going`, and must not be counted twice.
    without_particles = np.stack([probability[FREE], probability[STATIC], newborn, probability[UNKNOWN]])
    born = np.einsum("i,ihw->hw", M[:, DYNAMIC], without_particles)
    mixed[DYNAMIC] = born + going
    return mixed, born


def collide(
    mixed: NDArray,
    newborn: NDArray,
    particles: Particles,
    start: NDArray,
    end: NDArray,
    vacated: NDArray,
    blocked: NDArray,
) -> FilterState:
    """Let particles that have moved meet what their new cells hold.

    A cell that they leave becomes FREE, because nothing stands where something has moved away. In a cell where mass
    arrives with probability a, two statements meet: "something arrives", and what the cell itself holds. "It arrives,
    and the cell is STATIC" can't be true, because two solid things can't share a cell. So this combination is struck
    out of the joint distribution (`strike_out`). With s and d the cell's own static and dynamic probability

        P(DYNAMIC) = [a (1 - s) + (1 - a) d] / (1 - a s),   others = (1 - a) others / (1 - a s)

    So what arrives in free space is DYNAMIC, and a fence that is known to stand stays STATIC although particles cross
    it. What `Walls.doubt` doubts of an arrival is struck out in the same way.

    Parameters
    ----------
    mixed, newborn : (4, H, W), (H, W) float
        The four states before particles flew, and the part of P(DYNAMIC) that has no particles, from `mix`.
    particles : Particles
        N particles after their flight.
    start, end : (N,) int
        The cell of each before and after its flight, from `cells_of`.
    vacated : (H, W) float
        Sum of the weights that have left each cell.
    blocked : (N,) float
        Probability that a particle's arrival in its cell is impossible.
    """
    moved = end != start
    shape = newborn.shape
    stays = weight_in_cells(particles.weight * ~moved, end, shape)
    arrives = weight_in_cells(particles.weight * moved, end, shape)
    possible = weight_in_cells(particles.weight * moved * (1 - blocked), end, shape)
    # What can't be true is struck out of the joint distribution; the two factors scale the rest to a sum of 1.
    keep, take = strike_out(arrives, possible)
    probability = keep * mixed
    probability[FREE] += keep * vacated  # what flew away leaves free space behind
    probability[DYNAMIC] = keep * (newborn + stays) + take * possible
    factor = np.where(moved, at_cells(take, end) * (1 - blocked), at_cells(keep, end))
    return FilterState(probability, replace(particles, weight=particles.weight * factor), keep * newborn)


def strike_out(arrives: NDArray, possible: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Strike out the arrivals that can't be true, and scale the rest to 1.

    Something arrives in a cell with probability a. Of the joint distribution of "it arrives" and what the cell holds,
    the impossible part i is struck out, such as an arrival in a cell that is STATIC: i = a P(STATIC). The
    rest, 1 - i, is scaled to 1: nothing arrives, 1 - a, and the cell keeps what it held; or the arrival is possible.

    Parameters
    ----------
    arrives : (H, W) float
        Dynamic mass that arrives in the cell. It may exceed 1 where particles crowd; then a is `MAX_MOVE_PROBABILITY`.
    possible : (H, W) float
        The part of it that can be true.

    Returns
    -------
    keep : (H, W) float64
        Factor of what the cell held, (1 - a) / (1 - i).
    take : (H, W) float64
        Factor of the possible arrivals, (a / arrives) / (1 - i).
    """
    a = np.minimum(arrives, MAX_MOVE_PROBABILITY)
    share = ratio(a, arrives)
    consistent = 1 - (a - share * possible)
    return (1 - a) / consistent, share / consistent


def bayes(prior: NDArray, evidence: Evidence) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Multiply by the likelihoods and normalise: P(state | z) = P(z | state) P(state) / P(z).

    STATIC and DYNAMIC share P(z | occupied), FREE and UNKNOWN share P(z | free).

    Parameters
    ----------
    prior : (4, H, W) float
        The four states before the scan.
    evidence : Evidence
        The likelihoods of the scan, (H, W).

    Returns
    -------
    posterior : (4, H, W) float64
        The four states given the scan. Where no state that was held possible explains the scan, all is UNKNOWN.
    factor : (H, W) float64
        P(DYNAMIC | z) / P(DYNAMIC), the factor of the weights of the cell's particles.
    """
    # Only the ratio of the likelihoods counts. The larger becomes 1, because products of tiny numbers would vanish.
    best = np.maximum(evidence.occupied, evidence.free).astype(np.float64)
    # Two zeros are equal as well, so they tell nothing: 1 and 1.
    occupied = np.where(best > 0, ratio(evidence.occupied, best), 1)
    free = np.where(best > 0, ratio(evidence.free, best), 1)
    joint = np.stack([free, occupied, occupied, free]) * prior
    p_z = joint.sum(axis=0)
    posterior = ratio(joint, p_z)
    posterior[UNKNOWN] += p_z < TINY  # no state that was held possible explains the scan; `ratio` gave 0
    return posterior, ratio(occupied, p_z)

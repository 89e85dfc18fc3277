"""CMCDOT's four steps and the BOF's update: the fast twins against the literal ones, on anything that a cell can hold.

The fast twins keep their numbers in single precision, which rounds probabilities by up to 6e-8. So the twins agree to
1e-6. Two formulas divide by as little as 1e-3 (`CERTAIN`), so that a rounded number counts a thousandfold: where an
arrival meets a cell that is all but certainly STATIC, and where a thing that has all but certainly left was taken for a
standing one. So predictions and updates agree to 1e-4.
"""

import sys

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numba.extending import is_jitted

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    BofParams,
    BofState,
    CmcdotParams,
    Evidence,
    FilterState,
    Particles,
    PlanarMotion,
    State,
    VelocityLattice,
    WorldModel,
    bof_predict_literal,
    bof_update,
    bof_update_literal,
    move,
    move_literal,
    predict,
    predict_literal,
    resample,
    resample_literal,
    update,
    update_literal,
)
from semgrid_edu.occupancy.literal.particles import cells_at_literal, cells_of_literal, systematic_resample_literal
from semgrid_edu.occupancy.particles import cells_at, cells_of, keeps_pace
from semgrid_edu.occupancy.resampling import systematic_resample
from semgrid_edu.occupancy.world import HALT

GRID = GridSpec(0, 6, -2, 2, 1)
LATTICE = VelocityLattice(max_speed=8.0, spacing=4.0)
SEEDS, LEVELS = st.integers(0, 10**6), st.sampled_from([0.1, 1.0])
SLOW = WorldModel(rates=((0.0, 1e-3, 0.0, 1e-3),) * 4)
"""A world in which cells stay nearly certain."""
TWINS = settings(deadline=None, max_examples=60)


def beliefs(rng: np.random.Generator, level: float, n: int) -> np.ndarray:
    """Return distributions over n things in each cell: a low level makes nearly certain cells, some are certain."""
    p = np.moveaxis(rng.dirichlet(np.full(n, level), GRID.shape), -1, 0)
    p = np.where(rng.random(GRID.shape) < 0.2, np.eye(n)[rng.integers(0, n, GRID.shape)].transpose(2, 0, 1), p)
    p = np.where(p < 1e-6, 0, p)  # numbers that single precision hardly holds
    return (p / p.sum(axis=0)).astype(np.float32)


@st.composite
def states(draw) -> FilterState:
    """Any belief, with no particles or many of any weight: they may crowd in cells, rest, or be outside the map."""
    rng, n = np.random.default_rng(draw(SEEDS)), draw(st.sampled_from([0, 1, 5, 80]))
    probability = beliefs(rng, draw(LEVELS), 4)
    newborn = probability[State.DYNAMIC] * (rng.random(GRID.shape) * (rng.random(GRID.shape) < 0.5)).astype(np.float32)
    position = rng.uniform((-1, -3), (7, 3), (n, 2)).astype(np.float32)
    velocity = draw(st.sampled_from([0.0, 0.4, 5.0, 60.0])) * rng.normal(0, 1, (n, 2)).astype(np.float32)
    weight = draw(st.sampled_from([0.0, 0.01, 0.5, 5.0])) * rng.random(n, np.float32)  # 5: one alone overcrowds a cell
    weight = weight.astype(np.float32)
    return FilterState(probability, Particles(position, velocity.astype(np.float32), weight), newborn)


@st.composite
def scans(draw) -> Evidence:
    """Any likelihoods: some cells unseen, some certain, and some that contradict all that is believed."""
    rng, floor = np.random.default_rng(draw(SEEDS)), draw(st.sampled_from([0, 1e-30, 0.05]))
    occupied, free = np.maximum(rng.random((2, *GRID.shape)) ** 9, floor) * (rng.random((2, *GRID.shape)) < 0.8)
    unseen = rng.random(GRID.shape) < 0.3
    return Evidence(occupied.astype(np.float32), np.where(unseen, occupied, free).astype(np.float32))


@st.composite
def motions(draw) -> PlanarMotion:
    """No motion, shifts by whole cells and parts of them, turns, and jumps beyond the map."""
    steps = draw(st.tuples(st.integers(-24, 24), st.integers(-24, 24), st.integers(-250, 250) | st.just(0)))
    return PlanarMotion(steps[0] / 8 * draw(st.sampled_from([1, 1, 40])), steps[1] / 8, steps[2] / 64)


def assert_twins(fast: FilterState, literal: FilterState, tolerance: float) -> None:
    """Hold two states equal, unless rounding has put a particle into another cell."""
    ours, theirs = fast.particles, literal.particles
    assert len(ours) == len(theirs)
    np.testing.assert_allclose(ours.position, theirs.position, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(ours.velocity, theirs.velocity, rtol=1e-5, atol=1e-5)
    assume(np.array_equal(cells_of(ours.position, GRID), cells_of_literal(theirs.position, GRID)))
    assert literal.probability.dtype == np.float64
    np.testing.assert_allclose(fast.probability, literal.probability, rtol=0, atol=tolerance)
    np.testing.assert_allclose(fast.newborn, literal.newborn, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.weight, theirs.weight, rtol=tolerance, atol=tolerance)


@TWINS
@given(states(), motions())
def test_move(state, motion):
    assert_twins(move(state, GRID, motion), move_literal(state, GRID, motion), 1e-6)


@TWINS
@given(
    states(),
    st.sampled_from([0.0, 0.04, 0.1, 1.0, 1e6]),
    st.sampled_from([WorldModel(), WorldModel(stop_rate=0.0, max_acceleration=0.0), WorldModel(stop_speed=3.0), SLOW]),
    st.sampled_from([0.0, 0.1, 10.0]),
    SEEDS,
)
def test_predict(state, dt, world, driven, seed):
    state = move(state, GRID, PlanarMotion(0, 0, 0))  # makes the weights of each cell sum up to what it holds
    ours, theirs = np.random.default_rng(seed), np.random.default_rng(seed)
    args = state, GRID, world, dt
    fast, literal = predict(*args, ours, driven), predict_literal(*args, theirs, driven)
    keeps = (keeps_pace(*p.particles.velocity.T, world.pace(driven, dt, GRID.cell)) for p in (fast, literal))
    assume(np.array_equal(*keeps))
    for part in (-1, -HALT, 1):
        then = part * world.clearing_time, world.clearing_cells
        cells = cells_at(fast.particles, cells_of(fast.particles.position, GRID), GRID, *then)
        of_literal = cells_of_literal(literal.particles.position, GRID)
        assume(np.array_equal(cells, cells_at_literal(literal.particles, of_literal, GRID, *then)))
    assert_twins(fast, literal, 1e-4)
    assert ours.random() == theirs.random()


@TWINS
@given(states(), scans(), st.sampled_from([(0.93, 0.067, 0.003), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]))
def test_update(state, evidence, first_sight):
    world = WorldModel(first_sight=first_sight)
    assert_twins(update(state, GRID, evidence, world), update_literal(state, GRID, evidence, world), 1e-4)


@TWINS
@given(states(), st.sampled_from([1, 2, 3, 50, 500]), st.sampled_from([1e-9, 0.3, 0.9]), SEEDS)
def test_resample(state, n_particles, birth_share, seed):
    ours, theirs = np.random.default_rng(seed), np.random.default_rng(seed)
    params = CmcdotParams(n_particles=n_particles, birth_share=birth_share)
    assert_twins(resample(state, GRID, params, ours), resample_literal(state, GRID, params, theirs), 1e-6)
    assert ours.random() == theirs.random()


@TWINS
@given(SEEDS, LEVELS, scans())
def test_bof_update(seed, level, evidence):
    p = beliefs(np.random.default_rng(seed), level, len(LATTICE) + 2)
    state = BofState(p[0], p[1], p[2:], LATTICE.velocities, np.zeros((len(LATTICE), 2)))
    fast, literal = (f(state, GRID, evidence, BofParams(LATTICE)) for f in (bof_update, bof_update_literal))
    for name in ("free", "unknown", "occupied", "velocity", "remainder"):
        assert np.allclose(getattr(fast, name), getattr(literal, name), rtol=0, atol=1e-4), name
    assert literal.occupied.dtype == np.float64


@settings(deadline=None)
@given(
    st.lists(st.just(0.0) | st.floats(2**-20, 1, width=32), min_size=1, max_size=30).filter(any),
    st.integers(1, 200),
    st.floats(0, 1, exclude_max=True),
)
def test_systematic_resampling_draws_the_same_indices(weights, count, offset):
    weights = np.array(weights, np.float32)
    drawn = systematic_resample_literal(weights, count, offset)
    assert np.array_equal(drawn, systematic_resample(weights, count, offset))


@pytest.fixture
def nothing_compiled(monkeypatch):
    """Let every compiled function of the package raise an error."""

    def refuse(*arguments):
        raise AssertionError("a literal twin calls a compiled function")

    for module in [module for name, module in sys.modules.items() if name.startswith("semgrid_edu.")]:
        for name in [name for name, value in vars(module).items() if is_jitted(value)]:
            monkeypatch.setattr(module, name, refuse)


@pytest.mark.usefixtures("nothing_compiled")
def test_the_literal_twins_call_nothing_compiled():
    rng, evidence = np.random.default_rng(0), Evidence(np.full(GRID.shape, 0.8), np.full(GRID.shape, 0.05))
    state, params = FilterState.unknown(GRID), CmcdotParams(n_particles=50)
    with pytest.raises(AssertionError, match="a literal twin calls"):
        update(state, GRID, evidence, params)
    for _ in range(2):
        state = predict_literal(move_literal(state, GRID, PlanarMotion(0.5, 0, 0.1)), GRID, params, 0.1, rng)
        state = resample_literal(update_literal(state, GRID, evidence, params), GRID, params, rng)
    assert len(state.particles)
    lattice = BofParams(LATTICE)
    bof = BofState.nothing_known(GRID, LATTICE)
    bof_update_literal(bof_predict_literal(bof, GRID, lattice, 0.1), GRID, evidence, lattice)


OTHER = GridSpec(0, 12, -4, 4, 1)
SCAN = Evidence(*np.ones((2, *OTHER.shape)))


@pytest.mark.parametrize(
    ("step", "name"),
    [
        (lambda state, rng: move_literal(state, OTHER, PlanarMotion(1, 0, 0)), "state"),
        (lambda state, rng: predict_literal(state, OTHER, WorldModel(), 0.1, rng), "state"),
        (lambda state, rng: predict_literal(state, GRID, WorldModel(), -0.1, rng), "dt"),
        (lambda state, rng: update_literal(state, OTHER, SCAN, WorldModel()), "state"),
        (lambda state, rng: update_literal(state, GRID, SCAN, WorldModel()), "evidence"),
        (lambda state, rng: resample_literal(state, OTHER, CmcdotParams(), rng), "state"),
    ],
)
def test_literal_steps_refuse_what_the_fast_ones_refuse(step, name):
    with pytest.raises(ArgumentError, match=f"^{name}: expected"):
        step(FilterState.unknown(GRID), np.random.default_rng(0))


def test_the_literal_steps_make_a_filter():
    """Sixteen steps of a car that drives by at 8 m/s, a cell each: the literal filter finds it, and its velocity."""
    params, rng = CmcdotParams(n_particles=4000, max_acceleration=1.0), np.random.default_rng(0)
    road = GridSpec(0, 30, -1, 1, 1)
    state = FilterState.unknown(road)
    for step in range(16):
        hit = np.zeros(road.shape, bool)
        hit[26 - step : 28 - step] = True
        evidence = Evidence(np.where(hit, 0.8, 0.3), np.where(hit, 0.05, 0.7))
        state = predict_literal(move_literal(state, road, PlanarMotion()), road, params, 0.125, rng)
        state = resample_literal(update_literal(state, road, evidence, params), road, params, rng)
    belief = state.probability.mean(axis=2)
    assert belief[:, 11:13].argmax(axis=0).tolist() == [State.DYNAMIC] * 2
    assert (belief[:, 13:].argmax(axis=0) == State.FREE).all()
    assert abs(np.average(state.particles.velocity[:, 0], weights=state.particles.weight) - 8) < 1

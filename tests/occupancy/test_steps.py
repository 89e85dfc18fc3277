"""The four steps, each by itself: one cell against filterpy, and what each must conserve."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy import discrete_bayes
from filterpy.monte_carlo import resampling
from hypothesis import example, given, settings
from hypothesis import strategies as st

from semgrid_edu import fast, occupancy
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    CmcdotParams,
    Evidence,
    FilterState,
    Particles,
    PlanarMotion,
    State,
    move,
    predict,
    resample,
    transition_matrix,
    update,
)
from semgrid_edu.occupancy.state import cells_of, systematic_resample, weight_in_cells

GRID = GridSpec(0, 6, -2, 2, 1)
PARAMS = CmcdotParams(n_particles=2000)
BELIEFS = st.lists(st.floats(0.01, 1), min_size=4, max_size=4).map(lambda p: np.array(p) / sum(p))


def state_of(probability: np.ndarray, spec: GridSpec, seed: int = 0, speed: float = 3.0) -> FilterState:
    """Return a state whose dynamic mass is carried by particles, four a cell."""
    rng = np.random.default_rng(seed)
    centres = np.repeat(spec.centers().reshape(-1, 2), 4, axis=0)
    position = (centres + rng.uniform(-0.4, 0.4, centres.shape) * spec.cell).astype(np.float32)
    velocity = rng.normal(0, speed, position.shape).astype(np.float32)
    weight = np.repeat(probability[State.DYNAMIC].ravel() / 4, 4).astype(np.float32)
    return FilterState(probability.astype(np.float32), Particles(position, velocity, weight), np.zeros(spec.shape))


def random_state(seed: int) -> FilterState:
    probability = np.random.default_rng(seed).dirichlet(np.full(4, 0.3), GRID.shape)
    return state_of(np.moveaxis(probability, -1, 0), GRID, seed)


def assert_sound(state: FilterState, spec: GridSpec) -> None:
    """Each cell sums to 1, and its dynamic probability is what its particles carry plus what is newborn."""
    assert np.abs(state.probability.sum(axis=0) - 1).max() < 1e-5
    assert state.probability.min() >= -1e-6
    carried = weight_in_cells(state.particles.weight, cells_of(state.particles.position, spec), spec.shape)
    assert np.allclose(carried + state.newborn, state.probability[State.DYNAMIC], atol=1e-5)


@settings(deadline=None, max_examples=40)
@given(BELIEFS, st.floats(0, 2), st.lists(st.tuples(*[st.floats(0.01, 1)] * 2), min_size=3, max_size=3))
def test_one_cell_that_nothing_leaves_is_filterpys_discrete_bayes(belief, dt, scans):
    """Particles at rest in one cell, that don't stop by themselves: then only the matrix and Bayes' rule are left."""
    spec = GridSpec(0, 1, 0, 1, 1)
    params = replace(PARAMS, stop_rate=0.0, max_acceleration=0.0)
    state, rng = state_of(belief[:, None, None], spec, speed=0.0), np.random.default_rng(0)
    expected = belief.copy()
    for occupied, free in scans:
        predicted = predict(state, spec, params, dt, rng)
        expected = transition_matrix(params, dt).T @ expected
        assert np.allclose(predicted.probability[:, 0, 0], expected, atol=1e-5)
        if occupied != free:  # a cell that is seen isn't unknown: the same as one more transition
            expected = expected + expected[State.UNKNOWN] * np.array([*params.first_sight, -1])
        state = update(predicted, spec, Evidence(np.array([[occupied]]), np.array([[free]])), params)
        expected = discrete_bayes.update(np.array([free, occupied, occupied, free]), expected)
        assert np.allclose(state.probability[:, 0, 0], expected, atol=1e-5)
        assert_sound(state, spec)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 1000),
    st.floats(0, 1),
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(-4, 4),
    st.sampled_from([0, 1e-30, 0.3, 1]),
)
@example(
    seed=255, dt=0.0, dx=0.0, dy=0.5, dyaw=-1.5, floor=0
)  # a cell that moving mass leaves, nearly all that was there
@example(seed=0, dt=2.225073858507e-311, dx=0.0, dy=0.0, dyaw=0.0, floor=1)  # mass too small to divide by
def test_every_step_conserves_probability(seed, dt, dx, dy, dyaw, floor):
    rng = np.random.default_rng(seed)
    evidence = Evidence(*np.maximum(rng.random((2, *GRID.shape)) ** 9, floor))
    state = random_state(seed)
    for step in (
        lambda s: move(s, GRID, PlanarMotion(dx, dy, dyaw)),
        lambda s: predict(s, GRID, PARAMS, dt, rng),
        lambda s: update(s, GRID, evidence, PARAMS),
        lambda s: resample(s, GRID, PARAMS, rng),
    ):
        state = step(state)
        assert_sound(state, GRID)


def test_a_shift_by_whole_cells_is_exact_and_what_enters_is_unknown():
    state = random_state(1)
    moved = move(state, GRID, PlanarMotion(2, 1, 0))
    assert np.allclose(moved.probability[:, 2:, 1:], state.probability[:, :-2, :-1], atol=1e-6)
    assert (moved.probability[State.UNKNOWN, :2] == 1).all()
    assert (moved.probability[State.UNKNOWN, :, 0] == 1).all()
    assert np.allclose(moved.particles.position, state.particles.position - [2, 1], atol=1e-5)


def test_a_half_turn_turns_the_belief_and_its_velocities():
    spec = GridSpec(-3, 3, -2, 2, 1)
    state = state_of(np.moveaxis(np.random.default_rng(0).dirichlet(np.ones(4), spec.shape), -1, 0), spec)
    turned = move(state, spec, PlanarMotion(dyaw=np.pi))
    assert np.allclose(turned.probability, state.probability[:, ::-1, ::-1], atol=1e-6)
    assert np.allclose(turned.particles.velocity, -state.particles.velocity, atol=1e-5)


def test_no_time_no_change():
    state = random_state(2)
    predicted = predict(state, GRID, replace(PARAMS, max_acceleration=0.0), 0.0, np.random.default_rng(0))
    assert np.allclose(predicted.probability, state.probability, atol=1e-6)
    assert not predicted.newborn.any()


def test_what_was_all_but_impossible_is_certain_when_it_alone_explains_the_scan():
    probability = np.zeros((4, 1, 1), np.float32)
    probability[:, 0, 0] = [1, 0, 1e-40, 0]
    mover = Particles(np.full((1, 2), 0.5, np.float32), np.ones((1, 2), np.float32), probability[State.DYNAMIC, 0])
    state = FilterState(probability, mover, np.zeros((1, 1), np.float32))
    updated = update(state, GridSpec(0, 1, 0, 1, 1), Evidence(np.ones((1, 1)), np.zeros((1, 1))), PARAMS)
    assert updated.probability[State.DYNAMIC, 0, 0] == 1
    assert_sound(updated, GridSpec(0, 1, 0, 1, 1))


@pytest.mark.parametrize("certain", [State.FREE, State.STATIC])
def test_contradiction_leaves_nothing_known(certain):
    probability = np.zeros((4, 1, 1), np.float32)
    probability[certain] = 1
    state = FilterState(probability, Particles.none(), np.zeros((1, 1)))
    impossible = np.array([[float(certain == State.FREE)]])
    updated = update(state, GridSpec(0, 1, 0, 1, 1), Evidence(impossible, 1 - impossible), PARAMS)
    assert updated.probability[:, 0, 0].tolist() == [0, 0, 0, 1]


@settings(deadline=None)
@given(st.lists(st.integers(0, 40), min_size=1, max_size=50), st.integers(0, 2**20 - 1))
def test_systematic_resampling_is_filterpys_given_its_offset(weights, offset):
    """Filterpy draws its one random number from the global generator; here both are given the same.

    Weights are multiples of 2^-11, so that they add up to 1 exactly, and the offset isn't the last number below 1:
    otherwise filterpy looks beyond the last weight.
    """
    offset = offset / 2**20
    weights = np.array([*weights, 2**11 - sum(weights)]) / 2**11
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resampling, "random", lambda: offset)
        expected = resampling.systematic_resample(weights)
    assert np.array_equal(systematic_resample(weights, len(weights), offset), expected)


def test_systematic_resampling_adds_up_in_double_precision():
    weights = np.random.default_rng(0).random(200_000, np.float32)
    drawn = systematic_resample(weights, 140_000, 0.5)
    assert np.array_equal(drawn, systematic_resample(weights.astype(np.float64), 140_000, 0.5))


@settings(deadline=None)
@given(
    st.lists(st.just(0.0) | st.floats(1e-6, 1), min_size=1, max_size=30).filter(any),
    st.integers(1, 200),
    st.floats(0, 0.999),
)
def test_systematic_resampling_draws_each_floor_or_ceil_of_its_share(weights, count, offset):
    drawn = np.bincount(systematic_resample(np.array(weights), count, offset), minlength=len(weights))
    assert drawn.sum() == count
    assert (np.abs(drawn - count * np.array(weights) / sum(weights)) < 1 + 1e-9).all()


def test_resampling_spends_particles_where_dynamic_mass_is():
    probability = np.full((4, *GRID.shape), 0.1)
    probability[:, 2, 1] = [0.1, 0.1, 0.7, 0.1]
    probability[State.FREE] += 1 - probability.sum(axis=0)
    again = resample(state_of(probability, GRID), GRID, PARAMS, np.random.default_rng(0))
    count = np.bincount(cells_of(again.particles.position, GRID), minlength=24).reshape(GRID.shape)
    drawn = (1 - PARAMS.birth_share) * PARAMS.n_particles
    expected = drawn * probability[State.DYNAMIC] / probability[State.DYNAMIC].sum()
    assert np.abs(count - expected).max() <= 5  # four particles a cell, each drawn floor or ceil times
    assert_sound(again, GRID)


@settings(deadline=None)
@given(
    st.lists(st.sampled_from([0.0, 1e-3]) | st.floats(0, 20), min_size=16, max_size=16),
    st.floats(0, 100) | st.sampled_from([0.0, 1e-9, 0.1]),
)
def test_transition_matrix_holds_probabilities_and_composes_over_time(rates, dt):
    """Chapman-Kolmogorov: two steps of dt are one of 2 dt. No time is no change."""
    world = replace(PARAMS, rates=tuple(map(tuple, np.reshape(rates, (4, 4)))))
    M = transition_matrix(world, dt)
    np.testing.assert_allclose(M @ M, transition_matrix(world, 2 * dt), atol=1e-10)
    np.testing.assert_allclose(M.sum(axis=1), 1, atol=1e-10)
    assert M.min() >= 0
    assert np.array_equal(transition_matrix(world, 0.0), np.eye(4))


def test_transition_matrix_over_ages_is_where_the_chain_ends():
    """By default nothing leaves UNKNOWN."""
    for dt in (1e6, 1e30, 1e308):
        np.testing.assert_allclose(transition_matrix(PARAMS, dt), np.outer(np.ones(4), [0, 0, 0, 1]), atol=1e-12)


@pytest.mark.parametrize("dt", [-0.1, np.nan, np.inf])
def test_time_that_runs_backwards_is_refused(dt):
    with pytest.raises(ArgumentError, match="dt"):
        transition_matrix(PARAMS, dt)


@pytest.mark.parametrize(
    "bad",
    [
        {"n_particles": 0},
        {"n_particles": 1.5},
        {"rates": ((1, 2), (3, 4))},
        {"stop_speed": 0.0},
        {"max_speed": -1.0},
        {"birth_share": 1.0},
        {"first_sight": (0.5, 0.5, 0.5)},
    ],
)
def test_impossible_parameters_are_refused_by_name(bad):
    with pytest.raises(ArgumentError, match=next(iter(bad))):
        CmcdotParams(**bad)


OTHER = GridSpec(0, 12, -4, 4, 1)


@pytest.mark.parametrize(
    ("step", "name"),
    [
        (lambda of, state, rng: of.move(state, OTHER, PlanarMotion(1, 0, 0)), "state"),
        (lambda of, state, rng: of.predict(state, OTHER, PARAMS, 0.1, rng), "state"),
        (lambda of, state, rng: of.resample(state, OTHER, PARAMS, rng), "state"),
        (lambda of, state, rng: of.update(state, OTHER, Evidence(*np.ones((2, *OTHER.shape))), PARAMS), "state"),
        (lambda of, state, rng: of.update(state, GRID, Evidence(*np.ones((2, *OTHER.shape))), PARAMS), "evidence"),
        (lambda of, state, rng: of.update(state, GRID, Evidence(*np.ones((2, 1, 4))), PARAMS), "evidence"),
    ],
)
@pytest.mark.parametrize("module", [occupancy, fast], ids=["book", "fast"])
def test_a_belief_or_a_scan_over_other_cells_is_refused(module, step, name):
    """Such as over the vehicle's cells instead of the map's: compiled loops would read past the end of them."""
    with pytest.raises(ArgumentError, match=f"^{name}: expected shape"):
        step(module, random_state(0), np.random.default_rng(0))


@pytest.mark.parametrize("field", ["position", "velocity", "weight"])
def test_particles_of_which_something_is_missing_are_refused(field):
    particles = random_state(0).particles
    with pytest.raises(ArgumentError, match="expected shape"):
        replace(particles, **{field: getattr(particles, field)[:-1]})


def test_a_state_whose_planes_differ_in_size_is_refused():
    with pytest.raises(ArgumentError, match=r"^probability: expected shape"):
        replace(random_state(0), newborn=np.zeros(OTHER.shape))

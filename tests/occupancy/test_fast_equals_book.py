"""The compiled twins equal the book's functions, over anything that a cell or a scan can hold.

The compiled ones compute in single precision, which rounds probabilities by up to 6e-8. So they agree to 1e-6. Two
formulas divide by as little as 1e-3 (`MAX_MOVE_PROBABILITY`), so that a rounded number counts a thousandfold: where an
arrival meets a cell that is all but certainly STATIC, and where a thing that has all but certainly left was taken for a
static one. So predictions and updates agree to 1e-4.
"""

import copy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from worlds.lecture_02_boxes import Box, scan_boxes

from semgrid_edu import fast, occupancy
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast.occupancy import cellwise
from semgrid_edu.fast.occupancy import cmcdot as fast_cmcdot
from semgrid_edu.fast.occupancy import particles as fast_particles
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    CmcdotParams,
    Evidence,
    FilterState,
    Particles,
    PlanarMotion,
    SensorModel,
    State,
    Walls,
    WorldModel,
    steps,
)
from semgrid_edu.occupancy.cmcdot import velocity_moments
from semgrid_edu.occupancy.planar_motion import look_up
from semgrid_edu.occupancy.polar import GroundParams, height_above_ground
from semgrid_edu.occupancy.state import cells_of, systematic_resample

GRID = GridSpec(0, 6, -2, 2, 1)
SEEDS = st.integers(0, 10**6)
LEVELS = st.sampled_from([0.1, 1.0])
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
    rng = np.random.default_rng(draw(SEEDS))
    n = draw(st.sampled_from([0, 1, 5, 80]))
    probability = beliefs(rng, draw(LEVELS), 4)
    newborn = probability[State.DYNAMIC] * (rng.random(GRID.shape) * (rng.random(GRID.shape) < 0.5)).astype(np.float32)
    position = rng.uniform((-1, -3), (7, 3), (n, 2)).astype(np.float32)
    velocity = draw(st.sampled_from([0.0, 0.4, 5.0, 60.0])) * rng.normal(0, 1, (n, 2)).astype(np.float32)
    weight = draw(st.sampled_from([0.0, 0.01, 0.5, 5.0])) * rng.random(n, np.float32)  # 5: one alone overcrowds a cell
    particles = Particles(position, velocity.astype(np.float32), weight.astype(np.float32))
    return FilterState(probability, particles, newborn)


@st.composite
def scans(draw) -> Evidence:
    """Any likelihoods: some cells unseen, some certain, and some that contradict all that is believed."""
    rng = np.random.default_rng(draw(SEEDS))
    floor = draw(st.sampled_from([0, 1e-30, 0.05]))
    occupied, free = np.maximum(rng.random((2, *GRID.shape)) ** 9, floor) * (rng.random((2, *GRID.shape)) < 0.8)
    unseen = rng.random(GRID.shape) < 0.3
    return Evidence(occupied.astype(np.float32), np.where(unseen, occupied, free).astype(np.float32))


@st.composite
def motions(draw) -> PlanarMotion:
    """No motion, shifts by whole cells and parts of them, turns, and jumps beyond the map."""
    steps = draw(st.tuples(st.integers(-24, 24), st.integers(-24, 24), st.integers(-250, 250) | st.just(0)))
    return PlanarMotion(steps[0] / 8 * draw(st.sampled_from([1, 1, 40])), steps[1] / 8, steps[2] / 64)


def assert_equal(compiled: FilterState, book: FilterState, tolerance: float) -> None:
    """Hold two states equal, unless rounding has put a particle into another cell."""
    ours, theirs = compiled.particles, book.particles
    assert len(ours) == len(theirs)
    assert compiled.probability.dtype == ours.weight.dtype == np.float32
    np.testing.assert_allclose(ours.position, theirs.position, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(ours.velocity, theirs.velocity, rtol=1e-5, atol=1e-5)
    assume(np.array_equal(fast_particles.cells_of(ours.position, GRID), cells_of(theirs.position, GRID)))
    np.testing.assert_allclose(compiled.probability, book.probability, rtol=0, atol=tolerance)
    np.testing.assert_allclose(compiled.newborn, book.newborn, rtol=0, atol=tolerance)
    np.testing.assert_allclose(ours.weight, theirs.weight, rtol=tolerance, atol=tolerance)


@TWINS
@given(states(), motions())
def test_move(state, motion):
    assert_equal(fast.move(state, GRID, motion), occupancy.move(state, GRID, motion), 1e-6)


@TWINS
@given(
    states(),
    st.sampled_from([0.0, 0.04, 0.1, 1.0, 1e6]),
    st.sampled_from([WorldModel(), WorldModel(walls=None, max_acceleration=0.0), WorldModel(stop_speed=3.0), SLOW]),
    st.sampled_from([(0.0, 0.0), (0.1, 0.0), (6.0, -8.0)]),
    SEEDS,
)
def test_predict(state, dt, world, driven, seed):
    state = fast.move(state, GRID, PlanarMotion(0, 0, 0))  # makes the weights of each cell sum up to what it holds
    ours, theirs = np.random.default_rng(seed), np.random.default_rng(seed)
    compiled = fast.predict(state, GRID, world, dt, ours, driven)
    book = occupancy.predict(state, GRID, world, dt, theirs, driven)
    if world.walls is not None:
        assume(looks_alike(compiled.particles, book.particles, world.walls, driven, dt))
    assert_equal(compiled, book, 1e-4)
    assert ours.random() == theirs.random()


def looks_alike(compiled: Particles, book: Particles, walls: Walls, driven: tuple[float, float], dt: float) -> bool:
    """Say whether rounding leaves each particle's other places in the same cells, and its pace the same."""
    velocity = np.array(driven) / dt if dt > 0 else np.zeros(2)
    halt = walls.second_look * walls.clearing_time
    least = walls.clearing_cells * GRID.cell / halt if halt > 0 else np.inf
    keeps = fast_particles.keeps_pace.py_func(*compiled.velocity.T, *velocity, least)
    alike = np.array_equal(keeps, walls.keeps_pace(book.velocity, velocity, GRID.cell))
    cells = fast_particles.cells_of(compiled.position, GRID)
    for fraction in (-1, -walls.second_look, 1):
        time = fraction * walls.clearing_time
        there = fast_particles.cells_at(compiled, cells, GRID, time, walls.clearing_cells)
        then = cells_of(book.position + walls.displacement(book.velocity, GRID.cell, fraction), GRID)
        alike &= np.array_equal(there, np.where(then == cells, -1, then))
    return alike


@TWINS
@given(
    states(),
    scans(),
    st.sampled_from([(0.93, 0.067, 0.003), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]),
    st.sampled_from([Walls(), None]),
)
def test_update(state, evidence, first_sight, walls):
    world = WorldModel(first_sight=first_sight, walls=walls)
    assert_equal(fast.update(state, GRID, evidence, world), occupancy.update(state, GRID, evidence, world), 1e-4)


@pytest.mark.parametrize("static", [0.0, 5e-310, 1e-300])
def test_the_posterior_is_a_distribution_however_little_explains_the_scan(static):
    """Only STATIC explains a hit here, and its prior is below or above the smallest normal number."""
    prior = np.array([1 - static, static, 0, 0]).reshape(4, 1, 1)
    evidence = Evidence(np.full((1, 1), 0.8), np.zeros((1, 1)))
    for posterior, _ in (steps.bayes(prior, evidence), cellwise.bayes(prior, evidence.occupied, evidence.free)):
        np.testing.assert_allclose(posterior.sum(axis=0), 1)
        assert posterior.argmax() == (State.STATIC if static > 1e-305 else State.UNKNOWN)


@pytest.mark.parametrize("both", [0.0, 1e-30, 0.5])
@TWINS
@given(states())
def test_where_both_likelihoods_are_equal_a_scan_tells_nothing(both, state):
    evidence = Evidence(*np.full((2, *GRID.shape), both))
    for update in (fast.update, occupancy.update):
        updated = update(state, GRID, evidence, WorldModel(walls=None))
        np.testing.assert_allclose(updated.probability, state.probability, atol=1e-6)
        inside = cells_of(state.particles.position, GRID) >= 0
        np.testing.assert_allclose(updated.particles.weight[inside], state.particles.weight[inside], rtol=1e-5)


@TWINS
@given(states(), st.sampled_from([1, 2, 3, 50, 500]), st.sampled_from([1e-9, 0.3, 0.9]), SEEDS)
def test_resample(state, n_particles, birth_share, seed):
    ours, theirs = np.random.default_rng(seed), np.random.default_rng(seed)
    params = CmcdotParams(n_particles=n_particles, birth_share=birth_share)
    compiled = fast.resample(state, GRID, params, ours)
    assert_equal(compiled, occupancy.resample(state, GRID, params, theirs), 1e-6)
    assert ours.random() == theirs.random()


@settings(deadline=None)
@given(
    st.lists(st.just(0.0) | st.floats(2**-20, 1, width=32), min_size=1, max_size=30).filter(any),
    st.integers(1, 200),
    st.floats(0, 1, exclude_max=True),
)
def test_systematic_resampling_draws_the_same_indices(weights, count, offset):
    weights = np.array(weights, np.float32)
    drawn = systematic_resample(weights, count, offset)
    assert np.array_equal(drawn, fast.systematic_resample(weights, count, offset))


@pytest.mark.parametrize("of", [occupancy.state, fast], ids=["book", "fast"])
@pytest.mark.parametrize("count", [1, 5, 1000])
def test_systematic_resampling_never_draws_a_weight_of_zero(of, count):
    """The largest offset below 1, which rounding puts on the very end of all weights."""
    weights = np.r_[0.0, 0.0, np.random.default_rng(0).random(5), np.zeros(993)]
    for offset in (0.0, np.nextafter(1.0, 0)):
        drawn = of.systematic_resample(weights, count, offset)
        assert (weights[drawn] > 0).all()
        assert drawn[-1] == 6 or count < 5


@given(st.lists(st.floats(0, 5), min_size=16, max_size=16), st.floats(0, 60) | st.sampled_from([0.0, 1e6, 1e30]))
def test_transition_matrix(rates, dt):
    world = WorldModel(rates=tuple(tuple(row) for row in np.reshape(rates, (4, 4)).tolist()))
    M = occupancy.transition_matrix(world, dt)
    np.testing.assert_allclose(M, fast.transition_matrix(world, dt), rtol=0, atol=1e-6)
    assert (M >= 0).all()


@settings(deadline=None, max_examples=15)
@given(
    st.lists(st.tuples(st.floats(4, 30), st.floats(-9, 7), st.floats(0.3, 4), st.floats(0.2, 3)), max_size=5),
    st.floats(-0.08, 0.08),
    st.floats(-0.3, 0.3),
    st.sampled_from([np.float32, np.float64]),
    SEEDS,
)
def test_heights_and_evidence(corners, pitch, roll, dtype, seed):
    """On sloping ground, with noise, holes in it, and sectors without returns; the vehicle turned in the grid."""
    rng = np.random.default_rng(seed)
    boxes = [Box(x, x + long, y, y + long, high) for x, y, long, high in corners]
    points = scan_boxes(boxes, columns=180, rings=24, noise=0.02, rng=rng).astype(dtype)
    points[:, 2] += pitch * points[:, 0] + roll * points[:, 1] - (rng.random(len(points)) < 0.01) * rng.uniform(0, 3)
    coarse = GroundParams(sectors=40, bin_length=1.0, farthest=40.0, neighbours=2)
    compiled = fast.height_above_ground(points, coarse)
    np.testing.assert_allclose(compiled, height_above_ground(points, coarse), rtol=0, atol=1e-5)

    spec, pose = GridSpec(0, 30, -10, 10, 0.5), PlanarMotion(pitch, roll, pitch)
    ours, theirs = (f(points, spec, SensorModel(), pose) for f in (fast.scan_evidence, occupancy.scan_evidence))
    differ = (ours.occupied != theirs.occupied) | (ours.free != theirs.free)
    assert differ.mean() < 1e-3  # a height or an azimuth may be rounded across a border


@given(SEEDS, motions())
def test_look_up_and_moments(seed, motion):
    rng = np.random.default_rng(seed)
    values, outside = rng.random((3, *GRID.shape), np.float32), np.float32([1, 2, 3])
    fine = GridSpec(-0.97, 8.03, -2.97, 3.03, 0.75)
    compiled, book = (f(values, outside, GRID, fine, motion) for f in (fast.look_up, look_up))
    assert (compiled != book).any(axis=0).mean() < 0.05  # a centre may be rounded across a border
    position, velocity = rng.uniform(-3, 7, (50, 2)), rng.normal(0, 9, (50, 2))
    particles = Particles(*(a.astype(np.float32) for a in (position, velocity, rng.random(50))))
    cells = fast_particles.cells_of(particles.position, GRID)
    for ours, theirs in zip(
        fast_cmcdot.velocity_moments(particles, cells, GRID.shape),
        velocity_moments(particles, cells, GRID.shape),
        strict=True,
    ):
        np.testing.assert_allclose(ours, theirs, rtol=1e-5, atol=1e-5)


def test_the_first_frames_of_a_drive_are_the_same_and_later_ones_much_alike():
    frames = [sample_drive()[k] for k in range(5)]
    spec = GridSpec.compact()
    drives = [list(track(frames, spec, seed=3, keep_steps=True)) for track in (fast.track_drive, occupancy.track_drive)]
    for k, (ours, theirs) in enumerate(zip(*drives, strict=True)):
        assert theirs.probability.dtype == theirs.velocity.dtype == np.float32
        assert list(ours.steps) == list(theirs.steps) == ["move", "predict", "update", "resample"]
        difference = np.abs(ours.probability - theirs.probability)
        assert difference.max() < 1e-5 or k >= 2
        assert difference.mean() < 1e-3


@pytest.mark.parametrize("module", [occupancy, fast])
def test_a_copied_tracker_goes_on_like_the_original(module):
    frames = [sample_drive()[k] for k in range(4)]
    tracker = module.DriveTracker(GridSpec.compact(), CmcdotParams(n_particles=5000))
    for frame in frames[:2]:
        tracker.step(frame)
    twin = copy.deepcopy(tracker)
    ours, theirs = ([one.step(frame).probability for frame in frames[2:]] for one in (tracker, twin))
    np.testing.assert_array_equal(ours, theirs)


def test_walls_with_rules_of_their_own_cannot_be_compiled():
    class OwnWalls(Walls):
        pass

    state = FilterState.unknown(GRID)
    with pytest.raises(ArgumentError, match=r"^walls: expected .*OwnWalls"):
        fast.predict(state, GRID, WorldModel(walls=OwnWalls()), 0.1, np.random.default_rng(0))


def test_the_compiled_steps_take_the_books_states():
    """A state in double precision gives the same as the same state rounded."""
    rng, motion = np.random.default_rng(0), PlanarMotion(0.5, 0, 0.1)
    probability = beliefs(rng, 1.0, 4).astype(np.float64)
    particles = Particles(rng.uniform((0, -2), (6, 2), (9, 2)), rng.normal(0, 3, (9, 2)), rng.random(9))
    state = FilterState(probability, particles, np.zeros(GRID.shape))
    assert fast.move(state, GRID, motion).probability.dtype == np.float32
    doubled = replace(state, newborn=state.newborn.astype(np.float32))
    np.testing.assert_array_equal(
        fast.move(state, GRID, motion).probability, fast.move(doubled, GRID, motion).probability
    )

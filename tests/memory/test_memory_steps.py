"""The steps of the memory: what must hold however a cell was seen."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory import (
    Look,
    MemoryParams,
    MemoryState,
    carry_classes,
    learn_classes,
    look_at,
    recall_classes,
)
from semgrid_edu.occupancy import State
from semgrid_edu.occupancy.state import OUTSIDE

GRID, S = GridSpec(0, 6, -2, 2, 1), 3
SAME, ONE = np.arange(24, dtype=np.int32).reshape(GRID.shape), np.zeros((1, 1), np.int32)
"""Numbers of cells, in the same grid and in a grid of one cell."""
FEW = settings(deadline=None, max_examples=40)
SEEDS = st.integers(0, 10**6)
PARAMS = st.builds(
    MemoryParams,
    near_exponent=st.floats(0, 1),
    decay_distance=st.floats(1, 100),
    max_weight=st.floats(1, 5),
    movable=st.just((1,)),
)


def frame(rng: np.random.Generator, level: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Any semantic grid and any occupancy grid. Some cells are certain, and in some the camera sees nothing."""
    g, o = (np.moveaxis(rng.dirichlet(np.full(n, level), GRID.shape), -1, 0) for n in (S + 4, 4))
    g[:S] *= rng.random(GRID.shape) < 0.7
    g[-1] += 1 - g.sum(axis=0)
    return g.astype(np.float32), o.astype(np.float32)


def memories(rng: np.random.Generator, params: MemoryParams) -> MemoryState:
    """Any memory: some cells were never seen, and moving things are anywhere in their cells."""
    memory = MemoryState.empty(S, GRID)
    memory.evidence[:] = rng.normal(0, 3, memory.evidence.shape)
    memory.seen[:] = rng.random(memory.seen.shape) * (rng.random(memory.seen.shape) < 0.7)
    memory.weight[:] = (memory.seen > 0) * rng.uniform(0.1, 1, memory.seen.shape) * params.max_weight
    memory.evidence[:] *= (memory.seen > 0)[:, None]
    memory.offset[:] = rng.uniform(-0.5, 0.5, memory.offset.shape)
    return memory


@FEW
@given(SEEDS, PARAMS)
def test_what_is_recalled_is_a_distribution_and_what_is_learnt_stays_within_its_limits(seed, params):
    rng = np.random.default_rng(seed)
    memory, (g, o) = memories(rng, params), frame(rng)
    places = np.maximum(rng.permutation(SAME.ravel() - 3), OUTSIDE).reshape(SAME.shape)
    look = look_at(g, o, GRID, params)
    recalled = recall_classes(memory, SAME, o, look, params)
    assert recalled.min() >= 0
    np.testing.assert_allclose(recalled.sum(axis=0), 1, atol=1e-5)
    learnt = learn_classes(memory, places, look, params)
    assert learnt.weight.max() <= params.max_weight + 1e-9
    assert (learnt.seen >= memory.seen - 1e-12).all()
    assert learnt.seen.max() <= 1
    for name in ("evidence", "weight", "seen", "offset"):  # the frame tells nothing about cells outside its grid
        before, after = (getattr(one, name)[..., places == OUTSIDE] for one in (memory, learnt))
        np.testing.assert_array_equal(after, before)


@FEW
@given(SEEDS, PARAMS)
def test_a_first_frame_is_kept_as_it_is(seed, params):
    """With nothing remembered, the semantic classes keep their probabilities, and o names the unknown ones."""
    g, o = frame(np.random.default_rng(seed), level=1.0)
    recalled = recall_classes(MemoryState.empty(S, GRID), SAME, o, look_at(g, o, GRID, params), params)
    seen = g[:S].sum(axis=0) > 0
    np.testing.assert_allclose(recalled[:S, seen], g[:S, seen], atol=1e-5)
    np.testing.assert_allclose(recalled[S:], o * (1 - g[:S].sum(axis=0)), atol=1e-5)


def test_the_same_frame_again_and_again_is_worth_at_most_what_all_frames_may_be():
    """By hand: two classes, 0.8 and 0.2; after many frames the odds are 4 to the power `max_weight`."""
    params = MemoryParams(near_exponent=0.5, decay_distance=1e9, max_weight=2.0, movable=())
    spec = GridSpec(0, 1, 0, 1, 1)
    g, o = (
        np.array([0.8, 0.2, 0, 0, 0, 0], np.float32).reshape(6, 1, 1),
        np.eye(4, dtype=np.float32)[0].reshape(4, 1, 1),
    )
    look, memory, odds = look_at(g, o, spec, params), MemoryState.empty(2, spec), []
    for _ in range(5):
        recalled = recall_classes(memory, ONE, o, look, params)[:, 0, 0]
        odds.append(recalled[0] / recalled[1])
        memory = learn_classes(memory, ONE, look, params)
    np.testing.assert_allclose(odds, 4 ** np.array([1, 1.5, 2, 2, 2]), rtol=1e-4)


@pytest.mark.parametrize("speed", [10.0, 1.4])
def test_what_moves_takes_its_class_along_without_blur_and_what_stays_keeps_its_class(speed):
    """A car of 4.5 m drives along a column for two seconds."""
    params, spec, dt = MemoryParams(change_rate=(0.0, 0.0)), GridSpec(0, 30, 0, 0.5, 0.5), 0.1
    memory, velocity = MemoryState.empty(S, spec), np.zeros((2, *spec.shape), np.float32)
    memory.evidence[0, 0], memory.weight[0], memory.seen[0], velocity[0] = 5, 1, 1, speed
    x = spec.centers()[..., 0]
    for step in range(21):
        car = np.abs(x - 4.75 - speed * dt * step) < 2.25
        if step == 0:
            memory.evidence[1, 1], memory.weight[1], memory.seen[1] = 7 * car, car, car
        memory = carry_classes(memory, np.float32(0.9 * car), velocity, 0.5, dt if step else 0.0, params)
        middle = np.abs(x - 4.75 - speed * dt * step) < 1.5
        np.testing.assert_array_equal(memory.evidence[1, 1, middle], 7)
        assert not memory.seen[1, ~car].any()
    assert (memory.evidence[0, 0] == 5).all()


def test_a_car_that_comes_into_view_is_believed_at_once():
    """A road was seen a hundred times; then one frame shows a car with 0.9, and the result does too."""
    params, spec = MemoryParams(movable=(1,)), GridSpec(0, 1, 0, 1, 1)
    o = np.eye(4, dtype=np.float32)[State.STATIC].reshape(4, 1, 1)
    road, car = (np.array([p, 1 - p, 0, 0, 0, 0], np.float32).reshape(6, 1, 1) for p in (0.95, 0.1))
    memory = MemoryState.empty(2, spec)
    for _ in range(100):
        memory = learn_classes(memory, ONE, look_at(road, o, spec, params), params)
    assert recall_classes(memory, ONE, o, look_at(car, o, spec, params), params)[1, 0, 0] > 0.8


@pytest.mark.parametrize(("o", "still_there"), [((1, 0, 0, 0), 0.01), ((0, 1, 0, 0), 0.9), ((0, 0, 0, 1), 0.8181818)])
def test_a_remembered_car_counts_only_as_far_as_something_is_there(o, still_there):
    """By hand: the memory has car with 0.9; FREE leaves 0.001 of it, UNKNOWN 1/2: 0.45 / (0.45 + 0.1)."""
    params, spec = MemoryParams(movable=(1,)), GridSpec(0, 1, 0, 1, 1)
    o = np.array(o, np.float32).reshape(4, 1, 1)
    car = look_at(np.array([0.1, 0.9, 0, 0, 0, 0], np.float32).reshape(6, 1, 1), o, spec, params)
    memory = learn_classes(MemoryState.empty(2, spec), ONE, car, params)
    blind = Look(*np.zeros((2, 2, 1, 1), np.float32), *np.zeros((3, 1, 1), np.float32))
    assert recall_classes(memory, ONE, o, blind, params)[1, 0, 0] == pytest.approx(still_there, abs=1e-2)


@FEW
@given(SEEDS, PARAMS)
def test_where_the_camera_sees_the_frame_alone_decides_on_what_comes_and_goes(seed, params):
    rng = np.random.default_rng(seed)
    memory, (g, o) = memories(rng, params), frame(rng)
    g[S:] = 0
    g[:S] = np.moveaxis(rng.dirichlet(np.ones(S), GRID.shape), -1, 0)
    recalled = recall_classes(memory, SAME, o, look_at(g, o, GRID, params), params)
    np.testing.assert_allclose(recalled[1], g[1], atol=1e-5)


def test_ground_under_a_moving_car_isnt_learnt_as_car():
    params, spec = MemoryParams(movable=(1,)), GridSpec(0, 1, 0, 1, 1)
    g = np.array([0.05, 0.95, 0, 0, 0, 0], np.float32).reshape(6, 1, 1)
    o = np.array([0.0, 0.01, 0.99, 0.0], np.float32).reshape(4, 1, 1)
    memory = learn_classes(MemoryState.empty(2, spec), ONE, look_at(g, o, spec, params), params)
    gone = np.eye(4, dtype=np.float32)[State.FREE].reshape(4, 1, 1)
    blind = Look(*np.zeros((2, 2, 1, 1), np.float32), *np.zeros((3, 1, 1), np.float32))
    recalled = recall_classes(memory, ONE, gone, blind, params)[:, 0, 0]
    assert recalled[2] > 0.98  # unknown-free: the ground below the car was never seen


def test_grids_of_another_shape_are_rejected():
    g, o = frame(np.random.default_rng(0))
    for grid, name in ((g[:, 1:], "grid"), (g[:4], "grid")):
        with pytest.raises(ArgumentError, match=name):
            look_at(grid, o, GRID, MemoryParams())
    with pytest.raises(ArgumentError, match="occupancy"):
        look_at(g, o[:3], GRID, MemoryParams())
    with pytest.raises(ArgumentError, match="movable: expected numbers of semantic classes, 0 to 2"):
        look_at(g, o, GRID, MemoryParams())


@pytest.mark.parametrize(
    "bad", [{"near_exponent": 1.5}, {"decay_distance": 0.0}, {"max_weight": 0.5}, {"change_rate": (0.1,)}]
)
def test_impossible_parameters_are_rejected(bad):
    with pytest.raises(ArgumentError, match=next(iter(bad))):
        MemoryParams(**bad)

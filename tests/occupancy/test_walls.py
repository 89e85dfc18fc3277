"""Where a particle was: what comes out of a standing thing or past a porous one, and what a moving thing leaves."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds.lecture_04_scenes import known_scenes
from worlds.lecture_04_street_scores import StreetScores
from worlds.lecture_04_suspects import Suspect, run_filter

from semgrid_edu import fast
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    CmcdotParams,
    Evidence,
    FilterState,
    Particles,
    State,
    Walls,
    WorldModel,
    predict,
    update,
)
from semgrid_edu.occupancy.bof import origins
from semgrid_edu.occupancy.state import MAX_MOVE_PROBABILITY
from semgrid_edu.workshop.simulation import simulate

FREE, STATIC, DYNAMIC, UNKNOWN = State
ROW = GridSpec(0, 16, 0, 1, 1)
"""Sixteen cells ahead of the vehicle; row 0 is the farthest."""
STILL = WorldModel(rates=((0.0,) * 4,) * 4, stop_rate=0.0, max_acceleration=0.0)
"""Nothing changes its state or its velocity."""
BLIND = replace(STILL, walls=None)
"""The same for the paper's filter, which looks neither back nor ahead."""
ORIGIN, PASSED, BEFORE, TARGET, AHEAD = 13, 10, 9, 8, 3
"""Rows: where something at 10 m/s was 0.5 s, 0.2 s and 0.1 s before it gets into `TARGET`, and where it is 0.5 s on."""


def flying(static: float, target: State, ahead: State = UNKNOWN, weight: float = 0.5) -> FilterState:
    """Return a particle that flies ahead, out of a cell that is STATIC with this probability, into one of a state."""
    probability = np.zeros((4, *ROW.shape), np.float32)
    probability[FREE] = 1
    probability[:, ORIGIN, 0] = 1 - static, static, 0, 0
    probability[:, BEFORE, 0] = 1 - weight, 0, weight, 0
    probability[:, TARGET, 0], probability[:, AHEAD, 0] = np.eye(4)[target], np.eye(4)[ahead]
    position, velocity = np.array([[15.5 - BEFORE, 0.5]]), np.array([[10.0, 0.0]])
    particles = Particles(*(a.astype(np.float32) for a in (position, velocity)), np.array([weight], np.float32))
    return FilterState(probability, particles, np.zeros(ROW.shape, np.float32))


def with_another(state: FilterState, rows: int, weight: float) -> FilterState:
    """Add a particle of the same velocity, some rows below."""
    particles, shift = state.particles, np.array([[-rows, 0]], np.float32)
    both = Particles(
        np.concatenate([particles.position, particles.position + shift]),
        np.repeat(particles.velocity, 2, axis=0),
        np.append(particles.weight, np.float32(weight)),
    )
    return replace(state, particles=both)


TWINS = pytest.mark.parametrize("predicted", [predict, fast.predict], ids=["book", "fast"])


@TWINS
@pytest.mark.parametrize("ahead", [UNKNOWN, STATIC])
@pytest.mark.parametrize(("static", "dynamic"), [(0.0, 0.5), (0.6, (0.5 - 0.0648) / (1 - 0.0648)), (1.0, 0.0)])
def test_along_a_wall_into_a_cell_nobody_has_seen_the_origin_counts(predicted, static, dynamic, ahead):
    """By hand: a = 0.5, b = 0.5 static^4, u = 1, so P(DYNAMIC) = (a - b) / (1 - b)."""
    state = predicted(flying(static, UNKNOWN, ahead), ROW, STILL, 0.1, np.random.default_rng(0))
    np.testing.assert_allclose(state.probability[:, TARGET, 0], [0, 0, dynamic, 1 - dynamic], atol=1e-6)
    np.testing.assert_allclose(state.particles.weight, [dynamic], atol=1e-6)


@TWINS
@pytest.mark.parametrize(
    ("target", "ahead", "world"),
    [(UNKNOWN, FREE, STILL), (FREE, UNKNOWN, STILL), (UNKNOWN, UNKNOWN, BLIND)],
)
def test_what_goes_out_into_the_open_is_believed(predicted, target, ahead, world):
    """Out of a wall, but with free space before it, or already in it; and by filters that don't look."""
    state = predicted(flying(1.0, target, ahead), ROW, world, 0.1, np.random.default_rng(0))
    np.testing.assert_allclose(state.probability[[target, DYNAMIC], TARGET, 0], 0.5, atol=1e-6)


@TWINS
def test_what_follows_something_that_moves_is_believed(predicted):
    """As the side of a long vehicle, of which the rear was taken for a standing thing: what moves ahead is no wall."""
    state = with_another(flying(1.0, UNKNOWN, DYNAMIC), AHEAD - BEFORE, 1.0)
    given = predicted(state, ROW, STILL, 0.1, np.random.default_rng(0))
    np.testing.assert_allclose(given.probability[[UNKNOWN, DYNAMIC], TARGET, 0], 0.5, atol=1e-6)


@TWINS
def test_a_cell_that_has_only_been_left_counts_as_unseen(predicted):
    """By hand: what was there, 0.4, flies on, so u = 0.4 and P(DYNAMIC) = (a - b u) / (1 - b u) with a = b = 0.5."""
    state = flying(1.0, FREE)
    state.probability[:, TARGET, 0] = 0.6, 0, 0.4, 0
    given = predicted(with_another(state, TARGET - BEFORE, 0.4), ROW, STILL, 0.1, np.random.default_rng(0))
    np.testing.assert_allclose(given.probability[DYNAMIC, TARGET, 0], 0.3 / 0.8, atol=1e-6)


@TWINS
@pytest.mark.parametrize(
    ("running_speed", "static", "dynamic"), [(9.0, 1.0, 0.0), (11.0, 1.0, 0.5), (9.0, 0.5, 0.46875 / 0.96875)]
)
def test_what_flies_fast_through_something_that_stands_is_doubted(predicted, running_speed, static, dynamic):
    """Something stands between origin and target; the particle flies at 10 m/s.

    By hand, with a = 0.5, u = 1 and b = P(STATIC)^4 a or 0, P(DYNAMIC) = (a - b) / (1 - b).
    """
    walls = Walls(clearing_cells=2.0, running_speed=running_speed)
    state = flying(0.0, UNKNOWN)
    state.probability[:, PASSED, 0] = 1 - static, static, 0, 0
    given = predicted(state, ROW, replace(STILL, walls=walls), 0.1, np.random.default_rng(0))
    np.testing.assert_allclose(given.probability[DYNAMIC, TARGET, 0], dynamic, atol=1e-6)


@TWINS
@pytest.mark.parametrize(("row", "dynamic"), [(ORIGIN, 0.0), (PASSED, 0.5)])
def test_a_cell_beside_counts_as_origin_but_not_on_the_way(predicted, row, dynamic):
    """A wall at an angle is a staircase; but a car was in its own cells shortly before. By hand as above."""
    spec = GridSpec(0, 16, -1, 2, 1)
    state = flying(0.0, UNKNOWN)
    probability = np.repeat(state.probability, 3, axis=2)
    probability[:, row, 0] = 0, 1, 0, 0
    state = replace(state, probability=probability, newborn=np.zeros(spec.shape, np.float32))
    given = predicted(state, spec, STILL, 0.1, np.random.default_rng(0))
    np.testing.assert_allclose(given.probability[DYNAMIC, TARGET, 1], dynamic, atol=1e-6)


@TWINS
@pytest.mark.parametrize(("driven", "dynamic"), [(0.0, 0.5), (0.4, 0.5), (1.0, (0.5 - 0.3) / (1 - 0.3))])
def test_a_place_beside_what_stands_is_no_open_space_to_what_keeps_pace_with_the_vehicle(predicted, driven, dynamic):
    """By hand: a = 0.5, u = 1, and b = 0.6 a because the cell beside it stands with probability 0.6."""
    state = flying(1.0, UNKNOWN, FREE)
    state.probability[:, AHEAD - 1, 0] = 0.4, 0.6, 0, 0
    given = predicted(
        state, ROW, replace(STILL, walls=Walls(clearing_cells=1.0)), 0.1, np.random.default_rng(0), (driven, 0.0)
    )
    np.testing.assert_allclose(given.probability[DYNAMIC, TARGET, 0], dynamic, atol=1e-6)


@TWINS
def test_who_steps_out_of_a_hedge_into_the_open_is_believed_although_the_vehicle_drives(predicted):
    """A pedestrian at 1.5 m/s, straight out of a hedge: all cells that it comes from stand."""
    street = GridSpec(0, 8, 0, 4, 0.5)  # 16 x 8 cells; the hedge fills the first three columns, the left ones
    probability = np.zeros((4, *street.shape), np.float32)
    probability[FREE, :, 3:] = probability[STATIC, :, :3] = 1
    probability[:, 8, 2] = 0, 0.5, 0.5, 0
    walker = Particles(*(np.array(a, np.float32) for a in ([[3.75, 2.55]], [[0.0, -1.5]], [0.5])))
    state = FilterState(probability, walker, np.zeros(street.shape, np.float32))
    given = predicted(state, street, STILL, 0.1, np.random.default_rng(0), (1.0, 0.0))
    np.testing.assert_allclose(given.probability[DYNAMIC, 8, 3], 0.5, atol=1e-6)


@TWINS
def test_a_car_that_drives_along_a_parked_row_is_believed_although_the_vehicle_drives(predicted):
    """Right beside cells that stand, in space that is free before it and behind it."""
    probability = np.zeros((4, 16, 2), np.float32)
    probability[FREE, :, 0] = probability[STATIC, :, 1] = 1
    probability[:, BEFORE, 0] = 0.5, 0, 0.5, 0
    state = replace(flying(0.0, FREE), probability=probability, newborn=np.zeros((16, 2), np.float32))
    state.particles.position[:, 1] = 1.5
    street, world = GridSpec(0, 16, 0, 2, 1), replace(STILL, walls=Walls(clearing_cells=1.0))
    given = predicted(state, street, world, 0.1, np.random.default_rng(0), (1.0, 0.0))
    np.testing.assert_allclose(given.probability[:, TARGET, 0], [0.5, 0, 0.5, 0], atol=1e-6)


@pytest.mark.parametrize("updated", [update, fast.update], ids=["book", "fast"])
@pytest.mark.parametrize(("world", "seen", "static"), [(STILL, False, 2 / 3), (STILL, True, 0.8), (BLIND, False, 0.8)])
def test_nothing_stands_where_something_has_come_from_unless_it_is_seen(updated, world, seen, static):
    """By hand: a = 0.5 and s = 0.8 leave (1 - a) s / (1 - a s). A scan that all but says nothing has still seen."""
    state = flying(0.8, FREE)
    state.particles.position[0, 0] += 1
    state.probability[:, TARGET, 0], state.probability[:, BEFORE, 0] = [0.5, 0, 0.5, 0], [1, 0, 0, 0]
    occupied, free = np.ones((2, *ROW.shape), np.float32)
    if seen:
        free[ORIGIN] = 1 - 1e-6
    given = updated(state, ROW, Evidence(occupied, free), world).probability
    np.testing.assert_allclose(given[[FREE, STATIC], ORIGIN, 0], [1 - static, static], atol=2e-6)


@pytest.mark.parametrize("velocity", [(1.0, 0.0), (-3.0, 4.0), (0.0, -6.0), (1e-3, 0.0), (0.0, 0.0)])
def test_the_filters_look_back_half_a_second_and_for_slow_things_three_cells(velocity):
    """By hand, with cells of 1 m: at 1 m/s three cells, at 5 m/s as well, at 6 m/s half a second."""
    v, speed = np.array([velocity]), np.linalg.norm(velocity)
    expected = -max(3.0, 0.5 * speed) * v / max(speed, 1e-30) if speed else 0 * v
    np.testing.assert_allclose(Walls().displacement(v, 1.0, -1), expected)
    np.testing.assert_array_equal(origins(v, ROW, Walls()), np.rint(expected))
    np.testing.assert_array_equal(Walls(clearing_time=0).displacement(v, 1.0, -1), 0)


@given(st.integers(0, 1000))
def test_without_walls_prediction_is_the_papers_formula(seed):
    """P(DYNAMIC) = [a (1 - s) + (1 - a) d] / (1 - a s), others (1 - a) P / (1 - a s), by plain loops over cells."""
    rng = np.random.default_rng(seed)
    own = rng.dirichlet(np.ones(4), 16)
    own[:, FREE] += own[:, DYNAMIC]
    own[:, DYNAMIC] = 0
    weight = rng.uniform(0, own[:, FREE])
    own[:, FREE] -= weight
    own[:, DYNAMIC] = weight
    jump = rng.integers(-2, 3, 16)  # whole cells that the particle of each cell flies in a step
    position = np.stack([15.5 - np.arange(16), np.full(16, 0.5)], axis=1)
    velocity = np.stack([jump / 0.1, np.zeros(16)], axis=1)
    state = FilterState(own.T[:, :, None], Particles(position, velocity, weight), np.zeros(ROW.shape))
    found = predict(state, ROW, BLIND, 0.1, rng).probability[:, :, 0].T

    for row in range(16):
        came = [k for k in range(16) if k - jump[k] == row and jump[k]]
        a = min(sum(weight[k] for k in came), MAX_MOVE_PROBABILITY)
        free, static, _, unknown = own[row]
        stays, left = (0, weight[row]) if jump[row] else (weight[row], 0)
        moves = a * (1 - static) + (1 - a) * stays
        expected = np.array([(1 - a) * (free + left), (1 - a) * static, moves, (1 - a) * unknown])
        np.testing.assert_allclose(found[row], expected / (1 - a * static), atol=1e-12)


@pytest.mark.parametrize("name", ["clearing_time", "clearing_cells", "second_look"])
@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_what_is_no_time_and_no_number_of_cells_is_refused(name, value):
    with pytest.raises(ArgumentError, match=name):
        Walls(**{name: value})


def test_walls_that_come_into_view_stay_static():
    """On a street of walls that come into view, half a second makes less than half as many phantoms as none."""
    spec, drive = GridSpec.compact(), simulate(9000, 25, "walls")
    scenes, looks, blind = list(known_scenes(drive, spec)), StreetScores(spec), StreetScores(spec)
    for scores, walls in ((looks, Walls()), (blind, None)):
        run_filter(drive, scenes, Suspect(params=CmcdotParams(walls=walls)), scores, seed=9)
    assert looks.cells["scenery"][0] == blind.cells["scenery"][0]
    assert looks.cells["scenery"][1] < blind.cells["scenery"][1] / 2

"""BOF against joint inference over all cells: where it is exact, where it isn't, and by how much."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from worlds.lecture_03_bof import (
    AT_THE_EDGE,
    HEAD_ON,
    STANDING_OR_DRIVING,
    TOWARDS_A_FENCE,
    bof_beliefs,
    expected_things,
    stands_or_drives,
)  # fmt: skip
from worlds.lecture_03_row import (
    NO_CHANGE,
    Cell,
    CellsInARow,
    exact_beliefs,
    hit_probability,
    row_evidence,
    row_model,
)  # fmt: skip
from worlds.lecture_04_cmcdot import FORGETTING

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import eliminate
from semgrid_edu.metrics import total_variation
from semgrid_edu.occupancy import SensorModel

WORLDS = [AT_THE_EDGE, STANDING_OR_DRIVING, HEAD_ON, TOWARDS_A_FENCE]
STEP = {Cell.STATIC: 0, Cell.LEFT: -1, Cell.RIGHT: 1}
LIKELIHOOD = {"x": (0.8, 0.05), ".": (0.3, 0.7), "?": (1.0, 1.0)}
"""Of an occupied cell and of a free one: the sensor model's defaults."""


def bof_errors(world):
    """Total variation between BOF's distribution of each cell and the exact one, (T, K)."""
    return total_variation(bof_beliefs(world), exact_beliefs(world))


def beliefs_by_counting_histories(world):
    """Move things about as a child would on squared paper: no factors, no elimination."""
    K, T = len(world.cells), len(world.scans)
    marginals = np.zeros((T, K, 5))
    for states in product(range(5), repeat=K):
        weight = np.prod([world.belief[k, state] for k, state in enumerate(states)])
        things = [(k, Cell(state)) for k, state in enumerate(states) if state not in (Cell.FREE, Cell.UNKNOWN)]
        for t in range(T):
            things = [(k + STEP[kind], kind) for k, kind in things if 0 <= k + STEP[kind] < K]
            held = dict(things)
            if len(held) < len(things):
                break
            for k, letter in enumerate(world.scans[t]):
                weight *= LIKELIHOOD[letter][0 if k in held else 1]
            for k in range(K):
                marginals[t, k, held.get(k, Cell.FREE)] += weight
    return marginals / marginals.sum(axis=-1, keepdims=True)


@pytest.mark.parametrize("world", WORLDS)
def test_joint_inference_is_what_counting_histories_gives(world):
    np.testing.assert_allclose(exact_beliefs(world), beliefs_by_counting_histories(world), atol=1e-12)


def test_bof_is_exact_for_one_moving_thing_that_nobody_sees():
    unseen = CellsInARow(({}, {"left": 0.5, "right": 0.4}, {}, {}), ("????",) * 3)
    assert bof_errors(unseen).max() < 1e-9
    assert exact_beliefs(unseen)[0, 0, Cell.LEFT] == pytest.approx(0.5)


@pytest.mark.parametrize("rates", [NO_CHANGE, FORGETTING])
def test_bof_is_exact_in_a_single_cell_where_nothing_moves(rates):
    world = CellsInARow(({"static": 0.4, "unknown": 0.3},), ("x", "?", "."), rates)
    assert bof_errors(world).max() < 1e-9


def test_a_thing_that_stands_or_drives_is_believed_in_both_places():
    # Joint: either it drove (hit 0.8, pass 0.7) or it stands (pass 0.3, hit 0.05), equally probable before.
    drove = 0.8 * 0.7 / (0.8 * 0.7 + 0.3 * 0.05)
    exact, bof = exact_beliefs(STANDING_OR_DRIVING), bof_beliefs(STANDING_OR_DRIVING)
    assert exact[0, 0, Cell.FREE] == pytest.approx(drove, abs=1e-12)
    assert drove == pytest.approx(0.97, abs=5e-3)
    # BOF: each cell has its own prior of 1/2 and hears only its own beam.
    assert bof[0, 0, Cell.FREE] == pytest.approx(0.7, abs=1e-12)
    assert bof[0, 1, Cell.RIGHT] == pytest.approx(0.8 / 0.85, abs=1e-12)
    assert bof_errors(STANDING_OR_DRIVING)[0].max() == pytest.approx(drove - 0.7, abs=1e-12)
    np.testing.assert_allclose(bof_errors(STANDING_OR_DRIVING).max(axis=1), [0.274, 0.154, 0.073], atol=5e-4)
    np.testing.assert_allclose(expected_things(exact), 1, atol=1e-12)
    assert expected_things(bof)[0] == pytest.approx(0.3 + 0.8 / 0.85, abs=1e-12)
    assert expected_things(bof)[0] == pytest.approx(1.24, abs=5e-3)


def test_the_small_graph_is_the_row_after_its_first_scan():
    graph = stands_or_drives()
    exact = exact_beliefs(STANDING_OR_DRIVING)[0]
    for cell in (1, 2):
        posterior = eliminate(graph.model, f"m{cell},1", {"z1,1": 0, "z2,1": 1}).normalised().table
        assert posterior[0] == pytest.approx(exact[cell - 1, Cell.FREE], abs=1e-12)


def test_bof_adds_what_two_antecedents_send():
    exact, bof = exact_beliefs(HEAD_ON), bof_beliefs(HEAD_ON)
    assert 1 - exact[0, 1, Cell.FREE] == pytest.approx(2 / 3, abs=1e-12)
    assert 1 - bof[0, 1, Cell.FREE] == pytest.approx(0.999, abs=1e-12)
    # Later each of the two is too probable by 1/6, less the cap.
    np.testing.assert_allclose(bof_errors(HEAD_ON).max(axis=1), [0.333, 0.167, 0.167], atol=1.1e-3)


def test_what_cannot_share_a_cell_with_the_fence_does_not_come_back_to_where_it_started():
    exact, bof = exact_beliefs(TOWARDS_A_FENCE), bof_beliefs(TOWARDS_A_FENCE)
    assert exact[0, 1, Cell.STATIC] == pytest.approx(0.3 / (1 - 0.6 * 0.5), abs=1e-12)
    assert exact[0, 1, Cell.STATIC] == pytest.approx(3 / 7, abs=1e-12)
    assert bof[0, 1, Cell.STATIC] == pytest.approx(0.3, abs=1e-12)
    np.testing.assert_allclose(bof[0, 2], exact[0, 2], atol=1e-12)
    np.testing.assert_allclose(bof_errors(TOWARDS_A_FENCE).max(axis=1), 3 / 7 - 0.3, atol=1e-9)


IN_ITS_SHADOW = CellsInARow(
    ({"static": 0.5, "right": 0.5}, {}, {}, {}, {}, {}), ("?x....", "??x...", "???x..", "????x.", "?????x")
)
"""A thing stands or drives in a cell that nobody sees; the scans follow it for half a second."""

WALL_IN_VIEW = CellsInARow(
    ({"static": 0.97},) * 4 + ({"static": 0.95, "right": 0.03},) + ({"unknown": 1.0},) * 3,
    ("xxxxxx??", "xxxxxxx?", "xxxxxxxx"),
    first_sight=(0.95, 0.05, 0.0),
)
"""A wall of which each scan shows one cell more."""

JUST_STARTED = CellsInARow(({"static": 0.9}, {}, {}, {}, {"right": 1.0}, {}, {}), ("?....x.", "?.....x"))
"""Something begins to move; half a second ago at its velocity it would have been where something hidden stands."""


def exactly(world, cell, step):
    return eliminate(row_model(world, step), f"m{cell},{step}", row_evidence(world, step)).normalised().table


def test_what_has_been_seen_to_move_for_half_a_second_stands_nowhere_in_its_shadow():
    # Five returns from free cells, or one thing that drives: 0.05 against 0.8 each.
    assert exactly(IN_ITS_SHADOW, 1, 5)[Cell.STATIC] == pytest.approx(1 / (1 + 16**5), abs=1e-12)
    looking_back = bof_beliefs(IN_ITS_SHADOW)[:, 0, Cell.STATIC]
    np.testing.assert_allclose(looking_back[:4], 0.5, atol=1e-6)
    assert looking_back[4] == pytest.approx(0.001 * 0.5 / (1 - 0.999 * 0.5), rel=1e-3)
    not_looking_back = bof_beliefs(replace(IN_ITS_SHADOW, clearing_time=0.0))[:, 0, Cell.STATIC]
    np.testing.assert_allclose(not_looking_back, 0.5, atol=1e-6)


def test_looking_back_keeps_a_phantom_off_a_wall_that_comes_into_view_as_joint_inference_does():
    newest, phantom = (np.arange(3), np.arange(5, 8), Cell.RIGHT), [0.03]
    for _ in range(3):  # it arrives, or a cell turns out to be STATIC or FREE at first sight; and the cell is hit
        arrives = phantom[-1]
        explained = [arrives * 0.8, (1 - arrives) * 0.05 * 0.8, (1 - arrives) * 0.95 * 0.05]
        phantom.append(explained[0] / sum(explained))
    assert phantom[-1] > 0.95
    np.testing.assert_allclose(bof_beliefs(replace(WALL_IN_VIEW, clearing_time=0.0))[newest], phantom[1:], atol=1e-4)
    exact = [exactly(WALL_IN_VIEW, step + 5, step)[Cell.RIGHT] for step in (1, 2, 3)]
    assert max(exact) < 0.02
    np.testing.assert_allclose(bof_beliefs(WALL_IN_VIEW)[newest], exact, atol=0.01)


def test_looking_back_errs_about_what_has_just_begun_to_move():
    assert exactly(JUST_STARTED, 1, 2)[Cell.STATIC] == pytest.approx(0.9, abs=1e-12)
    assert bof_beliefs(JUST_STARTED)[-1, 0, Cell.STATIC] < 0.01
    assert bof_beliefs(replace(JUST_STARTED, clearing_time=0.0))[-1, 0, Cell.STATIC] == pytest.approx(0.9, abs=1e-6)


def test_a_scan_is_as_informative_as_the_sensor_model_says():
    sensor = SensorModel()
    read = hit_probability(sensor)
    np.testing.assert_allclose(read.sum(axis=1), 1, atol=1e-12)
    passes, hits = read[Cell.STATIC] / read[Cell.FREE]
    assert hits == pytest.approx(sensor.p_hit_occupied / sensor.p_hit_free)
    assert passes == pytest.approx(sensor.p_pass_occupied / sensor.p_pass_free)


def test_a_world_in_which_something_is_born_moving_is_refused():
    with pytest.raises(ArgumentError, match="rates"):
        CellsInARow(({},), (), ((0, 0, 1, 0),) * 4)

"""The log-odds grid: Bayes' rule on two states, and the smear that it can't help."""

import numpy as np
import pytest
from filterpy import discrete_bayes
from hypothesis import given
from hypothesis import strategies as st
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    Bof,
    BofParams,
    Evidence,
    LogOddsGrid,
    LogOddsParams,
    PlanarMotion,
    State,
    VelocityLattice,
    log_odds,
    probability,
    smear_area,
    update_log_odds,
)

SPEC = GridSpec(0, 40, -5, 5, 0.5)
FREELY = LogOddsParams(lowest=1e-12, highest=1 - 1e-12)
SCANS = st.lists(st.tuples(st.floats(0.05, 1), st.floats(0.05, 1)), min_size=1, max_size=6)


def evidence(occupied: float, free: float) -> Evidence:
    return Evidence(np.array([[occupied]]), np.array([[free]]))


@given(st.floats(0.01, 0.99))
def test_probability_is_the_inverse_of_log_odds(p):
    assert np.isclose(probability(log_odds(p)), p)


@given(st.floats(0.1, 0.9), SCANS)
def test_a_cell_follows_bayes_rule_on_two_states(prior, scans):
    L, expected = log_odds(np.array([[prior]])), np.array([prior, 1 - prior])
    for scan in scans:
        L = update_log_odds(L, evidence(*scan), FREELY)
        expected = discrete_bayes.update(np.array(scan), expected)
    assert np.isclose(probability(L[0, 0]), expected[0])


@pytest.mark.parametrize(("scan", "expected"), [((0, 1), 0.12), ((1, 0), 0.97), ((0, 0), 0.5), ((1e-40, 1e-40), 0.5)])
def test_contradictory_evidence_ends_at_the_bounds(scan, expected):
    assert np.isclose(probability(update_log_odds(np.zeros((1, 1)), evidence(*scan), LogOddsParams()))[0, 0], expected)


def test_what_was_seen_long_is_given_up_after_five_passes():
    """By hand: log(0.97 / 0.03) = 3.476, each pass log(0.3 / 0.7) = -0.847; 4 passes leave 0.087, the fifth -0.761."""
    params = LogOddsParams()
    L = np.zeros((1, 1))
    for _ in range(100):
        L = update_log_odds(L, evidence(0.64, 0.0025), params)
    believed = []
    for _ in range(6):
        L = update_log_odds(L, evidence(0.3, 0.7), params)
        believed.append(float(L[0, 0]))
    assert np.allclose(believed[3:5], [0.087, -0.761], atol=1e-3)


def car(step: int) -> Box:
    """Return a car that drives ahead at 5 m/s, a cell a step, so that its rear is seen in every cell that it leaves."""
    return Box.around(10.1 + 0.5 * step, 0, 4, 2, 1.4)


def smears(track) -> float:
    """Return the area that a tracker believes occupied though the car has left it."""
    left = np.zeros(SPEC.shape, bool)
    for step in range(16):
        p = track(scan_boxes([car(step)], columns=720))
        left |= cells_in(car(step), SPEC)
    return smear_area(p, left & ~cells_in(car(step), SPEC), SPEC)


def test_a_moving_car_leaves_a_smear_as_long_as_the_bound_allows():
    """Cells are given up at the fifth pass: the car leaves 0.5 m x 2 m a step, so four steps' worth stays behind it."""
    grid = LogOddsGrid(SPEC)
    assert smears(lambda points: grid.step(points, PlanarMotion(), 0.1)) == 4 * 0.5 * 2.0


def test_a_filter_that_knows_motion_smears_less():
    tracker = Bof(SPEC, BofParams(VelocityLattice(8.0, 1.0)))
    states = [State.STATIC, State.DYNAMIC]
    assert smears(lambda points: tracker.step(points, PlanarMotion(), 0.1).probability[states].sum(axis=0)) < 2


def test_the_grid_follows_the_vehicle_through_a_turn():
    grid, pose = LogOddsGrid(SPEC), PlanarMotion()
    for _ in range(20):
        points = scan_boxes([Box.around(20, 0, 1.5, 1.5, 2)], x=pose.dx, y=pose.dy, yaw=pose.dyaw)
        p = grid.step(points, PlanarMotion(0.33, 0.0, 0.01) if pose != PlanarMotion() else PlanarMotion(), 0.1)
        seen_from, pose = pose, pose.then(PlanarMotion(0.33, 0.0, 0.01))
    row, col, inside = SPEC.cells(seen_from.child_from_parent(np.array([[19.5, 0.0], [15.0, 0.0]])))
    assert inside.all()
    assert p.dtype == np.float32
    assert p[row, col][0] > 0.9
    assert p[row, col][1] < 0.2


@pytest.mark.parametrize(
    ("bad", "name"), [({"prior": 0.0}, "prior"), ({"highest": 1.0}, "highest"), ({"lowest": 0.98}, "lowest")]
)
def test_impossible_parameters_are_refused_by_name(bad, name):
    with pytest.raises(ArgumentError, match=name):
        LogOddsParams(**bad)


@pytest.mark.parametrize("p", [0.0, 1, -0.2, 1.2, np.nan, [0.5, 1.5]])
def test_what_is_no_probability_or_certain_has_no_log_odds(p):
    with pytest.raises(ArgumentError, match=r"^p: expected"):
        log_odds(p)

"""The log-odds grid: its bounds, and the smear that it can't help."""

import numpy as np
import pytest
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


def evidence(occupied: float, free: float) -> Evidence:
    return Evidence(np.array([[occupied]]), np.array([[free]]))


@given(st.floats(0.01, 0.99))
def test_probability_is_the_inverse_of_log_odds(p):
    assert np.isclose(probability(log_odds(p)), p)


@pytest.mark.parametrize(("scan", "expected"), [((0, 1), 0.12), ((1, 0), 0.97), ((0, 0), 0.5), ((1e-40, 1e-40), 0.5)])
def test_contradictory_evidence_ends_at_the_bounds(scan, expected):
    assert np.isclose(probability(update_log_odds(np.zeros((1, 1)), evidence(*scan), LogOddsParams()))[0, 0], expected)


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

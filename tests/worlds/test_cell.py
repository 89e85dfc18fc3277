"""One cell: CMCDOT's steps and the log-odds sum are exact inference on its chain."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.lecture_02_cell import (
    cell_given,
    exact_cell,
    one_cell,
    one_log_odds_cell,
    package_log_odds_cell,
    read_scans,
)  # fmt: skip

from semgrid_edu.graphical import d_separated, eliminate, enumerate_marginals
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    Evidence,
    FilterState,
    LogOddsParams,
    Particles,
    State,
    WorldModel,
    predict,
    transition_matrix,
    update,
)  # fmt: skip

PAIRS = st.tuples(*[st.floats(0.01, 1)] * 2) | st.just((1.0, 1.0))
SCANS = st.lists(PAIRS, min_size=1, max_size=6)
BELIEFS = st.lists(st.floats(0.01, 1), min_size=4, max_size=4).map(lambda p: np.array(p) / sum(p))
FREELY = LogOddsParams(lowest=1e-15, highest=1 - 1e-15)


@settings(deadline=None, max_examples=30)
@given(SCANS, st.floats(0, 2), BELIEFS)
def test_predict_and_update_are_the_forward_messages(scans, dt, start):
    """All dynamic mass is newborn, so none of it flies away, and none stops."""
    exact, world, spec = exact_cell(scans, dt, start=start), WorldModel(), GridSpec(0, 1, 0, 1, 1)
    first = np.reshape(start, (4, 1, 1)).astype(np.float32)
    state = FilterState(first, Particles.none(), first[State.DYNAMIC])
    for t, (occupied, free) in enumerate(scans):
        state = predict(state, spec, world, dt, np.random.default_rng(0))
        np.testing.assert_allclose(state.probability[:, 0, 0], exact.predicted[t], atol=1e-6)
        state = update(state, spec, Evidence(np.array([[occupied]]), np.array([[free]])), world)
        np.testing.assert_allclose(state.probability[:, 0, 0], exact.updated[t], atol=1e-6)


def test_two_scans_by_hand():
    """Nobody has looked; a beam passes, then a return: first sight, evidence, transition, evidence."""
    params = WorldModel()
    first = np.array([*params.first_sight, 0]) * [0.7, 0.3, 0.3, 0.7]
    second = first / first.sum() @ transition_matrix(params, 0.1)
    second = (second + second[State.UNKNOWN] * np.array([*params.first_sight, -1])) * [0.05, 0.8, 0.8, 0.05]
    exact = exact_cell(read_scans(".#"), 0.1)
    np.testing.assert_allclose(exact.updated, [first / first.sum(), second / second.sum()], atol=1e-7)


def test_the_last_filtered_belief_is_the_posterior():
    scans = read_scans(". #")
    stage, known = one_cell(scans), cell_given(scans)
    last = exact_cell(scans).updated[-1]
    np.testing.assert_allclose(eliminate(stage.model, "m3", known).normalised().table, last, atol=1e-12)
    np.testing.assert_allclose(
        enumerate_marginals(one_cell(scans[:2]).model, "m2", cell_given(scans[:2])).normalised().table,
        exact_cell(scans).updated[1],
        atol=1e-12,
    )


def test_a_scan_never_changes_the_ratio_of_static_to_dynamic():
    stage = exact_cell(read_scans("..##"), start=(0.4, 0.4, 0.2, 0.0))
    before, after = stage.predicted[-1], stage.updated[-1]
    revealed = before + before[State.UNKNOWN] * np.array([*WorldModel().first_sight, -1])
    assert after[State.STATIC] / after[State.DYNAMIC] == pytest.approx(revealed[State.STATIC] / revealed[State.DYNAMIC])


def test_unknown_survives_only_where_nobody_looks():
    updated = exact_cell(read_scans("  .")).updated
    assert updated[1, State.UNKNOWN] == 1
    assert updated[2, State.UNKNOWN] == 0


def test_the_state_screens_the_past_off():
    model = one_cell(read_scans("..#")).model
    assert d_separated(model, "z1", "z3", given="m2")
    assert not d_separated(model, "z1", "z3")
    assert d_separated(model, "v3", "m2")
    assert not d_separated(model, "v3", "m2", given="z3")


@settings(deadline=None)
@given(st.floats(0.1, 0.9), st.lists(st.tuples(*[st.floats(0.05, 1)] * 2), min_size=1, max_size=6))
def test_log_odds_are_exact_within_their_bounds(prior, scans):
    package = package_log_odds_cell(scans, replace(FREELY, prior=prior))
    for t in range(1, len(scans) + 1):
        known = {f"z{k}": 1 for k in range(1, t + 1)}
        exact = eliminate(one_log_odds_cell(scans, prior).model, "m", known).normalised().table
        assert package[t - 1] == pytest.approx(exact[1], abs=1e-12)


def test_the_bounds_hold_log_odds_back():
    """By hand: five passes make odds (3/7)^5 = 0.0145; the grid stays at 0.12."""
    scans = read_scans(".....")
    exact = eliminate(one_log_odds_cell(scans).model, "m", {f"z{t}": 1 for t in range(1, 6)}).normalised().table
    odds = (3 / 7) ** 5
    assert exact[1] == pytest.approx(odds / (1 + odds), rel=1e-6)
    assert package_log_odds_cell(scans)[-1] == pytest.approx(0.12)

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

from semgrid_edu.graphical import eliminate
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    Evidence,
    FilterState,
    LogOddsParams,
    Particles,
    State,
    WorldModel,
    predict,
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


def test_the_last_filtered_belief_is_the_posterior():
    scans = read_scans(". #")
    stage, known = one_cell(scans), cell_given(scans)
    last = exact_cell(scans).updated[-1]
    np.testing.assert_allclose(eliminate(stage.model, "m3", known).normalised().table, last, atol=1e-12)


@settings(deadline=None)
@given(st.floats(0.1, 0.9), st.lists(st.tuples(*[st.floats(0.05, 1)] * 2), min_size=1, max_size=6))
def test_log_odds_are_exact_within_their_bounds(prior, scans):
    package = package_log_odds_cell(scans, replace(FREELY, prior=prior))
    for t in range(1, len(scans) + 1):
        known = {f"z{k}": 1 for k in range(1, t + 1)}
        exact = eliminate(one_log_odds_cell(scans, prior).model, "m", known).normalised().table
        assert package[t - 1] == pytest.approx(exact[1], abs=1e-12)

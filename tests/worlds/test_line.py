"""Bayes on a line: filterpy and lecture 01 are the messages on the chain."""

import numpy as np
from filterpy import discrete_bayes
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.lecture_01_line import bayes_on_a_line, filtered, smoothed

from semgrid_edu.graphical import eliminate

MOVED = np.array([0.1, 0.8, 0.1])
P_POLE = np.where(np.isin(np.arange(10), [2, 3, 7]), 0.8, 0.1)
READINGS = st.lists(st.integers(0, 1), min_size=1, max_size=6)


@settings(deadline=None, max_examples=30)
@given(READINGS)
def test_forward_messages_are_lecture_01s_recursion(readings):
    """Its functions are filterpy's, as its own cells assert: update, then predict and update with each reading."""
    belief = np.full(10, 0.1)
    for t, found in enumerate(filtered(bayes_on_a_line(len(readings)), readings)):
        belief = discrete_bayes.predict(belief, offset=1, kernel=MOVED) if t else belief
        belief = discrete_bayes.update(P_POLE if readings[t] else 1 - P_POLE, belief)
        np.testing.assert_allclose(found, belief, atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(READINGS)
def test_backward_messages_smooth(readings):
    stage = bayes_on_a_line(len(readings))
    known = dict(zip(stage.observed, readings, strict=True))
    for t, belief in enumerate(smoothed(stage, readings)):
        np.testing.assert_allclose(belief, eliminate(stage.model, f"n{t}", known).normalised().table, atol=1e-12)


def test_a_kernel_longer_than_the_ring_goes_round_it():
    stage = bayes_on_a_line(2, n_cells=2, poles=(0,), moved=(0.5, 0.2, 0.3))
    np.testing.assert_allclose(eliminate(stage.model, "n1", {"n0": 0}).normalised().table, [0.8, 0.2])

"""Bayes on a line: filterpy and lecture 01 are the messages on the chain."""

import numpy as np
from filterpy import discrete_bayes
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.lecture_01_line import bayes_on_a_line, filtered, smoothed

from semgrid_edu.graphical import eliminate
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS, read_percent

MOVED = np.array([0.1, 0.8, 0.1])
P_POLE = np.where(np.isin(np.arange(10), [2, 3, 7]), 0.8, 0.1)
READINGS = st.lists(st.integers(0, 1), min_size=1, max_size=6)


def likelihood(says):
    return P_POLE if says else 1 - P_POLE


def recursion(readings, update, predict):
    """Update, then predict and update with each further reading."""
    belief, history = np.full(10, 0.1), []
    for t, says in enumerate(readings):
        prior = predict(belief) if t else belief
        belief = update(likelihood(says), prior)
        history.append(belief)
    return np.array(history)


def lecture_cell(tag):
    """The code of a tagged cell of lecture 01."""
    cells = read_percent(NOTEBOOKS / "src" / "01_bayes.py").cells
    return next(cell.source for cell in cells if tag in cell.metadata.get("tags", []))


@settings(deadline=None, max_examples=30)
@given(READINGS)
def test_forward_messages_are_filterpys_recursion(readings):
    expected = recursion(
        readings, discrete_bayes.update, lambda belief: discrete_bayes.predict(belief, offset=1, kernel=MOVED)
    )
    np.testing.assert_allclose(filtered(bayes_on_a_line(len(readings)), readings), expected, atol=1e-12)


def test_forward_messages_are_lecture_01s_recursion():
    lecture = {
        "np": np,
        "discrete_bayes": discrete_bayes,
        "POLES": [2, 3, 7],
        "N_CELLS": 10,
        "P_POLE": P_POLE,
        "MOVED": MOVED,
    }
    exec(lecture_cell("update"), lecture)
    exec(lecture_cell("predict"), lecture)
    readings = [1, 1, 0, 0, 0, 1, 0, 1]
    expected = recursion(readings, lecture["update"], lambda belief: lecture["predict"](belief, MOVED))
    np.testing.assert_allclose(filtered(bayes_on_a_line(8), readings), expected, atol=1e-12)


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

"""The figures of lecture 00: they show the numbers that they are given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_00_tour import draw_called, draw_story, painted_over

from semgrid_edu.datasets.samples import real_drive
from semgrid_edu.grid import GridSpec


def test_what_is_painted_over_has_the_scores_of_its_nearest_neighbour():
    scores = np.zeros((2, 1, 9))
    scores[0] = np.arange(9)
    scores[1, 0, 3] = 100
    painted = painted_over(scores, c=1, around=1)
    np.testing.assert_array_equal(painted[0, 0], [0, 1, 1, 1, 5, 5, 6, 7, 8])
    assert (painted[1] == 0).all()


def test_cells_of_a_class_are_drawn_by_their_labels():
    spec = GridSpec(0, 2, 0, 2, 1)
    ax = plt.subplots()[1]
    draw_called(ax, spec, np.array([[4, 4], [4, 0]]), 4, np.array([[255, 4], [0, 4]]))
    right, otherwise, *_ = ax.lines
    np.testing.assert_allclose(right.get_xydata(), [[0.5, 1.5]])
    np.testing.assert_allclose(otherwise.get_xydata(), [[1.5, 0.5]])
    assert len(np.unique(ax.images[0].get_array().reshape(-1, 3), axis=0)) == 2


def test_the_bars_of_a_story_add_up_to_one():
    frame = real_drive()[0]
    column = np.array([[20.0, -3, 0], [20, -3, 1]])
    states = np.full((4, 2), 0.25)
    answers = {"this": np.eye(14)[3], "that": np.full(14, 1 / 14)}
    _, history, called = draw_story(frame, column, states, [0.0, 0.2], answers).axes
    for ax in (history, called):
        assert max(bar.get_x() + bar.get_width() for bar in ax.patches) == pytest.approx(1)
    assert called.texts[0].get_text() == "car 1.00"

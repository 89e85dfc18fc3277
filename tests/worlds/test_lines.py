"""Bars are as high as their probabilities, bands as thick."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_01_lines import belief_history, places_on_ring, probability_lines, ring_road, state_history

from semgrid_edu import plotting


def heights(ax):
    return [bar.get_height() for bar in ax.patches]


def test_a_bar_is_as_high_as_its_probability_and_has_its_number():
    (ax,) = probability_lines({"belief": np.array([0.5, 0.125, 0.375])}, names=["a", "b", "c"]).axes
    assert heights(ax) == [0.5, 0.125, 0.375]
    assert [text.get_text() for text in ax.texts] == ["0.50", "0.12", "0.38"]
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["a", "b", "c"]
    assert ax.get_title(loc="left") == "belief"


def test_triangles_mark_the_cells_that_are_asked_for():
    line = {"belief": np.full(4, 0.25)}
    (marks,) = probability_lines(line, marked=[0, 2]).axes[0].lines
    np.testing.assert_array_equal(marks.get_xdata(), [0, 2])
    assert not probability_lines(line).axes[0].lines


def test_a_long_line_has_no_numbers_over_its_bars():
    assert not probability_lines({"belief": np.full(40, 0.025)}).axes[0].texts


def test_lines_below_each_other_share_their_scale():
    lines = {"prior": np.full(2, 0.5), "likelihood": np.array([0.9, 0.3]), "posterior": np.array([0.75, 0.25])}
    figure = probability_lines(lines, marked=[0])
    assert [ax.get_title(loc="left") for ax in figure.axes] == list(lines)
    assert len({ax.get_ylim() for ax in figure.axes}) == 1
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "", "cell"]
    assert figure.axes[0].get_ylim()[1] > 0.9
    np.testing.assert_array_equal([heights(ax) for ax in figure.axes], list(lines.values()))


def test_lines_of_zeros_have_an_axis_too():
    assert probability_lines({"a": np.zeros(2)}).axes[0].get_ylim()[1] > 0


def test_a_ring_goes_clockwise_from_the_top_and_has_a_bar_for_each_cell_and_its_poles():
    around = places_on_ring(4)
    np.testing.assert_allclose(around, [[0, 1], [1, 0], [0, -1], [-1, 0]], atol=1e-12)
    bars, vehicle, title = ring_road([2, 3, 7])
    ax = vehicle.axes
    assert len(bars) == 10
    assert title.axes is ax
    poles = next(line for line in ax.lines if line.get_marker() == "^")
    np.testing.assert_allclose(poles.get_xydata(), 0.58 * places_on_ring()[[2, 3, 7]])


def test_a_belief_has_a_column_for_each_step_with_cell_0_at_the_bottom_and_a_mark_at_the_truth():
    belief = np.array([[0.2, 0.7, 0.1], [0.0, 0.2, 0.8]])
    ax = belief_history(belief, truth=np.array([1, 0]))
    np.testing.assert_array_equal(ax.images[0].get_array(), belief.T)
    bottom, top = ax.get_ylim()
    assert bottom < top
    circles, crosses = ax.lines
    np.testing.assert_array_equal(circles.get_xydata(), [[0, 1]])
    np.testing.assert_array_equal(crosses.get_xydata(), [[1, 0]])
    assert not belief_history(belief).lines


def test_a_table_of_belief_in_a_figure_of_its_own_has_a_colour_bar():
    belief = np.array([[0.25, 0.75], [0.5, 0.5]])
    alone = belief_history(belief).figure
    assert [ax.get_ylabel() for ax in alone.axes] == ["cell", "probability"]
    figure, ax = plt.subplots()
    belief_history(belief, ax)
    assert figure.axes == [ax]


def test_a_band_is_as_thick_as_its_probability():
    probability = np.array([[0.5, 0.25], [0.2, 0.5], [0.2, 0.25], [0.1, 0.0]])
    ax = state_history(np.array([0.0, 0.1]), probability)
    for band, thickness, colour in zip(ax.collections, probability, plotting.STATE_COLOURS, strict=True):
        corners = band.get_paths()[0].vertices
        for time, thick in zip((0.0, 0.1), thickness, strict=True):
            assert np.ptp(corners[corners[:, 0] == time, 1]) == pytest.approx(thick)
        np.testing.assert_allclose(band.get_facecolor()[0, :3], np.divide(colour, 255))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == list(plotting.STATE_NAMES)

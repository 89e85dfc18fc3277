"""Drawings: every variable, arrow, factor and text is there, large enough to read, where it was asked for."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.patches import Ellipse, FancyArrow, FancyArrowPatch, PathPatch, Rectangle
from random_models import one_of_you

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Dashed, Factor, GraphicalModel, draw, in_rows
from semgrid_edu.graphical.rendering import NODE, GraphPicture

ROWS = in_rows(["m1", "m2"], ["z"])


def pieces(ax, kind):
    return [artist for artist in ax.get_children() if type(artist) is kind and artist is not ax.patch]


def said(ax):
    return {text.get_text() for text in ax.texts} - {""}


def centres(ax):
    return {tuple(np.round(ellipse.center, 9)) for ellipse in pieces(ax, Ellipse)}


def test_a_directed_model_has_a_node_per_variable_and_an_arrow_per_parent():
    ax = draw(one_of_you(), positions=ROWS)
    assert said(ax) == {"$m_{1}$", "$m_{2}$", "$z$"}
    assert centres(ax) == set(ROWS.values())
    assert len(pieces(ax, FancyArrow)) == 2
    assert not pieces(ax, Rectangle)


def test_an_undirected_model_has_a_square_per_factor_and_a_line_per_variable_of_it():
    model = GraphicalModel([Factor("a", [1, 2]), Factor(("a", "b"), [[2, 1], [1, 2]])])
    ax = draw(model, positions=in_rows(["a", "b"]))
    assert len(pieces(ax, Rectangle)) == 2
    squares = [np.mean(square.get_bbox().get_points(), axis=0) for square in pieces(ax, Rectangle)]
    np.testing.assert_allclose(squares, [(-0.35, 0.35), (0.5, 0)], atol=1e-9)
    assert len(ax.lines) == 3
    assert not pieces(ax, FancyArrow)


def test_observed_nodes_are_shaded_and_the_highlighted_one_is_thick():
    ax = draw(one_of_you(), observed={"z": 1}, highlight="m1", positions=ROWS)
    shaded = {tuple(e.center) for e in pieces(ax, Ellipse) if e.get_facecolor()[:3] == to_rgb("0.7")}
    thick = {tuple(e.center) for e in pieces(ax, Ellipse) if e.get_linewidth() > 2}
    assert shaded == {ROWS["z"]}
    assert thick == {ROWS["m1"]}


def test_plates_surround_their_nodes():
    ax = draw(one_of_you(), positions=ROWS, plates={"$k = 1, 2$": ["m1", "m2"]})
    (plate,) = pieces(ax, Rectangle)
    inside = [name for name, place in ROWS.items() if plate.get_bbox().contains(*place)]
    assert inside == ["m1", "m2"]
    assert "$k = 1, 2$" in said(ax)


def test_a_plate_reaches_round_the_texts_beside_its_nodes():
    ax = draw(one_of_you(), positions=ROWS, plates={"beams": "z"}, equations={"z": "a word that is long"})
    ax.figure.canvas.draw()
    (plate,) = pieces(ax, Rectangle)
    for text in ("a word that is long", "beams"):
        drawn = next(one for one in ax.texts if one.get_text() == text).get_window_extent()
        assert plate.get_window_extent().containsx(drawn.x1)
        assert not any(e.get_window_extent().overlaps(drawn) for e in pieces(ax, Ellipse))


def test_equations_and_own_labels_are_written():
    ax = draw(one_of_you(), equations={"z": "$P(z | m)$", "m1": "$P(z | m)$"}, labels={"m1": "left"}, positions=ROWS)
    assert {"$P(z | m)$", "left"} <= said(ax)
    assert [text.get_text() for text in ax.texts].count("$P(z | m)$") == 2


def test_it_draws_into_the_given_axes_and_opens_no_figure():
    figure, axes = plt.subplots(1, 2, figsize=(4, 2))
    for ax, model in zip(axes, (one_of_you(), GraphicalModel(one_of_you().factors)), strict=True):
        assert draw(model, ax=ax, positions=ROWS) is ax
    figure.canvas.draw()
    assert plt.get_fignums() == [figure.number]
    assert min(text.get_fontsize() for ax in axes for text in ax.texts) >= 8


def test_rows_are_centred_and_gaps_stay_free():
    assert in_rows(["a", "b", "c"], ["d"]) == {"a": (0, 0), "b": (1, 0), "c": (2, 0), "d": (1, -1)}
    assert in_rows(["a", None, "c"], [None, "d"]) == {"a": (0, 0), "c": (2, 0), "d": (1.5, -1)}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"highlight": "w"}, "found w"),
        ({"plates": {"K": ["w"]}}, "found w"),
        ({"equations": {"P(w)": "w"}}, r"equations: .* found P\(w\)"),
        ({"positions": dict.fromkeys(["m1", "m2", "z"], (0, 0))}, "one for m1, m2, z"),
        ({"positions": {"m1": (0, 0)}}, "none for m2, z"),
    ],
)  # fmt: skip
def test_unknown_names_and_nodes_on_top_of_each_other_are_refused(arguments, says):
    with pytest.raises(ArgumentError, match=says):
        draw(one_of_you(), **{"positions": ROWS} | arguments)


def test_a_straight_dashed_edge_stands_for_the_arrow_and_a_bent_one_beside_it():
    for bend, arrows in ((0.0, 1), (0.4, 2)):
        ax = draw(one_of_you(), positions=ROWS, dashed=[Dashed(("m1", "z"), ".1", bend=bend)])
        assert len(pieces(ax, FancyArrow)) == arrows
        assert len(pieces(ax, PathPatch)) == len(pieces(ax, FancyArrowPatch)) == 1
        assert ".1" in said(ax)


def test_a_curve_begins_and_ends_at_the_outlines_of_its_nodes():
    picture = GraphPicture(one_of_you(), {"m1": (0.0, 0.0), "m2": (2.0, 0.0), "z": (1.0, -1.0)}, {}, {})
    picture.connect(Dashed(("m1", "m2"), bend=0.25))
    start, middle, end = picture.curves[0][1]
    np.testing.assert_allclose([np.hypot(*start), np.hypot(*(end - (2, 0)))], NODE / 2 + 0.03)
    np.testing.assert_allclose(middle, (1, 1))


def test_a_ghost_is_drawn_but_is_no_variable():
    ax = draw(one_of_you(), positions=ROWS, ghosts={"m3": (2.0, 0.0)}, dashed=[Dashed(("m2", "m3"), arrow=False)])
    assert centres(ax) == {*ROWS.values(), (2.0, 0.0)}
    assert "$m_{3}$" in said(ax)
    assert not pieces(ax, FancyArrowPatch)
    with pytest.raises(ArgumentError):
        draw(one_of_you(), positions=ROWS, ghosts={"m3": (2.0, 0.0)}, observed="m3")

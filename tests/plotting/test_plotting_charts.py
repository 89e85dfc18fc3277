import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_12_pictures import forest_plot

from semgrid_edu.errors import ArgumentError
from semgrid_edu.plotting import training_curves
from semgrid_edu.training.log import TrainingLog


def _log(image=200, grid=100):
    iteration = np.arange(image + grid)
    stage = np.repeat(["image", "grid"], [image, grid])
    noise = np.where(iteration % 2, 0.5, -0.5)
    return TrainingLog(iteration, stage, np.full(len(iteration), 0.1), np.where(stage == "image", 2.0, 3.0) + noise)


def _curves(ax):
    """The smoothed lines; those that mark the stages have two points."""
    return [line for line in ax.get_lines() if len(line.get_xdata()) > 2]


def test_a_smoothed_line_is_the_mean_and_stages_do_not_mix():
    ax = training_curves(_log())
    image, grid = _curves(ax)
    assert (image.get_xdata()[[0, -1]].tolist(), grid.get_xdata()[[0, -1]].tolist()) == ([0, 199], [200, 299])
    np.testing.assert_allclose(image.get_ydata(), 2, atol=0.03)
    np.testing.assert_allclose(grid.get_ydata(), 3, atol=0.03)
    assert [text.get_text() for text in ax.texts] == ["image stage", "grid stage"]
    assert len(ax.collections[0].get_offsets()) == 300
    assert ax.get_legend() is None


def test_each_run_has_its_colour_and_its_name():
    _, ax = plt.subplots()
    assert training_curves({"one": _log(), "two": _log(image=0), "three": _log(grid=3)}, ax) is ax
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["one", "two", "three"]
    assert len({line.get_color() for line in _curves(ax)}) == 3


def test_nothing_to_draw_is_refused():
    with pytest.raises(ArgumentError, match="logs: expected at least one training run"):
        training_curves({})
    with pytest.raises(ArgumentError, match="logs: expected at least one training run"):
        training_curves({"empty": _log(0, 0)})


def test_a_forest_shows_each_interval_and_every_seed():
    rows = {
        "network": {"mean": 0.8, "low": 0.7, "high": 0.9, "seeds": [0.75, 0.8, 0.85]},
        "baseline": {"mean": 0.5, "low": 0.4, "high": 0.65, "seeds": [0.5]},
    }
    ax = forest_plot(rows, reference=0.6)
    assert [text.get_text() for text in ax.get_yticklabels()] == ["network", "baseline"]
    lines = {(line.get_label(), round(float(line.get_ydata()[0]))): line.get_xdata() for line in ax.lines[1:]}
    np.testing.assert_allclose(lines["95 % interval", 0], [70, 90])
    np.testing.assert_allclose(lines["95 % interval", 1], [40, 65])
    np.testing.assert_allclose(lines["mean", 1], [50])
    np.testing.assert_allclose(lines["one seed", 0], [75, 80, 85])
    assert ("one seed", 1) not in lines  # it would only repeat the mean
    np.testing.assert_allclose(ax.lines[0].get_xdata(), [60, 60])
    assert [text.get_text() for text in ax.texts] == ["80.0 (70.0 to 90.0)", "50.0 (40.0 to 65.0)"]
    assert ax.yaxis_inverted()
    with pytest.raises(ArgumentError, match="rows"):
        forest_plot({})

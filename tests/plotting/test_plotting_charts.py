import matplotlib.pyplot as plt
import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError
from semgrid_edu.plotting import training_curves
from semgrid_edu.training.log import TrainingLog


def _log(image=200, grid=100):
    iteration = np.arange(image + grid)
    stage = np.repeat(["image", "grid"], [image, grid])
    noise = np.where(iteration % 2, 0.5, -0.5)
    return TrainingLog(iteration, stage, np.full(len(iteration), 0.1), np.where(stage == "image", 2.0, 3.0) + noise)


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


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

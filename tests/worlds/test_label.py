"""How one cell gets its label: binomial sums, a vote by hand, and what calibration does to independence."""

import pytest
from scipy.stats import binom
from worlds.lecture_09_label import LabelWorld, lidar_label_stage, wrong_label

from semgrid_edu.graphical import d_separated


@pytest.mark.parametrize("returns", [1, 3, 5])
def test_a_majority_of_independent_errors_is_a_binomial_sum(returns):
    world = LabelWorld(returns, alone=0.1, shared=0.0)
    assert wrong_label(world) == pytest.approx(binom.sf(returns // 2, returns, 0.1), abs=1e-12)


@pytest.mark.parametrize("returns", [1, 3, 5])
def test_a_shared_error_is_never_outvoted(returns):
    right, off = binom.sf(returns // 2, returns, [0.1, 0.9])
    world = LabelWorld(returns, alone=0.1, shared=0.1)
    assert wrong_label(world) == pytest.approx(0.9 * right + 0.1 * off, abs=1e-12)
    assert wrong_label(LabelWorld(returns, alone=0.0, shared=0.1)) == pytest.approx(0.1, abs=1e-12)


@pytest.mark.parametrize(("content", "wrong"), [(0, 1 - 0.9**3), (1, 0.1**3)])
def test_where_what_stands_wins_one_wrong_return_makes_road_a_car(content, wrong):
    world = LabelWorld(3, alone=0.1, shared=0.0, vote="standing")
    assert wrong_label(world, content) == pytest.approx(wrong, abs=1e-12)


def test_given_what_stands_there_returns_depend_on_each_other_through_the_calibration():
    model = lidar_label_stage().model
    assert not d_separated(model, "x1", "x2", given=("m",))
    assert d_separated(model, "x1", "x2", given=("m", "c"))

"""The search: it reaches what it says, doesn't depend on interruptions, and finds an optimum that is known."""

from dataclasses import astuple

import numpy as np
import pytest

from semgrid_edu.crf import CrfParams
from semgrid_edu.errors import ArgumentError
from semgrid_edu.workshop.studies.crf import search_point as rules
from semgrid_edu.workshop.studies.crf.search_point import next_point, params_at, pareto_front, point_of

OPTIMUM = np.array([0.2, 0.9, 0.5, 0.35, 0.0])


def searched(n, seed, value):
    """The points of a search of n trials, and their values."""
    points, values = [], []
    for _ in range(n):
        points.append(next_point(points, values, seed))
        values.append(value(points[-1]))
    return np.array(points), np.array(values)


def closeness(point):
    return [-np.linalg.norm(point - OPTIMUM), -np.linalg.norm(point - (1 - OPTIMUM))]


def test_the_ends_of_each_axis_are_the_stated_factors_of_the_defaults():
    default = np.array(astuple(CrfParams.for_cells(0.5))[:5])
    for side, factors in enumerate(zip(*rules.FACTORS.values(), strict=True)):
        np.testing.assert_allclose(astuple(params_at([side] * 5, 0.5))[:5], factors * default, rtol=1e-12)


def test_the_middle_of_an_axis_is_the_geometric_mean_of_its_ends():
    low, middle, high = (params_at([side] * 5, 0.2).w_spatial for side in (0, 0.5, 1))
    assert middle == pytest.approx((low * high) ** 0.5, rel=0.005)


def test_the_defaults_lie_inside():
    point = point_of(CrfParams(), 0.2)
    assert ((point > 0.3) & (point < 0.8)).all()
    assert params_at(point, 0.2) == CrfParams()


def test_a_point_is_found_again_from_its_rounded_parameters():
    for point in np.random.default_rng(0).random((50, 5)):
        params = params_at(point, 0.2)
        np.testing.assert_allclose(point_of(params, 0.2), point, atol=0.002)
        assert params_at(np.clip(point_of(params, 0.2), 0, 1), 0.2) == params


@pytest.mark.parametrize("point", [[0.5] * 4, [0.5, 0.5, 0.5, 0.5, 1.1], [0.5, 0.5, 0.5, 0.5, np.nan]])
def test_a_point_outside_the_box_is_refused(point):
    with pytest.raises(ArgumentError, match="5 numbers from 0 to 1"):
        params_at(point, 0.2)


def test_the_first_trials_fill_the_box_evenly():
    points, _ = searched(rules.EXPLORED, 0, closeness)
    quarters = [np.bincount((column * 4).astype(int), minlength=4) for column in points.T]
    assert np.min(quarters) >= 12  # of 64 points, in each quarter of each axis


def test_the_same_seed_gives_the_same_trials_however_many_follow_and_another_gives_others():
    few, many, others = (searched(*run, closeness)[0] for run in ((80, 3), (100, 3), (80, 4)))
    np.testing.assert_array_equal(few, many[:80])
    assert not np.isin(few[: rules.EXPLORED], others[: rules.EXPLORED]).any()


def test_refinement_comes_close_to_the_optimum_of_each_objective():
    points, values = searched(260, 0, closeness)
    explored, found = values[: rules.EXPLORED].max(axis=0), values.max(axis=0)
    assert ((points >= 0) & (points <= 1)).all()
    assert (found > -0.06).all()
    assert (found > explored / 2).all()


def test_the_front_is_what_nothing_dominates():
    values = np.random.default_rng(1).integers(0, 6, (40, 2))
    expected = {
        tuple(a) for a in values.tolist() if not any(b[0] >= a[0] and b[1] >= a[1] and b != a for b in values.tolist())
    }
    front = pareto_front(values)
    assert [tuple(values[k]) for k in front] == sorted(expected, reverse=True)
    assert all(k == np.flatnonzero((values == values[k]).all(axis=1))[0] for k in front)

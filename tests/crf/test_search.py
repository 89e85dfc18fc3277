"""The search: it reaches what it says, doesn't depend on interruptions, and finds an optimum that is known."""

from dataclasses import astuple

import numpy as np
import pytest

from semgrid_edu.crf import CrfParams, next_point, params_at, pareto_front, point_of
from semgrid_edu.crf import search as rules
from semgrid_edu.errors import ArgumentError

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


def test_the_box_goes_from_a_tenth_to_ten_times_the_defaults():
    default = np.array(astuple(CrfParams.for_cells(0.5))[:5])
    for side, factor in ((0.0, 0.1), (0.5, 1.0), (1.0, 10.0)):
        np.testing.assert_allclose(astuple(params_at([side] * 5, 0.5))[:5], factor * default, rtol=1e-12)


def test_a_point_is_found_again_from_its_rounded_parameters():
    for point in np.random.default_rng(0).random((50, 5)):
        params = params_at(point, 0.2)
        np.testing.assert_allclose(point_of(params, 0.2), point, atol=0.002)
        assert params_at(np.clip(point_of(params, 0.2), 0, 1), 0.2) == params


@pytest.mark.parametrize("point", [[0.5] * 4, [0.5, 0.5, 0.5, 0.5, 1.1], [0.5, 0.5, 0.5, 0.5, np.nan]])
def test_a_point_outside_the_box_is_refused(point):
    with pytest.raises(ArgumentError, match="5 numbers from 0 to 1"):
        params_at(point, 0.2)


def test_the_first_trials_are_the_defaults_and_an_even_sequence():
    points, _ = searched(rules.EXPLORED, 0, closeness)
    np.testing.assert_array_equal(points[0], 0.5)
    quarters = [np.bincount((column * 4).astype(int), minlength=4) for column in points[1:].T]
    assert np.min(quarters) >= 12  # of 63 points, in each quarter of each axis


def test_the_same_seed_gives_the_same_trials_however_many_follow_and_another_gives_others():
    few, many, others = (searched(*run, closeness)[0] for run in ((80, 3), (100, 3), (80, 4)))
    np.testing.assert_array_equal(few, many[:80])
    explored = slice(1, rules.EXPLORED)
    assert not np.isin(few[explored], others[explored]).any()


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

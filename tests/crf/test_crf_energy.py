"""The energy and the written-out mean field against cases worked out by hand and by enumeration."""

import numpy as np
import pytest
from enumeration import random_cells
from scipy.special import softmax

from semgrid_edu.crf import CrfParams, energy, mean_field_naive, unary_from_probability
from semgrid_edu.errors import ArgumentError

AS_PRINTED = CrfParams(w_bilateral=2, w_spatial=3, sigma_alpha=2, sigma_beta=0.5, sigma_gamma=1, normalization="none")


def test_energy_of_two_by_two_by_hand():
    unary = np.arange(8.0).reshape(2, 2, 2)
    values = np.zeros((4, 2, 2))
    values[0, :, 0] = values[1, :, 1] = 1  # left column free, right column static: squared distance 2
    side = 2 * np.exp(-1 / 8) + 3 * np.exp(-1 / 2)  # same state
    across = 2 * np.exp(-1 / 8 - 2 / 0.5) + 3 * np.exp(-1 / 2)  # next to each other, other state
    slant = 2 * np.exp(-2 / 8 - 2 / 0.5) + 3 * np.exp(-1)
    cases = {
        ((0, 0), (0, 0)): 0 + 1 + 2 + 3,
        ((0, 1), (0, 1)): 0 + 5 + 2 + 7 + 2 * across + 2 * slant,
        ((0, 0), (1, 1)): 0 + 1 + 6 + 7 + 2 * side + 2 * slant,
        ((1, 0), (0, 0)): 4 + 1 + 2 + 3 + side + across + slant,
    }
    for labels, expected in cases.items():
        assert energy(np.array(labels), unary, values, AS_PRINTED) == pytest.approx(expected, abs=1e-12)


def test_one_update_written_as_eq_4_with_loops():
    unary, values = random_cells((3, 2, 3), 1)
    cells = [(r, c) for r in range(2) for c in range(3)]
    Q, expected = softmax(-unary, axis=0), np.zeros_like(unary)
    for i in cells:
        for label in range(3):
            cost = unary[(label, *i)]
            for j in cells:
                if j == i:
                    continue
                place = (i[0] - j[0]) ** 2 + (i[1] - j[1]) ** 2
                state = ((values[(slice(None), *i)] - values[(slice(None), *j)]) ** 2).sum()
                k = 2 * np.exp(-place / (2 * 2**2) - state / (2 * 0.5**2)) + 3 * np.exp(-place / 2)
                cost += k * sum(Q[(other, *j)] for other in range(3) if other != label)
            expected[(label, *i)] = np.exp(-cost)
    # An update goes 1 / (1 + (2 + 3) / 2) of the way, in logarithms: both kernels have 1 on their diagonal.
    expected = Q ** (5 / 7) * expected ** (2 / 7)
    expected /= expected.sum(axis=0)
    np.testing.assert_allclose(mean_field_naive(unary, values, AS_PRINTED, iterations=1), expected, atol=1e-12)


def test_unary_from_probability_is_minus_log():
    np.testing.assert_allclose(unary_from_probability([[0.5], [0.5], [0.0]]), [[np.log(2)], [np.log(2)], [np.inf]])
    for wrong in ([0.5, 0.6], [1.5, -0.5], [np.nan, 1.0]):
        with pytest.raises(ArgumentError, match="probability"):
            unary_from_probability(wrong)


@pytest.mark.parametrize(
    ("name", "value"),
    [("w_bilateral", -1), ("w_spatial", np.nan), ("sigma_alpha", 0), ("sigma_beta", -0.2), ("sigma_gamma", np.inf)],
)
def test_params_refuse_what_has_no_meaning(name, value):
    with pytest.raises(ArgumentError, match=name):
        CrfParams(**{name: value})


def test_params_refuse_an_unknown_normalisation():
    with pytest.raises(ArgumentError, match=r"normalization.*'before'"):
        CrfParams(normalization="before")


def test_energy_refuses_labels_that_are_no_classes():
    unary, values = random_cells((2, 2, 2))
    for labels in (
        np.full((2, 2), 2),
        np.full((2, 2), 255),
        np.full((2, 2), -1),
        np.zeros((2, 3), int),
        np.zeros((2, 2)),
    ):
        with pytest.raises(ArgumentError, match="labels"):
            energy(labels, unary, values, CrfParams())


def test_written_out_pairs_refuse_a_large_grid():
    values = np.full((4, 101, 100), 0.25)
    with pytest.raises(ArgumentError, match=r"at most 10000 cells.*found 10100"):
        mean_field_naive(np.zeros((2, 101, 100)), values, CrfParams())


@pytest.mark.parametrize("cell", [0.1, 0.2, 0.5])
def test_the_reach_in_metres_is_the_same_in_every_grid(cell):
    params = CrfParams.for_cells(cell)
    assert params.sigma_alpha * cell == pytest.approx(CrfParams().sigma_alpha * 0.2)
    assert params.sigma_gamma * cell == pytest.approx(CrfParams().sigma_gamma * 0.2)


@pytest.mark.parametrize("cell", [0, -0.5, np.nan, np.inf])
def test_cells_without_a_size_are_refused(cell):
    with pytest.raises(ArgumentError, match="cell: expected a positive number of metres"):
        CrfParams.for_cells(cell)

"""Degenerate input: the right limit, or an error that names the argument, for every way to run the CRF."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from enumeration import random_cells
from scipy.special import logsumexp, softmax

from semgrid_edu import fast
from semgrid_edu.crf import (
    CrfParams,
    energy,
    exact_marginals,
    free_energy,
    log_partition,
    mean_field,
    mean_field_naive,
    mean_field_sequential,
    most_likely,
    pair_weights,
)
from semgrid_edu.crf.params import LARGEST_WEIGHT, NARROWEST
from semgrid_edu.errors import ArgumentError

SHAPES = [(3, 2, 3), (3, 1, 5), (3, 5, 1), (4, 1, 1), (1, 2, 3), (1, 1, 1)]
NORMALIZATIONS = pytest.mark.parametrize("normalization", ["symmetric", "none"])
MARGINALS = {
    "filters": mean_field,
    "fast": fast.mean_field,
    "naive": mean_field_naive,
    "sequential": mean_field_sequential,
    "exact": exact_marginals,
}
OF_MARGINALS = pytest.mark.parametrize("infer", MARGINALS.values(), ids=MARGINALS)
FILTERS = pytest.mark.parametrize("infer", [mean_field, fast.mean_field], ids=["book", "fast"])


def distance_of_free_energy(unary, values, params):
    """F(Q) + log Z, which is KL(Q || P)."""
    Q = mean_field_naive(unary, values, params)
    return free_energy(Q, unary, values, params) + log_partition(unary, values, params)


def energy_of_one_label(unary, values, params):
    return energy(np.zeros(np.shape(values)[1:], int), unary, values, params)


EVERY = [*MARGINALS.values(), most_likely, log_partition, distance_of_free_energy, energy_of_one_label]


# --- widths and weights --------------------------------------------------------------------------


@OF_MARGINALS
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    "change",
    [{"sigma_alpha": 1e-300, "sigma_gamma": 1e-300}, {"w_bilateral": 0}],
)
@NORMALIZATIONS
def test_kernels_without_width_or_weight_leave_each_cell_its_own_distribution(infer, shape, change, normalization):
    unary, values = random_cells(shape)
    params = CrfParams(**change, normalization=normalization)
    params = replace(params, w_spatial=0) if params.w_bilateral == 0 else params
    np.testing.assert_allclose(infer(unary, values, params), softmax(-unary, axis=0), atol=1e-6)


@FILTERS
@pytest.mark.parametrize("width", [1e6, 1e300])
@NORMALIZATIONS
def test_kernels_of_any_width_weigh_all_pairs_alike(infer, width, normalization):
    unary, values = random_cells((3, 4, 3))
    params = CrfParams(4, 3, width, width, width, normalization)
    weight = 7 / 12 if normalization == "symmetric" else 7
    np.testing.assert_allclose(pair_weights(values, params), weight * (1 - np.eye(12)), rtol=1e-9)
    # The lattice's kernel isn't quite 1 at distance 0, which only the normalisation mends.
    tolerance = 1e-5 if normalization == "symmetric" else 0.03
    for iterations in (1, 10):
        exact = mean_field_naive(unary, values, params, iterations)
        np.testing.assert_allclose(infer(unary, values, params, iterations), exact, atol=tolerance)


@pytest.mark.parametrize("name", ["sigma_alpha", "sigma_gamma"])
@pytest.mark.parametrize(
    ("infer", "tolerance"), [(mean_field, 2e-3), (fast.mean_field, 2e-3), (mean_field_naive, 1e-9)]
)
def test_one_kernel_without_width_leaves_the_other(infer, tolerance, name):
    unary, values = random_cells((3, 8, 6))
    params = replace(CrfParams(), **{name: 1e-6})
    other = replace(params, **{"w_bilateral" if name == "sigma_alpha" else "w_spatial": 0})
    np.testing.assert_allclose(infer(unary, values, params, 500), infer(unary, values, other, 500), atol=tolerance)


@FILTERS
def test_a_width_below_the_narrowest_changes_nothing(infer):
    unary, values = random_cells((3, 8, 6))
    narrowest, half, none = (
        infer(unary, values, CrfParams(sigma_alpha=width, sigma_gamma=width))
        for width in (NARROWEST, NARROWEST / 2, 1e-6)
    )
    np.testing.assert_array_equal(half, narrowest)
    np.testing.assert_array_equal(none, narrowest)


@FILTERS
def test_states_too_far_apart_for_the_lattice_are_an_error_unless_the_kernel_has_no_weight(infer):
    unary, values = random_cells()
    params = CrfParams(sigma_beta=1e-6)
    with pytest.raises(ArgumentError, match="larger sigma"):
        infer(unary, values, params)
    without = replace(params, w_bilateral=0)
    np.testing.assert_allclose(infer(unary, values, without), mean_field_naive(unary, values, without), atol=1e-6)


@pytest.mark.parametrize("weight", [1e4, 1e8, LARGEST_WEIGHT])
@NORMALIZATIONS
def test_enormous_weights_make_all_cells_agree(weight, normalization):
    """The exact marginals are those of one cell with the sum of all costs; mean field picks a side."""
    unary, values = random_cells((3, 2, 3))
    params = CrfParams(weight, weight, 50, 5, 50, normalization)
    together = softmax(-unary.sum(axis=(1, 2)))
    np.testing.assert_allclose(exact_marginals(unary, values, params), np.tile(together, (2, 3, 1)).transpose(2, 0, 1))
    np.testing.assert_array_equal(most_likely(unary, values, params), np.full((2, 3), together.argmax()))
    assert log_partition(unary, values, params) == pytest.approx(logsumexp(-unary.sum(axis=(1, 2))))
    for infer in (mean_field, fast.mean_field, mean_field_naive):
        assert np.ptp(infer(unary, values, params, 100).argmax(axis=0)) == 0


def test_weights_beyond_float32_are_an_error():
    with pytest.raises(ArgumentError, match=r"w_spatial.*at most 1e\+30.*found 1e\+300"):
        CrfParams(w_spatial=1e300)


@pytest.mark.parametrize("infer", [exact_marginals, most_likely, log_partition])
def test_contradictions_whose_probability_is_below_every_number_have_no_exact_answer(infer):
    unary, values = np.array([[[0.0, 1e3]], [[1e3, 0.0]]]), np.full((4, 1, 2), 0.25)
    with pytest.raises(ArgumentError, match="params: expected weights and costs"):
        infer(unary, values, CrfParams(1e6, 1e6))
    contradiction = np.array([[[0.0, np.inf]], [[np.inf, 0.0]]])
    expected = {"exact_marginals": [[[1, 0]], [[0, 1]]], "most_likely": [[0, 1]]}
    weight = pair_weights(values, CrfParams())[0, 1]
    np.testing.assert_allclose(infer(contradiction, values, CrfParams()), expected.get(infer.__name__, -weight))


# --- sizes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 2, 3), (1, 1, 1)])
def test_one_class_is_certain(shape):
    unary, values = random_cells(shape)
    for infer in MARGINALS.values():
        np.testing.assert_array_equal(infer(unary, values, CrfParams()), np.ones(shape))
    np.testing.assert_array_equal(most_likely(unary, values, CrfParams()), np.zeros(shape[1:]))
    assert log_partition(unary, values, CrfParams()) == pytest.approx(-unary.sum())
    assert distance_of_free_energy(unary, values, CrfParams()) == pytest.approx(0, abs=1e-12)


# --- the unary term ------------------------------------------------------------------------------


@OF_MARGINALS
def test_an_impossible_class_is_one_that_costs_very_much(infer):
    unary, values = random_cells()
    unary[0, 0, 0] = unary[1, 1] = np.inf
    found = infer(unary, values, CrfParams())
    assert (found[np.isinf(unary)] == 0).all()
    np.testing.assert_allclose(found, infer(np.minimum(unary, 600), values, CrfParams()), atol=1e-6)
    unary[1:] = np.inf  # one class alone is possible
    unary[0] = 0
    np.testing.assert_array_equal(infer(unary, values, CrfParams())[0], 1)


@OF_MARGINALS
@pytest.mark.parametrize("shift", [-1000.0, 1000.0])
def test_what_is_added_to_all_classes_of_a_cell_changes_nothing_but_the_energy(infer, shift):
    unary, values = random_cells()
    shifted = unary.copy()
    shifted[:, 0, 1] += shift
    np.testing.assert_allclose(infer(shifted, values, CrfParams()), infer(unary, values, CrfParams()), atol=1e-6)
    log_Z = (log_partition(costs, values, CrfParams()) for costs in (shifted, unary))
    assert next(log_Z) == pytest.approx(next(log_Z) - shift, abs=1e-9)


@OF_MARGINALS
def test_costs_of_any_size_decide_a_cell(infer):
    unary, values = random_cells()
    np.testing.assert_array_equal(infer(1e300 * unary, values, CrfParams()), unary == unary.min(axis=0))


# --- kinds of arrays -----------------------------------------------------------------------------


@pytest.mark.parametrize("infer", EVERY)
def test_neither_layout_nor_kind_of_array_changes_anything(infer):
    unary, values = random_cells()
    expected = infer(unary, values, CrfParams())
    strided = np.repeat(np.repeat(unary, 2, axis=2), 3, axis=0)[::3, :, ::2]
    frozen = unary.copy()
    frozen.flags.writeable = False
    reversed_twice = values[:, ::-1].copy()[:, ::-1]
    masked = np.ma.masked_array(unary, np.zeros(unary.shape, bool))
    kinds = unary.tolist(), torch.tensor(unary), masked, unary.astype(">f8"), unary.astype(object)
    for same in (np.asfortranarray(unary), strided, frozen, *kinds):
        np.testing.assert_allclose(infer(same, values, CrfParams()), expected, rtol=1e-12)
    for same in (np.asfortranarray(values), reversed_twice, torch.tensor(values)):
        np.testing.assert_allclose(infer(unary, same, CrfParams()), expected, rtol=1e-12)


@pytest.mark.parametrize("infer", EVERY)
@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.uint8, np.int64, np.bool_])
def test_numbers_of_fewer_digits_are_taken_for_what_they_are(infer, dtype):
    unary = np.array([[[0, 1, 1], [1, 0, 1]], [[1, 0, 1], [1, 1, 0]]]).astype(dtype)
    values = np.eye(4)[[[0, 1, 2], [3, 0, 1]]].transpose(2, 0, 1).astype(dtype)
    expected = infer(unary.astype(np.float64), values.astype(np.float64), CrfParams())
    found = infer(unary, values, CrfParams())
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert getattr(found, "dtype", np.float64) == getattr(expected, "dtype", np.float64)


def changed(index, number):
    """Return what puts a number somewhere in the unary term."""

    def change(unary):
        unary[index] = number
        return unary

    return change


WRONG_UNARIES = {
    "another shape": (lambda unary: unary[0], "expected shape"),
    "no class": (lambda unary: unary[:0], "expected shape"),
    "no column": (lambda unary: unary[:, :, :0], "expected shape"),
    "NaN": (changed((1, 0, 2), np.nan), "expected numbers"),
    "-inf": (changed((1, 0, 2), -np.inf), "expected numbers"),
    "no possible class": (changed((slice(None), 1, 1), np.inf), "expected a possible class"),
    "complex": (lambda unary: unary.astype(complex), "expected"),
    "masked": (lambda unary: np.ma.masked_greater(unary, 0), "expected"),
    "gradients": (lambda unary: torch.tensor(unary, requires_grad=True), "expected"),
    "bfloat16": (lambda unary: torch.tensor(unary, dtype=torch.bfloat16), "expected"),
    "ragged": (lambda _: [[[1.0, 2.0]], [[1.0]]], "expected"),
    "text": (lambda _: "unary.npy", "expected"),
}
WRONG_VALUES = {
    "too much": lambda values: 1.2 * values,
    "nothing": lambda values: 0 * values,
    "negative": lambda values: values + np.reshape([1, -1, 0, 0], (4, 1, 1)),
    "NaN": lambda values: values * np.nan,
    "logarithms": np.log,
    "masked": lambda values: np.ma.masked_greater(values, 0.3),
    "complex": lambda values: values.astype(complex),
    "three states": lambda values: values[:3],
    "states last": lambda values: np.moveaxis(values, 0, -1),
}


@pytest.mark.parametrize("infer", EVERY)
@pytest.mark.parametrize("wrong", WRONG_UNARIES)
def test_what_is_no_unary_term_is_an_error_that_names_it(infer, wrong):
    unary, values = random_cells()
    change, message = WRONG_UNARIES[wrong]
    with pytest.raises(ArgumentError, match=rf"^unary: {message}"):
        infer(change(unary), values, CrfParams())


@pytest.mark.parametrize("infer", EVERY)
@pytest.mark.parametrize("wrong", WRONG_VALUES)
def test_what_is_no_distribution_of_states_is_an_error_that_names_it(infer, wrong):
    unary, values = random_cells()
    with pytest.raises(ArgumentError, match=r"^values: expected"):
        infer(unary, WRONG_VALUES[wrong](values), CrfParams())


# --- the states ----------------------------------------------------------------------------------


@pytest.mark.parametrize("infer", EVERY)
def test_rounding_of_states_is_forgiven(infer):
    unary, values = random_cells((3, 2, 2))
    rounded = values + np.reshape([-5e-4, 0, 4e-4, 0], (4, 1, 1)) * (values[0] > 0.1)
    np.testing.assert_allclose(infer(unary, rounded, CrfParams()), infer(unary, values, CrfParams()), atol=0.02)

"""Degenerate input: the right limit, or an error that names the argument; and the twins agree."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.special import logsumexp, softmax

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

SHAPES = [(3, 2, 3), (3, 1, 5), (3, 5, 1), (2, 1, 2), (4, 1, 1), (1, 2, 3), (1, 1, 1)]
NORMALIZATIONS = pytest.mark.parametrize("normalization", ["symmetric", "none"])


def crf(shape=(3, 2, 3), seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape), np.moveaxis(rng.dirichlet(np.ones(4), shape[1:]), -1, 0)


def distance_of_free_energy(unary, values, params):
    """F(Q) + log Z, which is KL(Q || P)."""
    Q = mean_field_naive(unary, values, params)
    return free_energy(Q, unary, values, params) + log_partition(unary, values, params)


def energy_of_one_label(unary, values, params):
    return energy(np.zeros(np.shape(values)[1:], int), unary, values, params)


MARGINALS = [mean_field, mean_field_naive, mean_field_sequential, exact_marginals]
EVERY = [*MARGINALS, most_likely, log_partition, distance_of_free_energy, energy_of_one_label]


# --- widths and weights --------------------------------------------------------------------------


@pytest.mark.parametrize("infer", MARGINALS)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("width", [1e-6, 1e-300])
@NORMALIZATIONS
def test_kernels_without_width_leave_each_cell_its_own_distribution(infer, shape, width, normalization):
    unary, values = crf(shape)
    params = CrfParams(sigma_alpha=width, sigma_gamma=width, normalization=normalization)
    np.testing.assert_allclose(infer(unary, values, params), softmax(-unary, axis=0), atol=1e-6)


@pytest.mark.parametrize("width", [1e6, 1e300])
@NORMALIZATIONS
def test_kernels_of_any_width_weigh_all_pairs_alike(width, normalization):
    unary, values = crf((3, 4, 3))
    params = CrfParams(4, 3, width, width, width, normalization)
    weight = 7 / 12 if normalization == "symmetric" else 7
    np.testing.assert_allclose(pair_weights(values, params), weight * (1 - np.eye(12)), rtol=1e-9)
    # The lattice's kernel isn't quite 1 at distance 0, which only the normalisation mends.
    tolerance = 1e-5 if normalization == "symmetric" else 0.03
    for iterations in (1, 10):
        fast, naive = (infer(unary, values, params, iterations) for infer in (mean_field, mean_field_naive))
        np.testing.assert_allclose(fast, naive, atol=tolerance)


@pytest.mark.parametrize("name", ["sigma_alpha", "sigma_gamma"])
def test_one_kernel_without_width_leaves_the_other(name):
    """Of the bilateral kernel the lattice is only nearly a Gaussian, so for that one the twins differ by more."""
    unary, values = crf((3, 8, 6))
    params = replace(CrfParams(), **{name: 1e-6})
    other = replace(params, **{"w_bilateral" if name == "sigma_alpha" else "w_spatial": 0})
    for infer, tolerance in ((mean_field, 2e-3), (mean_field_naive, 1e-9)):
        one, both = (infer(unary, values, crf_params, 500) for crf_params in (other, params))
        np.testing.assert_allclose(both, one, atol=tolerance)


def test_a_width_below_the_narrowest_changes_nothing():
    unary, values = crf((3, 8, 6))
    widths = [{"sigma_alpha": width, "sigma_gamma": width} for width in (NARROWEST, NARROWEST / 2, 1e-6)]
    first, *others = (mean_field(unary, values, CrfParams(**width)) for width in widths)
    for other in others:
        np.testing.assert_array_equal(other, first)
    for k in (0.5, 1):
        assert np.exp(-0.5 / (k * NARROWEST) ** 2) < 1e-9


def test_states_too_far_apart_for_the_lattice_are_an_error_that_names_the_width():
    unary, values = crf()
    params = CrfParams(sigma_beta=1e-6)
    with pytest.raises(ArgumentError, match=r"sigma_beta above 1e-3.*found 1e-06"):
        mean_field(unary, values, params)
    without = replace(params, w_bilateral=0)
    fast, naive = (infer(unary, values, without) for infer in (mean_field, mean_field_naive))
    np.testing.assert_allclose(fast, naive, atol=1e-6)


@pytest.mark.parametrize("infer", MARGINALS)
@pytest.mark.parametrize("shape", SHAPES)
@NORMALIZATIONS
def test_without_weights_nothing_happens(infer, shape, normalization):
    unary, values = crf(shape)
    params = CrfParams(0, 0, normalization=normalization)
    np.testing.assert_allclose(infer(unary, values, params), softmax(-unary, axis=0), atol=1e-6)


@pytest.mark.parametrize("weight", [1e4, 1e8, LARGEST_WEIGHT])
@NORMALIZATIONS
def test_enormous_weights_make_all_cells_agree(weight, normalization):
    """The exact marginals are those of one cell with the sum of all costs; mean field picks a side."""
    unary, values = crf((3, 2, 3))
    params = CrfParams(weight, weight, 50, 5, 50, normalization)
    together = softmax(-unary.sum(axis=(1, 2)))
    np.testing.assert_allclose(exact_marginals(unary, values, params), np.tile(together, (2, 3, 1)).transpose(2, 0, 1))
    np.testing.assert_array_equal(most_likely(unary, values, params), np.full((2, 3), together.argmax()))
    assert log_partition(unary, values, params) == pytest.approx(logsumexp(-unary.sum(axis=(1, 2))))
    for infer in (mean_field, mean_field_naive):
        assert np.ptp(infer(unary, values, params, 100).argmax(axis=0)) == 0


def test_weights_beyond_float32_are_refused():
    with pytest.raises(ArgumentError, match=r"w_spatial.*at most 1e\+30.*found 1e\+300"):
        CrfParams(w_spatial=1e300)


@pytest.mark.parametrize("infer", [exact_marginals, most_likely, log_partition])
def test_exact_inference_refuses_contradictions_whose_probability_is_below_every_number(infer):
    unary, values = np.array([[[0.0, 1e3]], [[1e3, 0.0]]]), np.full((4, 1, 2), 0.25)
    with pytest.raises(ArgumentError, match="params: expected weights and costs"):
        infer(unary, values, CrfParams(1e6, 1e6))
    contradiction = np.array([[[0.0, np.inf]], [[np.inf, 0.0]]])
    expected = {"exact_marginals": [[[1, 0]], [[0, 1]]], "most_likely": [[0, 1]]}
    weight = pair_weights(values, CrfParams())[0, 1]
    np.testing.assert_allclose(infer(contradiction, values, CrfParams()), expected.get(infer.__name__, -weight))


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_pairs_of_states_that_are_no_numbers_are_refused(wrong):
    with pytest.raises(ArgumentError, match=r"^values: expected probabilities"):
        pair_weights(np.full((4, 2, 3), wrong), CrfParams())


# --- sizes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("infer", MARGINALS)
def test_one_cell_keeps_its_distribution(infer):
    unary, values = crf((4, 1, 1))
    np.testing.assert_allclose(infer(unary, values, CrfParams()), softmax(-unary, axis=0), atol=1e-6)


@pytest.mark.parametrize("shape", [(1, 2, 3), (1, 1, 1)])
def test_one_class_is_certain(shape):
    unary, values = crf(shape)
    for infer in MARGINALS:
        np.testing.assert_array_equal(infer(unary, values, CrfParams()), np.ones(shape))
    np.testing.assert_array_equal(most_likely(unary, values, CrfParams()), np.zeros(shape[1:]))
    assert log_partition(unary, values, CrfParams()) == pytest.approx(-unary.sum())
    assert distance_of_free_energy(unary, values, CrfParams()) == pytest.approx(0, abs=1e-12)


@NORMALIZATIONS
@pytest.mark.parametrize("infer", MARGINALS)
def test_a_row_and_a_column_are_treated_alike(infer, normalization):
    (unary, values), params = crf((3, 1, 7)), CrfParams(1, 1, normalization=normalization)
    row = infer(unary, values, params)
    column = infer(unary.transpose(0, 2, 1), values.transpose(0, 2, 1), params)
    # The lattice lies obliquely in the grid, so it doesn't treat the two axes alike.
    np.testing.assert_allclose(column.transpose(0, 2, 1), row, atol=0.05 if infer is mean_field else 1e-9)


@pytest.mark.parametrize("shape", [(0, 2, 3), (3, 0, 3), (3, 2, 0), (0,), (3, 2), (1, 3, 2, 3)])
@pytest.mark.parametrize("infer", EVERY)
def test_arrays_of_another_shape_are_refused(infer, shape):
    with pytest.raises(ArgumentError, match=r"^unary: expected shape"):
        infer(np.zeros(shape), np.full((4, *shape[1:]), 0.25), CrfParams())


# --- the unary term ------------------------------------------------------------------------------


@pytest.mark.parametrize("infer", EVERY)
@pytest.mark.parametrize("wrong", [np.nan, -np.inf])
def test_costs_that_are_no_costs_are_refused(infer, wrong):
    unary, values = crf()
    unary[1, 0, 2] = wrong
    with pytest.raises(ArgumentError, match="unary: expected numbers"):
        infer(unary, values, CrfParams())


@pytest.mark.parametrize("infer", EVERY)
def test_a_cell_without_a_possible_class_is_refused(infer):
    unary, values = crf()
    unary[:, 1, 1] = np.inf
    with pytest.raises(ArgumentError, match="unary: expected a possible class"):
        infer(unary, values, CrfParams())


@pytest.mark.parametrize("infer", MARGINALS)
def test_an_impossible_class_is_one_that_costs_very_much(infer):
    unary, values = crf()
    unary[0, 0, 0] = unary[1, 1] = np.inf
    dear = infer(np.minimum(unary, 600), values, CrfParams())
    found = infer(unary, values, CrfParams())
    assert (found[np.isinf(unary)] == 0).all()
    np.testing.assert_allclose(found, dear, atol=1e-6)


@pytest.mark.parametrize("infer", MARGINALS)
def test_where_one_class_alone_is_possible_it_is_certain(infer):
    unary, values = crf()
    unary[1:] = np.inf
    np.testing.assert_array_equal(infer(unary, values, CrfParams()), np.arange(3)[:, None, None] == np.zeros((2, 3)))


@pytest.mark.parametrize("infer", MARGINALS)
@pytest.mark.parametrize("shift", [-1000.0, 1000.0])
def test_what_is_added_to_all_classes_of_a_cell_changes_nothing_but_the_energy(infer, shift):
    unary, values = crf()
    shifted = unary.copy()
    shifted[:, 0, 1] += shift
    np.testing.assert_allclose(infer(shifted, values, CrfParams()), infer(unary, values, CrfParams()), atol=1e-6)
    log_Z = (log_partition(costs, values, CrfParams()) for costs in (shifted, unary))
    assert next(log_Z) == pytest.approx(next(log_Z) - shift, abs=1e-9)
    assert distance_of_free_energy(shifted, values, CrfParams()) >= -1e-9


@pytest.mark.parametrize("infer", MARGINALS)
def test_costs_of_any_size_decide_a_cell(infer):
    unary, values = crf()
    found = infer(1e300 * unary, values, CrfParams())
    np.testing.assert_array_equal(found, unary == unary.min(axis=0))


def test_minus_zero_is_zero():
    unary, values = np.zeros((3, 2, 3)), np.zeros((4, 2, 3))
    values[2] = 1
    for infer in EVERY:
        np.testing.assert_array_equal(
            infer(-unary, values * [[[1]], [[-1]], [[1]], [[-1]]], CrfParams()), infer(unary, values, CrfParams())
        )


# --- kinds of arrays -----------------------------------------------------------------------------


@pytest.mark.parametrize("infer", EVERY)
def test_the_layout_in_memory_changes_nothing(infer):
    unary, values = crf()
    strided = np.repeat(np.repeat(unary, 2, axis=2), 3, axis=0)[::3, :, ::2]
    frozen = unary.copy(), values.copy()
    for array in frozen:
        array.flags.writeable = False
    reversed_twice = values[:, ::-1].copy()[:, ::-1]
    expected = infer(unary, values, CrfParams())
    for other in ((np.asfortranarray(unary), np.asfortranarray(values)), (strided, reversed_twice), frozen):
        np.testing.assert_allclose(infer(*other, CrfParams()), expected, rtol=1e-12)


@pytest.mark.parametrize("infer", EVERY)
def test_what_holds_the_same_numbers_gives_the_same(infer):
    unary, values = crf()
    expected = infer(unary, values, CrfParams())
    masked = np.ma.masked_array(unary, np.zeros(unary.shape, bool))
    for same in (unary.tolist(), torch.tensor(unary), masked, unary.astype(">f8"), unary.astype(object)):
        np.testing.assert_allclose(infer(same, torch.tensor(values), CrfParams()), expected, rtol=1e-12)


@pytest.mark.parametrize("infer", EVERY)
@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.int8, np.uint8, np.int64, np.bool_])
def test_numbers_of_fewer_digits_are_taken_for_what_they_are(infer, dtype):
    unary = np.array([[[0, 1, 1], [1, 0, 1]], [[1, 0, 1], [1, 1, 0]]]).astype(dtype)
    values = np.eye(4)[[[0, 1, 2], [3, 0, 1]]].transpose(2, 0, 1).astype(dtype)
    expected = infer(unary.astype(np.float64), values.astype(np.float64), CrfParams())
    found = infer(unary, values, CrfParams())
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert getattr(found, "dtype", np.float64) == getattr(expected, "dtype", np.float64)


@pytest.mark.parametrize("infer", EVERY)
@pytest.mark.parametrize(
    "wrong",
    [
        lambda unary: unary.astype(complex),
        lambda unary: np.ma.masked_greater(unary, 0),
        lambda unary: torch.tensor(unary, requires_grad=True),
        lambda unary: torch.tensor(unary, dtype=torch.bfloat16),
        lambda unary: [[[1.0, 2.0]], [[1.0]]],
        lambda unary: "unary.npy",
        lambda unary: None,
    ],
    ids=["complex", "masked", "gradients", "bfloat16", "ragged", "text", "None"],
)
def test_what_holds_no_real_numbers_is_refused_by_name(infer, wrong):
    unary, values = crf()
    with pytest.raises(ArgumentError, match=r"^unary: expected"):
        infer(wrong(unary), values, CrfParams())


# --- the states ----------------------------------------------------------------------------------


@pytest.mark.parametrize("infer", EVERY)
@pytest.mark.parametrize(
    "wrong",
    [
        lambda values: 1.2 * values,
        lambda values: 100 * values,
        lambda values: 0 * values,
        lambda values: values + np.reshape([1, -1, 0, 0], (4, 1, 1)),
        lambda values: values * np.nan,
        lambda values: values + np.inf,
        lambda values: np.log(values),
        lambda values: np.ma.masked_greater(values, 0.3),
        lambda values: values.astype(complex),
        lambda values: values[:3],
        lambda values: np.moveaxis(values, 0, -1),
        lambda values: None,
    ],
)
def test_what_is_no_distribution_of_states_is_refused_by_name(infer, wrong):
    unary, values = crf()
    with pytest.raises(ArgumentError, match=r"^values: expected"):
        infer(unary, wrong(values), CrfParams())


@pytest.mark.parametrize("infer", EVERY)
def test_rounding_of_states_is_forgiven(infer):
    unary, values = crf((3, 2, 2))
    rounded = values + np.reshape([-5e-4, 0, 4e-4, 0], (4, 1, 1)) * (values[0] > 0.1)
    np.testing.assert_allclose(infer(unary, rounded, CrfParams()), infer(unary, values, CrfParams()), atol=0.02)


@pytest.mark.parametrize("infer", MARGINALS)
def test_equal_states_everywhere_make_the_bilateral_kernel_a_spatial_one(infer):
    (unary, _), values = crf((3, 2, 3)), np.full((4, 2, 3), 0.25)
    certain = np.zeros_like(values)
    certain[3] = 1
    np.testing.assert_allclose(infer(unary, values, CrfParams()), infer(unary, certain, CrfParams()), atol=0.01)

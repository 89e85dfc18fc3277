"""Accurate mean field against the written-out one, and what its window leaves out."""

import resource

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from scipy.special import softmax
from worlds.lecture_11_accurate import RADIUS, WindowedGaussian, mean_field_accurate

from semgrid_edu.crf import CrfParams, gram_matrix, mean_field_naive, unary_from_probability

BOTH = pytest.mark.parametrize("normalization", ["symmetric", "none"])


def street(seed, shape=(60, 40), n_classes=14):
    """Classes and states in patches, under noise."""
    rng = np.random.default_rng(seed)
    truth, state = (np.argmax(gaussian_filter(rng.normal(size=(n, *shape)), (0, 4, 4)), axis=0) for n in (n_classes, 4))
    scores = 2 * np.eye(n_classes)[truth] + 1.5 * rng.normal(size=(*shape, n_classes))
    values = softmax(5 * np.eye(4)[state] + 0.5 * rng.normal(size=(*shape, 4)), axis=-1)
    unary = unary_from_probability(softmax(scores, axis=-1).transpose(2, 0, 1))
    return unary, values.transpose(2, 0, 1)


def matrix(values, params, radius):
    """The kernel as a matrix: what it returns for each column of the identity."""
    return WindowedGaussian.build(values, params, radius)(np.eye(values[0].size, dtype=np.float32)).astype(np.float64)


@BOTH
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_without_a_window_it_is_the_naive_one_on_any_grid(normalization, data):
    classes, height, width = (data.draw(st.integers(1, high)) for high in (17, 6, 7))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    unary, values = rng.normal(size=(classes, height, width)), rng.dirichlet(np.full(4, 0.4), (height, width))
    weights = (data.draw(st.floats(0, 3)) / (1 if normalization == "symmetric" else 10) for _ in range(2))
    params = CrfParams(*weights, *(data.draw(st.floats(*ends)) for ends in ((0.1, 50), (0.05, 5), (0.1, 50))))
    params = CrfParams(**(params.__dict__ | {"normalization": normalization}))
    case = unary, np.moveaxis(values, -1, 0), params, data.draw(st.integers(0, 6))
    np.testing.assert_allclose(mean_field_accurate(*case, radius=np.inf), mean_field_naive(*case), atol=1e-4)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (7, 8)])
@pytest.mark.parametrize("radius", [RADIUS, 1.5, np.inf])
def test_inside_the_window_the_kernel_is_exact_and_outside_it_is_zero(shape, radius):
    values = np.moveaxis(np.random.default_rng(0).dirichlet(np.full(4, 0.5), shape), -1, 0)
    params = CrfParams(w_bilateral=2, w_spatial=0, sigma_alpha=1.4, sigma_beta=0.5, normalization="none")
    place = np.indices(shape).reshape(2, -1)
    apart = np.abs(place[:, :, None] - place[:, None]).max(axis=0)
    expected = np.where(apart <= np.ceil(min(radius, 100) * 1.4), gram_matrix(values, params), 0)
    np.testing.assert_allclose(matrix(values, params, radius), expected, rtol=2e-5, atol=1e-9)


@BOTH
def test_the_kernel_is_symmetric_and_knows_its_diagonal(normalization):
    _, values = street(0, (9, 8))
    params = CrfParams(sigma_alpha=2, normalization=normalization)
    found = matrix(values, params, RADIUS)
    np.testing.assert_allclose(found, found.T, rtol=1e-5)
    np.testing.assert_allclose(np.diag(found), WindowedGaussian.build(values, params).diagonal, rtol=1e-5)


def test_the_window_leaves_out_what_the_docstring_says():
    """In the middle of equal cells 0.00013 of the row sum, by the tail of the Gaussian beyond four widths."""
    values, params = np.full((4, 33, 33), 0.25), CrfParams(sigma_alpha=3, normalization="none")
    kernels, ones = (WindowedGaussian.build(values, params, r) for r in (RADIUS, np.inf)), np.ones((33 * 33, 1), "f4")
    inside, everywhere = (float(kernel(ones)[16 * 33 + 16, 0]) for kernel in kernels)
    assert 0 < 1 - inside / everywhere < 0.00013
    assert everywhere - inside < params.w_bilateral * 2 * np.pi * 9 * 0.00013


def test_at_60_by_40_cells_it_is_nearly_the_naive_one():
    for seed in range(2):
        unary, values = street(seed)
        exact, found = mean_field_naive(unary, values, CrfParams()), mean_field_accurate(unary, values, CrfParams())
        assert np.abs(found - exact).mean() <= 1e-5, seed
        assert (found.argmax(axis=0) == exact.argmax(axis=0)).mean() >= 0.999, seed
        assert found.dtype == np.float32


def test_it_stops_when_nothing_changes_any_more():
    unary, values = street(0, (8, 9), 3)
    calm, sooner = (mean_field_accurate(unary, values, CrfParams(), 1000, tolerance) for tolerance in (1e-6, 1e-2))
    np.testing.assert_allclose(mean_field_accurate(unary, values, CrfParams(), 200), calm, atol=1e-4)
    assert np.abs(calm - sooner).max() > 1e-6


def test_a_grid_whose_matrix_would_not_fit_takes_little_memory():
    """A matrix of 20,000 x 20,000 pairs would take 1.6 GB in single precision; kB are the unit of ru_maxrss."""
    unary, values = np.zeros((3, 200, 100)), np.full((4, 200, 100), 0.25)
    mean_field_accurate(unary[:, :2], values[:, :2], CrfParams(sigma_alpha=2), 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    mean_field_accurate(unary, values, CrfParams(sigma_alpha=2), 1)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000

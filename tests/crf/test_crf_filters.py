"""Both filters against the Gaussian sum over all pairs of points."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from semgrid_edu.crf import PermutohedralLattice, SeparableGaussian
from semgrid_edu.errors import ArgumentError


def dense_gaussian(features):
    return np.exp(-0.5 * cdist(features, features, "sqeuclidean"))


@pytest.mark.parametrize("normalization", ["symmetric", "none"])
@pytest.mark.parametrize(("shape", "sigma"), [((23, 17), 3.0), ((40, 5), 0.7), ((1, 1), 3.0), ((3, 50), 30.0)])
def test_separable_filter_is_the_gaussian_sum(shape, sigma, normalization):
    K = dense_gaussian(np.indices(shape).reshape(2, -1).T / sigma)
    if normalization == "symmetric":
        root = np.sqrt(K.sum(axis=1))
        K = K / np.outer(root, root)
    values = np.random.default_rng(0).random((K.shape[0], 16)).astype(np.float32)
    gaussian = SeparableGaussian.build(shape, sigma, 2.5, normalization)
    np.testing.assert_allclose(gaussian(values), 2.5 * K @ values, rtol=3e-6)
    np.testing.assert_allclose(gaussian.diagonal, 2.5 * np.diag(K), rtol=1e-6)


@pytest.mark.parametrize(("d", "spread", "tolerance"), [(1, 50, 0.03), (2, 12, 0.03), (3, 6, 0.03), (5, 3, 0.1)])
def test_lattice_approximates_the_gaussian_sum_over_dense_points(d, spread, tolerance):
    # Dense, so that no blur is lost: what remains is the lattice's own error, a few per cent (Adams 2010, section 5).
    rng = np.random.default_rng(d)
    features = rng.uniform(0, spread, (3000, d))
    values = rng.random((3000, 16)).astype(np.float32)
    exact = dense_gaussian(features) @ values
    assert np.linalg.norm(PermutohedralLattice.build(features)(values) - exact) < tolerance * np.linalg.norm(exact)


@pytest.mark.parametrize("d", [2, 3, 5])
def test_lattice_knows_its_own_diagonal(d):
    rng = np.random.default_rng(d)
    features = np.concatenate([rng.normal(0, 1, (100, d)), rng.normal(0, 30, (28, d))])  # a cloud and lonely points
    lattice = PermutohedralLattice.build(features)
    np.testing.assert_allclose(np.diag(lattice(np.eye(128, dtype=np.float32))), lattice.diagonal, rtol=1e-5)


def test_lonely_points_hear_themselves_alone():
    lattice = PermutohedralLattice.build(100.0 * np.eye(5))
    values = np.eye(5, dtype=np.float32)
    np.testing.assert_allclose(lattice(values), np.diag(lattice.diagonal), rtol=1e-5, atol=1e-7)


def test_scaled_lattice_is_a_product_of_matrices():
    rng = np.random.default_rng(0)
    lattice = PermutohedralLattice.build(rng.normal(size=(60, 3)))
    scale, values = rng.random(60).astype(np.float32), rng.random((60, 16)).astype(np.float32)
    scaled = lattice.scaled(scale)
    np.testing.assert_allclose(scaled(values), scale[:, None] * lattice(scale[:, None] * values), rtol=1e-4)
    np.testing.assert_allclose(scaled.diagonal, scale**2 * lattice.diagonal, rtol=1e-5)


def test_filter_is_linear_and_knows_no_lanes():
    rng = np.random.default_rng(0)
    lattice = PermutohedralLattice.build(rng.normal(size=(80, 5)))
    a, b = rng.random((2, 80, 3)).astype(np.float32)
    np.testing.assert_allclose(lattice(a + 2 * b), lattice(a) + 2 * lattice(b), rtol=1e-4)
    np.testing.assert_allclose(lattice(a)[:, 1], lattice(a[:, 1:2].copy())[:, 0], rtol=1e-5)


@pytest.mark.parametrize("features", [np.zeros(5), np.zeros((0, 5)), np.full((3, 2), np.nan), np.full((3, 2), 1e12)])
def test_lattice_refuses_what_it_cannot_hold(features):
    with pytest.raises(ArgumentError, match="features"):
        PermutohedralLattice.build(features)


def test_filters_take_values_in_any_memory_order():
    rng = np.random.default_rng(0)
    values = rng.random((16, 30)).astype(np.float32).T
    lattice, gaussian = PermutohedralLattice.build(rng.normal(size=(30, 3))), SeparableGaussian.build((5, 6), 2.0, 1.0, "none")
    for kernel in (lattice, gaussian):
        np.testing.assert_array_equal(kernel(values), kernel(np.ascontiguousarray(values)))

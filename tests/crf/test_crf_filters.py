"""Both filters, in the book and fast: against the Gaussian sum over all pairs, their definition, and each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from semgrid_edu import crf, fast
from semgrid_edu.crf import enclosing_simplices
from semgrid_edu.crf.lattice import elevated, peak
from semgrid_edu.errors import ArgumentError

LATTICES = pytest.mark.parametrize("Lattice", [crf.PermutohedralLattice, fast.PermutohedralLattice])
GAUSSIANS = pytest.mark.parametrize("Gaussian", [crf.SeparableGaussian, fast.SeparableGaussian])


def dense_gaussian(features):
    return np.exp(-0.5 * cdist(features, features, "sqeuclidean"))


def cloud_and_lonely_points(d):
    rng = np.random.default_rng(d)
    return np.concatenate([rng.normal(0, 1, (100, d)), rng.normal(0, 30, (28, d))])


@GAUSSIANS
@pytest.mark.parametrize("normalization", ["symmetric", "none"])
@pytest.mark.parametrize(("shape", "sigma"), [((23, 17), 3.0), ((40, 5), 0.7), ((1, 1), 3.0), ((3, 50), 30.0)])
def test_separable_filter_is_the_gaussian_sum(Gaussian, shape, sigma, normalization):
    K = dense_gaussian(np.indices(shape).reshape(2, -1).T / sigma)
    if normalization == "symmetric":
        root = np.sqrt(K.sum(axis=1))
        K = K / np.outer(root, root)
    values = np.random.default_rng(0).random((K.shape[0], 16)).astype(np.float32)
    gaussian = Gaussian.build(shape, sigma, 2.5, normalization)
    np.testing.assert_allclose(gaussian(values), 2.5 * K @ values, rtol=3e-6)
    np.testing.assert_allclose(gaussian.diagonal, 2.5 * np.diag(K), rtol=1e-6)


@settings(max_examples=200, deadline=None)
@given(d=st.integers(1, 7), seed=st.integers(0, 2**32 - 1))
def test_a_point_is_the_weighted_mean_of_the_corners_of_its_simplex(d, seed):
    points = elevated(np.random.default_rng(seed).normal(0, 10, (5, d)))
    for point, corners, weights in zip(points, *enclosing_simplices(points), strict=True):
        np.testing.assert_allclose(weights @ corners, point, atol=1e-9)
        np.testing.assert_allclose(weights.sum(), 1)
        assert (weights >= -1e-12).all()
        np.testing.assert_array_equal(corners.sum(axis=1), 0)
        np.testing.assert_array_equal(corners % (d + 1), np.tile(np.arange(d + 1)[:, None], d + 1))
        around = np.diff([*corners, corners[0]], axis=0).tolist()  # by a step in each direction, once
        assert sorted(around) == sorted((1 - (d + 1) * np.eye(d + 1, dtype=int)).tolist())


@LATTICES
@pytest.mark.parametrize("d", [1, 2, 3, 5])
def test_splat_blur_and_slice_are_what_a_dictionary_of_vertices_says(Lattice, d):
    features = cloud_and_lonely_points(d)
    values = np.random.default_rng(0).random((len(features), 3)).astype(np.float32)
    simplices = [
        (list(map(tuple, corners.tolist())), weights)
        for corners, weights in zip(*enclosing_simplices(elevated(features)), strict=True)
    ]
    vertices = {}
    for (corners, weights), value in zip(simplices, values, strict=True):
        for corner, weight in zip(corners, weights, strict=True):
            vertices[corner] = vertices.get(corner, 0) + weight * value
    for step in 1 - (d + 1) * np.eye(d + 1, dtype=int):

        def neighbour(vertex, way, held=vertices):
            return held.get(tuple((np.array(vertex) + way).tolist()), 0)

        vertices = {v: held / 2 + (neighbour(v, step) + neighbour(v, -step)) / 4 for v, held in vertices.items()}
    expected = [peak(d) * sum(w * vertices[c] for c, w in zip(*simplex, strict=True)) for simplex in simplices]
    np.testing.assert_allclose(Lattice.build(features)(values), expected, rtol=1e-4, atol=1e-5)


@LATTICES
@pytest.mark.parametrize(("d", "spread", "tolerance"), [(1, 50, 0.03), (2, 12, 0.03), (3, 6, 0.03), (5, 3, 0.1)])
def test_lattice_approximates_the_gaussian_sum_over_dense_points(Lattice, d, spread, tolerance):
    # Dense, so that no blur is lost: what remains is the lattice's own error, a few per cent (Adams 2010, section 5).
    rng = np.random.default_rng(d)
    features = rng.uniform(0, spread, (3000, d))
    values = rng.random((3000, 16)).astype(np.float32)
    exact = dense_gaussian(features) @ values
    assert np.linalg.norm(Lattice.build(features)(values) - exact) < tolerance * np.linalg.norm(exact)


@LATTICES
@pytest.mark.parametrize("d", [1, 2, 3, 5])
def test_lattice_knows_its_own_diagonal(Lattice, d):
    lattice = Lattice.build(cloud_and_lonely_points(d))
    np.testing.assert_allclose(np.diag(lattice(np.eye(128, dtype=np.float32))), lattice.diagonal, rtol=1e-5)


@LATTICES
def test_scaled_lattice_is_a_product_of_matrices(Lattice):
    rng = np.random.default_rng(0)
    lattice = Lattice.build(rng.normal(size=(60, 3)))
    scale, values = rng.random(60).astype(np.float32), rng.random((60, 16)).astype(np.float32)
    scaled = lattice.scaled(scale)
    np.testing.assert_allclose(scaled(values), scale[:, None] * lattice(scale[:, None] * values), rtol=1e-4)
    np.testing.assert_allclose(scaled.diagonal, scale**2 * lattice.diagonal, rtol=1e-5)


@LATTICES
@pytest.mark.parametrize("features", [np.zeros(5), np.zeros((0, 5)), np.full((3, 2), np.nan), np.full((3, 2), 1e12)])
def test_lattice_refuses_what_it_cannot_hold(Lattice, features):
    with pytest.raises(ArgumentError, match="features"):
        Lattice.build(features)


@settings(max_examples=60, deadline=None)
@given(d=st.integers(1, 6), spread=st.floats(0.01, 20), on_borders=st.booleans(), seed=st.integers(0, 2**32 - 1))
def test_the_book_and_fast_have_the_same_lattice(d, spread, on_borders, seed):
    """To the rounding of float32, also where points are on the border between simplices."""
    rng = np.random.default_rng(seed)
    features, values = rng.normal(0, spread, (40, d)), rng.random((40, 3)).astype(np.float32)
    if on_borders:
        features = np.rint(features)
    book, twin = (Lattice.build(features) for Lattice in (crf.PermutohedralLattice, fast.PermutohedralLattice))
    np.testing.assert_allclose(twin(values), book(values), rtol=2e-5, atol=2e-6)
    np.testing.assert_allclose(twin.diagonal, book.diagonal, rtol=2e-6)


def test_filters_take_values_in_any_memory_order():
    values = np.random.default_rng(0).random((16, 30)).astype(np.float32).T
    for twin in (crf, fast):
        lattice = twin.PermutohedralLattice.build(np.random.default_rng(1).normal(size=(30, 3)))
        for kernel in (lattice, twin.SeparableGaussian.build((5, 6), 2.0, 1.0, "none")):
            np.testing.assert_allclose(kernel(values), kernel(np.ascontiguousarray(values)), rtol=1e-12)

"""The literal lattice: its simplices by their definition, its filter against the fast one and against the Gaussian."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from semgrid_edu.crf import PermutohedralLattice, lattice_literal
from semgrid_edu.crf.lattice.literal import (
    blur_literal,
    enclosing_simplex_literal,
    slice_literal,
    splat_literal,
    step,
)


@settings(max_examples=200, deadline=None)
@given(d=st.integers(1, 7), seed=st.integers(0, 2**32 - 1))
def test_a_point_is_the_weighted_mean_of_the_corners_of_its_simplex(d, seed):
    point = np.random.default_rng(seed).normal(0, 10, d + 1)
    point -= point.mean()
    corners, weights = enclosing_simplex_literal(point)
    np.testing.assert_allclose(weights @ np.array(corners), point, atol=1e-9)
    np.testing.assert_allclose(weights.sum(), 1)
    assert (weights >= -1e-12).all()
    for remainder, corner in enumerate(corners):
        assert sum(corner) == 0
        assert {coordinate % (d + 1) for coordinate in corner} == {remainder}
    ways = np.diff([*corners, corners[0]], axis=0)  # once around, by a step in each direction
    assert sorted(map(tuple, ways.tolist())) == sorted(tuple(step(d + 1, j).tolist()) for j in range(d + 1))


@pytest.mark.parametrize("corner", [(0, 0, 0), (3, 0, -3), (4, 1, -5), (-1, 2, -1)])
def test_a_vertex_has_all_its_weight_on_itself(corner):
    corners, weights = enclosing_simplex_literal(corner)
    np.testing.assert_allclose(weights[corners.index(corner)], 1)


@pytest.mark.parametrize("d", [1, 2, 3, 5])
def test_the_fast_lattice_is_the_literal_one(d):
    rng = np.random.default_rng(d)
    features = np.concatenate([rng.normal(0, 1, (60, d)), rng.normal(0, 20, (20, d))])  # a cloud and lonely points
    values = rng.random((80, 3))
    fast = PermutohedralLattice.build(features)(values.astype(np.float32))
    np.testing.assert_allclose(fast, lattice_literal(features, values), rtol=1e-4, atol=1e-5)


def test_a_blur_keeps_the_sum_while_it_meets_no_end():
    row = {(-n, n): np.array([float(n == 0)]) for n in range(-3, 4)}  # a line: d = 1
    blurred = blur_literal(row, 0)
    assert [blurred[-n, n].item() for n in range(-2, 3)] == [0, 0.25, 0.5, 0.25, 0]
    assert sum(value.item() for value in blur_literal({(0, 0): np.ones(1)}, 0).values()) == 0.5


def test_splatting_keeps_the_sum_and_slicing_a_constant():
    rng = np.random.default_rng(0)
    features, values = rng.normal(size=(30, 4)), rng.random((30, 2))
    vertices = splat_literal(features, values)
    np.testing.assert_allclose(sum(vertices.values()), values.sum(axis=0))
    flat = dict.fromkeys(vertices, np.array([7.0]))
    np.testing.assert_allclose(slice_literal(features, flat), 7)


def test_over_dense_points_it_is_nearly_the_gaussian_sum():
    rng = np.random.default_rng(0)
    features, values = rng.uniform(0, 6, (700, 2)), rng.random((700, 1))
    exact = np.exp(-0.5 * cdist(features, features, "sqeuclidean")) @ values
    error = lattice_literal(features, values) - exact
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(exact)

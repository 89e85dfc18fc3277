"""Mean field never raises the free energy, and where it stops (eq. (3), (4))."""

import numpy as np
import pytest
from enumeration import enumerated, random_cells
from scipy.special import logsumexp, softmax, xlogy

from semgrid_edu import fast
from semgrid_edu.crf import (
    CrfParams,
    crf_model,
    free_energy,
    gram_matrix,
    log_partition,
    mean_field,
    mean_field_naive,
    mean_field_sequential,
    mean_field_updates,
    pair_weights,
)
from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import mean_field_graph

ROUNDING = 1e-12
"""Of the size of the free energy, which sums thousands of rounded terms."""


def random_crf(seed):
    """Any small grid with any parameters: strong and weak pairs, wide and narrow kernels, certain and vague unaries."""
    rng = np.random.default_rng(seed)
    classes, height, width = rng.integers(1, 5, 3)
    unary = rng.normal(0, rng.choice([0.1, 1, 5, 50]), (classes, height, width))
    unary[1:][rng.random((classes - 1, height, width)) < 0.05] = np.inf
    values = np.moveaxis(rng.dirichlet(np.full(4, rng.choice([0.05, 0.3, 3])), (height, width)), -1, 0)
    weights, sigmas = rng.choice([0, 0.5, 4, 40, 400], 2), rng.choice([0.1, 1, 8, 50], 3)
    return unary, values, CrfParams(*weights, *sigmas, rng.choice(["symmetric", "none"]))


def energies(unary, values, params, updates):
    """The free energy at first and after each update, the pair weights computed once; the last is `free_energy`."""
    states = mean_field_updates(unary, values, params)
    Q = np.array([next(states) for _ in range(1 + updates)])
    q = Q.reshape(*Q.shape[:2], -1)
    phi, pairs = np.where(np.isinf(unary), 0, unary).reshape(len(unary), -1), np.triu(pair_weights(values, params))
    found = np.einsum("ncx,cx->n", q, phi) + pairs.sum() - np.einsum("ncx,xy,ncy->n", q, pairs, q, optimize=True)
    found += xlogy(q, q).sum(axis=(1, 2))
    np.testing.assert_allclose(found[-1], free_energy(Q[-1], unary, values, params), rtol=1e-10, atol=1e-10)
    return found


def test_a_hundred_times_the_free_energy_never_rises():
    for seed in range(100):
        found = energies(*random_crf(seed), updates=12)
        assert (np.diff(found) <= ROUNDING * (1 + np.abs(found).max())).all(), seed


def test_a_hundred_times_the_distance_from_the_exact_distribution_is_never_negative():
    """On at most six cells of each grid, so that every labelling can be counted."""
    for seed in range(100):
        unary, values, params = random_crf(seed)
        unary, values = unary[:, :2, :3], values[:, :2, :3]
        log_Z = logsumexp(-enumerated(unary, values, params)[1])
        assert seed % 20 or log_partition(unary, values, params) == pytest.approx(log_Z, abs=1e-9), seed
        assert (energies(unary, values, params, 3) + log_Z >= -1e-9 * (1 + abs(log_Z))).all(), seed


def test_the_kernels_have_no_negative_eigenvalue_which_is_what_the_damping_rests_on():
    for seed in range(20):
        _, values, params = random_crf(seed)
        gram = gram_matrix(values, params)
        assert np.linalg.eigvalsh(gram).min() >= -1e-12 * (1 + gram.max()), seed
        np.fill_diagonal(gram, 0)
        np.testing.assert_allclose(pair_weights(values, params), gram, atol=1e-12, err_msg=f"seed {seed}")


def test_all_at_once_ends_in_a_fixed_point_of_one_by_one():
    params = CrfParams(w_bilateral=2, w_spatial=2)
    for seed in range(20):
        unary, values = random_cells((3, 3, 3), seed)
        settled = mean_field_naive(unary, values, params, iterations=5000, tolerance=1e-15)
        phi, weights, q = unary.reshape(3, -1), pair_weights(values, params), settled.reshape(3, -1)
        np.testing.assert_allclose(softmax(-phi - (1 - q) @ weights, axis=0), q, atol=1e-9, err_msg=f"seed {seed}")


def test_one_by_one_never_raises_the_free_energy_either():
    for seed in range(100):
        crf = random_crf(seed)
        found = np.array([free_energy(mean_field_sequential(*crf, iterations=n), *crf) for n in range(4)])
        assert (np.diff(found) <= ROUNDING * (1 + np.abs(found).max())).all(), seed


def test_one_by_one_is_mean_field_on_the_graph_of_the_crf():
    """The graph's update takes any factors; over the CRF's it is the CRF's own, sweep by sweep."""
    for seed in range(10):
        unary, values = random_cells((3, 2, 3), seed)
        for sweeps in (1, 3):
            found = mean_field_graph(crf_model(unary, values, CrfParams()), iterations=sweeps).marginals
            expected = mean_field_sequential(unary, values, CrfParams(), sweeps).reshape(3, -1)
            np.testing.assert_allclose(
                np.stack(list(found.values()), axis=1), expected, atol=1e-9, err_msg=f"seed {seed}"
            )


@pytest.mark.parametrize("infer", [mean_field, fast.mean_field])
def test_an_update_by_filters_follows_the_naive_one_into_strong_coupling(infer):
    """Only the spatial kernel, which is exact: then both agree at any weight, as they never oscillate."""
    for seed in range(30):
        rng = np.random.default_rng(seed)
        unary, values = 2 * rng.normal(size=(4, 12, 9)), np.full((4, 12, 9), 0.25)
        params = CrfParams(w_bilateral=0, w_spatial=rng.choice([3, 30]), sigma_gamma=2, normalization="none")
        exact = mean_field_naive(unary, values, params)
        np.testing.assert_allclose(infer(unary, values, params), exact, atol=2e-3, err_msg=f"seed {seed}")


@pytest.mark.parametrize("infer", [mean_field_naive, mean_field, fast.mean_field])
def test_it_stops_when_nothing_changes_any_more(infer):
    unary, values = np.random.default_rng(0).normal(size=(3, 8, 8)), np.full((4, 8, 8), 0.25)
    settled, sooner = (infer(unary, values, CrfParams(), 100_000, tolerance) for tolerance in (1e-6, 1e-3))
    np.testing.assert_allclose(infer(unary, values, CrfParams(), 100), settled, atol=1e-4)
    assert 1e-6 < np.abs(settled - sooner).max() < 0.1
    with pytest.raises(ArgumentError, match="tolerance"):
        infer(unary, values, CrfParams(), 10, -1.0)

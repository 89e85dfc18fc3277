"""The CRF on tiny grids without approximation, against enumeration; and how far a Q is from it."""

import numpy as np
import pytest
from enumeration import enumerated, random_cells
from scipy.special import logsumexp

from semgrid_edu.crf import CrfParams, exact_marginals, free_energy, log_partition, most_likely
from semgrid_edu.errors import ArgumentError

TINY = pytest.mark.parametrize(("classes", "height", "width"), [(2, 4, 4), (3, 2, 3), (5, 1, 1), (1, 2, 2)])


@TINY
@pytest.mark.parametrize("normalization", ["symmetric", "none"])
def test_everything_exact_is_what_enumeration_says(classes, height, width, normalization):
    unary, values = random_cells((classes, height, width))
    params = CrfParams(sigma_beta=0.5, normalization=normalization)
    labellings, energies = enumerated(unary, values, params)
    assert log_partition(unary, values, params) == pytest.approx(logsumexp(-energies), abs=1e-10)
    np.testing.assert_array_equal(most_likely(unary, values, params), labellings[energies.argmin()])
    p = np.exp(-energies - logsumexp(-energies))
    wanted = np.einsum("n,nkhw->khw", p, (labellings[:, None] == np.arange(classes)[:, None, None]).astype(float))
    np.testing.assert_allclose(exact_marginals(unary, values, params), wanted, atol=1e-10)


def test_an_impossible_class_has_no_part_in_it():
    unary, values = random_cells((3, 2, 2), 3)
    unary[1] = np.inf
    without = np.delete(unary, 1, axis=0)
    np.testing.assert_allclose(
        exact_marginals(unary, values, CrfParams()),
        np.insert(exact_marginals(without, values, CrfParams()), 1, 0, axis=0),
        atol=1e-12,
    )
    assert log_partition(unary, values, CrfParams()) == pytest.approx(log_partition(without, values, CrfParams()))
    assert free_energy(np.full(unary.shape, 1 / 3), unary, values, CrfParams()) == np.inf


def test_free_energy_is_the_mean_energy_minus_the_entropy():
    """By enumeration, of any Q, with probabilities of 0 among them."""
    for seed in range(5):
        unary, values = random_cells((3, 2, 2), seed)
        rng = np.random.default_rng(seed)
        Q = np.moveaxis(rng.dirichlet(np.full(3, 0.3), (2, 2)), -1, 0)
        Q[:, 0, 0] = 0, 1, 0
        labellings, energies = enumerated(unary, values, CrfParams())
        q = np.take_along_axis(Q[:, None], labellings[None], axis=0)[0].prod(axis=(1, 2))
        log_q = np.log(np.where(q > 0, q, 1))
        found = free_energy(Q, unary, values, CrfParams())
        assert found == pytest.approx(q @ (energies + log_q), abs=1e-12), seed


@pytest.mark.parametrize("function", [exact_marginals, most_likely, log_partition])
def test_a_grid_with_too_many_labellings_is_refused_by_name(function):
    values = np.full((4, 5, 5), 0.25)
    with pytest.raises(ArgumentError, match=r"at most 10,000,000 labellings; mean_field takes more.*2\^25"):
        function(np.zeros((2, 5, 5)), values, CrfParams())


@pytest.mark.parametrize("Q", [np.full((2, 1, 2), 0.4), np.full((2, 2, 1), 0.5), [[[2.0, 0.5]], [[-1.0, 0.5]]], np.nan])
def test_free_energy_refuses_what_is_no_distribution(Q):
    with pytest.raises(ArgumentError, match=r"^Q: expected distributions"):
        free_energy(Q, np.zeros((2, 1, 2)), np.full((4, 1, 2), 0.25), CrfParams())

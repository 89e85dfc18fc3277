"""pyagrum as an independent oracle: posteriors, most likely evidence and d-separation on random networks."""

import numpy as np
import pytest
from pyagrum_oracle import as_directed, assert_oracle_agrees, network, posteriors
from random_models import random_directed, random_tree, random_undirected, some_evidence

from semgrid_edu.graphical import d_separated, eliminate, sum_product


@pytest.mark.parametrize("zeros", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(15))
def test_posteriors_of_random_networks(seed, zeros):
    model = random_directed(seed, variables=10, zeros=zeros)
    assert_oracle_agrees(model, some_evidence(model, seed, count=3)[0])


@pytest.mark.parametrize("make", [random_undirected, random_tree])
@pytest.mark.parametrize("seed", range(10))
def test_marginals_of_random_fields(make, seed):
    model = make(seed, variables=8)
    wanted, _ = posteriors(*as_directed(model))
    beliefs = sum_product(model)
    for name in model.names:
        np.testing.assert_allclose(eliminate(model, name).normalised().table, wanted[name], atol=1e-9)
        if beliefs.exact:
            np.testing.assert_allclose(beliefs.marginals[name], wanted[name], atol=1e-9)


@pytest.mark.parametrize("seed", range(15))
def test_d_separation_of_random_networks(seed):
    model = random_directed(seed, variables=10)
    net, rng = network(model), np.random.default_rng(seed)
    for count in (0, 1, 2, 3, 4) * 4:
        a, b, *known = rng.permutation(model.names)[: 2 + count].tolist()
        assert d_separated(model, a, b, known) == net.isIndependent(a, b, known)

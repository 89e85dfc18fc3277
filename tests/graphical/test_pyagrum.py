"""pyagrum as an independent oracle: posteriors, most likely evidence and d-separation on random networks."""

import numpy as np
import pyagrum
import pytest
from random_models import random_directed, random_tree, random_undirected, some_evidence

from semgrid_edu.graphical import Factor, GraphicalModel, d_separated, eliminate, sum_product


def network(model):
    """The same Bayesian network in pyagrum."""
    net = pyagrum.BayesNet()
    for name, states in model.cardinalities.items():
        net.add(pyagrum.RangeVariable(name, name, 0, states - 1))
    for child, parents in model.parents.items():
        for parent in parents:
            net.addArc(parent, child)
        factor = next(f for f in model.factors if sorted(f.names) == sorted((child, *parents)))
        order = net.cpt(child).names
        net.cpt(child)[:] = factor.ordered(*reversed(order)).table
    return net


def posteriors(model, evidence):
    engine = pyagrum.LazyPropagation(network(model))
    engine.setEvidence(evidence)
    engine.makeInference()
    hidden = [name for name in model.names if name not in evidence]
    return {name: engine.posterior(name).toarray() for name in hidden}, engine.evidenceProbability()


def as_directed(model):
    """An undirected model as a Bayesian network: each factor has a child, observed as "yes"."""
    coins = [Factor(name, np.full(states, 1 / states)) for name, states in model.cardinalities.items()]
    answers, parents = [], {}
    for k, factor in enumerate(model.factors):
        yes = factor.table / factor.table.max()
        answers.append(Factor((*factor.names, f"yes{k}"), np.stack([1 - yes, yes], axis=-1)))
        parents[f"yes{k}"] = factor.names
    return GraphicalModel(coins + answers, parents), dict.fromkeys(parents, 1)


@pytest.mark.parametrize("zeros", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(15))
def test_posteriors_of_random_networks(seed, zeros):
    model = random_directed(seed, variables=10, zeros=zeros)
    evidence, hidden = some_evidence(model, seed, count=3)
    wanted, probability = posteriors(model, evidence)
    assert eliminate(model, (), evidence).table == pytest.approx(probability, abs=1e-9)
    for name in hidden:
        np.testing.assert_allclose(eliminate(model, name, evidence).normalised().table, wanted[name], atol=1e-9)


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

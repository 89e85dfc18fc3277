"""pyagrum as an independent oracle: the same Bayesian network, solved by its junction tree."""

import numpy as np
import pyagrum

from semgrid_edu.graphical import Factor, GraphicalModel, eliminate


def network(model):
    """The same Bayesian network in pyagrum."""
    net = pyagrum.BayesNet()
    for name, states in model.cardinalities.items():
        net.add(pyagrum.RangeVariable(name, name, 0, states - 1))
    for child, parents in model.parents.items():
        for parent in parents:
            net.addArc(parent, child)
        factor = next(f for f in model.factors if sorted(f.names) == sorted((child, *parents)))
        net.cpt(child)[:] = factor.ordered(*reversed(net.cpt(child).names)).table
    return net


def posteriors(model, evidence):
    """P(name | evidence) of every variable that isn't given, and P(evidence)."""
    engine = pyagrum.LazyPropagation(network(model))
    engine.setEvidence(evidence)
    engine.makeInference()
    hidden = [name for name in model.names if name not in evidence]
    return {name: engine.posterior(name).toarray() for name in hidden}, engine.evidenceProbability()


def assert_oracle_agrees(model, evidence):
    """All posteriors by elimination, and the probability of the evidence, to 1e-9."""
    wanted, probability = posteriors(model, evidence)
    np.testing.assert_allclose(eliminate(model, (), evidence).table, probability, rtol=1e-9)
    for name, posterior in wanted.items():
        np.testing.assert_allclose(eliminate(model, name, evidence).normalised().table, posterior, atol=1e-9)


def as_directed(model):
    """An undirected model as a Bayesian network: each factor has a child, observed as "yes"."""
    coins = [Factor(name, np.full(states, 1 / states)) for name, states in model.cardinalities.items()]
    answers, parents = [], {}
    for k, factor in enumerate(model.factors):
        yes = factor.table / factor.table.max()
        answers.append(Factor((*factor.names, f"yes{k}"), np.stack([1 - yes, yes], axis=-1)))
        parents[f"yes{k}"] = factor.names
    return GraphicalModel(coins + answers, parents), dict.fromkeys(parents, 1)

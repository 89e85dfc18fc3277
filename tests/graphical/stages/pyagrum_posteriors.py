"""The same Bayesian network in pyagrum: an independent implementation of inference."""

import numpy as np
import pyagrum

from semgrid_edu.graphical import Factor, GraphicalModel


def posteriors(model, evidence):
    """P(name | evidence) of every variable that isn't given, and P(evidence)."""
    net = pyagrum.BayesNet()
    for name, states in model.cardinalities.items():
        net.add(pyagrum.RangeVariable(name, name, 0, states - 1))
    for child, parents in model.parents.items():
        for parent in parents:
            net.addArc(parent, child)
        factor = next(f for f in model.factors if sorted(f.names) == sorted((child, *parents)))
        net.cpt(child)[:] = factor.ordered(*reversed(net.cpt(child).names)).table
    engine = pyagrum.LazyPropagation(net)
    engine.setEvidence(evidence)
    engine.makeInference()
    hidden = [name for name in model.names if name not in evidence]
    return {name: engine.posterior(name).toarray() for name in hidden}, engine.evidenceProbability()


def as_directed(model):
    """An undirected model as a Bayesian network: each factor has a child, observed as "yes"."""
    coins = [Factor(name, np.full(states, 1 / states)) for name, states in model.cardinalities.items()]
    answers = [
        Factor((*f.names, f"yes{k}"), np.stack([1 - f.table / f.table.max(), f.table / f.table.max()], axis=-1))
        for k, f in enumerate(model.factors)
    ]
    parents = {f"yes{k}": f.names for k, f in enumerate(model.factors)}
    return GraphicalModel(coins + answers, parents), dict.fromkeys(parents, 1)

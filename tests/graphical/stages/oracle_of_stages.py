"""pyagrum as an independent oracle for the models of stages."""

import numpy as np
import pyagrum

from semgrid_edu.graphical import eliminate


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


def assert_oracle_agrees(model, given):
    """All posteriors and the probability of what is given, to 1e-9."""
    engine = pyagrum.LazyPropagation(network(model))
    engine.setEvidence(given)
    engine.makeInference()
    np.testing.assert_allclose(eliminate(model, (), given).table, engine.evidenceProbability(), rtol=1e-9)
    for name in set(model.names) - set(given):
        ours = eliminate(model, name, given).normalised().table
        np.testing.assert_allclose(ours, engine.posterior(name).toarray(), atol=1e-9)

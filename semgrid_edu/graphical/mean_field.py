"""Mean field on any discrete model: fits a product of independent distributions, one variable at a time.

It minimises the free energy F(Q) = E_Q[log Q] - E_Q[log product of factors] >= -log Z over Q(x) = prod_i q_i(x_i)
(Koller and Friedman, section 11.5).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax, xlogy

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.exact import NOTHING
from semgrid_edu.graphical.factor import Factor, rescaled_product
from semgrid_edu.graphical.messages import TOLERANCE, Beliefs
from semgrid_edu.graphical.model import GraphicalModel, possible

Independent = dict[str, NDArray[np.float64]]
"""One distribution per variable, {name: (K,)}."""


def mean_field_graph(
    model: GraphicalModel, given: Mapping[str, int] = NOTHING, iterations: int = 50, seed: int | None = None
) -> Beliefs:
    """Optimise the distribution of one variable at a time, with all others fixed.

    The optimal q_i is proportional to exp(E[log factors]), so no update increases the free energy. The free energy has
    several minima, and the initialisation decides which one is found. By default each variable starts from its unary
    factors (uniform if it has none), like the paper's CRF. If these don't prefer a state, a symmetric model may stay at
    its symmetric start, although breaking the symmetry would lower the free energy. A seed gives a random start
    instead.

    A zero in a factor forbids a combination of states. log 0 is treated as the limit of growing penalties: an update
    first minimises the expected number of forbidden combinations, then compares only the states that reach this
    minimum. As long as Q gives a forbidden combination any probability, its free energy is infinite.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    given : dict of str to int
        The states of observed variables.
    iterations : int
        Maximum number of sweeps over all variables, at least 1.
    seed : int, optional
        Seed for random initial distributions.

    Returns
    -------
    Beliefs
        `.free_energy` is F in nats after each sweep; -F is a lower bound on log Z, or on log P(given) in a directed
        model.

    Raises
    ------
    ArgumentError
        When a variable or state is unknown, `iterations` is less than 1, or the given states are obviously
        impossible: they make a factor zero everywhere, or the unary factors of a variable forbid all its states.

    Examples
    --------
    >>> pair = GraphicalModel([Factor("x", [0.4, 0.6]), Factor(("x", "y"), [[0.9, 0.1], [0.1, 0.9]])])
    >>> beliefs = mean_field_graph(pair)
    >>> beliefs.marginals["x"].round(2), beliefs.free_energy[-1].round(2)
    (array([0.13, 0.87]), np.float64(0.39))
    """
    if iterations < 1:
        raise ArgumentError("iterations", "at least 1", iterations)
    model = possible(model, given)
    q = _start(model, seed)
    free_energy: list[float] = []
    converged = False
    while not converged and len(free_energy) < iterations:
        before = dict(q)
        for name in model.names:
            q[name] = _best(model, q, name)
        free_energy.append(_free_energy(model, q))
        converged = all(abs(q[name] - before[name]).max() <= TOLERANCE for name in q)
    independent = all(len(factor.names) <= 1 for factor in model.factors)
    return Beliefs(q, converged, len(free_energy), converged and independent, free_energy=np.array(free_energy))


def _start(model: GraphicalModel, seed: int | None) -> Independent:
    """Initialise from the unary factors, or at random."""
    if seed is not None:
        rng = np.random.default_rng(seed)
        return {name: rng.dirichlet(np.ones(states)) for name, states in model.cardinalities.items()}
    alone = {
        name: [Factor(name, np.full(states, 1 / states)), *(f for f in model.factors if f.names == (name,))]
        for name, states in model.cardinalities.items()
    }
    return {name: rescaled_product(factors)[0].normalised().table for name, factors in alone.items()}


def _best(model: GraphicalModel, q: Independent, name: str) -> NDArray[np.float64]:
    """Return the distribution of one variable that minimises the free energy with all others fixed."""
    states = model.cardinalities[name]
    forbidden = np.zeros(states)
    log = np.zeros(states)
    for factor in model.factors:
        if name in factor.names:
            forbidden += _expected(factor.table == 0, factor, q, keep=name)
            log += _expected(_finite_log(factor.table), factor, q, keep=name)
    # No tolerance if some state is fully allowed: it would admit forbidden states, and F would be infinite.
    fewest = forbidden.min()
    allowed = forbidden <= fewest + (TOLERANCE if fewest > 0 else 0)
    return softmax(np.where(allowed, log, -np.inf))


def _free_energy(model: GraphicalModel, q: Independent) -> float:
    """Return F = E[log Q] - E[log product of factors]; infinite if Q allows a forbidden combination."""
    if any(_expected(factor.table == 0, factor, q) > 0 for factor in model.factors):
        return np.inf
    energy = -sum(_expected(_finite_log(factor.table), factor, q) for factor in model.factors)
    return float(energy + sum(xlogy(p, p).sum() for p in q.values()))


def _finite_log(table: NDArray) -> NDArray[np.float64]:
    """Return log(table), and 0 where the table is 0, because forbidden combinations are counted separately."""
    return np.log(np.where(table > 0, table, 1.0))


def _expected(values: NDArray, factor: Factor, q: Independent, keep: str | None = None) -> NDArray[np.float64]:
    """Return the expectation of a table under its variables' distributions, for each state of the variable `keep`."""
    values = np.asarray(values, dtype=np.float64)
    for axis, name in reversed(list(enumerate(factor.names))):
        if name != keep:
            values = np.moveaxis(values, axis, -1) @ q[name]
    return values

"""Exact inference: the sum over all assignments, and variable elimination (Koller and Friedman, chapters 9 and 13)."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from itertools import product as every_combination
from math import log, log10, prod
from types import MappingProxyType

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor, as_names, check_name, rescaled_product
from semgrid_edu.graphical.model import GraphicalModel, possible

MAX_ASSIGNMENTS = 10**6
"""A Python loop over this many takes about half a minute."""

NOTHING: Mapping[str, int] = MappingProxyType({})
"""No evidence."""


def enumerate_marginals(
    model: GraphicalModel, names: str | Sequence[str], given: Mapping[str, int] = NOTHING
) -> Factor:
    """Sum the product of all factors over every assignment of the other variables: the definition of a marginal.

    Like `eliminate`, it doesn't normalise, so the sum of all entries is P(given) in a directed model and the partition
    function Z in an undirected one; `.normalised()` gives P(names | given).

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    names : str or sequence of str
        The variables to keep, in the order of the result's axes; () gives only the total.
    given : dict of str to int
        The states of observed variables.

    Returns
    -------
    Factor
        Over `names`, not normalised.

    Raises
    ------
    ArgumentError
        When there are more than `MAX_ASSIGNMENTS` assignments, or a variable or state is unknown.

    Examples
    --------
    >>> rain, wet = Factor("rain", [0.8, 0.2]), Factor(("rain", "wet"), [[0.9, 0.1], [0.2, 0.8]])
    >>> found = enumerate_marginals(GraphicalModel([rain, wet], {"wet": ("rain",)}), "rain", given={"wet": 1})
    >>> found.table.round(2), found.table.sum().round(2), found.normalised().table.round(2)
    (array([0.08, 0.16]), np.float64(0.24), array([0.33, 0.67]))
    """
    model = model.given(**given)
    names = _wanted(model, names, given)
    count = prod(model.cardinalities.values())
    if count > MAX_ASSIGNMENTS:
        raise ArgumentError("model", f"at most {MAX_ASSIGNMENTS:,} assignments (`eliminate` takes more)", f"{count:,}")
    table = np.zeros([model.cardinalities[name] for name in names])
    for states in every_combination(*map(range, model.cardinalities.values())):
        assignment = dict(zip(model.names, states, strict=True))
        table[tuple(assignment[name] for name in names)] += model.weight(assignment)
    return Factor(names, table)


def eliminate(model: GraphicalModel, names: str | Sequence[str], given: Mapping[str, int] = NOTHING) -> Factor:
    """Sum out one variable at a time, in `min_fill_order`, each from the product of only the factors that contain it.

    The result isn't normalised, because its total is useful: P(given) in a directed model, the partition function Z in
    an undirected one. `.normalised()` gives P(names | given). Without evidence, the total of a directed model is 1, so
    its marginals are already normalised.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    names : str or sequence of str
        The variables to keep, in the order of the result's axes; () gives only the total.
    given : dict of str to int
        The states of observed variables.

    Returns
    -------
    Factor
        Over `names`, not normalised.

    Raises
    ------
    ArgumentError
        When a product would have more than 10^7 entries (the message names its variables), a variable or state is
        unknown, or the total is outside the range of floats, such as P(given) of a long chain; see `log_total`.

    Examples
    --------
    >>> rain, wet = Factor("rain", [0.8, 0.2]), Factor(("rain", "wet"), [[0.9, 0.1], [0.2, 0.8]])
    >>> found = eliminate(GraphicalModel([rain, wet], {"wet": ("rain",)}), "rain", given={"wet": 1})
    >>> found.table.round(2), found.table.sum().round(2), found.normalised().table.round(2)
    (array([0.08, 0.16]), np.float64(0.24), array([0.33, 0.67]))
    """
    found, power = _summed_out(model, names, given)
    with np.errstate(over="ignore", under="ignore"):
        table = np.ldexp(found.table, power)
    if found.table.any() and not np.finfo(float).tiny <= table.max() < np.inf:
        wanted = "a total from 1e-308 to 1e308; log_total gives its logarithm, sum_product the marginals of a tree"
        raise ArgumentError("model and given", wanted, f"about 10^{power * log10(2):.0f}")
    return Factor(found.names, table)


def log_total(model: GraphicalModel, given: Mapping[str, int] = NOTHING) -> float:
    """Return the logarithm of `eliminate(model, ())`: log P(given), or log Z of an undirected model.

    P(given) of a chain with thousands of measurements underflows, but its logarithm doesn't. log P(x | given) is the
    difference of two such logarithms: with and without x among the given variables.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    given : dict of str to int
        The states of observed variables.

    Returns
    -------
    float
        In nats; -inf when the given states are impossible.

    Raises
    ------
    ArgumentError
        When a product would have more than 10^7 entries, or a variable or state is unknown.

    Examples
    --------
    >>> coins = GraphicalModel([Factor(f"x{k}", [0.5, 0.5]) for k in range(2000)])
    >>> round(log_total(coins, {name: 0 for name in coins.names}) / np.log(2))
    -2000
    """
    found, power = _summed_out(model, (), given)
    return log(found.table) + power * log(2) if found.table > 0 else -np.inf


def max_product(model: GraphicalModel, given: Mapping[str, int] = NOTHING) -> dict[str, int]:
    """Find a most likely assignment of all unobserved variables: elimination with max instead of sum.

    The forward pass stores the clique of each eliminated variable. The backward pass assigns each variable its best
    state given the states already chosen, so the assignment is consistent even if several are equally likely. On a
    chain this is the Viterbi algorithm. It is exact on every graph, with or without loops, as long as no table exceeds
    10^7 entries.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    given : dict of str to int
        The states of observed variables.

    Returns
    -------
    dict of str to int
        A state for every unobserved variable, in the model's order.

    Raises
    ------
    ArgumentError
        When every assignment has probability 0, a table is too large, or a variable or state is unknown.

    Examples
    --------
    >>> rain, wet = Factor("rain", [0.8, 0.2]), Factor(("rain", "wet"), [[0.9, 0.1], [0.2, 0.8]])
    >>> max_product(GraphicalModel([rain, wet], {"wet": ("rain",)}), given={"wet": 1})
    {'rain': 1}
    """
    model = possible(model, given)
    factors = list(model.factors)
    cliques = []
    for name in min_fill_order(model):
        clique = rescaled_product(factor for factor in factors if name in factor.names)[0].normalised()
        cliques.append((name, clique))
        factors = [factor for factor in factors if name not in factor.names] + [clique.max(name)]
    best: dict[str, int] = {}
    for name, clique in reversed(cliques):
        known = {other: best[other] for other in clique.names if other != name}
        best[name] = int(np.argmax(clique.given(**known).table))
    return {name: best[name] for name in model.names}


def min_fill_order(model: GraphicalModel, keep: Iterable[str] = ()) -> tuple[str, ...]:
    """Return an elimination order by the min-fill heuristic.

    Eliminating a variable couples all its neighbours. The pairs that weren't neighbours before are its fill. The next
    variable is always one with the least fill, because that keeps the tables small. In a tie, the first in the model's
    order wins.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected; two variables are neighbours if a factor contains both.
    keep : iterable of str
        Variables not to eliminate.

    Examples
    --------
    >>> chain = GraphicalModel([Factor(("a", "b"), np.ones((2, 2))), Factor(("b", "c"), np.ones((2, 2)))])
    >>> min_fill_order(chain)
    ('a', 'b', 'c')
    """
    neighbours = model.neighbours
    keep = set(keep)
    order: list[str] = []
    while left := [name for name in model.names if name in neighbours and name not in keep]:
        name = min(left, key=lambda name: len(_fill(neighbours, name)))
        for one, other in _fill(neighbours, name):
            neighbours[one].add(other)
            neighbours[other].add(one)
        for other in neighbours.pop(name):
            neighbours[other].discard(name)
        order.append(name)
    return tuple(order)


def _fill(neighbours: Mapping[str, set[str]], name: str) -> list[tuple[str, str]]:
    """Return the pairs of a variable's neighbours that aren't neighbours of each other."""
    return [(one, other) for one, other in combinations(sorted(neighbours[name]), 2) if other not in neighbours[one]]


def _summed_out(model: GraphicalModel, names: str | Sequence[str], given: Mapping[str, int]) -> tuple[Factor, int]:
    """Return the marginal over `names` divided by 2^n, and n; each product is rescaled by a power of two."""
    model = model.given(**given)
    names = _wanted(model, names, given)
    power = 0
    factors = list(model.factors)
    for name in min_fill_order(model, keep=names):
        # Multiply the factors that contain the variable, and put their product, summed over it, in their place.
        clique, more = rescaled_product(factor for factor in factors if name in factor.names)
        factors = [factor for factor in factors if name not in factor.names] + [clique.sum(name)]
        power += more
    left, more = rescaled_product(factors)
    return left.ordered(*names), power + more


def _wanted(model: GraphicalModel, names: str | Sequence[str], given: Mapping[str, int]) -> tuple[str, ...]:
    """Check the requested variables against a model that is already sliced by the given states."""
    names = as_names(names)
    if known := [name for name in names if name in given]:
        raise ArgumentError("names", "variables that aren't given", f"{known[0]}, which is given as {given[known[0]]}")
    if len(set(names)) < len(names):
        raise ArgumentError("names", "each variable once", names)
    for name in names:
        check_name("names", name, model.names)
    return names

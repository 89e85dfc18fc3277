"""What makes a model directed: no cycle, one factor per child, each a distribution of its child (Bayesian network)."""

from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.variables import as_names, check_name

SUM_TOLERANCE = 1e-9
"""How far the sum over a child may be from 1: rounding, no more."""


def families(parents: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """Return each child followed by its parents: the variables of its factor.

    Parameters
    ----------
    parents : dict of str to tuple of str
        The parents of every variable.

    Returns
    -------
    dict of str to tuple of str
    """
    return {child: (child, *above) for child, above in parents.items()}


def topological_order(parents: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Sort variables so that parents stand before their children.

    Parameters
    ----------
    parents : dict of str to tuple of str
        The parents of every variable.

    Returns
    -------
    tuple of str

    Raises
    ------
    ArgumentError
        When there is a cycle; the message shows it.
    """
    try:
        return tuple(TopologicalSorter(parents).static_order())
    except CycleError as error:
        raise ArgumentError("parents", "no cycle of arrows", " -> ".join(error.args[1])) from error


def check_directed(
    factors: Sequence[Factor], parents: Mapping[str, tuple[str, ...]], names: Sequence[str]
) -> dict[str, tuple[str, ...]]:
    """Check that factors are the conditional distributions that `parents` announces, and complete `parents`.

    Parameters
    ----------
    factors : sequence of Factor
        One per variable.
    parents : dict of str to tuple of str
        The parents of each child; a variable that is left out has none.
    names : sequence of str
        All variables.

    Returns
    -------
    dict of str to tuple of str
        The parents of every variable, () of those without.

    Raises
    ------
    ArgumentError
        Names the factor or variable at fault.
    """
    complete = {name: as_names(parents.get(name, ())) for name in names}
    for name in {*parents, *(above for family in complete.values() for above in family)}:
        check_name("parents", name, names)
    topological_order(complete)
    groups: dict[tuple[str, ...], list[Factor]] = {}
    for factor in factors:
        groups.setdefault(tuple(sorted(factor.names)), []).append(factor)
    for child, family in families(complete).items():
        found = groups.get(tuple(sorted(family)), [])
        if len(found) != 1:
            wanted = f"exactly one factor over ({', '.join(family)}), child and parents, in a directed model"
            raise ArgumentError("factors", wanted, f"{len(found)} among {[factor.names for factor in factors]}")
        _check_conditional(found[0], child, complete[child])
    if len(factors) > len(complete):
        raise ArgumentError("factors", f"one per variable, {len(complete)} in all", len(factors))
    return complete


def _check_conditional(factor: Factor, child: str, parents: tuple[str, ...]) -> None:
    """Check that P(child | parents) sums to 1 over the child, whatever the parents' states."""
    sums = factor.sum(child).ordered(*parents)
    worst = np.unravel_index(np.argmax(abs(sums.table - 1)), sums.table.shape)
    if abs(sums.table[worst] - 1) > SUM_TOLERANCE:
        place = ", ".join(f"{name}={state}" for name, state in zip(parents, worst, strict=True))
        name = f"P({child} | {', '.join(parents)})" if parents else f"P({child})"
        found = f"{sums.table[worst]:.6g}{' at ' * bool(place)}{place}: normalise over {child}"
        raise ArgumentError(f"factor {name}", f"a sum of 1 over {child}", found)

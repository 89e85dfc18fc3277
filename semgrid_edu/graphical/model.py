"""A graphical model: a product of factors; in a directed model each factor is P(child | parents)."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from math import prod

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import Factor, as_names, check_name, check_states, shared_cardinalities

SUM_TOLERANCE = 1e-9
"""Tolerance for rounding errors in the sum over a child, which should be 1."""


@dataclass(frozen=True, eq=False)
class GraphicalModel:
    """A joint distribution over discrete variables, proportional to the product of its factors.

    Parameters
    ----------
    factors : iterable of Factor
        In a directed model exactly one per variable: P(child | parents), with axes in any order.
    parents : dict of str to tuple of str, optional
        The parents of each child; a variable that isn't listed has none. None makes the model undirected.

    Attributes
    ----------
    cardinalities : dict of str to int
        Number of states of each variable, in order of first occurrence.
    labels : tuple of str
        One label per factor: "P(r | m1, m2)" in a directed model, "f(x, y)" in an undirected one; the second factor
        over the same variables is "f(x, y) #2".

    Raises
    ------
    ArgumentError
        When factors disagree about the number of states of a variable. In a directed model also when there is a cycle,
        a factor is missing, or a factor doesn't sum to 1 over its child.

    Examples
    --------
    >>> rain, wet = Factor("rain", [0.8, 0.2]), Factor(("rain", "wet"), [[0.9, 0.1], [0.2, 0.8]])
    >>> model = GraphicalModel([rain, wet], parents={"wet": ("rain",)})
    >>> model.names, model.labels
    (('rain', 'wet'), ('P(rain)', 'P(wet | rain)'))
    """

    factors: tuple[Factor, ...]
    parents: Mapping[str, tuple[str, ...]] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "factors", tuple(self.factors))
        if others := [factor for factor in self.factors if not isinstance(factor, Factor)]:
            raise ArgumentError("factors", "objects of the class Factor", type(others[0]).__name__)
        names = self.names
        if self.parents is not None:
            object.__setattr__(self, "parents", check_directed(self.factors, self.parents, names))

    @cached_property
    def cardinalities(self) -> dict[str, int]:
        """Number of states of each variable, {name: K}, in order of first occurrence."""
        return shared_cardinalities(factor.cardinalities for factor in self.factors)

    @property
    def names(self) -> tuple[str, ...]:
        """The variables, in order of first occurrence."""
        return tuple(self.cardinalities)

    @property
    def directed(self) -> bool:
        """Whether the model has parents and children."""
        return self.parents is not None

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """One unique label per factor: "P(r | m1, m2)" or "f(x, y)"."""
        if self.parents is not None:
            owners = {frozenset(family): child for child, family in families(self.parents).items()}
            children = [owners[frozenset(factor.names)] for factor in self.factors]
            return tuple(_conditional(child, self.parents[child]) for child in children)
        count: Counter[str] = Counter()
        labels = []
        for label in (f"f({', '.join(factor.names)})" for factor in self.factors):
            count[label] += 1
            labels.append(label if count[label] == 1 else f"{label} #{count[label]}")
        return tuple(labels)

    @property
    def neighbours(self) -> dict[str, set[str]]:
        """The variables that share a factor with each variable; in a directed model, the moral graph."""
        adjacent: dict[str, set[str]] = {name: set() for name in self.names}
        for factor in self.factors:
            for name in factor.names:
                adjacent[name] |= set(factor.names) - {name}
        return adjacent

    def given(self, /, **states: int) -> "GraphicalModel":
        """Condition on observed states: slice every factor and return the model of the other variables.

        Parameters
        ----------
        **states : int
            The state of each observed variable, from 0; `model.given(**evidence)` for a dictionary.

        Returns
        -------
        GraphicalModel
            Undirected, not normalised, with the same factors in the same order, sliced. A factor becomes a constant if
            all its variables are observed.
        """
        check_states(states, self.cardinalities)
        return GraphicalModel(
            factor.given(**{name: states[name] for name in factor.names if name in states}) for factor in self.factors
        )

    def weight(self, assignment: Mapping[str, int]) -> float:
        """Return the product of all factors at one assignment of all variables.

        Parameters
        ----------
        assignment : dict of str to int
            The state of every variable.

        Returns
        -------
        float
            The probability of the assignment in a directed model; Z times the probability in an undirected one.
        """
        check_states(assignment, self.cardinalities)
        if missing := set(self.names) - set(assignment):
            raise ArgumentError("assignment", "a state for every variable", f"none for {', '.join(sorted(missing))}")
        states = {name: int(state) for name, state in assignment.items()}
        return prod(float(factor.table[tuple(states[name] for name in factor.names)]) for factor in self.factors)


def possible(model: GraphicalModel, given: Mapping[str, int]) -> GraphicalModel:
    """Condition a model like `GraphicalModel.given`, but raise an error if a factor becomes zero everywhere.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    given : dict of str to int
        The states of observed variables.
    """
    sliced = model.given(**given)
    for label, factor in zip(model.labels, sliced.factors, strict=True):
        if not factor.table.any():
            raise ArgumentError(f"factor {label}", "a positive entry for what is given", "only zeros: it can't happen")
    return sliced


def check_directed(
    factors: Sequence[Factor], parents: Mapping[str, tuple[str, ...]], names: Sequence[str]
) -> dict[str, tuple[str, ...]]:
    """Check that the factors are the conditional distributions that `parents` specifies, and complete `parents`.

    Parameters
    ----------
    factors : sequence of Factor
        One per variable; an error names the invalid factor.
    parents : dict of str to tuple of str
        The parents of each child; a variable that isn't listed has none.
    names : sequence of str
        All variables.
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
    """Check that P(child | parents) sums to 1 over the child for all parent states."""
    sums = factor.sum(child).ordered(*parents)
    worst = np.unravel_index(np.argmax(abs(sums.table - 1)), sums.table.shape)
    if abs(sums.table[worst] - 1) > SUM_TOLERANCE:
        place = ", ".join(f"{name}={state}" for name, state in zip(parents, worst, strict=True))
        found = f"{sums.table[worst]:.6g}{' at ' * bool(place)}{place}: normalise over {child}"
        raise ArgumentError(f"factor {_conditional(child, parents)}", f"a sum of 1 over {child}", found)


def _conditional(child: str, parents: Sequence[str]) -> str:
    return f"P({child} | {', '.join(parents)})" if parents else f"P({child})"


def families(parents: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """Return each child followed by its parents: the variables of its factor.

    Parameters
    ----------
    parents : dict of str to tuple of str
        The parents of every variable.
    """
    return {child: (child, *above) for child, above in parents.items()}


def topological_order(parents: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Sort variables so that parents come before their children; raise an error if there is a cycle.

    Parameters
    ----------
    parents : dict of str to tuple of str
        The parents of every variable.
    """
    try:
        return tuple(TopologicalSorter(parents).static_order())
    except CycleError as error:
        raise ArgumentError("parents", "no cycle of arrows", " -> ".join(error.args[1])) from error

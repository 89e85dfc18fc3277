"""A graphical model: a product of factors; directed when each is the distribution of a child given its parents."""

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
"""How far rounding may take the sum over a child from 1."""


@dataclass(frozen=True, eq=False)
class GraphicalModel:
    """A joint distribution over discrete variables, proportional to the product of its factors.

    Parameters
    ----------
    factors : iterable of Factor
        In a directed model exactly one per variable: P(child | parents), its axes in any order.
    parents : dict of str to tuple of str, optional
        The parents of each child; a variable that is left out has none. None makes the model undirected.

    Attributes
    ----------
    cardinalities : dict of str to int
        Number of states of each variable, in the order in which the variables first occur.
    labels : tuple of str
        One label per factor: "P(r | m1, m2)" in a directed model, "f(x, y)" in an undirected one; the second factor
        over the same variables is "f(x, y) #2".

    Raises
    ------
    ArgumentError
        When factors disagree about a variable's number of states; in a directed model also when there is a cycle,
        when a factor is missing, and when one doesn't sum to 1 over its child.

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
        """Number of states of each variable, {name: K}, in the order in which the variables first occur."""
        return shared_cardinalities(factor.cardinalities for factor in self.factors)

    @property
    def names(self) -> tuple[str, ...]:
        """The variables, in the order in which they first occur."""
        return tuple(self.cardinalities)

    @property
    def directed(self) -> bool:
        """Whether the model has parents and children."""
        return self.parents is not None

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """One label per factor, unique: "P(r | m1, m2)" or "f(x, y)"."""
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
        """The variables that share a factor with each variable: in a directed model, the moral graph."""
        adjacent: dict[str, set[str]] = {name: set() for name in self.names}
        for factor in self.factors:
            for name in factor.names:
                adjacent[name] |= set(factor.names) - {name}
        return adjacent

    def given(self, /, **states: int) -> "GraphicalModel":
        """Return the model of the other variables when these states are known: every factor is sliced.

        Parameters
        ----------
        **states : int
            The state of each known variable, from 0; `model.given(**evidence)` for a dictionary.

        Returns
        -------
        GraphicalModel
            Undirected, not normalised, with one factor for each of this model's, in the same order. A factor
            whose variables are all known becomes a constant.
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
            In a directed model the probability of the assignment; in an undirected one it is Z times that.
        """
        check_states(assignment, self.cardinalities)
        if missing := set(self.names) - set(assignment):
            raise ArgumentError("assignment", "a state for every variable", f"none for {', '.join(sorted(missing))}")
        states = {name: int(state) for name, state in assignment.items()}
        return prod(float(factor.table[tuple(states[name] for name in factor.names)]) for factor in self.factors)


def possible(model: GraphicalModel, given: Mapping[str, int]) -> GraphicalModel:
    """Return the model of the variables that aren't given; an error names a factor that is zero everywhere.

    Parameters
    ----------
    model : GraphicalModel
        Directed or not.
    given : dict of str to int
        The states of known variables.
    """
    sliced = model.given(**given)
    for label, factor in zip(model.labels, sliced.factors, strict=True):
        if not factor.table.any():
            raise ArgumentError(f"factor {label}", "a positive entry for what is given", "only zeros: it can't happen")
    return sliced


def check_directed(
    factors: Sequence[Factor], parents: Mapping[str, tuple[str, ...]], names: Sequence[str]
) -> dict[str, tuple[str, ...]]:
    """Check that factors are the conditional distributions that `parents` announces, and complete `parents`.

    Parameters
    ----------
    factors : sequence of Factor
        One per variable; an error names the one at fault.
    parents : dict of str to tuple of str
        The parents of each child; a variable that is left out has none.
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
    """Check that P(child | parents) sums to 1 over the child, whatever the parents' states."""
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
    """Sort variables so that parents come before their children; an error shows the cycle that prevents it.

    Parameters
    ----------
    parents : dict of str to tuple of str
        The parents of every variable.
    """
    try:
        return tuple(TopologicalSorter(parents).static_order())
    except CycleError as error:
        raise ArgumentError("parents", "no cycle of arrows", " -> ".join(error.args[1])) from error

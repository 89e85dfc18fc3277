"""In which order variables are eliminated: it decides how large the tables grow."""

from collections.abc import Iterable, Mapping
from itertools import combinations

from semgrid_edu.graphical.model import GraphicalModel


def min_fill_order(model: GraphicalModel, keep: Iterable[str] = ()) -> tuple[str, ...]:
    """Order variables for elimination: next is always the one whose elimination links the fewest strangers.

    Eliminating a variable couples all its neighbours. Pairs that weren't neighbours before are the fill; few of them
    keep the tables small. Among equals the first in the model's order is taken.

    Parameters
    ----------
    model : GraphicalModel
        Directed or not; two variables are neighbours when a factor contains both.
    keep : iterable of str
        Variables that aren't eliminated.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> import numpy as np
    >>> from semgrid_edu.graphical.factor import Factor
    >>> chain = GraphicalModel([Factor(("a", "b"), np.ones((2, 2))), Factor(("b", "c"), np.ones((2, 2)))])
    >>> min_fill_order(chain)
    ('a', 'b', 'c')
    """
    neighbours, keep = model.neighbours, set(keep)
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
    """Return the pairs of neighbours of a variable that aren't neighbours of each other."""
    return [(one, other) for one, other in combinations(sorted(neighbours[name]), 2) if other not in neighbours[one]]

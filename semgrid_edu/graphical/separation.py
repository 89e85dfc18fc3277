"""Which variables can influence each other: d-separation in directed models, separation in undirected ones.

The algorithm searches along active paths, the "Bayes ball" (Shachter 1998; Koller and Friedman, algorithm 3.1).
"""

from collections import deque
from collections.abc import Iterable, Mapping

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import as_names, check_name
from semgrid_edu.graphical.model import GraphicalModel

Names = str | Iterable[str]
"""One name or several."""


def d_separated(model: GraphicalModel, a: Names, b: Names, given: Names = ()) -> bool:
    """Return whether the graph guarantees that a and b are independent given `given`, for any numbers in the factors.

    Parameters
    ----------
    model : GraphicalModel
        In an undirected model a and b are separated when every path between them passes through `given`.
    a, b : str or iterable of str
        One variable or several.
    given : str or iterable of str
        Observed variables; a dictionary of evidence works too.

    Raises
    ------
    ArgumentError
        When a variable is unknown, or in more than one of the three groups.

    Examples
    --------
    Two cells and a beam that both may reflect are independent until the beam is observed.

    >>> import numpy as np
    >>> from semgrid_edu.graphical.factor import Factor
    >>> cells = [Factor("m1", [0.8, 0.2]), Factor("m2", [0.8, 0.2])]
    >>> reflection = Factor(("r", "m1", "m2"), np.full((2, 2, 2), 0.5))
    >>> beam = GraphicalModel([*cells, reflection], parents={"r": ("m1", "m2")})
    >>> d_separated(beam, "m1", "m2"), d_separated(beam, "m1", "m2", given="r")
    (True, False)
    """
    return why_dependent(model, a, b, given) is None


def why_dependent(model: GraphicalModel, a: Names, b: Names, given: Names = ()) -> tuple[str, ...] | None:
    """Return a shortest active path from a to b, which is why they may be dependent.

    In a directed model a path is active if each inner variable lets influence pass: a chain or a fork
    (-> x ->, <- x <-, <- x ->) if x is not given, a collider (-> x <-) if x or one of its descendants is given.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    a, b : str or iterable of str
        One variable or several.
    given : str or iterable of str
        Observed variables.

    Returns
    -------
    tuple of str or None
        The variables along the path, including both ends; None if a and b are separated.

    Raises
    ------
    ArgumentError
        When a variable is unknown, or in more than one of the three groups.

    Examples
    --------
    >>> from semgrid_edu.graphical.factor import Factor
    >>> chain = GraphicalModel([Factor(("x", "y"), [[2, 1], [1, 2]]), Factor(("y", "z"), [[2, 1], [1, 2]])])
    >>> why_dependent(chain, "x", "z"), why_dependent(chain, "x", "z", given="y")
    (('x', 'y', 'z'), None)
    """
    start = set(as_names(a))
    goal = set(as_names(b))
    known = set(as_names(given))
    _check_groups(model, start, goal, known)
    steps = _directed_steps(model.parents, known) if model.parents is not None else _undirected_steps(model, known)
    # A search state: a variable, and whether the path reached it from one of its parents.
    came_from = {(name, False): None for name in sorted(start)}
    queue = deque(came_from)
    while queue:
        place = queue.popleft()
        if place[0] in goal:
            return _path(place, came_from)
        for following in steps(*place):
            if following not in came_from:
                came_from[following] = place
                queue.append(following)
    return None


def _directed_steps(parents: Mapping[str, tuple[str, ...]], known: set[str]):
    """Return the Bayes-ball rule: where influence continues from a variable, depending on where it came from."""
    children = {name: [child for child, above in parents.items() if name in above] for name in parents}
    opens = _with_ancestors(parents, known)

    def steps(name: str, from_parent: bool) -> list[tuple[str, bool]]:
        # Coming from a parent and going up to a parent passes a collider, which only evidence below it opens.
        up = name in opens if from_parent else name not in known
        down = name not in known
        return [(above, False) for above in parents[name] if up] + [(child, True) for child in children[name] if down]

    return steps


def _undirected_steps(model: GraphicalModel, known: set[str]):
    """Return the rule for undirected graphs: influence continues to every neighbour, but not from a given variable."""
    neighbours = model.neighbours

    def steps(name: str, from_parent: bool) -> list[tuple[str, bool]]:
        return [] if name in known else [(other, from_parent) for other in sorted(neighbours[name])]

    return steps


def _with_ancestors(parents: Mapping[str, tuple[str, ...]], names: set[str]) -> set[str]:
    """Return the variables and all their ancestors, which are the colliders that they activate."""
    found = set(names)
    queue = list(names)
    while queue:
        new = set(parents[queue.pop()]) - found
        found |= new
        queue += new
    return found


def _path(place, came_from) -> tuple[str, ...]:
    path = []
    while place is not None:
        path.append(place[0])
        place = came_from[place]
    return tuple(reversed(path))


def _check_groups(model: GraphicalModel, a: set[str], b: set[str], given: set[str]) -> None:
    for argument, group in (("a", a), ("b", b), ("given", given)):
        for name in sorted(group):
            check_name(argument, name, model.names)
    if twice := (a & b) | (a & given) | (b & given):
        raise ArgumentError("a, b, given", "each variable in one of the three at most", ", ".join(sorted(twice)))

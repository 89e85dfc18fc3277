"""Sum-product message passing on a factor graph: exact on trees, "loopy" elsewhere (Kschischang 2001, section II)."""

from collections.abc import Mapping

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.beliefs import TOLERANCE, Beliefs
from semgrid_edu.graphical.exact import NOTHING
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel, possible

Messages = dict[tuple[str, str], Factor]
"""From source to target; each a factor over the variable at one of the two ends."""


def sum_product(
    model: GraphicalModel, given: Mapping[str, int] = NOTHING, iterations: int = 50, damping: float = 0.0
) -> Beliefs:
    """Pass messages between variables and factors until they stop changing; a belief is the product of what arrives.

    A variable tells a factor the product of what its other factors say. A factor tells a variable its own table
    times what its other variables say, summed over them. Every iteration visits all nodes twice, from the leaves
    inwards and back out. On a tree the first iteration therefore delivers every message, and the second finds nothing
    left to change. With loops the same messages meet their own echo, and the result is an approximation.

    Every message sums to 1, so long chains neither underflow nor overflow.

    Parameters
    ----------
    model : GraphicalModel
        Directed or not.
    given : dict of str to int
        The states of known variables; their factors are sliced first, which may open loops.
    iterations : int
        At most so many, at least 1.
    damping : float
        Share of the old message that is kept, 0 <= damping < 1. It helps loopy graphs to converge.

    Returns
    -------
    Beliefs
        `.messages[source, target]` between a variable's name and a factor's label of `model.labels`: on a chain,
        `.messages["x1", "P(x2 | x1)"]` is the filtered belief P(x1 | evidence up to 1). `.exact` says whether the
        factor graph without the given variables is a tree (or several) and the messages converged.

    Raises
    ------
    ArgumentError
        When no assignment agrees with what is given, or an argument is out of range.

    Examples
    --------
    >>> rain, wet = Factor("rain", [0.8, 0.2]), Factor(("rain", "wet"), [[0.9, 0.1], [0.2, 0.8]])
    >>> beliefs = sum_product(GraphicalModel([rain, wet], {"wet": ("rain",)}), given={"wet": 1})
    >>> beliefs.marginals["rain"].round(2), beliefs.exact, beliefs.messages["P(wet | rain)", "rain"].round(2)
    (array([0.33, 0.67]), True, array([0.11, 0.89]))
    """
    if iterations < 1:
        raise ArgumentError("iterations", "at least 1", iterations)
    if not 0 <= damping < 1:
        raise ArgumentError("damping", "0 <= damping < 1", damping)
    sliced = possible(model, given)
    factors = {label: factor for label, factor in zip(model.labels, sliced.factors, strict=True) if factor.names}
    links = _links(factors, sliced.names)
    outwards = _breadth_first(links)
    messages = _first_messages(factors, sliced.cardinalities)
    converged, iteration = False, 0
    while not converged and iteration < iterations:
        iteration += 1
        before = dict(messages)
        for source in (*reversed(outwards), *outwards):
            for target in links[source]:
                message = _message(source, target, links, factors, messages)
                messages[source, target] = _damped(message, messages[source, target], damping)
        converged = all(abs(messages[link].table - before[link].table).max() <= TOLERANCE for link in messages)
    marginals = {name: _arriving(name, links[name], messages, sliced.cardinalities[name]) for name in sliced.names}
    return Beliefs(
        marginals={name: belief.table for name, belief in marginals.items()},
        converged=converged,
        iterations=iteration,
        exact=converged and _is_forest(links),
        messages={link: message.table for link, message in messages.items()},
    )


def _links(factors: Mapping[str, Factor], names: tuple[str, ...]) -> dict[str, list[str]]:
    """Return the factor graph: the factors around each variable, and the variables around each factor."""
    around = {name: [label for label, factor in factors.items() if name in factor.names] for name in names}
    return around | {label: list(factor.names) for label, factor in factors.items()}


def _breadth_first(links: Mapping[str, list[str]]) -> list[str]:
    """Return all nodes of the factor graph, each after the neighbour through which it was reached."""
    order: dict[str, None] = {}
    for root in links:
        queue = [root] if root not in order else []
        order.update(dict.fromkeys(queue))
        while queue:
            new = [node for node in links[queue.pop(0)] if node not in order]
            order.update(dict.fromkeys(new))
            queue += new
    return list(order)


def _is_forest(links: Mapping[str, list[str]]) -> bool:
    """Whether leaves can be taken away, one after the other, until no link is left."""
    left = {node: set(around) for node, around in links.items()}
    while leaves := [node for node, around in left.items() if len(around) <= 1]:
        for leaf in leaves:
            for other in left.pop(leaf):
                left[other].discard(leaf)
    return not left


def _first_messages(factors: Mapping[str, Factor], states: Mapping[str, int]) -> Messages:
    """Before the first iteration every message says nothing: all states alike."""
    nothing = {name: Factor((name,), np.full(count, 1 / count)) for name, count in states.items()}
    pairs = [(label, name) for label, factor in factors.items() for name in factor.names]
    return {link: nothing[name] for label, name in pairs for link in ((label, name), (name, label))}


def _message(
    source: str,
    target: str,
    links: Mapping[str, list[str]],
    factors: Mapping[str, Factor],
    messages: Messages,
) -> Factor:
    """Return what a node tells a neighbour, from what all its other neighbours told it."""
    others = [node for node in links[source] if node != target]
    if source not in factors:
        return _arriving(source, others, messages, messages[source, target].table.size)
    told = factors[source].normalised()
    for name in others:
        told = (told * messages[name, source]).normalised()
    return told.sum(*others)


def _arriving(name: str, labels: list[str], messages: Messages, states: int) -> Factor:
    """Return the normalised product of what factors tell a variable; each partial product is normalised too."""
    told = Factor((name,), np.full(states, 1 / states))
    for label in labels:
        told = (told * messages[label, name]).normalised()
    return told


def _damped(new: Factor, old: Factor, damping: float) -> Factor:
    return Factor(new.names, (1 - damping) * new.table + damping * old.table)

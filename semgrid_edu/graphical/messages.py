"""Sum-product messages on a factor graph: exact on trees, "loopy" elsewhere (Kschischang 2001)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.exact import NOTHING
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.model import GraphicalModel, possible

TOLERANCE = 1e-10
"""An iteration has converged when no probability changes by more than this."""


@dataclass(frozen=True, eq=False)
class Beliefs:
    """Marginals of all unobserved variables.

    Parameters
    ----------
    marginals : dict of str to (K,) float64
        The probability of each state; sums to 1.
    converged : bool
        Whether the last iteration changed nothing by more than `TOLERANCE`.
    iterations : int
        Number of iterations.
    exact : bool
        Whether the marginals are known to be exact: they have converged, and the factor graph has no loops
        (sum-product) or no couplings (mean field).
    messages : dict of (str, str) to (K,) float64
        Normalised messages of sum-product by (source, target); empty for mean field.
    free_energy : (iterations,) float64
        Free energy of mean field after each sweep, in nats; empty for sum-product.
    """

    marginals: Mapping[str, NDArray[np.float64]]
    converged: bool
    iterations: int
    exact: bool
    messages: Mapping[tuple[str, str], NDArray[np.float64]] = field(default_factory=dict)
    free_energy: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


Messages = dict[tuple[str, str], NDArray[np.float64]]
"""Messages by (source, target); each is a distribution (K,) over the variable at one end of the link."""


def sum_product(model: GraphicalModel, given: Mapping[str, int] = NOTHING, iterations: int = 50) -> Beliefs:
    """Pass messages between variables and factors until they converge; a belief is the product of incoming messages.

    A variable's message to a factor is the product of the messages from its other factors. A factor's message to a
    variable is its table times the messages from its other variables, summed over these variables. Every iteration
    visits all nodes twice, from the leaves inwards and back out. So on a tree the first iteration computes every
    message, and the second changes nothing. On a graph with loops, a message returns to its source as if it were new
    evidence, and the result is an approximation.

    Every message sums to 1, so long chains neither underflow nor overflow.

    Parameters
    ----------
    model : GraphicalModel
        Directed or undirected.
    given : dict of str to int
        The states of observed variables. Their factors are sliced first, which may break loops.
    iterations : int
        Maximum number of iterations, at least 1.

    Returns
    -------
    Beliefs
        `.messages[source, target]`, between a variable name and a factor label from `model.labels`: on a chain,
        `.messages["x1", "P(x2 | x1)"]` is the filtered belief P(x1 | evidence up to 1). `.exact` is whether the
        factor graph of the unobserved variables is a tree (or a forest) and the messages converged.

    Raises
    ------
    ArgumentError
        When no assignment agrees with the given states, or an argument is out of range.

    Examples
    --------
    >>> rain, wet = Factor("rain", [0.8, 0.2]), Factor(("rain", "wet"), [[0.9, 0.1], [0.2, 0.8]])
    >>> beliefs = sum_product(GraphicalModel([rain, wet], {"wet": ("rain",)}), given={"wet": 1})
    >>> beliefs.marginals["rain"].round(2), beliefs.exact, beliefs.messages["P(wet | rain)", "rain"].round(2)
    (array([0.33, 0.67]), True, array([0.11, 0.89]))
    """
    if iterations < 1:
        raise ArgumentError("iterations", "at least 1", iterations)
    sliced = possible(model, given)
    labelled = zip(model.labels, sliced.factors, strict=True)
    factors = {label: factor.rescaled()[0] for label, factor in labelled if factor.names}
    # Messages go first from the leaves of each part to its root, then back: on a tree two passes are exact.
    links = _links(factors, sliced.names)
    parts = _parts(links)
    outwards = [node for part in parts for node in part]
    messages = _uniform(factors, sliced.cardinalities)
    converged = False
    iteration = 0
    while not converged and iteration < iterations:
        iteration += 1
        before = dict(messages)
        # A new message is used at once, so information crosses a whole chain in one iteration.
        for source in (*reversed(outwards), *outwards):
            for target in links[source]:
                messages[source, target] = _message(source, target, links, factors, messages)
        converged = all(abs(messages[link] - before[link]).max() <= TOLERANCE for link in messages)
    incoming = {name: [messages[label, name] for label in links[name]] for name in sliced.names}
    return Beliefs(
        marginals={name: _product(arrived, sliced.cardinalities[name]) for name, arrived in incoming.items()},
        converged=converged,
        iterations=iteration,
        exact=converged and _is_forest(links, parts),
        messages=messages,
    )


def _links(factors: Mapping[str, Factor], names: tuple[str, ...]) -> dict[str, list[str]]:
    """Return the factor graph: the factors around each variable, and the variables around each factor."""
    links: dict[str, list[str]] = {name: [] for name in names}
    for label, factor in factors.items():
        if label in names:
            raise ArgumentError("model", "no variable that is called like a factor", label)
        links[label] = list(factor.names)
        for name in factor.names:
            links[name].append(label)
    return links


def _parts(links: Mapping[str, list[str]]) -> list[list[str]]:
    """Return the connected components of the factor graph; each node comes after the node it was reached from."""
    parts: list[list[str]] = []
    reached: set[str] = set()
    for root in links:
        part = [root] if root not in reached else []
        reached.add(root)
        for node in part:  # grows during the loop
            new = [other for other in links[node] if other not in reached]
            reached.update(new)
            part += new
        parts += [part] if part else []
    return parts


def _is_forest(links: Mapping[str, list[str]], parts: list[list[str]]) -> bool:
    """Return whether no component has a loop: a tree has one link fewer than nodes."""
    return sum(map(len, links.values())) // 2 == len(links) - len(parts)


def _uniform(factors: Mapping[str, Factor], cardinalities: Mapping[str, int]) -> Messages:
    """Return uniform initial messages."""
    uniform = {name: np.full(count, 1 / count) for name, count in cardinalities.items()}
    pairs = [(label, name) for label, factor in factors.items() for name in factor.names]
    return {link: uniform[name] for label, name in pairs for link in ((label, name), (name, label))}


def _message(
    source: str,
    target: str,
    links: Mapping[str, list[str]],
    factors: Mapping[str, Factor],
    messages: Messages,
) -> NDArray[np.float64]:
    """Return the message of a node to a neighbour, computed from the messages of all other neighbours."""
    others = {node: messages[node, source] for node in links[source] if node != target}
    if source in factors:
        return _from_factor(factors[source], others)
    return _product(others.values(), states=messages[source, target].size)


def _from_factor(factor: Factor, incoming: Mapping[str, NDArray]) -> NDArray[np.float64]:
    """Return the table times the messages of all variables except one, summed over these variables."""
    table = factor.table
    for axis, name in reversed(list(enumerate(factor.names))):
        if name in incoming:
            # Only the target's axis can remain behind this one. Swap the two, so that the axis to sum over is last.
            table = _normalised(table.swapaxes(axis, -1) @ incoming[name])
    return _normalised(table)


def _product(messages: Iterable[NDArray], states: int) -> NDArray[np.float64]:
    """Return the normalised product of messages about one variable, normalising after each factor."""
    belief = np.full(states, 1 / states)
    for message in messages:
        belief = _normalised(belief * message)
    return belief


def _normalised(table: NDArray) -> NDArray[np.float64]:
    total = table.sum()
    if total == 0:
        wanted = "messages that agree on at least one state"
        raise ArgumentError("given", wanted, "none: no assignment agrees with all factors and with what is given")
    return table / total

"""Hand the arranged nodes, edges and plates to daft (https://docs.daft-pgm.org), which draws them."""

from collections.abc import Collection

import daft
from matplotlib.axes import Axes

from semgrid_edu.graphical.layout import NODE, Arrangement, half_width
from semgrid_edu.graphical.model import GraphicalModel

SQUARE = 0.14
"""Side of a factor."""

HIGHLIGHT = {"ec": "#d95f02", "lw": 3.0}
"""Outline of a highlighted node, three times as thick as the others: colour isn't the only mark."""


GHOST = {"ec": "0.55", "ls": (0, (2, 2)), "fc": "0.97"}
"""Look of a node that the model doesn't have."""


def render(
    model: GraphicalModel,
    where: Arrangement,
    ax: Axes,
    size: float,
    observed: Collection[str],
    highlight: Collection[str],
    without: Collection[frozenset[str]] = (),
) -> None:
    """Draw plates, then edges, then nodes.

    Parameters
    ----------
    model, ax, observed, highlight
        Those of `draw`.
    where : Arrangement
        Where everything stands.
    size : float
        Size of the texts, points.
    without : collection of frozenset of str
        Pairs of variables whose arrow is left out.
    """
    look = dict.fromkeys(where.said.keys() - set(model.names), GHOST) | dict.fromkeys(highlight, HIGHLIGHT)
    nodes = {
        name: daft.Node(
            name,
            text,
            *where.places[name],
            aspect=2 * half_width(text) / NODE,
            observed=name in observed,
            fontsize=size,
            plot_params=look.get(name, {}),
        )
        for name, text in where.said.items()
    }
    plates = [
        daft.Plate([*low, *(high - low)], label=text, fontsize=size, rect_params={"fc": "none"})
        for text, (low, high) in where.boxes.items()
    ]
    edges = _arrows(model, nodes, without) if model.directed else _factors(model, where, nodes)
    context = daft.PGM(grid_unit=1.0, node_unit=NODE)._ctx  # `PGM.render` would open a figure of its own
    context._ax = ax
    for thing in (*plates, *edges, *nodes.values()):
        thing.render(context)


def _arrows(model: GraphicalModel, nodes: dict[str, daft.Node], without: Collection) -> list[daft.Edge]:
    arrow = {"head_length": 0.14, "head_width": 0.1}
    pairs = [(above, child) for child, parents in model.parents.items() for above in parents]
    kept = [pair for pair in pairs if frozenset(pair) not in without]
    return [daft.Edge(nodes[above], nodes[child], plot_params=arrow) for above, child in kept]


def _factors(model: GraphicalModel, where: Arrangement, nodes: dict[str, daft.Node]) -> list:
    """Return the squares of an undirected model, and the lines to them."""
    things = []
    for label, factor in zip(model.labels, model.factors, strict=True):
        if factor.names:
            shape = {"scale": SQUARE / NODE}
            square = daft.Node(label, "", *where.places[label], **shape, plot_params={"fc": "k"}, shape="rectangle")
            # daft can't end an upright line at a rectangle, so lines end at a circle under the square.
            circle = daft.Node(label, "", *where.places[label], **shape)
            things += [daft.Edge(nodes[name], circle, directed=False) for name in factor.names] + [square]
    return things

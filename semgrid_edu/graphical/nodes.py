"""Nodes, edges and plates as daft draws them (https://docs.daft-pgm.org)."""

from collections.abc import Collection, Iterable, Mapping

import daft
import numpy as np
from matplotlib.axes import Axes

from semgrid_edu.graphical.layout import NODE, Place
from semgrid_edu.graphical.model import GraphicalModel

SQUARE = 0.14
"""Side of a factor."""

HIGHLIGHT = "#d95f02"
"""Outline of the highlighted node, which is three times as thick as the others: colour isn't the only mark."""


def variable_nodes(
    places: Mapping[str, Place],
    texts: Mapping[str, str],
    widths: Mapping[str, float],
    size: float,
    observed: Collection[str],
    highlight: Collection[str],
) -> dict[str, daft.Node]:
    """Make the nodes of variables.

    Parameters
    ----------
    places : dict of str to (float, float)
        The centre of each; neighbours are about 1 apart.
    texts : dict of str to str
        What each says; these are the variables.
    widths : dict of str to float
        How wide each is, at least `NODE`.
    size : float
        Of the text, points.
    observed, highlight : collection of str
        Which are shaded, and which have a thick coloured outline.

    Returns
    -------
    dict of str to daft.Node
        By variable.
    """
    outline = {True: {"ec": HIGHLIGHT, "lw": 3.0}, False: {}}
    return {
        name: daft.Node(
            name,
            text,
            *places[name],
            aspect=widths[name] / NODE,
            observed=name in observed,
            fontsize=size,
            plot_params=outline[name in highlight],
        )
        for name, text in texts.items()
    }


def model_edges(model: GraphicalModel, places: Mapping[str, Place], nodes: Mapping[str, daft.Node]) -> list:
    """Make the arrows of a directed model, or the squares of an undirected one and the lines to them.

    Parameters
    ----------
    model : GraphicalModel
        The model.
    places : dict of str to (float, float)
        The centre of each factor, by its label.
    nodes : dict of str to daft.Node
        The nodes of its variables.

    Returns
    -------
    list
        daft's edges and nodes.
    """
    if model.parents is not None:
        arrow = {"head_length": 0.14, "head_width": 0.1}
        return [
            daft.Edge(nodes[above], nodes[child], plot_params=arrow)
            for child, family in model.parents.items()
            for above in family
        ]
    things = []
    for label, factor in zip(model.labels, model.factors, strict=True):
        if factor.names:
            square = daft.Node(
                label, "", *places[label], scale=SQUARE / NODE, plot_params={"fc": "k"}, shape="rectangle"
            )
            # daft can't end an upright line at a rectangle, so lines end at a circle under the square.
            circle = daft.Node(label, "", *places[label], scale=SQUARE / NODE)
            things += [daft.Edge(nodes[name], circle, directed=False) for name in factor.names] + [square]
    return things


def plate_boxes(boxes: Mapping[str, tuple[np.ndarray, np.ndarray]], size: float) -> list[daft.Plate]:
    """Make plates.

    Parameters
    ----------
    boxes : dict of str to (ndarray, ndarray), each shape (2,)
        Lower left and upper right corner of each plate, by the text in it.
    size : float
        Of the text, points.

    Returns
    -------
    list of daft.Plate
        One for each box.
    """
    return [
        daft.Plate([*low, *(high - low)], label=text, fontsize=size, rect_params={"fc": "none"})
        for text, (low, high) in boxes.items()
    ]


def render(things: Iterable, ax: Axes) -> None:
    """Draw daft's objects into our axes: `daft.PGM.render` would open a figure of its own.

    Parameters
    ----------
    things : iterable
        Nodes, edges and plates; later ones lie over earlier ones.
    ax : matplotlib Axes
        Where.
    """
    context = daft.PGM(grid_unit=1.0, node_unit=NODE)._ctx
    context._ax = ax
    for thing in things:
        thing.render(context)

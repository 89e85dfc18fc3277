"""Where the nodes of a graph stand in a drawing, in units of the distance between neighbours, y upwards.

Nodes, edges and plates as daft draws them (https://docs.daft-pgm.org).
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from semgrid_edu.graphical.model import GraphicalModel, topological_order

if TYPE_CHECKING:  # daft brings matplotlib along, which takes half a second: it is imported where it draws
    import daft
    from matplotlib.axes import Axes

Place = tuple[float, float]
"""x to the right, y upwards."""

NODE = 0.56
"""Diameter of a node, when neighbours are 1 apart."""

CLEARANCE = 0.4
"""An edge that passes a node nearer than this seems to end there."""


def in_rows(*rows: Sequence[str | None]) -> dict[str, Place]:
    """Place variables row by row from top to bottom, each row centred.

    Parameters
    ----------
    *rows : sequence of str or None
        The names from left to right; None leaves a gap.

    Returns
    -------
    dict of str to (float, float)
        For `draw(model, positions=...)`.

    Examples
    --------
    >>> in_rows(["m1", "m2"], ["r"])
    {'m1': (0.0, 0.0), 'm2': (1.0, 0.0), 'r': (0.5, -1.0)}
    """
    widest = max(map(len, rows), default=0)
    return {
        name: ((widest - len(row)) / 2 + column, 0.0 - line)
        for line, row in enumerate(rows)
        for column, name in enumerate(row)
        if name is not None
    }


def automatic(model: GraphicalModel) -> dict[str, Place]:
    """Place all variables: parents above children, or an undirected graph from left to right.

    Parameters
    ----------
    model : GraphicalModel
        In an undirected one each column holds the variables as many steps away from the first.

    Returns
    -------
    dict of str to (float, float)
    """
    if model.parents is None:
        columns = in_rows(*_layers(_distances(model), model.neighbours))
        return {name: (-y, x) for name, (x, y) in columns.items()}
    rows = in_rows(*_layers(_depths(model.parents), model.parents))
    edges = [(above, child) for child, family in model.parents.items() for above in family]
    return _cleared(rows, edges)


def _depths(parents: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """Return how many arrows the longest path from above to each variable has."""
    depth: dict[str, int] = {}
    for name in topological_order(parents):
        depth[name] = max((depth[above] + 1 for above in parents[name]), default=0)
    return {name: depth[name] for name in parents}


def _distances(model: GraphicalModel) -> dict[str, int]:
    """Return how many steps each variable is away from the first one of its part of the graph."""
    neighbours, distance = model.neighbours, {}
    for root in model.names:
        front = {root} - distance.keys()
        steps = 0
        while front:
            distance |= dict.fromkeys(front, steps)
            front = set().union(*(neighbours[name] for name in front)) - distance.keys()
            steps += 1
    return {name: distance[name] for name in model.names}


def _layers(depth: Mapping[str, int], linked: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """Group variables by depth; within a group each stands near the mean place of what it is linked to before."""
    layers: list[list[str]] = []
    place: dict[str, float] = {}
    for level in range(max(depth.values(), default=-1) + 1):
        layer = [name for name in depth if depth[name] == level]
        means = {name: np.mean([place[other] for other in linked[name] if other in place] or [0.0]) for name in layer}
        layer.sort(key=means.__getitem__)
        place |= {name: k - (len(layer) - 1) / 2 for k, name in enumerate(layer)}
        layers.append(layer)
    return layers


def _cleared(places: dict[str, Place], edges: Sequence[tuple[str, str]]) -> dict[str, Place]:
    """Push aside each node that an edge between two others would cross."""
    places = dict(places)
    for name in places:
        others = [edge for edge in edges if name not in edge]
        if any(_distance(places[name], places[one], places[other]) < CLEARANCE for one, other in others):
            right = max(x for x, y in places.values() if y == places[name][1])
            places[name] = (right + 0.8, places[name][1])
    return places


def _distance(point: Place, start: Place, end: Place) -> float:
    """Return the distance of a point from the line between two others."""
    point, start, end = map(np.asarray, (point, start, end))
    along = end - start
    share = np.clip((point - start) @ along / (along @ along), 0, 1)
    return float(np.hypot(*(point - start - share * along)))


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
) -> "dict[str, daft.Node]":
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
    import daft

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


def model_edges(model: GraphicalModel, places: Mapping[str, Place], nodes: "Mapping[str, daft.Node]") -> list:
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
    import daft

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


def plate_boxes(boxes: Mapping[str, tuple[np.ndarray, np.ndarray]], size: float) -> "list[daft.Plate]":
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
    import daft

    return [
        daft.Plate([*low, *(high - low)], label=text, fontsize=size, rect_params={"fc": "none"})
        for text, (low, high) in boxes.items()
    ]


def render(things: Iterable, ax: "Axes") -> None:
    """Draw daft's objects into our axes: `daft.PGM.render` would open a figure of its own.

    Parameters
    ----------
    things : iterable
        Nodes, edges and plates; later ones lie over earlier ones.
    ax : matplotlib Axes
        Where.
    """
    import daft

    context = daft.PGM(grid_unit=1.0, node_unit=NODE)._ctx
    context._ax = ax
    for thing in things:
        thing.render(context)

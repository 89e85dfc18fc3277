"""Pictures of graphical models: circles are variables, arrows conditional distributions, black squares factors.

daft (https://docs.daft-pgm.org) draws nodes, edges and plates; this module decides where they stand and what they say.
"""

import re
from collections.abc import Iterable, Mapping

import daft
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.layout import Place, automatic
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.variables import as_names, check_name

NODE = 0.56
"""Diameter of a node, when neighbours are 1 apart."""

SQUARE = 0.14
"""Side of a factor."""

BELOW_LEFT, ABOVE_RIGHT = np.array([0.45, 0.65]), np.array([0.45, 0.42])
"""How far a plate reaches beyond the centres of its nodes; its text stands under them."""

INCHES = 0.8
"""From one node to the next in a figure of its own."""

FONT_SIZES = 8.0, 12.0
"""Points: labels are never smaller than the first, nor larger than the second."""

HIGHLIGHT = "#d95f02"
"""Outline of the highlighted node, which is three times as thick as the others: colour isn't the only mark."""


def draw(
    model: GraphicalModel,
    ax: Axes | None = None,
    *,
    observed: str | Iterable[str] = (),
    highlight: str | Iterable[str] = (),
    positions: Mapping[str, Place] | None = None,
    labels: Mapping[str, str] | None = None,
    equations: Mapping[str, str] | None = None,
    plates: Mapping[str, Iterable[str]] | None = None,
) -> Axes:
    r"""Draw a model: arrows from parents to children, or the factor graph of an undirected model.

    Parameters
    ----------
    model : GraphicalModel
        `GraphicalModel(model.factors)` draws the factor graph of a directed one.
    ax : matplotlib Axes, optional
        Where to draw; a new figure of fitting size when left out.
    observed : str or iterable of str
        Variables to shade; a dictionary of evidence serves too.
    highlight : str or iterable of str
        Variables with a thick coloured outline: the ones the text is about.
    positions : dict of str to (float, float), optional
        x to the right and y upwards, neighbours about 1 apart; see `in_rows`. It may also place factors, by their
        label of `model.labels`. What it leaves out is placed automatically: parents above children, undirected
        graphs from left to right, factors in the middle of their variables.
    labels : dict of str to str, optional
        What nodes say; "m1" says $m_1$ unless told otherwise.
    equations : dict of str to str, optional
        Text to the right of a variable or factor, by name or label.
    plates : dict of str to iterable of str, optional
        What is repeated: {"$k = 1 \ldots K$": ("m", "z")} draws a box around m and z.

    Returns
    -------
    matplotlib Axes
        With equal scales and without frame.

    Raises
    ------
    ArgumentError
        When a name isn't a variable (or factor, in `positions` and `equations`) of the model.

    Examples
    --------
    >>> from semgrid_edu.graphical import Factor, in_rows
    >>> beam = GraphicalModel([Factor("m", [0.8, 0.2]), Factor(("m", "z"), [[0.9, 0.1], [0.2, 0.8]])], {"z": ("m",)})
    >>> ax = draw(beam, observed="z", highlight="m", positions=in_rows(["m"], ["z"]))
    """
    labels, equations, plates = (
        labels or {},
        equations or {},
        {text: as_names(of) for text, of in (plates or {}).items()},
    )
    observed, highlight = as_names(observed), as_names(highlight)
    _check(model, positions or {}, equations, observed, highlight, labels, *plates.values())
    places = _places(model, positions or {})
    low, high = _extent(places, plates, equations)
    if ax is None:
        ax = plt.subplots(figsize=INCHES * (high - low), layout="constrained")[1]
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.set_axis_off()
    size = _font_size(ax, high - low)
    nodes = {
        name: _variable(name, places[name], _said(name, labels), size, name in observed, name in highlight)
        for name in model.names
    }
    things = [*_plates(plates, places, size), *_edges(model, places, nodes), *nodes.values()]
    _render(things, ax)
    for name, text in equations.items():
        x, y = places[name]
        aside = _half_width(nodes[name]) if name in nodes else SQUARE
        ax.text(x + aside + 0.08, y, text, fontsize=size, ha="left", va="center")
    return ax


def _check(model: GraphicalModel, positions, equations, *groups) -> None:
    for argument, names in (("positions", positions), ("equations", equations)):
        for name in names:
            check_name(argument, name, (*model.names, *model.labels))
    for name in (name for group in groups for name in group):
        check_name("observed, highlight, labels, plates", name, model.names)


def _places(model: GraphicalModel, positions: Mapping[str, Place]) -> dict[str, Place]:
    """Return the place of every variable and, by label, of every factor."""
    places = (automatic(model) if set(model.names) - set(positions) else {}) | dict(positions)
    for label, factor in zip(model.labels, model.factors, strict=True):
        if label not in places and not model.directed and factor.names:
            places[label] = _factor_place(factor.names, places)
    crowded = {place for place in places.values() if list(places.values()).count(place) > 1}
    if crowded:
        raise ArgumentError("positions", "a place of its own for each node", f"several at {sorted(crowded)[0]}")
    return places


def _factor_place(names: tuple[str, ...], places: Mapping[str, Place]) -> Place:
    """Put a factor in the middle of its variables; that of a single variable above it, further factors beside it."""
    x, y = np.mean([places[name] for name in names], axis=0)
    y += 0.55 if len(names) == 1 else 0.0
    while any(np.hypot(x - other_x, y - other_y) < 0.2 for other_x, other_y in places.values()):
        x += 0.25
    return float(x), float(y)


def _said(name: str, labels: Mapping[str, str]) -> str:
    """Return the text of a node: m1 and m_1 are symbols with an index, a single letter a symbol, all else a word."""
    index = re.fullmatch(r"([A-Za-z])_?([\d,]*)", name)
    return labels.get(name, f"${index[1]}_{{{index[2]}}}$" if index else name)


def _variable(name: str, place: Place, text: str, size: float, observed: bool, highlight: bool) -> daft.Node:
    style = {"ec": HIGHLIGHT, "lw": 3.0} if highlight else {}
    # A letter is about 0.6 of its height wide, and a node of diameter 1 holds four of them.
    return daft.Node(
        name, text, *place, aspect=max(1.0, _letters(text) / 4), observed=observed, fontsize=size, plot_params=style
    )


def _half_width(node: daft.Node) -> float:
    return NODE * node.aspect / 2


def _edges(model: GraphicalModel, places: Mapping[str, Place], nodes: Mapping[str, daft.Node]) -> list:
    """Return the arrows of a directed model, or the squares of an undirected one and the lines to them."""
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


def _plates(plates: Mapping[str, tuple[str, ...]], places: Mapping[str, Place], size: float) -> list[daft.Plate]:
    boxes = {text: _box(of, places) for text, of in plates.items()}
    return [
        daft.Plate(
            [*low, *(high - low)], label=text, position="bottom right", fontsize=size, rect_params={"fc": "none"}
        )
        for text, (low, high) in boxes.items()
    ]


def _box(names: Iterable[str], places: Mapping[str, Place]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower left and upper right corner of a plate around nodes."""
    corners = np.array([places[name] for name in names])
    return corners.min(axis=0) - BELOW_LEFT, corners.max(axis=0) + ABOVE_RIGHT


def _extent(places, plates, equations) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the picture: nodes, plates and, at a guess, the texts beside nodes."""
    centres = np.array(list(places.values()))
    boxes = np.array([_box(of, places) for of in plates.values()]).reshape(-1, 2)
    texts = [(places[name][0] + NODE / 2 + 0.12 * _letters(text), places[name][1]) for name, text in equations.items()]
    corners = np.concatenate([centres - 0.45, centres + 0.45, boxes, np.array(texts).reshape(-1, 2)])
    return corners.min(axis=0) - 0.03, corners.max(axis=0) + 0.03


def _letters(text: str) -> int:
    """Return about how many letters wide a text is, mathematics included."""
    return len(re.sub(r"\\[A-Za-z]+", "x", text).translate(str.maketrans("", "", "${}_^\\")))


def _font_size(ax: Axes, extent: np.ndarray) -> float:
    """Return points that fit a node at the scale of the axes, within `FONT_SIZES`."""
    width, height = ax.get_window_extent().size / ax.figure.dpi * 72
    return float(np.clip(0.24 * min(width / extent[0], height / extent[1]), *FONT_SIZES))


def _render(things: Iterable, ax: Axes) -> None:
    """Draw daft's objects into our axes: `daft.PGM.render` would open a figure of its own."""
    context = daft.PGM(grid_unit=1.0, node_unit=NODE)._ctx
    context._ax = ax
    for thing in things:
        thing.render(context)

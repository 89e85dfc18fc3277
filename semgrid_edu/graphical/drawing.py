"""Pictures of graphical models: circles are variables, arrows conditional distributions, black squares factors.

`nodes` draws them; this module decides where they stand and what they say. matplotlib is imported where it is used: it
takes half a second, and those who only infer don't need it.
"""

import re
from collections.abc import Iterable, Mapping
from itertools import chain, count
from typing import TYPE_CHECKING

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.layout import NODE, Place, automatic
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.variables import as_names, check_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARGIN = 0.45
"""How far a plate and the picture reach beyond the centres of nodes, at least."""

LETTER = 0.12
"""Width of a letter, roughly, in a figure of its own."""

INCHES = 0.8
"""From one node to the next in a figure of its own."""

FONT_SIZES = 8.0, 12.0
"""Points: labels are never smaller than the first, nor larger than the second."""


def draw(
    model: GraphicalModel,
    ax: "Axes | None" = None,
    *,
    observed: str | Iterable[str] = (),
    highlight: str | Iterable[str] = (),
    positions: Mapping[str, Place] | None = None,
    labels: Mapping[str, str] | None = None,
    equations: Mapping[str, str] | None = None,
    plates: Mapping[str, Iterable[str]] | None = None,
) -> "Axes":
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
        When a name isn't a variable (or factor, in `positions` and `equations`) of the model, or there is no variable.

    Examples
    --------
    >>> from semgrid_edu.graphical import Factor, in_rows
    >>> beam = GraphicalModel([Factor("m", [0.8, 0.2]), Factor(("m", "z"), [[0.9, 0.1], [0.2, 0.8]])], {"z": ("m",)})
    >>> ax = draw(beam, observed="z", highlight="m", positions=in_rows(["m"], ["z"]))
    """
    from semgrid_edu.graphical.layout import model_edges, plate_boxes, render, variable_nodes

    labels, equations = labels or {}, equations or {}
    plates = {text: as_names(of) for text, of in (plates or {}).items()}
    observed, highlight = as_names(observed), as_names(highlight)
    _check(model, positions or {}, equations, observed, highlight, labels, *plates.values())
    places = _places(model, positions or {})
    said = {name: _said(name, labels) for name in model.names}
    texts = {name: (text, _beside(name, places, said)) for name, text in equations.items()}
    boxes = {text: _box(text, of, places, said, texts) for text, of in plates.items()}
    low, high = _extent(places, said, boxes, texts.values())
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots(figsize=INCHES * (high - low), layout="constrained")[1]
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.set_axis_off()
    size = _font_size(ax, high - low)
    widths = {name: 2 * _half_width(text) for name, text in said.items()}
    nodes = variable_nodes(places, said, widths, size, observed, highlight)
    render([*plate_boxes(boxes, size), *model_edges(model, places, nodes), *nodes.values()], ax)
    for text, place in texts.values():
        ax.text(*place, text, fontsize=size, ha="left", va="center")
    return ax


def _check(model: GraphicalModel, positions, equations, *groups) -> None:
    if not model.names:
        raise ArgumentError("model", "at least one variable to draw", "none")
    for argument, names in (("positions", positions), ("equations", equations)):
        for name in names:
            check_name(argument, name, (*model.names, *model.labels))
    for name in (name for group in groups for name in group):
        check_name("observed, highlight, labels, plates", name, model.names)


def _places(model: GraphicalModel, positions: Mapping[str, Place]) -> dict[str, Place]:
    """Return the place of every variable and, by label, of every factor."""
    places = automatic(model) if set(model.names) - set(positions) else {}
    places |= {name: (float(x), float(y)) for name, (x, y) in positions.items()}
    factors = [] if model.directed else list(zip(model.labels, model.factors, strict=True))
    # Factors of one variable can stand anywhere around it, so they come last.
    for label, factor in sorted(factors, key=lambda pair: len(pair[1].names), reverse=True):
        if label not in places and factor.names:
            places[label] = _factor_place(factor.names, places)
    taken = list(places.values())
    if crowded := [name for name, place in places.items() if taken.count(place) > 1]:
        raise ArgumentError("positions", "a place of its own for each node", f"one for {', '.join(crowded)}")
    return places


def _factor_place(names: tuple[str, ...], places: Mapping[str, Place]) -> Place:
    """Put a factor in the middle of its variables, or beside its only one: the first place that is clear of others."""
    x, y = np.mean([places[name] for name in names], axis=0)
    around = [(-0.35, 0.35), (0.0, 0.5), (0.35, 0.35), (-0.35, -0.35), (0.35, -0.35), (0.0, -0.5)]
    rings = (np.multiply(scale, aside) for scale in count(1.0, 0.5) for aside in around)
    tried = chain([(0.0, 0.0)] if len(names) > 1 else [], rings)
    taken = np.array(list(places.values()))
    clear = ((x + right, y + up) for right, up in tried if np.hypot(*(taken - (x + right, y + up)).T).min() > 0.3)
    return tuple(map(float, next(clear)))


def _said(name: str, labels: Mapping[str, str]) -> str:
    """Return the text of a node: m1 and m_1 are symbols with an index, a single letter a symbol, all else a word."""
    index = re.fullmatch(r"([A-Za-z])_?([\d,]*)", name)
    return labels.get(name, _symbol(*index.groups()) if index else name)


def _symbol(letter: str, index: str) -> str:
    return f"${letter}_{{{index}}}$" if index else f"${letter}$"


def _half_width(text: str) -> float:
    """Return how far a node reaches to either side of its centre: words make it wider."""
    return max(NODE, LETTER * _letters(text)) / 2


def _box(text: str, names: tuple[str, ...], places, said, texts) -> tuple[np.ndarray, np.ndarray]:
    """Return two corners of a plate: its text stands at the lower left, clear of arrows, those of its nodes inside."""
    centres = np.array([places[name] for name in names])
    aside = max(MARGIN, *(_half_width(said[name]) + 0.1 for name in names))
    left = max(aside, LETTER * _letters(text) + 0.15)
    right, top = centres.max(axis=0) + np.array([aside, MARGIN])
    ends = [_end(*texts[name]) + 0.1 for name in names if name in texts]
    return centres.min(axis=0) - (left, 0.65), np.array([max([right, *ends]), top])


def _beside(name: str, places, said) -> Place:
    """Return where an equation begins: to the right of a variable, above a factor."""
    x, y = places[name]
    return (x + _half_width(said[name]) + 0.08, y) if name in said else (x - 0.06, y + 0.2)


def _extent(places, said, boxes, texts) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the picture: nodes, plates and, at a guess, the texts beside nodes."""
    reach = np.array([(max(MARGIN, _half_width(said.get(name, "")) + 0.05), MARGIN) for name in places])
    centres = np.array(list(places.values()))
    ends = [(_end(text, (x, y)), y) for text, (x, y) in texts]
    corners = [centres - reach, centres + reach, np.reshape(ends, (-1, 2)), *map(np.array, boxes.values())]
    corners = np.concatenate(corners)
    return corners.min(axis=0) - 0.03, corners.max(axis=0) + 0.03


def _end(text: str, place: Place) -> float:
    """Return where a text that begins at a place ends, at a guess."""
    return place[0] + LETTER * _letters(text)


def _letters(text: str) -> int:
    """Return about how many letters wide a text is, mathematics included."""
    return len(re.sub(r"\\[A-Za-z]+", "x", text).translate(str.maketrans("", "", "${}_^\\")))


def _font_size(ax: "Axes", extent: np.ndarray) -> float:
    """Return points that fit a node at the scale of the axes, within `FONT_SIZES`."""
    width, height = ax.get_window_extent().size / ax.figure.dpi * 72
    return float(np.clip(0.24 * min(width / extent[0], height / extent[1]), *FONT_SIZES))

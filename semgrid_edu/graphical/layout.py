"""Where the nodes, texts and plates of a drawing stand, in units of the distance between neighbours, y upwards."""

import re
from collections.abc import Mapping, Sequence
from itertools import chain, count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.model import GraphicalModel, topological_order

Place = tuple[float, float]
"""x to the right, y upwards."""

NODE = 0.56
"""Diameter of a node, when neighbours are 1 apart."""

MARGIN = 0.45
"""How far a plate and the picture reach beyond the centres of nodes, at least."""

LETTER = 0.12
"""Width of a letter, roughly, at the scale of the figures that `draw` makes."""

CLEARANCE = 0.4
"""An edge that passes nearer than this to a node looks as if it ended there."""


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
        In an undirected one each column holds the variables that are equally many steps away from the first.
    """
    if model.parents is None:
        columns = in_rows(*_layers(_distances(model), model.neighbours))
        return {name: (-y, x) for name, (x, y) in columns.items()}
    rows = in_rows(*_layers(_depths(model.parents), model.parents))
    edges = [(above, child) for child, family in model.parents.items() for above in family]
    return _cleared(rows, edges)


def _depths(parents: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """Return for each variable the number of arrows on the longest path that leads down to it."""
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
    """Group variables by depth; within a group each stands near the mean place of its links in earlier groups."""
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


class Arrangement(NamedTuple):
    """Where everything in a drawing stands.

    Parameters
    ----------
    places : dict of str to (float, float)
        The centre of each variable and, by label, of each factor.
    said : dict of str to str
        What each variable's node says.
    texts : list of (str, (float, float))
        Equations, and where they begin.
    boxes : dict of str to (ndarray, ndarray), each shape (2,)
        Lower left and upper right corner of each plate, by the text in it.
    corners : (2, 2) float64
        Lower left and upper right corner of the picture.
    """

    places: dict[str, Place]
    said: dict[str, str]
    texts: list[tuple[str, Place]]
    boxes: dict[str, tuple[NDArray, NDArray]]
    corners: NDArray[np.float64]


def arrange(
    model: GraphicalModel,
    positions: Mapping[str, Place],
    labels: Mapping[str, str],
    equations: Mapping[str, str],
    plates: Mapping[str, tuple[str, ...]],
    ghosts: Mapping[str, Place],
) -> Arrangement:
    """Find a place for everything that `draw` draws. Parameters are those of `draw`."""
    places = _places(model, positions) | dict(ghosts)
    said = {name: _said(name, labels) for name in (*model.names, *ghosts)}
    texts = {name: (text, _beside(name, places, said)) for name, text in equations.items()}
    boxes = {text: _box(text, of, places, said, texts) for text, of in plates.items()}
    reach = np.array([(max(MARGIN, half_width(said.get(name, "")) + 0.05), MARGIN) for name in places])
    centres = np.array(list(places.values()))
    ends = [(_end(text, place), place[1]) for text, place in texts.values()]
    points = np.concatenate(
        [centres - reach, centres + reach, np.reshape(ends, (-1, 2)), *map(np.array, boxes.values())]
    )
    ends = np.array([points.min(axis=0) - 0.03, points.max(axis=0) + 0.03])
    return Arrangement(places, said, list(texts.values()), boxes, ends)


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


def half_width(text: str) -> float:
    """Return how far a node reaches to either side of its centre: words make it wider.

    Parameters
    ----------
    text : str
        What the node says.
    """
    return max(NODE, LETTER * _letters(text)) / 2


def _box(text: str, names: tuple[str, ...], places, said, texts) -> tuple[np.ndarray, np.ndarray]:
    """Return two corners of a plate: room for its own text at the lower left, and for the equations of its nodes."""
    centres = np.array([places[name] for name in names])
    aside = max(MARGIN, *(half_width(said[name]) + 0.1 for name in names))
    left = max(aside, LETTER * _letters(text) + 0.15)
    right, top = centres.max(axis=0) + np.array([aside, MARGIN])
    ends = [_end(*texts[name]) + 0.1 for name in names if name in texts]
    return centres.min(axis=0) - (left, 0.65), np.array([max([right, *ends]), top])


def _beside(name: str, places, said) -> Place:
    """Return where an equation begins: to the right of a variable, above a factor."""
    x, y = places[name]
    return (x + half_width(said[name]) + 0.08, y) if name in said else (x - 0.06, y + 0.2)


def _end(text: str, place: Place) -> float:
    """Return where a text that begins at a place ends, at a guess."""
    return place[0] + LETTER * _letters(text)


def _letters(text: str) -> int:
    """Return about how many letters wide a text is, mathematics included."""
    return len(re.sub(r"\\[A-Za-z]+", "x", text).translate(str.maketrans("", "", "${}_^\\")))

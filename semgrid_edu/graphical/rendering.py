"""Rendering of a graphical model with daft: the geometry of nodes, texts, plates and curves."""

import re
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import daft
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import FancyArrowPatch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.places import CUT_COLOUR, Dashed, Place

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NODE = 0.56
"""Diameter of a node, when neighbours are 1 apart."""

SQUARE = 0.14
"""Side of a factor's square."""

MARGIN = 0.45
"""Minimum margin of plates and of the picture around the node centres."""

LETTER = 0.12
"""Approximate width of a letter in a figure made by `GraphPicture`."""

INCHES = 0.8
"""Distance between neighbouring nodes in a figure made by `GraphPicture`."""

FONT_SIZES = 8.0, 12.0
"""Smallest and largest font size, points."""

HIGHLIGHT = {"ec": "#d95f02", "lw": 3.0}
"""Outline of a highlighted node: coloured, and three times as thick for readers who can't see the colour."""

GHOST = {"ec": "0.55", "ls": (0, (2, 2)), "fc": "0.97"}
"""Style of a node that the model doesn't have."""


class GraphPicture:
    """The nodes of a model at their positions. Add texts, plates and dashed edges, then draw with `render`.

    Parameters
    ----------
    model : GraphicalModel
        The model.
    places : dict of str to (float, float)
        Centre of each variable and, by label, of each factor.
    ghosts : dict of str to (float, float)
        Nodes that the model doesn't have.
    labels : dict of str to str
        Node texts that differ from the names.
    """

    def __init__(
        self, model: GraphicalModel, places: Mapping[str, Place], ghosts: Mapping, labels: Mapping[str, str]
    ) -> None:
        self.model = model
        self.places = {**places, **ghosts}
        self.inside = {name: labels.get(name, _symbol(name)) for name in (*model.names, *ghosts)}
        self.ghosts = set(ghosts)
        self.beside: dict[str, tuple[str, float, float]] = {}
        self.plates: dict[str, tuple[NDArray, NDArray]] = {}
        self.curves: list[tuple[Dashed, NDArray]] = []

    def write(self, equations: Mapping[str, str]) -> None:
        """Put texts to the right of variables and above factors.

        Parameters
        ----------
        equations : dict of str to str
            The texts, by name or label.
        """
        for name, text in equations.items():
            x, y = self.places[name]
            if name in self.inside:
                self.beside[name] = text, x + _half_width(self.inside[name]) + 0.08, y
            else:
                self.beside[name] = text, x - 0.06, y + 0.2

    def surround(self, plates: Mapping[str, tuple[str, ...]]) -> None:
        """Put plates around nodes, with room for the plate's text at the bottom and for texts beside the nodes.

        Parameters
        ----------
        plates : dict of str to tuple of str
            The nodes in each plate, by the plate's text.
        """
        for text, names in plates.items():
            centres = np.array([self.places[name] for name in names])
            aside = max(MARGIN, *(_half_width(self.inside[name]) + 0.1 for name in names))
            ends = [self._end(name) + 0.1 for name in names if name in self.beside]
            low = centres.min(axis=0) - (max(aside, LETTER * _letters(text) + 0.15), 0.65)
            right, top = centres.max(axis=0) + np.array([aside, MARGIN])
            self.plates[text] = low, np.array([max([right, *ends]), top])

    def connect(self, edge: Dashed) -> None:
        """Add a dashed edge.

        Parameters
        ----------
        edge : Dashed
            The edge.
        """
        first, second = edge.ends
        start = np.array(self.places[first])
        end = np.array(self.places[second])
        along = end - start
        middle = (start + end) / 2 + 2 * edge.bend * np.array([-along[1], along[0]])
        ends = [self._outline(first, middle), middle, self._outline(second, middle)]
        self.curves.append((edge, np.array(ends)))

    def render(self, ax: "Axes | None", observed: Collection[str], highlight: Collection[str]) -> "Axes":
        """Draw everything, and return the Axes.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw into; by default a new figure.
        observed, highlight : collection of str
            The nodes to shade, and the nodes with a coloured outline.
        """
        low, high = self._limits()
        if ax is None:
            ax = plt.subplots(figsize=INCHES * (high - low), layout="constrained")[1]
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        ax.set_axis_off()
        size = _font_size(ax, high - low)
        nodes = {name: self._node(name, size, name in observed, name in highlight) for name in self.inside}
        boxes = [
            daft.Plate([*low, *(high - low)], label=text, fontsize=size, rect_params={"fc": "none"})
            for text, (low, high) in self.plates.items()
        ]
        context = daft.PGM(grid_unit=1.0, node_unit=NODE)._ctx  # `PGM.render` would create another figure
        context._ax = ax
        for thing in (*boxes, *self._edges(nodes), *nodes.values()):
            thing.render(context)
        for edge, points in self.curves:
            _draw_dashed(edge, points, ax, size)
        for text, x, y in self.beside.values():
            ax.text(x, y, text, fontsize=size, ha="left", va="center")
        return ax

    def _limits(self) -> NDArray[np.float64]:
        """Return the lower left and the upper right corner of the picture, (2, 2)."""
        corners = [np.reshape([self._end(name), y], (1, 2)) for name, (_, _, y) in self.beside.items()]
        for name, place in self.places.items():
            reach = max(MARGIN, _half_width(self.inside.get(name, "")) + 0.05), MARGIN
            corners.append(np.array([np.subtract(place, reach), np.add(place, reach)]))
        corners += [np.array(box) for box in self.plates.values()]
        corners = np.concatenate(corners)
        frame = np.array([corners.min(axis=0) - 0.03, corners.max(axis=0) + 0.03])
        everything = np.concatenate([frame, *(_bounding_box(edge, points) for edge, points in self.curves)])
        return np.array([everything.min(axis=0), everything.max(axis=0)])

    def _node(self, name: str, size: float, observed: bool, highlighted: bool) -> daft.Node:
        look = HIGHLIGHT if highlighted else GHOST if name in self.ghosts else {}
        text = self.inside[name]
        aspect = 2 * _half_width(text) / NODE
        place = self.places[name]
        return daft.Node(name, text, *place, aspect=aspect, observed=observed, fontsize=size, plot_params=look)

    def _edges(self, nodes: dict[str, daft.Node]) -> list:
        """Return the arrows of a directed model, or the squares and lines of an undirected one."""
        things = []
        if self.model.directed:
            replaced = {frozenset(edge.ends) for edge, _ in self.curves if not edge.bend}
            arrow = {"head_length": 0.14, "head_width": 0.1}
            for child, parents in self.model.parents.items():
                kept = [name for name in parents if frozenset((name, child)) not in replaced]
                things += [daft.Edge(nodes[name], nodes[child], plot_params=arrow) for name in kept]
            return things
        for label, factor in zip(self.model.labels, self.model.factors, strict=True):
            if factor.names:
                place = self.places[label]
                square = daft.Node(label, "", *place, scale=SQUARE / NODE, plot_params={"fc": "k"}, shape="rectangle")
                # daft can't end a vertical line at a rectangle, so lines end at a circle under the square.
                circle = daft.Node(label, "", *place, scale=SQUARE / NODE)
                things += [daft.Edge(nodes[name], circle, directed=False) for name in factor.names]
                things.append(square)
        return things

    def _outline(self, name: str, towards: NDArray) -> NDArray[np.float64]:
        """Return the point at which the line from a node's centre to another point crosses the node's outline."""
        centre = np.array(self.places[name])
        way = (towards - centre) / np.hypot(*(towards - centre))
        half = _half_width(self.inside[name])
        return centre + way * (1 / np.hypot(way[0] / half, way[1] / (NODE / 2)) + 0.03)

    def _end(self, name: str) -> float:
        """Return the approximate right end of the text beside a node."""
        text, x, _ = self.beside[name]
        return x + LETTER * _letters(text)


def _symbol(name: str) -> str:
    """Return the text in a node: m1 and m_1 become a symbol with index, one letter a symbol, the rest stays a word."""
    found = re.fullmatch(r"([A-Za-z])_?([\d,]*)", name)
    if not found:
        return name
    letter, index = found.groups()
    return f"${letter}_{{{index}}}$" if index else f"${letter}$"


def _letters(text: str) -> int:
    """Return the approximate width of a text in letters, including mathematics."""
    return len(re.sub(r"\\[A-Za-z]+", "x", text).translate(str.maketrans("", "", "${}_^\\")))


def _half_width(text: str) -> float:
    """Return half the width of a node with this text; words make it wider."""
    return max(NODE, LETTER * _letters(text)) / 2


def _font_size(ax: "Axes", extent: NDArray) -> float:
    """Return the font size, within `FONT_SIZES`, that fits a node at the scale of the axes."""
    width, height = ax.get_window_extent().size / ax.figure.dpi * 72
    return float(np.clip(0.24 * min(width / extent[0], height / extent[1]), *FONT_SIZES))


def _on_curve(points: NDArray, t: float) -> NDArray[np.float64]:
    """Return a point on a quadratic Bezier curve, (2,)."""
    return np.array([(1 - t) ** 2, 2 * t * (1 - t), t**2]) @ points


def _bounding_box(edge: Dashed, points: NDArray) -> NDArray[np.float64]:
    """Return two corners of the bounding box of a dashed edge and its text, (2, 2)."""
    half = np.array([LETTER * len(edge.text) / 2 + 0.05, 0.2])
    text = _on_curve(points, edge.at)
    around = np.array([text - half, text + half, *(_on_curve(points, t) for t in (0, 0.25, 0.5, 0.75, 1))])
    return np.array([around.min(axis=0), around.max(axis=0)])


def _draw_dashed(edge: Dashed, points: NDArray, ax: "Axes", size: float) -> None:
    """Draw one dashed edge and its text, with a white background so that it is readable on top of other edges."""
    style = {"color": CUT_COLOUR, "lw": 1.6, "zorder": 1.5}
    path = Path(points, [Path.MOVETO, Path.CURVE3, Path.CURVE3])
    ax.add_patch(PathPatch(path, fill=False, ls=(0, (4, 2.5)), **style))
    if edge.arrow:
        tip = {"arrowstyle": "-|>", "mutation_scale": 1.1 * size, "shrinkA": 0, "shrinkB": 0}
        ax.add_patch(FancyArrowPatch(_on_curve(points, 0.97), _on_curve(points, 1), **tip, **style))
    if edge.text:
        box = {"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none"}
        font = {"color": CUT_COLOUR, "fontsize": size, "fontweight": "bold", "ha": "center", "va": "center"}
        ax.text(*_on_curve(points, edge.at), edge.text, bbox=box, zorder=5, **font)

"""Pictures of graphical models: circles are variables, arrows conditional distributions, black squares factors.

Dashed curves, with a text on each, are the edges that a real system cuts. matplotlib is imported only inside `draw`,
because it takes half a second and inference doesn't need it.
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import as_names, check_name
from semgrid_edu.graphical.layout import LETTER, NODE, Place, arrange, half_width
from semgrid_edu.graphical.model import GraphicalModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CUT_COLOUR = "#7b3294"
"""Colour of every dashed edge and of its text."""


class Dashed(NamedTuple):
    """A dashed edge of a drawing. A straight one replaces the arrow between the same nodes, if there is one.

    Parameters
    ----------
    ends : (str, str)
        The two nodes.
    text : str
        What is written on it.
    arrow : bool
        Whether it ends in an arrow head, at the second node.
    bend : float
        How far its middle lies to the left of the straight line, seen from the first node; in units of its length.
    at : float
        Where the text stands: 0 for the first node, 1 for the second.
    """

    ends: tuple[str, str]
    text: str = ""
    arrow: bool = True
    bend: float = 0.0
    at: float = 0.5


INCHES = 0.8
"""From one node to the next in a figure that `draw` makes itself."""

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
    dashed: Iterable[Dashed] = (),
    ghosts: Mapping[str, Place] | None = None,
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
    dashed : iterable of Dashed
        Edges between any two nodes, drawn dashed; a straight one stands for the arrow between the same two.
    ghosts : dict of str to (float, float), optional
        Nodes that the model doesn't have, by name, and where they stand; drawn grey, with a dashed outline.

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
    from semgrid_edu.graphical.rendering import render

    positions, labels, equations, ghosts = positions or {}, labels or {}, equations or {}, ghosts or {}
    plates = {text: as_names(of) for text, of in (plates or {}).items()}
    observed, highlight = as_names(observed), as_names(highlight)
    texts = {name: text for name, text in labels.items() if name not in ghosts}
    _check(model, positions, equations, observed, highlight, texts, *plates.values())
    where = arrange(model, positions, labels, equations, plates, ghosts)
    curves = {edge: curve(edge, where.places, where.said) for edge in dashed}
    corners = np.concatenate([where.corners, *(bounding_box(*one) for one in curves.items())])
    low, high = corners.min(axis=0), corners.max(axis=0)
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots(figsize=INCHES * (high - low), layout="constrained")[1]
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.set_axis_off()
    size = _font_size(ax, high - low)
    render(model, where, ax, size, observed, highlight, {frozenset(edge.ends) for edge in curves if not edge.bend})
    for edge, points in curves.items():
        render_dashed(edge, points, ax, size)
    for text, place in where.texts:
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


def _font_size(ax: "Axes", extent: np.ndarray) -> float:
    """Return points that fit a node at the scale of the axes, within `FONT_SIZES`."""
    width, height = ax.get_window_extent().size / ax.figure.dpi * 72
    return float(np.clip(0.24 * min(width / extent[0], height / extent[1]), *FONT_SIZES))


def curve(edge: Dashed, places: Mapping[str, Place], said: Mapping[str, str]) -> NDArray[np.float64]:
    """Return the three control points of a dashed edge, which begins and ends at the outlines of its nodes.

    Parameters
    ----------
    edge : Dashed
        The edge.
    places : dict of str to (float, float)
        The centre of each node.
    said : dict of str to str
        What each node says.

    Returns
    -------
    (3, 2) float64
        Of a quadratic Bezier curve.
    """
    start, end = (np.array(places[name]) for name in edge.ends)
    along = end - start
    middle = (start + end) / 2 + 2 * edge.bend * np.array([-along[1], along[0]])
    first, last = (half_width(said[name]) for name in edge.ends)
    return np.array([_outline(start, middle, first), middle, _outline(end, middle, last)])


def _outline(centre: NDArray, towards: NDArray, half: float) -> NDArray[np.float64]:
    """Return where the line from the centre of a node to another place leaves the node."""
    way = (towards - centre) / np.hypot(*(towards - centre))
    return centre + way * (1 / np.hypot(way[0] / half, way[1] / (NODE / 2)) + 0.03)


def on_curve(points: NDArray, t: float) -> NDArray[np.float64]:
    """Return a place on a quadratic Bezier curve, (2,).

    Parameters
    ----------
    points : (3, 2) float
        Its control points.
    t : float
        0 for the beginning, 1 for the end.
    """
    return np.array([(1 - t) ** 2, 2 * t * (1 - t), t**2]) @ points


def bounding_box(edge: Dashed, points: NDArray) -> NDArray[np.float64]:
    """Return two corners of the box around a curve and its text, (2, 2).

    Parameters
    ----------
    edge : Dashed
        The edge.
    points : (3, 2) float
        Its control points.
    """
    written = np.array([LETTER * len(edge.text) / 2 + 0.05, 0.2])
    places = [on_curve(points, t) for t in (0, 0.25, 0.5, 0.75, 1)]
    text = on_curve(points, edge.at)
    around = np.array([*places, text - written, text + written])
    return np.array([around.min(axis=0), around.max(axis=0)])


def render_dashed(edge: Dashed, points: NDArray, ax: "Axes", size: float) -> None:
    """Draw one dashed edge and its text, on white so that it can be read where it crosses other edges.

    Parameters
    ----------
    edge : Dashed
        The edge.
    points : (3, 2) float
        The control points of its curve.
    ax : Axes
        Where to draw.
    size : float
        Size of the text, points.
    """
    from matplotlib.patches import FancyArrowPatch, PathPatch
    from matplotlib.path import Path

    style = {"color": CUT_COLOUR, "lw": 1.6, "zorder": 1.5}
    path = Path(points, [Path.MOVETO, Path.CURVE3, Path.CURVE3])
    ax.add_patch(PathPatch(path, fill=False, ls=(0, (4, 2.5)), **style))
    if edge.arrow:
        tip = {"arrowstyle": "-|>", "mutation_scale": 1.1 * size, "shrinkA": 0, "shrinkB": 0}
        ax.add_patch(FancyArrowPatch(on_curve(points, 0.97), on_curve(points, 1), **tip, **style))
    box = {"boxstyle": "round,pad=0.12", "fc": "white", "ec": "none"}
    written = {"color": CUT_COLOUR, "fontsize": size, "fontweight": "bold", "ha": "center", "va": "center"}
    if edge.text:
        ax.text(*on_curve(points, edge.at), edge.text, bbox=box, zorder=5, **written)

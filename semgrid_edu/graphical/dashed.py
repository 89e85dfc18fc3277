"""Dashed curves between two nodes of a drawing, with a text on each: the edges that a real system cuts."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.graphical.layout import LETTER, NODE, Place, half_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CUT_COLOUR = "#7b3294"
"""Of every dashed edge and of its text."""


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


def curve(edge: Dashed, places: Mapping[str, Place], said: Mapping[str, str]) -> NDArray[np.float64]:
    """Return the three control points of the curve, which begins and ends at the outlines of its nodes.

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

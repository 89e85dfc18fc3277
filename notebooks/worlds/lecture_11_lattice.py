"""The permutohedral lattice of points with two features, drawn: splat, blur, slice (Adams, Baek, Davis 2010)."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import PermutohedralLattice, enclosing_simplices
from semgrid_edu.crf.lattice import elevated, elevation

MARK = 50.0
"""Area of the mark of a point, or of a vertex that holds one point, in points squared."""

SIZE = 3
"""d + 1: coordinates of a vertex, corners of a triangle and directions of the blur."""


class LatticeFrame(NamedTuple):
    """One picture of the filter at work.

    Parameters
    ----------
    title : str
        The step it shows.
    places : (M, 2) float
        Positions of the marks, in features.
    values : (M,) float
        What is there: a weighted mean of the values of points.
    weights : (M,) float
        How much of the points is there: the area of the mark.
    """

    title: str
    places: NDArray
    values: NDArray
    weights: NDArray


def vertex_places(vertices: ArrayLike) -> NDArray[np.float64]:
    """Return the positions of vertices in the plane of the two features, (M, 2).

    Parameters
    ----------
    vertices : (M, 3) float
        Three coordinates each, with a sum of zero.

    Examples
    --------
    >>> vertex_places([(0, 0, 0), (3, -3, 0)]).round(3)
    array([[0.   , 0.   ],
           [1.732, 0.   ]])
    """
    basis = elevation(SIZE - 1)
    return np.asarray(vertices) @ basis / (basis[:, 0] @ basis[:, 0])


def draw_triangles(low: ArrayLike, high: ArrayLike, ax: Axes) -> Axes:
    """Draw the triangles of the lattice in a rectangle of the plane of features.

    Parameters
    ----------
    low, high : (2,) float
        Two opposite corners of the rectangle.
    ax : Axes
        Axes to draw into.
    """
    steps = vertex_places(1 - SIZE * np.eye(SIZE))
    far = int(np.abs([low, high]).sum()) + 2
    places = np.stack(np.meshgrid(*[np.arange(-far, far + 1)] * 2), axis=-1).reshape(-1, 2) @ steps[:2]
    near = places[((places > np.subtract(low, 2)) & (places < np.add(high, 2))).all(axis=1)]
    edges = [np.stack([near, near + one], axis=1) for one in steps]
    ax.add_collection(LineCollection(np.concatenate(edges), colors="0.78", linewidths=0.7, zorder=0))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    return ax


def draw_simplex(features: ArrayLike, ax: Axes) -> Axes:
    """Draw a point, the corners of its triangle with their coordinates, and a weight at each link.

    Parameters
    ----------
    features : (2,) float
        The point, in widths.
    ax : Axes
        Axes to draw into.
    """
    (y,) = elevated([features])
    (corners,), (weights,) = enclosing_simplices(y[None])
    for corner, weight, place in zip(corners.tolist(), weights, vertex_places(corners), strict=True):
        ax.plot(*zip(features, place, strict=True), color="0.3", linewidth=1.2)
        ax.plot(*place, "s", color="0.2", markersize=7)
        white = {"fc": "w", "ec": "none", "pad": 1}
        ax.annotate(f"{weight:.2f}", (features + place) / 2, ha="center", va="center", fontsize=9, bbox=white)
        if str(tuple(corner)) not in {text.get_text() for text in ax.texts}:
            outward = (place - features) / np.maximum(np.linalg.norm(place - features), 1e-9)
            style = {"textcoords": "offset points", "ha": "center", "va": "center", "fontsize": 9}
            ax.annotate(str(tuple(corner)), place, (26, 13) * outward, **style)
    ax.plot(*features, "o", color="#fc7200", markersize=9, markeredgecolor="k", zorder=3)
    return ax


def draw_lattice_frame(frame: LatticeFrame, ax: Axes | None = None) -> Axes:
    """Draw one picture of `lattice_story`.

    Parameters
    ----------
    frame : LatticeFrame
        What to draw; values of 0 to 1.
    ax : Axes, optional
        Axes to draw into.

    Returns
    -------
    Axes
        Colour shows the value of a mark, area its weight.
    """
    ax = ax or plt.subplots(layout="constrained")[1]
    area = MARK * np.sqrt(np.maximum(frame.weights, 0))
    ax.scatter(*frame.places.T, s=area, c=frame.values, cmap="cividis", vmin=0, vmax=1, edgecolors="k", linewidths=0.4)
    ax.set_title(frame.title, loc="left", fontsize="medium")
    return ax


def lattice_story(features: NDArray, values: NDArray, between: int = 0) -> Iterator[LatticeFrame]:
    """Yield the pictures of the filter at work: points, splat, one blur for each direction, slice, points again.

    Parameters
    ----------
    features : (N, 2) float
        One row per point, in units of the Gaussian's standard deviation.
    values : (N,) float
        The value of each point, 0 to 1.
    between : int
        How many pictures to put between two steps, so that the marks move in an animation.

    Yields
    ------
    LatticeFrame
        In the last one, each point has the weighted mean of the values around it.
    """
    lattice = PermutohedralLattice.build(features)
    corners, shares = enclosing_simplices(elevated(features))
    at_points = np.repeat(features, SIZE, axis=0)
    at_corners = vertex_places(corners.reshape(-1, SIZE))
    at_vertices = vertex_places(lattice.vertices)

    def journey(title: str, starts: NDArray, ends: NDArray, colours: NDArray) -> Iterator[LatticeFrame]:
        for t in _parts(between):
            yield LatticeFrame(title, (1 - t) * starts + t * ends, colours, shares.ravel())

    yield LatticeFrame("points, each with its value", features, values, np.ones(len(values)))
    title = "splat: each point gives to its 3 corners"
    held = lattice.shares.T @ np.column_stack([values, np.ones(len(values))])
    yield from journey(title, at_points, at_corners, np.repeat(values, SIZE))
    yield _of_sums(title, at_vertices, held)
    for direction, blur in enumerate(lattice.blurs, start=1):
        before = held
        held = blur @ before
        title = f"blur along direction {direction} of 3"
        for t in _parts(between):
            yield _of_sums(title, at_vertices, (1 - t) * before + t * held)
        yield _of_sums(title, at_vertices, held)
    title = "slice: each point takes from its 3 corners"
    of_vertex = {tuple(vertex): sums for vertex, sums in zip(lattice.vertices.tolist(), held, strict=True)}
    found = np.array([of_vertex[tuple(corner)] for corner in corners.reshape(-1, SIZE).tolist()])
    yield from journey(title, at_corners, at_points, found[:, 0] / found[:, 1])
    sums = lattice.shares @ held
    yield LatticeFrame(title, features, sums[:, 0] / sums[:, 1], np.ones(len(values)))


def code_of(*functions: Callable) -> Markdown:
    """Return the code of functions without their docstrings, to be shown in a notebook.

    Parameters
    ----------
    functions : callable
        Functions of the package.
    """
    shown = []
    for function in functions:
        source = textwrap.dedent(inspect.getsource(function))
        lines = source.splitlines()
        body = ast.parse(source).body[0].body
        documented = ast.get_docstring(ast.parse(source).body[0]) is not None
        first, last = (body[0].lineno, body[0].end_lineno) if documented else (1, 0)
        shown.append("\n".join(lines[: first - 1] + lines[last:]))
    return Markdown("```python\n" + "\n\n".join(shown) + "\n```")


def _parts(between: int) -> NDArray[np.float64]:
    return np.arange(1, between + 1) / (between + 1)


def _of_sums(title: str, places: NDArray, sums: NDArray) -> LatticeFrame:
    """Return the picture of vertices that hold a weighted sum of values, and the sum of the weights."""
    return LatticeFrame(title, places, sums[:, 0] / sums[:, 1], sums[:, 1])

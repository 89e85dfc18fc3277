"""Pictures of graphical models: circles are variables, arrows conditional distributions, black squares factors.

matplotlib is imported only inside `draw`, because it takes half a second and inference doesn't need it.
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.dashed import Dashed, bounding_box, curve, render_dashed
from semgrid_edu.graphical.factor import as_names, check_name
from semgrid_edu.graphical.layout import Place, arrange
from semgrid_edu.graphical.model import GraphicalModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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

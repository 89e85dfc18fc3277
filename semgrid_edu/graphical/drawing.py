"""Drawings of graphical models: circles are variables, arrows conditional distributions, black squares factors.

Dashed curves with a text are edges that a real system cuts. `draw` uses daft (https://docs.daft-pgm.org) and imports it
lazily, because matplotlib takes half a second to load and inference doesn't need it.
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical.factor import as_names, check_name
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.places import Dashed, Place

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(
    model: GraphicalModel,
    ax: "Axes | None" = None,
    *,
    positions: Mapping[str, Place],
    observed: str | Iterable[str] = (),
    highlight: str | Iterable[str] = (),
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
        The model. To draw the factor graph of a directed model, pass `GraphicalModel(model.factors)`.
    ax : matplotlib Axes, optional
        Axes to draw into; by default a new figure of suitable size.
    positions : dict of str to (float, float)
        Position of every variable: x to the right, y upwards, neighbours about 1 apart; see `in_rows`. It may also
        position factors, by their label in `model.labels`. The default for a factor is the middle of its variables, or
        above and left of its only variable.
    observed : str or iterable of str
        Variables to shade; a dictionary of evidence works too.
    highlight : str or iterable of str
        Variables with a thick coloured outline.
    labels : dict of str to str, optional
        Node texts that differ from the names. By default "m1" is written as $m_1$.
    equations : dict of str to str, optional
        Text to the right of a variable or above a factor, by name or label.
    plates : dict of str to iterable of str, optional
        Plates for repeated nodes: {"$k = 1 \ldots K$": ("m", "z")} draws a box around m and z.
    dashed : iterable of Dashed
        Dashed edges between any two nodes.
    ghosts : dict of str to (float, float), optional
        Positions of nodes that the model doesn't have; drawn in grey with a dashed outline.

    Returns
    -------
    matplotlib Axes
        With equal aspect and no frame.

    Raises
    ------
    ArgumentError
        When a name isn't a variable of the model (in `positions` and `equations`: or a factor), a variable has no
        position, or two nodes share a position.

    Examples
    --------
    >>> from semgrid_edu.graphical import Factor, in_rows
    >>> beam = GraphicalModel([Factor("m", [0.8, 0.2]), Factor(("m", "z"), [[0.9, 0.1], [0.2, 0.8]])], {"z": ("m",)})
    >>> ax = draw(beam, positions=in_rows(["m"], ["z"]), observed="z", highlight="m")
    """
    from semgrid_edu.graphical.rendering import GraphPicture

    labels = labels or {}
    equations = equations or {}
    ghosts = ghosts or {}
    plates = {text: as_names(names) for text, names in (plates or {}).items()}
    observed = as_names(observed)
    highlight = as_names(highlight)
    named = [name for name in labels if name not in ghosts]
    _check(model, {"observed": observed, "highlight": highlight, "labels": named, **plates}, positions, equations)
    picture = GraphPicture(model, _places(model, positions), ghosts, labels)
    picture.write(equations)
    picture.surround(plates)
    for edge in dashed:
        picture.connect(edge)
    return picture.render(ax, observed, highlight)


def _check(model: GraphicalModel, groups: Mapping[str, Iterable[str]], positions: Mapping, equations: Mapping) -> None:
    """Raise an error that names the first unknown name."""
    for argument, names in (("positions", positions), ("equations", equations)):
        for name in names:
            check_name(argument, name, (*model.names, *model.labels))
    for argument, names in groups.items():
        for name in names:
            check_name(argument, name, model.names)


def _places(model: GraphicalModel, positions: Mapping[str, Place]) -> dict[str, Place]:
    """Return the position of every variable and, for an undirected model, of every factor by label."""
    if missing := [name for name in model.names if name not in positions]:
        raise ArgumentError("positions", "a place for every variable", f"none for {', '.join(missing)}")
    places = {name: (float(x), float(y)) for name, (x, y) in positions.items()}
    factors = [] if model.directed else zip(model.labels, model.factors, strict=True)
    for label, factor in factors:
        if factor.names and label not in places:
            x, y = np.mean([places[name] for name in factor.names], axis=0)
            places[label] = (x, y) if len(factor.names) > 1 else (x - 0.35, y + 0.35)
    taken = list(places.values())
    if crowded := [name for name, place in places.items() if taken.count(place) > 1]:
        raise ArgumentError("positions", "a place of its own for each node", f"one for {', '.join(crowded)}")
    return places

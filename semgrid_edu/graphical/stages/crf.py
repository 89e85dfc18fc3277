"""The dense CRF on a few cells as an undirected model, built from the package's pair weights (eq. (3), (4))."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import CrfParams, crf_model, unary_from_probability
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph
from semgrid_edu.occupancy import N_STATES, State

UNDECIDED = np.array([[0.6, 0.4, 0.6], [0.4, 0.52, 0.4], [0.6, 0.4, 0.6]])
"""The network's probability of class 0: four cells are for it, four against it, and the centre is slightly for it."""

CUT = (
    CutEdge(
        "x1 - x2",
        "Mean field shows each cell only the average of the others, not how they would react to it, so beyond a "
        "coupling of about 1.3 it picks a side: 0.998 for class 0 at the default weights, where 0.52 is right.",
    ),
)
"""What the package's inference leaves out of the model; every pair has such an edge."""


def coupled(coupling: float) -> CrfParams:
    """Return the package's parameters with both pair weights scaled, in their default ratio of 4 to 3.

    Parameters
    ----------
    coupling : float
        The weight w_bilateral: 0 for no pair term, 4 for the package's default.

    Returns
    -------
    CrfParams
        The scaled parameters.
    """
    default = CrfParams()
    return CrfParams(w_bilateral=coupling, w_spatial=coupling * default.w_spatial / default.w_bilateral)


def two_classes(probability: ArrayLike) -> NDArray[np.float64]:
    """Return the unary term of two classes.

    Parameters
    ----------
    probability : (H, W) float
        Probability of class 0 in each cell.

    Returns
    -------
    (2, H, W) float64
        phi_u of eq. (3).
    """
    probability = np.asarray(probability, dtype=np.float64)
    return unary_from_probability(np.stack([probability, 1 - probability]))


def all_free(shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return occupancy values that couple every pair of cells: all cells are certainly free.

    Parameters
    ----------
    shape : (int, int)
        H, W of the grid.

    Returns
    -------
    (4, H, W) float64
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    """
    values = np.zeros((N_STATES, *shape))
    values[State.FREE] = 1
    return values


def crf_stage(coupling: float = 4.0, unary: NDArray | None = None, values: NDArray | None = None) -> StageGraph:
    """Return the graph of a fully connected CRF: a factor for each cell and one for each pair of cells.

    Parameters
    ----------
    coupling : float
        The weight of the pair term, see `coupled`.
    unary : (C, H, W) float, optional
        phi_u, the unary term; that of `UNDECIDED`, 3 x 3 cells, when left out.
    values : (4, H, W) float, optional
        Occupancy of each cell; all free when left out.

    Returns
    -------
    StageGraph
        The variables are those of `crf_model`, drawn on a circle, so that every pair has a line of its own.
    """
    unary = two_classes(UNDECIDED) if unary is None else unary
    values = all_free(unary.shape[1:]) if values is None else values
    model = crf_model(unary, values, coupled(coupling))
    return StageGraph(
        "CRF: every cell with every other",
        model,
        positions=_circle(model),
        equations={"f(x1)": r"$e^{-\phi_u(x_1)}$", "f(x1, x2)": r"$e^{-k_{12} [x_1 \neq x_2]}$"},
        cut=CUT,
    )


def _circle(model: GraphicalModel) -> dict[str, tuple[float, float]]:
    """Place cells on a circle, their own factors outside it, and the factors of opposite cells away from its centre."""
    names = model.names
    angles = np.pi / 2 - 2 * np.pi * np.arange(len(names)) / len(names)
    directions = dict(zip(names, np.stack([np.cos(angles), np.sin(angles)], axis=1), strict=True))
    radius = max(1.0, 0.29 * len(names))
    places = {name: radius * direction for name, direction in directions.items()}
    places |= {f"f({name})": (radius + 0.65) * direction for name, direction in directions.items()}
    for one, other in zip(names, names[len(names) // 2 :], strict=False):
        if len(names) % 2 == 0:
            places[f"f({one}, {other})"] = 0.4 * places[one]
    return {name: (float(x), float(y)) for name, (x, y) in places.items()}

"""The dense CRF on a few cells: exact inference and mean field as the coupling grows (eq. (3), (4)).

As the pair weights grow, all cells take the same label, but either class remains possible: the exact probability of
class 0 in the centre of `UNDECIDED` stays 0.52. Mean field agrees up to a coupling of 1; at 4 it says 0.998.
"""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import softmax

from semgrid_edu.crf import (
    CrfParams,
    crf_model,
    exact_marginals,
    mean_field_naive,
    unary_from_probability,
)
from semgrid_edu.graphical import GraphicalModel
from semgrid_edu.occupancy import N_STATES, State
from worlds.lecture_00_stage_graph import CutEdge, Price, StageGraph

UNDECIDED = np.array([[0.6, 0.4, 0.6], [0.4, 0.52, 0.4], [0.6, 0.4, 0.6]])
"""The network's probability of class 0: four cells favour it, four don't, and the centre slightly favours it."""


def coupled(coupling: float) -> CrfParams:
    """Return the package's parameters with both pair weights scaled.

    `coupling` is w_bilateral: 0 for no pair term, 4 for the default. The ratio of the two weights stays 4 to 3.
    """
    default = CrfParams()
    return CrfParams(w_bilateral=coupling, w_spatial=coupling * default.w_spatial / default.w_bilateral)


def two_classes(probability: ArrayLike) -> NDArray[np.float64]:
    """Return the unary term of two classes, phi_u of eq. (3), (2, H, W), from the probability of class 0, (H, W)."""
    probability = np.asarray(probability, dtype=np.float64)
    return unary_from_probability(np.stack([probability, 1 - probability]))


def all_free(shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return occupancy values that couple every pair of cells, (4, H, W): all cells are certainly free."""
    values = np.zeros((N_STATES, *shape))
    values[State.FREE] = 1
    return values


def sampled_marginals(
    unary: NDArray, prices: NDArray, start: NDArray[np.integer], sweeps: int = 80, seed: int = 0
) -> NDArray[np.float64]:
    """Return the marginals of a dense CRF by Gibbs sampling, (C, N), without mean field's assumption.

    Parameters
    ----------
    unary : (C, N) float
        phi_u, the price of each label in each cell.
    prices : (N, N) float
        k_ij, zero on the diagonal.
    start : (N,) int
        The first labelling.
    sweeps : int
        How often each cell draws a label; the first quarter isn't counted.
    seed : int
        Seed of the draws.
    """
    rng = np.random.default_rng(seed)
    labels = np.array(start)
    own = -np.asarray(unary, dtype=np.float64)
    pull = own + np.stack([prices[:, labels == label].sum(axis=1) for label in range(len(own))])
    total = np.zeros_like(own)
    counted = 0
    for sweep in range(sweeps):
        for i, noise in enumerate(rng.gumbel(size=own.T.shape)):
            old, new = labels[i], (pull[:, i] + noise).argmax()  # the Gumbel trick: a draw from softmax(pull)
            if new != old:
                pull[old] -= prices[i]
                pull[new] += prices[i]
                labels[i] = new
        if sweep >= sweeps // 4:
            total += softmax(pull, axis=0)
            counted += 1
    return total / counted


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


@cache
def mean_field_picks_a_side() -> Price:
    """P(class 0) of the centre of nine undecided cells, at the default weights."""
    unary = two_classes(UNDECIDED)
    values = all_free(UNDECIDED.shape)
    exact = exact_marginals(unary, values, CrfParams())
    found = mean_field_naive(unary, values, CrfParams())
    return Price(exact[0, 1, 1], found[0, 1, 1], "P(class 0) of an undecided cell")


CUT = (
    CutEdge(
        "x2 - x3",
        "Mean field shows each cell only the average of the others, not how they would react to it, so beyond a "
        "coupling of about 1.3 it picks a side: 0.998 for class 0 at the default weights, where 0.52 is right.",
        ("x2", "x3"),
        mean_field_picks_a_side,
        bend=0.3,
    ),
)
"""The edges that mean field cuts."""

"""The dense CRF on a few cells: exact inference, mean field and loopy sum-product as the coupling grows (eq. (3), (4)).

As the pair weights grow, all cells take the same label, but either class remains possible: the exact probability of
class 0 in the centre of `UNDECIDED` is 0.52 at each of the `COUPLINGS`. Mean field and loopy sum-product agree up to a
coupling of 1. At 2 they give 0.94 and 0.92, and at 4 both give 0.998: in between is a phase transition. Below it, at 1,
the error of loopy sum-product is about half that of mean field. Just above it, at 1.5, ten updates have a smaller error
than converged mean field, because they stop before it has picked a side.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import (
    CrfParams,
    crf_model,
    exact_marginals,
    mean_field,
    mean_field_naive,
    pair_weights,
    unary_from_probability,
)
from semgrid_edu.graphical import GraphicalModel, max_product, mean_field_graph, sum_product
from semgrid_edu.metrics import total_variation
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


COUPLINGS = (0.0, 0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 3.0, 4.0)
"""Values of w_bilateral, from no pair term to the package's default."""


@dataclass(frozen=True, eq=False)
class CouplingSweep:
    """The result of each method of inference in the CRF as the pair weight grows.

    Parameters
    ----------
    couplings : (n,) float64
        Values of w_bilateral.
    marginals : dict of str to (n, C, N) float64
        Distribution of each cell by method: "exact"; "mean field", one cell after the other until it converges;
        "naive" and "fast", the package's two functions with ten updates; "loopy", sum-product.
    labelling : (n, N) int64
        The most likely labelling of all cells together, by exact inference.
    converged : (n,) bool
        Whether loopy sum-product converged.
    """

    couplings: NDArray[np.float64]
    marginals: Mapping[str, NDArray[np.float64]]
    labelling: NDArray[np.int64]
    converged: NDArray[np.bool_]

    @property
    def errors(self) -> dict[str, NDArray[np.float64]]:
        """(n,) for each approximate method: the largest total variation of a cell's distribution from the exact one."""
        exact = self.marginals["exact"]
        return {
            method: total_variation(found.swapaxes(1, 2), exact.swapaxes(1, 2)).max(axis=1)
            for method, found in self.marginals.items()
            if method != "exact"
        }

    @property
    def wrong_labels(self) -> dict[str, NDArray[np.int64]]:
        """(n,) for each method: number of cells whose most probable class isn't that of the most likely labelling."""
        return {m: (found.argmax(axis=1) != self.labelling).sum(axis=1) for m, found in self.marginals.items()}


def coupling_sweep(
    couplings: Sequence[float] = COUPLINGS, unary: NDArray | None = None, values: NDArray | None = None
) -> CouplingSweep:
    """Compare exact inference with every approximation, one coupling after the other.

    Parameters
    ----------
    couplings : sequence of float
        Weights of the pair term, see `coupled`.
    unary : (C, H, W) float, optional
        phi_u, the unary term; that of `UNDECIDED` when left out.
    values : (4, H, W) float, optional
        Occupancy of each cell; all free when left out.

    Notes
    -----
    Loopy sum-product takes most of the time near the transition, where it converges slowly, or not at all in its fifty
    iterations.

    Examples
    --------
    >>> sweep = coupling_sweep([1.0, 4.0])
    >>> sweep.marginals["exact"][:, 0, 4].round(2), sweep.marginals["fast"][:, 0, 4].round(2)
    (array([0.52, 0.52]), array([0.52, 1.  ]))
    """
    unary = two_classes(UNDECIDED) if unary is None else np.asarray(unary, dtype=np.float64)
    values = all_free(unary.shape[1:]) if values is None else values
    points = [_inferences(unary, values, coupled(coupling)) for coupling in couplings]
    found, labelling, converged = zip(*points, strict=True)
    marginals = {method: np.array([point[method] for point in found], dtype=np.float64) for method in found[0]}
    return CouplingSweep(np.array(couplings, dtype=float), marginals, np.array(labelling), np.array(converged))


def critical_coupling(classes: int, values: NDArray) -> float:
    """Return the coupling above which mean field leaves the uniform distribution, although no cell prefers a class.

    Near the uniform distribution an update multiplies deviations by K / C, with K the matrix of pair weights. They
    grow when its largest eigenvalue exceeds C. By symmetry the exact marginals stay uniform at every coupling.

    Parameters
    ----------
    classes : int
        C, the number of classes. Below the critical coupling, mean field with two classes stays uniform. With more
        classes it may leave the uniform distribution earlier, if it starts far from it.
    values : (4, H, W) float
        Occupancy of each cell.

    Returns
    -------
    float
        The critical value of w_bilateral.

    Examples
    --------
    >>> round(critical_coupling(2, all_free((3, 3))), 3)
    1.298
    """
    return classes / float(np.linalg.eigvalsh(pair_weights(values, coupled(1.0))).max())


def _inferences(unary: NDArray, values: NDArray, params: CrfParams) -> tuple[dict[str, NDArray], list[int], bool]:
    """Return all marginals by method, the most likely labelling, and whether loopy sum-product converged."""
    model = crf_model(unary, values, params)
    loopy = sum_product(model)
    settled = mean_field_graph(model, iterations=200)
    marginals = {
        "exact": exact_marginals(unary, values, params).reshape(len(unary), -1),
        "mean field": _by_cell(model, settled.marginals),
        "naive": mean_field_naive(unary, values, params).reshape(len(unary), -1),
        "fast": mean_field(unary, values, params).reshape(len(unary), -1),
        "loopy": _by_cell(model, loopy.marginals),
    }
    return marginals, list(max_product(model).values()), loopy.converged


def _by_cell(model: GraphicalModel, marginals: Mapping[str, NDArray]) -> NDArray[np.float64]:
    return np.stack([marginals[name] for name in model.names], axis=1)


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

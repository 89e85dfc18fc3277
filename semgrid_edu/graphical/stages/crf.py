"""The dense CRF on a few cells: exact marginals and labelling against mean field and loopy sum-product (eq. (3), (4)).

The pair weights are the package's own. At the default weights one cell alone hardly decides anything; mean field and
loopy sum-product then turn a slight majority into near certainty, while the exact marginals stay undecided.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import CrfParams, mean_field, mean_field_naive, pair_weights, unary_from_probability
from semgrid_edu.graphical.exact import eliminate, max_product
from semgrid_edu.graphical.factor import Factor
from semgrid_edu.graphical.mean_field import mean_field_graph
from semgrid_edu.graphical.messages import sum_product
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.stages.stage_graph import CutEdge, StageGraph
from semgrid_edu.occupancy import N_STATES, State

UNDECIDED = np.array([[0.6, 0.4, 0.6], [0.4, 0.52, 0.4], [0.6, 0.4, 0.6]])
"""The network's probability of class 0: four cells vote for it, four against it, and the centre leans towards it."""

COUPLINGS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0)
"""From no pair term to the package's default."""

CUT = (
    CutEdge(
        "x1 - x2",
        "Mean field lets each cell hear the mean of the others, not what they would do if it changed: beyond a coupling "
        "of about 1.3 it picks a side, 0.999 for class 0 at the default weights, where 0.52 is right.",
    ),
)
"""What the package's inference leaves out of the model; every pair has such an edge."""


def coupled(coupling: float) -> CrfParams:
    """Return the package's parameters with both pair weights scaled, in their default ratio of 4 to 3.

    Parameters
    ----------
    coupling : float
        w_bilateral: 0 for no pair term, 4 for the package's default.

    Returns
    -------
    CrfParams
    """
    default = CrfParams()
    return CrfParams(w_bilateral=coupling, w_spatial=coupling * default.w_spatial / default.w_bilateral)


def two_classes(probability: ArrayLike) -> NDArray[np.float64]:
    """Return the unary term of two classes.

    Parameters
    ----------
    probability : (H, W) float
        Of class 0.

    Returns
    -------
    (2, H, W) float64
        phi_u of eq. (3).
    """
    probability = np.asarray(probability, dtype=np.float64)
    return unary_from_probability(np.stack([probability, 1 - probability]))


def all_free(shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return occupancy values with which every pair of cells talks: all of them certainly free.

    Parameters
    ----------
    shape : (int, int)
        H, W.

    Returns
    -------
    (4, H, W) float64
    """
    values = np.zeros((N_STATES, *shape))
    values[State.FREE] = 1
    return values


def crf_model(unary: NDArray, values: NDArray, params: CrfParams) -> GraphicalModel:
    """Build the CRF as a product of factors: P(x) = exp(-E(x)) / Z, with the energy of eq. (3) and (4).

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        For the pair weights.

    Returns
    -------
    GraphicalModel
        Undirected, over x1, x2, ..., cells counted row by row: a factor exp(-phi_u) per cell, and one per pair that
        is exp(-k_ij) where the two labels differ and 1 where they agree.
    """
    cells, weights = unary.reshape(len(unary), -1).T, pair_weights(values, params)
    names, differ = _names(len(cells)), 1 - np.eye(len(unary))
    own = [Factor(name, np.exp(-phi)) for name, phi in zip(names, cells, strict=True)]
    pairs = combinations(range(len(cells)), 2)
    return GraphicalModel([*own, *(Factor((names[i], names[j]), np.exp(-weights[i, j] * differ)) for i, j in pairs)])


def exact_marginals(model: GraphicalModel) -> NDArray[np.float64]:
    """Return the exact distribution of every cell of a CRF.

    Parameters
    ----------
    model : GraphicalModel
        Over N cells of C classes, from `crf_model`. Every cell is coupled to every other, so no order of elimination
        avoids the table of all C^N labellings; it may have 10^7 entries.

    Returns
    -------
    (C, N) float64
    """
    joint = eliminate(model, model.names).normalised().table
    cells = range(joint.ndim)
    return np.stack([joint.sum(axis=tuple(other for other in cells if other != cell)) for cell in cells], axis=1)


@dataclass(frozen=True, eq=False)
class CouplingSweep:
    """What each way of inference makes of the CRF as the pair weight grows.

    Parameters
    ----------
    couplings : (n,) float64
        w_bilateral.
    marginals : dict of str to (n, C, N) float64
        By method: "exact", "mean field" (to convergence, one cell after the other), "naive" and "fast" (the
        package's two, ten updates), "loopy" (sum-product).
    labelling : (n, N) int64
        The most likely labelling of all cells, exactly.
    converged : (n,) bool
        Whether loopy sum-product did.
    """

    couplings: NDArray[np.float64]
    marginals: Mapping[str, NDArray[np.float64]]
    labelling: NDArray[np.int64]
    converged: NDArray[np.bool_]

    @property
    def errors(self) -> dict[str, NDArray[np.float64]]:
        """By approximate method, (n,): the largest total variation of a cell's distribution from the exact one."""
        exact = self.marginals["exact"]
        return {
            method: np.abs(found - exact).sum(axis=1).max(axis=1) / 2
            for method, found in self.marginals.items()
            if method != "exact"
        }

    @property
    def wrong_labels(self) -> dict[str, NDArray[np.int64]]:
        """By method, (n,): in how many cells its most probable class isn't that of the most likely labelling."""
        return {m: (found.argmax(axis=1) != self.labelling).sum(axis=1) for m, found in self.marginals.items()}


def coupling_sweep(
    couplings: Sequence[float] = COUPLINGS, unary: NDArray | None = None, values: NDArray | None = None
) -> CouplingSweep:
    """Compare exact inference with every approximation, one coupling after the other.

    Parameters
    ----------
    couplings : sequence of float
        See `coupled`.
    unary : (C, H, W) float, optional
        phi_u; that of `UNDECIDED` when left out.
    values : (4, H, W) float, optional
        Occupancy of each cell; all free when left out.

    Returns
    -------
    CouplingSweep

    Examples
    --------
    >>> sweep = coupling_sweep([1.0, 4.0])
    >>> sweep.marginals["exact"][:, 0, 4].round(2), sweep.marginals["fast"][:, 0, 4].round(2)
    (array([0.52, 0.52]), array([0.54, 1.  ]))
    """
    unary = two_classes(UNDECIDED) if unary is None else np.asarray(unary, dtype=np.float64)
    values = all_free(unary.shape[1:]) if values is None else values
    points = [_inferences(unary, values, coupled(coupling)) for coupling in couplings]
    found, labelling, converged = zip(*points, strict=True)
    marginals = {method: np.array([point[method] for point in found]) for method in found[0]}
    return CouplingSweep(np.array(couplings, dtype=float), marginals, np.array(labelling), np.array(converged))


def critical_coupling(classes: int, values: NDArray) -> float:
    """Return the coupling beyond which mean field leaves the uniform distribution though no cell prefers a class.

    Near the uniform distribution an update multiplies deviations by K / C, with K the matrix of pair weights. They
    grow when its largest eigenvalue exceeds C. By symmetry the exact marginals stay uniform at every coupling.

    Parameters
    ----------
    classes : int
        C. With two classes mean field stays uniform below; with more it may leave earlier, from a start far away.
    values : (4, H, W) float
        Occupancy of each cell.

    Returns
    -------
    float

    Examples
    --------
    >>> round(critical_coupling(2, all_free((3, 3))), 3)
    1.298
    """
    return classes / float(np.linalg.eigvalsh(pair_weights(values, coupled(1.0))).max())


def crf_stage(coupling: float = 4.0, unary: NDArray | None = None, values: NDArray | None = None) -> StageGraph:
    """Return the graph of a fully connected CRF: a factor for each cell and one for each pair of cells.

    Parameters
    ----------
    coupling : float
        See `coupled`.
    unary : (C, H, W) float, optional
        phi_u; that of `UNDECIDED`, 3 x 3 cells, when left out.
    values : (4, H, W) float, optional
        Occupancy of each cell; all free when left out.

    Returns
    -------
    StageGraph
        Variables as in `crf_model`, drawn on a circle, so that every pair has a line of its own.
    """
    unary = two_classes(UNDECIDED) if unary is None else unary
    values = all_free(unary.shape[1:]) if values is None else values
    model = crf_model(unary, values, coupled(coupling))
    return StageGraph("CRF: every cell with every other", model, positions=_circle(model), cut=CUT)


def _inferences(unary: NDArray, values: NDArray, params: CrfParams) -> tuple[dict[str, NDArray], list[int], bool]:
    """Return all marginals by method, the most likely labelling, and whether loopy sum-product converged."""
    model = crf_model(unary, values, params)
    loopy, settled = sum_product(model, iterations=100), mean_field_graph(model, iterations=200)
    marginals = {
        "exact": exact_marginals(model),
        "mean field": _by_cell(model, settled.marginals),
        "naive": mean_field_naive(unary, values, params).reshape(len(unary), -1),
        "fast": mean_field(unary, values, params).reshape(len(unary), -1),
        "loopy": _by_cell(model, loopy.marginals),
    }
    return marginals, list(max_product(model).values()), loopy.converged


def _by_cell(model: GraphicalModel, marginals: Mapping[str, NDArray]) -> NDArray[np.float64]:
    return np.stack([marginals[name] for name in model.names], axis=1)


def _names(count: int) -> list[str]:
    return [f"x{number}" for number in range(1, count + 1)]


def _circle(model: GraphicalModel) -> dict[str, tuple[float, float]]:
    """Place cells on a circle, 1 apart, and each one's own factor outside it."""

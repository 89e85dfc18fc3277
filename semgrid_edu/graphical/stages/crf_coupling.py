"""Exact inference in the dense CRF against mean field and loopy sum-product, as the coupling grows (eq. (3), (4)).

As the pair weights grow, all cells take the same label, but which of the two classes that is stays open: the exact
probability of class 0 in the centre of `UNDECIDED` is 0.52 at each of the `COUPLINGS`. Mean field and loopy sum-product
agree with that up to a coupling of 1. At 2 they say 0.94 and 0.92, and at 4 both say 0.998: in between lies a phase
transition. Below it, at 1, the error of loopy sum-product is about half that of mean field. Just above it, at 1.5, ten
updates have a smaller error than converged mean field, because they stop before it has picked a side.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams, crf_model, exact_marginals, mean_field, mean_field_naive, pair_weights
from semgrid_edu.graphical.exact import max_product
from semgrid_edu.graphical.mean_field import mean_field_graph
from semgrid_edu.graphical.messages import sum_product
from semgrid_edu.graphical.model import GraphicalModel
from semgrid_edu.graphical.stages.crf import UNDECIDED, all_free, coupled, two_classes

COUPLINGS = (0.0, 0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 3.0, 4.0)
"""Values of w_bilateral, from no pair term to the package's default."""


@dataclass(frozen=True, eq=False)
class CouplingSweep:
    """What each way of inference makes of the CRF as the pair weight grows.

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
            method: np.abs(found - exact).sum(axis=1).max(axis=1) / 2
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

    Returns
    -------
    CouplingSweep
        Distributions and labellings at each coupling.

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
    """Return the coupling beyond which mean field leaves the uniform distribution, although no cell prefers a class.

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
    loopy, settled = sum_product(model), mean_field_graph(model, iterations=200)
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

"""The neighbours that pulled a cell in the last mean-field update, by the naive formula (eq. (4))."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.crf import CrfParams, mean_field, unary_from_probability
from semgrid_edu.crf.accurate import WindowedGaussian
from semgrid_edu.crf.naive import damping
from semgrid_edu.crf.spatial import SeparableGaussian
from semgrid_edu.errors import ArgumentError


@dataclass(frozen=True, eq=False)
class NeighbourPull:
    """What the CRF's last update did to one cell i.

    Parameters
    ----------
    before, after : (C,) float64
        The cell's distribution in the semantic grid g, and in the refined grid.
    weights : (H, W) float64
        k_ij, the bracket of eq. (4), for each other cell j; 0 for the cell itself.
    neighbours : (C, H, W) float32
        Q_j before the last update.
    settled : (C,) float64
        What the naive formula makes of the cell in the last update. It differs from `after` by as much as the fast
        filters differ from the sum over all pairs.
    """

    before: NDArray[np.float64]
    after: NDArray[np.float64]
    weights: NDArray[np.float64]
    neighbours: NDArray[np.float32]
    settled: NDArray[np.float64]

    @property
    def messages(self) -> NDArray[np.float64]:
        """(C,): sum_j k_ij Q_j(l), what all neighbours together add to the logarithm of each class's probability."""
        return np.einsum("hw,chw->c", self.weights, self.neighbours)

    def strongest(self, label: int, number: int = 5) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the neighbours that pull the cell most towards a class.

        Parameters
        ----------
        label : int
            The class, l.
        number : int
            How many neighbours.

        Returns
        -------
        cells : (number, 2) int64
            Their rows and columns, the strongest first.
        pull : (number,) float64
            k_ij Q_j(l) of each: its term of `messages[label]`.
        """
        terms = self.weights * self.neighbours[label]
        best = np.argsort(-terms, axis=None, kind="stable")[:number]
        return np.stack(np.unravel_index(best, terms.shape), axis=-1), terms.ravel()[best]


def neighbour_pull(
    g: NDArray, refined: NDArray, o: NDArray, cell: tuple[int, int], params: CrfParams, iterations: int = 10
) -> NeighbourPull:
    """Repeat the CRF up to its last update, and write that one out for one cell.

    Parameters
    ----------
    g : (C, H, W) float
        The semantic grid: probabilities.
    refined : (C, H, W) float
        What `mean_field` made of it.
    o : (4, H, W) float
        The probabilities of the four states.
    cell : (int, int)
        Row and column of the cell i.
    params : CrfParams
        The parameters of the refinement.
    iterations : int
        The number of its updates, at least 1.

    Returns
    -------
    NeighbourPull
        The weights of all neighbours, what they believed, and the cell before and after.

    Raises
    ------
    ArgumentError
        When there is no update to explain, or an argument isn't what `mean_field` takes.
    """
    if iterations < 1:
        raise ArgumentError("iterations", "at least one update to explain", iterations)
    unary = unary_from_probability(g)
    Q = mean_field(unary, o, params, iterations - 1)
    weights, own = weights_of_cell(o, params, cell)
    log_Q = np.log(np.maximum(Q[:, *cell].astype(np.float64), np.finfo(np.float32).tiny))
    target = np.einsum("hw,chw->c", weights, Q) - unary[:, *cell]
    part = damping(own)
    settled = softmax((1 - part) * log_Q + part * target)
    before, after = (np.asarray(grid[:, *cell], np.float64) for grid in (g, refined))
    return NeighbourPull(before, after, weights, Q, settled)


def weights_of_cell(o: NDArray, params: CrfParams, cell: tuple[int, int]) -> tuple[NDArray[np.float64], float]:
    """Compute the bracket of eq. (4) between one cell and every other: one row of `pair_weights`, for any size of grid.

    Parameters
    ----------
    o : (4, H, W) float
        o_i, the probabilities of the four states.
    params : CrfParams
        Weights, widths and normalisation. The row sums by which the bilateral kernel is normalised are summed over a
        window of four widths sigma_alpha (`WindowedGaussian`), which holds nearly all of them.
    cell : (int, int)
        Row and column of the cell i.

    Returns
    -------
    weights : (H, W) float64
        k_ij for each cell j; 0 for the cell itself, which is no pair with itself.
    own : float
        k_ii, which decides how far an update goes (`damping`).
    """
    apart = sum((index - at) ** 2.0 for index, at in zip(np.indices(o.shape[1:]), cell, strict=True))
    unlike = ((o - o[:, *cell][:, None, None]).astype(np.float64) ** 2).sum(axis=0)
    bilateral = WindowedGaussian.build(o, params).scale.astype(np.float64)
    spatial = SeparableGaussian.build(o.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    of_place = np.outer(spatial.row_scale, spatial.column_scale).astype(np.float64)
    weights = (
        bilateral[cell] * bilateral * np.exp(-0.5 * (apart / params.sigma_alpha**2 + unlike / params.sigma_beta**2))
    )
    weights += of_place[cell] * of_place * np.exp(-0.5 * apart / params.sigma_gamma**2)
    own, weights[cell] = float(weights[cell]), 0
    return weights, own

"""Every pair of cells written out: the kernels of eq. (4), and mean field at once or cell by cell; for small grids."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist
from scipy.special import log_softmax

from semgrid_edu.crf.mean_field import above_best, check_inputs, check_stop, normalise, settled, updates
from semgrid_edu.crf.params import CrfParams
from semgrid_edu.errors import ArgumentError

MAX_CELLS = 10_000
"""The largest grid whose pairs are written out: two matrices of 10,000 x 10,000 numbers are 1.6 GB."""


def kernels(values: ArrayLike, params: CrfParams) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute both kernels of eq. (4), without their weights, between all cells.

    With c the row and column of a cell and o its occupancy, they are

        k1_ij = exp(-|c_i - c_j|^2 / (2 sigma_alpha^2) - |o_i - o_j|^2 / (2 sigma_beta^2))
        k2_ij = exp(-|c_i - c_j|^2 / (2 sigma_gamma^2))

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        The widths.

    Returns
    -------
    bilateral, spatial : (H W, H W) float64
        k1 and k2.
    """
    values = np.asarray(values, dtype=np.float64)
    place = np.indices(values.shape[1:]).reshape(2, -1).T.astype(np.float64)
    occupancy = values.reshape(len(values), -1).T
    both = np.hstack([place / params.sigma_alpha, occupancy / params.sigma_beta])
    alone = place / params.sigma_gamma
    on_both = np.exp(-cdist(both, both, "sqeuclidean") / 2)
    on_place = np.exp(-cdist(alone, alone, "sqeuclidean") / 2)
    return on_both, on_place


def gram_matrix(values: ArrayLike, params: CrfParams) -> NDArray[np.float64]:
    """Compute the bracket of eq. (4) for all pairs of cells, including each cell with itself.

    Gaussians of distances are inner products in some space, so this matrix has no negative eigenvalue, whatever the
    weights, widths and normalisation. `damping` relies on this to keep mean field from oscillating.

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    (H W, H W) float64
        Symmetric and positive semidefinite; equal to `pair_weights` except on the diagonal.

    Raises
    ------
    ArgumentError
        When `values` has another shape or isn't finite, or the grid has more than `MAX_CELLS` cells.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 3:
        raise ArgumentError("values", "shape (4, H, W)", f"shape {values.shape}")
    if not np.isfinite(values).all():
        raise ArgumentError("values", "probabilities", "NaN or infinity")
    if values[0].size > MAX_CELLS:
        raise ArgumentError("values", f"at most {MAX_CELLS} cells; mean_field takes more", values[0].size)
    bilateral, spatial = kernels(values, params)
    if params.normalization == "symmetric":
        normalise(bilateral)
        normalise(spatial)
    bilateral *= params.w_bilateral  # in place, because these matrices may be large
    spatial *= params.w_spatial
    bilateral += spatial
    return bilateral


def pair_weights(values: ArrayLike, params: CrfParams) -> NDArray[np.float64]:
    """Compute the bracket of eq. (4) for every pair of cells. Parameters are those of `gram_matrix`, and so are errors.

    Returns
    -------
    (H W, H W) float64
        The cost of different labels in two cells, counted row by row. Zero on the diagonal, because a cell forms no
        pair with itself.
    """
    weights = gram_matrix(values, params)
    np.fill_diagonal(weights, 0)
    return weights


def mean_field_naive(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10, tolerance: float = 0.0
) -> NDArray[np.float64]:
    """Approximate the CRF's marginals by mean field, every pair of cells written out (eq. (3), (4)).

    Among all distributions with independent cells, mean field looks for the one closest to exp(-E(x)) / Z by minimising
    the free energy (`free_energy`). At a minimum, with k_ij the bracket of eq. (4), each cell satisfies

        Q_i(l) = exp(-phi_u(l) - sum_{j != i} k_ij (1 - Q_j(l))) / Z_i

    All cells are updated at once, starting from Q_i(l) = exp(-phi_u(l)) / Z_i, as in Kraehenbuehl and Koltun 2011,
    algorithm 1. They take the right-hand side as the new Q_i; here log Q_i moves only part of the way to it (see
    `damping`), so that no update raises the free energy. Without damping, two cells that attract each other strongly
    but have different labels swap them for ever.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weights, widths and normalisation.
    iterations : int
        The largest number of updates of all cells. With the default parameters nearly all labels have settled after
        ten, although the probabilities of some cells still change.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float64
        Q, the distribution over classes in each cell.

    Raises
    ------
    ArgumentError
        When shapes don't fit, numbers aren't what they should be, or the grid has more than `MAX_CELLS` cells.
    """
    check_stop(iterations, tolerance)
    return settled(mean_field_updates(unary, values, params), iterations, tolerance)


def mean_field_updates(unary: ArrayLike, values: ArrayLike, params: CrfParams) -> Iterator[NDArray[np.float64]]:
    """Yield the initial Q of `mean_field_naive` and the Q after each update, without end.

    Parameters are those of `mean_field_naive`.

    Yields
    ------
    (C, H, W) float64
        Q.

    Examples
    --------
    Two cells attract each other and disagree. The free energy, at first and after each update:

    >>> from semgrid_edu.crf import free_energy
    >>> unary, values = np.array([[[0.0, 2.0]], [[1.0, 0.0]]]), np.full((4, 1, 2), 0.25)
    >>> updates = mean_field_updates(unary, values, CrfParams())
    >>> [round(free_energy(next(updates), unary, values, CrfParams()), 2) for _ in range(4)]
    [1.89, 1.44, 1.31, 1.19]
    """
    unary, values = check_inputs(unary, values)
    weights = gram_matrix(values, params)
    self_coupling = np.diag(weights).copy()
    np.fill_diagonal(weights, 0)  # a cell forms no pair with itself
    return updates(unary, lambda Q: (1 - Q) @ weights, self_coupling)


def mean_field_sequential(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10
) -> NDArray[np.float64]:
    """Approximate the CRF's marginals by mean field, one cell after the other.

    Each update minimises the free energy over the distribution of one cell, so it can't raise it, and needs no damping.
    But the cells can't be updated in parallel. Parameters are those of `mean_field_naive`, and so are errors.

    Returns
    -------
    (C, H, W) float64
        Q, the distribution over classes in each cell.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations)
    phi = above_best(unary.astype(np.float64))
    weights = pair_weights(values, params)
    log_Q = log_softmax(-phi, axis=0)
    for _ in range(iterations):
        for i in range(phi.shape[1]):
            # Cells before i have been updated in this sweep already, and count with their new distributions.
            disagreement = (1 - np.exp(log_Q)) @ weights[i]
            log_Q[:, i] = log_softmax(-phi[:, i] - disagreement)
    return np.exp(log_Q).reshape(unary.shape)

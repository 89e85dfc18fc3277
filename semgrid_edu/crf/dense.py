"""The CRF written out: every pair of cells, its energy, and mean field by hand (eq. (3), (4)); for small grids."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist
from scipy.special import softmax

from semgrid_edu.crf.params import CrfParams, check_inputs, check_iterations
from semgrid_edu.errors import ArgumentError

MAX_CELLS = 10_000
"""The largest grid whose pairs are written out: two matrices of 10,000 x 10,000 numbers are 1.6 GB."""


def pair_weights(values: ArrayLike, params: CrfParams) -> NDArray[np.float64]:
    """Compute the bracket of eq. (4) for every pair of cells.

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    (H W, H W) float64
        The cost of two cells having different labels; cells are counted row by row. Zero on the diagonal, since a cell
        is no pair with itself.

    Raises
    ------
    ArgumentError
        When `values` has another shape or the grid more than `MAX_CELLS` cells.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 3:
        raise ArgumentError("values", "shape (4, H, W)", f"shape {values.shape}")
    _, height, width = values.shape
    if height * width > MAX_CELLS:
        raise ArgumentError("values", f"at most {MAX_CELLS} cells; mean_field takes more", height * width)
    place = np.indices((height, width)).reshape(2, -1).T.astype(np.float64)
    state = values.reshape(len(values), -1).T
    bilateral = np.hstack([place / params.sigma_alpha, state / params.sigma_beta])
    weights = params.w_bilateral * _gaussian(bilateral, params.normalization)
    weights += params.w_spatial * _gaussian(place / params.sigma_gamma, params.normalization)
    np.fill_diagonal(weights, 0)
    return weights


def _gaussian(features: NDArray, normalization: str) -> NDArray[np.float64]:
    """Return exp(-|f_i - f_j|^2 / 2) for all pairs of the (N, d) features, normalised; (N, N)."""
    kernel = np.exp(-0.5 * cdist(features, features, "sqeuclidean"))
    if normalization == "symmetric":
        root = np.sqrt(kernel.sum(axis=1))
        kernel /= root[:, None]
        kernel /= root
    return kernel


def energy(labels: ArrayLike, unary: ArrayLike, values: ArrayLike, params: CrfParams) -> float:
    """Compute the energy of a labelling, E(x) of eq. (3) with the pair term of eq. (4).

    The pair term carries `params.normalization`, so this is the energy whose mean field `mean_field_naive` finds; it
    is eq. (4) as printed with "none".

    Parameters
    ----------
    labels : (H, W) int
        x_i, the class of each cell.
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    float
        E(x): the cells' unary terms, plus a pair weight for each pair of cells (once) with different labels.

    Raises
    ------
    ArgumentError
        When shapes don't fit, a label is no class, or the grid has more than `MAX_CELLS` cells.

    Examples
    --------
    Two neighbouring cells in the same state, and only the spatial kernel: the cost of a border between them is
    w2 exp(-1 / (2 sigma_gamma^2)).

    >>> values = np.full((4, 1, 2), 0.25)
    >>> params = CrfParams(w_bilateral=0, w_spatial=3, sigma_gamma=1, normalization="none")
    >>> round(energy([[0, 1]], np.zeros((2, 1, 2)), values, params), 3)
    1.82
    """
    unary, values = check_inputs(unary, values)
    labels = np.asarray(labels)
    if labels.shape != unary.shape[1:] or labels.dtype.kind not in "iu":
        raise ArgumentError("labels", f"integers of shape {unary.shape[1:]}", f"{labels.dtype} of {labels.shape}")
    if labels.min() < 0 or labels.max() >= len(unary):
        raise ArgumentError("labels", f"classes 0 to {len(unary) - 1}", f"{labels.min()} to {labels.max()}")
    own = np.take_along_axis(unary, labels[None].astype(np.int64), axis=0).sum()
    x = labels.ravel()
    differ = x[:, None] != x  # mu(x_i, x_j)
    return float(own + np.triu(pair_weights(values, params) * differ).sum())


def mean_field_naive(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10
) -> NDArray[np.float64]:
    """Approximate the CRF's marginals by mean field, every pair of cells written out (eq. (3), (4)).

    Among all distributions in which cells are independent, mean field looks for the one closest to exp(-E(x)) / Z.
    Each cell's share of it must satisfy, with k_ij the bracket of eq. (4),

        Q_i(l) = exp(-phi_u(l) - sum_{j != i} k_ij (1 - Q_j(l))) / Z_i

    which is iterated from Q_i(l) = exp(-phi_u(l)) / Z_i, all cells at once (Kraehenbuehl and Koltun 2011, algorithm 1).
    If the cells were updated one after the other, no update could raise the free energy. Updating all at once usually
    lowers it as well, but two cells that strongly attract each other can swap their labels for ever.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weights, widths and normalisation.
    iterations : int
        Number of updates of all cells at once. After ten the labels have settled; probabilities of single cells still
        change later.

    Returns
    -------
    (C, H, W) float64
        Q, the distribution over classes in each cell.

    Raises
    ------
    ArgumentError
        When shapes don't fit, numbers aren't what they should be, or the grid has more than `MAX_CELLS` cells.
    """
    unary, values = check_inputs(unary, values)
    check_iterations(iterations)
    weights = pair_weights(values, params)
    phi = unary.reshape(len(unary), -1)
    Q = softmax(-phi, axis=0)
    for _ in range(iterations):
        disagreement = (1 - Q) @ weights
        Q = softmax(-phi - disagreement, axis=0)
    return Q.reshape(unary.shape)

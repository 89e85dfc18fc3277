"""The kernels of eq. (4): how strongly two cells influence each other, by their distance in place and occupancy."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist

from semgrid_edu.crf.params import CrfParams
from semgrid_edu.errors import ArgumentError

MAX_CELLS = 10_000
"""The largest grid whose pairs are written out: two matrices of 10,000 x 10,000 numbers are 1.6 GB."""


def gaussian(squared_distance: NDArray) -> NDArray:
    """Return exp(-d^2 / 2), the Gaussian of eq. (4), for squared distances d^2 in units of its width.

    Parameters
    ----------
    squared_distance : (...) float
        d^2 of each pair of cells.

    Returns
    -------
    (...) float
        1 for two cells at the same place.
    """
    return np.exp(-0.5 * squared_distance)


def kernels(
    values: ArrayLike, params: CrfParams, cells: slice | NDArray = slice(None)
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute both kernels of eq. (4), without their weights, between some cells i and all cells j.

    With c the row and column of a cell and o its occupancy, they are

        k1_ij = exp(-|c_i - c_j|^2 / (2 sigma_alpha^2) - |o_i - o_j|^2 / (2 sigma_beta^2))
        k2_ij = exp(-|c_i - c_j|^2 / (2 sigma_gamma^2))

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        The widths.
    cells : slice or (n,) int
        The cells i, counted row by row; all of them when left out.

    Returns
    -------
    bilateral, spatial : (n, H W) float64
        k1 and k2.
    """
    values = np.asarray(values, dtype=np.float64)
    place = np.indices(values.shape[1:]).reshape(2, -1).T.astype(np.float64)
    occupancy = values.reshape(len(values), -1).T
    both = np.hstack([place / params.sigma_alpha, occupancy / params.sigma_beta])
    alone = place / params.sigma_gamma
    bilateral, spatial = (gaussian(cdist(features[cells], features, "sqeuclidean")) for features in (both, alone))
    return bilateral, spatial


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


def normalise(kernel: NDArray[np.float64]) -> None:
    """Replace K by D^-1/2 K D^-1/2, in place, where D holds its row sums.

    Parameters
    ----------
    kernel : (N, N) float64
        K; overwritten.
    """
    root = np.sqrt(kernel.sum(axis=1))
    kernel /= root[:, None]
    kernel /= root


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

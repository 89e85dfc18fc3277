"""Mean field on the whole grid: eq. (3), (4) with filters in place of the sum over all pairs.

The spatial kernel is a separable Gaussian, one pass along rows and one along columns; the bilateral kernel is a
lattice.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf.kernel import gaussian, normalise
from semgrid_edu.crf.lattice import PermutohedralLattice
from semgrid_edu.crf.naive import settled, updates
from semgrid_edu.crf.params import NARROWEST, CrfParams, check_inputs, check_stop
from semgrid_edu.errors import check_whole


@dataclass(frozen=True, eq=False)
class SeparableGaussian:
    """Sums over all cells of a grid, weighted by ``exp(-|c_i - c_j|^2 / (2 sigma^2))``.

    ``exp(-(a^2 + b^2)) = exp(-a^2) exp(-b^2)``, so the kernel between cells is a kernel between rows times a kernel
    between columns. Its row sums factorise too, so each axis is normalised separately.

    Parameters
    ----------
    rows, columns : (H, H), (W, W) float64
        The kernel between rows, which includes the weight, and between columns.
    """

    rows: NDArray[np.float64]
    columns: NDArray[np.float64]

    @classmethod
    def build(cls, shape: tuple[int, int], sigma: float, weight: float, normalization: str) -> "SeparableGaussian":
        """Compute the kernel of both axes.

        Parameters
        ----------
        shape : (int, int)
            H and W, the number of rows and columns of the grid.
        sigma : float
            Width of the Gaussian, cells.
        weight : float
            Factor of the whole kernel.
        normalization : {"symmetric", "none"}
            How the kernel is normalised, see `CrfParams`.
        """
        rows, columns = (_between(size, max(sigma, NARROWEST)) for size in shape)
        if normalization == "symmetric":
            normalise(rows)
            normalise(columns)
        return cls(weight * rows, columns)

    @property
    def diagonal(self) -> NDArray[np.float64]:
        """k_ii: how much of its value each cell gets back, (H W,)."""
        return np.outer(np.diag(self.rows), np.diag(self.columns)).ravel()

    def __call__(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return sum_j k_ij values_j, the cell itself included; one row per cell, (H W, K)."""
        height, width = len(self.rows), len(self.columns)
        along_columns = self.rows @ values.reshape(height, -1)  # each row of the grid, with all its values, is a vector
        along_rows = self.columns @ along_columns.reshape(height, width, -1)
        return along_rows.reshape(values.shape)


def _between(size: int, sigma: float) -> NDArray[np.float64]:
    """Return the Gaussian between all cells of one axis, (size, size)."""
    place = np.arange(size) / sigma
    return gaussian((place[:, None] - place) ** 2)


_ZERO_SUM_STATES = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]) / 2
"""An orthonormal basis of the space orthogonal to (1, 1, 1, 1). The four probabilities sum to one, so three numbers in
this basis preserve the distance between two cells' states."""


def mean_field(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10, tolerance: float = 0.0, pad: int = 0
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field with filters (eq. (3), (4)): the updates of `mean_field_naive`.

    The sum over all pairs becomes two filters. The spatial one is exact (`SeparableGaussian`). The bilateral one is
    the permutohedral lattice, whose kernel is only nearly Gaussian. Filters include the cell itself, which forms no
    pair, so its own contribution is subtracted. The other Parameters are those of `mean_field_naive`, and so are
    errors, but the grid may be of any size.

    Parameters
    ----------
    pad : int
        Number of cells by which the border is padded (with its own values) before the CRF; cut off afterwards. At the
        edge of the grid a cell has neighbours on one side only; a pad of 8 recovers sidewalks at the edge of real
        streets. => If states differ

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations, tolerance)
    unary, values = (with_border(maps, pad) for maps in (unary, values))
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    bilateral = bilateral_kernel(values, params)
    self_coupling = bilateral.diagonal + spatial.diagonal

    # The cost of disagreeing, sum_j k_ij (1 - Q_j(l)), differs from this negative reward of agreeing by sum_j k_ij,
    # which is the same for all classes and cancels in the soft-max.
    def disagreement(Q: NDArray) -> NDArray:
        return self_coupling * Q - (bilateral(Q.T) + spatial(Q.T)).T

    Q = settled(updates(unary, disagreement, self_coupling), iterations, tolerance)
    return without_border(Q, pad).astype(np.float32)


def bilateral_kernel(values: NDArray, params: CrfParams) -> PermutohedralLattice:
    """Build the first kernel of eq. (4), on place and occupancy, including its weight and normalisation.

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weight, widths and normalisation.

    Returns
    -------
    PermutohedralLattice
        A lattice around H W points in five dimensions: two for the place, three for the state.

    Raises
    ------
    ArgumentError
        If the states differ, or the grid extends, by more kernel widths than the lattice can count.
    """
    lattice = PermutohedralLattice.build(bilateral_features(values, params))
    degree = np.ones(values[0].size)
    if params.normalization == "symmetric":
        degree = lattice(np.ones((values[0].size, 1)))[:, 0]
    return lattice.scaled(np.sqrt(params.w_bilateral / degree))


def bilateral_features(values: NDArray, params: CrfParams) -> NDArray[np.float64]:
    """Return place and occupancy of each cell in units of the bilateral kernel's widths.

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        The widths. If the kernel has weight zero, the features don't matter, and all are zero.

    Returns
    -------
    (H W, 5) float64
        Row, column, and three numbers for the state, with the same distances as the four probabilities.
    """
    place = np.indices(values.shape[1:]) / max(params.sigma_alpha, NARROWEST)
    state = np.einsum("ks,shw->khw", _ZERO_SUM_STATES, values) / params.sigma_beta
    features = np.concatenate([place, state]) * (params.w_bilateral > 0)
    return features.reshape(5, -1).T


def with_border(maps: NDArray, pad: int) -> NDArray:
    """Repeat the cells at the border outward.

    Parameters
    ----------
    maps : (K, H, W) float
        K numbers for each cell.
    pad : int
        Number of cells to add on each side.

    Returns
    -------
    (K, H + 2 pad, W + 2 pad) float
        The same maps with a border.
    """
    check_whole(pad=pad)
    return np.pad(maps, ((0, 0), (pad, pad), (pad, pad)), mode="edge") if pad else maps


def without_border(maps: NDArray, pad: int) -> NDArray:
    """Cut off what `with_border` added.

    Parameters
    ----------
    maps : (K, H + 2 pad, W + 2 pad) float
        K numbers for each cell.
    pad : int
        Number of cells to cut off on each side.

    Returns
    -------
    (K, H, W) float
        The maps without their border.
    """
    _, height, width = maps.shape
    return maps[:, pad : height - pad, pad : width - pad]

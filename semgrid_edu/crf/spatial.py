"""The spatial kernel of eq. (4), exact and cheap: on a grid a Gaussian of place is one of rows times one of columns."""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray


@dataclass(frozen=True)
class SeparableGaussian:
    """Sums over all cells of a grid, weighed by exp(-|c_i - c_j|^2 / (2 sigma^2)), as two banded matrix products.

    Parameters
    ----------
    rows : (H, H) float32
        The kernel between rows.
    columns : (W, W) float32
        The kernel between columns.
    reach : int
        Cells farther apart, 5 sigma, are left out: less than a millionth of the weight.
    """

    rows: NDArray[np.float32]
    columns: NDArray[np.float32]
    reach: int

    @classmethod
    def build(cls, shape: tuple[int, int], sigma: float, weight: float, normalization: str) -> "SeparableGaussian":
        """Compute the two matrices, with weight and normalisation folded in.

        The row sums of the whole kernel are products of the row sums of the two, so each is normalised by itself.

        Parameters
        ----------
        shape : (int, int)
            H and W.
        sigma : float
            Width, in cells.
        weight : float
            Factor of the whole kernel.
        normalization : {"symmetric", "none"}
            See `CrfParams`.

        Returns
        -------
        SeparableGaussian
            Ready to filter.
        """
        rows, columns = (_gaussian(size, sigma, normalization) for size in shape)
        return cls((weight * rows).astype(np.float32), columns.astype(np.float32), int(np.ceil(5 * sigma)))

    @property
    def diagonal(self) -> NDArray[np.float32]:
        """What each cell gets back of its own value, (H W,)."""
        return np.outer(np.diag(self.rows), np.diag(self.columns)).ravel()

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Filter values on the grid.

        Parameters
        ----------
        values : (H W, K) float32
            One row a cell, cells counted row by row.

        Returns
        -------
        (H W, K) float32
            sum_j k_ij values_j, the cell itself included.
        """
        grid = values.reshape(len(self.rows), len(self.columns), -1)
        return _filter(self.rows, self.columns, self.reach, grid).reshape(values.shape)


def _gaussian(size: int, sigma: float, normalization: str) -> NDArray[np.float64]:
    """Return the (size, size) kernel of one axis, normalised."""
    place = np.arange(size) / sigma
    kernel = np.exp(-0.5 * np.subtract.outer(place, place) ** 2)
    if normalization == "symmetric":
        root = np.sqrt(kernel.sum(axis=1))
        kernel /= np.outer(root, root)
    return kernel


# A loop, though BLAS has matrix products: its threads and numba's would fight for the same cores.
@njit(cache=True, parallel=True, fastmath=True)
def _filter(rows, columns, reach, values):
    """Multiply (H, W, K) values by both matrices, row by row of the result."""
    height, width, lanes = values.shape
    out = np.zeros_like(values)
    for r in prange(height):
        line = np.zeros((width, lanes), np.float32)
        for s in range(max(r - reach, 0), min(r + reach + 1, height)):
            for c in range(width):
                for k in range(lanes):
                    line[c, k] += rows[r, s] * values[s, c, k]
        for c in range(width):
            for s in range(max(c - reach, 0), min(c + reach + 1, width)):
                for k in range(lanes):
                    out[r, c, k] += columns[c, s] * line[s, k]
    return out

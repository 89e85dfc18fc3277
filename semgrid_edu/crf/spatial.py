"""The spatial kernel of eq. (4), exact and cheap: a Gaussian is one pass along rows and one along columns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf.kernel import gaussian, normalise
from semgrid_edu.crf.params import NARROWEST


@dataclass(frozen=True, eq=False)
class SeparableGaussian:
    """Sums over all cells of a grid, weighted by ``exp(-|c_i - c_j|^2 / (2 sigma^2))``.

    ``exp(-(a^2 + b^2)) = exp(-a^2) exp(-b^2)``, so the kernel between cells is a product of one between rows and one
    between columns. So are its row sums, and each axis is normalised by itself.

    Parameters
    ----------
    rows, columns : (H, H), (W, W) float64
        The kernel between rows, which holds the weight, and between columns.
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
        """k_ii, the share of its own value that each cell gets back, (H W,)."""
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

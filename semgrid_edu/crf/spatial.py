"""The spatial kernel of eq. (4), exact and cheap: on a grid, one convolution along rows and one along columns."""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from semgrid_edu.crf.params import NARROWEST


@dataclass(frozen=True)
class SeparableGaussian:
    """Sums over all cells of a grid, weighted by exp(-|c_i - c_j|^2 / (2 sigma^2)): one convolution along each axis.

    Parameters
    ----------
    taps : (R + 1,) float32
        The Gaussian at distances of 0 to R cells. R is 5 sigma; less than a millionth of the weight lies beyond.
    row_scale, column_scale : (H,), (W,) float32
        Normalisation and weight: k_ij is the Gaussian times both scales of cell i and both scales of cell j.
    """

    taps: NDArray[np.float32]
    row_scale: NDArray[np.float32]
    column_scale: NDArray[np.float32]

    @classmethod
    def build(cls, shape: tuple[int, int], sigma: float, weight: float, normalization: str) -> "SeparableGaussian":
        """Compute the taps, and the scales that hold weight and normalisation.

        The row sums of the whole kernel are products of the row sums of the two axes, so each axis is normalised by
        itself.

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

        Returns
        -------
        SeparableGaussian
            Ready to filter values on such a grid.
        """
        sigma = max(sigma, NARROWEST)
        reach = int(min(np.ceil(5 * sigma), max(shape) - 1))
        taps = np.exp(-0.5 * (np.arange(reach + 1) / sigma) ** 2)
        row_scale, column_scale = np.ones(shape[0]), np.ones(shape[1])
        if normalization == "symmetric":
            row_scale, column_scale = (1 / np.sqrt(_row_sums(size, sigma)) for size in shape)
        row_scale = row_scale * np.sqrt(weight)
        return cls(taps.astype(np.float32), row_scale.astype(np.float32), column_scale.astype(np.float32))

    @property
    def diagonal(self) -> NDArray[np.float32]:
        """k_ii, the share of its own value that each cell gets back, (H W,)."""
        return np.outer(self.row_scale**2, self.column_scale**2).ravel()

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Filter values on the grid.

        Parameters
        ----------
        values : (H W, K) float32
            One row per cell, cells counted row by row.

        Returns
        -------
        (H W, K) float32
            sum_j k_ij values_j, the cell itself included.
        """
        grid = values.reshape(len(self.row_scale), -1)
        scale = np.repeat(self.column_scale, values.shape[1])
        return _convolve(grid, values.shape[1], self.taps, self.row_scale, scale).reshape(values.shape)


def _row_sums(size: int, sigma: float) -> NDArray[np.float64]:
    """Return the row sums of the Gaussian between all cells of one axis, (size,)."""
    place = np.arange(size) / sigma
    return np.exp(-0.5 * np.subtract.outer(place, place) ** 2).sum(axis=1)


# Loops, though BLAS has matrix products: its threads would compete with numba's for the same cores.
@njit(cache=True, parallel=True, fastmath=True)
def _convolve(values, lanes, taps, row_scale, column_scale):
    """Convolve (H, W K) values, K per cell, along both axes; `column_scale` repeats each column's scale K times."""
    out = np.empty_like(values)
    for r in prange(len(values)):
        out[r] = convolved_row(values, r, lanes, taps, row_scale, column_scale)
    return out


@njit(cache=True, fastmath=True, inline="always")
def convolved_row(values, r, lanes, taps, row_scale, column_scale):
    """Compute one row of the filtered grid: add up rows, then what lies left and right in the sum.

    Parameters
    ----------
    values : (H, W K) float32
        K values of each cell.
    r : int
        The row.
    lanes : int
        K.
    taps, row_scale : (R + 1,), (H,) float32
        See `SeparableGaussian`.
    column_scale : (W K,) float32
        The scale of each column, K times each.

    Returns
    -------
    (W K,) float32
        The row.
    """
    height, length = values.shape
    reach = len(taps) - 1
    padded = np.zeros(length + 2 * reach * lanes, np.float32)  # zeros beyond the ends of the row
    row, total = padded[reach * lanes : reach * lanes + length], np.empty(length, np.float32)
    for s in range(max(r - reach, 0), min(r + reach + 1, height)):
        weight = taps[abs(r - s)] * row_scale[s]
        for n in range(length):
            row[n] += weight * values[s, n]
    for n in range(length):
        row[n] *= row_scale[r] * column_scale[n]
        total[n] = taps[0] * row[n]
    for t in range(1, reach + 1):
        left, right = padded[(reach - t) * lanes :], padded[(reach + t) * lanes :]
        for n in range(length):
            total[n] += taps[t] * (left[n] + right[n])
    for n in range(length):
        total[n] *= column_scale[n]
    return total

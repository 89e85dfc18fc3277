"""The spatial kernel of eq. (4), exact and cheap: on a grid, one convolution along rows and one along columns."""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from semgrid_edu.crf.params import NARROWEST
from semgrid_edu.fast.crf import FAST


@dataclass(frozen=True)
class SeparableGaussian:
    """Sums over all cells of a grid, weighted by ``exp(-|c_i - c_j|^2 / (2 sigma^2))``: a convolution per axis.

    Parameters
    ----------
    taps : (R + 1,) float32
        The Gaussian at distances of 0 to R cells. R is 5 sigma, which leaves out less than a millionth of the weight.
    row_scale, column_scale : (H,), (W,) float32
        Normalisation and weight: k_ij is the Gaussian times both scales of cells i and j.
    """

    taps: NDArray[np.float32]
    row_scale: NDArray[np.float32]
    column_scale: NDArray[np.float32]

    @classmethod
    def build(cls, shape: tuple[int, int], sigma: float, weight: float, normalization: str) -> "SeparableGaussian":
        """Compute the taps and the scales, which contain weight and normalisation.

        The row sums of the whole kernel are products of the row sums of the two axes, so each axis is normalised alone.

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
        sigma = max(sigma, NARROWEST)
        reach = int(min(np.ceil(5 * sigma), max(shape) - 1))
        taps = np.exp(-((np.arange(reach + 1) / sigma) ** 2) / 2)
        row_scale = np.ones(shape[0])
        column_scale = np.ones(shape[1])
        if normalization == "symmetric":
            row_scale, column_scale = (1 / np.sqrt(_row_sums(size, sigma)) for size in shape)
        row_scale = row_scale * np.sqrt(weight)
        return cls(taps.astype(np.float32), row_scale.astype(np.float32), column_scale.astype(np.float32))

    @property
    def diagonal(self) -> NDArray[np.float32]:
        """k_ii: how much of its value each cell gets back, (H W,)."""
        return np.outer(self.row_scale**2, self.column_scale**2).ravel()

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return sum_j k_ij values_j, the cell itself included; one row per cell, (H W, K)."""
        out = np.empty(values.shape, np.float32)
        self.filter(values, out)
        return out

    def filter(self, values: NDArray[np.float32], out: NDArray[np.float32]) -> None:
        """Filter values on the grid into an existing array.

        Parameters
        ----------
        values, out : (H W, K) float32
            One row per cell, cells counted row by row; `out` is overwritten.
        """
        grid, filtered = (array.reshape(len(self.row_scale), -1) for array in (np.ascontiguousarray(values), out))
        # A zero tap makes their number even, and zero scales exclude rows beyond the grid. The tap at distance 0 is
        # halved, because the loops add it twice, forward and backward.
        taps = np.append(self.taps, np.zeros(len(self.taps) % 2, np.float32))
        taps[0] /= 2
        row_scale = np.pad(self.row_scale, len(taps))
        column_scale = np.repeat(self.column_scale, values.shape[1])
        _convolve(grid, values.shape[1], taps, row_scale, column_scale, filtered)


def _row_sums(size: int, sigma: float) -> NDArray[np.float64]:
    """Return the row sums of the Gaussian between all cells of one axis, (size,)."""
    to_one_side = np.cumsum(np.exp(-((np.arange(size) / sigma) ** 2) / 2))
    return to_one_side + to_one_side[::-1] - 1


# Loops instead of BLAS's matrix products, because its threads would compete with numba's for the same cores.
@njit(cache=True, parallel=True, fastmath=FAST)
def _convolve(values, lanes, taps, row_scale, column_scale, out):
    """Convolve (H, W K) values, K per cell: add up rows, then the neighbours left and right in the sum.

    The number of taps is even, and the first one is half of what it should be, since it is added forward and backward.
    """
    length = values.shape[1]
    margin = (len(taps) - 1) * lanes
    for r in prange(len(values)):
        padded = np.zeros(length + 2 * margin, np.float32)  # zeros beyond the ends of the row
        row = padded[margin : margin + length]
        _add_rows(values, r, taps, row_scale, row)
        row *= row_scale[len(taps) + r] * column_scale
        out[r] = 0
        _add_neighbours(padded, lanes, taps, out[r])
        out[r] *= column_scale


# Two taps, so four rows, at a time: the sum is read and written half as often.
@njit(cache=True, fastmath=FAST, inline="always")
def _add_rows(values, r, taps, row_scale, total):
    """Add up rows around row r; rows beyond the grid have scale 0."""
    last = len(values) - 1
    middle = len(taps) + r
    for t in range(0, len(taps), 2):
        a = values[max(r - t, 0)]
        b = values[min(r + t, last)]
        c = values[max(r - t - 1, 0)]
        d = values[min(r + t + 1, last)]
        w_a = taps[t] * row_scale[middle - t]
        w_b = taps[t] * row_scale[middle + t]
        w_c = taps[t + 1] * row_scale[middle - t - 1]
        w_d = taps[t + 1] * row_scale[middle + t + 1]
        for n in range(len(total)):
            total[n] = total[n] + w_a * a[n] + w_b * b[n] + w_c * c[n] + w_d * d[n]


@njit(cache=True, fastmath=FAST, inline="always")
def _add_neighbours(padded, lanes, taps, total):
    """Add up the neighbours on the left and right in a padded row."""
    for t in range(0, len(taps), 2):
        left = padded[(len(taps) - 1 - t) * lanes :]
        right = padded[(len(taps) - 1 + t) * lanes :]
        left_2 = padded[(len(taps) - 2 - t) * lanes :]
        right_2 = padded[(len(taps) + t) * lanes :]
        w = taps[t]
        w_2 = taps[t + 1]
        for n in range(len(total)):
            total[n] = total[n] + w * (left[n] + right[n]) + w_2 * (left_2[n] + right_2[n])

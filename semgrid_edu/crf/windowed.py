"""The bilateral kernel of eq. (4), pair by pair: each cell with all cells of a window around it, compiled."""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from semgrid_edu.crf.params import CrfParams

RADIUS = 4.0
"""Reach of the window, in widths `sigma_alpha`: cells further up, down, left or right are left out."""
BLOCK = 16
"""The values of a cell are padded to a multiple of this number: loops of fixed length vectorise."""
_SHARPEST = np.float32(1e15)
"""The largest 1 / sigma_beta: its square still is a float32, and equal states stay equal."""


@dataclass(frozen=True)
class WindowedGaussian:
    """Sums over the cells of a window, weighted by a Gaussian of the distance in place and state.

    Every pair in the window is computed exactly, but for rounding, each time the kernel is applied: nothing grows with
    the number of pairs. What is left out is small. A pair outside the window has less than exp(-radius^2 / 2) of the
    weight of a cell with itself, 0.00034 at the default radius of 4. Where all cells have the same state, all pairs
    outside together have 0.00013 of a cell's row sum. That share can only be larger where a cell differs from its
    surroundings and is like cells beyond the window. Even then they sum to at most 2 pi sigma_alpha^2 * 0.00013, which
    is 0.05 of what the cell would tell itself at a width of 8 cells.

    Parameters
    ----------
    state : (H, 4, W) float32
        o_i in units of sigma_beta, in each row state by state.
    taps : (R + 1,) float32
        The Gaussian at distances of 0 to R cells along one axis; R cells is the reach of the window.
    scale : (H, W) float32
        Normalisation and weight: k_ij is the Gaussian times the scales of both cells.
    """

    state: NDArray[np.float32]
    taps: NDArray[np.float32]
    scale: NDArray[np.float32]

    @classmethod
    def build(cls, values: NDArray, params: CrfParams, radius: float = RADIUS) -> "WindowedGaussian":
        """Compute the taps, and the scales that hold weight and normalisation.

        Parameters
        ----------
        values : (4, H, W) float
            o_i, the occupancy probabilities of each cell.
        params : CrfParams
            Weight, widths and normalisation.
        radius : float
            Reach of the window in widths sigma_alpha; infinite for no window at all.

        Returns
        -------
        WindowedGaussian
            Ready to filter values on this grid.
        """
        _, height, width = values.shape
        reach = int(min(np.ceil(radius * params.sigma_alpha), max(height, width) - 1))
        taps = np.exp(-0.5 * (np.arange(reach + 1) / params.sigma_alpha) ** 2)
        sharpness = min(np.float32(1 / max(params.sigma_beta, 1e-30)), _SHARPEST)
        state = np.ascontiguousarray(values.transpose(1, 0, 2), np.float32) * sharpness
        kernel = cls(state, taps.astype(np.float32), np.ones((height, width), np.float32))
        degree = np.ones((height, width))
        if params.normalization == "symmetric":
            degree = kernel(np.ones((height * width, 1), np.float32)).reshape(height, width).astype(np.float64)
        return replace(kernel, scale=np.sqrt(params.w_bilateral / degree).astype(np.float32))

    @property
    def diagonal(self) -> NDArray[np.float32]:
        """k_ii, the share of its own value that each cell gets back, (H W,)."""
        return self.scale.ravel() ** 2

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Filter values on the grid.

        Parameters
        ----------
        values : (H W, K) float32
            One row per cell, cells counted row by row.

        Returns
        -------
        (H W, K) float32
            sum_j k_ij values_j over the window, the cell itself included.
        """
        columns = values.shape[1]
        padded = np.zeros((*self.scale.shape, -(-columns // BLOCK) * BLOCK), np.float32)
        padded[:, :, :columns] = values.reshape(*self.scale.shape, columns) * self.scale[:, :, None]
        sums = _window_sums(self.state, self.taps, padded)[:, :, :columns] * self.scale[:, :, None]
        return sums.reshape(values.shape)


# Threads share out rows; each cell's sum is computed by one of them, in one order, so their number changes nothing.
@njit(cache=True, parallel=True, fastmath=True)
def _window_sums(state, taps, values):
    """Return the sum over the window of each cell, (H, W, K), of Gaussian times values."""
    height, width, columns = values.shape
    reach, sums = len(taps) - 1, np.zeros((height, width, columns), np.float32)
    for r in prange(height):
        weights, mirrored = np.empty(width, np.float32), np.empty(2 * reach + 1, np.float32)
        for t in range(-reach, reach + 1):
            mirrored[t + reach] = taps[abs(t)]
        for c in range(width):
            first, last = max(c - reach, 0), min(c + reach + 1, width)
            for s in range(max(r - reach, 0), min(r + reach + 1, height)):
                _weigh(
                    state[r, :, c], state[s, :, first:last], taps[abs(r - s)], mirrored[first - c + reach :], weights
                )
                for block in range(0, columns, BLOCK):
                    _add(weights, values[s, first:last, block : block + BLOCK], sums[r, c, block : block + BLOCK])
    return sums


@njit(cache=True, fastmath=True, inline="always")
def _weigh(own, others, tap, taps, weights):
    """Write the Gaussian between one cell and the cells of a stretch of a row."""
    for d in range(others.shape[1]):
        square = np.float32(0)
        for k in range(4):
            difference = others[k, d] - own[k]
            square += difference * difference
        weights[d] = tap * taps[d] * _gaussian(square)


@njit(cache=True, fastmath=True, inline="always")
def _gaussian(square):
    """Return exp(-square / 2) to 6 digits: the 64th power of the series of exp(-square / 128), which vectorises."""
    y = max(-np.float32(1 / 128) * square, np.float32(-1))
    power = np.float32(1 / 120) * y + np.float32(1 / 24)
    power = (power * y + np.float32(1 / 6)) * y + np.float32(1 / 2)
    power = (power * y + np.float32(1)) * y + np.float32(1)
    for _ in range(6):
        power *= power
    return power


@njit(cache=True, fastmath=True, inline="always")
def _add(weights, values, total):
    """Add up one block of values of a stretch of a row, weighted."""
    for d in range(len(values)):
        for k in range(BLOCK):
            total[k] += weights[d] * values[d, k]

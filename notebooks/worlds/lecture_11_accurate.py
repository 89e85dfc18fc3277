"""Mean field with a nearly exact bilateral kernel, pair by pair in a window: lecture 11 asks what the lattice costs.

The loops over the window are compiled, so this needs numba.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import CrfParams, SeparableGaussian
from semgrid_edu.crf.mean_field import check_inputs, check_stop, settled, updates
from semgrid_edu.fast.crf import HALF, exponential

RADIUS = 4.0
"""Reach of the window, in widths `sigma_alpha`: cells further up, down, left or right are left out."""

_SHARPEST = np.float32(1e15)
"""The largest 1 / sigma_beta: its square still is a float32, and equal states stay equal."""


def mean_field_accurate(
    unary: ArrayLike,
    values: ArrayLike,
    params: CrfParams,
    iterations: int = 10,
    tolerance: float = 0.0,
    radius: float = RADIUS,
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field with nearly exact kernels: the updates of `mean_field_naive`.

    Where `mean_field` uses the permutohedral lattice, this computes the bilateral kernel pair by pair in a window
    around each cell (`WindowedGaussian` bounds the error of the window). The time grows with the number of cells times
    the window's size, the memory only with the number of cells. The other Parameters are those of `mean_field_naive`,
    and so are errors, but the grid may be of any size.

    Parameters
    ----------
    radius : float
        Reach of the bilateral window in widths `sigma_alpha`; infinite for all pairs, exact but for rounding.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell; the same bits whatever the number of threads.
    """
    unary, values = check_inputs(unary, values)
    return filtered(unary, params, WindowedGaussian.build(values, params, radius), iterations, tolerance)


def filtered(
    unary: NDArray, params: CrfParams, bilateral: object, iterations: int, tolerance: float
) -> NDArray[np.float32]:
    """Run mean field with a given filter in place of the lattice.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; inf where a class is impossible.
    params : CrfParams
        Weight, width and normalisation of the spatial kernel.
    bilateral : callable with a diagonal
        The bilateral kernel as a filter of float32 values (N, C), its weight and normalisation included; `.diagonal`
        is k_ii, the share of its own value that each cell gets back, (N,).
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.
    """
    check_stop(iterations, tolerance)
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    self_coupling = bilateral.diagonal + spatial.diagonal

    def disagreement(Q: NDArray) -> NDArray:
        return self_coupling * Q - (bilateral(np.ascontiguousarray(Q.T, np.float32)) + spatial(Q.T)).T

    return settled(updates(unary, disagreement, self_coupling), iterations, tolerance).astype(np.float32)


@dataclass(frozen=True)
class WindowedGaussian:
    """Sums over the cells of a window, weighted by a Gaussian of the distance in place and state.

    Every pair in the window is computed exactly, but for rounding, each time the kernel is applied: nothing grows with
    the number of pairs. What is left out is small. A pair outside the window has less than exp(-radius^2 / 2) of the
    weight of a cell with itself, 0.00034 at the default radius of 4. Where all cells have the same state, all pairs
    outside together have 0.00013 of a cell's row sum. That share can only be larger where a cell differs from its
    surroundings and is like cells beyond the window. Even then, for widths of at least a cell, the pairs outside sum to
    at most 2 pi sigma_alpha^2 * 0.00013: at a width of 8 cells, 0.05 of the weight of the cell with itself.

    Parameters
    ----------
    state : (H, 4, W) float32
        o_i in units of sigma_beta.
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
        """
        _, height, width = values.shape
        reach = int(min(np.ceil(radius * params.sigma_alpha), max(height, width) - 1))
        with np.errstate(over="ignore"):  # exp(-inf) is 0, the right limit of a width near 0
            taps = np.exp(-((np.arange(reach + 1) / params.sigma_alpha) ** 2) / 2)
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
        """Return sum_j k_ij values_j over the window, the cell itself included; one row per cell, (H W, K)."""
        height, width = self.scale.shape
        rows = values.reshape(height, width, -1).transpose(0, 2, 1) * self.scale[:, None]
        sums = _window_sums(self.state, self.taps, rows) * self.scale[:, None]
        return sums.transpose(0, 2, 1).reshape(values.shape)


# One thread computes each cell's sum in a fixed order, so the number of threads doesn't change the result.
# The inner loops run along slices of rows, because these vectorise.
@njit(cache=True, parallel=True, fastmath=True)
def _window_sums(state, taps, values):
    """Return for each cell the sum over the window of Gaussian times values; (H, K, W) like the values."""
    height, columns, width = values.shape
    reach, sums = len(taps) - 1, np.zeros(values.shape, np.float32)
    for r in prange(height):
        weights = np.empty(width, np.float32)
        for s in range(max(r - reach, 0), min(r + reach + 1, height)):
            for shift in range(max(-reach, 1 - width), min(reach, width - 1) + 1):
                first, last = max(-shift, 0), min(width - shift, width)
                own, other = _states(state[r], first, last), _states(state[s], first + shift, last + shift)
                _weigh(own, other, taps[abs(r - s)] * taps[abs(shift)], weights[first:last])
                for k in range(columns):
                    _add(weights[first:last], values[s, k, first + shift : last + shift], sums[r, k, first:last])
    return sums


@njit(cache=True)
def _states(rows, first, last):
    """Return the four states of the cells of a stretch of a row."""
    return rows[0, first:last], rows[1, first:last], rows[2, first:last], rows[3, first:last]


@njit(cache=True, fastmath=True)
def _weigh(own, other, tap, weights):
    """Write the Gaussian between each cell of a stretch and a cell of another stretch; `tap` is its part in place."""
    own_free, own_static, own_dynamic, own_unknown = own
    free, static, dynamic, unknown = other
    for c in range(len(weights)):
        square = (free[c] - own_free[c]) ** 2 + (static[c] - own_static[c]) ** 2
        square += (dynamic[c] - own_dynamic[c]) ** 2 + (unknown[c] - own_unknown[c]) ** 2
        weights[c] = tap * exponential(-HALF * square)


@njit(cache=True, fastmath=True)
def _add(weights, values, total):
    """Add weighted values."""
    for c in range(len(total)):
        total[c] += weights[c] * values[c]

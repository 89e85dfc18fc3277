"""Mean field with nearly exact kernels on grids too large for a matrix of all pairs (eq. (3), (4))."""

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_softmax

from semgrid_edu.crf.naive import NEVER, damping
from semgrid_edu.crf.params import CrfParams, check_inputs, check_stop
from semgrid_edu.crf.spatial import SeparableGaussian
from semgrid_edu.crf.windowed import RADIUS, WindowedGaussian


class Kernel(Protocol):
    """A kernel of eq. (4) as a filter: `SeparableGaussian`, `WindowedGaussian` and `PermutohedralLattice` are such.

    Parameters
    ----------
    diagonal : (N,) float32
        k_ii, the share of its own value that each cell gets back.
    """

    diagonal: NDArray[np.float32]

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Filter values.

        Parameters
        ----------
        values : (N, K) float32
            One row per cell.

        Returns
        -------
        (N, K) float32
            sum_j k_ij values_j, the cell itself included.
        """


def mean_field_accurate(
    unary: ArrayLike,
    values: ArrayLike,
    params: CrfParams,
    iterations: int = 10,
    tolerance: float = 0.0,
    radius: float = RADIUS,
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field with nearly exact kernels: the updates of `mean_field_naive`.

    Where `mean_field` asks the permutohedral lattice, this function computes the bilateral kernel pair by pair, in a
    window around each cell (`WindowedGaussian`, which says what the window can cost). The time grows with the number
    of cells times that of cells in a window, the memory with the number of cells alone.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weights, widths and normalisation.
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.
    radius : float
        Reach of the bilateral window in widths `sigma_alpha`; infinite for all pairs, exact but for rounding.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell; the same bits whatever the number of threads.

    Raises
    ------
    ArgumentError
        When shapes don't fit or numbers aren't what they should be.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations, tolerance)
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    updates = filtered_updates(unary, (WindowedGaussian.build(values, params, radius), spatial))
    return settled(updates, iterations, tolerance)


def settled(updates: Iterator[NDArray], iterations: int, tolerance: float) -> NDArray:
    """Take updates until their number is reached or nothing changes any more.

    Parameters
    ----------
    updates : iterator of (C, H, W) float
        Q at first and after each update, such as `mean_field_updates`.
    iterations : int
        The largest number of updates.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float
        The last Q.
    """
    Q = next(updates)
    for _ in range(iterations):
        before, Q = Q, next(updates)
        if np.abs(Q - before).max() <= tolerance:
            break
    return Q


def filtered_updates(unary: NDArray, kernels: Sequence[Kernel]) -> Iterator[NDArray[np.float32]]:
    """Yield Q at first and after each update, without end, as `mean_field_updates` does, with filters for the sums.

    The cost of disagreeing differs from the negative reward of agreeing only by a number that is the same for all
    classes, which the soft-max cancels; and filters include the cell itself, which is no pair.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    kernels : sequence of Kernel
        The kernels of eq. (4), with their weights and normalisation; one is enough to try it alone.

    Yields
    ------
    (C, H, W) float32
        Q, the distribution over classes in each cell.
    """
    phi = np.minimum(unary - unary.min(axis=0), NEVER).reshape(len(unary), -1).T.astype(np.float32)
    own = np.sum([kernel.diagonal for kernel in kernels], axis=0, dtype=np.float32)[:, None]
    part, logits = damping(own), log_softmax(-phi, axis=1)
    while True:
        Q = np.exp(logits)
        yield np.ascontiguousarray(Q.T).reshape(unary.shape)
        agreement = sum(kernel(Q) for kernel in kernels) - own * Q
        logits = log_softmax(logits + part * (agreement - phi - logits), axis=1)

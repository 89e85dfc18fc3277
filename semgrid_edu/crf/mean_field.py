"""Mean field on the whole grid in milliseconds: eq. (3), (4) with filters in place of the sum over all pairs."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf.lattice import PermutohedralLattice
from semgrid_edu.crf.naive import NEVER, damping
from semgrid_edu.crf.params import CrfParams, check_inputs, check_stop
from semgrid_edu.crf.spatial import SeparableGaussian

LANES = 16
"""The class axis is padded to a multiple of this number: 16 floats fill a cache line, and loops over them vectorise."""

_ZERO_SUM_STATES = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]) / 2
"""An orthonormal basis of the space orthogonal to (1, 1, 1, 1). The four probabilities sum to one, so three numbers in
this basis keep every distance between the states of two cells."""


class Kernel(Protocol):
    """One term of eq. (4) as a filter over N cells: a call returns sum_j k_ij values_j; `diagonal` holds k_ii, (N,)."""

    diagonal: NDArray[np.float32]

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return sum_j k_ij values_j for each cell i, (N, K) -> (N, K)."""


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
    """
    place = np.indices(values.shape[1:]) / params.sigma_alpha
    state = np.einsum("ks,shw->khw", _ZERO_SUM_STATES, values) / params.sigma_beta
    lattice = PermutohedralLattice.build(np.concatenate([place, state]).reshape(5, -1).T)
    degree = np.ones(values[0].size)
    if params.normalization == "symmetric":
        degree = lattice(np.ones((values[0].size, 1), np.float32))[:, 0]
    return lattice.scaled(np.sqrt(params.w_bilateral / degree))


def mean_field(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10, tolerance: float = 0.0
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field, fast (eq. (3), (4)); the twin of `mean_field_naive`.

    The sum over all pairs becomes two filters: the spatial one is exact (`SeparableGaussian`), the bilateral one uses
    the permutohedral lattice, whose kernel is only nearly Gaussian. Filters include the cell itself, which is no
    pair, so its own contribution is subtracted.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weights, widths and normalisation.
    iterations : int
        The largest number of updates of all cells. With the default parameters labels have settled after ten;
        probabilities of single cells still change later.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.

    Raises
    ------
    ArgumentError
        When shapes don't fit or numbers aren't what they should be.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations, tolerance)
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    Q = iterate(_in_lanes(unary), [bilateral_kernel(values, params), spatial], iterations, tolerance)
    return np.ascontiguousarray(Q[:, : len(unary)].T).reshape(unary.shape)


def iterate(
    phi: NDArray[np.float32], kernels: Sequence[Kernel], iterations: int, tolerance: float = 0.0
) -> NDArray[np.float32]:
    """Run the mean-field update of `mean_field_naive` with any kernels.

    The cost of disagreeing, sum_j k_ij (1 - Q_j(l)), differs from the negative reward of agreeing,
    -sum_j k_ij Q_j(l), only by sum_j k_ij, which is the same for all classes and cancels in the soft-max.

    Parameters
    ----------
    phi : (N, K) float32
        The unary term, finite, at least 0, and 0 for the best class of each cell.
    kernels : sequence of Kernel
        The terms of eq. (4).
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (N, K) float32
        Q, the distribution over classes in each cell.
    """
    own = sum(kernel.diagonal for kernel in kernels)
    part, logits = damping(own), -phi
    Q = _softmax(logits)
    for _ in range(iterations):
        reward = sum(kernel(Q) for kernel in kernels)
        _update(logits, part, reward, own, Q, phi)
        before, Q = Q, _softmax(logits)
        if tolerance > 0 and np.abs(Q - before).max() <= tolerance:
            break
    return Q


def _in_lanes(unary: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the unary term as (N, K), 0 for the best class; the classes are padded with impossible ones."""
    n_classes = len(unary)
    phi = np.full((unary[0].size, -(-n_classes // LANES) * LANES), NEVER, np.float32)
    phi[:, :n_classes] = np.minimum(unary - unary.min(axis=0), NEVER).reshape(n_classes, -1).T
    return phi


@njit(cache=True, parallel=True, fastmath=True)
def _update(logits, part, reward, own, Q, phi):
    """Move log Q_i(l), which is known up to one number per cell, part of the way: to the reward minus the unary term.

    The reward still contains the cell's own part.
    """
    for i in prange(len(Q)):
        for k in range(Q.shape[1]):
            target = reward[i, k] - own[i] * Q[i, k] - phi[i, k]
            logits[i, k] += part[i] * (target - logits[i, k])


def _softmax(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the soft-max along the class axis, (N, K); makes the largest logit of each cell 0."""
    _subtract_best(logits)
    Q = np.exp(logits)  # numpy's exp is vectorised, numba's isn't
    _normalise(Q)
    return Q


@njit(cache=True, parallel=True, fastmath=True)
def _subtract_best(logits):
    """Make the largest logit of each cell 0, in place."""
    for i in prange(len(logits)):
        best = logits[i, 0]
        for k in range(1, logits.shape[1]):
            best = max(best, logits[i, k])
        for k in range(logits.shape[1]):
            logits[i, k] -= best


@njit(cache=True, parallel=True, fastmath=True)
def _normalise(weights):
    """Divide each row by its sum, in place."""
    for i in prange(len(weights)):
        total = np.float32(0)
        for k in range(weights.shape[1]):
            total += weights[i, k]
        for k in range(weights.shape[1]):
            weights[i, k] /= total

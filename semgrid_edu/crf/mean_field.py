"""Mean field on the whole grid in milliseconds: eq. (3), (4) with filters in place of the sum over all pairs."""

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf.lattice import PermutohedralLattice
from semgrid_edu.crf.naive import NEVER, damping
from semgrid_edu.crf.params import NARROWEST, CrfParams, check_inputs, check_stop
from semgrid_edu.crf.spatial import SeparableGaussian, convolved_row
from semgrid_edu.errors import ArgumentError

LANES = 16
"""The class axis is padded to a multiple of this number: 16 floats fill a cache line, and loops over them vectorise."""

_ZERO_SUM_STATES = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]) / 2
"""An orthonormal basis of the space orthogonal to (1, 1, 1, 1). The four probabilities sum to one, so three numbers in
this basis keep every distance between the states of two cells."""


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
        When states differ by, or the grid measures, more widths than the lattice can count: some 3,000 together.
    """
    place = np.indices(values.shape[1:]) / max(params.sigma_alpha, NARROWEST)
    state = np.einsum("ks,shw->khw", _ZERO_SUM_STATES, values) / params.sigma_beta
    features = np.concatenate([place, state]) * (params.w_bilateral > 0)  # a kernel without weight can have any
    try:
        lattice = PermutohedralLattice.build(features.reshape(5, -1).T)
    except ArgumentError as error:
        found = f"{params.sigma_beta:g} and {params.sigma_alpha:g}: the lattice can't count so many widths"
        raise ArgumentError("params", "sigma_beta above 1e-3, or a larger sigma_alpha", found) from error
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
    phi = _in_lanes(unary.reshape(len(unary), -1), LANES)
    Q = iterate(phi, bilateral_kernel(values, params), spatial, iterations, tolerance)
    return _by_class(Q, len(unary)).reshape(unary.shape)


def iterate(
    phi: NDArray[np.float32],
    bilateral: PermutohedralLattice,
    spatial: SeparableGaussian,
    iterations: int,
    tolerance: float = 0.0,
) -> NDArray[np.float32]:
    """Run the mean-field update of `mean_field_naive`, with filters for the sums over all cells.

    The cost of disagreeing, sum_j k_ij (1 - Q_j(l)), differs from the negative reward of agreeing,
    -sum_j k_ij Q_j(l), only by sum_j k_ij, which is the same for all classes and cancels in the soft-max.

    Parameters
    ----------
    phi : (N, K) float32
        The unary term, finite, at least 0, and 0 for the best class of each cell.
    bilateral, spatial : PermutohedralLattice, SeparableGaussian
        The two kernels of eq. (4), with their weights and normalisation.
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (N, K) float32
        Q, the distribution over classes in each cell.
    """
    own, logits, Q, updated = bilateral.diagonal + spatial.diagonal, -phi, np.empty_like(phi), np.empty_like(phi)
    part, column_scale = damping(own).astype(np.float32), np.repeat(spatial.column_scale, phi.shape[1])
    grid = spatial.taps, spatial.row_scale, column_scale
    _softmax(logits, Q)
    for _ in range(iterations):
        vertices = bilateral.blurred(Q)
        change = _update(Q, updated, logits, phi, own, part, grid, vertices, bilateral.corners, bilateral.slices)
        Q, updated = updated, Q
        if change <= tolerance:
            break
    return Q


@njit(cache=True, parallel=True)
def _in_lanes(unary, lanes):
    """Return the unary term (C, H W) as (N, K), 0 for the best class; classes are padded with impossible ones."""
    n_classes, n_cells = unary.shape
    phi = np.full((n_cells, -(-n_classes // lanes) * lanes), np.float32(NEVER))
    for i in prange(n_cells):
        best = unary[:, i].min()
        for k in range(n_classes):
            phi[i, k] = min(unary[k, i] - best, NEVER)
    return phi


@njit(cache=True, parallel=True)
def _by_class(Q, n_classes):
    """Return (N, K) as (C, N), without the padding."""
    out = np.empty((n_classes, len(Q)), np.float32)
    for i in prange(len(Q)):
        for k in range(n_classes):
            out[k, i] = Q[i, k]
    return out


@njit(cache=True, parallel=True, fastmath=True)
def _update(Q, updated, logits, phi, own, part, grid, vertices, corners, slices):
    """Update all cells, row by row of the grid, and return the largest change of a probability.

    The reward of a cell is what the spatial kernel says, plus what the lattice's vertices say, minus what both contain
    of the cell itself. Its log Q, known up to one number, goes part of the way to the reward minus the unary term.
    """
    taps, row_scale, column_scale = grid
    height, lanes = len(row_scale), Q.shape[1]
    width, rows, change = len(Q) // height, Q.reshape(height, -1), np.zeros(height, np.float32)
    for r in prange(height):
        reward, largest = convolved_row(rows, r, lanes, taps, row_scale, column_scale), np.float32(0)
        for c in range(width):
            i = r * width + c
            self_weight, share = own[i], part[i]
            for first in range(0, lanes, LANES):
                for corner in range(corners.shape[1]):
                    weight, vertex = slices[i, corner], corners[i, corner]
                    for k in range(LANES):
                        reward[c * lanes + first + k] += weight * vertices[vertex, first + k]
                for k in range(LANES):
                    target = reward[c * lanes + first + k] - self_weight * Q[i, first + k] - phi[i, first + k]
                    logits[i, first + k] += share * (target - logits[i, first + k])
            _softmax_of_cell(logits, updated, i)
            for first in range(0, lanes, LANES):
                for k in range(LANES):
                    largest = max(largest, abs(updated[i, first + k] - Q[i, first + k]))
        change[r] = largest
    return change.max()


@njit(cache=True, parallel=True, fastmath=True)
def _softmax(logits, Q):
    """Write the soft-max of each cell's logits to Q, and make its largest logit 0."""
    for i in prange(len(Q)):
        _softmax_of_cell(logits, Q, i)


@njit(cache=True, fastmath=True, inline="always")
def _softmax_of_cell(logits, Q, i):
    best, total = logits[i, 0], np.float32(0)
    for first in range(0, Q.shape[1], LANES):
        for k in range(LANES):
            best = max(best, logits[i, first + k])
    for first in range(0, Q.shape[1], LANES):
        for k in range(LANES):
            logits[i, first + k] -= best
            Q[i, first + k] = _exp(logits[i, first + k])
            total += Q[i, first + k]
    share = np.float32(1) / total
    for first in range(0, Q.shape[1], LANES):
        for k in range(LANES):
            Q[i, first + k] *= share


@njit(cache=True, fastmath=True, inline="always")
def _exp(x):
    """Return exp(x) of a number that isn't positive, to 6 digits: the 64th power of the series of exp(x / 64).

    Unlike the exponential of the mathematical library, the compiler does this for many numbers at once.
    """
    y = max(x, np.float32(-80)) * np.float32(1 / 64)
    power = np.float32(1 / 120) * y + np.float32(1 / 24)
    power = (power * y + np.float32(1 / 6)) * y + np.float32(1 / 2)
    power = (power * y + np.float32(1)) * y + np.float32(1)
    for _ in range(6):
        power *= power
    return power if x > np.float32(-80) else np.float32(0)

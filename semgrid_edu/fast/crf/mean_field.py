"""Mean field on the whole grid in milliseconds: eq. (3), (4) with filters in place of the sum over all pairs."""

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf.lattice import bilateral_features
from semgrid_edu.crf.mean_field import NEVER, check_inputs, check_stop, damping, with_border
from semgrid_edu.crf.params import CrfParams
from semgrid_edu.fast.crf import FAST, exponential
from semgrid_edu.fast.crf.lattice import PermutohedralLattice
from semgrid_edu.fast.crf.spatial import SeparableGaussian

LANES = 16
"""A cell's classes are contiguous and padded to a multiple of this number: 16 floats fill a cache line."""


def mean_field(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10, tolerance: float = 0.0, pad: int = 0
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field in milliseconds (eq. (3), (4)): the book's fast twin.

    The other Parameters are those of `mean_field_naive`, and so are the errors, but the grid may have any size.

    Parameters
    ----------
    pad : int
        Number of cells by which the border is padded (with its own values) before the CRF; cut off afterwards.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations, tolerance)
    if pad:
        padded = [with_border(maps, pad) for maps in (unary, values)]
        return mean_field(*padded, params, iterations, tolerance)[:, pad:-pad, pad:-pad].copy()
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    phi = _above_best(np.require(unary, requirements="CW"))
    return iterate(phi, bilateral_kernel(values, params), spatial, iterations, tolerance)


def iterate(
    phi: NDArray[np.float32],
    bilateral: PermutohedralLattice,
    spatial: SeparableGaussian,
    iterations: int,
    tolerance: float = 0.0,
) -> NDArray[np.float32]:
    """Run the mean-field update of `mean_field_naive`, with filters for the sums over all cells.

    Parameters
    ----------
    phi : (C, H, W) float32
        The unary term, finite, at least 0, and 0 for the best class of each cell.
    bilateral, spatial : PermutohedralLattice, SeparableGaussian
        The two kernels of eq. (4), with their weights and normalisation.
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop when an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.
    """
    n_classes, height, width = phi.shape
    cells = np.zeros((height * width, -(-n_classes // LANES) * LANES), np.float32)
    rewards = np.zeros_like(cells)
    self_coupling = (bilateral.diagonal + spatial.diagonal).reshape(height, width)
    part = damping(self_coupling).astype(np.float32)
    logits = -phi
    Q = np.zeros_like(phi)
    # Without rewards, an update is the soft-max of the unary term.
    _update(rewards, phi, self_coupling, np.ones_like(part), logits, Q, cells)
    for _ in range(iterations):
        spatial.filter(cells, rewards)
        bilateral.add(cells, rewards)
        change = _update(rewards, phi, self_coupling, part, logits, Q, cells)
        if change <= tolerance:
            break
    return Q


def bilateral_kernel(values: NDArray, params: CrfParams) -> PermutohedralLattice:
    """Build the first kernel of eq. (4), including its weight and normalisation: the book's fast twin.

    Parameters are those of `bilateral_features`.
    """
    lattice = PermutohedralLattice.build(bilateral_features(values, params))
    degree = np.ones(values[0].size)
    if params.normalization == "symmetric":
        degree = lattice(np.ones((values[0].size, 1), np.float32))[:, 0]
    return lattice.scaled(np.sqrt(params.w_bilateral / degree))


# The twin of `above_best` in one pass: at the paper's size 0.2 ms on one core, where numpy's passes take 0.8 ms.
@njit(cache=True, parallel=True)
def _above_best(unary):
    """Return each cost minus the cost of the cell's best class, as float32, at most `NEVER`."""
    n_classes, height, width = unary.shape
    phi = np.empty(unary.shape, np.float32)
    for r in prange(height):
        best = unary[0, r].copy()
        for k in range(1, n_classes):
            for c in range(width):
                best[c] = min(best[c], unary[k, r, c])
        for k in range(n_classes):
            for c in range(width):
                phi[k, r, c] = min(unary[k, r, c] - best[c], NEVER)
    return phi


# Outside the filters, arrays have the axes (class, row, column): all loops then run along a row of the grid, and the
# compiler vectorises over its cells.
@njit(cache=True, parallel=True, fastmath=FAST)
def _update(rewards, phi, self_coupling, part, logits, Q, cells):
    """Update all cells, and return the largest change of a probability; `cells` gets a copy of Q in the filters' order.

    A cell's reward contains the contribution of the cell itself, which is subtracted. Its log Q moves, up to a
    constant, part of the way to the reward minus the unary term, see `updates`.
    """
    n_classes, height, width = phi.shape
    change = np.zeros(height, np.float32)
    rewards = rewards.reshape(height, width, -1)
    cells = cells.reshape(height, width, -1)
    for r in prange(height):
        fresh = np.empty((n_classes, width), np.float32)
        moved = np.zeros(width, np.float32)
        for c in range(width):  # transpose from the filters' order, and back below: cell by cell is faster
            for k in range(n_classes):
                fresh[k, c] = rewards[r, c, k]
        for k in range(n_classes):
            _approach(logits[k, r], fresh[k], self_coupling[r], Q[k, r], phi[k, r], part[r])
        _softmax(logits, r, fresh)
        for k in range(n_classes):
            _replace(Q[k, r], fresh[k], moved)
        for c in range(width):
            for k in range(n_classes):
                cells[r, c, k] = fresh[k, c]
        change[r] = moved.max()
    return change.max()


@njit(cache=True, fastmath=FAST, inline="always")
def _approach(logits, reward, self_coupling, Q, phi, part):
    for c in range(len(logits)):
        logits[c] += part[c] * (reward[c] - self_coupling[c] * Q[c] - phi[c] - logits[c])


@njit(cache=True, fastmath=FAST, inline="always")
def _softmax(logits, r, out):
    """Write the soft-max of row r of the logits to `out`, (C, W), and make the largest logit of each cell 0."""
    best = logits[0, r].copy()
    total = np.zeros(out.shape[1], np.float32)
    for k in range(1, len(out)):
        row = logits[k, r]
        for c in range(len(best)):
            best[c] = max(best[c], row[c])
    for k in range(len(out)):
        row = logits[k, r]
        for c in range(len(best)):
            row[c] -= best[c]
            out[k, c] = exponential(row[c])
        for c in range(len(best)):
            total[c] += out[k, c]
    for c in range(len(best)):
        total[c] = np.float32(1) / total[c]
    for k in range(len(out)):
        for c in range(len(best)):
            out[k, c] *= total[c]


@njit(cache=True, fastmath=FAST, inline="always")
def _replace(old, new, largest):
    """Overwrite the old numbers, and keep each cell's largest change."""
    for c in range(len(old)):
        largest[c] = max(largest[c], abs(new[c] - old[c]))
        old[c] = new[c]

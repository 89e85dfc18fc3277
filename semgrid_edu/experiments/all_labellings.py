"""The CRF without approximation by visiting every labelling, up to 16 cells of three classes (eq. (3), (4)).

The cells are split into two halves. A labelling is a labelling of the one half together with one of the other; its
energy is that of both, plus the pairs between them, which for all labellings at once are a product of matrices.
"""

from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams, pair_weights
from semgrid_edu.crf.params import check_inputs
from semgrid_edu.errors import ArgumentError

MOST_LABELLINGS = 10**8
"""A few seconds of work."""
_ROWS = 256
"""So many labellings of the first half at a time: the energies of up to 10,000 others each take 20 MB."""


class ExactCrf(NamedTuple):
    """What all labellings together say.

    Parameters
    ----------
    marginals : (C, H, W) float64
        P(x_i = l).
    labels : (H, W) int64
        The labelling of least energy; the first one when several tie.
    log_partition : float
        log Z.
    """

    marginals: NDArray[np.float64]
    labels: NDArray[np.int64]
    log_partition: float


def visit_labellings(unary: NDArray, values: NDArray, params: CrfParams) -> ExactCrf:
    """Sum over every labelling, and find the best.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; finite.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    ExactCrf

    Raises
    ------
    ArgumentError
        When shapes don't fit, a unary is infinite, or there are more than `MOST_LABELLINGS` labellings.
    """
    unary, values = check_inputs(unary, values)
    classes, cells = len(unary), unary[0].size
    if not np.isfinite(unary).all():
        raise ArgumentError("unary", "finite numbers", "inf")
    if classes**cells > MOST_LABELLINGS:
        raise ArgumentError("unary", f"at most {MOST_LABELLINGS:,} labellings", f"{classes}^{cells}")
    halves, energies = _split(unary.reshape(classes, -1).T, pair_weights(values, params))
    least, *best = min(_least(row, block) for row, block in energies())
    sums = [np.zeros(half.chosen.shape[1]) for half in halves]
    for row, block in energies():
        p = np.exp(least - block)
        sums[0] += p.sum(axis=1) @ halves[0].chosen[row : row + _ROWS]
        sums[1] += p.sum(axis=0) @ halves[1].chosen
    total = np.concatenate(sums).reshape(cells, classes).T
    chosen = np.concatenate([half.chosen[k] for half, k in zip(halves, best, strict=True)]).reshape(cells, classes)
    Z = total[:, 0].sum()
    shape = unary.shape[1:]
    return ExactCrf((total / Z).reshape(unary.shape), chosen.argmax(axis=1).reshape(shape), float(np.log(Z) - least))


def _least(row: int, block: NDArray) -> tuple[float, int, int]:
    """Return the least energy of some rows, and its labellings of the first and of the second half."""
    k, other = np.unravel_index(block.argmin(), block.shape)
    return float(block[k, other]), row + int(k), int(other)


class _Half(NamedTuple):
    """The labellings of half of the cells: which class each cell has, (L, n C) of 0 and 1, and their energies, (L,)."""

    chosen: NDArray[np.float64]
    energy: NDArray[np.float64]

    @classmethod
    def of(cls, phi: NDArray, weights: NDArray) -> "_Half":
        cells, classes = phi.shape
        labels = np.array(list(product(range(classes), repeat=cells)), dtype=np.int64)
        chosen = np.eye(classes)[labels].reshape(len(labels), cells * classes)
        agree = np.einsum("lk,lk->l", chosen @ np.kron(weights, np.eye(classes)), chosen)  # each pair twice
        return cls(chosen, chosen @ phi.ravel() + (weights.sum() - agree) / 2)


def _split(phi: NDArray, weights: NDArray) -> tuple[tuple[_Half, _Half], Callable[[], Iterator[tuple[int, NDArray]]]]:
    """Return both halves, and a function that yields the energies of all labellings, some rows at a time."""
    cells, classes = phi.shape
    first = cells // 2
    left, right = _Half.of(phi[:first], weights[:first, :first]), _Half.of(phi[first:], weights[first:, first:])
    between = weights[:first, first:]
    reward = np.kron(between, np.eye(classes)) @ right.chosen.T

    def energies() -> Iterator[tuple[int, NDArray]]:
        for row in range(0, len(left.energy), _ROWS):
            some = slice(row, row + _ROWS)
            yield row, left.energy[some, None] + right.energy + between.sum() - left.chosen[some] @ reward

    return (left, right), energies

"""Tiny dense CRFs (eq. (3), (4)): exactly, by visiting every labelling, and by loopy messages, all at once.

The cells are split into two halves. A labelling of all cells is one of each half, and its energy is that of the halves
plus that of the pairs between them: a table with one row per labelling of the first half and one column per labelling
of the second. So 16 cells of three classes, 43 million labellings, take a second or two.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax, logsumexp

from semgrid_edu.crf import CrfParams, pair_weights
from semgrid_edu.crf.params import check_inputs
from semgrid_edu.errors import ArgumentError

MOST_LABELLINGS = 10**8
"""The table of their energies takes less than a gigabyte."""
ITERATIONS, TOLERANCE, DAMPING = 2000, 1e-9, 0.5
"""Loopy messages: the most updates, the largest change of a log-message when they stop, the share of the old one that
is kept."""


class ExactCrf(NamedTuple):
    """What all labellings together say.

    Parameters
    ----------
    marginals : (C, H, W) float64
        P(x_i = l).
    labels : (H, W) int64
        The labelling of least energy; one of them when several tie.
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
    phi, weights = unary.reshape(classes, -1).T, pair_weights(values, params)
    half = cells // 2
    first = _Half.of(phi[:half], weights[:half, :half])
    last = _Half.of(phi[half:], weights[half:, half:])
    between = weights[:half, half:]
    energy = -first.chosen @ np.kron(between, np.eye(classes)) @ last.chosen.T  # pairs cost where labels differ
    energy += first.energy[:, None] + last.energy + between.sum()
    best = np.unravel_index(energy.argmin(), energy.shape)
    least = energy[best]
    p = np.exp(np.subtract(least, energy, out=energy), out=energy)
    marginals = np.concatenate([p.sum(axis=1) @ first.chosen, p.sum(axis=0) @ last.chosen]) / p.sum()
    labels = np.concatenate([first.labels[best[0]], last.labels[best[1]]])
    marginals = marginals.reshape(cells, classes).T.reshape(unary.shape)
    return ExactCrf(marginals, labels.reshape(unary.shape[1:]), float(np.log(p.sum()) - least))


class _Half(NamedTuple):
    """All labellings of some cells: (L, n) classes, the same as (L, n C) zeros and ones, and (L,) energies."""

    labels: NDArray[np.int64]
    chosen: NDArray[np.float64]
    energy: NDArray[np.float64]

    @classmethod
    def of(cls, phi: NDArray, weights: NDArray) -> "_Half":
        cells, classes = phi.shape
        labels = np.array(list(product(range(classes), repeat=cells)), dtype=np.int64).reshape(classes**cells, cells)
        chosen = np.eye(classes)[labels].reshape(len(labels), cells * classes)
        agree = np.einsum("lk,lk->l", chosen @ np.kron(weights, np.eye(classes)), chosen)  # each pair twice
        return cls(labels, chosen, chosen @ phi.ravel() + (weights.sum() - agree) / 2)


def potts_messages(unary: NDArray, values: NDArray, params: CrfParams, best: bool = False) -> NDArray[np.float64]:
    """Approximate the marginals by loopy sum-product, all messages at once: a fast twin of that in `graphical`.

    A factor of the CRF lies between two cells, so its two messages make one from cell to cell, and all cells are pairs:
    the messages are one table (N, N, C).

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; finite.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.
    best : bool
        Whether to maximise instead of to sum (loopy max-product).

    Returns
    -------
    (C, H, W) float64
        A distribution over the classes in each cell; with `best`, max-marginals divided by their sum.
    """
    unary, values = check_inputs(unary, values)
    phi, weights = unary.reshape(len(unary), -1).T, pair_weights(values, params)[:, :, None]
    messages = np.zeros((*weights.shape[:2], phi.shape[1]))  # [i, j, l]: what i tells j about class l, a logarithm
    for _ in range(ITERATIONS):
        from_others = (messages.sum(axis=0) - phi)[:, None] - messages.swapaxes(0, 1)  # all that i knows but from j
        new = log_softmax(_across(from_others, weights, best), axis=2)
        change = np.abs(new - messages).max()
        messages = (1 - DAMPING) * new + DAMPING * messages
        if change <= TOLERANCE:
            break
    belief = log_softmax(messages.sum(axis=0) - phi, axis=1)
    return np.exp(belief).T.reshape(unary.shape)


def _across(known: NDArray, weights: NDArray, best: bool) -> NDArray[np.float64]:
    """Carry messages across the factors exp(-k_ij [x_i != x_j]): agreeing is free, disagreeing costs k_ij."""
    if best:
        return np.maximum(known, known.max(axis=2, keepdims=True) - weights)
    with np.errstate(divide="ignore"):  # log(0) where a pair has no weight
        agree = np.log1p(-np.exp(-weights)) + known
    return np.logaddexp(agree, logsumexp(known, axis=2, keepdims=True) - weights)

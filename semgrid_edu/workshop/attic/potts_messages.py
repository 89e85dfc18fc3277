"""Loopy sum-product and max-product in the dense CRF, all messages at once: fast twins of those in `graphical`.

A factor of the CRF lies between two cells, so that what a cell tells it and what it tells the other cell make one
message from cell to cell. All cells are pairs, which makes the messages one table (N, N, C).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax, logsumexp

from semgrid_edu.crf import CrfParams, pair_weights
from semgrid_edu.crf.params import check_inputs

ITERATIONS, TOLERANCE, DAMPING = 2000, 1e-9, 0.5
"""At most so many iterations; until no log-message changes by more than this; the share of the old log-message kept."""


def potts_sum_product(unary: NDArray, values: NDArray, params: CrfParams) -> NDArray[np.float64]:
    """Approximate the marginals by loopy sum-product.

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
    (C, H, W) float64
        A distribution over the classes in each cell.
    """
    return _beliefs(unary, values, params, best=False)


def potts_max_product(unary: NDArray, values: NDArray, params: CrfParams) -> NDArray[np.float64]:
    """Approximate the max-marginals by loopy max-product. Parameters are those of `potts_sum_product`.

    Returns
    -------
    (C, H, W) float64
        Max-marginals, divided by their sum in each cell.
    """
    return _beliefs(unary, values, params, best=True)


def _beliefs(unary: NDArray, values: NDArray, params: CrfParams, best: bool) -> NDArray[np.float64]:
    """Pass messages until they stop changing."""
    unary, values = check_inputs(unary, values)
    phi, weights = unary.reshape(len(unary), -1).T, pair_weights(values, params)[:, :, None]
    messages = np.zeros((*weights.shape[:2], phi.shape[1]))  # [i, j, l]: what i tells j about class l, a logarithm
    for _ in range(ITERATIONS):
        told = (messages.sum(axis=0) - phi)[:, None] - messages.swapaxes(0, 1)  # what i says without what j told it
        new = log_softmax(_across(told, weights, best), axis=2)
        change = np.abs(new - messages).max()
        messages = (1 - DAMPING) * new + DAMPING * messages
        if change <= TOLERANCE:
            break
    belief = log_softmax(messages.sum(axis=0) - phi, axis=1)
    return np.exp(belief).T.reshape(unary.shape)


def _across(told: NDArray, weights: NDArray, best: bool) -> NDArray[np.float64]:
    """Carry messages across the factors exp(-k_ij [x_i != x_j]): agree at no cost, or disagree at that of the pair."""
    if best:
        return np.maximum(told, told.max(axis=2, keepdims=True) - weights)
    with np.errstate(divide="ignore"):  # log(0) where a pair has no weight
        agree = np.log1p(-np.exp(-weights)) + told
    return np.logaddexp(agree, logsumexp(told, axis=2, keepdims=True) - weights)

"""What the neighbours of a cell add in the CRF's last mean-field update, with the kernels of eq. (4) written out."""

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams

RADIUS = 4.0
"""Reach of the window, in widths `sigma_alpha`. A cell outside has less than exp(-8) of a cell's weight with itself."""

Step = tuple[int, int]


class Neighbours(NamedTuple):
    """What the neighbours of each cell i add in an update.

    Parameters
    ----------
    messages : (C, H, W) float
        sum_j k_ij Q_j(l): what all neighbours together add to the logarithm of each class's probability.
    steps : (2, number, H, W) int64
        Rows and columns from each cell to the neighbours that pull it most towards one class, the strongest first; 0
        where there are fewer.
    pull : (number, H, W) float
        k_ij Q_j(l) of each of these: its term of the message.
    """

    messages: NDArray[np.floating]
    steps: NDArray[np.int64]
    pull: NDArray[np.floating]


def neighbour_pull(Q: NDArray, label: NDArray, o: NDArray, params: CrfParams, number: int = 5) -> Neighbours:
    """Write out the sum over the neighbours in eq. (3), one step from cell to neighbour after the other.

    Parameters
    ----------
    Q : (C, H, W) float
        The distribution in each cell before the update.
    label : (H, W) int
        The class l of each cell i for which the strongest neighbours are found.
    o : (4, H, W) float
        o_i, the probabilities of the four states.
    params : CrfParams
        Weights, widths and normalisation of the kernels.
    number : int
        How many of the strongest neighbours to return.
    """
    steps = _window(params.sigma_alpha, label.shape)
    scale = _scales(o, params, steps)
    messages = np.zeros_like(Q)
    pull = np.zeros((number, *label.shape), Q.dtype)
    which = np.zeros((number, *label.shape), np.int64)
    for k, step in enumerate(steps[1:], start=1):  # without step 0: a cell is no pair with itself
        here, there = _pairs(label.shape, step)
        bilateral, spatial = _kernels(o, params, step)
        weights = bilateral * scale[0][here] * scale[0][there] + spatial * scale[1][here] * scale[1][there]
        Q_j = Q[:, *there]
        messages[:, *here] += weights * Q_j
        terms = np.zeros_like(pull[0])
        terms[here] = weights * np.take_along_axis(Q_j, label[here][None], axis=0)[0]
        _insert(pull, which, terms, k)
    return Neighbours(messages, np.moveaxis(np.array(steps)[which], -1, 0), pull)


def _window(sigma: float, shape: tuple[int, int]) -> list[Step]:
    """Return the steps to all cells of a square window, the nearest first."""
    reach = min(int(np.ceil(RADIUS * sigma)), max(shape) - 1)
    return sorted(product(range(-reach, reach + 1), repeat=2), key=np.linalg.norm)


def _pairs(shape: tuple[int, int], step: Step) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the cells from which a step stays inside the grid, and the cells to which it leads."""
    here = tuple(slice(max(0, -by), max(0, size - max(0, by))) for size, by in zip(shape, step, strict=True))
    there = tuple(slice(max(0, by), max(0, size + min(0, by))) for size, by in zip(shape, step, strict=True))
    return here, there


def _kernels(o: NDArray, params: CrfParams, step: Step) -> tuple[NDArray, float]:
    """Return both Gaussians of eq. (4) for the pairs of cells of a step; the second one is the same for all pairs."""
    here, there = _pairs(o.shape[1:], step)
    place = step[0] ** 2 + step[1] ** 2
    difference = o[:, *here] - o[:, *there]
    state = np.einsum("shw,shw->hw", difference, difference)
    bilateral = np.exp(-place / (2 * params.sigma_alpha**2) - state / (2 * params.sigma_beta**2))
    spatial = float(np.exp(-place / (2 * params.sigma_gamma**2)))
    return bilateral, spatial


def _scales(o: NDArray, params: CrfParams, steps: list[Step]) -> NDArray:
    """Return for each kernel the factor of each cell: k_ij is the Gaussian times the factors of i and of j."""
    row_sums = np.zeros((2, *o.shape[1:]), o.dtype)
    for step in steps if params.normalization == "symmetric" else steps[:1]:  # without steps, K_ii = 1 remains
        here, _ = _pairs(o.shape[1:], step)
        bilateral, spatial = _kernels(o, params, step)
        row_sums[0][here] += bilateral
        row_sums[1][here] += spatial
    weights = np.array([params.w_bilateral, params.w_spatial], o.dtype)
    return np.sqrt(weights[:, None, None] / row_sums)


def _insert(pull: NDArray, which: NDArray, terms: NDArray, number: int) -> None:
    """Put a term of each cell, and its number, into the cell's list of its largest terms if it is one of them."""
    at = terms > pull[-1]
    largest = np.concatenate([pull[:, at], terms[None, at]])
    numbers = np.concatenate([which[:, at], np.full((1, at.sum()), number)])
    order = np.argsort(-largest, axis=0, kind="stable")[:-1]
    pull[:, at] = np.take_along_axis(largest, order, axis=0)
    which[:, at] = np.take_along_axis(numbers, order, axis=0)

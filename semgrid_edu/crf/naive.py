"""Mean field with every pair of cells written out, all cells at once or one by one (eq. (3), (4)); for small grids."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_softmax

from semgrid_edu.crf.kernel import gram_matrix, pair_weights
from semgrid_edu.crf.params import CrfParams, check_inputs, check_stop

NEVER = 1e30
"""A cost in place of infinity: it avoids inf - inf, which is NaN, and exp(-1e30) is 0."""


def mean_field_naive(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10, tolerance: float = 0.0
) -> NDArray[np.float64]:
    """Approximate the CRF's marginals by mean field, every pair of cells written out (eq. (3), (4)).

    Among all distributions with independent cells, mean field looks for the one closest to exp(-E(x)) / Z by minimising
    the free energy (`free_energy`). At a minimum, with k_ij the bracket of eq. (4), each cell satisfies

        Q_i(l) = exp(-phi_u(l) - sum_{j != i} k_ij (1 - Q_j(l))) / Z_i

    All cells are updated at once, starting from Q_i(l) = exp(-phi_u(l)) / Z_i, as in Kraehenbuehl and Koltun 2011,
    algorithm 1. They take the right-hand side as the new Q_i; here log Q_i moves only part of the way to it (see
    `damping`), so that no update raises the free energy. Without damping, two cells that attract each other strongly
    but have different labels swap them for ever.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weights, widths and normalisation.
    iterations : int
        The largest number of updates of all cells. With the default parameters nearly all labels have settled after
        ten, although the probabilities of some cells still change.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float64
        Q, the distribution over classes in each cell.

    Raises
    ------
    ArgumentError
        When shapes don't fit, numbers aren't what they should be, or the grid has more than `MAX_CELLS` cells.
    """
    check_stop(iterations, tolerance)
    return settled(mean_field_updates(unary, values, params), iterations, tolerance)


def mean_field_updates(unary: ArrayLike, values: ArrayLike, params: CrfParams) -> Iterator[NDArray[np.float64]]:
    """Yield the initial Q of `mean_field_naive` and the Q after each update, without end.

    Parameters are those of `mean_field_naive`.

    Yields
    ------
    (C, H, W) float64
        Q.

    Examples
    --------
    Two cells attract each other and disagree. The free energy, at first and after each update:

    >>> from semgrid_edu.crf import free_energy
    >>> unary, values = np.array([[[0.0, 2.0]], [[1.0, 0.0]]]), np.full((4, 1, 2), 0.25)
    >>> updates = mean_field_updates(unary, values, CrfParams())
    >>> [round(free_energy(next(updates), unary, values, CrfParams()), 2) for _ in range(4)]
    [1.89, 1.44, 1.31, 1.19]
    """
    unary, values = check_inputs(unary, values)
    weights = gram_matrix(values, params)
    self_coupling = np.diag(weights).copy()
    np.fill_diagonal(weights, 0)  # a cell forms no pair with itself
    return updates(unary, lambda Q: (1 - Q) @ weights, self_coupling)


def updates(
    unary: NDArray, disagreement: Callable[[NDArray], NDArray], self_coupling: NDArray
) -> Iterator[NDArray[np.floating]]:
    """Yield the initial Q and the Q after each simultaneous update, without end: the update rule of mean field.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; inf where a class is impossible.
    disagreement : callable
        Q (C, H W) -> sum_{j != i} k_ij (1 - Q_j(l)), (C, H W), up to a constant that is the same for all classes.
    self_coupling : (H W,) float
        k_ii, see `damping`.

    Yields
    ------
    (C, H, W) float
        Q, the distribution over classes in each cell.
    """
    phi = above_best(unary).astype(np.float64)
    part = damping(self_coupling)
    log_Q = log_softmax(-phi, axis=0)
    while True:
        Q = np.exp(log_Q)
        yield Q.reshape(unary.shape)
        target = -phi - disagreement(Q)
        log_Q = log_softmax((1 - part) * log_Q + part * target, axis=0)


def above_best(unary: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the cost of each class relative to the cell's best one: the unary term up to a constant.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; inf where a class is impossible.

    Returns
    -------
    (C, H W) float
        Finite, at most `NEVER`.
    """
    return np.minimum(unary - unary.min(axis=0), NEVER).reshape(len(unary), -1)


def settled(states: Iterator[NDArray], iterations: int, tolerance: float) -> NDArray:
    """Update until the number of updates is reached, or an update changes no probability by more than the tolerance.

    Parameters
    ----------
    states : iterator of (C, H, W) float
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
    Q = next(states)
    for _ in range(iterations):
        before = Q
        Q = next(states)
        if np.abs(Q - before).max() <= tolerance:
            break
    return Q


def damping(self_coupling: NDArray) -> NDArray:
    """Return how far all cells may move at once without raising the free energy.

    With k_ii the weight of a cell with itself (the diagonal of `gram_matrix`), the free energy is::

        F(Q) = sum_i Q_i . phi_i - 1/2 sum_ij k_ij Q_i . Q_j + 1/2 sum_i k_ii |Q_i|^2 - H(Q) + constant

    The first sum over pairs has a positive semidefinite matrix, so with its minus sign it is concave, and nowhere above
    its tangent at the present Q. The next sum exceeds its tangent by ``k_ii / 2 |Q'_i - Q_i|^2``, which is at most
    ``k_ii / 2 KL(Q'_i || Q_i)`` by Pinsker's inequality. Tangents plus bound are nowhere below F and equal it at Q. So
    F at their minimum Q' is no larger than at Q. Setting the derivative to zero gives::

        log Q'_i = (1 - p_i) log Q_i + p_i (-phi_i - sum_{j != i} k_ij (1 - Q_j)) + constant,   p_i = 1 / (1 + k_ii / 2)

    (compare Kraehenbuehl and Koltun 2013, section 3; Baque et al. 2016).

    Parameters
    ----------
    self_coupling : (N,) float
        k_ii, for each cell the sum over the kernels.

    Returns
    -------
    (N,) float
        p_i, 0 < p_i <= 1. With the default parameters and many neighbours it is near 1, so damping costs nothing; with
        `normalization="none"` it is 1 / (1 + (w1 + w2) / 2).
    """
    return 1 / (1 + self_coupling / 2)


def mean_field_sequential(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10
) -> NDArray[np.float64]:
    """Approximate the CRF's marginals by mean field, one cell after the other.

    Each update minimises the free energy over the distribution of one cell, so it can't raise it, and needs no damping.
    But the cells can't be updated in parallel. Parameters are those of `mean_field_naive`, and so are errors.

    Returns
    -------
    (C, H, W) float64
        Q, the distribution over classes in each cell.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations)
    phi = above_best(unary.astype(np.float64))
    weights = pair_weights(values, params)
    log_Q = log_softmax(-phi, axis=0)
    for _ in range(iterations):
        for i in range(phi.shape[1]):
            disagreement = (1 - np.exp(log_Q)) @ weights[i]
            log_Q[:, i] = log_softmax(-phi[:, i] - disagreement)
    return np.exp(log_Q).reshape(unary.shape)

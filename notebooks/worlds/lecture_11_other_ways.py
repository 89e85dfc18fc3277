"""Other methods of inference in the CRF, for comparison with the package's (eq. (3), (4)).

Exactly, by visiting every labelling; by loopy messages, all at once; and by mean field with a low-rank kernel, which
compares every cell with a few landmarks only (Nystroem's method).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax, logsumexp

from semgrid_edu.crf import CrfParams, pair_weights
from semgrid_edu.crf.mean_field import check_inputs
from semgrid_edu.crf.naive import kernels
from semgrid_edu.errors import ArgumentError
from worlds.lecture_11_accurate import filtered

MOST_LABELLINGS = 10**8
"""The table of their energies takes less than a gigabyte."""
ITERATIONS, TOLERANCE, DAMPING = 2000, 1e-9, 0.5
"""Loopy messages: the most updates, the largest change of a log-message when they stop, the share of the old one that
is kept."""
_NEGLIGIBLE = 1e-10
"""Eigenvalues of the landmarks' kernel below this share of the largest are rounding errors and are left out."""


def visit_labellings(unary: NDArray, values: NDArray, params: CrfParams) -> tuple[NDArray, NDArray]:
    """Sum over every labelling, and find the best: the 43 million of 16 cells of three classes take seconds.

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
    marginals : (C, H, W) float64
        P(x_i = l).
    labels : (H, W) int
        The labelling of least energy; one of them when several tie.

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
    energy = _all_energies(unary.reshape(classes, -1).T, pair_weights(values, params))
    best = np.unravel_index(energy.argmin(), energy.shape)
    half = cells // 2  # the sums over either half of the axes are small, and tell the marginals of the other half
    table = np.exp(np.subtract(energy[best], energy, out=energy), out=energy).reshape(classes**half, -1)
    halves = table.sum(axis=1).reshape((classes,) * half), table.sum(axis=0).reshape((classes,) * (cells - half))
    of_cells = [np.moveaxis(sums, k, 0).reshape(classes, -1).sum(axis=1) for sums in halves for k in range(sums.ndim)]
    marginals = np.stack(of_cells, axis=1) / table.sum()
    return marginals.reshape(unary.shape), np.reshape(best, unary.shape[1:])


def _all_energies(phi: NDArray, weights: NDArray) -> NDArray[np.float64]:
    """Return the energy of every labelling, one axis per cell: each cell adds to that of all labellings before it."""
    classes, energy = phi.shape[1], np.zeros(())
    differ = 1 - np.eye(classes)
    for i, added in enumerate(phi):
        for j in reversed(range(i)):  # a pair costs where the labels differ
            added = added + (weights[i, j] * differ).reshape(classes, *(1,) * (i - j - 1), classes)
        energy = energy[..., None] + added
    return energy


def potts_messages(unary: NDArray, values: NDArray, params: CrfParams, best: bool = False) -> NDArray[np.float64]:
    """Approximate the marginals by loopy sum-product, all messages at once, as `graphical.sum_product` does.

    A factor of the CRF joins two cells, so its two messages become one from cell to cell. All cells are pairs, so the
    messages are one table (N, N, C).

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
    messages = np.zeros((*weights.shape[:2], phi.shape[1]))  # [i, j, l]: log of the message from i to j about class l
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


@dataclass(frozen=True)
class LowRankGaussian:
    """Sums over all cells, weighted by K_nm K_mm^-1 K_mn in place of the Gaussian K_nn, with m landmarks.

    Between landmarks it is exact. The weights of a cell that is far from every landmark vanish.

    Parameters
    ----------
    factor : (N, r) float32
        F, one row per cell: the kernel is F F^T, weight and normalisation included.
    """

    factor: NDArray[np.float32]

    @classmethod
    def build(cls, values: NDArray, params: CrfParams, landmarks: NDArray[np.integer]) -> "LowRankGaussian":
        """Factorise the bilateral kernel of eq. (4).

        Parameters
        ----------
        values : (4, H, W) float
            o_i, the occupancy probabilities of each cell.
        params : CrfParams
            Weight, widths and normalisation.
        landmarks : (m,) int
            The cells that are landmarks, counted row by row.

        Returns
        -------
        LowRankGaussian
            A kernel of rank m or less.
        """
        to_landmarks = kernels(values, params, landmarks)[0].T
        eigenvalues, vectors = np.linalg.eigh(to_landmarks[landmarks])
        kept = eigenvalues > _NEGLIGIBLE * eigenvalues[-1]
        factor = to_landmarks @ (vectors[:, kept] / np.sqrt(eigenvalues[kept]))
        degree = np.ones(len(factor))
        if params.normalization == "symmetric":
            degree = np.maximum(factor @ factor.sum(axis=0), 1)  # the exact row sums, with the cell itself, are no less
        return cls((factor * np.sqrt(params.w_bilateral / degree)[:, None]).astype(np.float32))

    @property
    def diagonal(self) -> NDArray[np.float32]:
        """k_ii, the share of its own value that each cell gets back, (N,)."""
        return np.square(self.factor).sum(axis=1)

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return sum_j k_ij values_j for values (N, K), one row per cell, the cell itself included."""
        return self.factor @ (self.factor.T @ values)


def mean_field_low_rank(
    unary: NDArray, values: NDArray, params: CrfParams, iterations: int, tolerance: float, *, rank: int, seed: int
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field with a low-rank bilateral kernel.

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
    rank : int
        Number of landmarks, drawn from the cells; all of them when there are fewer.
    seed : int
        Seed for the landmarks.

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
    cells = values[0].size
    landmarks = np.random.default_rng(seed).choice(cells, min(rank, cells), replace=False)
    return filtered(unary, params, LowRankGaussian.build(values, params, landmarks), iterations, tolerance)

"""What a labelling or a distribution costs, every pair of cells written out (eq. (3), (4))."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import xlogy

from semgrid_edu.crf.kernel import pair_weights
from semgrid_edu.crf.params import CrfParams, check_inputs
from semgrid_edu.errors import ArgumentError


def energy(labels: ArrayLike, unary: ArrayLike, values: ArrayLike, params: CrfParams) -> float:
    """Compute the energy of a labelling, E(x) of eq. (3) with the pair term of eq. (4).

    The pair term carries `params.normalization`, so this is the energy whose mean field `mean_field_naive` finds; it
    is eq. (4) as printed with "none".

    Parameters
    ----------
    labels : (H, W) int
        x_i, the class of each cell.
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    float
        E(x): the cells' unary terms, plus a pair weight for each pair of cells (once) with different labels.

    Raises
    ------
    ArgumentError
        When shapes don't fit, a label is no class, or the grid has more than `MAX_CELLS` cells.

    Examples
    --------
    Two neighbouring cells in the same state, and only the spatial kernel: the cost of a border between them is
    w2 exp(-1 / (2 sigma_gamma^2)).

    >>> values = np.full((4, 1, 2), 0.25)
    >>> params = CrfParams(w_bilateral=0, w_spatial=3, sigma_gamma=1, normalization="none")
    >>> round(energy([[0, 1]], np.zeros((2, 1, 2)), values, params), 3)
    1.82
    """
    unary, values = check_inputs(unary, values)
    labels = np.asarray(labels)
    if labels.shape != unary.shape[1:] or labels.dtype.kind not in "iu":
        raise ArgumentError("labels", f"integers of shape {unary.shape[1:]}", f"{labels.dtype} of {labels.shape}")
    if labels.min() < 0 or labels.max() >= len(unary):
        raise ArgumentError("labels", f"classes 0 to {len(unary) - 1}", f"{labels.min()} to {labels.max()}")
    own = np.take_along_axis(unary, labels[None].astype(np.int64), axis=0).sum(dtype=np.float64)
    x = labels.ravel()
    differ = x[:, None] != x  # mu(x_i, x_j)
    return float(own + np.triu(pair_weights(values, params) * differ).sum())


def free_energy(Q: ArrayLike, unary: ArrayLike, values: ArrayLike, params: CrfParams) -> float:
    """Compute the free energy of independent cells, F(Q) = E_Q[E(x)] - H(Q), which mean field makes small.

    It is an upper bound of -log Z, and F(Q) + log Z = KL(Q || P) says how far Q is from P(x) = exp(-E(x)) / Z. Each
    pair of cells counts once.

    The other Parameters are those of `energy`.

    Parameters
    ----------
    Q : (C, H, W) float
        A distribution over the classes in each cell.

    Returns
    -------
    float
        F(Q) in nats; infinite when Q gives an impossible class a probability.

    Raises
    ------
    ArgumentError
        When shapes don't fit, Q holds no distributions, or the grid has more than `MAX_CELLS` cells.

    Examples
    --------
    Two cells without unary costs, each undecided between two classes. Without the pair term F is -log Z = -2 log 2.
    The two cells disagree half of the time, so the pair term adds half of its weight, w2 exp(-1/2) = 0.607:

    >>> values, undecided = np.full((4, 1, 2), 0.25), np.full((2, 1, 2), 0.5)
    >>> params = CrfParams(w_bilateral=0, w_spatial=1, sigma_gamma=1, normalization="none")
    >>> round(float(free_energy(undecided, np.zeros((2, 1, 2)), values, params) + 2 * np.log(2)), 3)
    0.303
    """
    unary, values = check_inputs(unary, values)
    Q = np.asarray(Q, dtype=np.float64)
    if Q.shape != unary.shape or not (Q >= 0).all() or not np.allclose(Q.sum(axis=0), 1, atol=1e-3):
        raise ArgumentError("Q", f"distributions over axis 0, shape {unary.shape}", f"an array of shape {Q.shape}")
    q = Q.reshape(len(Q), -1)
    own = (q * np.where(q > 0, unary.reshape(q.shape), 0)).sum()
    disagree = 1 - q.T @ q
    return float(own + np.triu(pair_weights(values, params) * disagree).sum() + xlogy(q, q).sum())

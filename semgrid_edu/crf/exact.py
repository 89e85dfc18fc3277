"""The CRF with every pair of cells written out: energies, and exact inference on tiny grids (eq. (3), (4))."""

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import xlogy

from semgrid_edu.crf.mean_field import check_inputs
from semgrid_edu.crf.naive import pair_weights
from semgrid_edu.crf.params import CrfParams
from semgrid_edu.errors import ArgumentError
from semgrid_edu.graphical import Factor, GraphicalModel, eliminate, log_total, max_product


def energy(labels: ArrayLike, unary: ArrayLike, values: ArrayLike, params: CrfParams) -> float:
    """Compute the energy of a labelling, E(x) of eq. (3) with the pair term of eq. (4).

    The pair term includes `params.normalization`, so `mean_field_naive` approximates the distribution of this energy;
    with "none" it is eq. (4) as printed.

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
    unary_cost = np.take_along_axis(unary, labels[None].astype(np.int64), axis=0).sum(dtype=np.float64)
    x = labels.ravel()
    differ = x[:, None] != x  # mu(x_i, x_j)
    pair_cost = np.triu(pair_weights(values, params) * differ).sum()  # each pair once
    return float(unary_cost + pair_cost)


def free_energy(Q: ArrayLike, unary: ArrayLike, values: ArrayLike, params: CrfParams) -> float:
    """Compute the free energy of independent cells, F(Q) = E_Q[E(x)] - H(Q), which mean field minimises.

    It is an upper bound of -log Z: F(Q) + log Z = KL(Q || P) is the distance of Q from P(x) = exp(-E(x)) / Z. Each
    pair of cells counts once.

    The other Parameters are those of `energy`.

    Parameters
    ----------
    Q : (C, H, W) float
        A distribution over the classes in each cell.

    Returns
    -------
    float
        F(Q) in nats; infinite if Q gives an impossible class a positive probability.

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
    unary_cost = (q * np.where(q > 0, unary.reshape(q.shape), 0)).sum()  # 0 times infinity counts as 0
    differ = 1 - q.T @ q  # the probability that the labels of two cells differ
    pair_cost = np.triu(pair_weights(values, params) * differ).sum()
    entropy = -xlogy(q, q).sum()
    return float(unary_cost + pair_cost - entropy)


MAX_ENERGY = 700
"""The largest energy of the best labelling: exp(-745) is 0, so with more all labellings would look impossible."""

MAX_LABELLINGS = 10**7
"""The largest number of labellings: all cells are coupled, so elimination needs a table of all labellings."""


def crf_model(unary: ArrayLike, values: ArrayLike, params: CrfParams) -> GraphicalModel:
    """Build the CRF as a product of factors: P(x) = exp(-E(x)) / Z, with the energy of eq. (3) and (4).

    Parameters are those of `exact_marginals`.

    Returns
    -------
    GraphicalModel
        An undirected model over x1, x2, ..., with the cells counted row by row. It has a factor exp(-phi_u) per cell,
        and one per pair, which is exp(-k_ij) where the two labels differ and 1 where they agree.
    """
    unary, values = check_inputs(unary, values)
    cells = unary.reshape(len(unary), -1).T
    weights = pair_weights(values, params)
    differ = 1 - np.eye(len(unary))
    names = [f"x{number}" for number in range(1, len(cells) + 1)]
    of_cells = [Factor(name, np.exp(-phi)) for name, phi in zip(names, cells, strict=True)]
    of_pairs = [
        Factor((names[i], names[j]), np.exp(-weights[i, j] * differ)) for i, j in combinations(range(len(cells)), 2)
    ]
    return GraphicalModel([*of_cells, *of_pairs])


def exact_marginals(unary: ArrayLike, values: ArrayLike, params: CrfParams) -> NDArray[np.float64]:
    """Compute the marginal distribution of every cell by a sum over all labellings.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    (C, H, W) float64
        P(x_i = l): what mean field's Q approximates.

    Raises
    ------
    ArgumentError
        When shapes don't fit, numbers aren't what they should be, there are more than `MAX_LABELLINGS` labellings, or
        weights and costs contradict each other by more than `MAX_ENERGY`.

    Examples
    --------
    Two cells that attract each other, one of them for class 0, the other undecided:

    >>> from semgrid_edu.crf import unary_from_probability
    >>> unary = unary_from_probability([[[0.8, 0.5]], [[0.2, 0.5]]])
    >>> exact_marginals(unary, np.full((4, 1, 2), 0.25), CrfParams())[0].round(2)
    array([[0.8 , 0.78]])
    """
    model, shape = _tiny_model(unary, values, params)
    # All cells are coupled to all others, so nothing can be summed out early: this is a table of all labellings.
    joint = eliminate(model, model.names).normalised()
    return np.stack([joint.marginal(name).table for name in model.names], axis=1).reshape(shape)


def most_likely(unary: ArrayLike, values: ArrayLike, params: CrfParams) -> NDArray[np.int64]:
    """Find the labelling with the lowest energy, the exact minimum of eq. (3).

    Parameters are those of `exact_marginals`, and so are errors.

    Returns
    -------
    (H, W) int64
        The class of each cell; if several labellings share the lowest energy, one of them.
    """
    model, shape = _tiny_model(unary, values, params)
    best = max_product(model)
    return np.array([best[name] for name in model.names]).reshape(shape[1:])


def log_partition(unary: ArrayLike, values: ArrayLike, params: CrfParams) -> float:
    """Compute log Z, the logarithm of the sum of exp(-E(x)) over all labellings.

    Parameters are those of `exact_marginals`, and so are errors.

    Returns
    -------
    float
        In nats. The `free_energy` of Q plus log Z is KL(Q || P).
    """
    unary, _ = check_inputs(unary, values)
    model, _ = _tiny_model(unary, values, params)
    return float(log_total(model) - unary.min(axis=0).sum(dtype=np.float64))


def _tiny_model(unary: ArrayLike, values: ArrayLike, params: CrfParams) -> tuple[GraphicalModel, tuple[int, ...]]:
    """Return the model, with costs relative to each cell's cheapest class, and (C, H, W); too many labellings raise."""
    unary, values = check_inputs(unary, values)
    classes = len(unary)
    cells = unary[0].size
    if cells * np.log10(classes) > np.log10(MAX_LABELLINGS):
        expected = f"at most {MAX_LABELLINGS:,} labellings; mean_field takes more"
        raise ArgumentError("unary", expected, f"{classes} classes in {cells} cells, {classes}^{cells}")
    phi = unary.astype(np.float64)
    phi -= phi.min(axis=0)  # so that exp(-phi) neither overflows nor vanishes
    # If even simple labellings cost too much, exp(-E) is 0 for all of them, and Z too.
    candidates = [np.full(phi.shape[1:], label) for label in range(classes)] + [phi.argmin(axis=0)]
    least = min(energy(labels, phi, values, params) for labels in candidates)
    if least > MAX_ENERGY:
        expected = f"weights and costs for which a labelling costs at most {MAX_ENERGY} more than all best classes"
        raise ArgumentError("params", expected, f"{least:.4g}")
    return crf_model(phi, values, params), unary.shape

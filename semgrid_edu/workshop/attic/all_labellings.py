"""The CRF without approximation by visiting every labelling, up to 16 cells of three classes (eq. (3), (4)).

The cells are split into groups a, b and c. A labelling of all cells is one of each group, and its energy is that of the
groups plus that of the pairs between them. So exp(-E) is a product of tables over (a, b), (a, c), (b, c) and c, and the
sum over all labellings a product of matrices.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import CrfParams, pair_weights
from semgrid_edu.crf.params import check_inputs
from semgrid_edu.errors import ArgumentError

MOST_LABELLINGS = 10**8
"""A second of work."""


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
        Weights, widths and normalisation; a labelling's pair costs have to be some hundreds at most, since exp(-700) is
        nearly the smallest number.

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
    parts = np.split(np.arange(cells), [cells // 4, cells // 2])
    groups = [_Group.of(phi[part], weights[np.ix_(part, part)]) for part in parts]
    a, b, c = groups
    ab, ac, bc = (
        _between(groups[g], groups[h], weights[np.ix_(parts[g], parts[h])], classes)
        for g, h in ((0, 1), (0, 2), (1, 2))
    )
    ab += a.energy[:, None] + b.energy
    totals, log_z = _sums(ab, ac, bc, c.energy)
    marginals = np.concatenate([total @ group.chosen for total, group in zip(totals, groups, strict=True)])
    best = _best(ab, ac, bc, c.energy)
    labels = np.concatenate([group.labels[k] for group, k in zip(groups, best, strict=True)])
    return ExactCrf(marginals.reshape(cells, classes).T.reshape(unary.shape), labels.reshape(unary.shape[1:]), log_z)


class _Group(NamedTuple):
    """All labellings of some cells: (L, n) classes, the same as (L, n C) zeros and ones, and (L,) energies."""

    labels: NDArray[np.int64]
    chosen: NDArray[np.float64]
    energy: NDArray[np.float64]

    @classmethod
    def of(cls, phi: NDArray, weights: NDArray) -> "_Group":
        cells, classes = phi.shape
        labels = np.array(list(product(range(classes), repeat=cells)), dtype=np.int64)
        chosen = np.eye(classes)[labels].reshape(len(labels), cells * classes)
        agree = np.einsum("lk,lk->l", chosen @ np.kron(weights, np.eye(classes)), chosen)  # each pair twice
        return cls(labels, chosen, chosen @ phi.ravel() + (weights.sum() - agree) / 2)


def _between(one: _Group, other: _Group, weights: NDArray, classes: int) -> NDArray[np.float64]:
    """Return what the pairs between two groups cost, for all labellings of both: the weights where labels differ."""
    return weights.sum() - one.chosen @ np.kron(weights, np.eye(classes)) @ other.chosen.T


def _sums(ab: NDArray, ac: NDArray, bc: NDArray, c: NDArray) -> tuple[list[NDArray], float]:
    """Return the probabilities of the labellings of each group, and log Z."""
    p_ab, p_c, with_a, with_b = np.exp(ab.min() - ab), np.exp(c.min() - c), np.exp(-ac), np.exp(-bc)
    joint = p_ab * ((with_a * p_c) @ with_b.T)
    last = p_c * (with_a * (p_ab @ with_b)).sum(axis=0)
    Z = last.sum()
    return [joint.sum(axis=1) / Z, joint.sum(axis=0) / Z, last / Z], float(np.log(Z) - ab.min() - c.min())


def _best(ab: NDArray, ac: NDArray, bc: NDArray, c: NDArray) -> tuple[int, int, int]:
    """Return the labelling of each group in the labelling of least energy."""
    found = []
    for k in range(len(ab)):
        energy = ab[k][:, None] + bc + (ac[k] + c)
        place = np.unravel_index(energy.argmin(), energy.shape)
        found.append((energy[place], k, *place))
    return min(found)[1:]

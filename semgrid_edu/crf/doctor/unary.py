"""Faults of the unary term: scores, probabilities or logarithms in the place of energies (eq. (3)).

Costs that would come from a distribution if they were all multiplied by one number.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from semgrid_edu.crf.doctor.finding import Finding, in_cells
from semgrid_edu.crf.doctor.shapes import reshaped

SAMPLE = 500
"""Cells that are looked at."""


def scale_of(phi: NDArray) -> float | None:
    """Find the t for which sum_l exp(-t phi(l)) is 1 in every cell: log 10 for logarithms to base 10.

    In a cell whose costs are all positive the sum falls from C at t = 0 to 0, so there is one t, which is found by
    bisection. Only if it is the same in all cells do the costs come from a distribution.

    Parameters
    ----------
    phi : (C, H, W) float
        Costs.

    Returns
    -------
    float or None
        t; None when there is no such number.
    """
    cells = phi.reshape(len(phi), -1)
    cells = cells[:, :: max(1, cells.shape[1] // SAMPLE)]
    cells = cells[:, (cells.min(axis=0) > 1e-4) & (np.diff(np.sort(cells, axis=0)[:2], axis=0)[0] > 1e-3)]
    if cells.shape[1] < 16:
        return None
    low, high = np.full((2, cells.shape[1]), [[1e-3], [1e3]])
    for _ in range(60):
        middle = np.sqrt(low * high)
        above = logsumexp(-middle * cells, axis=0) > 0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    inner = np.quantile(low, [0.05, 0.5, 0.95])
    return float(inner[1]) if inner[2] < 1.02 * inner[0] else None


CLOSE = 0.02
"""How far the logarithm of a sum may be from 0; probabilities kept as float16, or raised by 1e-3 each, are nearer."""

ONE_COLOUR = "The refined map is one colour, or nearly so."
WORSE = "The CRF makes everything worse: labels that were right before are wrong after it."
CONVERT = "unary_from_probability(g) of probabilities g, or -log_softmax(scores, axis=0) of scores."


def unary_fault(unary: NDArray) -> Finding | None:
    """Find out what is wrong with the unary term.

    Parameters
    ----------
    unary : (C, H, W) float or int
        The costs of the classes, as they are supposed to be.

    Returns
    -------
    Finding or None
        The first fault, which may explain others; None when sum_l exp(-phi(l)) is 1 in each cell, as it should be.
    """
    phi = unary.astype(np.float64)
    for fault in (_float16, _nan, _one_class, _many_classes, _undecided, _log_probability, _never_or_always):
        if finding := fault(unary if fault is _float16 else phi):
            return finding
    total = logsumexp(-phi, axis=0)
    if (np.abs(total) <= CLOSE).all():
        return None
    for fault in (_probability, _constant_class, _elsewhere, _scaled, _scores):
        if finding := fault(phi):
            return finding
    return _no_distribution(np.exp(total), unary.dtype)


def _float16(unary: NDArray) -> Finding | None:
    if unary.dtype != np.float16 or np.isfinite(unary).all():
        return None
    return Finding(
        "float16 overflow",
        "Classes disappear that the network still gave a small probability, or labels look weird in single cells.",
        f"`unary` is float16 and {(~np.isfinite(unary)).sum():,} of its {unary.size:,} numbers are infinite or NaN.",
        "Below 6e-8 a probability is 0 in float16, and its logarithm infinite; above 65504 every number is infinite.",
        "In float32, and the logarithm of the soft-max in one step: -log_softmax(scores.float()).",
    )


def _nan(phi: NDArray) -> Finding | None:
    where = np.isnan(phi).any(axis=0)
    if not where.any():
        return None
    return Finding(
        "NaN in the unary",
        "The CRF stops with an ArgumentError; other packages return NaN, or label 0, in every cell.",
        f"There is a NaN in {in_cells(where)}; the first is cell {tuple(int(i) for i in np.argwhere(where)[0])}.",
        "0 / 0 where probabilities were normalised, log of a negative number, inf - inf, or a network that diverged.",
        "Look for it in the network's scores first. If they are finite, take log_softmax of them in one step.",
    )


def _one_class(phi: NDArray) -> Finding | None:
    if len(phi) > 1:
        return None
    return Finding(
        "one class",
        "The refined map is 0 everywhere, whatever the parameters.",
        "`unary` has only one class, so each cell has only one label to choose.",
        "The network has one output, the probability of the object.",
        "The background is a class too: unary_from_probability(np.stack([1 - p, p])).",
    )


def _many_classes(phi: NDArray) -> Finding | None:
    if len(phi) < 255:
        return None
    return Finding(
        "ignore label",
        "The CRF is slow, most classes never occur, and cells that should be ignored have a class of their own.",
        f"`unary` has {len(phi)} classes, {len(phi) - len(np.unique(phi.argmin(axis=0)))} of them the best of no cell.",
        "Labels up to 255 were turned into one-hot vectors; 255 usually means that a cell is unlabelled.",
        "Leave out the label 255, and give unlabelled cells the same cost for every class.",
    )


def _undecided(phi: NDArray) -> Finding | None:
    spread = spread_of(phi)
    if np.mean(spread < 0.05) < 0.99:
        return None
    return Finding(
        "undecided network",
        f"{ONE_COLOUR} Or it has patches that aren't in the scene.",
        f"In {in_cells(spread < 0.05)} all possible classes cost the same within 0.05.",
        "The network isn't trained, its weights weren't loaded, or its scores are far too small.",
        "Look at the labels before the CRF: g.argmax(axis=0). The CRF can't find what the network doesn't see.",
    )


def _log_probability(phi: NDArray) -> Finding | None:
    if phi.max() > CLOSE or np.mean(np.abs(logsumexp(phi, axis=0)) <= CLOSE) < 0.99:
        return None
    return Finding(
        "log probabilities",
        WORSE,
        f"All numbers of `unary` are negative or 0 ({phi.min():.3g} to {phi.max():.3g}), and their exponentials sum to "
        "one: these are logarithms of probabilities.",
        "The minus sign is missing. The CRF takes costs, so it prefers the class that the network finds least likely.",
        "unary_from_log_probability(log_g), which is -log_g.",
    )


def _never_or_always(phi: NDArray) -> Finding | None:
    """Judge cells where mean field would have to compute inf - inf."""
    always, never = np.isneginf(phi).any(axis=0), np.isposinf(phi).all(axis=0)
    if not (always | never).any():
        return None
    what = "a class costs -inf" if always.any() else "every class costs inf"
    return Finding(
        "infinite costs",
        "The CRF stops with an ArgumentError; other packages return NaN, and the labels look weird.",
        f"In {in_cells(always if always.any() else never)} {what}, so no probabilities follow from the costs.",
        "Probabilities above 1 or infinite scores for -inf; for inf, cells whose probabilities are all 0.",
        "Probabilities must sum to one in each cell. Where nothing is known give every class the same.",
    )


def _probability(phi: NDArray) -> Finding | None:
    total = phi.sum(axis=0)
    whole = {1: "", 100: " in per cent", 255: " in 255ths"}
    match = next((unit for unit in whole if np.mean(np.abs(total / unit - 1) < CLOSE) >= 0.99), None)
    if match is None or phi.min() < 0:
        return None
    return Finding(
        "probabilities",
        f"{WORSE} {ONE_COLOUR}",
        f"The numbers of `unary` lie between {phi.min():.3g} and {phi.max():.3g} and sum to {match} in each cell.",
        f"These are probabilities{whole[match]}. As costs they say the opposite: the likely class costs most.",
        "unary_from_probability(g), which is -log g" + (f", with g divided by {match}." if match > 1 else "."),
    )


def _constant_class(phi: NDArray) -> Finding | None:
    """Look for a class whose cost is the same everywhere, beside classes whose costs vary."""
    constant = np.ptp(phi, axis=(1, 2)) <= 1e-6
    if phi[0].size < 16 or not 0 < constant.sum() < len(phi) - 1:
        return None
    rest = np.mean(np.abs(logsumexp(-phi[~constant], axis=0)) <= CLOSE) >= 0.99
    return Finding(
        "ignore label",
        f"{ONE_COLOUR} Its colour is that of a class that nobody has labelled.",
        f"Class {constant.argmax()} costs {phi[constant.argmax(), 0, 0]:.3g} in every cell"
        + (", and the probabilities of the other classes already sum to one." if rest else "."),
        "A plane for unlabelled cells (255, -1 or void) was kept among the classes.",
        "Leave it out. Where a cell has no label, give all classes the same cost.",
    )


def _elsewhere(phi: NDArray) -> Finding | None:
    """Look for distributions along another axis, or in the order of memory."""
    for axes in (1, 2, (1, 2), (0, 1, 2)):
        if np.mean(np.abs(logsumexp(-phi, axis=axes)) <= CLOSE) >= 0.99:
            return Finding(
                "soft-max over the wrong axis",
                f"{WORSE} In single rows or columns a class is preferred that isn't there.",
                f"exp(-unary) sums to one along axis {axes}, not along axis 0, the classes.",
                "The soft-max was taken over rows or columns, or the classes lie on that axis.",
                "Take it over the axis of the classes, and bring that axis to the front: (C, H, W).",
            )
    in_memory = phi.reshape(*phi.shape[1:], -1)
    return reshaped("unary", phi.shape) if np.mean(np.abs(logsumexp(-in_memory, axis=-1)) <= CLOSE) >= 0.99 else None


def _scaled(phi: NDArray) -> Finding | None:
    factor = scale_of(phi)
    if factor is None or abs(factor - 1) < CLOSE:
        return None
    base = next((base for base in (10, 2) if abs(factor / np.log(base) - 1) < CLOSE), None)
    cause = f"The logarithm was taken to base {base}." if base else f"Costs, not scores, were divided by {factor:.4g}."
    return Finding(
        "scaled costs",
        "The CRF smooths more, or less, than the same weights do elsewhere.",
        f"exp(-unary) doesn't sum to one, but exp(-{factor:.4g} unary) does, in the cells looked at.",
        cause,
        "Natural logarithms: -np.log(g)."
        if base
        else "If that is a temperature, normalise after it: -log_softmax(scores / T, axis=0). The marginals stay the "
        "same, and energies and log Z become comparable.",
    )


def _scores(phi: NDArray) -> Finding | None:
    if len(phi) < 3 or phi.shape[1] * phi.shape[2] < 16:
        return None
    ranked = np.sort(phi, axis=0)
    lead, behind = np.median(ranked[-1] - ranked[-2]), np.median(ranked[1] - ranked[0])
    total = logsumexp(-phi, axis=0)
    if not behind < lead < np.inf or np.mean(np.abs(total) <= CLOSE) > 0.5:
        return None
    return Finding(
        "scores",
        WORSE,
        f"exp(-unary) doesn't sum to one, and in each cell the largest number stands out (by {lead:.2g}, median), the "
        f"smallest doesn't (by {behind:.2g}).",
        "These are probably a network's scores (logits): high for the best class. A cost is low for the best class.",
        "-log_softmax(scores, axis=0): the minus sign makes costs of them, the soft-max sets their level.",
    )


def _no_distribution(total: NDArray, dtype: np.dtype) -> Finding:
    off = ~(np.abs(np.log(total)) <= CLOSE)
    cause = "These may be scores, with or without a minus sign, or costs to which something was added."
    if off.mean() < 0.5:
        cause = (
            "In the other cells it does, so these cells were overwritten, padded, or put together from several grids."
        )
    if dtype.kind in "iub":
        cause = f"The costs are whole numbers ({dtype}): they were rounded, or these are labels or pixels."
    return Finding(
        "no distribution",
        "The CRF runs, but its energies and log Z can't be compared; with a wrong sign it makes everything worse.",
        f"exp(-unary) should sum to one over the classes; in {in_cells(off)} it doesn't (median there "
        f"{np.median(total[off]):.3g}).",
        cause,
        f"{CONVERT} If the sign is right, mean field gives the same labels after that as before.",
    )


def spread_of(phi: NDArray) -> NDArray[np.float64]:
    """Tell how much the dearest possible class of a cell costs above its cheapest.

    Parameters
    ----------
    phi : (C, H, W) float
        Costs; infinite for impossible classes.

    Returns
    -------
    (H, W) float64
        The difference; infinite where only one class is possible.
    """
    possible = np.isfinite(phi)
    spread = np.where(possible, phi, -np.inf).max(axis=0) - phi.min(axis=0)
    return np.where(possible.sum(axis=0) > 1, spread, np.inf)

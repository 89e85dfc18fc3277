"""Faults of the occupancy probabilities that the bilateral kernel compares (eq. (4)).

What the refined map shows: one label, an ignore label, the opposite of the network, or nothing new.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax

from semgrid_edu.crf.doctor.finding import Finding, in_cells
from semgrid_edu.crf.doctor.shapes import reshaped
from semgrid_edu.crf.doctor.unary import CONVERT, WORSE

FEW = 100
"""Cells. The grids that are computed by hand may well get one label."""


def refined_fault(refined: NDArray, phi: NDArray) -> Finding | None:
    """Find out what is wrong with a refined map.

    Parameters
    ----------
    refined : (C, H, W) float or (H, W) int
        Q, or a label for each cell.
    phi : (C, H, W) float64
        The costs of the classes.

    Returns
    -------
    Finding or None
        The first fault, if there is any.
    """
    if refined.shape not in (phi.shape, phi.shape[1:]):
        return _shape(refined, phi)
    if refined.ndim == 3 and (finding := _no_distribution(refined) or _unchanged(refined, phi)):
        return finding
    labels = refined.argmax(axis=0) if refined.ndim == 3 else refined
    return _no_class(labels, len(phi)) or _one_label(labels, phi) or _opposite(labels, phi)


def _shape(refined: NDArray, phi: NDArray) -> Finding:
    return Finding(
        "refined has another shape",
        "Refined labels look shuffled, or lie in another place than the labels before.",
        f"`refined` has the shape {refined.shape}; the unary term has {phi.shape}.",
        "Another frame, another grid, axes in another order, or a flattened array.",
        f"Hand over Q as mean_field returns it, {phi.shape}, or its labels, {phi.shape[1:]}.",
    )


def _no_distribution(Q: NDArray) -> Finding | None:
    if np.isfinite(Q).all() and Q.min() >= 0 and np.abs(Q.sum(axis=0, dtype=np.float64) - 1).max() < 0.02:
        return None
    return Finding(
        "refined holds no probabilities",
        "Labels look weird after the CRF, or every cell has label 0, which arg-max gives for NaN.",
        f"`refined` lies between {np.fmin.reduce(Q, axis=None):.3g} and {np.fmax.reduce(Q, axis=None):.3g}, and "
        f"{np.isnan(Q).sum():,} of its {Q.size:,} numbers are NaN.",
        "NaN, infinite costs or probabilities of 0 went into another implementation, or `refined` isn't Q.",
        "Check the unary term. mean_field refuses what it can't refine, and takes inf for an impossible class.",
    )


def _unchanged(Q: NDArray, phi: NDArray) -> Finding | None:
    if phi[0].size == 1 or np.abs(Q - softmax(-phi, axis=0)).max() > 1e-6:
        return None
    return Finding(
        "refinement without effect",
        "The CRF does nothing: the refined map is the map before it.",
        "`refined` is the network's own distribution, to six digits in every cell.",
        "No iterations, weights of 0, widths that reach no neighbour, or the wrong array was handed over.",
        "mean_field(unary, values, CrfParams.for_cells(cell), iterations=10).",
    )


def _no_class(labels: NDArray, n_classes: int) -> Finding | None:
    outside = (labels < 0) | (labels >= n_classes) | (labels != np.rint(labels))
    if not outside.any():
        return None
    return Finding(
        "ignore label",
        "Metrics and colours stop with an IndexError, or count a class that doesn't exist.",
        f"{outside.sum():,} of {outside.size:,} refined labels are none of the classes 0 to {n_classes - 1}: "
        f"{', '.join(f'{label:g}' for label in np.unique(labels[outside])[:5])}.",
        "A label for cells to ignore (255 or -1) is among them. The CRF gives every cell a class.",
        "Hide cells where you count or draw: confusion_matrix leaves out those whose truth is `ignore`.",
    )


def _one_label(labels: NDArray, phi: NDArray) -> Finding | None:
    if labels.size < FEW or np.ptp(labels) > 0:
        return None
    before = np.unique(phi.argmin(axis=0))
    cause = "The pairs outweigh the network: weights too large, widths too wide, or no normalisation."
    if len(before) == 1:
        cause = "The network already gives every cell one label, so the CRF has nothing to refine."
    return Finding(
        "one label",
        "The refined map is one colour.",
        f"Every cell of `refined` has label {labels.flat[0]:g}; before it, {len(before)} different labels were there.",
        cause,
        "If a fault stands above this one, mend it first. Then try the default parameters, CrfParams.for_cells(cell).",
    )


def _opposite(labels: NDArray, phi: NDArray) -> Finding | None:
    best, worst = np.mean(labels == phi.argmin(axis=0)), np.mean(labels == phi.argmax(axis=0))
    if worst <= best or labels.size < FEW:
        return None
    return Finding(
        "refined prefers what costs most",
        WORSE,
        f"{worst:.0%} of the refined labels are the dearest class of their cell, {best:.0%} the cheapest.",
        "The refinement was made with the opposite sign: scores, log probabilities or probabilities as costs.",
        f"Hand the refinement costs: {CONVERT}",
    )


REFUSED = "The CRF stops with an ArgumentError about `values`."
NORMALISE = "Hand over `belief.probability`, or divide by the sum: values / values.sum(axis=0)."


def states_fault(values: NDArray) -> Finding | None:
    """Find out what is wrong with the occupancy probabilities.

    Parameters
    ----------
    values : (4, H, W) float or int
        The probabilities, as they are supposed to be.

    Returns
    -------
    Finding or None
        The first fault; None when they sum to one in each cell.
    """
    values = values.astype(np.float64)
    if not np.isfinite(values).all():
        return _not_finite(values)
    total = values.sum(axis=0)
    if values.min() >= -1e-3 and np.abs(total - 1).max() <= 1e-3:
        return None
    for fault in (_logarithms, _in_other_units, _reshaped, _without_state, _counts):
        if finding := fault(values, total):
            return finding
    off = (np.abs(total - 1) > 1e-3) | (values.min(axis=0) < -1e-3)
    return Finding(
        "states don't sum to one",
        REFUSED,
        f"In {in_cells(off)} the four numbers of `values` aren't probabilities: they lie between {values.min():.3g} "
        f"and {values.max():.3g}, and sum to {total.min():.3g} to {total.max():.3g}.",
        "They were scaled, rounded, interpolated from another grid without normalisation, or are another quantity.",
        NORMALISE,
    )


def _not_finite(values: NDArray) -> Finding:
    bad = ~np.isfinite(values).all(axis=0)
    return Finding(
        "NaN in the states",
        REFUSED,
        f"In {in_cells(bad)} `values` holds NaN or infinity.",
        "0 / 0 where nothing was observed, or the velocities of a belief, which are NaN in cells at rest.",
        "Hand over `belief.probability`; where nothing was observed, UNKNOWN has probability 1.",
    )


def _logarithms(values: NDArray, total: NDArray) -> Finding | None:
    signs = [sign for sign in (1, -1) if np.abs(logsumexp(sign * values, axis=0)).max() < 0.02]
    if not signs:
        return None
    exp = "np.exp(values)" if signs[0] > 0 else "np.exp(-values)"
    return Finding(
        "logarithms of states",
        REFUSED,
        f"`values` lies between {values.min():.3g} and {values.max():.3g}, and {exp} sums to one.",
        "The states are compared as probabilities, not as logarithms or costs; only the unary term is a cost.",
        f"{exp} in place of values.",
    )


def _in_other_units(values: NDArray, total: NDArray) -> Finding | None:
    units = {100: "per cent", 255: "255ths, the grey levels of an image"}
    # Cut off to whole numbers, four of them may lack almost one unit each.
    unit = next((unit for unit in units if np.abs(total - unit).max() < 4), None)
    if unit is None or values.min() < 0:
        return None
    return Finding(
        "states in other units",
        REFUSED,
        f"The four numbers of each cell of `values` sum to {unit} (largest {values.max():.3g}).",
        f"They are given in {units[unit]}. The width sigma_beta is in probability, so cells would seem far apart.",
        f"values / {unit}, and then divided by its sum where it was rounded.",
    )


def _reshaped(values: NDArray, total: NDArray) -> Finding | None:
    in_memory = values.reshape(*values.shape[1:], -1)
    if values.min() < -1e-3 or np.abs(in_memory.sum(axis=-1) - 1).max() > 1e-3:
        return None
    return reshaped("values", values.shape)


def _without_state(values: NDArray, total: NDArray) -> Finding | None:
    empty = (values == 0).all(axis=0)
    if not empty.any() or np.abs(total[~empty] - 1).max(initial=0) > 1e-3:
        return None
    return Finding(
        "cells without a state",
        REFUSED,
        f"In {in_cells(empty)} all four numbers of `values` are 0; in the others they sum to one.",
        "Cells that no beam has reached were left empty, or the grid was padded.",
        "What nobody has seen is UNKNOWN: set values[State.UNKNOWN] to 1 there.",
    )


def _counts(values: NDArray, total: NDArray) -> Finding | None:
    if values.min() < 0 or not (values == np.rint(values)).all() or total.max() <= 1:
        return None
    return Finding(
        "counts of states",
        REFUSED,
        f"`values` holds whole numbers up to {values.max():.0f}, and their sums differ: {total.min():.0f} to "
        f"{total.max():.0f} in a cell.",
        "These are counts, such as hits of beams in a cell, not probabilities.",
        f"{NORMALISE} Cells without a count are UNKNOWN.",
    )

"""Faults of the occupancy probabilities that the bilateral kernel compares (eq. (4))."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from semgrid_edu.crf.faults.finding import Finding, in_cells
from semgrid_edu.crf.faults.shapes import reshaped

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

"""Faults of the two distributions that the CRF is given: costs of the classes (eq. (3)) and states (eq. (4))."""

from collections.abc import Iterator
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from semgrid_edu.crf.doctor.finding import Finding, finding, in_cells

SAMPLE = 500
"""At most this many cells are looked at for a common factor of their costs."""

CLOSE = 0.02
"""How far a sum of probabilities may be from 1, or its logarithm from 0. Rounding to float16 moves it by less."""

UNITS = {100: "per cent", 255: "255ths"}
"""What probabilities sum to that are given as percentages or grey levels."""


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
    fault = next(chain(_no_number(unary, phi), _no_choice(phi), _log_probability(phi), _infinite(phi)), None)
    total = logsumexp(-phi, axis=0)
    if fault or (np.abs(total) <= CLOSE).all():
        return fault
    others = chain(_probability(phi), _constant_class(phi), _elsewhere(phi), _scaled(phi), _scores(phi))
    return next(others, None) or _no_distribution(np.exp(total), unary.dtype)


def sum_to_one(totals: NDArray) -> bool:
    """Tell whether these are sums of probabilities: nearly all of them nearly 1.

    Parameters
    ----------
    totals : (...) float
        Sums over classes or states, of many cells.
    """
    return bool(np.mean(np.abs(totals - 1) <= CLOSE) >= 0.99)


def _total(phi: NDArray, axis: int | tuple[int, ...] = 0) -> NDArray:
    """Sum exp(-phi). A sum beyond e becomes e: it is far from 1 in any case, and could overflow."""
    return np.exp(np.minimum(logsumexp(-phi, axis=axis), 1))


def _no_number(unary: NDArray, phi: NDArray) -> Iterator[Finding]:
    if unary.dtype == np.float16 and not np.isfinite(unary).all():
        yield finding("float16 overflow", bad=(~np.isfinite(unary)).sum(), size=unary.size)
    where = np.isnan(phi).any(axis=0)
    if where.any():
        yield finding("NaN in the unary", cells=in_cells(where), first=tuple(np.argwhere(where)[0].tolist()))


def _no_choice(phi: NDArray) -> Iterator[Finding]:
    if len(phi) == 1:
        yield finding("one class")
    if len(phi) >= 255:
        unused = len(phi) - len(np.unique(phi.argmin(axis=0)))
        yield finding("ignore label/many classes", classes=len(phi), unused=unused)
    same = spread_of(phi) < 0.05
    if same.mean() >= 0.99:
        yield finding("undecided network", cells=in_cells(same))


def _log_probability(phi: NDArray) -> Iterator[Finding]:
    if phi.max() <= CLOSE and sum_to_one(_total(-phi)):
        yield finding("log probabilities", low=phi.min(), high=phi.max())


def _infinite(phi: NDArray) -> Iterator[Finding]:
    """Look for cells where mean field would have to compute inf - inf."""
    always, never = np.isneginf(phi).any(axis=0), np.isposinf(phi).all(axis=0)
    for where, what in ((always, "a class costs -inf"), (never, "every class costs inf")):
        if where.any():
            yield finding("infinite costs", cells=in_cells(where), what=what)


def _probability(phi: NDArray) -> Iterator[Finding]:
    sums, ends = phi.sum(axis=0), {"low": phi.min(), "high": phi.max()}
    total = next((unit for unit in (1, *UNITS) if sum_to_one(sums / unit)), None)
    if total == 1 and phi.min() >= 0:
        yield finding("probabilities", **ends)
    elif total and phi.min() >= 0:
        yield finding("probabilities/in other units", total=total, unit=UNITS[total], **ends)


def _constant_class(phi: NDArray) -> Iterator[Finding]:
    """Look for a class whose cost is the same everywhere, beside classes whose costs vary."""
    constant = np.ptp(phi, axis=(1, 2)) <= 1e-6
    if phi[0].size >= 16 and 0 < constant.sum() < len(phi) - 1:
        complete = sum_to_one(_total(phi[~constant]))
        rest = ", and the probabilities of the other classes already sum to one" if complete else ""
        label = constant.argmax()
        yield finding("ignore label/one plane", label=label, cost=phi[label, 0, 0], rest=rest)


def _elsewhere(phi: NDArray) -> Iterator[Finding]:
    """Look for distributions along another axis, or in the order of memory."""
    for axes in (1, 2, (1, 2), (0, 1, 2)):
        if sum_to_one(_total(phi, axes)):
            yield finding("soft-max over the wrong axis", axes=axes)
    if sum_to_one(_total(phi.reshape(*phi.shape[1:], -1), -1)):
        yield _reshaped("unary", phi)


def _scaled(phi: NDArray) -> Iterator[Finding]:
    factor = scale_of(phi)
    if factor is not None and abs(factor - 1) >= CLOSE:
        base = next((base for base in (10, 2) if abs(factor / np.log(base) - 1) < CLOSE), None)
        yield finding("scaled costs/logarithms" if base else "scaled costs", factor=factor, base=base)


def _scores(phi: NDArray) -> Iterator[Finding]:
    """Look for the largest number of each cell standing out, as scores have it, in place of the smallest."""
    if len(phi) < 3 or phi[0].size < 16:
        return
    ranked = np.sort(phi, axis=0)
    lead, behind = np.median(ranked[-1] - ranked[-2]), np.median(ranked[1] - ranked[0])
    if behind < lead < np.inf and np.mean(np.abs(logsumexp(-phi, axis=0)) <= CLOSE) <= 0.5:
        yield finding("scores", lead=lead, behind=behind)


def _no_distribution(total: NDArray, dtype: np.dtype) -> Finding:
    off = ~(np.abs(np.log(total)) <= CLOSE)
    variant = "/few cells" if off.mean() < 0.5 else ""
    if dtype.kind in "iub":
        variant = "/whole numbers"
    return finding(f"no distribution{variant}", cells=in_cells(off), total=np.median(total[off]), dtype=dtype)


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


def spread_of(phi: NDArray) -> NDArray[np.float64]:
    """Return how much the dearest possible class of a cell costs above its cheapest.

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
    infinite = ~np.isfinite(values).all(axis=0)
    if infinite.any():
        return finding("NaN in the states", cells=in_cells(infinite))
    total, low, high = values.sum(axis=0), values.min(), values.max()
    off = (np.abs(total - 1) > 1e-3) | (values.min(axis=0) < -1e-3)
    if not off.any():
        return None
    sums = {"high": high, "least": total.min(), "most": total.max()}
    if fault := next(chain(_log_states(values), _other_units(values), _holes(values)), None):
        return fault
    if low >= 0 and (values == np.rint(values)).all() and total.max() > 1:
        return finding("counts of states", **sums)
    return finding("states don't sum to one", cells=in_cells(off), low=low, **sums)


def _log_states(values: NDArray) -> Iterator[Finding]:
    for sign, exp in ((1, "np.exp(values)"), (-1, "np.exp(-values)")):
        if np.abs(logsumexp(sign * values, axis=0)).max() < 0.02:
            yield finding("logarithms of states", low=values.min(), high=values.max(), exp=exp)


def _other_units(values: NDArray) -> Iterator[Finding]:
    # Cut off to whole numbers, four of them may lack almost one unit each.
    total = next((unit for unit in UNITS if np.abs(values.sum(axis=0) - unit).max() < 4), None)
    if total and values.min() >= 0:
        unit = UNITS[total] + ", the grey levels of an image" * (total == 255)
        yield finding("states in other units", total=total, unit=unit, high=values.max())


def _holes(values: NDArray) -> Iterator[Finding]:
    """Look for distributions in the order of memory, and for cells that hold nothing."""
    in_memory = values.reshape(*values.shape[1:], -1)
    if values.min() >= -1e-3 and np.abs(in_memory.sum(axis=-1) - 1).max() <= 1e-3:
        yield _reshaped("values", values)
    empty = (values == 0).all(axis=0)
    if empty.any() and np.abs(values.sum(axis=0)[~empty] - 1).max(initial=0) <= 1e-3:
        yield finding("cells without a state", cells=in_cells(empty))


def _reshaped(argument: str, array: NDArray) -> Finding:
    channels_last = (*array.shape[1:], len(array))
    name = f"{argument} reshaped, not transposed"
    return finding("reshaped", name, argument=argument, channels_last=channels_last)

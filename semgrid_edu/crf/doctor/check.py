"""A doctor for the CRF: what is probably wrong with its input, parameters and result (eq. (3), (4))."""

from collections.abc import Generator, Iterator
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import softmax

from semgrid_edu.crf.doctor.distributions import spread_of, states_fault, unary_fault
from semgrid_edu.crf.doctor.finding import Finding, Findings, finding
from semgrid_edu.crf.doctor.shapes import arguments_swapped, as_numbers, oriented_unary, oriented_values
from semgrid_edu.crf.kernel import gaussian, kernels
from semgrid_edu.crf.params import PAPER_CELL, CrfParams


def check(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, refined: ArrayLike | None = None, cell: float | None = None
) -> Findings:
    """Say what is probably wrong when a CRF doesn't do what it should.

    It knows the mistakes that people make with this CRF and with others: scores or probabilities in the place of costs,
    axes in another order, widths in another unit, labels to ignore among the classes. Nothing that it is given raises
    an error. Where an axis is in the wrong place, it goes on with the axis moved, so it may name a second fault.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, or what was taken for it.
    values : (4, H, W) float
        o, the occupancy probabilities, or what was taken for them.
    params : CrfParams
        Weights, widths and normalisation.
    refined : (C, H, W) float or (H, W) int, optional
        The result of the CRF: Q, or the label of each cell.
    cell : float, optional
        Side of a cell, metres. Widths are in cells, so with it their reach can be judged.

    Returns
    -------
    list of Finding
        What was found, the most likely root first; print it. Empty when nothing was found, which is no proof that
        nothing is wrong: a check sees the numbers, not where they come from.

    Examples
    --------
    A network's probabilities, handed over as they are:

    >>> p = np.random.default_rng(0).dirichlet(np.ones(3), (20, 20)).transpose(2, 0, 1)
    >>> check(p, np.full((4, 20, 20), 0.25), CrfParams())[0].name
    'probabilities'
    >>> check(-np.log(p), np.full((4, 20, 20), 0.25), CrfParams())
    Nothing wrong was found in shapes, numbers and parameters.
    """
    with np.errstate(all="ignore"):  # numbers too large to add up are a finding, not a warning
        return Findings(_all(unary, values, params, refined, cell))


def _all(unary: object, values: object, params: object, refined: object, cell: float | None) -> Iterator[Finding]:
    """Yield what is wrong with shapes first, then with the numbers, the weights and widths, and the result."""
    phi, o = yield from _grids(unary, values)
    faults = [phi is not None and unary_fault(phi), o is not None and states_fault(o)]
    yield from filter(None, faults)
    if not isinstance(params, CrfParams):
        yield finding("no parameters", what=type(params).__name__)
    elif phi is not None or o is not None:
        of_params = list(kernel_faults(params, (o if phi is None else phi).shape[1:], cell))
        yield from of_params
        if faults == [None, None] and not of_params:
            yield from overwhelming(phi.astype(np.float64), o.astype(np.float64), params)
    if refined is not None:
        shown = yield from as_numbers("refined", refined)
        if shown is not None and phi is not None and not np.ma.is_masked(refined):
            yield from filter(None, [refined_fault(shown, phi.astype(np.float64))])


def _grids(unary: object, values: object) -> Generator[Finding, None, tuple[NDArray | None, NDArray | None]]:
    """Yield what is wrong with the shapes; return both arrays with their axes in place, or None."""
    phi = yield from as_numbers("unary", unary)
    o = yield from as_numbers("values", values)
    if phi is not None and o is not None and arguments_swapped(phi, o):
        yield finding("arguments swapped", other=len(o))
        phi, o = o, phi
    if o is not None:
        o = yield from oriented_values(o)
    if phi is not None:
        phi = yield from oriented_unary(phi, None if o is None else o.shape[1:])
    return phi, o


WEIGHT_OF = {"sigma_alpha": "w_bilateral", "sigma_gamma": "w_spatial"}
"""The weight of the kernel that each width in cells belongs to."""

LARGEST_WORLD = 100
"""Metres. A grid longer than this is rare: the LIDAR sees hardly anything there."""


def kernel_faults(params: CrfParams, shape: tuple[int, int], cell: float | None) -> Iterator[Finding]:
    """Find out which weights and widths can't be what was meant.

    Parameters
    ----------
    params : CrfParams
        Weights, widths and normalisation.
    shape : (int, int)
        H and W, the number of rows and columns of the grid.
    cell : float or None
        Side of a cell, metres, if it is known.

    Yields
    ------
    Finding
        One for each.
    """
    if params.w_bilateral == 0 and params.w_spatial == 0:
        yield finding("weights zero")
    metric = list(_in_metres(params, shape, cell))
    yield from metric or _of_other_cells(params, cell)
    used = {name: getattr(params, name) for name, weight in WEIGHT_OF.items() if getattr(params, weight) > 0}
    for name, sigma in used.items():
        of_next = gaussian(1 / sigma**2)
        if of_next < 0.05 and not metric:
            yield finding("narrow kernel", width=name, sigma=sigma, next=of_next)
        if sigma > max(shape) >= 16:
            yield finding("wide kernel", width=name, sigma=sigma, shape=shape)
    if params.w_bilateral > 0 and params.sigma_beta > 3:
        # Two certain, different states lie sqrt(2) apart.
        yield finding("blind to occupancy", sigma=params.sigma_beta, share=gaussian(2 / params.sigma_beta**2))


def _in_metres(params: CrfParams, shape: tuple[int, int], cell: float | None) -> Iterator[Finding]:
    """Suspect a width that has the number of the default in metres; it would be right for cells of a metre."""
    metres = CrfParams.for_cells(1.0)
    same = [name for name in WEIGHT_OF if np.isclose(getattr(params, name), getattr(metres, name), rtol=0.05)]
    if same and (cell <= 0.7 if cell else max(shape) > LARGEST_WORLD):
        world = f"the cells are {cell:g} m" if cell else f"with cells of 1 m the grid would be {max(shape)} m long"
        widths = ", ".join(f"{name} = {getattr(params, name):g}" for name in same)
        yield finding("widths in metres", same=widths, world=world, cell=cell or "cell")


def _of_other_cells(params: CrfParams, cell: float | None) -> Iterator[Finding]:
    given, default = ([getattr(crf, name) for name in WEIGHT_OF] for crf in (params, CrfParams()))
    if cell and given == default and not 0.75 < cell / PAPER_CELL < 1.34:
        numbers = {"given": params, "right": CrfParams.for_cells(cell), "reach": [sigma * cell for sigma in given]}
        yield finding("widths for another grid", paper=PAPER_CELL, cell=cell, **numbers)


def overwhelming(phi: NDArray, values: NDArray, params: CrfParams) -> Iterator[Finding]:
    """Compare what the pairs of a cell can weigh together with what its own costs can.

    Parameters
    ----------
    phi : (C, H, W) float64
        The costs of the classes.
    values : (4, H, W) float64
        The occupancy probabilities.
    params : CrfParams
        Weights, widths and normalisation.

    Yields
    ------
    Finding
        One, when the pairs weigh far more.
    """
    pull, own = pair_sum(values, params), float(np.median(spread_of(phi)))
    if pull > 50 and pull > 10 * own:
        variant = "/as printed" if params.normalization == "none" else ""
        yield finding(f"pairs outweigh the network{variant}", pull=pull, own=own)


def pair_sum(values: NDArray, params: CrfParams) -> float:
    """Add up the pair weights of a cell, eq. (4).

    Parameters
    ----------
    values : (4, H, W) float64
        The occupancy probabilities.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    float
        The mean of a few cells, spread over the grid. With symmetric normalisation the sum of the two weights, which a
        cell's pairs have on average if it has many neighbours.
    """
    if params.normalization == "symmetric":
        return params.w_bilateral + params.w_spatial
    few = slice(None, None, max(1, values[0].size // 50))
    bilateral, spatial = (kernel.sum(axis=1).mean() - 1 for kernel in kernels(values, params, few))
    return float(params.w_bilateral * bilateral + params.w_spatial * spatial)


FEW = 100
"""Cells. A grid smaller than this, such as one computed by hand, may well get a single label."""


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
        return finding("refined has another shape", shape=refined.shape, right=phi.shape, grid=phi.shape[1:])
    if refined.ndim == 2:
        return next(_refined_labels(refined, phi), None)
    return next(chain(_refined_distributions(refined, phi), _refined_labels(refined.argmax(axis=0), phi)), None)


def _refined_distributions(Q: NDArray, phi: NDArray) -> Iterator[Finding]:
    if not (np.isfinite(Q).all() and Q.min() >= 0 and np.abs(Q.sum(axis=0, dtype=np.float64) - 1).max() < 0.02):
        low, high = np.fmin.reduce(Q, axis=None), np.fmax.reduce(Q, axis=None)
        yield finding("refined holds no probabilities", low=low, high=high, nan=np.isnan(Q).sum(), size=Q.size)
    if phi[0].size > 1 and not np.abs(Q - softmax(-phi, axis=0)).max() > 1e-6:
        yield finding("refinement without effect")


def _refined_labels(labels: NDArray, phi: NDArray) -> Iterator[Finding]:
    last = len(phi) - 1
    outside = (labels < 0) | (labels > last) | (labels != np.rint(labels))
    if outside.any():
        few = ", ".join(f"{label:g}" for label in np.unique(labels[outside])[:5])
        yield finding("ignore label/refined", outside=outside.sum(), size=labels.size, last=last, labels=few)
    if labels.size < FEW:
        return
    if np.ptp(labels) == 0:
        before = len(np.unique(phi.argmin(axis=0)))
        yield finding("one label/before too" if before == 1 else "one label", label=labels.flat[0], before=before)
    best, worst = np.mean(labels == phi.argmin(axis=0)), np.mean(labels == phi.argmax(axis=0))
    if worst > best:
        yield finding("refined prefers what costs most", best=best, worst=worst)

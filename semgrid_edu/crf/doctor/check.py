"""A doctor for the CRF: what is probably wrong with its input and parameters, each with its symptom (eq. (3), (4))."""

from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf.doctor.distributions import states_fault, unary_fault
from semgrid_edu.crf.doctor.finding import Finding, Findings, finding
from semgrid_edu.crf.doctor.kernels import kernel_faults, overwhelming
from semgrid_edu.crf.doctor.refined import refined_fault
from semgrid_edu.crf.doctor.shapes import arguments_swapped, as_numbers, oriented_unary, oriented_values
from semgrid_edu.crf.params import CrfParams


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
    """Yield shapes first, then what the numbers mean, then kernels, then the result."""
    phi, o = yield from _grids(unary, values)
    faults = [phi is not None and unary_fault(phi), o is not None and states_fault(o)]
    yield from filter(None, faults)
    if not isinstance(params, CrfParams):
        yield finding("no parameters", what=type(params).__name__)
    elif phi is not None or o is not None:
        kernels = list(kernel_faults(params, (o if phi is None else phi).shape[1:], cell))
        yield from kernels
        if faults == [None, None] and not kernels:
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

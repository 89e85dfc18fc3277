"""Faults of weights and widths: kernels that reach nobody, everybody, or count for nothing (eq. (4))."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf.doctor.distributions import spread_of
from semgrid_edu.crf.doctor.finding import Finding, finding
from semgrid_edu.crf.kernel import gaussian, kernels
from semgrid_edu.crf.params import PAPER_CELL, CrfParams

REACH = {"sigma_alpha": "w_bilateral", "sigma_gamma": "w_spatial"}
"""The widths in cells, and the weights of their kernels."""

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
    used = {name: getattr(params, name) for name, weight in REACH.items() if getattr(params, weight) > 0}
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
    same = [name for name in REACH if np.isclose(getattr(params, name), getattr(metres, name), rtol=0.05)]
    if same and (cell <= 0.7 if cell else max(shape) > LARGEST_WORLD):
        world = f"the cells are {cell:g} m" if cell else f"with cells of 1 m the grid would be {max(shape)} m long"
        widths = ", ".join(f"{name} = {getattr(params, name):g}" for name in same)
        yield finding("widths in metres", same=widths, world=world, cell=cell or "cell")


def _of_other_cells(params: CrfParams, cell: float | None) -> Iterator[Finding]:
    given, default = ([getattr(crf, name) for name in REACH] for crf in (params, CrfParams()))
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

"""Faults of weights and widths: kernels that reach nobody, everybody, or count for nothing (eq. (4))."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf.doctor.finding import Finding
from semgrid_edu.crf.doctor.unary import spread_of
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
        yield Finding(
            "weights zero",
            "The CRF does nothing: the refined map is the map before it.",
            "Both weights of the kernels, w_bilateral and w_spatial, are 0.",
            "The cells don't know of each other, so each keeps its own distribution.",
            "Give the kernels a weight; the defaults are 4 and 3.",
        )
    if metric := _in_metres(params, shape, cell):
        yield metric
    elif cell and _widths(params) == _widths(CrfParams()) and not 0.75 < cell / PAPER_CELL < 1.34:
        yield _of_other_cells(params, cell)
    used = {name: getattr(params, name) for name, weight in REACH.items() if getattr(params, weight) > 0}
    for name, sigma in used.items():
        if gaussian(1 / sigma**2) < 0.05 and not metric:
            yield _narrow(name, sigma)
        if sigma > max(shape) >= 16:
            yield _wide(name, sigma, shape)
    if params.w_bilateral > 0 and params.sigma_beta > 3:
        yield _blind(params.sigma_beta)


def _widths(params: CrfParams) -> tuple[float, ...]:
    return tuple(getattr(params, name) for name in REACH)


def _in_metres(params: CrfParams, shape: tuple[int, int], cell: float | None) -> Finding | None:
    """Suspect a width that has the number of the default in metres; it would be right for cells of a metre."""
    metres = CrfParams.for_cells(1.0)
    same = [name for name in REACH if np.isclose(getattr(params, name), getattr(metres, name), rtol=0.05)]
    if not same or (cell > 0.7 if cell else max(shape) <= LARGEST_WORLD):
        return None
    world = f"the cells are {cell:g} m" if cell else f"with cells of 1 m the grid would be {max(shape)} m long"
    widths = ", ".join(f"{name} = {getattr(params, name):g}" for name in same)
    return Finding(
        "widths in metres",
        "The CRF smooths less than elsewhere: single wrong cells disappear, larger specks stay.",
        f"{widths} cells: that is the default in metres, and right for cells of 1 m; but {world}.",
        "Widths are in cells. A width in metres is too small by the size of a cell, 0.2 m or 0.5 m.",
        f"CrfParams.for_cells({cell or 'cell'}), or divide your widths by the size of a cell.",
    )


def _of_other_cells(params: CrfParams, cell: float) -> Finding:
    right = CrfParams.for_cells(cell)
    return Finding(
        "widths for another grid",
        "The CRF smooths more (coarse cells) or less (fine cells) than in the paper's grid.",
        f"sigma_alpha = {params.sigma_alpha:g} and sigma_gamma = {params.sigma_gamma:g} cells are the defaults for "
        f"cells of {PAPER_CELL} m, but these cells are {cell:g} m: they reach {params.sigma_alpha * cell:.2g} m and "
        f"{params.sigma_gamma * cell:.2g} m.",
        "The defaults are in cells of the paper's grid.",
        f"CrfParams.for_cells({cell:g}): {right.sigma_alpha:g} and {right.sigma_gamma:g} cells.",
    )


def _narrow(name: str, sigma: float) -> Finding:
    return Finding(
        "narrow kernel",
        "The CRF smooths less than elsewhere, or does nothing: the refined map is the map before it.",
        f"{name} = {sigma:g} cells: the kernel is 1 for a cell itself and {gaussian(1 / sigma**2):.1g} for the next.",
        "The width may be in another unit, such as metres or parts of the grid. It is in cells.",
        "CrfParams.for_cells(cell) gives widths for cells of that many metres.",
    )


def _wide(name: str, sigma: float, shape: tuple[int, int]) -> Finding:
    return Finding(
        "wide kernel",
        "The CRF over-smooths: the commonest labels gain, small things vanish.",
        f"{name} = {sigma:g} cells, but the grid has only {shape[0]} rows and {shape[1]} columns.",
        "Each cell is near to every other. The width may be in another unit, such as pixels or centimetres.",
        "CrfParams.for_cells(cell) gives widths for cells of that many metres.",
    )


def _blind(sigma_beta: float) -> Finding:
    certain = np.exp(-1 / sigma_beta**2)
    return Finding(
        "blind to occupancy",
        "The CRF smooths across the borders of free and occupied space: labels bleed out of houses.",
        f"sigma_beta = {sigma_beta:g}: a cell that is certainly free and one that is certainly occupied still count "
        f"{certain:.2f} for each other.",
        "sigma_beta is in probability, from 0 to 1. Widths such as 13 are for the colours 0 to 255 of an image.",
        "Take 0.2, the default, or search around it.",
    )


def overwhelming(phi: NDArray, values: NDArray, params: CrfParams) -> Finding | None:
    """Compare what the pairs of a cell can weigh together with what its own costs can.

    Parameters
    ----------
    phi : (C, H, W) float64
        The costs of the classes.
    values : (4, H, W) float64
        The occupancy probabilities.
    params : CrfParams
        Weights, widths and normalisation.

    Returns
    -------
    Finding or None
        What was found, when the pairs weigh far more.
    """
    pull, own = pair_sum(values, params), float(np.median(spread_of(phi)))
    if pull <= 50 or pull <= 10 * own:
        return None
    printed = params.normalization == "none"
    return Finding(
        "pairs outweigh the network",
        "The CRF over-smooths: small things, people and signs, vanish; in the end the refined map is one colour.",
        f"The weights of all pairs of a cell sum to {pull:,.0f} (mean of a few cells); the network's costs of the best "
        f"and the worst class differ by {own:.3g} (median).",
        'normalization="none" is eq. (4) as printed: each of hundreds of neighbours counts with full weight.'
        if printed
        else "The weights are large. With symmetric normalisation a cell's pairs weigh about w_bilateral + w_spatial.",
        'normalization="symmetric", or far smaller weights.'
        if printed
        else "Weights of a few units; the defaults are 4 and 3.",
    )


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

"""Mean field with a nearly exact bilateral kernel, pair by pair in a window: lecture 11 asks what the lattice costs."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf import CrfParams, SeparableGaussian
from semgrid_edu.crf.naive import settled, updates
from semgrid_edu.crf.params import check_inputs, check_stop
from semgrid_edu.fast.crf.windowed import RADIUS, WindowedGaussian


def mean_field_accurate(
    unary: ArrayLike,
    values: ArrayLike,
    params: CrfParams,
    iterations: int = 10,
    tolerance: float = 0.0,
    radius: float = RADIUS,
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field with nearly exact kernels: the updates of `mean_field_naive`.

    Where `mean_field` asks the permutohedral lattice, this computes the bilateral kernel pair by pair, in a window
    around each cell (`WindowedGaussian`, which says what the window can cost). The time grows with the number of
    cells times that of cells in a window, the memory with the number of cells alone.
    The other Parameters are those of `mean_field_naive`, and so are errors, but the grid may be of any size.

    Parameters
    ----------
    radius : float
        Reach of the bilateral window in widths `sigma_alpha`; infinite for all pairs, exact but for rounding.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell; the same bits whatever the number of threads.
    """
    unary, values = check_inputs(unary, values)
    return filtered(unary, params, WindowedGaussian.build(values, params, radius), iterations, tolerance)


def filtered(
    unary: NDArray, params: CrfParams, bilateral: object, iterations: int, tolerance: float
) -> NDArray[np.float32]:
    """Run mean field with some filter in place of the lattice.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; inf where a class is impossible.
    params : CrfParams
        Weight, width and normalisation of the spatial kernel.
    bilateral : callable with a diagonal
        The bilateral kernel as a filter of float32 values (N, C), its weight and normalisation included; `.diagonal`
        is k_ii, the share of its own value that each cell gets back, (N,).
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.
    """
    check_stop(iterations, tolerance)
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    self_coupling = bilateral.diagonal + spatial.diagonal

    def disagreement(Q: NDArray) -> NDArray:
        return self_coupling * Q - (bilateral(np.ascontiguousarray(Q.T, np.float32)) + spatial(Q.T)).T

    return settled(updates(unary, disagreement, self_coupling), iterations, tolerance).astype(np.float32)

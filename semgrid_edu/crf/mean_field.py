"""Mean field on the whole grid: eq. (3), (4) with filters in place of the sum over all pairs.

First the update rule, which `mean_field_naive` shares. Then the spatial kernel, a separable Gaussian: one pass along
rows and one along columns. The bilateral kernel is a lattice.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_softmax

from semgrid_edu.crf.lattice import bilateral_kernel
from semgrid_edu.crf.params import NARROWEST, CrfParams
from semgrid_edu.errors import ArgumentError, check_shape, check_whole
from semgrid_edu.occupancy import N_STATES

NEVER = 1e30
"""A cost in place of infinity: it avoids inf - inf, which is NaN, and exp(-1e30) is 0."""


def updates(
    unary: NDArray, disagreement: Callable[[NDArray], NDArray], self_coupling: NDArray
) -> Iterator[NDArray[np.floating]]:
    """Yield the initial Q and the Q after each simultaneous update, without end: the update rule of mean field.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; inf where a class is impossible.
    disagreement : callable
        Q (C, H W) -> sum_{j != i} k_ij (1 - Q_j(l)), (C, H W), up to a constant that is the same for all classes.
    self_coupling : (H W,) float
        k_ii, see `damping`.

    Yields
    ------
    (C, H, W) float
        Q, the distribution over classes in each cell.
    """
    phi = above_best(unary).astype(np.float64)
    part = damping(self_coupling)
    log_Q = log_softmax(-phi, axis=0)
    while True:
        Q = np.exp(log_Q)
        yield Q.reshape(unary.shape)
        # The exact optimum of each cell, all others fixed. Log Q goes only part of the way, see `damping`.
        target = -phi - disagreement(Q)
        log_Q = log_softmax((1 - part) * log_Q + part * target, axis=0)


def above_best(unary: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the cost of each class relative to the cell's best one: the unary term up to a constant.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u; inf where a class is impossible.

    Returns
    -------
    (C, H W) float
        Finite, at most `NEVER`.
    """
    return np.minimum(unary - unary.min(axis=0), NEVER).reshape(len(unary), -1)


def settled(iterates: Iterator[NDArray], iterations: int, tolerance: float) -> NDArray:
    """Update until the number of updates is reached, or an update changes no probability by more than the tolerance.

    Parameters
    ----------
    iterates : iterator of (C, H, W) float
        Q at first and after each update, such as `mean_field_updates`.
    iterations : int
        The largest number of updates.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.

    Returns
    -------
    (C, H, W) float
        The last Q.
    """
    Q = next(iterates)
    for _ in range(iterations):
        before = Q
        Q = next(iterates)
        if np.abs(Q - before).max() <= tolerance:
            break
    return Q


def damping(self_coupling: NDArray) -> NDArray:
    """Return how far all cells may move at once without raising the free energy.

    With k_ii the weight of a cell with itself (the diagonal of `gram_matrix`), the free energy is::

        F(Q) = sum_i Q_i . phi_i - 1/2 sum_ij k_ij Q_i . Q_j + 1/2 sum_i k_ii |Q_i|^2 - H(Q) + constant

    The first sum over pairs has a positive semidefinite matrix, so with its minus sign it is concave, and nowhere above
    its tangent at the present Q. The next sum exceeds its tangent by ``k_ii / 2 |Q'_i - Q_i|^2``, which is at most
    ``k_ii / 2 KL(Q'_i || Q_i)`` by Pinsker's inequality. Tangents plus bound are nowhere below F and equal it at Q. So
    F at their minimum Q' is no larger than at Q. Setting the derivative to zero gives::

        log Q'_i = (1 - p_i) log Q_i + p_i (-phi_i - sum_{j != i} k_ij (1 - Q_j)) + constant,   p_i = 1 / (1 + k_ii / 2)

    (compare Kraehenbuehl and Koltun 2013, section 3; Baque et al. 2016). All of this holds for a symmetric matrix, as
    that of `gram_matrix` is. The permutohedral lattice is only nearly symmetric, and F may rise a little.

    Parameters
    ----------
    self_coupling : (N,) float
        k_ii, for each cell the sum over the kernels.

    Returns
    -------
    (N,) float
        p_i, 0 < p_i <= 1; 1 is no damping. The more neighbours in the same state, the smaller is k_ii, and the
        nearer to 1 is p_i; with `normalization="none"` it is 1 / (1 + (w1 + w2) / 2).
    """
    return 1 / (1 + self_coupling / 2)


@dataclass(frozen=True, eq=False)
class SeparableGaussian:
    """Sums over all cells of a grid, weighted by ``exp(-|c_i - c_j|^2 / (2 sigma^2))``.

    ``exp(-(a^2 + b^2)) = exp(-a^2) exp(-b^2)``, so the kernel between cells is a kernel between rows times a kernel
    between columns. Its row sums factorise too, so each axis is normalised separately.

    Parameters
    ----------
    rows, columns : (H, H), (W, W) float64
        The kernel between rows, which includes the weight, and between columns.
    """

    rows: NDArray[np.float64]
    columns: NDArray[np.float64]

    @classmethod
    def build(cls, shape: tuple[int, int], sigma: float, weight: float, normalization: str) -> "SeparableGaussian":
        """Compute the kernel of both axes.

        Parameters
        ----------
        shape : (int, int)
            H and W, the number of rows and columns of the grid.
        sigma : float
            Width of the Gaussian, cells.
        weight : float
            Factor of the whole kernel.
        normalization : {"symmetric", "none"}
            How the kernel is normalised, see `CrfParams`.
        """
        sigma = max(sigma, NARROWEST)
        rows = _between(shape[0], sigma)
        columns = _between(shape[1], sigma)
        if normalization == "symmetric":
            normalise(rows)
            normalise(columns)
        return cls(weight * rows, columns)

    @property
    def diagonal(self) -> NDArray[np.float64]:
        """k_ii: how much of its value each cell gets back, (H W,)."""
        return np.outer(np.diag(self.rows), np.diag(self.columns)).ravel()

    def __call__(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return sum_j k_ij values_j, the cell itself included; one row per cell, (H W, K)."""
        height = len(self.rows)
        width = len(self.columns)
        summed = self.rows @ values.reshape(height, -1)  # over the rows of the grid, for each column and value
        summed = self.columns @ summed.reshape(height, width, -1)  # over the columns
        return summed.reshape(values.shape)


def _between(size: int, sigma: float) -> NDArray[np.float64]:
    """Return the Gaussian between all cells of one axis, (size, size)."""
    place = np.arange(size) / sigma
    return np.exp(-((place[:, None] - place) ** 2) / 2)


def normalise(kernel: NDArray[np.float64]) -> None:
    """Replace K by D^-1/2 K D^-1/2, in place, where D holds its row sums.

    Parameters
    ----------
    kernel : (N, N) float64
        K; overwritten.
    """
    root = np.sqrt(kernel.sum(axis=1))
    kernel /= root[:, None]
    kernel /= root


def mean_field(
    unary: ArrayLike, values: ArrayLike, params: CrfParams, iterations: int = 10, tolerance: float = 0.0, pad: int = 0
) -> NDArray[np.float32]:
    """Approximate the CRF's marginals by mean field with filters (eq. (3), (4)), in place of all pairs.

    The sum over all pairs becomes two filters. The spatial one is exact (`SeparableGaussian`). The bilateral one is
    the permutohedral lattice, whose kernel is only nearly Gaussian. Filters include the cell itself, which forms no
    pair, so its own contribution is subtracted.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u, see `unary_from_probability`; inf where a class is impossible.
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weights, widths and normalisation.
    iterations : int
        The largest number of updates of all cells.
    tolerance : float
        Stop as soon as an update changes no probability by more than this.
    pad : int
        Number of cells by which the border is padded (with its own values) before the CRF; cut off afterwards. This
        asserts that what is at the border goes on outside: a sidewalk of which the grid holds two columns, and which
        the road outvotes as it does any thin strip, becomes wider (lecture 10).

    Returns
    -------
    (C, H, W) float32
        Q, the distribution over classes in each cell.

    Raises
    ------
    ArgumentError
        When shapes don't fit, numbers aren't what they should be, or the states of the cells differ, or the grid
        extends, by more kernel widths than the lattice can count.
    """
    unary, values = check_inputs(unary, values)
    check_stop(iterations, tolerance)
    if pad:
        padded = [with_border(maps, pad) for maps in (unary, values)]
        return mean_field(*padded, params, iterations, tolerance)[:, pad:-pad, pad:-pad]
    spatial = SeparableGaussian.build(unary.shape[1:], params.sigma_gamma, params.w_spatial, params.normalization)
    bilateral = bilateral_kernel(values, params)
    self_coupling = bilateral.diagonal + spatial.diagonal

    # The cost of disagreeing, sum_j k_ij (1 - Q_j(l)), differs from this negative reward of agreeing by sum_j k_ij,
    # which is the same for all classes and cancels in the soft-max.
    def disagreement(Q: NDArray) -> NDArray:
        return self_coupling * Q - (bilateral(Q.T) + spatial(Q.T)).T

    return settled(updates(unary, disagreement, self_coupling), iterations, tolerance).astype(np.float32)


def with_border(maps: NDArray, pad: int) -> NDArray:
    """Repeat the cells at the border outward.

    Parameters
    ----------
    maps : (K, H, W) float
        K numbers for each cell.
    pad : int
        Number of cells to add on each side.

    Returns
    -------
    (K, H + 2 pad, W + 2 pad) float
        The same maps with a border.
    """
    check_whole(pad=pad)
    return np.pad(maps, ((0, 0), (pad, pad), (pad, pad)), mode="edge")


def check_inputs(unary: ArrayLike, values: ArrayLike) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Check the CRF's inputs, and return both arrays as float32 or float64.

    Parameters
    ----------
    unary : (C, H, W) float
        phi_u of eq. (3), the cost of each class in each cell; infinite for an impossible class.
    values : (4, H, W) float
        o, the probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.

    Raises
    ------
    ArgumentError
        When the shapes don't fit, a cost is NaN or -inf, a cell has no possible class, states don't sum to 1, or an
        argument holds anything but real numbers, or masked ones.
    """
    unary = _floats("unary", unary)
    values = _floats("values", values)
    if unary.ndim != 3 or 0 in unary.shape:
        raise ArgumentError("unary", "shape (C, H, W), nothing empty", f"shape {unary.shape}")
    check_shape("values", values, (N_STATES, *unary.shape[1:]))
    lowest = unary.min()  # NaN where any cost is NaN
    if np.isnan(lowest) or np.isneginf(lowest):
        raise ArgumentError("unary", "numbers, or inf for an impossible class", "NaN or -inf")
    if np.isinf(unary.max()) and np.isinf(unary.min(axis=0)).any():
        raise ArgumentError("unary", "a possible class in each cell", "a cell where every class is inf")
    if not (values.min() >= -1e-3 and np.abs(values.sum(axis=0) - 1).max() <= 1e-3):
        raise ArgumentError("values", "four probabilities that sum to 1 in each cell", "a cell where they don't")
    return unary, values


def _floats(name: str, argument: ArrayLike) -> NDArray[np.floating]:
    """Return an array of float32 or float64; any other type becomes float64."""
    if np.ma.is_masked(argument):
        raise ArgumentError(name, "an array without masked numbers", f"{np.ma.count_masked(argument)} masked")
    try:
        array = np.asarray(argument)
        if array.dtype in (np.float32, np.float64):
            return array
        return array.astype(np.float64, casting="unsafe" if array.dtype == object else "same_kind")
    except (RuntimeError, TypeError, ValueError) as error:  # RuntimeError: a tensor that requires gradients
        raise ArgumentError(name, "an array of real numbers", error) from error


def check_stop(iterations: int, tolerance: float = 0.0) -> None:
    """Check the stopping rule of mean field.

    Parameters
    ----------
    iterations : int
        How many times mean field updates all cells.
    tolerance : float
        The change of probabilities below which it stops.

    Raises
    ------
    ArgumentError
        When either is negative, or the first isn't a whole number.
    """
    if not isinstance(iterations, int | np.integer) or iterations < 0:
        raise ArgumentError("iterations", "a whole number of at least 0", iterations)
    if not tolerance >= 0:
        raise ArgumentError("tolerance", "a change of at least 0", tolerance)

"""The permutohedral lattice: a Gaussian filter in many dimensions as three sparse matrices (Adams, Baek, Davis 2010).

Simplices fill the space of features; where points are dense, many of them share corners. A filter is *splat*, *blur*,
*slice*: each point adds its value to the d + 1 corners of its simplex, the corners are blurred with (1/4, 1/2, 1/4)
along each of the d + 1 directions of the lattice, and each point takes the weighted mean of its corners.

The d features of a point are written as d + 1 numbers that sum to zero. A vertex of the lattice is then d + 1 integers
that sum to zero and have the same remainder modulo d + 1. A step in direction j adds 1 to all of them except the j-th,
from which it subtracts d.
"""

from dataclasses import dataclass, replace
from functools import reduce
from operator import matmul

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, diags_array, eye_array

from semgrid_edu.crf.params import NARROWEST, CrfParams
from semgrid_edu.errors import ArgumentError

FARTHEST = 2**30
"""The largest coordinate of a point in lattice space; `fast` stores it in 32 bits."""


def elevation(d: int) -> NDArray[np.float64]:
    """Return the matrix that maps d features to d + 1 numbers that sum to zero.

    Its scale gives the whole filter unit variance: splat and slice have variance (d + 1)^2 / 12 along each axis, the
    blur (d + 1)^2 / 2 (Adams 2010, section 3.1).

    Parameters
    ----------
    d : int
        Number of features of a point.

    Returns
    -------
    (d + 1, d) float64
        The matrix; its columns are orthogonal.
    """
    basis = np.zeros((d + 1, d))
    for j in range(d):
        basis[: j + 1, j] = 1
        basis[j + 1, j] = -(j + 1)
    return (d + 1) * np.sqrt(2 / 3) * basis / np.linalg.norm(basis, axis=0)


def peak(d: int) -> float:
    """Return the factor that gives the filter of d features the integral of the Gaussian, (2 pi)^(d/2).

    Without it the integral is the volume of feature space per vertex, (3/2)^(d/2) / sqrt(d + 1).

    Parameters
    ----------
    d : int
        Number of features of a point.

    Returns
    -------
    float
        The factor.
    """
    return (4 * np.pi / 3) ** (d / 2) * np.sqrt(d + 1)


def elevated(features: ArrayLike) -> NDArray[np.float64]:
    """Write the features of each point as numbers that sum to zero.

    Parameters
    ----------
    features : (N, d) float
        One row per point, in units of the Gaussian's standard deviation.

    Returns
    -------
    (N, d + 1) float64
        The points in the space of the lattice.

    Raises
    ------
    ArgumentError
        When `features` isn't a table of finite numbers.
    """
    features = np.asarray(features, dtype=np.float64)
    if features.ndim != 2 or 0 in features.shape or not np.isfinite(features).all():
        raise ArgumentError("features", "finite numbers of shape (N, d)", f"shape {features.shape}")
    # einsum, not @: BLAS's threads could change the last bit, and with it the side on which a border point falls.
    return np.einsum("nd,jd->nj", features, elevation(features.shape[1]))


def enclosing_simplices(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the simplex around each point, and the weights that make the point the mean of its corners.

    Parameters
    ----------
    points : (N, d + 1) float
        Points in the space of the lattice, see `elevated`.

    Returns
    -------
    corners : (N, d + 1, d + 1) int64
        For each point d + 1 vertices: corner m has coordinates of remainder m modulo d + 1.
    weights : (N, d + 1) float64
        Barycentric weights: not negative, they sum to 1, and the weighted mean of the corners is the point.

    Examples
    --------
    >>> corners, weights = enclosing_simplices(np.array([[4.2, -0.4, -3.8]]))
    >>> corners[0].tolist(), weights[0].round(2).tolist()
    ([[3, 0, -3], [4, 1, -5], [5, -1, -4]], [0.33, 0.13, 0.53])
    """
    size = points.shape[1]
    origin = size * np.rint(points / size).astype(np.int64)  # each number to the nearest multiple of d + 1
    rank = np.argsort(np.argsort(origin - points, axis=1, kind="stable"), axis=1)  # 0 for the largest residual
    # If the sum isn't zero, the numbers that were rounded the farthest are rounded the other way.
    rank += origin.sum(axis=1, keepdims=True) // size
    other_way = size * ((rank < 0).astype(np.int64) - (rank >= size))
    origin += other_way
    rank += other_way
    # Corner m is m steps from the origin: a step adds 1 to all numbers but one, the smallest residuals in turn.
    m = np.arange(size)[:, None]
    corners = origin[:, None] + m - size * (rank[:, None] >= size - m)
    residuals = -np.sort(origin - points, axis=1) / size  # the largest first
    gaps = residuals[:, :-1] - residuals[:, 1:]
    return corners, np.hstack([1 - gaps.sum(axis=1, keepdims=True), gaps[:, ::-1]])


@dataclass(frozen=True, eq=False)
class PermutohedralLattice:
    """Sums over points, weighted by a Gaussian of the distance between their features (eq. (4)).

    A lattice is built once for the features and then filters any number of values. Its kernel approximates ``exp(-|f_i
    - f_j|^2 / 2)``: the blur has the Gaussian's variance and integral but a finite reach, and it loses what it moves to
    a corner without points.

    Parameters
    ----------
    vertices : (M, d + 1) int64
        The corners of all simplices around points, each once.
    shares : (N, M) sparse
        The weights of splatting and slicing between points and corners, d + 1 in a row.
    blurs : tuple of d + 1 (M, M) sparse
        The blur along each direction.
    """

    vertices: NDArray[np.int64]
    shares: csr_array
    blurs: tuple[csr_array, ...]

    @classmethod
    def build(cls, features: ArrayLike) -> "PermutohedralLattice":
        """Place points in the lattice.

        Parameters
        ----------
        features : (N, d) float
            One row per point, in units of the Gaussian's standard deviation.

        Returns
        -------
        PermutohedralLattice
            Ready to filter values at these points.

        Raises
        ------
        ArgumentError
            When `features` isn't a table of finite numbers, or the points are too many standard deviations apart.
        """
        points = elevated(features)
        digits = _digits(points)  # the coordinates of a vertex become the digits of one number
        corners, weights = enclosing_simplices(points)
        n_points, size = weights.shape
        corners = corners.reshape(-1, size)
        numbers, first, members = np.unique(corners @ digits, return_index=True, return_inverse=True)
        ends = np.arange(0, len(corners) + 1, size)
        shares = csr_array((weights.ravel(), members, ends), shape=(n_points, len(numbers)))
        steps = digits.sum() - size * digits  # every step along direction j adds steps[j] to a vertex's number
        return cls(corners[first], shares, tuple(_blur(numbers, step) for step in steps))

    @property
    def diagonal(self) -> NDArray[np.float64]:
        """k_ii: how much of its value each point gets back, (N,)."""
        half = len(self.blurs) // 2
        # Each blur is symmetric, so K = taken @ given.T, of which only the diagonal is computed.
        given = reduce(matmul, self.blurs[:half], self.shares)  # what a point splats, after half of the blurs
        taken = reduce(matmul, self.blurs[: half - 1 : -1], self.shares)  # what it slices, from before the other half
        return peak(len(self.blurs) - 1) * (given * taken).sum(axis=1)

    def scaled(self, scale: NDArray) -> "PermutohedralLattice":
        """Return the lattice of the kernel diag(scale) K diag(scale).

        Parameters
        ----------
        scale : (N,) float
            One factor per point.
        """
        return replace(self, shares=csr_array(diags_array(scale) @ self.shares))

    def __call__(self, values: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return sum_j k(f_i, f_j) values_j, the point itself included; one row per point, (N, K)."""
        held = self.shares.T @ values  # splat
        for blur in self.blurs:
            held = blur @ held
        return peak(len(self.blurs) - 1) * (self.shares @ held)  # slice


def _digits(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the worth of each coordinate of a vertex as a digit: none for the last, which follows from the others."""
    spans = np.ceil(np.ptp(points, axis=0)) + 3 * points.shape[1]  # of the vertices and their neighbours
    if np.abs(points).max() > FARTHEST or np.prod(spans[:-1]) > 2**62:
        expected = "points fewer standard deviations apart, so larger sigmas"
        raise ArgumentError("features", expected, f"{spans.max():.4g} in lattice space")
    return np.append(np.cumprod([1, *spans[:-2]]), 0).astype(np.int64)


def _blur(numbers: NDArray[np.int64], step: int) -> csr_array:
    """Return the blur along one direction: a vertex keeps half of its value, and each neighbour gets a quarter of it.

    A neighbour that doesn't exist gives nothing and gets nothing.
    """
    size = len(numbers)
    _, ahead, here = np.intersect1d(numbers, numbers + step, assume_unique=True, return_indices=True)
    forward = csr_array((np.ones(len(here)), (here, ahead)), shape=(size, size))
    return csr_array(eye_array(size) / 2 + (forward + forward.T) / 4)


_ZERO_SUM_STATES = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]]) / 2
"""An orthonormal basis of the space orthogonal to (1, 1, 1, 1). The four probabilities sum to one, so three numbers in
this basis preserve the distance between two cells' states."""


def bilateral_kernel(values: NDArray, params: CrfParams) -> PermutohedralLattice:
    """Build the first kernel of eq. (4), on place and occupancy, including its weight and normalisation.

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        Weight, widths and normalisation.

    Returns
    -------
    PermutohedralLattice
        A lattice around H W points in five dimensions: two for the place, three for the state.

    Raises
    ------
    ArgumentError
        If the states differ, or the grid extends, by more kernel widths than the lattice can count.
    """
    lattice = PermutohedralLattice.build(bilateral_features(values, params))
    degree = np.ones(values[0].size)
    if params.normalization == "symmetric":
        degree = lattice(np.ones((values[0].size, 1)))[:, 0]
    return lattice.scaled(np.sqrt(params.w_bilateral / degree))


def bilateral_features(values: NDArray, params: CrfParams) -> NDArray[np.float64]:
    """Return place and occupancy of each cell in units of the bilateral kernel's widths.

    Parameters
    ----------
    values : (4, H, W) float
        o_i, the occupancy probabilities of each cell: they sum to one.
    params : CrfParams
        The widths. If the kernel has weight zero, the features don't matter, and all are zero.

    Returns
    -------
    (H W, 5) float64
        Row, column, and three numbers for the state, with the same distances as the four probabilities.
    """
    place = np.indices(values.shape[1:]) / max(params.sigma_alpha, NARROWEST)
    state = np.einsum("ks,shw->khw", _ZERO_SUM_STATES, values) / params.sigma_beta
    features = np.concatenate([place, state]) * (params.w_bilateral > 0)
    return features.reshape(5, -1).T

"""The permutohedral lattice: Gaussian filtering in many dimensions at the cost of a blur (Adams, Baek, Davis 2010).

Every point is in one simplex of a lattice; where points are dense, many share its corners. The filter splats each
point's value onto the d + 1 corners of its simplex, blurs the corners with (1/4, 1/2, 1/4) along each of the d + 1
lattice directions, and slices the result, which means that it interpolates at the points. The module `simplices` holds
the geometry, `vertices` the bookkeeping.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from semgrid_edu.crf.lattice import FARTHEST, elevated, peak
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast.crf import FAST, HALF
from semgrid_edu.fast.crf.simplices import origins_and_ranks, responses, self_responses
from semgrid_edu.fast.crf.vertices import number_vertices, sort_by_vertex


@dataclass(frozen=True)
class PermutohedralLattice:
    """Sums over points, weighted by a Gaussian of the distance between their features (eq. (4)).

    A lattice is built once for the features and then filters any number of values. Its kernel approximates ``exp(-|f_i
    - f_j|^2 / 2)``: the blur has the Gaussian's variance and integral but a finite reach, and it loses what it moves to
    a corner without points.

    Parameters
    ----------
    corners : (N, d + 1) int32
        The numbers of the M lattice vertices at the corners of each point's simplex.
    slices : (N, d + 1) float32
        The interpolation weight of each of a point's corners.
    neighbours : (d + 1, 2, M) int32
        The vertex one step forward and one step backward along each direction; M where there is none.
    starts : (M + 1,) int32
        Where each vertex's part of `points` and `splats` begins, and where the last one ends.
    points, splats : (N (d + 1),) int32, float32
        The points around each vertex, vertex after vertex, and their splatting weights.
    diagonal : (N,) float32
        k(f_i, f_i) of this lattice: how much of its value each point gets back.
    """

    corners: NDArray[np.int32]
    slices: NDArray[np.float32]
    neighbours: NDArray[np.int32]
    starts: NDArray[np.int32]
    points: NDArray[np.int32]
    splats: NDArray[np.float32]
    diagonal: NDArray[np.float32]

    @classmethod
    def build(cls, features: NDArray) -> "PermutohedralLattice":
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
            If `features` isn't a table of finite numbers, or they are too large for the lattice's integers.
        """
        points = elevated(features)
        if np.abs(points).max() > FARTHEST:
            raise ArgumentError("features", "fewer standard deviations, or a larger sigma", np.abs(features).max())
        dimensions = points.shape[1] - 1
        origins, ranks, weights = origins_and_ranks(np.asfortranarray(points))
        vertices = number_vertices(origins, ranks)
        corners = vertices.simplices.take(vertices.members, axis=0)
        starts, members = sort_by_vertex(corners.ravel(), vertices.neighbours.shape[2])
        factor = np.float32(peak(dimensions))
        shares = weights.astype(np.float32)
        return cls(
            corners=corners,
            slices=factor * shares,
            neighbours=vertices.neighbours,
            starts=starts,
            points=members // np.int32(dimensions + 1),
            splats=shares.ravel()[members],
            diagonal=factor * self_responses(vertices.members, weights, responses(*vertices[1:])),
        )

    def scaled(self, scale: NDArray) -> "PermutohedralLattice":
        """Return the lattice of the kernel diag(scale) K diag(scale).

        Parameters
        ----------
        scale : (N,) float
            One factor per point.
        """
        scale = scale.astype(np.float32)
        slices, splats = _scaled(self.slices, self.splats, self.points, scale)
        return replace(self, slices=slices, splats=splats, diagonal=self.diagonal * scale**2)

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return sum_j k(f_i, f_j) values_j, the point itself included; one row per point, (N, K)."""
        out = np.zeros(values.shape, np.float32)
        self.add(values, out)
        return out

    def add(self, values: NDArray[np.float32], out: NDArray[np.float32]) -> None:
        """Filter values at the points, and add the result to an array.

        Parameters
        ----------
        values, out : (N, K) float32
            One row per point.
        """
        _slice(self.blurred(values), self.corners, self.slices, out)

    def blurred(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Splat values onto the vertices and blur them there: all of the filter but the slicing.

        Parameters
        ----------
        values : (N, K) float32
            One row per point.

        Returns
        -------
        (M + 1, K) float32
            What each vertex holds; the last row is zero.
        """
        blurred, other = np.zeros((2, len(self.starts), values.shape[1]), np.float32)
        _splat(np.ascontiguousarray(values), self.starts, self.points, self.splats, blurred)
        for forward, backward in self.neighbours:
            _blur(blurred, forward, backward, other)
            blurred, other = other, blurred
        return blurred


@njit(cache=True, parallel=True)
def _scaled(slices, splats, points, scale):
    """Return both weights of each point times its scale."""
    scaled_slices = np.empty_like(slices)
    scaled_splats = np.empty_like(splats)
    for i in prange(len(slices)):
        for corner in range(slices.shape[1]):  # not row by row: numba would allocate an array for each product
            scaled_slices[i, corner] = scale[i] * slices[i, corner]
    for n in prange(len(splats)):
        scaled_splats[n] = scale[points[n]] * splats[n]
    return scaled_slices, scaled_splats


# Each vertex or point is summed by one thread in a fixed order, so the number of threads doesn't change the result.
@njit(cache=True, parallel=True, fastmath=FAST)
def _splat(values, starts, points, weights, out):
    """Sum the contributions of each vertex's points, (M + 1, K); the last row stays zero, for missing neighbours."""
    for v in prange(len(starts) - 1):
        for i in range(starts[v], starts[v + 1]):
            for k in range(values.shape[1]):
                out[v, k] += weights[i] * values[points[i], k]


@njit(cache=True, parallel=True, fastmath=FAST)
def _blur(values, forward, backward, out):
    """Blur (M + 1, K) values along one direction with (1/4, 1/2, 1/4), given each vertex's two neighbours."""
    for v in prange(len(forward)):
        for k in range(values.shape[1]):
            out[v, k] = HALF * (values[v, k] + HALF * (values[forward[v], k] + values[backward[v], k]))


@njit(cache=True, parallel=True, fastmath=FAST)
def _slice(values, corners, weights, out):
    """Interpolate the values at the N points from their corners, and add them: (M + 1, K) -> (N, K)."""
    for i in prange(len(corners)):
        for corner in range(corners.shape[1]):
            for k in range(values.shape[1]):
                out[i, k] += weights[i, corner] * values[corners[i, corner], k]

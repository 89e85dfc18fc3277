"""Points in the permutohedral lattice: each one's simplex and its response to itself (Adams, Baek, Davis 2010).

The lattice is in the hyperplane of d + 1 dimensions where the coordinates sum to zero. A vertex is d + 1 integers that
sum to zero and have the same remainder modulo d + 1. A step in direction j adds one to all of them except the j-th,
from which it subtracts d.
"""

import numpy as np
from numba import njit, prange

from semgrid_edu.fast.crf import HALF

FORWARD = 0
BACKWARD = 1
"""Indices on the second axis of `neighbours`: the vertex one step forward, and the vertex one step back."""


# The book's `enclosing_simplices`, point by point, without arrays over all points in between.
@njit(cache=True, parallel=True)
def origins_and_ranks(elevated):
    """Find the simplex around each point.

    Parameters
    ----------
    elevated : (N, d + 1) float
        The points on the hyperplane of zero sum, see `elevated`.

    Returns
    -------
    origins : (N, d + 1) int32
        The corner of the simplex whose coordinates have remainder 0 modulo d + 1.
    ranks : (N, d + 1) int32
        The rank of each coordinate's distance from that corner, 0 for the largest; the ranks identify the simplex.
    weights : (N, d + 1) float64
        The barycentric weights of the corners with remainders 0 .. d; they sum to 1.
    """
    n_points, size = elevated.shape
    origins = np.empty((n_points, size), np.int32)
    ranks = np.empty((n_points, size), np.int32)
    weights = np.empty((n_points, size), np.float64)
    for i in prange(n_points):
        distances = np.empty(size)
        rank = np.zeros(size, np.int32)
        weight = np.zeros(size + 1)
        excess = 0
        for j in range(size):
            steps = np.rint(elevated[i, j] * (1 / size))
            origins[i, j] = steps * size
            distances[j] = elevated[i, j] - steps * size
            excess += int(steps)
        for j in range(size):
            for k in range(j):
                later = distances[k] < distances[j]
                rank[k] += later
                rank[j] += not later
        # Rounding left the zero-sum hyperplane: correct the coordinates with the largest rounding error.
        for j in range(size):
            rank[j] += excess
            moved = size if rank[j] < 0 else -size if rank[j] >= size else 0
            rank[j] += moved
            origins[i, j] += moved
            delta = (distances[j] - moved) * (1 / size)
            weight[size - 1 - rank[j]] += delta
            weight[size - rank[j]] -= delta
        ranks[i] = rank
        weights[i] = weight[:size]
        weights[i, 0] += 1 + weight[size]
    return origins, ranks, weights


@njit(cache=True, parallel=True)
def responses(simplices, ranks, neighbours):
    """Compute the blur's response inside each simplex: how much of a value at one corner reaches each corner.

    Along each direction in turn, a value moves one step forward, one step back, or not at all. Corner a + 1 of a
    simplex is one step from corner a, in the direction whose rank is d - a, and corner 0 follows corner d. So a value
    goes from corner a to corner b along the directions between them, forward or back. It is lost if a vertex on the way
    doesn't exist.

    Parameters
    ----------
    simplices : (S, d + 1) int32
        The vertices at the corners of each simplex, see `Vertices`.
    ranks : (S, d + 1) int32
        Order of the coordinates in each simplex, see `origins_and_ranks`.
    neighbours : (d + 1, 2, M) int32
        The vertices one step forward and back along each direction; M where there is none.

    Returns
    -------
    (S, d + 1, d + 1) float32
        From the row's corner to the column's corner.
    """
    n_simplices, size = simplices.shape
    alive_forward = survivors(neighbours, FORWARD)
    alive_backward = survivors(neighbours, BACKWARD)
    response = np.zeros((n_simplices, size, size), np.float32)
    for s in prange(n_simplices):
        direction = np.empty(2 * size, np.int32)  # twice, since corner 0 follows corner d
        for j in range(size):
            direction[ranks[s, j]] = direction[ranks[s, j] + size] = j
        for a in range(size):
            forward = alive_forward[simplices[s, a]]
            backward = alive_backward[simplices[s, a]]
            weight = np.float32(0.5) ** size
            response[s, a, a] += weight  # no step at all
            above = a
            below = a
            steps_forward = 0
            steps_backward = 0
            for steps in range(1, size + 1):
                above = above + 1 if above < size - 1 else 0
                below = below - 1 if below > 0 else size - 1
                steps_forward |= 1 << direction[2 * size - a - steps]
                steps_backward |= 1 << direction[size - a + steps - 1]
                weight *= HALF
                response[s, a, above] += weight * forward[steps_forward]
                response[s, a, below] += weight * backward[steps_backward]
    return response


@njit(cache=True, parallel=True)
def survivors(neighbours, sign):
    """Check, for each vertex and each set of directions, whether all vertices on that path exist.

    Parameters
    ----------
    neighbours : (d + 1, 2, M) int32
        The vertices one step forward and back along each direction; M where there is none.
    sign : int
        `FORWARD` or `BACKWARD`: steps forward or back.

    Returns
    -------
    (M, 2^(d + 1)) bool
        Bit j of the column is set if the path uses direction j; the steps are in the order of the directions.
    """
    size, _, n_vertices = neighbours.shape
    alive = np.zeros((n_vertices, 1 << size), np.bool_)
    alive[:, 0] = True
    for j in range(size - 1, -1, -1):
        for v in prange(n_vertices):
            following = neighbours[j, sign, v]
            if following < n_vertices:
                for later in range(0, 1 << size, 2 << j):  # sets of directions after j
                    alive[v, later | 1 << j] = alive[following, later]
    return alive


@njit(cache=True, parallel=True)
def self_responses(members, weights, response):
    """Compute how much of its value the filter gives back to each point, without the factor `peak`.

    Parameters
    ----------
    members : (N,) int32
        The simplex of each point, see `Vertices`.
    weights : (N, d + 1) float64
        Barycentric weights of its corners, see `origins_and_ranks`.
    response : (S, d + 1, d + 1) float32
        See `responses`.

    Returns
    -------
    (N,) float32
        The diagonal of the filter.
    """
    diagonal = np.empty(len(members), np.float32)
    for i in prange(len(members)):
        weight = weights[i]
        returned = 0.0
        for a in range(len(weight)):
            reached = 0.0
            for b in range(len(weight)):
                reached += response[members[i], a, b] * weight[b]
            returned += weight[a] * reached
        diagonal[i] = returned
    return diagonal

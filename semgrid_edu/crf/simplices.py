"""Points in the permutohedral lattice: their simplices, its vertices and their neighbours (Adams, Baek, Davis 2010).

The lattice lies in the hyperplane of d + 1 dimensions in which the coordinates sum to zero. A vertex is d + 1 integers
that sum to zero and have the same remainder modulo d + 1; a step in direction j adds one to all of them except the
j-th, from which it takes d.
"""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

_FORTH, _BACK = 0, 1


def elevation(d: int) -> NDArray[np.float64]:
    """Return the matrix that takes d features to the hyperplane of zero sum.

    It is scaled so that the whole filter has unit variance: splat and slice have variance (d + 1)^2 / 12 along each
    axis, the blur (d + 1)^2 / 2 (Adams 2010, section 3.1).

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

    Without it the integral is the volume of feature space that belongs to one vertex, (3/2)^(d/2) / sqrt(d + 1).

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


@njit(cache=True, parallel=True)
def enclosing_simplices(elevated):
    """Find the simplex around each point.

    Parameters
    ----------
    elevated : (N, d + 1) float
        The points on the hyperplane of zero sum, see `elevation`.

    Returns
    -------
    origins : (N, d + 1) int32
        The corner of the simplex whose coordinates have remainder 0 modulo d + 1.
    ranks : (N, d + 1) int32
        The rank of each coordinate's distance from that corner, 0 for the largest; it names the simplex at the corner.
    weights : (N, d + 1) float64
        The barycentric weights of the corners with remainders 0 .. d; they sum to 1.
    """
    n_points, size = elevated.shape
    origins = np.empty((n_points, size), np.int32)
    ranks = np.zeros((n_points, size), np.int32)
    weights = np.zeros((n_points, size), np.float64)
    for i in prange(n_points):
        excess = 0
        for j in range(size):
            steps = int(np.rint(elevated[i, j] / size))
            origins[i, j] = steps * size
            excess += steps
        for j in range(size):
            for k in range(j):
                if elevated[i, k] - origins[i, k] < elevated[i, j] - origins[i, j]:
                    ranks[i, k] += 1
                else:
                    ranks[i, j] += 1
        # Rounding left the hyperplane of zero sum: move the coordinates that were rounded the farthest.
        for j in range(size):
            ranks[i, j] += excess
            if ranks[i, j] < 0:
                ranks[i, j] += size
                origins[i, j] += size
            elif ranks[i, j] >= size:
                ranks[i, j] -= size
                origins[i, j] -= size
        for j in range(size):
            delta = (elevated[i, j] - origins[i, j]) / size
            rank = size - 1 - ranks[i, j]
            weights[i, rank] += delta
            weights[i, (rank + 1) % size] -= delta
        weights[i, 0] += 1
    return origins, ranks, weights


@njit(cache=True)
def _differ(a, b):
    """Whether two vectors differ; np.array_equal is several times slower on so few numbers."""
    for j in range(len(a)):  # noqa: SIM110 - a generator would allocate
        if a[j] != b[j]:
            return True
    return False


@njit(cache=True)
def _lookup(key, keys, slots):
    """Return the slot of the hash table that holds this key, or the empty slot where the key belongs."""
    code = np.uint64(0)
    for j in range(len(key) - 1):  # the last coordinate follows from the others: they sum to zero
        code = (code + np.uint64(key[j])) * np.uint64(0x9E3779B97F4A7C15)
    mask = len(slots) - 1
    slot = np.int64(code >> np.uint64(32)) & mask
    while slots[slot] >= 0 and _differ(keys[slots[slot]], key):
        slot = (slot + 1) & mask
    return slot


@njit(cache=True)
def number_vertices(origins, ranks):
    """Give a number to each distinct corner, which makes it a vertex.

    Parameters
    ----------
    origins, ranks : (N, d + 1) int32
        The simplex around each point, see `enclosing_simplices`.

    Returns
    -------
    corners : (N, d + 1) int32
        The numbers of the vertices at the corners of each simplex.
    keys : (M, d + 1) int32
        The coordinates of each vertex.
    slots : (2^k,) int32
        A hash table from coordinates to numbers; -1 in empty slots.
    """
    n_points, size = origins.shape
    corners = np.empty((n_points, size), np.int32)
    keys = np.empty((n_points * size, size), np.int32)
    capacity = 1
    while capacity < 2 * n_points * size:
        capacity *= 2
    slots = np.full(capacity, -1, np.int32)
    key = np.empty(size, np.int32)
    count = 0
    for i in range(n_points):
        for corner in range(size):
            for j in range(size):
                key[j] = origins[i, j] + corner - (size if ranks[i, j] >= size - corner else 0)
            slot = _lookup(key, keys, slots)
            if slots[slot] < 0:
                keys[count] = key
                slots[slot] = count
                count += 1
            corners[i, corner] = slots[slot]
    return corners, keys[:count].copy(), slots


@njit(cache=True, parallel=True)
def find_neighbours(keys, slots):
    """Find the vertices one step forward and one step backward along each direction.

    Parameters
    ----------
    keys : (M, d + 1) int32
        The coordinates of each vertex, from `number_vertices`.
    slots : (2^k,) int32
        The hash table from coordinates to numbers, from `number_vertices`.

    Returns
    -------
    (d + 1, 2, M) int32
        Number of the neighbour by direction, forward or backward, and vertex; M where there is none.
    """
    n_vertices, size = keys.shape
    neighbours = np.full((size, 2, n_vertices), n_vertices, np.int32)
    for v in prange(n_vertices):
        key = keys[v] + 1
        for direction in range(size):
            key[direction] -= size
            found = slots[_lookup(key, keys, slots)]
            key[direction] += size
            if found >= 0:
                neighbours[direction, _FORTH, v] = found
                neighbours[direction, _BACK, found] = v
    return neighbours


@njit(cache=True)
def _walk(vertex, a, b, shift, ranks, neighbours):
    """Return the weight of one path of the blur from corner a of a simplex, the given vertex, to its corner b."""
    size = len(ranks)
    weight = 1.0
    for direction in range(size):
        step = shift + int(ranks[direction] >= size - b) - int(ranks[direction] >= size - a)
        if step == 0:
            weight *= 0.5
        else:
            weight *= 0.25
            vertex = neighbours[direction, _FORTH if step > 0 else _BACK, vertex]
            if vertex == neighbours.shape[2]:
                return 0.0
    return weight


@njit(cache=True, parallel=True)
def self_responses(corners, ranks, weights, neighbours):
    """Compute what share of its own value the filter gives back to each point, without the factor of `peak`.

    A point's value reaches it again over the paths of the blur between corners of its simplex. The path from corner a
    to b > a makes one step along each coordinate whose rank is d - a down to d - b + 1. One step along all d + 1
    directions together leads back to where it began; so raising or lowering every step of a path by one gives a further
    path to the same corner.

    Parameters
    ----------
    corners : (N, d + 1) int32
        The vertices around each point, see `number_vertices`.
    ranks, weights : (N, d + 1) int32, float64
        Order of the coordinates and barycentric weights, see `enclosing_simplices`.
    neighbours : (d + 1, 2, M) int32
        See `find_neighbours`.

    Returns
    -------
    (N,) float32
        The diagonal of the filter.
    """
    n_points, size = corners.shape
    diagonal = np.zeros(n_points, np.float32)
    for i in prange(n_points):
        for a in range(size):
            for b in range(size):
                for shift in range(-1 if a <= b else 0, 2 if a >= b else 1):
                    path = _walk(corners[i, a], a, b, shift, ranks[i], neighbours)
                    diagonal[i] += weights[i, a] * weights[i, b] * path
    return diagonal


@njit(cache=True)
def sort_by_vertex(vertices, n_vertices):
    """Sort corners by their vertices (counting sort).

    Parameters
    ----------
    vertices : (N (d + 1),) int32
        The number of the vertex at each corner, see `number_vertices`.
    n_vertices : int
        Number of vertices, M.

    Returns
    -------
    starts : (M + 1,) int32
        Where the corners of each vertex begin in `members`, and where those of the last one end.
    members : (N (d + 1),) int32
        Indices of the corners, vertex after vertex.
    """
    starts = np.zeros(n_vertices + 1, np.int32)
    for v in vertices:
        starts[v + 1] += 1
    starts = np.cumsum(starts).astype(np.int32)
    members = np.empty(len(vertices), np.int32)
    filled = starts.copy()
    for corner, v in enumerate(vertices):
        members[filled[v]] = corner
        filled[v] += 1
    return starts, members

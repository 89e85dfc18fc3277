"""The vertices of the permutohedral lattice that carry points: numbered, with their neighbours (Adams et al. 2010).

A vertex has coordinates (d + 1) q_j + r with a common remainder r. It is packed into one integer with a field for r and
one for each q_j. A step along the lattice then adds a number that depends only on r and on the direction.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast.crf.simplices import BACKWARD, FORWARD

MOST_DIMENSIONS = 8
"""The largest number of features of a point: with 8, `survivors` has 2^9 entries per vertex."""


class Vertices(NamedTuple):
    """The vertices around points, and which points, simplices and vertices belong together.

    Parameters
    ----------
    members : (N,) int32
        The simplex of each point; many points share one.
    simplices : (S, d + 1) int32
        The vertices at the corners of each simplex, in the order of their remainders.
    ranks : (S, d + 1) int32
        Order of the coordinates in each simplex, see `origins_and_ranks`.
    neighbours : (d + 1, 2, M) int32
        The vertex one step forward and one step back along each direction; M where there is none.
    """

    members: NDArray[np.int32]
    simplices: NDArray[np.int32]
    ranks: NDArray[np.int32]
    neighbours: NDArray[np.int32]


def number_vertices(origins: NDArray[np.int32], ranks: NDArray[np.int32]) -> Vertices:
    """Assign numbers to the distinct simplices and to their distinct corners, the vertices.

    Parameters
    ----------
    origins, ranks : (N, d + 1) int32
        The simplex around each point, see `origins_and_ranks`.

    Returns
    -------
    Vertices
        Points, simplices and vertices by number, and each vertex's neighbours.

    Raises
    ------
    ArgumentError
        If the points are so far apart that a vertex doesn't fit into one integer, or have more than `MOST_DIMENSIONS`
        dimensions.
    """
    size = origins.shape[1]
    if size > MOST_DIMENSIONS + 1:
        raise ArgumentError("features", f"at most {MOST_DIMENSIONS} dimensions", size - 1)
    lowest, units = _fields(origins)
    keys, orders = _pack(origins, ranks, lowest, units)
    members, first = _number_simplices(keys, orders)
    simplices, keys, slots = _number_corners(keys[first], ranks[first], units)
    return Vertices(members, simplices, ranks[first], _find_neighbours(keys, slots, units))


def _fields(origins: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the smallest possible q_j, (d,), and the place value of each q_j in the integer, (d + 1,).

    The last coordinate has no field: it follows from the others, because they sum to zero.
    """
    size = origins.shape[1]
    # A corner has q_j up to 1 smaller than the origin, and its neighbours 1 smaller or larger than that.
    columns = origins.T[:-1]  # one by one: with axis=0 numpy takes ten times as long for rows of a few numbers
    lowest = np.array([column.min() for column in columns]) // size - 2
    spans = np.array([column.max() for column in columns]) // size + 1 - lowest
    bits = np.array([int(n).bit_length() for n in (size - 1, *spans)])
    if bits.sum() > 63:
        raise ArgumentError("features", "fewer standard deviations, or a larger sigma", f"{bits.sum()} bits")
    return lowest.astype(np.int64), np.append(1 << np.cumsum(bits)[:-1], 0)


@njit(cache=True, parallel=True)
def _pack(origins, ranks, lowest, units):
    """Return two integers that identify each point's simplex: its corner with remainder 0, and the ranks."""
    keys = np.zeros(len(origins), np.int64)
    orders = np.zeros(len(origins), np.int64)
    size = origins.shape[1]
    for i in prange(len(origins)):
        for j in range(size - 1):
            keys[i] += (origins[i, j] // size - lowest[j]) * units[j]
        for j in range(size):
            orders[i] = orders[i] * size + ranks[i, j]
    return keys, orders


@njit(cache=True)
def _capacity(most):
    """Return the size of a hash table that stays half empty: a power of two."""
    capacity = 2
    while capacity < 2 * most:
        capacity *= 2
    return capacity


@njit(cache=True, inline="always")
def _hash(key):
    """Scatter similar keys: multiply by 2^64 / golden ratio, and take the upper bits (Knuth)."""
    return np.int64((np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32))


# Point by point and on one core, because each new simplex gets the next number.
@njit(cache=True)
def _number_simplices(keys, orders):
    """Return the number of each point's simplex, and one point of each simplex, from the integers of `_pack`."""
    members = np.empty(len(keys), np.int32)
    first = np.empty(len(keys), np.int64)
    count = 0
    slots = np.full(_capacity(len(keys)), -1, np.int32)
    for i in range(len(keys)):
        if i > 0 and keys[i] == keys[i - 1] and orders[i] == orders[i - 1]:
            members[i] = members[i - 1]
            continue
        slot = _hash(keys[i] + orders[i] * 31) & (len(slots) - 1)
        while slots[slot] >= 0 and (keys[first[slots[slot]]] != keys[i] or orders[first[slots[slot]]] != orders[i]):
            slot = (slot + 1) & (len(slots) - 1)
        if slots[slot] < 0:
            slots[slot] = count
            first[count] = i
            count += 1
        members[i] = slots[slot]
    return members, first[:count].copy()


@njit(cache=True, inline="always")
def _slot(key, keys, slots):
    """Return the slot of the hash table that holds this vertex, or the empty one where it belongs."""
    slot = _hash(key) & (len(slots) - 1)
    while slots[slot] >= 0 and keys[slots[slot]] != key:
        slot = (slot + 1) & (len(slots) - 1)
    return slot


@njit(cache=True, inline="always")
def _forward(key, remainder, direction, units):
    """Return the vertex one step forward: coordinate `direction` loses d, all others gain one."""
    if remainder < len(units) - 1:
        return key + 1 - units[direction]
    return key - remainder + units.sum() - units[direction]


@njit(cache=True)
def _number_corners(origins, ranks, units):
    """Return the numbers of each simplex's corners, (S, d + 1), the vertices, (M,), and a hash table of them."""
    n_simplices, size = ranks.shape
    simplices = np.empty((n_simplices, size), np.int32)
    keys = np.empty(n_simplices * size, np.int64)
    count = 0
    slots = np.full(_capacity(n_simplices * size), -1, np.int32)
    direction = np.empty(size, np.int64)
    for s in range(n_simplices):
        key = origins[s]
        for j in range(size):
            direction[ranks[s, j]] = j
        for corner in range(size):
            if corner > 0:
                key = _forward(key, corner - 1, direction[size - corner], units)
            slot = _slot(key, keys, slots)
            if slots[slot] < 0:
                keys[count] = key
                slots[slot] = count
                count += 1
            simplices[s, corner] = slots[slot]
    return simplices, keys[:count].copy(), slots


@njit(cache=True, parallel=True)
def _find_neighbours(keys, slots, units):
    """Return the vertices one step forward and back along each direction, (d + 1, 2, M); M where there is none."""
    n_vertices = len(keys)
    size = len(units)
    neighbours = np.full((size, 2, n_vertices), n_vertices, np.int32)
    for v in prange(n_vertices):
        remainder = keys[v] & (units[0] - 1)
        for direction in range(size):
            found = slots[_slot(_forward(keys[v], remainder, direction, units), keys, slots)]
            if found >= 0:
                neighbours[direction, FORWARD, v] = found
                neighbours[direction, BACKWARD, found] = v
    return neighbours


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
        Where the corners of each vertex begin in `members`, and where the corners of the last one end.
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

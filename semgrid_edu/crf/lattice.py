"""The permutohedral lattice: Gaussian filtering in many dimensions at the cost of a blur (Adams, Baek, Davis 2010).

Every point lies in one simplex of a lattice whose corners are few where points are many. Its values are splatted onto
the d + 1 corners, the corners blurred with (1/4, 1/2, 1/4) along each of the d + 1 lattice directions, and the result
sliced back at the points. A corner is the vector of its d + 1 integer coordinates, which sum to zero and have one
remainder modulo d + 1; direction j adds one to all coordinates but takes d from coordinate j.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError

_FORTH, _BACK = 0, 1


@dataclass(frozen=True)
class PermutohedralLattice:
    """Sums over points, weighed by a Gaussian of the distance of their features; built once, used for many values.

    The kernel is the literal exp(-|f_i - f_j|^2 / 2) up to the lattice's approximation: the blur has the Gaussian's
    variance and integral but a finite reach, and what it moves to a corner without points is lost.

    Parameters
    ----------
    corners : (N, d + 1) int32
        The lattice vertices around each point.
    slices : (N, d + 1) float32
        What a point takes from each of its corners.
    neighbours : (d + 1, 2, M) int32
        The vertex one step forth and back along each direction; M where there is none.
    starts : (M + 1,) int32
        Where each vertex's share of the next two begins.
    points, splats : (N (d + 1),) int32, float32
        The points around each vertex, vertex after vertex, and what they give to it.
    diagonal : (N,) float32
        How much of its own value each point gets back: k(f_i, f_i) as this lattice has it.
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
        """Embed points in the lattice.

        Parameters
        ----------
        features : (N, d) float
            The points, in units of the Gaussian's standard deviation.

        Returns
        -------
        PermutohedralLattice
            Ready to filter.

        Raises
        ------
        ArgumentError
            When `features` isn't a table of finite numbers, or they are too large for the lattice's integers.
        """
        features = np.asarray(features, dtype=np.float64)
        if features.ndim != 2 or 0 in features.shape or not np.isfinite(features).all():
            raise ArgumentError("features", "finite numbers of shape (N, d)", f"shape {features.shape}")
        dimensions = features.shape[1]
        # einsum, not @: the threads of BLAS would fight with numba's for the same cores.
        elevated = np.einsum("nd,jd->nj", features, _elevation(dimensions))
        if np.abs(elevated).max() > 2**30:
            raise ArgumentError("features", "fewer standard deviations, or a larger sigma", np.abs(features).max())
        origins, ranks, weights = _enclosing_simplices(elevated)
        corners, keys, slots = _number_vertices(origins, ranks)
        neighbours = _find_neighbours(keys, slots)
        starts, members = _sort_by_vertex(corners.ravel(), len(keys))
        peak = _peak(dimensions)
        return cls(
            corners=corners,
            slices=(peak * weights).astype(np.float32),
            neighbours=neighbours,
            starts=starts,
            points=members // np.int32(dimensions + 1),
            splats=weights.ravel()[members].astype(np.float32),
            diagonal=np.float32(peak) * _self_responses(corners, ranks, weights, neighbours),
        )

    def scaled(self, scale: NDArray) -> "PermutohedralLattice":
        """Fold a factor of each point into the kernel: diag(scale) K diag(scale).

        Parameters
        ----------
        scale : (N,) float
            The factors.

        Returns
        -------
        PermutohedralLattice
            The same lattice with other weights.
        """
        scale = scale.astype(np.float32)
        return replace(
            self,
            slices=self.slices * scale[:, None],
            splats=self.splats * scale[self.points],
            diagonal=self.diagonal * scale**2,
        )

    def __call__(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Filter values at the points.

        Parameters
        ----------
        values : (N, K) float32
            One row a point.

        Returns
        -------
        (N, K) float32
            sum_j k(f_i, f_j) values_j, the point itself included.
        """
        blurred = _splat(values, self.starts, self.points, self.splats)
        for forth, back in self.neighbours:
            blurred = _blur(blurred, forth, back)
        return _slice(blurred, self.corners, self.slices)


def _elevation(d: int) -> NDArray[np.float64]:
    """Return the (d + 1, d) map onto the plane of zero sum, scaled so that the whole filter has unit variance.

    Splat and slice have variance (d + 1)^2 / 12 along each axis, the blur (d + 1)^2 / 2 (Adams 2010, section 3.1).
    """
    basis = np.zeros((d + 1, d))
    for j in range(d):
        basis[: j + 1, j] = 1
        basis[j + 1, j] = -(j + 1)
    return (d + 1) * np.sqrt(2 / 3) * basis / np.linalg.norm(basis, axis=0)


def _peak(d: int) -> float:
    """Return the factor that gives the filter the Gaussian's integral, (2 pi)^(d/2).

    Without it the integral is the volume of feature space that belongs to one vertex, (3/2)^(d/2) / sqrt(d + 1).
    """
    return (4 * np.pi / 3) ** (d / 2) * np.sqrt(d + 1)


@njit(cache=True, parallel=True)
def _enclosing_simplices(elevated):
    """Find each point's simplex: its corner of remainder 0, the order of the coordinates, barycentric weights."""
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
        # Rounding left the plane of zero sum: move the coordinates that were rounded the farthest.
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
    """Return the slot of the hash table that holds this key, or the empty one where it belongs."""
    code = np.uint64(0)
    for j in range(len(key) - 1):  # the last coordinate follows from the others: they sum to zero
        code = (code + np.uint64(key[j])) * np.uint64(0x9E3779B97F4A7C15)
    mask = len(slots) - 1
    slot = np.int64(code >> np.uint64(32)) & mask
    while slots[slot] >= 0 and _differ(keys[slots[slot]], key):
        slot = (slot + 1) & mask
    return slot


@njit(cache=True)
def _number_vertices(origins, ranks):
    """Give a number to each distinct corner: return (N, d + 1) numbers, (M, d + 1) keys and the hash table."""
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
def _find_neighbours(keys, slots):
    """Return the (d + 1, 2, M) vertices one step forth and back along each direction; M where there is none."""
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
    """Return the weight of one of the blur's paths from a simplex's corner a, the given vertex, to its corner b."""
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
def _self_responses(corners, ranks, weights, neighbours):
    """Return the (N,) diagonal of the filter, without its peak factor: paths between corners of the same simplex.

    From corner a to b > a leads one step along each coordinate whose rank is d - a down to d - b + 1. Since one step
    along all d + 1 directions leads nowhere, so does that path with every step raised or lowered by one.
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
def _sort_by_vertex(vertices, n_vertices):
    """Sort the corners by the vertex they are (counting sort): where each vertex starts, and the sorted corners."""
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


@njit(cache=True, parallel=True, fastmath=True)
def _splat(values, starts, points, weights):
    """Gather, at each vertex, what its points give: (M + 1, K), the last row zero for neighbours that aren't there."""
    n_vertices = len(starts) - 1
    out = np.zeros((n_vertices + 1, values.shape[1]), np.float32)
    for v in prange(n_vertices):
        for i in range(starts[v], starts[v + 1]):
            for k in range(values.shape[1]):
                out[v, k] += weights[i] * values[points[i], k]
    return out


@njit(cache=True, parallel=True, fastmath=True)
def _blur(values, forth, back):
    """Blur along one direction with (1/4, 1/2, 1/4)."""
    out = np.zeros_like(values)
    for v in prange(len(forth)):
        for k in range(values.shape[1]):
            out[v, k] = 0.5 * values[v, k] + 0.25 * (values[forth[v], k] + values[back[v], k])
    return out


@njit(cache=True, parallel=True, fastmath=True)
def _slice(values, corners, weights):
    """Interpolate each point's value from its corners."""
    out = np.zeros((len(corners), values.shape[1]), np.float32)
    for i in prange(len(corners)):
        for corner in range(corners.shape[1]):
            for k in range(values.shape[1]):
                out[i, k] += weights[i, corner] * values[corners[i, corner], k]
    return out

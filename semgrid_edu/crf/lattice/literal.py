"""The permutohedral lattice, literally: one point, one vertex and one step at a time (Adams, Baek, Davis 2010).

The twin of `PermutohedralLattice`, for the bilateral kernel of eq. (4). A vertex is a tuple of its coordinates, and a
dictionary holds the vertices that exist, with their values. A step in direction j adds 1 to all coordinates but the
j-th, from which it takes d.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.crf.lattice.simplices import elevation, peak

Vertex = tuple[int, ...]
"""A vertex of the lattice: d + 1 integers that sum to zero and have the same remainder modulo d + 1."""


def enclosing_simplex_literal(elevated: ArrayLike) -> tuple[list[Vertex], NDArray[np.float64]]:
    """Find the simplex around one point, and the weights with which the point is a mean of its corners.

    Parameters
    ----------
    elevated : (d + 1,) float
        A point of the hyperplane in which coordinates sum to zero, see `elevation`.

    Returns
    -------
    corners : list of d + 1 Vertex
        The corner whose coordinates have remainder 0 modulo d + 1, then those with remainders 1 to d.
    weights : (d + 1,) float64
        Barycentric weights: not negative, they sum to 1, and the weighted mean of the corners is the point.

    Examples
    --------
    >>> corners, weights = enclosing_simplex_literal([4.2, -0.4, -3.8])
    >>> corners
    [(3, 0, -3), (4, 1, -5), (5, -1, -4)]
    >>> weights.round(3)
    array([0.333, 0.133, 0.533])
    """
    elevated = np.asarray(elevated, dtype=np.float64)
    size = len(elevated)
    origin = size * np.rint(elevated / size).astype(int)
    excess = origin.sum() // size  # by how many steps of `size` rounding has left the hyperplane
    order = np.argsort(-(elevated - origin), kind="stable")  # the largest residual first
    if excess > 0:
        origin[order[size - excess :]] -= size  # these were rounded up the farthest
    else:
        origin[order[:-excess]] += size  # these were rounded down the farthest
    residual = elevated - origin
    order = np.argsort(-residual, kind="stable")
    corners = [origin]
    for direction in order[:0:-1]:  # the coordinate with the smallest residual steps back first
        corners.append(corners[-1] + step(size, direction))
    ranked = residual[order] / size
    gaps = ranked[:-1] - ranked[1:]
    weights = np.append(1 - gaps.sum(), gaps[::-1])
    return [tuple(corner.tolist()) for corner in corners], weights


def step(size: int, direction: int) -> NDArray[np.int64]:
    """Return what a step forward adds to the coordinates of a vertex.

    Parameters
    ----------
    size : int
        d + 1, the number of coordinates and of directions.
    direction : int
        The coordinate that loses d, while all others gain 1.

    Returns
    -------
    (d + 1,) int64
        The step; all d + 1 steps together lead back to where they began.
    """
    forward = np.ones(size, dtype=np.int64)
    forward[direction] -= size
    return forward


def splat_literal(features: ArrayLike, values: ArrayLike) -> dict[Vertex, NDArray[np.float64]]:
    """Share each point's values out to the corners of its simplex.

    Parameters
    ----------
    features : (N, d) float
        One row per point, in units of the Gaussian's standard deviation.
    values : (N, K) float
        One row per point.

    Returns
    -------
    dict of Vertex to (K,) float64
        What each vertex holds; only vertices around points exist.
    """
    vertices: dict[Vertex, NDArray[np.float64]] = {}
    elevated = np.asarray(features, dtype=np.float64) @ elevation(np.shape(features)[1]).T
    for point, value in zip(elevated, np.asarray(values, dtype=np.float64), strict=True):
        for corner, weight in zip(*enclosing_simplex_literal(point), strict=True):
            vertices[corner] = vertices.get(corner, 0) + weight * value
    return vertices


def blur_literal(vertices: dict[Vertex, NDArray[np.float64]], direction: int) -> dict[Vertex, NDArray[np.float64]]:
    """Blur the values of the vertices along one direction with (1/4, 1/2, 1/4).

    Parameters
    ----------
    vertices : dict of Vertex to (K,) float64
        What each vertex holds.
    direction : int
        One of the d + 1 directions.

    Returns
    -------
    dict of Vertex to (K,) float64
        The same vertices with other values. A neighbour that doesn't exist gives nothing and gets nothing.
    """
    blurred = {}
    for vertex, value in vertices.items():
        forward = step(len(vertex), direction)
        ahead, behind = (tuple((np.array(vertex) + way).tolist()) for way in (forward, -forward))
        blurred[vertex] = value / 2 + vertices.get(ahead, 0) / 4 + vertices.get(behind, 0) / 4
    return blurred


def slice_literal(features: ArrayLike, vertices: dict[Vertex, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Interpolate the values of the vertices at points.

    Parameters
    ----------
    features : (N, d) float
        One row per point, in units of the Gaussian's standard deviation.
    vertices : dict of Vertex to (K,) float64
        What each vertex holds; one that doesn't exist counts as 0.

    Returns
    -------
    (N, K) float64
        One row per point.
    """
    elevated = np.asarray(features, dtype=np.float64) @ elevation(np.shape(features)[1]).T
    nothing = np.zeros_like(next(iter(vertices.values())))
    rows = []
    for point in elevated:
        of_point = zip(*enclosing_simplex_literal(point), strict=True)
        rows.append(sum(weight * vertices.get(corner, nothing) for corner, weight in of_point))
    return np.array(rows)


def lattice_literal(features: ArrayLike, values: ArrayLike) -> NDArray[np.float64]:
    """Filter values with a Gaussian of the distance between features: splat, blur in each direction, slice.

    What the CRF needs it for is the sum over all cells in mean field with eq. (4); `PermutohedralLattice` does the
    same fast.

    Parameters
    ----------
    features : (N, d) float
        One row per point, in units of the Gaussian's standard deviation.
    values : (N, K) float
        One row per point.

    Returns
    -------
    (N, K) float64
        sum_j k(f_i, f_j) values_j, where k(f_i, f_j) is nearly ``exp(-|f_i - f_j|^2 / 2)``; the point itself counts.
    """
    vertices, dimensions = splat_literal(features, values), np.shape(features)[1]
    for direction in range(dimensions + 1):
        vertices = blur_literal(vertices, direction)
    return peak(dimensions) * slice_literal(features, vertices)

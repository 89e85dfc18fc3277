"""Hidden tests of exercise 11, the fast CRF: sums over all pairs and the literal lattice are the reference."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from semgrid_edu.answers import answer_array, peak_megabytes
from semgrid_edu.crf.lattice.literal import blur_literal, enclosing_simplex_literal
from semgrid_instructor import close, generator, hidden


@hidden
def check_blur_map(blur_map: Callable) -> None:
    """Narrow and wide Gaussians, high and low maps, and one whose matrix of all pairs wouldn't fit."""
    for seed, (shape, sigma) in enumerate((((7, 4), 0.6), ((3, 11), 2.5), ((6, 5), 40.0), ((1, 9), 1.0))):
        values = generator(110 + seed).normal(size=shape)
        got = answer_array(blur_map(values.copy(), sigma))
        assert got.shape == shape, f"shape {got.shape} instead of {shape}"
        place = np.indices(shape).reshape(2, -1).T / sigma
        wanted = np.exp(-0.5 * cdist(place, place, "sqeuclidean")) @ values.ravel()
        assert close(got.ravel(), wanted, atol=1e-3), "wrong sums with another width: is the Gaussian cut off?"
    values = generator(114).random((60, 50))
    _, megabytes = peak_megabytes(blur_map, values, 3.0)
    assert megabytes < 20, "a map of 60 x 50 cells took far more memory than two passes need"


def _points(seed: int) -> list[NDArray]:
    """Return points in 1 to 6 dimensions, on both sides of the plane after rounding, some two steps away from it."""
    rng = generator(seed)
    points = [rng.normal(0, 8, d + 1) for d in (1, 2, 3, 5, 6) for _ in range(12)]
    for d, side in ((5, 1), (5, -1), (6, 1), (6, -1)):
        residuals = np.append(rng.uniform(0.42, 0.47, d), 0)  # in units of d + 1
        residuals[-1] = np.rint(residuals.sum()) - residuals.sum()
        whole = rng.integers(-2, 3, d + 1)
        whole[-1] -= whole.sum() + np.rint(residuals.sum())
        points.append(side * (d + 1) * (whole + residuals))
    return [point - point.mean() for point in points]


@hidden
def check_corners(enclosing_simplex: Callable) -> None:
    """Other dimensions, and points whose rounded sum is negative."""
    for y in _points(115):
        d = len(y) - 1
        wanted = np.array(enclosing_simplex_literal(y)[0])
        corners = answer_array(enclosing_simplex(y.copy())[0])
        rounded = (d + 1) * np.rint(y / (d + 1)).sum()
        where = f"in {d} dimensions" + (", where rounding leaves a negative sum" if rounded < 0 else "")
        assert corners.shape == wanted.shape, f"{where}: shape {corners.shape} instead of {wanted.shape}"
        assert (corners.sum(axis=1) == 0).all(), f"{where}: corners that don't sum to 0"
        assert np.array_equal(corners, wanted), f"{where}: other corners"


@hidden
def check_weights(enclosing_simplex: Callable) -> None:
    """Other dimensions, and points whose rounded sum is 0: a mistake in the repair costs the corners only."""
    for y in _points(116):
        d = len(y) - 1
        if np.rint(y / (d + 1)).sum() == 0:
            wanted = enclosing_simplex_literal(y)[1]
            weights = answer_array(enclosing_simplex(y.copy())[-1])
            assert weights.shape == (d + 1,), f"in {d} dimensions: shape {weights.shape} instead of {(d + 1,)}"
            assert close(weights.sum(), 1), f"in {d} dimensions: the weights sum to {weights.sum():.2f}"
            assert close(weights, wanted), f"in {d} dimensions: the weighted mean of the corners isn't the point"


@hidden
def check_lattice_filter(lattice_filter: Callable) -> None:
    """Clouds in one, two, three and five dimensions, with vertices that are missing."""
    for d in (1, 2, 3, 5):
        rng = generator(117 + d)
        points = rng.normal(0, 4, (25, d + 1))
        simplices = [enclosing_simplex_literal(point - point.mean()) for point in points]
        values = rng.random((25, 3))
        got = answer_array(lattice_filter([(np.array(c), np.array(w)) for c, w in simplices], values.copy()))
        assert got.shape == values.shape, f"shape {got.shape} instead of {values.shape}"
        vertices = {}
        for (corners, weights), value in zip(simplices, values, strict=True):
            for corner, weight in zip(corners, weights, strict=True):
                vertices[corner] = vertices.get(corner, 0) + weight * value
        for direction in range(d + 1):
            vertices = blur_literal(vertices, direction)
        wanted = [sum(w * vertices[c] for c, w in zip(*simplex, strict=True)) for simplex in simplices]
        assert close(got, wanted), f"wrong in {d} dimensions: is each of the d + 1 directions blurred once?"


@hidden
def check_others_say(others_say: Callable) -> None:
    """Other kernels, also one that isn't symmetric, and another number of classes."""
    for seed, (n, k) in enumerate(((5, 1), (12, 4), (1, 3))):
        rng = generator(122 + seed)
        kernel, Q = rng.random((n, n)), rng.random((n, k))
        got = answer_array(others_say(lambda values, kernel=kernel: kernel @ values, Q.copy()))
        assert got.shape == Q.shape, f"shape {got.shape} instead of {Q.shape}"
        wanted = (kernel - np.diag(np.diag(kernel))) @ Q
        assert close(got, wanted, atol=1e-5), "wrong sums for a kernel that isn't symmetric, or other classes"


def _street(seed: int, n_classes: int, shape: tuple[int, int]) -> tuple[NDArray, NDArray]:
    """Return log g and o of patches of classes and states, with noise."""
    rng = generator(seed)
    rows, columns = np.indices(shape)
    truth, state = (rows // 4 + columns // 5) % n_classes, (columns // 5) % 4
    g = 0.4 * rng.dirichlet(np.ones(n_classes), shape) + 0.6 * np.eye(n_classes)[truth]
    o = 0.1 * rng.dirichlet(np.ones(4), shape) + 0.9 * np.eye(4)[state]
    return np.log(g).transpose(2, 0, 1), o.transpose(2, 0, 1)


def _four_cells(seed: int, shape: tuple[int, int], n_classes: int) -> tuple[NDArray, NDArray]:
    """Return log g and o of four cells in four different states, so that the bilateral kernel joins none of them."""
    difference = generator(seed).uniform(0.05, 0.2, (n_classes, *shape)) * np.arange(n_classes)[:, None, None]
    log_g = difference - np.log(np.exp(difference).sum(axis=0))
    return log_g, np.eye(4).reshape(4, *shape)


def _refined(log_g: NDArray, o: NDArray, damping: float | str = 1.0) -> NDArray:
    """Return mean field with all pairs written out; damped by a number, or by each cell's own p of lecture 10."""
    place, flat, total = np.indices(o.shape[1:]).reshape(2, -1).T, log_g.reshape(len(log_g), -1), 0
    for weight, f in ((4, np.hstack([place / 3.2, o.reshape(4, -1).T / 0.2])), (3, place / 1.2)):
        kernel = np.exp(-0.5 * cdist(f, f, "sqeuclidean"))
        total = total + weight * kernel / np.sqrt(np.outer(kernel.sum(axis=1), kernel.sum(axis=1)))
    part = 1 / (1 + np.diag(total) / 2) if damping == "p" else damping
    np.fill_diagonal(total, 0)
    log_q = flat
    for _ in range(11):
        q = np.exp(log_q - log_q.max(axis=0))
        q /= q.sum(axis=0)
        log_q = log_q + part * (flat + q @ total - log_q)
    return q.reshape(log_g.shape)


@hidden
def check_refine(refine: Callable) -> None:
    """Other maps and numbers of classes; then four cells in which every filter's kernel is exact, so few digits differ.

    There opinions settle so slowly that five or twenty iterations, another width or another normalisation show.
    """
    for seed, n_classes, shape in ((125, 3, (16, 9)), (126, 6, (8, 15)), (127, 5, (12, 13))):
        log_g, o = _street(seed, n_classes, shape)
        got = answer_array(refine(log_g.copy(), o.copy()))
        assert got.shape == log_g.shape, f"shape {got.shape} instead of {log_g.shape}"
        error = np.abs(got - _refined(log_g, o)).mean()
        assert error < 0.02, f"with {n_classes} classes on {shape[0]} x {shape[1]} cells: off by {error:.3f} on average"
    for seed, shape, n_classes in ((129, (2, 2), 2), (130, (2, 2), 3), (131, (1, 4), 3), (132, (4, 1), 4)):
        log_g, o = _four_cells(seed, shape, n_classes)
        got = answer_array(refine(log_g.copy(), o.copy()))
        right = any(close(got, _refined(log_g, o, damping), atol=1e-3) for damping in (1.0, 0.95, 0.9, "p"))
        assert right, (
            "wrong where the kernels are exact: ten iterations, width 1.2, D^-1/2 on both sides, nothing from itself?"
        )


@hidden
def check_refine_memory(refine: Callable) -> None:
    """Whether memory grows with the number of cells, not of pairs; what one cell says must reach its neighbours."""
    log_g, o = _street(128, 4, (45, 44))
    refined, megabytes = peak_megabytes(refine, log_g, o)
    refined = answer_array(refined)
    assert refined.shape == log_g.shape, f"shape {refined.shape} instead of {log_g.shape}"
    assert np.isfinite(refined).all(), "NaN or infinity on a large map"
    assert close(answer_array(refine(log_g, o)), refined, atol=1e-3), "another map for the same input"
    turned = log_g.copy()
    turned[:, 20, 20] = log_g[[1, 2, 3, 0], 20, 20]
    elsewhere = np.ones(o.shape[1:], bool)
    elsewhere[20, 20] = False
    moved = np.abs(answer_array(refine(turned, o)) - refined)[:, elsewhere]
    assert moved.max() > 1e-5 * np.abs(refined).max(), "what one cell says doesn't reach any other"
    assert megabytes < 25, f"1980 cells took {megabytes:.0f} MB"

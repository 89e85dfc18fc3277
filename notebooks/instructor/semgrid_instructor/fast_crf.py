"""Hidden tests of exercise 11, the fast CRF: sums over all pairs and the package's simplices are the reference."""

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from semgrid_edu.crf import enclosing_simplices
from semgrid_edu.workshop.course.answers import answer_array, peak_megabytes
from semgrid_instructor import close, generator, hidden


@hidden
def check_blur_known(blur_known: Callable) -> None:
    """Narrow and wide Gaussians, few and many gaps, and a map whose matrix of all pairs wouldn't fit."""
    for seed, (shape, sigma, share) in enumerate((((7, 4), 0.9, 0.5), ((3, 11), 2.5, 0.2), ((6, 5), 40.0, 0.9))):
        rng = generator(110 + seed)
        known = rng.random(shape) < share
        known[1, 2] = True
        values = np.where(known, rng.normal(2, 1, shape), np.nan)
        got = answer_array(blur_known(values.copy(), known.copy(), sigma))
        assert got.shape == shape, "another shape"
        place = np.indices(shape).reshape(2, -1).T / sigma
        weight = np.exp(-0.5 * cdist(place, place[known.ravel()], "sqeuclidean"))
        wanted = weight @ values[known] / weight.sum(axis=1)
        assert close(got.ravel(), wanted, atol=1e-3), "wrong means with another width, or other gaps"
    known = generator(114).random((60, 50)) < 0.5
    _, megabytes = peak_megabytes(blur_known, np.where(known, 1.0, np.nan), known, 3.0)
    assert megabytes < 20, "a map of 60 x 50 cells took far more memory than passes along rows and columns need"


def _blurred(vertices: dict[tuple[int, ...], NDArray], direction: int, keep: bool) -> dict[tuple[int, ...], NDArray]:
    """Return the vertices after each has given a quarter away on both sides; without a taker it is lost or kept."""
    new = dict.fromkeys(vertices, 0.0)
    for vertex, value in vertices.items():
        kept = value / 2
        for sign in (1, -1):
            other = tuple(c + sign * (1 - len(vertex) * (i == direction)) for i, c in enumerate(vertex))
            if other in new:
                new[other] = new[other] + value / 4
            elif keep:
                kept = kept + value / 4
        new[vertex] = new[vertex] + kept
    return new


@hidden
def check_lattice_filter(lattice_filter: Callable) -> None:
    """Clouds in one, two, three and five dimensions, with missing vertices: what is for them is lost or kept."""
    for d, keep in itertools.product((1, 2, 3, 5), (False, True)):
        rng = generator(117 + d)
        points = rng.normal(0, 4, (25, d + 1))
        corners, weights = enclosing_simplices(points - points.mean(axis=1, keepdims=True))
        values = rng.random((25, 3))
        handed = [(c.copy(), w.copy()) for c, w in zip(corners, weights, strict=True)]
        got = answer_array(lattice_filter(handed, values.copy(), keep))
        simplices = [(list(map(tuple, c.tolist())), w) for c, w in zip(corners, weights, strict=True)]
        assert got.shape == values.shape, "another shape"
        vertices = {}
        for (corners, weights), value in zip(simplices, values, strict=True):
            for corner, weight in zip(corners, weights, strict=True):
                vertices[corner] = vertices.get(corner, 0) + weight * value
        for direction in range(d + 1):
            vertices = _blurred(vertices, direction, keep)
        wanted = [sum(w * vertices[c] for c, w in zip(*simplex, strict=True)) for simplex in simplices]
        assert close(got, wanted), (
            "wrong in another number of dimensions: is each of the d + 1 directions blurred once?"
        )


def _counting(kernel: NDArray, columns: int) -> Callable:
    """Return a filter with this kernel, (N, N), that stops when it gets more columns than it may get."""
    left = [columns]

    def blur(values: NDArray) -> NDArray:
        values = np.asarray(values, float)
        left[0] -= values.size // len(kernel)
        assert left[0] >= 0, "blur got more columns than it may get"
        return kernel @ values

    return blur


@hidden
def check_others_say(others_say: Callable) -> None:
    """Other maps, reaches and numbers of classes; filters that aren't symmetric, as short-sighted as they may be."""
    for seed, (shape, reach, classes) in enumerate((((7, 6), 1, 3), ((5, 9), 2, 1), ((1, 12), 3, 4), ((8, 8), 0, 2))):
        rng = generator(122 + seed)
        place = np.indices(shape).reshape(2, -1).T
        near = np.abs(place[:, None] - place).max(axis=-1) <= reach
        kernel, Q = near * rng.uniform(0.2, 1, near.shape), rng.random((len(place), classes))
        got = answer_array(others_say(_counting(kernel, classes + (2 * reach + 1) ** 2), Q.copy(), shape, reach))
        assert got.shape == Q.shape, "another shape"
        wanted = (kernel - np.diag(np.diag(kernel))) @ Q
        assert close(got, wanted, atol=1e-5), "wrong sums on another map, with another reach"


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
        assert got.shape == log_g.shape, "another shape"
        error = np.abs(got - _refined(log_g, o)).mean()
        assert error < 0.02, "too far off on average, with other maps and numbers of classes"
    for seed, shape, n_classes in ((129, (2, 2), 2), (130, (2, 2), 3), (131, (1, 4), 3), (132, (4, 1), 4)):
        log_g, o = _four_cells(seed, shape, n_classes)
        got = answer_array(refine(log_g.copy(), o.copy()))
        right = any(close(got, _refined(log_g, o, damping), atol=1e-3) for damping in (1.0, 0.95, 0.9, "p"))
        assert right, (
            "wrong where the kernels are exact: ten iterations, width 1.2, D^-1/2 on both sides, nothing from itself?"
        )


@hidden
def check_refine_memory(refine: Callable) -> None:
    """Whether memory grows with the number of cells, not of pairs; the large map must be right, too, and one map."""
    log_g, o = _street(128, 4, (45, 44))
    refined, megabytes = peak_megabytes(refine, log_g.copy(), o.copy())
    refined = answer_array(refined)
    assert refined.shape == log_g.shape, "another shape"
    assert np.isfinite(refined).all(), "NaN or infinity on a large map"
    assert close(answer_array(refine(log_g.copy(), o.copy())), refined, atol=1e-3), "another map for the same input"
    turned = log_g.copy()
    turned[:, 20, 20] = log_g[[1, 2, 3, 0], 20, 20]
    elsewhere = np.ones(o.shape[1:], bool)
    elsewhere[20, 20] = False
    moved = np.abs(answer_array(refine(turned, o.copy())) - refined)[:, elsewhere]
    assert moved.max() > 1e-5 * np.abs(refined).max(), "what one cell says doesn't reach any other"
    assert np.abs(refined - _refined(log_g, o)).mean() < 0.02, "too far off on a large map"
    assert megabytes < 25, (
        "1980 cells took more memory than passes along rows and columns need: are all pairs written down?"
    )

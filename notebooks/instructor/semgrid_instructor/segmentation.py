"""Hidden tests of exercise 07, segmentation: scipy is the reference; PyTorch takes seconds to load, a cell has few."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate, map_coordinates
from scipy.special import log_softmax

from semgrid_instructor import hidden


def _pixels_seen(layers: list[tuple[int, int, int]]) -> set[int]:
    """Return the pixels of a row that output 0 of a chain depends on, walked from the last layer to the first."""
    seen = {0}
    for kernel, stride, rate in reversed(layers):
        seen = {stride * place + rate * k for place in seen for k in range(kernel)}
    return seen


@hidden
def check_field(receptive_field: Callable) -> None:
    """No layer, one layer, and random chains, whose pixels are counted one by one."""
    assert tuple(receptive_field([])) == (1, 1), "an empty chain sees its own pixel: field 1, jump 1"
    rng = np.random.default_rng(71)
    for _ in range(12):
        chain = [tuple(map(int, layer)) for layer in rng.integers(1, 4, size=(5, 3))]
        field, jump = receptive_field(list(chain))
        assert jump == np.prod([stride for _, stride, _ in chain]), "wrong jump (strides need not be 1 or 2)"
        assert field == max(_pixels_seen(chain)) + 1, "wrong field (from the first pixel to the last, holes and all)"


def _pool(image: NDArray) -> tuple[NDArray, NDArray]:
    """Return the maxima of whole 2x2 windows and their indices, the windows taken one by one."""
    h, w = image.shape[0] // 2, image.shape[1] // 2
    places = np.arange(image.size).reshape(image.shape)
    indices = np.zeros((h, w), int)
    for v, u in np.ndindex(h, w):
        window = places[2 * v : 2 * v + 2, 2 * u : 2 * u + 2].ravel()
        indices[v, u] = max(window, key=image.ravel().__getitem__)
    return image.ravel()[indices], indices


@hidden
def check_pool(max_pool: Callable) -> None:
    """Random maps of other shapes, with numbers below zero; all different, so that no maximum is tied."""
    rng = np.random.default_rng(72)
    for shape, shift in (((2, 2), 0.0), ((6, 4), 0.0), ((4, 10), -20.0)):
        image = rng.normal(size=shape) + shift
        pooled, indices = max_pool(image.copy())
        values, places = _pool(image)
        assert np.shape(pooled) == values.shape, "wrong shape of the maxima"
        assert np.allclose(pooled, values), "wrong maxima (a map may be negative everywhere)"
        assert np.array_equal(indices, places), "the maxima are right, their indices are not"


@hidden
def check_unpool(unpool: Callable) -> None:
    """Random maps, also with an odd number of rows or columns."""
    rng = np.random.default_rng(73)
    for shape in ((4, 6), (5, 6), (6, 9), (7, 3)):
        image = rng.normal(size=shape)
        values, places = _pool(image)
        got = np.asarray(unpool(values.copy(), places.copy(), shape))
        assert got.shape == shape, "not the shape that was asked for (it may be odd)"
        kept = np.isin(np.arange(image.size), places).reshape(shape)
        assert np.allclose(got, image * kept), "a maximum isn't where its index says, or isn't what it was"


@hidden
def check_atrous(atrous: Callable) -> None:
    """Random images and kernels, other rates, one of them as large as the image."""
    rng = np.random.default_rng(74)
    for rate, shape in ((1, (4, 6)), (2, (9, 5)), (3, (8, 11)), (6, (6, 7))):
        image, kernel = rng.normal(size=shape), rng.normal(size=(3, 3))
        got = np.asarray(atrous(image.copy(), kernel.copy(), rate))
        assert got.shape == shape, f"rate {rate}: not the shape of the image"
        spread = np.zeros((2 * rate + 1, 2 * rate + 1))
        spread[::rate, ::rate] = kernel
        assert np.allclose(got, correlate(image, spread, mode="constant")), f"wrong with rate {rate}"


@hidden
def check_skip(add_skip: Callable) -> None:
    """Random scores of several classes, even and odd sizes."""
    rng = np.random.default_rng(75)
    for n_classes, (h, w), (height, width) in ((3, (3, 5), (6, 10)), (4, (4, 3), (7, 5)), (3, (1, 6), (2, 11))):
        coarse, fine = rng.normal(size=(n_classes, h, w)), rng.normal(size=(n_classes, height, width))
        got = np.asarray(add_skip(coarse.copy(), fine.copy()))
        assert got.shape == fine.shape, "not the shape of the fine map"
        places = np.mgrid[:height, :width] / 2 - 0.25
        enlarged = [map_coordinates(scores, places, order=1, mode="nearest") for scores in coarse]
        assert np.allclose(got, enlarged + fine), f"wrong sums with {n_classes} classes"


def _labelled(seed: int, shape: tuple[int, int, int], unlabelled: float) -> tuple[NDArray, NDArray]:
    """Return random scores, (C, h, w), and classes, of which a share is 255."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, shape[0], size=shape[1:])
    truth[rng.random(shape[1:]) < unlabelled] = 255
    truth[0, 0] = 1
    return rng.normal(0, 3, size=shape), truth


def _cross_entropy(scores: NDArray, truth: NDArray) -> float:
    """Return the mean of -log P(true class) over labelled pixels."""
    log_P = log_softmax(scores, axis=0)
    return -np.mean([log_P[truth[place], *place] for place in np.ndindex(truth.shape) if truth[place] != 255])


@hidden
def check_loss(cross_entropy: Callable) -> None:
    """Other shapes and classes, from no unlabelled pixel to nearly all of them."""
    for seed, shape, unlabelled in ((76, (4, 3, 5), 0.4), (77, (14, 6, 2), 0.0), (78, (2, 4, 4), 0.9)):
        scores, truth = _labelled(seed, shape, unlabelled)
        got = cross_entropy(scores.copy(), truth.copy())
        assert np.isclose(got, _cross_entropy(scores, truth)), "wrong loss"


@hidden
def check_large(cross_entropy: Callable) -> None:
    """Scores of thousands, of both signs, of which each pixel has its own."""
    scores, truth = _labelled(79, (5, 4, 3), 0.2)
    scores += np.linspace(-4000, 4000, 12).reshape(4, 3)
    got = cross_entropy(scores.copy(), truth.copy())
    assert np.isfinite(got), "no number: subtract each pixel's own largest score, not one for the whole image"
    assert np.isclose(got, _cross_entropy(scores, truth)), "wrong loss"

"""Hidden tests of exercise 07, segmentation: scipy is the reference; PyTorch takes seconds to load, a cell has few."""

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import correlate, map_coordinates
from scipy.special import log_softmax

from semgrid_edu.workshop.course.answers import answer_array
from semgrid_instructor import close, generator, hidden, in_any_order, keeping


def _rates(fewest_rates: Callable, field: int) -> list[int]:
    """Return the rates for a field, after checking that they have this field without a gap."""
    rates = answer_array(fewest_rates(field))
    assert rates.ndim == 1, "it doesn't return a list of rates"
    assert np.all(rates == np.round(rates)), "a rate isn't a whole number"
    assert np.all(rates >= 1), "a rate is below 1"
    assert 1 + 2 * rates.sum() == field, "the chain hasn't the field that was asked for"
    counts = np.ones(1)
    for rate in rates.astype(int):
        counts = np.convolve(counts, np.isin(np.arange(2 * rate + 1), (0, rate, 2 * rate)))
        counts = np.minimum(counts, 1)
    assert counts.all(), "the chain has a gap"
    return rates.tolist()


def _fields(seed: int) -> list[int]:
    """Return odd fields, small and large, and those around the powers of three."""
    return [5, 11, 25, 31, 79, 81, 83, 729, *(2 * generator(seed).integers(4, 1000, size=6) + 1).tolist()]


@hidden
def check_chain(fewest_rates: Callable) -> None:
    """Other fields; the layers may be too many."""
    for field in _fields(71):
        _rates(fewest_rates, field)


@hidden
def check_fewest(fewest_rates: Callable) -> None:
    """Other fields: n layers see at most 3^n pixels without a gap."""
    for field in _fields(72):
        layers = len(_rates(fewest_rates, field))
        assert 3 ** (layers - 1) < field, "a chain could be shorter"


def _pool(maps: NDArray, kernel: int, stride: int) -> tuple[NDArray, NDArray]:
    """Return the maxima of whole windows and their indices: sorted, with equal numbers left in their order."""
    corners = sliding_window_view(np.arange(maps[0].size).reshape(maps.shape[1:]), (kernel, kernel))
    windows = corners[::stride, ::stride].reshape(*corners[::stride, ::stride].shape[:2], -1)
    values = maps.reshape(len(maps), -1)[:, windows]
    first = np.argsort(-values, axis=-1, kind="stable")[..., :1]
    indices = np.take_along_axis(np.broadcast_to(windows, values.shape), first, axis=-1)
    return np.take_along_axis(values, first, axis=-1)[..., 0], indices[..., 0]


def _maps_to_pool(seed: int) -> list[tuple[NDArray, int, int]]:
    """Return maps with ties, kernels and strides: windows that overlap, touch, and lie apart; maps all below zero."""
    rng = generator(seed)
    cases = (
        ((3, 7, 5), 3, 2, 0.0),
        ((2, 6, 9), 2, 2, -9.0),
        ((1, 8, 10), 3, 1, 0.0),
        ((4, 5, 4), 1, 2, -9.0),
        ((2, 9, 6), 4, 3, 0.0),
    )
    return [(rng.integers(-2, 4, size=shape) + shift, kernel, stride) for shape, kernel, stride, shift in cases]


@hidden
@keeping
def check_maxima(max_pool: Callable) -> None:
    """Other maps, kernels and strides."""
    for maps, kernel, stride in _maps_to_pool(73):
        got = max_pool(maps.copy(), kernel, stride)
        pooled = answer_array(got if isinstance(got, np.ndarray) and got.ndim == 3 else got[0])
        expected = _pool(maps, kernel, stride)[0]
        assert pooled.shape == expected.shape, "wrong shape of the maxima, with other kernels and strides"
        assert close(pooled, expected), "wrong maxima (a map may be negative everywhere)"


@hidden
def check_indices(max_pool: Callable) -> None:
    """Other maps, kernels and strides."""
    for maps, kernel, stride in _maps_to_pool(74):
        indices = answer_array(max_pool(maps.copy(), kernel, stride)[1])
        assert np.array_equal(indices, _pool(maps, kernel, stride)[1]), "wrong indices, with other kernels and strides"


@hidden
@keeping
def check_unpool(unpool: Callable) -> None:
    """Take indices of random maps, and values that have nothing to do with them."""
    rng = generator(75)
    for maps, kernel, stride in _maps_to_pool(76):
        indices = _pool(maps, kernel, stride)[1]
        values = rng.normal(size=indices.shape)
        got = answer_array(unpool(values.copy(), indices.copy(), maps.shape))
        assert got.shape == maps.shape, "not the shape that was asked for (it may be odd)"
        pairs = zip(indices.reshape(len(maps), -1), values.reshape(len(maps), -1), strict=True)
        expected = [np.bincount(places, weights, maps[0].size) for places, weights in pairs]
        assert close(got, np.reshape(expected, maps.shape)), "a value isn't where its index says, or isn't what it was"


def _every(every: int, border: int, shape: tuple[int, int]) -> tuple[Callable, NDArray]:
    """Return a toy network that looks at every so many columns and knows nothing at the border, and a street for it."""
    street = generator(77 + every).integers(0, 200, (*shape, 3)).astype(np.uint8)

    def label(image: NDArray) -> NDArray:
        image = np.asarray(image)
        assert image.size < 100_000, "a network takes images of at most 100,000 numbers"
        places = every * (np.arange(image.shape[1]) // every)
        classes = image[:, places, 1].astype(int) // 40
        outside = np.minimum(np.arange(image.shape[1]), np.arange(image.shape[1])[::-1]) < border
        classes[:, outside] = 9
        return classes

    return label, street


@hidden
@keeping
def check_moved(share_moved: Callable) -> None:
    """Other networks, shifts and margins."""
    for every, border, shift, margin in ((1, 0, 1, 0), (4, 6, 3, 7), (8, 2, 11, 2), (2, 5, 1, 9)):
        label, street = _every(every, border, (4, 90))
        places = np.arange(shift + margin, 90 - shift - margin)
        before, after = label(street[:, :-shift])[:, places], label(street[:, shift:])[:, places - shift]
        got = answer_array(share_moved(label, street.copy(), shift, margin)).ravel()
        assert got.size == 1, "it doesn't return one number"
        assert close(got, [(before == after).sum() / before.size]), "wrong share, with other shifts and margins"


@hidden
@keeping
def check_period(period: Callable) -> None:
    """Other networks, with a border that doesn't count."""
    for every, wanted in in_any_order(((8, 8), (1, 1), (64, 64), (16, 16), (3, 0))):
        label, street = _every(every, 5, (4, 300))
        got = answer_array(period(label, street.copy(), 5)).ravel()
        assert got.size == 1, "it doesn't return one number"
        assert got[0] == wanted, "a wrong period, for another network"


def _of_test_size(image: NDArray) -> NDArray:
    """Return an image that an answer shows to a box, unless it would keep the box busy."""
    assert np.size(image) < 10_000, "a box takes images of at most 100 x 100 pixels"
    return np.asarray(image, float)


def _pooling(kind: int, depth: int, weight: float) -> Callable:
    """Return a box of maxima: 0 indices, 1 skips."""

    def box(image: NDArray) -> NDArray:
        pooled, levels = _of_test_size(image), []
        for _ in range(depth):
            levels.append((pooled, _pool(pooled[None], 2, 2)[1][0]))
            pooled = _pool(pooled[None], 2, 2)[0][0]
        for before, places in reversed(levels):
            if kind == 0:
                pooled, small = np.zeros(before.shape), pooled
                pooled.flat[places.ravel()] = small.ravel()
            else:
                finer = np.mgrid[: before.shape[0], : before.shape[1]] / 2 - 0.25
                pooled = map_coordinates(pooled, finer, order=1, mode="nearest") + weight * before
        return pooled

    return box


def _convolving(kind: int, depth: int, kernels: NDArray) -> Callable:
    """Return a box of sums: 2 strided, 3 atrous."""

    def box(image: NDArray) -> NDArray:
        result = _of_test_size(image)
        for level in range(depth):
            rate = 1 if kind == 2 else 2**level
            spread = np.zeros((2 * rate + 1, 2 * rate + 1))
            spread[::rate, ::rate] = kernels[level]
            result = correlate(result, spread, mode="constant")
            result = result[::2, ::2] if kind == 2 else result
        places = np.mgrid[: len(image), : len(image)] / 2**depth
        return map_coordinates(result, places, order=1, mode="nearest") if kind == 2 else result

    return box


def _check_boxes(name_mechanism: Callable, seed: int, depths: tuple[int, ...], plain: bool) -> None:
    """Judge boxes of each kind in a random order: with the lecture's kernel, or with random ones and weights."""
    rng = generator(seed)
    binomial = np.outer([1, 2, 1], [1, 2, 1]) / 16
    for depth in depths:
        for kind in rng.permutation(4):
            kernels = np.array([binomial] * 3) if plain else rng.uniform(0.05, 1, size=(3, 3, 3))
            weight = 1.0 if plain else rng.uniform(0.2, 3)
            box = _pooling(kind, depth, weight) if kind < 2 else _convolving(kind, depth, kernels)
            got = answer_array(name_mechanism(box, int(8 * rng.integers(3, 6)))).ravel()
            assert got.shape == (1,), "it doesn't return one name"
            assert got[0] == kind, "a box gets the name of another mechanism"


@hidden
def check_boxes(name_mechanism: Callable) -> None:
    """Judge boxes with the lecture's kernel and depth, for images of other sizes."""
    _check_boxes(name_mechanism, 80, (2, 2), plain=True)


@hidden
def check_strange_boxes(name_mechanism: Callable) -> None:
    """Other depths, kernels and weights."""
    _check_boxes(name_mechanism, 92, (1, 2, 3, 3), plain=False)


def _labelled(seed: int, shape: tuple[int, int, int], unlabelled: float) -> tuple[NDArray, NDArray]:
    """Return random scores, (C, h, w), and classes, of which a share is 255."""
    rng = generator(seed)
    truth = rng.integers(0, shape[0], size=shape[1:])
    truth[rng.random(shape[1:]) < unlabelled] = 255
    truth[0, 0] = 1
    return rng.normal(0, 3, size=shape), truth


def _cross_entropy(scores: NDArray, truth: NDArray) -> float:
    """Return the mean of -log P(true class) over labelled pixels."""
    log_P = log_softmax(scores, axis=0)
    return -np.mean([log_P[truth[place], *place] for place in np.ndindex(truth.shape) if truth[place] != 255])


@hidden
@keeping
def check_loss(loss_and_gradient: Callable) -> None:
    """Other shapes and classes, from no unlabelled pixel to nearly all of them."""
    for seed, shape, unlabelled in ((81, (4, 3, 5), 0.4), (82, (14, 6, 2), 0.0), (83, (2, 4, 4), 0.9)):
        scores, truth = _labelled(seed, shape, unlabelled)
        got = loss_and_gradient(scores.copy(), truth.copy())
        got = answer_array(got[0] if isinstance(got, tuple | list) else got)
        assert close(got, _cross_entropy(scores, truth)), "wrong loss"


@hidden
def check_gradient(loss_and_gradient: Callable) -> None:
    """Against the loss itself, each score nudged up and down."""
    for seed, shape, unlabelled in ((84, (4, 3, 2), 0.4), (85, (3, 2, 2), 0.0), (86, (2, 3, 3), 0.9)):
        scores, truth = _labelled(seed, shape, unlabelled)
        got = answer_array(loss_and_gradient(scores.copy(), truth.copy())[1])
        assert got.shape == shape, "wrong shape of the gradient"
        nudges = 1e-5 * np.eye(scores.size).reshape(-1, *shape)
        slopes = [_cross_entropy(scores + nudge, truth) - _cross_entropy(scores - nudge, truth) for nudge in nudges]
        assert close(got.ravel(), np.array(slopes) / 2e-5, atol=1e-7), "wrong gradient"


@hidden
def check_large(loss_and_gradient: Callable) -> None:
    """Scores of ten thousands, of both signs: even a long double can't hold e^30000; everybody is labelled."""
    scores, truth = _labelled(87, (5, 4, 3), 0.0)
    shift = np.linspace(-30000, 30000, 12).reshape(4, 3)
    small, large = (
        [answer_array(part) for part in loss_and_gradient(scores + added, truth.copy())] for added in (0, shift)
    )
    other = answer_array(loss_and_gradient(2 * scores, truth.copy())[0])
    assert not close(small[0], other), "the loss doesn't depend on the scores"
    assert np.ptp(small[1]) > 0, "the gradient is the same everywhere"
    assert np.isfinite(large[0]).all(), (
        "no number: subtract each pixel's own largest score, not one for the whole image"
    )
    assert close(large[0], small[0]), "the loss changes where the same is added to all scores of a pixel"
    assert close(large[1], small[1]), "the gradient changes where the same is added to all scores of a pixel"

"""Hidden tests of exercise 06, sampling on planes: scipy's interpolation and its adjoint are the reference.

No PyTorch here: importing it takes longer than a cell of an exercise may.
"""

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from semgrid_edu.workshop.course.answers import answer_array
from semgrid_instructor import close, generator, hidden, in_any_order, keeping


def _weights(four_pixels: Callable, u: float, v: float, h: int, w: int) -> NDArray:
    """Return the weight that an answer gives to each pixel, (h, w)."""
    rows, cols, weights = (answer_array(part).ravel() for part in four_pixels(u, v, h, w))
    assert len(rows) == len(cols) == len(weights) == 4, "not four rows, columns and weights"
    inside = (rows >= 0) & (rows < h) & (cols >= 0) & (cols < w)
    assert inside.all(), "a pixel that doesn't exist (images need not be wider than high)"
    table = np.zeros((h, w))
    np.add.at(table, (rows.astype(int), cols.astype(int)), weights.astype(float))
    return table


def _right(u: float, v: float, h: int, w: int) -> NDArray:
    """Return the weight of each pixel by equation (2), (h, w)."""
    return np.outer(_kernel(v - np.arange(h)), _kernel(u - np.arange(w)))


def _kernel(t: NDArray) -> NDArray:
    return np.maximum(0, 1 - np.abs(t))


def _read(scores: NDArray, pixels: NDArray, visible: NDArray) -> NDArray:
    """Return what the points read, (C, H, W)."""
    planes = np.zeros((len(scores), *visible.shape))
    for plane, image in zip(planes, scores, strict=True):
        plane[visible] = map_coordinates(image, pixels[visible].T[::-1], order=1)
    return planes


@hidden
def check_four_pixels(four_pixels: Callable) -> None:
    """Random points inside images of several sizes, some of them higher than wide."""
    rng = generator(61)
    for h, w in ((5, 3), (2, 9), (40, 60)):
        for u, v in rng.uniform(0.01, 0.99, size=(20, 2)) * (w - 1, h - 1):
            got = _weights(four_pixels, float(u), float(v), h, w)
            assert close(got, _right(u, v, h, w)), "wrong weights"


@hidden
def check_border(four_pixels: Callable) -> None:
    """Corners, edges and centres, and a point a hair before the last column; the values if they are right elsewhere."""
    n = int(generator(60).integers(5, 30))
    inside = [(1.2, 0.7), (2.6, 3.1)]
    sound = all(close(_weights(four_pixels, u, v, n, n), _right(u, v, n, n)) for u, v in inside)
    heaviest = set()
    e = n - 1
    for u, v in ((0, 0), (e, e), (0, e), (e, 0), (2, e), (e, 2.25), (1.75, e), (2, 3), (0, 2.5), (e - 1e-9, e)):
        got = _weights(four_pixels, float(u), float(v), n, n)
        assert not close(got.sum(), 0), "all weights are 0 on a border or a pixel's centre"
        heaviest.add(int(got.argmax()))
        right = close(got, _right(u, v, n, n), atol=1e-6)
        assert right or not sound, "wrong weights on a border or a pixel's centre"
    assert len(heaviest) > 4, "the same pixel has most weight, wherever the point is"


def _places(seed: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return scores (3, 7, 5), pixels (24, 2) with corners of the image among them, and what is visible."""
    rng = generator(seed)
    scores, pixels = rng.normal(size=(3, 7, 5)), rng.uniform(0, 1, size=(24, 2)) * (4, 6)
    visible = rng.random(24) < 0.5
    pixels[:3], visible[:6] = [[0, 0], [4, 6], [4, 0]], [True, True, True, True, False, False]
    pixels[~visible] = rng.choice([np.nan, -3.2, 1e6, 1.5], size=(np.sum(~visible), 2))
    pixels[4:6] = 1.5  # in the image: something hides it
    return scores, pixels, visible


def _boxes(rng: np.random.Generator, kind: int, h: int, w: int, n: int) -> tuple[Callable, Callable]:
    """Return forward and backward: 0 a pair, 1 overwrites, 2 divided by n, 3 to the nearest pixel."""
    places = rng.integers(0, (w - 1, h - 1), size=(n, 2)) + rng.choice([0.2, 0.3, 0.6, 0.7], size=(n, 2))
    places[-1] = np.floor(places[0]) + 0.7  # so that two of them share pixels
    A = np.array([_right(u, v, h, w).ravel() for u, v in places])

    def forward(s: NDArray) -> NDArray:
        return A @ np.asarray(s, float).reshape(h * w)

    def backward(p_bar: NDArray) -> NDArray:
        shares, s_bar = A * np.asarray(p_bar, float).reshape(-1, 1), np.zeros(h * w)
        if kind == 1:
            for one, read in zip(shares, A > 0, strict=True):
                s_bar[read] = one[read]
        elif kind == 3:
            np.add.at(s_bar, A.argmax(axis=1), np.asarray(p_bar, float).ravel())
        else:
            s_bar = shares.sum(axis=0) / (1 if kind == 0 else n)
        return s_bar.reshape(h, w)

    return forward, backward


@hidden
def check_which_kind(which_kind: Callable) -> None:
    """Judge other images and points, each kind more than once."""
    rng = generator(65)
    for h, w, n in ((7, 5, 12), (3, 9, 2), (6, 4, 30)):
        for kind in in_any_order(range(4)):
            found = answer_array(which_kind(*_boxes(rng, kind, h, w, n), h, w, n)).ravel()
            assert found.shape == (1,), "it doesn't return one number"
            assert found[0] == kind, "the wrong kind for another image and other points"


@hidden
@keeping
def check_yaw_slope(yaw_slope: Callable) -> None:
    """Random cameras, scores and points; then points a thousandth of a pixel away from a centre line."""
    rng = generator(66)
    for offset, complaint in ((None, "wrong slope"), (1e-3, "wrong close to a pixel's centre: does a step cross it?")):
        for n_points in (1, 7):
            s, t = rng.normal(size=(8, 15)), rng.normal(size=n_points)
            K = np.array([[rng.uniform(5, 9), 0, 6.3], [0, rng.uniform(5, 9), 2.9], [0, 0, 1]])
            inside = (
                rng.uniform(0.2, 0.8, size=(n_points, 2))
                if offset is None
                else np.tile([offset, 1 - offset], (n_points, 1))
            )
            pixels, Z = rng.integers(0, (14, 7), size=(n_points, 2)) + inside, rng.uniform(2, 30, n_points)
            rays = (pixels - K[:2, 2]) / np.diag(K)[:2]
            points = np.column_stack([rays * Z[:, None], Z])
            got = answer_array(yaw_slope(s, points, K, t)).ravel()
            assert got.shape == (1,), "not one number"
            step = 1e-7
            later, before = (_loss_turned(s, points, K, t, angle) for angle in (step, -step))
            assert close(got[0], (later - before) / (2 * step), rtol=1e-3, atol=1e-4), complaint


def _loss_turned(s: NDArray, points: NDArray, K: NDArray, t: NDArray, angle: float) -> float:
    """Return the loss when the camera is turned to the side."""
    X, Y, Z = points.T
    X, Z = X * np.cos(angle) + Z * np.sin(angle), Z * np.cos(angle) - X * np.sin(angle)
    u, v = K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]
    return float(0.5 * ((map_coordinates(s, [v, u], order=1) - t) ** 2).sum())


def _black_box(kind: int, swapped: bool = False) -> Callable:
    """Return a sampler of a convention: 0 centres, 1 corners, 2 stretched."""

    def sampler(image: NDArray, u: NDArray, v: NDArray) -> NDArray:
        image = np.asarray(image, float)
        places = []
        for at, size in zip((u, v) if swapped else (v, u), image.shape, strict=True):
            at = np.asarray(at, float)
            places.append((at, at - 0.5, at * (size - 1) / size)[kind])
        return map_coordinates(image, places, order=1, mode="nearest")

    return sampler


@hidden
def check_convention(convention: Callable) -> None:
    """Judge images of other sizes, large and small."""
    rng = generator(67)
    for h, w in (*rng.integers(4, 60, size=(4, 2)), (4, 4), (375, 1242)):
        for kind in in_any_order(range(3)):
            found = answer_array(convention(_black_box(kind), int(h), int(w))).ravel()
            assert found.shape == (1,), "it doesn't return one number"
            assert found[0] == kind, "the wrong convention in an image of another size"


@hidden
def check_swaps(swaps: Callable, convention: Callable) -> None:
    """Judge samplers of each kind that swap u and v, and others that don't."""
    for h, w in (*generator(63).integers(4, 40, size=(2, 2)).tolist(), (7, 7)):
        for kind, swapped in in_any_order(product(range(3), (False, True))):
            told = bool(swaps(_black_box(kind, swapped), h, w))
            assert told == swapped, "wrong about a sampler in an image of another size"
            if (
                swapped and answer_array(convention(_black_box(kind), h, w)).ravel()[0] == kind
            ):  # check_convention judges others
                found = answer_array(convention(_black_box(kind, True), h, w)).ravel()[0]
                assert found == kind, "convention is wrong for a sampler that swaps"


def _four(u: float, v: float, h: int, w: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return rows, columns and weights of the four pixels that a point reads; an answer may call this with anything."""
    assert h * w < 1000, "another image"
    heaviest = np.argsort(-_right(u, v, h, w), axis=None)[:4]
    return heaviest // w, heaviest % w, _right(u, v, h, w).ravel()[heaviest]


@hidden
@keeping
def check_sampling_matrix(there_and_back: Callable) -> None:
    """Judge values and gradients of other images and points; where pixels meet, and where points aren't visible."""
    for seed in (68, 69):
        scores, pixels, visible = _places(seed)
        p_bar = generator(seed + 10).normal(size=(3, 24))
        given = scores.copy(), p_bar.copy(), pixels.copy(), visible.copy()
        p, s_bar = map(answer_array, there_and_back(*given, _four))
        assert p.shape == (3, 24), "another shape"
        assert not np.isnan(p).any(), "NaN got in from points that aren't visible"
        assert close(p, _read(scores, pixels, visible)), "wrong values (an image may be higher than wide)"
        units = np.eye(35).reshape(35, 7, 5)
        wanted = np.einsum("kn,cn->ck", _read(units, pixels, visible), p_bar).reshape(3, 7, 5)
        assert close(s_bar, wanted), "wrong gradient in the scores"

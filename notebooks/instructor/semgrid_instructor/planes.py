"""Hidden tests of exercise 06, sampling on planes: scipy's interpolation and its adjoint are the reference.

No PyTorch here: importing it takes longer than a cell of an exercise may.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from semgrid_edu.answers import answer_array
from semgrid_instructor import close, generator, hidden


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
    n = 5
    inside = [(1.2, 0.7), (2.6, 3.1)]
    sound = all(close(_weights(four_pixels, u, v, n, n), _right(u, v, n, n)) for u, v in inside)
    heaviest = set()
    for u, v in ((0, 0), (4, 4), (0, 4), (4, 0), (2, 4), (4, 2.25), (1.75, 4), (2, 3), (0, 2.5), (4 - 1e-9, 4)):
        got = _weights(four_pixels, float(u), float(v), n, n)
        assert not close(got.sum(), 0), "all weights are 0 on a border or a pixel's centre"
        heaviest.add(int(got.argmax()))
        right = close(got, _right(u, v, n, n), atol=1e-6)
        assert right or not sound, "wrong weights on a border or a pixel's centre"
    assert len(heaviest) > 4, "the same pixel has most weight, wherever the point is"


def _plane(seed: int, all_visible: bool = False) -> tuple[NDArray, NDArray, NDArray]:
    """Return scores (3, 7, 5), pixels (6, 4, 2) with corners of the image among them, and what is visible."""
    rng = generator(seed)
    scores, pixels = rng.normal(size=(3, 7, 5)), rng.uniform(0, 1, size=(6, 4, 2)) * (4, 6)
    pixels[0, :3] = [[0, 0], [4, 6], [4, 0]]
    visible = np.ones((6, 4), bool) if all_visible else rng.random((6, 4)) < 0.6
    pixels[~visible] = rng.choice([np.nan, -3.2, 1e6, 1.5], size=(np.sum(~visible), 2))
    for row, col in np.argwhere(~visible)[:2]:
        pixels[row, col] = 1.5  # in the image: something hides it
    return scores, pixels, visible


@hidden
def check_sample_plane(sample_plane: Callable) -> None:
    """Random scores of an image that is higher than wide, at all of whose corners somebody reads."""
    scores, pixels, visible = _plane(62, all_visible=True)
    got = answer_array(sample_plane(scores.copy(), pixels.copy(), visible.copy()))
    assert got.shape == (3, 6, 4), f"shape {got.shape} instead of (3, 6, 4)"
    right = _read(scores, pixels, visible)
    inner = np.ones((6, 4), bool)
    inner[0, :3] = False
    assert close(got[:, inner], right[:, inner]), "wrong values"
    assert close(got, right), "points on the last row or column read wrong values"


@hidden
def check_invisible(sample_plane: Callable) -> None:
    """Not visible for every reason: behind the camera (NaN), outside, hidden by something; or nothing visible."""
    scores, pixels, visible = _plane(63)
    full = answer_array(sample_plane(scores.copy(), _plane(63, all_visible=True)[1], np.ones((6, 4), bool)))
    got = answer_array(sample_plane(scores.copy(), pixels.copy(), visible.copy()))
    assert got.shape == full.shape, "the shape depends on what is visible"
    twice = answer_array(sample_plane(2 * scores, _plane(63, all_visible=True)[1], np.ones((6, 4), bool)))
    assert not close(full, twice), "it doesn't matter what the scores are"
    assert (got[..., ~visible] == 0).all(), "points that aren't visible don't take 0"
    assert close(got[..., visible], full[..., visible]), "other values where not all is visible"
    nothing = answer_array(sample_plane(scores, np.full_like(pixels, np.nan), np.zeros_like(visible)))
    assert nothing.shape == (3, 6, 4), "the shape is wrong where nothing is visible"
    assert (nothing == 0).all(), "not all 0 where nothing is visible"


@hidden
def check_give_back(give_back: Callable) -> None:
    """Compare random blame with a pixel at a time; test <A s, p_bar> = <s, A^T p_bar>."""
    scores, pixels, visible = _plane(64, all_visible=True)
    p_bar = generator(65).normal(size=(3, 6, 4))
    got = answer_array(give_back(p_bar.copy(), pixels.copy(), visible.copy(), 7, 5))
    assert got.shape == (3, 7, 5), f"shape {got.shape} instead of (3, 7, 5)"
    read = _read(scores, pixels, visible)
    assert close((p_bar * read).sum(), (got * scores).sum()), "it isn't the transpose of equation (2)"
    one_pixel = np.eye(35).reshape(35, 7, 5)
    weights = _read(one_pixel, pixels, visible)
    assert close(got, np.einsum("nrc,krc->kn", weights, p_bar).reshape(3, 7, 5)), "wrong gradient"


@hidden
def check_give_back_invisible(give_back: Callable) -> None:
    """Place what isn't visible anywhere: it changes nothing, as if the visible points were all there are."""
    _, pixels, visible = _plane(68)
    p_bar = generator(69).normal(size=(3, 6, 4))
    got = answer_array(give_back(p_bar.copy(), pixels.copy(), visible.copy(), 7, 5))
    assert not np.isnan(got).any(), "NaN got in from points that aren't visible"
    alone = p_bar[:, visible][:, None], pixels[visible][None], np.ones((1, visible.sum()), bool)
    wanted = answer_array(give_back(*alone, 7, 5))
    fewer = answer_array(give_back(*(part[..., :3] if part is alone[0] else part[:, :3] for part in alone), 7, 5))
    assert not close(wanted, fewer), "the same, however many points there are"
    assert close(got, wanted), "points that aren't visible teach somebody"


@hidden
def check_slopes(slopes: Callable) -> None:
    """Random images and points; then points a thousandth of a pixel away from a centre."""
    rng = generator(66)
    for offset, complaint in ((None, "wrong slopes"), (1e-3, "wrong close to a pixel's centre: does a step cross it?")):
        for _ in range(10):
            s, (n, m) = rng.normal(size=(8, 5)), rng.integers(0, (7, 4))
            across, down = rng.uniform(0.2, 0.8, size=2) if offset is None else (offset, 1 - offset)
            (a, b), (c, d) = s[n : n + 2, m : m + 2]
            right = (1 - down) * (b - a) + down * (d - c), (1 - across) * (c - a) + across * (d - b)
            got = answer_array(slopes(s.copy(), float(m + across), float(n + down))).ravel()
            assert close(got, right, atol=1e-3), complaint


def _judge_places(unit_places: Callable, edge: float) -> None:
    """Compare with a straight line from -1 to 1, whose ends lie `edge` pixels outside the first and last centre."""
    rng = generator(67)
    for h, w in ((4, 9), (7, 2), (96, 320)):
        pixels = rng.uniform(0, 1, size=(2, 3, 5, 2)) * (w - 1, h - 1)
        pixels[0, 0, :2] = [[0, 0], [w - 1, h - 1]]
        got = answer_array(unit_places(pixels.copy(), (h, w), edge == 0))
        assert got.shape == pixels.shape, "the shape changed (there may be more axes before the last)"
        for axis, size in ((0, w), (1, h)):
            right = np.interp(pixels[..., axis], (-edge, size - 1 + edge), (-1, 1))
            assert close(got[..., axis], right), "wrong places"


@hidden
def check_centres(unit_places: Callable) -> None:
    """Other images, more axes, the first and the last pixel."""
    _judge_places(unit_places, edge=0)


@hidden
def check_edges(unit_places: Callable) -> None:
    """Judge the other convention in the same way."""
    _judge_places(unit_places, edge=0.5)

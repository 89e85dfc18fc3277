"""Hidden tests of exercise 06, sampling on planes: scipy's interpolation and its adjoint are the reference.

No PyTorch here: importing it takes longer than a cell of an exercise may.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from semgrid_instructor import hidden


def _weights(four_pixels: Callable, u: float, v: float, h: int, w: int) -> NDArray:
    """Return the weight that an answer gives to each pixel, (h, w)."""
    rows, cols, weights = (np.ravel(part) for part in four_pixels(u, v, h, w))
    assert len(rows) == len(cols) == len(weights) == 4, "not four rows, columns and weights"
    inside = (rows >= 0) & (rows < h) & (cols >= 0) & (cols < w)
    assert inside.all(), "a pixel that doesn't exist (images need not be wider than high)"
    table = np.zeros((h, w))
    np.add.at(table, (rows.astype(int), cols.astype(int)), weights.astype(float))
    return table


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
    rng = np.random.default_rng(61)
    for h, w in ((5, 3), (2, 9), (40, 60)):
        for u, v in rng.uniform(0.01, 0.99, size=(20, 2)) * (w - 1, h - 1):
            right = np.outer(_kernel(v - np.arange(h)), _kernel(u - np.arange(w)))
            assert np.allclose(_weights(four_pixels, float(u), float(v), h, w), right), "wrong weights"


@hidden
def check_border(four_pixels: Callable) -> None:
    """Corners, edges and centres, and a point a hair before the last column."""
    h, w = 6, 4
    for u, v in ((0, 0), (3, 5), (0, 5), (3, 0), (2, 5), (3, 2.25), (1.75, 5), (2, 3), (0, 2.5), (3 - 1e-9, 5)):
        right = np.outer(_kernel(v - np.arange(h)), _kernel(u - np.arange(w)))
        got = _weights(four_pixels, float(u), float(v), h, w)
        assert np.allclose(got, right, atol=1e-6), "wrong weights on a border or a pixel's centre"


def _plane(seed: int, all_visible: bool = False) -> tuple[NDArray, NDArray, NDArray]:
    """Return scores (3, 7, 5), pixels (6, 4, 2) with corners of the image among them, and what is visible."""
    rng = np.random.default_rng(seed)
    scores, pixels = rng.normal(size=(3, 7, 5)), rng.uniform(0, 1, size=(6, 4, 2)) * (4, 6)
    pixels[0, :3] = [[0, 0], [4, 6], [4, 0]]
    visible = np.ones((6, 4), bool) if all_visible else rng.random((6, 4)) < 0.6
    pixels[~visible] = rng.choice([np.nan, -3.2, 1e6, 1.5], size=(np.sum(~visible), 2))
    return scores, pixels, visible


@hidden
def check_sample_plane(sample_plane: Callable) -> None:
    """Random scores of an image that is higher than wide, at all of whose corners somebody reads."""
    scores, pixels, visible = _plane(62, all_visible=True)
    got = np.asarray(sample_plane(scores.copy(), pixels.copy(), visible.copy()))
    assert got.shape == (3, 6, 4), f"shape {got.shape} instead of (3, 6, 4)"
    right = _read(scores, pixels, visible)
    inner = np.ones((6, 4), bool)
    inner[0, :3] = False
    assert np.allclose(got[:, inner], right[:, inner]), "wrong values"
    assert np.allclose(got, right), "points on the last row or column read wrong values"


@hidden
def check_invisible(sample_plane: Callable) -> None:
    """Not visible for every reason: behind the camera (NaN), outside, hidden by something; or nothing visible."""
    scores, pixels, visible = _plane(63)
    got = np.asarray(sample_plane(scores.copy(), pixels.copy(), visible.copy()))
    assert (got[:, ~visible] == 0).all(), "points that aren't visible don't take 0"
    assert np.allclose(got, _read(scores, pixels, visible)), "wrong visible values"
    nothing = np.asarray(sample_plane(scores, np.full_like(pixels, np.nan), np.zeros_like(visible)))
    assert nothing.shape == (3, 6, 4), "the shape is wrong where nothing is visible"
    assert (nothing == 0).all(), "not all 0 where nothing is visible"


@hidden
def check_give_back(give_back: Callable) -> None:
    """Compare random blame with a pixel at a time; test <A s, p_bar> = <s, A^T p_bar>."""
    scores, pixels, visible = _plane(64)
    p_bar = np.random.default_rng(65).normal(size=(3, 6, 4))
    got = np.asarray(give_back(p_bar.copy(), pixels.copy(), visible.copy(), 7, 5))
    assert got.shape == (3, 7, 5), f"shape {got.shape} instead of (3, 7, 5)"
    assert not np.isnan(got).any(), "NaN got in from points that aren't visible"
    read = _read(scores, pixels, visible)
    assert np.isclose((p_bar * read).sum(), (got * scores).sum()), "it isn't the transpose of equation (2)"
    one_pixel = np.eye(35).reshape(35, 7, 5)
    weights = _read(one_pixel, pixels, visible)
    assert np.allclose(got, np.einsum("nrc,krc->kn", weights, p_bar).reshape(3, 7, 5)), "wrong gradient"


@hidden
def check_slopes(slopes: Callable) -> None:
    """Random images and points; then points a thousandth of a pixel away from a centre."""
    rng = np.random.default_rng(66)
    for offset, complaint in ((None, "wrong slopes"), (1e-3, "wrong close to a pixel's centre: does a step cross it?")):
        for _ in range(10):
            s, (n, m) = rng.normal(size=(8, 5)), rng.integers(0, (7, 4))
            across, down = rng.uniform(0.2, 0.8, size=2) if offset is None else (offset, 1 - offset)
            (a, b), (c, d) = s[n : n + 2, m : m + 2]
            right = (1 - down) * (b - a) + down * (d - c), (1 - across) * (c - a) + across * (d - b)
            got = slopes(s.copy(), float(m + across), float(n + down))
            assert np.allclose(got, right, atol=1e-3), complaint


def _judge_places(unit_places: Callable, edge: float) -> None:
    """Compare with a straight line from -1 to 1, whose ends lie `edge` pixels outside the first and last centre."""
    rng = np.random.default_rng(67)
    for h, w in ((4, 9), (7, 2), (96, 320)):
        pixels = rng.uniform(0, 1, size=(2, 3, 5, 2)) * (w - 1, h - 1)
        pixels[0, 0, :2] = [[0, 0], [w - 1, h - 1]]
        got = np.asarray(unit_places(pixels.copy(), (h, w), edge == 0))
        assert got.shape == pixels.shape, "the shape changed (there may be more axes before the last)"
        for axis, size in ((0, w), (1, h)):
            right = np.interp(pixels[..., axis], (-edge, size - 1 + edge), (-1, 1))
            assert np.allclose(got[..., axis], right), "wrong places"


@hidden
def check_centres(unit_places: Callable) -> None:
    """Other images, more axes, the first and the last pixel."""
    _judge_places(unit_places, edge=0)


@hidden
def check_edges(unit_places: Callable) -> None:
    """Judge the other convention in the same way."""
    _judge_places(unit_places, edge=0.5)

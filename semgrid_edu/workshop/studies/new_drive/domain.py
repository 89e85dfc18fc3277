"""The domain gap of images: how far their colours and edges are from the images that a network learned from."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_gradient_magnitude

from semgrid_edu.metrics import total_variation

BINS = 32
"""Number of bins of a histogram of brightness or of gradients."""
STEEPEST = 80.0
"""Gradients above this, grey values per pixel, count as this."""
COLOURS = ("red", "green", "blue")


def image_histograms(image: NDArray) -> dict[str, NDArray[np.float64]]:
    """Return how the colours and the edges of an image are distributed.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB, at the size that the network sees: edges depend on it.

    Returns
    -------
    dict of str to (32,) float64
        Shares of the pixels, which sum to 1: "red", "green", "blue", and "edges", the gradient of the grey image.
    """
    grey = image.mean(axis=2)
    found = {name: np.histogram(image[..., k], BINS, (0, 256))[0] for k, name in enumerate(COLOURS)}
    gradient = np.minimum(gaussian_gradient_magnitude(grey, 1), STEEPEST)
    found["edges"] = np.histogram(gradient, BINS, (0, STEEPEST))[0]
    return {name: counts / grey.size for name, counts in found.items()}


def image_statistics(image: NDArray) -> dict[str, float]:
    """Return four numbers that say what an image looks like.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB, at the size that the network sees.

    Returns
    -------
    dict of str to float
        "brightness", the mean grey value, and "contrast", its standard deviation, 0..255; "saturation", the mean
        difference of the largest and the smallest of R, G and B; "edges", the mean gradient, grey values per pixel.
    """
    grey = image.mean(axis=2)
    return {
        "brightness": float(grey.mean()),
        "contrast": float(grey.std()),
        "saturation": float(np.ptp(image.astype(np.float64), axis=2).mean()),
        "edges": float(gaussian_gradient_magnitude(grey, 1).mean()),
    }


def mean_over(images: Sequence[NDArray], measure: Callable[[NDArray], dict]) -> dict:
    """Return the means over several images of what is measured in each.

    Parameters
    ----------
    images : sequence of (h, w, 3) uint8
        RGB, at the size that the network sees.
    measure : callable
        `image_histograms` or `image_statistics`.
    """
    every = [measure(image) for image in images]
    return {name: np.mean([one[name] for one in every], axis=0) for name in every[0]}


def mean_histograms(images: Sequence[NDArray]) -> dict[str, NDArray[np.float64]]:
    """Return the mean over several images of their `image_histograms`.

    Parameters
    ----------
    images : sequence of (h, w, 3) uint8
        RGB, at the size that the network sees.
    """
    return mean_over(images, image_histograms)


def match_colours(image: NDArray, reference: NDArray) -> NDArray[np.uint8]:
    """Give an image (h, w, 3) the histograms of other images, colour by colour; brighter pixels stay brighter.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    reference : (..., 3) uint8
        Pixels whose histograms are taken.
    """
    matched = np.empty_like(image)
    for k in range(3):
        shares = np.bincount(image[..., k].ravel(), minlength=256).cumsum() / image[..., k].size
        matched[..., k] = np.quantile(reference[..., k], shares, method="inverted_cdf")[image[..., k]]
    return matched


def colour_distance(a: dict[str, NDArray], b: dict[str, NDArray]) -> float:
    """Return the mean over red, green and blue of the total variation of histograms, 0..1.

    Parameters
    ----------
    a, b : dict of str to (32,) float
        From `mean_histograms`.
    """
    return float(np.mean([total_variation(a[name], b[name]) for name in COLOURS]))


def distances(images: Sequence[NDArray], known: Sequence[NDArray]) -> dict[str, float]:
    """Return how far images are from those that a network learned from.

    Parameters
    ----------
    images, known : sequence of (h, w, 3) uint8
        RGB, at the size that the network sees.

    Returns
    -------
    dict of str to float
        "colour distance" and "edge distance": total variation of the mean histograms, 0..1.
    """
    seen, learned = mean_histograms(images), mean_histograms(known)
    edges = float(total_variation(seen["edges"], learned["edges"]))
    return {"colour distance": colour_distance(seen, learned), "edge distance": edges}

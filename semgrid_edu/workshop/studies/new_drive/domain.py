"""How far images are from those that a network learned from, and what a network makes of them without any truth."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_gradient_magnitude
from scipy.special import entr

from semgrid_edu.camera import project, transform_points
from semgrid_edu.frame import Frame
from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.studies.new_drive.drive_checks import LANE
from semgrid_edu.workshop.studies.new_drive.ego_motion import TALL

BINS = 32
"""Number of bins of a histogram of brightness or of gradients."""
STEEPEST = 80.0
"""Gradients above this, grey values per pixel, count as this."""
FLAT_CLASSES = ("road", "sidewalk", "sky")
"""Classes that a return from half a metre above the ground or more can't have."""


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
    gradient = np.minimum(gaussian_gradient_magnitude(grey, 1), STEEPEST)
    values = {name: image[..., k] for k, name in enumerate(("red", "green", "blue"))}
    ranges = dict.fromkeys(values, (0, 256)) | {"edges": (0, STEEPEST)}
    values["edges"] = gradient
    return {name: np.histogram(values[name], BINS, ranges[name])[0] / grey.size for name in values}


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


def mean_histograms(images: Sequence[NDArray]) -> dict[str, NDArray[np.float64]]:
    """Return the mean of the histograms of several images.

    Parameters
    ----------
    images : sequence of (h, w, 3) uint8
        RGB, at the size that the network sees.

    Returns
    -------
    dict of str to (32,) float64
        As `image_histograms`.
    """
    every = [image_histograms(image) for image in images]
    return {name: np.mean([one[name] for one in every], axis=0) for name in every[0]}


def match_colours(image: NDArray, reference: NDArray) -> NDArray[np.uint8]:
    """Give an image the histograms of other images, colour by colour; brighter pixels stay brighter.

    Parameters
    ----------
    image : (h, w, 3) uint8
        RGB.
    reference : (..., 3) uint8
        Pixels whose histograms are taken.

    Returns
    -------
    (h, w, 3) uint8
        RGB.
    """
    matched = np.empty_like(image)
    for k in range(3):
        shares = np.bincount(image[..., k].ravel(), minlength=256).cumsum() / image[..., k].size
        matched[..., k] = np.quantile(reference[..., k], shares, method="inverted_cdf")[image[..., k]]
    return matched


def normalised_entropy(probability: NDArray) -> NDArray[np.float64]:
    """Return the entropy of each distribution, as a share of the largest possible one.

    Parameters
    ----------
    probability : (C, ...) float
        The distribution over the classes at each place.

    Returns
    -------
    (...) float64
        0 where one class is certain, 1 where all are equally probable.
    """
    return entr(probability.astype(np.float64)).sum(axis=0) / np.log(len(probability))


class Agreement(NamedTuple):
    """How often a network's pixels say what the LIDAR knows without any label.

    Parameters
    ----------
    lane : float
        Share of the returns from the ground of the vehicle's own lane whose pixel is called road.
    standing : float
        Share of the returns from things that stand up whose pixel is called something that stands up.
    """

    lane: float
    standing: float


def agrees_with_lidar(frame: Frame, labels: NDArray) -> Agreement:
    """Compare labels of pixels with what the LIDAR knows: what is flat, and what stands up.

    Parameters
    ----------
    frame : Frame
        Its scan and its calibration are used.
    labels : (h, w) int
        A KITTI-14 class for each pixel, in any resolution of the image.

    Returns
    -------
    Agreement
        NaN where there is no return of a kind in the image.
    """
    camera = frame.camera.resized(labels.shape)
    pixels, visible = project(transform_points(camera.T_camera_from_lidar, frame.points[:, :3]), camera)
    x, y, height = frame.points_grid[visible, :3].T
    u, v = np.rint(pixels[visible]).astype(int).T
    said = labels[v, u]
    lane = (np.abs(y) < LANE[2]) & (x < LANE[1]) & (np.abs(height) < 0.3)
    standing = (height > TALL[0]) & (height < TALL[1])
    upright = ~np.isin(said, [KITTI_14.index(name) for name in FLAT_CLASSES])
    return Agreement(_mean(said[lane] == KITTI_14.index("road")), _mean(upright[standing]))


def _mean(values: NDArray) -> float:
    return float(values.mean()) if len(values) else float("nan")

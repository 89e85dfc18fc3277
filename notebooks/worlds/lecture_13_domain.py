"""The domain gap of images: how far they are from a network's training images, and how well it does on them.

The images have no labels. So we measure a network by its confidence, and by its agreement with the LIDAR.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_gradient_magnitude
from scipy.special import entr, softmax

from semgrid_edu.camera import project, transform_points
from semgrid_edu.datasets.samples import sample_frames
from semgrid_edu.frame import Frame, resize_image
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import total_variation
from semgrid_edu.workshop.course.street import STANDING
from worlds.lecture_13_checks import LANE

if TYPE_CHECKING:
    from semgrid_edu.networks import SemanticGridNet

FLAT_CLASSES = ("road", "sidewalk", "sky")
"""Classes that a return from half a metre above the ground or more can't have."""
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
    found["edges"] = np.histogram(gaussian_gradient_magnitude(grey, 1).clip(max=STEEPEST), BINS, (0, STEEPEST))[0]
    return {name: counts / grey.size for name, counts in found.items()}


def image_statistics(image: NDArray) -> dict[str, float]:
    """Return four numbers that describe the look of an image.

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
    """Return how far images are from a network's training images.

    Parameters
    ----------
    images, known : sequence of (h, w, 3) uint8
        RGB, at the size that the network sees.

    Returns
    -------
    dict of str to float
        "colour distance" and "edge distance": total variation of the mean histograms, 0..1.
    """
    seen = mean_histograms(images)
    learned = mean_histograms(known)
    edges = float(total_variation(seen["edges"], learned["edges"]))
    return {"colour distance": colour_distance(seen, learned), "edge distance": edges}


def normalised_entropy(probability: NDArray) -> NDArray[np.float64]:
    """Return the entropy of each distribution as a share of the largest possible one: 1 where all classes are equal.

    Parameters
    ----------
    probability : (C, ...) float
        The distribution over the classes at each place.
    """
    return entr(probability.astype(np.float64)).sum(axis=0) / np.log(len(probability))


class Agreement(NamedTuple):
    """How often a network's pixels agree with what the LIDAR knows without labels.

    Parameters
    ----------
    lane : float
        Share of the returns from the ground of the vehicle's own lane whose pixel is called road.
    standing : float
        Share of the returns from upright things whose pixel is predicted as something upright.
    """

    lane: float
    standing: float


def agrees_with_lidar(frame: Frame, labels: NDArray) -> Agreement:
    """Compare labels of pixels with what the LIDAR knows: what is flat, and what is upright.

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
    called = labels[v, u]
    lane = (np.abs(y) < LANE[2]) & (x < LANE[1]) & (np.abs(height) < 0.3)
    standing = (height > STANDING[0]) & (height < STANDING[1])
    upright = ~np.isin(called, [KITTI_14.index(name) for name in FLAT_CLASSES])
    agreeing = called[lane] == KITTI_14.index("road"), upright[standing]
    return Agreement(*(float(found.mean()) if len(found) else float("nan") for found in agreeing))


def training_images() -> list[NDArray[np.uint8]]:
    """Return the shipped images of the training set, (h, w, 3), at the size that the compact networks see."""
    return [frame.image.permute(1, 2, 0).numpy() for frame in sample_frames()]


def class_probabilities(net: "SemanticGridNet", image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the image network's distribution over the classes in each pixel, (C, h, w).

    Parameters
    ----------
    net : SemanticGridNet
        A trained network.
    image : (h, w, 3) uint8
        RGB, at the size that the network sees.
    """
    # The checks of the exercise import this module, and torch takes them two seconds.
    from semgrid_edu.pipeline import Stages

    unit = np.ascontiguousarray(image.transpose(2, 0, 1), np.float32) / 255
    return softmax(Stages.of(net).segment(unit), axis=0)


def network_numbers(net: "SemanticGridNet", frames: Sequence[Frame], matched: bool = False) -> dict[str, float]:
    """Measure an image network on frames without labels.

    Parameters
    ----------
    net : SemanticGridNet
        A trained network.
    frames : sequence of Frame
        Frames with images.
    matched : bool
        Whether the images get the colours of the training images first, see `match_colours`.

    Returns
    -------
    dict of str to float
        Means over the frames: "confidence", of the most probable class, and "entropy", see `normalised_entropy`, over
        pixels; "lane" and "standing", see `Agreement`.
    """
    size = net.architecture.image_size
    reference = np.stack(training_images())
    found = []
    for frame in frames:
        image = resize_image(frame.need_image(), size)
        p = class_probabilities(net, match_colours(image, reference) if matched else image)
        agreement = agrees_with_lidar(frame, p.argmax(axis=0))
        found.append([p.max(axis=0).mean(), normalised_entropy(p).mean(), *agreement])
    return dict(zip(("confidence", "entropy", "lane", "standing"), np.nanmean(found, axis=0).tolist(), strict=True))

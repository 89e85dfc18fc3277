"""What a network says of images that nobody has labelled: its confidence, and whether the LIDAR agrees."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import entr, softmax

from semgrid_edu.camera import project, transform_points
from semgrid_edu.datasets.samples import sample_frames
from semgrid_edu.datasets.training_arrays import resize_image
from semgrid_edu.frame import Frame
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.pipeline import Stages
from semgrid_edu.workshop.studies.new_drive.domain import match_colours
from semgrid_edu.workshop.studies.new_drive.drive_checks import LANE, TALL

FLAT_CLASSES = ("road", "sidewalk", "sky")
"""Classes that a return from half a metre above the ground or more can't have."""


def normalised_entropy(probability: NDArray) -> NDArray[np.float64]:
    """Return the entropy of each distribution as a share of the largest possible one: 1 where all classes are equal.

    Parameters
    ----------
    probability : (C, ...) float
        The distribution over the classes at each place.
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
    called = labels[v, u]
    lane = (np.abs(y) < LANE[2]) & (x < LANE[1]) & (np.abs(height) < 0.3)
    standing = (height > TALL[0]) & (height < TALL[1])
    upright = ~np.isin(called, [KITTI_14.index(name) for name in FLAT_CLASSES])
    agreeing = called[lane] == KITTI_14.index("road"), upright[standing]
    return Agreement(*(float(found.mean()) if len(found) else float("nan") for found in agreeing))


def training_images() -> list[NDArray[np.uint8]]:
    """Return the shipped images of the training set, (h, w, 3), at the size that the compact networks see."""
    return [frame.image.permute(1, 2, 0).numpy() for frame in sample_frames()]


def class_probabilities(net: SemanticGridNet, image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the image network's distribution over the classes in each pixel, (C, h, w).

    Parameters
    ----------
    net : SemanticGridNet
        A trained network.
    image : (h, w, 3) uint8
        RGB, at the size that the network sees.
    """
    unit = np.ascontiguousarray(image.transpose(2, 0, 1), np.float32) / 255
    return softmax(Stages.of(net).segment(unit), axis=0)


def network_numbers(net: SemanticGridNet, frames: Sequence[Frame], matched: bool = False) -> dict[str, float]:
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
    size, reference, found = net.architecture.image_size, np.stack(training_images()), []
    for frame in frames:
        image = resize_image(frame.need_image(), size)
        p = class_probabilities(net, match_colours(image, reference) if matched else image)
        agreement = agrees_with_lidar(frame, p.argmax(axis=0))
        found.append([p.max(axis=0).mean(), normalised_entropy(p).mean(), *agreement])
    return dict(zip(("confidence", "entropy", "lane", "standing"), np.nanmean(found, axis=0).tolist(), strict=True))

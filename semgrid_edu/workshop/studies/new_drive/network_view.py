"""What a network says of images that nobody has labelled: how sure it is, and whether the LIDAR agrees."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.datasets.samples import sample_frames
from semgrid_edu.datasets.training_arrays import resize_image
from semgrid_edu.frame import Frame
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.pipeline import Stages
from semgrid_edu.workshop.studies.new_drive.domain import agrees_with_lidar, match_colours, normalised_entropy


def training_images() -> list[NDArray[np.uint8]]:
    """Return the shipped images of the training set, (h, w, 3), at the size that the compact networks see."""
    return [frame.image.permute(1, 2, 0).numpy() for frame in sample_frames()]


def class_probabilities(net: SemanticGridNet, image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return what the image network says of each pixel.

    Parameters
    ----------
    net : SemanticGridNet
        A trained network.
    image : (h, w, 3) uint8
        RGB, at the size that the network sees.

    Returns
    -------
    (C, h, w) float32
        Soft-max of the scores.
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
        said = class_probabilities(net, match_colours(image, reference) if matched else image)
        agreement = agrees_with_lidar(frame, said.argmax(axis=0))
        found.append([said.max(axis=0).mean(), normalised_entropy(said).mean(), *agreement])
    means = np.nanmean(found, axis=0)
    return dict(zip(("confidence", "entropy", "lane", "standing"), map(float, means), strict=True))

"""The grids that are compared: a network's own, refined or not, and those of every baseline, by name (section 4)."""

from collections.abc import Callable, Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.grid_truth import unknown_classes
from semgrid_edu.datasets.ground_truth import carry_labels, close_gaps
from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE
from semgrid_edu.networks import SemanticGridNet, unit_image
from semgrid_edu.occupancy import N_STATES, State
from semgrid_edu.pipeline.checks import StageCheck
from semgrid_edu.planes import plane_pixels
from semgrid_edu.workshop.scoring.counting import Grids

Refine = Callable[[NDArray, NDArray], NDArray]
"""A stage (log_g (C, H, W), o (4, H, W)) -> g (C, H, W), as `semgrid_edu.pipeline.Stages` describes it."""

NETWORK = "network"
"""The network's own grid; refined, its name is followed by " + " and the name of the refinement."""

MAJORITY, OCCUPANCY_ALONE = "majority class", "occupancy alone"
"""The most frequent class of each cell, and of each cell and occupancy state."""

NOT_SEEN = -1
"""What `ground_pixels` says of a cell whose ground lies outside the image."""


def network_grids(net: SemanticGridNet, frames: TrainingSet, refinements: Mapping[str, Refine] | None = None) -> Grids:
    """Return the function that makes a network's grids, refined or not, as `count_grids` takes it.

    Parameters
    ----------
    net : SemanticGridNet
        The network, in evaluation mode, for the sizes of the frames.
    frames : TrainingSet
        The frames.
    refinements : mapping of str to callable, optional
        Refinements of the network's grids by name, such as `{"CRF": Stages.of(net).refine}`.

    Returns
    -------
    callable
        k -> the distributions (C, H, W) of frame k: "network", and "network + " with the name of each refinement. It
        raises `StageError` when a refinement raises an error or returns anything but probabilities.

    Raises
    ------
    ArgumentError
        When the network has other classes than the frames.
    """
    if net.n_classes != len(frames.label_set):
        raise ArgumentError("net", f"the {len(frames.label_set)} classes of {frames.label_set.name}", net.n_classes)

    def grids(k: int) -> dict[str, NDArray]:
        sample = frames[k]
        log_g = learned_log_g(net, sample)
        found = {NETWORK: np.exp(log_g)}
        for name, refine in (refinements or {}).items():
            found[f"{NETWORK} + {name}"], _ = StageCheck("refine", refine, k).call(
                log_g.shape, log_g, sample.occupancy.numpy()
            )
        return found

    return grids


@torch.inference_mode()
def learned_log_g(net: SemanticGridNet, sample: Sample) -> NDArray[np.float32]:
    """Return the network's semantic grid of a frame as natural logarithms of probabilities, (C, H, W).

    Parameters
    ----------
    net : SemanticGridNet
        The network, for the sizes of the frame.
    sample : Sample
        The frame.
    """
    return net(unit_image(sample.image)[None], sample.occupancy[None])[0].log_softmax(dim=0).numpy()


@torch.inference_mode()
def best_labels(segmenter: nn.Module, sample: Sample) -> NDArray[np.int64]:
    """Return the class with the highest score at each pixel, (h, w).

    Parameters
    ----------
    segmenter : Module
        An image network, i -> s: (1, 3, h, w) RGB in 0..1 -> (1, C, h, w) scores.
    sample : Sample
        The frame.
    """
    return segmenter(unit_image(sample.image)[None])[0].argmax(dim=0).numpy()


def baseline_grids(
    training: TrainingSet,
    frames: TrainingSet,
    segmenters: Mapping[str, nn.Module],
    camera: Camera | None = None,
    returns: Callable[[int], tuple[NDArray, NDArray]] | None = None,
) -> Grids:
    """Return the function that makes the grids of every baseline, as `count_grids` takes it.

    Parameters
    ----------
    training : TrainingSet
        The frames whose truth the first two baselines learn from.
    frames : TrainingSet
        The frames to score.
    segmenters : mapping of str to Module
        Image networks by name, i -> s. Their labels are carried to the grid as the true image labels are.
    camera : Camera, optional
        The calibration that geometry believes in; that of the frames when left out.
    returns : callable, optional
        k -> pixels and cells of the LIDAR returns of frame k by that calibration; those of the frames when left out.

    Returns
    -------
    callable
        k -> classes (H, W) of frame k: "majority class" of each cell; "occupancy alone", the majority class of each
        cell and state; and what `carried_grids` makes of "true" image labels and of those of each image network.
    """
    truths, returns = training.arrays["truth"], returns or frames.returns
    majority, by_state = majority_class(truths), majority_by_state(truths, training.arrays["occupancy"])
    ground, cell = ground_pixels(frames.spec, camera or frames.camera), frames.spec.cell

    def grids(k: int) -> dict[str, NDArray]:
        sample = frames[k]
        o = sample.occupancy.numpy()
        found = {MAJORITY: majority, OCCUPANCY_ALONE: classes_of_states(by_state, o)}
        if frames.label_set.n_semantic < len(frames.label_set):
            labels = {"true": sample.labels.numpy()}
            labels |= {name: best_labels(segmenter, sample) for name, segmenter in segmenters.items()}
            for name, classes in labels.items():
                found |= carried_grids(f"{name} labels", classes, o, returns(k), ground, cell)
        return found

    return grids


def carried_grids(
    name: str, labels: NDArray, occupancy: NDArray, returns: tuple[NDArray, NDArray], ground: NDArray, cell: float
) -> dict[str, NDArray[np.uint8]]:
    """Carry image labels to the grid in every way that learns nothing. Cells without a label take an unknown class.

    Parameters
    ----------
    name : str
        What the labels are called, such as "true labels".
    labels : (h, w) int
        The class of each pixel; 255 where unlabelled.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    returns : pair of (N,) int
        Pixel and cell of each LIDAR return that the camera sees.
    ground : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    cell : float
        Side of a cell, metres.

    Returns
    -------
    dict of str to (H, W) uint8
        By `carry_labels` ("geometry"), alone and with its gaps closed; by `inverse_perspective` ("flat ground"),
        everywhere and in observed cells only.
    """
    by_depth = carry_labels(labels, *returns, occupancy)
    return {
        f"geometry, {name}": by_depth,
        f"geometry, {name}, gaps closed": close_gaps(by_depth, cell),
        f"flat ground, {name}": inverse_perspective(labels, ground, occupancy),
        f"flat ground, {name}, observed cells": inverse_perspective(labels, ground, occupancy, True),
    }


def majority_class(truths: NDArray) -> NDArray[np.uint8]:
    """Return the most frequent class of each cell, (H, W): what one knows without looking.

    Of equally frequent classes it is the first. A cell that was never labelled takes the most frequent class of all.

    Parameters
    ----------
    truths : (N, H, W) uint8
        Grids of a training set, KITTI-14; 255 where unlabelled.
    """
    counts = np.stack([(truths == c).sum(axis=0) for c in range(len(KITTI_14))])
    overall = counts.sum(axis=(1, 2)).argmax()
    return np.where(counts.any(axis=0), counts.argmax(axis=0), overall).astype(np.uint8)


def majority_by_state(truths: NDArray, occupancy: NDArray) -> NDArray[np.uint8]:
    """Return the most frequent class of each cell for each occupancy state: what occupancy says without an image.

    Parameters
    ----------
    truths : (N, H, W) uint8
        Grids of a training set, KITTI-14; 255 where unlabelled.
    occupancy : (N, 4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each of these grids.

    Returns
    -------
    (4, H, W) uint8
        The majority class of the frames in which this state was the most probable one in this cell; if there was none,
        that of all cells in this state.
    """
    states = np.argmax(occupancy, axis=1)
    return np.stack([majority_class(np.where(states == state, truths, IGNORE)) for state in range(N_STATES)])


def classes_of_states(by_state: NDArray, occupancy: NDArray) -> NDArray[np.uint8]:
    """Look up the class of each cell by its most probable state.

    Parameters
    ----------
    by_state : (4, H, W) uint8
        From `majority_by_state`.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    """
    return np.take_along_axis(by_state, np.argmax(occupancy, axis=0)[None], axis=0)[0]


def ground_pixels(spec: GridSpec, camera: Camera) -> NDArray[np.int64]:
    """Return the pixel that sees the ground at the centre of each cell: equation (1) for plane 0, to the nearest pixel.

    Pixels (H, W) are numbered as row * w + column; -1 where the ground isn't in the image.

    Parameters
    ----------
    spec : GridSpec
        The grid, (H, W) cells.
    camera : Camera
        The camera at the size of the label image, (h, w) pixels.
    """
    (pixels,), (visible,) = plane_pixels(spec, [0.0], camera)
    places = np.full(spec.shape, NOT_SEEN)
    u, v = np.rint(pixels[visible]).astype(np.int64).T
    places[visible] = v * camera.size[1] + u
    return places


def inverse_perspective(
    labels: NDArray, places: NDArray, occupancy: NDArray, observed_only: bool = False
) -> NDArray[np.uint8]:
    """Carry image labels to the grid as if all that the camera sees were flat ground: inverse perspective mapping.

    No depth is used, so whatever stands above the ground is smeared away from the camera, over all cells that it hides.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel, KITTI-14: a network's arg-max, or the truth for an upper bound; 255 where unlabelled.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    observed_only : bool
        Whether cells that are most probably UNKNOWN, such as those behind a car, take no label.

    Returns
    -------
    (H, W) uint8
        The class of its pixel in each cell that the image shows; by occupancy state one of the four unknown classes in
        the others, and where the pixel is unlabelled or sky, which doesn't lie on the ground.

    Raises
    ------
    ArgumentError
        When a pixel lies outside the labels, or the shapes of `places` and `occupancy` disagree.
    """
    labels, unknown = np.asarray(labels), unknown_classes(occupancy)
    if places.shape != unknown.shape:
        raise ArgumentError("places", f"one for each of {unknown.shape} cells", f"shape {places.shape}")
    if places.max() >= labels.size:
        raise ArgumentError("places", f"pixels below {labels.size}", places.max())
    classes = labels.ravel()[places]
    shown = (places != NOT_SEEN) & (classes != IGNORE) & (classes != KITTI_14.index("sky"))
    if observed_only:
        shown &= unknown != UNKNOWN_OF_STATE[State.UNKNOWN]
    return np.where(shown, classes, unknown).astype(np.uint8)

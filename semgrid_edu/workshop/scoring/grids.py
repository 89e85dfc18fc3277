"""The grids to compare, by name: a network's, raw and refined, and the baselines that it must beat (section 4)."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from semgrid_edu.camera import Camera
from semgrid_edu.crf import CrfParams
from semgrid_edu.datasets.ground_truth import carry_labels, close_gaps
from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import mean_field
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.networks import SemanticGridNet, unit_image
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.stages.checks import CheckedStage, distribution
from semgrid_edu.workshop.scoring.confusions import Grids
from semgrid_edu.workshop.scoring.flat_ground import (
    Labeller,
    fitted_tables,
    ground_labels,
    ground_pixels,
    inverse_perspective,
    label_and_state,
)

Refine = Callable[[NDArray, NDArray], NDArray]
"""A stage (log_g (C, H, W), o (4, H, W)) -> g (C, H, W), see `semgrid_edu.pipeline.Stages`."""

NETWORK = "network"
"""Name of the network's grid. A refined grid is called "network + " and the name of the refinement."""

MAJORITY, OCCUPANCY_ALONE = "majority class", "occupancy alone"
"""Names of two baselines: the most frequent class per cell, and per cell and occupancy state."""


def network_grids(net: SemanticGridNet, frames: TrainingSet, refinements: Mapping[str, Refine] | None = None) -> Grids:
    """Return a function that makes a network's grids, raw and refined, for `count_grids`.

    Parameters
    ----------
    net : SemanticGridNet
        The network, in evaluation mode, for the image and grid sizes of the frames.
    frames : TrainingSet
        The frames.
    refinements : mapping of str to callable, optional
        Refinements of the network's grids by name, such as `{"CRF": crf_refinement(0.5)}`.

    Returns
    -------
    callable
        k -> the distributions (C, H, W) of frame k: "network", and "network + " with the name of each refinement. It
        raises `StageError` when a refinement raises an error or its result isn't probabilities.

    Raises
    ------
    ArgumentError
        When network and frames have different classes.
    """
    if net.n_classes != len(frames.label_set):
        raise ArgumentError("net", f"the {len(frames.label_set)} classes of {frames.label_set.name}", net.n_classes)

    def grids(k: int) -> dict[str, NDArray]:
        sample = frames[k]
        log_g = learned_log_g(net, sample)
        found = {NETWORK: np.exp(log_g)}
        for name, refine in (refinements or {}).items():
            checked = CheckedStage("refine", refine, log_g.shape, distribution, first_frame=k)
            found[f"{NETWORK} + {name}"] = checked(log_g, sample.occupancy.numpy())
        return found

    return grids


@torch.inference_mode()
def learned_log_g(net: SemanticGridNet, sample: Sample) -> NDArray[np.float32]:
    """Return the network's semantic grid of a frame as log probabilities, (C, H, W).

    Parameters
    ----------
    net : SemanticGridNet
        The network, for the image and grid size of the frame.
    sample : Sample
        The frame.
    """
    frames = Sample(*(None if part is None else part[None] for part in sample))
    return net(unit_image(frames.image), frames.occupancy, frames.return_heights)[0].log_softmax(dim=0).numpy()


def crf_refinement(cell: float) -> Refine:
    """Return the fast CRF with the parameters of `CrfParams.for_cells`.

    Parameters
    ----------
    cell : float
        Side of a cell, metres.
    """
    params = CrfParams.for_cells(cell)

    def refine(log_g: NDArray, o: NDArray) -> NDArray[np.float32]:
        return mean_field(-log_g, o, params)

    return refine


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
    """Return a function that makes the grids of every baseline, for `count_grids`.

    Parameters
    ----------
    training : TrainingSet
        The frames to fit the baselines to, with the same labels as for networks.
    frames : TrainingSet
        The frames to score.
    segmenters : mapping of str to Module
        Image networks by name, i -> s. Their labels are projected to the grid in the same way as the true image labels.
    camera : Camera, optional
        The calibration for the projection; by default the frames' calibration.
    returns : callable, optional
        k -> pixels and cells of the LIDAR returns of frame k under that calibration; by default `frames.returns`.

    Returns
    -------
    callable
        k -> classes (H, W) of frame k: "majority class" per cell; "occupancy alone", the majority class per cell and
        state; and, for the "true" image labels and the labels of each image network, the grids of `carried_grids` and
        the predictions of `RULES` from flat-ground label and occupancy state.
    """
    truths = training.arrays["truth"]
    returns = returns or frames.returns
    majority = majority_class(truths)
    by_state = majority_by_state(truths, training.arrays["occupancy"])
    networks = {name: partial(best_labels, segmenter) for name, segmenter in segmenters.items()}
    labellers: dict[str, Labeller] = {"true": lambda sample: sample.labels.numpy(), **networks}
    tables = fitted_tables(training, labellers, ground_pixels(training.spec, training.camera))
    ground = ground_pixels(frames.spec, camera or frames.camera)
    n_classes = len(frames.label_set)

    def grids(k: int) -> dict[str, NDArray]:
        sample = frames[k]
        o = sample.occupancy.numpy()
        found = {MAJORITY: majority, OCCUPANCY_ALONE: classes_of_states(by_state, o)}
        for name, labeller in labellers.items():
            labels = labeller(sample)
            if frames.label_set.n_semantic < n_classes:
                found |= carried_grids(f"{name} labels", labels, o, returns(k), ground, frames.spec.cell)
            cells = ground_labels(labels, ground, n_classes), np.argmax(o, axis=0)
            found |= {label_and_state(way, f"{name} labels"): table[cells] for way, table in tables[name].items()}
        return found

    return grids


def carried_grids(
    name: str, labels: NDArray, occupancy: NDArray, returns: tuple[NDArray, NDArray], ground: NDArray, cell: float
) -> dict[str, NDArray[np.uint8]]:
    """Project image labels to the grid with every method that needs no training.

    Cells without a label get an unknown class.

    Parameters
    ----------
    name : str
        Name of the labels, such as "true labels".
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
        From `carry_labels` ("geometry"), raw and with gaps closed; from `inverse_perspective` ("flat ground"), for all
        cells and for observed cells only.
    """
    by_depth = carry_labels(labels, *returns, occupancy)
    return {
        f"geometry, {name}": by_depth,
        f"geometry, {name}, gaps closed": close_gaps(by_depth, cell),
        f"flat ground, {name}": inverse_perspective(labels, ground, occupancy),
        f"flat ground, {name}, observed cells": inverse_perspective(labels, ground, occupancy, True),
    }


def majority_class(truths: NDArray) -> NDArray[np.uint8]:
    """Return the most frequent class of each cell, (H, W): the best guess without any input.

    In a tie, the first class wins. A cell that was never labelled gets the most frequent class overall.

    Parameters
    ----------
    truths : (N, H, W) uint8
        Grids of a training set, KITTI-14; 255 where unlabelled.
    """
    counts = np.stack([(truths == c).sum(axis=0) for c in range(len(KITTI_14))])
    overall = counts.sum(axis=(1, 2)).argmax()
    return np.where(counts.any(axis=0), counts.argmax(axis=0), overall).astype(np.uint8)


def majority_by_state(truths: NDArray, occupancy: NDArray) -> NDArray[np.uint8]:
    """Return the most frequent class of each cell for each occupancy state: the best guess without an image.

    Parameters
    ----------
    truths : (N, H, W) uint8
        Grids of a training set, KITTI-14; 255 where unlabelled.
    occupancy : (N, 4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each of these grids.

    Returns
    -------
    (4, H, W) uint8
        The majority class over the frames in which this cell was most probably in this state. If there was no such
        frame, the majority class over all cells in this state.
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

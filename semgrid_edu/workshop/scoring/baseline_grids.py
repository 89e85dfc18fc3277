"""The grids of every baseline for a frame, by name (section 4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.ground_truth import carry_labels, close_gaps
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.workshop.scoring.learned_grids import Grids
from semgrid_edu.workshop.scoring.single_sources import (
    classes_of_states,
    ground_pixels,
    inverse_perspective,
    majority_by_state,
    majority_class,
)


def baseline_grids(training: TrainingSet) -> Grids:
    """Return the function that makes the baselines' grids for a frame, as `frame_confusions` takes it.

    Parameters
    ----------
    training : TrainingSet
        The frames whose truth the first two learn from.

    Returns
    -------
    callable
        (frames, k) -> grids of frame k: "majority class" of each cell; "occupancy alone", the majority class of each
        cell and state; and what `carried_grids` makes of the true image labels.
    """
    truths = training.arrays["truth"]
    majority, by_state = majority_class(truths), majority_by_state(truths, training.arrays["occupancy"])

    def grids(frames: TrainingSet, k: int) -> dict[str, NDArray]:
        alone = classes_of_states(by_state, frames.arrays["occupancy"][k])
        carried = carried_grids("true", frames.arrays["labels"][k], frames, k)
        return {"majority class": majority, "occupancy alone": alone, **carried}

    return grids


def carried_grids(name: str, labels: NDArray, frames: TrainingSet, k: int) -> dict[str, NDArray[np.uint8]]:
    """Carry image labels to the grid in every way that learns nothing.

    Parameters
    ----------
    name : str
        Where the labels come from, such as "true".
    labels : (h, w) int
        The class of each pixel; 255 where unlabelled.
    frames : TrainingSet
        The frames, for depth, camera and occupancy.
    k : int
        Number of the frame.

    Returns
    -------
    dict of str to (H, W) uint8
        By `carry_labels` ("geometry"), alone and with its gaps closed; by `inverse_perspective`, everywhere and in
        observed cells only. Empty when the label set has no unknown classes, with which these fill cells without a
        label.
    """
    if frames.label_set.n_semantic == len(frames.label_set):
        return {}
    occupancy, places = frames.arrays["occupancy"][k], ground_pixels(frames.spec, frames.camera)
    by_depth = carry_labels(labels, *frames.returns(k), occupancy)
    return {
        f"geometry, {name} labels": by_depth,
        f"geometry, {name} labels, gaps closed": close_gaps(by_depth, frames.spec.cell),
        f"flat ground, {name} labels": inverse_perspective(labels, places, occupancy),
        f"flat ground, {name} labels, observed cells": inverse_perspective(labels, places, occupancy, True),
    }

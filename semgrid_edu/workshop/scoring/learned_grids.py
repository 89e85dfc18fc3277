"""A trained network's grids and image labels as classes, frame by frame (sections 3.1 and 3.4)."""

from collections.abc import Callable, Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import SemanticGridNet, unit_image
from semgrid_edu.pipeline.checks import StageCheck

Refine = Callable[[NDArray, NDArray], NDArray]
"""A stage (log_g (C, H, W), o (4, H, W)) -> g (C, H, W), as `semgrid_edu.pipeline.Stages` describes it."""

Grids = Callable[[TrainingSet, int], Mapping[str, NDArray]]
"""A function (frames, k) -> the grids of frame k, (H, W) classes each, by the name of the method that made them.

Methods that share work, such as a network with and without the CRF, come from one such function."""


def network_grids(net: SemanticGridNet, refinements: Mapping[str, Refine] | None = None) -> Grids:
    """Return the function that makes a network's grids for a frame, refined or not, as `frame_confusions` takes it.

    Parameters
    ----------
    net : SemanticGridNet
        The network, in evaluation mode, for the sizes of the frames.
    refinements : mapping of str to callable, optional
        Refinements of the network's grids by name, such as `{"CRF": Stages.of(net).refine}`.

    Returns
    -------
    callable
        (frames, k) -> the most probable class of each cell, (H, W) int64: under "network", and refined under
        "network + " and the name of the refinement. It raises `ArgumentError` when the network has other classes than
        the frames, and `StageError` when a refinement raises an error or returns anything but probabilities.
    """

    def grids(frames: TrainingSet, k: int) -> dict[str, NDArray]:
        if net.n_classes != len(frames.label_set):
            expected = f"the {len(frames.label_set)} classes of {frames.label_set.name}"
            raise ArgumentError("net", expected, net.n_classes)
        sample = frames[k]
        log_g = learned_log_g(net, sample)
        found = {"network": log_g.argmax(axis=0)}
        for name, refine in (refinements or {}).items():
            refined, _ = StageCheck("refine", refine, k).call(log_g.shape, log_g, sample.occupancy.numpy())
            found[f"network + {name}"] = refined.argmax(axis=0)
        return found

    return grids


@torch.inference_mode()
def learned_log_g(net: SemanticGridNet, sample: Sample) -> NDArray[np.float32]:
    """Return the network's semantic grid of a frame as log-probabilities.

    Parameters
    ----------
    net : SemanticGridNet
        The network, for the sizes of the frame.
    sample : Sample
        A frame of a data set.

    Returns
    -------
    (C, H, W) float32
        log g, natural logarithms.
    """
    return net(unit_image(sample.image)[None], sample.occupancy[None])[0].log_softmax(dim=0).numpy()


@torch.inference_mode()
def best_labels(segmenter: nn.Module, sample: Sample) -> NDArray[np.int64]:
    """Return the class with the highest score at each pixel.

    Parameters
    ----------
    segmenter : Module
        An image network, i -> s: (1, 3, h, w) RGB in 0..1 -> (1, C, h, w) scores.
    sample : Sample
        A frame of a data set.

    Returns
    -------
    (h, w) int64
        Classes.
    """
    return segmenter(unit_image(sample.image)[None])[0].argmax(dim=0).numpy()

"""The trained network against what learns next to nothing, on frames that none has seen (sections 4.2 and 4.3)."""

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, mean_field
from semgrid_edu.datasets.training_cache import SEED
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.experiments.baselines import carry_labels, close_gaps, majority_class
from semgrid_edu.files import sha256
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import (
    class_accuracy,
    confusion_matrix,
    frequency_weighted_iou,
    pixel_accuracy,
    semantic_cells,
)
from semgrid_edu.networks import SemanticGridNet, load_net
from semgrid_edu.provenance import versions

METRICS = {
    "pixel accuracy": pixel_accuracy,
    "class accuracy": class_accuracy,
    "FmIoU": frequency_weighted_iou,
}

Scores = dict[str, dict[str, dict[str, float]]]
"""By method, by cells ("all" or "semantic"), by metric; 0..1."""


def evaluate(dataset_dir: str | Path, weights: str | Path) -> dict[str, object]:
    """Score the network and the baselines on the test split of a data set.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the splits "train" and "test", such as data/minikitti.
    weights : path-like
        A network that learned from the training split.

    Returns
    -------
    dict
        "scores" (see `Scores`), "confusion" (row: truth) and how often each class is true, with all that
        made them: it can be written as JSON.

    Raises
    ------
    ArgumentError
        When the data set lacks a split, or the network is for other grids or images.
    DataError
        When a file is missing or damaged.
    """
    training, test = TrainingSet(dataset_dir, "train"), TrainingSet(dataset_dir, "test")
    net = load_net(weights, test.camera)
    confusions = confusion_matrices(net, test, majority_class(training.arrays["truth"]))
    return {
        "scores": scores(confusions, test.label_set),
        "confusion": {method: confusion.tolist() for method, confusion in confusions.items()},
        "classes": list(test.label_set.names),
        "frames": {"train": len(training), "test": len(test)},
        "weights": {"file": Path(weights).name, "sha256": sha256(weights)},
        "command": f"semgrid-edu evaluate --data {Path(dataset_dir).name} --weights {Path(weights).name}",
        "seed": SEED,
        "versions": versions("numpy", "torch", "numba"),
    }


def confusion_matrices(net: SemanticGridNet, test: TrainingSet, majority: NDArray) -> dict[str, NDArray[np.int64]]:
    """Count what each method makes of every frame.

    Parameters
    ----------
    net : SemanticGridNet
    test : TrainingSet
        The frames.
    majority : (H, W) int
        The majority class of each cell.

    Returns
    -------
    dict of str to (C, C) int64
        By method; row: truth.
    """
    n_classes = len(test.label_set)
    if net.n_classes != n_classes:
        raise ArgumentError("net", f"the {n_classes} classes of {test.label_set.name}", net.n_classes)
    total: dict[str, NDArray[np.int64]] = {}
    for k in tqdm(range(len(test)), desc="evaluate", unit="frame"):
        truth = test.arrays["truth"][k]
        for method, grid in predictions(net, test, k, majority).items():
            total[method] = total.get(method, 0) + confusion_matrix(truth, grid, n_classes)
    return total


@torch.inference_mode()
def predictions(net: SemanticGridNet, test: TrainingSet, k: int, majority: NDArray) -> dict[str, NDArray]:
    """Return the semantic grid of frame k by each method, (H, W) int."""
    sample, returns = test[k], test.returns(k)
    stages = net.stages(sample.image[None] / 255, sample.occupancy[None])
    unary = -stages.logits[0].log_softmax(dim=0).numpy()
    occupancy = sample.occupancy.numpy()
    image_classes = stages.scores[0].argmax(dim=0).numpy()
    predicted = carry_labels(image_classes, *returns, occupancy)
    true = carry_labels(sample.labels.numpy(), *returns, occupancy)
    return {
        "network": unary.argmin(axis=0),
        "network + CRF": mean_field(unary, occupancy, CrfParams()).argmax(axis=0),
        "majority class": majority,
        "geometry, predicted image labels": predicted,
        "predicted labels, gaps closed": close_gaps(predicted, test.spec.cell),
        "geometry, true image labels": true,
        "true labels, gaps closed": close_gaps(true, test.spec.cell),
    }


def scores(confusions: dict[str, NDArray], label_set: LabelSet) -> Scores:
    """Return the three metrics of each method, over all labelled cells and over those with a semantic truth."""
    return {
        method: {
            cells: {name: metric(matrix) for name, metric in METRICS.items()}
            for cells, matrix in (("all", confusion), ("semantic", semantic_cells(confusion, label_set)))
        }
        for method, confusion in confusions.items()
    }


def table(result: Scores) -> str:
    """Return the scores as a table to print, in per cent."""
    width = max(map(len, result))
    group = " ".join(f"{name:>14}" for name in METRICS)
    lines = [f"{'':{width}}  {'all labelled cells':^{len(group)}}   {'cells with a semantic class':^{len(group)}}"]
    lines.append(f"{'':{width}}  {group}   {group}")
    for method, cells in result.items():
        groups = (" ".join(f"{100 * value:14.1f}" for value in cells[name].values()) for name in ("all", "semantic"))
        lines.append(f"{method:{width}}  {'   '.join(groups)}")
    return "\n".join(lines)

"""The trained network against what learns next to nothing, on frames that none has seen (sections 4.2 and 4.3)."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from tqdm.auto import tqdm

from semgrid_edu.crf import CrfParams, mean_field
from semgrid_edu.datasets.training_cache import SEED
from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.experiments.baselines import carry_labels, close_gaps, majority_class
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS, confusion_matrix, semantic_cells
from semgrid_edu.networks import IMAGE_STAGE, SemanticGridNet, load_net
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import versions

Scores = dict[str, dict[str, dict[str, float]]]
"""By method, by cells ("all" or "semantic"), by metric; 0..1."""


def evaluate(dataset_dir: str | Path, weights: str | Path) -> dict[str, object]:
    """Score the network and the baselines on the test split of a data set.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the splits "train" and "test", such as data/minikitti.
    weights : path-like
        A network that learned from the training split. Where `image_stage.safetensors` lies beside it, its image
        labels are carried to the grid as well: those that learned from images alone, not yet from grids.

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
    segmenters = {"end-to-end": net.segmenter}
    image_stage = Path(weights).with_name(IMAGE_STAGE)
    if image_stage.exists():
        segmenters["image-stage"] = load_net(image_stage, test.camera).segmenter
    confusions = confusion_matrices(net, segmenters, test, majority_class(training.arrays["truth"]))
    return {
        "scores": scores(confusions, test.label_set),
        "confusion": {method: confusion.tolist() for method, confusion in confusions.items()},
        "classes": list(test.label_set.names),
        "frames": {"train": len(training), "test": len(test)},
        "weights": {"file": Path(weights).name, "sha256": sha256(weights)},
        "command": f"semgrid-edu evaluate --data {Path(dataset_dir).name} --weights {Path(weights).name}",
        "seed": SEED,
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "versions": versions("numpy", "torch", "numba"),
    }


def confusion_matrices(
    net: SemanticGridNet, segmenters: dict[str, nn.Module], test: TrainingSet, majority: NDArray
) -> dict[str, NDArray[np.int64]]:
    """Count what each method makes of every frame.

    Parameters
    ----------
    net : SemanticGridNet
    segmenters : dict of str to Module
        Image networks by name, whose labels geometry carries to the grid.
    test : TrainingSet
        The frames.
    majority : (H, W) int
        The majority class of each cell.

    Returns
    -------
    dict of str to (C, C) int64
        By method; row: truth.

    Raises
    ------
    ArgumentError
        When the network has other classes than the test set.
    """
    n_classes = len(test.label_set)
    if net.n_classes != n_classes:
        raise ArgumentError("net", f"the {n_classes} classes of {test.label_set.name}", net.n_classes)
    total: dict[str, NDArray[np.int64]] = {}
    for k in tqdm(range(len(test)), desc="evaluate", unit="frame"):
        truth, sample = test.arrays["truth"][k], test[k]
        grids = {"majority class": majority, **learned_grids(net, sample)}
        labels = {name: image_labels(segmenter, sample) for name, segmenter in segmenters.items()}
        for name, label_image in (labels | {"true": sample.labels.numpy()}).items():
            carried = carry_labels(label_image, *test.returns(k), sample.occupancy.numpy())
            grids[f"geometry, {name} labels"] = carried
            grids[f"geometry, {name} labels, gaps closed"] = close_gaps(carried, test.spec.cell)
        for method, grid in grids.items():
            total[method] = total.get(method, 0) + confusion_matrix(truth, grid, n_classes)
    return total


def learned_grids(net: SemanticGridNet, sample: Sample) -> dict[str, NDArray]:
    """Return the arg-max of the network's grid and of the refined one, (H, W) int."""
    unary = learned_unary(net, sample)
    refined = mean_field(unary, sample.occupancy.numpy(), CrfParams.for_cells(net.architecture.grid.cell))
    return {"network": unary.argmin(axis=0), "network + CRF": refined.argmax(axis=0)}


@torch.inference_mode()
def learned_unary(net: SemanticGridNet, sample: Sample) -> NDArray[np.float32]:
    """Return phi_u of equation (3) from the network: -log g, (C, H, W)."""
    return -net(sample.image[None] / 255, sample.occupancy[None])[0].log_softmax(dim=0).numpy()


@torch.inference_mode()
def image_labels(segmenter: nn.Module, sample: Sample) -> NDArray[np.int64]:
    """Return the arg-max of an image network's scores, (h, w)."""
    return segmenter(sample.image[None] / 255)[0].argmax(dim=0).numpy()


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

"""The trained network compared with simple baselines, on frames kept for testing (sections 4.2 and 4.3)."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from tqdm.auto import tqdm

from semgrid_edu.datasets.ground_truth import carry_labels, close_gaps
from semgrid_edu.datasets.training_cache import SEED
from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.experiments.baselines import majority_class
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS, confusion_matrix, semantic_cells
from semgrid_edu.networks import IMAGE_STAGE, SemanticGridNet, load_net, unit_image
from semgrid_edu.pipeline import Stages
from semgrid_edu.pipeline.seams import Seam
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import versions

Scores = dict[str, dict[str, dict[str, float]]]
"""Values of the metrics, 0..1: by method, by cells ("all" or "semantic"), by metric."""


Refine = Callable[[NDArray, NDArray], NDArray]
"""A stage (log_g (C, H, W), o (4, H, W)) -> g (C, H, W), as `semgrid_edu.pipeline.Stages` describes it."""


def evaluate(dataset_dir: str | Path, weights: str | Path, refine: Refine | None = None) -> dict[str, object]:
    """Score the network and the baselines on the test split of a data set.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the splits "train" and "test", such as data/minikitti.
    weights : path-like
        A network that learned from the training split. If `image_stage.safetensors`, the network after the first stage
        of training, lies in the same folder, its image labels are carried to the grid as well: that network has
        learned from images alone, not yet from grids.
    refine : callable, optional
        Refines the network's grids, as in `Stages`, and is named in the row "network + ..."; the CRF when left out.

    Returns
    -------
    dict
        "scores" (see `Scores`), "confusion" (a matrix for each method, one row per true class), and what they were
        computed from; it can be written as JSON.

    Raises
    ------
    ArgumentError
        When the data set lacks a split, or the network is for other grids or images.
    DataError
        When a file is missing or damaged.
    StageError
        When `refine` raises an error, or returns anything but probabilities.
    """
    training, test = TrainingSet(dataset_dir, "train"), TrainingSet(dataset_dir, "test")
    net = load_net(weights, test.camera)
    segmenters = {"end-to-end": net.segmenter}
    image_stage = Path(weights).with_name(IMAGE_STAGE)
    if image_stage.exists():
        segmenters["image-stage"] = load_net(image_stage, test.camera).segmenter
    confusions = confusion_matrices(net, segmenters, test, majority_class(training.arrays["truth"]), refine)
    return {
        "scores": scores(confusions, test.label_set),
        "confusion": {method: confusion.tolist() for method, confusion in confusions.items()},
        "classes": list(test.label_set.names),
        "frames": {"train": len(training), "test": len(test)},
        "weights": {"file": Path(weights).name, "sha256": sha256(weights)},
        "command": _command(Path(dataset_dir).name, Path(weights).name, refine),
        "seed": SEED,
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "versions": versions("numpy", "torch", "numba"),
    }


def _command(data: str, weights: str, refine: Refine | None) -> str:
    if refine is None:
        return f"semgrid-edu evaluate --data {data} --weights {weights}"
    return f'evaluate("{data}", "{weights}", refine={_name(refine)})'


def confusion_matrices(
    net: SemanticGridNet,
    segmenters: dict[str, nn.Module],
    test: TrainingSet,
    majority: NDArray,
    refine: Refine | None = None,
) -> dict[str, NDArray[np.int64]]:
    """Compare the grids of each method with the truth of every frame.

    Parameters
    ----------
    net : SemanticGridNet
        The network, for the grid and the images of the test set.
    segmenters : dict of str to Module
        Image networks by name, i -> s. Geometry carries their labels from the image to the grid.
    test : TrainingSet
        The frames, with truth.
    majority : (H, W) int
        The majority class of each cell.
    refine : callable, optional
        Refines the network's grids, as in `evaluate`.

    Returns
    -------
    dict of str to (C, C) int64
        Number of cells by method: one row per true class, one column per class that the method gives.

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
        grids = {"majority class": majority, **learned_grids(net, sample, refine, k)}
        labels = {name: best_labels(segmenter, sample) for name, segmenter in segmenters.items()}
        for name, label_image in (labels | {"true": sample.labels.numpy()}).items():
            carried = carry_labels(label_image, *test.returns(k), sample.occupancy.numpy())
            grids[f"geometry, {name} labels"] = carried
            grids[f"geometry, {name} labels, gaps closed"] = close_gaps(carried, test.spec.cell)
        for method, grid in grids.items():
            total[method] = total.get(method, 0) + confusion_matrix(truth, grid, n_classes)
    return total


def learned_grids(
    net: SemanticGridNet, sample: Sample, refine: Refine | None = None, number: int = 0
) -> dict[str, NDArray[np.int64]]:
    """Return the most probable class of each cell, before and after refinement.

    Parameters
    ----------
    net : SemanticGridNet
        The network, for the sizes of the frame.
    sample : Sample
        A frame of a data set.
    refine : callable, optional
        Refines the network's grids, as in `evaluate`.
    number : int
        Number of the frame, for error messages.

    Returns
    -------
    dict of str to (H, W) int64
        The classes under "network", and the refined ones under "network + " and the name of the refinement.

    Raises
    ------
    StageError
        When `refine` raises an error, or returns anything but probabilities.
    """
    log_g = learned_log_g(net, sample)
    seam = Seam("refine", refine or Stages.of(net).refine, number)
    refined, _ = seam.call(log_g.shape, log_g, sample.occupancy.numpy())
    return {"network": log_g.argmax(axis=0), f"network + {_name(refine)}": refined.argmax(axis=0)}


def _name(refine: Refine | None) -> str:
    return "CRF" if refine is None else getattr(refine, "__name__", type(refine).__name__)


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


def scores(confusions: dict[str, NDArray], label_set: LabelSet) -> Scores:
    """Return the three metrics of each method, over all labelled cells and over those with a semantic class.

    Parameters
    ----------
    confusions : dict of str to (C, C) int
        Confusion matrix of each method, from `confusion_matrices`.
    label_set : LabelSet
        The classes, of which it says which are semantic.

    Returns
    -------
    Scores
        Values from 0 to 1.
    """
    return {
        method: {
            cells: {name: metric(matrix) for name, metric in METRICS.items()}
            for cells, matrix in (("all", confusion), ("semantic", semantic_cells(confusion, label_set)))
        }
        for method, confusion in confusions.items()
    }


def scores_table(result: Scores) -> str:
    """Return the scores as a table to print, in per cent.

    Parameters
    ----------
    result : Scores
        What `scores` returns.

    Returns
    -------
    str
        One line per method under two lines of headings.
    """
    width = max(map(len, result))
    group = " ".join(f"{name:>14}" for name in METRICS)
    lines = [f"{'':{width}}  {'all labelled cells':^{len(group)}}   {'cells with a semantic class':^{len(group)}}"]
    lines.append(f"{'':{width}}  {group}   {group}")
    for method, cells in result.items():
        groups = (" ".join(f"{100 * value:14.1f}" for value in cells[name].values()) for name in ("all", "semantic"))
        lines.append(f"{method:{width}}  {'   '.join(groups)}")
    return "\n".join(lines)

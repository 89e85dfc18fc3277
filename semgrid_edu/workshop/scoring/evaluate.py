"""Compare the trained network with simple baselines on held-out frames (sections 4.2 and 4.3)."""

from collections.abc import Mapping
from pathlib import Path

from numpy.typing import NDArray
from torch import nn

from semgrid_edu.datasets.index import load_index
from semgrid_edu.datasets.training_arrays import SEED
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet, load_net
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS
from semgrid_edu.networks import IMAGE_STAGE, SemanticGridNet
from semgrid_edu.networks.weights import read_architecture
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.workshop.scoring.confusions import (
    FrameConfusions,
    GridCounts,
    count_grids,
    save_confusions,
    truths_of_frames,
)
from semgrid_edu.workshop.scoring.grids import Refine, baseline_grids, crf_refinement, network_grids
from semgrid_edu.workshop.scoring.score_with_interval import every_metric, markdown_table, score_with_interval, shown
from semgrid_edu.workshop.scoring.statistics import Metric

Scores = dict[str, dict[str, dict[str, float]]]
"""Scores, 0..1, by method, cells ("all" or "semantic") and metric."""

Intervals = dict[str, dict[str, dict[str, list[float | None]]]]
"""Like `Scores`, with [low, value, high] of a 95 % interval instead of the value."""


def evaluate(
    dataset_dir: str | Path,
    weights: str | Path,
    refine: Refine | None = None,
    confusions_file: str | Path | None = None,
) -> dict[str, object]:
    """Score the network and the baselines on the test split of a data set.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the splits "train" and "test", such as data/minikitti.
    weights : path-like
        A network trained on the training split. If its folder contains `image_stage.safetensors`, the network after the
        first training stage, the image labels of that network are projected to the grid as another baseline: it has
        learned from images only, not yet from grids.
    refine : callable, optional
        Refines the network's grids, as in `Stages`, and gives the row "network + ..." its name; by default the CRF.
    confusions_file : path-like, optional
        Output file for the confusion matrices per frame, method, truth and distance, see `save_confusions`.

    Returns
    -------
    dict
        The result of `scores_of_counts` and its inputs, JSON-serialisable.

    Raises
    ------
    ArgumentError
        When the data set lacks a split, or the image network beside it takes images of another size.
    DataError
        When a file is missing or damaged.
    StageError
        When `refine` raises an error, or its result isn't probabilities.
    """
    described = read_architecture(weights)
    size = described.image_size
    image_stage = Path(weights).with_name(IMAGE_STAGE)
    if image_stage.exists() and (found := read_architecture(image_stage).image_size) != size:
        raise ArgumentError(IMAGE_STAGE, f"image size {size}, as {Path(weights).name}", found)
    index = load_index(dataset_dir)
    (drive, _), *_ = index.drives("test")
    if described.label_set != index.label_set.name:  # what can't be scored is found before the data are prepared
        raise DataError(weights, f"a network for {index.label_set.name}", f"one for {described.label_set}")
    net = load_net(weights, drive.camera.resized(size))
    training, test = (TrainingSet(dataset_dir, split, described.grid, size) for split in ("train", "test"))
    segmenters = {"end-to-end": net.segmenter}
    if image_stage.exists():
        segmenters["image-stage"] = load_net(image_stage, test.camera).segmenter
    counted = count_methods(net, training, test, segmenters, refine)
    if confusions_file:
        save_confusions(confusions_file, counted.confusions)
    return scores_of_counts(counted, test) | {
        "frames": {"train": len(training), "test": len(test)},
        "weights": {"file": Path(weights).name, "sha256": sha256(weights)},
        "seed": SEED,
        **made_by(_command(Path(dataset_dir).name, Path(weights).name, refine), "numpy", "torch", "numba"),
    }


def _command(data: str, weights: str, refine: Refine | None) -> str:
    """Return the shell command, or the Python call if the refinement has no command-line option."""
    if refine is None:
        return f"semgrid-edu evaluate --data {data} --weights {weights}"
    return f'evaluate("{data}", "{weights}", refine={_name(refine)})'


def _name(refine: Refine | None) -> str:
    return "CRF" if refine is None else getattr(refine, "__name__", type(refine).__name__)


def count_methods(
    net: SemanticGridNet,
    training: TrainingSet,
    test: TrainingSet,
    segmenters: Mapping[str, nn.Module],
    refine: Refine | None = None,
) -> GridCounts:
    """Count the confusions of a network, raw and refined, and of the baselines.

    Parameters
    ----------
    net : SemanticGridNet
        The network, for the grid and image sizes of the frames.
    training, test : TrainingSet
        The frames to fit the baselines to, and the frames to score.
    segmenters : mapping of str to Module
        Image networks by name, i -> s. Their labels are projected to the grid, see `carried_grids`.
    refine : callable, optional
        Refines the network's grids, as in `evaluate`.
    """
    learned = network_grids(net, test, {_name(refine): refine or crf_refinement(test.spec.cell)})
    baselines = baseline_grids(training, test, segmenters)
    return count_grids(lambda k: learned(k) | baselines(k), test)


def scores_of_counts(counted: GridCounts, test: TrainingSet) -> dict[str, object]:
    """Return the scores of every method against the training labels.

    Parameters
    ----------
    counted : GridCounts
        From `count_methods`.
    test : TrainingSet
        The frames that were scored.

    Returns
    -------
    dict
        "scores" (see `Scores`), "intervals" (see `Intervals`; None with fewer than `MIN_DRIVES` test drives),
        "confusion" (one matrix per method, one row per true class), and the "classes".
    """
    truth, *_ = truths_of_frames(test)
    counts = {method: counted.confusions.of(method, truth).counts[method] for method in counted.methods}
    found = FrameConfusions(test.drives, counts)
    confusions = {method: found.total(method) for method in counts}
    return {
        "scores": scores(confusions, test.label_set),
        "intervals": intervals(found, test.label_set) if len(set(test.drives)) > 1 else None,
        "confusion": {method: confusion.tolist() for method, confusion in confusions.items()},
        "classes": list(test.label_set.names),
    }


def intervals(confusions: FrameConfusions, label_set: LabelSet) -> Intervals:
    """Return confidence intervals of all scores, each for this one network or baseline on new drives.

    Parameters
    ----------
    confusions : FrameConfusions
        Confusion matrices by method, for the frames of two or more drives.
    label_set : LabelSet
        The classes, and which of them are semantic.
    """

    def ends(by_drive: NDArray, metric: Metric) -> list[float | None]:
        value = score_with_interval(by_drive, metric)
        return [value["low"], value["mean"], value["high"]]

    return {method: every_metric(ends, label_set, confusions.by_drive(method)[None]) for method in confusions.counts}


def scores(confusions: dict[str, NDArray], label_set: LabelSet) -> Scores:
    """Return the three metrics of each method, over all labelled cells and over cells with a semantic class.

    Parameters
    ----------
    confusions : dict of str to (C, C) int
        Confusion matrix of each method.
    label_set : LabelSet
        The classes, and which of them are semantic.
    """
    return {
        method: every_metric(lambda matrix, metric: metric(matrix), label_set, confusion)
        for method, confusion in confusions.items()
    }


def scores_table(result: Scores, ends: Intervals | None = None) -> str:
    """Return the scores as a Markdown table, in per cent: one row per method.

    Parameters
    ----------
    result : Scores
        From `scores`.
    ends : Intervals, optional
        From `intervals` for the same methods, shown in brackets; by default no intervals.
    """
    head = [f"{name}{cells}" for cells in ("", ", semantic cells") for name in METRICS]
    places = [(cells, name) for cells in ("all", "semantic") for name in METRICS]

    def text(method: str, cells: str, name: str) -> str:
        low, _, high = ends[method][cells][name] if ends else [None] * 3
        return shown({"mean": result[method][cells][name], "low": low, "high": high, "seeds": []})

    rows = [[method, *(text(method, *place) for place in places)] for method in result]
    return markdown_table([["", *head], *rows])

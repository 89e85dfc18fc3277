"""End-to-end training against training in two stages, in which the image network is frozen (paper, section 4.1)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm.auto import tqdm

from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.metrics import METRICS, confusion_matrix
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, SemanticGridNet, load_net
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import made_by
from semgrid_edu.training import TrainingParams
from semgrid_edu.training.run import train_network
from semgrid_edu.workshop.scoring.evaluate import Scores, scores
from semgrid_edu.workshop.scoring.grids import best_labels, learned_log_g
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table

METHODS = ("end-to-end", "two-stage")
"""The two training regimes."""


def compare_training(
    dataset_dir: str | Path, runs: str | Path, n_seeds: int = 3, params: TrainingParams | None = None
) -> dict[str, object]:
    """Train in both regimes, seed by seed, and score the networks on frames that none of them has seen.

    With the same seed, both networks have the same image network after the first stage, bit for bit, and then see the
    same batches. In two stages the image network then stays as it is. End to end, the loss on the grid trains it
    further.

    Parameters
    ----------
    dataset_dir : path-like
        A data set with the splits "train" and "test", such as data/minikitti.
    runs : path-like
        Takes one folder per training run, such as "end-to-end-0". A run that has ended isn't repeated, and one that was
        interrupted is resumed.
    n_seeds : int
        Number of seeds, 0, 1, ..., for the initial weights and for the order of the frames.
    params : TrainingParams, optional
        How to train; the defaults when left out.

    Returns
    -------
    dict
        "scores": for each of `METHODS` a list of `Scores`, one per seed, of the "grid" and of the "image" labels; and
        all that made them. JSON can hold it.
    """
    params, test = params or TrainingParams(), TrainingSet(dataset_dir, "test")
    trained = {(seed, method): Path(runs) / f"{method}-{seed}" for seed in range(n_seeds) for method in METHODS}
    for (seed, method), folder in trained.items():
        if not (folder / WEIGHTS).exists():
            chosen = replace(params, end_to_end=method == "end-to-end")
            train_network(dataset_dir, folder, "segnet", chosen, seed, resume=True)
    scored: dict[str, list[Scores]] = {method: [] for method in METHODS}
    for (_, method), folder in trained.items():
        scored[method].append(score_grid_and_image(load_net(folder / WEIGHTS, test.camera), test))
    return {
        "scores": scored,
        "frames": len(test),
        "weights": {folder.name: sha256(folder / WEIGHTS) for folder in trained.values()},
        "image stages": {folder.name: sha256(folder / IMAGE_STAGE) for folder in trained.values()},
        "iterations": [params.image_iterations, params.grid_iterations],
        **made_by(
            f"semgrid-edu reproduce two-stage --data {Path(dataset_dir).name} --seeds {n_seeds}", "numpy", "torch"
        ),
    }


def score_grid_and_image(net: SemanticGridNet, test: TrainingSet) -> Scores:
    """Score a network's grids, and the labels that its image network gives to pixels.

    Parameters
    ----------
    net : SemanticGridNet
        The network, in evaluation mode.
    test : TrainingSet
        The frames to score it on.

    Returns
    -------
    Scores
        Scores of "grid" and of "image". An image has no unknown classes, so its "all" and "semantic" are the same.
    """
    confusions = {"grid": 0, "image": 0}
    for sample in tqdm((test[k] for k in range(len(test))), desc="score", total=len(test), unit="frame"):
        called = learned_log_g(net, sample).argmax(axis=0), best_labels(net.segmenter, sample)
        for name, truth, classes in zip(confusions, (sample.truth, sample.labels), called, strict=True):
            confusions[name] += confusion_matrix(truth.numpy(), classes, net.n_classes)
    return scores(confusions, test.label_set)


def two_stage_table(result: dict[str, list[Scores]]) -> str:
    """Return mean and range over the seeds, per cent, as a Markdown table.

    Parameters
    ----------
    result : dict of str to list of Scores
        The "scores" of a result of `compare_training`.
    """
    rows = [["", "cells", *METRICS]]
    for method, runs in result.items():
        for what, part, cells in (("all", "grid", "all"), ("semantic", "grid", "semantic"), ("pixels", "image", "all")):
            values = [[100 * run[part][cells][name] for run in runs] for name in METRICS]
            rows.append([method, what, *(f"{np.mean(v):.1f} ({min(v):.1f}-{max(v):.1f})" for v in values)])
    return markdown_table(rows)

"""What training costs on truth that is made in other ways: SegNet on the same seeds and test frames (section 4)."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from numpy.typing import NDArray

from semgrid_edu.datasets.named_truths import POLICIES
from semgrid_edu.experiments.measured import Measured, all_metrics, compared, measured, on_cells
from semgrid_edu.experiments.reproduction.accuracy_tables import TRUTHS, comparison
from semgrid_edu.experiments.reproduction.counting import CountingRun, by_seed, distance_band_names
from semgrid_edu.experiments.reproduction.label_runs import LABELS, LabelsRun
from semgrid_edu.experiments.reproduction.runs import Run
from semgrid_edu.experiments.reproduction.scales import Scale
from semgrid_edu.experiments.reproduction.score_runs import NETWORK, ScoreRun
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import class_iou, pixel_accuracy

USUAL_TRUTH = "lidar"
"""What all others are compared with: the paper's way, which Table 1's networks learn from."""


def truths_of(scale: Scale) -> tuple[str, ...]:
    """Return what networks learn from: the usual labels first, then the true ones, then those of other policies.

    Parameters
    ----------
    scale : Scale
        How large the experiment is.
    """
    return (USUAL_TRUTH, "true", *scale.policies)


def taught_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of the networks, all scored on the same frames.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.

    Returns
    -------
    dict of str to list of ScoreRun
        By what they learn from, one per seed. Those of the usual labels are SegNet's of Table 1.
    """
    usual = [scale.scored(scale.kitti, "segnet", seed) for seed in range(seeds)]
    others = {
        truth: [
            ScoreRun(scale.grid_stage(scale.kitti, "segnet", seed, truth), usual[0].frames, crf=False)
            for seed in range(seeds)
        ]
        for truth in truths_of(scale)[1:]
    }
    return {USUAL_TRUTH: usual} | others


def label_runs(scale: Scale) -> dict[str, LabelsRun]:
    """Return the runs that count the labels of the training frames.

    Parameters
    ----------
    scale : Scale
        How large they are.

    Returns
    -------
    dict of str to LabelsRun
        By what the labels are, as `taught_runs` has it.
    """
    usual, *others = (scale.arrays(scale.kitti, "train", truth) for truth in truths_of(scale))
    return {arrays.truth: LabelsRun(arrays, usual) for arrays in (usual, *others)}


def truth_cost_runs(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs. Parameters are those of `taught_runs`.

    Returns
    -------
    list of Run
        Those of the first seed first.
    """
    by_truth = taught_runs(scale, seeds).values()
    return [*label_runs(scale).values(), *(run for alike in zip(*by_truth, strict=True) for run in alike)]


def truth_costs(scale: Scale, seeds: int, root: Path) -> dict:
    """Return what training on each kind of labels costs, from runs that have ended.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.
    root : Path
        The folder of all runs.

    Returns
    -------
    dict
        "rows", one for each kind of labels: its name ("truth"), its "policy"; for the training frames the share of
        cells whose label is "changed" from the usual one, and how right the "labels" are; the networks' "scores" on the
        test frames and their "differences" from the usual networks; and for cells with a true semantic class, by class
        the intersection over union ("classes") and by distance the share that is right ("distances").
    """
    runs, labels = taught_runs(scale, seeds), label_runs(scale)
    return {"rows": [_row(truth, runs, labels[truth], root) for truth in runs]}


def _row(truth: str, runs: dict[str, list[ScoreRun]], labels: LabelsRun, root: Path) -> dict:
    """Return the row of one kind of labels."""
    networks, usual = runs[truth], runs[USUAL_TRUTH]
    like_usual = labels.confusions(root, LABELS, "lidar").total(LABELS)
    return {
        "truth": truth,
        "policy": asdict(POLICIES[truth]) if truth in POLICIES else None,
        "changed": 1 - pixel_accuracy(like_usual),
        "labels": all_metrics(by_seed([labels], root, LABELS, "true"), KITTI_14),
        "scores": {against: all_metrics(by_seed(networks, root, NETWORK, against), KITTI_14) for against in TRUTHS},
        "differences": comparison(truth, networks, usual, root, KITTI_14)["scores"],
        "classes": {
            name: _part([labels], networks, usual, root, lambda matrix, c=c: class_iou(matrix)[c])
            for c, name in enumerate(KITTI_14.names[: KITTI_14.n_semantic])
        },
        "distances": {
            band: _part([labels], networks, usual, root, pixel_accuracy, band) for band in distance_band_names()
        },
    }


def _part(
    labels: Sequence[CountingRun],
    networks: Sequence[CountingRun],
    usual: Sequence[CountingRun],
    root: Path,
    metric: Callable[[NDArray], float],
    band: str | None = None,
) -> dict[str, Measured]:
    """Return one score of labels and networks, over cells with a true semantic class."""
    of_labels, ours, theirs = (
        on_cells(by_seed(runs, root, method, "true", band), "semantic", KITTI_14)
        for runs, method in ((labels, LABELS), (networks, NETWORK), (usual, NETWORK))
    )
    return {
        "labels": measured(of_labels, metric),
        "networks": measured(ours, metric),
        "difference": compared(ours, theirs, metric),
    }

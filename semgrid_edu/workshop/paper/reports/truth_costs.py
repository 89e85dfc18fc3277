"""What training costs on truth that is made in other ways: SegNet on the same seeds and test frames (section 4).

What training on truth costs, as Markdown and as a picture (section 4).
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu.datasets.label_policies import POLICIES
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS, class_iou, pixel_accuracy
from semgrid_edu.workshop.paper.reports.accuracy_tables import TRUTHS, comparison
from semgrid_edu.workshop.paper.reports.forest import forest_plot
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.score_runs import LABELS, NETWORK, CountingRun, LabelsRun, ScoreRun, by_seed
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.scoring.confusions import distance_band_names
from semgrid_edu.workshop.scoring.score_with_interval import (
    ScoreWithInterval,
    all_metrics,
    compared,
    markdown_table,
    on_cells,
    per_cent,
    score_with_interval,
    shown,
)

LEARNED_FROM = {
    "lidar": "one scan (usual)",
    "true": "true labels",
    "no-cleanup": "one scan, no clean-up",
    "camera-mask": "one scan, visible to camera",
    "de-skewed": "one scan, de-skewed",
    "accumulated-smeared": "ten scans, movers smeared",
    "accumulated-carved": "ten scans, movers carved",
    "accumulated-carried": "ten scans, movers carried",
}
"""What the networks learn from, in words."""

PARTS = {
    "classes": "By class: intersection over union with the true labels, cells with a true semantic class",
    "distances": "By distance: share of the cells with a true semantic class that is right",
}
"""What is told class by class, and band by band."""


_MARKERS = "oXsD*v^<"


def truth_costs_markdown(result: dict) -> str:
    """Return what training on each kind of labels costs as Markdown.

    Parameters
    ----------
    result : dict
        From `truth_costs`.

    Returns
    -------
    str
    """
    rows = result["rows"]
    parts = [
        "SegNet, the same image stages, seeds and test frames; only the labels of the grids differ that it learns "
        f"from.\n\n## The labels, on the training frames, against the true ones\n\n{_labels(rows)}"
    ]
    for against, words in TRUTHS.items():
        for cells, which in (("all", "all cells"), ("semantic", "cells with a semantic class")):
            parts.append(
                f"## The networks, on the test frames, against {words}, {which}\n\n{_networks(rows, against, cells)}"
            )
    parts += [
        f"## {words}; differences of the networks in points\n\n{_parts(rows, part)}" for part, words in PARTS.items()
    ]
    return "\n\n".join(parts)


def _labels(rows: list[dict]) -> str:
    """Lay out how right the labels are."""
    lines = [["labels", "other than usual", "right, all cells", "right, cells with a semantic class"]]
    for row in rows:
        right = (shown(row["labels"][cells]["pixel accuracy"]) for cells in ("all", "semantic"))
        lines.append([LEARNED_FROM[row["truth"]], per_cent(row["changed"]), *right])
    return markdown_table(lines)


def _networks(rows: list[dict], against: str, cells: str) -> str:
    """Lay out the networks' scores, and their differences from the usual networks, points."""
    lines = [["learned from", *METRICS, *(f"{name}, difference" for name in METRICS)]]
    for row in rows:
        scores, differences = (row[part][against][cells] for part in ("scores", "differences"))
        line = [LEARNED_FROM[row["truth"]], *(shown(scores[name]) for name in METRICS)]
        lines.append(line + [shown(differences[name], 2) if row is not rows[0] else "" for name in METRICS])
    return markdown_table(lines)


def _parts(rows: list[dict], part: str) -> str:
    """Lay out one line per class or band: the usual labels and networks, and what the others change."""
    usual, *others = rows
    lines = [["", "usual labels", "usual networks", *(LEARNED_FROM[row["truth"]] for row in others)]]
    for name, found in usual[part].items():
        changes = (shown(row[part][name]["difference"]) for row in others)
        lines.append([name, shown(found["labels"]), shown(found["networks"]), *changes])
    return markdown_table(lines)


def truth_costs_picture(result: dict) -> Figure:
    """Draw the differences from the usual networks, and how right networks are beside the labels they learned from.

    Parameters
    ----------
    result : dict
        From `truth_costs`.

    Returns
    -------
    Figure
    """
    usual, *others = result["rows"]
    figure, axes = plt.subplots(1, 3, figsize=(19, 5), layout="constrained")
    for ax, cells, which in zip(axes, ("all", "semantic"), ("all cells", "cells with a semantic class"), strict=False):
        differences = {LEARNED_FROM[row["truth"]]: row["differences"]["true"][cells] for row in others}
        shown_ones = {name: found["pixel accuracy"] for name, found in differences.items()}
        forest_plot(shown_ones, ax, f"pixel accuracy, {which}: difference from usual, points", reference=0)
    axes[1].set_yticklabels([])
    _draw_against_labels(axes[2], [usual, *others])
    return figure


def _draw_against_labels(ax: Axes, rows: list[dict]) -> None:
    """Draw how right the networks are on the test frames against how right their labels were in training."""
    for row, marker in zip(rows, _MARKERS, strict=False):
        labels, networks = (
            100 * scores["semantic"]["pixel accuracy"]["mean"] for scores in (row["labels"], row["scores"]["true"])
        )
        ax.plot(labels, networks, marker, markersize=8, markeredgecolor="0.2", label=LEARNED_FROM[row["truth"]])
    ax.axline((50, 50), slope=1, color="0.4", linewidth=0.8, label="as right as the labels")
    ax.set(title="cells with a semantic class", xlabel="labels of the training frames right, per cent")
    ax.set_ylabel("networks right on the test frames, per cent")
    ax.grid(alpha=0.3)
    ax.legend(fontsize="small")


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
) -> dict[str, ScoreWithInterval]:
    """Return one score of labels and networks, over cells with a true semantic class."""
    of_labels, ours, theirs = (
        on_cells(by_seed(runs, root, method, "true", band), "semantic", KITTI_14)
        for runs, method in ((labels, LABELS), (networks, NETWORK), (usual, NETWORK))
    )
    return {
        "labels": score_with_interval(of_labels, metric),
        "networks": score_with_interval(ours, metric),
        "difference": compared(ours, theirs, metric),
    }

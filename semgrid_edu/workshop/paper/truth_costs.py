"""What training on other kinds of ground truth costs: SegNet on the same seeds and test frames (section 4)."""

from collections.abc import Sequence
from dataclasses import asdict

from semgrid_edu.datasets.label_policies import POLICIES
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS, class_iou, pixel_accuracy
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale, table1_runs
from semgrid_edu.workshop.paper.score_runs import LABELS, LabelsRun, ScoreRun, by_seed
from semgrid_edu.workshop.paper.tables import TRUTHS, beside_usual, beside_usual_table
from semgrid_edu.workshop.scoring.confusions import distance_band_names
from semgrid_edu.workshop.scoring.grids import NETWORK
from semgrid_edu.workshop.scoring.score_with_interval import (
    ScoreWithInterval,
    compared,
    every_metric,
    markdown_table,
    on_cells,
    per_cent,
    score_with_interval,
    shown,
)
from semgrid_edu.workshop.scoring.statistics import Metric

USUAL_TRUTH = "lidar"
"""What all others are compared with: the paper's way, which Table 1's networks learn from."""

LEARNED_FROM, CELLS, PARTS = (table_beside(__file__)[name] for name in ("learned_from", "cells", "parts"))
"""In words: what the networks learn from, on which cells they are scored, and what is listed part by part."""


def truths_of(scale: Scale) -> tuple[str, ...]:
    """Return what networks learn from: the usual labels first, then the true ones, then the labels of other policies.

    Parameters
    ----------
    scale : Scale
        How large the experiment is.
    """
    return (USUAL_TRUTH, "true", *scale.policies)


def taught_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of the networks by what they learn from, one per seed, all scored on the same frames.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds. The usual labels have the runs of Table 1's SegNet.
    """
    usual = table1_runs(scale, seeds)["segnet"]
    return {USUAL_TRUTH: usual} | {truth: learned_from(truth, usual, scale) for truth in truths_of(scale)[1:]}


def learned_from(truth: str, usual: Sequence[ScoreRun], scale: Scale) -> list[ScoreRun]:
    """Return the runs of networks that learn from other labels than the usual ones, on the same test frames.

    Parameters
    ----------
    truth : str
        What they learn from.
    usual : sequence of ScoreRun
        The usual networks, one per seed.
    scale : Scale
        How large they are.
    """
    networks = [scale.grid_stage(scale.kitti, "segnet", seed, truth) for seed in range(len(usual))]
    return [ScoreRun(network, one.frames, crf=False) for network, one in zip(networks, usual, strict=True)]


def label_runs(scale: Scale) -> dict[str, LabelsRun]:
    """Return the runs that count the labels of the training frames, by what the labels are.

    Parameters
    ----------
    scale : Scale
        How large they are.
    """
    usual, *others = (scale.arrays(scale.kitti, "train", truth) for truth in truths_of(scale))
    return {arrays.truth: LabelsRun(arrays, usual) for arrays in (usual, *others)}


def truth_cost_runs(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs, those of the first seed first. Parameters are those of `taught_runs`."""
    by_truth = taught_runs(scale, seeds).values()
    return [*label_runs(scale).values(), *(run for alike in zip(*by_truth, strict=True) for run in alike)]


def truth_costs(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return what it costs to train on each kind of labels, from ended runs. Parameters are those of `ablations`.

    Returns
    -------
    dict
        "rows", one for each kind of labels: its name ("truth"), its "policy"; for the training frames the share of
        cells whose label is "changed" from the usual one, and how right the "labels" are; the networks' "scores" on the
        test frames and their "differences" from the usual networks; and for cells with a true semantic class, by class
        the intersection over union ("classes") and by distance the share that is right ("distances").
    """
    runs = taught_runs(scale, seeds)
    labels = label_runs(scale)
    return {"rows": [_row(truth, runs, labels[truth], counted) for truth in runs]}


def _row(truth: str, runs: dict[str, list[ScoreRun]], labels: LabelsRun, counted: RunCounts) -> dict:
    """Return the row of one kind of labels."""
    networks = runs[truth]
    usual = runs[USUAL_TRUTH]
    like_usual = labels.confusions(counted, LABELS, "lidar").total(LABELS)

    def part(metric: Metric, band: str | None = None) -> dict[str, ScoreWithInterval]:
        """Return one score of labels and networks, over cells with a true semantic class."""
        of_labels, ours, theirs = (
            on_cells(by_seed(some, counted, method, "true", band), "semantic", KITTI_14)
            for some, method in (([labels], LABELS), (networks, NETWORK), (usual, NETWORK))
        )
        found = {"labels": score_with_interval(of_labels, metric), "networks": score_with_interval(ours, metric)}
        return found | {"difference": compared(ours, theirs, metric)}

    return {
        "truth": truth,
        "policy": asdict(POLICIES[truth]) if truth in POLICIES else None,
        "changed": 1 - pixel_accuracy(like_usual),
        "labels": every_metric(score_with_interval, KITTI_14, by_seed([labels], counted, LABELS, "true")),
        **beside_usual(networks, usual, counted),
        "classes": {
            name: part(lambda matrix, c=c: class_iou(matrix)[c])
            for c, name in enumerate(KITTI_14.names[: KITTI_14.n_semantic])
        },
        "distances": {band: part(pixel_accuracy, band) for band in distance_band_names()},
    }


def truth_costs_markdown(result: dict) -> str:
    """Return what training on each kind of labels costs as Markdown.

    Parameters
    ----------
    result : dict
        From `truth_costs`.
    """
    rows = {LEARNED_FROM[row["truth"]]: row for row in result["rows"]}
    tables = {"The labels, on the training frames, against the true ones": _labels(rows)}
    tables |= {
        f"The networks, on the test frames, against {words}, {which}": _networks(rows, against, cells)
        for against, words in TRUTHS.items()
        for cells, which in CELLS.items()
    }
    tables |= {f"{words}; differences of the networks in points": _parts(rows, part) for part, words in PARTS.items()}
    head = (
        "SegNet, the same image stages, seeds and test frames; only the labels of the grids differ that it learns from."
    )
    return "\n\n".join([head, *(f"## {title}\n\n{markdown_table(lines)}" for title, lines in tables.items())])


def _labels(rows: dict[str, dict]) -> list[list[str]]:
    """Lay out how right the labels are."""
    return [["labels", "other than usual", "right, all cells", "right, cells with a semantic class"]] + [
        [name, per_cent(row["changed"]), *(shown(row["labels"][cells]["pixel accuracy"]) for cells in CELLS)]
        for name, row in rows.items()
    ]


def _networks(rows: dict[str, dict], against: str, cells: str) -> list[list[str]]:
    """Lay out the networks' scores, and their differences from the usual networks, points."""
    head, usual, *others = beside_usual_table("learned from", rows, against, cells)
    return [head, usual[: 1 + len(METRICS)] + [""] * len(METRICS), *others]


def _parts(rows: dict[str, dict], part: str) -> list[list[str]]:
    """Lay out one line per class or band: the usual labels and networks, and what the others change."""
    (_, usual), *others = rows.items()
    lines = [["", "usual labels", "usual networks", *(name for name, _ in others)]]
    for name, found in usual[part].items():
        changes = (shown(row[part][name]["difference"]) for _, row in others)
        lines.append([name, shown(found["labels"]), shown(found["networks"]), *changes])
    return lines

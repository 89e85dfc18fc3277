"""What the paper leaves open: one thing changed at a time, against the same seeds and drives (section 4).

The ablations as Markdown (section 4).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from semgrid_edu.crf import expected_calibration_error
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS, pixel_accuracy
from semgrid_edu.workshop.paper.reports.accuracy_tables import TRUTHS, comparison
from semgrid_edu.workshop.paper.runs.claim_runs import table1_runs
from semgrid_edu.workshop.paper.runs.paper import NETWORKS
from semgrid_edu.workshop.paper.runs.scales import Scale
from semgrid_edu.workshop.paper.runs.score_runs import NETWORK, WITH_CRF, WITH_SEARCHED, ScoreRun, by_seed
from semgrid_edu.workshop.paper.runs.variants import CalibrationError, Variant
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.workshop.scoring.confusions import distance_band_names
from semgrid_edu.workshop.scoring.score_with_interval import (
    all_metrics,
    markdown_table,
    on_cells,
    score_with_interval,
    shown,
)

SECTIONS = {
    "variants": "Networks that are trained differently. Usual: SegNet, 20 planes 0.2 m apart, occupancy grid, "
    "reduction, balancing, labels made with the LIDAR.",
    "calibration": "The usual network, tested with a wrong calibration: degrees of pitch (positive: believed to look "
    "further down) and yaw (to the left), metres of height.",
    "frames": "A quarter of the training frames, against all of them.",
}
"""What each list of rows shows."""


def ablations_markdown(result: dict) -> str:
    """Return the ablations as Markdown.

    Parameters
    ----------
    result : dict
        From `ablations`.

    Returns
    -------
    str
    """
    parts = [f"## {words}\n\n{_rows(result[name])}" for name, words in SECTIONS.items()]
    parts.append(
        f"## Accuracy by distance, cells with a semantic class, true labels\n\n{_distance(result['distance'])}"
    )
    parts.append(f"## Expected calibration error, points\n\n{_calibration_table(result['sureness'])}")
    return "\n\n".join(parts)


def _rows(rows: list[dict]) -> str:
    """Lay out scores by the true labels over all cells, and differences from the usual network, points."""
    lines = [["", *METRICS, *(f"{name}, difference" for name in METRICS)]]
    for row in rows:
        scores, differences = (row[part]["true"]["all"] for part in ("scores", "differences"))
        ours, gains = (
            [shown(part[name], digits) for name in METRICS] for part, digits in ((scores, 1), (differences, 2))
        )
        lines.append([row["what"], *ours, *gains])
    return markdown_table(lines)


def _distance(rows: list[dict]) -> str:
    lines = [["distance", "pixel accuracy"]]
    return markdown_table(lines + [[row["what"], shown(row["pixel accuracy"])] for row in rows])


def _calibration_table(rows: list[dict]) -> str:
    lines = [["", "mean", "every seed"]]
    for row in rows:
        errors = 100 * np.array(row["expected calibration error"])
        lines.append([row["what"], f"{errors.mean():.1f}", ", ".join(f"{error:.1f}" for error in errors)])
    return markdown_table(lines)


VARIANTS = {
    "1 plane": Variant(n_planes=1),
    "2 planes": Variant(n_planes=2),
    "5 planes": Variant(n_planes=5),
    "10 planes": Variant(n_planes=10),
    "planes 0.1 m apart": Variant(spacing=0.1),
    "planes 0.4 m apart": Variant(spacing=0.4),
    "no occupancy grid": Variant(occupancy=False),
    "no 1x1 reduction": Variant(reduces=False),
    "no balancing": Variant(balanced=False),
}
"""Each differs in one thing from the usual network: 20 planes 0.2 m apart, occupancy grid, reduction, balancing."""

CALIBRATION_ERRORS = (
    *(CalibrationError(pitch=size) for size in (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)),
    *(CalibrationError(yaw=size) for size in (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)),
    *(CalibrationError(height=size) for size in (-0.2, -0.1, 0.1, 0.2)),
)
"""Errors in the calibration that the trained network is given when it is tested: degrees, metres."""

FEW = 4
"""The small training set has one in so many frames."""


def usual_runs(scale: Scale, seeds: int) -> list[ScoreRun]:
    """Return the runs of the usual network, which are SegNet's of Table 1. Parameters are those of `table1_runs`.

    Returns
    -------
    list of ScoreRun
        One per seed.
    """
    return table1_runs(scale, seeds)["segnet"]


def variant_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of the networks that differ from the usual one. Parameters are those of `table1_runs`.

    Returns
    -------
    dict of str to list of ScoreRun
        By what differs, one per seed.
    """
    found = {
        name: [scale.scored(scale.kitti, "segnet", seed, variant=variant, crf=False) for seed in range(seeds)]
        for name, variant in VARIANTS.items()
    }
    found["learned from true labels"] = [
        ScoreRun(scale.grid_stage(scale.kitti, "segnet", seed, truth="true"), usual.frames, crf=False)
        for seed, usual in enumerate(usual_runs(scale, seeds))
    ]
    return found


def small_set_runs(scale: Scale, seeds: int) -> dict[str, list[ScoreRun]]:
    """Return the runs of the three networks of Table 1 on a part of the frames. Parameters are those of `table1_runs`.

    Returns
    -------
    dict of str to list of ScoreRun
        By image network one per seed.
    """
    n_frames = max(scale.frames_to_train // FEW, 6)
    return {
        segmenter: [scale.scored(scale.kitti, segmenter, seed, n_frames=n_frames, crf=False) for seed in range(seeds)]
        for segmenter in NETWORKS
    }


def miscalibrated_runs(scale: Scale, seeds: int) -> dict[CalibrationError, list[ScoreRun]]:
    """Return the runs of the usual network with wrong calibrations. Parameters are those of `table1_runs`.

    Returns
    -------
    dict of CalibrationError to list of ScoreRun
        By error one per seed.
    """
    return {
        error: [ScoreRun(usual.network, usual.frames, False, error) for usual in usual_runs(scale, seeds)]
        for error in CALIBRATION_ERRORS
    }


def ablation_runs(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs of the ablations. Parameters are those of `table1_runs`.

    Returns
    -------
    list of Run
        The usual networks first; then what needs no other training run; then the variants.
    """
    others = (miscalibrated_runs(scale, seeds), variant_runs(scale, seeds), small_set_runs(scale, seeds))
    return [*usual_runs(scale, seeds), *(run for found in others for runs in found.values() for run in runs)]


def ablations(scale: Scale, seeds: int, root: Path) -> dict:
    """Return all ablations, from runs that have ended.

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
        "variants", "calibration", "frames", "distance" and "sureness": lists of rows, each with what it is ("what")
        and its scores.
    """
    usual = usual_runs(scale, seeds)
    networks = {"usual": usual} | variant_runs(scale, seeds)
    wrong = miscalibrated_runs(scale, seeds)
    return {
        "variants": [_row(name, runs, usual, root) for name, runs in networks.items()],
        "calibration": [_row(error.name.removeprefix("-"), runs, usual, root) for error, runs in wrong.items()],
        "frames": _small_sets(scale, seeds, root),
        "distance": [_band(band, usual, root) for band in distance_band_names()],
        "sureness": [_calibration(method, usual, root) for method in (NETWORK, WITH_CRF, WITH_SEARCHED)],
    }


def _row(what: str, runs: Sequence[ScoreRun], usual: Sequence[ScoreRun], root: Path) -> dict:
    """Return the scores of a variant and its differences from the usual network, by truth, cells and metric."""
    scores = {truth: all_metrics(by_seed(runs, root, NETWORK, truth), KITTI_14) for truth in TRUTHS}
    return {"what": what, "scores": scores, "differences": comparison(what, runs, usual, root, KITTI_14)["scores"]}


def _small_sets(scale: Scale, seeds: int, root: Path) -> list[dict]:
    """Return each network's scores with few frames, and what it loses against all of them."""
    rows, every = [], table1_runs(scale, seeds)
    for segmenter, few in small_set_runs(scale, seeds).items():
        rows.append(
            _row(f"{NETWORKS[segmenter]}, {few[0].network.image_stage.n_frames} frames", few, every[segmenter], root)
        )
    return rows


def _band(band: str, usual: Sequence[ScoreRun], root: Path) -> dict:
    """Return the scores of the cells in a band of distance, by the true labels."""
    found = by_seed(usual, root, NETWORK, "true", band)
    kept = on_cells(found, "semantic", KITTI_14)
    return {"what": band, "cells": int(kept.sum()), "pixel accuracy": score_with_interval(kept, pixel_accuracy)}


def _calibration(method: str, usual: Sequence[ScoreRun], root: Path) -> dict:
    """Return how well a method's probabilities mean what they say, seed by seed."""
    diagrams = [run.reliability(root, method) for run in usual]
    return {
        "what": method,
        "expected calibration error": [expected_calibration_error(diagram) for diagram in diagrams],
        "diagrams": [{name: column.tolist() for name, column in diagram._asdict().items()} for diagram in diagrams],
    }

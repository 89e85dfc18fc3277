"""What the paper leaves open: one thing changed at a time, against the same seeds and drives (section 4)."""

from collections.abc import Sequence
from functools import partial
from itertools import chain

import numpy as np

from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import pixel_accuracy
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.published import NETWORKS
from semgrid_edu.workshop.paper.run import Run
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import Scale, table1_runs
from semgrid_edu.workshop.paper.score_runs import WITH_CRF, WITH_SEARCHED, ScoreRun, by_seed
from semgrid_edu.workshop.paper.tables import CELLS, beside_usual, beside_usual_table
from semgrid_edu.workshop.paper.truth_costs import learned_from
from semgrid_edu.workshop.paper.variants import CalibrationError, named_variants
from semgrid_edu.workshop.scoring.calibration import expected_calibration_error
from semgrid_edu.workshop.scoring.confusions import distance_band_names
from semgrid_edu.workshop.scoring.grids import NETWORK
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, on_cells, score_with_interval, shown

_TABLES = table_beside(__file__)
VARIANTS = named_variants(_TABLES["variants"])
"""Each differs in one thing from the usual network."""

CALIBRATION_ERRORS = [CalibrationError(**{kind: size}) for kind, sizes in _TABLES["errors"].items() for size in sizes]
"""Errors in the calibration that the trained network is given when it is tested: degrees, metres."""

FEWER_FRAMES = 4
"""The small training set has one frame in four."""

NOTES = {"semantic": "", "all": " The truth of a cell without a semantic class is defined by the occupancy grid."}
"""On which cells rows are compared, in order, and what has to be known of them."""

CONFIDENCE = {"true": "", "lidar": ", by labels made with the LIDAR"}
"""The labels against which confidence is checked, and the words for them in a row; networks learn from the second."""

SECTIONS = _TABLES["sections"]
"""The lists of rows that are compared with the usual network, and what each shows."""


def ablated_runs(scale: Scale, seeds: int) -> dict[str, dict[str, tuple[list[ScoreRun], list[ScoreRun]]]]:
    """Return the runs of each row, and the usual ones that they are compared with, one per seed.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.

    Returns
    -------
    dict
        By key of `SECTIONS` and by what the row is.
    """
    every = table1_runs(scale, seeds)
    usual = every["segnet"]
    n_frames = max(usual[0].network.arrays.n_labelled // FEWER_FRAMES, 6)
    scored = partial(scale.scored, scale.kitti, crf=False)
    variants = {"usual": usual}
    variants |= {name: scored("segnet", seeds, variant=variant) for name, variant in VARIANTS.items()}
    variants |= {"learned from true labels": learned_from("true", usual, scale)}
    errors = {
        error.name.removeprefix("-"): [ScoreRun(run.network, run.frames, False, error) for run in usual]
        for error in CALIBRATION_ERRORS
    }
    small = {name: scored(name, seeds, n_frames=n_frames) for name in NETWORKS}
    return {
        "variants": {what: (runs, usual) for what, runs in variants.items()},
        "calibration": {what: (runs, usual) for what, runs in errors.items()},
        "frames": {f"{NETWORKS[name]}, {n_frames} frames": (runs, every[name]) for name, runs in small.items()},
    }


def ablation_runs(scale: Scale, seeds: int) -> list[Run]:
    """Return all runs: the usual networks first, then what trains nothing. Parameters are those of `ablated_runs`."""
    rows = ablated_runs(scale, seeds)
    usual = table1_runs(scale, seeds)["segnet"]
    pairs = (pair for name in ("calibration", "variants", "frames") for pair in rows[name].values())
    return [*usual, *chain(*chain(*pairs))]


def rows_without_runs(scale: Scale, seeds: int, counted: RunCounts) -> list[str]:
    """Return which rows were added after the counts were kept. Parameters are those of `ablations`."""
    rows = (row for section in ablated_runs(scale, seeds).values() for row in section.items())
    return [what for what, (runs, _) in rows if not all(map(counted.knows, runs))]


def ablations(scale: Scale, seeds: int, counted: RunCounts) -> dict:
    """Return all ablations, from runs that have ended, without `rows_without_runs`.

    Parameters
    ----------
    scale : Scale
        How large they are.
    seeds : int
        Number of seeds.
    counted : RunCounts
        What is known about the runs.

    Returns
    -------
    dict
        "variants", "calibration", "frames", "distance" and "confidence": lists of rows, each with what it is ("what")
        and its scores.
    """
    usual = table1_runs(scale, seeds)["segnet"]
    later = rows_without_runs(scale, seeds, counted)
    found: dict[str, list[dict]] = {
        name: [{"what": what, **beside_usual(*pair, counted)} for what, pair in rows.items() if what not in later]
        for name, rows in ablated_runs(scale, seeds).items()
    }
    found["distance"] = [_band(band, usual, counted) for band in distance_band_names()]
    methods = (NETWORK, WITH_CRF, WITH_SEARCHED)
    found["confidence"] = [_calibration(method, usual, counted, truth) for truth in CONFIDENCE for method in methods]
    return found


def _band(band: str, usual: Sequence[ScoreRun], counted: RunCounts) -> dict:
    """Return the scores of the cells in a band of distance, by the true labels."""
    kept = on_cells(by_seed(usual, counted, NETWORK, "true", band), "semantic", KITTI_14)
    return {"what": band, "cells": int(kept.sum()), "pixel accuracy": score_with_interval(kept, pixel_accuracy)}


def _calibration(method: str, usual: Sequence[ScoreRun], counted: RunCounts, truth: str) -> dict:
    """Return how well calibrated a method's probabilities are, seed by seed."""
    diagrams = [run.reliability(counted, method, truth) for run in usual]
    return {
        "what": method + CONFIDENCE[truth],
        "expected calibration error": [expected_calibration_error(diagram) for diagram in diagrams],
        "diagrams": [{name: column.tolist() for name, column in diagram._asdict().items()} for diagram in diagrams],
    }


def ablations_markdown(result: dict) -> str:
    """Return the ablations as Markdown.

    Parameters
    ----------
    result : dict
        From `ablations`.
    """
    rows = {words: {row["what"]: row for row in result[name]} for name, words in SECTIONS.items()}
    tables = {
        f"{words} {CELLS[cells].capitalize()}, true labels.{NOTES[cells]}": beside_usual_table("", some, "true", cells)
        for words, some in rows.items()
        for cells in NOTES
    }
    near = [[row["what"], shown(row["pixel accuracy"])] for row in result["distance"]]
    tables["Accuracy by distance, cells with a semantic class, true labels"] = [["distance", "pixel accuracy"], *near]
    sure = {row["what"]: 100 * np.array(row["expected calibration error"]) for row in result["confidence"]}
    tables["Expected calibration error, points"] = [["", "mean", "every seed"]] + [
        [what, f"{errors.mean():.1f}", ", ".join(f"{error:.1f}" for error in errors)] for what, errors in sure.items()
    ]
    return "\n\n".join(f"## {words}\n\n{markdown_table(lines)}" for words, lines in tables.items())

"""Tables 1 and 2: pixel accuracy, class accuracy and FmIoU, with and without the CRF (sections 4.2 and 4.3)."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS
from semgrid_edu.workshop.paper.runs.paper import NETWORKS
from semgrid_edu.workshop.paper.runs.score_runs import (
    BASELINES,
    NETWORK,
    WITH_CRF,
    BaselineRun,
    CountingRun,
    ScoreRun,
    by_seed,
)
from semgrid_edu.workshop.scoring.score_with_interval import (
    all_metrics,
    compared,
    markdown_table,
    on_cells,
    per_cent,
    shown,
    shown_seeds,
)

TRUTHS = {"lidar": "labels made with the LIDAR, as in the paper", "true": "true labels"}
"""What networks are scored against."""


def accuracy_rows(
    runs: Mapping[str, Sequence[ScoreRun]], root: Path, label_set: LabelSet, paper: Mapping[tuple[str, bool], dict]
) -> list[dict]:
    """Return the rows of a table: each image network without and with the CRF.

    Parameters
    ----------
    runs : mapping of str to sequence of ScoreRun
        By image network one run per seed.
    root : Path
        The folder of all runs.
    label_set : LabelSet
        The classes.
    paper : mapping of (str, bool) to dict
        The paper's scores by image network and whether the CRF is used.

    Returns
    -------
    list of dict
        "network", "CRF", the "paper"'s scores and ours: "scores" by truth, cells and metric, and the "confusion" matrix
        of all seeds by truth.
    """
    rows = []
    for segmenter, scored in runs.items():
        for crf, method in ((False, NETWORK), (True, WITH_CRF)):
            found = {truth: by_seed(scored, root, method, truth) for truth in TRUTHS}
            rows.append(
                {
                    "network": segmenter,
                    "CRF": crf,
                    "paper": paper[segmenter, crf],
                    "scores": {truth: all_metrics(matrices, label_set) for truth, matrices in found.items()},
                    "confusion": {truth: matrices.sum(axis=(0, 1)).tolist() for truth, matrices in found.items()},
                }
            )
    return rows


def crf_gains(runs: Mapping[str, Sequence[ScoreRun]], root: Path, label_set: LabelSet) -> list[dict]:
    """Return by how much the CRF changes each network's scores. Parameters are those of `accuracy_rows`.

    Returns
    -------
    list of dict
        "what" is compared, and the "scores" by truth, cells and metric.
    """
    return [
        comparison(f"{NETWORKS[segmenter]}: with CRF - without", scored, scored, root, label_set, (WITH_CRF, NETWORK))
        for segmenter, scored in runs.items()
    ]


def network_gains(runs: Mapping[str, Sequence[ScoreRun]], root: Path, label_set: LabelSet) -> list[dict]:
    """Return by how much each network beats the next one. Parameters are those of `accuracy_rows`.

    Returns
    -------
    list of dict
        As `crf_gains`.
    """
    return [comparison(f"{NETWORKS[a]} - {NETWORKS[b]}", runs[a], runs[b], root, label_set) for a, b in pairwise(runs)]


def baseline_gains(
    networks: Sequence[ScoreRun], baselines: Sequence[BaselineRun], root: Path, label_set: LabelSet
) -> list[dict]:
    """Return by how much SegNet beats each baseline.

    Parameters
    ----------
    networks : sequence of S ScoreRun
        SegNet's runs, one per seed.
    baselines : sequence of S BaselineRun
        The baselines of the same seeds, on the same frames.
    root : Path
        The folder of all runs.
    label_set : LabelSet
        The classes.

    Returns
    -------
    list of dict
        As `crf_gains`.
    """
    return [
        comparison(f"{NETWORKS['segnet']} - {name}", networks, baselines, root, label_set, (NETWORK, name))
        for name in BASELINES
    ]


def comparison(
    what: str,
    a: Sequence[CountingRun],
    b: Sequence[CountingRun],
    root: Path,
    label_set: LabelSet,
    methods: tuple[str, str] = (NETWORK, NETWORK),
) -> dict:
    """Return the difference of two methods in every metric.

    Parameters
    ----------
    what : str
        What is compared.
    a, b : sequence of S CountingRun
        The runs of both, one per seed.
    root : Path
        The folder of all runs.
    label_set : LabelSet
        The classes.
    methods : (str, str)
        The methods of both.

    Returns
    -------
    dict
        "what", and "scores" by truth, cells and metric.
    """
    scores: dict[str, dict] = {}
    for truth in TRUTHS:
        first, second = (by_seed(runs, root, name, truth) for runs, name in zip((a, b), methods, strict=True))
        scores[truth] = {
            cells: {
                name: compared(on_cells(first, cells, label_set), on_cells(second, cells, label_set), metric)
                for name, metric in METRICS.items()
            }
            for cells in ("all", "semantic")
        }
    return {"what": what, "scores": scores}


def accuracy_markdown(result: dict) -> str:
    """Return a result as Markdown.

    Parameters
    ----------
    result : dict
        Its "rows" are from `accuracy_rows`, its "differences" from `crf_gains`, `network_gains` and `baseline_gains`.

    Returns
    -------
    str
    """
    sections = []
    for truth, words in TRUTHS.items():
        for cells in ("all", "semantic"):
            with_class = "all labelled cells" if cells == "all" else "cells with a semantic class"
            sections.append(f"Against {words}, {with_class}:\n\n{_scores(result['rows'], truth, cells)}")
    sections.append(f"Every seed, all labelled cells, labels made with the LIDAR:\n\n{_seeds(result['rows'])}")
    for truth, words in TRUTHS.items():
        sections.append(
            f"Paired differences (same seeds, same drives), all labelled cells, against {words}, points:\n\n"
            + _differences(result["differences"], truth)
        )
    return "\n\n".join(sections)


def _scores(rows: list[dict], truth: str, cells: str) -> str:
    """Lay out ours beside the paper's; the paper has one kind of labels and cells."""
    as_in_paper = truth == "lidar" and cells == "all"
    head = ["network", "CRF"] + [f"{name}{part}" for name in METRICS for part in (", paper", "")[not as_in_paper :]]
    lines = [head]
    for row in rows:
        line = [NETWORKS[row["network"]], "yes" if row["CRF"] else "no"]
        for name in METRICS:
            line += [per_cent(row["paper"][name])] * as_in_paper + [shown(row["scores"][truth][cells][name])]
        lines.append(line)
    return markdown_table(lines)


def _seeds(rows: list[dict]) -> str:
    lines = [["network", "CRF", *METRICS]]
    for row in rows:
        scores = row["scores"]["lidar"]["all"]
        named = [NETWORKS[row["network"]], "yes" if row["CRF"] else "no"]
        lines.append([*named, *(shown_seeds(scores[name]) for name in METRICS)])
    return markdown_table(lines)


def _differences(rows: list[dict], truth: str) -> str:
    lines = [["difference", *METRICS]]
    for row in rows:
        lines.append([row["what"], *(shown(row["scores"][truth]["all"][name], 2) for name in METRICS)])
    return markdown_table(lines)

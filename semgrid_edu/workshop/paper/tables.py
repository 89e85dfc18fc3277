"""Tables 1 to 3: every score beside the paper's, its differences, and the confusion matrix (sections 4.2 to 4.4)."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.metrics import METRICS
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.published import NETWORKS, TABLE_3_CONFUSION, TABLE_3_SCORES
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.score_runs import (
    BASELINES,
    FITTED_BASELINES,
    WITH_CRF,
    BaselineRun,
    CountingRun,
    ScoreRun,
    by_seed,
)
from semgrid_edu.workshop.scoring.grids import NETWORK
from semgrid_edu.workshop.scoring.score_with_interval import (
    ScoreWithInterval,
    compared,
    every_metric,
    markdown_table,
    per_cent,
    score_with_interval,
    shown,
    shown_seeds,
)

_WORDS = table_beside(__file__)
TRUTHS, CELLS = _WORDS["truths"], _WORDS["cells"]
"""What networks are scored against, and on which cells: in words, by name."""


def scores_by_truth(runs: Sequence[CountingRun], counted: RunCounts, method: str = NETWORK) -> dict[str, dict]:
    """Return every metric of a method, by truth, cells and metric.

    Parameters
    ----------
    runs : sequence of S CountingRun
        One per seed.
    counted : RunCounts
        What is known about the runs.
    method : str
        One of the methods that the runs have scored.
    """
    return {
        truth: every_metric(score_with_interval, KITTI_14, by_seed(runs, counted, method, truth)) for truth in TRUTHS
    }


def differences_by_truth(
    counted: RunCounts, a: Sequence[CountingRun], b: Sequence[CountingRun], of_a: str = NETWORK, of_b: str = NETWORK
) -> dict[str, dict]:
    """Return a minus b in every metric, on the same seeds and drives, by truth, cells and metric.

    Parameters
    ----------
    counted : RunCounts
        What is known about the runs.
    a, b : sequence of S CountingRun
        One per seed.
    of_a, of_b : str
        The method of a and that of b.
    """
    counts = {truth: (by_seed(a, counted, of_a, truth), by_seed(b, counted, of_b, truth)) for truth in TRUTHS}
    return {truth: every_metric(compared, KITTI_14, *both) for truth, both in counts.items()}


def beside_usual(runs: Sequence[CountingRun], usual: Sequence[CountingRun], counted: RunCounts) -> dict[str, dict]:
    """Return the "scores" of networks, and their "differences" from the usual ones.

    Parameters
    ----------
    runs, usual : sequence of S CountingRun
        One per seed.
    counted : RunCounts
        What is known about the runs.
    """
    return {"scores": scores_by_truth(runs, counted), "differences": differences_by_truth(counted, runs, usual)}


def beside_usual_table(head: str, rows: Mapping[str, dict], truth: str, cells: str) -> list[list[str]]:
    """Lay out scores, and differences from the usual networks in points.

    Parameters
    ----------
    head : str
        The head of the first column.
    rows : mapping of str to dict
        By name what `beside_usual` returned.
    truth, cells : str
        What they are scored against, and on which cells: keys of `TRUTHS` and `CELLS`.
    """
    return [[head, *METRICS, *(f"{name}, difference" for name in METRICS)]] + [
        [name, *score_cells(row["scores"][truth][cells]), *score_cells(row["differences"][truth][cells], 2)]
        for name, row in rows.items()
    ]


def accuracy_result(
    runs: Mapping[str, Sequence[ScoreRun]],
    counted: RunCounts,
    baselines: Sequence[BaselineRun],
    paper: Mapping[tuple[str, bool], dict],
) -> dict[str, list[dict]]:
    """Return Table 1 or 2.

    Parameters
    ----------
    runs : mapping of str to sequence of S ScoreRun
        By image network one per seed.
    counted : RunCounts
        What is known about the runs.
    baselines : sequence of S BaselineRun
        The baselines of the same seeds, on the same frames, with which SegNet is compared.
    paper : mapping of (str, bool) to dict
        The paper's scores by image network and whether the CRF is used.

    Returns
    -------
    dict
        "rows", each image network without and with the CRF: "network", "CRF", the "paper"'s scores, our "scores" by
        truth, cells and metric, and by truth the "confusion" matrix of all seeds. "baselines": such rows for each
        baseline. "differences": "what" is compared, and the "scores", as `differences_by_truth` returns them.
    """
    pairs = {f"{NETWORKS[name]}: with CRF - without": (some, some, WITH_CRF) for name, some in runs.items()}
    pairs |= {f"{NETWORKS[a]} - {NETWORKS[b]}": (runs[a], runs[b]) for a, b in pairwise(runs)}
    pairs |= {f"{NETWORKS['segnet']} - {name}": (runs["segnet"], baselines, NETWORK, name) for name in BASELINES}
    unknown = dict.fromkeys(METRICS)
    return {
        "rows": [
            {"network": name, "CRF": crf, "paper": paper.get((name, crf), unknown), **_counted(scored, counted, method)}
            for name, scored in runs.items()
            for crf, method in ((False, NETWORK), (True, WITH_CRF))
        ],
        "baselines": [
            {"network": name, "CRF": False, "paper": unknown, **_counted(baselines, counted, name)}
            for name in BASELINES
        ],
        "differences": [{"what": what, "scores": differences_by_truth(counted, *pair)} for what, pair in pairs.items()],
    }


def _counted(runs: Sequence[CountingRun], counted: RunCounts, method: str) -> dict[str, dict]:
    """Return the scores of a method, and its confusion matrix for all seeds by truth."""
    cells = {truth: by_seed(runs, counted, method, truth).sum(axis=(0, 1)).tolist() for truth in TRUTHS}
    return {"scores": scores_by_truth(runs, counted, method), "confusion": cells}


def accuracy_markdown(result: dict) -> str:
    """Return Table 1 or 2 as Markdown.

    Parameters
    ----------
    result : dict
        From `accuracy_result`.
    """
    rows = [*result["rows"], *result["baselines"]]
    sections = [
        f"Against {words}, {which}:\n\n{_beside_paper(rows, truth, cells)}"
        for truth, words in TRUTHS.items()
        for cells, which in CELLS.items()
    ]
    seeds = [[*_named(row), *map(shown_seeds, _metrics(row["scores"]["lidar"]["all"]))] for row in rows]
    table = markdown_table([["method", "CRF", *METRICS], *seeds])
    sections.append(f"Every seed, all labelled cells, labels made with the LIDAR:\n\n{table}")
    for truth, words in TRUTHS.items():
        gains = [[row["what"], *score_cells(row["scores"][truth]["all"], 2)] for row in result["differences"]]
        sections.append(
            f"Paired differences (same seeds, same drives), all labelled cells, against {words}, points:\n\n"
            + markdown_table([["difference", *METRICS], *gains])
        )
    return "\n\n".join([*sections, _WORDS["baselines"]["what"]])


def score_cells(found: dict[str, ScoreWithInterval], digits: int = 1) -> list[str]:
    """Return the cells of a table's row: every metric with its interval, per cent.

    Parameters
    ----------
    found : dict of str to dict
        By metric.
    digits : int
        Digits after the point.
    """
    return [shown(value, digits) for value in _metrics(found)]


def _metrics(found: dict) -> list:
    """Return what is known of each metric, in their order."""
    return [found[name] for name in METRICS]


def _named(row: dict) -> list[str]:
    return [NETWORKS[row["network"]], "yes" if row["CRF"] else "no"]


def _beside_paper(rows: list[dict], truth: str, cells: str) -> str:
    """Lay out our scores, beside the paper's where labels and cells are those that the paper has."""
    with_paper = truth == "lidar" and cells == "all"
    lines = [["method", "CRF", *(f"{name}{part}" for name in METRICS for part in (", paper", "")[not with_paper :])]]
    for row in rows:
        line = _named(row)
        for name in METRICS:
            line += [per_cent(row["paper"][name])] * with_paper + [shown(row["scores"][truth][cells][name])]
        lines.append(line)
    return markdown_table(lines)


def confusion_result(
    runs: Mapping[str, Sequence[ScoreRun]], counted: RunCounts, baselines: Sequence[BaselineRun]
) -> dict[str, object]:
    """Return our Table 3 beside the paper's.

    Parameters
    ----------
    runs : mapping of str to sequence of S ScoreRun
        Under "segnet" one per seed.
    counted : RunCounts
        What is known about the runs.
    baselines : sequence of S BaselineRun
        The baselines of the same seeds, on the same frames.

    Returns
    -------
    dict
        "paper" and "ours": "scores" by metric, and the "matrix" in per cent of its rows; ours is the mean over the
        seeds, None in the row of a class that doesn't occur. "confusion" counts the cells of all seeds. "baselines", by
        name: "scores", and "differences", ours minus the baseline's.
    """
    found = by_seed(runs["segnet"], counted, NETWORK, "true")
    counts = found.sum(axis=1)
    with np.errstate(invalid="ignore"):  # NaN in the row of a class that doesn't occur
        shares = np.mean(100 * counts / counts.sum(axis=2, keepdims=True), axis=0)
    others = {name: by_seed(baselines, counted, name, "true") for name in FITTED_BASELINES}
    return {
        "classes": list(SYNTHIA_10.names),
        "paper": {"scores": TABLE_3_SCORES, "matrix": TABLE_3_CONFUSION},
        "ours": {
            "scores": _every(score_with_interval, found),
            "matrix": [[None if np.isnan(share) else round(float(share), 2) for share in row] for row in shares],
        },
        "confusion": found.sum(axis=(0, 1)).tolist(),
        "baselines": {
            name: {"scores": _every(score_with_interval, theirs), "differences": _every(compared, found, theirs)}
            for name, theirs in others.items()
        },
    }


def _every(score: Callable[..., ScoreWithInterval], *confusions: NDArray) -> dict[str, ScoreWithInterval]:
    """Return a score, or a difference, by every metric."""
    return {name: score(*confusions, metric) for name, metric in METRICS.items()}


def confusion_markdown(result: dict) -> str:
    """Return Table 3 as Markdown.

    Parameters
    ----------
    result : dict
        From `confusion_result`.
    """
    ours = result["ours"]["scores"]
    baselines = result["baselines"]
    rows = {"": METRICS, "paper": map(per_cent, _metrics(result["paper"]["scores"])), "ours": score_cells(ours)}
    rows["every seed"] = map(shown_seeds, _metrics(ours))
    rows |= {name: score_cells(one["scores"]) for name, one in baselines.items()}
    rows |= {f"ours - {name}, points": score_cells(one["differences"], 2) for name, one in baselines.items()}
    sections = [
        markdown_table([[name, *cells] for name, cells in rows.items()]),
        "Row: truth, column: detected, per cent of the row; mean over the seeds.",
        *("Ours:", _matrix(result["classes"], result["ours"]["matrix"])),
        *("The paper's:", _matrix(result["classes"], result["paper"]["matrix"])),
        _WORDS["baselines"]["what"],
    ]
    return "\n\n".join(sections)


def _matrix(names: list[str], matrix: list[list[float | None]]) -> str:
    shares = (["-" if share is None else f"{share:.2f}" for share in row] for row in matrix)
    return markdown_table([["", *names], *([name, *row] for name, row in zip(names, shares, strict=True))])

"""Table 3: the confusion matrix on data without any error (section 4.4)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import SYNTHIA_10
from semgrid_edu.metrics import METRICS
from semgrid_edu.workshop.paper.runs.paper import TABLE_3_CONFUSION, TABLE_3_SCORES
from semgrid_edu.workshop.paper.runs.score_runs import NETWORK, ScoreRun, by_seed
from semgrid_edu.workshop.scoring.score_with_interval import (
    markdown_table,
    per_cent,
    score_with_interval,
    shown,
    shown_seeds,
)


def confusion_result(runs: Sequence[ScoreRun], root: Path) -> dict:
    """Return our Table 3 beside the paper's.

    Parameters
    ----------
    runs : sequence of S ScoreRun
        One per seed.
    root : Path
        The folder of all runs.

    Returns
    -------
    dict
        "paper" and "ours": "scores" by metric, and the "matrix" in per cent of its rows; ours is the mean over the
        seeds, None in the row of a class that doesn't occur. "confusion" counts the cells of all seeds.
    """
    found = by_seed(runs, root, NETWORK, "true")
    shares = np.mean([row_per_cent(matrix) for matrix in found.sum(axis=1)], axis=0)
    return {
        "classes": list(SYNTHIA_10.names),
        "paper": {"scores": TABLE_3_SCORES, "matrix": [list(row) for row in TABLE_3_CONFUSION]},
        "ours": {
            "scores": {name: score_with_interval(found, metric) for name, metric in METRICS.items()},
            "matrix": [[None if np.isnan(share) else round(float(share), 2) for share in row] for row in shares],
        },
        "confusion": found.sum(axis=(0, 1)).tolist(),
    }


def row_per_cent(matrix: NDArray) -> NDArray[np.float64]:
    """Return a confusion matrix in per cent of its rows.

    Parameters
    ----------
    matrix : (C, C) int
        One row per true class.

    Returns
    -------
    (C, C) float64
        NaN in the row of a class that doesn't occur.

    Examples
    --------
    >>> row_per_cent(np.array([[3, 1], [0, 2]])).tolist()
    [[75.0, 25.0], [0.0, 100.0]]
    """
    totals = np.sum(matrix, axis=1, keepdims=True)
    return np.divide(100.0 * matrix, totals, out=np.full(np.shape(matrix), np.nan), where=totals > 0)


def confusion_markdown(result: dict) -> str:
    """Return Table 3 as Markdown.

    Parameters
    ----------
    result : dict
        From `confusion_result`.

    Returns
    -------
    str
    """
    scores = [["", *METRICS], ["paper", *(per_cent(result["paper"]["scores"][name]) for name in METRICS)]]
    ours = result["ours"]["scores"]
    scores.append(["ours", *(shown(ours[name]) for name in METRICS)])
    scores.append(["every seed", *(shown_seeds(ours[name]) for name in METRICS)])
    tables = [_matrix(result["classes"], result[whose]["matrix"]) for whose in ("ours", "paper")]
    return (
        f"{markdown_table(scores)}\n\nRow: truth, column: detected, per cent of the row; mean over the seeds.\n\n"
        f"Ours:\n\n{tables[0]}\n\nThe paper's:\n\n{tables[1]}"
    )


def _matrix(names: list[str], matrix: list[list[float | None]]) -> str:
    shares = (["-" if share is None else f"{share:.2f}" for share in row] for row in matrix)
    return markdown_table([["", *names], *([name, *row] for name, row in zip(names, shares, strict=True))])

"""By how much scores fall from Table 1 to Table 2, the paper's and ours, and in which pattern (section 4.3)."""

from types import SimpleNamespace

import numpy as np

from semgrid_edu.metrics import METRICS
from semgrid_edu.workshop.paper.runs.paper import TABLE_1_SCORES, TABLE_2_SCORES
from semgrid_edu.workshop.paper.runs.run_counts import RunCounts
from semgrid_edu.workshop.paper.runs.score_runs import by_seed
from semgrid_edu.workshop.scoring.grids import NETWORK
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, per_cent

COMPARED = ("pixel accuracy", "class accuracy")
"""The two metrics whose falls tell a pattern: which of them falls more."""


def drop_between_tables(runs: SimpleNamespace, counted: RunCounts) -> dict:
    """Return SegNet's scores of Table 2 minus those of Table 1, without the CRF, labels made with the LIDAR.

    Parameters
    ----------
    runs : SimpleNamespace
        From `runs_of_claims`; they have ended.
    counted : RunCounts
        What is known about them.

    Returns
    -------
    dict
        By metric: the "paper"'s, "ours" on the routes of Table 2, and "ours, more routes" on those of claim 3.
    """
    usual, table2, new_routes = (
        {name: _mean(by_seed(some, counted, NETWORK, "lidar"), metric) for name, metric in METRICS.items()}
        for some in (runs.usual, runs.table2, runs.new_routes)
    )
    paper = (TABLE_2_SCORES[("segnet", False)], TABLE_1_SCORES[("segnet", False)])
    pairs = {"paper": paper, "ours": (table2, usual), "ours, more routes": (new_routes, usual)}
    return {name: {metric: b[metric] - a[metric] for metric in METRICS} for name, (b, a) in pairs.items()}


def _mean(counts: np.ndarray, metric: object) -> float:
    """Return the mean over the seeds of a metric on all drives."""
    return float(np.mean([metric(matrix) for matrix in counts.sum(axis=1)]))


def drop_markdown(drop: dict) -> str:
    """Return the drops as a table, and a sentence on their pattern that the numbers decide.

    Parameters
    ----------
    drop : dict
        From `drop_between_tables`.
    """
    rows = [["", *METRICS]] + [[name, *(per_cent(row[m], 1) for m in METRICS)] for name, row in drop.items()]
    sentences = [_pattern(name, drop[name], drop["paper"]) for name in drop if name != "paper"]
    head = (
        "## From Table 1 to Table 2\n\nSegNet without the CRF, labels made with the LIDAR: Table 2 - Table 1, points."
    )
    why = "Each table has a network of its own, and other labels: the two tables differ in more than the routes."
    return "\n\n".join([head, markdown_table(rows), " ".join([*sentences, why])])


def _pattern(name: str, ours: dict[str, float], paper: dict[str, float]) -> str:
    """Return which of two metrics falls more, and whether it is the one that falls more in the paper."""
    more, papers = (min(COMPARED, key=row.get) for row in (ours, paper))
    (other,) = set(COMPARED) - {more}
    text = f"{name.capitalize()}: {more} changes by {100 * ours[more]:+.1f} points, the other by "
    text += f"{100 * ours[other]:+.1f}. In the paper {papers} falls most, by {-100 * paper[papers]:.1f}: "
    if more == papers:
        return text + "the same pattern."
    return text + f"the opposite pattern, which we can't explain from the paper. {_READ[more]}"


_READ = {
    "pixel accuracy": "Here frequent classes suffer on the other routes, there rare ones: some of the paper's classes "
    "may hardly occur on its two test routes, where each weighs as much as road in the mean over classes.",
    "class accuracy": "Here rare classes suffer on the other routes, there frequent ones.",
}
"""What it means that a metric falls most here and not in the paper."""

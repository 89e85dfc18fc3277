"""Scores with confidence intervals and one value per seed, as numbers and as text (section 4.2)."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS, semantic_cells
from semgrid_edu.workshop.scoring.statistics import MIN_DRIVES, Interval, Metric, drive_interval, paired_interval

ScoreWithInterval = dict[str, object]
"""The "mean" over the seeds, "low" and "high" of its 95 % interval, and the value of each of the "seeds". Values that
can't be computed are None. With fewer than `MIN_DRIVES` drives there is no interval."""

SHOWN_SEEDS = 5
"""With more seeds than this, `shown_seeds` shows only the lowest and the highest value."""


def score_with_interval(confusions: NDArray, metric: Metric) -> ScoreWithInterval:
    """Compute a score with its interval.

    Parameters
    ----------
    confusions : (S, V, C, C) int
        By seed and drive, see `drive_interval`.
    metric : callable
        Takes a confusion matrix (C, C), row: truth, and returns a number.
    """
    seeds = [float(metric(matrix)) for matrix in confusions.sum(axis=1)]
    return _with_interval(seeds, confusions.shape[1], lambda: drive_interval(confusions, metric))


def compared(a: NDArray, b: NDArray, metric: Metric) -> ScoreWithInterval:
    """Return the score of a minus the score of b, on the same seeds and drives.

    Parameters
    ----------
    a, b : (S, V, C, C) int
        By seed and drive, see `paired_interval`; (1, V, C, C) for a method without seeds.
    metric : callable
        Takes a confusion matrix (C, C), row: truth, and returns a number.
    """
    ours, theirs = np.broadcast_arrays(*([metric(matrix) for matrix in some.sum(axis=1)] for some in (a, b)))
    return _with_interval((ours - theirs).tolist(), a.shape[1], lambda: paired_interval(a, b, metric))


def _with_interval(seeds: list[float], n_drives: int, interval: Callable[[], Interval]) -> ScoreWithInterval:
    """Add the interval to a score; its ends are None if there are few drives or a class occurs in only one drive."""
    low = None
    mean = float(np.mean(seeds))
    high = None
    if n_drives >= MIN_DRIVES:
        with suppress(ArgumentError):
            low, mean, high = interval()
    defined = [None if np.isnan(seed) else seed for seed in seeds]
    return {"mean": None if np.isnan(mean) else mean, "low": low, "high": high, "seeds": defined}


def on_cells(confusions: NDArray, cells: str, label_set: LabelSet) -> NDArray[np.int64]:
    """Restrict confusion matrices to some of the cells.

    Parameters
    ----------
    confusions : (..., C, C) int
        One matrix or several, such as one per seed and drive.
    cells : str
        "all", or "semantic" for cells with a semantic true class.
    label_set : LabelSet
        The classes.

    Returns
    -------
    (..., C, C) int
    """
    if cells == "all":
        return confusions
    flat = confusions.reshape(-1, *confusions.shape[-2:])
    return np.stack([semantic_cells(matrix, label_set) for matrix in flat]).reshape(confusions.shape)


def every_metric(
    score: Callable[..., object], label_set: LabelSet, *confusions: NDArray
) -> dict[str, dict[str, object]]:
    """Return a score for every metric, over all cells and over cells with a semantic class.

    Parameters
    ----------
    score : callable
        Takes the confusion matrices and a metric: `score_with_interval` or, for two methods, `compared`.
    label_set : LabelSet
        The classes.
    *confusions : (..., C, C) int
        The matrices, passed to `score` before the metric.

    Returns
    -------
    dict
        Scores by cells ("all" or "semantic") and metric.
    """
    kept = {cells: [on_cells(one, cells, label_set) for one in confusions] for cells in ("all", "semantic")}
    return {cells: {name: score(*some, metric) for name, metric in METRICS.items()} for cells, some in kept.items()}


def shown(value: ScoreWithInterval, digits: int = 1) -> str:
    """Format a score in per cent: mean and interval.

    Parameters
    ----------
    value : ScoreWithInterval
        From `score_with_interval` or `compared`.
    digits : int
        Digits after the point.

    Examples
    --------
    >>> shown({"mean": 0.824, "low": 0.812, "high": 0.836, "seeds": [0.824]})
    '82.4 (81.2 to 83.6)'
    """
    mean, low, high = (per_cent(value[name], digits) for name in ("mean", "low", "high"))
    return mean if value["low"] is None else f"{mean} ({low} to {high})"


def shown_seeds(value: ScoreWithInterval, digits: int = 1) -> str:
    """Format every seed's value in per cent; with more than five seeds only the lowest and the highest.

    Parameters are those of `shown`.
    """
    seeds = [per_cent(one, digits) for one in value["seeds"]]
    if len(seeds) <= SHOWN_SEEDS:
        return ", ".join(seeds)
    return f"{min(seeds, key=float)} to {max(seeds, key=float)} ({len(seeds)} seeds)"


def per_cent(value: float | None, digits: int = 1) -> str:
    """Format a share in per cent.

    Parameters
    ----------
    value : float or None
        A share, 0..1; None if it is undefined.
    digits : int
        Digits after the point.
    """
    return "-" if value is None else f"{100 * value:.{digits}f}"


def markdown_table(rows: list[list[str]]) -> str:
    """Format rows as a Markdown table with columns that also align in plain text.

    Parameters
    ----------
    rows : list of list of str
        The cells of each row, header first.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first, *others in rows:
        cells = [f"{first:{widths[0]}}", *(f"{text:>{w}}" for text, w in zip(others, widths[1:], strict=True))]
        lines.append(f"| {' | '.join(cells)} |")
    lines.insert(1, f"|{'-' * (widths[0] + 2)}|" + "".join(f"{'-' * (w + 1)}:|" for w in widths[1:]))
    return "\n".join(lines)

"""A score with all that is known of it: mean, confidence interval, and every seed's value (section 4.2)."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.experiments.confusions import seed_confusions
from semgrid_edu.experiments.reproduction.score_runs import ScoreRun
from semgrid_edu.experiments.statistics import drive_interval, paired_interval
from semgrid_edu.labels import LabelSet
from semgrid_edu.metrics import METRICS, semantic_cells

Measured = dict[str, object]
"""The "mean" over the seeds, "low" and "high" of its 95 % interval, or None where one drive alone was scored, and the
value of each of the "seeds"."""

SHOWN_SEEDS = 5
"""Up to so many seeds each one's value is shown."""


def by_seed(
    runs: Sequence[ScoreRun], root: str | Path, method: str, truth: str, band: str | None = None
) -> NDArray[np.int64]:
    """Return the confusion matrices of a method, seed by seed and drive by drive.

    Parameters
    ----------
    runs : sequence of S ScoreRun
        The same network, trained with S seeds.
    root : path-like
        The folder of all runs.
    method, truth, band
        What to count, as `ScoreRun.confusions` takes them.

    Returns
    -------
    (S, V, C, C) int64
    """
    return seed_confusions([run.confusions(root, method, truth, band) for run in runs], method)


def measured(confusions: NDArray, metric: Callable[[NDArray], float]) -> Measured:
    """Return a score.

    Parameters
    ----------
    confusions : (S, V, C, C) int
        From `by_seed`.
    metric : callable
        Takes a confusion matrix and returns a number.
    """
    seeds = [float(metric(matrix)) for matrix in confusions.sum(axis=1)]
    return _with_interval(seeds, None if confusions.shape[1] < 2 else drive_interval(confusions, metric))


def compared(a: NDArray, b: NDArray, metric: Callable[[NDArray], float]) -> Measured:
    """Return the score of a minus that of b, on the same seeds and drives.

    Parameters
    ----------
    a, b : (S, V, C, C) int
        From `by_seed`.
    metric : callable
        Takes a confusion matrix and returns a number.
    """
    pairs = np.broadcast(a.sum(axis=1)[..., 0, 0], b.sum(axis=1)[..., 0, 0]).shape[0]
    seeds = [float(metric(a[s % len(a)].sum(axis=0)) - metric(b[s % len(b)].sum(axis=0))) for s in range(pairs)]
    return _with_interval(seeds, None if a.shape[1] < 2 else paired_interval(a, b, metric))


def _with_interval(seeds: list[float], interval: tuple[float, float, float] | None) -> Measured:
    low, _, high = interval or (None, None, None)
    return {"mean": float(np.mean(seeds)), "low": low, "high": high, "seeds": seeds}


def on_cells(confusions: NDArray, cells: str, label_set: LabelSet) -> NDArray[np.int64]:
    """Return confusion matrices of some of the cells.

    Parameters
    ----------
    confusions : (S, V, C, C) int
        From `by_seed`.
    cells : str
        "all", or "semantic" for those whose truth is a semantic class.
    label_set : LabelSet
        The classes.

    Returns
    -------
    (S, V, C, C) int
    """
    if cells == "all":
        return confusions
    flat = confusions.reshape(-1, *confusions.shape[2:])
    return np.stack([semantic_cells(matrix, label_set) for matrix in flat]).reshape(confusions.shape)


def all_metrics(confusions: NDArray, label_set: LabelSet) -> dict[str, dict[str, Measured]]:
    """Return every metric over all cells and over those with a semantic class.

    Parameters
    ----------
    confusions : (S, V, C, C) int
        From `by_seed`.
    label_set : LabelSet
        The classes.

    Returns
    -------
    dict
        By cells, "all" or "semantic", and by metric.
    """
    return {
        cells: {name: measured(on_cells(confusions, cells, label_set), metric) for name, metric in METRICS.items()}
        for cells in ("all", "semantic")
    }


def shown(value: Measured, digits: int = 1) -> str:
    """Return a score as text, per cent: mean and interval.

    Parameters
    ----------
    value : dict
        From `measured` or `compared`.
    digits : int
        Digits after the point.

    Returns
    -------
    str

    Examples
    --------
    >>> shown({"mean": 0.824, "low": 0.812, "high": 0.836, "seeds": [0.824]})
    '82.4 (81.2 to 83.6)'
    """
    mean = f"{100 * value['mean']:.{digits}f}"
    if value["low"] is None:
        return mean
    return f"{mean} ({100 * value['low']:.{digits}f} to {100 * value['high']:.{digits}f})"


def shown_seeds(value: Measured, digits: int = 1) -> str:
    """Return every seed's value as text, per cent; of many, the lowest and the highest.

    Parameters
    ----------
    value : dict
        From `measured` or `compared`.
    digits : int
        Digits after the point.

    Returns
    -------
    str
    """
    seeds = [f"{100 * one:.{digits}f}" for one in value["seeds"]]
    if len(seeds) <= SHOWN_SEEDS:
        return ", ".join(seeds)
    ends = (f"{100 * end:.{digits}f}" for end in (min(value["seeds"]), max(value["seeds"])))
    return f"{' to '.join(ends)} ({len(seeds)} seeds)"

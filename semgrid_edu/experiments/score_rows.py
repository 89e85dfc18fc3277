"""Rows of a table of results: a mean, its confidence interval, and the score of every seed (section 4.2)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.experiments.statistics import Interval, Metric, drive_interval, paired_interval

SHOWN_SEEDS = 5
"""Up to so many seeds each one's value is written out; of more, the smallest and the largest."""


class ScoreRow(NamedTuple):
    """What is known of one method's score, or of the difference between two.

    Parameters
    ----------
    name : str
        The method, or what is compared.
    interval : Interval
        The mean over the seeds and its confidence interval, in the unit of the metric.
    seeds : tuple of S float
        The value of each seed on all drives; their mean is that of the interval.
    """

    name: str
    interval: Interval
    seeds: tuple[float, ...]

    def text(self, scale: float = 100.0, digits: int = 1) -> str:
        """Return the row as text, without its name.

        Parameters
        ----------
        scale : float
            Factor of all numbers; 100 turns shares into per cent, and differences of shares into points.
        digits : int
            Number of digits after the point.

        Returns
        -------
        str
            Mean, interval in brackets, and with two seeds or more their values.

        Examples
        --------
        >>> ScoreRow("network", Interval(0.812, 0.824, 0.836), (0.822, 0.823, 0.827)).text()
        '82.4 (81.2 to 83.6); seeds 82.2, 82.3, 82.7'
        """
        low, mean, high, *seeds = (f"{scale * value:.{digits}f}" for value in (*self.interval, *self.seeds))
        text = f"{mean} ({low} to {high})"
        if len(seeds) > SHOWN_SEEDS:
            ends = (f"{scale * end:.{digits}f}" for end in (min(self.seeds), max(self.seeds)))
            return f"{text}; {len(seeds)} seeds {' to '.join(ends)}"
        return f"{text}; seeds {', '.join(seeds)}" if len(seeds) > 1 else text


def score_row(name: str, confusions: NDArray, metric: Metric, level: float = 0.95) -> ScoreRow:
    """Return the row of one method.

    Parameters
    ----------
    name : str
        The method.
    confusions : (S, V, C, C) int
        Its confusion matrices by seed and drive, see `drive_interval`.
    metric : callable
        Takes a confusion matrix (C, C) and returns a number.
    level : float
        How often the interval should hold the true value, between 0 and 1.

    Returns
    -------
    ScoreRow
    """
    return ScoreRow(name, drive_interval(confusions, metric, level), _by_seed(confusions, metric))


def gain_row(name: str, a: NDArray, b: NDArray, metric: Metric, level: float = 0.95) -> ScoreRow:
    """Return the row of the difference between two methods.

    Parameters
    ----------
    name : str
        What is compared, such as "network against majority class".
    a, b : (S, V, C, C) int
        Confusion matrices of the two by seed and drive, see `paired_interval`.
    metric : callable
        Takes a confusion matrix (C, C) and returns a number.
    level : float
        How often the interval should hold the true value, between 0 and 1.

    Returns
    -------
    ScoreRow
        Of metric(a) - metric(b), seed by seed.
    """
    of_a, of_b = np.broadcast_arrays(_by_seed(a, metric), _by_seed(b, metric))
    return ScoreRow(name, paired_interval(a, b, metric, level), tuple((of_a - of_b).tolist()))


def _by_seed(confusions: NDArray, metric: Metric) -> tuple[float, ...]:
    return tuple(float(metric(matrix)) for matrix in np.sum(confusions, axis=1))

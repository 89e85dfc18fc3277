"""Confidence intervals for scores and score differences, over drives and seeds (section 4.2)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize, special

from semgrid_edu.errors import ArgumentError

Metric = Callable[[NDArray], float]
"""A function of a confusion matrix (C, C), such as `pixel_accuracy`."""


MIN_DRIVES = 10
"""Fewer drives show too little of how drives vary, so tables get no interval and claims no verdict."""


class Interval(NamedTuple):
    """A mean and its confidence interval.

    Parameters
    ----------
    low, mean, high : float
        In the unit of the metric.
    """

    low: float
    mean: float
    high: float


class EstimatedMean(NamedTuple):
    """A mean over seeds and drives, and its variance, which give intervals and p-values.

    Parameters
    ----------
    mean : float
        The mean score, or the mean difference of two scores.
    variances : (float, float)
        V_s and V_d, the two components of the mean's variance: from the choice of seeds and from the choice of drives.
    sizes : (int, int)
        S and V, the numbers of seeds and drives.
    """

    mean: float
    variances: tuple[float, float]
    sizes: tuple[int, int]

    def half_width(self, level: float) -> float:
        """Return the half-width of the confidence interval, see `drive_interval`.

        Parameters
        ----------
        level : float
            The confidence level, between 0 and 1: how often such intervals should contain the true value.
        """
        variances = np.array(self.variances)
        freedom = [max(n - 1, 1) for n in self.sizes]
        t = special.stdtrit(freedom, (1 + level) / 2)  # quantiles of Student's distribution
        return float((t * variances).sum() / np.sqrt(variances.sum())) if variances.any() else 0.0

    def p_value(self, limit: float, above: bool) -> float:
        """Return the one-sided p-value of a claim that the true value is on one side of a limit.

        p is small if the mean is far on the other side. The interval with level 1 - 2 p ends exactly at the limit, so
        p-value and intervals never contradict each other.

        Parameters
        ----------
        limit : float
            The limit, in the unit of the mean.
        above : bool
            Whether the claim is that the true value is above the limit; otherwise below.
        """
        beyond = (limit - self.mean) if above else (self.mean - limit)
        if not any(self.variances):
            return 0.0 if beyond > 0 else 1.0
        nearly = 1 - 1e-12
        if abs(beyond) >= self.half_width(nearly):
            tail = (1 - nearly) / 2
        else:
            tail = (1 - optimize.brentq(lambda level: self.half_width(level) - abs(beyond), 0, nearly)) / 2
        return float(tail if beyond > 0 else 1 - tail)


def drive_estimate(confusions: ArrayLike, metric: Metric) -> EstimatedMean:
    """Return a method's mean score over its seeds, with variances. Parameters are those of `drive_interval`."""
    return _estimate(*_left_out(_checked("confusions", confusions), metric))


def paired_estimate(a: ArrayLike, b: ArrayLike, metric: Metric) -> EstimatedMean:
    """Return the mean score of a minus b, with variances. Parameters are those of `paired_interval`."""
    a = _checked("a", a)
    b = _checked("b", b)
    if a.shape[1:] != b.shape[1:] or (len(a) != len(b) and 1 not in (len(a), len(b))):
        raise ArgumentError("b", f"the seeds and drives of a, shape {a.shape}", f"shape {b.shape}")
    return _estimate(*(of_a - of_b for of_a, of_b in zip(_left_out(a, metric), _left_out(b, metric), strict=True)))


def drive_interval(confusions: ArrayLike, metric: Metric, level: float = 0.95) -> Interval:
    """Return a method's mean score over its seeds, and a confidence interval for it.

    **What it estimates.** Imagine training the same network on the same data with very many seeds, and testing each on
    very many new drives of the same kind. The score of one network is the metric of its summed confusion matrix, so
    drives with more labelled cells have more weight. The interval is for the mean of these scores. A single seed
    doesn't show how seeds vary; then the interval is for this one network on very many drives.

    **Method.** Frames of one drive are similar, so we resample drives, not frames. The jackknife leaves out one drive
    at a time, and the change of the score shows how much drives vary. The variance of the mean score has two
    components. V_s comes from the choice of seeds: the variance of the seeds' scores, divided by S. V_d comes from the
    choice of drives: the variance of the drives' contributions to the mean score, divided by V, minus the interaction
    of drives and seeds, because V_s already includes it. The half-width follows Cochran and Cox (Experimental Designs),

        (t_{S-1} V_s + t_{V-1} V_d) / sqrt(V_s + V_d),

    with quantiles t of Student's distribution. t_2 is 4.3, so with three seeds that differ, the interval is wide. In
    simulations with 20 drives and 3 seeds, from variation between drives only to variation between seeds only, 95 %
    intervals of the three metrics of section 4.2 contained the true value in 92 to 97.5 % of 2000 cases
    (`benchmarks/interval_coverage.py`).

    **Limits.** The interval doesn't cover other kinds of streets or other training data, because neither varies here.
    It isn't for the score of the next single network, which varies more than the mean of many. If a class occurs in few
    drives, its recall depends on these few, and so does the mean over classes: with a class in one of twenty drives,
    95 % intervals of class accuracy contained the true value in only 63 % of the cases. If an interval extends below 0
    or above 1, there are too few drives or seeds.

    Parameters
    ----------
    confusions : (S, V, C, C) int
        Confusion matrix per seed and drive, summed over the drive's frames, for S seeds and V >= 2 drives, see
        `seed_confusions`.
    metric : callable
        Takes a confusion matrix (C, C), row: truth, and returns a number.
    level : float
        The confidence level, between 0 and 1: how often such intervals should contain the true value.

    Returns
    -------
    low, mean, high : float
        The interval and the mean of the seeds' scores on all V drives.

    Raises
    ------
    ArgumentError
        When the shape is wrong, there are fewer than two drives, the level isn't between 0 and 1, or the metric isn't
        finite for all drives or for all but one.

    Examples
    --------
    Four drives of one network, with 80, 84, 78 and 82 of 100 cells correct:

    >>> one_network = [[[[right, 100 - right], [0, 0]] for right in (80, 84, 78, 82)]]
    >>> low, mean, high = drive_interval(one_network, lambda matrix: matrix[0, 0] / matrix.sum())
    >>> f"{low:.3f} {mean:.3f} {high:.3f}"
    '0.769 0.810 0.851'
    """
    return _interval(drive_estimate(confusions, metric), level)


def paired_interval(a: ArrayLike, b: ArrayLike, metric: Metric, level: float = 0.95) -> Interval:
    """Return the mean score of method a minus method b, and a confidence interval for it.

    Both methods are scored on the same drives, and seed s of a is paired with seed s of b. A drive that is hard for
    both lowers both scores and cancels in the difference. So this interval can be much narrower than the intervals of
    the two scores, and two methods can differ clearly even if their intervals overlap.

    The interval is for the mean of metric(a) - metric(b) over new seeds and very many new drives. Method and limits are
    the same as in `drive_interval`, applied to the differences.

    Parameters
    ----------
    a, b : (S, V, C, C) int
        Confusion matrices of the two methods on the same drives, as for `drive_interval`. The shape is (1, V, C, C) for
        a method that doesn't depend on the seed, such as a baseline without training.
    metric : callable
        Takes a confusion matrix (C, C), row: truth, and returns a number.
    level : float
        The confidence level, between 0 and 1: how often such intervals should contain the true value.

    Returns
    -------
    low, mean, high : float
        The difference, above zero if a is better, and its interval.

    Raises
    ------
    ArgumentError
        When a and b differ in drives or number of seeds, and as in `drive_interval`.
    """
    return _interval(paired_estimate(a, b, metric), level)


def _checked(name: str, confusions: ArrayLike) -> NDArray:
    """Return the matrices as an array, or raise an error with the reason why no interval is possible."""
    matrices = np.asarray(confusions)
    if matrices.ndim != 4 or matrices.shape[2] != matrices.shape[3] or not len(matrices):
        raise ArgumentError(name, "confusion matrices (S, V, C, C) of S seeds on V drives", f"shape {matrices.shape}")
    if matrices.shape[1] < 2:
        expected = "two drives or more, because one doesn't show how drives differ"
        raise ArgumentError(name, expected, matrices.shape[1])
    return matrices


def _left_out(confusions: NDArray, metric: Metric) -> tuple[NDArray, NDArray]:
    """Return each seed's metric on all drives (S,), and with each drive left out (S, V): a jackknife over drives."""
    totals = confusions.sum(axis=1)
    scores = np.array([metric(total) for total in totals])
    without = np.array([[metric(matrix) for matrix in matrices] for matrices in totals[:, None] - confusions])
    if not (np.isfinite(scores).all() and np.isfinite(without).all()):
        raise ArgumentError("metric", "a finite number for all drives, and for all but one of them", "NaN or infinity")
    return scores, without


def _estimate(scores: NDArray, without: NDArray) -> EstimatedMean:
    """Return the estimate from each seed's metric on all drives (S,), and with each drive left out (S, V)."""
    return EstimatedMean(float(scores.mean()), _variances(scores, without), without.shape)


def _interval(estimate: EstimatedMean, level: float) -> Interval:
    if not 0 < level < 1:
        raise ArgumentError("level", "a share between 0 and 1, such as 0.95", level)
    half = estimate.half_width(level)
    return Interval(estimate.mean - half, estimate.mean, estimate.mean + half)


def _variances(scores: NDArray, without: NDArray) -> tuple[float, float]:
    """Return V_s and V_d, the components of the mean score's variance from seeds and from drives."""
    n_seeds, n_drives = without.shape
    parts = (n_drives - 1) * (without.mean(axis=1, keepdims=True) - without)  # per seed and drive
    of_drives = parts.mean(axis=0).var(ddof=1) / n_drives
    if n_seeds == 1:
        return 0.0, float(of_drives)
    of_both = parts.var(axis=0, ddof=1).sum() / (n_drives - 1) / n_seeds / n_drives
    return float(scores.var(ddof=1) / n_seeds), float(max(of_drives - of_both, 0.0))

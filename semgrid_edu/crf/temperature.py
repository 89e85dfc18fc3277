"""Calibration: a network's accuracy by its confidence, and the temperature that corrects it (eq. (3))."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import log_softmax, softmax

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE

COLDEST, HOTTEST = 0.01, 100.0
"""The temperatures between which `fit_temperature` searches."""

SUM_TOLERANCE = 1e-3
"""How far the probabilities of a cell may be from a sum of 1: float32 networks round."""


class Reliability(NamedTuple):
    """A classifier's accuracy by its confidence: the columns of a reliability diagram.

    Parameters
    ----------
    confidence : (B,) float64
        Mean probability of the most probable class, over the cells of each bin; 0 in an empty bin.
    accuracy : (B,) float64
        Share of these cells in which that class is right; 0 in an empty bin.
    cells : (B,) int64
        Number of cells in each bin.
    """

    confidence: NDArray[np.float64]
    accuracy: NDArray[np.float64]
    cells: NDArray[np.int64]


def at_temperature(log_probability: ArrayLike, temperature: float) -> NDArray:
    """Make a distribution less confident (temperature above 1) or more (below 1): soft-max of log p / T.

    The order of the classes doesn't change, so the most probable class is the same.

    Parameters
    ----------
    log_probability : (C, ...) float
        log p, natural logarithms; -inf for a class of probability 0.
    temperature : float
        T, positive.

    Returns
    -------
    (C, ...) float
        Logarithms of the new distribution, in the type of the argument.

    Raises
    ------
    ArgumentError
        When T isn't a positive number, or exp(log p) isn't a distribution in each cell.

    Examples
    --------
    >>> np.exp(at_temperature(np.log([0.8, 0.2]), 2.0)).round(3)
    array([0.667, 0.333])
    """
    if not (np.isfinite(temperature) and temperature > 0):
        raise ArgumentError("temperature", "a positive number", temperature)
    log_p = np.asarray(log_probability)
    _check_distribution("log_probability", log_p, np.exp)
    return log_softmax(log_p / float(temperature), axis=0)


def fit_temperature(log_probability: ArrayLike, truth: ArrayLike, ignore: int = IGNORE) -> float:
    """Return the temperature that makes the truth most likely (Guo et al. 2017, "temperature scaling").

    With b = 1 / T, the loss logsumexp(b log p) - b log p(truth) is convex in b, and its derivative is the mean of log p
    under the scaled distribution minus log p(truth). The best b is where the mean of this over all cells crosses zero.

    Parameters
    ----------
    log_probability : (C, ...) float
        log p, natural logarithms, of cells that the classifier has not learned from. (On its own training data a
        classifier is right more often than elsewhere, and the temperature comes out too low.)
    truth : (...) int
        The class of each cell.
    ignore : int
        Class number of what is unlabelled, which counts nowhere.

    Returns
    -------
    float
        T, from 0.01 to 100.

    Raises
    ------
    ArgumentError
        When the shapes don't fit, a label is no class, no cell is labelled, exp(log p) isn't a distribution in each
        labelled cell, a probability is 0, or the best temperature is outside this range: when every cell is right, or
        log p has nothing to do with the truth.

    Examples
    --------
    Four cells at 99 %, one of them wrong: at the right temperature they are at 75 %.

    >>> log_p = np.log([[0.99] * 4, [0.01] * 4])
    >>> T = fit_temperature(log_p, [0, 0, 0, 1])
    >>> np.exp(at_temperature(log_p, T))[0].round(4)
    array([0.75, 0.75, 0.75, 0.75])
    """
    columns, classes = _labelled("log_probability", log_probability, truth, ignore)
    if not np.isfinite(columns).all():
        raise ArgumentError("log_probability", "finite logarithms", "infinity or NaN: a class of probability 0?")
    _check_distribution("log_probability", columns, np.exp)
    columns = columns.astype(np.float64)
    of_truth = columns[classes, np.arange(len(classes))].mean()

    def slope(b: float) -> float:
        return (softmax(b * columns, axis=0) * columns).sum(axis=0).mean() - of_truth

    ends = 1 / HOTTEST, 1 / COLDEST
    if not slope(ends[0]) < 0 < slope(ends[1]):
        found = "every cell right" if slope(ends[0]) < 0 else "log p that tells nothing about the truth"
        raise ArgumentError("truth", f"a best temperature between {COLDEST} and {HOTTEST}", found)
    return float(1 / brentq(slope, *ends, xtol=1e-9, rtol=1e-9))


def reliability(probability: ArrayLike, truth: ArrayLike, n_bins: int = 15, ignore: int = IGNORE) -> Reliability:
    """Bin cells by the probability of their most probable class, and count how often it is right.

    Parameters
    ----------
    probability : (C, ...) float
        The distribution over the classes in each cell.
    truth : (...) int
        The class of each cell.
    n_bins : int
        B, the number of bins of equal width between 0 and 1; each includes its upper end.
    ignore : int
        Class number of what is unlabelled, which counts nowhere.

    Returns
    -------
    Reliability
        Confidence, accuracy and number of cells of each bin. For a calibrated classifier the first two are equal.

    Raises
    ------
    ArgumentError
        When the shapes don't fit, a label is no class, no cell is labelled, a labelled cell has no distribution, or
        there is no bin.
    """
    columns, classes = _labelled("probability", probability, truth, ignore)
    if n_bins < 1:
        raise ArgumentError("n_bins", "at least one bin", n_bins)
    _check_distribution("probability", columns, np.positive)
    confident = columns.max(axis=0).astype(np.float64)
    bins = np.clip(np.ceil(confident * n_bins).astype(int) - 1, 0, n_bins - 1)
    right = columns.argmax(axis=0) == classes
    cells, confidence, accuracy = (np.bincount(bins, weights, n_bins) for weights in (None, confident, right))
    shared = np.maximum(cells, 1)
    return Reliability(confidence / shared, accuracy / shared, cells)


def expected_calibration_error(diagram: Reliability) -> float:
    """Return the mean gap between confidence and accuracy over all cells, ECE (Naeini et al. 2015).

    Parameters
    ----------
    diagram : Reliability
        From `reliability`.

    Returns
    -------
    float
        0..1; 0 for a calibrated classifier.
    """
    return float(diagram.cells @ np.abs(diagram.confidence - diagram.accuracy) / diagram.cells.sum())


def _check_distribution(name: str, values: NDArray, to_probability: Callable[[NDArray], NDArray]) -> None:
    """Check that the values of each cell, (C, ...), are probabilities that sum to 1, or their logarithms."""
    with np.errstate(over="ignore", invalid="ignore"):
        probability = to_probability(values.astype(np.float64))
        total = probability.sum(axis=0)
    wrong = ~(np.abs(total - 1) <= SUM_TOLERANCE) | (probability < 0).any(axis=0)
    if wrong.any():
        what = "logarithms of probabilities" if to_probability is np.exp else "probabilities"
        raise ArgumentError(
            name, f"{what} that sum to 1 in each cell", f"a cell with {values[:, wrong][:, 0].tolist()}"
        )


def _labelled(name: str, columns: ArrayLike, truth: ArrayLike, ignore: int) -> tuple[NDArray, NDArray[np.int64]]:
    """Return the columns (C, N) and the classes (N,) of the labelled cells, after checking that they fit."""
    columns = np.asarray(columns)
    truth = np.asarray(truth)
    if columns.ndim == 0 or columns.shape[1:] != truth.shape:
        raise ArgumentError(name, f"shape (C, {', '.join(map(str, truth.shape))})", f"shape {columns.shape}")
    kept = truth != ignore
    labels = truth[kept]
    fractional = labels != np.round(labels)  # true of NaN as well
    if fractional.any():
        raise ArgumentError("truth", "whole numbers, the classes", labels[fractional][0])
    classes = labels.astype(np.int64)
    if not len(classes):
        raise ArgumentError("truth", "at least one labelled cell", f"{ignore} everywhere")
    if not (classes.min() >= 0 and classes.max() < len(columns)):
        raise ArgumentError("truth", f"classes 0..{len(columns) - 1}", f"{classes.min()}..{classes.max()}")
    return columns[:, kept], classes

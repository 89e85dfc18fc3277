"""Calibration: how often a classifier is right, by how confident it is (reliability diagrams, section 4.2)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE

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


def reliability(probability: ArrayLike, truth: ArrayLike, n_bins: int = 15) -> Reliability:
    """Bin cells by the probability of their most probable class, and count how often it is right.

    Parameters
    ----------
    probability : (C, ...) float
        The distribution over the classes in each cell.
    truth : (...) int
        The class of each cell; 255 where unlabelled.
    n_bins : int
        B, the number of bins of equal width between 0 and 1; each includes its upper end, up to rounding.

    Returns
    -------
    Reliability
        Confidence, accuracy and number of cells of each bin. For a calibrated classifier the first two are equal.

    Raises
    ------
    ArgumentError
        When the shapes don't fit, no cell is labelled, or a labelled cell has no distribution.
    """
    truth = np.asarray(truth)
    probability = np.asarray(probability)
    if probability.shape[1:] != truth.shape:
        raise ArgumentError("probability", f"shape (C, {', '.join(map(str, truth.shape))})", probability.shape)
    labelled = truth != IGNORE
    if not labelled.any():
        raise ArgumentError("truth", "at least one labelled cell", f"{IGNORE} everywhere")
    probability = probability[:, labelled]
    wrong = ~(np.abs(probability.sum(axis=0, dtype=np.float64) - 1) <= SUM_TOLERANCE) | (probability < 0).any(axis=0)
    if wrong.any():
        found = f"a cell with {probability[:, wrong][:, 0].tolist()}"
        raise ArgumentError("probability", "probabilities that sum to 1 in each cell", found)
    confident = probability.max(axis=0).astype(np.float64)
    right = probability.argmax(axis=0) == truth[labelled]
    bins = np.clip(np.ceil(confident * n_bins).astype(int) - 1, 0, n_bins - 1)
    cells = np.bincount(bins, minlength=n_bins)
    return reliability_of_sums(
        np.stack([cells, np.bincount(bins, confident, n_bins), np.bincount(bins, right, n_bins)])
    )


def reliability_sums(diagram: Reliability) -> NDArray[np.float64]:
    """Return what can be added up over frames: the number of cells, their confidences, and the right ones, (3, B).

    Parameters
    ----------
    diagram : Reliability
        From `reliability`.
    """
    return np.stack([diagram.cells, diagram.confidence * diagram.cells, diagram.accuracy * diagram.cells])


def reliability_of_sums(sums: NDArray) -> Reliability:
    """Return a method's accuracy by its confidence.

    Parameters
    ----------
    sums : (3, B) float
        From `reliability_sums`, or the sum of several.
    """
    cells, confidence, right = sums
    divisor = np.maximum(cells, 1)  # an empty bin has weight 0
    return Reliability(confidence / divisor, right / divisor, cells.astype(np.int64))


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

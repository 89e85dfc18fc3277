"""The paper's metrics (section 4.2), each from a confusion matrix, and how far apart two distributions are."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE, LabelSet


def confusion_matrix(truth: ArrayLike, predicted: ArrayLike, n_classes: int, ignore: int = IGNORE) -> NDArray[np.int64]:
    """Count how often each true class is predicted as each class.

    The matrices of several frames can be added. The metrics of a data set are computed from the sum.

    Parameters
    ----------
    truth, predicted : (...) int
        The class of each cell (or pixel), 0 .. n_classes - 1.
    n_classes : int
        Number of classes, C.
    ignore : int
        Class number of unlabelled cells. They aren't counted, whatever is predicted there.

    Returns
    -------
    (C, C) int64
        Row: truth; column: prediction.

    Examples
    --------
    >>> confusion_matrix([0, 0, 1, 255], [0, 1, 1, 0], n_classes=2)
    array([[1, 1],
           [0, 1]])
    """
    truth = np.asarray(truth)
    predicted = np.asarray(predicted)
    if truth.shape != predicted.shape:
        raise ArgumentError("predicted", f"the shape of truth, {truth.shape}", predicted.shape)
    labelled = truth != ignore
    truth = _classes("truth", truth[labelled], n_classes)
    predicted = _classes("predicted", predicted[labelled], n_classes)
    return np.bincount(truth * n_classes + predicted, minlength=n_classes**2).reshape(n_classes, n_classes)


def _classes(name: str, labels: NDArray, n_classes: int) -> NDArray[np.int64]:
    """Return the labels as int64, after checking that they are classes."""
    if labels.size and not np.issubdtype(labels.dtype, np.integer):
        raise ArgumentError(name, "integer classes", f"type {labels.dtype}")
    if labels.size and not (labels.min() >= 0 and labels.max() < n_classes):
        raise ArgumentError(name, f"classes 0..{n_classes - 1} in labelled cells", f"{labels.min()}..{labels.max()}")
    return labels.astype(np.int64)


def semantic_cells(confusion: ArrayLike, label_set: LabelSet) -> NDArray[np.int64]:
    """Keep only the cells whose truth is a semantic class.

    Most cells are unknown, and they are the easiest to get right, because the occupancy grid shows which they are.
    Without them a metric measures the semantic classes alone. A semantic cell that is predicted as unknown still counts
    as wrong.

    Parameters
    ----------
    confusion : (C, C) int
        Row: truth; column: prediction.
    label_set : LabelSet
        Its first `n_semantic` classes are the semantic ones.

    Returns
    -------
    (C, C) int64
        The same matrix with zeros in the rows of the other classes.
    """
    kept = _matrix(confusion).copy()
    if len(kept) != len(label_set):
        wanted = f"a row for each of the {len(label_set)} classes of {label_set.name}"
        raise ArgumentError("confusion", wanted, len(kept))
    kept[label_set.n_semantic :] = 0
    return kept


def pixel_accuracy(confusion: ArrayLike) -> float:
    """Return the share of labelled cells that are predicted correctly, 0..1; NaN when no cell is labelled.

    Parameters
    ----------
    confusion : (C, C) int
        How often each true class (row) is predicted as each class (column).
    """
    matrix = _matrix(confusion)
    return _ratio(np.trace(matrix), matrix.sum())


def class_accuracy(confusion: ArrayLike) -> float:
    """Return the mean over classes of the share of a class's cells that are predicted correctly, 0..1.

    Classes without cells in the truth are left out of the mean; NaN when no cell is labelled. Parameters are those of
    `pixel_accuracy`.
    """
    matrix = _matrix(confusion)
    cells = matrix.sum(axis=1)
    present = cells > 0
    return _ratio((np.diag(matrix)[present] / cells[present]).sum(), present.sum())


def frequency_weighted_iou(confusion: ArrayLike) -> float:
    """Return FmIoU: the mean over classes of intersection over union, weighted by frequency, 0..1.

    With N labelled cells, n_c cells of class c, m_c predictions of it and TP_c correct ones, it is sum_c n_c / N * TP_c
    / (n_c + m_c - TP_c); NaN when no cell is labelled. Parameters are those of `pixel_accuracy`.
    """
    matrix = _matrix(confusion)
    cells = matrix.sum(axis=1)
    hits = np.diag(matrix)
    present = cells > 0
    union = cells + matrix.sum(axis=0) - hits
    return _ratio((cells[present] * hits[present] / union[present]).sum(), cells.sum())


def class_iou(confusion: ArrayLike) -> NDArray[np.float64]:
    """Return the intersection over union of each class, (C,), 0..1; NaN for a class in neither truth nor prediction.

    TP_c / (n_c + m_c - TP_c), see `frequency_weighted_iou`. Parameters are those of `pixel_accuracy`.
    """
    matrix = _matrix(confusion)
    hits = np.diag(matrix)
    union = matrix.sum(axis=1) + matrix.sum(axis=0) - hits
    return np.divide(hits, union, out=np.full(len(hits), np.nan), where=union > 0)


def _matrix(confusion: ArrayLike) -> NDArray:
    """Return the confusion matrix as an array, or raise an error that explains why it isn't one."""
    matrix = np.asarray(confusion)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ArgumentError("confusion", "a square matrix, row: truth", f"shape {matrix.shape}")
    return matrix


def _ratio(part: float, whole: float) -> float:
    return float(part / whole) if whole else float("nan")


METRICS = {"pixel accuracy": pixel_accuracy, "class accuracy": class_accuracy, "FmIoU": frequency_weighted_iou}
"""The three metrics of section 4.2, by the names that tables give them."""


def total_variation(p: ArrayLike, q: ArrayLike) -> NDArray[np.float64]:
    """Return how far two distributions are apart, ``sum |p - q| / 2``: the most by which they disagree about any event.

    Parameters
    ----------
    p, q : (..., K) float
        Distributions along the last axis.

    Examples
    --------
    >>> total_variation([0.5, 0.5], [0.9, 0.1]).round(6)
    np.float64(0.4)
    """
    return np.abs(np.asarray(p) - q).sum(axis=-1) / 2

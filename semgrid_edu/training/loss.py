"""The loss: cross-entropy under median frequency balancing, so that rare classes count (paper, section 4.1)."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_softmax
from torch import Tensor, nn

from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.training.batches import Batch, grid_logits, image_scores

if TYPE_CHECKING:
    from lightning_fabric import Fabric

TRUTH = {"image": "labels", "grid": "truth"}
"""The field of `Sample` that each stage learns from."""


def class_frequencies(maps: Iterable[NDArray], n_classes: int) -> NDArray[np.float64]:
    """Return f(c) = (number of cells of class c) / (number of cells of the maps in which c occurs), section 4.1.

    Parameters
    ----------
    maps : iterable of (...) int
        Grids or images of classes. Unlabelled cells, 255, are counted neither in the numerator nor in the denominator.
    n_classes : int
        C, the number of classes.

    Returns
    -------
    (C,) float64
        A share, 0..1; 0 for a class that occurs in no map.

    Examples
    --------
    >>> class_frequencies([[0, 0, 0, 1], [0, 0, 0, 0]], n_classes=3)
    array([0.875, 0.25 , 0.   ])
    """
    cells_of = np.zeros(n_classes)
    cells_where_it_occurs = np.zeros(n_classes)
    for number, classes in enumerate(maps):
        labelled = np.asarray(classes)[np.asarray(classes) != IGNORE]
        if labelled.size and not (labelled.min() >= 0 and labelled.max() < n_classes):
            found = f"{labelled.min()}..{labelled.max()} in map {number}"
            raise ArgumentError("maps", f"classes 0..{n_classes - 1} or {IGNORE}", found)
        counts = np.bincount(labelled.astype(np.int64), minlength=n_classes)
        cells_of += counts
        cells_where_it_occurs += (counts > 0) * labelled.size
    return np.divide(cells_of, cells_where_it_occurs, out=np.zeros(n_classes), where=cells_of > 0)


def median_frequency_weights(maps: Iterable[NDArray], n_classes: int, limit: float = math.inf) -> NDArray[np.float64]:
    """Return the weights alpha_c = (median of f) / f(c) of the classes in the loss (section 4.1).

    Rare classes get large weights, so that predicting the frequent classes everywhere doesn't give a low loss.

    Parameters
    ----------
    maps : iterable of (...) int
        Grids or images of classes, as for `class_frequencies`.
    n_classes : int
        C, the number of classes.
    limit : float
        No weight is above `limit` or below 1 / `limit`. The paper has no limit.

    Returns
    -------
    (C,) float64
        0 for a class that occurs in no map; such a class isn't part of the median.

    Examples
    --------
    >>> median_frequency_weights([[0, 0, 0, 1], [0, 0, 0, 2]], n_classes=4)
    array([0.33333333, 1.        , 1.        , 0.        ])
    """
    f = class_frequencies(maps, n_classes)
    occurs = f > 0
    if not occurs.any():
        raise ArgumentError("maps", "at least one labelled cell or pixel", "none")
    alpha = np.zeros(n_classes)
    alpha[occurs] = np.clip(np.median(f[occurs]) / f[occurs], 1 / limit, limit)
    return alpha


def class_weights(dataset: Sequence[Sample], stage: str, n_classes: int, limit: float) -> Tensor:
    """Return the weight of each class in the loss of a stage.

    Parameters
    ----------
    dataset : sequence of Sample
        The frames to learn from.
    stage : str
        "image" for the labels of pixels, "grid" for the true classes of cells.
    n_classes : int
        C, the number of classes.
    limit : float
        The largest weight, as for `median_frequency_weights`.

    Returns
    -------
    (C,) float32
        alpha_c, 0 for a class that occurs in no frame.
    """
    maps = (getattr(sample, TRUTH[stage]).numpy() for sample in dataset)
    try:
        return torch.from_numpy(median_frequency_weights(maps, n_classes, limit)).float()
    except ArgumentError as error:
        _, expected, found = error.args
        raise ArgumentError(f"{TRUTH[stage]} of the dataset", expected, found) from None


def weighted_cross_entropy(scores: ArrayLike, truth: ArrayLike, alpha: ArrayLike) -> float:
    """Compute the loss of section 4.1: cross-entropy of the labelled pixels or cells, weighted by class.

    L = sum_j alpha[c_j] (-log g_j[c_j]) / sum_j alpha[c_j], where j runs over the labelled cells, c_j is the true class
    of cell j, and g_j the soft-max of its scores. It is a mean of -log g in which rare classes have more weight.

    Parameters
    ----------
    scores : (B, C, ...) float
        Scores of each class before any soft-max, such as s of images (B, C, h, w) or logits of grids (B, C, H, W).
    truth : (B, ...) int
        The true class of each pixel or cell, 0 .. C - 1; 255 where it is unlabelled.
    alpha : (C,) float
        The weight of each class, from `median_frequency_weights`.

    Returns
    -------
    float
        Nats. 0 when nothing is labelled, or only classes of weight 0: there is nothing to learn.

    Raises
    ------
    ArgumentError
        If the shapes don't match, or `truth` contains anything but classes and 255.

    Examples
    --------
    Two cells with even scores: -log 1/2 = 0.693, whatever the weights.

    >>> round(weighted_cross_entropy(np.zeros((1, 2, 2)), [[0, 1]], alpha=[1, 3]), 3)
    0.693
    """
    scores, alpha = (np.asarray(part, dtype=np.float64) for part in (scores, alpha))
    truth = np.asarray(truth)
    _check_loss_inputs(scores, truth, alpha)
    labelled = truth != IGNORE
    c = truth[labelled]
    log_g = log_softmax(np.moveaxis(scores, 1, -1)[labelled], axis=1)  # one row per labelled cell, one column per class
    weights = alpha[c]
    losses = -log_g[np.arange(len(c)), c]
    return float((weights * losses).sum() / weights.sum()) if weights.any() else 0.0


def _check_loss_inputs(scores: NDArray, truth: NDArray, alpha: NDArray) -> None:
    """Check that scores (B, C, ...), truth (B, ...) and weights (C,) fit each other."""
    if scores.ndim < 2 or truth.shape != scores.shape[:1] + scores.shape[2:]:
        found = f"scores of shape {scores.shape}, truth of shape {truth.shape}"
        raise ArgumentError("truth", "shape (B, ...) for scores of shape (B, C, ...)", found)
    n_classes = scores.shape[1]
    if alpha.shape != (n_classes,):
        raise ArgumentError("alpha", f"shape ({n_classes},), one weight per class", f"shape {alpha.shape}")
    if truth.dtype.kind not in "iu":
        raise ArgumentError("truth", "integers, the numbers of classes", truth.dtype)
    wrong = truth[(truth != IGNORE) & ((truth < 0) | (truth >= n_classes))]
    if wrong.size:
        raise ArgumentError("truth", f"classes 0..{n_classes - 1} or {IGNORE}", wrong[0])


def cross_entropy_sums(scores: Tensor, truth: Tensor, alpha: Tensor) -> tuple[Tensor, Tensor]:
    """Return numerator and denominator of `weighted_cross_entropy`, fast and differentiable (section 4.1).

    They are separate because several processes can share a batch: its loss is the quotient of the sums over all of
    them.

    Parameters
    ----------
    scores : (B, C, ...) float
        Scores of each class before any soft-max.
    truth : (B, ...) int
        The true class of each pixel or cell; 255 where it is unlabelled.
    alpha : (C,) float
        The weight of each class.

    Returns
    -------
    losses : () float
        sum_j alpha[c_j] (-log g_j[c_j]), nats.
    weights : () float
        sum_j alpha[c_j]; it has no gradient.
    """
    scores = scores.to(torch.promote_types(scores.dtype, torch.float32))  # mixed precision sums in float32
    alpha = alpha.to(scores)
    truth = truth.long()
    losses = F.cross_entropy(scores, truth, weight=alpha, ignore_index=IGNORE, reduction="sum")
    return losses, alpha[truth[truth != IGNORE]].sum()


def process_loss(fabric: "Fabric", losses: Tensor, weights: Tensor) -> Tensor:
    """Return this process's part of the loss, such that the mean over processes is the loss of the whole batch.

    Distributed training averages the gradients over the processes. With one process the part is the loss itself, losses
    / weights.

    Parameters
    ----------
    fabric : lightning_fabric.Fabric
        The processes.
    losses : () float
        Sum of the weighted losses in this process, nats.
    weights : () float
        Sum of the weights in this process.

    Returns
    -------
    () float
        0 if no process has any weight: nothing can be learnt from such a batch, and 0/0 would stop the run.
    """
    total = fabric.all_reduce(weights.clone(), reduce_op="sum")
    return fabric.world_size * losses / total.clamp_min(torch.finfo(total.dtype).tiny)


class Objective(nn.Module):
    """The objective of one stage of training: the weighted cross-entropy of a batch, as its two sums.

    It is a module because Fabric shares gradients among processes through the forward pass of a module.

    Parameters
    ----------
    net : SemanticGridNet
        The network that learns.
    stage : str
        "image" for the scores of pixels, "grid" for the logits of cells.
    alpha : (C,) float
        The weight of each class, from `class_weights`.
    """

    def __init__(self, net: SemanticGridNet, stage: str, alpha: Tensor) -> None:
        super().__init__()
        self.net = net
        self.stage = stage
        self.register_buffer("alpha", alpha)

    def forward(self, batch: Batch) -> tuple[Tensor, Tensor]:
        """Return the two sums whose quotient is the loss of a batch, see `cross_entropy_sums`.

        Parameters
        ----------
        batch : Batch
            The frames of a step, on the device of the network.

        Returns
        -------
        losses, weights : () float
            The sum of the weighted losses, nats, and the sum of the weights.
        """
        scores = (image_scores if self.stage == "image" else grid_logits)(self.net, batch)
        return cross_entropy_sums(scores, getattr(batch.frames, TRUTH[self.stage]), self.alpha)

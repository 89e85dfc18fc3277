"""The loss: cross-entropy under median frequency balancing, so that rare classes count (paper, section 4.1)."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.training.batches import Batch, grid_logits, image_scores
from semgrid_edu.training.distributed import process_total, world_size

TRUTH = {"image": "labels", "grid": "truth"}
"""What each stage learns from: the field of `Sample`."""


def class_frequencies(maps: Iterable[NDArray], n_classes: int) -> NDArray[np.float64]:
    """Return f(c) = cells of c / cells of the maps in which c occurs (paper, section 4.1).

    Parameters
    ----------
    maps : sequence of (...) int
        Grids or images of classes; unlabelled cells, 255, count neither above nor below.
    n_classes : int
        C.

    Returns
    -------
    (C,) float64
        0 for a class that occurs in no map.

    Raises
    ------
    ArgumentError
        When a map holds a number that is neither a class nor 255.

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
    """Return the weights alpha_c = median f / f(c) that keep frequent classes from buying the loss (section 4.1).

    Parameters
    ----------
    maps : sequence of (...) int
        As for `class_frequencies`.
    n_classes : int
        C.
    limit : float
        No weight is above `limit` or below 1 / `limit`. The paper has none.

    Returns
    -------
    (C,) float64
        0 for a class that occurs in no map; it isn't part of the median.

    Raises
    ------
    ArgumentError
        When no cell is labelled, or a map holds something else than classes.

    Examples
    --------
    >>> median_frequency_weights([[0, 0, 0, 1], [0, 0, 0, 2]], n_classes=4)
    array([0.33333333, 1.        , 1.        , 0.        ])
    """
    f = class_frequencies(maps, n_classes)
    occurs = f > 0
    if not occurs.any():
        raise ArgumentError("maps", "at least one labelled cell", "none")
    alpha = np.zeros(n_classes)
    alpha[occurs] = np.clip(np.median(f[occurs]) / f[occurs], 1 / limit, limit)
    return alpha


def class_weights(dataset: Sequence[Sample], stage: str, n_classes: int, limit: float) -> Tensor:
    """Return the loss's weight of each class in a stage.

    Parameters
    ----------
    dataset : sequence of Sample
    stage : str
        "image" or "grid".
    n_classes, limit
        As for `median_frequency_weights`.

    Returns
    -------
    (C,) float32

    Raises
    ------
    ArgumentError
        When nothing is labelled, or with something else than classes.
    """
    maps = (getattr(sample, TRUTH[stage]).numpy() for sample in dataset)
    try:
        return torch.from_numpy(median_frequency_weights(maps, n_classes, limit)).float()
    except ArgumentError as error:
        _, expected, found = error.args
        raise ArgumentError(f"{TRUTH[stage]} of the dataset", expected, found) from None


class Objective(nn.Module):
    """The loss of a stage: cross-entropy, weighted by class, over the labelled pixels or cells of a batch.

    It is a module because `DistributedDataParallel` works through the forward pass of one.

    Parameters
    ----------
    net : SemanticGridNet
    stage : str
        "image" or "grid".
    alpha : (C,) float
        The weights of the classes.
    """

    def __init__(self, net: SemanticGridNet, stage: str, alpha: Tensor) -> None:
        super().__init__()
        self.net, self.stage, self.alpha = net, stage, alpha

    def forward(self, batch: Batch) -> Tensor:
        """Return sum_j alpha_c(j) (-log g_c(j)) / sum_j alpha_c(j), c(j) being the true class of pixel or cell j.

        With several processes, whose mean is taken, the lower sum is over the batches of all of them. A batch in
        which nothing is labelled teaches nothing: its loss is 0, not 0/0.
        """
        scores = (image_scores if self.stage == "image" else grid_logits)(self.net, batch)
        scores = scores.to(torch.promote_types(scores.dtype, torch.float32))  # of mixed precision
        alpha = self.alpha.to(scores)
        truth = getattr(batch.frames, TRUTH[self.stage]).long()
        weights = process_total(alpha[truth[truth != IGNORE]].sum())
        losses = F.cross_entropy(scores, truth, weight=alpha, ignore_index=IGNORE, reduction="sum")
        return world_size() * losses / weights.clamp_min(torch.finfo(weights.dtype).tiny)

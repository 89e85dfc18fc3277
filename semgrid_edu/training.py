"""Learning from few frames: median frequency balancing and the training loop (paper, section 4.1)."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor
from tqdm.auto import trange

from semgrid_edu.batches import Batch, draw_batch, grid_logits, image_scores
from semgrid_edu.checkpoint import load_checkpoint, save_checkpoint
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.errors import ArgumentError
from semgrid_edu.files import write_text
from semgrid_edu.labels import IGNORE
from semgrid_edu.memory import keep_freed_memory
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, SemanticGridNet, save_net
from semgrid_edu.occupancy import N_STATES

CHECKPOINT, LOG = "checkpoint.safetensors", "log.csv"
LOG_HEADER = "iteration,stage,learning_rate,loss\n"
CHECKPOINT_EVERY = 100
"""Iterations between checkpoints: some twenty seconds of work is lost at most."""

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


@dataclass(frozen=True)
class TrainingParams:
    """How the network learns: first the image network on image labels, then all of it on the grid, end to end.

    The first stage stands in for the paper's ImageNet weights.

    Parameters
    ----------
    image_iterations, grid_iterations : int
        Of the two stages; the paper stops at 2000.
    batch_size : int
        Frames a step; the paper's 6.
    learning_rate : float
        At the start of each stage; it falls to zero along half a cosine. The paper's 1e-3 refines weights
        that come from ImageNet; ours start at random, normalised in every layer, and stand far more.
    momentum : float
        The paper's 0.9.
    weight_limit : float
        Largest weight of a class, see `median_frequency_weights`. Without it a cell of signage counts three hundred
        times one of unknown-unobserved in minikitti, and the loss is made of a handful of cells.
    jitter : float
        How far brightness and contrast of the images vary, as a share: 142 frames teach little about light.
    end_to_end : bool
        Whether the grid teaches the image network too. If not, training has two separate stages, as in the
        authors' earlier work: the image network stays as the first one left it.
    """

    image_iterations: int = 2000
    grid_iterations: int = 2000
    batch_size: int = 6
    learning_rate: float = 0.05
    momentum: float = 0.9
    weight_limit: float = 4.0
    jitter: float = 0.2
    end_to_end: bool = True

    @property
    def iterations(self) -> int:
        """Of both stages together."""
        return self.image_iterations + self.grid_iterations

    def stage(self, iteration: int) -> tuple[str, float]:
        """Return the stage that an iteration is in, "image" or "grid", and its learning rate."""
        if iteration < self.image_iterations:
            stage, done = "image", iteration / self.image_iterations
        else:
            stage, done = "grid", (iteration - self.image_iterations) / self.grid_iterations
        return stage, self.learning_rate * (1 + math.cos(math.pi * done)) / 2


def train(
    net: SemanticGridNet,
    dataset: Sequence[Sample],
    folder: str | Path,
    params: TrainingParams | None = None,
    seed: int = 0,
    resume: bool = False,
) -> None:
    """Train a network, leaving a log of every step and a checkpoint to resume from.

    All that is random is a function of the seed and the number of the step. So a run that was killed and
    resumed ends with the same weights, bit for bit, as one that was not.

    Parameters
    ----------
    net : SemanticGridNet
        Of `build_net`; changed in place, in evaluation mode afterwards.
    dataset : sequence of Sample
        The frames to learn from.
    folder : path-like
        Takes `log.csv`, the network after the first stage as `image_stage.safetensors`, the trained one as
        `weights.safetensors` and, until that is there, `checkpoint.safetensors`.
    params : TrainingParams, optional
    seed : int
        Of the order of the frames and of their jitter.
    resume : bool
        Whether to continue from the folder's checkpoint.

    Raises
    ------
    ArgumentError
        When the data don't fit the network, the checkpoint is of another run, or the loss isn't finite.
    DataError
        When there is no checkpoint to resume from, or it is damaged.
    """
    params, folder = params or TrainingParams(), Path(folder)
    _check_dataset(net, dataset, params)
    alpha = {stage: class_weights(dataset, stage, net.n_classes, params.weight_limit) for stage in TRUTH}
    optimiser = torch.optim.SGD(net.parameters(), lr=params.learning_rate, momentum=params.momentum)
    run = json.dumps({"seed": seed, "frames": len(dataset), **asdict(params)})
    start = load_checkpoint(folder / CHECKPOINT, run, net, optimiser) if resume else 0
    keep_freed_memory()
    net.train()
    with _open_log(folder / LOG, start) as log:
        for iteration in (progress := trange(start, params.iterations, initial=start, total=params.iterations)):
            stage, optimiser.param_groups[0]["lr"] = params.stage(iteration)
            if stage == "grid" and not params.end_to_end:
                net.segmenter.eval().requires_grad_(False)
            batch = draw_batch(dataset, params.batch_size, params.jitter, iteration, seed)
            loss = _step(net, optimiser, batch, stage, alpha[stage])
            if not math.isfinite(loss):
                found = f"{params.learning_rate}, with which it is {loss} in iteration {iteration}"
                raise ArgumentError("learning_rate", "a rate that keeps the loss finite", found)
            log.write(f"{iteration},{stage},{optimiser.param_groups[0]['lr']:.6g},{loss:.6g}\n")
            progress.set_postfix(stage=stage, loss=f"{loss:.3f}", refresh=False)
            if iteration + 1 == params.image_iterations:
                save_net(net, folder / IMAGE_STAGE)
            if (iteration + 1) % CHECKPOINT_EVERY == 0:
                log.flush()
                save_checkpoint(folder / CHECKPOINT, run, net, optimiser, iteration + 1)
    net.eval()
    save_net(net, folder / WEIGHTS)
    (folder / CHECKPOINT).unlink(missing_ok=True)


def _step(net: SemanticGridNet, optimiser: torch.optim.SGD, batch: Batch, stage: str, alpha: Tensor) -> float:
    """Change the weights by one step of gradient descent and return the loss before it."""
    optimiser.zero_grad()
    scores = (image_scores if stage == "image" else grid_logits)(net, batch)
    truth = getattr(batch.frames, TRUTH[stage]).long()
    weights = alpha[truth[truth != IGNORE]].sum()
    loss = F.cross_entropy(scores, truth, weight=alpha, ignore_index=IGNORE, reduction="sum") / weights
    loss.backward()
    optimiser.step()
    return loss.item()


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
    """
    maps = (getattr(sample, TRUTH[stage]).numpy() for sample in dataset)
    return torch.from_numpy(median_frequency_weights(maps, n_classes, limit)).float()


def _check_dataset(net: SemanticGridNet, dataset: Sequence[Sample], params: TrainingParams) -> None:
    """Refuse frames that the network can't take."""
    if len(dataset) < params.batch_size:
        raise ArgumentError("dataset", f"at least one batch of {params.batch_size} frames", f"{len(dataset)} frames")
    size, shape = net.sampler.image_size, net.sampler.planes_shape[1:]
    expected = Sample((3, *size), size, (N_STATES, *shape), shape)
    for name, part, want in zip(Sample._fields, dataset[0], expected, strict=True):
        if tuple(part.shape) != want:
            raise ArgumentError("dataset", f"{name} of shape {want}", tuple(part.shape))


def _open_log(path: Path, start: int) -> TextIO:
    """Open the log for the step `start`, dropping the lines of later ones that no checkpoint holds."""
    lines = path.read_text().splitlines(keepends=True)[: start + 1] if start else [LOG_HEADER]
    write_text(path, "".join(lines))
    return path.open("a", newline="\n")

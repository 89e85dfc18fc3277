"""Batches of labelled frames, jittered and mirrored, and the network on them (paper, section 4.1)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.networks import SemanticGridNet


class Batch(NamedTuple):
    """Frames side by side, and whether the step sees them in a mirror.

    Parameters
    ----------
    frames : Sample
        Each field with a first axis B more; `image` is float32 in 0..1.
    mirrored : bool
        Left and right change places inside `image_scores` and `grid_logits`, which change them back.
    """

    frames: Sample
    mirrored: bool

    def flip(self, x: Tensor) -> Tensor:
        """Mirror images or grids, if this batch is to be."""
        return x.flip(-1) if self.mirrored else x


def draw_batch(
    dataset: Sequence[Sample], size: int, jitter: float, iteration: int, seed: int, mirror: bool = True
) -> Batch:
    """Return the frames of a step: each pass over the data takes them in a new order, whole batches only.

    Parameters
    ----------
    dataset : sequence of Sample
    size : int
        Frames a batch, B.
    jitter : float
        How far brightness and contrast vary, as a share.
    iteration : int
        Number of the step; with the seed, it decides everything.
    seed : int
    mirror : bool
        Whether half of the batches are to be seen in a mirror.

    Returns
    -------
    Batch
    """
    epoch, k = divmod(iteration, len(dataset) // size)
    order = np.random.default_rng((seed, 0, epoch)).permutation(len(dataset))
    chosen = order[k * size : (k + 1) * size]
    frames = Sample(*map(torch.stack, zip(*(dataset[i] for i in chosen.tolist()), strict=True)))
    rng = np.random.default_rng((seed, 1, iteration))
    contrast, brightness = rng.uniform(-jitter, jitter, (2, size, 1, 1, 1)).astype(np.float32)
    image = (frames.image / 255 - 0.5) * (1 + torch.from_numpy(contrast)) + 0.5 + torch.from_numpy(brightness)
    return Batch(frames._replace(image=image.clamp(0, 1)), mirrored=mirror and bool(rng.random() < 0.5))


def share_of_batch(batch: Batch, process: int, n_processes: int, device: torch.device | str) -> Batch:
    """Return the part of a batch that one of several processes takes, on its device.

    Parameters
    ----------
    batch : Batch
        Of B frames.
    process, n_processes : int
        The number of the process, from 0, and how many there are; B is a multiple.
    device : device

    Returns
    -------
    Batch
        Of B / n_processes frames.
    """
    size = len(batch.frames.image) // n_processes
    part = slice(process * size, (process + 1) * size)
    return batch._replace(frames=Sample(*(field[part].to(device) for field in batch.frames)))


def image_scores(net: SemanticGridNet, batch: Batch) -> Tensor:
    """Return the image network's scores of a batch, before any soft-max.

    Parameters
    ----------
    net : SemanticGridNet
    batch : Batch

    Returns
    -------
    (B, C, h, w) float32
        s, unmirrored.
    """
    return batch.flip(net.segmenter(batch.flip(batch.frames.image)))


def grid_logits(net: SemanticGridNet, batch: Batch) -> Tensor:
    """Return the semantic grid of a batch before the soft-max.

    The planes are sampled unmirrored: the camera isn't quite symmetric, so that a mirrored image alone would
    no longer lie where equation (1) looks.

    Parameters
    ----------
    net : SemanticGridNet
    batch : Batch

    Returns
    -------
    (B, C, H, W) float32
        log g up to a number a cell, unmirrored.
    """
    # What the 1x1 convolution leaves is mirrored: it looks at one cell at a time, and leaves less to move.
    reduced = net.fusion.reduce(net.sampler(image_scores(net, batch)))
    return batch.flip(net.fusion.fuse(batch.flip(reduced), batch.flip(batch.frames.occupancy)))

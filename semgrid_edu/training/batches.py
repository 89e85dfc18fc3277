"""Batches of labelled frames, jittered and mirrored, and the network's results for them (paper, section 4.1)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_edu.datasets.training_set import Mixture, Sample
from semgrid_edu.networks import SemanticGridNet, unit_image
from semgrid_edu.planes import PlaneSampler


class Batch(NamedTuple):
    """The frames of one step, and whether the network sees them mirrored.

    Parameters
    ----------
    frames : Sample
        The fields of all frames, each with an additional first axis B; `image` is float32 in 0..1.
    mirrored : bool
        Whether left and right are exchanged for the network. `image_scores` and `grid_logits` mirror their results
        back, so that they fit the labels of `frames`.
    sampler : PlaneSampler, optional
        Equation (2) for the camera that took these images; by default the network's sampler.
    """

    frames: Sample
    mirrored: bool
    sampler: PlaneSampler | None = None


def draw_batch(
    dataset: Sequence[Sample],
    size: int,
    jitter: float,
    iteration: int,
    seed: int,
    mirror: bool = True,
    tint: float = 0.0,
) -> Batch:
    """Draw the frames of a step, with jittered brightness and contrast, mirrored at random (data augmentation).

    Each pass over the data shuffles the frames. Batches are always complete, so a pass may leave out a few frames.

    Parameters
    ----------
    dataset : sequence of Sample
        The frames to learn from; a `Mixture` takes its data sets in turn.
    size : int
        B, the number of frames in a batch.
    jitter : float
        How far brightness and contrast vary, as a fraction of the range of an image: 0.2 is up to 20 % either way.
    iteration : int
        Number of the step; with the seed it determines everything random.
    seed : int
        Seed for the order, the jitter and the mirroring.
    mirror : bool
        Whether each batch is mirrored with probability one half.
    tint : float
        How much each colour channel of an image varies independently, as a fraction.

    Returns
    -------
    Batch
        B frames.
    """
    part, turn = dataset.turn(iteration) if isinstance(dataset, Mixture) else (dataset, iteration)
    chosen = frames_of_step(len(part), size, turn, seed)
    fields = zip(*(part[i] for i in chosen.tolist()), strict=True)
    # Where some frames lack return heights, the network doesn't use them: see `train`.
    frames = Sample(*(None if any(part is None for part in field) else torch.stack(field) for field in fields))
    rng = np.random.default_rng((seed, 1, iteration))
    contrast, brightness = rng.uniform(-jitter, jitter, (2, size, 1, 1, 1)).astype(np.float32)
    image = (unit_image(frames.image) - 0.5) * (1 + torch.from_numpy(contrast)) + 0.5 + torch.from_numpy(brightness)
    mirrored = mirror and bool(rng.random() < 0.5)
    tints = 1 + torch.from_numpy(rng.uniform(-tint, tint, (size, 3, 1, 1)).astype(np.float32))
    return Batch(frames._replace(image=(image * tints).clamp(0, 1)), mirrored)


def frames_of_step(n_frames: int, size: int, iteration: int, seed: int) -> NDArray[np.int64]:
    """Return the numbers of the frames in the batch of a step: each pass over the data shuffles them.

    Parameters
    ----------
    n_frames : int
        Number of frames of the data.
    size : int
        B, the number of frames in a batch.
    iteration : int
        Number of the step.
    seed : int
        Seed for the order.

    Returns
    -------
    (B,) int
        Numbers of the frames.
    """
    epoch, k = divmod(iteration, n_frames // size)
    order = np.random.default_rng((seed, 0, epoch)).permutation(n_frames)
    return order[k * size : (k + 1) * size]


def share_of_batch(batch: Batch, process: int, n_processes: int, device: torch.device | str) -> Batch:
    """Return one process's share of a batch, on its device.

    Parameters
    ----------
    batch : Batch
        B frames.
    process, n_processes : int
        The number of the process, from 0, and the number of processes, which divides B.
    device : torch.device or str
        The device of the process.

    Returns
    -------
    Batch
        B / n_processes frames.
    """
    size = len(batch.frames.image) // n_processes
    part = slice(process * size, (process + 1) * size)
    return batch._replace(frames=Sample(*(None if f is None else f[part].to(device) for f in batch.frames)))


def image_scores(net: SemanticGridNet, batch: Batch) -> Tensor:
    """Return the image network's scores for a batch, before any soft-max.

    Parameters
    ----------
    net : SemanticGridNet
        The network, on the device of the batch.
    batch : Batch
        B frames.

    Returns
    -------
    (B, C, h, w) float32
        s, unmirrored.
    """
    return _flip(net.segment(_flip(batch.frames.image, batch.mirrored)), batch.mirrored)


def grid_logits(net: SemanticGridNet, batch: Batch) -> Tensor:
    """Return the semantic grid of a batch before the soft-max. Parameters are those of `image_scores`.

    Of a mirrored batch, what learns sees image and grid with left and right exchanged, and every result is mirrored
    back. The planes are sampled unmirrored: the camera isn't quite symmetric, so in a mirrored image equation (1) would
    give the wrong pixels.

    Returns
    -------
    (B, C, H, W) float32
        The logits, unmirrored.
    """
    frames = batch.frames
    scan = [frames.occupancy]
    if net.uses_return_heights:
        scan.append(frames.return_heights.float())
    planes = net.sample(image_scores(net, batch), batch.sampler)
    # What reduces the planes sees one cell at a time, so we mirror after it, when there is less data to move.
    reduced = net.fusion.reduce(planes, *scan[1:])
    mirrored_scan = [_flip(part, batch.mirrored) for part in scan]
    return _flip(net.fusion.fuse(_flip(reduced, batch.mirrored), *mirrored_scan), batch.mirrored)


def _flip(x: Tensor, mirrored: bool) -> Tensor:
    """Exchange left and right of images or grids if `mirrored`."""
    return x.flip(-1) if mirrored else x

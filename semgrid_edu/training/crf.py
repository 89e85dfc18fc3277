"""Learning the CRF: its weights, widths and label costs, on top of a network that stays as it is (section 3.5)."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import NamedTuple

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from semgrid_edu.crf.layer import CrfLayer, save_crf
from semgrid_edu.errors import ArgumentError
from semgrid_edu.training.batches import frames_of_step
from semgrid_edu.training.loop import descend
from semgrid_edu.training.loss import cross_entropy_sums, median_frequency_weights
from semgrid_edu.training.params import TrainingParams

CRF_TRAINING = TrainingParams(
    image_iterations=0, grid_iterations=150, batch_size=2, learning_rate=0.5, jitter=0.0, mirror=False
)
"""How a CRF learns: there is no image stage, and images don't matter. Mirrored grids would give the same gradients. The
weight limit is that of the networks; a limit of 1 is plain cross-entropy, in which every cell counts the same."""


class GridBatch(NamedTuple):
    """What the CRF learns from.

    Parameters
    ----------
    log_g : (B, C, H, W) float32
        The network's semantic grids, natural logarithms.
    occupancy : (B, 4, H, W) float32
        The probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    truth : (B, H, W) uint8
        The class of each cell; 255 where unlabelled.
    """

    log_g: Tensor
    occupancy: Tensor
    truth: Tensor


class CrfObjective(nn.Module):
    """The weighted cross-entropy of refined grids, as its two sums.

    Parameters
    ----------
    layer : CrfLayer
        The CRF that learns.
    alpha : (C,) float
        The weight of each class, from `median_frequency_weights`.
    """

    def __init__(self, layer: CrfLayer, alpha: Tensor) -> None:
        super().__init__()
        self.layer, self.alpha = layer, alpha

    def forward(self, batch: GridBatch) -> tuple[Tensor, Tensor]:
        """Return the two sums whose quotient is the loss of a batch, see `cross_entropy_sums`.

        Parameters
        ----------
        batch : GridBatch
            The frames of a step.

        Returns
        -------
        losses, weights : () float
            The sum of the weighted losses, nats, and the sum of the weights.
        """
        return cross_entropy_sums(self.layer(batch.log_g, batch.occupancy), batch.truth, self.alpha)


def train_crf(
    layer: CrfLayer,
    log_g: NDArray,
    occupancy: NDArray,
    truth: NDArray,
    folder: str | Path,
    params: TrainingParams = CRF_TRAINING,
    seed: int = 0,
    resume: bool = False,
) -> None:
    """Train a CRF on the grids of a network, leaving a log of every step and a checkpoint to resume from.

    As with `train`, a run that was killed and resumed ends with the same weights as one that wasn't.

    Parameters
    ----------
    layer : CrfLayer
        The CRF, which is changed in place.
    log_g : (N, C, H, W) float32
        The network's semantic grids, natural logarithms.
    occupancy : (N, 4, H, W) float32
        The probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    truth : (N, H, W) uint8
        The class of each cell; 255 where unlabelled.
    folder : path-like
        Where to write `log.csv`, the trained CRF as `weights.safetensors` and, as long as the run isn't finished,
        `checkpoint.safetensors`.
    params : TrainingParams
        Number of steps (`grid_iterations`), frames per step, rates, and the limit of class weights.
    seed : int
        Seed for the order of the frames.
    resume : bool
        Whether to go on from the folder's checkpoint; before there is one, the run begins.

    Raises
    ------
    ArgumentError
        When there are too few frames, grids don't fit the layer, the checkpoint belongs to another run, or the loss
        isn't finite.
    DataError
        When the checkpoint is damaged; when the folder holds files that a new run would overwrite; or when another
        process trains in it.
    """
    if len(truth) < params.batch_size:
        raise ArgumentError("truth", f"at least one batch of {params.batch_size} frames", f"{len(truth)} frames")
    alpha = torch.from_numpy(median_frequency_weights(truth, layer.n_classes, params.weight_limit)).float()
    run = {"seed": seed, "frames": len(truth), **asdict(params), **layer.description(), "class weights": alpha.tolist()}

    def batch(iteration: int) -> GridBatch:
        chosen = frames_of_step(len(truth), params.batch_size, iteration, seed)
        return GridBatch(*(torch.from_numpy(part[chosen]) for part in (log_g, occupancy, truth)))

    objective = CrfObjective(layer, alpha)
    descend(layer, lambda _: objective, batch, partial(save_crf, layer), Path(folder), params, run, resume)

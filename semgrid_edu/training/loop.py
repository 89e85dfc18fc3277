"""The training loop: stochastic gradient descent, first on images, then end to end (paper, section 4.1).

`fit` learns, one step after the other; `train` writes what a run leaves behind: its log, checkpoints and weights.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn
from tqdm.auto import tqdm

from semgrid_edu.datasets.training_set import Mixture, Sample
from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, SemanticGridNet, save_net
from semgrid_edu.networks.build import plane_sampler
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.storage.files import sole_writer
from semgrid_edu.training.batches import Batch, draw_batch, share_of_batch
from semgrid_edu.training.checkpoint import CHECKPOINT, check_folder, load_checkpoint, save_checkpoint
from semgrid_edu.training.devices import open_fabric
from semgrid_edu.training.log import LOG, Step, append_step, begin_log
from semgrid_edu.training.loss import Objective, class_weights, process_loss
from semgrid_edu.training.params import TrainingParams

if TYPE_CHECKING:
    from lightning_fabric import Fabric

CHECKPOINT_EVERY = 100
"""Iterations between checkpoints, which is what an interruption loses at most."""


def train(
    net: SemanticGridNet,
    dataset: Sequence[Sample],
    folder: str | Path,
    params: TrainingParams | None = None,
    seed: int = 0,
    resume: bool = False,
    fabric: "Fabric | None" = None,
) -> None:
    """Train a network, and write a log of every step and a checkpoint to resume from.

    Everything random is a function of the seed and the number of the step. So a run that was killed and resumed
    ends with the same weights as one that wasn't, bit for bit on a CPU.

    With several processes, each takes its share of every batch. Loss and gradients are computed over the whole batch.
    Batch normalisation is over the whole batch on GPUs, and over each process's share on CPUs. All processes must see
    the same data and the same folder.

    Parameters
    ----------
    net : SemanticGridNet
        A network with an architecture, as `build_net` makes it. It is changed in place; afterwards it is in
        evaluation mode and on the device.
    dataset : sequence of Sample
        The frames to learn from; for several cameras a `Mixture`.
    folder : path-like
        Where to write `log.csv`, the network after the first stage as `image_stage.safetensors`, the trained network
        as `weights.safetensors` and, until the run is finished, `checkpoint.safetensors`.
    params : TrainingParams, optional
        Numbers of iterations, rates and the like; the defaults if left out.
    seed : int
        Seed for the order of the frames and for their jitter.
    resume : bool
        Whether to resume from the folder's checkpoint; if there is none, the run starts from the beginning.
    fabric : lightning_fabric.Fabric, optional
        Device, precision and processes, from `open_fabric`; the CPU if left out.

    Raises
    ------
    ArgumentError
        When the network has no architecture, the data don't fit the network, the checkpoint belongs to another run, or
        the loss isn't finite.
    DataError
        When the checkpoint is damaged; when the folder holds files that a new run would overwrite; or when another
        process trains in it.
    """
    params = params or TrainingParams()
    fabric = fabric or open_fabric("cpu")
    folder = Path(folder)
    _check_dataset(net, dataset, params, fabric.world_size)
    alpha = {stage: class_weights(dataset, stage, net.n_classes, params.weight_limit) for stage in params.stages}
    run = {"seed": seed, "frames": len(dataset), **asdict(params), **asdict(net.need_architecture())}
    run |= {f"{stage} class weights": weights.tolist() for stage, weights in alpha.items()}

    check_folder(folder, resume)
    first_process = fabric.is_global_zero  # it alone writes
    with sole_writer(folder) if first_process else nullcontext():
        check_folder(folder, resume)  # check again: until now another process could write to it
        fabric.barrier()  # process 0 writes its log only when all have checked, or a slow one would reject that log
        net.to(fabric.device)
        if fabric.world_size > 1 and fabric.device.type == "cuda":
            nn.SyncBatchNorm.convert_sync_batchnorm(net)
        optimiser = make_optimiser(net, params)
        start = 0
        if (folder / CHECKPOINT).exists():
            start = load_checkpoint(folder / CHECKPOINT, run, net, optimiser)
        if first_process:
            begin_log(folder / LOG, start)

        steps = fit(net, dataset, optimiser, params, alpha, seed, fabric, start)
        shown = tqdm(steps, initial=start, total=params.iterations, disable=not first_process)
        for step in shown:
            shown.set_postfix(stage=step.stage, loss=f"{step.loss:.3f}", refresh=False)
            if not first_process:
                continue
            append_step(folder / LOG, step)
            if step.iteration + 1 == params.image_iterations:
                save_net(net, folder / IMAGE_STAGE)
            if (step.iteration + 1) % CHECKPOINT_EVERY == 0:
                save_checkpoint(folder / CHECKPOINT, run, net, optimiser, step.iteration + 1)
        if first_process:
            save_net(net, folder / WEIGHTS)
            (folder / CHECKPOINT).unlink(missing_ok=True)
    net.eval()


def fit(
    net: SemanticGridNet,
    dataset: Sequence[Sample],
    optimiser: torch.optim.Optimizer,
    params: TrainingParams,
    alpha: Mapping[str, Tensor],
    seed: int,
    fabric: "Fabric",
    start: int = 0,
) -> Iterator[Step]:
    """Learn: draw a batch, go one step down the gradient of its loss, and again.

    Parameters
    ----------
    net, dataset, params, seed, fabric
        Those of `train`.
    optimiser : Optimizer
        The optimiser of the trainable weights, from `make_optimiser`.
    alpha : dict of str to (C,) float
        The class weights of the loss in each stage, "image" and "grid".
    start : int
        The number of the first step.

    Yields
    ------
    Step
        After each step; the network has changed.

    Raises
    ------
    ArgumentError
        When the loss isn't finite, from which training can't recover.
    """
    samplers = _samplers(net, dataset, fabric.device)
    with _freezing(net) as learnable:
        for iteration in range(start, params.iterations):
            stage, rate = params.stage(iteration)
            if iteration in (start, params.image_iterations):  # a stage begins
                _begin_stage(net, stage, params.end_to_end, learnable)
                objective = fabric.setup_module(Objective(net, stage, alpha[stage]))
            for group in optimiser.param_groups:
                group["lr"] = rate * group["share"]

            batch = draw_batch(dataset, params.batch_size, params.jitter, iteration, seed, params.mirror, params.tint)
            if samplers:
                batch = batch._replace(sampler=samplers[dataset.turn(iteration)[0]])
            batch = share_of_batch(batch, fabric.global_rank, fabric.world_size, fabric.device)
            step = Step(iteration, stage, rate, learn(fabric, objective, optimiser, batch))
            if not math.isfinite(step.loss):  # training can't recover from it
                found = f"{params.learning_rate}, with which it is {step.loss} in iteration {iteration}"
                raise ArgumentError("learning_rate", "a rate that keeps the loss finite", found)
            yield step


def _samplers(net: SemanticGridNet, dataset: Sequence[Sample], device: torch.device) -> dict[Sequence, nn.Module]:
    """Return equation (2) for the camera of each part of a mixture; one camera has the network's own sampler."""
    if not isinstance(dataset, Mixture):
        return {}
    kind = type(net.sampler)
    return {part: plane_sampler(net.architecture, part.camera, kind).to(device) for part in dataset.parts}


def make_optimiser(net: SemanticGridNet, params: TrainingParams) -> torch.optim.Optimizer:
    """Return the optimiser of the trainable weights, in two groups: those that ImageNet taught, and the others.

    Each group's "share" is its fraction of the learning rate.

    Parameters
    ----------
    net : SemanticGridNet
        The network, on its device.
    params : TrainingParams
        Which optimiser, and its rates.
    """
    taught = set()
    if isinstance(net.segmenter, Segmenter):  # the published tensors share their memory with the parameters
        taught = {tensor.data_ptr() for tensor in net.segmenter.imagenet_tensors().values()}
    learnable = [parameter for parameter in net.parameters() if parameter.requires_grad]
    groups = [
        {"params": [weight for weight in learnable if weight.data_ptr() in taught], "share": params.encoder_rate},
        {"params": [weight for weight in learnable if weight.data_ptr() not in taught], "share": 1.0},
    ]
    if params.optimiser == "adamw":
        return torch.optim.AdamW(groups, lr=params.learning_rate)
    return torch.optim.SGD(groups, lr=params.learning_rate, momentum=params.momentum)


def learn(fabric: "Fabric", objective: nn.Module, optimiser: torch.optim.Optimizer, batch: Batch) -> float:
    """Change the weights by one step of gradient descent.

    Parameters
    ----------
    fabric : lightning_fabric.Fabric
        Device, precision and processes.
    objective : Module
        An `Objective` that `fabric.setup_module` has set up.
    optimiser : Optimizer
        The optimiser of the trainable weights.
    batch : Batch
        This process's share of the batch, on the device.

    Returns
    -------
    float
        The loss of the whole batch before the step, nats.
    """
    loss = process_loss(fabric, *objective(batch))
    optimiser.zero_grad()
    fabric.backward(loss)
    optimiser.step()
    return fabric.all_reduce(loss.detach(), reduce_op="mean").item()


def _begin_stage(net: SemanticGridNet, stage: str, end_to_end: bool, learnable: Sequence[nn.Parameter]) -> None:
    """Make the weights of this stage trainable, and freeze all others."""
    net.train()
    segmenter_learns = stage == "image" or end_to_end
    if not segmenter_learns:
        net.segmenter.eval()
    in_segmenter = set(net.segmenter.parameters())
    for parameter in learnable:
        parameter.requires_grad_(segmenter_learns if parameter in in_segmenter else stage == "grid")


@contextmanager
def _freezing(net: nn.Module) -> Iterator[list[nn.Parameter]]:
    """Yield the trainable weights; after the block they are trainable again."""
    learnable = [parameter for parameter in net.parameters() if parameter.requires_grad]
    try:
        yield learnable
    finally:
        for parameter in learnable:
            parameter.requires_grad_(True)


def _check_dataset(net: SemanticGridNet, dataset: Sequence[Sample], params: TrainingParams, n_processes: int) -> None:
    """Check that the network can be saved, that the frames fit it, and that processes can share a batch."""
    architecture = net.need_architecture()
    for part in dataset.parts if isinstance(dataset, Mixture) else (dataset,):
        if len(part) < params.batch_size:
            raise ArgumentError("dataset", f"at least one batch of {params.batch_size} frames", f"{len(part)} frames")
    if params.batch_size % n_processes:
        raise ArgumentError("batch_size", f"a multiple of {n_processes}, the number of processes", params.batch_size)
    size = net.sampler.image_size
    cells = net.sampler.planes_shape[1:]
    shapes = {"image": (3, *size), "labels": size, "occupancy": (N_STATES, *cells), "truth": cells}
    if architecture.uses_return_heights:
        shapes["return_heights"] = (2, *cells)
    for k, sample in enumerate(dataset):
        for name, shape in shapes.items():
            tensor = getattr(sample, name)
            if tensor is None:
                raise ArgumentError("dataset", f"{name}, which the network uses", f"none in frame {k}")
            if tuple(tensor.shape) != shape:
                raise ArgumentError("dataset", f"{name} of shape {shape}", f"{tuple(tensor.shape)} in frame {k}")

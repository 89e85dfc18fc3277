"""The training loop: stochastic gradient descent, end to end (paper, section 4.1)."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from functools import partial
from pathlib import Path

import torch
from torch import Tensor, nn
from tqdm.auto import trange

from semgrid_edu.datasets.training_set import Mixture, Sample, TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, SemanticGridNet, save_net
from semgrid_edu.networks.build import plane_sampler
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.storage.files import sole_writer
from semgrid_edu.training.batches import Batch, draw_batch, share_of_batch
from semgrid_edu.training.checkpoint import CHECKPOINT, check_folder, load_checkpoint, save_checkpoint
from semgrid_edu.training.devices import (
    in_parallel,
    keep_freed_memory,
    mixed_precision,
    process_total,
    rank,
    shared_batch_norm,
    shared_mean,
    world_size,
)
from semgrid_edu.training.log import LOG, Step, append_step, begin_log
from semgrid_edu.training.loss import Objective, class_weights
from semgrid_edu.training.params import TrainingParams

CHECKPOINT_EVERY = 100
"""Iterations between checkpoints: an interruption costs about twenty seconds of work at most."""


def train(
    net: SemanticGridNet,
    dataset: Sequence[Sample],
    folder: str | Path,
    params: TrainingParams | None = None,
    seed: int = 0,
    resume: bool = False,
    device: torch.device | str = "cpu",
) -> None:
    """Train a network, leaving a log of every step and a checkpoint to resume from.

    Everything random is a function of the seed and the number of the step. So a run that was killed and resumed
    ends with the same weights as one that wasn't, bit for bit on a CPU.

    Inside `process_group` with several processes, each process takes its share of every batch, and together they make
    the same step as one process would; all of them must see the same data and the same folder.

    Parameters
    ----------
    net : SemanticGridNet
        A network with an architecture, as `build_net` makes it. It is changed in place; afterwards it is in
        evaluation mode and on `device`.
    dataset : sequence of Sample
        The frames to learn from; for several cameras a `Mixture`.
    folder : path-like
        Where to write `log.csv`, the network after the first stage as `image_stage.safetensors`, the trained network
        as `weights.safetensors` and, as long as the run isn't finished, `checkpoint.safetensors`.
    params : TrainingParams, optional
        Numbers of iterations, rates and the like; the defaults if left out.
    seed : int
        Seed for the order of the frames and for their jitter.
    resume : bool
        Whether to go on from the folder's checkpoint; before there is one, the run begins.
    device : torch.device or str
        The device to compute on.

    Raises
    ------
    ArgumentError
        When the network has no architecture, the data don't fit the network, the checkpoint belongs to another run, or
        the loss isn't finite.
    DataError
        When the checkpoint is damaged; when the folder holds files that a new run would overwrite; or when another
        process trains in it.
    """
    params, device = params or TrainingParams(), torch.device(device)
    _check_dataset(net, dataset, params)
    stages = [stage for stage, n in (("image", params.image_iterations), ("grid", params.grid_iterations)) if n]
    alpha = {stage: class_weights(dataset, stage, net.n_classes, params.weight_limit) for stage in stages}
    run = {"seed": seed, "frames": len(dataset), **asdict(params), **asdict(net.need_architecture())}
    run |= {f"{stage} class weights": weights.tolist() for stage, weights in alpha.items()}

    samplers = {
        part: plane_sampler(net.architecture, part.camera, type(net.sampler)).to(device) for part in _parts(dataset)
    }

    def objective(stage: str) -> nn.Module:
        return _objective(net, stage, alpha[stage].to(device), params.end_to_end)

    def batch(iteration: int) -> Batch:
        drawn = draw_batch(dataset, params.batch_size, params.jitter, iteration, seed, params.mirror, params.tint)
        if isinstance(dataset, Mixture):
            drawn = drawn._replace(sampler=samplers[dataset.turn(iteration)[0]])
        return share_of_batch(drawn, rank(), world_size(), device)

    with shared_batch_norm(net), _gradients_as_found(net):
        descend(net.to(device), objective, batch, partial(save_net, net), Path(folder), params, run, resume)
    net.eval()


def descend(
    learner: nn.Module,
    objective: Callable[[str], nn.Module],
    batch: Callable[[int], tuple],
    save: Callable[[Path], None],
    folder: Path,
    params: TrainingParams,
    run: dict,
    resume: bool,
) -> None:
    """Make all steps of a training run, in a folder that no other process writes to meanwhile.

    Parameters
    ----------
    learner : Module
        What learns, on its device.
    objective : callable
        Called with the name of each stage when it begins. Returns a module: batch -> the two sums whose quotient is the
        loss, as `Objective` returns them.
    batch : callable
        Number of a step -> what the objective takes, on the same device.
    save : callable
        Writes what was learnt to a file.
    folder : Path
        The folder of the training run.
    params : TrainingParams
        Numbers of iterations, rates and the like.
    run : dict
        What distinguishes this run from others, as for `save_checkpoint`.
    resume : bool
        Whether to go on from the folder's checkpoint; before there is one, the run begins.
    """
    check_folder(folder, resume)
    with sole_writer(folder) if rank() == 0 else nullcontext():
        check_folder(folder, resume)  # once more: until now another process could write to it
        learning = [parameter for parameter in learner.parameters() if parameter.requires_grad]
        optimiser = torch.optim.SGD(learning, lr=params.learning_rate, momentum=params.momentum)
        # After `check_folder` there is a checkpoint only if the run is to be resumed.
        start = load_checkpoint(folder / CHECKPOINT, run, learner, optimiser) if (folder / CHECKPOINT).exists() else 0
        if rank() == 0:
            begin_log(folder / LOG, start)
        keep_freed_memory()
        steps = trange(start, params.iterations, initial=start, total=params.iterations, disable=rank() > 0)
        for iteration in steps:
            stage, optimiser.param_groups[0]["lr"] = params.stage(iteration)
            if iteration in (start, params.image_iterations):
                loss_of = objective(stage)
            loss = learn(loss_of, optimiser, batch(iteration), learning[0].device)
            step = Step(iteration, stage, optimiser.param_groups[0]["lr"], loss)
            _check_finite(step, params.learning_rate)
            steps.set_postfix(stage=stage, loss=f"{loss:.3f}", refresh=False)
            if rank() == 0:
                append_step(folder / LOG, step)
                if iteration + 1 == params.image_iterations:
                    save(folder / IMAGE_STAGE)
                if (iteration + 1) % CHECKPOINT_EVERY == 0:
                    save_checkpoint(folder / CHECKPOINT, run, learner, optimiser, iteration + 1)
        if rank() == 0:
            save(folder / WEIGHTS)
            (folder / CHECKPOINT).unlink(missing_ok=True)


def learn(objective: nn.Module, optimiser: torch.optim.SGD, batch: tuple, device: torch.device) -> float:
    """Change the weights by one step of gradient descent, and return the loss before it, nats.

    Parameters
    ----------
    objective : Module
        batch -> the two sums whose quotient is the loss, as `Objective` returns them.
    optimiser : SGD
        The optimiser of the weights that learn.
    batch : tuple
        What the objective takes, on the device.
    device : torch.device
        The device that computes.
    """
    optimiser.zero_grad()
    with mixed_precision(device):
        loss = shared_mean(*objective(batch))
    loss.backward()
    optimiser.step()
    return process_total(loss.detach()).item() / world_size()


def _check_finite(step: Step, learning_rate: float) -> None:
    """Refuse to go on after a loss that is infinite or NaN, from which nothing can be learnt any more."""
    if not math.isfinite(step.loss):
        found = f"{learning_rate}, with which it is {step.loss} in iteration {step.iteration}"
        raise ArgumentError("learning_rate", "a rate that keeps the loss finite", found)


def _objective(net: SemanticGridNet, stage: str, alpha: Tensor, end_to_end: bool) -> nn.Module:
    """Return the objective of a stage when it begins, and freeze the weights that don't learn in it."""
    net.train()
    if stage == "grid" and not end_to_end:
        net.segmenter.eval().requires_grad_(False)
    return in_parallel(Objective(net, stage, alpha), some_unused=stage == "image")


def _parts(dataset: Sequence[Sample]) -> tuple[TrainingSet, ...]:
    """Return the parts of a mixture, which have a camera each; nothing else has parts."""
    return dataset.parts if isinstance(dataset, Mixture) else ()


@contextmanager
def _gradients_as_found(net: nn.Module) -> Iterator[None]:
    """Let the weights that could learn before the block, and only these, learn again after it."""
    found = [(parameter, parameter.requires_grad) for parameter in net.parameters()]
    try:
        yield
    finally:
        for parameter, learns in found:
            parameter.requires_grad_(learns)


def _check_dataset(net: SemanticGridNet, dataset: Sequence[Sample], params: TrainingParams) -> None:
    """Refuse a network that can't be saved, frames that don't fit it, and batches that can't be shared."""
    net.need_architecture()
    for part in _parts(dataset) or (dataset,):
        if len(part) < params.batch_size:
            raise ArgumentError("dataset", f"at least one batch of {params.batch_size} frames", f"{len(part)} frames")
    if params.batch_size % world_size():
        raise ArgumentError("batch_size", f"a multiple of {world_size()}, the number of processes", params.batch_size)
    size, shape = net.sampler.image_size, net.sampler.planes_shape[1:]
    expected = Sample((3, *size), size, (N_STATES, *shape), shape)
    for k, sample in enumerate(dataset):
        for name, part, want in zip(Sample._fields, sample, expected, strict=True):
            if tuple(part.shape) != want:
                raise ArgumentError("dataset", f"{name} of shape {want}", f"{tuple(part.shape)} in frame {k}")

"""One training in several processes, each with its share of every batch (section 4.1)."""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from functools import partial

import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm
from torch.nn.parallel import DistributedDataParallel

from semgrid_edu.training.devices import choose_device

PATIENCE = timedelta(minutes=30)
"""A process waits so long for the others: the first may be making the data set's arrays."""


@contextmanager
def process_group(device: str = "auto") -> Iterator[torch.device]:
    """Join the processes that torchrun started, if it started this one, and leave them with the block.

    When one fails, torchrun ends the others.

    Parameters
    ----------
    device : str
        As `choose_device` takes it.

    Yields
    ------
    torch.device
        That of this process.

    Raises
    ------
    ArgumentError
        When there is no such device.
    """
    chosen = choose_device(device, int(os.environ.get("LOCAL_RANK", 0)))
    gpu = chosen if chosen.type == "cuda" else None
    if gpu:
        torch.cuda.set_device(gpu)
    if int(os.environ.get("WORLD_SIZE", 1)) == 1:
        yield chosen
        return
    dist.init_process_group("nccl" if gpu else "gloo", timeout=PATIENCE, device_id=gpu)
    try:
        yield chosen
    finally:
        dist.destroy_process_group()


def rank() -> int:
    """Return the number of this process; process 0 alone writes files and shows progress."""
    return dist.get_rank() if dist.is_initialized() else 0


def world_size() -> int:
    """Return the number of processes, 1 for a training without torchrun."""
    return dist.get_world_size() if dist.is_initialized() else 1


@contextmanager
def first_process_first() -> Iterator[None]:
    """Let process 0 run the block before the others do: it makes the files that they then find."""
    if rank() > 0:
        dist.barrier()
    try:
        yield
    finally:  # when it fails, the others fail alike instead of waiting
        if rank() == 0 and world_size() > 1:
            dist.barrier()


class _Total(torch.autograd.Function):
    """A sum over processes. Its parts work on the losses of all, so that a part's gradient is a sum again."""

    @staticmethod
    def forward(ctx, x: Tensor) -> Tensor:
        x = x.clone(memory_format=torch.contiguous_format)
        dist.all_reduce(x)
        return x

    @staticmethod
    def backward(ctx, grad: Tensor) -> Tensor:
        return _Total.apply(grad)


def process_total(x: Tensor) -> Tensor:
    """Return the sum of a tensor over all processes, differentiable.

    Parameters
    ----------
    x : (...) float
        Of the same shape in each process.

    Returns
    -------
    (...) float
        `x` itself when there is one process.
    """
    return _Total.apply(x) if world_size() > 1 else x


def in_parallel(module: nn.Module, some_unused: bool) -> nn.Module:
    """Return a module whose gradients are means over all processes, so that their weights stay the same.

    Parameters
    ----------
    module : Module
        Its forward gives a loss.
    some_unused : bool
        Whether the loss leaves some weights out.

    Returns
    -------
    Module
        `module` itself when there is one process.
    """
    if world_size() == 1:
        return module
    with warnings.catch_warnings():  # PyTorch 2.13 has a new name for `broadcast_buffers`, which 2.6 doesn't know
        warnings.simplefilter("ignore", FutureWarning)
        return DistributedDataParallel(module, find_unused_parameters=some_unused, broadcast_buffers=False)


@contextmanager
def shared_batch_norm(net: nn.Module) -> Iterator[None]:
    """Inside, a network's batch normalisation takes mean and variance over the batches of all processes.

    So that half the batch in each of two processes is one step of the whole batch. PyTorch's own way to do it,
    SyncBatchNorm, works on GPUs alone.

    Parameters
    ----------
    net : Module
        As it was after the block.
    """
    norms = [module for module in net.modules() if isinstance(module, _BatchNorm)] if world_size() > 1 else []
    for norm in norms:
        norm.forward = partial(_normalise, norm)
    try:
        yield
    finally:
        for norm in norms:
            del norm.forward


def _normalise(norm: _BatchNorm, x: Tensor) -> Tensor:
    """Do what `norm.forward` does, with mean and variance over all processes; the same number of values in each."""
    if not norm.training:
        return type(norm).forward(norm, x)
    axes = [0, *range(2, x.ndim)]
    n = world_size() * x.numel() // x.shape[1]
    values = x.to(torch.promote_types(x.dtype, torch.float32))  # mixed precision sums in float32 too
    mean = process_total(values.sum(axes, keepdim=True)) / n
    centred = values - mean
    variance = process_total(centred.square().sum(axes, keepdim=True)) / n
    with torch.no_grad():
        norm.num_batches_tracked += 1
        norm.running_mean.lerp_(mean.flatten(), norm.momentum)
        norm.running_var.lerp_(variance.flatten() * n / (n - 1), norm.momentum)
    scale = norm.weight.view(mean.shape) * torch.rsqrt(variance + norm.eps)
    return (centred * scale + norm.bias.view(mean.shape)).to(x.dtype)

"""What a training run computes on: a device, its precision and memory, or several processes (section 4.1)."""

import ctypes
import os
import re
import sys
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

from semgrid_edu.errors import ArgumentError


def choose_device(name: str = "auto", process: int = 0) -> torch.device:
    """Return the device that a command's option `--device` names.

    Parameters
    ----------
    name : str
        "cpu", "cuda", "cuda:N" for the GPU with that number, or "auto": a GPU when there is one, else the CPU.
    process : int
        Number of this process on its machine, from 0: "cuda" and "auto" give each process a GPU of its own.

    Returns
    -------
    torch.device
        The CPU or one GPU.

    Raises
    ------
    ArgumentError
        When the name is none of these, there is no such GPU, or several processes would share one GPU.

    Examples
    --------
    >>> choose_device("cpu")
    device(type='cpu')
    """
    if not re.fullmatch(r"auto|cpu|cuda(:\d+)?", name):
        raise ArgumentError("--device", "auto, cpu, cuda or cuda:N", repr(name))
    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if name == "cpu" or (name == "auto" and not gpus):
        return torch.device("cpu")
    if ":" in name and process > 0:
        raise ArgumentError("--device", "auto, cpu or cuda: each process takes a GPU of its own", repr(name))
    number = int(name.removeprefix("cuda:")) if ":" in name else process
    if number >= gpus:
        wanted = f"{name}, the GPU number {number} for process {process}"
        raise ArgumentError("--device", f"cpu or one of the {gpus} GPUs that PyTorch finds here", wanted)
    return torch.device("cuda", number)


def mixed_precision(device: torch.device) -> torch.autocast:
    """Return a context in which a GPU convolves in bfloat16, which has half the bits of float32 and the same range.

    Weights, sums and losses stay float32. Because the range is the same, gradients need no scaling. A CPU, and a GPU
    without bfloat16 (before NVIDIA's Ampere), compute everything in float32.

    Parameters
    ----------
    device : torch.device
        The device that computes.

    Returns
    -------
    torch.autocast
        A context for the forward pass.
    """
    able = device.type == "cuda" and torch.cuda.is_bf16_supported(including_emulation=False)
    return torch.autocast(device.type, torch.bfloat16, enabled=able)


M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_MAX = -1, -2, -4
"""Options of `mallopt`, as glibc's malloc.h numbers them."""


def keep_freed_memory() -> None:
    """Let this process keep the memory that it frees, for the next buffer of that size.

    On Linux, glibc hands freed buffers above 32 MB back to the system at once, and the system clears every page of the
    next such buffer anew when it is touched. The twenty planes of a batch are larger than that. At the paper's scale,
    sampling them took 30 ms with glibc's defaults and 12 ms with kept memory. The price is that the process never
    shrinks below its peak. On systems other than Linux with glibc nothing changes.
    """
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(M_MMAP_MAX, 0)
        libc.mallopt(M_TRIM_THRESHOLD, 2**31 - 1)
        libc.mallopt(M_TOP_PAD, 2**26)


PATIENCE = timedelta(minutes=30)
"""How long a process waits for the others: the first may be making the data set's arrays."""


@contextmanager
def process_group(device: str = "auto") -> Iterator[torch.device]:
    """Join the processes that torchrun started, if it started this one, for the length of the block.

    When one process fails, torchrun ends the others.

    Parameters
    ----------
    device : str
        "cpu", "cuda", "cuda:N" or "auto", see `choose_device`.

    Yields
    ------
    torch.device
        The device of this process.
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
    """Return the number of processes, 1 for a training run without torchrun."""
    return dist.get_world_size() if dist.is_initialized() else 1


@contextmanager
def first_process_first() -> Iterator[None]:
    """Let process 0 run the block before the others do, so that they find the files that it makes."""
    if rank() > 0:
        dist.barrier()
    try:
        yield
    finally:  # when process 0 fails, the others go on and fail in the same way instead of waiting
        if rank() == 0 and world_size() > 1:
            dist.barrier()


class _Total(torch.autograd.Function):
    """A sum over processes; every process's loss depends on each summand, so the gradient is a sum over them too."""

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
        This process's summand, of the same shape in each process.

    Returns
    -------
    (...) float
        The sum; `x` itself when there is one process.
    """
    return _Total.apply(x) if world_size() > 1 else x


def shared_mean(losses: Tensor, weights: Tensor) -> Tensor:
    """Return this process's part of a weighted mean: the mean of all processes' parts is the mean of the whole batch.

    Taking the mean over processes is what `DistributedDataParallel` does with gradients. With one process the part is
    the mean, losses / weights.

    Parameters
    ----------
    losses : () float
        Sum of the weighted losses in this process.
    weights : () float
        Sum of the weights in this process.

    Returns
    -------
    () float
        0 when no process has any weight: such a batch teaches nothing, and 0/0 would stop the run.
    """
    total = process_total(weights)
    return world_size() * losses / total.clamp_min(torch.finfo(total.dtype).tiny)


def in_parallel(module: nn.Module, some_unused: bool) -> nn.Module:
    """Return a module whose gradients are means over all processes, so that all of them keep the same weights.

    Parameters
    ----------
    module : Module
        A module whose forward pass gives the two sums of the loss.
    some_unused : bool
        Whether the loss doesn't depend on some of the weights.

    Returns
    -------
    Module
        `module` itself when there is one process.
    """
    if world_size() == 1:
        return module
    with warnings.catch_warnings():  # PyTorch 2.13 has a new name for `broadcast_buffers` that 2.6 doesn't know
        warnings.simplefilter("ignore", FutureWarning)
        return DistributedDataParallel(module, find_unused_parameters=some_unused, broadcast_buffers=False)


@contextmanager
def shared_batch_norm(net: nn.Module) -> Iterator[None]:
    """Let a network's batch normalisation take mean and variance over the batches of all processes in the block.

    Half the batch in each of two processes then makes the same step as the whole batch in one. PyTorch's own module
    for it, SyncBatchNorm, works on GPUs only.

    Parameters
    ----------
    net : Module
        The network; after the block it is as it was before.
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
    """Do what `norm.forward` does, with mean and variance over all processes, which have equally many values."""
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

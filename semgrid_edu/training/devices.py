"""The device that a training run computes on, and the precision that it computes with (section 4.1)."""

import re

import torch

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

"""The device that a training run computes on, its precision, and the memory that the run keeps (section 4.1)."""

import ctypes
import re
import sys

import torch

from semgrid_edu.errors import ArgumentError

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

"""Where a training run computes: device, precision and processes, by Lightning Fabric (section 4.1)."""

import os
import re
from typing import TYPE_CHECKING

import torch

from semgrid_edu.errors import ArgumentError, needed

if TYPE_CHECKING:
    from lightning_fabric import Fabric


def choose_device(name: str = "auto", process: int = 0) -> torch.device:
    """Return the device that a command's option `--device` names.

    Parameters
    ----------
    name : str
        "cpu", "cuda", "cuda:N" for the GPU with that number, or "auto": a GPU when there is one, else the CPU.
    process : int
        Number of this process on its machine, from 0: with "cuda" and "auto" each process gets its own GPU.

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


def open_fabric(device: str = "auto") -> "Fabric":
    """Join the processes that torchrun started, if it started this one, and choose device and precision.

    A GPU convolves in bfloat16 if it can (since NVIDIA's Ampere). This type has half the bits of float32 and the same
    range, so gradients need no scaling. Weights, sums and losses stay float32. A CPU computes in float32.

    Parameters
    ----------
    device : str
        "cpu", "cuda", "cuda:N" or "auto", see `choose_device`.

    Returns
    -------
    lightning_fabric.Fabric
        The `fabric` argument of `train`.
    """
    Fabric = needed("lightning_fabric").Fabric  # imported here, because it takes seconds

    processes = int(os.environ.get("WORLD_SIZE", 1))
    on_this_machine = int(os.environ.get("LOCAL_WORLD_SIZE", 1))
    chosen = choose_device(device, int(os.environ.get("LOCAL_RANK", 0)))
    half = chosen.type == "cuda" and torch.cuda.is_bf16_supported(including_emulation=False)
    fabric = Fabric(
        accelerator=chosen.type,
        devices=[chosen.index] if chosen.index is not None and processes == 1 else on_this_machine,
        num_nodes=processes // on_this_machine,
        strategy="ddp" if processes > 1 else "auto",
        precision="bf16-mixed" if half else "32-true",
    )
    fabric.launch()
    return fabric

"""Checkpoints: a training that was killed goes on as if it had not been (paper, section 4.1)."""

from pathlib import Path

from torch import nn
from torch.optim import SGD

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.tensors import read_tensors, write_tensors


def save_checkpoint(path: Path, run: str, net: nn.Module, optimiser: SGD, iteration: int) -> None:
    """Write weights, momenta and the number of the next step, all in one file so that they can't disagree.

    Parameters
    ----------
    path : Path
        A safetensors file, written atomically: a full disk or a kill leaves the checkpoint before it.
    run : str
        What tells this run from others, in full.
    net : Module
    optimiser : SGD
        Of the parameters of `net`.
    iteration : int
    """
    tensors = {f"net.{name}": tensor for name, tensor in net.state_dict().items()}
    for name, parameter in net.named_parameters():
        if parameter in optimiser.state:  # not before its first gradient
            tensors[f"momentum.{name}"] = optimiser.state[parameter]["momentum_buffer"]
    write_tensors(path, tensors, {"run": run, "iteration": str(iteration)})


def load_checkpoint(path: Path, run: str, net: nn.Module, optimiser: SGD) -> int:
    """Restore weights and momenta and return the number of the next step.

    Parameters
    ----------
    path, run, net, optimiser
        As for `save_checkpoint`; network and optimiser are changed in place.

    Raises
    ------
    DataError
        When the file is missing or damaged.
    ArgumentError
        When it belongs to another run.
    """
    header, tensors = read_tensors(path)
    try:
        found, iteration = header["run"], int(header["iteration"])
    except (KeyError, ValueError) as error:
        raise DataError(path, "a checkpoint of a training", error) from error
    if found != run:
        raise ArgumentError("resume", f"the run of {path}, {found}", run)
    for name, parameter in net.named_parameters():
        if f"momentum.{name}" in tensors:
            optimiser.state[parameter]["momentum_buffer"] = tensors.pop(f"momentum.{name}")
    net.load_state_dict({name.removeprefix("net."): tensor for name, tensor in tensors.items()})
    return iteration

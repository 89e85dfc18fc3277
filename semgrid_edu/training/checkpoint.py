"""Checkpoints: a training that was killed goes on as if it had not been (paper, section 4.1)."""

import json
from pathlib import Path

from torch import nn
from torch.optim import SGD

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.networks.weights import check_tensors
from semgrid_edu.storage.tensors import read_tensors, write_tensors


def save_checkpoint(path: Path, run: dict[str, object], net: nn.Module, optimiser: SGD, iteration: int) -> None:
    """Write weights, momenta and the number of the next step, all in one file so that they can't disagree.

    Parameters
    ----------
    path : Path
        A safetensors file, written atomically: a full disk or a kill leaves the checkpoint before it.
    run : dict
        What tells this run from others, by name; anything that JSON can hold.
    net : Module
    optimiser : SGD
        Of the parameters of `net`.
    iteration : int
    """
    tensors = {f"net.{name}": tensor for name, tensor in net.state_dict().items()}
    for name, parameter in net.named_parameters():
        if parameter in optimiser.state:  # not before its first gradient
            tensors[f"momentum.{name}"] = optimiser.state[parameter]["momentum_buffer"]
    write_tensors(path, tensors, {"run": json.dumps(run), "iteration": str(iteration)})


def load_checkpoint(path: Path, run: dict[str, object], net: nn.Module, optimiser: SGD) -> int:
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
        When it belongs to another run; it says in what they differ.
    """
    header, tensors = read_tensors(path)
    try:
        found, iteration = json.loads(header["run"]), int(header["iteration"])
        found = dict(found)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(path, "a checkpoint of a training", error) from error
    _check_run(path, found, json.loads(json.dumps(run)))
    momenta = {name: tensors.pop(f"momentum.{name}", None) for name, _ in net.named_parameters()}
    weights = {name.removeprefix("net."): tensor for name, tensor in tensors.items()}
    check_tensors(path, weights, net.state_dict())
    net.load_state_dict(weights)
    for name, parameter in net.named_parameters():
        if momenta[name] is not None:
            optimiser.state[parameter]["momentum_buffer"] = momenta[name].to(parameter.device)
    return iteration


def _check_run(path: Path, found: dict[str, object], run: dict[str, object]) -> None:
    """Refuse the checkpoint of another run, naming what differs."""
    differing = [name for name in sorted(found.keys() | run.keys()) if found.get(name) != run.get(name)]
    if differing:
        theirs, ours = ({name: one.get(name) for name in differing} for one in (found, run))
        raise ArgumentError("resume", f"the run of {path}, {theirs}", ours)

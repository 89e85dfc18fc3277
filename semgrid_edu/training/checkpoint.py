"""Checkpoints: an interrupted training run resumes as if nothing had happened (paper, section 4.1)."""

import json
from pathlib import Path

from torch import Tensor, nn
from torch.optim import Optimizer

from semgrid_edu.datasets.index import INDEX_FILE
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS
from semgrid_edu.networks.weights import check_tensors
from semgrid_edu.storage.files import check_ours
from semgrid_edu.storage.provenance import PROVENANCE
from semgrid_edu.storage.reading import parse_json
from semgrid_edu.storage.tensors import read_tensors, write_tensors
from semgrid_edu.training.log import HEADER, LOG

CHECKPOINT = "checkpoint.safetensors"
"""Name of the file in a run's folder from which an interrupted run resumes."""


def check_folder(folder: Path, resume: bool) -> None:
    """Check that no finished or interrupted run and no other file would be overwritten.

    Parameters
    ----------
    folder : Path
        The folder of the new training run.
    resume : bool
        Whether it continues an interrupted run.

    Raises
    ------
    DataError
        If the folder contains a run that would be lost, a data set, or other files.
    """
    if (folder / INDEX_FILE).exists():
        raise DataError(folder, "a folder for the training run alone", "a data set")
    if (folder / PROVENANCE).exists() and not (folder / LOG).exists():
        raise DataError(folder, "a folder for the training run alone", f"the {PROVENANCE} of something else")
    if (folder / WEIGHTS).exists():
        raise DataError(folder, "a folder without a trained network, which would be lost", WEIGHTS)
    check_ours(HEADER, folder / LOG, folder / IMAGE_STAGE)
    if (folder / CHECKPOINT).exists():
        if not resume:
            raise DataError(folder, "a folder without an interrupted run (--resume continues it)", CHECKPOINT)
        read_tensors(folder / CHECKPOINT)  # a damaged one is found before the data are prepared


def save_checkpoint(path: Path, run: dict[str, object], net: nn.Module, optimiser: Optimizer, iteration: int) -> None:
    """Write weights, momenta and the number of the next step to one file, so that they always match.

    Parameters
    ----------
    path : Path
        The safetensors file. It is written atomically: when the process is killed or the disk is full, the previous
        checkpoint is still there.
    run : dict
        What distinguishes this run from others, such as its seed, by name; anything that JSON can hold.
    net : Module
        The network that learns.
    optimiser : Optimizer
        The optimiser of the parameters of `net`, which holds what it remembers of them: momenta, and more.
    iteration : int
        Number of the next step, from 0.
    """
    tensors = {f"net.{name}": tensor for name, tensor in net.state_dict().items()}
    for name, parameter in net.named_parameters():
        remembered = optimiser.state.get(parameter, {})  # empty before its first gradient
        tensors |= {f"{key}.{name}": tensor for key, tensor in remembered.items()}
    write_tensors(path, tensors, {"run": json.dumps(run), "iteration": str(iteration)})


def load_checkpoint(path: Path, run: dict[str, object], net: nn.Module, optimiser: Optimizer) -> int:
    """Restore weights and momenta, and return the number of the next step.

    Parameters
    ----------
    path : Path
        A file that `save_checkpoint` wrote.
    run : dict
        What distinguishes this run from others; it must be equal in the file.
    net : Module
        The network, whose weights are replaced.
    optimiser : Optimizer
        The optimiser of its parameters, whose momenta are replaced.

    Returns
    -------
    int
        Number of the next step, from 0.

    Raises
    ------
    DataError
        When the file is missing or damaged.
    ArgumentError
        When the file belongs to another run; the message names the differences.
    """
    header, tensors = read_tensors(path)
    try:
        found = parse_json(path, header["run"])
        iteration = int(header["iteration"])
        if iteration < 0:
            raise ValueError(f"step {iteration}")
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(path, "a checkpoint of a training run", error) from error
    _check_run(path, found, json.loads(json.dumps(run)))
    parts: dict[str, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        part, _, layer = name.partition(".")
        parts.setdefault(part, {})[layer] = tensor
    weights = parts.pop("net", {})
    check_tensors(path, weights, net.state_dict())
    net.load_state_dict(weights)
    parameters = dict(net.named_parameters())
    for part, remembered in parts.items():
        for name, tensor in remembered.items():
            parameter = parameters[name]
            # AdamW counts its steps on the CPU.
            optimiser.state[parameter][part] = tensor if part == "step" else tensor.to(parameter.device)
    return iteration


def _check_run(path: Path, found: dict[str, object], run: dict[str, object]) -> None:
    """Check that a checkpoint belongs to this run, or name the differences."""
    differing = [name for name in sorted(found.keys() | run.keys()) if found.get(name) != run.get(name)]
    if differing:
        theirs, ours = ({name: one.get(name) for name in differing} for one in (found, run))
        raise ArgumentError("resume", f"the run of {path}, {theirs}", ours)

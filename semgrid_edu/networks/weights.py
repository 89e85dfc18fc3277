"""Weights on disk: safetensors files with their architecture (section 4)."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from torch import Tensor, nn

from semgrid_edu.camera import Camera
from semgrid_edu.errors import DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks.build import build_net
from semgrid_edu.networks.semantic_grid import Architecture, SemanticGridNet
from semgrid_edu.planes import PlaneSampler
from semgrid_edu.storage.reading import parse_json
from semgrid_edu.storage.tensors import read_tensors, write_tensors

IMAGE_STAGE, WEIGHTS = "image_stage.safetensors", "weights.safetensors"
"""The files that a training run writes to its folder: the network after each of the two stages."""


def save_net(net: SemanticGridNet, path: str | Path, half: bool = False) -> None:
    """Write a network's weights and its architecture, atomically.

    Parameters
    ----------
    net : SemanticGridNet
        A network with an architecture, from `build_net` or `load_net`. The camera's calibration isn't saved: it belongs
        to the drive.
    path : path-like
        The safetensors file to write.
    half : bool
        Whether convolutions are written in 16 bits, which takes half the space. Biases and batch normalisation stay in
        32, because running variances span many orders of magnitude. `load_net` gives a network of 32 bits again.

    Raises
    ------
    ArgumentError
        If the network has no architecture, because it couldn't be rebuilt from the file.
    """
    description = asdict(net.need_architecture())
    for name in ("uses_occupancy", "reduces", "n_segmenters", "uses_return_heights"):
        # Omit defaults, so that files older than these fields keep their checksums when they are rewritten.
        if description[name] == getattr(Architecture, name):
            del description[name]
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in net.state_dict().items()}
    if half:
        tensors = {name: tensor.half() if tensor.ndim > 1 else tensor for name, tensor in tensors.items()}
    write_tensors(path, tensors, {"architecture": json.dumps(description)})


def load_net(path: str | Path, camera: Camera, sampler: type[nn.Module] = PlaneSampler) -> SemanticGridNet:
    """Read a trained network and place its planes for a camera.

    Parameters
    ----------
    path : path-like
        A file that `save_net` wrote.
    camera : Camera
        Calibration of the images that the network will see.
    sampler : type
        The class that samples the planes, as for `build_net`.

    Returns
    -------
    SemanticGridNet
        The network, in evaluation mode.

    Raises
    ------
    DataError
        When the file is missing, damaged or from another program, its weights don't fit the architecture in its
        header, or a weight isn't a finite number.
    """
    header, tensors = read_tensors(path)
    with _named(path, header):
        net = build_net(_architecture(path, header), camera, sampler=sampler)
    check_tensors(path, tensors, net.state_dict())
    net.load_state_dict(tensors)
    return net.eval()


def read_architecture(path: str | Path) -> Architecture:
    """Return the architecture of a trained network. Errors are those of `load_net`.

    Parameters
    ----------
    path : path-like
        A file that `save_net` wrote.
    """
    header, _ = read_tensors(path)
    with _named(path, header):
        return _architecture(path, header)


@contextmanager
def _named(path: str | Path, header: dict) -> Iterator[None]:
    """Turn any error about the architecture into an error that names the file."""
    try:
        yield
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        found = f"{str(header)[:300]}: {error}"
        raise DataError(path, "the architecture of a network in the header", found) from error


def _architecture(path: str | Path, header: dict) -> Architecture:
    """Return the architecture from the header, where `save_net` put it as a nested dictionary."""
    values = parse_json(path, header["architecture"])
    tuples = {name: tuple(values[name]) for name in ("image_size", "heights")}
    return Architecture(**(values | tuples | {"grid": GridSpec(**values["grid"])}))


def weights_doubts(path: str | Path) -> list[str]:
    """List doubts about a weights file that will be used as a whole network, i and o -> g.

    Parameters
    ----------
    path : path-like
        A file that `save_net` wrote.

    Returns
    -------
    list of str
        One line per doubt.

    Raises
    ------
    DataError
        If the file is missing or damaged, or is from the image stage, so that its fusion network is untrained.
    """
    _, tensors = read_tensors(path)
    # Batch normalisation counts its training batches.
    learnt = {name: bool((count > 0).any()) for name, count in tensors.items() if name.endswith("num_batches_tracked")}
    fusion = [has_learnt for name, has_learnt in learnt.items() if name.startswith("fusion.")]
    if fusion and not any(fusion) and any(learnt.values()):
        raise DataError(path, f"a whole network, such as {WEIGHTS}", "one of the image stage: its fusion hasn't learnt")
    doubts = [] if any(fusion) else [DataError(path, "a network that has learnt", "one that hasn't made a step")]
    weights = [found for found in tensors.values() if found.is_floating_point() and found.ndim > 1]
    if weights and all(bool((found == found.round()).all()) for found in weights):
        doubts.append(DataError(path, "weights like 0.137", "only whole numbers: were they rounded?"))
    return [str(doubt) for doubt in doubts]


def check_tensors(path: str | Path, found: dict[str, Tensor], expected: dict[str, Tensor]) -> None:
    """Raise a `DataError` about the first tensor that doesn't fit the network, if there is one.

    Parameters
    ----------
    path : path-like
        The file that the tensors come from.
    found, expected : dict of str to Tensor
        The tensors of the file and those of the network; names and shapes are compared.
    """
    for name in sorted(found.keys() | expected.keys()):
        have = tuple(found[name].shape) if name in found else "nothing"
        want = tuple(expected[name].shape) if name in expected else "nothing"
        if have != want:
            raise DataError(path, f"{want} for {name}", have)
        if not found[name].isfinite().all():
            raise DataError(path, f"finite numbers for {name}", "NaN or infinity")
        if name.endswith("running_var") and found[name].min() < 0:
            raise DataError(path, f"variances of at least 0 for {name}", float(found[name].min()))

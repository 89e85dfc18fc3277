"""First weights from ImageNet: the published encoders, from a local file in torchvision's naming (section 4.3)."""

from itertools import chain
from pathlib import Path

import torch
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.deeplab import DeepLab
from semgrid_edu.networks.fcn import Fcn
from semgrid_edu.networks.segnet import SegNet
from semgrid_edu.networks.vgg import DEPTHS
from semgrid_edu.networks.weights import check_tensors
from semgrid_edu.storage.tensors import read_tensors

FCN_HIDDEN = {"classifier.0": "conv6.0", "classifier.3": "conv7.0"}
"""VGG16's fully connected layers and the convolutions that FCN makes of them."""


def load_imagenet(segmenter: nn.Module, path: str | Path) -> None:
    """Give an image network's encoder the weights that it learnt on ImageNet.

    Parameters
    ----------
    segmenter : SegNet, Fcn or DeepLab
        Of preset "paper". Changed in place, or not at all.
    path : path-like
        A safetensors file with the names and shapes of torchvision's `vgg16` (SegNet, FCN) or `resnet101`
        (DeepLab). Tensors of other layers, such as ImageNet's own classifier, are left where they are.

    Raises
    ------
    ArgumentError
        When the network has no published ImageNet weights.
    DataError
        When the file is missing, damaged, not of safetensors, or lacks a tensor or has it in another shape.

    Notes
    -----
    What is loaded: for SegNet the thirteen convolutions, but not its batch normalisation, which VGG16 lacks
    and which stays as it is; for FCN the same and the two hidden layers of the classifier as conv6 and conv7;
    for DeepLab all of ResNet-101 before the classifier, with scales, shifts and running statistics of its
    batch normalisation. Decoders and score layers keep their weights.

    Pickled files (`.pth`) are refused: reading one can run any code that is in it. Convert it once, where
    you trust it::

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


def imagenet_tensors(segmenter: nn.Module) -> dict[str, Tensor]:
    """Return the network's tensors that the file fills, by their names in the file."""
    if isinstance(segmenter, SegNet):
        convolutions = [layer[0] for layer in chain.from_iterable(segmenter.conv_deconv.encoder)]
        # The compact encoder has fewer convolutions; its shapes aren't those of the file.
        return _named(dict(zip(_vgg_names(), convolutions, strict=False)))
    if isinstance(segmenter, Fcn):
        convolutions = [layer for layer in segmenter.backbone.features if isinstance(layer, nn.Conv2d)]
        hidden = {name: segmenter.get_submodule(own) for name, own in FCN_HIDDEN.items()}
        return _named(dict(zip(_vgg_names(), convolutions, strict=True)) | hidden)
    if isinstance(segmenter, DeepLab):
        state = segmenter.backbone.state_dict()
        return {name: own for name, own in state.items() if not name.endswith("num_batches_tracked")}
    raise ArgumentError("segmenter", "a SegNet, Fcn or DeepLab", type(segmenter).__name__)


def _vgg_names() -> list[str]:
    """Return torchvision's names of VGG16's convolutions: layers are numbered, ReLU and pooling included."""
    starts = [sum(2 * depth + 1 for depth in DEPTHS[:stage]) for stage in range(len(DEPTHS))]
    return [f"features.{start + 2 * k}" for start, depth in zip(starts, DEPTHS, strict=True) for k in range(depth)]


def _named(modules: dict[str, nn.Module]) -> dict[str, Tensor]:
    """Return the modules' parameters, each named after its module."""
    return {f"{name}.{part}": own for name, module in modules.items() for part, own in module.named_parameters()}


def _as_published(name: str, own: Tensor) -> Tensor:
    """Return a tensor as it is in the file: fully connected layers know no rows and columns."""
    return own.flatten(1) if name.startswith("classifier") and own.ndim == 4 else own

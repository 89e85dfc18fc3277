"""What all image networks share: bytes -> RGB in 0..1 -> one score per class and pixel (paper, section 3.1)."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError

IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Mean and standard deviation of red, green and blue over ImageNet's images, 0..1. Weights learnt on ImageNet expect
inputs normalised by them."""


def unit_image(image: Tensor) -> Tensor:
    """Scale the bytes of an image to 0..1.

    Parameters
    ----------
    image : (..., 3, h, w) uint8
        RGB, 0..255.

    Returns
    -------
    (..., 3, h, w) float32
        RGB, 0..1, in PyTorch's default type, which is float32 unless a program changes it.

    Raises
    ------
    ArgumentError
        If the image isn't uint8: it may have been scaled already.

    Examples
    --------
    >>> unit_image(torch.tensor([0, 51, 255], dtype=torch.uint8))
    tensor([0.0000, 0.2000, 1.0000])
    """
    if image.dtype != torch.uint8:
        raise ArgumentError("image", "bytes, 0..255, torch.uint8", image.dtype)
    return image / 255


class Segmenter(nn.Module, ABC):
    """An image network, i -> s: normalises the image, then scores it.

    A subclass lists its presets, makes its layers in `build` and scores an image in `scores`. CONTRIBUTING.md shows how
    to add one.

    Parameters
    ----------
    n_classes : int
        C, the number of classes that are scored.
    preset : str
        Name of a size in `PRESETS`: "compact" or "paper".
    seed : int
        Seed for the initial weights.
    """

    PRESETS: ClassVar[dict[str, dict[str, Any]]]
    """The keyword arguments of `build`, for each preset."""

    IMAGENET: ClassVar[str | None] = None
    """Name of the published network whose ImageNet weights the encoder can start from; None if there is none."""

    MEAN: ClassVar[tuple[float, ...]] = IMAGENET_MEAN
    STD: ClassVar[tuple[float, ...]] = IMAGENET_STD
    """What the published weights expect the images to be normalised by: mean and deviation of red, green and blue."""

    def __init__(self, n_classes: int, preset: str = "compact", seed: int = 0) -> None:
        super().__init__()
        if preset not in self.PRESETS:
            raise ArgumentError("preset", f"one of {', '.join(self.PRESETS)}", repr(preset))
        self.n_classes = n_classes
        self.register_buffer("mean", torch.tensor(self.MEAN).view(3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(self.STD).view(3, 1, 1), persistent=False)
        with fresh_weights(self, seed):
            self.build(n_classes, **self.PRESETS[preset])

    def forward(self, image: Tensor) -> Tensor:
        """Return s, the scores of each class at each pixel, without a soft-max.

        Parameters
        ----------
        image : (B, 3, h, w) float
            RGB, 0..1.

        Returns
        -------
        (B, C, h, w) float
            One score per class and pixel.
        """
        if image.ndim != 4 or image.shape[1] != 3:
            raise ArgumentError("image", "shape (B, 3, h, w)", tuple(image.shape))
        if not image.is_floating_point():
            raise ArgumentError("image", "floats in 0..1", image.dtype)
        normalised = (image - self.mean) / self.std
        # Channels last in memory: faster on a CPU, with the same result up to rounding.
        return self.scores(normalised.contiguous(memory_format=torch.channels_last))

    @abstractmethod
    def build(self, n_classes: int, **preset: Any) -> None:
        """Make the layers of one preset; `fresh_weights` draws their initial weights afterwards.

        Parameters
        ----------
        n_classes : int
            C, the number of classes that are scored.
        **preset
            The keyword arguments that the preset has in `PRESETS`.
        """

    @abstractmethod
    def scores(self, x: Tensor) -> Tensor:
        """Return the scores of normalised images.

        Parameters
        ----------
        x : (B, 3, h, w) float
            RGB, normalised by `MEAN` and `STD`.

        Returns
        -------
        (B, C, h, w) float
            One score per class and pixel, before any soft-max.
        """

    def imagenet_tensors(self) -> dict[str, Tensor]:
        """Return the encoder's tensors (not copies) that published weights replace, by their published names."""
        return {}


@contextmanager
def fresh_weights(net: nn.Module, seed: int) -> Iterator[None]:
    """Make the initial weights of the layers created in the block depend only on the seed.

    PyTorch's layers draw their initial weights from the CPU's global generator. Inside the block that generator starts
    from the seed; afterwards its state is restored. Then `initialise` redraws the weights of the convolutions.

    Parameters
    ----------
    net : Module
        The network whose layers are created in the block.
    seed : int
        Seed for the initial weights.
    """
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(seed)
        yield
    initialise(net, seed)


def initialise(net: nn.Module, seed: int) -> None:
    """Draw new weights for all convolutions, scaled so that signals keep their size from layer to layer.

    The weights are normal and the biases zero. The variance of convolutions is 2 / fan-in, because the ReLU after them
    halves the power of its input (He et al., 2015). The variance of up-convolutions is 1 / (number of input channels):
    no ReLU follows them, and their strides leave no overlap, so each pixel of the result is a sum over the channels of
    one input pixel. Other layers are unchanged.

    Parameters
    ----------
    net : Module
        The network, changed in place.
    seed : int
        Seed for the weights.
    """
    generator = torch.Generator().manual_seed(seed)
    for module in net.modules():
        if isinstance(module, nn.Conv2d | nn.Conv3d):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu", generator=generator)
        elif isinstance(module, nn.ConvTranspose2d):
            nn.init.normal_(module.weight, std=module.in_channels**-0.5, generator=generator)
        else:
            continue
        if module.bias is not None:
            nn.init.zeros_(module.bias)

"""What all image networks share: RGB in 0..1 -> a score for each class and pixel (paper, section 3.1)."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.conv_deconv import fresh_weights

IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of red, green and blue over ImageNet's images, 0..1: what weights learnt there expect."""


class Segmenter(nn.Module, ABC):
    """An image network, i -> s. A subclass lists its presets and says how it builds and scores.

    Parameters
    ----------
    n_classes : int
        C.
    preset : str
        "compact" or "paper".
    seed : int
        Of the initial weights.

    Raises
    ------
    ArgumentError
        When there is no such preset.
    """

    PRESETS: ClassVar[dict[str, dict[str, Any]]]
    """What `build` takes, for each preset."""

    def __init__(self, n_classes: int, preset: str = "compact", seed: int = 0) -> None:
        super().__init__()
        if preset not in self.PRESETS:
            raise ArgumentError("preset", f"one of {', '.join(self.PRESETS)}", repr(preset))
        self.n_classes = n_classes
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(3, 1, 1), persistent=False)
        with fresh_weights(self, seed):
            self.build(n_classes, **self.PRESETS[preset])

    def forward(self, image: Tensor) -> Tensor:
        """Return s, the scores of each class at each pixel, no soft-max.

        Parameters
        ----------
        image : (B, 3, h, w) float
            RGB, 0..1.

        Returns
        -------
        (B, C, h, w) float

        Raises
        ------
        ArgumentError
            When the image isn't of floats or of another shape, or too small for the network.
        """
        if image.ndim != 4 or image.shape[1] != 3:
            raise ArgumentError("image", "shape (B, 3, h, w)", tuple(image.shape))
        if not image.is_floating_point():
            raise ArgumentError("image", "floats in 0..1", image.dtype)
        # Channels last in memory: half the time on a CPU, the same numbers.
        return self.scores(((image - self.mean) / self.std).contiguous(memory_format=torch.channels_last))

    @abstractmethod
    def build(self, n_classes: int, **preset: Any) -> None:
        """Make the layers of one preset; their first weights are drawn afterwards."""

    @abstractmethod
    def scores(self, x: Tensor) -> Tensor:
        """Return the scores, (B, C, h, w), of images of zero mean and unit deviation, (B, 3, h, w)."""

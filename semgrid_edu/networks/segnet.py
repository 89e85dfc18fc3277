"""SegNet: from an image to a score for each class and pixel (paper, section 3.1)."""

from typing import ClassVar

import torch
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.conv_deconv import ConvDeconv, fresh_weights

IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of red, green and blue over ImageNet's images, 0..1: what weights learnt there expect."""


class SegNet(nn.Module):
    """Segment an image by an encoder of VGG16's shape and a decoder that unpools by its indices.

    Parameters
    ----------
    n_classes : int
        C.
    preset : str
        "paper" has VGG16's thirteen convolutions down and thirteen up; "compact" is the same, narrow and
        shallow enough for two cores. Both have two convolutions at full resolution: after unpooling three
        pixels in four are empty, and a single one leaves them speckled.
    seed : int
        Of the initial weights.

    References
    ----------
    Badrinarayanan, Kendall, Cipolla: SegNet: A Deep Convolutional Encoder-Decoder Architecture for Image
    Segmentation. PAMI 39(12), 2017.
    """

    PRESETS: ClassVar = {
        "compact": {"widths": (16, 32, 64, 96), "depths": (2, 1, 2, 2)},
        "paper": {"widths": (64, 128, 256, 512, 512), "depths": (2, 2, 3, 3, 3)},
    }

    def __init__(self, n_classes: int, preset: str = "compact", seed: int = 0) -> None:
        super().__init__()
        if preset not in self.PRESETS:
            raise ArgumentError("preset", f"one of {', '.join(self.PRESETS)}", repr(preset))
        self.n_classes = n_classes
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(3, 1, 1), persistent=False)
        with fresh_weights(self, seed):
            self.conv_deconv = ConvDeconv(3, n_classes, **self.PRESETS[preset])

    def forward(self, image: Tensor) -> Tensor:
        """Return s, the scores of each class at each pixel, no soft-max.

        Parameters
        ----------
        image : (B, 3, h, w) float
            RGB, 0..1.

        Returns
        -------
        (B, C, h, w) float
        """
        return self.conv_deconv((image - self.mean) / self.std)

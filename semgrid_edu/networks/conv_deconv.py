"""The conv-deconv network: max-pooling down, unpooling by the same indices up (paper, sections 3.1 and 3.4, Fig. 5).

SegNet is one whose input is an image. The fusion network has one, too.
"""

from itertools import chain, pairwise
from typing import ClassVar

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.networks.vgg import vgg16_tensors


def conv_bn_relu(n_in: int, n_out: int) -> nn.Sequential:
    """Return one layer of Fig. 5: 3x3 convolution, batch normalisation, ReLU; the map keeps its size.

    Parameters
    ----------
    n_in, n_out : int
        Number of channels of the input and of the result.

    Returns
    -------
    Sequential
        The three layers, with fresh weights.
    """
    return nn.Sequential(nn.Conv2d(n_in, n_out, 3, padding=1), nn.BatchNorm2d(n_out), nn.ReLU(inplace=True))


class ConvDeconv(nn.Module):
    """Encode a map by convolutions and max-pooling; decode it by convolutions and unpooling to where the maxima were.

    Each of the S stages halves the map on the way down and restores it on the way up. The decoder has as many
    layers as the encoder, in reverse order, and its last layer gives the result, without normalisation or ReLU.
    A pooled map no longer shows where in its 2x2 window each maximum was. The encoder keeps these indices, and the
    decoder puts the values back there, so that borders stay sharp without any weights (Badrinarayanan, Kendall and
    Cipolla, SegNet, PAMI 2017).

    Parameters
    ----------
    n_in, n_out : int
        Number of channels of the input and of the result.
    widths : (S,) int
        Number of channels in each stage.
    depths : (S,) int
        Number of convolutions in each stage, on the way down and again on the way up.
    skips : bool
        Whether each decoder stage also sees its encoder stage's map before pooling (Ronneberger, Fischer
        and Brox, U-Net, 2015).
    """

    def __init__(
        self, n_in: int, n_out: int, widths: tuple[int, ...], depths: tuple[int, ...], skips: bool = False
    ) -> None:
        super().__init__()
        self.skips = skips
        below = (n_in, *widths[:-1])
        self.encoder = nn.ModuleList(
            nn.Sequential(*_layers([start] + [width] * depth))
            for start, width, depth in zip(below, widths, depths, strict=True)
        )
        above = (n_out, *widths[:-1])
        self.decoder = nn.ModuleList(
            nn.Sequential(*_layers([width * (1 + skips)] + [width] * (depth - 1) + [end], plain_end=stage == 0))
            for stage, (width, depth, end) in enumerate(zip(widths, depths, above, strict=True))
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return the result at the size of the input.

        Parameters
        ----------
        x : (B, n_in, H, W) float
            The map to encode.

        Returns
        -------
        (B, n_out, H, W) float
            The result of the last layer.
        """
        smallest = 2 ** len(self.encoder)
        if min(x.shape[2:]) < smallest:
            raise ArgumentError("x", f"maps of {smallest} x {smallest} or larger", tuple(x.shape))
        # Channels last in memory: faster on a CPU, with the same result up to rounding.
        x = x.contiguous(memory_format=torch.channels_last)
        levels = []
        for encode in self.encoder:
            before = encode(x)
            x, indices = F.max_pool2d(before, 2, return_indices=True)
            levels.append((before, indices))
        for decode, (before, indices) in zip(reversed(self.decoder), reversed(levels), strict=True):
            # The size is given because 35 rows and 34 both pool to 17.
            x = F.max_unpool2d(x, indices, 2, output_size=before.shape[2:])
            x = decode(torch.cat([x, before], dim=1) if self.skips else x)
        return x


def _layers(channels: list[int], plain_end: bool = False) -> list[nn.Module]:
    """Return the layers from each number of channels to the next; with `plain_end` the last is a convolution alone."""
    layers = [conv_bn_relu(n_in, n_out) for n_in, n_out in pairwise(channels)]
    return [*layers[:-1], layers[-1][0]] if plain_end else layers


class SegNet(Segmenter):
    """Segment an image by an encoder shaped like VGG16 and a decoder that unpools by the encoder's indices.

    The encoder halves the maps by max-pooling and remembers where in each 2x2 window the maximum was. The decoder
    mirrors the encoder: each of its stages puts the values back in these places, then convolves. The last convolution
    gives the scores. All of this is `ConvDeconv`, here with the three channels of an image as input.

    The other Parameters are those of `Segmenter`.

    Parameters
    ----------
    preset : str
        "paper" has VGG16's thirteen convolutions on the way down and thirteen on the way up; "compact" is narrower and
        shallower, for two cores. Both have two convolutions at full resolution: unpooling leaves three pixels in four
        empty, and a single convolution isn't enough to fill them without speckles.

    References
    ----------
    Badrinarayanan, Kendall, Cipolla: SegNet: A Deep Convolutional Encoder-Decoder Architecture for Image
    Segmentation. PAMI 39(12), 2017.
    """

    PRESETS: ClassVar = {
        "compact": {"widths": (16, 32, 48, 64), "depths": (2, 1, 1, 2)},
        "paper": {"widths": (64, 128, 256, 512, 512), "depths": (2, 2, 3, 3, 3)},
    }
    IMAGENET = "vgg16"

    def build(self, n_classes: int, widths: tuple[int, ...], depths: tuple[int, ...]) -> None:
        """Make the encoder and its mirror image, see `ConvDeconv`.

        The other Parameters are those of `Segmenter.build`.

        Parameters
        ----------
        widths : (S,) int
            Number of channels in each stage.
        depths : (S,) int
            Number of convolutions in each stage, on the way down and again on the way up.
        """
        self.conv_deconv = ConvDeconv(3, n_classes, widths, depths)

    def scores(self, x: Tensor) -> Tensor:
        """Return the scores. Parameters and result are those of `Segmenter.scores`."""
        return self.conv_deconv(x)

    def imagenet_tensors(self) -> dict[str, Tensor]:
        """Return weights and biases of the encoder's convolutions; VGG16 has no batch normalisation to load."""
        return vgg16_tensors(layer[0] for layer in chain.from_iterable(self.conv_deconv.encoder))

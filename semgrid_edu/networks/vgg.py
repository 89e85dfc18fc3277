"""VGG16's thirteen convolutions: the encoder of FCN (paper, section 3.1; Simonyan and Zisserman, 2015)."""

from itertools import pairwise

from torch import Tensor, nn

DEPTHS = (2, 2, 3, 3, 3)
"""Convolutions of each stage: thirteen (Simonyan and Zisserman, table 1, column D)."""


class Vgg(nn.Module):
    """Five stages of 3x3 convolutions, each halved by max-pooling at its end.

    Pooling rounds up, as in the framework that the network was published in: a last odd row or column is kept,
    and cell i of a pooled map covers pixels 2 i and 2 i + 1, whatever the size. Parameters are named as in
    torchvision's `vgg16` (`vgg16_bn` with batch normalisation).

    Parameters
    ----------
    widths : (5,) int
        Channels of each stage.
    batch_norm : bool
        Whether each convolution is followed by batch normalisation; the published network has none.
    """

    def __init__(self, widths: tuple[int, ...], batch_norm: bool) -> None:
        super().__init__()
        stages = zip((3, *widths[:-1]), widths, DEPTHS, strict=True)
        self.features = nn.Sequential(
            *(layer for start, width, depth in stages for layer in _stage(start, width, depth, batch_norm))
        )

    def forward(self, x: Tensor) -> list[Tensor]:
        """Return what each stage's pooling gives, (B, 3, h, w) -> five maps of 1/2, 1/4, ... 1/32 of the size."""
        pooled = []
        for layer in self.features:
            x = layer(x)
            if isinstance(layer, nn.MaxPool2d):
                pooled.append(x)
        return pooled


def conv_relu(n_in: int, n_out: int, kernel: int, batch_norm: bool) -> list[nn.Module]:
    """Return a convolution that keeps the size, batch normalisation where wanted, and ReLU.

    Parameters
    ----------
    n_in, n_out : int
        Channels.
    kernel : int
        Its side, odd, pixels.
    batch_norm : bool

    Returns
    -------
    list of Module
    """
    norm = [nn.BatchNorm2d(n_out)] if batch_norm else []
    return [nn.Conv2d(n_in, n_out, kernel, padding=kernel // 2), *norm, nn.ReLU(inplace=True)]


def _stage(start: int, width: int, depth: int, batch_norm: bool) -> list[nn.Module]:
    """Return the layers of one stage, pooling included."""
    channels = [start] + [width] * depth
    layers = [layer for n_in, n_out in pairwise(channels) for layer in conv_relu(n_in, n_out, 3, batch_norm)]
    return [*layers, nn.MaxPool2d(2, ceil_mode=True)]

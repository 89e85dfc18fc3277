"""VGG16's thirteen convolutions, the encoder of FCN; SegNet's has the same shape (Simonyan and Zisserman, 2015)."""

from collections.abc import Iterable
from itertools import pairwise

from torch import Tensor, nn

DEPTHS = (2, 2, 3, 3, 3)
"""Number of convolutions in each stage, thirteen in all (Simonyan and Zisserman, table 1, column D)."""


class Vgg(nn.Module):
    """Compute feature maps by five stages of 3x3 convolutions with ReLU, each followed by 2x2 max-pooling.

    Pooling rounds up, as in Caffe, for which the network was published: a last odd row or column is kept, and cell i of
    a pooled map covers pixels 2 i and 2 i + 1, whatever the size. Parameters are named as in
    torchvision's `vgg16` (`vgg16_bn` with batch normalisation).

    Parameters
    ----------
    widths : (5,) int
        Number of channels in each stage.
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
        """Return the map after the pooling of each stage.

        Parameters
        ----------
        x : (B, 3, h, w) float
            Normalised images.

        Returns
        -------
        list of (B, width, H, W) float
            Five maps, at 1/2, 1/4, ... 1/32 of the size, rounded up.
        """
        pooled = []
        for layer in self.features:
            x = layer(x)
            if isinstance(layer, nn.MaxPool2d):
                pooled.append(x)
        return pooled


def conv_relu(n_in: int, n_out: int, kernel: int, batch_norm: bool) -> list[nn.Module]:
    """Return a convolution that keeps the size, batch normalisation if wanted, and ReLU.

    Parameters
    ----------
    n_in, n_out : int
        Number of channels of the input and of the result.
    kernel : int
        Side of the kernel, odd, pixels.
    batch_norm : bool
        Whether there is batch normalisation between convolution and ReLU.

    Returns
    -------
    list of Module
        Two or three layers, in their order.
    """
    norm = [nn.BatchNorm2d(n_out)] if batch_norm else []
    return [nn.Conv2d(n_in, n_out, kernel, padding=kernel // 2), *norm, nn.ReLU(inplace=True)]


def vgg16_tensors(layers: Iterable[nn.Module]) -> dict[str, Tensor]:
    """Return the weights and biases of layers under their names in torchvision's `vgg16`.

    Parameters
    ----------
    layers : iterable of Module
        The thirteen convolutions in order, then the two that replace the hidden layers of the classifier, if the
        network has them.

    Returns
    -------
    dict of str to Tensor
        The layers' tensors (not copies) under names such as "features.0.weight".
    """
    named = zip(_layer_names(), layers, strict=False)
    return {f"{name}.{part}": tensor for name, layer in named for part, tensor in layer.named_parameters()}


def _layer_names() -> list[str]:
    """Return torchvision's names of VGG16's layers with weights. It numbers all layers, ReLU and pooling included."""
    starts = [sum(2 * depth + 1 for depth in DEPTHS[:stage]) for stage in range(len(DEPTHS))]
    features = [f"features.{start + 2 * k}" for start, depth in zip(starts, DEPTHS, strict=True) for k in range(depth)]
    return [*features, "classifier.0", "classifier.3"]


def _stage(start: int, width: int, depth: int, batch_norm: bool) -> list[nn.Module]:
    """Return the layers of one stage, from `start` channels to `width`, with pooling at the end."""
    channels = [start] + [width] * depth
    layers = [layer for n_in, n_out in pairwise(channels) for layer in conv_relu(n_in, n_out, 3, batch_norm)]
    return [*layers, nn.MaxPool2d(2, ceil_mode=True)]

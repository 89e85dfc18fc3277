"""SegNet: from an image to one score per class and pixel (paper, section 3.1)."""

from itertools import chain
from typing import ClassVar

from torch import Tensor

from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.networks.vgg import vgg16_tensors


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

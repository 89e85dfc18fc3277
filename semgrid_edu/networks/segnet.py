"""SegNet: from an image to a score for each class and pixel (paper, section 3.1)."""

from typing import ClassVar

from torch import Tensor

from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.segmenter import Segmenter


class SegNet(Segmenter):
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
        "compact": {"widths": (16, 32, 48, 64), "depths": (2, 1, 1, 2)},
        "paper": {"widths": (64, 128, 256, 512, 512), "depths": (2, 2, 3, 3, 3)},
    }

    def build(self, n_classes: int, widths: tuple[int, ...], depths: tuple[int, ...]) -> None:
        """Make the encoder and its mirror image."""
        self.conv_deconv = ConvDeconv(3, n_classes, widths, depths)

    def scores(self, x: Tensor) -> Tensor:
        """Return the scores, (B, 3, h, w) -> (B, C, h, w)."""
        return self.conv_deconv(x)

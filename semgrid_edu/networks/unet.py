"""U-Net: skip connections carry whole feature maps, where SegNet passes only indices (Ronneberger et al., 2015)."""

from itertools import pairwise
from typing import ClassVar

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.conv_deconv import conv_bn_relu
from semgrid_edu.networks.segmenter import Segmenter


class UNet(Segmenter):
    """Segment an image by an encoder and a decoder that also sees each of the encoder's maps.

    Every stage has two 3x3 convolutions. The encoder halves the map between stages by max-pooling; the decoder doubles
    it by a learnt up-convolution and appends the encoder's map of that size as further channels (the skip connection).
    A 1x1 convolution scores the classes.

    The other Parameters are those of `Segmenter`.

    Parameters
    ----------
    preset : str
        "paper" has the published widths, 64 to 1024, and 31,044,366 parameters for 14 classes; "compact" is an
        eighth as wide.

    Notes
    -----
    This is the padded variant: convolutions keep the size, so the encoder's maps fit without cropping and the scores
    have the size of the image, whereas the publication loses 92 pixels on each side. Each 3x3 convolution is followed
    by batch normalisation, as in SegNet; the publication has none. The publication's dropout is left out, because it
    would draw from a global generator. Where a map has an odd side, the last row or column of the up-convolution is
    only its bias.

    References
    ----------
    Ronneberger, Fischer, Brox: U-Net: Convolutional Networks for Biomedical Image Segmentation. MICCAI 2015.
    """

    PRESETS: ClassVar = {"compact": {"widths": (8, 16, 32, 64, 128)}, "paper": {"widths": (64, 128, 256, 512, 1024)}}

    def build(self, n_classes: int, widths: tuple[int, ...]) -> None:
        """Make encoder, up-convolutions, decoder (finest stage first) and the final 1x1 convolution.

        The other Parameters are those of `Segmenter.build`.

        Parameters
        ----------
        widths : (S,) int
            Number of channels in each stage.
        """
        self.encoder = nn.ModuleList(_double(n_in, n_out) for n_in, n_out in pairwise((3, *widths)))
        self.up = nn.ModuleList(nn.ConvTranspose2d(below, width, 2, stride=2) for width, below in pairwise(widths))
        self.decoder = nn.ModuleList(_double(2 * width, width) for width in widths[:-1])
        self.score = nn.Conv2d(widths[0], n_classes, 1)

    def scores(self, x: Tensor) -> Tensor:
        """Return the scores. Parameters and result are those of `Segmenter.scores`."""
        smallest = 2 ** len(self.up)
        if min(x.shape[2:]) < smallest:
            raise ArgumentError("image", f"{smallest} x {smallest} pixels or more", tuple(x.shape))
        skips = [self.encoder[0](x)]
        for encode in self.encoder[1:]:
            skips.append(encode(F.max_pool2d(skips[-1], 2)))
        x = skips.pop()
        for up, decode, skip in zip(reversed(self.up), reversed(self.decoder), reversed(skips), strict=True):
            # The size is given because 35 rows and 34 both pool to 17.
            larger = up(x, output_size=skip.shape[2:])
            x = decode(torch.cat([skip, larger], dim=1))
        return self.score(x)


def _double(n_in: int, n_out: int) -> nn.Sequential:
    """Return the two convolutions of one stage, with normalisation and ReLU."""
    return nn.Sequential(conv_bn_relu(n_in, n_out), conv_bn_relu(n_out, n_out))

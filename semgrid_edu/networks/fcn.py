"""FCN-8s: scores from three depths of VGG16, summed on the way up (paper, section 3.1; Long et al., 2015)."""

from typing import ClassVar

import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.networks.segmenter import Segmenter
from semgrid_edu.networks.vgg import Vgg, conv_relu, vgg16_tensors


class Fcn(Segmenter):
    """Segment an image by a fully convolutional VGG16 with skip connections that add the scores of finer stages.

    The two hidden layers of VGG16's classifier become a 7x7 convolution, conv6, and a 1x1 convolution, conv7. A 1x1
    convolution then scores the classes at 1/32 of the resolution. These scores are upsampled twofold and added to the
    scores of pool4 at 1/16, upsampled twofold again and added to those of pool3 at 1/8, and upsampled eightfold to
    the image: hence "8s". Upsampling is bilinear and fixed, as in the authors' released networks.

    The other Parameters are those of `Segmenter`.

    Parameters
    ----------
    preset : str
        "paper" is VGG16 with 4096 channels in conv6 and conv7; "compact" has the same layers, but narrow, and batch
        normalisation, without which a network this deep hardly learns from random weights.

    Notes
    -----
    Three things differ from the publication. Convolutions are padded to keep the size, whereas the publication pads
    the image by 100 pixels and crops by offsets. (Pooling rounds up in both, so every size of image works; here maps
    are cropped only at their lower and right edges.) Score layers start with random weights, not with zeros, so that
    the encoder learns from the first step on. There is no dropout, because it would draw from a global generator.

    References
    ----------
    Long, Shelhamer, Darrell: Fully Convolutional Networks for Semantic Segmentation. CVPR 2015.
    """

    PRESETS: ClassVar = {
        "compact": {"widths": (16, 32, 48, 64, 64), "hidden": 48, "batch_norm": True},
        "paper": {"widths": (64, 128, 256, 512, 512), "hidden": 4096, "batch_norm": False},
    }
    IMAGENET = "vgg16"

    def build(self, n_classes: int, widths: tuple[int, ...], hidden: int, batch_norm: bool) -> None:
        """Make VGG16, the hidden layers and the three score layers.

        The other Parameters are those of `Segmenter.build`.

        Parameters
        ----------
        widths : (5,) int
            Number of channels in each stage of VGG16.
        hidden : int
            Number of channels of conv6 and conv7.
        batch_norm : bool
            Whether each convolution is followed by batch normalisation.
        """
        self.backbone = Vgg(widths, batch_norm)
        self.conv6 = nn.Sequential(*conv_relu(widths[-1], hidden, 7, batch_norm))
        self.conv7 = nn.Sequential(*conv_relu(hidden, hidden, 1, batch_norm))
        self.score_conv7 = nn.Conv2d(hidden, n_classes, 1)
        self.score_pool4 = nn.Conv2d(widths[3], n_classes, 1)
        self.score_pool3 = nn.Conv2d(widths[2], n_classes, 1)

    def scores(self, x: Tensor) -> Tensor:
        """Return the scores. Parameters and result are those of `Segmenter.scores`."""
        _, _, pool3, pool4, pool5 = self.backbone(x)
        at_32 = self.score_conv7(self.conv7(self.conv6(pool5)))
        at_16 = enlarge(at_32, 2, pool4.shape[2:]) + self.score_pool4(pool4)
        at_8 = enlarge(at_16, 2, pool3.shape[2:]) + self.score_pool3(pool3)
        return enlarge(at_8, 8, x.shape[2:])

    def imagenet_tensors(self) -> dict[str, Tensor]:
        """Return weights and biases of VGG16's convolutions and, as conv6 and conv7, of its two hidden layers."""
        convolutions = [layer for layer in self.backbone.features if isinstance(layer, nn.Conv2d)]
        return vgg16_tensors([*convolutions, self.conv6[0], self.conv7[0]])


def enlarge(scores: Tensor, factor: int, size: tuple[int, int]) -> Tensor:
    """Upsample bilinearly a map whose cell i covers pixels factor i .. factor (i + 1) - 1, and crop it to `size`.

    A cell's value is at the centre of its pixels. Beyond the outermost centres the result is constant.

    Parameters
    ----------
    scores : (B, C, H, W) float
        The map.
    factor : int
        Pixels per cell, along each axis.
    size : (int, int)
        Height h and width w of the result, pixels, at most factor H and factor W. They are smaller when the last
        cell covers fewer pixels than the others.

    Returns
    -------
    (B, C, h, w) float
        The upsampled map.
    """
    larger = F.interpolate(scores, scale_factor=factor, mode="bilinear", align_corners=False)
    return larger[..., : size[0], : size[1]]

"""DeepLab v2 without its CRF: atrous ResNet and atrous spatial pyramid pooling (paper, section 3.1; Chen et al.)."""

from typing import ClassVar

import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.networks.resnet import ResNet
from semgrid_edu.networks.segmenter import Segmenter

OUTPUT_STRIDE = 8
"""Pixels between the cells of the scored map."""


class DeepLab(Segmenter):
    """Segment an image by a ResNet that halves thrice only, and classifiers that look near and far.

    Atrous spatial pyramid pooling (ASPP): 3x3 convolutions of four rates score the same map side by side,
    each with its own reach, and their scores are summed. Bilinear interpolation takes them to the image.

    Parameters
    ----------
    n_classes : int
        C.
    preset : str
        "paper" is ResNet-101 and rates 6, 12, 18, 24; "compact" the same stages, narrow and shallow, with a
        third of the rates: it sees images scaled down to about a quarter, 12 rows of cells, in which a kernel
        of rate 12 would have a single row left inside the map, and with a quarter of the summed scores.
    seed : int
        Of the initial weights.

    Notes
    -----
    The quarter changes what a step learns, not what the network can say. The classifiers sum over 36 values
    of each feature; at the learning rate that suits the other compact networks, 0.05, the plain sum overshoots
    (the loss climbs from 4.6 to 66 in its first steps), while the mean learns as steadily as they do.

    References
    ----------
    Chen, Papandreou, Kokkinos, Murphy, Yuille: DeepLab: Semantic Image Segmentation with Deep Convolutional
    Nets, Atrous Convolution, and Fully Connected CRFs. PAMI 40(4), 2018 (arXiv 2016).
    """

    PRESETS: ClassVar = {
        "compact": {"width": 8, "depths": (2, 2, 4, 2), "rates": (2, 4, 6, 8), "scale": 0.25},
        "paper": {"width": 64, "depths": (3, 4, 23, 3), "rates": (6, 12, 18, 24), "scale": 1.0},
    }

    def build(self, n_classes: int, width: int, depths: tuple[int, ...], rates: tuple[int, ...], scale: float) -> None:
        """Make the ResNet and a classifier for each rate."""
        self.scale = scale
        self.backbone = ResNet(width, depths, OUTPUT_STRIDE)
        self.aspp = nn.ModuleList(
            nn.Conv2d(self.backbone.n_out, n_classes, 3, padding=rate, dilation=rate) for rate in rates
        )

    def scores(self, x: Tensor) -> Tensor:
        """Return the scores, (B, 3, h, w) -> (B, C, h, w)."""
        features = self.backbone(x)
        summed = sum(classify(features) for classify in self.aspp)
        return interpolate(self.scale * summed, OUTPUT_STRIDE, x.shape[2:])


def interpolate(scores: Tensor, stride: int, size: tuple[int, int]) -> Tensor:
    """Interpolate a map whose cell i lies on pixel stride x i, bilinear; past the last cell it stays constant.

    Parameters
    ----------
    scores : (B, C, H, W) float
    stride : int
    size : (int, int)
        h, w of the image; H, W are those divided by the stride, rounded up.

    Returns
    -------
    (B, C, h, w) float
    """
    spanned = [stride * (n - 1) + 1 for n in scores.shape[2:]]
    between = F.interpolate(scores, size=spanned, mode="bilinear", align_corners=True)
    return F.pad(between, (0, size[1] - spanned[1], 0, size[0] - spanned[0]), mode="replicate")

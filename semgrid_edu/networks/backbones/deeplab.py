"""DeepLab v2 without its CRF: atrous ResNet and atrous spatial pyramid pooling (paper, section 3.1; Chen et al.)."""

from typing import ClassVar

import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.networks.backbones.resnet import ResNet
from semgrid_edu.networks.backbones.segmenter import Segmenter

OUTPUT_STRIDE = 8
"""Pixels from one cell of the scored map to the next."""


class DeepLab(Segmenter):
    """Segment an image by a ResNet that halves the map only three times, and classifiers that look near and far.

    The classifiers are atrous spatial pyramid pooling (ASPP): 3x3 convolutions with four dilation rates score the same
    map side by side, each with its own reach, and their scores are summed. Bilinear interpolation takes the sum to the
    size of the image.

    The other Parameters are those of `Segmenter`.

    Parameters
    ----------
    preset : str
        "paper" is ResNet-101 with rates 6, 12, 18, 24. "compact" has the same stages, narrow and shallow, a third of
        the rates, and a quarter of the summed scores (see the notes). Its rates are smaller because it sees images
        scaled down to about a quarter: the map has 12 rows of cells, and a kernel of rate 12 would have only
        one of its three rows inside the map.

    Notes
    -----
    The quarter changes how far a training step goes, not what the network can express. The classifiers sum over 36
    values of each feature. At 0.05, the learning rate that suits the other compact networks, the plain sum overshoots
    (the loss climbs from 4.6 to 66 in its first steps), while the mean over the four rates learns steadily.

    References
    ----------
    Chen, Papandreou, Kokkinos, Murphy, Yuille: DeepLab: Semantic Image Segmentation with Deep Convolutional
    Nets, Atrous Convolution, and Fully Connected CRFs. PAMI 40(4), 2018 (arXiv 2016).
    """

    PRESETS: ClassVar = {
        "compact": {"width": 8, "depths": (2, 2, 4, 2), "rates": (2, 4, 6, 8), "scale": 0.25},
        "paper": {"width": 64, "depths": (3, 4, 23, 3), "rates": (6, 12, 18, 24), "scale": 1.0},
    }
    IMAGENET = "resnet101"

    def build(self, n_classes: int, width: int, depths: tuple[int, ...], rates: tuple[int, ...], scale: float) -> None:
        """Make the ResNet and one classifier per rate.

        The other Parameters are those of `Segmenter.build`.

        Parameters
        ----------
        width : int
            Number of channels of the ResNet's stem.
        depths : (4,) int
            Number of bottlenecks in each stage of the ResNet.
        rates : tuple of int
            Dilation rate of each classifier.
        scale : float
            Factor of the summed scores.
        """
        self.scale = scale
        self.backbone = ResNet(width, depths, OUTPUT_STRIDE)
        self.aspp = nn.ModuleList(
            nn.Conv2d(self.backbone.n_out, n_classes, 3, padding=rate, dilation=rate) for rate in rates
        )

    def scores(self, x: Tensor) -> Tensor:
        """Return the scores. Parameters and result are those of `Segmenter.scores`."""
        features = self.backbone(x)
        summed = sum(classify(features) for classify in self.aspp)
        return interpolate(self.scale * summed, OUTPUT_STRIDE, x.shape[2:])

    def imagenet_tensors(self) -> dict[str, Tensor]:
        """Return all of ResNet before its classifier, with the running statistics of its batch normalisation."""
        state = self.backbone.state_dict()
        return {name: own for name, own in state.items() if not name.endswith("num_batches_tracked")}


def interpolate(scores: Tensor, stride: int, size: tuple[int, int]) -> Tensor:
    """Interpolate a map whose cell i lies on pixel stride x i, bilinearly; past the last cell it stays constant.

    Parameters
    ----------
    scores : (B, C, H, W) float
        The map.
    stride : int
        Pixels from one cell to the next.
    size : (int, int)
        Height h and width w of the image, pixels; H and W are h and w divided by the stride, rounded up.

    Returns
    -------
    (B, C, h, w) float
        One value per pixel.
    """
    spanned = [stride * (n - 1) + 1 for n in scores.shape[2:]]
    between = F.interpolate(scores, size=spanned, mode="bilinear", align_corners=True)
    return F.pad(between, (0, size[1] - spanned[1], 0, size[0] - spanned[0]), mode="replicate")

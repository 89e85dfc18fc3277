"""DeepLab v2 without its CRF: atrous ResNet and atrous spatial pyramid pooling (paper, section 3.1; Chen et al.)."""

from typing import ClassVar

import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.segmenter import Segmenter

OUTPUT_STRIDE = 8
"""Pixels from one cell of the scored map to the next."""

EXPANSION = 4
"""Channels of a bottleneck's result for each channel inside it (He et al., table 1)."""


class DeepLab(Segmenter):
    """Segment an image by a ResNet that halves the map only three times, and classifiers with short and long reach.

    The classifiers are atrous spatial pyramid pooling (ASPP): 3x3 convolutions with four dilation rates score the same
    map in parallel, each with a different reach, and their scores are summed. Bilinear interpolation enlarges the sum
    to the size of the image.

    The other Parameters are those of `Segmenter`.

    Parameters
    ----------
    preset : str
        "paper" is ResNet-101 with rates 6, 12, 18, 24. "compact" has the same stages, narrow and shallow, a third of
        the rates, and a quarter of the summed scores (see the notes). Its rates are smaller because it sees images
        scaled down to about a quarter: the map has 12 rows of cells, so only one of the three rows of a kernel of rate
        12 would be inside it.

    Notes
    -----
    The quarter changes how far a training step goes, not what the network can express. The classifiers sum over 36
    values of each feature. At a learning rate of 0.05, which suits the other compact networks, the plain sum overshoots
    (the loss climbs from 4.6 to 66 in the first steps), whereas the mean over the four rates learns steadily.

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
        summed = sum(classifier(features) for classifier in self.aspp)
        return interpolate(self.scale * summed, OUTPUT_STRIDE, x.shape[2:])

    def imagenet_tensors(self) -> dict[str, Tensor]:
        """Return all of ResNet before its classifier, including the running statistics of its batch normalisation."""
        state = self.backbone.state_dict()
        return {name: tensor for name, tensor in state.items() if not name.endswith("num_batches_tracked")}


def interpolate(scores: Tensor, stride: int, size: tuple[int, int]) -> Tensor:
    """Interpolate bilinearly a map whose cell i is on pixel stride x i; past the last cell the result is constant.

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


class ResNet(nn.Module):
    """Compute a feature map by a stem and four stages of bottlenecks; the last stages dilate instead of striding.

    A stage with stride 2 halves the map. The atrous algorithm omits the stride and dilates every later kernel by it
    instead. The result contains all values of the strided network, unchanged, and the values between them. Parameters
    are named as in torchvision's `resnet101`, whose strides are in the 3x3 convolutions.

    He, Zhang, Ren, Sun: Deep Residual Learning for Image Recognition. CVPR 2016.

    Parameters
    ----------
    width : int
        Number of channels of the stem; 64 in the publication. Stage k = 0 .. 3 has width 2^k channels inside its
        bottlenecks.
    depths : (4,) int
        Number of bottlenecks in each stage; (3, 4, 23, 3) in ResNet-101.
    output_stride : int
        Pixels from one cell of the result to the next. 8: the last two stages are atrous, with rates 2 and 4, as in
        DeepLab; 16: only the last stage is; 32: none is, as in the publication.
    """

    def __init__(self, width: int, depths: tuple[int, ...], output_stride: int = 8) -> None:
        super().__init__()
        if output_stride not in (8, 16, 32):
            raise ArgumentError("output_stride", "8, 16 or 32", output_stride)
        self.conv1 = nn.Conv2d(3, width, 7, stride=2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        n_in = width
        total_stride = 4  # of the stem: its convolution and its pooling
        rate = 1
        for stage, depth in enumerate(depths):
            stride = 1 if stage == 0 else 2
            # The kernel whose stride is omitted keeps its rate: it still sees the map before the halving.
            first_rate = rate
            if total_stride * stride > output_stride:
                rate *= stride
                stride = 1
            total_stride *= stride
            blocks = [Bottleneck(n_in, width << stage, stride, first_rate)]
            n_in = EXPANSION * (width << stage)
            blocks += [Bottleneck(n_in, width << stage, 1, rate) for _ in range(depth - 1)]
            self.add_module(f"layer{stage + 1}", nn.Sequential(*blocks))
        self.n_out = n_in

    def forward(self, x: Tensor) -> Tensor:
        """Return the map of the last stage.

        Parameters
        ----------
        x : (B, 3, h, w) float
            Normalised images.

        Returns
        -------
        (B, n_out, ceil(h / s), ceil(w / s)) float
            The map, with s the output stride. Cell i is on pixel s i, because all strides start at the first pixel.
        """
        x = F.max_pool2d(F.relu(self.bn1(self.conv1(x)), inplace=True), 3, stride=2, padding=1)
        return self.layer4(self.layer3(self.layer2(self.layer1(x))))


class Bottleneck(nn.Module):
    """Add a residual to a map: the result of three convolutions, 1x1, 3x3 and 1x1.

    Parameters
    ----------
    n_in, width : int
        Number of channels of the input, and between the convolutions; the result has 4 x width channels.
    stride, rate : int
        Stride and dilation of the 3x3 convolution.
    """

    def __init__(self, n_in: int, width: int, stride: int, rate: int) -> None:
        super().__init__()
        n_out = EXPANSION * width
        self.conv1 = nn.Conv2d(n_in, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, padding=rate, dilation=rate, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3 = nn.Conv2d(width, n_out, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(n_out)
        self.downsample = None
        if stride != 1 or n_in != n_out:
            self.downsample = nn.Sequential(nn.Conv2d(n_in, n_out, 1, stride, bias=False), nn.BatchNorm2d(n_out))

    def forward(self, x: Tensor) -> Tensor:
        """Return the sum of the map and its residual.

        Parameters
        ----------
        x : (B, n_in, H, W) float
            The map.

        Returns
        -------
        (B, 4 width, H, W) float
            The sum; H and W are halved, and rounded up, when the stride is 2.
        """
        residual = F.relu(self.bn1(self.conv1(x)), inplace=True)
        residual = F.relu(self.bn2(self.conv2(residual)), inplace=True)
        residual = self.bn3(self.conv3(residual))
        return F.relu(residual + (x if self.downsample is None else self.downsample(x)), inplace=True)

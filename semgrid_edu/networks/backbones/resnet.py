"""ResNet with atrous convolutions: the encoder of DeepLab (paper, section 3.1; He et al., CVPR 2016)."""

import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError

EXPANSION = 4
"""Channels that leave a bottleneck for each channel inside it (He et al., table 1)."""


class ResNet(nn.Module):
    """Compute a feature map by a stem and four stages of bottlenecks, the last of which dilate instead of striding.

    A stage with stride 2 halves the map. The atrous algorithm leaves the stride out and instead dilates every later
    kernel by the stride that was left out. The values that the strided network would have given are still there,
    unchanged, together with the values between them. Parameters are named as in torchvision's `resnet101`, whose
    strides are in the 3x3 convolutions.

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
        n_in, reached, rate = width, 4, 1
        for stage, depth in enumerate(depths):
            stride = 1 if stage == 0 else 2
            # The kernel whose stride is left out keeps its rate: it still sees the map before the halving.
            first_rate = rate
            if reached * stride > output_stride:
                stride, rate = 1, rate * stride
            reached *= stride
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
            The map, with s the output stride. Cell i lies on pixel s i, because all strides start at the first pixel.
        """
        x = F.max_pool2d(F.relu(self.bn1(self.conv1(x)), inplace=True), 3, stride=2, padding=1)
        return self.layer4(self.layer3(self.layer2(self.layer1(x))))


class Bottleneck(nn.Module):
    """Add to a map what three convolutions, 1x1, 3x3 and 1x1, make of it (the residual).

    Parameters
    ----------
    n_in, width : int
        Number of channels that come in, and between the convolutions; 4 width channels go out.
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

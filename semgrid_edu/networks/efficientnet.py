"""EfficientNet-Lite0 with a feature pyramid: an image network that starts from ImageNet (paper, section 4.1)."""

from itertools import pairwise
from typing import ClassVar, NamedTuple

import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.networks.conv_deconv import conv_bn_relu
from semgrid_edu.networks.fcn import enlarge
from semgrid_edu.networks.segmenter import Segmenter


class Stage(NamedTuple):
    """A row of EfficientNet's table: blocks in sequence, the first of which has the stride.

    Parameters
    ----------
    depth : int
        Number of blocks.
    kernel : int
        Side of the depthwise kernels, cells.
    stride : int
        Stride of the first block.
    expansion : int
        Channels inside a block for each channel of its input.
    width : int
        Number of channels of the result.
    """

    depth: int
    kernel: int
    stride: int
    expansion: int
    width: int


STEM = 32
"""Number of channels after the first convolution."""

STAGES = (
    Stage(1, 3, 1, 1, 16),
    Stage(2, 3, 2, 6, 24),
    Stage(2, 5, 2, 6, 40),
    Stage(3, 3, 2, 6, 80),
    Stage(3, 5, 1, 6, 112),
    Stage(4, 5, 2, 6, 192),
    Stage(1, 3, 1, 6, 320),
)
"""The stages of EfficientNet-B0, which are also those of Lite0 (Tan and Le, table 1)."""


class EfficientNet(Segmenter):
    """Segment an image by EfficientNet-Lite0 and a feature pyramid on its maps at strides 2 to 32.

    The encoder is the one network here that is small enough for a CPU at its published size, so its ImageNet weights
    fit both presets. At each stride a 1x1 convolution brings the encoder's map to the pyramid's width, and batch
    normalisation to one size: ImageNet's maps are three to seven times as large as fresh ones, and the pyramid adds
    them. From the coarsest map down, each is smoothed by a 3x3 convolution, doubled in size and added to the next finer
    one. The sum at stride 2 is only normalised, because smoothing it would cost twice as much as the rest of the
    pyramid; its scores are enlarged twofold.

    The other Parameters are those of `Segmenter`.

    Parameters
    ----------
    preset : str
        "paper" has the pyramid's published width, 256 channels; "compact" has 48. The encoder is the same.

    References
    ----------
    Tan, Le: EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks. ICML 2019. The Lite variants
    (Liu, 2020) leave out squeeze-and-excitation, and their ReLU stops at 6.

    Lin, Dollar, Girshick, He, Hariharan, Belongie: Feature Pyramid Networks for Object Detection. CVPR 2017.
    """

    PRESETS: ClassVar = {"compact": {"width": 48}, "paper": {"width": 256}}
    IMAGENET = "efficientnet-lite0"
    MEAN = (127 / 255,) * 3
    STD = (128 / 255,) * 3

    def build(self, n_classes: int, width: int) -> None:
        """Make the encoder, the pyramid and the score layer.

        The other Parameters are those of `Segmenter.build`.

        Parameters
        ----------
        width : int
            Number of channels of the pyramid.
        """
        self.backbone = LiteEncoder()
        self.lateral = nn.ModuleList(
            nn.Sequential(nn.Conv2d(n_in, width, 1, bias=False), nn.BatchNorm2d(width)) for n_in in self.backbone.widths
        )
        self.smooth = nn.ModuleList(conv_bn_relu(width, width) for _ in self.backbone.widths[1:])
        self.score = nn.Sequential(nn.BatchNorm2d(width), nn.ReLU(inplace=True), nn.Conv2d(width, n_classes, 1))

    def scores(self, x: Tensor) -> Tensor:
        """Return the scores. Parameters and result are those of `Segmenter.scores`."""
        maps = [lateral(found) for lateral, found in zip(self.lateral, self.backbone(x), strict=True)]
        pyramid = maps[-1]
        for finer, smooth in zip(reversed(maps[:-1]), reversed(self.smooth), strict=True):
            pyramid = finer + enlarge(smooth(pyramid), 2, finer.shape[2:])
        return enlarge(self.score(pyramid), 2, x.shape[2:])

    def imagenet_tensors(self) -> dict[str, Tensor]:
        """Return the encoder's tensors by their published names; those of the classifier aren't part of it."""
        return self.backbone.published_tensors()


class LiteEncoder(nn.Module):
    """Compute feature maps by EfficientNet-Lite0 without its classifier: a stem and sixteen blocks in seven stages.

    Attributes
    ----------
    widths : list of int
        Number of channels of each map in the result.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stem = ConvBn(3, STEM, 3, stride=2)
        starts = (STEM, *(stage.width for stage in STAGES))
        self.stages = nn.ModuleList(_blocks(n_in, stage) for n_in, stage in zip(starts, STAGES, strict=False))
        # The last stage before each halving, and the last of all.
        halves = [stage.stride == 2 for stage in STAGES[1:]] + [True]
        self.ends = [k for k, ends in enumerate(halves) if ends]
        self.widths = [STAGES[k].width for k in self.ends]

    def forward(self, x: Tensor) -> list[Tensor]:
        """Return the last map of each size.

        Parameters
        ----------
        x : (B, 3, h, w) float
            Normalised images.

        Returns
        -------
        list of (B, width, H, W) float
            Five maps, at 1/2, 1/4, ... 1/32 of the size, rounded up.
        """
        x = F.relu6(self.stem(x))
        maps = []
        for k, stage in enumerate(self.stages):
            x = stage(x)
            if k in self.ends:
                maps.append(x)
        return maps

    def published_tensors(self) -> dict[str, Tensor]:
        """Return the weights and statistics (not copies) under the names in which they were published."""
        named = {"_conv_stem": self.stem.conv, "_bn0": self.stem.norm}
        blocks = [block for stage in self.stages for block in stage]
        for k, block in enumerate(blocks):
            parts = {"expand": (block.expand, 0), "depthwise": (block.depthwise, 1), "project": (block.project, 2)}
            for part, (layer, number) in parts.items():
                if isinstance(layer, ConvBn):
                    named |= {f"_blocks.{k}._{part}_conv": layer.conv, f"_blocks.{k}._bn{number}": layer.norm}
        return {
            f"{name}.{part}": tensor
            for name, layer in named.items()
            for part, tensor in layer.state_dict().items()
            if part != "num_batches_tracked"
        }


class InvertedBottleneck(nn.Module):
    """Widen a map, convolve each channel by itself, narrow it again; add the input where the shapes are equal.

    Sandler et al. (MobileNetV2, CVPR 2018) call it inverted because it is wide inside. No ReLU follows the narrow map,
    because there it would lose what the few channels hold.

    Parameters
    ----------
    n_in, n_out : int
        Number of channels of the input and of the result.
    kernel, stride : int
        Side and stride of the depthwise kernels.
    expansion : int
        Channels inside the block for each of the input; 1 for none to be added.
    """

    def __init__(self, n_in: int, n_out: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        inside = expansion * n_in
        self.expand = ConvBn(n_in, inside, 1) if expansion > 1 else None
        self.depthwise = ConvBn(inside, inside, kernel, stride, groups=inside)
        self.project = ConvBn(inside, n_out, 1)
        self.adds = stride == 1 and n_in == n_out

    def forward(self, x: Tensor) -> Tensor:
        """Return the narrow map.

        Parameters
        ----------
        x : (B, n_in, H, W) float
            The map.

        Returns
        -------
        (B, n_out, H, W) float
            H and W are halved, and rounded up, when the stride is 2.
        """
        wide = x if self.expand is None else F.relu6(self.expand(x), inplace=True)
        wide = F.relu6(self.depthwise(wide), inplace=True)
        narrow = self.project(wide)
        return x + narrow if self.adds else narrow


class ConvBn(nn.Module):
    """A convolution without bias, padded as in TensorFlow, and batch normalisation with TensorFlow's constants.

    The encoder was published for TensorFlow, so its weights expect both.

    Parameters
    ----------
    n_in, n_out : int
        Number of channels of the input and of the result.
    kernel, stride : int
        Side and stride of the kernel.
    groups : int
        Number of groups of channels that are convolved by themselves.
    """

    def __init__(self, n_in: int, n_out: int, kernel: int, stride: int = 1, groups: int = 1) -> None:
        super().__init__()
        # With stride 1 the zeros are shared evenly, which needs no copy of the map.
        padding = kernel // 2 if stride == 1 else 0
        self.conv = nn.Conv2d(n_in, n_out, kernel, stride, padding, groups=groups, bias=False)
        self.norm = nn.BatchNorm2d(n_out, eps=1e-3, momentum=0.01)

    def forward(self, x: Tensor) -> Tensor:
        """Return the normalised result.

        Parameters
        ----------
        x : (B, n_in, H, W) float
            The map.

        Returns
        -------
        (B, n_out, H / stride, W / stride) float
            Rounded up.
        """
        kernel = self.conv.kernel_size[0]
        stride = self.conv.stride[0]
        if stride > 1:
            rows = same_padding(x.shape[2], kernel, stride)
            columns = same_padding(x.shape[3], kernel, stride)
            x = F.pad(x, (*columns, *rows))
        return self.norm(self.conv(x))


def same_padding(size: int, kernel: int, stride: int) -> tuple[int, int]:
    """Return the number of zeros before and after an axis in TensorFlow's padding "same".

    The result has size / stride cells, rounded up. Where the zeros can't be shared evenly, the end gets one more: a
    kernel of 3 with stride 2 takes an even axis without any zero before it, whereas PyTorch's padding of 1 would shift
    every map by one cell.

    Parameters
    ----------
    size : int
        Number of cells of the axis.
    kernel, stride : int
        Side and stride of the kernel.

    Examples
    --------
    >>> same_padding(8, kernel=3, stride=2)
    (0, 1)
    >>> same_padding(7, kernel=3, stride=2)
    (1, 1)
    """
    n_out = -(-size // stride)
    zeros = max((n_out - 1) * stride + kernel - size, 0)
    return zeros // 2, zeros - zeros // 2


def _blocks(n_in: int, stage: Stage) -> nn.Sequential:
    """Return the blocks of a stage."""
    widths = [n_in] + [stage.width] * stage.depth
    strides = [stage.stride] + [1] * (stage.depth - 1)
    return nn.Sequential(
        *(
            InvertedBottleneck(start, end, stage.kernel, stride, stage.expansion)
            for (start, end), stride in zip(pairwise(widths), strides, strict=True)
        )
    )

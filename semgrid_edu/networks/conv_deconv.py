"""The conv-deconv network: max-pooling down, unpooling by the same indices up (paper, sections 3.1 and 3.4, Fig. 5).

SegNet and the fusion network are both built from it. `fresh_weights` seeds the initial weights of every network in the
package.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError


def conv_bn_relu(n_in: int, n_out: int) -> nn.Sequential:
    """Return one layer of Fig. 5: 3x3 convolution, batch normalisation, ReLU; the map keeps its size.

    Parameters
    ----------
    n_in, n_out : int
        Number of channels of the input and of the result.

    Returns
    -------
    Sequential
        The three layers, with fresh weights.
    """
    return nn.Sequential(nn.Conv2d(n_in, n_out, 3, padding=1), nn.BatchNorm2d(n_out), nn.ReLU(inplace=True))


class ConvDeconv(nn.Module):
    """Encode a map by convolutions and max-pooling; decode it by convolutions and unpooling to where the maxima were.

    Each of the S stages halves the map on the way down and restores it on the way up. The decoder has as many
    layers as the encoder, in reverse order, and its last layer gives the result, without normalisation or ReLU.
    A pooled map no longer shows where in its 2x2 window each maximum was. The encoder keeps these indices, and the
    decoder puts the values back there, so that borders stay sharp without any weights (Badrinarayanan, Kendall and
    Cipolla, SegNet, PAMI 2017).

    Parameters
    ----------
    n_in, n_out : int
        Number of channels of the input and of the result.
    widths : (S,) int
        Number of channels in each stage.
    depths : (S,) int
        Number of convolutions in each stage, on the way down and again on the way up.
    skips : bool
        Whether each decoder stage also sees its encoder stage's map before pooling (Ronneberger, Fischer
        and Brox, U-Net, 2015).
    """

    def __init__(
        self, n_in: int, n_out: int, widths: tuple[int, ...], depths: tuple[int, ...], skips: bool = False
    ) -> None:
        super().__init__()
        self.skips = skips
        below = (n_in, *widths[:-1])
        self.encoder = nn.ModuleList(
            nn.Sequential(*_layers([start] + [width] * depth))
            for start, width, depth in zip(below, widths, depths, strict=True)
        )
        above = (n_out, *widths[:-1])
        self.decoder = nn.ModuleList(
            nn.Sequential(*_layers([width * (1 + skips)] + [width] * (depth - 1) + [end], plain_end=stage == 0))
            for stage, (width, depth, end) in enumerate(zip(widths, depths, above, strict=True))
        )

    def forward(self, x: Tensor) -> Tensor:
        """Return the result at the size of the input.

        Parameters
        ----------
        x : (B, n_in, H, W) float
            The map to encode.

        Returns
        -------
        (B, n_out, H, W) float
            The result of the last layer.
        """
        smallest = 2 ** len(self.encoder)
        if min(x.shape[2:]) < smallest:
            raise ArgumentError("x", f"maps of {smallest} x {smallest} or larger", tuple(x.shape))
        # Channels last in memory: takes half the time on a CPU, with the same result.
        x = x.contiguous(memory_format=torch.channels_last)
        levels = []
        for encode in self.encoder:
            before = encode(x)
            x, indices = F.max_pool2d(before, 2, return_indices=True)
            levels.append((before, indices))
        for decode, (before, indices) in zip(reversed(self.decoder), reversed(levels), strict=True):
            # The size is given because 35 rows and 34 both pool to 17.
            x = F.max_unpool2d(x, indices, 2, output_size=before.shape[2:])
            x = decode(torch.cat([x, before], dim=1) if self.skips else x)
        return x


def _layers(channels: list[int], plain_end: bool = False) -> list[nn.Module]:
    """Return the layers from each number of channels to the next; with `plain_end` the last is a convolution alone."""
    layers = [conv_bn_relu(n_in, n_out) for n_in, n_out in pairwise(channels)]
    return [*layers[:-1], layers[-1][0]] if plain_end else layers


@contextmanager
def fresh_weights(net: nn.Module, seed: int) -> Iterator[None]:
    """Make the initial weights of the layers created in the block depend only on the seed.

    PyTorch's layers draw their initial weights from the CPU's global generator. Inside the block that generator starts
    from the seed; afterwards its state is restored. Then `initialise` redraws the weights of the convolutions.

    Parameters
    ----------
    net : Module
        The network whose layers are created in the block.
    seed : int
        Seed for the initial weights.
    """
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(seed)
        yield
    initialise(net, seed)


def initialise(net: nn.Module, seed: int) -> None:
    """Draw new weights for all convolutions, scaled so that signals keep their size from layer to layer.

    The weights are normal and the biases zero. The variance of convolutions is 2 / fan-in, because the ReLU after them
    halves the power of its input (He et al., 2015). The variance of up-convolutions is 1 / (number of input channels):
    no ReLU follows them, and their strides leave no overlap, so each pixel of the result is a sum over the channels of
    one input pixel. Other layers are unchanged.

    Parameters
    ----------
    net : Module
        The network, changed in place.
    seed : int
        Seed for the weights.
    """
    generator = torch.Generator().manual_seed(seed)
    for module in net.modules():
        if isinstance(module, nn.Conv2d | nn.Conv3d):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu", generator=generator)
        elif isinstance(module, nn.ConvTranspose2d):
            nn.init.normal_(module.weight, std=module.in_channels**-0.5, generator=generator)
        else:
            continue
        if module.bias is not None:
            nn.init.zeros_(module.bias)

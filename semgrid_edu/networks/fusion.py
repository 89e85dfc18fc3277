"""Reduction of the planes and their fusion with the occupancy grid (paper, section 3.4, Fig. 4 and 5)."""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.segmenter import fresh_weights
from semgrid_edu.occupancy import N_STATES, State

N_REDUCED = 16
"""Number of planes after the reduction. The paper doesn't give it; with 16 of 280 the reduction costs less than the
network after it."""


class FusionNet(nn.Module):
    """Fuse the image's scores on D planes with the occupancy grid: (p, o) -> g.

    A 1x1 convolution reduces the D x C planes to a few. It weights heights and classes in the same way in every cell.
    Then the four planes of the occupancy grid are appended, and a small conv-deconv network with skip connections
    scores the classes.

    Parameters
    ----------
    n_scores : int
        Number of classes scored on the planes.
    n_planes : int
        D, the number of planes.
    n_classes : int
        C, the number of classes of the semantic grid.
    n_reduced : int or None
        Number of planes after the reduction; None for none, so that the conv-deconv network takes all D x C planes.
    seed : int
        Seed for the initial weights.
    uses_occupancy : bool
        Whether the network sees the occupancy grid. Otherwise it sees UNKNOWN in every cell, see `Architecture`.
    """

    WIDTHS, DEPTHS = (32, 48, 64), (1, 1, 2)
    """Three stages instead of VGG16's five: Fig. 5 shows fewer layers, and gives no widths."""

    def __init__(
        self,
        n_scores: int,
        n_planes: int,
        n_classes: int,
        n_reduced: int | None = N_REDUCED,
        seed: int = 0,
        uses_occupancy: bool = True,
    ) -> None:
        super().__init__()
        self.uses_occupancy = uses_occupancy
        n_left = n_reduced or n_scores * n_planes
        with fresh_weights(self, seed):
            self.reduce = _reduction(n_scores, n_planes, n_reduced)
            self.conv_deconv = ConvDeconv(n_left + N_STATES, n_classes, self.WIDTHS, self.DEPTHS, skips=True)

    def forward(self, planes: Tensor, occupancy: Tensor) -> Tensor:
        """Return the logits of the semantic grid; a soft-max over C makes them probabilities.

        Parameters
        ----------
        planes : (B, C, D, H, W) float
            p, the image's scores on the planes.
        occupancy : (B, 4, H, W) float
            o, the probabilities of the four states; they sum to 1 in each cell.

        Returns
        -------
        (B, C, H, W) float
            g before the soft-max.
        """
        return self.fuse(self.reduce(planes), occupancy)

    def fuse(self, reduced: Tensor, occupancy: Tensor) -> Tensor:
        """Return the logits, as `forward` does, from planes that are already reduced.

        Parameters
        ----------
        reduced : (B, n_reduced, 1, H, W) float
            The result of `reduce`.
        occupancy : (B, 4, H, W) float
            o, the probabilities of the four states; they sum to 1 in each cell.

        Returns
        -------
        (B, C, H, W) float
            g before the soft-max.
        """
        return self.conv_deconv(self.joined(reduced, occupancy))

    def joined(self, reduced: Tensor, occupancy: Tensor) -> Tensor:
        """Append the occupancy grid to the reduced planes. Parameters are those of `FusionNet.fuse`.

        Returns
        -------
        (B, n_reduced + 4, H, W) float
            The input of the conv-deconv network.
        """
        if not self.uses_occupancy:
            occupancy = no_scan(occupancy)
        occupancy = occupancy.contiguous(memory_format=torch.channels_last)
        return torch.cat([reduced.squeeze(2), occupancy], dim=1)


def no_scan(occupancy: Tensor) -> Tensor:
    """Return an occupancy grid that is UNKNOWN in every cell, as after a scan without a single beam.

    Parameters
    ----------
    occupancy : (B, 4, H, W) float
        A grid of this size.
    """
    unknown = torch.zeros_like(occupancy)
    unknown[:, State.UNKNOWN] = 1
    return unknown


class PlaneConvolution(nn.Conv3d):
    """The 1x1 convolution of all D x C planes: on (B, C, D, H, W), a D x 1 x 1 kernel.

    It is computed as a matrix product with one row of D x C scores per cell. `fast.PlaneSampler` leaves the planes in
    memory in this order, so nothing is copied.
    """

    def forward(self, planes: Tensor) -> Tensor:
        """Reduce the planes.

        Parameters
        ----------
        planes : (B, C, D, H, W) float
            p, the image's scores on the planes.

        Returns
        -------
        (B, n_reduced, 1, H, W) float
            Weighted sums over C and D.
        """
        cells = planes.permute(0, 3, 4, 2, 1).flatten(3)
        weight = self.weight.flatten(2).transpose(1, 2).flatten(1)
        return F.linear(cells, weight, self.bias).permute(0, 3, 1, 2).unsqueeze(2)


def _reduction(n_scores: int, n_planes: int, n_reduced: int | None) -> nn.Module:
    """Return the layers from (B, C, D, H, W) to (B, n_reduced, 1, H, W); unreduced to (B, C x D, 1, H, W)."""
    if n_reduced is None:
        return nn.Sequential(nn.Flatten(1, 2), nn.Unflatten(1, (n_scores * n_planes, 1)))
    convolution = PlaneConvolution(n_scores, n_reduced, (n_planes, 1, 1))
    return nn.Sequential(convolution, nn.BatchNorm3d(n_reduced), nn.ReLU(inplace=True))

"""Both kernels of eq. (4) in torch, with gradients for their widths."""

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from semgrid_edu.crf.pair_window import PairSum, PairWindow


class Pairs(NamedTuple):
    """A kernel between the cells of a batch of grids.

    Parameters
    ----------
    sums : callable
        x (B, K, H, W) -> y (B, K, H, W), y_i = sum_{j != i} k_ij x_j.
    own : (B or 1, 1, H, W) float
        k_ii.
    """

    sums: Callable[[Tensor], Tensor]
    own: Tensor

    def normalised(self, occupancy: Tensor) -> "Pairs":
        """Return D^-1/2 K D^-1/2 with D the row sums of the kernel K, its diagonal included.

        Parameters
        ----------
        occupancy : (B, 4, H, W) float
            Any array of the batch: it gives shape and type.

        Returns
        -------
        Pairs
            The normalised kernel.
        """
        root = (self.own + self.sums(torch.ones_like(occupancy[:, :1]))).sqrt()
        return Pairs(lambda x: self.sums(x / root) / root, self.own / root**2)


def bilateral_pairs(occupancy: Tensor, radius: int, sigma_alpha: Tensor, sigma_beta: Tensor) -> Pairs:
    """Return the first kernel of eq. (4), on place and occupancy, for the pairs of a window.

    Parameters
    ----------
    occupancy : (B, 4, H, W) float
        o, the probabilities of the four states.
    radius : int
        Half the side of the window, cells.
    sigma_alpha, sigma_beta : () float
        The widths in space, cells, and in state probability.

    Returns
    -------
    Pairs
        Without weight and normalisation.
    """
    window = PairWindow(*occupancy.shape[2:], radius)
    places = torch.tensor(window.offsets).reshape(-1, 2).to(occupancy).square().sum(dim=1, keepdim=True)
    states = window.squared_distances(occupancy)
    weights = torch.exp(-0.5 * (places / sigma_alpha**2 + states / sigma_beta**2))
    return Pairs(lambda x: PairSum.apply(weights, x, window), torch.ones_like(occupancy[:, :1]))


def spatial_pairs(occupancy: Tensor, sigma_gamma: Tensor) -> Pairs:
    """Return the second kernel of eq. (4), on place alone: the product of a Gaussian of rows and one of columns.

    Parameters
    ----------
    occupancy : (B, 4, H, W) float
        It gives shape and type.
    sigma_gamma : () float
        The width, cells.

    Returns
    -------
    Pairs
        Without weight and normalisation, for all pairs of cells of the grid.
    """
    axes = (torch.arange(size).to(occupancy) for size in occupancy.shape[2:])
    rows, columns = (torch.exp(-0.5 * ((axis[:, None] - axis) / sigma_gamma) ** 2) for axis in axes)
    return Pairs(lambda x: rows @ x @ columns - x, torch.ones_like(occupancy[:, :1]))

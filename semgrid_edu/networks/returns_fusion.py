"""Fusion that knows the heights of the returns: the edge from l to g, which the paper leaves out (section 3.4)."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from semgrid_edu.networks.conv_deconv import ConvDeconv
from semgrid_edu.networks.fusion import FusionNet, no_scan
from semgrid_edu.networks.segmenter import fresh_weights
from semgrid_edu.occupancy import N_STATES
from semgrid_edu.planes import above_ground, pick_planes

HIGHEST = 5.0
"""Height above the ground to which heights are clipped, metres; the network sees them as 0..2."""

CERTAIN = 20.0
"""How far the logits of the unknown classes are lowered in a cell that both sensors see."""


class ReturnsFusion(nn.Module):
    """Fuse the image's scores at the heights of the scan's returns with occupancy grid and heights: (p, o, l) -> g.

    The four numbers of o don't say how high a cell is occupied, and D planes of scores are many to learn from few
    frames. Here the scan chooses the planes: nothing reduces them, and the conv-deconv network sees the scores at each
    cell's lowest and highest return, the occupancy grid, how far both are above the ground, and whether there is any.

    A cell is hardly ever called unknown if a beam came back from it and its return is in the camera's view, because few
    labels call it so.

    Parameters
    ----------
    n_scores : int
        Number of classes scored on the planes.
    heights : (D,) float
        delta_i, the heights of the planes, from the lowest up, metres.
    cell : float
        Side of a cell, metres.
    n_classes : int
        C, the number of classes of the semantic grid.
    seed : int
        Seed for the initial weights.
    uses_occupancy : bool
        Whether the network sees the occupancy grid. Otherwise it sees UNKNOWN in every cell, and still the heights.
    """

    def __init__(
        self,
        n_scores: int,
        heights: Sequence[float],
        cell: float,
        n_classes: int,
        seed: int = 0,
        uses_occupancy: bool = True,
    ) -> None:
        super().__init__()
        self.heights = tuple(heights)
        self.cell = cell
        self.uses_occupancy = uses_occupancy
        # Scores at two heights, four states, both heights above the ground, and whether there is a return.
        n_in = 2 * n_scores + N_STATES + 3
        with fresh_weights(self, seed):
            self.conv_deconv = ConvDeconv(n_in, n_classes, FusionNet.WIDTHS, FusionNet.DEPTHS, skips=True)

    def forward(self, planes: Tensor, occupancy: Tensor, return_heights: Tensor) -> Tensor:
        """Return the logits of the semantic grid; a soft-max over C makes them probabilities.

        Parameters
        ----------
        planes : (B, C, D, H, W) float
            p, the image's class probabilities on the planes.
        occupancy : (B, 4, H, W) float
            o, the probabilities of the four states; they sum to 1 in each cell.
        return_heights : (B, 2, H, W) float
            The lowest and the highest return of each cell, from `cell_heights`.

        Returns
        -------
        (B, C, H, W) float
            g before the soft-max.
        """
        return self.fuse(self.reduce(planes, return_heights), occupancy, return_heights)

    def reduce(self, planes: Tensor, return_heights: Tensor) -> Tensor:
        """Pick the scores at the heights of the returns. Parameters are those of `ReturnsFusion.forward`.

        Returns
        -------
        (B, 2 n_scores, 1, H, W) float
            From `pick_planes`.
        """
        return pick_planes(planes, return_heights, self.heights).unsqueeze(2)

    def fuse(self, reduced: Tensor, occupancy: Tensor, return_heights: Tensor) -> Tensor:
        """Return the logits, as `forward` does, from scores that are already picked.

        Parameters
        ----------
        reduced : (B, 2 n_scores, 1, H, W) float
            The result of `reduce`.
        occupancy : (B, 4, H, W) float
            o, the probabilities of the four states; they sum to 1 in each cell.
        return_heights : (B, 2, H, W) float
            The lowest and the highest return of each cell, from `cell_heights`.

        Returns
        -------
        (B, C, H, W) float
            g before the soft-max.
        """
        logits = self.conv_deconv(self.joined(reduced, occupancy, return_heights))
        # The last classes are the unknown ones, one for each state. Out of view all scores are zero.
        semantic, unknown = logits.split([logits.shape[1] - N_STATES, N_STATES], dim=1)
        seen = (reduced != 0).any(dim=1) & ~return_heights[:, :1].isnan()
        return torch.cat([semantic, unknown - CERTAIN * seen], dim=1)

    def joined(self, reduced: Tensor, occupancy: Tensor, return_heights: Tensor) -> Tensor:
        """Append occupancy and heights to the picked scores. Parameters are those of `ReturnsFusion.fuse`.

        Returns
        -------
        (B, 2 n_scores + 4 + 3, H, W) float
            The input of the conv-deconv network.
        """
        if not self.uses_occupancy:
            occupancy = no_scan(occupancy)
        above = above_ground(return_heights, self.cell).nan_to_num(nan=0.0).clamp(0, HIGHEST) / (HIGHEST / 2)
        has_return = ~return_heights[:, :1].isnan()
        return torch.cat([reduced.squeeze(2), occupancy, above, has_return.to(above.dtype)], dim=1)

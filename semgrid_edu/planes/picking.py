"""Scores on the planes at the heights of the scan's returns: the scan says which planes to look at (section 3.4)."""

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

REACH = 2.0
"""The lowest return up to this many metres ahead, behind, to the left and to the right is taken for the ground."""


def above_ground(return_heights: Tensor, cell: float) -> Tensor:
    """Return how far returns are above the lowest one in the cells around, metres; NaN in a cell without a return.

    Parameters
    ----------
    return_heights : (B, 2, H, W) or (2, H, W) float
        The lowest and the highest return of each cell, from `cell_heights`.
    cell : float
        Side of a cell, metres; of 0.5 m, 9 x 9 cells are looked at.

    Returns
    -------
    (B, 2, H, W) or (2, H, W) float
    """
    reach = round(REACH / cell)
    lowest = return_heights[..., :1, :, :].nan_to_num(nan=torch.inf)
    # There is no min-pooling, so the negative of the largest negative height is taken.
    ground = -F.max_pool2d(-lowest, 2 * reach + 1, stride=1, padding=reach)
    return return_heights - ground


def pick_planes(planes: Tensor, z: Tensor, heights: Tensor | Sequence[float]) -> Tensor:
    """Return the scores at two heights of each cell, linear between the planes below and above.

    Below the lowest plane and above the highest one these planes themselves are taken, and in a cell without a return
    the ground.

    Parameters
    ----------
    planes : (B, C, D, H, W) float
        p, the image's scores on the planes.
    z : (B, 2, H, W) float
        Two heights of each cell, metres above flat ground, from `cell_heights`; NaN without a return.
    heights : (D,) float
        delta_i, the heights of the planes, from the lowest up, metres.

    Returns
    -------
    (B, 2C, H, W) float
        The scores of the C classes at the first height, then those at the second.

    Examples
    --------
    A score of 4 on the ground and 8 one metre above it, looked up at 0.25 m and at 3 m:

    >>> planes = torch.tensor([4.0, 8.0]).reshape(1, 1, 2, 1, 1)
    >>> pick_planes(planes, torch.tensor([0.25, 3.0]).reshape(1, 2, 1, 1), [0.0, 1.0]).ravel()
    tensor([5., 8.])
    """
    heights = torch.as_tensor(heights, dtype=z.dtype, device=z.device)
    z = z.nan_to_num(nan=0.0).clamp(heights[0], heights[-1]).contiguous()
    # z is between plane `below` and plane `above`; `share` is how far it is on the way from one to the other.
    above = torch.searchsorted(heights, z)
    below = (above - 1).clamp(min=0)
    distance = heights[above] - heights[below]  # zero on the lowest plane, which is both
    share = (z - heights[below]) / distance.where(distance > 0, 1)
    picked = [
        torch.lerp(_on_plane(planes, below[:, k]), _on_plane(planes, above[:, k]), share[:, k, None].to(planes.dtype))
        for k in range(2)
    ]
    return torch.cat(picked, dim=1)


def _on_plane(planes: Tensor, number: Tensor) -> Tensor:
    """Return the scores (B, C, H, W) on the plane whose number (B, H, W) each cell has."""
    index = number[:, None, None].expand(-1, planes.shape[1], -1, -1, -1)
    return planes.gather(2, index).squeeze(2)

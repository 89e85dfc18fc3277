"""Equation (2) by PyTorch's `grid_sample`: what a network samples and learns through (paper, section 3.3)."""

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import ArrayLike
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.planes.pixels import check_plane_points


class PlaneSampler(nn.Module):
    """Resample scores on the planes: equation (2), differentiable.

    For a fixed calibration equation (1) always gives the same pixels, so the module is built once and holds no weights.
    `semgrid_edu.fast.PlaneSampler` does the same two to three times as fast.

    Parameters
    ----------
    pixels : (D, H, W, 2) float
        u, v of each point in pixels, from `plane_pixels`.
    visible : (D, H, W) bool
        The points that take a value; the others take zero.
    image_size : (int, int)
        Height h and width w of the scores, pixels.

    Raises
    ------
    ArgumentError
        When the shapes don't agree or a visible point is outside the image.

    Examples
    --------
    >>> import numpy as np
    >>> import torch
    >>> sampler = PlaneSampler(np.full((1, 1, 1, 2), 0.5), np.ones((1, 1, 1), bool), image_size=(2, 2))
    >>> sampler(torch.tensor([[[[0.0, 1.0], [2.0, 3.0]]]]))
    tensor([[[[[1.5000]]]]])
    """

    def __init__(self, pixels: ArrayLike, visible: ArrayLike, image_size: tuple[int, int]) -> None:
        super().__init__()
        self.pixels = np.asarray(pixels, dtype=np.float64)
        self.visible = np.asarray(visible)
        self.image_size = tuple(image_size)
        check_plane_points(self.pixels, self.visible, self.image_size)

        # grid_sample counts from -1 to 1. With align_corners=True these are the centres of the first and the last
        # pixel, as in `plane_pixels`; without it they would be the image's edges, half a pixel farther out.
        height, width = self.image_size
        self.grid = 2 * self.pixels / (max(width - 1, 1), max(height - 1, 1)) - 1
        self.grid[~self.visible] = 0

    @property
    def planes_shape(self) -> tuple[int, int, int]:
        """D planes of H x W points."""
        return self.visible.shape

    def forward(self, scores: Tensor) -> Tensor:
        """Return the planes of each image.

        Parameters
        ----------
        scores : (B, C, h, w) float
            s, one value per class and pixel of each image.

        Returns
        -------
        (B, C, D, H, W) float
            p, in the type of `scores`.

        Raises
        ------
        ArgumentError
            When the scores don't have the size that the sampler was built for.
        """
        check_scores(scores, self.image_size)
        # In double precision, because coordinates from -1 to 1 would lose a ten-thousandth of a pixel in single.
        images = scores.double()
        grid = torch.from_numpy(self.grid).to(scores.device)
        hidden = torch.from_numpy(~self.visible).to(scores.device)
        planes = [
            F.grid_sample(images, plane.expand(len(images), -1, -1, -1), mode="bilinear", align_corners=True)
            for plane in grid
        ]
        return torch.stack(planes, dim=2).masked_fill(hidden, 0).to(scores.dtype)


def check_scores(scores: Tensor, image_size: tuple[int, int]) -> None:
    """Raise an `ArgumentError` unless these are scores of images of that size.

    Parameters
    ----------
    scores : (B, C, h, w) float
        One value per class and pixel of each image.
    image_size : (int, int)
        The height h and width w that they should have, pixels.
    """
    height, width = image_size
    if scores.ndim != 4 or tuple(scores.shape[2:]) != (height, width):
        raise ArgumentError("scores", f"shape (B, C, {height}, {width})", tuple(scores.shape))

"""Equation (2), fast and differentiable, as a module of a network (section 3.3)."""

from collections.abc import Callable

from numpy.typing import ArrayLike
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.planes.operator import PlaneOperator


class PlaneSampler(nn.Module):
    """Resample scores on the planes: equation (2), fast and differentiable.

    The module holds one `PlaneOperator`, which is fixed, and no weights. It also keeps the operator of its last batch,
    because all batches of a training run have the same size. Where it is moved to another device or type, it gets an
    operator of its own there; other modules that shared the old one keep it.

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
        When the shapes don't agree or a visible point lies outside the image.

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
        self._hold(PlaneOperator.build(pixels, visible, image_size))

    @classmethod
    def from_operator(cls, operator: PlaneOperator) -> "PlaneSampler":
        """Return a sampler around an operator that is already there, which it shares with others that have it.

        Parameters
        ----------
        operator : PlaneOperator
            The operator for one image.

        Returns
        -------
        PlaneSampler
            A module of its own.
        """
        sampler = cls.__new__(cls)
        nn.Module.__init__(sampler)
        sampler._hold(operator)
        return sampler

    def _hold(self, operator: PlaneOperator) -> None:
        """Take this operator from now on, and forget the last batch's."""
        self.operator = self._of_batch = operator

    @property
    def image_size(self) -> tuple[int, int]:
        """Height h and width w of the scores, pixels."""
        return self.operator.image_size

    @property
    def planes_shape(self) -> tuple[int, int, int]:
        """D planes of H x W points."""
        return self.operator.planes_shape

    def forward(self, scores: Tensor) -> Tensor:
        """Return the planes of each image.

        Parameters
        ----------
        scores : (B, C, h, w) float
            s, one value per class and pixel of each image.

        Returns
        -------
        (B, C, D, H, W) float
            p, in the type of `scores`. In memory all scores of a cell lie together, (B, H, W, D, C), as the 1x1
            convolution that follows likes it.

        Raises
        ------
        ArgumentError
            When the scores don't have the size that the sampler was built for.
        """
        if scores.ndim != 4 or tuple(scores.shape[2:]) != self.image_size:
            raise ArgumentError(
                "scores", f"shape (B, C, {self.image_size[0]}, {self.image_size[1]})", tuple(scores.shape)
            )
        return self._operator_for(len(scores))(scores)

    def _operator_for(self, n_images: int) -> PlaneOperator:
        """Return the operator for so many images at once, the last batch's where it fits."""
        if n_images == 1:
            return self.operator
        if self._of_batch.n_images != n_images:
            self._of_batch = self.operator.block_diagonal(n_images)
        return self._of_batch

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "PlaneSampler":
        """Move the operator as well: PyTorch's `.to`, `.double`, `.cuda` and their like all come through here."""
        self._hold(self.operator.map(fn))
        return super()._apply(fn, recurse)

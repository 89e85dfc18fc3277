"""Equation (2), fast and differentiable: a fixed operator for each calibration, and the module that holds it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import prod

import numpy as np
from numpy.typing import ArrayLike
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.planes.pixels import check_plane_points
from semgrid_edu.planes.sparse import SparseMatrix, SparseProduct, bilinear_matrix


@dataclass(frozen=True, eq=False)
class PlaneOperator:
    """The sparse matrix of equation (2) and its transpose, which carries gradients back.

    For a fixed calibration the four pixels around each point and their weights never change, so equation (2) is one
    sparse matrix that maps pixels to points. Nothing in an operator changes once it is built; any number of samplers
    can share it.

    Parameters
    ----------
    matrix : SparseMatrix
        One row per point, one column per pixel. The D points of a cell follow each other, so that its scores lie next
        to each other in memory. The rows of points that aren't visible are empty and cost nothing.
    transpose : SparseMatrix
        The same weights, one row per pixel and one column per point.
    image_size : (int, int)
        Height h and width w of the scores, pixels.
    planes_shape : (int, int, int)
        D planes of H x W points.
    n_images : int
        How many images the matrices take at once, B: see `block_diagonal`.
    """

    matrix: SparseMatrix
    transpose: SparseMatrix
    image_size: tuple[int, int]
    planes_shape: tuple[int, int, int]
    n_images: int = 1

    @classmethod
    def build(cls, pixels: ArrayLike, visible: ArrayLike, image_size: tuple[int, int]) -> "PlaneOperator":
        """Work out the operator for one image of known pixels. Parameters are those of `PlaneSampler`."""
        pixels, visible = np.asarray(pixels), np.asarray(visible)
        check_plane_points(pixels, visible, image_size)
        by_cell = np.moveaxis(pixels, 0, 2), np.moveaxis(visible, 0, 2)
        matrix = bilinear_matrix(*by_cell, image_size)
        both = (SparseMatrix.from_scipy(part) for part in (matrix, matrix.T.tocsr()))
        return cls(*both, tuple(image_size), visible.shape)

    def block_diagonal(self, n_images: int) -> "PlaneOperator":
        """Return the operator for several images at once: its matrices stand along a diagonal, once per image.

        One product then gives the planes of all images next to each other in memory, so that they needn't be copied
        into a batch.

        Parameters
        ----------
        n_images : int
            B, the number of images. The new operator needs B times the memory of this one.
        """
        n_pixels, n_points = prod(self.image_size), prod(self.planes_shape)
        matrix = self.matrix.block_diagonal(n_images, n_pixels)
        transpose = self.transpose.block_diagonal(n_images, n_points)
        return replace(self, matrix=matrix, transpose=transpose, n_images=n_images)

    def map(self, change: Callable[[Tensor], Tensor]) -> "PlaneOperator":
        """Return an operator with changed tensors, such as copies of them on a GPU.

        Parameters
        ----------
        change : callable
            Takes each tensor of the two matrices, and returns the one to take its place.
        """
        matrix, transpose = (SparseMatrix(*map(change, part)) for part in (self.matrix, self.transpose))
        return replace(self, matrix=matrix, transpose=transpose)

    def __call__(self, scores: Tensor) -> Tensor:
        """Return the planes of each image, (B, C, h, w) -> (B, C, D, H, W), differentiable; B is `n_images`."""
        planes = SparseProduct.apply(scores.permute(0, 2, 3, 1).flatten(0, 2), self.matrix, self.transpose)
        n_planes, *shape = self.planes_shape
        return planes.unflatten(0, (self.n_images, *shape, n_planes)).permute(0, 4, 3, 1, 2)

    def __deepcopy__(self, memo: dict) -> "PlaneOperator":
        """Return the operator itself: nothing in it changes, so copies of a network share it."""
        return self

    @property
    def nbytes(self) -> int:
        """The memory that both matrices hold, bytes."""
        return sum(part.nbytes for part in (*self.matrix, *self.transpose))


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
        """Return a sampler around an operator, which it shares with others that have it.

        Parameters
        ----------
        operator : PlaneOperator
            The operator for one image.
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
            p, in the type of `scores`. In memory all scores of a cell lie together, (B, H, W, D, C), the order in
            which the 1x1 convolution that follows reads them.

        Raises
        ------
        ArgumentError
            When the scores don't have the size that the sampler was built for.
        """
        height, width = self.image_size
        if scores.ndim != 4 or tuple(scores.shape[2:]) != (height, width):
            raise ArgumentError("scores", f"shape (B, C, {height}, {width})", tuple(scores.shape))
        return self._operator_for(len(scores))(scores)

    def _operator_for(self, n_images: int) -> PlaneOperator:
        """Return the operator for this many images at once: that of the last batch, if it was as large."""
        if n_images == 1:
            return self.operator
        if self._of_batch.n_images != n_images:
            self._of_batch = self.operator.block_diagonal(n_images)
        return self._of_batch

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "PlaneSampler":
        """Move the operator as well: PyTorch's `.to`, `.double`, `.cuda` and their like all come through here."""
        self._hold(self.operator.map(fn))
        return super()._apply(fn, recurse)

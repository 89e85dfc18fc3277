"""Equation (2) of one calibration as a fixed operator, from the pixels of an image to its planes (section 3.3)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import prod

import numpy as np
from numpy.typing import ArrayLike
from torch import Tensor

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
        """Work out the operator of points whose pixels are known, for one image.

        Parameters are those of `PlaneSampler`.

        Returns
        -------
        PlaneOperator
            The operator of D planes of H x W points.

        Raises
        ------
        ArgumentError
            When the shapes don't agree or a visible point lies outside the image.
        """
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

        Returns
        -------
        PlaneOperator
            Built from this operator of one image.
        """
        n_pixels, n_points = prod(self.image_size), prod(self.planes_shape)
        matrix = self.matrix.block_diagonal(n_images, n_pixels)
        return replace(
            self, matrix=matrix, transpose=self.transpose.block_diagonal(n_images, n_points), n_images=n_images
        )

    def map(self, change: Callable[[Tensor], Tensor]) -> "PlaneOperator":
        """Return an operator with changed tensors, such as copies of them on a GPU.

        Parameters
        ----------
        change : callable
            Takes each tensor of the two matrices, and returns the one to take its place.

        Returns
        -------
        PlaneOperator
            A new operator; this one stays as it is.
        """
        matrix, transpose = (SparseMatrix(*map(change, part)) for part in (self.matrix, self.transpose))
        return replace(self, matrix=matrix, transpose=transpose)

    def __call__(self, scores: Tensor) -> Tensor:
        """Return the planes of each image, (B, C, h, w) -> (B, C, D, H, W), differentiable; B is `n_images`."""
        rows = scores.permute(0, 2, 3, 1).flatten(0, 2)
        planes = SparseProduct.apply(rows, self.matrix, self.transpose)
        n_planes, *shape = self.planes_shape
        return planes.unflatten(0, (self.n_images, *shape, n_planes)).permute(0, 4, 3, 1, 2)

    def __deepcopy__(self, memo: dict) -> "PlaneOperator":
        """Return the operator itself: nothing in it changes, so copies of a network share it."""
        return self

    @property
    def nbytes(self) -> int:
        """The memory that both matrices hold, bytes."""
        return sum(part.nbytes for part in (*self.matrix, *self.transpose))

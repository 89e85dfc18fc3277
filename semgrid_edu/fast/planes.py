"""Equation (2) as a product with a sparse matrix that never changes (section 3.3).

For a fixed calibration the four pixels around each point and their weights never change. So equation (2) is one sparse
matrix that maps pixels to points, and its transpose maps gradients back.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from torch import Tensor, nn

from semgrid_edu.planes.pixels import check_plane_points
from semgrid_edu.planes.sampler import check_scores


class PlaneSampler(nn.Module):
    """Resample scores on the planes. Parameters and errors are those of `PlaneSampler` in `semgrid_edu.planes`.

    Examples
    --------
    >>> sampler = PlaneSampler(np.full((1, 1, 1, 2), 0.5), np.ones((1, 1, 1), bool), image_size=(2, 2))
    >>> sampler(torch.tensor([[[[0.0, 1.0], [2.0, 3.0]]]]))
    tensor([[[[[1.5000]]]]])
    """

    def __init__(self, pixels: ArrayLike, visible: ArrayLike, image_size: tuple[int, int]) -> None:
        super().__init__()
        self.pixels = np.asarray(pixels, dtype=np.float64)
        self.visible = np.asarray(visible)
        self.image_size = tuple(image_size)
        self.operator = PlaneOperator.build(self.pixels, self.visible, self.image_size)

    @property
    def planes_shape(self) -> tuple[int, int, int]:
        """D planes of H x W points."""
        return self.visible.shape

    def forward(self, scores: Tensor) -> Tensor:
        """Return the planes of each image. Parameters and errors are those of `PlaneSampler.forward`.

        Returns
        -------
        (B, C, D, H, W) float
            p, in the type of `scores`. In memory all scores of a cell are together, (B, H, W, D, C), because the 1x1
            convolution that follows reads them in this order.
        """
        check_scores(scores, self.image_size)
        return self.operator(scores)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> "PlaneSampler":
        """Move the operator as well: PyTorch's `.to`, `.double` and `.cuda` call this."""
        self.operator = self.operator.map(fn)
        return super()._apply(fn, recurse)


@dataclass(frozen=True, eq=False)
class PlaneOperator:
    """The sparse matrix of equation (2) and its transpose.

    Parameters
    ----------
    matrix : SparseMatrix
        One row per point, one column per pixel. The D points of a cell follow each other, so that its scores are next
        to each other in memory. The rows of points that aren't visible are empty and cost nothing.
    transpose : SparseMatrix
        The transposed matrix: one row per pixel, one column per point.
    image_size : (int, int)
        Height h and width w of the scores, pixels.
    planes_shape : (int, int, int)
        D planes of H x W points.
    """

    matrix: "SparseMatrix"
    transpose: "SparseMatrix"
    image_size: tuple[int, int]
    planes_shape: tuple[int, int, int]

    @classmethod
    def build(cls, pixels: NDArray, visible: NDArray, image_size: tuple[int, int]) -> "PlaneOperator":
        """Return the operator for one image. Parameters are those of `PlaneSampler`."""
        check_plane_points(pixels, visible, image_size)
        matrix = bilinear_matrix(np.moveaxis(pixels, 0, 2), np.moveaxis(visible, 0, 2), image_size)
        transpose = SparseMatrix.from_scipy(matrix.T.tocsr())
        return cls(SparseMatrix.from_scipy(matrix), transpose, tuple(image_size), visible.shape)

    def map(self, change: Callable[[Tensor], Tensor]) -> "PlaneOperator":
        """Return an operator with changed tensors, such as copies of them on a GPU.

        Parameters
        ----------
        change : callable
            Takes each tensor of the two matrices, and returns its replacement.
        """
        matrix, transpose = (SparseMatrix(*map(change, part)) for part in (self.matrix, self.transpose))
        return replace(self, matrix=matrix, transpose=transpose)

    def __call__(self, scores: Tensor) -> Tensor:
        """Return the planes of each image, (B, C, h, w) -> (B, C, D, H, W), differentiable."""
        images = scores.permute(0, 2, 3, 1).flatten(1, 2)
        products = [SparseProduct.apply(image, self.matrix, self.transpose) for image in images]
        planes = torch.stack(products) if len(products) > 1 else products[0][None]  # without a copy
        n_planes, *shape = self.planes_shape
        return planes.unflatten(1, (*shape, n_planes)).permute(0, 4, 3, 1, 2)

    def __deepcopy__(self, memo: dict) -> "PlaneOperator":
        """Return the operator itself: it never changes, so copies of a network share it."""
        return self

    @property
    def nbytes(self) -> int:
        """The memory that both matrices hold, bytes."""
        return sum(part.nbytes for part in (*self.matrix, *self.transpose))


def bilinear_matrix(pixels: NDArray, visible: NDArray, image_size: tuple[int, int]) -> csr_array:
    """Return equation (2) as a matrix: one row per point, one column per pixel, four weights in each visible row.

    Points and pixels are counted row by row, points also plane by plane: (D H W, h w). Parameters are those of
    `PlaneSampler`.

    Examples
    --------
    >>> bilinear_matrix(np.full((1, 1, 1, 2), 0.25), np.ones((1, 1, 1), bool), (2, 2)).toarray()
    array([[0.5625, 0.1875, 0.1875, 0.0625]], dtype=float32)
    """
    # One plane at a time, so that intermediate results fit into the processor's cache.
    corners = [_corners(points[seen], image_size) for points, seen in zip(pixels, visible, strict=True)]
    indices, weights = map(np.concatenate, zip(*corners, strict=True))
    offsets = np.concatenate([[0], np.cumsum(4 * visible.ravel())])
    return csr_array(
        (weights.ravel(), indices.ravel(), offsets.astype(np.int32)),
        shape=(visible.size, image_size[0] * image_size[1]),
    )


def _corners(points: NDArray, image_size: tuple[int, int]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the four pixels around each point as columns of the matrix, (N, 4), and their weights, (N, 4)."""
    height, width = image_size
    u, v = points.T
    left = np.floor(u)
    top = np.floor(v)
    right_weight = u - left
    lower_weight = v - top
    # On the last column or row the far neighbour has weight zero, but it must exist.
    right = np.minimum(left + 1, width - 1)
    bottom = np.minimum(top + 1, height - 1)
    rows = (top, 1 - lower_weight), (bottom, lower_weight)
    columns = (left, 1 - right_weight), (right, right_weight)
    indices = np.stack([row * width + column for row, _ in rows for column, _ in columns], axis=-1)
    weights = np.stack([lower * sideways for _, lower in rows for _, sideways in columns], axis=-1)
    return indices.astype(np.int32), weights.astype(np.float32)


class SparseMatrix(NamedTuple):
    """Compressed sparse rows: row r has weights[a:b] in the columns indices[a:b], a, b = offsets[r], offsets[r + 1].

    Parameters
    ----------
    indices : (N,) int32
        The column of each weight.
    offsets : (rows + 1,) int32
        Where each row begins, and where the last one ends.
    weights : (N,) float
        No unit; the weights of equation (2) sum to 1 in each visible row.
    """

    indices: Tensor
    offsets: Tensor
    weights: Tensor

    @classmethod
    def from_scipy(cls, matrix: csr_array) -> "SparseMatrix":
        """Return a matrix of SciPy as tensors that share its memory.

        Parameters
        ----------
        matrix : csr_array
            The matrix, (rows, columns).
        """
        return cls(*map(torch.from_numpy, (matrix.indices, matrix.indptr, matrix.data)))

    def multiply(self, rows: Tensor) -> Tensor:
        """Return the product with a dense matrix, (rows, C).

        PyTorch's embedding bag computes a weighted sum of gathered rows, which is this product. On a CPU it is several
        times faster than PyTorch's sparse matrices.

        Parameters
        ----------
        rows : (columns, C) float
            One row per pixel, its C scores.
        """
        weights = self.weights.to(rows.dtype)
        return F.embedding_bag(
            self.indices, rows, self.offsets, mode="sum", per_sample_weights=weights, include_last_offset=True
        )


class SparseProduct(torch.autograd.Function):
    """The product y = A x with the gradient A^T dL/dy.

    The transpose is passed in so that the backward pass gathers rows, as the forward pass does; scattering them into
    the pixels would be slower.
    """

    @staticmethod
    def forward(ctx, rows: Tensor, matrix: SparseMatrix, transpose: SparseMatrix) -> Tensor:
        """Return A x.

        Parameters
        ----------
        ctx
            PyTorch's store for what the backward pass needs.
        rows : (columns, C) float
            x, one row per column of A.
        matrix, transpose : SparseMatrix
            A and its transpose.
        """
        ctx.matrices = matrix, transpose
        return matrix.multiply(rows.contiguous())

    @staticmethod
    def backward(ctx, grad: Tensor) -> tuple[Tensor, None, None]:
        """Return A^T dL/dy, which can be differentiated again, and no gradient of the two matrices.

        Parameters
        ----------
        ctx
            PyTorch's store, filled by `forward`.
        grad : (rows, C) float
            dL/dy, the gradient of the loss with respect to the product.
        """
        matrix, transpose = ctx.matrices
        return SparseProduct.apply(grad, transpose, matrix), None, None

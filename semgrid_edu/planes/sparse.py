"""Equation (2) as a product with a sparse matrix, its transpose bringing gradients back (section 3.3)."""

from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from scipy.sparse import csr_array
from torch import Tensor


def bilinear_matrix(pixels: NDArray, visible: NDArray, image_size: tuple[int, int]) -> csr_array:
    """Return equation (2) as a matrix: one row per point, one column per pixel, four weights in each visible row.

    Parameters
    ----------
    pixels : (D, H, W, 2) float
        u, v of each point in pixels; a visible point lies inside the image.
    visible : (D, H, W) bool
        The points that take a value; the rows of the others are empty.
    image_size : (int, int)
        Height h and width w of the image, pixels.

    Returns
    -------
    (D H W, h w) float32
        Points and pixels counted row by row, points also plane by plane.

    Examples
    --------
    >>> bilinear_matrix(np.full((1, 1, 1, 2), 0.25), np.ones((1, 1, 1), bool), (2, 2)).toarray()
    array([[0.5625, 0.1875, 0.1875, 0.0625]], dtype=float32)
    """
    # One plane at a time: intermediate results then fit into the processor's cache.
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
    left, top = np.floor(u), np.floor(v)
    right_weight, lower_weight = u - left, v - top
    # On the last column or row the far neighbour has no weight, but it must exist.
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    rows = (top, 1 - lower_weight), (bottom, lower_weight)
    columns = (left, 1 - right_weight), (right, right_weight)
    indices = np.stack([row * width + column for row, _ in rows for column, _ in columns], axis=-1)
    weights = np.stack([lower * sideways for _, lower in rows for _, sideways in columns], axis=-1)
    return indices.astype(np.int32), weights.astype(np.float32)


class SparseMatrix(NamedTuple):
    """Compressed sparse rows: row r holds weights[a:b] in the columns indices[a:b], a, b = offsets[r], offsets[r + 1].

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
        """Return the product with a dense matrix, (rows, C): equation (2) for all points at once.

        PyTorch's bag of embeddings computes just that, a weighted sum of gathered rows, and on a CPU it is several
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

    def block_diagonal(self, n_blocks: int, n_columns: int) -> "SparseMatrix":
        """Return the matrix that multiplies several dense matrices at once, one stacked below the other.

        Parameters
        ----------
        n_blocks : int
            How often this matrix stands along the diagonal: once per image.
        n_columns : int
            The number of columns of this matrix. Its entries don't say, since its last columns may be empty.
        """
        block = torch.arange(n_blocks, dtype=self.offsets.dtype, device=self.offsets.device)[:, None]
        n_weights = self.offsets[-1:]
        starts = (self.offsets[:-1] + block * n_weights).flatten()
        return SparseMatrix(
            indices=(self.indices + block * n_columns).flatten(),
            offsets=torch.cat([starts, n_blocks * n_weights]),
            weights=self.weights.repeat(n_blocks),
        )


class SparseProduct(torch.autograd.Function):
    """The product y = A x with the gradient A^T dL/dy.

    The transpose is given, so that the backward pass gathers rows as the forward pass does; scattering them into the
    pixels would be slower.
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

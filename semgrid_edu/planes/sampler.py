"""Equation (2), fast and differentiable: one sparse matrix for each calibration (section 3.3)."""

from copy import deepcopy
from functools import lru_cache
from math import prod

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from torch import Tensor, nn

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.planes.pixels import check_heights, check_points, plane_pixels
from semgrid_edu.planes.sparse import SparseMatrix, SparseProduct, bilinear_matrix


class PlaneSampler(nn.Module):
    """Resample scores on the planes: equation (2), fast and differentiable.

    For a fixed calibration the four pixels around each point and their weights never change, so equation (2)
    is one sparse matrix that maps pixels to points. It and its transpose, which carries gradients back, are
    built once; for a batch they stand along a diagonal, once an image, and the last batch's are kept. Points that
    aren't visible are empty rows and cost nothing. `for_camera` goes all the way from a calibration, and remembers.

    Parameters
    ----------
    pixels : (D, H, W, 2) float
        u, v of each point, from `plane_pixels`.
    visible : (D, H, W) bool
        The points that take a value; the others take zero.
    image_size : (int, int)
        h, w of the scores.

    Raises
    ------
    ArgumentError
        When the shapes don't agree or a visible point lies outside the image.

    Examples
    --------
    >>> sampler = PlaneSampler(np.full((1, 1, 1, 2), 0.5), np.ones((1, 1, 1), bool), image_size=(2, 2))
    >>> sampler(torch.tensor([[[[0.0, 1.0], [2.0, 3.0]]]]))
    tensor([[[[[1.5000]]]]])
    """

    def __init__(self, pixels: ArrayLike, visible: ArrayLike, image_size: tuple[int, int]) -> None:
        super().__init__()
        pixels, visible = np.asarray(pixels), np.asarray(visible)
        check_points(pixels, visible, image_size)
        self.image_size = tuple(image_size)
        self.planes_shape = visible.shape
        matrix = bilinear_matrix(pixels, visible, image_size)
        self._register_matrix("matrix", matrix)
        self._register_matrix("transpose", matrix.T.tocsr())

    @staticmethod
    def for_camera(spec: GridSpec, heights: ArrayLike, camera: Camera) -> "PlaneSampler":
        """Return the sampler of a calibration: equation (1), then (2), worked out at the first call for it.

        Parameters
        ----------
        spec : GridSpec
            The cells.
        heights : (D,) float
            delta_i, metres above the ground.
        camera : Camera
            Of the image that the scores are of, at their size.

        Returns
        -------
        PlaneSampler
            A module of its own; its matrices are shared with the others of this calibration until it is moved
            to another device or type.

        Raises
        ------
        ArgumentError
            As `plane_pixels`.
        """
        heights = tuple(check_heights(heights).tolist())
        matrices = (np.asarray(T, dtype=np.float64).tobytes() for T in (camera.K, camera.T_camera_from_lidar))
        built = _build_sampler(spec, heights, *matrices, tuple(camera.size), camera.lidar_height)
        # What counts as copied already stays shared.
        return deepcopy(built, {id(part): part for part in built.buffers()})

    def _register_matrix(self, name: str, matrix: csr_array) -> None:
        """Keep a sparse matrix as buffers: they follow the module to its device, and stay out of its weights."""
        for part, values in zip(SparseMatrix._fields, (matrix.indices, matrix.indptr, matrix.data), strict=True):
            self.register_buffer(f"{name}_{part}", torch.from_numpy(values), persistent=False)

    def _matrix(self, name: str, n_images: int, n_columns: int) -> SparseMatrix:
        """Return a matrix for as many images side by side: their planes then needn't be copied into one batch."""
        matrix = SparseMatrix(*(getattr(self, f"{name}_{part}") for part in SparseMatrix._fields))
        return matrix if n_images == 1 else _block_diagonal(matrix, n_images, n_columns)

    def forward(self, scores: Tensor) -> Tensor:
        """Return the planes of each image.

        Parameters
        ----------
        scores : (B, C, h, w) float

        Returns
        -------
        (B, C, D, H, W) float
            Channels-last in memory, (B, D, H, W, C), as the convolution that follows likes it.

        Raises
        ------
        ArgumentError
            When the scores don't have the size that the sampler was built for.
        """
        if scores.ndim != 4 or tuple(scores.shape[2:]) != self.image_size:
            raise ArgumentError(
                "scores", f"shape (B, C, {self.image_size[0]}, {self.image_size[1]})", tuple(scores.shape)
            )
        n_images, n_pixels, n_points = len(scores), prod(self.image_size), prod(self.planes_shape)
        matrix = self._matrix("matrix", n_images, n_pixels)
        transpose = self._matrix("transpose", n_images, n_points)
        planes = SparseProduct.apply(scores.permute(0, 2, 3, 1).flatten(0, 2), matrix, transpose)
        return planes.unflatten(0, (n_images, *self.planes_shape)).permute(0, 4, 1, 2, 3)


# One matrix and its transpose: all batches of a training are of one size.
_block_diagonal = lru_cache(maxsize=2)(SparseMatrix.block_diagonal)


# Four calibrations: an operator at the paper's scale holds 67 MB.
@lru_cache(maxsize=4)
def _build_sampler(
    spec: GridSpec,
    heights: tuple[float, ...],
    K: bytes,
    T_camera_from_lidar: bytes,
    size: tuple[int, int],
    lidar_height: float,
) -> PlaneSampler:
    """Build a sampler from nothing but the key it is remembered by."""
    matrices = np.frombuffer(K).reshape(3, 3), np.frombuffer(T_camera_from_lidar).reshape(4, 4)
    return PlaneSampler(*plane_pixels(spec, heights, Camera(*matrices, size, lidar_height)), size)

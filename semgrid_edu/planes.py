"""Planes above the ground and what the image says on them, equations (1) and (2) of the paper (section 3.3)."""

from copy import deepcopy
from functools import lru_cache
from math import prod

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from torch import Tensor, nn

from semgrid_edu.bilinear import SparseMatrix, SparseProduct, bilinear_matrix
from semgrid_edu.camera import Camera, project, transform_points
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec


def plane_heights(n_planes: int = 20, spacing: float = 0.2) -> NDArray[np.float64]:
    """Return the heights delta_i of the planes above the ground, the lowest on it.

    Parameters
    ----------
    n_planes : int
        D; the paper's 20 (section 4.1).
    spacing : float
        The constant d between planes, metres. The paper doesn't give it. 0.2 m is the side of the paper's
        cells; 20 planes then reach 3.8 m, above cars, people, trucks and most signs.

    Returns
    -------
    (D,) float64
        Metres.

    Examples
    --------
    >>> plane_heights(4, spacing=0.5)
    array([0. , 0.5, 1. , 1.5])
    """
    if n_planes < 1:
        raise ArgumentError("n_planes", "at least one plane", n_planes)
    if not (np.isfinite(spacing) and spacing > 0):
        raise ArgumentError("spacing", "a positive distance in metres", spacing)
    return np.arange(n_planes) * float(spacing)


def plane_pixels(spec: GridSpec, heights: ArrayLike, camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Find the pixel that sees each point of each plane: equation (1).

    The point of plane i above cell j lies at (x_j, y_j, delta_i) in the grid frame, and T_camera_from_grid
    takes it to the camera.

    Parameters
    ----------
    spec : GridSpec
        The cells, (H, W) of them.
    heights : (D,) float
        delta_i, metres above the ground.
    camera : Camera

    Returns
    -------
    pixels : (D, H, W, 2) float64
        u, v; NaN behind the camera.
    visible : (D, H, W) bool
        In front of the camera and inside the image.

    Raises
    ------
    ArgumentError
        When `heights` isn't a list of one or more finite numbers.
    """
    heights = _check_heights(heights)
    centers, T_camera_from_grid = spec.centers(), camera.T_camera_from_grid
    visible = np.empty((len(heights), *spec.shape), dtype=bool)
    pixels = np.empty((*visible.shape, 2))
    # Plane by plane, as in `bilinear_matrix`: what is computed on the way stays in the processor's cache.
    for i, delta in enumerate(heights):
        points = np.dstack([centers, np.full(spec.shape, delta)])
        pixels[i], visible[i] = project(transform_points(T_camera_from_grid, points), camera)
    return pixels, visible


def _check_heights(heights: ArrayLike) -> NDArray[np.float64]:
    heights = np.asarray(heights, dtype=np.float64)
    if heights.ndim != 1 or not heights.size or not np.isfinite(heights).all():
        raise ArgumentError("heights", "one or more finite metres, shape (D,)", f"shape {heights.shape}: {heights}")
    return heights


def sample_planes_naive(scores: ArrayLike, pixels: ArrayLike, visible: ArrayLike) -> NDArray[np.float64]:
    """Resample the scores on the planes: equation (2), literally, one point at a time.

    p[c, i, j] = sum_n sum_m s[c, n, m] k(u_j - m) k(v_j - n), with the bilinear kernel k(t) = max(0, 1 - |t|).

    Parameters
    ----------
    scores : (C, h, w) float
        s, one value a class and pixel.
    pixels : (D, H, W, 2) float
        u, v of each point.
    visible : (D, H, W) bool

    Returns
    -------
    (C, D, H, W) float64
        p; zero where a point isn't visible.

    Raises
    ------
    ArgumentError
        When the shapes don't agree or a visible point lies outside the image.

    Examples
    --------
    >>> scores = np.array([[[0.0, 1.0], [2.0, 3.0]]])
    >>> sample_planes_naive(scores, np.full((1, 1, 1, 2), 0.5), np.ones((1, 1, 1), bool))
    array([[[[1.5]]]])
    """
    s, pixels, visible = np.asarray(scores, dtype=np.float64), np.asarray(pixels), np.asarray(visible)
    _check_points(pixels, visible, s.shape[1:])
    n, m = np.arange(s.shape[1]), np.arange(s.shape[2])
    p = np.zeros((s.shape[0], *visible.shape))
    for j in np.ndindex(visible.shape):
        if visible[j]:
            u, v = pixels[j]
            p[:, *j] = _bilinear_kernel(v - n) @ s @ _bilinear_kernel(u - m)
    return p


def _bilinear_kernel(t: NDArray) -> NDArray:
    return np.maximum(0, 1 - np.abs(t))


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
        _check_points(pixels, visible, image_size)
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
        heights = tuple(_check_heights(heights).tolist())
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


def _check_points(pixels: NDArray, visible: NDArray, image_size: tuple[int, int]) -> None:
    """Refuse points that don't fit each other or the image."""
    if visible.ndim != 3 or not visible.size or visible.dtype != bool:
        raise ArgumentError("visible", "bool, shape (D, H, W), not empty", f"{visible.dtype}, shape {visible.shape}")
    if pixels.shape != (*visible.shape, 2):
        raise ArgumentError("pixels", f"shape {(*visible.shape, 2)}", pixels.shape)
    last = np.array(image_size)[::-1] - 1
    planes = zip(pixels, visible, strict=True)
    if not all(((points >= 0) & (points <= last))[seen].all() for points, seen in planes):
        raise ArgumentError("pixels", f"visible points in an image of {image_size} pixels", "points outside it")

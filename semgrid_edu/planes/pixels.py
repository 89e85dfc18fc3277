"""Equations (1) and (2) as printed: the pixel of each point of a plane, and the scores around it (section 3.3)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.camera import Camera, project, transform_points
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec


def plane_heights(n_planes: int = 20, spacing: float = 0.2) -> NDArray[np.float64]:
    """Return the heights delta_i of the planes; the lowest plane is the ground itself.

    Parameters
    ----------
    n_planes : int
        D, the number of planes; 20 in the paper (section 4.1).
    spacing : float
        d, the constant distance between planes, metres. The paper doesn't give it. 0.2 m is the side of the
        paper's cells; the highest of 20 planes is then at 3.8 m, above cars, people, trucks and most signs.

    Returns
    -------
    (D,) float64
        Heights in metres, from 0 upwards.

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

    The point of plane i above cell j is (x_j, y_j, delta_i) in the grid frame, and T_camera_from_grid takes it to the
    camera.

    Parameters
    ----------
    spec : GridSpec
        The cells, (H, W) of them.
    heights : (D,) float
        delta_i, metres above the ground.
    camera : Camera
        The camera at the size of the image, see `Camera.resized`.

    Returns
    -------
    pixels : (D, H, W, 2) float64
        u, v of each point in pixels; NaN for points behind the camera.
    visible : (D, H, W) bool
        Whether the point is in front of the camera and inside the image.
    """
    heights = check_heights(heights)
    centers = spec.centers()
    T_camera_from_grid = camera.T_camera_from_grid
    visible = np.empty((len(heights), *spec.shape), dtype=bool)
    pixels = np.empty((*visible.shape, 2))
    # One plane at a time, so that intermediate results fit into the processor's cache.
    for i, delta in enumerate(heights):
        points = np.dstack([centers, np.full(spec.shape, delta)])
        pixels[i], visible[i] = project(transform_points(T_camera_from_grid, points), camera)
    return pixels, visible


def check_heights(heights: ArrayLike) -> NDArray[np.float64]:
    """Return the heights of planes as an array, or raise an `ArgumentError` if they aren't one or more finite numbers.

    Parameters
    ----------
    heights : (D,) float
        delta_i, metres above the ground.
    """
    heights = np.asarray(heights, dtype=np.float64)
    if heights.ndim != 1 or not heights.size or not np.isfinite(heights).all():
        raise ArgumentError("heights", "one or more finite metres, shape (D,)", f"shape {heights.shape}: {heights}")
    return heights


def check_plane_points(pixels: NDArray, visible: NDArray, image_size: tuple[int, int]) -> None:
    """Raise an `ArgumentError` if the shapes don't agree, or a visible point is outside the image.

    Parameters
    ----------
    pixels : (D, H, W, 2) float
        u, v of each point in pixels.
    visible : (D, H, W) bool
        The points that take a value.
    image_size : (int, int)
        Height h and width w of the image, pixels.
    """
    if visible.ndim != 3 or not visible.size or visible.dtype != bool:
        raise ArgumentError("visible", "bool, shape (D, H, W), not empty", f"{visible.dtype}, shape {visible.shape}")
    if pixels.shape != (*visible.shape, 2):
        raise ArgumentError("pixels", f"shape {(*visible.shape, 2)}", pixels.shape)
    last = np.array(image_size)[::-1] - 1
    inside = (pixels >= 0) & (pixels <= last)
    if not inside[visible].all():
        raise ArgumentError("pixels", f"visible points in an image of {image_size} pixels", "points outside it")


def sample_planes_naive(scores: ArrayLike, pixels: ArrayLike, visible: ArrayLike) -> NDArray[np.float64]:
    """Resample the scores on the planes: equation (2) as printed, one point at a time.

    p[c, i, j] = sum_n sum_m s[c, n, m] k(u_j - m) k(v_j - n), with the bilinear kernel ``k(t) = max(0, 1 - |t|)``.

    Parameters
    ----------
    scores : (C, h, w) float
        s, one value per class and pixel.
    pixels : (D, H, W, 2) float
        u, v of each point in pixels, from `plane_pixels`.
    visible : (D, H, W) bool
        The points that take a value; the others take zero.

    Returns
    -------
    (C, D, H, W) float64
        p, one value per class and point.

    Examples
    --------
    >>> scores = np.array([[[0.0, 1.0], [2.0, 3.0]]])
    >>> sample_planes_naive(scores, np.full((1, 1, 1, 2), 0.5), np.ones((1, 1, 1), bool))
    array([[[[1.5]]]])
    """
    s = np.asarray(scores, dtype=np.float64)
    pixels = np.asarray(pixels)
    visible = np.asarray(visible)
    check_plane_points(pixels, visible, s.shape[1:])
    n = np.arange(s.shape[1])  # rows of the image
    m = np.arange(s.shape[2])  # columns
    p = np.zeros((s.shape[0], *visible.shape))
    for j in np.ndindex(visible.shape):
        if visible[j]:
            u, v = pixels[j]
            p[:, *j] = _bilinear_kernel(v - n) @ s @ _bilinear_kernel(u - m)
    return p


def _bilinear_kernel(t: NDArray) -> NDArray:
    """Return k(t), the weight along one axis of a pixel at distance t from the point."""
    return np.maximum(0, 1 - np.abs(t))

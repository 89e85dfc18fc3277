"""Equation (2) as printed: each point of a plane takes its value from the scores around its pixel (section 3.3)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.planes.pixels import check_plane_points


def sample_planes_naive(scores: ArrayLike, pixels: ArrayLike, visible: ArrayLike) -> NDArray[np.float64]:
    """Resample the scores on the planes: equation (2), literally, one point at a time.

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
    s, pixels, visible = np.asarray(scores, dtype=np.float64), np.asarray(pixels), np.asarray(visible)
    check_plane_points(pixels, visible, s.shape[1:])
    n, m = np.arange(s.shape[1]), np.arange(s.shape[2])
    p = np.zeros((s.shape[0], *visible.shape))
    for j in np.ndindex(visible.shape):
        if visible[j]:
            u, v = pixels[j]
            p[:, *j] = _bilinear_kernel(v - n) @ s @ _bilinear_kernel(u - m)
    return p


def _bilinear_kernel(t: NDArray) -> NDArray:
    """Return k(t), the weight of a pixel at distance t along one axis."""
    return np.maximum(0, 1 - np.abs(t))

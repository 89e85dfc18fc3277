"""What pooling indices, skips and atrous convolutions each do to a thin pole, without learning (paper, section 3.1)."""

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.backbones.deeplab import interpolate
from semgrid_edu.networks.backbones.fcn import enlarge

MECHANISMS = ("nearest", "bilinear", "indices", "skips", "strided", "atrous")
"""Ways to see far and to end at full resolution: max-pooling, then enlarging its result in one of two ways, unpooling
it by its indices (SegNet), or adding finer maps to it (FCN); strides, then interpolation; holes instead of strides
(DeepLab)."""


def apply_mechanism(image: ArrayLike, mechanism: str) -> NDArray[np.float64]:
    """Send an image through one mechanism with fixed weights: down to a quarter of its size and up again.

    Parameters
    ----------
    image : (H, W) float
        Any image whose sides are multiples of 4.
    mechanism : str
        One of `MECHANISMS`. "nearest" and "bilinear": the image is max-pooled twice, then each value is spread over its
        4 x 4 pixels, or interpolated between their middles. "indices": values go back to where the maxima were.
        "skips": as in FCN, each map on the way up is added to the one of its size on the way down; here the result is
        the mean of all three. "strided": the image is filtered twice with the binomial kernel (1, 2, 1)/4 in both
        directions and stride 2, then interpolated. "atrous": the same without strides (the image stays at full size),
        where the second kernel has holes.

    Returns
    -------
    (H, W) float64
        What is left of the image.

    Raises
    ------
    ArgumentError
        When there is no such mechanism or 4 doesn't divide the sides.

    Examples
    --------
    >>> pole = np.zeros((4, 4))
    >>> pole[0, 2] = 1
    >>> apply_mechanism(pole, "nearest")[0]
    array([1., 1., 1., 1.])
    >>> apply_mechanism(pole, "indices")[0]
    array([0., 0., 1., 0.])
    """
    check_mechanism(mechanism)
    x = torch.as_tensor(np.asarray(image, np.float64))
    if x.ndim != 2 or min(x.shape) < 4 or x.shape[0] % 4 or x.shape[1] % 4:
        raise ArgumentError("image", "shape (H, W) of multiples of 4", tuple(x.shape))
    apply = _apply_kernels if mechanism in ("strided", "atrous") else _apply_pooling
    return apply(x[None, None], mechanism)[0, 0].numpy()


def _apply_pooling(x: Tensor, mechanism: str) -> Tensor:
    half, where_half = F.max_pool2d(x, 2, return_indices=True)
    quarter, where_quarter = F.max_pool2d(half, 2, return_indices=True)
    if mechanism == "indices":
        return F.max_unpool2d(F.max_unpool2d(quarter, where_quarter, 2), where_half, 2)
    if mechanism == "nearest":
        return F.interpolate(quarter, scale_factor=4)
    if mechanism == "bilinear":
        return enlarge(quarter, 4, x.shape[2:])
    return (enlarge(enlarge(quarter, 2, half.shape[2:]) + half, 2, x.shape[2:]) + x) / 3


def _apply_kernels(x: Tensor, mechanism: str) -> Tensor:
    binomial = torch.tensor([1, 2, 1], dtype=x.dtype) / 4
    kernel = torch.outer(binomial, binomial)[None, None]
    if mechanism == "strided":
        twice = F.conv2d(F.conv2d(x, kernel, stride=2, padding=1), kernel, stride=2, padding=1)
        return interpolate(twice, 4, x.shape[2:])
    return F.conv2d(F.conv2d(x, kernel, padding=1), kernel, padding=2, dilation=2)


def place_and_width(profile: ArrayLike) -> tuple[float, int]:
    """Return where a row of an image is brightest and how wide it is there.

    Parameters
    ----------
    profile : (W,) float
        One row of an image, with at least one value above 0.

    Returns
    -------
    place : float
        Column of the largest value, pixels; the mean column of several equal ones.
    width : int
        Full width at half maximum: number of pixels with at least half the largest value.

    Examples
    --------
    >>> place_and_width([0, 1, 4, 4, 3, 0])
    (2.5, 3)
    """
    profile = np.asarray(profile, np.float64)
    if profile.ndim != 1 or not profile.max(initial=0) > 0:
        raise ArgumentError("profile", "a row of pixels, at least one above 0", profile)
    brightest = np.flatnonzero(np.isclose(profile, profile.max()))
    return float(brightest.mean()), int((profile >= profile.max() / 2).sum())


def check_mechanism(mechanism: str) -> None:
    """Refuse an unknown mechanism.

    Parameters
    ----------
    mechanism : str
        One of `MECHANISMS`.

    Raises
    ------
    ArgumentError
        When it is none of them.
    """
    if mechanism not in MECHANISMS:
        raise ArgumentError("mechanism", f"one of {', '.join(MECHANISMS)}", repr(mechanism))

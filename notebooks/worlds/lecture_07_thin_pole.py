"""The effect of pooling indices, skips and atrous convolutions on a thin pole, first without training (section 3.1)."""

from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from semgrid_edu.networks.deeplab import interpolate
from semgrid_edu.networks.fcn import enlarge
from semgrid_edu.networks.segmenter import fresh_weights

MECHANISMS = ("nearest", "bilinear", "indices", "skips", "strided", "atrous")
"""Ways to see far and still score at full resolution: max-pooling, then enlarging its result in one of two ways,
unpooling it by its indices (SegNet), or adding finer maps to it (FCN); strides, then interpolation; holes instead of
strides (DeepLab)."""
SIDE = 32
"""Side of the images, pixels."""
NOISE = 0.1
"""Standard deviation of each pixel's noise; poles are three to five times as bright."""
WIDTH = 8
"""Channels of every layer of a `PoleNet`."""
STRIDES = (1, 2, 2, 1, 1, 1, 1)
"""Strides of the seven layers of "strided"."""
RATES = (1, 1, 2, 4, 4, 4, 4)
"""Rates of the seven layers of "atrous": the atrous algorithm derives them from the strides, see `ResNet`."""
BATCH_SIZE = 4
LEARNING_RATE = 0.02
"""For Adam: gradient descent with momentum, as in `train`, takes more steps than fit into seconds."""
POLE_WEIGHT = 4.0
"""Weight of a pole's pixel in the loss, the limit of `TrainingParams`: three pixels in a hundred belong to poles."""


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
        The image after the mechanism.

    Examples
    --------
    >>> pole = np.zeros((4, 4))
    >>> pole[0, 2] = 1
    >>> apply_mechanism(pole, "nearest")[0]
    array([1., 1., 1., 1.])
    >>> apply_mechanism(pole, "indices")[0]
    array([0., 0., 1., 0.])
    """
    x = torch.as_tensor(np.asarray(image, np.float64))
    apply = _apply_kernels if mechanism in ("strided", "atrous") else _apply_pooling
    return apply(x[None, None], mechanism)[0, 0].numpy()


def _apply_pooling(x: Tensor, mechanism: str) -> Tensor:
    half, where_half = F.max_pool2d(x, 2, return_indices=True)
    quarter, where_quarter = F.max_pool2d(half, 2, return_indices=True)
    if mechanism == "bilinear":
        return enlarge(quarter, 4, x.shape[2:])
    whole = _double(mechanism, _double(mechanism, quarter, half, where_quarter), x, where_half)
    return whole / 3 if mechanism == "skips" else whole


def _double(mechanism: str, x: Tensor, before: Tensor, indices: Tensor) -> Tensor:
    """Double a map's size; `before` and `indices` are those of the pooling that halved it."""
    if mechanism == "indices":
        return F.max_unpool2d(x, indices, 2)
    if mechanism == "nearest":
        return F.interpolate(x, scale_factor=2)
    larger = enlarge(x, 2, before.shape[2:])
    return larger + before if mechanism == "skips" else larger


def _apply_kernels(x: Tensor, mechanism: str) -> Tensor:
    binomial = torch.tensor([1, 2, 1], dtype=x.dtype) / 4
    kernel = torch.outer(binomial, binomial)[None, None]
    stride, rate = (2, 1) if mechanism == "strided" else (1, 2)
    twice = F.conv2d(F.conv2d(x, kernel, None, stride, 1), kernel, None, stride, rate, rate)
    return interpolate(twice, 4, x.shape[2:]) if mechanism == "strided" else twice


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
    brightest = np.flatnonzero(np.isclose(profile, profile.max()))
    return float(brightest.mean()), int((profile >= profile.max() / 2).sum())


def draw_poles(n: int, seed: int) -> tuple[Tensor, Tensor]:
    """Draw noisy images of a pole, one or two pixels wide, beside a wall of the same brightness.

    A single bright pixel may be pole or wall. To tell them apart, a network must see the whole width of the wall, 6 to
    10 pixels.

    Parameters
    ----------
    n : int
        Number of images.
    seed : int
        Seed for everything that is drawn.

    Returns
    -------
    images : (n, 1, 32, 32) float32
        Brightness.
    truth : (n, 32, 32) int64
        1 for a pixel of the pole, else 0.
    """
    rng = np.random.default_rng(seed)
    images = rng.normal(rng.uniform(0.3, 0.7, (n, 1, 1)), NOISE, (n, SIDE, SIDE))
    truth = np.zeros((n, SIDE, SIDE), np.int64)
    for image, labels in zip(images, truth, strict=True):
        pole = rng.integers(1, 3)
        wall = rng.integers(6, 11)
        first, second = rng.permutation([pole, wall])
        left = rng.integers(0, SIDE - pole - wall - 1)
        right = left + first + rng.integers(2, SIDE - pole - wall - left + 1)
        rows = slice(rng.integers(2, 13), rng.integers(20, 31))
        brighter = rng.uniform(0.3, 0.5)
        for start, width in ((left, first), (right, second)):
            image[rows, start : start + width] += brighter
            labels[rows, start : start + width] = width == pole
    return torch.from_numpy(images[:, None].astype(np.float32)), torch.from_numpy(truth)


class PoleNet(nn.Module):
    """Seven 3x3 convolutions that find poles. The networks differ only in their mechanism.

    All six have the same layers in the same order, so they have the same number of weights, and with the same seed the
    same initial weights. Three layers lead down, one stays at a quarter of the resolution, two lead up, one scores.
    "strided" scores at a quarter of the resolution and interpolates, which takes 0.4 million multiplications per image.
    "atrous" stays at full resolution and takes 3.2 million. The others take 1.2 million.

    Parameters
    ----------
    mechanism : str
        One of `MECHANISMS`.
    seed : int
        Seed for the initial weights.
    """

    def __init__(self, mechanism: str, seed: int = 0) -> None:
        super().__init__()
        self.mechanism = mechanism
        strides = STRIDES if mechanism == "strided" else (1,) * 7
        rates = RATES if mechanism == "atrous" else (1,) * 7
        channels = (1, *(WIDTH,) * 6, 2)
        with fresh_weights(self, seed):
            self.layers = nn.Sequential(*map(_layer, channels[:-1], channels[1:], strides, rates))
            self.layers[-1] = self.layers[-1][0]

    def forward(self, image: Tensor) -> Tensor:
        """Score every pixel as ground and as pole, (B, 2, h, w) float32.

        Parameters
        ----------
        image : (B, 1, h, w) float32
            Images whose sides are multiples of 4.
        """
        x = image.contiguous(memory_format=torch.channels_last)
        if self.mechanism not in ("strided", "atrous"):
            return self._down_and_up(x)
        x = self.layers(x)
        return interpolate(x, 4, image.shape[2:]) if self.mechanism == "strided" else x

    def _down_and_up(self, x: Tensor) -> Tensor:
        full, half, quarter, stay, to_half, to_full, score = self.layers
        first = full(x)
        x, where_first = F.max_pool2d(first, 2, return_indices=True)
        second = half(x)
        x, where_second = F.max_pool2d(second, 2, return_indices=True)
        x = to_half(_double(self.mechanism, stay(quarter(x)), second, where_second))
        return score(to_full(_double(self.mechanism, x, first, where_first)))


def _layer(n_in: int, n_out: int, stride: int, rate: int) -> nn.Sequential:
    conv = nn.Conv2d(n_in, n_out, 3, stride, padding=rate, dilation=rate)
    return nn.Sequential(conv, nn.BatchNorm2d(n_out), nn.ReLU(inplace=True))


def train_pole_net(mechanism: str, steps: int = 150, seed: int = 0) -> PoleNet:
    """Train a network on images of poles, each seen once, and return it in evaluation mode. It takes a second or two.

    Parameters
    ----------
    mechanism : str
        One of `MECHANISMS`.
    steps : int
        Number of steps, each on 4 new images.
    seed : int
        Seed for the initial weights and for the images.
    """
    net = PoleNet(mechanism, seed)
    optimiser = torch.optim.Adam(net.parameters(), LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    images, truth = draw_poles(BATCH_SIZE * steps, seed)
    for image, labels in zip(images.split(BATCH_SIZE), truth.split(BATCH_SIZE), strict=True):
        optimiser.zero_grad()
        F.cross_entropy(net(image), labels, weight=torch.tensor([1, POLE_WEIGHT])).backward()
        optimiser.step()
        schedule.step()
    return net.eval()


class PoleScores(NamedTuple):
    """How well a network finds poles.

    Parameters
    ----------
    iou : float
        Intersection over union of the poles' pixels, all images together, 0..1.
    missed : float
        Share of the rows with a pole in which no pixel is predicted as pole, 0..1.
    width, true_width : float
        Mean number of pixels predicted as pole, and of the pole's pixels, in a row that isn't missed; NaN if all are.
    offset : float
        Mean distance between the centres of both, pixels; NaN if all rows are missed.
    """

    iou: float
    missed: float
    width: float
    true_width: float
    offset: float


def score_poles(predicted: ArrayLike, truth: ArrayLike) -> PoleScores:
    """Compare the predicted pixels with the poles.

    Parameters
    ----------
    predicted, truth : (n, H, W) bool or int
        Prediction and truth: 1 for a pixel of a pole, else 0.
    """
    predicted = np.asarray(predicted, bool)
    truth = np.asarray(truth, bool)
    iou = (predicted & truth).sum() / (predicted | truth).sum()
    with_pole = truth.any(axis=-1)
    found = with_pole & predicted.any(axis=-1)
    if not found.any():
        return PoleScores(float(iou), 1.0, *[float("nan")] * 3)
    called = predicted[found]
    poles = truth[found]
    offset = np.abs(_middle(called) - _middle(poles)).mean()
    missed = 1 - found.sum() / with_pole.sum()
    return PoleScores(*map(float, (iou, missed, called.sum(1).mean(), poles.sum(1).mean(), offset)))


def _middle(rows: NDArray[np.bool_]) -> NDArray[np.float64]:
    return rows @ np.arange(rows.shape[1]) / rows.sum(axis=1)

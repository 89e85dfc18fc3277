"""Tiny networks that differ in one mechanism alone, and how well each finds thin poles (paper, section 3.1)."""

from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from semgrid_edu.errors import ArgumentError
from semgrid_edu.networks.backbones.conv_deconv import fresh_weights
from semgrid_edu.networks.backbones.deeplab import interpolate
from semgrid_edu.networks.backbones.fcn import enlarge
from semgrid_edu.workshop.illustrations.thin_pole import check_mechanism

SIDE = 32
"""Side of the images, pixels."""
NOISE = 0.1
"""Standard deviation of the noise of each pixel; poles stand out from the ground by three to five times as much."""
WIDTH = 8
"""Channels of every layer of a `PoleNet`."""
STRIDES, RATES = (1, 2, 2, 1, 1, 1, 1), (1, 1, 2, 4, 4, 4, 4)
"""Strides of the seven layers of "strided", rates of those of "atrous". The atrous algorithm makes the second of the
first, see `ResNet`."""
BATCH_SIZE, LEARNING_RATE = 8, 0.02
"""For Adam: gradient descent with momentum, as in `train`, takes more steps than fit into seconds."""
POLE_WEIGHT = 4.0
"""Weight of a pole's pixel in the loss, the limit of `TrainingParams`: three pixels in a hundred belong to poles."""


def draw_poles(n: int, seed: int) -> tuple[Tensor, Tensor]:
    """Draw noisy images of a pole, one or two pixels wide, beside a wall of the same brightness.

    A bright pixel alone doesn't tell pole from wall. For that, a network must see as far as the wall is wide, 6 to 10
    pixels.

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
        pole, wall = rng.integers(1, 3), rng.integers(6, 11)
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
    """Seven 3x3 convolutions that find poles. Networks differ in one mechanism alone.

    All six have the same layers in the same order, so they have equally many weights, and with one seed the same
    initial ones. Three layers lead down, one stays at a quarter of the resolution, two lead up, one scores. "strided"
    scores at a quarter of the resolution and interpolates, which takes 0.4 million multiplications per image. "atrous"
    stays at full resolution and takes 3.2 million. The others take 1.2 million.

    Parameters
    ----------
    mechanism : str
        One of `MECHANISMS`.
    seed : int
        Seed for the initial weights.

    Raises
    ------
    ArgumentError
        When there is no such mechanism.
    """

    def __init__(self, mechanism: str, seed: int = 0) -> None:
        super().__init__()
        check_mechanism(mechanism)
        self.mechanism = mechanism
        strides = STRIDES if mechanism == "strided" else (1,) * 7
        rates = RATES if mechanism == "atrous" else (1,) * 7
        channels = (1, *(WIDTH,) * 6, 2)
        with fresh_weights(self, seed):
            self.layers = nn.ModuleList(map(_layer, channels[:-1], channels[1:], strides, rates))
            self.layers[-1] = self.layers[-1][0]

    def forward(self, image: Tensor) -> Tensor:
        """Score every pixel.

        Parameters
        ----------
        image : (B, 1, h, w) float32
            Images whose sides are multiples of 4.

        Returns
        -------
        (B, 2, h, w) float32
            Scores of ground and pole.
        """
        x = image.contiguous(memory_format=torch.channels_last)
        if self.mechanism not in ("strided", "atrous"):
            return self._down_and_up(x)
        for layer in self.layers:
            x = layer(x)
        return interpolate(x, 4, image.shape[2:]) if self.mechanism == "strided" else x

    def _down_and_up(self, x: Tensor) -> Tensor:
        full, half, quarter, stay, to_half, to_full, score = self.layers
        seen = []
        for encode in (full, half):
            before = encode(x)
            x, indices = F.max_pool2d(before, 2, return_indices=True)
            seen.append((before, indices))
        x = stay(quarter(x))
        for decode, (before, indices) in zip((to_half, to_full), reversed(seen), strict=True):
            x = decode(self._up(x, before, indices))
        return score(x)

    def _up(self, x: Tensor, before: Tensor, indices: Tensor) -> Tensor:
        """Double a map's size; `before` and `indices` are those of the pooling that halved it."""
        if self.mechanism == "indices":
            return F.max_unpool2d(x, indices, 2)
        if self.mechanism == "nearest":
            return F.interpolate(x, scale_factor=2)
        larger = enlarge(x, 2, before.shape[2:])
        return larger + before if self.mechanism == "skips" else larger


def _layer(n_in: int, n_out: int, stride: int, rate: int) -> nn.Sequential:
    conv = nn.Conv2d(n_in, n_out, 3, stride, padding=rate, dilation=rate)
    return nn.Sequential(conv, nn.BatchNorm2d(n_out), nn.ReLU(inplace=True))


def train_pole_net(mechanism: str, steps: int = 150, seed: int = 0) -> PoleNet:
    """Train a network on images of poles, each seen once. It takes a second or two.

    Parameters
    ----------
    mechanism : str
        One of `MECHANISMS`.
    steps : int
        Number of steps, each on 8 new images.
    seed : int
        Seed for the initial weights and for the images.

    Returns
    -------
    PoleNet
        In evaluation mode.
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
    """How well poles are found.

    Parameters
    ----------
    iou : float
        Intersection over union of the poles' pixels, all images together, 0..1.
    missed : float
        Share of the rows with a pole in which no pixel is called pole, 0..1.
    width, true_width : float
        Mean number of pixels called pole, and of pixels of the pole, in a row that isn't missed; NaN where all are.
    offset : float
        Mean distance between the middles of both, pixels; NaN where all rows are missed.
    """

    iou: float
    missed: float
    width: float
    true_width: float
    offset: float


def score_poles(predicted: ArrayLike, truth: ArrayLike) -> PoleScores:
    """Compare the pixels called pole with the poles.

    Parameters
    ----------
    predicted, truth : (n, H, W) bool or int
        What is called pole, and what is: 1 for a pixel of a pole, else 0.

    Returns
    -------
    PoleScores
    """
    predicted, truth = np.asarray(predicted, bool), np.asarray(truth, bool)
    if predicted.shape != truth.shape or truth.ndim != 3 or not truth.any():
        raise ArgumentError("predicted, truth", "one shape (n, H, W), and poles", f"{predicted.shape}, {truth.shape}")
    iou = (predicted & truth).sum() / (predicted | truth).sum()
    stands = truth.any(axis=-1)
    found = stands & predicted.any(axis=-1)
    if not found.any():
        return PoleScores(float(iou), 1.0, *[float("nan")] * 3)
    called, poles = predicted[found], truth[found]
    offset = np.abs(_middle(called) - _middle(poles)).mean()
    missed = 1 - found.sum() / stands.sum()
    return PoleScores(*map(float, (iou, missed, called.sum(1).mean(), poles.sum(1).mean(), offset)))


def _middle(rows: NDArray[np.bool_]) -> NDArray[np.float64]:
    return rows @ np.arange(rows.shape[1]) / rows.sum(axis=1)

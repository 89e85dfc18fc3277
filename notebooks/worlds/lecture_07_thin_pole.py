"""The effect of pooling, strides, indices, skips and atrous convolutions on a thin pole (section 3.1)."""

from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
import typer
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn
from tqdm.auto import tqdm

from semgrid_edu.networks.deeplab import interpolate
from semgrid_edu.networks.fcn import enlarge
from semgrid_edu.networks.segmenter import fresh_weights

MECHANISMS = ("nearest", "indices", "half skips", "skips", "atrous")
"""Ways to see far and still score at full resolution: max-pooling, then enlarging its result, unpooling it by its
indices (SegNet), or adding finer maps to it, up to half the size as FCN does or up to full size as U-Net does; holes
instead of halving (DeepLab)."""


class Way(NamedTuple):
    """How a `PoleNet` goes down to a quarter of the size, and up again.

    Parameters
    ----------
    down : str
        "pooling", "strides" or "atrous", which stays at full size.
    up : str
        "at once": scores at a quarter of the size are interpolated. "decoder": the map is doubled and convolved,
        twice. "indices" and "skips": the decoder also gets what `MECHANISMS` says. "": there is nothing to go up.
    """

    down: str
    up: str


WAYS = (
    *(Way(down, up) for up in ("at once", "decoder") for down in ("pooling", "strides")),
    Way("pooling", "skips"),
    Way("strides", "skips"),
    Way("pooling", "indices"),
    Way("atrous", ""),
)
"""The networks that are compared."""

SHORT = {
    Way("pooling", "at once"): (43, 47, 38, 42, 49),
    Way("strides", "at once"): (41, 42, 41, 40, 41),
    Way("pooling", "decoder"): (56, 65, 50, 65, 51),
    Way("strides", "decoder"): (64, 76, 59, 60, 67),
    Way("pooling", "skips"): (96, 96, 96, 94, 95),
    Way("strides", "skips"): (96, 96, 94, 94, 95),
    Way("pooling", "indices"): (82, 89, 85, 85, 82),
    Way("atrous", ""): (95, 94, 93, 93, 95),
}
"""Overlap of each way's networks on new images by seed, per cent, after `SHORT_STEPS`."""

REACHED = {
    Way("pooling", "at once"): (56, 57, 58, 55, 57),
    Way("strides", "at once"): (44, 45, 45, 45, 46),
    Way("pooling", "decoder"): (65, 86, 75, 82, 84),
    Way("strides", "decoder"): (89, 87, 86, 86, 87),
    Way("pooling", "skips"): (98, 98, 98, 98, 98),
    Way("strides", "skips"): (98, 98, 98, 98, 98),
    Way("pooling", "indices"): (94, 93, 94, 91, 91),
    Way("atrous", ""): (99, 99, 99, 99, 99),
}
"""The same after `STEPS`; `python -m worlds.lecture_07_thin_pole` prints both."""

SIDE = 32
"""Side of the images, pixels."""
NOISE = 0.1
"""Standard deviation of each pixel's noise; poles are three to five times as bright."""
WIDTH = 8
"""Channels of every layer of a `PoleNet`."""
RATES = (1, 1, 2, 4, 4, 4, 4)
"""Rates of the seven layers of "atrous": the atrous algorithm derives them from strides of 2 in the second and third
layer, see `ResNet`."""
BATCH_SIZE = 4
STEPS, SHORT_STEPS = 1200, 300
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
        One of `MECHANISMS`. "nearest": the image is max-pooled twice, then each value is spread over its 4 x 4 pixels.
        "indices": values go back to where the maxima were. "skips": each map on the way up is added to the one of its
        size on the way down, and the result is the mean of all three; "half skips" leaves the full size out, as FCN
        leaves out its finest maps. "atrous": the image stays at full
        size and is filtered with the binomial kernel (1, 2, 1)/4 in both directions, and again with holes in it.

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
    x = torch.as_tensor(np.asarray(image, np.float64))[None, None]
    if mechanism == "atrous":
        return _apply_kernels(x)[0, 0].numpy()
    half, where_half = F.max_pool2d(x, 2, return_indices=True)
    quarter, where_quarter = F.max_pool2d(half, 2, return_indices=True)
    if mechanism == "half skips":
        return (enlarge(enlarge(quarter, 2, half.shape[2:]) + half, 2, x.shape[2:]) / 2)[0, 0].numpy()
    whole = _double(mechanism, _double(mechanism, quarter, half, where_quarter), x, where_half)
    return (whole / 3 if mechanism == "skips" else whole)[0, 0].numpy()


def _double(mechanism: str, x: Tensor, before: Tensor, indices: Tensor) -> Tensor:
    """Double a pooled map's size; `before` and `indices` are those of the pooling that halved it."""
    if mechanism == "indices":
        return F.max_unpool2d(x, indices, 2)
    if mechanism == "nearest":
        return F.interpolate(x, scale_factor=2)
    larger = enlarge(x, 2, before.shape[2:])
    return larger + before if mechanism == "skips" else larger


def _apply_kernels(x: Tensor) -> Tensor:
    binomial = torch.tensor([1, 2, 1], dtype=x.dtype) / 4
    kernel = torch.outer(binomial, binomial)[None, None]
    return F.conv2d(F.conv2d(x, kernel, padding=1), kernel, padding=2, dilation=2)


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
    """Seven 3x3 convolutions that find poles. The networks differ only in their way down and up.

    All have the same layers in the same order, so they have the same number of weights, and with the same seed the
    same initial weights. Three layers lead down, one stays at a quarter of the size, two lead up, one scores; "at once"
    keeps the last three at a quarter of the size, "atrous" keeps all at full size.

    Parameters
    ----------
    way : Way
        One of `WAYS`.
    seed : int
        Seed for the initial weights.
    """

    def __init__(self, way: Way, seed: int = 0) -> None:
        super().__init__()
        self.way = way
        strides = (1, 2, 2, 1, 1, 1, 1) if way.down == "strides" else (1,) * 7
        rates = RATES if way.down == "atrous" else (1,) * 7
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
        if self.way.down == "atrous":
            return self.layers(x)
        full, half, quarter, stay, to_half, to_full, score = self.layers
        ups = []
        for down in (full, half):
            before = down(x)
            x, indices = (
                (before, before) if self.way.down == "strides" else F.max_pool2d(before, 2, return_indices=True)
            )
            ups.append((before, indices))
        x = stay(quarter(x))
        if self.way.up == "at once":
            return self._larger(score(to_full(to_half(x))), 4, image)
        (first, where_first), (second, where_second) = ups
        x = to_half(self._doubled(x, second, where_second))
        return score(to_full(self._doubled(x, first, where_first)))

    def _doubled(self, x: Tensor, before: Tensor, indices: Tensor) -> Tensor:
        """Return a map at twice its size; strided cells are elsewhere than pooled ones."""
        if self.way.down == "pooling":
            return _double(self.way.up, x, before, indices)
        larger = interpolate(x, 2, before.shape[2:])
        return larger + before if self.way.up == "skips" else larger

    def _larger(self, x: Tensor, factor: int, image: Tensor) -> Tensor:
        """Interpolate, between the places where pooled or strided cells are."""
        return (interpolate if self.way.down == "strides" else enlarge)(x, factor, image.shape[2:])


def _layer(n_in: int, n_out: int, stride: int, rate: int) -> nn.Sequential:
    conv = nn.Conv2d(n_in, n_out, 3, stride, padding=rate, dilation=rate)
    return nn.Sequential(conv, nn.BatchNorm2d(n_out), nn.ReLU(inplace=True))


def train_pole_net(way: Way, seed: int = 0, steps: int = STEPS) -> PoleNet:
    """Train a network on images of poles, each seen once, and return it in evaluation mode. It takes some seconds.

    Parameters
    ----------
    way : Way
        One of `WAYS`.
    seed : int
        Seed for the initial weights and for the images.
    steps : int
        Number of steps, each on 4 new images.
    """
    net = PoleNet(way, seed)
    optimiser = torch.optim.Adam(net.parameters(), LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    images, truth = draw_poles(BATCH_SIZE * steps, seed)
    for image, labels in zip(images.split(BATCH_SIZE), truth.split(BATCH_SIZE), strict=True):
        optimiser.zero_grad()
        F.cross_entropy(net(image), labels, weight=torch.tensor([1, POLE_WEIGHT])).backward()
        optimiser.step()
        schedule.step()
    return net.eval()


def overlap(called: ArrayLike, truth: ArrayLike) -> float:
    """Return the intersection over union of poles: pixels that are and are called pole, over those that are either.

    Parameters
    ----------
    called, truth : (n, H, W) bool or int
        1 for a pixel of a pole, else 0.
    """
    called = np.asarray(called, bool)
    truth = np.asarray(truth, bool)
    return float((called & truth).sum() / (called | truth).sum())


@torch.inference_mode()
def overlap_of(way: Way, seed: int, steps: int = STEPS) -> float:
    """Train a network and return its overlap on 100 images of a test set, per cent.

    Parameters are those of `train_pole_net`.
    """
    images, truth = draw_poles(100, seed=12345)
    with torch.inference_mode(False):
        net = train_pole_net(way, seed, steps)
    return 100 * overlap(net(images).argmax(dim=1), truth)


def main(seeds: int = 5) -> None:
    """Train all networks and print their overlaps, seed by seed; this is how `SHORT` and `REACHED` were made.

    Parameters
    ----------
    seeds : int
        Number of networks of each way.
    """
    torch.set_num_threads(1)
    for steps in (SHORT_STEPS, STEPS):
        for way in tqdm(WAYS, desc=f"{steps} steps"):
            print(f"    {way}: {tuple(round(overlap_of(way, seed, steps)) for seed in range(seeds))},", flush=True)


if __name__ == "__main__":
    typer.run(main)

"""What ImageNet weights brought on a real street: numbers of `docs/results/imagenet_worth.json` for lecture 07.

Pixel accuracy, per cent, on PandaSet's scene 002 after 24 labelled images and 100 steps, each map of the encoder
normalised before the decoder adds it. `lecture_07_imagenet` made them.
"""

from typing import NamedTuple


class Reached(NamedTuple):
    """What a network reaches, by what its encoder starts from; one training a round.

    Parameters
    ----------
    others, low, high : float
        On cameras that it didn't learn from: mean of the rounds, and ends of its interval.
    own : float
        On the very images that it learned from.
    """

    others: float
    low: float
    high: float
    own: float


REACHED = {
    "ImageNet": Reached(82, 79, 86, own=91),
    "ImageNet, shuffled": Reached(45, 38, 52, own=80),
    "fresh": Reached(65, 55, 74, own=85),
}
"""By what the encoder starts from: ImageNet's weights, the same in another order within each tensor, or fresh ones."""

ROWS = 41
"""The most frequent class of each row: a baseline without an image."""

ADDED = (17, 9, 25)
"""What ImageNet's weights add to fresh ones: mean, and ends of the interval of the paired difference."""

LONGER = (65, 74)
"""Fresh weights on other cameras after 100 steps and after 300, without that normalisation."""

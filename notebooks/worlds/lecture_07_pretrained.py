"""What ImageNet weights brought on a real street: numbers of `docs/results/imagenet_worth.json` for lecture 07.

Pixel accuracy, per cent, on cameras of PandaSet's scene 002 that weren't learned from. `lecture_07_imagenet` made them.
"""

from typing import NamedTuple


class Reached(NamedTuple):
    """What a network reaches after 24 labelled frames, by what its encoder starts from.

    Parameters
    ----------
    imagenet, shuffled, fresh : float
        ImageNet's weights, the same in another order within each tensor, and fresh ones.
    """

    imagenet: float
    shuffled: float
    fresh: float


AS_IT_IS = Reached(0, 0, 0)
"""Where the decoder adds the encoder's maps as they are; means of two seeds."""

NORMALISED = Reached(0, 0, 0)
"""Where each map is normalised before it is added; one seed."""

LONGER = 0
"""Fresh weights as they are, three times the steps."""

ROWS = 0
"""The most frequent class of each row: a baseline without an image."""

ADDED = (0, 0, 0)
"""What ImageNet's weights add to fresh ones where maps are normalised: mean, and ends of the interval over cameras."""

OWN, OTHERS = {2: 0, 8: 0, 24: 0}, {2: 0, 8: 0, 24: 0}
"""By number of labelled frames: on these very frames, and on other cameras; fresh weights, maps as they are."""

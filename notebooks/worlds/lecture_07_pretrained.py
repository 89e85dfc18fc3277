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


AS_IT_IS = Reached(imagenet=46, shuffled=48, fresh=65)
"""Where the decoder adds the encoder's maps as they are; means of two seeds."""

NORMALISED = Reached(imagenet=82, shuffled=45, fresh=65)
"""Where each map is normalised before it is added; one seed."""

LONGER = 74
"""Fresh weights as they are, three times the steps."""

ROWS = 41
"""The most frequent class of each row: a baseline without an image."""

ADDED = (17, 9, 25)
"""What ImageNet's weights add to fresh ones where maps are normalised: mean, and ends of the interval over cameras."""

OWN, OTHERS = {2: 92, 8: 87, 24: 86}, {2: 57, 8: 64, 24: 65}
"""By number of labelled frames: on these very frames, and on other cameras; fresh weights, maps as they are."""

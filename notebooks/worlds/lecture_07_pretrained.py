"""What ImageNet weights brought on a real street: the numbers of `lecture_07_imagenet`, which ship with lecture 07.

Pixel accuracy, per cent, means of two seeds and six cameras; `docs/results/imagenet_worth.json` has all of them.
"""

FRAMES = (2, 8, 24)
"""Numbers of labelled frames."""

UNSEEN = {"ImageNet": (50.0, 60.0, 70.0), "fresh": (30.0, 40.0, 50.0)}
"""On cameras that were left out, by what the encoder starts from."""

OWN = {"ImageNet": (95.0, 93.0, 91.0), "fresh": (80.0, 70.0, 60.0)}
"""On the frames that the network has learned from."""

CONTROLS = {"ImageNet, shuffled": 40.0, "fresh, three times the steps": 55.0}
"""On cameras that were left out, after 24 frames."""

ROWS = 44.0
"""The most frequent class of each row, on cameras that were left out."""

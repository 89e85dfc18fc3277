"""Label sets: the numbers, names and colours of classes (paper, sections 3.1 and 4)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.errors import ArgumentError

IGNORE = 255
"""The class number of unlabelled pixels and cells, which loss and metrics leave out."""


@dataclass(frozen=True)
class LabelSet:
    """The classes of a data set, in the order of their numbers.

    Parameters
    ----------
    name : str
        The name of the set.
    names : tuple of str
        The name of each class; class c is `names[c]`.
    rgb : tuple of (int, int, int)
        The colour of each class: red, green and blue, 0..255.
    n_semantic : int
        Number of semantic classes. They come first; the others are kinds of unknown.
    flat : tuple of str
        Names of the ground classes. `most_voted` prefers any other class to these.

    Examples
    --------
    >>> KITTI_14.index("car"), len(KITTI_14), KITTI_14.n_semantic
    (3, 14, 10)
    """

    name: str
    names: tuple[str, ...]
    rgb: tuple[tuple[int, int, int], ...]
    n_semantic: int
    flat: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of classes, C."""
        return len(self.names)

    def index(self, name: str) -> int:
        """Return the number of a class.

        Parameters
        ----------
        name : str
            The name of a class of this set.
        """
        if name not in self.names:
            raise ArgumentError("name", f"a class of {self.name}: {', '.join(self.names)}", repr(name))
        return self.names.index(name)

    def colours(self, labels: NDArray) -> NDArray[np.uint8]:
        """Paint a map of classes in RGB, (..., 3).

        Parameters
        ----------
        labels : (...) int
            Class numbers; 255 (unlabelled) is painted white.
        """
        palette = np.full((256, 3), 255, dtype=np.uint8)
        palette[: len(self)] = self.rgb
        return palette[np.asarray(labels)]

    def most_voted(self, votes: NDArray, otherwise: ArrayLike) -> NDArray[np.uint8]:
        """Return the class of each cell from the votes of the classes seen in it.

        An object outvotes the ground below it: one vote for a thin pole beats many for the road. Otherwise the most
        frequent class wins; of equally frequent classes, the first.

        Parameters
        ----------
        votes : (C, ...) int
            How often each class was seen in each cell.
        otherwise : (...) int, or int
            The class of cells without a vote.

        Examples
        --------
        >>> votes = np.zeros((14, 3), int)
        >>> votes[KITTI_14.index("road")] = 5, 5, 0
        >>> votes[KITTI_14.index("car")] = 0, 1, 0
        >>> KITTI_14.most_voted(votes, otherwise=IGNORE)
        array([  0,   3, 255], dtype=uint8)
        """
        object_votes = votes.copy()
        object_votes[[self.index(name) for name in self.flat]] = 0
        best = np.where(object_votes.any(axis=0), object_votes.argmax(axis=0), votes.argmax(axis=0))
        return np.where(votes.any(axis=0), best, otherwise).astype(np.uint8)


# The palette of Cityscapes (Cordts et al., 2016), with the smallest changes that let a deuteranope tell all classes
# apart.
_KITTI_COLOURS = {
    "road": (126, 59, 122),
    "sidewalk": (255, 64, 252),
    "vegetation": (141, 176, 58),
    "car": (0, 0, 142),
    "pedestrian": (204, 0, 50),
    "bicycle": (114, 4, 28),
    "building": (110, 125, 130),
    "signage": (223, 223, 0),
    "fence": (190, 153, 153),
    "sky": (66, 130, 182),
    "unknown-free": (225, 229, 232),
    "unknown-static": (131, 104, 76),
    "unknown-dynamic": (244, 198, 156),
    "unknown-unobserved": (12, 16, 24),
}

KITTI_14 = LabelSet(
    "KITTI-14",
    names=tuple(_KITTI_COLOURS),
    rgb=tuple(_KITTI_COLOURS.values()),
    n_semantic=10,
    flat=("road", "sidewalk", "vegetation"),
)
"""Our reading of the paper's C = 14: ten semantic classes, then the four kinds of unknown by occupancy state."""

UNKNOWN_OF_STATE = (10, 11, 12, 13)
"""KITTI-14's unknown class of each occupancy state, in the order FREE, STATIC, DYNAMIC, UNKNOWN."""

_SYNTHIA_COLOURS = {
    "void": (12, 16, 24),
    "building": (110, 125, 130),
    "road": (126, 59, 122),
    "sidewalk": (255, 64, 252),
    "fence": (190, 153, 153),
    "vegetation": (141, 176, 58),
    "pole": (90, 200, 210),
    "car": (0, 0, 142),
    "sign": (223, 223, 0),
    "lane": (255, 240, 190),
}

SYNTHIA_10 = LabelSet(
    "SYNTHIA-10",
    names=tuple(_SYNTHIA_COLOURS),
    rgb=tuple(_SYNTHIA_COLOURS.values()),
    n_semantic=10,
    flat=("void", "road", "sidewalk", "vegetation", "lane"),  # anything outvotes void and the ground
)
"""The ten classes of the paper's Table 3, in its order."""

LABEL_SETS = {labels.name: labels for labels in (KITTI_14, SYNTHIA_10)}
"""Label sets by the name that data sets on disk use."""

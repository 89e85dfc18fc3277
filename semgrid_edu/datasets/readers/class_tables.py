"""Tables that translate the classes of other data sets into those of a label set of this package (section 4)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.labels import IGNORE, KITTI_14, LabelSet


@dataclass(frozen=True)
class ClassTable:
    """Which class of a label set each number in another data set's files becomes.

    Parameters
    ----------
    label_set : LabelSet
        The classes to translate to.
    names : dict of int to (str or None)
        The class of each number that the files may hold; None for what stays unlabelled.

    Examples
    --------
    >>> from semgrid_edu.labels import KITTI_14
    >>> ClassTable(KITTI_14, {0: None, 7: "road"}).classes(Path("a.png"), np.array([7, 0]))
    array([  0, 255], dtype=uint8)
    """

    label_set: LabelSet
    names: dict[int, str | None]

    def classes(self, path: Path, numbers: NDArray) -> NDArray[np.uint8]:
        """Translate the numbers of a file.

        Parameters
        ----------
        path : Path
            Where the numbers come from, for the error.
        numbers : (...) int
            What the file holds.

        Returns
        -------
        (...) uint8
            Classes of the label set; 255 where unlabelled.
        """
        known = np.array(sorted(self.names))
        places = np.searchsorted(known, numbers).clip(max=len(known) - 1)
        strange = numbers[known[places] != numbers]
        if strange.size:
            raise DataError(path, f"labels among {', '.join(map(str, known))}", f"{strange.flat[0]}")
        names = [self.names[number] for number in known]
        classes = np.array([IGNORE if name is None else self.label_set.index(name) for name in names], dtype=np.uint8)
        return classes[places]


PANDASET_CLASSES = ClassTable(
    KITTI_14,
    {
        **dict.fromkeys((7, 8, 9, 10), "road"),  # road, lane lines, stop lines, other markings
        **dict.fromkeys((11,), "sidewalk"),
        **dict.fromkeys((5,), "vegetation"),
        **dict.fromkeys((13, 14, 15, 16, 17), "car"),  # car, pickup, two sizes of trucks, towed object
        **dict.fromkeys((19, 20, 22, 23), "car"),  # construction, uncommon and emergency vehicles, bus
        **dict.fromkeys((27, 28, 29), "car"),  # train, trolley, tram
        **dict.fromkeys((30, 31), "pedestrian"),  # also with an object
        **dict.fromkeys((18, 25, 26), "bicycle"),  # motorcycle, scooter, bicycle
        **dict.fromkeys((41,), "building"),
        **dict.fromkeys((36, 38), "signage"),  # signs, also of construction sites
        **dict.fromkeys((35, 39), "fence"),  # road barriers, also of construction sites
        **dict.fromkeys((1, 2, 3, 4), None),  # smoke, exhaust, spray, reflection: nothing is there
        **dict.fromkeys((6, 12), None),  # other ground and driveways: neither road nor sidewalk
        **dict.fromkeys((21, 24, 32, 33), None),  # pedicab, mobility device, animals
        **dict.fromkeys((34, 37, 40, 42), None),  # pylon, cone, rolling container, other static object
    },
)
"""KITTI-14's class of each number in PandaSet's annotations/semseg, which are those of its classes.json.

What could be several classes stays unlabelled: an "other static object" is a pole, a wall or a hydrant."""

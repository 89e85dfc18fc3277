"""Tables that translate the classes of other data sets into those of a label set of this package (section 4).

SemanticKITTI's labels of returns, and which class of KITTI-14 each becomes (section 4; Behley et al., ICCV 2019).

The numbers are those of the data set's own configuration (semantic-kitti.yaml of its programming interface).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.labels import IGNORE, KITTI_14, LabelSet
from semgrid_edu.storage.reading import read_bytes


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

        Raises
        ------
        DataError
            When the file holds a number that the table doesn't have.
        """
        known = np.array(sorted(self.names))
        places = np.searchsorted(known, numbers).clip(max=len(known) - 1)
        strange = numbers[known[places] != numbers]
        if strange.size:
            raise DataError(path, f"labels among {', '.join(map(str, known))}", f"{strange.flat[0]}")
        names = [self.names[number] for number in known]
        classes = np.array([IGNORE if name is None else self.label_set.index(name) for name in names], dtype=np.uint8)
        return classes[places]


SEMANTIC_KITTI_CLASSES = ClassTable(
    KITTI_14,
    {
        0: None,  # unlabelled
        1: None,  # outlier
        10: "car",
        11: "bicycle",
        13: "car",  # bus
        15: "bicycle",  # motorcycle
        16: "car",  # on rails
        18: "car",  # truck
        20: "car",  # other vehicle
        30: "pedestrian",
        31: "bicycle",  # bicyclist
        32: "bicycle",  # motorcyclist
        40: "road",
        44: "road",  # parking
        48: "sidewalk",
        49: None,  # other ground
        50: "building",
        51: "fence",
        52: None,  # other structure
        60: "road",  # lane marking
        70: "vegetation",
        71: "vegetation",  # trunk
        72: "vegetation",  # terrain
        80: "signage",  # pole
        81: "signage",  # traffic sign
        99: None,  # other object
        252: "car",
        253: "bicycle",  # bicyclist
        254: "pedestrian",
        255: "bicycle",  # motorcyclist
        256: "car",  # on rails
        257: "car",  # bus
        258: "car",  # truck
        259: "car",  # other vehicle
    },
)
"""KITTI-14's class of each number in the labels.

As in the rest of the package, poles are signage, whoever rides a bicycle belongs to it, and grass is vegetation.
KITTI-14 has no classes for larger vehicles and for motorcycles, so they become cars and bicycles."""

FIRST_MOVING = 252
"""From this number on, a class is of things that move."""


def read_point_labels(path: Path, n_points: int) -> NDArray[np.int64]:
    """Read the number of each return's class.

    The file holds a little-endian uint32 for each return: the class in the lower 16 bits, the instance in the upper
    ones.

    Parameters
    ----------
    path : Path
        The file, such as labels/000000.label.
    n_points : int
        N, the number of returns of the scan.

    Returns
    -------
    (N,) int64
        Numbers of SemanticKITTI, which `SEMANTIC_KITTI_CLASSES` translates.

    Raises
    ------
    DataError
        When the file is missing, or doesn't have a label for each return.
    """
    content = read_bytes(path)
    if len(content) != 4 * n_points:
        raise DataError(path, f"4 bytes for each of the scan's {n_points} returns", f"{len(content)} bytes")
    return (np.frombuffer(content, dtype="<u4") & 0xFFFF).astype(np.int64)

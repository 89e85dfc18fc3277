"""Tables that translate the classes of other data sets into a label set of this package (section 4)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.labels import IGNORE, LabelSet


@dataclass(frozen=True)
class ClassTable:
    """A table from the class numbers in another data set's files to the classes of a label set.

    Parameters
    ----------
    label_set : LabelSet
        The classes to translate to.
    names : dict of int to (str or None)
        The class of each number that may occur in the files; None for unlabelled.

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
            The numbers in the file.

        Returns
        -------
        (...) uint8
            Classes of the label set; 255 where unlabelled.
        """
        known = np.array(sorted(self.names))
        places = np.searchsorted(known, numbers).clip(max=len(known) - 1)
        unknown = numbers[known[places] != numbers]
        if unknown.size:
            raise DataError(path, f"labels among {', '.join(map(str, known))}", f"{unknown.flat[0]}")
        names = [self.names[number] for number in known]
        classes = np.array([IGNORE if name is None else self.label_set.index(name) for name in names], dtype=np.uint8)
        return classes[places]

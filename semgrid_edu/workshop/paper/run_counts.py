"""The counts that reports read from runs, kept beside the results so that every number can be recomputed (section 4).

A report reads its runs only through `RunCounts`: from the folders of the runs when they have just ended, or later from
the one file that was kept. So a number is computed in one way, with the runs or without them.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import parse_json
from semgrid_edu.storage.tensors import read_arrays, write_arrays
from semgrid_edu.workshop.paper.run import Run, checked_record
from semgrid_edu.workshop.scoring.confusions import DRIVES, FrameConfusions, checked_confusions

RECORDS = "records.json"
"""The name under which the file holds the records of all runs, as JSON. Each other array has the name RUN/WHAT."""


class RunCounts:
    """What is known about runs that have ended. Whatever is read from their folders is remembered, to be kept.

    Parameters
    ----------
    source : path-like
        The folder of all runs, or a file that `RunCounts.keep` wrote.

    Attributes
    ----------
    arrays : dict of str to array
        What has been read, or what the file holds, by RUN/WHAT.
    records : dict of str to dict
        The same for what `Run.record` returns, by run.

    Raises
    ------
    DataError
        When the file is missing or damaged, or holds something else.
    """

    def __init__(self, source: str | Path) -> None:
        self.source = Path(source)
        self.arrays = {}
        self.records = {}
        if not self.source.is_dir():
            self.arrays = read_arrays(self.source)
            if RECORDS not in self.arrays:
                raise DataError(self.source, "counts that `semgrid-edu reproduce` has kept", list(self.arrays)[:5])
            self.records = parse_json(self.source, str(self.arrays.pop(RECORDS)))

    def of(self, run: Run, names: tuple[str, ...], read: Callable[[Path], Mapping[str, NDArray]]) -> dict[str, NDArray]:
        """Return arrays of a run by name.

        Parameters
        ----------
        run : Run
            The run.
        names : tuple of str
            What is wanted.
        read : callable
            Folder of all runs -> these arrays.

        Raises
        ------
        DataError
            When the run hasn't ended, its files are damaged, or nothing was kept of this.
        """
        keys = {name: f"{run.name}/{name}" for name in names}
        if self.source.is_dir() and not self.arrays.keys() >= set(keys.values()):
            self.arrays |= {keys[name]: array for name, array in read(self.source).items()}
        if lacking := [key for key in keys.values() if key not in self.arrays]:
            raise DataError(self.source, f"the array {lacking[0]!r}", f"{len(self.arrays)} others")
        return {name: self.arrays[key] for name, key in keys.items()}

    def confusions(self, run: Run, method: str, name: str, read: Callable[[Path], FrameConfusions]) -> FrameConfusions:
        """Return what a run counted of a method, one matrix per drive.

        Parameters
        ----------
        run : Run
            The run.
        method : str
            The method.
        name : str
            What was counted of it: method, truth and distance.
        read : callable
            Folder of all runs -> the method's confusion matrices, frame by frame.
        """

        def by_drive(root: Path) -> dict[str, NDArray]:
            found = read(root)
            return {DRIVES: np.array(list(dict.fromkeys(found.drives))), name: found.by_drive(method)}

        found = checked_confusions(self.source, self.of(run, (DRIVES, name), by_drive))
        return FrameConfusions(found.drives, {method: found.counts[name]})

    def knows(self, run: Run) -> bool:
        """Return whether a run was among those whose counts were kept; all runs of a folder are expected to end.

        Parameters
        ----------
        run : Run
            The run.
        """
        return self.source.is_dir() or run.name in self.records

    def record(self, run: Run) -> dict:
        """Return what a run recorded when it ended, as `Run.record` does.

        Parameters
        ----------
        run : Run
            The run.

        Raises
        ------
        DataError
            When the run hasn't ended, or its record is missing or damaged.
        """
        if self.source.is_dir():
            self.records[run.name] = run.record(self.source)
        if run.name not in self.records:
            expected = f"the record of a run, {run.name} (`semgrid-edu reproduce` makes it)"
            raise DataError(self.source, expected, f"those of {len(self.records)} others")
        return checked_record(self.source, self.records[run.name])

    def keep(self, path: str | Path) -> None:
        """Write all that has been read to one file, atomically: whole numbers in as few bytes as they need.

        Parameters
        ----------
        path : path-like
            The .npz file to write.
        """
        arrays = {RECORDS: np.array(json.dumps(self.records))}
        write_arrays(path, arrays | {key: _smallest(self.arrays[key]) for key in sorted(self.arrays)})


def _smallest(array: NDArray) -> NDArray:
    """Return whole numbers in the smallest type that holds them; other arrays as they are."""
    if array.dtype.kind not in "iu" or not array.size:
        return array
    low = int(array.min())
    high = int(array.max())
    return array.astype(np.min_scalar_type(high if low >= 0 else min(low, -high - 1)))

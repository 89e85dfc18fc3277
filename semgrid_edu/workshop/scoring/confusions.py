"""Confusion matrices per frame, the basis of all scores and intervals (section 4.2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.tensors import read_arrays, write_arrays

DRIVES = "drives"
"""Key of the drives in a file of confusion matrices; reserved, so no method may use it."""

BANDS = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, np.inf)
"""Limits of the bands of distance from the LIDAR in which cells are counted, metres."""


@dataclass(frozen=True, eq=False)
class FrameConfusions:
    """Confusion matrices per frame: how often cells of each true class are predicted as each class.

    Parameters
    ----------
    drives : tuple of str
        The drive of each of the F frames, such as "2026_01_01 0143".
    counts : dict of str to (F, C, C) int64
        Numbers of labelled cells per frame, one row per true class, one column per predicted class. The keys are
        methods; from `count_grids`, keys of `confusion_key`.
    """

    drives: tuple[str, ...]
    counts: dict[str, NDArray[np.int64]]

    def of(self, method: str, truth: str, band: str | None = None) -> "FrameConfusions":
        """Return the counts of one method against one truth, under the method's name.

        Parameters
        ----------
        method : str
            Such as "network".
        truth : str
            The labels to compare with, "true" or "lidar".
        band : str, optional
            One of `distance_band_names`; by default all distances.
        """
        keys = [confusion_key(method, truth, one) for one in ([band] if band else distance_band_names())]
        return FrameConfusions(self.drives, {method: sum(self.counts[key] for key in keys)})

    def by_drive(self, method: str) -> NDArray[np.int64]:
        """Return one matrix per drive, (V, C, C), in the order of the drives' first frames.

        Parameters
        ----------
        method : str
            A key of `counts`.
        """
        return drive_confusions(self.counts[method], self.drives)

    def total(self, method: str) -> NDArray[np.int64]:
        """Return the sum over all frames, (C, C). Parameters are those of `FrameConfusions.by_drive`."""
        return self.counts[method].sum(axis=0)


def band_names(edges: Sequence[float]) -> list[str]:
    """Name bands of distance.

    Parameters
    ----------
    edges : sequence of B + 1 float
        The limits of the bands, metres; the last one may be infinite.

    Examples
    --------
    >>> band_names([0, 10, 20, np.inf])
    ['0-10 m', '10-20 m', 'beyond 20 m']
    """
    return [f"{low:g}-{high:g} m" if np.isfinite(high) else f"beyond {low:g} m" for low, high in pairwise(edges)]


def distance_band_names() -> list[str]:
    """Return the names of `BANDS`, nearest first, such as "0-10 m"."""
    return band_names(BANDS)


def confusion_key(method: str, truth: str, band: str) -> str:
    """Return the key for a method's counts against one truth in one band of distance.

    Parameters
    ----------
    method, truth, band : str
        As for `FrameConfusions.of`.
    """
    return f"{method}, {truth} labels, {band}"


def drive_confusions(counts: NDArray, drives: Sequence[str]) -> NDArray[np.int64]:
    """Sum confusion matrices over the frames of each drive: (V, C, C), in the order of the drives' first frames.

    Parameters
    ----------
    counts : (F, C, C) int
        One matrix per frame.
    drives : sequence of F str
        The drive of each frame.

    Examples
    --------
    >>> counts = np.array([[[1, 0], [0, 1]], [[0, 2], [0, 0]], [[5, 0], [0, 0]]])
    >>> drive_confusions(counts, ["a", "b", "a"]).tolist()
    [[[6, 0], [0, 1]], [[0, 2], [0, 0]]]
    """
    if len(counts) != len(drives):
        raise ArgumentError("drives", f"one for each of the {len(counts)} frames", len(drives))
    number = {drive: v for v, drive in enumerate(dict.fromkeys(drives))}
    summed = np.zeros((len(number), *np.shape(counts)[1:]), np.int64)
    np.add.at(summed, [number[drive] for drive in drives], counts)
    return summed


def seed_confusions(runs: Sequence[FrameConfusions], method: str) -> NDArray[np.int64]:
    """Stack the matrices per drive of several seeds, (S, V, C, C), for `drive_interval`.

    Parameters
    ----------
    runs : sequence of S FrameConfusions
        One per seed, on the same frames.
    method : str
        A method that all runs contain.
    """
    if len({run.drives for run in runs}) != 1:
        raise ArgumentError("runs", "one or more runs on the same frames", f"{len(runs)} runs, not all on the same")
    return np.stack([run.by_drive(method) for run in runs])


def save_confusions(path: str | Path, confusions: FrameConfusions) -> None:
    """Write the matrices of all frames to one compressed file. The write is atomic.

    Parameters
    ----------
    path : path-like
        The .npz file to write; its folder is created if it is missing.
    confusions : FrameConfusions
        The matrices; no method may be called "drives".
    """
    if DRIVES in confusions.counts:
        raise ArgumentError("confusions", f"methods with another name than {DRIVES!r}", list(confusions.counts))
    write_arrays(path, {DRIVES: np.array(confusions.drives), **confusions.counts})


def load_confusions(path: str | Path) -> FrameConfusions:
    """Read the matrices that `save_confusions` wrote.

    Parameters
    ----------
    path : path-like
        The file.

    Raises
    ------
    DataError
        When the file is missing or damaged, or contains something else.
    """
    return checked_confusions(path, read_arrays(path))


def checked_confusions(path: str | Path, arrays: Mapping[str, NDArray]) -> FrameConfusions:
    """Check the arrays of a file and return them as confusion matrices.

    Parameters
    ----------
    path : path-like
        The file, for the error message.
    arrays : mapping of str to array
        The drives, under the key "drives", and the matrices.

    Raises
    ------
    DataError
        When the arrays are something else.
    """
    drives = arrays.get(DRIVES, np.empty(0))
    counts = {name: matrices for name, matrices in arrays.items() if name != DRIVES}
    shapes = {name: matrices.shape for name, matrices in counts.items()}
    if not len(drives) or any(shape != (len(drives), *shape[-1:] * 2) for shape in shapes.values()):
        raise DataError(path, "confusion matrices (F, C, C) of the frames of F drives", f"{len(drives)} and {shapes}")
    for name, matrices in counts.items():
        if matrices.dtype.kind not in "iu" or (matrices < 0).any():
            raise DataError(path, f"numbers of cells as {name!r}", f"{matrices.dtype}, from {matrices.min()}")
    wide = {name: np.ascontiguousarray(matrices, np.int64) for name, matrices in counts.items()}
    return FrameConfusions(tuple(drives.tolist()), wide)

"""Confusion matrices per frame, the basis of all scores and intervals, and how they are counted (section 4.2)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.grid import GridSpec
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.storage.tensors import read_arrays, write_arrays
from semgrid_edu.workshop.scoring.calibration import reliability, reliability_sums

DRIVES = "drives"
"""Key of the drives in a file of confusion matrices; reserved, so no method may use it."""

BANDS = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, np.inf)
"""Limits of the bands of distance from the LIDAR in which cells are counted, metres."""

Grids = Callable[[int], Mapping[str, NDArray]]
"""A function k -> the grids of frame k by method name. A grid is (H, W) int with classes, or (C, H, W) float with
a distribution over the classes; for a distribution, calibration is counted too.

One function makes the grids of all methods that share work, such as a network with and without the CRF."""


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
        raise DataError(
            path, "confusion matrices (F, C, C) of F frames, and the drive of each", f"{len(drives)} and {shapes}"
        )
    for name, matrices in counts.items():
        if matrices.dtype.kind not in "iu" or (matrices < 0).any():
            raise DataError(path, f"numbers of cells as {name!r}", f"{matrices.dtype}, from {matrices.min()}")
    wide = {name: np.ascontiguousarray(matrices, np.int64) for name, matrices in counts.items()}
    return FrameConfusions(tuple(drives.tolist()), wide)


def distance_bands(spec: GridSpec, edges: Sequence[float]) -> NDArray[np.int64]:
    """Return the index of each cell's band of distance, (H, W).

    This is the horizontal distance from the LIDAR to the cell's centre. Cells closer than the first limit belong to the
    first band, cells beyond the last limit to the last band.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    edges : sequence of B + 1 float
        The limits of the bands, metres, from near to far.
    """
    return np.digitize(spec.distances(), edges[1:-1])


class GridCounts(NamedTuple):
    """The counts from `count_grids`.

    Parameters
    ----------
    methods : tuple of str
        The names of the methods.
    confusions : FrameConfusions
        By method, truth and band of distance.
    reliability : dict of str to (3, B) float
        For each method with a distribution, per bin of confidence: the number of cells, the sum of their confidences,
        and the number of correct cells. The keys come from `reliability_key`.
    """

    methods: tuple[str, ...]
    confusions: FrameConfusions
    reliability: dict[str, NDArray[np.float64]]


def reliability_key(method: str, truth: str) -> str:
    """Return the key of `GridCounts.reliability` for a method and a truth.

    Parameters
    ----------
    method : str
        Such as "network".
    truth : str
        "true" or "lidar".
    """
    return method if truth == "true" else f"{method}, {truth} labels"


def count_grids(grids: Grids, frames: TrainingSet) -> GridCounts:
    """Compare the grids of one or several methods with the truth, per frame.

    Parameters
    ----------
    grids : callable
        Makes the grids of a frame, such as `network_grids(net, frames)` or `lambda k: {"majority class": majority}`.
    frames : TrainingSet
        The frames, with their drives. If its "truth" differs from its "true" labels, it comes from the LIDAR.

    Raises
    ------
    ArgumentError
        When the shape of a grid differs from the truth, or it contains a class that the frames don't have.
    """
    truths = truths_of_frames(frames)
    band = distance_bands(frames.spec, BANDS)
    counts: dict[str, list[NDArray]] = {}
    confidence: dict[str, NDArray] = {}
    methods: dict[str, None] = {}
    for k in tqdm(range(len(frames)), desc="score", unit="frame"):
        for method, grid in grids(k).items():
            methods.setdefault(method)
            if np.ndim(grid) == 3:
                for truth, classes in truths.items():
                    key = reliability_key(method, truth)
                    confidence[key] = confidence.get(key, 0) + reliability_sums(reliability(grid, classes[k]))
                grid = grid.argmax(axis=0)
            for truth, classes in truths.items():
                for name, matrix in _by_band(classes[k], grid, band, len(frames.label_set)).items():
                    counts.setdefault(confusion_key(method, truth, name), []).append(matrix)
    stacked = {key: np.stack(matrices) for key, matrices in counts.items()}
    return GridCounts(tuple(methods), FrameConfusions(frames.drives, stacked), confidence)


def truths_of_frames(frames: TrainingSet) -> dict[str, NDArray]:
    """Return the labels to compare with by name, (N, H, W): first the training labels, then "true".

    Parameters
    ----------
    frames : TrainingSet
        The frames. Labels made with the LIDAR are called "lidar".
    """
    truth = frames.arrays["truth"]
    true = frames.arrays["true"]
    return {"true": true} if truth is true else {"lidar": truth, "true": true}


def _by_band(truth: NDArray, called: NDArray, band: NDArray, n_classes: int) -> dict[str, NDArray[np.int64]]:
    """Return the confusion matrix of each band of distance."""
    if np.shape(called) != truth.shape:
        raise ArgumentError("grids", f"the shape of the truth, {truth.shape}", np.shape(called))
    cells = {name: band == number for number, name in enumerate(distance_band_names())}
    return {name: confusion_matrix(truth[there], called[there], n_classes) for name, there in cells.items()}

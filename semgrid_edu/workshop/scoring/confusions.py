"""Confusion matrices frame by frame: what all scores, intervals and comparisons are computed from (section 4.2)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.storage.tensors import read_arrays, write_arrays
from semgrid_edu.workshop.scoring.learned_grids import Grids, network_grids

DRIVES = "drives"
"""The name that the drives have in a file of confusion matrices, so that no method can have it."""


@dataclass(frozen=True, eq=False)
class FrameConfusions:
    """How often each true class is called each class, frame by frame, by one or several methods.

    Parameters
    ----------
    drives : tuple of str
        The drive of each of the F frames, such as "2026_01_01 0143".
    counts : dict of str to (F, C, C) int64
        By method the number of labelled cells of each frame: one row per true class, one column per called class.
    """

    drives: tuple[str, ...]
    counts: dict[str, NDArray[np.int64]]

    def by_drive(self, method: str) -> NDArray[np.int64]:
        """Return one matrix per drive.

        Parameters
        ----------
        method : str
            A key of `counts`.

        Returns
        -------
        (V, C, C) int64
            The sum over the frames of each drive, in the order of the drives' first frames.
        """
        return drive_confusions(self.counts[method], self.drives)

    def total(self, method: str) -> NDArray[np.int64]:
        """Return one matrix for all frames.

        Parameters
        ----------
        method : str
            A key of `counts`.

        Returns
        -------
        (C, C) int64
        """
        return self.counts[method].sum(axis=0)


def frame_confusions(grids: SemanticGridNet | Grids, frames: TrainingSet) -> FrameConfusions:
    """Compare the grids of one or several methods with the truth, frame by frame.

    Parameters
    ----------
    grids : SemanticGridNet or callable
        What makes the grids: a network in evaluation mode, or a function as `Grids` describes it, such as
        `network_grids(net, refine)` or `lambda frames, k: {"majority class": majority}`.
    frames : TrainingSet
        The frames, with truth.

    Returns
    -------
    FrameConfusions
        The methods have the names that `grids` gives them; a network alone is called "network".

    Raises
    ------
    ArgumentError
        When a grid has another shape than the truth, or a class that the frames don't have.
    """
    if isinstance(grids, SemanticGridNet):
        grids = network_grids(grids)
    n_classes, counts = len(frames.label_set), {}
    for k in tqdm(range(len(frames)), desc="evaluate", unit="frame"):
        for method, grid in grids(frames, k).items():
            counts.setdefault(method, []).append(confusion_matrix(frames.arrays["truth"][k], grid, n_classes))
    return FrameConfusions(frames.drives, {method: np.stack(matrices) for method, matrices in counts.items()})


def drive_confusions(counts: NDArray, drives: Sequence[str]) -> NDArray[np.int64]:
    """Sum confusion matrices over the frames of each drive.

    Parameters
    ----------
    counts : (F, C, C) int
        One matrix per frame.
    drives : sequence of F str
        The drive of each frame.

    Returns
    -------
    (V, C, C) int64
        One matrix per drive, in the order of the drives' first frames.

    Raises
    ------
    ArgumentError
        When there aren't as many drives as frames.

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
    """Stack the drives' matrices of the same method, trained with several seeds.

    Parameters
    ----------
    runs : sequence of S FrameConfusions
        One per seed, on the same frames.
    method : str
        A method that all of them have.

    Returns
    -------
    (S, V, C, C) int64
        What `drive_interval` and `paired_interval` take.

    Raises
    ------
    ArgumentError
        When there is no run, or two of them have other frames.
    """
    if len({run.drives for run in runs}) != 1:
        raise ArgumentError("runs", "one or more runs on the same frames", f"{len(runs)} runs, not all on the same")
    return np.stack([run.by_drive(method) for run in runs])


def save_confusions(path: str | Path, confusions: FrameConfusions) -> None:
    """Write the matrices of all frames to one compressed file, atomically.

    Parameters
    ----------
    path : path-like
        The .npz file to write; its folder is made when missing.
    confusions : FrameConfusions
        What to write.

    Raises
    ------
    ArgumentError
        When a method is called "drives".
    """
    if DRIVES in confusions.counts:
        raise ArgumentError("confusions", f"methods with another name than {DRIVES!r}", list(confusions.counts))
    write_arrays(path, {DRIVES: np.array(confusions.drives), **confusions.counts})


def load_confusions(path: str | Path) -> FrameConfusions:
    """Read the matrices of all frames.

    Parameters
    ----------
    path : path-like
        A file that `save_confusions` wrote.

    Returns
    -------
    FrameConfusions

    Raises
    ------
    DataError
        When the file is missing or damaged, or holds something else.
    """
    counts = read_arrays(path)
    drives = counts.pop(DRIVES, np.empty(0))
    shapes = {name: matrices.shape for name, matrices in counts.items()}
    if not len(drives) or any(shape != (len(drives), *shape[-1:] * 2) for shape in shapes.values()):
        raise DataError(path, "confusion matrices (F, C, C) of the frames of F drives", f"{len(drives)} and {shapes}")
    return FrameConfusions(tuple(drives.tolist()), counts)

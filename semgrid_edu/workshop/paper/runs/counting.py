"""Grids counted against the truth, frame by frame, by distance, and by how sure they are (section 4.2)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.crf import reliability
from semgrid_edu.crf.temperature import Reliability
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.workshop.scoring.confusions import FrameConfusions, load_confusions, save_confusions, seed_confusions
from semgrid_edu.workshop.scoring.distances import band_names, distance_bands
from semgrid_edu.workshop.scheduler.runs import Run
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.storage.tensors import read_arrays, write_arrays

CONFUSIONS, RELIABILITY = "confusions.npz", "reliability.npz"
"""The files of a run that counts: confusion matrices by frame, and how often a method is right when it is how sure."""

BANDS = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, np.inf)
"""Limits of the bands of distance from the LIDAR by which cells are counted, metres."""


def distance_band_names() -> list[str]:
    """Return the names of the bands of distance, nearest first, such as "0-10 m"."""
    return band_names(BANDS)


class CountingRun(Run):
    """A run that counts grids against the truth, by `GridCounts`."""

    def confusions(self, root: str | Path, method: str, truth: str, band: str | None = None) -> FrameConfusions:
        """Return the confusion matrices of one method.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        method : str
            Such as `NETWORK`.
        truth : str
            Against which labels: "true" or "lidar".
        band : str, optional
            One of `distance_band_names`; all distances when left out.

        Returns
        -------
        FrameConfusions
            With one method, called `method`.

        Raises
        ------
        DataError
            When the run hasn't ended, or its file is damaged.
        """
        found = load_confusions(self.folder(root) / CONFUSIONS)
        bands = [band] if band else distance_band_names()
        return FrameConfusions(found.drives, {method: sum(found.counts[_key(method, truth, one)] for one in bands)})

    def reliability(self, root: str | Path, method: str) -> Reliability:
        """Return how often a method is right when it is how sure, over all frames, by the true labels.

        Parameters
        ----------
        root : path-like
            The folder of all runs.
        method : str
            Such as `NETWORK`.

        Returns
        -------
        Reliability
            One entry per bin of confidence.

        Raises
        ------
        DataError
            When the run hasn't ended, or its file is damaged.
        """
        cells, confidence, right = read_arrays(self.folder(root) / RELIABILITY)[method]
        some = np.maximum(cells, 1)
        return Reliability(confidence / some, right / some, cells.astype(np.int64))


def by_seed(
    runs: Sequence[CountingRun], root: str | Path, method: str, truth: str, band: str | None = None
) -> NDArray[np.int64]:
    """Return the confusion matrices of a method, seed by seed and drive by drive.

    Parameters
    ----------
    runs : sequence of S CountingRun
        The same network, trained with S seeds.
    root : path-like
        The folder of all runs.
    method, truth, band
        What to count, as `CountingRun.confusions` takes them.

    Returns
    -------
    (S, V, C, C) int64

    Raises
    ------
    ArgumentError
        When there is no run, or two of them were scored on other frames.
    DataError
        When a run hasn't ended, or its file is damaged.
    """
    return seed_confusions([run.confusions(root, method, truth, band) for run in runs], method)


class GridCounts:
    """What is counted over the frames: confusion matrices by method, truth and band of distance, and reliability.

    Parameters
    ----------
    frames : TrainingSet
        The frames, with the truth that their methods learned from and the true one.
    """

    def __init__(self, frames: TrainingSet) -> None:
        self.frames = frames
        truth, true = frames.arrays["truth"], frames.arrays["true"]
        self.truths = {"true": true} if truth is true else {"lidar": truth, "true": true}
        self.band = distance_bands(frames.spec, BANDS)
        self.matrices: dict[str, list[NDArray]] = {}
        self.sure: dict[str, NDArray] = {}

    def add(self, method: str, k: int, called: NDArray) -> None:
        """Count a grid.

        Parameters
        ----------
        method : str
            What made it.
        k : int
            Number of the frame.
        called : (H, W) int
            The class that it gives to each cell.
        """
        for truth, grids in self.truths.items():
            for number, name in enumerate(distance_band_names()):
                there = self.band == number
                matrix = confusion_matrix(grids[k][there], called[there], len(self.frames.label_set))
                self.matrices.setdefault(_key(method, truth, name), []).append(matrix)

    def add_probability(self, method: str, k: int, probability: NDArray) -> None:
        """Count the most probable classes of a grid, and how sure it is of them.

        Parameters
        ----------
        method : str
            What made it.
        k : int
            Number of the frame.
        probability : (C, H, W) float
            Its distribution over the classes in each cell.
        """
        self.add(method, k, probability.argmax(axis=0))
        diagram = reliability(probability, self.truths["true"][k])
        sums = np.stack([diagram.cells, diagram.confidence * diagram.cells, diagram.accuracy * diagram.cells])
        self.sure[method] = self.sure.get(method, 0) + sums

    def write(self, folder: Path) -> None:
        """Write all that was counted.

        Parameters
        ----------
        folder : Path
            The folder of the run, from which `CountingRun` reads.
        """
        write_arrays(folder / RELIABILITY, self.sure)
        matrices = {key: np.stack(found) for key, found in self.matrices.items()}
        save_confusions(folder / CONFUSIONS, FrameConfusions(self.frames.drives, matrices))


def _key(method: str, truth: str, band: str) -> str:
    """Return the name that a method has in the file of confusion matrices."""
    return f"{method}, {truth} labels, {band}"

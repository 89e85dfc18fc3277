"""Grids counted against the truth: frame by frame, by distance from the LIDAR, and by confidence (section 4.2)."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from semgrid_edu.crf.temperature import Reliability, reliability
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.metrics import confusion_matrix
from semgrid_edu.workshop.scoring.confusions import BANDS, FrameConfusions, confusion_key, distance_band_names

Grids = Callable[[int], Mapping[str, NDArray]]
"""A function k -> the grids of frame k by the name of the method that made them: classes (H, W) int, or a distribution
(C, H, W) float over the classes, whose calibration is counted as well.

Methods that share work, such as a network with and without the CRF, are made by one function."""


def distance_bands(spec: GridSpec, edges: Sequence[float]) -> NDArray[np.int64]:
    """Return the number of each cell's band of distance, (H, W).

    The distance is the horizontal one from the LIDAR to the cell's centre. Cells nearer than the first limit belong to
    the first band, cells beyond the last limit to the last band.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    edges : sequence of B + 1 float
        The limits of the bands, metres, from near to far.
    """
    return np.digitize(spec.distances(), edges[1:-1])


class GridCounts(NamedTuple):
    """What `count_grids` counted.

    Parameters
    ----------
    methods : tuple of str
        The names of the methods.
    confusions : FrameConfusions
        By method, truth and band of distance.
    reliability : dict of str to (3, B) float
        For each method that gave a distribution, by bin of confidence: the number of cells, the sum of their
        confidence, and how many are right. The keys are those of `reliability_key`.
    """

    methods: tuple[str, ...]
    confusions: FrameConfusions
    reliability: dict[str, NDArray[np.float64]]


def reliability_key(method: str, truth: str) -> str:
    """Return the key of `GridCounts.reliability` for a method and some labels.

    Parameters
    ----------
    method : str
        Such as "network".
    truth : str
        "true" or "lidar".
    """
    return method if truth == "true" else f"{method}, {truth} labels"


def reliability_sums(probability: NDArray, truth: NDArray) -> NDArray[np.float64]:
    """Return for each bin of confidence its cells, the sum of their confidence, and how many are right: (3, B).

    Parameters
    ----------
    probability, truth : array
        As `reliability` takes them.
    """
    diagram = reliability(probability, truth)
    return np.stack([diagram.cells, diagram.confidence * diagram.cells, diagram.accuracy * diagram.cells])


def reliability_of_sums(sums: NDArray) -> Reliability:
    """Return how often a method is right by its confidence.

    Parameters
    ----------
    sums : (3, B) float
        From `GridCounts.reliability`, or the sum of several.
    """
    cells, confidence, right = sums
    divisor = np.maximum(cells, 1)  # an empty bin has weight 0
    return Reliability(confidence / divisor, right / divisor, cells.astype(np.int64))


def count_grids(grids: Grids, frames: TrainingSet) -> GridCounts:
    """Compare the grids of one or several methods with the truth, frame by frame.

    Parameters
    ----------
    grids : callable
        Makes the grids of a frame, such as `network_grids(net, frames)` or `lambda k: {"majority class": majority}`.
    frames : TrainingSet
        The frames, with their drives. Their "truth" is made with the LIDAR if it differs from the "true" one.

    Raises
    ------
    ArgumentError
        When a grid has another shape than the truth, or a class that the frames don't have.
    """
    truths, band = truths_of_frames(frames), distance_bands(frames.spec, BANDS)
    counts: dict[str, list[NDArray]] = {}
    confidence: dict[str, NDArray] = {}
    methods: dict[str, None] = {}
    for k in tqdm(range(len(frames)), desc="score", unit="frame"):
        for method, grid in grids(k).items():
            methods.setdefault(method)
            if np.ndim(grid) == 3:
                for truth, classes in truths.items():
                    key = reliability_key(method, truth)
                    confidence[key] = confidence.get(key, 0) + reliability_sums(grid, classes[k])
                grid = grid.argmax(axis=0)
            for truth, classes in truths.items():
                for name, matrix in _by_band(classes[k], grid, band, len(frames.label_set)).items():
                    counts.setdefault(confusion_key(method, truth, name), []).append(matrix)
    stacked = {key: np.stack(matrices) for key, matrices in counts.items()}
    return GridCounts(tuple(methods), FrameConfusions(frames.drives, stacked), confidence)


def truths_of_frames(frames: TrainingSet) -> dict[str, NDArray]:
    """Return the labels to compare with by name, (N, H, W): first those that networks learn from, then "true".

    Parameters
    ----------
    frames : TrainingSet
        The frames. Labels that are made with the LIDAR are called "lidar".
    """
    truth, true = frames.arrays["truth"], frames.arrays["true"]
    return {"true": true} if truth is true else {"lidar": truth, "true": true}


def _by_band(truth: NDArray, called: NDArray, band: NDArray, n_classes: int) -> dict[str, NDArray[np.int64]]:
    """Return the confusion matrix of each band of distance."""
    if np.shape(called) != truth.shape:
        raise ArgumentError("grids", f"the shape of the truth, {truth.shape}", np.shape(called))
    cells = {name: band == number for number, name in enumerate(distance_band_names())}
    return {name: confusion_matrix(truth[there], called[there], n_classes) for name, there in cells.items()}

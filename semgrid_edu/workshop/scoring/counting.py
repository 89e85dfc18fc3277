"""Compare grids with the truth: per frame, per distance from the LIDAR, and per confidence (section 4.2)."""

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
"""A function k -> the grids of frame k by method name. A grid is (H, W) int with classes, or (C, H, W) float with
a distribution over the classes; for a distribution, calibration is counted too.

One function makes the grids of all methods that share work, such as a network with and without the CRF."""


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


def reliability_sums(probability: NDArray, truth: NDArray) -> NDArray[np.float64]:
    """Return the number of cells, the sum of their confidences and the number of correct cells per bin, (3, B).

    Parameters
    ----------
    probability, truth : array
        As for `reliability`.
    """
    diagram = reliability(probability, truth)
    return np.stack([diagram.cells, diagram.confidence * diagram.cells, diagram.accuracy * diagram.cells])


def reliability_of_sums(sums: NDArray) -> Reliability:
    """Return a method's accuracy as a function of its confidence.

    Parameters
    ----------
    sums : (3, B) float
        From `GridCounts.reliability`, or the sum of several.
    """
    cells, confidence, right = sums
    divisor = np.maximum(cells, 1)  # an empty bin has weight 0
    return Reliability(confidence / divisor, right / divisor, cells.astype(np.int64))


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
    """Return the labels to compare with by name, (N, H, W): first the training labels, then "true".

    Parameters
    ----------
    frames : TrainingSet
        The frames. Labels made with the LIDAR are called "lidar".
    """
    truth, true = frames.arrays["truth"], frames.arrays["true"]
    return {"true": true} if truth is true else {"lidar": truth, "true": true}


def _by_band(truth: NDArray, called: NDArray, band: NDArray, n_classes: int) -> dict[str, NDArray[np.int64]]:
    """Return the confusion matrix of each band of distance."""
    if np.shape(called) != truth.shape:
        raise ArgumentError("grids", f"the shape of the truth, {truth.shape}", np.shape(called))
    cells = {name: band == number for number, name in enumerate(distance_band_names())}
    return {name: confusion_matrix(truth[there], called[there], n_classes) for name, there in cells.items()}

"""Two ways to a semantic grid that learn next to nothing, for the network to beat (section 4; claim of section 3.3)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from semgrid_edu.datasets.truth import unknown_classes
from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE
from semgrid_edu.occupancy import State

CLOSING_REACH = 1.5
"""Metres. Of 0.5 to 3 m it gives the best pixel accuracy on minikitti's training split, with true image labels."""


def majority_class(truths: NDArray) -> NDArray[np.uint8]:
    """Return the most frequent class of each cell: what one knows without looking.

    Parameters
    ----------
    truths : (N, H, W) uint8
        Grids of a training set, KITTI-14; 255 where unlabelled.

    Returns
    -------
    (H, W) uint8
        Of equally frequent classes the first; the most frequent of all cells where a cell was never labelled.
    """
    counts = np.stack([(truths == c).sum(axis=0) for c in range(len(KITTI_14))])
    overall = counts.sum(axis=(1, 2)).argmax()
    return np.where(counts.any(axis=0), counts.argmax(axis=0), overall).astype(np.uint8)


def carry_labels(labels: NDArray, pixels: NDArray, cells: NDArray, occupancy: NDArray) -> NDArray[np.uint8]:
    """Carry image labels to the grid with the LIDAR's depth: pure geometry, as the paper makes its ground truth.

    Each return that the camera sees takes the class of its pixel to its cell. There the returns vote as the fine
    cells of the truth do (`LabelSet.most_voted`); a cell that no labelled return reaches is unknown by occupancy
    state. Sky sends no return, so such a label is an error at an object's outline and is dropped.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel, KITTI-14: a network's arg-max, or the truth for an upper bound; 255 where unlabelled.
    pixels, cells : (N,) int
        Pixel and cell of each return, from `semgrid_edu.datasets.returns.seen_returns`.
    occupancy : (4, H, W) float
        Probability of free, static, dynamic and unknown.

    Returns
    -------
    (H, W) uint8

    Raises
    ------
    ArgumentError
        When a pixel or a cell lies outside.
    """
    labels, unknown = np.asarray(labels), unknown_classes(occupancy)
    for name, places, size in (("pixels", pixels, labels.size), ("cells", cells, unknown.size)):
        if len(places) and not (min(places) >= 0 and max(places) < size):
            raise ArgumentError(name, f"numbers from 0 to {size - 1}", f"{min(places)} to {max(places)}")
    classes = labels.ravel()[pixels]
    kept = (classes != IGNORE) & (classes != KITTI_14.index("sky"))
    n = len(KITTI_14)
    votes = np.bincount(cells[kept] * n + classes[kept], minlength=unknown.size * n).reshape(*unknown.shape, n)
    return KITTI_14.most_voted(np.moveaxis(votes, -1, 0), otherwise=unknown)


def close_gaps(grid: NDArray, cell: float, reach: float = CLOSING_REACH) -> NDArray[np.uint8]:
    """Label the gaps between the LIDAR's rings: the morphological clean-up that the paper gives such a grid.

    Parameters
    ----------
    grid : (H, W) uint8
        From `carry_labels`.
    cell : float
        Side of a cell, metres.
    reach : float
        How far a label spreads, metres.

    Returns
    -------
    (H, W) uint8
        Each cell that was observed, but that no label reached, takes the class of the nearest cell that has one.
    """
    unlabelled = grid >= KITTI_14.n_semantic
    if unlabelled.all():
        return grid
    distance, nearest = distance_transform_edt(unlabelled, sampling=cell, return_indices=True)
    observed = grid != UNKNOWN_OF_STATE[State.UNKNOWN]
    return np.where(observed & (distance <= reach), grid[tuple(nearest)], grid)

"""Image labels on the grid: carried there by the LIDAR's depth, with the gaps between its rings closed (section 4)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, distance_transform_edt

from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE, LabelSet
from semgrid_edu.occupancy import State

CLOSING_REACH = 1.5
"""Metres: the best of 0.5 to 3 m by pixel accuracy on minikitti's training split, with true image labels."""

GROUND_REACH = 3.0
"""Metres: beyond 30 m the LIDAR's rings are at least this far apart on the ground."""

OBJECT_REACH = 1.0
"""Metres: half the width of the widest gap in walls and hedges that is closed. By mean intersection over union on six
training frames of minikitti, 1 m was better than 0.5 m, and a `GROUND_REACH` of 3 m better than 2 m."""


def carry_labels(
    labels: NDArray, pixels: NDArray, cells: NDArray, occupancy: NDArray, label_set: LabelSet = KITTI_14
) -> NDArray[np.uint8]:
    """Carry image labels to the grid with the LIDAR's depth: pure geometry, as the paper makes its ground truth.

    Each return that the camera sees carries the class of its pixel to its cell. There the returns vote by the rule of
    the true grids (`LabelSet.most_voted`). A cell without a labelled return gets the unknown class of its occupancy
    state. Sky gives no return, so a sky label is an error at an object's outline and is dropped.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel: a network's arg-max, or the truth for an upper bound; 255 where unlabelled.
    pixels, cells : (N,) int
        Pixel and cell of each return, from `semgrid_edu.datasets.project_lidar.seen_returns`.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    label_set : LabelSet
        The classes, with an unknown one for each occupancy state.

    Returns
    -------
    (H, W) uint8
    """
    labels = np.asarray(labels)
    unknown = np.array(unknown_numbers(label_set), np.uint8)[np.argmax(occupancy, axis=-3)]
    for name, places, size in (("pixels", pixels, labels.size), ("cells", cells, unknown.size)):
        if len(places) and not (min(places) >= 0 and max(places) < size):
            raise ArgumentError(name, f"numbers from 0 to {size - 1}", f"{min(places)} to {max(places)}")
    classes = labels.ravel()[pixels]
    kept = classes != IGNORE
    if "sky" in label_set.names:
        kept &= classes != label_set.index("sky")
    n = len(label_set)
    votes = np.bincount(cells[kept] * n + classes[kept], minlength=unknown.size * n).reshape(*unknown.shape, n)
    return label_set.most_voted(np.moveaxis(votes, -1, 0), otherwise=unknown)


def close_gaps(
    grid: NDArray, cell: float, reach: float = CLOSING_REACH, label_set: LabelSet = KITTI_14
) -> NDArray[np.uint8]:
    """Label the gaps between the LIDAR's rings: the paper's morphological clean-up.

    Parameters
    ----------
    grid : (H, W) uint8
        From `carry_labels`.
    cell : float
        Side of a cell, metres.
    reach : float
        How far a label spreads, metres.
    label_set : LabelSet
        The classes, with an unknown one for each occupancy state.

    Returns
    -------
    (H, W) uint8
        Each cell that was observed, but has no label, gets the class of the nearest labelled cell.
    """
    unobserved = unknown_numbers(label_set)[State.UNKNOWN]
    unlabelled = grid >= label_set.n_semantic
    if unlabelled.all():
        return grid
    distance, nearest = distance_transform_edt(unlabelled, sampling=cell, return_indices=True)
    return np.where((grid != unobserved) & (distance <= reach), grid[tuple(nearest)], grid)


def close_and_spread(grid: NDArray, cell: float, label_set: LabelSet = KITTI_14) -> NDArray[np.uint8]:
    """Label the gaps between the LIDAR's rings, without making objects grow.

    The ground continues between the rings, so its labels spread by up to `GROUND_REACH`. If objects spread, they would
    cover the ground around them. They are closed instead (dilated, then eroded, class by class), which fills gaps up to
    twice `OBJECT_REACH` wide and doesn't move outlines.

    Parameters
    ----------
    grid : (H, W) uint8
        From `carry_labels`.
    cell : float
        Side of a cell, metres.
    label_set : LabelSet
        The classes, with an unknown one for each occupancy state.

    Returns
    -------
    (H, W) uint8
        Cells that were observed, but had no label, may have one now; the others are unchanged.
    """
    flat = np.array([label_set.index(name) for name in label_set.flat])
    only_ground = np.where((grid < label_set.n_semantic) & ~np.isin(grid, flat), unknown_numbers(label_set)[0], grid)
    spread = close_gaps(only_ground, cell, GROUND_REACH, label_set)
    margin = round(OBJECT_REACH / cell)
    square = np.ones((2 * margin + 1,) * 2, bool)
    fillable = (grid >= label_set.n_semantic) & (grid != unknown_numbers(label_set)[State.UNKNOWN])
    closed = np.where(fillable, spread, grid)
    for c in set(range(label_set.n_semantic)) - set(flat.tolist()):
        thing = np.pad(grid == c, margin)
        closed[fillable & binary_closing(thing, square)[margin:-margin, margin:-margin]] = c
    return closed


def unknown_numbers(label_set: LabelSet) -> tuple[int, ...]:
    """Return the unknown class of each occupancy state.

    Parameters
    ----------
    label_set : LabelSet
        The classes.

    Returns
    -------
    tuple of 4 int
        Class numbers in the order FREE, STATIC, DYNAMIC, UNKNOWN.

    Examples
    --------
    >>> unknown_numbers(KITTI_14)
    (10, 11, 12, 13)
    """
    names = [KITTI_14.names[c] for c in UNKNOWN_OF_STATE]
    if not set(names) <= set(label_set.names):
        raise ArgumentError("label_set", f"a label set with the classes {', '.join(names)}", label_set.name)
    return tuple(label_set.index(name) for name in names)

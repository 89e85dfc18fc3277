"""Labelled points seen from above: the class of each cell in which points with classes lie (section 4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, LabelSet

CLEARANCE = 2.5
"""Metres above the lowest point of a cell from which on a point hangs over what stands there: the top of a vehicle,
up to which `SensorModel` counts returns as obstacles too."""


def birdseye_votes(
    points_grid: NDArray, classes: NDArray[np.uint8], spec: GridSpec, label_set: LabelSet
) -> NDArray[np.uint8]:
    """Let labelled points vote on the class of the cells that they lie in.

    Branches and signs that hang over a road don't make it vegetation or signage: points more than `CLEARANCE` above the
    lowest labelled point in their cell have no vote. Among the others `LabelSet.most_voted` decides: what stands in a
    cell outvotes the ground below it.

    Parameters
    ----------
    points_grid : (N, 3+) float
        Points in the grid frame, metres.
    classes : (N,) uint8
        The class of each point; 255 (unlabelled) has no vote.
    spec : GridSpec
        The grid, (H, W) cells.
    label_set : LabelSet
        The classes that the numbers stand for.

    Returns
    -------
    (H, W) uint8
        255 in a cell without a labelled point.
    """
    rows, cols, inside = spec.cells(points_grid)
    kept = inside & (classes != IGNORE)
    cells, z, classes = (rows * spec.shape[1] + cols)[kept], points_grid[kept, 2], classes[kept]
    lowest = np.full(spec.shape[0] * spec.shape[1], np.inf, dtype=z.dtype)
    np.minimum.at(lowest, cells, z)
    below = z <= lowest[cells] + CLEARANCE
    votes = np.zeros((len(label_set), lowest.size), dtype=np.int64)
    np.add.at(votes, (classes[below], cells[below]), 1)
    return label_set.most_voted(votes.reshape(len(label_set), *spec.shape), otherwise=IGNORE)

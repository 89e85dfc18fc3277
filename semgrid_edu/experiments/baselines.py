"""What one knows without looking, for the network to beat (section 4); pure geometry is in `datasets.ground_truth`."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import KITTI_14


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

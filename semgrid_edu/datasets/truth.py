"""The truth to learn from: what stands in the cells that the camera sees, and which cells are unknown (section 4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE


def grid_truth(labels: FrameLabels, belief_probability: NDArray, spec: GridSpec) -> NDArray[np.uint8]:
    """Return the class that each cell should take.

    A cell that the camera sees takes the class of what stands there. The others have no label, so, as in the paper,
    they are unknown-free, unknown-static, unknown-dynamic or unknown-unobserved: their most probable occupancy state
    decides.

    Parameters
    ----------
    labels : FrameLabels
        What is true of the frame, in classes of KITTI-14.
    belief_probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.

    Returns
    -------
    (H, W) uint8
        A class of KITTI-14 in every cell.

    Raises
    ------
    ArgumentError
        When the label set has no unknown classes, or shapes disagree.
    """
    if labels.label_set is not KITTI_14:
        raise ArgumentError("labels", f"the label set {KITTI_14.name}", labels.label_set.name)
    unknown = unknown_classes(belief_probability)
    truth = labels.birdseye_on(spec)
    if unknown.shape != truth.shape:
        raise ArgumentError("belief_probability", f"shape {(4, *truth.shape)}", f"{np.shape(belief_probability)}")
    return np.where(labels.visible_on(spec) & (truth != IGNORE), truth, unknown)


def unknown_classes(belief_probability: NDArray) -> NDArray[np.uint8]:
    """Return KITTI-14's unknown class of the most probable state.

    Parameters
    ----------
    belief_probability : (..., 4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.

    Returns
    -------
    (..., H, W) uint8
        Classes of KITTI-14.
    """
    states = np.argmax(belief_probability, axis=-3)
    return np.array(UNKNOWN_OF_STATE, dtype=np.uint8)[states]

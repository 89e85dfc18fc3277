"""The truth to learn from: what stands in the cells that the camera sees, unknown elsewhere (section 4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE


def grid_truth(labels: FrameLabels, belief_probability: NDArray, spec: GridSpec) -> NDArray[np.uint8]:
    """Return the class that each cell should take.

    A cell that the camera sees takes the class of what stands there. Nobody labelled the others, so, as in the
    paper, they are unknown-free, -static, -dynamic or -unobserved, by their most probable occupancy state.

    Parameters
    ----------
    labels : FrameLabels
        With KITTI-14's classes.
    belief_probability : (4, H, W) float
        Probability of free, static, dynamic and unknown in each cell.
    spec : GridSpec
        The grid; a coarsening of the labels' own.

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
        Probability of free, static, dynamic and unknown.

    Returns
    -------
    (..., H, W) uint8
    """
    states = np.argmax(belief_probability, axis=-3)
    return np.array(UNKNOWN_OF_STATE, dtype=np.uint8)[states]

"""The truth to learn from: what stands in the cells that the camera sees, and which cells are unknown (section 4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, SYNTHIA_10, UNKNOWN_OF_STATE, LabelSet


def grid_truth(labels: FrameLabels, belief_probability: NDArray, spec: GridSpec) -> NDArray[np.uint8]:
    """Return the class that each cell should take.

    A cell that the camera sees takes the class of what stands there. The others have no label. With KITTI-14 they are,
    as in the paper, unknown-free, unknown-static, unknown-dynamic or unknown-unobserved: their most probable occupancy
    state decides. SYNTHIA-10 has no such classes; there they are void, as in the paper's Table 3, where void is the
    most frequent class by far.

    Parameters
    ----------
    labels : FrameLabels
        What is true of the frame, in classes of KITTI-14 or of SYNTHIA-10.
    belief_probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.

    Returns
    -------
    (H, W) uint8
        A class of the label set in every cell.

    Raises
    ------
    ArgumentError
        When it isn't known what cells without a label are in the label set, or shapes disagree.
    """
    unknown = _without_label(labels.label_set, belief_probability)
    truth = labels.birdseye_on(spec)
    if unknown.shape != truth.shape:
        raise ArgumentError("belief_probability", f"shape {(4, *truth.shape)}", f"{np.shape(belief_probability)}")
    return np.where(labels.visible_on(spec) & (truth != IGNORE), truth, unknown)


def _without_label(label_set: LabelSet, belief_probability: NDArray) -> NDArray[np.uint8]:
    """Return the class (H, W) that each cell takes when it has no label."""
    if label_set is KITTI_14:
        return unknown_classes(belief_probability)
    if label_set is SYNTHIA_10:
        return np.full(np.shape(belief_probability)[-2:], SYNTHIA_10.index("void"), dtype=np.uint8)
    raise ArgumentError("labels", f"the label set {KITTI_14.name} or {SYNTHIA_10.name}", label_set.name)


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

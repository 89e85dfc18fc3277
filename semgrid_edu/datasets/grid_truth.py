"""The truth for training: the class of cells that the camera sees, and unknown classes elsewhere (section 4)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from semgrid_edu.datasets.frames import FrameSequence, visible_labels
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, SYNTHIA_10, UNKNOWN_OF_STATE, LabelSet

GAP = 1.0
"""How far around a cell a square without any label must reach for the cell to count as unknown, metres."""


def grid_truth(labels: FrameLabels, belief_probability: NDArray, spec: GridSpec) -> NDArray[np.uint8]:
    """Return the true class of each cell, for training.

    A cell that the camera sees has the class of its label; `fill_unlabelled` decides about the others.

    Parameters
    ----------
    labels : FrameLabels
        The labels of the frame, in classes of KITTI-14 or of SYNTHIA-10.
    belief_probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.
    spec : GridSpec
        The grid: the extent of `LABEL_GRID`, a multiple of its cell.

    Returns
    -------
    (H, W) uint8
        A class of the label set in every cell, or 255, see `decided_truth`.
    """
    in_view = labels.undecided_on(spec)
    return decided_truth(visible_labels(labels, spec), in_view, belief_probability, labels.label_set)


def decided_truth(
    truth: NDArray[np.uint8], in_view: NDArray[np.bool_], belief_probability: NDArray, label_set: LabelSet
) -> NDArray[np.uint8]:
    """Give unlabelled cells an unknown class, except where the camera may see something unlabelled.

    Parameters not named here are those of `fill_unlabelled`.

    Parameters
    ----------
    in_view : (H, W) bool
        The cells in view of the camera when the labels have gaps; no cell when everything that it sees is labelled.

    Returns
    -------
    (H, W) uint8
        Where labels have gaps: 255 in unlabelled cells in view, and an unknown class in every cell out of view.
    """
    if not in_view.any():
        return fill_unlabelled(truth, belief_probability, label_set)
    unseen = fill_unlabelled(np.full_like(truth, IGNORE), belief_probability, label_set)
    return np.where(in_view, truth, unseen)


def truth_to_learn(drive: FrameSequence, k: int, belief_probability: NDArray, spec: GridSpec) -> NDArray[np.uint8]:
    """Return the class of each cell of a drive's frame; 255 where the camera may see something unlabelled.

    Parameters
    ----------
    drive : FrameSequence
        The drive, whose label set is KITTI-14 or SYNTHIA-10.
    k : int
        Number of a labelled frame.
    belief_probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.
    spec : GridSpec
        The grid, (H, W) cells.

    Returns
    -------
    (H, W) uint8
    """
    return decided_truth(drive.truth(k, spec), drive.undecided(k, spec), belief_probability, drive.label_set)


def fill_unlabelled(truth: NDArray[np.uint8], belief_probability: NDArray, label_set: LabelSet) -> NDArray[np.uint8]:
    """Give unlabelled cells a class.

    With KITTI-14 they become unknown-free, unknown-static, unknown-dynamic or unknown-unobserved, by their most
    probable occupancy state, as in the paper. SYNTHIA-10 has no such classes; there they become void, as in the paper's
    Table 3, where void is the most frequent class by far.

    Parameters
    ----------
    truth : (H, W) uint8
        The class of each cell; 255 where unlabelled.
    belief_probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.
    label_set : LabelSet
        KITTI-14 or SYNTHIA-10.

    Returns
    -------
    (H, W) uint8
    """
    if np.shape(belief_probability) != (4, *truth.shape):
        raise ArgumentError("belief_probability", f"shape {(4, *truth.shape)}", f"{np.shape(belief_probability)}")
    if label_set == KITTI_14:
        unknown = unknown_classes(belief_probability)
    elif label_set == SYNTHIA_10:
        unknown = np.uint8(SYNTHIA_10.index("void"))
    else:
        raise ArgumentError("labels", f"the label set {KITTI_14.name} or {SYNTHIA_10.name}", label_set.name)
    return np.where(truth == IGNORE, unknown, truth)


def fill_gaps_with_unknown(truth: NDArray[np.uint8], belief_probability: NDArray, spec: GridSpec) -> NDArray[np.uint8]:
    """Give an unknown class to cells in whose surroundings, a square that reaches `GAP` metres, there is no label.

    The paper calls every unlabelled cell unknown (section 4). Labels of real streets come from LIDAR returns. Behind a
    wall there are none, and a network that is never corrected there calls these cells anything. Close to labels a
    return was only missed by chance, so here these cells stay open.

    Parameters
    ----------
    truth : (..., H, W) uint8
        Classes of KITTI-14; 255 where unlabelled.
    belief_probability : (..., 4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.
    spec : GridSpec
        The grid.

    Returns
    -------
    (..., H, W) uint8
        255 only in unlabelled cells close to labels.

    Examples
    --------
    Beside one cell of road, the cells up to a metre away stay open; those farther away become unknown:

    >>> belief = np.eye(4)[[0, 0, 3, 3, 3]].T.reshape(4, 1, 5)
    >>> fill_gaps_with_unknown(np.array([[0, 255, 255, 255, 255]], np.uint8), belief, GridSpec.compact())
    array([[  0, 255, 255,  13,  13]], dtype=uint8)
    """
    side = 2 * round(GAP / spec.cell) + 1
    size = (1,) * (truth.ndim - 2) + (side, side)
    near = maximum_filter(truth < KITTI_14.n_semantic, size=size)
    return np.where((truth == IGNORE) & ~near, unknown_classes(belief_probability), truth)


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
    return np.array(UNKNOWN_OF_STATE, dtype=np.uint8)[np.argmax(belief_probability, axis=-3)]

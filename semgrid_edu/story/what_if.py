"""What a frame's cells would be called if one input were true, or gone: the network run again with it (section 3.4)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.frame import FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.pipeline import FrameResult, Stages
from semgrid_edu.story.cell_evidence import pixel_truth

NO_IMAGE, NO_OCCUPANCY = "no image", "no occupancy"
TRUE_IMAGE, TRUE_OCCUPANCY, TRUE_BOTH = "true image", "true occupancy", "both true"
CHANGES = (NO_IMAGE, NO_OCCUPANCY, TRUE_IMAGE, TRUE_OCCUPANCY, TRUE_BOTH)
"""The changes of `what_if`; the true ones need labels."""


def what_if(result: FrameResult, net: SemanticGridNet) -> dict[str, NDArray[np.int64]]:
    """Run the network again with its inputs changed, and return what it then calls each cell, before the CRF.

    Parameters
    ----------
    result : FrameResult
        The frame's result.
    net : SemanticGridNet
        The network that made it, in evaluation mode.

    Returns
    -------
    dict of str to (H, W) int64
        "no image", all scores are zero; "no occupancy", no scan was ever taken; and where the frame has labels "true
        image" (`right_scores`), "true occupancy" (`right_occupancy`) and "both true". Nothing else changes.
    """
    own, s, o, labels = Stages.of(net), result.scores, result.belief.probability, result.frame.labels
    nothing_known = np.broadcast_to(np.reshape(NOTHING_KNOWN, (-1, 1, 1)), o.shape).astype(np.float32)
    changed = {NO_IMAGE: (np.zeros_like(s), o), NO_OCCUPANCY: (s, nothing_known)}
    if labels is not None:
        right = right_scores(s, pixel_truth(labels, s.shape[1:])), right_occupancy(o, labels, own.architecture.grid)
        changed |= {TRUE_IMAGE: (right[0], o), TRUE_OCCUPANCY: (s, right[1]), TRUE_BOTH: right}
    return {name: own.fuse(own.sample(scores), states).argmax(axis=0) for name, (scores, states) in changed.items()}


def right_scores(scores: NDArray, truth: NDArray) -> NDArray[np.float32]:
    """Exchange each pixel's highest score with that of its true class: as sure as before, and right.

    Parameters
    ----------
    scores : (C, h, w) float
        s, the image network's scores.
    truth : (h, w) int
        The true class of each pixel. A pixel whose class isn't among the C keeps its scores.

    Returns
    -------
    (C, h, w) float32

    Examples
    --------
    >>> right_scores(np.array([[[5.0]], [[2.0]], [[3.0]]]), np.array([[2]])).ravel()
    array([3., 2., 5.], dtype=float32)
    """
    best = scores.argmax(axis=0)[None]
    true = np.where(truth < len(scores), truth, best).astype(np.int64)
    right = np.array(scores, np.float32)
    np.put_along_axis(right, best, np.take_along_axis(scores, true, axis=0), axis=0)
    np.put_along_axis(right, true, scores.max(axis=0, keepdims=True), axis=0)
    return right


def right_occupancy(o: NDArray, labels: FrameLabels, spec: GridSpec) -> NDArray[np.float32]:
    """Make the cells whose class is known FREE if it is flat; elsewhere what was FREE or UNKNOWN becomes STATIC.

    Parameters
    ----------
    o : (4, H, W) float
        The probabilities of the four states.
    labels : FrameLabels
        What is true of the frame.
    spec : GridSpec
        The grid, (H, W).

    Returns
    -------
    (4, H, W) float32
        They sum to 1 in each cell. Cells without a semantic class stay as they are.
    """
    truth, label_set = grid_truth(labels, o, spec), labels.label_set
    flat = np.isin(truth, [label_set.index(name) for name in label_set.flat])
    standing = (truth < label_set.n_semantic) & ~flat
    right = np.array(o, np.float32)
    right[State.STATIC] += np.where(standing, right[State.FREE] + right[State.UNKNOWN], 0)
    right[State.FREE] = np.where(flat, 1, np.where(standing, 0, right[State.FREE]))
    for state in (State.STATIC, State.DYNAMIC, State.UNKNOWN):
        right[state][flat] = 0
    right[State.UNKNOWN][standing] = 0
    return right

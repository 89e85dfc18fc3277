"""Which stage is to blame for a wrong cell: the network run again with an input corrected or removed (section 3.4)."""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.frame import FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE
from semgrid_edu.networks import SemanticGridNet
from semgrid_edu.occupancy import State
from semgrid_edu.occupancy.steps import NOTHING_KNOWN
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.planes import cell_heights
from semgrid_edu.workshop.demo.contributions import fusion_inputs
from semgrid_edu.workshop.demo.evidence import pixel_truth

NO_IMAGE, NO_OCCUPANCY = "no image", "no occupancy"
TRUE_IMAGE, TRUE_OCCUPANCY, TRUE_BOTH = "true image", "true occupancy", "both true"
CHANGES = (NO_IMAGE, NO_OCCUPANCY, TRUE_IMAGE, TRUE_OCCUPANCY, TRUE_BOTH)
"""The changes of `what_if`; the true ones need labels."""

FAULTS = ("none", "mended", "crf", "image", "occupancy", "either", "both", "fusion")
"""The stages that can be to blame, see `faults`."""


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
        "no image": all scores are zero. "no occupancy": no scan was ever taken, so there are no heights either. And
        where the frame has labels, "true image" (`right_scores`), "true occupancy" (`right_occupancy`) and "both true".
        Nothing else changes.
    """
    s = result.scores
    o = result.belief.probability
    labels = result.frame.labels
    spec = net.need_architecture().grid
    z = cell_heights(result.frame.points_grid, spec)
    changed = {
        NO_IMAGE: (np.zeros_like(s), o, z),
        NO_OCCUPANCY: (s, np.broadcast_to(NOTHING_KNOWN[:, None, None], o.shape), np.full_like(z, np.nan)),
    }
    if labels is not None:
        true_s = right_scores(s, pixel_truth(labels, s.shape[1:]))
        true_o = right_occupancy(o, labels, spec)
        changed |= {TRUE_IMAGE: (true_s, o, z), TRUE_OCCUPANCY: (s, true_o, z), TRUE_BOTH: (true_s, true_o, z)}
    with torch.no_grad():
        logits = {name: net.fusion(*fusion_inputs(net, *inputs))[0] for name, inputs in changed.items()}
    return {name: values.argmax(dim=0).numpy() for name, values in logits.items()}


def right_scores(scores: NDArray, truth: NDArray) -> NDArray[np.float32]:
    """Swap each pixel's highest score with that of its true class: as certain as before, and right.

    Parameters
    ----------
    scores : (C, h, w) float
        s, the image network's scores.
    truth : (h, w) int
        The true class of each pixel. A pixel whose class isn't among the C keeps its scores.

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
    """Make flat cells FREE; in other labelled cells, what was FREE or UNKNOWN becomes STATIC.

    Parameters
    ----------
    o : (4, H, W) float
        The probabilities of the four states.
    labels : FrameLabels
        The labels of the frame. Cells without a semantic class stay as they are.
    spec : GridSpec
        The grid, (H, W).
    """
    truth = grid_truth(labels, o, spec)
    flat = np.isin(truth, [labels.label_set.index(name) for name in labels.label_set.flat])
    standing = (truth < labels.label_set.n_semantic) & ~flat
    right = np.array(o, np.float32)
    right[:, flat] = np.reshape([1, 0, 0, 0], (4, 1))
    right[State.STATIC, standing] += right[State.FREE, standing] + right[State.UNKNOWN, standing]
    right[State.FREE, standing] = 0
    right[State.UNKNOWN, standing] = 0
    return right


def faults(
    label: ArrayLike, refined: ArrayLike, truth: ArrayLike, otherwise: Mapping[str, ArrayLike]
) -> NDArray[np.int64]:
    """Return which stage is to blame for each cell, as an index of `FAULTS`.

    A stage is to blame if the class before the CRF becomes right once the stage's output is corrected. So no stage is
    charged with an error that the next ones would have overcome, and two stages can be to blame.

    Parameters
    ----------
    label, refined : (...) int
        The class of each cell before and after the CRF.
    truth : (...) int
        The true class; 255 where it isn't known.
    otherwise : dict of str to (...) int
        What each cell is called when an input changes, see `what_if`.

    Examples
    --------
    >>> FAULTS[faults(0, 0, 3, {"true image": 3, "true occupancy": 0, "both true": 3})]
    'image'
    """
    label, refined, truth = map(np.asarray, (label, refined, truth))
    if TRUE_BOTH not in otherwise:
        return np.zeros(truth.shape, np.int64)
    image, occupancy, both = (np.equal(otherwise[change], truth) for change in (TRUE_IMAGE, TRUE_OCCUPANCY, TRUE_BOTH))
    cases = {
        "none": (truth == IGNORE) | ((label == truth) & (refined == truth)),
        "mended": refined == truth,
        "crf": label == truth,
        "either": image & occupancy,
        "image": image,
        "occupancy": occupancy,
        "both": both,
    }
    return np.select(list(cases.values()), [FAULTS.index(name) for name in cases], FAULTS.index("fusion"))

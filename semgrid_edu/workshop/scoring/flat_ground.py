"""Flat-ground projection of image labels, and the baselines that a network must beat (section 4.2).

The baselines have two inputs per cell. One is the image label at the pixel that would see the cell's ground if the
ground were flat. Cells outside the image, or with an unlabelled pixel, get a separate value. The other is the cell's
most probable occupancy state. We count how often each class occurs with each pair over all cells of the training
frames. The class then comes from a table of these counts, or from naive Bayes, which treats label and state as
independent given the class.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.grid_truth import unknown_classes
from semgrid_edu.datasets.training_set import Sample, TrainingSet
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE
from semgrid_edu.occupancy import N_STATES, State
from semgrid_edu.planes import plane_pixels

NOT_SEEN = -1
"""The value of `ground_pixels` for a cell with its ground outside the image."""

Labeller = Callable[[Sample], NDArray]
"""A function that labels the pixels of a frame: sample -> classes (h, w), 255 where unlabelled."""


def ground_pixels(spec: GridSpec, camera: Camera) -> NDArray[np.int64]:
    """Return the pixel that sees the ground at the centre of each cell: equation (1) for plane 0, rounded.

    Pixel indices (H, W) are row * w + column; -1 if the ground is outside the image.

    Parameters
    ----------
    spec : GridSpec
        The grid, (H, W) cells.
    camera : Camera
        The camera, scaled to the size of the label image, (h, w) pixels.
    """
    (pixels,), (visible,) = plane_pixels(spec, [0.0], camera)
    places = np.full(spec.shape, NOT_SEEN)
    u, v = np.rint(pixels[visible]).astype(np.int64).T
    places[visible] = v * camera.size[1] + u
    return places


def inverse_perspective(labels: NDArray, places: NDArray, occupancy: NDArray, observed_only: bool = False) -> NDArray:
    """Project image labels to the grid as if the whole image showed flat ground: inverse perspective mapping.

    It uses no depth, so objects above the ground smear away from the camera, over all cells behind them.

    Parameters
    ----------
    labels : (h, w) uint8
        The KITTI-14 class of each pixel: a network's arg-max, or the truth for an upper bound; 255 where unlabelled.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    observed_only : bool
        Whether to leave cells unlabelled that are most probably UNKNOWN, such as the cells behind a car.

    Returns
    -------
    (H, W) uint8
        The class of the cell's pixel. A cell outside the image, or with an unlabelled or sky pixel, gets one of the
        four unknown classes, by occupancy state.

    Raises
    ------
    ArgumentError
        When a pixel is outside the labels, or the shapes of `places` and `occupancy` disagree.
    """
    labels = np.asarray(labels)
    unknown = unknown_classes(occupancy)
    if places.shape != unknown.shape:
        raise ArgumentError("places", f"one for each of {unknown.shape} cells", f"shape {places.shape}")
    if places.max() >= labels.size:
        raise ArgumentError("places", f"pixels below {labels.size}", places.max())
    classes = labels.ravel()[places]
    shown = (places != NOT_SEEN) & (classes != IGNORE) & (classes != KITTI_14.index("sky"))
    if observed_only:
        shown &= unknown != UNKNOWN_OF_STATE[State.UNKNOWN]
    return np.where(shown, classes, unknown).astype(np.uint8)


def ground_labels(labels: NDArray, places: NDArray, n_classes: int) -> NDArray[np.int64]:
    """Return the flat-ground label of each cell, (H, W); a cell without a label gets C, the number of classes.

    Parameters
    ----------
    labels : (h, w) int
        The class of each pixel; 255 where unlabelled.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    n_classes : int
        C, the number of classes.
    """
    classes = np.asarray(labels, np.int64).ravel()[places]
    return np.where((places == NOT_SEEN) | (classes == IGNORE), n_classes, classes)


def count_labels_and_states(frames: TrainingSet, labeller: Labeller, places: NDArray) -> NDArray[np.int64]:
    """Count the cells of all frames by ground label, most probable state and class, (C + 1, 4, C).

    Parameters
    ----------
    frames : TrainingSet
        The frames; their training labels give the classes.
    labeller : callable
        Labels the images.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    """
    n_classes = len(frames.label_set)
    shape = (n_classes + 1, N_STATES, n_classes)
    counts = np.zeros(shape, np.int64)
    for k in range(len(frames)):
        truth = frames.arrays["truth"][k]
        state = np.argmax(frames.arrays["occupancy"][k], axis=0)
        known = truth != IGNORE
        cells = ground_labels(labeller(frames[k]), places, n_classes)[known], state[known], truth[known]
        counts += np.bincount(np.ravel_multi_index(cells, shape), minlength=counts.size).reshape(shape)
    return counts


def joint_table(counts: NDArray) -> NDArray[np.int64]:
    """Return the most frequent class for each ground label and each state, (C + 1, 4).

    There is no smoothing. If a label and a state never occurred together, the state alone decides.

    Parameters
    ----------
    counts : (C + 1, 4, C) int
        From `count_labels_and_states`.

    Examples
    --------
    One label (or none), two states and two classes; the label never occurred with the second state:

    >>> joint_table(np.array([[[3, 1], [0, 0]], [[1, 2], [0, 4]]])).tolist()
    [[0, 1], [1, 1]]
    """
    return np.where(counts.any(axis=2), counts.argmax(axis=2), counts.sum(axis=0).argmax(axis=1))


def naive_bayes(counts: NDArray) -> NDArray[np.int64]:
    """Return the most probable class for each ground label l and each state s, (C + 1, 4).

    This is the class c that maximises P(c) P(l | c) P(s | c). Laplace smoothing adds one to each count of a label or
    state with a class. Without it, a class that never occurred with a label would be impossible in every state.

    Parameters
    ----------
    counts : (C + 1, 4, C) int
        From `count_labels_and_states`.
    """
    n_labels, n_states, _ = counts.shape
    of_class = counts.sum(axis=(0, 1))
    label = (counts.sum(axis=1) + 1) / (of_class + n_labels)
    state = (counts.sum(axis=0) + 1) / (of_class + n_states)
    return (of_class * label[:, None] * state[None]).argmax(axis=2)


RULES = {"table": joint_table, "naive Bayes": naive_bayes}
"""Methods to predict the class from label and state, by name."""


def label_and_state(way: str, labels: str) -> str:
    """Return the method name of grids predicted from ground labels and occupancy states.

    Parameters
    ----------
    way : str
        A key of `RULES`.
    labels : str
        Name of the image labels, such as "true labels".
    """
    return f"{way} of flat ground and state, {labels}"


def fitted_tables(
    frames: TrainingSet, labellers: Mapping[str, Labeller], places: NDArray
) -> dict[str, dict[str, NDArray[np.int64]]]:
    """Return the class for each label and state, (C + 1, 4), by labeller and by key of `RULES`.

    Parameters
    ----------
    frames : TrainingSet
        The training frames. Baselines and networks learn from the same labels, true or from the LIDAR, so the
        comparison is fair.
    labellers : mapping of str to callable
        Functions that label the images, by name.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    """
    counts = {name: count_labels_and_states(frames, one, places) for name, one in labellers.items()}
    return {name: {way: table(one) for way, table in RULES.items()} for name, one in counts.items()}

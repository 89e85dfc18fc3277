"""Image labels looked up where flat ground would be, and the baselines that a network must beat (section 4.2).

The baselines know two things about a cell. One is the image label at the pixel that would see the cell's ground if the
ground were flat; cells whose ground the image doesn't show, or whose pixel has no label, get a separate value.
The other is the cell's most probable occupancy state. How often each class occurs with both is counted over all cells
of the training frames. Then the class is looked up in a table, or found by naive Bayes, as if label and state were
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
"""The number that `ground_pixels` returns for a cell whose ground is outside the image."""

Labeller = Callable[[Sample], NDArray]
"""A function that labels the pixels of a frame: sample -> classes (h, w), 255 where unlabelled."""


def ground_pixels(spec: GridSpec, camera: Camera) -> NDArray[np.int64]:
    """Return the pixel that sees the ground at the centre of each cell: equation (1) for plane 0, to the nearest pixel.

    Pixels (H, W) are numbered as row * w + column; -1 where the ground isn't in the image.

    Parameters
    ----------
    spec : GridSpec
        The grid, (H, W) cells.
    camera : Camera
        The camera at the size of the label image, (h, w) pixels.
    """
    (pixels,), (visible,) = plane_pixels(spec, [0.0], camera)
    places = np.full(spec.shape, NOT_SEEN)
    u, v = np.rint(pixels[visible]).astype(np.int64).T
    places[visible] = v * camera.size[1] + u
    return places


def inverse_perspective(labels: NDArray, places: NDArray, occupancy: NDArray, observed_only: bool = False) -> NDArray:
    """Carry image labels to the grid as if everything in the image were flat ground: inverse perspective mapping.

    No depth is used, so things above the ground are smeared away from the camera, over all cells that they hide.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel, KITTI-14: a network's arg-max, or the truth for an upper bound; 255 where unlabelled.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    observed_only : bool
        Whether cells that are most probably UNKNOWN, such as those behind a car, take no label.

    Returns
    -------
    (H, W) uint8
        The class of its pixel in each cell that the image shows. In other cells, and where the pixel is unlabelled or
        sky, one of the four unknown classes, by occupancy state.

    Raises
    ------
    ArgumentError
        When a pixel is outside the labels, or the shapes of `places` and `occupancy` disagree.
    """
    labels, unknown = np.asarray(labels), unknown_classes(occupancy)
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
    """Return the label of each cell's ground, (H, W); a cell without a label gets C, the number of classes.

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
    """Count the cells of all frames by label of the ground, most probable state and class, (C + 1, 4, C).

    Parameters
    ----------
    frames : TrainingSet
        The frames; the classes are those that networks learn from.
    labeller : callable
        Labels the images.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    """
    n_classes = len(frames.label_set)
    shape = (n_classes + 1, N_STATES, n_classes)
    counts = np.zeros(shape, np.int64)
    for k in range(len(frames)):
        truth, state = frames.arrays["truth"][k], np.argmax(frames.arrays["occupancy"][k], axis=0)
        known = truth != IGNORE
        cells = ground_labels(labeller(frames[k]), places, n_classes)[known], state[known], truth[known]
        counts += np.bincount(np.ravel_multi_index(cells, shape), minlength=counts.size).reshape(shape)
    return counts


def joint_table(counts: NDArray) -> NDArray[np.int64]:
    """Return the most frequent class for each label of the ground and each state, (C + 1, 4).

    Nothing is smoothed: if a label and a state never occurred together, the state alone decides.

    Parameters
    ----------
    counts : (C + 1, 4, C) int
        From `count_labels_and_states`.

    Examples
    --------
    One label or none, two states, and two classes; the label never occurred with the second state:

    >>> joint_table(np.array([[[3, 1], [0, 0]], [[1, 2], [0, 4]]])).tolist()
    [[0, 1], [1, 1]]
    """
    return np.where(counts.any(axis=2), counts.argmax(axis=2), counts.sum(axis=0).argmax(axis=1))


def naive_bayes(counts: NDArray) -> NDArray[np.int64]:
    """Return the most probable class for each label l of the ground and each state s, (C + 1, 4).

    It is the class c with the largest P(c) P(l | c) P(s | c). One is added to each count of a label or state with
    a class (Laplace smoothing). Otherwise a class that never occurred with a label would be impossible, whatever the
    state is.

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


WAYS = {"table": joint_table, "naive Bayes": naive_bayes}
"""The ways to find the class from label and state, by name."""


def label_and_state(way: str, labels: str) -> str:
    """Return the name of the grids that are made from labels of the ground and occupancy states.

    Parameters
    ----------
    way : str
        A key of `WAYS`.
    labels : str
        What the image labels are called, such as "true labels".
    """
    return f"{way} of flat ground and state, {labels}"


def fitted_tables(
    frames: TrainingSet, labellers: Mapping[str, Labeller], places: NDArray
) -> dict[str, dict[str, NDArray[np.int64]]]:
    """Return the class for each label and state, (C + 1, 4), by labeller and by name of `WAYS`.

    Parameters
    ----------
    frames : TrainingSet
        The frames to learn from. Their truth is what the networks learn from, true or made with the LIDAR, so that a
        baseline knows exactly as much as a network.
    labellers : mapping of str to callable
        The functions that label the images, by name.
    places : (H, W) int
        The pixel that sees each cell's ground, from `ground_pixels`.
    """
    counts = {name: count_labels_and_states(frames, one, places) for name, one in labellers.items()}
    return {name: {way: table(one) for way, table in WAYS.items()} for name, one in counts.items()}

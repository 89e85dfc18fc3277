"""Two baselines with one source each: the image alone, on flat ground, and the occupancy alone (section 4).

What one knows without looking, for the network to beat (section 4); pure geometry is in `datasets.ground_truth`.
"""

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.grid_truth import unknown_classes
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE
from semgrid_edu.occupancy import N_STATES, State
from semgrid_edu.planes import plane_pixels


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


NOT_SEEN = -1
"""What `ground_pixels` says of a cell whose ground lies outside the image."""


def ground_pixels(spec: GridSpec, camera: Camera) -> NDArray[np.int64]:
    """Return the pixel that sees the ground at the centre of each cell: equation (1) for plane 0, to the nearest pixel.

    Parameters
    ----------
    spec : GridSpec
        The grid, (H, W) cells.
    camera : Camera
        The camera at the size of the label image, (h, w) pixels.

    Returns
    -------
    (H, W) int64
        Pixel as row * w + column; -1 where the ground isn't in the image.
    """
    (pixels,), (visible,) = plane_pixels(spec, [0.0], camera)
    places = np.full(spec.shape, NOT_SEEN)
    u, v = np.rint(pixels[visible]).astype(np.int64).T
    places[visible] = v * camera.size[1] + u
    return places


def inverse_perspective(
    labels: NDArray, places: NDArray, occupancy: NDArray, observed_only: bool = False
) -> NDArray[np.uint8]:
    """Carry image labels to the grid as if all that the camera sees were flat ground: inverse perspective mapping.

    No depth is used, so whatever stands above the ground is smeared away from the camera, over all cells that it hides.

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
        The class of its pixel in each cell that the image shows; by occupancy state one of the four unknown classes in
        the others, and where the pixel is unlabelled or sky, which doesn't lie on the ground.

    Raises
    ------
    ArgumentError
        When a pixel lies outside the labels, or the shapes of `places` and `occupancy` disagree.
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


def majority_by_state(truths: NDArray, occupancy: NDArray) -> NDArray[np.uint8]:
    """Return the most frequent class of each cell for each occupancy state: what occupancy tells without an image.

    Parameters
    ----------
    truths : (N, H, W) uint8
        Grids of a training set, KITTI-14; 255 where unlabelled.
    occupancy : (N, 4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each of these grids.

    Returns
    -------
    (4, H, W) uint8
        The majority class of the frames in which this state was the most probable one in this cell; if there was none,
        that of all cells in this state.
    """
    states = np.argmax(occupancy, axis=1)
    return np.stack([majority_class(np.where(states == state, truths, IGNORE)) for state in range(N_STATES)])


def classes_of_states(by_state: NDArray, occupancy: NDArray) -> NDArray[np.uint8]:
    """Look up the class of each cell by its most probable state.

    Parameters
    ----------
    by_state : (4, H, W) uint8
        From `majority_by_state`.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.

    Returns
    -------
    (H, W) uint8
    """
    return np.take_along_axis(by_state, np.argmax(occupancy, axis=0)[None], axis=0)[0]

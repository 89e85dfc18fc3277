"""Ground truth of cells: image labels carried there by the LIDAR, and gaps closed, by a policy (section 4)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, distance_transform_edt

from semgrid_edu.camera import invert_rigid, project, transform_points
from semgrid_edu.datasets.ground_truth.window import Moment, TruthPolicy, gather_returns
from semgrid_edu.datasets.project_lidar import seen_returns
from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, UNKNOWN_OF_STATE, LabelSet
from semgrid_edu.occupancy import State

CLOSING_REACH = 1.5
"""Metres: the best of 0.5 to 3 m by pixel accuracy on minikitti's training split, with true image labels."""

GROUND_REACH = 3.0
"""Metres: beyond 30 m the LIDAR's rings are at least this far apart on the ground."""

OBJECT_REACH = 1.0
"""Metres: half the width of the widest gap in walls and hedges that is closed. By mean intersection over union on six
training frames of minikitti, 1 m was better than 0.5 m, and a `GROUND_REACH` of 3 m better than 2 m."""

SIGHT_COLUMNS = 100
"""Number of directions into which the image is divided, as wide as one column of the coarse simulated LIDAR."""


def carry_labels(
    labels: NDArray, pixels: NDArray, cells: NDArray, occupancy: NDArray, label_set: LabelSet = KITTI_14
) -> NDArray[np.uint8]:
    """Carry image labels to the grid with the LIDAR's depth: pure geometry, as the paper makes its ground truth.

    Each return that the camera sees carries the class of its pixel to its cell. There the returns vote by the rule of
    the true grids (`LabelSet.most_voted`). A cell without a labelled return gets the unknown class of its occupancy
    state. Sky gives no return, so a sky label is an error at an object's outline and is dropped.

    Parameters
    ----------
    labels : (h, w) uint8
        The class of each pixel: a network's arg-max, or the truth for an upper bound; 255 where unlabelled.
    pixels, cells : (N,) int
        Pixel and cell of each return, from `semgrid_edu.datasets.project_lidar.seen_returns`.
    occupancy : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN.
    label_set : LabelSet
        The classes, with an unknown one for each occupancy state.

    Returns
    -------
    (H, W) uint8
    """
    labels = np.asarray(labels)
    unknown = np.array(unknown_numbers(label_set), np.uint8)[np.argmax(occupancy, axis=-3)]
    for name, places, size in (("pixels", pixels, labels.size), ("cells", cells, unknown.size)):
        if len(places) and not (min(places) >= 0 and max(places) < size):
            raise ArgumentError(name, f"numbers from 0 to {size - 1}", f"{min(places)} to {max(places)}")
    return vote(labels.ravel()[pixels], cells, unknown, label_set)


def vote(classes: NDArray, cells: NDArray, unknown: NDArray, label_set: LabelSet) -> NDArray[np.uint8]:
    """Give each cell the class for which its returns vote, by the rule of `LabelSet.most_voted`.

    Parameters
    ----------
    classes : (N,) int
        The class of each return; 255 where unlabelled.
    cells : (N,) int
        The cell of each return, counted row by row.
    unknown : (H, W) uint8
        The class of each cell that has no labelled return.
    label_set : LabelSet
        The classes. Sky doesn't vote.
    """
    kept = classes != IGNORE
    if "sky" in label_set.names:
        kept &= classes != label_set.index("sky")
    n = len(label_set)
    votes = np.bincount(cells[kept] * n + classes[kept], minlength=unknown.size * n).reshape(*unknown.shape, n)
    return label_set.most_voted(np.moveaxis(votes, -1, 0), otherwise=unknown)


def close_gaps(
    grid: NDArray, cell: float, reach: float = CLOSING_REACH, label_set: LabelSet = KITTI_14
) -> NDArray[np.uint8]:
    """Label the gaps between the LIDAR's rings by the nearest label.

    Parameters
    ----------
    grid : (H, W) uint8
        From `carry_labels`.
    cell : float
        Side of a cell, metres.
    reach : float
        How far a label spreads, metres.
    label_set : LabelSet
        The classes, with an unknown one for each occupancy state.

    Returns
    -------
    (H, W) uint8
        Each cell that was observed, but has no label, gets the class of the nearest labelled cell.
    """
    unobserved = unknown_numbers(label_set)[State.UNKNOWN]
    unlabelled = grid >= label_set.n_semantic
    if unlabelled.all():
        return grid
    distance, nearest = distance_transform_edt(unlabelled, sampling=cell, return_indices=True)
    return np.where((grid != unobserved) & (distance <= reach), grid[tuple(nearest)], grid)


def close_and_spread(grid: NDArray, cell: float, label_set: LabelSet = KITTI_14) -> NDArray[np.uint8]:
    """Label the gaps between the LIDAR's rings, without making objects grow.

    The ground continues between the rings, so its labels spread by up to `GROUND_REACH`. If objects spread, they would
    cover the ground around them. They are closed instead (dilated, then eroded, class by class), which fills gaps of
    about twice `OBJECT_REACH`, in whole cells, and doesn't move outlines.

    Parameters
    ----------
    grid : (H, W) uint8
        From `carry_labels`.
    cell : float
        Side of a cell, metres.
    label_set : LabelSet
        The classes, with an unknown one for each occupancy state.

    Returns
    -------
    (H, W) uint8
        Cells that were observed, but had no label, may have one now; the others are unchanged.
    """
    flat = np.array([label_set.index(name) for name in label_set.flat])
    only_ground = np.where((grid < label_set.n_semantic) & ~np.isin(grid, flat), unknown_numbers(label_set)[0], grid)
    spread = close_gaps(only_ground, cell, GROUND_REACH, label_set)
    margin = round(OBJECT_REACH / cell)
    square = np.ones((2 * margin + 1,) * 2, bool)
    fillable = (grid >= label_set.n_semantic) & (grid != unknown_numbers(label_set)[State.UNKNOWN])
    closed = np.where(fillable, spread, grid)
    for c in set(range(label_set.n_semantic)) - set(flat.tolist()):
        thing = binary_closing(np.pad(grid == c, margin), square)
        closed[fillable & thing[margin : margin + len(grid), margin : margin + grid.shape[1]]] = c
    return closed


def unknown_numbers(label_set: LabelSet) -> tuple[int, ...]:
    """Return the unknown class of each occupancy state.

    Parameters
    ----------
    label_set : LabelSet
        The classes.

    Returns
    -------
    tuple of 4 int
        Class numbers in the order FREE, STATIC, DYNAMIC, UNKNOWN.

    Examples
    --------
    >>> unknown_numbers(KITTI_14)
    (10, 11, 12, 13)
    """
    names = [KITTI_14.names[c] for c in UNKNOWN_OF_STATE]
    if not set(names) <= set(label_set.names):
        raise ArgumentError("label_set", f"a label set with the classes {', '.join(names)}", label_set.name)
    return tuple(label_set.index(name) for name in names)


def in_sight(frame: Frame, spec: GridSpec) -> NDArray[np.bool_]:
    """Return which cells are in the camera's sight.

    The image is divided into vertical strips. In each strip the camera sees as far as the farthest return that it sees
    (`seen_returns`).

    Parameters
    ----------
    frame : Frame
        The frame; its points and its calibration are used.
    spec : GridSpec
        The grid.

    Returns
    -------
    (H, W) bool
    """
    centers = np.concatenate([spec.centers(), np.full((*spec.shape, 1), frame.camera.lidar_height)], axis=-1)
    T_camera_from_grid = frame.camera.T_camera_from_grid
    pixels, ahead = project(transform_points(T_camera_from_grid, centers), frame.camera)
    height, width = frame.camera.size
    strips = np.where(ahead, np.nan_to_num(pixels[..., 0]) * SIGHT_COLUMNS / width, 0).astype(int)
    eye = invert_rigid(T_camera_from_grid)[:2, 3]
    distance = np.hypot(*np.moveaxis(spec.centers() - eye, -1, 0))
    seen_pixels, seen_cells = seen_returns(frame, spec, (height, width))
    farthest = np.zeros(SIGHT_COLUMNS)
    np.maximum.at(farthest, seen_pixels % width * SIGHT_COLUMNS // width, distance.ravel()[seen_cells])
    return ahead & (distance <= farthest[strips])


def lidar_truth(
    frame: Frame,
    probability: NDArray,
    spec: GridSpec,
    policy: TruthPolicy | None = None,
    before: Sequence[Moment] = (),
    after: Sequence[Moment] = (),
) -> NDArray[np.uint8]:
    """Make the ground truth of a frame from its image labels, as the paper does.

    Each pixel with a return gets its depth (of several returns, the closest one's). This gives the pixel a point in
    space, and the cell there gets its label. Then gaps are closed, and cells without a label become unknown-free,
    -static, -dynamic or -unobserved by their most probable occupancy state. (In the paper a human also corrects the
    result.)

    Parameters
    ----------
    frame : Frame
        The frame, with labels.
    probability : (4, H, W) float
        Probability of FREE, STATIC, DYNAMIC and UNKNOWN in each cell.
    spec : GridSpec
        The grid.
    policy : TruthPolicy, optional
        The choices to make; by default the paper's.
    before, after : sequence of Moment
        The frames before and after this one, in the order of time, for policies that need them. There may be fewer than
        the policy asks for.

    Returns
    -------
    (H, W) uint8
        A class of the frame's label set in every cell.

    Raises
    ------
    ArgumentError
        When the frame has no labels, its label set has no unknown classes, the shape of `probability` or of the labels
        is wrong, or the policy needs frames, labels or beliefs that aren't given.

    Examples
    --------
    >>> truth = lidar_truth(drive[9], belief.probability, GridSpec.compact())           # doctest: +SKIP
    >>> wide = TruthPolicy(past=9, movers="carried")                                    # doctest: +SKIP
    >>> truth = lidar_truth(drive[9], belief.probability, spec, wide, before=moments)   # doctest: +SKIP
    """
    policy = policy or TruthPolicy()
    if frame.labels is None:
        raise ArgumentError("frame", "a frame with labels", "a frame without")
    label_set = frame.labels.label_set
    unknown = np.array(unknown_numbers(label_set), np.uint8)
    check_shape("probability", probability, (4, *spec.shape))
    returns = gather_returns(frame, before, after, spec, policy)
    rows, cols, inside = spec.cells(returns.places)
    cells = (rows * spec.shape[1] + cols)[inside]
    classes = returns.classes[inside]
    voters = label_set if policy.vote == "standing" else replace(label_set, flat=())
    states = np.argmax(probability, axis=0)
    truth = vote(classes, cells, unknown[states], voters)
    if policy.cleanup == "spread":
        truth = close_gaps(truth, spec.cell, label_set=label_set)
    elif policy.cleanup == "close":
        truth = close_and_spread(truth, spec.cell, label_set)
    if policy.visible_to == "camera":
        truth = np.where(in_sight(frame, spec), truth, unknown[states])
    elif policy.visible_to == "lidar":
        truth = np.where(states != State.UNKNOWN, truth, unknown[states])
    return truth


def drive_truth(
    moments: Sequence[Moment], k: int, spec: GridSpec, policy: TruthPolicy | None = None
) -> NDArray[np.uint8]:
    """Make the ground truth of one frame of a drive with `lidar_truth`.

    Parameters
    ----------
    moments : sequence of Moment
        The frames of the drive in the order of time, each with the filter's belief after it.
    k : int
        Number of the frame.
    spec : GridSpec
        The grid of the beliefs.
    policy : TruthPolicy, optional
        The choices to make; by default the paper's.

    Returns
    -------
    (H, W) uint8
        A class of the frame's label set in every cell.
    """
    if not 0 <= k < len(moments) or moments[k].belief is None:
        raise ArgumentError("k", f"a frame with a belief, 0 to {len(moments) - 1}", k)
    frame, belief = moments[k]
    return lidar_truth(frame, belief.probability, spec, policy, moments[:k], moments[k + 1 :])

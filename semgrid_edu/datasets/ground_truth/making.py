"""Semantic grids from image labels and LIDAR scans by a policy: the paper's ground truth, and others (section 4)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import invert_rigid, project, transform_points
from semgrid_edu.datasets.ground_truth.carrying import carry_labels, close_and_spread, close_gaps, unknown_numbers
from semgrid_edu.datasets.ground_truth.policy import TruthPolicy
from semgrid_edu.datasets.ground_truth.window import Moment, gather_returns
from semgrid_edu.datasets.project_lidar import seen_returns
from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import State

SIGHT_COLUMNS = 100
"""Number of directions into which the image is divided, as wide as one column of the coarse simulated LIDAR."""


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
    truth = carry_labels(classes, np.arange(len(cells)), cells, probability, voters)
    if policy.cleanup == "spread":
        truth = close_gaps(truth, spec.cell, label_set=label_set)
    elif policy.cleanup == "close":
        truth = close_and_spread(truth, spec.cell, label_set)
    states = np.argmax(probability, axis=0)
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

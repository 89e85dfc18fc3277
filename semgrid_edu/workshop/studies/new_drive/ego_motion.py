"""What the poses of a drive say of its motion, against the scans: laid over each other, and in the wrong axes."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from semgrid_edu.camera import invert_rigid, rigid_transform, transform_points
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame

TALL = (0.5, 3.0)
"""Heights above the ground, metres, between which returns come from things that stand up, such as walls and poles."""
NEAREST, FARTHEST = 3.0, 40.0
"""Distances between which returns are compared, metres: beyond, neighbouring beams are too far apart."""


def standing_points(frame: Frame) -> NDArray[np.float64]:
    """Return the returns from things that stand up, in the LIDAR frame.

    Parameters
    ----------
    frame : Frame
        Its scan and the LIDAR's height are used.

    Returns
    -------
    (n, 3) float64
        Metres; cars and people are among them, moving or not.
    """
    height, distance = frame.points_grid[:, 2], np.hypot(*frame.points[:, :2].T)
    chosen = (height > TALL[0]) & (height < TALL[1]) & (distance > NEAREST) & (distance < FARTHEST)
    return frame.points[chosen, :3].astype(np.float64)


def motion_between(before: Frame, now: Frame) -> NDArray[np.float64]:
    """Return what the poses say of the motion between two frames.

    Parameters
    ----------
    before, now : Frame
        Two frames of a drive.

    Returns
    -------
    (4, 4) float64
        T_before_from_now of the LIDAR, metres.
    """
    return invert_rigid(before.T_world_from_lidar) @ now.T_world_from_lidar


def overlay_error(before: Frame, now: Frame, T_before_from_now: NDArray) -> float:
    """Lay one scan over another and return how far apart they are: the median distance to the nearest return.

    Most of what stands up doesn't move, so a wrong motion makes the median large, and a few moving things don't.

    Parameters
    ----------
    before, now : Frame
        Two frames of a drive.
    T_before_from_now : (4, 4) float
        The motion to try, metres.

    Returns
    -------
    float
        Metres; it isn't 0 for the true motion, because the beams hit other places.
    """
    moved = transform_points(T_before_from_now, standing_points(now))
    return float(np.median(KDTree(standing_points(before)).query(moved)[0]))


def _in_axes(rotation: ArrayLike) -> Callable[[NDArray], NDArray]:
    """Return a function that expresses a motion in turned or mirrored axes."""
    M = rigid_transform(np.array(rotation, dtype=np.float64), np.zeros(3))
    return lambda T: M @ T @ M.T


AXES: dict[str, Callable[[NDArray], NDArray]] = {
    "as the poses say": lambda T: T,
    "left and right swapped": _in_axes(np.diag([1, -1, 1])),
    "backwards": _in_axes(np.diag([-1, -1, 1])),
    "a quarter turn": _in_axes([[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "no motion": lambda T: np.eye(4),
}
"""What a motion becomes by mistakes that one makes with axes, (4, 4) -> (4, 4), by name."""


def axes_errors(frames: Sequence[Frame], apart: int = 5) -> dict[str, float]:
    """Lay scans over each other by the motion that the poses say, and by what mistakes with axes make of it.

    Parameters
    ----------
    frames : sequence of Frame
        Successive frames of a drive, more than `apart`.
    apart : int
        How many frames lie between two scans that are compared: a longer way shows a wrong motion better.

    Returns
    -------
    dict of str to float
        For each entry of `AXES` the mean over all pairs of frames of `overlay_error`, metres.

    Raises
    ------
    ArgumentError
        When there are too few frames.
    """
    pairs = list(pairwise(frames[::apart])) if apart > 0 else []
    if not pairs:
        raise ArgumentError("apart", f"1 to {len(frames) - 1} for {len(frames)} frames", apart)
    errors = {name: [] for name in AXES}
    for before, now in pairs:
        tree, points = KDTree(standing_points(before)), standing_points(now)
        for name, mistake in AXES.items():
            moved = transform_points(mistake(motion_between(before, now)), points)
            errors[name].append(np.median(tree.query(moved)[0]))
    return {name: float(np.mean(values)) for name, values in errors.items()}

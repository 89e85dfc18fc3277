"""Scans before and after the labelled one, moved to its frame: what stands gets dense, what moves needs care (4)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import invert_rigid, transform_points
from semgrid_edu.datasets.ground_truth.policy import TruthPolicy
from semgrid_edu.datasets.ground_truth.sweep import deskew_scan, ego_velocity
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, State


class Moment(NamedTuple):
    """A frame of a drive, and what the occupancy filter believes after it.

    Parameters
    ----------
    frame : Frame
        The frame.
    belief : Belief or None
        From `track_drive`; a policy that leaves moving things as they are needs none.
    """

    frame: Frame
    belief: Belief | None


def gather_points(
    frame: Frame, before: Sequence[Moment], after: Sequence[Moment], spec: GridSpec, policy: TruthPolicy
) -> NDArray[np.float32]:
    """Return the returns of a frame, with those of the scans around it that a policy adds.

    Parameters
    ----------
    frame : Frame
        The labelled frame.
    before, after : sequence of Moment
        What came before it and after it, in the order of time; the nearest are used, as many as there are.
    spec : GridSpec
        The grid of the beliefs.
    policy : TruthPolicy
        Numbers of scans, whether they are de-skewed, and what happens to moving things.

    Returns
    -------
    (N, 4) float32
        In the LIDAR frame of the labelled frame, metres, with reflectance; its own returns come first.

    Raises
    ------
    ArgumentError
        When moving things are to be treated and a belief is missing, or a scan is to be de-skewed and no other frame
        tells how the vehicle moves.
    """
    moments = [*before, Moment(frame, None), *after]
    frames = [moment.frame for moment in moments]
    now = len(before)
    scans = [_scan(frames, now, policy.deskew)]
    for k in range(max(now - policy.past, 0), min(now + policy.future + 1, len(moments))):
        if k != now:
            points = _without_smear(moments[k], _scan(frames, k, policy.deskew), frame.time, spec, policy.movers)
            T_now_from_then = invert_rigid(frame.T_world_from_lidar) @ frames[k].T_world_from_lidar
            scans.append(np.column_stack([transform_points(T_now_from_then, points[:, :3]), points[:, 3:]]))
    return np.concatenate(scans).astype(np.float32)


def _scan(frames: list[Frame], k: int, deskew: bool) -> NDArray[np.float32]:
    """Return the scan of a frame, de-skewed if so wished, by its motion since the frame before or to the one after."""
    if not deskew:
        return frames[k].points
    if len(frames) < 2:
        raise ArgumentError("before, after", "a frame beside the labelled one, whose pose tells the motion", "none")
    return deskew_scan(frames[k].points, ego_velocity(frames[k], frames[k - 1 if k else 1]))


def _without_smear(
    moment: Moment, points: NDArray[np.float32], now: float, spec: GridSpec, movers: str
) -> NDArray[np.float32]:
    """Leave, remove or carry on the returns in cells that are rather DYNAMIC than STATIC."""
    if movers == "smeared":
        return points
    if moment.belief is None:
        raise ArgumentError("before, after", f"beliefs, for moving things to be {movers}", "None")
    rows, cols, inside = spec.cells(points)
    probability, velocity = (array[:, rows, cols] for array in (moment.belief.probability, moment.belief.velocity))
    moves = inside & (probability[State.DYNAMIC] > probability[State.STATIC])
    known = np.isfinite(velocity).all(axis=0) & (movers == "carried")
    carried = points.copy()
    carried[:, :2] += np.where(moves & known, velocity * (now - moment.frame.time), 0).T
    return carried[~moves | known]

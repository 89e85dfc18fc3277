"""Scans before and after the labelled one, moved to its frame: what stands gets dense, what moves needs care (4)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import invert_rigid, transform_points
from semgrid_edu.datasets.ground_truth.policy import TruthPolicy
from semgrid_edu.datasets.ground_truth.sweep import deskew_scan, ego_velocity
from semgrid_edu.datasets.readers.project_lidar import closest_returns
from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE
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


class LabelledReturns(NamedTuple):
    """Returns of one or several scans, with the class of the pixel that each one falls on.

    Parameters
    ----------
    places : (N, 3) float32
        x, y, z in the LIDAR frame of the labelled frame, metres.
    classes : (N,) uint8
        Their classes; 255 where the image has no label.
    """

    places: NDArray[np.float32]
    classes: NDArray[np.uint8]


def gather_returns(
    frame: Frame, before: Sequence[Moment], after: Sequence[Moment], spec: GridSpec, policy: TruthPolicy
) -> LabelledReturns:
    """Label the returns of a frame, and those of the scans around it that a policy adds.

    At each pixel only the closest return is labelled (`closest_returns`): of all scans together when one image labels
    them all, of each scan when each has its own.

    Parameters
    ----------
    frame : Frame
        The labelled frame.
    before, after : sequence of Moment
        What came before it and after it, in the order of time; the nearest are used. There may be fewer than the policy
        asks for.
    spec : GridSpec
        The grid of the beliefs.
    policy : TruthPolicy
        Numbers of scans, which image labels them, whether they are de-skewed, and what happens to moving things.

    Raises
    ------
    ArgumentError
        When labels are missing or have another size than the image; when moving things are to be treated and a belief
        is missing; when a scan is to be de-skewed and there is no other frame from whose pose the vehicle's motion
        follows.
    """
    moments = [*before, Moment(frame, None), *after]
    frames = [moment.frame for moment in moments]
    now, own = len(before), policy.labels == "own"
    scans = []
    for k in range(max(now - policy.past, 0), min(now + policy.future + 1, len(moments))):
        points = _scan(frames, k, policy.deskew)
        if own:
            points = _with_classes(frames[k], points)
        if k != now:
            points = _without_smear(moments[k], points, frame.time, spec, policy.movers)
            T_now_from_then = invert_rigid(frame.T_world_from_lidar) @ frames[k].T_world_from_lidar
            points = np.column_stack([transform_points(T_now_from_then, points[:, :3]), points[:, 3:]])
        scans.append(points)
    # The labelled frame's own returns come first: of two that are equally close its own one wins.
    scans.insert(0, scans.pop(min(now, policy.past)))
    gathered = np.concatenate(scans).astype(np.float32)
    labelled = gathered if own else _with_classes(frame, gathered)
    return LabelledReturns(labelled[:, :3], labelled[:, 3].astype(np.uint8))


def _with_classes(frame: Frame, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the points that the camera of a frame sees, each with the class of its pixel in place of reflectance."""
    if frame.labels is None:
        raise ArgumentError("before, after", "image labels of every frame of the window", f"none at {frame.time:g} s")
    labels = frame.labels
    check_shape("frame.labels.image", labels.image, frame.camera.size)
    returns, uv = closest_returns(replace(frame, points=points))
    classes = np.where(labels.image < labels.label_set.n_semantic, labels.image, IGNORE)[uv[:, 1], uv[:, 0]]
    return np.column_stack([points[returns, :3], classes]).astype(np.float32)


def _scan(frames: list[Frame], k: int, deskew: bool) -> NDArray[np.float32]:
    """Return the scan of a frame; de-skewed, if asked for, by the motion since the frame before or to the one after."""
    if not deskew:
        return frames[k].points
    if len(frames) < 2:
        raise ArgumentError("before, after", "a frame beside the labelled one, whose pose shows the motion", "none")
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

"""Scans around the labelled one, moved to its frame: denser for static things, smeared for moving ones (section 4).

A spinning scanner takes a tenth of a second for one turn, during which the vehicle moves. A return measured t seconds
after the image is given in the LIDAR's frame at that time t. De-skewing expresses all returns in the LIDAR's frame at
the instant of the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import invert_rigid, transform_points
from semgrid_edu.datasets.project_lidar import closest_returns
from semgrid_edu.errors import ArgumentError, check_shape
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE
from semgrid_edu.occupancy import Belief, PlanarMotion, State
from semgrid_edu.occupancy.cmcdot import LIDAR_PERIOD

MOVERS = ("smeared", "carved", "carried")
LABELS = ("present", "own")
SIGHTS = ("any", "camera", "lidar")
VOTES = ("standing", "majority")
CLEANUPS = ("none", "spread", "close")


@dataclass(frozen=True)
class TruthPolicy:
    """How to make a semantic grid from image labels and LIDAR scans; by default as in the paper, where it is specific.

    Parameters
    ----------
    past, future : int
        Numbers of scans before and after the labelled one that are added to it, moved by the vehicle's poses. The paper
        uses only the labelled scan.
    labels : str
        Which image labels the returns of these other scans. "present": the labelled frame's, so that one labelled image
        is enough, as in KITTI, where one image in ten has labels. A point that is hidden at that instant gets the label
        of whatever hides it, unless that has a return on the same pixel. "own": the image taken with the scan, so that
        all frames of the window need labels.
    movers : str
        What happens to returns from moving things in these other scans. "smeared": nothing, so that they stay where the
        thing was. "carved": they are removed. "carried": they are moved to where the thing is now, by the velocity of
        their cell, or removed where that is unknown. The occupancy filter decides what moves, and how fast, because a
        real drive has no better source.
    deskew : bool
        Whether to undo the motion of the vehicle within a turn of the LIDAR (`deskew_scan`). Use it for scans as a
        scanner records them, such as KITTI's raw ones and the simulated data sets. Scans of one instant, such as the
        sample drive's, would be distorted by it, unless `TruthFlaws.skewed` has skewed them first.
    vote : str
        The class of a cell whose returns have several. "standing": the most frequent class that isn't ground, and a
        ground class only if there is no other, as in the true grids (`LabelSet.most_voted`); a thin pole then keeps its
        cell, but so does one wrong return. "majority": the most frequent class.
    visible_to : str
        Which cells may keep a label. "any": all. "camera": cells in the camera's sight, as far as this scan shows
        (`in_sight`). "lidar": cells that the LIDAR has observed, whose most probable state isn't UNKNOWN.
    cleanup : str
        How the gaps between the rings are closed. "none": not at all. "spread": all classes spread into them
        (`close_gaps`). "close": objects are closed, and only the ground spreads (`close_and_spread`). The paper uses
        morphological methods, but doesn't specify which.

    Examples
    --------
    >>> TruthPolicy(past=9, movers="carried").visible_to
    'any'
    """

    past: int = 0
    future: int = 0
    labels: str = "present"
    movers: str = "smeared"
    deskew: bool = False
    vote: str = "standing"
    visible_to: str = "any"
    cleanup: str = "close"

    def __post_init__(self) -> None:
        """Check that every field is one of its choices."""
        choices_of = {"labels": LABELS, "movers": MOVERS, "vote": VOTES, "visible_to": SIGHTS, "cleanup": CLEANUPS}
        for name, choices in choices_of.items():
            if getattr(self, name) not in choices:
                raise ArgumentError(name, f"one of {', '.join(choices)}", repr(getattr(self, name)))
        for name in ("past", "future"):
            if type(getattr(self, name)) is not int or getattr(self, name) < 0:
                raise ArgumentError(name, "a number of scans, 0 or more", repr(getattr(self, name)))


class Moment(NamedTuple):
    """A frame of a drive, and the occupancy filter's belief after it.

    Parameters
    ----------
    frame : Frame
        The frame.
    belief : Belief or None
        From `track_drive`; not needed by a policy that leaves moving things as they are.
    """

    frame: Frame
    belief: Belief | None


class LabelledReturns(NamedTuple):
    """Returns of one or several scans, each with the class of its pixel.

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
    """Label the returns of a frame, and of the scans around it that a policy adds.

    At each pixel only the closest return is labelled (`closest_returns`): the closest of all scans if one image labels
    them all, or of each scan if each has its own image.

    Parameters
    ----------
    frame : Frame
        The labelled frame.
    before, after : sequence of Moment
        The frames before and after it, in the order of time; the nearest are used. There may be fewer than the policy
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
    now = len(before)
    own = policy.labels == "own"
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
    # The labelled frame's returns come first, so that they win ties in distance.
    scans.insert(0, scans.pop(min(now, policy.past)))
    gathered = np.concatenate(scans).astype(np.float32)
    labelled = gathered if own else _with_classes(frame, gathered)
    return LabelledReturns(labelled[:, :3], labelled[:, 3].astype(np.uint8))


def _with_classes(frame: Frame, points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the points that a frame's camera sees, each with the class of its pixel in place of the reflectance."""
    if frame.labels is None:
        expected = "image labels of the frame, and with own labels of every frame of the window"
        raise ArgumentError("frame, before, after", expected, f"none at {frame.time:g} s")
    labels = frame.labels
    check_shape("frame.labels.image", labels.image, frame.camera.size)
    returns, uv = closest_returns(replace(frame, points=points))
    classes = np.where(labels.image < labels.label_set.n_semantic, labels.image, IGNORE)[uv[:, 1], uv[:, 0]]
    return np.column_stack([points[returns, :3], classes]).astype(np.float32)


def _scan(frames: list[Frame], k: int, deskew: bool) -> NDArray[np.float32]:
    """Return a frame's scan, de-skewed if wanted by the motion since the frame before or to the frame after."""
    if not deskew:
        return frames[k].points
    if len(frames) < 2:
        raise ArgumentError("before, after", "a frame beside the labelled one, whose pose shows the motion", "none")
    return deskew_scan(frames[k].points, ego_velocity(frames[k], frames[k - 1 if k else 1]))


def _without_smear(
    moment: Moment, points: NDArray[np.float32], now: float, spec: GridSpec, movers: str
) -> NDArray[np.float32]:
    """Leave, remove or move the returns in cells that are more DYNAMIC than STATIC."""
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


class EgoVelocity(NamedTuple):
    """The velocity of the vehicle in its own frame.

    Parameters
    ----------
    forward, left : float
        Metres per second.
    turn : float
        Turn to the left, radians per second.
    """

    forward: float
    left: float
    turn: float


def ego_velocity(frame: Frame, other: Frame) -> EgoVelocity:
    """Return the velocity of the vehicle at a frame, from the pose and the time of a neighbouring frame.

    Parameters
    ----------
    frame : Frame
        The frame.
    other : Frame
        The frame before or after it.
    """
    seconds = other.time - frame.time
    if seconds == 0:
        raise ArgumentError("other", "a frame of another time", f"one of {other.time} s too")
    motion = PlanarMotion.from_poses(frame.T_world_from_lidar, other.T_world_from_lidar)
    return EgoVelocity(motion.dx / seconds, motion.dy / seconds, motion.dyaw / seconds)


def sweep_times(points: NDArray) -> NDArray[np.float64]:
    """Return when each return was measured, if the scanner turns clockwise and faces forward at the image.

    KITTI's scanner does: it triggers the cameras when it faces forward (Geiger et al., 2013).

    Parameters
    ----------
    points : (N, 2+) float
        x forward, y left in the LIDAR frame, metres.

    Returns
    -------
    (N,) float64
        Seconds since the image, from -0.05 (behind, on the left) to 0.05 (behind, on the right).

    Examples
    --------
    >>> sweep_times(np.array([[5.0, 0.0], [0.0, 5.0], [0.0, -5.0]])).tolist()
    [-0.0, -0.025, 0.025]
    """
    azimuth = np.arctan2(points[:, 1].astype(np.float64), points[:, 0])
    return -azimuth / (2 * np.pi) * LIDAR_PERIOD


def deskew_scan(points: NDArray, velocity: EgoVelocity) -> NDArray:
    """Move all returns of a scan to the LIDAR's frame at the instant of the image.

    In t seconds the vehicle moves by v t and turns by w t, so a return p becomes R(w t) p + v t. Moving things stay
    skewed, because their motion isn't known.

    Parameters
    ----------
    points : (N, 3+) float
        Returns as recorded: x forward, y left, z up in the LIDAR's frame when each was measured, metres.
    velocity : EgoVelocity
        Velocity of the vehicle.

    Returns
    -------
    (N, 3+) float
        The returns in the frame of one instant, in the type of `points`.
    """
    t = sweep_times(points)
    xy = _turned(points[:, :2], velocity.turn * t) + t[:, None] * np.array(velocity[:2])
    return np.column_stack([xy, points[:, 2:]]).astype(points.dtype)


def skew_scan(points: NDArray, velocity: EgoVelocity) -> NDArray:
    """Skew a scan that was taken at one instant, as if a scanner on a moving vehicle had recorded it.

    It inverts `deskew_scan` up to a small error, because a return gets the time of its direction before skewing.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the frame of the LIDAR at one instant: x forward, y left, z up, metres.
    velocity : EgoVelocity
        Velocity of the vehicle.

    Returns
    -------
    (N, 3+) float
        Each return in the LIDAR's frame at the time of its measurement, in the type of `points`.
    """
    t = sweep_times(points)
    xy = _turned(points[:, :2] - t[:, None] * np.array(velocity[:2]), -velocity.turn * t)
    return np.column_stack([xy, points[:, 2:]]).astype(points.dtype)


def _turned(xy: NDArray, angles: NDArray) -> NDArray[np.float64]:
    """Turn each point to the left by its angle, radians."""
    cos = np.cos(angles)
    sin = np.sin(angles)
    x = xy[:, 0]
    y = xy[:, 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)

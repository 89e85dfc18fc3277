"""Poses that no car can have: jumps, turns in no time, a heading that isn't the way it moves, a GPS without a fix."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.datasets.oxts import mercator_pose, mercator_scale
from semgrid_edu.errors import DataError

FASTEST = 100.0
"""Metres per second. No car drives faster."""

PERIODS = (0.005, 5.0)
"""Seconds: the shortest and the longest plausible time from one frame to the next (median)."""

NEIGHBOURS = 2
"""A step is compared with this many steps before it and after it."""

STRAY = (1.0, 0.5)
"""How far a pose may be from where the steps around it lead: metres along the ground, and up. Positions of KITTI's GPS
stray by decimetres."""

HARDEST = 10.0
"""Metres per second squared. No car brakes harder."""

TURN = (5.0, 60.0)
"""How far a car can turn in a step: degrees, and degrees per second."""

TILT = (4.0, 20.0)
"""How much more or less it can lean: degrees, and degrees per second."""

SLOWEST = 1.0
"""Metres per second. Slower cars have no direction of motion that a GPS could tell."""

FORWARD_SHARE = 0.9
"""The smallest plausible cosine between heading and motion (median over the steps)."""

FEWEST_STEPS = 3
"""From this many steps on, a direction or a speed is compared."""

SPEED_RATIO = 1.3
"""How far the speed of the positions may be from the packets' own speed, as a factor (median over the steps)."""

NORTH, EAST = 6, 7
"""Fields of a packet: velocity towards north and east, m/s."""

POSITION_MODE = 27
"""Field of a packet: how the GPS got its position. 0 means not at all, 1 that it searches, 2 by Doppler alone."""

YAW = 5
"""Field of a packet: yaw, radians from east, anticlockwise."""

PACKET_MISTAKES: dict[str, Callable[[NDArray], NDArray]] = {
    "is yaw clockwise?": lambda packets: _with_yaw(packets, -packets[:, YAW]),
    "is yaw clockwise from north?": lambda packets: _with_yaw(packets, np.pi / 2 - packets[:, YAW]),
    "is yaw from north?": lambda packets: _with_yaw(packets, np.pi / 2 + packets[:, YAW]),
    "is yaw in degrees?": lambda packets: _with_yaw(packets, np.radians(packets[:, YAW])),
    "are latitude and longitude swapped?": lambda packets: packets[:, [1, 0, *range(2, packets.shape[1])]],
}
"""How to undo common mistakes in packets, (N, 30).

The question is asked if undoing one makes the vehicle move the way it looks."""


def packet_doubts(packets: Mapping[object, NDArray], seconds: NDArray) -> list[str]:
    """Name the packets that no car can have sent.

    Parameters
    ----------
    packets : mapping of object to (30,) float
        The packets of a drive, in order, from `read_packet`, by what to call each in a line, such as its file.
    seconds : (N,) float
        Time of each packet; steps that aren't positive or not known are skipped.

    Returns
    -------
    list of str
        One line for each doubt: those of `path_doubts`; a GPS without a fix; another speed than the packets' own.
    """
    if not packets:
        return []
    fields = np.array(list(packets.values()))
    paths = list(packets)
    found = _without_fix(fields, paths)
    poses = _poses(fields)
    found += path_doubts(poses, seconds, paths, lambda: _hint(fields, seconds))
    moved, steps = _steps(poses, seconds)
    measured = np.linalg.norm(fields[:, [NORTH, EAST]], axis=1)
    known = (steps > 0) & (measured[1:] > SLOWEST)
    if known.sum() >= FEWEST_STEPS:
        ratio = float(np.median(np.linalg.norm(moved[known, :2], axis=1) / steps[known] / measured[1:][known]))
        if not 1 / SPEED_RATIO < ratio < SPEED_RATIO:
            expected = "positions that move as fast as the packets' velocities"
            found.append(str(DataError(paths[0], expected, f"{ratio:.2g} times as fast (median)")))
    return found


def path_doubts(
    poses: NDArray, seconds: NDArray, places: Sequence[object], hint: Callable[[], str] = lambda: ""
) -> list[str]:
    """Name the poses that no car can have reached, and say if the vehicle doesn't move the way it looks.

    Parameters
    ----------
    poses : (N, 4, 4) float
        T_world_from_vehicle, metres: x forward, y to the left, z up.
    seconds : (N,) float
        Time of each pose; steps that aren't positive or not known are skipped.
    places : sequence of N
        What to call each pose in a line, such as its file.
    hint : callable
        Returns what to ask if the vehicle doesn't move the way it looks; "" for nothing.

    Returns
    -------
    list of str
        One line for each such pose, and one for the direction.
    """
    moved, steps = _steps(poses, seconds)
    timed = np.flatnonzero(steps > 0)  # an unknown time is NaN
    if len(timed) and not PERIODS[0] < (period := float(np.median(steps[timed]))) < PERIODS[1]:
        expected = f"times in seconds, {PERIODS[0]} to {PERIODS[1]} apart"
        return [str(DataError(places[0], expected, f"{period:.3g} apart (median): are they in another unit?"))]
    found = []
    for i, k in enumerate(timed):
        around = timed[max(i - NEIGHBOURS, 0) : i + NEIGHBOURS + 1]
        velocity = np.median(moved[around] / steps[around, None], axis=0) if len(around) > 2 else None
        doubt = _step_doubt(poses[k], poses[k + 1], steps[k], velocity)
        if doubt:
            found.append(str(DataError(places[k + 1], *doubt)))
    share = _forward_share(poses, seconds)
    if share < FORWARD_SHARE:
        question = hint()
        expected = f"a vehicle that moves the way it looks (cosine of at least {FORWARD_SHARE})"
        what = f"{share:.2f} (median of all steps)"
        found.append(str(DataError(places[0], expected, f"{what}: {question}" if question else what)))
    return found


def _step_doubt(before: NDArray, after: NDArray, dt: float, velocity: NDArray | None) -> tuple[str, str] | None:
    """Return what was expected of a step and what was found; None if a car can do it."""
    step = after[:3, 3] - before[:3, 3]
    if np.linalg.norm(step) > FASTEST * dt:
        return f"a place within {FASTEST * dt:.0f} m of the packet before", f"{np.linalg.norm(step):.0f} m"
    if velocity is not None:
        stray = step - velocity * dt
        slack = HARDEST * dt**2
        if np.linalg.norm(stray[:2]) > STRAY[0] + slack:
            return "a place where the steps around it lead", f"one {np.linalg.norm(stray[:2]):.1f} m beside it"
        if abs(stray[2]) > STRAY[1] + slack:
            return "a height to which the steps around it lead", f"one {stray[2]:+.1f} m from it"
    turned = np.degrees(Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).magnitude())
    if turned > TURN[0] + TURN[1] * dt:
        return f"a turn of at most {TURN[0] + TURN[1] * dt:.0f} degrees since the pose before", f"{turned:.0f} degrees"
    leant = np.degrees(np.arccos(np.clip(before[:3, 2] @ after[:3, 2], -1, 1)))
    if leant > TILT[0] + TILT[1] * dt:
        return f"roll and pitch within {TILT[0] + TILT[1] * dt:.0f} degrees of the pose before", f"{leant:.0f} degrees"
    return None


def _steps(poses: NDArray, seconds: NDArray) -> tuple[NDArray, NDArray]:
    """Return how far each pose is from the one before, (N - 1, 3) in the world, and the seconds, (N - 1,)."""
    return np.diff(poses[:, :3, 3], axis=0), np.diff(seconds)


def _forward_share(poses: NDArray, seconds: NDArray) -> float:
    """Return the median cosine between heading and motion; 1 for a vehicle that hardly moves."""
    moved, steps = _steps(poses, seconds)
    length = np.linalg.norm(moved[:, :2], axis=1)
    moving = (steps > 0) & (length > SLOWEST * steps)
    if moving.sum() < FEWEST_STEPS:
        return 1.0
    heading = poses[1:, :2, 0]
    return float(np.median((moved[:, :2] * heading).sum(axis=1)[moving] / length[moving]))


def _poses(packets: NDArray) -> NDArray[np.float64]:
    """Return T_mercator_from_imu of each packet, (N, 4, 4)."""
    scale = mercator_scale(packets[0])
    return np.array([mercator_pose(packet, scale) for packet in packets])


def _hint(packets: NDArray, seconds: NDArray) -> str:
    """Return the questions of the mistakes whose undoing makes the vehicle move the way it looks."""
    asked = []
    for question, undo in PACKET_MISTAKES.items():
        undone = undo(packets)
        if np.abs(undone[:, 0]).max() < 90 and _forward_share(_poses(undone), seconds) >= FORWARD_SHARE:
            asked.append(question)
    return " ".join(asked)


def _with_yaw(packets: NDArray, yaw: NDArray) -> NDArray:
    """Return packets with another yaw."""
    changed = packets.copy()
    changed[:, YAW] = yaw
    return changed


def _without_fix(packets: NDArray, paths: Sequence[object]) -> list[str]:
    """Name the first packet whose GPS has no fix. A drive that never says how it got its positions isn't doubted."""
    mode = packets[:, POSITION_MODE]
    lost = np.flatnonzero(mode <= 2)
    if not mode.any() or not len(lost):
        return []
    found = f"mode {mode[lost[0]]:.0f}, and the same in {len(lost)} of {len(mode)} packets"
    return [str(DataError(paths[lost[0]], "a GPS that has a fix (posmode of at least 3)", found))]

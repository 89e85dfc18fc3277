"""The skew of a LIDAR scan: it takes a tenth of a second, in which the vehicle moves on (section 4).

A spinning scanner measures one direction after the other. A return that was measured t seconds after the camera took
its image is given in the frame of the LIDAR as it stood at that time t. To de-skew is to give all returns in the frame
of one instant, that of the image.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.occupancy import PlanarMotion
from semgrid_edu.occupancy.cmcdot import LIDAR_PERIOD


class EgoVelocity(NamedTuple):
    """The velocity of the vehicle along its own axes.

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
    """Return when each return was measured, if the scanner turns clockwise and looks ahead when the image is taken.

    KITTI's scanner does (Geiger et al., 2013: it triggers the cameras when it faces forward).

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
    """Move all returns of a scan to the frame that the LIDAR had at the instant of the image.

    In t seconds the vehicle moves by v t and turns by w t, so a return p becomes R(w t) p + v t. What moves by itself
    stays skewed: its motion isn't known.

    Parameters
    ----------
    points : (N, 3+) float
        Returns as they were recorded: x forward, y left, z up in the frame of the LIDAR as it stood when each was
        measured, metres.
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

    The inverse of `deskew_scan` but for a small error: a return gets the time of its direction before it is skewed.

    Parameters
    ----------
    points : (N, 3+) float
        Returns in the frame of the LIDAR at one instant: x forward, y left, z up, metres.
    velocity : EgoVelocity
        Velocity of the vehicle.

    Returns
    -------
    (N, 3+) float
        Each return in the frame of the LIDAR as it stood when it was measured, in the type of `points`.
    """
    t = sweep_times(points)
    xy = _turned(points[:, :2] - t[:, None] * np.array(velocity[:2]), -velocity.turn * t)
    return np.column_stack([xy, points[:, 2:]]).astype(points.dtype)


def _turned(xy: NDArray, angles: NDArray) -> NDArray[np.float64]:
    """Turn each point to the left by its angle, radians."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y = xy[:, 0], xy[:, 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)

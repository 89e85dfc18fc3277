"""How things move: along the road's coordinates, at a speed that swings a little."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, rigid_transform
from semgrid_edu.simulation.street.layout import Road, ground_height, to_world


@dataclass(frozen=True)
class Pace:
    """A speed of `mean` plus `swing` sin(`rate` t + `phase`), m/s and rad/s, integrated in closed form."""

    mean: float
    swing: float = 0.0
    rate: float = 0.8
    phase: float = 0.0

    def distance(self, t: float) -> float:
        """Return the metres covered from 0 to t seconds."""
        return self.mean * t + self.swing / self.rate * (np.cos(self.phase) - np.cos(self.rate * t + self.phase))

    def speed(self, t: float) -> float:
        """Return the speed at t seconds, m/s."""
        return self.mean + self.swing * np.sin(self.rate * t + self.phase)


STAND = Pace(0.0)
"""The pace of what stands still."""


@dataclass(frozen=True)
class Trajectory:
    """A straight line in road coordinates, run at a pace.

    Parameters
    ----------
    s, d : float
        Where it is at t = 0, metres.
    along, across : float
        Direction in (s, d): (1, 0) with our traffic, (-1, 0) against it, (0, 1) across the road to the left.
    pace : Pace
    turn : float
        Added to the direction that the trajectory gives, rad: how something that stands is turned.
    """

    s: float
    d: float
    along: float
    across: float
    pace: Pace
    turn: float = 0.0

    def at(self, t: float) -> tuple[float, float]:
        """Return s and d at t seconds."""
        way = self.pace.distance(t)
        return self.s + self.along * way, self.d + self.across * way

    def pose(self, road: Road, t: float) -> tuple[NDArray[np.float64], float]:
        """Return the position on the ground, (3,) m, and the yaw in the world, rad, at t seconds."""
        s, d = self.at(t)
        x, y, heading = to_world(road, s, d)
        return np.array([x, y, ground_height(road, s, d)]), heading + np.arctan2(self.across, self.along) + self.turn

    def velocity(self, road: Road, t: float) -> NDArray[np.float64]:
        """Return the velocity in the world's x and y at t seconds, (2,) m/s."""
        step = 1e-4
        return (self.pose(road, t + step)[0][:2] - self.pose(road, t - step)[0][:2]) / (2 * step)


@dataclass(frozen=True)
class Ego:
    """The recording car's way: a lane, a little sway in it, and a body that rolls and pitches on its springs.

    Parameters
    ----------
    road : Road
    trajectory : Trajectory
    sway : float
        Amplitude of its sideways drift, metres.
    roll, pitch : float
        Amplitudes, rad: about 0.2 degrees on an even road.
    phase : float
        Shifts all of these oscillations, rad.
    """

    road: Road
    trajectory: Trajectory
    sway: float
    roll: float
    pitch: float
    phase: float

    def T_world_from_lidar(self, t: float) -> NDArray[np.float64]:
        """Return the LIDAR's pose at t seconds, (4, 4); it tilts about the point on the ground below it."""
        s, d = self.trajectory.at(t)
        speed = self.trajectory.pace.speed(t)
        swing = 0.45 * s / 10.0 + self.phase
        d += self.sway * np.sin(swing)
        x, y, heading = to_world(self.road, s, d)
        drift = self.sway * np.cos(swing) * 0.045 if speed > 0 else 0.0
        yaw = heading + np.arctan(drift)
        roll = self.roll * np.sin(5.1 * t + 2 * self.phase)
        pitch = self.pitch * np.sin(6.7 * t + 3 * self.phase)
        R = rotation_matrix(roll, pitch, yaw)
        return rigid_transform(R, np.array([x, y, 0.0]) + KITTI_LIDAR_HEIGHT * R[:, 2])


def rotation_matrix(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Return Rz(yaw) Ry(pitch) Rx(roll), the order of KITTI's oxts angles."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )

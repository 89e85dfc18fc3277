"""Motion along the road at a slightly oscillating speed, and the recording car's motion on its suspension."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, rigid_transform
from semgrid_edu.workshop.simulation.street.ground import on_ground, on_wheels
from semgrid_edu.workshop.simulation.street.layout import Road, to_world
from semgrid_edu.workshop.simulation.things.shapes import rotation_matrix

_RATE = 0.8
"""Angular frequency at which a speed oscillates, rad/s."""


@dataclass(frozen=True)
class ActorPace:
    """A speed over time, mean + swing sin(0.8 t + phase), and its integral, the distance travelled.

    Parameters
    ----------
    mean : float
        Mean speed, m/s.
    swing : float
        Amplitude of the oscillation, m/s.
    phase : float
        Phase of the oscillation at t = 0, rad.
    """

    mean: float
    swing: float = 0.0
    phase: float = 0.0

    @classmethod
    def random(cls, rng: np.random.Generator, mean: float | None = None) -> "ActorPace":
        """Draw the speed of the recording car.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        mean : float, optional
            Mean speed, m/s; by default random from 5 to 14 m/s, and 0 in one drive of ten.
        """
        drawn = 0.0 if rng.random() < 0.1 else float(rng.uniform(5, 14))
        mean = drawn if mean is None else mean
        swing = float(rng.uniform(0.0, 0.12)) * mean
        phase = float(rng.uniform(0, 6.28))
        return cls(mean, swing, phase)

    def distance(self, t: float) -> float:
        """Return the distance travelled since t = 0, metres.

        Parameters
        ----------
        t : float
            Time, seconds.
        """
        return self.mean * t + self.swing / _RATE * (np.cos(self.phase) - np.cos(_RATE * t + self.phase))

    def speed(self, t: float) -> float:
        """Return the speed at one instant, m/s. Parameters are those of `ActorPace.distance`."""
        return self.mean + self.swing * np.sin(_RATE * t + self.phase)


STANDSTILL = ActorPace(0.0)
"""The pace of an object that doesn't move."""


@dataclass(frozen=True)
class Departure:
    """A pace that is zero at first, rises at a constant rate, and then stays constant.

    Parameters
    ----------
    mean : float
        The final speed, m/s.
    start : float
        Time of departure, seconds.
    acceleration : float
        The acceleration, m/s^2.
    """

    mean: float
    start: float
    acceleration: float

    def distance(self, t: float) -> float:
        """Return the distance travelled since t = 0, metres. Parameters are those of `ActorPace.distance`."""
        since = max(t - self.start, 0.0)
        rising = min(since, self.mean / self.acceleration)
        return 0.5 * self.acceleration * rising**2 + self.mean * (since - rising)

    def speed(self, t: float) -> float:
        """Return the speed at one instant, m/s. Parameters are those of `ActorPace.distance`."""
        return min(self.acceleration * max(t - self.start, 0.0), self.mean)


@dataclass(frozen=True)
class Trajectory:
    """A straight line in road coordinates, followed at a pace.

    Parameters
    ----------
    s, d : float
        Position at t = 0: distance along the road and to the left of its centre line, metres.
    along, across : float
        Direction in (s, d): (1, 0) with our traffic, (-1, 0) against it, (0, 1) across the road to the left.
    pace : ActorPace or Departure
        Speed over time.
    turn : float
        Angle between this direction and the direction that the object faces, rad, for objects that don't move.
    """

    s: float
    d: float
    along: float
    across: float
    pace: ActorPace | Departure
    turn: float = 0.0

    def at(self, t: float) -> tuple[float, float]:
        """Return (s, d) at one instant: distance along the road and to the left of its centre line, metres.

        Parameters
        ----------
        t : float
            Time, seconds.
        """
        travelled = self.pace.distance(t)
        return self.s + self.along * travelled, self.d + self.across * travelled

    def pose(self, road: Road, t: float) -> tuple[NDArray[np.float64], float]:
        """Return position and direction in the world at one instant.

        Parameters
        ----------
        road : Road
            The street.
        t : float
            Time, seconds.

        Returns
        -------
        position : (3,) float64
            The point on the ground, metres.
        yaw : float
            Direction of the object, rad from the x axis, counter-clockwise.
        """
        s, d = self.at(t)
        position, heading = on_ground(road, s, d)
        return position, heading + np.arctan2(self.across, self.along) + self.turn

    def velocity(self, road: Road, t: float) -> NDArray[np.float64]:
        """Return the velocity over ground along the world's x and y, (2,), m/s, as a central difference.

        Parameters are those of `Trajectory.pose`.
        """
        step = 1e-4
        return (self.pose(road, t + step)[0][:2] - self.pose(road, t - step)[0][:2]) / (2 * step)


_AXLES, _TRACK = 2.7, 1.55
"""Wheelbase and track width of the recording car, metres."""


@dataclass(frozen=True)
class Ego:
    """The motion of the recording car: it drifts within its lane, and rolls and pitches on its suspension.

    Parameters
    ----------
    road : Road
        The street.
    trajectory : Trajectory
        The centre line of its lane, and its pace.
    sway : float
        Amplitude of its sideways drift, metres.
    roll, pitch : float
        Amplitudes of roll and pitch relative to the plane under its wheels, rad.
    phase : float
        Phase of all three oscillations, rad.
    """

    road: Road
    trajectory: Trajectory
    sway: float
    roll: float
    pitch: float
    phase: float

    @classmethod
    def random(
        cls, rng: np.random.Generator, road: Road, pace: ActorPace, lane: int | None = None, swing: tuple = (0.3, 0.6)
    ) -> "Ego":
        """Draw the lane and the oscillations of the recording car.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        road : Road
            The street.
        pace : ActorPace
            Its speed over time.
        lane : int, optional
            Number of its lane, 0 next to the centre line; by default the outer lane in two drives out of three.
        swing : (float, float)
            Smallest and largest amplitude of roll and pitch, degrees.
        """
        drawn = road.lanes_right - 1 if rng.random() < 0.65 else 0
        lane = drawn if lane is None else lane
        d = -(lane + 0.5) * road.lane + float(rng.normal(0, 0.1))
        sway = float(rng.uniform(0.02, 0.1))
        phase = float(rng.uniform(0, 6.28))
        roll, pitch = (float(x) for x in np.radians(rng.uniform(*swing, 2)))
        return cls(road, Trajectory(0.0, d, 1.0, 0.0, pace), sway, roll, pitch, phase)

    def T_world_from_lidar(self, t: float) -> NDArray[np.float64]:
        """Return the LIDAR's pose at one instant, (4, 4), metres. It tilts about the ground point below it.

        Parameters
        ----------
        t : float
            Time, seconds.
        """
        s, d = self.trajectory.at(t)
        speed = self.trajectory.pace.speed(t)
        swing = 0.45 * s / 10.0 + self.phase
        d += self.sway * np.sin(swing)
        x, y, heading = to_world(self.road, s, d)
        drift = self.sway * np.cos(swing) * 0.045 if speed > 0 else 0.0
        yaw = heading + np.arctan(drift)
        height, roll, pitch = on_wheels(self.road, s, d, yaw, _AXLES, _TRACK)
        roll += self.roll * np.sin(5.1 * t + 2 * self.phase)
        pitch += self.pitch * np.sin(6.7 * t + 3 * self.phase)
        R = rotation_matrix(roll, pitch, yaw)
        return rigid_transform(R, np.array([x, y, height]) + KITTI_LIDAR_HEIGHT * R[:, 2])

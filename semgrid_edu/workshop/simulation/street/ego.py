"""The recording car: how it drives along the road, and how its body moves on its springs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, rigid_transform
from semgrid_edu.workshop.simulation.street.ground import on_wheels
from semgrid_edu.workshop.simulation.street.layout import Road, to_world
from semgrid_edu.workshop.simulation.street.trajectories import ActorPace, Trajectory
from semgrid_edu.workshop.simulation.things.shapes import rotation_matrix

_AXLES, _TRACK = 2.7, 1.55
"""Distance between the axles of the recording car, and between the wheels of an axle, metres."""


@dataclass(frozen=True)
class Ego:
    """The motion of the recording car: it keeps its lane, sways in it, and rolls and pitches on its springs.

    Parameters
    ----------
    road : Road
        The street.
    trajectory : Trajectory
        The middle of its lane, and its pace.
    sway : float
        Amplitude of its sideways drift, metres.
    roll, pitch : float
        Amplitudes of these angles about the plane below its wheels, rad.
    phase : float
        Phase of all of these oscillations, rad.
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
        """Draw the recording car's lane and how it sways.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of all that is drawn.
        road : Road
            The street.
        pace : ActorPace
            How fast it drives.
        lane : int, optional
            Number of its lane, 0 beside the centre line; when left out, the outer one in two drives of three.
        swing : (float, float)
            Least and largest amplitude of roll and pitch, degrees.
        """
        drawn = road.lanes_right - 1 if rng.random() < 0.65 else 0
        lane = drawn if lane is None else lane
        d = -(lane + 0.5) * road.lane + float(rng.normal(0, 0.1))
        sway, phase = float(rng.uniform(0.02, 0.1)), float(rng.uniform(0, 6.28))
        roll, pitch = (float(x) for x in np.radians(rng.uniform(*swing, 2)))
        return cls(road, Trajectory(0.0, d, 1.0, 0.0, pace), sway, roll, pitch, phase)

    def T_world_from_lidar(self, t: float) -> NDArray[np.float64]:
        """Return the LIDAR's pose at one instant, (4, 4), metres; it tilts about the point on the ground below it.

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

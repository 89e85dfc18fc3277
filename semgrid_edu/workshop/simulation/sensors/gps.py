"""GPS and IMU: packets as KITTI's development kit defines them, a Mercator projection of the pose and its rates."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.datasets.oxts import EARTH_RADIUS

GRAVITY = 9.81
"""What an accelerometer at rest reads upwards, m/s^2."""
_STEP = 1e-3
"""Seconds between the poses of which velocities and accelerations are central differences."""
DATAFORMAT = Path(__file__).with_name("dataformat.txt").read_text(encoding="utf-8")
"""The legend that KITTI puts beside the packets."""
_FLAGS = (0.05, 0.02, 4, 9, 4, 4, 6)
"""Accuracies and modes, the last numbers of each packet: those of a receiver with a good fix."""


@dataclass(frozen=True)
class Geodesy:
    """Where on Earth a drive starts, and in which direction its world points.

    Parameters
    ----------
    latitude, longitude : float
        Place of the IMU at the first packet, degrees.
    altitude : float
        Its height above sea level, metres.
    heading : float
        Direction of the world's x axis, rad from east, counter-clockwise.
    """

    latitude: float
    longitude: float
    altitude: float
    heading: float

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Geodesy":
        """Draw a place near Karlsruhe, where KITTI was recorded, and a direction.

        Parameters
        ----------
        rng : numpy.random.Generator
            Decides them.
        """
        north, east = float(rng.uniform(0, 0.05)), float(rng.uniform(0, 0.05))
        return cls(49.0 + north, 8.4 + east, 114.0, float(rng.uniform(-3.1, 3.1)))

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3): from the simulator's world to east, north, up."""
        return Rotation.from_euler("z", self.heading).as_matrix()

    def degrees(self, offset: NDArray) -> tuple[float, float]:
        """Return where on Earth a point is: the inverse of the Mercator projection near the first packet.

        Parameters
        ----------
        offset : (3,) float
            How far the point lies east, north and up of the first packet, metres.

        Returns
        -------
        latitude, longitude : float
            Degrees.
        """
        scale = np.cos(np.radians(self.latitude))
        longitude = self.longitude + np.degrees(offset[0] / (scale * EARTH_RADIUS))
        mercator = np.log(np.tan(np.radians(90 + self.latitude) / 2)) + offset[1] / (scale * EARTH_RADIUS)
        return float(np.degrees(2 * np.arctan(np.exp(mercator))) - 90), float(longitude)


def oxts_packet(pose: Callable[[float], NDArray], t: float, geodesy: Geodesy) -> str:
    """Return the thirty numbers of an oxts packet, which `DATAFORMAT` names.

    Parameters
    ----------
    pose : callable
        Function of the time in seconds that returns T_world_from_imu, (4, 4), metres.
    t : float
        Time of the packet, seconds since the drive began.
    geodesy : Geodesy
        Where on Earth the drive begins.

    Returns
    -------
    str
        One line.
    """
    before, now, after = (pose(t + h) for h in (-_STEP, 0.0, _STEP))
    turn = geodesy.rotation
    offset = turn @ (now[:3, 3] - pose(0.0)[:3, 3])
    latitude, longitude = geodesy.degrees(offset)
    R = turn @ now[:3, :3]
    yaw, pitch, roll = Rotation.from_matrix(R).as_euler("ZYX")
    velocity = turn @ (after[:3, 3] - before[:3, 3]) / (2 * _STEP)
    acceleration = turn @ (after[:3, 3] - 2 * now[:3, 3] + before[:3, 3]) / _STEP**2
    rates = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).as_rotvec() / (2 * _STEP)
    level = Rotation.from_euler("z", yaw).as_matrix()
    felt = np.add(acceleration, (0, 0, GRAVITY))
    numbers = [latitude, longitude, geodesy.altitude + offset[2], roll, pitch, yaw, velocity[1], velocity[0]]
    numbers += [*(level.T @ velocity), *(R.T @ felt), *(level.T @ felt), *rates, *(level.T @ R @ rates)]
    return " ".join([f"{x:.16g}" for x in numbers] + [str(x) for x in _FLAGS]) + "\n"

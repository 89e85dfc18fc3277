"""The recording car in KITTI's conventions: calibration, camera and LIDAR models, GPS/IMU packets."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, Camera, invert_rigid, lidar_from_grid, rigid_transform
from semgrid_edu.datasets.oxts import EARTH_RADIUS

HDL64E_ELEVATIONS = tuple(np.concatenate([np.linspace(2.0, -8.33, 32), np.linspace(-8.83, -24.9, 32)]).tolist())
"""Elevations of the Velodyne HDL-64E's 64 lasers, degrees: two blocks, the upper one finer (its manual)."""
KITTI_ELEVATIONS = (
    2.27, 1.91, 1.70, 1.21, 0.97, 0.51, 0.34, -0.08, -0.41, -0.83, -1.12, -1.45, -1.82,
    -2.15, -2.46, -2.81, -3.09, -3.46, -3.71, -4.07, -4.36, -4.69, -5.00, -5.32, -5.65, -5.96,
    -6.24, -6.49, -6.85, -7.17, -7.39, -7.72, -8.33, -8.84, -9.30, -9.70, -10.16, -10.74, -11.23,
    -11.65, -12.09, -12.51, -13.03, -13.54, -14.12, -14.56, -15.05, -15.41, -16.03, -16.56, -17.14, -17.63,
    -18.07, -18.45, -18.92, -19.46, -19.99, -20.52, -21.00, -21.40, -21.84, -22.47, -23.01, -23.48,
)  # fmt: skip
"""Laser elevations of KITTI's scanner, degrees: per laser the median over its returns in two scans of drive 0013."""

_CAMERA_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
_KITTI_K = np.array([[721.5377, 0.0, 609.5593], [0.0, 721.5377, 172.8540], [0.0, 0.0, 1.0]])
_KITTI_SIZE = (375, 1242)
_IMAGE_SIZE = (188, 621)
"""Height and width of the images, pixels: half of KITTI's."""


@dataclass(frozen=True)
class Lidar:
    """A spinning LIDAR.

    Parameters
    ----------
    elevations : tuple of float
        Elevation of each laser, degrees; by default the HDL-64E's.
    azimuth_min, azimuth_max, azimuth_step : float
        Horizontal angles of a scan, degrees, positive to the left. The default covers the half-plane ahead in steps of
        0.9 degrees, which keeps data sets small; the HDL-64E at 10 Hz has -180, 180 and 0.18.
    range_sigma : float
        Standard deviation of the range noise, metres: 2 cm according to the manual.
    dropout : float
        Share of returns that are lost on any surface, 0..1.
    weak_signal : float
        Signal strength at which 1 return in e is lost. At 25 m and perpendicular incidence, the signal equals the
        reflectance.
    revolution : float
        Duration of one clockwise revolution, seconds; 0 for an instantaneous scan.
    """

    elevations: tuple[float, ...] = HDL64E_ELEVATIONS
    azimuth_min: float = -90.0
    azimuth_max: float = 90.0
    azimuth_step: float = 0.9
    range_sigma: float = 0.02
    dropout: float = 0.03
    weak_signal: float = 0.05
    revolution: float = 0.0

    @cached_property
    def azimuths(self) -> NDArray[np.float64]:
        """(A,): azimuth of each column of a scan, degrees, from left to right."""
        return np.arange(self.azimuth_max, self.azimuth_min, -self.azimuth_step)

    @cached_property
    def times(self) -> NDArray[np.float64]:
        """(A,): time of each column, seconds, 0 when the LIDAR points ahead."""
        return -self.azimuths / 360 * self.revolution

    @cached_property
    def directions(self) -> NDArray[np.float32]:
        """(N, 3) float32: unit vectors in the LIDAR frame, laser by laser from the top, each from left to right."""
        azimuth = np.radians(self.azimuths)
        elevation = np.radians(self.elevations)[:, None]
        x = np.cos(elevation) * np.cos(azimuth)
        y = np.cos(elevation) * np.sin(azimuth)
        return np.stack([x, y, np.sin(elevation) + 0 * azimuth], axis=-1).reshape(-1, 3).astype(np.float32)


HDL64E = Lidar(azimuth_min=-180.0, azimuth_max=180.0, azimuth_step=0.18)
"""KITTI's scanner at 10 Hz: 360 degrees, full resolution, instantaneous."""
HDL64E_AHEAD = Lidar(KITTI_ELEVATIONS, azimuth_step=0.18, weak_signal=0.015, revolution=0.1)
"""KITTI's scanner in the simulated data sets: the half-plane ahead, scanned while the vehicle moves."""


@dataclass(frozen=True)
class Rig:
    """The sensors of the recording car and their mounting positions.

    Parameters
    ----------
    lidar : Lidar
        Directions and noise of the LIDAR.
    packet_interval : float
        Time between two GPS/IMU packets, seconds. A scan gets the pose of the nearest packet. KITTI's interval is 0.01,
        so a pose is up to 5 ms off, which is 5 cm at 11 m/s. 0 gives the exact pose of the scan.
    """

    lidar: Lidar = Lidar()
    packet_interval: float = 0.0

    R_rect: ClassVar[NDArray[np.float64]] = Rotation.from_euler("xyz", [0.25, -0.42, 0.56], degrees=True).as_matrix()
    """(3, 3): from camera 0 to its rectified frame."""
    T_camera0_from_lidar: ClassVar[NDArray[np.float64]] = rigid_transform(
        Rotation.from_euler("xyz", [-0.25, 0.35, -0.5], degrees=True).as_matrix() @ _CAMERA_AXES,
        np.array([-0.004, -0.076, -0.272]),
    )
    """(4, 4): camera 0 is 0.27 m ahead of the LIDAR and 0.08 m lower."""
    T_lidar_from_imu: ClassVar[NDArray[np.float64]] = rigid_transform(
        Rotation.from_euler("xyz", [0.85, 0.12, 0.045], degrees=True).as_matrix(), np.array([-0.81, 0.32, -0.80])
    )
    """(4, 4): the IMU is 0.81 m behind the LIDAR, 0.32 m to its right and 0.8 m lower."""
    T_grid_from_lidar: ClassVar[NDArray[np.float64]] = invert_rigid(lidar_from_grid(KITTI_LIDAR_HEIGHT))
    """(4, 4): a translation up by the LIDAR's height."""

    @staticmethod
    def P_rect(index: int) -> NDArray[np.float64]:
        """Return the projection matrix of a rectified camera, with the baselines of KITTI's cameras.

        Parameters
        ----------
        index : int
            Number of the camera, 0..3.

        Returns
        -------
        (3, 4) float64
            From the rectified frame of camera 0, metres, to pixels.
        """
        K = Camera(_KITTI_K, np.eye(4), _KITTI_SIZE).resized(_IMAGE_SIZE).K
        baseline = (0.0, -0.5372, 0.0622, -0.4706)[index]
        return np.column_stack([K, [K[0, 0] * baseline, 0.0, 0.0]])

    @cached_property
    def camera(self) -> Camera:
        """Camera 2, rectified."""
        P = self.P_rect(2)
        shift = rigid_transform(np.eye(3), np.array([P[0, 3] / P[0, 0], 0.0, 0.0]))
        T = shift @ rigid_transform(self.R_rect, np.zeros(3)) @ self.T_camera0_from_lidar
        return Camera(P[:, :3], T, _IMAGE_SIZE)

    @cached_property
    def T_lidar_from_camera(self) -> NDArray[np.float64]:
        """(4, 4): the inverse of the camera's pose."""
        return invert_rigid(self.camera.T_camera_from_lidar)

    @cache  # noqa: B019 (there are few rigs)
    def pixel_directions(self, du: float = 0.0, dv: float = 0.0) -> NDArray[np.float32]:
        """Return the viewing direction of every pixel of camera 2.

        Parameters
        ----------
        du, dv : float
            Offset to the right and down from the pixel centres, pixels.

        Returns
        -------
        (h w, 3) float32
            Unit vectors in the LIDAR frame, row by row.
        """
        height, width = self.camera.size
        v, u = np.mgrid[:height, :width]
        pixels = np.stack([u + du, v + dv, np.ones_like(u)], axis=-1).reshape(-1, 3)
        rays = pixels @ np.linalg.inv(self.camera.K).T @ self.T_lidar_from_camera[:3, :3].T
        return (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)


KITTI_AHEAD = Rig(lidar=HDL64E_AHEAD)
"""The sensors of the simulated data sets."""
KITTI_RIG = Rig(lidar=HDL64E, packet_interval=0.01)
"""KITTI's scanner with a pose packet every 10 ms."""
SAMPLE_RIG = Rig(lidar=replace(HDL64E_AHEAD, azimuth_step=0.45))
"""The sensors of the shipped drive: fewer LIDAR columns, to keep it small."""


GRAVITY = 9.81
"""Upward reading of an accelerometer at rest, m/s^2."""
_STEP = 1e-3
"""Time step of the central differences for velocity and acceleration, seconds."""
DATAFORMAT = Path(__file__).with_name("dataformat.txt").read_text(encoding="utf-8")
"""KITTI's description of the packet format."""
_FLAGS = (0.05, 0.02, 4, 9, 4, 4, 6)
"""The last numbers of each packet: accuracies and modes of a receiver with a good fix."""


@dataclass(frozen=True)
class Geodesy:
    """Geographic start and orientation of a drive.

    Parameters
    ----------
    latitude, longitude : float
        Position of the IMU at the first packet, degrees.
    altitude : float
        Height of the IMU above sea level, metres.
    heading : float
        Direction of the world's x axis, rad from east, counter-clockwise.
    """

    latitude: float
    longitude: float
    altitude: float
    heading: float

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Geodesy":
        """Draw a position near Karlsruhe, where KITTI was recorded, and a heading.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        """
        north = float(rng.uniform(0, 0.05))
        east = float(rng.uniform(0, 0.05))
        return cls(49.0 + north, 8.4 + east, 114.0, float(rng.uniform(-3.1, 3.1)))

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3): from the simulator's world to east, north, up."""
        return Rotation.from_euler("z", self.heading).as_matrix()

    def degrees(self, offset: NDArray) -> tuple[float, float]:
        """Return latitude and longitude of a point: the inverse Mercator projection around the first packet.

        Parameters
        ----------
        offset : (3,) float
            Offset of the point from the first packet: east, north and up, metres.

        Returns
        -------
        latitude, longitude : float
            Degrees.
        """
        scale = np.cos(np.radians(self.latitude))
        longitude = self.longitude + np.degrees(offset[0] / (scale * EARTH_RADIUS))
        mercator = np.log(np.tan(np.radians(90 + self.latitude) / 2)) + offset[1] / (scale * EARTH_RADIUS)
        return float(np.degrees(2 * np.arctan(np.exp(mercator))) - 90), float(longitude)


def oxts_packet(pose: Callable[[float], NDArray], t: float, geodesy: Geodesy, step: float = _STEP) -> str:
    """Return the thirty numbers of an oxts packet; `DATAFORMAT` describes them.

    Parameters
    ----------
    pose : callable
        t in seconds -> T_world_from_imu, (4, 4), metres.
    t : float
        Time of the packet, seconds since the drive began.
    geodesy : Geodesy
        Geographic start of the drive.
    step : float
        Time step of the differences that velocity and acceleration are, seconds.

    Returns
    -------
    str
        One line.
    """
    before, now, after = (pose(t + h) for h in (-step, 0.0, step))
    turn = geodesy.rotation
    offset = turn @ (now[:3, 3] - pose(0.0)[:3, 3])
    latitude, longitude = geodesy.degrees(offset)
    R = turn @ now[:3, :3]
    yaw, pitch, roll = Rotation.from_matrix(R).as_euler("ZYX")
    velocity = turn @ (after[:3, 3] - before[:3, 3]) / (2 * step)
    acceleration = turn @ (after[:3, 3] - 2 * now[:3, 3] + before[:3, 3]) / step**2
    rates = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).as_rotvec() / (2 * step)
    level = Rotation.from_euler("z", yaw).as_matrix()
    felt = np.add(acceleration, (0, 0, GRAVITY))
    numbers = [latitude, longitude, geodesy.altitude + offset[2], roll, pitch, yaw, velocity[1], velocity[0]]
    numbers += [*(level.T @ velocity), *(R.T @ felt), *(level.T @ felt), *rates, *(level.T @ R @ rates)]
    return " ".join([f"{x:.16g}" for x in numbers] + [str(x) for x in _FLAGS]) + "\n"

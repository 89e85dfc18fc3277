"""KITTI's timestamps, and poses from its GPS and inertial packets (OXTS) by the Mercator projection (section 4)."""

import re
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import invert_rigid, rigid_transform
from semgrid_edu.datasets.drive_files import lines_of
from semgrid_edu.errors import DataError
from semgrid_edu.storage.reading import parse_numbers, read_lines, read_text

_STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{9}")


EARTH_RADIUS = 6378137.0
"""Radius of the Earth at the equator, metres (WGS 84), as the KITTI development kit takes it."""

PACKET_FIELDS = 30
"""Number of values in a packet; a drive's dataformat.txt names them."""


def read_timestamps(path: Path, n_frames: int, first: int = 0) -> NDArray[np.datetime64]:
    """Read the times at which a sensor took each frame.

    Parameters
    ----------
    path : Path
        timestamps.txt of the sensor.
    n_frames : int
        Number of frames, and therefore of lines.
    first : int
        The number of the first frame: the file of a clip may be that of the drive from which it was cut.

    Returns
    -------
    (n_frames,) datetime64[ns]
        NaT for an empty line, with which KITTI marks a scan that was never recorded.
    """
    lines = read_lines(path, n_frames)
    times = np.array([_parse(path, number, line) for number, line in enumerate(lines, 1)], dtype="datetime64[ns]")
    chosen = lines_of(path, times, range(first, first + n_frames))
    known = np.flatnonzero(~np.isnat(times))
    backwards = np.flatnonzero(np.diff(times[known]) <= np.timedelta64(0))
    if backwards.size:
        line = known[backwards[0] + 1]
        raise DataError(path, "increasing times", f"{lines[line]!r} in line {line + 1}, not after the one before")
    return chosen


def _parse(path: Path, number: int, line: str) -> np.datetime64:
    """Return the time in one line."""
    if not line.strip():
        return np.datetime64("NaT", "ns")
    with suppress(ValueError):
        if _STAMP.fullmatch(line.strip()):
            return np.datetime64(line.strip(), "ns")
    raise DataError(path, "times like 2011-09-26 13:10:51.168593664", f"{line!r} in line {number}")


def read_packet(path: Path) -> NDArray[np.float64]:
    """Read a packet.

    Parameters
    ----------
    path : Path
        The file of one frame.

    Returns
    -------
    (30,) float64
        Latitude and longitude (degrees), altitude (m), roll, pitch and yaw (rad), and 24 further numbers.
    """
    return parse_packet(path, read_text(path))


def parse_packet(path: Path, text: str) -> NDArray[np.float64]:
    """Return the numbers of a packet.

    Parameters
    ----------
    path : Path
        Where the packet comes from, for the error.
    text : str
        Its numbers.

    Returns
    -------
    (30,) float64
        See `read_packet`.
    """
    packet = parse_numbers(path, text, "an oxts packet")
    if packet.size != PACKET_FIELDS:
        raise DataError(path, f"{PACKET_FIELDS} numbers", f"{packet.size}")
    latitude, longitude = packet[:2]
    if not (abs(latitude) < 90 and abs(longitude) <= 180):
        raise DataError(path, "latitude and longitude in degrees", (latitude, longitude))
    if np.abs(packet[3:6]).max() > 2 * np.pi:
        raise DataError(path, "roll, pitch and yaw in radians", packet[3:6].tolist())
    return packet


def mercator_scale(packet: NDArray) -> float:
    """Return the cosine of a packet's latitude, which scales Mercator's metres to true metres nearby.

    Parameters
    ----------
    packet : (30,) float
        From `read_packet`.
    """
    return float(np.cos(np.radians(packet[0])))


def mercator_pose(packet: NDArray, scale: float) -> NDArray[np.float64]:
    """Return the pose of the IMU in a packet. Mercator's axes point east, north and up.

    x = s r lon,  y = s r log tan(pi / 4 + lat / 2),  z = altitude;  R = Rz(yaw) Ry(pitch) Rx(roll).

    Parameters
    ----------
    packet : (30,) float
        From `read_packet`.
    scale : float
        s, the same for all packets of a drive: `mercator_scale` of the first one.

    Returns
    -------
    (4, 4) float64
        T_mercator_from_imu, metres.
    """
    latitude, longitude = np.radians(packet[:2])
    x = scale * EARTH_RADIUS * longitude
    y = scale * EARTH_RADIUS * np.log(np.tan(np.pi / 4 + latitude / 2))
    roll, pitch, yaw = packet[3:6]
    rotation = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    return rigid_transform(rotation, np.array([x, y, packet[2]]))


def imu_pose(first: NDArray, packet: NDArray) -> NDArray[np.float64]:
    """Return the pose of the IMU relative to its pose at a drive's first packet.

    Parameters
    ----------
    first, packet : (30,) float
        The first packet, and the packet whose pose is wanted, from `read_packet`.

    Returns
    -------
    (4, 4) float64
        T_world_from_imu, metres.
    """
    scale = mercator_scale(first)
    return invert_rigid(mercator_pose(first, scale)) @ mercator_pose(packet, scale)

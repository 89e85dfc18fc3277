"""KITTI's calibration files: of the raw drives (camera 2 of equation (1), LIDAR and IMU), and of the benchmarks."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, Camera, rigid_transform
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.storage.reading import parse_numbers, read_text

ROTATION_TOLERANCE = 1e-4
"""The largest accepted entry of R R^T - I: KITTI prints seven digits, which leaves about 1e-6."""


LIDAR_HEIGHT = "lidar_height"
"""A line of calib_velo_to_cam.txt that KITTI's own drives lack: the height of a LIDAR above the ground, metres."""

TRACKING_KEYS = ("R_rect", "Tr_velo_cam", "Tr_imu_velo")
"""The tracking benchmark's keys of the rectification, of the LIDAR in camera 0, and of the IMU in the LIDAR."""

OBJECT_KEYS = ("R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo")
"""The object benchmark's names of the same three."""


def read_camera(folder: Path, name: str = "image_02") -> Camera:
    """Read the calibration of a camera; image_02 is the left colour camera, image_03 the right one.

    A LIDAR point x appears on the rectified image at K (T_baseline R_rect_00 T_camera0_from_lidar x). Rectified cameras
    look in the same direction and differ by a shift along their x axis, which P_rect_0N stores as fx times metres. Its
    last column also has a z term, 3 mm in KITTI. We ignore it, as pykitti does: beyond 10 m it moves no pixel by more
    than 0.35.

    Parameters
    ----------
    folder : Path
        The folder of a date, which holds calib_cam_to_cam.txt and calib_velo_to_cam.txt.
    name : str
        Name of the folder of its images, "image_00" to "image_03".
    """
    K, T_camera_from_camera0, size = read_rectification(folder / "calib_cam_to_cam.txt", name)
    of_lidar = folder / "calib_velo_to_cam.txt"
    return Camera(K, T_camera_from_camera0 @ read_rigid(of_lidar), size, read_lidar_height(of_lidar))


def read_lidar_height(path: Path) -> float:
    """Return the height of the LIDAR above the ground, metres: KITTI's where the file has none.

    Parameters
    ----------
    path : Path
        A calib_velo_to_cam.txt.

    Raises
    ------
    DataError
        When it isn't one positive number.
    """
    calibration = read_calibration(path)
    if LIDAR_HEIGHT not in calibration:
        return KITTI_LIDAR_HEIGHT
    height = float(entry_of(path, calibration, LIDAR_HEIGHT, (1,))[0])
    if not height > 0:
        raise DataError(path, f"{LIDAR_HEIGHT}: metres above the ground", height)
    return height


def camera_from(
    path: Path,
    K: NDArray,
    T_camera_from_lidar: NDArray,
    size: tuple[int, int],
    lidar_height: float = KITTI_LIDAR_HEIGHT,
) -> Camera:
    """Return the camera that a calibration file describes; an error names the file.

    Parameters
    ----------
    path : Path
        Where the calibration comes from, for the error.
    K, T_camera_from_lidar, size, lidar_height
        The fields of `Camera`: (3, 3) pixels, (4, 4) metres, (h, w) pixels, metres.

    Raises
    ------
    DataError
        When `Camera` raises an error, or the principal point is outside the image.
    """
    height, width = size
    principal_point = np.asarray(K)[:2, 2]
    # `Camera` allows that, because an image may be cropped from a larger one.
    if not ((principal_point >= -0.5) & (principal_point <= (width - 0.5, height - 0.5))).all():
        expected = f"in K a principal point within the image of {width} x {height} pixels"
        raise DataError(path, expected, principal_point.tolist())
    try:
        return Camera(K, T_camera_from_lidar, size, lidar_height)
    except ArgumentError as error:
        name, expected, found = error.args
        raise DataError(path, f"in {name} {expected}", found) from error


def read_rectification(
    path: Path, name: str = "image_02"
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, int]]:
    """Read the calibration of a rectified camera from calib_cam_to_cam.txt.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        Name of the folder of its images, "image_00" to "image_03".

    Returns
    -------
    K : (3, 3) float64
        Intrinsic matrix, pixels.
    T_camera_from_camera0 : (4, 4) float64
        Rigid transform from the unrectified camera 0, metres.
    size : (int, int)
        Height and width, pixels.
    """
    calibration = read_calibration(path)
    number = name.removeprefix("image_")
    K, T_camera_from_rectified = projection(path, calibration, f"P_rect_{number}")
    width, height = entry_of(path, calibration, f"S_rect_{number}", (2,))
    if not (width >= 1 and height >= 1 and width % 1 == 0 and height % 1 == 0):
        raise DataError(path, f"S_rect_{number}: width and height in pixels", [width, height])
    T_rectified_from_camera0 = rigid_transform(_rotation(path, calibration, "R_rect_00"), np.zeros(3))
    camera = camera_from(path, K, T_camera_from_rectified @ T_rectified_from_camera0, (int(height), int(width)))
    return camera.K, camera.T_camera_from_lidar, camera.size


def projection(path: Path, calibration: dict[str, str], key: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Decompose the projection matrix of a rectified camera, K [I | t].

    Parameters
    ----------
    path : Path
        Where the calibration comes from, for the error.
    calibration : dict of str to str
        The values of each key.
    key : str
        The key of the matrix, such as P_rect_02.

    Returns
    -------
    K : (3, 3) float64
        Intrinsic matrix, pixels.
    T_camera_from_rectified : (4, 4) float64
        Shift from the rectified frame of camera 0 along its x axis, metres.
    """
    P = entry_of(path, calibration, key, (3, 4))
    if not (P[0, 0] > 0 and P[1, 1] > 0 and P[1, 0] == 0 and np.array_equal(P[2, :3], [0, 0, 1])):
        raise DataError(path, f"{key} = K [I | t] with K upper triangular, focal lengths above 0", P.tolist())
    return P[:, :3], rigid_transform(np.eye(3), np.array([P[0, 3] / P[0, 0], 0, 0]))


def read_rigid(path: Path) -> NDArray[np.float64]:
    """Read a rigid transform.

    Parameters
    ----------
    path : Path
        calib_velo_to_cam.txt (camera 0 from LIDAR) or calib_imu_to_velo.txt (LIDAR from IMU).

    Returns
    -------
    (4, 4) float64
        Metres.
    """
    calibration = read_calibration(path)
    return rigid_transform(_rotation(path, calibration, "R"), entry_of(path, calibration, "T", (3,)))


def read_calibration(path: Path) -> dict[str, str]:
    """Read a file of lines `key: values`.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict of str to str
        The values of each key, not parsed yet.
    """
    text = read_text(path)
    if not text.endswith("\n"):
        raise DataError(path, "a line end after the last line", f"the end of the file after {text[-20:]!r}")
    entries: dict[str, str] = {}
    for line in text.splitlines():
        key, colon, values = line.partition(":")
        if not colon or key in entries:
            raise DataError(path, "lines `key: values`, each key once", repr(line))
        entries[key] = values
    return entries


def entry_of(path: Path, calibration: dict[str, str], key: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return the numbers of one key in a given shape.

    Parameters
    ----------
    path : Path
        Where the calibration comes from, for the error.
    calibration : dict of str to str
        The values of each key.
    key : str
        The key.
    shape : tuple of int
        Shape of the result.

    Returns
    -------
    (shape) float64
    """
    if key not in calibration:
        raise DataError(path, f"the key {key}", f"the keys {', '.join(calibration)}")
    numbers = parse_numbers(path, calibration[key], key)
    if numbers.size != np.prod(shape):
        raise DataError(path, f"{np.prod(shape)} numbers for {key}", f"{numbers.size}")
    return numbers.reshape(shape)


def _rotation(path: Path, calibration: dict[str, str], key: str) -> NDArray[np.float64]:
    """Return a rotation matrix."""
    return check_rotation(path, entry_of(path, calibration, key, (3, 3)), key)


def check_rotation(path: Path, R: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    """Check that a matrix is a rotation, and return it.

    Parameters
    ----------
    path : Path
        Where the matrix comes from, for the error.
    R : (3, 3) float64
        The matrix.
    what : str
        What the matrix is, for the error.

    Returns
    -------
    (3, 3) float64
        `R` itself.
    """
    if np.abs(R @ R.T - np.eye(3)).max() > ROTATION_TOLERANCE or np.linalg.det(R) < 0:
        raise DataError(path, f"a rotation matrix for {what}", R.tolist())
    return R


class BenchmarkCalibration(NamedTuple):
    """The calibration of the left colour camera, and the poses of the other sensors.

    Parameters
    ----------
    K : (3, 3) float64
        Intrinsic matrix of the left colour camera, pixels.
    T_camera_from_lidar : (4, 4) float64
        From the LIDAR to the left colour camera, metres.
    T_camera0_from_lidar : (4, 4) float64
        From the LIDAR to the rectified camera 0, in whose frame the odometry benchmark gives poses, metres.
    T_lidar_from_imu : (4, 4) float64 or None
        From the IMU to the LIDAR, metres; None in the odometry benchmark.
    """

    K: NDArray[np.float64]
    T_camera_from_lidar: NDArray[np.float64]
    T_camera0_from_lidar: NDArray[np.float64]
    T_lidar_from_imu: NDArray[np.float64] | None


def read_benchmark_calibration(path: Path) -> BenchmarkCalibration:
    """Read the calibration of a sequence.

    The odometry benchmark has the keys P0 to P3 and Tr, the LIDAR in the rectified camera 0. The tracking benchmark has
    P0 to P3, R_rect, Tr_velo_cam (the LIDAR in camera 0 before it is rectified) and Tr_imu_velo, the last three without
    a colon. The object benchmark calls these three R0_rect, Tr_velo_to_cam and Tr_imu_to_velo.

    Parameters
    ----------
    path : Path
        calib.txt of an odometry sequence, or the file of a tracking run.
    """
    entries = _benchmark_entries(path)
    K, T_camera_from_rectified = projection(path, entries, "P2")
    if "Tr" in entries:
        T_camera0_from_lidar = _rigid(path, entries, "Tr")
        T_lidar_from_imu = None
    else:
        rectify, from_lidar, from_imu = OBJECT_KEYS if OBJECT_KEYS[0] in entries else TRACKING_KEYS
        if rectify not in entries:
            expected = f"the key Tr of the odometry benchmark, or {rectify} and {from_lidar} of the tracking benchmark"
            raise DataError(path, expected, ", ".join(entries)[:200] or "no key")
        R = _rotation(path, entries, rectify)
        T_camera0_from_lidar = rigid_transform(R, np.zeros(3)) @ _rigid(path, entries, from_lidar)
        T_lidar_from_imu = _rigid(path, entries, from_imu)
    T_camera_from_lidar = T_camera_from_rectified @ T_camera0_from_lidar
    return BenchmarkCalibration(K, T_camera_from_lidar, T_camera0_from_lidar, T_lidar_from_imu)


def parse_pose(path: Path, text: str, what: str) -> NDArray[np.float64]:
    """Return the rigid transform from twelve numbers, the three upper rows of its matrix.

    Parameters
    ----------
    path : Path
        Where the numbers come from, for the error.
    text : str
        The numbers.
    what : str
        What the transform is, for the error.

    Returns
    -------
    (4, 4) float64
        Metres.
    """
    return _rigid(path, {what: text}, what)


def _benchmark_entries(path: Path) -> dict[str, str]:
    """Return the values of each key; a colon may follow the key."""
    lines = [line.split(maxsplit=1) for line in read_text(path).splitlines() if line.strip()]
    return {key.rstrip(":"): (values[0] if values else "") for key, *values in lines}


def _rigid(path: Path, entries: dict[str, str], key: str) -> NDArray[np.float64]:
    matrix = entry_of(path, entries, key, (3, 4))
    return rigid_transform(check_rotation(path, matrix[:, :3], key), matrix[:, 3])

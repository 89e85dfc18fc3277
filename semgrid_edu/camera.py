"""The pinhole camera and rigid transforms: equation (1) of the paper (section 3.3)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError

KITTI_LIDAR_HEIGHT = 1.73
"""Height of the LIDAR on KITTI's car above the ground, metres (Geiger et al., 2013, figure 1)."""

FOCAL_LENGTHS = (0.01, 100.0)
"""Shortest and longest focal length of a lens, in image widths or heights: angles of view of 178 and 0.6 degrees."""


def rigid_transform(rotation: NDArray, translation: NDArray) -> NDArray[np.float64]:
    """Return the (4, 4) transform of homogeneous column vectors that rotates, then shifts.

    Parameters
    ----------
    rotation : (3, 3) float
        Rotation matrix.
    translation : (3,) float
        Shift, metres.
    """
    T = np.eye(4)
    T[:3, :3] = rotation
    T[:3, 3] = translation
    return T


def invert_rigid(T: NDArray) -> NDArray[np.float64]:
    """Return T_source_from_target, (4, 4), by transposing the rotation.

    Parameters
    ----------
    T : (4, 4) float
        The rigid transform T_target_from_source, metres.
    """
    rotation = T[:3, :3].T
    return rigid_transform(rotation, -rotation @ T[:3, 3])


def transform_points(T_target_from_source: NDArray, points: NDArray) -> NDArray:
    """Move points from one frame to another.

    Parameters
    ----------
    T_target_from_source : (4, 4) float
        Rigid transform, metres.
    points : (..., 3) float
        Points in the source frame, metres.

    Returns
    -------
    (..., 3) float
        The points in the target frame, metres, in the type of `points`.
    """
    T = T_target_from_source.astype(points.dtype)
    return points @ T[:3, :3].T + T[:3, 3]


def lidar_from_grid(lidar_height: float) -> NDArray[np.float64]:
    """Return T_lidar_from_grid, (4, 4): a shift from the ground below the LIDAR; both frames have the same axes.

    Parameters
    ----------
    lidar_height : float
        Height of the LIDAR above the ground, metres.
    """
    return rigid_transform(np.eye(3), np.array([0.0, 0.0, -lidar_height]))


@dataclass(frozen=True, eq=False)
class Camera:
    """A rectified pinhole camera and its pose. In its frame x points right, y down and z ahead.

    Parameters
    ----------
    K : (3, 3) float64
        Intrinsic matrix, pixels. The centre of the first pixel is (0, 0); u runs right, v down.
    T_camera_from_lidar : (4, 4) float64
        Rigid transform from the LIDAR frame to the camera frame, metres.
    size : (int, int)
        Height and width of the image, pixels.
    lidar_height : float
        Height of the LIDAR above the ground, metres.
    """

    K: NDArray[np.float64]
    T_camera_from_lidar: NDArray[np.float64]
    size: tuple[int, int]
    lidar_height: float = KITTI_LIDAR_HEIGHT

    def __post_init__(self) -> None:
        """Reject matrices of the wrong shape, and numbers that no camera has."""
        _check_matrix("K", "a 3x3 intrinsic matrix", self.K, (3, 3))
        _check_matrix("T_camera_from_lidar", "a 4x4 transform", self.T_camera_from_lidar, (4, 4))
        _check_pinhole(self.K, np.array(self.size[::-1]))

    @property
    def T_camera_from_grid(self) -> NDArray[np.float64]:
        """Rigid transform, (4, 4), from the grid frame (on the ground below the LIDAR) to the camera frame."""
        return self.T_camera_from_lidar @ lidar_from_grid(self.lidar_height)

    def same_as(self, other: "Camera") -> bool:
        """Return whether another camera has the same calibration, number for number.

        Parameters
        ----------
        other : Camera
            The camera to compare with.
        """
        matrices = ((self.K, other.K), (self.T_camera_from_lidar, other.T_camera_from_lidar))
        sizes = (self.size, self.lidar_height) == (other.size, other.lidar_height)
        return sizes and all(np.array_equal(one, another) for one, another in matrices)

    def resized(self, size: tuple[int, int]) -> "Camera":
        """Return the camera that would have taken the same picture with another number of pixels.

        Pixel centres are integers, so the image spans -1/2 .. w - 1/2, and scaling it by s moves the principal point to
        c' = (c + 1/2) s - 1/2. Without the halves every projected point would be off by up to half a pixel.

        Parameters
        ----------
        size : (int, int)
            The new height and width, pixels.
        """
        scale_v = size[0] / self.size[0]
        scale_u = size[1] / self.size[1]
        S = np.array([[scale_u, 0, (scale_u - 1) / 2], [0, scale_v, (scale_v - 1) / 2], [0, 0, 1]])
        return replace(self, K=S @ self.K, size=tuple(size))


def _check_matrix(name: str, expected: str, matrix: NDArray, shape: tuple[int, int]) -> None:
    if np.shape(matrix) != shape:
        raise ArgumentError(name, expected, f"shape {np.shape(matrix)}")
    if not np.isfinite(matrix).all():
        raise ArgumentError(name, "finite numbers", np.asarray(matrix).tolist())


def _check_pinhole(K: NDArray, size: NDArray) -> None:
    """Reject focal lengths (pixels) that no lens has, for images of (w, h) pixels."""
    shortest, longest = FOCAL_LENGTHS
    focal_lengths = np.diag(K)[:2]
    if not ((focal_lengths >= shortest * size) & (focal_lengths <= longest * size)).all():
        expected = f"focal lengths of {shortest:g} to {longest:g} times {size[0]} x {size[1]} pixels"
        raise ArgumentError("K", expected, focal_lengths.tolist())


def project(points: NDArray, camera: Camera) -> tuple[NDArray, NDArray[np.bool_]]:
    """Find the pixel of each point: equation (1), (u, v, 1)^T = K (X/Z, Y/Z, 1)^T.

    Parameters
    ----------
    points : (..., 3) float
        X right, Y down, Z ahead in the camera frame, metres.
    camera : Camera
        Its intrinsic matrix and the size of its images are used.

    Returns
    -------
    pixels : (..., 2) float
        u to the right and v down, pixels; NaN for a point that isn't in front of the camera.
    visible : (...) bool
        Whether the point is in front of the camera and projects between the centres of the image's pixels, 0 <= u <= w
        - 1, 0 <= v <= h - 1, where equation (2) can interpolate.

    Examples
    --------
    >>> camera = Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), size=(5, 5))
    >>> project(np.array([[0.3, 0.2, 10.0]]), camera)
    (array([[3., 2.]]), array([ True]))
    """
    points = np.asarray(points)
    if points.shape[-1:] != (3,):
        raise ArgumentError("points", "shape (..., 3): X, Y, Z", f"shape {points.shape}")
    depth = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    pixels = (points @ camera.K.T.astype(points.dtype))[..., :2] / depth[..., None]
    height, width = camera.size
    u = pixels[..., 0]
    v = pixels[..., 1]
    return pixels, (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)

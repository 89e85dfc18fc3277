"""Hidden tests of exercise 05, from grid to pixel: the package's camera and planes are the reference."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_instructor import hidden

AXES = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
"""From the axes of grid and LIDAR to those of the camera."""


def _intrinsics(rng: np.random.Generator) -> NDArray[np.float64]:
    f_u, f_v, c_u, c_v = rng.uniform((80, 150, 100, 40), (140, 220, 200, 90))
    return np.array([[f_u, 0, c_u], [0, f_v, c_v], [0, 0, 1]])


@hidden
def check_crop(new_intrinsics: Callable) -> None:
    """Other cuts, and none on one side."""
    rng = np.random.default_rng(51)
    for left, top in ((17, 4), (0, 31), (25, 0)):
        K = _intrinsics(rng)
        got = np.asarray(new_intrinsics(K.copy(), left, top, 1.0, 1.0))
        assert np.allclose(got[:, :2], K[:, :2]), "a cut changes nothing but the last column"
        assert np.allclose(got[:, 2], K[:, 2] - [left, top, 0]), "wrong principal point after a cut"


@hidden
def check_resize(new_intrinsics: Callable) -> None:
    """Smaller and larger images, cut and uncut."""
    rng = np.random.default_rng(52)
    for size, new_size in (((188, 621), (96, 320)), ((60, 80), (150, 120)), ((50, 50), (10, 50))):
        K = _intrinsics(rng)
        scale_v, scale_u = new_size[0] / size[0], new_size[1] / size[1]
        got = np.asarray(new_intrinsics(K.copy(), 0, 0, scale_u, scale_v))
        expected = Camera(K, np.eye(4), size).resized(new_size).K
        assert np.allclose(got[:2, :2], expected[:2, :2]), "wrong focal lengths after resizing (images can grow, too)"
        assert np.allclose(got, expected), "wrong principal point after resizing (images can grow, too)"
        K[0, 2], K[1, 2] = K[0, 2] + 13, K[1, 2] + 5
        assert np.allclose(new_intrinsics(K, 13, 5, scale_u, scale_v), expected), "wrong after a cut and resizing"


@hidden
def check_now_from_before(now_from_before: Callable) -> None:
    """Random poses in three dimensions; all must lead to one place in the world."""
    rng = np.random.default_rng(53)
    for _ in range(5):
        now, before = (rigid_transform(Rotation.random(rng=rng).as_matrix(), rng.uniform(-50, 50, 3)) for _ in range(2))
        got = np.asarray(now_from_before(now.copy(), before.copy()))
        assert got.shape == (4, 4), f"shape {got.shape} instead of (4, 4)"
        wanted = invert_rigid(now) @ before
        assert np.allclose(got[:3, :3], wanted[:3, :3]), "wrong rotation (a car also pitches and rolls)"
        assert np.allclose(got, wanted), "wrong shift"


def _camera(rng: np.random.Generator) -> Camera:
    """Return a camera that looks ahead, not quite level, at a place of its own."""
    tilt = Rotation.from_rotvec(rng.normal(0, 0.05, 3)).as_matrix()
    return Camera(_intrinsics(rng), rigid_transform(tilt @ AXES, rng.uniform(-0.5, 0.5, 3)), size=(130, 320))


@hidden
def check_plane_pixels(plane_pixels: Callable) -> None:
    """Tilted cameras, planes below and above them, and one point alone."""
    rng = np.random.default_rng(54)
    for height, n_points in ((0.0, 40), (1.2, 1), (3.4, 25)):
        camera, xy = _camera(rng), rng.uniform((3, -12), (60, 12), size=(n_points, 2))
        points = np.column_stack([xy, np.full(n_points, height)])
        wanted, _ = project(transform_points(camera.T_camera_from_grid, points), camera)
        got = plane_pixels(xy.copy(), height, camera.K.copy(), camera.T_camera_from_grid, camera.size)[0]
        assert np.shape(got) == wanted.shape, f"shape {np.shape(got)} instead of {wanted.shape}"
        assert np.allclose(got, wanted), "wrong pixels (no camera is quite level, no pixel quite whole)"


@hidden
def check_visible(plane_pixels: Callable) -> None:
    """Many points all around the camera, several heights; each border of the image, on it and a little beside it."""
    rng = np.random.default_rng(55)
    for height in (0.0, 1.0, 2.6):
        camera, xy = _camera(rng), rng.uniform((-30, -20), (40, 20), size=(600, 2))
        points = np.column_stack([xy, np.full(len(xy), height)])
        wanted, in_view = project(transform_points(camera.T_camera_from_grid, points), camera)
        got, visible = plane_pixels(xy.copy(), height, camera.K.copy(), camera.T_camera_from_grid, camera.size)
        behind = np.isnan(wanted).all(axis=1)
        assert not np.asarray(visible)[behind].any(), "a point behind the camera is called visible"
        assert np.isnan(np.asarray(got, dtype=float)[behind]).all(), "a point behind the camera has a pixel"
        assert np.array_equal(visible, in_view), "wrong at a border of the image"
    _judge_borders(plane_pixels)


def _judge_borders(plane_pixels: Callable) -> None:
    """Walk across the four borders of a small image; powers of two, so that the borders are met without rounding."""
    K = np.array([[64.0, 0, 32], [0, 64, 16], [0, 0, 1]])
    T = rigid_transform(AXES, np.array([0.0, 1.0, 0.0]))
    h, w = 33, 97
    for u in (-0.25, 0, 0.25, w - 1.25, w - 1, w - 0.75):
        visible = plane_pixels(np.array([[8.0, (32 - u) / 8]]), 0.0, K, T, (h, w))[1]
        assert bool(visible[0]) == (0 <= u <= w - 1), "wrong at the left or right border of the image"
    for v in (h - 1.25, h - 1, h - 0.75):
        visible = plane_pixels(np.array([[64 / (v - 16), 0.0]]), 0.0, K, T, (h, w))[1]
        assert bool(visible[0]) == (v <= h - 1), "wrong at the lower border of the image"
    for v in (-0.25, 0, 0.25):
        visible = plane_pixels(np.array([[64 / (16 - v), 0.0]]), 2.0, K, T, (h, w))[1]
        assert bool(visible[0]) == (v >= 0), "wrong at the upper border of the image"


@hidden
def check_lands_at(lands_at: Callable) -> None:
    """Other cameras; the thing and its picture must have one pixel, by equation (1)."""
    rng = np.random.default_rng(56)
    for _ in range(20):
        z_cam, x = rng.uniform(1.0, 3.0), rng.uniform(3, 50)
        z, delta = rng.uniform(0, 0.95, 2) * z_cam
        camera = Camera(_intrinsics(rng), rigid_transform(AXES, np.zeros(3)), (100, 300), lidar_height=z_cam)
        there = np.array([[x, 0, z], [float(lands_at(x, z, z_cam, delta)), 0, delta]])
        (_, v), (_, v_drawn) = project(transform_points(camera.T_camera_from_grid, there), camera)[0]
        assert np.isclose(v, v_drawn), "the thing and the place where it is drawn have different pixels"


@hidden
def check_never(lands_at: Callable) -> None:
    """Rays that climb, rays that run level, planes above the camera."""
    rng = np.random.default_rng(57)
    for _ in range(10):
        z_cam, x = rng.uniform(1.0, 2.0), rng.uniform(3, 50)
        (z_low, delta_low), (z_high, delta_high) = rng.uniform(0, 0.9, 2) * z_cam, z_cam + rng.uniform(0.1, 2, 2)
        for z, delta in ((z_low, delta_high), (z_high, delta_low)):
            assert np.isnan(lands_at(x, z, z_cam, delta)), "the ray never meets the plane, and yet there is a place"
        wanted = x * (delta_high - z_cam) / (z_high - z_cam)
        assert np.isclose(lands_at(x, z_high, z_cam, delta_high), wanted), "wrong for a plane above the camera"
        assert np.isnan(lands_at(x, z_cam, z_cam, delta_low)), "a level ray meets no other plane: NaN"


@hidden
def check_reach(reach: Callable) -> None:
    """At the depth returned, width times height must be one pixel; planes below and above the camera."""
    rng = np.random.default_rng(58)
    for below in (True, False, True, False):
        cell, f_u, f_v, z_cam = rng.uniform((0.1, 90, 150, 1.2), (0.9, 140, 800, 3.0))
        delta = z_cam * rng.uniform(0.1, 0.9) if below else z_cam + rng.uniform(0.1, 2.0)
        Z = reach(cell, f_u, f_v, z_cam, delta)
        pixels = f_u * cell / Z * (f_v * abs(z_cam - delta) * cell / Z**2)
        where = "below" if below else "above"
        assert np.isclose(pixels, 1), f"the cell isn't one pixel there (a plane {where} the camera)"

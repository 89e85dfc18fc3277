"""Hidden tests of exercise 05, from grid to pixel: the package's camera and planes are the reference."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.answers import answer_array, answer_number
from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_instructor import close, generator, hidden, keeping

AXES = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
"""From the axes of grid and LIDAR to those of the camera."""


def _intrinsics(rng: np.random.Generator) -> NDArray[np.float64]:
    f_u, f_v, c_u, c_v = rng.uniform((80, 150, 100, 40), (140, 220, 200, 90))
    return np.array([[f_u, 0, c_u], [0, f_v, c_v], [0, 0, 1]])


@hidden
@keeping
def check_crop(new_intrinsics: Callable) -> None:
    """Other cuts, and none on one side."""
    rng = generator(51)
    for left, top in ((17, 4), (0, 31), (25, 0)):
        K = _intrinsics(rng)
        got = answer_array(new_intrinsics(K.copy(), left, top, 1.0, 1.0))
        assert close(got[:, :2], K[:, :2]), "a cut changes nothing but the last column"
        cut, half = K[:, 2] - [left, top, 0], np.array([0.5, 0.5, 0])  # half: a matter of check_resize
        right = any(close(got[:, 2], cut + off) for off in (0 * half, half, -half))
        assert right, "wrong principal point after a cut"


@hidden
def check_resize(new_intrinsics: Callable) -> None:
    """Smaller and larger images, cut and uncut."""
    rng = generator(52)
    for size, new_size in (((188, 621), (96, 320)), ((60, 80), (150, 120)), ((50, 50), (10, 50))):
        K = np.round(_intrinsics(rng))  # rounding before the resize is a matter of the cut, which check_crop judges
        scale_v, scale_u = new_size[0] / size[0], new_size[1] / size[1]
        got = answer_array(new_intrinsics(K.copy(), 0, 0, scale_u, scale_v))
        expected = Camera(K, np.eye(4), size).resized(new_size).K
        assert close(got[:2, :2], expected[:2, :2]), "wrong focal lengths after resizing (images can grow, too)"
        assert close(got, expected), "wrong principal point after resizing (images can grow, too)"
        cut = answer_array(new_intrinsics(K.copy(), 13, 5, 1.0, 1.0))
        both = answer_array(new_intrinsics(K.copy(), 13, 5, scale_u, scale_v))
        then_resized = answer_array(new_intrinsics(cut, 0, 0, scale_u, scale_v))
        assert close(both, then_resized), "wrong after a cut and resizing"


@hidden
def check_now_from_before(now_from_before: Callable) -> None:
    """Random poses in three dimensions; all must lead to one place in the world."""
    rng = generator(53)
    for _ in range(5):
        now, before = (rigid_transform(Rotation.random(rng=rng).as_matrix(), rng.uniform(-50, 50, 3)) for _ in range(2))
        got = answer_array(now_from_before(now.copy(), before.copy()))
        assert got.shape == (4, 4), f"shape {got.shape} instead of (4, 4)"
        wanted = invert_rigid(now) @ before
        assert close(got[:3, :3], wanted[:3, :3]), "wrong rotation (a car also pitches and rolls)"
        assert close(got, wanted), "wrong shift"


def _camera(rng: np.random.Generator) -> Camera:
    """Return a camera that looks ahead, not quite level, at a place of its own."""
    tilt = Rotation.from_rotvec(rng.normal(0, 0.05, 3)).as_matrix()
    return Camera(_intrinsics(rng), rigid_transform(tilt @ AXES, rng.uniform(-0.5, 0.5, 3)), size=(130, 320))


def _seen_from(camera: Camera, xy: NDArray, height: float) -> tuple[NDArray, NDArray, NDArray]:
    """Return depths (N,), pixels (N, 2) and which of them are in view (N,), for points of a plane."""
    points = transform_points(camera.T_camera_from_grid, np.column_stack([xy, np.full(len(xy), height)]))
    return points[:, 2], *project(points, camera)


def _judge_pixels(plane_pixels: Callable, camera: Camera, xy: NDArray, height: float, complaint: str) -> None:
    """Compare pixels within the image; those of other points are what check_visible judges."""
    _, wanted, in_view = _seen_from(camera, xy, height)
    got = answer_array(plane_pixels(xy.copy(), height, camera.K.copy(), camera.T_camera_from_grid, camera.size)[0])
    assert got.shape == wanted.shape, f"shape {got.shape} instead of {wanted.shape}"
    assert close(got[in_view], wanted[in_view]), complaint


@hidden
def check_plane_pixels(plane_pixels: Callable) -> None:
    """Tilted cameras, planes below and above them, and one point alone; then a camera with a skew."""
    rng = generator(54)
    for height, n_points in ((0.0, 40), (1.2, 1), (3.4, 25)):
        camera, xy = _camera(rng), rng.uniform((3, -12), (60, 12), size=(n_points, 2))
        if n_points == 1:
            xy = rng.uniform((10, -1), (20, 1), size=(1, 2))
        wrong = "wrong pixels (no camera is quite level, no pixel quite whole)"
        _judge_pixels(plane_pixels, camera, xy, height, wrong)
    camera.K[0, 1] = rng.uniform(5, 10)
    skewed = "wrong where K[0, 1] isn't 0: u = (f_u X + K[0, 1] Y) / Z + c_u, so multiply by the whole K"
    _judge_pixels(plane_pixels, camera, xy, height, skewed)


@hidden
def check_visible(plane_pixels: Callable) -> None:
    """Many points all around the camera, several heights; each border of the image, on it and a little beside it.

    What is visible goes by the pixels that the answer itself found, and behind is what lies well behind, whatever the
    answer makes of height and shift: check_plane_pixels judges those.
    """
    rng = generator(55)
    for height in (0.0, 1.0, 2.6):
        camera, xy = _camera(rng), rng.uniform((-30, -20), (40, 20), size=(600, 2))
        Z, _, _ = _seen_from(camera, xy, height)
        got, visible = plane_pixels(xy.copy(), height, camera.K.copy(), camera.T_camera_from_grid, camera.size)
        pixels, visible = answer_array(got), answer_array(visible, dtype=bool)
        assert not visible[Z < -8].any(), "a point behind the camera is called visible"
        assert np.isnan(pixels[Z < -8]).all(), "a point behind the camera has a pixel"
        assert np.isfinite(pixels[Z > 8]).all(), "a point in front of the camera, but beside the image, has no pixel"
        assert np.ptp(pixels[Z > 8], axis=0).min() > 0, "all points have the same row or column"
        assert np.array_equal(visible, _within(pixels, camera.size)), "wrong at a border of the image"
    _judge_borders(plane_pixels)


def _within(pixels: NDArray, size: tuple[int, int]) -> NDArray:
    """Return which pixels lie among the centres of the image's, (N,)."""
    return ((pixels >= 0) & (pixels <= np.array(size)[::-1] - 1)).all(axis=1)


def _judge_borders(plane_pixels: Callable) -> None:
    """Walk across the four borders of a small image; powers of two, so that the borders are met without rounding."""
    K = np.array([[64.0, 0, 32], [0, 64, 16], [0, 0, 1]])
    T, size = rigid_transform(AXES, np.array([0.0, 1.0, 0.0])), (33, 97)
    h, w = size
    borders = {"left or right": [((8.0, (32 - u) / 8), 0.0) for u in (-0.25, 0, 0.25, w - 1.25, w - 1, w - 0.75)]}
    borders["lower"] = [((64 / (v - 16), 0.0), 0.0) for v in (h - 1.25, h - 1, h - 0.75)]
    borders["upper"] = [((64 / (16 - v), 0.0), 2.0) for v in (-0.25, 0, 0.25)]
    for border, places in borders.items():
        for xy, height in places:
            got, visible = plane_pixels(np.array([xy]), height, K, T, size)
            right = np.array_equal(answer_array(visible, dtype=bool), _within(answer_array(got), size))
            assert right, f"wrong at the {border} border of the image"
    near, behind = answer_array(plane_pixels(np.array([[0.25, 0.0], [-0.25, 0.0]]), 0.5, K, T, size)[0])
    assert np.isfinite(near).all(), "a point 0.25 m in front of the camera has no pixel (Z > 0 is all it takes)"
    assert np.isnan(behind).all(), "a point 0.25 m behind the camera has a pixel"


@hidden
def check_lands_at(lands_at: Callable) -> None:
    """Other cameras, planes also below the ground; the thing and its picture must have one pixel, by equation (1)."""
    rng = generator(56)
    for share in rng.uniform(-0.3, 0.95, size=20):
        z_cam, x = rng.uniform(1.0, 3.0), rng.uniform(3, 50)
        z, delta = rng.uniform(0, 0.95) * z_cam, share * z_cam
        camera = Camera(_intrinsics(rng), rigid_transform(AXES, np.zeros(3)), (100, 300), lidar_height=z_cam)
        there = np.array([[x, 0, z], [answer_number(lands_at(x, z, z_cam, delta)), 0, delta]])
        (_, v), (_, v_drawn) = project(transform_points(camera.T_camera_from_grid, there), camera)[0]
        assert close(v, v_drawn), "the thing and the place where it is drawn have different pixels"


@hidden
def check_never(lands_at: Callable) -> None:
    """Rays that climb, rays that run level, planes above the camera."""
    rng = generator(57)
    for _ in range(10):
        z_cam, x = rng.uniform(1.0, 2.0), rng.uniform(3, 50)
        (z_low, delta_low), (z_high, delta_high) = rng.uniform(0, 0.9, 2) * z_cam, z_cam + rng.uniform(0.1, 2, 2)
        for z, delta in ((z_low, delta_high), (z_high, delta_low)):
            drawn = answer_number(lands_at(x, z, z_cam, delta))
            assert np.isnan(drawn), "the ray never meets the plane, and yet there is a place"
        wanted = x * (delta_high - z_cam) / (z_high - z_cam)
        above = answer_number(lands_at(x, z_high, z_cam, delta_high))
        mirrored = answer_number(lands_at(x, 2 * z_cam - z_high, z_cam, 2 * z_cam - delta_high))
        right_below = close(mirrored, wanted)  # check_lands_at judges those below the camera
        assert close(above, wanted) or not right_below, "wrong for a plane above the camera"
        assert not np.isnan(above), "never, for a plane above the camera that the ray does meet"
        level = answer_number(lands_at(x, z_cam, z_cam, delta_low))
        assert np.isnan(level), "a level ray meets no other plane: NaN"


@hidden
def check_reach(reach: Callable) -> None:
    """At the depth returned, width times height must be one pixel; planes on all sides of the camera; far away."""
    rng = generator(58)
    for where in ("below the camera", "above the camera", "below the ground", "far away"):
        cell, f_u, f_v, z_cam = rng.uniform((0.1, 90, 150, 1.2), (0.9, 140, 800, 3.0))
        share = {"above the camera": (1.1, 2.0), "below the ground": (-0.5, -0.1)}.get(where, (0.1, 0.9))
        delta = z_cam * rng.uniform(*share)
        if where == "far away":
            cell, f_u, f_v = 2.0, 10 * f_u, 10 * f_v
        Z = answer_number(reach(cell, f_u, f_v, z_cam, delta))
        pixels = f_u * cell / Z * (f_v * abs(z_cam - delta) * cell / Z**2)
        how = "a depth of hundreds of metres" if where == "far away" else f"a plane {where}"
        assert close(pixels, 1, rtol=1e-4), f"the cell isn't one pixel there ({how})"

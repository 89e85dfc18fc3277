"""Hidden tests of exercise 05, from grid to pixel: the package's camera and planes are the reference."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.answers import answer_array
from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_instructor import close, generator, hidden, keeping

AXES = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
"""From the axes of grid and LIDAR to those of the camera."""


def _intrinsics(rng: np.random.Generator) -> NDArray[np.float64]:
    f_u, f_v, c_u, c_v = rng.uniform((80, 150, 100, 40), (140, 220, 200, 90))
    return np.array([[f_u, 0, c_u], [0, f_v, c_v], [0, 0, 1]])


def _cut_and_resized(rng: np.random.Generator) -> tuple[NDArray, NDArray, NDArray]:
    """Return K, K_new, and what was done in between: left, top, scale_u, scale_v; images can grow, and get borders."""
    K, done = _intrinsics(rng), rng.uniform((-20, -15, 0.2, 0.2), (60, 40, 2.5, 2.5))
    left, top, scale_u, scale_v = done
    cut = np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])
    resize = np.array([[scale_u, 0, (scale_u - 1) / 2], [0, scale_v, (scale_v - 1) / 2], [0, 0, 1]])
    return K, resize @ cut @ K, done


@hidden
@keeping
def check_scales(what_was_done: Callable) -> None:
    """Judge smaller and larger images, cut and with a border."""
    rng = generator(51)
    for _ in range(6):
        K, K_new, done = _cut_and_resized(rng)
        got = answer_array(what_was_done(K, K_new)).ravel()
        assert got.shape == (4,), f"{got.size} numbers instead of four"
        assert close(got[2:], done[2:]), "wrong scales (images can grow, too)"


@hidden
def check_cut(what_was_done: Callable) -> None:
    """Judge cuts and borders, in images that shrink and grow."""
    rng = generator(52)
    for _ in range(10):
        K, K_new, done = _cut_and_resized(rng)
        got = answer_array(what_was_done(K.copy(), K_new.copy())).ravel()
        assert got.shape == (4,), f"{got.size} numbers instead of four"
        assert close(got[:2], done[:2], atol=1e-4), (
            "wrong cut (a negative one adds a border; cuts need not be whole pixels)"
        )


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


def _seen_from(camera: Camera, xy: NDArray, z: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return depths (N,), pixels (N, 2) and which of them are in view (N,), for points of a road."""
    points = transform_points(camera.T_camera_from_grid, np.column_stack([xy, z]))
    return points[:, 2], *project(points, camera)


def _judge_pixels(road_pixels: Callable, camera: Camera, xy: NDArray, z: NDArray, complaint: str) -> None:
    """Compare pixels within the image; those of other points are what check_visible judges."""
    _, wanted, in_view = _seen_from(camera, xy, z)
    got = answer_array(road_pixels(xy.copy(), z.copy(), camera.K.copy(), camera.T_camera_from_grid, camera.size)[0])
    assert got.shape == wanted.shape, f"shape {got.shape} instead of {wanted.shape}"
    assert close(got[in_view], wanted[in_view]), complaint


@hidden
def check_road_pixels(road_pixels: Callable) -> None:
    """Tilted cameras, roads below and above them, and one point alone; then a camera with a skew."""
    rng = generator(54)
    for height, n_points in ((0.0, 40), (1.2, 1), (3.4, 25)):
        camera, xy = _camera(rng), rng.uniform((3, -12), (60, 12), size=(n_points, 2))
        if n_points == 1:
            xy = rng.uniform((10, -1), (20, 1), size=(1, 2))
        z = height + rng.uniform(-0.4, 0.4, n_points)
        wrong = "wrong pixels (no camera is quite level, no pixel quite whole)"
        _judge_pixels(road_pixels, camera, xy, z, wrong)
    camera.K[0, 1] = rng.uniform(5, 10)
    skewed = "wrong where K[0, 1] isn't 0: u = (f_u X + K[0, 1] Y) / Z + c_u, so multiply by the whole K"
    _judge_pixels(road_pixels, camera, xy, z, skewed)


@hidden
def check_visible(road_pixels: Callable) -> None:
    """Many points all around the camera, several heights; each border of the image, on it and a little beside it.

    What is visible goes by the pixels that the answer itself found, and behind is what lies well behind, whatever the
    answer makes of height and shift: check_road_pixels judges those.
    """
    rng = generator(55)
    for height in (0.0, 1.0, 2.6):
        camera, xy = _camera(rng), rng.uniform((-30, -20), (40, 20), size=(600, 2))
        z = height + rng.uniform(-0.4, 0.4, len(xy))
        Z, _, _ = _seen_from(camera, xy, z)
        got, visible = road_pixels(xy.copy(), z.copy(), camera.K.copy(), camera.T_camera_from_grid, camera.size)
        pixels, visible = answer_array(got), answer_array(visible, dtype=bool)
        assert not visible[Z < -8].any(), "a point behind the camera is called visible"
        assert np.isnan(pixels[Z < -8]).all(), "a point behind the camera has a pixel"
        assert np.isfinite(pixels[Z > 8]).all(), "a point in front of the camera, but beside the image, has no pixel"
        assert np.ptp(pixels[Z > 8], axis=0).min() > 0, "all points have the same row or column"
        assert np.array_equal(visible, _within(pixels, camera.size)), "wrong at a border of the image"
    _judge_borders(road_pixels)


def _within(pixels: NDArray, size: tuple[int, int]) -> NDArray:
    """Return which pixels lie among the centres of the image's, (N,)."""
    return ((pixels >= 0) & (pixels <= np.array(size)[::-1] - 1)).all(axis=1)


def _judge_borders(road_pixels: Callable) -> None:
    """Walk across the four borders of a small image; powers of two, so that the borders are met without rounding."""
    K = np.array([[64.0, 0, 32], [0, 64, 16], [0, 0, 1]])
    T, size = rigid_transform(AXES, np.array([0.0, 1.0, 0.0])), (33, 97)
    h, w = size
    borders = {
        "left or right": [
            ((8.0, (32 - u) / 8), 0.0)
            for u in (-0.25, -0.0625, 0, 0.0625, 0.25, w - 1.25, w - 1.0625, w - 1, w - 0.9375, w - 0.75)
        ]
    }
    borders["lower"] = [((64 / (v - 16), 0.0), 0.0) for v in (h - 1.25, h - 1, h - 0.9375, h - 0.75)]
    borders["upper"] = [((64 / (16 - v), 0.0), 2.0) for v in (-0.25, -0.0625, 0, 0.25)]
    for border, places in borders.items():
        for xy, height in places:
            got, visible = road_pixels(np.array([xy]), np.array([height]), K, T, size)
            right = np.array_equal(answer_array(visible, dtype=bool), _within(answer_array(got), size))
            assert right, f"wrong at the {border} border of the image"
    lone = np.array([[0.0625, 0.0], [0.25, 0.0], [-0.0625, 0.0], [-0.25, 0.0], [5000.0, 0.0]])
    closest, near, just, behind, far = answer_array(road_pixels(lone, np.full(5, 0.5), K, T, size)[0])
    assert np.isfinite([near, closest]).all(), (
        "a point just in front of the camera has no pixel (Z > 0 is all it takes)"
    )
    assert np.isnan([behind, just]).all(), "a point just behind the camera has a pixel"
    assert np.isfinite(far).all(), "a point 5 km ahead has no pixel (Z > 0 is all it takes)"


@hidden
@keeping
def check_heights_of(heights_of: Callable) -> None:
    """Other cameras, planes also below the ground and above the camera: thing and picture must have one pixel."""
    rng = generator(56)
    for low, high in ((-0.3, 0.9), (1.1, 2.0)):
        z_cam, n = rng.uniform(1.0, 3.0), 12
        delta = z_cam * rng.uniform(low, high)
        x, x_drawn = rng.uniform(3, 50, size=(2, n))
        z = answer_array(heights_of(x, x_drawn, z_cam, delta))
        assert z.shape == (n,), f"shape {z.shape} instead of {(n,)}"
        camera = Camera(_intrinsics(rng), rigid_transform(AXES, np.zeros(3)), (100, 300), lidar_height=z_cam)
        there = np.stack([np.stack([a, 0 * a, b], axis=1) for a, b in ((x, z), (x_drawn, np.full(n, delta)))])
        seen, drawn = project(transform_points(camera.T_camera_from_grid, there), camera)[0]
        assert close(seen, drawn, atol=1e-3), "the thing and the place where it is drawn have different pixels"


@hidden
@keeping
def check_impossible(heights_of: Callable) -> None:
    """Judge what is drawn nowhere, at the camera or behind it; the others must have what they have alone."""
    rng = generator(57)
    for n in (1, 9):
        x, x_drawn = rng.uniform(3, 50, size=(2, n))
        alone = answer_array(heights_of(x, x_drawn, 1.5, 0.3))
        assert alone.shape == (n,), f"shape {alone.shape} instead of {(n,)}"
        assert np.isfinite(alone).all(), "NaN where a height is possible"
        assert n == 1 or np.ptp(alone) > 0, "all have the same height"
        never = np.concatenate([x_drawn, [np.nan, 0.0, -1e-3, -40.0]])
        got = answer_array(heights_of(np.concatenate([x, [5.0, 9.0, 8.0, 30.0]]), never, 1.5, 0.3))
        assert close(got[:n], alone), "other heights beside what is drawn nowhere"
        assert np.isnan(got[n:]).all(), "a height for what is drawn nowhere, at the camera or behind it"


def _faults(rng: np.random.Generator) -> list[tuple[tuple, int, float]]:
    """Return what is given, the fault and the amount: each fault twice, with pixels a tenth of a pixel wrong."""
    cases = []
    for fault in (0, 1, 2, 3) * 2:
        camera, amount = _camera(rng), rng.choice([-1, 1]) * rng.uniform(0.4, 1.8)
        x = rng.uniform(5, 30, 200)
        points = np.stack([x, x * rng.uniform(-0.7, 0.7, 200), rng.uniform(-1.7, 2.0, 200)], axis=1)
        K, T = camera.K, camera.T_camera_from_lidar
        turn = Rotation.from_euler("x" if fault == 1 else "y", amount, degrees=True).as_matrix()
        K_true = K - amount * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]]) if fault == 0 else K
        T_true = rigid_transform(turn, np.zeros(3)) @ T if fault in (1, 2) else T
        seen = transform_points(T_true, points) @ K_true.T
        pixels = seen[:, :2] / seen[:, 2:] + rng.normal(0, 0.1, (200, 2))
        cases.append(((points, pixels, K, invert_rigid(T) if fault == 3 else T), fault, 0.0 if fault == 3 else amount))
    return cases


@hidden
@keeping
def check_fault(find_fault: Callable) -> None:
    """Judge the kind of fault, with pixels that are not quite right."""
    for given, fault, _ in _faults(generator(58)):
        got = answer_array(find_fault(*given)).ravel()
        assert got.shape == (2,), f"{got.size} numbers instead of two"
        assert got[0] == fault, "the wrong fault (clicks are a tenth of a pixel wrong; a yaw looks nearly like a shift)"


@hidden
@keeping
def check_amount(find_fault: Callable) -> None:
    """Judge the amount of the fault."""
    for given, _, amount in _faults(generator(59)):
        got = answer_array(find_fault(*given)).ravel()
        assert got.shape == (2,), f"{got.size} numbers instead of two"
        assert close(got[1], amount, rtol=0, atol=0.05), "the wrong amount"

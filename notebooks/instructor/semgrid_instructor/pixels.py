"""Hidden tests of exercise 05, from grid to pixel: the package's camera and planes are the reference."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.workshop.course.answers import answer_array
from semgrid_instructor import close, generator, hidden, in_any_order, keeping

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
        assert got.shape == (4,), "not four numbers"
        assert close(got[2:], done[2:]), "wrong scales (images can grow, too)"


@hidden
def check_cut(what_was_done: Callable) -> None:
    """Judge cuts and borders, in images that shrink and grow."""
    rng = generator(52)
    for _ in range(10):
        K, K_new, done = _cut_and_resized(rng)
        got = answer_array(what_was_done(K.copy(), K_new.copy())).ravel()
        assert got.shape == (4,), "not four numbers"
        assert close(got[:2], done[:2], atol=1e-4), (
            "wrong cut (a negative one adds a border; cuts need not be whole pixels)"
        )


@hidden
def check_camera_from_before(camera_from_before: Callable) -> None:
    """Random poses in three dimensions; all must lead to one place in the world."""
    rng = generator(53)
    for _ in range(5):
        given = tuple(rigid_transform(Rotation.random(rng=rng).as_matrix(), rng.uniform(-50, 50, 3)) for _ in range(3))
        got = answer_array(camera_from_before(*(T.copy() for T in given)))
        assert got.shape == (4, 4), "another shape"
        wanted = given[0] @ invert_rigid(given[1]) @ given[2]
        assert close(got[:3, :3], wanted[:3, :3]), "wrong rotation (a car also pitches and rolls)"
        assert close(got, wanted), "wrong shift"


def _camera(rng: np.random.Generator) -> Camera:
    """Return a camera that looks ahead, not quite level, at a place of its own."""
    tilt = Rotation.from_rotvec(rng.normal(0, 0.05, 3)).as_matrix()
    return Camera(_intrinsics(rng), rigid_transform(tilt @ AXES, rng.uniform(-0.5, 0.5, 3)), size=(130, 320))


def _first_walls(x: NDArray, top: NDArray, z_cam: float, delta: float) -> tuple[list[int], float]:
    """Return the first wall on each cell's ray, up to a millimetre below it, and by how much it was decided."""
    firsts, closest = [], np.inf
    for goal in x:
        sinks = (z_cam - delta) / goal
        above = top + 0.001 - (z_cam - sinks * x)
        closest = min(closest, np.abs(above).min())
        firsts.append(next((wall for wall, height in enumerate(above) if height > 0), len(x)))
    return firsts, closest


def _row(rng: np.random.Generator) -> tuple[NDArray, NDArray, float]:
    """Return x, top and z_cam of a road that rises or falls, with things on it, some higher than the camera."""
    n, z_cam = int(rng.integers(1, 13)), rng.uniform(1.0, 2.5)
    x = np.sort(rng.uniform(3, 60, n))
    return x, rng.uniform(-0.02, 0.01) * x + np.where(rng.random(n) < 0.3, rng.uniform(0, 3, n), 0), z_cam


@hidden
@keeping
def check_shown(shown: Callable) -> None:
    """Judge roads that rise and fall, things of all heights, planes below the ground, at a top, above the camera."""
    rng, judged = generator(54), 0
    while judged < 30:
        (x, top, z_cam), delta = _row(rng), rng.uniform(-1.2, 3.0)
        if judged % 3 == 0:  # a plane at the top of a wall
            delta = top[judged % len(x)]
        wanted, closest = _first_walls(x, top, z_cam, delta)
        if closest < 1e-4:
            continue
        judged += 1
        got = answer_array(shown(x, top, z_cam, delta))
        assert got.shape == (len(x),), "another shape"
        which = "above" if delta > z_cam else "below"
        assert np.array_equal(got, wanted), (
            "a wrong wall, on a plane " + which + " the camera (walls may be higher than it, rays may end at a top)"
        )


@hidden
@keeping
def check_best_plane(best_plane: Callable) -> None:
    """Judge planes in no order; where several are equally good it must be the first."""
    rng, judged = generator(55), 0
    while judged < 20:
        (x, top, z_cam), heights = _row(rng), rng.permutation(np.linspace(-1.1, 0.7, 10))
        found = [_first_walls(x, top, z_cam, delta) for delta in heights]
        in_place = [np.sum(np.array(walls) == np.arange(len(x))) for walls, _ in found]
        if min(closest for _, closest in found) < 1e-4 or len(x) < 3:
            continue
        judged += 1
        got = answer_array(best_plane(x, top, z_cam, heights)).ravel()
        assert got.shape == (1,), "not one number"
        assert got[0] in range(10), "it isn't the number of a plane"
        assert in_place[int(got[0])] == max(in_place), "another plane shows more cells in place"
        assert got[0] == np.argmax(in_place), "an earlier plane is as good"


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
        assert z.shape == (n,), "another shape"
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
        assert alone.shape == (n,), "another shape"
        assert np.isfinite(alone).all(), "NaN where a height is possible"
        assert n == 1 or np.ptp(alone) > 0, "all have the same height"
        others = (x, x_drawn, 1.5, 0.6), (x, x_drawn + 1, 1.5, 0.3), (x, x_drawn, 1.9, 0.3)
        assert not any(close(alone, answer_array(heights_of(*one))) for one in others), "the same for another plane"
        never = np.concatenate([x_drawn, [np.nan, 0.0, -1e-3, -40.0]])
        got = answer_array(heights_of(np.concatenate([x, [5.0, 9.0, 8.0, 30.0]]), never, 1.5, 0.3))
        assert close(got[:n], alone), "other heights beside what is drawn nowhere"
        assert np.isnan(got[n:]).all(), "a height for what is drawn nowhere, at the camera or behind it"


def _faults(rng: np.random.Generator, least: float, noise: float) -> list[tuple[tuple, int, float]]:
    """Return what is given, the fault and the amount, at least so large: each fault twice, pixels with noise."""
    cases = []
    for fault in (0, 1, 2, 3) * 2:
        camera, amount = _camera(rng), rng.choice([-1, 1]) * round(rng.uniform(least, 1.8), 2)
        x = rng.uniform(5, 30, 200)
        points = np.stack([x, x * rng.uniform(-0.7, 0.7, 200), rng.uniform(-1.7, 2.0, 200)], axis=1)
        K, T = camera.K, camera.T_camera_from_lidar
        turn = Rotation.from_euler("x" if fault == 1 else "y", amount, degrees=True).as_matrix()
        K_true = K - amount * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]]) if fault == 0 else K
        T_true = rigid_transform(turn, np.zeros(3)) @ T if fault in (1, 2) else T
        seen = transform_points(T_true, points) @ K_true.T
        pixels = seen[:, :2] / seen[:, 2:] + rng.normal(0, noise, (200, 2))
        cases.append(((points, pixels, K, invert_rigid(T) if fault == 3 else T), fault, 0.0 if fault == 3 else amount))
    return cases


@hidden
@keeping
def check_fault(find_fault: Callable) -> None:
    """Judge the kind of fault, with pixels that are not quite right."""
    for given, fault, _ in in_any_order(_faults(generator(58), least=0.4, noise=0.1)):
        got = answer_array(find_fault(*given)).ravel()
        assert got.shape == (2,), "not two numbers"
        assert got[0] == fault, "the wrong fault (clicks are a tenth of a pixel wrong; a yaw looks nearly like a shift)"


@hidden
@keeping
def check_amount(find_fault: Callable) -> None:
    """Judge the amount of the fault: where clicks are exact, one per cent off is three times what is allowed."""
    for least, noise, allowed in ((0.4, 0.1, 0.05), (1.2, 0, 0.004)):
        for given, _, amount in in_any_order(_faults(generator(59), least, noise)):
            got = answer_array(find_fault(*given)).ravel()
            assert got.shape == (2,), "not two numbers"
            assert close(got[1], amount, rtol=0, atol=allowed), "the wrong amount"

"""Hidden tests of exercise 09, where truth comes from: the package, scipy and definitions are the reference."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing
from scipy.spatial.transform import Rotation

from semgrid_edu.answers import answer_array
from semgrid_edu.camera import Camera, project, rigid_transform, transform_points
from semgrid_edu.labels import KITTI_14
from semgrid_instructor import close, generator, hidden


@hidden
def check_depth_picture(depth_picture: Callable) -> None:
    """Other cameras with unequal focal lengths and a skew, crowded pixels, no point at all; near, far, on a border."""
    for seed, (size, n) in enumerate((((9, 5), 400), ((3, 20), 60), ((4, 4), 0))):
        rng = generator(90 + seed)
        K = np.array([[11.0 + seed, rng.uniform(2, 4), size[1] / 2], [0, 7.0, size[0] / 3], [0, 0, 1]])
        points = rng.uniform((-9, -5, -3), (9, 5, 25), (n, 3))
        got = answer_array(depth_picture(points.copy(), K.copy(), size))
        assert got.shape == size, f"shape {got.shape} instead of {size}"
        pixels, seen = project(points, Camera(K, np.eye(4), size))
        wanted = np.full(size, np.inf)
        u, v = np.rint(pixels[seen]).astype(int).T
        np.minimum.at(wanted, (v, u), points[seen, 2])
        wanted[np.isinf(wanted)] = np.nan
        assert np.array_equal(np.isnan(got), np.isnan(wanted)), "other pixels have a depth, with other focal lengths"
        assert close(got, wanted, equal_nan=True), "other depths, where many returns share a pixel"
    K, depths = np.array([[4.0, 0, 4], [0, 4, 2], [0, 0, 1]]), np.array([0.25, 2.0, 64.0, 512.0])
    pixels = np.array([[0, 0], [8, 4], [0, 4], [8, 0]])  # u, v: the corners of an image of 5 x 9 pixels
    points = np.column_stack([(pixels - [4, 2]) / 4 * depths[:, None], depths])  # powers of two: nothing is rounded
    got = answer_array(depth_picture(points, K, (5, 9)))
    wanted = np.full((5, 9), np.nan)
    wanted[pixels[:, 1], pixels[:, 0]] = depths
    where = "on a border (limits included), a quarter of a metre or hundreds of metres away"
    assert close(got, wanted, equal_nan=True), f"a return is missing or wrong {where}"


@hidden
def check_count_votes(count_votes: Callable) -> None:
    """Many cells, all classes, ties, no return at all."""
    for seed, (n, n_cells) in enumerate(((900, 150), (40, 60), (0, 5))):
        rng = generator(95 + seed)
        cells, classes = rng.integers(0, n_cells, n), rng.choice([*range(10), 0, 1, 2, 0, 255], n)
        got = answer_array(count_votes(cells.copy(), classes.copy(), n_cells))
        assert got.shape == (n_cells,), f"shape {got.shape} instead of {(n_cells,)}"
        kept = (classes != 255) & (classes != KITTI_14.index("sky"))
        votes = np.zeros((len(KITTI_14), n_cells), int)
        np.add.at(votes, (classes[kept], cells[kept]), 1)
        wanted = KITTI_14.most_voted(votes, otherwise=255)
        assert np.array_equal(got == 255, wanted == 255), "other cells have a label"
        assert np.array_equal(got, wanted), "another class wins in a cell with several"


@hidden
def check_close_mask(close_mask: Callable) -> None:
    """Other reaches, things at every edge, an empty and a full mask."""
    for seed, (shape, reach, density) in enumerate(
        (((12, 9), 2, 0.2), ((7, 15), 3, 0.05), ((5, 6), 1, 0.0), ((4, 7), 2, 1.0), ((6, 6), 1, 0.5))
    ):
        mask = generator(100 + seed).random(shape) < density
        got = answer_array(close_mask(mask.copy(), reach), dtype=bool)
        assert got.shape == shape, f"shape {got.shape} instead of {shape}"
        side = np.ones((2 * reach + 1,) * 2, bool)
        wanted = binary_closing(np.pad(mask, 2 * reach), side)[2 * reach : -2 * reach, 2 * reach : -2 * reach]
        assert not (mask & ~got).any(), f"closing with a reach of {reach} lost cells of the mask"
        assert np.array_equal(got, wanted), f"another mask with a reach of {reach}"


@hidden
def check_fill_unknown(fill_unknown: Callable) -> None:
    """Larger maps with all classes and states in all combinations."""
    for seed, shape in enumerate(((11, 7), (1, 30), (20, 20))):
        rng = generator(105 + seed)
        votes, near = (rng.choice([*range(9), 255, 255, 255, 255], shape) for _ in range(2))
        o = rng.dirichlet(np.ones(4), shape).transpose(2, 0, 1)
        got = answer_array(fill_unknown(votes.copy(), o.copy(), near.copy()))
        assert got.shape == shape, f"shape {got.shape} instead of {shape}"
        for place in np.ndindex(shape):
            state = int(np.argmax(o[(slice(None), *place)]))
            wanted = 10 + state if near[place] == 255 or state == 3 else near[place]
            wanted = wanted if votes[place] == 255 else votes[place]
            assert got[place] == wanted, f"a cell with vote {votes[place]} and state {state} got {got[place]:g}"


@hidden
def check_carry_window(carry_window: Callable) -> None:
    """Other turns, also up and down hill, other times, also scans that come later."""
    for seed, (n, seconds) in enumerate(((60, 0.9), (25, -0.4), (1, 0.1), (0, 0.3))):
        rng = generator(110 + seed)
        T = rigid_transform(Rotation.from_rotvec(rng.normal(0, 0.3, 3)).as_matrix(), rng.normal(0, 5, 3))
        points, moves, velocity = rng.normal(0, 10, (n, 3)), rng.random(n) < 0.5, rng.normal(0, 8, (n, 2))
        velocity[rng.random((n, 2)) < 0.2] = np.nan
        got = answer_array(carry_window(points.copy(), moves.copy(), velocity.copy(), seconds, T))
        got = got.reshape(-1, 3) if got.size == 0 else got
        wanted = _carried(points, moves, velocity, seconds, T)
        when = "a later scan" if seconds < 0 else "an earlier scan"
        assert got.shape == wanted.shape, f"{when}: shape {got.shape} instead of {wanted.shape}"
        assert n == 0 or close(got, wanted), f"{when}: other places, where the road climbs or time runs backward"


def _carried(points: NDArray, moves: NDArray, velocity: NDArray, seconds: float, T: NDArray) -> NDArray:
    """Return what is left of the points, one by one."""
    rows = []
    for point, mover, v in zip(points, moves, velocity, strict=True):
        if not mover:
            rows.append(point)
        elif not np.isnan(v).any():
            rows.append(point + np.array([v[0] * seconds, v[1] * seconds, 0]))
    return transform_points(T, np.reshape(rows, (-1, 3)))

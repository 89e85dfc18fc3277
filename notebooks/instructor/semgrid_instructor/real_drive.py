"""Hidden tests of exercise 13, your own street: other clocks, planes, scans and maps."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import invert_rigid, rigid_transform, transform_points
from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_instructor import close, generator, hidden, in_any_order


@hidden
def check_frames_missing(frames_missing: Callable) -> None:
    """Other periods, clocks that waver by up to a fifth of a turn, up to six frames lost, and a late start."""
    for seed, period in enumerate((0.02, 0.1036, 0.5, 3.0)):
        rng = generator(1300 + seed)
        lost = rng.choice([0, 0, 0, 1, 2, 6], 40)
        times = 100 + np.concatenate([[0.0], np.cumsum(period * (1 + lost + rng.uniform(-0.2, 0.2, 40)))])
        got = answer_array(frames_missing(times.tolist(), period)).ravel()
        assert close(got, lost), "other numbers for another period"


def _plane(seed: int, slope: float, lean: float) -> tuple[NDArray, NDArray]:
    """Return a road that rises ahead, and a wall that isn't quite parallel to it, by a LIDAR that leans to a side."""
    rng, turn = generator(seed), Rotation.from_euler("x", lean, degrees=True).as_matrix()
    x, y = rng.uniform(3, 20, 200), rng.uniform(-3, 3, 200)
    ground = np.column_stack([x, y, np.tan(np.radians(slope)) * y + 0.01 * x - 1.7])
    along, up = rng.uniform(2, 25, 150), rng.uniform(-1, 5, 150)
    wall = np.column_stack([along, rng.choice([-9, 7]) + rng.uniform(-0.2, 0.2) * along, up])
    noise = rng.normal(0, 0.003, (350, 3))
    return ground @ turn.T + noise[:200], wall @ turn.T + noise[200:]


@hidden
def check_slope_and_lean(slope_and_lean: Callable) -> None:
    """Both signs of both angles; walls on both sides."""
    angles = generator(1320).uniform(-4, 4, (5, 2))
    for seed, (slope, lean) in enumerate([*angles, (2.5, 0.0), (0.0, -2.0)]):
        got = answer_array(slope_and_lean(*_plane(1310 + seed, slope, lean))).ravel()
        assert got.shape == (2,), "not two numbers"
        assert close(got, np.array([slope, lean]), atol=0.1), "other angles for a street with noise and another wall"


@hidden
def check_judge_motion(judge_motion: Callable) -> None:
    """Motions with a turn, large and small, claimed rightly, the wrong way round, or not at all."""
    for seed, (ahead, yaw) in enumerate(((2.0, 3.0), (0.02, 0.1), (0.6, -8.0), (0.0, 6.0), (1.0, 0.0))):
        rng = generator(1330 + seed)
        ahead, yaw = rng.choice([-1, 1]) * np.array([ahead, yaw])
        T = rigid_transform(Rotation.from_euler("z", yaw, degrees=True).as_matrix(), np.array([ahead, 0.02, 0]))
        before = rng.uniform((5, -15, 0), (40, 15, 3), (300, 3))
        now = transform_points(invert_rigid(T), before) + rng.normal(0, 0.01, before.shape)
        now[:60] += rng.uniform(-4, 4, (60, 3))
        for claim in in_any_order((T, invert_rigid(T), np.eye(4))):
            said, wanted = judge_motion(before.copy(), now.copy(), claim.copy()), _judged(before, now, claim)
            assert said is None or isinstance(said, bool | np.bool_), "neither True, False nor None"
            assert (None if said is None else bool(said)) is wanted, "another verdict, with turns"


def _judged(before: NDArray, now: NDArray, T: NDArray) -> bool | None:
    """Return the verdict by the exercise's rule; no margin of these scans lies near its limit."""
    tree = KDTree(before)
    claimed, *others = (np.median(tree.query(transform_points(M, now))[0]) for M in (T, np.eye(4), invert_rigid(T)))
    margin = min(others) - claimed
    return None if abs(margin) <= 0.05 else bool(margin > 0)


@hidden
def check_held_out(held_out_score: Callable) -> None:
    """Other shapes, margins up to four cells, learned cells in patches and at the border of the grid."""
    for seed, (shape, margin) in enumerate((((3, 20, 9), 2), ((1, 12, 12), 0), ((5, 15, 8), 1), ((2, 30, 25), 4))):
        rng = generator(1350 + seed)
        truths, called = rng.integers(0, 4, (2, *shape))
        truths[rng.random(shape) < 0.4] = 255
        learned = np.zeros(shape[1:], bool)
        learned[:3, :2] = True
        learned[tuple(rng.integers(0, shape[1:], (3, 2)).T)] = True
        rows, cols = np.nonzero(learned)
        grid = np.indices(shape[1:])
        apart = np.maximum(np.abs(grid[0][..., None] - rows), np.abs(grid[1][..., None] - cols)).min(axis=-1) > margin
        wanted = (called == truths)[(truths != 255) & apart].mean()
        got = answer_number(held_out_score(truths.copy(), called.copy(), learned.copy(), margin))
        assert close(got, wanted), "another share with another margin"


def _street(seed: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return map, occupancy and truth of a street that nobody knows, whose map fails as that of the real one does.

    It fails in whole blocks, so that no blur helps. Right or wrong, a cell has a second class, so that neither its
    doubt nor the pair of classes tells what is true: `o` does.
    """
    rng = generator(seed)
    flat = np.add.outer(np.arange(18), np.arange(8)) % 2 == 0
    blocks = np.where(flat, rng.choice([0, 0, 1], flat.shape), rng.choice([2, 3, 6, 8], flat.shape))
    fails = np.where(flat, rng.integers(2, 4, blocks.shape), rng.integers(10, 14, blocks.shape))
    failing = rng.permutation(blocks.size).reshape(blocks.shape) < 0.4 * blocks.size
    decoys = np.where(np.isin(blocks, (2, 3)), rng.integers(0, 2, blocks.shape), fails)
    said, second = np.where(failing, (fails, blocks), (blocks, decoys))
    truth, said, second = (np.kron(one, np.ones((8, 8), int))[:142, :62] for one in (blocks, said, second))
    state = np.where(truth < 2, 0, rng.integers(1, 3, truth.shape))
    o = 0.1 * rng.dirichlet(np.ones(4), truth.shape) + 0.9 * np.eye(4)[state]
    g = 0.6 * np.eye(14)[said] + 0.25 * np.eye(14)[second] + 0.15 * rng.dirichlet(np.ones(14), truth.shape)
    return np.moveaxis(g, -1, 0), np.moveaxis(o, -1, 0), np.where(rng.random(truth.shape) < 0.3, 255, truth)


def _gain(refine: Callable, seed: int) -> float:
    """Return by how much the share of right cells of a street rises, compared with forbidding the unknown classes."""
    g, o, truth = _street(seed)
    counted = truth != 255
    refined = answer_array(refine(np.log(g), o.copy()))
    assert refined.shape == g.shape, "another shape"
    assert close(refined.sum(axis=0), np.ones(g.shape[1:]), atol=1e-4), "no probabilities on another street"
    new, old = ((one.argmax(axis=0) == truth)[counted].mean() for one in (refined, g[:10]))
    return new - old


@hidden
def check_refine(refine: Callable) -> None:
    """Other sizes, sure maps and sure occupancy: probabilities in every cell, arguments that stay, and a gain."""
    for seed, shape in enumerate(((1, 1), (9, 4), (20, 31))):
        rng = generator(1370 + seed)
        g = rng.dirichlet(np.full(14, 0.1), shape).transpose(2, 0, 1) + 1e-9
        log_g = np.log(g / g.sum(axis=0))
        o = np.eye(4)[rng.integers(0, 4, shape)].transpose(2, 0, 1)
        kept = log_g.copy(), o.copy()
        got = answer_array(refine(log_g, o))
        assert got.shape == (14, *shape), "another shape on a grid of another size"
        assert np.isfinite(got).all(), "no numbers where the map or the occupancy is sure"
        assert got.min() >= 0, "negative probabilities where the map or the occupancy is sure"
        assert close(got.sum(axis=0), np.ones(shape), atol=1e-4), "the classes of a cell don't sum to 1"
        same = np.array_equal(log_g, kept[0]) and np.array_equal(o, kept[1])
        assert same, "it changes an argument: make new arrays"
    assert _gain(refine, 1380) > 0.1, "no gain on another street, whose map fails in the same way"


@hidden
def check_better_map(refine: Callable) -> None:
    """Other streets, whose road is taken for vegetation or a car, and what stands for unknown."""
    assert np.mean([_gain(refine, 1381), _gain(refine, 1382)]) > 0.1, (
        "no gain on other streets, whose map fails in the same way"
    )

"""The scrolling map of classes: what was seen stays where it was seen, sharp, and what was never seen stays unknown."""

from copy import deepcopy

import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.memory import ClassMemory, MemoryParams, View, remember_drive, smooth_drive
from semgrid_edu.occupancy import Belief, PlanarMotion

SPEC, S = GridSpec(0, 20, -5, 5, 0.5), 3
NOTHING = np.full((2, 2, *SPEC.shape), np.nan, np.float32)
KEEPS = MemoryParams(change_rate=(0.0, 0.0), movable=())


def all_free() -> Belief:
    probability = np.zeros((4, *SPEC.shape), np.float32)
    probability[0] = 1
    return Belief(probability, NOTHING[0], NOTHING)


def street(position: PlanarMotion, ahead_of: float = 10.0) -> tuple[np.ndarray, np.ndarray]:
    """A floor of 2 m tiles of three classes. The camera sees those that are more than some metres ahead."""
    world = position.parent_from_child(SPEC.centers())
    tile = (np.floor(world[..., 0] / 2) + np.floor(world[..., 1] / 2)).astype(int) % S
    g = np.zeros((S + 4, *SPEC.shape), np.float32)
    g[:S] = np.where(np.arange(S)[:, None, None] == tile, 0.8, 0.1)
    seen = SPEC.centers()[..., 0] > ahead_of
    g *= seen
    g[S] += ~seen
    return g, tile


@pytest.mark.parametrize("step", [PlanarMotion(0.37, 0.0, 0.0), PlanarMotion(0.37, 0.02, 0.008)])
def test_tiles_that_the_camera_no_longer_sees_stay_sharp_and_in_place(step):
    """However often the map has scrolled, cells behind the view have the class that was seen there, except at edges."""
    class_memory, position = ClassMemory(SPEC, KEEPS), PlanarMotion()
    for k in range(40):
        motion = step if k else PlanarMotion()
        position = position.then(motion)
        g, tile = street(position)
        remembered = class_memory.advance(g, all_free(), motion, 0.1)
        np.testing.assert_allclose(remembered.sum(axis=0), 1, atol=1e-5)
    near = slice(SPEC.shape[0] - 16, SPEC.shape[0] - 4), slice(5, 15)  # 2 to 8 m ahead, seen 5 to 20 frames ago
    x, y = np.moveaxis(position.parent_from_child(SPEC.centers())[near], -1, 0)
    inside = (np.abs(x / 2 - np.rint(x / 2)) > 0.26) & (np.abs(y / 2 - np.rint(y / 2)) > 0.26)  # over a cell from edges
    assert inside.sum() > 15
    right = remembered[:S].argmax(axis=0)[near][inside] == tile[near][inside]
    assert right.mean() > 0.8  # each time the map turns, cells move by up to half a cell
    assert (
        np.median(remembered[:S].max(axis=0)[near][inside]) > 0.75
    )  # interpolation at each step would have blurred 0.8 away


def test_what_was_never_seen_has_the_unknown_class_of_its_state():
    class_memory = ClassMemory(SPEC, KEEPS)
    g, _ = street(PlanarMotion())
    remembered = class_memory.advance(g, all_free(), PlanarMotion(), 0.1)
    never = SPEC.centers()[..., 0] < 10
    np.testing.assert_allclose(remembered[S, never], 1, atol=1e-6)
    np.testing.assert_allclose(remembered[:S, ~never], g[:S, ~never], atol=1e-5)


def test_a_standing_vehicle_forgets_what_it_no_longer_sees_at_the_rate_of_change():
    rate, class_memory = 0.03, ClassMemory(SPEC, MemoryParams(movable=()))
    seen, blind = street(PlanarMotion(), ahead_of=-1)[0], street(PlanarMotion(), ahead_of=99)[0]
    class_memory.advance(seen, all_free(), PlanarMotion(), 0.1)
    for _ in range(20):
        remembered = class_memory.advance(blind, all_free(), PlanarMotion(), 0.5)
    np.testing.assert_allclose(remembered[:S].sum(axis=0), np.exp(-rate * 10), rtol=1e-4)
    np.testing.assert_allclose(remembered[:S].max(axis=0) / remembered[:S].sum(axis=0), 0.8, atol=1e-4)


def test_a_copy_goes_on_by_itself():
    """Along a street that the vehicle passes, with something that moves in every frame."""
    rng = np.random.default_rng(0)
    params = MemoryParams(movable=(1,))
    class_memory = ClassMemory(SPEC, params)
    for k in range(6):
        motion = PlanarMotion(0.37 * (k > 0), 0.02, 0.02)
        o = np.moveaxis(rng.dirichlet(np.full(4, 0.3), SPEC.shape), -1, 0).astype(np.float32)
        belief = Belief(o, rng.normal(0, 5, (2, *SPEC.shape)).astype(np.float32), NOTHING)
        g = np.moveaxis(rng.dirichlet(np.full(S + 4, 0.3), SPEC.shape), -1, 0).astype(np.float32)
        copied = deepcopy(class_memory)
        expected = class_memory.advance(g, belief, motion, 0.1)
        np.testing.assert_array_equal(copied.advance(g, belief, motion, 0.1), expected)


def test_with_the_whole_drive_a_cell_that_is_seen_later_is_known_before():
    """The vehicle drives backwards, so cells right ahead come into view only later. Smoothing knows them at once."""
    views, tiles = [], []
    for k in range(16):
        g, tile = street(PlanarMotion(-0.5 * k, 0.0, 0.0))
        pose = np.eye(4)
        pose[0, 3] = -0.5 * k
        views.append(View(Frame(None, np.empty((0, 4)), None, pose, 0.1 * k), all_free(), g))
        tiles.append(tile)
    filtered, smoothed = (list(of(views, SPEC, KEEPS)) for of in (remember_drive, smooth_drive))
    later = (SPEC.centers()[..., 0] > 4) & (SPEC.centers()[..., 0] < 9)
    assert (filtered[0].argmax(axis=0)[later] == S).all()  # unknown-free
    np.testing.assert_array_equal(smoothed[0][:, later].argmax(axis=0), tiles[0][later])
    np.testing.assert_allclose(smoothed[-1], filtered[-1], atol=1e-6)
    np.testing.assert_allclose(smoothed[0].sum(axis=0), 1, atol=1e-5)


def test_the_number_of_classes_cant_change():
    class_memory, grid = ClassMemory(SPEC, KEEPS), street(PlanarMotion())[0]
    class_memory.advance(grid, all_free(), PlanarMotion(), 0.1)
    with pytest.raises(ArgumentError, match="grid: expected 3 semantic classes and 4 unknown ones, found 6 classes"):
        class_memory.advance(grid[1:], all_free(), PlanarMotion(), 0.1)


def test_five_hundred_steps_keep_sums_and_limits():
    """Along a road without end, with a turn now and then and things that move: nothing drifts, nothing grows."""
    spec, rng = GridSpec(0, 6, -2, 2, 0.5), np.random.default_rng(0)
    class_memory = ClassMemory(spec, MemoryParams(movable=(1,)))
    nothing = np.full((2, 2, *spec.shape), np.nan, np.float32)
    o = np.moveaxis(rng.dirichlet(np.full(4, 0.3), spec.shape), -1, 0).astype(np.float32)
    belief = Belief(o, rng.normal(0, 5, (2, *spec.shape)).astype(np.float32), nothing)
    g = np.moveaxis(rng.dirichlet(np.full(S + 4, 0.3), spec.shape), -1, 0).astype(np.float32)
    for k in range(500):
        motion = PlanarMotion(0.8, 0.0, 0.01 if k % 100 < 50 else -0.01)
        remembered = class_memory.advance(np.roll(g, k, axis=1), belief, motion, 0.1)
        if k % 100 == 99:
            np.testing.assert_allclose(remembered.sum(axis=0), 1, atol=2e-5)
            assert np.isfinite(class_memory.state.evidence).all()
            assert class_memory.state.weight.max() <= class_memory.params.max_weight + 1e-5
            assert class_memory.state.seen.max() <= 1 + 1e-6

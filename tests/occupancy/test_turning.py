"""Where nothing moves, nothing moves: a vehicle that turns, or drives past, in a world of walls and boxes."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds.lecture_02_boxes import Box, scan_boxes

from semgrid_edu import fast
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Bof, BofParams, CmcdotParams, LogOddsGrid, PlanarMotion, State, VelocityLattice
from semgrid_edu.occupancy.planar_motion import look_up, map_around

SPEC = GridSpec(-20, 20, -10, 10, 0.5)
PERIOD, WARM_UP = 0.1, 5
WALLS = [Box(-40, 40, 8, 9, 3), Box(-40, 40, -9, -8, 3)]
PLACES = [(8, 4), (15, -5), (-9, 5), (-14, -4), (3, -6), (22, 5)]
STREET = WALLS + [Box.around(x, y, 4, 1.8, 1.5) for x, y in PLACES]
BLOCKS = [Box(*x, *y, 3) for x in ((-40, -6), (6, 40)) for y in ((-40, -6), (6, 40))]
JUNCTION = BLOCKS + [Box.around(x, y, 4, 1.8, 1.5) for x, y in ((-14, -4), (12, 4.5), (20, -4.5))]

STILL, AHEAD = PlanarMotion(), PlanarMotion(0.5)
MANOEUVRES = {
    "on the spot": (STREET, STILL, [PlanarMotion(dyaw=np.radians(2))] * 25),
    "slowly to the right": (STREET, STILL, [PlanarMotion(dyaw=np.radians(-0.7))] * 40),
    "straight on": (STREET, PlanarMotion(-10), [AHEAD] * 30),
    "left at a junction": (
        JUNCTION,
        PlanarMotion(-14, -2),
        [AHEAD] * 12 + [PlanarMotion(0.5, 0, np.pi / 50)] * 25 + [AHEAD] * 5,
    ),
}


def drive(tracker, boxes: list[Box], pose: PlanarMotion, motions: list[PlanarMotion]):
    """Yield the pose of the vehicle and what the tracker returns, after each motion."""
    rng = np.random.default_rng(0)
    for motion in motions:
        pose = pose.then(motion)
        points = scan_boxes(boxes, pose.dx, pose.dy, pose.dyaw, 600, rings=40, field=360, noise=0.02, rng=rng)
        yield pose, tracker.step(points, motion, PERIOD)


def far_from_everything(xy: np.ndarray, boxes: list[Box]) -> np.ndarray:
    """Return which places of the world are more than a metre from every box, (N,)."""
    low = np.array([(box.x_min, box.y_min) for box in boxes])
    high = np.array([(box.x_max, box.y_max) for box in boxes])
    outside = np.maximum(low - xy[:, None], xy[:, None] - high).clip(min=0)
    return (np.linalg.norm(outside, axis=-1) > 1).all(axis=1)


@pytest.mark.parametrize("name", MANOEUVRES)
def test_nothing_moves_and_nothing_stands_where_nothing_is(name):
    boxes, start, motions = MANOEUVRES[name]
    tracker = fast.Cmcdot(SPEC, CmcdotParams(n_particles=30_000))
    moving = []
    for pose, belief in list(drive(tracker, boxes, start, motions))[WARM_UP:]:
        state = belief.probability.argmax(axis=0)
        moving.append(np.count_nonzero(state == State.DYNAMIC))
        standing = pose.parent_from_child(SPEC.centers()[state == State.STATIC])
        assert len(standing) > 60
        assert not far_from_everything(standing, boxes).any()
    assert np.mean(moving) <= 2
    assert max(moving) <= 5


def test_the_other_filters_keep_their_map_while_the_vehicle_turns():
    boxes, start, motions = MANOEUVRES["on the spot"]
    motions = motions[:12]
    bof = Bof(SPEC, BofParams(VelocityLattice(max_speed=4.0, spacing=2.0)))
    grid = LogOddsGrid(SPEC)
    both = SimpleNamespace(step=lambda *scan: (bof.step(*scan), grid.step(*scan)))
    for pose, (belief, p) in drive(both, boxes, start, motions):
        standing = pose.parent_from_child(SPEC.centers()[belief.probability.argmax(axis=0) == State.STATIC])
        assert not far_from_everything(standing, boxes).any()
        assert not far_from_everything(pose.parent_from_child(SPEC.centers()[p > 0.6]), boxes).any()
    assert np.count_nonzero(belief.probability.argmax(axis=0) == State.DYNAMIC) <= 2


headings = st.floats(-10, 10)
remainders = st.floats(-0.25, 0.25)


@given(headings, remainders, remainders)
def test_the_map_has_a_cell_for_each_cell_of_the_vehicle(yaw, dx, dy):
    area, inside = map_around(SPEC, yaw), np.zeros(1)
    found = look_up(np.ones((1, *area.shape)), inside, area, SPEC, PlanarMotion(dx, dy, yaw))
    assert found.all()


@given(headings, headings)
def test_a_cell_of_one_map_is_a_cell_of_the_next(yaw, other):
    """So the belief goes from one to the other unchanged."""
    area, target = map_around(SPEC, yaw), map_around(SPEC, other)
    rows, cols, inside = area.cells(target.centers().reshape(-1, 2))
    np.testing.assert_allclose(area.centers()[rows, cols][inside], target.centers().reshape(-1, 2)[inside], atol=1e-9)


def test_a_vehicle_that_looks_ahead_needs_its_own_grid_and_a_cell_around_it():
    assert map_around(GridSpec.compact(), 0.0).shape == (144, 64)
    assert map_around(GridSpec.compact(), np.pi / 2).shape == (64, 144)

"""Ground truth made from LIDAR: hand-computed scenes, each policy on a scene whose answer is known, bad input."""

from dataclasses import replace

import numpy as np
import pytest

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.ground_truth import Moment, TruthPolicy, drive_truth, lidar_truth
from semgrid_edu.datasets.ground_truth.making import in_sight
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, SYNTHIA_10, LabelSet
from semgrid_edu.occupancy import Belief, State

SPEC = GridSpec(0.0, 40.0, -10.0, 10.0, 1.0)
SIZE = (101, 201)
# The camera sits in the LIDAR and looks ahead: X = -y, Y = -z, Z = x. Pixel (50, 100) is straight ahead.
CAMERA = Camera(
    np.array([[100.0, 0, 100], [0, 100.0, 50], [0, 0, 1]]),
    np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    SIZE,
)
ROAD, CAR, SKY = (KITTI_14.index(name) for name in ("road", "car", "sky"))
UNKNOWN = {state: KITTI_14.index(f"unknown-{name}") for state, name in zip(
    State, ("free", "static", "dynamic", "unobserved"), strict=True)}  # fmt: skip
BARE = TruthPolicy(cleanup="none")


def labels_of(image, label_set=KITTI_14):
    image = np.broadcast_to(np.uint8(image), SIZE)
    nothing = np.full(LABEL_GRID.shape, IGNORE, np.uint8)
    return FrameLabels(label_set, image, np.full(SIZE, np.nan, np.float32), nothing, np.zeros(LABEL_GRID.shape, bool))


def frame_of(*xyz, image=ROAD, time=0.0, x_world=0.0, label_set=KITTI_14):
    points = np.c_[np.reshape(xyz, (-1, 3)), np.zeros(len(xyz))].astype(np.float32)
    pose = np.eye(4)
    pose[0, 3] = x_world
    return Frame(None, points, CAMERA, pose, time, labels_of(image, label_set))


def states_of(states):
    return np.moveaxis(np.eye(4)[np.broadcast_to(states, SPEC.shape)], -1, 0)


def labelled(grid):
    """The labelled cells of a grid as {(x, y): class}, by the lower corners of the cells, metres."""
    return {(39 - int(r), 9 - int(c)): int(grid[r, c]) for r, c in np.argwhere(grid < KITTI_14.n_semantic)}


def test_of_two_returns_on_one_pixel_the_nearest_takes_the_label():
    frame = frame_of((30.5, 0.01, 0), (10.5, 0.01, 0))
    assert labelled(lidar_truth(frame, states_of(State.FREE), SPEC, BARE)) == {(10, 0): ROAD}


def test_each_return_takes_the_class_of_its_own_pixel_to_its_own_cell():
    image = np.full(SIZE, ROAD)
    image[:, :100] = CAR  # the left half of the image
    image[:40] = SKY
    image[60:] = IGNORE
    image[50, 150] = UNKNOWN[State.STATIC]  # an annotator's "unknown" is no label
    returns = (20.5, 3.5, 0), (20.5, -3.5, 0), (10.5, 5.5, 1.5), (10.5, 5.5, -1.5), (30.5, -15.25, 0), (8.5, -4.25, 0)
    truth = lidar_truth(frame_of(*returns, image=image), states_of(State.STATIC), SPEC, BARE)
    assert labelled(truth) == {(20, 3): CAR, (20, -4): ROAD}


def test_a_cell_that_no_return_reaches_is_unknown_by_its_state():
    states = np.arange(800).reshape(SPEC.shape) % 4
    truth = lidar_truth(frame_of((10.5, 0.5, 0)), states_of(states), SPEC, BARE)
    expected = np.array(list(UNKNOWN.values()))[states]
    expected[29, 9] = ROAD
    np.testing.assert_array_equal(truth, expected)
    assert truth.dtype == np.uint8


def test_without_returns_everything_is_unknown():
    empty = frame_of()
    for policy in (TruthPolicy(), TruthPolicy(visible_to="camera"), TruthPolicy(visible_to="lidar")):
        assert (lidar_truth(empty, states_of(State.FREE), SPEC, policy) == UNKNOWN[State.FREE]).all()


def test_clean_up_closes_what_lies_within_its_reach():
    frame = frame_of((10.5, 0.5, 0))
    cells = labelled(lidar_truth(frame, states_of(State.FREE), SPEC, TruthPolicy(cleanup="spread")))
    assert set(cells) == {(10 + i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)}  # 1.5 m: the eight neighbours


def test_the_ground_spreads_farther_but_what_stands_does_not():
    post = frame_of((10.5, 0.5, 0), image=CAR)
    assert labelled(lidar_truth(post, states_of(State.FREE), SPEC)) == {(10, 0): CAR}
    road = labelled(lidar_truth(frame_of((10.5, 0.5, 0)), states_of(State.FREE), SPEC))
    assert set(road) == {(10 + i, j) for i in range(-3, 4) for j in range(-3, 4) if np.hypot(i, j) <= 3}


@pytest.mark.parametrize(("vote", "winner"), [("standing", CAR), ("majority", ROAD)])
def test_the_vote_decides_a_cell_with_several_classes(vote, winner):
    image = np.full(SIZE, ROAD)
    image[:, 99] = CAR
    returns = (10.5, 0.1, 0), (10.5, 0.5, 0), (10.5, 0.5, 0.5)  # pixels 99, 95 and 95 of the row
    truth = lidar_truth(frame_of(*returns, image=image), states_of(State.FREE), SPEC, replace(BARE, vote=vote))
    assert labelled(truth) == {(10, 0): winner}


class TestOwnLabels:
    """Some road that a car hides now was seen a moment ago, and the image of that moment says what it is."""

    now = frame_of((20.5, 0.5, 0), image=CAR, time=0.1)
    then = frame_of((30.5, 0.75, 0), image=ROAD, time=0.0)

    def cells(self, labels, then=None):
        policy = TruthPolicy(past=1, labels=labels, cleanup="none")
        before = [Moment(then or self.then, None)]
        return labelled(lidar_truth(self.now, states_of(State.FREE), SPEC, policy, before))

    def test_the_present_image_sees_the_closest_return_of_all_scans(self):
        assert self.cells("present") == {(20, 0): CAR}

    def test_the_image_of_its_own_instant_labels_what_is_hidden_now(self):
        assert self.cells("own") == {(20, 0): CAR, (30, 0): ROAD}

    def test_one_scan_is_the_same_with_both(self):
        rng = np.random.default_rng(3)
        frame = frame_of(*rng.uniform((1, -12, -1.7), (45, 12, 2), (300, 3)), image=rng.integers(0, 10, SIZE))
        one, other = (
            lidar_truth(frame, states_of(State.FREE), SPEC, TruthPolicy(labels=labels)) for labels in ("own", "present")
        )
        np.testing.assert_array_equal(one, other)

    def test_a_frame_of_the_window_without_labels_is_refused(self):
        with pytest.raises(ArgumentError, match="labels of every frame of the window, found none at 0 s"):
            self.cells("own", replace(self.then, labels=None))


class TestMovers:
    """A car passes at 10 m/s while the recording car has moved on by 2 m; a post stands still."""

    now = frame_of((20.5, 2.5, 0), (20.5, 3.5, 0), image=CAR, time=0.4)
    then = frame_of((18.5, 2.5, 0), (18.5, 3.5, 0), (14.5, -3.5, 0), time=0.0, x_world=-2.0)

    def belief(self, speed):
        states, velocity = np.full(SPEC.shape, State.FREE), np.full((2, *SPEC.shape), np.nan, np.float32)
        states[21, 6:8] = State.DYNAMIC
        velocity[:, 21, 6:8] = np.array(speed)[:, None]
        return Belief(states_of(states), velocity, np.full((2, 2, *SPEC.shape), np.nan, np.float32))

    def cells(self, movers, speed=(10.0, 0.0)):
        policy = TruthPolicy(past=1, movers=movers, cleanup="none")
        before = [Moment(self.then, self.belief(speed))]
        return set(labelled(lidar_truth(self.now, states_of(State.FREE), SPEC, policy, before)))

    car, post, smear = {(20, 2), (20, 3)}, {(12, -4)}, {(16, 2), (16, 3)}

    def test_smeared_the_car_stands_in_two_places(self):
        assert self.cells("smeared") == self.car | self.post | self.smear

    def test_carved_it_stands_where_it_is_now(self):
        assert self.cells("carved") == self.car | self.post

    def test_carried_its_old_returns_arrive_where_it_is_now(self):
        assert self.cells("carried") == self.car | self.post

    def test_a_wrong_velocity_carries_them_elsewhere(self):
        assert self.cells("carried", speed=(15.0, 0.0)) == self.car | self.post | {(18 + 4, 2), (18 + 4, 3)}

    def test_what_moves_with_unknown_velocity_is_left_out(self):
        assert self.cells("carried", speed=(np.nan, np.nan)) == self.car | self.post

    def test_scans_beyond_the_window_are_not_used(self):
        before = [Moment(self.then, None)]
        for policy in (BARE, TruthPolicy(future=3, cleanup="none")):
            truth = lidar_truth(self.now, states_of(State.FREE), SPEC, policy, before)
            assert set(labelled(truth)) == self.car

    def test_the_future_is_added_as_the_past_is(self):
        later = replace(self.then, time=0.8)
        policy = TruthPolicy(future=1, movers="carried", cleanup="none")
        after = [Moment(later, self.belief((-10.0, 0.0)))]  # it comes back to where it is now
        truth = lidar_truth(self.now, states_of(State.FREE), SPEC, policy, after=after)
        assert set(labelled(truth)) == self.car | self.post

    def test_without_belief_nobody_knows_what_moves(self):
        policy = TruthPolicy(past=1, movers="carved")
        with pytest.raises(ArgumentError, match="before, after: expected beliefs, for moving things to be carved"):
            lidar_truth(self.now, states_of(State.FREE), SPEC, policy, [Moment(self.then, None)])

    def test_a_drive_is_cut_where_it_ends(self):
        moments = [Moment(self.then, self.belief((10.0, 0.0))), Moment(self.now, self.belief((10.0, 0.0)))]
        policy = TruthPolicy(past=9, future=9, movers="carved", cleanup="none")
        assert set(labelled(drive_truth(moments, 1, SPEC, policy))) == self.car | self.post


def test_deskewing_uses_the_motion_between_the_frames():
    # 0.45 of a quarter turn to the left: measured 0.01125 s before the image, when the car was 0.225 m further back.
    angle = np.radians(40.5)
    frame = frame_of((15.1, 15.1 * np.tan(angle), 0), time=1.0, x_world=2.0)
    wide = GridSpec(0.0, 40.0, -20.0, 20.0, 1.0)
    before = [Moment(frame_of(time=0.9), None)]
    free = np.moveaxis(np.eye(4)[np.zeros(wide.shape, int)], -1, 0)
    found = [
        39 - np.argwhere(lidar_truth(frame, free, wide, policy, before) == ROAD)[:, 0]
        for policy in (BARE, TruthPolicy(deskew=True, cleanup="none"))
    ]
    assert [rows.tolist() for rows in found] == [[15], [14]]
    with pytest.raises(ArgumentError, match="whose pose shows the motion"):
        lidar_truth(frame, free, wide, TruthPolicy(deskew=True))


def test_visible_to_the_lidar_means_that_its_state_is_known():
    states = np.full(SPEC.shape, State.FREE)
    states[29, 9] = State.UNKNOWN
    frame = frame_of((10.5, 0.5, 0), (20.5, 0.6, 0))
    policy = TruthPolicy(visible_to="lidar", cleanup="none")
    truth = lidar_truth(frame, states_of(states), SPEC, policy)
    assert labelled(truth) == {(20, 0): ROAD}
    assert truth[29, 9] == UNKNOWN[State.UNKNOWN]


def test_the_camera_sees_as_far_as_the_last_return_in_each_direction():
    wall = frame_of(*((20.5, y, 0) for y in np.arange(-25, 25, 0.2)))
    sight = in_sight(wall, SPEC)
    assert sight[39 - 18, 4:16].all()  # in front of the wall
    assert not sight[39 - 23].any()  # behind it
    assert not sight[39 - 5, [0, -1]].any()  # beside the image, whose half angle is 45 degrees
    policy = TruthPolicy(past=1, visible_to="camera", cleanup="none")
    seen_before = [Moment(frame_of((30.5, 0.5, 5.0)), None)]  # above the wall: through a gap between its returns
    for visible_to, held in (("any", True), ("camera", False)):
        truth = lidar_truth(wall, states_of(State.FREE), SPEC, replace(policy, visible_to=visible_to), seen_before)
        assert ((30, 0) in labelled(truth)) == held


def test_any_label_set_with_unknown_classes_will_do():
    names = ("stone", "grass", "unknown-unobserved", "unknown-free", "unknown-dynamic", "unknown-static")
    garden = LabelSet("garden", names, ((0, 0, 0),) * 6, n_semantic=2, flat=("grass",))
    frame = frame_of((10.5, 0.5, 0), image=1, label_set=garden)
    states = np.arange(800).reshape(SPEC.shape) % 4
    truth = lidar_truth(frame, states_of(states), SPEC, BARE)
    assert truth[29, 9] == 1
    assert truth[0, :4].tolist() == [3, 5, 4, 2]


def test_every_cell_has_a_class_of_the_label_set():
    rng = np.random.default_rng(0)
    for _ in range(5):
        returns = rng.uniform((1, -12, -1.7), (45, 12, 2), (300, 3))
        image = rng.choice(np.array([*range(14), IGNORE], np.uint8), SIZE)
        belief = Belief(
            rng.dirichlet(np.ones(4), SPEC.shape).transpose(2, 0, 1), rng.normal(size=(2, *SPEC.shape)), None
        )
        frame = frame_of(*returns, image=image, time=0.1)
        moments = [Moment(replace(frame, time=0.0), belief), Moment(frame, belief)]
        for movers in ("smeared", "carved", "carried"):
            for visible_to in ("any", "camera", "lidar"):
                policy = TruthPolicy(1, 0, rng.choice(["own", "present"]), movers, visible_to=visible_to, deskew=True)
                truth = drive_truth(moments, 1, SPEC, policy)
                assert truth.dtype == np.uint8
                assert truth.shape == SPEC.shape
                assert truth.max() < len(KITTI_14)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"labels": None}, "frame: expected a frame with labels, found a frame without"),
        (
            {"labels": labels_of(0, SYNTHIA_10)},
            "label_set: expected a label set with the classes unknown-free.*SYNTHIA-10",
        ),
        ({"camera": CAMERA.resized((50, 100))}, r"frame.labels.image: expected shape \(50, 100\)"),
    ],
)
def test_a_frame_without_proper_labels_is_refused(change, message):
    with pytest.raises(ArgumentError, match=message):
        lidar_truth(replace(frame_of((10.5, 0.5, 0)), **change), states_of(State.FREE), SPEC)


def test_a_belief_of_another_grid_is_refused():
    with pytest.raises(ArgumentError, match=r"probability: expected shape \(4, 40, 20\)"):
        lidar_truth(frame_of((10.5, 0.5, 0)), states_of(State.FREE)[:, 1:], SPEC)


@pytest.mark.parametrize(
    "choice",
    [{"movers": "frozen"}, {"visible_to": "radar"}, {"cleanup": True}, {"vote": "all"}, {"past": -1}, {"future": 1.5}],
    ids=str,
)
def test_a_policy_that_does_not_exist_is_refused(choice):
    with pytest.raises(ArgumentError, match=next(iter(choice))):
        TruthPolicy(**choice)


def test_a_frame_that_the_drive_does_not_have_is_refused():
    with pytest.raises(ArgumentError, match="k: expected a frame with a belief, 0 to 0"):
        drive_truth([Moment(frame_of((10.5, 0.5, 0)), None)], 0, SPEC)

"""The majority, the image alone, the occupancy alone, and both together, on grids small enough to fill in by hand."""

import numpy as np
import pytest
import torch
from sklearn.naive_bayes import CategoricalNB

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.scoring.flat_ground import (
    count_labels_and_states,
    ground_labels,
    ground_pixels,
    inverse_perspective,
    joint_table,
    naive_bayes,
)
from semgrid_edu.workshop.scoring.grids import classes_of_states, majority_by_state, majority_class

ROAD, WALK, CAR, SKY = (KITTI_14.index(name) for name in ("road", "sidewalk", "car", "sky"))
FREE, STATIC, DYNAMIC, UNOBSERVED = 10, 11, 12, 13

# A camera 1 m above the ground that looks along x. Ground at distance d lies 10 / d pixels below the horizon, row 5.
AHEAD = Camera(
    np.array([[10.0, 0, 5], [0, 10, 5], [0, 0, 1]]),
    np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    (11, 11),
    lidar_height=1.0,
)


def occupancy(*states):
    return np.eye(4)[list(states)].T[:, None]


def test_ground_lies_below_the_horizon_by_the_inverse_of_its_distance():
    """Cells of 1 m, their centres 2.5 to 0.5 m ahead and 0 or 1 m to the right: rows 5 + 10/d, columns 5 + 10 y/d."""
    places = ground_pixels(GridSpec(0, 3, -1.5, 0.5, 1.0), AHEAD)
    assert places.tolist() == [[9 * 11 + 5, 9 * 11 + 9], [-1, -1], [-1, -1]]  # d of 1.5 would be row 11.7


def test_all_that_a_car_hides_is_called_car():
    labels = np.array([[SKY, 255, CAR, ROAD]], np.uint8)
    places = np.array([[0, 1, 2, 2, 2, 3, -1]])
    states = occupancy(0, 0, 1, 3, 3, 0, 3)
    everywhere = inverse_perspective(labels, places, states)
    assert everywhere.tolist() == [[FREE, FREE, CAR, CAR, CAR, ROAD, UNOBSERVED]]
    observed = inverse_perspective(labels, places, states, observed_only=True)
    assert observed.tolist() == [[FREE, FREE, CAR, UNOBSERVED, UNOBSERVED, ROAD, UNOBSERVED]]


def test_places_that_do_not_fit_are_refused():
    labels = np.zeros((2, 2), np.uint8)
    for places in (np.array([[4]]), np.array([[0, 0]])):
        with pytest.raises(ArgumentError, match="places"):
            inverse_perspective(labels, places, occupancy(0))


def test_each_state_has_a_majority_in_each_cell():
    truths = np.array([[[ROAD, WALK]], [[ROAD, WALK]], [[CAR, WALK]], [[CAR, 255]]], np.uint8)
    states = [[0, 0], [1, 0], [1, 2], [1, 1]]
    by_state = majority_by_state(truths, np.stack([occupancy(*frame) for frame in states]))
    assert by_state[:, 0, 0].tolist()[:2] == [ROAD, CAR]  # free once, road; static three times, mostly car
    assert by_state[:, 0, 1].tolist() == [WALK, CAR, WALK, 0]  # static there was unlabelled: the class of static cells
    assert by_state[2, 0, 0] == WALK  # never dynamic here: the class of dynamic cells elsewhere
    assert classes_of_states(by_state, occupancy(1, 2)).tolist() == [[CAR, WALK]]


def test_majority_of_each_cell():
    truths = np.array([[[ROAD, 255, CAR]], [[WALK, 255, CAR]], [[WALK, 255, 255]]], np.uint8)
    assert majority_class(truths).tolist() == [[WALK, WALK, CAR]]


def test_majority_breaks_ties_by_the_first_class():
    assert majority_class(np.array([[[CAR]], [[ROAD]]], np.uint8)).tolist() == [[ROAD]]


PLACES = np.array([[0, 1, 2, 2, -1]])
IMAGES = np.array([[[ROAD, 255, CAR]], [[ROAD, WALK, CAR]]], np.uint8)
STATES = [[0, 0, 1, 3, 3], [0, 1, 1, 0, 3]]
TRUTHS = np.array([[[ROAD, FREE, CAR, UNOBSERVED, 255]], [[WALK, STATIC, CAR, ROAD, UNOBSERVED]]], np.uint8)


class TwoFrames:
    """Two frames of a row of five cells, whose ground three pixels show."""

    label_set = KITTI_14
    arrays = {"truth": TRUTHS, "occupancy": np.stack([occupancy(*states) for states in STATES])}  # noqa: RUF012

    def __len__(self):
        return 2

    def __getitem__(self, k):
        parts = (np.zeros((3, 1, 3), np.uint8), IMAGES[k], self.arrays["occupancy"][k], TRUTHS[k])
        return Sample(*map(torch.from_numpy, parts))


def test_a_cell_whose_ground_has_no_label_has_a_value_of_its_own():
    assert ground_labels(IMAGES[0], PLACES, 14).tolist() == [[ROAD, 14, CAR, CAR, 14]]


def test_cells_are_counted_by_label_state_and_class():
    counts = count_labels_and_states(TwoFrames(), lambda sample: sample.labels.numpy(), PLACES)
    found = {tuple(map(int, place)): int(counts[tuple(place)]) for place in np.argwhere(counts)}
    assert found == {
        (ROAD, 0, ROAD): 1,
        (ROAD, 0, WALK): 1,
        (14, 0, FREE): 1,
        (CAR, 1, CAR): 2,
        (CAR, 3, UNOBSERVED): 1,
        (WALK, 1, STATIC): 1,
        (CAR, 0, ROAD): 1,
        (14, 3, UNOBSERVED): 1,
    }


def drawn_cells(n=2000):
    """Labels, states and classes of cells, of which the first two depend on the class, each in its own way."""
    rng = np.random.default_rng(0)
    classes = rng.choice(14, n, p=rng.dirichlet(np.ones(14)))
    labels, states = (classes + rng.geometric(0.6, n)) % 15, (classes // 4 + rng.geometric(0.5, n)) % 4
    counts = np.zeros((15, 4, 14), int)
    np.add.at(counts, (labels, states, classes), 1)
    return counts, np.column_stack([labels, states]), classes


EVERY_PAIR = np.indices((15, 4)).reshape(2, -1).T


def test_naive_bayes_is_that_of_scikit_learn():
    counts, seen, classes = drawn_cells()
    model = CategoricalNB(alpha=1, min_categories=[15, 4]).fit(seen, classes)
    np.testing.assert_array_equal(naive_bayes(counts).ravel(), model.predict(EVERY_PAIR))


def test_no_rule_of_label_and_state_is_right_more_often_than_the_table_on_the_cells_that_it_was_fitted_to():
    counts, seen, classes = drawn_cells()
    table, other = (
        (one[seen[:, 0], seen[:, 1]] == classes).mean() for one in (joint_table(counts), naive_bayes(counts))
    )
    assert table >= other
    assert table == pytest.approx(counts.max(axis=2).sum() / counts.sum())


def test_where_label_and_state_never_met_the_state_decides():
    counts = np.zeros((15, 4, 14), int)
    counts[ROAD, 0, ROAD], counts[CAR, 1, CAR], counts[CAR, 1, STATIC] = 5, 1, 2
    assert joint_table(counts)[[ROAD, CAR], [1, 0]].tolist() == [STATIC, ROAD]

"""The majority, the image alone and the occupancy alone, on grids and images small enough to fill in by hand."""

import numpy as np
import pytest

from semgrid_edu.camera import Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.scoring.grids import (
    classes_of_states,
    ground_pixels,
    inverse_perspective,
    majority_by_state,
    majority_class,
)

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

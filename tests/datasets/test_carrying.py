"""Labels carried to grids small enough to fill in by hand, and their gaps closed."""

import numpy as np
import pytest

from semgrid_edu.datasets.ground_truth import carry_labels, close_gaps
from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import KITTI_14

ROAD, WALK, CAR, SKY = (KITTI_14.index(name) for name in ("road", "sidewalk", "car", "sky"))
FREE, STATIC, DYNAMIC, UNOBSERVED = 10, 11, 12, 13


def occupancy(*states):
    return np.eye(4)[list(states)].T[:, None]


def test_labels_reach_the_cells_of_their_returns():
    labels = np.array([[ROAD, CAR], [255, SKY]], np.uint8)
    grid = carry_labels(labels, np.array([0, 1, 2, 3]), np.array([0, 1, 2, 3]), occupancy(1, 0, 2, 3))
    assert grid.tolist() == [[ROAD, CAR, DYNAMIC, UNOBSERVED]]


def test_what_stands_outvotes_the_ground():
    labels = np.array([[ROAD, ROAD, CAR, WALK, WALK, ROAD]], np.uint8)
    cells = np.array([0, 0, 0, 1, 1, 1])
    assert carry_labels(labels, np.arange(6), cells, occupancy(0, 0)).tolist() == [[CAR, WALK]]


def test_without_returns_everything_is_unknown():
    nothing = np.array([], np.int32)
    grid = carry_labels(np.zeros((2, 2), np.uint8), nothing, nothing, occupancy(0, 1, 2, 3))
    assert grid.tolist() == [[FREE, STATIC, DYNAMIC, UNOBSERVED]]


def test_places_outside_are_refused():
    for name, pixels, cells in (("pixels", [4], [0]), ("cells", [0], [1]), ("cells", [0], [-1])):
        with pytest.raises(ArgumentError, match=name):
            carry_labels(np.zeros((2, 2), np.uint8), np.array(pixels), np.array(cells), occupancy(0))


def test_gaps_take_the_nearest_class_where_something_was_observed():
    row = np.array([[ROAD, FREE, STATIC, FREE, FREE, UNOBSERVED, CAR]], np.uint8)
    assert close_gaps(row, 0.5, reach=1.0).tolist() == [[ROAD, ROAD, ROAD, FREE, CAR, UNOBSERVED, CAR]]


def test_a_grid_without_labels_stays_as_it_is():
    row = np.array([[FREE, STATIC, DYNAMIC, UNOBSERVED]], np.uint8)
    np.testing.assert_array_equal(close_gaps(row, 0.5), row)

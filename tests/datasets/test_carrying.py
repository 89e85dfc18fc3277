"""Labels carried to grids small enough to fill in by hand, and their gaps closed."""

import numpy as np
import pytest

from semgrid_edu.datasets.ground_truth import carry_labels, close_and_spread, close_gaps
from semgrid_edu.errors import ArgumentError
from semgrid_edu.labels import KITTI_14

ROAD, WALK, CAR, SKY = (KITTI_14.index(name) for name in ("road", "sidewalk", "car", "sky"))
FREE, STATIC, DYNAMIC, UNOBSERVED = 10, 11, 12, 13


def occupancy(*states):
    return np.eye(4)[list(states)].T[:, None]


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


def wall(*holes):
    """A wall of 9 cells of 1 m between sidewalk and free space, with holes in it."""
    grid = np.full((7, 9), FREE, np.uint8)
    grid[3] = KITTI_14.index("building")
    grid[3, list(holes)] = STATIC
    grid[6] = WALK
    return grid


def test_a_wall_is_closed_and_does_not_grow():
    closed = close_and_spread(wall(4), cell=1.0)
    np.testing.assert_array_equal(closed[3], wall()[3])
    assert (closed == KITTI_14.index("building")).sum() == 9


def test_a_wide_gap_stays_open_for_walls_but_takes_the_ground():
    closed = close_and_spread(wall(3, 4, 5), cell=1.0)
    assert (closed[3, 3:6] == WALK).all()


def test_what_was_labelled_or_never_observed_stays():
    rng = np.random.default_rng(0)
    grid = rng.integers(0, 14, (30, 20)).astype(np.uint8)
    closed = close_and_spread(grid, cell=0.5)
    kept = (grid < 10) | (grid == UNOBSERVED)
    np.testing.assert_array_equal(closed[kept], grid[kept])
    assert (closed[~kept] < 10).mean() > 0.5


def test_without_ground_nothing_spreads():
    grid = np.full((5, 5), FREE, np.uint8)
    grid[2, 2] = CAR
    np.testing.assert_array_equal(close_and_spread(grid, cell=0.5), grid)

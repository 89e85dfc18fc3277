"""The toy world against what a ruler and a protractor say."""

import numpy as np
import pytest
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT
from semgrid_edu.grid import GridSpec

BOX = Box.around(20, 3, 4, 2, 1.8)
"""Higher than the scanner, which doesn't see its top."""


def test_rings_meet_flat_ground_where_their_angle_says():
    """1.73 m above the ground, a ring e below the horizon meets it at 1.73 / tan e."""
    points = scan_boxes([], columns=40, rings=3, field=360.0)
    elevation = np.radians([24.8, 11.4])
    np.testing.assert_allclose(points[:, 2], 0, atol=1e-5)
    found = np.hypot(points[:, 0], points[:, 1]).reshape(2, 40)
    np.testing.assert_allclose(found, np.tile(KITTI_LIDAR_HEIGHT / np.tan(elevation)[:, None], 40), rtol=1e-5)


def test_a_box_is_hit_on_the_sides_that_face_the_scanner_and_hides_what_is_behind():
    points = scan_boxes([BOX, Box.around(25, 3.75, 1, 2, 1.0)], columns=900)
    hits = points[points[:, 2] > 0.01]
    front, side = np.isclose(hits[:, 0], 18, atol=1e-4), np.isclose(hits[:, 1], 2, atol=1e-4)
    assert (front | side).all()
    assert front.any()
    assert side.any()
    assert 1.5 < hits[:, 2].max() <= 1.8


def test_the_vehicles_pose_is_taken_off_the_returns():
    """5 m farther on and turned right by a quarter, the vehicle has the box 13 to 17 m to its left, 2 to 4 m behind."""
    points = scan_boxes([BOX], x=5, yaw=-np.pi / 2, columns=3600, field=360)
    forward, left, _ = points[points[:, 2] > 0.01].T
    near_end, front_side = np.isclose(left, 13, atol=1e-4), np.isclose(forward, -2, atol=1e-4)
    assert (near_end | front_side).all()
    np.testing.assert_allclose([forward[near_end].min(), forward[near_end].max()], [-4, -2], atol=0.05)
    np.testing.assert_allclose([left[front_side].min(), left[front_side].max()], [13, 17], atol=0.3)


def test_noise_is_along_the_ray_and_of_the_seed():
    clean, *noisy = (scan_boxes([BOX], noise=n, rng=np.random.default_rng(0)) for n in (0, 0.05, 0.05))
    np.testing.assert_array_equal(*noisy)
    sensor = np.array([0, 0, KITTI_LIDAR_HEIGHT])
    rays = [(points - sensor) / np.linalg.norm(points - sensor, axis=1, keepdims=True) for points in (clean, noisy[0])]
    np.testing.assert_allclose(*rays, atol=1e-5)
    error = np.linalg.norm(noisy[0] - sensor, axis=1) - np.linalg.norm(clean - sensor, axis=1)
    assert np.std(error) == pytest.approx(0.05, rel=0.05)


def test_nothing_returns_from_beyond_the_longest_range():
    assert np.linalg.norm(scan_boxes([BOX], farthest=15.0) - [0, 0, KITTI_LIDAR_HEIGHT], axis=1).max() < 15


def test_cells_are_in_a_box_whose_centre_is():
    spec = GridSpec(0, 10, -5, 5, 1)
    inside = cells_in(Box(2, 4, 0, 3, 1), spec)
    assert np.argwhere(inside).tolist() == [[r, c] for r in (6, 7) for c in (2, 3, 4)]
    np.testing.assert_array_equal(cells_in(Box(12, 14, 1, 4, 1), spec, x=10, y=1), inside)
    assert cells_in(Box(2, 4, 0, 3, 1), spec, margin=1).sum() == 4 * 5

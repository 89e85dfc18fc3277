"""The skew of a scan: by hand, and against a scanner that is followed return by return."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from semgrid_edu.datasets.ground_truth.window import EgoVelocity, deskew_scan, ego_velocity, skew_scan
from semgrid_edu.errors import ArgumentError

VELOCITY = EgoVelocity(forward=12.0, left=0.5, turn=0.4)


def test_a_return_on_the_left_was_measured_a_quarter_turn_before_the_image():
    points = np.array([[0.0, 10.0, 1.0, 0.5], [10.0, 0.0, 1.0, 0.5]])
    moved = deskew_scan(points, EgoVelocity(10.0, 0.0, 0.0))
    np.testing.assert_allclose(moved, [[-0.25, 10.0, 1.0, 0.5], [10.0, 0.0, 1.0, 0.5]])
    turned = deskew_scan(points, EgoVelocity(0.0, 0.0, 1.0))
    np.testing.assert_allclose(turned[0], [10 * np.sin(0.025), 10 * np.cos(0.025), 1.0, 0.5])


def recorded(place):
    """Follow a scanner: when does it look at a place that stands still, and where does it find it then?"""

    def found(t):
        cos, sin = np.cos(VELOCITY.turn * t), np.sin(VELOCITY.turn * t)
        shift = place - t * np.array(VELOCITY[:2])
        return np.array([[cos, sin], [-sin, cos]]) @ shift

    def lag(t):
        x, y = found(t)
        return t + np.arctan2(y, x) / (2 * np.pi) * 0.1

    return found(brentq(lag, -0.045, 0.045))


def test_deskewing_finds_what_stands_still_where_it_stands():
    rng = np.random.default_rng(0)
    angles, ranges = rng.uniform(-2.5, 2.5, 50), rng.uniform(4, 60, 50)
    places = np.c_[ranges * np.cos(angles), ranges * np.sin(angles)]
    raw = np.c_[[recorded(place) for place in places], np.ones(50)]
    assert np.abs(raw[:, :2] - places).max() > 0.2
    np.testing.assert_allclose(deskew_scan(raw, VELOCITY)[:, :2], places, atol=1e-9)


def test_skewing_is_undone_by_deskewing():
    rng = np.random.default_rng(1)
    points = np.c_[rng.uniform(10, 60, 100), rng.uniform(-10, 10, (100, 1)), rng.random((100, 2))].astype(np.float32)
    skewed = skew_scan(points, VELOCITY)
    assert skewed.dtype == np.float32
    assert np.abs(skewed - points).max() > 0.05
    np.testing.assert_allclose(deskew_scan(skewed, VELOCITY), points, atol=0.01)


def test_the_velocity_is_that_of_the_poses():
    pose = np.eye(4)
    pose[:2, 3] = 1.2, 0.05
    before, now = (SimpleNamespace(time=t, T_world_from_lidar=T) for t, T in ((0.0, np.eye(4)), (0.1, pose)))
    np.testing.assert_allclose(ego_velocity(now, before), (12.0, 0.5, 0.0), atol=1e-9)
    np.testing.assert_allclose(ego_velocity(before, now), (12.0, 0.5, 0.0), atol=1e-9)
    with pytest.raises(ArgumentError, match="a frame of another time"):
        ego_velocity(now, now)

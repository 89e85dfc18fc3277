"""A camera that learns its pitch: pixels, readings and a slope against the package."""

import numpy as np
import torch
from worlds import lecture_06_calibration as calibration

from semgrid_edu.camera import Camera, project
from semgrid_edu.planes import sample_planes_naive

K = np.array([[60.0, 0, 39.5], [0, 60, 23.5], [0, 0, 1]])
T_CAMERA_FROM_LIDAR = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
CAMERA = Camera(K, T_CAMERA_FROM_LIDAR, (48, 80), lidar_height=1.5)


def points_ahead(count=30):
    """Return points of the ground in the camera's frame, (J, 3)."""
    rng = np.random.default_rng(0)
    return torch.from_numpy(
        np.column_stack([rng.uniform(-2, 2, count), np.full(count, 1.5), rng.uniform(6, 20, count)])
    )


def test_without_a_pitch_the_pixels_are_those_of_equation_1():
    points = points_ahead()
    u, v = calibration.pixels_at(points, torch.tensor(0.0), K)
    pixels, visible = project(points.numpy(), CAMERA)
    assert visible.all()
    np.testing.assert_allclose(np.column_stack([u, v]), pixels)


def test_a_camera_that_looks_down_sees_points_higher_in_the_image():
    points = points_ahead()
    before, after = (calibration.pixels_at(points, torch.tensor(a), K)[1] for a in (0.0, 0.01))
    assert (after < before).all()


def test_points_read_by_equation_2():
    rng = np.random.default_rng(1)
    s, u, v = rng.normal(size=(2, 48, 80)), rng.uniform(0, 79, 20), rng.uniform(0, 47, 20)
    literal = sample_planes_naive(s, np.stack([u, v], axis=-1)[None, None], np.ones((1, 1, 20), bool))
    np.testing.assert_allclose(calibration.read_points(*map(torch.from_numpy, (s, u, v))), literal[:, 0, 0])

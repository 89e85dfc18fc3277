"""The camera: equation (1) by hand, frames, and resizing without losing half a pixel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.errors import ArgumentError

K = np.array([[100.0, 0, 50], [0, 100, 20], [0, 0, 1]])
LIDAR_TO_CAMERA_AXES = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
CAMERA = Camera(K, rigid_transform(LIDAR_TO_CAMERA_AXES, np.zeros(3)), size=(40, 100), lidar_height=2.0)


def test_equation_1_by_hand():
    pixels, visible = project(np.array([[1.0, 0.5, 10.0]]), CAMERA)
    np.testing.assert_allclose(pixels, [[100 * 0.1 + 50, 100 * 0.05 + 20]])
    assert visible.all()


def test_a_point_left_and_above_lands_left_and_above():
    ahead_left_up = np.array([[10.0, 1.0, 2.5]])
    pixels, visible = project(transform_points(CAMERA.T_camera_from_grid, ahead_left_up), CAMERA)
    np.testing.assert_allclose(pixels, [[50 - 10, 20 - 5]])
    assert visible.all()


def test_points_behind_beside_and_beyond_the_border_are_not_visible():
    points = np.array([[0, 0, -5.0], [0, 0, 0], [100, 0, 1], [0.4905, 0, 1], [0.49, 0, 1], [-0.5, -0.2, 1]])
    pixels, visible = project(points, CAMERA)
    assert visible.tolist() == [False, False, False, False, True, True]
    assert np.isnan(pixels[:2]).all()


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_the_inverse_of_a_rigid_transform_undoes_it(numbers):
    T = rigid_transform(Rotation.from_rotvec(numbers[:3]).as_matrix(), np.array(numbers[3:]))
    np.testing.assert_allclose(invert_rigid(T) @ T, np.eye(4), atol=1e-12)


def test_resizing_moves_pixels_as_averaging_blocks_of_them_does():
    """A 2x2 block with centres 2 and 3 becomes the pixel with centre 1: u' = (u + 1/2)/2 - 1/2."""
    half = CAMERA.resized((20, 50))
    point = np.array([[0.13, -0.07, 1.0]])
    full_pixel, half_pixel = project(point, CAMERA)[0], project(point, half)[0]
    np.testing.assert_allclose(half_pixel, (full_pixel + 0.5) / 2 - 0.5)


def test_resizing_there_and_back_changes_nothing():
    again = CAMERA.resized((96, 320)).resized(CAMERA.size)
    np.testing.assert_allclose(again.K, CAMERA.K, atol=1e-12)


@pytest.mark.parametrize(
    ("entry", "number", "expected"),
    [((0, 2), np.nan, "finite numbers"), ((0, 0), 0.99, "focal lengths"), ((1, 1), 4001, "focal lengths")],
)
def test_what_no_lens_has_is_refused(entry, number, expected):
    """Images of 40 x 100 pixels: focal lengths from 1 to 10,000 along u, from 0.4 to 4,000 along v."""
    wrong = K.copy()
    wrong[entry] = number
    with pytest.raises(ArgumentError, match=f"K: expected {expected}"):
        Camera(wrong, np.eye(4), (40, 100))


def test_wrong_shapes_are_refused_by_name():
    with pytest.raises(ArgumentError, match="K: expected a 3x3"):
        Camera(np.eye(4), np.eye(4), (4, 4))
    with pytest.raises(ArgumentError, match="T_camera_from_lidar"):
        Camera(K, np.eye(3), (4, 4))
    with pytest.raises(ArgumentError, match="points"):
        project(np.zeros((5, 2)), CAMERA)

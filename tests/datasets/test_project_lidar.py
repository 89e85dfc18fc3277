"""Which returns the camera sees: a hand-computed scene."""

import numpy as np

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.project_lidar import closest_returns, seen_returns
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec

# The camera sits in the LIDAR and looks ahead: X = -y, Y = -z, Z = x. Pixel (2, 2) is straight ahead.
CAMERA = Camera(
    np.array([[10.0, 0, 2], [0, 10.0, 2], [0, 0, 1]]),
    np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    (5, 5),
)
SPEC = GridSpec(0.0, 40.0, -10.0, 10.0, 1.0)


def frame_of(*xyz):
    points = np.c_[np.array(xyz, np.float32), np.zeros(len(xyz), np.float32)]
    return Frame(None, points, CAMERA, np.eye(4), 0.0)


def test_closest_return_of_a_pixel_hides_the_others():
    pixels, cells = seen_returns(frame_of((30.5, 0.1, 0), (10.5, 0.1, 0), (20.5, 0.1, 0)), SPEC, (5, 5))
    assert pixels.tolist() == [2 * 5 + 2]
    assert cells.tolist() == [29 * 20 + 9]


def test_the_closest_returns_are_known_by_their_numbers():
    frame = frame_of((30.5, 0.1, 0), (10.5, 2.1, 1.05), (-5.0, 0.1, 0), (10.5, 0.1, 0))
    returns, uv = closest_returns(frame)
    assert dict(zip(returns.tolist(), map(tuple, uv.tolist()), strict=True)) == {1: (0, 1), 3: (2, 2)}


def test_left_is_left_and_up_is_up():
    pixels, cells = seen_returns(frame_of((10.5, 2.1, 1.05)), SPEC, (5, 5))
    assert pixels.tolist() == [1 * 5 + 0]
    assert cells.tolist() == [29 * 20 + 7]


def test_behind_beside_and_beyond_the_grid_nothing_is_seen():
    pixels, cells = seen_returns(frame_of((-10.5, 0.1, 0), (10.5, 9, 0), (60.5, 0.1, 0)), SPEC, (5, 5))
    assert len(pixels) == len(cells) == 0


def test_far_return_beyond_the_grid_is_hidden_but_a_near_one_hides():
    near_but_outside = GridSpec(20.0, 40.0, -10.0, 10.0, 1.0)
    pixels, _ = seen_returns(frame_of((10.5, 0.1, 0), (30.5, 0.1, 0)), near_but_outside, (5, 5))
    assert len(pixels) == 0


def test_pixel_of_the_resized_image_holds_that_of_the_camera():
    xyz = [(10.0, 2 - u, 2 - v) for v in range(5) for u in range(5)]
    pixels, _ = seen_returns(frame_of(*xyz), SPEC, (10, 15))
    rows, cols = np.divmod(pixels, 15)
    # The camera's pixel (v, u) covers rows 2v, 2v + 1 and columns 3u to 3u + 2; its centre lies at the end of row 2v.
    assert rows.tolist() == [2 * v + 1 for v in range(5) for _ in range(5)]
    assert cols.tolist() == [3 * u + 1 for _ in range(5) for u in range(5)]

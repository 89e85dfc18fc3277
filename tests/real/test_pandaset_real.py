"""PandaSet's reader on a real scene: what it says of the street is plausible, and the LIDAR stands where it is said."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data_samples.make_real import needed_returns
from semgrid_edu.datasets import PandasetScene
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14

pytestmark = pytest.mark.real

ROAD, CAR = KITTI_14.index("road"), KITTI_14.index("car")


@pytest.fixture(scope="module")
def root():
    if not os.environ.get("PANDASET"):
        pytest.skip("needs real PandaSet data: set PANDASET to the folder that holds 002")
    return Path(os.environ["PANDASET"])


@pytest.fixture(scope="module")
def scene(root):
    return PandasetScene(root, "002")


@pytest.mark.parametrize("camera", ["front_camera", "left_camera"])
def test_every_frame_is_sound(root, camera):
    assert PandasetScene(root, "002", camera).problems() == []


PUBLISHED = {
    "front_camera": (0.000, -0.039, -0.044),
    "front_left_camera": (-0.258, -0.307, -0.924),
    "front_right_camera": (0.255, -0.249, -0.869),
    "left_camera": (0.239, -0.280, -0.538),
    "right_camera": (-0.231, -0.308, -0.685),
    "back_camera": (-0.000, -0.217, -1.055),
}
"""Where the Pandar64 is in the frame of each camera, by the extrinsics that come with PandaSet's devkit, metres."""


@pytest.mark.parametrize("camera", PUBLISHED)
def test_the_lidar_stands_where_the_published_extrinsics_say(root, camera):
    T_camera_from_lidar = PandasetScene(root, "002", camera).camera.T_camera_from_lidar
    np.testing.assert_allclose(T_camera_from_lidar[:3, 3], PUBLISHED[camera], atol=0.04)


def test_the_road_lies_at_height_zero(scene):
    frame, truth = scene[5], scene.truth(5, GridSpec(0, 71, -15.5, 15.5, 0.5))
    rows, cols, inside = GridSpec(0, 71, -15.5, 15.5, 0.5).cells(frame.points_grid)
    near = inside & (np.hypot(*frame.points_grid[:, :2].T) < 15)
    on_road = frame.points_grid[near][truth[rows[near], cols[near]] == ROAD, 2]
    assert np.median(on_road) == pytest.approx(0, abs=0.1)


def test_more_scans_label_more_cells_and_no_moving_car_is_smeared(scene):
    spec = GridSpec.paper()
    one, many = (scene.truth(10, spec, before=n, after=n) for n in (0, 9))
    assert 0.1 < (one != IGNORE).mean() < 0.2 < (many != IGNORE).mean() < 0.4
    both = (one != IGNORE) & (many != IGNORE)
    assert (one == many)[both].mean() > 0.95
    assert (many == CAR).sum() < 2.5 * (one == CAR).sum()


def test_the_filter_does_not_miss_the_returns_that_the_excerpt_leaves_out(scene):
    frames, spec = [scene._without_labels(k) for k in range(10)], GridSpec.paper()
    needed = [needed_returns(frame.points_grid) for frame in frames]
    fewer = [
        replace(f, points=f.points[some], vehicle_returns=f.vehicle_returns[some])
        for f, some in zip(frames, needed, strict=True)
    ]
    assert sum(len(frame.points) for frame in fewer) < 0.5 * sum(len(frame.points) for frame in frames)
    for whole, reduced in zip(track_drive(frames, spec), track_drive(fewer, spec), strict=True):
        np.testing.assert_array_equal(whole.probability, reduced.probability)

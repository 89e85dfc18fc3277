"""Errors like real data's: what they change and what they don't, and that a seed fixes them."""

from dataclasses import replace

import numpy as np
import pytest

from semgrid_edu.camera import Camera
from semgrid_edu.datasets.ground_truth.window import EgoVelocity, skew_scan
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.workshop.flaws import NO_FLAWS, TruthFlaws, flawed_drive, flawed_frame, flawed_labels, miscalibrated

ROAD, CAR, SKY = (KITTI_14.index(name) for name in ("road", "car", "sky"))
CAMERA = Camera(
    np.array([[100.0, 0, 50], [0, 100.0, 30], [0, 0, 1]]),
    np.array([[0.0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    (60, 100),
)


def street():
    """A road with a car of 20 x 30 pixels, one of 4 x 5, and a patch of road of 3 x 3 in the first."""
    labels = np.full((60, 100), ROAD, np.uint8)
    labels[20:40, 20:50] = CAR
    labels[30:34, 70:75] = CAR
    labels[28:31, 30:33] = ROAD
    return labels


def frame(k=0):
    nothing = np.full(LABEL_GRID.shape, IGNORE, np.uint8)
    depth = np.ones((60, 100), np.float32)
    labels = FrameLabels(KITTI_14, street(), depth, nothing, np.zeros(LABEL_GRID.shape, bool))
    pose = np.eye(4)
    pose[0, 3] = k
    points = np.array([[10, 5, 0, 0.5], [20, -5, 0, 0.5]], np.float32)
    return Frame(None, points, CAMERA, pose, 0.1 * k, labels)


def test_without_flaws_nothing_changes():
    same = flawed_frame(frame(), NO_FLAWS, seed=3, velocity=EgoVelocity(10, 0, 0))
    np.testing.assert_array_equal(same.labels.image, street())
    np.testing.assert_array_equal(same.points, frame().points)
    np.testing.assert_array_equal(same.camera.T_camera_from_lidar, CAMERA.T_camera_from_lidar)


def test_small_things_are_missed_but_no_large_ones_and_no_gaps():
    flaws = replace(NO_FLAWS, small=40, missed=1.0)
    expected = street()
    expected[30:34, 70:75] = ROAD
    np.testing.assert_array_equal(flawed_labels(street(), KITTI_14, flaws, np.random.default_rng(0)), expected)


def test_as_many_are_missed_as_the_probability_says():
    labels = np.full((200, 200), ROAD, np.uint8)
    labels[::4, ::4] = CAR
    found = flawed_labels(labels, KITTI_14, replace(NO_FLAWS, small=2, missed=0.3), np.random.default_rng(0))
    assert 1 - (found == CAR).sum() / 2500 == pytest.approx(0.3, abs=0.03)  # 3 standard deviations


def test_outlines_shift_and_nothing_else_does():
    flaws = replace(NO_FLAWS, outline=1.0)
    changed = flawed_labels(street(), KITTI_14, flaws, np.random.default_rng(0)) != street()
    assert 0 < changed.mean() < 0.05
    rows, cols = np.nonzero(changed)
    labels = np.pad(street(), 4, mode="edge")
    near = [np.unique(labels[r : r + 9, c : c + 9]).size for r, c in zip(rows, cols, strict=True)]
    assert min(near) == 2  # both classes lie within 4 pixels of each change


def test_the_calibration_is_off_by_as_much_as_said():
    flaws = TruthFlaws(rotation=0.5, translation=0.1)
    errors = [
        miscalibrated(CAMERA, flaws, np.random.default_rng(seed)).T_camera_from_lidar
        @ np.linalg.inv(CAMERA.T_camera_from_lidar)
        for seed in range(300)
    ]
    shifts, turns = np.array([e[:3, 3] for e in errors]), np.array([[e[2, 1], e[0, 2], e[1, 0]] for e in errors])
    assert np.sqrt((shifts**2).mean()) == pytest.approx(0.1, rel=0.1)
    assert np.degrees(np.sqrt((turns**2).mean())) == pytest.approx(0.5, rel=0.1)
    np.testing.assert_allclose(errors[0][:3, :3] @ errors[0][:3, :3].T, np.eye(3), atol=1e-12)


def test_frames_of_a_drive_share_their_calibration_but_not_their_labels():
    flaws = TruthFlaws(outline=1.0, skewed=True)
    drive = flawed_drive([frame(0), frame(1), frame(2)], flaws, seed=5)
    cameras = [one.camera.T_camera_from_lidar for one in drive]
    np.testing.assert_array_equal(cameras[0], cameras[1])
    assert (cameras[0] != CAMERA.T_camera_from_lidar).any()
    assert (drive[0].labels.image != drive[1].labels.image).any()
    np.testing.assert_array_equal(drive[1].points, skew_scan(frame().points, EgoVelocity(10.0, 0.0, 0.0)))
    np.testing.assert_array_equal(drive[1].labels.birdseye, frame().labels.birdseye)
    again = flawed_drive([frame(0), frame(1), frame(2)], flaws, seed=5)
    other = flawed_drive([frame(0), frame(1), frame(2)], flaws, seed=5, number=1)
    for one, two, three in zip(drive, again, other, strict=True):
        np.testing.assert_array_equal(one.labels.image, two.labels.image)
        np.testing.assert_array_equal(one.camera.T_camera_from_lidar, three.camera.T_camera_from_lidar)
        assert (one.labels.image != three.labels.image).any()


def test_a_frame_alone_is_not_skewed_and_may_lack_labels():
    (one,) = flawed_drive([replace(frame(), labels=None)], TruthFlaws(skewed=True), seed=0)
    assert one.labels is None
    np.testing.assert_array_equal(one.points, frame().points)


@pytest.mark.parametrize(
    "wrong", [{"rotation": -1.0}, {"missed": 1.5}, {"outline": np.nan}, {"small": np.inf}], ids=str
)
def test_errors_that_cannot_be_are_refused(wrong):
    with pytest.raises(ArgumentError, match=next(iter(wrong))):
        TruthFlaws(**wrong)

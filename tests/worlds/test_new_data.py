"""Checks of new data, on cases whose answer is known: by hand, from the simulator, or from a fault made on purpose."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from worlds.lecture_13_checks import (
    AXES,
    axes_errors,
    ground_plane,
    overlay_error,
    share_on_image,
    time_gaps,
    wall_lean,
)
from worlds.lecture_13_domain import (
    agrees_with_lidar,
    colour_distance,
    image_histograms,
    image_statistics,
    match_colours,
    mean_histograms,
    normalised_entropy,
    training_images,
)
from worlds.lecture_13_faults import FAULTS, TURN, YAWS, drive_readings
from worlds.lecture_13_real_drive import moving_hits, read_boxes, real_drive_table, sample_boxes
from worlds.lecture_13_scan_borders import depth_edges, edge_contrast, ring_by_ring

import semgrid_edu
from semgrid_edu.camera import Camera
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.fast import track_drive
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.course.street import motion_between

COMMITTED = Path(semgrid_edu.__file__).parents[1] / "docs" / "results" / "real_drive.json"


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """Return eleven frames of the shipped drive, whose calibration and poses are right but for a small error."""
    return sample_drive()[4:15]


def test_gaps_by_hand_and_times_that_run_backwards():
    assert time_gaps([0.0, 0.1, 0.2, 0.4, 0.5, 0.9]).tolist() == [2, 4]
    assert time_gaps([3.0, 3.5]).tolist() == []
    for bad in ([1.0], [0.0, 0.2, 0.1]):
        with pytest.raises(ArgumentError, match="times"):
            time_gaps(bad)


def test_share_of_returns_on_the_image_by_hand():
    T = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    camera = Camera(np.array([[100.0, 0, 50], [0, 100, 20], [0, 0, 1]]), T, (41, 101))
    points = np.array([[10.0, 0, 0], [10, 4, 0], [10, -6, 0], [10, 0, 4], [-10, 0, 0]])
    assert share_on_image(points, camera) == 2 / 4
    assert np.isnan(share_on_image(points[4:], camera))


def test_ground_is_found_below_a_car():
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(3, 20, 500), rng.uniform(-1.5, 1.5, 500), np.zeros(500)])
    points[:, 2] = -1.7 + 0.02 * points[:, 0] - 0.01 * points[:, 1]
    points[:80, 2] = rng.uniform(-1.5, 0, 80)
    plane = ground_plane(points, 1.73)
    np.testing.assert_allclose(plane, [1.7, np.degrees(np.arctan(0.02)), np.degrees(np.arctan(-0.01))], atol=0.05)
    with pytest.raises(ArgumentError, match="ground"):
        ground_plane(points[:5], 1.73)


def test_borders_are_the_near_sides_of_jumps_along_a_ring():
    angle = np.radians([2.0, 1, 0, -1, -2, -40])
    distance = np.array([20.0, 20, 8, 8, 30, 60])
    points = distance[:, None] * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(6)])
    np.testing.assert_allclose(np.linalg.norm(depth_edges(points), axis=1), [8, 8])
    np.testing.assert_allclose(depth_edges(points), points[2:4])


def test_a_scan_that_is_sorted_by_time_gives_the_borders_that_one_ring_by_ring_gives():
    ring = np.array([20.0, 20, 8, 8, 30, 30])
    azimuth, elevation = np.meshgrid(np.radians([2.0, 1, 0, -1, -2, -3]), np.radians([-6.0, 0, 6]))
    direction = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    scan = (ring * np.array(direction)).transpose(1, 2, 0)  # (rings, columns, 3)
    by_time = scan.transpose(1, 0, 2).reshape(-1, 3)
    assert ring_by_ring(scan.reshape(-1, 3)).tolist() == scan.reshape(-1, 3).tolist()
    assert ring_by_ring(by_time).tolist() == scan.reshape(-1, 3).tolist()
    np.testing.assert_allclose(depth_edges(by_time), depth_edges(scan.reshape(-1, 3)))
    assert len(depth_edges(by_time)) == 6


def test_what_is_no_wall_tells_no_lean(frames):
    box, low, high = (5, 20, -12, -6), (5, -12, -0.5, 0), (20, -6, 6, 1)
    scattered = np.random.default_rng(0).uniform(low, high, (500, 4))
    with pytest.raises(ArgumentError, match="box"):
        wall_lean(replace(frames[0], points=scattered[:50]), box)
    with pytest.raises(ArgumentError, match="a wall"):
        wall_lean(replace(frames[0], points=scattered), box)


def test_motion_of_the_poses_lays_scans_over_each_other(frames):
    right, wrong = motion_between(frames[0], frames[5]), motion_between(frames[5], frames[0])
    assert overlay_error(frames[0], frames[0], np.eye(4)) == 0
    assert overlay_error(frames[0], frames[5], right) < overlay_error(frames[0], frames[5], wrong) / 4
    errors = axes_errors(frames)
    assert errors["as the poses say"] < errors["no motion"] / 1.5 < errors["backwards"]
    with pytest.raises(ArgumentError, match="apart"):
        axes_errors(frames, apart=11)


def test_mistakes_with_axes_are_motions_too():
    T = np.array([[0.0, -1, 0, 3], [1, 0, 0, 2], [0, 0, 1, 1], [0, 0, 0, 1]])
    moves = {name: mistake(T)[:3, 3].tolist() for name, mistake in AXES.items()}
    assert moves == {
        "as the poses say": [3, 2, 1],
        "left and right swapped": [3, -2, 1],
        "backwards": [-3, -2, 1],
        "a quarter turn": [-2, 3, 1],
        "no motion": [0, 0, 0],
    }


def test_a_gap_of_scans_is_a_gap_in_time_and_checked_around(frames):
    silent = [replace(frame, points=frame.points[:0]) if k in (4, 5) else frame for k, frame in enumerate(frames)]
    known = mean_histograms(training_images())
    read = drive_readings(silent, known, every=2)
    assert read == drive_readings([*frames[:4], *frames[6:]], known, every=2)
    assert read["gaps"] == 1


def test_each_fault_moves_its_own_reading(frames):
    known = mean_histograms(training_images())
    read = {name: drive_readings(make(frames), known, every=2) for name, make in FAULTS.items()}
    sound = read["none"]
    assert abs(sound["yaw"]) <= 0.5
    assert abs(sound["tilt"]) < 0.1
    assert sound["gaps"] == sound["motion"] == 0
    assert read["two frames lost"]["gaps"] == 1
    assert read["camera turned"]["yaw"] - sound["yaw"] == pytest.approx(TURN, abs=0.5)
    assert read["LIDAR tilted"]["tilt"] - sound["tilt"] == pytest.approx(-TURN, abs=0.05)
    assert read["poses backwards"]["motion"] > 1
    # The vehicle drives straight on, and a street is grey: these two faults go unnoticed.
    assert read["poses mirrored"]["motion"] < 0.05
    assert read["red and blue swapped"]["colours"] == pytest.approx(sound["colours"], abs=0.05)


def test_contrast_without_borders_in_the_image_is_flat(frames):
    noise = np.random.default_rng(0).integers(0, 256, frames[0].image.shape, np.uint8)
    contrast = edge_contrast(replace(frames[0], image=noise), YAWS)
    np.testing.assert_allclose(contrast, 1, atol=0.1)


def test_histograms_and_statistics_of_two_colours():
    image = np.zeros((4, 8, 3), np.uint8)
    image[:, 4:] = 200, 100, 0
    histograms = image_histograms(image)
    assert {name: one.sum() for name, one in histograms.items()} == pytest.approx(dict.fromkeys(histograms, 1.0))
    assert histograms["red"][25] == histograms["red"][0] == 0.5
    assert histograms["blue"][0] == 1
    statistics = image_statistics(image)
    assert statistics["brightness"] == statistics["contrast"] == 50
    assert statistics["saturation"] == 100
    swapped = image_histograms(image[..., ::-1].copy())
    assert colour_distance(histograms, histograms) == 0
    assert colour_distance(histograms, swapped) == pytest.approx(1 / 3)


def test_matched_colours_have_the_histogram_of_the_reference_and_keep_the_order():
    rng = np.random.default_rng(1)
    image = rng.permutation(np.arange(192) % 64 * 4).reshape(8, 8, 3).astype(np.uint8)
    image[..., 0], image[..., 1], image[..., 2] = (rng.permutation(64).reshape(8, 8) for _ in range(3))
    reference = (100 + 2 * np.arange(64, dtype=np.uint8))[:, None].repeat(3, axis=1)
    matched = match_colours(image, reference)
    for k in range(3):
        np.testing.assert_array_equal(np.sort(matched[..., k].ravel()), reference[:, k])
        assert np.all(np.diff(matched[..., k].ravel()[image[..., k].argsort(axis=None)].astype(int)) > 0)


def test_entropy_is_nothing_when_sure_and_one_when_even():
    p = np.array([[1.0, 0.25, 0.5], [0, 0.25, 0.5], [0, 0.25, 0], [0, 0.25, 0]])
    np.testing.assert_allclose(normalised_entropy(p), [0, 1, 0.5])


def test_agreement_with_the_lidar_by_hand(frames):
    camera = replace(frames[0].camera, lidar_height=1.73)
    points = np.array([[10, 0, -1.73, 0], [12, 1, -1.7, 0], [15, -1, 0, 0], [15, 3, 0.5, 0]], np.float32)
    frame = replace(frames[0], points=points, camera=camera)
    labels = np.full(camera.size, KITTI_14.index("road"))
    assert agrees_with_lidar(frame, labels) == (1.0, 0.0)
    labels[:] = KITTI_14.index("building")
    assert agrees_with_lidar(frame, labels) == (0.0, 1.0)
    labels[:, : camera.size[1] // 2] = KITTI_14.index("sky")  # the left half, with one of the two that stand
    assert agrees_with_lidar(frame, labels).standing == 0.5


def test_the_filter_finds_the_moving_cars_of_the_sample_drive():
    drive, spec = sample_drive(), GridSpec.compact()
    boxes = sample_boxes(drive)
    beliefs = list(track_drive(drive[:], spec))
    hits = [moving_hits(drive[k], beliefs[k], boxes.get(k, []), spec) for k in range(12, 20)]
    assert np.concatenate(hits).mean() > 0.8
    assert moving_hits(drive[0], beliefs[0], [], spec).size == 0


def test_boxes_are_read_by_frame(tmp_path):
    path = tmp_path / "moving_cars_0013.json"
    assert read_boxes(path) == {}
    path.write_text(json.dumps({"about": "cars", "car_1": {"4": [1, 2, 3, 4, 99]}, "car_2": {"4": [5, 6, 7, 8, 9]}}))
    assert read_boxes(path) == {4: [[1, 2, 3, 4], [5, 6, 7, 8]]}


def test_committed_result_says_how_it_was_made_and_has_a_table():
    result = json.loads(COMMITTED.read_text())
    assert result["command"].startswith("python -m worlds.lecture_13_real_drive")
    assert {"date", "versions", "seed", "minutes"} <= result.keys()
    assert "ground: height" in real_drive_table(result)

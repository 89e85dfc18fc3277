"""What `demo --rerun` writes, read back by Rerun's own reader; skipped without the extra."""

from dataclasses import replace

import numpy as np
import pytest

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.files import check_ours
from semgrid_edu.workshop.demo.rerun import APPLICATION, rerun_recording

chunk = pytest.importorskip("rerun.chunk", reason="the extra rerun isn't installed, or too old to read recordings")


def seconds_of(row):
    return row["time"].total_seconds() if row.get("time") else 0.0


@pytest.fixture(scope="module")
def path(told, last_labelled, tmp_path_factory):
    path = tmp_path_factory.mktemp("rerun") / "drive.rrd"
    with rerun_recording(path, GridSpec.compact(), KITTI_14, last_labelled.camera) as take:
        for result in told:
            take(result)
    return path


def rows_of(path):
    """The rows of each place in the recording's tree, as dictionaries, in the order of time."""
    found = {}
    for one in chunk.RrdReader(path).stream():
        found.setdefault(one.entity_path, []).extend(one.to_record_batch().to_pylist())
    return {place: sorted(rows, key=seconds_of) for place, rows in found.items()}


@pytest.fixture(scope="module")
def rows(path):
    return rows_of(path)


def test_frames_are_at_their_seconds(rows, told):
    for place in ("/world/lidar", "/world/lidar/points", "/maps/occupancy", "/maps/classes", "/maps/truth"):
        seconds = [seconds_of(row) for row in rows[place]]
        assert seconds == pytest.approx([result.frame.time for result in told], abs=1e-6)


def test_points_and_poses_are_those_of_the_frames(rows, told):
    for k, result in enumerate(told):
        positions = np.array(rows["/world/lidar/points"][k]["Points3D:positions"])
        np.testing.assert_allclose(positions, result.frame.points[:, :3], atol=1e-5)
        place = rows["/world/lidar"][k]["Transform3D:translation"][0]
        np.testing.assert_allclose(place, result.frame.T_world_from_lidar[:3, 3], atol=1e-5)
        columns = np.array(rows["/world/lidar"][k]["Transform3D:mat3x3"][0]).reshape(3, 3)
        np.testing.assert_allclose(columns.T, result.frame.T_world_from_lidar[:3, :3], atol=1e-6)


def test_a_camera_that_nods_is_logged_for_each_frame(told, tmp_path):
    """As PandaSet's does against its level LIDAR: a point of the LIDAR is where each frame's own camera sees it."""
    nods = []
    for angle in (0.0, 0.1):
        T = np.eye(4)
        T[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        camera = told[0].frame.camera
        camera = replace(camera, T_camera_from_lidar=T @ camera.T_camera_from_lidar)
        nods.append(replace(told[0], frame=replace(told[0].frame, camera=camera, time=angle)))
    with rerun_recording(tmp_path / "a.rrd", GridSpec.compact(), KITTI_14, camera) as take:
        for result in nods:
            take(result)
    poses = [row for row in rows_of(tmp_path / "a.rrd")["/world/lidar/camera"] if row.get("Transform3D:mat3x3")]
    for row, result in zip(poses, nods, strict=True):
        rotation = np.array(row["Transform3D:mat3x3"][0]).reshape(3, 3).T  # column by column
        ahead = rotation @ (1, 2, 30) + row["Transform3D:translation"][0]
        expected = np.linalg.inv(result.frame.camera.T_camera_from_lidar) @ (1, 2, 30, 1)
        np.testing.assert_allclose(ahead, expected[:3], atol=1e-4)


def test_maps_are_those_of_the_results_and_truth_is_shown_where_known(rows, told):
    shape = GridSpec.compact().shape
    for row, result in zip(rows["/maps/classes"], told, strict=True):
        numbers = np.array(row["SegmentationImage:buffer"][0], np.uint8).reshape(shape)
        np.testing.assert_array_equal(numbers, result.refined.argmax(axis=0))
    *unknown, known = rows["/maps/truth"]
    assert [row.get("SegmentationImage:buffer") for row in unknown] == [None, None]
    truth = grid_truth(told[-1].frame.labels, told[-1].belief.probability, GridSpec.compact())
    shown = np.array(known["SegmentationImage:buffer"][0], np.uint8).reshape(shape)
    np.testing.assert_array_equal(shown, truth)


def test_the_image_has_its_calibration(rows, last_labelled):
    (row,) = [row for row in rows["/world/lidar/camera/image"] if row.get("Pinhole:image_from_camera")]
    K = np.array(row["Pinhole:image_from_camera"][0]).reshape(3, 3).T  # column by column
    np.testing.assert_allclose(K - last_labelled.camera.K, [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]], atol=1e-5)


def test_a_recording_of_ours_may_be_replaced(path):
    check_ours(APPLICATION, path)


def test_nothing_is_left_of_a_drive_that_is_interrupted(last_labelled, tmp_path):
    recording = rerun_recording(tmp_path / "a.rrd", GridSpec.compact(), KITTI_14, last_labelled.camera)
    with pytest.raises(KeyboardInterrupt), recording:
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []

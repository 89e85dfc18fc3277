"""What `demo --rerun` writes, read back by Rerun's own reader; skipped without the extra."""

import numpy as np
import pytest

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.grid import GridSpec
from semgrid_edu.storage.files import check_ours
from semgrid_edu.workshop.demo.rerun import APPLICATION, rerun_recording

chunk = pytest.importorskip("rerun.chunk", reason="the extra rerun isn't installed")


def seconds_of(row):
    return row["time"].total_seconds() if row.get("time") else 0.0


@pytest.fixture(scope="module")
def path(told, net, last_labelled, tmp_path_factory):
    path = tmp_path_factory.mktemp("rerun") / "drive.rrd"
    with rerun_recording(path, net, last_labelled.camera) as take:
        for result in told:
            take(result)
    return path


@pytest.fixture(scope="module")
def rows(path):
    """The rows of each place in the recording's tree, as dictionaries, in the order of time."""
    found = {}
    for one in chunk.RrdReader(path).stream():
        found.setdefault(one.entity_path, []).extend(one.to_record_batch().to_pylist())
    return {place: sorted(rows, key=seconds_of) for place, rows in found.items()}


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


def test_nothing_is_left_of_a_drive_that_is_interrupted(net, last_labelled, tmp_path):
    with pytest.raises(KeyboardInterrupt), rerun_recording(tmp_path / "a.rrd", net, last_labelled.camera):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []

"""An excerpt of a real scene reads back like the scene, and the filter doesn't notice the missing returns."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from tiny_pandaset import NUMBERS, SCENE, STEP, write_tiny_pandaset

from data_samples.make_real import needed_returns, write_real_excerpt
from semgrid_edu.camera import invert_rigid
from semgrid_edu.datasets import KittiRawDrive, PandasetScene
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.storage.provenance import provenance_problems
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E, Rig
from semgrid_edu.workshop.simulation.street.plan import Wishes

SPEC = GridSpec.compact()


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return write_tiny_pandaset(tmp_path_factory.mktemp("pandaset"))


@pytest.fixture(scope="module")
def folder(root, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out") / "real"
    write_real_excerpt(root, SCENE, len(NUMBERS), folder)
    return folder


@pytest.fixture(scope="module")
def drive(folder):
    return KittiRawDrive(folder, "1970_01_01", "0002")


def test_the_reader_finds_a_complete_drive(drive, folder):
    assert drive.problems() == []
    assert len(drive) == len(NUMBERS)
    assert provenance_problems(folder) == []


def test_poses_read_back_within_a_centimetre(drive):
    for k, number in enumerate(NUMBERS):
        T = invert_rigid(drive[0].T_world_from_lidar) @ drive[k].T_world_from_lidar
        np.testing.assert_allclose(T[:3, 3], [STEP * number, 0, 0], atol=0.01)
        np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-6)
        assert drive[k].time == pytest.approx(0.1 * number, abs=1e-4)


def test_cells_have_the_classes_of_the_scene(drive, root):
    scene = PandasetScene(root, SCENE)
    for k, frame in enumerate(drive):
        assert frame.labels.label_set is KITTI_14
        assert np.mean(frame.labels.birdseye_on(SPEC) == scene.truth(k, SPEC)) > 0.99


def test_its_labels_have_gaps(drive):
    assert (drive.undecided(0, SPEC) & (drive.truth(0, SPEC) == IGNORE)).any()
    assert not sample_drive().undecided(0, SPEC).any()


def test_the_same_command_gives_the_same_bytes(root, folder, tmp_path):
    write_real_excerpt(root, SCENE, len(NUMBERS), tmp_path / "real")
    files = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    again = {path.relative_to(tmp_path / "real"): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert files == again


def test_the_filter_gives_the_same_belief_without_the_other_returns():
    """With full-circle scans in a bend, where the filter's map rotates relative to the grid."""
    simulated = SimulatedDrive(11, 4, Wishes(layout="bend", speed=12.0), Rig(lidar=replace(HDL64E, azimuth_step=0.9)))
    frames = [simulated.scan(k) for k in range(4)]
    kept = [needed_returns(frame.points_grid) for frame in frames]
    assert np.mean(np.concatenate(kept)) < 0.9
    fewer = [replace(frame, points=frame.points[one]) for frame, one in zip(frames, kept, strict=True)]
    for all_returns, needed in zip(track_drive(frames, SPEC), track_drive(fewer, SPEC), strict=True):
        np.testing.assert_array_equal(all_returns.probability, needed.probability)


def test_too_few_frames_and_a_folder_with_files_are_errors(root, tmp_path):
    with pytest.raises(ArgumentError, match="n_frames: expected 2 to 3 frames, found 4"):
        write_real_excerpt(root, SCENE, 4, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    (tmp_path / "mine.txt").touch()
    with pytest.raises(DataError, match="expected a new or an empty folder, found one with files"):
        write_real_excerpt(root, SCENE, 2, tmp_path)


def test_a_scene_without_labels_is_an_error_before_anything_is_written(tmp_path):
    bare = write_tiny_pandaset(tmp_path / "bare")
    shutil.rmtree(bare / SCENE / "annotations")
    with pytest.raises(DataError, match="expected the classes of the returns, found no folder"):
        write_real_excerpt(bare, SCENE, 2, tmp_path / "new")
    assert not (tmp_path / "new").exists()

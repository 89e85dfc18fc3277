"""The cached training set of a hand-made data set: what it holds, and when it is made anew."""

import json
import shutil

import numpy as np
import pytest
from tiny_drive import DATE, SIZE, write_tiny_dataset
from typer.testing import CliRunner

from semgrid_edu.datasets import KittiRawDrive, grid_truth, training_cache
from semgrid_edu.errors import ArgumentError, DataError
from semgrid_edu.fast import TrainingSet, track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams
from semgrid_edu.planes import cell_heights
from semgrid_edu.storage.files import CACHE_VARIABLE, cache_folder
from semgrid_edu.workshop.commands.main import app

SMALL = (6, 20)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A data set whose training split is in the cache."""
    root = write_tiny_dataset(tmp_path_factory.mktemp("tiny"))
    TrainingSet(root, "train", image_size=SMALL)
    return root


@pytest.fixture
def no_work(monkeypatch):
    """Whatever would make arrays anew fails instead."""

    def refuse(*_):
        raise AssertionError("made anew")

    monkeypatch.setattr(training_cache, "in_each_drive", refuse)


@pytest.mark.usefixtures("no_work")
class TestBuilt:
    def test_holds_what_the_readers_and_the_filter_give(self, built):
        training, spec = TrainingSet(built, "train", image_size=SMALL), GridSpec.compact()
        assert len(training) == 2
        for sample, name in zip(training, ("0001", "0002"), strict=True):
            drive = KittiRawDrive(built, DATE, name)
            *_, belief = track_drive(drive, spec, seed=0)
            np.testing.assert_array_equal(sample.occupancy, belief.probability)
            heights = cell_heights(drive[2].points_grid, spec)
            np.testing.assert_array_equal(sample.return_heights, heights.astype(np.float32))
            np.testing.assert_array_equal(sample.truth, grid_truth(drive[2].labels, belief.probability, spec))
            blocks = drive[2].image.reshape(6, 2, 20, 2, 3).mean(axis=(1, 3)).transpose(2, 0, 1)
            np.testing.assert_allclose(sample.image.numpy(), blocks, atol=1)

    def test_returns_lie_where_the_wall_stands(self, built):
        # The wall of the hand-made drive stands 30 m ahead of the LIDAR: row (71 - 30) / 0.5 of the grid.
        pixels, cells = TrainingSet(built, "train", image_size=SMALL).returns(1)
        rows = cells // GridSpec.compact().shape[1]
        assert len(pixels) == len(cells) > 50
        assert np.bincount(rows).argmax() == 82
        assert pixels.max() < SMALL[0] * SMALL[1]

    def test_camera_is_that_of_the_resized_images(self, built):
        camera = TrainingSet(built, "train", image_size=SMALL).camera
        assert camera.size == SMALL
        np.testing.assert_array_equal(camera.K, KittiRawDrive(built, DATE, "0001").camera.resized(SMALL).K)

    @pytest.mark.parametrize(
        "change",
        [{"image_size": SIZE}, {"spec": GridSpec(0, 71, -15.5, 15.5, 1.0)}, {"params": CmcdotParams(n_particles=999)}],
    )
    def test_another_recipe_is_not_in_the_cache(self, built, change):
        with pytest.raises(AssertionError, match="made anew"):
            TrainingSet(built, "train", **{"image_size": SMALL, **change})

    def test_another_index_is_not_in_the_cache(self, built, tmp_path):
        root = shutil.copytree(built, tmp_path / "copy")
        text = (root / "dataset.json").read_text().replace('"frame": 2', '"frame": 1')
        (root / "dataset.json").write_text(text)
        with pytest.raises(AssertionError, match="made anew"):
            TrainingSet(root, "train", image_size=SMALL)

    def test_a_scan_changed_in_place_is_not_in_the_cache(self, built, tmp_path):
        """The same name and the same size, other points."""
        root = shutil.copytree(built, tmp_path / "copy")
        scan = root / DATE / f"{DATE}_drive_0002_sync" / "velodyne_points" / "data" / "0000000001.bin"
        scan.write_bytes(scan.read_bytes()[16:] + scan.read_bytes()[:16])
        with pytest.raises(AssertionError, match="made anew"):
            TrainingSet(root, "train", image_size=SMALL)

    def test_damaged_array_is_named(self, built, tmp_path):
        root = shutil.copytree(built, tmp_path / "copy")
        (path,) = root.glob("cache/train-*.npz")
        path.write_bytes(path.read_bytes()[:-5])
        with pytest.raises(DataError, match=rf"{path.name}: .*delete the file to compute them again"):
            TrainingSet(root, "train", image_size=SMALL)

    def test_unknown_split_is_named(self, built):
        with pytest.raises(ArgumentError, match="split"):
            TrainingSet(built, "validation")


class TestCacheFolder:
    def test_another_folder_leaves_the_data_as_they_are(self, tmp_path, monkeypatch):
        root = write_tiny_dataset(tmp_path / "data")
        before = sorted(root.rglob("*"))
        monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "elsewhere"))
        training = TrainingSet(root, "train", image_size=SMALL)
        assert sorted(root.rglob("*")) == before
        monkeypatch.setattr(training_cache, "in_each_drive", None)
        again = TrainingSet(root, "train", image_size=SMALL)
        np.testing.assert_array_equal(training.arrays["occupancy"], again.arrays["occupancy"])

    def test_two_data_sets_share_a_folder(self, tmp_path, monkeypatch):
        monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "elsewhere"))
        first, second = (write_tiny_dataset(tmp_path / name) for name in ("first", "second"))
        scan = second / DATE / f"{DATE}_drive_0001_sync" / "velodyne_points" / "data" / "0000000002.bin"
        scan.write_bytes(scan.read_bytes()[: 16 * 40])
        grids = [TrainingSet(root, "train", image_size=SMALL).arrays["occupancy"][0] for root in (first, second)]
        assert not np.array_equal(*grids)

    def test_folder_that_cannot_be_written_is_named_with_a_way_out(self, tmp_path):
        root = write_tiny_dataset(tmp_path)
        (root / "cache").write_text("a file")
        with pytest.raises(DataError, match=r"cache.*--cache"):
            TrainingSet(root, "train", image_size=SMALL)


def test_the_command_line_passes_the_folder_on(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, "")  # so that what the command sets is undone afterwards
    CliRunner().invoke(app, ["--cache", str(tmp_path / "elsewhere"), "data", "verify"])
    assert cache_folder(tmp_path) == tmp_path / "elsewhere"


def test_error_in_a_worker_names_the_file_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(training_cache, "WORKERS", 2)
    root = write_tiny_dataset(tmp_path)
    scan = root / DATE / f"{DATE}_drive_0002_sync" / "velodyne_points" / "data" / "0000000001.bin"
    scan.write_bytes(b"short")
    with pytest.raises(DataError, match=str(scan)):
        TrainingSet(root, "train", image_size=SMALL)
    assert not list(root.glob("cache/train*"))


class TestRefusals:
    def test_drives_of_two_cameras(self, tmp_path):
        root = write_tiny_dataset(tmp_path)
        other = shutil.copytree(root / DATE, root / "2026_01_02")
        for drive in other.glob("*_sync"):
            drive.rename(other / drive.name.replace(DATE, "2026_01_02"))
        calibration = other / "calib_cam_to_cam.txt"
        calibration.write_text(calibration.read_text().replace("2.000000e+01", "3.000000e+01"))
        frames = [{"date": date, "drive": "0001", "frame": 2} for date in (DATE, "2026_01_02")]
        index = {"name": "two", "label_set": "KITTI-14", "splits": {"train": frames}}
        (root / "dataset.json").write_text(json.dumps(index))
        with pytest.raises(DataError, match="2026_01_02"):
            TrainingSet(root, "train", image_size=SMALL)

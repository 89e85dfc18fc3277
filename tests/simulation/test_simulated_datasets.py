"""Data sets: the same seed gives the same bytes, with any number of workers and interruptions."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tiny_notes import wait_for

from semgrid_edu.datasets import KittiRawDrive, load_index
from semgrid_edu.datasets.kitti_raw import drive_folder
from semgrid_edu.errors import DataError
from semgrid_edu.labels import KITTI_14
from semgrid_edu.storage.files import sha256
from semgrid_edu.storage.provenance import provenance_problems
from semgrid_edu.workshop.simulation import datasets
from semgrid_edu.workshop.simulation.datasets import RECIPES, DatasetRecipe, Route, make_from_recipe
from semgrid_edu.workshop.simulation.sensors.rig import Rig
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.workshop.simulation.writer import DATE

QUIET = Wishes(density=0.2, layout="straight", styles=("park", "park"))
TINY = DatasetRecipe("tiny", "KITTI-14", (Route("train", 2, 2, QUIET), Route("test", 1, 1, QUIET)), rig=Rig())
DENSE = DatasetRecipe("dense", "SYNTHIA-10", (Route("train", 1, 1, QUIET),), dense=True, rig=Rig())


def contents(root: Path) -> dict[str, str]:
    return {str(p.relative_to(root)): sha256(p) for p in sorted(root.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return make_from_recipe(TINY, tmp_path_factory.mktemp("made"), seed=3, workers=2)


def test_another_seed_gives_another_world(made, tmp_path):
    datasets._make_drive(TINY, tmp_path, 4, "0002")
    image = f"{DATE}/{DATE}_drive_0002_sync/image_02/data/0000000000.png"
    assert contents(tmp_path)[image] != contents(made)[image]


def unfinished(made, folder):
    """Return a copy as a killed run leaves it: no dataset.json."""
    root = shutil.copytree(made, folder / "tiny")
    (root / "dataset.json").unlink()
    (root / "provenance.json").unlink()
    return root


def test_an_interrupted_run_resumes_to_the_same_bytes_with_any_number_of_workers(made, tmp_path):
    """A killed run leaves a complete drive and a partial one in a hidden folder; here two workers made the data set."""
    root = unfinished(made, tmp_path)
    second = drive_folder(root, DATE, "0002")
    partial = second.rename(second.with_name(f".{DATE}_drive_0002_sync.partial"))
    (partial / "image_02" / "data" / "0000000007.png").write_bytes(b"half")
    first = drive_folder(root, DATE, "0001") / "oxts" / "data" / "0000000000.txt"
    written = first.stat().st_mtime_ns
    resumed = make_from_recipe(TINY, tmp_path, seed=3, workers=1)
    assert contents(resumed) == contents(made)
    assert first.stat().st_mtime_ns == written


def test_a_drive_with_missing_files_is_an_error_before_provenance_is_written(made, tmp_path):
    root = unfinished(made, tmp_path)
    (drive_folder(root, DATE, "0001") / "velodyne_points" / "data" / "0000000001.bin").unlink()
    with pytest.raises(DataError, match=r"drive_0001_sync: expected all .* 1 missing, such as .*0000000001\.bin"):
        make_from_recipe(TINY, tmp_path, seed=3, workers=1)
    assert not (root / "dataset.json").exists()
    assert not (root / "provenance.json").exists()


def test_the_drive_of_the_faster_worker_stays_and_the_other_one_is_removed(made, tmp_path):
    """A worker of a killed command finishes late: its drive is removed."""
    root = shutil.copytree(made, tmp_path / "tiny")
    before = contents(root)
    (root / DATE / f".{DATE}_drive_0002_sync-abcd.partial").mkdir()
    partial = root / DATE / f".{DATE}_drive_0002_sync-abcd.partial" / "0000000000.png"
    partial.write_bytes(b"half")
    datasets._make_drive(TINY, root, 3, "0002")
    assert partial.read_bytes() == b"half"
    assert provenance_problems(root) == []
    partial.unlink()
    assert contents(root) == before


def test_workers_end_when_their_parent_is_killed(tmp_path):
    code = """
import time
from pathlib import Path
from semgrid_edu.workshop.workplace import workplace

def work(name):
    Path(name).touch()
    time.sleep(600)

if __name__ == "__main__":
    with workplace(2) as place:
        list(place.executor.map(work, ["one", "other"]))
"""
    script = tmp_path / "run.py"
    script.write_text(code)
    variables = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen([sys.executable, script], cwd=tmp_path, env=variables, stdout=subprocess.PIPE)
    wait_for(lambda: (tmp_path / "one").exists() and (tmp_path / "other").exists())
    process.kill()
    process.communicate(timeout=10)  # workers have the same output, which ends when all of them have ended


def test_the_index_lists_the_labelled_frames(made):
    index = load_index(made)
    assert (index.name, index.label_set) == ("tiny", KITTI_14)
    assert [(f.drive, f.frame) for f in index.splits["train"]] == [(("2026_01_01", "0001"), 1)]
    assert [(f.drive, f.frame) for f in index.splits["test"]] == [(("2026_01_01", "0002"), 0)]
    for frames in index.splits.values():
        for labelled in frames:
            assert KittiRawDrive(made, *labelled.drive)[labelled.frame].labels is not None


def test_dense_points_are_on_the_depth_image(tmp_path):
    root = make_from_recipe(DENSE, tmp_path, seed=0, workers=1)
    frame = KittiRawDrive(root, DATE, "0001")[0]
    assert 3000 < len(frame.points) < 20_000
    T = frame.camera.T_camera_from_lidar
    points = frame.points[:, :3] @ T[:3, :3].T + T[:3, 3]
    pixels = points @ frame.camera.K.T
    u, v = (pixels[:, :2] / pixels[:, 2:]).round().astype(int).T
    assert frame.labels.depth[v, u] == pytest.approx(points[:, 2], abs=0.01)
    assert frame.labels.image.max() <= 9


def test_every_nth_frame_is_labelled():
    assert list(Route("train", 10, every=3).labelled) == [2, 5, 8]
    assert list(Route("train", 3).labelled) == [0, 1, 2]
    assert list(Route("train", 3, every=3).labelled) == [2]


def test_the_recipes_have_the_papers_numbers_of_frames():
    def labelled(name, split):
        return [len(route.labelled) for route in RECIPES[name].routes if route.split == split]

    assert (sum(labelled("minikitti", "train")), sum(labelled("minikitti", "test"))) == (142, 110)
    assert all(route.n_frames == 10 and list(route.labelled) == [9] for route in RECIPES["minikitti"].routes)
    assert (sum(labelled("minichroma", "train")), len(labelled("minichroma", "train"))) == (146, 3)
    assert (sum(labelled("minichroma", "test")), len(labelled("minichroma", "test"))) == (130, 2)
    assert len(labelled("minisynthia", "test")) == 1

"""Ways to train for real streets: what is kept apart, seeds that count together, and a run from end to end."""

from types import SimpleNamespace

import numpy as np
import pytest
from tiny_pandaset import SCENE, write_tiny_pandaset

from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame
from semgrid_edu.datasets.samples import samples_dir
from semgrid_edu.datasets.training_set import TrainingSet
from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.studies.training import real_streets

CAMERAS = ("front_camera", "left_camera")


@pytest.fixture
def two_cameras(monkeypatch):
    monkeypatch.setattr(real_streets, "CAMERAS", CAMERAS)
    table = {"left_out": ["left_camera"], "later": ["both"], "learnt": 0.5, "skipped": 0.2}
    monkeypatch.setattr(real_streets, "TABLE", table)


def test_what_is_tested_is_not_learnt(two_cameras):
    views = {"front_camera": range(20), "left_camera": range(10)}
    (others, left_out), (first, last) = real_streets.splits(views).values()
    assert others == [(views["front_camera"], list(range(20)))]
    assert left_out == [(views["left_camera"], list(range(10)))]
    for (frames, learnt), (same, tested) in zip(first, last, strict=True):
        assert frames is same
        assert learnt == list(range(len(frames) // 2))
        assert tested == list(range(round(0.7 * len(frames)), len(frames)))


@pytest.mark.parametrize("method", ["pixel accuracy", "class accuracy"])
def test_each_seed_counts_as_much(monkeypatch, method):
    """Two blocks; one network calls half of the road cells car, the other all of them road."""
    road, car = KITTI_14.index("road"), KITTI_14.index("car")
    counts = np.zeros((2, 2, len(KITTI_14.names), len(KITTI_14.names)), np.int64)
    counts[:, :, car, car] = 10
    counts[0, :, road, road] = counts[0, :, road, car] = 5
    counts[1, :, road, road] = 10
    counted = [SimpleNamespace(confusions=SimpleNamespace(drives=("a", "b")), reliability={}) for _ in counts]
    matrices = {id(one): matrix for one, matrix in zip(counted, counts, strict=True)}
    monkeypatch.setattr(real_streets, "_matrices", lambda _, one: matrices[id(one)])
    scores = real_streets._scores_by_method([{"net": [("net", one)]} for one in counted])["net"]
    assert scores[method]["seeds"] == [0.75, 1.0]
    assert scores[method]["mean"] == 0.875
    assert scores["recall"] == {"road": 0.75, "car": 1.0}
    assert (scores["cells"], scores["frames"]) == (40, 2)


def test_a_run_from_end_to_end(two_cameras, tmp_path, monkeypatch):
    """One step on a real and one on a simulated frame; the same folder a second time gives the same numbers."""
    both = SimpleNamespace(seeds=1, start=True, together=True, image=0, grid=2)
    monkeypatch.setattr(real_streets, "VARIANTS", {"both": both})
    first_frame = (LabelledFrame(("2026_01_01", "0001"), 0),)
    index = DatasetIndex(samples_dir() / "sample", "sample", KITTI_14, {"train": first_frame}, folder=tmp_path)
    streets = TrainingSet(index, "train")
    monkeypatch.setattr(real_streets, "sets_by_camera", lambda *_: [streets])
    root, runs = write_tiny_pandaset(tmp_path / "pandaset"), tmp_path / "runs"
    first = real_streets.compare_real(root, SCENE, "simulated", runs)
    assert set(first["scores"]) == {"two cameras left out", "later"}
    assert set(first["scores"]["later"]) == {"occupancy state alone", "both", "both + CRF"}
    assert first["scores"]["two cameras left out"]["both"]["frames"] == 2
    assert real_streets.compare_real(root, SCENE, "simulated", runs)["scores"] == first["scores"]
    assert "\n| both " in real_streets.real_streets_table(first)


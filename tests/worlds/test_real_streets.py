"""The study of real streets: what is kept apart stays apart, runs aren't mixed up, and its page quotes its result."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tiny_pandaset import SCENE, write_tiny_pandaset
from worlds import lecture_08_real_streets as real_streets
from worlds.lecture_08_real_streets import (
    LATER,
    LEFT_OUT,
    STATE_TABLE,
    WayToTrain,
    compare_real,
    splits,
)

import semgrid_edu
from semgrid_edu.datasets.index import DatasetIndex, LabelledFrame
from semgrid_edu.datasets.pandaset import CAMERAS
from semgrid_edu.datasets.samples import samples_dir
from semgrid_edu.errors import DataError
from semgrid_edu.fast import TrainingSet
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import IMAGE_STAGE, WEIGHTS, Architecture
from semgrid_edu.training import TrainingParams
from semgrid_edu.workshop.scoring.score_with_interval import shown

CLONE = Path(semgrid_edu.__file__).parents[1]


@pytest.fixture
def sides():
    """Frames by camera: 20 ahead and 10 to each other side, which stand for themselves."""
    return {camera: list(range(20 if camera == "front_camera" else 10)) for camera in CAMERAS}


def test_no_network_is_tested_on_what_it_learned(sides):
    for training, test in (one for rounds in splits(sides).values() for one in rounds):
        learned, kept = ({(id(frames), k) for frames, ks in parts for k in ks} for parts in (training, test))
        assert min(len(learned), len(kept)) > 0
        assert not learned & kept


def test_each_camera_is_left_out_once_and_whole_and_later_frames_come_a_second_later(sides):
    by_side, (in_time,) = splits(sides).values()
    tested = [id(frames) for _, test in by_side for frames, _ in test]
    assert sorted(tested) == sorted(map(id, sides.values()))  # each camera once
    for training, test in by_side:
        assert sum(len(ks) for _, ks in training + test) == 70
    for (frames, learned), (_, kept) in zip(*in_time, strict=True):
        assert kept[-1] == frames[-1]
        assert (kept[0] - learned[-1]) * 4 / len(frames) >= 1  # the frames of each camera span four seconds


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return write_tiny_pandaset(tmp_path_factory.mktemp("pandaset"))


@pytest.fixture(scope="module")
def streets(tmp_path_factory):
    """The first frame of the shipped simulated drive."""
    frame = LabelledFrame(("2026_01_01", "0001"), 0)
    cache = tmp_path_factory.mktemp("sample")
    return DatasetIndex(samples_dir() / "sample", "sample", KITTI_14, {"train": (frame,)}, folder=cache)


MEAN_OF_THREE = "simulated, then real, mean of three image networks"


@pytest.fixture
def small(monkeypatch, streets):
    """Two cameras, four ways: two steps, one on simulated frames; one fuses their scores; one of another size."""
    once = WayToTrain(Architecture(), params=TrainingParams(1, 1), with_simulated=True)
    described = Architecture(uses_return_heights=True, image_size=(48, 160))
    tall = WayToTrain(described, params=TrainingParams(0, 1), with_simulated=True)
    mean = WayToTrain(Architecture(), mean_of="once", params=TrainingParams(0, 1, end_to_end=False))
    by_camera = lambda *_, image_size: [TrainingSet(streets, "train", image_size=image_size)]  # noqa: E731
    monkeypatch.setattr(real_streets.TrainingSet, "by_camera", by_camera)
    monkeypatch.setattr(real_streets, "CAMERAS", ("front_camera", "left_camera"))
    monkeypatch.setattr(
        real_streets,
        "WAYS",
        {"as shipped": WayToTrain(Architecture(), "segnet"), "once": once, "mean": mean, "tall": tall},
    )
    chosen = {"left_out": [["left_camera"], ["front_camera"]], "later": ["once", "mean"], "seeds": 1}
    monkeypatch.setattr(real_streets, "TABLE", real_streets.TABLE | chosen)


def test_every_way_is_scored_and_a_run_that_has_ended_is_not_repeated(small, root, tmp_path):
    before = sorted(root.rglob("*"))
    result = compare_real(root, SCENE, "simulated", tmp_path)
    (by_side, in_time), runs = result["scores"].values(), sorted((tmp_path / SCENE).glob(f"*/{WEIGHTS}"))
    learned = ["once", "once + CRF", "mean", "mean + CRF"]
    tall = ["tall", "tall + CRF"]
    assert list(by_side) == [STATE_TABLE, "as shipped", "as shipped + CRF", *learned, *tall]
    assert list(in_time) == [STATE_TABLE, *learned]
    assert len({scores["cells"] for scores in by_side.values()}) == 1
    rounds = [f"{LEFT_OUT} 0", f"{LEFT_OUT} 1", f"{LATER} 0"]
    names = [f"{one}, {way}, 0" for one in rounds for way in ("mean", "once", "tall")]
    assert [run.parent.name for run in runs] == names[:-1]  # "tall" isn't tried on later frames
    assert list(by_side["once"]["cameras"]) == ["left_camera", "front_camera"]
    assert sorted(root.rglob("*")) == before
    written = [run.stat().st_mtime_ns for run in runs]
    assert compare_real(root, SCENE, "simulated", tmp_path)["scores"] == result["scores"]
    assert [run.stat().st_mtime_ns for run in runs] == written
    json.dumps(result)


def test_the_mean_is_of_the_image_networks_of_all_seeds_of_the_same_round(monkeypatch, tmp_path):
    started = []
    monkeypatch.setattr(real_streets, "Mixture", lambda parts: parts)
    monkeypatch.setattr(real_streets, "_train", lambda way, starts, *_: started.append(starts))
    found = real_streets._networks(MEAN_OF_THREE, [([], []), ([], [])], {}, tmp_path / LEFT_OUT, range(3, 6), 4, "cpu")
    runs = [[f"{LEFT_OUT} {r}, simulated, then real, two stages, {seed}" for seed in (3, 4, 5)] for r in (0, 1)]
    assert started == [[tmp_path / run / IMAGE_STAGE for run in one] for one in runs]
    assert list(found) == [f"{LEFT_OUT} {r}, {MEAN_OF_THREE}, 4" for r in (0, 1)]


def _counted(drives, road_right, road_called_car, car_right=0):
    """Counts of one camera, by frame, of cells that are road or car."""
    road, car = KITTI_14.index("road"), KITTI_14.index("car")
    counts = np.zeros((len(drives), len(KITTI_14), len(KITTI_14)), np.int64)
    counts[:, road, road], counts[:, road, car], counts[:, car, car] = road_right, road_called_car, car_right
    of = lambda name, _: SimpleNamespace(counts={name: counts})  # noqa: E731
    return "net", SimpleNamespace(confusions=SimpleNamespace(drives=drives, of=of), reliability={})


def test_scores_are_of_the_cells_of_all_cameras_and_stand_beside_the_tables():
    """One camera has 30 cells, 20 right, the other 10, all wrong; the table has half of each right."""
    ours = [_counted(("a, 0", "a, 1"), [12, 8], [4, 6]), _counted(("b, 0",), [0], [10])]
    table = [_counted(("a, 0", "a, 1"), [8, 7], [8, 7]), _counted(("b, 0",), [5], [5])]
    scores = real_streets._scores_of([ours], table)
    assert scores["pixel accuracy"]["mean"] == scores["recall"]["road"] == 0.5
    assert scores["above the table"]["pixel accuracy"]["mean"] == 0
    assert scores["cameras"] == {"a": 2 / 3, "b": 0}
    assert (scores["cells"], scores["frames"]) == (40, 3)
    assert scores["pixel accuracy"]["low"] is None  # three blocks are too few


def test_each_seed_counts_as_much_and_is_compared_with_the_same_table():
    one, other = ([_counted(("a, 0", "a, 1"), [right, right], [10 - right, 10 - right], 30)] for right in (10, 5))
    scores = real_streets._scores_of([one, other], [_counted(("a, 0", "a, 1"), [5, 5], [5, 5], 30)])
    assert scores["pixel accuracy"]["seeds"] == [1.0, 0.875]
    assert scores["class accuracy"]["seeds"] == [1.0, 0.75]
    assert scores["above the table"]["pixel accuracy"]["seeds"] == [0.125, 0.0]
    assert scores["recall"] == {"road": 0.75, "car": 1.0}
    assert (scores["cameras"], scores["cells"], scores["frames"]) == ({"a": 0.9375}, 80, 2)


def test_a_camera_that_is_missing_is_named_before_any_work(root, tmp_path):
    with pytest.raises(DataError, match="front_left_camera: expected images"):
        compare_real(root, SCENE, "simulated", tmp_path)
    assert not list(tmp_path.iterdir())


NAMES = {
    "a table that knows only the occupancy state": STATE_TABLE,
    "SegNet from simulated streets alone": "simulated only",
    "SegNet, then real cells": "simulated, then real",
    "SegNet, then real pixels and cells": "simulated, then real, image stage on points",
    "SegNet, then real pixels and cells, image network frozen on cells": "simulated, then real, two stages",
    "the mean scores of three such image networks, one fusion network on cells": MEAN_OF_THREE,
    "one such image network, each colour varied by up to 15 %": "simulated, then real, two stages, tinted",
    "SegNet, then real and simulated pixels and cells in turn": "simulated and real in turn, image stage on points",
    "FCN, then real cells": "simulated, then real, FCN",
    "DeepLab, then real cells": "simulated, then real, DeepLab",
    "SegNet, real pixels and cells alone": "real only",
    "U-Net, real pixels and cells alone": "real only, U-Net",
    "SegNet, real pixels and cells alone, without occupancy": "real only, without occupancy",
    "SegNet, real pixels and cells alone, with one plane": "real only, one plane",
}


def test_the_page_of_the_study_quotes_the_committed_result():
    by_side, in_time = json.loads((CLONE / "docs/results/real_streets.json").read_text())["scores"].values()
    page = (CLONE / "docs" / "results" / "real_streets.md").read_text(encoding="utf-8")
    lines = [line for line in page.splitlines() if line.startswith("|")][2:]
    rows = [[cell.strip(" *") for cell in line.split("|")[1:-1]] for line in lines]
    assert [name for name, *_ in rows] == list(NAMES)
    for name, *quoted in rows:
        one, later = by_side[NAMES[name]], in_time.get(NAMES[name])
        metrics = ("pixel accuracy", "class accuracy")
        expected = [shown(one[metric]) for metric in metrics]
        expected += [shown(one["above the table"][metric]) if NAMES[name] != STATE_TABLE else "" for metric in metrics]
        assert quoted == expected + [shown(later[metric]) if later else "" for metric in metrics]

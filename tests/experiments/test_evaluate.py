"""The evaluation on a network that answers by hand-made rules."""

import json

import numpy as np
import pytest
import torch
from tiny_drive import write_tiny_dataset

from semgrid_edu.camera import Camera
from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import METRICS, pixel_accuracy
from semgrid_edu.networks import Architecture, build_net, save_net
from semgrid_edu.pipeline import StageError
from semgrid_edu.storage.files import sha256
from semgrid_edu.workshop.scoring.confusions import FrameConfusions, load_confusions
from semgrid_edu.workshop.scoring.evaluate import count_methods, evaluate, intervals, scores_of_counts, scores_table
from semgrid_edu.workshop.scoring.statistics import drive_interval

ROAD, CAR, FREE, STATIC = (KITTI_14.index(name) for name in ("road", "car", "unknown-free", "unknown-static"))
TRUTH = np.array([[[ROAD, CAR], [FREE, STATIC]]], np.uint8)
LABELS = np.array([[ROAD, CAR], [255, 255]], np.uint8)
_FREE, _STATIC = np.array([[0.97, 0.01, 0.01, 0.01], [0.01, 0.97, 0.01, 0.01]], np.float32)
OCCUPANCY = np.stack([[_FREE, _STATIC], [_FREE, _STATIC]]).transpose(2, 0, 1).copy()

# From 1 m above the ground straight down: the image of four pixels is the map of the four cells.
LOOKS_DOWN = Camera(
    np.array([[2, 0, 1.5], [0, 2, 1.5], [0, 0, 1]]),
    np.array([[0.0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]),
    (2, 2),
    lidar_height=1.0,
)


class FourCells:
    """One frame of 2 x 2 cells and as many pixels, each pixel's return in the cell of its number."""

    label_set, drives = KITTI_14, ("2026_01_01 0001",)
    spec = GridSpec(0.0, 1.0, 0.0, 1.0, 0.5)
    camera = LOOKS_DOWN
    arrays = {"truth": TRUTH, "true": TRUTH, "occupancy": OCCUPANCY[None]}  # noqa: RUF012

    def __len__(self):
        return 1

    def __getitem__(self, k):
        from semgrid_edu.datasets.training_set import Sample

        parts = np.zeros((3, 2, 2), np.uint8), LABELS, OCCUPANCY, TRUTH[0]
        return Sample(*map(torch.from_numpy, parts))

    def returns(self, k):
        return np.arange(4), np.arange(4)


class AllCars(FourCells):
    """What the baselines learn from."""

    arrays = FourCells.arrays | {"truth": np.full((1, 2, 2), CAR)}


class AlwaysRoad:
    n_classes = 14

    def need_architecture(self):
        return Architecture()

    def __call__(self, image, occupancy, return_heights):
        return self.segmenter(image)

    def segmenter(self, image):
        return 9 * torch.eye(14)[ROAD].reshape(1, 14, 1, 1).expand(1, 14, 2, 2)


def evaluated(segmenters, refine=None):
    """A network that sees road everywhere, when cars are the majority of each cell."""
    return scores_of_counts(count_methods(AlwaysRoad(), AllCars(), FourCells(), segmenters, refine), FourCells())


@pytest.fixture(scope="module")
def found():
    return evaluated({"all-road": AlwaysRoad().segmenter})["scores"]


def test_scores_are_those_counted_by_hand(found):
    accuracy = {method: cells["all"]["pixel accuracy"] for method, cells in found.items()}
    assert accuracy == {
        "majority class": 0.25,
        "network": 0.25,
        "network + CRF": 0.25,
        "occupancy alone": 0.25,
        "geometry, all-road labels": 0.25,
        "geometry, all-road labels, gaps closed": 0.25,
        "flat ground, all-road labels": 0.25,
        "flat ground, all-road labels, observed cells": 0.25,
        "geometry, true labels": 1.0,
        "geometry, true labels, gaps closed": 0.5,  # the free and the static cell take the class of their neighbour
        "flat ground, true labels": 1.0,
        "flat ground, true labels, observed cells": 1.0,
        "table of flat ground and state, true labels": 0.25,  # fitted to cars alone
        "table of flat ground and state, all-road labels": 0.25,
        "naive Bayes of flat ground and state, true labels": 0.25,
        "naive Bayes of flat ground and state, all-road labels": 0.25,
    }
    assert found["network"]["semantic"]["class accuracy"] == 0.5


def test_another_refinement_has_a_row_of_its_own():
    def always_car(log_g, o):
        assert log_g.shape == (14, 2, 2)
        assert o.shape == (4, 2, 2)
        return np.eye(14)[np.full((2, 2), CAR)].transpose(2, 0, 1)

    confusions = evaluated({}, always_car)["confusion"]
    assert confusions.keys() >= {"network", "network + always_car"}
    np.testing.assert_array_equal(np.argwhere(confusions["network + always_car"])[:, 1], CAR)


def test_a_refinement_that_gives_no_probabilities_is_refused():
    with pytest.raises(StageError, match=r"^refine \(test_evaluate.py, line \d+\), frame 0: .* log-probabilities"):
        evaluated({}, lambda log_g, o: log_g)


def test_table_shows_every_method_and_number(found):
    lines = scores_table(found).splitlines()
    assert len(lines) == 2 + len(found)
    (line,) = (line for line in lines if line.startswith("| geometry, true labels  "))
    assert [float(cell) for cell in line.split("|")[2:-1]] == [100.0] * 6
    assert json.loads(json.dumps(found)) == found


def test_table_shows_intervals_in_brackets():
    scores = {"network": {cells: dict.fromkeys(METRICS, 0.5) for cells in ("all", "semantic")}}
    found = {"all": [0.4, 0.5, 0.6], "semantic": [None] * 3}
    ends = {"network": {cells: dict.fromkeys(METRICS, value) for cells, value in found.items()}}
    line = scores_table(scores, ends).splitlines()[-1]
    assert [cell.strip() for cell in line.split("|")[2:-1]] == ["50.0 (40.0 to 60.0)"] * 3 + ["50.0"] * 3


def test_intervals_are_those_of_the_drives():
    right, wrong = np.zeros((2, 14, 14), np.int64)
    right[ROAD, ROAD], wrong[ROAD, FREE] = 10, 10
    counts = np.stack([right + wrong, right, right + wrong, 2 * wrong] * 5)
    counts[:, FREE, FREE] = 20
    drives = tuple("aabbccddeeffgghhiijj")
    found = intervals(FrameConfusions(drives, {"network": counts}), KITTI_14)["network"]
    for cells, empty in (("all", False), ("semantic", True)):
        by_drive = counts.reshape(10, 2, 14, 14).sum(axis=1)
        by_drive[:, FREE] *= not empty
        assert found[cells]["pixel accuracy"] == list(drive_interval(by_drive[None], pixel_accuracy))


def test_evaluates_a_network_from_disk_at_its_own_sizes(tmp_path):
    root = write_tiny_dataset(tmp_path / "tiny")
    camera = KittiRawDrive(root, "2026_01_01", "0001").camera
    other = Architecture(image_size=(48, 160), grid=GridSpec(0.0, 71.0, -15.5, 15.5, 1.0), uses_return_heights=True)
    save_net(build_net(other, camera), tmp_path / "net.safetensors")
    save_net(build_net(other, camera, seed=1), tmp_path / "image_stage.safetensors")
    result = evaluate(root, tmp_path / "net.safetensors", confusions_file=tmp_path / "confusions.npz")
    assert {"geometry, end-to-end labels", "geometry, image-stage labels"} < result["scores"].keys()
    assert result == json.loads(json.dumps(result))
    assert result["frames"] == {"train": 2, "test": 1}
    assert result["weights"]["sha256"] == sha256(tmp_path / "net.safetensors")
    assert result["command"] == "semgrid-edu evaluate --data tiny --weights net.safetensors"
    assert result["intervals"] is None  # of one drive
    kept = load_confusions(tmp_path / "confusions.npz")
    assert kept.drives == ("2026_01_01 0003",)
    for method, confusion in result["confusion"].items():
        assert kept.of(method, "true").total(method).tolist() == confusion
        assert np.sum(confusion) == 71 * 31, method  # every cell has a class
    save_net(build_net(Architecture(), camera), tmp_path / "image_stage.safetensors")
    with pytest.raises(ArgumentError, match=r"image_stage\.safetensors: expected image size \(48, 160\)"):
        evaluate(root, tmp_path / "net.safetensors")

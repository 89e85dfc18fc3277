"""The evaluation on a network that answers by hand-made rules."""

import json

import numpy as np
import pytest
import torch

from semgrid_edu.experiments.evaluate import confusion_matrices, scores, table
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks.semantic_grid import Stages

ROAD, CAR, FREE, STATIC = (KITTI_14.index(name) for name in ("road", "car", "unknown-free", "unknown-static"))
TRUTH = np.array([[[ROAD, CAR], [FREE, STATIC]]], np.uint8)


class FourCells:
    """One frame of 2 x 2 cells and as many pixels, each pixel's return in the cell of its number."""

    label_set = KITTI_14
    arrays = {"truth": TRUTH}  # noqa: RUF012

    def __len__(self):
        return 1

    def __getitem__(self, k):
        from semgrid_edu.datasets.training_set import Sample

        free, static = np.array([[0.97, 0.01, 0.01, 0.01], [0.01, 0.97, 0.01, 0.01]], np.float32)
        occupancy = np.stack([[free, static], [free, static]]).transpose(2, 0, 1).copy()
        labels = np.array([[ROAD, CAR], [255, 255]], np.uint8)
        parts = np.zeros((3, 2, 2), np.uint8), labels, occupancy, TRUTH[0]
        return Sample(*map(torch.from_numpy, parts))

    def returns(self, k):
        return np.arange(4), np.arange(4)


class AlwaysRoad:
    n_classes = 14

    def stages(self, image, occupancy):
        scores = torch.zeros(1, 14, 2, 2)
        scores[:, ROAD] = 9
        return Stages(scores, None, scores)


@pytest.fixture(scope="module")
def found():
    confusions = confusion_matrices(AlwaysRoad(), FourCells(), np.full((2, 2), CAR))
    return scores(confusions, KITTI_14)


def test_scores_are_those_counted_by_hand(found):
    accuracy = {method: cells["all"]["pixel accuracy"] for method, cells in found.items()}
    assert accuracy == {
        "network": 0.25,
        "network + CRF": 0.25,
        "majority class": 0.25,
        "geometry, network's image labels": 0.25,
        "geometry, true image labels": 1.0,
    }
    assert found["network"]["semantic"]["class accuracy"] == 0.5


def test_table_shows_every_method_and_number(found):
    lines = table(found).splitlines()
    assert len(lines) == 2 + len(found)
    assert [float(word) for word in lines[-1].split("labels")[1].split()] == [100.0] * 6
    assert json.loads(json.dumps(found)) == found

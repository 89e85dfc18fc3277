"""SemanticKITTI's reader on a real scan: what it says of the street is plausible, and agrees with the labels."""

import os
from pathlib import Path

import numpy as np
import pytest

from semgrid_edu.datasets import SemanticKittiSequence
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14

pytestmark = pytest.mark.real

SPEC = GridSpec(x_min=-50, x_max=50, y_min=-50, y_max=50, cell=0.5)


@pytest.fixture(scope="module")
def sequence():
    root = os.environ.get("SEMANTIC_KITTI")
    if not root:
        pytest.skip("needs real SemanticKITTI data: set SEMANTIC_KITTI to the folder that holds sequences")
    return SemanticKittiSequence(Path(root), "00")


def test_there_is_a_label_for_each_return(sequence):
    assert len(sequence.classes(0)) == len(sequence.scan(0)) > 100_000
    assert (sequence.classes(0) == IGNORE).mean() < 0.1


def test_the_road_lies_where_the_height_of_the_lidar_says(sequence):
    points, road = sequence.scan(0), sequence.classes(0) == KITTI_14.index("road")
    near = np.hypot(points[:, 0], points[:, 1]) < 10
    assert np.median(points[road & near, 2]) == pytest.approx(-1.73, abs=0.15)


def test_the_vehicle_stands_on_the_road(sequence):
    truth, xy = sequence.truth(0, SPEC), SPEC.centers()
    around = (np.abs(xy[..., 0]) < 15) & (np.abs(xy[..., 1]) < 1.0)
    classes = truth[around & (truth != IGNORE)]
    assert classes.size > 30
    assert np.mean(np.isin(classes, [KITTI_14.index("road"), KITTI_14.index("car")])) > 0.9


def test_only_cells_with_returns_are_labelled(sequence):
    rows, cols, inside = SPEC.cells(sequence.scan(0))
    hit = np.zeros(SPEC.shape, bool)
    hit[rows[inside], cols[inside]] = True
    truth = sequence.truth(0, SPEC)
    assert not (truth[~hit] != IGNORE).any()
    assert (truth[hit] != IGNORE).mean() > 0.9

"""The majority baseline on grids small enough to fill in by hand."""

import numpy as np

from semgrid_edu.labels import KITTI_14
from semgrid_edu.workshop.scoring.single_sources import majority_class

ROAD, WALK, CAR = (KITTI_14.index(name) for name in ("road", "sidewalk", "car"))


def test_majority_of_each_cell():
    truths = np.array([[[ROAD, 255, CAR]], [[WALK, 255, CAR]], [[WALK, 255, 255]]], np.uint8)
    assert majority_class(truths).tolist() == [[WALK, WALK, CAR]]


def test_majority_breaks_ties_by_the_first_class():
    assert majority_class(np.array([[[CAR]], [[ROAD]]], np.uint8)).tolist() == [[ROAD]]

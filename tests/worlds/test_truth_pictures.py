"""The figure of made ground truth: what each cell means."""

import numpy as np
import pytest
from worlds.lecture_09_pictures import DIFFERENCES, difference_kinds, truth_difference

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14

ROAD, CAR, FREE, STATIC = (KITTI_14.index(name) for name in ("road", "car", "unknown-free", "unknown-static"))
TRUTH = np.array([[ROAD, ROAD, ROAD], [FREE, FREE, CAR]])
MADE = np.array([[ROAD, CAR, FREE], [CAR, STATIC, CAR]])


def test_each_cell_differs_in_one_way():
    names = np.array(list(DIFFERENCES))[difference_kinds(TRUTH, MADE, 10)]
    assert names.tolist() == [
        ["the same label", "another label", "seen, but not labelled"],
        ["labelled, but not seen", "no label in either", "the same label"],
    ]


def test_truth_made_truth_and_difference_stand_side_by_side():
    spec = GridSpec(0.0, 2.0, -1.5, 1.5, 1.0)
    figure = truth_difference(spec, TRUTH, MADE, KITTI_14)
    rasters = [ax.get_images()[0].get_array() for ax in figure.axes]
    np.testing.assert_array_equal(rasters[0], KITTI_14.colours(TRUTH))
    np.testing.assert_array_equal(rasters[1], KITTI_14.colours(MADE))
    assert rasters[2][0, 1].tolist() == list(DIFFERENCES["another label"])
    shown = [text.get_text() for text in figure.axes[2].get_legend().get_texts()]
    assert shown[1:3] == ["the same label (33.3%)", "another label (16.7%)"]
    with pytest.raises(ArgumentError, match="raster"):
        truth_difference(spec, TRUTH, MADE.T, KITTI_14)

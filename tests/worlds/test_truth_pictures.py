"""Figures of made ground truth: what each cell and each point means."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_09_counts import COUNTED, TruthCounts
from worlds.lecture_09_pictures import DIFFERENCES, difference_kinds, policy_errors, truth_difference, truth_errors

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14

ROAD, CAR, FREE, STATIC = (KITTI_14.index(name) for name in ("road", "car", "unknown-free", "unknown-static"))
TRUTH = np.array([[ROAD, ROAD, ROAD], [FREE, FREE, CAR]])
MADE = np.array([[ROAD, CAR, FREE], [CAR, STATIC, CAR]])


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


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


def counts():
    cells = np.zeros((len(COUNTED), 2, 10), int)
    cells[:, 0, ROAD] = 100, 60, 30, 200, 150, 0
    cells[:, 1, ROAD] = 100, 20, 70, 10, 5, 0
    return TruthCounts(cells)


def test_a_point_is_a_share_and_small_numbers_have_none():
    figure = truth_errors(counts(), (0, 10, 30), KITTI_14)
    lines = {ax.get_title(): ax.get_lines() for ax in figure.axes}
    assert [line.get_label() for line in lines["seen, no label"]] == ["road"]
    assert lines["seen, no label"][0].get_xdata().tolist() == [5, 20]
    np.testing.assert_allclose(lines["seen, no label"][0].get_ydata(), [30, 70])
    np.testing.assert_allclose(lines["seen, another label"][0].get_ydata(), [10, 10])
    (wrong,) = lines["labelled, but something\nelse is there"]
    np.testing.assert_allclose(wrong.get_ydata(), [25, np.nan])  # 10 labelled cells are too few
    with pytest.raises(ArgumentError, match="edges: expected 3 distances"):
        truth_errors(counts(), (0, 10), KITTI_14)


def test_a_bar_is_the_share_of_all_drives_together():
    drives = {"700": {"a": [100, 60, 30, 100, 75, 0]}, "701": {"a": [300, 60, 240, 100, 25, 0]}}
    figure = policy_errors({"sums": {"a": []}, "drives": drives}, ("missed", "wrong"))
    assert [ax.patches[0].get_width() for ax in figure.axes] == pytest.approx([67.5, 50])
    (quartiles,) = figure.axes[1].collections[0].get_segments()
    assert quartiles[:, 0].tolist() == pytest.approx([37.5, 62.5])

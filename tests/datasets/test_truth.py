"""Truth on the grid: the class where the camera sees, the kind of unknown elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from semgrid_edu.datasets import grid_truth
from semgrid_edu.datasets.grid_truth import fill_gaps_with_unknown, unknown_classes
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import LABEL_GRID, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14, SYNTHIA_10

SPEC = GridSpec.compact()


def make_labels(birdseye, visible, label_set=KITTI_14):
    image = np.zeros((2, 2), np.uint8)
    return FrameLabels(label_set, image, image.astype(np.float32), birdseye, visible)


def belief_of(states):
    return np.eye(4)[states].transpose(2, 0, 1) * 0.4 + 0.15


@pytest.fixture
def states():
    return np.random.default_rng(0).integers(0, 4, SPEC.shape)


def test_seen_cells_take_their_class_and_others_their_state(states):
    birdseye = np.full(LABEL_GRID.shape, KITTI_14.index("road"), np.uint8)
    birdseye[:, 150:] = IGNORE
    visible = np.zeros(LABEL_GRID.shape, bool)
    visible[350:] = True
    truth = grid_truth(make_labels(birdseye, visible), belief_of(states), SPEC)
    seen = np.zeros(SPEC.shape, bool)
    seen[70:, :30] = True
    assert (truth[seen] == KITTI_14.index("road")).all()
    names = np.array(["unknown-free", "unknown-static", "unknown-dynamic", "unknown-unobserved"])
    np.testing.assert_array_equal(np.array(KITTI_14.names)[truth[~seen]], names[states[~seen]])


def test_where_labels_have_gaps_unlabelled_cells_in_view_are_left_out_and_the_others_are_unknown(states):
    birdseye = np.full(LABEL_GRID.shape, IGNORE, np.uint8)
    birdseye[:100] = KITTI_14.index("road")
    labels = make_labels(birdseye, birdseye != IGNORE)
    undecided = np.zeros(LABEL_GRID.shape, bool)
    undecided[:350] = True
    truth = grid_truth(replace(labels, undecided=undecided), belief_of(states), SPEC)
    unknown = grid_truth(make_labels(np.full_like(birdseye, IGNORE), undecided), belief_of(states), SPEC)
    assert (truth[:20] == KITTI_14.index("road")).all()
    assert (truth[20:70] == IGNORE).all()
    np.testing.assert_array_equal(truth[70:], unknown[70:])


@pytest.mark.parametrize("cell", [0.5, 1.0])
def test_a_gap_becomes_unknown_exactly_where_no_label_is_within_a_metre(cell):
    spec = GridSpec(0, 20, -10, 10, cell)
    rng = np.random.default_rng(1)
    truth = np.full((3, *spec.shape), IGNORE, np.uint8)
    truth[rng.random(truth.shape) < 0.02] = KITTI_14.index("car")
    truth[rng.random(truth.shape) < 0.02] = KITTI_14.index("unknown-free")  # not a label of anything
    belief = np.eye(4)[rng.integers(0, 4, truth.shape)].transpose(0, 3, 1, 2)
    filled = fill_gaps_with_unknown(truth, belief, spec)
    unknown = unknown_classes(belief)
    for k, row, col in np.argwhere(truth == IGNORE):
        labelled = np.argwhere(truth[k] == KITTI_14.index("car"))
        near = (np.abs(labelled - (row, col)).max(axis=1) * cell <= 1.0).any()
        assert filled[k, row, col] == (IGNORE if near else unknown[k, row, col])
    np.testing.assert_array_equal(filled[truth != IGNORE], truth[truth != IGNORE])
    assert (filled == IGNORE).any()


def test_one_seen_fine_cell_of_a_pole_names_its_cell(states):
    birdseye = np.full(LABEL_GRID.shape, KITTI_14.index("sidewalk"), np.uint8)
    birdseye[503, 202] = KITTI_14.index("signage")
    visible = np.ones(LABEL_GRID.shape, bool)
    truth = grid_truth(make_labels(birdseye, visible), belief_of(states), SPEC)
    expected = np.full(SPEC.shape, KITTI_14.index("sidewalk"))
    expected[100, 40] = KITTI_14.index("signage")
    np.testing.assert_array_equal(truth, expected)


def test_refuses_other_shapes_and_label_sets(states):
    labels = make_labels(np.zeros(LABEL_GRID.shape, np.uint8), np.ones(LABEL_GRID.shape, bool))
    with pytest.raises(ArgumentError, match="belief_probability"):
        grid_truth(labels, belief_of(states)[:, 1:], SPEC)
    other = replace(KITTI_14, name="other")
    with pytest.raises(ArgumentError, match="KITTI-14 or SYNTHIA-10, found other"):
        grid_truth(make_labels(labels.birdseye, labels.visible, other), belief_of(states), SPEC)


def test_without_a_label_synthias_cells_are_void(states):
    birdseye = np.full(LABEL_GRID.shape, SYNTHIA_10.index("lane"), np.uint8)
    birdseye[:, 150:] = IGNORE
    visible = np.zeros(LABEL_GRID.shape, bool)
    visible[350:] = True
    expected = np.full(SPEC.shape, SYNTHIA_10.index("void"))
    expected[70:, :30] = SYNTHIA_10.index("lane")
    np.testing.assert_array_equal(
        grid_truth(make_labels(birdseye, visible, SYNTHIA_10), belief_of(states), SPEC), expected
    )

"""A story in words: what it claims is what comes out when the stages are run again."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from told_story import counted

from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.occupancy import State
from semgrid_edu.workshop.demo.details import SENTENCES
from semgrid_edu.workshop.demo.evidence import last_sight
from semgrid_edu.workshop.demo.what_if import FAULTS, faults, right_occupancy, right_scores, what_if

ROAD, SIDEWALK, CAR, FENCE = map(KITTI_14.index, ("road", "sidewalk", "car", "fence"))
SPEC = GridSpec.compact()


@given(
    arrays(np.float32, (5, 3, 4), elements=st.floats(-20, 20, width=32)),
    arrays(np.uint8, (3, 4), elements=st.sampled_from([0, 1, 2, 3, 4, IGNORE])),
)
def test_right_scores_are_the_same_numbers_with_the_true_class_first(scores, truth):
    right = right_scores(scores, truth)
    np.testing.assert_array_equal(np.sort(right, axis=0), np.sort(scores, axis=0))
    known = truth != IGNORE
    best = right.max(axis=0)
    np.testing.assert_array_equal(
        np.take_along_axis(right, np.where(known, truth, 0)[None], axis=0)[0][known], best[known]
    )
    np.testing.assert_array_equal(right[:, ~known], scores[:, ~known])


def test_right_occupancy_is_free_where_the_truth_is_flat_and_occupied_where_it_stands(told):
    result = told[-1]
    o = result.belief.probability
    right = right_occupancy(o, result.frame.labels, SPEC)
    truth = grid_truth(result.frame.labels, o, SPEC)
    flat = np.isin(truth, [KITTI_14.index(name) for name in KITTI_14.flat])
    standing = (truth < KITTI_14.n_semantic) & ~flat
    assert flat.sum() > 50
    assert standing.sum() > 10
    np.testing.assert_allclose(right.sum(axis=0), 1, atol=1e-5)
    np.testing.assert_array_equal(right[State.FREE][flat], 1)
    np.testing.assert_allclose((right[State.STATIC] + right[State.DYNAMIC])[standing], 1, atol=1e-5)
    np.testing.assert_array_equal(right[:, ~flat & ~standing], o[:, ~flat & ~standing])


def test_what_is_removed_is_not_there(told, net, story_maps):
    """Zeros for every plane, or UNKNOWN for every cell, straight into the fusion network."""
    result, removed = told[-1], story_maps.otherwise
    o = torch.tensor(result.belief.probability)[None]
    unknown = torch.zeros_like(o)
    unknown[:, State.UNKNOWN] = 1
    with torch.inference_mode():
        planes = net.sampler(torch.tensor(result.scores)[None])
        blind, deaf = net.fusion(torch.zeros_like(planes), o), net.fusion(planes, unknown)
    np.testing.assert_array_equal(removed["no image"], blind[0].argmax(dim=0))
    np.testing.assert_array_equal(removed["no occupancy"], deaf[0].argmax(dim=0))


def test_correcting_what_is_right_changes_nothing(told, net):
    """If each pixel shows what the image network calls it, then the true image is the one that it was given."""
    result = told[-1]
    labels = replace(result.frame.labels, image=result.scores.argmax(axis=0).astype(np.uint8))
    same = replace(result, frame=replace(result.frame, labels=labels))
    second, first = np.sort(result.grid, axis=0)[-2:]
    decided = first - second > 1e-3  # where two classes are as good as equal, rounding decides
    assert decided.mean() > 0.9
    np.testing.assert_array_equal(what_if(same, net)["true image"][decided], result.grid.argmax(axis=0)[decided])


@pytest.mark.parametrize(
    ("label", "refined", "truth", "image", "occupancy", "both", "fault"),
    [
        (CAR, CAR, CAR, CAR, CAR, CAR, "none"),
        (ROAD, ROAD, IGNORE, CAR, CAR, CAR, "none"),
        (ROAD, CAR, CAR, CAR, ROAD, CAR, "mended"),
        (CAR, ROAD, CAR, CAR, CAR, CAR, "crf"),
        (ROAD, ROAD, CAR, CAR, ROAD, CAR, "image"),
        (ROAD, SIDEWALK, CAR, CAR, ROAD, CAR, "image"),
        (ROAD, ROAD, CAR, ROAD, CAR, CAR, "occupancy"),
        (ROAD, ROAD, CAR, CAR, CAR, CAR, "either"),
        (ROAD, ROAD, CAR, ROAD, FENCE, CAR, "both"),
        (ROAD, ROAD, CAR, ROAD, FENCE, FENCE, "fusion"),
    ],
)
def test_the_stage_that_went_wrong_is_the_one_whose_repair_helps(label, refined, truth, image, occupancy, both, fault):
    otherwise = {"true image": image, "true occupancy": occupancy, "both true": both}
    assert FAULTS[faults(label, refined, truth, otherwise)] == fault


def test_without_labels_no_stage_is_charged():
    assert FAULTS[faults(ROAD, CAR, IGNORE, {"no image": ROAD})] == "none"


def test_classes_are_counted_the_most_frequent_first():
    assert counted([0, 3, 3, 255], ("road", "sidewalk", "vegetation", "car")) == "car (2), road (1)"


def test_every_fault_has_its_sentence():
    assert set(SENTENCES["fault"]) == set(FAULTS)


def test_the_memory_says_when_a_frame_last_named_the_place():
    """The vehicle drives a cell of 1 m in each frame; the camera sees row 0 alone, and calls it road, car, fence."""
    spec, nothing = GridSpec(0, 4, 0, 1, 1), KITTI_14.index("unknown-free")
    seen = []
    for k, called in enumerate((ROAD, CAR, FENCE)):
        pose = np.eye(4)
        pose[0, 3] = k
        labels = np.array([[called], [nothing], [nothing], [nothing]])
        seen.append((Frame(None, np.zeros((0, 4), np.float32), None, pose, 0.1 * k), labels))
    sight = last_sight(seen, spec, KITTI_14.n_semantic)
    assert sight.back.ravel().tolist() == [0, 1, 2, -1]
    assert sight.label.ravel().tolist() == [FENCE, CAR, ROAD, nothing]
    np.testing.assert_allclose(sight.seconds.ravel(), [0, 0.1, 0.2, 0])

"""A story in words: what it claims is what comes out when the stages are run again."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tiny_drive import DATE, write_tiny_drive

from semgrid_edu.datasets import KittiRawDrive
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.networks import Architecture, build_net
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.story import cell_story, what_if
from semgrid_edu.story.cell_evidence import cell_memory
from semgrid_edu.story.what_if import right_occupancy, right_scores
from semgrid_edu.story.words import FAULTS, faults

ROAD, SIDEWALK, CAR, FENCE = map(KITTI_14.index, ("road", "sidewalk", "car", "fence"))
SPEC = GridSpec.compact()


@pytest.fixture(scope="module")
def net_and_result(tmp_path_factory):
    root = tmp_path_factory.mktemp("drive")
    write_tiny_drive(root, labelled=(2,))
    drive = KittiRawDrive(root, DATE, "0001")
    net = build_net(Architecture(), drive.camera, seed=3).eval()
    return net, list(run_pipeline(drive, Stages.of(net)))[2]


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


def test_right_occupancy_is_free_where_the_truth_is_flat_and_occupied_where_it_stands(net_and_result):
    result = net_and_result[1]
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


def test_what_is_removed_is_not_there(net_and_result):
    """Zeros for every plane, or UNKNOWN for every cell, straight into the fusion network."""
    net, result = net_and_result
    removed, o = what_if(result, net), torch.tensor(result.belief.probability)[None]
    unknown = torch.zeros_like(o)
    unknown[:, State.UNKNOWN] = 1
    with torch.inference_mode():
        planes = net.sampler(torch.tensor(result.scores)[None])
        blind, deaf = net.fusion(torch.zeros_like(planes), o), net.fusion(planes, unknown)
    np.testing.assert_array_equal(removed["no image"], blind[0].argmax(dim=0))
    np.testing.assert_array_equal(removed["no occupancy"], deaf[0].argmax(dim=0))


def test_to_put_right_what_is_right_changes_nothing(net_and_result):
    """If each pixel shows what the image network calls it, then the true image is the one that it was given."""
    net, result = net_and_result
    labels = replace(result.frame.labels, image=result.scores.argmax(axis=0).astype(np.uint8))
    same = replace(result, frame=replace(result.frame, labels=labels))
    np.testing.assert_array_equal(what_if(same, net)["true image"], result.grid.argmax(axis=0))


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


def test_a_story_says_what_it_holds(net_and_result):
    net, result = net_and_result
    for cell in ((81, 31), (120, 33), (0, 0)):
        story = cell_story(result, cell, net)
        place, called, *_, numbers = str(story).splitlines()
        assert place.startswith(f"Cell ({cell[0]}, {cell[1]}), {story.xy[0]:.1f} m ahead")
        assert called.startswith(f"Called {story.names[story.refined]} (")
        assert numbers.startswith(
            f"In logarithms, {story.names[story.label]} against {story.names[story.rival]}: image"
        )
        image = next(line for line in str(story).splitlines() if line.startswith("Image"))
        seen = image.split(" In truth")[0].count("(")
        assert seen == len(set(story.pixel_classes[story.visible]))


def made(ahead: float, called: np.ndarray, kept: int) -> SimpleNamespace:
    """A result by hand: the vehicle's place, what the frame calls the cells, and what memory calls all of them."""
    pose = np.eye(4)
    pose[0, 3] = ahead
    frame = SimpleNamespace(T_world_from_lidar=pose, time=0.1 * ahead)
    grid = np.eye(14, dtype=np.float32)[called].transpose(2, 0, 1)
    return SimpleNamespace(
        frame=frame, grid=grid, remembered=np.full(grid.shape, 0.02) + 0.5 * np.eye(14)[kept][:, None, None]
    )


def test_the_memory_says_when_a_frame_last_named_the_place():
    """The vehicle drives a cell of 1 m in each frame; the camera sees row 0 alone, and calls it road, then a car."""
    spec, nothing = GridSpec(0, 4, 0, 1, 1), KITTI_14.index("unknown-free")
    called = [np.array([[c], [nothing], [nothing], [nothing]]) for c in (ROAD, CAR, FENCE)]
    results = [made(k, one, kept=SIDEWALK) for k, one in enumerate(called)]
    found = [cell_memory(results, spec, (row, 0), KITTI_14.n_semantic) for row in range(4)]
    assert [one.back for one in found] == [0, 1, 2, -1]
    assert [one.then for one in found] == [FENCE, CAR, ROAD, nothing]
    assert [one.seconds for one in found] == pytest.approx([0, 0.1, 0.2, 0])
    assert {(one.label, one.earlier) for one in found} == {(SIDEWALK, 2)}
    assert found[0].sure == pytest.approx(0.52)
    results[-1].remembered = None
    assert cell_memory(results, spec, (0, 0), KITTI_14.n_semantic) is None

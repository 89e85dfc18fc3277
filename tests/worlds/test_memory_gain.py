"""The study of what memory gains: cells told apart by when they were seen, counts by hand, and the committed result."""

import json
from pathlib import Path

import numpy as np
import pytest
from worlds.lecture_04_scenes import labelled_frame
from worlds.lecture_14_counts import (
    GROUPS,
    GainCounts,
    count_cells,
    frames_in_view,
    memory_tables,
)
from worlds.lecture_14_gain import FIRST, LAST, real_blocks

import semgrid_edu
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.frame import LABEL_GRID, Frame, FrameLabels
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.memory import View
from semgrid_edu.occupancy import Belief
from semgrid_edu.workshop.course.street import frames_since_seen
from semgrid_edu.workshop.scoring.statistics import MIN_DRIVES
from semgrid_edu.workshop.simulation.drive import SimulatedDrive

SPEC = GridSpec(0, 71, -15.5, 15.5, 1.0)
COMMITTED = Path(semgrid_edu.__file__).parents[1] / "docs" / "results" / "memory.json"


def frame(ahead: float, visible_from: float, time: float = 0.0) -> Frame:
    """A vehicle `ahead` metres along a road of which the camera sees what is farther than some metres."""
    pose = np.eye(4)
    pose[0, 3] = ahead
    visible = LABEL_GRID.centers()[..., 0] > visible_from
    labels = FrameLabels(
        KITTI_14, np.zeros((1, 1), np.uint8), np.zeros((1, 1)), np.zeros(LABEL_GRID.shape, np.uint8), visible
    )
    return Frame(None, np.empty((0, 4), np.float32), sample_drive().camera, pose, time, labels)


def views(*called: int) -> list[View]:
    """Frames a metre apart, each of which calls everything a class of its own."""
    nothing, o = np.full((2, 2, *SPEC.shape), np.nan, np.float32), np.zeros((4, *SPEC.shape), np.float32)
    o[0] = 1
    grids = [np.eye(14, dtype=np.float32)[c][:, None, None] * np.ones(SPEC.shape, np.float32) for c in called]
    return [View(frame(k, 0), Belief(o, nothing[0], nothing), g) for k, g in enumerate(grids)]


def test_cells_know_how_many_frames_ago_they_were_seen():
    """The camera sees what is farther than 10 m, and the vehicle drives 2 m in each frame."""
    now = frames_since_seen([frame(2.0 * k, 10) for k in range(4)], SPEC)[-1]
    x = SPEC.centers()[:, 0, 0]
    expected = np.select([x > 10, x > 8, x > 6, x > 4], [0, 1, 2, 3], -1)
    np.testing.assert_array_equal(now, np.broadcast_to(expected[:, None], SPEC.shape))


def test_cells_know_in_how_many_frames_they_were_seen():
    """As above: what is farther than 10 m now was in view in all four frames, what is nearer in the earlier ones."""
    count = frames_in_view([frame(2.0 * k, 10) for k in range(4)], SPEC)[-1]
    x = SPEC.centers()[:, 0, 0]
    reach = np.select([x < 65, x < 67, x < 69], [4, 3, 2], 1)  # the farthest cells entered the grid only later
    expected = np.minimum(np.select([x > 10, x > 8, x > 6, x > 4], [4, 3, 2, 1], 0), reach)
    np.testing.assert_array_equal(count, np.broadcast_to(expected[:, None], SPEC.shape))


def test_counts_are_those_by_hand():
    p = np.array([[0.8, 0.5, 0.1], [0.2, 0.5, 0.9]])
    counted = count_cells(p, np.array([0, 1, 0], np.uint8))
    np.testing.assert_array_equal(counted.confusion, [[1, 1], [1, 0]])
    unknown = 0.9 * np.eye(14)[[12, 0]].T + 0.1 * np.eye(14)[[3, 5]].T  # its most probable class is unknown, road
    assert count_cells(unknown, np.array([3, 0], np.uint8)).forbidden[[3, 0], [3, 0]].tolist() == [1, 1]
    assert counted.brier == pytest.approx(2 * (0.2**2 + 0.5**2 + 0.9**2))
    cells, confidence, right = counted.by_confidence.sum(axis=1)
    assert (cells, confidence, right) == (3, pytest.approx(0.8 + 0.5 + 0.9), pytest.approx(1))


def test_each_group_counts_its_own_cells_and_unlabelled_ones_nowhere():
    counts, frames = GainCounts(SPEC), [frame(0.0, 10), frame(2.0, 10)]
    frames[1].labels.birdseye[:, :155] = IGNORE
    road, car = (np.float32(np.eye(14)[c][:, None, None] * np.ones(SPEC.shape)) for c in (0, 3))
    counts.add(frames, [{"one frame": car, "memory": road}, {"one frame": road, "memory": road}])
    scores = counts.summary()
    half = SPEC.shape[1] / 2
    seen, before = (61 * 31, 61 * half), 2 * half
    assert scores["in view"]["cells"] == pytest.approx(sum(seen), rel=0.05)
    assert scores["seen before"]["cells"] == pytest.approx(before, rel=0.05)
    one, memory = (scores["in view"]["methods"][name]["pixel accuracy"]["mean"] for name in ("one frame", "memory"))
    assert (one, memory) == (pytest.approx(seen[1] / sum(seen), rel=0.05), 1)
    assert scores["in view"]["gain"]["pixel accuracy"]["mean"] == pytest.approx(memory - one)
    assert scores["in view"]["methods"]["memory"]["Brier"] == pytest.approx(0)
    last = scores["seen before"]["methods"]["last look"]["pixel accuracy"]["mean"]
    assert last == 0  # the first frame, which called everything car, is where the camera last saw them
    assert scores["seen before"]["gain over the last look"]["pixel accuracy"]["mean"] == pytest.approx(1)
    assert scores["seen later"]["cells"] == 0
    in_one_frame, in_two = (scores[f"in view, frames {a} to {b}"]["cells"] for a, b in ((1, 1), (2, 5)))
    assert (in_one_frame > 0, in_one_frame + in_two) == (True, scores["in view"]["cells"])


def test_the_last_maps_are_averaged_and_multiplied():
    called = (0, 0, 0, 1, 1, 1)
    mean = list(FIRST["mean of five maps, not moved"](views(*called), SPEC))[-1]
    np.testing.assert_allclose(mean[[0, 1], 5, 5], [2 / LAST, 3 / LAST])
    moved = list(FIRST["mean of five maps"](views(*called), SPEC))[-1]
    np.testing.assert_allclose(moved[[0, 1], -3, 5], [2 / LAST, 3 / LAST])
    np.testing.assert_allclose(moved[:2, 0, 5], [0, 1])  # what is farthest ahead lies in the newest map alone
    product = list(FIRST["product of five maps"](views(*called), SPEC))[-1]
    np.testing.assert_allclose(product[0, -3, 5] / product[1, -3, 5], 1e-4, rtol=1e-3)  # three against two
    np.testing.assert_allclose(product.sum(axis=0), 1, atol=1e-5)


def test_a_camera_is_cut_into_blocks_of_two_seconds():
    blocks = real_blocks(frame(0, 0, time) for time in (0.0, 0.8, 1.6, 2.4, 3.2, 4.8))
    assert [[one.time for one in block] for block in blocks] == [[0.0, 0.8, 1.6], [2.4, 3.2], [4.8]]


def test_a_simulated_frame_has_its_image():
    taken = labelled_frame(SimulatedDrive(7, 1), 0)
    assert taken.image.shape[2] == 3
    assert taken.labels.visible.any()


def test_the_committed_result_is_whole():
    result = json.loads(COMMITTED.read_text())
    assert result["drives"] >= MIN_DRIVES
    for groups in result["scores"].values():
        assert all(groups[name]["cells"] for name in GROUPS)
    assert all(street in memory_tables(result) for street in result["scores"])
    worth = result["worth"]
    assert worth["best"] == [float(min(worth["log loss"], key=lambda w: worth["log loss"][w][k])) for k in range(5)]

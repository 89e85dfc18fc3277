"""Scores by pieces of street, and the verdicts of a report card."""

import json
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from worlds.lecture_13_faults import FAULTS, YAWS
from worlds.lecture_13_report_card import (
    Line,
    border_verdict,
    check_lines,
    draw_report_card,
    map_lines,
    motion_verdict,
    view_line,
)

from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import pixel_accuracy
from semgrid_edu.storage.files import shipped_folder
from semgrid_edu.workshop.course.notebooks.build import NOTEBOOKS
from semgrid_edu.workshop.course.street import (
    PIECE,
    best_table,
    piece_confusions,
    semantic_truths,
    street_pieces,
)

SPEC = GridSpec(x_min=0, x_max=24, y_min=-8, y_max=8, cell=2.0)


def test_a_piece_stays_where_it_is_when_the_vehicle_drives_on():
    first = replace(sample_drive()[0], T_world_from_lidar=np.eye(4))
    moved = np.eye(4)
    moved[0, 3] = PIECE  # one piece ahead
    before, after = street_pieces([first, replace(first, T_world_from_lidar=moved)], SPEC)
    rows = round(PIECE / SPEC.cell)
    np.testing.assert_array_equal(before[:-rows], after[rows:])
    assert len(np.unique(before)) == 3 * 2  # 24 m x 16 m


def test_counts_of_the_pieces_sum_to_those_of_the_map():
    rng = np.random.default_rng(0)
    truths, called = rng.integers(0, 10, (2, 3, 12, 8))
    truths[0, :4] = IGNORE
    pieces = np.broadcast_to(np.arange(12)[:, None] // 4, truths.shape)
    counts = piece_confusions(truths, called, pieces)
    assert counts.shape == (1, 3, 14, 14)
    assert counts.sum() == (truths != IGNORE).sum()
    assert pixel_accuracy(counts[0].sum(axis=0)) == pytest.approx((called == truths)[truths != IGNORE].mean())
    truths[:, :4] = IGNORE
    assert len(piece_confusions(truths, called, pieces)[0]) == 2


def test_no_table_of_states_is_better_than_the_best_one():
    rng = np.random.default_rng(1)
    truths, beliefs = rng.integers(0, 5, (3, 9, 9)), rng.random((3, 4, 9, 9))
    truths[0, 0] = IGNORE
    best, counted = (best_table(truths, beliefs) == truths)[truths != IGNORE].mean(), truths != IGNORE
    for _ in range(200):
        other = rng.integers(0, 5, 4)[beliefs.argmax(axis=1)]
        assert (other == truths)[counted].mean() <= best


def test_only_cells_with_a_class_of_the_street_count():
    drive = real_drive()
    unseen = np.eye(4)[3][:, None, None] * np.ones((142, 62))
    truths = semantic_truths(drive, [unseen, unseen], GridSpec.compact())
    assert truths.shape == (2, 142, 62)
    assert set(np.unique(truths)) <= {*range(KITTI_14.n_semantic), IGNORE}


def test_a_reading_at_the_end_of_the_search_or_without_contrast_tells_nothing():
    peak = 1 + np.exp(-(YAWS**2))
    assert border_verdict(peak, YAWS) is True
    assert border_verdict(np.roll(peak, 6), YAWS) is False
    assert border_verdict(1 + YAWS / 10, YAWS) is None
    assert border_verdict(peak / 3, YAWS) is None
    assert border_verdict(peak, YAWS, null=2.1) is None


def test_ground_in_view_from_further_away_than_learned_is_an_alarm():
    assert view_line(13, 6).verdict is False
    assert view_line(6.5, 6).verdict is True


def test_a_vehicle_that_stands_cannot_tell_whether_its_poses_are_right():
    right = {"as the poses say": 0.1, "no motion": 0.5, "backwards": 0.9}
    assert motion_verdict(right) is True
    assert motion_verdict(right | {"no motion": 0.12}) is None
    assert motion_verdict(right | {"backwards": 0.02}) is False


def test_the_card_of_the_real_street_and_of_one_with_a_turned_camera():
    drive = real_drive()
    frames = drive[:]
    sound = {line.check: line.verdict for line in check_lines(drive, frames)}
    assert [sound[check] for check in ("files", "borders", "ground ahead")] == [True] * 3
    assert sound["gaps in time"] is None  # a loss of every second frame would read the same
    assert sound["motion"] is None  # it stands in a queue
    assert sound["clocks"] is None  # the excerpt has one time for all sensors
    assert not sound["ground to the left"]
    turned = {line.check: line.verdict for line in check_lines(drive, FAULTS["camera turned"](frames))}
    assert {check for check in sound if sound[check] != turned[check]} == {"borders"}


def test_the_lectures_box_says_what_was_measured_on_the_drive_that_is_not_shipped():
    measured = json.loads((shipped_folder("docs") / "results" / "real_drive.json").read_text(encoding="utf-8"))
    one = measured["drives"]["stretch 1"]
    speed, late = one["metres"] / one["seconds"], one["delay ms"]["image_02"]
    assert motion_verdict(one["axes"]) is True
    numbers = [
        f"at {speed:.0f} m/s",
        f"images come {late:.0f} ms",
        f"moves by {speed * late / 10:.0f} cm",
        f"best at {measured['faults']['stretch 1']['none']['yaw']:.2f}°",
        f"{one['axes']['as the poses say']:.2f} m as the poses say",
        f"{one['axes']['left and right swapped']:.2f} m mirrored",
    ]
    source = (NOTEBOOKS / "src" / "13_real_drive.py").read_text(encoding="utf-8")
    box = " ".join(line.removeprefix("# > ") for line in source.splitlines() if line.startswith("# > "))
    assert [number for number in numbers if number not in box] == []


def test_a_map_that_is_right_beats_trivial_ones_and_one_that_is_wrong_does_not():
    rng = np.random.default_rng(2)
    truths, beliefs = rng.integers(0, 3, (1, 12, 12)), rng.random((1, 4, 12, 12))
    pieces = np.arange(144).reshape(1, 12, 12) // 12
    rivals = {"the table": best_table(truths, beliefs), "road": np.zeros_like(truths)}
    right = np.eye(14)[truths].transpose(0, 3, 1, 2)
    lines = map_lines("map", truths, right, rivals, pieces)
    assert [line.verdict for line in lines] == [True] * 3
    lines = map_lines("map", truths, right[:, ::-1], rivals, pieces)
    assert [line.verdict for line in lines] == [False] * 3


def test_the_drawing_says_each_verdict_in_words():
    lines = [Line("a", "1", True), Line("b", "2", False), Line("c", "3", None)]
    _, ax = plt.subplots()
    written = [text.get_text() for text in draw_report_card(lines, ax).texts]
    assert {"passes", "ALARM", "can't tell", "a", "2"} <= set(written)

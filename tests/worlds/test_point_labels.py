"""How wrong truth from labelled returns is: the counts add up, and carrying moving things is better than smearing."""

import pytest
from worlds.lecture_09_counts import counts_of
from worlds.lecture_09_point_labels import point_labels
from worlds.lecture_09_tables import truth_tables


@pytest.fixture(scope="module")
def result():
    return point_labels(drives=1, lidar="coarse")


@pytest.fixture(scope="module")
def shares(result):
    return {name: counts_of(result, name).shares(axis=(0, 1)) for name in result["sums"]}


def test_more_scans_find_more_cells(shares):
    assert shares["9 before and after"]["found"] > 1.5 * shares["one scan"]["found"]


def test_few_labels_are_wrong(shares):
    assert shares["one scan"]["wrong"] < 0.12
    assert shares["9 before and after"]["wrong"] < 0.12


def test_things_carried_with_their_cuboids_dont_smear(shares):
    carried, smeared = shares["9 before and after"], shares["9 before and after, movers smeared"]
    assert carried["wrong"] < smeared["wrong"]
    assert carried["found"] >= smeared["found"]


def test_cells_that_the_camera_sees_are_told_from_others(shares):
    assert shares["9 before and after, seen by the camera"]["hidden"] < 0.25 * shares["9 before and after"]["hidden"]


def test_the_table_has_a_row_for_each_way(result):
    assert all(f"| {name} " in truth_tables(result) for name in result["sums"])

"""What the camera is worth: baselines on cells that are computed by hand, counts that come back, one unit a camera."""

import numpy as np
import pytest
from worlds import lecture_08_camera_worth as worth
from worlds.lecture_08_camera_worth import RULE, Cells, without_networks
from worlds.lecture_08_counts import as_text, camera_scores, counts_of_text

from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.occupancy import N_STATES, State

ROAD, CAR, BUILDING = (KITTI_14.index(name) for name in ("road", "car", "building"))


def _cells(states, heights, true):
    """One frame with one row of cells; each state is certain."""
    o = np.eye(N_STATES, dtype=np.float32)[np.array(states)].T[None, :, None]
    above = np.array([heights, heights], dtype=float)[None, :, None]
    true = np.array(true, np.uint8)[None, None]
    return Cells(o, above, true, true)


def test_each_baseline_calls_cells_by_what_it_knows():
    """Static cells are cars more often than buildings, and unlabelled more often than either."""
    free, static = State.FREE, State.STATIC
    learned = _cells(6 * [static] + 2 * [free], 8 * [0.0], [CAR, CAR, BUILDING, *3 * [IGNORE], ROAD, ROAD])
    tested = _cells([free, static, static, State.DYNAMIC], [0.1, 1.0, 3.0, np.nan], [ROAD, CAR, BUILDING, CAR])
    maps = without_networks(learned, tested)
    assert maps[worth.ROAD].tolist() == [[[ROAD, ROAD, ROAD, ROAD]]]
    assert maps[worth.TABLE].tolist() == [[[ROAD, CAR, CAR, ROAD]]]  # no dynamic cell was learned from
    assert maps[RULE].tolist() == [[[ROAD, CAR, BUILDING, ROAD]]]
    assert maps[worth.FOREST].shape == (1, 1, 4)


def test_counts_come_back_from_their_text():
    counts = np.random.default_rng(0).integers(0, 2, (3, 14, 14))
    counts[1] = 0
    text = as_text({"front_camera": counts})["front_camera"]
    assert text[1] == ""
    assert counts_of_text(text).tolist() == counts.tolist()
    assert counts_of_text(["0>3:12"])[0, 0, 3] == 12


def _counts(rights):
    """Ten cells of road a camera in two frames, some of them right."""
    matrices = np.zeros((2, 14, 14), np.int64)
    found = {}
    for number, right in enumerate(rights):
        found[str(number)] = matrices.copy()
        found[str(number)][0, ROAD, ROAD] = right
        found[str(number)][1, ROAD, CAR] = 10 - right
        found[str(number)][1, KITTI_14.index("unknown-free"), ROAD] = 99  # isn't scored
    return found


def test_the_interval_is_over_cameras_and_paired_with_the_height_rule():
    """Three cameras with 8, 5 and 8 of ten right: 0.7 on average, t(2) = 4.30 standard errors of 0.1 either way."""
    counts = {"ours": _counts([8, 5, 8]), RULE: _counts([7, 4, 7])}
    scores = camera_scores(counts, "ours", RULE)
    assert scores["cells"] == 30
    assert scores["pixel accuracy"] == pytest.approx({"low": 0.7 - 0.4303, "mean": 0.7, "high": 0.7 + 0.4303}, abs=1e-4)
    assert scores["pixel accuracy by camera"] == {"0": 0.8, "1": 0.5, "2": 0.8}
    above = scores["pixel accuracy above the height rule"]
    assert above == pytest.approx({"low": 0.1, "mean": 0.1, "high": 0.1})


def test_a_network_may_be_forbidden_to_say_unknown():
    scores = np.zeros((1, 14, 1, 2))
    scores[0, KITTI_14.index("unknown-free")] = 2
    scores[0, CAR] = 1
    maps = worth._both_ways("net", scores)
    assert maps["net"].tolist() == [[[KITTI_14.index("unknown-free")] * 2]]
    assert maps["net, unknown forbidden"].tolist() == [[[CAR, CAR]]]

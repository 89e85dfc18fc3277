"""Scores of occupancy filters, on truths made by hand."""

import numpy as np
import pytest
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes
from worlds.lecture_04_cell_scores import CellScores, Estimate, hit_cell_groups
from worlds.lecture_04_scenes import CellTruth, KnownScene, SceneHistory, pool_truth

from semgrid_edu.camera import Camera
from semgrid_edu.frame import LABEL_GRID, Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, PlanarMotion, State
from semgrid_edu.workshop.simulation.things.materials import Kind

FREE, STATIC, DYNAMIC, UNKNOWN = State
ROW = GridSpec(0, 1, 0, 5, 1)
"""One row of five cells: free road, a wall, and three cells of a car, the last one behind it, never seen."""
CAMERA = Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), size=(10, 20))


def row(*values) -> np.ndarray:
    return np.array([values])


def scene(**changes) -> KnownScene:
    velocity = np.zeros((2, 1, 5), np.float32)
    velocity[0, 0, 2:] = 10.0
    truth = CellTruth(
        row(FREE, STATIC, DYNAMIC, DYNAMIC, DYNAMIC),
        row(Kind.ROAD, Kind.BUILDING, Kind.CAR, Kind.CAR, Kind.CAR),
        row(0, 0, 7, 7, 7),
        velocity,
    )
    frame = Frame(None, np.empty((0, 4), np.float32), CAMERA, np.eye(4), 2.0)
    parts = {
        "hit": row(0, 1, 1, 1, 0) > 0,
        "observed": row(1, 1, 1, 1, 0) > 0,
        "never_seen": row(0, 0, 0, 0, 1) > 0,
        "left": row(1, 0, 0, 0, 0) > 0,
        "in_view": {7: 15},
    }
    return KnownScene(frame, PlanarMotion(), truth, **(parts | changes))


def belief() -> Belief:
    """Call the cells FREE, STATIC, DYNAMIC, STATIC, UNKNOWN; the third moves at 13 m/s forward and 4 to the left."""
    probability = np.array(
        [[0.7, 0.2, 0.1, 0.0], [0, 0.9, 0.1, 0], [0, 0.2, 0.8, 0], [0, 0.6, 0.4, 0], [0, 0, 0, 1]], np.float32
    ).T[:, None]
    velocity = np.full((2, 1, 5), np.nan, np.float32)
    velocity[:, 0, 2] = 13.0, 4.0
    return Belief(probability, velocity, np.full((2, 2, 1, 5), np.nan, np.float32))


@pytest.fixture
def summary() -> dict:
    scores = CellScores(ROW)
    scores.add(scene(), Estimate.of_belief(belief()))
    return scores.summary()


def test_the_confusion_counts_observed_cells_and_cells_never_seen(summary):
    assert summary["confusion"] == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 1, 0], [0, 0, 0, 1]]
    assert summary["accuracy"] == 0.8
    assert summary["dynamic"] == {"precision": 1.0, "recall": 0.5}


def test_a_cell_that_was_seen_once_and_is_hidden_now_counts_nowhere():
    scores = CellScores(ROW)
    scores.add(scene(never_seen=np.zeros((1, 5), bool)), Estimate.of_belief(belief()))
    assert scores.confusion.sum() == 4


def test_velocity_errors_are_vectors_of_cells_rightly_called_dynamic(summary):
    assert summary["velocity error"]["moving cars"] == {"cells": 1, "median": 5.0, "rms": 5.0}
    assert summary["velocity error"]["cyclists"] == {"cells": 0, "median": None, "rms": None}


def test_hit_cells_are_divided_by_what_is_in_them(summary):
    hits = summary["hit cells"]
    assert hits["moving cars, to 25 m"] == {"cells": 2, "dynamic": 0.5, "occupied": 1.0}
    assert hits["walls"] == {"cells": 1, "dynamic": 0.0, "occupied": 1.0}
    assert {name for name, one in hits.items() if one["cells"]} == {"moving cars, to 25 m", "walls"}


@pytest.mark.parametrize(("frames", "cells"), [(14, 0), (15, 2)])
def test_what_moves_counts_from_1_5_seconds_in_view_on(frames, cells):
    found = dict(hit_cell_groups(scene(in_view={7: frames}), ROW))
    assert found["moving cars, to 25 m"].sum() == cells


def test_smear_is_what_is_held_occupied_where_something_has_left(summary):
    assert summary["smear"] == {"cells": 1, "occupied": 0.0}
    scores = CellScores(ROW)
    scores.add(scene(), Estimate.of_log_odds(np.full((1, 5), 0.97)))
    assert scores.summary()["smear"]["occupied"] == 1.0


def test_a_log_odds_grid_calls_static_what_is_occupied_and_unknown_what_is_undecided():
    estimate = Estimate.of_log_odds(row(0.3, 0.5, 0.54, 0.7, 0.97))
    assert estimate.state.tolist() == [[FREE, UNKNOWN, UNKNOWN, STATIC, STATIC]]
    assert not estimate.moves.any()
    assert np.isnan(estimate.velocity).all()


def test_scores_of_nothing_are_none():
    summary = CellScores(ROW).summary()
    assert summary["accuracy"] is summary["dynamic"]["precision"] is summary["smear"]["occupied"] is None


def fine(kind=Kind.ROAD) -> tuple[np.ndarray, np.ndarray]:
    return np.full(LABEL_GRID.shape, kind, np.uint8), np.zeros(LABEL_GRID.shape, np.int32)


def test_a_cell_takes_what_covers_most_of_it_ground_left_aside():
    kinds, instances = fine()
    kinds[0, 0] = Kind.POLE
    kinds[0, 2:5], instances[0, 2:5] = Kind.CAR, [3, 3, 4]
    kinds[1, 2:4] = Kind.GRASS
    kinds[2:4, 0:2], kinds[2, 0] = Kind.GRASS, Kind.ROAD
    truth = pool_truth(kinds, instances, {3: (6.0, 0.0), 9: (1.0, 1.0)}, GridSpec.paper())
    assert truth.state[0, :4].tolist() == [STATIC, DYNAMIC, STATIC, FREE]
    assert truth.kind[0, :4].tolist() == [Kind.POLE, Kind.CAR, Kind.CAR, Kind.ROAD]
    assert truth.instance[0, :4].tolist() == [0, 3, 4, 0]
    assert truth.velocity[:, 0, 1].tolist() == [6.0, 0.0]
    assert truth.kind[1, 0] == Kind.GRASS


CELLS = GridSpec(0, 20, -5, 5, 0.5)


def crossing(steps: int) -> list[KnownScene]:
    """Return the scenes of a box that crosses 10 m ahead to the left at 5 m/s, and hides what is behind it."""
    past, seen = SceneHistory(CELLS), []
    for k in range(steps):
        box = Box.around(10.0, -4.0 + 0.5 * k, 1.0, 1.0, 1.6)
        points = scan_boxes([box, Box(16, 17, -5, 5, 2.0)], columns=720)
        there = cells_in(box, CELLS)
        truth = CellTruth(
            np.where(there, DYNAMIC, FREE), np.where(there, Kind.CAR, Kind.ROAD), there * 5, np.zeros((2, *CELLS.shape))
        )
        lidar = np.pad(points, ((0, 0), (0, 1))) - np.float32([0, 0, CAMERA.lidar_height, 0])
        seen.append(past.add(Frame(None, lidar, CAMERA, np.eye(4), 0.1 * k), truth))
    return seen


def test_what_moved_leaves_free_cells_for_a_second():
    seen = crossing(15)
    rows, cols, _ = CELLS.cells(np.array([[10.25, -3.75], [10.25, 1.25]]))
    left = [scene.left[rows[0], cols[0]] for scene in seen]
    assert not any(left[:2])
    assert all(left[3:11])
    assert not any(left[13:])
    assert not seen[-1].left[rows[1], cols[1] - 3]  # not there yet


def test_cells_behind_the_wall_are_never_seen_and_those_behind_the_box_have_been():
    first, last = (lambda seen: (seen[0], seen[-1]))(crossing(10))
    behind_wall = cells_in(Box(18, 20, -4, 4, 0), CELLS)
    assert first.never_seen[behind_wall].all()
    assert last.never_seen[behind_wall].all()
    shadow = cells_in(Box(11.5, 12, 0.2, 0.8, 0), CELLS)
    assert not last.observed[shadow].any()
    assert not last.never_seen[shadow].any()


def test_an_object_counts_its_frames_in_view():
    assert [scene.in_view for scene in crossing(3)] == [{5: 0}, {5: 1}, {5: 2}]

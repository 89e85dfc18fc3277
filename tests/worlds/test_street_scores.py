"""Scores of a filter on test streets, on frames made by hand."""

import numpy as np
from worlds.lecture_04_scenes import CellTruth, KnownScene
from worlds.lecture_04_street_scores import StreetScores

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, Camera
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, PlanarMotion, State
from semgrid_edu.workshop.simulation.things.materials import Kind

FREE, STATIC, DYNAMIC, UNKNOWN = State
ROW = GridSpec(2, 3, -11, -3, 1)
"""One row of eight cells ahead: road, two of a fence, a parked car, three of car 7, one of pedestrian 9."""
STATES = [[FREE, STATIC, STATIC, STATIC, DYNAMIC, DYNAMIC, DYNAMIC, DYNAMIC]]
KINDS = [[Kind.ROAD, Kind.FENCE, Kind.FENCE, Kind.CAR, Kind.CAR, Kind.CAR, Kind.CAR, Kind.PEDESTRIAN]]
INSTANCES = [[0, 0, 0, 3, 7, 7, 7, 9]]
CAMERA = Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), size=(10, 20))


def scene(time: float, height: float = 1.0) -> KnownScene:
    """Every cell is hit by two returns at one height."""
    y, x = -3.5 - np.arange(8.0), np.full(8, 2.5)
    points = np.column_stack([x, y, np.full(8, height - KITTI_LIDAR_HEIGHT), np.zeros(8)]).repeat(2, axis=0)
    velocity = np.zeros((2, 1, 8), np.float32)
    velocity[0, 0, 4:7] = 10.0
    truth = CellTruth(np.array(STATES), np.array(KINDS), np.array(INSTANCES), velocity)
    frame = Frame(None, points.astype(np.float32), CAMERA, np.eye(4), time)
    everywhere = np.ones((1, 8), bool)
    left = truth.state == FREE
    return KnownScene(frame, PlanarMotion(), truth, everywhere, everywhere, ~everywhere, left, {3: 20, 7: 20, 9: 20})


def belief(dynamic: list[float]) -> Belief:
    """Share every cell between STATIC and DYNAMIC."""
    p = np.zeros((4, 1, 8), np.float32)
    p[DYNAMIC, 0], p[STATIC, 0] = dynamic, 1 - np.array(dynamic)
    velocity = np.zeros((2, 1, 8), np.float32)
    velocity[0] = 9.0
    return Belief(p, velocity, np.zeros((2, 2, 1, 8), np.float32))


def scored(*frames: tuple[float, list[float]], height: float = 1.0) -> dict:
    scores = StreetScores(ROW)
    for time, dynamic in frames:
        scores.add(scene(time, height=height), belief(dynamic))
    return scores.cells


NO, YES = 0.0, 1.0


def test_phantoms_are_cells_of_scenery_called_dynamic_from_one_second_on():
    wrong = [NO, YES, NO, YES, YES, YES, YES, YES]
    assert "scenery" not in scored((0.9, wrong))
    cells = scored((1.0, wrong))
    assert cells["scenery"] == cells["fences"] == [2, 1]
    assert cells["standing cars"] == [1, 1]
    assert cells["walls"] == [0, 0]


def test_a_phantom_is_likelier_dynamic_than_static_and_than_0_3():
    weak = belief([NO, 0.25, 0.45, NO, NO, NO, NO, NO])
    weak.probability[STATIC, 0, 1] = 0.2
    scores = StreetScores(ROW)
    scores.add(scene(2.0), weak)
    assert scores.cells["fences"] == [2, 0]


def test_static_things_count_where_they_are_hit_above_0_7_m():
    assert scored((2.0, [NO] * 8), height=0.5)["scenery"] == [0, 0]


def test_moving_things_count_once_they_have_moved_in_view_for_long():
    half = [NO, NO, NO, NO, YES, YES, NO, YES]
    assert scored((0.0, half), (0.7, half))["moving cars"] == [0, 0]
    cells = scored((0.0, half), (0.8, half))
    assert cells["moving cars"] == [3, 2]
    assert cells["walkers, near"] == [0, 0]
    assert scored((0.0, half), (1.5, half))["walkers, near"] == [1, 1]


def test_what_something_has_left_should_not_stay_occupied():
    assert scored((0.0, [NO] * 8))["left"] == [1, 1]

"""Scores of a filter on test streets, on frames made by hand."""

import json
from functools import partial

import numpy as np
import pytest

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, Camera
from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Belief, PlanarMotion, State
from semgrid_edu.workshop.commands.main import run
from semgrid_edu.workshop.simulation.street.traffic import Actor
from semgrid_edu.workshop.simulation.street.trajectories import ActorPace, Trajectory
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.studies.filter.detection_latency import convoy_pairs
from semgrid_edu.workshop.studies.filter.scenes import CellTruth, KnownScene
from semgrid_edu.workshop.studies.filter.streets import StreetScores, measure_streets, streets_tables

FREE, STATIC, DYNAMIC, UNKNOWN = State
ROW = GridSpec(2, 3, -11, -3, 1)
"""One row of eight cells ahead: road, two of a fence, a parked car, three of car 7, one of pedestrian 9."""
STATES = [[FREE, STATIC, STATIC, STATIC, DYNAMIC, DYNAMIC, DYNAMIC, DYNAMIC]]
KINDS = [[Kind.ROAD, Kind.FENCE, Kind.FENCE, Kind.CAR, Kind.CAR, Kind.CAR, Kind.CAR, Kind.PEDESTRIAN]]
INSTANCES = [[0, 0, 0, 3, 7, 7, 7, 9]]
CAMERA = Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), size=(10, 20))
LOOK = ("sedan", (0.1, 0.1, 0.1))


def actor(number: int, kind: Kind, s: float, pace: ActorPace, along: int = 1, d: float = 0.0) -> Actor:
    return Actor(number, kind, (4.0, 1.8, 1.5), Trajectory(s, d, along, 0, pace), LOOK)


MOVING = [actor(7, Kind.CAR, 20.0, ActorPace(10)), actor(9, Kind.PEDESTRIAN, 5.0, ActorPace(1.4))]


def scene(time: float, frames_in_view: int = 20, height: float = 1.0) -> KnownScene:
    """Every cell is hit by two returns at one height."""
    y, x = -3.5 - np.arange(8.0), np.full(8, 2.5)
    points = np.column_stack([x, y, np.full(8, height - KITTI_LIDAR_HEIGHT), np.zeros(8)]).repeat(2, axis=0)
    velocity = np.zeros((2, 1, 8), np.float32)
    velocity[0, 0, 4:7] = 10.0
    truth = CellTruth(np.array(STATES), np.array(KINDS), np.array(INSTANCES), velocity)
    frame = Frame(None, points.astype(np.float32), CAMERA, np.eye(4), time)
    everywhere = np.ones((1, 8), bool)
    left = truth.state == FREE
    in_view = {3: frames_in_view, 7: frames_in_view, 9: frames_in_view}
    return KnownScene(frame, PlanarMotion(), truth, everywhere, everywhere, ~everywhere, left, in_view)


def belief(dynamic: list[float], speed: float = 9.0) -> Belief:
    """Share every cell between STATIC and DYNAMIC."""
    p = np.zeros((4, 1, 8), np.float32)
    p[DYNAMIC, 0], p[STATIC, 0] = dynamic, 1 - np.array(dynamic)
    velocity = np.zeros((2, 1, 8), np.float32)
    velocity[0] = speed
    return Belief(p, velocity, np.zeros((2, 2, 1, 8), np.float32))


def scored(*frames: tuple[float, list[float]]) -> dict:
    scores = StreetScores(ROW)
    scores.latency.begin(MOVING)
    for time, dynamic in frames:
        scores.add(scene(time), belief(dynamic))
    scores.latency.end()
    return scores.summary()


NO, YES = 0.0, 1.0


def test_phantoms_are_cells_of_scenery_called_dynamic_from_one_second_on():
    wrong = [NO, YES, NO, YES, YES, YES, YES, YES]
    assert scored((0.9, wrong))["cells"].get("scenery") is None
    cells = scored((1.0, wrong))["cells"]
    assert cells["scenery"] == cells["fences"] == {"cells": 2, "called": 0.5}
    assert cells["standing cars"] == {"cells": 1, "called": 1.0}
    assert cells["walls"] == {"cells": 0, "called": None}


def test_a_phantom_is_likelier_dynamic_than_static_and_than_0_3():
    weak = belief([NO, 0.25, 0.45, NO, NO, NO, NO, NO])
    weak.probability[STATIC, 0, 1] = 0.2
    scores = StreetScores(ROW)
    scores.latency.begin(MOVING)
    scores.add(scene(2.0), weak)
    assert scores.summary()["cells"]["fences"]["called"] == 0.0


def test_what_stands_counts_where_it_is_hit_above_0_7_m():
    scores = StreetScores(ROW)
    scores.latency.begin(MOVING)
    scores.add(scene(2.0, height=0.5), belief([NO] * 8))
    assert scores.summary()["cells"]["scenery"]["cells"] == 0


def test_the_worst_frame_is_one_of_60_cells_or_more():
    assert scored((1.0, [NO, YES, YES, NO, NO, NO, NO, NO]))["worst frame"] is None
    scores = StreetScores(ROW)
    scores.frames += [(59, 59), (60, 6), (100, 5)]
    assert scores.summary()["worst frame"] == 0.1


def test_moving_things_count_once_they_have_moved_in_view_for_long():
    half = [NO, NO, NO, NO, YES, YES, NO, YES]
    assert scored((0.0, half), (0.7, half))["cells"]["moving cars"]["cells"] == 0
    cells = scored((0.0, half), (0.8, half))["cells"]
    assert cells["moving cars"] == {"cells": 3, "called": pytest.approx(2 / 3)}
    assert cells["walkers, near"]["cells"] == 0
    assert scored((0.0, half), (1.5, half))["cells"]["walkers, near"] == {"cells": 1, "called": 1.0}


def test_speed_is_that_of_the_mean_velocity():
    summary = scored((0.0, [YES] * 8), (1.5, [YES] * 8))
    assert summary["speed error"] == {"cases": 1, "median": 1.0, "within 1.5 m/s": 1.0}


def test_what_something_has_left_should_not_stay_occupied():
    assert scored((0.0, [NO] * 8))["cells"]["left"] == {"cells": 1, "called": 1.0}


def test_something_is_found_when_half_of_its_cells_are_called_dynamic():
    one, two = [NO] * 4 + [YES, NO, NO, NO], [NO] * 4 + [YES, YES, NO, NO]
    times = scored((0.0, one), (0.1, one), (0.2, two), (1.2, one))["found after"]
    assert times == {"cars": [0.2], "pedestrians": [None]}


def test_something_in_view_for_less_than_a_second_may_stay_unfound():
    assert scored((0.0, [NO] * 8), (0.5, [NO] * 8))["found after"] == {"cars": [], "pedestrians": []}


def test_a_follower_is_late_from_when_the_first_is_found_and_it_is_hit():
    """Car 7 is found at 0.2 s; car 8 behind it is hit from the beginning, and found at 0.6 s."""
    scores, pace = StreetScores(ROW), ActorPace(10)
    scores.latency.begin([actor(7, Kind.CAR, 20.0, pace), actor(8, Kind.CAR, 5.0, pace)])
    for time, first, second in ((0.0, NO, NO), (0.2, YES, NO), (0.6, YES, YES)):
        one = scene(time)
        one.truth.instance[:] = [[0, 0, 0, 8, 7, 7, 7, 0]]
        one.truth.state[:] = [[FREE, DYNAMIC, DYNAMIC, DYNAMIC, DYNAMIC, DYNAMIC, DYNAMIC, FREE]]
        one.truth.instance[0, 1:4] = 8
        scores.add(one, belief([NO, second, second, second, first, first, first, NO]))
    scores.latency.end()
    assert scores.summary()["found after the car ahead"] == [pytest.approx(0.4)]


def test_cars_on_one_line_at_one_pace_form_a_convoy():
    pace, other = ActorPace(10), ActorPace(9)
    oncoming = [actor(k, Kind.CAR, s, pace, along=-1, d=3.0) for k, s in ((1, 50.0), (2, 30.0), (3, 70.0))]
    others = [actor(4, Kind.CAR, 10.0, pace, d=3.0), actor(5, Kind.CAR, 20.0, other, along=-1, d=3.0)]
    assert convoy_pairs([*oncoming, *others, actor(6, Kind.PEDESTRIAN, 40.0, pace, along=-1, d=3.0)]) == [
        (2, 1),
        (1, 3),
    ]


def test_the_command_writes_what_measure_returns_and_prints_it_as_tables(tmp_path, monkeypatch, capsys):
    out, short = tmp_path / "streets.json", partial(measure_streets, frames=3, streets=("mesh", "convoy"))
    monkeypatch.setattr("semgrid_edu.workshop.studies.filter.streets.measure_streets", short)
    arguments = ["reproduce", "streets", "--seed", "1", "--drives", "1", "--grid", "compact", "--out", str(out)]
    monkeypatch.setattr("sys.argv", ["semgrid-edu", *arguments])
    with pytest.raises(SystemExit, match="0"):
        run()
    written = json.loads(out.read_text())
    assert written["scores"] == short(seed=1, drives=1, grids=("compact",))["scores"]
    assert written["command"] == "semgrid-edu reproduce streets --seed 1 --drives 1 --grid compact"
    tables = streets_tables(written)
    assert tables in capsys.readouterr().out
    assert [line.split("|")[1].strip() for line in tables.splitlines() if line.startswith("| ")] == [
        "stands, called DYNAMIC",
        "mesh",
        "convoy",
        "moves",
    ]


@pytest.mark.parametrize(
    ("bad", "name"),
    [
        ({"drives": 0}, "drives"),
        ({"frames": 0}, "frames"),
        ({"seed": -1}, "seed"),
        ({"grids": ()}, "grid"),
        ({"streets": ("alley",)}, "street"),
    ],
)
def test_what_cannot_be_measured_is_refused_by_name(bad, name):
    with pytest.raises(ArgumentError, match=name):
        measure_streets(**bad)

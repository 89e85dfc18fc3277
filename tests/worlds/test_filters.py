"""The comparison of occupancy filters on simulated drives, and what CMCDOT's defaults have to do there."""

import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path

import pytest
from worlds import lecture_04_filters
from worlds.lecture_04_cell_scores import CellScores, Estimate
from worlds.lecture_04_filters import GRIDS, LIDARS, METHODS, compare_filters, occupancy_table, occupancy_tables
from worlds.lecture_04_scenes import known_scenes

import semgrid_edu
from semgrid_edu.fast import Cmcdot
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.rig import Rig
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.workshop.simulation.street.traffic import Traffic
from semgrid_edu.workshop.simulation.street.trajectories import STANDSTILL, ActorPace, Trajectory
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.workplace import Workplace

COMMITTED = Path(semgrid_edu.__file__).parents[1] / "docs" / "results" / "occupancy.json"
WALKERS = "walking pedestrians, to 25 m"


def people_and_parked_cars(traffic: Traffic) -> None:
    """Let people walk at 1.4 m/s towards us, away from us and across, between parked cars."""
    road = traffic.road
    for side, sign in ((road.left, 1), (road.right, -1)):
        for s in (8.0, 14.0, 20.0, 26.0):
            way = Trajectory(s, sign * (side.edge - 1.06), 1, 0, STANDSTILL)
            traffic.park(Kind.CAR, way, ("estate", (0.3, 0.3, 0.3)))
        for s, along in ((10.0, 1), (16.0, -1), (21.0, 1), (24.0, -1)):
            traffic.walk(s, sign * (side.edge + side.strip + side.walk / 2), along, 0, ActorPace(1.4))
        traffic.walk(12.0 + 3 * sign, 3.0 * sign, 0, -sign, ActorPace(1.4))


@pytest.fixture(scope="module")
def hits() -> dict:
    """What CMCDOT makes of the hit cells of a drive of 2 s at 3 m/s, with its defaults."""
    styles, borders = ("town", "town"), ("hedge", "hedge")
    wishes = Wishes("straight", (1, 1), styles, borders, (True, True), speed=3.0, cast=people_and_parked_cars)
    drive = SimulatedDrive(0, 20, wishes, Rig(lidar=LIDARS["HDL-64E"]))
    tracker, scores = Cmcdot(GridSpec.paper(), seed=0), CellScores(GridSpec.paper())
    for scene in known_scenes(drive, GridSpec.paper()):
        belief = tracker.step(scene.frame.points_grid, scene.motion, PERIOD)
        scores.add(scene, Estimate.of_belief(belief))
    return scores.summary()["hit cells"]


def test_people_who_walk_are_dynamic(hits):
    assert hits[WALKERS]["cells"] > 50
    assert hits[WALKERS]["dynamic"] >= 0.6


def test_parked_cars_and_walls_are_not(hits):
    for name in ("standing cars", "walls"):
        assert hits[name]["cells"] > 300
        assert hits[name]["dynamic"] <= 0.03


@pytest.mark.parametrize("lidar", LIDARS)
@pytest.mark.parametrize("grid", GRIDS)
def test_the_committed_comparison_says_the_same_of_all_its_drives(lidar, grid):
    hits = json.loads(COMMITTED.read_text())["scores"][lidar][grid]["CMCDOT"]["hit cells"]
    assert hits[WALKERS]["dynamic"] >= 0.6
    for name in ("standing cars", "parked bicycles", "walls", "fences", "foliage", "poles", "signs"):
        assert hits[name]["dynamic"] <= 0.03


def test_a_comparison_has_scores_for_each_lidar_grid_and_filter(monkeypatch):
    here = Workplace(ThreadPoolExecutor(1), 1)
    monkeypatch.setattr(lecture_04_filters, "workplace", lambda: nullcontext(here))
    result = compare_filters(seed=1, drives=1, grids=("compact",), frames=1)
    assert {(lidar, *grids) for lidar, grids in result["scores"].items()} == {(lidar, "compact") for lidar in LIDARS}
    assert occupancy_table(result, "coarse", "compact") in occupancy_tables(result)


def test_a_table_has_one_column_a_method():
    lines = occupancy_table(json.loads(COMMITTED.read_text())).splitlines()
    assert [cell.strip() for cell in lines[0].split("|")[2:-1]] == list(METHODS)
    assert {line.count("|") for line in lines} == {2 + len(METHODS)}
    assert len({len(line) for line in lines}) == 1

"""Each named street has the things that its name promises, where real streets have them."""

from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest

from semgrid_edu.errors import ArgumentError
from semgrid_edu.frame import LABEL_GRID
from semgrid_edu.workshop.simulation import drive, simulate
from semgrid_edu.workshop.simulation.drive import PERIOD, SimulatedDrive
from semgrid_edu.workshop.simulation.street.builder import Builder
from semgrid_edu.workshop.simulation.street.ground import ground_mesh
from semgrid_edu.workshop.simulation.street.plan import RANDOM_STREET, YARD, Wishes, draw_plan
from semgrid_edu.workshop.simulation.street.road_users import overturned_car
from semgrid_edu.workshop.simulation.street.trajectories import Departure
from semgrid_edu.workshop.simulation.things.materials import Kind, Material

FENCED = ("mesh", "mesh and hedge", "hedge", "glass", "posts", "walls")
SEEDS = (0, 1, 2)


@cache
def street(name: str) -> SimulatedDrive:
    """A street that several tests share and none of them changes."""
    return simulate(0, 2, name)


def convoy_pairs(moving) -> list[tuple[int, int]]:
    """Numbers of each car and its follower: cars on the same line at the same pace."""
    lines: dict[object, list[tuple[float, int]]] = {}
    for path, number in ((actor.trajectory, actor.instance) for actor in moving if actor.kind == Kind.CAR):
        line = (path.along, path.across, path.d if path.along else path.s, path.pace)
        lines.setdefault(line, []).append((path.s * path.along + path.d * path.across, number))
    ordered = [[number for _, number in sorted(line, reverse=True)] for line in lines.values()]
    return [pair for line in ordered for pair in pairwise(line)]


def materials(drive) -> set:
    return set(drive.instant(0.0).material)


def places_right_of_lane(drive, kind: Kind) -> np.ndarray:
    """Positions of all objects of a kind to the right of our lane: along the road, and distance from the lane."""
    row = drive.static_footprints
    x, y = row[:, 0], row[:, 1]
    return np.column_stack([x, drive.ego.trajectory.d - y])[(row[:, 6] == kind) & (y < drive.ego.trajectory.d)]


def only_ground(plan, rng) -> Builder:
    """Scenery that is quick to build, for tests of the plan and of road users."""
    builder = Builder(plan, rng)
    builder.solid.append((ground_mesh(plan.road, plan.start, plan.end), 0))
    return builder


@pytest.fixture
def no_scenery(monkeypatch):
    """Let streets have a ground and road users only: most of the time goes into houses, trees and fences."""
    monkeypatch.setattr(drive, "build_scenery", only_ground)


@pytest.mark.usefixtures("no_scenery")
def test_the_car_passes_a_border_at_12_to_14_metres_a_second():
    offenders = []
    for name, seed in product(FENCED, SEEDS):
        bare = simulate(seed, 2, name)
        ego, side = bare.ego.trajectory, bare.plan.road.right
        distance = side.edge + side.strip + side.walk + 0.35 + ego.d
        if not (12 <= ego.pace.mean <= 14 and 3 < distance < 8):
            offenders.append((name, seed, ego.pace.mean, distance))
    assert offenders == []


def test_the_porous_materials_of_a_street():
    porous = {Material.WIRE, Material.TWIGS, Material.PANE}
    expected = {name: set() for name in FENCED}
    expected |= {"mesh": {Material.WIRE}, "mesh and hedge": {Material.WIRE, Material.TWIGS}}
    expected |= {"hedge": {Material.TWIGS}, "glass": {Material.PANE}}
    assert {name: materials(street(name)) & porous for name in expected} == expected


def test_posts_form_a_regular_row():
    places = places_right_of_lane(street("posts"), Kind.POLE)
    offsets, counts = np.unique(places[:, 1].round(2), return_counts=True)
    row = np.sort(places[np.isclose(places[:, 1], offsets[counts.argmax()], atol=0.01), 0])
    steps = np.diff(row)
    assert len(row) > 40
    assert np.mean(np.abs(steps - np.median(steps)) < 0.01) > 0.8
    assert 1.4 <= np.median(steps) <= 2.6


def test_there_are_cross_walls_behind_gaps():
    drive = street("walls")
    walls = drive.static_footprints[drive.static_footprints[:, 6] == Kind.BUILDING]
    across = walls[(np.abs(np.cos(walls[:, 4])) < np.sin(0.6)) & (walls[:, 3] < 0.2)]
    assert len(across) > 5


@pytest.mark.usefixtures("no_scenery")
def test_the_gaps_of_a_convoy_are_8_to_20_metres():
    offenders = []
    for seed in SEEDS:
        drive = simulate(seed, 36, "convoy")
        road, pairs = drive.plan.road, convoy_pairs(drive.moving)
        actors = {actor.instance: actor for actor in drive.moving}
        assert pairs
        for t, (ahead, follower) in product((0.0, 3.0), pairs):
            a, b = actors[ahead], actors[follower]
            gap = np.linalg.norm(a.middle(road, t) - b.middle(road, t)) - (a.size[0] + b.size[0]) / 2 + 0.5
            if not 8 <= gap <= 21:
                offenders.append((seed, t, ahead, follower, gap))
    assert offenders == []


@pytest.mark.usefixtures("no_scenery")
def test_pedestrians_walk_along_and_across():
    ways = {(a.trajectory.along, abs(a.trajectory.across)) for a in simulate(0, 36, "pedestrians").moving}
    assert {(1, 0), (-1, 0), (0, 1)} <= ways


@pytest.mark.usefixtures("no_scenery")
def test_slow_starters_wait_for_a_second_and_then_move():
    drive = simulate(0, 36, "slow starters")
    kinds = {actor.kind for actor in drive.moving}
    assert kinds == {Kind.CAR, Kind.PEDESTRIAN}
    assert all(np.hypot(*velocity) < 1e-9 for velocity in drive.velocities(0.99).values())
    assert all(np.hypot(*velocity) > 0.9 for velocity in drive.velocities(3.4).values())


@pytest.mark.usefixtures("no_scenery")
def test_cars_cross_in_both_directions():
    ways = {seed: {a.trajectory.across for a in simulate(seed, 36, "crossing cars").moving} for seed in SEEDS}
    assert ways == {seed: {-1, 1} for seed in SEEDS}


@pytest.mark.usefixtures("no_scenery")
def test_seed_and_name_decide_the_street():
    streets = (0, "mesh"), (0, "mesh"), (1, "mesh"), (0, "glass")
    one, again, other, elsewhere = (simulate(seed, 2, name).scan(1).points for seed, name in streets)
    assert np.array_equal(one, again)
    assert one.shape != other.shape or not np.array_equal(one, other)
    assert one.shape != elsewhere.shape or not np.array_equal(one, elsewhere)


@pytest.mark.usefixtures("no_scenery")
def test_poses_come_from_packets_up_to_5_ms_away():
    drive = simulate(0, 8, "mesh")
    errors = [np.linalg.norm(drive.scan(k).T_world_from_lidar[:2, 3] - drive.pose(k * PERIOD)[:2, 3]) for k in range(8)]
    assert 0 < max(errors) <= 0.005 * 14 * 1.15
    assert len(set(errors)) == 8


def test_returns_of_a_border_are_where_the_truth_has_an_object():
    """Beams that pass through mesh and hedge get longer ranges, but still end on something in the truth."""
    drive = street("mesh and hedge")
    points = drive.scan(1).points_grid
    kinds = drive.birdseye(PERIOD)[0]
    right = (points[:, 1] < -3) & (points[:, 0] > 2) & (points[:, 0] < 40) & (points[:, 2] > 0.7) & (points[:, 2] < 1.6)
    rows, cols, inside = LABEL_GRID.cells(points[right])
    ground = np.isin(kinds[rows[inside], cols[inside]], [Kind.ROAD, Kind.LANE, Kind.SIDEWALK, Kind.GRASS])
    assert len(ground) > 1000
    assert ground.mean() < 0.1


def test_a_departure_covers_the_integral_of_its_speed():
    pace, times = Departure(5.0, 1.0, 2.0), np.linspace(0, 6, 6001)
    covered = np.concatenate([[0], np.cumsum(np.diff(times) * [pace.speed(t) for t in (times[1:] + times[:-1]) / 2])])
    assert [pace.distance(t) for t in times] == pytest.approx(covered, abs=1e-6)


def test_a_yard_never_comes_up_at_random():
    assert not any(YARD in draw_plan(np.random.default_rng(seed), 30.0, RANDOM_STREET).styles for seed in range(200))


def test_an_unknown_street_raises_an_error():
    with pytest.raises(ArgumentError, match=r"mesh and hedge.*found alley"):
        simulate(0, 36, "alley")


@pytest.mark.usefixtures("no_scenery")
def test_the_overturned_car_is_a_few_metres_ahead():
    for seed in SEEDS:
        objects = SimulatedDrive(seed, 3, Wishes(cast=overturned_car)).objects(2 * PERIOD)
        (lying,) = (one for one in objects if one.get("overturned"))
        assert lying["class"] == "car"
        assert not lying["moving"]
        assert 9 <= lying["centre"][0] <= 23
        assert lying["centre"][2] == pytest.approx(lying["size"][2] / 2, abs=0.3)
        assert all("overturned" not in one for one in objects if one is not lying)

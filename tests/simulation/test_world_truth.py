"""Road users don't collide, and the labels of a street agree with each other and with its geometry."""

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from semgrid_edu.camera import transform_points
from semgrid_edu.frame import LABEL_GRID
from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.street.footprints import (
    ROUND,
    SQUARE,
    Footprint,
    collides,
    footprint_table,
    outline,
    stamp,
)
from semgrid_edu.workshop.simulation.street.layout import outside_asphalt, to_road
from semgrid_edu.workshop.simulation.things.materials import Kind, class_of_kind
from semgrid_edu.workshop.simulation.things.shapes import merge


def test_stamping_equals_testing_every_cell():
    rng = np.random.default_rng(0)
    feet = [
        Footprint(*rng.uniform(0, 6, 2), *rng.uniform(0.3, 1.5, 2), rng.uniform(-3, 3), p, k, 0, 2.0)
        for k, p in enumerate((ROUND, SQUARE, 6.0))
    ]
    c, s = np.cos(0.3), np.sin(0.3)
    rows, cols = np.mgrid[:60, :50]
    ahead, left = 6 - (rows + 0.5) * 0.1, 5 - (cols + 0.5) * 0.1
    cells = np.stack([c * ahead - s * left + 1.0, s * ahead + c * left - 0.5], axis=-1)
    expected = np.full((60, 50), -1)
    for k, f in enumerate(feet):
        x, y = cells[..., 0] - f.x, cells[..., 1] - f.y
        u = np.abs(np.cos(f.yaw) * x + np.sin(f.yaw) * y) / f.half_length
        v = np.abs(np.cos(f.yaw) * y - np.sin(f.yaw) * x) / f.half_width
        with np.errstate(over="ignore"):
            expected[u**f.exponent + v**f.exponent <= 1] = k
    which = np.full((60, 50), -1, np.int32)
    stamp(footprint_table(feet), cells, 0.1, which)
    assert np.array_equal(which, expected)
    assert len(np.unique(which)) == 4


def test_collision_of_rectangles():
    car = Footprint(0, 0, 2.2, 0.9, 0.0, SQUARE, Kind.CAR, 1, 1.5)
    beside, into = car._replace(y=2.0), car._replace(x=3.0, y=1.0, yaw=0.7)
    assert not collides(car, footprint_table([beside]))
    assert collides(car, footprint_table([beside]), margin=0.3)
    assert collides(car, footprint_table([into]))


def test_road_users_never_collide(crowded_drives):
    offenders = []
    for drive in [*crowded_drives, *(SimulatedDrive(seed, 10) for seed in range(3, 6))]:
        for t in (0.0, 0.45, 0.9):
            feet = [actor.footprint(drive.plan.road, t) for actor in drive.moving]
            for k, foot in enumerate(feet):
                if collides(foot, feet[:k] + feet[k + 1 :]) or collides(foot, drive.static_footprints):
                    offenders.append((drive, t, foot))
    assert offenders == []


def test_cars_are_on_the_asphalt_and_scenery_is_off_it(junction_drive):
    road = junction_drive.plan.road
    for actor in junction_drive.moving + junction_drive.parked:
        if actor.kind == Kind.CAR:
            assert outside_asphalt(road, *actor.trajectory.at(0.0)) < 0
    end_of_world = junction_drive.plan.end - 25
    for f in junction_drive.static_footprints:
        if f[6] in (Kind.BUILDING, Kind.FENCE, Kind.PLANT, Kind.SIGN, Kind.POLE) and f[0] < end_of_world:
            points = outline(Footprint(*f)) if f[6] == Kind.BUILDING else f[None, :2]
            assert min(outside_asphalt(road, *to_road(road, x, y)) for x, y in points) > 0


def test_people_walk_at_1_4_metres_a_second(crowded_drives):
    speeds = [
        np.hypot(*actor.trajectory.velocity(drive.plan.road, 0.5))
        for drive in crowded_drives
        for actor in drive.moving
        if actor.kind == Kind.PEDESTRIAN and actor.trajectory.pace.mean > 0
    ]
    assert len(speeds) > 10
    assert np.mean(speeds) == pytest.approx(1.4, abs=0.15)


def test_the_velocity_of_objects_is_the_change_of_their_position(junction_drive):
    road = junction_drive.plan.road
    before, after = ({o["id"]: o for o in junction_drive.objects(t)} for t in (0.4, 0.5))
    pose = junction_drive.rig.T_grid_from_lidar @ np.linalg.inv(junction_drive.pose(0.45))
    moving = [a for a in junction_drive.moving if a.instance in before and before[a.instance]["moving"]]
    assert len(moving) >= 3
    for actor in moving:
        change = (actor.trajectory.pose(road, 0.5)[0] - actor.trajectory.pose(road, 0.4)[0]) / 0.1
        expected = (pose[:3, :3] @ change)[:2]
        assert before[actor.instance]["velocity"] == pytest.approx(expected, abs=0.15)
    assert all(o["velocity"] == [0, 0] for o in before.values() if not o["moving"])
    assert after


def test_velocities_are_those_of_the_objects(junction_drive):
    velocities = junction_drive.velocities(0.4)
    moving = [o for o in junction_drive.objects(0.4) if o["moving"]]
    assert len(moving) >= 3
    for thing in moving:
        assert velocities[thing["id"]] == pytest.approx(thing["velocity"], abs=1e-3)


def test_birdseye_gives_kind_and_number_of_every_object(junction_drive, last_frame):
    kinds, instances = junction_drive.birdseye(0.9)
    assert np.array_equal(kinds, last_frame.truth.kinds)
    assert set(kinds[instances > 0]) <= {Kind.CAR, Kind.BICYCLE, Kind.PEDESTRIAN}
    for thing in junction_drive.objects(0.9):
        row, col, _ = LABEL_GRID.cells(np.array([thing["centre"]]))
        assert instances[row[0], col[0]] == thing["id"]


def test_a_scan_is_a_frame_without_image_and_with_different_noise(junction_drive, last_frame):
    scan, again = junction_drive.scan(9), junction_drive.scan(9)
    assert scan.image is None
    assert np.array_equal(scan.points, again.points)
    assert np.array_equal(scan.T_world_from_lidar, last_frame.T_world_from_lidar)
    assert scan.time == last_frame.time
    ranges = [np.sort(np.linalg.norm(points[:, :3], axis=1)) for points in (scan.points, last_frame.points)]
    assert len(ranges[0]) == pytest.approx(len(ranges[1]), rel=0.02)
    assert np.quantile(ranges[0], 0.5) == pytest.approx(np.quantile(ranges[1], 0.5), abs=0.1)
    assert not np.array_equal(scan.points, last_frame.points)


def test_the_truth_agrees_with_rays_from_below(junction_drive, last_frame):
    instant = junction_drive.instant(0.9)
    solid = np.isin(instant.kind, (Kind.CAR, Kind.BUILDING))
    rows, cols = np.mgrid[0:710:7, 0:310:7]
    centers = LABEL_GRID.centers()[rows, cols].reshape(-1, 2)
    T = last_frame.T_world_from_lidar @ np.linalg.inv(junction_drive.rig.T_grid_from_lidar)
    world = transform_points(T, np.column_stack([centers, np.zeros(len(centers))]))
    kinds = last_frame.truth.kinds[rows, cols].ravel()
    truth = np.isin(kinds, (Kind.CAR, Kind.BUILDING))
    whole = merge([instant.static.shape, instant.moving.shape])
    scene = EmbreeScene()
    TriangleMesh(scene, whole.vertices, np.ascontiguousarray(whole.faces[solid]))
    start = np.column_stack([world[:, :2], np.full(len(world), -10.0)]).astype(np.float32)
    up = np.tile(np.float32([0, 0, 1]), (len(start), 1))
    height = scene.run(start, up, query="DISTANCE") - 10.0
    met = height < 2.5
    assert truth.sum() > 100
    assert (met == truth).mean() > 0.985


def test_labelled_pixels_project_near_cells_of_their_class(junction_drive, last_frame):
    rig, picture = junction_drive.rig, last_frame.picture
    v, u = np.nonzero(np.nan_to_num(picture.depth, nan=1e9) < 40)
    rays = np.stack([u, v, np.ones(len(u))], axis=-1) @ np.linalg.inv(rig.camera.K).T
    points = rays * picture.depth[v, u, None]
    grid = transform_points(np.linalg.inv(rig.camera.T_camera_from_grid), points.astype(float))
    rows, cols, inside = LABEL_GRID.cells(grid)
    low = inside & (grid[:, 2] < 2.2)
    to_class = class_of_kind(KITTI_14)
    pixel, truth = to_class[picture.kind[v, u]], to_class[last_frame.truth.kinds]
    agree = np.zeros(len(pixel), bool)
    for r, c in np.ndindex(3, 3):
        agree |= truth[(rows + r - 1).clip(0, 709), (cols + c - 1).clip(0, 309)] == pixel
    assert low.sum() > 20_000
    assert agree[low].mean() > 0.95
    for name in ("road", "sidewalk", "vegetation", "car", "building", "signage"):
        assert agree[low & (pixel == KITTI_14.index(name))].mean() > 0.92, name
    assert last_frame.truth.visible[rows, cols][low].mean() > 0.9


def test_the_camera_sees_no_ground_outside_its_view(junction_drive, last_frame):
    centers = LABEL_GRID.centers()
    ground = np.isin(last_frame.truth.kinds, (Kind.ROAD, Kind.LANE, Kind.SIDEWALK, Kind.GRASS))
    visible = last_frame.truth.visible & ground
    assert not visible[np.abs(centers[..., 1]) > 1.0 * centers[..., 0] + 2.0].any()
    assert not visible[centers[..., 0] < 2.0].any()
    assert 0.03 < visible.mean() < 0.6


def test_every_kind_has_its_class_in_both_label_sets():
    kitti, synthia = class_of_kind(KITTI_14), class_of_kind(SYNTHIA_10)
    pairs = {Kind.LANE: ("road", "lane"), Kind.POLE: ("signage", "pole"), Kind.SKY: ("sky", "void")}
    pairs |= {Kind.PEDESTRIAN: ("pedestrian", "void"), Kind.GRASS: ("vegetation", "vegetation")}
    for kind, (ours, theirs) in pairs.items():
        assert KITTI_14.names[kitti[kind]] == ours
        assert SYNTHIA_10.names[synthia[kind]] == theirs
    assert kitti[255] == synthia[255] == 255

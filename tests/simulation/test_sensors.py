"""Camera and LIDAR against geometry by hand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, project, rigid_transform, transform_points
from semgrid_edu.datasets.ground_truth.window import EgoVelocity, deskew_scan, sweep_times
from semgrid_edu.frame import LABEL_GRID
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.sensors.camera import take_picture
from semgrid_edu.workshop.simulation.sensors.lidar import labelled_scan
from semgrid_edu.workshop.simulation.sensors.raycast import Instant, RayMesh
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E_AHEAD, Lidar, Rig
from semgrid_edu.workshop.simulation.street.layout import Road, Side
from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.street.plan import Wishes
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import box, quads, rotation_matrix

SIDE = Side(5.0, 0.0, 2.0, 0.0, 3.0)
ROAD = Road(0.0, 0.0, 0.0, 3.5, 1, 1, SIDE, SIDE, 0.0, 0.0, False, False, 4.0, False, True)
POSE = rigid_transform(np.eye(3), np.array([0.0, 0.0, KITTI_LIDAR_HEIGHT]))
EXACT = Lidar(range_sigma=0.0, dropout=0.0)


def scene(*things) -> Instant:
    ground = quads([-50, -50, 0], [200, 0, 0], [0, 100, 0], (0.2,) * 3, Material.GROUND, Kind.ROAD)
    return Instant(RayMesh.of([ground, *things], range(1 + len(things))), None)


def at(thing):
    """A function of time that always returns the same thing."""
    return lambda _: thing


def wall(x: float):
    return box((x + 0.5, 0, 2), (1, 200, 20), (0.5,) * 3, Material.RETRO, Kind.BUILDING)


def test_the_hdl64e_has_64_rings_from_2_to_minus_24_9_degrees():
    rays = Rig().lidar.directions
    elevation = np.degrees(np.arcsin(rays[:, 2]))
    assert len(np.unique(elevation.round(3))) == 64
    assert (elevation.min(), elevation.max()) == pytest.approx((-24.9, 2.0), abs=1e-4)
    assert np.linalg.norm(rays, axis=1) == pytest.approx(1, abs=1e-6)


def test_ranges_to_ground_and_wall_are_exact_without_noise():
    points = labelled_scan(at(scene(wall(12.0))), at(POSE), EXACT, ROAD, np.random.default_rng(0))[0]
    points = points[np.abs(points[:, 1]) < 40]
    on_wall = points[:, 0] > 11.999
    assert points[on_wall, 0] == pytest.approx(12.0, abs=1e-3)
    assert points[~on_wall, 2] == pytest.approx(-KITTI_LIDAR_HEIGHT, abs=1e-3)
    assert on_wall.sum() > 1000
    assert (~on_wall).sum() > 1000


def test_range_noise_is_two_centimetres():
    noisy = replace(EXACT, range_sigma=0.02)
    points = labelled_scan(at(scene(wall(8.0))), at(POSE), noisy, ROAD, np.random.default_rng(0))[0]
    ranges = np.linalg.norm(points[:, :3], axis=1)
    ahead = points[:, 2] > -1.5
    exact = 8.0 * ranges[ahead] / points[ahead, 0]
    assert (ranges[ahead] - exact).std() == pytest.approx(0.02, rel=0.1)


def test_intensity_scatters_falls_with_range_and_reads_0_far_away_as_on_kittis_scanner():
    """There 6 % of the returns from 10 to 20 m read exactly 0, and 70 % from 40 to 80 m; a lane's scatter by 0.11."""
    intensity = {}
    for distance in (12.0, 60.0):
        plaster = box((distance + 0.5, 0, 2), (1, 200, 20), (0.5,) * 3, Material.PLASTER, Kind.BUILDING)
        lidar = Lidar(range_sigma=0.0)
        points = labelled_scan(at(scene(plaster)), at(POSE), lidar, ROAD, np.random.default_rng(0))[0]
        ahead = (np.abs(points[:, 0] - distance) < 0.5) & (np.abs(points[:, 1]) < 5)
        intensity[distance] = points[ahead, 3]
    near, far = intensity[12.0], intensity[60.0]
    assert near.min() >= 0
    assert near.max() < 1
    assert near.std() == pytest.approx(0.1, abs=0.02)
    assert (near == 0).mean() < 0.1
    assert (far == 0).mean() > 0.5


def test_dark_and_distant_surfaces_lose_more_returns():
    def share(material, x):
        thing = box((x + 0.5, 0, 2), (1, 200, 20), (0.5,) * 3, material, Kind.BUILDING)
        points = labelled_scan(at(scene(thing)), at(POSE), Lidar(range_sigma=0.0), ROAD, np.random.default_rng(0))[0]
        return (points[:, 0] > x - 0.1).sum()

    assert share(Material.PLASTER, 40.0) > 1.5 * share(Material.RUBBER, 40.0)
    assert share(Material.RUBBER, 15.0) > 2 * share(Material.RUBBER, 60.0)


def test_a_rotated_vehicle_measures_a_rotated_wall():
    turn = rigid_transform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), POSE[:3, 3])
    points = labelled_scan(at(scene(wall(12.0))), at(turn), EXACT, ROAD, np.random.default_rng(0))[0]
    assert points[points[:, 2] > -1.7, 1] == pytest.approx(-12.0, abs=1e-3)


def test_a_rolling_scan_measures_each_column_from_the_pose_at_its_time():
    def pose(t):
        return rigid_transform(rotation_matrix(0, 0, t), POSE[:3, 3] + [10.0 * t, 0, 0])

    turning = replace(EXACT, revolution=0.1)
    points = labelled_scan(at(scene(wall(12.0))), pose, turning, ROAD, np.random.default_rng(0))[0]
    assert np.abs(sweep_times(points)).max() > 0.02
    still = deskew_scan(points, EgoVelocity(10.0, 0.0, 1.0))
    ahead = points[:, 2] > -1.7
    assert still[ahead, 0] == pytest.approx(12.0, abs=1e-3)
    assert np.abs(points[ahead, 0] - 12.0).max() > 0.2


def test_a_rolling_scan_measures_a_moving_object_at_the_time_of_its_column():
    def world(t):
        return scene(box((20.5, -3 + 10 * t, 1), (1, 2, 2), (0.5,) * 3, Material.RETRO, Kind.CAR))

    points, kinds = labelled_scan(world, at(POSE), replace(EXACT, revolution=0.1), ROAD, np.random.default_rng(0))
    front = points[(kinds == Kind.CAR) & (points[:, 0] < 20.001), 1]
    middle = (front.min() + front.max()) / 2
    assert middle == pytest.approx(-3 + 10 * (0.1 / 360) * np.degrees(np.arctan2(3, 20)), abs=0.1)


def test_kittis_scanner_hits_as_many_cells_as_on_a_real_street():
    # Share of the 0.5 m cells in view of the camera that are hit in drive 0013, by distance: there are few cars.
    real, edges = [0.76, 0.46, 0.21, 0.066], (5, 15, 25, 40, 72)
    spec, rig = replace(LABEL_GRID, cell=0.5), Rig(lidar=HDL64E_AHEAD)
    place = spec.centers()
    distance, view = np.hypot(*place.T).T, np.arctan(rig.camera.size[1] / 2 / rig.camera.K[0, 0])
    seen, found = np.abs(np.arctan2(place[..., 1], place[..., 0])) < view, []
    for seed in range(4):
        drive = SimulatedDrive(seed, 10, Wishes(density=0.2, parking=(False, False)), rig)
        row, col, inside = spec.cells(drive.scan(5).points_grid)
        hit = np.zeros(spec.shape, bool)
        hit[row[inside], col[inside]] = True
        found.append([hit[seen & (distance >= a) & (distance < b)].mean() for a, b in pairwise(edges)])
    ratio = np.mean(found, axis=0) / real
    assert (ratio > 1 / 1.3).all()
    assert (ratio < 1.3).all()


def test_pixel_rays_project_back_to_their_pixels():
    rig = Rig()
    points = transform_points(rig.T_lidar_from_camera, np.zeros(3)) + 17.0 * rig.pixel_directions().astype(float)
    pixels, visible = project(transform_points(rig.camera.T_camera_from_lidar, points), rig.camera)
    v, u = np.mgrid[: rig.camera.size[0], : rig.camera.size[1]]
    assert pixels == pytest.approx(np.stack([u, v], axis=-1).reshape(-1, 2), abs=2e-3)
    assert visible.mean() > 0.98


def test_the_camera_is_1_65_m_above_the_ground():
    rig = Rig()
    eye = transform_points(np.linalg.inv(rig.camera.T_camera_from_grid), np.zeros(3))
    assert eye == pytest.approx([0.27, 0.06, 1.65], abs=0.02)


def test_depth_and_kind_of_a_known_box():
    rig = Rig()
    thing = box((20.5, 1.0, 1.0), (1, 2, 2), (0.5,) * 3, Material.MATTE, Kind.CAR)
    light = Light.random(np.random.default_rng(0))
    picture = take_picture(scene(thing), POSE, rig, ROAD, light, np.random.default_rng(0))
    corners = np.array([[20, 0, 0.0], [20, 2, 0.0], [20, 0, 2.0], [20, 2, 2.0]])
    pixels, _ = project(transform_points(rig.camera.T_camera_from_grid, corners), rig.camera)
    u, v = np.round(pixels.mean(axis=0)).astype(int)
    depth = transform_points(rig.camera.T_camera_from_grid, corners.mean(axis=0))[2]
    assert picture.kind[v, u] == Kind.CAR
    assert picture.instance[v, u] == 1
    assert picture.depth[v, u] == pytest.approx(depth, abs=0.02)
    rows, cols = np.nonzero(picture.instance == 1)
    assert cols.min() == pytest.approx(pixels[:, 0].min(), abs=1.5)
    assert rows.max() == pytest.approx(pixels[:, 1].max(), abs=1.5)
    assert np.isnan(picture.depth[picture.kind == Kind.SKY]).all()


def test_a_box_casts_a_shadow_away_from_the_sun():
    light = replace(
        Light.random(np.random.default_rng(0)), sun=(0.0, 0.6, 0.8), sun_colour=(1.5,) * 3, softness=0.01, clouds=0.0
    )
    tall = box((12.0, 0.0, 2.0), (2, 1, 4), (0.5,) * 3, Material.MATTE, Kind.POLE)
    picture = take_picture(scene(tall), POSE, Rig(), ROAD, light, np.random.default_rng(0))
    camera = Rig().camera
    spots = np.array([[12.0, -2.0, 0.0], [12.0, 2.5, 0.0]])
    pixels, _ = project(transform_points(camera.T_camera_from_grid, spots), camera)
    (u0, v0), (u1, v1) = np.round(pixels).astype(int)
    shaded, lit = (picture.image[v - 1 : v + 2, u - 2 : u + 3].mean() for u, v in ((u0, v0), (u1, v1)))
    assert shaded < 0.75 * lit

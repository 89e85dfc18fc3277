"""What camera and LIDAR read, against geometry done by hand."""

from dataclasses import replace

import numpy as np
import pytest

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT, project, rigid_transform, transform_points
from semgrid_edu.workshop.simulation.sensors.camera import take_picture
from semgrid_edu.workshop.simulation.sensors.lidar import scan
from semgrid_edu.workshop.simulation.sensors.raycast import Instant, RayMesh
from semgrid_edu.workshop.simulation.sensors.rig import Lidar, Rig
from semgrid_edu.workshop.simulation.street.layout import Road, Side
from semgrid_edu.workshop.simulation.street.light import Light
from semgrid_edu.workshop.simulation.things.materials import Kind, Material
from semgrid_edu.workshop.simulation.things.shapes import box, quads

SIDE = Side(5.0, 0.0, 2.0, 0.0, 3.0)
ROAD = Road(0.0, 0.0, 0.0, 3.5, 1, 1, SIDE, SIDE, 0.0, 0.0, False, False, 4.0, False, True)
POSE = rigid_transform(np.eye(3), np.array([0.0, 0.0, KITTI_LIDAR_HEIGHT]))
EXACT = Lidar(range_sigma=0.0, drop=0.0)


def scene(*things) -> Instant:
    ground = quads([-50, -50, 0], [200, 0, 0], [0, 100, 0], (0.2,) * 3, Material.GROUND, Kind.ROAD)
    return Instant(RayMesh.of([ground, *things], range(1 + len(things))), None)


def wall(x: float):
    return box((x + 0.5, 0, 2), (1, 200, 20), (0.5,) * 3, Material.RETRO, Kind.BUILDING)


def test_the_hdl64e_has_64_rings_from_2_to_minus_24_9_degrees():
    rays = Rig().lidar.directions
    elevation = np.degrees(np.arcsin(rays[:, 2]))
    assert len(np.unique(elevation.round(3))) == 64
    assert (elevation.min(), elevation.max()) == pytest.approx((-24.9, 2.0), abs=1e-4)
    assert np.linalg.norm(rays, axis=1) == pytest.approx(1, abs=1e-6)


def test_ranges_to_ground_and_wall_are_exact_without_noise():
    points = scan(scene(wall(12.0)), POSE, EXACT, ROAD, np.random.default_rng(0))
    points = points[np.abs(points[:, 1]) < 40]
    on_wall = points[:, 0] > 11.999
    assert points[on_wall, 0] == pytest.approx(12.0, abs=1e-3)
    assert points[~on_wall, 2] == pytest.approx(-KITTI_LIDAR_HEIGHT, abs=1e-3)
    assert on_wall.sum() > 1000
    assert (~on_wall).sum() > 1000


def test_range_noise_is_two_centimetres():
    noisy = replace(EXACT, range_sigma=0.02)
    points = scan(scene(wall(8.0)), POSE, noisy, ROAD, np.random.default_rng(0))
    ranges = np.linalg.norm(points[:, :3], axis=1)
    ahead = points[:, 2] > -1.5
    exact = 8.0 * ranges[ahead] / points[ahead, 0]
    assert (ranges[ahead] - exact).std() == pytest.approx(0.02, rel=0.1)


def test_dark_and_distant_surfaces_lose_more_returns():
    def share(material, x):
        thing = box((x + 0.5, 0, 2), (1, 200, 20), (0.5,) * 3, material, Kind.BUILDING)
        points = scan(scene(thing), POSE, Lidar(range_sigma=0.0), ROAD, np.random.default_rng(0))
        return (points[:, 0] > x - 0.1).sum()

    assert share(Material.PLASTER, 40.0) > 1.5 * share(Material.RUBBER, 40.0)
    assert share(Material.RUBBER, 15.0) > 2 * share(Material.RUBBER, 60.0)


def test_a_turned_vehicle_sees_the_wall_turned():
    turn = rigid_transform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), POSE[:3, 3])
    points = scan(scene(wall(12.0)), turn, EXACT, ROAD, np.random.default_rng(0))
    assert points[points[:, 2] > -1.7, 1] == pytest.approx(-12.0, abs=1e-3)


def test_pixel_rays_project_back_to_their_pixels():
    rig = Rig()
    points = transform_points(rig.T_lidar_from_camera, np.zeros(3)) + 17.0 * rig.pixel_directions().astype(float)
    pixels, visible = project(transform_points(rig.camera.T_camera_from_lidar, points), rig.camera)
    v, u = np.mgrid[: rig.image_size[0], : rig.image_size[1]]
    assert pixels == pytest.approx(np.stack([u, v], axis=-1).reshape(-1, 2), abs=2e-3)
    assert visible.mean() > 0.98


def test_the_camera_stands_1_65_m_above_the_ground():
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

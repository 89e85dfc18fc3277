"""Road coordinates and the ground."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_edu.camera import KITTI_LIDAR_HEIGHT
from semgrid_edu.workshop.simulation.street.ground import (
    KERB_HEIGHT,
    ground_height,
    ground_kind,
    ground_kinds,
    ground_mesh,
    lane_mark,
    on_wheels,
)
from semgrid_edu.workshop.simulation.street.layout import Road, Side, to_road, to_world
from semgrid_edu.workshop.simulation.street.trajectories import ActorPace, Ego, Trajectory
from semgrid_edu.workshop.simulation.things.materials import Kind

SIDE = Side(edge=4.0, strip=0.0, walk=2.0, bank_rise=0.8, bank_width=3.0)
STRAIGHT = Road(0.0, 0.0, 0.0, 3.5, 1, 1, SIDE, SIDE, 0.0, 0.0, False, False, 4.0, False, False)
JUNCTION = STRAIGHT._replace(junction=30.0, side_half=3.0, side_left=True)


@settings(deadline=None)
@given(
    s=st.floats(-40, 200), d=st.floats(-30, 30), radius=st.floats(60, 300), left=st.booleans(), turn=st.floats(0.1, 1.2)
)
def test_road_coordinates_and_back(s, d, radius, left, turn):
    road = STRAIGHT._replace(bend_start=20.0, bend_end=20.0 + turn * radius, curvature=(1 if left else -1) / radius)
    x, y, _ = to_world(road, s, d)
    assert to_road(road, x, y) == pytest.approx((s, d), abs=1e-7)


def test_a_quarter_circle_to_the_left_ends_heading_left():
    road = STRAIGHT._replace(bend_start=10.0, bend_end=10.0 + 50 * np.pi, curvature=0.01)
    assert to_world(road, 10.0 + 50 * np.pi, 0.0) == pytest.approx((110.0, 100.0, np.pi / 2))


def test_cross_section_of_a_straight_road():
    kinds = [ground_kind(STRAIGHT, 5.0, d) for d in (0.0, 3.9, -3.9, 4.1, 5.9, 6.1, -5.0, 12.0)]
    road, walk, grass = Kind.ROAD, Kind.SIDEWALK, Kind.GRASS
    assert kinds == [road, road, road, walk, walk, grass, walk, grass]
    heights = [ground_height(STRAIGHT, 5.0, d) for d in (0.0, 4.1, -4.1, 9.3)]
    assert heights == pytest.approx([0.0, KERB_HEIGHT, KERB_HEIGHT, KERB_HEIGHT + 0.8], abs=1e-9)


HILL = STRAIGHT._replace(crown=0.02, grade_before=0.06, grade_after=-0.04, crest_start=20.0, crest_end=60.0)


def test_a_crest_joins_two_grades_without_a_step_or_a_kink():
    s = np.arange(-10.0, 100.0, 0.25)
    height = np.array([ground_height(HILL, x, 0.0) for x in s])
    slope = np.diff(height) / 0.25
    assert height[40] == 0.0
    assert slope[s[1:] < 20] == pytest.approx(0.06)
    assert slope[s[:-1] > 60] == pytest.approx(-0.04)
    assert np.diff(slope) == pytest.approx(np.where((s[1:-1] > 20) & (s[1:-1] < 60), -0.1 / 40 * 0.25, 0), abs=4e-4)
    assert height[s == 60] == pytest.approx(0.06 * 60 - 0.1 * 20)


def test_the_road_falls_from_the_crown_to_the_kerbs():
    heights = [ground_height(HILL, 0.0, d) for d in (0.0, 2.0, -2.0, 4.0, -4.0, 4.5)]
    assert heights == pytest.approx([0, -0.04, -0.04, -0.08, -0.08, KERB_HEIGHT - 0.08])


def test_a_vehicle_rests_on_its_wheels():
    even = on_wheels(STRAIGHT, 5.0, -1.5, 0.0, 2.7, 1.5)
    assert even == (0.0, 0.0, 0.0)
    height, roll, pitch = on_wheels(HILL, 5.0, -1.5, 0.0, 2.7, 1.5)
    assert (height, roll, pitch) == pytest.approx((0.3 - 0.03, np.arctan(0.02), -np.arctan(0.06)))
    _, roll, pitch = on_wheels(HILL, 5.0, 1.5, np.pi, 2.7, 1.5)
    assert (roll, pitch) == pytest.approx((np.arctan(0.02), np.arctan(0.06)))


def test_the_recording_car_tilts_with_the_road():
    ego = Ego(HILL, Trajectory(0.0, 0.0, 1.0, 0.0, ActorPace(10.0)), sway=0.0, roll=0.0, pitch=0.0, phase=0.0)
    T = ego.T_world_from_lidar(1.0)
    assert T[:3, 0] @ [0, 0, 1] == pytest.approx(np.sin(np.arctan(0.06)))
    on_ground = T @ [0, 0, -KITTI_LIDAR_HEIGHT, 1]
    assert on_ground[:3] == pytest.approx([10.0, 0.0, 0.6 - 0.02 * 1.55 / 2], abs=1e-6)


def test_the_side_road_opens_one_side_and_rounds_its_corners():
    assert ground_kind(JUNCTION, 30.0, 10.0) == Kind.ROAD
    assert ground_kind(JUNCTION, 30.0, -10.0) == Kind.GRASS
    inner_corner = 4.0 + 4.0 * (1 - 0.5**0.5)
    assert ground_kind(JUNCTION, 33.0 + inner_corner - 4.0 - 0.05, inner_corner - 0.05) == Kind.ROAD
    assert ground_kind(JUNCTION, 33.0 + inner_corner - 4.0 + 0.05, inner_corner + 0.05) == Kind.SIDEWALK


def test_a_solid_centre_line_is_fourteen_centimetres_wide():
    d = np.linspace(-0.5, 0.5, 2001)
    painted = [lane_mark(STRAIGHT, 5.0, x, 0.0) > 0.5 for x in d]
    assert np.sum(painted) * 0.0005 == pytest.approx(0.14, abs=0.003)
    assert ground_kinds(STRAIGHT, np.array([[5.0, 0.0], [5.0, 1.0]])).tolist() == [Kind.LANE, Kind.ROAD]


def test_blurring_a_line_conserves_its_paint():
    d = np.linspace(-0.5, 0.5, 2001)
    total = [sum(lane_mark(STRAIGHT, 5.0, x, blur) for x in d) * 0.0005 for blur in (0.01, 0.1)]
    assert total[0] == pytest.approx(total[1], rel=0.02)


def test_the_mesh_follows_the_ground():
    mesh = ground_mesh(JUNCTION, 0.0, 60.0)
    corners = mesh.vertices[mesh.faces]
    flat = np.abs(mesh.normals[:, 2]) > 0.99
    middles = corners[flat].mean(axis=1)
    near = np.abs(middles[:, 1]) < 12
    heights = [ground_height(JUNCTION, *to_road(JUNCTION, x, y)) for x, y in middles[near, :2]]
    assert np.abs(middles[near, 2] - heights).max() < 0.1
    assert (mesh.normals[:, 2] > 0).all()

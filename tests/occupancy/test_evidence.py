"""Evidence from a scan: by hand on a ray of five cells, and the fast twin against the literal one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import minimum_filter

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion, SensorModel, scan_evidence, scan_evidence_literal
from semgrid_edu.occupancy.evidence import walk_ray
from semgrid_edu.occupancy.polar import fill_gaps
from semgrid_edu.simulation.boxes import Box, scan_boxes

RAY = GridSpec(x_min=0, x_max=5, y_min=-0.5, y_max=0.5, cell=1)
SENSOR = SensorModel()
TWINS = pytest.mark.parametrize("evidence_of", [scan_evidence, scan_evidence_literal])


@TWINS
def test_five_cells_on_a_ray_by_hand(evidence_of):
    """Two obstacle returns at 3.5 m, one of the ground at 1.5 m: free, free, free, occupied, unseen."""
    points = np.array([[1.5, 0, 0.0], [3.5, 0, 1.0], [3.5, 0, 1.2]])
    evidence = evidence_of(points, RAY, SENSOR)
    farthest_first = [(1, 1), (0.8**2, 0.05**2), (0.3, 0.7), (0.3, 0.7), (0.3, 0.7)]
    assert np.allclose(evidence.occupied[:, 0], [occupied for occupied, _ in farthest_first])
    assert np.allclose(evidence.free[:, 0], [free for _, free in farthest_first])


@TWINS
def test_ground_alone_is_free_up_to_its_farthest_return(evidence_of):
    evidence = evidence_of(np.array([[2.5, 0, 0.1]]), RAY, SENSOR)
    assert (evidence.free[:, 0] > evidence.occupied[:, 0]).tolist() == [False, False, True, True, True]


@TWINS
def test_what_is_above_a_car_says_nothing(evidence_of):
    evidence = evidence_of(np.array([[3.5, 0, 3.0]]), RAY, SENSOR)
    assert (evidence.occupied == 1).all()
    assert (evidence.free == 1).all()


@TWINS
def test_an_empty_scan_says_nothing(evidence_of):
    evidence = evidence_of(np.empty((0, 4), np.float32), RAY, SENSOR)
    assert (evidence.occupied == 1).all()
    assert (evidence.free == 1).all()


@settings(max_examples=8, deadline=None)
@given(
    st.lists(st.tuples(st.floats(4, 30), st.floats(-9, 7), st.floats(0.3, 4), st.floats(0.3, 4)), max_size=6),
    st.floats(-0.5, 0.5),
    st.floats(-0.5, 0.5),
    st.floats(-0.05, 0.05),
)
def test_the_twins_differ_in_thin_lines_only(corners, dx, dy, dyaw):
    """Obstacles are counted alike; where one ends what is free half a cell before the other, no 3 x 3 cells differ."""
    spec, pose = GridSpec(0, 30, -10, 10, 0.5), PlanarMotion(dx, dy, dyaw)
    points = scan_boxes([Box(x, x + long, y, y + wide, 1.6) for x, y, long, wide in corners], columns=360, rings=24)
    fast, literal = (f(points, spec, SENSOR, pose) for f in (scan_evidence, scan_evidence_literal))
    assert np.array_equal(fast.occupied > fast.free, literal.occupied > literal.free)
    differ = (fast.free > fast.occupied) != (literal.free > literal.occupied)
    assert not minimum_filter(differ, 3).any()
    assert differ.mean() < 0.05


@given(st.floats(-40, 40), st.floats(-40, 40), st.floats(-3.1, 3.1), st.floats(0.1, 80))
def test_a_ray_walks_through_neighbouring_cells(x, y, azimuth, length):
    spec = GridSpec(-20, 20, -20, 20, 1)
    rows, cols, leaves_at = walk_ray(spec, (x, y), azimuth, length)
    steps = np.abs(np.diff(rows)) + np.abs(np.diff(cols))
    assert (steps >= 1).all()
    assert (steps <= 2).all()  # 2: the ray runs through a corner
    assert (np.diff(leaves_at) > 0).all()
    assert (leaves_at[:-1] < length).all()


def test_columns_wider_apart_than_beams_leave_no_holes():
    """The simulated scanner's columns are 0.9 degrees apart, beams a third of that."""
    azimuth = np.radians(np.arange(-45, 45, 0.9))
    ground = np.stack([30 * np.cos(azimuth), 30 * np.sin(azimuth), 0 * azimuth], axis=1)
    spec = GridSpec(0, 20, -5, 5, 0.5)
    x, y = np.moveaxis(spec.centers(), -1, 0)
    evidence = scan_evidence(ground, spec, SENSOR)
    ahead = np.abs(np.arctan2(y, x)) < np.radians(44)
    assert (evidence.free > evidence.occupied)[ahead].all()
    assert (evidence.free == evidence.occupied)[~ahead & (np.abs(np.arctan2(y, x)) > np.radians(46))].all()


@TWINS
def test_the_vehicles_own_bonnet_is_no_obstacle(evidence_of):
    """KITTI's LIDAR sees its own bonnet; the same return beside the vehicle is an obstacle."""
    spec = GridSpec(0, 4, -2, 2, 0.5)
    ground = np.array([[3.75, 0.25, 0.0], [3.75, 1.75, 0.0]])
    bonnet, beside = np.array([[2.5, 0.2, 0.8]]), np.array([[2.5, 1.2, 0.8]])
    for returns, obstacles in ((bonnet, 0), (beside, 1)):
        evidence = evidence_of(np.concatenate([ground, returns]), spec, SENSOR)
        assert (evidence.occupied > evidence.free).sum() == obstacles
    with_bonnet = evidence_of(np.concatenate([ground, bonnet]), spec, SENSOR)
    np.testing.assert_array_equal(with_bonnet.free, evidence_of(ground, spec, SENSOR).free)


def test_wide_gaps_stay_blind_and_narrow_ones_see_no_farther_than_their_neighbours():
    reach = np.array([0.0, 7.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0])
    assert fill_gaps(reach, 2).tolist() == [7.0, 7.0, 4.0, 4.0, 4.0, 0.0, 0.0, 0.0, 9.0]


@TWINS
@pytest.mark.parametrize("points", [np.array([[1.0, np.nan, 0.0]]), np.array([[1.0, 0, np.inf]]), np.zeros((3, 2)), 5])
def test_what_is_no_scan_is_refused_by_name(evidence_of, points):
    with pytest.raises(ArgumentError, match="points"):
        evidence_of(points, RAY, SENSOR)


@pytest.mark.parametrize(
    "bad",
    [{"azimuth_step": 0}, {"p_hit_free": 0}, {"p_pass_free": 1}, {"obstacle_min": 3}, {"vehicle": (3, -2, -1, 1)}],
)
def test_an_impossible_sensor_is_refused_by_name(bad):
    with pytest.raises(ArgumentError, match=next(iter(bad))):
        SensorModel(**bad)

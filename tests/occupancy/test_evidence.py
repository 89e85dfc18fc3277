"""Evidence from a scan: by hand on a ray of five cells, and against a walk along every ray."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from worlds.lecture_02_boxes import Box, scan_boxes
from worlds.lecture_02_rays import evidence_by_rays

from semgrid_edu import fast
from semgrid_edu.camera import KITTI_LIDAR_HEIGHT
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import Evidence, Scan, SensorModel, scan_evidence
from semgrid_edu.occupancy.polar import fill_gaps
from semgrid_edu.workshop.simulation.sensors.rig import HDL64E_ELEVATIONS

RAY = GridSpec(x_min=0, x_max=5, y_min=-0.5, y_max=0.5, cell=1)
SENSOR = SensorModel()
TWINS = pytest.mark.parametrize("evidence_of", [scan_evidence, fast.scan_evidence], ids=["book", "fast"])


@TWINS
def test_five_cells_on_a_ray_by_hand(evidence_of):
    """Two obstacle returns at 3.5 m, one of the ground at 1.5 m: free, free, free, occupied, unseen."""
    points = np.array([[1.5, 0, 0.0], [3.5, 0, 1.0], [3.5, 0, 1.2]])
    evidence = evidence_of(points, RAY, SENSOR)
    farthest_first = [(1, 1), (0.8**2, 0.05**2), (0.3, 0.7), (0.3, 0.7), (0.3, 0.7)]
    assert np.allclose(evidence.occupied[:, 0], [occupied for occupied, _ in farthest_first])
    assert np.allclose(evidence.free[:, 0], [free for _, free in farthest_first])


def says(evidence):
    """Return what the evidence says of each cell of the ray, nearest first: free, occupied or nothing."""
    ratio = np.sign(evidence.occupied - evidence.free)[::-1, 0]
    return "".join({-1: "f", 1: "o", 0: "."}[int(r)] for r in ratio)


LONG_RAY = GridSpec(x_min=0, x_max=12, y_min=-0.5, y_max=0.5, cell=1)


@TWINS
@pytest.mark.parametrize(
    ("returns", "expected"),
    [
        # occlusion: a low thing hides what is behind it, though rings that look over it may hit something there
        ([(3.5, 0.4), (9.5, 0.0)], "fffo.....f.."),
        ([(3.5, 0.4), (6.5, 1.5)], "fffo..o....."),
        # what a ring hits just behind the first obstacle may lie under it; from a car's length on it can't
        ([(3.5, 0.6), (5.5, 0.0), (7.5, 0.0), (9.5, 0.0)], "fffo.....f.."),
        # a crown or a bridge hides nothing below it, and says nothing itself
        ([(3.5, 3.0), (6.5, 0.0)], "fffffff....."),
        # a wall seen through the gap under something that hangs
        ([(3.5, 3.0), (6.5, 1.0)], "ffffffo....."),
        # one return of a pole in front of a wall stops the beam
        ([(4.5, 1.0), (8.5, 1.0), (8.5, 1.4)], "ffffo...o..."),
        # two rings that hit the ground: nothing stands between them
        ([(4.5, 0.0), (7.5, 0.0)], "ffffffff...."),
        # a kerb is ground, an obstacle beside a ground return overrules it
        ([(4.5, 0.1), (7.5, 0.05), (7.6, 1.0)], "fffffffo...."),
    ],
)
def test_what_a_beam_with_several_rings_says_of_its_cells(evidence_of, returns, expected):
    ahead, heights = np.array(returns).T
    points = np.stack([ahead, np.zeros_like(ahead), heights], axis=1)
    assert says(evidence_of(points, LONG_RAY, replace(SENSOR, ground=None))) == expected


@TWINS
def test_one_return_of_a_pole_is_an_obstacle_and_shades_no_more_than_its_beam(evidence_of):
    azimuth = np.radians(np.arange(-30, 30, 0.2))
    wall = np.stack([20 * np.cos(azimuth), 20 * np.sin(azimuth), 0 * azimuth + 1], axis=1)
    spec = GridSpec(0, 20, -4, 4, 0.2)
    pole = np.array([[8.0, 0.01, 1.0]])
    alone, with_pole = (evidence_of(scan, spec, SENSOR) for scan in (wall, np.concatenate([wall, pole])))
    shadow = (alone.free > alone.occupied) & ~(with_pole.free > with_pole.occupied)
    x, y = np.moveaxis(spec.centers()[shadow], -1, 0)
    assert (with_pole.occupied > with_pole.free)[60, 19]
    assert (x > 7.8).all()
    assert (np.abs(y) < 0.2 + np.radians(SENSOR.azimuth_step) * x).all()


def test_no_obstacle_hides_between_the_rings_of_kittis_scanner_within_50_m():
    """The ray to the farther of two rings on the ground is so high above the nearer one, where the gap begins."""
    rings = np.radians(HDL64E_ELEVATIONS)
    on_ground = -KITTI_LIDAR_HEIGHT / np.tan(rings[rings < 0])
    nearer, farther = on_ground[1:], on_ground[:-1]
    hidden = KITTI_LIDAR_HEIGHT * (farther - nearer) / farther
    assert (hidden[farther < 50] < SENSOR.obstacle_min).all()
    assert (hidden[farther > 70] > SENSOR.obstacle_min).all()


@TWINS
def test_an_empty_scan_says_nothing(evidence_of):
    evidence = evidence_of(np.empty((0, 4), np.float32), RAY, SENSOR)
    assert (evidence.occupied == 1).all()
    assert (evidence.free == 1).all()


def crossed(scan: Scan, spec: GridSpec, cell: tuple[int, int]) -> bool:
    """Say whether the sight of a beam ends inside the circle around a cell, or between two beams that cross it.

    Sight ends at a beam's reach, and what may come from under an obstacle ends `under` behind it.
    """
    x, y = spec.centers()[cell]
    distance, radius, width = np.hypot(x, y), spec.cell / np.sqrt(2), 2 * np.pi / len(scan.reach)
    azimuth = (np.arange(len(scan.reach)) + 0.5) * width - np.pi - np.arctan2(y, x)
    beside = np.abs(np.angle(np.exp(1j * azimuth))) <= np.arcsin(min(1, radius / distance)) + width
    ends = scan.reach[beside] + np.array([[0], [scan.sensor.under]])
    return bool(((ends.min(axis=1) < distance + radius) & (ends.max(axis=1) >= distance - radius)).any())


@settings(max_examples=4, deadline=None)
@example([(13.0, -2.75, 4.0, 1.25), (17.0, -1.25, 1.0, 0.5)])  # differs in 3 x 3 cells
@given(
    st.lists(st.tuples(st.floats(4, 30), st.floats(-9, 7), st.floats(0.3, 4), st.floats(0.3, 4)), max_size=6),
)
def test_a_walk_along_every_ray_differs_only_along_the_border_of_what_is_seen(corners):
    """Obstacles are counted alike. What is free differs only in cells that the border of what is seen runs through.

    There the walk asks whether any beam passes the whole cell, and the package whether the beam of its centre does. How
    many such cells there are depends on the length of the border, so on the boxes: up to 7 % in the worst scene found.
    """
    spec = GridSpec(0, 30, -10, 10, 0.5)
    points = scan_boxes([Box(x, x + long, y, y + wide, 1.6) for x, y, long, wide in corners], columns=360, rings=24)
    asked, walked = (f(points, spec, SENSOR) for f in (scan_evidence, evidence_by_rays))
    assert np.array_equal(asked.occupied > asked.free, walked.occupied > walked.free)
    differ = (asked.free > asked.occupied) != (walked.free > walked.occupied)
    scan = SENSOR.scan(points)
    assert all(crossed(scan, spec, (row, col)) for row, col in np.argwhere(differ))


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


@TWINS
@pytest.mark.parametrize(
    ("y", "reflectance", "obstacles"),
    [(1.35, 0.0, 0), (1.35, 0.01, 1), (2.1, 0.0, 1), (1.35, None, 1)],
    ids=["split beam", "something beside the vehicle", "beyond a pulse", "no reflectance known"],
)
def test_a_beam_that_the_vehicles_edge_splits_is_no_obstacle(evidence_of, y, reflectance, obstacles):
    """It merges two echoes closer than half a pulse, 0.75 m, and brings no light back."""
    returns = np.array([[3.75, 0.25, 0.0, 0.3], [1.4, y, 1.0, reflectance or 0]])[:, : 3 if reflectance is None else 4]
    evidence = evidence_of(returns, GridSpec(0, 4, -3, 3, 0.5), SENSOR)
    assert (evidence.occupied > evidence.free).sum() == obstacles


@TWINS
@pytest.mark.parametrize(("reflectance", "obstacles"), [(0.0, 1), (0.3, 1)], ids=["not measured", "measured"])
def test_who_stands_before_the_bumper_is_seen_without_reflectance(evidence_of, reflectance, obstacles):
    """A scanner that writes 0 for all returns: none of them is taken for a split beam."""
    ground = [[3.75, y, 0.0, reflectance] for y in (-1, 0, 1)]
    person = [[3.2, 0.2, 1.0 + 0.1 * k, reflectance] for k in range(9)]
    evidence = evidence_of(np.array([*ground, *person]), GridSpec(0, 4, -2, 2, 0.5), SENSOR)
    assert (evidence.occupied > evidence.free).sum() == obstacles


@TWINS
@pytest.mark.parametrize(("own", "x", "obstacles"), [(1, 3.2, 0), (0, 1.4, 1)], ids=["far ahead", "where a bonnet is"])
def test_who_knows_the_vehicles_own_returns_needs_no_outline(evidence_of, own, x, obstacles):
    returns = np.array([[3.75, 0.25, 0.0, 0.3, 0], [x, 0.2, 1.0, 0.0, own]])
    evidence = evidence_of(returns, GridSpec(0, 4, -3, 3, 0.5), SENSOR)
    assert (evidence.occupied > evidence.free).sum() == obstacles


def test_wide_gaps_stay_blind_and_narrow_ones_see_no_farther_than_their_neighbours():
    reach = np.array([0.0, 7.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 9.0])
    assert fill_gaps(reach, 2).tolist() == [7.0, 7.0, 4.0, 4.0, 4.0, 0.0, 0.0, 0.0, 9.0]


@TWINS
@pytest.mark.parametrize(
    "points",
    [
        np.array([[1.0, np.nan, 0.0]]),
        np.array([[1.0, 0, np.inf]]),
        np.zeros((3, 2)),
        5,
        np.ones((2, 3), complex),
        np.array([["4", "0", "1"]]),
    ],
)
def test_what_is_no_scan_is_refused_by_name(evidence_of, points):
    with pytest.raises(ArgumentError, match="points"):
        evidence_of(points, RAY, SENSOR)


@pytest.mark.parametrize(
    "bad",
    [
        {"azimuth_step": 0},
        {"p_hit_free": 0},
        {"p_pass_free": 1},
        {"obstacle_min": 3},
        {"vehicle": (3, -2, -1, 1)},
        {"vehicle": (0, 1, 2)},
        {"edge": -0.1},
        {"under": -1.0},
        {"column_spacing": np.nan},
        {"column_spacing": -0.1},
        {"max_returns": 0},
        {"max_returns": 1.5},
    ],
)
def test_an_impossible_sensor_is_refused_by_name(bad):
    with pytest.raises(ArgumentError, match=next(iter(bad))):
        SensorModel(**bad)


@pytest.mark.parametrize(
    ("occupied", "free", "name"),
    [
        (np.ones((2, 3)), np.ones((3, 2)), "free"),
        (np.full((2, 3), -0.1), np.ones((2, 3)), "occupied"),
        (np.ones((2, 3)), np.full((2, 3), np.nan), "free"),
    ],
)
def test_what_is_no_likelihood_is_refused_by_name(occupied, free, name):
    with pytest.raises(ArgumentError, match=f"^{name}: expected"):
        Evidence(occupied, free)

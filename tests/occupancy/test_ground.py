"""The local ground: known slopes, walls and holes; flat scenes as before."""

from dataclasses import replace

import numpy as np
import pytest
from worlds.lecture_02_boxes import Box, scan_boxes

from semgrid_edu import fast
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion, SensorModel, scan_evidence
from semgrid_edu.occupancy.polar import GroundParams, height_above_ground, walk_sector
from semgrid_edu.occupancy.sensor import prepare_scan

PARAMS = GroundParams()
MIDDLES = (np.arange(PARAMS.bins) + 0.5) * PARAMS.bin_length
SCENE = [Box.around(12, 2, 4, 1.8, 1.5), Box.around(20, -4, 1, 8, 2.4), Box.around(7, -3, 0.5, 0.5, 1.8)]


def on(surface, points):
    """Lift a scan of flat ground onto a surface z(x, y)."""
    lifted = points.copy()
    lifted[:, 2] += surface(points[:, 0], points[:, 1])
    return lifted


SURFACES = {
    "pitch and roll": lambda x, y: 0.02 * x + 0.01 * y,
    "a road that steepens": lambda x, y: x**2 / 2 / 700,
    "a hilltop": lambda x, y: -(x**2) / 2 / 1500,
    "a verge beside the road": lambda x, y: np.clip((np.abs(y) - 2) * 0.3, 0, 0.6),
    "a kerb": lambda x, y: np.where(np.abs(y) > 3, 0.12, 0.0),
}


@pytest.mark.parametrize("name", SURFACES)
def test_heights_are_those_above_the_surface(name):
    """What is lifted with its ground keeps its height; obstacles and ground are told apart as on flat ground."""
    flat = scan_boxes(SCENE, columns=900)
    flat = flat[np.hypot(flat[:, 0], flat[:, 1]) < 40]
    height = height_above_ground(on(SURFACES[name], flat), PARAMS)
    ground, obstacle = flat[:, 2] < 0.01, flat[:, 2] > 0.5
    assert (np.abs(height[ground]) < 0.3).mean() > 0.995
    assert np.median(np.abs(height[ground])) < 0.05
    assert (height[obstacle] > 0.3).mean() > 0.99


@pytest.mark.parametrize("boxes", [[], SCENE])
def test_on_flat_ground_the_evidence_is_that_of_the_flat_rule(boxes):
    points, spec, sensor = scan_boxes(boxes, columns=600), GridSpec.compact(), SensorModel()
    pose = PlanarMotion(0.3, -0.2, 0.02)
    local, flat = (scan_evidence(points, spec, s, pose) for s in (sensor, replace(sensor, ground=None)))
    np.testing.assert_array_equal(local.occupied, flat.occupied)
    np.testing.assert_array_equal(local.free, flat.free)


def test_a_sector_by_hand():
    """Ground at 5 and 10 m; a bumper at 12 m; behind the car, ground again at 20 m; a hole at 25 m; a roof's edge."""
    distance = np.array([5.0, 10.0, 12.1, 12.2, 20.0, 25.0, 30.0])
    z = np.array([0.0, 0.1, 0.3, 0.9, 0.2, -1.0, 2.0])
    ground = walk_sector(distance, z, PARAMS)
    expected = np.interp(MIDDLES, [0, 5, 10, 20], [0, 0, 0.1, 0.2])
    np.testing.assert_allclose(ground, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("farther", "rise", "is_ground"),
    [
        (0.5, 0.25, True),  # step + slope d = 0.27
        (0.5, 0.28, False),
        (4.0, 0.49, True),  # rise + grade d = 0.5
        (4.0, 0.51, False),
        (4.0, -0.49, True),
        (4.0, -0.51, False),
        (30.0, 0.79, True),  # as for gap = 10 m: 0.8
        (30.0, 0.81, False),
    ],
)
def test_what_ground_may_do_from_one_return_to_the_next(farther, rise, is_ground):
    ground = walk_sector(np.array([6.0, 6.0 + farther]), np.array([0.0, rise]), PARAMS)
    assert ground[-1] == (rise if is_ground else 0.0)


def test_points_below_the_ground_do_not_pull_it_down():
    """Mirrored returns, as puddles and glass make them: one in two hundred, up to 3 m too low."""
    points, rng = scan_boxes(SCENE, columns=900), np.random.default_rng(0)
    mirrored = rng.random(len(points)) < 0.005
    points[mirrored, 2] -= rng.uniform(0.5, 3, mirrored.sum()).astype(np.float32)
    height = height_above_ground(points, PARAMS)
    true_ground = ~mirrored & (points[:, 2] < 0.01)
    assert (np.abs(height[true_ground]) < 0.05).mean() > 0.999


def test_walls_cars_and_hedges_do_not_become_ground():
    """A street between parked cars and hedges: hardly an obstacle return comes out lower than 0.3 m."""
    cars = [Box.around(x, side * 4, 4.2, 1.8, 1.5) for x in range(6, 60, 6) for side in (-1, 1)]
    walls = [Box.around(30, side * 8, 60, 1.0, 1.2) for side in (-1, 1)]
    points = scan_boxes(cars + walls, columns=900)
    height = height_above_ground(points, PARAMS)
    assert (height[points[:, 2] > 0.5] > 0.3).mean() > 0.999


def test_a_scan_without_ground_is_judged_by_flat_ground():
    wall = np.array([[15.0, y, z] for y in np.arange(-5, 5, 0.1) for z in (1.0, 1.2, 1.4)])
    np.testing.assert_allclose(height_above_ground(wall, PARAMS), wall[:, 2])


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 3)),
        np.array([[10.0, 0.0, 1.0]]),
        np.zeros((50, 3)),
        np.tile([[8.0, 3.0, 0.0]], (50, 1)),
        np.array([[10.0, 0.0, -40.0]]),
        np.array([[1e30, -1e30, 1e30], [-1e300, 0.0, 0.0]]),
        np.array([[5, 0, 0], [6, 1, 0]]),
    ],
)
def test_odd_scans_give_finite_heights(points):
    prepared = prepare_scan(points, SensorModel())
    assert prepared.shape == (len(points), 3)
    assert np.isfinite(prepared).all()
    np.testing.assert_allclose(prepared[:, 2], fast.height_above_ground(points, PARAMS))


def test_neither_order_nor_type_nor_further_columns_matter():
    rng = np.random.default_rng(0)
    points = on(SURFACES["a verge beside the road"], scan_boxes(SCENE, columns=300, noise=0.02, rng=rng))
    height = height_above_ground(points, PARAMS)
    order = rng.permutation(len(points))
    np.testing.assert_array_equal(height_above_ground(points[order], PARAMS), height[order])
    wide = np.column_stack([points, np.ones(len(points))]).astype(np.float64)
    np.testing.assert_allclose(height_above_ground(wide, PARAMS), height, atol=1e-5)


@pytest.mark.parametrize("points", [np.array([[1.0, np.nan, 0.0]]), np.array([[np.inf, 0, 0]]), np.zeros((3, 2))])
def test_compiled_loops_refuse_what_is_no_scan(points):
    with pytest.raises(ArgumentError, match=r"^points: expected"):
        fast.height_above_ground(points, PARAMS)


@pytest.mark.parametrize(
    "bad",
    [{"sectors": 0}, {"sectors": 4.5}, {"neighbours": -1}, {"neighbours": 180}]
    + [{"bin_length": 0.0}, {"bin_length": 100.0}]
    + [{name: value} for name in ("step", "slope", "rise", "grade", "gap") for value in (-0.1, np.nan)],
)
def test_impossible_ground_is_refused_by_name(bad):
    with pytest.raises(ArgumentError, match=next(iter(bad))):
        GroundParams(**bad)

"""What no street holds: contradictory, empty, enormous and broken input, and the right limits it must lead to."""

import numpy as np
import pytest
from worlds.lecture_02_boxes import Box, scan_boxes

from semgrid_edu import fast, occupancy
from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    Belief,
    Bof,
    BofParams,
    CmcdotParams,
    LogOddsGrid,
    PlanarMotion,
    State,
    VelocityLattice,
)

SPEC = GridSpec(0, 40, -10, 10, 0.5)
PARAMS = CmcdotParams(n_particles=10_000)
STILL, NO_POINTS = PlanarMotion(), np.empty((0, 3), np.float32)
STREET = [Box(5, 60, 7.2, 7.7, 2.5), Box.around(15, -2, 4, 1.8, 1.5)]


@pytest.fixture(params=[occupancy.Cmcdot, fast.Cmcdot], ids=["book", "fast"])
def cmcdot(request) -> type[occupancy.Cmcdot]:
    """The filter and its compiled twin."""
    return request.param


def seasoned(cmcdot: type[occupancy.Cmcdot], steps: int = 2) -> occupancy.Cmcdot:
    """Return a tracker that has seen a car drive past a wall."""
    tracker = cmcdot(SPEC, PARAMS)
    for k in range(steps):
        car = Box.around(15 + k, -2, 4, 1.8, 1.5)
        tracker.step(scan_boxes([STREET[0], car]), STILL, 0.1)
    return tracker


def assert_sound(belief: Belief) -> None:
    """Every cell is a distribution, and velocity with its covariance is known together or not at all."""
    assert np.abs(belief.probability.sum(axis=0) - 1).max() < 1e-5
    assert belief.probability.min() >= 0
    unknown = np.isnan(belief.velocity[0])
    assert np.array_equal(np.isnan(belief.velocity_covariance), np.broadcast_to(unknown, (2, 2, *SPEC.shape)))
    assert np.isfinite(belief.velocity[:, ~unknown]).all()
    assert np.isfinite(belief.velocity_covariance[..., ~unknown]).all()


REFUSED = [
    (np.array([[1, np.nan, 0]]), 0.1, "points"),
    (NO_POINTS, -0.1, "dt"),
    (NO_POINTS, np.nan, "dt"),
    (NO_POINTS, np.inf, "dt"),
]


def test_a_refused_call_names_what_is_wrong_and_changes_nothing(cmcdot):
    tracker, twin, scan = seasoned(cmcdot), seasoned(cmcdot), scan_boxes(STREET)
    for points, dt, name in REFUSED:
        with pytest.raises(ArgumentError, match=name):
            tracker.step(points, PlanarMotion(1, 0.2, 0.1), dt)
    belief, expected = (t.step(scan, PlanarMotion(0.3, 0, 0.01), 0.1) for t in (tracker, twin))
    for field in ("probability", "velocity", "velocity_covariance"):
        assert np.array_equal(getattr(belief, field), getattr(expected, field), equal_nan=True)


def test_a_hundred_returns_say_no_more_than_two():
    """An enormous scan, five million points: beyond `max_returns` the returns of a cell add nothing."""
    scan = scan_boxes(STREET, columns=900)
    few, many = (np.concatenate([scan] * copies) for copies in (2, -(-5_000_000 // len(scan))))
    few, many = (fast.Cmcdot(SPEC, PARAMS).step(points, STILL, 0.1) for points in (few, many))
    assert np.array_equal(few.probability, many.probability)


@pytest.mark.parametrize(
    "tracker_of",
    [lambda: Bof(SPEC, BofParams(VelocityLattice(4.0, 2.0))), lambda: LogOddsGrid(SPEC)],
    ids=["BOF", "log-odds"],
)
def test_the_older_filters_refuse_and_forget_alike(tracker_of):
    """A refused call changes nothing; after a jump the belief is that of a filter that has seen nothing."""
    tracker, twin, scan = tracker_of(), tracker_of(), scan_boxes(STREET)
    for points, dt, name in ((np.array([[np.nan, 0, 0]]), 0.1, "points"), (NO_POINTS, -1.0, "dt")):
        with pytest.raises(ArgumentError, match=name):
            tracker.step(points, PlanarMotion(1, 0, 0), dt)
    first, expected = (probability_of(t.step(scan, STILL, 0.1)) for t in (tracker, twin))
    assert np.array_equal(first, expected)
    assert first.dtype == np.float32
    beliefs = [probability_of(t.step(NO_POINTS, PlanarMotion(100, 0, 0.5), 0.1)) for t in (tracker, tracker_of())]
    assert np.array_equal(*beliefs)


def probability_of(belief: Belief | np.ndarray) -> np.ndarray:
    """Return the probabilities of a belief; those of a log-odds grid are the belief."""
    return belief.probability if isinstance(belief, Belief) else belief


@pytest.mark.parametrize("distance", [1e6, 1e30])
def test_returns_from_beyond_the_world_hide_nothing_and_hit_nothing(cmcdot, distance):
    azimuth = np.radians(np.arange(0, 360, 0.1))
    points = np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), np.ones(3600)], axis=1)
    for scan in (points, points.astype(np.float32), points * [1, 1, distance]):
        tracker = seasoned(cmcdot)
        for _ in range(2):
            belief = tracker.step(scan, STILL, 0.1)
            assert_sound(belief)
        assert (np.isin(belief.probability.argmax(axis=0), (State.FREE, State.UNKNOWN, State.STATIC))).all()
        fresh = cmcdot(SPEC, PARAMS).step(scan, STILL, 0.1)
        assert (fresh.probability[[State.STATIC, State.DYNAMIC]].sum(axis=0) < 0.2).all()


def test_a_single_return_that_comes_twice_is_an_obstacle_and_frees_its_beam(cmcdot):
    """By hand, occupied against free after one return: 0.048 x 0.8 < 0.952 x 0.05. A second one decides."""
    tracker, scan = cmcdot(SPEC, PARAMS), np.array([[20.25, 0.25, 1.0]])
    first, belief = tracker.step(scan, STILL, 0.1), tracker.step(scan, STILL, 0.1)
    assert_sound(belief)
    assert first.probability[:, 39, 19].argmax() == State.FREE
    likeliest = belief.probability.argmax(axis=0)
    assert likeliest[39, 19] == State.STATIC
    assert (likeliest[40:45, 19] == State.FREE).all()
    assert (likeliest[:39] == State.UNKNOWN).all()


@pytest.mark.parametrize("dt", [1e6, 1e30])
def test_after_ages_all_is_forgotten(cmcdot, dt):
    belief = seasoned(cmcdot).step(NO_POINTS, STILL, dt)
    assert_sound(belief)
    assert (belief.probability[State.UNKNOWN] > 1 - 1e-6).all()
    assert np.isnan(belief.velocity).all()


@pytest.mark.parametrize("jump", [PlanarMotion(-3, 100, 1.0), PlanarMotion(1e300, 0, 0.01)])
def test_a_jump_beyond_the_map_forgets_everything_and_the_filter_goes_on(cmcdot, jump):
    tracker = seasoned(cmcdot)
    belief = tracker.step(NO_POINTS, jump, 0.1)
    assert (belief.probability[State.UNKNOWN] == 1).all()
    assert np.isnan(belief.velocity).all()
    assert len(tracker.particles) == 0
    newcomer = cmcdot(SPEC, PARAMS)
    newcomer.step(NO_POINTS, jump, 0.1)
    for _ in range(3):
        likeliest = [t.step(scan_boxes(STREET), STILL, 0.1).probability.argmax(axis=0) for t in (tracker, newcomer)]
        assert (likeliest[0] == likeliest[1]).mean() > 0.99


@pytest.mark.parametrize("half_turn", [np.pi, -np.pi, 1e4 * np.pi + np.pi])
def test_after_a_half_turn_the_vehicle_looks_where_it_has_never_looked(cmcdot, half_turn):
    tracker = seasoned(cmcdot)
    belief = tracker.step(NO_POINTS, PlanarMotion(0, 0, half_turn), 0.1)
    ahead = (
        SPEC.centers()[..., 0] > 5
    )  # beyond what the map held behind the vehicle, and a step's flight of what is born
    assert (belief.probability[State.UNKNOWN][ahead] == 1).all()
    assert_sound(belief)
    assert_sound(tracker.step(scan_boxes(STREET), PlanarMotion(0.5, 0, -half_turn), 0.1))

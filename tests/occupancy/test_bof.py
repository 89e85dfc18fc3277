"""The BOF: against CMCDOT's prediction, filterpy, and answers found by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds.lecture_02_boxes import Box, scan_boxes
from worlds.lecture_04_scenes import hit_cells

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import (
    Bof,
    BofParams,
    BofState,
    Evidence,
    FilterState,
    Particles,
    PlanarMotion,
    State,
    VelocityLattice,
    Walls,
    WorldModel,
    bof_move,
    bof_predict,
    bof_update,
    bof_velocity,
    predict,
    update,
)
from semgrid_edu.occupancy.state import cells_of, draw_velocities, weight_in_cells

DYNAMIC = State.DYNAMIC
GRID = GridSpec(0, 3, -1, 1, 0.5)
LINE = GridSpec(0, 5, 0, 0.5, 0.5)
LATTICE = VelocityLattice(max_speed=8.0, spacing=4.0)
PARAMS = BofParams(LATTICE)
STILL = WorldModel(rates=((0.0,) * 4,) * 4, stop_rate=0.0, max_acceleration=0.0, first_sight=(0.85, 0.15, 0.0))
ONLY_FLIGHT = BofParams(LATTICE, STILL)
EXACT = 0.125
"""Seconds in which 4 m/s are exactly one cell of half a metre."""
DRIVEN = st.sampled_from([0.0, 0.6, -0.6, 2.0])
"""How far the vehicle drives, metres."""


def random_state(seed: int, spec: GridSpec = GRID) -> BofState:
    """Return a state in which some cells are crowded and others empty, and any remainder is possible."""
    rng = np.random.default_rng(seed)
    mass = np.moveaxis(rng.dirichlet(np.full(len(LATTICE) + 2, 0.1), spec.shape), -1, 0).astype(np.float32)
    remainder = rng.uniform(-0.5, 0.5, LATTICE.velocities.shape) * spec.cell
    return BofState(mass[0], mass[1], mass[2:], LATTICE.velocities, remainder)


def bin_of(vx: float, vy: float = 0.0) -> int:
    """Return the index of a velocity of the lattice."""
    return int(np.flatnonzero((LATTICE.velocities == (vx, vy)).all(axis=1))[0])


def movers(cars: dict[int, tuple[float, float]]) -> BofState:
    """Return free cells on a line with moving mass in some: row -> (velocity along x, probability)."""
    free, occupied = np.ones(LINE.shape, np.float32), np.zeros((len(LATTICE), *LINE.shape), np.float32)
    for row, (velocity, mass) in cars.items():
        free[row], occupied[bin_of(velocity), row] = 1 - mass, mass
    unknown, remainder = np.zeros(LINE.shape, np.float32), np.zeros((len(LATTICE), 2))
    return BofState(free, unknown, occupied, LATTICE.velocities, remainder)


def predicted(state: BofState, steps: int, params: BofParams = ONLY_FLIGHT, dt: float = EXACT) -> BofState:
    """Predict several times, with nobody looking."""
    for _ in range(steps):
        state = bof_predict(state, LINE, params, dt)
    return state


def assert_sound(state: BofState) -> None:
    """Each cell is a distribution."""
    assert np.abs(state.probability.sum(axis=0) - 1).max() < 1e-5
    assert min(state.free.min(), state.unknown.min(), state.occupied.min()) >= -1e-6


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), DRIVEN, st.sampled_from([2.0, 5.0, None]))
def test_prediction_is_that_of_cmcdot_when_its_particles_lie_on_the_lattice(seed, driven, clearing_cells):
    """One particle a cell and velocity, anywhere in its cell: in whole cells both do the same, mass by mass.

    Each was five cells away per 4 m/s when it still took up another place, and at the second look two.
    """
    rng, moving = np.random.default_rng(seed), WorldModel(max_acceleration=0.0, stop_speed=3.0)
    walls = None if clearing_cells is None else Walls(clearing_time=5 * EXACT, clearing_cells=clearing_cells)
    world = replace(moving, walls=walls)
    state = replace(random_state(seed), remainder=np.zeros((len(LATTICE), 2)))
    velocity, row, col = (index.ravel() for index in np.indices(state.occupied[1:].shape))
    corner = np.stack([row, col], axis=1) + rng.uniform(0.05, 0.95, (len(row), 2))
    position = ((GRID.x_max, GRID.y_max) - corner * GRID.cell).astype(np.float32)
    particles = Particles(position, LATTICE.velocities[1:][velocity].astype(np.float32), state.occupied[1:].ravel())
    twin = FilterState(state.probability, particles, np.zeros(GRID.shape, np.float32))

    twin = predict(twin, GRID, world, EXACT, rng, (driven, 0.0))
    state = bof_predict(state, GRID, BofParams(LATTICE, world), EXACT, (driven, 0.0))
    assert np.allclose(state.probability, twin.probability, atol=2e-6)
    for k in range(1, len(LATTICE)):
        of_bin = velocity == k - 1
        cells = cells_of(twin.particles.position[of_bin], GRID)
        carried = weight_in_cells(twin.particles.weight[of_bin], cells, GRID.shape)
        assert np.allclose(state.occupied[k], carried + LATTICE.prior[k] * twin.newborn, atol=2e-6)


def test_slow_mass_moves_too():
    """1 m/s in steps of 0.1 s on cells of 0.5 m: 5 steps a cell, the first jump when half a cell is exceeded."""
    lattice = VelocityLattice(1.0, 1.0)
    occupied = np.zeros((5, *LINE.shape), np.float32)
    occupied[4, 9] = 0.5
    zero, half = np.zeros((5, 2)), np.float32(0.5)
    state = BofState(1 - half * (occupied[4] > 0), np.zeros(LINE.shape, np.float32), occupied, lattice.velocities, zero)
    rows = []
    for _ in range(20):
        state = bof_predict(state, LINE, BofParams(lattice, STILL), 0.1)
        rows.append(int(state.occupied[4, :, 0].argmax()))
    assert rows == [9] * 2 + [8] * 5 + [7] * 5 + [6] * 5 + [5] * 3
    assert np.isclose(state.occupied[4].max(), 0.5)


def test_nothing_is_lost_but_over_the_border_and_nothing_comes_in():
    state = predicted(movers(dict.fromkeys(range(10), (8.0, 0.5))), 2)
    assert np.allclose(state.probability[DYNAMIC, :, 0], 0.5 * (np.arange(10) < 6))
    assert_sound(predicted(state, 1, dt=1000.0))
    assert predicted(state, 1, dt=1e30).occupied[1:].max() == 0


def test_acceleration_spreads_velocities_with_the_variance_of_particles():
    """Uniform up to 6 m/s^2 in 0.1 s: (0.6 m/s)^2 / 3 along each axis, away from the rim of the lattice."""
    lattice = VelocityLattice(8.0, 1.0)
    state = BofState.nothing_known(LINE, lattice)
    state.unknown[:] = 0
    state.occupied[(lattice.velocities == (4.0, 1.0)).all(axis=1)] = 1
    moved = bof_predict(state, LINE, BofParams(lattice, replace(STILL, max_acceleration=6.0)), 0.1)
    mean, covariance = bof_velocity(moved)
    assert np.allclose(mean[:, 5, 0], [4, 1], atol=1e-5)
    assert np.allclose(covariance[:, :, 5, 0], np.eye(2) * 0.6**2 / 3, atol=1e-4)


def test_velocity_moments_of_two_movers_by_hand():
    """0.1 at (4, 0) and 0.3 at (0, -4): mean (1, -3), E[v v^T] - mean mean^T = [[3, 3], [3, 3]]."""
    state = movers({})
    state.occupied[bin_of(4, 0), 2], state.occupied[bin_of(0, -4), 2] = 0.1, 0.3
    mean, covariance = bof_velocity(state)
    assert np.allclose(mean[:, 2, 0], [1, -3], atol=1e-5)
    assert np.allclose(covariance[:, :, 2, 0], 3, atol=1e-5)
    assert np.isnan(mean[:, :2]).all()
    assert np.isnan(covariance[:, :, 3:]).all()


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 1000),
    st.floats(0, 1),
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(-4, 4),
    st.sampled_from([0, 1e-30, 0.3, 1]),
)
def test_every_step_keeps_every_cell_a_distribution(seed, dt, dx, dy, dyaw, floor):
    evidence = Evidence(*np.maximum(np.random.default_rng(seed).random((2, *GRID.shape)) ** 9, floor))
    state = random_state(seed)
    for step in (
        lambda s: bof_move(s, GRID, PlanarMotion(dx, dy, dyaw)),
        lambda s: bof_predict(s, GRID, PARAMS, dt),
        lambda s: bof_update(s, GRID, evidence, PARAMS),
    ):
        state = step(state)
        assert_sound(state)


@settings(deadline=None)
@given(st.integers(0, 1000))
def test_update_is_that_of_cmcdot_and_leaves_velocities_alone(seed):
    """A scan knows nothing of velocities: what moves keeps its distribution over them where nothing is born."""
    state, rng = random_state(seed), np.random.default_rng(seed)
    evidence = Evidence(*rng.uniform(0.1, 1, (2, *GRID.shape)))
    given_scan = bof_update(state, GRID, evidence, ONLY_FLIGHT)
    prior = FilterState(state.probability, Particles.none(), np.zeros(GRID.shape, np.float32))
    assert np.allclose(given_scan.probability, update(prior, GRID, evidence, STILL).probability, atol=1e-6)
    before, after = (s.occupied[1:] / np.maximum(s.probability[DYNAMIC], 1e-9) for s in (state, given_scan))
    worth = np.minimum(state.probability[DYNAMIC], given_scan.probability[DYNAMIC]) > 1e-3
    assert np.allclose(before[:, worth], after[:, worth], atol=1e-3)


@pytest.mark.parametrize("certain", ["free", "occupied"])
def test_contradiction_leaves_nothing_known(certain):
    state = movers({})
    if certain == "occupied":
        state.free[:], state.occupied[0] = 0, 1
    impossible = np.full(LINE.shape, float(certain == "free"))
    state = bof_update(state, LINE, Evidence(impossible, 1 - impossible), PARAMS)
    assert (state.unknown == 1).all()
    assert_sound(state)


def test_no_time_no_change():
    state = random_state(3)
    after = bof_predict(replace(state, remainder=state.remainder * 0.9), GRID, PARAMS, 0.0)
    assert np.allclose(after.occupied, state.occupied, atol=1e-6)
    assert np.allclose(after.free, state.free, atol=1e-6)


def test_what_is_born_takes_the_prior_velocities():
    """UNKNOWN cells that turn out occupied: the dynamic share of first sight over the lattice's prior."""
    state = bof_update(
        BofState.nothing_known(GRID, LATTICE), GRID, Evidence(np.ones(GRID.shape), np.zeros(GRID.shape)), PARAMS
    )
    static, dynamic = PARAMS.world.first_sight[1:]
    assert np.allclose(state.occupied[1:, 0, 0], LATTICE.prior[1:] * dynamic / (static + dynamic))


def test_a_shift_by_whole_cells_is_exact_and_what_enters_is_unknown():
    state = random_state(4)
    moved = bof_move(state, GRID, PlanarMotion(1.0, 0.5, 0))
    assert np.array_equal(moved.occupied[:, 2:, 1:], state.occupied[:, :-2, :-1])
    assert np.array_equal(moved.free[2:, 1:], state.free[:-2, :-1])
    assert (moved.unknown[:2] == 1).all()
    assert (moved.unknown[:, 0] == 1).all()
    assert np.array_equal(moved.remainder, state.remainder)


def test_a_half_turn_turns_mass_velocities_and_remainders():
    spec = GridSpec(-1.5, 1.5, -1, 1, 0.5)
    state = random_state(5, spec)
    turned = bof_move(state, spec, PlanarMotion(dyaw=np.pi))
    assert np.array_equal(turned.occupied, state.occupied[:, ::-1, ::-1])
    assert np.allclose(turned.velocity, -state.velocity)
    assert np.allclose(turned.remainder, -state.remainder)


def test_the_lattice_holds_the_points_of_a_disc():
    """Gauss's circle problem: 1, 5, 13, 29, 49 points up to radius 0, 1, 2, 3, 4; 197 up to 8."""
    assert [len(VelocityLattice(r * 0.7, 0.7)) for r in (1, 2, 3, 4, 8)] == [5, 13, 29, 49, 197]
    lattice = VelocityLattice(5.0, 1.0)
    assert (lattice.velocities[0] == 0).all()
    assert (np.diff(np.hypot(*lattice.velocities.T)) >= -1e-12).all()
    assert lattice.prior[0] == 0
    assert np.isclose(lattice.prior.sum(), 1)
    sides = lattice.velocities[lattice.neighbours] - lattice.velocities[:, None]
    inner = (np.hypot(*lattice.velocities.T) <= 4) & (np.hypot(*lattice.velocities.T) > 1)
    assert np.allclose(sides[inner], [[1, 0], [-1, 0], [0, 1], [0, -1]])
    assert (lattice.neighbours[1:] != 0).all()


def test_the_prior_is_what_particles_are_born_with():
    """A million draws counted around each point of the lattice, away from zero where a square holds one density."""
    lattice, drawn = VelocityLattice(10.0, 1.0), draw_velocities(1_000_000, 12.0, np.random.default_rng(0))
    steps = np.rint(drawn).astype(int)
    count = np.zeros((25, 25))
    np.add.at(count, (steps[:, 0] + 12, steps[:, 1] + 12), 1)
    fast = np.hypot(*lattice.velocities.T) >= 3
    counted = count[tuple(lattice.velocities[fast].astype(int).T + 12)]
    expected = lattice.prior[fast]
    assert np.abs(counted / counted.sum() / (expected / expected.sum()) - 1).max() < 0.1


@pytest.mark.parametrize(
    ("bad", "name"),
    [((16.0, 0.0), "spacing"), ((1.0, 2.0), "max_speed"), ((np.nan, 1.0), "max_speed"), ((1e9, 1.0), "max_speed")],
)
def test_no_lattice_is_refused_by_name(bad, name):
    with pytest.raises(ArgumentError, match=name):
        VelocityLattice(*bad)


def test_too_much_for_memory_is_refused_with_its_size():
    """By hand: 4-byte numbers for 7845 velocities (Gauss's circle of radius 50) in 100 x 700 cells are 2.2 GB."""
    with pytest.raises(ArgumentError, match=r"lattice: .*at most 2 GB, found 7845 x 100 x 700, 2\.2 GB"):
        BofState.nothing_known(GridSpec(0, 100, 0, 700, 1), VelocityLattice(50.0, 1.0))


SMALL = GridSpec(0, 40, -10, 10, 0.5)


def test_a_turning_vehicle_sees_a_car_move_straight_on():
    """The lattice doesn't turn with the map, so the car's velocity stays on it; beliefs are in the vehicle's axes."""
    tracker = Bof(SMALL, BofParams(VelocityLattice(8.0, 2.0)))
    pose, motion = PlanarMotion(), PlanarMotion(0.2, 0.0, 0.02)
    for k in range(20):
        car = Box.around(16 + 0.6 * k, 0, 4, 1.8, 1.5)
        points = scan_boxes([car], x=pose.dx, y=pose.dy, yaw=pose.dyaw)
        belief = tracker.step(points, motion, 0.1)
        seen_from, pose = pose, pose.then(motion)
    moving = (belief.probability[DYNAMIC] > 0.5) & hit_cells(points, SMALL)
    assert moving.sum() >= 3
    heading = seen_from.rotation @ belief.velocity[:, moving].mean(axis=1)
    assert np.abs(heading - [6, 0]).max() < 1


OTHER = GridSpec(0, 6, -2, 2, 0.5)
SCAN = Evidence(*np.ones((2, *OTHER.shape)))


@pytest.mark.parametrize(
    ("step", "name"),
    [
        (lambda state: bof_move(state, OTHER, PlanarMotion(1, 0, 0)), "state"),
        (lambda state: bof_predict(state, OTHER, PARAMS, 0.1), "state"),
        (lambda state: bof_predict(state, GRID, BofParams(), 0.1), "state"),
        (lambda state: bof_update(state, OTHER, SCAN, PARAMS), "state"),
        (lambda state: bof_update(state, GRID, SCAN, PARAMS), "evidence"),
    ],
)
def test_a_belief_or_a_scan_over_other_cells_is_refused(step, name):
    with pytest.raises(ArgumentError, match=f"^{name}: expected shape"):
        step(random_state(0))

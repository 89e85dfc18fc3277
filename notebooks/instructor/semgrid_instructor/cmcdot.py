"""Hidden tests of exercise 04, CMCDOT: the package itself is the reference."""

from collections.abc import Callable

import numpy as np

from semgrid_edu.answers import answer_array, answer_arrays
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams, Evidence, FilterState, Particles, transition_matrix
from semgrid_edu.occupancy import update as package_update
from semgrid_edu.occupancy.local_belief import velocity_moments
from semgrid_edu.occupancy.particles import cells_of, weight_in_cells
from semgrid_edu.occupancy.resampling import systematic_resample
from semgrid_instructor import close, generator, hidden, keeping


@hidden
def check_in_cells(in_cells: Callable) -> None:
    """Many particles in and around a grid that reaches behind the vehicle, some cells without any."""
    rng = generator(1)
    spec = GridSpec(x_min=-2, x_max=6, y_min=-1, y_max=3, cell=0.5)
    position = rng.uniform([-4, -3], [8, 5], size=(300, 2))
    velocity, weight = rng.normal(0, 8, size=(300, 2)), rng.uniform(0.001, 0.1, size=300)
    particles = Particles(*(a.astype(np.float32) for a in (position, velocity, weight)))
    cells = cells_of(particles.position, spec)
    expected, _ = velocity_moments(particles, cells, spec.shape)
    before = position + np.array([1.3, -0.4])
    got = in_cells(before, velocity, weight, 1.3, -0.4, spec.x_max, spec.y_max, spec.cell, spec.shape)
    dynamic, mean = answer_arrays(got, 2)
    assert dynamic.shape == spec.shape, f"dynamic has the shape {dynamic.shape} instead of {spec.shape}"
    total = weight_in_cells(particles.weight, cells, spec.shape)
    inner, right = close(dynamic[1:, 1:], total[1:, 1:], atol=1e-5), close(dynamic, total, atol=1e-5)
    cut = (
        "wrong sums in row 0 or column 0: int() and astype(int) cut -0.6 to 0, a cell of the grid; take np.floor first"
    )
    assert right or not inner, cut
    assert right, "wrong sums (cells need not be 1 m; particles may be on any side)"
    empty = np.isnan(expected)
    assert np.array_equal(np.isnan(mean), empty), "velocity must be NaN exactly where no particle is"
    assert close(mean[~empty], expected[~empty], atol=1e-3), "sums are right, mean velocities are not"


@hidden
@keeping
def check_mix(mix: Callable) -> None:
    """Random beliefs through the matrix of default rates, and through one in which UNKNOWN gives birth."""
    rng = generator(2)
    belief = rng.dirichlet(np.ones(4), size=(5, 7)).transpose(2, 0, 1)
    for M in (transition_matrix(CmcdotParams(), 0.3), rng.dirichlet(np.ones(4), size=4)):
        after, newborn = answer_arrays(mix(belief.copy(), M.copy()), 2)
        assert after.shape == belief.shape, f"shape {after.shape} instead of {belief.shape}"
        by_cells = np.einsum("ij,ihw->jhw", M, belief)
        assert close(after, by_cells), "wrong belief after the step"
        born = sum(M[i, 2] * belief[i] for i in (0, 1, 3))
        assert close(newborn, born), "wrong newborn mass (any of the three other states may turn DYNAMIC)"


def _scan(belief: np.ndarray, occupied: np.ndarray, free: np.ndarray, first_sight: tuple) -> np.ndarray:
    """Return what the package makes of a scan."""
    spec = GridSpec(x_min=0, x_max=belief.shape[1], y_min=0, y_max=belief.shape[2], cell=1)
    state = FilterState(belief.astype(np.float32), Particles.none(), belief[2].astype(np.float32))
    evidence = Evidence(occupied.astype(np.float32), free.astype(np.float32))
    return package_update(state, spec, evidence, CmcdotParams(first_sight=first_sight)).probability


@hidden
@keeping
def check_update(update: Callable) -> None:
    """Random beliefs and evidence over a grid of another shape."""
    rng = generator(3)
    belief = rng.dirichlet(np.ones(4), size=(6, 5)).transpose(2, 0, 1)
    occupied, free = rng.uniform(0.05, 1, size=(2, 6, 5))
    got = answer_array(update(belief.copy(), occupied.copy(), free.copy(), (0.5, 0.2, 0.3)))
    assert got.shape == belief.shape, f"shape {got.shape} instead of {belief.shape}"
    assert close(got.sum(axis=0), 1), "the states of some cells don't sum to 1"
    assert close(got[3], 0), "UNKNOWN is left in cells that the scan sees (as free, or as occupied)"
    expected = _scan(belief, occupied, free, (0.5, 0.2, 0.3))
    assert close(got, expected, atol=1e-5), "sums are right, values are not"


@hidden
def check_update_limits(update: Callable) -> None:
    """Silent cells, cells certain of being FREE or STATIC, contradictions of either, and what is only improbable.

    What becomes of UNKNOWN and of DYNAMIC in a cell that the scan sees is for check_update to judge.
    """
    belief = np.eye(4)[:, None, [0, 1, 0, 1, 0, 1, 2, 3]]
    occupied, free = generator(7).uniform(0.1, 0.9, size=(2, 1, 8))
    free[0, 0] = occupied[0, 1] = occupied[0, 2] = free[0, 3] = 0
    free[0, 4:] = occupied[0, 4:]
    got = answer_array(update(belief.copy(), occupied.copy(), free.copy(), (0.5, 0.2, 0.3)))
    assert np.isfinite(got).all(), "a cell is NaN or infinite"
    assert close(got[..., 4:], belief[..., 4:]), "where the scan is silent the belief must stay"
    expected = _scan(belief, occupied, free, (0.5, 0.2, 0.3))
    assert close(got, expected, atol=1e-5), "wrong where a cell is certain or contradicted"
    for tiny in (1e-4, 1e-7):
        got = answer_array(update(belief[..., :1], np.array([[0.9]]), np.array([[tiny]]), (0.5, 0.2, 0.3)))
        possible = "a cell, surely free, explains its scan with a small probability: that is no contradiction"
        assert close(got[:, 0, 0], [1, 0, 0, 0]), possible


@hidden
def check_systematic(systematic: Callable) -> None:
    """More and fewer draws than weights, weights of zero at the ends, and teeth on borders."""
    rng = generator(4)
    for size, count in ((50, 50), (7, 200), (400, 20)):
        weight, offset = rng.dirichlet(np.full(size, 0.3)) * 3, rng.random()
        got = answer_array(systematic(weight.copy(), count, offset))
        assert got.shape == (count,), f"{count} indices expected from {size} weights, got shape {got.shape}"
        assert np.array_equal(got, systematic_resample(weight, count, offset)), "wrong indices for random weights"
    weight = np.array([0.0, 1, 1, 0, 2, 0])
    got = answer_array(systematic(weight.copy(), 8, 0.0), dtype=int)
    assert (weight[got] > 0).all(), "a particle of weight 0 was drawn (a tooth on a border draws the second)"
    assert np.array_equal(got, [1, 1, 2, 2, 4, 4, 4, 4]), "wrong where a tooth lies on a border"


def _struck_out(own: np.ndarray, a: float) -> np.ndarray:
    """Return the belief of one cell, combination by combination."""
    after = np.zeros(4)
    for state, p in enumerate(own):
        after[state] += (1 - a) * p
        after[2] += a * p * (state != 1)
    return after / after.sum()


def _compare(meet: Callable, own: np.ndarray, arrives: np.ndarray) -> None:
    """Compare `meet` with the enumeration in every cell."""
    got = answer_array(meet(own.copy(), arrives.copy()))
    assert got.shape == own.shape, f"shape {got.shape} instead of {own.shape}"
    assert close(got.sum(axis=0), 1), "the states of some cells don't sum to 1"
    for r, c in np.ndindex(arrives.shape):
        expected = _struck_out(own[:, r, c], arrives[r, c])
        assert close(got[:, r, c], expected), "sums are right, values are not (UNKNOWN is a state too)"


@hidden
def check_meet(meet: Callable) -> None:
    """Random beliefs in cells in which nothing moves, and arrivals, over a grid of another shape."""
    rng = generator(5)
    own = np.insert(rng.dirichlet(np.ones(3), size=(5, 7)), 2, 0, axis=-1).transpose(2, 0, 1)
    _compare(meet, own, rng.uniform(0.05, 0.95, size=(5, 7)))


@hidden
def check_meet_dynamic(meet: Callable) -> None:
    """Random beliefs in FREE and DYNAMIC; check_meet judges the two other states."""
    rng = generator(6)
    own = np.zeros((4, 5, 7))
    own[[0, 2]] = rng.dirichlet(np.ones(2), size=(5, 7)).transpose(2, 0, 1)
    _compare(meet, own, rng.uniform(0.05, 0.95, size=(5, 7)))


@hidden
def check_meet_limits(meet: Callable) -> None:
    """Any weights that arrive, in cells certain of each state: they must do what 0.999 does, whatever that is."""
    own = np.repeat(np.eye(4)[:, None, :], 3, axis=1)
    arrives = generator(8).uniform([[0], [1], [2]], [[0.9], [1.5], [40]], size=(3, 4))
    arrives[1, :2] = 1.0
    got = answer_array(meet(own.copy(), arrives.copy()))
    assert np.isfinite(got).all(), "a cell is NaN or infinite"
    assert got.min() >= 0, "a probability is negative"
    expected = answer_array(meet(own.copy(), np.minimum(arrives, 0.999)))
    assert not close(expected, answer_array(meet(own.copy(), arrives / 100))), "it doesn't matter what arrives"
    assert close(got, expected), "wrong where weights of 1 and more arrive"

"""Hidden tests of exercise 03, BOF: scipy, filterpy and counting by hand are the references."""

from collections.abc import Callable

import numpy as np
from filterpy.discrete_bayes import update as discrete_update
from scipy import ndimage

from semgrid_edu.workshop.course.answers import answer_array, answer_arrays
from semgrid_instructor import asked_in_any_order, close, generator, hidden, keeping


@hidden
@keeping
def check_shift(shift: Callable) -> None:
    """Every direction, no way at all, and ways that leave the map."""
    rng = generator(2)
    mass = rng.uniform(0.1, 1, size=(5, 4))
    ways = ((0, 0), (0, 1), (2, 0), (1, -2), (-4, -1), (3, 3), (7, 0), (0, -9))
    for (down, right), got in asked_in_any_order(lambda way: answer_array(shift(mass.copy(), *way)), ways):
        how = "a way of 0" if 0 in (down, right) else "another direction"
        how = "a way longer than the map" if max(abs(down), abs(right)) > 4 else how
        assert got.shape == mass.shape, "wrong shape for " + how
        expected = ndimage.shift(mass, (down, right), order=0, cval=0.0)
        assert close(got, expected), "wrong for " + how


@hidden
@keeping
def check_update(update: Callable) -> None:
    """Random beliefs on another lattice and grid, one cell that is certain of each."""
    rng = generator(3)
    belief = rng.dirichlet(np.ones(6), size=(4, 7)).transpose(2, 0, 1)  # the last one is free
    belief[:, 1, 2] = [0, 0, 0, 0, 0, 1]
    belief[:, 2, 2] = [0.5, 0, 0.5, 0, 0, 0]
    occupied, free = rng.uniform(0.05, 1, size=(5, 4, 7)), rng.uniform(0.05, 1, size=(4, 7))
    occupied[:, 2, 2] = 0.3  # a scan that doesn't tell velocities
    got = answer_array(update(belief[:5].copy(), occupied.copy(), free.copy()))
    assert got.shape == (5, 4, 7), "wrong shape (there need not be three velocities)"
    assert close(got[:, 1, 2], 0), "a cell that is free for sure must stay so"
    assert close(got[:, 2, 2], belief[:5, 2, 2]), "a cell that is occupied for sure must stay so"
    for row, col in np.ndindex(4, 7):
        likelihood = np.append(occupied[:, row, col], free[row, col])
        expected = discrete_update(likelihood, belief[:, row, col].copy())
        assert close(got[:, row, col], expected[:5]), "wrong values"


SLOW, FAST = 0.9, [0, 1, 2, 4, 6]
"""What counts as standing, m/s, and which velocities of the lattice below don't."""


def _lattice_and_joint() -> tuple[np.ndarray, np.ndarray]:
    """Return a lattice that isn't symmetric, (7, 2), and a joint over 3 x 4 cells; in three of them nothing moves."""
    rng = generator(4)
    velocities = rng.uniform([-3, -9], [12, 4], size=(7, 2))
    velocities *= 1 + 2 * SLOW / np.hypot(*velocities.T)[:, None]  # faster than twice as fast as `slow`
    velocities[3], velocities[5] = 0, [0.6, -0.3]
    joint = 0.9 * rng.dirichlet(np.full(7, 0.4), size=(3, 4)).transpose(2, 0, 1)
    joint[:, 2, 1] = 0
    joint[:, 1, 2] = [0, 0, 0, 0.5, 0, 0, 0]
    joint[:, 1, 0] = [0, 0, 0, 0.3, 0, 0.4, 0]
    joint[:, 0, 3] *= 1e-6
    return velocities, joint


def _moving(joint: np.ndarray) -> list[tuple[int, int]]:
    """Return the cells where something may well move; check_no_mass judges those with little mass, and with none."""
    return [(int(row), int(col)) for row, col in np.argwhere(joint[FAST].sum(axis=0) > 0.01)]


def _mean_is_right(mean: np.ndarray, joint: np.ndarray, velocities: np.ndarray) -> bool:
    """Compare with numpy's weighted average, cell by cell."""
    return all(
        close(mean[:, row, col], np.average(velocities[FAST], axis=0, weights=joint[FAST, row, col]))
        for row, col in _moving(joint)
    )


@hidden
@keeping
def check_mean(mean_and_covariance: Callable) -> None:
    """Random mass, the velocities of a lattice that isn't symmetric."""
    velocities, joint = _lattice_and_joint()
    mean = answer_array(mean_and_covariance(joint.copy(), velocities.copy(), SLOW)[0])
    assert mean.shape == (2, 3, 4), "wrong shape (there need not be five velocities)"
    assert _mean_is_right(mean, joint, velocities), (
        "wrong mean (velocities may stand in any order, and `slow` may differ)"
    )


@hidden
@keeping
def check_no_mass(mean_and_covariance: Callable) -> None:
    """NaN where nothing moves, and nowhere else; where the mean is wrong, only in free cells."""
    velocities, joint = _lattice_and_joint()
    mean, covariance = answer_arrays(mean_and_covariance(joint.copy(), velocities.copy(), SLOW), 2)
    empty = joint[FAST].sum(axis=0) == 0
    judged = empty if _mean_is_right(mean, joint, velocities) else joint.sum(axis=0) == 0
    assert np.isnan(mean[:, judged]).all(), "a mean velocity where nothing moves"
    assert np.isnan(covariance[:, :, judged]).all(), "a covariance where nothing moves"
    known = np.isfinite(mean[:, ~empty]).all() and np.isfinite(covariance[:, :, ~empty]).all()
    assert known, "NaN where something may move (a little mass, but some)"


@hidden
@keeping
def check_covariance(mean_and_covariance: Callable) -> None:
    """Compare with numpy's weighted covariance, cell by cell; where means are wrong, in cells where all moves."""
    velocities, joint = _lattice_and_joint()
    mean, covariance = answer_arrays(mean_and_covariance(joint.copy(), velocities.copy(), SLOW), 2)
    if not _mean_is_right(mean, joint, velocities):
        joint[[3, 5]] = 0
        joint /= np.maximum(joint.sum(axis=0), 1e-9)
        covariance = answer_array(mean_and_covariance(joint.copy(), velocities.copy(), SLOW)[1])
    assert covariance.shape == (2, 2, 3, 4), "wrong shape (there need not be five velocities)"
    for row, col in _moving(joint):
        expected = np.cov(velocities[FAST].T, aweights=joint[FAST, row, col], ddof=0)
        assert close(covariance[:, :, row, col], expected), "wrong covariance"


@hidden
@keeping
def check_arrive(arrive: Callable) -> None:
    """Count the pairs one by one, in random cells and in cells that are certain."""
    rng = generator(5)
    own = rng.dirichlet(np.ones(4), size=(3, 5)).transpose(2, 0, 1)
    arrives = rng.uniform(0, 0.99, size=(3, 5))
    own[:, 0, 0], arrives[0, 0] = [0, 1, 0, 0], 0.999
    own[:, 1, 1], arrives[1, 1] = [1, 0, 0, 0], 1.0
    got = answer_array(arrive(own.copy(), arrives.copy()))
    assert got.shape == own.shape, "wrong shape (the grid may have any number of rows and columns)"
    assert np.isfinite(got).all(), "no number where it is certain that something arrives in a free cell"
    for row, col in np.ndindex(3, 5):
        a = arrives[row, col]
        cuts = {a, min(a, 0.999)}  # the package lets `a` be 0.999 at most, and so may a student
        assert any(close(got[:, row, col], _pairs(own[:, row, col], cut)) for cut in cuts), "wrong values"


def _pairs(own: np.ndarray, a: float) -> np.ndarray:
    """Return what is left of one cell (4,) where something arrives with probability a, pair by pair."""
    pairs = np.zeros(4)
    for state, comes in np.ndindex(4, 2):
        if not (state in (1, 2) and comes):
            pairs[2 if comes else state] += own[state] * (a if comes else 1 - a)
    return pairs / pairs.sum()


@hidden
@keeping
def check_follow(follow: Callable) -> None:
    """Several scans, uneven priors, velocities that leave the line on either side; by summing over the places."""
    rng = generator(6)
    steps, cases = np.array([-2, -1, 0, 1, 3]), []
    for start, scans, cells in ((0, 2, 6), (4, 4, 6), (3, 1, 7)):
        cases.append((start, steps, rng.dirichlet(np.ones(5)), *rng.uniform(0.2, 1, size=(2, scans, cells))))
    asked = asked_in_any_order(lambda case: answer_array(follow(case[0], *map(np.copy, case[1:]))), cases)
    for (start, _, prior, occupied, free), got in asked:
        assert got.shape == (5,), "wrong shape (there need not be three velocities)"
        weight = prior.copy()
        for t, place in np.ndindex(free.shape):
            here = start + steps * (t + 1) == place
            weight *= np.where(here, occupied[t, place], free[t, place])
        left = "wrong where a thing leaves the line" if start == 0 else "wrong values"
        assert close(got, weight / weight.sum()), left

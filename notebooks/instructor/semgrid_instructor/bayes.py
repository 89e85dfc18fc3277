"""Hidden tests of exercise 01, Bayes' rule on a line: filterpy and the package itself are the reference."""

from collections.abc import Callable
from itertools import product

import numpy as np
from filterpy import discrete_bayes
from scipy.linalg import expm, logm

from semgrid_edu.occupancy import CmcdotParams, transition_matrix
from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_instructor import asked_in_any_order, close, generator, hidden, in_any_order, keeping


def _beside(n_cells: int, poles: np.ndarray, hit: float, false_alarm: float) -> np.ndarray:
    """Return P("pole" | cell), (N,)."""
    return np.where(np.isin(np.arange(n_cells), poles), hit, false_alarm)


def _road(n_cells: int) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return a belief with a cell that is impossible, three poles as an array, and a sensor."""
    rng = generator(1100 + n_cells)
    belief = rng.dirichlet(np.ones(n_cells))
    belief[2] = 0
    return (
        belief / belief.sum(),
        rng.choice(n_cells, size=3, replace=False),
        rng.uniform(0.6, 0.95),
        rng.uniform(0.05, 0.3),
    )


def _balanced(number: int, hit: float, false_alarm: float) -> list[bool]:
    """Return readings that together speak neither for a pole nor against it: each number stays far from zero."""
    readings, for_a_pole = [], 0.0
    for _ in range(number):
        says = for_a_pole < 0
        for_a_pole += np.log(hit / false_alarm) if says else np.log((1 - hit) / (1 - false_alarm))
        readings.append(bool(says))
    return readings


@hidden
@keeping
def check_locate_fresh(locate: Callable) -> None:
    """Longer roads, other sensors, no readings, and thousands."""
    for n_cells, n_readings in in_any_order(((5, 0), (5, 6), (30, 5), (30, 3000))):
        belief, poles, *sensor = _road(n_cells)
        readings = _balanced(n_readings, *sensor)
        if n_readings < 10:
            readings = [bool(says) for says in generator(1200 + n_readings).random(n_readings) < 0.4]
        got = answer_array(locate(belief.copy(), list(readings), poles.copy(), *sensor))
        assert got.shape == belief.shape, "another shape"
        assert np.isfinite(got).all(), "NaN after many readings: unnormalised products end at zero"
        assert got[2] == 0, "what was impossible must stay impossible"
        p_pole, expected = _beside(n_cells, poles, *sensor), belief
        for says in readings:
            expected = discrete_bayes.update(p_pole if says else 1 - p_pole, expected)
        assert close(got, expected), "wrong with three poles and another number of readings"


@hidden
@keeping
def check_locate_stuck(locate: Callable) -> None:
    """Sum over all ways in which the sensor may have been stuck: 2^7 for eight readings."""
    for n_cells, stuck, alike in in_any_order(((5, 0.3, False), (30, 0.85, False), (30, 1.0, True), (5, 0.6, True))):
        belief, poles, *sensor = _road(n_cells)
        readings = [False] * 8 if alike else [bool(says) for says in generator(1250 + n_cells).random(8) < 0.5]
        got = answer_array(locate(belief.copy(), list(readings), poles.copy(), *sensor, stuck=stuck))
        assert got.shape == belief.shape, "another shape"
        p_pole, total = _beside(n_cells, poles, *sensor), np.zeros(n_cells)
        for was_stuck in product((False, True), repeat=7):
            way = p_pole if readings[0] else 1 - p_pole
            for old, new, held in zip(readings[:-1], readings[1:], was_stuck, strict=True):
                fresh = p_pole if new else 1 - p_pole
                way = way * (stuck * (old == new) if held else (1 - stuck) * fresh)
            total += way
        assert close(got, discrete_bayes.update(total, belief)), "wrong for another `stuck`, or for eight readings"


def _moved(belief: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Return where things are on a road without an end, (N + D - 1,)."""
    n_cells, reach = moved.shape
    after = np.zeros(n_cells + reach - 1)
    for n in range(n_cells):
        after[n : n + reach] += belief[n] * moved[n]
    return after


@hidden
@keeping
def check_predict_ring(predict: Callable) -> None:
    """Drive moves of other lengths, up to once round the ring, and another one in each cell."""
    rng = generator(12)
    sizes = (9, 5), (6, 6), (4, 2)
    drives = [(rng.dirichlet(np.ones(n)), rng.dirichlet(np.ones(reach), size=n)) for n, reach in sizes]
    for (belief, moved), got in asked_in_any_order(lambda drive: answer_array(predict(*map(np.copy, drive))), drives):
        n_cells, reach = moved.shape
        expected = np.zeros(n_cells)
        np.add.at(expected, np.arange(n_cells + reach - 1) % n_cells, _moved(belief, moved))
        assert got.shape == belief.shape, "another shape"
        assert close(got.sum(), 1), "probability is lost or made (a row of moves may have any length)"
        assert close(got, expected), "sums are right, values are not (a row of moves may have any length)"


@hidden
@keeping
def check_predict_wall(predict: Callable) -> None:
    """Drive moves that would end far behind the wall, judged also by what the answer itself makes of a long ring."""
    for n_cells, reach in in_any_order(((7, 3), (5, 5))):
        rng = generator(1300 + n_cells)
        belief, moved = rng.dirichlet(np.ones(n_cells)), rng.dirichlet(np.ones(reach), size=n_cells)
        got = answer_array(predict(belief.copy(), moved.copy(), ring=False))
        assert got.shape == belief.shape, "another shape"
        assert not close(got, belief), "nothing has moved"
        turned = answer_array(predict(belief[::-1].copy(), moved.copy(), ring=False))
        assert not close(got, turned), "it doesn't matter what was believed before"
        beyond = _moved(belief, moved)
        expected = np.append(beyond[: n_cells - 1], beyond[n_cells - 1 :].sum())
        longer = np.pad(moved, ((reach, reach), (0, 0)), mode="edge")
        wide = answer_array(predict(np.pad(belief, reach), longer))
        first, last = reach, reach + n_cells - 1
        by_ring = np.concatenate([[wide[: first + 1].sum()], wide[first + 1 : last], [wide[last:].sum()]])
        right = close(got, expected) or close(got, by_ring)
        assert right or close(got.sum(), 1), "probability is lost at the wall (moves of three and more cells?)"
        assert right, "sums are right, values are not (moves of three and more cells?)"


def _cell(seed: int, scans: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a first belief, likelihoods of many scans, some of them silent, and the package's matrix."""
    likelihoods = generator(seed).uniform(0.05, 0.9, size=(scans, 4))
    likelihoods[::7] = 0.25
    return np.array([0.4, 0.3, 0.2, 0.1]), likelihoods, transition_matrix(CmcdotParams(), dt=0.5)


def _filtered(belief: np.ndarray, likelihoods: np.ndarray, M: np.ndarray) -> np.ndarray:
    rows = []
    for t, likelihood in enumerate(likelihoods):
        belief = discrete_bayes.update(likelihood, belief @ M if t else belief)
        rows.append(belief)
    return np.array(rows)


@hidden
@keeping
def check_follow(follow: Callable) -> None:
    """Four states, the package's matrix, and a drive of thousands of scans."""
    cell = _cell(14, 3000)
    got = answer_array(follow(*(array.copy() for array in cell)))
    assert got.shape == cell[1].shape, "another shape"
    for k, expected in enumerate(_filtered(cell[0], cell[1][:20], cell[2])):
        assert close(got[k], expected), "wrong with four states, from the first scans on"
    assert np.isfinite(got).all(), "NaN after many scans: unnormalised products end at zero"
    assert close(got.sum(axis=1), 1), "after many scans the belief no longer sums to 1"


@hidden
@keeping
def check_follow_lag(follow: Callable) -> None:
    """Other lags, one longer than the drive, one of a hundred scans."""
    cells = []
    for scans, lag, scale in ((12, 2, 1), (12, 5, 1), (6, 9, 1), (120, 100, 0.001)):
        belief, likelihoods, M = _cell(18, scans)
        cells.append((belief, likelihoods * scale, M, lag))  # only ratios matter
    asked = asked_in_any_order(lambda cell: answer_array(follow(*map(np.copy, cell[:3]), lag=cell[3])), cells)
    for (belief, likelihoods, M, lag), got in asked:
        scans = len(likelihoods)
        assert got.shape == likelihoods.shape, "another shape"
        assert np.isfinite(got).all(), "NaN with a long lag: normalise the message on the way"
        forward = _filtered(belief, likelihoods, M)
        for t in (0, 1, scans // 2, scans - 2, scans - 1):
            pair = np.diag(forward[t])  # P(state at t, state later)
            for later in likelihoods[t + 1 : t + 1 + lag]:
                pair = pair @ M * later
                pair /= pair.sum()
            message = "wrong with a lag" + (" that is longer than the drive" if lag > scans else "")
            assert close(got[t], pair.sum(axis=1)), message


def _counts(seed: int) -> list[np.ndarray]:
    """Return what was counted of cells of several kinds; in the last, one of the changes was never seen."""
    rng = generator(seed)
    appears, vanishes = rng.integers(5, 60), rng.integers(80, 250)
    return [
        np.array([[700 - appears, appears], [vanishes, 600 - vanishes]]),
        np.array([[300, 100], [20, 180]]),
        np.array([[1000 - appears, appears], [0, 50]]),
    ]


def _over(counts: np.ndarray, dt: float, new_dt: float) -> np.ndarray:
    return expm(np.real(logm(counts / counts.sum(axis=1, keepdims=True))) * (new_dt / dt))


@hidden
@keeping
def check_transition(transition: Callable) -> None:
    """Other counts and times, up to very long ones; states of unequal frequency; a world that never changes."""
    cases = product(_counts(16), ((0.1, 0.02), (0.2, 0.5), (0.05, 5.0)))
    asked = asked_in_any_order(lambda case: answer_array(transition(case[0].copy(), *case[1])), cases)
    for (counts, (dt, new_dt)), got in asked:
        assert np.isfinite(got).all(), "NaN (a change may never have been seen)"
        assert close(got, _over(counts, dt, new_dt), atol=1e-5), "wrong for other counts and times"
    got = answer_array(transition(np.array([[40, 0], [0, 7]]), 0.1, 0.3))
    assert np.isfinite(got).all(), "NaN where no change was ever seen"
    assert close(got, np.eye(2), atol=1e-5), "where no change was ever seen the matrix is the identity"


@hidden
@keeping
def check_half_life(half_life: Callable) -> None:
    """Measure it on the matrix itself."""
    for counts, dt in in_any_order(product(_counts(17), (0.1, 0.5))):
        M = _over(counts, dt, answer_number(half_life(counts.copy(), dt)))
        message = "wrong for other counts or another `dt`: two beliefs must come half as close"
        assert close(M[0, 0] - M[1, 0], 0.5, atol=1e-4), message


@hidden
@keeping
def check_build_map(build_map: Callable) -> None:
    """Take maps of several sizes, scans with gaps of several lengths, and a single scan."""
    for shape, first in in_any_order((((9, 4, 3), 0.5), ((6, 2, 7), 0.1), ((1, 3, 3), 0.3))):
        rng = generator(1900 + shape[0])
        occupied, free = rng.uniform(0.05, 0.95, size=(2, *shape))
        silent = rng.random(shape) < 0.4
        occupied[silent] = free[silent] = 0.5
        counts = np.array([[300, 100], [20, 180]])
        gaps = rng.choice([0.05, 0.1, 0.35], size=shape[0] - 1)
        matrices = np.array([_over(counts, 0.1, gap) for gap in gaps]).reshape(-1, 2, 2)
        got = answer_array(build_map(occupied.copy(), free.copy(), matrices.copy(), first=first))
        assert got.shape == shape, "another shape"
        expected = _maps(occupied, free, first, matrices)
        assert close(got[0], expected[0]), "the first map is wrong"
        assert close(got, expected), "wrong after scans with gaps of several lengths"


def _maps(occupied: np.ndarray, free: np.ndarray, first: float, matrices: np.ndarray) -> np.ndarray:
    p, maps = np.full(occupied.shape[1:], first), []
    for M, o, f in zip([np.eye(2), *matrices], occupied, free, strict=True):
        p = (1 - p) * M[0, 1] + p * M[1, 1]
        p = p * o / (p * o + (1 - p) * f)
        maps.append(p)
    return np.array(maps)

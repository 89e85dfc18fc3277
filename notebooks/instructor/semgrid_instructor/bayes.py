"""Hidden tests of exercise 01, Bayes' rule on a line: filterpy and the package itself are the reference."""

from collections.abc import Callable

import numpy as np
from filterpy import discrete_bayes
from scipy.linalg import expm

from semgrid_edu.answers import answer_array, answer_number
from semgrid_edu.occupancy import CmcdotParams, transition_matrix
from semgrid_instructor import close, generator, hidden, keeping


def _check_locate(locate: Callable, says_pole: bool) -> None:
    """Longer roads, other sensors, poles as an array, and a cell that is impossible.

    Silence is judged by what the answer itself makes of a sensor that says "pole" as often as this one says nothing.
    """
    rng = generator(11)
    for n_cells in (5, 30):
        belief = rng.dirichlet(np.ones(n_cells))
        belief[2] = 0
        belief /= belief.sum()
        poles = rng.choice(n_cells, size=3, replace=False)
        hit, false_alarm = rng.uniform(0.6, 0.95), rng.uniform(0.05, 0.3)
        got = answer_array(locate(belief.copy(), says_pole, poles.copy(), hit, false_alarm))
        assert got.shape == belief.shape, f"shape {got.shape} instead of {belief.shape}"
        if says_pole:
            assert got[2] == 0, "what was impossible must stay impossible"
            expected = discrete_bayes.update(np.where(np.isin(np.arange(n_cells), poles), hit, false_alarm), belief)
        else:
            expected = answer_array(locate(belief.copy(), True, poles.copy(), 1 - hit, 1 - false_alarm))
            elsewhere = answer_array(locate(belief.copy(), False, (poles + 1) % n_cells, hit, false_alarm))
            assert not close(got, elsewhere), "it doesn't matter where the poles are"
            as_pole = answer_array(locate(belief.copy(), True, poles.copy(), hit, false_alarm))
            assert not close(got, as_pole), "it doesn't matter what the sensor says"
        assert close(got, expected), f"wrong after a reading with {n_cells} cells and three poles"


@hidden
@keeping
def check_locate_pole(locate: Callable) -> None:
    """Let the sensor say "pole"."""
    _check_locate(locate, says_pole=True)


@hidden
def check_locate_nothing(locate: Callable) -> None:
    """Let the sensor say "nothing"."""
    _check_locate(locate, says_pole=False)


@hidden
def check_predict_ring(predict: Callable) -> None:
    """Kernels of other lengths, up to once round the ring."""
    rng = generator(12)
    for n_cells, reach in ((9, 5), (6, 6), (4, 2)):
        belief, moved = rng.dirichlet(np.ones(n_cells)), rng.dirichlet(np.ones(reach))
        expected = sum(m * np.roll(belief, d) for d, m in enumerate(moved))
        got = answer_array(predict(belief.copy(), moved.copy()))
        assert got.shape == belief.shape, f"shape {got.shape} instead of {belief.shape}"
        assert close(got.sum(), 1), "probability is lost or made (a kernel may have any length)"
        assert close(got, expected), "sums are right, values are not (a kernel may have any length)"


@hidden
def check_predict_wall(predict: Callable) -> None:
    """Drive moves that would end far behind the wall, judged also by what the answer itself makes of a long ring."""
    rng = generator(13)
    for n_cells, reach in ((7, 3), (5, 5)):
        belief, moved = rng.dirichlet(np.ones(n_cells)), rng.dirichlet(np.ones(reach))
        got = answer_array(predict(belief.copy(), moved.copy(), ring=False))
        assert got.shape == belief.shape, f"shape {got.shape} instead of {belief.shape}"
        assert not close(got, belief), "nothing has moved"
        turned = answer_array(predict(belief[::-1].copy(), moved.copy(), ring=False))
        assert not close(got, turned), "it doesn't matter what was believed before"
        beyond = np.convolve(belief, moved)
        expected = np.append(beyond[: n_cells - 1], beyond[n_cells - 1 :].sum())
        wide = answer_array(predict(np.pad(belief, reach), moved.copy()))
        first, last = reach, reach + n_cells - 1
        by_ring = np.concatenate([[wide[: first + 1].sum()], wide[first + 1 : last], [wide[last:].sum()]])
        right = close(got, expected) or close(got, by_ring)
        assert right or close(got.sum(), 1), "probability is lost at the wall (moves of three and more cells?)"
        assert right, "sums are right, values are not (moves of three and more cells?)"


@hidden
def check_follow(follow: Callable) -> None:
    """Four states, the package's matrix, and a drive of thousands of scans."""
    rng = generator(14)
    M = transition_matrix(CmcdotParams(), dt=0.1)
    likelihoods = rng.uniform(0.05, 0.9, size=(3000, 4))
    likelihoods[::7] = 0.25
    belief = np.array([0.4, 0.3, 0.2, 0.1])
    got = answer_array(follow(belief.copy(), likelihoods.copy(), M.copy()))
    assert got.shape == likelihoods.shape, f"shape {got.shape} instead of {likelihoods.shape}"
    for k, likelihood in enumerate(likelihoods[:20]):
        belief = discrete_bayes.update(likelihood, belief @ M)
        assert close(got[k], belief), f"wrong from scan {k} on, with four states"
    assert np.isfinite(got).all(), "NaN after many scans: unnormalised products end at zero"
    assert close(got.sum(axis=1), 1), "after many scans the belief no longer sums to 1"


@hidden
def check_transition(transition: Callable) -> None:
    """Other rates and times; a world that never changes, and one that only ever gains."""
    slow, fast = generator(16).uniform((0.01, 0.5), (0.4, 3.0))
    for appears, vanishes, dt in ((slow, fast, 0.1), (fast, slow, 10.0), (slow, 0.0, 1.0), (0.0, 0.0, 1.0)):
        R = np.array([[-appears, appears], [vanishes, -vanishes]])
        got = answer_array(transition(appears, vanishes, dt))
        assert np.isfinite(got).all(), "NaN (a rate may be 0, and so may both)"
        assert close(got, expm(R * dt), atol=1e-5), "wrong for other rates and times, such as 0 or very long ones"


@hidden
def check_half_life(half_life: Callable) -> None:
    """Measure it on the matrix itself."""
    slow, fast = generator(17).uniform((0.1, 0.8), (0.5, 3.0))
    for appears, vanishes in ((slow, fast), (fast, slow), (0.0, slow), (fast, 0.0)):
        R = np.array([[-appears, appears], [vanishes, -vanishes]])
        M = expm(R * answer_number(half_life(appears, vanishes)))
        left = M[0, 0] - M[1, 0]
        assert close(left, 0.5, atol=1e-4), "wrong for other rates: two beliefs must come half as close"


@hidden
def check_fuse(fuse: Callable) -> None:
    """Beams in any order, and so many that a product of all would end at zero."""
    rng = generator(15)
    for n_beams, n_states in ((3, 2), (6, 4), (3000, 3)):
        first = rng.uniform(0.05, 0.3, size=(n_beams, n_states))
        beams = np.concatenate([rng.permutation(n_beams), rng.integers(0, n_beams, size=2 * n_beams)])
        likelihoods = np.concatenate([first[beams[:n_beams]], rng.uniform(0.05, 1, size=(2 * n_beams, n_states))])
        belief = rng.dirichlet(np.ones(n_states))
        log_product = np.log(belief) + np.log(first).sum(axis=0)
        expected = np.exp(log_product - log_product.max())
        got = answer_array(fuse(belief.copy(), likelihoods.copy(), beams.copy()))
        assert np.isfinite(got).all(), "NaN with thousands of beams: the product of all likelihoods is zero"
        assert close(got, expected / expected.sum()), "wrong belief (rows of one beam need not be neighbours)"

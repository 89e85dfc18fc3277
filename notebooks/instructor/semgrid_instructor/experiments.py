"""Hidden tests of exercise 12, the experiments: the package's metrics and formulas written here are the reference."""

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from semgrid_edu.metrics import METRICS, class_accuracy
from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_edu.workshop.scoring.confusions import drive_confusions
from semgrid_edu.workshop.scoring.statistics import drive_interval
from semgrid_instructor import close, generator, hidden


def _matrices(seed: int, n: int, n_classes: int) -> NDArray[np.int64]:
    """Return confusion matrices of drives of unequal size, in each of which all classes occur."""
    rng = generator(seed)
    size = rng.integers(1, 8, (n, 1, 1))
    return size * (rng.integers(1, 9, (n, n_classes, n_classes)) + 15 * np.eye(n_classes, dtype=int))


@hidden
def check_drive_scores(drive_scores: Callable) -> None:
    """More classes, drives of one frame; classes that are called but don't occur, or never called, or never right."""
    counts = _matrices(120, 9, 4)
    counts[[1, 4, 7], 2] = 0
    counts[5, :, 1] = 0
    counts[3, [0, 2], [0, 2]] = 0
    drives = ["0003", "0001", "0003", "0002", "0001", "0009", "0002", "0001", "0003"]
    names, matrices = list(dict.fromkeys(drives)), drive_confusions(counts, drives)
    for least in (1, min(matrix.sum(axis=1).max() for matrix in matrices)):
        got = drive_scores(counts.copy(), list(drives), int(least))
        assert isinstance(got, dict), "no dictionary"
        assert set(got) == set(names), "other drives"
        for name, matrix in zip(names, matrices, strict=True):
            enough = np.where(matrix.sum(axis=1, keepdims=True) >= least, matrix, 0)
            absent = " that lacks a class" if (matrix.sum(axis=1) == 0).any() else ""
            score = answer_number(got[name])
            assert close(score, class_accuracy(enough)), "a wrong score, four classes, of a drive" + absent


@hidden
def check_hochberg(hochberg: Callable) -> None:
    """One to twelve statements, sure and doubtful, and some near their limits, equal ones among them; other levels."""
    rng = generator(119)
    for count in rng.integers(1, 13, 60):
        for level in (0.025, 0.1):
            near = level / np.arange(1, count + 1) * rng.uniform(0.8, 1.3, count)
            for p_values in (rng.beta(0.3, 3, count), rng.permutation(near), rng.choice(near, 2 * count)):
                wanted = _hochberg(p_values, level)
                got = answer_array(hochberg(p_values.tolist(), level)).ravel().astype(bool)
                right = got.shape == wanted.shape and (got == wanted).all()
                assert right, "other statements are rejected"


def _hochberg(p_values: NDArray, level: float) -> NDArray[np.bool_]:
    """Return what Hochberg's correction rejects, by adjusted p-values."""
    order = np.argsort(p_values)[::-1]
    adjusted = np.minimum.accumulate(p_values[order] * np.arange(1, len(p_values) + 1))
    found = np.zeros(len(p_values), np.bool_)
    found[order] = adjusted <= level
    return found


@hidden
def check_towns(town_interval: Callable) -> None:
    """Other numbers of drives, towns and classes, towns of unlike size; other metrics and levels."""
    for seed, (n, n_classes, n_towns) in enumerate(((6, 2, 3), (12, 4, 5), (25, 3, 8))):
        matrices, rng = _matrices(121 + seed, n, n_classes), generator(131 + seed)
        number = np.concatenate([np.arange(n_towns), rng.integers(0, n_towns, n - n_towns)])
        rng.shuffle(number)
        pooled = np.stack([matrices[number == g].sum(axis=0) for g in range(n_towns)])
        for (name, metric), level in product(METRICS.items(), (0.95, 0.8)):
            got = answer_array(town_interval(matrices.copy(), [f"town-{g}" for g in number], metric, level)).ravel()
            without = [metric(np.delete(pooled, g, axis=0).sum(axis=0)) for g in range(n_towns)]
            wanted = drive_interval(pooled[None], metric, level)
            _compare(got, [wanted, _around(wanted[1], without, level, wanted[1])], name)


@hidden
def check_paired(paired: Callable, jackknife: Callable) -> None:
    """Other numbers of drives and classes, other metrics and levels; or what the jackknife of task 3 makes of them."""
    for seed, (n, n_classes) in enumerate(((4, 2), (15, 4))):
        a = _matrices(124 + seed, n, n_classes)
        b = a + generator(127 + seed).integers(0, 6, a.shape)
        for (name, metric), level in product(METRICS.items(), (0.95, 0.8)):
            got = answer_array(paired(a.copy(), b.copy(), metric, level)).ravel()
            share = _share(metric)
            middle = share((a.sum(0), b.sum(0)))
            without = [share((np.delete(a, v, axis=0).sum(0), np.delete(b, v, axis=0).sum(0))) for v in range(n)]
            try:
                _compare(got, [_around(middle, without, level, about) for about in (np.mean(without), middle)], name)
            except AssertionError:
                if not _is_share(got, middle) or not close(got, _by_own(jackknife, a, b, share, level)):
                    raise


def _share(metric: Callable) -> Callable:
    """Return the share of the second matrix' errors that the first saves."""
    return lambda two: (metric(two[0]) - metric(two[1])) / (1 - metric(two[1]))


def _is_share(got: NDArray, wanted: float) -> bool:
    """Return whether these may be the ends and the middle of an interval that is made with a wrong jackknife."""
    return got.shape == (3,) and np.ptp(got) > 0 and np.abs(got - wanted).min() < abs(wanted) / 2


def _by_own(jackknife: Callable, a: NDArray, b: NDArray, share: Callable, level: float) -> NDArray:
    """Return what the jackknife of task 3 gives for the share; NaN where it gives nothing."""
    try:
        pairs, names = np.stack([a, b], axis=1), [f"drive-{v}" for v in range(len(a))]
        return answer_array(jackknife(pairs, names, share, level)).reshape(3)
    except Exception:
        return np.full(3, np.nan)


def _around(score: float, without: list[float], level: float, about: float) -> tuple[float, float, float]:
    """Return the interval of a jackknife that measures deviations from `about`."""
    n = len(without)
    half = stats.t.ppf((1 + level) / 2, n - 1) * np.sqrt((n - 1) / n * ((np.array(without) - about) ** 2).sum())
    return score - half, score, score + half


def _compare(got: NDArray, variants: list[tuple], where: str) -> None:
    """Compare an interval with variants of the jackknife: a width that is one per cent off is three times too far."""
    assert got.shape == (3,), "not three numbers"
    assert close(got[1], variants[0][1], atol=1e-6), where + ": the number in the middle is wrong"
    assert any(close(got, wanted, rtol=0, atol=(wanted[2] - wanted[0]) / 600) for wanted in variants), (
        where + ": wrong width: does it follow the level and the number of what is left out?"
    )

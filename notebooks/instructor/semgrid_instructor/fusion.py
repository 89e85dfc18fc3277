"""Hidden tests of exercise 08, fusion and training: counters, scipy and unrolled sums are the reference.

Nothing here imports PyTorch, which takes a fresh kernel longer than all tests together.
"""

from collections import Counter
from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax

from semgrid_edu.workshop.course.answers import answer_array
from semgrid_instructor import close, generator, hidden, in_any_order, keeping


def _columns(seed: int, n_rows: int, n_cells: int) -> tuple[NDArray, NDArray]:
    """Return columns (n, N) of few values, and a truth that depends on them; some of it unlabelled."""
    rng = generator(seed)
    columns = rng.integers(0, 3, (n_rows, n_cells))
    truth = (columns * (1 + np.arange(n_rows))[:, None]).sum(axis=0) % 5
    truth = np.where(rng.random(n_cells) < 0.3, rng.integers(0, 5, n_cells), truth)
    truth[rng.random(n_cells) < 0.2] = 255
    return columns, truth


def _named(columns: NDArray, truth: NDArray, new: NDArray) -> list[int]:
    """Return the class of each new cell, by counters of every beginning of a column."""
    counters: dict[tuple, Counter] = {}
    for *column, c in np.vstack([columns, truth])[:, truth != 255].T.tolist():
        for n in range(len(column) + 1):
            counters.setdefault(tuple(column[:n]), Counter())[c] += 1
    named = []
    for column in new.T.tolist():
        known = next(tuple(column[:n]) for n in range(len(column), -1, -1) if tuple(column[:n]) in counters)
        named.append(min(counters[known], key=lambda c, counts=counters[known]: (-counts[c], c)))
    return named


@hidden
@keeping
def check_name_cells(name_cells: Callable) -> None:
    """One, two and four rows; new cells are among the labelled ones."""
    for seed, n_rows, n_cells in ((80, 1, 40), (81, 2, 90), (82, 4, 60)):
        columns, truth = _columns(seed, n_rows, n_cells)
        new = columns[:, truth != 255][:, :25]
        got = answer_array(name_cells(columns, truth, new)).ravel()
        assert close(got, _named(columns, truth, new)), "wrong classes with " + (
            "one row" if n_rows == 1 else "several rows"
        )


@hidden
def check_way_out(name_cells: Callable) -> None:
    """Try columns that agree with labelled ones in all rows, in some, or in none; labels that are large numbers."""
    columns, truth = _columns(83, 3, 80)
    rng = generator(84)
    new = rng.integers(0, 5, (3, 60))
    new[:, :5] = columns[:, truth != 255][:, :5]
    new[0, -5:] = 255
    got = answer_array(name_cells(columns.copy(), truth.copy(), new.copy())).ravel()
    assert close(got, _named(columns, truth, new)), "wrong where a column hasn't been met"


def _maps(planes: NDArray, theta: NDArray, beta: NDArray) -> NDArray:
    """Return the reduced maps."""
    return np.tensordot(theta, planes, axes=2) + np.asarray(beta)[:, None, None]


BUGS = {
    "planes, transposed theta": ("planes", lambda p, t, b: np.einsum("kcd,khw->cdhw", t[::-1], b)),
    "planes, first map": ("planes", lambda p, t, b: np.einsum("cd,hw->cdhw", t[0], b[0])),
    "planes, one sign": ("planes", lambda p, t, b: -np.einsum("kcd,khw->cdhw", t, b)),
    "theta, one cell": ("theta", lambda p, t, b: np.einsum("k,cd->kcd", b[:, 0, 0], p[:, :, 0, 0])),
    "theta, nothing from behind": ("theta", lambda p, t, b: np.broadcast_to(p.sum(axis=(2, 3)), t.shape)),
    "theta, mean": ("theta", lambda p, t, b: np.einsum("khw,cdhw->kcd", b, p) / b[0].size),
    "beta, mean": ("beta", lambda p, t, b: b.mean(axis=(1, 2))),
    "beta, reversed": ("beta", lambda p, t, b: b.sum(axis=(1, 2))[::-1]),
    "none": ("none", None),
}
"""What is wrong in a way back, and what it returns in place of the right derivative."""


def _way_back(bug: str) -> Callable:
    """Return a way back with one bug."""
    name, wrong = BUGS[bug]

    def back(planes: NDArray, theta: NDArray, from_maps: NDArray) -> tuple[NDArray, ...]:
        right = {
            "planes": np.tensordot(theta, from_maps, axes=(0, 0)),
            "theta": np.tensordot(from_maps, planes, axes=((1, 2), (2, 3))),
            "beta": from_maps.sum(axis=(1, 2)),
        }
        return tuple((right | ({name: wrong(planes, theta, from_maps)} if wrong else {})).values())

    return back


def _inputs(seed: int, size: tuple[int, ...]) -> tuple[NDArray, NDArray, NDArray]:
    """Return planes, theta and beta for K, C, D, H, W."""
    rng, (n_reduced, n_classes, n_planes, height, width) = generator(seed), size
    planes = rng.normal(size=(n_classes, n_planes, height, width))
    return planes, rng.normal(size=(n_reduced, n_classes, n_planes)), rng.normal(size=n_reduced)


@hidden
@keeping
def check_wrong_derivative(wrong_derivative: Callable) -> None:
    """Other sizes and other bugs; twice without any."""
    for seed, bug in in_any_order(enumerate([*BUGS, "none"])):
        told = wrong_derivative(_maps, _way_back(bug), *_inputs(85 + seed, (3, 2, 2, 2, 2 + seed % 3)))
        assert told == BUGS[bug][0], "it names the wrong derivative, or none"


@hidden
def check_one_number(wrong_derivative: Callable) -> None:
    """One number of a derivative is wrong by three per cent, or all by rounding."""

    def slightly(part: int, place: int, factor: float) -> Callable:
        def back(*arguments: NDArray) -> list[NDArray]:
            derivatives = [np.array(each) for each in _way_back("none")(*arguments)]
            derivatives[part].flat[place] *= factor
            return derivatives

        return back

    missed, rounding = "it misses one number that is wrong by three per cent", "it takes rounding for an error"
    wrongs = (0, 1.03, missed), (2, 1.03, missed), (slice(None), 1 - 1e-9, rounding)
    parts = enumerate(("planes", "theta", "beta"))
    for (part, name), (place, factor, complaint) in in_any_order(product(parts, wrongs)):
        told = wrong_derivative(_maps, slightly(part, place, factor), *_inputs(97 + part, (3, 3, 1, 2, 1)))
        assert told == ("none" if complaint == rounding else name), complaint


def _random_cells(seed: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return logits, truth of which a third is unlabelled, and the weights of the classes."""
    rng = generator(seed)
    n_classes = int(rng.integers(3, 8))
    truth = rng.integers(0, n_classes, (5, 4))
    truth[rng.random((5, 4)) < 0.3] = 255
    return rng.normal(size=(n_classes, 5, 4)), truth, rng.uniform(0.2, 4, n_classes)


def _loss(logits: NDArray, truth: NDArray, alpha: NDArray) -> float:
    """Return the weighted loss."""
    counted = (truth == np.arange(len(alpha))[:, None, None]) * alpha[:, None, None]
    return float(-(counted * log_softmax(logits, axis=0)).sum() / counted.sum())


@hidden
@keeping
def check_loss_back(loss_back: Callable) -> None:
    """Compare with a nudge of each logit; 8-bit labels; a class of weight 0."""
    for seed in range(106, 109):
        logits, truth, alpha = _random_cells(seed)
        got = answer_array(loss_back(logits, truth, alpha))
        assert got.shape == logits.shape, "another shape"
        wanted = np.zeros(logits.shape)
        for place in np.ndindex(logits.shape):
            nudge = np.zeros(logits.shape)
            nudge[place] = 1e-5
            wanted[place] = (_loss(logits + nudge, truth, alpha) - _loss(logits - nudge, truth, alpha)) / 2e-5
        assert close(got, wanted, rtol=1e-4), "it isn't what a nudge of each logit does to the loss"
    assert close(answer_array(loss_back(logits, truth.astype(np.uint8), alpha)), wanted, rtol=1e-4), "wrong with bytes"


@hidden
def check_large_logits(loss_back: Callable) -> None:
    """Add ten thousands to all logits of a cell, to each cell another number; let the truth trail by hundreds."""
    for seed in range(109, 112):
        logits, truth, alpha = _random_cells(seed)
        shift = np.linspace(-40_000, 40_000, 20).reshape(5, 4)
        small, large = (answer_array(loss_back(logits + add, truth.copy(), alpha.copy())) for add in (0, shift))
        other = answer_array(loss_back(2 * logits, truth.copy(), alpha.copy()))
        assert not close(small, other), "the derivatives don't depend on the logits"
        assert close(large, small), "the derivatives change where the same is added to all logits of a cell"
        steep = 500 * logits
        milder = np.maximum(steep - steep.max(axis=0), -40)  # the same soft-max, as far as float64 can tell
        far, near = (answer_array(loss_back(each, truth.copy(), alpha.copy())) for each in (steep, milder))
        assert close(far, near), "wrong when logits are hundreds apart"


def _trained(seed: int, rates: NDArray, kappa: float, n: int) -> tuple[NDArray, NDArray]:
    """Return path and gradients of a training run; delta is summed over all earlier gradients."""
    rng = generator(seed)
    gradients, path = rng.normal(size=(len(rates), n)), [rng.normal(size=n)]
    for k, eta in enumerate(rates):
        path.append(path[-1] - eta * sum(kappa ** (k - i) * gradients[i] for i in range(k + 1)))
    return np.array(path), gradients


@hidden
@keeping
def check_rate_and_momentum(rate_and_momentum: Callable) -> None:
    """Long paths and short ones, one parameter and many, without momentum and with much."""
    for seed, (eta, kappa, steps, n) in enumerate(
        [(0.05, 0.9, 8, 3), (1.5, 0.0, 4, 2), (0.01, 0.99, 30, 1), (0.3, 0.5, 2, 5)]
    ):
        eta, kappa = (eta, kappa) * generator(140 + seed).uniform(0.6, 1, 2)
        path, gradients = _trained(112 + seed, np.full(steps, eta), kappa, n)
        got = answer_array(rate_and_momentum(path, gradients)).ravel()
        assert close(got, [eta, kappa], rtol=1e-4, atol=1e-5), "wrong for another path"


def _theta(features: NDArray, truth: NDArray, alpha: NDArray, rates: tuple[float, float], steps: int) -> NDArray:
    """Return the weights after some steps; delta is the sum of all earlier gradients, cell by cell."""
    (eta, kappa), gradients = rates, []
    theta = np.zeros((len(alpha), len(features)))
    for step in range(steps):
        g = np.exp(log_softmax(theta @ features, axis=0))
        labelled = [j for j, c in enumerate(truth.tolist()) if c != 255]
        total = sum(alpha[truth[j]] for j in labelled)
        one_hot = np.eye(len(alpha))
        back = [alpha[truth[j]] / total * np.outer(g[:, j] - one_hot[truth[j]], features[:, j]) for j in labelled]
        gradients.append(np.sum(back, axis=0))
        theta = theta - eta * sum(kappa ** (step - k) * one for k, one in enumerate(gradients))
    return theta


@hidden
@keeping
def check_train(train: Callable) -> None:
    """Other numbers of classes, features, cells and steps; weights of classes, and unlabelled cells."""
    for seed, (n_classes, n_features, n_cells, steps, eta, kappa) in enumerate(
        [(3, 4, 30, 7, 0.3, 0.9), (5, 2, 12, 3, 0.8, 0.0), (14, 6, 50, 5, 0.1, 0.5)]
    ):
        rng = generator(120 + seed)
        features, alpha = rng.normal(size=(n_features, n_cells)), rng.uniform(0.3, 4, n_classes)
        truth = rng.integers(0, n_classes, n_cells)
        truth[rng.random(n_cells) < 0.3] = 255
        got = answer_array(train(features, truth, alpha, steps, eta, kappa))
        wanted = _theta(features, truth, alpha, (eta, kappa), steps)
        assert close(got, wanted, rtol=1e-4, atol=1e-5), "wrong weights after some steps"


def _cells(seed: int, n_cells: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return o (4, N), height (N,) and truth (N,): of four classes, three share a state, at heights of their own."""
    names = generator(seed).permutation(10)[:4]
    rng = np.random.default_rng([seed, n_cells])
    kind = rng.choice(4, n_cells, p=[0.4, 0.25, 0.2, 0.15])
    state = np.where(rng.random(n_cells) < 0.1, rng.integers(0, 4, n_cells), kind > 0)
    o = np.full((4, n_cells), 0.05)
    o[state, np.arange(n_cells)] = 0.85
    height = np.array([0.05, 0.75, 1.75, 3.6])[kind] + rng.uniform(-0.04, 0.2, n_cells)
    height[rng.random(n_cells) < 0.1] = np.nan
    return o, height, names[kind]


@hidden
@keeping
def check_name_new(name_new: Callable) -> None:
    """Other classes at other heights; most cells unlabelled, some without a return."""
    for seed in (130, 131):
        o, height, truth = _cells(seed, 3000)
        truth = np.where(np.arange(3000) % 3 > 0, 255, truth)
        new_o, new_height, wanted = _cells(seed, 1000)
        got = answer_array(name_new(o, height, truth, new_o, new_height))
        assert got.shape == wanted.shape, "another number of classes than of cells"
        assert (got == wanted).mean() > 0.8, "too few cells are right on another street"

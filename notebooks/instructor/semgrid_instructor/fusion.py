"""Hidden tests of exercise 08, reduction, fusion and training: numpy, scipy and unrolled sums are the reference.

Nothing here imports PyTorch, which takes a fresh kernel longer than all tests together.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_softmax

from semgrid_edu.answers import answer_array, answer_number
from semgrid_instructor import close, generator, hidden, keeping

SIZES = ((3, 4, 5, 2, 3), (1, 2, 1, 4, 1), (5, 1, 3, 3, 2))
"""K, C, D, H, W of each case: all different, and one of each where it matters."""


def _reduction(size: tuple[int, ...], seed: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return random planes, theta, beta and what comes from behind."""
    n_reduced, n_classes, n_planes, height, width = size
    rng = generator(seed)
    planes = rng.normal(size=(n_classes, n_planes, height, width))
    theta, beta = rng.normal(size=(n_reduced, n_classes, n_planes)), rng.normal(size=n_reduced)
    return planes, theta, beta, rng.normal(size=(n_reduced, height, width))


@hidden
@keeping
def check_reduce_planes(reduce_planes: Callable) -> None:
    """Other numbers of maps, classes and planes, several rows."""
    for seed, size in enumerate(SIZES):
        planes, theta, beta, blamed = _reduction(size, 80 + seed)
        got = answer_array(reduce_planes(planes.copy(), theta.copy(), beta.copy()))
        assert got.shape == blamed.shape, f"shape {got.shape} instead of {blamed.shape}"
        wanted = np.tensordot(theta, planes, axes=2) + beta[:, None, None]
        assert close(got, wanted), "wrong sums when C, D and K are other numbers"


def _nudged(at: NDArray, total: Callable[[NDArray], float]) -> NDArray:
    """Return the derivative of a sum that is linear in each of its numbers: exact, however large the nudge."""
    units = np.eye(at.size).reshape(at.size, *at.shape)
    return np.array([total(at + unit) - total(at) for unit in units]).reshape(at.shape)


@hidden
@keeping
def check_theta_bar(reduce_back: Callable) -> None:
    """Compare with what a nudge of each weight and bias does."""
    for seed, size in enumerate(SIZES):
        planes, theta, beta, blamed = _reduction(size, 83 + seed)
        got = reduce_back(planes.copy(), theta.copy(), blamed.copy())
        theta_bar, beta_bar = map(answer_array, got[:2])
        assert theta_bar.shape == theta.shape, f"by theta: shape {theta_bar.shape} instead of {theta.shape}"
        wanted = _nudged(theta, lambda t, p=planes, b=blamed: (np.tensordot(t, p, axes=2) * b).sum())
        assert close(theta_bar, wanted), "wrong derivatives by theta when C, D and K are other numbers"
        wanted = _nudged(beta, lambda t, b=blamed: (t[:, None, None] * b).sum())
        assert close(beta_bar, wanted), "wrong derivatives by beta when there are several rows or maps"


@hidden
def check_planes_bar(reduce_back: Callable) -> None:
    """Compare with what a nudge of each score does."""
    for seed, size in enumerate(SIZES):
        planes, theta, _, blamed = _reduction(size, 86 + seed)
        planes_bar = answer_array(reduce_back(planes.copy(), theta.copy(), blamed.copy())[2])
        assert planes_bar.shape == planes.shape, f"by planes: shape {planes_bar.shape} instead of {planes.shape}"
        wanted = _nudged(planes, lambda p, t=theta, b=blamed: (np.tensordot(t, p, axes=2) * b).sum())
        assert close(planes_bar, wanted), "wrong derivatives by the planes when C, D and K are other numbers"


def _maps(seed: int, n_classes: int) -> list[NDArray]:
    """Return maps of different sizes, unevenly filled; each but the first lacks a class or more."""
    rng = generator(seed)
    maps = []
    for number in range(n_classes + 1):
        share = rng.dirichlet(np.full(n_classes, 0.7))
        classes = rng.choice(n_classes, size=rng.integers(4, 12, 2), p=share)
        classes[classes == number] = (number + 1) % n_classes
        classes[rng.random(classes.shape) < 0.1 * number] = 255
        maps.append(classes)
    maps[0].flat[:n_classes] = np.arange(n_classes)
    return maps


def _balanced(maps: list[NDArray], n_classes: int) -> NDArray[np.float64]:
    """Return the weights of the classes, those of absent ones 0."""
    counts = np.array([[(m == c).sum() for c in range(n_classes)] for m in maps])
    below = (counts > 0).T @ counts.sum(axis=1)
    occurs = below > 0
    f = counts.sum(axis=0)[occurs] / below[occurs]
    alpha = np.zeros(n_classes)
    alpha[occurs] = np.median(f) / f
    return alpha


@hidden
@keeping
def check_balance(balance: Callable) -> None:
    """Try maps of different sizes; a map without any label; odd and even numbers of classes; 8-bit labels."""
    for seed, n_classes in ((89, 3), (90, 6), (91, 7)):
        maps = _maps(seed, n_classes)
        wanted = _balanced(maps, n_classes)
        assert close(answer_array(balance([m.copy() for m in maps], n_classes)), wanted), (
            "wrong with maps of different sizes"
        )
        bare = [*maps, np.full((4, 5), 255)]
        assert close(answer_array(balance(bare, n_classes)), wanted), (
            "a map in which nothing is labelled changes the weights"
        )
        small = [m.astype(np.uint8) for m in maps]
        assert close(answer_array(balance(small, n_classes)), wanted), "wrong when the labels are 8-bit numbers"


@hidden
def check_absent(balance: Callable) -> None:
    """Let several classes be absent, class 0 among them: the others weigh as much as when all occur."""
    maps = [m[:4, :4] for m in _maps(92, 4)]
    maps[1][0] = 0, 1, 2, 3
    raised = [m + np.where(m == 255, 0, 2) for m in maps]
    wanted = answer_array(balance([m.copy() for m in maps], 4))
    got = answer_array(balance(raised, 9))
    assert np.isfinite(got).all(), "a weight isn't finite when several classes are absent"
    assert close(got, [0, 0, *wanted, 0, 0, 0]), "wrong when several classes, 0 among them, are absent"
    lonely = answer_array(balance([np.full((2, 3), 1)], 3))
    assert lonely[1] > 0, "a class that is alone has a weight"
    assert lonely[[0, 2]].tolist() == [0, 0], "the weight of a class that doesn't occur is 0"


def _random_cells(seed: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return logits, truth of which a third is unlabelled, and the weights of the classes."""
    rng = generator(seed)
    n_classes = int(rng.integers(3, 8))
    truth = rng.integers(0, n_classes, (5, 4))
    truth[rng.random((5, 4)) < 0.3] = 255
    return rng.normal(size=(n_classes, 5, 4)), truth, rng.uniform(0.2, 4, n_classes)


@hidden
@keeping
def check_weighted_loss(weighted_loss: Callable) -> None:
    """Random maps of several classes and rows."""
    for seed in range(93, 97):
        logits, truth, alpha = _random_cells(seed)
        counted = (truth == np.arange(len(alpha))[:, None, None]) * alpha[:, None, None]
        wanted = -(counted * log_softmax(logits, axis=0)).sum() / counted.sum()
        got = answer_number(weighted_loss(logits, truth, alpha))
        assert close(got, wanted), "wrong with more classes, rows and unlabelled cells"


@hidden
def check_large_logits(weighted_loss: Callable) -> None:
    """Add thousands to all logits of a cell, to each cell another number; let the truth trail by hundreds."""
    for seed in range(97, 101):
        logits, truth, alpha = _random_cells(seed)
        shift = np.linspace(-4000, 4000, 20).reshape(5, 4)
        small, large = (answer_array(weighted_loss(logits + add, truth.copy(), alpha.copy())) for add in (0, shift))
        assert not close(small, answer_array(weighted_loss(2 * logits, truth.copy(), alpha.copy()))), (
            "the loss doesn't depend on the logits"
        )
        assert close(large, small), "the loss changes where the same is added to all logits of a cell"
        first, trail = np.zeros((5, 4), int), np.array([-600.0, *[0.0] * (len(alpha) - 1)])[:, None, None]
        far, half = (
            answer_array(weighted_loss(part * trail + 0 * logits, first.copy(), alpha.copy())) for part in (1, 0.5)
        )
        assert np.isfinite(far).all(), "no number when logits are hundreds apart"
        assert close(far, 2 * half, rtol=0.02), "wrong when logits are hundreds apart"


@hidden
@keeping
def check_momentum_step(momentum_step: Callable) -> None:
    """Take five steps of falling rate with a table of parameters, and compare with the sum over all of them."""
    rng = generator(101)
    start, gradients, kappa = rng.normal(size=(3, 2)), rng.normal(size=(5, 3, 2)), 0.7
    theta, delta, wanted = start.copy(), np.zeros((3, 2)), start.copy()
    for n, eta in enumerate(0.3 / np.arange(1, 6)):
        theta, delta = map(answer_array, momentum_step(theta, delta, gradients[n].copy(), eta, kappa))
        wanted = wanted - eta * sum(kappa ** (n - k) * gradients[k] for k in range(n + 1))
        assert np.shape(theta) == (3, 2), f"theta of shape (3, 2) became {np.shape(theta)}"
        assert close(theta, wanted), f"wrong after {n + 1} steps of falling rate"


@hidden
def check_cosine_rate(cosine_rate: Callable) -> None:
    """Try each step of seven: the square of half the angle's cosine is the same factor."""
    for step in range(7):
        wanted = 0.05 * np.cos(np.pi * step / 14) ** 2
        assert close(answer_number(cosine_rate(0.05, step, 7)), wanted), "wrong in other steps"

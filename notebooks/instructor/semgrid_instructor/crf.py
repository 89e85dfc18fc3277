"""Hidden tests of exercise 10, the CRF by hand: loops over pairs and labellings are the reference.

Nothing here imports the package's compiled parts, which take a fresh kernel longer than all tests together.
"""

from collections.abc import Callable
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_instructor import close, generator, hidden, keeping

W1, W2 = 4.0, 3.0
SIGMA_ALPHA, SIGMA_BETA, SIGMA_GAMMA = 3.2, 0.2, 1.2
REACH, UPDATES = 6, 5
"""What the setup cell of the exercise gives `refine`."""

SIZES = ((3, 4), (2, 5), (5, 3), (4, 1))
"""C and N of small cases: all numbers different, and a single cell."""


def _case(size: tuple[int, int], seed: int) -> tuple[NDArray, NDArray]:
    """Return random phi (C, N) and k (N, N); the diagonal of k is filled, because it must not count."""
    rng = generator(seed)
    k = rng.uniform(0, 1.5, (size[1], size[1]))
    return rng.exponential(size=size), np.triu(k, 1) + np.triu(k, 1).T + np.diag(rng.uniform(2, 7, size[1]))


def _energy(x: tuple[int, ...], phi: NDArray, k: NDArray) -> float:
    """Return E(x), one cell and one pair after the other."""
    pairs = sum(k[i, j] for i, j in combinations(range(len(x)), 2) if x[i] != x[j])
    return sum(phi[label, i] for i, label in enumerate(x)) + pairs


def _free_energy(Q: NDArray, phi: NDArray, k: NDArray, mu: NDArray) -> float:
    """Return F(Q) by its definition, the sum over all labellings."""
    F = 0.0
    for x in product(range(len(phi)), repeat=phi.shape[1]):
        probability = np.prod([Q[label, i] for i, label in enumerate(x)])
        pairs = sum(k[i, j] * mu[x[i], x[j]] for i, j in combinations(range(len(x)), 2))
        own = sum(phi[label, i] for i, label in enumerate(x))
        F += probability * (own + pairs + np.log(probability))
    return F


def _borders(n_classes: int, seed: int) -> NDArray:
    """Return a random price for each border of two classes, (C, C), symmetric, with zeros on its diagonal."""
    mu = np.triu(generator(seed).uniform(0.2, 3, (n_classes, n_classes)), 1)
    return mu + mu.T


@hidden
def check_tipping_prices(tipping_prices: Callable) -> None:
    """Other opinions; just below and just above each price, the four labellings written out must say so."""
    rng = generator(100)
    drawn = np.column_stack([rng.uniform(0.8, 0.95, 3), rng.uniform(0.25, 0.48, 3)])
    for p, q in ((0.95, 0.3), (0.7, 0.45), (0.99, 0.02), *drawn):
        got = answer_array(tipping_prices(p, q))
        assert got.shape == (2,), "another shape"
        for n, what in enumerate(("the most likely labelling", "cell 2")):
            for price, is_road in ((got[n] - 0.001, False), (got[n] + 0.001, True)):
                phi = -np.log([[p, q], [1 - p, 1 - q]])
                P = {x: np.exp(-_energy(x, phi, np.full((2, 2), price))) for x in product((0, 1), repeat=2)}
                by_itself = (P[0, 0] + P[1, 0]) / sum(P.values()) > 0.5
                says_road = (max(P, key=P.get) == (0, 0), by_itself)[n]
                assert says_road == is_road, what + " doesn't turn to road at your price"


@hidden
@keeping
def check_energy_change(energy_change: Callable) -> None:
    """Try every change of random labellings of other sizes."""
    for seed, size in enumerate(SIZES):
        phi, k = _case(size, 101 + seed)
        labels = generator(seed).integers(0, size[0], size[1])
        for i, label in product(range(size[1]), range(size[0])):
            after = labels.copy()
            after[i] = label
            wanted = _energy(after, phi, k) - _energy(labels, phi, k)
            got = answer_number(energy_change(labels.copy(), i, label, phi.copy(), k.copy()))
            assert close(got, wanted), "wrong with other numbers of cells and classes"


@hidden
@keeping
def check_marginals(marginals: Callable) -> None:
    """Try other sizes with nothing, one, two and all cells known; each marginal as a sum by itself."""
    for seed, size in enumerate(SIZES):
        phi, k = _case(size, 105 + seed)
        rng = generator(seed)
        for n_known in {0, 1, min(2, size[1]), size[1]}:
            cells = rng.permutation(size[1])[:n_known]
            known = {int(cell): int(rng.integers(size[0])) for cell in cells}
            got = answer_array(marginals(phi.copy(), k.copy(), dict(known)))
            assert got.shape == size, "another shape"
            labellings = [
                x for x in product(range(size[0]), repeat=size[1]) if all(x[i] == label for i, label in known.items())
            ]
            P = np.exp([-_energy(x, phi, k) for x in labellings])
            for label, i in np.ndindex(size):
                wanted = P[[x[i] == label for x in labellings]].sum() / P.sum()
                assert close(got[label, i], wanted), "wrong with " + (
                    "some cells known" if n_known else "no cell known"
                )


def _updated(Q: NDArray, phi: NDArray, k: NDArray, mu: NDArray) -> NDArray:
    """Return Q after one update of all cells at once."""
    return softmax(-phi - mu @ Q @ (k - np.diag(np.diag(k))), axis=0)


def _potts(n_classes: int) -> NDArray:
    """Return the price 1 for each border."""
    return 1 - np.eye(n_classes)


@hidden
@keeping
def check_update(update: Callable) -> None:
    """Other numbers of cells and classes, also where all classes of a cell are dear."""
    for seed, size in enumerate((*SIZES, (4, 6))):
        phi, k = _case(size, 109 + seed)
        phi = phi if seed < len(SIZES) else 12 + 5 * phi
        Q = softmax(generator(seed).normal(size=phi.shape), axis=0)
        for kind, mu in (("Potts", _potts(size[0])), ("other borders", _borders(size[0], 140 + seed))):
            got = answer_array(update(Q.copy(), phi.copy(), k.copy(), mu.copy()))
            assert got.shape == Q.shape, "another shape"
            right = close(got, _updated(Q, phi, k, mu))
            assert right, "wrong with other numbers of cells and classes, " + kind


@hidden
def check_update_limits(update: Callable) -> None:
    """Prices that are thousands apart from cell to cell, and prices of pairs of thousands."""
    rng = generator(113)
    phi = rng.normal(size=(3, 6)) + rng.choice([0, 800, 5000], size=6)
    phi[1, 2] = phi[0, 4] = np.inf
    Q = softmax(rng.normal(size=phi.shape), axis=0)
    k = np.exp(-np.abs(np.subtract.outer(range(6), range(6))))
    other = answer_array(update(Q[[1, 2, 0]], np.arange(18).reshape(3, 6)[::-1] / 6, k.copy(), _potts(3)))
    for prices in (0 * k, 3000 * k):
        got = answer_array(update(Q.copy(), phi.copy(), prices, _potts(3)))
        assert np.isfinite(got).all(), "a result isn't finite when prices are thousands"
    small = np.where(np.isinf(phi), np.inf, np.arange(18).reshape(3, 6) / 6)
    got, wanted = (answer_array(update(Q.copy(), small + more, k.copy(), _potts(3))) for more in (3000, 0))
    assert not close(other, wanted), "the same, whatever classes cost"
    alone = answer_array(update(Q.copy(), small, 0 * k, _potts(3)))
    assert not close(alone, wanted), "the same, whatever other cells say"
    rise = rng.uniform(0.5, 2, (3, 6))
    dearer = answer_array(update(Q.copy(), small + rise, k.copy(), _potts(3)))
    factor = dearer / np.maximum(wanted, 1e-99) * np.exp(rise)
    possible = np.isfinite(small).all(axis=0)
    assert close(factor[:, possible], factor[[1, 2, 0]][:, possible]), "what costs 1 more isn't e times less probable"
    assert close(got, wanted, atol=2e-3), "not the same when all prices are 3000 higher"


@hidden
@keeping
def check_free_energy(free_energy: Callable) -> None:
    """Compare with the definition, a sum over all labellings."""
    for seed, size in enumerate(SIZES):
        phi, k = _case(size, 114 + seed)
        Q = softmax(generator(seed).normal(size=size), axis=0)
        for kind, mu in (("Potts", _potts(size[0])), ("other borders", _borders(size[0], 150 + seed))):
            got = answer_number(free_energy(Q.copy(), phi.copy(), k.copy(), mu.copy()))
            right = close(got, _free_energy(Q, phi, k, mu))
            assert right, "wrong with other numbers of cells and classes, " + kind


@hidden
def check_free_energy_limits(free_energy: Callable) -> None:
    """Certain cells; an impossible class that gets a probability; a tiny probability that isn't 0."""

    def F(Q: list, phi: list) -> float:
        """Return the answer's free energy of two cells."""
        k = np.array([[3, 0.5], [0.5, 3]])
        return answer_number(free_energy(np.array(Q, float), np.array(phi, float), k, _potts(2)))

    a, b, c = generator(114).uniform(0.2, 0.9, 3)
    phi, eps = [[a, np.inf], [b, c]], 1e-12
    near = F([[1 - eps, eps], [eps, 1 - eps]], [[a, 9], [b, c]])
    assert close(F([[1, 0], [0, 1]], phi), near), "certain cells have no entropy, only their energy"
    assert np.isinf(F([[0.5, 0.5], [0.5, 0.5]], phi)), "an impossible class with a probability costs infinitely much"
    assert not close(F([[0.5, 0.5], [0.5, 0.5]], np.zeros((2, 2))), F([[1, 1], [0, 0]], np.zeros((2, 2)))), (
        "unsure cells and sure ones have the same free energy where all prices are 0"
    )
    none, little, less = (F([[q, 0], [1 - q, 1]], np.zeros((2, 2))) for q in (0, 1e-3, 1e-6))
    rise, step = abs(little - none), abs(less - none)
    assert 300 * step < rise < 800 * step, "a small probability q adds q log q, not a multiple of q"
    tiny = [[eps, 0], [1 - eps, 1]]
    paid = F(tiny, [[1e12, 0], [0, 0]]) - F(tiny, [[0, 0], [0, 0]])
    assert abs(paid) > 0.1, "a tiny probability isn't 0: times a large price it counts"


@hidden
@keeping
def check_weight_for(weight_for: Callable) -> None:
    """Random kernels of other sizes, odd and even; the median cell's payment, added up pair by pair."""
    for seed, size, total in ((118, 2, 1.0), (119, 5, 7.0), (120, 8, 0.5)):
        features = generator(seed).normal(size=(size, 2))
        K = np.exp(-((features[:, None] - features) ** 2).sum(axis=-1) / 2)
        w = answer_number(weight_for(K.copy(), total))
        paid = sorted(sum(w * K[i, j] for j in range(size) if j != i) for i in range(size))
        median = (paid[(size - 1) // 2] + paid[size // 2]) / 2
        assert close(median, total), "the median cell doesn't pay the total (of odd and of even numbers of cells)"


def _refined(log_g: NDArray, o: NDArray) -> NDArray:
    """Return the refined map from a matrix of all pairs, those out of reach set to 0."""
    classes, height, width = log_g.shape
    places, states = np.indices((height, width)).reshape(2, -1).T, o.reshape(4, -1).T
    apart, unlike = (((f[:, None] - f) ** 2).sum(axis=-1) for f in (places, states))
    near = (np.abs(places[:, None] - places) <= REACH).all(axis=-1)
    bilateral = near * np.exp(-apart / (2 * SIGMA_ALPHA**2) - unlike / (2 * SIGMA_BETA**2))
    spatial = near * np.exp(-apart / (2 * SIGMA_GAMMA**2))
    k = sum(w * K / np.sqrt(np.outer(K.sum(1), K.sum(1))) for w, K in ((W1, bilateral), (W2, spatial)))
    phi = -log_g.reshape(classes, -1)
    Q = np.exp(-phi)
    for _ in range(UPDATES):
        Q = _updated(Q, phi, k, _potts(classes))
    return Q.reshape(log_g.shape)


@hidden
def check_refine(refine: Callable) -> None:
    """Try maps wider and higher than the reach, with one class, one row or one column among them; float32 too."""
    for seed, (shape, dtype) in enumerate(
        product(((4, 9, 11), (3, 1, 15), (2, 14, 2), (1, 3, 3)), (np.float64, np.float32))
    ):
        rng = generator(121 + seed)
        g = softmax(1.5 * rng.normal(size=shape), axis=0).astype(dtype)
        o = np.moveaxis(rng.dirichlet(np.full(4, 0.3), shape[1:]), -1, 0).astype(dtype)
        log_g = np.log(g)
        got = answer_array(refine(log_g.copy(), o.copy()))
        assert got.shape == shape, "another shape"
        wanted = _refined(log_g.astype(float), o.astype(float))
        assert close(got, wanted, atol=2e-3), "wrong on a map of another size"

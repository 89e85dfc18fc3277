"""Hidden tests of the exercise on graphical models: the package's own inference is the reference."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from semgrid_edu.graphical import Factor, GraphicalModel, d_separated, enumerate_marginals
from semgrid_edu.graphical import eliminate as eliminate_exactly
from semgrid_instructor import hidden


def _named(shapes: dict[str, int], names: tuple[str, ...], rng: np.random.Generator) -> tuple:
    """Return a random factor as (names, table)."""
    return names, rng.uniform(0.1, 1, size=[shapes[name] for name in names])


def _check_products(multiply: Callable, pairs: tuple[tuple[str, str], ...], seed: int) -> None:
    """Multiply factors over these variables, two to four states each."""
    rng, shapes = np.random.default_rng(seed), {"a": 2, "b": 3, "c": 4, "d": 2}
    for one, other in pairs:
        f, g = _named(shapes, tuple(one), rng), _named(shapes, tuple(other), rng)
        names, table = multiply(f, g)
        expected = Factor(*f) * Factor(*g)
        about = f"factors over ({', '.join(one)}) and ({', '.join(other)})"
        assert sorted(names) == sorted(expected.names), f"wrong names for {about}"
        assert np.shape(table) == tuple(shapes[name] for name in names), f"names and table don't fit for {about}"
        assert np.allclose(table, expected.ordered(*names).table), f"wrong entries for {about}"


@hidden
def check_multiply(multiply: Callable) -> None:
    """One variable in common, anywhere, of two to four states."""
    _check_products(multiply, (("abc", "bd"), ("ba", "cb"), ("c", "acd")), seed=21)


@hidden
def check_multiply_shared(multiply: Callable) -> None:
    """Several variables in common, all of them, none of them, no variable at all."""
    _check_products(
        multiply, (("abc", "cb"), ("bd", "db"), ("abd", "dca"), ("ab", "cd"), ("", "ab"), ("a", "")), seed=30
    )


@hidden
def check_posterior(posterior: Callable) -> None:
    """Four variables with other numbers of states, asked in every place and with any number given."""
    rng, shapes = np.random.default_rng(22), {"a": 3, "b": 2, "c": 4, "d": 2}
    joint = _named(shapes, tuple("abcd"), rng)
    model = GraphicalModel([Factor(*joint)])
    for wanted, given in (
        ("c", {"a": 2, "d": 0}),
        ("a", {"b": 0}),
        ("d", {"c": 3, "a": 0, "b": 1}),
        ("b", {}),
        ("d", {"c": 1}),
    ):
        got = np.asarray(posterior(joint, wanted, dict(given)))
        expected = enumerate_marginals(model, wanted, given).normalised().table
        assert got.shape == expected.shape, (
            f"shape {got.shape} instead of {expected.shape} with {len(given)} of four given"
        )
        assert np.allclose(got, expected), f"wrong with {len(given)} of four variables given"


@hidden
def check_impossible(posterior: Callable) -> None:
    """Impossible only together; and possible although tiny."""
    table = np.zeros((2, 2, 2))
    table[0, 0, 0], table[1, 1, 1] = 1e-20, 3e-20
    joint = ("m1", "m2", "z"), table
    try:
        posterior(joint, "m2", {"m1": 0, "z": 1})
    except ValueError:
        pass
    else:
        raise AssertionError("no ValueError where two known states exclude each other")
    try:
        got = posterior(joint, "z", {"m1": 0})
    except ValueError:
        raise AssertionError("a tiny weight isn't zero: what is very improbable can still happen") from None
    assert np.allclose(got, [1, 0]), "wrong where weights are tiny"


def _random_graph(rng: np.random.Generator, size: int) -> dict[str, tuple[str, ...]]:
    """Return the parents of a random graph, children listed before or after their parents."""
    names = [f"v{k}" for k in range(size)]
    parents = {name: tuple(above for above in names[:k] if rng.random() < 0.4) for k, name in enumerate(names)}
    return {name: parents[name] for name in rng.permutation(names).tolist()}


def _model(parents: dict[str, tuple[str, ...]]) -> GraphicalModel:
    """Return a model of this graph; its numbers don't matter."""
    tables = {name: np.full([2] * (len(above) + 1), 0.5) for name, above in parents.items()}
    return GraphicalModel([Factor((name, *parents[name]), table) for name, table in tables.items()], parents)


def _check_separated(separated: Callable, size: int, graphs: int, seed: int) -> None:
    """Compare with the package's Bayes ball on random graphs."""
    rng = np.random.default_rng(seed)
    for _ in range(graphs):
        parents = _random_graph(rng, size)
        a, b, *others = rng.permutation(list(parents)).tolist()
        given = tuple(others[: rng.integers(0, len(others) + 1)])
        got, right = separated(dict(parents), a, b, given), d_separated(_model(parents), a, b, given)
        assert got in (True, False), "neither True nor False"
        what = "open although every path is blocked" if right else "separated although a path is open"
        assert got == right, f"{what}, in a graph of {size} variables with {len(given)} known"


@hidden
def check_separated_three(separated: Callable) -> None:
    """Every kind of graph of three variables, named differently."""
    _check_separated(separated, size=3, graphs=150, seed=23)


@hidden
def check_separated_large(separated: Callable) -> None:
    """Random graphs of six variables."""
    _check_separated(separated, size=6, graphs=300, seed=24)


STATES = {"a": 2, "b": 3, "c": 2, "d": 4, "e": 3}


def _ring() -> list[Factor]:
    """Return a ring of four variables, a factor of one of them, and a variable without neighbours."""
    rng = np.random.default_rng(25)
    families = (("a", "b"), ("b", "c"), ("c", "d"), ("d", "a"), ("e",), ("b",))
    return [Factor(names, rng.uniform(0.1, 1, size=[STATES[name] for name in names])) for names in families]


@hidden
def check_eliminate(eliminate: Callable) -> None:
    """Several variables left, one of them without neighbours, and several orders."""
    factors = _ring()
    for order in (["c", "e", "b"], ["b", "e", "d"], ["a", "b", "c", "e"], ["e"]):
        result = eliminate(list(factors), list(order))[0]
        left = [name for name in STATES if name not in order]
        assert sorted(result.names) == sorted(left), f"wrong variables are left, where {len(left)} should be"
        expected = eliminate_exactly(GraphicalModel(factors), left)
        assert np.allclose(result.ordered(*left).table, expected.table), (
            f"wrong result where {len(left)} variables are left"
        )


@hidden
def check_cost(eliminate: Callable) -> None:
    """Two to four states, and several orders."""
    for order, right in ((["c", "e", "b"], 24), (["b", "e", "d"], 16), (["e"], 3), (["a", "b", "c", "e"], 24)):
        largest = eliminate(_ring(), list(order))[1]
        assert largest == right, "wrong size of the largest table, for variables of two to four states"


def _chain(seed: int, length: int, n_states: int) -> tuple:
    """Return start, M and likelihoods of a random chain."""
    rng = np.random.default_rng(seed)
    likelihoods = rng.uniform(0.02, 0.9, size=(length, n_states))
    likelihoods[length // 2] = 0
    likelihoods[length // 2, 1] = 0.5
    return rng.dirichlet(np.ones(n_states)), rng.dirichlet(np.ones(n_states), size=n_states), likelihoods


def _exact(start: np.ndarray, M: np.ndarray, likelihoods: np.ndarray, t: int) -> np.ndarray:
    """Return P(state at t | all these scans) by elimination."""
    names = [f"x{k}" for k in range(len(likelihoods))]
    pairs = [Factor(pair, M) for pair in pairwise(names)]
    scans = [Factor(name, row) for name, row in zip(names, likelihoods, strict=True)]
    model = GraphicalModel([Factor(names[0], start), *pairs, *scans])
    return eliminate_exactly(model, names[t]).normalised().table


@hidden
def check_filtered(filtered: Callable) -> None:
    """Four states, one scan only, and thousands of scans."""
    for length, n_states in ((1, 3), (6, 4)):
        chain = _chain(26, length, n_states)
        got = np.asarray(filtered(*(array.copy() for array in chain)))
        assert got.shape == (length, n_states), f"shape {got.shape} instead of {(length, n_states)}"
        for t in range(length):
            expected = _exact(chain[0], chain[1], chain[2][: t + 1], t)
            assert np.allclose(got[t], expected), f"wrong at scan {t}, with {n_states} states"
    got = np.asarray(filtered(*_chain(27, 3000, 3)))
    assert np.isfinite(got).all(), "NaN after thousands of scans: normalise the message on the way"
    assert np.allclose(got.sum(axis=1), 1), "after thousands of scans the belief no longer sums to 1"


@hidden
def check_smoothed(smoothed: Callable) -> None:
    """Four states, one scan only, and thousands of scans, the first of which nearly forgets the last."""
    for length, n_states in ((1, 3), (6, 4)):
        chain = _chain(28, length, n_states)
        got = np.asarray(smoothed(*(array.copy() for array in chain)))
        assert got.shape == (length, n_states), f"shape {got.shape} instead of {(length, n_states)}"
        for t in range(length):
            assert np.allclose(got[t], _exact(*chain, t)), f"wrong at scan {t} of {length}, with {n_states} states"
    chain = _chain(29, 3000, 3)
    got = np.asarray(smoothed(*chain))
    assert np.isfinite(got).all(), "NaN after thousands of scans: normalise the message on the way"
    expected = _exact(chain[0], chain[1], chain[2][:40], 0)
    assert np.allclose(got[0], expected, atol=1e-6), "wrong at the first of thousands of scans"

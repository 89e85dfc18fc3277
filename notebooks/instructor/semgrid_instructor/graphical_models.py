"""Hidden tests of the exercise on graphical models: the package's own inference is the reference."""

from collections.abc import Callable
from functools import lru_cache
from itertools import combinations, pairwise, permutations

import numpy as np

from semgrid_edu.graphical import Factor, GraphicalModel, d_separated, enumerate_marginals
from semgrid_edu.graphical import eliminate as eliminate_exactly
from semgrid_edu.workshop.course.answers import answer_array
from semgrid_instructor import asked_in_any_order, close, generator, hidden, in_any_order, keeping


def _named(shapes: dict[str, int], names: tuple[str, ...], rng: np.random.Generator) -> tuple:
    """Return a random factor as (names, table)."""
    return names, rng.uniform(0.1, 30, size=[shapes[name] for name in names])


def _check_quotients(divide: Callable, pairs: tuple[tuple[str, str], ...], seed: int, zeros: bool = False) -> None:
    """Divide products by one of their factors, two to four states each; with `zeros`, a state of it is impossible."""
    shapes = {"a": 2, "b": 3, "c": 4, "d": 2}
    for k, (one, other) in in_any_order(enumerate(pairs)):
        rng = generator(100 * seed + k)
        quotient, g = _named(shapes, tuple(one), rng), _named(shapes, tuple(other), rng)
        if zeros and other:
            g[1][(0,) * len(other)] = 0
        product = (Factor(*quotient) * Factor(*g)).ordered(*one)
        possible = (Factor(*quotient) * Factor(g[0], np.sign(g[1]))).ordered(*one)
        f = product.names, product.table
        arguments = (f[0], np.array(f[1])), (g[0], np.array(g[1]))
        names, table = divide(*arguments)
        changed = any(not np.array_equal(now[1], old[1]) for now, old in zip(arguments, (f, g), strict=True))
        assert not changed, "it changed a table that it was given: make a new one"
        table = answer_array(table)
        assert np.isfinite(table).all(), "0 / 0 must be 0"
        assert sorted(names) == sorted(one), "wrong names"
        assert table.shape == tuple(shapes[name] for name in names), "names and table don't fit"
        assert close(table, possible.ordered(*names).table), "wrong entries"


@hidden
def check_divide(divide: Callable) -> None:
    """One variable in common, anywhere, of two to four states."""
    _check_quotients(divide, (("abc", "b"), ("ba", "a"), ("cad", "c"), ("cb", "b")), seed=21)


@hidden
def check_divide_shared(divide: Callable) -> None:
    """Several variables in common, all of them, none at all, and zeros."""
    pairs = ("abc", "cb"), ("bd", "db"), ("abd", "da"), ("ab", ""), ("cab", "abc")
    _check_quotients(divide, pairs, seed=30)
    _check_quotients(divide, pairs, seed=31, zeros=True)


@hidden
def check_posterior(posterior: Callable) -> None:
    """Four variables with other numbers of states, asked in every place, with none to three reports."""
    rng, shapes = generator(22), {"a": 3, "b": 2, "c": 4, "d": 2}
    joint = _named(shapes, tuple("abcd"), rng)
    questions = []
    for wanted, about in (("c", "ad"), ("a", "b"), ("d", "cab"), ("b", ""), ("d", "dc")):
        heard = {name: rng.uniform(0.05, 1, shapes[name]) for name in about}
        if len(heard) > 1:
            heard[about[1]] = np.eye(shapes[about[1]])[-1]
        questions.append((wanted, heard))

    def ask(question: tuple[str, dict]) -> np.ndarray:
        wanted, heard = question
        return answer_array(posterior(joint, wanted, {name: row.copy() for name, row in heard.items()}))

    for (wanted, heard), got in asked_in_any_order(ask, questions):
        expected = enumerate_marginals(GraphicalModel([Factor(*joint), *map(Factor, heard, heard.values())]), wanted)
        assert got.shape == expected.table.shape, "another shape"
        right = close(got, expected.normalised().table)
        assert right, "wrong with " + ("reports of some variables" if heard else "nothing heard")


@hidden
def check_impossible(posterior: Callable) -> None:
    """Tables with many zeros and tiny weights: reports that exclude each other, and others that don't."""
    rng, names = generator(32), ("m1", "m2", "z")
    for _ in range(40):
        weights = np.where(rng.random((2, 2, 2)) < 0.4, 10.0 ** -rng.integers(0, 25, (2, 2, 2)), 0)
        heard = {name: int(rng.integers(2)) for name in rng.permutation(names)[: rng.integers(1, 3)].tolist()}
        possible = weights[tuple(heard.get(name, slice(None)) for name in names)].any()
        reports = {name: [1 - state, state] for name, state in heard.items()}
        try:
            posterior((names, weights), next(name for name in names if name not in heard), reports)
        except ValueError:
            assert not possible, "a tiny weight isn't zero: what is very improbable can still happen"
        else:
            assert possible, "no ValueError where reports exclude each other"
    weights = np.arange(1.0, 9.0).reshape(2, 2, 2)
    got, again = (answer_array(posterior((names, weights), "z", {"m1": [0, 1]})) for _ in range(2))
    assert np.array_equal(got, again), "another answer to the same question"
    assert np.ptp(got) > 0, "the same for every state, although they are not equally probable"


def _random_graph(rng: np.random.Generator, size: int) -> dict[str, tuple[str, ...]]:
    """Return the parents of a random graph, children listed before or after their parents."""
    names = [f"v{k}" for k in range(size)]
    parents = {name: tuple(above for above in names[:k] if rng.random() < 0.4) for k, name in enumerate(names)}
    return {name: parents[name] for name in rng.permutation(names).tolist()}


@lru_cache(maxsize=1000)
def _model(*arrows: tuple[str, tuple[str, ...]]) -> GraphicalModel:
    """Return a model in which each variable has these parents; its numbers don't matter."""
    tables = [Factor((name, *above), np.full([2] * (len(above) + 1), 0.5)) for name, above in arrows]
    return GraphicalModel(tables, dict(arrows))


DEEP = {"a": (), "b": (), "c": ("a", "b"), "d": ("c",), "e": ("d",), "f": ("e",)}
"""A collider with three more variables below it, one under the other."""


TWO_WAYS = {"a": (), "b": (), "c": ("a", "b"), "d": ("a", "c")}
"""With c known, no way leads from d to b through c, but one does through a and then c: c is visited twice."""


def _shuffled(rng: np.random.Generator, parents: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """Return the same graph, its variables and parents listed in another order."""
    return {
        name: tuple(sorted(parents[name], key=lambda _: rng.random()))
        for name in rng.permutation(list(parents)).tolist()
    }


def _check_question(
    separated: Callable, parents: dict, a: str, b: str, given: tuple[str, ...], exact: tuple[str, ...] = ()
) -> None:
    """Compare one answer with the package's Bayes ball, which is told what else is known; not if that is a or b."""
    known = set(given)
    for _ in exact:
        known |= {name for name in exact if known.issuperset(parents[name])}
    if known & {a, b}:
        return
    got, right = separated(dict(parents), a, b, given, exact), d_separated(_model(*parents.items()), a, b, known)
    assert np.shape(got) == (), "neither True nor False"
    assert got in (True, False), "neither True nor False"
    what = "open although every path is blocked" if right else "separated although a path is open"
    assert got == right, what


def _linked(parents: dict, a: str, b: str) -> bool:
    """Return whether an arrow links two variables: three variables show that it does, larger graphs ask for more."""
    return a in parents[b] or b in parents[a]


@hidden
def check_separated_three(separated: Callable) -> None:
    """Chains, forks and colliders of three variables, named differently; in none are there two paths."""
    rng = generator(23)
    questions = [
        (_shuffled(rng, BELOW), *rng.permutation(["a", "c"]).tolist(), given, exact)
        for given, exact in ((("d",), ("b",)), (("d",), ()), ((), ("b",)))
    ]
    for _ in range(150):
        parents = _random_graph(rng, 3)
        a, b, *others = rng.permutation(list(parents)).tolist()
        given = tuple(others[: rng.integers(0, 2)])
        if sum(map(len, parents.values())) < 3:
            questions.append((parents, a, b, given))
    for question in in_any_order(questions):
        _check_question(separated, *question)


@hidden
def check_separated_large(separated: Callable) -> None:
    """Random graphs of six variables, one with what is known far below a collider, one with two ways to a collider."""
    rng = generator(24)
    questions = [(_shuffled(rng, TWO_WAYS), *rng.permutation(["b", "d"]).tolist(), ("c",)) for _ in range(40)]
    for _ in range(300):
        parents = _random_graph(rng, 6)
        a, b, *others = rng.permutation(list(parents)).tolist()
        exact = tuple(name for name in parents if parents[name] and rng.random() < 0.5)
        if not _linked(parents, a, b):
            questions.append((parents, a, b, tuple(others[: rng.integers(0, len(others) + 1)]), exact))
    for a, b in permutations(DEEP, 2):
        others = [name for name in DEEP if name not in (a, b)]
        for given in ((), *combinations(others, 1), *combinations(others, 2)):
            if not _linked(DEEP, a, b):
                questions.append((DEEP, a, b, given))
    for question in in_any_order(questions):
        _check_question(separated, *question)


BELOW = {"a": ("b",), "b": ("d",), "c": ("b",), "d": ()}
"""A fork whose middle has a parent."""


def _chain(rng: np.random.Generator, K: int, T: int) -> tuple[np.ndarray, ...]:
    """Return the prior, the matrix and the scans of a chain; some scans are missing, and some steps impossible."""
    M = rng.uniform(0.05, 1, (K, K)) * (rng.random((K, K)) < 0.8) + np.eye(K)
    scans = rng.uniform(0.05, 0.95, (T, K))
    scans[rng.random(T) < 0.2] = 1
    return rng.dirichlet(np.ones(K)), M / M.sum(axis=1, keepdims=True), scans


def _all_tables(prior: np.ndarray, M: np.ndarray, scans: np.ndarray, left_out: set[int]) -> GraphicalModel:
    """Return the chain as a model of one factor for each table, without the scans that are left out."""
    names = [f"x{t}" for t in range(len(scans))]
    steps = [Factor(pair, M) for pair in pairwise(names)]
    return GraphicalModel(
        [
            Factor(names[0], prior),
            *steps,
            *(Factor(names[t], np.ones_like(prior) if t in left_out else scans[t]) for t in range(len(scans))),
        ]
    )


CHAINS = (2, 1), (2, 3), (3, 5), (4, 2), (5, 6), (2, 7)
"""States and times of the chains that are asked for."""


@hidden
@keeping
def check_messages(messages: Callable) -> None:
    """Two to five states, one to seven times; what is left of time t and what is right of it, by elimination."""
    rng, cases = generator(25), []
    for K, T in CHAINS:
        chain = _chain(rng, K, T)
        left = [
            _all_tables(*(part[: t + 1] if k == 2 else part for k, part in enumerate(chain)), {t}) for t in range(T)
        ]
        from_left = np.array([eliminate_exactly(model, f"x{t}").table for t, model in enumerate(left)])
        together = np.array([eliminate_exactly(_all_tables(*chain, {t}), f"x{t}").table for t in range(T)])
        possible = from_left > 0
        from_right = np.divide(together, from_left, out=np.ones_like(together), where=possible)
        cases.append((chain, from_left, from_right, possible))
    for chain, from_left, from_right, possible in in_any_order(cases):
        got = messages(*chain)
        assert isinstance(got, tuple | list), "not two tables"
        assert len(got) == 2, "not two tables"
        left, right = (answer_array(one) for one in got)
        assert left.shape == right.shape == from_left.shape, "another shape (K may be two to five, T may be 1)"
        scaled = left / left.sum(axis=1, keepdims=True)
        if close(scaled, from_left / from_left.sum(axis=1, keepdims=True)):
            assert close(left, from_left), "from_left is right up to a factor: don't normalise"
        assert close(left, from_left), "wrong messages from the left"
        assert close(right[possible], from_right[possible]), "wrong messages from the right"


@hidden
@keeping
def check_credible(credible: Callable) -> None:
    """How probable each scan is, by two eliminations of the whole chain: with it and without it."""
    rng, cases = generator(26), []
    for K, T in CHAINS:
        chain = _chain(rng, K, T)
        names = tuple(f"x{t}" for t in range(T))
        with_all = eliminate_exactly(_all_tables(*chain, set()), names[0]).table.sum()
        without = [eliminate_exactly(_all_tables(*chain, {t}), names[t]).table.sum() for t in range(T)]
        cases.append((chain, with_all / np.array(without)))
    for chain, right in in_any_order(cases):
        got = answer_array(credible(*chain))
        assert got.shape == right.shape, "another shape"
        assert close(got, right), "wrong probability of a scan, given all the others"

"""Random models for properties, and the two worlds of which every number is known by hand."""

import itertools

import numpy as np

from semgrid_edu.graphical import Factor, GraphicalModel


def random_directed(seed, variables=6, zeros=0.0):
    """A Bayesian network with up to three parents per variable; a share of its entries is exactly zero."""
    rng = np.random.default_rng(seed)
    names = [f"v{k}" for k in rng.permutation(variables)]
    states = {name: int(rng.integers(2, 4)) for name in names}
    parents = {
        name: tuple(rng.choice(names[:k], size=rng.integers(0, min(k, 3) + 1), replace=False).tolist()) if k else ()
        for k, name in enumerate(names)
    }
    factors = [_conditional(rng, name, parents[name], states, zeros) for name in names]
    return GraphicalModel([factors[k] for k in rng.permutation(variables)], parents)


def _conditional(rng, child, parents, states, zeros):
    table = rng.gamma(1.0, size=[states[child], *(states[name] for name in parents)])
    table[1:] *= rng.random(table[1:].shape) >= zeros
    names = rng.permutation([child, *parents]).tolist()
    return Factor((child, *parents), table / table.sum(axis=0)).ordered(*names)


def random_undirected(seed, variables=6, zeros=0.0):
    """Factors over one to three variables each, at random; some variables may stand alone."""
    rng = np.random.default_rng(seed)
    names = [f"v{k}" for k in range(variables)]
    states = {name: int(rng.integers(2, 4)) for name in names}
    scopes = [[name] for name in names]
    scopes += [rng.choice(names, size=rng.integers(2, 4), replace=False).tolist() for _ in range(variables)]
    return GraphicalModel(_table(rng, scope, states, zeros) for scope in scopes)


def random_tree(seed, variables=7):
    """An undirected tree: each variable but the first is tied to one earlier one."""
    rng = np.random.default_rng(seed)
    states = {f"v{k}": int(rng.integers(2, 4)) for k in range(variables)}
    pairs = [(f"v{rng.integers(k)}", f"v{k}") for k in range(1, variables)]
    scopes = [[name] for name in states if rng.random() < 0.7] + [list(pair) for pair in pairs]
    return GraphicalModel(_table(rng, scope, states) for scope in scopes)


def _table(rng, scope, states, zeros=0.0):
    table = rng.gamma(1.0, size=[states[name] for name in scope])
    return Factor(tuple(scope), table * (rng.random(table.shape) >= zeros) if len(scope) > 1 else table)


def some_evidence(model, seed, count=2):
    """States of a few variables that have positive probability together, and the other variables."""
    rng = np.random.default_rng(seed)
    while True:
        states = {name: int(rng.integers(k)) for name, k in model.cardinalities.items()}
        if model.weight(states) > 0:
            break
    known = rng.choice(list(model.names), size=count, replace=False).tolist()
    return {name: states[name] for name in known}, [name for name in model.names if name not in known]


def assignments(model):
    """Every assignment of all variables."""
    states = itertools.product(*map(range, model.cardinalities.values()))
    return [dict(zip(model.names, state, strict=True)) for state in states]


def one_of_you(prior=0.2):
    """Two cells and a coarse beam that says whether one of them reflected: explaining away."""
    cells = [Factor(name, [1 - prior, prior]) for name in ("m1", "m2")]
    reflected = Factor(("m1", "m2", "z"), [[[1, 0], [0, 1]], [[0, 1], [0, 1]]])
    return GraphicalModel([*cells, reflected], parents={"z": ("m1", "m2")})


def chain(steps, seed=0, states=3, symbols=2):
    """A hidden Markov model x0 -> x1 -> ... with readings z0, z1, ...; also its three tables."""
    rng = np.random.default_rng(seed)
    first, move, read = (
        rng.dirichlet(np.ones(n), size=m) for n, m in ((states, 1), (states, states), (symbols, states))
    )
    factors = [Factor("x0", first[0])]
    factors += [Factor((f"x{t - 1}", f"x{t}"), move) for t in range(1, steps)]
    factors += [Factor((f"x{t}", f"z{t}"), read) for t in range(steps)]
    parents = {f"x{t}": (f"x{t - 1}",) for t in range(1, steps)} | {f"z{t}": (f"x{t}",) for t in range(steps)}
    return GraphicalModel(factors, parents), first[0], move, read

"""The graders of the exercise on graphical models, against real mistakes and other right ways."""

from grader_checks import GraderChecks, mistake, right

WEIGHTED = """
def posterior(factor, wanted, heard):
    names, table = list(factor[0]), np.array(factor[1], float)
    for name, likelihood in heard.items():
        table = table * np.reshape(likelihood, [-1 if n == name else 1 for n in names])
    for name in list(names):
        if name != wanted:
            table = table.sum(axis=names.index(name))
            names.remove(name)
"""

RECIPE = """
def separated(parents, a, b, given=(), exact=()):
    given = set(given)
    for _ in parents:
        given |= {name for name in exact if set(parents[name]) <= given}
    kept, queue = set(), [a, b, *given]
    while queue:
        name = queue.pop()
        kept.add(name)
        queue += parents[name]
    linked = {name: set() for name in kept}
    for child in kept:
        family = {child, *parents[child]}
        for name in family:
            linked[name] |= family
    reached, queue = set(given), [a]
    while queue:
        name = queue.pop()
        if name not in reached:
            reached.add(name)
            queue += linked[name]
    return b not in reached
"""

PATHS = """
def separated(parents, a, b, given=(), exact=()):
    given = set(given)
    for _ in parents:
        given |= {name for name in exact if set(parents[name]) <= given}
    children = {name: [c for c in parents if name in parents[c]] for name in parents}

    def below(name):
        return {name}.union(*(below(c) for c in children[name]))

    def opens(before, middle, after):
        collider = before in parents[middle] and after in parents[middle]
        return bool(below(middle) & set(given)) if collider else middle not in given

    def walk(path):
        if path[-1] == b:
            return True
        for following in [*parents[path[-1]], *children[path[-1]]]:
            inside = len(path) == 1 or opens(path[-2], path[-1], following)
            if following not in path and inside and walk([*path, following]):
                return True
        return False

    return not walk([a])
"""

ELIMINATE = """
def eliminate(factors, order, seen, best=()):
    factors = [f.given(**{n: s for n, s in seen.items() if n in f.names}) for f in factors]
    largest = 0
    for name in order:
        touching = [f for f in factors if name in f.names]
        together = touching[0]
        for f in touching[1:]:
            together = together * f
        largest = max(largest, together.table.size)
        taken = together.max(name) if name in best else together.sum(name)
        factors = [f for f in factors if name not in f.names] + [taken]
    result = factors[0]
    for f in factors[1:]:
        result = result * f
    return result, largest
"""

FILTERED = """
def filtered(start, M, likelihoods):
    rows, b = [], start
    for row in likelihoods:
        b = b * row / (b @ row)
        rows.append(b)
        b = b @ M
    return np.array(rows)

"""

SMOOTHED = """
def smoothed(start, M, likelihoods):
    beliefs, message = filtered(start, M, likelihoods), np.ones(len(start))
    for t in range(len(likelihoods) - 1, -1, -1):
        beliefs[t] = beliefs[t] * message / (beliefs[t] @ message)
        message = M @ (likelihoods[t] * message)
        message = message / message.sum()
    return beliefs
"""


class TestGraphicalModels(GraderChecks):
    exercise = "graphical_models"
    entries = (
        # ---- task 1
        right(
            "broadcasting, axes by name, zeros put back",
            task="divide",
            code="""
def spread(names, factor):
    own, table = factor
    table = table.transpose([own.index(name) for name in names if name in own])
    return table[tuple(slice(None) if name in own else None for name in names)]


def divide(f, g):
    return f[0], np.nan_to_num(f[1] / spread(f[0], g), nan=0.0)""",
        ),
        right(
            "a loop over all states, names sorted",
            task="divide",
            code="""
def divide(f, g):
    states = dict(zip(f[0], f[1].shape))
    names = tuple(sorted(states))
    table = np.zeros([states[name] for name in names])
    for index in np.ndindex(table.shape):
        at = dict(zip(names, index))
        below = g[1][tuple(at[n] for n in g[0])]
        if below:
            table[index] = f[1][tuple(at[n] for n in f[0])] / below
    return names, table""",
        ),
        right(
            "the package's product with the inverse, returned as lists",
            task="divide",
            code="""
before, got, slips, table, cases, street = "tests", "may", "have", "these", "names", "too"


def divide(f, g):
    inverse = np.array([1 / x if x else 0 for x in np.ravel(g[1])]).reshape(np.shape(g[1]))
    both = Factor(*f) * Factor(g[0], inverse)
    return [list(both.names), both.table.tolist()]""",
        ),
        mistake(
            "the companion's product, pasted",
            task="divide",
            loses=2,
            says="you multiplied: a quotient divides",
            code="""
def divide(f, g):
    both = Factor(*f) * Factor(*g)
    return both.names, both.table""",
        ),
        mistake(
            "rows of different lengths",
            task="divide",
            loses=2,
            says="for the table divide returned no array of numbers",
            code="def divide(f, g):\n    return f[0], [[1.0], [2.0, 3.0]]",
        ),
        mistake(
            "numpy broadcasts by place",
            task="divide",
            loses=2,
            says="line the axes up by name",
            code="""
def divide(f, g):
    return f[0], np.nan_to_num(f[1] / g[1], nan=0.0)""",
        ),
        mistake(
            "upside down",
            task="divide",
            loses=2,
            says="divide f by g",
            code="""
def divide(f, g):
    both = Factor(f[0], 1 / f[1]) * Factor(*g)
    return both.names, both.table""",
        ),
        mistake(
            "normalised",
            task="divide",
            loses=2,
            says="a quotient isn't normalised",
            code="""
def divide(f, g):
    both = (Factor(*f) * Factor(g[0], 1 / np.maximum(g[1], 1e-300))).normalised()
    return both.names, both.table""",
        ),
        mistake(
            "g's axes taken in f's order",
            task="divide",
            loses=1,
            says="the axes of g stand the other way round",
            code="""
def divide(f, g):
    inverse = np.divide(1, g[1], out=np.zeros(np.shape(g[1])), where=np.asarray(g[1]) > 0)
    if sorted(f[0]) == sorted(g[0]):
        return f[0], f[1] * inverse
    both = Factor(*f) * Factor(g[0], inverse)
    return both.names, both.table""",
        ),
        mistake(
            "0 / 0 left as it is",
            task="divide",
            loses=1,
            says="the quotient is 0 there",
            code="""
def divide(f, g):
    shared = [name for name in f[0] if name in g[0]]
    below = np.transpose(g[1], [g[0].index(name) for name in shared])
    return f[0], f[1] / below[tuple(slice(None) if name in shared else None for name in f[0])]""",
        ),
        mistake(
            "names don't fit the table",
            task="divide",
            loses=2,
            says="right numbers, wrong names",
            code="""
def divide(f, g):
    both = Factor(*f) * Factor(g[0], 1 / np.maximum(g[1], 1e-300))
    return tuple(sorted(both.names, reverse=True)), both.table""",
        ),
        mistake(
            "in place",
            task="divide",
            loses=2,
            says="divide changed the table of `f`",
            code="""
def divide(f, g):
    table = np.moveaxis(f[1], f[0].index(g[0][0]), -1)
    table /= g[1]
    return f[0], f[1]""",
        ),
        mistake(
            "an argument changed where several variables are shared",
            task="divide",
            loses=1,
            says="it changed a table that it was given",
            code="""
def divide(f, g):
    inverse = np.divide(1, g[1], out=np.zeros(np.shape(g[1])), where=np.asarray(g[1]) > 0)
    both = Factor(*f) * Factor(g[0], inverse)
    if len(g[0]) == 2:
        f[1][...] = 0
    return both.names, both.table""",
        ),
        mistake(
            "nothing returned",
            task="divide",
            loses=2,
            says="did you forget `return`?",
            code="def divide(f, g):\n    (f[0], f[1])",
        ),
        mistake(
            "at most two axes",
            task="divide",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def divide(f, g):
    if len(g[0]) == 1:
        return f[0], (f[1].T / g[1]).T if f[0][0] == g[0][0] else f[1] / g[1]
    return f[0], np.nan_to_num(f[1] / g[1].T, nan=0.0)""",
        ),
        mistake(
            "an endless loop",
            task="divide",
            loses=2,
            says="before timeout",
            code="""
def divide(f, g):
    while True:
        pass""",
        ),
        # ---- task 2
        right(
            "multiply and sum, one axis after the other",
            task="posterior",
            code=WEIGHTED
            + """
    if not table.any():
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        right(
            "a loop over all states",
            task="posterior",
            code="""
def posterior(factor, wanted, heard):
    names, table = factor
    weights = [0.0] * table.shape[names.index(wanted)]
    for index in np.ndindex(*table.shape):
        at = dict(zip(names, index))
        weights[at[wanted]] += table[index] * np.prod([row[at[name]] for name, row in heard.items()])
    if sum(weights) == 0:
        raise ValueError("impossible")
    return [w / sum(weights) for w in weights]""",
        ),
        right(
            "a model with one more factor for each report, whose error is a ValueError",
            task="posterior",
            code="""
from semgrid_edu.graphical import product


def posterior(factor, wanted, heard):
    joint = product([Factor(*factor), *(Factor(name, row) for name, row in heard.items())])
    return joint.sum(*(n for n in joint.names if n != wanted)).normalised().table""",
        ),
        mistake(
            "the package's function, wrapped",
            task="posterior",
            loses=3,
            says="expected a state from 0 to 1",
            code="""
from semgrid_edu.graphical import GraphicalModel, enumerate_marginals


def posterior(factor, wanted, heard):
    return enumerate_marginals(GraphicalModel([Factor(*factor)]), wanted, heard).normalised().table""",
        ),
        mistake(
            "the companion's slice",
            task="posterior",
            loses=2,
            says="you take the report for certain",
            code=WEIGHTED.replace("reshape(likelihood", "reshape(np.eye(len(likelihood))[np.argmax(likelihood)]")
            + """    if not table.any():
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        mistake(
            "a mixture of the answers",
            task="posterior",
            loses=2,
            says="you mix the answers for z = 0 and z = 1",
            code="""
def posterior(factor, wanted, heard):
    names, table = list(factor[0]), np.array(factor[1], float)
    for name, likelihood in heard.items():
        others = tuple(k for k, n in enumerate(names) if n != name)
        share = np.reshape(likelihood, [-1 if n == name else 1 for n in names])
        table = table / np.maximum(table.sum(axis=others, keepdims=True), 1e-300) * share
    weights = table.sum(axis=tuple(k for k, n in enumerate(names) if n != wanted))
    if weights.sum() == 0:
        raise ValueError("impossible")
    return weights / weights.sum()""",
        ),
        mistake(
            "a report of what is wanted left out",
            task="posterior",
            loses=2,
            says="there is a report of z itself",
            code=WEIGHTED.replace("in heard.items():", "in heard.items():\n        if name == wanted: continue")
            + """    if not table.any():
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        mistake(
            "what is heard left out",
            task="posterior",
            loses=3,
            says="you summed z out",
            code="""
def posterior(factor, wanted, heard):
    names, table = factor
    weights = table.sum(axis=tuple(k for k, n in enumerate(names) if n != wanted))
    return weights / weights.sum()""",
        ),
        mistake(
            "likelihoods the other way round",
            task="posterior",
            loses=3,
            says="the first number of a likelihood is that of state 0",
            code=WEIGHTED.replace("reshape(likelihood", "reshape(likelihood[::-1]") + "    return table / table.sum()",
        ),
        mistake(
            "wanted ignored",
            task="posterior",
            loses=2,
            says="look where the axis of `wanted` is",
            code=WEIGHTED.replace("name != wanted", "name != factor[0][0]")
            + """    if not table.any():
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        mistake(
            "maximum instead of sum",
            task="posterior",
            loses=2,
            says="an unknown variable is summed out",
            code=WEIGHTED.replace("table.sum(axis", "table.max(axis")
            + """    if not table.any():
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        mistake(
            "mean instead of sum, not normalised",
            task="posterior",
            loses=3,
            says="you took the mean over the others",
            code=WEIGHTED.replace("table.sum(axis", "table.mean(axis") + "    return table",
        ),
        mistake(
            "not normalised, but it knows the impossible",
            task="posterior",
            loses=2,
            says="divide by their sum, 28",
            code=WEIGHTED
            + """    if not table.any():
        raise ValueError("impossible")
    return table""",
        ),
        mistake(
            "not normalised",
            task="posterior",
            loses=3,
            says="divide by their sum, 28",
            code=WEIGHTED + "    return table",
        ),
        mistake(
            "divided by the sum of the whole table",
            task="posterior",
            loses=3,
            says="divide by what is left of it",
            code=WEIGHTED + "    return table / factor[1].sum()",
        ),
        mistake(
            "the unknown variable at state 0",
            task="posterior",
            loses=2,
            says="you looked at m1 = 0 only",
            code=WEIGHTED.replace(
                "table.sum(axis=names.index(name))",
                "table.sum(axis=names.index(name)) if name in heard else np.take(table, 0, axis=names.index(name))",
            )
            + """    if not table.any():
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        mistake(
            "NaN for the impossible",
            task="posterior",
            loses=1,
            says="0 / 0 gives NaN",
            code=WEIGHTED + "    return table / table.sum()",
        ),
        mistake(
            "uniform for the impossible",
            task="posterior",
            loses=1,
            says="nothing follows from it",
            code=WEIGHTED
            + """    if not table.any():
        return np.full(len(table), 1 / len(table))
    return table / table.sum()""",
        ),
        mistake(
            "nothing returned for the impossible",
            task="posterior",
            loses=1,
            says="raise ValueError instead of returning nothing",
            code=WEIGHTED
            + """    if table.any():
        return table / table.sum()""",
        ),
        mistake(
            "any zero is taken for impossible",
            task="posterior",
            loses=1,
            says="a zero in one entry is no reason to raise",
            code=WEIGHTED
            + """    if not table.all():
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        mistake(
            "a tolerance for zero",
            task="posterior",
            loses=1,
            says="on inputs you haven't seen: a tiny weight isn't zero",
            code=WEIGHTED
            + """    if np.isclose(table.sum(), 0):
        raise ValueError("impossible")
    return table / table.sum()""",
        ),
        mistake(
            "two states taken for granted",
            task="posterior",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def posterior(factor, wanted, heard):
    names, table = factor
    table = table.copy()
    for name, likelihood in heard.items():
        for state in range(2):
            table[(slice(None),) * names.index(name) + (state,)] *= likelihood[state]
    weights = table.sum(axis=tuple(k for k, n in enumerate(names) if n != wanted))
    if weights.sum() == 0:
        raise ValueError("impossible")
    return weights / weights.sum()""",
        ),
        # ---- task 3
        right("all paths, one after the other", task="separated", code=PATHS),
        right(
            "the Bayes ball",
            task="separated",
            code="""
def separated(parents, a, b, given=(), exact=()):
    given = set(given)
    for _ in parents:
        given |= {name for name in exact if set(parents[name]) <= given}
    above, queue = set(), list(given)
    while queue:
        name = queue.pop()
        above.add(name)
        queue += parents[name]
    seen, queue = set(), [(a, "up")]
    while queue:
        name, way = queue.pop()
        if (name, way) in seen:
            continue
        seen.add((name, way))
        if name == b:
            return False
        if (way == "up" and name not in given) or (way == "down" and name in above):
            queue += [(p, "up") for p in parents[name]]
        if name not in given:
            queue += [(c, "down") for c in parents if name in parents[c]]
    return True""",
        ),
        right(
            "numbers: random tables and the package's inference",
            task="separated",
            code="""
from semgrid_edu.graphical import GraphicalModel, enumerate_marginals


def separated(parents, a, b, given=(), exact=()):
    given = set(given)
    for _ in parents:
        given |= {name for name in exact if set(parents[name]) <= given}
    rng, factors = np.random.default_rng(0), []
    for child, above in parents.items():
        p = rng.uniform(0.2, 0.8, size=[2] * len(above))
        factors.append(Factor((*above, child), np.stack([p, 1 - p], axis=-1)))
    joint = enumerate_marginals(GraphicalModel(factors, parents), (a, b, *given)).table
    joint = joint / joint.sum(axis=(0, 1))
    product = joint.sum(axis=1, keepdims=True) * joint.sum(axis=0, keepdims=True)
    return bool(abs(joint - product).max() < 1e-12)""",
        ),
        right(
            "powers of a matrix of links",
            task="separated",
            code="""
def separated(parents, a, b, given=(), exact=()):
    given = set(given)
    for _ in parents:
        given |= {name for name in exact if set(parents[name]) <= given}
    names = list(parents)
    down = np.eye(len(names), dtype=int)
    for child, family in parents.items():
        for above in family:
            down[names.index(above), names.index(child)] = 1
    leads = np.linalg.matrix_power(down, len(names)) > 0
    kept = leads[:, [names.index(name) for name in (a, b, *given)]].any(axis=1)
    down = down * kept[:, None] * kept
    linked = down @ down.T + down + down.T
    known = [names.index(name) for name in given]
    linked[known], linked[:, known] = 0, 0
    reached = np.linalg.matrix_power(np.minimum(linked, 1) + np.eye(len(names)), len(names))
    return reached[names.index(a), names.index(b)] == 0""",
        ),
        mistake(
            "the package's Bayes ball, wrapped",
            task="separated",
            loses=4,
            says="pixel is exact and its parent known",
            code="""
from semgrid_edu.graphical import GraphicalModel, d_separated


def separated(parents, a, b, given=(), exact=()):
    tables = [Factor((name, *above), np.full([2] * (len(above) + 1), 0.5)) for name, above in parents.items()]
    return d_separated(GraphicalModel(tables, parents), a, b, given)""",
        ),
        mistake(
            "one known parent is enough",
            task="separated",
            loses=2,
            says="*all* its parents must be known",
            code=RECIPE.replace("set(parents[name]) <= given", "set(parents[name]) & given"),
        ),
        mistake(
            "what is exact looked at once",
            task="separated",
            loses=2,
            says="look again whenever something has become known",
            code=RECIPE.replace("for _ in parents:", "for _ in range(1):"),
        ),
        mistake(
            "what is exact taken for known",
            task="separated",
            loses=4,
            says="nothing is known: pixel is exact, but its parent isn't known",
            code=RECIPE.replace("if set(parents[name]) <= given", ""),
        ),
        mistake(
            "the argument changed",
            task="separated",
            loses=2,
            says="changed its argument `parents`",
            code=RECIPE.replace("    given = set", "    parents.update(dict.fromkeys(given, ()))\n    given = set", 1)
            .replace("parents.update", "old = dict(parents)\n    parents.update")
            .replace("parents[name]", "old[name]")
            .replace("parents[child]", "old[child]"),
        ),
        mistake(
            "answers the opposite",
            task="separated",
            loses=4,
            says="all answers are the opposite",
            code=RECIPE.replace("b not in reached", "b in reached"),
        ),
        mistake(
            "arrows ignored",
            task="separated",
            loses=4,
            says="arrows that meet block",
            code=RECIPE.replace("[a, b, *given]\n", "list(parents)\n", 1)
            .replace("queue += parents[name]\n    linked", "pass\n    linked")
            .replace(
                """        for name in family:
            linked[name] |= family
""",
                """        linked[child] |= family
        for name in parents[child]:
            linked[name].add(child)
""",
            ),
        ),
        mistake(
            "parents not married",
            task="separated",
            loses=4,
            says="Link its parents",
            code=RECIPE.replace(
                """        for name in family:
            linked[name] |= family
""",
                """        linked[child] |= family
        for name in parents[child]:
            linked[name].add(child)
""",
            ),
        ),
        mistake(
            "married in the whole graph",
            task="separated",
            loses=4,
            says="Take z out in step (1)",
            code=RECIPE.replace("[a, b, *given]\n", "list(parents)\n", 1),
        ),
        mistake(
            "what is known taken out before marrying",
            task="separated",
            loses=4,
            says="Link its parents",
            code=RECIPE.replace("    for child in kept:\n", "    for child in kept - set(given):\n"),
        ),
        mistake(
            "ancestors of what is known forgotten",
            task="separated",
            loses=4,
            says="Link its parents",
            code=RECIPE.replace("[a, b, *given]\n", "[a, b]\n", 1),
        ),
        mistake(
            "direct neighbours only",
            task="separated",
            loses=4,
            says="the chain is open while now isn't known",
            code="""
def separated(parents, a, b, given=(), exact=()):
    given = set(given)
    for _ in parents:
        given |= {name for name in exact if set(parents[name]) <= given}
    return a not in parents[b] and b not in parents[a]""",
        ),
        mistake(
            "what is known doesn't block",
            task="separated",
            loses=4,
            says="so it blocks the chain",
            code=RECIPE.replace("set(given), [a]", "set(), [a]"),
        ),
        mistake(
            "what is known blocks even where the two are linked",
            task="separated",
            loses=2,
            says="neighbours are never separated",
            code=RECIPE.replace(
                "    kept, queue",
                "    if given and b in parents and a in parents[b]:\n        return True\n    kept, queue",
                1,
            ),
        ),
        mistake(
            "a collider is opened by itself only",
            task="separated",
            loses=2,
            says="z lies below the collider r",
            code=PATHS.replace("bool(below(middle) & set(given))", "middle in given"),
        ),
        mistake(
            "a collider is opened by itself or its children, by nothing further down",
            task="separated",
            loses=2,
            says="on inputs you haven't seen: separated although a path is open",
            code=PATHS.replace("*(below(c) for c in children[name])", "children[name]"),
        ),
        mistake(
            "one blocked path is enough",
            task="separated",
            loses=2,
            says="all must be blocked",
            code=PATHS.replace(
                "    return not walk([a])",
                """    paths, queue = [], [[a]]
    while queue:
        path = queue.pop()
        if path[-1] == b:
            paths.append(path)
        else:
            steps = [*parents[path[-1]], *children[path[-1]]]
            queue += [[*path, name] for name in steps if name not in path]
    return not paths or any(
        not all(opens(*path[k : k + 3]) for k in range(len(path) - 2)) for path in paths
    )""",
            ),
        ),
        mistake(
            "one open collider opens the whole path",
            task="separated",
            loses=2,
            says="each collider on the path must be open",
            code=PATHS.replace("bool(below(middle) & set(given)) if collider", "bool(given) if collider"),
        ),
        mistake(
            "each variable visited once, from whichever side",
            task="separated",
            loses=2,
            says="on inputs you haven't seen",
            code="""
def separated(parents, a, b, given=(), exact=()):
    given = set(given)
    for _ in parents:
        given |= {name for name in exact if set(parents[name]) <= given}
    above, queue = set(), list(given)
    while queue:
        name = queue.pop()
        above.add(name)
        queue += parents[name]
    seen, queue = set(), [(a, "up")]
    while queue:
        name, way = queue.pop()
        if name in seen:
            continue
        seen.add(name)
        if name == b:
            return False
        if (way == "up" and name not in given) or (way == "down" and name in above):
            queue += [(p, "up") for p in parents[name]]
        if name not in given:
            queue += [(c, "down") for c in parents if name in parents[c]]
    return True""",
        ),
        # ---- task 4
        right("lists", task="eliminate", code=ELIMINATE),
        right(
            "the package's product, or reduce",
            task="eliminate",
            code="""
from functools import reduce

from semgrid_edu.graphical import product


def eliminate(factors, order, seen, best=()):
    factors = [f.given(**{n: seen[n] for n in f.names if n in seen}) for f in factors]
    sizes = []
    for name in order:
        without = [f for f in factors if name not in f.names]
        together = reduce(lambda f, g: f * g, [f for f in factors if name in f.names])
        sizes.append(int(np.prod(together.table.shape)))
        factors = [*without, (Factor.max if name in best else Factor.sum)(together, name)]
    return product(factors), max(sizes)""",
        ),
        mistake(
            "the package's elimination, wrapped; sizes from the names alone",
            task="eliminate",
            loses=2,
            says="take the largest entry over it, don't sum",
            code="""
from semgrid_edu.graphical import GraphicalModel
from semgrid_edu.graphical import eliminate as exact


def eliminate(factors, order, seen, best=()):
    model = GraphicalModel(factors)
    left = [name for name in model.names if name not in order and name not in seen]
    scopes, largest = [set(f.names) - set(seen) for f in factors], 0
    for name in order:
        together = set().union(*(s for s in scopes if name in s))
        largest = max(largest, int(np.prod([model.cardinalities[n] for n in together])))
        scopes = [s for s in scopes if name not in s] + [together - {name}]
    return exact(model, left, seen, order=order), largest""",
        ),
        right(
            "recursion",
            task="eliminate",
            code="""
from functools import reduce


def eliminate(factors, order, seen=(), best=()):
    factors = [f.given(**{n: seen[n] for n in f.names if n in seen}) for f in factors]
    if not order:
        return reduce(Factor.__mul__, factors), 0
    name, *rest = order
    together = reduce(Factor.__mul__, [f for f in factors if name in f.names])
    taken = together.max(name) if name in best else together.sum(name)
    result, largest = eliminate([f for f in factors if name not in f.names] + [taken], rest, best=best)
    return result, max(largest, together.table.size)""",
        ),
        mistake(
            "what is left counted too",
            task="eliminate",
            loses=1,
            says="from which a variable is taken out, not of what is left",
            code=ELIMINATE.replace("result, largest\n", "result, max(largest, result.table.size)\n"),
        ),
        mistake(
            "numbers thrown away",
            task="eliminate",
            loses=2,
            says="on inputs you haven't seen: right up to a factor",
            code=ELIMINATE.replace("+ [taken]", "+ [taken] * (together.table.ndim > 1)"),
        ),
        mistake(
            "everything multiplied first",
            task="eliminate",
            loses=1,
            says="you multiplied all factors first",
            code="""
def eliminate(factors, order, seen, best=()):
    factors = [f.given(**{n: seen[n] for n in f.names if n in seen}) for f in factors]
    together = factors[0]
    for f in factors[1:]:
        together = together * f
    largest = together.table.size
    for name in order:
        together = together.max(name) if name in best else together.sum(name)
    return together, largest""",
        ),
        mistake(
            "counted after the sum",
            task="eliminate",
            loses=1,
            says="count the product before the variable is summed out",
            code=ELIMINATE.replace("together.table.size", "together.sum(name).table.size"),
        ),
        mistake(
            "axes instead of entries",
            task="eliminate",
            loses=1,
            says="and its entries, not its axes",
            code=ELIMINATE.replace("together.table.size", "together.table.ndim"),
        ),
        mistake(
            "sizes added up",
            task="eliminate",
            loses=1,
            says="the largest counts",
            code=ELIMINATE.replace("max(largest, together.table.size)", "largest + together.table.size"),
        ),
        mistake(
            "the last size instead of the largest",
            task="eliminate",
            loses=1,
            says="keep the largest, not the last",
            code=ELIMINATE.replace("max(largest, together.table.size)", "together.table.size"),
        ),
        mistake(
            "an order of its own",
            task="eliminate",
            loses=1,
            says="keep to `order`",
            code=ELIMINATE.replace("in order:", "in sorted(order):"),
        ),
        mistake(
            "used factors kept",
            task="eliminate",
            loses=3,
            says="take used factors out of the list",
            code=ELIMINATE.replace("[f for f in factors if name not in f.names] + [taken", "factors + [taken"),
        ),
        mistake(
            "the sum never put back",
            task="eliminate",
            loses=3,
            says="put each sum back among the factors",
            code=ELIMINATE.replace(" + [taken]", "").replace(
                "    result = factors[0]\n",
                "    if not factors:\n        return Factor((), 1.0), largest\n    result = factors[0]\n",
            ),
        ),
        mistake(
            "summed first, then multiplied",
            task="eliminate",
            loses=3,
            says="multiply first, then sum",
            code="""
def eliminate(factors, order, seen, best=()):
    factors = [f.given(**{n: seen[n] for n in f.names if n in seen}) for f in factors]
    largest = 0
    for name in order:
        touching = [f for f in factors if name in f.names]
        largest = max(largest, *(f.table.size for f in touching))
        together = Factor((), 1.0)
        for f in touching:
            together = together * f.sum(name)
        factors = [f for f in factors if name not in f.names] + [together]
    result = factors[0]
    for f in factors[1:]:
        result = result * f
    return result, largest""",
        ),
        mistake(
            "every message normalised",
            task="eliminate",
            loses=2,
            says="normalise nowhere",
            code=ELIMINATE.replace("+ [taken]", "+ [taken.normalised()]").replace(
                "return result, largest", "return Factor(result.names, result.table / 4), largest"
            ),
        ),
        mistake(
            "the result normalised",
            task="eliminate",
            loses=2,
            says="don't normalise",
            code=ELIMINATE.replace("return result,", "return result.normalised(),"),
        ),
        mistake(
            "only the factor returned",
            task="eliminate",
            loses=1,
            says="got one Factor",
            code=ELIMINATE.replace("return result, largest", "return result"),
        ),
        mistake(
            "two states taken for granted",
            task="eliminate",
            loses=1,
            says="on inputs you haven't seen: wrong size of the largest table",
            code=ELIMINATE.replace("together.table.size", "2 ** together.table.ndim"),
        ),
        mistake(
            "only the last factor returned",
            task="eliminate",
            loses=2,
            says="on inputs you haven't seen: wrong result",
            code=ELIMINATE.replace("result = factors[0]\n", "result = factors[-1]\n    return result, largest\n"),
        ),
        mistake(
            "the companion's function, pasted",
            task="eliminate",
            loses=3,
            says="takes 2 positional arguments",
            code="""
from functools import reduce

from semgrid_edu.graphical import product


def eliminate(factors, order):
    entries = []
    for name in order:
        together = reduce(Factor.__mul__, [f for f in factors if name in f.names])
        entries.append(together.table.size)
        factors = [f for f in factors if name not in f.names] + [together.sum(name)]
    return product(factors), max(entries)""",
        ),
        mistake(
            "what is seen is ignored",
            task="eliminate",
            loses=3,
            says="then it has no axis any more",
            code=ELIMINATE.replace("seen.items()", "()"),
        ),
        mistake(
            "what is seen is summed out",
            task="eliminate",
            loses=3,
            says="you summed m2 out",
            code=ELIMINATE.replace("seen.items()", "()").replace("in order:", "in [*order, *seen]:"),
        ),
        mistake(
            "always state 0",
            task="eliminate",
            loses=2,
            says="slice at the state that was seen",
            code=ELIMINATE.replace("{n: s for", "{n: 0 for"),
        ),
        # ---- task 5
        right(
            "loops over states",
            task="messages",
            code="""
def filtered(start, M, likelihoods):
    rows, message = [], list(start)
    for row in likelihoods:
        weights = [m * p for m, p in zip(message, row)]
        rows.append([w / sum(weights) for w in weights])
        message = [sum(rows[-1][i] * M[i][j] for i in range(len(M))) for j in range(len(M))]
    return np.array(rows)


def smoothed(start, M, likelihoods):
    rows, message = filtered(start, M, likelihoods), [1.0] * len(start)
    for t in range(len(rows) - 1, -1, -1):
        weights = [f * m for f, m in zip(rows[t], message)]
        rows[t] = [w / sum(weights) for w in weights]
        back = [sum(M[i][j] * likelihoods[t][j] * message[j] for j in range(len(M))) for i in range(len(M))]
        message = [b / sum(back) for b in back]
    return rows""",
        ),
        right(
            "backwards by division, after Rauch, Tung and Striebel",
            task="messages",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    rows = filtered(start, M, likelihoods)
    for t in reversed(range(len(rows) - 1)):
        rows[t] = rows[t] * (M @ (rows[t + 1] / (rows[t] @ M)))
    return rows""",
        ),
        right(
            "in logarithms",
            task="messages",
            code="""
from scipy.special import logsumexp


def filtered(start, M, likelihoods):
    rows, message = [], np.log(start)
    for row in np.log(likelihoods):
        rows.append(message + row - logsumexp(message + row))
        message = logsumexp(rows[-1][:, None] + np.log(M), axis=0)
    return np.exp(rows)


def smoothed(start, M, likelihoods):
    rows, message = np.log(filtered(start, M, likelihoods)), np.zeros(len(start))
    for t in reversed(range(len(rows))):
        back = logsumexp(np.log(M) + np.log(likelihoods[t]) + message, axis=1)
        rows[t] += message - logsumexp(rows[t] + message)
        message = back
    return np.exp(rows)""",
        ),
        right(
            "recursion",
            task="messages",
            code="""
def filtered(start, M, likelihoods):
    belief = start * likelihoods[0] / (start @ likelihoods[0])
    rest = filtered(belief @ M, M, likelihoods[1:]) if len(likelihoods) > 1 else []
    return [belief, *rest]


def backward(M, likelihoods):
    if len(likelihoods) == 1:
        return [np.ones(len(M))]
    rest = backward(M, likelihoods[1:])
    message = M @ (likelihoods[1] * rest[0])
    return [message / message.sum(), *rest]


def smoothed(start, M, likelihoods):
    weights = np.array(filtered(start, M, likelihoods)) * backward(M, likelihoods)
    return weights / weights.sum(axis=1, keepdims=True)""",
        ),
        mistake(
            "a move before the first scan",
            task="messages",
            loses=2,
            says="no move before it",
            code=FILTERED.replace("b = [], start", "b = [], start @ M") + SMOOTHED,
        ),
        mistake(
            "not normalised",
            task="messages",
            loses=4,
            says="normalise each row",
            code=FILTERED.replace(" / (b @ row)", "") + SMOOTHED.replace(" / (beliefs[t] @ message)", ""),
        ),
        mistake(
            "the prediction returned",
            task="messages",
            loses=2,
            says="return the belief at the time of the scan",
            code=FILTERED.replace("rows.append(b)\n        b = b @ M", "b = b @ M\n        rows.append(b)") + SMOOTHED,
        ),
        mistake(
            "the first scan missing",
            task="messages",
            loses=2,
            says="the first scan is missing",
            code="""
def filtered(start, M, likelihoods):
    rows = [start]
    for row in likelihoods[1:]:
        b = (rows[-1] @ M) * row
        rows.append(b / b.sum())
    return np.array(rows)

"""
            + SMOOTHED,
        ),
        mistake(
            "M transposed",
            task="messages",
            loses=2,
            says="a belief stands to its left",
            code=FILTERED.replace("b = b @ M", "b = M @ b") + SMOOTHED,
        ),
        mistake(
            "nothing moves",
            task="messages",
            loses=2,
            says="nothing moved between the scans",
            code=FILTERED.replace("        b = b @ M\n", "") + SMOOTHED,
        ),
        mistake(
            "each row from the start",
            task="messages",
            loses=2,
            says="carry the belief on",
            code="""
def filtered(start, M, likelihoods):
    weights = np.array([start, *[start @ M] * (len(likelihoods) - 1)]) * likelihoods
    return weights / weights.sum(axis=1, keepdims=True)

"""
            + SMOOTHED,
        ),
        mistake(
            "arguments changed",
            task="messages",
            loses=2,
            says="changed its argument `likelihoods`",
            code="""
def filtered(start, M, likelihoods):
    likelihoods[0] *= start
    likelihoods[0] /= likelihoods[0].sum()
    for t in range(1, len(likelihoods)):
        likelihoods[t] *= likelihoods[t - 1] @ M
        likelihoods[t] /= likelihoods[t].sum()
    return likelihoods


def smoothed(start, M, likelihoods):
    beliefs, message = filtered(start, M, likelihoods.copy()), np.ones(len(start))
    for t in range(len(likelihoods) - 1, -1, -1):
        beliefs[t] = beliefs[t] * message / (beliefs[t] @ message)
        message = M @ (likelihoods[t] * message)
        message = message / message.sum()
    return beliefs""",
        ),
        mistake(
            "underflow in the filter",
            task="messages",
            loses=2,
            says="on inputs you haven't seen: NaN after hundreds of scans",
            code="""
def filtered(start, M, likelihoods):
    rows, message = [], start
    for row in likelihoods:
        rows.append(message * row)
        message = rows[-1] @ M
    return np.array(rows) / np.sum(rows, axis=1, keepdims=True)

"""
            + SMOOTHED,
        ),
        mistake(
            "the filter starts again where it underflows",
            task="messages",
            loses=2,
            says="on inputs you haven't seen: wrong after hundreds of scans",
            code="""
def filtered(start, M, likelihoods):
    rows, message = [], start
    for row in likelihoods:
        rows.append(message * row)
        message = rows[-1] @ M
        if message.sum() < 1e-250:
            message = np.ones(len(start))
    return np.array(rows) / np.sum(rows, axis=1, keepdims=True)

"""
            + SMOOTHED,
        ),
        mistake(
            "underflow in the message backwards",
            task="messages",
            loses=2,
            says="on inputs you haven't seen: NaN after hundreds of scans",
            code=FILTERED + SMOOTHED.replace("        message = message / message.sum()\n", ""),
        ),
        mistake(
            "its own scan in the message",
            task="messages",
            loses=2,
            says="the last scan is counted twice",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    beliefs, message = filtered(start, M, likelihoods), np.ones(len(start))
    for t in range(len(likelihoods) - 1, -1, -1):
        message = likelihoods[t] * message
        beliefs[t] = beliefs[t] * message / (beliefs[t] @ message)
        message = M @ message
        message = message / message.sum()
    return beliefs""",
        ),
        mistake(
            "two filters multiplied",
            task="messages",
            loses=2,
            says="a filter run backwards holds scan t too",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    both = filtered(start, M, likelihoods) * filtered(start, M, likelihoods[::-1])[::-1]
    return both / both.sum(axis=1, keepdims=True)""",
        ),
        mistake(
            "the filter run backwards alone",
            task="messages",
            loses=2,
            says="the past is missing",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    return filtered(start, M, likelihoods[::-1])[::-1]""",
        ),
        mistake(
            "a message without likelihoods",
            task="messages",
            loses=2,
            says="that is still the filter",
            code=FILTERED + SMOOTHED.replace("(likelihoods[t] * message)", "message"),
        ),
        mistake(
            "M transposed on the way back",
            task="messages",
            loses=2,
            says="M @ message sums over where it goes next",
            code=FILTERED + SMOOTHED.replace("M @ (likelihoods[t] * message)", "(likelihoods[t] * message) @ M"),
        ),
        mistake(
            "the likelihood of the wrong scan",
            task="messages",
            loses=2,
            says="you took that of scan t",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    beliefs, message = filtered(start, M, likelihoods), np.ones(len(start))
    for t in range(len(likelihoods) - 2, -1, -1):
        message = M @ (likelihoods[t] * message)
        message = message / message.sum()
        beliefs[t] = beliefs[t] * message / (beliefs[t] @ message)
    return beliefs""",
        ),
        mistake(
            "the message doesn't pass M",
            task="messages",
            loses=2,
            says="the message must pass M",
            code=FILTERED + SMOOTHED.replace("M @ (likelihoods[t] * message)", "likelihoods[t] * message"),
        ),
        mistake(
            "backwards without dividing by the prediction",
            task="messages",
            loses=2,
            says="divide the smoothed row t + 1 by its prediction",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    rows = filtered(start, M, likelihoods)
    for t in reversed(range(len(rows) - 1)):
        rows[t] = rows[t] * (M @ rows[t + 1])
        rows[t] /= rows[t].sum()
    return rows""",
        ),
        mistake(
            "averaged",
            task="messages",
            loses=2,
            says="multiplied, not averaged",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    rows = filtered(start, M, likelihoods)
    rows[:-1] = (rows[:-1] + filtered(start, M, likelihoods[::-1])[::-1][:-1]) / 2
    return rows""",
        ),
        mistake(
            "one step back only",
            task="messages",
            loses=2,
            says="row 0 hears of scan 1 only",
            code=FILTERED
            + """
def smoothed(start, M, likelihoods):
    rows = filtered(start, M, likelihoods)
    for t in range(len(rows) - 1):
        rows[t] *= M @ likelihoods[t + 1]
        rows[t] /= rows[t].sum()
    return rows""",
        ),
    )

# %% [markdown]
# # Exercise 01b: graphical models
#
# Four pieces of a small inference library: the quotient of two tables, Bayes' rule on a table, independence read off a graph, and messages along a chain.
# Then one question to answer in words. About 90 minutes. The lecture is [01b: graphical models](../01b_graphical_models.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | divide two tables with named axes | 1 + 1 |
# | 2 | what is heard: multiply, sum out, normalise | 2 + 1 |
# | 3 | independence read off a graph | 2 + 2 |
# | 4 | messages along a chain, and which scan doesn't fit | 2 + 1 |
# | 5 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other inputs. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does


def _explain(got, slips):
    """Stop with a hint when `got` is what a common slip gives."""
    for slip, hint in slips.items():
        if np.shape(got) == np.shape(slip):
            assert not np.allclose(got, slip, atol=5e-4), f"got {np.round(got, 3).tolist()}: {hint}"


# %% [markdown]
# ## Task 1: divide by name (1 + 1 points)
#
# The lecture multiplies factors: $P(z, m) = P(m)\, P(z \mid m)$. Sometimes one must go back, from $P(z, m)$ and $P(m)$ to $P(z \mid m)$, or take a message out of a belief
# that it has been multiplied into. A factor is a pair `(names, table)`: a tuple of names, one for each axis, and a table of non-negative numbers. Complete `divide`: it
# returns the quotient, again as a pair, over the variables of `f`. An entry is the entry of `f` divided by the entry of `g` at the same states. All variables of `g` are
# among those of `f`, but their axes may stand at other places. You may choose the order of the result's axes, as long as `names` tells it.
# The second point is for factors that share several variables, for `g` without any (then its `names` is `()` and its table one number), and for zeros: where `g` is 0, `f` is 0 too, and the quotient is 0.


# %% nbgrader={"grade": false, "grade_id": "divide", "locked": false, "schema_version": 3, "solution": true, "task": false}
def divide(f, g):
    """Return the quotient of two factors as (names, table)."""
    ### BEGIN SOLUTION
    names = tuple(f[0])
    shared = [name for name in names if name in g[0]]
    below = np.transpose(g[1], [g[0].index(name) for name in shared])
    below = below[tuple(slice(None) if name in shared else None for name in names)]
    return names, np.divide(f[1], below, out=np.zeros(np.shape(f[1])), where=below > 0)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "quotient-hints", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_QUOTIENT_SLIPS = {  # rows m, columns z
    ((0.9, 7 / 30), (6 / 70, 0.8)): "the numbers of m divide along the axis of z: line the axes up by name",
    ((0.441, 0.049), (0.018, 0.072)): "you multiplied: a quotient divides",
    ((10 / 9, 10), (5, 1.25)): "upside down: divide f by g",
    ((0.45, 0.05), (0.1, 0.4)): "you divided by the sum: a quotient isn't normalised",
    ((0.9, 0.2), (0.1, 0.8)): "right numbers, wrong names: your names stand in another order than your axes",
}


# %% nbgrader={"grade": true, "grade_id": "divide-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    joint, cell = (("m", "z"), np.array([[0.63, 0.07], [0.06, 0.24]])), (("m",), np.array([0.7, 0.3]))
    before = joint[1].copy(), cell[1].copy()
    got = divide(joint, cell)
    assert got is not None, "divide returned nothing: did you forget `return`?"
    assert np.array_equal(joint[1], before[0]), "divide changed the table of `f`: make a new one (no /=)"
    assert np.array_equal(cell[1], before[1]), "divide changed the table of `g`: make a new one"
    assert isinstance(got, tuple | list), f"return a pair, (names, table), got {type(got).__name__}"
    assert len(got) == 2, f"return two things, the names and the table, got {len(got)}"
    names, table = tuple(got[0]), answer_array(got[1], "for the table divide")
    assert len(set(names)) == len(names), (
        f"the names {names} hold m twice: a variable that both factors have is one axis"
    )
    assert sorted(names) == ["m", "z"], f"the quotient is over the variables of f, m and z, yours is over {names}"
    assert table.shape == (2, 2), f"two variables of two states make a table of shape (2, 2), got {table.shape}"
    table = table if names == ("m", "z") else table.T
    _explain(table, _QUOTIENT_SLIPS)
    np.testing.assert_allclose(table, [[0.9, 0.1], [0.2, 0.8]], err_msg="P(z | m): 0.63 / 0.7, 0.07 / 0.7 for m = 0")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_divide(divide)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "divide-shared-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    f = ("m1", "m2"), np.array([[1.0, 200.0], [30.0, 0.0]])
    got = divide(f, (("m2", "m1"), np.array([[1.0, 10.0], [100.0, 0.0]])))
    assert isinstance(got, tuple | list), f"return a pair, (names, table), got {type(got).__name__}"
    names, table = got[0], answer_array(got[1], "for the table divide")
    assert sorted(names) == ["m1", "m2"], f"the quotient is over m1 and m2, yours is over {names}"
    assert np.isfinite(table).all(), "0 / 0 where m1 = 1 and m2 = 1: the quotient is 0 there"
    table = table if tuple(names) == ("m1", "m2") else table.T
    swapped = "the axes of g stand the other way round: sort them by name, not by place"
    _explain(table, {((1.0, 20.0), (0.3, 0.0)): swapped})
    np.testing.assert_allclose(table, [[1, 2], [3, 0]], err_msg="at m1 = 0, m2 = 1: f says 200 and g says 100")
    f = ("z", "a", "m"), np.arange(12.0, 36.0).reshape(2, 3, 4)
    for g in ((("m", "z"), np.arange(1.0, 9.0).reshape(4, 2)), ((), np.array(4.0))):
        names, table = divide(f, g)
        table = answer_array(table, f"for the table divide, where g has the names {g[0]},")
        assert sorted(names) == ["a", "m", "z"], f"the quotient is over z, a and m, yours is over {names}"
        size = {"z": 2, "a": 3, "m": 4}
        wanted = tuple(size[name] for name in names)
        assert table.shape == wanted, f"your names {tuple(names)} ask for the shape {wanted}, got {table.shape}"
        table = np.transpose(table, [list(names).index(name) for name in f[0]])
        below = g[1].T[:, None] if g[0] else g[1]
        np.testing.assert_allclose(table, f[1] / below, err_msg=f"three variables in f, and g has the names {g[0]}")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_divide_shared(divide)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: what is heard (2 + 1 points)
#
# The lecture slices a table at what is known for certain. A report is seldom certain. `factor` is again a pair `(names, table)`, a joint table of several variables. It need
# not sum to 1. `heard` is a dictionary, and may be empty. For each variable of which a report has come it holds the report's likelihood: `{"z": [0.3, 0.9]}` says that the
# report is three times as probable if z is 1 as if z is 0. So a likelihood needn't sum to 1, and `[0, 1]` is the report of a witness who is never wrong.
# Reports are independent of each other once all variables are known. There may be one about `wanted` itself.
#
# Complete `posterior`: it returns P(wanted | all reports), an array with one probability for each state of the variable `wanted`. For one more point: what is heard may be
# impossible, because every entry that agrees with it is 0. Then there is no answer, so raise a `ValueError`.


# %% nbgrader={"grade": false, "grade_id": "posterior", "locked": false, "schema_version": 3, "solution": true, "task": false}
def posterior(factor, wanted, heard):
    """Return P(wanted | all reports) as an array (K,)."""
    ### BEGIN SOLUTION
    names, weights = list(factor[0]), np.array(factor[1], float)
    for name, likelihood in heard.items():
        weights = np.moveaxis(np.moveaxis(weights, names.index(name), -1) * likelihood, -1, names.index(name))
    weights = weights.sum(axis=tuple(axis for axis, name in enumerate(names) if name != wanted))
    if weights.sum() == 0:
        raise ValueError("these reports exclude each other")
    return weights / weights.sum()
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "posterior-hints", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_POSTERIOR_SLIPS = {  # P(m2 | z is surely 1) by a common slip
    (19 / 41, 22 / 41): "you summed z out: something is heard of z, so its states don't count alike",
    (11 / 13, 2 / 13): "that is for z = 0: the first number of a likelihood is that of state 0",
    (6 / 28, 22 / 28): "that is the answer for m1: look where the axis of `wanted` is",
    (6 / 22, 16 / 22): "you took the largest entry over m1: an unknown variable is summed out",
    (8, 20): "these are weights: divide by their sum, 28",
    (8 / 41, 20 / 41): "these are the weights divided by the sum of the table as it was: divide by what is left of it",
    (2 / 6, 4 / 6): "you looked at m1 = 0 only: m1 isn't known, sum over its states",
    (2, 5): "you took the mean over the others: sum, then divide by the sum",
}
_UNSURE_SLIPS = {  # P(m2 | a report of z that is three times as probable if z is 1)
    (8 / 28, 20 / 28): "you take the report for certain: z may still be 0, with a smaller weight",
    (0.4258, 0.5742): "you mix the answers for z = 0 and z = 1: a likelihood multiplies the joint table",
    (8.75 / 41, 15.5 / 41): "divide by the sum of the weights, after the report has multiplied them",
    (10.5, 18.6): "these are weights: divide by their sum",
}


# %% nbgrader={"grade": true, "grade_id": "posterior-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    table = np.array([[[8.0, 2.0], [1.0, 4.0]], [[3.0, 6.0], [1.0, 16.0]]])  # axes m1, m2, z
    joint = (("m1", "m2", "z"), table.copy())
    got = answer_array(posterior(joint, "m2", {"z": [0, 1]}), "posterior")
    assert np.array_equal(joint[1], table), "posterior changed the table it was given: make a new one"
    assert got.shape == (2,), f"one probability for each of the 2 states of m2, shape (2,), got {got.shape}"
    _explain(got, _POSTERIOR_SLIPS)
    np.testing.assert_allclose(got, [8 / 28, 20 / 28], err_msg="m2 = 0: 2 + 6 = 8; m2 = 1: 4 + 16 = 20")
    got = answer_array(posterior(joint, "m2", {"z": [0.3, 0.9]}), "posterior")
    _explain(got, _UNSURE_SLIPS)
    by_hand = "m2 = 0: 0.3 * (8 + 3) + 0.9 * (2 + 6) = 10.5; m2 = 1: 0.3 * (1 + 1) + 0.9 * (4 + 16) = 18.6"
    np.testing.assert_allclose(got, [10.5 / 29.1, 18.6 / 29.1], err_msg=by_hand)
    got = answer_array(posterior(joint, "z", {"m1": [1, 0], "z": [1, 0.5]}), "posterior")
    _explain(got, {(9 / 15, 6 / 15): "there is a report of z itself: it counts like any other"})
    np.testing.assert_allclose(got, [3 / 4, 1 / 4], err_msg="m1 is 0: 8 + 1 = 9 for z = 0, half of 2 + 4 for z = 1")
    got = answer_array(posterior(joint, "z", {}), "posterior")
    np.testing.assert_allclose(got, [13 / 41, 28 / 41], err_msg="nothing heard: sum the others out")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_posterior(posterior)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "impossible-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    silent = (("m", "z"), np.array([[0.5, 0.0], [0.5, 0.0]]))  # a sensor that never says 1
    try:
        got, raised = posterior(silent, "m", {"z": [0, 1]}), False
    except ValueError:
        got, raised = None, True
    assert raised or got is not None, "z = 1 can't happen: raise ValueError instead of returning nothing"
    spread = not raised and np.isnan(answer_array(got, "posterior")).any()
    assert not spread, "0 / 0 gives NaN, which spreads silently: raise ValueError instead"
    assert raised, f"z = 1 can't happen, so nothing follows from it, not even {got}: raise ValueError"
    try:
        posterior((("m", "z"), np.array([[0.5, 0.0], [0.5, 0.2]])), "m", {"z": [0, 1]})
        can_happen = True
    except ValueError:
        can_happen = False
    assert can_happen, "here z = 1 can happen: a zero in one entry is no reason to raise"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_impossible(posterior)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: independence read off a graph (2 + 2 points)
#
# `parents` describes a directed graph: for each variable the tuple of its parents, `()` for one without. Complete `separated`: it returns `True` when every path between
# `a` and `b` is blocked once the variables in `given` are known, and `False` otherwise. Some variables may be **exact**: each of those in `exact` is a function of its parents, without noise,
# as the pixel of a point is a function of the camera's pose. So as soon as all its parents are known, it is known as well. (One without parents is known from the start.)
# For example, let arrows lead from *pose* to *pixel*, and from *pixel* to the readings *z1* and *z2*. If only the pose is known, z1 tells about z2. If the pixel is exact, it is known too, and blocks.
# `a` and `b` are two different variables
# that aren't known, not even after this step.
#
# First add to what is known whatever is exact and has no unknown parent, again and again. Then use the lecture's rule: look at every path from `a` to `b`, and at every variable inside it. Two helpers do the walking:
# `paths(parents, a, b)` lists all paths as tuples of names, from `a` to `b`, with or against the arrows and through no variable twice; `below(parents, name)` is the set of `name` and all variables further down its arrows.
# What is left for you is to say when a path is blocked.
#
# Two points are for graphs of three or four variables, two for larger ones.


# %% nbgrader={"grade": false, "grade_id": "walking", "locked": true, "schema_version": 3, "solution": false, "task": false}
def below(parents, name):
    """Return the set of `name` and all variables further down its arrows."""
    found = {name}
    while more := {child for child in parents if child not in found and found & set(parents[child])}:
        found |= more
    return found


def paths(parents, a, b):
    """Return all paths from a to b, each a tuple of names; none goes through a variable twice."""
    found, started = [], [(a,)]
    while started:
        path = started.pop()
        beside = {name for name in parents if name in parents[path[-1]] or path[-1] in parents[name]}
        longer = [(*path, name) for name in sorted(beside.difference(path))]
        found += [path for path in longer if path[-1] == b]
        started += [path for path in longer if path[-1] != b]
    return found


# %% nbgrader={"grade": false, "grade_id": "separated", "locked": false, "schema_version": 3, "solution": true, "task": false}
def separated(parents, a, b, given=(), exact=()):
    """Return whether the graph alone makes a and b independent once `given` is known."""
    ### BEGIN SOLUTION
    given = set(given)
    for _ in exact:
        given |= {name for name in exact if given.issuperset(parents[name])}

    def blocks(before, middle, after):
        if before in parents[middle] and after in parents[middle]:  # a collider
            return not below(parents, middle) & given
        return middle in given

    return all(any(blocks(*path[k : k + 3]) for k in range(len(path) - 2)) for path in paths(parents, a, b))
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "graphs", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_CHAIN = {"before": (), "now": ("before",), "after": ("now",)}
_FORK = {"m": (), "z1": ("m",), "z2": ("m",)}
_MEET = {"m1": (), "m2": (), "z": ("m1", "m2")}
_THREE = (
    (_CHAIN, "before", "after", (), False, "what acts on now acts on after: the chain is open while now isn't known"),
    (_CHAIN, "before", "after", ("now",), True, "now is known, so it blocks the chain: before has no other way"),
    (_FORK, "z1", "z2", (), False, "both beams hint at the same cell: the fork is open while m isn't known"),
    (_FORK, "z1", "z2", ("m",), True, "m is known, so it blocks the fork: only the sensor's own errors are left"),
    (_MEET, "m1", "m2", (), True, "z isn't known: a collider blocks until it, or something below it, is known"),
    (_MEET, "m1", "m2", ("z",), False, "explaining away: a known collider opens the path"),
    (_MEET, "m1", "z", ("m2",), False, "an arrow links them: neighbours are never separated"),
)
_PIXEL = {"pose": (), "pixel": ("pose",), "z1": ("pixel",), "z2": ("pixel",)}
_EXACT_FOUR = (
    (_PIXEL, "z1", "z2", ("pose",), ("pixel",), True, "pixel is exact and its parent known, so pixel is known too, and blocks"),
    (_PIXEL, "z1", "z2", ("pose",), (), False, "pixel isn't exact here: pose alone doesn't say what it is"),
    (_PIXEL, "z1", "z2", (), ("pixel",), False, "nothing is known: pixel is exact, but its parent isn't known"),
    (_FORK, "z1", "z2", (), ("m",), True, "m is exact and has no parent, so it is known from the start, and blocks"),
)  # fmt: skip


# %% nbgrader={"grade": true, "grade_id": "separated-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    graphs = [dict(parents) for parents, *_ in _THREE]
    got = [separated(graph, a, b, given) for graph, (_, a, b, given, _, _) in zip(graphs, _THREE, strict=True)]
    untouched = graphs == [parents for parents, *_ in _THREE]
    assert untouched, "separated changed its argument `parents`: make a new dictionary"
    assert all(np.shape(answer) == () and answer in (True, False) for answer in got), f"return True or False, got {got}"
    opposite = got == [not case[4] for case in _THREE]
    assert not opposite, "all answers are the opposite: True means separated, no open path"
    for answer, (_, a, b, given, right, hint) in zip(got, _THREE, strict=True):
        assert answer == right, f"{a} and {b} given {given}: you say {bool(answer)}, but {hint}"
    for parents, a, b, given, exact, right, hint in _EXACT_FOUR:
        answer = separated(dict(parents), a, b, given, exact)
        assert answer == right, f"{a} and {b} given {given}, exact {exact}: you say {bool(answer)}, but {hint}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_separated_three(separated)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% nbgrader={"grade": false, "grade_id": "large-graphs", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_RANGE = {"m1": (), "m2": (), "r": ("m1", "m2"), "z": ("r",)}
_SCANS = {"before": (), "now": ("before",), "after": ("now",), "z1": ("before",), "z2": ("now",), "z3": ("after",)}
_DUST = {"m": (), "dust": (), "z1": ("m", "dust"), "z2": ("m", "dust")}
_PITCH = {"m1": (), "m2": (), "pitch": (), "z1": ("m1", "pitch"), "z2": ("m2", "pitch")}
_LARGE = (
    (_RANGE, "m1", "m2", ("z",), False, "z lies below the collider r and tells something about it, so r is open"),
    (_RANGE, "m1", "m2", (), True, "neither r nor anything below it is known"),
    (_SCANS, "before", "after", ("z1", "z2", "z3"), False, "a scan of now is not now: the chain stays open"),
    (_SCANS, "before", "z3", ("now",), True, "now blocks the only way, however long it is"),
    (_DUST, "z1", "z2", ("m",), False, "m blocks one path, and the path through dust is open: all must be blocked"),
    (_DUST, "z1", "z2", ("m", "dust"), True, "both paths are blocked"),
    (_PITCH, "m1", "m2", ("z1",), True, "z2 isn't known and blocks: each collider on the path must be open"),
    (_PITCH, "m1", "m2", ("z1", "z2"), False, "both colliders are known: the path through the pitch is open"),
    (_PITCH, "m1", "m2", ("z1", "z2", "pitch"), True, "pitch is the middle of a fork, and known: it blocks"),
)
_LOOKUP = {"pose": (), "K": (), "ray": ("pose",), "pixel": ("ray", "K"), "z1": ("pixel",), "z2": ("pixel",)}
_EXACT_LARGE = (
    (("K", "pose"), True, "pose gives ray, and ray and K give pixel: look again whenever something has become known"),
    (("pose",), False, "K isn't known, so pixel isn't either: *all* its parents must be known"),
)


# %% nbgrader={"grade": true, "grade_id": "separated-large-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    for parents, a, b, given, right, hint in _LARGE:
        answer = separated(dict(parents), a, b, given)
        assert np.shape(answer) == (), f"return True or False, got {answer}"
        assert answer == right, f"{a} and {b} given {given}: you say {answer}, but {hint}"
    for given, right, hint in _EXACT_LARGE:
        answer = separated(dict(_LOOKUP), "z1", "z2", given, ("pixel", "ray"))
        assert answer == right, f"z1 and z2 given {given}, ray and pixel exact: you say {answer}, but {hint}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_separated_large(separated)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: messages along a chain (2 + 1 points)
#
# Something has K states and is scanned T times; from time to time it may change its state, as in the lecture. `prior`, (K,), is P(state at time 0). `M`, (K, K), has a row for each state
# before a step and a column for each state after it. `scans`, (T, K), has a row for each scan: how probable this scan is in each state. A row of ones is a scan that got lost.
#
# Complete `messages`: it returns two tables, both (T, K). Row t of `from_left` is the message that arrives at time t from the left; it holds the prior and all scans *before* t, not the scan of t itself.
# Row t of `from_right` arrives from the right and holds all scans *after* t; nothing comes after the last, so its row is ones. Don't normalise any of them. (Then each row of
# `from_left * scans * from_right` has the same sum, the probability of all the scans. Why?)
#
# Complete `credible`, for one more point: which scan doesn't fit the others? It returns for each scan how probable it was, given *all the other* scans, (T,). Use your messages: what do they say of the state at time t, without
# the scan of t, and how probable is the scan then?


# %% nbgrader={"grade": false, "grade_id": "messages", "locked": false, "schema_version": 3, "solution": true, "task": false}
def messages(prior, M, scans):
    """Return the messages from the left and from the right, both (T, K), not normalised."""
    ### BEGIN SOLUTION
    from_left, from_right = [np.asarray(prior)], [np.ones(len(prior))]
    for scan in scans[:-1]:
        from_left.append((from_left[-1] * scan) @ M)
    for scan in scans[:0:-1]:
        from_right.append(M @ (scan * from_right[-1]))
    return np.array(from_left), np.array(from_right[::-1])
    ### END SOLUTION


def credible(prior, M, scans):
    """Return how probable each scan was, given all the others, (T,)."""
    ### BEGIN SOLUTION
    from_left, from_right = messages(prior, M, scans)
    without = from_left * from_right
    return (without * scans).sum(axis=1) / without.sum(axis=1)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "a-chain", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_PRIOR, _M, _TWO_SCANS = np.array([0.5, 0.5]), np.array([[0.9, 0.1], [0.3, 0.7]]), np.array([[0.8, 0.4], [0.2, 1.0]])
_LOST = np.array([[0.8, 0.4], [1.0, 1.0], [0.2, 1.0]])  # the scan of time 1 got lost
_LEFT_SLIPS = {  # row 1 of from_left: (0.5 * 0.8, 0.5 * 0.4) = (0.4, 0.2), then M
    (0.084, 0.18): "the scan of time 1 is in its own message: it comes from neither side",
    (0.6, 0.4): "the scan of time 0 is missing: it is before time 1",
    (0.38, 0.26): "M stands the wrong way round: a row is the state before the step",
    (0.7, 0.3): "these sum to 1: don't normalise",
    (0.48, 0.16): "the scan of time 0 belongs to the state at time 0: multiply it in before the step",
    (0.4, 0.2): "the step is missing: a message goes through M",
}
_RIGHT_SLIPS = {  # row 0 of from_right: M times (0.2, 1.0)
    (0.48, 0.72): "M stands the wrong way round: from the right, sum over the state AFTER the step, its columns",
    (0.224, 0.304): "the scan of time 0 is in its own message: it comes from neither side",
    (0.28 / 1.04, 0.76 / 1.04): "these sum to 1: don't normalise",
    (0.14, 0.38): "the prior is in the message from the right: it belongs to the left alone",
    (0.76, 0.52): "that is the scan of time 0: from the right come the scans after t",
    (1, 1): "nothing arrives at time 0: the last row is ones, and from there go back",
}


# %% nbgrader={"grade": true, "grade_id": "messages-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    given = _PRIOR.copy(), _M.copy(), _TWO_SCANS.copy()
    got = messages(*given)
    assert got is not None, "messages returned nothing: did you forget `return`?"
    kept = all(np.array_equal(now, old) for now, old in zip(given, (_PRIOR, _M, _TWO_SCANS), strict=True))
    assert kept, "messages changed a table that it was given: make a new one"
    assert isinstance(got, tuple | list), f"return two tables, from_left and from_right, got {type(got).__name__}"
    assert len(got) == 2, f"return two tables, from_left and from_right, got {len(got)}"
    left, right = (answer_array(one, "messages") for one in got)
    assert left.shape == right.shape == (2, 2), f"both are (T, K) = (2, 2), got {left.shape} and {right.shape}"
    _explain(left[0], {(0.4, 0.2): "row 0 of from_left is the prior alone: no scan comes before time 0"})
    _explain(left[1], _LEFT_SLIPS)
    _explain(right[0], _RIGHT_SLIPS)
    _explain(right[1], {(0.2, 1.0): "the last row of from_right is ones: its own scan doesn't come from the right"})
    by_hand = "row 1: 0.4 * 0.9 + 0.2 * 0.3 and 0.4 * 0.1 + 0.2 * 0.7"
    np.testing.assert_allclose(left, [[0.5, 0.5], [0.42, 0.18]], atol=1e-9, err_msg=by_hand)
    by_hand = "row 0: 0.9 * 0.2 + 0.1 * 1.0 and 0.3 * 0.2 + 0.7 * 1.0"
    np.testing.assert_allclose(right, [[0.28, 0.76], [1, 1]], atol=1e-9, err_msg=by_hand)
    left, right = (answer_array(one, "messages") for one in messages(_PRIOR.copy(), _M.copy(), _LOST.copy()))
    assert left.shape == right.shape == (3, 2), f"three scans: both are (3, 2), got {left.shape} and {right.shape}"
    repeated = np.allclose(left[2], left[1])
    assert not repeated, "row 2 of from_left repeats row 1: go on from the message before it, by one step"
    repeated = np.allclose(right[0], right[1])
    assert not repeated, "row 0 of from_right repeats row 1: go on from the message after it, by one step"
    by_hand = "a lost scan in the middle; row 2: 0.42 * 0.9 + 0.18 * 0.3 and 0.42 * 0.1 + 0.18 * 0.7"
    np.testing.assert_allclose(left, [[0.5, 0.5], [0.42, 0.18], [0.432, 0.168]], atol=1e-9, err_msg=by_hand)
    by_hand = "a lost scan in the middle; row 0: 0.9 * 0.28 + 0.1 * 0.76 and 0.3 * 0.28 + 0.7 * 0.76"
    np.testing.assert_allclose(right, [[0.328, 0.616], [0.28, 0.76], [1, 1]], atol=1e-9, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_messages(messages)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "credible-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    got = answer_array(credible(_PRIOR.copy(), _M.copy(), _TWO_SCANS.copy()), "credible")
    assert got.shape == (2,), f"one number for each of the 2 scans, shape (2,), got {got.shape}"
    all_scans = "that is the probability of ALL scans: divide by that of the others alone"
    _explain(got, {(0.264, 0.264): all_scans})
    _explain(got[0], {0.6: "that is before any other scan: from the right come the scans after it"})
    right = 0.264 / 0.52, 0.264 / 0.6
    by_hand = "scan 0: without it 0.5 * 0.28, 0.5 * 0.76; with it 0.8 and 0.4 times as much"
    np.testing.assert_allclose(got, right, atol=1e-9, err_msg=by_hand)
    three = np.array([[0.8, 0.4], [0.3, 0.9], [0.2, 1.0]])
    got = answer_array(credible(_PRIOR.copy(), _M.copy(), three), "credible")
    assert got.shape == (3,), f"one number for each of the 3 scans, shape (3,), got {got.shape}"
    _explain(got[1], {0.48: "the scan of time 1 is between two others: what comes from the right is missing"})
    right = 0.1584 / np.array([0.324, 0.2544, 0.288])
    by_hand = "scan 1: without it 0.42 * 0.28, 0.18 * 0.76; with it 0.3 and 0.9 times as much"
    np.testing.assert_allclose(got, right, atol=1e-9, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import graphical_models

    complaint = graphical_models.check_credible(credible)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: in your own words (2 points)
#
# Two cells are one behind the other on the way of a coarse beam. Before any beam each is occupied with probability 0.2, whatever the other is. A return says "at least one of you is occupied", and not
# which; it never errs. A second beam along the same way returns, too. An occupancy grid (lecture 02) keeps one probability per cell. At each return it updates both cells separately, by Bayes' rule with
# the likelihood 1 if the cell is occupied and 0.2 if it is free.
#
# 1. Which edges does the true graph of two cells and two beams have, and which dependence does the grid forget after the first beam?
# 2. Another sensor now reports for certain that the front cell is *free*. What should happen to the probability of the rear cell, and what happens in the grid?
# 3. Suppose that ten more of the coarse beams had returned before this report, so that the grid is nearly sure of the rear cell. Is the grid right now, and for the right reason?
#
# Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "dropped-edge", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# Each return has arrows from both cells, so each is a collider, and once the returns are known the two cells depend on each other. The grid keeps only the two marginals after each beam, so it drops the coupling "at
# least one of you". When the front cell turns out to be free, only the rear cell can have returned the beams, so it is occupied for certain. In the grid nothing happens to it, because nothing links it to the front
# cell. After ten more returns the grid is nearly sure of the rear cell, and here this happens to be true. But the reason is wrong: each return counted as a new witness, although the true model learns nothing from the later ones. The
# grid was just as sure of the front cell, which is free. And had the report been *occupied*, the rear cell should have fallen back to its prior, and the grid would have kept it.
# One point for the collider and the dropped coupling, one for what should happen to the rear cell and why the grid's certainty after more beams isn't earned.

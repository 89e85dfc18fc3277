# %% [markdown]
# # Exercise 04: CMCDOT
#
# Five functions, with which you could write the filter again, and one question to answer in words. About 75 minutes.
# The lecture is [04: CMCDOT](../04_cmcdot.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | move, and sum in cells: dynamic mass and mean velocity | 2 |
# | 2 | a transition matrix, and what is born by it | 2 |
# | 3 | four states meet a scan, without 0/0 | 2 + 1 |
# | 4 | systematic resampling | 3 |
# | 5 | two opinions at arrival | 2 + 1 + 1 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.
#
# States are always in the order FREE, STATIC, DYNAMIC, UNKNOWN.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.answers import answer_array, answer_arrays

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.
FREE, STATIC, DYNAMIC, UNKNOWN = range(4)

# %% [markdown]
# ## Task 1: move, and sum in cells (2 points)
#
# Each of N particles has a position (x, y) in metres, a velocity (along x, along y) in m/s, both arrays (N, 2), and a weight, (N,). Positions are in
# the vehicle's frame of the **last** scan: x forward, y left. Since then the vehicle has driven `dx` metres forward and `dy` to the left; it hasn't turned.
#
# The grid is a map around the vehicle **now**, forward up: row 0 is the farthest ahead, column 0 the leftmost; the outer corner of cell (0, 0) lies at
# `x_max`, `y_max`, in metres; cells are `cell` metres wide; `shape` is (H, W).
#
# Complete `in_cells`: it returns `dynamic`, shape (H, W), the sum of the weights in each cell, and `velocity`, shape (2, H, W), the mean velocity over
# ground in each cell, **weighed by the weights**; NaN where no particle is. Particles outside the grid count nowhere.


# %% nbgrader={"grade": false, "grade_id": "in-cells", "locked": false, "schema_version": 3, "solution": true, "task": false}
def in_cells(position, velocity, weight, dx, dy, x_max, y_max, cell, shape):
    """Return dynamic probability (H, W) and mean velocity (2, H, W)."""
    ### BEGIN SOLUTION
    row = np.floor((x_max - (position[:, 0] - dx)) / cell).astype(int)
    col = np.floor((y_max - (position[:, 1] - dy)) / cell).astype(int)
    inside = (row >= 0) & (row < shape[0]) & (col >= 0) & (col < shape[1])
    where = (row[inside], col[inside])
    dynamic, moment = np.zeros(shape), np.zeros((2, *shape))
    np.add.at(dynamic, where, weight[inside])
    for axis in range(2):
        np.add.at(moment[axis], where, weight[inside] * velocity[inside, axis])
    return dynamic, np.where(dynamic > 0, moment / np.where(dynamic > 0, dynamic, 1), np.nan)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "in-cells-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # 3 x 4 cells of one metre, 0..3 m ahead. We drove 1 m: particles 0 and 1 are in cell (0, 2), far ahead, now.
    position = np.array([[3.5, 0.5], [3.3, 0.2], [2.4, 1.2], [4.5, 1.5]])  # the last one is ahead of the grid
    speed, weight = np.array([[10.0, 0], [2, 4], [-3, 1], [5, 5]]), np.array([0.1, 0.3, 0.2, 0.4])
    got = in_cells(position, speed, weight, dx=1, dy=0, x_max=3, y_max=3, cell=1, shape=(3, 4))
    assert isinstance(got, (tuple, list)), f"return two arrays, dynamic and velocity; got {got}"
    dynamic, velocity = answer_arrays(got, 2, "in_cells")
    assert dynamic.shape == (3, 4), f"expected dynamic of shape (3, 4), got {dynamic.shape}"
    assert velocity.shape == (2, 3, 4), f"expected velocity of shape (2, 3, 4), got {velocity.shape}"
    assert dynamic.any(), "we drove forward, so what stands comes nearer: subtract dx, dy"
    slips = {
        (0, 1, 0.2): "positions are in the frame of the last scan: we have driven dx, dy since",
        (2, 0, 0.4): "row and column are swapped: rows count along x (forward), columns along y (left)",
        (2, 2, 0.4): "row 0 is the farthest ahead: count rows from x_max",
        (0, 0, 0.4): "column 0 is the leftmost: count columns from y_max",
        (2, 1, 0.4): "a particle ahead of the grid fell into its last row: row -1 is outside",
        (0, 1, 0.4): "a particle ahead of the grid fell into row 0: int() and astype(int) cut -0.5 to 0; take np.floor first",
        (1, 0, 0.2): "a row has W cells: in one long row of all cells, (row, col) is cell row * W + col",
        (0, 2, 0.3): "two particles share cell (0, 2), you count one: `dynamic[rows, cols] += weight` keeps the last; use np.add.at",
        (0, 2, 0.2): "dx goes with x, column 0 of `position`, and dy with y",
    }  # fmt: skip
    for (row, col, slip), hint in slips.items():
        assert not np.isclose(dynamic[row, col], slip), f"{slip} in cell ({row}, {col}): {hint}"
    assert np.allclose(dynamic, [[0, 0, 0.4, 0], [0, 0.2, 0, 0], [0] * 4]), "sum the weights in each cell"
    mean = np.round(velocity[:, 0, 2], 2)
    assert not np.allclose(mean, [6, 2]), "that is the plain mean: one particle carries 0.1, the other 0.3"
    assert not np.allclose(mean, [1.6, 1.2]), "that sums weight times velocity: divide it by the sum of the weights"
    assert np.allclose(mean, [4, 3]), f"cell (0, 2): (0.1 * 10 + 0.3 * 2) / 0.4 = 4 and (0.3 * 4) / 0.4 = 3, got {mean}"
    assert np.isnan(velocity[:, 2, 1]).all(), "no particle is in cell (2, 1): its velocity is NaN, not a number"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_in_cells(in_cells)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: what becomes of a belief (2 points)
#
# `M[i, j]` is the probability that a cell in state i is in state j one step later; rows sum to 1. `belief` has the shape (4, H, W).
#
# Complete `mix`: it returns `after`, (4, H, W), and `newborn`, (H, W): that part of `after[DYNAMIC]` which was **not** DYNAMIC before. It has no
# particles yet, while the rest has. Leave the arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "mix", "locked": false, "schema_version": 3, "solution": true, "task": false}
def mix(belief, M):
    """Return the belief (4, H, W) after one step, and the newborn mass (H, W)."""
    ### BEGIN SOLUTION
    after = np.einsum("ij,ihw->jhw", M, belief)
    return after, after[DYNAMIC] - M[DYNAMIC, DYNAMIC] * belief[DYNAMIC]
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "mix-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    M = np.array([[0.8, 0, 0.1, 0.1], [0.2, 0.7, 0.1, 0], [0.1, 0.2, 0.5, 0.2], [0, 0, 0, 1]])
    belief = np.zeros((4, 1, 2))
    belief[:, 0, 0] = [0.5, 0.2, 0.3, 0]  # DYNAMIC after it: 0.5 * 0.1 + 0.2 * 0.1 + 0.3 * 0.5
    belief[:, 0, 1] = [0, 0, 0, 1]  # UNKNOWN stays so
    before = belief.copy()
    got = mix(belief, M)
    assert isinstance(got, (tuple, list)), f"return two arrays, after and newborn; got {got}"
    assert np.array_equal(belief, before), "mix changed its argument `belief`: make a new array"
    after, newborn = answer_arrays(got, 2, "mix")
    assert after.shape == (4, 1, 2), f"expected after of shape (4, 1, 2), got {after.shape}"
    backwards = np.allclose(after[:, 0, 0], M @ before[:, 0, 0])
    assert not backwards, "M is used the wrong way round, its row is the state before"
    assert np.allclose(after.sum(axis=0), 1), f"cell (0, 0) sums to {after[:, 0, 0].sum():.2f}: nothing may get lost"
    np.testing.assert_allclose(after[:, 0, 0], [0.47, 0.2, 0.22, 0.11], err_msg="by hand: sum over i of b_i M[i, j]")
    assert newborn.shape == (1, 2), f"expected newborn of shape (1, 2), got {newborn.shape}"
    slips = {
        0.22: "that is all that is DYNAMIC after the step: what was DYNAMIC before has its particles and isn't born again",
        **dict.fromkeys((0, -0.08), "what DYNAMIC loses is no negative birth: sum what comes in from the other three"),
        0.15: "that is what stays DYNAMIC: newborn is the rest, from the three other states",
        0.09: "M[i, j] leads from i to j: what turns DYNAMIC is in a column of M, not in its row",
        0.05: "STATIC and UNKNOWN may turn DYNAMIC too",
    }
    for slip, hint in slips.items():
        assert not np.isclose(newborn[0, 0], slip), f"newborn mass {newborn[0, 0]:.2f}: {hint}"
    np.testing.assert_allclose(newborn, [[0.07, 0]], atol=1e-9, err_msg="by hand: 0.5 * 0.1 + 0.2 * 0.1")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_mix(mix)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: four states meet a scan (2 + 1 points)
#
# `belief` is (4, H, W); `occupied` and `free`, each (H, W), are P(z | occupied) and P(z | free) of a scan. Where the two are equal the scan says
# nothing, and the cell keeps its belief. Where they differ,
#
# 1. somebody looks, so UNKNOWN is shared out among FREE, STATIC and DYNAMIC in the proportions `first_sight` (three numbers that sum to 1);
# 2. Bayes' rule: STATIC and DYNAMIC share P(z | occupied);
# 3. where nothing that was held possible explains the scan, nothing is known any more: UNKNOWN is 1.
#
# Complete `update`: it returns the belief after the scan, and leaves its arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(belief, occupied, free, first_sight):
    """Return the belief (4, H, W) after one scan."""
    ### BEGIN SOLUTION
    revealed = np.where(occupied != free, belief[UNKNOWN], 0)
    prior = belief + revealed * np.array([*first_sight, -1.0])[:, None, None]
    joint = prior * np.stack([free, occupied, occupied, free])
    total = joint.sum(axis=0)
    nothing_known = np.array([0.0, 0, 0, 1])[:, None, None]
    return np.where(total > 0, joint / np.where(total > 0, total, 1), nothing_known)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief = np.array([0.2, 0.2, 0.1, 0.5]).reshape(4, 1, 1)  # a return comes back from this cell
    before = belief.copy()
    got = update(belief, occupied=np.array([[0.8]]), free=np.array([[0.2]]), first_sight=(0.6, 0.3, 0.1))
    got = answer_array(got, "update")
    assert np.array_equal(belief, before), "update changed its argument `belief`: make a new array (no +=, no *=)"
    assert got.shape == (4, 1, 1), f"expected the shape of the belief, (4, 1, 1), got {got.shape}"
    seen = np.round(got[:, 0, 0], 2)
    assert np.isclose(seen[UNKNOWN], 0), f"somebody looked, yet UNKNOWN is {seen[UNKNOWN]}: share it out first"
    assert np.isclose(seen.sum(), 1, atol=0.02), f"the cell sums to {seen.sum():.2f}: divide by the sum over its states"
    slips = {
        (0.27, 0.55, 0.18, 0): "its old belief in FREE, STATIC and DYNAMIC got lost: add the shares of UNKNOWN to it",
        (0.11, 0.44, 0.44, 0): "the belief got lost: Bayes' rule multiplies it by the evidence",
        (0.24, 0.68, 0.07, 0): "DYNAMIC takes P(z | occupied) too, like STATIC",
        (0.14, 0.57, 0.29, 0): "UNKNOWN was thrown away: share it out among the three others",
        (0.8, 0.14, 0.06, 0): "P(z | occupied) and P(z | free) are swapped",
        (0.13, 0.5, 0.37, 0): "UNKNOWN isn't shared out evenly: `first_sight` has a number for each of the three",
        (0.26, 0.5, 0.24, 0): "share UNKNOWN out before you multiply by the evidence, not after",
    }
    for slip, hint in slips.items():
        assert not np.allclose(seen, slip, atol=0.006), f"the cell is {seen}: {hint}"
    np.testing.assert_allclose(
        seen, [0.2, 0.56, 0.24, 0], atol=0.005, err_msg="by hand: 0.10, 0.28, 0.12, divided by 0.50"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "update-limits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief = np.zeros((4, 1, 2))
    belief[:, 0, 0] = [0.2, 0.2, 0.1, 0.5]  # of this cell the scan says nothing ...
    belief[:, 0, 1] = [1, 0, 0, 0]  # ... and this one, surely free, is surely occupied
    got = update(belief, occupied=np.array([[0.5, 1.0]]), free=np.array([[0.5, 0.0]]), first_sight=(0.6, 0.3, 0.1))
    got = answer_array(got, "update")
    assert got.shape == (4, 1, 2), f"expected the shape of the belief, (4, 1, 2), got {got.shape}"
    assert np.isfinite(got).all(), "cell (0, 1) is 0/0: nothing explains its scan, so it must become UNKNOWN"
    silent, contradicted = np.round(got, 2)[:, 0].T
    assert not np.isclose(silent[UNKNOWN], 0), "nobody looked at cell (0, 0): there UNKNOWN stays"
    assert np.allclose(silent, [0.2, 0.2, 0.1, 0.5]), f"the scan is silent in cell (0, 0), yet it became {silent}"
    assert np.allclose(contradicted, [0, 0, 0, 1]), (
        f"nothing explains cell (0, 1): UNKNOWN should be 1, got {contradicted}"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_update_limits(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: systematic resampling (3 points)
#
# Lay the weights end to end on a line. Lay a comb over it, with `count` teeth a `count`-th of the line apart; the first tooth is `offset` (between 0
# and 1) of that distance from the beginning. Each tooth draws the particle it lies on; a tooth on the border of two draws the second.
#
# Complete `systematic`: it returns the `count` indices, in ascending order. The weights need not sum to 1.


# %% nbgrader={"grade": false, "grade_id": "systematic", "locked": false, "schema_version": 3, "solution": true, "task": false}
def systematic(weight, count, offset):
    """Return the indices (count,) that the teeth draw."""
    ### BEGIN SOLUTION
    ends = np.cumsum(weight)
    teeth = (np.arange(count) + offset) / count * ends[-1]
    return np.searchsorted(ends, teeth, side="right")
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "systematic-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    weight = np.array([1.0, 6.0, 3.0])  # a line 10 long, whose parts end at 1, 7 and 10; four teeth, 2.5 apart
    drawn = [systematic(weight.copy(), 4, 0.3) for _ in range(20)]  # at 0.75, 3.25, 5.75, 8.25
    got = answer_array(drawn[0], "systematic")
    assert got.shape == (4,), f"expected 4 indices, as many as `count`, got shape {got.shape}"
    assert np.issubdtype(np.asarray(drawn[0]).dtype, np.integer), f"an index must be an integer, got {got}"
    repeats = all(np.array_equal(got, again) for again in drawn)
    assert repeats, "the same call gave other indices: the comb has one offset, which is given; nothing else is random"
    slips = {
        (0, 0, 0, 0): "all teeth lie on particle 0: the weights sum to 10, not to 1",
        (1, 2, 2, 3): "every index is one too large: particle n ends at w_0 + ... + w_n",
        (1, 1, 2, 2): "the offset is a part of the distance between two teeth: divide it by `count` too",
        (1, 1, 2, 3): "the offset is a part of the distance between two teeth: divide it by `count` too",
        (0, 1, 2, 2): "the teeth are a count-th of the line apart, so the last isn't at its end",
        (
            1,
            1,
            1,
            2,
        ): "the first tooth lies on particle 0, which ends at 1: the weights lie on the line in their own order",
        (-1, 0, 0, 1): "every index is one too small: what begins at 0 is particle 0",
    }
    assert tuple(got) not in slips, f"got {got}: {slips.get(tuple(got))}"
    np.testing.assert_array_equal(got, [0, 1, 1, 2], err_msg="teeth at 0.75, 3.25, 5.75, 8.25")
    got = answer_array(systematic(weight.copy(), 4, 0.5), "systematic")
    assert got.tolist() != [0, 1, 1, 2], "offset 0.5 drew the same as offset 0.3: where the comb begins decides"
    np.testing.assert_array_equal(got, [1, 1, 1, 2], err_msg="offset 0.5: teeth at 1.25, 3.75, 6.25, 8.75")
    (got,) = answer_array(systematic(weight.copy(), 1, 0.8), "systematic")
    assert got == 2, "the tooth at 8 lies on particle 2: go on `while` a particle ends before the tooth, not `if`"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_systematic(systematic)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: two opinions at arrival (2 + 1 + 1 points)
#
# The cells have their own belief, `own` (4, H, W). Particles arrive in them with probability `arrives` (H, W). Take the two opinions as independent, strike
# out the one impossible combination, "something arrives" and STATIC, and normalise:
#
# | | FREE | STATIC | DYNAMIC | UNKNOWN |
# |---|---|---|---|---|
# | arrives | DYNAMIC | impossible | DYNAMIC | DYNAMIC |
# | doesn't | FREE | STATIC | DYNAMIC | UNKNOWN |
#
# This is a first version. The package's filter strikes out one combination more: something comes out of a wall and goes on along it, and nobody
# has seen that the cell is free. Leave it out here.
#
# Complete `meet`: it returns the belief (4, H, W). For the last point: the weights of all that arrives may sum to more than 1, and a cell may be
# STATIC for sure. So let particles claim 0.999 at most.


# %% nbgrader={"grade": false, "grade_id": "meet", "locked": false, "schema_version": 3, "solution": true, "task": false}
def meet(own, arrives):
    """Return the belief (4, H, W) after particles have arrived."""
    ### BEGIN SOLUTION
    a = np.minimum(arrives, 0.999)
    joint = (1 - a) * own
    joint[DYNAMIC] += a * (1 - own[STATIC])
    return joint / joint.sum(axis=0)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "meet-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    own = np.zeros((4, 1, 3))
    own[:, 0, 0] = [0.5, 0.5, 0, 0]  # four combinations of 1/4 each, one of them impossible
    own[:, 0, 1] = [0.1, 0.3, 0, 0.6]  # nothing arrives here
    own[:, 0, 2] = [0.5, 0.5, 0, 0]  # 0.8 arrives: of the combinations 0.4, 0.4, 0.1, 0.1 the second is impossible
    before = own.copy()
    got = answer_array(meet(own, np.array([[0.5, 0.0, 0.8]])), "meet")
    assert np.array_equal(own, before), "meet changed its argument `own`: make a new array"
    assert got.shape == (4, 1, 3), f"return the belief, of the shape of own, (4, 1, 3); got {got.shape}"
    fence, quiet, surer = np.round(got, 2)[:, 0].T
    assert np.allclose(quiet, [0.1, 0.3, 0, 0.6]), f"nothing arrives in cell (0, 1), yet it became {quiet}"
    assert np.isclose(fence.sum(), 1, atol=0.02), f"cell (0, 0) sums to {fence.sum():.2f}: divide by what is left"
    slips = {
        (0.25, 0.25, 0.5, 0): "a thing can't arrive where STATIC stands: strike that combination out",
        (0.5, 0, 0.5, 0): "`doesn't arrive and STATIC` is possible: don't strike it out",
        (0.5, 0.25, 0.25, 0): "the impossible quarter goes to no state: strike it out, then divide all that is left",
        (0.25, 0.5, 0.25, 0): "STATIC isn't always right: strike the combination out, then divide all that is left",
    }
    for slip, hint in slips.items():
        assert not np.allclose(fence, slip, atol=0.011), f"cell (0, 0) is {fence}: {hint}"
    np.testing.assert_allclose(
        fence, [0.33, 0.33, 0.33, 0], atol=0.01, err_msg="cell (0, 0): three combinations are left"
    )
    assert surer[DYNAMIC] > 0.5, (
        f"cell (0, 2) is {surer}: `arrives and FREE` isn't FREE, only `doesn't arrive and FREE` is"
    )
    by_hand = "cell (0, 2): 0.1, 0.1, 0.4, divided by 0.6"
    np.testing.assert_allclose(surer, [0.17, 0.17, 0.67, 0], atol=0.01, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_meet(meet)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "meet-dynamic-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    own = np.zeros((4, 1, 2))
    own[:, 0] = np.array([[0.4, 0, 0.6, 0]]).T  # something moves here already, perhaps
    got = answer_array(meet(own, np.array([[0.5, 0.0]])), "meet")
    assert got.shape == (4, 1, 2), f"return the belief, of the shape of own, (4, 1, 2); got {got.shape}"
    met, quiet = np.round(got, 2)[:, 0].T
    assert not np.isclose(quiet[DYNAMIC], 0), (
        "the own DYNAMIC of cell (0, 1) got lost: nothing arrives, it is still there"
    )
    slips = {
        0.71: "something arrives also where something moves already: that is DYNAMIC too",
        0.73: "you count its DYNAMIC mass twice: `arrives and DYNAMIC`, `doesn't arrive and DYNAMIC` are two parts of it",
        0.85: "you count its DYNAMIC mass twice: `arrives and DYNAMIC`, `doesn't arrive and DYNAMIC` are two parts of it",
    }
    for slip, hint in slips.items():
        assert not np.isclose(met[DYNAMIC], slip, atol=0.006), f"DYNAMIC {met[DYNAMIC]} instead of 0.8: {hint}"
    np.testing.assert_allclose(met, [0.2, 0, 0.8, 0], atol=0.01, err_msg="only `doesn't arrive and FREE` leaves FREE")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_meet_dynamic(meet)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "meet-limits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    own = np.zeros((4, 1, 2))
    own[STATIC, 0, 0] = 1
    own[FREE, 0, 1] = 1
    got = answer_array(meet(own.copy(), np.array([[1.0, 1.7]])), "meet")
    assert got.shape == (4, 1, 2), f"return the belief, of the shape of own, (4, 1, 2); got {got.shape}"
    assert np.isfinite(got).all(), (
        "surely STATIC, and surely something arrives: that is 0/0; let particles claim 0.999 at most"
    )
    assert got.min() >= 0, (
        f"a probability of {got.min():.2f}: arriving weights of 1.7 are claimed in full; at most 0.999"
    )
    most, less = (answer_array(meet(own.copy(), np.full((1, 2), a)), "meet") for a in (0.999, 0.998))
    np.testing.assert_allclose(got, most, atol=1e-6, err_msg="weights of 1 and 1.7 claim 0.999, no more and no less")
    assert not np.allclose(most, less, atol=1e-6), "0.999 and 0.998 make no difference: let particles claim up to 0.999"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_meet_limits(meet)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# You get a LIDAR that turns twice as fast: 20 scans a second instead of 10, each as good as before. A colleague's filter multiplies the belief by
# one fixed transition matrix at every step; yours takes M = exp(R dt). What goes wrong in your colleague's filter? And name one thing that
# changes in yours too, though nothing in the world has changed. Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "twice-as-fast", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The fixed matrix is applied twice as often, so in the colleague's world everything happens twice as fast: free space out of sight is forgotten in half the
# time, and twice as much is born and dies each second. With M = exp(R dt) two steps of 0.05 s are one of 0.1 s, so what is predicted doesn't depend on the scanner.
# The update does: scans are taken as independent, and there are twice as many, so the belief grows certain twice as fast, though a grazing ray or a hole in a bush is
# in most of them alike. (Also right: particles are resampled twice as often, so there is more noise and more newborn mass gets particles each second.)
# One point for the matrix, one for the evidence or the resampling.

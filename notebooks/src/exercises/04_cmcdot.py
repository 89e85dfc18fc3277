# %% [markdown]
# # Exercise 04: CMCDOT
#
# Five functions, none of which the lecture prints, and one question to answer in words. At the end your own filter runs on two streets. About 85 minutes.
# The lecture is [04: CMCDOT](../04_cmcdot.ipynb).
#
# | task | about | points | minutes |
# |---|---|---|---|
# | 1 | move, and sum in cells: dynamic mass and mean velocity | 2 | 20 |
# | 2 | two arrivals in one cell, exactly | 3 | 15 |
# | 3 | a scanner that also measures speed | 2 + 1 | 20 |
# | 4 | resampling with an offset for each tooth | 3 | 10 |
# | 5 | your filter on a simulated and on a real street | 2 | 10 |
# | 6 | in your own words | 2 | 10 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.
#
# States are always in the order FREE, STATIC, DYNAMIC, UNKNOWN.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array, answer_arrays
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import CmcdotParams

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
# ground in each cell, **weighted by the weights**; NaN where no particle is. Particles outside the grid count nowhere.


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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "in-cells-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # 3 x 4 cells of one metre, 0..3 m ahead. We drove 1 m ahead, 1 m right: particles 0 and 1 are in cell (0, 2) now.
    position = np.array([[3.5, -0.5], [3.3, -0.8], [2.4, 0.2], [4.5, 0.5]])  # the last one is ahead of the grid
    speed, weight = np.array([[10.0, 0], [2, 4], [-3, 1], [5, 5]]), np.array([0.1, 0.3, 0.2, 0.4])
    got = in_cells(position, speed, weight, dx=1, dy=-1, x_max=3, y_max=3, cell=1, shape=(3, 4))
    assert isinstance(got, (tuple, list)), f"return two arrays, dynamic and velocity; got {got}"
    dynamic, velocity = answer_arrays(got, 2, "in_cells")
    assert dynamic.shape == (3, 4), f"expected dynamic of shape (3, 4), got {dynamic.shape}"
    assert velocity.shape == (2, 3, 4), f"expected velocity of shape (2, 3, 4), got {velocity.shape}"
    assert dynamic.any(), "what stands comes nearer: subtract dx from x, column 0 of `position`, and dy from y"
    slips = {
        (0, 2, 0.2): "positions are in the frame of the last scan: we have driven dx, dy since",
        (0, 3, 0.4): "dx is subtracted and dy isn't: we have driven sideways, too",
        (2, 0, 0.4): "row and column are swapped: rows count along x (forward), columns along y (left)",
        (2, 2, 0.4): "row 0 is the farthest ahead: count rows from x_max",
        (0, 0, 0.4): "column 0 is the leftmost: count columns from y_max",
        (2, 1, 0.4): "a particle ahead of the grid fell into its last row: row -1 is outside",
        (0, 1, 0.4): "a particle ahead of the grid fell into row 0: int() and astype(int) cut -0.5 to 0; take np.floor first",
        (1, 0, 0.2): "a row has W cells: in one long row of all cells, (row, col) is cell row * W + col",
        (0, 2, 0.3): "two particles share cell (0, 2), you count one: `dynamic[rows, cols] += weight` keeps the last; use np.add.at",
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
# ## Task 2: two arrivals (3 points)
#
# The lecture's formula knows one arrival, with probability $a$, and the package adds up what arrives from all sides. Now be exact for two. From the left
# something arrives in the cell with probability `from_left`, from the right with `from_right`. The cell itself holds something STATIC with probability
# `static`, else it is FREE. The three are independent, until you know two rules. As in the lecture, **nothing arrives where something stands**. And
# **not both arrive**: in the lecture's table what moves in the cell and what arrives may be parts of one thing, but what comes from the left and what comes
# from the right are two things that would collide. So write down all combinations, strike out each that breaks a rule, and scale the rest to 1.
#
# Complete `two_arrivals`: its arguments are arrays (H, W), and it returns the belief of each cell, (3, H, W), in the order FREE, STATIC, DYNAMIC. At least
# one combination is always possible.


# %% nbgrader={"grade": false, "grade_id": "two-arrivals", "locked": false, "schema_version": 3, "solution": true, "task": false}
def two_arrivals(from_left, from_right, static):
    """Return the belief of each cell, (3, H, W), in which one of two things may arrive."""
    ### BEGIN SOLUTION
    none = (1 - from_left) * (1 - from_right)
    one = from_left * (1 - from_right) + from_right * (1 - from_left)
    possible = np.stack([none * (1 - static), none * static, one * (1 - static)])
    return possible / possible.sum(axis=0)
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "two-arrivals-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    arguments = [np.array([[p, q]]) for p, q in ((0.5, 0.6), (0.4, 0.0), (0.2, 0.5))]  # the second cell: one arrival
    got = answer_array(two_arrivals(*(a.copy() for a in arguments)), "two_arrivals")
    assert got.shape == (3, 1, 2), f"expected FREE, STATIC, DYNAMIC of 1 x 2 cells, shape (3, 1, 2), got {got.shape}"
    both, single = np.round(got[:, 0].T, 3)
    assert np.isclose(both.sum(), 1, atol=0.01), f"the first cell sums to {both.sum():.2f}: scale what is left to 1"
    slips = {
        (0.098, 0.024, 0.878): "you add up the two arrivals, as if at most one could come: they are independent",
        (
            0.279,
            0.07,
            0.651,
        ): "both may arrive here, and that counts as DYNAMIC: strike it out, because the two would collide",
        (0.3, 0.075, 0.625): "nothing arrives where something STATIC stands: strike that out, too",
        (0.24, 0.06, 0.7): "you strike out nothing: nothing arrives where something stands, and not both arrive",
    }
    for slip, hint in slips.items():
        assert not np.allclose(both, slip, atol=0.002), f"the first cell is {both}: {hint}"
    by_hand = "by hand: FREE 0.24, STATIC 0.06 and DYNAMIC 0.40, of what is left, 0.70"
    np.testing.assert_allclose(both, [0.343, 0.086, 0.571], atol=0.002, err_msg=by_hand)
    np.testing.assert_allclose(single, [2 / 7, 2 / 7, 3 / 7], atol=0.002, err_msg="one arrival: as in the lecture")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_two_arrivals(two_arrivals)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: a scanner that also measures speed (2 + 1 points)
#
# Newer scanners measure by the Doppler effect how fast a return comes nearer. So one scan *can* tell something that moves from something that stands:
# STATIC and DYNAMIC have likelihoods of their own. `belief` is (4, H, W); `likelihood` is (3, H, W): P(z | FREE), P(z | STATIC), P(z | DYNAMIC).
# Where all three are equal the scan says nothing, and the cell keeps its belief. Where they are not,
#
# 1. a scan has looked, so UNKNOWN is shared out among FREE, STATIC and DYNAMIC in the proportions `first_sight` (three numbers that sum to 1);
# 2. Bayes' rule;
# 3. where nothing that was held possible explains the scan, nothing is known any more: UNKNOWN is 1.
#
# Complete `update`: it returns the belief after the scan, and leaves its arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(belief, likelihood, first_sight):
    """Return the belief (4, H, W) after one scan."""
    ### BEGIN SOLUTION
    silent = (likelihood == likelihood[0]).all(axis=0)
    shared = np.where(silent, 0, belief[UNKNOWN])
    prior = belief + shared * np.array([*first_sight, -1.0])[:, None, None]
    joint = prior * np.concatenate([likelihood, likelihood[:1]])
    total = joint.sum(axis=0)
    nothing_known = np.array([0.0, 0, 0, 1])[:, None, None]
    after = np.where(total > 0, joint / np.where(total > 0, total, 1), nothing_known)
    return np.where(silent, belief, after)
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief = np.array([0.2, 0.2, 0.1, 0.5]).reshape(4, 1, 1)  # a return comes back, from something that hardly moves
    before = belief.copy()
    likelihood = np.array([0.2, 0.8, 0.4]).reshape(3, 1, 1)
    got = update(belief, likelihood, first_sight=(0.6, 0.3, 0.1))
    got = answer_array(got, "update")
    assert np.array_equal(belief, before), "update changed its argument `belief`: make a new array (no +=, no *=)"
    assert np.array_equal(likelihood.ravel(), [0.2, 0.8, 0.4]), (
        "update changed its argument `likelihood`: make a new array"
    )
    assert got.shape == (4, 1, 1), f"expected the shape of the belief, (4, 1, 1), got {got.shape}"
    seen = np.round(got[:, 0, 0], 2)
    assert np.isclose(seen[UNKNOWN], 0), f"a scan has looked, yet UNKNOWN is {seen[UNKNOWN]}: share it out first"
    assert np.isclose(seen.sum(), 1, atol=0.02), f"the cell sums to {seen.sum():.2f}: divide by the sum over its states"
    slips = {
        (0.2, 0.56, 0.24, 0): "this scanner tells DYNAMIC from STATIC: each has its own likelihood",
        (0.3, 0.6, 0.1, 0): "its old belief in FREE, STATIC and DYNAMIC got lost: add the shares of UNKNOWN to it",
        (0.14, 0.57, 0.29, 0): "the belief got lost: Bayes' rule multiplies it by the likelihood",
        (0.17, 0.67, 0.17, 0): "UNKNOWN was thrown away: share it out among the three others",
        (0.28, 0.39, 0.33, 0): "the likelihoods of STATIC and DYNAMIC are swapped",
        (0.15, 0.62, 0.23, 0): "UNKNOWN isn't shared out evenly: `first_sight` has a number for each of the three",
        (0.29, 0.56, 0.15, 0): "share UNKNOWN out before you multiply by the likelihood, not after",
    }
    for slip, hint in slips.items():
        assert not np.allclose(seen, slip, atol=0.006), f"the cell is {seen}: {hint}"
    by_hand = "by hand: 0.10, 0.28, 0.06, divided by 0.44"
    np.testing.assert_allclose(got[:, 0, 0], [0.227, 0.636, 0.136, 0], atol=0.002, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "update-limits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief = np.zeros((4, 1, 2))
    belief[:, 0, 0] = [0.2, 0.2, 0.1, 0.5]  # of this cell the scan says nothing ...
    belief[:, 0, 1] = [1, 0, 0, 0]  # ... and this one, surely free, is surely occupied
    likelihood = np.array([[0.5, 0.0], [0.5, 1.0], [0.5, 1.0]])[:, None]
    got = answer_array(update(belief, likelihood, first_sight=(0.6, 0.3, 0.1)), "update")
    assert got.shape == (4, 1, 2), f"expected the shape of the belief, (4, 1, 2), got {got.shape}"
    assert np.isfinite(got).all(), "cell (0, 1) is 0/0: nothing explains its scan, so it must become UNKNOWN"
    silent, contradicted = np.round(got, 2)[:, 0].T
    assert not np.isclose(silent[UNKNOWN], 0), "no scan looked at cell (0, 0): there UNKNOWN stays"
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
# ## Task 4: an offset for each tooth (3 points)
#
# The lecture's comb has one random number for all its teeth. In **stratified resampling** the line of all weights, end to end, is divided into `count`
# equal parts, and each part has one tooth, at a random place of its own: tooth i lies `offsets[i]` (between 0 and 1) of a part behind the beginning of
# part i. Each tooth draws the particle it lies on; a tooth on the border of two draws the second.
#
# Complete `stratified`: it returns the `count` indices, in ascending order. The weights need not sum to 1.


# %% nbgrader={"grade": false, "grade_id": "stratified", "locked": false, "schema_version": 3, "solution": true, "task": false}
def stratified(weight, count, offsets):
    """Return the indices (count,) that the teeth draw; `offsets` is (count,)."""
    ### BEGIN SOLUTION
    ends = np.cumsum(weight)
    teeth = (np.arange(count) + offsets) / count * ends[-1]
    return np.searchsorted(ends, teeth, side="right")
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "stratified-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    weight = np.array([1.0, 6.0, 3.0])  # a line 10 long, whose parts end at 1, 7 and 10; four parts, 2.5 long
    offsets = np.array([0.6, 0.2, 0.9, 0.1])  # teeth at 1.5, 3.0, 7.25, 7.75
    drawn = [stratified(weight.copy(), 4, offsets.copy()) for _ in range(20)]
    got = answer_array(drawn[0], "stratified")
    assert got.shape == (4,), f"expected 4 indices, as many as `count`, got shape {got.shape}"
    assert np.issubdtype(np.asarray(drawn[0]).dtype, np.integer), f"an index must be an integer, got {got}"
    assert all(np.array_equal(got, again) for again in drawn), "the same call gave other indices: the offsets are given"
    slips = {
        (1, 1, 1, 2): "that is the comb of the lecture, with the first offset for all: tooth i has its own, offsets[i]",
        (0, 0, 0, 0): "all teeth lie on particle 0: the weights sum to 10, not to 1",
        (2, 2, 3, 3): "every index is one too large: particle n ends at w_0 + ... + w_n",
        (0, 0, 1, 1): "every index is one too small: what begins at 0 is particle 0",
        (1, 1, 3, 2): "an offset is a part of a part: divide it by `count` too",
        (0, 1, 1, 2): "the offsets aren't used: tooth i lies offsets[i] of a part behind the beginning of part i",
    }
    assert tuple(got) not in slips, f"got {got}: {slips.get(tuple(got))}"
    np.testing.assert_array_equal(got, [1, 1, 2, 2], err_msg="teeth at 1.5, 3.0, 7.25, 7.75")
    (got,) = answer_array(stratified(weight.copy(), 1, np.array([0.8])), "stratified")
    assert got == 2, "the tooth at 8 lies on particle 2: go on `while` a particle ends before the tooth, not `if`"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_stratified(stratified)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: your filter on two streets (2 points)
#
# Now your resampling drives. Complete `track`:
#
# 1. write a class with one method, `draw(self, weight, count, rng)`, that returns `draws(weight, count, rng.random(count))`. The argument `draws` is your
#    `stratified`, or a function like it that a test hands over;
# 2. make `CmcdotParams` with `n_particles=20_000` and an object of this class as `resampling`;
# 3. return what `track_drive(frames, spec, params, seed=0)` gives.
#
# The tests call `maps`, which collects P(DYNAMIC) from it; leave it as it is.


# %% nbgrader={"grade": false, "grade_id": "track", "locked": false, "schema_version": 3, "solution": true, "task": false}
def track(frames, spec, draws=stratified):
    """Run the filter with a resampling of one's own over frames, and give one belief for each."""

    ### BEGIN SOLUTION
    class Stratified:
        def draw(self, weight, count, rng):
            return draws(weight, count, rng.random(count))

    return track_drive(frames, spec, CmcdotParams(n_particles=20_000, resampling=Stratified()), seed=0)
    ### END SOLUTION


def maps(frames, spec, draws=stratified):
    """Return P(DYNAMIC) after each frame, (T, H, W)."""
    return np.array([belief.probability[DYNAMIC] for belief in track(frames, spec, draws)])


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "track-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    calls = []

    def draws(weight, count, offsets):  # each index by itself, wherever its offset lies on the whole line
        calls.append((count, np.ptp(weight) > 0, np.shape(offsets) == (count,)))
        ends = np.cumsum(weight)
        return np.searchsorted(ends, np.sort(offsets) * ends[-1], side="right")

    spec = GridSpec(x_min=0, x_max=30, y_min=-10, y_max=10, cell=0.5)
    for drive in (sample_drive(), real_drive()):
        calls.clear()
        *_, usual = track_drive([drive[k] for k in range(3)], spec, CmcdotParams(n_particles=20_000), seed=0)
        got = answer_array(maps([drive[k] for k in range(3)], spec, draws), "maps")
        assert got.shape == (3, *spec.shape), (
            f"expected one map for each of 3 frames, {(3, *spec.shape)}; got {got.shape}"
        )
        change = np.abs(got[-1] - usual.probability[DYNAMIC]).max()
        assert change > 1e-4, "that is the package's own resampling: hand yours over as `resampling` of CmcdotParams"
        assert calls, "your `draw` never called `draws`: a test hands over a function of its own"
        assert all(offsets for _, _, offsets in calls), "one offset for each tooth: rng.random(count)"
        assert all(differ for _, differ, _ in calls), "the weights are all equal: hand on those that `draw` is given"
        number = sum(count for count, _, _ in calls[-2:])  # the filter draws twice a scan, old particles and new ones
        assert number == 20_000, f"the filter has {number:,} particles, not 20,000: set `n_particles`"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import cmcdot

    complaint = cmcdot.check_track(maps)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# To see it on the demo's page, save `stratified`, `track` and their imports as `my_stages.py`, and run `semgrid-edu demo --stages my_stages.py`. It runs the
# whole pipeline on the simulated street and on a real one with your filter in place of the package's. Here is the real street in numbers, when your tests have
# passed: `(maps([real_drive()[k] for k in range(10)], GridSpec.compact()) > 0.5).sum(axis=(1, 2))`.

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# You get a LIDAR that turns twice as fast: 20 scans a second instead of 10, each as good as before. A colleague's filter multiplies the belief by
# one fixed transition matrix at every step; yours takes M = exp(R dt), where R holds the rates of change per second. What goes wrong in your colleague's
# filter? And name one thing that changes in yours too, though nothing in the world has changed. Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "twice-as-fast", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The fixed matrix is applied twice as often, so in the colleague's world everything happens twice as fast: free space out of sight is forgotten in half the
# time, and twice as much is born and dies each second. With M = exp(R dt) two steps of 0.05 s are one of 0.1 s, so what is predicted doesn't depend on the scanner.
# The update does: scans are taken as independent, and there are twice as many, so the belief grows certain twice as fast, though a grazing ray or a hole in a bush is
# in most of them alike. (Also right: particles are resampled twice as often, so there is more noise and more newborn mass gets particles each second.)
# One point for the matrix, one for the evidence or the resampling.

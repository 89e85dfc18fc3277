# %% [markdown]
# # Exercise 03: occupancy with velocity
#
# Five small functions; put together they are a Bayesian occupancy filter on a lattice of velocities. And one question to answer in
# words. About 60 minutes. The lecture is [03: BOF](../03_bof.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | where it came from | 2 |
# | 2 | one velocity flies | 2 |
# | 3 | a scan | 3 |
# | 4 | how fast, and how sure | 2 + 1 + 2 |
# | 5 | what arrives where something stands | 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.answers import answer_array, answer_arrays

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.

# %% [markdown]
# ## Task 1: where it came from (2 points)
#
# The grid is a map seen from above, forward up: row 0 is the farthest ahead, column 0 the leftmost. Something is in cell (`row`, `col`) now. Its
# `velocity` is (vx, vy) in metres a second, x forward and y **left**. In which cell was it `dt` seconds ago? Cells are squares with
# a side of `cell` metres.
#
# Complete `antecedent`: it returns that cell as two integers. It may lie outside the grid. The way is a whole number of cells, but for
# the last digits of floating-point numbers.


# %% nbgrader={"grade": false, "grade_id": "antecedent", "locked": false, "schema_version": 3, "solution": true, "task": false}
def antecedent(row, col, velocity, dt, cell):
    """Return the row and column where what is in (row, col) now was dt seconds ago."""
    ### BEGIN SOLUTION
    forward, left = (round(v * dt / cell) for v in velocity)
    return row + forward, col + left
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "antecedent-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # 4 m/s forward and 2 m/s to the right for half a second, cells of 0.25 m. By hand: 8 cells up the map, 4 to the right.
    got = antecedent(row=10, col=20, velocity=(4.0, -2.0), dt=0.5, cell=0.25)
    assert answer_array(got, "antecedent").shape == (2,), f"return two numbers, row and column; got {got}"
    got = tuple(np.asarray(got).tolist())
    slips = {
        (2, 24): "that is where it will be: you look for where it was",
        (2, 16): "rows count down the map and x counts up it: who drives forward comes from a larger row",
        (18, 24): "columns count to the right and y to the left: who drives to the right comes from a smaller column",
        (6, 28): "x and y are swapped: vx, forward, goes over rows",
        (14, 12): "x and y are swapped: vx, forward, goes over rows",
        (26, 12): "the time got lost: velocity times dt is the way",
        (12, 19): "you count metres: how many cells of 0.25 m are 2 m?",
    }
    assert got not in slips, f"got {got}: {slips[got]}"
    assert got == (18, 16), f"8 rows farther down and 4 columns to the left of (10, 20) is (18, 16), got {got}"
    assert all(isinstance(i, int) for i in got), f"an index must be an integer, got {got}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_antecedent(antecedent)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: one velocity flies (2 points)
#
# `mass` (H, W) is what one velocity of the lattice holds in each cell: P(occupied, and moving with this velocity). All of it flies the same way:
# from (r, c) to (r + `down`, c + `right`). Both are integers of any sign.
#
# Complete `shift`: it returns the mass after the flight. Nothing is known of what enters the map, so that is 0, and what leaves the map is lost.
# Leave the argument as it is.


# %% nbgrader={"grade": false, "grade_id": "shift", "locked": false, "schema_version": 3, "solution": true, "task": false}
def shift(mass, down, right):
    """Return the mass (H, W) after all of it has flown by whole cells."""
    ### BEGIN SOLUTION
    height, width = mass.shape
    flown = np.zeros_like(mass)
    for row in range(height):
        for col in range(width):
            if 0 <= row - down < height and 0 <= col - right < width:
                flown[row, col] = mass[row - down, col - right]
    return flown
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "shift-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    mass = np.array([[0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8], [0.0, 0.9, 0.0, 1.0]])
    before = mass.copy()
    got = answer_array(shift(mass, -1, 2), "shift")  # up by one row, to the right by two columns
    assert np.array_equal(mass, before), "shift changed its argument `mass`: make a new array"
    assert got.shape == (3, 4), f"expected the shape of the mass, (3, 4), got {got.shape}"
    slips = {
        "what leaves on one side comes in on the other: the world isn't round": np.roll(before, (-1, 2), axis=(0, 1)),
        "it flew the wrong way: what was in (r, c) is now in (r + down, c + right)": [[0] * 4, [0.3, 0.4, 0, 0], [0.7, 0.8, 0, 0]],
        "it flew down instead of up: a negative `down` is a smaller row": [[0] * 4, [0, 0, 0.1, 0.2], [0, 0, 0.5, 0.6]],
        "it flew left instead of right: a positive `right` is a larger column": [[0.7, 0.8, 0, 0], [0, 1, 0, 0], [0] * 4],
        "rows and columns are swapped: `down` is for rows": [[0] * 4, [0] * 4, [0.2, 0.3, 0.4, 0]],
        "at the border you repeat the last cell: nothing is known of what enters, so it is 0": [
            [0.5, 0.5, 0.5, 0.6], [0, 0, 0, 0.9], [0, 0, 0, 0.9]
        ],
    }  # fmt: skip
    for hint, slip in slips.items():
        assert not np.allclose(got, slip), hint
    expected = np.array([[0, 0, 0.5, 0.6], [0, 0, 0, 0.9], [0, 0, 0, 0]])
    np.testing.assert_allclose(got, expected, err_msg="0.5, in (1, 0) before, is in (0, 2) now")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_shift(shift)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: a scan (3 points)
#
# `joint` (V, H, W) holds P(occupied, velocity v) for each of V velocities in each cell. What the velocities leave of 1 is the probability that the
# cell is free. Of each cell the scan says P(z | occupied) and P(z | free): `if_occupied` and `if_free`, both (H, W). How fast a thing moves makes no
# difference to what the scanner sees of it.
#
# Complete `update`: it returns the joint (V, H, W) after the scan, by Bayes' rule in each cell. Leave the arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(joint, if_occupied, if_free):
    """Return P(occupied, v | scan), (V, H, W)."""
    ### BEGIN SOLUTION
    occupied = joint * if_occupied
    free = (1 - joint.sum(axis=0)) * if_free
    return occupied / (occupied.sum(axis=0) + free)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    joint = np.zeros((3, 1, 4))  # the last cell is free
    joint[:, 0, 0] = [0.1, 0.2, 0.1]  # of this cell the scan says nothing
    joint[:, 0, 1] = [0.1, 0.2, 0.1]  # here a beam came back
    joint[:, 0, 2] = [0.3, 0.3, 0.2]  # and this one it passed
    if_occupied, if_free = np.array([[1.0, 0.9, 0.3, 0.3]]), np.array([[1.0, 0.1, 0.8, 0.8]])
    before = joint.copy()
    got = answer_array(update(joint, if_occupied, if_free), "update")
    assert np.array_equal(joint, before), "update changed its argument `joint`: make a new array (no *=, no /=)"
    assert got.shape == (3, 1, 4), f"expected the shape of the joint, (3, 1, 4), got {got.shape}"
    slips = {
        "the velocities sum to 1, yet the cell may be free: 1 - sum of the joint is a hypothesis as well": [0.25, 0.5, 0.25],
        "Bayes' rule has a second step: divide by P(z), the sum over all hypotheses of the cell": [0.09, 0.18, 0.09],
        "the two likelihoods are swapped: a beam that comes back speaks for occupied": [1 / 58, 2 / 58, 1 / 58],
        "free lacks its prior: its hypothesis weighs 1 - sum of the joint": [9 / 46, 18 / 46, 9 / 46],
        "you update each velocity against all else: the velocities and free compete, all at once": [0.5, 9 / 13, 0.5],
    }  # fmt: skip
    for hint, slip in slips.items():
        assert not np.allclose(got[:, 0, 1], slip), hint
    quiet = np.round(got[:, 0, 0], 3)
    kept = (
        f"silent in cell (0, 0), yet 0.1, 0.2, 0.1 became {quiet}: go cell by cell, and take both likelihoods as given"
    )
    assert np.allclose(quiet, [0.1, 0.2, 0.1]), kept
    np.testing.assert_allclose(got[:, 0, 1], np.array([9, 18, 9]) / 42, err_msg="0.09, 0.18, 0.09, and free 0.06")
    np.testing.assert_allclose(got[:, 0, 2], np.array([9, 9, 6]) / 40, err_msg="0.09, 0.09, 0.06, and free 0.16")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: how fast, and how sure (2 + 1 + 2 points)
#
# `joint` (V, H, W) as before; `velocities` (V, 2) names the velocity of each bin, x and y, in metres a second. The first of them is zero: its
# mass is STATIC, that of all the others is DYNAMIC. **Given that something moves** in a cell, what is its mean velocity, and what
# is the covariance of its velocity?
#
# Complete `mean_and_covariance`: it returns the mean, (2, H, W) in m/s, and the covariance, (2, 2, H, W) in m²/s². Where nothing moves there is
# no velocity: both are NaN there.


# %% nbgrader={"grade": false, "grade_id": "mean-and-covariance", "locked": false, "schema_version": 3, "solution": true, "task": false}
def mean_and_covariance(joint, velocities):
    """Return mean (2, H, W) and covariance (2, 2, H, W) of the velocity of what moves."""
    ### BEGIN SOLUTION
    share = joint[1:] / joint[1:].sum(axis=0)  # P(v | DYNAMIC); 0 / 0 is NaN, as it should be
    mean = np.einsum("vhw,vi->ihw", share, velocities[1:])
    apart = velocities[1:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "mean-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    velocities = np.array([[0.0, 0.0], [4.0, 2.0], [4.0, -6.0], [-4.0, 0.0]])
    joint = np.zeros((4, 1, 3))
    joint[:, 0, 0] = [0.3, 0.2, 0.1, 0.1]
    joint[0, 0, 1] = 0.9  # something stands in cell (0, 1); cell (0, 2) is free
    got = mean_and_covariance(joint, velocities)
    assert got is not None, "mean_and_covariance returned nothing: did you forget `return`?"
    two = isinstance(got, (tuple, list)) and len(got) == 2
    assert two, "return two arrays, the mean and the covariance"
    mean = answer_array(got[0], "the mean")
    assert mean.shape == (2, 1, 3), f"the mean has a plane for x and one for y, shape (2, 1, 3), got {mean.shape}"
    slips = {
        (0.8, -0.2): "you weigh by P(occupied, v): given that something moves means divided by P(DYNAMIC)",
        (8 / 7, -2 / 7): "what stands doesn't move: the zero velocity, the first bin, counts neither above nor below",
        (-0.5, 2.0): "x and y are swapped: velocities[:, 0] is x, the first plane of the mean",
        (4 / 3, -4 / 3): "every velocity counts the same: weigh each by what the cell believes of it",
        (1.0, -1.0): "every velocity counts the same: weigh each by what the cell believes of it",
        (4.0, 2.0): "that is the most probable velocity: the mean weighs all of them",
    }
    for slip, hint in slips.items():
        assert not np.allclose(mean[:, 0, 0], slip), hint
    by_hand = "by hand: (0.2 * 4 + 0.1 * 4 - 0.1 * 4) / 0.4 and (0.2 * 2 - 0.1 * 6) / 0.4"
    np.testing.assert_allclose(mean[:, 0, 0], [2.0, -0.5], err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_mean(mean_and_covariance)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "no-mass-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    velocities = np.array([[0.0, 0.0], [4.0, 2.0], [4.0, -6.0], [-4.0, 0.0]])
    joint = np.zeros((4, 1, 3))
    joint[:, 0, 0] = [0.3, 0.2, 0.1, 0.1]
    joint[0, 0, 1] = 0.9
    mean, covariance = answer_arrays(mean_and_covariance(joint, velocities), 2, "mean_and_covariance")
    shapes = mean.shape, covariance.shape
    assert shapes == ((2, 1, 3), (2, 2, 1, 3)), f"expected shapes (2, 1, 3) and (2, 2, 1, 3), got {shapes}"
    empty = {1: "what is in cell (0, 1) stands", 2: "cell (0, 2) is free"}
    if np.allclose(mean[:, 0, 0], [8 / 7, -2 / 7]):  # what stands is counted in: that has cost its points above
        del empty[1]
    for col, why in empty.items():
        none = f"{why}, so nothing moves at 0 m/s there: no velocity isn't zero velocity"
        assert not np.allclose(mean[:, 0, col], 0), none
        assert np.isnan(mean[:, 0, col]).all(), f"{why}: its velocity is NaN, got {mean[:, 0, col]}"
        assert np.isnan(covariance[:, :, 0, col]).all(), f"{why}: its covariance is NaN as well"
    assert np.isfinite(mean[:, 0, 0]).all(), "something may move in cell (0, 0): no NaN there"
    assert np.isfinite(covariance[:, :, 0, 0]).all(), "something may move in cell (0, 0): no NaN there"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_no_mass(mean_and_covariance)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "covariance-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    velocities = np.array([[0.0, 0.0], [4.0, 2.0], [4.0, -6.0], [-4.0, 0.0]])
    joint = np.array([0.3, 0.2, 0.1, 0.1]).reshape(4, 1, 1)
    mean, covariance = answer_arrays(mean_and_covariance(joint, velocities.copy()), 2, "mean_and_covariance")
    right_mean = np.round(mean.ravel(), 6).tolist() == [2.0, -0.5]
    if not right_mean:  # wrong weights have cost their points above; here they sum to 1
        joint = np.array([0, 0.5, 0.25, 0.25]).reshape(4, 1, 1)
        _, covariance = answer_arrays(mean_and_covariance(joint, velocities.copy()), 2, "mean_and_covariance")
    assert covariance.shape == (2, 2, 1, 1), f"one 2 x 2 matrix a cell, shape (2, 2, 1, 1), got {covariance.shape}"
    got = covariance[:, :, 0, 0]
    slips = {
        "that is the mean of v v^T: take the mean velocity off first": [[16, -2], [-2, 11]],
        "the two components vary together: the off-diagonal isn't zero": [[12, 0], [0, 10.75]],
        "x and y are swapped": [[10.75, -1], [-1, 12]],
        "you weigh by P(occupied, v): divide by P(DYNAMIC)": [[4.8, -0.4], [-0.4, 4.3]],
        "what stands doesn't move: leave the zero velocity out": [[384 / 49, -40 / 49], [-40 / 49, 304 / 49]],
        "every velocity counts the same: weigh each by what the cell believes of it": np.cov(velocities[1:].T, ddof=0),
        "every velocity counts the same: weigh each by what the cell believes": np.cov(velocities[1:].T),
        "these are standard deviations, m/s: a covariance is in m^2/s^2": np.diag(np.sqrt([12, 10.75])),
    }
    for hint, slip in slips.items():
        assert not np.allclose(got, slip), hint
    by_hand = f"vx is 4, 4, -4 with 1/2, 1/4, 1/4: its variance is 12 m^2/s^2, got {got[0, 0]:.3g}"
    assert np.isclose(got[0, 0], 12), by_hand
    np.testing.assert_allclose(got, [[12, -1], [-1, 10.75]], err_msg="the mean of (v - mean)(v - mean)^T")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_covariance(mean_and_covariance)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: what arrives where something stands (3 points)
#
# Two opinions meet in a cell. Its own is `own` (4, H, W): FREE, STATIC, DYNAMIC, UNKNOWN, which sum to 1. Its neighbours say: with the probability
# `arrives` (H, W) something moving arrives here. Take the two as independent, and write down the probability of each pair (own state; arrives or not).
# One pair is impossible: nothing arrives where something STATIC stands. Strike it out. In the pairs that are left, what arrives makes the cell
# DYNAMIC, whatever it was, and where nothing arrives the cell keeps its state.
#
# (The package strikes out one combination more, because it also asks where things come from and where they go: see *One thing, two places* in the
# lecture. Leave that out here.)
#
# Complete `arrive`: it returns the belief (4, H, W) that is left, and leaves its arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "arrive", "locked": false, "schema_version": 3, "solution": true, "task": false}
def arrive(own, arrives):
    """Return the belief (4, H, W) of cells where something arrives with a known probability."""
    ### BEGIN SOLUTION
    free, static, dynamic, unknown = own
    nothing = 1 - arrives
    possible = 1 - arrives * static
    comes = arrives * (1 - static)
    return np.stack([nothing * free, nothing * static, comes + nothing * dynamic, nothing * unknown]) / possible
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "arrive-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    own = np.array([[[0.5, 0.35, 0.1]], [[0.5, 0.2, 0.6]], [[0.0, 0.3, 0.2]], [[0.0, 0.15, 0.1]]])
    arrives = np.array([[0.6, 0.4, 0.0]])
    got = answer_array(arrive(own.copy(), arrives.copy()), "arrive")
    assert got.shape == (4, 1, 3), f"expected the shape of `own`, (4, 1, 3), got {got.shape}"
    slips = {
        "you strike nothing out: that something arrives where something stands is impossible": [21, 12, 58, 9],
        "neither of the two wins: strike their pair out, and let what is left sum to 1": [21, 20, 50, 9],
        "the pair that you strike out isn't UNKNOWN, it is impossible: let what is left sum to 1": [21, 12, 50, 17],
        "you add what arrives and scale: write down the pairs (own state; arrives or not) first": [25, 100 / 7, 50, 75 / 7],
        "only STATIC and arriving exclude each other: where something moves, more may arrive": [26.25, 15, 47.5, 11.25],
        "what moved in the cell already got lost: where nothing arrives, DYNAMIC stays DYNAMIC": [
            2100 / 74, 1200 / 74, 3200 / 74, 900 / 74
        ],
    }  # fmt: skip
    for hint, slip in slips.items():
        assert not np.allclose(got[:, 0, 1], np.array(slip) / 100, atol=1e-4), hint
    total = got.sum(axis=0)[0, 1]
    struck_out = f"the states of cell (0, 1) sum to {total:.2f}: divide by what is left after striking out"
    assert np.isclose(total, 1), struck_out
    assert np.allclose(got[:, 0, 2], own[:, 0, 2]), "in cell (0, 2) nothing arrives, so it must keep its belief"
    np.testing.assert_allclose(got[:, 0, 0], [2 / 7, 2 / 7, 3 / 7, 0], err_msg="by hand: 0.2, 0.2, 0.3, divided by 0.7")
    np.testing.assert_allclose(got[:, 0, 1], np.array([21, 12, 50, 9]) / 92, err_msg="by hand: 0.21, 0.12, 0.50, 0.09")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_arrive(arrive)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# A bus 12 m long drives past you at a constant 10 m/s, a few metres to the side, so that your scanner sees its whole flank. After two
# seconds the filter is sure that its front moves at 10 m/s. Of the cells in the middle of the flank it says: occupied, and most
# probably standing. Why? And the front moves for sure: why doesn't that help the cells in the middle? Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "flank", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# In the middle of the flank there was something in the cell before, and there is now, whatever the velocity along the flank: the antecedent of
# the cell lies in the bus for 0 m/s as for 10 m/s, so every scan fits all of these velocities alike, and the prior decides between them:
# it says that most things stand. Only where the flank begins or ends do the hypotheses predict something else: the front arrives in
# cells that were free. That doesn't help the middle because the filter treats each cell by itself: it knows no objects, so it doesn't
# know that cell and front belong to one rigid body.
# One point for the antecedent that lies in the bus for every velocity, one for cells that are independent of each other.

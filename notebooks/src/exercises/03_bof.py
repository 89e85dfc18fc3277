# %% [markdown]
# # Exercise 03: occupancy with velocity
#
# Five small functions. One of them follows a thing exactly and shows what BOF loses. The other four, put together, are a Bayesian occupancy filter,
# which you let run on a simulated and on a real street. And one question to answer in words. About 90 minutes. The lecture is
# [03: BOF](../03_bof.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | one velocity flies | 2 |
# | 2 | a scanner that measures velocities | 3 |
# | 3 | how fast, and how sure | 2 + 1 + 2 |
# | 4 | what arrives where something stands | 3 |
# | 5 | one thing, followed exactly | 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array, answer_arrays

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.

# %% [markdown]
# ## Task 1: one velocity flies (2 points)
#
# The grid is a map seen from above: row 0 is the farthest ahead, column 0 the leftmost. `mass` (H, W) is what one velocity of the lattice holds in each cell: P(occupied, and moving with this velocity). All of it flies the same way:
# from (r, c) to (r + `down`, c + `right`). Both are integers of any sign, and may be larger than the map.
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


# %% nbgrader={"grade": true, "grade_id": "shift-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
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
# ## Task 2: a scanner that measures velocities (3 points)
#
# `joint` (V, H, W) holds P(occupied, velocity v) for each of V velocities in each cell. What the velocities leave of 1 is the probability that the
# cell is free. The scanner of the lecture measures no velocity. A Doppler LIDAR does, roughly: what it says of a cell is the more probable the better a
# velocity fits. So `if_occupied` (V, H, W) holds P(z | occupied with velocity v), a number for each velocity, and `if_free` (H, W) holds P(z | free).
#
# Complete `update`: it returns the joint (V, H, W) after the scan, by Bayes' rule in each cell. Leave the arguments as they are. (For a scanner without
# Doppler all velocities have the same number. The filter at the end uses your function so.)


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(joint, if_occupied, if_free):
    """Return P(occupied, v | scan), (V, H, W)."""
    ### BEGIN SOLUTION
    occupied = joint * if_occupied
    free = (1 - joint.sum(axis=0)) * if_free
    return occupied / (occupied.sum(axis=0) + free)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    joint = np.zeros((3, 1, 4))  # the last cell is free
    joint[:, 0, 0] = [0.1, 0.2, 0.1]  # of this cell the scan says nothing
    joint[:, 0, 1] = [0.1, 0.2, 0.1]  # here a beam came back, with a Doppler shift that fits the second velocity
    joint[:, 0, 2] = [0.3, 0.3, 0.2]  # and this one it passed
    if_free = np.array([[1.0, 0.1, 0.8, 0.8]])
    if_occupied = np.array([[[1.0, 0.3, 0.3, 0.3]], [[1.0, 0.9, 0.3, 0.3]], [[1.0, 0.1, 0.3, 0.3]]])
    before = joint.copy()
    got = answer_array(update(joint, if_occupied, if_free), "update")
    assert np.array_equal(joint, before), "update changed its argument `joint`: make a new array (no *=, no /=)"
    assert got.shape == (3, 1, 4), f"expected the shape of the joint, (3, 1, 4), got {got.shape}"
    slips = {
        "the velocities sum to 1, yet the cell may be free: 1 - sum of the joint is a hypothesis as well": [3 / 22, 18 / 22, 1 / 22],
        "Bayes' rule has a second step: divide by P(z), the sum over all hypotheses of the cell": [0.03, 0.18, 0.01],
        "the two likelihoods are swapped: a beam that comes back speaks for occupied": [1 / 22, 2 / 58, 1 / 10],
        "free lacks its prior: its hypothesis weighs 1 - sum of the joint": [3 / 32, 18 / 32, 1 / 32],
        "you update each velocity against all else: the velocities and free compete, all at once": [0.25, 9 / 13, 0.1],
        "you average what the scanner says over the velocities: each velocity has a likelihood of its own": [13 / 70, 26 / 70, 13 / 70],
    }  # fmt: skip
    for hint, slip in slips.items():
        assert not np.allclose(got[:, 0, 1], slip), hint
    kept = "silent in cell (0, 0), which keeps 0.1, 0.2, 0.1: go cell by cell, and take both likelihoods as given"
    assert np.allclose(got[:, 0, 0], [0.1, 0.2, 0.1], atol=1e-3), kept
    np.testing.assert_allclose(
        got[:, 0, 1], np.array([3, 18, 1]) / 28, rtol=1e-5, err_msg="0.03, 0.18, 0.01, and free 0.06"
    )
    np.testing.assert_allclose(
        got[:, 0, 2], np.array([9, 9, 6]) / 40, rtol=1e-5, err_msg="0.09, 0.09, 0.06, and free 0.16"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: how fast, and how sure (2 + 1 + 2 points)
#
# `joint` (V, H, W) as before; `velocities` (V, 2) names the velocity of each bin, x and y, in metres a second. This lattice isn't the lecture's: its bins
# stand **in any order**, and a bush that sways in the wind fills some of them as well. So only what is faster than `slow`, in m/s, counts as moving.
# **Given that something moves** in a cell, what is its mean velocity, and what is the covariance of its velocity?
#
# Complete `mean_and_covariance`: it returns the mean, (2, H, W) in m/s, and the covariance, (2, 2, H, W) in m²/s². Where nothing moves there is
# no velocity: both are NaN there. Leave the arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "mean-and-covariance", "locked": false, "schema_version": 3, "solution": true, "task": false}
def mean_and_covariance(joint, velocities, slow):
    """Return mean (2, H, W) and covariance (2, 2, H, W) of the velocity of what moves, faster than `slow`."""
    ### BEGIN SOLUTION
    fast = np.hypot(*velocities.T) > slow
    share = joint[fast] / joint[fast].sum(axis=0)  # P(v | it moves); 0 / 0 is NaN, as it should be
    mean = np.einsum("vhw,vi->ihw", share, velocities[fast])
    apart = velocities[fast][:, :, None, None] - mean
    return mean, np.einsum("vhw,vihw,vjhw->ijhw", share, apart, apart)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "mean-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    velocities = np.array([[4.0, 2.0], [0.0, 0.0], [4.0, -6.0], [-4.0, 0.0], [0.5, -0.5]])
    joint = np.zeros((5, 1, 3))
    joint[:, 0, 0] = [0.2, 0.2, 0.1, 0.1, 0.1]
    joint[1, 0, 1] = 0.9  # something stands in cell (0, 1); cell (0, 2) is free
    got = mean_and_covariance(joint, velocities, slow=1.0)
    assert got is not None, "mean_and_covariance returned nothing: did you forget `return`?"
    two = isinstance(got, (tuple, list)) and len(got) == 2
    assert two, "return two arrays, the mean and the covariance"
    mean = answer_array(got[0], "the mean")
    assert mean.shape == (2, 1, 3), f"the mean has a plane for x and one for y, shape (2, 1, 3), got {mean.shape}"
    slips = {
        (0.8, -0.2): "you weight by P(occupied, v): given that something moves means divided by P(it moves)",
        (8.5 / 7, -2.5 / 7): "what stands doesn't move: leave the bins that aren't faster than `slow` out of both sums",
        (1.7, -0.5): "only the zero velocity is left out: what moves at 0.7 m/s isn't faster than `slow` either",
        (0.1, -1.3): "you leave the first bin out: here the bins stand in any order, so look at their speeds",
        (-0.5, 2.0): "x and y are swapped: velocities[:, 0] is x, the first plane of the mean",
        (4 / 3, -4 / 3): "every velocity counts the same: weight each by what the cell believes of it",
        (0.9, -0.9): "every velocity counts the same: weight each by what the cell believes of it",
        (4.0, 2.0): "that is the most probable velocity: the mean weights all of them",
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


# %% nbgrader={"grade": true, "grade_id": "no-mass-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    velocities = np.array([[4.0, 2.0], [0.0, 0.0], [4.0, -6.0], [-4.0, 0.0], [0.5, -0.5]])
    joint = np.zeros((5, 1, 4))
    joint[:, 0, 0] = [0.2, 0.2, 0.1, 0.1, 0.1]
    joint[1, 0, 1], joint[4, 0, 3] = 0.9, 0.8
    got = mean_and_covariance(joint, velocities, slow=1.0)
    mean, covariance = answer_arrays(got, 2, "mean_and_covariance")
    shapes = mean.shape, covariance.shape
    assert shapes == ((2, 1, 4), (2, 2, 1, 4)), f"expected shapes (2, 1, 4) and (2, 2, 1, 4), got {shapes}"
    empty = {1: "what is in cell (0, 1) stands", 2: "cell (0, 2) is free", 3: "a bush sways in cell (0, 3)"}
    if np.allclose(mean[:, 0, 0], [8.5 / 7, -2.5 / 7]):  # what stands is counted in: that has cost its points above
        del empty[1], empty[3]
    if np.allclose(mean[:, 0, 0], [1.7, -0.5]):  # and so has what sways
        del empty[3]
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


# %% nbgrader={"grade": true, "grade_id": "covariance-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    velocities = np.array([[4.0, 2.0], [0.0, 0.0], [4.0, -6.0], [-4.0, 0.0], [0.5, -0.5]])
    joint = np.array([0.2, 0.2, 0.1, 0.1, 0.1]).reshape(5, 1, 1)
    mean, covariance = answer_arrays(mean_and_covariance(joint, velocities.copy(), 1.0), 2, "mean_and_covariance")
    right_mean = np.round(mean.ravel(), 6).tolist() == [2.0, -0.5]
    if not right_mean:  # wrong weights have cost their points above; here they sum to 1
        joint = np.array([0.5, 0, 0.25, 0.25, 0]).reshape(5, 1, 1)
        _, covariance = answer_arrays(mean_and_covariance(joint, velocities.copy(), 1.0), 2, "mean_and_covariance")
    assert covariance.shape == (2, 2, 1, 1), f"one 2 x 2 matrix a cell, shape (2, 2, 1, 1), got {covariance.shape}"
    got = covariance[:, :, 0, 0]
    slips = {
        "that is the mean of v v^T: take the mean velocity off first": [[16, -2], [-2, 11]],
        "the two components vary together: the off-diagonal isn't zero": [[12, 0], [0, 10.75]],
        "x and y are swapped": [[10.75, -1], [-1, 12]],
        "you weight by P(occupied, v): divide by P(it moves)": [[4.8, -0.4], [-0.4, 4.3]],
        "what stands doesn't move: leave what isn't faster than `slow` out": np.cov(
            velocities.T, aweights=[2, 2, 1, 1, 1], ddof=0
        ),
        "every velocity counts the same: weight each by what the cell believes of it": np.cov(
            velocities[[0, 2, 3]].T, ddof=0
        ),
        "every velocity counts the same: weight each by what the cell believes": np.cov(velocities[[0, 2, 3]].T),
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
# ## Task 4: what arrives where something stands (3 points)
#
# Two opinions meet in a cell. Its own is `own` (4, H, W): FREE, STATIC, DYNAMIC, UNKNOWN, which sum to 1. Its neighbours say: with the probability
# `arrives` (H, W) something moving arrives here. Take the two as independent, and write down the probability of each pair (own state; arrives or not).
# In this task alone, DYNAMIC in `own` is what moves but is still in its cell, because it is slow. (In the filter at the end all that moves leaves its cell, so DYNAMIC
# of `own` is 0 there.) Two solid things can't share a cell. So **two** pairs are impossible: nothing arrives where something STATIC stands, nor where something DYNAMIC still is. Strike both out. In the pairs that are left, what arrives makes the cell DYNAMIC, and where nothing arrives the cell keeps its state.
#
# Complete `arrive`: it returns the belief (4, H, W) that is left, and leaves its arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "arrive", "locked": false, "schema_version": 3, "solution": true, "task": false}
def arrive(own, arrives):
    """Return the belief (4, H, W) of cells where something arrives with a known probability."""
    ### BEGIN SOLUTION
    free, static, dynamic, unknown = own
    nothing = 1 - arrives
    possible = 1 - arrives * (static + dynamic)
    comes = arrives * (free + unknown)
    return np.stack([nothing * free, nothing * static, comes + nothing * dynamic, nothing * unknown]) / possible
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "arrive-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    own = np.array([[[0.5, 0.35, 0.1]], [[0.5, 0.2, 0.6]], [[0.0, 0.3, 0.2]], [[0.0, 0.15, 0.1]]])
    arrives = np.array([[0.6, 0.4, 0.0]])
    got = answer_array(arrive(own.copy(), arrives.copy()), "arrive")
    assert got.shape == (4, 1, 3), f"expected the shape of `own`, (4, 1, 3), got {got.shape}"
    slips = {
        "you strike nothing out: that something arrives where something stands is impossible": [21, 12, 58, 9],
        "neither of the two wins: strike their pair out, and let what is left sum to 1": [21, 20, 50, 9],
        "the pairs that you strike out aren't UNKNOWN, they are impossible: let what is left sum to 1": [21, 12, 38, 29],
        "you add what arrives and scale: write down the pairs (own state; arrives or not) first": [25, 100 / 7, 50, 75 / 7],
        "you strike out one pair, as the lecture does: here what is still moving in the cell excludes an arrival as well": [
            2100 / 92, 1200 / 92, 5000 / 92, 900 / 92
        ],
        "what moved in the cell already got lost: where nothing arrives, DYNAMIC stays DYNAMIC": [
            2100 / 62, 1200 / 62, 2000 / 62, 900 / 62
        ],
    }  # fmt: skip
    for hint, slip in slips.items():
        assert not np.allclose(got[:, 0, 1], np.array(slip) / 100, atol=1e-4), hint
    total = got.sum(axis=0)[0, 1]
    struck_out = f"the states of cell (0, 1) sum to {total:.2f}: divide by what is left after striking out"
    assert np.isclose(total, 1), struck_out
    assert np.allclose(got[:, 0, 2], own[:, 0, 2]), "in cell (0, 2) nothing arrives, so it must keep its belief"
    np.testing.assert_allclose(got[:, 0, 0], [2 / 7, 2 / 7, 3 / 7, 0], err_msg="by hand: 0.2, 0.2, 0.3, divided by 0.7")
    np.testing.assert_allclose(got[:, 0, 1], np.array([21, 12, 38, 9]) / 80, err_msg="by hand: 0.21, 0.12, 0.38, 0.09")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_arrive(arrive)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: one thing, followed exactly (3 points)
#
# BOF asks each cell by itself, and finds 1.24 things where there is one. What is the exact answer, if you follow the thing as a whole? There are K cells
# on a line and exactly one thing. At scan 0 it is in cell `start`. It has one of V velocities and keeps it: `steps` (V,) says by how many cells it moves
# from each scan to the next, to the right if positive, and `prior` (V,) how probable that is. Then come T scans. Scan number t = 0, 1, ... T - 1 of the arrays
# is made after t + 1 steps; of each cell it says P(z | occupied) and P(z | free): `if_occupied` and `if_free`, both (T, K). Cells are seen independently of
# each other, once it is known which of them is occupied. A thing that has left the line occupies no cell of it, so then all cells are free.
#
# Complete `follow`: it returns the probability of each velocity, given all scans, (V,). Leave the arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "follow", "locked": false, "schema_version": 3, "solution": true, "task": false}
def follow(start, steps, prior, if_occupied, if_free):
    """Return P(velocity | all scans), (V,), of one thing that keeps its velocity."""
    ### BEGIN SOLUTION
    scans, cells = if_free.shape
    weight = np.array(prior, dtype=float)
    for k, step in enumerate(steps):
        for t in range(scans):
            occupied = np.arange(cells) == start + step * (t + 1)
            weight[k] *= np.where(occupied, if_occupied[t], if_free[t]).prod()
    return weight / weight.sum()
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "follow-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    # The lecture's line: six cells, the thing in cell 2, and a beam comes back from cell 3. It passes all others.
    occupied, free = np.full((1, 6), 0.3), np.full((1, 6), 0.7)
    occupied[0, 3], free[0, 3] = 0.8, 0.05
    steps, prior = np.array([-1, 0, 1]), np.full(3, 1 / 3)
    before = [a.copy() for a in (steps, prior, occupied, free)]
    got = answer_array(follow(2, steps, prior, occupied, free), "follow")
    for argument, was, name in zip(
        (steps, prior, occupied, free), before, ("steps", "prior", "if_occupied", "if_free"), strict=True
    ):
        assert np.array_equal(argument, was), f"follow changed its argument `{name}`: make a new array"
    assert got.shape == (3,), f"one probability for each velocity, shape (3,), got {got.shape}"
    slips = {
        "you ask only the cell in which the thing would be: the others must then be free, and the scan saw them too": [3 / 14, 3 / 14, 8 / 14],
        "divide by the sum: the three velocities are all the possibilities there are": [0.3 * 0.05 * 0.7**4 / 3] * 2 + [0.8 * 0.7**5 / 3],
        "the first scan is made after one step, not at the start": [1 / 3, 1 / 3, 1 / 3],
        "that is BOF's answer, cell by cell: follow each velocity through all cells": [0.1 / 0.567, 0.1 / 0.567, 8 / 9],
    }  # fmt: skip
    for hint, slip in slips.items():
        assert not np.allclose(got, slip), hint
    by_hand = "by hand, up to a common factor: to the right 0.8 * 0.7, else 0.3 * 0.05"
    np.testing.assert_allclose(got, np.array([0.015, 0.015, 0.56]) / 0.59, rtol=1e-5, err_msg=by_hand)
    uneven = answer_array(follow(2, steps, np.array([0.1, 0.1, 0.8]), np.ones((1, 6)), np.ones((1, 6))), "follow")
    assert np.allclose(uneven, [0.1, 0.1, 0.8]), "a scan that says nothing leaves the prior as it was"
    occupied, free = np.full((2, 6), 0.3), np.full((2, 6), 0.7)
    occupied[0, 5], free[0, 5] = 0.8, 0.05
    left = answer_array(follow(4, np.array([0, 1]), np.full(2, 0.5), occupied, free), "follow")
    why = "what has left leaves all cells free; by hand: it stands 0.3 * 0.05 * 0.3, it drives 0.8 * 0.7 * 0.7"
    assert np.allclose(left, np.array([0.0045, 0.392]) / 0.3965, rtol=1e-5), why
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bof

    complaint = bof.check_follow(follow)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# So the thing goes to the right with 0.949, where BOF says that cell 3 holds it with 0.889, and cells 1 and 2 with 0.18 each.
#
# ## Put together: your filter on two streets
#
# `track` below calls your `shift`, `arrive`, `update` and `mean_and_covariance`, and adds what the lecture says of a street: what a
# cell turns out to be at first sight, and now and then something that starts to move. Its lattice has velocities 5 m/s apart, so that everything moves by
# whole cells of 0.5 m in a tenth of a second. First its steps, on a map that is fixed to the ground. Read `predicted`: all that moves leaves its cell, so what a
# cell holds by itself before anything arrives is FREE, STATIC or UNKNOWN, and arrivals from several cells add up.
# (So of your two pairs only the one with STATIC acts here.)


# %% nbgrader={"grade": false, "grade_id": "steps", "locked": true, "schema_version": 3, "solution": false, "task": false}
def predicted(joint, unknown, ways):
    """Return the states (4, H, W) and the mass of what moves (V - 1, H, W): fly, and meet what each cell holds."""
    flown = np.stack([np.asarray(shift(mass, down, right)) for mass, (down, right) in zip(joint, ways, strict=True)])
    own = np.stack([1 - flown[0] - unknown, flown[0], 0 * unknown, unknown])
    states = np.asarray(arrive(own, np.minimum(flown[1:].sum(axis=0), 0.999)))
    return states, flown[1:] * (states[2] / np.maximum(flown[1:].sum(axis=0), 1e-12))


def first_seen(states, moving, seen, starts):
    """Return the joint (V, H, W) with what `seen` cells turn out to be, and with what starts to move."""
    static = 0.999 * states[1] + 0.045 * seen
    moving = moving + (0.001 * (states[0] + states[1]) + 0.003 * seen) * starts
    return np.concatenate([static[None], moving])


def updated(joint, scan):
    """Return the joint given a scan, to which all velocities look alike."""
    return np.asarray(update(joint, np.broadcast_to(scan.occupied, joint.shape).copy(), scan.free.astype(float)))


def planes_of(joint, unknown, velocities):
    """Return the four states, the mean velocity and its covariance, (10, H, W)."""
    mean, covariance = map(np.asarray, mean_and_covariance(joint, velocities, 0.0))
    states = [1 - joint.sum(axis=0) - unknown, joint[0], joint[1:].sum(axis=0), unknown]
    return np.concatenate([states, mean, covariance.reshape(4, *unknown.shape)]).astype(np.float32)


# %% nbgrader={"grade": false, "grade_id": "track", "locked": true, "schema_version": 3, "solution": false, "task": false}
def track(frames, spec):
    """Yield the belief of each frame, as the pipeline asks for it."""
    from semgrid_edu.grid import GridSpec
    from semgrid_edu.occupancy import Belief, PlanarMotion, SensorModel, VelocityLattice
    from semgrid_edu.occupancy.planar_motion import look_up

    lattice, first, time = VelocityLattice(max_speed=15, spacing=5), None, 0.0
    starts = (lattice.prior[1:] / lattice.prior[1:].sum())[:, None, None]
    ground = GridSpec(spec.x_min, spec.x_max + 30, spec.y_min - 5, spec.y_max + 5, spec.cell)
    joint, unknown = np.zeros((len(lattice), *ground.shape)), np.ones(ground.shape)
    for frame in frames:
        first, dt, time = first or frame, frame.time - time if first else 0.0, frame.time
        pose = PlanarMotion.from_poses(first.T_world_from_lidar, frame.T_world_from_lidar)
        scan = SensorModel().scan(frame.points_grid).evidence(ground, pose)
        ways = -np.rint(lattice.velocities * dt / spec.cell).astype(int)
        states, moving = predicted(joint, unknown, ways)
        seen = np.where(scan.occupied != scan.free, states[3], 0)
        joint, unknown = updated(first_seen(states, moving, seen, starts), scan), states[3] - seen
        planes = planes_of(joint, unknown, lattice.velocities)
        here = look_up(planes, np.float32([0, 0, 0, 1] + 6 * [np.nan]), ground, spec, pose)
        states = np.clip(here[:4], 0, 1)
        yield Belief(states / states.sum(axis=0), here[4:6], here[6:].reshape(2, 2, *spec.shape))


# %% [markdown]
# Take the `#` away from the last line below, run the cell, and look at your map, on the simulated street and on the real one.


# %%
def light_up():
    """Draw what your filter believes at the end of both streets."""
    import matplotlib.pyplot as plt

    from semgrid_edu import plotting
    from semgrid_edu.datasets.samples import real_drive, sample_drive
    from semgrid_edu.grid import GridSpec

    spec = GridSpec.compact()
    _, axes = plt.subplots(1, 2, figsize=(8, 6), layout="compressed", sharey=True)
    for ax, drive in zip(axes, (sample_drive(), real_drive()), strict=True):
        *_, belief = track(drive, spec)
        plotting.velocity_wheel(spec, belief.probability, belief.velocity, ax=ax, legend=ax is axes[1])
        plotting.velocity(spec, belief.probability, belief.velocity, ax)
    axes[0].set_title("simulated", fontsize=9)
    axes[1].set_title("real: PandaSet by Hesai and Scale AI, CC BY 4.0", fontsize=9)
    plt.show()


# light_up()

# %% [markdown]
# It is a stage of the pipeline as well. Copy `import numpy as np`, your four functions and the two cells with `track` and its steps into a file `my_stages.py`, and run
#
#     semgrid-edu demo --stages my_stages.py
#
# Then the semantic grid of both streets is built upon your filter, beside that of the package. Where do they differ?
# None of your four functions makes the difference on the real street. The package has rules against walls that seem to move, and it forgets; `track` does neither. Look at the cars that drive ahead of us to the left.
#
# ## Task 6: in your own words (2 points)
#
# A train of small cars passes you on your left at 20 m/s. Each car carries one thin post, and the posts follow each other at a distance of exactly 2 m. Your
# scanner turns ten times a second and sees the posts alone. The lattice has velocities 5 m/s apart, up to 20 m/s. Answer in about six sentences:
#
# 1. Take the posts that were in view from the beginning. Which velocities of the lattice explain all their scans alike, and what does the filter make of them, and why?
# 2. The first post drives into free road, where the filter sees that it moves. What does BOF forget, so that this helps the posts behind it late or not at all? Name one change to the scanner that would help.

# %% [markdown] nbgrader={"grade": true, "grade_id": "posts", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# In a tenth of a second each post moves by 2 m, to where the next one was. So each scan looks like the one before, and the antecedents of a post's cell hold a post for 0 m/s,
# for 20 m/s and for 20 m/s the other way. All three explain the scans alike, so the filter's own steps decide. First sight is for STATIC, and STATIC is one velocity, while DYNAMIC is
# spread over 48, of which only two fit. So STATIC leads, and the strike-out makes the lead certain: the posts are STATIC. (In a simulation so are they with even odds at first sight, and with reversed ones: the spread is enough.
# The other velocities, 5 to 15 m/s, lead from a gap to a post and are refuted.) The first post arrives in cells that were free, so it is DYNAMIC. But the filter keeps each cell by itself and forgets what ties it to the others.
# So what is known of the first post says nothing at once about those behind it. It only travels back from post to post: in the simulation two posts are DYNAMIC after eleven scans, four after eighteen. A scanner with another rate would help, 15 scans a second say: then standing and driving predict different places, and in the simulation all posts are DYNAMIC. So would one that measures velocity (Doppler).
# One point for 0 and 20 m/s (either way) together with a lead of STATIC (first sight or the spread), one for cells kept by themselves and a change that helps.

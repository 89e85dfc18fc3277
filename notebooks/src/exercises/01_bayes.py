# %% [markdown]
# # Exercise 01: Bayes' rule on a line
#
# Five small functions: the two halves of a Bayes filter, the whole filter, the matrix of a changing world, and a rule about witnesses.
# Then one question to answer in words. About 60 minutes. The lecture is [01: Bayes' rule on a line](../01_bayes.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | update: one reading on a map | 1 + 1 |
# | 2 | predict: a move with an error, on a ring and before a wall | 2 + 1 |
# | 3 | predict, update, repeat | 3 |
# | 4 | the transition matrix of a cell, for any time step; its half-life | 2 + 1 |
# | 5 | each witness once | 2 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.answers import answer_array, answer_number

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.


def _explain(got, slips):
    """Stop with a hint when `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.allclose(got, slip, atol=5e-4), f"got {np.round(got, 3)}: {hint}"


# %% [markdown]
# ## Task 1: one reading on a map (1 + 1 points)
#
# A vehicle is in one of N cells: `belief`, shape `(N,)`, sums to 1. `poles` lists the cells that have a pole beside them (the first cell is 0). A sensor says *pole* with
# probability `hit` where there is one and with probability `false_alarm` where there is none; otherwise it says *nothing*.
#
# Complete `locate`: it returns the belief after one reading. One point is for *pole* (`says_pole` is `True`), one for *nothing* (`False`). Leave `belief` as it is: somebody else may need it.


# %% nbgrader={"grade": false, "grade_id": "locate", "locked": false, "schema_version": 3, "solution": true, "task": false}
def locate(belief, says_pole, poles, hit, false_alarm):
    """Return the belief (N,) after one reading."""
    ### BEGIN SOLUTION
    likelihood = np.full(len(belief), false_alarm)
    likelihood[list(poles)] = hit
    if not says_pole:
        likelihood = 1 - likelihood
    product = likelihood * belief
    return product / product.sum()
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "locate-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief = np.array([0.4, 0.3, 0.2, 0.1])
    before = belief.copy()
    got = answer_array(locate(belief, True, poles=[1, 3], hit=0.8, false_alarm=0.1), "locate")
    assert np.array_equal(belief, before), "locate changed its argument `belief`: make a new array (no *=, no /=)"
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    slips = {
        (0.0556, 0.4444, 0.0556, 0.4444): "you forget what was believed before: multiply the prior in",
        (0.1786, 0.3929, 0.1071, 0.3214): "you add prior and likelihood: Bayes' rule multiplies them",
        (0.6154, 0.0577, 0.3077, 0.0192): "that moves belief away from the poles: `hit` belongs to cells with a pole",
    }
    _explain(got, slips)
    assert np.isclose(got.sum(), 1), f"the belief sums to {got.sum():.2f}: divide by the sum of the products"
    np.testing.assert_allclose(got, np.array([4, 24, 2, 8]) / 38, err_msg="by hand: 0.04, 0.24, 0.02, 0.08")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_locate_pole(locate)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "locate-nothing-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief, poles = np.array([0.4, 0.3, 0.2, 0.1]), [1, 3]
    got = answer_array(locate(belief.copy(), False, poles, hit=0.8, false_alarm=0.1), "locate")
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    says_pole = answer_array(locate(belief.copy(), True, poles, hit=0.8, false_alarm=0.1), "locate")
    swapped = answer_array(locate(belief.copy(), True, poles, hit=0.1, false_alarm=0.8), "locate")
    slips = {
        (0.4, 0.3, 0.2, 0.1): "the sensor said *nothing*, you learnt nothing: its silence is evidence against poles",
        tuple(says_pole): "the sensor said *nothing*, and you count it as *pole*: use `says_pole`",
        tuple(swapped): "you swap the two; P(nothing | cell) = 1 - P(pole | cell) instead",
    }
    _explain(got, slips)
    # Silence is like the word of a sensor that says it with 1 - hit and 1 - false_alarm.
    by_hand = answer_array(locate(belief.copy(), True, poles, hit=1 - 0.8, false_alarm=1 - 0.1), "locate")
    np.testing.assert_allclose(got, by_hand, err_msg="by hand: 0.36, 0.06, 0.18, 0.02, divided by 0.62")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_locate_nothing(locate)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: a move with an error (2 + 1 points)
#
# The vehicle drives forward, towards higher cells: `moved[d]` is the probability that it has moved by `d` cells, d = 0, 1, 2, ... (so `moved[0]` is the
# probability that it has not moved at all).
#
# Complete `predict`: it returns the belief after the move. With `ring=True` the road is a ring: after the last cell comes cell 0. For one more point: with
# `ring=False` the road ends at a wall behind the last cell, and who would drive beyond it stands in the last cell.


# %% nbgrader={"grade": false, "grade_id": "predict", "locked": false, "schema_version": 3, "solution": true, "task": false}
def predict(belief, moved, ring=True):
    """Return the belief (N,) after a move."""
    ### BEGIN SOLUTION
    n_cells = len(belief)
    after = np.zeros(n_cells)
    for n in range(n_cells):
        for d, m in enumerate(moved):
            target = (n + d) % n_cells if ring else min(n + d, n_cells - 1)
            after[target] += m * belief[n]
    return after
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "predict-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief, moved = np.array([0.5, 0.3, 0.2, 0.0]), np.array([0.1, 0.7, 0.2])
    before = belief.copy(), moved.copy()
    got = answer_array(predict(belief, moved), "predict")
    assert np.array_equal(belief, before[0]), "predict changed its argument `belief`: make a new array"
    assert np.array_equal(moved, before[1]), "predict changed its argument `moved`: make a new array"
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    slips = {
        (0.30, 0.17, 0.12, 0.41): "that drives backwards: what arrives in cell n after d cells comes from n - d",
        (0.12, 0.41, 0.30, 0.17): "the kernel is reversed: moved[0] is the probability of staying",
        (0.38, 0.33, 0.20, 0.09): "one cell too short: moved[0] means 0 cells; the kernel isn't centred",
        (0.20, 0.09, 0.38, 0.33): "one cell too far: moved[0] means 0 cells",
        (0.05, 0.38, 0.33, 0.20): "what drives beyond the last cell is lost: on a ring it arrives in cell 0",
        (
            0.05,
            0.38,
            0.33,
            0.24,
        ): "what drives beyond the last cell stands before a wall: on a ring it arrives in cell 0",
    }
    _explain(got, slips)
    assert np.isclose(got.sum(), 1), f"the belief sums to {got.sum():.2f}: what leaves one cell must arrive in another"
    np.testing.assert_allclose(got, [0.09, 0.38, 0.33, 0.20], err_msg="cell 1: 0.7 of 0.5, 0.1 of 0.3 and 0.2 of 0.0")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_predict_ring(predict)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "predict-wall-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief, moved = np.array([0.5, 0.3, 0.2, 0.0]), np.array([0.1, 0.7, 0.2])
    got = answer_array(predict(belief.copy(), moved.copy(), ring=False), "predict")
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    normalised = tuple(np.array([0.05, 0.38, 0.33, 0.20]) / 0.96)
    slips = {
        (0.09, 0.38, 0.33, 0.20): "that is the ring: with `ring=False` nothing comes round to cell 0",
        (0.05, 0.38, 0.33, 0.20): "0.04 is lost: who would drive beyond the wall stands in the last cell",
        normalised: "the sum is right, but the 0.04 at the wall went to all cells, not to the last",
    }
    _explain(got, slips)
    # By your own kernel: on a ring with three empty cells more on either side, what ends in those stands at a wall.
    wide = answer_array(predict(np.pad(belief, 3), moved.copy()), "predict")
    assert wide.shape == (10,), f"expected one number for each of 10 cells, shape (10,), got {wide.shape}"
    by_ring = [wide[:4].sum(), *wide[4:6], wide[6:].sum()]
    right = np.allclose(got, by_ring) or np.allclose(got, [0.05, 0.38, 0.33, 0.24])
    assert right, f"expected 0.05, 0.38, 0.33, 0.24: from cell 2, 0.9 of 0.2 ends in cell 3; got {np.round(got, 3)}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_predict_wall(predict)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: predict, update, repeat (3 points)
#
# Now one grid cell with S states. `belief`, shape `(S,)`, is what you believe before the first scan. `M[i, j]` is the probability that a cell in state i is in
# state j at the next scan. `likelihoods`, shape `(T, S)`, has one row a scan: P(z | state).
#
# Complete `follow`: it returns the belief after each scan, shape `(T, S)`. Between two scans the world changes, and before the first scan too. A drive
# has thousands of scans.


# %% nbgrader={"grade": false, "grade_id": "follow", "locked": false, "schema_version": 3, "solution": true, "task": false}
def follow(belief, likelihoods, M):
    """Return the belief after each scan (T, S)."""
    ### BEGIN SOLUTION
    history = []
    for likelihood in likelihoods:
        product = (belief @ M) * likelihood
        belief = product / product.sum()
        history.append(belief)
    return np.array(history)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "follow-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief, M = np.array([0.6, 0.4]), np.array([[0.9, 0.1], [0.3, 0.7]])  # FREE, OCCUPIED
    likelihoods = np.array([[0.2, 0.8], [0.5, 0.5], [0.9, 0.3]])  # a return, silence, a pass
    got = answer_array(follow(belief.copy(), likelihoods.copy(), M.copy()), "follow")
    assert got.shape != (4, 2), "four rows for three scans: leave out the belief from before the first scan"
    assert got.shape != (2,), "only one belief came back: return that after each scan, one row a scan"
    assert got.shape == (3, 2), f"expected one row for each scan, shape (3, 2), got {got.shape}"
    sums = got.sum(axis=1)
    wrong = np.abs(sums - 1).argmax()
    assert np.allclose(sums, 1), f"the belief after scan {wrong} sums to {sums[wrong]:.2f}: normalise each belief"
    slips = {
        (0.2397, 0.7603): "M is transposed: M[i, j] goes from i to j, so a belief stands to its left",
        (0.2727, 0.7273): "the first scan comes after a time step: predict first, then update",
        (0.4636, 0.5364): "that is update, then predict; a scan speaks of now: predict first",
        (0.66, 0.34): "that is the prediction before the scan: return what is believed after it",
    }
    _explain(got[0], slips)
    np.testing.assert_allclose(got[0], [0.3267, 0.6733], atol=1e-4, err_msg="0.66, 0.34 predicted; times 0.2, 0.8")
    _explain(got[1], {(0.66, 0.34): "each scan starts from the first belief again: carry on from the last one"})
    _explain(got[1], {(0.3267, 0.6733): "nothing was predicted before the second scan: a silent scan takes time, too"})
    silent = "a silent scan leaves the prediction as it is"
    np.testing.assert_allclose(got[1], [0.4960, 0.5040], atol=1e-4, err_msg=silent)
    np.testing.assert_allclose(got[2], [0.8167, 0.1833], atol=1e-4)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_follow(follow)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: a matrix for any time step (2 + 1 points)
#
# In a free cell something appears at the rate `appears`, and what stands in it vanishes at the rate `vanishes`, both in 1/s. It may change more than once in a
# time step: that is what makes this more than two probabilities. Rates may be 0, and so may `dt`.
#
# Complete `transition`: it returns the 2 x 2 matrix of a step of `dt` seconds, states in the order FREE, OCCUPIED; `M[i, j]` goes from i to j. The closed
# form (solve one linear differential equation), `scipy.linalg.expm` and the lecture's 100,000 short steps are all fine; five digits must be right.
#
# For one more point complete `half_life`: whatever is believed of a cell, when nobody looks it tends to the same final belief. After how many seconds is
# half of the difference left? At least one of the two rates is positive.


# %% nbgrader={"grade": false, "grade_id": "transition", "locked": false, "schema_version": 3, "solution": true, "task": false}
def transition(appears, vanishes, dt):
    """Return the transition matrix (2, 2) of FREE and OCCUPIED over `dt` seconds."""
    ### BEGIN SOLUTION
    total = appears + vanishes
    if total == 0:
        return np.eye(2)
    final = np.array([vanishes, appears]) / total
    kept = np.exp(-total * dt)
    return kept * np.eye(2) + (1 - kept) * final
    ### END SOLUTION


def half_life(appears, vanishes):
    """Return the seconds after which half of the difference to the final belief is left."""
    ### BEGIN SOLUTION
    return np.log(2) / (appears + vanishes)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "transition-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_array(transition(appears=0.5, vanishes=1.5, dt=0.4), "transition")
    assert got.shape == (2, 2), f"expected a matrix of shape (2, 2), got {got.shape}"
    slips = {
        ((0.8, 0.2), (0.6, 0.4)): "that is I + R dt, a single step: right for a very short time only",
        ((0.8187, 1.2214), (1.8221, 0.5488)): "np.exp takes each entry by itself; the exponential of a matrix is expm",
        (
            (0.8623, 0.4130),
            (0.1377, 0.5870),
        ): "that is the transpose: a row is where it comes from, so each row sums to 1",
        ((0.5870, 0.4130), (0.1377, 0.8623)): "the rates are swapped: what is free changes at the rate `appears`",
        ((0.8187, 0.1813), (0.4512, 0.5488)): "1 - exp(-rate dt) forgets that a cell may change and change back",
        ((0.7838, 0.2162), (0.6485, 0.3515)): "that is the matrix of a whole second: use `dt`",
        ((1.3064, -0.3064), (-0.9191, 1.9191)): "a probability above 1: check the sign of the exponent, belief decays",
        ((0.75, 0.25), (0.75, 0.25)): "that is where it ends after a very long time: use `dt`",
    }
    _explain(got, slips)
    sums = got.sum(axis=1)
    assert np.allclose(sums, 1), f"rows sum to {sums.round(3)}: from each state the cell must go somewhere"
    by_hand = "exp(-2 * 0.4) = 0.449 of every difference is left"
    np.testing.assert_allclose(got, [[0.8623, 0.1377], [0.4130, 0.5870]], atol=1e-4, err_msg=by_hand)
    same = answer_array(transition(0.5, 1.5, dt=0.0), "transition")
    np.testing.assert_allclose(same, np.eye(2), atol=1e-9, err_msg="in no time nothing changes")
    half = answer_array(transition(0.5, 1.5, dt=0.2), "transition")
    np.testing.assert_allclose(half @ half, got, atol=1e-5, err_msg="two half steps must make one whole step")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_transition(transition)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "half-life-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_number(half_life(appears=0.5, vanishes=1.5), "half_life")
    slips = {
        0.5: "1 / (appears + vanishes) is the time after which 1/e is left; you want 1/2",
        1.3863: "what vanishes pulls towards the final belief, too: both rates count",
        0.4621: "what appears pulls towards the final belief, too: both rates count",
        0.6931: "the difference falls like exp(-(appears + vanishes) t), not like exp(-t)",
        1.8484: "two processes at once are faster than each alone: add the rates, not the times",
    }
    _explain(got, slips)
    assert np.isclose(got, 0.34657, atol=1e-4), f"expected ln 2 / 2 = 0.347 s, got {got:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_half_life(half_life)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: each witness once (2 points)
#
# A scan gives K returns: `likelihoods`, shape `(K, S)`, has one row a return. `beams`, shape `(K,)`, says which beam each came from. Different beams err
# independently. Returns of one beam don't: what fools the first fools the second too. So of each beam count only its **first** return, in the order of the
# rows; they need not be sorted by beam.
#
# Complete `fuse`: it returns the belief after the scan, shape `(S,)`. A scan may have thousands of beams: mind what lecture 01 says of long products.


# %% nbgrader={"grade": false, "grade_id": "fuse", "locked": false, "schema_version": 3, "solution": true, "task": false}
def fuse(belief, likelihoods, beams):
    """Return the belief (S,) after a scan, counting each beam once."""
    ### BEGIN SOLUTION
    _, first = np.unique(beams, return_index=True)
    log_product = np.log(belief) + np.log(likelihoods[first]).sum(axis=0)
    product = np.exp(log_product - log_product.max())
    return product / product.sum()
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "fuse-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief = np.array([0.6, 0.4])  # FREE, OCCUPIED
    likelihoods = np.array([[0.2, 0.8], [0.1, 0.9], [0.7, 0.3]])
    beams = np.array([4, 4, 9])
    got = answer_array(fuse(belief.copy(), likelihoods.copy(), beams.copy()), "fuse")
    assert got.shape == (2,), f"expected one number for each of the 2 states, shape (2,), got {got.shape}"
    slips = {
        (0.0886, 0.9114): "all three returns count: the second is the same beam's, and no new witness",
        (0.28, 0.72): "you keep the last return of beam 4: keep its first",
        (0.3818, 0.6182): "you average the returns of a beam: only the first counts",
        (0.5676, 0.4324): "the prior is in it once for each beam: it counts once",
        (0.3684, 0.6316): "the prior is missing: multiply it in, once",
        (0.5510, 0.4490): "you average over beams: independent evidence is multiplied",
        (0.2727, 0.7273): "only one beam counts: beams 4 and 9 are two witnesses",
    }
    _explain(got, slips)
    assert np.isclose(got.sum(), 1), f"the belief sums to {got.sum():.2f}: normalise it"
    np.testing.assert_allclose(got, np.array([84, 96]) / 180, err_msg="0.6 * 0.2 * 0.7 against 0.4 * 0.8 * 0.3")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_fuse(fuse)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# A car has been parked in a cell for ten minutes: 6000 scans said *occupied*, and the filter's matrix is the identity (nothing ever changes). Now the car
# drives off. What will the filter believe of the cell during the next minute, and why? Name one change to the filter that repairs it, and one thing that gets
# worse by it. Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "parked", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# Each scan has multiplied the odds, so after 6000 of them they are astronomic, and P(FREE) may have become an exact zero. Each scan that passes takes back as little
# as one scan has put in, or nothing at all from a zero, so the cell stays occupied: for minutes, or for ever. Repair: a transition matrix with a small rate from
# OCCUPIED to FREE (or a bound on the odds, which amounts to the same): then there is always some belief left to multiply. What gets worse: the filter forgets what
# it isn't shown, so a wall behind a passing truck fades, and a single wrong reading does more harm.
# One point for the odds that have to be undone (or the zero), one for a repair together with its price.

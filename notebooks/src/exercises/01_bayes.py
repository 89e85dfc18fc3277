# %% [markdown]
# # Exercise 01: Bayes' rule on a line
#
# Six small functions: a sensor that gets stuck, a move on ice, a filter that waits before it answers, a matrix from what was counted and its half-life,
# and a map put together from them. Then one question to answer in words. About 90 minutes. The lecture is [01: Bayes' rule on a line](../01_bayes.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | update: readings that repeat themselves | 1 + 1 |
# | 2 | predict: a move where the road is slippery, on a ring and before a wall | 2 + 1 |
# | 3 | a filter, and a smoother that waits for a few scans | 1 + 2 |
# | 4 | a transition matrix from counts, for any time step; its half-life | 2 + 1 |
# | 5 | put together: a map from scans at any times | 2 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array, answer_number

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.


def _explain(got, slips):
    """Stop with a hint when `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.allclose(got, slip, atol=5e-4), f"got {np.round(got, 3)}: {hint}"


# %% [markdown]
# ## Task 1: a sensor that gets stuck (1 + 1 points)
#
# A vehicle *stands still* in one of N cells: `belief`, shape `(N,)`, sums to 1. `poles` lists the cells that have a pole beside them (the first cell is 0). A sensor is read several
# times: `readings` is a list with `True` for *pole* and `False` for *nothing*. The sensor's electronics are old. With probability `stuck` it doesn't look at all, and delivers its last reading once
# more. Otherwise the reading is fresh: *pole* with probability `hit` beside a pole, and with probability `false_alarm` elsewhere. The first reading is always fresh.
#
# Complete `locate`: it returns the belief after all readings. One point is for `stuck=0`, where the readings err independently. The other is for any `stuck` up to 1 under which the readings are possible: then they don't, and you
# have to ask how probable a reading is given the cell *and the reading before it*. (What must come out if all readings are alike and `stuck=1`?) There may be no reading, or thousands. Leave `belief` as it is:
# somebody else may need it.


# %% nbgrader={"grade": false, "grade_id": "locate", "locked": false, "schema_version": 3, "solution": true, "task": false}
def locate(belief, readings, poles, hit, false_alarm, stuck=0.0):
    """Return the belief (N,) of a vehicle that stands still, after several readings."""
    ### BEGIN SOLUTION
    p_pole = np.full(len(belief), false_alarm)
    p_pole[list(poles)] = hit
    last = None
    for says_pole in readings:
        likelihood = p_pole if says_pole else 1 - p_pole
        if last is not None:
            likelihood = (1 - stuck) * likelihood + stuck * (says_pole == last)
        belief = likelihood * belief
        belief = belief / belief.sum()
        last = says_pole
    return belief
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "locate-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    belief = np.array([0.4, 0.3, 0.2, 0.1])
    before, readings = belief.copy(), [True, False, True]
    got = answer_array(locate(belief, readings, poles=[1, 3], hit=0.8, false_alarm=0.1), "locate")
    assert np.array_equal(belief, before), "locate changed its argument `belief`: make a new array (no *=, no /=)"
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    slips = {
        (0.1053, 0.6316, 0.0526, 0.2105): "one reading is missing: multiply by the likelihood of *each* reading",
        (
            0.0153,
            0.7328,
            0.0076,
            0.2443,
        ): "the sensor said *nothing*, you learnt nothing: its silence is evidence against poles",
        (0.0019, 0.7478, 0.001, 0.2493): "the sensor said *nothing*, and you count it as *pole*",
        (0.0328, 0.4672, 0.0328, 0.4672): "you forget what was believed before: multiply the prior in",
        (
            0.1361,
            0.8166,
            0.017,
            0.0302,
        ): "the first belief is in it three times: each reading goes on from the last belief",
    }
    _explain(got, slips)
    assert np.isclose(got.sum(), 1), f"the belief sums to {got.sum():.4f}: divide by the sum of the products"
    expected = np.array([0.0036, 0.0384, 0.0018, 0.0128])
    np.testing.assert_allclose(got, expected / expected.sum(), err_msg="by hand: beside a pole 0.8 * 0.2 * 0.8")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_locate_fresh(locate)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "locate-stuck-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    belief, poles = np.array([0.4, 0.3, 0.2, 0.1]), [1, 3]
    got = answer_array(locate(belief.copy(), [True, True, False], poles, 0.8, 0.1, stuck=0.5), "locate")
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    slips = {
        (0.0636, 0.6784, 0.0318, 0.2261): "`stuck` isn't used: a repeated reading may bring nothing new",
        (0.3051, 0.4068, 0.1525, 0.1356): "a repeated reading may be a fresh one: it brings less, not nothing",
        (
            0.1024,
            0.6348,
            0.0512,
            0.2116,
        ): "the third reading differs from the second, so it isn't a repetition: no `stuck` there",
        (0.4773, 0.213, 0.2387, 0.071): "the first reading repeats nothing: it is fresh",
        (0.1869, 0.5398, 0.0934, 0.1799): "a reading is fresh with probability 1 - stuck only: that factor is missing",
    }
    _explain(got, slips)
    expected = np.array([0.0099, 0.0216, 0.00495, 0.0072])
    by_hand = "beside a pole 0.8, then 0.5 * 0.8 + 0.5, then 0.5 * 0.2"
    np.testing.assert_allclose(got, expected / expected.sum(), err_msg=by_hand)
    once = answer_array(locate(belief.copy(), [False], poles, 0.8, 0.1), "locate")
    alike = answer_array(locate(belief.copy(), [False] * 3, poles, 0.8, 0.1, stuck=1.0), "locate")
    np.testing.assert_allclose(alike, once, err_msg="with stuck=1 three readings are worth one")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_locate_stuck(locate)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: a move with an error (2 + 1 points)
#
# The vehicle drives forward, towards higher cells. Some cells are icy, so the move depends on the cell where it starts: `moved[n, d]` is the probability that a vehicle
# in cell n moves by d cells, d = 0, 1, 2, ... (so `moved[n, 0]` is the probability that it stays). `moved` has shape `(N, D)`, and each row sums to 1.
#
# Complete `predict`: it returns the belief after the move. With `ring=True` the road is a ring: after the last cell comes cell 0. For one more point: with
# `ring=False` the road ends at a wall behind the last cell, and a vehicle that would drive beyond it stands in the last cell.


# %% nbgrader={"grade": false, "grade_id": "predict", "locked": false, "schema_version": 3, "solution": true, "task": false}
def predict(belief, moved, ring=True):
    """Return the belief (N,) after a move."""
    ### BEGIN SOLUTION
    n_cells = len(belief)
    after = np.zeros(n_cells)
    for n in range(n_cells):
        for d, p in enumerate(moved[n]):
            target = (n + d) % n_cells if ring else min(n + d, n_cells - 1)
            after[target] += p * belief[n]
    return after
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "predict-hints", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_MOVE_SLIPS = {
    (0.09, 0.38, 0.26, 0.20): "that is the row of the cell of arrival: the ice is where it starts",
    (0.09, 0.38, 0.33, 0.20): "row 0 of `moved` for all cells: each cell has its own row",
    (0.28, 0.09, 0.22, 0.41): "that drives backwards: what arrives in cell n after d cells comes from n - d",
    (0.22, 0.41, 0.28, 0.09): "the rows are reversed: moved[n, 0] is the probability of staying",
    (0.38, 0.43, 0.12, 0.07): "one cell too short: moved[n, 0] means 0 cells; the kernel isn't centred",
    (0.12, 0.07, 0.38, 0.43): "one cell too far: moved[n, 0] means 0 cells",
    (0.05, 0.38, 0.43, 0.12): "what drives beyond the last cell is lost: on a ring it arrives in cell 0",
    (0.05, 0.38, 0.43, 0.14): "that is the road before a wall: on a ring it arrives in cell 0",
}


# %% nbgrader={"grade": true, "grade_id": "predict-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    dry, icy = (0.1, 0.7, 0.2), (0.6, 0.3, 0.1)
    belief, moved = np.array([0.5, 0.3, 0.2, 0.0]), np.array([dry, dry, icy, dry])
    before = belief.copy(), moved.copy()
    got = answer_array(predict(belief, moved), "predict")
    assert np.array_equal(belief, before[0]), "predict changed its argument `belief`: make a new array"
    assert np.array_equal(moved, before[1]), "predict changed its argument `moved`: make a new array"
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    _explain(got, _MOVE_SLIPS)
    assert np.isclose(got.sum(), 1), f"the belief sums to {got.sum():.2f}: what leaves one cell must arrive in another"
    by_hand = "cell 2: 0.2 of 0.5, 0.7 of 0.3 and 0.6 of 0.2"
    np.testing.assert_allclose(got, [0.07, 0.38, 0.43, 0.12], atol=1e-5, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_predict_ring(predict)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "predict-wall-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    dry, icy = (0.1, 0.7, 0.2), (0.6, 0.3, 0.1)
    belief, moved = np.array([0.5, 0.3, 0.2, 0.0]), np.array([dry, dry, icy, dry])
    got = answer_array(predict(belief.copy(), moved.copy(), ring=False), "predict")
    assert got.shape == (4,), f"expected one number for each of the 4 cells, shape (4,), got {got.shape}"
    normalised = tuple(np.array([0.05, 0.38, 0.43, 0.12]) / 0.98)
    slips = {
        (0.07, 0.38, 0.43, 0.12): "that is the ring: with `ring=False` nothing comes round to cell 0",
        (0.05, 0.38, 0.43, 0.12): "0.02 is lost: what would drive beyond the wall stands in the last cell",
        normalised: "the sum is right, but the 0.02 at the wall went to all cells, not to the last",
    }
    _explain(got, slips)
    # By your own move: on a ring with three empty cells more on either side, what ends in those stands at a wall.
    longer = np.pad(moved, ((3, 3), (0, 0)), mode="edge")
    wide = answer_array(predict(np.pad(belief, 3), longer), "predict")
    assert wide.shape == (10,), f"expected one number for each of 10 cells, shape (10,), got {wide.shape}"
    by_ring = [wide[:4].sum(), *wide[4:6], wide[6:].sum()]
    right = np.allclose(got, by_ring, atol=1e-5) or np.allclose(got, [0.05, 0.38, 0.43, 0.14], atol=1e-5)
    assert right, f"expected 0.05, 0.38, 0.43, 0.14: from cell 2, 0.4 of 0.2 ends in cell 3; got {np.round(got, 3)}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_predict_wall(predict)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: a filter that may wait (1 + 2 points)
#
# Now one grid cell with S states. `belief`, shape `(S,)`, is what you believe at the time of the first scan, before you have seen it: there is no move before it. `M[i, j]` is the
# probability that a cell in state i is in state j at the next scan. `likelihoods`, shape `(T, S)`, has one row per scan: P(z | state). A drive has thousands of scans.
#
# Complete `follow`: row t of what it returns, shape `(T, S)`, is the belief in the state at scan t, given the scans 0 to t + `lag`, as far as there are so many. With `lag=0`
# that is the filter (one point). With `lag=2` the filter waits for two more scans before it says what the cell was: this is a *fixed-lag smoother* (two points). The last rows, for which
# fewer scans follow, use what there is. Leave your arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "follow", "locked": false, "schema_version": 3, "solution": true, "task": false}
def follow(belief, likelihoods, M, lag=0):
    """Return the belief in the state at each scan, given the scans up to `lag` later (T, S)."""
    ### BEGIN SOLUTION
    history = []
    for t, likelihood in enumerate(likelihoods):
        prior = belief @ M if t else belief
        belief = prior * likelihood / (prior @ likelihood)
        history.append(belief)
    history = np.array(history)
    for t in range(len(history)):
        message = np.ones(len(belief))
        for later in likelihoods[t + 1 : t + 1 + lag][::-1]:
            message = M @ (later * message)
            message /= message.sum()
        history[t] *= message
        history[t] /= history[t].sum()
    return history
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "follow-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    belief, M = np.array([0.6, 0.4]), np.array([[0.9, 0.1], [0.3, 0.7]])  # FREE, OCCUPIED
    likelihoods = np.array([[0.2, 0.8], [0.5, 0.5], [0.9, 0.3]])  # a return, silence, a pass
    arguments = belief.copy(), likelihoods.copy(), M.copy()
    got = answer_array(follow(*arguments), "follow")
    same = all(np.array_equal(a, b) for a, b in zip(arguments, (belief, likelihoods, M), strict=True))
    assert same, "follow changed one of its arguments: make new arrays (no *=, no /=)"
    assert got.shape != (4, 2), "four rows for three scans: leave out the belief from before the first scan"
    assert got.shape != (2,), "only one belief came back: return that after each scan, one row per scan"
    assert got.shape == (3, 2), f"expected one row for each scan, shape (3, 2), got {got.shape}"
    sums = got.sum(axis=1)
    wrong = np.abs(sums - 1).argmax()
    assert np.allclose(sums, 1), f"the belief after scan {wrong} sums to {sums[wrong]:.2f}: normalise each belief"
    slips = {
        (0.3267, 0.6733): "`belief` is at the time of the first scan: no move before it",
        (0.4636, 0.5364): "that is the prediction for the next scan: return what is believed at this one",
        (0.6, 0.4): "that is the belief before the scan: return what is believed after it",
    }
    _explain(got[0], slips)
    np.testing.assert_allclose(got[0], [0.2727, 0.7273], atol=1e-4, err_msg="0.6, 0.4; times 0.2, 0.8")
    slips = {
        (0.35, 0.65): "M is transposed: M[i, j] goes from i to j, so a belief stands to its left",
        (0.6, 0.4): "each scan starts from the first belief again: carry on from the last one",
        (0.2727, 0.7273): "nothing was predicted before the second scan: a silent scan takes time, too",
    }
    _explain(got[1], slips)
    silent = "a silent scan leaves the prediction as it is"
    np.testing.assert_allclose(got[1], [0.4636, 0.5364], atol=1e-4, err_msg=silent)
    np.testing.assert_allclose(got[2], [0.8044, 0.1956], atol=1e-4)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_follow(follow)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "follow-lag-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    belief, M = np.array([0.6, 0.4]), np.array([[0.9, 0.1], [0.3, 0.7]])  # FREE, OCCUPIED
    likelihoods = np.array([[0.2, 0.8], [0.7, 0.4], [0.9, 0.3], [0.1, 0.5]])
    arguments = belief.copy(), likelihoods.copy(), M.copy()
    got = answer_array(follow(*arguments, lag=1), "follow")
    same = all(np.array_equal(a, b) for a, b in zip(arguments, (belief, likelihoods, M), strict=True))
    assert same, "follow changed one of its arguments: make new arrays (no *=, no /=)"
    assert got.shape == (4, 2), f"one row for each of 4 scans, whatever the lag, shape (4, 2), got {got.shape}"
    sums = got.sum(axis=1)
    wrong = np.abs(sums - 1).argmax()
    assert np.allclose(sums, 1, atol=1e-5), f"the belief of scan {wrong} sums to {sums[wrong]:.2f}: normalise each row"
    slips = {  # P(FREE) of the first three rows
        (0.2727, 0.6020, 0.8541): "that is the filter: with `lag=1` row t also uses scan t + 1",
        (0.3457, 0.6162, 0.6833): "that uses all later scans: with `lag=1` only the next one",
        (0.3982, 0.6162, 0.6833): "that waits for two scans: with `lag=1` only for the next one",
        (0.6020, 0.8541, 0.4642): "that is the filter one scan later: row t is still about scan t",
        (0.4455, 0.8194, 0.7961): "M is transposed: backward in time, sum over where the cell goes, M @ ...",
        (0.3962, 0.8194, 0.5394): "the later scan is about a later state: bring it back by M",
        (0.1136, 0.8225, 0.8662): "row t counts scan t twice: the message holds later scans only",
        (0.4636, 0.6612, 0.8125): "that is a prediction: multiply by what the later scan says",
        (0.3989, 0.7509, 0.7010): "`belief` is at the time of the first scan: no move before it",
    }
    _explain(got[:3, 0], slips)
    by_hand = "row 0: the filter's 0.2727, 0.7273, times what the next scan says of each, 0.67 and 0.49"
    np.testing.assert_allclose(got[0], [0.3390, 0.6610], atol=1e-4, err_msg=by_hand)
    np.testing.assert_allclose(got[2], [0.6833, 0.3167], atol=1e-4)
    last = "after the last scan nothing follows: its row is the filter's"
    np.testing.assert_allclose(got[3], [0.4642, 0.5358], atol=1e-4, err_msg=last)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_follow_lag(follow)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: a matrix for any time step (2 + 1 points)
#
# Somebody watched cells on a real drive and counted: `counts[i, j]`, shape `(2, 2)`, is how often a cell in state i (0 is FREE, 1 is OCCUPIED) was in state j at the next scan, `dt` seconds
# later. Your LIDAR has another time step. A cell may change more than once in a time step: that is what makes this more than a division.
#
# Complete `transition`: it returns the 2 x 2 matrix of a step of `new_dt` seconds; `M[i, j]` goes from i to j. Five digits must be right. `new_dt` may be shorter or longer than `dt`, and 0.
# Each state was seen at least once; perhaps no change was ever seen. You may assume that states last: `1 - M[0, 1] - M[1, 0]` of the counted step is greater than 0.
#
# For one more point complete `half_life`: whatever is believed of a cell, when nobody looks it tends to the same final belief. After how many seconds is
# half of the difference left? Here at least one change has been seen.


# %% nbgrader={"grade": false, "grade_id": "transition", "locked": false, "schema_version": 3, "solution": true, "task": false}
def transition(counts, dt, new_dt):
    """Return the transition matrix (2, 2) of FREE and OCCUPIED over `new_dt` seconds."""
    ### BEGIN SOLUTION
    M = np.array(counts) / np.sum(counts, axis=1, keepdims=True)
    appears, vanishes = M[0, 1], M[1, 0]
    if appears + vanishes == 0:
        return np.eye(2)
    final = np.array([vanishes, appears]) / (appears + vanishes)
    kept = (1 - appears - vanishes) ** (new_dt / dt)
    return kept * np.eye(2) + (1 - kept) * final
    ### END SOLUTION


def half_life(counts, dt):
    """Return the seconds after which half of the difference to the final belief is left."""
    ### BEGIN SOLUTION
    M = np.array(counts) / np.sum(counts, axis=1, keepdims=True)
    return dt * np.log(0.5) / np.log(1 - M[0, 1] - M[1, 0])
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "transition-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    counts = np.array([[180, 20], [30, 70]])
    got = answer_array(transition(counts.copy(), dt=0.1, new_dt=0.05), "transition")
    assert got.shape == (2, 2), f"expected a matrix of shape (2, 2), got {got.shape}"
    slips = {
        ((0.9, 0.1), (0.3, 0.7)): "that is the matrix of `dt`: use `new_dt`",
        ((0.95, 0.05), (0.15, 0.85)): "half the time isn't half the probability: a cell may change and change back",
        ((0.9487, 0.3162), (0.5477, 0.8367)): "that is the root of each entry: take the root of the matrix",
        ((0.9487, 0.0513), (0.1633, 0.8367)): "(1 - p) to a power forgets that a cell may change and change back",
        ((0.84, 0.16), (0.48, 0.52)): "that is the matrix of a step twice as long: `new_dt` is the new one",
        (
            (0.9436, 0.1690),
            (0.0564, 0.8310),
        ): "that is the transpose: a row is where it comes from, so each row sums to 1",
    }
    _explain(got, slips)
    sums = got.sum(axis=1)
    assert np.allclose(sums, 1, atol=1e-5), f"rows sum to {sums.round(3)}: divide the counts of each row by its sum"
    by_hand = "of every difference 1 - 0.1 - 0.3 = 0.6 is left after 0.1 s"
    np.testing.assert_allclose(got, [[0.94365, 0.05635], [0.16905, 0.83095]], atol=1e-4, err_msg=by_hand)
    whole = answer_array(transition(counts.copy(), dt=0.1, new_dt=0.1), "transition")
    np.testing.assert_allclose(whole, [[0.9, 0.1], [0.3, 0.7]], atol=1e-5, err_msg="after `dt` it is what was counted")
    same = answer_array(transition(counts.copy(), dt=0.1, new_dt=0.0), "transition")
    np.testing.assert_allclose(same, np.eye(2), atol=1e-5, err_msg="in no time nothing changes")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_transition(transition)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "half-life-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    got = answer_number(half_life(np.array([[180, 20], [30, 70]]), dt=0.1), "half_life")
    slips = {
        0.1958: "that is the time after which 1/e is left; you want 1/2",
        0.1733: "0.1 / dt and 0.3 / dt aren't the rates: a cell may change and change back within `dt`",
        0.1943: "what appears pulls towards the final belief, too: both changes count",
        0.6579: "what vanishes pulls towards the final belief, too: both changes count",
        0.8522: "two processes at once are faster than each alone",
        1.3569: "that is the number of scans: multiply by `dt`",
    }
    _explain(got, slips)
    assert np.isclose(got, 0.13569, atol=1e-4), f"expected 0.1 ln 0.5 / ln 0.6 = 0.136 s, got {got:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_half_life(half_life)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: put together (2 points)
#
# Now a whole map, each cell filtered by itself. Scan t says P(z | OCCUPIED) of each cell in `occupied[t]` and P(z | FREE) in `free[t]`; both have shape `(T, H, W)`. Where a scan
# says nothing, the two are equal. Scans come at any times, because a real sensor drops some. So `matrices`, shape `(T - 1, 2, 2)`, holds a transition matrix for each gap: `matrices[t]` leads
# from scan t to scan t + 1. (In a moment your `transition` will make them.)
#
# Complete `build_map`: it returns P(OCCUPIED) of each cell after each scan, shape `(T, H, W)`. As in task 3 there is no move before the first scan: at its time each cell is OCCUPIED with probability `first`.
# Leave your arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "build-map", "locked": false, "schema_version": 3, "solution": true, "task": false}
def build_map(occupied, free, matrices, first=0.5):
    """Return P(OCCUPIED) of each cell after each scan (T, H, W)."""
    ### BEGIN SOLUTION
    p, maps = np.full(np.shape(occupied)[1:], first), []
    for t in range(len(occupied)):
        if t:
            p = (1 - p) * matrices[t - 1][0, 1] + p * matrices[t - 1][1, 1]
        p = p * occupied[t] / (p * occupied[t] + (1 - p) * free[t])
        maps.append(p)
    return np.array(maps)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "build-map-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    matrices = np.array([[[0.9, 0.1], [0.3, 0.7]], [[0.804, 0.196], [0.588, 0.412]]])  # 0.1 s, then 0.3 s
    occupied = np.array(
        [[[0.8, 0.3, 0.5]], [[0.8, 0.3, 0.5]], [[0.5, 0.8, 0.5]]]
    )  # three scans, one row of three cells
    free = np.array([[[0.1, 0.7, 0.5]], [[0.1, 0.7, 0.5]], [[0.5, 0.1, 0.5]]])
    arguments = occupied.copy(), free.copy(), matrices.copy()
    got = answer_array(build_map(*arguments, first=0.2), "build_map")
    same = all(np.array_equal(a, b) for a, b in zip(arguments, (occupied, free, matrices), strict=True))
    assert same, "build_map changed one of its arguments: make new arrays (no *=, no /=)"
    assert got.shape == (3, 1, 3), f"one map per scan, shape (3, 1, 3), got {got.shape}"
    slips = {
        (0.6929, 0.1078, 0.2200): "`first` is the belief at the time of the first scan: no move before it",
        (0.8889, 0.3000, 0.5000): "`first` is not used",
        (0.3333, 0.9032, 0.8000): "that is P(FREE)",
        (0.2000, 0.2000, 0.2000): "that is the belief before the first scan: return what is believed after each",
    }
    _explain(got[0, 0], slips)
    by_hand = "0.2 * 0.8 against 0.8 * 0.1 in the first cell"
    np.testing.assert_allclose(got[0, 0], [0.6667, 0.0968, 0.2], atol=1e-4, err_msg=by_hand)
    slips = {
        (0.6333, 0.5751, 0.2320): "the first matrix for each gap: every gap has its own",
        (0.9412, 0.2687, 0.2000): "nothing changes between the scans: predict with `matrices`",
        (0.4274, 0.9093, 0.5211): "M is transposed: M[i, j] goes from i to j",
    }
    _explain(got[2, 0], slips)
    by_hand = "in the first cell 0.889 is predicted to be 0.8889 * 0.412 + 0.1111 * 0.196"
    np.testing.assert_allclose(got[2, 0], [0.3880, 0.6829, 0.2435], atol=1e-4, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import bayes

    complaint = bayes.check_build_map(build_map)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ### Does the map light up?
#
# It is a stage of the pipeline now. Put this into a file `my_stages.py`, with your `transition` and `build_map` above it:
#
# ```python
# from collections import deque
#
# import numpy as np
#
# from semgrid_edu.occupancy import PlanarMotion, SensorModel, scan_evidence
#
# COUNTS, DT = np.array([[980, 20], [50, 950]]), 0.1  # of free cells 2 % are occupied a tenth of a second later
#
#
# def track(frames, spec):
#     """Filter the last ten scans again in the grid of each new frame: slow, but easy to read."""
#     last = deque(maxlen=10)
#     for frame in frames:
#         last.append(frame)
#         poses = [PlanarMotion.from_poses(frame.T_world_from_lidar, old.T_world_from_lidar) for old in last]
#         scans = [scan_evidence(old.points_grid, spec, SensorModel(), pose) for old, pose in zip(last, poses)]
#         occupied, free = np.array([scan.occupied for scan in scans]), np.array([scan.free for scan in scans])
#         matrices = np.array([transition(COUNTS, DT, gap) for gap in np.diff([old.time for old in last])])
#         p = np.asarray(build_map(occupied, free, matrices))[-1]
#         seen = (occupied != free).any(axis=0)
#         yield np.stack([seen * (1 - p), seen * p, 0 * p, 1 - seen])  # FREE, STATIC, DYNAMIC, UNKNOWN
# ```
#
# Then `semgrid-edu demo --stages my_stages.py` runs the system with your filter and with the package's, and shows both side by side. Where do they differ? Yours has no DYNAMIC yet.
#
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

# %% [markdown]
# # Exercise 09: where truth comes from
#
# Five functions that ask more of a made truth than the lecture did, and one question to answer in words. About 90 minutes.
# The lecture is [09: where truth comes from, and how wrong it is](../09_truth.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | a stricter rule for hidden returns | 2 |
# | 2 | which rule of voting to choose | 2 |
# | 3 | an audit of clean-ups | 2 |
# | 4 | what your rule changes in a map | 3 |
# | 5 | what a wrong label costs | 2 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings
from dataclasses import replace
from math import comb

import numpy as np
from scipy import ndimage  # task 3 may use it

from semgrid_edu.workshop.course.answers import answer_array
from semgrid_edu.camera import project, transform_points
from semgrid_edu.datasets.ground_truth import TruthPolicy, lidar_truth
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
ROAD, SIDEWALK, VEGETATION, CAR = (KITTI_14.index(n) for n in ("road", "sidewalk", "vegetation", "car"))
FREE, STATIC, DYNAMIC, UNKNOWN = range(4)  # the occupancy states


def in_view(frame):
    """Return the number of each return that falls into the image, (N,), its whole pixel (u, v), (N, 2), and depth, (N,)."""
    in_camera = transform_points(frame.camera.T_camera_from_lidar, frame.points[:, :3])
    uv, visible = project(in_camera, frame.camera)
    return np.flatnonzero(visible), np.rint(uv[visible]).astype(int), in_camera[visible, 2]


# %% [markdown]
# ## Task 1: a stricter rule for hidden returns (2 points)
#
# The lecture's rule drops a return when a closer one shares its *pixel*. That catches next to nothing, because two returns seldom meet on one pixel. Here is a
# stricter one. `uv` holds the whole pixel (u, v) of each return, `(N, 2)`, and `Z` its depth in metres, `(N,)`. A return is **hidden** when any other return, at most `reach` columns
# *and* at most `reach` rows away, is closer by **more than** `gap` metres. Returns that are hidden themselves hide others too: something is there.
#
# Complete `open_to_view`: it returns an array `(N,)`, True for each return that is *not* hidden. There are thousands of returns in a scan, so don't loop over all pairs in Python.


# %% nbgrader={"grade": false, "grade_id": "open-to-view", "locked": false, "schema_version": 3, "solution": true, "task": false}
def open_to_view(uv, Z, reach, gap):
    """Return which returns aren't hidden by a closer one in the pixels around, (N,)."""
    ### BEGIN SOLUTION
    is_open = np.ones(len(Z), bool)
    for n in range(len(Z)):
        near = (np.abs(uv - uv[n]) <= reach).all(axis=1)
        is_open[n] = not (Z[n] - Z[near] > gap).any()
    return is_open
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "returns-of-task-1", "locked": true, "schema_version": 3, "solution": false, "task": false}
_RETURNS = np.array(  # u, v, Z; by hand with a reach of 2 pixels and a gap of 0.5 m
    [
        [10, 5, 20.0],  # 0: hidden by 1, two columns away
        [12, 5, 8.0],  # 1
        [15, 5, 20.0],  # 2: three columns from 1
        [12, 8, 20.0],  # 3: three rows from 1
        [14, 7, 20.0],  # 4: hidden by 1, two columns and two rows away
        [30, 5, 10.4],  # 5: 6 is closer, but only by 0.4 m
        [31, 5, 10.0],  # 6
        [40, 5, 30.0],  # 7: hidden by 8, which is hidden too
        [42, 5, 20.0],  # 8: hidden by 9
        [44, 5, 10.0],  # 9
        [50, 5, 12.0],  # 10: hidden by 11, on the same pixel
        [50, 5, 9.0],  # 11
        [60, 5, 10.5],  # 12: 13 is closer by 0.5 m, not by more
        [60, 6, 10.0],  # 13
    ]
)

# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "open-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_OPEN_SLIPS = {  # number of the return: what is wrong when its answer is
    1: "return 1 is dropped, but what is near it is farther away: only a closer return hides",
    10: "return 10 shares its pixel with a closer one: such a return is hidden, as in the lecture",
    2: "return 2 is dropped: the closer one is three columns away",
    3: "return 3 is dropped: the closer one is three rows away",
    5: "return 5 is dropped: the one beside it is closer by 0.4 m only, less than the gap",
    12: "return 12 is dropped: the one below it is closer by 0.5 m, which is not more than the gap",
    4: "return 4 lies two columns and two rows from a closer one: `reach` counts columns and rows, each by itself",
    7: "return 7 is hidden by return 8, although 8 is hidden itself: something is there",
    8: "return 8 is hidden by return 9, two columns away",
    0: "return 0 is hidden: the closer one is two columns away, which is within the reach",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "open-to-view-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    uv, Z = _RETURNS[:, :2].astype(int), _RETURNS[:, 2]
    got = answer_array(open_to_view(uv.copy(), Z.copy(), 2, 0.5), "open_to_view", dtype=bool)
    assert got.shape == (14,), f"expected True or False for each of 14 returns, got shape {got.shape}"
    by_hand = ~np.isin(np.arange(14), [0, 4, 7, 8, 10])
    assert not np.array_equal(got, ~by_hand), "True means that a return is NOT hidden: the other way round"
    for number, hint in _OPEN_SLIPS.items():
        assert got[number] == by_hand[number], hint
    np.testing.assert_array_equal(got, by_hand, err_msg="all returns, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_open_to_view(open_to_view)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: which rule of voting to choose (2 points)
#
# A cell holds `n` returns, an odd number. It is a car with probability `p_car`, otherwise road, and each return brings one of these two classes. Two kinds of error are in the data:
#
# - with probability `calibration` the camera is off, and then **all** returns of the cell fall on pixels of the other class;
# - whether it is or not, each return **by itself** brings the class that its pixel doesn't show, with probability `alone`.
#
# The cell takes its label by *majority*, or by *what stands wins* (car, as soon as one return brings car). Which rule should one choose?
#
# Complete `wrong_shares`: it returns two numbers, the probability that a majority gives the wrong label, and that *what stands wins* does. `comb(n, m)` is the number of ways to choose
# m of n.


# %% nbgrader={"grade": false, "grade_id": "wrong-shares", "locked": false, "schema_version": 3, "solution": true, "task": false}
def wrong_shares(n, alone, calibration, p_car):
    """Return how often a majority is wrong, and how often what stands wins is."""
    ### BEGIN SOLUTION
    majority = standing = 0.0
    for wrong, chance in ((alone, 1 - calibration), (1 - alone, calibration)):
        most = sum(comb(n, m) * wrong**m * (1 - wrong) ** (n - m) for m in range(n // 2 + 1, n + 1))
        majority += chance * most
        standing += chance * ((1 - p_car) * (1 - (1 - wrong) ** n) + p_car * wrong**n)
    return majority, standing
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "wrong-shares-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_MAJORITY_SLIPS = {
    0.0280: "the calibration is ignored",
    0.1252: "when the camera is off, returns err by themselves, too: then one is right with probability `alone`",
    0.1280: "when the camera is off, returns err by themselves, too, and both errors can't be added: go through both cases",
    0.0855: "you let the camera be off for each return by itself: it is off for all of them together",
    0.8776: "that is how often the label is right",
    0.0486: "three wrong returns of three are a wrong majority, too: go up to m = n",
    0.1000: "that holds if no return errs by itself",
    0.0738: "that is the probability that all are wrong: more than half is enough",
}
_STANDING_SLIPS = {
    0.2170: "the calibration is ignored",
    0.7102: "that is how often the label is right",
    0.1278: "the probabilities of road and car are swapped",
    0.3438: "that is a cell of road: weight it with 1 - p_car, and a car cell with p_car",
    0.0738: "that is a cell of a car: weight it with p_car, and a road cell with 1 - p_car",
    0.1224: "that is the majority's",
}


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=1e-4), f"{what} {got:.4f}: {hint}"


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "wrong-shares-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: three returns. Wrong with 0.1 each: a majority with 0.028, a road cell 0.271, a car cell 0.001. Wrong with 0.9 each: 0.972, 0.999, 0.729.
    got = answer_array(wrong_shares(3, 0.1, 0.1, 0.2), "wrong_shares")
    assert got.shape == (2,), f"expected two numbers, majority and what stands wins, got shape {got.shape}"
    assert not np.allclose(got, [0.2898, 0.1224], atol=1e-4), "the two numbers are swapped: the majority comes first"
    _explain("majority:", got[0], _MAJORITY_SLIPS)
    np.testing.assert_allclose(got[0], 0.9 * 0.028 + 0.1 * 0.972, atol=1e-6, err_msg="majority")
    _explain("what stands wins:", got[1], _STANDING_SLIPS)
    wanted = 0.9 * (0.8 * 0.271 + 0.2 * 0.001) + 0.1 * (0.8 * 0.999 + 0.2 * 0.729)
    np.testing.assert_allclose(got[1], wanted, atol=1e-6, err_msg="what stands wins")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_wrong_shares(wrong_shares)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# When the test has passed: how large must `p_car` be for *what stands wins* to be the better rule, with three returns and both errors 0.1? And with nine returns? Is there any number of returns with which it is
# better for a street on which one cell in ten is a car?
#
# ## Task 3: an audit of clean-ups (2 points)
#
# In the lecture the clean-up made most labels, and class by class its guesses were worse than votes. You are given finished maps, and want to know which of them break the rules of their own recipe. `votes` is a map of classes, `(H, W)`, with 255 where no
# return has brought a label. `unseen`, `(H, W)`, is True in cells that the filter has not observed. `made` is the finished map, `(H, W)`: classes 0 to 9 have a meaning, 10 to 13 are the unknown ones.
#
# Complete `audit`: it returns three numbers, how many cells break each of these rules.
#
# 1. A cell with a vote keeps it.
# 2. A cell without a vote that is unseen gets no class with a meaning.
# 3. A cell without a vote gets a class with a meaning only from a **vote** of that class at most `reach` rows *and* at most `reach` columns away.
#
# A cell can break rules 2 and 3.


# %% nbgrader={"grade": false, "grade_id": "audit", "locked": false, "schema_version": 3, "solution": true, "task": false}
def audit(votes, unseen, made, reach):
    """Return how many cells break each of three rules."""
    ### BEGIN SOLUTION
    given = (votes == 255) & (made < 10)
    square = np.ones((2 * reach + 1, 2 * reach + 1), bool)
    far = 0
    for c in range(10):
        around = ndimage.binary_dilation(votes == c, square)
        far += (given & (made == c) & ~around).sum()
    return ((votes != 255) & (made != votes)).sum(), (given & unseen).sum(), far
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "audit-map", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _finished():
    """Return votes, what is unseen, and a finished map, (3, 6) each; the reach is 1."""
    votes, unseen = np.full((3, 6), 255), np.zeros((3, 6), bool)
    votes[0, 0], votes[0, 5], votes[2, 0] = ROAD, CAR, SIDEWALK
    unseen[0, 0] = unseen[1, 3] = unseen[1, 5] = unseen[2, 5] = True
    made = [
        [ROAD, ROAD, ROAD, 10, SIDEWALK, ROAD],  # (0, 2): too far; (0, 4): beside a car's vote; (0, 5): overruled
        [ROAD, SIDEWALK, 10, 13, CAR, CAR],  # (1, 5): unseen
        [SIDEWALK, SIDEWALK, 10, 10, VEGETATION, VEGETATION],  # no vote of vegetation anywhere; (2, 5): unseen too
    ]
    return votes, unseen, np.array(made)


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "audit-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_AUDIT_SLIPS = (  # rule, count: hint
    {0: "the vote of cell (0, 5), CAR, has become ROAD", 16: "a cell without a vote can't break it: leave 255 out"},
    {
        3: "unseen are also a cell that has a vote and one that is unknown in the finished map: neither breaks the rule",
        4: "unseen are also a cell that has a vote and one that is unknown in the finished map: neither breaks the rule",
        0: "cells (1, 5) and (2, 5) are unseen and got a class",
    },
    {
        0: "a label doesn't vouch for itself: look for votes, not for labels of the finished map",
        1: "labels of the finished map don't vouch for others: look for votes",
        2: "labels of the finished map don't vouch for others: look for votes",
        3: "cell (0, 4) became SIDEWALK beside a vote of CAR: a vote of the same class is needed. Or did you leave out cell (2, 5), which breaks two rules?",
        5: "cell (0, 5) has a vote: rule 3 is about cells without one",
        6: "cells (1, 1) and (1, 4) have a vote one row and one column away: that is within the reach",
        7: "cells (1, 1) and (1, 4) have a vote one row and one column away, and (0, 5) has its own vote",
    },
)


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "audit-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    votes, unseen, made = _finished()
    got = answer_array(audit(votes, unseen, made, 1), "audit")
    assert np.array_equal(votes, _finished()[0]), "audit changed its argument `votes`: work on a copy"
    assert np.array_equal(made, _finished()[2]), "audit changed its argument `made`: work on a copy"
    assert got.shape == (3,), f"expected three numbers, one for each rule, got shape {got.shape}"
    for n, slips in enumerate(_AUDIT_SLIPS):
        hint = slips.get(int(got[n]))
        assert not hint, f"rule {n + 1}, {got[n]:g} cells: {hint}"
    np.testing.assert_array_equal(got, [1, 2, 4], err_msg="cells that break rules 1, 2 and 3, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_audit(audit)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: what your rule changes in a map (3 points)
#
# Does the rule of task 1 make a better truth? Complete `labels_and_wrong`: it makes a map from one frame without the returns that `open_to_view(uv, Z, reach, gap)` calls hidden, and returns two numbers:
#
# - how many cells have a label (a class from 0 to 9);
# - in how many of these another class stands. `frame.labels.birdseye_on(spec)`, `(H, W)`, knows what stands in each cell.
#
# `in_view(frame)`, in the first cell, gives the returns in view, their pixels and depths. `replace(frame, points=...)` makes a frame with other points (its rows keep all four columns). The map is
# `lidar_truth(frame, o, spec, TruthPolicy(cleanup="none"))`, so that you see votes alone.
#
# The tests hand over a rule of their own as `rule`; unless they do, it is yours.


# %% nbgrader={"grade": false, "grade_id": "labels-and-wrong", "locked": false, "schema_version": 3, "solution": true, "task": false}
def labels_and_wrong(frame, o, spec, reach, gap, rule=open_to_view):
    """Return the number of labelled cells, and in how many of them something else stands."""
    ### BEGIN SOLUTION
    numbers, uv, Z = in_view(frame)
    kept = numbers[rule(uv, Z, reach, gap)]
    made = lidar_truth(replace(frame, points=frame.points[kept]), o, spec, TruthPolicy(cleanup="none"))
    labelled = made < 10
    return labelled.sum(), (labelled & (made != frame.labels.birdseye_on(spec))).sum()
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "labels-and-wrong-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    frame, spec = sample_drive()[10], GridSpec.compact()
    o = np.zeros((4, *spec.shape))
    o[FREE] = 1

    def all_open(uv, Z, reach, gap):
        return np.ones(len(Z), bool)

    def half(uv, Z, reach, gap):  # says of a return what depends on all that it is given
        return (uv[:, 0] + 2 * uv[:, 1] + np.floor(Z).astype(int)) % 5 < reach + gap

    usual = lidar_truth(frame, o, spec, TruthPolicy(cleanup="none"))
    wrong = ((usual < 10) & (usual != frame.labels.birdseye_on(spec))).sum()
    got = answer_array(labels_and_wrong(frame, o, spec, 4, 0.5, all_open), "labels_and_wrong")
    assert got.shape == (2,), f"expected two numbers, labelled cells and wrong ones, got shape {got.shape}"
    right = "that is the number of right labels: count those in whose cell another class stands"
    assert got[1] != (usual < 10).sum() - wrong or got[1] == wrong, right
    cleaned = lidar_truth(frame, o, spec)
    assert got[0] != (cleaned < 10).sum(), 'the clean-up is in your map: hand over TruthPolicy(cleanup="none")'
    assert got[0] != usual.size, "every cell counts as labelled: 10 to 13 are no labels"
    assert got[0] == (usual < 10).sum(), "a rule that hides nothing must leave the number of labels as it is"
    assert got[1] == wrong, "a rule that hides nothing must leave the number of wrong labels as it is"
    fewer = answer_array(labels_and_wrong(frame, o, spec, 2, 0.5, half), "labels_and_wrong")
    assert fewer[0] < got[0], "a rule that hides many returns must leave fewer labels: do you use `rule`?"
    other = answer_array(labels_and_wrong(frame, o, spec, 4, 0.5, half), "labels_and_wrong")
    assert not np.array_equal(other, fewer), "another reach changes nothing: hand `reach` and `gap` over to the rule"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_labels_and_wrong(labels_and_wrong)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: what a wrong label costs (2 points)
#
# A rule that removes wrong labels removes right ones, too. Its **price** is the number of right labels that are lost for each wrong one that is removed. Is that cheap? Compare it with a rule that knows nothing: if labels
# are removed at random, each wrong one costs as many right ones as there are right ones for each wrong one.
#
# You are given the counts of task 4, labels and wrong labels: `before`, two numbers, without any rule, and `after`, `(R, 2)`, with R different reaches. Complete `prices`: it returns an array `(R,)` with the price of each reach, NaN
# where no wrong label was removed, and then one number, the price of removing at random.


# %% nbgrader={"grade": false, "grade_id": "prices", "locked": false, "schema_version": 3, "solution": true, "task": false}
def prices(before, after):
    """Return right labels lost for each wrong one removed, (R,), and that of removing at random, a number."""
    ### BEGIN SOLUTION
    (labels, wrong), after = before, np.asarray(after)
    removed = wrong - after[:, 1]
    lost = (labels - wrong) - (after[:, 0] - after[:, 1])
    price = np.full(len(after), np.nan)
    some = removed > 0
    price[some] = lost[some] / removed[some]
    return price, (labels - wrong) / wrong
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "prices-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_PRICE_SLIPS = {
    3.0: "you divide the labels that are lost, wrong ones included: count the right ones alone",
    0.5: "upside down: right labels lost, divided by wrong ones removed",
    6.0: "those are the right labels that are left for each wrong one that is left",
    0.2: "that is the share of all right labels that is lost",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "prices-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: 1000 labels, 200 wrong, so 800 right and a price of 4 at random. 760 and 120: 80 wrong ones removed, 160 right ones lost.
    before, after = np.array([1000, 200]), np.array([[1000, 200], [760, 120], [400, 50]])
    given = after.copy()
    got = prices(before.copy(), given)
    assert np.array_equal(given, after), "prices changed its argument `after`: work on a copy"
    assert isinstance(got, (tuple, list)), "return two things: an array, and a number"
    assert len(got) == 2, f"return two things, an array and a number; got {len(got)}"
    price, chance = answer_array(got[0], "prices"), answer_array(got[1], "price at random")
    assert price.shape == (3,), f"expected one price for each of 3 reaches, got shape {price.shape}"
    assert np.isnan(price[0]), "no wrong label was removed with the first reach: its price is NaN"
    for slip, hint in _PRICE_SLIPS.items():
        assert not np.isclose(price[1], slip), f"price {price[1]:.4f}: {hint}"
    np.testing.assert_allclose(price[1:], [160 / 80, 450 / 150], err_msg="prices, by hand")
    assert chance.size == 1, f"the price at random is one number, got shape {chance.shape}"
    assert not np.isclose(chance, 0.25), "at random: right labels for each wrong one, not the other way round"
    assert not np.isclose(chance, 5), "at random: a wrong label isn't a right one that is lost"
    np.testing.assert_allclose(chance, 4, err_msg="the price of removing at random, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_prices(prices)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# When the test has passed, ask your rule: what is its price on `sample_drive()[10]` with a reach of 0, 2 and 4 pixels and a gap of 0.5 m? Is it cheaper than chance? And how many right labels does it leave: would you use it? As occupancy take `o = np.zeros((4, *GridSpec.compact().shape)); o[FREE] = 1`; it only names the unknown cells. Why is there no price for a reach of 0?
#
# Then try a gap of 2 m with a reach of 2. Which right labels did the narrow gap cost? (How far apart in depth are two rows of far road?)
#
# ## Task 6: in your own words (2 points)
#
# A colleague has made a ground truth from 19 scans with moving things *carried*, and reports: "Against the one-scan truth, twice as many cells are labelled, and where both have a label, 95 % agree. So the new
# truth is better." Which two things does this comparison not tell? What could be wrong in *both* truths so that they agree? And what would you measure, on real data without a simulator, to find out? Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "agreement", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The comparison doesn't tell whether the *new* labels, in cells that the one-scan truth leaves open, are right: they are not in the 95 %. Nor does it tell whether the labels on which both agree are right. Both are made from the
# same image labels with the same calibration, so both have the same error of calibration (a shared error isn't outvoted), and in both hidden returns take the label of what hides them. (The filter that says what moves, and how fast, errs as well, but
# only the carried truth uses its velocities.) To find out one needs a witness that doesn't share these errors: a sample of cells labelled by people in the LIDAR points themselves (as in SemanticKITTI), the calibration measured again with a target, or the same place
# seen on another day. For moving things: how far is a carried car, scan by scan, from where the scan of now has it? One point for the two gaps, one for a shared error and a measurement that doesn't share it.

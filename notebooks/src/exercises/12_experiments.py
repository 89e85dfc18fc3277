# %% [markdown]
# # Exercise 12: the experiments
#
# Four functions with which you can judge a claim from confusion matrices, and one question to answer in words. About 75 minutes.
# The lecture is [12: the experiments](../12_experiments.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | frames pooled into drives, and class accuracy | 2 |
# | 2 | which statements to reject | 2 |
# | 3 | drives that share a town | 3 |
# | 4 | the share of errors that is saved, paired | 2 |
# | 5 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong; the folded cell shows slips, so open it last. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np
from scipy import stats  # stats.t.ppf(p, df) is the p-quantile of Student's distribution with df degrees of freedom

from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_edu.metrics import pixel_accuracy  # the tests of tasks 3 and 4 use it

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does


def _explain(what, got, slips, atol):
    """Stop with a hint when `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=atol), f"{what} {got:.4f}: {hint}"


def _three(result, name):
    """Return the three numbers of an interval."""
    numbers = answer_array(result, name)
    assert numbers.size == 3, f"{name} must return three numbers: low, what is in the middle, high"
    return numbers.ravel()


# %% [markdown]
# ## Task 1: frames pooled into drives (2 points)
#
# `counts` holds one confusion matrix per frame, `(F, C, C)`: row truth, column prediction. `drives` is a list of F names, the drive of each frame. Frames of a drive
# aren't always neighbours in the list.
#
# Complete `drive_scores`: it returns a dictionary that gives for each drive its class accuracy. First the matrices of its frames are *summed*, then the metric is
# taken: the mean over classes of the share of the class's cells that are called right. But three cells say little about a class. So a class with fewer than `least` true
# cells in the drive (all its frames together) is left out of the mean; each drive has a class with at least `least`. `least` is at least 1.


# %% nbgrader={"grade": false, "grade_id": "drive-scores", "locked": false, "schema_version": 3, "solution": true, "task": false}
def drive_scores(counts, drives, least=1):
    """Return the class accuracy of each drive, by its name."""
    ### BEGIN SOLUTION
    scores = {}
    for drive in dict.fromkeys(drives):
        total = sum(matrix for matrix, name in zip(counts, drives, strict=True) if name == drive)
        cells = total.sum(axis=1)
        scores[drive] = float(np.mean(np.diag(total)[cells >= least] / cells[cells >= least]))
    return scores
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "drive-scores-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    counts, drives = np.array([[[8, 2], [0, 0]], [[6, 2], [0, 0]], [[1, 9], [2, 2]]]), ["a", "b", "a"]
    got = drive_scores(counts.copy(), list(drives))  # by hand, drive a: [[9, 11], [2, 2]], so (9/20 + 2/4) / 2 = 0.475
    assert got is not None, "drive_scores returned nothing: did you forget `return`?"
    assert isinstance(got, dict), f"return a dictionary, a score by each drive's name, not {type(got).__name__}"
    assert set(got) == {"a", "b"}, f"expected the drives a and b, got {list(got)}"
    a, b = (answer_number(got[drive], f"drive_scores, for drive {drive},") for drive in ("a", "b"))
    slips = {
        0.5500: "you average the scores of its frames: sum the matrices first, then take the metric once",
        0.4583: "that is pixel accuracy: all right cells over all cells. Take a mean over classes",
        0.4860: "you divide by the columns: cells *called* a class. Divide by the rows, the cells that *are* of the class",
        0.8000: "only one frame of drive a counts: its frames aren't neighbours in the list",
        0.3000: "only the last frame of drive a counts: add the matrices, don't overwrite",
        0.5179: "all drives are summed: keep them apart",
    }
    _explain("drive a:", a, slips, 1e-3)
    assert np.isclose(a, 0.475), f"drive a: {a:.4f}, by hand 0.475"
    as_zero = "a class without true cells is left out of the mean, it doesn't count as 0"
    _explain("drive b:", b, {0.375: as_zero, 0.875: as_zero.replace("as 0", "as 1")}, 1e-3)
    assert not np.isnan(b), "drive b: not a number: you divide by the 0 cells of a class that doesn't occur"
    assert np.isclose(b, 0.75), f"drive b: {b:.4f}, by hand 6/8 = 0.75"
    few, enough = (answer_number(drive_scores(counts.copy(), drives, least)["a"], "a score") for least in (5, 4))
    assert not np.isclose(few, 0.475), "drive a has 4 cells of the second class, fewer than 5: leave it out of the mean"
    assert np.isclose(few, 0.45), f"drive a, least=5: {few:.4f}, by hand 9/20 = 0.45"
    assert np.isclose(enough, 0.475), f"drive a, least=4: {enough:.4f}; 4 cells aren't fewer than 4, so 0.475"
    split = np.array([[[3, 1], [0, 3]], [[4, 0], [1, 1]]])  # one drive, whose second class has 3 + 2 cells
    both = answer_number(drive_scores(split, ["c", "c"], 4)["c"], "a score")
    assert not np.isclose(both, 0.875), "count a class's cells in all frames of the drive: 3 + 2 is more than 4"
    assert np.isclose(both, 0.8375), f"drive c, least=4: {both:.4f}, by hand (7/8 + 4/5) / 2 = 0.8375"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import experiments

    complaint = experiments.check_drive_scores(drive_scores)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: which statements to reject (2 points)
#
# `p_values` holds the p-value of each statement of a claim, in the claim's own order. Holm's correction, named in the lecture, goes from the smallest p-value upwards and stops at the first that isn't rejected. **Hochberg's** goes
# downwards, with the same limits. It rejects at least as many, and is as safe where statements are independent. Holm's rejects none when Bonferroni's rejects none; Hochberg's still may, so it can change a verdict. Sort them, *largest* p-value first. If the first is at most level, reject all of them. Otherwise it stays; if the second is at
# most level / 2, reject this one **and all smaller ones**. Otherwise it stays as well; then comes the third, against level / 3, and so on.
#
# Complete `hochberg`: it returns for each statement, in the order of `p_values`, whether Hochberg's correction rejects it.


# %% nbgrader={"grade": false, "grade_id": "hochberg", "locked": false, "schema_version": 3, "solution": true, "task": false}
def hochberg(p_values, level=0.025):
    """Return which statements Hochberg's correction rejects."""
    ### BEGIN SOLUTION
    found, order = [False] * len(p_values), np.argsort(p_values)[::-1]
    for place, k in enumerate(order):
        if p_values[k] <= level / (place + 1):
            for smaller in order[place:]:
                found[smaller] = True
            break
    return found
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "hochberg-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    # Sorted: 0.03, 0.013, 0.008, 0.0065, 0.004, against 0.025, 0.0125, 0.00833, 0.00625, 0.005. The third is rejected, and those after it.
    p_values = [0.013, 0.004, 0.03, 0.008, 0.0065]
    got = answer_array(hochberg(list(p_values)), "hochberg").ravel()
    assert got.shape == (5,), f"five statements, five answers; got {got.size}"
    slips = {
        (1, 1, 0, 1, 1): "this is without a correction: each p-value is compared with the level itself",
        (
            0,
            1,
            0,
            0,
            0,
        ): "that is Holm's correction, or Bonferroni's: begin with the largest p-value, and let its limit be the level",
        (0, 1, 0, 1, 0): "0.0065 is above its own limit, but smaller than 0.008, which is rejected: so it is, too",
        (0, 0, 0, 1, 0): "with the first that is at most its limit, all smaller ones are rejected as well",
        (1, 1, 1, 0, 0): "answer in the order of `p_values`, not in sorted order",
        (1, 1, 1, 1, 1): "the largest, 0.03, comes first and is above the level: it stays",
        (0, 0, 0, 0, 0): "0.008, the third of the largest, is at most 0.025 / 3: it is rejected",
    }
    found = tuple(got.astype(bool).astype(int).tolist())
    assert found == (0, 1, 0, 1, 1), (
        f"got {found}: {slips.get(found, '0.008 and what is smaller is rejected; is the order that of p_values?')}"
    )
    got = answer_array(hochberg([0.012, 0.001, 0.02]), "hochberg").ravel().astype(bool).tolist()
    assert got == [True, True, True], f"0.02 is at most 0.025, so all three are rejected, got {got}"
    equal = answer_array(hochberg([0.05, 0.025], level=0.05), "hochberg").ravel().astype(bool).tolist()
    assert equal == [True, True], f"*at most*: a p-value equal to its limit is rejected, with level 0.05; got {equal}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import experiments

    complaint = experiments.check_hochberg(hochberg)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: drives that share a town (3 points)
#
# The lecture leaves out one drive at a time, because frames share a drive. Your drives were recorded in a few **towns**, and streets of one town look alike. So a drive has a parent, too: draw the graph. What must be left out now,
# one at a time?
#
# `matrices` are the confusion matrices of V drives, `(V, C, C)`, `towns` is a list of V names, the town of each drive, in any order; `metric` is a function of one matrix, such as `pixel_accuracy`, and `level` says how often
# the interval should contain the true value. With $\theta$ the metric of the sum of all matrices, $\theta_{-g}$ that of the sum without **all drives of town g**, $\bar\theta$ the mean of the $\theta_{-g}$, and $G$ towns,
#
# $$ \theta \pm t \sqrt{\frac{G - 1}{G} \sum_{g} \left( \theta_{-g} - \bar\theta \right)^2} $$
#
# where $t$ is the quantile of Student's distribution that leaves $(1 - \text{level})/2$ on *each* side. How many degrees of freedom does it have?
#
# Complete `town_interval`: it returns `low, score, high`.


# %% nbgrader={"grade": false, "grade_id": "towns", "locked": false, "schema_version": 3, "solution": true, "task": false}
def town_interval(matrices, towns, metric, level=0.95):
    """Return low, score, high."""
    ### BEGIN SOLUTION
    names, number = np.unique(towns, return_inverse=True)
    G, total = len(names), matrices.sum(axis=0)
    without = np.array([metric(matrices[number != g].sum(axis=0)) for g in range(G)])
    half = stats.t.ppf((1 + level) / 2, G - 1) * np.sqrt((G - 1) / G * ((without - without.mean()) ** 2).sum())
    return metric(total) - half, metric(total), metric(total) + half
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "towns-hints", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_HALF_WIDTHS = {
    0.1832: "you leave out one drive at a time: drives of a town look alike, so leave out a town",
    0.2249: "what is left out are towns, so Student's quantile has G - 1 degrees of freedom",
    0.1864: "1.96 is for very many drives; Student's quantile for 3 degrees of freedom is 3.18",
    0.0951: "that is the standard error. Multiply it by Student's quantile",
    0.2640: "Student's quantile has G - 1 degrees of freedom, not G",
    0.2238: "the quantile must leave 2.5 % on each side, so take the one of 0.975",
    0.1009: "you treat the scores without one town like independent scores. They differ little, so their squares are scaled *up*: see the formula",
    0.2017: "the variance of the scores without one town must be scaled up: see the formula",
    0.1747: "the mean of the squares isn't their sum: see the formula",
    0.3494: "the factor (G - 1) / G is missing",
    0.4035: "the factor is (G - 1) / G, not G / (G - 1)",
    0.2956: "you use the score of each town alone. Use the score of all drives *without* it",
    0.0288: "the root is missing",
    0.6052: "the factor is (G - 1) / G, not G - 1",
}


# %% nbgrader={"grade": true, "grade_id": "towns-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    # Four towns: 80 of 100, 150 of 200, 45 of 50 and 70 of 150 cells right. All: 345/500 = 0.69. Left out: 0.6625, 0.65, 0.6667, 0.7857.
    right = np.array([30, 100, 20, 40, 50, 50, 25, 30])
    cells = np.array([50, 120, 20, 80, 50, 80, 30, 70])
    matrices = np.stack([np.stack([right, cells - right], axis=1), np.zeros((8, 2), int)], axis=1)
    towns = ["Apt", "Bex", "Cluj", "Dax", "Apt", "Bex", "Cluj", "Dax"]
    low, score, high = _three(town_interval(matrices.copy(), list(towns), pixel_accuracy), "town_interval")
    middles = {
        0.7292: "that is the mean of the towns' scores. Sum the matrices first: a town with more cells counts for more",
        0.6912: "that is the mean of the scores without one town. The interval is around the score of *all* drives",
    }
    _explain("the score is", score, middles, 1e-4)
    assert np.isclose(score, 0.69, atol=1e-4), f"the score is {score:.4f}; by hand 345/500 = 0.69"
    half = (high - low) / 2
    _explain("it reaches to each side by", half, _HALF_WIDTHS, 4e-4)
    assert np.isclose(score - low, high - score), "the interval isn't symmetric around the score"
    assert np.isclose(half, 0.3026, atol=1e-3), f"it reaches {half:.4f} to each side; expected 0.3026"
    low, _, high = _three(town_interval(matrices.copy(), list(towns), pixel_accuracy, level=0.9), "town_interval")
    half = (high - low) / 2
    assert not np.isclose(half, 0.3026, atol=1e-3), "with level=0.9 the interval must be narrower: use `level`"
    assert np.isclose(half, 0.2238, atol=1e-3), f"with level=0.9 it reaches {half:.4f} to each side; expected 0.2238"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import experiments

    complaint = experiments.check_towns(town_interval)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: the share of errors that is saved (2 points)
#
# `a` and `b` are the confusion matrices of two methods on the **same** V drives, `(V, C, C)` each: `a[v]` and `b[v]` belong to the same drive. Two points of accuracy are little where a third is wrong,
# and much where a fortieth is. So take the share of b's errors that a saves,
#
# $$ \theta = \frac{\text{metric}(a) - \text{metric}(b)}{1 - \text{metric}(b)} $$
#
# of the summed matrices. Leave a drive out of *both* methods at once, and see what that does to $\theta$.
#
# Complete `paired_interval`: it returns `low, share, high`, by the lecture's jackknife, one drive left out at a time. (You may call your
# `town_interval`, whose mistakes cost nothing here, or write the formula again. Which towns, and what in place of the matrices, make it leave out both matrices of one drive?)


# %% nbgrader={"grade": false, "grade_id": "paired", "locked": false, "schema_version": 3, "solution": true, "task": false}
def paired_interval(a, b, metric, level=0.95):
    """Return low, share, high of the errors of b that a saves."""
    ### BEGIN SOLUTION
    V, of_a, of_b = len(a), a.sum(axis=0), b.sum(axis=0)

    def share(x, y):
        return (metric(x) - metric(y)) / (1 - metric(y))

    without = np.array([share(of_a - x, of_b - y) for x, y in zip(a, b, strict=True)])
    half = stats.t.ppf((1 + level) / 2, V - 1) * np.sqrt((V - 1) / V * ((without - without.mean()) ** 2).sum())
    return share(of_a, of_b) - half, share(of_a, of_b), share(of_a, of_b) + half
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "paired-data", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _of_cells(right, cells):
    """Return one matrix per drive, of cells that are called right and others."""
    return np.array([[[r, n - r], [0, 0]] for r, n in zip(right, cells, strict=True)])


def _by_own_jackknife(jackknife, a, b):
    """Return what the jackknife of task 3 gives for the share, be it right or not; NaN where it gives nothing."""

    def share(two):
        return (pixel_accuracy(two[0]) - pixel_accuracy(two[1])) / (1 - pixel_accuracy(two[1]))

    try:
        pairs = np.stack([a, b], axis=1)
        names = [f"drive {v}" for v in range(len(pairs))]
        return _three(jackknife(pairs, names, share), "it")
    except Exception:
        return np.full(3, np.nan)


# %% nbgrader={"grade": false, "grade_id": "paired-hints", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _explain_paired(low, share, high):
    """Stop with a hint when the share of saved errors, or its interval, is what a common slip gives."""
    assert share > 0, f"the share is {share:.4f}: a is better, and saves errors of b"
    middles = {
        0.0667: "that is the difference of the two accuracies: divide it by the errors of b, 1 - metric(b)",
        0.2542: "divide by the errors of b, not by those of a",
        0.0993: "divide by what b calls wrong, 1 - metric(b), not by what it calls right",
        0.7973: "that is the share of b's errors that a makes as well",
        0.2509: "that is the mean of the drives' shares. Sum the matrices first, as in task 3",
    }
    _explain("the share is", share, middles, 5e-4)
    assert low <= high, "low is above high: the ends of two separate intervals can't simply be subtracted"
    both = "leave the drive out of both methods, above and below the line"
    halves = {
        0.0570: "that is the interval of the difference: the share is another number",
        0.1733: "you divide the interval of the difference by the errors in all drives: " + both,
        0.6049: "you leave drives out of a alone: " + both,
        0.3801: "you leave drives out of b alone: " + both,
        0.7144: "that is the interval of two methods on *different* drives: on the same drives what they share cancels",
        0.3833: "you use each drive's own share. Use the share *without* the drive",
    }
    _explain("it reaches to each side by", (high - low) / 2, halves, 1e-3)


# %% nbgrader={"grade": true, "grade_id": "paired-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    a = _of_cells((92, 140, 40, 60), (100, 200, 50, 100))  # 118 of 450 wrong
    b = _of_cells((80, 126, 38, 58), (100, 200, 50, 100))  # 148 of 450 wrong, so a saves 30/148 = 0.2027
    got = _three(paired_interval(a.copy(), b.copy(), pixel_accuracy), "paired_interval")
    # By deviations from their mean, or from the share in all drives.
    wanted = [[-0.04005, 0.20270, 0.44545], [-0.04105, 0.20270, 0.44646]]
    if not any(np.allclose(got, one, rtol=0, atol=8e-4) for one in wanted):
        # What is wrong in your task 3 has cost its points there, and costs none here.
        own = _by_own_jackknife(town_interval, a, b)
        if not np.allclose(got, own) or got[0] == got[2]:
            _explain_paired(*got)
            right, half = np.isclose(got[1], 0.2027, atol=4e-4), (got[2] - got[0]) / 2
            assert right, f"the share is {got[1]:.4f}; by hand 30/148 = 0.2027"
            assert np.isclose(half, 0.24275, rtol=0, atol=8e-4), f"it reaches {half:.4f} to each side; expected 0.2428"
            assert np.allclose(got, wanted[0], rtol=0, atol=8e-4), "the interval isn't symmetric around the share"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import experiments

    complaint = experiments.check_paired(paired_interval, town_interval)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: in your own words (2 points)
#
# A colleague writes: "We tried eight variants. The best of them gains 1.2 points of class accuracy over the usual network: the 95 % interval over our 4000 test frames goes from 0.9 to
# 1.5. So our part is a clear improvement. Another part changed nothing (interval from -2 to 2), so it can be left out." You learn that the frames come from twelve drives, and
# that each variant was trained once. Name four things that are wrong with these conclusions, and say for each what you would do in its place. Give one number: with what probability does at least one of eight equal, independent variants get a 95 % interval that excludes zero? Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "four-things", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# (1) Frames of a drive aren't independent: the interval must be over the twelve drives, and will be much wider. (2) One seed: nothing is known of how training runs differ, so both networks
# must be trained with at least three seeds, the same for both, and the difference paired. (3) The best of eight on the test drives is partly luck: choose on validation drives and test the
# chosen one once, or correct the level for eight comparisons. (1 - 0.95^8 = 34 %.) (4) An interval from -2 to 2 doesn't show that nothing changed, only that up to two points couldn't be seen: state beforehand
# how large a loss is acceptable, and ask whether the interval lies above that. (Also welcome: a class in few drives may decide class accuracy; which drives were left out of training;
# the rule should have been written before the numbers.)
# Half a point for each of four, with what to do in its place: drives instead of frames, more seeds, the best of eight, no difference seen.

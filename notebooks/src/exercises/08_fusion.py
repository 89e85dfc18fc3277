# %% [markdown]
# # Exercise 08: reduction, fusion, training
#
# Six small functions that training is made of, and one question to answer in words. About 80 minutes.
# The lecture is [08: reduction, fusion, training end to end](../08_fusion.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | the 1x1 reduction | 2 |
# | 2 | its way back | 2 + 1 |
# | 3 | median frequency balancing | 2 + 1 |
# | 4 | a weighted loss | 3 + 1 |
# | 5 | one step with momentum, and its rate | 2 + 1 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.
#
# All of it is plain numpy: no network library is needed, and arguments are never changed.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
IGNORE = 255


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=1e-3), f"{what} {got:.4g}: {hint}"


# %% [markdown]
# ## Task 1: the 1x1 reduction (2 points)
#
# `planes` holds the scores $p$ of C classes on D planes, `(C, D, H, W)`. `theta` holds a weight for each reduced map, class and plane, `(K, C, D)`, `beta` a
# bias for each reduced map, `(K,)`. In every cell $j$ alike
#
# $$ \tilde p_{k,j} = \beta_k + \sum_c \sum_d \theta_{k,c,d}\; p_{c,d,j} $$
#
# Complete `reduce_planes`: it returns the reduced maps, `(K, H, W)`, before any normalisation or ReLU.


# %% nbgrader={"grade": false, "grade_id": "reduce-planes", "locked": false, "schema_version": 3, "solution": true, "task": false}
def reduce_planes(planes, theta, beta):
    """Return K maps, each a weighted sum of all planes of all classes, (K, H, W)."""
    ### BEGIN SOLUTION
    return np.einsum("kcd,cdhw->khw", theta, planes) + beta[:, None, None]
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "reduction", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _reduction():
    """Return planes (2, 2, 1, 2), theta (2, 2, 2) and beta (2,): two classes, two planes, one row of two cells, two maps."""
    planes = np.array([[[[3.0, 1.0]], [[1.0, 0.0]]], [[[0.0, 4.0]], [[2.0, 2.0]]]])
    return planes, np.array([[[1.0, -1.0], [2.0, 0.5]], [[0.0, 1.0], [1.0, 1.0]]]), np.array([0.5, -4.0])


_REDUCED_SLIPS = {
    -1.5: "class and plane are swapped: theta is (K, C, D), planes (C, D, H, W), so theta[k, c, d] belongs to planes[c, d]",
    10.0: "the bias is missing: add beta[k], once",
    6.0: "your bias changes along the columns: beta[k] belongs to map k, to all cells of it",
    12.0: "the bias is added with every term: add beta[k] once, after the sum",
    11.0: "the bias is added with every plane or class: add beta[k] once, after the sum",
    3.0: "that is a mean over classes and planes: take the sum, the weights know how much each counts",
    8.5: "that is the largest term: the sum of all four is asked for",
    9.5: "that is the ground plane alone: sum over d as well",
    1.5: "that is the first class alone: sum over c as well",
    7.5: "the weights are missing: multiply each plane by its theta before you sum",
    2.774: "you apply a soft-max over classes: planes hold scores, and they stay scores",
    2.783: "you apply a soft-max over planes: planes hold scores, and they stay scores",
}


# %% nbgrader={"grade": true, "grade_id": "reduce-planes-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand, map 0 in the second cell: 0.5 + 1 * 1 - 1 * 0 + 2 * 4 + 0.5 * 2 = 10.5.
    got = answer_array(reduce_planes(*_reduction()), "reduce_planes")
    assert got.shape == (2, 1, 2), f"expected K maps of one row and two columns, (2, 1, 2), got {got.shape}"
    _explain("map 0, second cell:", got[0, 0, 1], _REDUCED_SLIPS)
    assert not np.isclose(got[1, 0, 0], 0), "map 1, first cell is 0 where -1 is right: the ReLU comes later"
    np.testing.assert_allclose(got, [[[3.5, 10.5]], [[-1, 2]]], err_msg="the four sums, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_reduce_planes(reduce_planes)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: its way back (2 + 1 points)
#
# Training asks for the derivative of the loss by everything that went into the reduction. What comes from behind is `blamed`, `(K, H, W)`: the derivative
# by each reduced map in each cell. Since each $\tilde p_{k,j}$ is a sum, its derivatives can be read off the formula of task 1; what was used in many
# places gets the sum of what comes from all of them.
#
# Complete `reduce_back`: it returns three arrays, the derivatives of the loss by `theta`, `(K, C, D)`, by `beta`, `(K,)`, and by `planes`, `(C, D, H, W)`.


# %% nbgrader={"grade": false, "grade_id": "reduce-back", "locked": false, "schema_version": 3, "solution": true, "task": false}
def reduce_back(planes, theta, blamed):
    """Return the derivatives by theta (K, C, D), by beta (K,) and by the planes (C, D, H, W)."""
    ### BEGIN SOLUTION
    theta_bar = np.einsum("khw,cdhw->kcd", blamed, planes)
    planes_bar = np.einsum("kcd,khw->cdhw", theta, blamed)
    return theta_bar, blamed.sum(axis=(1, 2)), planes_bar
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "theta-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_THETA_SLIPS = {
    2.5: "that is the mean over cells: a weight that is used in every cell gets the sum",
    4.0: "blame is lost: sum planes times blamed over cells, not each by itself",
    6.0: "that is the first cell alone: the weight is used in every cell, so sum over them",
    8.0: "you sum over the reduced maps too: theta[k] is used in map k alone",
    1.0: "that is theta itself: the derivative of theta * p by theta is p",
}


# %% nbgrader={"grade": true, "grade_id": "theta-bar-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # The planes of task 1. By hand, theta[0, 0, 0] was multiplied by 3 in the first cell and by 1 in the second: 2 * 3 - 1 * 1 = 5.
    planes, theta, _ = _reduction()
    got = reduce_back(planes, theta, np.array([[[2.0, -1.0]], [[0.0, 3.0]]]))
    assert got is not None, "reduce_back returned nothing: did you forget `return`?"
    assert np.iterable(got), "return three arrays: by theta, by beta, by the planes"
    assert len(got) >= 2, "return three arrays: by theta, by beta, by the planes"
    theta_bar, beta_bar = answer_array(got[0], "by theta reduce_back"), answer_array(got[1], "by beta reduce_back")
    assert theta_bar.shape == (2, 2, 2), f"by theta: one number a weight, shape (2, 2, 2), got {theta_bar.shape}"
    assert beta_bar.shape == (2,), f"by beta: one number a map, (K,) = (2,), got {beta_bar.shape}"
    _explain("by theta[0, 0, 0]:", theta_bar[0, 0, 0], _THETA_SLIPS)
    by_hand = [[[5, 2], [-4, 2]], [[3, 0], [12, 6]]]
    swapped = np.allclose(theta_bar, np.swapaxes(by_hand, 1, 2))
    assert not swapped, "class and plane are swapped in the derivative with respect to theta"
    np.testing.assert_allclose(theta_bar, by_hand, err_msg="by theta: sum over cells of planes[c, d] * blamed[k]")
    assert not np.allclose(beta_bar, [0.5, 1.5]), "by beta: that is the mean over cells, take the sum"
    assert not np.allclose(beta_bar, 1), "by beta: 1 is that of a map by its bias; multiply by what comes from behind"
    np.testing.assert_allclose(beta_bar, [1, 3], err_msg="by beta: the sum over cells of blamed[k]")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_theta_bar(reduce_back)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "planes-bar-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand, the score of class 1 on plane 0 in the second cell went into map 0 by 2 and into map 1 by 1: 2 * -1 + 1 * 3 = 1.
    planes, theta, _ = _reduction()
    got = reduce_back(planes, theta, np.array([[[2.0, -1.0]], [[0.0, 3.0]]]))
    assert np.iterable(got), "return three arrays: by theta, by beta, by the planes"
    assert len(got) == 3, "return three arrays: by theta, by beta, by the planes"
    got = answer_array(got[2], "by planes reduce_back")
    assert got.shape == (2, 2, 1, 2), f"by planes: one number a score, (C, D, H, W) = (2, 2, 1, 2), got {got.shape}"
    slips = {
        -2.0: "that is the blame of map 0 alone: a score went into all K maps, so sum over k",
        3.0: "that is the blame of map 1 alone: a score went into all K maps, so sum over k",
        0.5: "that is the mean over maps: sum over k",
        2.0: "the weights are missing: what comes from behind goes back by the weight by which the score went in",
        4.0: "class and plane are swapped: theta[k, c, d] belongs to planes[c, d]",
    }
    _explain("class 1, plane 0, second cell:", got[1, 0, 0, 1], slips)
    by_hand = [[[[2, -1]], [[-2, 4]]], [[[4, 1]], [[1, 2.5]]]]
    np.testing.assert_allclose(got, by_hand, err_msg="by planes: sum over k of theta[k, c, d] * blamed[k]")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_planes_bar(reduce_back)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: median frequency balancing (2 + 1 points)
#
# `maps` is a list of maps of classes, integer arrays that may differ in size. The number 255 means unlabelled: such a cell counts nowhere, neither above
# nor below.
#
# $$ f(c) = \frac{\text{cells of } c \text{ in all maps}}{\text{labelled cells of the maps in which } c \text{ occurs}}, \qquad
#    \alpha_c = \frac{\operatorname{median}_{c'} f(c')}{f(c)} $$
#
# Complete `balance`: it returns the weights, `(n_classes,)`. For one more point: a class that occurs in no map gets the weight 0, and has no part in the
# median.


# %% nbgrader={"grade": false, "grade_id": "balance", "locked": false, "schema_version": 3, "solution": true, "task": false}
def balance(maps, n_classes):
    """Return the weight of each class, (n_classes,)."""
    ### BEGIN SOLUTION
    f = np.zeros(n_classes)
    for c in range(n_classes):
        where = [m for m in maps if (m == c).any()]
        if where:
            f[c] = sum((m == c).sum() for m in where) / sum((m != IGNORE).sum() for m in where)
    alpha = np.zeros(n_classes)
    alpha[f > 0] = np.median(f[f > 0]) / f[f > 0]
    return alpha
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "class-maps", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _maps():
    """Return two maps of classes, one with 8 labelled cells, one with 10."""
    first = np.array([[0, 0, 0, 0], [0, 0, 1, 1], [255, 255, 255, 255]])
    return [first, np.array([[0, 0, 0, 0], [2, 2, 2, 2], [2, 3, 255, 255]])]


# %% nbgrader={"grade": true, "grade_id": "balance-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: f = 10/18, 2/8, 5/10, 1/10, their median 0.375.
    got = answer_array(balance(_maps(), n_classes=4), "balance")
    assert got.shape == (4,), f"expected one weight a class, shape (4,), got {got.shape}"
    slips = {
        0.350: "every class is counted over all maps: below stand the cells of the maps in which it occurs",
        0.700: "unlabelled cells are counted below: only labelled ones are",
        0.632: "that is the mean of the frequencies over f: take their median",
        0.652: "you average the frequencies of the maps: count the cells of all maps first, then divide once",
        1.481: "that is f / median: what is frequent must weigh less",
        1.800: "that is 1 / f: the median stands above",
        0.556: "that is the frequency f itself: the weight is median / f",
        0.900: "of an even number of frequencies the median is the mean of the two in the middle, you take the upper one",
        0.450: "of an even number of frequencies the median is the mean of the two in the middle, you take the lower one",
    }
    _explain("class 0 weighs", got[0], slips)
    np.testing.assert_allclose(got, [0.675, 1.5, 0.75, 3.75], err_msg="0.375 over 10/18, 2/8, 5/10, 1/10")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_balance(balance)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "absent-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    before = answer_array(balance(_maps(), n_classes=4), "balance")
    got = answer_array(balance(_maps(), n_classes=5), "balance")  # no cell is of class 4
    assert np.isfinite(got).all(), f"the weights are {got}: class 4 doesn't occur, so don't divide by its frequency"
    assert got.shape == (5,), f"expected one weight a class, shape (5,), got {got.shape}"
    pulled = f"class 0 weighs {got[0]:.3g} in place of {before[0]:.3g}: absent class 4 pulls the median down, leave it out there"
    assert np.isclose(got[0], before[0]), pulled
    assert got[4] == 0, f"class 4 doesn't occur, so its weight is 0, got {got[4]:g}"
    assert got.any(), "all weights are 0: those of classes that occur aren't"
    np.testing.assert_allclose(got[:4], before, err_msg="the others weigh as much as without class 4")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_absent(balance)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: a weighted loss (3 + 1 points)
#
# `logits` are what the network gives, `(C, H, W)`; a soft-max over the classes turns them into probabilities $g_{c,j}$. `truth` is `(H, W)`, with 255 where a
# cell isn't labelled; `alpha` holds the weights of the classes, `(C,)`. With $c(j)$ the true class of cell $j$, and the sums over labelled cells,
#
# $$ \text{loss} = -\frac{\sum_j \alpha_{c(j)} \log g_{c(j),j}}{\sum_j \alpha_{c(j)}} $$
#
# Complete `weighted_loss`: it returns one number. For one more point: logits may be 1000 or -1000, where $e^{1000}$ is more than a computer holds and $e^{-1000}$ less, and the
# true class may trail by as much. You may add any number to all logits of a cell without changing its soft-max.


# %% nbgrader={"grade": false, "grade_id": "weighted-loss", "locked": false, "schema_version": 3, "solution": true, "task": false}
def weighted_loss(logits, truth, alpha):
    """Return the weighted cross-entropy of one map over its labelled cells."""
    ### BEGIN SOLUTION
    shifted = logits - logits.max(axis=0)
    log_g = shifted - np.log(np.exp(shifted).sum(axis=0))
    labelled = truth != IGNORE
    true = truth[labelled]
    of_truth = log_g[:, labelled][true, np.arange(true.size)]
    return -(alpha[true] * of_truth).sum() / alpha[true].sum()
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "loss-cells", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _cells():
    """Return logits (2, 1, 3), truth (1, 3) and alpha (2,). Soft-max by hand: (1/2, 1/2), (3/4, 1/4) and an unlabelled cell."""
    logits = np.array([[[0.0, np.log(3), 2.0]], [[0.0, 0.0, 0.0]]])
    return logits, np.array([[0, 1, IGNORE]]), np.array([1.0, 3.0])


_LOSS_SLIPS = {
    2.426: "you divide by the number of cells: divide by the sum of their weights",
    1.617: "you divide by the number of cells, unlabelled ones too: divide by the sum of the weights of labelled ones",
    1.040: "the weights are missing, or cancel: each cell counts by the alpha of its true class",
    4.852: "that is the sum: divide it by the sum of the weights",
    -1.213: "the sign is swapped: log of a probability is negative, a loss positive",
    0.527: "that is the logarithm to base 10: take the natural one",
    0.693: "the unlabelled cell is counted below",
    0.996: "you count the unlabelled cell as class 0: 255 means that nobody knows",
    1.605: "you count the unlabelled cell as the last class: 255 means that nobody knows",
    0.970: "the unlabelled cell weighs below as class 0: leave it out there too",
    0.904: "that is the soft-max of a soft-max: once is enough",
    0.3125: "that is the mean probability of the truth: take its logarithm",
    1.432: "your soft-max runs along the row of cells: it is over the classes, axis 0",
    2.666: "your soft-max runs over all numbers at once: each cell has its own, over the classes, axis 0",
    0.0: "there is no soft-max, or it runs down the rows of the map: it is over the classes, axis 0",
}


# %% nbgrader={"grade": true, "grade_id": "weighted-loss-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand, truth 0 and 1: (1 * log 2 + 3 * log 4) / (1 + 3) = 1.213.
    got = answer_array(weighted_loss(*_cells()), "weighted_loss")
    assert got.size == 1, f"expected one number, got an array of shape {got.shape}"
    _explain("the loss is", got.item(), _LOSS_SLIPS)
    np.testing.assert_allclose(got, 1.213, atol=1e-3, err_msg="(1 * log 2 + 3 * log 4) / 4")
    logits, _, alpha = _cells()
    got = answer_array(weighted_loss(logits, np.array([[0, IGNORE, IGNORE]]), alpha), "weighted_loss")
    hint = "with the first cell alone labelled it is 1 * log 2 / 1; 0.173: you divide by the weights of all classes"
    np.testing.assert_allclose(got, 0.693, atol=1e-3, err_msg=hint)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_weighted_loss(weighted_loss)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "large-logits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    def loss(*logits, truth=(0,)):
        """Return the answer's loss for a row of cells: the logits of class 0, then those of class 1."""
        got = weighted_loss(np.array(logits, float)[:, None], np.array([truth]), np.array([1.0, 3.0]))
        return answer_array(got, "weighted_loss").mean()

    got = loss([1000, -1000], [1000 + np.log(3), -1000], truth=(0, 1))
    small = loss([0, 0], [np.log(3), 0], truth=(0, 1))  # the same soft-max, (1/4, 3/4) and (1/2, 1/2)
    assert np.isfinite(got), (
        f"the loss is {got}: e^1000 overflows and e^-1000 vanishes; subtract the largest logit of each cell first"
    )
    hint = "if you added a small number against log 0, or subtracted one number from all cells, don't: subtract each cell's largest"
    np.testing.assert_allclose(got, small, atol=1e-6, err_msg=f"logits of 1000 and -1000 against 0; {hint}")
    got, half = loss([-1000], [0]), loss([-500], [0])
    assert np.isfinite(got), (
        f"the loss is {got}: a truth that trails by 1000 costs 1000; keep log g, g itself is 0 here"
    )
    cut = "a truth that trails by 1000 must cost twice as much as by 500: don't add a small number against log 0"
    assert abs(got) > 100, f"the loss is {got:.4g}; {cut}"
    np.testing.assert_allclose(got, 2 * half, rtol=1e-3, err_msg=cut)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_large_logits(weighted_loss)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: one step with momentum, and its rate (2 + 1 points)
#
# $$ \Delta \leftarrow \kappa\,\Delta + \frac{\partial\,\text{loss}}{\partial \theta}, \qquad
#    \theta \leftarrow \theta - \eta\,\Delta $$
#
# Complete `momentum_step`: it takes parameters `theta`, the last `delta` and the new `gradient`, arrays of one shape, the rate `eta` and the momentum `kappa`,
# and returns the new `theta` and the new `delta`, without changing its arguments.


# %% nbgrader={"grade": false, "grade_id": "momentum-step", "locked": false, "schema_version": 3, "solution": true, "task": false}
def momentum_step(theta, delta, gradient, eta, kappa):
    """Return theta and delta after one step of gradient descent with momentum."""
    ### BEGIN SOLUTION
    delta = kappa * delta + gradient
    return theta - eta * delta, delta
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "momentum-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_STEP_SLIPS = {
    1.130: "the step goes uphill: theta - eta * delta",
    0.906: "the gradient is damped by 1 - kappa: add it whole",
    0.902: "the rate counts twice: delta has none, only the step has",
    0.510: "the rate stands inside delta: when the rate falls, old gradients would keep their old, larger one",
    0.843: "that is Nesterov's momentum: step by delta as it is after its update",
    0.900: "you step by the old delta: update it first",
    0.960: "that is plain descent: step by delta, not by the gradient",
    0.874: "kappa damps the new gradient too: only the old delta fades",
    0.650: "that is delta: return theta first",
    0.730: "eta and kappa are swapped: eta is the rate of the step, kappa what is left of the old delta",
    0.860: "the old delta doesn't fade: multiply it by kappa",
    0.950: "the gradient is subtracted from delta and delta from theta: two minus signs go uphill",
}


# %% nbgrader={"grade": true, "grade_id": "momentum-step-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    theta, delta, gradient = np.array([1.0, 2.0]), np.array([0.5, -1.0]), np.array([0.2, 0.4])
    got = momentum_step(theta, delta, gradient, eta=0.2, kappa=0.9)
    assert got is not None, "momentum_step returned nothing: did you forget `return`?"
    assert np.iterable(got), "return two arrays: the new theta and the new delta"
    assert len(got) == 2, "return two arrays: the new theta and the new delta"
    assert np.array_equal(theta, [1, 2]), "momentum_step changed its argument `theta`: make a new array (no -=)"
    same = np.array_equal(delta, [0.5, -1])
    assert same, "momentum_step changed its argument `delta`: make a new array (no *= or +=)"
    new_theta, new_delta = (
        answer_array(got[0], "for theta momentum_step"),
        answer_array(got[1], "for delta momentum_step"),
    )
    assert new_theta.shape == (2,), f"theta has two parameters, and became {new_theta.shape}"
    _explain("the first parameter is", new_theta[0], _STEP_SLIPS)
    np.testing.assert_allclose(new_theta, [0.87, 2.1], err_msg="theta by hand: 1 - 0.2 * 0.65, 2 + 0.2 * 0.5")
    assert not np.allclose(new_delta, [0.13, -0.1]), "delta is returned with the rate in it: give back delta itself"
    np.testing.assert_allclose(new_delta, [0.65, -0.5], err_msg="delta by hand: 0.45 + 0.2, -0.9 + 0.4")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_momentum_step(momentum_step)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# Complete `cosine_rate`: in training step `step` of `steps`, the first being 0, it returns `eta` times a factor that falls from 1 to 0 along half a cosine:
# 1 in step 0, 1/2 in the middle, and 0 if there were a step number `steps`.


# %% nbgrader={"grade": false, "grade_id": "cosine-rate", "locked": false, "schema_version": 3, "solution": true, "task": false}
def cosine_rate(eta, step, steps):
    """Return the rate in one step."""
    ### BEGIN SOLUTION
    return eta * (1 + np.cos(np.pi * step / steps)) / 2
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "cosine-rate-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: cos 72 degrees = 0.309, so 0.4 * (1 + 0.309) / 2 = 0.262.
    got = answer_array(cosine_rate(eta=0.4, step=2, steps=5), "cosine_rate").mean()
    slips = {
        0.1236: "that is eta * cos: it falls to -eta. Add 1, then halve",
        0.5236: "halve it: the first step would have twice the rate",
        0.0382: "that is a whole cosine, which comes up again: the angle runs from 0 to pi",
        0.3236: "that is a quarter of a cosine, which ends at full slope: the angle runs from 0 to pi",
        0.2400: "that is a straight line",
        0.2000: "the last step gets rate 0: only a step number `steps` would have none",
        0.1382: "the angle runs backwards, or is a step ahead: step 0 has the full rate",
        0.0066: "the angle is in degrees, and numpy takes radians",
    }
    _explain("0.4 in step 2 of 5 becomes", got, slips)
    np.testing.assert_allclose(got, 0.2618, atol=1e-4, err_msg="0.4 * (1 + cos 72 degrees) / 2")
    first = answer_array(cosine_rate(0.4, 0, 5), "cosine_rate").mean()
    assert np.isclose(first, 0.4), f"step 0 has the full rate, 0.4, got {first:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_cosine_rate(cosine_rate)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# In the lecture the planes above 1 m could fall silent, and the shipped network found nearly as much as before. A colleague concludes: "what stands above 1 m isn't
# needed to see a street from above, so ten planes will do, also for our lorry, whose camera sits 3 m high." What does the measurement say, and what
# doesn't it? Name one experiment that would tell. Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "what-it-says", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# It says that *this* trained network, on *these* streets, with this camera and with the occupancy grid beside it, loses little over all cells without those planes (of some classes more: a fifth
# of the buildings' cells, and half of what cars gain over the ground plane alone); nothing about what a network needs that is trained without them, or could make of them. It listens to the foot of things, and the occupancy grid tells it where they stand; where feet are hidden (dense traffic), or the
# occupancy grid is worse, higher planes may be all there is. From 3 m up the camera looks down on roofs, and other planes are right: by geometry, not by what was learnt here.
# The experiment: train anew with the lowest planes only and with all of them, several seeds each, for the lorry's camera, and compare on streets that neither has seen. One point for the limits of the
# measurement (this network, this camera, correlated inputs), one for a training that would tell.

# %% [markdown]
# # Exercise 08: fusion and training
#
# A baseline, the check of a gradient, the first step of backpropagation, an optimiser that gives itself away; then a training of your own, which has to beat
# a table and a rule on a real street; and one question in words. About 85 minutes. The lecture is [08: fusion](../08_fusion.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | a table with a way out: the number to beat | 2 + 1 |
# | 2 | which derivative is wrong? | 2 + 1 |
# | 3 | the gradient of the weighted loss | 3 + 1 |
# | 4 | rate and momentum, from the path | 2 |
# | 5 | a training of your own, and a street on which it must beat table and rule | 3 + 2 |
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
from scipy.ndimage import minimum_filter

from semgrid_edu.datasets.samples import real_drive
from semgrid_edu.fast import track_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.workshop.course.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
IGNORE = 255


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=1e-3), f"{what} {got:.4g}: {hint}"


# %% [markdown]
# ## Task 1: a table with a way out (2 + 1 points)
#
# The lecture's table knows two things about a cell. Yours takes any number: `columns` holds whole numbers, `(n, N)`, one row for each thing that is known
# (the label on the ground, the state, the label on another plane, ...), one column for each cell; `truth` is `(N,)`, with 255 where a cell isn't labelled.
# `new` are the columns of other cells, `(n, M)`.
#
# Complete `name_cells`: it returns a class for each new cell, `(M,)`: the most frequent true class among the labelled cells with *the same column*; of
# equally frequent classes the one with the smallest number. For one more point: a column that didn't occur among the labelled cells. Then leave out
# its last row and look for cells that agree in the others; if there are none, the last two rows, and so on. When nothing is left, take the most
# frequent class of all.


# %% nbgrader={"grade": false, "grade_id": "name-cells", "locked": false, "schema_version": 3, "solution": true, "task": false}
def name_cells(columns, truth, new):
    """Return the class of each new cell by a table of the labelled ones, (M,)."""
    ### BEGIN SOLUTION
    labelled = truth != IGNORE
    columns, truth = columns[:, labelled], truth[labelled]
    named = np.zeros(new.shape[1], int)
    for j, column in enumerate(new.T):
        for n in range(len(column), -1, -1):
            same = (columns[:n] == column[:n, None]).all(axis=0)
            if same.any():
                named[j] = np.bincount(truth[same]).argmax()
                break
    return named
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "table-cells", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _labelled_cells():
    """Return columns (2, 13) and truth (13,): label and state of each cell, and its true class."""
    label = [0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1]
    state = [0, 0, 0, 1, 1, 1, 1, 1, 0, 0, 2, 2, 2]
    truth = [0, 0, 2, 2, 2, 0, 1, 1, 0, 3, 3, 255, 255]
    return np.array([label, state]), np.array(truth)


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "name-cells-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    new = np.array([[0, 0, 1, 1, 1], [0, 1, 1, 0, 2]])
    got = answer_array(name_cells(*_labelled_cells(), new), "name_cells").astype(float)
    assert got.shape == (5,), f"expected one class for each new cell, shape (5,), got {got.shape}"
    assert not (got == IGNORE).any(), "255 isn't a class: leave out the cells without a label"
    assert got[1] != 0, "label 0 with state 1 is mostly class 2: does your table look at the first row alone?"
    assert got[0] != 2, "label 0 with state 0 is mostly class 0: does your table look at the last row alone?"
    assert got[3] != 3, "classes 0 and 3 are equally frequent there: take the smaller number"
    np.testing.assert_array_equal(got, [0, 2, 1, 0, 3], err_msg="the most frequent class of each pair, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_name_cells(name_cells)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "way-out-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    columns, truth = _labelled_cells()
    got = answer_array(name_cells(columns, truth, np.array([[1, 0, 7], [7, 0, 1]])), "name_cells")
    assert got.shape == (3,), f"expected one class for each new cell, shape (3,), got {got.shape}"
    assert got[1] == 0, f"label 0 with state 0 has been met, and is mostly class 0, got {got[1]:g}"
    met = "the pair (1, 7) hasn't been met: leave out the state; of the cells with label 1 classes 1 and 3 are most frequent"
    assert got[0] == 1, f"{met}, so 1, got {got[0]:g}"
    nothing = "label 7 hasn't been met: leave out state and label; most frequent of all is class 0"
    assert got[2] == 0, f"{nothing}, got {got[2]:g} (class 2 or 1: you kept the state)"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_way_out(name_cells)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: which derivative is wrong? (2 + 1 points)
#
# A colleague has written the reduction and its way back:
#
# - `forward(planes, theta, beta)` returns the reduced maps, `(K, H, W)`, of planes `(C, D, H, W)`, theta `(K, C, D)` and beta `(K,)`. It is right.
# - `back(planes, theta, from_maps)` takes the derivative of a loss with respect to the maps, `(K, H, W)`, and returns three arrays: the derivatives of
#   this loss with respect to `planes`, to `theta` and to `beta`. At most one of them is wrong.
#
# Complete `wrong_derivative`: it returns `"planes"`, `"theta"`, `"beta"`, or `"none"`. You choose `from_maps`; think about which one shows the most. For
# one more point: a single number of a derivative may be wrong, and by as little as three per cent; and a deviation of a billionth is rounding.


# %% nbgrader={"grade": false, "grade_id": "wrong-derivative", "locked": false, "schema_version": 3, "solution": true, "task": false}
def wrong_derivative(forward, back, planes, theta, beta):
    """Return which of the three derivatives is wrong: "planes", "theta", "beta" or "none"."""
    ### BEGIN SOLUTION
    inputs = {"planes": planes, "theta": theta, "beta": beta}
    from_maps = np.random.default_rng(0).normal(size=np.shape(forward(planes, theta, beta)))
    for (name, values), told in zip(inputs.items(), back(planes, theta, from_maps), strict=True):
        by_nudging = np.zeros(np.shape(values))
        for place in np.ndindex(by_nudging.shape):
            nudge = np.zeros(by_nudging.shape)
            nudge[place] = 0.5
            up, down = (forward(**inputs | {name: values + sign * nudge}) for sign in (1, -1))
            by_nudging[place] = ((up - down) * from_maps).sum()
        if not np.allclose(told, by_nudging, rtol=1e-3, atol=1e-6):
            return name
    return "none"
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "ways-back", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _forward(planes, theta, beta):
    """Reduce the planes."""
    return np.einsum("kcd,cdhw->khw", theta, planes) + np.asarray(beta)[:, None, None]


def _way_back(bug=""):
    """Return a way back with one bug, by the name of what is wrong in it."""

    def back(planes, theta, from_maps):
        by_planes = np.einsum("kcd,khw->cdhw", theta, from_maps)
        by_theta = np.einsum("khw,cdhw->kcd", from_maps, planes)
        by_beta = from_maps.sum(axis=(1, 2))
        if bug == "planes":
            by_planes = np.einsum("cd,khw->cdhw", theta[0], from_maps)  # as if map 0 had all weights
        if bug == "theta":
            by_theta = by_theta / from_maps[0].size  # a mean where a sum is right
        if bug == "beta":
            by_beta = np.full(len(theta), float(from_maps[0].size))  # forgets what comes from behind
        return by_planes, by_theta, by_beta

    return back


# %% nbgrader={"grade": false, "grade_id": "some-inputs", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _inputs(seed, K, C, D, H, W):
    """Return planes, theta and beta of some sizes."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(C, D, H, W)), rng.normal(size=(K, C, D)), rng.normal(size=K)


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "wrong-derivative-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    hints = {
        "planes": "nudge each score, and compare with what back says of it",
        "theta": "nudge each weight, and compare with what back says of it",
        "beta": "does your from_maps differ from cell to cell? All ones hide a way back that forgets what comes from behind",
        "none": "nothing is wrong here: compare with a tolerance, and put each number back after its nudge",
    }
    for seed, bug in enumerate(("none", "planes", "theta", "beta")):
        got = wrong_derivative(_forward, _way_back(bug), *_inputs(seed, K=2, C=3, D=2, H=2, W=3))
        assert isinstance(got, str), f'return "planes", "theta", "beta" or "none", got {got!r}'
        assert got in hints, f'return "planes", "theta", "beta" or "none", got {got!r}'
        assert got == bug, f'wrong is "{bug}", and you say "{got}": {hints[bug]}'
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_wrong_derivative(wrong_derivative)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "one-number-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    def slightly(part, place, factor):
        """Return a way back in which one number is wrong by a factor."""

        def back(*arguments):
            derivatives = [np.array(each) for each in _way_back()(*arguments)]
            derivatives[part].flat[place] *= factor
            return derivatives

        return back

    for part, name in enumerate(("planes", "theta", "beta")):
        for place in (0, 1, -1):
            for factor, wanted in ((1.03, name), (0.97, name), (1 + 1e-9, "none")):
                got = wrong_derivative(_forward, slightly(part, place, factor), *_inputs(9, K=2, C=2, D=2, H=1, W=2))
                what = f'number {place} of "{name}" is multiplied by {factor}, and you say "{got}"'
                assert got == wanted, f"{what}: compare each number by itself, with a tolerance in between"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_one_number(wrong_derivative)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: the gradient of the weighted loss (3 + 1 points)
#
# Here backpropagation begins. `logits` are what the network gives, `(C, H, W)`; a soft-max over the classes makes them probabilities $g_{c,j}$. `truth` is
# `(H, W)`, with 255 where a cell isn't labelled; `alpha` holds the weights of the classes, `(C,)`. The loss is that of the lecture, with $t_j$ the true class of cell $j$:
#
# $$ \text{loss} = -\frac{\sum_j \alpha_{t_j} \log g_{t_j,\,j}}{\sum_j \alpha_{t_j}} $$
#
# Complete `loss_back`: it returns the derivative of the loss with respect to each logit, `(C, H, W)`. (The derivative of $-\log g_{t}$ with respect to
# logit $c$ is $g_c$, less 1 when $c = t$.) For one more point: logits may be ten thousands, of either sign, and $e^{1000}$ is more than a computer holds.


# %% nbgrader={"grade": false, "grade_id": "loss-back", "locked": false, "schema_version": 3, "solution": true, "task": false}
def loss_back(logits, truth, alpha):
    """Return the derivative of the weighted cross-entropy with respect to the logits, (C, H, W)."""
    ### BEGIN SOLUTION
    g = np.exp(logits - logits.max(axis=0))
    g = g / g.sum(axis=0)
    labelled = truth != IGNORE
    true = np.where(labelled, truth, 0)
    one_hot = np.arange(len(logits))[:, None, None] == true
    weight = np.where(labelled, alpha[true], 0)
    return weight * (g - one_hot) / weight.sum()
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "loss-cells", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _cells():
    """Return logits (2, 1, 3), truth (1, 3) and alpha (2,). Soft-max by hand: (1/2, 1/2), (3/4, 1/4) and an unlabelled cell."""
    logits = np.array([[[0.0, np.log(3), 2.0]], [[0.0, 0.0, 0.0]]])
    return logits, np.array([[0, 1, IGNORE]]), np.array([1.0, 3.0])


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "loss-back-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_BACK_SLIPS = {  # of class 0 in the second cell, by hand 3 * (3/4 - 0) / (1 + 3) = 0.5625
    1.125: "you divide by the number of cells: divide by the sum of their weights",
    0.75: "you divide by the number of cells, unlabelled ones too, or leave the weights out and don't divide",
    0.375: "the weights are missing: each cell counts by the alpha of its true class",
    2.25: "that is not yet divided by the sum of the weights",
    -0.5625: "the sign is swapped: this is the gradient, and the step against it comes later",
    0.1875: "class 0 gets its own alpha: it is the weight of the *true* class that counts",
    0.45: "the unlabelled cell's weight is counted below",
    0.3214: "the unlabelled cell's weight is counted below",
    -0.1875: "1 is subtracted from class 0: subtract it from the true class, here 1",
    0.5466: "your soft-max runs along the row of cells: it is over the classes, axis 0",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "loss-back-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_array(loss_back(*_cells()), "loss_back")
    assert got.shape == (2, 1, 3), f"expected one derivative per logit, shape (2, 1, 3), got {got.shape}"
    assert not np.abs(got[:, 0, 2]).any(), f"the third cell isn't labelled: its derivatives are 0, got {got[:, 0, 2]}"
    _explain("class 0, second cell:", got[0, 0, 1], _BACK_SLIPS)
    by_class = got.sum(axis=0)
    assert np.allclose(by_class, 0), (
        f"over the classes of a cell the derivatives sum to 0, yours to {by_class.round(3)}"
    )
    by_hand = [[[-0.125, 0.5625, 0]], [[0.125, -0.5625, 0]]]
    np.testing.assert_allclose(got, by_hand, atol=1e-6, err_msg="alpha of the truth times (g - 1 at the truth), over 4")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_loss_back(loss_back)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "large-logits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    small, truth, alpha = _cells()
    wanted = answer_array(loss_back(small.copy(), truth.copy(), alpha.copy()), "loss_back")
    shift = np.array([[1000.0, -1000.0, 500.0]])
    got = answer_array(loss_back(small + shift, truth, alpha), "loss_back")
    assert np.isfinite(got).all(), (
        "e^1000 overflows and e^-1000 vanishes: subtract the largest logit of each cell first"
    )
    assert wanted.any(), "all derivatives are 0"
    hint = "the same number added to all logits of a cell changes nothing; subtract each cell's own largest"
    np.testing.assert_allclose(got, wanted, atol=1e-6, err_msg=hint)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_large_logits(loss_back)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: rate and momentum, from the path (2 points)
#
# Somebody has trained with momentum, $\Delta \leftarrow \kappa\,\Delta + \text{gradient}$, $w \leftarrow w - \eta\,\Delta$, from $\Delta = 0$ on, and has
# kept the parameters $w$ before, between and after the steps, `path` `(T + 1, n)`, and the gradient of each step, `gradients` `(T, n)`. Rate and momentum got lost.
#
# Complete `rate_and_momentum`: it returns $\eta$ and $\kappa$, which were the same in all steps. There may be a single parameter, and no momentum.


# %% nbgrader={"grade": false, "grade_id": "rate-and-momentum", "locked": false, "schema_version": 3, "solution": true, "task": false}
def rate_and_momentum(path, gradients):
    """Return the learning rate and the momentum of an optimiser."""
    ### BEGIN SOLUTION
    steps = np.diff(path, axis=0)
    before = np.concatenate([np.zeros((1, steps.shape[1])), steps[:-1]])
    parts = np.stack([-gradients.ravel(), before.ravel()], axis=1)
    eta, kappa = np.linalg.lstsq(parts, steps.ravel(), rcond=None)[0]
    return eta, kappa
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "rate-and-momentum-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand, eta = 0.5 and kappa = 0.5: delta is (2, 1), then (1, 0.5) + (2, 3) = (3, 3.5), then (1.5, 1.75) + (0, 1) = (1.5, 2.75).
    gradients = np.array([[2.0, 1.0], [2.0, 3.0], [0.0, 1.0]])
    path = np.array([[1.0, 1.0], [0.0, 0.5], [-1.5, -1.25], [-2.25, -2.625]])
    got = answer_array(rate_and_momentum(path, gradients), "rate_and_momentum").ravel()
    assert got.shape == (2,), f"return two numbers, the rate and the momentum, got {got.shape}"
    assert got[0] > 0, f"the rate is {got[0]:.3g}: w goes down by eta times delta, so mind the sign"
    np.testing.assert_allclose(got, [0.5, 0.5], atol=1e-6, err_msg="rate and momentum of the path made by hand")
    path, gradients = np.array([[1.0], [0.9], [0.72], [0.486]]), np.array([[1.0], [0.9], [0.72]])
    got = answer_array(rate_and_momentum(path, gradients), "rate_and_momentum").ravel()
    swapped = np.allclose(got, [0.9, 0.1], atol=1e-4)
    assert not swapped, "rate and momentum are swapped: return eta first"
    np.testing.assert_allclose(got, [0.1, 0.9], atol=1e-4, err_msg="the lecture's path: 1, 0.9, 0.72, 0.486")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_rate_and_momentum(rate_and_momentum)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: a training of your own (3 + 2 points)
#
# The smallest network has one layer. Column $j$ of `features`, `(K, N)`, holds what is known of cell $j$, and the logits of all cells are `theta @ features`,
# `(C, N)`. `truth` is `(N,)`, with 255 where a cell isn't labelled, and `alpha`, `(C,)`, holds the weights of the classes. The loss is that of task 3.
#
# Complete `train`: start with `theta`, `(C, K)`, and $\Delta$ all zero, take `steps` steps with all cells in each, $\Delta \leftarrow \kappa\,\Delta +
# \text{gradient}$, $\theta \leftarrow \theta - \eta\,\Delta$, and return `theta`. (The derivative with respect to `theta` is that with respect to the logits, times
# the transposed features. A hundred steps on a real street take a second.)


# %% nbgrader={"grade": false, "grade_id": "train", "locked": false, "schema_version": 3, "solution": true, "task": false}
def train(features, truth, alpha, steps, eta, kappa):
    """Return the weights (C, K) of one layer after training with momentum."""
    ### BEGIN SOLUTION
    use = truth != IGNORE
    features, truth = features[:, use], truth[use].astype(int)
    weight = alpha[truth] / alpha[truth].sum()
    one_hot = np.arange(len(alpha))[:, None] == truth
    theta = np.zeros((len(alpha), len(features)))
    delta = np.zeros(theta.shape)
    for _ in range(steps):
        logits = theta @ features
        g = np.exp(logits - logits.max(axis=0))
        g = g / g.sum(axis=0)
        delta = kappa * delta + (weight * (g - one_hot)) @ features.T
        theta = theta - eta * delta
    return theta
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "train-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    features, truth, alpha = np.eye(2, 3), np.array([0, 1, IGNORE]), np.ones(2)
    got = answer_array(train(features, truth, alpha, 1, 0.4, 0.5), "train")
    assert got.shape == (2, 2), f"expected one weight per class and feature, shape (2, 2), got {got.shape}"
    slips = {  # by hand: g is 1/2, so the derivative is (1/2 - 1) / 2 = -0.25, and the step is 0.4 * 0.25
        -0.1: "the sign is swapped: a step goes against the gradient",
        0.2: "you don't divide by the sum of the weights",
        0.0: "nothing was learned in the one step: does your loop return theta before it?",
        0.0667: "the unlabelled cell is counted below",
    }
    _explain("after one step theta[0, 0] is", got[0, 0], slips)
    np.testing.assert_allclose(got, [[0.1, -0.1], [-0.1, 0.1]], atol=1e-6, err_msg="one step with rate 0.4, by hand")
    got = answer_array(train(features, truth, alpha, 2, 0.4, 0.5), "train")
    slips = {
        0.19003: "delta forgets the step before: multiply it by kappa, and add the new gradient",
        0.28007: "the momentum multiplies all of theta, or isn't kappa: delta becomes kappa * delta + gradient",
        0.15003: "the gradient of the first step is used again: compute the logits in each step",
    }
    _explain("after two steps theta[0, 0] is", got[0, 0], slips)
    np.testing.assert_allclose(got[0, 0], 0.240033, atol=1e-5, err_msg="two steps: 0.1 + 0.4 * (0.5 * 0.25 + 0.22508)")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_train(train)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# **And now beat the table and the rule.** On a real street the cells beyond 15 m are labelled, and you name the nearer ones. `o`, `(4, N)`, is the occupancy grid of
# the labelled cells. `height`, `(N,)`, says how far the highest return of each is above the ground, metres, and is NaN in a cell without a return; `truth`, `(N,)`, is
# as above. `new_o` and `new_height` are those of the nearer cells. There are 14 classes.
#
# Complete `name_new`: it returns a class for each new cell, `(M,)`. In class accuracy it must be two points better than a table of the most probable state of `o`, and than the
# lecture's height rule, which knows three classes; and in accuracy better than *always road*. How is yours to choose: which features to make, which weights, `train` or something
# else. Your instructor's street has other classes at other heights.
#
# (Why far and near, not left and right? Road is 65 % of the far cells and 57 % of the near ones. On the right side of this street it is 21 %, on the left 79 %. A method
# also learns how frequent classes are, and there it would learn what is false.)


# %% nbgrader={"grade": false, "grade_id": "name-new", "locked": false, "schema_version": 3, "solution": true, "task": false}
def name_new(o, height, truth, new_o, new_height):
    """Return the class of each new cell, (M,)."""

    ### BEGIN SOLUTION
    def features(o, height):
        """Return 1, o, and in which piece of height a cell is, (K, N)."""
        piece = np.where(np.isnan(height), -1, np.digitize(height, [0.25, 0.5, 1, 1.5, 2, 3]))
        return np.concatenate([np.ones((1, len(height))), o, piece == np.arange(-1, 7)[:, None]])

    use = truth != IGNORE
    X, true = features(o, height)[:, use], truth[use].astype(int)
    theta, delta = np.zeros((14, len(X))), 0.0
    for _ in range(150):
        logits = theta @ X
        g = np.exp(logits - logits.max(axis=0))
        g = g / g.sum(axis=0)
        delta = 0.9 * delta + (g - (np.arange(14)[:, None] == true)) @ X.T / len(true)
        theta = theta - 0.5 * delta
    return (theta @ features(new_o, new_height)).argmax(axis=0)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "street", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _height(points, spec):
    """Return how far each cell's highest return is above the lowest within 9 x 9 cells, (H, W) metres; NaN without any."""
    rows, cols, inside = spec.cells(points)
    highest, lowest = np.full(spec.shape, -np.inf), np.full(spec.shape, np.inf)
    np.maximum.at(highest, (rows[inside], cols[inside]), points[inside, 2])
    np.minimum.at(lowest, (rows[inside], cols[inside]), points[inside, 2])
    ground = minimum_filter(lowest, 9, mode="constant", cval=np.inf)
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(highest), highest - ground, np.nan)


def _street():
    """Return o (4, N), height (N,) and truth (N,) of the labelled cells of a real street: beyond 15 m, and nearer."""
    spec, drive = GridSpec.compact(), real_drive()
    frames = [drive[k] for k in range(4)]
    o = np.stack([belief.probability for belief in track_drive(frames, spec)], axis=1)
    height = np.stack([_height(frame.points_grid, spec) for frame in frames])
    truth = np.stack([frame.labels.birdseye_on(spec) for frame in frames])
    far = np.broadcast_to(spec.centers()[..., 0] > 15, truth.shape)
    return [(o[:, part], height[part], truth[part]) for part in ((truth < 10) & far, (truth < 10) & ~far)]


def _class_accuracy(called, truth):
    """Return the mean over the classes that occur of the share of a class's cells that are right, per cent."""
    return 100 * np.mean([(called[truth == c] == c).mean() for c in np.unique(truth)])


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "name-new-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    (o, height, truth), (new_o, new_height, new_truth) = _street()
    got = answer_array(name_new(o.copy(), height.copy(), truth.copy(), new_o.copy(), new_height.copy()), "name_new")
    assert got.shape == new_truth.shape, (
        f"expected one class for each new cell, shape {new_truth.shape}, got {got.shape}"
    )
    state, new_state = o.argmax(axis=0), new_o.argmax(axis=0)
    most = np.array([np.bincount(truth[state == s], minlength=14).argmax() for s in range(4)])
    baselines = {
        "a table of the states": most[new_state],
        "the height rule": np.where(new_height > 2.2, 6, np.where(new_height > 0.25, 3, 0)),
    }
    mine = _class_accuracy(got, new_truth)
    for name, called in baselines.items():
        other = _class_accuracy(called, new_truth)
        told = f"class accuracy {mine:.0f} %, and {name} gets {other:.0f} %"
        assert mine >= other + 2, f"{told}: what does it not know? Give height to your features in pieces"
        print(told)
    right, road = (got == new_truth).mean(), (new_truth == 0).mean()
    print(f"road: {100 * (truth == 0).mean():.0f} % of the far cells, {100 * road:.0f} % of the near ones")
    told = f"{100 * right:.0f} % of the cells are right, and always road gets {100 * road:.0f} %"
    assert right > road, f"{told}: the weights of rare classes may be too large"
    print(told)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fusion

    complaint = fusion.check_name_new(name_new)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# On the lecture's real street, a network with $o$ and heights gets 84 % of the cells in the view of cameras that it hasn't learned from. If it sees the image, too, it gets 83 %. A colleague concludes: "Then the
# camera is worth nothing. Leave it out." What does the measurement say, and what doesn't it say? Name one experiment that would tell. Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "what-it-says", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# It says that this network, which learned from four cameras at one street corner, finds no more cells with the image than without it when it is shown another side of the corner. Most labelled cells are
# road, cars and walls, which height already tells apart. It doesn't say that the image holds nothing more: sidewalk, vegetation and pedestrians look different and have the height of
# something else, but they are few among the cells. Nor does it say what a camera would be worth with more streets to learn from; one point is less than the intervals are wide, and it is one seed. The experiment: give the same learner $o$ and heights, once
# with and once without the image's scores, on many streets that it hasn't seen, with several seeds, and compare all cells and each class. One point for what was measured (few views of one corner, mostly classes that height tells), one for
# a comparison in which only the image is switched off.

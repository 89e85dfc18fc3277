# %% [markdown]
# # Exercise 10: a CRF of your own
#
# Seven functions that ask more of a CRF than the lecture did, the last of which refines the map of the sample drive, and one question to answer in words. About 100 minutes.
# The lecture is [10: the CRF by hand](../10_crf.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | the prices at which two cells agree | 2 |
# | 2 | what changing one label costs; marginals when some labels are known | 2 + 3 |
# | 3 | mean field when each border has its own price | 2 + 1 |
# | 4 | its free energy | 2 + 1 |
# | 5 | a weight for a kernel, and a CRF that refines a map | 1 + 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong: the cell `slips` above it lists what usual mistakes give. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.
#
# In tasks 2 to 4 the N cells are counted from 0 to N - 1, wherever they lie. `phi`, shape `(C, N)`, holds the price of each class in each cell, $\phi_u$ of equation (3). `k`, shape
# `(N, N)`, holds the price of each pair: it is symmetric, and its diagonal may hold any numbers. A cell is no pair with itself, so **the diagonal must never count**. Arguments are never
# changed.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings
from itertools import product

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does

W1, W2 = 4.0, 3.0  # the last task: weights, widths (cells, probability, cells), reach (cells) and number of updates
SIGMA_ALPHA, SIGMA_BETA, SIGMA_GAMMA = 3.2, 0.2, 1.2
REACH, UPDATES = 6, 5


def shifted(maps, dr, dc):
    """Return maps (..., H, W) in which cell (r, c) holds what cell (r + dr, c + dc) held; 0 from beyond the border.

    Offsets up to REACH are allowed.
    """
    H, W = maps.shape[-2:]
    padded = np.zeros((*maps.shape[:-2], H + 2 * REACH, W + 2 * REACH), maps.dtype)
    padded[..., REACH : REACH + H, REACH : REACH + W] = maps
    return padded[..., REACH + dr : REACH + dr + H, REACH + dc : REACH + dc + W]


# %% nbgrader={"grade": false, "grade_id": "explain", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _explain(what, got, slips, atol=1e-4):
    """Stop with a hint when `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.allclose(got, slip, atol=atol), f"{what} {np.round(got, 4)}: {hint}"


# %% [markdown]
# ## Task 1: the prices at which two cells agree (2 points)
#
# Two cells, two classes. The network says that cell 1 is road with probability `p`, more than one half, and cell 2 with `q`, less than one half. Cell 1 is surer: $p + q > 1$. If their labels
# differ, that costs $k$. With a small $k$ each keeps its own label; as $k$ grows, cell 2 is called road, too. But when? The two questions of the lecture have two answers:
#
# 1. above which price is the **most likely labelling** "both road"?
# 2. above which price is road the **most likely label of cell 2**, that is, its marginal above one half?
#
# Complete `tipping_prices`: it returns the two prices. (Write down the four labellings as in the lecture's first table, with $e^{-k}$ where the labels differ. A formula or a numerical search are both right.)


# %% nbgrader={"grade": false, "grade_id": "tipping-prices", "locked": false, "schema_version": 3, "solution": true, "task": false}
def tipping_prices(p, q):
    """Return the prices above which the best labelling, and cell 2 by itself, turn to road."""
    ### BEGIN SOLUTION
    # Best labelling: p q > p (1 - q) e^-k. Marginal: p q + (1 - p) q e^-k > p (1 - q) e^-k + (1 - p) (1 - q).
    return np.log((1 - q) / q), np.log((p - q) / (p + q - 1))
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "tipping-prices-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_BEST_SLIPS = {
    2.1972: "that is the price at which cell 1 would give way: cell 2 is less sure, so it gives way first",
    -0.4055: "the sign is swapped: a price that keeps them from differing is positive",
    1.5000: "a price stands in the exponent: take the logarithm",
    0.2027: "the pair is counted twice: two cells are one pair",
    0.8109: "compare the labellings (road, road) and (road, car): p stands in both, 1 - q and q differ",
    0.5850: "that is the logarithm to base 2: take the natural one",
    0.5108: "that is the second price: the most likely labelling is one of four, compare their probabilities",
}
_TIP_SLIPS = {
    0.4055: "that is the first price again: a marginal adds up two labellings",
    -0.5108: "the sign is swapped: a price that keeps them from differing is positive",
    1.6667: "a price stands in the exponent: take the logarithm",
    0.2554: "the pair is counted twice: two cells are one pair",
    0.7370: "that is the logarithm to base 2: take the natural one",
    0.9163: "that is the price of road in cell 2, -log q: weigh the four labellings",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "tipping-prices-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: 0.9 * 0.4 = 0.9 * 0.6 e^-k at k = log 1.5; and 0.36 + 0.04 e^-k = 0.54 e^-k + 0.06 at e^-k = 0.6.
    got = answer_array(tipping_prices(0.9, 0.4), "tipping_prices")
    assert got.shape == (2,), f"expected two prices, got shape {got.shape}"
    swapped = "the two prices are swapped: that of the most likely labelling comes first"
    assert not np.allclose(got, [np.log(1 / 0.6), np.log(1.5)], atol=1e-3), swapped
    _explain("the first price is", got[0], _BEST_SLIPS, atol=1e-3)
    np.testing.assert_allclose(got[0], np.log(1.5), atol=1e-4, err_msg="0.36 = 0.54 e^-k")
    _explain("the second price is", got[1], _TIP_SLIPS, atol=1e-3)
    np.testing.assert_allclose(got[1], np.log(1 / 0.6), atol=1e-4, err_msg="0.36 + 0.04 e^-k = 0.54 e^-k + 0.06")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_tipping_prices(tipping_prices)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: changing one label, and knowing some (2 + 3 points)
#
# Whoever tries out labellings changes one cell at a time. Then it would be a waste to add up all pairs again. `labels`, shape `(N,)`, holds a class for each cell. What does the energy of equation (3),
# $E(x) = \sum_i \phi_u(x_i) + \sum_{i<j} [x_i \neq x_j]\, k_{ij}$, gain when cell `i` takes the class `label` and all others keep theirs?
#
# Complete `energy_change`: it returns $E(\text{after}) - E(\text{before})$, one number. Only row `i` of `k` is needed.


# %% nbgrader={"grade": false, "grade_id": "energy-change", "locked": false, "schema_version": 3, "solution": true, "task": false}
def energy_change(labels, i, label, phi, k):
    """Return how much E(x) rises when cell i takes another label."""
    ### BEGIN SOLUTION
    price = np.where(np.arange(len(labels)) == i, 0, k[i])
    differ = price[labels != label].sum() - price[labels != labels[i]].sum()
    return phi[label, i] - phi[labels[i], i] + differ
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "energy-change-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_CHANGE_SLIPS = {
    -2.2: "that is before minus after",
    3.0: "each pair is counted twice, as (i, j) and as (j, i)",
    1.8: "each pair is halved: the energy counts each pair once, and each of them holds cell i once",
    0.8: "the cell's own prices are missing",
    1.4: "the pairs are missing",
    4.3: "that is what cell i pays afterwards: subtract what it paid before",
    6.7: "that is the whole energy afterwards: subtract that of before",
    11.2: "the cell is paired with itself: the diagonal of k must never count",
    -6.8: "the cell is paired with itself: the diagonal of k must never count",
    0.6: "you charge the pairs that agree: different labels cost",
    4.9: "you multiply by the difference of the class numbers: they are names, a pair differs or it doesn't",
    2.0: "class and cell are swapped: phi[c, i] is the price of class c in cell i",
    4.0: "the pairs of before are missing: subtract them",
    -0.4: "the pairs of afterwards are missing",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "energy-change-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    phi = np.array([[0.1, 2.0, 0.3, 1.4], [1.9, 0.4, 1.5, 0.2], [1.2, 0.7, 0.6, 2.4], [0.8, 1.1, 1.7, 0.9]])
    k = np.array([[9, 0.5, 1.5, 0.3], [0.5, 9, 0.7, 0.2], [1.5, 0.7, 9, 1.1], [0.3, 0.2, 1.1, 9]])
    labels = np.array([0, 3, 0, 1])
    # By hand, cell 2 from class 0 to class 3: 1.7 - 0.3 for the cell; before it differs from cells 1 and 3 (0.7 + 1.1), after from 0 and 3 (1.5 + 1.1).
    got = answer_array(energy_change(labels, 2, 3, phi, k), "energy_change")
    assert list(labels) == [0, 3, 0, 1], "energy_change changed its argument `labels`: work on a copy"
    assert got.size == 1, f"expected one number, got an array of shape {got.shape}"
    _explain("the energy changes by", got.item(), _CHANGE_SLIPS, atol=1e-3)
    np.testing.assert_allclose(got, 2.2, atol=1e-6, err_msg="1.4 for the cell and 2.6 - 1.8 for its pairs")
    same = answer_array(energy_change(labels, 1, 3, phi, k), "energy_change")
    np.testing.assert_allclose(same, 0, atol=1e-6, err_msg="a cell that keeps its label changes nothing")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_energy_change(energy_change)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# Every labelling has the probability $P(x) = e^{-E(x)} / Z$. Suppose somebody has looked at a few cells and knows their labels: `known` is a dictionary from cells to classes, such as `{2: 0}`, and may be empty. What do we then believe of
# the *other* cells? Complete `marginals`: it returns, in an array `(C, N)`, the probability of each class in each cell **given** what is known. A known cell has its class with probability 1.
# `product(range(C), repeat=N)` yields all $C^N$ labellings one by one. N is at most 6 in the tests.


# %% nbgrader={"grade": false, "grade_id": "marginals", "locked": false, "schema_version": 3, "solution": true, "task": false}
def marginals(phi, k, known):
    """Return the exact probability of each class in each cell, given the known ones, (C, N)."""
    ### BEGIN SOLUTION
    C, N = phi.shape
    cells, total = np.arange(N), np.zeros((C, N))
    for x in product(range(C), repeat=N):
        x = np.array(x)
        if any(x[i] != label for i, label in known.items()):
            continue
        E = phi[x, cells].sum() + (k * (x[:, None] != x)).sum() / 2
        total[x, cells] += np.exp(-E)
    return total / total.sum(axis=0)
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "marginals-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_MARGINAL_SLIPS = {
    (0.321, 0.178, 0.143): "the numbers of a cell don't sum to 1: divide by Z, the sum over all labellings",
    (0.238, 0.132, 0.106): "you divide by the sum over all cells as well: in each cell the classes sum to 1",
    (0.179, 0.621, 0.654): "cheap labellings must be probable: exp(-E), not exp(E)",
    (0.606, 0.441, 0.403): "each pair is counted twice: sum over i < j only",
    (0.821, 0.379, 0.346): "pairs that agree are charged, or different ones rewarded: different labels cost",
    (0.802, 0.378, 0.289): "the pairs are missing: that is what each cell says by itself",
    (0.726, 0.331, 0.243): "that is mean field: sum over all labellings, exactly",
    (0.746, 0.382, 0.271): "that is one mean-field update: sum over all labellings, exactly",
    (0.574, 0.426, 0.426): "you keep the best labelling of each class (a max-marginal): sum over the labellings",
    (1, 0, 0): "that is the most likely labelling: a probability of each class is asked for",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "known-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_KNOWN_SLIPS = {  # cell 2 is known to have class 0
    (0.716, 0.398, 0.319): "`known` is ignored",
    (0.716, 0.398, 1.000): "what is known must reach the other cells: leave out all labellings that contradict it",
    (
        0.279,
        0.242,
        0.319,
    ): "those are probabilities of both, not of one given the other: divide by the sum over the labellings that remain",
    (0.771, 0.492, 1.000): "the known cell's neighbours don't hear from it: its pairs still cost",
    (0.642, 0.229, 0.000): "class and cell are mixed up in `known`: it maps cells to classes, {2: 0}",
    (0.952, 0.943, 1.000): "each pair is counted twice",
    (0.834, 0.121, 1.000): "different labels are rewarded: they cost",
    (0.895, 0.774, 1.000): "that is mean field: sum over all labellings, exactly",
    (1.000, 0.502, 0.389): "cell and class are mixed up in `known`: it maps cells to classes, {2: 0}",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "marginals-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    phi = np.array([[0.2, 0.9, 1.2], [1.6, 0.4, 0.3]])
    k = np.array([[0, 0.8, 0.3], [0.8, 0, 1.1], [0.3, 1.1, 0]])
    got = answer_array(marginals(phi, k, {}), "marginals")
    assert got.shape == (2, 3), f"expected a row per class and a column per cell, (2, 3), got {got.shape}"
    _explain("class 0 has, in the three cells,", got[0], _MARGINAL_SLIPS, atol=1.1e-3)
    np.testing.assert_allclose(got[0], [0.7156, 0.3975, 0.3192], atol=1e-4, err_msg="class 0 in the three cells")
    np.testing.assert_allclose(got.sum(axis=0), 1, err_msg="the classes of each cell sum to 1")
    got = answer_array(marginals(phi, k, {2: 0}), "marginals")
    assert got.shape == (2, 3), f"expected a row per class and a column per cell, (2, 3), got {got.shape}"
    _explain("with cell 2 known to have class 0, that class has", got[0], _KNOWN_SLIPS, atol=1.1e-3)
    by_hand = [0.8724, 0.7573, 1]
    np.testing.assert_allclose(got[0], by_hand, atol=1e-4, err_msg="class 0, when cell 2 is known to have it")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_marginals(marginals)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: when each border has its own price (2 + 1 points)
#
# The lecture charges every two different labels alike (Potts). But road beside sidewalk is usual, and road beside sky is not. Let `mu`, shape `(C, C)`, say how dear each pair of classes is: two cells
# with the labels $l$ and $m$ cost $k_{ij}\,\mu_{lm}$. It is symmetric, with zeros on its diagonal. Potts is the case in which all others are 1.
#
# `Q`, shape `(C, N)`, holds a distribution for each cell. A cell pays for its neighbours *on average*, as in the lecture. Update **all cells at once**, so that each of them uses the `Q` that was given, without damping.
#
# Complete `update`: it returns the new `Q`. For one more point: prices may be thousands, where $e^{-1000}$ is less than a computer holds, and infinite for an impossible class. You may
# add any number to all prices of a cell without changing its result.


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(Q, phi, k, mu):
    """Return Q after one update of all cells at once, (C, N)."""
    ### BEGIN SOLUTION
    others = k - np.diag(np.diag(k))
    price = phi + mu @ Q @ others
    weight = np.exp(price.min(axis=0) - price)
    return weight / weight.sum(axis=0)
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "update-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_UPDATE_SLIPS = {
    (0.885, 0.094, 0.108): "a cell counts itself: the diagonal of k must be left out",
    (0.655, 0.144, 0.319): "different labels are rewarded: they must cost; check the sign of the sum",
    (0.296, 0.382, 0.296): "the cells' own prices phi are missing",
    (0.108, 0.555, 0.201): "the sign of phi is swapped: a high price is a low probability",
    (0.654, 0.126, 0.220): "you normalise over the cells: each cell has its own Z, a sum over axis 0",
    (0.269, 0.052, 0.091): "you divide by the sum over all cells and classes: each cell has its own Z",
    (0.287, 0.055, 0.096): "the classes of a cell don't sum to 1: divide by Z_i",
    (0.571, 0.225, 0.276): "cell 1 already used the new Q of cell 0: all cells use the old Q",
    (0.453, 0.184, 0.280): "you use each cell's best class: the whole distribution counts",
    (0.557, 0.249, 0.290): "you start from log Q: the cells' own opinion is phi, in every update",
    (0.592, 0.211, 0.304): "each pair is halved: in a cell's own sum every neighbour has its full price",
    (0.527, 0.266, 0.280): "each pair counts twice: every neighbour counts once",
    (0.600, 0.204, 0.306): "that is a mean over the cells: take the sum over the others",
    (0.777, 0.134, 0.208): "you multiply by the old Q: it only stands in the sum over the others",
    (0.614, 0.241, 0.297): "only the pairs i < j are used: a cell hears from all others",
    (0.571, 0.178, 0.310): "only the pairs i > j are used: a cell hears from all others",
    (-1.250, -2.900, -2.340): "those are minus the prices: take the exponential, then divide by Z_i",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "mu-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_MU_SLIPS = {  # each border has its own price
    (0.571, 0.231, 0.297): "`mu` is ignored: each pair of classes has its own price",
    (0.815, 0.353, 0.424): "different labels are rewarded: they must cost",
    (
        0.328,
        0.009,
        0.094,
    ): "1 - Q counts twice what `mu` says already: the mean price of label l beside cell j is the sum over m of mu[l, m] Q_j(m)",
    (0.165, 0.030, 0.052): "one price for all borders of a class: each pair of classes has its own",
    (0.368, 0.083, 0.170): "one mean price for all borders of a class: each pair of classes has its own",
    (0.248, 0.044, 0.105): "one price for all borders of a class: each pair of classes has its own",
    (0.268, 0.021, 0.269): "you use each cell's best class: the whole distribution counts",
    (0.480, 0.000, 0.001): "a cell counts itself: the diagonal of k must be left out",
    (0.154, 0.122, 0.149): "the cells' own prices phi are missing",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    Q = np.array([[0.6, 0.2, 0.3], [0.3, 0.5, 0.1], [0.1, 0.3, 0.6]])
    phi = np.array([[0.4, 1.6, 1.1], [1.3, 0.7, 2.0], [1.9, 1.0, 0.5]])
    k = np.array([[5, 0.8, 0.3], [0.8, 5, 1.4], [0.3, 1.4, 5]])
    before = Q.copy()
    got = answer_array(update(Q, phi, k, 1 - np.eye(3)), "update")  # Potts
    assert np.array_equal(Q, before), "update changed its argument `Q`: make a new array, all cells use the old one"
    assert got.shape == (3, 3), f"expected the shape of Q, (3, 3), got {got.shape}"
    # By hand, cell 0: prices 0.4 + 0.8 * 0.8 + 0.3 * 0.7 = 1.25, 1.3 + 0.8 * 0.5 + 0.3 * 0.9 = 1.97, 1.9 + 0.8 * 0.7 + 0.3 * 0.4 = 2.58.
    _explain("class 0 has, in the three cells,", got[0], _UPDATE_SLIPS, atol=1.1e-3)
    by_hand = [[0.5710, 0.2314, 0.2968], [0.2779, 0.3384, 0.1678], [0.1510, 0.4302, 0.5354]]
    np.testing.assert_allclose(got, by_hand, atol=1e-4, err_msg="a row per class, a column per cell")
    mu = np.array([[0, 1.0, 3.0], [1.0, 0, 0.5], [3.0, 0.5, 0]])
    got = answer_array(update(Q, phi, k, mu), "update")
    _explain("with other borders class 0 has, in the three cells,", got[0], _MU_SLIPS, atol=1.1e-3)
    # By hand, cell 0, class 0: 0.4 + 0.8 * (0.5 * 1 + 0.3 * 3) + 0.3 * (0.1 * 1 + 0.6 * 3) = 2.09.
    np.testing.assert_allclose(
        got[0], [0.3507, 0.0558, 0.1863], atol=1e-4, err_msg="class 0, each border with its own price"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "update-limits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Every class is dear, and class 1 of cell 1 is impossible; then the same with 2000 less for each.
    Q, k, less = np.full((3, 2), 1 / 3), np.zeros((2, 2)), np.array([[0.0, 3.0], [1.0, np.inf], [7000.0, 3.0]])
    got = answer_array(update(Q.copy(), less + 2000, k.copy(), 1 - np.eye(3)), "update")
    assert np.isfinite(got).all(), (
        "a result isn't finite: exp(-2000) is 0 on a computer, so subtract each cell's smallest price first"
    )
    wanted = answer_array(update(Q.copy(), less, k.copy(), 1 - np.eye(3)), "update")
    assert np.isfinite(wanted).all(), (
        "a result isn't finite where a class is impossible: its price is inf, its weight 0"
    )
    hint = "2001 against 2000 is 1 / (1 + e), as 1 against 0; if you subtract one number from all cells, take each cell's own"
    np.testing.assert_allclose(got, wanted, atol=1e-4, err_msg=hint)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_update_limits(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: its free energy (2 + 1 points)
#
# Which score does the update of task 3 lower? The lecture's free energy is the mean energy of independent cells minus their entropy, with each pair counted once. Let each border have its own price `mu`, as in task 3, and work out what the *mean* price of a pair is
# when cell $i$ has the label $l$ with $Q_i(l)$ and cell $j$ has $m$ with $Q_j(m)$, each by itself.
#
# Complete `free_energy`: it returns one number, in nats. For one more point: `Q` may be 0, where $0 \log 0$ counts as 0; and if the class is impossible there, $0 \cdot \infty$ counts as 0 too.


# %% nbgrader={"grade": false, "grade_id": "free-energy", "locked": false, "schema_version": 3, "solution": true, "task": false}
def free_energy(Q, phi, k, mu):
    """Return F(Q)."""
    ### BEGIN SOLUTION
    possible = Q > 0
    mean_price = (Q[possible] * phi[possible]).sum()
    disagree = np.triu(k * (Q.T @ mu @ Q), 1).sum()
    return mean_price + disagree + (Q[possible] * np.log(Q[possible])).sum()
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "free-energy-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_FREE_SLIPS = {
    1.2547: "the pair is counted twice: sum over i < j only",
    2.9193: "the sign of the entropy is swapped: uncertainty makes F smaller, so add Q log Q, which is negative",
    1.8080: "the entropy is missing: that is the mean energy",
    0.4807: "you charge the probability that the pair agrees: 1 minus it",
    -0.2033: "agreement is rewarded instead of disagreement charged: here it is an energy, so the constant matters",
    0.2048: "that is the logarithm to base 2: take the natural one",
    1.3254: "that is the logarithm to base 10: take the natural one",
    -0.5533: "the cells' own prices are missing",
    1.4367: "each cell counts as half a pair with itself: leave the diagonal of k out",
    2.1767: "each cell counts as a pair with itself: leave the diagonal of k out",
    2.7347: "the pair is counted twice, and each cell with itself: sum over i < j only",
    0.1387: "the pair is missing",
    -1.8033: "the sign of the cells' own prices is swapped",
    0.0717: "the cells' own prices are averaged over the cells: take the sum",
    2.8467: "the cells' own prices aren't weighted by Q",
    -0.6967: "the sign of all of it is swapped: F is an energy, and mean field makes it small",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "free-energy-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    Q, phi, k = np.array([[0.8, 0.3], [0.2, 0.7]]), np.array([[0.5, 1.2], [1.4, 0.3]]), np.array([[2, 0.9], [0.9, 2]])
    # By hand: prices 0.40 + 0.28 + 0.36 + 0.21 = 1.25; the pair agrees with 0.24 + 0.14 = 0.38, so 0.9 * 0.62 = 0.558; minus an entropy of 1.1113.
    got = answer_array(free_energy(Q, phi, k, 1 - np.eye(2)), "free_energy")  # Potts
    assert got.size == 1, f"expected one number, got an array of shape {got.shape}"
    _explain("F is", got.item(), _FREE_SLIPS)
    np.testing.assert_allclose(got, 0.6967, atol=1e-4, err_msg="1.25 + 0.558 - 1.1113")
    # A border costs 2.5: 0.9 * 2.5 * 0.62 = 1.395 in place of 0.558.
    got = answer_array(free_energy(Q, phi, k, 2.5 * (1 - np.eye(2))), "free_energy")
    ignored = "`mu` is ignored: each pair of labels has its own price"
    assert not np.isclose(got, 0.6967, atol=1e-4), f"F is {got:.4f}, with borders that cost 2.5: {ignored}"
    assert not np.isclose(got, 1.6237, atol=1e-4), "the price of a border is weighted with k and Q: 2.5 * 0.9 * 0.62"
    np.testing.assert_allclose(got, 1.5337, atol=1e-4, err_msg="1.25 + 1.395 - 1.1113, a border costs 2.5")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_free_energy(free_energy)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "free-energy-limits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Class 1 of cell 0 is impossible, and its Q is 0; then its Q is nearly 0, and its price 5.
    k = np.array([[2, 0.9], [0.9, 2]])
    at, near = np.array([[1.0, 0.5], [0.0, 0.5]]), np.array([[1 - 1e-9, 0.5], [1e-9, 0.5]])
    got = answer_array(free_energy(at, np.array([[0.5, 1.2], [np.inf, 0.3]]), k.copy(), 1 - np.eye(2)), "free_energy")
    assert not np.isnan(got).any(), "F is NaN: 0 * log 0 and 0 * inf count as 0; leave out what has probability 0"
    assert np.isfinite(got).all(), f"F is {got}, but the impossible class has probability 0 and costs nothing"
    nearly = answer_array(free_energy(near, np.array([[0.5, 1.2], [5.0, 0.3]]), k.copy(), 1 - np.eye(2)), "free_energy")
    hint = "a probability of 0 must give what a tiny one gives"
    np.testing.assert_allclose(got, nearly, atol=1e-4, err_msg=hint)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_free_energy_limits(free_energy)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: a weight for a kernel, and a CRF of your own (1 + 3 points)
#
# You want to use a kernel as printed, without normalisation, and yet as strong as a normalised one. `K` is one kernel, `(N, N)`, symmetric, with ones on its diagonal. A cell that differs from all others pays $w \sum_{j \neq i} K_{ij}$. Complete
# `weight_for`: it returns the weight $w$ with which this is `total` for the median cell.


# %% nbgrader={"grade": false, "grade_id": "weight-for", "locked": false, "schema_version": 3, "solution": true, "task": false}
def weight_for(K, total):
    """Return the weight with which the median cell pays `total` when it differs from all others."""
    ### BEGIN SOLUTION
    return total / np.median(K.sum(axis=1) - np.diag(K))
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "weight-for-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_WEIGHT_SLIPS = {
    2.0588: "the diagonal is in your sums: a cell is no pair with itself",
    2.1000: "the diagonal is in your sums, and the mean isn't the median",
    5.2500: "that is right for the mean of the cells: take the median",
    3.8889: "that is right for the cell that pays most: take the median",
    8.7500: "that is right for the cell that pays least: take the median",
    0.2000: "that is one over the weight",
    2.4500: "divide the total by the sum, don't multiply",
    1.7500: "you divide by the sum of all entries: each cell has its own sum",
    35.0: "the median of single prices isn't the median of what a cell pays in all: sum over j first",
    11.6667: "the median of single prices isn't the median of what a cell pays in all: sum over j first",
    5.8333: "the median of single prices isn't the median of what a cell pays in all: sum over j first",
    10.0: "each pair is halved: a cell pays the full price of each of its pairs",
    2.5: "each pair counts twice: a cell pays for each of its pairs once",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "weight-for-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # The three cells' sums without themselves are 0.7, 0.9 and 0.4, so the median is 0.7.
    K = np.array([[1, 0.6, 0.1], [0.6, 1, 0.3], [0.1, 0.3, 1]])
    before = K.copy()
    got = answer_array(weight_for(K, 3.5), "weight_for")
    assert np.array_equal(K, before), "weight_for changed its argument: work on a copy"
    assert got.size == 1, f"expected one number, got an array of shape {got.shape}"
    _explain("the weight is", got.item(), _WEIGHT_SLIPS, atol=1e-3)
    np.testing.assert_allclose(got, 5, atol=1e-6, err_msg="3.5 / 0.7")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_weight_for(weight_for)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# Now put it together on a map of H x W cells. The matrix of all pairs of the sample drive's 8804 cells would fill 600 MB, so let a cell pay only to cells that are at most
# `REACH` rows and columns away; both Gaussians are small beyond. Then you need no matrix: for each offset `(dr, dc)`, `shifted(maps, dr, dc)` (in the first cell) shows every cell its
# neighbour at that offset. All H x W pairs of this offset are handled in one line.
#
# `log_g` is `(C, H, W)`, the logarithms of the network's probabilities, so $\phi_u = -\log g$. `o` is `(4, H, W)`.
#
# 1. At each offset up to `REACH`, (0, 0) included, compute for all cells the two Gaussians of equation (4) without their weights, $K^{(1)}$ (place with `SIGMA_ALPHA`, state with
#    `SIGMA_BETA`) and $K^{(2)}$ (place with `SIGMA_GAMMA`). A neighbour beyond the border doesn't exist: its $K$ is 0.
# 2. $D^{(1)}$ and $D^{(2)}$, maps of H x W, are their sums over all offsets. Normalise: $k = $ `W1` $K^{(1)}_{ij} / \sqrt{D^{(1)}_i D^{(1)}_j}\; + $ `W2` $K^{(2)}_{ij} / \sqrt{D^{(2)}_i D^{(2)}_j}$.
# 3. Start with $Q = g$ and do `UPDATES` updates as in task 3 with Potts, all cells at once. The offset (0, 0) is no pair.
#
# Complete `refine`: it returns $Q$, `(C, H, W)`. (With these prices the free energy of the lecture's frame falls without damping too. The lecture shows two cells for which it doesn't.)


# %% nbgrader={"grade": false, "grade_id": "refine", "locked": false, "schema_version": 3, "solution": true, "task": false}
def refine(log_g, o):
    """Return the refined probabilities of the classes, (C, H, W)."""
    ### BEGIN SOLUTION
    steps = range(-REACH, REACH + 1)
    inside, pairs = np.ones(o.shape[1:]), {}
    for dr, dc in product(steps, steps):
        apart, unlike = dr**2 + dc**2, ((o - shifted(o, dr, dc)) ** 2).sum(axis=0)
        there = shifted(inside, dr, dc)
        bilateral = there * np.exp(-apart / (2 * SIGMA_ALPHA**2) - unlike / (2 * SIGMA_BETA**2))
        pairs[dr, dc] = bilateral, there * np.exp(-apart / (2 * SIGMA_GAMMA**2))
    r1, r2 = (sum(kernels[n] for kernels in pairs.values()) ** -0.5 for n in (0, 1))
    Q = np.exp(log_g)
    for _ in range(UPDATES):
        logits = np.array(log_g, dtype=float)
        for (dr, dc), (K1, K2) in pairs.items():
            if (dr, dc) != (0, 0):
                k = W1 * K1 * r1 * shifted(r1, dr, dc) + W2 * K2 * r2 * shifted(r2, dr, dc)
                logits -= k * (1 - shifted(Q, dr, dc))
        weight = np.exp(logits - logits.max(axis=0))
        Q = weight / weight.sum(axis=0)
    return Q
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "refine-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_REFINE_SLIPS = {
    (0.9996, 0.9982, 0.9990): "a cell counts itself: the offset (0, 0) is no pair, it only counts in D",
    (0.9991, 0.9986, 0.9278): "the offset (0, 0) is missing in D",
    (0.9973, 0.9960, 0.9452): "nothing is normalised: divide by the roots of D",
    (0.9443, 0.8695, 0.7624): "you divide by the cell's own D: by the root of its own and the root of its neighbour's",
    (0.7774, 0.5552, 0.5788): "the square roots are missing: divide by sqrt(D_i D_j)",
    (0.9873, 0.9686, 0.8743): "the root of the neighbour's D is missing: shift it as you shift Q",
    (0.7836, 0.5872, 0.5396): "neighbours beyond the border count in D: their K is 0",
    (0.8520, 0.0400, 0.4658): "different labels are rewarded: being unlike the others must lower the probability",
    (0.6273, 0.6805, 0.5732): "that is one update: do UPDATES of them",
    (0.0149, 0.0286, 0.0979): "the sign of log_g is swapped: phi is -log g",
    (0.9999, 1.0000, 0.9921): "each update starts from log Q: the cells' own opinion is log g, in every update",
    (0.3046, 0.6406, 0.3577): "the network's opinion log_g is missing in the update",
    (0.9479, 0.8306, 0.7499): "you start from equal probabilities: start from Q = g",
    (0.7718, 0.5432, 0.5989): "both kernels share one D: each has its own",
    (0.9610, 0.8794, 0.8392): "SIGMA_ALPHA and SIGMA_GAMMA are swapped",
    (0.9652, 0.9207, 0.7998): "the widths aren't squared",
    (0.9899, 0.9754, 0.9778): "the states are missing in the first kernel",
    (0.7349, 0.4939, 0.5000): "the second kernel is missing",
    (0.7919, 0.5808, 0.6671): "the first kernel is missing",
    (0.7083, 0.3765, 0.5000): "a cell hears only from one side: use the offsets on both sides",
    (0.9220, 0.8858, 0.6809): "only the nearest neighbours count: go up to REACH",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "refine-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    g = np.array([[[0.7, 0.3, 0.5]], [[0.2, 0.6, 0.1]], [[0.1, 0.1, 0.4]]])  # three classes, one row of three cells
    o = np.array([[[0.8, 0.9, 0.1]], [[0.1, 0.0, 0.7]], [[0.0, 0.1, 0.1]], [[0.1, 0.0, 0.1]]])  # FREE, FREE, STATIC
    log_g = np.log(g)
    got = answer_array(refine(log_g, o), "refine")
    assert np.array_equal(log_g, np.log(g)), "refine changed its argument `log_g`: make a new array"
    assert got.shape == (3, 1, 3), f"expected the shape of log_g, (3, 1, 3), got {got.shape}"
    assert np.isfinite(got).all(), (
        "a result isn't finite: did you divide by a sum of a neighbour beyond the border, which is 0?"
    )
    assert np.allclose(got.sum(axis=0), 1), "the classes of each cell must sum to 1, over axis 0"
    _explain("class 0 has, in the three cells,", got[0, 0], _REFINE_SLIPS, atol=5e-4)
    np.testing.assert_allclose(got[0, 0], [0.9458, 0.8850, 0.7536], atol=1e-4, err_msg="class 0 in the three cells")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_refine(refine)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## See it on the sample drive (no points)
#
# Your `refine` is a stage of the whole system. Run this in a new cell; it writes the first cell of this notebook, the setup, and your function into a file:
#
# ```python
# import inspect
# from pathlib import Path
#
# setup = next(text for text in In if "REACH, UPDATES" in text and "def shifted" in text)
# Path("my_stages.py").write_text(setup + "\n\n" + inspect.getsource(refine))
# ```
#
# Then, in a terminal in the same folder, `semgrid-edu demo --stages my_stages.py` runs the system with your CRF and with the package's, and shows both side by side. Yours takes a second or
# two per frame. Exercise 11 makes it fast.

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# A colleague refines a map with mean field at strong weights. In one cell road goes from 0.55 to 0.998, and he writes: "The CRF is now 99.8 % sure, so the vehicle may drive there." To show how
# good the approximation is, he adds: "KL(Q || P) is -3.1." What is wrong with each of the two sentences? Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "how-sure", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# Mean field treats the cells as independent. Above the critical coupling it picks a side: independent cells can't say "we all agree, but we don't know on what", so each becomes nearly certain,
# while the exact marginal may still be close to one half. The 0.998 therefore says that the neighbours agree, not that road is 99.8 % probable; as a label it may be useful, as a probability it
# isn't calibrated. KL is never negative. A negative number means that log Z was left out (then it is the free energy, of which only differences count), that pairs were counted wrongly, or
# that cells were paired with themselves. One point for "too sure, picks a side", one for "never negative, log Z or double counting".

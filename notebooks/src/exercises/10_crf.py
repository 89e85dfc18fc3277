# %% [markdown]
# # Exercise 10: a CRF of your own
#
# Seven small functions, the last of which refines the map of the sample drive, and one question to answer in words. About 100 minutes.
# The lecture is [10: the CRF by hand](../10_crf.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | the price of a pair, equation (4) | 2 |
# | 2 | energy, and exact marginals by enumeration | 2 + 3 |
# | 3 | one mean-field update of all cells | 2 + 1 |
# | 4 | the free energy | 2 + 1 |
# | 5 | normalisation, and a CRF that refines a map | 1 + 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong: the cell `slips` above it lists what usual mistakes give. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.
#
# In tasks 1 to 4 the N cells are counted from 0 to N - 1, wherever they lie. `phi`, shape `(C, N)`, holds the price of each class in each cell, $\phi_u$ of equation (3). `k`, shape
# `(N, N)`, holds the price of each pair: it is symmetric, and its diagonal may hold any numbers. A cell is no pair with itself, so **the diagonal must never count**. Arguments are never
# changed.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings
from itertools import product

import numpy as np

from semgrid_edu.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does

W1, W2 = 4.0, 3.0  # the last task: weights, widths (cells, probability, cells), reach (cells) and number of updates
SIGMA_ALPHA, SIGMA_BETA, SIGMA_GAMMA = 3.2, 0.2, 1.2
REACH, UPDATES = 6, 5


def shifted(maps, dr, dc):
    """Return maps (..., H, W) in which cell (r, c) holds what cell (r + dr, c + dc) held; 0 from beyond the border.

    Offsets up to REACH are allowed.
    """
    H, W = maps.shape[-2:]
    padded = np.pad(maps, [(0, 0)] * (maps.ndim - 2) + [(REACH, REACH)] * 2)
    return padded[..., REACH + dr : REACH + dr + H, REACH + dc : REACH + dc + W]


# %% nbgrader={"grade": false, "grade_id": "explain", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _explain(what, got, slips, atol=1e-4):
    """Stop with a hint when `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.allclose(got, slip, atol=atol), f"{what} {np.round(got, 4)}: {hint}"


# %% [markdown]
# ## Task 1: the price of a pair (2 points)
#
# Two cells have the places `r_i` and `r_j`, (row, column), and the occupancy probabilities `o_i` and `o_j`, four numbers each; all are arrays. What do different labels in
# them cost? With the weights `w1`, `w2` and the widths `alpha`, `beta`, `gamma`
#
# $$ k_{ij} = w_1 \exp\!\Big(\!-\frac{|r_i - r_j|^2}{2\sigma_\alpha^2} - \frac{|o_i - o_j|^2}{2\sigma_\beta^2}\Big) + w_2 \exp\!\Big(\!-\frac{|r_i - r_j|^2}{2\sigma_\gamma^2}\Big) $$
#
# Complete `pair_price`: it returns one number.


# %% nbgrader={"grade": false, "grade_id": "pair-price", "locked": false, "schema_version": 3, "solution": true, "task": false}
def pair_price(r_i, r_j, o_i, o_j, w1, w2, alpha, beta, gamma):
    """Return k_ij, the bracket of equation (4)."""
    ### BEGIN SOLUTION
    apart = np.sum((r_i - r_j) ** 2)
    unlike = np.sum((o_i - o_j) ** 2)
    bilateral = np.exp(-apart / (2 * alpha**2) - unlike / (2 * beta**2))
    return w1 * bilateral + w2 * np.exp(-apart / (2 * gamma**2))
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "pair-price-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_PRICE_SLIPS = {
    2.2828: "the widths aren't squared: divide by 2 sigma^2",
    1.3229: "the 2 is missing: divide by 2 sigma^2",
    4.5284: "you square the 2 as well: divide by 2 * sigma**2, not by (2 * sigma)**2",
    0.0001: "`x / 2 * sigma**2` multiplies by the width: write x / (2 * sigma**2)",
    2.5499: "the distances aren't squared: no square root, the sum of the squares itself stands in the exponent",
    17.3573: "the minus signs are missing: what is farther apart must cost less",
    8.3489: "the minus sign of the second part of the exponent is missing: unlike states must cost less",
    0.8756: "the weights are missing",
    3.1621: "the weights are swapped: w1 belongs to the term with the states",
    6.4330: "place and state of the first term belong into one exponent, so that both must fit: exp(-a - b), not exp(-a) + exp(-b)",
    4.6356: "the states are missing in the first term",
    1.3614: "that is the first term alone: add the spatial one",
    2.0829: "the second term ignores the states: only the places count there",
    3.2344: "alpha and gamma are swapped: alpha belongs to the first term",
    1.1101: "square each difference first, then sum: (1 + 2)^2 isn't 1^2 + 2^2",
    5.0451: "that is a mean of squares: take their sum",
    2.1861: "the two terms are multiplied: add them",
}


# %% nbgrader={"grade": true, "grade_id": "pair-price-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: |r_i - r_j|^2 = 1 + 4 = 5 and |o_i - o_j|^2 = 0.04 + 0.04 + 0.01 + 0.01 = 0.1, so 4 exp(-5/18 - 0.8) + 3 exp(-5/8) = 2.967.
    places, states = np.array([[3.0, 1.0], [4.0, 3.0]]), np.array([[0.7, 0.2, 0.1, 0.0], [0.5, 0.4, 0.0, 0.1]])
    got = pair_price(*places, *states, w1=4, w2=3, alpha=3, beta=0.25, gamma=2)
    got = answer_array(got, "pair_price")
    assert got.size == 1, f"expected one number, got an array of shape {got.shape}: sum the squares of the differences"
    _explain("the price is", got.item(), _PRICE_SLIPS)
    np.testing.assert_allclose(got, 2.9672, atol=1e-4, err_msg="4 exp(-5/18 - 0.8) + 3 exp(-5/8)")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_pair_price(pair_price)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: energy, and exact marginals (2 + 3 points)
#
# `labels`, shape `(N,)`, holds a class for each cell. With equation (3)
#
# $$ E(x) = \sum_i \phi_u(x_i) + \sum_{i<j} [x_i \neq x_j]\, k_{ij} $$
#
# Complete `energy`: it returns one number.


# %% nbgrader={"grade": false, "grade_id": "energy", "locked": false, "schema_version": 3, "solution": true, "task": false}
def energy(labels, phi, k):
    """Return E(x) of one labelling."""
    ### BEGIN SOLUTION
    own = phi[labels, np.arange(len(labels))].sum()
    differ = labels[:, None] != labels
    return own + (k * differ).sum() / 2
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "energy-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_ENERGY_SLIPS = {
    7.3: "each pair is counted twice, as (i, j) and as (j, i): sum over i < j only",
    3.2: "you charge the pairs that agree: different labels cost",
    39.2: "you charge the pairs that agree, and each cell with itself: different labels cost",
    21.2: "you charge the pairs that agree, and each cell with itself: different labels cost",
    42.0: "all pairs are charged, each cell with itself too: only different labels cost",
    24.0: "all pairs are charged, each cell with itself too: only different labels cost",
    4.0: "only cells that follow one another are charged: every pair counts, this CRF is fully connected",
    6.0: "all pairs are charged: only those with different labels cost",
    1.7: "the pairs are missing",
    2.8: "the prices of the cells are missing",
    -1.1: "the pairs are subtracted: different labels cost, so add",
    0.0111: "that is exp(-E): the energy itself is asked for",
    5.4: "class and cell are swapped: phi[c, i] is the price of class c in cell i",
    19.8: "you sum the prices of all classes: each cell pays for its own label only",
    7.1: "you multiply by the difference of the class numbers: they are names, a pair differs or it doesn't",
    1.1: "the prices of the cells are subtracted: add them",
    3.225: "that is a mean over the cells: take the sum",
    7.8207: "`phi` holds prices already, -log of probabilities: don't take the logarithm again",
}


# %% nbgrader={"grade": true, "grade_id": "energy-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    phi = np.array([[0.1, 2.0, 0.3, 1.4], [1.9, 0.4, 1.5, 0.2], [1.2, 0.7, 0.6, 2.2], [0.8, 1.1, 1.7, 0.9]])
    k = np.array([[9, 0.5, 1.5, 0.3], [0.5, 9, 0.7, 0.2], [1.5, 0.7, 9, 1.1], [0.3, 0.2, 1.1, 9]])
    # By hand: 0.1 + 1.1 + 0.3 + 0.2 = 1.7 for the cells. Only cells 0 and 2 agree, so five pairs: 0.5 + 0.3 + 0.7 + 0.2 + 1.1 = 2.8.
    got = answer_array(energy(np.array([0, 3, 0, 1]), phi, k), "energy")
    assert got.size == 1, f"expected one number, got an array of shape {got.shape}"
    _explain("the energy is", got.item(), _ENERGY_SLIPS, atol=1e-3)
    np.testing.assert_allclose(got, 4.5, err_msg="1.7 for the cells and 2.8 for five pairs")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_energy(energy)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# Every labelling has the probability $P(x) = e^{-E(x)} / Z$. Complete `marginals`: it returns, in an array `(C, N)`, the probability of each class in each cell, summed over all $C^N$
# labellings. `product(range(C), repeat=N)` yields them one by one. N is at most 6 in the tests.


# %% nbgrader={"grade": false, "grade_id": "marginals", "locked": false, "schema_version": 3, "solution": true, "task": false}
def marginals(phi, k):
    """Return the exact probability of each class in each cell, (C, N)."""
    ### BEGIN SOLUTION
    C, N = phi.shape
    cells, total = np.arange(N), np.zeros((C, N))
    for x in product(range(C), repeat=N):
        x = np.array(x)
        E = phi[x, cells].sum() + (k * (x[:, None] != x)).sum() / 2
        total[x, cells] += np.exp(-E)
    return total / total.sum(axis=0)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "marginals-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
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


# %% nbgrader={"grade": true, "grade_id": "marginals-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    phi = np.array([[0.2, 0.9, 1.2], [1.6, 0.4, 0.3]])
    k = np.array([[0, 0.8, 0.3], [0.8, 0, 1.1], [0.3, 1.1, 0]])
    got = answer_array(marginals(phi, k), "marginals")
    assert got.shape == (2, 3), f"expected a row per class and a column per cell, (2, 3), got {got.shape}"
    _explain("class 0 has, in the three cells,", got[0], _MARGINAL_SLIPS, atol=1.1e-3)
    np.testing.assert_allclose(got[0], [0.7156, 0.3975, 0.3192], atol=1e-4, err_msg="class 0 in the three cells")
    np.testing.assert_allclose(got.sum(axis=0), 1, err_msg="the classes of each cell sum to 1")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_marginals(marginals)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: one mean-field update (2 + 1 points)
#
# `Q`, shape `(C, N)`, holds a distribution for each cell. Update **all cells at once**, so that each of them uses the `Q` that was given:
#
# $$ Q_i'(l) = \frac{1}{Z_i} \exp\!\Big(\!-\phi_u(l) - \sum_{j \neq i} k_{ij}\,\big(1 - Q_j(l)\big)\Big) $$
#
# Complete `update`: it returns the new `Q`. For one more point: prices may be thousands, where $e^{-1000}$ is less than a computer holds, and infinite for an impossible class. You may
# add any number to all prices of a cell without changing its result.


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(Q, phi, k):
    """Return Q after one update of all cells at once, (C, N)."""
    ### BEGIN SOLUTION
    others = k - np.diag(np.diag(k))
    price = phi + (1 - Q) @ others
    weight = np.exp(price.min(axis=0) - price)
    return weight / weight.sum(axis=0)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "update-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
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


# %% nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    Q = np.array([[0.6, 0.2, 0.3], [0.3, 0.5, 0.1], [0.1, 0.3, 0.6]])
    phi = np.array([[0.4, 1.6, 1.1], [1.3, 0.7, 2.0], [1.9, 1.0, 0.5]])
    k = np.array([[5, 0.8, 0.3], [0.8, 5, 1.4], [0.3, 1.4, 5]])
    before = Q.copy()
    got = answer_array(update(Q, phi, k), "update")
    assert np.array_equal(Q, before), "update changed its argument `Q`: make a new array, all cells use the old one"
    assert got.shape == (3, 3), f"expected the shape of Q, (3, 3), got {got.shape}"
    # By hand, cell 0: prices 0.4 + 0.8 * 0.8 + 0.3 * 0.7 = 1.25, 1.3 + 0.8 * 0.5 + 0.3 * 0.9 = 1.97, 1.9 + 0.8 * 0.7 + 0.3 * 0.4 = 2.58.
    _explain("class 0 has, in the three cells,", got[0], _UPDATE_SLIPS, atol=1.1e-3)
    by_hand = [[0.5710, 0.2314, 0.2968], [0.2779, 0.3384, 0.1678], [0.1510, 0.4302, 0.5354]]
    np.testing.assert_allclose(got, by_hand, atol=1e-4, err_msg="a row per class, a column per cell")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "update-limits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Every class is dear, and class 1 of cell 1 is impossible; then the same with 2000 less for each.
    Q, k, less = np.full((3, 2), 1 / 3), np.zeros((2, 2)), np.array([[0.0, 3.0], [1.0, np.inf], [7000.0, 3.0]])
    got = answer_array(update(Q.copy(), less + 2000, k.copy()), "update")
    assert np.isfinite(got).all(), (
        "a result isn't finite: exp(-2000) is 0 on a computer, so subtract each cell's smallest price first"
    )
    wanted = answer_array(update(Q.copy(), less, k.copy()), "update")
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
# ## Task 4: the free energy (2 + 1 points)
#
# For independent cells, with each pair counted once,
#
# $$ F(Q) = \sum_i \sum_l Q_i(l)\,\phi_u(l) + \sum_{i<j} k_{ij} \Big(1 - \sum_l Q_i(l)\,Q_j(l)\Big) + \sum_i \sum_l Q_i(l) \log Q_i(l) $$
#
# Complete `free_energy`: it returns one number, in nats. For one more point: `Q` may be 0, where $0 \log 0$ counts as 0; and if the class is impossible there, $0 \cdot \infty$ counts as 0 too.


# %% nbgrader={"grade": false, "grade_id": "free-energy", "locked": false, "schema_version": 3, "solution": true, "task": false}
def free_energy(Q, phi, k):
    """Return F(Q)."""
    ### BEGIN SOLUTION
    possible = Q > 0
    mean_price = (Q[possible] * phi[possible]).sum()
    disagree = np.triu(k * (1 - Q.T @ Q), 1).sum()
    return mean_price + disagree + (Q[possible] * np.log(Q[possible])).sum()
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "free-energy-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
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


# %% nbgrader={"grade": true, "grade_id": "free-energy-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    Q, phi, k = np.array([[0.8, 0.3], [0.2, 0.7]]), np.array([[0.5, 1.2], [1.4, 0.3]]), np.array([[2, 0.9], [0.9, 2]])
    # By hand: prices 0.40 + 0.28 + 0.36 + 0.21 = 1.25; the pair agrees with 0.24 + 0.14 = 0.38, so 0.9 * 0.62 = 0.558; minus an entropy of 1.1113.
    got = answer_array(free_energy(Q, phi, k), "free_energy")
    assert got.size == 1, f"expected one number, got an array of shape {got.shape}"
    _explain("F is", got.item(), _FREE_SLIPS)
    np.testing.assert_allclose(got, 0.6967, atol=1e-4, err_msg="1.25 + 0.558 - 1.1113")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_free_energy(free_energy)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "free-energy-limits-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Class 1 of cell 0 is impossible, and its Q is 0; then its Q is nearly 0, and its price 5.
    k = np.array([[2, 0.9], [0.9, 2]])
    at, near = np.array([[1.0, 0.5], [0.0, 0.5]]), np.array([[1 - 1e-9, 0.5], [1e-9, 0.5]])
    got = answer_array(free_energy(at, np.array([[0.5, 1.2], [np.inf, 0.3]]), k.copy()), "free_energy")
    assert not np.isnan(got).any(), "F is NaN: 0 * log 0 and 0 * inf count as 0; leave out what has probability 0"
    assert np.isfinite(got).all(), f"F is {got}, but the impossible class has probability 0 and costs nothing"
    nearly = answer_array(free_energy(near, np.array([[0.5, 1.2], [5.0, 0.3]]), k.copy()), "free_energy")
    hint = "a probability of 0 must give what a tiny one gives"
    np.testing.assert_allclose(got, nearly, atol=1e-4, err_msg=hint)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_free_energy_limits(free_energy)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: normalisation, and a CRF of your own (1 + 3 points)
#
# `K` is one kernel, `(N, N)`, symmetric, with ones on its diagonal. Complete `normalise`: it returns $K_{ij} / \sqrt{D_i D_j}$, where $D_i$ is the sum of row $i$, the diagonal included.


# %% nbgrader={"grade": false, "grade_id": "normalise", "locked": false, "schema_version": 3, "solution": true, "task": false}
def normalise(K):
    """Return D^-1/2 K D^-1/2, (N, N)."""
    ### BEGIN SOLUTION
    root = np.sqrt(K.sum(axis=1))
    return K / root[:, None] / root
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "normalise-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_NORMALISE_SLIPS = {
    0.1858: "the square roots are missing: divide by sqrt(D_i D_j)",
    0.3529: "you divide each row by its sum: then k_ij isn't k_ji; divide by the root of both sums",
    0.3158: "you divide each column by its sum: then k_ij isn't k_ji; divide by the root of both sums",
    0.4602: "you divide by one root only: one for the row and one for the column",
    1.0783: "you multiply by the roots: divide",
    0.6000: "nothing has changed: divide by sqrt(D_i D_j)",
    0.1200: "you divide by the sum of all entries: each cell has its own sum",
    0.7559: "the diagonal is missing in the row sums: it counts in D",
    0.5126: "those are lengths of rows (roots of sums of squares): D is a plain sum",
    0.4257: "those are lengths of rows (roots of sums of squares): D is a plain sum",
    1.0015: "you divide by means: D is a sum",
}


# %% nbgrader={"grade": true, "grade_id": "normalise-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Row sums 1.7, 1.9, 1.4: cells 0 and 1 get 0.6 / sqrt(1.7 * 1.9) = 0.334.
    K = np.array([[1, 0.6, 0.1], [0.6, 1, 0.3], [0.1, 0.3, 1]])
    before = K.copy()
    got = answer_array(normalise(K), "normalise")
    assert np.array_equal(K, before), "normalise changed its argument: make a new array"
    assert got.shape == (3, 3), f"expected the shape of K, (3, 3), got {got.shape}"
    _explain("cells 0 and 1 get", got[0, 1], _NORMALISE_SLIPS)
    by_hand = [[0.5882, 0.3338, 0.0648], [0.3338, 0.5263, 0.1839], [0.0648, 0.1839, 0.7143]]
    np.testing.assert_allclose(got, by_hand, atol=1e-4, err_msg="K_ij / sqrt(D_i D_j)")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import crf

    complaint = crf.check_normalise(normalise)
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
# 3. Start with $Q = g$ and do `UPDATES` updates as in task 3, all cells at once. The offset (0, 0) is no pair.
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


# %% nbgrader={"grade": false, "grade_id": "refine-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
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


# %% nbgrader={"grade": true, "grade_id": "refine-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
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

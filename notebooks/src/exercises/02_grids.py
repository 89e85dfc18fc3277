# %% [markdown]
# # Exercise 02: occupancy grids
#
# Five small functions that together are an occupancy grid, and one question to answer in words. About 75 minutes.
# The lecture is [02: occupancy grids](../02_grids.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | log-odds, there and back | 1 + 1 |
# | 2 | one scan in every cell | 2 + 1 |
# | 3 | the prior counts once | 2 + 1 |
# | 4 | how long is the smear? | 2 |
# | 5 | what one beam says | 3 + 1 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.answers import answer_array, answer_number
from semgrid_edu.grid import GridSpec

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.

# %% [markdown]
# ## Task 1: log-odds, there and back (1 + 1 points)
#
# $$ L = \log \frac{p}{1 - p} $$
#
# Complete `log_odds` and its inverse, `probability`. Both take a number or an array; the logarithm is the natural one. For the way back, solve the
# equation for $p$ on paper. A cell that was hit a hundred times has a large $L$: `probability(1000.0)` must still be a number, so look at what your
# formula does with $e^{1000}$.


# %% nbgrader={"grade": false, "grade_id": "log-odds", "locked": false, "schema_version": 3, "solution": true, "task": false}
def log_odds(p):
    """Return the log-odds of a probability."""
    ### BEGIN SOLUTION
    return np.log(p / (1 - p))
    ### END SOLUTION


def probability(L):
    """Return the probability that has these log-odds."""
    ### BEGIN SOLUTION
    return 1 / (1 + np.exp(-L))
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "log-odds-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: 0.8 to 0.2 is 4 to 1, and log 4 = 1.386.
    got = answer_number(log_odds(0.8), "log_odds")
    slips = {
        4.0: "those are the odds: take their logarithm",
        -1.386: "the sign is swapped: what is more probable than not has positive log-odds, so p stands above 1 - p",
        0.602: "that is the logarithm to base 10: take the natural one, np.log",
        2.0: "that is the logarithm to base 2: take the natural one, np.log",
        -0.223: "that is log p: log-odds compare p with 1 - p",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=2e-3), f"log_odds(0.8) = {got:.3f}: {hint}"
    assert np.isclose(got, np.log(4)), f"log_odds(0.8): expected log 4 = 1.386, got {got:.3f}"
    got = answer_array(log_odds(np.array([[0.2, 0.5], [0.8, 0.9]])), "log_odds")
    assert got.shape == (2, 2), f"a (2, 2) array goes in, a (2, 2) array must come out, got shape {got.shape}"
    np.testing.assert_allclose(got, [[-1.386, 0], [1.386, 2.197]], atol=1e-3, err_msg="log-odds of 0.2, 0.5, 0.8, 0.9")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_log_odds(log_odds)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "probability-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_number(probability(np.log(4)), "probability")
    slips = {
        4.0: "those are the odds, and no probability is above 1: p = odds / (1 + odds)",
        0.2: "that is 1 - p: larger L means more probable",
        0.96: "you raise 10 to the power L: the logarithm was the natural one",
        0.882: "that is tanh: it runs from -1 to 1, a probability from 0 to 1",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=2e-3), f"probability(1.386) = {got:.3f}: {hint}"
    assert np.isclose(got, 0.8), f"probability(1.386): the way back must give 0.8, got {got:.3f}"
    got = answer_array(probability(np.array([-2.197, 0.0, 2.197])), "probability")
    np.testing.assert_allclose(got, [0.1, 0.5, 0.9], atol=1e-3, err_msg="L = -2.197, 0, 2.197")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_probability(probability)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: one scan in every cell (2 + 1 points)
#
# `L` holds the log-odds of every cell, `(H, W)`. A scan gives two more arrays of that shape: `occupied` is $P(z \mid \text{occupied})$ and `free` is
# $P(z \mid \text{free})$. Bayes' rule in log-odds is one addition. For one more point: after it, no cell may lie outside the range from `L_min` to
# `L_max`.
#
# Complete `update`: it returns the new log-odds, and leaves its arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(L, occupied, free, L_min, L_max):
    """Return the log-odds (H, W) after one scan."""
    ### BEGIN SOLUTION
    return np.clip(L + np.log(occupied / free), L_min, L_max)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    L = np.array([[0.0, 1.0, 0.9], [0.4, 0.0, 0.5]])
    occupied, free = np.full((2, 3), 0.6), np.full((2, 3), 0.6)  # the scan says nothing ...
    occupied[0, 2], free[0, 2] = 0.3, 0.7  # ... but that a beam passed cell (0, 2) ...
    occupied[1, 2], free[1, 2] = 0.9, 0.05  # ... and came back from cell (1, 2)
    before = L.copy()
    got = answer_array(update(L, occupied, free, L_min=-2.0, L_max=3.5), "update")
    assert np.array_equal(L, before), "update changed its argument `L`: make a new array (no +=)"
    assert got.shape == (2, 3), f"expected the shape of L, (2, 3), got {got.shape}"
    assert not np.allclose(got, -2.0), "every cell is at L_min: clip takes the lower limit first, then the upper one"
    slips = {  # of cell (1, 2): by hand 0.5 + log(0.9 / 0.05) = 0.5 + 2.890 = 3.390
        -2.0: "the sign is swapped: a hit makes a cell more occupied, so P(z | occupied) stands above",
        -2.39: "the sign is swapped: a hit makes a cell more occupied, so P(z | occupied) stands above",
        1.755: "that is the logarithm to base 10: take the natural one, np.log",
        1.350: "you add the difference of the two likelihoods: odds are multiplied by their ratio, so add its logarithm",
        0.395: "you add log P(z | occupied) alone: how likely was that return if the cell is free?",
        2.697: "you take P(z | occupied) for P(occupied | z): a scan gives two likelihoods, compare them",
        2.890: "the old belief got lost: add to L",
        1.445: "you multiply: with logarithms, Bayes' rule is an addition",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got[1, 2], slip, atol=2e-3), f"cell (1, 2) is at {got[1, 2]:.2f}: {hint}"
    by_hand = "a passed cell falls by 0.847, one that was hit rises by 2.89"
    np.testing.assert_allclose(got, [[0, 1, 0.053], [0.4, 0, 3.390]], atol=1e-3, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "clamp-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    passed, hit = (0.3, 0.7), (0.9, 0.05)
    L = np.array([[3.0, -1.5, 0.0, 4.0]])  # the last cell got above the limit before there was one
    occupied, free = np.array([hit, passed, hit, passed]).T[:, None]
    got = answer_array(update(L.copy(), occupied.copy(), free.copy(), L_min=-2.0, L_max=3.5), "update")
    wide = answer_array(update(L.copy(), occupied, free, L_min=-50.0, L_max=50.0), "update")  # your sums
    assert got.shape == wide.shape == (1, 4), f"expected the shape of L, (1, 4), got {got.shape}"
    got, wide = got[0], wide[0]
    assert not np.isclose(got[3], wide[3] - 0.5, atol=1e-3), (
        f"cell (0, 3) fell from 4 to {got[3]:.2f}: you clamp before you add, but the sum is what must stay in range"
    )
    assert got.max() < 3.51, f"cell (0, {got.argmax()}) is now at {got.max():.2f}, above L_max = 3.5: clamp the sum"
    assert got.min() > -2.01, (
        f"cell (0, {got.argmin()}) is now at {got.min():.2f}, below L_min = -2: clamp that side too"
    )
    by_hand = "what lies within the limits stays; sums by hand: 5.89, -2.35, 2.89, 3.15"
    np.testing.assert_allclose(got, np.clip(wide, -2, 3.5), atol=1e-3, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_clamp(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: the prior counts once (2 + 1 points)
#
# Not every sensor model speaks in likelihoods. `posteriors` has the shape `(K, H, W)`: for each of K scans, what that scan alone makes of each cell,
# $P(\text{occupied} \mid z_k)$. Every one of them was made from the same `prior`, a number: a scan that says nothing gives the prior back. So the prior is
# in each of them, and you want it in the result once:
#
# $$ L = L_0 + \sum_{k=1}^K (L_k - L_0) $$
#
# Complete `fuse`: it returns the **probability** of each cell after all K scans, `(H, W)`, with $L_0$ the log-odds of the prior and $L_k$ those of scan k.
# Your two functions of task 1 may help. For one more point: a parked car is scanned thousands of times before it drives off, and so many
# scans must not end in a zero or an infinity that no later scan can take back.


# %% nbgrader={"grade": false, "grade_id": "fuse", "locked": false, "schema_version": 3, "solution": true, "task": false}
def fuse(prior, posteriors):
    """Return P(occupied | all scans) of each cell, (H, W)."""
    ### BEGIN SOLUTION
    L_0 = np.log(prior / (1 - prior))
    L = L_0 + (np.log(posteriors / (1 - posteriors)) - L_0).sum(axis=0)
    return 1 / (1 + np.exp(-L))
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "fuse-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Three scans of two cells, prior 0.2. Cell (0, 0): none says anything. Cell (0, 1): two make it 0.5, the third says nothing.
    got = answer_array(fuse(0.2, np.array([[[0.2, 0.5]], [[0.2, 0.5]], [[0.2, 0.2]]])), "fuse")
    assert got.shape == (1, 2), f"expected one number a cell, (1, 2), got {got.shape}: sum over the scans only"
    slips = {
        0.0154: "the prior is counted three times, once with each scan: subtract L_0 from each L_k",
        0.0039: "the prior is counted four times: subtract L_0 from each L_k before you add it once",
        0.0588: "the prior is counted twice: subtract L_0 from each L_k, not from their sum",
        0.5: "the prior got lost: after the subtractions add L_0 once",
        0.8: "the prior works the wrong way round: subtract L_0 from each L_k, then add it once",
        0.008: "you multiply probabilities: what P(free | z) says must count too, so work with odds",
        -1.386: "those are log-odds: give the probability back",
    }
    silent, twice = got[0]
    for slip, hint in slips.items():
        was = f"nothing was seen in cell (0, 0), yet 0.2 became {silent:.4f}"
        assert not np.isclose(silent, slip, atol=6e-4), f"{was}: {hint}"
    slips = {
        0.4: "that is the mean, but two scans that agree are worth more than one",
        0.5: "two scans that agree are worth more than the best of them",
        0.2: "that is the prior: the last scan says nothing, but the two before it did",
    }
    for slip, hint in slips.items():
        assert not np.isclose(twice, slip, atol=6e-4), f"cell (0, 1) is at {twice:.1f}: {hint}"
    np.testing.assert_allclose(got, [[0.2, 0.8]], atol=1e-3, err_msg="by hand: odds 1/4 * 4 * 4 = 4, so 0.8")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_fuse(fuse)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "fuse-many-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # A thousand scans say 0.9, then a thousand say 0.1, and the last one 0.8. The prior is 0.5: all but the last cancel.
    posteriors = np.concatenate([np.full(1000, 0.9), np.full(1000, 0.1), [0.8]]).reshape(-1, 1, 1)
    got, last = (answer_array(fuse(0.5, p), "fuse") for p in (posteriors.copy(), posteriors[-1:].copy()))
    assert np.isfinite(got).all(), "NaN after 2001 scans: so long a product ends at 0 or infinity; add logarithms"
    stuck = "odds of 9 ** 1000 are infinite, and a probability of exactly 0 or 1 never comes back; add logarithms"
    assert np.allclose(got, last, atol=1e-6), f"2000 scans cancel, yet {last.ravel()} became {got.ravel()}: {stuck}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_fuse_many(fuse)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: how long is the smear? (2 points)
#
# A car drives away from you at `speed` (m/s) and is scanned every `dt` seconds. While it covers a cell, the cell's log-odds are at the clamp, `L_max`. As
# soon as it has left the cell, every scan passes it: with $P(z \mid \text{occupied})$ = `occupied` and $P(z \mid \text{free})$ = `free`. A cell is called
# occupied while $L > 0$.
#
# Complete `smear`: it returns two numbers. First, how many passes a cell survives: it is still occupied after so many, and after one more it isn't. Second,
# the length of the tail that the car drags along, in metres: the car goes on by `speed * dt` from one pass to the next.


# %% nbgrader={"grade": false, "grade_id": "smear", "locked": false, "schema_version": 3, "solution": true, "task": false}
def smear(speed, dt, L_max, occupied, free):
    """Return the passes that a left cell survives, and the length of the tail in metres."""
    ### BEGIN SOLUTION
    passes, L = 0, L_max
    while L + np.log(occupied / free) > 0:
        L = L + np.log(occupied / free)
        passes += 1
    return passes, passes * speed * dt
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "smear-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # A pass is worth log(0.3 / 0.8) = -0.98. By hand: 4, 3.02, 2.04, 1.06, 0.08, then -0.90. The car does 12 m/s: 1.2 m a scan.
    got = answer_array(smear(speed=12.0, dt=0.1, L_max=4.0, occupied=0.3, free=0.8), "smear")
    assert got.size == 2, f"return two numbers, passes and metres; got {got}"
    passes, metres = got.ravel()
    assert np.isclose(passes, np.round(passes)), f"passes come one by one, got {passes:.3f}: count whole ones"
    slips = {
        5: "after the fifth the cell is free, at -0.90: count the passes that it survives",
        3: "you take log P(z | occupied) alone, 1.20 a pass: what a pass is worth is log(0.3 / 0.8)",
        17: "you take log P(z | free) alone, 0.22 a pass: what a pass is worth is log(0.3 / 0.8)",
        9: "that is the logarithm to base 10, 0.43 a pass: take the natural one",
        10: "you subtract the ratio 0.3 / 0.8 itself: take its logarithm",
        13: "you subtract P(z | occupied) itself: what a pass is worth is log(0.3 / 0.8)",
        7: "you subtract the difference 0.8 - 0.3: what a pass is worth is log(0.3 / 0.8)",
    }
    assert passes not in slips, f"{passes:g} passes: {slips[passes]}"
    assert passes == 4, f"expected 4 passes, got {passes:g}"
    assert not np.isclose(metres, 48), "48 m: you forgot dt, the car does 1.2 m from one pass to the next"
    assert not np.isclose(metres, 6), "6 m: four passes are survived, so the tail is four steps of 1.2 m"
    np.testing.assert_allclose(metres, 4.8, err_msg="four passes, 1.2 m each")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_smear(smear)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: what one beam says (3 + 1 points)
#
# A beam starts at the origin, x = y = 0, and comes back from an obstacle at (`x`, `y`), metres. `spec` is a `GridSpec` as in exercise 00: forward up, row 0
# the farthest ahead, with `spec.x_max`, `spec.y_max`, `spec.cell`, `spec.shape`, and `spec.cells(xy)` for points `(N, 2)`.
#
# Complete `beam_evidence`: it returns an array of the grid's shape with what must be added to the log-odds: `L_hit` in the cell of the return, `L_pass` in
# **every** cell that the beam crosses before, 0 in all others. Where the beam only clips the corner of a cell, both answers are right. For one more point: a
# return from outside the grid counts as well. The beam passes all cells on its way to the border, and no cell is hit.


# %% nbgrader={"grade": false, "grade_id": "beam-evidence", "locked": false, "schema_version": 3, "solution": true, "task": false}
def beam_evidence(x, y, spec, L_hit, L_pass):
    """Return what one beam adds to the log-odds, (H, W)."""
    ### BEGIN SOLUTION
    evidence = np.zeros(spec.shape)
    along = np.linspace(0, 1, 20_000)[:, None] * np.array([x, y])
    rows, cols, inside = spec.cells(along)
    evidence[rows[inside], cols[inside]] = L_pass
    rows, cols, inside = spec.cells(np.array([[x, y]]))
    evidence[rows[inside], cols[inside]] = L_hit
    return evidence
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "beam-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    spec = GridSpec(x_min=-0.5, x_max=5.5, y_min=-4.5, y_max=4.5, cell=1)  # draw it, with the beam from cell (5, 4)
    got = answer_array(beam_evidence(3.8, 1.8, spec, L_hit=2.0, L_pass=-1.0), "beam_evidence")
    assert got.shape == (6, 9), f"expected one number a cell, shape (6, 9), got {got.shape}"
    assert got.max() > 0, "no cell is hit: the cell of the return is hit, whatever passes were counted in it"
    slips = {
        (2, 1): "row and column are swapped: rows count along x, columns along y",
        (1, 6): "y points left and column 0 is the leftmost: measure columns from y_max",
        (4, 2): "you count rows from the vehicle: row 0 is the farthest ahead, measure from x_max",
        (3, 2): "you count rows from the vehicle: row 0 is the farthest ahead, measure from x_max",
        (2, 3): "you round: a point belongs to the cell that it lies in (floor)",
    }
    hit = tuple(int(i) for i in np.unravel_index(np.argmax(got), got.shape))
    assert hit == (1, 2), f"the return is in cell (1, 2), you hit {hit}: {slips.get(hit, 'where is x = 3.8, y = 1.8?')}"
    assert got[1, 2] == 2, f"cell (1, 2) is at {got[1, 2]:g}: the beam ends in it, so it isn't passed: L_hit, once"
    assert got[0, 2] == 0, "cell (0, 2) lies behind the obstacle: the beam didn't get there, so nothing is known of it"
    assert got.min() < 0, "no cell is free: the beam passed every cell before the obstacle"
    assert got.min() == -1, f"a cell is at {got.min():g}: one beam passes a cell once, however often you look"
    hint = "steps of a whole cell, or one cell a row, leave out cells"
    for cell in ((5, 4), (4, 4), (4, 3), (3, 3), (2, 3), (2, 2)):
        assert got[cell] == -1, f"the beam crosses cell {cell} for more than 0.3 m, yet it isn't free: {hint}"
    assert (got != 0).sum() == 7, f"the beam crosses 7 cells, you have {(got != 0).sum()}: does it start at x = y = 0?"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_beam(beam_evidence)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "outside-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    spec = GridSpec(x_min=-0.5, x_max=5.5, y_min=-4.5, y_max=4.5, cell=1)
    got = answer_array(beam_evidence(9.5, 0.3, spec, L_hit=2.0, L_pass=-1.0), "beam_evidence")
    assert got.shape == (6, 9), f"expected one number a cell, shape (6, 9), got {got.shape}"
    hit = [tuple(cell) for cell in np.argwhere(got > 0).tolist()]
    assert not hit, (
        f"the return is 4 m beyond the grid, yet cell {hit[0]} is hit: an array's row -4 is the fourth from its end"
    )
    column = f"the beam passes column 4 from row 5 to row 0, got {got[:, 4].tolist()}"
    assert (got < 0).sum() >= 3, column
    short = answer_array(beam_evidence(5.2, 0.16, spec, L_hit=-1.0, L_pass=-1.0), "beam_evidence")
    by_hand = np.zeros((6, 9))
    by_hand[:, 4] = -1
    if np.array_equal(short, by_hand):  # a beam that is wrong within the grid has cost its points above
        assert (got[:, 4] == -1).all(), column
        assert (np.delete(got, 4, axis=1) == 0).all(), "the beam stays in column 4: in the grid y runs from 0 to 0.17 m"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_beam_outside(beam_evidence)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# To shorten the smear, a colleague lowers `L_max` from 3.5 to 0.5. What gets worse, and where on a street would you see it? And which smear does no choice
# of `L_max` remove? Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "shorter-smear", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# A low clamp makes the grid forget what it has gathered: whatever was hit ten times is worth no more than what was hit once, so one pass (-0.85) makes it free. What
# is seen only now and then flickers: thin poles between two beams, porous hedges and fences, the edges of cars. No clamp removes the tail that no beam
# passes: that of an oncoming car lies behind the car, in its shadow, and what has left the field of view is not seen again; log-odds change only where there is
# evidence, so only forgetting helps. One point for a cost with its place, one for the unseen tail.

# %% [markdown]
# # Exercise 02: occupancy grids
#
# First you do exactly what a grid does only roughly: three cells and one beam. Then you build a grid of your own, piece by piece, and let it drive down two
# streets. About 120 minutes. The lecture is [02: occupancy grids](../02_grids.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | three cells and one beam, exactly; what it costs to take cells as independent | 2 + 1 + 2 |
# | 2 | the prior counts once | 2 + 1 |
# | 3 | a clamp for a given smear | 2 |
# | 4 | one beam through a grid | 3 + 1 |
# | 5 | put together: your own grid on two streets | 2 + 1 + 2 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import matplotlib.pyplot as plt
import numpy as np

from semgrid_edu import plotting
from semgrid_edu.workshop.course.answers import answer_array, answer_number
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import PlanarMotion, SensorModel, scan_evidence
from semgrid_edu.occupancy.planar_motion import look_up, map_around, scroll

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.

# %% [markdown]
# ## Task 1: three cells and one beam, exactly (2 + 1 + 2 points)
#
# A beam flies along three cells, the nearest first. Before the beam, they are occupied with the probabilities `prior`, (3,), independently of each other. A free
# cell that the beam reaches reflects it with probability `reflect[0]`, an occupied one with `reflect[1]`; otherwise the beam flies on to the next cell. `seen`, (4,), is
# what the sensor reports, as $P(z \mid r)$: how probable this report is if the beam was reflected in cell 1, 2 or 3, or (the last number) in none of them.
#
# Complete `beam_posterior`: it returns $P(m_1, m_2, m_3 \mid z)$ of all eight maps as an array of shape (2, 2, 2). Index 0 means free and 1 occupied, so `[0, 1, 0]`
# is the map in which only cell 2 is occupied. The second point is for reports in which nothing came back.


# %% nbgrader={"grade": false, "grade_id": "beam-posterior", "locked": false, "schema_version": 3, "solution": true, "task": false}
def beam_posterior(prior, reflect, seen):
    """Return P(m1, m2, m3 | z), (2, 2, 2)."""
    ### BEGIN SOLUTION
    posterior = np.zeros((2, 2, 2))
    for m in np.ndindex(2, 2, 2):
        reaches, likelihood = 1.0, 0.0
        for k in range(3):
            likelihood += reaches * reflect[m[k]] * seen[k]
            reaches *= 1 - reflect[m[k]]
        likelihood += reaches * seen[3]
        posterior[m] = likelihood * np.prod([prior[k] if m[k] else 1 - prior[k] for k in range(3)])
    return posterior / posterior.sum()
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "posterior-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    prior, reflect, seen = np.array([0.2, 0.5, 0.4]), np.array([0.1, 0.8]), np.array([0.2, 0.6, 0.3, 0.1])
    got = answer_array(beam_posterior(prior.copy(), reflect.copy(), seen.copy()), "beam_posterior")
    assert got.shape == (2, 2, 2), f"one number per map, shape (2, 2, 2), got {got.shape}"
    assert not np.isclose(got.sum(), 0.3268, atol=2e-3), "the eight sum to 0.327 = P(z): divide by it"
    assert np.isclose(got.sum(), 1), f"the eight probabilities sum to {got.sum():.3f}: did you normalise?"
    slips = {  # P(cell 2 occupied); by hand, the map [0, 1, 0] alone: 0.8 * 0.5 * 0.6 * (0.1 * 0.2 + 0.9 * (0.8 * 0.6 + ...))
        0.7316: "a free cell reflects too, with probability reflect[0]",
        0.4101: "reflect[0] is for free cells and reflect[1] for occupied ones: you swapped them",
        0.7113: "cell 2 can reflect only what cell 1 let pass: multiply by the probability that the beam gets there",
        0.7386: "the first occupied cell need not reflect: it lets 1 - reflect[1] of the beams pass",
        0.7148: "the beam may pass all three cells: add that case, with seen[3]",
        0.6333: "the prior got lost: multiply by P(m1) P(m2) P(m3)",
        0.5899: "the prior is the wrong way round: `prior` is P(occupied)",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got[:, 1].sum(), slip, atol=2e-3), f"P(cell 2 occupied) = {slip}: {hint}"
    assert not np.isclose(got[1, 0, 0], 0.1394, atol=2e-3), (
        "the axes are reversed: the first index is cell 1, the nearest"
    )
    right = [[[0.1257, 0.1394], [0.3478, 0.2442]], [[0.0355, 0.0268], [0.0479, 0.0326]]]
    np.testing.assert_allclose(got, right, atol=2e-4, err_msg="P(m1, m2, m3 | z)")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_posterior(beam_posterior)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "nothing-back-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    arguments = np.array([0.2, 0.5, 0.4]), np.array([0.1, 0.8]), np.array([0.0, 0.0, 0.0, 1.0])
    got = answer_array(beam_posterior(*arguments), "beam_posterior")
    assert got.shape == (2, 2, 2), f"one number per map, shape (2, 2, 2), got {got.shape}"
    assert np.isfinite(got).all(), (
        "nothing came back, and you divide 0 by 0: a beam that passes all cells is a case too"
    )
    # By hand: all free 0.8 * 0.5 * 0.6 * 0.9^3 = 0.17496, all occupied 0.2 * 0.5 * 0.4 * 0.2^3 = 0.00032.
    ratio = got[0, 0, 0] / got[1, 1, 1]
    assert not np.isclose(ratio, 6), "you left out how probable it is that each cell lets the beam pass"
    assert np.isclose(ratio, 546.75, rtol=1e-3), (
        f"all free should be 547 times as probable as all occupied, got {ratio:.3g}"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_nothing_back(beam_posterior)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# A grid keeps only three numbers of these eight: the **marginals** $P(m_k = 1 \mid z)$. It treats the cells as independent, so it believes in the product
# $q(m) = \prod_k P(m_k \mid z)$. Complete `price`: it takes a posterior over three cells, (2, 2, 2), and returns how far $q$ is from it, as the **total variation**,
#
# $$ \tfrac12 \sum_m |P(m \mid z) - q(m)|. $$
#
# It is 0 when the cells really are independent, and never more than 1.


# %% nbgrader={"grade": false, "grade_id": "price", "locked": false, "schema_version": 3, "solution": true, "task": false}
def price(posterior):
    """Return the total variation between a posterior (2, 2, 2) and the product of its marginals."""
    ### BEGIN SOLUTION
    one, two, three = posterior.sum(axis=(1, 2)), posterior.sum(axis=(0, 2)), posterior.sum(axis=(0, 1))
    return 0.5 * np.abs(posterior - one[:, None, None] * two[:, None] * three).sum()
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "price-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # "One of you two", about cells 1 and 2, prior 0.2 each: 4/9 only the first, 4/9 only the second, 1/9 both. Cell 3 stays at 0.2.
    two = np.array([[0, 4], [4, 1]]) / 9
    posterior = two[:, :, None] * np.array([0.8, 0.2])
    got = answer_number(price(posterior.copy()), "price")
    slips = {
        0.7901: "you left out the factor 1/2",
        0.158: "that is the largest difference of one map: add up the differences of all maps",
        0.0: "you took differences without their sign away: they cancel, so sum absolute values",
        0.4611: "you compare with equal probabilities: compare with the product of the marginals",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=2e-3), f"price = {got:.3f}: {hint}"
    # By hand: the marginals are 5/9, so q of "both free" is 16/81; all four differ by 16/81.
    assert np.isclose(got, 32 / 81, atol=1e-4), f"by hand 0.5 * 4 * 16/81 = 0.395, got {got:.3f}"
    apart = np.array([0.7, 0.3])[:, None, None] * np.array([0.4, 0.6])[:, None] * np.array([0.9, 0.1])
    assert np.isclose(price(apart), 0, atol=1e-9), "three independent cells: their product is the posterior, so it is 0"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_price(price)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: the prior counts once (2 + 1 points)
#
# Not every sensor model gives likelihoods. `posteriors` has the shape `(K, H, W)`: for each of K scans, what that scan alone makes of each cell,
# $P(\text{occupied} \mid z_k)$. Every one of them was made from the same `prior`, a number: a scan that says nothing gives the prior back. So the prior is
# in each of them, and you want it in the result once:
#
# $$ L = L_0 + \sum_{k=1}^K (L_k - L_0) $$
#
# Complete `fuse`: it returns the **probability** of each cell after all K scans, `(H, W)`, with $L_0$ the log-odds of the prior and $L_k$ those of scan k.
# For one more point: a parked car is scanned thousands of times before it drives off, and so many
# scans must not end in a zero or an infinity that no later scan can take back. Do it without a clamp, so that scans which contradict each other cancel exactly.


# %% nbgrader={"grade": false, "grade_id": "fuse", "locked": false, "schema_version": 3, "solution": true, "task": false}
def fuse(prior, posteriors):
    """Return P(occupied | all scans) of each cell, (H, W)."""
    ### BEGIN SOLUTION
    L_0 = np.log(prior / (1 - prior))
    L = L_0 + (np.log(posteriors / (1 - posteriors)) - L_0).sum(axis=0)
    return 1 / (1 + np.exp(-L))
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "fuse-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Three scans of two cells, prior 0.2. Cell (0, 0): none says anything. Cell (0, 1): two make it 0.5, the third says nothing.
    got = answer_array(fuse(0.2, np.array([[[0.2, 0.5]], [[0.2, 0.5]], [[0.2, 0.2]]])), "fuse")
    assert got.shape == (1, 2), f"expected one number per cell, (1, 2), got {got.shape}: sum over the scans only"
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "fuse-many-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # A thousand scans say 0.9, then a thousand say 0.1, and the last one 0.8. The prior is 0.5: all but the last cancel.
    posteriors = np.concatenate([np.full(1000, 0.9), np.full(1000, 0.1), [0.8]]).reshape(-1, 1, 1)
    got, last = (answer_array(fuse(0.5, p), "fuse") for p in (posteriors.copy(), posteriors[-1:].copy()))
    assert np.isfinite(got).all(), "NaN after 2001 scans: so long a product ends at 0 or infinity; add logarithms"
    stuck = "odds of 9 ** 1000 are infinite, and a probability of exactly 0 or 1 never comes back; add logarithms, without a clamp"
    assert np.allclose(got, last, atol=1e-6), f"2000 scans cancel, yet {last.ravel()} became {got.ravel()}: {stuck}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_fuse_many(fuse)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: a clamp for a given smear (2 points)
#
# A car drives away from you at `speed` (m/s) and is scanned every `dt` seconds. While it covers a cell, the cell's log-odds are at the clamp. As soon as it has left
# the cell, every scan passes it, with $P(z \mid \text{occupied})$ = `occupied` and $P(z \mid \text{free})$ = `free`. A cell is called occupied while $L > 0$, so it
# survives some passes, and the tail is that number times the distance covered from one pass to the next.
#
# The tail may be at most `tail` metres long. Complete `highest_clamp`: it returns the highest clamp that keeps it so short, as a **probability**. (A cell that a pass takes
# to exactly $L = 0$ is free. The computer may hold 3.6 / (12 · 0.1) as slightly less than 3. You needn't care: where
# `tail` is a whole number of passes long, the tests use numbers that it holds exactly.)


# %% nbgrader={"grade": false, "grade_id": "highest-clamp", "locked": false, "schema_version": 3, "solution": true, "task": false}
def highest_clamp(tail, speed, dt, occupied, free):
    """Return the highest P(occupied) at which log-odds may be clamped, so that the tail isn't longer than `tail` metres."""
    ### BEGIN SOLUTION
    survived = np.floor(tail / (speed * dt))
    return 1 / (1 + np.exp(-(survived + 1) * np.log(free / occupied)))
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "clamp-for-tail-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # A pass is worth log(0.6 / 0.3) = log 2. The car covers 1.2 m from pass to pass, so 4 m allow 3 survived passes; the fourth must free the cell.
    got = answer_number(highest_clamp(tail=4.0, speed=12.0, dt=0.1, occupied=0.3, free=0.6), "highest_clamp")
    slips = {
        2.7726: "those are log-odds: give the probability that belongs to them",
        0.9527: "passes come one by one: 3.33 passes are 3 that the cell survives",
        0.8889: "with 3 log 2 the third pass already frees the cell: it may survive three, and be freed by the fourth",
        0.9697: "with that clamp a cell survives 4 passes, which is 4.8 m",
        0.6667: "you forgot dt: the car covers 1.2 m from one pass to the next",
        0.8853: "you take log P(z | free) alone: what a pass is worth is log(0.6 / 0.3)",
        0.9919: "you take log P(z | occupied) alone: what a pass is worth is log(0.6 / 0.3)",
        0.7685: "you take the difference 0.6 - 0.3: what a pass is worth is log(0.6 / 0.3)",
        0.0588: "the sign is swapped: the clamp is on the occupied side, above 0.5",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=1e-3), f"highest_clamp = {got:.4f}: {hint}"
    assert np.isclose(got, 16 / 17, atol=2e-4), f"by hand 4 log 2, so 16 to 1 and P = 0.9412, got {got:.4f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_highest_clamp(highest_clamp)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: one beam through a grid (3 + 1 points)
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "beam-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    spec = GridSpec(x_min=-0.5, x_max=5.5, y_min=-4.5, y_max=4.5, cell=1)  # draw it, with the beam from cell (5, 4)
    got = answer_array(beam_evidence(3.8, 1.8, spec, L_hit=2.0, L_pass=-1.0), "beam_evidence")
    assert got.shape == (6, 9), f"expected one number per cell, shape (6, 9), got {got.shape}"
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "outside-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    spec = GridSpec(x_min=-0.5, x_max=5.5, y_min=-4.5, y_max=4.5, cell=1)
    got = answer_array(beam_evidence(9.5, 0.3, spec, L_hit=2.0, L_pass=-1.0), "beam_evidence")
    assert got.shape == (6, 9), f"expected one number per cell, shape (6, 9), got {got.shape}"
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
# ## Task 5: put together (2 + 1 + 2 points)
#
# Now a grid of your own. Unlike the lecture's, it forgets only where nobody looks. `L`, `occupied` and `free` are (H, W): the log-odds of every cell, and the two likelihoods of a scan. Complete
# `update`:
# - where the scan says nothing, that is where `occupied` equals `free`, the log-odds fade: they shrink by the factor $e^{-dt / \tau}$;
# - everywhere else they take the scan in by Bayes' rule, without fading;
# - after that no cell may lie outside the range from `L_min` to `L_max` (this is one more point).
#
# It returns the new log-odds, and leaves its arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def update(L, occupied, free, dt, tau, L_min, L_max):
    """Return the log-odds (H, W) after one scan, in a grid that forgets what isn't seen."""
    ### BEGIN SOLUTION
    silent = occupied == free
    return np.clip(np.where(silent, L * np.exp(-dt / tau), L + np.log(occupied / free)), L_min, L_max)
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "update-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_SIGN = "the sign is swapped: a hit makes a cell more occupied, so P(z | occupied) stands above"
_UPDATE_SLIPS = {  # by hand, cell (1, 2): 0.5 + log(0.9 / 0.05) = 3.390; cell (0, 1): exp(-0.2) = 0.819
    ((1, 2), -2.0): _SIGN,
    ((1, 2), -2.39): _SIGN,
    ((1, 2), 1.755): "that is the logarithm to base 10: take the natural one, np.log",
    (
        (1, 2),
        1.350,
    ): "you add the difference of the two likelihoods: odds are multiplied by their ratio, so add its logarithm",
    ((1, 2), 0.395): "you add log P(z | occupied) alone: how likely was that return if the cell is free?",
    ((1, 2), 2.697): "you take P(z | occupied) for P(occupied | z): a scan gives two likelihoods, compare them",
    ((1, 2), 2.890): "the old belief got lost: add to L",
    ((1, 2), 1.445): "you multiply: with logarithms, Bayes' rule is an addition",
    ((1, 2), 3.299): "a cell that is seen doesn't fade: only where the scan says nothing",
    ((0, 1), 1.0): "nothing was seen there, so the cell fades",
    ((0, 1), 0.0067): "dt / tau is upside down: in 0.1 s a memory of 0.5 s loses 18 %",
    ((0, 1), 1.2214): "it grows: the exponent is negative",
    ((0, 1), 0.8): "that is 1 - dt / tau: the factor is exp(-dt / tau)",
    ((0, 1), 0.8706): "that is a half-life: the factor is exp(-dt / tau)",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "update-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    L = np.array([[0.0, 1.0, 0.9], [0.4, 0.0, 0.5]])
    occupied, free = np.full((2, 3), 0.6), np.full((2, 3), 0.6)  # the scan says nothing ...
    occupied[0, 2], free[0, 2] = 0.3, 0.7  # ... but that a beam passed cell (0, 2) ...
    occupied[1, 2], free[1, 2] = 0.9, 0.05  # ... and came back from cell (1, 2)
    before = L.copy()
    got = answer_array(update(L, occupied, free, dt=0.1, tau=0.5, L_min=-2.0, L_max=3.5), "update")
    assert np.array_equal(L, before), "update changed its argument `L`: make a new array (no +=)"
    assert got.shape == (2, 3), f"expected the shape of L, (2, 3), got {got.shape}"
    assert not np.allclose(got, -2.0), "every cell is at L_min: clip takes the lower limit first, then the upper one"
    for (cell, value), hint in _UPDATE_SLIPS.items():
        assert not np.isclose(got[cell], value, atol=2e-3), f"cell {cell} is at {got[cell]:.2f}: {hint}"
    by_hand = "unseen cells fade by exp(-0.2) = 0.819, a passed one falls by 0.847, one that was hit rises by 2.89"
    np.testing.assert_allclose(got, [[0, 0.819, 0.053], [0.327, 0, 3.390]], atol=1e-3, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_update(update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "clamp-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    passed, hit = (0.3, 0.7), (0.9, 0.05)
    L = np.array([[3.0, -1.5, 0.0, 4.0]])  # the last cell got above the limit before there was one
    occupied, free = np.array([hit, passed, hit, passed]).T[:, None]
    how = {"dt": 0.1, "tau": 0.5}
    got = answer_array(update(L.copy(), occupied.copy(), free.copy(), **how, L_min=-2.0, L_max=3.5), "update")
    wide = answer_array(update(L.copy(), occupied, free, **how, L_min=-50.0, L_max=50.0), "update")  # your sums
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
# The next stage of the system wants four states per cell, FREE, STATIC, DYNAMIC and UNKNOWN, in this order. Your grid has one number. Complete `as_belief`: it takes log-odds
# (H, W) and returns (4, H, W), four numbers per cell that sum to 1. DYNAMIC is 0, because this grid has no word for it. UNKNOWN is 1 at $P = 0.5$ and falls in a straight
# line to 0 at $P = 0$ and at $P = 1$. The rest is FREE below 0.5 and STATIC above. A cell may have any log-odds, also 1000.


# %% nbgrader={"grade": false, "grade_id": "as-belief", "locked": false, "schema_version": 3, "solution": true, "task": false}
def as_belief(L):
    """Return the probabilities of FREE, STATIC, DYNAMIC and UNKNOWN, (4, H, W)."""
    ### BEGIN SOLUTION
    P = 0.5 * (1 + np.tanh(0.5 * L))
    free, static = np.maximum(1 - 2 * P, 0), np.maximum(2 * P - 1, 0)
    return np.stack([free, static, np.zeros_like(P), 1 - free - static])
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "as-belief-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    L = np.array([[np.log(4), -np.log(9), 0.0]])  # P = 0.8, 0.1, 0.5
    got = answer_array(as_belief(L.copy()), "as_belief")
    assert got.shape != (1, 3, 4), "the states are the first axis: (4, H, W)"
    assert got.shape == (4, 1, 3), f"four numbers per cell, shape (4, 1, 3), got {got.shape}"
    first = got[:, 0, 0].round(3).tolist()  # of the cell with P = 0.8
    slips = {
        (0.2, 0.8, 0, 0): "where is UNKNOWN? At P = 0.8 the grid is 0.4 from knowing nothing and 0.6 from certainty",
        (0, 0.6, 0.4, 0): "UNKNOWN is the fourth state and DYNAMIC the third",
        (0, 0, 0.6, 0.4): "this grid can't say DYNAMIC: what is occupied counts as STATIC",
        (0.6, 0, 0, 0.4): "FREE and STATIC are swapped: L above 0 means occupied",
        (0, 0.8, 0, 0.2): "UNKNOWN must be 1 at P = 0.5, and 0 only at P = 0 and P = 1",
    }
    for slip, hint in slips.items():
        assert not np.allclose(first, slip, atol=2e-3), f"P = 0.8 became {first}: {hint}"
    assert np.allclose(got.sum(axis=0), 1, atol=1e-6), f"the four states sum to {got.sum(axis=0).round(3).tolist()}"
    right = [[0, 0.8, 0], [0.6, 0, 0], [0, 0, 0], [0.4, 0.2, 1]]
    np.testing.assert_allclose(
        got[:, 0], right, atol=1e-6, err_msg="FREE, STATIC, DYNAMIC, UNKNOWN at P = 0.8, 0.1, 0.5"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import grids

    complaint = grids.check_as_belief(as_belief)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# **And now on the street.** The cell below makes a stage of your two functions: it moves your map with the vehicle, gives each scan to `update`, and hands out `as_belief`. (There are no points
# in it: your functions have earned them.) Take the `#` away in the cell after it, and you see your grid on the sample drive and on the real street. Where are the ghosts of lecture 02, and which of them fade?


# %% nbgrader={"grade": false, "grade_id": "stage", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _track(frames, spec, tau=0.5):
    """Yield your grid's belief (4, H, W) for each frame: called `track`, this is a stage of the pipeline."""
    area, pose, before = map_around(spec, yaw=0), PlanarMotion(), None
    L, nothing = np.zeros(area.shape), np.zeros(1, np.float32)
    for frame in frames:
        before = before or frame
        motion = PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
        shift, pose = scroll(pose.then(motion), spec.cell)  # by whole cells; the rest stays in the pose
        last, area = area, map_around(spec, pose.dyaw)
        L = look_up(np.float32(L)[None], nothing, last, area, shift)[0]
        scan = scan_evidence(frame.points_grid, area, SensorModel(), pose)
        L = np.array(update(L, scan.occupied, scan.free, frame.time - before.time, tau, -1.99, 3.48), float)
        yield np.array(as_belief(look_up(np.float32(L)[None], nothing, area, spec, pose)[0]), float)
        before = frame


def _show_streets():
    """Draw your grid after the last frame of both streets."""
    _, axes = plt.subplots(1, 2, figsize=(8, 5.5), layout="compressed")
    for ax, (name, drive) in zip(axes, (("sample", sample_drive()), ("real", real_drive())), strict=True):
        *_, belief = _track((drive[k] for k in range(len(drive))), GridSpec.compact())
        plotting.occupancy(GridSpec.compact(), belief, ax=ax, legend=ax is axes[1]).set_title(name)
    plt.show()


# %%
# _show_streets()

# %% [markdown]
# To run it as a stage of the whole system, copy `update`, `as_belief` and `_track` into a file `my_stages.py`, add their imports, and call the last one `track`. Then
# `semgrid-edu demo --stages my_stages.py` shows your grid beside the package's filter, and what the semantic grid makes of each, on both streets.

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# To shorten the smear, a colleague lowers the clamp from 0.97 to 0.62. What gets worse, and where on a street would you see it? And which smear does no clamp remove: what does
# the model of a cell lack for it? Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "shorter-smear", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# A low clamp makes the grid forget what it has gathered: whatever was hit ten times is worth no more than what was hit once, so one pass (-0.85) makes it free. What
# is seen only now and then flickers: thin poles between two beams, porous hedges and fences, the edges of cars. No clamp removes the tail that no beam
# passes: that of an oncoming car lies behind the car, in its shadow, and what has left the field of view is not seen again; log-odds change only where there is
# evidence, so forgetting helps. The model has one variable for the cell at all scans. It lacks a variable for each scan, with an edge from one to the next: with it a cell may change.
# One point for a cost with its place, one for the unseen tail and the missing change.

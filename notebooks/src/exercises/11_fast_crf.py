# %% [markdown]
# # Exercise 11: the fast CRF
#
# Four functions that ask more of a filter than the lecture did and end in a CRF of your own, which refines the sample drive, and one question to answer in words. About 95 minutes.
# The lecture is [11: the fast CRF](../11_fast_crf.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | a blur over a map with gaps | 2 |
# | 2 | is losing an error? Two blurs, compared with the exact sums | 3 |
# | 3 | what the *other* cells say, asked of many at once | 2 |
# | 4 | a CRF of your own | 3 + 1 |
# | 5 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array
from semgrid_edu.workshop.course.answers import peak_megabytes
from semgrid_edu.crf import PermutohedralLattice, SeparableGaussian  # task 4 may use them
from semgrid_edu.crf import enclosing_simplices, lattice

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=1e-3), f"{what} {got:.4f}: {hint}"


# %% [markdown]
# ## Task 1: a blur over a map with gaps (2 points)
#
# `values` is a map, `(H, W)`, and `known`, `(H, W)`, says in which cells it holds anything: in the others it may hold NaN. With $r_i$ the row and the column of cell $i$, give **every** cell, known or not, the mean of the known cells,
# weighted by the spatial kernel of equation (4):
#
# $$ \text{blurred}_i = \frac{\sum_{j\ \text{known}} k_{ij}\, \text{values}_j}{\sum_{j\ \text{known}} k_{ij}}, \qquad k_{ij} = \exp\!\left(-\frac{|r_i - r_j|^2}{2\sigma^2}\right) $$
#
# A known cell counts itself, and beyond the map there are no cells. At least one cell is known. Arguments are not changed.
#
# Complete `blur_known`: it returns the blurred map, `(H, W)`. A map of 300 x 200 cells must take no time and little memory.


# %% nbgrader={"grade": false, "grade_id": "blur-known", "locked": false, "schema_version": 3, "solution": true, "task": false}
def blur_known(values, known, sigma):
    """Return the mean of the known cells, weighted by a Gaussian of the distance, (H, W)."""
    ### BEGIN SOLUTION
    rows, columns = (np.exp(-0.5 * np.subtract.outer(a, a) ** 2 / sigma**2) for a in map(np.arange, values.shape))
    held = np.where(known, values, 0)
    return (rows @ held @ columns) / (rows @ known.astype(float) @ columns)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "blur-known-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    # This sigma gives 0.8 to a neighbour, so 0.8 ** 4 = 0.41 at distance 2 and 0.8 ** 9 = 0.13 at distance 3. Two cells are known.
    sigma = np.sqrt(-0.5 / np.log(0.8))
    values = np.array([[1.0, np.nan, np.nan, np.nan], [np.nan, np.nan, np.nan, 2.0]])
    known, before = np.isfinite(values), values.copy()
    got = answer_array(blur_known(values, known, sigma), "blur_known")
    assert np.array_equal(values, before, equal_nan=True), "blur_known changed its argument `values`: work on a copy"
    assert got.shape == (2, 4), f"expected the shape of the map, (2, 4), got {got.shape}: is it turned?"
    assert not np.isnan(got[0, 1]), (
        "NaN spreads, also from 0 * NaN: put something else where nothing is known, before you blur"
    )
    slips = {
        1.4554: "that is the sum: divide by the sum of the weights of known cells",
        0.2687: "cells that aren't known count as 0 in your mean: leave their weights out of the lower sum",
        1.1437: "the factor 2 below sigma**2 is missing",
        1.2082: "you divide by sigma instead of sigma**2",
        1.3902: "the distance isn't squared",
        1.0000: "row 1 isn't heard in row 0: both sums take two passes",
        1.4444: "that is a mean of the means of rows: blur sums first, and divide in the end",
        1.5000: "that is the plain mean of the known cells: nearer ones count more",
    }
    _explain("cell (0, 1) is", got[0, 1], slips)  # by hand: (0.8 * 1 + 0.8 * 0.41 * 2) / (0.8 + 0.8 * 0.41) = 1.291
    slips = {
        1.0: "a known cell is blurred as well: it hears the others",
        1.3902: "it hears cell (1, 3) too well: your blur goes round, from the last column to the first; the map ends there",
        2.0: "it doesn't hear itself: a known cell counts itself",
    }
    _explain("cell (0, 0) is", got[0, 0], slips)
    np.testing.assert_allclose(got, [[1.097, 1.291, 1.610, 1.856], [1.144, 1.390, 1.709, 1.903]], atol=2e-3)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_blur_known(blur_known)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: is losing an error? (3 points)
#
# The lecture's blur loses what would go to a vertex that doesn't exist. One could also let a vertex **keep** what it can't give away, so that the sum over all vertices stays the same.
# Build both, and compare. `simplices` is a list with one pair for each of N points: `corners`, an
# integer array `(d + 1, d + 1)`, one row per corner, and `weights`, `(d + 1,)`. `values` is `(N, K)`. The filter
#
# 1. *splats*: a vertex gets the sum of `weight * value` of all points around it. Only vertices that are a corner of some point exist;
# 2. *blurs* along direction 0, then 1, ... up to `d`: each vertex gives 1/4 of its value to the neighbour one step ahead, 1/4 to the one behind, and keeps the rest. Where a neighbour doesn't exist, its quarter is lost if `keep` is False; if `keep` is True, the vertex keeps that quarter, too. (A step ahead in direction `j` adds 1 to all coordinates but the `j`-th, from which it takes `d`.)
# 3. *slices*: a point gets the weighted mean of its corners, with the same weights.
#
# Complete `lattice_filter`: it returns `(N, K)`.


# %% nbgrader={"grade": false, "grade_id": "lattice-filter", "locked": false, "schema_version": 3, "solution": true, "task": false}
def lattice_filter(simplices, values, keep):
    """Return the filtered values, (N, K)."""
    ### BEGIN SOLUTION
    vertices = {}
    for (corners, weights), value in zip(simplices, values, strict=True):
        for corner, weight in zip(map(tuple, corners), weights, strict=True):
            vertices[corner] = vertices.get(corner, 0) + weight * value
    size = len(simplices[0][1])
    for j in range(size):
        forward = np.ones(size, int)
        forward[j] -= size
        around = {v: (tuple(v + forward), tuple(v - forward)) for v in vertices}
        vertices = {
            v: x / 2 + sum(vertices.get(u, x if keep else 0) for u in around[v]) / 4 for v, x in vertices.items()
        }
    return np.array([sum(w * vertices[tuple(c)] for c, w in zip(*simplex, strict=True)) for simplex in simplices])
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "lattice-hints", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_LATTICE_SLIPS = {  # what point 0 of the test gets by a common slip, with keep=False
    14.0000: "nothing is blurred between splat and slice, or no neighbour is found: a step adds 1 to all coordinates but one, and takes d from that one",
    12.5000: "you blur along one direction only: there are d + 1",
    15.1250: "keep is False: a quarter for a vertex that doesn't exist is lost",
    43.7500: "you blur with (1/2, 1, 1/2): the vertex keeps a half, its neighbours give a quarter each",
    26.9375: "you blur with (1/4, 1, 1/4): the vertex itself keeps a half",
    12.1250: "slice with the weights of splat, not with a plain mean",
    24.2500: "you slice without weights",
    9.8125: "two points share the vertex in the middle: add to it, don't overwrite",
    21.7500: "you splat without weights: a point shares its value out",
    11.5000: "you blur into vertices that don't exist: only corners of points do",
    6.5625: "you blur with the neighbour ahead only",
    7.1250: "you blur with the neighbour behind only",
    10.7266: "a blur must read old values only; you change vertices while others still read them",
    15.7083: "you divide by the weights that exist: then nothing is lost, and what a vertex gives isn't what the others get",
}


# %% nbgrader={"grade": true, "grade_id": "lattice-filter-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    # One dimension: two points share the vertex in the middle of three. By hand: splat 12, 20, 16. What can't be given is lost: 11, 17, 13, then 9.75, 14.5, 10.75.
    left = np.array([[0, 0], [-1, 1]]), np.array([0.75, 0.25])
    right = np.array([[-2, 2], [-1, 1]]), np.array([0.5, 0.5])
    values = np.array([[16.0, 0.0], [32.0, 4.0]])
    got = answer_array(lattice_filter([left, right], values.copy(), False), "lattice_filter")
    assert got.shape == (2, 2), f"expected N rows of K values, (2, 2), got {got.shape}"  # 0.75 * 9.75 + 0.25 * 14.5
    _explain("with keep=False point 0 gets", got[0, 0], _LATTICE_SLIPS)
    np.testing.assert_allclose(got, [[10.9375, 0.78125], [12.625, 1.1875]], atol=1e-4, err_msg="keep=False, by hand")
    # It is kept: 14, 17, 17, then 14.75, 16.25, 17. The sum stays 48.
    got = answer_array(lattice_filter([left, right], values.copy(), True), "lattice_filter")
    slips = {
        10.9375: "keep is True: what goes to a vertex that doesn't exist stays with its giver",
        15.7083: "you divide by the weights that exist: then the sum over all vertices changes",
    }
    _explain("with keep=True point 0 gets", got[0, 0], slips)
    np.testing.assert_allclose(got, [[15.125, 0.90625], [16.625, 1.625]], atol=1e-4, err_msg="keep=True, by hand")
    corners, at_first = np.array([[0, 0, 0], [1, 1, -2], [2, -1, -1]]), np.array([1.0, 0, 0])
    triangle = [(np.roll(corners, -k, axis=0), at_first) for k in range(3)]  # one point on each corner
    got = answer_array(lattice_filter(triangle, np.array([[64.0], [0], [0]]), True), "lattice_filter").ravel()
    assert not np.array_equal(got, [37, 12, 15]), "the order of the directions is 0, 1, ... d: you begin with the last"
    np.testing.assert_allclose(
        got, [37, 15, 12], err_msg="a triangle: each of the 3 directions joins two of its corners"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_lattice_filter(lattice_filter)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# Which is nearer to the Gaussian? The next cell multiplies your filter by the lattice's peak and compares both with the sums over all pairs. You need its numbers in task 5.


# %% nbgrader={"grade": false, "grade_id": "exact-sums", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _compare(name, features):
    """Print how near both filters come to the sums over all pairs."""
    simplices = list(zip(*enclosing_simplices(lattice.elevated(features)), strict=True))
    exact = np.exp(-0.5 * ((features[:, None] - features) ** 2).sum(axis=-1))
    for keep in (False, True):
        kernel = lattice.peak(features.shape[1]) * lattice_filter(simplices, np.eye(len(features)), keep)
        sums, exact_sums = kernel.sum(axis=1, keepdims=True), exact.sum(axis=1, keepdims=True)
        ratio, error = np.median(sums / exact_sums), np.abs(kernel / sums - exact / exact_sums).sum(axis=1).mean()
        print(f"{name}, keep={keep!s:<5}  sums / exact sums {ratio:.2f}, error of the normalised sums {error:.2f}")


def _street_of_two_states():
    rng = np.random.default_rng(5)
    place, state = np.indices((10, 12)).reshape(2, -1).T, np.arange(120) % 12 // 6
    o = 0.7 * np.eye(3)[state] + 0.3 * rng.dirichlet(np.ones(3), 120)
    _compare("a street, d = 5", np.hstack([place / 3.2, o / 0.2]))


try:
    _street_of_two_states()
except NotImplementedError:
    print("complete lattice_filter first")

# %% [markdown]
# ## Task 3: what the other cells say (2 points)
#
# `blur` is a filter: a function that takes `(N, K)` values and returns `(N, K)`, and that is linear: $\text{blur}(Q)_i = \sum_j k_{ij} Q_j$. You can call it, but you can't look inside. Mean field needs the sum without the cell itself,
# $\sum_{j \ne i} k_{ij} Q_j$, so you need $k_{ii}$, which differs from cell to cell. One could ask for it cell by cell: put a 1 into one cell, and see what comes back. But on the paper's grid that takes 55,025 columns.
#
# This filter is short-sighted: $k_{ij}$ is 0 for two cells that are more than `reach` rows **or** more than `reach` columns apart. The cells of a map of `shape` = (H, W) are counted row by row. How can several cells be asked in one column?
#
# Complete `others_say`: it returns the sums, `(N, K)`. Besides the K columns of `Q` it may hand over at most $(2\,\text{reach} + 1)^2$ columns to `blur`, in one call or in several; `blur` stops when there are more. (A lattice sees farther than
# that, so the package works $k_{ii}$ out from the vertices.)


# %% nbgrader={"grade": false, "grade_id": "others-say", "locked": false, "schema_version": 3, "solution": true, "task": false}
def others_say(blur, Q, shape, reach):
    """Return the filtered values without what each cell tells itself, (N, K)."""
    ### BEGIN SOLUTION
    rows, columns = np.indices(shape).reshape(2, -1) % (reach + 1)
    group = rows * (reach + 1) + columns  # cells of one group don't hear each other
    answers = blur(np.eye((reach + 1) ** 2)[group])
    own = answers[np.arange(len(Q)), group]
    return blur(Q) - own[:, None] * Q
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "counting-blur", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _counting(kernel, columns):
    """Return a filter with this kernel, (N, N), that stops when it gets more columns than it should in all."""
    left = [columns]

    def blur(values):
        values = np.asarray(values, float)
        values = values if values.ndim > 1 else values[:, None]
        left[0] -= values.size // len(kernel)
        assert left[0] >= 0, (
            f"blur got more than the {columns} columns that it may get: ask several cells in one column"
        )
        return kernel @ values

    return blur


def _seen_from(reach):
    """Return a kernel of 3 x 5 cells, (15, 15), that sees `reach` rows and columns far, and Q (15, 2)."""
    place = np.indices((3, 5)).reshape(2, -1).T
    near = np.abs(place[:, None] - place).max(axis=-1) <= reach
    number = np.arange(15)
    kernel = near / (1.0 + (number[:, None] + number) % 4) + np.diag((number + 1) / 10)
    return kernel, np.stack([number / 20, 1 - number / 20], axis=1)


# %% nbgrader={"grade": true, "grade_id": "others-say-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    kernel, Q = _seen_from(1)
    before, own = Q.copy(), np.diag(kernel)
    got = others_say(_counting(kernel, 2 + 9), Q, (3, 5), 1)
    got = answer_array(got, "others_say")
    assert np.array_equal(Q, before), "others_say changed its argument `Q`: work on a copy"
    assert got.shape == (15, 2), f"expected the shape of Q, (15, 2), got {got.shape}"
    heard, wanted = (kernel @ Q)[7, 0], (kernel @ Q - own[:, None] * Q)[7, 0]
    slips = {
        heard: "nothing is subtracted: the filter counts the cell itself",
        heard - Q[7, 0]: "you subtract Q itself, as if k_ii were 1: this filter has another k_ii in each cell",
        heard
        - kernel[7].sum()
        * Q[7, 0]: "you subtract the sum of the kernel's row: k_ii is what comes back from the cell alone",
        heard - own[7]: "you subtract k_ii without Q: a cell tells itself k_ii * Q",
        own[7] * Q[7, 0]: "that is what the cell tells itself: subtract it from the whole sum",
        -wanted: "the sign is swapped",
        heard - own[0] * Q[7, 0]: "that is k_ii of cell 0, taken for all cells: each cell has its own",
        heard - own.mean() * Q[7, 0]: "that is a mean of all k_ii: each cell has its own",
    }
    _explain("cell 7, class 0:", got[7, 0], slips)
    near = "some cells that you ask in one column hear each other: how far apart must they be?"
    np.testing.assert_allclose(got, kernel @ Q - own[:, None] * Q, atol=1e-6, err_msg=near)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_others_say(others_say)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: a CRF of your own (3 + 1 points)
#
# Now the stage `refine` of the pipeline. `log_g` is `(C, H, W)`: the logarithms of the network's probabilities. `o` is `(4, H, W)`: the occupancy grid. Complete
# `refine`: it returns refined probabilities, `(C, H, W)`, by **10 iterations** of mean field on equation (4), with the package's defaults for cells of 0.5 m:
#
# - bilateral kernel: weight 4, widths 3.2 cells in place and 0.2 in the four probabilities;
# - spatial kernel: weight 3, width 1.2 cells;
# - each kernel $K$ is normalised to $D^{-1/2} K D^{-1/2}$, where $D$ holds its row sums, that is, what it makes of a map of ones.
#
# You may use the package's filters, or your own of tasks 1 and 2:
#
# ```python
# blur = PermutohedralLattice.build(features)               # features (N, d), in units of the widths
# blur = SeparableGaussian.build((H, W), 1.2, 1, "none")    # sigma in cells, weight, normalisation
# blur(values)                                              # values (N, K) float32 -> (N, K), cells counted row by row
# blur.diagonal                                             # k_ii, (N,)
# ```
#
# Their first call takes some seconds, because they are compiled then.
#
# For one more point: the right map of a larger street without a matrix of all pairs, so that it can refine the maps of a drive. Lecture 10's damping isn't needed with these settings; a result with it
# is right, too.


# %% nbgrader={"grade": false, "grade_id": "refine", "locked": false, "schema_version": 3, "solution": true, "task": false}
def refine(log_g, o):
    """Return refined probabilities, (C, H, W)."""
    ### BEGIN SOLUTION
    n_classes, height, width = log_g.shape
    place = np.indices((height, width)).reshape(2, -1).T
    features = np.hstack([place / 3.2, o.reshape(4, -1).T / 0.2])
    kernels = []
    for weight, blur in (
        (4, PermutohedralLattice.build(features)),
        (3, SeparableGaussian.build((height, width), 1.2, 1, "none")),
    ):
        scale = np.sqrt(weight / blur(np.ones((len(place), 1), np.float32)))
        kernels.append((blur, scale, scale**2 * blur.diagonal[:, None]))
    unary = -log_g.reshape(n_classes, -1).T
    log_Q = -unary
    for _ in range(10):
        Q = np.exp(log_Q - log_Q.max(axis=1, keepdims=True))
        Q = (Q / Q.sum(axis=1, keepdims=True)).astype(np.float32)
        log_Q = -unary + sum(scale * blur(scale.astype(np.float32) * Q) - own * Q for blur, scale, own in kernels)
    Q = np.exp(log_Q - log_Q.max(axis=1, keepdims=True))
    return (Q / Q.sum(axis=1, keepdims=True)).T.reshape(log_g.shape)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "all-pairs", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _all_pairs(log_g, o, w=(4, 3), widths=(3.2, 0.2, 1.2), own=(1, 1), root=0.5, rounds=10, keep=0, log=True, part=1):
    """Do the same with a matrix of all pairs; other keywords make mistakes."""
    place, flat, K, diagonal = np.indices(o.shape[1:]).reshape(2, -1).T, log_g.reshape(len(log_g), -1), 0, 0
    for weight, subtract, f in (
        (w[0], own[0], np.hstack([place / widths[0], o.reshape(4, -1).T / widths[1]])),
        (w[1], own[1], place / widths[2]),
    ):
        k = np.exp(-0.5 * ((f[:, None] - f) ** 2).sum(axis=-1))
        k = weight * k / np.outer(k.sum(axis=1) ** root, k.sum(axis=1) ** root)
        K, diagonal = K + k - subtract * np.diag(np.diag(k)), diagonal + np.diag(k)
    flat = flat if log else np.exp(flat)
    log_Q, part = flat, 1 / (1 + diagonal / 2) if part == "p" else part
    for _ in range(rounds + 1):
        Q = np.exp(log_Q - log_Q.max(axis=0)) / np.exp(log_Q - log_Q.max(axis=0)).sum(axis=0)
        log_Q = log_Q + part * (flat + keep * (log_Q - flat) + Q @ K - log_Q)
    return Q.reshape(log_g.shape)


def _street():
    """Return the classes (13, 10) of a street, log g (4, 13, 10) that guesses them, and its occupancy o (4, 13, 10)."""
    rng, on_right = np.random.default_rng(11), np.arange(10) > 4
    truth, state = (np.arange(13) > 5)[:, None] + 2 * on_right, on_right + np.zeros((13, 1), int)
    log_g = np.log(rng.dirichlet(np.ones(4), (13, 10)) * 0.7 + 0.3 * np.eye(4)[truth]).transpose(2, 0, 1)
    return truth, log_g, (0.1 * rng.dirichlet(np.ones(4), (13, 10)) + 0.9 * np.eye(4)[state]).transpose(2, 0, 1)


# %% nbgrader={"grade": false, "grade_id": "refine-hints", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
_REFINE_SLIPS = {
    "what a cell tells itself isn't subtracted: see task 3": {"own": (0, 0)},
    "what a cell tells itself through the lattice isn't subtracted: both kernels have a diagonal": {"own": (0, 1)},
    "what a cell tells itself through rows and columns isn't subtracted: both kernels have a diagonal": {"own": (1, 0)},
    "the kernels aren't normalised: D^-1/2 K D^-1/2": {"root": 0},
    "you divide by the row sums twice: scale by 1 / sqrt(D) before and after the filter": {"root": 1},
    "the sign of the sum is wrong: agreeing neighbours raise log Q": {"w": (-4, -3)},
    "the two weights are swapped: 4 is that of the bilateral kernel": {"w": (3, 4)},
    "the bilateral kernel is missing": {"w": (0, 3)},
    "the spatial kernel is missing": {"w": (4, 0)},
    "both weights are missing": {"w": (1, 1)},
    "you multiply by the widths: features are divided by them": {"widths": (1 / 3.2, 5, 1 / 1.2)},
    "the bilateral kernel ignores the occupancy": {"widths": (3.2, 1e9, 1.2)},
    "the widths of place are swapped: 3.2 cells belong to the bilateral kernel": {"widths": (1.2, 0.2, 3.2)},
    "you start from probabilities, not from their logarithms": {"log": False},
    "one iteration isn't ten": {"rounds": 1},
    "you return the network's own distribution": {"rounds": 0},
    "each iteration starts from log_g, not from the last log Q: you add up all iterations": {"keep": 1},
}


# %% nbgrader={"grade": true, "grade_id": "refine-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    truth, log_g, o = _street()
    got = answer_array(refine(log_g.copy(), o.copy()), "refine")
    assert got.shape == log_g.shape, f"expected the shape of log_g, (4, 13, 10), got {got.shape}"
    assert np.isfinite(got).all(), (
        "probabilities must be finite: subtract the largest exponent of each cell before np.exp"
    )
    assert (got >= 0).all(), "a probability is negative: return Q, not log Q"
    total = got.sum(axis=0)[0, 0]
    assert np.allclose(got.sum(axis=0), 1, atol=1e-3), (
        f"the classes of a cell sum to {total:.3f}: the soft-max runs over classes"
    )
    certain = 40 * (np.eye(4)[truth].transpose(2, 0, 1) - 1)
    share = (answer_array(refine(certain, o.copy()), "refine").argmax(axis=0) == truth).mean()
    assert share > 0.9, (
        f"a network that is certain keeps {100 * share:.0f} % of its labels: is the sign right, are classes and cells mixed up? "
        "(C, H, W) becomes (N, C) by reshape(C, -1).T, and goes back by .T.reshape(C, H, W)"
    )
    away = {hint: np.abs(got - _all_pairs(log_g, o, **slip)).mean() for hint, slip in _REFINE_SLIPS.items()}
    hint, error = min(away, key=away.get), np.abs(got - _all_pairs(log_g, o)).mean()
    assert error <= away[hint], f"nearer to a mistake ({away[hint]:.3f}) than to the right map ({error:.3f}): {hint}"
    assert error < 0.02, f"on average a probability is off by {error:.3f}, more than a lattice's kernel explains (0.02)"
    # Four cells in four states: the lattice joins none of them, so what a cell tells itself is all that it hears there.
    log_g, o = np.log([[[0.5, 0.3], [0.2, 0.4]], [[0.5, 0.7], [0.8, 0.6]]]), np.eye(4).reshape(4, 2, 2)
    got = answer_array(refine(log_g.copy(), o.copy()), "refine")
    off = min(np.abs(got - _all_pairs(log_g, o, part=part)).max() for part in (1, 0.95, 0.9, "p"))
    assert off < 0.01, (
        f"in four cells whose occupancy is unlike, a probability is off by {off:.3f}: subtract what this filter gives a cell back, blur.diagonal, with the same normalisation"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_refine(refine)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "refine-memory-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _test():
    _, log_g, o = _street()
    refine(log_g.copy(), o.copy())  # what is compiled on the first call isn't counted
    log_g, o = (np.kron(part, np.ones((1, 3, 5))) for part in (log_g, o))  # 39 x 50 cells: all pairs have 30 MB
    large, megabytes = peak_megabytes(refine, log_g.copy(), o)
    large = answer_array(large, "refine")
    assert large.shape == log_g.shape, f"on a larger map: expected {log_g.shape}, got {large.shape}"
    assert not np.allclose(large, log_g), "refine gave log_g back: this point is for a map that was refined"
    assert not np.allclose(large, np.exp(log_g)), "refine gave the network's probabilities back, not refined ones"
    assert megabytes < 30, (
        f"1950 cells took {megabytes:.0f} MB: you write all pairs down; the paper's grid would take 24 GB"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_refine_memory(refine)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ### See it on the drive
#
# Copy `refine` into a file `my_stages.py`, with the imports it needs at its top, and run
#
# ```
# semgrid-edu demo --stages my_stages.py
# ```
#
# The page shows your stage beside the package's, frame by frame. Where do they differ, and why should they?
#
# ## Task 5: in your own words (2 points)
#
# A colleague reads the lecture: "The lattice loses a quarter of each sum, so small cars vanish. Let its vertices keep that quarter, and the cars will come back." Look at your table of task 2.
# Where was the lost quarter going, and which cells hear it if it is kept? Why does a map suffer less than a lost quarter suggests? And what would you run, and count, to find out whether the lattice or
# something else loses the cars? Name what each run switches off. Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "three-errors", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The quarter was on its way to a place in the space of features where no cell is. So a part of it should go, because nobody is there to hear it. Another part would have reached cells further on: with the empty vertices around, the sums come nearer to the exact ones, at several times as many vertices. A vertex that keeps it
# gives it to the cells that are there already. They hear each other too loudly: in five dimensions the sums are about three times the exact ones, and the error of a row is larger than with the loss. A map suffers little, because equation (4) is
# normalised: each kernel is divided by its own sums, and a common factor cancels. Only the shape counts. To find the cause, count the true car cells that are found by the network, by the lattice, by all pairs (no kernel error), by all
# pairs with more iterations (no convergence error). Mean field's own error is left: compare the energies of the map with the cars put back and without. If all lose about as many, and the cars make the map dearer, it is the model: change its weights and count again.
# One point for where the quarter goes or what normalisation does; one for a comparison in which one cause is switched off.

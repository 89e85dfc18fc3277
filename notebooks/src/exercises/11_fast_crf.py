# %% [markdown]
# # Exercise 11: the fast CRF
#
# Five functions that end in a CRF of your own, which refines the sample drive, and one question to answer in words. About 100 minutes.
# The lecture is [11: the fast CRF](../11_fast_crf.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | a Gaussian along rows, then along columns | 2 |
# | 2 | the simplex around a point, and its barycentric weights | 2 + 1 |
# | 3 | splat, blur, slice | 3 |
# | 4 | what the *other* cells say | 2 |
# | 5 | a CRF of your own | 3 + 1 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.answers import answer_array
from semgrid_edu.answers import peak_megabytes
from semgrid_edu.crf import PermutohedralLattice, SeparableGaussian  # task 5 may use them

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=1e-3), f"{what} {got:.4f}: {hint}"


# %% [markdown]
# ## Task 1: a Gaussian along rows, then along columns (2 points)
#
# `values` is a map, `(H, W)`. With $r_i$ the row and the column of cell $i$, the spatial kernel of equation (4) sums
#
# $$ \text{blurred}_i = \sum_j \exp\!\left(-\frac{|r_i - r_j|^2}{2\sigma^2}\right) \text{values}_j $$
#
# over **all** cells of the map, cell $i$ included. Nothing is normalised, and beyond the map there are no cells.
#
# Complete `blur_map`: it returns the blurred map, `(H, W)`, in two passes, so that a map of 300 x 200 cells takes no time and little memory.


# %% nbgrader={"grade": false, "grade_id": "blur-map", "locked": false, "schema_version": 3, "solution": true, "task": false}
def blur_map(values, sigma):
    """Return the sums over all cells, weighted by a Gaussian of the distance, (H, W)."""
    ### BEGIN SOLUTION
    rows, columns = (np.exp(-0.5 * np.subtract.outer(a, a) ** 2 / sigma**2) for a in map(np.arange, values.shape))
    return rows @ values @ columns
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "blur-map-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # This sigma gives 0.8 to a neighbour, so 0.8 ** 4 = 0.41 at distance 2 and 0.8 ** 9 = 0.13 at distance 3. Two cells aren't 0.
    sigma = np.sqrt(-0.5 / np.log(0.8))
    values = np.array([[1.0, 0, 0, 0], [0, 0, 0, 2.0]])
    got = answer_array(blur_map(values, sigma), "blur_map")  # by hand, cell (0, 1): 0.8 * 1 + 0.8 * 0.41 * 2 = 1.455
    assert got.shape == (2, 4), f"expected the shape of the map, (2, 4), got {got.shape}: is it turned?"
    slips = {
        0.8000: "row 1 isn't heard in row 0: the second pass must blur what the first pass left, not the map itself",
        0.0000: "only columns are blurred: blur rows too, one after the other",
        0.8548: "the factor 2 below sigma**2 is missing",
        1.0923: "you divide by sigma instead of sigma**2",
        1.8240: "the distance isn't squared",
        0.3555: "nearly: the two passes have different widths",
    }
    _explain("cell (0, 1) is", got[0, 1], slips)
    assert got[0, 1] > 0.5, f"cell (0, 1) is {got[0, 1]:.4f}: that is normalised. The sum is asked for, not a mean"
    slips = {
        2.2800: "it hears cell (1, 3) too well: your blur goes round, from the last column to the first; the map ends there",
        0.2147: "it doesn't hear itself: cell i is included in the sum",
    }
    _explain("cell (0, 0) is", got[0, 0], slips)
    np.testing.assert_allclose(got, [[1.2147, 1.4554, 1.6896, 1.7342], [1.0684, 1.4592, 1.9277, 2.1074]], atol=2e-3)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_blur_map(blur_map)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: the simplex around a point (2 + 1 points)
#
# `y` is a point of the permutohedral lattice's space in `d` dimensions: `d + 1` numbers that sum to zero. Vertices are integers that sum to zero and have the
# same remainder modulo `d + 1`.
#
# Complete `enclosing_simplex`: it returns `corners`, an integer array `(d + 1, d + 1)`, one row per corner of the simplex around `y`, where row $m$ has
# remainder $m$; and `weights`, `(d + 1,)`, the barycentric weights of these corners. Round first, repair the sum, then sort.


# %% nbgrader={"grade": false, "grade_id": "enclosing-simplex", "locked": false, "schema_version": 3, "solution": true, "task": false}
def enclosing_simplex(y):
    """Return the corners around y, (d + 1, d + 1), by remainder, and their weights, (d + 1,)."""
    ### BEGIN SOLUTION
    size = len(y)
    origin = size * np.rint(y / size).astype(int)
    while origin.sum() > 0:
        origin[np.argmin(y - origin)] -= size
    while origin.sum() < 0:
        origin[np.argmax(y - origin)] += size
    order = np.argsort(origin - y)  # the largest residual first
    residual = (y - origin)[order]
    corners = [origin]
    for smallest in order[:0:-1]:
        forward = np.ones(size, int)
        forward[smallest] -= size
        corners.append(corners[-1] + forward)
    gaps = (residual[:-1] - residual[1:])[::-1] / size
    return np.array(corners), np.concatenate([[1 - gaps.sum()], gaps])
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "corners-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _corner_hint(corners):
    """Return what is wrong with the corners around y = (1.7, 1.6, -3.3), or nothing."""
    sums, remainders = corners.sum(axis=1), [sorted(set(row)) for row in (corners % 3).tolist()]
    if (sums != 0).all():
        return "no corner sums to 0. Repair the sum after rounding, before you step"
    if (sums != 0).any():
        return "corners that don't sum to 0. A step adds 1 to d coordinates and takes d from one"
    if any(len(row) > 1 for row in remainders):
        return "these are no vertices: within a row, remainders modulo 3 differ"
    if [row[0] for row in remainders] == [0, 2, 1]:
        return "rows are in the order 0, 2, 1 of remainders: a step adds 1 to d coordinates, and takes d from one"
    if [row[0] for row in remainders] != [0, 1, 2]:
        return "row m is the corner with remainder m: 0, 1, 2"
    first, second = corners[:2].tolist()
    if first in ([0, 3, -3], [3, 3, -6]):
        return f"you changed the {'first' if first[0] == 0 else 'last'} coordinate; change the one that was rounded up the farthest"
    if second == [4, -2, -2]:
        return (
            "the coordinate with the smallest residual loses d, not the one with the largest. "
            "Sort the residuals as they are after the repair, not before"
        )


# %% nbgrader={"grade": true, "grade_id": "corners-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # (1.7, 1.6, -3.3), rounded: (3, 3, -3), whose sum is 3. By hand: (3, 0, -3), residuals (-1.3, 1.6, -0.3).
    y = np.array([1.7, 1.6, -3.3])
    got = enclosing_simplex(y)
    assert got is not None, "enclosing_simplex returned nothing: did you forget `return`?"
    assert isinstance(got, (tuple, list)), "return two arrays: corners and weights"
    assert len(got) == 2, "return two arrays: corners and weights"
    corners = answer_array(got[0], "for the corners enclosing_simplex")
    assert corners.shape == (3, 3), f"expected 3 corners of 3 coordinates, got shape {corners.shape}"
    hint = _corner_hint(corners)
    assert not hint, f"{corners.tolist()}: {hint}"
    np.testing.assert_array_equal(corners, [[3, 0, -3], [1, 1, -2], [2, 2, -4]], err_msg="the corners, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_corners(enclosing_simplex)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "weights-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    y = np.array([1.7, 1.4, -3.1])  # rounded: (3, 0, -3), whose sum is 0. By hand: residuals (-1.3, 1.4, -0.1)
    got = enclosing_simplex(y)
    assert isinstance(got, (tuple, list)), "return two arrays: corners and weights"
    weights = answer_array(got[-1], "for the weights enclosing_simplex")
    assert weights.shape == (3,), f"expected one weight for each corner, shape (3,), got {weights.shape}"
    assert not np.isclose(weights.sum(), 3), "the weights sum to 3: divide the gaps by d + 1"
    assert not np.isclose(weights[1:].sum(), 2.7), "the gaps are between residuals: divide them by d + 1"
    assert not np.isclose(weights[0], 0), "the first corner gets what the others leave: 1 - 0.4 - 0.5"
    assert np.isclose(weights.sum(), 1), f"the weights sum to {weights.sum():.3f}, not to 1"
    assert not np.allclose(weights, [0.1, 0.5, 0.4], atol=1e-3), (
        "weights of corners 1 and 2 are swapped: corner 1 was reached by stepping back in the smallest residual, so its gap is the last"
    )
    assert (weights > -1e-9).all(), f"a weight is negative, {weights.round(3)}: the point would lie outside its simplex"
    np.testing.assert_allclose(weights, [0.1, 0.4, 0.5], atol=1e-3, err_msg="the gaps, by hand: 1.2 / 3 and 1.5 / 3")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_weights(enclosing_simplex)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: splat, blur, slice (3 points)
#
# `simplices` is a list with one pair for each of N points: `corners`, an integer array `(d + 1, d + 1)`, and `weights`, `(d + 1,)`, as from task 2. `values` is
# `(N, K)`. The filter
#
# 1. *splats*: a vertex gets the sum of `weight * value` of all points around it. Only vertices that are a corner of some point exist;
# 2. *blurs* along direction 0, then 1, ... up to `d`: each vertex gets 1/2 of its value, and 1/4 of its neighbour one step ahead and 1/4 of that one step
#    behind. A step in direction `j` adds 1 to all coordinates but the `j`-th, from which it takes `d`. A neighbour that doesn't exist counts as 0;
# 3. *slices*: a point gets the weighted mean of its corners, with the same weights.
#
# Complete `lattice_filter`: it returns `(N, K)`.


# %% nbgrader={"grade": false, "grade_id": "lattice-filter", "locked": false, "schema_version": 3, "solution": true, "task": false}
def lattice_filter(simplices, values):
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
        vertices = {
            v: x / 2 + vertices.get(tuple(v + forward), 0) / 4 + vertices.get(tuple(v - forward), 0) / 4
            for v, x in vertices.items()
        }
    return np.array([sum(w * vertices[tuple(c)] for c, w in zip(*simplex, strict=True)) for simplex in simplices])
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "lattice-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_LATTICE_SLIPS = {  # what point 0 of the test gets by a common slip
    14.0000: "nothing is blurred between splat and slice",
    12.5000: "you blur along one direction only: there are d + 1",
    43.7500: "you blur with (1/2, 1, 1/2): the vertex keeps a half, its neighbours give a quarter each",
    26.9375: "you blur with (1/4, 1, 1/4): the vertex itself keeps a half",
    12.1250: "slice with the weights of splat, not with a plain mean",
    24.2500: "you slice without weights",
    9.8125: "two points share the vertex in the middle: add to it, don't overwrite",
    21.7500: "you splat without weights: a point shares its value out",
    11.5000: "you blur into vertices that don't exist: only corners of points do",
    6.5625: "you blur with the neighbour ahead only",
    7.1250: "you blur with the neighbour behind only",
    3.5000: "no neighbour is found: a step adds 1 to all coordinates but one, and takes d from that one",
    10.7266: "a blur must read old values only; you change vertices while others still read them",
}


# %% nbgrader={"grade": true, "grade_id": "lattice-filter-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    # One dimension: two points share the vertex in the middle of three. By hand: splat 12, 20, 16; blurred once 11, 17, 13; twice 9.75, 14.5, 10.75.
    left = np.array([[0, 0], [-1, 1]]), np.array([0.75, 0.25])
    right = np.array([[-2, 2], [-1, 1]]), np.array([0.5, 0.5])
    got = lattice_filter([left, right], np.array([[16.0, 0.0], [32.0, 4.0]]))
    got = answer_array(got, "lattice_filter")  # first column, point 0: 0.75 * 9.75 + 0.25 * 14.5 = 10.94
    assert got.shape == (2, 2), f"expected N rows of K values, (2, 2), got {got.shape}"
    _explain("point 0 gets", got[0, 0], _LATTICE_SLIPS)
    np.testing.assert_allclose(got, [[10.9375, 0.78125], [12.625, 1.1875]], atol=1e-4, err_msg="both points, by hand")
    corners, at_first = np.array([[0, 0, 0], [1, 1, -2], [2, -1, -1]]), np.array([1.0, 0, 0])
    triangle = [(np.roll(corners, -k, axis=0), at_first) for k in range(3)]  # one point on each corner
    got = answer_array(lattice_filter(triangle, np.array([[64.0], [0], [0]])), "lattice_filter").ravel()
    assert not np.array_equal(got, [9, 4, 6]), "the order of the directions is 0, 1, ... d: you begin with the last"
    np.testing.assert_allclose(got, [9, 6, 4], err_msg="a triangle: each of the 3 directions joins two of its corners")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_lattice_filter(lattice_filter)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: what the other cells say (2 points)
#
# `blur` is a filter: a function that takes `(N, K)` values and returns `(N, K)`, and that is linear: $\text{blur}(Q)_i = \sum_j k_{ij} Q_j$. You can call it, but you
# can't look inside. Mean field needs the sum without the cell itself, $\sum_{j \ne i} k_{ij} Q_j$.
#
# Complete `others_say`: it returns these sums, `(N, K)`. What does the filter give back to cell $i$ if cell $i$ alone has a value? (On a large grid one would work
# out $k_{ii}$ from the lattice. Here N is small enough to ask.)


# %% nbgrader={"grade": false, "grade_id": "others-say", "locked": false, "schema_version": 3, "solution": true, "task": false}
def others_say(blur, Q):
    """Return the filtered values without what each cell tells itself, (N, K)."""
    ### BEGIN SOLUTION
    own = np.diag(blur(np.eye(len(Q))))
    return blur(Q) - own[:, None] * Q
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "others-say-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    kernel = np.array([[1.1, 0.5, 0.2], [0.5, 0.9, 0.4], [0.2, 0.4, 0.8]])
    Q = np.array([[0.9, 0.1], [0.5, 0.5], [0.2, 0.8]])
    before = Q.copy()
    got = others_say(lambda values: kernel @ values, Q)  # by hand, cell 0, class 0: 0.5 * 0.5 + 0.2 * 0.2 = 0.29
    got = answer_array(got, "others_say")
    assert np.array_equal(Q, before), "others_say changed its argument `Q`: work on a copy"
    assert got.shape == (3, 2), f"expected the shape of Q, (3, 2), got {got.shape}"
    slips = {
        1.28: "nothing is subtracted: the filter counts the cell itself",
        0.38: "you subtract Q itself, as if k_ii were 1: this filter has another k_ii in each cell",
        -0.34: "you subtract the sum of the kernel's row: k_ii is what comes back to cell i when cell i alone has a value",
        0.18: "you subtract k_ii without Q: a cell tells itself k_ii * Q",
        0.99: "that is what the cell tells itself: subtract it from the whole sum",
        -0.29: "the sign is swapped",
        0.1611: "you divide by the sum of the kernel's row: the sum is asked for",
        0.56: "that is k_ii of cell 2, taken for all cells: each cell has its own",
    }
    _explain("cell 0, class 0:", got[0, 0], slips)
    np.testing.assert_allclose(got, [[0.29, 0.41], [0.53, 0.37], [0.38, 0.22]], err_msg="by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_others_say(others_say)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: a CRF of your own (3 + 1 points)
#
# Now the stage `refine` of the pipeline. `log_g` is `(C, H, W)`: the logarithms of the network's probabilities. `o` is `(4, H, W)`: the occupancy grid. Complete
# `refine`: it returns refined probabilities, `(C, H, W)`, by **10 iterations** of mean field on equation (4), with the package's defaults for cells of 0.5 m:
#
# - bilateral kernel: weight 4, widths 3.2 cells in place and 0.2 in the four probabilities;
# - spatial kernel: weight 3, width 1.2 cells;
# - each kernel $K$ is normalised to $D^{-1/2} K D^{-1/2}$, where $D$ holds its row sums, that is, what it makes of a map of ones.
#
# You may use the package's filters, or your own of tasks 1 to 3:
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
# For one more point: no matrix of all pairs, so that it can refine the maps of a drive. Lecture 10's damping isn't needed with these settings; if you use it,
# that is right too. (The test accepts the result with damping by $p_i$ as in lecture 10, by 0.9 or by 0.95, and
# without any.)


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


# %% nbgrader={"grade": false, "grade_id": "all-pairs", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _all_pairs(log_g, o, w=(4, 3), widths=(3.2, 0.2, 1.2), own=1, root=0.5, sign=1, rounds=10, keep=0, log=True):
    """Do the same with a matrix of all pairs; other keywords make mistakes."""
    place, flat, K = np.indices(o.shape[1:]).reshape(2, -1).T, log_g.reshape(len(log_g), -1), 0
    for weight, f in (
        (w[0], np.hstack([place / widths[0], o.reshape(4, -1).T / widths[1]])),
        (w[1], place / widths[2]),
    ):
        k = np.exp(-0.5 * ((f[:, None] - f) ** 2).sum(axis=-1))
        K = K + weight * k / np.outer(k.sum(axis=1) ** root, k.sum(axis=1) ** root)
    K -= own * np.diag(np.diag(K))
    flat = flat if log else np.exp(flat)
    log_Q = flat
    for _ in range(rounds + 1):
        Q = np.exp(log_Q - log_Q.max(axis=0)) / np.exp(log_Q - log_Q.max(axis=0)).sum(axis=0)
        log_Q = flat + keep * (log_Q - flat) + sign * Q @ K
    return Q.reshape(log_g.shape)


def _street():
    """Return the classes (13, 10) of a street, log g (4, 13, 10) that guesses them, and its occupancy o (4, 13, 10)."""
    rng, on_right = np.random.default_rng(11), np.arange(10) > 4
    truth, state = (np.arange(13) > 5)[:, None] + 2 * on_right, on_right + np.zeros((13, 1), int)
    log_g = np.log(rng.dirichlet(np.ones(4), (13, 10)) * 0.7 + 0.3 * np.eye(4)[truth]).transpose(2, 0, 1)
    return truth, log_g, (0.1 * rng.dirichlet(np.ones(4), (13, 10)) + 0.9 * np.eye(4)[state]).transpose(2, 0, 1)


# %% nbgrader={"grade": false, "grade_id": "refine-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_REFINE_SLIPS = {
    "what a cell tells itself isn't subtracted: see task 4": {"own": 0},
    "the kernels aren't normalised: D^-1/2 K D^-1/2": {"root": 0},
    "you divide by the row sums twice: scale by 1 / sqrt(D) before and after the filter": {"root": 1},
    "the sign of the sum is wrong: agreeing neighbours raise log Q": {"sign": -1},
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


# %% nbgrader={"grade": true, "grade_id": "refine-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
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
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import fast_crf

    complaint = fast_crf.check_refine(refine)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "refine-memory-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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
        f"3120 cells took {megabytes:.0f} MB: you write all pairs down; the paper's grid would take 24 GB"
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
# ## Task 6: in your own words (2 points)
#
# After the CRF most pedestrians are gone from your map. A colleague says: "That is the lattice's kernel, which isn't quite Gaussian. Let us use
# `mean_field_accurate` and 50 iterations instead of 10." Which three errors must be told apart here? Which of them does the proposal remove, and what would you
# measure to find out which one costs the pedestrians? Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "three-errors", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The kernel error (another kernel than equation (4)'s, at the same number of iterations), the convergence error (mean field stopped early), and the error of mean field itself against exact
# inference, which no filter removes: those are the lecture's three. (An answer that names the error of the model instead of the third is right, too: even the exact minimum of equation (3) with these weights may be
# wrong, because the pair terms pull a few cells towards their many neighbours.) `mean_field_accurate` removes the first and 50 iterations remove the second; neither touches mean field or the model. To find out: count the pedestrians' cells that are found by the network, by
# `mean_field` and by `mean_field_accurate` with 10 and with 50 iterations. In the lecture the lattice and the window lose about as many, so the model costs them: then weights and widths must be
# searched on labelled frames, with a metric that counts small classes. One point for the three errors, one for a measurement that separates them.

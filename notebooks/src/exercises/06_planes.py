# %% [markdown]
# # Exercise 06: sampling that learns
#
# Six small functions: equation (2), two black boxes, a camera that learns, a sparse matrix; and one question in words. About 90 minutes. The lecture is [06: sampling that learns](../06_planes.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | four pixels and their weights | 2 + 1 |
# | 2 | a bug in the way back | 3 |
# | 3 | a camera that learns: the slope of a loss in the yaw | 3 |
# | 4 | half a pixel: which convention a black box has | 2 + 1 |
# | 5 | put together: your sampler on two streets | 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.
#
# As everywhere in this course u runs to the right, v down, and the centre of the first pixel is (0, 0). Arrays are indexed by row, then column.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=2e-3), f"{what} {got:.4g}: {hint}"


# %% [markdown]
# ## Task 1: four pixels and their weights (2 + 1 points)
#
# A point lies at (`u`, `v`) in an image of `h` rows and `w` columns, $0 \le u \le w - 1$ and $0 \le v \le h - 1$. Which four pixels does it read, and
# with which weights?
#
# Complete `four_pixels`: it returns three lists (or arrays) of four entries, `rows`, `cols` and `weights`, in any order of the pixels. For one more point:
# on the last row or column, and on a pixel's centre, some of the four don't count. Every pixel that you return must exist all the same, and the weights
# must still sum to 1.


# %% nbgrader={"grade": false, "grade_id": "four-pixels", "locked": false, "schema_version": 3, "solution": true, "task": false}
def four_pixels(u, v, h, w):
    """Return rows, columns and weights of the four pixels that a point reads."""
    ### BEGIN SOLUTION
    top, left = int(np.floor(v)), int(np.floor(u))
    down, across = v - top, u - left
    bottom, right = min(top + 1, h - 1), min(left + 1, w - 1)
    weights = [(1 - down) * (1 - across), (1 - down) * across, down * (1 - across), down * across]
    return [top, top, bottom, bottom], [left, right, left, right], weights
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "weight-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_WEIGHT_SLIPS = {
    0.1: "the weights are crossed: the nearer pixel has the larger one",
    0.15: "the weights across are crossed: column 1 is nearer than column 2",
    0.3: "the weights down are crossed: row 0 is nearer than row 1",
    0.025: "you add half a pixel to u and v: the centre of the first pixel is (0, 0) already",
    1.35: "you add the weights across and down: multiply them",
    0.3375: "you take a mean of the weights across and down: multiply them",
    0.528: "you use the distance as the crow flies: a weight across times a weight down",
}


def _four(got):
    """Return rows, columns and weights, four numbers each."""
    assert got is not None, "four_pixels returned nothing: did you forget `return`?"
    assert np.iterable(got), f"return three things, rows, cols and weights; got {got}"
    assert len(got) == 3, f"return three things, rows, cols and weights; got {got}"
    names = ("for the rows", "for the columns", "for the weights")
    rows, cols, weights = (
        answer_array(part, f"{name} four_pixels").ravel() for part, name in zip(got, names, strict=True)
    )
    assert len(rows) == len(cols) == len(weights) == 4, "return four rows, four columns and four weights"
    return rows, cols, weights


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "weights-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: across 0.75 and 0.25, down 0.6 and 0.4; so 0.45 and 0.15 in row 0, 0.30 and 0.10 in row 1.
    rows, cols, weights = _four(four_pixels(1.25, 0.4, h=3, w=4))
    read = {(int(r), int(c)): float(x) for r, c, x in zip(rows, cols, weights, strict=True)}
    assert len(read) > 1, f"pixel {min(read)} alone: that is the nearest one, but a point reads four"
    assert (2, 0) not in read, f"pixels {sorted(read)}: rows and columns are swapped: u counts columns, v counts rows"
    assert min(rows) >= 0, (
        f"there is no row {min(rows):g}: the centre of the first pixel is (0, 0), so take no half off"
    )
    assert (0, 2) in read, f"pixels {sorted(read)}: u = 1.25 lies between columns 1 and 2, v = 0.4 between rows 0 and 1"
    _explain("pixel (0, 1) has the weight", read.get((0, 1), 0), _WEIGHT_SLIPS)
    by_hand = {(0, 1): 0.45, (0, 2): 0.15, (1, 1): 0.30, (1, 2): 0.10}
    for pixel, weight in by_hand.items():
        assert np.isclose(read.get(pixel, 0), weight), f"pixel {pixel}: expected {weight}, got {read.get(pixel, 0):.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_four_pixels(four_pixels)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "border-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    for u, v, where in ((1.0, 1.0, "a pixel's centre"), (1.5, 3.0, "the last row"), (3.0, 0.5, "the last column")):
        rows, cols, weights = _four(four_pixels(u, v, h=4, w=4))
        _, cols_before, weights_before = _four(four_pixels(u - 1e-6, v - 1e-6, h=4, w=4))  # a hair before the place
        point, total = f"({u}, {v}), on {where}", weights.sum()
        assert not np.isclose(total, 0), (
            f"{point}: all weights are 0. Where u is an integer, floor and ceil are the same"
        )
        usual = np.isclose(weights_before.sum(), 1)
        assert np.isclose(total, 1) or not usual, f"{point}: the weights sum to {total:.2f}, not 1"
        there = (rows >= 0) & (rows < 4) & (cols >= 0) & (cols < 4)
        missing = [(int(r), int(c)) for r, c in zip(rows[~there], cols[~there], strict=True)]
        assert not missing, f"{point}: you return pixel {missing[0]} of an image of 4 x 4; take one that exists"
        mean, usual = weights @ cols, np.isclose(weights_before @ cols_before, u, atol=1e-4)
        place = f"the pixels' mean column, by weight, must be that of the point; it is {mean:.3f}"
        assert np.isclose(mean, u) or not usual, f"{point}: {place}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_border(four_pixels)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: a bug in the way back (3 points)
#
# A wrong backward pass stops nothing: the network still learns, a little worse. Somebody hands you two black boxes. `forward(s)` takes an image `(h, w)` and
# returns what n points read, `(n,)`, by equation (2). The points are fixed, but nobody tells you where they are: all between pixels, and some pixels are read by more
# than one point. `backward(p_bar)` takes a gradient `(n,)` and returns one for the image, `(h, w)`. It is one of four:
#
# | kind | what it returns |
# |---|---|
# | `PAIR` | what it should: for each pixel weight times gradient, added up over all points that read it |
# | `OVERWRITES` | the share of the last point (the highest number) that reads a pixel; the shares of the others are lost |
# | `MEAN` | the right sums, divided by n |
# | `NEAREST` | the whole gradient of each point goes to the pixel with its largest weight, added up |
#
# The adjoint test of the lecture only tells `PAIR` from the others. Complete `which_kind`: it returns one of the four. You may call the boxes with whatever
# you like, as often as you like.


# %% nbgrader={"grade": false, "grade_id": "boxes", "locked": true, "schema_version": 3, "solution": false, "task": false}
PAIR, OVERWRITES, MEAN, NEAREST = range(4)
_POINTS = np.array([[0.3, 0.4], [0.7, 0.2], [1.2, 1.7], [2.6, 2.3], [0.4, 0.8]])


def _boxes(kind, points=_POINTS, h=4, w=4):
    """Return forward and backward of a kind, for points (n, 2) in an image of h rows and w columns."""
    down = np.maximum(0, 1 - np.abs(points[:, 1:] - np.arange(h)))
    across = np.maximum(0, 1 - np.abs(points[:, :1] - np.arange(w)))
    A = (down[:, :, None] * across[:, None, :]).reshape(len(points), h * w)

    def forward(s):
        return A @ np.asarray(s, float).reshape(h * w)

    def backward(p_bar):
        p_bar, s_bar = np.asarray(p_bar, float).reshape(-1, 1), np.zeros(h * w)
        if kind == OVERWRITES:
            for weights, share in zip(A, A * p_bar, strict=True):
                s_bar[weights > 0] = share[weights > 0]
        elif kind == NEAREST:
            np.add.at(s_bar, A.argmax(axis=1), p_bar[:, 0])
        else:
            s_bar = (A * p_bar).sum(axis=0) / (len(points) if kind == MEAN else 1)
        return s_bar.reshape(h, w)

    return forward, backward


# %% nbgrader={"grade": false, "grade_id": "which-kind", "locked": false, "schema_version": 3, "solution": true, "task": false}
def which_kind(forward, backward, h, w, n):
    """Return PAIR, OVERWRITES, MEAN or NEAREST."""
    ### BEGIN SOLUTION
    A = np.array([forward(one) for one in np.eye(h * w).reshape(-1, h, w)]).T  # (n, h * w)
    p_bar = np.linspace(1, 2, n)
    guess = {PAIR: p_bar @ A, MEAN: p_bar @ A / n, OVERWRITES: np.zeros(h * w), NEAREST: np.zeros(h * w)}
    for weights, gradient in zip(A, p_bar, strict=True):
        guess[OVERWRITES][weights > 0] = (weights * gradient)[weights > 0]
        guess[NEAREST][weights.argmax()] += gradient
    got = np.ravel(backward(p_bar))
    return min(guess, key=lambda kind: np.abs(guess[kind] - got).sum())
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "which-kind-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    names = ("PAIR", "OVERWRITES", "MEAN", "NEAREST")
    hints = (
        "find out by unit images which point reads which pixel; the right sums are A^T p_bar",
        "two points share a pixel: the later one's share replaces the sum",
        "all sums are too small by the same factor",
        "a point's whole gradient is in one pixel, that of its largest weight",
    )
    for kind, name in enumerate(names):
        got = answer_array(which_kind(*_boxes(kind), 4, 4, 5), "which_kind").ravel()
        assert got.size == 1, f"return one of the four, got {got}"
        found = names[int(got[0])] if got[0] in range(4) else f"{got[0]:g}, which is none of the four"
        assert got[0] == kind, f"the backward pass is {name}, and you find {found}: {hints[kind]}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_which_kind(which_kind)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: a camera that learns its yaw (3 points)
#
# In the lecture a camera learned its pitch. Now it is turned to the side, by a small angle $\alpha$ about its own vertical axis: a point $(X, Y, Z)$ of the
# camera's frame becomes $(X \cos\alpha + Z \sin\alpha,\; Y,\; -X \sin\alpha + Z \cos\alpha)$. Then equation (1) gives its pixel with `K` (no skew), equation (2) reads
# the scores `s`, `(h, w)`, there, and the loss is half the sum of squared differences from what the map says, `t`, `(J,)`: $\frac12 \sum_j (p_j - t_j)^2$.
#
# Complete `yaw_slope`: it returns $\partial\,\text{loss} / \partial\alpha$ at $\alpha = 0$, one number. `points` is `(J, 3)`; all of them are read inside the image,
# none on a pixel's centre line. Use the chain rule: $\bar p_j$, the slopes of the value in u *and in v*, and what $\alpha$ does to u and v. Points may lie a
# thousandth of a pixel from a centre line, where finite differences with a large step go wrong.


# %% nbgrader={"grade": false, "grade_id": "yaw-slope", "locked": false, "schema_version": 3, "solution": true, "task": false}
def yaw_slope(s, points, K, t):
    """Return the derivative of the loss in the yaw, at 0."""
    ### BEGIN SOLUTION
    total = 0.0
    for (X, Y, Z), wanted in zip(points, t, strict=True):
        u, v = K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]
        n, m = int(np.floor(v)), int(np.floor(u))
        down, across = v - n, u - m
        (a, b), (c, d) = s[n : n + 2, m : m + 2]
        p = (1 - down) * ((1 - across) * a + across * b) + down * ((1 - across) * c + across * d)
        in_u, in_v = (1 - down) * (b - a) + down * (d - c), (1 - across) * (c - a) + across * (d - b)
        u_turns, v_turns = K[0, 0] * (1 + (X / Z) ** 2), K[1, 1] * X * Y / Z**2
        total += (p - wanted) * (in_u * u_turns + in_v * v_turns)
    return total
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "yaw-slope-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    # One point, by hand: X/Z = 0.1, Y/Z = 0.1, so u = 10 * 0.1 + 0.25 = 1.25 and v = 10 * 0.1 - 0.25 = 0.75.
    s, K = np.array([[0.0, 1, 5], [0, 3, 2]]), np.array([[10.0, 0, 0.25], [0, 10, -0.25], [0, 0, 1]])
    point = np.array([[0.2, 0.2, 2.0]])
    got = answer_array(yaw_slope(s, point, K, np.array([3.5625])), "yaw_slope").ravel()
    assert got.size == 1, f"return one number, got {got}"
    # It reads 0.25 * 2 + 0.75 * 2.75 = 2.5625, 1 too little. Slopes: 0.25 in u, 0.75 in v; u turns by 10 * 1.01, v by 10 * 0.01.
    slips = {
        2.6: "the sign is turned: p_bar is what is read minus what is wanted, and alpha turns as the text says",
        -2.525: "v is missing: beside the axis and below it a yaw moves a point up or down as well",
        -2.5: "v is missing, and u turns by f_u (1 + (X/Z)^2): Z changes too",
        -2.575: "u turns by f_u (1 + (X/Z)^2): Z changes too",
        -5.2: "the half of the loss is missing: the derivative of 1/2 d^2 is d",
        -2.45: "v moves the other way: Z grows smaller where X is positive, so what lies below the axis moves down",
        -7.6: "the slopes in u and v are swapped",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got[0], slip, atol=2e-3), f"one point, got {got[0]:.4g}: {hint}"
    one = "by hand: -1 * (0.25 * 10.1 + 0.75 * 0.1)"
    np.testing.assert_allclose(got[0], -2.6, atol=1e-3, err_msg=one)
    two = answer_array(yaw_slope(s, np.repeat(point, 2, axis=0), K, np.array([3.5625, 1.5625])), "yaw_slope").ravel()
    balance = "two points, one reads 1 too little and one 1 too much: their slopes cancel, so take p - t of each"
    np.testing.assert_allclose(two[0], 0, atol=1e-3, err_msg=balance)
    twice = answer_array(yaw_slope(s, np.repeat(point, 2, axis=0), K, np.full(2, 3.5625)), "yaw_slope").ravel()
    np.testing.assert_allclose(twice[0], 2 * got[0], atol=1e-3, err_msg="two equal points: the loss is a sum, no mean")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_yaw_slope(yaw_slope)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: which convention does a black box have? (2 + 1 points)
#
# `sampler(image, u, v)` reads an image `(h, w)` at places `u`, `v`, both `(J,)`, and returns `(J,)`. It interpolates between neighbouring pixels, and holds
# the outermost ones beyond the border. But nobody has written down what its u and v mean. There are three candidates:
#
# | convention | the centre of the first pixel is | the centre of the last one is |
# |---|---|---|
# | `CENTRES` | (0, 0) | (w - 1, h - 1) |
# | `CORNERS` | (0.5, 0.5): (0, 0) is the corner of the image | (w - 0.5, h - 0.5) |
# | `STRETCHED` | (0, 0) | (w, h) |
#
# Complete `convention`: it returns the one that the sampler follows, for an image of `h` rows and `w` columns, both at least 4. You may feed it any image you
# like, except a photograph: what would that tell? For one more point: other samplers swap u and v. `convention` must then return the same, and `swaps` must
# return whether the sampler takes v for u and u for v.


# %% nbgrader={"grade": false, "grade_id": "conventions", "locked": true, "schema_version": 3, "solution": false, "task": false}
CENTRES, CORNERS, STRETCHED = range(3)


def _sampler(kind, swapped=False):
    """Return a sampler that follows a convention, and may swap u and v."""

    def place(at, size):
        at = np.asarray(at, float)
        moved = at if kind == CENTRES else at - 0.5 if kind == CORNERS else at * (size - 1) / size
        return np.clip(moved, 0, size - 1)

    def sampler(image, u, v):
        image, (u, v) = np.asarray(image, float), (v, u) if swapped else (u, v)
        h, w = image.shape
        down = np.maximum(0, 1 - np.abs(place(v, h)[:, None] - np.arange(h)))
        across = np.maximum(0, 1 - np.abs(place(u, w)[:, None] - np.arange(w)))
        return ((down @ image) * across).sum(axis=1)

    return sampler


# %% nbgrader={"grade": false, "grade_id": "convention", "locked": false, "schema_version": 3, "solution": true, "task": false}
def convention(sampler, h, w):
    """Return CENTRES, CORNERS or STRETCHED."""
    ### BEGIN SOLUTION
    axis = 0 if swaps(sampler, h, w) else 1
    ramp = np.broadcast_to(np.arange(w) if axis else np.arange(h)[:, None], (h, w)).astype(float)
    size = w if axis else h
    near, far = sampler(ramp, np.array([1.0, size - 2.0]), np.array([1.0, 1.0]))
    expected = {CENTRES: (1, size - 2), CORNERS: (0.5, size - 2.5)}
    expected[STRETCHED] = ((size - 1) / size, (size - 2) * (size - 1) / size)
    return min(expected, key=lambda kind: np.abs(np.subtract(expected[kind], (near, far))).sum())
    ### END SOLUTION


def swaps(sampler, h, w):
    """Return whether the sampler takes v for u and u for v."""
    ### BEGIN SOLUTION
    ramp = np.broadcast_to(np.arange(w, dtype=float), (h, w))
    first, second = sampler(ramp, np.array([1.0, 2.0]), np.array([1.0, 1.0]))
    return bool(np.isclose(first, second))
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "convention-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    names = ("CENTRES", "CORNERS", "STRETCHED")
    hint = (
        "feed it a ramp, in which each pixel's value is its own column: then the value read is the place that was read"
    )
    for h, w in ((5, 9), (40, 6), (6, 6)):
        for kind, name in enumerate(names):
            got = answer_array(convention(_sampler(kind), h, w), "convention").ravel()
            assert got.size == 1, f"return one of the three, got {got}"
            assert got[0] in range(3), f"return CENTRES, CORNERS or STRETCHED, got {got[0]:g}"
            found = names[int(got[0])]
            assert got[0] == kind, f"an image of {h} x {w}: the sampler is {name}, and you find {found}: {hint}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_convention(convention)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "swaps-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    for kind in range(3):
        for swapped in (False, True):
            got = swaps(_sampler(kind, swapped), 8, 5)
            assert np.size(got) == 1, f"return True or False, got {got}"
            turns = "takes v for u" if swapped else "takes u for u"
            assert bool(got) == swapped, (
                f"a sampler that {turns}, and swaps says {got}: walk along u on a ramp of columns"
            )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_swaps(swaps, convention)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: put together, your sampler on two streets (3 points)
#
# For one camera the weights never change, so build them once. `pixels` holds u and v of N points, `(N, 2)`, and `visible` says which of them the camera
# sees, `(N,)`. Complete `sampling_matrix`: it returns the sparse matrix, `(N, h * w)`, that takes a vector of scores to what the points read. The row of a
# point that isn't visible is empty: such a point reads 0, and its u and v may be anything, also NaN.
#
# `weights_of` tells which four pixels a point reads, as your `four_pixels` does, which it is unless the tests hand something else over. The pixel in row n and
# column m has the number n * w + m. Collect the numbers of the points, those of the pixels, and the weights in three lists, and give them to
# `csr_matrix((weights, (points, numbers)), shape=(N, h * w))`, which adds up entries that meet. The tests call `there_and_back`, with points of the two
# streets, which uses your matrix and its transpose; leave it as it is.


# %% nbgrader={"grade": false, "grade_id": "sampling-matrix", "locked": false, "schema_version": 3, "solution": true, "task": false}
from scipy.sparse import csr_matrix


def sampling_matrix(pixels, visible, h, w, weights_of=four_pixels):
    """Return the sparse matrix (N, h * w) from scores to what the points read."""
    ### BEGIN SOLUTION
    points, numbers, weights = [], [], []
    for point in np.flatnonzero(visible):
        rows, cols, four = weights_of(*pixels[point], h, w)
        points += [point] * 4
        numbers += [n * w + m for n, m in zip(rows, cols, strict=True)]
        weights += list(four)
    return csr_matrix((weights, (points, numbers)), shape=(len(pixels), h * w))
    ### END SOLUTION


def there_and_back(s, p_bar, pixels, visible, weights_of=four_pixels):
    """Return what points read of s (C, h, w), (C, N), and what their gradient p_bar (C, N) sends back, (C, h, w)."""
    A = sampling_matrix(pixels, visible, *s.shape[1:], weights_of)
    return (A @ s.reshape(len(s), -1).T).T, (A.T @ p_bar.T).T.reshape(s.shape)


# %% nbgrader={"grade": false, "grade_id": "streets", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _points(frame, size, cell=4.0):
    """Return u and v of the centres of cells of the ground, (N, 2), and which are in view, (N,)."""
    from semgrid_edu.camera import project, transform_points
    from semgrid_edu.grid import GridSpec

    camera, centres = frame.camera.resized(size), GridSpec(0, 64, -16, 16, cell).centers()
    on_ground = np.dstack([centres, np.zeros(centres.shape[:2])]).reshape(-1, 3)
    return project(transform_points(camera.T_camera_from_grid, on_ground), camera)


def _four_somewhere(u, v, h, w):
    """Return rows, columns and weights of four pixels that have nothing to do with the point, but are always the same."""
    rng = np.random.default_rng([int(1000 * u), int(1000 * v)])
    return rng.integers(0, h, 4), rng.integers(0, w, 4), rng.dirichlet(np.ones(4))


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "sampling-matrix-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    from semgrid_edu.datasets.samples import real_drive, sample_drive

    for street, frame in (("simulated", sample_drive()[0]), ("real", real_drive()[0])):
        s = np.random.default_rng(0).normal(size=(2, 24, 80))
        pixels, visible = _points(frame, s.shape[1:])
        p_bar = np.random.default_rng(1).normal(size=(2, len(pixels)))
        got = there_and_back(s, p_bar, pixels, visible, _four_somewhere)
        p, s_bar = (answer_array(one, "there_and_back") for one in got)
        assert p.shape == p_bar.shape, f"{len(pixels)} points of the {street} street, got the shape {p.shape}"
        assert not np.isnan(p).any(), "NaN: leave points that aren't visible out"
        assert not p[:, ~visible].any(), "a point that isn't visible reads something: its row must be empty"
        four = [_four_somewhere(*pixels[j], 24, 80) for j in np.flatnonzero(visible)]
        right = np.transpose([s[:, rows, cols] @ weights for rows, cols, weights in four])
        values = f"{street} street: not what the points read. Is the number of a pixel n * w + m?"
        np.testing.assert_allclose(p[:, visible], right, atol=1e-5, err_msg=values)
        np.testing.assert_allclose((p_bar * p).sum(), (s_bar * s).sum(), rtol=1e-5, err_msg="the adjoint test fails")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_sampling_matrix(there_and_back)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# Now it becomes the stage `sample` of the pipeline, for twenty planes. The pipeline doesn't tell this stage which camera it has, but the filter sees every
# frame first, so `track` notes it there and builds your matrix once. Take the `#` away from the last line (about ten seconds) to see how many cells of the simulated
# street get their true class, near by and far ahead. Then let all points read a pixel too high in the image: set `LOWER` to -1. Where does the map change?
# Then try +1. The far cells get *better*, although the network was trained without a shift. Before you call the camera's calibration wrong: what else could
# move the best shift?


# %%
LOWER = 0  # so many pixels lower in the image is read


def matrix_of(frame):
    """Return your matrix for all planes of the street's camera, (D * H * W, h * w)."""
    from semgrid_edu.grid import GridSpec
    from semgrid_edu.planes import plane_heights, plane_pixels

    pixels, visible = plane_pixels(GridSpec.compact(), plane_heights(), frame.camera.resized((96, 320)))
    pixels = np.add(pixels, (0, LOWER))
    visible = visible & (pixels[..., 1] >= 0) & (pixels[..., 1] <= 95)
    return sampling_matrix(pixels.reshape(-1, 2), visible.reshape(-1), 96, 320)


# %%
noted = {}


def track(frames, spec):
    """Yield the package's beliefs, and note the camera."""
    from semgrid_edu.fast import track_drive

    def looked_at():
        for frame in frames:
            if "matrix" not in noted:
                noted.update(matrix=matrix_of(frame), shape=spec.shape)
            yield frame

    noted.clear()
    return track_drive(looked_at(), spec)


def sample(s):
    """Return the scores on the planes, (C, D, H, W)."""
    return (noted["matrix"] @ s.reshape(len(s), -1).T).T.reshape(len(s), -1, *noted["shape"])


# %%
def right_cells():
    """Print how many cells of the simulated street get their true class, with your stage."""
    from semgrid_edu.datasets.samples import sample_drive
    from semgrid_edu.grid import GridSpec
    from semgrid_edu.pipeline import Stages, run_pipeline

    spec, frames = GridSpec.compact(), [sample_drive()[k] for k in range(0, 20, 4)]
    x, shares = spec.centers()[..., 0], []
    for result in run_pipeline(frames, Stages(track=track, sample=sample)):
        labels = result.frame.labels
        right, seen = result.grid.argmax(axis=0) == labels.birdseye_on(spec), labels.visible_on(spec)
        shares.append([right[seen & where].mean() for where in (x < 15, x >= 50)])
    near, far = 100 * np.mean(shares, axis=0)
    print(f"{near:.0f} % of the cells up to 15 m ahead have their true class, and {far:.0f} % from 50 m on")


# right_cells()

# %% [markdown]
# Put `import numpy as np`, your `four_pixels` and `sampling_matrix` with its import, and the two cells with `matrix_of` and `sample` into a file `my_stages.py`, and run
#
#     semgrid-edu demo --stages my_stages.py
#
# It shows both streets, the real one too, with your planes and with the package's. Where do the maps differ, near by or far ahead?
#
# ## Task 6: in your own words (2 points)
#
# To save time, a colleague lets each point read its nearest pixel instead of four. The network still trains, nearly as well. Why does it, although the
# stairs have no slope? What can't be learnt any more? And where on the map would you look for the damage: near the vehicle, or far away? Five sentences are
# enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "nearest", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The scores are what learns, and for them the sampling stays linear: a matrix with a single 1 in each row, whose transpose hands the whole gradient to the one
# pixel that was read. No slope in u and v is needed while the calibration is fixed. What can't be learnt any more is whatever moves the points: the
# calibration, the height of a plane, the pose of the vehicle, for the gradient in u and v is zero. The damage is a rounding of up to half a pixel:
# centimetres near the vehicle, where a pixel is small, but up to five metres of ground at 60 m, where edges jump in steps a pixel deep. One point for the
# gradient in the scores, one for what moves or for the far end of the map.

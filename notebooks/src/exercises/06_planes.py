# %% [markdown]
# # Exercise 06: sampling that learns
#
# Five small functions: equation (2), the way back, a camera that learns, a black box; and one question in words. About 75 minutes. The lecture is [06: sampling that learns](../06_planes.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | four pixels and their weights | 2 + 1 |
# | 2 | a plane | 2 + 1 |
# | 3 | the way back | 2 + 1 |
# | 4 | a camera that learns: the slope of a loss in the yaw | 3 |
# | 5 | half a pixel: which convention a black box has | 2 + 1 |
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

from semgrid_edu.answers import answer_array

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


# %% nbgrader={"grade": false, "grade_id": "weight-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
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


# %% nbgrader={"grade": true, "grade_id": "weights-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
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


# %% nbgrader={"grade": true, "grade_id": "border-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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
# ## Task 2: a plane (2 + 1 points)
#
# `s` are scores, `(C, h, w)`. `pixels` holds u and v of each point of one plane, `(H, W, 2)`, and `visible` says which points the camera sees, `(H, W)`.
#
# Complete `sample_plane`: it returns what the points read, `(C, H, W)`, by equation (2). For one more point: a point that isn't visible takes 0. Its u and
# v may be anything, also NaN.


# %% nbgrader={"grade": false, "grade_id": "sample-plane", "locked": false, "schema_version": 3, "solution": true, "task": false}
def sample_plane(s, pixels, visible):
    """Return the scores on one plane, (C, H, W)."""
    ### BEGIN SOLUTION
    n, m = np.arange(s.shape[1]), np.arange(s.shape[2])
    p = np.zeros((s.shape[0], *visible.shape))
    for j in zip(*np.nonzero(visible), strict=True):
        u, v = pixels[j]
        p[:, *j] = np.maximum(0, 1 - np.abs(v - n)) @ s @ np.maximum(0, 1 - np.abs(u - m))
    return p
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "plane-scores", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _scores():
    """Return scores of two classes in an image of 3 x 3, and six points in it, (3, 2, 2)."""
    s = np.array([[[0.0, 10, 20], [2, 7, 20], [1, 6, 15]], [[0, 0, 0], [5, 0, 0], [0, 0, 0]]])
    return s, np.array([[[0.25, 1.0], [1.25, 0.5]], [[2.0, 2.0], [0.0, 1.5]], [[1.0, 0.0], [1.5, 1.5]]])


# %% nbgrader={"grade": true, "grade_id": "plane-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_array(sample_plane(*_scores(), np.ones((3, 2), bool)), "sample_plane")
    assert got.shape == (2, 3, 2), f"expected one value a class and point, shape (2, 3, 2), got {got.shape}"
    slips = {  # of class 0, point (0, 0), at u = 0.25, v = 1: by hand 0.75 * 2 + 0.25 * 7 = 3.25
        9.25: "u and v are swapped: u counts columns, v counts rows",
        5.75: "the weights are crossed: column 0 is nearer than column 1",
        2.0: "that is the nearest pixel",
        9.0: "you add the two pixels: the weights must sum to 1",
        -11.75: "a kernel below zero: a pixel farther than 1 away has the weight 0, not less: max(0, 1 - |t|)",
        5.25: "you read half a pixel too far right and down: the centre of the first pixel is (0, 0)",
    }
    first, last = got[0, 0, 0], got[0, 1, 0]
    _explain("point (0.25, 1) reads in class 0", first, slips)
    assert np.isclose(first, 3.25), f"point (0.25, 1): expected 3/4 of 2 and 1/4 of 7, 3.25, got {first:.3f}"
    assert np.isclose(last, 15), f"point (2, 2) lies on the last pixel and reads 15, got {last:.3f}"
    by_hand = [[[3.25, 11.375], [15, 1.5], [10, 12]], [[3.75, 0], [0, 2.5], [0, 0]]]
    np.testing.assert_allclose(got, by_hand, atol=1e-6, err_msg="all points of both classes, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_sample_plane(sample_plane)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "invisible-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    s, inside = _scores()
    full = answer_array(sample_plane(s.copy(), inside.copy(), np.ones((3, 2), bool)), "sample_plane")
    pixels, visible = inside.copy(), np.array([[False, True], [False, False], [True, True]])
    pixels[0, 0], pixels[1, 1] = np.nan, (-7.5, 400.0)
    got = answer_array(sample_plane(s, pixels, visible), "sample_plane")
    assert got.shape == full.shape == (2, 3, 2), f"expected one value a class and point, (2, 3, 2), got {got.shape}"
    assert not np.isnan(got).any(), (
        "NaN: NaN times 0 is NaN, and so is NaN in a sum. Leave such points out, don't weigh them"
    )
    hidden = f"point (1, 0) lies in the image but isn't visible (something hides it): 0, not {got[0, 1, 0]}"
    assert got[0, 1, 0] == 0, hidden
    assert got[0, 1, 1] == 0, f"point (1, 1) lies outside the image: 0, not {got[0, 1, 1]}"
    assert got[:, visible].any(), "the visible points read 0: only those that aren't visible do"
    same = "the visible points read what they read when all are visible"
    np.testing.assert_allclose(got[:, visible], full[:, visible], err_msg=same)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_invisible(sample_plane)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: the way back (2 + 1 points)
#
# Now the loss speaks. `p_bar` says by how much the loss grows when a value on the plane grows, `(C, H, W)`. What does that mean for the scores? Nudge a
# pixel in your mind: who reads it, and how much of it?
#
# Complete `give_back`: it returns $\bar s$, `(C, h, w)`. No automatic differentiation: numpy is enough. For one more point: points
# that aren't visible teach nobody, whatever their u and v are.


# %% nbgrader={"grade": false, "grade_id": "give-back", "locked": false, "schema_version": 3, "solution": true, "task": false}
def give_back(p_bar, pixels, visible, h, w):
    """Return the gradient of the loss in the scores, (C, h, w)."""
    ### BEGIN SOLUTION
    n, m = np.arange(h), np.arange(w)
    s_bar = np.zeros((len(p_bar), h, w))
    for j in zip(*np.nonzero(visible), strict=True):
        u, v = pixels[j]
        weights = np.outer(np.maximum(0, 1 - np.abs(v - n)), np.maximum(0, 1 - np.abs(u - m)))
        s_bar += p_bar[:, *j, None, None] * weights
    return s_bar
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "back-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _blame():
    """Return p_bar (2, 1, 3) and pixels (1, 3, 2): three points, two of them between columns 0 and 1 of row 0."""
    pixels = np.array([[[0.5, 0.0], [0.25, 0.0], [1.25, 0.5]]])
    return np.array([[[1.0, 2.0, 4.0]], [[10.0, 20.0, 40.0]]]), pixels


_BACK_SLIPS = {  # of pixel (0, 0): by hand 0.5 * 1 + 0.75 * 2 = 2.0
    1.5: "the second reader's blame replaces that of the first: add them up (`a[rows, cols] +=` adds once a pixel)",
    0.5: "only the first reader counts: add up all of them (or do you divide by the number of points?)",
    0.667: "you divide by the number of points: a sum has no mean in it",
    1.0: "you take the mean over a pixel's readers: add them up",
    1.6: "you divide by the sum of the weights: add up, a pixel that is read twice gets blamed twice",
    1.375: "the weights are squared: blame times weight, once",
    1.25: "that is the sum of the weights: multiply each with what the loss says of its reader",
    -2.0: "the sign is turned: this is the gradient; the step against it comes later",
    22.0: "you add up the classes: each has its own gradient",
}


# %% nbgrader={"grade": true, "grade_id": "give-back-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    p_bar, pixels = _blame()
    got = answer_array(give_back(p_bar, pixels, np.ones((1, 3), bool), h=3, w=4), "give_back")
    assert got.shape == (2, 3, 4), f"expected one number a class and pixel, shape (2, 3, 4), got {got.shape}"
    assert got[0, 1, 0] == 0, "pixel (1, 0) is read by nobody, yet it learns: u counts columns, v counts rows"
    _explain("pixel (0, 0) gets in class 0", got[0, 0, 0], _BACK_SLIPS)
    assert not np.allclose(got, np.round(got)), "all blame goes to the nearest pixel, but a point reads up to four"
    by_hand = np.array([[2.0, 2.5, 0.5, 0], [0, 1.5, 0.5, 0], [0, 0, 0, 0]])
    np.testing.assert_allclose(got, [by_hand, 10 * by_hand], atol=1e-6, err_msg="by hand, both classes")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_give_back(give_back)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "give-back-invisible-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # The same three points, and one that isn't visible, whose place is NaN.
    p_bar, pixels = _blame()
    wanted = answer_array(give_back(p_bar.copy(), pixels.copy(), np.ones((1, 3), bool), h=3, w=4), "give_back")
    more = np.concatenate([[[[np.nan, np.nan]]], pixels], axis=1)
    blame = np.concatenate([[[[100.0]], [[1000.0]]], p_bar], axis=2)
    got = answer_array(give_back(blame, more, np.array([[False, True, True, True]]), h=3, w=4), "give_back")
    assert wanted.any(), "the points that are visible teach nobody: only those that aren't have no part"
    assert got.shape == wanted.shape, f"one point more, and the shape {wanted.shape} becomes {got.shape}"
    assert not np.isnan(got).any(), "NaN: the point that isn't visible got in. Leave it out, don't weigh it"
    sent = "the point that isn't visible teaches a pixel: leave it out, don't send it somewhere"
    np.testing.assert_allclose(got, wanted, atol=1e-6, err_msg=sent)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_give_back_invisible(give_back)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: a camera that learns its yaw (3 points)
#
# In the lecture a camera learned its pitch. Now it is turned to the side, by a small angle $\psi$ about its own vertical axis: a point $(X, Y, Z)$ of the
# camera's frame becomes $(X \cos\psi + Z \sin\psi,\; Y,\; -X \sin\psi + Z \cos\psi)$. Then equation (1) gives its pixel with `K` (no skew), equation (2) reads
# the scores `s`, `(h, w)`, there, and the loss is half the sum of squared differences from what the map says, `t`, `(J,)`: $\frac12 \sum_j (p_j - t_j)^2$.
#
# Complete `yaw_slope`: it returns $\partial\,\text{loss} / \partial\psi$ at $\psi = 0$, one number. `points` is `(J, 3)`; all of them are read inside the image,
# none on a pixel's centre line. Use the chain rule: $\bar p_j$, the slopes of the value in u *and in v*, and what $\psi$ does to u and v. Points may lie a
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


# %% nbgrader={"grade": true, "grade_id": "yaw-slope-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    # One point, by hand: X/Z = 0.1, Y/Z = 0.1, so u = 10 * 0.1 + 0.25 = 1.25 and v = 10 * 0.1 - 0.25 = 0.75.
    s, K = np.array([[0.0, 1, 5], [0, 3, 2]]), np.array([[10.0, 0, 0.25], [0, 10, -0.25], [0, 0, 1]])
    point = np.array([[0.2, 0.2, 2.0]])
    got = answer_array(yaw_slope(s, point, K, np.array([3.5625])), "yaw_slope").ravel()
    assert got.size == 1, f"return one number, got {got}"
    # It reads 0.25 * 2 + 0.75 * 2.75 = 2.5625, 1 too little. Slopes: 0.25 in u, 0.75 in v; u turns by 10 * 1.01, v by 10 * 0.01.
    slips = {
        2.6: "the sign is turned: p_bar is what is read minus what is wanted, and psi turns as the text says",
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
# ## Task 5: which convention does a black box have? (2 + 1 points)
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
        return np.einsum("jn,nm,jm->j", down, image, across)

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


# %% nbgrader={"grade": true, "grade_id": "convention-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
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


# %% nbgrader={"grade": true, "grade_id": "swaps-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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
# ## Task 6: in your own words (2 points)
#
# To save time, a colleague lets each point read its nearest pixel instead of four. The network still trains, nearly as well. Why does it, although the
# stairs have no slope? What can't be learnt any more? And where on the map would you look for the damage: near the vehicle, or far away? Five sentences are
# enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "nearest", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The scores are what learns, and for them the sampling stays linear: a matrix with a single 1 in each row, whose transpose hands the whole blame to the one
# pixel that was read. No slope in u and v is needed while the calibration is fixed. What can't be learnt any more is whatever moves the points: the
# calibration, the height of a plane, the pose of the vehicle, for the gradient in u and v is zero. The damage is a rounding of up to half a pixel:
# centimetres near the vehicle, where a pixel is small, but up to five metres of ground at 60 m, where edges jump in steps a pixel deep. One point for the
# gradient in the scores, one for what moves or for the far end of the map.

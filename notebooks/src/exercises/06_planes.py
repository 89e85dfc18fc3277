# %% [markdown]
# # Exercise 06: sampling that learns
#
# Five small functions: equation (2), the way back, what half a pixel does; and one question to answer in words. About 75 minutes. The lecture is [06: sampling that learns](../06_planes.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | four pixels and their weights | 2 + 1 |
# | 2 | a plane | 2 + 1 |
# | 3 | the way back | 2 + 1 |
# | 4 | if the point moves | 2 |
# | 5 | half a pixel: places for PyTorch | 1 + 1 |
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
# ## Task 4: if the point moves (2 points)
#
# One class, `s` `(h, w)`, and one point, never on a pixel's centre line: neither u nor v is an integer.
#
# Complete `slopes`: it returns two numbers, by how much the value changes for each pixel that the point moves to the right, $\partial p / \partial u$, and
# down, $\partial p / \partial v$. Check yourself by finite differences, with a step small enough.


# %% nbgrader={"grade": false, "grade_id": "slopes", "locked": false, "schema_version": 3, "solution": true, "task": false}
def slopes(s, u, v):
    """Return the derivatives of the value at (u, v) in u and in v."""
    ### BEGIN SOLUTION
    n, m = int(np.floor(v)), int(np.floor(u))
    down, across = v - n, u - m
    (a, b), (c, d) = s[n : n + 2, m : m + 2]
    return (1 - down) * (b - a) + down * (d - c), (1 - across) * (c - a) + across * (d - b)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "slopes-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    s = np.array([[1.0, 5, 0], [3, 2, 4], [0, 6, 0]])
    got = answer_array(slopes(s, 0.25, 0.75), "slopes").ravel()
    assert got.size == 2, f"return two numbers, in u and in v; got {got}"
    in_u, in_v = got
    swapped = np.isclose(in_u, 0.75) and np.isclose(in_v, 0.25)
    assert not swapped, "the two are swapped: u to the right first, then v down"
    slips = {  # in u, by hand: row 0 rises by 4 and row 1 falls by 1; the point is 0.25 in row 0: 0.25 * 4 - 0.75 * 1
        -0.25: "the sign is turned: the right pixel minus the left one",
        2.75: "the rows' weights are crossed: v = 0.75 is nearer to row 1",
        4.0: "that is row 0 alone: row 1 counts too, by its weight",
        -1.0: "that is row 1 alone: row 0 counts too, by its weight",
        3.0: "you add the differences of both rows: weigh them, by 0.25 and 0.75",
        1.5: "you take the mean of both rows: weigh them, by 0.25 and 0.75",
        0.0: "that is the slope of the nearest pixel; the bilinear value does change",
        2.5625: "that is the value itself: how does it change?",
        1.0: "row 1 got lost: a point between two rows listens to both",
        0.5: "that is twice the slope: from a step to the left to a step to the right there are two steps",
    }
    _explain("in u you have", in_u, slips)
    assert np.isclose(in_u, 0.25, atol=1e-4), f"in u: expected 0.25 * (5 - 1) + 0.75 * (2 - 3) = 0.25, got {in_u:.4f}"
    assert np.isclose(in_v, 0.75, atol=1e-4), f"in v: expected 0.75 * (3 - 1) + 0.25 * (2 - 5) = 0.75, got {in_v:.4f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_slopes(slopes)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: half a pixel, places for PyTorch (1 + 1 points)
#
# `torch.nn.functional.grid_sample` wants places between -1 and 1, as pairs of the place across and the place down. With `align_corners=True`, -1 and 1 are
# the *centres* of the first and the last pixel; with `False` they are the *edges* of the image, half a pixel farther out.
#
# Complete `unit_places`: `pixels` holds pairs of u and v, `(..., 2)` with any number of axes before the last, and `size` is the height and width of the
# image. It returns places of the same shape, in the convention that `align_corners` asks for. Draw a row of five pixels with their edges, and mark -1 and 1
# twice, before you write.


# %% nbgrader={"grade": false, "grade_id": "unit-places", "locked": false, "schema_version": 3, "solution": true, "task": false}
def unit_places(pixels, size, align_corners):
    """Return u and v scaled to -1 .. 1, (..., 2)."""
    ### BEGIN SOLUTION
    last = np.array(size[::-1]) - 1
    return 2 * pixels / last - 1 if align_corners else (2 * pixels + 1) / (last + 1) - 1
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "centres-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # A row of five pixels, three rows high: u = 1 lies a quarter of the way from the first to the last centre; v = 2 is the last row.
    got = answer_array(unit_places(np.array([[1.0, 2.0], [2.0, 1.0]]), (3, 5), align_corners=True), "unit_places")
    assert got.shape == (2, 2), f"two pairs in, two pairs out, shape (2, 2); got {got.shape}"
    slips = {
        -0.6: "from the first centre to the last there are w - 1 steps, not w",
        -0.4: "that is the other convention: here -1 and 1 are the centres of the first and last pixel",
        0.25: "places run from -1 to 1, not from 0 to 1",
        0.0: "height and width are swapped: `size` is (h, w), u runs along the width",
        1.0: "u and v changed places: first across, then down",
    }
    _explain("align_corners=True, u = 1 goes to", got[0, 0], slips)
    middle = "by hand; (2, 1) is the middle of the image"
    np.testing.assert_allclose(got, [[-0.5, 1], [0, 0]], atol=1e-6, err_msg=middle)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_centres(unit_places)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "edges-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # From edge to edge it is five pixels, and u = 1 lies one and a half of them from the first edge: 3/10 of the way.
    got = answer_array(unit_places(np.array([[1.0, 2.0], [2.0, 1.0]]), (3, 5), align_corners=False), "unit_places")
    assert got.shape == (2, 2), f"two pairs in, two pairs out, shape (2, 2); got {got.shape}"
    slips = {
        -0.6: "u = 0 is a centre, half a pixel from the edge: add that half first",
        -0.5: "that is the other convention: here -1 and 1 are the edges, half a pixel outside the centres",
        0.3: "places run from -1 to 1, not from 0 to 1",
        0.0: "height and width are swapped: `size` is (h, w), u runs along the width",
        -0.8: "the half has the wrong sign: the first edge lies at u = -1/2, so measure from there",
        -0.25: "from edge to edge there are w pixels, not w - 1",
        2 / 3: "u and v changed places: first across, then down",
    }
    _explain("align_corners=False, u = 1 goes to", got[0, 0], slips)
    np.testing.assert_allclose(got, [[-0.4, 2 / 3], [0, 0]], atol=1e-6, err_msg="by hand; (2, 1) is the middle")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import planes

    complaint = planes.check_edges(unit_places)
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

# %% [markdown]
# # Exercise 09: where truth comes from
#
# Five functions that together make a ground truth from image labels and LIDAR, and one question to answer in words. About 90 minutes.
# The lecture is [09: where truth comes from, and how wrong it is](../09_truth.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | the closest of several depths | 2 |
# | 2 | votes in a cell | 2 |
# | 3 | closing a gap | 2 |
# | 4 | what has no label | 2 |
# | 5 | a moving car, carried by its velocity | 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers and other sizes. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np
from scipy import ndimage  # task 3 may use it

from semgrid_edu.answers import answer_array
from semgrid_edu.labels import KITTI_14

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
ROAD, SIDEWALK, VEGETATION, CAR, SKY = (KITTI_14.index(n) for n in ("road", "sidewalk", "vegetation", "car", "sky"))
FREE, STATIC, DYNAMIC, UNKNOWN = range(4)  # the occupancy states

# %% [markdown]
# ## Task 1: the closest of several depths (2 points)
#
# `points` holds returns in the camera frame, `(N, 3)`: X to the right, Y down, Z ahead, metres. `K` is the intrinsic matrix, `(3, 3)`, and `size` is the height and the
# width of the image, in pixels. The pixel of a return is $(u, v, 1)^T = K\,(X/Z, Y/Z, 1)^T$, with every entry of `K`. A return is in view, near or far, when it lies
# in front of the camera and its pixel, **before** rounding, lies in $0 \le u \le \text{width} - 1$ and $0 \le v \le \text{height} - 1$. Then its pixel is rounded to
# the nearest whole numbers.
#
# Complete `depth_picture`: it returns an array `(height, width)` with the depth Z of the **closest** return on each pixel, and `np.nan` on pixels without a return.


# %% nbgrader={"grade": false, "grade_id": "depth-picture", "locked": false, "schema_version": 3, "solution": true, "task": false}
def depth_picture(points, K, size):
    """Return the smallest depth on each pixel, (height, width); NaN where there is none."""
    ### BEGIN SOLUTION
    depth = np.full(size, np.nan)
    for X, Y, Z in points:
        if Z <= 0:
            continue
        u, v, _ = K @ (X / Z, Y / Z, 1)
        if 0 <= u <= size[1] - 1 and 0 <= v <= size[0] - 1:
            pixel = round(float(v)), round(float(u))
            depth[pixel] = np.fmin(depth[pixel], Z)
    return depth
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "depth-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _picture():
    """Return points (9, 3), K of a camera whose row 1 looks level and column 2 straight ahead, and the picture, (4, 6), by hand."""
    K = np.array([[10.0, 0, 2], [0, 10.0, 1], [0, 0, 1]])  # by hand: u = 2 + 10 X / Z, v = 1 + 10 Y / Z
    points = [
        [0.0, 1.0, 10.0],  # u = 2, v = 2
        [0.0, 2.0, 20.0],  # the same pixel, farther away
        [0.0, 0.5, 5.0],  # the same pixel, closer
        [0.0, 3.0, 30.0],  # the same pixel, the farthest, and the last in the list
        [4.2, -1.2, 20.0],  # u = 4.1, v = 0.4
        [1.9, 1.0, 10.0],  # u = 3.9, v = 2
        [-0.4, -0.2, -2.0],  # behind the camera: u = 4, v = 2 if you forget to look at Z
        [3.2, 0.0, 10.0],  # u = 5.2: beyond the centre of the last pixel, which is 5
        [0.0, -1.04, 10.0],  # v = -0.04: above the centre of the first row
    ]
    wanted = np.full((4, 6), np.nan)
    wanted[2, 2], wanted[0, 4], wanted[2, 4] = 5.0, 20.0, 10.0
    return np.array(points), K, wanted


# %% nbgrader={"grade": false, "grade_id": "depth-other-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _depth_hint(got):
    """Return what is wrong with a picture whose pixel (2, 2) may be right, or nothing."""
    if np.isclose(got[2, 2], np.sqrt(25.25), atol=1e-3):
        return "row 2, column 2 holds the distance of the return: the depth is Z, along the optical axis"
    if got[2, 4] == -2:
        return "row 2, column 4: a return behind the camera got into the picture: look at the sign of Z"
    if np.isnan(got[2, 4]) and not np.isnan(got[2, 3]):
        return "the return at u = 3.9 landed in column 3: round to the nearest pixel, don't cut off"
    if not np.isnan(got[:2, 5]).all():
        return "the return at u = 5.2 is in the picture: test the pixel against the image before you round it"
    if not np.isnan(got[0, 2]):
        return "the return at v = -0.04 is in the picture: test the pixel against the image before you round it"


# %% nbgrader={"grade": true, "grade_id": "depth-picture-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    points, K, wanted = _picture()
    got = answer_array(depth_picture(points, K, (4, 6)), "depth_picture")
    assert got.shape != (6, 4), "the picture is turned: rows (v) come first, then columns (u)"
    assert got.shape == (4, 6), f"expected a picture of height 4 and width 6, got shape {got.shape}"
    assert not np.isinf(got).any(), "a pixel without a return is np.nan, not infinite"
    assert not (got == 0).any(), "a pixel without a return is np.nan, not 0"
    slips = {
        30.0: "that is the last return in the list, or the farthest: of several the closest counts",
        10.0: "that is the first return in the list: of several the closest counts",
        16.25: "that is the mean of all four: between the car in front and the wall behind there is nothing. Take the closest",
        0.5: "that is Y: the depth is Z, along the optical axis",
        0.2: "that is 1 / Z",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got[2, 2], slip), f"row 2, column 2: {got[2, 2]:.2f}: {hint}"
    hint = _depth_hint(got)
    assert not hint, hint
    np.testing.assert_allclose(got, wanted, err_msg="the whole picture, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_depth_picture(depth_picture)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: votes in a cell (2 points)
#
# `cells` and `classes` hold the cell and the class of each labelled return, `(N,)`, as whole numbers. Classes are those of `KITTI_14`: ten that have a meaning (0 to 9), of which
# `SKY` never gets a vote, and 255 for "no label".
#
# Complete `count_votes`: it returns an array `(n_cells,)` with the class that each cell takes, 255 where it gets none. **What stands wins**: if any return of a cell
# has a class that stands, the most frequent of *those* wins; otherwise the most frequent of the ground's, which are `ROAD`, `SIDEWALK` and `VEGETATION`. Of equally frequent
# classes the one with the smallest number wins.


# %% nbgrader={"grade": false, "grade_id": "count-votes", "locked": false, "schema_version": 3, "solution": true, "task": false}
def count_votes(cells, classes, n_cells):
    """Return the class of each cell, (n_cells,); 255 where it has no vote."""
    ### BEGIN SOLUTION
    votes = np.zeros((n_cells, 10), int)
    for cell, label in zip(cells, classes, strict=True):
        if label != 255 and label != SKY:
            votes[cell, label] += 1
    standing = votes.copy()
    standing[:, [ROAD, SIDEWALK, VEGETATION]] = 0
    best = np.where(standing.any(axis=1), standing.argmax(axis=1), votes.argmax(axis=1))
    return np.where(votes.any(axis=1), best, 255)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "votes-cells", "locked": true, "schema_version": 3, "solution": false, "task": false}
_PEDESTRIAN, _SIGNAGE = KITTI_14.index("pedestrian"), KITTI_14.index("signage")


def _returns():
    """Return cells and classes, (23,) each, in no order; `in_cell` holds the classes of each of the eight cells."""
    in_cell = [
        [ROAD, ROAD, ROAD, CAR],  # one return from a car, three from the road
        [SIDEWALK, ROAD, SIDEWALK],  # ground alone: the most frequent
        [SKY, SKY, ROAD],  # sky gets no vote
        [],  # no return
        [255, 255, SIDEWALK],  # 255 is no label
        [_SIGNAGE, _PEDESTRIAN, ROAD, ROAD, ROAD],  # two that stand, equally frequent
        [SKY, 255],  # nothing that counts
        [ROAD, CAR, CAR, _PEDESTRIAN, VEGETATION, VEGETATION, VEGETATION],  # the most frequent of those that stand
    ]
    cells = np.repeat(np.arange(8), [len(one) for one in in_cell])
    classes = np.array([label for one in in_cell for label in one])
    order = np.random.default_rng(9).permutation(len(cells))
    return cells[order], classes[order]


# %% nbgrader={"grade": true, "grade_id": "count-votes-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_array(count_votes(*_returns(), 8), "count_votes")
    assert got.shape == (8,), f"expected one class for each of 8 cells, got shape {got.shape}"
    assert got[3] == 255, f"cell 3 has no return and got class {got[3]:g}: a cell without a vote is 255"
    assert got[2] != SKY, "cell 2 became sky: such a label lies at an outline, and gets no vote"
    assert got[4] != 255, "cell 4: 255 isn't a class that wins votes; SIDEWALK has one"
    assert got[6] != SKY, "cell 6 became sky: such a label gets no vote"
    assert got[6] == 255, f"cell 6 has neither a class with a meaning nor a vote, and got {got[6]:g}: it is 255"
    assert got[0] != ROAD, "cell 0: three returns from the road outvoted the car. What stands wins, be it one vote"
    ground = "cell 7: the ground outvoted what stands, or vegetation counts as standing: it is ground"
    assert got[7] != VEGETATION, ground
    most = "cell 7: of those that stand the most frequent wins, not the one with the largest number"
    assert got[7] != _PEDESTRIAN, most
    assert got[5] != _SIGNAGE, "cell 5: of equally frequent classes the one with the smallest number wins"
    assert got[1] == SIDEWALK, "cell 1: sidewalk has two votes, road one"
    by_hand = [CAR, SIDEWALK, ROAD, 255, SIDEWALK, _PEDESTRIAN, 255, CAR]
    np.testing.assert_array_equal(got, by_hand, err_msg="all, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_count_votes(count_votes)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: closing a gap (2 points)
#
# `mask` is a map of True and False, `(H, W)`. To **dilate** it by a reach of `r` cells is to set each cell True that has a True cell at most `r` rows *and* at most `r` columns
# away (a square of 2r + 1 cells). To **erode** it is to keep only cells whose whole square is True. To **close** it is to dilate, then erode.
#
# Beyond the map there is nothing, but a thing at the edge of the map must not lose its edge by being closed: so surround the map with enough False
# cells first, and cut them off in the end.
#
# Complete `close_mask`: it returns the closed mask, `(H, W)`. You may write loops, or use `ndimage`.


# %% nbgrader={"grade": false, "grade_id": "close-mask", "locked": false, "schema_version": 3, "solution": true, "task": false}
def close_mask(mask, reach):
    """Return the mask, dilated and then eroded, (H, W)."""
    ### BEGIN SOLUTION
    margin = 2 * reach
    closed = ndimage.binary_closing(np.pad(mask, margin), np.ones((2 * reach + 1, 2 * reach + 1)))
    return closed[margin:-margin, margin:-margin]
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "masks", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _mask(*rows):
    """Turn rows of # and . into a mask."""
    return np.array([[c == "#" for c in row] for row in rows])


_DOTS = _mask("...........", "#..#.....#.", "...........")


# %% nbgrader={"grade": true, "grade_id": "close-mask-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    mask = _DOTS.copy()
    got = answer_array(
        close_mask(mask, 1), "close_mask", dtype=bool
    )  # by hand: the gap of two cells is closed, no more
    assert np.array_equal(mask, _DOTS), "close_mask changed its argument `mask`: work on a copy"
    size = f"expected the shape of the mask, (3, 11), got {got.shape}: cut the surrounding cells off"
    assert got.shape == (3, 11), size
    early = "nothing is left: you eroded first, and no square fits into single cells. Dilate first, then erode"
    assert got.any(), early
    wide = "the rows beside have True cells: that is the dilated mask. Erode it too, by the same reach"
    assert not got[[0, 2]].any(), wide
    assert got[1, 0], "the cell at the edge of the map is lost: surround the map with False cells before you dilate"
    assert got[_DOTS].all(), "a cell of the mask is lost: closing only adds. Did you erode before you dilated?"
    assert got[1, 1:3].all(), "the gap of two cells is still open: with a reach of 1 gaps up to two cells close"
    five = "the gap of five cells is closed in part: with a reach of 1 only gaps up to two cells close"
    assert not got[1, 4:9].any(), five
    upright = answer_array(close_mask(_DOTS.T.copy(), 1), "close_mask", dtype=bool)
    turned = _mask("...........", "####.....#.", "...........").T
    assert np.array_equal(upright, turned), "turned upright: gaps between rows aren't closed like gaps between columns"
    one_less = answer_array(close_mask(_mask(".....", ".#...", "....."), 1), "close_mask", dtype=bool)
    assert one_less.sum() == 1, f"a single cell became {one_less.sum()} cells: closing moves no outline"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_close_mask(close_mask)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: what has no label (2 points)
#
# `votes` is a map of classes, `(H, W)`, with 255 where no return has brought a label, as from task 2. `o` is the occupancy grid, `(4, H, W)`: the probabilities of FREE,
# STATIC, DYNAMIC and UNKNOWN. `near` is another map of classes, `(H, W)`: the class of the nearest labelled cell, 255 where that is too far away.
#
# Complete `fill_unknown`: it returns a map of classes, `(H, W)`, without any 255.
#
# - A cell with a vote keeps it.
# - A cell without a vote that the filter has **observed** (its most probable state isn't UNKNOWN) takes the class of `near`, if there is one.
# - All others are unknown by their most probable state: class 10 (unknown-free), 11 (-static), 12 (-dynamic) or 13 (-unobserved).


# %% nbgrader={"grade": false, "grade_id": "fill-unknown", "locked": false, "schema_version": 3, "solution": true, "task": false}
def fill_unknown(votes, o, near):
    """Return a class for every cell, (H, W)."""
    ### BEGIN SOLUTION
    state = o.argmax(axis=0)
    filled = np.where((near != 255) & (state != UNKNOWN), near, 10 + state)
    return np.where(votes != 255, votes, filled)
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "small-map", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _small_map():
    """Return votes (2, 4), the occupancy o (4, 2, 4) and near (2, 4)."""
    free = [[0.7, 0.6, 0.4, 0.1], [0.2, 0.2, 0.1, 0.1]]
    static = [[0.1, 0.2, 0.3, 0.5], [0.1, 0.2, 0.1, 0.1]]
    dynamic = [[0.1, 0.1, 0.2, 0.2], [0.6, 0.1, 0.2, 0.1]]
    unknown = [[0.1, 0.1, 0.1, 0.2], [0.1, 0.5, 0.6, 0.7]]
    votes = np.array([[ROAD, 255, 255, 255], [255, 255, 255, CAR]])
    return (
        votes,
        np.array([free, static, dynamic, unknown]),
        np.array([[ROAD, ROAD, 255, 255], [255, SIDEWALK, 255, CAR]]),
    )


# %% nbgrader={"grade": true, "grade_id": "fill-unknown-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    votes, o, near = _small_map()
    got = answer_array(fill_unknown(votes, o, near), "fill_unknown")
    assert np.array_equal(votes, _small_map()[0]), "fill_unknown changed its argument `votes`: work on a copy"
    axis = "the most probable state of a cell is a maximum over axis 0"
    assert got.shape == (2, 4), f"expected the shape of the votes, (2, 4), got {got.shape}: {axis}"
    left = (got == 255).sum()
    assert not left, f"{left} cells are still 255: each cell without a label is one of the four unknowns"
    vote = f"cell (1, 3) has a vote, CAR, and became {got[1, 3]:g}: a vote stays, whatever the filter says"
    assert got[1, 3] == CAR, vote
    blind = "cell (1, 1) became sidewalk, but the filter has not observed it (UNKNOWN 0.5): clean-up leaves it alone"
    assert got[1, 1] != SIDEWALK, blind
    seen = f"cell (0, 1) is observed, and the nearest label is ROAD: it takes that, not {got[0, 1]:g}"
    assert got[0, 1] == ROAD, seen
    swapped = "FREE and UNKNOWN are swapped: class 10 is unknown-free, 13 unknown-unobserved"
    assert got[0, 2] != 13 or got[1, 2] != 10, swapped
    assert got[0, 2] != FREE, f"cell (0, 2) got {got[0, 2]:g}, the number of its state: the unknown classes begin at 10"
    assert got[1, 0] != 11, "cell (1, 0) is rather DYNAMIC (0.6) than STATIC (0.1): class 12"
    np.testing.assert_array_equal(got, [[ROAD, ROAD, 10, 11], [12, 13, 13, CAR]], err_msg="all cells, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_fill_unknown(fill_unknown)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: a moving car, carried by its velocity (3 points)
#
# A window of scans. `points` holds the returns of an **earlier** scan, `(N, 3)`: x, y, z in the LIDAR frame as it stood *then*. `moves` says which of them lie in a cell that moves, `(N,)`, and
# `velocity` is the velocity of that cell over ground along x and y of the frame of *then*, `(N, 2)` in m/s; it may be NaN where the filter doesn't know it. `seconds` is the time from then to now. `T_now_from_then` is the 4 x 4
# transform from the LIDAR frame of then to that of now.
#
# Complete `carry_window`: it returns the returns in the LIDAR frame of **now**, `(M, 3)`, in their order, such that
#
# - what stands is only transformed, because the vehicle has moved;
# - what moves is first moved on by velocity times time, in the frame of then, and then transformed;
# - what moves with an unknown velocity (NaN in either part) is left out: nobody knows where it is.


# %% nbgrader={"grade": false, "grade_id": "carry-window", "locked": false, "schema_version": 3, "solution": true, "task": false}
def carry_window(points, moves, velocity, seconds, T_now_from_then):
    """Return earlier returns where they are now, (M, 3)."""
    ### BEGIN SOLUTION
    known = np.isfinite(velocity).all(axis=1)
    carried = points.copy()
    carried[moves & known, :2] += velocity[moves & known] * seconds
    carried = carried[~moves | known]
    return carried @ T_now_from_then[:3, :3].T + T_now_from_then[:3, 3]
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "carry-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _window():
    """Return points, moves and velocity. The vehicle has driven 4 m ahead in 0.5 s since, and turned left by 90 degrees."""
    points = [
        [10.0, 0.0, -1.0],  # a post: stands, although its cell has a velocity
        [20.0, 3.0, -0.5],  # a car at 10 m/s along x: 5 m farther on now, at (25, 3)
        [20.0, -3.0, -0.5],  # moves, velocity unknown
        [8.0, 2.0, 0.5],  # stands, velocity unknown, as usual for what stands
        [6.0, -1.0, 0.0],  # moves to the left at 2 m/s: at (6, 0) now
        [9.0, 4.0, 0.0],  # moves; only one part of its velocity is known
    ]
    velocity = [[3.0, 3.0], [10.0, 0.0], [np.nan, np.nan], [np.nan, np.nan], [0.0, 2.0], [1.0, np.nan]]
    return np.array(points), np.array([False, True, True, False, True, True]), np.array(velocity)


_CAR_SLIPS = {
    (3.0, -16.0): "the car was left where it was: add velocity times time before the transform",
    (3.0, -11.0): "the car went backward: it is 0.5 s later now, so it is farther along its velocity",
    (3.0, -26.0): "the car went 10 m: that is its velocity; in 0.5 s it covers half of that",
    (8.0, -16.0): "you added the motion after the transform: the velocity is along the axes of then",
    (25.0, 3.0): "nothing was transformed: the vehicle has moved and turned",
    (1.0, 25.0): "you used the inverse transform: T_now_from_then takes points from then to now",
    (3.0, -25.0): "the vehicle's turn is there, its 4 m are missing: a transform rotates, then shifts",
}


# %% nbgrader={"grade": true, "grade_id": "carry-window-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    points, moves, velocity = _window()
    T_now_from_then = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 4], [0, 0, 1, 0], [0, 0, 0, 1]])
    got = answer_array(carry_window(points, moves, velocity, 0.5, T_now_from_then), "carry_window")
    assert np.array_equal(points, _window()[0]), "carry_window changed its argument `points`: work on a copy"
    assert got.shape[1:] == (3,), f"expected x, y, z of each return, (M, 3), got shape {got.shape}"
    nan = "a return has NaN: what moves with an unknown velocity is left out, and what stands has no velocity to add"
    assert np.isfinite(got).all(), nan
    assert len(got) != 6, "6 returns came back: what moves with an unknown velocity is left out"
    assert len(got) != 5, "5 returns came back: a velocity is unknown when either of its parts is NaN"
    alone = "these are the moving ones, or the standing ones, alone. Both belong to the map"
    assert len(got) != 2, f"2 returns came back: {alone}"
    assert len(got) == 4, f"{len(got)} returns came back, 4 by hand: what stands stays, known velocity or not"
    for (x, y), hint in _CAR_SLIPS.items():
        assert not np.allclose(got[1, :2], (x, y), atol=1e-6), f"the car is put at ({x}, {y}): {hint}"
    assert not np.allclose(got[0, :2], (1.5, -7.5), atol=1e-6), "the post was carried: only what `moves` is"
    by_hand = [[0.0, -6, -1.0], [3.0, -21, -0.5], [2.0, -4, 0.5], [0.0, -2, 0.0]]
    np.testing.assert_allclose(got, by_hand, atol=1e-9, err_msg="all four returns, by hand")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import truth

    complaint = truth.check_carry_window(carry_window)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ### See it on the drive
#
# Your functions are the steps of `semgrid_edu.datasets.ground_truth.lidar_truth`. `TruthPolicy(past=9, labels="own", movers="carried")` does with nine scans what your `carry_window` does with one. The widget of the
# lecture shows what each choice does to the map.
#
# ## Task 6: in your own words (2 points)
#
# A colleague has made a ground truth from 19 scans with moving things *carried*, and reports: "Against the one-scan truth, twice as many cells are labelled, and where both have a label, 95 % agree. So the new
# truth is better." Which two things does this comparison not tell? What could be wrong in *both* truths so that they agree? And what would you measure, on real data without a simulator, to find out? Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "agreement", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The comparison doesn't tell whether the *new* labels, in cells that the one-scan truth leaves open, are right: they are not in the 95 %. Nor does it tell whether the labels on which both agree are right. Both are made from the
# same image labels with the same calibration, so both have the same error of calibration (a shared error isn't outvoted), and in both hidden returns take the label of what hides them. (The filter that says what moves, and how fast, errs as well, but
# only the carried truth uses its velocities.) To find out one needs a witness that doesn't share these errors: a sample of cells labelled by people in the LIDAR points themselves (as in SemanticKITTI), the calibration measured again with a target, or the same place
# seen on another day. For moving things: how far is a carried car, scan by scan, from where the scan of now has it? One point for the two gaps, one for a shared error and a measurement that doesn't share it.

# %% [markdown]
# # Exercise 00: the tour
#
# Five small functions, one for each idea that the whole course stands on, and a question to answer in words. About 60 minutes.
# The lecture is [00: the tour](../00_tour.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | from metres to cells | 2 |
# | 2 | Bayes' rule in every cell | 3 |
# | 3 | from a point to its pixel, equation (1) | 2 + 1 |
# | 4 | two accuracies that disagree | 3 |
# | 5 | FmIoU, which also charges for wrong claims, of a map with gaps | 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.

# %% [markdown]
# ## Task 1: from metres to cells (2 points)
#
# The grid is a map seen from above, **forward up**: x points forward, y points **left**. Row 0 is the farthest ahead, column 0 is the
# leftmost. The corner of cell (0, 0), far ahead on the left, lies at `x_max`, `y_max`; cells are squares with a side of `cell` metres.
#
# Complete `cell_of`: it returns `(row, col)`, two integers, for one point inside the grid. Draw a grid of four cells first.


# %% nbgrader={"grade": false, "grade_id": "cell-of", "locked": false, "schema_version": 3, "solution": true, "task": false}
def cell_of(x, y, x_max, y_max, cell):
    """Return the row and column of the cell that holds the point (x, y)."""
    ### BEGIN SOLUTION
    row = int(np.floor((x_max - x) / cell))
    col = int(np.floor((y_max - y) / cell))
    return row, col
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "cell-of-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # A grid 6 m ahead, 2 m to each side, in cells of 0.5 m. By hand: 1.4 m below the top edge, 0.8 m from the left edge.
    got = cell_of(x=4.6, y=1.2, x_max=6, y_max=2, cell=0.5)
    assert answer_array(got, "cell_of").shape == (2,), f"return two numbers, row and column; got {got}"
    got = tuple(np.asarray(got).tolist())
    slips = {
        (1, 2): "row and column are swapped: rows count along x (forward), columns along y (left)",
        (9, 1): "you count rows from the vehicle: row 0 is the farthest ahead, measure from x_max",
        (2, 6): "y points left and column 0 is the leftmost: measure columns from y_max",
        (3, 2): "you round to the nearest border: a point belongs to the cell it lies in (floor)",
        (1, 0): "you count metres: how many cells of 0.5 m fit into 1.4 m?",
    }
    assert got not in slips, f"got {got}: {slips[got]}"
    assert got == (2, 1), f"expected row 2, column 1 for x = 4.6 m, y = 1.2 m, got {got}"
    assert all(isinstance(i, int) for i in got), f"an index must be an integer, got {got}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import tour

    complaint = tour.check_cell_of(cell_of)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: Bayes' rule in every cell (3 points)
#
# Every cell believes in four states, in the order FREE, STATIC, DYNAMIC, UNKNOWN: `belief` has the shape `(4, H, W)` and its four numbers
# in one cell sum to 1. A scan gives `likelihood`, same shape: how probable is what the LIDAR saw, if the cell were in that state?
#
# Complete `bayes_update`: it returns the belief after the scan. Bayes' rule has two steps. Do both, and leave the two arguments as they
# are: somebody else may still need them.


# %% nbgrader={"grade": false, "grade_id": "bayes-update", "locked": false, "schema_version": 3, "solution": true, "task": false}
def bayes_update(belief, likelihood):
    """Return the belief (4, H, W) after one scan."""
    ### BEGIN SOLUTION
    product = belief * likelihood
    return product / product.sum(axis=0)
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "bayes-update-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    belief = np.full((4, 2, 3), 0.25)
    belief[:, 0, 1] = [0.7, 0.1, 0.1, 0.1]
    belief[:, 1, 2] = [0.6, 0.2, 0.1, 0.1]
    likelihood = np.full((4, 2, 3), 0.5)  # this scan is silent everywhere ...
    likelihood[:, 1, 2] = [0.1, 0.9, 0.9, 0.5]  # ... but in cell (1, 2), where the beam came back
    before = belief.copy()
    got = answer_array(bayes_update(belief, likelihood), "bayes_update")
    assert np.array_equal(belief, before), "bayes_update changed its argument `belief`: make a new array (no *=, no /=)"
    assert got.shape == (4, 2, 3), f"expected the shape of the belief, (4, 2, 3), got {got.shape}"
    total = got.sum(axis=0)
    row, col = np.unravel_index(np.abs(total - 1).argmax(), total.shape)
    wrong = f"the four states of cell ({row}, {col}) sum to {total[row, col]:.2f}"
    assert np.allclose(total, 1), f"{wrong}: did you normalise over the state axis?"
    assert not np.allclose(got[:, 0, 1], 0.25), "cell (0, 1) forgot what it believed: multiply the old belief in"
    quiet = np.round(got[:, 0, 1], 2)
    silent = np.allclose(quiet, before[:, 0, 1], atol=0.01)
    assert silent, f"the scan is silent in cell (0, 1), yet 0.7, ... became {quiet}"
    np.testing.assert_allclose(got[:, 1, 2], np.array([6, 18, 9, 5]) / 38, err_msg="by hand: 0.06, 0.18, 0.09, 0.05")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import tour

    complaint = tour.check_bayes_update(bayes_update)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: from a point to its pixel (2 + 1 points)
#
# The lecture's two formulas for $u$ and $v$ are the first two rows of one product:
#
# $$ \begin{pmatrix} u \\ v \\ 1 \end{pmatrix} = K \begin{pmatrix} X/Z \\ Y/Z \\ 1 \end{pmatrix}, \qquad
#    K = \begin{pmatrix} f & 0 & u_0 \\ 0 & f & v_0 \\ 0 & 0 & 1 \end{pmatrix} \qquad (1) $$
#
# `point` is (x, y, z) in the grid frame, metres. `T_camera_from_grid`, 4 x 4, takes it to the camera frame: X right, Y down, Z ahead.
# (A 4 x 4 matrix takes a point as (x, y, z, 1), so that its last column can shift the point.) `K`, 3 x 3, is the camera's intrinsic
# matrix, in pixels; it may have two focal lengths, one for each row. The centre of the first pixel is (0, 0).
#
# Complete `pixel_of`: it returns `(u, v)`. For one more point: a point that is not in front of the camera has no pixel, so return
# `(nan, nan)`.


# %% nbgrader={"grade": false, "grade_id": "pixel-of", "locked": false, "schema_version": 3, "solution": true, "task": false}
def pixel_of(point, K, T_camera_from_grid):
    """Return u (right) and v (down), in pixels."""
    ### BEGIN SOLUTION
    X, Y, Z, _ = T_camera_from_grid @ np.append(point, 1.0)
    if Z <= 0:
        return np.nan, np.nan
    u, v, _ = K @ np.array([X / Z, Y / Z, 1.0])
    return u, v
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "pixel-of-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    K = np.array([[100.0, 0, 50], [0, 100, 20], [0, 0, 1]])
    ahead = np.array([[0.0, -1, 0, 0], [0, 0, -1, 1.5], [1, 0, 0, 0], [0, 0, 0, 1]])  # a camera 1.5 m above the ground
    # 10 m ahead, 2 m to the right, 0.5 m up. By hand: X = 2, Y = 1, Z = 10, so u = 50 + 100 * 0.2 and v = 20 + 100 * 0.1.
    got = answer_array(pixel_of(np.array([10.0, -2.0, 0.5]), K, ahead), "pixel_of")
    assert got.shape == (2,), f"return two numbers, u and v; got {got}"
    slips = {
        (700, 300): "did you divide by Z?",
        (68.3, 29.3): "you divide by the distance: Z is the depth along the camera's axis only",
        (64.3, -265.7): "you use the inverse transform: T_camera_from_grid takes grid to camera as it is",
        (70, 15): "the camera's place got lost: the fourth coordinate of a point is 1, not 0",
        (30, 70): "that is (v, u): u counts to the right and comes first",
        (20, 10): "the principal point is missing: the third column of K shifts the pixel",
        (70.5, 30.5): "half a pixel too much: the centre of the first pixel is (0, 0)",
        (69.5, 29.5): "half a pixel too little: the centre of the first pixel is (0, 0)",
    }
    for slip, hint in slips.items():
        assert not np.allclose(got, slip, atol=0.1), f"got ({got[0]:.1f}, {got[1]:.1f}): {hint}"
    np.testing.assert_allclose(got, (70, 30), err_msg="X = 2, Y = 1, Z = 10")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import tour

    complaint = tour.check_pixel_of(pixel_of)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "pixel-behind-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    K = np.array([[100.0, 0, 50], [0, 100, 20], [0, 0, 1]])
    ahead = np.array([[0.0, -1, 0, 0], [0, 0, -1, 1.5], [1, 0, 0, 0], [0, 0, 0, 1]])
    got = answer_array(pixel_of(np.array([-5.0, 2.0, 0.5]), K, ahead), "pixel_of")
    assert got.shape == (2,), f"return (nan, nan) for a point behind the camera, got {got}"
    seen = f"got ({got[0]:.0f}, {got[1]:.0f}): look at the sign of Z"
    assert np.isnan(got).all(), f"a point 5 m behind the camera has no pixel, {seen}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import tour

    complaint = tour.check_pixel_behind(pixel_of)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: two accuracies that disagree (3 points)
#
# `confusion[t, p]` counts the cells whose truth is class `t` and whose prediction is class `p`: one **row** for each true class.
#
# Complete `accuracies`: it returns two numbers between 0 and 1. *Pixel accuracy* is the share of all cells that are right. *Class
# accuracy* takes the share that is right within each true class, and then the mean over classes. A class without a true cell has no
# share, so it is left out of the mean.


# %% nbgrader={"grade": false, "grade_id": "accuracies", "locked": false, "schema_version": 3, "solution": true, "task": false}
def accuracies(confusion):
    """Return pixel accuracy and class accuracy."""
    ### BEGIN SOLUTION
    right = np.diag(confusion)
    cells = confusion.sum(axis=1)
    occurs = cells > 0
    return right.sum() / confusion.sum(), (right[occurs] / cells[occurs]).mean()
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "accuracies-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    confusion = np.array([[6, 2, 1], [2, 2, 0], [0, 0, 0]])  # nothing is truly of class 2, though one cell is called so
    got = answer_array(accuracies(confusion), "accuracies")
    assert got.shape == (2,), f"return pixel accuracy and class accuracy, got {got}"
    pixel, per_class = got
    assert not np.isclose(pixel, 7 / 12), "the two are swapped: pixel accuracy comes first"
    assert np.isclose(pixel, 8 / 13), f"8 of 13 cells are right, so the pixel accuracy is 0.615, got {pixel:.3f}"
    assert not np.isnan(per_class), "class 2 has no true cell: 0 / 0 is not a share, leave it out"
    slips = {
        7 / 18: "class 2 has no true cell: leave it out of the mean instead of counting a 0",
        5 / 12: "you divide by the columns (what was predicted): a true class is a row",
        8 / 39: "you divide by all cells: a class is measured on its own cells only",
        4 / 13: "you divide by all cells: a class is measured on its own cells only",
        29 / 66: "that is intersection over union: here, a wrong prediction costs the true class only",
        29 / 99: "that is intersection over union: here, a wrong prediction costs the true class only",
    }
    for slip, hint in slips.items():
        assert not np.isclose(per_class, slip), f"class accuracy {per_class:.3f}: {hint}"
    assert np.isclose(per_class, 7 / 12), f"6 of 9 and 2 of 4: the mean of 0.667 and 0.5 is 0.583, got {per_class:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import tour

    complaint = tour.check_accuracies(accuracies)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: FmIoU (3 points)
#
# The *intersection over union* (IoU) of a class is the number of cells that are right, divided by the number of cells that truly are of
# this class **or** are called so. FmIoU is the mean of the classes' IoU, weighted by the share of each class in the *truth*.
#
# The map of this task has gaps: in some cells it makes no claim at all. So `confusion`, (C, C + 1), has one **column** more than in task 4,
# the last one, for cells without a claim. Such a cell truly is of its class, and the map misses it.
#
# Complete `fm_iou`: it returns one number between 0 and 1. A class that neither occurs nor is ever claimed has no IoU; it must not spoil the
# sum. Do the example by hand first: two classes; five cells of road, of which one is called car and one gets no claim; and one car that is
# found.


# %% nbgrader={"grade": false, "grade_id": "fmiou", "locked": false, "schema_version": 3, "solution": true, "task": false}
def fm_iou(confusion):
    """Return the FmIoU of a confusion matrix (C, C + 1), whose last column counts cells without a claim."""
    ### BEGIN SOLUTION
    right = np.diag(confusion)
    cells = confusion.sum(axis=1)
    union = cells + confusion[:, :-1].sum(axis=0) - right
    occurs = cells > 0
    return (cells[occurs] / cells.sum() * right[occurs] / union[occurs]).sum()
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "fmiou-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    confusion = np.array([[3, 1, 0, 1], [0, 1, 0, 0], [0, 0, 0, 0]])  # road, car, and a class that never occurs
    before = confusion.copy()
    got = answer_array(fm_iou(confusion), "fm_iou")
    assert got.shape == (), f"return one number, got {got}"
    assert np.array_equal(confusion, before), "fm_iou changed its argument `confusion`: make new arrays"
    assert not np.isnan(got), "class 2 neither occurs nor is claimed: 0 / 0 is not a share, leave it out"
    slips = {
        11 / 20: "that is the plain mean of the two IoUs: weight each by how frequent the class is in the truth",
        11 / 30: "that is the plain mean over all classes: weight each IoU by how frequent the class is in the truth",
        14 / 25: "you weight by the claims: weight each by how frequent the class is in the truth",
        2 / 3: "that is the pixel accuracy: divide by truth or claimed, not by truth alone",
        53 / 144: "you count the right cells twice: the union is truth plus claimed minus right",
        11 / 12: "you divide by the claimed cells only, a column: the union also has the cells that were missed",
        7 / 10: "you leave out the cells without a claim: each belongs to the truth of its class, and is missed",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=1e-6), f"got {got:.3f}: {hint}"
    by_hand = "road 3 of 5, car 1 of 2: 5/6 of 0.6 and 1/6 of 0.5 are 0.583"
    assert np.isclose(got, 7 / 12, atol=1e-5), f"{by_hand}, got {got:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import tour

    complaint = tour.check_fm_iou(fm_iou)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# First: thirty metres ahead, the semantic grid says *road* in a cell that the occupancy grid calls STATIC with probability 0.9. Name two
# stages that may be the cause, and say for each what you would look at to find out.
#
# Then: somebody reports that a map finds every pedestrian, a recall of 100 %. The labels come from LIDAR beams that came back. Name one more
# number or one test that you ask for, and say which mistake it would show. Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "blame", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The image network may have taken the object for road, or the object is so small from afar that its pixels are mixed with road: look at
# its scores at the pixels where the cell projects to, at several heights. If the scores are right there, the fusion did not use
# the right plane, or it trusts road too much because road is the most frequent class: look at the planes one by one. The occupancy grid
# itself may be wrong: on a slope, ground returns rise above 0.3 m and count as an obstacle: look at the LIDAR points in the cell.
#
# I ask how many cells the map calls pedestrian in all, and how many of these have a label: inventions in cells without a label lower
# neither recall nor IoU. Or I paint the people out of the image: if the map still finds them, it knows this street by heart, and I ask
# for another street.
# One point for two stages, each with a check that would tell it from the other; one for a number or test and the mistake it would show.

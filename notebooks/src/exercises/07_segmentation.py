# %% [markdown]
# # Exercise 07: three networks for segmentation
#
# Six small functions, the parts that tell SegNet, FCN and DeepLab apart and the loss that teaches all of them, and one question to answer in words. About
# 75 minutes. The lecture is [07: three networks for segmentation](../07_segmentation.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | how far a chain of layers sees | 2 |
# | 2 | max-pooling with indices, and the way back | 2 + 1 |
# | 3 | a convolution with holes | 3 |
# | 4 | a skip: enlarge, crop, add | 2 + 1 |
# | 5 | the loss of an image | 2 + 1 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does

# %% [markdown]
# ## Task 1: how far a chain of layers sees (2 points)
#
# `layers` is a list of `(kernel, stride, rate)`, the first layer of the network first. Complete `receptive_field`: it returns two numbers. First the
# **field**: how many pixels a side of the image one output of the chain depends on. Second the **jump**: how many pixels of the image two neighbouring outputs
# lie apart.
#
# $$ \text{field} \leftarrow \text{field} + (\text{kernel} - 1) \cdot \text{rate} \cdot \text{jump}, \qquad
#    \text{jump} \leftarrow \text{jump} \cdot \text{stride} $$
#
# Both are 1 before the first layer, so they are 1 and 1 for a chain without layers. Do the chain of the test below on paper first.


# %% nbgrader={"grade": false, "grade_id": "field", "locked": false, "schema_version": 3, "solution": true, "task": false}
def receptive_field(layers):
    """Return field and jump of a chain of layers, in pixels of the image."""
    ### BEGIN SOLUTION
    field, jump = 1, 1
    for kernel, stride, rate in layers:
        field += (kernel - 1) * rate * jump
        jump *= stride
    return field, jump
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "field-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
# By hand: 1 + 2 = 3; halve: + 1 = 4, jump 2; + 4 * 2 = 12; rate 2, stride 2: + 2 * 2 * 2 = 20, jump 4; + 2 * 4 = 28.
got = receptive_field([(3, 1, 1), (2, 2, 1), (5, 1, 1), (3, 2, 2), (3, 1, 1)])
assert np.size(got) == 2, f"return two numbers, field and jump; got {got}"
field, jump = got
slips = {
    14: "the jump is forgotten: after a halving each step of a kernel is two pixels of the image",
    37: "a layer's own stride counts from the next layer on: first the field, then the jump",
    40: "a kernel of 3 adds its two neighbours, not three: kernel - 1",
    24: "the rate is forgotten: a kernel of 3 with rate 2 spans 5",
    27: "without any layer an output is its own pixel: start with a field of 1",
    55: "strides multiply: two halvings make a jump of 4, three of 8",
    36: "the rate spreads a kernel, it doesn't move outputs apart: it is no part of the jump",
    16: "you add up the kernels: each adds kernel - 1, in steps of rate times jump",
    30: "a kernel of 3 with rate 2 spans 5 pixels, not 6: it adds (3 - 1) * 2",
    25: "you walk from the last layer to the first: `layers` begins at the image, where the jump is 1",
    17: "rate and stride are swapped: each layer is (kernel, stride, rate)",
    4: "that is the jump: return the field first, then the jump",
}
assert field not in slips, f"a field of {field}: {slips[field]}"
assert field == 28, f"expected a field of 28 pixels, got {field}"
assert jump == 4, f"two layers have stride 2, so outputs lie 4 pixels apart; got {jump}"
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_field(receptive_field)
assert not complaint, complaint
### END HIDDEN TESTS

# %% [markdown]
# ## Task 2: max-pooling with indices, and the way back (2 + 1 points)
#
# `max_pool(image)` takes a map `(h, w)` with even sides, in windows of 2 x 2 that don't overlap. It returns the maxima, `(h / 2, w / 2)`, and of each where it was, as
# an **index of the map**, counted row by row from 0: row · w + column. `unpool(pooled, indices, shape)` is the way back: a map of `shape` that is zero but where
# the indices say. The shape is given, since a map of five rows is pooled to two.


# %% nbgrader={"grade": false, "grade_id": "pool", "locked": false, "schema_version": 3, "solution": true, "task": false}
def max_pool(image):
    """Return the maxima of 2x2 windows and their indices, both (h / 2, w / 2)."""
    ### BEGIN SOLUTION
    h, w = image.shape
    windows = image.reshape(h // 2, 2, w // 2, 2).swapaxes(1, 2).reshape(h // 2, w // 2, 4)
    row, column = np.divmod(windows.argmax(axis=-1), 2)
    v, u = np.ogrid[: h // 2, : w // 2]
    return windows.max(axis=-1), (2 * v + row) * w + 2 * u + column
    ### END SOLUTION


def unpool(pooled, indices, shape):
    """Return a map of `shape` with each maximum where it was."""
    ### BEGIN SOLUTION
    image = np.zeros(shape)
    image.flat[indices.ravel()] = pooled.ravel()
    return image
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "pool-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
image = np.array([[1.0, 2, 0, 0, 7, 1], [0, 0, 4, 3, 0, 0], [0, 5, 0, 0, 0, 1], [6, 0, 0, 8, 3, 0]])
got = max_pool(image)
assert got is not None, "max_pool returned nothing: did you forget `return`?"
assert len(got) == 2, "return two arrays, the maxima and their indices"
pooled, indices = (np.asarray(part) for part in got)
assert pooled.shape != (3, 5), "your windows overlap: from one to the next it is two rows or columns"
assert pooled.shape == (2, 3), f"a (4, 6) map has 2 x 3 windows, got maxima of shape {pooled.shape}"
assert not np.allclose(pooled, 0), "those are the minima: take the largest of each window"
assert not np.isclose(pooled[0, 0], 0.75), "that is the mean of the window: take its maximum"
np.testing.assert_allclose(pooled, [[2, 4, 7], [6, 8, 3]], err_msg="the largest number of each window")
assert indices.shape == (2, 3), f"expected one index a window, row * w + column, shape (2, 3), got {indices.shape}"
slips = {
    (2, 3): "that is the index in the window: after unpooling nobody would know which window; count in the whole map",
    (6, 15): "you multiply the row by the height: a row of the map has w = 6 numbers",
    (9, 15): "you count column by column: numpy and PyTorch count row by row",
    (5, 12): "you multiply the row by the width of the pooled map: the index is that of the large map, w = 6",
    (9, 22): "you count from 1: the first number of the map has index 0",
    (2, 14): "that is the window's first number: where in the window is the maximum?",
}
found = (int(indices[0, 1]), int(indices[1, 1]))
assert found not in slips, f"the indices of 4 and of 8 are {found[0]} and {found[1]}: {slips[found]}"
np.testing.assert_array_equal(indices, [[1, 8, 4], [18, 21, 22]], err_msg="4 is in row 1, column 2: 1 * 6 + 2 = 8")
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_pool(max_pool)
assert not complaint, complaint
### END HIDDEN TESTS

# %% nbgrader={"grade": true, "grade_id": "unpool-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
pooled, indices = np.array([[2.0, 4, 7], [6, 8, 3]]), np.array([[1, 8, 4], [18, 21, 22]])
got = np.asarray(unpool(pooled, indices, (4, 6)))
assert np.shape(got) == (4, 6), f"expected the shape that was asked for, (4, 6), got {np.shape(got)}"
assert np.count_nonzero(got) < 7, (
    "more than six numbers aren't zero: a maximum goes to one place, not to its whole window"
)
assert not np.isclose(got[0, 0], 2), "2 lies at (0, 0), a corner of its window: its index 1 is row 0, column 1"
assert not np.isclose(got[2, 0], 4), (
    "4 lies at (2, 0): index 8 is row 8 // 6 = 1, column 8 % 6 = 2: divide by the width"
)
by_hand = [[0, 2, 0, 0, 7, 0], [0, 0, 4, 0, 0, 0], [0, 0, 0, 0, 0, 0], [6, 0, 0, 8, 3, 0]]
np.testing.assert_allclose(got, by_hand, err_msg="each maximum where it was, all else zero")
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_unpool(unpool)
assert not complaint, complaint
### END HIDDEN TESTS

# %% [markdown]
# ## Task 3: a convolution with holes (3 points)
#
# Complete `atrous(image, kernel, rate)`: the 3x3 convolution of one channel whose weights lie `rate` pixels apart. The output has the size of the image; outside
# the image everything is zero. As everywhere in deep learning the kernel isn't turned round:
#
# $$ \text{out}[v, u] = \sum_{n=0}^{2} \sum_{m=0}^{2} \text{kernel}[n, m]\;
#    \text{in}[v + \text{rate} \cdot (n - 1),\; u + \text{rate} \cdot (m - 1)] $$


# %% nbgrader={"grade": false, "grade_id": "atrous", "locked": false, "schema_version": 3, "solution": true, "task": false}
def atrous(image, kernel, rate):
    """Return the convolution of an image (h, w) with a kernel (3, 3), (h, w)."""
    ### BEGIN SOLUTION
    h, w = image.shape
    padded = np.pad(image, rate)
    out = np.zeros((h, w))
    for n, m in np.ndindex(3, 3):
        out += kernel[n, m] * padded[rate * n : rate * n + h, rate * m : rate * m + w]
    return out
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "atrous-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
image, kernel = np.zeros((5, 7)), np.arange(1.0, 10).reshape(3, 3)  # 1 2 3 / 4 5 6 / 7 8 9
image[2, 3] = 1
got = np.asarray(atrous(image, kernel, rate=2))
slips = {
    (): "atrous returned nothing: did you forget `return`?",
    (3, 4): "you take the rate for a stride: every pixel has an output, it is the weights that lie apart",
    (3, 5): "with rate 2 the kernel reaches 2 pixels beyond the border: pad by rate, not by 1",
    (1, 3): "the border is missing: pad with `rate` zeros on each side",
}
assert np.shape(got) == (5, 7), f"shape {np.shape(got)}: {slips.get(np.shape(got), 'that of the image is (5, 7)')}"
assert not np.isclose(got[2, 2], 6), "the pixel's neighbour answers: with rate 2 the kernel skips it"
assert np.isclose(got[2, 3], 5), f"the middle weight, 5, meets the pixel at (2, 3) itself; got {got[2, 3]:g}"
slips = {
    1: "the kernel is turned round: for the output at (0, 1) the pixel lies below and to the right, so it meets weight 9",
    3: "the kernel is turned round from top to bottom",
    7: "the kernel is turned round from left to right",
    0: "nothing arrives there: is the rate applied to rows and to columns?",
}
assert got[0, 1] not in slips, f"the output at (0, 1) is {got[0, 1]:g}: {slips[got[0, 1]]}"
assert not np.isclose(got[4, 3], 4), "rows and columns of the kernel are swapped: n counts rows, m columns"
np.testing.assert_allclose(got[::2, 1::2], kernel[::-1, ::-1], err_msg="one pixel of 1 in the middle")
got = np.asarray(atrous(np.ones((5, 7)), kernel, rate=2))
assert np.isclose(got[0, 0], 28), (
    f"ones give {got[0, 0]:g} in the corner, not 5 + 6 + 8 + 9: outside, everything is zero"
)
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_atrous(atrous)
assert not complaint, complaint
### END HIDDEN TESTS

# %% [markdown]
# ## Task 4: a skip: enlarge, crop, add (2 + 1 points)
#
# `coarse` are the scores of a deep map, `(C, h, w)`, and `fine` those of the map above it, `(C, H, W)`, where H is 2h or 2h - 1, and W is 2w or 2w - 1. Cell i of the
# coarse map covers rows (or columns) 2i and 2i + 1 of the fine one, so its value belongs between the two, at 2i + ½. In between, interpolate bilinearly; beyond the
# first and the last of these places the value stays constant. A last row or column that the fine map hasn't got is cut off.
#
# Complete `add_skip`: it returns the enlarged coarse scores plus the fine ones, `(C, H, W)`, and leaves its arguments as they are.


# %% nbgrader={"grade": false, "grade_id": "skip", "locked": false, "schema_version": 3, "solution": true, "task": false}
def add_skip(coarse, fine):
    """Return the sum of a coarse map, enlarged twofold, and a fine one."""

    ### BEGIN SOLUTION
    def enlarge(values, size):
        places = 2 * np.arange(len(values)) + 0.5
        return np.interp(np.arange(size), places, values)

    _, height, width = fine.shape
    taller = np.apply_along_axis(enlarge, 1, coarse, height)
    return np.apply_along_axis(enlarge, 2, taller, width) + fine
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "skip-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
coarse, fine = np.array([[[4.0, 8, 0, 8]]]), np.zeros((1, 2, 7))
fine[0, :, 3] = 10
got = np.asarray(add_skip(coarse, fine))
assert np.count_nonzero(fine) == 2, "add_skip changed its argument `fine`: make a new array (no +=)"
assert np.shape(got) != (1, 2, 8), "a column too many: the fine map has only seven, cut off the last one"
assert np.shape(got) == (1, 2, 7), f"expected the shape of the fine map, (1, 2, 7), got {np.shape(got)}"
assert not np.allclose(got, fine), "the coarse scores got lost"
slips = {  # of columns 0 to 2; by hand 4, a quarter of the way from 4 to 8, three quarters of it
    (4, 4, 8): "each value is repeated (nearest): interpolate between the places 2i + 1/2",
    (4, 6, 8): "you put value i at column 2i: it covers 2i and 2i + 1, so it belongs between them",
    (4, 5.714, 7.429): "the ends are aligned (align_corners): the first value belongs to 1/2, not to 0",
    (5, 7, 6): "the first column is cut off: cut at the right end",
    (4, 5.429, 7.714): "you stretch the coarse map to seven columns: double it to eight, then cut one off",
    (3, 5, 7): "before the first place, 1/2, the value stays at 4: neither extrapolate nor mix with zeros",
    (2, 2.5, 3.5): "that is the mean: a skip adds",
}
head = got[0, 0, :3]
for slip, hint in slips.items():
    assert not np.allclose(head, slip, atol=1e-3), f"columns 0 to 2 are {head.round(2).tolist()}: {hint}"
assert not np.isclose(got[0, 0, 3], 6), "column 3 is 6, the coarse map alone: add the fine scores"
assert not np.isclose(got[0, 0, 3], 60), "column 3 is 60: a skip adds scores, it doesn't multiply them"
np.testing.assert_allclose(got[0, 0], [4, 5, 7, 16, 2, 2, 6], err_msg="row 0; coarse alone: 4 5 7 6 2 2 6")
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_skip(add_skip)
assert not complaint, complaint
### END HIDDEN TESTS

# %% nbgrader={"grade": true, "grade_id": "rows-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
coarse, fine = np.array([[[0.0], [4]], [[8], [0]]]), np.full((2, 3, 2), 10.0)  # two classes, two rows, one column
got = np.asarray(add_skip(coarse, fine))
assert np.shape(got) == (2, 3, 2), f"expected the shape of the fine map, (2, 3, 2), got {np.shape(got)}: cut rows too"
assert not np.allclose(got[0, :, 0], [10, 10, 14]), "the rows are repeated: rows are interpolated too"
np.testing.assert_allclose(
    got[:, :, 0], [[10, 11, 13], [18, 16, 12]], err_msg="by hand 0 1 3 and 8 6 2, and 10 to each"
)
np.testing.assert_allclose(
    got[:, :, 1], got[:, :, 0], err_msg="the coarse map has one column, so both columns are alike"
)
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_skip(add_skip)
assert not complaint, complaint
### END HIDDEN TESTS

# %% [markdown]
# ## Task 5: the loss of an image (2 + 1 points)
#
# `scores` has the shape `(C, h, w)`, `truth` the shape `(h, w)`: the class of each pixel, or 255 where it isn't labelled. Complete `cross_entropy`: the mean of $-\log
# P(c^*)$ over the labelled pixels, natural logarithm, where $P$ is the soft-max of the pixel's scores. For one more point it must stay right where scores are
# thousands, of either sign, or thousands apart: adding the same to all scores of a pixel changes nothing, so add something that keeps $e^s$ small.
#
# $$ P(c) = \frac{e^{s_c}}{\sum_{c'} e^{s_{c'}}} $$


# %% nbgrader={"grade": false, "grade_id": "loss", "locked": false, "schema_version": 3, "solution": true, "task": false}
def cross_entropy(scores, truth):
    """Return the mean over labelled pixels of -log P(true class)."""
    ### BEGIN SOLUTION
    labelled = truth != 255
    s = scores[:, labelled]
    s = s - s.max(axis=0)
    log_P = s - np.log(np.exp(s).sum(axis=0))
    return -log_P[truth[labelled], np.arange(labelled.sum())].mean()
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "loss-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
# The scores are logarithms of these odds: three classes, two rows, two columns.
odds = np.array([[[4.0, 1], [1, 2]], [[2, 3], [1, 4]], [[2, 4], [6, 2]]])
truth = np.array([[0, 0], [255, 1]])  # P(true class): 4/8, 1/8; -, 4/8
got = cross_entropy(np.log(odds), truth)
assert got is not None, "cross_entropy returned nothing: did you forget `return`?"
assert np.ndim(got) == 0, f"expected one number, the mean, got shape {np.shape(got)}"
slips = {
    0.866: "you divide by all four pixels: one isn't labelled, so divide by three",
    3.466: "that is the sum: take the mean over the labelled pixels",
    -1.155: "the sign is swapped: a loss is -log P, which is never below zero",
    0.502: "that is the logarithm to base 10: take the natural one",
    1.667: "that is the logarithm to base 2: take the natural one",
    0.375: "that is the mean of P(true class): take -log of each",
    0.625: "that is the mean of 1 - P: take -log P of each",
    -0.924: "those are the scores themselves: without soft-max a score says nothing",
    1.040: "you average over classes: the mean is over labelled pixels, whatever their classes",
    0.981: "you take the logarithm of the mean: first the logarithm of each pixel, then their mean",
    1.386: "you count the unlabelled pixel as class 0: 255 means that nobody knows",
    0.938: "you count the unlabelled pixel as the last class: 255 means that nobody knows",
    0.685: "the soft-max runs over the columns of the image: sum over the classes, axis 0",
    0.627: "the soft-max runs over the rows of the image: sum over the classes, axis 0",
    2.542: "the soft-max runs over the whole image: each pixel's classes sum to 1, so sum over axis 0",
}
for slip, hint in slips.items():
    assert not np.isclose(got, slip, atol=2e-3), f"a loss of {got:.3f}: {hint}"
assert np.isclose(got, 1.1552, atol=1e-3), f"expected (log 2 + log 8 + log 2) / 3 = 1.155, got {got:.3f}"
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_loss(cross_entropy)
assert not complaint, complaint
### END HIDDEN TESTS

# %% nbgrader={"grade": true, "grade_id": "large-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
got = cross_entropy(np.array([[[1000.0]], [[1003.0]]]), np.array([[1]]))
assert not np.isnan(got), (
    "scores of 1000 and 1003 give no number, for e^1000 overflows: subtract the pixel's largest score"
)
assert np.isclose(got, 0.0486, atol=1e-4), f"scores 1000 and 1003 must give what 0 and 3 give, 0.049; got {got:.4f}"
got = cross_entropy(np.array([[[-1000.0, 500]], [[0.0, 500]]]), np.array([[0, 1]]))
assert np.isfinite(got), (
    "a score of -1000 against 0 costs 1000, not infinity: keep log P, don't take the logarithm of P"
)
assert np.isclose(got, (1000 + np.log(2)) / 2), f"expected (1000 + 0.693) / 2 = 500.35, got {got:.2f}"
### BEGIN HIDDEN TESTS
from semgrid_instructor import segmentation

complaint = segmentation.check_large(cross_entropy)
assert not complaint, complaint
### END HIDDEN TESTS

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# A dark pole, one pixel wide, stands before a bright sky. What does max-pooling of the *brightness* make of it, and can indices bring it back? SegNet pools
# after two convolutions, not at once: why does that help? And would a skip, as in FCN, have the same trouble? Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "dark-pole", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# Every 2 x 2 window of the pole also holds sky, which is brighter: the maximum is sky in all of them, the pole is gone after one pooling, and the indices say where the sky
# was. A convolution before the pooling can turn "darker than left and right" into a large positive value (the kernel 1 -2 1), so that the maximum of the window is
# the pole's, and its index the pole's place: what is pooled is an answer, not brightness. A skip adds scores computed from the map before it was pooled further; where that map still shows the pole, its scores can
# do so whatever the coarse map has lost; but FCN's finest skip is pool3, which has been pooled three times itself. One point for the sky winning the window and
# that indices can't undo it; one for the learnt answer before pooling, with a word on skips.

# %% [markdown]
# # Exercise 07: three networks for segmentation
#
# Six functions, the parts that tell SegNet, FCN and DeepLab apart and the loss that teaches all of them, and one question to answer in words. Where the lecture
# has a row, a channel or a pixel, you take them a step further, to what a network computes. About 100 minutes. The lecture is [07: three networks for segmentation](../07_segmentation.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | how far a chain of layers sees, and where it looks | 1 + 2 |
# | 2 | pooling with windows that overlap, and the way back | 1 + 1 + 1 |
# | 3 | a layer, with channels, holes and stride | 1 + 1 + 1 |
# | 4 | a skip: enlarge, crop, add | 2 + 1 |
# | 5 | the loss of an image, and its gradient | 1 + 2 + 1 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Your functions leave their arguments as they are. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=2e-3), f"{what} {got:.5g}: {hint}"


# %% [markdown]
# ## Task 1: how far a chain of layers sees, and where it looks (1 + 2 points)
#
# `layers` is a list of `(kernel, stride, rate, padding)`, the first layer of the network first. Each layer puts `padding` zeros before the first of its inputs and
# as many after the last; for output 0, the first weight of its kernel meets the first of these zeros. Complete `receptive_field`: it returns three numbers.
#
# - The **field**: how many pixels a side of the image one output of the chain depends on, zeros of the padding included, as if the image went on.
# - The **jump**: how many pixels of the image two neighbouring outputs lie apart.
# - The **centre**: where output 0 lies in the image, in the middle between the first and the last pixel of its field. Pixel 0 lies at 0, a zero before it at -1; so
#   a centre may be a half, or less than 0.
#
# Field and jump are in the lecture. For the centre ask of each layer: how far from *input* 0 does its output 0 lie, and how many *pixels* wide is a step there? A 3x3
# convolution with padding 1 leaves output 0 where input 0 was; a 2x2 window moves it by half a step. That is why a pooled map has to be enlarged in another way than a
# strided one. Do the chain of the test on paper first.


# %% nbgrader={"grade": false, "grade_id": "field", "locked": false, "schema_version": 3, "solution": true, "task": false}
def receptive_field(layers):
    """Return field, jump and centre of a chain of layers, in pixels of the image."""
    ### BEGIN SOLUTION
    field, jump, centre = 1, 1, 0
    for kernel, stride, rate, padding in layers:
        reach = (kernel - 1) * rate
        field += reach * jump
        centre += (reach / 2 - padding) * jump
        jump *= stride
    return field, jump, centre
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "field-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_FIELD_SLIPS = {
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
    17: "rate and stride are swapped: each layer is (kernel, stride, rate, padding)",
    42: "padding makes a map longer, not a kernel: the field doesn't know of it",
    4: "that is the jump: return the field first, then the jump, then the centre",
}


# %% nbgrader={"grade": true, "grade_id": "field-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Field by hand: 1 + 2 = 3; halve: + 1 = 4, jump 2; + 4 * 2 = 12; rate 2, stride 2: + 2 * 2 * 2 = 20, jump 4; + 2 * 4 = 28.
    layers = [(3, 1, 1, 1), (2, 2, 1, 0), (5, 1, 1, 2), (3, 2, 2, 1), (3, 1, 1, 0)]
    got = answer_array(receptive_field(layers), "receptive_field").ravel()
    assert got.size >= 2, f"return three numbers, field, jump and centre; got {got}"
    _explain("a field of", got[0], _FIELD_SLIPS)
    assert got[0] == 28, f"expected a field of 28 pixels, got {got[0]:g}"
    assert got[1] == 4, f"two layers have stride 2, so outputs lie 4 pixels apart; got {got[1]:g}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_field(receptive_field)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% nbgrader={"grade": false, "grade_id": "centre-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_CENTRE_SLIPS = {
    13.5: "the padding is forgotten: zeros before a map move output 0 to the left",
    9.5: "padding counts in steps of its layer's input: a zero is as wide as the jump",
    2.5: "the jump is forgotten: after a halving each step is two pixels of the image",
    9.0: "a layer's own stride counts from the next layer on: first the centre, then the jump",
    4.5: "the rate spreads the kernel, whose middle is (kernel - 1) * rate / 2 from its first weight; padding stays",
    12.5: "from the first to the middle of three it is one step, of two half a step: (kernel - 1) / 2",
    6.0: "half a pixel is lost: the middle of a 2x2 window lies between two pixels, so don't round",
    7.0: "half a pixel too far: pixel 0 lies at 0, the middle of a 2x2 window half a step on, not a whole one",
    20.5: "the sign of the padding: zeros before a map move output 0 to the left",
    -0.5: "the padding counts twice: zeros after the map don't move output 0",
    10.0: "half of the padding is lost: `padding` zeros stand before the map, and as many after it",
    -7.0: "that is the first pixel of the field: its middle is asked for",
    20.0: "that is the last pixel of the field: its middle is asked for",
    14.0: "that is half the field: from the first to the middle of 28 pixels it is 13.5, and padding counts too",
    3.0: "you walk from the last layer to the first: `layers` begins at the image, where the jump is 1",
    -6.5: "the sign: what a kernel reaches to the right is added, padding is subtracted",
}


# %% nbgrader={"grade": true, "grade_id": "centre-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: 0; the window of 2: + 1/2; + 0; reaching 2 to either side, padded by 1 only: + 1 * 2 = 2.5; not padded: + 1 * 4 = 6.5.
    layers = [(3, 1, 1, 1), (2, 2, 1, 0), (5, 1, 1, 2), (3, 2, 2, 1), (3, 1, 1, 0)]
    got = answer_array(receptive_field(layers), "receptive_field").ravel()
    assert got.size == 3, f"return three numbers, field, jump and centre; got {got}"
    _explain("a centre of", got[2], _CENTRE_SLIPS)
    assert got[2] == 6.5, f"expected a centre of 1/2 + 2 + 4 = 6.5, got {got[2]:g}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_centre(receptive_field)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: pooling with windows that overlap, and the way back (1 + 1 + 1 points)
#
# SegNet pools in windows of 2 x 2, side by side; DeepLab's ResNet in windows of 3 x 3 that begin two pixels apart, so that they overlap. `max_pool(maps, kernel, stride)` takes C maps,
# `(C, h, w)`, in windows of `kernel` x `kernel` pixels. The first stands in the top left corner, the next begins `stride` pixels further on, and only whole windows
# count: what is left at the right or at the bottom is in none. It returns two arrays, `(C, rows of windows, windows a row)`: the maxima, and of each where it was, as an **index of its
# channel**, counted row by row from 0: row · w + column. Where the largest number stands twice in a window (after a ReLU, 0 often does), the one with the smaller
# index wins.
#
# `unpool(values, indices, shape)` is the way back: maps of `shape`, `(C, h, w)`, zero but where the indices say. The values come out of a decoder and are new ones; where windows
# overlap and two of them name the same place, their values **add up**. (It is also how a gradient gets through max-pooling: a pixel that was the largest of two windows
# answers for both.)


# %% nbgrader={"grade": false, "grade_id": "pool", "locked": false, "schema_version": 3, "solution": true, "task": false}
def max_pool(maps, kernel, stride):
    """Return the maxima of the windows of each channel, and their indices."""
    ### BEGIN SOLUTION
    C, h, w = maps.shape
    shape = C, (h - kernel) // stride + 1, (w - kernel) // stride + 1
    pooled, indices = np.zeros(shape), np.zeros(shape, int)
    for c, v, u in np.ndindex(shape):
        top, left = stride * v, stride * u
        window = maps[c, top : top + kernel, left : left + kernel]
        n, m = np.unravel_index(window.argmax(), window.shape)
        pooled[c, v, u], indices[c, v, u] = window[n, m], (top + n) * w + left + m
    return pooled, indices
    ### END SOLUTION


def unpool(values, indices, shape):
    """Return maps of `shape` in which each value is added at its place."""
    ### BEGIN SOLUTION
    maps = np.zeros(shape)
    for c, v, u in np.ndindex(indices.shape):
        maps[c].flat[indices[c, v, u]] += values[c, v, u]
    return maps
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "pool-maps", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _maps():
    """Return the maps of the next tests. In channel 0 two windows share the 7, and none has the 9; in channel 1 there are ties."""
    maps = np.zeros((2, 5, 8))
    maps[0, 0, [1, 6, 7]] = 1, 2, 9
    maps[0, 1, [2, 3]] = 7, 2
    maps[0, [2, 3, 4, 4], [0, 4, 0, 3]] = 3, 5, 4, 6
    maps[1, [0, 1, 3], [3, 3, 1]] = 2, 2, 5
    return maps


print(_maps().astype(int))


# %% nbgrader={"grade": true, "grade_id": "pool-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = max_pool(_maps(), kernel=3, stride=2)
    assert got is not None, "max_pool returned nothing: did you forget `return`?"
    alone = not np.iterable(got) or (isinstance(got, np.ndarray) and got.ndim == 3)
    pooled = answer_array(got if alone else got[0], "for the maxima max_pool")
    slips = {0: "the smallest number", 11 / 9: "the mean", 1: "the largest of 2 x 2 pixels, and not of 3 x 3,"}
    for slip, hint in slips.items():
        assert not np.isclose(pooled.flat[0], slip), f"{slip:.2f} is {hint} of the first window, its largest is 7"
    slips = {
        (2, 3, 6): "your windows begin one pixel apart: take one every `stride` pixels",
        (2, 1, 2): "your windows don't overlap: they begin `stride` pixels apart, not `kernel`",
        (2, 2, 4): "the last window of a row has fewer than three columns: only whole windows count",
        (2, 3, 4): "windows at the border have fewer than 3 x 3 pixels: only whole windows count",
        (2, 3): "you take the maximum over channels too: each channel has its own",
    }
    hint = slips.get(pooled.shape, "2 channels of 2 x 3 windows were expected")
    assert pooled.shape == (2, 2, 3), f"maxima of shape {pooled.shape}: {hint}"
    np.testing.assert_allclose(pooled, [[[7, 7, 2], [4, 6, 5]], [[0, 2, 0], [5, 0, 0]]], err_msg="window by window")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_maxima(max_pool)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% nbgrader={"grade": false, "grade_id": "index-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_INDEX_SLIPS = {
    7: "that is the index in the window: after unpooling nobody would know which window; count in the whole map",
    23: "you multiply the row by the height: a row of the map has w = 8 numbers",
    19: "you count column by column: numpy and PyTorch count row by row",
    15: "you multiply the row by the windows of a row: the index is that of the large map, w = 8",
    36: "you count from 1: the first number of the map has index 0",
    18: "that is the window's first number: where in the window is the maximum?",
    31: "column 7 is in no window, but a row of the map still has 8 numbers",
    26: "the window begins at row 2, column 2, not at 1, 1: windows are `stride` pixels apart",
    44: "windows begin `stride` pixels apart, not `kernel`",
}


# %% nbgrader={"grade": true, "grade_id": "indices-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = max_pool(_maps(), kernel=3, stride=2)
    alone = not np.iterable(got) or (isinstance(got, np.ndarray) and got.ndim == 3)
    two = not alone and len(got) == 2
    assert two, "return two arrays, the maxima and their indices"
    indices = answer_array(got[1], "for the indices max_pool")
    assert indices.shape == (2, 2, 3), f"one index a window, row * w + column, shape (2, 2, 3); got {indices.shape}"
    _explain("the index of 6 is", indices[0, 1, 1], _INDEX_SLIPS)
    found = indices[0, 1, 1]
    assert found == 35, f"6 is in row 4, column 3, so its index is 4 * 8 + 3 = 35, got {found:g}"
    assert indices[1, 1, 0] != 65, "the index of 5 in channel 1 is 65: don't count channel 0, each channel begins at 0"
    tie = "2 stands in row 0 and in row 1: of equal numbers the one with the smaller index wins"
    assert indices[1, 0, 1] != 11, tie
    np.testing.assert_array_equal(indices[0], [[10, 10, 6], [32, 35, 28]], err_msg="channel 0; 7 is in two windows")
    np.testing.assert_array_equal(indices[1], [[0, 3, 4], [25, 18, 20]], err_msg=f"channel 1: {tie}")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_indices(max_pool)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "unpool-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    indices = np.array([[[10, 10, 6], [32, 35, 28]], [[0, 3, 4], [25, 18, 20]]])
    values = np.arange(12.0, 0, -1).reshape(2, 2, 3)  # 12 11 10 / 9 8 7 and 6 5 4 / 3 2 1
    got = answer_array(unpool(values, indices, (2, 5, 8)), "unpool")
    assert got.shape == (2, 5, 8), f"expected the shape that was asked for, (2, 5, 8), got {got.shape}"
    assert np.count_nonzero(got) < 12, (
        "more than eleven numbers aren't zero: a value goes to one place, not to a window"
    )
    assert got[1].any(), "channel 1 is empty: an index counts in its own channel"
    assert got[0, 2, 0] == 0, (
        "row 2, column 0 isn't zero: index 10 is row 10 // 8 = 1, column 10 % 8 = 2: divide by the width"
    )
    slips = {
        11: "the second value has replaced the first. (numpy's maps[indices] += values adds only once where an index repeats.)",
        12: "only the first value, or the larger, has got there",
        11.5: "that is their mean",
    }
    _explain("two windows name row 1, column 2, with 12 and 11, and they add up; it is", got[0, 1, 2], slips)
    by_hand = np.zeros((2, 5, 8))
    by_hand[0, [1, 0, 4, 4, 3], [2, 6, 0, 3, 4]] = 23, 10, 9, 8, 7
    by_hand[1, [0, 0, 0, 3, 2, 2], [0, 3, 4, 1, 2, 4]] = 6, 5, 4, 3, 2, 1
    np.testing.assert_allclose(got, by_hand, err_msg="each value where its index says, 12 + 11 where two say the same")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_unpool(unpool)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: a layer, with channels, holes and stride (1 + 1 + 1 points)
#
# A layer of a network has a kernel for each pair of an output channel $k$ and an input channel $c$, and a bias for each output channel. `maps` is `(C, h, w)`, `kernels` is
# `(K, C, N, N)` with an odd N (3, but also 1 or 7), `bias` is `(K,)`. The weights lie `rate` inputs apart, the outputs `stride` inputs. Outside the maps everything
# is zero, and as everywhere in deep learning the kernel isn't turned round:
#
# $$ \text{out}[k, v, u] = \text{bias}[k] + \sum_c \sum_{n=0}^{N-1} \sum_{m=0}^{N-1} \text{kernels}[k, c, n, m]\;
#    \text{in}\left[c,\; \text{stride}\, v + \text{rate}\, \left(n - \tfrac{N-1}{2}\right),\; \text{stride}\, u + \text{rate}\, \left(m - \tfrac{N-1}{2}\right)\right] $$
#
# Complete `atrous`: it returns the outputs of all places $(\text{stride}\, v, \text{stride}\, u)$ that lie in the map. With stride 1 these are h x w, whatever N and rate are.
# One point is for channels and bias, one for holes and for any odd N, one for the stride (again with any N).


# %% nbgrader={"grade": false, "grade_id": "atrous", "locked": false, "schema_version": 3, "solution": true, "task": false}
def atrous(maps, kernels, bias, stride, rate):
    """Return the K outputs of a layer, (K, places down, places across)."""
    ### BEGIN SOLUTION
    _, h, w = maps.shape
    N = kernels.shape[-1]
    reach = rate * (N - 1) // 2
    padded = np.pad(maps, ((0, 0), (reach, reach), (reach, reach)))
    out = bias[:, None, None]
    for n, m in np.ndindex(N, N):
        seen = padded[:, rate * n : rate * n + h : stride, rate * m : rate * m + w : stride]
        out = out + np.tensordot(kernels[:, :, n, m], seen, axes=1)
    return out
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "layer-inputs", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _kernels():
    """Return kernels (2, 2, 3, 3): for output 0 input 0 meets 1 2 3 / 4 5 6 / 7 8 9, input 1 meets 10 11 12 / 13 14 15 / 16 17 18."""
    return np.arange(1.0, 37).reshape(2, 2, 3, 3)


def _one_layer(answer, maps, kernel, stride, rate):
    """Return what `atrous` says of one map and one kernel, without bias: this is about holes and stride alone."""
    got = answer(maps[None].copy(), kernel[None, None].copy(), np.zeros(1), stride, rate)
    got = answer_array(got, "atrous")
    return got.reshape(got.shape[-2:]) if got.size and got.shape[:-2].count(1) == got.ndim - 2 else got


# %% nbgrader={"grade": false, "grade_id": "channel-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_CHANNEL_SLIPS = {  # by hand 5 + 14 * 100 + 0.5
    1405: "the bias is missing",
    1406: "the bias is added for each input channel: once is enough",
    1409.5: "the bias is added for each weight: once is enough",
    1414: "the bias is added for each weight and each channel: once is enough",
    5.5: "that is channel 0 alone: sum over c",
    1400.5: "that is the last channel alone: sum over c",
    703: "that is the mean over channels: sum over c",
    2305.5: "input and output channel are swapped: kernels are (K, C, N, N)",
    505.5: "all inputs meet the kernel of channel 0: each pair of channels has its own",
}


# %% nbgrader={"grade": true, "grade_id": "atrous-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    inputs = np.zeros((2, 5, 8))
    inputs[:, 2, 4] = 1, 100
    got = answer_array(atrous(inputs, _kernels(), np.array([0.5, 0.25]), stride=1, rate=1), "atrous")
    slips = {
        (2, 2, 5, 8): "sum over the input channels",
        (5, 8): "one output channel is missing, or the two are summed",
        (2, 3, 6): "the border is missing: pad with zeros on each side",
    }
    assert got.shape == (2, 5, 8), f"shape {got.shape}: {slips.get(got.shape, '2 outputs of 5 x 8 were expected')}"
    _explain("output 0 at the ones themselves, (2, 4), is", got[0, 2, 4], _CHANNEL_SLIPS)
    middle, other = got[:, 2, 4]
    hand = "the middle weights, 5 and 14, meet 1 and 100"
    assert np.isclose(middle, 1405.5), f"{hand}: expected 5 + 1400 + 0.5, got {middle:g}"
    assert np.isclose(other, 3223.25), f"output 1 at the same place: expected 23 + 3200 + 0.25, got {other:g}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_channels(atrous)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% nbgrader={"grade": false, "grade_id": "hole-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_HOLE_SHAPES = {
    (3, 4): "you take the rate for a stride: it is the weights that lie apart, not the outputs",
    (3, 6): "with rate 2 the kernel reaches 2 pixels beyond the border: pad by rate, not by 1",
    (1, 4): "the border is missing: pad with zeros on each side",
}
_HOLE_SLIPS = {
    1: "the kernel is turned round: the 1 lies below and to the right, so it meets 9",
    3: "the kernel is turned round from top to bottom: the 1 lies below, so it meets its last row",
    7: "the kernel is turned round from left to right: the 1 lies to the right, so it meets its last column",
    0: "nothing arrives there: (rate + 1) is too far, rate is the distance from weight to weight",
}


# %% nbgrader={"grade": true, "grade_id": "holes-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # One map with a 1 at (2, 4), one kernel, 1 2 3 / 4 5 6 / 7 8 9, no bias.
    dot, kernel = np.zeros((5, 8)), _kernels()[0, 0]
    dot[2, 4] = 1
    got = _one_layer(atrous, dot, kernel, stride=1, rate=2)
    assert got.shape == (5, 8), (
        f"shape {got.shape}: {_HOLE_SHAPES.get(got.shape, 'with stride 1 it is that of the map')}"
    )
    assert not np.isclose(got[2, 3], 6), "the neighbour at (2, 3) answers: with rate 2 the kernel skips it"
    _explain("the output at (0, 2) is", got[0, 2], _HOLE_SLIPS)
    assert not np.isclose(got[4, 4], 4), "rows and columns of the kernel are swapped: n counts rows, m columns"
    hand = "the output at every second pixel around the 1"
    np.testing.assert_allclose(got[::2, 2:7:2], [[9, 8, 7], [6, 5, 4], [3, 2, 1]], err_msg=hand)
    corner = _one_layer(atrous, np.ones((5, 8)), kernel, stride=1, rate=2)[0, 0]
    assert np.isclose(corner, 28), f"a map of ones gives {corner:g} in the corner, not 5 + 6 + 8 + 9: outside is zero"
    try:
        got = _one_layer(atrous, dot, kernel[1:2, 1:2], stride=1, rate=2)
    except IndexError:
        raise AssertionError("kernels of 1 x 1 are refused: take N from kernels.shape") from None
    assert got.shape != (9, 12), "kernels of 1 x 1 reach beyond nothing: pad by rate * (N - 1) / 2"
    assert got.shape == (5, 8), f"kernels of 1 x 1, stride 1: expected 5 x 8 outputs, got {got.shape}"
    assert np.isclose(got[2, 4], 5), f"a kernel of 1 x 1 meets the pixel itself: expected 5, got {got[2, 4]:g}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_holes(atrous)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "stride-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    # One map with a 1 at (2, 3), one kernel, 1 2 3 / 4 5 6 / 7 8 9, no bias. Your outputs with stride 1 tell what is right.
    dot = np.zeros((5, 8))
    dot[2, 3] = 1
    full, got = (_one_layer(atrous, dot, _kernels()[0, 0], stride, rate=1) for stride in (1, 2))
    assert np.count_nonzero(full) == 9, "with stride 1 the nine outputs around the 1 must hear of it, and no others"
    slips = {
        (5, 8): "the stride is ignored",
        (2, 4): "of five rows the stride keeps 0, 2 and 4: three",
        (3, 8): "the stride counts across as well as down",
        (5, 4): "the stride counts down as well as across",
    }
    wanted = full[::2, ::2]
    assert got.shape == wanted.shape, f"shape {got.shape}: {slips.get(got.shape, f'{wanted.shape} was expected')}"
    assert got.any() or not wanted.any(), (
        "all outputs are 0: the rate counts inputs, also where a stride leaves outputs out"
    )
    np.testing.assert_allclose(
        got, wanted, err_msg="output (v, u) belongs to pixel (2v, 2u): every second one of stride 1"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_stride(atrous)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

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
def _test():
    coarse, fine = np.array([[[4.0, 8, 0, 8]]]), np.zeros((1, 2, 7))
    fine[0, :, 3] = 10
    got = answer_array(add_skip(coarse, fine), "add_skip")
    assert np.count_nonzero(fine) == 2, "add_skip changed its argument `fine`: make a new array (no +=)"
    assert got.shape != (1, 2, 8), "a column too many: the fine map has only seven, cut off the last one"
    assert got.shape == (1, 2, 7), f"expected the shape of the fine map, (1, 2, 7), got {got.shape}"
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
    for slip, hint in slips.items():
        assert not np.allclose(got[0, 0, :3], slip, atol=1e-3), f"columns 0 to 2 are {got[0, 0, :3].round(2)}: {hint}"
    assert not np.isclose(got[0, 0, 3], 6), "column 3 is 6, the coarse map alone: add the fine scores"
    assert not np.isclose(got[0, 0, 3], 60), "column 3 is 60: a skip adds scores, it doesn't multiply them"
    np.testing.assert_allclose(got[0, 0], [4, 5, 7, 16, 2, 2, 6], err_msg="row 0; coarse alone: 4 5 7 6 2 2 6")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_skip_columns(add_skip)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "rows-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    coarse, fine = np.array([[[0.0], [4]], [[8], [0]]]), np.full((2, 3, 2), 10.0)  # two classes, two rows, one column
    got = answer_array(add_skip(coarse, fine), "add_skip")
    assert got.shape == (2, 3, 2), f"expected the shape of the fine map, (2, 3, 2), got {got.shape}: cut rows too"
    assert not np.allclose(got[0, :, 0], [10, 10, 14]), "the rows are repeated: rows are interpolated too"
    hand = "by hand 0 1 3 and 8 6 2, and 10 to each"
    np.testing.assert_allclose(got[:, :, 0], [[10, 11, 13], [18, 16, 12]], err_msg=hand)
    hand = "the coarse map has one column, so both columns are alike"
    np.testing.assert_allclose(got[:, :, 1], got[:, :, 0], err_msg=hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_skip_rows(add_skip)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: the loss of an image, and its gradient (1 + 2 + 1 points)
#
# `scores` has the shape `(C, h, w)`, `truth` the shape `(h, w)`: the class of each pixel, or 255 where it isn't labelled. The loss is the mean of $-\log P(c^*)$ over
# the labelled pixels, natural logarithm, where $P$ is the soft-max of the pixel's scores.
#
# $$ P(c) = \frac{e^{s_c}}{\sum_{c'} e^{s_{c'}}} $$
#
# Complete `loss_and_gradient`: it returns two things, the loss and its derivative with respect to each score, `(C, h, w)`. The lecture has the derivative of one pixel's loss; what
# becomes of it in a mean, and what does a pixel teach that nobody has labelled? `scores` stays as it is.
#
# For the last point both must stay right where scores are thousands, of either sign, or thousands apart: adding the same to all scores of a pixel changes nothing, so add
# something that keeps $e^s$ small.


# %% nbgrader={"grade": false, "grade_id": "loss", "locked": false, "schema_version": 3, "solution": true, "task": false}
def loss_and_gradient(scores, truth):
    """Return the mean over labelled pixels of -log P(true class), and its derivative with respect to the scores."""
    ### BEGIN SOLUTION
    labelled = truth != 255
    shifted = scores - scores.max(axis=0)
    log_P = shifted - np.log(np.exp(shifted).sum(axis=0))
    is_true = np.arange(len(scores))[:, None, None] == truth
    gradient = labelled * (np.exp(log_P) - is_true) / labelled.sum()
    return -log_P[is_true].mean(), gradient
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "loss-image", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _image():
    """Return scores (3, 2, 2) and classes (2, 2). Scores are logarithms of odds: P(true class) is 4/8, 1/8; -, 4/8."""
    odds = np.array([[[4.0, 1], [1, 2]], [[2, 3], [1, 4]], [[2, 4], [6, 2]]])
    return np.log(odds), np.array([[0, 0], [255, 1]])


_LOSS_SLIPS = {
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


# %% nbgrader={"grade": true, "grade_id": "loss-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    scores, truth = _image()
    got = loss_and_gradient(scores, truth)
    assert np.array_equal(scores, _image()[0]), (
        "loss_and_gradient changed its argument `scores`: make a new array (no -=)"
    )
    loss = answer_array(got[0] if isinstance(got, tuple | list) else got, "for the loss loss_and_gradient")
    assert loss.ndim == 0, f"expected one number first, the mean, got shape {loss.shape}"
    _explain("a loss of", loss, _LOSS_SLIPS)
    assert np.isclose(loss, 1.1552, atol=1e-3), f"expected (log 2 + log 8 + log 2) / 3 = 1.155, got {loss:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_loss(loss_and_gradient)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% nbgrader={"grade": false, "grade_id": "gradient-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_GRADIENT_SLIPS = {
    -0.875: "that is the gradient of this pixel's loss: in a mean of three it counts a third",
    -0.219: "you divide by all four pixels: one isn't labelled, so divide by three",
    -0.073: "you divide by all scores of the image: the mean is over three labelled pixels",
    0.292: "the sign is swapped: a higher score of the true class makes the loss smaller",
    0.042: "that is P alone: probability minus truth, where truth is 1 for the true class",
    -2.667: "that is the derivative with respect to P, -1 / P: go on to the scores",
    -0.036: "that is the derivative of the mean of -P: the loss is the mean of -log P",
}


# %% nbgrader={"grade": true, "grade_id": "gradient-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand, the pixel in row 0, column 1: P is 1/8, 3/8, 4/8 and class 0 is true, so (1/8 - 1, 3/8, 4/8), and a third of it in the mean.
    got = loss_and_gradient(*_image())
    assert isinstance(got, tuple | list), f"return two things, the loss and its gradient; got {got}"
    gradient = answer_array(got[1], "for the gradient loss_and_gradient")
    assert gradient.shape == (3, 2, 2), f"one derivative a score, shape (3, 2, 2), got {gradient.shape}"
    assert np.allclose(gradient[:, 1, 0], 0), "the pixel that isn't labelled has no part in the loss: its gradient is 0"
    of_true, *others = gradient[:, 0, 1]
    _explain("by the true class's score in row 0, column 1:", of_true, _GRADIENT_SLIPS)
    assert np.isclose(of_true, -0.2917, atol=1e-3), (
        f"by the true class's score: expected -7/24 = -0.292, got {of_true:.3f}"
    )
    assert np.any(others), "the other classes' scores have a gradient too: they stand in the sum below the fraction"
    np.testing.assert_allclose(others, [1 / 8, 1 / 6], err_msg="by the other two scores, 3/8 and 4/8, a third of each")
    hand = "row 1, column 1, where class 1 is true"
    np.testing.assert_allclose(gradient[:, 1, 1], [1 / 12, -1 / 6, 1 / 12], err_msg=hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_gradient(loss_and_gradient)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": false, "grade_id": "large-pixel", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _one_pixel(answer, score_0, score_1, truth):
    """Return what an answer says of one pixel of two classes: the loss, one number, and its gradient."""
    got = answer(np.array([[[score_0]], [[score_1]]], float), np.array([[truth]]))
    assert isinstance(got, tuple | list), f"return two things, the loss and its gradient; got {got}"
    loss = answer_array(got[0], "for the loss loss_and_gradient").mean()
    return loss, answer_array(got[1], "for the gradient loss_and_gradient")


# %% nbgrader={"grade": true, "grade_id": "large-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    loss, gradient = _one_pixel(loss_and_gradient, 1000, 1003, truth=1)
    small, gradient_small = _one_pixel(loss_and_gradient, 0, 3, truth=1)
    assert not np.isnan(loss), (
        "scores of 1000 and 1003 give no number, for e^1000 overflows: subtract the pixel's largest score"
    )
    assert np.isclose(loss, small), f"scores 1000 and 1003 must give what 0 and 3 give, {small:.3f}; got {loss:.4f}"
    right = not np.isnan(gradient).any()
    assert right, "the loss is right, the gradient no number: subtract the largest score there too"
    assert np.allclose(gradient, gradient_small), "scores 1000 and 1003 must give the gradient that 0 and 3 give"
    loss, gradient = _one_pixel(loss_and_gradient, -1000, 0, truth=0)
    half, gradient_half = _one_pixel(loss_and_gradient, -500, 0, truth=0)
    assert np.isfinite(loss), (
        "a score of -1000 against 0 costs 1000, not infinity: keep log P, don't take the logarithm of P"
    )
    twice = abs(loss) > 100 and np.isclose(loss, 2 * half)
    assert twice, f"-1000 against 0 must cost twice what -500 does: {loss:.1f} and {half:.1f}. Is log P cut off?"
    right = gradient.any() and np.allclose(gradient, gradient_half)
    assert right, "-1000 and 0 must give the gradient that -500 and 0 give: P is 0 and 1"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_large(loss_and_gradient)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

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

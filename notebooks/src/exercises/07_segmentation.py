# %% [markdown]
# # Exercise 07: three networks for segmentation
#
# Each function here asks for more than the lecture gives. You design a chain of layers, take pooling a step further than the lecture's toy, measure three trained
# networks, find out which mechanism works inside a black box, repair a loss, and answer two questions in words. About 100 minutes. The lecture is
# [07: three networks for segmentation](../07_segmentation.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | the shortest chain that sees everything | 1 + 2 |
# | 2 | pooling with windows that overlap, and the way back | 1 + 1 + 1 |
# | 3 | how far must a real street move? | 1 + 2 |
# | 4 | which mechanism is in the box? | 1 + 2 |
# | 5 | repair a loss | 1 + 2 + 1 |
# | 6 | in your own words | 1 + 1 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Your functions leave their arguments as they are. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does


def _explain(what, got, slips):
    """Stop with a hint when the number `got` is what a common slip gives."""
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, atol=2e-3), f"{what} {got:.5g}: {hint}"


# %% [markdown]
# ## Task 1: the shortest chain that sees everything (1 + 2 points)
#
# You may build a chain of 3x3 convolutions, all of stride 1, and you may choose the *rate* of each. A customer names the receptive field, an odd number of pixels. She
# wants a chain
#
# - that has exactly this field: the output depends on nothing farther away;
# - without gaps: the output depends on *every* pixel of its field;
# - with as few layers as possible.
#
# Complete `fewest_rates`: it returns the list of rates, first layer first. Three layers of rate 1 have a field of 7 without gaps; three of rate 2 a field of 13 with gaps.
# A field of 1 needs no layer, so it gets an empty list. One point is for the first two wishes, two are for the third.


# %% nbgrader={"grade": false, "grade_id": "chain", "locked": false, "schema_version": 3, "solution": true, "task": false}
def fewest_rates(field):
    """Return the rates of the shortest chain of 3x3 layers with this field and no gap."""
    ### BEGIN SOLUTION
    to_see, rates = (field - 1) // 2, []  # to either side
    while sum(rates) < to_see:
        rates.append(min(2 * sum(rates) + 1, to_see - sum(rates)))
    return rates
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "chain-rules", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _rates(answer, field):
    """Return the rates that an answer gives for a field, after a look at what they are."""
    rates = answer_array(answer(field), "fewest_rates")
    assert rates.ndim == 1, f"return a list of rates, one per layer; got shape {rates.shape}"
    whole = np.all(rates == np.round(rates)) and np.all(rates >= 1)
    assert whole, f"field {field}: a rate is a whole number from 1; got {rates}"
    return rates.astype(int).tolist()


def _seen(rates):
    """Return how far from the output the pixels lie that it depends on, in order."""
    places = {0}
    for rate in rates:
        places = {place + step for place in places for step in (-rate, 0, rate)}
    return sorted(places)


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "chain-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    for field in (1, 7, 3, 13, 27, 61):
        rates = _rates(fewest_rates, field)
        got = 1 + 2 * sum(rates)
        slips = {
            2 * field
            - 1: "a layer of rate r adds 2 r to the field, r to either side: the rates sum to (field - 1) / 2",
            field + 2: "one pixel too far to either side: the output's own pixel is part of the field",
            field - 2: "one pixel short to either side: the rates sum to (field - 1) / 2",
        }
        hint = slips.get(got, "each layer of rate r adds 2 r, and the output sees its own pixel")
        assert got == field, f"rates {rates} have a field of {got}, not {field}: {hint}"
        seen = _seen(rates)
        text = f"field {field}, rates {rates}: only {len(seen)} of its pixels count, those at {seen[:9]} ..."
        assert len(seen) == field, f"{text}, as with the lecture's rates 2, 2, 2"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_chain(fewest_rates)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "fewest-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    for field, fewest in ((3, 1), (9, 2), (27, 3), (29, 4), (243, 5)):
        rates = _rates(fewest_rates, field)
        whole = 1 + 2 * sum(rates) == field == len(_seen(rates))
        assert whole, f"rates {rates}: first mend the field, {field}, or its gaps"
        hint = (
            "the lecture's rates 1, 2, 4 see 7 to either side; is 4 the largest rate that leaves no gap after 1 and 2?"
        )
        few = len(rates) <= fewest
        assert few, f"field {field}: {fewest} layers are enough, you take {len(rates)}; {hint}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_fewest(fewest_rates)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: pooling with windows that overlap, and the way back (1 + 1 + 1 points)
#
# SegNet pools in windows of 2 x 2, side by side; DeepLab in windows of 3 x 3 that begin two pixels apart, so that they overlap. `max_pool(maps, kernel, stride)` takes C maps,
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "pool-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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

# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "index-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "indices-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "unpool-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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
# ## Task 3: how far must a street move? (1 + 2 points)
#
# The lecture moved a street by one pixel, and an eighth of SegNet's labels didn't move along. You measure this for any network. It is given as a function: `label(image)`
# takes an image `(h, w, 3)` and returns the class of each pixel, `(h, w)`.
#
# `share_moved(label, image, shift, margin)` shows the network two views of one image: all columns but the last `shift`, and all but the first `shift`. In the second view
# everything is `shift` columns further left. Return the share of pixels that get the same class in both views. Count all places of the street that are at least `margin` columns away from
# the left and the right border of *both* views: the outermost `margin` columns of each view don't count. (Near a border the network sees what is beyond it, which doesn't move along.)
#
# `period(label, image, margin)` returns the smallest shift out of 1, 2, 4, 8, 16, 32, 64 with which *all* labels move along, or 0 if there is none.
#
# One point is for the share, two are for the period. The last test asks the three shipped networks; on a slow machine it takes a minute or more. Write down what you expect for each before you run it; the lecture's drawings are enough.


# %% nbgrader={"grade": false, "grade_id": "moved", "locked": false, "schema_version": 3, "solution": true, "task": false}
def share_moved(label, image, shift, margin):
    """Return the share of pixels that keep their class when the street moves left by `shift` columns."""
    ### BEGIN SOLUTION
    before, after = label(image[:, :-shift]), label(image[:, shift:])
    width = before.shape[1]
    return np.mean(before[:, shift + margin : width - margin] == after[:, margin : width - margin - shift])
    ### END SOLUTION


def period(label, image, margin):
    """Return the smallest shift out of 1, 2, 4, ... 64 with which all labels move along; 0 if there is none."""
    ### BEGIN SOLUTION
    for shift in (1, 2, 4, 8, 16, 32, 64):
        if share_moved(label, image, shift, margin) == 1:
            return shift
    return 0
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "toy-network", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _street(width=150, seed=5):
    """Return a street of patches, (3, width, 3)."""
    patches = np.random.default_rng(seed).integers(0, 200, (3, width // 3 + 1, 3))
    return np.repeat(patches, 3, axis=1)[:, :width].astype(np.uint8)


def _network(every, border=0):
    """Return a toy that looks at every so many columns, as a network that has halved; at the border all is class 9."""

    def label(image):
        image = np.asarray(image)
        classes = np.repeat(image[:, ::every, 0] // 50, every, axis=1)[:, : image.shape[1]].astype(int)
        if border:
            classes[:, :border] = classes[:, -border:] = 9
        return classes

    return label


# %% nbgrader={"grade": false, "grade_id": "real-networks", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _real_network(name):
    """Return one of the course's image networks as a function, and a wide strip of four images of the drive."""
    import torch

    from semgrid_edu.datasets.samples import sample_drive, sample_image_stage
    from semgrid_edu.frame import resize_image
    from semgrid_edu.networks import load_net

    torch.set_num_threads(1)
    drive = sample_drive()
    net = load_net(sample_image_stage(name), drive.camera).segmenter
    images = [resize_image(drive[k].image, (96, 320))[40:72] for k in (2, 6, 10, 14)]

    @torch.inference_mode()
    def label(image):
        x = torch.from_numpy(np.array(image, np.uint8)).permute(2, 0, 1)[None] / 255
        return net(x)[0].argmax(dim=0).numpy()

    return label, np.concatenate(images, axis=1)[:, :768]


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "moved-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_MOVED_SLIPS = {
    0.1813: "you compare the same column of both views: in the second view the street is `shift` columns further left",
    0.2583: "you move the second view the wrong way",
    0.6214: "the borders of the views count: leave out `margin` columns of each",
    0.6308: "only one side of the views is left out: there are two borders",
    0.6160: "`margin` counts in one view only: what is far from the border in one may be near it in the other",
    0.3583: "that is the share that does not move along",
    0.6400: "np.roll puts the columns of one border at the other: take two views of the image",
    0.6480: "np.roll puts the columns of one border at the other: take two views of the image",
    231: "that is a number of pixels: divide by all that you compare",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "moved-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_array(share_moved(_network(4, border=10), _street(), 5, 10), "share_moved").ravel()
    assert got.size == 1, f"return one number, the share; got shape {got.shape}"
    for slip, hint in _MOVED_SLIPS.items():
        assert not np.isclose(got[0], slip, atol=1e-4), f"a share of {got[0]:.4f}: {hint}"
    expected = "231 of 3 x 120 pixels, 0.6417"
    assert np.isclose(got[0], 231 / 360, atol=1e-5), (
        f"expected {expected}, got {got[0]:.4f}: which columns do you compare?"
    )
    whole = answer_array(share_moved(_network(4, border=10), _street(), 8, 10), "share_moved").ravel()[0]
    assert np.isclose(whole, 1), (
        f"moved by 8, a network that looks at every fourth column is right everywhere; got {whole:g}"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_moved(share_moved)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "period-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    for every in (1, 4, 32, 2):
        got = answer_array(period(_network(every, border=3), _street(), 3), "period").ravel()
        assert got.size == 1, f"return one number, the shift; got shape {got.shape}"
        hint = "all labels must move along, and a smaller shift comes first"
        assert got[0] == every, (
            f"a network that looks at every {every} columns: expected {every}, got {got[0]:g}: {hint}"
        )
    got = answer_array(period(_network(7), _street(), 3), "period").ravel()[0]
    assert got == 0, f"no power of 2 is a multiple of 7, so expected 0, got {got:g}"
    periods = {"segnet": 16, "fcn": 32, "deeplab": 8}
    for name, wanted in periods.items():
        got = answer_array(period(*_real_network(name), 256), "period").ravel()[0]
        assert got == wanted, f"{name}: expected {wanted}, the cells of its coarsest map in pixels, got {got:g}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_period(period)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: which mechanism is in the box? (1 + 2 points)
#
# Somebody hands you a box. `box(image)` takes an image `(h, w)` whose sides are multiples of 8, makes it smaller or blurs it, and returns an image of the same size. Inside
# works one of four mechanisms, with fixed weights:
#
# | name | inside |
# |---|---|
# | `INDICES` | max-pooling, one to three times, and unpooling by the indices |
# | `SKIPS` | max-pooling, one to three times; on the way up, interpolation, and each finer map added with a weight |
# | `STRIDED` | a kernel without negative weights, with stride 2, one to three times, then interpolation |
# | `ATROUS` | the same kernels without stride, with rates 1, then 2, then 4: an output sees at most 7 pixels to either side |
#
# Complete `name_mechanism`: it returns one of the four. You may feed the box as many images as you like. Don't compare with the lecture's numbers, because the boxes of the
# tests have other kernels, weights and depths. Ask for *properties*: what is true of every box of a kind, and of no box of the others? Is the answer to a sum the sum of the
# answers? What becomes of the answer when the image moves by one pixel? (Keep away from the border: put what you move in the middle.) One point is for boxes like the lecture's, two are for strange ones.


# %% nbgrader={"grade": false, "grade_id": "box-maker", "locked": true, "schema_version": 3, "solution": false, "task": false}
INDICES, SKIPS, STRIDED, ATROUS = range(4)
_NAMES = ("INDICES", "SKIPS", "STRIDED", "ATROUS")


def _along(image, change):
    """Return an image after a change of its columns, and then of its rows."""
    return change(change(image).T).T


def _resized(image, places):
    """Return an image read at these places, down and across, bilinearly; beyond the border it stays constant."""
    return _along(image, lambda one: np.array([np.interp(places, np.arange(len(row)), row) for row in one]))


def _pooled(image):
    """Return the maxima of 2 x 2 windows, and for each where it was, row * width + column."""
    h, w = image.shape
    windows = image.reshape(h // 2, 2, w // 2, 2).swapaxes(1, 2).reshape(h // 2, w // 2, 4)
    row, column = np.divmod(windows.argmax(axis=-1), 2)
    v, u = np.ogrid[: h // 2, : w // 2]
    return windows.max(axis=-1), (2 * v + row) * w + 2 * u + column


# %% nbgrader={"grade": false, "grade_id": "box-insides", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _maxima(image, depth, weight=None):
    """Return an image that was pooled and came back: by its indices, or with a weight of the finer maps by skips."""
    if depth == 0:
        return image
    pooled, places = _pooled(image)
    small = _maxima(pooled, depth - 1, weight)
    if weight is not None:
        return _resized(small, (np.arange(len(image)) - 0.5) / 2) + weight * image
    back = np.zeros(image.size)
    back[places.ravel()] = small.ravel()
    return back.reshape(image.shape)


def _sums(image, depth, kernel, stride):
    """Return an image after kernels with stride 2, interpolated to its old size, or without stride and with holes."""
    places = np.arange(len(image)) / stride**depth
    for level in range(depth):
        rate = 1 if stride == 2 else 2**level
        padded = np.pad(image, rate)
        n, holes = len(image), rate * np.arange(3)
        across = sum(k * padded[:, hole : hole + n] for k, hole in zip(kernel, holes, strict=True))
        image = sum(k * across[hole : hole + n] for k, hole in zip(kernel, holes, strict=True))[::stride, ::stride]
    return _resized(image, places)


# %% nbgrader={"grade": false, "grade_id": "box-of-a-kind", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _box(kind, depth=2, kernel=(0.25, 0.5, 0.25), weight=1.0, size=16):
    """Return a box of a kind for images of `size` x `size` pixels."""

    def box(image):
        image = np.array(image, float)
        assert image.shape == (size, size), f"this box takes images of {size} x {size} pixels, got {image.shape}"
        if kind in (0, 1):
            return _maxima(image, depth, weight if kind else None)
        return _sums(image, depth, kernel, stride=2 if kind == 2 else 1)

    return box


# %% nbgrader={"grade": false, "grade_id": "boxes", "locked": false, "schema_version": 3, "solution": true, "task": false}
def name_mechanism(box, size):
    """Return INDICES, SKIPS, STRIDED or ATROUS; the box takes images of `size` x `size` pixels."""
    ### BEGIN SOLUTION
    one, other = np.random.default_rng(0).random((2, size, size))
    if np.allclose(box(one + other), box(one) + box(other)):
        dot = np.zeros((size, size))
        dot[size // 2, size // 2] = 1
        moves = np.allclose(box(np.roll(dot, 1, axis=1)), np.roll(box(dot), 1, axis=1))
        return ATROUS if moves else STRIDED
    return INDICES if np.mean(box(1 + one) == 0) > 0.5 else SKIPS
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "box-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_BOX_HINTS = {  # by the two kinds that are confused
    (0, 1): "both find a bright post; which of them leaves three of four pixels at zero, even in a bright image?",
    (2, 3): "a post in one column doesn't tell them apart: move it by one pixel, and see whether the answer moves",
    (
        1,
        3,
    ): "one is a sum of products, the other takes maxima: is the answer to a sum of two images the sum of the answers?",
}


def _named(answer, kind, size=16, **parts):
    """Stop with a hint when an answer gives a box another name."""
    got = answer_array(answer(_box(kind, size=size, **parts), size), "name_mechanism").ravel()
    assert got.size == 1, f"return one of the four names, got {got}"
    assert got[0] in range(4), f"return INDICES, SKIPS, STRIDED or ATROUS, got {got[0]:g}"
    confused = tuple(sorted((kind, int(got[0]))))
    hint = _BOX_HINTS.get(confused, "which property do maxima have, and which have sums of products?")
    assert got[0] == kind, f"this box is {_NAMES[kind]}, and you say {_NAMES[int(got[0])]}: {hint}"


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "boxes-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    for kind in (3, 0, 2, 1):
        _named(name_mechanism, kind)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_boxes(name_mechanism)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "strange-boxes-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    for depth in (1, 3):
        for kernel in ((0.2, 0.7, 0.1), (0.0, 1.0, 0.5)):
            for kind in (1, 2, 0, 3):
                _named(name_mechanism, kind, size=24, depth=depth, kernel=kernel, weight=0.3)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import segmentation

    complaint = segmentation.check_strange_boxes(name_mechanism)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: repair a loss (1 + 2 + 1 points)
#
# A colleague's network learns badly. Here is her loss. `scores` has the shape `(C, h, w)`, `truth` the shape `(h, w)`: the class of each pixel, or 255 where it isn't
# labelled. The function should return the mean of $-\log P(c^*)$ over the labelled pixels (natural logarithm, $P$ the soft-max of the pixel's scores), and the derivative of
# this mean with respect to each score, `(C, h, w)`.
#
# ```python
# def loss_and_gradient(scores, truth):
#     P = np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)
#     true = np.clip(truth, 0, len(scores) - 1)
#     one_hot = np.arange(len(scores))[:, None, None] == true
#     return -np.log(P[one_hot]).sum() / truth.size, P - one_hot
# ```
#
# It runs on any image and raises no error, yet it has at least four mistakes. Write it rightly. The mistakes aren't independent: mending one may show the next. `scores`
# stays as it is.
#
# For the last point both results must stay right where scores are ten thousands, of either sign, or thousands apart: adding the same to all scores of a pixel changes
# nothing, so add something that keeps $e^s$ small.


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


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "loss-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "loss-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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

# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "gradient-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_GRADIENT_SLIPS = {
    -0.875: "that is the gradient of this pixel's loss: in a mean of three it counts a third",
    -0.219: "you divide by all four pixels: one isn't labelled, so divide by three",
    -0.073: "you divide by all scores of the image: the mean is over three labelled pixels",
    0.292: "the sign is swapped: a higher score of the true class makes the loss smaller",
    0.042: "that is P alone: probability minus truth, where truth is 1 for the true class",
    -2.667: "that is the derivative with respect to P, -1 / P: go on to the scores",
    -0.036: "that is the derivative of the mean of -P: the loss is the mean of -log P",
}


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "gradient-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
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


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "large-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
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
# ## Task 6: in your own words (1 + 1 points)
#
# **a** A dark pole, one pixel wide, stands before a bright sky. What does max-pooling of the *brightness* make of it, and can indices bring it back? SegNet pools
# after two convolutions, not at once: why does that help? Three sentences are enough.
#
# **b** A blog writes: "We trained network A with atrous kernels for 100 epochs and network B with strides for 30, on the same 24 images. On these images A gets 95 % of the
# pixels right and B 88 %. So strides lose thin things." Name three faults of this argument, each with the control or the number that you would ask for.

# %% [markdown] nbgrader={"grade": true, "grade_id": "dark-pole", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# **a** Every 2 x 2 window of the pole also holds sky, which is brighter: the maximum is sky in all of them, the pole is gone after one pooling, and the indices say where
# the sky was. A convolution before the pooling can turn "darker than left and right" into a large positive value (the kernel 1 -2 1), so that the maximum of the window is
# the pole's, and its index the pole's place: what is pooled is an answer, not brightness.
#
# **b** (1) The training differs, too: give both the same number of steps, and several seeds each. (2) Judged on the images learned from, both numbers may be memory: ask for
# images (cameras, streets) that nobody learned from. (3) Pixel accuracy hardly sees thin things, which are few pixels: ask for the IoU of poles, and for that of a baseline. Also
# right: other things may differ besides the stride (decoder, number of weights, receptive field): change the stride alone. One point for **a**: the sky wins each window, so
# that indices can't undo it, and a learned answer before pooling; one for **b**: three faults, each with what to ask for.

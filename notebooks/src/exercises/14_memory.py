# %% [markdown]
# # Exercise 14: memory for classes
#
# Weigh frames, measure how long errors last, let the laser correct the memory, and write a memory of your own; one question to answer in words.
# About 90 minutes. The lecture is [14: memory for classes](../14_memory.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | several frames, each with its exponent | 2 |
# | 2 | how long errors last, and what that makes of T frames | 2 |
# | 3 | the laser corrects the memory | 3 |
# | 4 | your memory, on the real street | 3 |
# | 5 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers and other frames. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings
from copy import deepcopy as _copy
from dataclasses import replace as _replace

import numpy as np

from semgrid_edu.workshop.course.answers import answer_array
from semgrid_edu.memory import View
from semgrid_edu.memory import remember_drive as _remember_drive
from semgrid_edu.occupancy import Belief, PlanarMotion  # for task 4
from semgrid_edu.occupancy.planar_motion import look_up  # for task 4
from semgrid_edu.stages.stepping import CheckedMemory
from semgrid_edu.workshop.course.street import street_results as _street_results

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
FREE, STATIC, DYNAMIC, UNKNOWN = range(4)

# %% [markdown]
# ## Task 1: several frames, each with its exponent (2 points)
#
# T frames say how probable each of C classes is: `p`, `(T, C)`. Each frame counts with its own exponent, `w`, `(T,)`. All classes are equally frequent before any
# frame. So the belief is proportional to $\prod_t p_{t,c}^{w_t}$.
#
# Complete `combine`: it returns this belief, `(C,)`, which sums to 1. A class that one frame calls impossible mustn't be ruled out by it for ever: take each
# probability that is below 0.0001 as 0.0001. Leave `p` and `w` unchanged.


# %% nbgrader={"grade": false, "grade_id": "combine", "locked": false, "schema_version": 3, "solution": true, "task": false}
def combine(p, w):
    """Return the belief over the classes that several frames give together, (C,)."""
    ### BEGIN SOLUTION
    score = np.asarray(w) @ np.log(np.maximum(p, 1e-4))
    belief = np.exp(score - score.max())
    return belief / belief.sum()
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "combine-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: 0.8 and 0.2 with exponent 1, then 0.5 and 0.5: the second frame says nothing.
    got = answer_array(combine(np.array([[0.8, 0.2], [0.5, 0.5]]), np.array([1.0, 0.5])), "combine")
    assert got.shape == (2,), f"expected one number per class, shape (2,), got {got.shape}"
    assert np.isclose(got.sum(), 1), f"the belief sums to {got.sum():.3f}: divide by the sum"
    assert np.allclose(got, [0.8, 0.2], atol=1e-3), (
        f"the second frame says nothing, so 0.8 and 0.2 stay; got {got.round(3)}"
    )
    # Odds of 4 with exponent 1 and of 4 with exponent 0.5: 4 * 2 = 8, so 8/9.
    got = answer_array(combine(np.array([[0.8, 0.2], [0.8, 0.2]]), np.array([1.0, 0.5])), "combine")
    slips = {
        16 / 17: "the exponents have no effect",
        0.8: "that is a mean: multiply the powers",
        0.5 * (0.8 + 2 / 3): "each frame is normalised by itself and then averaged: multiply",
    }
    for value, hint in slips.items():
        assert not np.isclose(got[0], value, atol=2e-3), f"got {got[0]:.3f}: {hint}"
    assert np.isclose(got[0], 8 / 9, atol=1e-3), f"odds of 4 and of 4 ** 0.5 = 2 are odds of 8, 0.889; got {got[0]:.3f}"
    sure = answer_array(combine(np.array([[1.0, 0.0], [0.1, 0.9], [0.1, 0.9]]), np.full(3, 1.0)), "combine")
    assert np.isfinite(sure).all(), "a probability of 0 gives NaN: take at least 0.0001"
    assert sure[1] > 1e-3, "a class that one frame calls impossible is ruled out for ever: take at least 0.0001"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import memory

    complaint = memory.check_combine(combine)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: how long errors last (2 points)
#
# `wrong` is `(N, T)`: for each of N places whether the network was wrong in each of T frames in a row, 1 or 0. Pair each frame with the next one, in all places
# together: that is N (T - 1) pairs. The correlation coefficient of these pairs is $r$. By the lecture's formula, T frames are then worth
# $1 + (T - 1)\,(1 - r) / (1 + r)$ independent ones. This holds if the correlation falls by the factor $r$ with each frame. If it falls more slowly, as on the lecture's drive, they
# are worth less.
#
# Complete `errors_last`: it returns $r$ and this worth. The correlation coefficient of x and y is their covariance divided by both standard deviations; here x are all
# earlier ones of the pairs and y all later ones.


# %% nbgrader={"grade": false, "grade_id": "errors-last", "locked": false, "schema_version": 3, "solution": true, "task": false}
def errors_last(wrong):
    """Return the correlation of neighbouring frames' errors, and how many independent frames all of them are worth."""
    ### BEGIN SOLUTION
    wrong = np.asarray(wrong, float)
    r = np.corrcoef(wrong[:, :-1].ravel(), wrong[:, 1:].ravel())[0, 1]
    return r, 1 + (wrong.shape[1] - 1) * (1 - r) / (1 + r)
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "errors-last-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Four places, three frames: eight pairs (1,1) (1,0) (0,0) (0,0) (0,1) (1,1) (0,0) (0,0). Both means are 3/8,
    # both variances 15/64, the covariance is 2/8 - 9/64 = 7/64: r = 7/15.
    wrong = np.array([[1, 1, 0], [0, 0, 0], [0, 1, 1], [0, 0, 0]])
    got = answer_array(errors_last(wrong), "errors_last")
    assert got.shape == (2,), f"return two numbers, r and the worth; got shape {got.shape}"
    r, worth = got
    slips = {
        2 / 3: "that is P(wrong again | wrong), not the correlation",
        5 / 12: "that is the share of wrong frames",
        2 / 8: "that is the mean of the products: subtract the product of the means, and divide by both deviations",
        7 / 64: "that is the covariance: divide by both standard deviations",
    }
    for value, hint in slips.items():
        assert not np.isclose(r, value, atol=1e-3), f"r = {r:.3f}: {hint}"
    places = np.corrcoef(wrong[:-1].ravel(), wrong[1:].ravel())[0, 1]
    assert not np.isclose(r, places, atol=1e-3), "you pair neighbouring places: pair each frame with the next one"
    assert np.isclose(r, 7 / 15, atol=1e-3), f"covariance 7/64 by variance 15/64 is r = 7/15 = 0.467, got {r:.3f}"
    expected = 1 + 2 * (1 - 7 / 15) / (1 + 7 / 15)
    assert not np.isclose(worth, 1 + 3 * (1 - 7 / 15) / (1 + 7 / 15), atol=1e-3), "T frames: T - 1 follow the first"
    assert not np.isclose(worth, expected / 3, atol=1e-3), "that is the exponent of each frame: don't divide by T"
    assert np.isclose(worth, expected, atol=1e-3), (
        f"r is right; by the formula three frames are worth {expected:.3f}, got {worth:.3f}"
    )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import memory

    complaint = memory.check_errors_last(errors_last)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: the laser corrects the memory (3 points)
#
# The lecture's ghosts are cells that the memory calls *car* though the car has left. The package lets the laser speak of cars, people and bicycles, and takes off half of P(UNKNOWN),
# too; here the laser speaks of all that stands, because a building can't be in a free cell either, and an UNKNOWN cell takes nothing off, because no beam has been there. `p` is what the memory says of C classes, `(C, H, W)`; it sums to
# 1 in each cell. `o` is the occupancy grid, `(4, H, W)`, in the order FREE, STATIC, DYNAMIC, UNKNOWN. `standing` lists the numbers of the classes that stand up, such as car
# and building. A standing thing can't be in a free cell, so its probability is multiplied by 1 - P(FREE); a class of the ground keeps its own. Then each cell is divided by
# its sum.
#
# Complete `listen`: it returns the corrected distribution, `(C, H, W)`. If nothing is left in a cell (all classes that the memory believes in stand, and the cell is surely
# FREE), memory and laser contradict each other: return `1 / C` for each class there. Leave `p` and `o` unchanged.


# %% nbgrader={"grade": false, "grade_id": "listen", "locked": false, "schema_version": 3, "solution": true, "task": false}
def listen(p, o, standing):
    """Return what the memory says once it has heard the laser, (C, H, W)."""
    ### BEGIN SOLUTION
    heard = np.array(p, float)
    heard[list(standing)] *= 1 - np.asarray(o, float)[FREE]
    total = heard.sum(axis=0)
    return np.where(total > 0, heard / np.where(total > 0, total, 1), 1 / len(heard))
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "listen-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    # One row of four cells; road, car, building. By hand, cell 0: car 0.8 * 0.1 = 0.08, road 0.2: P(car) = 0.08 / 0.28.
    p = np.array([[0.2, 0.2, 0.0, 0.7], [0.8, 0.8, 0.5, 0.2], [0.0, 0.0, 0.5, 0.1]]).reshape(3, 1, 4)
    o = np.array([[0.9, 0.1, 1.0, 0.5], [0.0, 0.6, 0.0, 0.1], [0.1, 0.0, 0.0, 0.1], [0.0, 0.3, 0.0, 0.3]]).reshape(
        4, 1, 4
    )
    kept = p.copy(), o.copy()
    got = answer_array(listen(p, o, [1, 2]), "listen")
    assert np.array_equal(p, kept[0]), "it changes `p`: make a new array"
    assert np.array_equal(o, kept[1]), "it changes `o`: make a new array"
    assert got.shape == p.shape, f"expected shape {p.shape}, got {got.shape}"
    assert np.isfinite(got).all(), "where nothing is left you divide by 0: return 1 / C for each class there"
    assert not np.allclose(got[:, 0, 0], [0.2, 0.08, 0]), "divide each cell by its sum"
    assert not np.isclose(got[1, 0, 0], 0.72 / 0.92, atol=1e-3), "you multiply by P(FREE): it is 1 - P(FREE)"
    assert not np.isclose(got[1, 0, 0], 0.8, atol=1e-3), "the laser has no effect on cell 0"
    occupied = 0.8 * 0.6 / (0.2 + 0.8 * 0.6)
    assert not np.isclose(got[1, 0, 1], occupied, atol=1e-3), "an UNKNOWN cell may hold a car: multiply by 1 - P(FREE)"
    assert np.isclose(got[1, 0, 0], 0.08 / 0.28, atol=1e-3), (
        f"cell 0: P(car) = 0.08 / 0.28 = 0.286, got {got[1, 0, 0]:.3f}"
    )
    assert np.allclose(got[:, 0, 2], 1 / 3, atol=1e-3), f"cell 2: nothing is left, so 1/3 each; got {got[:, 0, 2]}"
    assert np.allclose(got.sum(axis=0), 1, atol=1e-4), "each cell sums to 1"
    only_car = answer_array(listen(p, o, [1]), "listen")
    assert np.isclose(only_car[2, 0, 3], 0.1 / 0.9, atol=1e-3), "a class that isn't in `standing` keeps its own"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import memory

    complaint = memory.check_listen(listen)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: your memory, on the real street (3 points)
#
# Complete `remember(views, spec)`: a generator that takes a view, yields a semantic grid, and only then takes the next view. A view has `view.grid`, `(14, H, W)`, what the
# network made of this frame alone: ten semantic classes, then unknown-free, unknown-static, unknown-dynamic and unknown-unobserved. `view.belief.probability` is the
# occupancy grid, and `view.frame.T_world_from_lidar` the pose. What you yield has the shape of `view.grid` and sums to 1 in each cell.
#
# It must do two things. In cells that the camera sees now, at most half a point may be lost against one frame. In cells that it saw before and doesn't see now, at least 12
# points more must be right on this real street, where the vehicle stands, and 30 on a simulated one, where it drives (a small test of a vehicle that drives is below, too). A way that works: the part of a cell's probability that one frame gives to the unknown classes goes to
# what earlier frames said of this place, as far as they saw it. To look up an earlier map where the vehicle is now:
#
#     motion = PlanarMotion.from_poses(earlier.frame.T_world_from_lidar, view.frame.T_world_from_lidar)
#     look_up(earlier.grid, np.zeros(14, np.float32), spec, spec, motion)      # (14, H, W); 0 where the earlier map doesn't reach
#
# Look each earlier view up directly: a map that is looked up again and again is rounded to whole cells each time. The package's own memory is no answer. The tests call `maps`; leave it as it is.


# %% nbgrader={"grade": false, "grade_id": "remember", "locked": false, "schema_version": 3, "solution": true, "task": false}
def remember(views, spec):
    """Yield, for each view, the semantic grid with memory, (14, H, W)."""
    ### BEGIN SOLUTION
    past = []
    for view in views:
        past.append(view)
        total = np.zeros_like(view.grid[:10])
        for earlier in past:
            motion = PlanarMotion.from_poses(earlier.frame.T_world_from_lidar, view.frame.T_world_from_lidar)
            total += look_up(earlier.grid, np.zeros(14, np.float32), spec, spec, motion)[:10]
        now = view.grid[:10]
        classes = now + (1 - now.sum(axis=0)) * total / np.maximum(total.sum(axis=0), 1)
        yield np.concatenate([classes, view.belief.probability * (1 - classes.sum(axis=0))])
    ### END SOLUTION


def maps(frames, occupancy, grids, spec):
    """Return the most probable class of each cell after each frame, (T, H, W), with your memory as a stage."""
    stage = CheckedMemory("remember", remember, grids[0].shape, spec)
    nothing, called = np.full((2, 2, *spec.shape), np.nan, np.float32), []
    for frame, o, g in zip(frames, occupancy, grids, strict=True):
        view = View(frame, Belief(o, nothing[0], nothing), g)
        called.append(stage.step(view).argmax(axis=0))
    return np.array(called)


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "street", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _street():
    """Return what `maps` takes of the real street, the true classes, and which cells are in view and were seen before."""
    results, spec = _street_results(None, 10)
    bare = [_copy(_replace(one.frame, image=None, labels=None, points=one.frame.points[:0])) for one in results]
    given = bare, np.stack([one.belief.probability for one in results]), np.stack([one.grid for one in results]), spec
    truth = np.stack([one.frame.labels.birdseye_on(spec) for one in results])
    seen = np.stack([one.frame.labels.visible_on(spec) for one in results])
    before = np.logical_or.accumulate(seen) & ~seen  # the vehicle stands
    return given, truth, seen, before


def _package_maps(frames, occupancy, grids, spec):
    """Return what the package's own memory makes of the same."""
    nothing = np.full((2, 2, *spec.shape), np.nan, np.float32)
    views = [View(f, Belief(o, nothing[0], nothing), g) for f, o, g in zip(frames, occupancy, grids, strict=True)]
    return np.stack([grid.argmax(axis=0) for grid in _remember_drive(views, spec)])


def _right(called, truth, cells):
    """Return the share of labelled cells that are right, per cent."""
    cells = cells & (truth != 255)
    return 100 * (called == truth)[cells].mean()


# %% jupyter={"source_hidden": true} nbgrader={"grade": false, "grade_id": "drives", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _test_that_drives(frame, spec):
    """Check the place of a building, 20 m ahead in the first frame, after 3 m; the second frame sees nothing at all."""
    ahead = np.eye(4)
    ahead[0, 3] = 3
    frames = [frame, _replace(frame, T_world_from_lidar=frame.T_world_from_lidar @ ahead, time=frame.time + 0.1)]
    x, y = np.moveaxis(spec.centers(), -1, 0)
    o = np.zeros((2, 4, *spec.shape), np.float32)
    o[:, UNKNOWN] = 1
    grids = np.zeros((2, 14, *spec.shape), np.float32)
    there = (abs(x - 20) < 2) & (abs(y) < 2)
    grids[0, 0], grids[0, 6], grids[0, 13] = 0.9 * ~there, 0.9 * there, 0.1
    grids[1, 13] = 1
    later = answer_array(maps(_copy(frames), o.copy(), grids.copy(), spec), "maps").astype(int)[1]
    nearer, where_it_was = (abs(x - 17) < 0.8) & (abs(y) < 0.8), (abs(x - 21) < 0.8) & (abs(y) < 0.8)
    hint = "look each earlier map up where the vehicle is now"
    assert (later[where_it_was] != 6).all(), f"the vehicle drove 3 m, and a building hasn't come 3 m nearer: {hint}"
    assert (later[nearer] == 6).all(), f"the vehicle drove 3 m; a building that was 20 m ahead isn't 17 m ahead: {hint}"


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "remember-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    given, truth, seen, before = _street()
    got = answer_array(maps(*_copy(given)), "maps").astype(int)
    assert got.shape == truth.shape, f"expected one map for each of {len(truth)} frames, {truth.shape}; got {got.shape}"
    one = given[2].argmax(axis=1)
    assert (got != one).any(), "nothing is remembered: every map is that of one frame"
    assert (got != _package_maps(*given)).any(), "that is the package's own memory: write yours"
    was, now = _right(one, truth, seen), _right(got, truth, seen)
    hint = "where the camera sees a cell, let the newest frame decide"
    assert now > was - 0.5, f"in view {now:.1f} % are right, and {was:.1f} % with one frame: {hint}"
    print(f"in view: one frame {was:.1f} %, yours {now:.1f} %")
    was, now = _right(one, truth, before), _right(got, truth, before)
    hint = "does the unknown part of a cell go to what earlier frames said of it?"
    assert now > was + 12, f"seen before {now:.1f} % are right, and {was:.1f} % with one frame: {hint}"
    print(f"seen before: one frame {was:.1f} %, yours {now:.1f} %")
    _test_that_drives(given[0][0], given[3])
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import memory

    complaint = memory.check_remember(maps)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# To see it on the demo's page, save `remember` and its imports as `my_stages.py`, and run `semgrid-edu demo --stages my_stages.py`: your map stands beside the package's.
#
# ## Task 5: in your own words (2 points)
#
# A colleague's memory multiplies the class probabilities of all frames, with exponent 1. On a parking lot, where the vehicle stands for a minute, its map gets surer from frame
# to frame, and a hedge that the network takes for a building becomes a building with 99.99 %. What is wrong with the colleague's model, and what do you change? And name one
# situation in which *your* memory of task 4 makes the map worse than one frame, and what you would measure to notice. Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "parking-lot", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The product takes frames as independent given the content of a cell. They share the network's error: what makes it take this hedge for a building is still there at the next
# frame, so 600 frames of one view are worth little more than one. I would give each further frame an exponent below 1, measured from how frequently errors repeat, or limit what
# all frames together may be worth. My memory keeps what earlier frames said where the camera doesn't look: a car that stood there and drove away out of view stays as a ghost. I
# would score cells seen before by themselves, by class and by the time since they were seen, and compare with the occupancy grid: cells that are FREE and remembered as car.
# One point for the shared errors with an exponent, a limit or softened frames, one for a situation with a fitting measurement.

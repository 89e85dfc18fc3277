# %% [markdown]
# # Exercise 05: from grid to pixel
#
# Five tasks with small functions around equation (1), and one question to answer in words. About 100 minutes.
# The lecture is [05: from grid to pixel](../05_pixels.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | what was done to an image, from its two calibrations | 1 + 2 |
# | 2 | what was scanned before, seen by the camera of now | 3 |
# | 3 | what the pixel of a cell shows | 3 + 2 |
# | 4 | how high something is, from where a plane draws it | 2 + 1 |
# | 5 | a calibration with a fault | 2 + 2 |
# | 6 | a car that brakes, in your own words | 2 |
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
# ## Task 1: what was done to an image (1 + 2 points)
#
# Somebody gives you two intrinsic matrices: `K` of the camera's image, and `K_new` of the image that a network gets. In between `left` columns and `top` rows
# were cut off, and then what was left was resized: every length across was multiplied by `scale_u`, every length down by `scale_v`. The centre of the first
# pixel is (0, 0), before and after. A negative `left` or `top` means that a border was added instead.
#
# Complete `what_was_done`: it returns the four numbers `left, top, scale_u, scale_v`, and leaves both matrices as they are. The scales are worth one point,
# the cut two. Write down what a cut and a resize make of K, in this order, and solve.


# %% nbgrader={"grade": false, "grade_id": "what-was-done", "locked": false, "schema_version": 3, "solution": true, "task": false}
def what_was_done(K, K_new):
    """Return left, top, scale_u and scale_v: the image was cropped, then resized."""
    ### BEGIN SOLUTION
    scale = np.diag(K_new)[:2] / np.diag(K)[:2]
    left, top = K[:2, 2] + 0.5 - (K_new[:2, 2] + 0.5) / scale
    return left, top, *scale
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "scales-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    K = np.array([[100.0, 0, 40], [0, 120, 30], [0, 0, 1]])
    K_new = np.array([[50.0, 0, 15.75], [0, 30, 5.625], [0, 0, 1]])
    before = K.copy(), K_new.copy()
    got = answer_array(what_was_done(K, K_new), "what_was_done").ravel()
    kept = np.array_equal(K, before[0]) and np.array_equal(K_new, before[1])
    assert kept, "what_was_done changed an argument: work on copies"
    assert got.shape == (4,), f"return four numbers, left, top, scale_u, scale_v; got {got}"
    slips = {
        2.0: "turned round: the new focal length is the old one times the scale",
        0.25: "the scales are swapped: scale_u belongs to the first row of K",
        1.0: "the focal length tells the scale: f_u was 100 and is 50",
        0.39375: "the principal point was cut as well: only the focal lengths tell the scale",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got[2], slip), f"scale_u = {got[2]:g}: {hint}"
    np.testing.assert_allclose(got[2:], [0.5, 0.25], atol=1e-6, err_msg="f_u from 100 to 50, f_v from 120 to 30")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_scales(what_was_done)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "cut-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand, backwards: c_u = 15.75 is 16.25 from the image's edge, 32.5 before it was halved, 32 from the first centre; it was 40.
    K = np.array([[100.0, 0, 40], [0, 120, 30], [0, 0, 1]])
    K_new = np.array([[50.0, 0, 15.75], [0, 30, 5.625], [0, 0, 1]])
    got = answer_array(what_was_done(K, K_new), "what_was_done").ravel()
    assert got.shape == (4,), f"return four numbers, left, top, scale_u, scale_v; got {got}"
    slips = {
        8.5: "you lost half a pixel on the way: count from the image's edge, divide by the scale, go back to the centre",
        9.0: "the half has the wrong sign: the edge lies half a pixel BEFORE the first centre",
        4.25: "that is counted in the new, larger pixels, and half a pixel got lost: the cut came first, in the old ones",
        4.0: "you undo the cut first: it came first, so it is undone last, and it counts old pixels",
        24.25: "the resize was not undone",
        -8.0: "the sign is turned: what is cut off on the left makes c_u smaller",
        6.0: "left and top are swapped: `left` moves u, the first row of K",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got[0], slip), f"left = {got[0]:g}: {hint}"
    np.testing.assert_allclose(got[:2], [8, 6], atol=1e-6, err_msg="by hand: 40 - 32 = 8 columns and 30 - 24 = 6 rows")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_cut(what_was_done)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: what was scanned before, seen by the camera of now (3 points)
#
# A car drives. `T_world_from_before` and `T_world_from_now`, 4 x 4, say where its LIDAR was and where it is now: each takes points of that LIDAR frame to
# the world. `T_camera_from_lidar` is part of the calibration, the same at all times. The LIDAR has scanned some points *before*, and you have an image of
# *now*.
#
# Complete `camera_from_before`: it returns the 4 x 4 matrix that takes points of the old LIDAR frame to the frame of the camera of now.


# %% nbgrader={"grade": false, "grade_id": "camera-from-before", "locked": false, "schema_version": 3, "solution": true, "task": false}
def camera_from_before(T_camera_from_lidar, T_world_from_now, T_world_from_before):
    """Return the matrix from the LIDAR's frame before to the camera's frame now, (4, 4)."""
    ### BEGIN SOLUTION
    turn, shift = T_world_from_now[:3, :3], T_world_from_now[:3, 3]
    T_now_from_world = np.eye(4)
    T_now_from_world[:3, :3] = turn.T
    T_now_from_world[:3, 3] = -turn.T @ shift
    return T_camera_from_lidar @ T_now_from_world @ T_world_from_before
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "camera-from-before-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Before, the car stands at (10, 2) and looks along the world's x. Now it stands at (12, 5) and looks along the world's y.
    # So its old place is 3 m behind it and, since left of it is the world's -x, 2 m to its left: x = -3, y = 2.
    T_camera_from_lidar = np.array([[0.0, -1, 0, 0], [0, 0, -1, -0.5], [1, 0, 0, 0], [0, 0, 0, 1]])
    T_world_from_before = np.array([[1.0, 0, 0, 10], [0, 1, 0, 2], [0, 0, 1, 0], [0, 0, 0, 1]])
    T_world_from_now = np.array([[0.0, -1, 0, 12], [1, 0, 0, 5], [0, 0, 1, 0], [0, 0, 0, 1]])
    given = T_camera_from_lidar, T_world_from_now, T_world_from_before
    got = answer_array(camera_from_before(*(T.copy() for T in given)), "camera_from_before")
    assert got.shape == (4, 4), f"expected a 4 x 4 matrix, got shape {got.shape}"
    assert np.allclose(got[3], [0, 0, 0, 1]), "the last row isn't 0, 0, 0, 1: only the rotation may be transposed"
    slips = {
        (-3, 2, 0): "that is the place in the LIDAR's frame of now: the camera is still to come",
        (-3, -0.5, 2): "that is the way from NOW to before: the other pose must be turned round",
        (-15, -0.5, 10): "no pose was turned round: in 'world from now' 'world from before' no neighbours cancel",
        (15, -0.5, -10): "the shift of the inverse isn't just minus the shift: it must be turned as well",
        (-14, -0.5, 5): "the order is wrong: with the two poses swapped, no neighbours cancel",
        (22, -0.5, 7): "the sign of the shift is missing: the inverse undoes it",
        (-3.5, 2, 0): "the order is wrong: the camera's matrix acts last, so it stands on the left",
        (3, -0.5, -2): "that is the way in the world's axes: turn it into those of the car",
    }
    there = got[:3, 3]
    for slip, hint in slips.items():
        assert not np.allclose(there, slip), f"the LIDAR's old place, seen by the camera: {there.round(3)}: {hint}"
    by_hand = "the LIDAR's old place, seen by the camera: which neighbours cancel in your product?"
    np.testing.assert_allclose(there, (-2, -0.5, -3), err_msg=by_hand, atol=1e-9)
    np.testing.assert_allclose(got @ [1, 0, 0, 1], [-1, -0.5, -3, 1], err_msg="1 m before the old place", atol=1e-9)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_camera_from_before(camera_from_before)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: what does the pixel of a cell show? (3 + 2 points)
#
# Equation (1) gives a cell its pixel, whatever that pixel shows. In the lecture the pixels of some road cells showed something nearer, of others something
# farther. Now find out what.
#
# A level camera is `z_cam` metres above the ground and looks along a row of cells, the nearest first. Cell j is `x[j]` metres ahead of the camera, and what
# fills it reaches up to `top[j]` metres: 1.4 for a car, 0 for bare road, -0.3 for the road in a dip. Think of each cell as a thin wall at its distance, from far
# below up to `top[j]`. A plane at `delta` gives cell j the pixel that looks at the height `delta` there, `x[j]` metres ahead.
#
# Complete `shown`: it returns for each cell j the number of the **first** wall that the ray of its pixel meets, `(N,)`. That is j itself when the cell is seen in
# place, a smaller number when something nearer hides it, a larger one when the ray flies over the cell and meets something behind it. When the ray meets no wall at
# all, return N, the number of cells. A ray that passes at most a millimetre above a wall's top counts as meeting it: on a plane at a wall's own height it ends
# exactly at its top, and computers round. `x` and `top` are `(N,)`.
#
# Complete `best_plane`, for two more points: of several planes at `heights`, `(D,)`, it returns the number of the one on which most cells are seen in place; the
# first of them if there are several.


# %% nbgrader={"grade": false, "grade_id": "shown", "locked": false, "schema_version": 3, "solution": true, "task": false}
def shown(x, top, z_cam, delta):
    """Return the number of the first wall that each cell's ray meets, (N,); N where it meets none."""
    ### BEGIN SOLUTION
    ray = z_cam + (delta - z_cam) * x / np.reshape(x, (-1, 1))  # (cell that is looked for, wall)
    meets = np.asarray(top) + 0.001 >= ray
    return np.where(meets.any(axis=1), meets.argmax(axis=1), len(x))
    ### END SOLUTION


def best_plane(x, top, z_cam, heights):
    """Return the number of the plane on which most cells are seen in place."""
    ### BEGIN SOLUTION
    in_place = [np.sum(shown(x, top, z_cam, delta) == np.arange(len(x))) for delta in heights]
    return int(np.argmax(in_place))
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "rows-of-cells", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _row():
    """Return a row of five cells, 5 to 40 m ahead: road, something 0.9 m high, road, a dip, road."""
    return np.array([5.0, 10.0, 20.0, 30.0, 40.0]), np.array([0.05, 0.9, 0.05, -0.5, 0.05])


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "shown-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    x, top = _row()
    got = answer_array(shown(x, top, z_cam=1.5, delta=0.0), "shown")
    kept = np.array_equal(x, _row()[0]) and np.array_equal(top, _row()[1])
    assert kept, "shown changed an argument: work on copies"
    assert got.shape == (5,), f"five cells, five numbers; got the shape {got.shape}"
    slips = {
        (0, 1, 2, 3, 4): "that is equation (1) alone: what stands in front hides a cell, and a ray can fly over a dip",
        (0, 1, 1, 3, 4): "nothing flies over in your answer: 30 m ahead the ray is at 0 m and the dip reaches -0.5 m",
        (0, 0, 0, 0, 0): "you compare the walls with the plane: compare with the ray, which comes down from the camera",
        (4, 4, 4, 4, 4): "that is the last wall that the ray meets: the first one is what the pixel shows",
        (0, 1, 1, 0, 1): "a higher wall in front doesn't hide all behind it: the camera stands high and looks over it",
        (0, 1, 2, 4, 4): "nothing is hidden in your answer: the ray to 20 m is 0.75 m up where something is 0.9 m high",
        (1, 2, 2, 5, 5): "count the cells from 0",
    }
    for slip, hint in slips.items():
        assert not np.array_equal(got, slip), f"got {got}: {hint}"
    by_hand = "by hand: the ray to 20 m ends at 10 m; those to 30 and 40 m pass over it, 1 and 1.125 m up"
    np.testing.assert_array_equal(got, [0, 1, 1, 4, 4], err_msg=by_hand)
    for level in (0.0, 0.05, 0.1, 0.3):
        flat = answer_array(shown(x, np.full(5, level), 1.5, level), "shown")
        tie = f"a level road at {level:g} m, on a plane at {level:g} m: each ray ends at its own wall's top; allow a millimetre"
        np.testing.assert_array_equal(flat, [0, 1, 2, 3, 4], err_msg=tie)
    higher = answer_array(shown(x, top, 1.5, 1.0), "shown")
    nothing = "a plane at 1 m: from 20 m on the rays meet no wall, and the number is N = 5"
    np.testing.assert_array_equal(higher, [1, 4, 5, 5, 5], err_msg=nothing)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_shown(shown)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "best-plane-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    heights = np.array([-0.8, -0.4, 0.0, 0.4])
    falling = np.array([10.0, 20.0, 40.0]), np.array([0.05, -0.35, -0.75])
    standing = np.array([5.0, 10.0, 20.0]), np.array([0.6, 0.05, 0.05])
    got = [answer_array(best_plane(*row, 1.5, heights), "best_plane").ravel() for row in (falling, standing)]
    assert all(one.size == 1 for one in got), f"return one number, got {got}"
    downhill, level = (float(one[0]) for one in got)
    assert downhill != -0.8, "return the number of the plane, not its height"
    assert downhill == 0, (
        f"a road that falls: you choose plane {downhill:g}. On plane 0 all three cells are in place, on 1 two, on 2 one"
    )
    blocked = "on a low plane the thing at 5 m hides the cell at 10 m, so a cell must be seen IN PLACE to count"
    assert level == 2, (
        f"something 0.6 m high, then road: you choose plane {level:g}. On plane 2 all are in place; {blocked}"
    )
    two = answer_array(best_plane(*standing, 1.5, np.array([0.4, 0.0, 0.01])), "best_plane").ravel()[0]
    assert two == 1, f"plane 0 shows one cell in place, 1 and 2 all three: return 1, the first of these, not {two:g}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_best_plane(best_plane)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: how high is it? (2 + 1 points)
#
# In the lecture the ground plane drew the sidewalk too far away, because the sidewalk is higher than the plane. Turn this round: how far a thing is off on the map tells
# how high it is. A level camera is `z_cam` metres above the ground. Things stand `x` metres ahead of it, `(N,)`: the LIDAR has measured that. The plane at the height `delta` (below the ground where it
# is negative) draws them `x_drawn` metres ahead of the camera, `(N,)`.
#
# Complete `heights_of`: it returns the height of each thing's visible point above the ground, `(N,)`. For one more point: where nothing is drawn (`x_drawn`
# is NaN), or where it would be drawn at the camera or behind it (`x_drawn` is 0 or less), no height is possible: return NaN there, and the right heights
# everywhere else.


# %% nbgrader={"grade": false, "grade_id": "heights-of", "locked": false, "schema_version": 3, "solution": true, "task": false}
def heights_of(x, x_drawn, z_cam, delta):
    """Return the heights, (N,), of what is x metres ahead and drawn x_drawn metres ahead on the plane at delta."""
    ### BEGIN SOLUTION
    share = np.asarray(x) / np.where(np.asarray(x_drawn) > 0, x_drawn, np.nan)
    return z_cam - (z_cam - delta) * share
    ### END SOLUTION


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "heights-of-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # The ray meets the plane at 0.2 m, 1.4 m below the camera, 25 m ahead: so 10 m ahead it has sunk by 0.56 m, to 1.04 m.
    x, x_drawn = np.array([10.0, 10.0, 10.0]), np.array([25.0, 10.0, 8.0])
    got = answer_array(heights_of(x, x_drawn, z_cam=1.6, delta=0.2), "heights_of")
    assert got.shape == (3,), f"three things, three heights; got the shape {got.shape}"
    slips = {
        -1.9: "the ratio is turned round: the ray has sunk less at the thing, which is nearer, than at the plane",
        0.96: "that is the ground plane: the ray sinks by z_cam - delta until it meets this one",
        0.56: "that is how far the ray has sunk: measure from the ground, not from the camera",
        0.88: "that is a plane 0.2 m BELOW the ground: `delta` has a sign",
        0.84: "that is the height above the plane: measure from the ground",
        0.76: "the triangle begins at the camera, not at the plane",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got[0], slip), f"got {got[0]:.3g} m for the first: {hint}"
    by_hand = "by hand: 1.04 m; in place on its own plane: 0.2 m; drawn too near: it is lower, -0.15 m"
    np.testing.assert_allclose(got, [1.04, 0.2, -0.15], atol=1e-6, err_msg=by_hand)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_heights_of(heights_of)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "impossible-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    x, x_drawn = np.array([10.0, 12.0, 9.0, 10.0]), np.array([25.0, np.nan, -30.0, 0.0])
    got = answer_array(heights_of(x, x_drawn, 1.6, 0.2), "heights_of")
    assert got.shape == (4,), f"four things, four heights; got the shape {got.shape}"
    assert np.isnan(got[1]), f"the second is drawn nowhere (NaN), yet you say {got[1]:g} m"
    behind = "no plane draws anything behind the camera"
    assert np.isnan(got[2]), f"the third would be drawn 30 m behind the camera, yet you say {got[2]:g} m: {behind}"
    assert np.isnan(got[3]), f"the fourth would be drawn at the camera itself, yet you say {got[3]:g} m"
    assert not np.isnan(got[0]), "the first has a height: only where nothing can be drawn is there none"
    alone = answer_array(heights_of(x[:1], x_drawn[:1], 1.6, 0.2), "heights_of")
    np.testing.assert_allclose(got[:1], alone, err_msg="the first has another height beside the others than alone")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_impossible(heights_of)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: a calibration with a fault (2 + 2 points)
#
# A calibration `K`, `T_camera_from_lidar` has exactly one fault. Somebody has clicked on the pixels where some LIDAR returns are really seen: `points`,
# `(N, 3)`, in the LIDAR frame, and `pixels`, `(N, 2)`. The fault is one of four, and each has a number:
#
# | fault | what is true | amount |
# |---|---|---|
# | `SHIFT` | the principal point is (c_u - amount, c_v - amount) | pixels, -2 to 2 |
# | `PITCH` | the transform is `turned(T_camera_from_lidar, "x", amount)` | degrees, -2 to 2 |
# | `YAW` | the transform is `turned(T_camera_from_lidar, "y", amount)` | degrees, -2 to 2 |
# | `INVERSE` | the transform is the inverse of `T_camera_from_lidar` | 0 |
#
# Complete `find_fault`: it returns two numbers, the fault and its amount. The fault is worth two points, the amount two. The amount is a multiple of 0.01.
# Find exactly this multiple where the clicks are exact. Where they are a tenth of a pixel wrong, be right to 0.05.
#
# A yaw and a shift move nearly all pixels by the same amount. What tells them apart? `project_points` and `turned` below are yours to use.


# %% nbgrader={"grade": false, "grade_id": "fault-tools", "locked": true, "schema_version": 3, "solution": false, "task": false}
SHIFT, PITCH, YAW, INVERSE = range(4)


def project_points(points, K, T_camera_from_lidar):
    """Return the pixels, (N, 2), of points in the LIDAR frame, (N, 3): equation (1)."""
    triples = (points @ T_camera_from_lidar[:3, :3].T + T_camera_from_lidar[:3, 3]) @ K.T
    return triples[:, :2] / triples[:, 2:]


def turned(T_camera_from_lidar, axis, degrees):
    """Return the transform of a camera that was turned about its own axis "x" (nods) or "y" (to the side)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]] if axis == "x" else [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    return turn @ T_camera_from_lidar


# %% nbgrader={"grade": false, "grade_id": "find-fault", "locked": false, "schema_version": 3, "solution": true, "task": false}
def find_fault(points, pixels, K, T_camera_from_lidar):
    """Return the fault (SHIFT, PITCH, YAW or INVERSE) and its amount."""
    ### BEGIN SOLUTION
    T = T_camera_from_lidar
    mended = {
        SHIFT: lambda amount: (K - amount * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]]), T),
        PITCH: lambda amount: (K, turned(T, "x", amount)),
        YAW: lambda amount: (K, turned(T, "y", amount)),
        INVERSE: lambda amount: (K, np.linalg.inv(T)),
    }

    def best(fault, amounts):
        """Return the smallest error, and the amount that leaves it."""
        return min((np.abs(project_points(points, *mended[fault](a)) - pixels).mean(), a) for a in amounts)

    found = {INVERSE: best(INVERSE, [0.0])}
    for fault in (SHIFT, PITCH, YAW):
        _, roughly = best(fault, np.arange(-20, 21) / 10)
        found[fault] = best(fault, (np.arange(-10, 11) + round(100 * roughly)) / 100)
    fault = min(found, key=found.get)
    return fault, found[fault][1]
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "fault-cases", "locked": true, "schema_version": 3, "solution": false, "task": false} jupyter={"source_hidden": true}
def _faulty():
    """Return five cases: points, pixels, K and T, which has one fault each, and what is wrong; the last with noise."""
    K = np.array([[100.0, 0, 50], [0, 120, 20], [0, 0, 1]])
    T = np.array([[0.0, -1, 0, 0.1], [0, 0, -1, -0.1], [1, 0, 0, -0.2], [0, 0, 0, 1]])
    x, y = (a.ravel() for a in np.meshgrid([6.0, 9, 14, 20], [-0.4, -0.1, 0.2, 0.45]))
    points = np.stack([x, x * y, np.linspace(-1.6, 1, 16)], axis=1)
    off = np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    truths = ((K - off, T), (K, turned(T, "x", 0.5)), (K, turned(T, "y", -1.0)), (K, T))
    given = [(points, project_points(points, *truth), K, T) for truth in truths[:3]]
    given.append((points, project_points(points, *truths[3]), K, np.linalg.inv(T)))
    clicks = np.random.default_rng(5).normal(0, 0.1, (16, 2))
    given.append((points, project_points(points, *truths[2]) + clicks, K, T))
    return given, ((SHIFT, 0.5), (PITCH, 0.5), (YAW, -1.0), (INVERSE, 0.0), (YAW, -1.0))


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "fault-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    names = ("SHIFT", "PITCH", "YAW", "INVERSE")
    for given, (fault, _) in zip(*_faulty(), strict=True):
        kept = tuple(a.copy() for a in given)
        got = answer_array(find_fault(*given), "find_fault").ravel()
        assert all(map(np.array_equal, kept, given)), "find_fault changed an argument: work on copies"
        assert got.shape == (2,), f"return two numbers, the fault and its amount; got {got}"
        found = names[int(got[0])] if got[0] in range(4) else f"{got[0]:g}, which is none of the four"
        hint = "how large is the error that is left, if you repair each of the four as well as possible?"
        assert got[0] == fault, f"the fault is {names[fault]}, and you find {found}: {hint}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_fault(find_fault)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% jupyter={"source_hidden": true} nbgrader={"grade": true, "grade_id": "amount-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    for number, (given, (fault, amount)) in enumerate(zip(*_faulty(), strict=True)):
        allowed = 0.001 if number < 4 else 0.05
        got = answer_array(find_fault(*(a.copy() for a in given)), "find_fault").ravel()
        assert got.shape == (2,), f"return two numbers, the fault and its amount; got {got}"
        assert amount == 0 or not np.isclose(got[1], -amount, rtol=0.1), (
            f"fault {fault}, amount {got[1]:g}: the sign is turned. The table says what is TRUE, and the calibration is wrong"
        )
        radians = amount != 0 and fault != SHIFT and np.isclose(got[1], np.radians(amount), rtol=0.1)
        assert not radians, f"fault {fault}, amount {got[1]:g}: the amount is asked for in degrees"
        assert np.isclose(got[1], amount, rtol=0, atol=allowed), (
            f"fault {fault}: the amount is {amount:g}, and you find {got[1]:.3f}; it must be right to {allowed:g}"
        )
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_amount(find_fault)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: a car that brakes, in your own words (2 points)
#
# The car brakes, and its nose goes down by a degree. The map isn't told.
#
# 1. In which direction do the labels of the road move on the ground plane's map, and where is it worst?
# 2. At which height would a plane have to be, so that the ground 30 m ahead is drawn in its place? And 10 m ahead? What do you answer to a colleague who
#    proposes forty planes instead of twenty?
# 3. Would you see the fault in the LIDAR's returns, drawn into the image?
#
# Six sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "braking", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# With the nose down everything in the image moves up. The row in which the cell at 30 m is looked up now shows road that is nearer, so nearer road is drawn at 30 m: labels move away
# from the car. 1/x_read = 1/x + tan(psi) / z_cam: it is worst far ahead, where the error grows nearly like the square of the distance, and small nearby.
#
# The ground at x is f tan(psi) rows higher than expected. A plane at delta is f delta / x rows higher than the ground. So delta = x tan(psi): 0.52 m for 30 m, 0.17 m for 10 m. Each
# plane repairs the nod at one distance only, so more planes don't repair it, unless a network chooses another one for each distance. (With the nose up they would have to be below the ground.) The angle itself must be measured, by an inertial sensor or by the LIDAR's ground.
#
# No: LIDAR and camera turn together, so *camera from lidar* stays right and the returns still fit. *LIDAR from grid* is wrong. One point for 1 and 3, one for the two heights and what follows.

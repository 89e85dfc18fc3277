# %% [markdown]
# # Exercise 13: a real drive
#
# Four checks of new data, a search for the fault in damaged copies of the sample drive, and one question to answer in words. About 90 minutes.
# The lecture is [13: a real drive](../13_real_drive.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | where frames are missing | 2 |
# | 2 | the share of the returns that fall on the image | 2 |
# | 3 | the ground below the LIDAR | 2 + 1 |
# | 4 | one scan laid over another | 3 |
# | 5 | find the fault | 3 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers and other frames. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
# Names that begin with _ belong to the tests.
import warnings

import numpy as np

from semgrid_edu.answers import answer_array
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.workshop.studies.new_drive.drive_checks import edge_contrast, ground_plane, time_gaps  # for task 5
from semgrid_edu.workshop.studies.new_drive.drive_checks import motion_between, overlay_error
from semgrid_edu.workshop.studies.new_drive.faults import FAULTS

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does

# %% [markdown]
# ## Task 1: where frames are missing (2 points)
#
# `times` holds the time of each frame, in seconds. A step from one frame to the next is a gap when it is longer than 1.5 times the **median** step.
#
# Complete `find_gaps`: it returns a list of the numbers k, counted from 0, for which the step from frame k to frame k + 1 is a gap.


# %% nbgrader={"grade": false, "grade_id": "find-gaps", "locked": false, "schema_version": 3, "solution": true, "task": false}
def find_gaps(times):
    """Return k for each gap between frame k and frame k + 1."""
    ### BEGIN SOLUTION
    steps = np.diff(times)
    return np.flatnonzero(steps > 1.5 * np.median(steps)).tolist()
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "find-gaps-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # The steps are 0.1, 0.1, 0.2, 0.1, 0.1, 0.5 and 0.1 s, their median is 0.1 s: two are gaps.
    found = find_gaps([0.0, 0.1, 0.2, 0.4, 0.5, 0.6, 1.1, 1.2])
    got = answer_array(found, "find_gaps").ravel().round(6).tolist()
    assert np.asarray(found).dtype != bool, "return the numbers k, not one True or False for each step"
    slips = {
        (3, 6): "you name the frame after the gap: k is the frame before it",
        (5,): "only the longest is found: compare with the median, since long gaps pull up the mean",
        (0, 1, 3, 4, 6): "these are the steps that are no gaps: the comparison is the wrong way round",
        (0.2, 0.5): "you return steps: return their numbers k",
        (0.2, 0.6): "you return times: return the numbers k",
        (): "no gap is found",
    }
    assert tuple(got) not in slips, f"got {found}: {slips[tuple(got)]}"
    assert got == [2, 5], f"expected gaps after frames 2 and 5, got {found}"
    none = answer_array(find_gaps([0.0, 0.1, 0.2, 0.3]), "find_gaps")
    assert none.size == 0, "found a gap where all steps are equal"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import real_drive

    complaint = real_drive.check_find_gaps(find_gaps)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: the share of the returns that fall on the image (2 points)
#
# `points` are returns in the LIDAR frame, `(N, 3)`: x ahead, y to the left, z up, in metres. `T` is T_camera_from_lidar, `(4, 4)`. `K` is the camera's matrix,
# `(3, 3)`, and `size` the height and the width of its image in pixels. Equation (1) of lecture 05 says that a point (X, Y, Z) of the camera frame is seen at
# $(u, v, 1)^T = K\,(X/Z, Y/Z, 1)^T$ if $Z > 0$. It falls on the image when $0 \le u \le w - 1$ and $0 \le v \le h - 1$.
#
# Complete `share_on_image`: of the returns **ahead of the vehicle** (x > 0), which share falls on the image? Each T here is such that a return can be ahead of
# the LIDAR and yet behind the camera, which stands elsewhere: such a return isn't seen.


# %% nbgrader={"grade": false, "grade_id": "share-on-image", "locked": false, "schema_version": 3, "solution": true, "task": false}
def share_on_image(points, T, K, size):
    """Return the share of the returns with x > 0 that fall on the image, 0..1."""
    ### BEGIN SOLUTION
    ahead = points[points[:, 0] > 0]
    X, Y, Z = T[:3, :3] @ ahead.T + T[:3, 3:]
    Z = np.where(Z > 0, Z, np.nan)
    u, v, _ = K @ np.array([X / Z, Y / Z, np.ones_like(Z)])
    return np.mean((u >= 0) & (u <= size[1] - 1) & (v >= 0) & (v <= size[0] - 1))
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "share-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
_SHARE_SLIPS = {
    4 / 13: "you divide by the number of all returns: only those with x > 0 count",
    8 / 13: "returns behind the camera are counted as seen, and you divide by all returns: check Z > 0",
    5 / 10: "a return behind the camera is counted as seen: check Z > 0; or the upper limits are missing",
    8 / 10: "the lower limits are missing: u and v can be negative",
    4 / 9: "the return between LIDAR and camera is left out: it is ahead of the vehicle, so it counts as not seen",
    2 / 10: "height and width are swapped: size is (height, width)",
    7 / 10: "v is never checked against its limits",
    6 / 10: "u is never checked against its limits",
    0.0: "nothing falls on the image: did you divide by Z, and use T the right way round?",
    4.0: "you return the number: divide by the number of returns ahead",
}


# %% nbgrader={"grade": true, "grade_id": "share-on-image-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # The camera stands 1 m ahead of the LIDAR; it sees (11, y, z) at u = 50 - 10 y, v = 20 - 10 z.
    T = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, -1], [0, 0, 0, 1]])
    K = np.array([[100.0, 0, 50], [0, 100, 20], [0, 0, 1]])
    on_it = [[11, 0, 0], [11, 4, 0], [11, 0, 1.5], [21, 4, 1]]
    beside = [[11, -6, 0], [11, 7, 0], [11, 3, 2.5], [11, 2, 3], [11, 1, 4]]  # u = 110, u = -20, and thrice v < 0
    between, behind = [[0.5, 0, 0]], [[-10, 0, 0], [-10, 2, 0], [-20, 0, 1]]  # of LIDAR and camera; of both
    points = np.array(on_it + beside + between + behind, float)
    got = answer_array(share_on_image(points, T, K, (41, 101)), "share_on_image")
    assert got.size == 1, f"return one number, the share; got an array of shape {got.shape}"
    got = got.item()
    close = [hint for value, hint in _SHARE_SLIPS.items() if np.isclose(got, value, atol=1e-3)]
    assert not close, f"got {got:.3f}: {close[0]}"
    assert np.isclose(got, 4 / 10), f"expected 4 of 10 returns ahead, 0.4, got {got:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import real_drive

    complaint = real_drive.check_share_on_image(share_on_image)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: the ground below the LIDAR (2 + 1 points)
#
# `points` are returns from the road, in the LIDAR frame, `(N, 3)`. Fit the plane $z = -h + p\,x + r\,y$ by least squares.
#
# Complete `ground`: it returns the **height** $h$ of the LIDAR above the plane in metres, and the **rise ahead** of the plane in degrees, $\arctan p$.
#
# For one more point: up to a fifth of the returns come from cars, which stand *on* the road (never below). The height has to be right within 2 cm and the rise
# within 0.2 degrees all the same. Throwing out once what lies more than 10 cm off isn't enough, because with so many cars the first plane itself is farther off. The
# lecture's `ground_plane` throws out what lies off by more than 10 cm **and** by more than the median error, fits again, and repeats this ten times.


# %% nbgrader={"grade": false, "grade_id": "ground", "locked": false, "schema_version": 3, "solution": true, "task": false}
def ground(points):
    """Return the height of the LIDAR above the ground (m), and how much the ground rises ahead (degrees)."""
    ### BEGIN SOLUTION
    x, y, z = np.asarray(points, float).T
    A, use = np.column_stack([np.ones_like(x), x, y]), np.ones(len(x), bool)
    for _ in range(20):
        plane = np.linalg.lstsq(A[use], z[use], rcond=None)[0]
        error = np.abs(z - A @ plane)
        use = error <= max(0.05, np.median(error))
    return -plane[0], np.degrees(np.arctan(plane[1]))
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "ground-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # By hand: from (4, 0, -1.70) ten metres ahead, z rises by 0.40: p = 0.04, 2.29 degrees. At x = 0 the ground lies at -1.86 m.
    road = np.array([[4, 0, -1.70], [14, 0, -1.30], [4, 1, -1.69], [14, -1, -1.31]])
    got = answer_array(ground(road), "ground")
    assert got.size == 2, f"return two numbers, height and rise; got {got}"
    height, rise = got.ravel()
    assert not np.isclose(height, -1.86, atol=0.01), "the height is negative: the ground lies at -h"
    assert not np.isclose(height, 1.50, atol=0.01), "that is the mean height: extrapolate to the LIDAR's place, x = 0"
    assert not np.isclose(height, rise, atol=1e-6), "both numbers are equal"
    assert np.isclose(height, 1.86, atol=0.01), f"expected a height of 1.86 m, got {height:.3f}"
    slips = {
        0.04: "that is the slope, or its angle in radians: degrees are asked for",
        -2.2906: "the sign is swapped: the ground ahead is higher, so it rises",
        0.5729: "that is the rise to the left: the order of x and y",
    }
    for slip, hint in slips.items():
        assert not np.isclose(rise, slip, atol=2e-3), f"rise {rise:.4f}: {hint}"
    assert np.isclose(rise, 2.2906, atol=0.01), f"expected a rise of 2.29 degrees, got {rise:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import real_drive

    complaint = real_drive.check_ground(ground)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "ground-cars-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    rng = np.random.default_rng(13)
    road = np.column_stack([rng.uniform(3, 20, 400), rng.uniform(-1.5, 1.5, 400), np.zeros(400)])
    road[:, 2] = -1.7 + 0.01 * road[:, 0] + rng.normal(0, 0.01, 400)
    road[:60, 0], road[:60, 2] = rng.uniform(12, 16, 60), rng.uniform(-1.2, -0.3, 60)  # a car
    clear = answer_array(ground(road[60:].copy()), "ground").ravel()
    raised = answer_array(ground(road[60:] + np.array([0, 0, 0.3])), "ground").ravel()
    assert np.isclose(abs(raised[0] - clear[0]), 0.3, atol=0.02), "on a road 0.3 m higher up the height is the same"
    height, rise = answer_array(ground(road.copy()), "ground").ravel()
    assert abs(height - clear[0]) < 0.02, (
        f"with a car on the road the height is {height:.2f} m, not {clear[0]:.2f}: leave out what lies off the plane, and fit again"
    )
    assert abs(rise - clear[1]) < 0.2, f"with a car on the road the rise is {rise:.2f} degrees, not {clear[1]:.2f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import real_drive

    complaint = real_drive.check_ground_with_cars(ground)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: one scan laid over another (3 points)
#
# `before` and `now` are the returns of two scans, `(N, 3)` and `(M, 3)`, each in the LIDAR frame of its own instant. `T` is T_before_from_now, `(4, 4)`: it
# carries a point of the frame of now into the frame of before.
#
# Complete `overlay`: move the returns of `now` into the frame of `before`, find for each of them the distance to the nearest return of `before`, and return the
# **median** of these distances, in metres. Scans have some thousand returns, so don't write down all pairs at once; `scipy.spatial.KDTree` helps.


# %% nbgrader={"grade": false, "grade_id": "overlay", "locked": false, "schema_version": 3, "solution": true, "task": false}
def overlay(before, now, T):
    """Return the median distance from the moved returns of now to the nearest returns of before (m)."""
    ### BEGIN SOLUTION
    from scipy.spatial import KDTree

    return float(np.median(KDTree(before).query(now @ T[:3, :3].T + T[:3, 3])[0]))
    ### END SOLUTION


# %% nbgrader={"grade": false, "grade_id": "overlay-hints", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _nearest(a, b):
    """Return for each point of b the distance to the nearest point of a."""
    return np.linalg.norm(b[:, None] - a, axis=2).min(axis=1)


def _carried(points, T):
    """Move points."""
    return points @ T[:3, :3].T + T[:3, 3]


def _scans():
    """Return the scan before, (6, 3), the scan of now, (5, 3), and T_before_from_now."""
    c, s = np.cos(np.radians(20)), np.sin(np.radians(20))
    T = np.array([[c, -s, 0, 1.0], [s, c, 0, 0.3], [0, 0, 1, 0.05], [0, 0, 0, 1]])
    before = np.array([[8.0, 2, 0], [12, -3, 1], [15, 4, 0.5], [20, -1, 1], [25, 6, 0], [9, -6, 1]])
    aside = np.array([[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3], [0.4, 0, 0], [0, 2, 0]])
    return before, _carried(before[:5] + aside, np.linalg.inv(T)), T


# %% nbgrader={"grade": false, "grade_id": "overlay-slips", "locked": true, "schema_version": 3, "solution": false, "task": false}
def _overlay_slips(before, now, T):
    """Return the distances that common slips give, by hint."""
    moved, back = _carried(now, T), _carried(now, np.linalg.inv(T))
    mean_hint = "that is the mean: a few things that move would spoil it, take the median"
    distances = {
        "you move by the inverse: T carries points of now into the frame of before": _nearest(before, back),
        "nothing is moved: apply T to `now`": _nearest(before, now),
        "the rotation is missing": _nearest(before, now + T[:3, 3]),
        "the shift is missing": _nearest(before, now @ T[:3, :3].T),
        "the rotation is transposed: points are rows, so it is now @ R.T": _nearest(before, now @ T[:3, :3] + T[:3, 3]),
        "you go from before to now: look for the nearest of `before` for each of `now`": _nearest(moved, before),
        "that is the squared distance": _nearest(before, moved) ** 2,
        "heights are left out: distances are in three dimensions": _nearest(before[:, :2], moved[:, :2]),
        "you move `before`, not `now`": _nearest(_carried(before, T), now),
    }
    return {mean_hint: _nearest(before, moved).mean()} | {hint: np.median(d) for hint, d in distances.items()}


# %% nbgrader={"grade": true, "grade_id": "overlay-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    before, now, T = _scans()
    got = answer_array(overlay(before.copy(), now.copy(), T.copy()), "overlay")  # by hand: 0.1, 0.2, 0.3, 0.4 and 2
    assert got.size == 1, f"return one number, the median; got an array of shape {got.shape}"
    got = got.item()
    for hint, value in _overlay_slips(before, now, T).items():
        assert not np.isclose(got, value, atol=1e-6), f"got {got:.3f}: {hint}"
    assert np.isclose(got, 0.3), f"expected 0.3 m, got {got:.3f}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import real_drive

    complaint = real_drive.check_overlay(overlay)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: find the fault (3 points)
#
# Somebody hands you nine to fifteen frames of the sample drive, in which at most one thing is wrong. Complete `find_fault`: it returns one of
#
# - `"none"`;
# - `"two frames lost"`;
# - `"camera turned"`: the calibration says that the camera looks 2 degrees further to the right than it does;
# - `"LIDAR tilted"`: the LIDAR leans by 2 degrees, which the calibration doesn't know;
# - `"poses backwards"`: the poses say that the vehicle drives backwards.
#
# A frame has `frame.time`, `frame.points` (N, 4), `frame.image` and `frame.camera`. Use the package's functions for tasks 1, 3 and 4, so that a mistake there
# costs nothing here:
#
# ```python
# time_gaps(times)                          # task 1
# ground_plane(frame.points, 1.73).pitch    # task 3: how much the ground of the own lane rises ahead, degrees
# overlay_error(before, now, T)             # task 4, for two frames: it takes the returns of things that stand up
# motion_between(before, now)               # (4, 4): T_before_from_now, as the poses say
# edge_contrast(frame, [-2, -1, 0, 1, 2])   # how well borders in scan and image agree, for a camera turned by these degrees
# ```
#
# For the motion compare frames that are five apart. Against what do you compare the distance? If the motion is right, its inverse is wrong. Average `edge_contrast`
# over a few frames. A second is enough for all of it.


# %% nbgrader={"grade": false, "grade_id": "find-fault", "locked": false, "schema_version": 3, "solution": true, "task": false}
def find_fault(frames):
    """Return the name of the fault."""
    ### BEGIN SOLUTION
    if len(time_gaps([frame.time for frame in frames])):
        return "two frames lost"
    if abs(ground_plane(frames[0].points, 1.73).pitch) > 1:
        return "LIDAR tilted"
    before, now = frames[0], frames[5]
    T = motion_between(before, now)
    if overlay_error(before, now, np.linalg.inv(T)) < overlay_error(before, now, T):
        return "poses backwards"
    turns = np.arange(-3, 3.1, 0.5)
    contrast = np.mean([edge_contrast(frame, turns) for frame in frames[::3]], axis=0)
    return "camera turned" if abs(turns[contrast.argmax()]) > 1 else "none"
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "find-fault-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    frames, found = sample_drive()[4:15], {}
    for fault in ("none", "two frames lost", "camera turned", "LIDAR tilted", "poses backwards"):
        found[fault] = find_fault(FAULTS[fault](frames))
        assert found[fault] is not None, f"{fault}: find_fault returned nothing: did you forget `return`?"
        assert isinstance(found[fault], str), f"{fault}: return one of the five names, got {found[fault]!r}"
    assert len(set(found.values())) > 1, f"the answer is always {found['none']!r}, whatever the fault"
    assert found["none"] == "none", (
        f"the sound drive is called {found['none']!r}: which reading is beyond its limit, and is the limit too tight?"
    )
    for fault, said in found.items():
        assert said == fault, f"the fault is {fault!r}, you say {said!r}"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import real_drive

    complaint = real_drive.check_find_fault(find_fault)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# A colleague has a new drive. The poses pass the test of task 4, the borders agree, the ground is level, and the network's map has a mean confidence of 0.82, as on the
# sample drive. "Then the map is right, too", he says. Which conclusion holds, which doesn't, and what would you measure, without any label, before you believe the map? Name also one fault that
# could hide behind the good readings. Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "believe-the-map", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# The checks say that geometry holds: what needs no training (evidence, occupancy, CMCDOT) can be believed. They say nothing about the semantics, because a network that learned from other images can be wrong and as sure as before:
# on drive 0013 the map's confidence was 0.81 and 0.83, and 0.82 on the sample drive. Without labels one can ask the LIDAR: are returns from the lane called road, and those from standing things something that stands? And compare the images with the training images, as a
# warning, not as a measure of damage. A fault that hides: mirrored poses on a straight road, every second frame lost, or swapped colours. One point for the conclusion, one for a measurement and a fault.

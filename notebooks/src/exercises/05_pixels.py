# %% [markdown]
# # Exercise 05: from grid to pixel
#
# Five small functions around equation (1), and one question to answer in words. About 75 minutes.
# The lecture is [05: from grid to pixel](../05_pixels.ipynb).
#
# | task | about | points |
# |---|---|---|
# | 1 | a camera whose image was cropped and resized | 1 + 2 |
# | 2 | from one frame to another | 3 |
# | 3 | the pixels of a plane, equation (1) | 3 + 2 |
# | 4 | what a wrong height costs | 2 + 1 |
# | 5 | how far a cell has a pixel of its own | 2 |
# | 6 | in your own words | 2 |
#
# Put your code in place of `raise NotImplementedError()`, and run the test cell below each task. A test that fails tells you how to think, not just that
# you are wrong. Your instructor's tests use other numbers. Before you hand in: *Kernel, Restart Kernel and Run All Cells*.

# %% nbgrader={"grade": false, "grade_id": "setup", "locked": true, "schema_version": 3, "solution": false, "task": false}
import warnings

import numpy as np

from semgrid_edu.answers import answer_array, answer_number

warnings.filterwarnings("ignore")  # a warning costs no points; a wrong number does
# Names that begin with _ belong to the tests.

# %% [markdown]
# ## Task 1: a camera whose image was cropped and resized (1 + 2 points)
#
# `K` is the intrinsic matrix of an image; its skew, K[0, 1], is 0. First `left` columns and `top` rows are cut off; then what is left is resized: every length across is
# multiplied by `scale_u`, every length down by `scale_v`. The centre of the first pixel is (0, 0), before and after.
#
# Complete `new_intrinsics`: it returns the matrix of the new image, 3 x 3, and leaves `K` as it is. The cut is worth one point, the scales two. Draw a row
# of six pixels, cut two off, make three out of... where is the *edge* of the first pixel?


# %% nbgrader={"grade": false, "grade_id": "new-intrinsics", "locked": false, "schema_version": 3, "solution": true, "task": false}
def new_intrinsics(K, left, top, scale_u, scale_v):
    """Return K of the image that was cropped, then resized."""
    ### BEGIN SOLUTION
    cut = np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])
    resize = np.array([[scale_u, 0, (scale_u - 1) / 2], [0, scale_v, (scale_v - 1) / 2], [0, 0, 1]])
    return resize @ cut @ K
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "crop-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    K = np.array([[100.0, 0, 40], [0, 120, 30], [0, 0, 1]])
    before = K.copy()
    got = answer_array(new_intrinsics(K, left=8, top=6, scale_u=1, scale_v=1), "new_intrinsics")
    assert np.array_equal(K, before), "new_intrinsics changed its argument `K`: make a new matrix (K.copy())"
    assert got.shape == (3, 3), f"expected a matrix of shape (3, 3), got {got.shape}"
    uncut = answer_array(new_intrinsics(K.copy(), left=0, top=0, scale_u=1, scale_v=1), "new_intrinsics")
    moved = (got - uncut)[:, 2]  # what the cut alone does to the principal point
    slips = {
        8: "with 8 columns cut off on the left, everything lies 8 pixels farther to the LEFT: subtract",
        -6: "left and top are swapped: `left` moves the first row of K, u",
        0: "the principal point stays in the scene, but pixels are counted from a new first one: c_u = 40 - 8",
    }
    for slip, hint in slips.items():
        assert not np.isclose(moved[0], slip), f"8 columns cut off, c_u = {got[0, 2]:g}: {hint}"
    no_size = "a cut changes no focal length, no pixel has changed its size"
    assert np.isclose(got[0, 0], uncut[0, 0]), f"f_u = {got[0, 0]:g}: {no_size}"
    np.testing.assert_allclose(moved, [-8, -6, 0], atol=1e-9, err_msg="by hand: (40 - 8, 30 - 6)")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_crop(new_intrinsics)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "resize-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    K = np.array([[100.0, 0, 40], [0, 120, 30], [0, 0, 1]])
    kept = answer_array(new_intrinsics(K.copy(), 0, 0, 1, 1), "new_intrinsics")
    assert kept.shape == (3, 3), f"expected a matrix of shape (3, 3), got {kept.shape}"
    for slip, hint in {39.5: "half a pixel got lost", 40.5: "half a pixel too much"}.items():
        assert not np.isclose(kept[0, 2], slip), f"{hint}: without a resize nothing but the cut may move c_u"
    # By hand: from the image's edge, c_u is 40.5; half of it 20.25; from the first centre 19.75. For v: 30.5, 7.625, 7.125.
    got = answer_array(new_intrinsics(K.copy(), 0, 0, scale_u=0.5, scale_v=0.25), "new_intrinsics")
    slips = {
        (0, 100): "with half as many pixels, every length in pixels is half as long",
        (0, 200): "you divide by the scale; it multiplies lengths",
        (0, 25): "the scales are swapped: scale_u belongs to the first row of K",
        (0, 49.5): "a length has no edge, so it gets no half pixel: f_u times scale_u",
        (
            2,
            20,
        ): "you scale about the centre of the first pixel: the image begins half a pixel before it, and that edge stays",
        (2, 20.25): "you lost half a pixel on the way: add 1/2, scale, subtract 1/2",
        (2, 19.5): "you subtract 1/2 at the end, but you didn't add it at the beginning",
        (2, 9.625): "the scales are swapped: scale_u belongs to the first row of K",
        (2, 40): "c_u was not scaled",
    }
    for (column, slip), hint in slips.items():
        assert not np.isclose(got[0, column], slip, atol=1e-6), f"halved, K[0, {column}] = {slip:g}: {hint}"
    by_hand = [[50, 0, 19.75], [0, 30, 7.125], [0, 0, 1]]
    np.testing.assert_allclose(got, by_hand, atol=1e-9, err_msg="c' = (c + 1/2) scale - 1/2, f' = f scale")
    cut, both = (answer_array(new_intrinsics(K.copy(), 8, 6, *s))[0, 2] for s in ((1, 1), (0.5, 0.25)))
    order = f"cut, then halved, c_u = {both:g}: you resize first and then cut: the cut comes first, in the old pixels"
    assert np.isclose(both, (cut + 0.5) / 2 - 0.5), order
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_resize(new_intrinsics)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 2: from one frame to another (3 points)
#
# A car drives. `T_world_from_before` and `T_world_from_now`, 4 x 4, say where its LIDAR was and where it is now: each takes points of that LIDAR frame to
# the world. What stood at some place *before* has another place in the frame of *now*.
#
# Complete `now_from_before`: it returns `T_now_from_before`, the 4 x 4 matrix that takes points of the old LIDAR frame to the new one. Write the names in a
# row so that neighbours cancel; one of the two must be turned round first.


# %% nbgrader={"grade": false, "grade_id": "now-from-before", "locked": false, "schema_version": 3, "solution": true, "task": false}
def now_from_before(T_world_from_now, T_world_from_before):
    """Return T_now_from_before, (4, 4)."""
    ### BEGIN SOLUTION
    turn, shift = T_world_from_now[:3, :3], T_world_from_now[:3, 3]
    T_now_from_world = np.eye(4)
    T_now_from_world[:3, :3] = turn.T
    T_now_from_world[:3, 3] = -turn.T @ shift
    return T_now_from_world @ T_world_from_before
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "now-from-before-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Before, the car stands at (10, 2) and looks along the world's x. Now it stands at (12, 5) and looks along the world's y.
    # So its old place is 3 m behind it and, since left of it is the world's -x, 2 m to its left: x = -3, y = 2.
    T_world_from_before = np.array([[1.0, 0, 0, 10], [0, 1, 0, 2], [0, 0, 1, 0], [0, 0, 0, 1]])
    T_world_from_now = np.array([[0.0, -1, 0, 12], [1, 0, 0, 5], [0, 0, 1, 0], [0, 0, 0, 1]])
    got = answer_array(now_from_before(T_world_from_now, T_world_from_before), "now_from_before")
    assert got.shape == (4, 4), f"expected a 4 x 4 matrix, got shape {got.shape}"
    assert np.allclose(got[3], [0, 0, 0, 1]), "the last row isn't 0, 0, 0, 1: only the rotation may be transposed"
    slips = {
        (2, 3): "that is T_before_from_now: turn the other one round",
        (
            10,
            15,
        ): "no matrix was turned round: T_world_from_now ends in 'world', so it can't stand on the left as it is",
        (5, 14): "the order is wrong: with the factors swapped, no neighbours cancel",
        (-10, -15): "the shift of the inverse isn't just minus the shift: it must be turned as well",
        (-2, -3): "that is the way in the world's axes: turn it into those of the car, which looks along the world's y",
        (3, -2): "turned the wrong way: the inverse of a rotation is its transpose",
        (7, -22): "the sign of the shift is missing: the inverse undoes it",
        (-7, 22): "the rotation of the inverse is missing: it is the transpose, in the shift and in the matrix",
        (-15, 10): "you turned the product round: only one of the two must be",
        (-50, 24): "`*` multiplies entry by entry: a product of matrices is `@`",
    }
    x, y = got[:2, 3]
    for slip, hint in slips.items():
        assert not np.allclose((x, y), slip), f"the car's old place, seen from now: x = {x:g}, y = {y:g}: {hint}"
    np.testing.assert_allclose((x, y), (-3, 2), err_msg="the car's old place, seen from now", atol=1e-9)
    np.testing.assert_allclose(got @ [1, 0, 0, 1], [-3, 1, 0, 1], err_msg="1 m before the old place", atol=1e-9)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_now_from_before(now_from_before)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 3: the pixels of a plane (3 + 2 points)
#
# $$ \begin{pmatrix} u \\ v \\ 1 \end{pmatrix} = K \begin{pmatrix} X/Z \\ Y/Z \\ 1 \end{pmatrix} \qquad (1) $$
#
# `xy`, `(N, 2)`, are centres of cells in the grid frame, metres. The plane lies `height` metres above the ground, so its points are (x, y, height).
# `T_camera_from_grid`, 4 x 4, takes them to the camera frame: X right, Y down, Z ahead. `size` is `(h, w)`, the image's height and width in pixels.
# `K` may have a skew, K[0, 1], that isn't 0.
#
# Complete `plane_pixels`: it returns two arrays. `pixels`, `(N, 2)`: u and v of each point, NaN for a point that isn't in front of the camera. `visible`,
# `(N,)` of booleans: in front of the camera, and among the centres of the image's pixels, $0 \le u \le w - 1$ and $0 \le v \le h - 1$. `pixels` is worth
# three points, NaN and `visible` two.


# %% nbgrader={"grade": false, "grade_id": "plane-pixels", "locked": false, "schema_version": 3, "solution": true, "task": false}
def plane_pixels(xy, height, K, T_camera_from_grid, size):
    """Return pixels (N, 2) and visible (N,) of the points of a plane."""
    ### BEGIN SOLUTION
    points = np.column_stack([xy, np.full(len(xy), height), np.ones(len(xy))])
    X, Y, Z = (T_camera_from_grid @ points.T)[:3]
    Z = np.where(Z > 0, Z, np.nan)
    u, v, _ = K @ np.stack([X / Z, Y / Z, np.ones(len(xy))])
    h, w = size
    return np.stack([u, v], axis=1), (u >= 0) & (u <= w - 1) & (v >= 0) & (v <= h - 1)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "plane-pixels-test", "locked": true, "points": 3, "schema_version": 3, "solution": false, "task": false}
def _test():
    K = np.array([[100.0, 0, 50], [0, 120, 20], [0, 0, 1]])
    ahead = np.array([[0.0, -1, 0, 0], [0, 0, -1, 1.5], [1, 0, 0, 0], [0, 0, 0, 1]])  # a camera 1.5 m above the ground
    xy = np.array([[10.0, -2.0], [20.0, 2.0], [10.0, 0.0]])
    # The first, 0.5 m up, by hand: X = 2, Y = 1, Z = 10, so u = 50 + 100 * 0.2 and v = 20 + 120 * 0.1.
    got = plane_pixels(xy, 0.5, K, ahead, (40, 100))
    assert got is not None, "plane_pixels returned nothing: did you forget `return`?"
    two = isinstance(got, (tuple, list)) and len(got) == 2
    assert two, "return two arrays, pixels and visible: `return pixels, visible`"
    pixels = answer_array(got[0], "plane_pixels")
    assert pixels.shape == (3, 2), f"three points go in, pixels must have the shape (3, 2), got {pixels.shape}"
    slips = {
        (700, 320): "did you divide by Z?",
        (70, 38): "that is the ground: the point lies at z = height",
        (70, 44): "the plane went 0.5 m below the ground: z = +height in the grid frame, T turns it down",
        (70, 14): "the camera's place got lost: the fourth coordinate of a point is 1, not 0",
        (64.3, -322.9): "you use the inverse transform: T_camera_from_grid takes grid to camera as it is",
        (85, 14): "that is R (p - t): the matrix turns a point first and then shifts it, R p + t",
        (32, 70): "that is (v, u): u counts to the right and comes first",
        (20, 12): "the principal point is missing: the third column of K",
        (69.5, 31.7): "you divide by the distance: Z is the depth along the camera's axis only",
        (74, 30): "f_u and f_v are swapped",
        (70.5, 32.5): "half a pixel too much: the centre of the first pixel is (0, 0)",
    }
    u, v = pixels[0]
    for slip, hint in slips.items():
        assert not np.allclose((u, v), slip, atol=0.1), f"got ({u:.1f}, {v:.1f}) for the point (10, -2, 0.5): {hint}"
    np.testing.assert_allclose(pixels, [[70, 32], [40, 26], [50, 32]], atol=1e-9, err_msg="by hand, Z = 10, 20 and 10")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_plane_pixels(plane_pixels)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "visible-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    K = np.array([[100.0, 0, 50], [0, 120, 20], [0, 0, 1]])
    ahead = np.array([[0.0, -1, 0, 0], [0, 0, -1, 1.5], [1, 0, 0, 0], [0, 0, 0, 1]])
    places = {
        (10.0, -2.0): "it is at (70, 35), in the middle of the picture: is `size` (h, w), and u compared with w?",
        (-10.0, -1.0): "it lies behind the camera: the formula gives (40, 5), but look at the sign of Z",
        (10.0, 5.03): "its u is -0.3: to the left of the first pixel's centre",
        (10.0, 5.0): "its u is 0, the centre of the first column: the border belongs to the image",
        (10.0, -4.94): "its u is 99.4, and the last pixel's centre is at w - 1 = 99",
        (10.0, -4.86): "its u is 98.6, between the centres of the last two pixels",
        (7.6, 0.0): "its v is 39.7, and the last row's centre is at h - 1 = 39",
        (0.0, 1.0): "Z is 0 there: nothing in the camera's own plane has a pixel",
    }
    got = plane_pixels(np.array(list(places)), 0.25, K, ahead, (40, 100))
    two = isinstance(got, (tuple, list)) and len(got) == 2
    assert two, "return two arrays, pixels and visible: `return pixels, visible`"
    pixels, visible = answer_array(got[0], "plane_pixels"), np.asarray(got[1])
    assert pixels.shape == (8, 2), f"eight points go in, pixels must have the shape (8, 2), got {pixels.shape}"
    assert visible.shape == (8,), f"eight points go in, visible must have the shape (8,), got {visible.shape}"
    assert visible.dtype == bool, f"visible must hold booleans, got {visible.dtype}"
    within = ((pixels >= 0) & (pixels <= [99, 39])).all(axis=1)  # by the pixels that you found
    within[[1, 7]] = False
    for (x, y), truth, claimed in zip(places, within, visible, strict=True):
        assert claimed == truth, f"visible is {claimed} for x = {x:g}, y = {y:g}, 0.25 m up: {places[x, y]}"
    behind = pixels[[1, 7]]
    assert np.isnan(behind).all(), f"points not in front of the camera have no pixel: NaN, got {behind.tolist()}"
    beside = "a point beside the image has a pixel all the same, NaN is for points behind"
    assert np.isfinite(pixels[[2, 4]]).all(), beside
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_visible(plane_pixels)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 4: what a wrong height costs (2 + 1 points)
#
# A level camera is `z_cam` metres above the ground. Something is `x` metres ahead of it, at the height `z`. Its pixel is read by the plane at the height
# `delta` (below the ground where it is negative), which draws it somewhere else. Draw the ray from the side: two similar triangles below (or above) the camera.
#
# Complete `lands_at`: it returns how many metres ahead of the camera the plane draws it. For one more point: a ray that climbs never meets a plane below the
# camera, one that sinks none above, and a level one (`z == z_cam`) none but its own. Then return `np.nan`. (Nobody will ask for `delta == z_cam`.)


# %% nbgrader={"grade": false, "grade_id": "lands-at", "locked": false, "schema_version": 3, "solution": true, "task": false}
def lands_at(x, z, z_cam, delta):
    """Return how far ahead a plane at delta draws what is x metres ahead at height z."""
    ### BEGIN SOLUTION
    if (z_cam - delta) * (z_cam - z) <= 0:
        return np.nan
    return x * (z_cam - delta) / (z_cam - z)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "lands-at-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # The ray sinks from 1.5 m to 0.9 m, by 0.6 m, in 12 m. Down to the plane at 0.3 m it sinks by 1.2 m: twice as far.
    got = answer_number(lands_at(12.0, 0.9, z_cam=1.5, delta=0.3), "lands_at")
    slips = {
        30: "that is the ground: the plane lies at delta",
        6: "the triangles are swapped: the plane is lower than the thing, so the ray gets there later, farther away",
        36: "measure both heights from the camera, where the ray starts, not from the ground",
        4: "measure both heights from the camera, where the ray starts, not from the ground",
        15: "the thing's own height is missing: how much does the ray sink in 12 m?",
        12: "that is where the thing is, or how far it is thrown: count from the camera, to where it is drawn",
        9.6: "z_cam - delta alone isn't the share: compare it with z_cam - z",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got, slip), f"got {got:g} m: {hint}"
    np.testing.assert_allclose(got, 24, err_msg="0.6 m down in 12 m, 1.2 m down in 24 m")
    got = answer_number(lands_at(12.0, 0.3, 1.5, 0.3), "lands_at")
    np.testing.assert_allclose(got, 12, err_msg="on the plane at its own height a thing is in place")
    got = answer_number(lands_at(12.0, 0.0, 1.5, 0.9), "lands_at")
    np.testing.assert_allclose(got, 4.8, err_msg="a plane above the thing draws it nearer")
    got = answer_number(lands_at(12.0, 0.9, 1.5, -0.3), "lands_at")
    assert not np.isclose(got, 24), "a plane 0.3 m below the ground isn't one 0.3 m above it: `delta` has a sign"
    np.testing.assert_allclose(got, 36, err_msg="a plane 0.3 m below the ground: 1.8 m down in 36 m")
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_lands_at(lands_at)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()


# %% nbgrader={"grade": true, "grade_id": "never-test", "locked": true, "points": 1, "schema_version": 3, "solution": false, "task": false}
def _test():
    got = answer_number(lands_at(12.0, 2.0, 1.5, 0.3), "lands_at")
    assert not got < 0, (
        f"a sign 2 m up is drawn {got:g} m ahead: behind the camera. Its ray climbs and never meets this plane"
    )
    assert not np.isinf(got), "not infinitely far: never, NaN"
    assert np.isnan(got), f"a ray that climbs to 2 m never meets the plane at 0.3 m, yet it is drawn {got:g} m ahead"
    got = answer_number(lands_at(12.0, 2.0, 1.5, 2.5), "lands_at")
    assert not np.isnan(got), "a ray that climbs to 2 m in 12 m does meet the plane at 2.5 m: both lie above the camera"
    if np.isclose(answer_number(lands_at(12.0, 1.0, 1.5, 0.5), "lands_at"), 24):  # right below the camera
        np.testing.assert_allclose(got, 24, err_msg="0.5 m up in 12 m, 1 m up in 24 m")
    got = answer_number(lands_at(12.0, 0.9, 1.5, 2.5), "lands_at")
    assert np.isnan(got), f"a ray that sinks never meets the plane at 2.5 m, yet it is drawn {got:g} m ahead"
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_never(lands_at)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 5: how far a cell has a pixel of its own (2 points)
#
# A square cell with a side of `cell` metres lies on the plane at the height `delta`, straight ahead at the depth $Z$. The level camera is `z_cam` metres above
# the ground; its focal lengths are `f_u`, `f_v` pixels. The cell is about
#
# $$ \frac{f_u\,\text{cell}}{Z} \text{ pixels across and } \frac{f_v\,|z_\text{cam} - \delta|\,\text{cell}}{Z^2} \text{ pixels along.} $$
#
# Complete `reach`: it returns the depth, in metres, at which its area is exactly one pixel. The plane may lie above the camera, or
# below the ground, where `delta` is negative. The depth may be hundreds of metres.


# %% nbgrader={"grade": false, "grade_id": "reach", "locked": false, "schema_version": 3, "solution": true, "task": false}
def reach(cell, f_u, f_v, z_cam, delta):
    """Return the depth at which a cell of the plane covers one pixel."""
    ### BEGIN SOLUTION
    return (f_u * f_v * abs(z_cam - delta) * cell**2) ** (1 / 3)
    ### END SOLUTION


# %% nbgrader={"grade": true, "grade_id": "reach-test", "locked": true, "points": 2, "schema_version": 3, "solution": false, "task": false}
def _test():
    # Half a metre below the camera: 100 * 80 * 0.5 * 0.5**2 = 1000 pixels at Z = 1 m. The area falls like the third power.
    got = answer_number(reach(0.5, f_u=100, f_v=80, z_cam=1.5, delta=1.0), "reach")
    slips = {
        1000: "that is the area at Z = 1 m: at which Z is it one pixel?",
        333.333: "`** 1 / 3` is a third of the first power: write `** (1 / 3)`",
        31.623: "that is the square root: one Z is in the width and two are in the height, three in the area",
        14.422: "that is a cell on the ground: count the height from the plane, z_cam - delta",
        17.1: "the camera is z_cam - delta above the plane, not z_cam + delta",
        12.599: "the cell's side counts twice, across and along",
        15.874: "the cell's side got lost: it counts twice, across and along",
        10.772: "you took f_u for f_v: along, the rows count",
        9.283: "you took f_v for f_u: across, the columns count",
        50: "that is where the cell is one pixel wide; its area is asked for",
        4.472: "that is where the cell is one pixel high; its area is asked for",
        7.937: "the cell's side is part of the area, too: it belongs under the root, squared",
        0.001: "turn it round: the area at Z is the area at 1 m divided by the third power of Z",
    }
    for slip, hint in slips.items():
        assert not np.isclose(got, slip, rtol=1e-3), f"got {got:.2f} m: {hint}"
    np.testing.assert_allclose(got, 10, err_msg="1000 pixels at 1 m, so 1000 / 10**3 = 1 pixel at 10 m")
    got = reach(0.5, f_u=100, f_v=80, z_cam=1.5, delta=2.0)
    real = np.isrealobj(got) and np.all(np.asarray(got) > 0)
    assert real, f"got {got} for a plane above the camera: from below its cells are as large: take |z_cam - delta|"
    np.testing.assert_allclose(answer_number(got, "reach"), 10, err_msg="0.5 m above the camera is as good as below")
    below = "a plane 0.2 m below the ground, 0.5 m below the camera: `delta` has a sign"
    np.testing.assert_allclose(reach(0.5, 100, 80, 0.3, -0.2), 10, err_msg=below)
    ### BEGIN HIDDEN TESTS
    from semgrid_instructor import pixels

    complaint = pixels.check_reach(reach)
    assert not complaint, complaint
    ### END HIDDEN TESTS


_test()

# %% [markdown]
# ## Task 6: in your own words (2 points)
#
# The car brakes, its nose goes down by a degree, and nobody tells the calibration. In which direction do the labels move on the map, and where on the map is it
# worst? A colleague proposes forty planes instead of twenty. Does that help? Five sentences are enough.

# %% [markdown] nbgrader={"grade": true, "grade_id": "braking", "locked": false, "points": 2, "schema_version": 3, "solution": true, "task": false}
# With the nose down, everything in the image moves up. The row where the cell at 30 m is looked up now shows road that is nearer, about 22 m: so what is at 22 m is drawn at
# 30 m, labels move away from the car. 1/x' = 1/x + angle / z_cam: it is worst far ahead, where the error grows nearly like the square of the distance, and small nearby. More planes in the same range
# don't help: the error isn't one of the height alone, it grows with the distance, so no single plane is right for the ground at all distances; the network would have to choose another plane
# for each distance, and needs planes below zero for a nose that goes up. A pitch angle from an inertial sensor, or the horizon or the LIDAR's ground in the image, helps. One point for direction and place, one for a reasoned answer
# on the planes.

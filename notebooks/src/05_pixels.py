# %% [markdown]
# # 05 · From grid to pixel: equation (1)
#
# **In one sentence.** A pixel doesn't know how far away its thing is, but every place has exactly one pixel: so lay
# planes over the grid, and ask for each point of each plane which pixel sees it.
#
# **You will be able to**
# - find the pixel of a point by similar triangles, and say what $K$ does to it;
# - change $K$ when an image is resized or cropped, without losing half a pixel;
# - read, compose and invert transforms by their names;
# - build the pixels of a whole plane, with a mask for what lies behind the camera or outside the image;
# - say by hand what a wrong height, a wrong angle and a long distance do to the map.
#
# **Prerequisites.** Lecture 00: the grid, a first look at equation (1). A matrix times a vector; a rotation as a
# matrix.
#
# **Time.** 110 minutes, best in two sittings; the computer needs less than one.
#
# **Paper.** Section 3.3, equation (1).
#
# ```
# (x, y, δ) ── T_lidar_from_grid ──▶ ── T_camera_from_lidar ──▶ (X, Y, Z) ── ÷ Z ──▶ ── K ──▶ pixel (u, v), in view?
# ```

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, interact
from scipy import ndimage
from scipy.spatial.transform import Rotation

from semgrid_edu import plotting
from semgrid_edu.camera import Camera, invert_rigid, lidar_from_grid, project, rigid_transform, transform_points
from semgrid_edu.datasets.training_arrays import resize_image
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import plane_heights, plane_pixels

plt.rcParams["figure.dpi"] = 72
plt.rcParams.update({"image.interpolation": "nearest", "hatch.color": "white"})
spec, drive = GridSpec.compact(), sample_drive()
frame = drive[len(drive) - 1]
camera = frame.camera
grey = (120 + frame.image.mean(axis=2, keepdims=True) // 16 * 8).astype(np.uint8)
pale = replace(frame, image=np.repeat(grey, 3, axis=2))  # to draw on
coarse = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, cell=1.0)  # to draw, so that dots stay apart

# %% [markdown]
# New symbols, beside those of lecture 00:
#
# | symbol | meaning | name in code |
# |---|---|---|
# | $f_u, f_v$ | focal lengths, pixels | `K[0, 0]`, `K[1, 1]` |
# | $c_u, c_v$ | principal point: where the camera's axis meets the image, pixels | `K[0, 2]`, `K[1, 2]` |
# | $z_\text{cam}$ | height of the camera above the ground, metres | `z_cam` |
# | $\psi$ | a small angle by which the camera is turned | `degrees` |
#
# ## Two similar triangles
#
# Take a box with a tiny hole in front and a film 200 pixels behind the hole. (A distance in pixels? The film's pixels
# are its unit of length: with pixels of 0.02 mm it is 4 mm.) Ten metres ahead stands a pole, 2 m tall. Light runs
# straight through the hole, so the pole and its picture are two triangles of the same shape: the picture is to 200
# pixels as 2 m are to 10 m. 200 · 2 / 10 = 40 pixels. (It stands on its head; a camera turns it back.)
#
# **Predict before you run.** How tall is the picture when the pole is 20 m away? And that of a toy pole of 20 cm, 1 m
# away?
#
# <details><summary>Answer</summary>20 pixels: twice as far, half as tall. The toy: 200 · 0.2 / 1 = 40 pixels, the same
# as the real pole at 10 m. A picture can't tell a small thing nearby from a big one far away. Keep this in mind: it is
# the trouble of this whole lecture.</details>
#
# Count pixels to the right and down, from the first pixel's centre; the axis of the camera meets the film at $(c_u,
# c_v)$. Then, in the camera's frame, $X$ to the right, $Y$ down, $Z$ ahead:
#
# $$ u - c_u = f_u \frac{X}{Z}, \qquad v - c_v = f_v \frac{Y}{Z} $$


# %%
def pinhole(X, Y, Z, f_u=200, f_v=200, c_u=160, c_v=48):
    """Return u and v of a point: two similar triangles."""
    return c_u + f_u * X / Z, c_v + f_v * Y / Z


K = np.array([[200.0, 0, 160], [0, 200, 48], [0, 0, 1]])
places = {
    "top of the pole, 10 m ahead": (0, -2, 10),
    "the same, 20 m ahead": (0, -2, 20),
    "of the toy, 1 m ahead": (0, -0.2, 1),
}
for name, point in places.items():
    package, _ = project(np.array(point, float), Camera(K, np.eye(4), size=(96, 320)))
    np.testing.assert_allclose(pinhole(*point), package)
    print(f"{name:<28} {48 - package[1]:.0f} pixels above the axis")

# %%
fig, ax = plt.subplots(figsize=(8, 2.6), layout="constrained")
for Z, top, colour in ((10, 2.0, "tab:blue"), (20, 2.0, "tab:orange"), (1, 0.2, "tab:green")):
    ax.plot([0, Z], [0, top], color=colour, linewidth=0.8)
    ax.plot([Z, Z], [0, top], color=colour, linewidth=4, solid_capstyle="butt")
ax.axvline(1, color="0.7", linestyle=":")
ax.text(1.1, -0.5, "one metre ahead: (X/Z, Y/Z, 1)", color="0.4", fontsize="small")
ax.plot(0, 0, "ko")
ax.set(xlabel="Z, ahead of the hole [m]", ylabel="up, −Y [m]", ylim=(-0.7, 2.3), xlim=(-0.5, 21))
plt.show()

# %% [markdown]
# Thick: the poles; thin: the ray from the top of each to the hole. Blue and green share one ray, so they share a pixel.
# Look at the dotted line one metre ahead: a ray meets it at $(X/Z, Y/Z)$, and the picture is what you see on that line,
# in pixels instead of metres. That is all $K$ does.
#
# Turn the triangle round and it measures: height = pixels · $Z / f_v$. On the drive, in the last frame, two
# pedestrians: how tall are they? The rows come from the true labels of the image, the depth from the simulator.

# %%
people, _ = ndimage.label(frame.labels.image == KITTI_14.index("pedestrian"))
fig, axes = plt.subplots(1, 2, figsize=(4, 3), layout="constrained")
two = np.argsort(-np.bincount(people[people > 0]))[:2]  # the largest, so the nearest
for ax, number in zip(axes, two, strict=True):
    rows, cols = np.nonzero(people == number)
    Z = np.median(frame.labels.depth[rows, cols])
    tall = rows.max() - rows.min() + 1
    print(f"{tall} rows of pixels, {Z:.1f} m ahead: {tall * Z / camera.K[1, 1]:.2f} m tall")
    ax.imshow(frame.image)
    ax.hlines((rows.min() - 0.5, rows.max() + 0.5), cols.min() - 5, cols.max() + 5, color="tab:red")
    ax.set(xlim=(cols.mean() - 25, cols.mean() + 25), ylim=(155, 75), xlabel="u [pixels]", ylabel="v [pixels]")
plt.show()

# %% [markdown]
# One picture is twice as tall as the other, the people are not. Without the depth you couldn't know.
#
# ## One matrix, and the division last
#
# A camera shifts (by $c$), scales (by $f$) and divides (by $Z$). The division spoils the matrix algebra, so do it last:
# carry a third number along.
#
# By hand, for the point of lecture 00, (1.5, 1, 10): $K$ times it is (200 · 1.5 + 160 · 10, 200 · 1 + 48 · 10, 10) =
# (1900, 680, 10). Divide by the last number: (190, 68). The same pixel as before.
#
# **Predict before you run.** And the point (3, 2, 20)? And (0.15, 0.1, 1)?
#
# <details><summary>Answer</summary>(3800, 1360, 20) and (190, 68, 1). Divided: (190, 68), both. Multiples of one triple
# are one pixel, as all points of one ray are. Triples read like this are called *homogeneous coordinates*.</details>
#
# $$ \begin{pmatrix} u \\ v \\ 1 \end{pmatrix} = K \begin{pmatrix} X/Z \\ Y/Z \\ 1 \end{pmatrix}
#    = \frac{1}{Z}\, K \begin{pmatrix} X \\ Y \\ Z \end{pmatrix}, \qquad
#    K = \begin{pmatrix} f_u & 0 & c_u \\ 0 & f_v & c_v \\ 0 & 0 & 1 \end{pmatrix} \qquad (1) $$


# %%
def pixel(point, K):
    """Return u and v of a point of the camera's frame: equation (1), the division last."""
    triple = K @ point
    return triple[:2] / triple[2]


for point in ([1.5, 1, 10], [3, 2, 20], [0.15, 0.1, 1]):
    np.testing.assert_allclose(pixel(np.array(point), K), pinhole(*point))
    print(f"{point!s:<14} -> {(K @ point).tolist()!s:<22} -> {pixel(np.array(point), K).round(6).tolist()}")

# %% [markdown]
# ### Where parallels meet
#
# Two rails run straight ahead on the ground, 1.5 m to the left and to the right, 1.5 m below the camera: the points
# $(\pm 1.5, 1.5, Z)$. At $Z$ = 10 they are at u = 160 ± 30, at 20 at 160 ± 15.
#
# **Predict before you run.** Where do they meet?
#
# <details><summary>Answer</summary>As $Z$ grows, $X/Z$ and $Y/Z$ go to 0: at (160, 48), the principal point. Wherever
# they start, all lines in this direction end there. $K$ knows it: the *direction* (0, 0, 1) gives the triple (160, 48,
# 1).</details>

# %%
for X in (-1.5, 1.5):
    np.testing.assert_allclose(pixel(np.array([X, 1.5, 1e9]), K), pixel(np.array([0.0, 0, 1]), K), atol=1e-6)
straight_on = camera.K @ camera.T_camera_from_grid[:3, :3] @ np.array([1.0, 0, 0])  # the grid's forward direction
vanishing = straight_on[:2] / straight_on[2]
print("on the drive, what runs straight ahead ends at u = {:.0f}, v = {:.0f}".format(*vanishing))

# %%
fig, ax = plt.subplots(figsize=(6, 2.8), layout="constrained")
ax.imshow(pale.image)
for y in (-2.1, -4.5):
    rail = np.array([[x, y, 0.0] for x in np.geomspace(7, 1000, 100)])
    pixels, visible = project(transform_points(camera.T_camera_from_grid, rail), camera)
    ax.plot(*pixels[visible].T, color="tab:red")
ax.plot(*vanishing, "+", color="tab:red", markersize=16, markeredgewidth=2)
ax.set(xlim=(270, 560), ylim=(187, 55), xlabel="u [pixels]", ylabel="v [pixels]")
plt.show()

# %% [markdown]
# Red: two lines on the ground, 2.1 m and 4.5 m to the right, and the point where all such lines end. In the
# simulator's map these are the edges of the sidewalk, and they fall on its edges in the image. If they didn't,
# calibration or code would be wrong: draw this picture of every new camera.
#
# ## A new image, a new $K$
#
# Networks see smaller images, and often only a part. A row of 8 pixels, its axis in the middle, at $c_u$ = 3.5; $f_u$ =
# 10. Take pairs of pixels together, 4 are left.
#
# **Predict before you run.** The new $c_u$? The new $f_u$? And if you cut two pixels off on the left instead?
#
# <details><summary>Answer</summary>The middle of 4 pixels, at 0, 1, 2, 3, is 1.5. Not 3.5 / 2 = 1.75! The image begins
# half a pixel *before* the centre of its first pixel, and that edge is what stays in place: 3.5 + 0.5 = 4 pixels from
# the edge, half of them is 2, less 0.5. The focal length has no place, only a length: 5. A cut shifts: $c_u$ = 1.5, and
# $f_u$ is still 10, since no pixel has changed its size.</details>
#
# From $w \times h$ to $w' \times h'$ pixels, and with $u_0$ columns and $v_0$ rows cut off:
#
# $$ \text{resized:} \quad f_u' = f_u \frac{w'}{w}, \quad c_u' = \left(c_u + \tfrac12\right) \frac{w'}{w} - \tfrac12
#    \qquad\qquad \text{cropped:} \quad f_u' = f_u, \quad c_u' = c_u - u_0 $$
#
# and the same for $v$. As matrices on the left of $K$, they can be chained.


# %%
def resize(scale_u, scale_v):
    """Return the matrix that takes pixels of an image to those of a resized one."""
    return np.array([[scale_u, 0, (scale_u - 1) / 2], [0, scale_v, (scale_v - 1) / 2], [0, 0, 1]])


def crop(left, top):
    """Return the matrix that takes pixels of an image to those of a part of it."""
    return np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])


row = np.array([[10, 0, 3.5], [0, 10, 0], [0, 0, 1]])
print("halved: f_u, c_u =", (resize(0.5, 1) @ row)[0, ::2], "  cropped:", (crop(2, 0) @ row)[0, ::2])
h, w = camera.size
np.testing.assert_allclose(resize(320 / w, 96 / h) @ camera.K, camera.resized((96, 320)).K)

# %% [markdown]
# Is it true of pictures, too? Paint a soft dot on a black image of the drive's size, 188 x 621, at the pixel of a place
# 15 m ahead. Cut off the first column, halve what is left to 94 x 310, and ask where the dot's middle is now.

# %%
place = transform_points(camera.T_camera_from_grid, np.array([15.0, 2.0, 1.0]))
(u, v), (columns, rows) = pixel(place, camera.K), np.meshgrid(np.arange(w), np.arange(h))
dot = 255 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 5**2))
part = np.dstack([dot.round().astype(np.uint8)] * 3)[:, 1:]
small = resize_image(part, (94, 310))[..., 0].astype(float)
middle = np.array([small.sum(axis=0) @ np.arange(310), small.sum(axis=1) @ np.arange(94)]) / small.sum()
np.testing.assert_allclose(middle, pixel(place, resize(0.5, 0.5) @ crop(1, 0) @ camera.K), atol=0.02)
careless = pixel(place, np.diag([0.5, 0.5, 1]) @ crop(1, 0) @ camera.K)
print("K times one half misses the dot by {:.2f} and {:.2f} pixels".format(*np.abs(careless - middle)))

# %% [markdown]
# A quarter of a pixel, and no error message. Lecture 06 turns it into metres.
#
# ## Where the camera stands: reading names
#
# A toy car: the LIDAR is 2 m above the ground, the camera 0.5 m below the LIDAR and looks ahead. A post stands 10 m
# ahead, 2 m to the right; its top is 0.5 m above the ground. Three frames, three triples for one place:
#
# | frame | axes | origin | top of the post |
# |---|---|---|---|
# | grid | x forward, y left, z up | on the ground below the LIDAR | (10, -2, 0.5) |
# | LIDAR | the same | 2 m higher | (10, -2, -1.5) |
# | camera | X right, Y down, Z ahead | 0.5 m below the LIDAR | (2, 1, 10) |
#
# Check the last row: right is -y; ahead is x; and the top of the post is 1 m lower than the camera, so $Y$ = 1.
#
# Each step turns and shifts. As 4 x 4 matrices on $(x, y, z, 1)$ a turn with its shift is one factor, and the names
# tell the order: **neighbours that are equal cancel**, from right to left.
#
# $$ T_\text{camera←grid} = T_\text{camera←lidar}\; T_\text{lidar←grid}, \qquad
#    T = \begin{pmatrix} T_\text{turn} & T_\text{shift} \\ 0 & 1 \end{pmatrix}, \qquad
#    T^{-1} = \begin{pmatrix} T_\text{turn}^\top & -T_\text{turn}^\top T_\text{shift} \\ 0 & 1 \end{pmatrix} $$
#
# **Predict before you run.** $T^{-1}$ of `T_camera_from_grid` is called `T_grid_from_camera`. What does it make of (0,
# 0, 0), in the toy car? And why is it not simply $-T_\text{shift}$?
#
# <details><summary>Answer</summary>The camera's own place, seen from the grid: (0, 0, 1.5). The shift, (0, 1.5, 0),
# is written in the *camera's* axes, where down is $Y$. Its negative would put the camera 1.5 m to the right, since the
# second axis of the grid points to the left.</details>

# %%
axes_of_camera = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # X is -y, Y is -z, Z is x


def transform(turn, shift):
    """Return the 4 x 4 matrix that turns, then shifts."""
    return np.vstack([np.column_stack([turn, shift]), [0, 0, 0, 1]])


def inverse(T):
    """Return the way back: undo the shift, then the turn."""
    turn, shift = T[:3, :3], T[:3, 3]
    return transform(turn.T, -turn.T @ shift)


T_lidar_from_grid = transform(np.eye(3), [0, 0, -2])
T_camera_from_lidar = transform(axes_of_camera, [0, -0.5, 0])
T_camera_from_grid = T_camera_from_lidar @ T_lidar_from_grid
toy = Camera(K, T_camera_from_lidar, size=(96, 320), lidar_height=2.0)
np.testing.assert_allclose(T_lidar_from_grid, lidar_from_grid(2.0))
np.testing.assert_allclose(T_camera_from_grid, toy.T_camera_from_grid)
np.testing.assert_allclose(inverse(T_camera_from_grid), invert_rigid(T_camera_from_grid))
print("post, from the camera:", (T_camera_from_grid @ [10, -2, 0.5, 1])[:3])
print("camera, from the grid:", np.abs(inverse(T_camera_from_grid)[:3, 3]))  # no -0

# %%
fig, ax = plt.subplots(figsize=(8, 2.8), layout="constrained")
frames = {"grid": (0, "x", "z", 1), "LIDAR": (2, "x", "z", 1), "camera": (1.5, "Z", "Y", -1)}
for (name, (up, first, second, sign)), colour in zip(frames.items(), ("0.3", "tab:blue", "tab:red"), strict=True):
    for dx, dz, axis in ((1.2, 0, first), (0, 0.4 * sign, second)):
        ax.annotate("", (dx, up + dz), (0, up), arrowprops={"arrowstyle": "->", "color": colour})
        ax.text(1.15 * dx + 0.08, up + 1.15 * dz, axis, color=colour, va="center")
    ax.text(-0.2, up, name, color=colour, ha="right", va="center")
ax.plot([10, 10], [0, 0.5], color="black", linewidth=3)
ax.plot([0, 10], [1.5, 0.5], color="tab:red", linewidth=0.8, linestyle=":")
ax.axhline(0, color="0.7", zorder=0)
ax.set(xlim=(-2, 11), ylim=(-0.2, 2.6), xlabel="forward [m]", ylabel="height [m]")
plt.show()

# %% [markdown]
# The toy car from its right side; y points into the page, X out of it. Dotted: the ray from the camera to the top of
# the post.
#
# The drive's calibration is made the same way, only that nothing is exactly straight. Two routes must end in the same
# pixel: from the LIDAR frame, or over the grid.

# %%
z_cam = invert_rigid(camera.T_camera_from_grid)[2, 3]
straight, _ = project(transform_points(camera.T_camera_from_lidar, frame.points[:, :3].astype(float)), camera)
over_grid, _ = project(transform_points(camera.T_camera_from_grid, frame.points_grid[:, :3].astype(float)), camera)
difference = np.abs(straight - over_grid)[frame.points[:, 0] > 1].max()
assert difference < 1e-3
print("the drive's camera, in the grid frame:", invert_rigid(camera.T_camera_from_grid)[:3, 3].round(2), "m")

# %% [markdown]
# ## Equation (1) for a plane
#
# Now everything in turn, for the top of the post: grid (10, -2, 0.5), camera (2, 1, 10), pixel u = 160 + 200 · 2 / 10 =
# 200, v = 48 + 200 · 1 / 10 = 68. A plane is nothing but many such points: the centres of all cells, lifted to one
# height $\delta_d$.
#
# Take the cells straight ahead of the toy car. A point of the plane at $\delta$ is 1.5 - $\delta$ metres lower than the
# camera, so $v = 48 + 200\,(1.5 - \delta) / Z$:
#
# | | $Z$ = 5 m | 10 m | 20 m | 40 m |
# |---|---|---|---|---|
# | $\delta$ = 0 m | 108 | 78 | 63 | 55.5 |
# | $\delta$ = 1 m | 68 | 58 | 53 | 50.5 |
# | $\delta$ = 1.5 m | ? | ? | ? | ? |
# | $\delta$ = 2 m | 28 | 38 | 43 | 45.5 |
#
# **Predict before you run.** Fill in the missing row. To which number does every row tend? And which of the places in
# the table is not in the picture, whose rows run from 0 to 95?
#
# <details><summary>Answer</summary>48, four times: the plane at the camera's own height is seen edge-on, as a line.
# All rows tend to 48: the horizon. The ground 5 m ahead, row 108, lies below the lower border.</details>
#
# With the point of plane $d$ in the grid frame, as the paper has it:
#
# $$ \begin{pmatrix} X \\ Y \\ Z \\ 1 \end{pmatrix} = T_\text{camera←grid}
#    \begin{pmatrix} x_j \\ y_j \\ \delta_d \\ 1 \end{pmatrix}, \qquad
#    \begin{pmatrix} u \\ v \\ 1 \end{pmatrix} = K \begin{pmatrix} X/Z \\ Y/Z \\ 1 \end{pmatrix} \qquad (1) $$


# %% tags=["eq-1"]
def pixels_of_planes(spec, heights, camera):
    """Return the pixels, (D, H, W, 2), and which of them are in view, (D, H, W): one point at a time."""
    pixels = np.full((len(heights), *spec.shape, 2), np.nan)
    visible = np.zeros((len(heights), *spec.shape), bool)
    h, w = camera.size
    for d, r, c in np.ndindex(visible.shape):
        x, y = spec.centers()[r, c]
        X, Y, Z, _ = camera.T_camera_from_grid @ [x, y, heights[d], 1]
        if Z > 0:
            u, v, _ = camera.K @ [X / Z, Y / Z, 1]
            pixels[d, r, c] = u, v
            visible[d, r, c] = 0 <= u <= w - 1 and 0 <= v <= h - 1
    return pixels, visible


block = GridSpec(x_min=-10, x_max=41, y_min=-7, y_max=8, cell=3)  # some of it behind the camera
for some_camera in (toy, camera):
    literal, seen = pixels_of_planes(block, [0.0, 1.0, 1.5, 2.0], some_camera)
    package, visible = plane_pixels(block, [0.0, 1.0, 1.5, 2.0], some_camera)
    np.testing.assert_allclose(literal, package)
    np.testing.assert_array_equal(seen, visible)
print(f"{seen.size} points, {seen.sum()} of them in view of the drive's camera")

# %%
fig, ax = plt.subplots(figsize=(8, 3.2), layout="constrained")
ahead = GridSpec(x_min=0, x_max=60, y_min=-0.1, y_max=0.1, cell=0.2)
toy_heights = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0]
toy_pixels, toy_visible = plane_pixels(ahead, toy_heights, toy)
for height, pixels, visible in zip(toy_heights, toy_pixels, toy_visible, strict=True):
    colour = plt.get_cmap("viridis")(height / 3.3)
    (line,) = ax.plot(ahead.centers()[:, 0, 0], pixels[:, 0, 1], color=colour, label=f"{height} m")
    first = np.flatnonzero(visible[:, 0]).max()
    ax.plot(ahead.centers()[first, 0, 0], pixels[first, 0, 1], "o", color=colour)
ax.axhspan(-0.5, 95.5, color="0.93", zorder=0)
ax.set(xlabel="x, forward [m]", ylabel="v, down [pixels]", xlim=(0, 60), ylim=(115, -20))
ax.legend(title="plane at", loc="center left", bbox_to_anchor=(1, 0.5))
plt.show()

# %% [markdown]
# Grey: the image. Each curve is a plane, straight ahead; the dot is where it comes into view. Lower planes are seen
# from above and climb towards the horizon, higher ones from below and sink to it. Near the car the curves are far
# apart, so there an image tells heights from one another. Sixty metres ahead three metres of height are ten rows.
#
# The same on the drive, over a paled image: each dot is the centre of a cell of the ground plane, coloured by
# its depth. (The cells are 1 m wide here, so that the dots stay apart.)

# %%
fig, ax = plt.subplots(figsize=(8, 2.5), layout="constrained")
plotting.plane_on_image(coarse, 0.0, pale, ax=ax, size=5)
plt.show()

# %% [markdown]
# A carpet on the road. It also lies over the cars that stand there, for equation (1) knows nothing of cars. Near the
# lower border neighbours are 60 pixels apart, along the horizon they run into each other.
#
# ### The horizon
#
# A point on the horizon is infinitely far ahead, where 1 m up or down makes no difference; so **all planes meet
# there**. It is also where the plane at the camera's height lies. So whatever is higher than the camera rises above the
# horizon in the image, whatever is lower stays below, *at any distance*.
#
# **Predict before you run.** The drive's camera is 1.66 m above the road, its horizon in row 86. The two pedestrians
# from above are 9 m and 19 m ahead. In which rows are the tops of their heads?
#
# <details><summary>Answer</summary>They are 1.7 m tall, about as tall as the camera stands: so their heads are on the
# horizon, or just above, both of them. (A few rows above: they walk on the sidewalk, and the kerb lifts them by 12 cm.)
# Look at a crowd on a square: if you are as tall as they are, all heads are on one line.</details>


# %%
def horizon(u, camera):
    """Return the row of the horizon in column u: where directions along the ground end, left and right."""
    ends = camera.K @ camera.T_camera_from_grid[:3, :3] @ np.array([[1.0, 1], [0.5, -0.5], [0, 0]])
    (u_left, u_right), (v_left, v_right) = ends[:2] / ends[2]
    return v_left + (u - u_left) / (u_right - u_left) * (v_right - v_left)


far_away = transform_points(camera.T_camera_from_grid, np.array([[1e7, 3e6, 0.0], [1e7, -2e6, 3.8]]))
u, v = project(far_away, camera)[0].T
np.testing.assert_allclose(horizon(u, camera), v, atol=1e-3)
for number in two:
    rows, cols = np.nonzero(people == number)
    print(f"head in row {rows.min()}, horizon there in row {horizon(cols.mean(), camera):.0f}")

# %% [markdown]
# ## Behind the camera, outside the image
#
# The grid may reach behind the car. What does the formula alone say of a place 10 m *behind* the toy camera, 2 m to the
# left, on the ground: $(-2, 1.5, -10)$?
#
# **Predict before you run.** Compute u and v. Would you notice that something is wrong?
#
# <details><summary>Answer</summary>u = 160 + 200 · (-2) / (-10) = 200 and v = 48 + 200 · 1.5 / (-10) = 18: a fine
# pixel, in the sky on the right. Two minus signs have cancelled; the world behind is projected through the hole, upside
# down. You wouldn't notice: no error, no NaN, only ground that is taken from the sky.</details>
#
# So a point is **visible** if it lies in front of the camera *and* its pixel is in the image. In the image means here:
# among the *centres* of pixels, $0 \le u \le w - 1$, $0 \le v \le h - 1$, since equation (2) interpolates between
# centres.

# %%
behind = np.array([-2, 1.5, -10])
print("formula alone: u = {:.0f}, v = {:.0f}".format(*pinhole(*behind)))
print("package:", project(behind, toy)[0], " visible:", project(behind, toy)[1])
ground_from = 200 * 1.5 / (95 - 48)
just = np.array([[0, 1.5, 0.999 * ground_from], [0, 1.5, 1.001 * ground_from]])
np.testing.assert_array_equal(project(just, toy)[1], [False, True])
print(f"the toy camera sees the ground from {ground_from:.1f} m on")

# %% [markdown]
# On the drive: for each cell, how many of the twenty planes can be read? The grid is drawn from 20 m behind the
# car to 30 m ahead.

# %%
longer = GridSpec(x_min=-20, x_max=30, y_min=-15.5, y_max=15.5, cell=0.5)
_, in_view = plane_pixels(longer, plane_heights(), camera)
fig, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
plotting.grid_values(longer, in_view.sum(axis=0), "planes in view, of 20", ax=axes[0], cmap="viridis")
ax = axes[1]
near_car = GridSpec(x_min=-2, x_max=14, y_min=-10, y_max=10, cell=0.1)
for height in (0.0, 1.0, 2.0, 3.0):
    (visible,) = plane_pixels(near_car, [height], camera)[1]
    colour = plt.get_cmap("viridis")(height / 3.3)
    ax.contour(near_car.centers()[0, :, 1], near_car.centers()[:, 0, 0], visible, [0.5], colors=[colour])
    ax.plot([], [], color=colour, label=f"{height:.0f} m")
ax.set(xlim=(10, -10), ylim=(-2, 14), aspect="equal", xlabel="y, to the left [m]", ylabel="x, forward [m]")
ax.plot(0, 0, "k^", markersize=10)
ax.legend(title="plane at", loc="lower right", fontsize="small")
plt.show()
(ground,) = plane_pixels(spec, [0.0], camera)[1]
print(f"of the course's grid {100 * ground.mean():.0f} % can be read on the ground plane")

# %% [markdown]
# Left: dark is nothing, yellow all twenty, and nothing comes from behind. The wedge is the camera's angle of view.
# Within it, near the car, planes drop out: the ground below the lower border of the image, the high ones above the
# upper. Right, closer: inside its line a plane is in view (the triangle is the LIDAR). Those near the camera's height
# begin 2 or 3 m ahead; the ground, and the plane 3 m up, only 6 m ahead. For the cells next to the car only the
# occupancy grid has something to say.
#
# ## How many pixels is a cell?
#
# A cell of 0.5 m on the ground, 10 m ahead of the toy car. Across, similar triangles: 200 · 0.5 / 10 = 10 pixels.
# Along, it reaches from 9.75 m to 10.25 m, from row 48 + 300 / 9.75 = 78.77 to 48 + 300 / 10.25 = 77.27: 1.5 pixels. So
# 15 pixels.
#
# **Predict before you run.** And 20 m ahead?
#
# <details><summary>Answer</summary>5 across. Along, 300 / 19.75 - 300 / 20.25 = 0.375, a quarter: seen from twice as
# far *and* twice as flat. Together 1.9 pixels, an eighth.</details>
#
# $$ \text{across} = \frac{f_u\,\text{cell}}{Z}, \qquad
#    \text{along} \approx \frac{f_v\, |z_\text{cam} - \delta|\,\text{cell}}{Z^2}, \qquad
#    \text{pixels a cell} \approx \frac{f_u f_v\, |z_\text{cam} - \delta|\,\text{cell}^2}{Z^3} $$


# %%
def pixels_of_cell(cell, Z, camera, z_cam):
    """Return how many pixels a cell on the ground is across and along."""
    f_u, f_v = camera.K[0, 0], camera.K[1, 1]
    return f_u * cell / Z, f_v * z_cam * cell / Z**2


def outline(x, y, cell, camera):
    """Return the pixels of the corners of a cell on the ground, (4, 2)."""
    corners = np.array([[x + i * cell / 2, y + j * cell / 2, 0] for i, j in ((-1, -1), (-1, 1), (1, 1), (1, -1))])
    return project(transform_points(camera.T_camera_from_grid, corners), camera)[0]


def area(corners):
    """Return the area of a polygon: the shoelace formula."""
    u, v = corners.T
    return abs(u @ np.roll(v, 1) - v @ np.roll(u, 1)) / 2


for x in (10, 20, 40):
    across, along = pixels_of_cell(0.5, x, toy, z_cam=1.5)
    np.testing.assert_allclose(across * along, area(outline(x, 0.0, 0.5, toy)), rtol=0.01)
    print(f"toy, {x} m ahead: {across:.1f} x {along:.2f} = {across * along:.2f} pixels")

# %% [markdown]
# The drive's camera, with the image that the course's compact network sees (96 x 320), and with an image as large as
# the paper's (375 x 1242):

# %%
cameras = {"compact": camera.resized((96, 320)), "paper's": camera.resized((375, 1242))}
print(f"{'image':<9}{'cell':>6}" + "".join(f"{f'{Z} m ahead':>25}" for Z in (5, 20, 50)) + f"{'one pixel at':>14}")
for name, some_camera in cameras.items():
    for cell in (0.2, 0.5):
        sizes = [pixels_of_cell(cell, Z, some_camera, z_cam) for Z in (5, 20, 50)]
        columns = "".join(f"{f'{across:.1f} x {along:.2f} = {across * along:.2f}':>25}" for across, along in sizes)
        reach = (some_camera.K[0, 0] * some_camera.K[1, 1] * z_cam * cell**2) ** (1 / 3)
        print(f"{name:<9}{cell:>4} m{columns}{f'{reach:.0f} m':>14}")

# %%
compact = cameras["compact"]
small = resize_image(frame.image, (96, 320))
fig, axes = plt.subplots(1, 4, figsize=(10, 2.7), layout="constrained", width_ratios=(1, 1, 1, 1.6))
for ax, x in zip(axes, (7.0, 15.0, 40.0), strict=False):
    corners = outline(x, 0.5, 0.5, compact)
    ax.imshow(small)
    ax.fill(*corners.T, facecolor="none", edgecolor="tab:red")
    u, v = corners.mean(axis=0)
    ax.set(xlim=(u - 9, u + 9), ylim=(v + 9, v - 9), xticks=[], yticks=[])
    ax.set_title(f"{x:.0f} m ahead", fontsize="medium")
distances = np.geomspace(7, 70, 60)
for cell, style in ((0.5, "-"), (0.2, "--")):
    for (name, some_camera), colour in zip(cameras.items(), ("tab:blue", "tab:orange"), strict=True):
        areas = [area(outline(x, 0.5, cell, some_camera)) for x in distances]
        axes[3].loglog(distances, areas, style, color=colour, label=f"{name}, {cell} m")
axes[3].axhline(1, color="0.6", linewidth=1)
axes[3].set(xlabel="x, forward [m]", ylabel="pixels a cell")
axes[3].set_xticks((10, 20, 50), labels=("10", "20", "50"))
axes[3].minorticks_off()
axes[3].legend(fontsize="x-small")
plt.show()

# %% [markdown]
# Red: one cell of half a metre in the compact network's image, each panel 18 pixels wide (white: below the border). 15
# m ahead it is already a slit, 40 m ahead a hair. On the right, the pixels of a cell by distance: straight lines that
# fall by three decades a decade. Below the grey line a cell has less than a pixel of its own: it says what its
# neighbours say. Count it: how many different pixels do the cells of the ground plane meet?

# %%
(pixels,), (visible,) = plane_pixels(spec, [0.0], compact)
x_cells = spec.centers()[..., 0]
for near, far in ((6, 20), (20, 40), (40, 71)):
    band = visible & (x_cells >= near) & (x_cells < far)
    different = np.unique(pixels[band].round(), axis=0)
    print(f"{near:>2} to {far} m ahead: {band.sum()} cells look into {len(different)} different pixels")

# %% [markdown]
# Half of the cells in view lie beyond 40 m, and live on a few rows of the image. No network can give to these cells
# what the image doesn't have: the paper's "closer objects are estimated better than distant ones" begins here.
#
# ## The wrong height
#
# So far each point had a height, and we found its pixel. Now somebody gives you a pixel that says *car*, and you look
# for its cell. If you know nothing, you assume that the world is flat: $\delta$ = 0. The top of a post, 1 m high, 10 m
# ahead of the toy car:
#
# **Predict before you run.** Draw the ray from the camera, 1.5 m up, over the top of the post, to the ground. How far
# ahead does it land? And over the roof of a car at 1.4 m? Over the sign at 2 m?
#
# <details><summary>Answer</summary>The ray sinks by 0.5 m in 10 m, so it has 1.5 m down after 30 m: 20 m behind the
# post. Over the roof it sinks by 0.1 m in 10 m: 150 m. Over the sign it rises: never.</details>
#
# Two similar triangles once more, from the camera's height down to the plane at $\delta$, and down to the thing at $z$:
#
# $$ x_\delta = x\, \frac{z_\text{cam} - \delta}{z_\text{cam} - z} $$


# %%
def lands_at(x, z, z_cam, delta=0.0):
    """Return how far ahead of the camera something, x metres ahead at height z, is drawn on a plane."""
    if (z_cam - delta) * (z_cam - z) <= 0:
        return np.nan  # the ray climbs and the plane is lower, or the other way round
    return x * (z_cam - delta) / (z_cam - z)


for z in (0.0, 0.5, 1.0, 1.4, 2.0):
    x_flat = lands_at(10, z, z_cam=1.5)
    if np.isfinite(x_flat):
        thing, drawn = np.array([0, 1.5 - z, 10]), np.array([0, 1.5, x_flat])
        np.testing.assert_allclose(project(thing, toy)[0], project(drawn, toy)[0])
    where = "nowhere" if np.isnan(x_flat) else f"{x_flat:.0f} m ahead"
    print(f"{z} m high, 10 m ahead: drawn on the ground {where}")

# %% [markdown]
# Both points have the same pixel: that is what the assertion says, by equation (1). It also says how much a *small*
# mistake costs. The same thing, 1 m high, on the plane at 0.9 m: $10 \cdot 0.6 / 0.5 = 12$ m; on the plane at 1.1 m, 8
# m. A mistake of 10 cm in height is 2 m on the map.
#
# Now the red car in front of us. Each of its pixels has its true depth; so go equation (1) backwards to its place.
# Where would a flat world draw it?

# %%
cars, _ = ndimage.label(frame.labels.image == KITTI_14.index("car"))
rows, cols = np.nonzero((cars == cars[150, 150]) & (frame.labels.depth < 11))
T_grid_from_camera = invert_rigid(camera.T_camera_from_grid)
eye = T_grid_from_camera[:3, 3]


def places_of(rows, cols, frame=frame):
    """Return what pixels see, in the grid frame, (N, 3): equation (1) backwards, with the true depth."""
    Z = frame.labels.depth[rows, cols].astype(float)
    triples = np.stack([cols, rows, np.ones_like(rows)]) * Z  # not yet divided
    return transform_points(T_grid_from_camera, (np.linalg.inv(camera.K) @ triples).T)


def drawn(delta):
    """Return where the car's pixels lie on a plane, (N, 2); NaN where their rays don't meet it."""
    down = (z_cam - delta) / (z_cam - places[:, 2])
    return np.where(down[:, None] > 0, eye[:2] + down[:, None] * (places - eye)[:, :2], np.nan)


places = places_of(rows, cols)
x_once = lands_at((places - eye)[0, 0], places[0, 2], z_cam)
np.testing.assert_allclose(drawn(0.0)[0, 0] - eye[0], x_once)
print(f"{len(places)} pixels of one car, {places[:, 0].min():.1f} to {places[:, 0].max():.1f} m ahead")

# %%
fig, axes = plt.subplots(1, 3, figsize=(9, 3.8), layout="constrained", width_ratios=(2, 1, 1))
axes[0].scatter(*places[::7, [0, 2]].T, s=2, c=plt.get_cmap("viridis")(places[::7, 2] / 1.7))
for z in (0.4, 0.9, 1.3):
    k = np.abs(places[:, 2] - z).argmin()
    axes[0].plot([eye[0], drawn(0.0)[k, 0]], [z_cam, 0], color="0.7", linewidth=0.8, zorder=0)
    axes[0].plot(drawn(0.0)[k, 0], 0, "x", color="tab:red")
axes[0].plot(eye[0], z_cam, "ks")
axes[0].set(xlabel="x, forward [m]", ylabel="height [m]", xlim=(-1, 41), ylim=(-0.1, 2))
for ax, delta in zip(axes[1:], (0.0, 0.8), strict=True):
    ax.scatter(*drawn(delta)[::3, ::-1].T, s=1, color="tab:red", label="drawn")
    ax.scatter(*places[::3, 1::-1].T, s=1, color="black", label="true")
    ax.set(xlim=(15.5, -5), ylim=(0, 50), aspect="equal", xlabel="y, to the left [m]", title=f"plane at {delta} m")
axes[1].set_ylabel("x, forward [m]")
axes[2].legend(markerscale=6, fontsize="small")
plt.show()

# %% [markdown]
# Left, from the side: the pixels of the car, coloured by height, the rays of three of them, and where the flat world
# puts these (crosses). In the middle, from above: the true places, black, are a small L, back and side of the car; red
# is the car on the ground plane, thrown over the map like the shadow that a lamp casts. Right, on the plane at 0.8 m:
# what is lower lies too near now, what is higher too far, and the top of the roof is still thrown more than 20 m.
#
# If we had the right height for each pixel, all would be well. With twenty planes, 20 cm apart, the right one is at
# most 10 cm away. How far off is each pixel on the best of the planes, if we take every plane, every second one, and so
# on?

# %%
truth = places[:, :2]
for D in (1, 2, 5, 10, 20):
    some_heights = plane_heights(20)[:: 20 // D]
    off = np.stack([np.linalg.norm(drawn(delta) - truth, axis=1) for delta in some_heights])
    median = np.median(np.nan_to_num(off, nan=np.inf).min(axis=0))
    print(f"{D:>2} {'planes' if D > 1 else 'plane '}: half of the car's pixels are less than {median:.1f} m off")

# %% [markdown]
# (Two planes, at 0 m and 2 m, are no better than one: the second is above the camera, and the rays of this car point
# down.) This is why there are twenty planes and not one. They don't *know* which height is right. They only make sure
# that a good answer is among those offered, here for half of the pixels less than a cell away, and leave the choice to
# what is learnt (lecture 08).

# %% [markdown]
# ## Play with it
#
# Drag the height of the plane. Where does the grid land in the image? At which height does the table top cut the red
# car's number plate, its roof, the heads of the cyclists? At which does it become a line, and what happens beyond?
# (Without a running kernel there is no slider; the figure below shows four heights.)


# %% tags=["nbval-ignore-output"]
def draw_plane(ax, height, colour_bar=True):
    """Draw where the grid, lifted to a height, lands in the image, and the horizon."""
    plotting.plane_on_image(coarse, height, pale, ax=ax, size=3, colour_bar=colour_bar)
    ax.plot((0, w - 1), (horizon(0, camera), horizon(w - 1, camera)), color="black", linewidth=0.6)
    share = plane_pixels(spec, [height], camera)[1].mean()
    ax.set_title(f"plane at {height:.2f} m: {100 * share:.0f} % of the cells in view", fontsize="medium")


def show(height):
    """Show the plane at the slider's height."""
    _, ax = plt.subplots(figsize=(10, 3.2), layout="constrained")
    draw_plane(ax, height)
    plt.show()


_ = interact(show, height=FloatSlider(value=0.0, min=0.0, max=3.8, step=0.05, description="height [m]"))

# %%
fig, axes = plt.subplots(2, 2, figsize=(8, 2.8), layout="constrained")
for ax, height in zip(axes.flat, (0.5, 1.2, 1.65, 3.0), strict=True):
    draw_plane(ax, height, colour_bar=False)
plt.show()

# %% [markdown]
# Black: the horizon. At 0.5 m and 1.2 m the grid is a table top, seen from above, flatter and flatter; at 1.65 m, half
# a centimetre below the camera, it is a line; at 3 m a ceiling, seen from below. In all four the same 71 m fit between
# the near edge and the horizon. (The number plate hangs at about 0.7 m: there the dots 6.5 m ahead run across it.)
#
# ## Where this breaks
#
# Equation (1) is exact. It is exact about a camera that is where you think it is, and about a point that you know to be
# there. Both are assumptions.
#
# ### One degree
#
# The camera is turned by $\psi$ = 1°, and nobody has told the calibration. For the toy camera each pixel is off by
# about 200 · tan 1° = 3.5.
#
# **Predict before you run.** In metres, 30 m ahead: how far is a cell off if the camera is turned to the side (yaw)?
# And if it nods (pitch), so that the row of the ground at 30 m, 48 + 300 / 30 = 58, is really row 54.5 or 61.5?
#
# <details><summary>Answer</summary>To the side: 30 · tan 1° = 0.52 m, one cell. Nodding: rows 6.5 and 13.5 below the
# horizon are 300 / 6.5 = 46 m and 300 / 13.5 = 22 m: 16 m too far, or 8 m too near. The same degree, and up to
# thirty times the error: the camera looks at the road at a very flat angle.</details>
#
# With $\tan\psi \approx \psi$ the focal length drops out: yaw moves a place by $x\,\psi$, and pitch makes a place of
# the ground at $x$ read another one, at $x'$ (minus with the nose up, plus with the nose down):
#
# $$ \frac{1}{x'} = \frac{1}{x} \mp \frac{\psi}{z_\text{cam}} $$


# %%
def turned(camera, axis, degrees):
    """Return the camera after a small turn about its own axis: "x" nods, "y" turns to the side."""
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    T = rigid_transform(turn, np.zeros(3)) @ camera.T_camera_from_lidar
    return Camera(camera.K, T, camera.size, camera.lidar_height)


def read_instead(x, camera, truly):
    """Return the place on the ground, x and y, that is really seen where the calibration expects (x, 0)."""
    u, v = project(transform_points(camera.T_camera_from_grid, np.array([x, 0.0, 0])), camera)[0]
    back = invert_rigid(truly.T_camera_from_grid)
    ray = back[:3, :3] @ np.linalg.inv(truly.K) @ [u, v, 1]
    return (back[:3, 3] - back[2, 3] / ray[2] * ray)[:2] if ray[2] < 0 else np.full(2, np.nan)


for name, axis, sign in (("nose down", "x", 1), ("nose up", "x", -1), ("to the side", "y", 1)):
    x, y = read_instead(30.0, toy, turned(toy, axis, sign))
    if axis == "x":
        np.testing.assert_allclose(1 / x, 1 / 30 + sign * np.radians(1) / 1.5, rtol=0.01)
    print(f"{name:<12} the cell 30 m ahead reads the ground {x:.1f} m ahead, {abs(y):.1f} m to the side")

# %%
fig, axes = plt.subplots(1, 3, figsize=(8, 2.9), layout="constrained", width_ratios=(1.5, 1, 1))
x = np.linspace(6.5, 60, 100)
axes[0].plot([0, 60], [0, 60], color="0.6", linewidth=1, label="as calibrated")
for degrees, style in ((0.25, ":"), (0.5, "--"), (1.0, "-")):
    for sign, colour in ((1, "tab:blue"), (-1, "tab:red")):
        read = [read_instead(a, camera, turned(camera, "x", sign * degrees))[0] for a in x]
        label = f"{degrees}° nose {'down' if sign > 0 else 'up'}"
        axes[0].plot(x, read, style, color=colour, label=label)
axes[0].set(xlabel="cell, x [m]", ylabel="reads the ground at x [m]", xlim=(0, 60), ylim=(0, 60))
axes[0].legend(fontsize="x-small")
for ax, degrees in zip(axes[1:], (0, 1), strict=True):
    wrong = turned(camera, "y", degrees)
    plotting.points_on_image(replace(frame, camera=wrong), ax, size=6, colour_bar=False)
    ax.set(xlim=(430, 510), ylim=(180, 75))
    ax.set_title(f"calibration turned by {degrees}°", fontsize="medium")
plt.show()

# %% [markdown]
# Left, the drive's camera: with the nose one degree down, the cell at 30 m gets the label of the road at 23 m; with the
# nose one degree up, the cell at 37 m gets that of 60 m. Half a degree is about what a car nods when it brakes gently.
# Right, LIDAR points with the calibration as it is and turned to the side by a degree: 6 pixels, and the nearer points
# (lighter) that belong on the pole hang in the air beside it. Sideways you see a wrong calibration at once; in pitch
# you hardly do, and that is where it hurts.
#
# ### The ground isn't flat
#
# A road that climbs by 4 % from 10 m on is 1.2 m high 40 m ahead. The plane $\delta$ = 0 lies far below it there: its
# cell at 40 m looks along a ray that sinks by 1.5 m in 40 m, and meets the road earlier, where $1.5 - 0.0375\,x =
# 0.04\,(x - 10)$, so at 24.5 m. But the plane at 1.2 m is in place.
#
# **Predict before you run.** And if the road falls by 4 %?
#
# <details><summary>Answer</summary>The ray of the cell at 40 m sinks by 3.75 % and the road by 4: they never meet, the
# cell reads the sky or whatever stands on the way. And no plane helps, since none lies below zero.</details>

# %%
for side, name in ((0.04, "uphill"), (-0.04, "downhill")):
    for x in (20, 30, 40):
        z_road = side * (x - 10)
        meets = (1.5 + side * 10) / (1.5 / x + side)  # 1.5 - 1.5 / x * meets = side * (meets - 10)
        reads = f"reads the road at {meets:.1f} m" if meets > 0 else "never reads the road"
        off = np.abs(plane_heights() - z_road).min()
        print(f"{name:<9} the ground plane's cell at {x} m {reads}; the nearest plane is off by {off:.1f} m")

# %% [markdown]
# **Uphill, the twenty planes help; downhill nothing does.**
#
# ### No depth: two places, one pixel
#
# 30 m ahead on the ground, and 10 m ahead, 1 m up: you computed that the toy camera sees both in row 58. It *sees* only
# one of them, the nearer. Equation (1) gives the pixel to both. What stands in front paints itself on every cell behind
# it, and "visible" doesn't help: it only means *in the image*.
#
# **Predict before you run.** In the last frame of the drive, of all cells whose point on the ground lies in the image:
# how many does the camera not see, since something is in the way?
#
# <details><summary>Answer</summary>More than half, 57 %; over the whole drive 45 to 58 %. Behind the first row of cars,
# hedges and fences the map from above is mostly what *isn't* in the picture.</details>

# %%
(pixels,), (visible,) = plane_pixels(spec, [0.0], camera)
cols, rows = pixels[visible].round().astype(int).T
hidden, label = np.zeros(spec.shape, bool), np.full(spec.shape, 255)
hidden[visible] = places_of(rows, cols)[:, 2] > 0.3  # what the pixel sees isn't the ground
label[visible] = frame.labels.image[rows, cols]
maps = {"what the ground plane reads": label, "truth": frame.labels.birdseye_on(spec)}
fig = plotting.label_maps(spec, maps, KITTI_14)
for ax in fig.axes:
    ax.contourf(spec.centers()[0, :, 1], spec.centers()[:, 0, 0], hidden, [0.5, 1.5], colors="none", hatches=["////"])
plt.show()
shares = [100 * (places_of(rows, cols, other)[:, 2] > 0.3).mean() for other in drive]
print(f"{shares[-1]:.0f} % of the cells in the image are hidden behind something", end="; ")
print(f"in the other frames {min(shares):.0f} to {max(shares):.0f} %")
right = (label == frame.labels.birdseye_on(spec))[visible & ~hidden].mean()
print(f"of the others {100 * right:.0f} % read their true class")

# %% [markdown]
# Left: the true labels of the image, laid on the ground by equation (1); right: the true map; hatched: hidden cells.
# Where nothing is hatched five cells in six agree: that is equation (1) at work. (The sixth lies on an edge, below a
# car or at the foot of a fence, or so far ahead that one pixel is metres deep.) Where it is hatched, the left map shows
# what stands in front, drawn out to the edge of the grid: the cars on the left, the cyclists (dark red), the pedestrian
# (red) and the fence on the right. No camera model repairs that. The LIDAR knows which cells are hidden, and the
# occupancy grid calls them UNKNOWN: this is why the paper needs both.
#
# ## In five lines
#
# 1. $(X/Z, Y/Z)$ is the picture one metre ahead; $K$ turns it into pixels. Resized, $K$ moves by half pixels; cropped,
#    it shifts.
# 2. Transforms are read by names, right to left; the inverse undoes the shift first, then the turn.
# 3. Every place has one pixel, (1); a pixel has a whole ray of places. All planes meet at the horizon, and the one at
#    the camera's height is seen edge-on.
# 4. Pixels a cell fall like $Z^{-3}$; the error of a wrong height grows like $1 / (z_\text{cam} - z)$. Twenty planes
#    keep the right height among the answers.
# 5. In front of the camera *and* in the image is not yet seen: (1) knows neither depth, nor slopes, nor that the car
#    nods.
#
# ## Further reading
#
# - Hartley, Zisserman, *Multiple View Geometry in Computer Vision*, 2nd edition, Cambridge 2004, chapters 6 and 8: the
#   camera matrix, vanishing points and the horizon.
# - Zhang, *A flexible new technique for camera calibration*, PAMI 22(11), 2000: where $K$ comes from.
# - Geiger, Lenz, Stiller, Urtasun, *Vision meets robotics: the KITTI dataset*, IJRR 32(11), 2013: the sensors, their
#   frames and their calibration.
# - Mallot, Bülthoff, Little, Bohrer, *Inverse perspective mapping simplifies optical flow computation and obstacle
#   detection*, Biological Cybernetics 64, 1991: the flat world, and what stands up in it.
# - Roddick, Kendall, Cipolla, *Orthographic feature transform for monocular 3D object detection*, BMVC 2019: the same
#   idea as the paper's planes, with boxes.
# - Philion, Fidler, *Lift, splat, shoot*, ECCV 2020: the other way round, pixels that guess their depth.
#
# ## Exercise
#
# [Exercise 05](exercises/05_pixels.ipynb): a cropped and resized camera, the way from one frame to another, the pixels
# of a plane, what a wrong height costs, how far a cell has a pixel, and one question. Next: lecture 06, reading between
# pixels.

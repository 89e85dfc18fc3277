# %% [markdown]
# # 05 · From grid to pixel: equation (1)
#
# **In one sentence.** A pixel doesn't tell how far away the thing is that it shows, but a point in space has one
# pixel, or none when it is out of view; so we lay planes over the grid, at several heights, and look up the pixel of
# every point of every plane.
#
# **You will be able to**
# - find the pixel of a point by similar triangles, and say what $K$ does to it;
# - change $K$ when an image is resized or cropped, without losing half a pixel;
# - read, compose and invert transforms by their names;
# - compute the pixels of a whole plane, with a mask for what lies behind the camera or outside the image;
# - say what a wrong height, a hidden cell and a wrong angle do to the map, and what equation (1) leaves out as a
#   graphical model.
#
# **Prerequisites.** Lecture [00](00_tour.ipynb): the grid, a first look at equation (1). A matrix times a vector; a
# rotation as a matrix. For the graph: [graphical models](01b_graphical_models.ipynb).
#
# **Time.** 118 minutes; the computer needs less than one.
#
# **Paper.** Section 3.3, equation (1).

# %% jupyter={"source_hidden": true}
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown
from ipywidgets import FloatSlider, interact
from scipy import ndimage
from scipy.spatial.transform import Rotation

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.graphical import d_separated
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import plane_pixels
from worlds.lecture_00_ledger import ledger, ledger_table
from worlds.lecture_05_pixel_ray import CAR_HEIGHTS, cell_by_cell, exact_ray, occlusion_cost, pixel_height, pixel_ray

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"
ROAD, SIDEWALK, CAR = (KITTI_14.index(name) for name in ("road", "sidewalk", "car"))
spec, drive = GridSpec.compact(), sample_drive()
frame = drive[len(drive) - 1]
camera, (h, w) = frame.camera, frame.camera.size
T_grid_from_camera = invert_rigid(camera.T_camera_from_grid)
eye = T_grid_from_camera[:3, 3]
z_cam = eye[2]

# %% jupyter={"source_hidden": true}


def paled(frame):
    """Return the frame with a grey, light image, to draw on."""
    grey = (120 + frame.image.mean(axis=2, keepdims=True) // 16 * 8).astype(np.uint8)
    return replace(frame, image=np.repeat(grey, 3, axis=2))


def places_of(rows, cols, frame=frame):
    """Return what pixels see, in the grid frame, (N, 3): equation (1) backwards, with the simulator's true depth."""
    Z = frame.labels.depth[rows, cols].astype(float)
    triples = np.stack([cols, rows, np.ones_like(rows)]) * Z  # not yet divided by Z
    return transform_points(T_grid_from_camera, (np.linalg.inv(camera.K) @ triples).T)


pale = paled(frame)
coarse = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, cell=1.0)  # to draw, so that dots stay apart
instances, _ = ndimage.label(frame.labels.image == CAR)
is_red_car = (instances == instances[140, 120]) & (frame.labels.depth < 13)
car = places_of(*np.nonzero(is_red_car))
pale.image[is_red_car] = pale.image[is_red_car] // 2 + np.array([110, 10, 10], np.uint8)

# %% [markdown]
# ## A plane that rises through the street
#
# To bring classes from pixels to cells of the map we need to know which pixel belongs to which cell. Watch what happens
# when we lift the grid, as a flat sheet of points, from one metre below the ground to three metres above it:


# %% jupyter={"source_hidden": true}
def read_at(height):
    """Return what cells read from the true labels, (H, W) each: the class (255 out of view), whether the red car."""
    (pixels,), (visible,) = plane_pixels(spec, [height], camera)
    read, red = np.full(spec.shape, 255), np.zeros(spec.shape, bool)
    cols, rows = pixels[visible].round().astype(int).T
    read[visible], red[visible] = frame.labels.image[rows, cols], is_red_car[rows, cols]
    return read, red


def draw_read(height, ax):
    """Draw the map that a plane reads, and mark the cells that read the red car and its true place."""
    read, red = read_at(height)
    plotting.grid_labels(spec, read, KITTI_14, ax=ax)
    ax.plot(*spec.centers()[red][:, ::-1].T, "s", color="tab:red", markersize=1.8, label="the red car")
    ax.plot(*car[::60, 1::-1].T, "k.", markersize=3, label="its true place")
    ax.set_ylim(0, 45)
    named, style = ax.get_legend().legend_handles + ax.get_lines(), {"fontsize": "small", "frameon": False}
    ax.legend(handles=named, loc="upper left", bbox_to_anchor=(1.02, 1), markerscale=3, **style)


# %% jupyter={"source_hidden": true} alt="animation: A, a sheet of coloured dots rises through the camera image of a street with one car marked in red, and becomes a line at the camera's height; B, seen from the side, it cuts through the red car; C, the map of classes read on the sheet, with red dots where a cell reads the red car: a long smear from its place outwards on the ground plane, and a shorter one on both sides of its place at 0.8 m"


def raised():
    """Yield the figure with the plane at each height."""
    fig = plt.figure(figsize=(8.4, 4.3), layout="constrained")
    for height in (-1, -0.5, 0, 0.4, 0.8, 1.2, z_cam, 2, 2.5, 3):
        fig.clear()
        axes = fig.subplot_mosaic([["A", "C"], ["B", "C"]], width_ratios=(2.7, 1), height_ratios=(1.6, 1))
        plotting.plane_on_image(coarse, height, pale, ax=axes["A"], size=2, colour_bar=False)
        axes["B"].scatter(*car[::7, [0, 2]].T, s=1, color="tab:red")
        axes["B"].plot([0, 40], [height] * 2, "C0", eye[0], z_cam, "ks")
        axes["B"].set(xlim=(-1, 41), ylim=(-1.2, 3.2), xlabel="x, forward [m]", ylabel="height [m]")
        draw_read(height, axes["C"])
        for letter, ax in axes.items():
            ax.set_title(f"A: plane at {height:.1f} m" if letter == "A" else letter, fontsize="medium")
        yield fig


plotting.animate(
    raised(), period=0.4, alt="a plane of points rises through the street, and the map that it reads changes"
)

# %% [markdown]
# A: each dot is the centre of a square of 1 m, drawn at its pixel; nearer cells are lighter. B: the same from the side, with
# the pixels of the red car where they really are. The black square is the camera. C: the map of classes that the
# plane reads. Bright red are the cells that read the red car (*pedestrian* is darker), black is its true place. At
# 0 m the car is thrown over the map like a shadow. At 0.8 m, in the middle of its bodywork, the smear is shorter and
# lies on both sides of the true place. At the camera's own height the sheet becomes a line, and above it the map
# shows what is high: trees, houses, sky. **No height is right for everything.**
#
# ### The graph
#
# As a graphical model: four cells lie in a row, straight ahead: $m_1$ to $m_4$, each road or car.
# $a_j$ is the label of the pixel that looks at the *ground* in cell $j$. Its ray passes over all cells before it: here
# the car in cell 3 also blocks the ray to cell 4 (blue pixels say *car*). Equation (1) knows of one arrow only,
# $m_j \to a_j$:

# %% jupyter={"source_hidden": true} alt="a sketch from the side: a camera, its four pixels, and their rays to the ground in four cells; a car in cell 3 blocks the rays to cells 3 and 4"
colours = KITTI_14.colours(np.array([ROAD, ROAD, CAR, CAR])) / 255
fig, side = plt.subplots(figsize=(5.6, 3.2), layout="constrained")
side.add_patch(plt.Rectangle((7.1, 0), 1.8, 1.3, color=colours[2], alpha=0.4))
for j, (x, colour) in enumerate(zip((4, 6, 8, 10), colours, strict=True), start=1):
    stop = np.array([0, min(x, 7.1), x])  # camera, first thing, ground
    side.plot(stop[:2], 3 - 3 * stop[:2] / x, color=colour, linewidth=1.2)
    side.plot(stop[1:], 3 - 3 * stop[1:] / x, ":", color="0.4", linewidth=1.2)
    side.plot(2.8, 3 - 3 * 2.8 / x, "s", color=colour, markersize=6)
    right, up = {3: (-0.36, 0.09), 4: (0, 0.35)}.get(j, (0, -0.1))  # where no other square or ray lies
    side.text(2.8 + right, 3 - 3 * 2.8 / x + up, f"$a_{j}$", ha="center", va="top", fontsize=9)
    side.plot([x - 0.9, x + 0.9], [0, 0], color="black", linewidth=3, solid_capstyle="butt")
    side.text(x, -0.15, f"$m_{j}$", ha="center", va="top")
side.plot(0, 3, "ks")
side.set(xlim=(-0.4, 11), ylim=(-0.6, 3.2), title="A car in cell 3, from the side")
side.axis("off")
plt.show()

# %% [markdown]
# **Predict before you run.** The four pixels say road, car, car, car. Three cars, or one? Each cell is a car with
# probability 0.2 beforehand, and a pixel's label is right with 0.95. Draw the graph. Are $m_1$ and $m_3$ independent,
# before the pixels are known and once $a_3$ is known?
#
# <details><summary>Answer</summary>
#
# One car in cell 2 explains all three labels. So cell 2 is a car with 0.91, and the cells behind it stay near their
# prior, 0.23 and 0.20: behind a car the image says nothing. Equation (1) gives each cell its own pixel: 0.83 three
# times. $m_1$ and $m_3$ are independent beforehand; given $a_3$, their common child, they compete to explain it.
#
# </details>

# %% jupyter={"outputs_hidden": true}
stage, labels = pixel_ray(), [0, 1, 1, 1]
print("exact,        P(car):", exact_ray(labels).round(2))
print("equation (1), P(car):", cell_by_cell(labels).round(2))
print("by how much (1) is off, mean over all labels:", occlusion_cost().round(2))
assert d_separated(stage.model, "m1", "m3")
assert not d_separated(stage.model, "m1", "m3", given=("a3",))

# %% [markdown]
# Here is the graph:

# %% tags=["graph"] jupyter={"source_hidden": true, "outputs_hidden": true} alt="a directed graph: four cells m1 to m4 above, four observed pixels a1 to a4 below; each pixel has arrows from its own cell and from all nearer ones; one of the slanted arrows is dashed and carries its price"
fig, ax = plt.subplots(figsize=(5.4, 3.2), layout="constrained")
stage.draw(ax)
plt.show()

# %% [markdown]
# Equation (1) cuts every slanted arrow, $m_i \to a_j$ with $i < j$: *occlusion*. One of them is dashed, with its
# price. With these numbers the error grows along the ray, because more can stand in front of a cell that is farther
# away. Nothing in this lecture repairs it; the LIDAR can help (lecture 08).
#
# ## Two similar triangles
#
# Now the geometry. Take a box with a tiny hole in front and a film 200 pixels behind the hole (its focal
# length, measured in the film's own pixels). Ten metres ahead stands a pole, 2 m tall. Light runs straight through the
# hole, so the pole and its picture (upside down) are two triangles of the same shape: 200 · 2 / 10 = 40 pixels.
#
# **Predict before you run.** How tall is the picture when the pole is 20 m away? And that of a pole of 20 cm, 1 m
# away?
#
# <details><summary>Answer</summary>
#
# 20 pixels: twice as far, half as tall. The small one: 200 · 0.2 / 1 = 40 pixels, the same as the real pole at 10 m. A
# picture cannot tell a small thing nearby from a big one far away.
#
# </details>
#
# Count pixels to the right and down, from the first pixel's centre; the camera's axis meets the film at the *principal
# point* $(c_u, c_v)$, and $f_u, f_v$ are the *focal lengths* in pixels. With $X$ to the right, $Y$ down, $Z$ ahead:
#
# $$ u - c_u = f_u \frac{X}{Z}, \qquad v - c_v = f_v \frac{Y}{Z} $$


# %% jupyter={"outputs_hidden": true}
def pinhole(X, Y, Z, f_u=200, f_v=200, c_u=160, c_v=48):
    """Return u and v of a point: two similar triangles."""
    return c_u + f_u * X / Z, c_v + f_v * Y / Z


K = np.array([[200.0, 0, 160], [0, 200, 48], [0, 0, 1]])
for name, point in {"10 m ahead": (0, -2, 10), "20 m ahead": (0, -2, 20), "20 cm, 1 m": (0, -0.2, 1)}.items():
    package, _ = project(np.array(point, float), Camera(K, np.eye(4), size=(96, 320)))
    np.testing.assert_allclose(pinhole(*point), package)
    print(f"top of the pole, {name}: {48 - package[1]:.0f} pixels above the axis")

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="three poles seen from the side; the rays from the hole to the top of the pole ten metres ahead and of the small one one metre ahead are the same line"
fig, ax = plt.subplots(figsize=(7.5, 2.4), layout="constrained")
for Z, top, colour in ((10, 2.0, "tab:blue"), (20, 2.0, "tab:orange"), (1, 0.2, "tab:green")):
    ax.plot([0, Z], [0, top], color=colour, linewidth=0.8)
    ax.plot([Z, Z], [0, top], color=colour, linewidth=4, solid_capstyle="butt")
    ax.text(Z + 0.2, top, f"{top:g} m, {Z} m ahead", color=colour, va="center")
ax.axvline(1, color="0.7", linestyle=":")
ax.plot(0, 0, "ko")
ax.set(xlabel="Z, ahead of the hole [m]", ylabel="up, −Y [m]", ylim=(-0.3, 2.3), xlim=(-0.5, 25))
plt.show()

# %% [markdown]
# Blue and green share one ray, so they share a pixel. The dotted line stands one metre ahead: a ray meets it at $(X/Z,
# Y/Z)$. The picture is what you see on that line, in pixels instead of metres, and this change of unit is what the
# numbers $f$ and $c$ do.
#
# ## One matrix, and the division last
#
# A camera shifts (by $c$), scales (by $f$) and divides (by $Z$). The division is not linear, so do it last and carry a
# third number along. The point (1.5, 1, 10): $K$ times it is (200 · 1.5 + 160 · 10, 200 · 1 + 48 · 10, 10) = (1900,
# 680, 10). Divide by the last number: (190, 68). The points (3, 2, 20) and (0.15, 0.1, 1) give (190, 68) too, since
# multiples of one triple are one pixel, as all points of one ray are. Triples read like this are called *homogeneous
# coordinates*; $K$ is the *intrinsic matrix*.
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
    print(f"{point!s:<14} -> {pixel(np.array(point), K).round(6).tolist()}")

# %% [markdown]
# **Predict before you run.** Two rails run straight ahead, 1.5 m to the left and to the right, 1.5 m below the camera:
# the points $(\pm 1.5, 1.5, Z)$. At $Z$ = 10 they are at u = 160 ± 30, at 20 at 160 ± 15. Where do they meet?
#
# <details><summary>Answer</summary>
#
# As $Z$ grows, $X/Z$ and $Y/Z$ go to 0: at (160, 48), the principal point. Wherever they start, all lines in this
# direction end in this one point, the direction's *vanishing point*.
#
# </details>
#
# On the drive, the sidewalk on the right has two straight edges, 2.1 m and 4.45 m to the right of the vehicle. Draw the
# two lines on the ground, at height 0, through equation (1):

# %% jupyter={"outputs_hidden": true}
straight_on = camera.K @ camera.T_camera_from_grid[:3, :3] @ np.array([1.0, 0, 0])  # the grid's forward direction
vanishing = straight_on[:2] / straight_on[2]
print("what runs straight ahead ends at u = {:.0f}, v = {:.0f}".format(*vanishing))
for y, side in ((-2.1, 0), (-4.45, -1)):
    u, v = project(transform_points(camera.T_camera_from_grid, np.array([8.0, y, 0])), camera)[0]
    edge = np.flatnonzero(frame.labels.image[round(v)] == SIDEWALK)[side]
    print(f"line {-y:.2f} m to the right, 8 m ahead: u = {u:.0f}; the sidewalk ends at {edge}: {edge - u:+.0f} pixels")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="the image with two red lines on the ground that meet at the vanishing point; the left one, A, runs along the foot of the kerb, the right one, B, runs inside the sidewalk instead of along its edge; a dashed line 16 cm higher fits near by"
fig, ax = plt.subplots(figsize=(7.5, 3.4), layout="constrained")
ax.imshow(pale.image)
for y, z, style in ((-2.1, 0.0, "-"), (-4.45, 0.0, "-"), (-4.45, 0.16, "--")):
    rail = np.array([[x, y, z] for x in np.geomspace(6, 1000, 200)])
    pixels, visible = project(transform_points(camera.T_camera_from_grid, rail), camera)
    ax.plot(*pixels[visible].T, style, color="tab:red", linewidth=1.2)
for letter, at, text in (("A", (400, 162), (360, 172)), ("B", (517, 164), (470, 178)), ("C", (532, 162), (560, 150))):
    ax.annotate(letter, at, text, color="tab:blue", fontweight="bold", arrowprops={"arrowstyle": "->"})
ax.plot(*vanishing, "+", color="tab:red", markersize=16, markeredgewidth=2)
ax.set(xlim=(270, 610), ylim=(187, 60), xlabel="u [pixels]", ylabel="v [pixels]")
plt.show()

# %% [markdown]
# The cross is the vanishing point. A fits within a few pixels. B doesn't: 8 m ahead it misses the edge by 24 pixels,
# half a metre. The calibration is
# right and so is the code. What is wrong is "on the ground": A runs at the foot of the kerb, but the sidewalk lies *on*
# it. The miss even tells how high, by similar triangles: the ray through the edge meets the ground farther out than the
# edge is.

# %%
outwards = 4.45 + eye[1]  # of the camera, which stands a little to the left
u, v = project(transform_points(camera.T_camera_from_grid, np.array([8.0, -4.45, 0])), camera)[0]
edge = np.flatnonzero(frame.labels.image[round(v)] == SIDEWALK)[-1]
meets = outwards + (edge - u) * 8 / camera.K[0, 0]
height = z_cam * (1 - outwards / meets)
(true_height,) = places_of(np.array([round(v)]), np.array([edge]))[:, 2]
assert abs(height - true_height) < 0.03
print(f"line {outwards:.2f} m from the camera, ray {meets:.2f} m: the sidewalk is {height:.2f} m high", end=", ")
print(f"by the simulator {true_height:.2f} m")

# %% [markdown]
# That is the kerb, and the slopes of road and sidewalk. Drawn at 16 cm, the line fits near by (C, dashed); farther
# ahead the street sinks. So 17 cm of height are half a metre on the map: this is why the system needs several planes.
#
# ## A new image, a new $K$
#
# Networks see smaller images, and often only a part. Take a row of 8 pixels with its axis in the middle, at $c_u$ =
# 3.5, and $f_u$ = 10. Average the pixels in pairs: 4 are left.
#
# **Predict before you run.** The new $c_u$? The new $f_u$? And if you cut two pixels off on the left instead?
#
# <details><summary>Answer</summary>
#
# The middle of 4 pixels, at 0, 1, 2, 3, is 1.5. Not 3.5 / 2 = 1.75! The image begins half a pixel *before* the centre
# of its first pixel, and that edge is what stays in place: 3.5 + 0.5 = 4 pixels from the edge, half of them is 2,
# less 0.5. The focal length is only scaled: 5. A cut shifts: $c_u$ = 1.5, and $f_u$ is still 10.
#
# </details>
#
# From $w \times h$ to $w' \times h'$ pixels, and with $u_0$ columns cut off on the left (the same for $v$):
#
# $$ \text{resized:} \quad f_u' = f_u \frac{w'}{w}, \quad c_u' = \left(c_u + \tfrac12\right) \frac{w'}{w} - \tfrac12
#    \qquad\qquad \text{cropped:} \quad f_u' = f_u, \quad c_u' = c_u - u_0 $$


# %% jupyter={"outputs_hidden": true}
def resize(scale_u, scale_v):
    """Return the matrix that takes pixels of an image to those of a resized one."""
    return np.array([[scale_u, 0, (scale_u - 1) / 2], [0, scale_v, (scale_v - 1) / 2], [0, 0, 1]])


def crop(left, top):
    """Return the matrix that takes pixels of an image to those of a part of it."""
    return np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])


row = np.array([[10, 0, 3.5], [0, 10, 0], [0, 0, 1]])
print("halved: f_u, c_u =", (resize(0.5, 1) @ row)[0, ::2], "  cropped:", (crop(2, 0) @ row)[0, ::2])
np.testing.assert_allclose(resize(320 / w, 96 / h) @ camera.K, camera.resized((96, 320)).K)

# %% [markdown]
# Is it true of pictures, too? Paint a soft dot on a black image at the pixel of a place 15 m ahead. Cut off the first
# column, halve the rest, and ask where the dot's middle is now.

# %% jupyter={"source_hidden": true}
place = transform_points(camera.T_camera_from_grid, np.array([15.0, 2.0, 1.0]))
(u, v), (columns, rows) = pixel(place, camera.K), np.meshgrid(np.arange(w), np.arange(h))
dot = 255 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 5**2))
part = np.dstack([dot.round().astype(np.uint8)] * 3)[:, 1:]
small = resize_image(part, (94, 310))[..., 0].astype(float)
middle = np.array([small.sum(axis=0) @ np.arange(310), small.sum(axis=1) @ np.arange(94)]) / small.sum()
np.testing.assert_allclose(middle, pixel(place, resize(0.5, 0.5) @ crop(1, 0) @ camera.K), atol=0.02)
careless = pixel(place, np.diag([0.5, 0.5, 1]) @ crop(1, 0) @ camera.K)
print(
    "the rule finds the dot; K times one half misses it by {:.2f} and {:.2f} pixels".format(*np.abs(careless - middle))
)

# %% [markdown]
# A quarter of a pixel, and no error message. Lecture 06 turns such errors into metres.
#
# ## Where the camera stands: reading names
#
# Until now points were given in the camera's frame. The map has its own. In a toy car the LIDAR is 2 m above the
# ground, the camera 0.5 m below the LIDAR and looks ahead. A post stands 10 m ahead, 2 m to the right; its top is 0.5 m
# above the ground. Three frames, three triples for one place:
#
# | frame | axes | origin | top of the post |
# |---|---|---|---|
# | grid | x forward, y left, z up | on the ground below the LIDAR | (10, -2, 0.5) |
# | LIDAR | the same | 2 m higher | (10, -2, -1.5) |
# | camera | X right, Y down, Z ahead | 0.5 m below the LIDAR | (2, 1, 10) |
#
# Each step turns and shifts. As 4 x 4 matrices on $(x, y, z, 1)$ a turn with its shift is one factor (the *extrinsic*
# calibration), and the names tell the order: **neighbours that are equal cancel**, from right to left.
#
# $$ T_\text{camera←grid} = T_\text{camera←lidar}\; T_\text{lidar←grid}, \qquad
#    T = \begin{pmatrix} R & t \\ 0 & 1 \end{pmatrix}, \qquad
#    T^{-1} = \begin{pmatrix} R^\top & -R^\top t \\ 0 & 1 \end{pmatrix} $$
#
# **Predict before you run.** $T^{-1}$ of `T_camera_from_grid` is called `T_grid_from_camera`. What does it make of (0,
# 0, 0), in the toy car? And why is it not simply $-t$?
#
# <details><summary>Answer</summary>
#
# The camera's own place, seen from the grid: (0, 0, 1.5). The shift $t$ = (0, 1.5, 0) is written in the *camera's*
# axes, where down is $Y$. Its negative would put the camera 1.5 m to the right.
#
# </details>

# %% jupyter={"outputs_hidden": true}
axes_of_camera = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # X is -y, Y is -z, Z is x


def inverse(T):
    """Return the way back: undo the shift, then the turn."""
    R, t = T[:3, :3], T[:3, 3]
    return rigid_transform(R.T, -R.T @ t)


T_camera_from_lidar = rigid_transform(axes_of_camera, np.array([0, -0.5, 0]))
T_camera_from_grid = T_camera_from_lidar @ rigid_transform(np.eye(3), np.array([0, 0, -2.0]))
toy = Camera(K, T_camera_from_lidar, size=(96, 320), lidar_height=2.0)
np.testing.assert_allclose(T_camera_from_grid, toy.T_camera_from_grid)
np.testing.assert_allclose(inverse(T_camera_from_grid), invert_rigid(T_camera_from_grid))
print("post, from the camera:", (T_camera_from_grid @ [10, -2, 0.5, 1])[:3])
print("camera, from the grid:", inverse(T_camera_from_grid)[:3, 3] + 0.0)  # + 0.0 makes 0 of -0

# %% [markdown]
# ## Equation (1) for a plane
#
# Now everything in turn, for the top of the post: grid (10, -2, 0.5), camera (2, 1, 10), pixel u = 160 + 200 · 2 / 10 =
# 200, v = 48 + 200 · 1 / 10 = 68. A plane is many such points: the centres of all cells, lifted to one height
# $\delta_d$. Straight ahead of the toy car, a point of the plane at $\delta$ is 1.5 - $\delta$ metres lower than the
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
# <details><summary>Answer</summary>
#
# 48, four times: the plane at the camera's own height is seen edge-on, as a line. All rows tend to 48, the *horizon*:
# infinitely far ahead, 1 m up or down makes no difference. The ground 5 m ahead, row 108, lies below the lower border.
#
# </details>
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

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="rows of the image against the distance ahead, for planes at six heights: lower planes climb towards the horizon at row 48, higher ones sink to it, the one at 1.5 m is a level line"
fig, ax = plt.subplots(figsize=(7.5, 2.9), layout="constrained")
ahead = GridSpec(x_min=0, x_max=60, y_min=-0.1, y_max=0.1, cell=0.2)
toy_heights = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0]
toy_pixels, toy_visible = plane_pixels(ahead, toy_heights, toy)
for height, pixels, visible in zip(toy_heights, toy_pixels, toy_visible, strict=True):
    colour = plt.get_cmap("viridis")(height / 3.3)
    ax.plot(ahead.centers()[:, 0, 0], pixels[:, 0, 1], color=colour, label=f"{height} m")
    first = np.flatnonzero(visible[:, 0]).max()
    ax.plot(ahead.centers()[first, 0, 0], pixels[first, 0, 1], "o", color=colour)
ax.axhspan(-0.5, 95.5, color="0.93", zorder=0)
ax.set(xlabel="x, forward [m]", ylabel="v, down [pixels]", xlim=(0, 60), ylim=(115, -20))
ax.legend(title="plane at", loc="center left", bbox_to_anchor=(1, 0.5))
plt.show()

# %% [markdown]
# Grey: the image. Each curve is a plane, straight ahead; the dot is where it comes into view. **All planes meet at the
# horizon**, which is also where the plane at the camera's height lies. So whatever is higher than the camera rises
# above the horizon *at any distance*, and all heads in a crowd are on one line if you are as tall as they are. Near the
# car the curves are far apart; sixty metres ahead, three metres of height are ten rows.
#
# ## Behind the camera, outside the image
#
# The grid may reach behind the car.
#
# **Predict before you run.** What does the formula alone say of a place 10 m *behind* the toy camera, 2 m to the left,
# on the ground: $(-2, 1.5, -10)$? Would you notice that something is wrong?
#
# <details><summary>Answer</summary>
#
# u = 160 + 200 · (-2) / (-10) = 200 and v = 48 + 200 · 1.5 / (-10) = 18: a fine pixel, in the sky on the right. Two
# minus signs have cancelled. You would not notice: no error, no NaN, only ground that is taken from the sky.
#
# </details>

# %% jupyter={"outputs_hidden": true}
behind = np.array([-2, 1.5, -10])
print("formula alone: u = {:.0f}, v = {:.0f}".format(*pinhole(*behind)))
print("package:", project(behind, toy)[0], " in view:", project(behind, toy)[1])
(ground,) = plane_pixels(spec, [0.0], camera)[1]
print(f"of the course's grid {100 * ground.mean():.0f} % is in view on the ground plane of the drive's camera")

# %% [markdown]
# So a point is **in view** if it lies in front of the camera *and* its pixel lies between the outermost *centres* of
# the image's pixels, $0 \le u \le w - 1$, $0 \le v \le h - 1$, since equation (2) of lecture 06 interpolates between
# centres. The
# code calls this `visible`; it says nothing about what stands in between.
#
# ## The wrong height
#
# So far each point had a height, and we found its pixel. Now somebody gives you a pixel that says *car*, and you look
# for its cell. If you know nothing, you assume that the world is flat: $\delta$ = 0.
#
# **Predict before you run.** The top of a post, 1 m high, 10 m ahead of the toy car. Draw the ray from the camera, 1.5
# m up, over the top of the post, to the ground. How far ahead does it land? And over the roof of a car at 1.4 m? Over a
# sign at 2 m?
#
# <details><summary>Answer</summary>
#
# The ray sinks by 0.5 m in 10 m, so it has 1.5 m down after 30 m: 20 m behind the post. Over the roof it sinks by 0.1 m
# in 10 m: 150 m. Over the sign it rises: never.
#
# </details>
#
# Two similar triangles once more. From the camera, $z_\text{cam}$ above the ground, one goes down to the thing, $x$ metres
# ahead of the camera and $z$ high, the other on to the plane at $\delta$, which it meets at $x_\delta$:
#
# $$ x_\delta = x\, \frac{z_\text{cam} - \delta}{z_\text{cam} - z} $$

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
for z in (0.0, 1.0, 1.4):
    x_flat = 10 * 1.5 / (1.5 - z)
    both = np.array([[0, 1.5 - z, 10], [0, 1.5, x_flat]])
    np.testing.assert_allclose(*project(both, toy)[0])  # the thing and its place on the ground share a pixel
    print(f"{z} m high, 10 m ahead: drawn {x_flat:.0f} m ahead on the ground")

# %% [markdown]
# Now the red car in front of us. Each of its pixels has its true depth, so we know its true place. Where does each
# plane draw it?

# %%
down = (z_cam - np.array([0.0, 0.8])[:, None]) / (z_cam - car[:, 2])
on_ground, on_plane = eye[:2] + down[..., None] * (car - eye)[:, :2]
off_ground, off_plane = (np.linalg.norm(drawn - car[:, :2], axis=1) for drawn in (on_ground, on_plane))
print(f"{len(car)} pixels of one car, {car[:, 0].min():.1f} to {car[:, 0].max():.1f} m ahead")
print(f"on the ground plane half of them are off by more than {np.median(off_ground):.1f} m", end=", ")
print(f"on the plane at 0.8 m by more than {np.median(off_plane):.1f} m")
every = eye[:2] + ((z_cam - np.arange(8)[:, None] / 5) / (z_cam - car[:, 2]))[..., None] * (car - eye)[:, :2]
best = np.linalg.norm(every - car[:, :2], axis=2).min(axis=0)
print(
    f"each on the best of the planes 20 cm apart: {100 * (best > spec.cell).mean():.0f} % are off by more than a cell"
)

# %% jupyter={"source_hidden": true} alt="A, from the side: pixels of a car that stands 7 to 11 m ahead, and three rays from the camera through pixels 0.4, 0.9 and 1.2 m high, which meet the ground 10, 19 and 24 m ahead; B and C, from above: the car drawn on the ground plane is a smear from its place to beyond 45 m, on the plane at 0.8 m one from 4 to 25 m, around the true place"
fig, axes = plt.subplots(1, 3, figsize=(8.6, 3.4), layout="constrained", width_ratios=(2, 1, 1))
axes[0].scatter(*car[::7, [0, 2]].T, s=2, c=plt.get_cmap("viridis")(car[::7, 2] / 1.7))
for z in (0.4, 0.9, 1.2):
    k = np.abs(car[:, 2] - z).argmin()
    axes[0].plot([eye[0], on_ground[k, 0]], [z_cam, 0], color="0.7", linewidth=0.8, zorder=0)
    axes[0].plot(on_ground[k, 0], 0, "x", color="tab:red")
axes[0].plot(eye[0], z_cam, "ks")
axes[0].set(xlabel="x, forward [m]", ylabel="height [m]", xlim=(-1, 30), ylim=(-0.2, 2), title="A")
for ax, drawn, name in ((axes[1], on_ground, "B: plane at 0 m"), (axes[2], on_plane, "C: plane at 0.8 m")):
    ax.scatter(*drawn[::3, ::-1].T, s=1, color="tab:red", label="drawn")
    ax.scatter(*car[::3, 1::-1].T, s=1, color="black", label="true")
    ax.set(xlim=(15.5, -5), ylim=(0, 50), aspect="equal", xlabel="y, to the left [m]", title=name)
axes[1].set_ylabel("x, forward [m]")
axes[2].legend(markerscale=6, fontsize="small")
plt.show()

# %% [markdown]
# A, from the side: the pixels of the car, coloured by height, and where the flat world puts three of them (crosses).
# B and C, from above: the true places, black, and the drawn ones, red. On the plane at 0.8 m what is lower lies
# too near, what is higher too far. Even if someone chose the best plane for each pixel, four in ten would be off by
# more than a cell, because near the camera's own height a ray is nearly level: there 10 cm of height are metres of
# road. The planes only make sure that better answers are among those offered. The choice is left to what is learnt.
#
# As a graph: a class $c$ says something about the height $h$ of what a pixel shows (in metres; not the image's $h$),
# and the height says at which place $x$ along the ray the thing stands. Dashed: the cut edge; its price is explained below.

# %% tags=["graph-height"] jupyter={"source_hidden": true} alt="a directed graph: class c to height h (dashed, with its price), h to place x, and class c to the observed label a"
height_stage = pixel_height()
fig, ax = plt.subplots(figsize=(5, 2.4), layout="constrained")
height_stage.draw(ax, highlight=["h"])
plt.show()

# %% [markdown]
# How high above the road are the pixels of cars on the drive, up to 45 m ahead?

# %% jupyter={"source_hidden": true}
counts = np.zeros(4)
for other in drive:
    ground, cars = (places_of(*np.nonzero(other.labels.image == c), other) for c in (ROAD, CAR))
    profile = np.polyfit(ground[:, 0], ground[:, 2], 3, w=1 / (1 + ground[:, 0]))
    cars = cars[cars[:, 0] < 45]
    counts += np.histogram(cars[:, 2] - np.polyval(profile, cars[:, 0]), [-5, 0.175, 0.55, 0.925, 9])[0]
print("lowest, about 0.35 m, 0.75 m, 1.1 m or higher:", *(f"{share:.0%}" for share in counts / counts.sum()))
np.testing.assert_allclose(counts / counts.sum(), CAR_HEIGHTS, atol=0.01)

# %% [markdown]
# For a ray of the toy camera that meets the ground at 30 m, these four heights are places at 30, 23, 15 and 8 m. So,
# given a pixel
# that says car, the exact answer spreads over four places, and the flat world is sure of the least likely one: P(30 m)
# = 1 instead of 0.03. The twenty planes don't infer the height either: they keep all places, without probabilities.
#
# ## Hidden cells
#
# The first graph said: behind the first thing, the image says nothing. How much of a street is that?
#
# **Predict before you run.** In the last frame of the drive, take all cells in view on the ground plane. In how many of
# them does the pixel show something that stands *in front of* the cell?
#
# <details><summary>Answer</summary>
#
# In more than half, 55 %; over the whole drive it is 52 to 67 %. But another 32 % read something
# *behind* the cell. The road has a crest. In this frame the ground 40 m ahead lies 0.7 m lower than below the
# vehicle, so the ray through the plane's cell passes above the road there and meets something farther away, lower
# than the plane. Only 13 % read something at the cell's own distance, to within a tenth.
#
# </details>

# %% jupyter={"outputs_hidden": true}
(pixels,), (visible,) = plane_pixels(spec, [0.0], camera)
cols, rows = pixels[visible].round().astype(int).T
wanted = np.linalg.norm(spec.centers()[visible] - eye[:2], axis=1)
shares = []
for other in drive:
    there = places_of(rows, cols, other)
    seen_at = np.linalg.norm(there[:, :2] - eye[:2], axis=1) / wanted
    shares.append([(seen_at < 0.9).mean(), (np.abs(seen_at - 1) <= 0.1).mean(), (seen_at > 1.1).mean()])
print("cells whose pixel shows something nearer, in place, farther (within a tenth of the distance):")
print("last frame:", *(f"{100 * s:.0f} %" for s in shares[-1]), end="; all frames: ")
print(*(f"{100 * min(s):.0f} to {100 * max(s):.0f} %" for s in zip(*shares, strict=True)), sep=", ")
front, right = seen_at < 0.9, frame.labels.image[rows, cols] == frame.labels.birdseye_on(spec)[visible]
ground = places_of(*np.nonzero(frame.labels.image == ROAD))
assert np.isclose(np.median(ground[np.abs(ground[:, 0] - 40) < 2, 2]), -0.7, atol=0.03)  # the crest
assert (there[seen_at > 1.1, 2] < 0).mean() > 0.99
for name, which in (("nearer", front), ("in place", np.abs(seen_at - 1) <= 0.1), ("farther", seen_at > 1.1)):
    print(f"{name}: {100 * right[which].mean():.0f} % read their true class")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two maps: the classes that the ground plane reads, with cars drawn out into long streaks, hatched where something nearer is read; and the true classes"
hidden, label = np.zeros(spec.shape, bool), np.full(spec.shape, 255)
hidden[visible], label[visible] = front, frame.labels.image[rows, cols]
maps = {"what the ground plane reads": label, "truth": frame.labels.birdseye_on(spec)}
fig = plotting.label_maps(spec, maps, KITTI_14)
plt.rcParams["hatch.color"] = "white"
fig.axes[0].contourf(
    spec.centers()[0, :, 1], spec.centers()[:, 0, 0], hidden, [0.5, 1.5], colors="none", hatches=["////"]
)
plt.show()

# %% [markdown]
# Left: the *true* labels of the image, laid on the ground by equation (1); right: the true map. White: out of view.
# Hatched: the pixel
# shows something nearer, which is drawn out, often to the edge of the grid. No camera model repairs that. The LIDAR
# knows which cells are hidden, and the occupancy grid calls them UNKNOWN: one reason to use both sensors. Far ahead,
# what the map lacks is the road's own shape: there a plane *below* zero would be right.
# [The companion](deeper/05_cells_and_slopes.ipynb) measures slopes, and how few pixels a far cell has.
#
# ## A real street
#
# The same code on a real camera, from PandaSet: another lens, another vehicle, the camera 2.09 m up. We have no true
# depth here. But the LIDAR has returns, each with its own height, and people have labelled them.

# %%
real = real_drive()[9]
real_eye = invert_rigid(real.camera.T_camera_from_grid)[:3, 3]
returns = real.points_grid[:, :3].astype(float)
at, in_view = project(transform_points(real.camera.T_camera_from_grid, returns), real.camera)
cols, rows = at[in_view].round().astype(int).T
road = returns[in_view][real.labels.image[rows, cols] == ROAD]
print(f"focal length {real.camera.K[0, 0]:.0f} pixels, camera {real_eye[2]:.2f} m above the ground")
for x in (15, 20, 30, 40, 50):
    height = np.median(road[np.abs(road[:, 0] - x) < 0.05 * x, 2])
    lands = x * real_eye[2] / (real_eye[2] - height)
    print(f"road {x} m ahead: {height:+.2f} m high, so the ground plane draws it {lands:.1f} m ahead")

# %% jupyter={"source_hidden": true} alt="a real street with LIDAR returns on it, coloured by depth, that follow the cars' outlines; below it the dots of the ground plane, which lie on the road and also over the cars"
fig, axes = plt.subplots(2, 1, figsize=(5.6, 4), layout="constrained")
plotting.points_on_image(real, axes[0], size=2)
plotting.plane_on_image(coarse, 0.0, paled(real), ax=axes[1], size=4)
axes[0].set_title("A: LIDAR returns", fontsize="medium")
axes[1].set_title("B: centres of cells of 1 m on the ground plane", fontsize="medium")
fig.supxlabel(real_drive().credit, fontsize=8)
plt.show()

# %% [markdown]
# A: nearer returns are lighter. Their colour changes where the outlines of cars and trees are in the image, as it must
# if the calibration is right. B: a carpet on the road. It also lies over the cars, because equation (1) knows nothing
# of cars. This street is nearly flat: at these five distances its road is at most 8 cm above or below the ground plane.
# Even so the road 40 m ahead is drawn 1.5 m too near.
#
# ## Play with it
#
# Drag the height of the plane. At which height does it become a line, and what happens
# beyond? (Without a running kernel there is no slider; the animation above shows the same.)

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the grid lifted to a height, drawn over the image"


def show(height):
    """Show the plane at the slider's height."""
    _, ax = plt.subplots(figsize=(7.5, 2.6), layout="constrained")
    plotting.plane_on_image(coarse, height, pale, ax=ax, size=3, colour_bar=False)
    ax.set_title(f"plane at {height:.2f} m", fontsize="medium")
    plt.show()


_ = interact(show, height=FloatSlider(value=0.0, min=-1.0, max=3.8, step=0.05, description="height [m]"))

# %% [markdown]
# ## Where this breaks
#
# Equation (1) is exact about a camera without lens distortion that is where you think it is, and about a point that
# you know to be there. You have seen the second fail. The first: the camera is turned by $\psi$ = 1°, and nobody has
# told the calibration.
#
# **Predict before you run.** In metres, 30 m ahead: how far is a cell off if the toy camera is turned to the side
# (yaw)? And if it nods (pitch)? Row 48 + 300 / 30 = 58, where the ground at 30 m should be, then really looks where
# row 54.5 or 61.5 should.
#
# <details><summary>Answer</summary>
#
# To the side: 30 · tan 1° = 0.52 m, one cell. Nodding: rows 6.5 and 13.5 below the horizon are 300 / 6.5 = 46 m and 300
# / 13.5 = 22 m: 16 m too far, or 8 m too near. The same degree, and fifteen or thirty times the error, because the camera
# looks at the road at a very flat angle.
#
# </details>
#
# With $\tan\psi \approx \psi$ the focal length drops out: yaw moves a place by $x\,\psi$, and pitch makes a place of
# the ground at $x$ read another one, at $x'$ (minus with the nose up, plus with the nose down):
#
# $$ \frac{1}{x'} = \frac{1}{x} \mp \frac{\psi}{z_\text{cam}} $$


# %% jupyter={"outputs_hidden": true}
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
    assert axis == "y" or np.isclose(1 / x, 1 / 30 + sign * np.radians(1) / 1.5, rtol=0.01)
    print(f"{name:<12} the cell 30 m ahead reads the ground {x:.1f} m ahead, {abs(y):.1f} m to the side")
on_drive = [read_instead(at, camera, turned(camera, "x", sign))[0] for at, sign in ((30.0, 1), (37.0, -1))]
np.testing.assert_allclose(on_drive, (23, 60), atol=0.5)  # the drive's camera, for the figure below

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="which ground a cell reads, against the cell's distance, for pitch errors of a quarter, half and one degree: nose up bends far above the diagonal, nose down below it"
fig, ax = plt.subplots(figsize=(6, 3.2), layout="constrained")
x = np.linspace(6.5, 60, 100)
ax.plot([0, 60], [0, 60], color="0.6", linewidth=1, label="as calibrated")
for degrees, style in ((0.25, ":"), (0.5, "--"), (1.0, "-")):
    for sign, colour in ((1, "tab:blue"), (-1, "tab:red")):
        read = [read_instead(a, camera, turned(camera, "x", sign * degrees))[0] for a in x]
        ax.plot(x, read, style, color=colour, label=f"{degrees}° nose {'down' if sign > 0 else 'up'}")
ax.set(xlabel="cell, x [m]", ylabel="reads the ground at x [m]", xlim=(0, 60), ylim=(0, 60))
ax.legend(fontsize="small", loc="center left", bbox_to_anchor=(1, 0.5))
plt.show()

# %% [markdown]
# The drive's camera: with the nose one degree down, the cell at 30 m gets the label of the road at 23 m; with the nose
# one degree up, the cell at 37 m gets that of 60 m. The crest of
# the drive does the same: the grid is fixed to the vehicle, so the road tilts under it.
#
# ## The ledger
#
# Two edges are cut here, with their prices in the worlds of the two graphs:

# %% jupyter={"source_hidden": true}
Markdown(ledger_table(ledger("pixel") + ledger("height")))

# %% [markdown]
# ## In five lines
#
# 1. $(X/Z, Y/Z)$ is the picture one metre ahead; $K$ turns it into pixels. Resizing scales $c$ from the image's edge,
#    half a pixel before the first centre; cropping shifts it.
# 2. Transforms are read by names, right to left; the inverse undoes the shift first, then the turn.
# 3. A point in view has one pixel, (1); a pixel has a whole ray of points. All planes meet at the horizon.
# 4. A wrong height moves a thing by $x\,(z - \delta) / (z_\text{cam} - z)$: 17 cm of sidewalk are half a metre on the map.
# 5. In view is not yet seen: (1) cuts occlusion (0.83 instead of 0.23) and the height (1 instead of 0.03).
#
# **What you can now do**: lay any map over any calibrated, undistorted image, and say how far off each cell may be,
# and why.
#
# ## Further reading
#
# - Hartley, Zisserman, *Multiple View Geometry in Computer Vision*, 2nd edition, Cambridge 2004, chapters 6 and 8: the
#   camera matrix, vanishing points and the horizon.
# - Zhang, *A flexible new technique for camera calibration*, PAMI 22(11), 2000: where $K$ comes from.
# - Mallot, Bülthoff, Little, Bohrer, *Inverse perspective mapping simplifies optical flow computation and obstacle
#   detection*, Biological Cybernetics 64, 1991: the flat world, and what stands up in it.
# - Roddick, Kendall, Cipolla, *Orthographic feature transform for monocular 3D object detection*, BMVC 2019: planes for
#   boxes.
# - Philion, Fidler, *Lift, splat, shoot*, ECCV 2020: pixels that guess their depth; the cut edge put back.
#
# ## Exercise
#
# [Exercise 05](exercises/05_pixels.ipynb): undo a crop, transforms by name, what a cell's pixel really shows, a height
# from a miss on the map, and a calibration with a fault that you find, and repair on two streets. Next: lecture [06](06_planes.ipynb), reading between pixels.

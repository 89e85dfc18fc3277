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
# - compute the pixels of a whole plane, and which of them are in view;
# - say what a wrong height, a hidden cell and a wrong angle do to the map.
#
# **Prerequisites.** Lecture [00](00_tour.ipynb): the grid. Lecture [01b](01b_graphical_models.ipynb), for one graph. A
# matrix times a vector; a rotation as a matrix.
#
# **Time.** 74 minutes; the computer needs less than one.
#
# **Paper.** Section 3.3, equation (1).

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, interact
from scipy import ndimage
from scipy.interpolate import NearestNDInterpolator
from scipy.spatial.transform import Rotation

from semgrid_edu import plotting
from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.frame import blocks, resize_image
from semgrid_edu.graphical import d_separated
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import plane_pixels
from worlds.lecture_05_pixel_ray import cell_by_cell, exact_ray, pixel_ray

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"
ROAD, SIDEWALK, CAR = (KITTI_14.index(name) for name in ("road", "sidewalk", "car"))
PURPLE, BLUE = KITTI_14.colours(np.array([ROAD, CAR])) / 255
ORANGE, SKY = "#d55e00", "#0072b2"

# %% [markdown]
# ## Where does a point appear in the image?
#
# To bring a class from a pixel to a cell of the map we need to know which pixel belongs to which cell. Begin with the
# simplest camera: a box with a tiny hole in front, and a film 200 pixels behind the hole (its *focal length*, measured
# in the film's own pixels). Ten metres ahead stands a pole of two metres. Light runs straight through the hole. So the
# pole and its picture are two triangles of the same shape: 200 · 2 / 10 = 40 pixels.
#
# **Predict before you run.** How tall is the picture when the pole is twice as far away? And that of a pole a tenth as
# tall, at a tenth of the distance?
#
# <details><summary>Answer</summary>
#
# Half as tall, 20 pixels. The small one: 40 pixels again, like the first pole. A picture cannot tell a small thing
# nearby from a big one far away.
#
# </details>
#
# On the film the picture is upside down. A camera turns it upright, and so do we: hence plus signs. Count pixels to the
# right ($u$) and down ($v$), from the first pixel's centre. The camera's axis meets the image at the *principal point*
# $(c_u, c_v)$, and $f_u, f_v$ are the focal lengths. With $X$ to the right, $Y$ down and $Z$ ahead of the hole, the
# depth:
#
# $$ u = c_u + f_u \frac{X}{Z}, \qquad v = c_v + f_v \frac{Y}{Z} $$


# %% jupyter={"outputs_hidden": true}
def pinhole(X, Y, Z, f_u=200, f_v=200, c_u=160, c_v=48):
    """Return u and v of a point: two similar triangles."""
    return c_u + f_u * X / Z, c_v + f_v * Y / Z


for name, top in {"10 m ahead": (0, -2, 10), "20 m ahead": (0, -2, 20), "20 cm, 1 m": (0, -0.2, 1)}.items():
    print(f"top of the pole, {name}: {48 - pinhole(*top)[1]:.0f} pixels above the axis")

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="left, three poles seen from the side; the rays from the hole to the top of the pole ten metres ahead and of the small one one metre ahead are the same line; right, the upright image, with pictures of the three poles that are 40, 20 and 40 pixels tall"
fig, (ax, image) = plt.subplots(1, 2, figsize=(8.8, 2.4), layout="constrained", width_ratios=(3, 1))
poles = ((10, 2.0, "tab:blue", "A"), (20, 2.0, "tab:orange", "B"), (1, 0.2, "tab:green", "C"))
for k, (Z, top, colour, name) in enumerate(poles):
    ax.plot([0, Z], [0, top], color=colour, linewidth=0.8)
    ax.plot([Z, Z], [0, top], color=colour, linewidth=4, solid_capstyle="butt")
    ax.text(Z + 0.2, top if top > 1 else -0.14, f"{name}: {top:g} m, {Z} m ahead", color=colour, va="center")
    image.plot([k, k], [48, pinhole(0, -top, Z)[1]], color=colour, linewidth=8, solid_capstyle="butt")
ax.plot(0, 0, "ko")
ax.set(xlabel="Z, ahead of the hole [m]", ylabel="up, −Y [m]", ylim=(-0.3, 2.3), xlim=(-0.5, 27))
image.set(xlim=(-0.6, 2.6), ylim=(60, 0), ylabel="row v", title="their pictures")
image.set_xticks(range(3), labels="ABC")
plt.show()

# %% [markdown]
# Pole C and pole A share one ray, so their tops share a pixel. **A point has one pixel, but a pixel has a whole ray of
# points.**
#
# ## How does one matrix do it?
#
# A camera scales by $f$, shifts by $c$ and divides by $Z$. The division isn't linear, so do it last, and carry a third
# number along. $K$, the **intrinsic matrix**, makes of the point $(X, Y, Z)$ the triple $(f_u X + c_u Z,\; f_v Y + c_v
# Z,\; Z)$. Divide by its last number, and you have the pixel.


# %%
def pixel(point, K):
    """Return u and v of a point of the camera's frame: multiply, then divide."""
    triple = K @ point
    return triple[:2] / triple[2]


K = np.array([[200.0, 0, 160], [0, 200, 48], [0, 0, 1]])
print(K @ [1.5, 1, 10], "= 200 * 1.5 + 160 * 10, 200 * 1 + 48 * 10, 10")
for point in ([1.5, 1, 10], [3, 2, 20], [0.15, 0.1, 1]):
    np.testing.assert_allclose(pixel(np.array(point), K), pinhole(*point))
    print(f"{point!s:<14} -> {pixel(np.array(point), K).round(6).tolist()}")

# %% [markdown]
# All three points are multiples of one triple, so they are on one ray.
#
# A real lens also bends straight lines a little. Our images have been straightened beforehand (*rectified*). For them
# $K$ and one division are enough.
#
# ## What if the image is resized or cropped?
#
# Networks see smaller images, and often only a part. Take a row of 8 pixels with its axis in the middle, at $c_u$ =
# 3.5, and $f_u$ = 10. Average the pixels in pairs: 4 are left.
#
# **Predict before you run.** The new $c_u$? The new $f_u$? And if you cut two pixels off on the left instead?
#
# <details><summary>Answer</summary>
#
# The middle of four pixels is 1.5, and not half of 3.5! The image begins half a pixel *before* the centre of its first
# pixel, and that edge is what stays in place: the axis is 4 pixels from the edge, then 2, so 1.5 from the first centre.
# The focal length is only halved. A cut shifts: $c_u$ = 1.5, and $f_u$ stays.
#
# </details>


# %% jupyter={"outputs_hidden": true}
def resize(scale_u, scale_v):
    """Return the matrix that takes pixels of an image to those of a resized one: (u + 1/2) * scale - 1/2."""
    return np.array([[scale_u, 0, (scale_u - 1) / 2], [0, scale_v, (scale_v - 1) / 2], [0, 0, 1]])


def crop(left, top):
    """Return the matrix that takes pixels of an image to those of a part of it."""
    return np.array([[1.0, 0, -left], [0, 1, -top], [0, 0, 1]])


row = np.array([[10, 0, 3.5], [0, 10, 0], [0, 0, 1]])
print("halved: f_u, c_u =", (resize(0.5, 1) @ row)[0, ::2], "  cropped:", (crop(2, 0) @ row)[0, ::2])

# %% [markdown]
# What does it cost to forget the half pixel? The camera $K$, 1.5 m above a flat road, sees the road 30 m ahead in the
# tenth row below its axis, so in the fifth when the image is halved. The careless $c_v$ is a quarter of a pixel off,
# and a quarter of five rows is 5 %: we look at the road 28.6 m ahead, 1.4 m too near, without an error message.

# %% jupyter={"source_hidden": true}
careless, right = np.diag([0.5, 0.5, 1]) @ K, resize(0.5, 0.5) @ K
looked_up = pixel(np.array([0, 1.5, 30]), careless)[1]
np.testing.assert_allclose(right[1, 1] * 1.5 / (looked_up - right[1, 2]), 28.57, atol=0.01)
place = np.array([1.5, 1.0, 10.0])  # and a soft dot on a black image moves as the rule says, cut and halved
(u, v), (columns, rows) = pixel(place, K), np.meshgrid(np.arange(321), np.arange(96))
dot = 255 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 5**2))
part = np.dstack([dot.round().astype(np.uint8)] * 3)[:, 1:]
small = resize_image(part, (48, 160))[..., 0].astype(float)
middle = np.array([small.sum(axis=0) @ np.arange(160), small.sum(axis=1) @ np.arange(48)]) / small.sum()
np.testing.assert_allclose(middle, pixel(place, resize(0.5, 0.5) @ crop(1, 0) @ K), atol=0.02)

# %% [markdown]
# So scale distances from the image's *edge*, half a pixel before the first centre. A cut only shifts.
#
# ## Where is the camera?
#
# Until now points were given in the camera's frame, but the map has its own. In a toy car the LIDAR is two metres above
# the ground, and half a metre below it a camera looks ahead. Here is the top of a post in three frames:
#
# | frame | axes | origin | top of the post |
# |---|---|---|---|
# | grid | x forward, y left, z up | on the ground below the LIDAR | (10, -2, 0.5) |
# | LIDAR | the same | two metres higher | (10, -2, -1.5) |
# | camera | X right, Y down, Z ahead | half a metre below the LIDAR | (2, 1, 10) |
#
# Each step may turn and shift. One matrix on $(x, y, z, 1)$ does both: a rotation $R$, and a shift $t$ in its last
# column. How do you find them? $R$ turns the axes: X is -y, Y is -z, Z is x. And **$t$ is where the new frame sees the
# old origin.** The camera sees the LIDAR half a metre above itself, and its Y points down: $t$ = (0, -0.5, 0).
#
# The names tell the order. **Neighbours that are equal cancel**: *camera from lidar* times *lidar from grid* is *camera
# from grid*. And the way back? From $Rp + t$, first take off $t$, then turn back by $R^\top$.

# %%
axes_of_camera = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # X is -y, Y is -z, Z is x


def inverse(T):
    """Return the way back: undo the shift, then the turn."""
    R, t = T[:3, :3], T[:3, 3]
    return rigid_transform(R.T, -R.T @ t)


T_camera_from_lidar = rigid_transform(axes_of_camera, np.array([0, -0.5, 0]))
T_lidar_from_grid = rigid_transform(np.eye(3), np.array([0, 0, -2.0]))
T_camera_from_grid = T_camera_from_lidar @ T_lidar_from_grid
print("post, from the camera:         ", (T_camera_from_grid @ [10, -2, 0.5, 1])[:3])
print("grid's origin, from the camera:", T_camera_from_grid[:3, 3])
print("camera, from the grid:         ", inverse(T_camera_from_grid)[:3, 3] + 0.0)  # + 0.0 makes 0 of -0

# %% [markdown]
# The last two lines are the shifts of the two ways. One isn't the other's negative, because each is written in the axes
# of its own frame. That is why the inverse must turn $t$ as well.
#
# So one matrix, put together by names, brings any point of the map into the camera's frame. $K$ and *camera from lidar*
# together are called the calibration.
#
# ## Which pixel belongs to which cell?
#
# A cell $j$ is a place $(x_j, y_j)$. Give it a height: lift the whole grid, as a flat sheet of cell centres, to the
# height $\delta_d$. This is plane number $d$, and equation (1) gives a pixel to each of its points:
#
# $$ \begin{pmatrix} X \\ Y \\ Z \\ 1 \end{pmatrix} = T_\text{camera←grid}
#    \begin{pmatrix} x_j \\ y_j \\ \delta_d \\ 1 \end{pmatrix}, \qquad
#    \begin{pmatrix} u \\ v \\ 1 \end{pmatrix} = K \begin{pmatrix} X/Z \\ Y/Z \\ 1 \end{pmatrix} \qquad (1) $$


# %% tags=["eq-1"]
def pixels_of_planes(spec, heights, camera):
    """Return the pixels, (D, H, W, 2), and which of them are in view, (D, H, W): one point at a time."""
    pixels = np.full((len(heights), *spec.shape, 2), np.nan)
    in_view = np.zeros((len(heights), *spec.shape), bool)
    n_rows, n_columns = camera.size
    for d, r, c in np.ndindex(in_view.shape):
        x, y = spec.centers()[r, c]
        X, Y, Z, _ = camera.T_camera_from_grid @ [x, y, heights[d], 1]
        if Z > 0:
            u, v, _ = camera.K @ [X / Z, Y / Z, 1]
            pixels[d, r, c] = u, v
            in_view[d, r, c] = 0 <= u <= n_columns - 1 and 0 <= v <= n_rows - 1
    return pixels, in_view


# %% jupyter={"source_hidden": true}
spec, drive = GridSpec.compact(), sample_drive()
frame = drive[len(drive) - 1]
camera = frame.camera
eye = invert_rigid(camera.T_camera_from_grid)[:3, 3]
z_cam = eye[2]
toy = Camera(K, T_camera_from_lidar, size=(96, 320), lidar_height=2.0)
np.testing.assert_allclose(T_camera_from_grid, toy.T_camera_from_grid)
block = GridSpec(x_min=-10, x_max=41, y_min=-7, y_max=8, cell=3)  # some of it behind the camera
for some_camera in (toy, camera):
    literal, literal_in_view = pixels_of_planes(block, [0.0, 1.5, 2.0], some_camera)
    package, in_view = plane_pixels(block, [0.0, 1.5, 2.0], some_camera)
    np.testing.assert_allclose(literal, package)
    np.testing.assert_array_equal(literal_in_view, in_view)
assert pinhole(-2, 1.5, -10) == (200, 18)  # ten metres behind the camera: above the horizon, row 48

# %% [markdown]
# Why `if Z > 0`? Behind the camera $X/Z$ and $Y/Z$ both change their sign, so a place on the ground would get a pixel in
# the sky, without an error or a NaN. A point is **in view** if it is in front of the camera *and* its pixel is between
# the centres of the outermost pixels, because lecture [06](06_planes.ipynb) interpolates between centres.
#
# One line of equation (1) carries the rest of this lecture. A level camera is $z_\text{cam}$ above the ground. A thing
# at the height $z$ is $Y = z_\text{cam} - z$ below it, so
#
# $$ \text{rows below the horizon} = v - c_v = f_v\, \frac{z_\text{cam} - z}{Z} \qquad \text{(the row rule)} $$
#
# Far ahead $Z$ is large and the height doesn't matter: everything tends to row $c_v$, the horizon. A plane at the
# camera's own height is seen edge-on, in this row everywhere. Watch it on a simulated drive, whose camera is 1.66 m
# above the ground:


# %% jupyter={"source_hidden": true}
def places_of(frame, rows, cols):
    """Return what pixels see, in the grid frame, (N, 3): equation (1) backwards, with the simulator's true depth."""
    Z = frame.labels.depth[rows, cols].astype(float)
    triples = np.stack([cols, rows, np.ones_like(rows)]) * Z  # not yet divided by Z
    return transform_points(invert_rigid(frame.camera.T_camera_from_grid), (np.linalg.inv(frame.camera.K) @ triples).T)


def sheet(ax, height):
    """Draw the points of a plane that are in view, over a pale image with one car marked in blue."""
    ax.imshow(pale)
    pixels, in_view = plane_pixels(coarse, [height], camera)
    ax.plot(*pixels[in_view].T, ".", color=ORANGE, markersize=2.5)
    ax.set(xlim=(-0.5, pale.shape[1] - 0.5), ylim=(pale.shape[0] - 0.5, -0.5), xticks=[], yticks=[])
    ax.set_title(f"plane at {height:.2f} m", fontsize="medium")


instances, _ = ndimage.label(frame.labels.image == CAR)
is_front_car = (instances == instances[140, 120]) & (frame.labels.depth < 13)
pale = np.repeat((120 + frame.image.mean(axis=2, keepdims=True) // 2).astype(np.uint8), 3, axis=2)
pale[is_front_car] = (pale[is_front_car] // 2 + 100 * BLUE).astype(np.uint8)
coarse = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, cell=1.0)  # to draw, so that dots stay apart

# %% jupyter={"source_hidden": true} alt="three pictures of a street with one car marked in blue, and a sheet of orange dots: at 0 m it lies on the road and runs up to the horizon, at 0.8 m it is higher and cuts the car at half its height, at 1.66 m it is a line at the horizon"
fig, axes = plt.subplots(3, 1, figsize=(6.4, 6.4), layout="constrained")
for ax, height in zip(axes, (0, 0.8, z_cam), strict=True):
    sheet(ax, height)
plt.show()

# %% [markdown]
# Each dot is the centre of a square of a metre. On the road, through the middle of the blue car, and edge-on: the same
# places, other pixels. (With a running kernel, drag the plane yourself.)

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the grid lifted to a height, drawn over the image"


def show(height):
    """Show the plane at the slider's height."""
    _, ax = plt.subplots(figsize=(6.4, 2.2), layout="constrained")
    sheet(ax, height)
    plt.show()


_ = interact(show, height=FloatSlider(value=0.0, min=-1.0, max=3.8, step=0.05, description="height [m]"))

# %% [markdown]
# So equation (1) gives each cell one pixel per plane.
#
# ## What if the height is wrong?
#
# A pixel may show something that isn't at the plane's height. How far from its true place is it drawn on the map?
#
# **Predict before you run.** A post, 1 m high, stands 10 m ahead of the toy camera. Draw the ray from the camera, 1.5
# m up, over the top of the post, to the ground. How far ahead does it land? And over a sign that is higher than the
# camera?
#
# <details><summary>Answer</summary>
#
# The ray sinks by half a metre on its way to the post, so it has come all the way down after 30 m: far behind it. Over
# the sign it rises: never.
#
# </details>
#
# %% jupyter={"outputs_hidden": true}
print("the post's top, on the ground:", 10 * 1.5 / (1.5 - 1), "m ahead")

# %% [markdown]
# By the row rule: the thing, $x$ ahead of the camera ($Z = x$) and $z$ high, is in the same row as the place where the
# plane at $\delta$ draws it, so $(z_\text{cam} - z) / x = (z_\text{cam} - \delta) / x_\text{drawn}$, and
#
# $$ x_\text{drawn} = x\, \frac{z_\text{cam} - \delta}{z_\text{cam} - z} $$
#
# So a small height makes a large miss. On the drive the sidewalk is 16 cm high. The ground plane draws it 1.66 / 1.50 =
# 1.11 times as far from the camera as it is, so a point of its edge, 8.3 m away, is 0.9 m off. For the blue car it is
# worse, because its roof is nearly as high as the camera:


# %%
def drawn(places, delta):
    """Return where the plane at delta draws what stands at some places, in the grid frame, (N, 3)."""
    return eye + (z_cam - delta) / (z_cam - places[:, 2:]) * (places - eye)


# %% jupyter={"source_hidden": true}
row = round(project(transform_points(camera.T_camera_from_grid, np.array([8, -4.45, 0])), camera)[0][1])
edge = places_of(frame, np.array([row]), np.flatnonzero(frame.labels.image[row] == SIDEWALK)[-1:])
np.testing.assert_allclose((z_cam, edge[0, 2], np.hypot(*(edge - eye)[0, :2])), (1.66, 0.16, 8.3), atol=0.06)
np.testing.assert_allclose(np.hypot(*(drawn(edge, 0) - edge)[0, :2]), 0.9, atol=0.03)
car = places_of(frame, *np.nonzero(is_front_car))

# %% jupyter={"source_hidden": true} alt="A, from the side: a car, and rays from the camera to three of its points; the higher the point, the farther behind the car its ray reaches the ground. B and C, from above: black dots where the car is; orange dots where the planes draw it: at 0 m a long smear outwards that begins at the car, at 0.8 m a shorter one that begins before the car"
fig, axes = plt.subplots(1, 3, figsize=(8.8, 3.6), layout="constrained", width_ratios=(1.7, 1, 1))
axes[0].plot(*car[::7, [0, 2]].T, "k.", markersize=2)
axes[0].plot(eye[0], z_cam, "ks")
for height in (0.4, 0.8, 1.2):
    seen = car[np.abs(car[:, 2] - height).argmin()]
    ray = seen - eye
    far = eye + ray * z_cam / -ray[2]
    axes[0].plot([eye[0], far[0]], [z_cam, 0], color=ORANGE, linewidth=1)
    axes[0].plot(seen[0], seen[2], "o", color=ORANGE, markeredgecolor="black")
    axes[0].plot(far[0], 0, "x", color=ORANGE, markersize=8)
for delta, style in ((0, "-"), (0.8, "--")):
    axes[0].axhline(delta, color="0.5", linewidth=1, linestyle=style)
axes[0].set(xlim=(-1, 28), ylim=(-0.3, 2), xlabel="x, forward [m]", ylabel="height [m]")
axes[0].set_title("A: from the side", fontsize="medium")
for ax, delta, title in ((axes[1], 0.0, "B: on 0 m"), (axes[2], 0.8, "C: on 0.8 m")):
    below = car[car[:, 2] < z_cam - 0.02]
    ax.plot(*drawn(below, delta)[::3, 1::-1].T, ".", color=ORANGE, markersize=2, label="drawn")
    ax.plot(*car[::3, 1::-1].T, "k.", markersize=2, label="true place")
    ax.set(xlim=(26, -4), ylim=(0, 60), aspect="equal", xlabel="y, to the left [m]")
    ax.set_title(title, fontsize="medium")
axes[1].set_ylabel("x, forward [m]")
axes[2].legend(markerscale=5, fontsize=9, loc="upper right")
plt.show()

# %% [markdown]
# A: rays to three points of the car; the higher the point, the farther its ray reaches. B: so the ground plane draws the
# car out into a long smear. C: on the plane at 0.8 m (dashed in A), what is lower is drawn too near and what is higher
# too far.
#
# So a thing is drawn in its place only on the plane of its own height. That is why equation (1) has several planes. A
# network has to find out which one is right for a cell; lecture [08](08_fusion.ipynb) measures whether that pays.
#
# ## What does the image say of hidden cells?
#
# Look at B once more. If the road were flat, the smear would cover exactly the ground that the camera cannot see, because
# the car is in front of it: **occlusion**. What can the image say of these cells?
#
# A toy: four cells straight ahead, $m_1$ to $m_4$, each road or a van that is higher than the camera. Pixel $a_j$ looks
# at the *ground* in cell $j$. Its ray passes over all cells before it, so a van in any of them hides the ground. As a
# graph, a pixel has an arrow from each cell that its ray passes:

# %% tags=["graph"] jupyter={"source_hidden": true} alt="left, a sketch from the side: a camera and its rays to the ground in four cells; a van in cell 2, higher than the camera, blocks the rays to cells 2, 3 and 4; right, a directed graph: four cells m1 to m4 above, four grey pixels a1 to a4 below, and each pixel has arrows from its own cell and from all nearer ones"
fig, (side, ax) = plt.subplots(1, 2, figsize=(9, 2.9), layout="constrained", width_ratios=(1.1, 1))
side.add_patch(plt.Rectangle((5.1, 0), 1.8, 2.3, color=BLUE, alpha=0.4))
for j, x in enumerate((4, 6, 8, 10), start=1):
    stop = np.array([0, x if j == 1 else 5.1, x])  # camera, first thing, ground
    side.plot(stop[:2], 2 - 2 * stop[:2] / x, color=BLUE if j > 1 else PURPLE, linewidth=1.5)
    side.plot(stop[1:], 2 - 2 * stop[1:] / x, ":", color="0.4", linewidth=1.2)
    near = 0.55 * x if j < 3 else 0.35 * x + 0.4 * (j == 4)
    label = {"ha": "center", "va": "center", "fontsize": 9, "bbox": {"fc": "white", "ec": "none", "pad": 1}}
    side.text(near, 2 - 2 * near / x, f"$a_{j}$", **label)
    side.plot([x - 0.9, x + 0.9], [0, 0], color="black", linewidth=3, solid_capstyle="butt")
    side.text(x, -0.12, f"$m_{j}$", ha="center", va="top")
side.plot(0, 2, "ks")
side.set(xlim=(-0.4, 11), ylim=(-0.5, 2.4))
side.set_title("a van in cell 2, from the side", fontsize=10)
side.axis("off")
stage = pixel_ray()
stage.draw(ax)
ax.set_title("which cells a pixel depends on", fontsize=10)
plt.show()

# %% [markdown]
# **Predict before you run.** The four pixels say road, van, van, van. Each cell is a van with probability 0.2
# beforehand, and a pixel's label is right with 0.95. In which cells is a van? And are $m_1$ and $m_3$ independent once
# $a_3$ is known?
#
# <details><summary>Answer</summary>
#
# One van explains all labels, the one in cell 2. Behind it nothing is known, so a cell there nearly keeps its 0.2. And
# no: $a_3$ is a known collider, so $m_1$ and $m_3$ compete to explain it. The code does it by hand: it asks where the
# *first* van is.
#
# </details>

# %% jupyter={"outputs_hidden": true}
first_in_2 = 0.8 * 0.2 * 0.95**4  # no van in cell 1, one in cell 2, and all four labels are right
first_in_1 = 0.2 * 0.05 * 0.95**3  # the first label is wrong
first_in_3 = 0.8**2 * 0.2 * 0.05 * 0.95**3  # the second label is wrong
later = 0.8**3 * (0.2 * 0.05**2 * 0.95**2 + 0.8 * 0.05**3 * 0.95)  # in cell 4, or nowhere: nearly nothing
total = first_in_1 + first_in_2 + first_in_3 + later
print(f"cell 2: {(first_in_2 + 0.2 * first_in_1) / total:.2f}")  # behind a first van in cell 1 it keeps its 0.2
print(f"cell 3: {(first_in_3 + 0.2 * (first_in_1 + first_in_2)) / total:.2f}")
print(f"its own pixel only: {0.2 * 0.95 / (0.2 * 0.95 + 0.8 * 0.05):.2f}")

# %% jupyter={"source_hidden": true}
exact, own = exact_ray([0, 1, 1, 1]), cell_by_cell([0, 1, 1, 1])
np.testing.assert_allclose(exact[1], (first_in_2 + 0.2 * first_in_1) / total)
np.testing.assert_allclose(exact[2], (first_in_3 + 0.2 * (first_in_1 + first_in_2)) / total)
np.testing.assert_allclose((exact[1], exact[2], own[1]), (0.91, 0.23, 0.83), atol=0.005)
assert d_separated(stage.model, "m1", "m3")
assert not d_separated(stage.model, "m1", "m3", given=("a3",))

# %% [markdown]
# A reader that gives each cell its own pixel, as equation (1) does, believes in three vans with 0.83 each. In the image
# there is evidence for one: 0.91, and 0.23 in the cell behind it. Behind the first van the image says nothing.
#
# ## How much of a street is wrong, and why?
#
# We have two causes: a wrong height, and a thing in front. To tell them apart, take the cells that are truly road, up
# to 40 m ahead, and let each read the true label of its pixel. If it isn't *road*, is the thing nearer than the cell, or
# farther? A cell may also read *another* piece of road and look right. So ask, too, whether the place that the pixel
# shows is within a metre of the cell. Then switch the first cause off: lift each cell to the height of the nearest piece
# of road in the image. This removes the height error of road cells and of no others. Means of five frames:

# %% jupyter={"source_hidden": true}
NEAR, FAR = 1, 2
near_us = GridSpec(0, 40, spec.y_min, spec.y_max, spec.cell)
centres, n_rows = near_us.centers(), near_us.shape[0]


def read_lifted(frame, height):
    """Return label and depth of each cell's pixel, whether it is in view, the cell's depth, and how far off it reads."""
    points = np.concatenate([centres, height[..., None]], axis=-1)
    points = transform_points(frame.camera.T_camera_from_grid, points)
    pixels, in_view = project(points, frame.camera)
    cols, rows = np.where(in_view[..., None], pixels, 0).round().astype(int).transpose(2, 0, 1)
    read = np.where(in_view, frame.labels.image[rows, cols], 255)
    shown = places_of(frame, rows.ravel(), cols.ravel()).reshape(*rows.shape, 3)[..., :2]
    off = np.linalg.norm(shown - centres, axis=-1)
    return read, frame.labels.depth[rows, cols], in_view, points[..., 2], off


# %% jupyter={"source_hidden": true}
shares, read, why = {}, {}, {}
for k in (0, 5, 10, 15, len(drive) - 1):
    labels = drive[k].labels
    truth, seen = labels.birdseye_on(spec)[-n_rows:], blocks(labels.visible, spec).mean(axis=-1)[-n_rows:]
    road = places_of(drive[k], *np.nonzero(labels.image == ROAD))
    heights = {"on 0 m": np.zeros(near_us.shape)}
    heights["lifted to the road"] = NearestNDInterpolator(road[:, :2], road[:, 2])(centres)
    for name, height in heights.items():
        read[name], depth, in_view, Z, off = read_lifted(drive[k], height)
        is_road, reads_road = in_view & (truth == ROAD), read[name] == ROAD
        why[name] = np.where(depth < Z, NEAR, FAR) * (is_road & ~reads_road)
        part = [(why[name] == cause)[is_road].mean() for cause in (0, NEAR, FAR)]
        part += [reads_road[is_road & (seen == whole)].mean() for whole in (1, 0)]
        part += [(truth == CAR)[read[name] == CAR].mean(), (off[is_road] < 1).mean()]
        shares.setdefault(name, []).append(part)
means = {name: 100 * np.mean(all_frames, axis=0) for name, all_frames in shares.items()}
for name, (right, nearer, farther, wholly_seen, hidden, cars, in_place) in means.items():
    print(f"a road cell {name:<17} reads road {right:.0f} %, something nearer {nearer:.0f} %, farther {farther:.0f} %")
    print(f"   of those that the camera sees wholly {wholly_seen:.0f} % read road, of the hidden ones {hidden:.0f} %")
    print(f"   {in_place:.0f} % read a place within a metre; of all cells that read car {cars:.0f} % are car")
assert max(one[2] for one in shares["lifted to the road"]) < 0.005  # in no frame

# %% jupyter={"source_hidden": true} alt="three maps up to 40 m: the true classes; what cells read on 0 m, with cars drawn out into long streaks: hatched with lines where a road cell reads something nearer, beside and behind the cars, and with dots where it reads something farther, in a band 30 to 40 m ahead; and what they read lifted to the road, where the lines remain and the dots are gone"
maps = {"truth": truth} | {f"read {name}": read[name] for name in read}
fig = plotting.label_maps(near_us, maps, KITTI_14)
plt.rcParams["hatch.color"] = "white"
for ax, name in zip(fig.axes[1:], read, strict=False):
    for cause, hatch in ((NEAR, "////"), (FAR, "....")):
        mask, place = why[name] == cause, (near_us.centers()[0, :, 1], near_us.centers()[:, 0, 0])
        ax.contourf(*place, mask, [0.5, 1.5], colors="none", hatches=[hatch])
plt.show()

# %% [markdown]
# The maps show the last frame, whose road falls away most. Lines: a road cell reads something nearer. Dots: it reads
# something farther, because the ray passes over the falling road.
#
# The height matters more than the labels show: on 0 m only a third of the road cells read a place within a metre,
# lifted three quarters. And hardly a lifted cell reads something farther, in any frame: the wrong height was the cause.
# What is nearer stays, because no height lets a camera look through a car. The simulator tells which cells the camera
# sees. Lifted, each one that is seen wholly reads *road*, and no hidden one does. (The rest are seen in part.)
#
# The streaks of the cars stay, too: of all cells that read *car*, about four in five are something else. *In view*
# isn't yet *seen*. The LIDAR measures where the car ends, and that tells its cells from those behind: one reason to use
# both sensors.
#
# ## Where this breaks: a camera that nods
#
# Let the camera's nose be lower by $\psi$ = 1° than you think.
#
# **Predict before you run.** The toy camera sees the ground at $x$ in the row that is $300 / x$ below the horizon. The
# nose goes down by a degree, and the whole image moves up by about $f \tan\psi$ = 3.5 rows. Which ground is now in the
# row that we look up for 30 m? And if the nose goes up instead?
#
# <details><summary>Answer</summary>
#
# We look 10 rows below the old horizon, so 13.5 below the new one, or 6.5: the ground at 22 m, or at 46 m.
#
# </details>
#
# By the row rule, $f z_\text{cam} / x_\text{read} = f z_\text{cam} / x \pm f \tan\psi$. The focal length cancels,
# because it scales both rows and the nod (plus with the nose down, minus with the nose up):
#
# $$ \frac{1}{x_\text{read}} \approx \frac{1}{x} \pm \frac{\tan\psi}{z_\text{cam}} $$
#
# But what has nodded? There are two faults, and each spoils another matrix. On a bent mount the camera is turned, and
# the LIDAR isn't: *camera from lidar* is wrong. When the car brakes, both are turned together: *camera from lidar* stays
# right, and *lidar from grid* is wrong. The labels on the map suffer alike:


# %% jupyter={"outputs_hidden": true}
def turned(axis, degrees):
    """Return the transform that turns about an axis."""
    return rigid_transform(Rotation.from_euler(axis, degrees, degrees=True).as_matrix(), np.zeros(3))


def x_read(x, T):
    """Return how far ahead the ground is in the row that is expected for x, if T is the true camera from grid."""
    from_camera = inverse(T)
    ray = from_camera[:3, :3] @ [0, 1.5 / x, 1]  # the row rule: 200 * 1.5 / x below the axis
    return from_camera[0, 3] - ray[0] * from_camera[2, 3] / ray[2] if ray[2] < 0 else np.nan


for sign, name in ((1, "down"), (-1, "up")):
    bent = turned("x", sign) @ T_camera_from_lidar @ T_lidar_from_grid
    braking = T_camera_from_lidar @ turned("y", -sign) @ T_lidar_from_grid
    print(f"nose {name}: 30 m reads {x_read(30, bent):.0f} m, bent mount; {x_read(30, braking):.0f} m, both turned")
    np.testing.assert_allclose(1 / x_read(30, bent), 1 / 30 + sign * np.tan(np.radians(1)) / 1.5, rtol=0.01)

# %% jupyter={"source_hidden": true} alt="which ground a cell of the toy camera reads, against the cell's distance, with the nose up or down by one degree: nose up bends far above the diagonal and leaves the panel, from 86 m on it reads the sky; nose down stays far below; the predicted 46 m and 22 m at 30 m are marked"
fig, ax = plt.subplots(figsize=(6.4, 3), layout="constrained")
x = np.linspace(5, 100, 96)
ax.plot([0, 100], [0, 100], color="0.6", linewidth=1, label="as calibrated")
for sign, colour, style, name in ((-1, ORANGE, "--", "up"), (1, SKY, "-", "down")):
    true = turned("x", sign) @ T_camera_from_grid
    ax.plot(x, [x_read(a, true) for a in x], style, color=colour, label=f"nose {name} by 1°")
    ax.plot(30, x_read(30, true), "o", color=colour)
    place = (28, x_read(30, true) + 3) if sign < 0 else (30, x_read(30, true) - 12)
    ax.text(*place, f"{x_read(30, true):.0f} m", color=colour, fontsize=9, ha="right" if sign < 0 else "left")
sky = 1.5 / np.tan(np.radians(1))
ax.axvspan(sky, 100, color=ORANGE, alpha=0.15)
ax.text((sky + 100) / 2, 60, "nose up:\nsky", ha="center", fontsize=9)
ax.set(xlabel="cell, x [m]", ylabel="reads the ground at [m]", xlim=(0, 100), ylim=(0, 120))
ax.legend(fontsize=9, loc="upper left")
plt.show()
np.testing.assert_allclose(sky, 86, atol=0.5)

# %% [markdown]
# Near the car the error is small. Far ahead it explodes, because there the road is seen at a very flat angle. With the
# nose up, cells beyond $z_\text{cam} / \tan\psi$ = 86 m read the sky.
#
# Can you notice such a fault? On a real street, from PandaSet, draw the LIDAR's returns from one car into the image,
# with the calibration as it is and as if the mount were bent by a degree:

# %% jupyter={"source_hidden": true} alt="the rear of a real car, twice, with yellow dots where LIDAR returns from it are drawn; left, the dots end at the car's outline; right, all are shifted upwards and those of the roof hang above it"
real = real_drive()[0]
returns = real.points_grid[:, :3].astype(float)
front = (np.abs(returns[:, 1]) < 1.6) & (returns[:, 0] > 0) & (returns[:, 0] < 17) & (returns[:, 2] > 0.3)
fig, axes = plt.subplots(1, 2, figsize=(8.4, 3.2), layout="constrained")
for ax, degrees, title in ((axes[0], 0, "A: as calibrated"), (axes[1], 1, "B: mount bent by 1°")):
    T = turned("x", degrees) @ real.camera.T_camera_from_grid
    at, in_view = project(transform_points(T, returns), real.camera)
    ax.imshow(real.image)
    ax.plot(*at[in_view & front][::4].T, "o", color="#ffd500", markersize=3, mec="black", mew=0.3)
    ax.set(xlim=(170, 310), ylim=(144.5, 50), xticks=[], yticks=[])
    ax.set_title(title, fontsize="medium")
fig.supxlabel(real_drive().credit, fontsize=8)
plt.show()

# %% [markdown]
# A: the returns end at the car's outline, as they must if *camera from lidar* is right. B: those of the roof hang above
# it. So this check finds a bent mount. It can't find a braking car: LIDAR and camera turn together, and A stays A.
#
# So the map needs the calibration *and* the car's own pitch, right to a fraction of a degree.
#
# ## In five lines
#
# 1. A point has one pixel: scale by the focal length, divide by the depth, shift. A pixel has a whole ray of points.
# 2. Resizing scales from the image's edge, half a pixel before the first centre; cropping shifts.
# 3. Transforms are read by names. The inverse undoes the shift first, then the turn.
# 4. The row rule, $f_v (z_\text{cam} - z) / Z$ rows below the horizon, tells what a wrong height and a nod do.
# 5. In view isn't yet seen: behind the first thing on its ray a pixel says nothing.
#
# ## Further reading and exercise
#
# - Hartley, Zisserman, *Multiple View Geometry in Computer Vision*, 2nd edition, Cambridge 2004, chapters 6 and 8.
# - Mallot, Bülthoff, Little, Bohrer, *Inverse perspective mapping simplifies optical flow computation and obstacle
#   detection*, Biological Cybernetics 64, 1991: the flat world, and what stands up in it.
# - Philion, Fidler, *Lift, splat, shoot*, ECCV 2020: pixels that guess their depth.
#
# [The companion](deeper/05_cells_and_slopes.ipynb) asks how many pixels a far cell has, and which planes a road on a
# slope needs.
#
# [Exercise 05](exercises/05_pixels.ipynb): undo a crop, bring old returns to the camera of now, say what a pixel really
# shows, and find a fault. Next: lecture [06](06_planes.ipynb), reading between pixels.

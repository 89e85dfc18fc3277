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
# - say what a wrong height, a hidden cell and a wrong angle do to the map.
#
# **Prerequisites.** Lecture [00](00_tour.ipynb): the grid. Lecture [01b](01b_graphical_models.ipynb), for one graph. A
# matrix times a vector; a rotation as a matrix.
#
# **Time.** 74 minutes; the computer needs less than one.
#
# **Paper.** Section 3.3, equation (1).

# %% jupyter={"source_hidden": true}
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, interact
from scipy import ndimage
from scipy.spatial.transform import Rotation

from semgrid_edu import plotting
from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.frame import resize_image
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
# Count pixels to the right ($u$) and down ($v$), from the first pixel's centre. The camera's axis meets the film at the
# *principal point* $(c_u, c_v)$, and $f_u, f_v$ are the focal lengths. With $X$ to the right, $Y$ down and $Z$ ahead of
# the hole:
#
# $$ u = c_u + f_u \frac{X}{Z}, \qquad v = c_v + f_v \frac{Y}{Z} $$


# %% jupyter={"outputs_hidden": true}
def pinhole(X, Y, Z, f_u=200, f_v=200, c_u=160, c_v=48):
    """Return u and v of a point: two similar triangles."""
    return c_u + f_u * X / Z, c_v + f_v * Y / Z


for name, top in {"10 m ahead": (0, -2, 10), "20 m ahead": (0, -2, 20), "20 cm, 1 m": (0, -0.2, 1)}.items():
    print(f"top of the pole, {name}: {48 - pinhole(*top)[1]:.0f} pixels above the axis")

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="three poles seen from the side; the rays from the hole to the top of the pole ten metres ahead and of the small one one metre ahead are the same line"
fig, ax = plt.subplots(figsize=(7.5, 2.4), layout="constrained")
for Z, top, colour in ((10, 2.0, "tab:blue"), (20, 2.0, "tab:orange"), (1, 0.2, "tab:green")):
    ax.plot([0, Z], [0, top], color=colour, linewidth=0.8)
    ax.plot([Z, Z], [0, top], color=colour, linewidth=4, solid_capstyle="butt")
    ax.text(Z + 0.2, top, f"{top:g} m, {Z} m ahead", color=colour, va="center")
ax.plot(0, 0, "ko")
ax.set(xlabel="Z, ahead of the hole [m]", ylabel="up, −Y [m]", ylim=(-0.3, 2.3), xlim=(-0.5, 25))
plt.show()

# %% [markdown]
# The small pole and the near tall one share one ray, so they share a pixel. **A point has one pixel, but a pixel has a
# whole ray of points.**
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
# All three points are multiples of one triple. They are on one ray, and have one pixel. And where do lines end? Two
# rails run straight ahead, one to the left of the camera and one to the right. Far away $X/Z$ and $Y/Z$ vanish for
# both, so both end at the principal point. Lines of one direction meet in one pixel, their **vanishing point**.
#
# So $K$ holds all that the camera itself does, and the division is left to the end.
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
# Is it true of pictures, too? Paint a soft dot on a black image, at the pixel of some place. Cut off the first column,
# halve the rest, and look where the middle of the dot is now:

# %% jupyter={"source_hidden": true}
place = np.array([1.5, 1.0, 10.0])
(u, v), (columns, rows) = pixel(place, K), np.meshgrid(np.arange(321), np.arange(96))
dot = 255 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / (2 * 5**2))
part = np.dstack([dot.round().astype(np.uint8)] * 3)[:, 1:]
small = resize_image(part, (48, 160))[..., 0].astype(float)
middle = np.array([small.sum(axis=0) @ np.arange(160), small.sum(axis=1) @ np.arange(48)]) / small.sum()
np.testing.assert_allclose(middle, pixel(place, resize(0.5, 0.5) @ crop(1, 0) @ K), atol=0.02)
careless = pixel(place, np.diag([0.5, 0.5, 1]) @ crop(1, 0) @ K)
print(f"with the half pixel the rule finds the dot; without it misses by {careless[0] - middle[0]:.2f} pixels")

# %% [markdown]
# A quarter of a pixel, and no error message. So scale distances from the image's *edge*, half a pixel before the first
# centre. Focal lengths only scale, and a cut only shifts.
#
# ## Where is the camera?
#
# Until now points were given in the camera's frame, but the map has its own. In a toy car the LIDAR is two metres above
# the ground. The camera is half a metre below the LIDAR and looks ahead. Here is the top of a post in three frames:
#
# | frame | axes | origin | top of the post |
# |---|---|---|---|
# | grid | x forward, y left, z up | on the ground below the LIDAR | (10, -2, 0.5) |
# | LIDAR | the same | two metres higher | (10, -2, -1.5) |
# | camera | X right, Y down, Z ahead | half a metre below the LIDAR | (2, 1, 10) |
#
# Each step turns and shifts. One matrix on $(x, y, z, 1)$ does both: a rotation $R$, and a shift $t$ in its last
# column. The names tell the order. **Neighbours that are equal cancel**: *camera from lidar* times *lidar from grid* is
# *camera from grid*. And the way back? From $Rp + t$, first take off $t$, then turn back by $R^\top$.

# %%
axes_of_camera = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # X is -y, Y is -z, Z is x


def inverse(T):
    """Return the way back: undo the shift, then the turn."""
    R, t = T[:3, :3], T[:3, 3]
    return rigid_transform(R.T, -R.T @ t)


T_camera_from_lidar = rigid_transform(axes_of_camera, np.array([0, -0.5, 0]))
T_lidar_from_grid = rigid_transform(np.eye(3), np.array([0, 0, -2.0]))
T_camera_from_grid = T_camera_from_lidar @ T_lidar_from_grid
print("post, from the camera:", (T_camera_from_grid @ [10, -2, 0.5, 1])[:3])
print("camera, from the grid:", inverse(T_camera_from_grid)[:3, 3] + 0.0)  # + 0.0 makes 0 of -0

# %% [markdown]
# The last line is where the grid sees the camera: 1.5 m above the ground. It isn't $-t$. The shift $t$ is written in
# the axes of the camera, so it must be turned as well.
#
# So one matrix, put together by names, brings any point of the map into the camera's frame.
#
# ## Which pixel belongs to which cell?
#
# Now everything in turn. A cell $j$ is a place $(x_j, y_j)$. Give it a height: lift the whole grid, as a flat sheet of
# cell centres, to the height $\delta_d$. This is plane number $d$, and equation (1) gives a pixel to each of its points:
#
# $$ \begin{pmatrix} X \\ Y \\ Z \\ 1 \end{pmatrix} = T_\text{camera←grid}
#    \begin{pmatrix} x_j \\ y_j \\ \delta_d \\ 1 \end{pmatrix}, \qquad
#    \begin{pmatrix} u \\ v \\ 1 \end{pmatrix} = K \begin{pmatrix} X/Z \\ Y/Z \\ 1 \end{pmatrix} \qquad (1) $$


# %% tags=["eq-1"]
def pixels_of_planes(spec, heights, camera):
    """Return the pixels, (D, H, W, 2), and which of them are in view, (D, H, W): one point at a time."""
    pixels = np.full((len(heights), *spec.shape, 2), np.nan)
    visible = np.zeros((len(heights), *spec.shape), bool)
    n_rows, n_columns = camera.size
    for d, r, c in np.ndindex(visible.shape):
        x, y = spec.centers()[r, c]
        X, Y, Z, _ = camera.T_camera_from_grid @ [x, y, heights[d], 1]
        if Z > 0:
            u, v, _ = camera.K @ [X / Z, Y / Z, 1]
            pixels[d, r, c] = u, v
            visible[d, r, c] = 0 <= u <= n_columns - 1 and 0 <= v <= n_rows - 1
    return pixels, visible


# %% jupyter={"source_hidden": true}
spec, drive = GridSpec.compact(), sample_drive()
frame = drive[len(drive) - 1]
camera = frame.camera
T_grid_from_camera = invert_rigid(camera.T_camera_from_grid)
eye = T_grid_from_camera[:3, 3]
z_cam = eye[2]
toy = Camera(K, T_camera_from_lidar, size=(96, 320), lidar_height=2.0)
np.testing.assert_allclose(T_camera_from_grid, toy.T_camera_from_grid)
block = GridSpec(x_min=-10, x_max=41, y_min=-7, y_max=8, cell=3)  # some of it behind the camera
for some_camera in (toy, camera):
    literal, seen = pixels_of_planes(block, [0.0, 1.5, 2.0], some_camera)
    package, visible = plane_pixels(block, [0.0, 1.5, 2.0], some_camera)
    np.testing.assert_allclose(literal, package)
    np.testing.assert_array_equal(seen, visible)
assert pinhole(-2, 1.5, -10) == (200, 18)  # ten metres behind the camera: above the horizon, row 48

# %% [markdown]
# Why `if Z > 0`? A place on the ground *behind* the toy camera has a negative $Z$. The formula alone gives it a pixel
# in the sky, since minus signs cancel. There is no error and no NaN. So a point is **in view** only if it is in front
# of the camera *and* its pixel is within the image.
#
# **Predict before you run.** Straight ahead of the toy car a point of a plane is $1.5 - \delta$ metres below the camera,
# so it is in row $v = 48 + 200\,(1.5 - \delta) / Z$. Which row is the plane at 1.5 m? And to which row does *every*
# plane tend, far ahead?
#
# <details><summary>Answer</summary>
#
# Row 48, twice. The plane at the camera's own height is seen edge-on, as a line. And far ahead $Z$ is so large that the
# height doesn't matter: all planes meet in this row, the horizon.
#
# </details>
#
# %% jupyter={"outputs_hidden": true}
for Z in (5, 20, 80, 1000):
    rows = ", ".join(f"{48 + 200 * (1.5 - delta) / Z:.1f}" for delta in (0, 1, 1.5, 2))
    print(f"{Z:>4} m ahead, planes at 0, 1, 1.5, 2 m: rows {rows}")

# %% [markdown]
# Watch it on the drive, whose camera is 1.66 m above the ground:


# %% jupyter={"source_hidden": true}
def places_of(rows, cols, frame=frame):
    """Return what pixels see, in the grid frame, (N, 3): equation (1) backwards, with the simulator's true depth."""
    Z = frame.labels.depth[rows, cols].astype(float)
    triples = np.stack([cols, rows, np.ones_like(rows)]) * Z  # not yet divided by Z
    return transform_points(T_grid_from_camera, (np.linalg.inv(camera.K) @ triples).T)


def paled(frame):
    """Return the frame with a grey, light image, to draw on."""
    grey = (120 + frame.image.mean(axis=2, keepdims=True) // 16 * 8).astype(np.uint8)
    return replace(frame, image=np.repeat(grey, 3, axis=2))


def read_at(height):
    """Return the class that each cell reads from the true labels of the image, (H, W): 255 out of view."""
    (pixels,), (visible,) = plane_pixels(spec, [height], camera)
    read = np.full(spec.shape, 255)
    cols, rows = pixels[visible].round().astype(int).T
    read[visible] = frame.labels.image[rows, cols]
    return read


# %% jupyter={"source_hidden": true}
pale = paled(frame)
coarse = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, cell=1.0)  # to draw, so that dots stay apart
instances, _ = ndimage.label(frame.labels.image == CAR)
is_front_car = (instances == instances[140, 120]) & (frame.labels.depth < 13)
car = places_of(*np.nonzero(is_front_car))
pale.image[is_front_car] = (pale.image[is_front_car] // 2 + 100 * BLUE).astype(np.uint8)
HEIGHTS = (0, 0.4, 0.8, z_cam, 2, 2.5)
MAPS = {height: read_at(height) for height in HEIGHTS}
LEGEND = [c for c in range(len(KITTI_14.names)) if max((read == c).sum() for read in MAPS.values()) > 20]


def draw_map(ax, height):
    """Draw the map that a plane reads, with the true place of the blue car and all classes in the legend."""
    plotting.grid_labels(spec, MAPS[height], KITTI_14, ax=ax)
    dots = ax.plot(*car[::60, 1::-1].T, "ko", markersize=2.5, markeredgecolor="white", markeredgewidth=0.4)
    squares = [plt.Rectangle((0, 0), 1, 1, color=KITTI_14.colours(np.array([c]))[0] / 255) for c in LEGEND]
    names = [*(KITTI_14.names[c] for c in LEGEND), "true place of the blue car"]
    style = {"fontsize": 8, "frameon": False, "handlelength": 1}
    ax.legend([*squares, *dots], names, loc="upper left", bbox_to_anchor=(1.02, 1), **style)
    ax.set_ylim(0, 45)


# %% jupyter={"source_hidden": true} alt="animation: A, a sheet of dots rises through the camera image of a street with one car marked in blue, and becomes a line at the camera's height; B, seen from the side, it cuts through the car; C, the map of classes that the sheet reads, with the car's true place in black: on the ground plane a long blue smear from there outwards, at 0.8 m a shorter one on both sides of it"


def raised():
    """Yield the figure with the plane at each height."""
    fig = plt.figure(figsize=(8.4, 4.3), layout="constrained")
    for height in HEIGHTS:
        fig.clear()
        axes = fig.subplot_mosaic([["A", "C"], ["B", "C"]], width_ratios=(2.7, 1), height_ratios=(1.6, 1))
        plotting.plane_on_image(coarse, height, pale, ax=axes["A"], size=2, colour_bar=False)
        axes["B"].scatter(*car[::7, [0, 2]].T, s=1, color=BLUE)
        axes["B"].plot([0, 40], [height] * 2, "tab:orange", eye[0], z_cam, "ks")
        axes["B"].set(xlim=(-1, 41), ylim=(-1.2, 3.2), xlabel="x, forward [m]", ylabel="height [m]")
        draw_map(axes["C"], height)
        for letter, text in {"A": f"A: plane at {height:.1f} m", "B": "B: from the side", "C": "C: the map"}.items():
            axes[letter].set_title(text, fontsize="medium")
        yield fig


plotting.animate(
    raised(), period=0.5, alt="a plane of points rises through the street, and the map that it reads changes"
)

# %% [markdown]
# A: each dot is the centre of a square of a metre; nearer ones are lighter. One car is marked in blue. B: the same from the
# side, with the camera as a black square. C: the map that the plane reads from the image's true labels. On the ground plane
# the car is thrown over the map like a shadow. At 0.8 m, half-way up its body, the smear lies on both sides of the true
# place. Above the camera's height the map shows what is high, as trees and houses. (With a running kernel, drag the
# plane yourself.)

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the grid lifted to a height, drawn over the image"


def show(height):
    """Show the plane at the slider's height."""
    _, ax = plt.subplots(figsize=(7.5, 2.6), layout="constrained")
    plotting.plane_on_image(coarse, height, pale, ax=ax, size=3, colour_bar=False)
    ax.set_title(f"plane at {height:.2f} m", fontsize="medium")
    plt.show()


_ = interact(show, height=FloatSlider(value=0.0, min=-1.0, max=3.8, step=0.05, description="height [m]"))

# %% [markdown]
# So equation (1) gives each cell one pixel per plane, and no plane is right for everything in the street.
#
# ## What if the height is wrong?
#
# How far off is a thing that isn't at the plane's height?
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
# Two similar triangles once more. Seen from the camera, $z_\text{cam}$ above the ground, one goes down to the thing, $x$
# ahead and $z$ high. The other goes on to the plane at $\delta$, which it meets at $x_\delta$ ahead:
#
# $$ x_\delta = x\, \frac{z_\text{cam} - \delta}{z_\text{cam} - z} $$
#
# Try it on the drive, where the sidewalk on the right ends in a straight edge. Eight metres ahead, take the pixel of
# this edge. As a control take the pixel of the kerb's foot, where the sidewalk begins at the height of the road. The
# simulator knows the true place of both.


# %%
def drawn(places, delta):
    """Return where the plane at delta draws what stands at some places, in the grid frame, (N, 3)."""
    return eye + (z_cam - delta) / (z_cam - places[:, 2:]) * (places - eye)


edges = {}
for name, y, side in (("kerb's foot", -2.1, 0), ("far edge", -4.45, -1)):
    row = round(project(transform_points(camera.T_camera_from_grid, np.array([8, y, 0])), camera)[0][1])
    column = np.flatnonzero(frame.labels.image[row] == SIDEWALK)[side]
    edges[name] = there = places_of(np.array([row]), np.array([column]))
    print(f"{name}: truly at ({there[0, 0]:.2f}, {there[0, 1]:.2f}), {there[0, 2]:+.2f} m high", end="; drawn ")
    np.testing.assert_allclose(drawn(there, there[0, 2]), there)  # in place on the plane of its own height
    ground = drawn(there, 0)[0]
    print(f"at ({ground[0]:.2f}, {ground[1]:.2f}) on the ground plane; {np.hypot(*(ground - there[0])[:2]):.2f} m off")

# %% jupyter={"source_hidden": true}
off = {name: np.hypot(*(drawn(there, 0) - there)[0, :2]) for name, there in edges.items()}
np.testing.assert_allclose(list(off.values()), (0.16, 0.88), atol=0.006)
np.testing.assert_allclose(edges["far edge"][0], (7.26, -4.48, 0.16), atol=0.006)
missed = np.linalg.norm(drawn(car, 0) - car, axis=1)
for name, part in (("below 0.4 m", car[:, 2] < 0.4), ("above 1.2 m", car[:, 2] > 1.2)):
    print(f"pixels of the car {name}: half of them are drawn more than {np.median(missed[part]):.1f} m off")

# %% jupyter={"source_hidden": true} alt="A, from above: the camera, and in front of it black dots where the edges of the sidewalk truly are and orange crosses where the ground plane draws them; at the foot of the kerb they nearly coincide, at the far edge the cross is farther away on the same ray; B and C, from above, a car of which the ground plane makes a long smear outwards, and the plane at 0.8 m a shorter one around its true place"
fig, axes = plt.subplots(1, 3, figsize=(8.8, 3.4), layout="constrained", width_ratios=(1.5, 1, 1))
for k, (name, there) in enumerate(edges.items()):
    both = np.concatenate([there, drawn(there, 0)])
    axes[0].plot(*both[:, 1::-1].T, color="0.6")
    axes[0].plot(*both[0, 1::-1], "ko", label=None if k else "true place")
    axes[0].plot(*both[1, 1::-1], "x", color="#d55e00", markersize=9, label=None if k else "drawn at 0 m")
    side = 1 if k else -1  # the kerb's name to the left of its dot
    axes[0].text(both[0, 1] - 0.4 * side, both[0, 0], name, ha="left" if k else "right", va="center", fontsize=9)
axes[0].plot(eye[1], eye[0], "ks")
axes[0].plot([eye[1], ground[1]], [eye[0], ground[0]], ":", color="0.5", zorder=0)
axes[0].text(eye[1] + 0.6, eye[0] + 0.4, "camera", ha="left", fontsize=9)
axes[0].set(xlim=(2.6, -8), ylim=(-0.5, 11.5), aspect="equal", title="A: the sidewalk's two edges")
axes[0].legend(fontsize=8, loc="upper left")
for ax, delta, title in ((axes[1], 0.0, "B: a car, on 0 m"), (axes[2], 0.8, "C: on 0.8 m")):
    ax.scatter(*drawn(car, delta)[::3, 1::-1].T, s=1, color="#d55e00", label="drawn")
    ax.scatter(*car[::3, 1::-1].T, s=1, color="black", label="true place")
    ax.set(xlim=(15.5, -5), ylim=(0, 50), aspect="equal", title=title)
for ax in axes:
    ax.set_xlabel("y, to the left [m]")
axes[0].set_ylabel("x, forward [m]")
axes[2].legend(markerscale=6, fontsize=8)
plt.show()

# %% [markdown]
# The far edge is drawn 0.88 m from its true place (A), though calibration and code are right. What is wrong is the
# height: the sidewalk is 16 cm higher than the plane. By hand: the ray meets the ground 1.66 / 1.50 = 1.11 times as far
# from the camera as the edge is, and the edge is 8.3 m away. On a plane of the edge's own height the miss is gone. The
# control misses by less, because it is only 3 cm off the plane.
#
# A car is worse, because it reaches up nearly to the camera's height, where rays are almost level (B). Half of its
# pixels below 0.4 m are drawn more than 1.4 m off, half of those above 1.2 m more than 27.9 m. On the plane at 0.8 m,
# what is lower is drawn too near and what is higher too far (C).
#
# So a thing is drawn in its place only on the plane of its own height. Several planes *offer* several places, and one
# of them may be nearly right. Nobody says which. Whether a network profits must be measured: in lecture
# [08](08_fusion.ipynb) twenty planes are not clearly better than one.
#
# ## What does the image say of hidden cells?
#
# Four cells lie in a row straight ahead, $m_1$ to $m_4$, each road or car. Pixel $a_j$ looks at the *ground* in cell
# $j$. Its ray passes over all cells before it, so a car in any of them hides the ground. This is called **occlusion**.
# As a graph, a pixel has an arrow from each cell that its ray passes:

# %% tags=["graph"] jupyter={"source_hidden": true} alt="left, a sketch from the side: a camera and its rays to the ground in four cells; a car in cell 2 blocks the rays to cells 2, 3 and 4; right, a directed graph: four cells m1 to m4 above, four grey pixels a1 to a4 below, and each pixel has arrows from its own cell and from all nearer ones"
fig, (side, ax) = plt.subplots(1, 2, figsize=(9, 2.9), layout="constrained", width_ratios=(1.1, 1))
side.add_patch(plt.Rectangle((5.1, 0), 1.8, 1.3, color=BLUE, alpha=0.4))
for j, x in enumerate((4, 6, 8, 10), start=1):
    stop = np.array([0, x if j == 1 else max(5.1, x - 1.3 * x / 3), x])  # camera, first thing, ground
    side.plot(stop[:2], 3 - 3 * stop[:2] / x, color=BLUE if j > 1 else PURPLE, linewidth=1.5)
    side.plot(stop[1:], 3 - 3 * stop[1:] / x, ":", color="0.4", linewidth=1.2)
    side.text(x / 3, 2, f"$a_{j}$", ha="center", va="center", fontsize=9, bbox={"fc": "white", "ec": "none", "pad": 1})
    side.plot([x - 0.9, x + 0.9], [0, 0], color="black", linewidth=3, solid_capstyle="butt")
    side.text(x, -0.15, f"$m_{j}$", ha="center", va="top")
side.plot(0, 3, "ks")
side.set(xlim=(-0.4, 11), ylim=(-0.6, 3.2))
side.set_title("a car in cell 2, from the side", fontsize=10)
side.axis("off")
stage = pixel_ray()
stage.draw(ax)
ax.set_title("which cells a pixel depends on", fontsize=10)
plt.show()

# %% [markdown]
# **Predict before you run.** The four pixels say road, car, car, car. Each cell is a car with probability 0.2
# beforehand, and a pixel's label is right with 0.95. Which cells are cars? And are $m_1$ and $m_3$ independent once
# $a_3$ is known?
#
# <details><summary>Answer</summary>
#
# One car explains all labels, the one in cell 2. Behind it nothing is known, so a cell there nearly keeps its 0.2. And
# no: $a_3$ is a known collider, so $m_1$ and $m_3$ compete to explain it. The code does it by hand: it asks where the
# *first* car is.
#
# </details>

# %% jupyter={"outputs_hidden": true}
first_in_2 = 0.8 * 0.2 * 0.95**4  # no car in cell 1, one in cell 2, and all four labels are right
first_in_1 = 0.2 * 0.05 * 0.95**3  # the first label is wrong
first_in_3 = 0.8**2 * 0.2 * 0.05 * 0.95**3  # the second label is wrong
later = 0.8**3 * (0.2 * 0.05**2 * 0.95**2 + 0.8 * 0.05**3 * 0.95)  # in cell 4, or nowhere: nearly nothing
total = first_in_1 + first_in_2 + first_in_3 + later
print(f"cell 2: {(first_in_2 + 0.2 * first_in_1) / total:.2f}")  # behind a first car in cell 1 it keeps its 0.2
print(f"cell 3: {(first_in_3 + 0.2 * (first_in_1 + first_in_2)) / total:.2f}")
print(f"its own pixel only: {0.2 * 0.95 / (0.2 * 0.95 + 0.8 * 0.05):.2f}")

# %% jupyter={"source_hidden": true}
exact, own = exact_ray([0, 1, 1, 1]), cell_by_cell([0, 1, 1, 1])
np.testing.assert_allclose(exact[1], (first_in_2 + 0.2 * first_in_1) / total)
np.testing.assert_allclose(exact[2], (first_in_3 + 0.2 * (first_in_1 + first_in_2)) / total)
print("P(car) of the four cells, exact:", exact.round(2), " own pixel only:", own.round(2))
assert d_separated(stage.model, "m1", "m3")
assert not d_separated(stage.model, "m1", "m3", given=("a3",))

# %% [markdown]
# A reader that gives each cell its own pixel, as equation (1) does, believes in three cars with 0.83 each. In the
# image there is evidence for one: 0.91, and 0.23 behind it. Behind the first car the image says nothing.
#
# How much of a street is that? In the last frame, look up all cells in view on the ground plane. Compare how far away
# the cell is with how far away the thing is that its pixel shows. Then do it again with each cell at the road's *own*
# height, because this road has a crest:

# %% jupyter={"source_hidden": true}
ground = places_of(*np.nonzero(frame.labels.image == ROAD))
profile = np.polyfit(ground[:, 0], ground[:, 2], 3, w=1 / (1 + ground[:, 0]))
along_road = np.polyval(profile, np.minimum(spec.centers()[..., 0], 60))
centres = spec.centers().reshape(-1, 2)
wanted = np.linalg.norm(centres - eye[:2], axis=1)
shares = {}
for name, height in (("at 0 m", np.zeros(len(centres))), ("at the road's height", along_road.ravel())):
    lifted = np.column_stack([centres, height])
    pixels, visible = project(transform_points(camera.T_camera_from_grid, lifted), camera)
    cols, rows = pixels[visible].round().astype(int).T
    ratio = np.linalg.norm(places_of(rows, cols)[:, :2] - eye[:2], axis=1) / wanted[visible]
    shares[name] = [100 * part.mean() for part in (ratio < 0.9, np.abs(ratio - 1) <= 0.1, ratio > 1.1)]
    print(f"cells {name:<21} pixel shows something nearer {shares[name][0]:.0f} %", end=", ")
    print(f"in place {shares[name][1]:.0f} %, farther {shares[name][2]:.0f} %")
    if name == "at 0 m":
        hidden = np.zeros(spec.shape, bool)
        hidden.ravel()[visible] = ratio < 0.9
np.testing.assert_allclose(np.polyval(profile, 40), -0.7, atol=0.03)

# %% jupyter={"source_hidden": true} alt="two maps: the classes that the ground plane reads, with cars drawn out into long streaks, hatched where something nearer is read; and the true classes"
maps = {"read on the ground plane": read_at(0.0), "truth": frame.labels.birdseye_on(spec)}
fig = plotting.label_maps(spec, maps, KITTI_14)
plt.rcParams["hatch.color"] = "white"
fig.axes[0].contourf(
    spec.centers()[0, :, 1], spec.centers()[:, 0, 0], hidden, [0.5, 1.5], colors="none", hatches=["////"]
)
plt.show()

# %% [markdown]
# On the ground plane more than half of the pixels show something nearer (hatched), which is drawn out into long streaks.
# Another third show something *farther*, because the road falls away and the ray passes over it. At the road's own
# height these are nearly gone, so the crest was the cause. The hidden cells stay, and no plane repairs them.
#
# So *in view* isn't yet *seen*. The LIDAR knows which cells are hidden: one reason to use both sensors.
#
# ## Does it work on a real street?
#
# The same code on a real camera, from PandaSet: another lens, another vehicle, the camera 2.09 m up. We have no true
# depth here, but the LIDAR has returns with heights of their own.

# %% jupyter={"source_hidden": true} alt="a real street with LIDAR returns on it, coloured by depth, that follow the cars' outlines; below it the dots of the ground plane, which lie on the road and also over the cars"
real = real_drive()[9]
real_eye = invert_rigid(real.camera.T_camera_from_grid)[:3, 3]
returns = real.points_grid[:, :3].astype(float)
at, in_view = project(transform_points(real.camera.T_camera_from_grid, returns), real.camera)
cols, rows = at[in_view].round().astype(int).T
road = returns[in_view][real.labels.image[rows, cols] == ROAD]
road_height = np.median(road[np.abs(road[:, 0] - 40) < 2, 2])
lands = 40 * real_eye[2] / (real_eye[2] - road_height)
np.testing.assert_allclose((real_eye[2], road_height, 40 - lands), (2.09, -0.08, 1.5), atol=0.06)
fig, axes = plt.subplots(2, 1, figsize=(5.6, 4), layout="constrained")
plotting.points_on_image(real, axes[0], size=2)
plotting.plane_on_image(coarse, 0.0, paled(real), ax=axes[1], size=4)
axes[0].set_title("A: LIDAR returns", fontsize="medium")
axes[1].set_title("B: centres of cells of 1 m on the ground plane", fontsize="medium")
fig.supxlabel(real_drive().credit, fontsize=8)
plt.show()

# %% [markdown]
# A: nearer returns are lighter. Their colour changes at the outlines of cars and trees, as it must if the calibration is
# right. B: a carpet on the road. It also lies over the cars, because equation (1) knows nothing of cars. The
# street is nearly flat; still its road 40 m ahead, 8 cm lower than the plane, is drawn 1.5 m too near.
#
# So it works, and it shows the same limits.
#
# ## Where this breaks: a camera that nods
#
# Equation (1) is exact about a camera that is where you think it is. Let the camera be turned by $\psi$ = 1°, and
# nobody has told the calibration.
#
# **Predict before you run.** The toy camera sees the ground at $Z$ in the row that is $300 / Z$ below the horizon, so
# that at 30 m is 10 rows below. The car brakes, and the camera nods by a degree, 3.5 rows. Which ground does it see
# there now? And if the nose goes up instead?
#
# <details><summary>Answer</summary>
#
# What belongs to 13.5 rows below the horizon, or to 6.5: the ground at 22 m, or at 46 m.
#
# </details>
#
# With $\tan\psi \approx \psi$ the focal length drops out. Where the ground at $x$ is expected, the ground at $x'$ is
# seen (plus with the nose down, minus with the nose up):
#
# $$ \frac{1}{x'} = \frac{1}{x} \pm \frac{\psi}{z_\text{cam}} $$


# %% jupyter={"outputs_hidden": true}
def nodded(camera, degrees):
    """Return the camera after a small turn about its own X axis, the nose down."""
    turn = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    T = rigid_transform(turn, np.zeros(3)) @ camera.T_camera_from_lidar
    return Camera(camera.K, T, camera.size, camera.lidar_height)


def seen_instead(x, camera, truly):
    """Return how far ahead the ground is that is really seen where the calibration expects (x, 0)."""
    u, v = project(transform_points(camera.T_camera_from_grid, np.array([x, 0.0, 0])), camera)[0]
    back = invert_rigid(truly.T_camera_from_grid)
    ray = back[:3, :3] @ np.linalg.inv(truly.K) @ [u, v, 1]
    return (back[:3, 3] - back[2, 3] / ray[2] * ray)[0] if ray[2] < 0 else np.nan


for sign, name in ((1, "down"), (-1, "up")):
    x = seen_instead(30.0, toy, nodded(toy, sign))
    np.testing.assert_allclose(1 / x, 1 / 30 + sign * np.radians(1) / 1.5, rtol=0.01)
    print(f"nose {name}: the cell 30 m ahead reads the ground {x:.0f} m ahead")

# %% jupyter={"source_hidden": true} alt="which ground a cell reads, against the cell's distance, for half a degree and one degree: nose up bends far above the diagonal, nose down below it"
fig, ax = plt.subplots(figsize=(6, 3), layout="constrained")
x = np.linspace(6.5, 60, 60)
ax.plot([0, 60], [0, 60], color="0.6", linewidth=1, label="as calibrated")
for degrees, style in ((0.5, "--"), (1.0, "-")):
    for sign, colour, name in ((-1, "#d55e00", "up"), (1, "#0072b2", "down")):
        read = [seen_instead(a, camera, nodded(camera, sign * degrees)) for a in x]
        ax.plot(x, read, style, color=colour, label=f"{degrees}° nose {name}")
ax.set(xlabel="cell, x [m]", ylabel="reads the ground at x [m]", xlim=(0, 60), ylim=(0, 60))
ax.legend(fontsize=9, loc="center left", bbox_to_anchor=(1, 0.5))
plt.show()

# %% [markdown]
# The figure shows it for the drive's camera. Near the car the error is small. Far ahead it explodes, because there the
# camera looks at the road at a very flat angle.
#
# So a calibration must be right to a fraction of a degree.
#
# ## In five lines
#
# 1. A point has one pixel: scale by the focal length, divide by the depth, shift. A pixel has a whole ray of points.
# 2. Resizing scales from the image's edge, half a pixel before the first centre; cropping shifts.
# 3. Transforms are read by names. The inverse undoes the shift first, then the turn.
# 4. A plane draws things in place only at its own height: 16 cm of sidewalk are 0.88 m on the map.
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
# [Exercise 05](exercises/05_pixels.ipynb): undo a crop, transforms by name, what a cell's pixel really shows, a height
# from a miss on the map, and a calibration with a fault that you find. Next: lecture [06](06_planes.ipynb),
# reading between pixels.

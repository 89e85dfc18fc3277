# %% [markdown]
# # Cells and slopes: how many pixels a cell has, and which plane a road needs
#
# **In one sentence.** A cell's share of the image falls with the third power of its distance, and a road that falls
# away needs planes below zero.
#
# **You will be able to**
# - compute how many pixels a cell has, and up to which distance it has one of its own;
# - predict which ground a cell reads on a slope, and say what planes below zero would bring and cost.
#
# **Prerequisites.** Lecture [05](../05_pixels.ipynb).
#
# **Time.** 24 minutes; the computer needs seconds.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import plane_pixels

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"
ROAD = KITTI_14.index("road")
spec, drive = GridSpec.compact(), sample_drive()
frame = drive[len(drive) - 1]
camera = frame.camera
T_grid_from_camera = invert_rigid(camera.T_camera_from_grid)
eye = T_grid_from_camera[:3, 3]
z_cam = eye[2]
axes_of_camera = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
toy_K = np.array([[200.0, 0, 160], [0, 200, 48], [0, 0, 1]])
toy = Camera(toy_K, rigid_transform(axes_of_camera, np.zeros(3)), size=(96, 320), lidar_height=1.5)


def places_of(rows, cols, frame=frame):
    """Return what pixels see, in the grid frame, (N, 3), with the simulator's true depth."""
    Z = frame.labels.depth[rows, cols].astype(float)
    triples = np.stack([cols, rows, np.ones_like(rows)]) * Z
    return transform_points(T_grid_from_camera, (np.linalg.inv(camera.K) @ triples).T)


# %% [markdown]
# ## How many pixels is a cell?
#
# A cell of 0.5 m on the ground, 10 m ahead of the toy camera of lecture 05 (1.5 m up, $f$ = 200 pixels). Across,
# similar triangles: 200 · 0.5 / 10 = 10 pixels. Along, it reaches from 9.75 m to 10.25 m, from row 48 + 300 / 9.75 =
# 78.77 to 48 + 300 / 10.25 = 77.27: 1.5 pixels. So its area is 15 pixels.
#
# **Predict before you run.** And 20 m ahead?
#
# <details><summary>Answer</summary>
#
# 5 across. Along, 300 / 19.75 - 300 / 20.25 = 0.375, a quarter: seen from twice as far *and* twice as flat. Together
# 1.9 pixels, an eighth.
#
# </details>
#
# $$ \text{across} = \frac{f_u\,\text{cell}}{Z}, \qquad
#    \text{along} \approx \frac{f_v\, |z_\text{cam} - \delta|\,\text{cell}}{Z^2}, \qquad
#    \text{pixels per cell} \approx \frac{f_u f_v\, |z_\text{cam} - \delta|\,\text{cell}^2}{Z^3} $$
#
# Here $\delta$ is the plane's height, as in lecture 05; for the ground it is 0.


# %% jupyter={"outputs_hidden": true}
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
# Now the drive's camera. One image is as small as the one that the course's compact network sees, one as large as the
# paper's, and cells are of half a metre as in the course, or of 0.2 m as in the paper:

# %% jupyter={"source_hidden": true} alt="three magnified pieces of the image with one cell outlined: a wide box 7 m ahead, a slit at 15 m, a hair at 40 m; and a chart of pixels per cell against distance, straight lines that fall by three decades per decade"
cameras = {"compact": camera.resized((96, 320)), "paper's": camera.resized((375, 1242))}
compact = cameras["compact"]
small = resize_image(frame.image, (96, 320))
fig, axes = plt.subplots(1, 4, figsize=(8.8, 2.6), layout="constrained", width_ratios=(1, 1, 1, 1.8))
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
axes[3].set(xlabel="x, forward [m]", ylabel="pixels per cell")
axes[3].set_xticks((10, 20, 50), labels=("10", "20", "50"))
axes[3].minorticks_off()
axes[3].legend(fontsize=8, loc="lower left")
plt.show()

# %% [markdown]
# Red: one cell of half a metre in the compact network's image; each panel is 18 pixels wide, and its white part is
# below the image. Right: under the grey line a cell has less than a pixel of its own. Then it shares pixels with its
# neighbours. How many do share?

# %%
(pixels,), (visible,) = plane_pixels(spec, [0.0], compact)
x_cells = spec.centers()[..., 0]
for near, far in ((6, 20), (20, 40), (40, 71)):
    band = visible & (x_cells >= near) & (x_cells < far)
    different = np.unique(pixels[band].round(), axis=0)
    print(f"{near:>2} to {far} m ahead: {band.sum()} cells look into {len(different)} different pixels")

# %% [markdown]
# So beyond 40 m about eight cells share one pixel, and with it its error. They are one witness, not eight.
#
# ## A road that climbs, a road that falls
#
# A road that climbs by 4 % from 10 m on is 1.2 m high 40 m ahead. The ground plane's cell at 40 m looks along a ray
# that sinks by 1.5 m in 40 m, and meets the road earlier, where $1.5 - 0.0375\,x = 0.04\,(x - 10)$: at 24.5 m.
#
# **Predict before you run.** And if the road falls by 4 %? Which planes would help?
#
# <details><summary>Answer</summary>
#
# The ray of the cell at 40 m sinks by 3.75 %, the road by 4: they never meet, and the cell reads what lies beyond. A
# plane 1.2 m *below* zero is in place at 40 m, as the one 1.2 m above is uphill. The paper's planes begin at zero.
#
# </details>

# %% jupyter={"outputs_hidden": true}
for slope, name in ((0.04, "uphill"), (-0.04, "downhill")):
    meets = (1.5 + slope * 10) / (1.5 / 40 + slope)  # 1.5 - 1.5 / 40 * meets = slope * (meets - 10)
    reads = f"reads the road at {meets:.1f} m" if meets > 0 else "never reads the road"
    print(f"{name}: the ground plane's cell at 40 m {reads}; the road is {slope * 30:+.1f} m high there")

# %% [markdown]
# The drive has such a road, with a crest, and the vehicle pitches. How high is the road in the grid's frame, which is
# fixed to the vehicle? The LIDAR measures it, in simulation and on a real street:


# %% jupyter={"source_hidden": true}
def road_profile(frame, x):
    """Return the median height of the road at distances x, NaN where no labelled return lies."""
    at, in_view = project(transform_points(frame.camera.T_camera_from_grid, frame.points_grid[:, :3]), frame.camera)
    cols, rows = at[in_view].round().astype(int).T
    road = frame.points_grid[in_view][frame.labels.image[rows, cols] == ROAD]
    near = [road[np.abs(road[:, 0] - a) < 0.05 * a, 2] for a in x]
    return np.array([np.median(part) if len(part) > 3 else np.nan for part in near])


# %% jupyter={"source_hidden": true} alt="height of the road against distance: in the simulated drive from plus 0.1 m to minus 1.1 m at 52 m, differently in each frame; on the real street within 0.2 m of zero up to 64 m"
x = np.arange(8, 66, 4.0)
fig, axes = plt.subplots(1, 2, figsize=(8, 2.8), layout="constrained", sharey=True)
for ax, some_drive, frames, name in (
    (axes[0], drive, (0, 5, 10, 15, 19), "the drive"),
    (axes[1], real_drive(), (0, 3, 6, 9), "a real street"),
):
    for k in frames:
        ax.plot(x, road_profile(some_drive[k], x), ".-", label=f"frame {k}")
    ax.axhline(0, color="0.6", linewidth=1)
    ax.set(title=name, xlabel="x, forward [m]")
    ax.legend(fontsize="small")
assert np.nanmax(np.abs([road_profile(real_drive()[k], x) for k in (0, 3, 6, 9)])) < 0.2
assert np.isclose(road_profile(drive[19], np.array([52.0]))[0], -1.1, atol=0.06)
axes[0].set_ylabel("height of the road [m]")
fig.supxlabel(real_drive().credit, fontsize=8)
plt.show()

# %% [markdown]
# In the last frame of the drive the road falls to 1.1 m below the grid's zero at 52 m. The real street stays within 0.2
# m. What would planes below zero bring? Take the true labels of the images and all cells that the camera sees. On which
# share of the *road* cells does at least one plane read *road*? More planes can only raise this, so the control is the
# same share among cells that are *not* road: there it should stay low.

# %%
seen = np.stack([f.labels.visible_on(spec) for f in drive])
is_road = np.stack([f.labels.birdseye_on(spec) == ROAD for f in drive])
offered = {}
for name, heights in {"0 m": [0.0], "0 to 0.4 m": [0, 0.2, 0.4], "-1.4 to 0.4 m": np.arange(-1.4, 0.5, 0.2)}.items():
    at, in_view = plane_pixels(spec, heights, camera)
    cols, rows = np.where(in_view[..., None], at, 0).round().astype(int).transpose(3, 0, 1, 2)
    offered[name] = np.stack([((f.labels.image[rows, cols] == ROAD) & in_view).any(axis=0) for f in drive])
band = seen & visible & (x_cells >= 40) & (x_cells < 60)
for name, read in offered.items():
    found, wrong = 100 * read[band & is_road].mean(), 100 * read[band & ~is_road].mean()
    print(f"40 to 60 m, planes {name}: road read on {found:.0f} % of road, {wrong:.0f} % of the rest")

# %% [markdown]
# The ground plane offers *road* on 15 % of the road, because in many frames it looks over the crest, and planes a little
# higher don't change that. With planes from -1.4 m on it is offered on 99 %. But also on half of the other cells: a low
# plane gives a cell a lower pixel, and that may show the road in front of whatever stands in the cell.
#
# So planes below zero put the right answer among those that are offered, and make choosing harder.
#
# ## Where this breaks
#
# The shares say what is offered, not what a network makes of it: nobody trained one with planes below zero here. And the
# profiles are those of one simulated drive and of two seconds of one real street.
#
# ## In three lines
#
# 1. Pixels per cell fall like $Z^{-3}$: once for the width, twice for the depth.
# 2. Uphill the planes above zero help. Downhill only planes below zero do.
# 3. What is offered is not yet chosen.
#
# ## Further reading
#
# - Geiger, Lenz, Stiller, Urtasun, *Vision meets robotics: the KITTI dataset*, IJRR 32(11), 2013: the sensors, their
#   frames and their calibration.
# - Labayrade, Aubert, Tarel, *Real time obstacle detection on non flat road geometry through v-disparity
#   representation*, IV 2002: finding the road's profile in the image.

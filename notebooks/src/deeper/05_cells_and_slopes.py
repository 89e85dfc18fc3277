# %% [markdown]
# # Cells and slopes: how many pixels a cell has, and which plane a road needs
#
# **In one sentence.** A cell's share of the image falls with the third power of its distance, and a road that falls
# away needs planes below zero: both are measured here, on the toy camera, on the drive and on a real street.
#
# **You will be able to**
# - compute how many pixels a cell of a plane has, and up to which distance it has one of its own;
# - say how far off the best of several planes is, for the pixels of a car;
# - predict which ground a cell reads on a slope, and choose planes for a given road.
#
# **Prerequisites.** Lecture [05](../05_pixels.ipynb).
#
# **Time.** 29 minutes; the computer needs seconds.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
from scipy import ndimage

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.camera import Camera, invert_rigid, project, rigid_transform, transform_points
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import plane_heights, plane_pixels

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"
ROAD, CAR = KITTI_14.index("road"), KITTI_14.index("car")
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
# The drive's camera, with the image that the course's compact network sees (96 x 320), and with an image as large as
# the paper's (375 x 1242); cells of 0.5 m as in the course, and of 0.2 m as in the paper:

# %%
cameras = {"compact": camera.resized((96, 320)), "paper's": camera.resized((375, 1242))}
print(f"{'image':<9}{'cell':>6}" + "".join(f"{f'{Z} m ahead':>25}" for Z in (5, 20, 50)) + f"{'one pixel at':>14}")
for name, some_camera in cameras.items():
    for cell in (0.2, 0.5):
        sizes = [pixels_of_cell(cell, Z, some_camera, z_cam) for Z in (5, 20, 50)]
        columns = "".join(f"{f'{across:.1f} x {along:.2f} = {across * along:.2f}':>25}" for across, along in sizes)
        reach = (some_camera.K[0, 0] * some_camera.K[1, 1] * z_cam * cell**2) ** (1 / 3)
        print(f"{name:<9}{cell:>4} m{columns}{f'{reach:.0f} m':>14}")

# %% jupyter={"source_hidden": true} alt="three magnified pieces of the image with one cell outlined: a wide box 7 m ahead, a slit at 15 m, a hair at 40 m; and a chart of pixels per cell against distance, straight lines that fall by three decades per decade"
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
# Red: one cell of half a metre in the compact network's image; each panel is 18 pixels wide, and its white part lies below
# the image. On the right, below the grey line, a cell has less than a pixel of its own, so it shares pixels with its neighbours. How many do share? Count the different
# pixels that the cells of the ground plane meet:

# %%
(pixels,), (visible,) = plane_pixels(spec, [0.0], compact)
x_cells = spec.centers()[..., 0]
print(f"of all cells in view {100 * (x_cells[visible] > 40).mean():.0f} % lie beyond 40 m")
for near, far in ((6, 20), (20, 40), (40, 71)):
    band = visible & (x_cells >= near) & (x_cells < far)
    different = np.unique(pixels[band].round(), axis=0)
    print(f"{near:>2} to {far} m ahead: {band.sum()} cells look into {len(different)} different pixels")

# %% [markdown]
# Cells that read one pixel share its error, so they are one witness (lecture [06](../06_planes.ipynb)).
#
# ## The best of several planes
#
# Each pixel of lecture 05's red car has a true height. Suppose that someone chose, for each pixel, the plane on which
# it lands nearest to its true place. How far off is it still, with all 20 planes of the course, 0.2 m apart, with every
# second one, and so on?

# %%
instances, _ = ndimage.label(frame.labels.image == CAR)
rows, cols = np.nonzero((instances == instances[140, 120]) & (frame.labels.depth < 13))
places = places_of(rows, cols)


def best_of(heights, places):
    """Return the distance from the true place to the nearest of the places that the planes offer, (N,)."""
    down = (z_cam - np.asarray(heights)[:, None]) / (z_cam - places[:, 2])
    drawn = eye[:2] + np.where(down > 0, down, np.nan)[..., None] * (places - eye)[:, :2]
    return np.nanmin(np.linalg.norm(drawn - places[:, :2], axis=2), axis=0)


for D in (1, 2, 5, 10, 20):
    off = best_of(plane_heights(20)[:: 20 // D], places)
    says = f"half of the pixels are less than {np.median(off):.1f} m off"
    print(f"{D:>2} planes: {says}, {100 * (off > spec.cell).mean():.0f} % more than a cell")
off = best_of(plane_heights(20), places)
for low, high in ((0, 0.8), (0.8, 1.2), (1.2, 1.6)):
    band = (places[:, 2] >= low) & (places[:, 2] < high)
    print(f"20 planes, pixels from {low} to {high} m: half are less than {np.median(off[band]):.1f} m off")

# %% [markdown]
# The right *height* is never farther away than 10 cm, half the spacing. On the map that is little for a wheel and much
# for a roof: the nearer to the camera's own height, the more metres of road lie in 10 cm of height. With two planes, at
# 0 and 2 m, nothing is gained over one: the second is above the camera, and the rays of this car point down. With all
# twenty, four in ten pixels are still off by more than a cell.
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
for side, name in ((0.04, "uphill"), (-0.04, "downhill")):
    for x in (20, 30, 40):
        z_road = side * (x - 10)
        meets = (1.5 + side * 10) / (1.5 / x + side)  # 1.5 - 1.5 / x * meets = side * (meets - 10)
        reads = f"reads the road at {meets:.1f} m" if meets > 0 else "never reads the road"
        off = [np.abs(heights - z_road).min() for heights in (plane_heights(), plane_heights() - 1.2)]
        print(f"{name}, ground plane's cell at {x} m {reads}", end="; ")
        print(f"nearest plane off by {off[0]:.1f} m, with 20 planes from -1.2 m by {off[1]:.1f} m")

# %% [markdown]
# The drive has such a road: it has a crest, and the vehicle pitches. Where does the road lie in the grid's frame, which is
# fixed to the vehicle? The LIDAR measures it, in simulation and on the real street:


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
largest = np.nanmax(np.abs([road_profile(real_drive()[k], x) for k in (0, 3, 6, 9)]))
print(f"last frame of the drive, 40 m ahead: {road_profile(drive[19], np.array([40.0]))[0]:.2f} m", end="; ")
print(f"real street, farthest from zero: {largest:.2f} m")
axes[0].set_ylabel("height of the road [m]")
fig.supxlabel(real_drive().credit, fontsize=8)
plt.show()

# %% [markdown]
# In the last frame of the drive the road falls to 1.1 m below the grid's zero at 52 m. (A dot is missing where fewer
# than four labelled returns lie on the road.) What would planes below zero bring? Take the true labels of the images,
# and all cells whose true class is road and that the camera sees. On which share of them does at least one plane read
# *road*? More planes can only raise this share, so ask the same for cells that it sees and that are *not* road: there
# it should stay low.

# %%
seen = np.stack([f.labels.visible_on(spec) for f in drive])
is_road = np.stack([f.labels.birdseye_on(spec) == ROAD for f in drive])
offered = {}
for name, heights in {"0 m": [0.0], "0 to 0.4 m": [0, 0.2, 0.4], "-1.4 to 0.4 m": np.arange(-1.4, 0.5, 0.2)}.items():
    at, in_view = plane_pixels(spec, heights, camera)
    cols, rows = np.where(in_view[..., None], at, 0).round().astype(int).transpose(3, 0, 1, 2)
    offered[name] = np.stack([((f.labels.image[rows, cols] == ROAD) & in_view).any(axis=0) for f in drive])
for near, far in ((6, 20), (20, 40), (40, 60)):
    band = seen & visible & (x_cells >= near) & (x_cells < far)
    for name, read in offered.items():
        found, wrong = 100 * read[band & is_road].mean(), 100 * read[band & ~is_road].mean()
        print(f"{near} to {far} m, planes {name}: road read on {found:.0f} % of road, {wrong:.0f} % of the rest")

# %% [markdown]
# From 40 to 60 m the ground plane offers *road* on 15 % of the cells that are road, because in many frames it looks
# over the crest, and planes a little higher don't change that. With planes from -1.4 m on, 99 % are offered it. But so
# are up to half of the others: a low plane gives a cell a lower pixel, and that may show the road in front of whatever
# stands in the cell. So a right answer is among those that are offered, and choosing becomes harder.
#
# ## Where this breaks
#
# The counts say what is offered, not what a network makes of it: nobody trained one with planes below zero here. The
# profiles are those of one simulated drive and of two seconds of one real street. The formula for pixels per cell
# assumes a level camera and a small cell.
#
# ## In five lines
#
# 1. Pixels per cell fall like $Z^{-3}$: once for the width, twice for the depth.
# 2. The right height is among the planes within 10 cm; the right place isn't, near the camera's own height.
# 3. Uphill the planes above zero help. Downhill only planes below zero do.
# 4. In the drive's last frame the road lies 0.75 m below the grid's zero 40 m ahead; on the real street, in four frames, at
#    most 0.16 m off.
# 5. What is offered is not yet chosen.
#
# ## Further reading
#
# - Geiger, Lenz, Stiller, Urtasun, *Vision meets robotics: the KITTI dataset*, IJRR 32(11), 2013: the sensors, their
#   frames and their calibration.
# - Labayrade, Aubert, Tarel, *Real time obstacle detection on non flat road geometry through v-disparity
#   representation*, IV 2002: finding the road's profile in the image.

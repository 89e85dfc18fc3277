# %% [markdown]
# # 06 · Sampling that learns: equation (2) and its gradient
#
# **In one sentence.** A point of a plane reads the four pixels around it with four weights, and on the way back each
# pixel receives its share of the gradient by the same four weights; so an error on the map can train the image network.
#
# **You will be able to**
# - compute a bilinear sample by hand, and its gradient with respect to (short: *in*) the scores, u and v;
# - write equation (2) as a sparse matrix, and say why its transpose (the *adjoint*) carries the gradient;
# - check any gradient by finite differences;
# - calibrate a camera by gradient descent, and say what it finds when the ground isn't flat;
# - find an error of half a pixel with a ramp, and say what it costs on the ground, in metres.
#
# **Prerequisites.** Lecture [05](05_pixels.ipynb): equation (1) gives a pixel (u, v) to each point of each plane.
# Derivatives and the chain rule; a matrix times a vector.
#
# **Time.** 116 minutes; the computer needs less than one.
#
# **Paper.** Section 3.3, equation (2), after Jaderberg et al. (2015).

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from IPython.display import Markdown
from ipywidgets import FloatSlider, interact
from matplotlib.colors import LogNorm
from scipy import ndimage

from semgrid_edu.frame import resize_image
from semgrid_edu import fast, plotting
from semgrid_edu.camera import transform_points
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.graphical import d_separated
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import PlaneSampler, plane_heights, plane_pixels, sample_planes_naive
from worlds.lecture_00_ledger import ledger, ledger_table
from worlds.lecture_06_shared_pixel import believed_by_readers, shared_pixel

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
torch.set_num_threads(1)
drive, spec, heights = sample_drive(), GridSpec.compact(), plane_heights()
frame = drive[0]
camera = frame.camera.resized((96, 320))
camera_height = camera.T_camera_from_grid[1, 3]
pixels, visible = plane_pixels(spec, heights, camera)
image = resize_image(frame.image, camera.size)
true_labels = resize_labels(frame.labels.image, camera.size)
flat = [KITTI_14.index(name) for name in ("road", "sidewalk")]
x_cells = spec.centers()[..., 0]

# %% jupyter={"source_hidden": true}


def ground_heights(frame, from_lidar):
    """Return the height of the ground in each cell: 0, or a curved surface fitted to the scan's lowest returns."""
    if not from_lidar:
        return np.zeros(spec.shape)
    x, y, z = frame.points_grid[:, :3].T.astype(float)
    near = (x > 5) & (x < 30) & (np.abs(y) < 6)
    terms, z = np.stack([np.ones(near.sum()), x[near], y[near], x[near] ** 2], axis=1), z[near]
    keep = np.abs(z) < 0.6
    for _ in range(10):
        surface = np.linalg.lstsq(terms[keep], z[keep])[0]
        keep = np.abs(terms @ surface - z) < 0.12
    x, y = np.moveaxis(spec.centers(), -1, 0)
    return surface[0] + surface[1] * x + surface[2] * y + surface[3] * x**2


# %% jupyter={"source_hidden": true}


def lesson(frame, from_lidar=False):
    """Return labels of an image (C, h, w), classes of ground cells that it sees (C, J), their places (J, 3)."""
    truth = frame.labels.birdseye_on(spec)
    cells = frame.labels.visible_on(spec) & np.isin(truth, flat) & (x_cells > 8) & (x_cells < 25)
    on_ground = np.dstack([spec.centers(), ground_heights(frame, from_lidar)])[cells]
    points = torch.from_numpy(transform_points(camera.T_camera_from_grid, on_ground))
    labels = resize_labels(frame.labels.image, camera.size)
    return [torch.from_numpy(np.stack([a == c for c in flat])).double() for a in (labels, truth[cells])] + [points]


def pixels_at(points, pitch):
    """Return u and v of points seen by the camera turned down by `pitch`, radians: equation (1)."""
    X, Y, Z = points.T
    Y, Z = torch.cos(pitch) * Y - torch.sin(pitch) * Z, torch.sin(pitch) * Y + torch.cos(pitch) * Z
    K = torch.from_numpy(camera.K)
    return K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]


def read_points(s, u, v):
    """Return what points read, equation (2) by PyTorch: (C, h, w) scores, (J,) pixels -> (C, J)."""
    where = torch.stack([2 * u / (s.shape[2] - 1) - 1, 2 * v / (s.shape[1] - 1) - 1], dim=-1)
    return F.grid_sample(s[None], where[None, None], align_corners=True)[0, :, 0]


# %% jupyter={"source_hidden": true}


def loss_at(pitch, lessons):
    """Return the mean squared difference between what the points read and the map."""
    return sum(((read_points(s, *pixels_at(points, pitch)) - t) ** 2).mean() for s, t, points in lessons) / len(lessons)


def descend(degrees, lessons, steps=20):
    """Return pitch (degrees) and loss along a descent, (steps, 2)."""
    pitch, path = torch.tensor(np.radians(degrees), requires_grad=True), []
    for _ in range(steps):
        loss = loss_at(pitch, lessons)
        path.append((np.degrees(pitch.item()), loss.item()))
        (gradient,) = torch.autograd.grad(loss, pitch)
        with torch.no_grad():
            pitch -= 0.002 * gradient
    return np.array(path)


chosen = (0, 5, 10, 15, 19)
on_zero, on_lidar = ([lesson(drive[k], from_lidar) for k in chosen] for from_lidar in (False, True))

# %% [markdown]
# ## A calibration that converges on the image
#
# Suppose we believe that the drive's camera points two degrees lower than it does. Nobody tells the program. It has a map of
# road and sidewalk, the ground's height from the LIDAR, the labels of five images, and a derivative. Watch:

# %% jupyter={"source_hidden": true} alt="animation: A, dots of road and sidewalk lie too high in the image and slide down within four steps until the border between them lies on the kerb; B, the pitch over the steps falls from two degrees to minus 0.3"
path = descend(2.0, on_lidar, steps=12)


def converging():
    """Yield the figure with the points at each step."""
    fig = plt.figure(figsize=(8.2, 2.7), layout="constrained")
    _, t, points = on_lidar[0]
    for step, (degrees, _) in enumerate(path):
        fig.clear()
        left, right = fig.subplots(1, 2, width_ratios=(3, 1))
        left.imshow(130 + image.mean(axis=2) // 16 * 7, cmap="gray", vmin=0, vmax=255)
        u, v = (a.numpy() for a in pixels_at(points, torch.tensor(np.radians(degrees))))
        for c, colour in enumerate(KITTI_14.colours(np.array(flat)) / 255):
            left.plot(u[t[c] > 0], v[t[c] > 0], ".", color=colour, markersize=2, label=KITTI_14.names[flat[c]])
        left.set(ylim=(95.5, 30), xlim=(60, 319.5), xlabel="u [pixels]", ylabel="v [pixels]")
        left.set_title(f"A: the map's cells in the image, step {step}")
        left.legend(loc="upper left", fontsize="small", markerscale=4)
        right.plot(path[: step + 1, 0], ".-", color="black")
        right.axhline(0, color="0.6", linewidth=1)
        right.set(xlim=(-0.5, 11.5), ylim=(-0.7, 2.2), xlabel="step", ylabel="pitch [degrees]", title="B")
        yield fig


plotting.animate(converging(), period=0.5, alt="the map's cells slide onto road and sidewalk as the pitch is learnt")

# %% [markdown]
# A: each dot is a cell that the map calls road or sidewalk, at the pixel that equation (1) gives to it with the pitch
# learnt so far. B: that pitch. After four steps the border between the colours lies on the kerb. (Why it stops
# at -0.3° comes below.) This works because *reading a pixel has a derivative*: the loss on the map says
# in which direction each dot should move, and the chain rule collects that into one number. The same derivative, in
# the scores instead of the place, trains the whole image network (lecture 08). This lecture builds both, from four
# numbers on.
#
# ### The graph
#
# One thing first that no derivative repairs. $m$ is what lies on a patch of ground, $a$ the label of the pixel that
# shows it, and $x_1, x_2, \dots$ are what different cells read there.
#
# **Predict before you run.** Before you look, a car is as probable as none. The pixel is right with 0.8, and all four
# cells read *car*. How probable is a car? How probable would it be if each cell had read a pixel of its own? Draw the
# graph: given $m$, are $x_1$ and $x_2$ independent?
#
# <details><summary>Answer</summary>
#
# 0.80, for one cell, four or a hundred: they all repeat the same reading. With a pixel each it would be 0.996. Given
# $m$ they are dependent, because the pixel's error reaches both; given $a$ they are independent.
#
# </details>

# %% jupyter={"outputs_hidden": true}
stage = shared_pixel()
for n in (1, 2, 4, 10):
    exact, independent = believed_by_readers(n)
    print(f"{n:>2} cells say car: exact {exact:.2f}, as if independent {independent:.3f}")
assert not d_separated(stage.model, "x1", "x2", given=("m",))
assert d_separated(stage.model, "x1", "x2", given=("a",))
on_street = plane_pixels(spec, heights, real_drive().camera.resized(camera.size))
for name, (at, seen) in {"drive": (pixels, visible), "real street": on_street}.items():
    bands = [at[0][seen[0] & (x_cells >= a) & (x_cells < b)].round() for a, b in ((6, 20), (20, 40), (40, 71))]
    shares = ", ".join(f"{len(read_by) / len(np.unique(read_by, axis=0)):.1f}" for read_by in bands)
    print(f"on the {name}, cells per pixel from 6, 20 and 40 m on: {shares}")

# %% tags=["graph"] jupyter={"source_hidden": true, "outputs_hidden": true} alt="a directed graph: the patch m, below it the pixel a, below it four observed cells x1 to x4 that all depend on the pixel; the arrow to x4 is dashed and carries its price"
fig, ax = plt.subplots(figsize=(5.4, 3.2), layout="constrained")
stage.draw(ax)
plt.show()

# %% [markdown]
# Cut is the error that all readers share (dashed at $x_4$, as an example). A network that looks at neighbouring cells can learn to allow for it; a rule
# that multiplies their probabilities can't.
#
# ## A value between four pixels
#
# Take an image of 3 x 3 pixels and one class. Its scores:
#
# | | u = 0 | u = 1 | u = 2 |
# |---|---|---|---|
# | **v = 0** | 0 | 4 | 8 |
# | **v = 1** | 2 | 6 | 0 |
# | **v = 2** | 4 | 0 | 2 |
#
# Equation (1) sends a point of a plane to u = 1.25, v = 0.5: a quarter of the way from column 1 to column 2, half-way
# from row 0 to row 1.
#
# **Predict before you run.** Interpolate: first along row 0, then along row 1, then between the two. What does the
# point read, and how much of it comes from each pixel?
#
# <details><summary>Answer</summary>
#
# Row 0: 3/4 · 4 + 1/4 · 8 = 5. Row 1: 3/4 · 6 + 1/4 · 0 = 4.5. Half-way between:
# 4.75. Multiply the fractions and each pixel has a weight: 3/8 for the 4 and for the 6, 1/8 for the 8 and for the 0.
# They sum to 1. The other five pixels count nothing.
#
# </details>
#
# One rule for all nine pixels: a pixel's weight falls from 1 to 0 as the point moves away by one pixel, across and
# down alike. That is a kernel, $k(t) = \max(0, 1 - |t|)$, and the interpolation is the paper's equation ($n$ counts
# rows, and $m$, no longer what lies on the ground, columns):
#
# $$ p_{c,d,j} = \sum_n \sum_m s_{c,n,m}\; k(u_j - m)\; k(v_j - n) \qquad (2) $$


# %% tags=["eq-2"] jupyter={"outputs_hidden": true}
def kernel(t):
    """Return the bilinear kernel: 1 at the pixel, 0 from one pixel away on."""
    return max(0.0, 1 - abs(t))


def read(s, u, v):
    """Return what a point reads in one class: equation (2), literally."""
    value = 0.0
    for n, m in np.ndindex(s.shape):
        value += s[n, m] * kernel(u - m) * kernel(v - n)
    return value


s = np.array([[0.0, 4, 8], [2, 6, 0], [4, 0, 2]])
points = np.array([[1.25, 0.5], [1.0, 1.5], [0.0, 0.0], [2.0, 2.0], [0.75, 2.0]])
package = sample_planes_naive(s[None], points.reshape(1, 1, 5, 2), np.ones((1, 1, 5), bool))
np.testing.assert_allclose([read(s, u, v) for u, v in points], package.ravel())
for u, v in points:
    print(f"u = {u:.2f}, v = {v:.2f}: reads {read(s, u, v):.2f}")


# %% [markdown]
# On a pixel's centre the point reads that pixel alone; on a line between two centres it reads two.


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, nine pixels with their scores and a cross between four of them, whose weights are 3/8, 3/8, 1/8 and 1/8; right, the triangular kernel with the weights of three columns on it"
def draw_point(ax, u, v):
    """Draw the image, a point on it, and the weights of its pixels."""
    ax.imshow(s, cmap="Blues", vmin=0, vmax=14)
    for n, m in np.ndindex(s.shape):
        weight = kernel(u - m) * kernel(v - n)
        ax.text(m, n - 0.12, f"{s[n, m]:.0f}", ha="center", va="bottom", fontsize=14)
        if weight > 0:
            ax.text(m, n + 0.12, f"times {weight:.3f}", ha="center", va="top", color="tab:red", fontsize=9)
    ax.plot(u, v, "x", color="tab:red", markersize=10, markeredgewidth=2)
    ax.set(xticks=range(3), yticks=range(3), xlabel="u [pixels]", ylabel="v [pixels]")
    ax.set_title(f"the point at ({u:.2f}, {v:.2f}) reads {read(s, u, v):.2f}", fontsize="medium")


fig, axes = plt.subplots(1, 2, figsize=(8, 3.3), layout="constrained")
draw_point(axes[0], 1.25, 0.5)
t = np.linspace(-1.6, 2.4, 401)
axes[1].plot(t, [kernel(x) for x in t], color="black")
for m in range(3):
    axes[1].plot(1.25 - m, kernel(1.25 - m), "o", color="tab:red")
    axes[1].annotate(f"column {m}", (1.25 - m, kernel(1.25 - m)), xytext=(8, 6), textcoords="offset points")
axes[1].set(xlabel="t = u - m [pixels]", ylabel="k(t)", title="across, for u = 1.25", xlim=(-1.6, 2.4))
plt.show()

# %% [markdown]
# Left, the red cross is the point, and the red numbers are weights. A pixel's weight is the product of two numbers between 0 and 1, one across and one
# down. Right, the one across: the point is 0.25 from column 1 (0.75), -0.75 from column 2 (0.25) and 1.25, too far, from
# column 0.
#
# On the drive, equation (1) has found the pixels. Here are three small pieces of one image, magnified, with the points
# of the ground plane on them. Near by, most pixels are read by no point; far ahead, many points share the same four.

# %% jupyter={"source_hidden": true} alt="three magnified pieces of the image with yellow dots: far apart 8 m ahead, lines of dots at 20 m, closer lines that run into each other at 45 m"
fig, axes = plt.subplots(1, 3, figsize=(8, 2.9), layout="constrained")
for ax, ahead in zip(axes, (8, 20, 45), strict=True):
    (row,), (col,), _ = spec.cells(np.array([[ahead, -0.2]]))
    u, v = pixels[0, row, col]
    ax.imshow(image, interpolation="nearest")
    ax.plot(*pixels[0][visible[0]].T, ".", color="yellow", markersize=4)
    ax.set(xlim=(u - 12.5, u + 12.5), ylim=(v + 8.5, v - 8.5), title=f"{ahead} m ahead", xlabel="u [pixels]")
axes[0].set_ylabel("v [pixels]")
plt.show()

# %% [markdown]
# ## The way back: backpropagation
#
# The loss sits at the far end, on the map, and the scores are to learn from it. So we need its derivative with respect to
# each score; a bar marks such a derivative, $\bar p = \partial\,\text{loss} / \partial p$. Suppose that the loss asks the
# point at (1.25, 0.5) for a higher value and a second point, at (1, 1.5), for a lower one: $\bar p = (-1, +2)$.
#
# Nudge the pixel with the 6 by a small amount $\varepsilon$. The first point reads it with weight 3/8 and the second
# with 1/2, so $p$ changes by $(3/8\,\varepsilon, 1/2\,\varepsilon)$ and the loss by $-3/8\,\varepsilon + 2 \cdot
# 1/2\,\varepsilon$. That pixel's $\bar s$ is 0.625.
#
# **Predict before you run.** And that of its neighbour, the 8? Of the 2 in the lower right corner? Which pixels don't
# learn?
#
# <details><summary>Answer</summary>
#
# The 8 is read by the first point alone, with 1/8: -0.125. No point reads the lower right corner or
# column 0: these four pixels get 0. A pixel gets back what it gave: the same weight, times
# the gradient of the reader, **added up** over all readers.
#
# </details>
#
# $$ \bar s_{c,n,m} = \sum_d \sum_j \bar p_{c,d,j}\; k(u_j - m)\; k(v_j - n) $$


# %% jupyter={"outputs_hidden": true}
def give_back(p_bar, points, shape):
    """Return the gradient of the loss in the scores of one class, literally."""
    s_bar = np.zeros(shape)
    for gradient, (u, v) in zip(p_bar, points, strict=True):
        for n, m in np.ndindex(shape):
            s_bar[n, m] += gradient * kernel(u - m) * kernel(v - n)
    return s_bar


def sampler_of(points):
    """Return the package's sampler for a few points of a 3 x 3 image, in double precision."""
    count = len(points)
    return PlaneSampler(points.reshape(1, 1, count, 2), np.ones((1, 1, count), bool), (3, 3)).double()


two, p_bar = points[:2], np.array([-1.0, 2.0])
scores = torch.tensor(s)[None, None].requires_grad_()
planes = sampler_of(two)(scores)
planes.backward(torch.tensor(p_bar).reshape(planes.shape))
np.testing.assert_allclose(give_back(p_bar, two, s.shape), scores.grad[0, 0])
print(give_back(p_bar, two, s.shape))

# %% [markdown]
# Never trust a gradient that you haven't checked. The check needs no mathematics: nudge one score up, nudge it down,
# and see by how much the loss changes. Such *finite differences* are slow, one pixel at a time, and hard to get wrong.


# %%
def loss_of(s):
    """Return a loss whose gradient in p is p_bar."""
    return sum(gradient * read(s, u, v) for gradient, (u, v) in zip(p_bar, two, strict=True))


epsilon, by_differences = 1e-4, np.zeros(s.shape)
for n, m in np.ndindex(s.shape):
    nudge = np.zeros(s.shape)
    nudge[n, m] = epsilon
    by_differences[n, m] = (loss_of(s + nudge) - loss_of(s - nudge)) / (2 * epsilon)
np.testing.assert_allclose(by_differences, give_back(p_bar, two, s.shape), atol=1e-9)
assert torch.autograd.gradcheck(sampler_of(points), scores)  # the same, by PyTorch, for the package
print("largest difference is below 1e-9:", np.abs(by_differences - scores.grad[0, 0].numpy()).max() < 1e-9)

# %% [markdown]
# On the drive, let every point of every plane send back 1. What arrives at a pixel is then the sum of the weights with
# which it is read: how strongly the map will train it.

# %% jupyter={"source_hidden": true} alt="the image with the sum of weights per pixel: bright along the horizon in the middle, dark above and below, white where no point reads: at the lower and upper border, and in a wedge above and below the vanishing point"
sampler = PlaneSampler(pixels, visible, camera.size)
scores = torch.zeros(1, 1, *camera.size, requires_grad=True)
sampler(scores).sum().backward()
weight = np.ma.masked_equal(scores.grad[0, 0].numpy(), 0)
_, ax = plt.subplots(figsize=(7.5, 2.4), layout="constrained")
style = {"norm": LogNorm(0.1, 1000), "cmap": "viridis", "interpolation": "nearest"}
plotting.image_values(weight, "sum of weights", ax=ax, **style)
ax.set(xlabel="u [pixels]", ylabel="v [pixels]", xticks=range(0, 320, 50), yticks=range(0, 96, 20))
plt.show()
print(f"{100 * weight.mask.mean():.0f} % of the pixels are read by no point, so they never learn from the map")
left, middle, right = np.split(scores.grad[0, 0, round(camera.K[1, 2])].numpy(), (107, 213))  # the horizon's row
print(f"on the horizon: left {left.mean():.0f}, in the middle {middle.mean():.0f}, right {right.mean():.0f}")

# %% [markdown]
# No point reads the white pixels. The white wedges in the middle lie between the two middle columns of cells, which run
# towards the vanishing point. Along the horizon a pixel of the middle third is read with a weight that is many times
# that of a pixel at its side. So if all readers send back gradients of the same size and sign, a pixel there receives
# the most.
#
# ## The whole of equation (2) is one matrix
#
# For one calibration the weights never change. Write the nine scores below each other as a vector, take three points
# and write down which point reads which pixel: three rows, nine columns.
#
# **Predict before you run.** How many of the 27 entries aren't zero, for the points (1.25, 0.5), (1, 1.5) and (0, 0)?
# And what does the *column* of the pixel with the 6 say?
#
# <details><summary>Answer</summary>
#
# 4 + 2 + 1 = 7. A row says which pixels a point reads; a column says which points read a pixel: 3/8, 1/2, 0. The gradient above was that column times the gradients of the readers.
#
# </details>
#
# So with $A$ for the matrix, forward is $A$ and backward is its transpose, the **adjoint** of $A$ (the map that moves
# to the other side of a scalar product):
#
# $$ p = A s, \qquad \bar s = A^T \bar p, \qquad \bar p \cdot (A s) = (A^T \bar p) \cdot s $$
#
# The third equation is the test for every pair of a forward and a backward pass: it must hold for *any* $s$ and
# $\bar p$, so a few random ones find nearly every mismatch of the two.


# %% jupyter={"outputs_hidden": true}
def matrix_of(points, shape):
    """Return equation (2) as a matrix, (points, pixels)."""
    h, w = shape
    rows = []
    for u, v in points:
        across = [kernel(u - m) for m in range(w)]
        down = [kernel(v - n) for n in range(h)]
        rows.append(np.outer(down, across).ravel())
    return np.array(rows)


three, p_bar = points[:3], np.array([-1.0, 2.0, 0.5])
A = matrix_of(three, s.shape)
np.testing.assert_allclose(A @ s.ravel(), [read(s, u, v) for u, v in three])
np.testing.assert_allclose(A.T @ p_bar, give_back(p_bar, three, s.shape).ravel())
rng = np.random.default_rng(0)
some_s, some_p_bar = rng.normal(size=9), rng.normal(size=3)
np.testing.assert_allclose(some_p_bar @ (A @ some_s), (A.T @ some_p_bar) @ some_s)
print(f"p_bar . (A s) = {p_bar @ (A @ s.ravel()):.3f},  (A^T p_bar) . s = {(A.T @ p_bar) @ s.ravel():.3f}")

# %% [markdown]
# Forward, each row has at most four weights. Backward, a row of $A^T$ may have none or any number of them. The usual
# backward pass *scatters*: each point adds its gradient to four pixels, and points that share a pixel must wait for
# each other. With the transpose built once, each pixel *gathers* from its readers. `fast.PlaneSampler` is that: two
# sparse matrices per calibration, one product per direction. It passes the same test:

# %% jupyter={"source_hidden": true}
s_some = torch.from_numpy(rng.normal(size=(1, 3, *camera.size)).astype(np.float32)).requires_grad_()
gathering = fast.PlaneSampler(pixels, visible, camera.size)
planes = gathering(s_some)
p_some = torch.from_numpy(rng.normal(size=planes.shape).astype(np.float32))
planes.backward(p_some)
there, back = (p_some * planes).double().sum(), (s_some.grad * s_some).double().sum()
torch.testing.assert_close(there, back, rtol=1e-4, atol=0.1)
one = np.s_[:, ::20, ::20]  # point by point takes its time
literal = sample_planes_naive(s_some[0].detach().numpy(), pixels[one], visible[one])
np.testing.assert_allclose(planes[0].detach().numpy()[:, *one], literal, atol=1e-4)
shares = gathering.operator.nbytes / 1e6, 4 * visible.size * np.prod(camera.size) / 1e9
print("fast == literal; sparse, with its transpose, {:.0f} MB, as a full matrix {:.0f} GB".format(*shares))

# %% [markdown]
# [The companion](deeper/06_sampling.ipynb) compares times, and shows what reading the whole area of a cell would bring.
#
# ## Pixels that learn from the map alone
#
# Forget the network: let every score of the image be a free number, all zero at first. No pixel has a label. You get the
# *map* instead, the class of each ground cell that the camera sees. Sample the
# scores on the ground plane, compare with the map (by *cross-entropy*, minus the logarithm of the true class's
# probability), send the gradient back, take a step.
#
# **Predict before you run.** After twenty steps, which pixels of the image have got a class? Think of the pieces at 8,
# 20 and 45 m. And what will the pixels of a picket fence learn, when the cell *behind* it is lawn?
#
# <details><summary>Answer</summary>
#
# Those that a cell in sight reads: a lattice of dots near by, a closed carpet far away, nothing
# above the horizon. The fence's pixels are read by the ground behind it, so they learn *vegetation*: equation (2) knows
# no depth.
#
# </details>

# %% jupyter={"outputs_hidden": true}
truth, seen = frame.labels.birdseye_on(spec), frame.labels.visible_on(spec)
ground = PlaneSampler(pixels[:1], visible[:1], camera.size)
taught = torch.from_numpy(seen & visible[0])
classes = torch.from_numpy(truth[taught.numpy()].astype(np.int64))
free_scores = torch.zeros(1, len(KITTI_14), *camera.size, requires_grad=True)
for _ in range(20):
    p = ground(free_scores)[0, :, 0]
    loss = F.cross_entropy(p[:, taught].T, classes, reduction="sum")
    (s_bar,) = torch.autograd.grad(loss, free_scores)
    with torch.no_grad():
        free_scores -= s_bar
heard = (s_bar != 0).any(dim=1)[0].numpy()
learnt = np.where(heard, free_scores.detach().argmax(dim=1)[0].numpy(), 255)

# %% jupyter={"outputs_hidden": true}
below = np.arange(96) > camera.K[1, 2]
print(f"{100 * heard[below].mean():.0f} % of the pixels below the horizon have learnt, {heard[~below].sum()} above it")
flat = [KITTI_14.index(name) for name in ("road", "sidewalk")]
is_flat, is_right = np.isin(true_labels, flat), heard & (learnt == true_labels)
shares = [100 * share.mean() for share in (heard[is_flat], is_right[heard & is_flat], is_right[is_flat])]
print(
    "road and sidewalk: {:.0f} % of the pixels are read, {:.0f} % of these are right, {:.0f} % of all".format(*shares)
)
wrong = heard & is_flat & ~is_right
print(f"of the wrong ones {100 * (learnt == KITTI_14.index('car'))[wrong].mean():.0f} % have learnt car")
print(f"everything else that is read: {100 * is_right[heard & ~is_flat].mean():.0f} % are right", end=", ")
fence, lawn = (KITTI_14.index(name) for name in ("fence", "vegetation"))
of_fence = learnt[heard & (true_labels == fence)]
print(
    f"of the fence {100 * (of_fence == fence).mean():.0f} %, {100 * (of_fence == lawn).mean():.0f} % learn vegetation"
)

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="A, the classes that pixels have learnt from the map, dots near by and a closed area far ahead, with nothing above the horizon, and the fence at F learnt as vegetation; B, the true labels, with the fence at F"
fig, axes = plt.subplots(2, 1, figsize=(7.5, 3.8), layout="constrained")
plotting.image_labels(image, learnt, KITTI_14, ax=axes[0], opacity=1).set_title("A: learnt from the map")
plotting.image_labels(image, true_labels, KITTI_14, ax=axes[1]).set_title("B: true labels, never shown to it")
axes[0].get_legend().remove()
plotting.class_legend(axes[1], KITTI_14, true_labels, loc="upper center", bbox_to_anchor=(0.5, 0), ncols=5)
for ax in axes:
    ax.images[0].set_interpolation("nearest")
    ax.set_ylim(95.5, 35.5)
    arrow = {"arrowstyle": "->", "color": "black"}
    ax.annotate("F", (254, 60), (234, 86), fontweight="bold", arrowprops=arrow, bbox={"fc": "white", "pad": 1.5})
plt.show()

# %% [markdown]
# A: where the photograph is seen, nothing was learnt. On road and sidewalk the map reads part of the pixels, and
# most of what it reads is right, although no pixel was ever labelled: this is end-to-end training in miniature. Of
# everything else that is read, 42 % are right. Of the pixels of the fence (F) that are read, 1 % have learnt *fence*
# and 89 % *vegetation*,
# because the lawn *behind* it has the same pixels. This is lecture 05's cut edge, occlusion, at work in the gradient.

# %% [markdown]
# ## If the point moves: the gradient in u and v
#
# So far the scores learnt, and the weights stood still. For that alone no slope is needed: let each point read its
# *nearest* pixel, and the pixel gets the whole gradient. But what if the calibration should learn, or the height of a plane?
# Then the point moves, and the question is how $p$ changes with $u$.
#
# **Predict before you run.** Move the point of (1.25, 0.5) by a tiny step to the right. How much does $p$ change, per
# pixel of the step? And down? And to the right, if it reads the nearest pixel instead?
#
# <details><summary>Answer</summary>
#
# To the right the value rises along row 0, by 8 - 4 per pixel, and falls along row 1, by 6 per pixel; the point is half
# in each: 1/2 · 4 - 1/2 · 6 = -1. Down: 3/4 · (6 - 4) + 1/4 · (0 - 8) = -0.5. With the
# nearest pixel a tiny step to the right changes nothing, so there is nothing to learn from.
#
# </details>
#
# The kernel's slope is -1 on the right of its pixel and +1 on the left, so between pixels the gradient is a difference
# of neighbours:
#
# $$ \frac{\partial p}{\partial u} = \sum_n \sum_m s_{n,m}\; k'(u - m)\; k(v - n), \qquad
#    k'(t) = \begin{cases} -\operatorname{sign}(t) & |t| < 1 \\ 0 & |t| > 1 \end{cases} $$


# %% jupyter={"outputs_hidden": true}
def slope(t):
    """Return the derivative of the kernel, where it has one."""
    return -np.sign(t) if abs(t) < 1 else 0.0


def slopes(s, u, v):
    """Return the derivatives of `read` in u and in v."""
    in_u = in_v = 0.0
    for n, m in np.ndindex(s.shape):
        in_u += s[n, m] * slope(u - m) * kernel(v - n)
        in_v += s[n, m] * kernel(u - m) * slope(v - n)
    return in_u, in_v


in_u, in_v = slopes(s, 1.25, 0.5)
by_steps = (read(s, 1.26, 0.5) - read(s, 1.24, 0.5)) / 0.02, (read(s, 1.25, 0.51) - read(s, 1.25, 0.49)) / 0.02
np.testing.assert_allclose((in_u, in_v), by_steps)
print(f"in u {in_u:.2f}, in v {in_v:.2f}")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, the value along a row of pixels: stairs for the nearest pixel, connected lines for bilinear; right, the slopes: zero for the stairs, plus 4 and minus 6 for the lines"
across = np.linspace(0, 2, 401)
fig, axes = plt.subplots(1, 2, figsize=(8, 2.8), layout="constrained")
axes[0].plot(across, s[1, np.floor(across + 0.5).astype(int)], color="0.6", label="nearest pixel")
axes[0].plot(across, [read(s, u, 1.0) for u in across], color="tab:red", label="bilinear")
axes[0].plot(range(3), s[1], "o", color="black", label="scores of row 1")
axes[0].set(xlabel="u [pixels]", ylabel="p", xticks=range(3), title="the value along row 1")
axes[0].legend()
between = across[across % 1 > 1e-9]
axes[1].plot(between, np.zeros_like(between), ".", color="0.6", markersize=2, label="nearest pixel")
axes[1].plot(between, [slopes(s, u, 1.0)[0] for u in between], ".", color="tab:red", markersize=2, label="bilinear")
axes[1].set(xlabel="u [pixels]", ylabel="slope of p in u [per pixel]", xticks=range(3), title="its slope")
plt.show()

# %% [markdown]
# Left, grey: stairs, flat except where they jump. Red: connected lines. Right: the slope of the stairs is 0 between the jumps;
# that of the lines is +4 up to the middle pixel and -6 after it. On a pixel's centre the slope jumps: there is a
# *kink*, and each program returns a number of its own
# ([companion](deeper/06_sampling.ipynb)).
#
# ## A calibration that learns
#
# Now the animation of the beginning. A toy first: the point stands at (1.25, 1), where it reads 4.5; the map says that
# it should read 6. The loss is $\tfrac12 (p - 6)^2$, so $\bar p = p - 6 = -1.5$. The slope in u is -6. By the chain
# rule the loss has the slope $-1.5 \cdot -6 = 9$, and a step of 0.02 against it moves the point to $u = 1.25 - 0.02
# \cdot 9 = 1.07$: towards the 6. A *pitch* moves all points at once, so the slopes add up:
#
# $$ \frac{\partial\,\text{loss}}{\partial\,\text{pitch}} = \sum_{c,j} \bar p_{c,j} \left(
#    \frac{\partial p}{\partial u} \frac{\partial u}{\partial\,\text{pitch}} +
#    \frac{\partial p}{\partial v} \frac{\partial v}{\partial\,\text{pitch}} \right) $$


# %%
def gradient_by_hand(pitch, s, t, points):
    """Return d loss / d pitch of one image, literally; loss as in `loss_at`, derivatives of u and v by a tiny step."""
    (u, v), (u_later, v_later) = (
        [a.numpy() for a in pixels_at(points, torch.tensor(angle, dtype=torch.float64))]
        for angle in (pitch, pitch + 1e-6)
    )
    total = 0.0
    for c, j in np.ndindex(*t.shape):
        n, m = int(v[j]), int(u[j])
        four = s[c, n : n + 2, m : m + 2].numpy()  # the four pixels around the point
        p_bar = 2 * (read(four, u[j] - m, v[j] - n) - t[c, j].item()) / t.numel()
        in_u, in_v = slopes(four, u[j] - m, v[j] - n)
        total += p_bar * (in_u * (u_later[j] - u[j]) + in_v * (v_later[j] - v[j])) / 1e-6
    return total


s_one, t_one, some_points = on_zero[0]
inner = (some_points[:, 0].abs() < 0.5 * some_points[:, 2]) & (torch.arange(len(some_points)) % 5 == 0)  # a few cells
t_one, some_points = t_one[:, inner], some_points[inner]
pitch = torch.tensor(0.02, dtype=torch.float64, requires_grad=True)
(gradient,) = torch.autograd.grad(loss_at(pitch, [(s_one, t_one, some_points)]), pitch)
by_hand = gradient_by_hand(0.02, s_one, t_one, some_points)
np.testing.assert_allclose(by_hand, gradient.item(), rtol=1e-3)
print(f"by hand {by_hand:.3f}, by PyTorch {gradient.item():.3f}")

# %% [markdown]
# **Predict before you run.** The true pitch error is 0. With all cells at height 0, from +2 and from -2 degrees, does
# the descent end at 0? Remember the crest of lecture 05.
#
# <details><summary>Answer</summary>
#
# No. From +2° it ends at -0.1°, from -2° at -0.7° after twenty steps, and taken one by one the five images have
# their minima between -0.7° and +0.2°: the loss explains wrong heights by a pitch of the camera. With heights
# of the ground from the LIDAR, both descents end at -0.3°, 0.9 pixels from the truth; the five minima still lie up to
# 0.6° apart.
#
# </details>

# %% jupyter={"outputs_hidden": true}
paths = {
    name: [descend(start, lessons) for start in (2.0, -2.0)]
    for name, lessons in (("height 0", on_zero), ("height from LIDAR", on_lidar))
}
degrees = np.linspace(-3, 3, 61)
with torch.inference_mode():
    losses = {
        name: np.array([[loss_at(torch.tensor(np.radians(a)), [one]).item() for a in degrees] for one in lessons])
        for name, lessons in (("height 0", on_zero), ("height from LIDAR", on_lidar))
    }
for name, (down, up) in paths.items():
    single = degrees[losses[name].argmin(axis=1)]
    print(f"{name}: from +2 to {down[-1, 0]:+.1f}, from -2 to {up[-1, 0]:+.1f} degrees", end="; ")
    print("single images:", *(f"{a:+.1f}" for a in single))
assert max(abs(path[-1, 0]) for path in paths["height from LIDAR"]) < 0.35
off = camera.K[1, 1] * np.tan(np.radians(-paths["height from LIDAR"][0][-1, 0]))
print(f"with heights from LIDAR both end {off:.1f} pixels from the truth")
assert abs(paths["height 0"][0][-1, 0] - paths["height 0"][1][-1, 0]) > 0.4

# %% jupyter={"source_hidden": true, "outputs_hidden": true}


def clear_of_things(s, t, points):
    """Leave out the points that have anything but road and sidewalk within two pixels, at the true pitch."""
    all_flat = ndimage.minimum_filter(s.sum(dim=0).numpy(), size=5) > 0
    u, v = (a.round().long() for a in pixels_at(points, torch.tensor(0.0)))
    keep = torch.from_numpy(all_flat[v.clamp(max=95).numpy(), u.clamp(0, 319).numpy()])
    return s, t[:, keep], points[keep]


clear = [clear_of_things(*lesson) for lesson in on_lidar]
ends = [descend(start, clear, steps=30)[-1, 0] for start in (2.0, -2.0)]
kept = sum(len(points) for *_, points in clear) / sum(len(points) for *_, points in on_lidar)
print(
    "with the {:.0f} % of the cells that are clear of other things: {:+.1f} and {:+.1f} degrees".format(
        100 * kept, *ends
    )
)

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="loss over pitch with two descents: on the left, with the ground at height 0, a wide flat valley between minus 0.7 and minus 0.1 degrees in which the descents end apart; on the right, with the LIDAR's heights, one valley where both end together"
fig, axes = plt.subplots(1, 2, figsize=(8, 3), layout="constrained", sharey=True)
for ax, name in zip(axes, paths, strict=True):
    ax.plot(degrees, losses[name].T, color="0.8", linewidth=1, label=("one image", *4 * [None]))
    ax.plot(degrees, losses[name].mean(axis=0), color="tab:red", label="mean of five")
    for path, label in zip(paths[name], ("two descents", None), strict=True):
        ax.plot(*path.T, ".-", color="black", label=label)
    ax.axvline(0, color="0.6", linewidth=1)
    ax.set(xlabel="pitch [degrees]", title=name)
axes[0].set_ylabel("loss")
axes[0].legend(fontsize="small")
plt.show()

# %% [markdown]
# On the left the mean has a wide floor instead of one lowest point, because the heights are wrong by a different
# amount in each image. On the right it has one, 0.3° from the truth: 0.9 pixels in this image. Most of this comes
# from cells beside things that stand, because a point that lies too high reads the thing, and one too low still reads
# road: the curves rise faster to the right. With the 77 % of the cells that keep two pixels away from such things,
# both descents end at -0.1°. So the descent works; what was wrong on the left is what the model holds fixed,
# height 0. A gradient changes *whatever may move*: if an error lies in what is held fixed, it bends something else to make
# up for it. (The map used here is the simulator's, so this is a demonstration, not a calibration without
# measurements.) Read by the nearest pixel, the loss has no slope at all:

# %%
u, v = pixels_at(on_zero[0][2], torch.tensor(0.03, requires_grad=True))
nearest = on_zero[0][0][:, v.round().long().clamp(0, 95), u.round().long().clamp(0, 319)]
print("nearest pixel: is there a gradient?", nearest.requires_grad)

# %% [markdown]
# ## Half a pixel
#
# All this stands on one convention: **the centre of the first pixel is (0, 0)**. Its area then reaches from -0.5 to
# 0.5, and an image of $w$ pixels from $-0.5$ to $w - 0.5$. Others put (0, 0) on the *corner* of the first pixel. Both
# are fine; mixing them isn't. PyTorch's `F.grid_sample` wants places scaled to -1 .. 1. With `align_corners=True`, -1
# and 1 are the centres of the first and the last pixel; with `False`, the default, they are the edges of the image:
#
# $$ \text{True:} \quad \frac{2u}{w - 1} - 1, \qquad \text{False:} \quad \frac{2u + 1}{w} - 1 $$
#
# **Predict before you run.** A program scales for one and calls the other. How large is the error at the borders, and in
# the middle of the image? Which image would you feed to a sampler to find out which convention it has?
#
# <details><summary>Answer</summary>
#
# Half a pixel at either border, in opposite directions, and nothing in the middle: too little to see in a picture. A
# **ramp** shows it: let each pixel's score be its own v. Then the value read *is* the place that it was read from.
#
# </details>

# %% jupyter={"outputs_hidden": true}
last = np.array(camera.size)[::-1] - 1
v_ramp = torch.arange(96.0)[:, None].expand(camera.size)[None, None]
asked, in_view = pixels[0, ..., 1], visible[0]
centres = torch.from_numpy(2 * pixels[:1] / last - 1).float().nan_to_num(-2)
edges = torch.from_numpy((2 * pixels[:1] + 1) / (last + 1) - 1).float().nan_to_num(-2)


def read_ramp(places, align_corners):
    """Return what the ground's points read on the ramp by grid_sample."""
    return F.grid_sample(v_ramp, places, align_corners=align_corners, padding_mode="border")[0, 0].numpy()


readings = {
    "PlaneSampler": ground(v_ramp)[0, 0, 0].numpy(),
    "centres, align_corners=True": read_ramp(centres, True),
    "edges, align_corners=False": read_ramp(edges, False),
    "centres, align_corners=False": read_ramp(centres, False),
}
assert np.abs(readings["PlaneSampler"] - asked)[in_view].max() < 1e-3
for name, reading in readings.items():
    off = np.abs(reading - asked)[in_view]
    print(f"{name:<29} off by {off.min():.2f} to {off.max():.2f} pixels")

# %% [markdown]
# ### In metres
#
# What is half a pixel on the ground? A toy camera: $z_\text{cam}$ = 1.5 m above it, $f_v$ = 200 pixels. A point of the
# ground $Z$ metres ahead lies $f_v\, z_\text{cam} / Z = 300 / Z$ pixels below the horizon: 30 pixels at 10 m, 10 at 30
# m, 5 at 60 m.
#
# **Predict before you run.** Read half a pixel too low, at 30.5, 10.5 and 5.5. Which ground do you get, instead of that
# at 10, 30 and 60 m?
#
# <details><summary>Answer</summary>
#
# 300 / 30.5 = 9.8, 300 / 10.5 = 28.6, 300 / 5.5 = 54.5 m: off by 0.2, 1.4 and 5.5 metres. Eleven cells.
#
# </details>
#
# $$ Z = \frac{f_v\, z_\text{cam}}{v - c_v}, \qquad
#    \left|\frac{\partial Z}{\partial v}\right| = \frac{Z^2}{f_v\, z_\text{cam}} $$

# %% jupyter={"outputs_hidden": true}
below_horizon = camera.K[1, 1] * camera_height / np.array([10.0, 30.0, 60.0])  # rows, of the drive's camera
for Z, rows in zip((10, 30, 60), below_horizon, strict=True):
    off = Z - camera.K[1, 1] * camera_height / (rows + 0.5)
    print(f"{Z} m ahead, half a pixel is {off:.1f} m of ground ahead, {0.5 * Z / camera.K[0, 0]:.2f} m sideways")
low = PlaneSampler(np.minimum(pixels[:1] + np.array([0, 0.5]), (np.inf, 95)), visible[:1], camera.size)
one_hot = torch.from_numpy(np.stack([true_labels == c for c in range(len(KITTI_14))])).float()[None]
labels = [np.where(in_view, sampled(one_hot)[0, :, 0].argmax(dim=0), 255) for sampled in (ground, low)]
for near, far in ((6, 20), (20, 40), (40, 71)):
    band = in_view & (x_cells > near) & (x_cells < far)
    print(f"{near} to {far} m ahead: {100 * (labels[0] != labels[1])[band].mean():.0f} % of cells read another class")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two maps: the classes that the ground plane reads, and, coloured, the cells that read another class half a pixel lower: few near by, most between 20 and 50 m, and along edges"
changed = np.where(labels[0] == labels[1], 255, labels[1])
fig = plotting.label_maps(spec, {"read where it is": labels[0], "changed, half a pixel too low": changed}, KITTI_14)
plt.show()

# %% [markdown]
# Right: coloured are the cells that now read another class, and the colour says which: more beyond 20 m than nearer.
# Nothing fails, and a network that is trained with the shift may learn to live with it, until
# somebody corrects the bug.
#
# ## Play with it
#
# Move the point. Where do two pixels have the weight 1/2, where do four have 1/4? Cross a column of pixels: which of
# the two slopes jumps, and does the value? (Without a running kernel there are no dials; the second section shows one place.)


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the nine pixels with the point, its weights and its slopes"
def show(u, v):
    """Show the weights and slopes at the dials' point."""
    _, ax = plt.subplots(figsize=(3.6, 3.6), layout="constrained")
    draw_point(ax, u, v)
    ax.set_xlabel("u [pixels]\nslope in u {:+.2f}, in v {:+.2f}".format(*slopes(s, u, v)))
    plt.show()


_ = interact(
    show,
    u=FloatSlider(value=1.25, min=0, max=2, step=0.05, description="u"),
    v=FloatSlider(value=0.5, min=0, max=2, step=0.05, description="v"),
)

# %% [markdown]
# ## Where this breaks
#
# **A slope needs scores that change.** The gradient in u and v knows four pixels. How far off may the calibration start, if
# the descent gets ninety steps?

# %%
for start in (6.0, 8.0, 10.0, -12.0, -15.0):
    path = descend(start, on_lidar, steps=91)
    print("from {:+.1f} degrees: after 30 steps at {:+.1f}, after 90 at {:+.1f}".format(*path[[0, 30, 90], 0]))
for s_one, _, points in on_lidar:  # at 10 and at -15 degrees no point reads road or sidewalk
    assert not any(read_points(s_one, *pixels_at(points, torch.tensor(np.radians(a)))).any() for a in (10.0, -15.0))
    assert pixels_at(points, torch.tensor(np.radians(-15.0)))[1].min() > 95  # below the image

# %% [markdown]
# From six degrees it arrives within thirty steps, from eight and from -12 it needs up to ninety. From ten degrees it
# never moves: no cell reads road or sidewalk, whose scores are 0 all around, so the
# slope is exactly zero. From -15 all cells fall below the image. That is why aligning images (*registration*) starts with small,
# blurred ones, where a slope reaches farther, and refines.
#
# **Four pixels are the right number at one distance only.** A cell of 0.5 m covers about 40 pixels at 7 m and a
# fifteenth at 60 m. Near by a thin thing may be missed (*aliasing*); far away, cells share a pixel. The
# [companion](deeper/06_sampling.ipynb) measures both.
#
# **The gradient goes to whatever was read.** A cell whose view is blocked reads the thing in front, and trains it
# towards the class of the cell.
#
# ## The ledger
#
# One edge is cut here, with its price on the toy world:

# %% jupyter={"source_hidden": true}
Markdown(ledger_table(ledger("planes")))

# %% [markdown]
# ## In five lines
#
# 1. A point reads the four pixels around it; the weights are a kernel across times a kernel down, and sum to 1.
# 2. That is one fixed sparse matrix. Its transpose, the adjoint, carries the gradient back, added up over readers.
# 3. In u and v the gradient is a difference of neighbouring pixels: enough to learn a calibration from six degrees off, if
#    the heights are right, and nothing at all if you read the nearest pixel.
# 4. Half a pixel is 5 m of ground at 60 m. State where the centre of the first pixel is, and check it with a ramp.
# 5. Cells that read one pixel share its error: 0.80, not 0.996.
#
# **What you can now do**: write a sampler with its way back, test both, and find out which convention any other one has.
#
# ## Further reading
#
# - Jaderberg, Simonyan, Zisserman, Kavukcuoglu, *Spatial Transformer Networks*, NIPS 2015: equation (2) and its
#   gradient in u and v.
# - Lucas, Kanade, *An iterative image registration technique with an application to stereo vision*, IJCAI 1981:
#   calibrating by the slope of an image, long before networks.
# - Griewank, Walther, *Evaluating Derivatives*, SIAM 2008: why the transpose, for any program.
#
# ## Exercise
#
# [Exercise 06](exercises/06_planes.ipynb): four pixels and their weights, the mean over a cell, a bug in a way back, the
# slope of a loss in the yaw, which convention a black box has, your own sampler on two streets, and one question. Next: lecture [07](07_segmentation.ipynb), three
# networks for segmentation.

# %% [markdown]
# # 06 · Sampling that learns: equation (2) and its gradient
#
# **In one sentence.** A point of a plane reads the four pixels around it with four weights, and on the way back each
# pixel gets its share of the blame by the same four weights; so a mistake on the map can teach the image network.
#
# **You will be able to**
# - compute a bilinear sample by hand, and its gradient in the scores and in u and v;
# - write equation (2) as a sparse matrix, and say why its transpose carries the gradient;
# - check any gradient by finite differences, and know where that check must fail;
# - say what a shift of half a pixel costs on the ground, in metres, and find it with a ramp;
# - say of each pixel whether it learns at all, and from which cells.
#
# **Prerequisites.** Lecture 05: equation (1) gives a pixel (u, v) to each point of each plane. Derivatives and the
# chain rule; a matrix times a vector.
#
# **Time.** 120 minutes, best in two sittings; the computer needs less than one.
#
# **Paper.** Section 3.3, equation (2), after Jaderberg et al. (2015).
#
# ```
#                         ┌── pixel of each point, eq. (1)
#                         ▼
# scores s (C, h, w) ── eq. (2) ──▶ planes p (C, D, H, W) ── fusion ──▶ map ──▶ loss
#    s̄ (C, h, w)     ◀── transposed ──  p̄ (C, D, H, W)  ◀──────────────────────┘
# ```

# %%
from time import process_time

import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from ipywidgets import FloatSlider, interact
from matplotlib.colors import LogNorm

from semgrid_edu import plotting
from semgrid_edu.camera import Camera, rigid_transform, transform_points
from semgrid_edu.datasets.readers.frames import resize_labels
from semgrid_edu.datasets.training_arrays import resize_image
from semgrid_edu.datasets.samples import sample_drive, sample_image_stage
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.networks import load_net
from semgrid_edu.pipeline import network_image
from semgrid_edu.planes import PlaneSampler, plane_heights, plane_pixels, sample_planes_naive

plt.rcParams["figure.dpi"] = 72
torch.set_num_threads(1)

# %% [markdown]
# New symbols, beside those of lecture 00:
#
# | symbol | meaning | shape | name in code |
# |---|---|---|---|
# | $n, m$ | row and column of a pixel | | `n`, `m` |
# | $d, j$ | a plane, and one of its points | | |
# | $k(t)$ | sampling kernel | | `kernel` |
# | $A$ | equation (2) as a matrix: a row a point, a column a pixel | (DHW, hw) | `A` |
# | $\bar p$ | blame of a value on a plane: $\partial\,\text{loss} / \partial p$ | (C, D, H, W) | `p_bar` |
# | $\bar s$ | blame of a score: $\partial\,\text{loss} / \partial s$ | (C, h, w) | `s_bar` |
#
# (The paper numbers planes by $i$; in this course $i$ is the image.)

# %% [markdown]
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
# <details><summary>Answer</summary>Row 0: 3/4 · 4 + 1/4 · 8 = 5. Row 1: 3/4 · 6 + 1/4 · 0 = 4.5. Half-way between:
# 4.75. Multiply the fractions and each pixel has a weight: 3/8 for the 4 and for the 6, 1/8 for the 8 and for the 0.
# They sum to 1. The other five pixels count nothing.</details>
#
# One rule for all nine pixels: a pixel's weight falls from 1 to 0 as the point moves away by one pixel, across and
# down alike. That is a kernel, $k(t) = \max(0, 1 - |t|)$, and the interpolation is the paper's equation:
#
# $$ p_{c,d,j} = \sum_n \sum_m s_{c,n,m}\; k(u_j - m)\; k(v_j - n) \qquad (2) $$


# %% tags=["eq-2"]
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
# On a pixel's centre the point reads that pixel alone; on the last row it reads two. All agree with the package.


# %%
def draw_point(ax, u, v):
    """Draw the image, a point on it, and the weights of its pixels."""
    ax.imshow(s, cmap="Blues", vmin=0, vmax=14)
    for n, m in np.ndindex(s.shape):
        weight = kernel(u - m) * kernel(v - n)
        ax.text(m, n - 0.12, f"{s[n, m]:.0f}", ha="center", va="bottom", fontsize=14)
        if weight > 0:
            ax.text(m, n + 0.12, f"weight {weight:.3f}", ha="center", va="top", color="tab:red", fontsize=9)
    ax.plot(u, v, "x", color="tab:red", markersize=10, markeredgewidth=2)
    ax.set(xticks=range(3), yticks=range(3), xlabel="u [pixels]", ylabel="v [pixels]")
    ax.set_title(f"the point at ({u:.2f}, {v:.2f}) reads {read(s, u, v):.2f}", fontsize="medium")


fig, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
draw_point(axes[0], 1.25, 0.5)
t = np.linspace(-1.6, 1.6, 321)
axes[1].plot(t, [kernel(x) for x in t], color="black")
for m in range(3):
    axes[1].plot(1.25 - m, kernel(1.25 - m), "o", color="tab:red")
    axes[1].annotate(f"column {m}", (1.25 - m, kernel(1.25 - m)), xytext=(8, 6), textcoords="offset points")
axes[1].set(xlabel="t = u - m [pixels]", ylabel="k(t)", title="across, for u = 1.25", xlim=(-1.6, 1.9))
plt.show()

# %% [markdown]
# Left, the red cross is the point; a pixel's weight is the product of two numbers between 0 and 1, one across and one
# down. Right, the one across: the point is 0.25 from column 1 (weight 0.75), -0.75 from column 2 (0.25) and too far
# from column 0.
#
# On the drive, equation (1) has found the pixels. Here are three small pieces of one image, magnified, with the
# points of the ground plane on them.
#
# **Predict before you run.** Cells are 0.5 m wide and deep. Which of the three pieces has the most points in it: 8, 20
# or 45 m ahead? In which do two points share the same four pixels?
#
# <details><summary>Answer</summary>The farther, the more: perspective draws the cells together. At 8 m most pixels are
# read by nobody. At 20 m, straight ahead, neighbours begin to share their four pixels; at 45 m about seven points do.
# Both will matter.</details>

# %%
drive, spec, heights = sample_drive(), GridSpec.compact(), plane_heights()
frame = drive[0]
camera = frame.camera.resized((96, 320))
pixels, visible = plane_pixels(spec, heights, camera)
image = resize_image(frame.image, camera.size)
fig, axes = plt.subplots(1, 3, figsize=(10, 3.6), layout="constrained")
for ax, ahead in zip(axes, (8, 20, 45), strict=True):
    (row,), (col,), _ = spec.cells(np.array([[ahead, -0.2]]))
    u, v = pixels[0, row, col]
    ax.imshow(image, interpolation="nearest")
    ax.plot(*pixels[0][visible[0]].T, ".", color="yellow", markersize=4)
    ax.set(xlim=(u - 12.5, u + 12.5), ylim=(v + 8.5, v - 8.5), title=f"{ahead} m ahead", xlabel="u [pixels]")
axes[0].set_ylabel("v [pixels]")
plt.show()

# %% [markdown]
# Each yellow dot takes its 14 scores from the four pixels around it, by weights that depend on nothing but the
# calibration.
#
# ## Back again: what each pixel gets
#
# Now learn. The loss sits at the far end, on the map; suppose that it asks the point at (1.25, 0.5) for a higher value
# and a second point, at (1, 1.5), for a lower one: $\bar p = (-1, +2)$.
#
# Nudge the pixel with the 6 by a small amount $\varepsilon$. The first point reads it with weight 3/8 and the second
# with 1/2, so $p$ changes by $(3/8\,\varepsilon, 1/2\,\varepsilon)$ and the loss by $-3/8\,\varepsilon + 2 \cdot
# 1/2\,\varepsilon$. That pixel's $\bar s$ is 0.625.
#
# **Predict before you run.** And that of its neighbour, the 8? Of the 2 in the lower right corner? Which pixels don't
# learn?
#
# <details><summary>Answer</summary>The 8 is read by the first point alone, with 1/8: -0.125. The lower right corner is
# read by nobody: 0, and so are the three pixels of column 0. A pixel gets back what it gave: the same weight, times
# what the loss says of the reader, **added up** over all readers.</details>
#
# $$ \bar s_{c,n,m} = \sum_d \sum_j \bar p_{c,d,j}\; k(u_j - m)\; k(v_j - n) $$


# %%
def give_back(p_bar, points, shape):
    """Return the gradient of the loss in the scores of one class, literally."""
    s_bar = np.zeros(shape)
    for blame, (u, v) in zip(p_bar, points, strict=True):
        for n, m in np.ndindex(shape):
            s_bar[n, m] += blame * kernel(u - m) * kernel(v - n)
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
    return sum(blame * read(s, u, v) for blame, (u, v) in zip(p_bar, two, strict=True))


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
# which it is read: its voice in the map.

# %%
sampler = PlaneSampler(pixels, visible, camera.size)
scores = torch.zeros(1, 1, *camera.size, requires_grad=True)
sampler(scores).sum().backward()
voice = np.ma.masked_equal(scores.grad[0, 0].numpy(), 0)
_, ax = plt.subplots(figsize=(8, 2.5), layout="constrained")
style = {"norm": LogNorm(0.1, 1000), "cmap": "viridis", "interpolation": "nearest"}
plotting.image_values(voice, "sum of weights", ax=ax, **style)
plt.show()
print(f"{100 * voice.mask.mean():.0f} % of the pixels are read by no point, so they never learn from the map")
left, middle, right = np.split(scores.grad[0, 0, round(camera.K[1, 2])].numpy(), (107, 213))  # the horizon's row
print(f"on the horizon: left {left.mean():.0f}, in the middle {middle.mean():.0f}, right {right.mean():.0f}")

# %% [markdown]
# The frame is the image's; white pixels have no voice. They lie at the lower and the upper border, where the points
# nearest to the vehicle go, and fall so far apart that they miss most pixels. The white streaks are what you see
# between the trees of an orchard: directions in which no cell's centre lies near by, whatever its height. Along the
# horizon a pixel of the middle third answers for more than sixty points, on average, and a pixel to either side of it
# for fewer than ten. At the lower border it is less than one. So what the network learns from the map, it learns mostly
# in the middle.
#
# ## The whole of equation (2) is one matrix
#
# For one calibration the weights never change. Write the nine scores below each other as a vector, take three points
# and write down who reads whom: three rows, nine columns.
#
# **Predict before you run.** How many of the 27 entries aren't zero, for the points (1.25, 0.5), (1, 1.5) and (0, 0)?
# And what does the *column* of the pixel with the 6 say?
#
# <details><summary>Answer</summary>4 + 2 + 1 = 7. A row says what a point reads; a column says by whom a pixel is read:
# 3/8, 1/2, 0. The gradient above was that column times what the loss says.</details>
#
# So with $A$ for the matrix, forward is $A$ and backward is its transpose:
#
# $$ p = A s, \qquad \bar s = A^T \bar p, \qquad \bar p \cdot (A s) = (A^T \bar p) \cdot s $$
#
# The third equation is the test for every pair of a forward and a backward pass: it must hold for *any* $s$ and
# $\bar p$, so a few random ones find nearly every mistake.


# %%
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

# %%
fig, axes = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained", width_ratios=(2.4, 1))
for ax, matrix, names in ((axes[0], A, ("pixel", "point")), (axes[1], A.T, ("point", "pixel"))):
    ax.imshow(matrix, cmap="Blues", vmin=0, vmax=1.6, aspect="auto")
    for (row, column), weight in np.ndenumerate(matrix):
        if weight:
            ax.text(column, row, f"{weight:.3g}", ha="center", va="center", fontsize=8)
    ax.set(xticks=range(matrix.shape[1]), yticks=range(matrix.shape[0]), xlabel=names[0], ylabel=names[1])
axes[0].set_title("A: scores to points", fontsize="medium")
axes[1].set_title("transposed: blame to pixels", fontsize="medium")
plt.show()

# %% [markdown]
# Left: at most four weights a row, wherever the point lies. Right: a row may have none (pixels 3, 6 and 8) or any
# number of them. That is why the usual backward pass *scatters*: each point adds its blame to four pixels, and points
# that share a pixel must wait for each other. Build the transpose once, and each pixel *gathers* from its readers
# instead. `PlaneSampler` is that: two sparse matrices, built once for a calibration, and the same fast product for both
# directions.
#
# On the drive: twenty planes of 142 x 62 cells, 96 x 320 pixels.

# %%
n_points, n_pixels = visible.size, np.prod(camera.size)
bytes_sparse = sampler.operator.nbytes
print(f"A: {n_points:,} x {n_pixels:,}, {100 * visible.mean():.0f} % of its rows have weights")
print(
    f"as a full matrix {4 * n_points * n_pixels / 1e9:.0f} GB; sparse, with its transpose, {bytes_sparse / 1e6:.0f} MB"
)

# %%
net = load_net(sample_image_stage(), drive.camera)
with torch.inference_mode():
    scores = net.segmenter(network_image(frame, camera.size)[None])
    planes = sampler(scores)[0].numpy()
some = np.s_[:, ::10, ::10]  # the literal twin takes its time: every tenth row and column of cells
literal = sample_planes_naive(scores[0].numpy(), pixels[some], visible[some])
np.testing.assert_allclose(planes[:, *some], literal, atol=1e-4)
leaf = scores.clone().requires_grad_()
blame = torch.from_numpy(rng.normal(size=(1, *planes.shape)).astype(np.float32))
sampler(leaf).backward(blame)
forward, backward = (blame[0].double().numpy() * planes).sum(), (leaf.grad.double() * scores).sum()
np.testing.assert_allclose(forward, backward, atol=1e-6 * np.abs(blame[0].numpy() * planes).sum())
print("fast == literal, and the transpose is the adjoint")


# %% [markdown]
# And the times? The literal twin goes from point to point. The usual way in PyTorch is `F.grid_sample`: as fast as its
# authors could make it for points that may move, so it works out the four weights again at each call, and scatters on
# the way back. (It wants u and v scaled to -1 .. 1, of which more below.)


# %% tags=["nbval-ignore-output"]
def seconds(run, repeats=5):
    """Return the shortest computing time of several runs."""
    times = []
    for _ in range(repeats):
        start = process_time()
        run()
        times.append(process_time() - start)
    return min(times)


last = np.array(camera.size)[::-1] - 1
where = torch.from_numpy(np.where(visible[..., None], 2 * pixels / last - 1, -2)).float().reshape(1, 1, -1, 2)
usual = F.grid_sample(leaf, where, align_corners=True)
np.testing.assert_allclose(usual.detach().numpy().ravel(), planes.ravel(), atol=1e-3)
slow = seconds(lambda: sample_planes_naive(scores[0].numpy(), pixels[some], visible[some]), repeats=1)
slow *= visible.sum() / visible[some].sum()
print(f"literal, forward: {slow:.0f} s; PlaneSampler, forward: {1000 * seconds(lambda: sampler(scores)):.0f} ms")
scatter = seconds(lambda: F.grid_sample(leaf, where, align_corners=True).sum().backward())
print(f"there and back: grid_sample {1000 * scatter:.0f} ms", end=", ")
print(f"PlaneSampler {1000 * seconds(lambda: sampler(leaf).sum().backward()):.0f} ms")

# %% [markdown]
# ## Pixels that learn from the map alone
#
# Here is what that buys. Forget the network: let every score of the image be a free number, all zero at first. Nobody
# labels a pixel. Someone gives you the *map* instead, the class of each ground cell that the camera sees. Sample the
# scores on the ground plane, compare with the map (cross-entropy, as in training), send the blame back, take a step.
#
# **Predict before you run.** After twenty steps, which pixels of the image have got a class? Think of the pieces at 8,
# 20 and 45 m. And what will the pixels of a picket fence learn, when the cell *behind* it is lawn?
#
# <details><summary>Answer</summary>Those that are read: a lattice of dots near by, a closed carpet far away, nothing
# above the horizon. The fence's pixels are read by the ground behind it, so they learn *vegetation*: equation (2) knows
# no depth.</details>

# %%
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

# %%
true_labels = resize_labels(frame.labels.image, camera.size)
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
print(f"of the fence {100 * is_right[heard & (true_labels == KITTI_14.index('fence'))].mean():.0f} %")

# %%
fig, axes = plt.subplots(2, 1, figsize=(8, 4), layout="constrained")
plotting.image_labels(image, learnt, KITTI_14, ax=axes[0], opacity=1).set_title("learnt from the map")
plotting.image_labels(image, true_labels, KITTI_14, ax=axes[1]).set_title("truth, which nobody has shown to it")
for ax in axes:
    ax.images[0].set_interpolation("nearest")
    ax.set_ylim(95.5, 35.5)
plt.show()

# %% [markdown]
# Top: where the photograph shines through, nobody asked. On road and sidewalk the map reads a third of the pixels. Of
# these nine in ten are right, and none of them was ever labelled: this is end-to-end training in miniature. (Half of
# the wrong ones have learnt *car*: they lie at the foot of one.) The other two thirds have learnt nothing. Wrong is,
# above all, what stands up. No pixel of the fence has learnt *fence*, nearly all say vegetation, and the foot of the
# sign's post says sidewalk: from where the camera stands, the lawn and the pavement *behind* them have the same pixels.
# With twenty planes, an occupancy grid and a network that shares its weights over all pixels, the real training has a
# way out of both, dots and blame (lecture 08).

# %% [markdown]
# ## If the point moves: the gradient in u and v
#
# So far the scores learnt, and the weights stood still. For that alone no slope is needed: let each point read its
# *nearest* pixel, and the pixel gets all the blame. But what if the calibration should learn, or the height of a plane?
# Then the point moves, and the question is how $p$ changes with $u$.
#
# **Predict before you run.** Move the point of (1.25, 0.5) by a tiny step to the right. How much does $p$ change a
# pixel? And down? And if it reads the nearest pixel instead?
#
# <details><summary>Answer</summary>To the right the value rises along row 0, by 8 - 4 a pixel, and falls along row 1,
# by 6; the point is half in each: 1/2 · 4 - 1/2 · 6 = -1. Down: 3/4 · (6 - 4) + 1/4 · (0 - 8) = -0.5. With the
# nearest pixel a tiny step changes nothing, so it has nothing to learn from.</details>
#
# The kernel's slope is -1 on the right of its pixel and +1 on the left, so between pixels the gradient is a difference
# of neighbours:
#
# $$ \frac{\partial p}{\partial u} = \sum_n \sum_m s_{n,m}\; k'(u - m)\; k(v - n), \qquad
#    k'(t) = \begin{cases} -\operatorname{sign}(t) & |t| < 1 \\ 0 & |t| > 1 \end{cases} $$


# %%
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

# %%
across = np.linspace(0, 2, 401)
fig, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
axes[0].plot(across, s[1, np.floor(across + 0.5).astype(int)], color="0.6", label="nearest pixel")
axes[0].plot(across, [read(s, u, 1.0) for u in across], color="tab:red", label="bilinear")
axes[0].plot(range(3), s[1], "o", color="black", label="scores of row 1")
axes[0].set(xlabel="u [pixels]", ylabel="p", xticks=range(3), title="the value along row 1")
axes[0].legend()
between = across[across % 1 > 1e-9]
axes[1].plot(between, np.zeros_like(between), ".", color="0.6", markersize=2, label="nearest pixel")
axes[1].plot(between, [slopes(s, u, 1.0)[0] for u in between], ".", color="tab:red", markersize=2, label="bilinear")
axes[1].set(xlabel="u [pixels]", ylabel="slope of p in u [a pixel]", xticks=range(3), title="its slope")
plt.show()

# %% [markdown]
# Left, grey: stairs, flat except where they jump. Red: connected lines. Right: the slope of the stairs is 0 everywhere;
# that of the lines is +4 up to the middle pixel and -6 after it. Towards a high score you can feel your way; on the
# stairs you can't. (The assertion compares with finite differences and finds no error: a straight line has none.)
#
# ### On a pixel's centre there is a kink
#
# At u = 1 the slope is +4 on one side and -6 on the other. No number is right there, and each program gives its own.


# %%
def read_torch(s, u, v):
    """Return what points read, equation (2) for autograd: (C, h, w) scores, (J,) pixels -> (C, J)."""
    n, m = torch.arange(s.shape[1]), torch.arange(s.shape[2])
    across = torch.relu(1 - (u[:, None] - m).abs())
    down = torch.relu(1 - (v[:, None] - n).abs())
    return torch.einsum("cnm,jn,jm->cj", s, down, across)


def by_grid_sample(s, u, v):
    """Do the same by PyTorch's own sampler."""
    where = torch.stack([2 * u / (s.shape[2] - 1) - 1, 2 * v / (s.shape[1] - 1) - 1], dim=-1)
    return F.grid_sample(s[None], where[None, None], align_corners=True)[0, :, 0]


one_class, v = torch.tensor(s)[None], torch.tensor([1.0], dtype=torch.float64)
for at in (1.25, 1.0):
    u = torch.tensor([at], dtype=torch.float64, requires_grad=True)
    answers = [torch.autograd.grad(way(one_class, u, v).sum(), u)[0].item() for way in (read_torch, by_grid_sample)]
    central = (read(s, at + 1e-6, 1.0) - read(s, at - 1e-6, 1.0)) / 2e-6
    agree = torch.autograd.gradcheck(lambda u: read_torch(one_class, u, v), u, raise_exception=False)
    print(f"u = {at:.2f}: autograd {answers[0]:.0f}, grid_sample {answers[1]:.0f}", end=", ")
    print(f"finite differences {central:.0f}; gradcheck passes: {agree}")

# %% [markdown]
# Between pixels all agree. On the kink autograd says 0, `grid_sample` takes the slope on the right, finite differences
# the mean of both sides. A `gradcheck` that fails now and then may just have landed on a kink: look there first. (It
# must run in double precision: in single, nudges of a millionth drown in rounding.)
#
# ## A calibration that learns
#
# A toy first. The point stands at (1.25, 1), where it reads 4.5; the map says that it should read 6. The loss is
# $\tfrac12 (p - 6)^2$, so $\bar p = p - 6 = -1.5$. The slope in u is -6. By the chain rule the loss has the slope $-1.5
# \cdot -6 = 9$, and a step of 0.02 against it moves the point to $u = 1.25 - 0.02 \cdot 9 = 1.07$: towards the 6.

# %%
u = 1.25
for _ in range(4):
    print(f"u = {u:.3f} reads {read(s, u, 1.0):.2f}")
    u -= 0.02 * (read(s, u, 1.0) - 6) * slopes(s, u, 1.0)[0]

# %% [markdown]
# On the drive, suppose that the calibration is two degrees off: the camera points lower, or higher, than we believe.
# What we have is labels of its images, and a map of road and sidewalk, 8 to 25 m ahead. Turn the ground's points by an
# unknown *pitch*, equation (1), read the labels there, equation (2), compare with the map, and let the chain rule run
# all the way back to one number:
#
# $$ \frac{\partial\,\text{loss}}{\partial\,\text{pitch}} = \sum_{c,d,j} \bar p_{c,d,j} \left(
#    \frac{\partial p}{\partial u} \frac{\partial u}{\partial\,\text{pitch}} +
#    \frac{\partial p}{\partial v} \frac{\partial v}{\partial\,\text{pitch}} \right) $$


# %%
def lesson(frame):
    """Return labels of an image (C, h, w), classes of ground cells that it sees (C, J), their places (J, 3)."""
    truth, x = frame.labels.birdseye_on(spec), spec.centers()[..., 0]
    cells = frame.labels.visible_on(spec) & np.isin(truth, flat) & (x > 8) & (x < 25)
    on_ground = np.concatenate([spec.centers()[cells], np.zeros((cells.sum(), 1))], axis=1)
    points = torch.from_numpy(transform_points(camera.T_camera_from_grid, on_ground))
    labels = resize_labels(frame.labels.image, camera.size)
    return [torch.from_numpy(np.stack([a == c for c in flat])).double() for a in (labels, truth[cells])] + [points]


def pixels_at(points, pitch):
    """Return u and v of points seen by the camera turned down by `pitch`, radians: equation (1)."""
    X, Y, Z = points.T
    Y, Z = torch.cos(pitch) * Y - torch.sin(pitch) * Z, torch.sin(pitch) * Y + torch.cos(pitch) * Z
    K = torch.from_numpy(camera.K)
    return K[0, 0] * X / Z + K[0, 2], K[1, 1] * Y / Z + K[1, 2]


# %%
lessons = [lesson(drive[k]) for k in (0, 5, 10, 15, 19)]


def loss_at(pitch, way=read_torch):
    """Return the mean squared difference between what the points read and the map."""
    return sum(((way(s, *pixels_at(points, pitch)) - t) ** 2).mean() for s, t, points in lessons) / len(lessons)


pitch = torch.tensor(0.02, dtype=torch.float64, requires_grad=True)
(gradient,) = torch.autograd.grad(loss_at(pitch), pitch)
by_differences = (loss_at(pitch + 1e-8) - loss_at(pitch - 1e-8)) / 2e-8
torch.testing.assert_close(gradient, by_differences, rtol=1e-4, atol=1e-4)


# %%
def nearest(s, u, v):
    """Read the nearest pixel."""
    u, v = u.round().long().clamp(0, s.shape[2] - 1), v.round().long().clamp(0, s.shape[1] - 1)
    return s[:, v, u]


def descend(degrees, steps=20):
    """Return pitch and loss along a descent, degrees."""
    pitch, path = torch.tensor(np.radians(degrees), requires_grad=True), []
    for _ in range(steps):
        loss = loss_at(pitch)
        path.append((np.degrees(pitch.item()), loss.item()))
        (gradient,) = torch.autograd.grad(loss, pitch)
        with torch.no_grad():
            pitch -= 0.002 * gradient
    return np.array(path)


paths = [descend(start) for start in (2.0, -2.0)]
for path in paths:
    print("pitch [degrees]:", *(np.round(path[[0, 2, 4, 8, 12, 19], 0], 1) + 0.0))
    assert abs(path[-1, 0]) < 0.1
print("nearest pixel: is there a gradient?", loss_at(torch.tensor(0.03, requires_grad=True), nearest).requires_grad)

# %%
degrees = np.linspace(-3, 3, 61)
with torch.inference_mode():
    ways = {way: [loss_at(torch.tensor(np.radians(a)), way).item() for a in degrees] for way in (nearest, read_torch)}
fig, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained", width_ratios=(1.4, 1))
axes[0].plot(degrees, ways[nearest], color="0.6", label="nearest pixel")
axes[0].plot(degrees, ways[read_torch], color="tab:red", label="bilinear")
for path in paths:
    axes[0].plot(*path.T, ".-", color="black", label="descent" if path is paths[0] else None)
axes[0].set(xlabel="pitch [degrees]", ylabel="loss")
axes[0].legend()
for path in paths:
    axes[1].plot(path[:, 0], ".-", color="black")
axes[1].axhline(0, color="0.6", linewidth=1)
axes[1].set(xlabel="step", ylabel="pitch [degrees]", xticks=range(0, 20, 5))
plt.show()

# %% [markdown]
# Left: the loss over pitch, and two descents, one from each side; right: the same, step by step. Both end within a
# tenth of a degree of the truth, 0, which is a third of a pixel: five images are enough to calibrate the camera to the
# map, and nobody measured anything. Read by its nearest pixel the loss has nearly the same valley, but ask autograd for
# the way down and it has none to give.
#
# ## Half a pixel
#
# All this stands on one convention: **the centre of the first pixel is (0, 0)**. Its area then reaches from -0.5 to
# 0.5, and an image of $w$ pixels from $-0.5$ to $w - 0.5$. Others put (0, 0) on the *corner* of the first pixel. Both
# are fine; mixing them isn't.
#
# Take a row of four pixels, and average it down to two. The first new pixel covers the old pixels 0 and 1, so its
# centre, 0, lies at the old u = 0.5.
#
# **Predict before you run.** Where in the new row is the old u = 0.5? The old u = 3? Why not multiply by 1/2?
#
# <details><summary>Answer</summary>0 and 1.25: add 1/2 to count from the image's edge, scale, and take 1/2 off again.
# Multiplying alone gives 0.25 and 1.5, always a quarter of a pixel too far to the right: it scales about the centre of
# the first pixel instead of the edge of the image.</details>
#
# $$ u' = \left(u + \tfrac12\right) \frac{w'}{w} - \tfrac12 $$
#
# Lecture 05 made the calibration of a smaller image by this rule: that is where its halves come from.


# %%
def resized(u, w, new_w):
    """Return where a place of a row of w pixels lies in a row of new_w."""
    return (u + 0.5) * new_w / w - 0.5


wide = Camera(np.array([[100.0, 0, 30], [0, 100, 20], [0, 0, 1]]), np.eye(4), size=(40, 64))
small = wide.resized((20, 16))
np.testing.assert_allclose(small.K[:2, 2], (resized(30, 64, 16), resized(20, 40, 20)))
mistakes = {
    "right": lambda u: resized(u, 4, 2),
    "scaled about the first centre": lambda u: u * 2 / 4,
    "align_corners: last centre on last centre": lambda u: u * (2 - 1) / (4 - 1),
}
for name, place in mistakes.items():
    print(f"{name:<42} old 0.5 -> {place(0.5):+.3f}   old 3 -> {place(3.0):+.3f}")

# %%
fig, axes = plt.subplots(1, 3, figsize=(10, 2), layout="constrained")
for ax, (name, place) in zip(axes, mistakes.items(), strict=True):
    for m in range(4):
        ax.add_patch(plt.Rectangle((m - 0.5, 1), 1, 0.6, facecolor="0.9", edgecolor="black"))
        ax.plot(m, 1.3, ".", color="black")
    for m in range(2):  # where the new pixels really lie, and where the formula believes the new centres to be
        ax.add_patch(plt.Rectangle((2 * m - 0.5, 0), 2, 0.6, facecolor="0.9", edgecolor="black"))
        ax.plot(np.interp(m, place(np.arange(-2, 7)), np.arange(-2, 7)), 0.3, "x", color="tab:red", markersize=9)
    ax.set(xlim=(-0.8, 3.8), ylim=(-0.2, 1.8), yticks=[0.3, 1.3], yticklabels=["new", "old"], xticks=range(4))
    ax.set_title(name, fontsize="small")
    ax.set_xlabel("old u [pixels]")
plt.show()

# %% [markdown]
# Each box is a pixel; the red crosses are where each rule believes the centres of the two new pixels to be. Only on the
# left do they lie in the middle of their boxes.
#
# `align_corners` is PyTorch's name for the third rule. It shows up twice: in `F.interpolate`, as drawn, and in
# `F.grid_sample`, which wants places scaled to -1 .. 1. With `align_corners=True`, -1 and 1 are the centres of the
# first and the last pixel; with `False`, the default, they are the edges of the image:
#
# $$ \text{True:} \quad \frac{2u}{w - 1} - 1, \qquad \text{False:} \quad \frac{2u + 1}{w} - 1 $$
#
# Scale for one and call the other, and you are off by half a pixel at either border, in opposite directions, and by
# nothing in the middle: no picture shows it.
#
# A **ramp** shows it. Let each pixel's score be its own v. Then the value read *is* the place that it was read from.

# %%
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
blind = camera.K[1, 2] - frame.camera.K[1, 2] * 96 / frame.image.shape[0]
assert np.abs(readings["PlaneSampler"] - asked)[in_view].max() < 1e-3
for name, reading in readings.items():
    off = np.abs(reading - asked)[in_view]
    print(f"{name:<34} off by {off.min():.2f} to {off.max():.2f} pixels")
print(f"a K that was multiplied, not resized: off by {np.abs(blind):.2f} pixels everywhere")

# %% [markdown]
# (The last line is the drive's own camera, made smaller from 188 to 96 rows.)
#
# ### In metres
#
# What is half a pixel on the ground? A toy camera: $z_\text{cam}$ = 1.5 m above it, $f_v$ = 200 pixels. A point of the
# ground $Z$ metres ahead lies $f_v\, z_\text{cam} / Z = 300 / Z$ pixels below the horizon: 30 pixels at 10 m, 10 at 30
# m, 5 at 60 m.
#
# **Predict before you run.** Read half a pixel too low, at 30.5, 10.5 and 5.5. Which ground do you get, instead of that
# at 10, 30 and 60 m?
#
# <details><summary>Answer</summary>300 / 30.5 = 9.8, 300 / 10.5 = 28.6, 300 / 5.5 = 54.5 m: off by 0.2, 1.4 and 5.5
# metres. Eleven cells.</details>
#
# $$ Z = \frac{f_v\, z_\text{cam}}{v - c_v}, \qquad
#    \left|\frac{\partial Z}{\partial v}\right| = \frac{Z^2}{f_v\, z_\text{cam}} $$


# %%
def ground_at(v, camera):
    """Return how far ahead a level camera meets the ground along row v, metres."""
    return camera.K[1, 1] * camera_height / (v - camera.K[1, 2])


camera_height = camera.T_camera_from_grid[1, 3]
for Z in (10.0, 30.0, 60.0):
    v = camera.K[1, 2] + camera.K[1, 1] * camera_height / Z
    np.testing.assert_allclose(ground_at(v, camera), Z)
    slip = np.abs(ground_at(v + np.array([1e-3, 0.5]), camera) - Z)
    np.testing.assert_allclose(slip[0] / 1e-3, Z**2 / (camera.K[1, 1] * camera_height), rtol=1e-3)
    print(
        f"{Z:.0f} m ahead, half a pixel is {slip[1]:.1f} m of ground ahead, {0.5 * Z / camera.K[0, 0]:.2f} m sideways"
    )

# %%
tenths = np.arange(camera.size[0] * 10) / 10 - 0.45  # ten thin rows in each row of pixels
depth = np.where(tenths > camera.K[1, 2] + 2, ground_at(tenths, camera), np.inf)
bands = np.searchsorted((10, 30, 60), depth) % 2  # a road painted dark from 10 to 30 m and beyond 60 m ...
bands = bands.reshape(-1, 10).mean(axis=1)  # ... as the pixels see it
bands = torch.from_numpy(np.tile(bands[:, None], (1, camera.size[1]))).float()[None, None]
one_hot = torch.from_numpy(np.stack([true_labels == c for c in range(len(KITTI_14))])).float()[None]
low = np.minimum(pixels[:1] + np.array([0, 0.5]), (np.inf, camera.size[0] - 1))
samplers = ground, PlaneSampler(low, visible[:1], camera.size)
painted = [np.where(in_view, sampled(bands)[0, 0, 0], np.nan) for sampled in samplers]
labels = [np.where(in_view, sampled(one_hot)[0, :, 0].argmax(dim=0), 255) for sampled in samplers]
fig, axes = plt.subplots(1, 3, figsize=(10, 5), layout="compressed")
for ax, picture, title in zip(axes, painted, ("read where it is", "half a pixel too low"), strict=False):
    ax.imshow(picture, extent=(spec.y_max, spec.y_min, spec.x_min, spec.x_max), cmap="Greys", vmin=-0.4, vmax=1.6)
    ax.hlines((10, 30, 60), -15.5, 15.5, color="tab:red", linewidth=1)
    ax.set(title=title, xlabel="y, to the left [m]", ylabel="x, forward [m]")
changed = np.where(labels[0] == labels[1], 255, labels[1])
plotting.grid_labels(spec, changed, KITTI_14, ax=axes[2]).set_title("the drive: cells that changed")
plt.show()
x = spec.centers()[..., 0]
for near, far in ((6, 20), (20, 40), (40, 71)):
    band = in_view & (x > near) & (x < far)
    print(f"{near} to {far} m ahead: {100 * (changed != 255)[band].mean():.0f} % of the cells have another class")

# %% [markdown]
# Left and middle, a road painted light and dark: its colour must change on the red lines, at 10, 30 and 60 m. Half a
# pixel too low, and what lies at 54 m is drawn at 60. (The far edges are soft even on the left: there one row of pixels
# covers ten metres.) Right, the drive's true labels: coloured are the cells that now read another class, and the colour
# says which. The farther, the more of them, most of all beside edges and thin things. A network that *learns* with the
# shift learns to undo it, until somebody corrects the bug.
#
# ## No depth is used
#
# A pixel is a ray. Every plane cuts that ray somewhere, and there it reads this pixel. The toy camera again, 1.5 m
# above the ground, $f_v$ = 200; one single bright pixel, ten rows below the horizon.
#
# **Predict before you run.** How far ahead is the bright spot on the ground plane? On a plane at 0.5 m? At 1 m? And on
# one at 1.5 m?
#
# <details><summary>Answer</summary>200 · 1.5 / 10 = 30 m, 200 · 1.0 / 10 = 20 m and 10 m. At 1.5 m, the height of the
# camera, never: the ray points down, so it only sinks.</details>
#
# $$ Z_d = \frac{f_v\,(z_\text{cam} - \delta_d)}{v - c_v} $$

# %%
axes_of_camera = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # X right is -y, Y down is -z, Z ahead is x
K = np.array([[200.0, 0, 160], [0, 200, 48], [0, 0, 1]])
toy_camera = Camera(K, rigid_transform(axes_of_camera, np.zeros(3)), size=(96, 320), lidar_height=1.5)
column = GridSpec(x_min=4.5, x_max=40.5, y_min=-0.5, y_max=0.5, cell=1)
toy_heights = np.array([0.0, 0.5, 1.0, 1.5])
toy_pixels, toy_visible = plane_pixels(column, toy_heights, toy_camera)
bright = torch.zeros(1, 1, 96, 320)
bright[..., 58, :] = 1
toy_planes = PlaneSampler(toy_pixels, toy_visible, toy_camera.size)(bright)[0, 0, :, :, 0].numpy()
x_column = column.centers()[:, 0, 0]
for height, values in zip(toy_heights[:3], toy_planes, strict=False):
    np.testing.assert_allclose(x_column[values.argmax()], 200 * (1.5 - height) / 10)
    print(f"plane at {height:.1f} m: brightest {x_column[values.argmax()]:.0f} m ahead, {(values > 0).sum()} cells lit")
assert not toy_planes[3].any()

# %%
fig, ax = plt.subplots(figsize=(9, 2.6), layout="constrained")
for slope_v in (9, 10, 11):
    style = {"color": "tab:red", "linewidth": 1, "linestyle": "-" if slope_v == 10 else ":"}
    ax.plot([0, 200 * 1.5 / slope_v], [1.5, 0], **style)
for height, values in zip(toy_heights, toy_planes, strict=True):
    ax.plot([0, 40], [height] * 2, color="0.8", linewidth=1, zorder=0)
    ax.scatter(x_column, np.full(36, height), c=values, cmap="Blues", vmin=-0.3, vmax=1, s=40, edgecolors="0.7")
ax.plot(0, 1.5, "ks", markersize=8)
ax.set(xlim=(-1, 41), ylim=(-0.2, 1.8), yticks=toy_heights, xlabel="x, forward [m]", ylabel="height [m]")
plt.show()

# %% [markdown]
# A side view; grey lines are planes, dots the cells, darker where they read the bright pixel. The solid red line is its
# ray; dotted, where its weight ends. One thing in the image is on every plane, each time elsewhere, and the lower the
# plane, the longer it is smeared. If it is a spot on the road, the ground plane is right. If it is the bumper of a car,
# half a metre up, the second one is. **Equation (2) doesn't choose.** It lays all answers out, side by side in every
# cell, and leaves the choice to what is learnt after it.
#
# On the drive, look at the cars. With the true labels of the image, which plane puts them where they are?

# %%
car = KITTI_14.index("car")
found, called, there = np.zeros(20), np.zeros(20), 0
for k in range(len(drive)):
    labels = drive[k].labels
    cars = labels.visible_on(spec) & (labels.birdseye_on(spec) == car) & (x < 40)
    mask = torch.from_numpy(resize_labels(labels.image, camera.size) == car).float()
    on_planes = (sampler(mask[None, None])[0, 0].numpy() > 0.5) & (x < 40)
    found, called, there = found + (on_planes & cars).sum((1, 2)), called + on_planes.sum((1, 2)), there + cars.sum()
right = found / np.maximum(called, 1)
for d in (0, 2, 5, 8, 10, 11, 12):
    share = f"{100 * found[d] / there:3.0f} % of the cars' cells read car"
    print(f"plane at {heights[d]:.1f} m: {share}; of the cells that read car {100 * right[d]:.0f} % are one")
assert right.argmax() == 11
assert right.max() < 0.35
assert called.argmax() == 6

# %%
with torch.inference_mode():
    likely = scores.softmax(dim=1)
    on_planes = sampler(likely)[0, car].numpy()
    cars = torch.from_numpy(true_labels == car).float()[None, None]
    truly = sampler(cars)[0, 0].numpy()
outline = (truth == car) & seen
fig, axes = plt.subplots(2, 4, figsize=(7.5, 6.4), layout="compressed", sharex=True, sharey=True)
for column_axes, d in zip(axes.T, (0, 3, 6, 10), strict=True):
    for ax, values in zip(column_axes, (truly[d], on_planes[d]), strict=True):
        shown = np.where(visible[d], values, np.nan)
        ax.imshow(shown, extent=(spec.y_max, spec.y_min, 0, 71), cmap="Blues", vmin=0, vmax=1, interpolation="nearest")
        ax.contour(*spec.centers()[0, :, 1:].T, spec.centers()[:, 0, 0], outline, [0.5], colors="tab:red")
        ax.set_ylim(0, 45)
    column_axes[0].set_title(f"plane at {heights[d]:.1f} m", fontsize="medium")
    column_axes[1].set_xlabel("y, to the left [m]")
axes[0, 0].set_ylabel("true labels\nx, forward [m]")
axes[1, 0].set_ylabel("network's P(car)\nx, forward [m]")
plt.show()

# %% [markdown]
# Red: where the cars that the camera sees stand. Blue: how much a cell reads *car*, from 0, white, to 1, dark. Top:
# perfect labels; bottom: those of the network, softer, but the same smear. On the ground plane a car lies *behind* its
# place, thrown away from the camera like a shadow: only its wheels land where they are. On the plane at 0.6 m what is
# lower falls short, what is higher overshoots, and the bodywork at that height is right. At 1.2 m the smear is longest.
# At 2 m, above the camera, rays rise, and only what towers over it is left: the roof of a van. Of all twenty planes the
# one at 2.2 m is the purest: three in ten of its cells that read *car* are one. But it finds only a quarter of the
# cars' cells. Of the planes below the camera, the one at 0.4 m is the purest: a quarter. No plane is right, each is
# right for something, and it takes the LIDAR's occupancy to say where along the smear the car stands: lecture 08.
#
# ## Play with it
#
# Move the point. Where do two pixels have the weight 1/2, where do four have 1/4? Cross a column of pixels: which of
# the two slopes jumps, and does the value? Find the largest slope in u of this image, and say from the nine numbers why
# it must be there. (Without a running kernel there are no dials; the figure below shows three places.)


# %% tags=["nbval-ignore-output"]
def show(u, v):
    """Show the weights and slopes at the dials' point."""
    _, ax = plt.subplots(figsize=(4, 4), layout="constrained")
    draw_point(ax, u, v)
    ax.set_xlabel("u [pixels]\nslope in u {:+.2f}, in v {:+.2f}".format(*slopes(s, u, v)))
    plt.show()


_ = interact(
    show,
    u=FloatSlider(value=1.25, min=0, max=2, step=0.05, description="u"),
    v=FloatSlider(value=0.5, min=0, max=2, step=0.05, description="v"),
)

# %%
fig, axes = plt.subplots(1, 3, figsize=(10, 3.8), layout="constrained")
for ax, place in zip(axes, ((0.5, 0.5), (1.0, 0.5), (1.95, 0.05)), strict=True):
    draw_point(ax, *place)
    ax.set_xlabel("u [pixels]\nslope in u {:+.2f}, in v {:+.2f}".format(*slopes(s, *place)))
plt.show()

# %% [markdown]
# Left, the middle of four pixels: their mean. In the middle, on a column's centre, only two pixels count, and the slope
# in u that is written there, 0, is neither the one on its left, +4, nor that on its right, -1 (`sign(0)` is 0). On the
# right, nearly on the corner, one pixel has nine tenths.
#
# ## Where this breaks
#
# **Four pixels are the right number at one distance only.** A cell of 0.5 m is a patch of the image. Sideways it is
# $f_u \cdot 0.5 / Z$ pixels wide, ahead $f_v\, z_\text{cam} \cdot 0.5 / Z^2$ pixels high. With 185 for both $f$ and a
# camera at 1.65 m that is, by hand, 13 x 3, so about 40 pixels at 7 m, 4 at 15 m, 1 at 24 m, and at 60 m a sixteenth.
#
# **Predict before you run.** Equation (2) reads four pixels, always. What is lost at 7 m? What is wrong at 60 m?
#
# <details><summary>Answer</summary>At 7 m, 36 of 40 pixels have no say: a line of the road or a thin leg shows up if it
# happens to lie under the cell's centre, and flickers from frame to frame. That is aliasing. At 60 m, sixteen cells
# share a pixel, so they all say the same, and no learning can make them differ.</details>
#
# $$ \text{pixels a cell} = f_u f_v\, z_\text{cam}\, \frac{\text{cell}^2}{Z^3} $$

# %%
distance = x[:, 31]  # the column of cells just right of the middle
patch = camera.K[0, 0] * camera.K[1, 1] * camera_height * spec.cell**2 / distance**3
corners = GridSpec(spec.x_min, spec.x_max, spec.y_min, spec.y_max, spec.cell / 2)  # quarter cells: their centres
quarters, _ = plane_pixels(corners, [0.0], camera)
q = quarters[0].reshape(spec.shape[0], 2, spec.shape[1], 2, 2)[:, :, 31]
across, along = q[:, 1, 1] - q[:, 1, 0], q[:, 1, 0] - q[:, 0, 0]
measured = 4 * np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0])
far = distance > 7
np.testing.assert_allclose(measured[far], patch[far], rtol=0.15)
fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
ax.semilogy(distance[far], measured[far], color="black")
ax.axhline(4, color="tab:red", linewidth=1, label="what equation (2) reads")
ax.axhspan(4, 60, color="tab:red", alpha=0.1, label="pixels without a say")
ax.axhspan(0.02, 1, color="tab:blue", alpha=0.1, label="cells share a pixel")
ax.set(xlabel="x, forward [m]", ylabel="pixels a cell", xlim=(7, 71), ylim=(0.03, 60))
ax.legend(fontsize="small")
plt.show()
for ahead in (7.25, 15.25, 24.25, 60.25):
    print(f"{ahead:5.2f} m ahead: {measured[distance == ahead][0]:.2g} pixels a cell")

# %% [markdown]
# Near by, read more: the mean over the patch (a blurred image for near cells, as computer graphics does with mip-maps),
# or several points a cell. The other nineteen planes help a little, since their points fall between those of the
# ground. Far away, nothing helps but more pixels: the paper's 375 rows and its focal length of 720 move the point where
# cells begin to share pixels from 24 to 60 m, and its smaller cells move it back to 33.
#
# **A slope is felt only near by.** The gradient in u and v knows four pixels. Turn the camera of our calibration not by
# two degrees but by eight, to either side:

# %%
for start in (8.0, -8.0):
    lost = descend(start)
    print(f"starts at {start:+.0f} degrees, after {len(lost)} steps at {lost[-1, 0]:+.1f}", end=": ")
    v = torch.cat([pixels_at(points, torch.tensor(np.radians(start)))[1] for _, _, points in lessons])
    above, below_image = (v < camera.K[1, 2]).double().mean(), (v > camera.size[0] - 1).double().mean()
    print(f"{100 * above:.0f} % of the points read above the horizon, {100 * below_image:.0f} % below the image")

# %% [markdown]
# On the one side the ground reads trees, houses and sky, where there is no road in any direction. On the other it reads
# the road just before the vehicle, where everything is road, or falls below the image. Either way the gradient is
# nearly zero, or worse, points at something else. That is why registration starts with small, blurred images, where one
# pixel is wide, and refines.
#
# **Blame goes to whoever was read.** You have seen the fence learn the lawn behind it. A cell whose view is blocked
# reads the thing in front, and teaches it its own class. Points outside the image and behind the camera read zero, and
# teach nobody.
#
# **Kinks.** On a pixel's centre there is no derivative. In training that never matters, since the calibration is fixed
# there; in a gradient check it does.
#
# ## In five lines
#
# 1. A point reads the four pixels around it; the weights are a kernel across times a kernel down, and sum to 1.
# 2. That is one fixed sparse matrix. Its transpose carries the gradient back: who was read gets the blame, added up.
# 3. In u and v the gradient is a difference of neighbouring pixels: enough to learn a calibration from close by, and
#    nothing at all if you read the nearest pixel.
# 4. Half a pixel is 5 m of ground at 60 m. State where the centre of the first pixel is, and check it with a ramp.
# 5. No depth is used: a pixel is repeated along its ray on every plane, and what comes after must choose.
#
# ## Further reading
#
# - Jaderberg, Simonyan, Zisserman, Kavukcuoglu, *Spatial Transformer Networks*, NIPS 2015: equation (2) and its
#   gradient in u and v.
# - Lucas, Kanade, *An iterative image registration technique with an application to stereo vision*, IJCAI 1981:
#   calibrating by the slope of an image, long before networks.
# - Jiang, Sun, Tagliasacchi, Trulls, Yi, *Linearized multi-sampling for differentiable image transformation*, ICCV
#   2019: what to do about a gradient that sees four pixels.
# - Williams, *Pyramidal parametrics*, SIGGRAPH 1983: mip-maps.
# - Griewank, Walther, *Evaluating Derivatives*, SIAM 2008: why the transpose, for any program.
#
# ## Exercise
#
# [Exercise 06](exercises/06_planes.ipynb): four pixels and their weights, a plane, the way back, slopes, a resized
# calibration, and one question. Next: lecture 07, three networks for segmentation.

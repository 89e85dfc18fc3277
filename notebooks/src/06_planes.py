# %% [markdown]
# # 06 · Sampling that learns: equation (2) and its gradient
#
# **In one sentence.** A point on the map reads four pixels with four weights, and an error on the map goes back to the
# same four pixels by the same weights; so a map can teach an image, and even correct a camera's angle.
#
# **You will be able to**
# - take one step of gradient descent by hand;
# - compute a bilinear sample by hand, and its gradient in the scores, in u and in v;
# - write equation (2) as a matrix, and say why its transpose carries the gradient;
# - check any gradient with a nudge, and any sampler with a ramp;
# - say what half a pixel costs on the ground, in metres.
#
# **Prerequisites.** Lecture [05](05_pixels.ipynb): equation (1) gives a pixel (u, v) to each point of each plane.
# Derivatives and the chain rule; a matrix times a vector.
#
# **Time.** 76 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.3, equation (2), after Jaderberg et al. (2015).

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
import torch
from ipywidgets import FloatSlider, interact

from semgrid_edu import fast, plotting
from semgrid_edu.datasets import frames, samples
from semgrid_edu.frame import resize_image
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.planes import PlaneSampler, plane_pixels, sample_planes_naive
from worlds import lecture_06_calibration as calibration

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
torch.set_num_threads(1)
drive, spec = samples.sample_drive(), GridSpec.compact()
frame = drive[0]
camera = frame.camera.resized((96, 320))
pixels, visible = plane_pixels(spec, [0.0], camera)  # one plane, the ground
image = resize_image(frame.image, camera.size)
true_labels = frames.resize_labels(frame.labels.image, camera.size)

# %% [markdown]
# ## What is a loss, and what is one step?
#
# In this course a network will label the pixels of an image. But what has to be right in the end is a *map*: the class of
# each cell, seen from above. How can an error on the map correct a pixel?
#
# First we need to say what *wrong* means, and in which direction *better* is. Take one pixel and one class. Its score $s$
# is 4, and somebody who knows says that it should be 6. A **loss** is one number that is zero when all is right and grows with
# the error. Here it is half the squared difference, $\ell = \tfrac12 (s - 6)^2$, which is 2.
#
# Which way is better? The derivative of this loss is $s - 6$, which is -2. So if we raise $s$, the loss falls. The rule of
# **gradient descent** is to go *against* the derivative, by a fixed fraction of it, the **step size** $\eta$:
# $s \leftarrow s - \eta\, \partial \ell / \partial s$.
#
# ```
# step size 0.25:   4 -> 4 + 0.25 · 2 = 4.5    there the derivative is -1.5
#                        4.5 + 0.25 · 1.5 = 4.875, a shorter step
# step size 2.5:    4 -> 4 + 2.5 · 2 = 9       farther from 6 than before
# ```
#
# A step size of two would land as far from 6 as before, on the other side. So here two is the limit.


# %% jupyter={"source_hidden": true} alt="two parabolas of the loss over the score with its minimum at 6: on the left, with a step size of 0.25, dots go down from 4 towards 6 in shorter and shorter steps; on the right, with a step size of 2.5, they jump from 4 to 9 and then to 1.5, higher each time"
def one_step(s, eta):
    """Return the score after one step on half its squared distance from 6."""
    return s - eta * (s - 6)


fig, axes = plt.subplots(1, 2, figsize=(7.6, 2.7), layout="constrained", sharey=True)
at = np.linspace(0.5, 11, 200)
for ax, eta, steps in zip(axes, (0.25, 2.5), (5, 2), strict=True):
    path = [4.0]
    for _ in range(steps):
        path.append(one_step(path[-1], eta))
    ax.plot(at, (at - 6) ** 2 / 2, color="0.6")
    ax.plot(path, [(s - 6) ** 2 / 2 for s in path], "o-", color="black", markersize=4)
    ax.annotate("start", (4, 2), xytext=(-16, 12), textcoords="offset points", fontsize=9)
    ax.set(xlabel="score s", title=f"step size {eta}")
    assert (abs(path[-1] - 6) < 2) == (eta == 0.25)
axes[0].set_ylabel("loss")
assert [one_step(4, 0.25), one_step(4.5, 0.25), one_step(4, 2.5), one_step(4, 2)] == [4.5, 4.875, 9, 8]
plt.show()

# %% [markdown]
# With many scores each gets its own derivative. All of them together are the **gradient**, and each score takes its step at the same time. So the loss says *how wrong*, the gradient says *where to
# go*, and the step size says *how far*. What is left is the derivative of an error on the map in a score of the image. So
# how does the map read the image?
#
# ## What does a point read between four pixels?
#
# Take an image of nine pixels and one class. Its scores:
#
# ```
#          u = 0   u = 1   u = 2
# v = 0      0       4       8
# v = 1      2       6       0
# v = 2      4       0       2
# ```
#
# Equation (1) sends a point of a plane to (u, v) = (1.25, 0.5), a quarter of the way from the middle column to the right
# one, and half-way between the two upper rows.
#
# **Predict before you run.** Interpolate: first along the top row, then along the row below, then between the two. What
# does the point read, and how much of it comes from each pixel?
#
# <details><summary>Answer</summary>
#
# ```
# row v = 0:         3/4 · 4 + 1/4 · 8 = 5
# row v = 1:         3/4 · 6 + 1/4 · 0 = 4.5
# half-way between:                      4.75
# ```
#
# Multiply the fractions and each pixel has a weight: 3/8 in the middle column, 1/8 in the right one. They sum to one.
#
# </details>
#
# One rule holds for all nine pixels: a weight falls from one to zero as the point moves away by one pixel, across and down
# alike. That is a **kernel**, $k(a) = \max(0, 1 - |a|)$. With $n$ for rows and $m$ for columns, the interpolation is the
# paper's equation:
#
# $$ p_{c,d,j} = \sum_n \sum_m s_{c,n,m}\; k(u_j - m)\; k(v_j - n) \qquad (2) $$
#
# Point $j$ of plane $d$ takes the score of class $c$ from the pixels around $(u_j, v_j)$.


# %% tags=["eq-2"] jupyter={"outputs_hidden": true}
def kernel(a):
    """Return the bilinear kernel: 1 at the pixel, 0 from one pixel away on."""
    return max(0.0, 1 - abs(a))


def read(s, u, v):
    """Return what a point reads in one class: equation (2), literally."""
    value = 0.0
    for n, m in np.ndindex(s.shape):
        value += s[n, m] * kernel(u - m) * kernel(v - n)
    return value


s = np.array([[0.0, 4, 8], [2, 6, 0], [4, 0, 2]])
points = np.array([[1.25, 0.5], [1.0, 1.5]])
for u, v in points:
    print(f"u = {u:.2f}, v = {v:.2f}: reads {read(s, u, v):.2f}")


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, nine pixels with their scores and a cross between four of them, whose weights are 3/8, 3/8, 1/8 and 1/8; right, the triangular kernel with the weights of three columns on it"
def draw_point(ax, u, v):
    """Draw the image, a point on it, and the weights of its pixels."""
    ax.imshow(s, cmap="Blues", vmin=0, vmax=14)
    for n, m in np.ndindex(s.shape):
        weight = kernel(u - m) * kernel(v - n)
        ax.text(m, n - 0.12, f"{s[n, m]:.0f}", ha="center", va="bottom", fontsize=14)
        if weight > 0:
            ax.text(m, n + 0.12, f"times {weight:.3f}", ha="center", va="top", color="#a00000", fontsize=9)
    ax.plot(u, v, "x", color="tab:red", markersize=10, markeredgewidth=2)
    ax.set(xticks=range(3), yticks=range(3), xlabel="u [pixels]", ylabel="v [pixels]")
    ax.set_title(f"the point at ({u:.2f}, {v:.2f}) reads {read(s, u, v):.2f}", fontsize=10)


fig, axes = plt.subplots(1, 2, figsize=(8, 3.3), layout="constrained")
draw_point(axes[0], 1.25, 0.5)
apart = np.linspace(-1.6, 2.4, 401)
axes[1].plot(apart, [kernel(a) for a in apart], color="black")
for m in range(3):
    axes[1].plot(1.25 - m, kernel(1.25 - m), "o", color="tab:red")
    axes[1].annotate(f"column {m}", (1.25 - m, kernel(1.25 - m)), xytext=(8, 6), textcoords="offset points")
axes[1].set(xlabel="a = u - m [pixels]", ylabel="k(a)", title="the weight across, for u = 1.25", xlim=(-1.6, 2.4))
plt.show()

# %% [markdown]
# The nearer a column or a row, the larger its weight. Here are two pieces of the drive's image with the points of the
# ground plane. The right one is magnified five times as much.

# %% jupyter={"source_hidden": true} alt="two magnified pieces of the image with yellow dots and black lines around the pixels: left, 8 m ahead, a piece 25 pixels wide with fifteen dots far apart; right, 45 m ahead, a piece 5 pixels wide, where each column of dots puts about twelve of them into one pixel"
fig, axes = plt.subplots(1, 2, figsize=(7.6, 2.9), layout="constrained")
for ax, ahead, half in zip(axes, (8, 45), (12.5, 2.5), strict=True):
    (row,), (col,), _ = spec.cells(np.array([[ahead, -0.2]]))
    u, v = pixels[0, row, col].round()
    ax.imshow(image, interpolation="nearest")
    ax.plot(*pixels[0][visible[0]].T, ".", color="yellow", markersize=7, markeredgecolor="black", markeredgewidth=0.4)
    title = f"{ahead} m ahead, {2 * half:.0f} pixels wide"
    ax.set(xlim=(u - half, u + half), ylim=(v + 0.6 * half, v - 0.6 * half), title=title, xlabel="u [pixels]")
    ax.yaxis.get_major_locator().set_params(integer=True)
    ax.hlines(np.arange(v - 9.5, v + 10), u - half, u + half, color="black", linewidth=0.3)
    ax.vlines(np.arange(u - 13.5, u + 14), v - half, v + half, color="black", linewidth=0.3)
axes[0].set_ylabel("v [pixels]")
plt.show()

# %% [markdown]
# Near the vehicle most pixels are read by no point. Far ahead, many points share the same four. So a point reads the
# four pixels around it, with weights that sum to 1, wherever it is.
#
# ## How does an error on the map reach a pixel?
#
# Suppose that the map says 5.75 at our point, which reads 4.75. A second point, at (1, 1.5), half-way between the 6 and the 0
# below it, reads 3, and the map says 1. The loss is again half the squared difference, added up over points. Its
# derivative in $p$ is what is read minus what is wanted. A bar marks it: $\bar p = \partial \ell / \partial p$.
#
# ```
#                       reads   wanted   derivative   weight of the 6
# first point           4.75    5.75        -1             3/8
# second point          3       1           +2             1/2
# derivative in the 6:         -1 · 3/8 + 2 · 1/2 = 0.625
# ```
#
# If we nudge the pixel with the 6, each point feels it by its weight. So the derivative in this pixel, its $\bar s$, is
# the last line.
#
# **Predict before you run.** What is the $\bar s$ of the 8, its neighbour above to the right? Which pixels don't learn?
#
# <details><summary>Answer</summary>
#
# The first point alone reads the 8, with 1/8, so it gets -0.125. No point reads the left column or the lower right corner. These four
# pixels get nothing.
#
# </details>
#
# A pixel gets back what it gave: the same weight, times the derivative of the reader, **added up** over all readers.
#
# $$ \bar s_{c,n,m} = \sum_d \sum_j \bar p_{c,d,j}\; k(u_j - m)\; k(v_j - n) $$


# %% jupyter={"outputs_hidden": true}
def give_back(p_bar, points, shape):
    """Return the gradient of the loss in the scores of one class, literally."""
    s_bar = np.zeros(shape)
    for derivative, (u, v) in zip(p_bar, points, strict=True):
        for n, m in np.ndindex(shape):
            s_bar[n, m] += derivative * kernel(u - m) * kernel(v - n)
    return s_bar


wanted = np.array([5.75, 1.0])
p_bar = np.array([read(s, u, v) for u, v in points]) - wanted
s_bar = give_back(p_bar, points, s.shape)
print(s_bar)

# %% [markdown]
# Never trust a gradient that you haven't checked. The check needs no mathematics: nudge one score up, nudge it down, and see
# by how much the loss changes.


# %%
def loss(s):
    """Return half the squared difference between what the points read and what the map says."""
    return sum((read(s, u, v) - t) ** 2 / 2 for (u, v), t in zip(points, wanted, strict=True))


nudged = np.zeros(s.shape)
for n, m in np.ndindex(s.shape):
    nudge = np.zeros(s.shape)
    nudge[n, m] = 1e-4
    nudged[n, m] = (loss(s + nudge) - loss(s - nudge)) / 2e-4
np.testing.assert_allclose(nudged, s_bar, atol=1e-9)
print(f"loss {loss(s):.2f}; after one step of size 0.5, {loss(s - 0.5 * s_bar):.2f}")

# %% jupyter={"source_hidden": true}
package = sample_planes_naive(s[None], points.reshape(1, 1, 2, 2), np.ones((1, 1, 2), bool))
np.testing.assert_allclose([read(s, u, v) for u, v in points], package.ravel())
leaf = torch.tensor(s)[None, None].requires_grad_()
toy_sampler = PlaneSampler(points.reshape(1, 1, 2, 2), np.ones((1, 1, 2), bool), (3, 3)).double()
(toy_sampler(leaf)[0, 0, 0, 0] - torch.tensor(wanted)).pow(2).sum().div(2).backward()
np.testing.assert_allclose(leaf.grad[0, 0], s_bar)

# %% [markdown]
# The map told two points that they were wrong, and five pixels learnt from it. One step lowers the loss from 2.50 to
# 1.80. So an error reaches exactly the pixels that were read, by the weights with which they were read.
#
# ## Why is the way back a transpose?
#
# For one camera the weights never change. Write the nine scores below each other as a vector, and write down which point
# reads which pixel: one row for each point, one column for each pixel. A row has at most four weights. The *column* of a
# pixel says who reads it. The gradient above was this column, times the derivatives of the readers.
#
# So if $A$ is the matrix, forward is $A$ and backward is its transpose. The transpose is also called the **adjoint**,
# because it moves $A$ to the other side of a scalar product:
#
# $$ p = A s, \qquad \bar s = A^T \bar p, \qquad \bar p \cdot (A s) = (A^T \bar p) \cdot s $$
#
# The third equation is a test for every pair of a forward and a backward pass. It must hold for *any* $s$ and $\bar p$,
# so a few random ones find nearly every mismatch of the two. And you needn't look inside.


# %%
A = np.array([[kernel(u - m) * kernel(v - n) for n, m in np.ndindex(s.shape)] for u, v in points])
np.testing.assert_allclose(A.T @ p_bar, s_bar.ravel())

rng = np.random.default_rng(0)
some_s, some_p_bar = rng.normal(size=9), rng.normal(size=2)
back = give_back(some_p_bar, points, s.shape)
print("right way back:", np.isclose(some_p_bar @ (A @ some_s), back.ravel() @ some_s))
back[1, 1] = 0  # a bug: one pixel is forgotten
print("with the bug:", np.isclose(some_p_bar @ (A @ some_s), back.ravel() @ some_s))

# %% jupyter={"source_hidden": true}
ground = fast.PlaneSampler(pixels, visible, camera.size)
s_some = torch.from_numpy(rng.normal(size=(1, 1, *camera.size)).astype(np.float32)).requires_grad_()
planes = ground(s_some)
p_some = torch.from_numpy(rng.normal(size=planes.shape).astype(np.float32))
planes.backward(p_some)
torch.testing.assert_close((p_some * planes).double().sum(), (s_some.grad * s_some).double().sum(), rtol=1e-4, atol=0.1)
one = np.s_[:, ::5, ::5]  # point by point takes its time
literal = sample_planes_naive(s_some[0].detach().numpy(), pixels[one], visible[one])
np.testing.assert_allclose(planes[0].detach().numpy()[:, *one], literal, atol=1e-4)

# %% [markdown]
# The package's `fast.PlaneSampler` passes the same test. So the way back is the same weights, read by columns.
#
# ## Can pixels learn from the map alone?
#
# Let every score of the image be a free number, zero at first. No pixel has a label. You get the *map*: the class of each
# cell in which the camera sees something. A cell should read 1 for its true class and 0 for the others, and the loss is
# half the squared difference, added up. From now on `torch.autograd.grad` computes the gradient.
#
# **Predict before you run.** Which pixels of the image get a class? Think of the two magnified pieces. And what
# will the pixels of a picket fence learn, when the cell *behind* the fence is vegetation?
#
# <details><summary>Answer</summary>
#
# Pixels that a cell of the map reads: a lattice of dots near by, a closed carpet far away, nothing above the horizon. The
# ground behind the fence reads the fence's pixels. So they learn *vegetation*: equation (2) knows no depth.
#
# </details>

# %% jupyter={"outputs_hidden": true}
truth = frame.labels.birdseye_on(spec)
wanted_map = torch.stack([torch.from_numpy(truth == c) for c in range(len(KITTI_14))]).float()


def learn_from_map(taught, steps=20, eta=0.1):
    """Return the class of each pixel after the descent, 255 where no cell of `taught` (H, W) reads it."""
    scores = torch.zeros(1, len(KITTI_14), *camera.size, requires_grad=True)
    for _ in range(steps):
        p = ground(scores)[0, :, 0]
        loss = 0.5 * ((p - wanted_map) ** 2)[:, torch.from_numpy(taught)].sum()
        (gradient,) = torch.autograd.grad(loss, scores)
        with torch.no_grad():
            scores -= eta * gradient
    was_read = (gradient != 0).any(dim=1)[0].numpy()
    return np.where(was_read, scores.detach().argmax(dim=1)[0].numpy(), 255)


taught = frame.labels.visible_on(spec) & visible[0]
learnt = learn_from_map(taught)

# %% jupyter={"outputs_hidden": true, "source_hidden": true}
ROAD, FENCE, VEGETATION = (KITTI_14.index(name) for name in ("road", "fence", "vegetation"))
was_read = learnt < 255


def right_of(of):
    """Return the share of the pixels `of` that have learnt their class, percent."""
    return 100 * (learnt == true_labels)[was_read & of].mean()


anything = np.ones(learnt.shape, bool)
print(f"of all pixels that are read {right_of(anything):.0f} % learn their class; ", end="")
print(f"always road would get {100 * (true_labels == ROAD)[was_read].mean():.0f} %")
print(*(f"{name} {right_of(true_labels == KITTI_14.index(name)):.0f} %" for name in ("road", "car", "fence")), sep=", ")

scores = torch.randn(1, 1, *camera.size, generator=torch.Generator().manual_seed(0))
for _ in range(40):  # the power method
    scores = (scores / scores.norm()).requires_grad_()
    (scores,) = torch.autograd.grad(0.5 * (ground(scores)[0, 0, 0][torch.from_numpy(taught)] ** 2).sum(), scores)
print(f"the largest step size that can work is {2 / scores.norm():.2f}")  # 2 over the largest eigenvalue of A^T A

# %% [markdown]
# No pixel was ever labelled. Still, of all pixels that are read 72 % learn their class, and the trivial rule *always
# road* would get 46 %. But nearly all pixels of the fence have become vegetation. (For one score the limit of the step size
# was two. Here many cells pull at one pixel, so it is much lower.)
#
# Is occlusion really the cause of the wrong lessons? The camera sees something of each cell, but not always its ground:
# the roof of a car hides the ground behind it. Switch it off. The simulator knows the depth of each pixel. So leave out
# every cell whose pixel shows something more than a metre nearer, a third of the cells. As a control, leave out as many at
# random. Will the fence's pixels now learn *fence*?

# %% jupyter={"source_hidden": true}
(places,), (inside,) = plane_pixels(spec, [0.0], frame.camera)
centres = np.dstack([spec.centers(), np.zeros(spec.shape)])
Z = calibration.transform_points(camera.T_camera_from_grid, centres)[..., 2]
cols, rows = places[inside].round().astype(int).T
occluded = np.zeros(spec.shape, bool)
occluded[inside] = frame.labels.depth[rows, cols] < Z[inside] - 1  # something is more than a metre nearer
hidden = np.flatnonzero(taught & occluded)
assert 0.3 < len(hidden) / taught.sum() < 0.36
wrong = (learnt < 255) & (learnt != true_labels)
fence = (learnt < 255) & (true_labels == FENCE)


def without_cells(gone):
    """Return the classes that pixels learn, how many wrong ones fall silent or become right, and the share right."""
    cells = taught.copy()
    cells.ravel()[gone] = False
    now = learn_from_map(cells)
    right = (now == true_labels)[now < 255].mean()
    return now, (wrong & (now == 255)).sum(), (wrong & (now == true_labels)).sum(), right


# %% jupyter={"source_hidden": true}
print(f"with all cells {wrong.sum()} pixels are wrong; of the fence {fence.sum()} are read, ", end="")
print(f"{(learnt == VEGETATION)[fence].sum()} of them learn vegetation")
without, silent, righted, right = without_cells(hidden)
print(f"without occluded cells {silent} of the wrong ones fall silent, {righted} become right; ", end="")
print(f"{right:.0%} of what is still read is right, before {(learnt == true_labels)[learnt < 255].mean():.0%}")
print(
    f"of the fence {(fence & (without < 255)).sum()} are read, {(without == VEGETATION)[fence].sum()} learn vegetation"
)
draws = [np.random.default_rng(seed).choice(np.flatnonzero(taught), len(hidden), replace=False) for seed in range(3)]
by_chance = [without_cells(gone)[1:] for gone in draws]
print(
    "with as many at random {:.0f} fall silent, {:.0f} become right, {:.0%} right (mean of 3)".format(
        *np.mean(by_chance, axis=0)
    )
)

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="a piece of the image with the fence, three times: when all cells teach, the fence's pixels are full of black crosses on the colour of vegetation; without occluded cells most of these pixels are empty, with a few crosses left; below, the true labels"
fig, axes = plt.subplots(3, 1, figsize=(7.5, 7.4), layout="constrained", sharex=True)
plotting.image_labels(image, true_labels, KITTI_14, ax=axes[2]).images[0].set_interpolation("nearest")
for ax, now in zip(axes, (learnt, without), strict=False):
    opaque = np.dstack([KITTI_14.colours(now) / 255, now < 255])
    ax.imshow(150 + image.mean(axis=2) // 3, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    ax.imshow(opaque, interpolation="nearest")
    v, u = np.nonzero((now < 255) & (now != true_labels))
    ax.plot(u, v, "x", color="black", markersize=4, markeredgewidth=0.8)
    ax.axis("off")
for ax, title in zip(axes, ("all cells teach", "without occluded cells", "true labels"), strict=True):
    ax.set(xlim=(199.5, 274.5), ylim=(73.5, 49.5))
    ax.set_title(title, fontsize=10)
shown = np.concatenate([one[50:74, 200:275].ravel() for one in (learnt, true_labels)])
plotting.class_legend(axes[2], KITTI_14, shown[shown < 255], loc="upper center", bbox_to_anchor=(0.5, 0), ncols=4)
plt.show()

# %% [markdown]
# A cross is a pixel that has learnt a wrong class. Grey ones weren't read. Without the occluded cells 796 of the 1368
# wrong pixels fall silent, without as many random ones 223. So occlusion taught more than half of what was wrong. Of what
# is still read, 85 % is right, not 72; with the random cells left out it stays at 71 %. But only 21 wrong pixels become
# right, and the fence's pixels that are still read go on learning vegetation. So a map can teach pixels without one
# label. Its wrong lessons can be removed, but nothing replaces them.
#
# ## What does half a pixel cost?
#
# All this needs a convention: here **the centre of the first pixel is (0, 0)**. Others put the zero on its *corner*. Both
# are fine, but mixing them isn't. Here are two bugs that programs really have:
#
# - *Corner*: the calibration counts from the corner, so each v arrives as v + 0.5.
# - *Mixed scales*: PyTorch's `grid_sample` wants places from -1 to 1. With `align_corners=True` these are the centres of
#   the outermost pixels, and with `False`, the default, their outer edges. The program scales for centres, and calls the default.
#
# Half a pixel is too little to see in a picture. And our two checks don't help: if both ways have the same wrong weights,
# they still fit each other. Use a **ramp**: let each pixel's score be its own v. Then the value that is read *is* the place
# that was read.


# %%
def read_rows(scores, v, align_corners=True):
    """Return what PyTorch reads of scores (1, 1, 96, 320) in the middle, at rows v counted from centres."""
    places = torch.stack([torch.zeros(len(v)), 2 * v / 95 - 1], dim=-1)  # from -1 to 1
    return torch.nn.functional.grid_sample(scores, places[None, None], align_corners=align_corners)[0, 0, 0]


asked = torch.linspace(0.5, 94, 188)
programs = {
    "right": lambda scores: read_rows(scores, asked),
    "corner": lambda scores: read_rows(scores, asked + 0.5),
    "mixed scales": lambda scores: read_rows(scores, asked, align_corners=False),
}
ramp = torch.arange(96.0)[:, None].expand(camera.size)[None, None]
off = {name: program(ramp) - asked for name, program in programs.items()}
print({name: f"off by up to {error.abs().max():.2f}" for name, error in off.items()})

# %% jupyter={"source_hidden": true}
for name, program in programs.items():
    scores = torch.randn(ramp.shape).requires_grad_()
    p = program(scores)
    p_bar = torch.randn(p.shape)
    (s_bar,) = torch.autograd.grad(p, scores, p_bar)
    passes = torch.isclose((p_bar * p).sum(), (s_bar * scores).sum(), rtol=1e-3, atol=1e-3).item()
    print(f"{name}: the adjoint test gives {passes}")
in_view = visible[0]  # the package's sampler reads the ramp right
assert np.abs(ground(ramp)[0, 0, 0].numpy() - pixels[0, ..., 1])[in_view].max() < 1e-3

# %% [markdown]
# All three programs pass the adjoint test, and the ramp finds the bugs. Are they worth the trouble? Take a toy camera at
# $z_\text{cam}$ = 1.5 m, with a focal length $f_v$ of 200 pixels and its horizon in the middle of the image. A point of the
# ground $Z$ metres ahead is $f_v\, z_\text{cam} / Z$ pixels below the horizon, by similar triangles. Now read half a pixel
# lower in the image:
#
# ```
# 10 m:  300 / 10 = 30 pixels;  300 / 30.5 =  9.8 m
# 60 m:  300 / 60 =  5 pixels;  300 / 5.5  = 54.5 m
# ```

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, the error on the ramp over the image's rows: zero for the right program, half a pixel everywhere for the corner, and for mixed scales a line from minus half a pixel at the top to plus half a pixel at the bottom; right, metres of ground over the distance: for the corner a curve from 0.2 m at 10 m over 1.4 m at 30 m to 5.5 m at 60 m, for mixed scales at most 0.7 m"
fig, axes = plt.subplots(1, 2, figsize=(7.8, 3.1), layout="constrained")
styles = {"right": ":", "corner": "-", "mixed scales": "--"}
for name, style in styles.items():
    axes[0].plot(asked, off[name], style, color="black", label=name)
axes[0].set(xlabel="row that was asked for, v [pixels]", ylabel="read too low by [pixels]", title="on the ramp")
axes[0].legend(fontsize=9, loc="lower right")
far = np.linspace(7, 65, 200)
errors = {"corner": 0.5, "mixed scales": (300 / far) / 95}
for name, pixels_low in errors.items():
    axes[1].plot(far, far - 300 / (300 / far + pixels_low), styles[name], color="black", label=name)
for Z in (10, 30, 60):
    short = Z - 300 / (300 / Z + 0.5)
    axes[1].plot(Z, short, "o", color="tab:red")
    axes[1].annotate(f"{short:.1f} m", (Z, short), xytext=(-22, 10), textcoords="offset points", fontsize=9)
axes[1].set(
    xlabel="distance Z [m]",
    ylabel="error on the ground [m]",
    title="on the ground, toy camera",
    xlim=(0, 68),
    ylim=(-0.3, 7),
)
axes[1].legend(fontsize=9, loc="upper left")
plt.show()

# %% jupyter={"source_hidden": true}
at_60 = off["mixed scales"][torch.argmin((asked - 52.5).abs())].item()  # 5 pixels below the middle, 47.5
assert np.isclose(at_60, 0.053, atol=5e-4)
assert np.isclose(60 - 300 / (5 + at_60), 0.6, atol=0.05)

# %% [markdown]
# With the corner bug the error grows with the *square* of the distance, because $\partial Z / \partial v = -Z^2 / (f_v\,
# z_\text{cam})$. At 60 m half a pixel is eleven cells. The mixed scales err by half a pixel, too, but at the bottom of the
# image, where a pixel is cheap. At 60 m they cost 0.6 m. So what counts is *where* in the image an error is, and a ramp
# shows it.
#
# ## What changes if the point moves?
#
# So far the scores learnt, and the points stood still. But if the camera's angle should learn, the points move. How does
# $p$ change with $u$ and $v$?
#
# **Predict before you run.** Move our first point by a tiny step to the right. How much does $p$ change, per
# pixel of the step? And down? And to the right, if it reads only its nearest pixel instead of four?
#
# <details><summary>Answer</summary>
#
# Along the top row the value rises, along the row below it falls, and the point is half in each:
#
# ```
# right:  1/2 · (8 - 4) + 1/2 · (0 - 6) = -1
# down:   3/4 · (6 - 4) + 1/4 · (0 - 8) = -0.5
# ```
#
# With the nearest pixel a tiny step changes nothing.
#
# </details>
#
# The kernel falls on the right of its pixel and rises on the left, by one per pixel. So the derivative is a difference of
# neighbours.


# %% jupyter={"outputs_hidden": true}
def slope(a):
    """Return the derivative of the kernel, where it has one."""
    return -np.sign(a) if abs(a) < 1 else 0.0


def slopes(s, u, v):
    """Return the derivatives of `read` in u and in v."""
    in_u = in_v = 0.0
    for n, m in np.ndindex(s.shape):
        in_u += s[n, m] * slope(u - m) * kernel(v - n)
        in_v += s[n, m] * kernel(u - m) * slope(v - n)
    return in_u, in_v


in_u, in_v = slopes(s, 1.25, 0.5)
print(f"in u {in_u:.2f}, in v {in_v:.2f}")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, the value along a row of pixels: stairs for the nearest pixel, connected lines for bilinear; right, the slopes: zero for the stairs, plus 4 and minus 6 for the lines"
nudged = (read(s, 1.26, 0.5) - read(s, 1.24, 0.5)) / 0.02, (read(s, 1.25, 0.51) - read(s, 1.25, 0.49)) / 0.02
np.testing.assert_allclose((in_u, in_v), nudged)
across = np.linspace(0, 2, 401)
fig, axes = plt.subplots(1, 2, figsize=(8, 2.8), layout="constrained")
axes[0].plot(across, s[1, np.floor(across + 0.5).astype(int)], ":", color="black", label="nearest pixel")
axes[0].plot(across, [read(s, u, 1.0) for u in across], color="tab:red", label="bilinear")
axes[0].plot(range(3), s[1], "o", color="black", label="scores of row 1")
axes[0].set(xlabel="u [pixels]", ylabel="p", xticks=range(3), title="the value along row 1")
axes[0].legend(fontsize=9)
between = across[across % 1 > 1e-9]
axes[1].plot(between, np.zeros_like(between), ":", color="black", label="nearest pixel")
for left in (0, 1):
    axes[1].plot([left, left + 1], [slopes(s, left + 0.5, 1.0)[0]] * 2, color="tab:red", label=("bilinear", None)[left])
axes[1].set(xlabel="u [pixels]", ylabel="slope of p in u [per pixel]", xticks=range(3), title="its slope")
axes[1].legend(fontsize=9)
plt.show()


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
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
# The nearest pixel gives stairs, flat between the jumps, so there is nothing to learn from. Bilinear reading gives connected
# lines. In the live notebook, move the point across a column: the value doesn't jump, but its slope does. (Exactly on
# a column there is none, and our code says 0.) So on a row of pixels the derivative in $u$ is the difference between
# the pixels right and left of the point; between two rows it is the weighted mean of both differences. Likewise in $v$.
#
# ## Can a map correct a camera's angle?
#
# First by hand. A point at (1.25, 1) is a quarter pixel right of the 6, and the map says that it should read 6:
#
# ```
# it reads 3/4 · 6 + 1/4 · 0 = 4.5        derivative in p:   4.5 - 6 = -1.5
# slope of p in u:  0 - 6 = -6            derivative in u:  -1.5 · -6 = 9   (chain rule)
# one step of size 0.02:                  u = 1.25 - 0.02 · 9 = 1.07
# ```
#
# The point moves towards the 6. Now suppose we believe that the drive's camera looks two degrees lower than it does. This
# angle, the **pitch** $\psi$, moves all points at once. So each point adds its own chain:
#
# $$ \frac{\partial \ell}{\partial \psi} = \sum_j \bar p_j \left( \frac{\partial p_j}{\partial u_j} \frac{\partial u_j}{\partial \psi} + \frac{\partial p_j}{\partial v_j} \frac{\partial v_j}{\partial \psi} \right) $$
#
# The two slopes of $p$ we have. A camera that looks farther down sees everything higher in the image. So $\partial v_j /
# \partial \psi$ is about $-f_v$ pixels per radian, and $u$ changes much less.
#
# The scores are the true labels of five images, so that no network's mistakes get in. The map's cells are road and
# sidewalk from 8 to 25 m ahead, and a surface through the lowest LIDAR returns gives their heights. The loss is now a
# *mean*, so that more cells don't make longer steps. The step size was found by trying.


# %%
def loss_at(pitch, lessons):
    """Return half the mean squared difference between what the cells read and what the map says."""
    losses = []
    for scores, wanted, points in lessons:
        u, v = calibration.pixels_at(points, pitch, camera.K)  # equation (1), turned by the pitch
        p = calibration.read_points(scores, u, v)  # equation (2)
        losses.append(((p - wanted) ** 2).mean() / 2)
    return torch.stack(losses).mean()


def descend(degrees, lessons, steps, eta=0.004):
    """Return the pitch, in degrees, at each step of the descent."""
    pitch, path = torch.tensor(np.radians(degrees), requires_grad=True), []
    for _ in range(steps):
        path.append(np.degrees(pitch.item()))
        (derivative,) = torch.autograd.grad(loss_at(pitch, lessons), pitch)
        with torch.no_grad():
            pitch -= eta * derivative
    return np.array(path)


lessons = [calibration.lesson_of(drive[k], spec, camera) for k in (0, 5, 10, 15, 19)]
path = descend(2.0, lessons, steps=15)
print("pitch in degrees:", *(f"{degrees:.1f}" for degrees in path))

# %% jupyter={"source_hidden": true}
angle = torch.tensor(0.02, dtype=torch.float64, requires_grad=True)
(derivative,) = torch.autograd.grad(loss_at(angle, lessons), angle)
nudged = [loss_at(torch.tensor(0.02 + a, dtype=torch.float64), lessons) for a in (-1e-7, 1e-7)]
np.testing.assert_allclose(derivative.item(), (nudged[1] - nudged[0]).item() / 2e-7, rtol=1e-3)
alone = [descend(2.0, [lesson], steps=30)[-1] for lesson in lessons]
print("each image alone ends at", *(f"{degrees:+.2f}" for degrees in alone))
assert abs(descend(-2.0, lessons, steps=30)[-1] - descend(2.0, lessons, steps=30)[-1]) < 0.02
at_25 = 1 / (1 / 25 - np.radians(path[-1]) / camera.T_camera_from_grid[1, 3])  # lecture 05's rule
assert 1.5 < 25 - at_25 < 2
at_ten = torch.tensor(np.radians(10.0))
heard = [calibration.read_points(s, *calibration.pixels_at(points, at_ten, camera.K)) for s, _, points in lessons]
assert not any(p.any() for p in heard)
assert abs(descend(10.0, lessons, steps=3)[-1] - 10) < 1e-4

# %% jupyter={"source_hidden": true} alt="left, two pieces of the image: before, dots of road and sidewalk are too high, the sidewalk's reach the fence; after, the border between them is near the kerb; right, the pitch over the steps falls from two degrees within four steps to minus 0.3, and five crosses for single images are between minus 0.5 and plus 0.1"
fig, axes = plt.subplot_mosaic(
    [["before", "pitch"], ["after", "pitch"]], figsize=(8, 4), layout="constrained", width_ratios=(5, 3)
)
axes = [axes[name] for name in ("before", "after", "pitch")]
_, wanted, on_ground = lessons[0]
for ax, step in zip(axes, (0, len(path) - 1), strict=False):
    u, v = (a.numpy() for a in calibration.pixels_at(on_ground, torch.tensor(np.radians(path[step])), camera.K))
    ax.imshow(130 + image.mean(axis=2) // 16 * 7, cmap="gray", vmin=0, vmax=255)
    for c, (colour, marker) in enumerate(zip(KITTI_14.colours(np.array(calibration.FLAT)) / 255, ".+", strict=True)):
        name = KITTI_14.names[calibration.FLAT[c]]
        of = wanted[c] > 0
        ax.plot(u[of], v[of], marker, color=colour, markersize=4, linestyle="", label=name)
    ax.set(ylim=(90.5, 40), xlim=(130, 270), ylabel="v [pixels]")
    ax.set_title(f"step {step}: {path[step]:+.1f} degrees", fontsize=10)
axes[1].set_xlabel("u [pixels]")
axes[0].legend(loc="lower left", fontsize=8, markerscale=1.5)
axes[2].axhline(0, color="0.6", linewidth=1)
axes[2].plot(path, ".-", color="black", label="five images")
axes[2].plot(np.full(5, len(path) + 1), alone, "x", color="tab:red", label="each alone")
axes[2].set(xticks=(0, 5, 10), ylim=(-0.8, 2.2), xlabel="step", ylabel="pitch [degrees]", title="the descent")
axes[2].legend(fontsize=8)
plt.show()

# %% [markdown]
# Each dot is a cell of the map, at the pixel that the pitch gives it in one of the images. At the end the border between
# road and sidewalk is near the kerb. But the pitch goes past the truth to -0.3 degrees, and each image alone ends
# somewhere between -0.5 and +0.1. By lecture 05's rule, a cell 25 m ahead then reads the ground at 23 m.
#
# Started at ten degrees, the descent doesn't move. No cell reads road or sidewalk there: all scores around it are zero, and
# so is the slope. That is why aligning images starts with small, blurred ones, where a slope reaches farther. So a map
# can correct a camera's angle if it is nearly right, here to about a third of a degree.
#
# ## Where this breaks: what else bends the angle?
#
# What does the descent do if something else is wrong? Let us make an error of known size: tell it that the ground is 10 cm
# higher than the LIDAR says.
#
# **Predict before you run.** The cells are 8 to 25 m ahead. Seen from the camera, by what angle does a point move up, if it
# is raised by 10 cm? Which way does the pitch go, and how far?
#
# <details><summary>Answer</summary>
#
# ```
# 25 m:  0.1 / 25 = 0.004 radians  = 0.23 degrees
#  8 m:  0.1 / 8  = 0.0125 radians = 0.72 degrees
# ```
#
# The points are now too high in the image. To bring them down, the camera must look *up*. So the pitch falls, by
# something between 0.2 and 0.7 degrees.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="the pitch at the end of the descent over the error of the ground's height, from minus 20 to plus 20 cm: a falling line through minus 0.3 degrees at zero, inside a grey wedge of what was computed by hand; small crosses for single images scatter around it by about a quarter of a degree"
raised = np.array([-0.2, -0.1, 0, 0.1, 0.2])


def ends_at(metres, lessons):
    """Return where the descent ends if the ground is raised; in the camera's frame down is positive."""
    up = torch.tensor([0.0, metres, 0.0])
    return descend(0.0, [(scores, wanted, points - up) for scores, wanted, points in lessons], steps=20)[-1]


together = np.array([ends_at(metres, lessons) for metres in raised])
fig, ax = plt.subplots(figsize=(6, 3), layout="constrained")
for nth, lesson in enumerate(lessons):
    single = [ends_at(metres, [lesson]) for metres in raised]
    ax.plot(100 * raised, single, "x", color="tab:red", markersize=5, label=("each alone", None)[nth > 0])
by_hand = [together[2] - np.degrees(raised / Z) for Z in (25, 8)]
ax.fill_between(100 * raised, *by_hand, color="0.88", label="by hand, 8 to 25 m")
ax.plot(100 * raised, together, "o-", color="black", label="five images")
ax.axhline(0, color="0.6", linewidth=1)
ax.set(xlabel="the ground is raised by [cm]", ylabel="pitch at the end [degrees]", xticks=100 * raised)
ax.legend(fontsize=8)
plt.show()
print(
    f"from {together[2]:+.2f} to {together[3]:+.2f} degrees with the ground 10 cm higher, to {together[1]:+.2f} lower"
)
assert ((-np.diff(together) > 0.23) & (-np.diff(together) < 0.72)).all()

# %% [markdown]
# The pitch falls by 0.27 degrees for each 10 cm, within what we computed, and nothing warns us. Lower the ground by 10 cm,
# and the pitch even ends at the truth. But this doesn't prove that our ground was 10 cm too high, because any error that
# moves the points alike would do the same. So **a gradient changes whatever may move**, and the angle bends to make up for whatever is wrong.
#
# ## In five lines
#
# 1. A loss says how wrong, its gradient where to go, the step size how far.
# 2. A point reads the four pixels around it. The way back is the transpose: the same weights, added up over readers.
# 3. Check a gradient with a nudge, and a pair of passes with random numbers. Both miss a wrong convention; a ramp shows it.
# 4. What a pixel is worth grows with the square of the distance: half a pixel is five metres of ground at sixty.
# 5. In u and v the gradient is a difference of neighbours. It can correct a camera's angle, but the angle bends to
#    whatever else is wrong.
#
# ## Further reading and exercise
#
# - Jaderberg, Simonyan, Zisserman, Kavukcuoglu, *Spatial Transformer Networks*, NIPS 2015: equation (2) and its
#   gradient in u and v.
# - Lucas, Kanade, *An iterative image registration technique with an application to stereo vision*, IJCAI 1981:
#   aligning by the slope of an image, long before networks.
#
# [Exercise 06](exercises/06_planes.ipynb): from four weights to your own sampler on two streets. Next: lecture
# [07](07_segmentation.ipynb), three networks for segmentation.

# %% [markdown]
# # 06 · Sampling that learns: equation (2) and its gradient
#
# **In one sentence.** A point on the map reads four pixels with four weights, and an error on the map goes back to the
# same four pixels by the same weights; so a map can teach an image, and even correct a camera's angle.
#
# **You will be able to**
# - say what a loss is, and take one step of gradient descent by hand;
# - compute a bilinear sample by hand, and its gradient in the scores, in u and in v;
# - write equation (2) as a matrix, and say why its transpose carries the gradient;
# - check any gradient with a nudge, and any sampler with a ramp;
# - say what half a pixel costs on the ground, in metres.
#
# **Prerequisites.** Lecture [05](05_pixels.ipynb): equation (1) gives a pixel (u, v) to each point of each plane.
# Derivatives and the chain rule; a matrix times a vector.
#
# **Time.** 77 minutes, of which the computer needs less than one.
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
x_cells = spec.centers()[..., 0]

# %% [markdown]
# ## What is a loss, and what is one step?
#
# In this course a network will label the pixels of an image. But the truth that we have is a *map*: the class of each
# cell, seen from above. Nobody labels the pixels. How can an error on the map correct a pixel?
#
# First we need to say what *wrong* means, and in which direction *better* is. Take one pixel and one class. Its score $s$
# is 4, and somebody who knows says that it should be 6. A **loss** is one number that is zero when all is right and grows with
# the error. Here it is half the squared difference, $\ell = \tfrac12 (s - 6)^2$, which is 2.
#
# Which way is better? The derivative of this loss is $s - 6$, which is -2. So if we raise $s$ by a little, the loss
# falls by twice as much. The rule of **gradient descent** is to go *against* the derivative, by a fixed fraction of it, the **step size**
# $\eta$: $\;s \leftarrow s - \eta\, \partial \ell / \partial s$.
#
# ```
# step size 0.25:   4 -> 4 + 0.25 · 2 = 4.5    there the derivative is -1.5
#                        4.5 + 0.25 · 1.5 = 4.875, a shorter step
# step size 2.5:    4 -> 4 + 2.5 · 2 = 9       farther from 6 than before
# ```


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
assert [one_step(4, 0.25), one_step(4.5, 0.25), one_step(4, 2.5)] == [4.5, 4.875, 9]
plt.show()

# %% [markdown]
# That is all of learning, with one number. With many scores each gets its own derivative. All of them together are the
# **gradient**, and each score takes its step at the same time. So the loss says *how wrong*, the gradient says *where to
# go*, and the step size says *how far*.
#
# What is left is to find the derivative of an error on the map in a score of the image. For this we need to know how
# the map reads the image.
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
# Equation (1) sends a point of a plane to (u, v) = (1.25, 0.5). That is a quarter of the way from the middle column to the
# right one, and half-way between the two upper rows.
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
package = sample_planes_naive(s[None], points.reshape(1, 1, 2, 2), np.ones((1, 1, 2), bool))
np.testing.assert_allclose([read(s, u, v) for u, v in points], package.ravel())
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
# On the left the cross is the point, and the red numbers are the weights. On the right is the part that comes from
# going across: the nearer a column, the larger its weight.
#
# On the drive, equation (1) has found the pixels. Here are three small pieces of one image, magnified, with the points
# of the ground plane on them.

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
# by how much the loss changes. This is slow, one pixel at a time, and hard to get wrong. And if the gradient is right, a
# step against it must lower the loss.


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
leaf = torch.tensor(s)[None, None].requires_grad_()
toy_sampler = PlaneSampler(points.reshape(1, 1, 2, 2), np.ones((1, 1, 2), bool), (3, 3)).double()
(toy_sampler(leaf)[0, 0, 0, 0] - torch.tensor(wanted)).pow(2).sum().div(2).backward()
np.testing.assert_allclose(leaf.grad[0, 0], s_bar)

# %% [markdown]
# The map told two points that they were wrong, and five pixels learnt from it. (The package's sampler gives the same
# gradient.) So an error reaches exactly the pixels that were read, by the weights with which they were read.
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
full = 4 * visible.size * np.prod(camera.size)
print(f"the drive's ground plane: {ground.operator.nbytes / 1e6:.1f} MB with the transpose, ", end="")
print(f"instead of {full / 1e6:.0f} MB for a full matrix")

# %% [markdown]
# The package's `fast.PlaneSampler` is this matrix and its transpose for the drive's camera, and passes the same test.
# Only the weights that aren't zero are kept. So the way back costs about as much as the way there, and needs no new mathematics.
#
# ## Can pixels learn from the map alone?
#
# Forget the network for now: let every score of the image be a free number, zero at first. No pixel has a label. You get
# the *map*: the class of each ground cell that the camera sees. A cell should read 1 for its true class and 0 for the
# others, and the loss is half the squared difference, as before. From now on PyTorch goes the way back for us:
# `torch.autograd.grad` returns the gradient that we have computed by hand.
#
# **Predict before you run.** Which pixels of the image get a class? Think of the three magnified pieces. And what
# will the pixels of a picket fence learn, when the cell *behind* the fence is lawn?
#
# <details><summary>Answer</summary>
#
# Pixels that a cell in sight reads: a lattice of dots near by, a closed carpet far away, nothing above the horizon. The
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
ROAD, SIDEWALK, FENCE, LAWN = (KITTI_14.index(name) for name in ("road", "sidewalk", "fence", "vegetation"))
flat, was_read = np.isin(true_labels, [ROAD, SIDEWALK]), learnt < 255
below = np.arange(96) > camera.K[1, 2]
right = [100 * (a == true_labels)[flat & was_read].mean() for a in (learnt, np.full(learnt.shape, ROAD))]
print(
    f"{100 * was_read[below].mean():.0f} % of the pixels below the horizon are read, {was_read[~below].sum()} above it"
)
print(f"of those on road and sidewalk {right[0]:.0f} % learn their class; always road would get {right[1]:.0f} %")
assert right[0] > right[1] + 10

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="A, the classes that pixels have learnt from the map, dots near by and a closed area far ahead, with nothing above the horizon, and the fence at F learnt as vegetation; B, the true labels, with the fence at F"
fig, axes = plt.subplots(2, 1, figsize=(7.5, 3.8), layout="constrained")
plotting.image_labels(image, learnt, KITTI_14, ax=axes[0], opacity=1).set_title("A: learnt from the map", fontsize=10)
plotting.image_labels(image, true_labels, KITTI_14, ax=axes[1]).set_title(
    "B: true labels, never shown to it", fontsize=10
)
axes[0].get_legend().remove()
plotting.class_legend(axes[1], KITTI_14, true_labels, loc="upper center", bbox_to_anchor=(0.5, 0), ncols=5)
for ax in axes:
    ax.images[0].set_interpolation("nearest")
    ax.set_ylim(95.5, 35.5)
    arrow = {"arrowstyle": "->", "color": "black"}
    ax.annotate("F", (254, 60), (234, 86), fontweight="bold", arrowprops=arrow, bbox={"fc": "white", "pad": 1.5})
plt.show()

# %% [markdown]
# In A the photograph is visible where nothing was learnt. On road and sidewalk nearly all pixels that are read learn
# their class, although no pixel was ever labelled. The trivial rule *always road* is far behind.
#
# But the fence (F) has become lawn. Is occlusion really the cause? Switch it off. The simulator knows the depth of each
# pixel. So leave out every cell that is farther away than what its pixel shows. As a control, leave out as many cells at
# random.

# %% jupyter={"source_hidden": true}
(places,), (inside,) = plane_pixels(spec, [0.0], frame.camera)
centres = np.dstack([spec.centers(), np.zeros(spec.shape)])
Z = calibration.transform_points(camera.T_camera_from_grid, centres)[..., 2]
cols, rows = places[inside].round().astype(int).T
occluded = np.zeros(spec.shape, bool)
occluded[inside] = frame.labels.depth[rows, cols] < Z[inside] - 1  # something is more than a metre nearer
at_random = taught.copy()
gone = np.random.default_rng(0).choice(np.flatnonzero(taught), (taught & occluded).sum(), replace=False)
at_random.ravel()[gone] = False
fence_turned_lawn = {}
for name, cells in {
    "all cells": taught,
    "without occluded": taught & ~occluded,
    "as many at random": at_random,
}.items():
    fence_turned_lawn[name] = ((learn_from_map(cells) == LAWN) & (true_labels == FENCE)).sum()
    print(f"{name:<18} {fence_turned_lawn[name]:3d} pixels of the fence learn vegetation")
assert fence_turned_lawn["without occluded"] < 0.2 * fence_turned_lawn["as many at random"]

# %% [markdown]
# Without the occluded cells the mistake nearly goes, and the control keeps it. So the map alone can teach pixels, as far
# as they are read. What it teaches is wrong where a cell reads something in front of itself.
#
# ## What does half a pixel cost?
#
# All this needs one convention: here **the centre of the first pixel is (0, 0)**. Others put the zero on the *corner* of
# the first pixel. Both are fine, but mixing them isn't. PyTorch's `grid_sample` wants places scaled to `-1 .. 1`. With
# `align_corners=True` these are the centres of the first and the last pixel. With `False`, the default, they are the
# outer edges of the image.
#
# Suppose that a program scales for one and calls the other. How would you notice? The error is half a pixel at most, too
# little to see in a picture. Use a **ramp**: let each pixel's score be its own v. Then the value that is read *is* the
# place that was read.

# %%
ramp = torch.arange(96.0)[:, None].expand(camera.size)[None, None]
asked = torch.linspace(0.5, 94.5, 189)
where = torch.stack([torch.zeros(189), 2 * asked / 95 - 1], dim=-1)[None, None]  # scaled for centres
off = {}
for align_corners in (True, False):
    was_read = torch.nn.functional.grid_sample(ramp, where, align_corners=align_corners)[0, 0, 0]
    off[align_corners] = was_read - asked
    print(f"align_corners={align_corners}: off by up to {off[align_corners].abs().max():.2f} pixels")

# %% jupyter={"source_hidden": true}
in_view = visible[0]  # the package's sampler reads the ramp right
assert np.abs(ground(ramp)[0, 0, 0].numpy() - pixels[0, ..., 1])[in_view].max() < 1e-3

# %% [markdown]
# The ramp has found it. Is it worth the trouble? Take a toy camera at $z_\text{cam}$ = 1.5 m, with a focal length $f_v$ of 200
# pixels. A point of the ground $Z$ metres ahead is $f_v\, z_\text{cam} / Z$ pixels below the horizon, by similar triangles.
#
# **Predict before you run.** How many pixels below the horizon is the ground at 10 and at 60 m? Now read half a pixel
# too low. Which ground do you get instead?
#
# <details><summary>Answer</summary>
#
# ```
# 10 m:  300 / 10 = 30 pixels;  300 / 30.5 =  9.8 m
# 60 m:  300 / 60 =  5 pixels;  300 / 5.5  = 54.5 m
# ```
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="A, the error on the ramp over the image's rows: none with matching conventions, with mixed ones a line from minus half a pixel at the top to plus half a pixel at the bottom; B, metres of ground over the distance for an error of half a pixel: a curve from 0.2 m at 10 m over 1.4 m at 30 m to 5.5 m at 60 m"
fig, axes = plt.subplots(1, 2, figsize=(7.8, 2.9), layout="constrained")
for align_corners, style, name in ((True, "-", "matching"), (False, "--", "mixed")):
    axes[0].plot(asked, off[align_corners], style, color="black", label=name)
axes[0].set(xlabel="row that was asked for, v [pixels]", ylabel="read too low by [pixels]", title="A: two conventions")
axes[0].legend(fontsize=9)
far = np.linspace(5, 65, 200)
axes[1].plot(far, far - 300 / (300 / far + 0.5), color="black")
for Z in (10, 30, 60):
    short = Z - 300 / (300 / Z + 0.5)
    axes[1].plot(Z, short, "o", color="tab:red")
    axes[1].annotate(f"{short:.1f} m", (Z, short), xytext=(-34, 6), textcoords="offset points", fontsize=9)
axes[1].set(xlabel="distance Z [m]", ylabel="error on the ground [m]", title="B: half a pixel too low")
plt.show()

# %% [markdown]
# In A the mixed program errs in opposite directions at the top and at the bottom, and not at all in the middle. B shows what half a pixel
# costs: the error grows with the *square* of the distance, because $\partial Z / \partial v = -Z^2 / (f_v\,
# z_\text{cam})$. So half a pixel is a hand's breadth near by, and eleven cells of half a metre at 60 m. Nothing crashes. State your
# convention, and test it with a ramp.
#
# ## What changes if the point moves?
#
# So far the scores learnt, and the points stood still. But what if the camera's angle should learn? Then the points move, and
# the question is how $p$ changes with $u$ and $v$.
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
nudged = (read(s, 1.26, 0.5) - read(s, 1.24, 0.5)) / 0.02, (read(s, 1.25, 0.51) - read(s, 1.25, 0.49)) / 0.02
np.testing.assert_allclose((in_u, in_v), nudged)
print(f"in u {in_u:.2f}, in v {in_v:.2f}")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, the value along a row of pixels: stairs for the nearest pixel, connected lines for bilinear; right, the slopes: zero for the stairs, plus 4 and minus 6 for the lines"
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
# lines. (The dials work with a running kernel. Cross a column: the value doesn't jump, but its slope does.) So the
# derivative in $u$ is the difference between the pixels right and left of the point, and likewise in $v$.
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
# The point moves towards the 6. Now suppose we believe that the drive's camera looks two degrees lower than it does. The **pitch**, the
# angle by which it looks down, moves all points at once. So its derivative is a sum over points: $\bar p$, times the
# slopes in u and v, times what the pitch does to u and v. The map has road and sidewalk, with the ground's height from the
# LIDAR. The scores are the true labels of five images, so that hardly anything but the angle is wrong.


# %%
def descend(degrees, lessons, steps, eta=0.004):
    """Return the pitch, in degrees, at each step of the descent."""
    pitch, path = torch.tensor(np.radians(degrees), requires_grad=True), []
    for _ in range(steps):
        path.append(np.degrees(pitch.item()))
        loss = calibration.loss_at(pitch, lessons, camera.K)
        (derivative,) = torch.autograd.grad(loss, pitch)
        with torch.no_grad():
            pitch -= eta * derivative
    return np.array(path)


lessons = [calibration.lesson_of(drive[k], spec, camera) for k in (0, 5, 10, 15, 19)]
path = descend(2.0, lessons, steps=10)
print("pitch in degrees:", *(f"{degrees:.1f}" for degrees in path))

# %% jupyter={"source_hidden": true}
angle = torch.tensor(0.02, dtype=torch.float64, requires_grad=True)
(derivative,) = torch.autograd.grad(calibration.loss_at(angle, lessons, camera.K), angle)
nudged = [calibration.loss_at(torch.tensor(0.02 + a, dtype=torch.float64), lessons, camera.K) for a in (-1e-7, 1e-7)]
np.testing.assert_allclose(derivative.item(), (nudged[1] - nudged[0]).item() / 2e-7, rtol=1e-3)


# %% jupyter={"source_hidden": true}
def converging():
    """Yield the figure with the points at each step."""
    fig, (left, right) = plt.subplots(1, 2, figsize=(8.2, 2.7), layout="constrained", width_ratios=(3, 1))
    _, wanted, on_ground = lessons[0]
    left.imshow(130 + image.mean(axis=2) // 16 * 7, cmap="gray", vmin=0, vmax=255)
    left.set(ylim=(95.5, 30), xlim=(60, 319.5), xlabel="u [pixels]", ylabel="v [pixels]")
    right.axhline(0, color="0.6", linewidth=1)
    right.set(xlim=(-0.5, 9.5), xticks=(0, 4, 8), ylim=(-0.7, 2.2), xlabel="step", ylabel="pitch [degrees]", title="B")
    dots = []
    for c, (colour, marker) in enumerate(zip(KITTI_14.colours(np.array(calibration.FLAT)) / 255, ".+", strict=True)):
        name = KITTI_14.names[calibration.FLAT[c]]
        dots += left.plot([], [], marker, color=colour, markersize=3, linestyle="", label=name)
    left.legend(loc="upper left", fontsize=8, markerscale=2)
    (line,) = right.plot([], [], ".-", color="black")
    for step in (0, 1, 2, 3, 4, 6, 9):
        u, v = (a.numpy() for a in calibration.pixels_at(on_ground, torch.tensor(np.radians(path[step])), camera.K))
        for c, dot in enumerate(dots):
            dot.set_data(u[wanted[c] > 0], v[wanted[c] > 0])
        left.set_title(f"A: the map's cells in the image, step {step}", fontsize=10)
        line.set_data(range(step + 1), path[: step + 1])
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


# %% jupyter={"source_hidden": true} alt="animation: A, dots of road and sidewalk are too high in the image and slide down within four steps until the border between them is on the kerb; B, the pitch over the steps falls from two degrees to minus 0.3"
plotting.animate(converging(), period=0.6, alt="the map's cells slide onto road and sidewalk as the pitch is learnt")

# %% [markdown]
# In A each dot is a cell of the map, at the pixel that the pitch of this step gives it. After four steps the border between
# road and sidewalk is on the kerb. But B goes on, past the truth, and stops at -0.3 degrees. **0.9 pixels remain.** That
# sounds little. On the map it means that a cell 60 m ahead reads the ground at 51 m.
#
# Why does it stop there? A suspect: cells beside things. A point that is a little too high reads the car behind it. One
# that is a little too low still reads road. So it is safer to read too low.
#
# **Predict before you run.** How would you test this suspicion? And what is the control?
#
# <details><summary>Answer</summary>
#
# Leave out all cells that have anything but road and sidewalk within two pixels, which is about a quarter of them. As a
# control, leave out as many at random. If the suspect is guilty, only the first ends near the truth.
#
# </details>

# %% jupyter={"outputs_hidden": true}
clear = [calibration.clear_of_things(lesson, camera.K) for lesson in lessons]
as_many = [calibration.as_many_at_random(all_of, len(kept[2]), 0) for all_of, kept in zip(lessons, clear, strict=True)]
ends = {}
for name, chosen in {"all cells": lessons, "clear of things": clear, "as many at random": as_many}.items():
    ends[name] = [descend(start, chosen, steps=30)[-1] for start in (2.0, -2.0)]
    print(f"{name:<18} ends at {ends[name][0]:+.1f} from above, at {ends[name][1]:+.1f} from below")

# %% jupyter={"source_hidden": true}
assert max(np.abs(ends["clear of things"])) < 0.15 < 0.25 < min(np.abs(ends["as many at random"]))
kept = sum(len(lesson[2]) for lesson in clear) / sum(len(lesson[2]) for lesson in lessons)
assert 0.75 < kept < 0.8
end = torch.tensor(np.radians(path[-1]))
height = camera.T_camera_from_grid[1, 3]
ahead = torch.tensor([[0.0, height, 60.0]], dtype=torch.float64)
below_horizon = calibration.pixels_at(ahead, end, camera.K)[1].numpy() - camera.K[1, 2]
pixels_off = below_horizon - camera.K[1, 1] * height / ahead[:, 2].numpy()
read_instead = camera.K[1, 1] * height / below_horizon
print(f"60 m ahead, {pixels_off[0]:.1f} pixels remain: read is the ground at {read_instead[0]:.0f} m")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="loss over pitch: A, from minus 15 to 12 degrees, a valley near zero with flat ends below minus 12 and above 9.5 degrees, where a descent from 10 stays while those from 6 and minus 6 reach the valley; B, near zero: with all cells the lowest point is at minus 0.3, with the cells clear of things at minus 0.1"
fig, (wide, near) = plt.subplots(1, 2, figsize=(8, 3.1), layout="constrained")
with torch.inference_mode():
    curve = {}
    for name, chosen, at in (("wide", lessons[:2], np.arange(-15, 12.1, 1.0)), ("all cells", lessons, np.arange(-1, 1.01, 0.1)),
                             ("clear of things", clear, np.arange(-1, 1.01, 0.1))):  # fmt: skip
        curve[name] = at, np.array([calibration.loss_at(torch.tensor(np.radians(a)), chosen, camera.K) for a in at])
wide.plot(*curve["wide"], color="0.5")
starts = {start: descend(start, lessons[:2], steps=30)[-1] for start in (10.0, 6.0, -6.0)}
for start, end in starts.items():
    on_curve = np.interp([start, end], *curve["wide"])
    wide.annotate("", (end, on_curve[1]), (start, on_curve[0]), arrowprops={"arrowstyle": "->", "color": "tab:red"})
    wide.plot(start, on_curve[0], "o", color="tab:red")
for name, style in (("all cells", "-"), ("clear of things", "--")):
    at, losses = curve[name]
    near.plot(at, losses, style, color="black", label=name)
    near.plot(at[losses.argmin()], losses.min(), "v", color="black")
near.axvline(0, color="0.6", linewidth=1)
wide.set(xlabel="pitch [degrees]", ylabel="loss", title="A: where a descent starts")
near.set(xlabel="pitch [degrees]", title="B: where it ends", ylim=(0, 0.045))
near.legend(fontsize=9, loc="upper left")
plt.show()
assert starts[10.0] == 10
assert max(abs(starts[6.0]), abs(starts[-6.0])) < 0.6

# %% [markdown]
# The suspect is guilty. Without cells beside things both descents end a tenth of a degree from the truth (B). The control
# stays where it was. (We chose these cells with the true angle, so this is a diagnosis, not yet a remedy.) So a map can correct a
# camera's angle, to a pixel. But **a gradient changes whatever may move**: if something else is wrong, here what a cell beside a
# car reads, the angle bends to make up for it.
#
# ## Where this breaks
#
# **A slope needs scores that change.** In A above, a red dot is a start and its arrow shows where thirty steps lead. From six
# degrees on either side the descent arrives. From ten it never moves, because no cell reads road or sidewalk. All scores
# around are zero, and so is the slope. That is why aligning images starts with small, blurred ones, where a slope reaches
# farther, and refines.
#
# **Four pixels are the right number at one distance only.** Seven metres ahead a cell covers about forty pixels and reads four of
# them. Let each pixel have an error of its own. How much of it does a cell keep, and how much would the mean over its
# whole area keep?

# %% jupyter={"source_hidden": true} alt="how much of a pixel's error a cell keeps, over the distance: with four pixels about two thirds everywhere; with the mean over the cell from 0.16 at 7 m, rising slowly to 0.55 at 60 m"
kept_error = {"four pixels, equation (2)": calibration.noise_left(spec, camera, 1),
              "mean over the cell": calibration.noise_left(spec, camera, 5)}  # fmt: skip
fig, ax = plt.subplots(figsize=(6.2, 2.6), layout="constrained")
for (name, kept), style in zip(kept_error.items(), ("-", "--"), strict=True):
    seen = ~np.isnan(kept).all(axis=1)
    ax.plot(x_cells[seen, 0], np.nanmean(kept[seen], axis=1), style, color="black", label=name)
ax.set(xlabel="x, forward [m]", ylabel="error that is kept", xlim=(6, 71), ylim=(0, 1))
ax.legend(fontsize=9)
plt.show()
near_by = (x_cells > 6.5) & (x_cells < 8)
means = [np.nanmean(kept[near_by]) for kept in kept_error.values()]
assert 0.64 < means[0] < 0.7
assert means[1] < means[0] / 4

# %% [markdown]
# Near by the mean would keep a quarter of what four pixels keep. Far ahead the two come close. (The waves: a point on a
# pixel's row reads two pixels, not four.) But this needs errors that are independent. A network that takes a shadow for
# a car is wrong on all forty pixels. And far ahead several cells read one pixel. They share its error, so they are one
# witness.
#
# ## In five lines
#
# 1. A loss says how wrong, its gradient where to go, the step size how far.
# 2. A point reads the four pixels around it. The way back is the transpose: the same weights, added up over readers.
# 3. Check a gradient with a nudge, a pair of passes with random numbers, a convention with a ramp.
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
# - Griewank, Walther, *Evaluating Derivatives*, SIAM 2008: why the transpose, for any program.
#
# [Exercise 06](exercises/06_planes.ipynb): four pixels and their weights, a bug in a way back, the slope of a loss in the
# yaw, which convention a black box has, and your own sampler on two streets. Next: lecture
# [07](07_segmentation.ipynb), three networks for segmentation.

# %% [markdown]
# # Training, and what it learns
#
# **In one sentence.** Training is a loop of a batch, a loss, its gradient and a step; momentum is what makes the step
# useful in a narrow valley, and what has been learnt has to be measured, because neither the weights nor the training
# frames show it.
#
# **You will be able to**
# - make a step of gradient descent with momentum by hand, and say when momentum is faster;
# - write a training loop in twenty lines, and test it by learning two frames by heart;
# - tell *overfitting* (learning the frames by heart) from *generalisation* (being right on new ones);
# - tell apart which heights are right, which have large weights, and which the result depends on.
#
# **Prerequisites.** Lecture [08](../08_fusion.ipynb): the loss, the gradient from map to pixels.
#
# **Time.** 49 minutes; the computer needs one.

# %% jupyter={"source_hidden": true}
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from IPython.display import Markdown

from semgrid_edu import plotting
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.samples import sample_drive, sample_frames, sample_image_stage, sample_weights
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import class_accuracy, confusion_matrix, pixel_accuracy, semantic_cells

# %% jupyter={"source_hidden": true}
from semgrid_edu.fast import build_net, load_net, track_drive
from semgrid_edu.networks import Architecture
from semgrid_edu.pipeline import network_image
from semgrid_edu.planes import plane_heights, plane_pixels
from semgrid_edu.training import TrainingParams, train
from semgrid_edu.training.batches import Batch, draw_batch, grid_logits
from semgrid_edu.fast.allocator import keep_freed_memory
from semgrid_edu.training.log import read_log
from semgrid_edu.training.loss import class_weights

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
torch.set_num_threads(1)
keep_freed_memory()
NAMES = {"segnet": "SegNet", "fcn": "FCN", "deeplab": "DeepLab v2", "unet": "U-Net"}
drive, spec, heights, few = sample_drive(), GridSpec.compact(), plane_heights(), sample_frames()
frames = [drive[k] for k in range(len(drive))]
beliefs = [belief.probability for belief in track_drive(frames, spec)]
truth = np.stack([grid_truth(f.labels, o, spec) for f, o in zip(frames, beliefs, strict=True)])[::2]
image = torch.from_numpy(np.stack([network_image(frame, Architecture.image_size) for frame in frames[::2]]))
o, frames, shown = torch.from_numpy(np.stack(beliefs[::2])), frames[::2], 5
ROAD, SIDEWALK, CAR, BICYCLE, BUILDING = map(KITTI_14.index, ("road", "sidewalk", "car", "bicycle", "building"))

# %% [markdown]
# ## One step downhill, with momentum
#
# All that is learnt, $\theta$, takes steps against the gradient of the loss. Momentum $\kappa$ makes a step out of the
# last one and the new gradient; the learning rate $\eta$ says how far it goes (section 4.1; $\kappa = 0.9$):
#
# $$ \Delta \leftarrow \kappa\,\Delta + \frac{\partial\,\text{loss}}{\partial \theta}, \qquad
#    \theta \leftarrow \theta - \eta\,\Delta $$
#
# Take one parameter and the loss $\theta^2 / 2$, whose gradient is $\theta$ itself. Start at $\theta = 1$ with $\Delta =
# 0$ and $\eta = 0.1$.
#
# **Predict before you run.** Three steps by hand. How large does a step become in the long run, when the gradient is
# always 1?
#
# <details><summary>Answer</summary>
#
# $\Delta = 1$, $\theta = 0.9$. $\Delta = 0.9 + 0.9 = 1.8$, $\theta = 0.72$. $\Delta = 1.62 + 0.72 = 2.34$, $\theta =
# 0.486$. With a constant gradient of 1, $\Delta$ tends to $1 / (1 - 0.9) = 10$: ten times the step of plain descent.
#
# </details>


# %% tags=["momentum"]
def descend(theta, gradient, rates, kappa):
    """Take one step for each rate; return theta before, between and after them."""
    delta, path = 0.0, [theta]
    for k, eta in enumerate(rates):
        delta = kappa * delta + gradient(theta, k)
        theta = theta - eta * delta
        path.append(theta)
    return np.array(path)


def cosine(eta, steps):
    """Return the rate of each step: from eta along half a cosine to zero."""
    return eta * (1 + np.cos(np.pi * np.arange(steps) / steps)) / 2


# %% jupyter={"outputs_hidden": true}
path = descend(1.0, lambda theta, k: theta, rates=[0.1] * 3, kappa=0.9)
parameter = torch.ones(1, dtype=torch.float64, requires_grad=True)
optimiser = torch.optim.SGD([parameter], lr=0.1, momentum=0.9)
for by_hand in path[1:]:
    optimiser.zero_grad()  # or the new gradient is added to the old one
    (parameter**2 / 2).sum().backward()
    optimiser.step()
    np.testing.assert_allclose(parameter.item(), by_hand)
schedule = TrainingParams(image_iterations=10, grid_iterations=8)
np.testing.assert_allclose(cosine(0.05, 8), [schedule.stage(10 + k)[1] for k in range(8)])
print("theta:", path.round(3), "  cosine, four steps:", cosine(1.0, 4).round(3))

# %% [markdown]
# So is momentum just a larger rate? Take a narrow valley, the loss $(\theta_1^2 + 100\,\theta_2^2) / 2$: across it is a
# hundred times as steep as along. The steep direction limits the rate, because above $2\,(1 + \kappa) / 100$ the steps
# across grow instead of shrinking. (A plain step makes $\theta_2$ into $(1 - 100\,\eta)\,\theta_2$, which grows once
# $\eta > 0.02$.)
#
# **Predict before you run.** Give plain descent and momentum each the best rate below its limit. Which reaches 0.01 in
# both parameters first, and which has the larger rate?
#
# <details><summary>Answer</summary>
#
# Plain descent needs 231 steps, momentum 85. Momentum's best rate is the *smaller* one, 0.003 against 0.020. So its
# speed doesn't come from a larger rate: across the valley the gradient keeps changing its sign and mostly cancels in
# $\Delta$; along the valley the gradients add up.
#
# </details>

# %% jupyter={"outputs_hidden": true}
curvature = np.array([1.0, 100.0])  # along the valley, across it


def valley(eta, kappa, steps=400):
    """Return both parameters before, between and after the steps, from (1, 1) on."""
    return descend(np.ones(2), lambda theta, k: curvature * theta, [eta] * steps, kappa)


def steps_needed(eta, kappa):
    """Return the number of steps until both parameters stay below 0.01."""
    return np.flatnonzero(np.abs(valley(eta, kappa)).max(axis=1) >= 0.01)[-1] + 1


best = {}
for kappa in (0.0, 0.9):
    rates = np.linspace(0.05, 0.999, 200) * 2 * (1 + kappa) / 100
    best[kappa] = min(rates, key=lambda eta, kappa=kappa: steps_needed(eta, kappa))
    print(f"kappa {kappa}: best rate {best[kappa]:.3f}, {steps_needed(best[kappa], kappa)} steps")
assert steps_needed(best[0.9], 0.9) < 0.5 * steps_needed(best[0.0], 0.0)
assert best[0.9] < best[0.0]

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="A, the path of plain descent in a valley: a zigzag from wall to wall that creeps towards the minimum; B, momentum's path: wide swings that die out while it moves along the valley; C, the larger of the two parameters against the step: momentum falls to a hundredth in less than half of the steps"
fig = plt.figure(figsize=(8.2, 4.4), layout="constrained")
axes = fig.subplot_mosaic([["A", "C"], ["B", "C"]])
across, along = np.meshgrid(np.linspace(-1.1, 1.1, 80), np.linspace(-0.7, 1.1, 120))
for letter, kappa, name in (("A", 0.0, "plain descent"), ("B", 0.9, "momentum 0.9")):
    axes[letter].contour(along, across, along**2 + 100 * across**2, np.geomspace(0.01, 100, 9), colors="0.8")
    steps = valley(best[kappa], kappa, 40)
    axes[letter].plot(steps[:, 0], steps[:, 1], ".-", linewidth=0.8, markersize=4, color="tab:blue")
    axes[letter].plot(0, 0, "r+", markersize=10)
    axes[letter].set(title=f"{letter}: {name}, 40 steps", xlabel=r"along, $\theta_1$", ylabel=r"across, $\theta_2$")
    style = "--" if kappa == 0 else "-"
    axes["C"].semilogy(np.abs(valley(best[kappa], kappa, 250)).max(axis=1), style, label=name)
axes["C"].axhline(0.01, color="0.6", linewidth=1)
axes["C"].set(xlabel="step", ylabel="larger of the two parameters", title="C", ylim=(1e-3, None))
axes["C"].legend(fontsize="small")
plt.show()

# %% [markdown]
# A: plain descent jumps from wall to wall and creeps along the valley. B: momentum swings, the swings die out, and the
# motion along the valley builds up. The red cross is the minimum, the grey lines are lines of equal loss. C: how far
# the worse parameter is from its best value, 0; the grey line is the 0.01 of the question.
#
# A batch isn't all streets, so its gradient is right only on average. Add noise to that of one parameter:

# %% jupyter={"source_hidden": true} alt="four curves of one parameter under the same noise: plain descent with rate 0.02 falls slowly over 120 steps; plain with 0.2 and momentum with 0.02 arrive early and keep wandering; momentum with a falling rate arrives early and comes to rest"
noise = np.random.default_rng(0).normal(0, 0.5, 120)
fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
for name, rates, kappa, style, line in (
    ("plain, rate 0.02", [0.02] * 120, 0.0, "0.65", "-"),
    ("plain, rate 0.2", [0.2] * 120, 0.0, "0.2", "-"),
    ("momentum 0.9, rate 0.02", [0.02] * 120, 0.9, "#1e6ee6", "--"),
    ("the same, cosine", cosine(0.02, 120), 0.9, "#fc7200", "-."),
):
    noisy = descend(1.0, lambda theta, k: theta + noise[k], rates, kappa)
    ax.plot(noisy, color=style, linestyle=line, label=name)
ax.axhline(0, color="0.8", zorder=0)
ax.set(xlabel="step", ylabel=r"$\theta$; best is 0")
ax.legend(frameon=False, fontsize="small", ncols=2)
plt.show()

# %% [markdown]
# With one parameter, momentum and a rate ten times as large both arrive within 15 steps, and both then go wherever the
# noise pushes them. If the rate falls to zero along half a cosine, as in training, momentum comes to rest, because
# small last steps average over many gradients.
#
# ## All of it in twenty lines
#
# Training is this loop and nothing more. Lecture 08 explains what it calls: the class weights, the loss, and the chain
# rule, which is `loss.backward()`.


# %%
def learn(net, dataset, batches, params):
    """Learn from the grid's truth, literally; return the loss of each step."""
    alpha = class_weights(dataset, "grid", net.n_classes, params.weight_limit)
    deltas = [torch.zeros_like(theta) for theta in net.parameters()]
    losses = []
    net.train()
    for batch, eta in zip(batches, cosine(params.learning_rate, params.grid_iterations), strict=True):
        net.zero_grad()
        logits = grid_logits(net, batch)
        loss = F.cross_entropy(logits, batch.frames.truth.long(), weight=alpha, ignore_index=IGNORE)
        loss.backward()
        with torch.no_grad():
            for theta, delta in zip(net.parameters(), deltas, strict=True):
                delta.mul_(params.momentum).add_(theta.grad)
                theta -= eta * delta
        losses.append(loss.item())
    net.eval()
    return losses


# %% [markdown]
# Three steps of it, on a small network with two frames of noise, leave the same weights as the package's `train`, which
# adds a log, checkpoints and a first stage on image labels:

# %% jupyter={"source_hidden": true}
rng, small_grid = np.random.default_rng(0), GridSpec(x_min=4, x_max=12, y_min=-4, y_max=4, cell=1)
architecture = Architecture(image_size=(16, 48), grid=small_grid, heights=(0.0, 0.6, 1.2))


def noise_frame():
    """A frame that means nothing, of the small net's size."""
    pixels, classes = (rng.integers(0, n, size, np.uint8) for n, size in ((256, (3, 16, 48)), (14, (8, 8))))
    return Sample(*map(torch.from_numpy, (pixels, pixels[0] % 14, rng.random((4, 8, 8), np.float32), classes)))


# %% tags=["nbval-ignore-output"]
tiny, three_steps = [noise_frame(), noise_frame()], TrainingParams(0, 3, batch_size=2, jitter=0.0)
ours, theirs = build_net(architecture, drive.camera), build_net(architecture, drive.camera)
learn(ours, tiny, [draw_batch(tiny, 2, jitter=0.0, iteration=k, seed=0) for k in range(3)], three_steps)
with TemporaryDirectory() as folder:
    train(theirs, tiny, folder, three_steps, seed=0)
for theta, expected in zip(ours.parameters(), theirs.parameters(), strict=True):
    np.testing.assert_allclose(theta.detach(), expected.detach(), rtol=1e-3, atol=1e-5)

# %% [markdown]
# ## Overfitting first
#
# A network that can't learn two frames by heart has a bug, or is too small, or takes too small steps. So this is the
# first thing to try with any training code. We begin with an image network that knows image labels (the end of stage
# one) and a fresh reduction and fusion, and take 25 steps, each with both frames.
#
# **Predict before you run.** The loss at the beginning, when the fresh network knows nothing of 14 classes? The share
# of right cells after 25 steps? And on the drive, which it doesn't see?
#
# <details><summary>Answer</summary>
#
# Somewhat above $\log 14 = 2.6$, the loss of equal probabilities, because the first guesses are surer than that and
# wrong. More than four cells in five of its own frames are right. On the drive far fewer: it has learnt two streets, not
# streets.
#
# </details>


# %% jupyter={"source_hidden": true}
@torch.inference_mode()
def predict(net, image, o):
    """Return the class of each cell, (B, H, W)."""
    return np.stack([net(i[None], q[None])[0].argmax(dim=0).numpy() for i, q in zip(image, o, strict=True)])


def accuracies(grids, truth):
    """Return pixel accuracy and class accuracy over cells whose truth is a semantic class, per cent."""
    counts = semantic_cells(confusion_matrix(truth, grids, n_classes=14), KITTI_14)
    return np.array([100 * pixel_accuracy(counts), 100 * class_accuracy(counts)])


# %% tags=["nbval-ignore-output"] jupyter={"outputs_hidden": true}
everything = Sample(*map(torch.stack, zip(*few[:2], strict=True)))
every_time = Batch(everything._replace(image=everything.image / 255), mirrored=False)
by_heart = load_net(sample_image_stage(), drive.camera)
losses = learn(by_heart, few[:2], [every_time] * 25, TrainingParams(0, 25, batch_size=2, learning_rate=0.25))
recited = predict(by_heart, every_time.frames.image, everything.occupancy)
right = (recited == everything.truth.numpy()).mean()
print(f"loss {losses[0]:.2f} -> {losses[-1]:.2f}; of the cells {100 * right:.0f} % right")
assert losses[0] > np.log(14)
assert right > 0.8

# %% [markdown]
# With 400 steps, from random weights on and every cell counting alike, all four image networks learn four such frames
# (`worlds/lecture_08_overfit.py`):

# %% jupyter={"source_hidden": true}
by_network = json.loads(Path("../../docs/results/overfit.json").read_text(encoding="utf-8"))["networks"]
lines = ["| image network | steps | cells right, of four frames [%] |", "|---|---|---|"]
for name, run in by_network.items():
    lines.append(f"| {NAMES[name]} | {run['iterations']} | {100 * run['pixel accuracy']['evaluation']:.1f} |")
Markdown("\n".join(lines))

# %% [markdown]
# ## Then some seconds, then half an hour
#
# Now the whole way from random weights by `train`: first the image network on image labels, then all of it on the grid,
# with varied brightness and contrast and mirrored streets (*data augmentation*). Six frames, one in each of 10 + 20
# steps. The shipped weights come from the same code with 142 frames, six in each of 2000 + 2000 steps; their log lies
# beside them.

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
quick = build_net(Architecture("segnet"), drive.camera, seed=0)
with TemporaryDirectory() as folder:
    train(quick, few, folder, TrainingParams(10, 20, batch_size=1, learning_rate=0.1), seed=0)
net = load_net(sample_weights(), drive.camera).requires_grad_(False)

# %% jupyter={"source_hidden": true} alt="the loss of the shipped network's training, logarithmic or falling: the first stage falls over 2000 steps, the second starts high again and falls"
plotting.training_curves(read_log(sample_weights().with_name("log.csv")))
plt.show()

# %% [markdown]
# Two stages, two losses, each with its own cosine. The second starts high again, because reduction and fusion are fresh.
#
# **Predict before you run.** Three networks, judged on their own frames and on the drive that none of them has seen.
# Which has the largest gap?
#
# <details><summary>Answer</summary>
#
# The one that learnt by heart: good on its own frames, poor on the drive. That gap is overfitting.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} tags=["nbval-ignore-output"]
learnt = {"two frames by heart": by_heart, "six frames, some seconds": quick, "shipped": net}
on_drive = {name: predict(candidate, image, o) for name, candidate in learnt.items()}
own_image, own_o = (torch.stack([getattr(sample, name) for sample in few]) for name in ("image", "occupancy"))
own_truth = np.stack([sample.truth.numpy() for sample in few])
print(f"{'semantic cells, per cent':<26}{'its own frames':>22}{'drive':>18}")
gaps = {}
for name, candidate in learnt.items():
    mine = slice(2) if candidate is by_heart else slice(6)
    own = accuracies(predict(candidate, own_image[mine] / 255, own_o[mine]), own_truth[mine])
    new = accuracies(on_drive[name], truth)
    gaps[name] = own[0] - new[0]
    print("{:<26}{:>10.0f}, class {:.0f}{:>8.0f}, class {:.0f}".format(name, *own, *new))
assert max(gaps, key=gaps.get) == "two frames by heart"

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="four maps of a frame of the drive: learnt by heart with much noise, some seconds with road and hardly any other class that is seen, the shipped network with clear road, sidewalk and cars, and the truth"
maps = {name: grids[shown] for name, grids in on_drive.items()}
plotting.label_maps(spec, maps | {"truth": truth[shown]}, KITTI_14)
plt.show()

# %% [markdown]
# In the maps, the network that learnt by heart loses much of the road beyond 50 m and paints sidewalk where
# the truth has none. The network of some seconds draws road, and hardly any other class that can be seen. The shipped network draws the
# sidewalk, the lawn beside it and some of the cars.
#
# Frames and steps changed together, so the table doesn't say which of them helped. The six frames are among the 142, so
# the first pair of the last row isn't a test.
#
# ## Which heights does it use?
#
# Three questions, often taken for one. *Which heights are right?* That has nothing to do with the network: carry the
# true labels of the pixels to each plane, and count in how many true cells of a class they say this class. *Which have
# large weights? Which does the result depend on?* To see this, let planes fall silent: each cell in view takes the mean
# scores of its plane, which say nothing about this cell.
#
# **Predict before you run.** For which planes do the true labels say road in a road's cell, car in a car's, building in
# a building's beyond a row of parked cars?
#
# <details><summary>Answer</summary>
#
# Road: most often at 0 m, and with every plane above less. Car: low planes, far below its roof. Building: high planes,
# over the roofs of the cars; lower, fences and cars are in the way.
#
# </details>


# %% jupyter={"source_hidden": true}
@torch.inference_mode()
def grid_of(planes, net):
    """Return the class of each cell, (B, H, W), for planes (B, C, D, H, W)."""
    return np.stack([net.fusion(p[None], q[None])[0].argmax(dim=0).numpy() for p, q in zip(planes, o, strict=True)])


def heard(keep, planes, net):
    """Return the grids that are left when the planes that `keep` (D,) leaves out take their mean over cells in view."""
    in_view = (planes != 0).any(dim=1, keepdim=True)
    mean = (planes * in_view).sum(dim=(0, -2, -1), keepdim=True) / in_view.sum(dim=(0, -2, -1), keepdim=True).clamp(
        min=1
    )
    return grid_of(torch.where(torch.from_numpy(keep)[:, None, None], planes, mean * in_view), net)


def found(grids):
    """Return the share of each class's true cells that are called so, per cent."""
    counts = confusion_matrix(truth, grids, n_classes=14)
    return 100 * np.diag(counts) / np.maximum(counts.sum(axis=1), 1)


# %% jupyter={"source_hidden": true}
def planes_of(net):
    """Return the planes of the drive's ten frames, (B, C, D, H, W)."""
    with torch.inference_mode():
        return torch.cat([net.sampler(net.segmenter(i[None])) for i in image])


def right_heights():
    """Return, for each class and plane, in how many of the class's cells the true labels say so, per cent (C, D)."""
    pixels, visible = plane_pixels(spec, heights, drive.camera)
    u, v = np.rint(np.where(visible[..., None], pixels, 0)).astype(int).transpose(3, 0, 1, 2)
    hits, cells = np.zeros((14, 20)), np.zeros((14, 20))
    for frame, classes in zip(frames, truth, strict=True):
        for c in range(KITTI_14.n_semantic):
            where = visible & (classes == c)
            cells[c] += where.sum(axis=(1, 2))
            hits[c] += (where & (frame.labels.image[v, u] == c)).sum(axis=(1, 2))
    return 100 * hits / np.maximum(cells, 1)


# %% jupyter={"source_hidden": true}
planes, truly = planes_of(net), right_heights()
tops = (0, 3, 5, 7, 10, 12, 19)
up_to = np.array([found(heard(np.arange(20) <= top, planes, net)) for top in tops])
trained = net.fusion.reduce[0].weight[..., 0, 0].numpy()
first = build_net(net.architecture, drive.camera, seed=0).fusion.reduce[0].weight.detach()[..., 0, 0].numpy()
norms = [np.linalg.norm(weight, axis=0).mean(axis=0) for weight in (trained, first)]
changed = np.linalg.norm(trained - first, axis=(0, 1)) / np.linalg.norm(first, axis=(0, 1))

# %% tags=["nbval-ignore-output"] jupyter={"outputs_hidden": true}
print(
    "true labels say the class, at 0, 0.2, 1.0, 1.4, 2.0, 2.4 m; then: found with planes up to 0, .6, 1, 1.4, 2, 2.4, 3.8 m"
)
for c in (ROAD, SIDEWALK, CAR, BICYCLE, BUILDING):
    by_truth = " ".join(f"{value:3.0f}" for value in truly[c, [0, 1, 5, 7, 10, 12]])
    print(f"{KITTI_14.names[c]:<9} {by_truth} | {' '.join(f'{value:3.0f}' for value in up_to[:, c])}")
assert truly[CAR, heights > 2.3].max() < 1
assert up_to[-1, CAR] < up_to[tops.index(12), CAR] - 2
assert up_to[tops.index(3), BUILDING] > truly[BUILDING, :4].max() + 15
print(f"change of the weights over their first norm: lowest two planes {changed[0]:.1f} and {changed[1]:.1f}", end=", ")
print(f"others {changed[2:].min():.1f} to {changed[2:].max():.1f}")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="A, the share of a class's cells whose true label names it, by height: road and car fall with height, building rises; B, the norm of the reduction's weights before and after training, different only on the lowest planes; C, the share found with planes up to a height: building rises with every plane, road and car reach most of theirs early"
fig, axes = plt.subplots(1, 3, figsize=(8.6, 3.2), layout="constrained")
for c, style in ((ROAD, "-"), (CAR, "--"), (BICYCLE, "-."), (BUILDING, ":")):
    colour = np.divide(KITTI_14.rgb[c], 255)
    axes[0].plot(heights, truly[c], style, color=colour, label=KITTI_14.names[c])
    axes[2].plot(heights[list(tops)], up_to[:, c], style, color=colour)
axes[1].plot(heights, norms[0], "o-", color="0.2", markersize=4, label="trained")
axes[1].plot(heights, norms[1], "s--", color="0.6", markersize=4, label="drawn at random")
axes[0].set(title="A: right, by the truth", ylabel="cells whose label says so [%]", ylim=(0, 100))
axes[1].set(title="B: weights", ylabel="norm, mean over classes", ylim=(0, None))
axes[2].set(title="C: planes up to", ylabel="true cells called so [%]", ylim=(0, 100))
for ax in axes:
    ax.set_xlabel("height [m]")
for ax in axes[:2]:
    ax.legend(fontsize="small")
plt.show()

# %% [markdown]
# A: where each class is right. For a road that is the ground plane, and even there only in 56 of 100 cells, because
# things stand in the way and because beyond the crest of this street the road lies below the plane. B: the norms of the
# weights, the length of the 16 numbers by which the reduction multiplies a class's score on a plane. From 1 m up they
# differ little from what was drawn at random, most at the top. But the weights themselves have changed there by
# 0.3 to 0.6 of that norm, as the printed line says: a norm doesn't show what was learnt. C: what is found when
# all higher planes fall silent.
#
# So does it use the right heights? For the road, yes: the ground plane alone finds it. Cars gain seven points from
# the planes up to 1.4 m; those above 2.4 m never show a car, and *with* them four points fewer are found. Bicycles
# gain from planes above 2 m, which never show a bicycle. Buildings are the surprise: with the planes up to 0.6 m two
# in five of their cells are found, although the labels there are right in far fewer. Low down there are the foot of
# the wall and the lawn in front of it, and $o$ says where the wall stands. So the network probably reads from such
# context what geometry doesn't show it; which part of it, this test doesn't say.
#
# One network is one sample. The same on the three shipped ones, which differ in their image network alone:

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
low, rows = heights < 1.1, []
for name in ("segnet", "fcn", "deeplab"):
    other = load_net(sample_weights(name), drive.camera).requires_grad_(False)
    their = planes_of(other)
    for keep, text in ((low | True, "all planes"), (low, "up to 1 m"), (~low, "above 1 m")):
        grids = heard(keep, their, other)
        by_class = found(grids)
        rows.append(
            [NAMES[name], text, *accuracies(grids, truth), by_class[ROAD], by_class[SIDEWALK], by_class[BUILDING]]
        )
all_planes, up_to_1_m, above_1_m = (np.array([row[2:] for row in rows[k::3]]) for k in range(3))
assert (all_planes - up_to_1_m)[:, 0].max() < 5
assert (all_planes - up_to_1_m)[:, 4].min() > 30
assert (all_planes - above_1_m)[:, 0].min() > 10
lines = ["| network | planes | semantic cells | class accuracy | road | sidewalk | building |", "|" + "---|" * 7]
lines += [
    f"| {name} | {text} | " + " | ".join(f"{value:.0f}" for value in values) + " |" for name, text, *values in rows
]
Markdown("\n".join(lines))

# %% [markdown]
# With the planes up to 1 m the three lose at most 4 points of semantic cells and 2 to 7 of class accuracy, and keep road
# and sidewalk, but two fifths of the buildings or more are gone. Without these planes all lose 14 points or more, and not
# alike: FCN loses two fifths of its road, SegNet five points, DeepLab nothing. We don't know why.
#
# ## What this does not show
#
# A network with fewer planes that is *trained* so may learn as much: the companion [more tables](12_more_tables.ipynb)
# has networks with 1, 2, 5 and 10 planes. A plane that falls silent is an input that this network has never met. And
# one drive is one street.
#
# ## In five lines
#
# 1. Training repeats four things: a batch, its loss, the gradient, a step.
# 2. In a narrow valley momentum wins, and not by a larger rate: across the valley gradients cancel, along it they add up.
# 3. Let new training code learn two frames by heart first. A network that only does that is good on its own frames and
#    poor on others.
# 4. A norm of weights shows neither what was learnt nor what the result depends on.
# 5. With its lowest planes alone the network keeps road and sidewalk and loses many buildings.
#
# ## Further reading
#
# - Sutskever, Martens, Dahl, Hinton, *On the importance of initialization and momentum in deep learning*, ICML 2013.
# - Goh, *Why momentum really works*, Distill 2017: the valley, with dials.
# - Loshchilov, Hutter, *SGDR: stochastic gradient descent with warm restarts*, ICLR 2017: the cosine.
#
# Back to [lecture 08](../08_fusion.ipynb).

# %% [markdown]
# # 08 · Reduction, fusion, training end to end
#
# **In one sentence.** Twenty planes per class say more than a map needs, and none of them is right everywhere; a 1x1
# convolution reduces them, a small network fuses them with the occupancy grid, and one loss on the map trains all of
# it, down to the first convolution of the image network.
#
# **You will be able to**
# - compute the 1x1 reduction by hand, and say why it is a product of two matrices;
# - say what image and occupancy grid each contribute to a map, and measure it against a table;
# - draw late fusion as a graph, name the edge that it cuts, and measure its price on a drive;
# - weight a loss so that predicting the frequent classes everywhere no longer gives a low loss;
# - follow the gradient of one wrong cell back to pixels, and say what it does to their labels;
# - say what an error of pitch or yaw costs, for both signs.
#
# **Prerequisites.** Lectures [05](05_pixels.ipynb) and [06](06_planes.ipynb) (equations (1) and (2), the adjoint) and
# [07](07_segmentation.ipynb) (image networks, raw scores, skips). The chain rule.
#
# **Time.** 110 minutes; the computer needs one.
#
# **Paper.** Sections 3.4 and 4.1, figures 4 and 5; claims 7 and 9 (lecture 12 has the list of the paper's claims).

# %% jupyter={"source_hidden": true}
import json
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import torch
import torch.nn.functional as F
from IPython.display import Markdown
from ipywidgets import FloatSlider, interact
from scipy.spatial.transform import Rotation

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.camera import rigid_transform
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.datasets.samples import (
    real_drive,
    real_weights,
    sample_drive,
    sample_frames,
    sample_image_stage,
    sample_weights,
)

# %% jupyter={"source_hidden": true}
from semgrid_edu.datasets.training_set import Sample
from semgrid_edu.fast import build_net, load_net, track_drive
from semgrid_edu.graphical import d_separated
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.metrics import class_accuracy, confusion_matrix, pixel_accuracy, semantic_cells
from semgrid_edu.networks import Architecture, FusionNet
from semgrid_edu.occupancy import State
from semgrid_edu.pipeline import network_image
from semgrid_edu.planes import plane_heights, plane_pixels
from semgrid_edu.plotting.grids import draw_map
from semgrid_edu.plotting.images import draw_image
from semgrid_edu.training import TrainingParams
from semgrid_edu.training.batches import Batch, grid_logits
from semgrid_edu.fast.allocator import keep_freed_memory
from semgrid_edu.training.loss import class_frequencies, class_weights, median_frequency_weights
from semgrid_edu.workshop.scoring import score_with_interval

# %% jupyter={"source_hidden": true}
from worlds.lecture_00_ledger import ledger, ledger_table
from worlds.lecture_08_late_fusion import car_by_both, late_fusion

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
plt.rcParams["image.interpolation"] = "nearest"  # pixels stay pixels, and classes are not mixed
torch.set_num_threads(1)
keep_freed_memory()  # training is faster when the allocator keeps what is freed
spec, heights, size = GridSpec.compact(), plane_heights(), Architecture.image_size
PALETTE = np.array([*KITTI_14.rgb, *[(255, 255, 255)] * (256 - len(KITTI_14))], np.uint8)
ROAD, SIDEWALK, CAR, FENCE = (KITTI_14.index(name) for name in ("road", "sidewalk", "car", "fence"))

# %% jupyter={"source_hidden": true}


def prepared(drive):
    """Return every frame, image (B, 3, h, w), occupancy (B, 4, H, W) and true class (B, H, W) of a drive."""
    frames = [drive[k] for k in range(len(drive))]
    beliefs = [belief.probability for belief in track_drive(frames, spec)]
    truth = np.stack([grid_truth(f.labels, o, spec) for f, o in zip(frames, beliefs, strict=True)])
    images = torch.from_numpy(np.stack([network_image(frame, size) for frame in frames]))
    return frames, images, torch.from_numpy(np.stack(beliefs)), truth


@torch.inference_mode()
def scores_of(net, images):
    """Return the raw scores of each image, (B, C, h, w)."""
    return torch.cat([net.segmenter(image[None]) for image in images])


@torch.inference_mode()
def grid_of(net, planes, o):
    """Return the class of each cell, (B, H, W), from planes (B, C, D, H, W) and occupancy (B, 4, H, W)."""
    return np.stack([net.fusion(p[None], q[None])[0].argmax(dim=0).numpy() for p, q in zip(planes, o, strict=True)])


# %% jupyter={"source_hidden": true}
def accuracies(grids, truth):
    """Return pixel accuracy and class accuracy over cells whose truth is a semantic class, per cent."""
    counts = semantic_cells(confusion_matrix(truth, grids, n_classes=14), KITTI_14)
    return np.array([100 * pixel_accuracy(counts), 100 * class_accuracy(counts)])


# %% jupyter={"source_hidden": true}
drive = sample_drive()
frames, image, o, truth = (part[::2] for part in prepared(drive))  # ten frames are enough here
counted, semantic, shown = truth != IGNORE, truth < KITTI_14.n_semantic, 5
net, stage_one = (
    load_net(path, drive.camera).requires_grad_(False) for path in (sample_weights(), sample_image_stage())
)
scores = scores_of(net, image)
planes = torch.cat([net.sampler(s[None]) for s in scores])
whole = grid_of(net, planes, o)
few = sample_frames()
pixel_truth = np.stack([resize_labels(frame.labels.image, size) for frame in frames])

# %% [markdown]
# ## Pixels that learn from the map
#
# Take an image network that has learnt labels of pixels (*stage one*), and put a reduction and a fusion with random weights
# behind it.
# It gets one training frame and no further label of a pixel: in 16 steps only the loss *on the map* counts.

# %% jupyter={"source_hidden": true}
lesson = Sample(*map(torch.stack, zip(*few[:1], strict=True)))
batch = Batch(lesson._replace(image=lesson.image / 255), mirrored=False)
learner = load_net(sample_image_stage(), drive.camera)


def shares_right():
    """Return labels of pixels and of cells, (1, h, w) and (1, H, W), and the share of each that is right, per cent."""
    with torch.inference_mode():
        pixels, cells = scores_of(learner, batch.frames.image).argmax(dim=1), grid_logits(learner, batch).argmax(dim=1)
    pairs = (pixels, lesson.labels), (cells, lesson.truth)
    right = [100 * (a == b)[b != IGNORE].float().mean().item() for a, b in pairs]
    return pixels.numpy(), cells.numpy(), right


alpha = class_weights(few[:1], "grid", 14, TrainingParams.weight_limit)
optimiser, story = torch.optim.SGD(learner.parameters(), lr=0.2, momentum=0.9), []
for step in range(17):
    if step % 4 == 0:
        learner.eval()
        story.append((step, *shares_right()))
        learner.train()
    optimiser.zero_grad()
    F.cross_entropy(grid_logits(learner, batch), lesson.truth.long(), weight=alpha, ignore_index=IGNORE).backward()
    optimiser.step()
all_called = np.concatenate([part[0].ravel() for _, pixels, cells, _ in story for part in (pixels, cells)])

# %% jupyter={"source_hidden": true} tags=["nbval-ignore-output"] alt="animation: A, the classes of pixels, which begin as a tidy street of road, sidewalk, car and buildings, and get patches of wrong classes; B, the map, at first nearly all one wrong class, in which road, sidewalk and cars take shape; C, the true map; D, the share of right cells rises from near zero to about 70 per cent while that of pixels falls from about 90 to about 60"


def trained():
    """Yield the figure with labels of pixels and cells after some steps."""
    fig = plt.figure(figsize=(8.2, 4.6), layout="constrained")
    steps, by_pixel, by_cell = zip(*[(step, *right) for step, _, _, right in story], strict=True)
    for now, (step, pixels, cells, _) in enumerate(story):
        fig.clear()
        axes = fig.subplot_mosaic([["A", "B", "C"], ["D", "B", "C"]], width_ratios=(2.3, 1, 1))
        draw_image(PALETTE[pixels[0]], axes["A"])
        plotting.grid_labels(spec, cells[0], KITTI_14, ax=axes["B"], legend=False)
        plotting.grid_labels(spec, lesson.truth[0].numpy(), KITTI_14, ax=axes["C"], legend=False)
        plotting.class_legend(axes["C"], KITTI_14, all_called)
        for name, right in (("cells", by_cell), ("pixels", by_pixel)):
            axes["D"].plot(steps[: now + 1], right[: now + 1], ".-" if name == "cells" else "x--", label=name)
        axes["D"].set(xlim=(-1, 17), ylim=(0, 100), xlabel="step", ylabel="right [%]")
        axes["D"].legend(loc="lower right", fontsize="small")
        names = {"A": f"A: pixels, step {step}", "B": "B: the map", "C": "C: the true map", "D": "D"}
        for letter, ax in axes.items():
            ax.set_title(names[letter], fontsize="medium")
        axes["C"].set_ylabel("")
        yield fig


plotting.animate(trained(), period=0.5, alt="labels of pixels lose their order while the map takes shape")

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
for name, (step, _, _, right) in (("before", story[0]), ("after", story[-1])):
    print(f"{name:<7} step {step:>2}: pixels {right[0]:.0f} % right, cells {right[1]:.0f} % right")
assert story[-1][3][1] > story[0][3][1] + 30
assert story[-1][3][0] < story[0][3][0] - 5

# %% [markdown]
# A: the class with the highest score in each pixel. B: the map. C: its truth. D: the share of each that is right in
# this frame. The map gets better, while the labels of the pixels get *worse*. The gradient of the map's loss
# reaches down to the first convolution of the image network (we check this below). It asks for scores that help the
# map, whatever they say about pixels. This is what the paper's title calls *end to end*. The lecture builds it piece
# by piece.
#
# ### The graph
#
# First, what is there to fuse? Take one cell: $m$ is what is in it, road or car. The pixel that looks at it has a
# label $a$, and the occupancy grid says $o$. Whether something in front, an *occluder*, hides the cell is $hid$. It hides
# it from *both*: then the pixel shows the occluder, mostly a car, and hardly a beam arrives, so $o$ is mostly UNKNOWN.
#
# *Late fusion* lets each sensor decide about the cell and multiplies: $P(m)\,P(a \mid m)\,P(o \mid m)$, normalised
# (*naive Bayes* in statistics).
#
# **Predict before you run.** Beforehand P(car) is 0.2, and half of all cells are hidden. The label of a seen cell is
# right with 0.95; the occluder is a car with 0.9. $o$ is UNKNOWN with 0.1 where the cell is seen, and with 0.95 where it
# is hidden. Now the pixel says car, and $o$ says UNKNOWN. How probable is a car, by late fusion and exactly? And are
# $a$ and $o$ independent given $m$?
#
# <details><summary>Answer</summary>
#
# Exactly: P(both readings given car) is $0.5 \cdot 0.95 \cdot 0.1 + 0.5 \cdot 0.9 \cdot 0.95 = 0.475$, given road $0.5
# \cdot 0.05 \cdot 0.1 + 0.5 \cdot 0.9 \cdot 0.95 = 0.430$. So the odds of 0.25 become 0.276, and P(car) is 0.22:
# UNKNOWN suggests that the cell is hidden, and then the label says next to nothing about it. Late fusion uses the label
# alone, $0.925 : 0.475$, and $o$ alone, which says nothing of $m$: the odds become 0.49, P(car) 0.33. Given $m$ the
# readings are dependent, because $hid$ is a common cause of both; given $m$ and $hid$ they are independent.
#
# </details>

# %% jupyter={"outputs_hidden": true}
stage = late_fusion()
for label, state, text in ((1, 2, "car, UNKNOWN"), (1, 1, "car, occupied"), (0, 0, "road, FREE")):
    print(f"{text:<14} P(car) exactly {{:.2f}}, by late fusion {{:.2f}}".format(*car_by_both(label, state)))
assert not d_separated(stage.model, "a", "o", given=("m",))
assert d_separated(stage.model, "a", "o", given=("m", "hid"))

# %% [markdown]
# Here is the graph. Late fusion cuts the dashed edge, and P(car) changes as written on it:

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a directed graph: what is in the cell, m, and whether it is hidden, hid, both with arrows to the observed label a and the observed occupancy state o; the arrow from hid to o is dashed and carries the price .22 to .33"
fig, ax = plt.subplots(figsize=(5.4, 3), layout="constrained")
stage.draw(ax, highlight=["hid"])
plt.show()

# %% [markdown]
# The network of this lecture gets $a$ and $o$ *together*, so it may learn that they share a cause: it needn't cut the
# dashed edge. A system that multiplies two finished maps cuts it. What that costs on a drive we measure below.
#
# ## Which plane is right? The 1x1 reduction
#
# Lecture 06 leaves 14 scores on 20 planes above each cell, 280 numbers. Which should the map believe? A car stands
# 8 m ahead on an empty road, 4 m long and 1.4 m high. The camera looks over it from 1.65 m. Take a cell in front of the
# car (centre 6 m ahead), one in it (10 m) and one behind it (14 m), and above each two points, on the ground and at
# 1.4 m.
#
# **Predict before you run.** Draw the six rays from the side. Which of the six points does the camera call *car*?
#
# <details><summary>Answer</summary>
#
# On the ground: road, car, car, because the ray to the third point ends at the car. At 1.4 m: car, car, road, because
# the ray over the first cell goes on until it meets the car, and the ray to the third passes above the roof. Each
# plane alone draws the car two cells long, on different sides. Both agree only where the car is.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="side view: six rays from the camera through points above cells a, b and c; on the ground a is road, b and c are car; at 1.4 m a and b are car and c is road"
camera_height, near, far, roof = 1.65, 8.0, 12.0, 1.4


def where_ray_ends(x, z):
    """Follow the ray from the camera through the point (x, z) to the car or the road: class, and place it meets."""
    slope = (z - camera_height) / x
    if camera_height + slope * near <= roof:
        return ("road", x, z) if x < near and z == 0 else ("car", near, camera_height + slope * near)
    on_roof = (roof - camera_height) / slope
    return ("car", on_roof, roof) if on_roof <= far else ("road", -camera_height / slope, 0.0)


fig, ax = plt.subplots(figsize=(8.2, 2.6), layout="constrained")
ax.fill([near, far, far, near], [0, 0, roof, roof], color=np.divide(KITTI_14.rgb[CAR], 255), alpha=0.35)
for x, name in zip((6, 10, 14), "abc", strict=True):
    ax.text(x, -0.35, f"cell {name}", ha="center")
    for z in (0.0, 1.4):
        called, x_end, z_end = where_ray_ends(x, z)
        colour = np.divide(KITTI_14.rgb[KITTI_14.index(called)], 255)
        ax.plot([0, x_end], [camera_height, z_end], color=colour, linewidth=0.8)
        ax.plot(x, z, "o" if called == "car" else "s", color=colour, markersize=9, markeredgecolor="white", zorder=3)
ax.plot(0, camera_height, "k>", markersize=9)
ax.hlines([0, 1.4], 0, 20, color="0.6", linestyle=":", zorder=0)
ax.set(xlim=(-0.5, 18), ylim=(-0.5, 2), xlabel="x, forward [m]", ylabel="z, up [m]", title="triangle: the camera")
plt.show()

# %% [markdown]
# Squares: the ray meets road; circles: it meets the car. Write their scores down, 2 for "looks like it", 0 for
# "doesn't", and choose two sums of these numbers by hand. *Road*: believe the ground plane. *Car*: both planes' car,
# less 3.
#
# | | cell a | cell b | cell c | weight for *road* | weight for *car* |
# |---|---|---|---|---|---|
# | road, ground | 2 | 0 | 0 | 1 | 0 |
# | road, 1.4 m | 0 | 0 | 2 | 0 | 0 |
# | car, ground | 0 | 2 | 2 | 0 | 1 |
# | car, 1.4 m | 2 | 2 | 0 | 0 | 1 |
#
# *Road* is (2, 0, 0) and *car* (2 - 3, 4 - 3, 2 - 3) = (-1, 1, -1): positive only where both planes agree. With
# $p_{c,d,j}$ the score of class $c$ on plane $d$ in cell $j$, weights $\theta$ and biases $\beta$, the reduced map
# number $k$ is (section 3.4, figure 4)
#
# $$ \tilde p_{k,j} = \beta_k + \sum_{c=1}^C \sum_{d=1}^D \theta_{k,c,d}\; p_{c,d,j} $$
#
# The weights are the same in every cell, and no cell looks at its neighbour: that is what *1x1* means. With the pairs
# $(c, d)$ in one column it is a product of two matrices.


# %% tags=["reduction"]
def reduce(p, theta, beta):
    """Reduce planes (C, D, cells) to (K, cells), literally: each sum by itself."""
    left = np.zeros((len(theta), p.shape[2]))
    for k, j in np.ndindex(left.shape):
        left[k, j] = beta[k]
        for c, d in np.ndindex(p.shape[:2]):
            left[k, j] += theta[k, c, d] * p[c, d, j]
    return left


p = np.array([[[2, 0, 0], [0, 0, 2]], [[0, 2, 2], [2, 2, 0]]], dtype=np.float32)  # (C, D, cells)
theta = np.array([[[1, 0], [0, 0]], [[0, 0], [1, 1]]], dtype=np.float32)  # (K, C, D)
beta = np.array([0, -3], dtype=np.float32)
toy = FusionNet(n_scores=2, n_planes=2, n_classes=2, n_reduced=2)
convolution = toy.reduce[0]  # its kernel is D x 1 x 1
convolution.load_state_dict({"weight": torch.from_numpy(theta)[..., None, None], "bias": torch.from_numpy(beta)})
with torch.inference_mode():
    package = convolution(torch.from_numpy(p)[None, ..., None])[0, :, 0, :, 0]
np.testing.assert_allclose(reduce(p, theta, beta), package)
np.testing.assert_allclose(reduce(p, theta, beta), theta.reshape(2, 4) @ p.reshape(4, 3) + beta[:, None])
print("road", reduce(p, theta, beta)[0], "  car", reduce(p, theta, beta)[1])

# %% [markdown]
# Then come batch normalisation ([what trained networks do](deeper/07_trained_networks.ipynb) has it by hand) and a ReLU,
# which cuts the -1 off. The network isn't told these weights; it learns them,
# and may find others. Its reduction leaves 16 maps, with $16 \cdot 280 + 16 = 4496$ weights.
#
# One detail matters later. A point of a plane that the camera doesn't see takes the score 0 for every class. So on
# planes zero has a meaning: "the camera doesn't see this". Under a soft-max the same number may be added to all scores of a pixel
# and nothing changes. Here the map changes: lecture 07 counted it on one frame, here are ten. (*Semantic cells* are
# those in which a class like road or car is true, and not one of the four *unknown* ones.)

# %% tags=["nbval-ignore-output"]
print(f"weights of the reduction: {sum(part.numel() for part in net.fusion.reduce[0].parameters()):,}")
for added in (1, 5, -5):
    shifted = grid_of(net, (net.sampler(s[None] + added)[0] for s in scores), o)
    pixel, by_class = accuracies(shifted, truth)
    changed = 100 * (shifted != whole).mean()
    print(
        f"all scores {added:+d}: {changed:2.0f} % of cells change; semantic cells {pixel:.0f} %, class {by_class:.0f} %"
    )
pixel, by_class = accuracies(whole, truth)
print(f"as they are: semantic cells {pixel:.0f} % right, class accuracy {by_class:.0f} %")

# %% jupyter={"source_hidden": true} alt="four of the sixteen reduced maps in grey: rays fan out from the vehicle along what stands; in three of them the corners out of view are grey or white"
with torch.inference_mode():
    reduced = net.fusion.reduce(planes[shown, None])[0, :, 0]
fig, axes = plt.subplots(1, 4, figsize=(8.2, 3.9), sharex=True, sharey=True, layout="compressed")
for k, ax in zip((0, 4, 8, 12), axes, strict=True):
    brightest = float(reduced[k].quantile(0.98))
    draw_map(spec, reduced[k] / brightest, ax, cmap="gray", vmin=0, vmax=1).set_title(f"map {k}", fontsize="medium")
    ax.set(xlabel="", ylabel="")
fig.colorbar(axes[-1].images[0], ax=axes, label="value / 98 % quantile of its map", extend="max", shrink=0.6)
fig.supxlabel("y, to the left [m]", fontsize="medium")
axes[0].set_ylabel("x, forward [m]")
plt.show()

# %% [markdown]
# So zero has a meaning: 1 more changes 7 % of the cells, and even helps a little here; 5 less costs nearly half of what
# was right. The picture shows four of the 16 maps in one frame, bright for large. What stands is smeared away from the
# camera, and a single cell can't tell how far away it is. Maps 4, 8 and 12 also light up in the corners: there nobody
# looked. Whether the reduction costs accuracy and saves time (claim 8) is measured in lecture [12](12_experiments.ipynb).
#
# ## Where it stands: $o$ joins
#
# Four cells, seen along and beside the ray to the car:
#
# | cell | the ground plane says | $o$ says | truth |
# |---|---|---|---|
# | in front of the car | road | FREE | road |
# | the car's rear | car | STATIC | car |
# | in the car's shadow | car | UNKNOWN | unobserved |
# | beside the road | sidewalk | FREE | sidewalk |
#
# The image can't tell the second row from the third, and $o$ can't tell the first from the fourth. Together the four
# differ. So the network puts the four maps of $o$ on top of the 16, $[\tilde p; o]$, and everything after that sees
# both:


# %% tags=["fusion"]
def fuse(planes, o, fusion):
    """Return the logits of a batch: reduce, put o on top, and let a conv-deconv network look at both."""
    left = fusion.reduce(planes)  # 1x1 convolution, batch normalisation, ReLU
    return fusion.conv_deconv(torch.cat([left[:, :, 0], o], dim=1))


with torch.inference_mode():
    np.testing.assert_allclose(fuse(planes[:1], o[:1], net.fusion), net.fusion(planes[:1], o[:1]), atol=1e-4)

# %% [markdown]
# (The *logits* are its 14 scores per cell before the soft-max.) Four cells chosen by hand prove little. On the drive we
# can count. Take the *true* label of the pixel that the ground plane reads, and the most probable state of $o$. Make a
# table of 14 classes and "out of view" times four states, with the most frequent true class in each of its 60 entries.
# It has no neighbours, no other planes and nothing to learn but counts. This is the number to beat.
#
# **Predict before you run.** How many cells does such a table get right, fitted on this very drive: with the label
# alone, with $o$ alone, with both? And if late fusion multiplies the two instead?
#
# <details><summary>Answer</summary>
#
# Of all cells 52 % with the label, 56 % with $o$, 74 % with both; the network 80 %. Late fusion: 73 %, less than a
# point below. So on this drive cutting the dashed edge costs little, although in the toy P(car) became 0.33 instead of 0.22.
# What else the table leaves out costs much more: on semantic cells it stays at 50 %, and the network reaches 73 %.
#
# </details>


# %% jupyter={"outputs_hidden": true}
def fit_table(label, state, is_class):
    """Count the classes for each pair of a label and a state, (256, 4, 14)."""
    counts = np.zeros((IGNORE + 1, 4, 14))
    np.add.at(counts, (label, state, is_class), 1)
    return counts


def late(counts, label, state):
    """Return P(m) P(a | m) P(o | m) of each cell, not normalised: late fusion with what the table has counted."""
    n = counts.sum(axis=(0, 1))
    each = np.maximum(n, 1)
    return n * (counts.sum(axis=1) / each)[label] * (counts.sum(axis=0) / each)[state]


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
def read_on_ground(labels, camera):
    """Return the label (B, H, W) that the ground plane reads in each cell; 255 out of view."""
    (ground,), (visible,) = plane_pixels(spec, heights[:1], camera)
    u, v = np.rint(np.where(visible[..., None], ground, 0)).astype(int).transpose(2, 0, 1)
    return np.stack([np.where(visible, one[v, u], IGNORE) for one in labels])


def compare(label, state, truth, network, counts):
    """Return a row for each way to name cells: right of all cells, right of semantic ones, class accuracy, per cent."""
    answers = {
        "pixel's label alone": counts.sum(axis=1).argmax(axis=1)[label],
        "$o$ alone": counts.sum(axis=0).argmax(axis=1)[state],
        "late fusion": late(counts, label, state).argmax(axis=1),
        "table of both": counts.argmax(axis=2)[label, state],
        "the network": network,
    }
    return {name: [100 * (got == truth).mean(), *accuracies(got, truth)] for name, got in answers.items()}


def as_table(rows):
    """Return rows of three numbers as a Markdown table."""
    lines = ["| | all cells | semantic cells | class accuracy |", "|---|---|---|---|"]
    return "\n".join(lines + [f"| {name} | {a:.0f} | {b:.0f} | {c:.0f} |" for name, (a, b, c) in rows.items()])


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
state = o.numpy().argmax(axis=1)
label = read_on_ground([frame.labels.image for frame in frames], drive.camera)
columns = label[counted], state[counted], truth[counted].astype(int)
drive_rows = compare(*columns, whole[counted], fit_table(*columns))
few_truth = np.stack([sample.truth.numpy() for sample in few])
few_state = np.stack([sample.occupancy.numpy() for sample in few]).argmax(axis=1)
seen_images = torch.stack([sample.image for sample in few]) / 255, image
few_label, its_label = (
    read_on_ground(scores_of(stage_one, images).argmax(dim=1).numpy(), drive.camera.resized(size))
    for images in seen_images
)
from_few = fit_table(few_label[few_truth != IGNORE], few_state[few_truth != IGNORE], few_truth[few_truth != IGNORE])
honest = {"late fusion": late(from_few, its_label, state).argmax(axis=-1)}
honest["table"] = from_few.argmax(axis=2)[its_label, state]
for name, got in honest.items():
    right = [100 * (got == truth)[counted].mean(), *accuracies(got, truth)]
    drive_rows[f"{name} from six training frames, labels by stage one"] = right
assert 0 < drive_rows["table of both"][0] - drive_rows["late fusion"][0] < 1
assert drive_rows["the network"][0] > drive_rows["table of both"][0] + 4
assert np.abs(np.subtract(*list(drive_rows.values())[-2:])).max() < 0.5
Markdown(as_table(drive_rows))

# %% [markdown]
# The last two rows could really be used: they need no true label of a pixel of this drive, and were counted on other frames. They differ by less
# than half a point in each column. (The *table of both* is the best one over all cells of this drive. Over semantic
# cells another can be better, and the one from the training frames is.)
#
# Two cautions. The truth of the *unknown* classes is defined by $o$ (lecture 09), so over all cells a table that knows
# $o$ starts with a gift; that is why the second column counts semantic cells alone. And by class accuracy late
# fusion is the *better* of the two: which way wins depends on what is counted.
#
# The same in bits: how much of the class is still open (*conditional entropy*), and how much do label and state share
# once the class is known (*conditional mutual information*, $I(a; o \mid m)$)? Late fusion assumes that this is zero.


# %%
def bits(*columns):
    """Return the entropy of what stands in columns of whole numbers, side by side, bits."""
    counts = np.unique(np.stack(columns), axis=1, return_counts=True)[1]
    return -(counts / counts.sum() * np.log2(counts / counts.sum())).sum()


def shared(a, o, m):
    """Return I(a; o | m), bits."""
    return bits(a, m) + bits(o, m) - bits(m) - bits(a, o, m)


a, b, m = columns
by_label, by_state, by_both = (bits(m, *known) - bits(*known) for known in ((a,), (b,), (a, b)))
print(f"class: {bits(m):.2f} bits; open with label {by_label:.2f}, with o {by_state:.2f}, with both {by_both:.2f}")
print(f"label and state share {shared(a, b, m):.2f} bits once the class is known")

# %% [markdown]
# The pair leaves a whole bit open. The pixel on the ground plane often shows what stands *in front of* the cell (lecture
# 05). The paper's network gets more: all planes, and the neighbours.
#
# Does the trained network use both? Give it, in place of $o$, the mean of $o$ over all cells, the same everywhere; then
# do the same with the planes.
#
# **Predict before you run.** Which of road, sidewalk, car and building suffers most when $o$ is silent? Which when the
# image is?
#
# <details><summary>Answer</summary>
#
# Without $o$ hardly any cell of cars and buildings is found, and sidewalk falls from 57 to 19 %. Without the image
# buildings lose most, from 85 to 17 %. The sidewalk loses less, from 57 to 40 %. It is FREE like the road, so the $o$
# of a single cell can't tell them apart (claim 7); what still finds it is probably the $o$ of the cells around it.
#
# </details>


# %% jupyter={"source_hidden": true}
def silent(maps, where):
    """Return, in place of maps (B, ..., H, W), the mean of each over the cells that count, the same in all of them."""
    total = (maps * where).sum(dim=(0, -2, -1), keepdim=True)
    return total / where.sum(dim=(0, -2, -1), keepdim=True).clamp(min=1) * where


def found(grids, truth):
    """Return the share of each class's true cells that are called so, per cent; NaN where there are none."""
    counts = confusion_matrix(truth, grids, n_classes=14)
    return 100 * np.diag(counts) / np.where(counts.any(axis=1), counts.sum(axis=1), np.nan)


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="bars by class: with o silent buildings, cars, bicycles, fences, signage and pedestrians fall to nothing, sidewalk falls to a third, and vegetation is found a little more often; with the image silent buildings and vegetation lose most, sidewalk a third, road little, and signage is found more often"
seen = (planes != 0).any(dim=1, keepdim=True)  # (B, 1, D, H, W): which points of the planes the camera sees
grids = {
    "image and o": whole,
    "o silent": grid_of(net, planes, silent(o, torch.ones(10, 1, *spec.shape))),
    "image silent": grid_of(net, silent(planes, seen), o),
}
shares = {name: found(grid, truth) for name, grid in grids.items()}
fig, ax = plt.subplots(figsize=(8.2, 3.2), layout="constrained")
present = np.flatnonzero(np.isfinite(shares["image and o"]))
styles = (("0.2", ""), ("#fc7200", "//"), ("#1e6ee6", ".."))
for (name, share), offset, (colour, hatch) in zip(shares.items(), (-0.27, 0, 0.27), styles, strict=True):
    ax.bar(np.arange(len(present)) + offset, share[present], 0.27, label=name, color=colour, hatch=hatch, ec="white")
ax.set_xticks(range(len(present)), [KITTI_14.names[c] for c in present], rotation=30, ha="right")
ax.set(ylabel="true cells called so [%]", ylim=(0, 100))
ax.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1))
plt.show()

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true, "outputs_hidden": true}
for name, grid in grids.items():
    numbers = " ".join(
        f"{KITTI_14.names[c]} {shares[name][c]:.0f}" for c in (ROAD, SIDEWALK, CAR, KITTI_14.index("building"))
    )
    print(
        "{:<13} semantic cells {:.0f} %, class accuracy {:.0f} %; found:".format(name, *accuracies(grid, truth)),
        numbers,
    )
building = KITTI_14.index("building")
assert max(shares["o silent"][[CAR, building]]) < 5
assert shares["image silent"][building] < 0.5 * shares["image and o"][building]
assert shares["image silent"][SIDEWALK] < 0.8 * shares["image and o"][SIDEWALK]

# %% [markdown]
# One caution: this network has never learnt with a silent input. For one that is *trained* without $o$ see the
# real street below.
#
# ## One cell sees little: the conv-deconv network
#
# After the reduction comes a network like lecture 07's SegNet, with skips (figure 5): 3x3 convolutions, three
# poolings, and back up. It brings in the neighbours: a shadow has something at its near end. On the way down it has
# one convolution at full size, one after a pooling, two after the next, and as many on the way up. So it sees
# $1 + 2 + 4 + 4 = 11$ cells to each side on the way down, 11 more on the way up, and with the windows of pooling at
# most 36 cells, 18 m. How far does it really listen? Differentiate the winning score of one cell with respect to $o$
# in every other:

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="a map of how strongly the score of one cell depends on the occupancy of others: strongest in the cell itself, about a hundred times weaker 5 m away, and nothing beyond about 11 m"
row, col = 100, 31  # 20.75 m ahead, in the middle
o_one = o[shown, None].clone().requires_grad_()
logits = net.fusion(planes[shown, None], o_one)
(by_o,) = torch.autograd.grad(logits[0, whole[shown, row, col], row, col], o_one)
strength = by_o[0].abs().sum(dim=0).numpy()
apart = np.abs(np.argwhere(strength > 0) - [row, col]).max(axis=1)
assert 22 <= apart.max() <= 36
ax = plotting.grid_values(
    spec, np.log10(strength / strength.max() + 1e-9), "|gradient| relative to the largest (log10)", vmin=-4
)
ax.plot(*spec.centers()[row, col, ::-1], "c+", markersize=10)
ax.set_ylim(0, 45)
plt.show()
near_by = strength[row - 4 : row + 5, col - 4 : col + 5].sum() / strength.sum()
print(f"reaches {apart.max()} cells; within 2 m lies {100 * near_by:.0f} % of it")

# %% [markdown]
# The cross is the cell that is asked about. A change of its own occupancy counts most, and of a cell 5 m away about a
# hundred times less. But there are many such cells: more than half of the sum lies beyond 2 m.
#
# ## What the loss balances
#
# A soft-max makes probabilities $g_{c,j}$ of the logits, and the loss looks at one number per cell, the probability of
# the true class. But two fifths of a map are unobserved, and pedestrians are two cells in a thousand: a network that
# says "unobserved" everywhere is right in two cells of five. Two toy maps of nine cells: `R` road, `S` sidewalk, `C`
# car, `-` unlabelled.
#
# ```
#  map 1   R R R R S S S S -          map 2   R R R R R R C C -
# ```
#
# The paper weights each class by its frequency, counted only in the maps *in which it occurs* (*median frequency
# balancing*):
#
# $$ f(c) = \frac{\text{cells of } c}{\text{labelled cells of the maps in which } c \text{ occurs}}, \qquad
#    \alpha_c = \frac{\operatorname{median}_{c'} f(c')}{f(c)} $$
#
# By hand: road 10 of 16, sidewalk 4 of 8, car 2 of 8 (map 1 has no car). The median of 5/8, 1/2 and 1/4 is 1/2, so the
# weights are 0.8, 1 and 2. The loss is a weighted mean over labelled cells, with $c(j)$ the true class of cell $j$:
#
# $$ \text{loss} = -\frac{\sum_j \alpha_{c(j)} \log g_{c(j),j}}{\sum_j \alpha_{c(j)}} $$
#
# A road to which the network gives 1/2, a car to which it gives 1/4 and an unlabelled cell: $(0.8 \log 2 + 2 \log 4) /
# 2.8 = 1.188$. The car counts two and a half times as much as the road, the unlabelled cell not at all.


# %% tags=["median-frequency"]
def frequencies(maps, n_classes):
    """f(c), literally: one class, one map at a time."""
    f = []
    for c in range(n_classes):
        where_it_occurs = [m for m in maps if c in m]
        cells = sum((m == c).sum() for m in where_it_occurs)
        f.append(cells / sum((m != IGNORE).sum() for m in where_it_occurs))
    return np.array(f)


R, S, C, unlabelled = 0, 1, 2, IGNORE
maps = np.array([[R, R, R, R, S, S, S, S, unlabelled], [R, R, R, R, R, R, C, C, unlabelled]])
f = frequencies(maps, n_classes=3)
alpha = np.median(f) / f
np.testing.assert_allclose(f, class_frequencies(maps, n_classes=3))
np.testing.assert_allclose(alpha, median_frequency_weights(maps, n_classes=3))
print("f", f, "  alpha", alpha)


# %% tags=["loss"]
def cross_entropy(g, true, alpha):
    """Return the loss of one map: g (C, cells), true classes (cells,)."""
    above = below = 0.0
    for j, c in enumerate(true):
        if c != IGNORE:
            above -= alpha[c] * np.log(g[c, j])
            below += alpha[c]
    return above / below


g = np.array([[1 / 2, 1 / 2, 1 / 3], [1 / 4, 1 / 4, 1 / 3], [1 / 4, 1 / 4, 1 / 3]])  # one column per cell
true = np.array([R, C, unlabelled])
toy_logits, toy_truth = torch.from_numpy(np.log(g))[None], torch.from_numpy(true)[None]
package = F.cross_entropy(toy_logits, toy_truth, weight=torch.from_numpy(alpha), ignore_index=IGNORE)
np.testing.assert_allclose(cross_entropy(g, true, alpha), package)
print(f"weighted {cross_entropy(g, true, alpha):.3f}   unweighted {cross_entropy(g, true, np.ones(3)):.3f}")

# %% [markdown]
# **Predict before you run.** Six labelled frames of the training set. A class that occurs in every frame has $n_c$
# cells and the weight $\alpha_c$. How large is its share of all weight, compared with another such class? And what does
# one cell of a class with 25 cells weigh, compared with an unobserved one?
#
# <details><summary>Answer</summary>
#
# The shares are equal: $f(c)$ is $n_c$ over all cells, so $\alpha_c n_c$ doesn't depend on $n_c$. Then 25 cells have as
# much weight as 19,585: one of them weighs as much as 783 unobserved ones, and 25 cells have 8 % of the weight.
# So the package keeps weights between 1/4 and 4 (`weight_limit`; the paper has no limit), and
# most of the balance goes: with it the three largest classes keep 54 % of the weight, pedestrians have 2.8 %, signage
# 1.4 %, and those 25 cells 0.6 %.
#
# </details>

# %% jupyter={"outputs_hidden": true}
training = [sample.truth.numpy() for sample in few]
cells = np.bincount(np.concatenate(training, axis=None), minlength=14)[:14]
weights = {"no weights": np.ones(14), "balanced": median_frequency_weights(training, 14)}
weights["limit 4, as in training"] = median_frequency_weights(training, 14, TrainingParams.weight_limit)
kept = {name: 100 * alpha * cells / (alpha * cells).sum() for name, alpha in weights.items()}
dynamic, unobserved = KITTI_14.index("unknown-dynamic"), KITTI_14.index("unknown-unobserved")
print("one unknown-dynamic cell weighs as", f"{cells[unobserved] / cells[dynamic]:.0f}", "unobserved ones, balanced")
for name, share in kept.items():
    rare = {KITTI_14.names[c]: f"{share[c]:.1f}" for c in (*map(KITTI_14.index, ("pedestrian", "signage")), dynamic)}
    print(f"{name}: three largest classes {share[np.argsort(cells)[-3:]].sum():.0f} %, of the rest", rare)
assert cells[dynamic] == 25

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three bar charts of each class's share of the weight: without weights unobserved, road and unknown-free have 71 per cent; balanced nearly all classes have 8 per cent; with the limit of 4 the large classes have most again"
occurs = cells > 0
fig, axes = plt.subplots(1, 3, figsize=(8.2, 3.6), sharey=True, layout="constrained")
names = [f"{KITTI_14.names[c]} ({cells[c]})" for c in np.flatnonzero(occurs)]
for ax, (name, alpha) in zip(axes, weights.items(), strict=True):
    share = kept[name][occurs]
    ax.barh(names, share, color=np.divide(KITTI_14.rgb, 255)[occurs], edgecolor="0.4", linewidth=0.5)
    for place, weight in enumerate(alpha[occurs]):
        ax.text(share[place] + 0.7, place, f"{weight:.2f}", va="center", fontsize=8)
    ax.set(xlabel="share of the weight [%]", xlim=(0, 50), title=name)
axes[0].invert_yaxis()
plt.show()

# %% [markdown]
# Behind each name stands the number of its cells, behind each bar the weight $\alpha_c$. What training uses, on the
# right, lies nearer to the left than to the middle. Bicycles and fences have less than the others in the middle,
# because they are missing in some frames.
#
# How steps are made of this loss, with momentum and a falling rate, and what happens along 2000 of them, is the
# companion [training](deeper/08_training.ipynb).
#
# ## The way of the gradient: end to end
#
# Back to the toy of the reduction. Say the map *car* should have been smaller in cell c: the derivative of the loss
# with respect to it is 1, and nothing else is wrong.
#
# **Predict before you run.** Which of the twelve scores receive a gradient? At which pixels does it arrive?
#
# <details><summary>Answer</summary>
#
# Car on the ground and car at 1.4 m above cell c, each times its weight 1. From there it goes to the pixels that these
# points read: the first to the car's rear, the second just above its roof. The loss doesn't know which was at fault.
#
# </details>
#
# As in lecture 06 a bar stands for the derivative of the loss. The gradient goes back through the reduction by the
# transposed weights, through equation (2) by the adjoint of sampling, $A^T$, and on by the chain rule of the image
# network (*backpropagation*):
#
# $$ \bar p_{c,d,j} = \sum_k \theta_{k,c,d}\; \bar{\tilde p}_{k,j}, \qquad \bar s = A^T \bar p $$


# %% jupyter={"outputs_hidden": true}
def back_to_planes(theta, from_maps):
    """Return the derivative with respect to scores (C, D, cells), from that with respect to reduced maps (K, cells)."""
    p_bar = np.zeros((*theta.shape[1:], from_maps.shape[1]))
    for k, c, d in np.ndindex(theta.shape):
        p_bar[c, d] += theta[k, c, d] * from_maps[k]
    return p_bar


from_maps = np.array([[0, 0, 0], [0, 0, 1]], dtype=np.float32)  # road, car
leaf = torch.from_numpy(p)[None, ..., None].requires_grad_()
(package,) = torch.autograd.grad(convolution(leaf), leaf, torch.from_numpy(from_maps)[None, :, None, :, None])
np.testing.assert_allclose(back_to_planes(theta, from_maps), package[0, ..., 0])
print("car: ground", package[0, 1, 0, :, 0].numpy(), " 1.4 m", package[0, 1, 1, :, 0].numpy())

# %% [markdown]
# Does the gradient really get from the grid to the first convolution of the image network? Take a small net in float64,
# 8 x 8 cells and three planes, nudge one weight of that convolution up and down, and compare:

# %%
small_grid = GridSpec(x_min=4, x_max=12, y_min=-4, y_max=4, cell=1)
architecture = Architecture(image_size=(16, 48), grid=small_grid, heights=(0.0, 0.6, 1.2))
small, rng = build_net(architecture, drive.camera).double().eval(), np.random.default_rng(0)
small_image, small_o = (torch.from_numpy(rng.random((1, *shape))) for shape in ((3, 16, 48), (4, 8, 8)))
small_truth = torch.from_numpy(rng.integers(0, 14, (1, 8, 8)))
first_convolution = next(small.segmenter.parameters())


def nudged(place, by):
    """Return the small net's loss with one weight of its first convolution changed."""
    with torch.no_grad():
        first_convolution[place] += by
        loss = F.cross_entropy(small(small_image, small_o), small_truth).item()
        first_convolution[place] -= by
    return loss


(gradient,) = torch.autograd.grad(F.cross_entropy(small(small_image, small_o), small_truth), first_convolution)
for place in ((0, 0, 1, 1), (5, 1, 0, 2)):
    by_nudging = (nudged(place, 1e-6) - nudged(place, -1e-6)) / 2e-6
    np.testing.assert_allclose(by_nudging, gradient[place], rtol=1e-4)
    print(f"weight {place}: {gradient[place]:+.1e} by the chain rule, {by_nudging:+.1e} by nudging")

# %% [markdown]
# Not zero, and right. Now one wrong cell on the drive: of those that a car stands in, 18 to 35 m ahead, the one with
# the highest cost. **Predict before you run.** Which pixels get its gradient: only the car's, or only one?
#
# <details><summary>Answer</summary>
#
# Neither. The cell's 20 points lie above each other, so their pixels lie on a vertical line in the image, from the foot
# to 3.8 m up: on the car and on the trees behind it. Neighbouring cells pass gradient on to lines of their own, so that
# nearly half of all pixels get some.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, the image with a vertical line of points from the ground to 3.8 m, over a silver car and the trees behind it; right, the size of the gradient in the same piece: bright along that line and along neighbouring vertical lines between the same heights, fainter towards the sides"
x = spec.centers()[..., 0]
with torch.inference_mode():
    logits = net.fusion(planes[shown, None], o[shown, None])
costs = F.cross_entropy(logits, torch.from_numpy(truth[shown, None]).long(), reduction="none")[0].numpy()
costs[(truth[shown] != CAR) | (x < 18) | (x > 35)] = 0
row, col = np.unravel_index(costs.argmax(), spec.shape)
leaf = scores[shown, None].clone().requires_grad_()
cost = F.cross_entropy(net.fusion(net.sampler(leaf), o[shown, None])[:, :, row, col], torch.tensor([CAR]))
(s_bar,) = torch.autograd.grad(cost, leaf)
line = plane_pixels(spec, heights, drive.camera.resized(size))[0][:, row, col]
fig, axes = plt.subplots(1, 2, figsize=(8.2, 3.2), layout="constrained")
draw_image(resize_image(frames[shown].image, size), axes[0])
strength = s_bar[0].abs().sum(dim=0).numpy()
draw_image((strength / strength.max()) ** 0.5, axes[1], cmap="magma", vmin=0, vmax=1)
fig.colorbar(axes[1].images[0], ax=axes[1], label="square root of |gradient| / largest", shrink=0.8)
for ax, colour in zip(axes, ("#fc7200", "white"), strict=True):
    ax.plot(*line.T, "-", color=colour, linewidth=0.8)
    for d in (0, 5, 10, 15):
        ax.plot(*line[d], "_", color=colour, markersize=9)
        ax.annotate(f"{heights[d]:.0f} m", line[d], (6, 0), textcoords="offset points", color=colour, va="center")
    ax.set_xlim(max(line[0, 0] - 70, -0.5), line[0, 0] + 70)
axes[0].set_title("A: the points above the cell", fontsize="medium")
axes[1].set_title("B: size of the gradient", fontsize="medium")
plt.show()

# %% jupyter={"outputs_hidden": true, "source_hidden": true}
print(f"{x[row, col]:.1f} m ahead, truth car, called {KITTI_14.names[whole[shown, row, col]]}")
for name in ("vegetation", "car"):
    share = strength[pixel_truth[shown] == KITTI_14.index(name)].sum() / strength.sum()
    print(f"of the gradient {share:.0%} arrives at {name}", end=", ")
print(f"{(strength > 0).mean():.0%} of the pixels get some")

# %% [markdown]
# A step of training changes the scores *there*, at all heights, although nobody has said what these pixels show. More of
# this gradient arrives at vegetation than at cars. That is behind the animation, and behind what 2000 steps did to the
# shipped network:

# %% jupyter={"source_hidden": true} alt="A, the true classes of a street's pixels; B, after the first stage the large parts are right, with ragged borders and without thin posts; C, after training end to end: road, sidewalk and cars are still recognised, and in place of the fence there are patches of building, car and pedestrian"
before, after = (scores_of(each, image).argmax(dim=1).numpy() for each in (stage_one, net))
fig, axes = plt.subplots(3, 1, figsize=(6.4, 6.7), layout="constrained")
for ax, (name, shown_labels) in zip(
    axes,
    {"A: truth": pixel_truth, "B: after stage one": before, "C: after training end to end": after}.items(),
    strict=True,
):
    draw_image(PALETTE[shown_labels[shown]], ax)
    ax.set_title(name, fontsize="medium")
all_shown = np.stack([labels[shown] for labels in (pixel_truth, before, after)])
plotting.class_legend(axes[-1], KITTI_14, all_shown, loc="upper center", bbox_to_anchor=(0.5, 0), ncols=5)
plt.show()

# %%
known = pixel_truth != IGNORE
for name, labels in (("stage one", before), ("end to end", after)):
    by_class = {KITTI_14.names[c]: round(100 * (labels == c)[pixel_truth == c].mean()) for c in (ROAD, CAR, FENCE)}
    print(f"{name:<11} {100 * (labels == pixel_truth)[known].mean():.0f} % of pixels right;", by_class)
found_less = [(before == c)[pixel_truth == c].mean() - (after == c)[pixel_truth == c].mean() for c in range(10)]
assert np.argmax(found_less) == FENCE
taken = np.bincount(after[pixel_truth == FENCE], minlength=14)
print(
    f"pixels of fences are most often called {KITTI_14.names[taken.argmax()]} now, {100 * taken.max() / taken.sum():.0f} %"
)

# %% [markdown]
# End-to-end training rewards only a good map, and nothing holds the scores to the labels of pixels. As such they get
# worse, from 80 % to 67 % on this drive. The fence loses most.
#
# ## End to end, or in two stages?
#
# The authors' earlier system trained the image network first, and then kept its weights fixed (*frozen*). What does the
# way back buy? Networks of both kinds with the same first stage and the same batches, three seeds, judged on 110 frames:
# end to end minus two stages, in points, with 95 % intervals:

# %% jupyter={"source_hidden": true}
claims = json.loads(Path("../docs/results/reduced/claims.json").read_text(encoding="utf-8"))["claims"]
by_lidar, by_true = ([one["value"] for one in reading["statements"]] for reading in claims["10"]["readings"])
table = "| end to end - two stages | by LIDAR labels | by true labels |\n|---|---|---|\n"
for metric, *pair in zip(("pixel accuracy", "class accuracy", "FmIoU"), by_lidar, by_true, strict=True):
    cells = ("{:+.1f} ({:+.1f} to {:+.1f})".format(*(100 * v[k] for k in ("mean", "low", "high"))) for v in pair)
    table += f"| {metric} | {' | '.join(cells)} |\n"
assert by_true[0]["high"] < 0
assert all(value["low"] < 0 < value["high"] for value in by_lidar + by_true[1:])
Markdown(table)

# %% [markdown]
# Five of the six intervals contain zero. The sixth lies just below it: by true labels half a point fewer cells are right
# end to end. So on these streets the way back brings nothing that we can see, and on the drive above fewer pixels were
# right after it. Our stage one is strong: it learns
# true labels of every pixel of the same images. The paper starts from ImageNet weights; what end to end would buy after
# such a start these runs don't say. Lecture [12](12_experiments.ipynb) judges this claim of the paper.
#
# ## A real street
#
# What is $o$ worth? On simulated streets, by *true* labels, networks trained with and without $o$ were compared. So
# were networks on a real street (PandaSet), by labels that people gave to LIDAR returns:

# %% jupyter={"source_hidden": true}
results = Path("../docs/results")
variants = json.loads((results / "reduced/ablations.json").read_text(encoding="utf-8"))["variants"]
simulated = {v["what"]: v["scores"]["true"]["semantic"] for v in variants}
real_streets = json.loads((results / "real_streets.json").read_text(encoding="utf-8"))["scores"]
left_out = real_streets["each pair of cameras left out"]


def row_of_scores(name, scores):
    """Return a row of the table: each score's pixel accuracy, per cent, and its interval where it has one."""
    texts = [score_with_interval.shown(score["pixel accuracy"], digits=0) for score in scores]
    return f"| {name} | " + " | ".join(texts + [""] * (3 - len(texts))) + " |"


head = "| semantic cells right, per cent | with $o$ | without $o$ | a table of $o$ alone |\n|---|---|---|---|"
real = [left_out[name] for name in ("real only", "real only, without occupancy", "occupancy state alone")]
rows = [
    row_of_scores("simulated, true labels", [simulated["usual"], simulated["no occupancy grid"]]),
    row_of_scores("the same, one plane instead of twenty", [simulated["1 plane"]]),
    row_of_scores("real cameras left out, real labels", real),
]
Markdown("\n".join([head, *rows]))

# %% [markdown]
# In brackets 95 % intervals. The simulated rows' networks learnt in 500 steps from labels made with the LIDAR (lecture
# 09), on a GPU, so don't compare their 54 % with the 73 % above. For the real row six cameras made three pairs
# (right, left, front and back). Each pair was left out once, three networks learned from the four others, and the two
# were scored: all on one street corner. By true labels $o$ brings 14 points; by real labels 43, and the score without
# it has a wide interval. The judges differ, too: a real cell is labelled only where a *LIDAR return* lies, and there
# $o$ has evidence. And look at the last column: in the view of cameras that a network hasn't learned from, a table of
# $o$ alone gets *more* cells right, by 6 points (1 to 11). Of eight ways that go on from simulated streets six come
# within two points of it; the highest, the mean of three image networks' scores, has 2 more after the CRF, and that may
# be chance (-1 to 4; [results](../docs/results.md)). The second row is a surprise of its own: a network that was
# trained with the ground plane alone loses one point against one with twenty. So on these simulated streets, with these
# labels, the number of planes is hardly what a network has over a table.
#
# Is late fusion nearly free on the real street, too? Labels by the shipped real network, state by the filter, truth by
# people:

# %%
street = real_drive()
real_net = load_net(real_weights(), street.camera).requires_grad_(False)
_, real_image, real_o, real_truth = prepared(street)
real_scores = scores_of(real_net, real_image)
real_grid = grid_of(real_net, (real_net.sampler(s[None])[0] for s in real_scores), real_o)
real_label = read_on_ground(real_scores.argmax(dim=1).numpy(), street.camera.resized(size))
use = real_truth != IGNORE
real_columns = real_label[use], real_o.numpy().argmax(axis=1)[use], real_truth[use].astype(int)
real_rows = compare(*real_columns, real_grid[use], fit_table(*real_columns))
print(f"label and state share {shared(*real_columns):.2f} bits once the class is known")
late_called = late(fit_table(*real_columns), *real_columns[:2]).argmax(axis=1)
shares = zip(KITTI_14.names, found(late_called, real_columns[2]), strict=True)
print("true cells that late fusion finds, %:", ", ".join(f"{name} {share:.0f}" for name, share in shares if share >= 0))
assert 2.5 < real_rows["table of both"][0] - real_rows["late fusion"][0] < 4
Markdown(as_table(real_rows))

# %% jupyter={"source_hidden": true} alt="three maps of the real street: the network's classes; late fusion, with the road beyond 13 m and several cars and walls in place, more cars and walls than there are, and neither vegetation nor sidewalk; and the labels, which have gaps"
late_grid = np.full(real_truth.shape, IGNORE)
late_grid[use] = late_called
last_maps = {
    "A: the network": real_grid[-1],
    "B: late fusion": late_grid[-1],
    "C: labels (white: none)": real_truth[-1],
}
fig = plotting.label_maps(spec, last_maps, KITTI_14)
fig.supxlabel(street.credit, fontsize=7)
plt.show()

# %% [markdown]
# Three times as many bits are shared as on the simulated drive, and here late fusion isn't nearly free: it loses three
# points of all cells, and six of semantic ones, against the table, which knows how label and state occur together. By
# class accuracy it is better here, too, by about seven points. (The network has learnt from these very
# frames, so its row shows what it can hold, not how it does on a new street.) Over all ten frames late fusion finds
# most of the road, two fifths of the cells of cars and nearly three quarters of those of buildings, and gives these names to
# many other cells (B shows the last frame). It finds next to nothing of vegetation, sidewalk, bicycles and pedestrians. The road
# nearer than 13 m is missing, too: this camera doesn't see the ground so near, and a table can't ask the neighbours.
#
# ## Play with it
#
# Turn the camera, and keep the calibration. Positive: it points higher than the calibration says. Where does the map
# break first, near or far? (Without a running kernel there is no slider; the curves below show seven angles, from -2 to 2 degrees.)


# %% jupyter={"source_hidden": true}
def turned(pitch=0.0, yaw=0.0):
    """Return a calibration from which the camera deviates: it points higher, or farther to the left, by some degrees."""
    turn = Rotation.from_euler("xy", [pitch, yaw], degrees=True).as_matrix()
    T = rigid_transform(turn, np.zeros(3)) @ drive.camera.T_camera_from_lidar
    return replace(drive.camera, T_camera_from_lidar=T)


def map_with(name, scores, camera, which=slice(None)):
    """Return the grids that a shipped network makes of its scores of some frames with a calibration."""
    wrong = load_net(sample_weights(name), camera).requires_grad_(False)
    return grid_of(wrong, (wrong.sampler(s[None])[0] for s in scores), o[which])


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the map of a frame with the calibration of the slider's angle"
def show(pitch):
    """Show the map with a wrong pitch."""
    _, ax = plt.subplots(figsize=(3, 4.6), layout="compressed")
    grid = map_with("segnet", scores[shown : shown + 1], turned(pitch), slice(shown, shown + 1))[0]
    plotting.grid_labels(spec, grid, KITTI_14, ax=ax, legend=False)
    ax.set_title(f"{accuracies(grid, truth[shown])[0]:.0f} % of semantic cells", fontsize="medium")
    plt.show()


_ = interact(show, pitch=FloatSlider(value=1.0, min=-3, max=3, step=0.25, description="pitch [°]"))

# %% [markdown]
# ## Where this breaks
#
# **A wrong calibration.** Claim 9 says that learning repairs errors of calibration: those that were there in training.
#
# **Predict before you run.** One degree is three pixels of this image. Does it matter more in pitch or in yaw? Is it the
# same whether the camera points too high or too low?
#
# <details><summary>Answer</summary>
#
# Yaw moves a cell 30 m ahead by half a metre; pitch makes it read the ground 16 m too far or 8 m too near (lecture
# 05, for a camera at 1.5 m). Pointing too high by one degree costs the three networks 3 to 14 points, yaw of one
# degree 3 at most. Pointing too *low* by one degree cost none of them anything on these five frames: FCN gained about
# four points. With other frames DeepLab lost two.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="accuracy of three networks against the error of pitch and of yaw from minus two to two degrees: with pitch it falls steeply when the camera points too high; when it points too low it rises for FCN, while DeepLab v2 falls at two degrees; with yaw it falls little on both sides"
NAMES = {"segnet": "SegNet", "fcn": "FCN", "deeplab": "DeepLab v2"}
angles, some = (-2, -1, 0, 1, 2), slice(None, None, 2)  # five of the ten frames
looks = {name: scores_of(load_net(sample_weights(name), drive.camera), image[some]) for name in NAMES}


def share_right(name, **angle):
    """Return the pixel accuracy of a network with a camera that is turned by an angle, per cent."""
    return accuracies(map_with(name, looks[name], turned(**angle), some), truth[some])[0]


curves = {
    (name, axis): [share_right(name, **{axis: angle}) for angle in angles]
    for name in NAMES
    for axis in ("pitch", "yaw")
}
fig, axes = plt.subplots(1, 2, figsize=(8.2, 3), sharey=True, layout="constrained")
for (name, axis), curve in curves.items():
    style = {"segnet": "o-", "fcn": "s--", "deeplab": "^:"}[name]
    axes[int(axis == "yaw")].plot(angles, curve, style, label=NAMES[name], markersize=4)
axes[0].set(
    xlabel="pitch error [degrees]; positive: camera points higher", ylabel="semantic cells right [%]", ylim=(40, 85)
)
axes[1].set(xlabel="yaw error [degrees]; positive: farther to the left")
axes[0].legend(fontsize="small", loc="lower left")
plt.show()

# %% tags=["nbval-ignore-output"] jupyter={"outputs_hidden": true}
usual = {name: curves[name, "pitch"][angles.index(0)] for name in NAMES}
print(f"{'semantic cells right, %':<26}" + "".join(f"{angle:>7}" for angle in angles), "degrees")
for (name, axis), curve in curves.items():
    print(f"{NAMES[name] + ', ' + axis:<26}" + "".join(f"{value:7.0f}" for value in curve))
right = {"as trained": whole, "camera 2 degrees too low": map_with("segnet", scores, turned(-2))}
for name, grid in right.items():
    near, far = (100 * (grid == truth)[semantic & side].mean() for side in (x < 20, x >= 30))
    print(f"SegNet, {name:<25} nearer than 20 m {near:.0f} %, beyond 30 m {far:.0f} %")
assert all(2 < usual[n] - curves[n, "pitch"][3] < 15 for n in looks)
assert all(curves[n, "pitch"][1] > usual[n] - 0.5 for n in looks)
assert all(abs(usual[n] - curves[n, "yaw"][k]) < 3.5 for n in looks for k in (1, 3))

# %% [markdown]
# Two degrees too high are worse still; two degrees too low cost DeepLab five points and the others nothing. The last two
# lines show where SegNet gains: it loses two points nearer than 20 m, and gains four beyond 30 m. Two reasons are
# possible, and this test doesn't tell them apart: a far cell that reads too near mostly reads more of the same street,
# while one that reads too far reads what stands on it; and where the road falls, it lies below the plane.
#
# **A light that it hasn't met.** Training varied brightness by a fifth:

# %% tags=["nbval-ignore-output"]
for name in looks:
    dim = scores_of(load_net(sample_weights(name), drive.camera), image[some] / 3)
    dark, bright = accuracies(map_with(name, dim, drive.camera, some), truth[some])[0], usual[name]
    print(f"{NAMES[name]:<11} a third of the light: {bright:.0f} -> {dark:.0f} % of semantic cells")

# %% [markdown]
# **What it makes up.** Where no beam has been and the camera doesn't see the cell either, the truth is
# *unknown-unobserved*. How many of these cells get a name all the same, and can the probabilities tell a guess from a
# sight?

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="histograms of the confidence of named cells: where a beam has been most lie above 0.9, where neither beam nor camera has been they spread from 0.3 to 1"
dark = o[:, State.UNKNOWN].numpy() > 0.9
nobody, named = dark & (truth == unobserved), whole < KITTI_14.n_semantic
with torch.inference_mode():
    sure = np.stack(
        [net.fusion(p[None], q[None])[0].softmax(dim=0).amax(dim=0) for p, q in zip(planes, o, strict=True)]
    )
guessed, sighted = sure[nobody & named], sure[semantic & named & ~dark]
ranks = np.searchsorted(np.sort(sighted), guessed)
print(f"of the cells that neither camera nor LIDAR sees {100 * named[nobody].mean():.0f} % get a name")
print(f"mean confidence there {guessed.mean():.2f}, of named cells that a beam has reached {sighted.mean():.2f}")
assert guessed.mean() < sighted.mean() - 0.1
print(f"a sight is surer than a guess in {100 * (1 - ranks.mean() / len(sighted)):.0f} % of pairs")
fig, ax = plt.subplots(figsize=(5.4, 2.4), layout="constrained")
for values, style, name in ((sighted, "-", "a beam has been there"), (guessed, "--", "neither beam nor camera")):
    ax.hist(values, np.linspace(0, 1, 41), density=True, histtype="step", linestyle=style, label=name)
ax.set(xlabel="confidence of a named cell", ylabel="density")
ax.legend(loc="upper left", fontsize="small")
plt.show()

# %% [markdown]
# The map of names doesn't tell a guess from a sight; the probabilities mostly do. So keep them, for the CRF (lecture
# 10) and for whoever plans a path.
#
# ## The ledger
#
# One edge, with its price on the toy world:

# %% jupyter={"source_hidden": true}
Markdown(ledger_table(ledger("fusion")))

# %% [markdown]
# Late fusion cuts it; this network needn't. Over all cells the edge is worth less than a point on the simulated drive,
# and three points on the real one. The network is farther above the table than that, so most of its lead lies
# elsewhere. It reads scores in place of one label, and it sees the cells around. On simulated streets twenty planes
# bring about a point.
#
# ## In five lines
#
# 1. A 1x1 convolution is a matrix product in each cell; on planes zero means that the camera doesn't see the point.
# 2. The image says what, $o$ says where. A table of both gets 74 % of all cells, late fusion 73 %, the network
#    80 %.
# 3. Balancing gives classes that are in all frames equal shares; with the limit that training uses the three largest
#    keep 54 %.
# 4. A wrong cell's gradient reaches pixels through $\theta^T$ and $A^T$. The scores then serve the map: 80 % of pixels
#    right become 67 %.
# 5. A camera that points one degree too high costs 4 to 14 points, one that points one degree too low none.
#
# **What you can do now.** Train a network from camera and LIDAR to a map, name the baseline that it has to beat, and
# measure what each input is worth.
#
# ## Further reading
#
# - Badrinarayanan, Kendall, Cipolla, *SegNet*, PAMI 39(12), 2017: unpooling by indices; it uses the balancing too.
# - Eigen, Fergus, *Predicting depth, surface normals and semantic labels with a common multi-scale convolutional
#   architecture*, ICCV 2015: where median frequency balancing comes from.
# - Lin, Chen, Yan, *Network in network*, ICLR 2014: the 1x1 convolution.
# - Ronneberger, Fischer, Brox, *U-Net*, MICCAI 2015: skip connections.
#
# ## Exercise
#
# [Exercise 08](exercises/08_fusion.ipynb): a table with a way out, a derivative that is wrong, a limit for the weights,
# the gradient of the loss, an optimiser found from its path, and one question. Next: lecture [09](09_truth.ipynb), where
# the truth comes from.

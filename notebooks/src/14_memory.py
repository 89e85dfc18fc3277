# %% [markdown]
# # 14 · Memory for classes: what is one more look worth?
#
# **In one sentence.** The paper's map forgets what earlier images showed; you give it a memory, find out why a second
# look is worth much less than the first, and measure what the memory gains and where it harms.
#
# **You will be able to**
# - draw one cell over time, and read from the graph what two frames share;
# - combine frames that make the same mistake, by hand and with an exponent;
# - write a memory of classes for one cell, and let a moving car take its class along;
# - score a memory against the rivals that cost nothing, and find the ghosts that it keeps.
#
# **Prerequisites.** Lectures [03](03_bof.ipynb) and [04](04_cmcdot.ipynb): a filter over time, velocities of cells.
# Lecture [08](08_fusion.ipynb): the semantic grid. For d-separation: lecture [01b](01b_graphical_models.ipynb).
#
# **Time.** 68 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3, figure 2: nothing leads from one semantic grid to the next. The rest isn't in the paper.

# %% jupyter={"source_hidden": true}
import json
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown
from ipywidgets import FloatSlider, interact
from scipy.ndimage import label

# %% jupyter={"source_hidden": true}
from semgrid_edu import fast, memory, plotting
from semgrid_edu.datasets import samples
from semgrid_edu.graphical import d_separated
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.memory import MemoryParams, remember_drive
from semgrid_edu.occupancy import PlanarMotion, State
from semgrid_edu.occupancy.planar_motion import look_up
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.workshop.course.street import frames_since_seen
from worlds import lecture_14_class_memory as toy
from worlds.lecture_00_street import CLASS_OF, CLASSES, STREET

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
spec, S = GridSpec.compact(), KITTI_14.n_semantic
real, sample = samples.real_drive(), samples.sample_drive()


def with_memory(frames, weights):
    """Return the results of some frames with memory; without the CRF, of which this lecture needs nothing."""
    stages = Stages.fast(fast.load_net(weights, frames[0].camera), memory=True)
    return list(run_pipeline(frames, replace(stages, refine=lambda log_g, o: np.exp(log_g))))


street = with_memory([real[k] for k in range(9)], samples.real_weights())
driven = with_memory(sample[::2], samples.sample_weights())
measured = json.loads(Path("../docs/results/memory.json").read_text())

# %% [markdown]
# ## What does the map say of a car that has left the picture?
#
# The vehicle waits at a crossing. An oncoming car passes on the left. After 1.6 seconds it has left the image, but not
# the laser scan. Follow the ring, which appears when the filter finds that the car moves.


# %% jupyter={"source_hidden": true}
def oncoming(result):
    """Return the middle of the oncoming car's cells, x and y in metres: the largest patch that moves on the left."""
    x, y = np.moveaxis(spec.centers(), -1, 0)
    patches, _ = label((result.belief.probability[State.DYNAMIC] > 0.5) & (y > 6) & (y < 11) & (x > 6) & (x < 35))
    cells = patches == 1 + np.bincount(patches.ravel(), minlength=2)[1:].argmax()
    return np.array([x[cells].mean(), y[cells].mean()]) if cells.sum() > 5 else None


def pictures():
    """Return the figure of image and two maps, its parts that change, and the most probable classes of all frames."""
    fig = plt.figure(figsize=(9.6, 3.9), layout="constrained")
    axes = fig.subplot_mosaic([["A", "B", "C"]], width_ratios=(2.2, 1, 1))
    fig.supxlabel(real.credit, fontsize=8)
    maps = [[grid.argmax(axis=0) for grid in (result.grid, result.remembered)] for result in street]
    photo, rings = axes["A"].imshow(street[0].frame.image[::2, ::2]), []
    axes["A"].set_axis_off()
    for letter, title, first in zip("BC", ("B: one frame", "C: with memory"), maps[0], strict=True):
        ax = plotting.grid_labels(spec, first, KITTI_14, ax=axes[letter], legend=False)
        ax.set_ylim(0, 45)
        ax.set_title(title, fontsize="medium")
        rings += [ax.plot([], [], "o", ms=26, mfc="none", mec=c, mew=w)[0] for c, w in (("white", 4), ("red", 2))]
    axes["C"].set_ylabel("")
    plotting.class_legend(axes["C"], KITTI_14, np.array(maps))
    return fig, axes, photo, rings, maps


# %% jupyter={"source_hidden": true} alt="animation of a real street: A, the camera image; B, the map of one frame, in which the ringed oncoming car turns from car to unknown-dynamic as it leaves the image; C, the map with memory, in which it stays a car"
def passing():
    """Yield image, map of one frame and map with memory, of every second frame."""
    fig, axes, photo, rings, maps = pictures()
    for result, both in list(zip(street, maps, strict=True))[::2]:
        photo.set_data(result.frame.image[::2, ::2] // 16 * 16)
        axes["A"].set_title(f"A: image, {result.frame.time:.1f} s", fontsize="medium")
        for letter, one in zip("BC", both, strict=True):
            axes[letter].images[0].set_data(KITTI_14.colours(one))
        place = oncoming(result)
        for ring in rings if place is not None else ():
            ring.set_data(*place[::-1, None])
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(passing(), period=1.0, alt="a car leaves the image; only the map with memory still calls it a car")

# %% [markdown]
# In B, the map of one frame, the car is blue, *car*, where the camera sees it. As it leaves the image it turns pale
# orange, cell by cell: *unknown-dynamic*. In C it stays a car.
#
# B takes its classes from the newest image alone. Its occupancy filter remembers *where* things are, but nothing
# remembers *what* they are. So the map knows that something moves there, and no longer that it is a car.
#
# The obvious memory multiplies what all frames say. Before we build it, we ask when this would be right.
#
# ## What do two frames share?
#
# Take one cell at three frames. $m_t$ is its content, $l_t$ says whether a laser beam stops there, and $z_t$ is the
# class that the network names. So far this is lecture 01's chain with two sensors. The new row is $e_t$, the network's
# **error**: "none", or "says building, whatever it sees", and so on. Errors last, because the shadow that misled the
# network is mostly still there a moment later. In our toy an error stays with probability $r = 0.6$, and is otherwise
# drawn anew. Each frame by itself is right with 0.8.

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a directed graph of three frames: contents m0 to m2 in a row, above them scans, below them the classes named, which also depend on a row of errors e0 to e2, highlighted; neighbouring contents and neighbouring errors are joined by arrows"
stage = toy.class_over_time(toy.MemoryWorld(steps=3, repeats=0.6))
fig, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
replace(stage, cut=()).draw(ax, highlight=("e0", "e1", "e2"))
plt.show()

# %% [markdown]
# **Predict before you run.** A product of frames is right if $z_0$ and $z_1$ are independent once the contents $m_0$ and
# $m_1$ are known. Are they? And are $z_0$ and the beam $l_1$?
#
# <details><summary>Answer</summary>
#
# $z_0$ and $z_1$ aren't, because the path $z_0 - e_0 - e_1 - z_1$ is open. If the error $e_0$ were known as well, they
# would be. $z_0$ and $l_1$ are independent: the laser doesn't share the camera's errors.
#
# </details>

# %% jupyter={"outputs_hidden": true}
for one, other, given in (("z0", "z1", "m0 m1"), ("z0", "z1", "m0 m1 e0"), ("z0", "l1", "m0 m1")):
    independent = d_separated(stage.model, one, other, given=given.split())
    print(f"{one} and {other} independent, given {given}: {independent}")

# %% [markdown]
# So two images share the network's error, even when we know everything about the cell. A laser beam and an image don't.
#
# ## How much is a second look worth?
#
# Two frames in a row say *building*, and the cell doesn't change. One cell in ten of the toy street is a building. A
# frame is right with 0.8; a wrong one names each of the three other classes with 0.2 / 3 = 0.067.
#
# - *Independent witnesses*: a building weighs 0.1 · 0.8 · 0.8 = 0.064, everything else 0.9 · 0.067 · 0.067 = 0.004. So
#   P(building) = 0.94.
# - *The second frame always repeats the first*: it says nothing new. 0.1 · 0.8 against 0.9 · 0.067 gives 0.57.
# - *$r$ = 0.6*: if the first was right, the second says the same with 0.6 + 0.4 · 0.8 = 0.92. If it was wrong, with 0.63.
#
# **Predict before you run.** What is P(building) in the third case: nearer to one look or to two?
#
# <details><summary>Answer</summary>
#
# Multiply the weights of one look by 0.92 and 0.63. P(building) = 0.66, much nearer to one look.
#
# </details>

# %% jupyter={"outputs_hidden": true}
right, wrong, prior = 0.8, 0.2 / 3, 0.1
for r in (0.0, 0.6, 1.0):
    again_right, again_wrong = r + (1 - r) * right, r + (1 - r) * wrong
    building, other = prior * right * again_right, (1 - prior) * wrong * again_wrong
    print(f"errors stay with {r}: P(building | building, building) = {building / (building + other):.2f}")

# %% [markdown]
# The exact answer follows the errors, too. In the toy there are four ways to be wrong. A real network has as many as
# there are shadows and textures, so nobody can write them down. What a system can afford is one belief $b_t(m)$ per cell,
# and an **exponent** $w$. The scan counts fully. Each image counts as $w$ of a witness:
#
# $$ b_t(m) \;\propto\; P(l_t \mid m)\; P(z_t \mid m)^{w} \sum_{m'} P(m \mid m')\, b_{t-1}(m') $$
#
# With $w = 1$ this is the product of frames.


# %% tags=["factored"]
def factored(world, named, stopped, w):
    """Return P(class) after all frames: one belief per cell, and an exponent in place of the errors."""
    says = np.einsum("e,mek->km", world.errors(), world.named())  # P(z | m), one frame by itself
    belief = np.array(STREET)
    for t, (z, stops) in enumerate(zip(named, stopped, strict=True)):
        belief = belief @ world.street.change() if t else belief
        belief = belief * world.returned()[:, stops] * says[z] ** w
        belief = belief / belief.sum()
    return belief @ CLASS_OF


world, seen = toy.MemoryWorld(steps=3, repeats=0.6), ([CLASSES.index("building")] * 2 + [0], [1, 1, 0])
np.testing.assert_allclose(factored(world, *seen, 0.5), toy.factored_classes(world, *seen, exponent=0.5))

# %% [markdown]
# How good is it? The **log loss** of a belief is −log P(true class), in nats; less is better. The toy is small enough for
# the exact mean over every sequence of three frames.


# %% jupyter={"source_hidden": true} alt="log loss against the exponent from 0 to 1 for a toy cell; left, errors last: a curve with its lowest point near one half, below the dashed line of the last image alone and above the dotted line of the exact answer, and above the dashed line at exponent 1; right, errors drawn anew: the curve falls to the exact answer at exponent 1"
def draw_loss(repeats, ax):
    """Draw the log loss against the exponent, for a rate at which errors stay."""
    chosen, exponents = toy.MemoryWorld(steps=3, repeats=repeats), np.linspace(0, 1, 21)
    price = toy.memory_price(chosen)
    ax.axhline(price.forgotten, color="0.4", linestyle="--", label="the last image alone")
    ax.plot(exponents, toy.loss_by_exponent(chosen, exponents), color="tab:blue", label="every image with exponent w")
    ax.plot(price.exponent, price.weighted, "o", color="tab:blue", label="best exponent")
    ax.axhline(price.exact, color="black", linestyle=":", label="exact")
    ax.set(xlabel="exponent w of each image", ylabel="log loss [nats]", title=f"errors stay with r = {repeats:.2f}")
    ax.set_ylim(0, 0.9)


fig, axes = plt.subplots(1, 2, figsize=(8.8, 3.1), layout="constrained", sharey=True)
for ax, r in zip(axes, (0.6, 0.0), strict=True):
    draw_loss(r, ax)
    ax.label_outer()
axes[0].legend(frameon=False, fontsize=8, loc="lower right")
plt.show()

# %% jupyter={"source_hidden": true}
price = toy.memory_price(world)
assert [round(loss, 2) for loss in price[:4]] == [0.42, 0.52, 0.38, 0.34]
assert round(price.exponent, 1) == 0.5
assert toy.memory_price(toy.MemoryWorld(3, 0.0)).independent < 0.3  # switched off: errors that don't last

# %% [markdown]
# At the right end of the left figure is the product: 0.52 nats, *worse* than the last image alone with 0.42. It is very
# sure of a wrong class whenever the frames err together. Is that the reason? The right figure switches it off. Errors are
# drawn anew in each frame, and the product becomes the exact answer.
#
# If errors last, the best exponent is one half, with 0.38 nats. Exact inference gets 0.34. This is the price of the lecture.
# **By its forgetting the paper's system loses 0.08 nats in the toy**, and an exponent pays back about half of it.


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="log loss against the exponent of each image, for a chosen rate at which errors stay"
def show(repeats):
    """Show the loss for the slider's setting."""
    draw_loss(repeats, plt.subplots(figsize=(6, 2.8), layout="constrained")[1])
    plt.legend(frameon=False, fontsize=8)
    plt.show()


_ = interact(show, repeats=FloatSlider(value=0.6, min=0.0, max=0.95, step=0.05, description="r"))

# %% [markdown]
# (The slider works with a running kernel.) A textbook formula gives the exponent without a search. If the errors of $T$
# readings have the correlation $r$ from each to the next one, as in the toy, their mean is as good as that of
#
# $$ T_\text{eff} = 1 + (T - 1)\,\frac{1 - r}{1 + r} $$
#
# independent readings. With $T$ = 3 and $r$ = 0.6 this is 1.5, so each of three frames gets the exponent one half, as in
# the figure. In the toy, then, each further look is worth a quarter of the first.
#
# ## How much may real frames weigh together?
#
# Now a drive: the simulated one, ten frames in two seconds. Do its network's errors last? Take a cell that the camera sees
# at two frames, and look up where it was. If the network was wrong there in the first, is it wrong in the second? The
# correlation of "wrong" with "wrong" is the $r$ of the formula.


# %% tags=["repeats"]
def wrong_and_seen(result):
    """Return whether each cell is wrong, and whether it can be judged: labelled, in view, and not moving, (2, H, W)."""
    truth = result.frame.labels.birdseye_on(spec)
    judged = result.frame.labels.visible_on(spec) & (truth != IGNORE)
    judged &= result.belief.probability[State.DYNAMIC] < 0.1
    return np.stack([result.grid[:S].argmax(axis=0) != truth, judged]).astype(np.float32)


def moved_to(now, then, values):
    """Return the values (C, H, W) of an earlier frame's map, looked up in the cells of now."""
    motion = PlanarMotion.from_poses(then.frame.T_world_from_lidar, now.frame.T_world_from_lidar)
    return look_up(np.float32(values), np.zeros(len(values), np.float32), spec, spec, motion)


def errors_last(results, apart):
    """Return the correlation of errors in the same place, `apart` frames from each other."""
    pairs = []
    for then, now in zip(results[:-apart], results[apart:], strict=True):
        (was_wrong, was_judged), (wrong, judged) = moved_to(now, then, wrong_and_seen(then)), wrong_and_seen(now)
        both = (was_judged * judged) > 0
        pairs.append(np.stack([was_wrong[both], wrong[both]]))
    return np.corrcoef(np.concatenate(pairs, axis=1))[0, 1]


# %% [markdown]
# The correlation is 0.6 after one frame. By the formula ten frames are then worth three, and an exponent of a third should
# help.
#
# **Predict before you run.** The memory counts the first look fully, and each further one with the exponent $w$. Which of
# $w$ = 0.1, 0.35 and 1 is the best on the drive? Is it better than the newest frame alone?
#
# <details><summary>Answer</summary>
#
# The two small exponents are nearly alike, but *none* of the three beats the newest frame: 0.65 nats against 0.63. The product is
# worst.
#
# </details>


# %%
def log_loss(maps):
    """Return the log loss in view, and how sure the maps are there; the unknown classes left aside."""
    found = []
    for result, grid in zip(driven, maps, strict=True):
        truth = result.frame.labels.birdseye_on(spec)
        cells = result.frame.labels.visible_on(spec) & (truth != IGNORE)
        p = grid[:S, cells] / np.maximum(grid[:S, cells].sum(axis=0), 1e-9)
        found.append([-np.log(np.maximum(p[truth[cells], np.arange(cells.sum())], 1e-3)), p.max(axis=0)])
    return np.concatenate(found, axis=1).mean(axis=1)


def tried_with(weights, most):
    """Return the log loss and how sure the maps are, for each weight of one more frame; all together weigh `most`."""
    params = [MemoryParams(near_exponent=each, decay_distance=1e9, max_weight=most) for each in weights]
    return np.array([log_loss(remember_drive(views, spec, one)) for one in params])


# %% tags=["nbval-ignore-output", "weights"] jupyter={"outputs_hidden": true}
views = [memory.View(result.frame, result.belief, result.grid) for result in driven]
weights = (0.1, 0.35, 1.0)
newest = log_loss([result.grid for result in driven])
product = tried_with(weights, most=20.0)  # more than ten frames can weigh, so there is no limit
print(f"newest frame alone: {newest[0]:.2f} nats, {100 * newest[1]:.0f} % sure")
for w, (loss, sure) in zip(weights, product, strict=True):
    print(f"w = {w:<4}: {loss:.2f} nats, {100 * sure:.0f} % sure")
assert newest[0] < product[:, 0].min() < product[2, 0] - 0.04

# %% [markdown]
# With more frames the map gets surer, but not better. The fault may be that evidence piles up. Then stop it: let all
# frames *together* weigh one. That is a **running mean** of $\log P$. Let $\ell$ be the mean in a cell and $p$ what the
# newest frame says. With $a$ for the weight of the newest,
#
# $$ \ell_\text{new} = (1 - a)\,\ell_\text{old} + a \log p. $$
#
# Note the difference: $w$ says how much each frame *adds*, $a$ how much of the old it *replaces*.

# %% jupyter={"source_hidden": true} tags=["nbval-ignore-output"] alt="left, the correlation of errors falls from 0.6 after a fifth of a second to a third after two seconds, while the curve of the formula is near 0 after one; right, log loss of three weights: the product of frames is above the dashed line of the newest frame alone, the running mean below it"
apart, mean = np.arange(1, 10), tried_with(weights, most=1.0)
lasting = np.array([errors_last(driven, k) for k in apart])
fig, (left, ax) = plt.subplots(1, 2, figsize=(8.6, 3.2), layout="constrained")
left.plot(0.2 * apart, lasting, "o-", color="tab:blue", label="measured")
left.plot(0.2 * apart, lasting[0] ** apart, "--", color="0.4", label="formula: $r^k$ after k frames")
left.set(xlabel="time apart [s]", ylabel="correlation of errors", ylim=(0, 0.8), title="how long errors last")
ax.axhline(newest[0], color="0.4", linestyle="--", label="newest frame alone")
ax.plot(weights, product[:, 0], "s-", color="tab:red", label="product, exponent w")
ax.plot(weights, mean[:, 0], "o-", color="tab:blue", label="running mean, weight a")
ax.set(xlabel="w or a", ylabel="log loss in view [nats]", title="what ten frames are worth")
for one in (left, ax):
    one.legend(frameon=False, fontsize=8)
plt.show()
assert 0.55 < lasting[0] < 0.7
assert round(toy.frames_worth(10, lasting[0])) == 3
assert 0.45 < lasting[-1] / lasting[0] < 0.65
assert mean[1, 0] < newest[0] - 0.01
assert mean[1, 1] - newest[1] < 0.01 < 0.02 < product[1, 1] - newest[1]

# %% [markdown]
# The right figure shows the mean in blue. With $a$ = 0.35 it is better than the newest frame alone, and its map is hardly any
# surer. (The filter draws random particles, so on another processor a last digit may differ.)
#
# And why did the formula promise more? It assumes that the correlation falls by the same factor in each frame, so that
# hardly any of it is left after two seconds. In the left figure about half of it is left. Even frames far apart aren't
# independent. So all ten frames together may weigh about as much as one.
#
# ## Who decides what a cell is?
#
# Here is the memory of one cell. By hand, with $a$ = 0.5: the first frame says 0.8 and 0.2, odds of 4. The second says
# 0.5 and 0.5, odds of 1. The mean of their logarithms is the logarithm of 2, so P = 0.67, between the two.


# %% tags=["learn"]
def learn(mean, p, a):
    """Return the mean of log P after one more frame; at first there is none."""
    return np.log(p) if mean is None else (1 - a) * mean + a * np.log(p)


here, FREE = GridSpec(0, 1, 0, 1, 1), np.eye(4)[State.FREE].reshape(4, 1, 1)
params = MemoryParams(near_exponent=0.5, decay_distance=1e9, max_weight=1.0, movable=())
package, mean = memory.MemoryState.empty(2, here), None
for p in ([0.8, 0.2], [0.5, 0.5], [0.3, 0.7]):
    mean = learn(mean, p, a=0.5)
    look = memory.look_at(np.array([*p, 0, 0, 0, 0]).reshape(6, 1, 1), FREE, here, params)
    package = memory.learn_classes(package, np.zeros((1, 1), int), look, params)
    np.testing.assert_allclose(package.evidence[0, :, 0, 0], mean, atol=1e-5)
    print(f"frame says {p}: P = {(np.exp(mean) / np.exp(mean).sum()).round(2)}")

# %% jupyter={"source_hidden": true}
said = np.array([0.8] * 4 + [0.1] + [0.8] * 3 + [0.1] * 4)
logs = np.log(np.stack([said, 1 - said], axis=1))
kept = [logs[0]]
for p in logs[1:]:
    kept.append(0.65 * kept[-1] + 0.35 * p)
histories = {"this frame": (logs, "0.5", ":"), "product": (logs.cumsum(axis=0), "tab:red", "--")}
histories["running mean, a = 0.35"] = (np.array(kept), "tab:blue", "-")

# %% jupyter={"source_hidden": true} alt="left, P(building) of a cell over twelve frames: one frame alone drops at a blunder in frame 5, the running mean only to one half, the product not at all; when the cell changes at frame 9 the mean follows at once and the product three frames later; right, a table of who decides: in view the mean for what stays and this frame alone for car, person, bicycle; seen before the memory, and for cars memory times laser; never seen the four unknown classes"
fig, (left, ax) = plt.subplots(1, 2, figsize=(9.8, 3.3), layout="constrained", width_ratios=(1, 1.15))
for name, (scores, colour, line) in histories.items():
    left.plot(np.arange(1, 13), np.exp(scores[:, 0]) / np.exp(scores).sum(axis=1), line, color=colour, label=name)
left.set(xlabel="frame", ylabel="P(building)", ylim=(0, 1.45), yticks=(0, 0.5, 1), title="A: a blunder, then a change")
left.legend(frameon=False, fontsize=8, ncols=2, loc="upper left")
decides = {"in view": ("memory and frame,\nrunning mean", "this frame alone"),
           "seen before": ("memory", "memory, times\nP(something there)"),
           "never seen": ("nobody: one of the\nunknown classes", "nobody: one of the\nunknown classes")}  # fmt: skip
ax.set(xlim=(-1.05, 2), ylim=(3.5, -0.1), title="B: who decides")
ax.set_axis_off()
for column, head in enumerate(("what stays: road,\nhouse, tree ...", "what comes and goes:\ncar, person, bicycle")):
    ax.text(column + 0.5, 0.25, head, ha="center", va="center", fontsize=9)
for row, (where, cells) in enumerate(decides.items()):
    ax.text(-0.08, row + 1, where, ha="right", va="center", fontsize=9)
    for column, text in enumerate(cells):
        shade = ("#dce9f5", "#fbe5cf", "0.93")[2 if row == 2 else column]
        ax.add_patch(plt.Rectangle((column + 0.03, row + 0.57), 0.94, 0.86, facecolor=shade, edgecolor="0.5"))
        ax.text(column + 0.5, row + 1, text, ha="center", va="center", fontsize=9)
plt.show()

# %% [markdown]
# In A, the fifth frame is a blunder, and from the ninth on the cell really is something else. The mean only dips at the
# blunder and follows the change. The product ignores both for too long.
#
# B shows the whole rule. A hundred frames of empty road are no witness against a car that has just come. So where the
# camera sees a cell, this frame alone decides on cars, people and bicycles. Where it doesn't, the memory speaks, and the
# laser is a second witness: a remembered car is multiplied by the probability that something is there at all.
#
# Two details. The map stays aligned with the world and scrolls under the vehicle by whole cells (lecture 04), because to
# interpolate it in every frame would blur it. And $a$ falls with the distance, from 0.7 beside the vehicle to half of that
# far ahead, where a cell is less than a pixel high. This default is older than the rule for cars. Measured
# again, 0.2 is the best up to 45 metres. But in each band of distance the default costs at most 0.01 nats more
# ([memory.json](../docs/results/memory.json)), so it has stayed.

# %% jupyter={"source_hidden": true}
worth = measured["worth"]
losses, middle = np.array([*worth["log loss"].values()]), np.convolve(worth["edges"], [0.5, 0.5], "valid")
default = MemoryParams().exponent(middle)
weights_tried = [float(a) for a in worth["log loss"]]
costs = [np.interp(a, weights_tried, band) - band.min() for a, band in zip(default, losses.T, strict=True)]
assert max(costs) < 0.0105
assert worth["best"] == [0.2, 0.2, 0.2, 0.2, 0.35]
assert worth["edges"][4] == 45

# %% [markdown]
# So the mean decides on what stays, the newest look on what comes and goes, and the laser on what nobody sees now.
#
# ## Where does the class of a moving car go?
#
# A memory of places fails for a car that drives, because its class would stay behind. So there are two layers in each
# cell, what *stays* and what *moves*. They count with P(not DYNAMIC) and P(DYNAMIC). The filter also has a velocity for
# each moving cell, so such a cell asks the cell where its content came from, and copies the class.
#
# **Predict before you run.** A row of ten cells of 0.5 m. A car covers the first three and drives at 2 m/s, which is
# 0.2 m in each frame. A memory rounds this to whole cells and forgets the rest. Where is the class after ten frames?
#
# <details><summary>Answer</summary>
#
# 0.2 m is less than half a cell, so it rounds to nothing, each time. The class never leaves its three cells, and is
# forgotten as the car leaves them.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
row, speed, dt = GridSpec(0, 5, 0, 0.5, 0.5), 2.0, 0.1
x = row.centers()[..., 0]
keeps_rest, rounds = (memory.MemoryState.empty(2, row) for _ in range(2))
for one in (keeps_rest, rounds):
    one.evidence[1, 1], one.weight[1], one.seen[1] = 1.0 * (x < 1.5), x < 1.5, x < 1.5
velocity = np.stack([np.full(row.shape, speed), np.zeros(row.shape)])
for step in range(11):
    car = np.abs(x - 0.75 - speed * dt * step) < 0.75
    if step:
        keeps_rest = memory.carry_classes(keeps_rest, np.float32(car), velocity, 0.5, dt, MemoryParams())
        rounds.offset[:] = 0
        rounds = memory.carry_classes(rounds, np.float32(car), velocity, 0.5, dt, MemoryParams())
    if step % 5 == 0:
        rows = [car, *(one.evidence[1, 1] > 0 for one in (keeps_rest, rounds))]
        drawn = ["".join("#" if there else "." for there in one[::-1, 0]) for one in rows]
        print("{:.1f} s   car {}   class, rest kept {}   class, rest lost {}".format(step * dt, *drawn))

# %% [markdown]
# Forward is to the right. The package keeps the rest, so the class travels with the car, as in the opening picture.
#
# ## What does the memory gain?
#
# There are two kinds of cells to ask about: those that the camera sees now, and those that it saw before and doesn't see
# now. Each has a rival that costs nothing. In view it is the mean of the last five maps. In cells seen before it is the
# **last look**: keep what the map said when the camera last saw the cell.
#
# **Predict before you run.** In which of the two does the memory gain more? And what may it gain there against the last
# look: classes, or only fewer answers *unknown*?
#
# <details><summary>Answer</summary>
#
# In cells seen before. There it gains 15 points over the last look on simulated streets. But if *unknown* is forbidden to
# both, only 2.5 are left.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
names = {
    "fresh simulated streets": "simulated streets, new to the network",
    "real street, network from simulated streets": "a real street, new to the network",
    "real street, network that learned from its frames": "the same, network learned from its frames",
}


def table(group, rival, gain):
    """Return a table of pixel accuracies: one frame, a rival, memory and the gain with its interval."""
    over = "one frame" if gain == "gain" else rival
    head = f"| cells {group} | one frame | {rival} | memory | gain over {over} | if *unknown* is forbidden |"
    rows = [f"Pixel accuracy {group}, per cent:\n", head, "|" + "---|" * 6]
    for key, name in names.items():
        one = measured["scores"][key][group]
        shares = [f"{100 * one['methods'][m]['pixel accuracy']['mean']:.0f}" for m in ("one frame", rival, "memory")]
        found = one[gain]["pixel accuracy"]
        low, mean, high = (f"{100 * found[part]:+.1f}" for part in ("low", "mean", "high"))
        forbidden = f"{100 * one[gain]['unknown forbidden']['mean']:+.1f}"
        rows.append(f"| {name} | {' | '.join(shares)} | {mean} ({low} to {high}) | {forbidden} |")
    return "\n".join(rows)


in_view = table("in view", "mean of five maps", "gain")
Markdown(in_view + "\n\n" + table("seen before", "last look", "gain over the last look"))

# %% jupyter={"source_hidden": true}
fresh = measured["scores"]["fresh simulated streets"]
gains = {group: fresh[group][name] for group, name in (("in view", "gain"), ("seen before", "gain over the last look"))}
shown = [round(100 * gains[g][m]["mean"], 1) for g in gains for m in ("pixel accuracy", "unknown forbidden")]
assert shown == [5.0, 0.8, 15.4, 2.5], shown
own = measured["scores"]["real street, network that learned from its frames"]["seen before"]["gain over the last look"]
assert own["unknown forbidden"]["low"] < 0
five, one_frame = (fresh["in view"]["methods"][m]["pixel accuracy"]["mean"] for m in ("mean of five maps", "one frame"))
assert five < one_frame - 0.02
later = [fresh["seen later"]["methods"][m]["pixel accuracy"]["mean"] for m in ("memory", "whole drive")]
assert [round(100 * share) for share in later] == [11, 63]

# %% [markdown]
# The intervals are over drives (lecture 12), on the real street over pieces of two seconds. In view, memory gains 5 points on streets that are new to the network, and
# the mean of five maps *loses* points there. For a network that learned from these very frames there is hardly anything left
# to gain. In cells seen before, one frame knows almost nothing on simulated streets, the last look knows a lot, and the
# memory more.

# %% jupyter={"source_hidden": true} alt="three maps of the simulated street: with one frame, most cells beside the view and right before the vehicle are pale, brown or black, unknown; with memory, road, sidewalk and vegetation reach to the vehicle; the truth"
maps = {"one frame": driven[-1].grid, "with memory": driven[-1].remembered}
maps = {name: grid.argmax(axis=0) for name, grid in maps.items()}
plotting.label_maps(spec, maps | {"truth": driven[-1].frame.labels.birdseye_on(spec)}, KITTI_14)
plt.show()

# %% [markdown]
# Is this knowledge, or does the memory only say *unknown* less often? Forbid that answer to both (the tables' last column).
# On new streets the gain in view falls below one point, and the gain over the last look to a few. So there most of the gain
# is fewer answers *unknown*. That is worth having: the map above shows the road right before the vehicle, which one frame
# calls unknown. But the classes are hardly better than those of one good look. (In the last row the gain stays large, but
# its interval then includes zero.)
#
# Whoever makes labels from a recorded drive also has the *later* images. `smooth_drive` runs a second memory backward
# through the drive. In cells that are only seen later it is right in 63 of 100, and the memory of the past in 11.
#
# So the memory gains little in view and much where the camera has looked before.
#
# ## Where this breaks: a car that has left
#
# A car was in a cell. It left while the camera looked elsewhere. The memory keeps a **ghost**: a cell of empty road, seen
# before, that it calls car. On the simulated drive we know the truth, so we can count ghosts, and look up which of them had
# a car at an earlier frame.


# %% tags=["nbval-ignore-output"]
cars, road, comes = KITTI_14.index("car"), KITTI_14.index("road"), list(MemoryParams().movable)
truth = np.stack([result.frame.labels.birdseye_on(spec) for result in driven])
before = (frames_since_seen([result.frame for result in driven], spec) > 0) & (truth != IGNORE)
remembered = np.stack([result.remembered for result in driven])
ghosts = before & (truth == road) & (remembered.argmax(axis=1) == cars)
parked = np.zeros_like(ghosts)
for k, now in enumerate(driven):
    for earlier, then in enumerate(driven[:k]):
        parked[k] |= moved_to(now, then, truth[earlier][None] == cars)[0] > 0
print(f"{ghosts.sum()} ghost cells; in {100 * parked[ghosts].mean():.0f} % an earlier frame had a car")
assert ghosts.sum() > 200
assert parked[ghosts].mean() > 0.45

# %% [markdown]
# In more than half of the ghosts a car has left. The laser could object, but it isn't sure enough. By hand: the memory says
# car with 0.9, and the filter FREE with 0.6 and STATIC with 0.4. The car keeps 0.9 · 0.4 / (0.9 · 0.4 + 0.1) = 0.78.
#
# Switch the cause off: forbid the memory to answer car, person or bicycle where the camera doesn't look. Or let the laser
# decide alone: no car where the filter says FREE. What does each cost?

# %% tags=["nbval-ignore-output"]
free = np.stack([result.belief.probability[State.FREE] for result in driven]) > 0.5
without, corrected = remembered.copy(), remembered.copy()
without[:, comes] = 0
corrected[:, comes] *= ~free[:, None]
rules = {"one frame": np.stack([result.grid for result in driven]), "memory": remembered,
         "no car where FREE": corrected, "no cars at all": without}  # fmt: skip
hidden, empty, score = before & (truth == cars), before & (truth == road), {}
for name, grids in rules.items():
    called = grids.argmax(axis=1)
    claims, right = called == cars, called == truth
    score[name] = claims[empty].sum(), 100 * claims[hidden].mean(), 100 * right[before].mean()
    print("{:<18} {:4} ghosts, {:2.0f} % of car cells found, {:.1f} % of all right".format(name, *score[name]))
assert hidden.sum() < 0.05 * before.sum()
assert score["no cars at all"][0] == 0
assert score["no cars at all"][2] > score["memory"][2]
assert score["no car where FREE"][0] < 0.8 * score["memory"][0]
assert score["memory"][1] > 25 > 5 > score["one frame"][1]

# %% [markdown]
# Without cars the ghosts are gone, and even *more* cells are right. So should a memory forget cars? It found a third of
# the hidden cars' cells, and one frame finds nearly none. A vehicle that forgets a parked car because it looks
# elsewhere may turn into it. Pixel accuracy can't see that, because cars are few. The laser as a judge is the better
# repair: it removes a third of the ghosts and keeps most of the cars. You build a softer form of it in the exercise.
#
# **What this doesn't show.** The fresh streets come from the simulator that the network learned from. The real street is
# a few seconds at one corner. And all these poses hardly drift; what a memory is worth with poses that do, we haven't
# measured.
#
# ## In five lines
#
# 1. Frames share the network's errors, so they aren't independent witnesses. A product of them can be worse than one
#    frame.
# 2. In the toy an exponent wins back half of what forgetting costs. On the drive errors last longer than the formula says,
#    and no exponent that we tried beats the newest frame.
# 3. A running mean does: all frames together weigh one. What comes and goes is decided by the newest look, and by the
#    laser where nobody looks.
# 4. In view the memory gains little, mostly fewer answers *unknown*. Where the camera looked before it gains far more.
# 5. Forgetting is the last price on lecture 00's list: 0.08 nats in the toy, half of which comes back. A memory has a price
#    of its own, the ghosts of cars that have left.
#
# **What you can now do.** You can draw a perception system as a graph, find what it leaves out, compute on a toy what
# that costs, build the repair, and measure whether the toy was right.
#
# ## Further reading and exercise
#
# - Sengupta, Sturgess, Ladicky, Torr, *Automatic dense visual semantic mapping from street-level imagery*, IROS 2012:
#   votes of frames in one map.
# - McCormac, Handa, Davison, Leutenegger, *SemanticFusion*, ICRA 2017: the product of frames, cell by cell.
# - Kittler, Hatef, Duin, Matas, *On combining classifiers*, PAMI 20(3), 1998: why a mean may beat a product.
#
# [Exercise 14](exercises/14_memory.ipynb): weigh frames, measure how long errors last, let the laser correct the memory,
# and a memory of your own, scored on the real street.

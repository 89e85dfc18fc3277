# %% [markdown]
# # Time, factored and sampled beliefs: what to do when a belief has too many states
#
# **In one sentence.** The exact belief about many things that change over time can't be stored, so filters keep a
# product of small beliefs (assumed density), a sample (particles), or a sample with an exact belief attached to each
# member (Rao-Blackwell), and each of the three has its own kind of error.
#
# **You will be able to**
# - draw a dynamic Bayesian network of two slices, and say why its exact belief doesn't stay a product;
# - say which question is answered by a filter, a smoother and Viterbi's path;
# - name the two moments at which BOF projects its belief, and measure which of them costs more;
# - write a particle filter, say why it needs resampling, and reduce its variance by computing what can be computed;
# - say why a grid needs no data association, and can't count.
#
# **Prerequisites.** Lectures [01](../01_bayes.ipynb) and [03](../03_bof.ipynb); factors and d-separation, as in
# [graphical models](../01b_graphical_models.ipynb). Lecture [04](../04_cmcdot.ipynb) comes after this page.
#
# **Time.** 62 minutes, of which the computer needs a few seconds.

# %% jupyter={"source_hidden": true}
import sys
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import IntSlider, interact

from semgrid_edu import plotting
from semgrid_edu.graphical import Factor, d_separated, max_product, sum_product
from semgrid_edu.metrics import total_variation

sys.path.append("..")  # for worlds/, in the folder above
from worlds.lecture_00_stage_graph import directed
from worlds.lecture_01_line import bayes_on_a_line
from worlds.lecture_01_lines import belief_history
from worlds.lecture_03_bof import (
    AT_THE_EDGE, HEAD_ON, STANDING_OR_DRIVING, TOWARDS_A_FENCE, bof_beliefs, bof_stage, expected_things,
)  # fmt: skip
from worlds.lecture_03_row import HIT, NOT_SEEN, Cell, exact_beliefs, hit_probability, joint_belief
from worlds.lecture_04_cmcdot import LEFT_OR_RIGHT, sampling_error

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI

# %% [markdown]
# ## One thing, two places
#
# A small world of lecture 03: four cells in a row, and one thing in cell 1. It either stands, or drives one cell to the
# right in each step. Both are equally probable. Before any scan, where is it one step later?


# %% jupyter={"source_hidden": true}
def occupied_pair(joint):
    """Return P(cell 1 occupied or not, cell 2 occupied or not), (2, 2)."""
    pair = joint.sum(*joint.names[2:]).table
    busy = np.isin(np.arange(len(Cell)), [Cell.STATIC, Cell.LEFT, Cell.RIGHT]).astype(int)
    return np.array([[pair[np.ix_(busy == a, busy == b)].sum() for b in (0, 1)] for a in (0, 1)])


unseen = replace(STANDING_OR_DRIVING, scans=("????",))
exact = occupied_pair(joint_belief(unseen, 1))
factored = np.outer(exact.sum(axis=1), exact.sum(axis=0))


def draw_pair(ax, table, title):
    """Draw a joint table of two cells with its numbers."""
    ax.imshow(table, cmap="Blues", vmin=0, vmax=0.8)
    for (row, col), p in np.ndenumerate(table):
        ax.text(col, row, f"{p:.2f}", ha="center", va="center", fontsize=12)
    ax.set_xticks((0, 1), ("free", "occupied"))
    ax.set_yticks((0, 1), ("free", "occupied"))
    ax.set(xlabel="cell 2", ylabel="cell 1")
    ax.set_title(title, fontsize=11)


# %% jupyter={"source_hidden": true} alt="two tables of cell 1 against cell 2, each free or occupied; left, the exact joint distribution, 0.5 in each of the two corners where exactly one cell is occupied and 0 elsewhere; right, the product of the marginals, 0.25 in all four corners"
fig, axes = plt.subplots(1, 2, figsize=(7.2, 3.1), layout="constrained")
draw_pair(axes[0], exact, "A: the exact joint belief")
draw_pair(axes[1], factored, "B: one number per cell")
plt.show()
np.testing.assert_allclose(exact, [[0, 0.5], [0.5, 0]], atol=1e-12)

# %% [markdown]
# In A the thing is in one place or in the other, but never in both and never nowhere. In B we have kept P(occupied) =
# 0.5 for each cell and nothing else. Now there are two things with probability 0.25, and none with probability 0.25.
# Both tables have the same marginals. So the error of B can't be seen in the map, until the next scan arrives.
#
# A is right, but for the paper's 55,025 cells, with the five states of a cell in this row (FREE, STATIC, moving to the
# left or to the right, UNKNOWN), it has $5^{55025}$ entries. This page is about what to store instead.
#
# ## A dynamic Bayesian network
#
# Draw the cells of one step, the cells of the next, and an arrow from each cell to those where its contents may be one
# step later. This two-slice graph is repeated over time. Such a model is a **dynamic Bayesian network**:

# %% jupyter={"source_hidden": true} alt="two rows of four cells, before and now, with arrows from each cell to itself and its neighbours one step later, a scan below each cell, and above each cell a node that says at most one thing"
stage = replace(bof_stage(), cut=())
stage.draw(plt.subplots(figsize=(7.6, 4.4), layout="constrained")[1])
plt.show()

# %% [markdown]
# **Predict before you run.** Suppose that all cells of the upper slice are independent. Are cells 1 and 2 of the lower
# slice independent of each other? What if somebody told you the whole upper slice? Look for a fork.
#
# <details><summary>Answer</summary>
#
# They aren't: the cell $m_1^{t-1}$ has arrows to both, because what it holds may stay or go. This is a fork. Given the
# whole upper slice, all forks are closed, and no other path is open. So given the upper slice the two are independent.
#
# </details>

# %% jupyter={"outputs_hidden": true}
before = [f"m{k},0" for k in (1, 2, 3, 4)]
assert not d_separated(stage.model, "m1,1", "m2,1")
assert d_separated(stage.model, "m1,1", "m2,1", given=before)
print("cells 1 and 2 independent:", d_separated(stage.model, "m1,1", "m2,1"))
print("given the slice before:   ", d_separated(stage.model, "m1,1", "m2,1", given=before))

# %% [markdown]
# This is the whole difficulty. Each *slice* is cheap, because given the slice before its cells are independent. But the
# filter has to sum the slice before out, and what is summed out leaves its children coupled. After a few steps every
# cell is coupled to every other one that a chain of arrows connects with it. (The field says that the belief becomes
# **entangled**.)
#
# ## Three questions about the same chain
#
# Before we approximate, let us be clear about what is asked. A cell is FREE or OCCUPIED. The *filter* (lecture 01)
# answers "what is it now?", with the scans up to now. The *smoother* answers "what was it then?", with all scans. And
# *Viterbi's path* answers "what is the most probable story?". On any chain, all three are messages on one graph:

# %%
M = np.array([[0.95, 0.05], [0.1, 0.9]])  # from FREE, from OCCUPIED, in one step
SAYS_HIT = np.array([0.15, 0.7])  # P(hit | FREE), P(hit | OCCUPIED)
scans = [int(letter == "x") for letter in "..x...xxx.x.xxx....."]
T = len(scans)
factors = [Factor("m0", [0.5, 0.5])]
factors += [Factor((f"m{t - 1}", f"m{t}"), M) for t in range(1, T)]
factors += [Factor((f"m{t}", f"z{t}"), np.stack([1 - SAYS_HIT, SAYS_HIT], axis=1)) for t in range(T)]
chain, given = directed(factors), {f"z{t}": z for t, z in enumerate(scans)}
told = sum_product(chain, given)
smooth = np.array([told.marginals[f"m{t}"][1] for t in range(T)])
forward = [told.messages[f"m{t}", f"P(m{t + 1} | m{t})"][1] for t in range(T - 1)] + [smooth[-1]]
story = [max_product(chain, given)[f"m{t}"] for t in range(T)]

# %% jupyter={"source_hidden": true} alt="probability of occupied over twenty steps with hits as crosses: the filter jumps at each hit and sags at each gap; the smoother stays below one half until step 5, is high from step 6 to 14 through the gaps, and falls at 15; the most probable path is a single block from step 6 to 14"
fig, ax = plt.subplots(figsize=(7.5, 2.8), layout="constrained")
ax.step(range(T), story, where="mid", color="0.75", linewidth=6, label="most probable path")
ax.plot(forward, "o-", color="#d55e00", label="filter")
ax.plot(smooth, "s-", color="#0072b2", label="smoother")
hits = np.flatnonzero(scans)
ax.plot(hits, np.full(len(hits), 1.08), "kx", label="hit")
ax.set(xlabel="step", ylabel="P(OCCUPIED)", ylim=(-0.05, 1.15), xticks=range(0, T, 2))
fig.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False, fontsize=9)
plt.show()
assert story == [0] * 6 + [1] * 9 + [0] * 5
assert (round(forward[2], 2), round(smooth[2], 1)) == (0.45, 0.3)
assert min(smooth[6:15]) > 0.5 > max(*smooth[:6], *smooth[15:])
assert forward[6] < 0.5 < 0.8 < smooth[6]
assert forward[15] > 0.5 > 0.35 > smooth[15]

# %% [markdown]
# At step 2 a single hit raises the filter to 0.45. The smoother knows that nothing followed, and says 0.3. At step 6 it is
# the other way round: the filter still doubts what the smoother knows. At 15 the filter still says occupied, with 0.70,
# where the smoother says free. The path gives one block, from 6 to 14. It doesn't say how sure it is.
#
# A vehicle can't wait for the end of the drive, but it may wait for a moment. A smoother that uses the scans up to a few
# steps later, always the same number, is called a **fixed-lag smoother**; exercise 01 asks for one.
#
# Smoothing needs beliefs about pairs of slices. So a filter that has thrown couplings away has thrown away what a
# smoother would need. From here on we ask for the filter only.
#
# ## Factored: assumed-density filtering
#
# Keep a product of one small table per cell. Each step makes it a joint table with couplings; then go back to the
# nearest product. This is **assumed-density filtering**: the belief is assumed to have a certain form, and is brought
# back to that form (*projected*) after each step. Which product is the nearest? Measure by the Kullback-Leibler
# divergence from the joint belief $P$ to the product $r$:
#
# $$ D(P \,\|\, r) = \sum_{m} P(m) \log \frac{P(m)}{r_1(m_1) \cdots r_K(m_K)} $$
#
# By hand, for two cells: the sum splits into $-\sum_{m_1} P(m_1) \log r_1(m_1)$, the same for cell 2, and a constant.
# Each part is smallest when $r_k$ equals the marginal $P(m_k)$. So the nearest product is that of the **marginals**,
# which is table B. The divergence that is left is called the mutual information. For A and B it is $\log 2$ = 0.69
# nats: knowing one cell tells which of two cases the other is in.

# %% jupyter={"source_hidden": true}
kept = exact > 0
mutual = np.sum(exact[kept] * np.log(exact[kept] / factored[kept]))
np.testing.assert_allclose(mutual, np.log(2))
rng = np.random.default_rng(0)
for a, b in rng.uniform(0.05, 0.95, size=(200, 2)):  # no other product is nearer
    other = np.outer([1 - a, a], [1 - b, b])
    assert np.sum(exact[kept] * np.log(exact[kept] / other[kept])) >= mutual

# %% [markdown]
# A step consists of prediction and update. So there are two moments at which one may project, before the scan or after
# it. `whole_step` predicts and updates jointly, then projects. `twice` projects after the prediction already, so that the
# scan must update each cell by itself.

# %% jupyter={"source_hidden": true} alt="three rows of boxes: exact, predict then update, always a joint table; whole step, predict, update, then project after the scan; twice, predict, project before the scan, then update cell by cell; solid arrows carry a joint table, dashed arrows one table per cell"
FILTERS = {
    "exact": (("predict", 1), None, ("update", 3), None),
    "whole step": (("predict", 1), None, ("update", 3), ("project", 4)),
    "twice": (("predict", 1), ("project", 2), ("update\ncell by cell", 3), None),
}
fig, ax = plt.subplots(figsize=(8, 2.9), layout="constrained")
for y, (name, boxes) in zip((2, 1, 0), FILTERS.items(), strict=True):
    ax.text(-0.1, y, name, ha="right", va="center", fontsize=10)
    x, joint = 0.0, name == "exact"
    for text, at in [box for box in boxes if box] + [("", 5)]:
        style = {"ls": "-", "color": "black", "lw": 1.5} if joint else {"ls": "--", "color": "#d55e00", "lw": 1.5}
        ax.annotate("", (at - 0.36 * bool(text), y), (x, y), arrowprops={"arrowstyle": "->", **style})
        colour = "#f4c9a8" if text == "project" else "0.92"
        ax.text(at, y, text, ha="center", va="center", fontsize=9, bbox={"fc": colour, "pad": 5} if text else None)
        x, joint = at + 0.36, joint if text.startswith("update") else text == "predict" or name == "exact"
ax.plot([2.5, 2.5], [-0.4, 2.4], ":", color="0.6")
ax.text(2.5, 2.5, "the scan arrives", ha="center", fontsize=9)
for style, label in (("-", "a joint table"), ("--", "one table per cell")):
    ax.plot([], [], style, color="black" if style == "-" else "#d55e00", label=label)
ax.legend(loc="lower center", bbox_to_anchor=(0.5, -0.2), ncols=2, frameon=False, fontsize=9)
ax.set(xlim=(-1.1, 5.1), ylim=(-0.5, 2.7))
ax.set_axis_off()
plt.show()


# %% tags=["assumed-density"]
def as_cells(belief):
    """Return a product of beliefs (K, 5) as the first cells of a row."""
    return tuple({s.name.lower(): float(p) for s, p in zip(Cell, row, strict=True) if s != Cell.FREE} for row in belief)


def whole_step(world, belief, scan):
    """Predict and update the joint table, then keep the marginals."""
    return exact_beliefs(replace(world, cells=as_cells(belief), scans=(scan,)))[0]


def twice(world, belief, scan):
    """Predict the joint table and keep the marginals; then update each cell by itself."""
    belief = whole_step(world, belief, NOT_SEEN * len(scan))
    first_sight = np.array([*world.first_sight, 0, 0])
    says = hit_probability(world.params.world.sensor)
    for k, letter in enumerate(scan):
        if letter != NOT_SEEN:
            belief[k] = (belief[k] + belief[k, Cell.UNKNOWN] * first_sight) * (np.arange(5) != Cell.UNKNOWN)
            belief[k] *= says[:, int(letter == HIT)] / (belief[k] @ says[:, int(letter == HIT)])
    return belief


# %%
def assumed_density(world, step):
    """Return the beliefs (T, K, 5) of a filter that keeps a product."""
    beliefs = [world.belief]
    for scan in world.scans:
        beliefs.append(step(world, beliefs[-1], scan))
    return np.array(beliefs[1:])


# %% [markdown]
# **Predict before you run.** The scans show the thing driving: `.x..`, `..x.`, `...x`. After the first scan the exact
# filter gives cell 1 a probability of 0.97 of being free. Which of the two ways comes closer to it? And which of them,
# do you think, is BOF?
#
# <details><summary>Answer</summary>
#
# The projection after the whole step: the scan of cell 2 says that the thing has left cell 1, and it can say so only as
# long as the two cells are coupled. `twice` has forgotten this coupling just before the scan arrives. BOF stores a grid after
# the prediction and updates cell by cell, so it is `twice`. The table has one more surprise.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
WORLDS = {
    "stands or drives": STANDING_OR_DRIVING,
    "at the edge": AT_THE_EDGE,
    "left or right": LEFT_OR_RIGHT,
    "head on": HEAD_ON,
    "towards a fence": TOWARDS_A_FENCE,
}
print(f"{'largest error in a cell':<20}{'whole step':>12}{'twice':>9}{'BOF':>9}")
worst = {}
for name, world in WORLDS.items():
    ways = assumed_density(world, whole_step), assumed_density(world, twice), bof_beliefs(world)
    worst[name] = [total_variation(beliefs, exact_beliefs(world)).max() for beliefs in ways]
    print(f"{name:<20}{worst[name][0]:12.3f}{worst[name][1]:9.3f}{worst[name][2]:9.3f}")
by_scan = assumed_density(STANDING_OR_DRIVING, twice)
np.testing.assert_allclose(by_scan, bof_beliefs(STANDING_OR_DRIVING), atol=1e-6)
by_step = total_variation(bof_beliefs(TOWARDS_A_FENCE), exact_beliefs(TOWARDS_A_FENCE)).max(axis=1)
np.testing.assert_allclose(by_step, 0.13, atol=0.005)
assert max(errors[0] for errors in worst.values()) < 0.02
assert worst["stands or drives"][1] > 0.25
assert round(exact_beliefs(STANDING_OR_DRIVING)[0, 0, Cell.FREE], 2) == 0.97
assert max(worst["head on"][1], worst["towards a fence"][1], *worst["at the edge"]) < 1e-6
assert min(worst["head on"][2], worst["towards a fence"][2]) > 0.1

# %% [markdown]
# In these worlds, the moment of the projection matters more than the projection itself. After the whole step the largest
# error of all five worlds is 0.011; after the prediction it is 0.274. In the first world, `twice` and BOF agree to six
# digits, so the moment explains all of BOF's error there. In a real grid nobody can update jointly, because all cells
# depend on each other. But the first and the third row show what a scan is worth if it is used before the
# coupling is forgotten. ("At the edge" there is nothing to lose: the thing drives to the right or leaves the row, so two
# cells never share it.)
#
# The surprise is in the last two rows. There, projecting costs nothing, and BOF errs all the same: it computes even the
# marginals of the *prediction* in an approximate way. It adds what two cells send as if only one could ("head on"), and
# it doesn't tell a cell that its neighbour is blocked ("towards a fence").
#
# In short, **BOF is assumed-density filtering**, with one product over cells, projected twice in each step, plus a
# simplified rule for things that meet. No amount of computing time removes its error, because nothing in it is random.
# How many things does the grid hold after the first scan? The exact answer is 1:

# %%
for name, beliefs in (("exact", exact_beliefs(STANDING_OR_DRIVING)), ("BOF", bof_beliefs(STANDING_OR_DRIVING))):
    print(f"{name:<6} expected number of things after each scan", expected_things(beliefs).round(2))

# %% [markdown]
# ## Sampled: importance sampling
#
# The other way out is to keep no table at all, but a set of possible worlds. Take the ring road of lecture 01. Draw $N$
# places from the prior, ask each how probable the reading is there, and use that number as its **weight**. This is
# **importance sampling**: we draw from one distribution (the prior), want another one (the posterior), and correct the
# difference by weights. A sample with its weight is a **particle** $q$:
#
# $$ P(n_t = n \mid z_t) \approx \sum_{i:\, q_i = n} w_i, \qquad w_i = \frac{P(z_t \mid q_i)}{\sum_j P(z_t \mid q_j)} $$
#
# By hand: ten particles, one in each cell, and the sensor says *pole*. Three have 0.8, seven have 0.1, and the sum is
# 3.1. So a particle beside a pole weighs 0.26, as Bayes' rule said. How many particles are really at work? The
# **effective sample size** $1 / \sum_i w_i^2$ is $N$ when all weigh the same, and 1 when one has everything. Here it is
# $1 / (3 \cdot 0.258^2 + 7 \cdot 0.032^2)$ = 4.8.
#
# Over time, each particle moves at random and its weights multiply. That goes wrong: after some steps a few particles,
# which were lucky, have nearly all the weight. So we **resample**: draw $N$ particles with probabilities equal to the
# weights, and let all weigh the same again. Here is the whole **particle filter**:

# %% tags=["particle-filter"]
N_CELLS, POLES, MOVED = 10, [2, 3, 7], [0.1, 0.8, 0.1]
P_POLE = np.where(np.isin(np.arange(N_CELLS), POLES), 0.8, 0.1)
SENSOR = np.array([1 - P_POLE, P_POLE])
assert round(P_POLE.sum() ** 2 / np.sum(P_POLE**2), 1) == 4.8  # ten particles, by hand
READINGS = np.isin(np.arange(25), [2, 3, 4, 9, 15, 18, 23, 24]).astype(int)  # a trip on lecture 01's ring road


def particle_filter(n, rng, resample=True):
    """Return the belief after each reading, and the effective sample size before resampling."""
    place, weight = rng.integers(N_CELLS, size=n), np.full(n, 1 / n)
    beliefs, sizes = [], []
    for says in READINGS:
        place = (place + rng.choice(3, size=n, p=MOVED)) % N_CELLS
        weight = weight * SENSOR[says, place]
        weight /= weight.sum()
        beliefs.append(np.bincount(place, weight, N_CELLS))
        sizes.append(1 / np.sum(weight**2))
        if resample:
            place, weight = rng.choice(place, size=n, p=weight), np.full(n, 1 / n)
    return np.array(beliefs), np.array(sizes)


# %% [markdown]
# **Predict before you run.** Take 1000 particles and 25 readings. How many are at work at the end without resampling,
# and with it? And if you take 100 times as many particles, by how much does the error fall?
#
# <details><summary>Answer</summary>
#
# Without resampling about two; with it several hundred, and at no step fewer than 300. The error of an average of $N$
# independent draws falls like $1/\sqrt{N}$, so 100 times as many particles make it 10 times smaller. Resampling makes
# particles dependent, but the law stays.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
ring = bayes_on_a_line(steps=25)
messages = sum_product(ring.model, {f"z{t}": int(z) for t, z in enumerate(READINGS)})
exact_ring = np.array([messages.messages[f"n{t}", f"P(n{t + 1} | n{t})"] for t in range(24)])
NUMBERS = (10, 100, 1000, 10000)


def mean_error(n, resample, seeds=10):
    """Return the root mean square error of all probabilities."""
    runs = [particle_filter(n, np.random.default_rng(seed), resample)[0][:24] for seed in range(seeds)]
    return np.sqrt(np.mean((np.array(runs) - exact_ring) ** 2))


errors = {resample: [mean_error(n, resample) for n in NUMBERS] for resample in (False, True)}
at_work = {resample: particle_filter(1000, np.random.default_rng(0), resample)[1] for resample in (False, True)}

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, effective sample size of 1000 particles over 25 steps on a logarithmic axis: with resampling it stays between 400 and 1000, without it falls to about 2; right, error against number of particles on logarithmic axes: with resampling along a line of slope minus one half, without it hardly larger for 10 particles and more than three times for 10,000"
fig, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
for resample, style, label in ((True, "o-", "with resampling"), (False, "s--", "without")):
    axes[0].plot(at_work[resample], style, markersize=4, label=label)
    axes[1].plot(NUMBERS, errors[resample], style, label=label)
axes[1].plot(NUMBERS, errors[True][0] * np.sqrt(NUMBERS[0] / np.array(NUMBERS)), ":", color="0.4", label="$N^{-1/2}$")
axes[0].set(xlabel="step", ylabel="effective sample size", yscale="log", title="1000 particles")
axes[1].set(xlabel="number of particles N", ylabel="error of a probability", xscale="log", yscale="log")
for ax in axes:
    ax.legend(fontsize=9, frameon=False)
plt.show()
slope = np.polyfit(np.log(NUMBERS), np.log(errors[True]), 1)[0]
assert at_work[False][-1] < 3 < 300 < at_work[True].min()
assert -0.6 < slope < -0.4
assert errors[False][-1] > 3 * errors[True][-1]

# %% [markdown]
# The error of a sample is random, and it can be bought off with particles, at a poor rate. That is the opposite of
# BOF's error, which isn't random and stays.
#
# But a sample of *all* cells would need far more. Each particle would be a complete map, and there are $5^{55025}$ maps. A
# sample of any size that we can store hardly ever holds one that fits the whole scan. So sampling alone fails for the
# same reason for which the table did.
#
# ### Your turn: resample only when it must be
#
# A draw makes noise of its own, because by chance some particles are drawn twice and others not at all. So many filters
# resample only when the effective sample size has fallen below half of $N$. Copy `particle_filter` and change it so.
# Take 1000 particles and many seeds. In how many of the 25 steps does your filter resample, and how much smaller is its
# error? (`exact_ring` holds the exact beliefs of the first 24 steps, and `mean_error` compares with them.)
#
# <details><summary>Answer</summary>
#
# One line changes: `if 1 / np.sum(weight**2) < n / 2`. The filter resamples in seven steps, and its error is about 15 %
# smaller. After most readings the weights differ so little that a draw would bring nothing but its noise.
#
# </details>


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
def when_needed(n, rng):
    """Return the belief after each reading, and how often the filter has resampled."""
    place, weight = rng.integers(N_CELLS, size=n), np.full(n, 1 / n)
    beliefs, draws = [], 0
    for says in READINGS:
        place = (place + rng.choice(3, size=n, p=MOVED)) % N_CELLS
        weight = weight * SENSOR[says, place]
        weight /= weight.sum()
        beliefs.append(np.bincount(place, weight, N_CELLS))
        if 1 / np.sum(weight**2) < n / 2:
            place, weight, draws = rng.choice(place, size=n, p=weight), np.full(n, 1 / n), draws + 1
    return np.array(beliefs), draws


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
runs = [when_needed(1000, np.random.default_rng(seed)) for seed in range(300)]
draws = np.mean([draws for _, draws in runs])
error = np.sqrt(np.mean([(beliefs[:24] - exact_ring) ** 2 for beliefs, _ in runs]))
always = mean_error(1000, resample=True, seeds=300)
print(f"error {error:.4f} with {draws:.0f} draws, {always:.4f} with a draw in each of 25 steps")
assert 6.9 < draws < 7.1
assert 0.75 < error / always < 0.92

# %% [markdown]
# ## Both: Rao-Blackwell
#
# The way out is to sample as little as possible. Suppose that somebody may have taken the pole beside cell 7 away; let
# $e$ be 1 if it still exists. The unknowns are the path and $e$. We could sample both. But *given the path*, $e$ is one
# unknown with two states, and lecture 01 says how to update it exactly. So let each particle have a place $q$ and its own
# little belief about $e$. This is a **Rao-Blackwellised particle filter**: some variables are sampled, the rest is
# computed exactly given the sample. The theorem behind the name says that, for independent
# draws, this never makes an average worse. (Resampling makes draws dependent, so we also measure.) If an estimate $f$
# depends on what is sampled, $q$, and on the rest, then its mean given $q$ varies less than $f$ itself:
#
# $$ \operatorname{Var}\, \mathrm{E}[f \mid q] = \operatorname{Var} f - \mathrm{E}\,\operatorname{Var}[f \mid q]
# \;\le\; \operatorname{Var} f $$


# %% tags=["rao-blackwell"]
NO_POLE = np.where(np.isin(np.arange(N_CELLS), [2, 3]), 0.8, 0.1)
SAYS_POLE = np.array([NO_POLE, P_POLE])  # P("pole" | e, place): row e = 0 without the pole beside cell 7


def is_it_there(n, rng, exact):
    """Return P(e = 1) after each reading; each particle has a belief about e, certain unless `exact`."""
    place = rng.integers(N_CELLS, size=n)
    belief = np.full((n, 2), 0.5) if exact else np.eye(2)[rng.integers(2, size=n)]
    answers = []
    for says in READINGS:
        place = (place + rng.choice(3, size=n, p=MOVED)) % N_CELLS
        product = belief * (SAYS_POLE if says else 1 - SAYS_POLE)[:, place].T
        weight = product.sum(axis=1) / product.sum()  # P(z | this particle's past)
        belief = product / product.sum(axis=1, keepdims=True)
        answers.append(weight @ belief[:, 1])
        drawn = rng.choice(n, size=n, p=weight)
        place, belief = place[drawn], belief[drawn]
    return np.array(answers)


# %% jupyter={"source_hidden": true} alt="error of P(pole stands) against the number of particles on logarithmic axes: two parallel falling lines; the Rao-Blackwellised one lies about two and a half times lower"
both = np.full((2, N_CELLS), 0.5 / N_CELLS)
MOVE = np.array([sum(p * np.eye(N_CELLS)[(n + d) % N_CELLS] for d, p in enumerate(MOVED)) for n in range(N_CELLS)])
right = []
for says in READINGS:
    both = both @ MOVE * (SAYS_POLE if says else 1 - SAYS_POLE)
    both /= both.sum()
    right.append(both[1].sum())
SIZES = (30, 100, 300, 1000)
spread = np.array(
    [
        [
            np.sqrt(np.mean([(is_it_there(n, np.random.default_rng(s), exact) - right) ** 2 for s in range(40)]))
            for n in SIZES
        ]
        for exact in (False, True)
    ]
)
fig, ax = plt.subplots(figsize=(5.6, 3), layout="constrained")
ax.plot(SIZES, spread[0], "s--", label="place and pole sampled")
ax.plot(SIZES, spread[1], "o-", label="place sampled, pole computed")
ax.set(xlabel="number of particles N", ylabel="error of P(pole stands)", xscale="log", yscale="log")
ax.legend(fontsize=9, frameon=False)
plt.show()
gain = (spread[0] / spread[1]) ** 2
assert (gain > 4).all()

# %% jupyter={"source_hidden": true}
print("how many times more particles the plain filter needs:", ", ".join(f"{g:.0f}" for g in gain.round()))

# %% [markdown]
# To be as good, the plain filter needs several times as many particles, since variance falls like $1/N$. A particle
# whose $e$ was drawn at the start keeps it for ever, while one that carries a belief about $e$ goes on learning.
#
# **CMCDOT is built like this.** What moves is sampled: each particle has a place, a velocity and a weight. What stands,
# what is free and what is unknown is computed cell by cell, given the particles. That is the "conditional Monte Carlo"
# in its name. But its cells are also a product, as BOF's are, so it has both errors: the one that particles buy off, and
# the one that they don't. On lecture 03's row "left or right":

# %%
sampled = sampling_error(LEFT_OR_RIGHT, [100, 400, 1600], seeds=range(10))
print("particles            ", sampled.numbers)
print("error to BOF         ", sampled.to_bof.round(3))
print("error to the exact   ", sampled.to_exact.round(3))
print("BOF's error, the bias", round(sampled.bias, 3))
assert np.allclose(sampled.to_exact**2, sampled.bias**2 + sampled.to_bof**2, rtol=0.1)
assert sampled.to_bof[-1] < 0.3 * sampled.to_bof[0]

# %% [markdown]
# ### Play with it
#
# How few particles are enough on the ring road? (Without a running kernel there is no slider; the figure shows three
# settings.)


# %% jupyter={"source_hidden": true} tags=["nbval-ignore-output"]
def show(n, ax=None):
    """Draw the particle filter's belief over the trip."""
    belief, _ = particle_filter(n, np.random.default_rng(1))
    return belief_history(belief, ax).set_title(f"{n} particles", fontsize=10)


_ = interact(lambda n: (show(n), plt.show())[1], n=IntSlider(value=30, min=2, max=300))

# %% jupyter={"source_hidden": true} alt="three tables of belief over 25 steps: with 5 particles a few dark cells that jump; with 50 the diagonal stripes appear with noise; with 5000 they are smooth"
fig, axes = plt.subplots(1, 3, figsize=(10, 2.5), sharey=True, layout="constrained")
for ax, n in zip(axes, (5, 50, 5000), strict=True):
    show(n, ax)
    ax.label_outer()
fig.colorbar(axes[0].images[0], ax=axes, label="probability")
plt.show()

# %% [markdown]
# ## Which filter is which
#
# | filter | what it keeps | its error |
# |---|---|---|
# | exact | the joint table | none; $5^K$ numbers |
# | BOF | a product over cells (assumed density) | stays, however long you compute |
# | particle filter | a sample | random, falls like $N^{-1/2}$ |
# | CMCDOT | a sample of what moves, a product over cells for the rest | both |
#
# Trackers that keep a list of things have one more joint belief: which return came from which thing. To decide that is
# **data association**. With $k$ things and $k$ returns there are $k!$ answers, and trackers differ in what they keep of
# them: the best one, the marginals, or a few. A grid names no things. It asks *whether* something arrived in a cell, so
# it has nothing to associate. But it can't count, either: above, it held 1.24 things where there is one.
#
# ## Where this breaks
#
# Assumed density is good as long as what is seen makes up for what is forgotten. In the row above, scans see every cell
# and the number of things falls from 1.24 towards 1. Where nobody looks, nothing repairs it: "towards a fence" is wrong
# by 0.13 after each of its three steps.
#
# A sample breaks where it has no particles. If none is near the truth, weights only choose the best of the wrong ones, and
# after normalising nobody sees that all of them fitted badly. And resampling forgets: after some steps, all particles
# descend from a few ancestors. In `is_it_there` each belief about $e$ depends on the whole path of its particle, so for a
# pole that was passed long ago only these few paths count. That is why filters which compute a map per path (FastSLAM is one) have
# trouble with long loops. The four numbers above are from one trip of one length; they prove no general factor.
#
# ## In five lines
#
# 1. In a dynamic Bayesian network each slice is cheap, and the belief still becomes entangled.
# 2. Filter, smoother and Viterbi answer three different questions about one chain.
# 3. Assumed density: keep the marginals. In two of five worlds projecting after the prediction cost far more than after
#    the whole step, and in none did it cost less.
# 4. Importance sampling: weights correct for what was drawn. Without resampling a few particles get nearly
#    all the weight.
# 5. Rao-Blackwell: sample what you must and compute the rest. CMCDOT does so, within BOF's product of cells.
#
# ## Further reading
#
# - Murphy, *Dynamic Bayesian Networks: Representation, Inference and Learning*, PhD thesis, Berkeley 2002: all of this
#   page, and much more.
# - Boyen and Koller, *Tractable inference for complex stochastic processes*, UAI 1998: why the error of a factored
#   belief needn't grow for ever.
# - Minka, *A family of algorithms for approximate Bayesian inference*, PhD thesis, MIT 2001, chapter 3: assumed-density
#   filtering, and how to improve it.
# - Doucet, de Freitas, Murphy and Russell, *Rao-Blackwellised particle filtering for dynamic Bayesian networks*, UAI
#   2000.
# - Thrun, Burgard, Fox, *Probabilistic Robotics*, MIT Press 2005, chapters 4 and 13: particle filters, FastSLAM.
# - Bar-Shalom and Li, *Multitarget-Multisensor Tracking*, 1995: data association.
# - Lectures [03](../03_bof.ipynb) and [04](../04_cmcdot.ipynb), between which this page stands, and
#   [exercise 01](../exercises/01_bayes.ipynb), which asks for a smoother.

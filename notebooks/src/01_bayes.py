# %% [markdown]
# # 01 · Bayes' rule on a line: predict, update, repeat
#
# **In one sentence.** A belief is a row of numbers that sum to one, and a Bayes filter does two things to it, over
# and over: *predict* spreads it, because the world moves on, and *update* multiplies it by what was seen.
#
# **You will be able to**
# - do both steps by hand, and in ten lines of code;
# - read from a graph what a filter assumes, and which edge it cuts;
# - go back in time: smoothing, and the most likely path;
# - name four ways to make a filter sure and wrong;
# - turn the same two steps into the filter of one grid cell, with a transition matrix for any time step.
#
# **Prerequisites.** Lecture [00](00_tour.ipynb), its first stage; a row of numbers times a matrix; the exponential
# function.
#
# **Time.** 75 minutes, of which the computer needs a few seconds.
#
# **Paper.** Section 3.2, steps 1 to 3, for a single cell: prediction by a transition matrix, update by a sensor
# model, estimate.

# %% jupyter={"source_hidden": true}
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from filterpy import discrete_bayes
from IPython.display import Markdown
from ipywidgets import FloatSlider, interact

from semgrid_edu import plotting
from semgrid_edu.datasets.samples import real_drive, sample_drive
from semgrid_edu.fast import track_drive
from semgrid_edu.graphical import Factor, GraphicalModel, d_separated, draw, in_rows
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import CmcdotParams, Evidence, FilterState, Particles, PlanarMotion, SensorModel, State
from semgrid_edu.occupancy import scan_evidence, transition_matrix
from semgrid_edu.occupancy import update as update_grid
from worlds.lecture_00_ledger import ledger, ledger_table
from worlds.lecture_01_line import bayes_on_a_line, filtered, most_likely_path, smoothed
from worlds.lecture_01_lines import belief_history, probability_lines, state_history

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI

# %% [markdown]
# ## Where is the vehicle?
#
# A vehicle drives round a ring road of ten cells. Poles stand beside three of them: a pair at **A**, beside cells 2
# and 3, and a single one at **B**, beside cell 7. A sensor looks to the side and says *pole* or *nothing*. It errs: it
# says *pole* with probability 0.8 beside a pole, and with probability 0.1 elsewhere. The map is known. Where is the
# vehicle? Here is what a filter believes over 25 readings. Each bar is the probability of a cell; a bar of one half
# reaches the dotted circle. The orange circle is the vehicle, which the filter can't see.

# %% jupyter={"source_hidden": true}
POLES = [2, 3, 7]
N_CELLS = 10
P_POLE = np.where(np.isin(np.arange(N_CELLS), POLES), 0.8, 0.1)  # P("pole" | cell), for each cell
TRIP = [0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 9, 0, 1, 2, 3, 5, 6, 7, 8, 9, 0, 1, 2, 3]  # drawn at random, see below
SAYS_POLE = [2, 3, 4, 9, 15, 18, 23, 24]  # the steps at which the sensor says "pole"


def draw_ring(ax, belief, place, title):
    """Draw a belief as bars around the ring, the poles as triangles and the vehicle as a circle."""
    ax.clear()
    for radius, style in ((1, "-"), (1.5, ":")):
        ax.add_patch(plt.Circle((0, 0), radius, fill=False, color="0.8", linestyle=style, zorder=0))
    for n, b in enumerate(belief):
        x, y = np.sin(2 * np.pi * n / N_CELLS), np.cos(2 * np.pi * n / N_CELLS)
        ax.plot([x, x * (1 + b)], [y, y * (1 + b)], color="#0072b2", linewidth=14, solid_capstyle="butt")
        ax.text(0.85 * x, 0.85 * y, n, ha="center", va="center", fontsize=9)
        ax.plot(*((0.65 * x, 0.65 * y, "k^") if n in POLES else ([], [])), markersize=9)
        ax.plot(*((x, y) if n == place else ([], [])), "o", ms=14, mfc="none", color="#d55e00", mew=3)
    for letter, at in {"A": (0.38, 0.0), "B": (-0.36, -0.2)}.items():
        ax.text(*at, letter, fontsize=14, fontweight="bold", ha="center", va="center")
    ax.set(xlim=(-1.9, 1.9), ylim=(-1.9, 1.9), aspect="equal")
    ax.set_title(title, fontsize=11)
    ax.set_axis_off()


# %% jupyter={"source_hidden": true} alt="animation of ten cells in a circle with a bar at each; after two readings of pole in a row the bars gather at A and from then on follow the vehicle round the ring; at step 7 they are one cell ahead"
def ring_frames():
    """Draw the ring twice per step: after the prediction, and after the reading."""
    ax = plt.subplots(figsize=(3.9, 4.1), layout="constrained")[1]
    belief = np.full(N_CELLS, 1 / N_CELLS)
    for k, place in enumerate(TRIP):
        prior = discrete_bayes.predict(belief, offset=1, kernel=[0.1, 0.8, 0.1])
        belief = discrete_bayes.update(P_POLE if k in SAYS_POLE else 1 - P_POLE, prior)
        draw_ring(ax, prior, place, f"step {k}: predict")
        yield ax.figure
        ax.figure.set_layout_engine("none")  # only the first frame is laid out
        draw_ring(ax, belief, place, f'step {k}: sensor says "{"pole" if k in SAYS_POLE else "nothing"}"')
        yield ax.figure


plotting.animate(ring_frames(), period=0.7, alt="a belief follows a vehicle round a ring road of ten cells")

# %% [markdown]
# At first all ten bars are alike. Two readings of *pole* in a row fit the pair at A best, so the bars gather there, and
# from then on they mostly follow the vehicle. By the end of this page you will have written this filter.
#
# ## The graph
#
# What does such a filter assume? Draw every unknown and every reading as a circle. $n_t$ is the place at step $t$,
# $z_t$ the reading there. An arrow goes to each variable from those that it depends on directly:

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a row of four places n0 to n3, an arrow from each to the next; below each place the shaded reading z, with an arrow from the place to it; a dashed line from n2 back to n1 marks the edge that the filter cuts"
line = bayes_on_a_line()
line.draw(plt.subplots(figsize=(6.5, 2.4), layout="constrained")[1], highlight=["n1"])
plt.show()

# %% [markdown]
# The place depends on the last place, because the vehicle drives on. The reading depends on the place alone. Readings
# are shaded because we observe them. A model in which the same slice, here a place and its reading, repeats over time
# is a **dynamic Bayesian network**. If its slice has one hidden state, as here, it is a **hidden Markov model**.
#
# What matters are the edges that aren't there. Two variables are **conditionally independent** given a third if, once
# you know the third, one tells nothing more about the other.
#
# **Predict before you run.** You want to know $n_2$. Does the first reading $z_0$ help, as long as you don't know any
# place? Does it still help if somebody tells you $n_1$? And which variables must you know so that nothing else tells
# you anything about $n_1$ (ringed)?
#
# <details><summary>Answer</summary>
#
# It helps: $z_0$ tells something about $n_0$, and so about $n_1$ and $n_2$. Once $n_1$ is known it doesn't: all that
# the past can tell about the future, it tells through the present. The variables that shield $n_1$ from all others are
# $n_0$, $n_2$ and $z_1$. They are called its **Markov blanket**: a variable's parents, its children, and the other
# parents of its children.
#
# </details>

# %% jupyter={"outputs_hidden": true}
assert not d_separated(line.model, "n2", "z0")
assert d_separated(line.model, "n2", "z0", given="n1")
assert d_separated(line.model, "n1", ["n3", "z0", "z2", "z3"], given=["n0", "n2", "z1"])
print("z0 tells about n2:", not d_separated(line.model, "n2", "z0"))
print("z0 tells about n2 once n1 is known:", not d_separated(line.model, "n2", "z0", given="n1"))

# %% [markdown]
# `d_separated` reads this from the graph alone (the companion [graphical models](deeper/graphical_models.ipynb) has its
# rule). The second answer is why a filter can forget: a belief about $n_1$ is all that it has to keep of $z_0$ and
# $z_1$.
#
# The dashed line is an edge that the filter **cuts**. A reading at step 2 also tells something about step 1, but a
# filter never goes back. Every stage of this course cuts edges in order to be affordable. We keep a **ledger** of
# them: which edge, and what it costs. The two numbers on the dashed line are its price: how often the most probable
# place is the right one, exactly and with the filter.
#
# ## One reading: update
#
# The **belief** $b_t(n)$ is the probability that the vehicle is in cell $n$ at step $t$. You know nothing yet, so it is
# 0.1 for each of the ten cells. Now the sensor says *pole*.
#
# **Predict before you run.** What do you believe of cell 3 now, and of cell 5? There are only two different products:
# write them down, add up all ten, divide.
#
# <details><summary>Answer</summary>
#
# Beside a pole 0.1 · 0.8 = 0.08, three times; elsewhere 0.1 · 0.1 = 0.01, seven times. They sum to 0.31. So cell 3 gets
# 0.08 / 0.31 = 0.26 and cell 5 gets 0.01 / 0.31 = 0.03.
#
# </details>
#
# This is Bayes' rule:
#
# $$ P(n \mid z_t) = \frac{P(z_t \mid n)\; b(n)}{P(z_t)}, \qquad P(z_t) = \sum_{n'} P(z_t \mid n')\; b(n') $$
#
# The belief $b$ before the reading is the **prior**, $P(z_t \mid n)$ the **likelihood**, the result the **posterior**:
# the new belief.


# %% tags=["update"] jupyter={"outputs_hidden": true}
def update(likelihood, prior):
    """Return the posterior: multiply cell by cell, then divide by the sum."""
    product = [p * b for p, b in zip(likelihood, prior, strict=True)]
    return np.array(product) / sum(product)


nothing_known = np.full(N_CELLS, 1 / N_CELLS)
one_reading = update(P_POLE, nothing_known)
np.testing.assert_allclose(one_reading, discrete_bayes.update(P_POLE, nothing_known))
print("cell 3: {:.3f}   cell 5: {:.3f}".format(*one_reading[[3, 5]]))

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="three rows of ten bars: the prior is 0.10 everywhere; the likelihood of pole is 0.80 in cells 2, 3 and 7 and 0.10 elsewhere; the posterior is 0.26 in those three cells and 0.03 elsewhere"
probability_lines({"prior": nothing_known, "likelihood of 'pole'": P_POLE, "posterior": one_reading})
plt.show()

# %% [markdown]
# The assertion compares our function with `filterpy`, a library for filters: its `discrete_bayes` has both steps,
# and you have just written one.
#
# Look at the middle row: it doesn't sum to one, and needn't. A likelihood is not a belief. It answers ten *what if*
# questions: if the vehicle were here, how probable was it that the sensor says what it said? The sum below the
# fraction, $P(z_t) = 0.31$, is how probable the reading was altogether. It only normalises, but keep an eye on it: when
# it is tiny, the reading contradicts what the filter believed.
#
# ## The vehicle drives on: predict
#
# The odometer says: one cell forward. Odometers err too: with probability 0.1 the vehicle hasn't left its cell, with
# 0.8 it has moved by one, with 0.1 by two.
#
# **Predict before you run.** The belief has three peaks of 0.26, in cells 2, 3 and 7, and 0.03 elsewhere. What is it
# in cell 3 after the move? Ask from where one can get there: from 2, from 3 and from 1.
#
# <details><summary>Answer</summary>
#
# From 2 by one: 0.8 · 0.26 = 0.206. From 3, not moved: 0.1 · 0.26 = 0.026. From 1 by two: 0.1 · 0.03 = 0.003. Together
# 0.24. Nothing needs to be normalised: what leaves one cell arrives in another.
#
# </details>
#
# With $P(d)$ for the probability of moving by $d$ cells:
#
# $$ P(n_t = n \mid z_0 \ldots z_{t-1}) = \sum_d P(d)\; b_{t-1}(n - d) $$
#
# A sum of this form is a *convolution*, and $P(d)$ is its kernel. On the ring road $n - d$ goes round.

# %% tags=["predict"] jupyter={"outputs_hidden": true}
MOVED = np.array([0.1, 0.8, 0.1])  # by 0, 1, 2 cells


def predict(belief, moved):
    """Return the belief after a move: for each cell, from where could the vehicle have come?"""
    after = np.zeros(len(belief))
    for n in range(len(belief)):
        for d, p in enumerate(moved):
            after[n] += p * belief[(n - d) % len(belief)]
    return after


moved_on = predict(one_reading, MOVED)
np.testing.assert_allclose(moved_on, discrete_bayes.predict(one_reading, offset=1, kernel=MOVED))
print(f"cell 3: {moved_on[3]:.3f}   sum: {moved_on.sum():.3f}")

# %% [markdown]
# After the move the sensor says *pole* again. Two poles in neighbouring cells: that fits the pair at A best.

# %% jupyter={"source_hidden": true} alt="three rows of ten bars: after one reading 0.26 in cells 2, 3 and 7; after the move the same one cell to the right and blunter; after the second reading 0.55 in cell 3 and less than 0.2 elsewhere"
two_readings = update(P_POLE, moved_on)
probability_lines(
    {"after one reading": one_reading, "after the move": moved_on, "after the second reading": two_readings}
)
plt.show()

# %% [markdown]
# The middle row is the upper one, one cell to the right and blunter. In the lower row cell 3 has 0.55:
# neither reading could tell 2, 3 and 7 apart, but their order in time could. **This is why a filter needs the
# prediction:** it carries what was seen there and then to here and now.
#
# ## Repeat, and count the bits
#
# The rest is repetition. To see it work we need a vehicle that really errs as the model says, so `trip` (folded here)
# draws one at random: that of the animation. The filter doesn't see the places, only the readings.


# %% jupyter={"source_hidden": true}
def trip(steps, rng, poles=POLES, moved=MOVED, hit=0.8):
    """Return the places of a random trip, and whether the sensor says "pole" at each."""
    moves = rng.choice(3, size=steps, p=moved)
    places = (rng.integers(N_CELLS) + np.cumsum(moves)) % N_CELLS
    says_pole = rng.random(steps) < np.where(np.isin(places, poles), hit, 0.1)
    return places, says_pole


# %%
def entropy(belief):
    """Return the uncertainty of a belief in bits; what is impossible adds nothing."""
    possible = belief[belief > 0]
    return -np.sum(possible * np.log2(possible))


# %% [markdown]
# The **entropy** $S = -\sum_n b(n) \log_2 b(n)$ counts uncertainty in bits: 0 when one cell has everything, 1 for two
# cells in balance, $\log_2 10 = 3.3$ for ten.
#
# **Predict before you run.** One of the two steps can never lower the entropy on this road. Which one? And is it true
# that the other can never raise it?
#
# <details><summary>Answer</summary>
#
# Prediction never lowers it: each new number is a mean of old ones, so peaks get lower and holes fill up. Update lowers
# it usually, but not always: a reading that contradicts what you believed leaves you with two explanations instead of
# one. A surprise can make you less sure, and rightly so. (Where a road ends at a wall, even prediction can lower the
# entropy, because in time every vehicle stands at the wall.)
#
# </details>

# %% jupyter={"outputs_hidden": true}
places, says_pole = trip(25, np.random.default_rng(2))
belief, history, bits, surprises = nothing_known, [], [], []
for k, says in enumerate(says_pole):
    prior = predict(belief, MOVED)
    if says != (prior.argmax() in POLES):
        surprises.append(k)
    belief = update(P_POLE if says else 1 - P_POLE, prior)
    history.append(belief)
    bits += [entropy(prior), entropy(belief)]

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="above, the belief over 25 steps as a table of ten cells, with the true places as circles along its dark diagonal stripes; below, the entropy, which goes up with every prediction and mostly down with every update, between 1.0 and 3.3 bits"
np.testing.assert_array_equal(places, TRIP)
np.testing.assert_array_equal(np.flatnonzero(says_pole), SAYS_POLE)
fig, axes = plt.subplots(2, 1, figsize=(7, 4.2), sharex=True, layout="constrained")
belief_history(np.array(history), ax=axes[0], truth=places).set(xlabel="")
fig.colorbar(axes[0].images[0], ax=axes, label="probability", shrink=0.46, anchor=(0, 1))
axes[1].plot(np.repeat(np.arange(25), 2) + np.tile([-0.25, 0.0], 25), bits, "-", color="0.6")
axes[1].plot(np.arange(25) - 0.25, bits[::2], "o", color="#0072b2", markersize=4, label="after predict")
axes[1].plot(bits[1::2], "s", color="#d55e00", markersize=4, label="after update")
axes[1].set(xlabel="step", ylabel="entropy [bits]", ylim=(0, 3.8))
axes[1].legend(fontsize="small", ncols=2, frameon=False)
plt.show()
raised = [k for k in range(25) if bits[2 * k + 1] > bits[2 * k]]
assert surprises == [2, 4, 8, 14, 16, 18]
assert raised == [k for k in surprises if not says_pole[k]] == [8, 14, 16]
assert all(bits[2 * k + 1] < bits[2 * k] for k in range(25) if k not in raised)
assert all(bits[2 * k] >= bits[2 * k - 1] for k in range(1, 25))
favourite = np.argmax(history, axis=1)
assert favourite[3] == 3 != places[3] == 2
assert (favourite == places)[4:7].all()
assert favourite[7] == 6 != places[7] == 5

# %% [markdown]
# Above, the darker the surer, and circles are the truth. Below, the entropy goes up with every prediction (circles) and
# mostly down with every update (squares). At step 3 the sensor has said *pole* twice in a row. That fits the pair at A,
# so the filter takes the vehicle to be in cell 3. But the vehicle hasn't moved and is still in cell 2, beside the same
# pole. One step later it is in cell 3, and the filter is right. But nothing is settled for good, because the next
# prediction takes away much of what an update gains: at step 7 the filter is one cell ahead again.
#
# Six readings are surprises: not what the favourite cell made one expect. At steps 8, 14 and 16 the sensor says
# *nothing* where a pole was expected, and these three updates raise the entropy. At steps 2, 4 and 18 it says *pole*
# where none was expected. Poles are rare, so such a reading leaves few cells, and the entropy falls all the same.
#
# *Mostly* down can be made exact. Take two cells, one without a pole (belief 0.8), one with (0.2). Here *pole* is a
# surprise that raises the entropy. How often may that happen before the average goes up?

# %% jupyter={"source_hidden": true}
prior, p_pole = np.array([0.8, 0.2]), np.array([0.1, 0.8])
after = [entropy(update(likelihood, prior)) for likelihood in (1 - p_pole, p_pole)]
print(f"before {entropy(prior):.2f} bits; after 'nothing' {after[0]:.2f}, after 'pole' {after[1]:.2f}")
for name, share in (("P(pole) = 0.24, as the model says", p_pole @ prior), ("0.68", 0.68), ("0.80", 0.8)):
    print(f"if 'pole' comes with {name}: {(1 - share) * after[0] + share * after[1]:.2f} bits on average")
limit = (entropy(prior) - after[0]) / (after[1] - after[0])
assert abs(limit - 0.684) < 0.001
assert limit > p_pole @ prior

# %% [markdown]
# One reading may confuse you, but on average readings make you surer, as long as they come as often as the model says,
# here *pole* in 24 of 100 cases. If the model is wrong, even that fails: should *pole* come in more than 68 of 100
# cases, a reading raises the entropy on average.
#
# ## Witnesses: a fork
#
# The vehicle stands still and the sensor reads twice: *pole*, *nothing*. Does it matter which came first?
# Multiplication says no. So evidence that belongs to one instant may come in any order, or all at once, as one
# product. But why may we multiply at all? Because of a missing edge again. Two readings of one place are a **fork**:

# %% jupyter={"source_hidden": true} alt="left, a fork: a place n with arrows to two readings z0 and z1; right, the same with a bug e that has arrows to both readings as well"
fork_parents = {"z0": ("n",), "z1": ("n",)}
bug_parents = {"z0": ("n", "e"), "z1": ("n", "e")}


def graph_of(parents):
    """Return a model of a graph whose tables don't matter."""
    roots = dict.fromkeys(name for above in parents.values() for name in above)
    names = {**dict.fromkeys(roots, ()), **parents}
    factors = [Factor((*above, name), np.full([2] * (len(above) + 1), 0.5)) for name, above in names.items()]
    return GraphicalModel(factors, parents)


fork, bug = graph_of(fork_parents), graph_of(bug_parents)
fig, axes = plt.subplots(1, 2, figsize=(6, 2), layout="constrained")
readings = ["z0", "z1"]
draw(fork, axes[0], observed=readings, positions=in_rows(["n"], readings))
draw(bug, axes[1], observed=readings, positions=in_rows(["n", "e"], readings))
axes[0].set_title("two witnesses", fontsize=10)
axes[1].set_title("the same bug behind both", fontsize=10)
plt.show()

# %%
one_way = update(1 - P_POLE, update(P_POLE, nothing_known))
other_way = update(P_POLE, update(1 - P_POLE, nothing_known))
np.testing.assert_allclose(one_way, other_way)
np.testing.assert_allclose(one_way, update(P_POLE * (1 - P_POLE), nothing_known))
assert not d_separated(fork, "z0", "z1")  # a first "pole" makes a second more likely ...
assert d_separated(fork, "z0", "z1", given="n")  # ... but not once the place is known
assert not d_separated(bug, "z0", "z1", given="n")

# %% [markdown]
# On the left the readings are conditionally independent given the place: they err separately, so
# $P(z_0, z_1 \mid n) = P(z_0 \mid n)\,P(z_1 \mid n)$, and each counts. On the right something else, $e$, disturbs both, and
# the product is wrong.
#
# **Predict before you run.** A bug delivers the same reading, *pole*, twice. What does the filter believe of the
# three cells with poles: 0.26 each, as it should, or what else?
#
# <details><summary>Answer</summary>
#
# 0.8² = 0.64 against 0.1² = 0.01, as if the sensor were that good: 0.064 three times, 0.001 seven times, sum 0.199. So
# 0.32 each: the poles have 96 % instead of 77 %. The filter is sure of something that it has not seen.
#
# </details>

# %% jupyter={"outputs_hidden": true}
twice = update(P_POLE, one_reading)
np.testing.assert_allclose(twice, update(P_POLE**2, nothing_known))
print(f"on the three cells with poles: once {one_reading[POLES].sum():.2f}, counted twice {twice[POLES].sum():.2f}")

# %% [markdown]
# Predict and update don't commute. A reading speaks of where the vehicle is *now*. Used before the move is taken into
# account, it speaks of the wrong cells:

# %% jupyter={"source_hidden": true}
right = update(P_POLE, predict(one_reading, MOVED))
wrong = predict(update(P_POLE, one_reading), MOVED)
print(f"cell 3: predict, then update {right[3]:.2f};  update, then predict {wrong[3]:.2f}")

# %% [markdown]
# ## What a zero does
#
# **Predict before you run.** You are certain: the vehicle is in cell 5, $b(5) = 1$. There is no pole there, and the
# sensor says *pole* ten times. What do you believe now? What if you had started with 0.999 instead, and the rest on
# cell 7?
#
# <details><summary>Answer</summary>
#
# Still 1: the other nine cells have 0, and 0 times anything is 0. However absurd the readings, certainty can't be
# corrected. With 0.999 against 0.001 each reading multiplies the odds of cell 7 by 8, so 8⁴ = 4096 turns them round:
# four readings.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
certain, nearly = np.eye(N_CELLS)[5], np.zeros(N_CELLS)
nearly[[5, 7]] = 0.999, 0.001
for reading in range(1, 11):
    certain, nearly = update(P_POLE, certain), update(P_POLE, nearly)
    if reading in (3, 4, 10):
        print(f"{reading:2d} readings: certain {certain[5]:.3f}, nearly certain {nearly[5]:.3f} of cell 5")

# %% [markdown]
# And if the sensor's model holds a zero, *pole* is impossible in cell 5, the product is zero everywhere, and the
# result is 0/0. So we put **no zeros into sensor models, and let the prediction leak a little to everywhere.** The
# package refuses a sensor that never errs, and its update answers 0/0 with *nothing is known any more*.
#
# Computers make zeros of their own, because floating-point numbers end at about $10^{-308}$: the product of 500
# likelihoods of 0.1 is 0. A filter that normalises at each step is safe, since only ratios matter. Where products get
# long, one adds logarithms instead: lecture 02 builds a whole map of them.
#
# ## Looking back: the future, and what cutting it costs
#
# After the first reading, *pole*, the filter gave 0.26 to each of the cells 2, 3 and 7. One step later it heard *pole*
# again. That says something about the first step too, and the filter never uses it: this is the dashed edge. How would
# one use it?
#
# Ask each cell: if the vehicle was there at step 0, how probable was the second *pole*? From cell 2 it stays with 0.1,
# or goes to 3 with 0.8, or to 4 with 0.1, so 0.1 · 0.8 + 0.8 · 0.8 + 0.1 · 0.1 = 0.73. From cell 3 it is 0.1 · 0.8 +
# 0.8 · 0.1 + 0.1 · 0.1 = 0.17, and the same from 7. This is a likelihood like any other, so update with it: cell 2
# rises from 0.26 to 0.55, and cells 3 and 7 fall to 0.13. A belief that uses the readings before *and* after is called
# **smoothed**.
#
# With more steps, write $\beta_t(n)$ for the probability of all readings after step $t$ if the vehicle is in cell $n$.
# It is computed backward from the last step, where $\beta = 1$:
#
# $$ P(n_t = n \mid \text{all } z) \propto b_t(n)\, \beta_t(n), \qquad
# \beta_{t-1}(n) = \sum_{d} P(d)\; P(z_t \mid n + d)\; \beta_t(n + d) $$

# %% tags=["smooth"]
SENSOR = np.array([1 - P_POLE, P_POLE])  # rows "nothing", "pole"
MOVE = np.array([predict(place, MOVED) for place in np.eye(N_CELLS)])  # row i: where a vehicle in cell i will be


def smooth(history, says_pole):
    """Return the belief in each place given all readings; `history` holds the filter's beliefs."""
    back, beliefs = np.ones(N_CELLS), []
    for belief, says in zip(history[::-1], says_pole[::-1], strict=True):
        beliefs.append(update(back, belief))
        back = MOVE @ (SENSOR[int(says)] * back)
        back = back / back.sum()  # only ratios matter
    return np.array(beliefs[::-1])


by_hand = smooth([one_reading, two_readings], [True, True])[0]
print("step 0, cells 2, 3 and 7: filter", one_reading[POLES].round(2), " smoothed", by_hand[POLES].round(2))

# %% [markdown]
# There is a third question: which *path* is the most probable one? That isn't the row of the most probable places,
# because neighbours in that row need not fit together. Carry along, for each cell, the best path that ends there. It
# consists of the best path to some cell before, and one move. This is the algorithm of **Viterbi**: the filter with a
# maximum in place of the sum.


# %% tags=["viterbi"]
def best_path(says_pole):
    """Return the most probable path as a whole, given all readings (Viterbi)."""
    log_p, came_from = np.log(nothing_known), []
    for says in says_pole:
        ways = log_p[:, None] + np.log(np.maximum(MOVE, 1e-300))  # from each cell to each cell
        came_from.append(ways.argmax(axis=0))
        log_p = ways.max(axis=0) + np.log(SENSOR[int(says)])
    path = [log_p.argmax()]
    for before in came_from[:0:-1]:
        path.append(before[path[-1]])
    return np.array(path[::-1])


# %% jupyter={"source_hidden": true}
def log_probability(path, says_pole):
    """Return log P(path, readings), up to a constant."""
    moves = np.log(np.maximum(MOVE[path[:-1], path[1:]], 1e-300)).sum()
    return moves + np.log(SENSOR[np.array(says_pole, int), path]).sum()


stage = bayes_on_a_line(steps=25)
np.testing.assert_allclose(history, filtered(stage, says_pole), atol=1e-12)
np.testing.assert_allclose(smooth(history, says_pole), smoothed(stage, says_pole), atol=1e-12)
theirs = np.array(most_likely_path(stage, says_pole))
np.testing.assert_allclose(log_probability(best_path(says_pole), says_pole), log_probability(theirs, says_pole))

# %% [markdown]
# A folded cell compares filter and smoother with the package's exact inference on the graph: they agree to $10^{-12}$,
# and the package's best path is as probable as ours. On the graph, $b$ and $\beta$ are **messages** that run forward
# and backward along the chain. The filter sends only the forward ones.
#
# **Predict before you run.** Over 400 random trips of 30 steps each, how often do filter, smoother and best path name
# the right cell? Which of the three is right most often?
#
# <details><summary>Answer</summary>
#
# The smoother. It knows more than the filter, and by its very definition it names, for each step, the most probable
# cell. The best path also knows all readings, but it maximises something else: the probability of being right at all
# steps together. The filter comes last.
#
# </details>


# %% jupyter={"source_hidden": true, "outputs_hidden": true} tags=["future-cut"]
def localise(says_pole, sensor=SENSOR, moved=MOVED):
    """Return the filter's belief after each reading; `sensor` holds the likelihoods of "nothing" and of "pole"."""
    belief, history = nothing_known, []
    for says in says_pole:
        belief = update(sensor[int(says)], predict(belief, moved))
        history.append(belief)
    return np.array(history)


rng = np.random.default_rng(0)
trips = [trip(30, rng) for _ in range(400)]
names = "filter", "smoother", "best path"
right, fits = np.zeros((2, 3))
for places, says_pole in trips:
    history = localise(says_pole)
    rows = [history.argmax(axis=1), smooth(history, says_pole).argmax(axis=1), best_path(says_pole)]
    right += [np.mean(row == places) / len(trips) for row in rows]
    fits += [np.mean(np.diff(row) % N_CELLS <= 2) / len(trips) for row in rows]
for name, r, f in zip(names, right, fits, strict=True):
    print(f"{name:<10} right {100 * r:.1f} %   steps that the odometer allows {100 * f:.1f} %")
assert right[0] < 0.46 < 0.53 < right[2] < 0.55 < 0.58 < right[1]
assert fits[0] < 0.9 < fits[1] < 0.98 < fits[2] > 1 - 1e-9

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three tables of belief over 25 steps of one trip with the true places as circles: the filter's is blurred at first and one cell off at several steps; the smoother's is sharper, above all in the first steps; the best path is a single cell per step that follows the truth but for a few steps"
fig, axes = plt.subplots(1, 3, figsize=(11, 2.8), sharey=True, layout="constrained")
heard = np.isin(np.arange(25), SAYS_POLE)
seen = localise(heard)
path = np.eye(N_CELLS)[best_path(heard)]
for ax, name, table in zip(axes, names, (seen, smooth(seen, heard), path), strict=True):
    row = table.argmax(axis=1)
    belief_history(table, ax, truth=np.array(TRIP)).set_title(
        f"{name}: right in {np.sum(row == TRIP)} of 25 steps", fontsize=10
    )
    ax.label_outer()
fig.colorbar(axes[0].images[0], ax=axes, label="probability (circle: truth)")
plt.show()

# %% [markdown]
# This is the price of the cut edge: the filter is right in 45 % of the steps, the smoother in 59 %. For the *present*
# place nothing is lost, because at the last step both are the same belief. So a vehicle that must act now pays nothing,
# and a map that is made afterwards pays. The best path is right less often than the smoother, but it is the only one of
# the three rows that the odometer allows at each step: the filter's favourites make an impossible jump in one of ten
# steps.
#
# The picture shows the trip of the animation. Compare the first steps: when the filter hears the two poles at A, it
# is too late to correct what it said before. The line in the ledger:

# %% jupyter={"source_hidden": true}
Markdown(ledger_table(ledger("line")))

# %% [markdown]
# `n1 <- n2` stands for every step. This line isn't counted but computed: it adds up all possible readings of a trip of
# six steps. Over 30 steps both numbers are higher, because there is more past and more future to listen to.
#
# ## Turn the problem round
#
# So far the map was known and the place was not. A LIDAR on a vehicle with good odometry has the opposite problem:
# its place is known, the *map* isn't. So ask, for **one cell** of the ground: is it FREE or OCCUPIED? Let $m^t$ be its
# state at scan $t$. Two hypotheses instead of ten, and the same two steps.
#
# A beam that **passes** the cell has probability 0.7 if the cell is free, and 0.3 if it is occupied (bushes are
# porous). A beam that **comes back** from it has 0.05 if it is free (grazing rays) and 0.8 if it is occupied.
#
# By hand it is easier with odds, P(OCCUPIED) : P(FREE). Start with 1. Two beams pass: 3/7 = 0.43, then 9/49 = 0.18.
# Then one comes back, which multiplies by 0.8/0.05 = 16: 2.94. As probabilities of OCCUPIED: 0.30, 0.16, 0.75. One
# return outweighs two passes. (0.3 and 0.8 sum to more than one. They needn't fit together: of each pair only the ratio
# counts, so a pair may be scaled as you like.)

# %% jupyter={"source_hidden": true}
PASS, HIT = np.array([0.7, 0.3]), np.array([0.05, 0.8])  # P(z | FREE), P(z | OCCUPIED)
belief, heard = np.array([0.5, 0.5]), []
for likelihood in (PASS, PASS, HIT):
    belief = update(likelihood, belief)
    heard.append(belief[1])
np.testing.assert_allclose(heard, [0.30, 0.16, 0.75], atol=5e-3)

# %% [markdown]
# Not a line of the code had to change. And predict? A cell doesn't move, but its *state* does: cars come and go. Say
# that, from one scan to the next, a free cell becomes occupied with probability 0.1, and an occupied one free with
# 0.2. These numbers form a **transition matrix** $M$: $M_{ij}$ is the probability to go *from* $i$ *to* $j$, so its
# **rows** sum to one, here 0.9, 0.1 and 0.2, 0.8. The prediction is $\sum_i b_{t-1}(i)\, M_{ij}$: the belief is a row
# that stands to the left. By hand: FREE 0.6, OCCUPIED 0.4 becomes FREE 0.6 · 0.9 + 0.4 · 0.2 = 0.62.


# %%
def predict_states(belief, M):
    """Return the belief after a transition, literally."""
    after = np.zeros(len(belief))
    for i, j in np.ndindex(M.shape):
        after[j] += belief[i] * M[i, j]
    return after


print(predict_states(np.array([0.6, 0.4]), np.array([[0.9, 0.1], [0.2, 0.8]])).round(2))
np.testing.assert_allclose(predict_states(one_reading, MOVE), predict(one_reading, MOVED))

# %% [markdown]
# The last line says that the ring road was nothing else: a convolution is a transition matrix whose rows are one
# kernel, shifted. A matrix is more general: each state may have its own way to change.
#
# ## A matrix for any time step
#
# You tuned $M$ for a LIDAR with 10 scans a second. The new one makes 20. If you leave $M$ as it is, the filter forgets
# twice as fast, because in each tenth of a second $M$ is applied twice. The matrix belongs to a time step. What belongs
# to the world are *rates*: how often per second does a free cell become occupied?
#
# Give the rates $R_{ij}$ from state $i$ to $j$, in 1/s. In a very short time $\epsilon$ the belief changes by
# $\epsilon\, b R$ (the diagonal of $R$ is what leaves, so rows of $R$ sum to zero). With two states we can solve this.
# A free cell becomes occupied at the rate $\alpha$, an occupied one free at the rate $\gamma$. Let $b$ be the
# belief in OCCUPIED. It gains $\alpha (1 - b)$ a second and loses $\gamma b$. Both balance at
# $b_\infty = \alpha / (\alpha + \gamma)$, and the difference to it decays exponentially:
#
# $$ b(t) = b_\infty + \left(b(0) - b_\infty\right) e^{-(\alpha + \gamma)\, t} $$
#
# By hand: with $\alpha$ = 0.5 and $\gamma$ = 1.5 per second, $b_\infty$ = 0.25. After 0.1 s a share $e^{-0.2}$ = 0.82
# of the difference is left, so a cell that was surely occupied has 0.25 + 0.75 · 0.82 = 0.86.
#
# With more states there is no such short formula, but the same idea: cut the time step $\Delta t$, in the code `dt`,
# into many short ones:
#
# $$ M(\Delta t) = \lim_{k \to \infty} \left(I + R\,\frac{\Delta t}{k}\right)^{k} = \exp(R\,\Delta t) $$
#
# The filter of this course has four states: FREE, STATIC and DYNAMIC (the two kinds of occupied), and UNKNOWN, for
# what nobody has seen, or not lately. For this page:

# %% tags=["transition-matrix"]
RATES = (  # to FREE, STATIC, DYNAMIC, UNKNOWN, 1/s
    (0.0, 0.02, 0.2, 0.2),
    (0.02, 0.0, 0.02, 0.1),
    (1.0, 0.1, 0.0, 0.5),
    (0.0, 0.0, 0.0, 0.0),
)


def matrix_of(rates, dt, k=100_000):
    """Return M(dt), literally: k short steps in which hardly anything happens."""
    R = np.array(rates)
    R -= np.diag(R.sum(axis=1))
    return np.linalg.matrix_power(np.eye(len(R)) + R * dt / k, k)


two_states = matrix_of([[0, 0.5], [1.5, 0]], dt=0.1)
np.testing.assert_allclose(two_states[1, 1], 0.25 + 0.75 * np.exp(-0.2), atol=1e-6)
sensor = SensorModel(p_hit_occupied=0.8, p_hit_free=0.05, p_pass_occupied=0.3, p_pass_free=0.7)
params = CmcdotParams(rates=RATES, first_sight=(0.85, 0.14, 0.01), sensor=sensor)
M = transition_matrix(params, dt=0.1)
np.testing.assert_allclose(matrix_of(RATES, dt=0.1), M, atol=1e-6)
half = transition_matrix(params, dt=0.05)
np.testing.assert_allclose(half @ half, M)
print(M.round(3))

# %% [markdown]
# Read the first row: of what is free now, 96 % is still free at the next scan; 2 % has become dynamic, as something
# has driven in. `half @ half` is `M`: two half steps are one whole step, so the filter may run at any rate.
#
# The rates are *assumptions* about the world, like the sensor's numbers. What do they say of a cell that nobody looks
# at any more? Start with one that is surely STATIC, and one that is surely DYNAMIC:

# %% jupyter={"source_hidden": true} alt="two panels of stacked bands over ten seconds: after five seconds the STATIC cell is static by a half, and most of the rest is UNKNOWN; of the DYNAMIC cell little is left after two seconds, FREE takes over at first and then UNKNOWN"
times = np.linspace(0, 10, 51)
fig, axes = plt.subplots(1, 2, figsize=(9, 2.4), sharey=True, layout="constrained")
for ax, state in zip(axes, (State.STATIC, State.DYNAMIC), strict=True):
    forgets = np.array([np.eye(4)[state] @ transition_matrix(params, t) for t in times])
    state_history(times, forgets.T, ax=ax).set_title(f"{state.name}, then out of sight")
axes[0].get_legend().remove()
axes[1].set_ylabel("")
plt.show()

# %% [markdown]
# A wall is remembered for a while. Of a moving thing one can say little after a second: it leaves the cell, and what
# comes next nobody knows. Memory of a thing should last as long as the thing stays. With four states a matrix can give
# walls and cars a memory each; with two it can't.
#
# ## One cell of the drive
#
# Now the drive. Over its 20 frames we watch four spots on the ground, given by x and y in the first frame:

# %% jupyter={"source_hidden": true} alt="map of the street from above with class colours and a legend; four circles with names: on the road ahead, at the front of a house on the right, on the lane on the left where a car will drive through, and further left behind that lane"
SPOTS = {
    "road": (18.25, -0.75),
    "front of a house": (33.25, -13.25),
    "a car drives through": (17.25, 2.75),
    "a passing car hides it": (20.25, 5.75),
}
spec, frames = GridSpec.compact(), list(sample_drive())
rows, cols, _ = spec.cells(np.array(list(SPOTS.values())))
start = frames[0].T_world_from_lidar
occupied, free = np.empty((2, len(frames), len(SPOTS)))
for k, frame in enumerate(frames):
    pose = PlanarMotion.from_poses(start, frame.T_world_from_lidar)
    evidence = scan_evidence(frame.points_grid, spec, sensor, pose)
    occupied[k], free[k] = evidence.occupied[rows, cols], evidence.free[rows, cols]

LABEL = {"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 1}
fig, ax = plt.subplots(figsize=(6.5, 5.6), layout="compressed")
plotting.grid_labels(spec, frames[0].labels.birdseye_on(spec), KITTI_14, ax=ax).set_ylim(5, 40)
for (name, (x, y)), place in zip(SPOTS.items(), ((24, -4), (-22, 9), (0, -20), (0, 9)), strict=True):
    ax.plot(y, x, "o", markersize=9, markerfacecolor="none", markeredgecolor="black", markeredgewidth=2)
    ax.annotate(name, (y, x), place, textcoords="offset points", ha="center", bbox=LABEL)
plt.show()

# %% [markdown]
# The map is the truth of the first frame, the circles are our spots. The car that will drive through one of them is
# still behind us.
#
# `scan_evidence` turns a scan into two likelihoods for each cell, P(z | occupied) and P(z | free), as in the toy case
# (lecture 02 shows how). Where a scan says nothing of a cell, they are equal. One letter per scan: `#` for a return,
# `.` for a beam that passes, a blank for nothing.

# %% jupyter={"source_hidden": true}
for name, o, f in zip(SPOTS, occupied.T, free.T, strict=True):
    print(f"{name:<24}{''.join('#' if a > b else '.' if a < b else ' ' for a, b in zip(o, f, strict=True))}")

# %% [markdown]
# UNKNOWN needs one more rule. It means that nobody has looked, so a cell that a scan says anything of isn't UNKNOWN
# any more: its share goes to the other three as cells are found at **first sight**. For this page we assume FREE 0.85,
# STATIC 0.14, DYNAMIC 0.01.
#
# **Predict before you run.** For two seconds the house gives returns, the car for four scans. A return is as probable
# from a parked car as from one that moves: STATIC and DYNAMIC share P(z | occupied). So can the filter of one cell
# ever tell them apart? If so, what does it know that the likelihood doesn't say?
#
# <details><summary>Answer</summary>
#
# Bayes' rule multiplies STATIC and DYNAMIC by the same number, so it never changes their proportion. That proportion
# comes from what we assume. By our rates, a free cell becomes DYNAMIC ten times as often as STATIC, so what appears in
# a free cell is called DYNAMIC. At first sight STATIC is fourteen times as frequent as DYNAMIC, so the house, which is
# there from the first scan, is called STATIC at once.
#
# </details>


# %%
def step(belief, occupied, free, assumed=params, update=update):
    """Return the belief of one cell after a time step and a scan: predict, first sight, update."""
    prior = predict_states(belief, transition_matrix(assumed, dt=0.1))
    if occupied != free:
        prior = prior + prior[State.UNKNOWN] * np.array([*assumed.first_sight, -1])
    return update([free, occupied, occupied, free], prior)


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
ONE_CELL = GridSpec(x_min=0, x_max=1, y_min=0, y_max=1, cell=1)


def step_of_package(belief, occupied, free):
    """Return the same by the package's update, which has the rule of first sight too, on a grid of one cell."""
    predicted = (belief @ M).reshape(4, 1, 1)
    state = FilterState(predicted, Particles.none(), newborn=predicted[State.DYNAMIC])
    scan = Evidence(np.full((1, 1), occupied), np.full((1, 1), free))
    return update_grid(state, ONE_CELL, scan, params).probability[:, 0, 0]


history = np.empty((len(frames), len(SPOTS), 4))
belief = np.tile([0.0, 0.0, 0.0, 1.0], (len(SPOTS), 1))  # UNKNOWN
for k, spot in np.ndindex(history.shape[:2]):
    before, scan = belief[spot].copy(), (occupied[k, spot], free[k, spot])
    belief[spot] = history[k, spot] = step(before, *scan)
    np.testing.assert_allclose(belief[spot], step(before, *scan, update=discrete_bayes.update))
    np.testing.assert_allclose(belief[spot], step_of_package(before, *scan), atol=1e-6)
assert min(history[0, 0, State.FREE], history[0, 1, State.STATIC]) > 0.9  # road and house, first scan

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="four panels of stacked bands over two seconds: the road is free throughout; the house static throughout; the car's cell is free, mostly dynamic for four scans with a band of static, then free again after three scans; the hidden cell's free band shrinks while it is hidden and comes back"
times = [frame.time - frames[0].time for frame in frames]
fig, axes = plt.subplots(2, 2, figsize=(9, 4.6), sharex=True, sharey=True, layout="constrained")
for ax, name, cell in zip(axes.ravel(), SPOTS, history.transpose(1, 2, 0), strict=True):
    state_history(times, cell, ax=ax).set_title(name)
    ax.label_outer()
    if ax is not axes[0, 1]:
        ax.get_legend().remove()
plt.show()
car, hidden = list(SPOTS).index("a car drives through"), list(SPOTS).index("a passing car hides it")
hits = np.flatnonzero(occupied[:, car] > free[:, car])
assert len(hits) == 4
assert (history[hits, car, State.DYNAMIC] > history[hits, car, State.STATIC]).all()
assert (np.diff(history[hits, car, State.STATIC]) > 0).all()
assert (history[hits[-1] + 1 : hits[-1] + 3, car, State.FREE] < 0.5).any()
assert (history[hits[-1] + 4 :, car, State.FREE] > 0.5).all()
blind = np.flatnonzero(occupied[:, hidden] == free[:, hidden])
assert (np.diff(history[blind, hidden, State.FREE]) < 0).all()
assert history[blind[-1] + 1, hidden, State.UNKNOWN] < 1e-9
assert history[blind[-1] + 1, hidden, State.DYNAMIC] > 0.03 > 0.02 > history[-1, hidden, State.DYNAMIC]

# %% [markdown]
# Each picture is one cell over two seconds, each band as high as its state is probable. At its first scan the road is
# free and the house STATIC, both above 0.9. For the house that is the prior of first sight, not a prediction: the
# rates have had no time to act. Below on the left the car is there within one scan and mostly DYNAMIC: the right
# answer, for the reason that you have predicted. It isn't ten to one, though, for two reasons. A little STATIC was
# left over from before. And the prediction forgets a little of the free cell at each step; what it forgets becomes
# UNKNOWN, and is shared out anew by the rule of first sight, where standing things are more frequent than moving ones.
# From return to return the STATIC band grows, because by our rates a moving thing leaves a cell sooner than a standing
# one. When the car has left, the cell needs a few scans to believe it; remember that for the next lecture. On the
# right the belief fades while the car hides the cell: grey grows, because we forget, and orange, because something may
# have driven in unseen. When the cell is seen again, grey is gone at once and orange within a few scans.
#
# `step` agrees with `filterpy` and with the package to six digits.
#
# ### How much of this rests on one rate?
#
# On this page a free cell turns DYNAMIC at a rate of 0.2 a second: that is the number behind *ten times*. The
# package's default is 0.01. So change this one number, filter the car's cell again, and look at its last return. Then
# take all of the package's defaults. Last, take the same cell from the package's whole filter, with the same defaults.

# %% jupyter={"source_hidden": true}
last = hits[-1]


def at_the_last_return(assumed):
    """Return P(STATIC) and P(DYNAMIC) of the car's cell at its last return."""
    belief = np.array([0.0, 0.0, 0.0, 1.0])
    for k in range(last + 1):
        belief = step(belief, occupied[k, car], free[k, car], assumed)
    return belief[[State.STATIC, State.DYNAMIC]]


shares = {}
for rate in (0.01, 0.05, 0.1, 0.2, 0.5):
    rates = np.array(RATES)
    rates[State.FREE, State.DYNAMIC] = rate
    shares[f"FREE to DYNAMIC at {rate} /s"] = at_the_last_return(replace(params, rates=tuple(map(tuple, rates))))
shares["the package's defaults"] = at_the_last_return(CmcdotParams())

# %% jupyter={"source_hidden": true}
moved = PlanarMotion.from_poses(start, frames[last].T_world_from_lidar)  # a straight road: hardly a turn
x, y = SPOTS["a car drives through"]
(row,), (col,), _ = spec.cells(np.array([[x - moved.dx, y - moved.dy]]))
whole_filter = list(track_drive(frames[: last + 1], spec))[-1].probability[:, row, col]
print(f"{'the car, at its last return':<34}STATIC  DYNAMIC")
for name, (static, dynamic) in shares.items():
    print(f"{name:<34}{static:6.2f}{dynamic:9.2f}")
print("{:<34}{:5.1f}{:9.1f}".format("the whole filter, its defaults", *whole_filter[[State.STATIC, State.DYNAMIC]]))
assert abs(moved.dyaw) < 0.01
assert shares["the package's defaults"][0] > 0.7
assert abs(np.subtract(*shares["FREE to DYNAMIC at 0.1 /s"])) < 0.05
assert whole_filter[State.DYNAMIC] > 0.9

# %% [markdown]
# In one cell by itself, the verdict on the car rests on that rate. At 0.1 a second the two are level. With the
# package's defaults the same returns say STATIC, 0.80 to 0.20. Yet the package's whole filter calls this cell DYNAMIC
# (last row). It can, because its cells aren't alone: the car comes from a neighbouring cell, which predicts it. So the
# rates are not what tells moving from standing in the end. Lectures 03 and 04 show what does.
#
# ## Play with it
#
# Back to the ring road. Two sliders: `hit`, how often the sensor says *pole* beside a pole, and `slip`, how probable
# it is that the vehicle moves by less or more than one cell. When does the filter keep track? (Without a running
# kernel there are no sliders; the figure below them shows four settings.)


# %% jupyter={"source_hidden": true} tags=["nbval-ignore-output"]
def one_trip(hit, slip, rng):
    """Return the places of a trip of 40 steps, and the beliefs of a filter that knows sensor and odometry."""
    moved = np.array([slip / 2, 1 - slip, slip / 2])
    places, says_pole = trip(40, rng, moved=moved, hit=hit)
    p_pole = np.where(np.isin(np.arange(N_CELLS), POLES), hit, 0.1)
    return places, localise(says_pole, [1 - p_pole, p_pole], moved)


def show(hit, slip, ax=None):
    """Draw a trip of 40 steps, and what a filter believes that knows sensor and odometry; return places, favourites."""
    places, history = one_trip(hit, slip, np.random.default_rng(6))
    right = 100 * np.mean(history.argmax(axis=1) == places)
    ax = belief_history(history, ax, truth=places)
    ax.set_title(f"hit {hit:.2f}, slip {slip:.2f}: right in {right:.0f} %", fontsize="medium")
    return places, history.argmax(axis=1)


sliders = {"hit": FloatSlider(value=0.8, min=0.1, max=0.99, step=0.01), "slip": FloatSlider(value=0.2, min=0, max=0.9)}
_ = interact(lambda hit, slip: (show(hit, slip), plt.show())[1], **sliders)

# %% jupyter={"source_hidden": true} alt="four tables of belief over 40 steps: with the numbers of this page blurred stripes that mostly follow the truth; with a good sensor and good odometry sharp stripes on the truth from step 5 on, but for a slip at step 12; with a good sensor and bad odometry blurred stripes, sharp only near poles; with a bad sensor and good odometry pale stripes beside each other, of which one follows the truth"
fig, axes = plt.subplots(2, 2, figsize=(9, 4.6), sharex=True, sharey=True, layout="constrained")
SETTINGS = {"C": (0.8, 0.2), "D": (0.99, 0.02), "E": (0.99, 0.6), "F": (0.3, 0.02)}
shown = {}
for ax, (letter, setting) in zip(axes.ravel(), SETTINGS.items(), strict=True):
    shown[letter] = show(*setting, ax)
    ax.set_title(f"{letter}  {ax.get_title()}", fontsize="medium")
    ax.label_outer()
fig.colorbar(axes[0, 0].images[0], ax=axes, label="probability (circle: truth)")
plt.show()
places, favourites = shown["D"]
np.testing.assert_array_equal(np.flatnonzero(places[5:] != favourites[5:]) + 5, [12, 13])

# %% jupyter={"source_hidden": true}
rng, rates = np.random.default_rng(0), {}
for letter, setting in SETTINGS.items():
    rates[letter] = np.mean(
        [np.mean(b.argmax(axis=1) == at) for at, b in (one_trip(*setting, rng) for _ in range(200))]
    )
    print(f"{letter}: right in {100 * rates[letter]:.0f} % of the steps of 200 trips")
assert rates["D"] > 0.8 > 0.5 > rates["C"] > rates["E"] > rates["F"] > 0.2

# %% [markdown]
# In D, with a good sensor and good odometry, the place is known once the pair at A has been seen, at step 5. The vehicle
# slips at step 12; the filter notices two steps later, when it expects the pole beside cell 2 and the sensor says
# *nothing*. E is the same good sensor with bad odometry: most cells have no pole, and between poles only the odometer
# speaks. F is a bad sensor, which misses seven of ten poles, with good odometry: it follows the vehicle, but can't tell
# for long which of several places it is in. On this trip it is lucky. Over 200 trips these two are right in 36 and 30 %
# of the steps, where D is right in 87 %. At `hit` 0.1 the sensor says *pole* as often here as there, so it carries no
# information, and no filter can invent any.
#
# ## Where this breaks
#
# **Sure and wrong.** A filter says how sure it is, and that can be tested: over our 400 trips, take the belief that it
# gives to its favourite cell, and see how often the vehicle is there. If the two agree, the filter is called
# **calibrated**. Now break one assumption at a time.


# %% jupyter={"source_hidden": true}
def claims_and_truth(sensor, poles=POLES):
    """Return the mean belief in the favourite cell, and how often the vehicle is there, over 400 trips."""
    rng, claimed, right = np.random.default_rng(0), [], []
    for _ in range(400):
        places, says_pole = trip(30, rng, poles=poles)
        history = localise(says_pole, sensor)
        claimed.append(history.max(axis=1))
        right.append(history.argmax(axis=1) == places)
    return np.mean(claimed), np.mean(right)


measured = {
    "all as assumed": claims_and_truth(SENSOR),
    "sensor thought\nto err in 1 %": claims_and_truth(np.where(SENSOR > 0.5, 0.99, 0.01)),
    "each reading\ncounted twice": claims_and_truth(SENSOR**2),
    "a pole was moved\nfrom 7 to 8": claims_and_truth(SENSOR, poles=[2, 3, 8]),
}

# %% jupyter={"source_hidden": true} alt="pairs of bars, what the filter claims and how often it is right: as assumed 0.46 and 0.45; with the sensor thought to err in 1 per cent, readings counted twice, or a pole moved, the claim is higher than the truth by more than 0.1"
fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
at = np.arange(len(measured))
for shift, label, colour, values in zip(
    (-0.2, 0.2), ("it claims", "it is right"), ("#0072b2", "0.6"), np.transpose(list(measured.values())), strict=True
):
    ax.bar_label(ax.bar(at + shift, values, width=0.38, label=label, color=colour), fmt="%.2f", fontsize="small")
ax.set_xticks(at, measured)
ax.set(ylabel="probability", ylim=(0, 0.95))
ax.legend(ncols=2, fontsize="small", frameon=False)
plt.show()
(honest, is_honest), *broken = measured.values()
assert abs(honest - is_honest) < 0.02
assert all(claim > truth + 0.1 for claim, truth in broken)

# %% [markdown]
# The first pair agrees. In the other three the filter claims far more than it knows, and nothing in its belief shows
# it. Counting twice often comes in disguise. Ten returns of one scan from the same bush, or the same bush in ten
# scans, are not ten independent witnesses: they share an error, as in the right graph of the section on witnesses.
# That is why the package's sensor model lets only the first `max_returns` returns of a cell count, and its defaults
# are far from a perfect sensor.
#
# **A ghost.** The road has been free for two seconds. Now two grazing rays come back from it, and then beams pass
# again.

# %% jupyter={"source_hidden": true}
road = history[-1, list(SPOTS).index("road")]
two_returns = sensor.p_hit_occupied**2, sensor.p_hit_free**2
passes = sensor.p_pass_occupied, sensor.p_pass_free
for name, scan in (("two returns", two_returns), *[("pass", passes)] * 5):
    road = step(road, *scan)
    print(f"{name:<12}FREE {road[State.FREE]:.2f}  DYNAMIC {road[State.DYNAMIC]:.2f}")

# %% [markdown]
# For two scans the filter believes that something moves on the road. The cell can't know better: by our rates, what
# appears in a free cell is most probably DYNAMIC. Its neighbours could tell. Here are seven cells of one lane of a **real
# street**, watched from a standing vehicle for 1.8 s (PandaSet by Hesai and Scale AI, CC BY 4.0), in the letters from
# above:

# %% jupyter={"source_hidden": true}
LANE = ((27.25, 8.25), (24.75, 8.25), (22.25, 8.25), (19.75, 8.25), (17.25, 7.75), (15.25, 7.75), (13.25, 7.25))
street = list(real_drive())
at_rows, at_cols, _ = spec.cells(np.array(LANE))
said = []
for frame in street:
    pose = PlanarMotion.from_poses(street[0].T_world_from_lidar, frame.T_world_from_lidar)
    scan = scan_evidence(frame.points_grid, spec, sensor, pose)
    said.append(np.sign(scan.occupied - scan.free)[at_rows, at_cols])
said = np.array(said).T
for (x, _), letters in zip(LANE, said, strict=True):
    print(f"{x:5.2f} m ahead  {''.join('#' if a > 0 else '.' if a < 0 else ' ' for a in letters)}")
first = [np.flatnonzero(letters > 0)[0] for letters in said]
assert (np.diff(first) >= 0).all()
assert np.hypot(pose.dx, pose.dy) < 0.2  # our vehicle stands
speed = (LANE[0][0] - LANE[-1][0]) / (street[first[-1]].time - street[first[0]].time)
assert 12 < speed < 16

# %% [markdown]
# Each row by itself is a ghost of two scans. All rows together are a car that comes towards us at some 14 m/s: what
# turns up in one cell comes from the one before. One cell, filtered by itself, has no velocity. That is the subject
# of lectures 03 and 04; lecture [02](02_grids.ipynb) first puts thousands of such cells side by side.
#
# ## In five lines
#
# 1. A belief sums to one; a likelihood needn't. Posterior = prior times likelihood, divided by the sum.
# 2. Predict spreads; update sharpens on average, if the model is right. Predict first: a reading speaks of now.
# 3. Readings multiply because they are conditionally independent given the state; each piece counts once. Zeros can't
#    be corrected.
# 4. A filter is exact for now and cuts the future: smoothing gets it back, and Viterbi finds the best path.
# 5. A grid cell is filtered like a place on a road, with $M = \exp(R\,\Delta t)$. STATIC and DYNAMIC look alike to a
#    scan. A single cell tells them apart by first sight and by its rates; the whole filter by what its neighbours send.
#
# **You can now** filter and smooth any chain of states in ten lines, and say which edge a filter cuts.
#
# ## Further reading
#
# - Labbe, *Kalman and Bayesian Filters in Python*, chapter 2: [the discrete Bayes
#   filter](https://github.com/rlabbe/Kalman-and-Bayesian-Filters-in-Python), by `filterpy`'s author.
# - Thrun, Burgard, Fox, *Probabilistic Robotics*, MIT Press 2005, chapters 2 and 8: the filter in general, and
#   localisation on a map.
# - Rabiner, *A tutorial on hidden Markov models*, Proceedings of the IEEE 77(2), 1989: forward algorithm, backward
#   algorithm, Viterbi.
# - Norris, *Markov Chains*, Cambridge 1997, chapter 2: rates and $\exp(R\,\Delta t)$.
# - [Graphical models from nothing](deeper/graphical_models.ipynb), a companion to this course: the filter as one half
#   of message passing, and what a missing edge costs. [Time, factored and sampled
#   beliefs](deeper/time_beliefs.ipynb), a companion between 03 and 04: what to do when a belief has too many states.
#
# ## Exercise
#
# [Exercise 01](exercises/01_bayes.ipynb): a move on ice, a smoother that waits for a few scans, a matrix from counts,
# and a map put together from your own functions, as a stage of the pipeline.

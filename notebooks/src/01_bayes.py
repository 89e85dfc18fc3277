# %% [markdown]
# # 01 · Bayes' rule on a line: predict, update, repeat
#
# **In one sentence.** A belief is a row of numbers that sum to one, and a Bayes filter does two things to it, over
# and over: *predict* spreads it, because the world moves on, and *update* multiplies it by what was seen.
#
# **You will be able to**
# - do both steps by hand, and in ten lines of code;
# - say how sure a filter is, and test whether it is right to be so sure;
# - say when readings may be multiplied, and what a zero does;
# - tell two questions apart: what is it now, and what was it then;
# - turn the same two steps into the filter of one cell of a map, for any time step.
#
# **Prerequisites.** Lecture [00](00_tour.ipynb), its first stage; a row of numbers times a matrix; the exponential
# function.
#
# **Time.** 74 minutes, of which the computer needs a few seconds.
#
# **Paper.** Section 3.2, for a single cell: prediction by a transition matrix, update by a sensor model, estimate.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
from filterpy import discrete_bayes
from ipywidgets import FloatSlider, interact

from semgrid_edu import plotting
from worlds.lecture_01_line import bayes_on_a_line, filtered, smoothed
from worlds.lecture_01_lines import belief_history, probability_lines

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI

# %% [markdown]
# ## Where is the vehicle?
#
# A vehicle drives round a ring road of ten cells. Poles stand beside three of them: a pair at **A**, beside cells 2
# and 3, and a single one at **B**, beside cell 7. A sensor looks to the side and says *pole* or *nothing*. It errs: it
# says *pole* with probability 0.8 beside a pole, and with probability 0.1 elsewhere. The map is known. Where is the
# vehicle?
#
# Here is what a filter believes from reading to reading. Each bar is the probability of a cell; a bar of one half reaches the
# dotted circle. The orange circle is the vehicle, which the filter can't see.

# %% jupyter={"source_hidden": true}
POLES = [2, 3, 7]
N_CELLS = 10
P_POLE = np.where(np.isin(np.arange(N_CELLS), POLES), 0.8, 0.1)  # P("pole" | cell), for each cell
TRIP = [0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 9, 0, 1, 2, 3, 5, 6, 7, 8, 9, 0, 1, 2, 3]  # drawn at random, see below
SAYS_POLE = [2, 3, 4, 9, 15, 18, 23, 24]  # the steps at which the sensor says "pole"
AROUND = np.array([(np.sin(angle), np.cos(angle)) for angle in 2 * np.pi * np.arange(N_CELLS) / N_CELLS])  # x, y


def ring():
    """Draw the road and the poles; return what changes: the bars, the circle of the vehicle and the title."""
    ax = plt.subplots(figsize=(3.9, 4.1), layout="constrained")[1]
    for radius, style in ((1, "-"), (1.5, ":")):
        ax.add_patch(plt.Circle((0, 0), radius, fill=False, color="0.8", linestyle=style, zorder=0))
    bars = [ax.plot([], [], color="#0072b2", linewidth=14, solid_capstyle="butt")[0] for _ in range(N_CELLS)]
    for n, (x, y) in enumerate(AROUND):
        ax.text(0.85 * x, 0.85 * y, n, ha="center", va="center", fontsize=9)
    ax.plot(*(0.65 * AROUND[POLES].T), "k^", markersize=9)
    for letter, at in {"A": (0.38, 0.0), "B": (-0.36, -0.2)}.items():
        ax.text(*at, letter, fontsize=14, fontweight="bold", ha="center", va="center")
    (vehicle,) = ax.plot([], [], "o", ms=14, mfc="none", color="#d55e00", mew=3)
    ax.set(xlim=(-1.9, 1.9), ylim=(-1.9, 1.9), aspect="equal")
    ax.set_axis_off()
    return bars, vehicle, ax.set_title(" ", fontsize=11)


# %% jupyter={"source_hidden": true} alt="animation of ten cells in a circle with a bar at each; after two readings of pole in a row the bars gather at A and from then on follow the vehicle round the ring; at step 7 they are one cell ahead"
def ring_frames():
    """Show the ring twice per step: after the prediction, and after the reading."""
    bars, vehicle, title = ring()
    belief = np.full(N_CELLS, 1 / N_CELLS)
    for k, place in enumerate(TRIP[:16]):
        vehicle.set_data(*AROUND[[place]].T)
        prior = discrete_bayes.predict(belief, offset=1, kernel=[0.1, 0.8, 0.1])
        belief = discrete_bayes.update(P_POLE if k in SAYS_POLE else 1 - P_POLE, prior)
        said = "pole" if k in SAYS_POLE else "nothing"
        for shown, words in ((prior, "predict"), (belief, f'sensor says "{said}"')):
            for bar, (x, y), b in zip(bars, AROUND, shown, strict=True):
                bar.set_data([x, x * (1 + b)], [y, y * (1 + b)])
            title.set_text(f"step {k}: {words}")
            yield title.figure
            title.figure.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(ring_frames(), period=0.7, alt="a belief follows a vehicle round a ring road of ten cells")

# %% [markdown]
# At first all ten bars are alike. Two readings of *pole* in a row fit the pair at A best, so the bars gather there, and
# from then on they mostly follow the vehicle. So a sensor that can't tell one pole from another, and errs, is enough to
# find one's place. How, the next two sections show.
#
# ## What does one reading tell?
#
# The **belief** $b(n)$ is the probability that the vehicle is in cell $n$. You know nothing yet, so it is 0.1 for each
# of the ten cells. Now the sensor says *pole*.
#
# **Predict before you run.** What do you believe of cell 3 now, and of cell 5? There are only two different products:
# write them down, add up all ten, divide.
#
# <details><summary>Answer</summary>
#
# Beside a pole 0.1 · 0.8 = 0.08, elsewhere 0.1 · 0.1 = 0.01. Three of the first and seven of the second sum to 0.31. So
# cell 3 gets 0.08 / 0.31 = 0.26, and cell 5 gets 0.03.
#
# </details>
#
# This is **Bayes' rule**. With $z$ for the reading:
#
# $$ P(n \mid z) = \frac{P(z \mid n)\; b(n)}{\sum_{n'} P(z \mid n')\; b(n')} $$
#
# The belief $b$ before the reading is the **prior**, $P(z \mid n)$ the **likelihood**, the result the **posterior**:
# the new belief.


# %% tags=["update"] jupyter={"outputs_hidden": true}
def update(likelihood, prior):
    """Return the posterior: multiply cell by cell, then divide by the sum."""
    product = likelihood * prior
    return product / product.sum()


nothing_known = np.full(N_CELLS, 1 / N_CELLS)
one_reading = update(P_POLE, nothing_known)
np.testing.assert_allclose(one_reading, discrete_bayes.update(P_POLE, nothing_known))
print("cell 3: {:.2f}   cell 5: {:.2f}".format(*one_reading[[3, 5]]))

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="three rows of ten bars: the prior is 0.10 everywhere; the likelihood of pole is 0.80 in cells 2, 3 and 7 and 0.10 elsewhere; the posterior is 0.26 in those three cells and 0.03 elsewhere"
probability_lines({"prior": nothing_known, "likelihood of 'pole'": P_POLE, "posterior": one_reading})
plt.show()

# %% [markdown]
# The assertion compares our function with `filterpy`, a library for filters, whose `discrete_bayes` has both steps.
#
# The middle row doesn't sum to one, and needn't, because a likelihood isn't a belief. It answers ten *what if*
# questions: if the vehicle were here, how probable was it that the sensor says *pole*? The posterior sums to one.
#
# So a reading multiplies each cell by how well it explains the reading.
#
# ## What happens when the vehicle drives on?
#
# The odometer says: one cell forward. Odometers err too. With probability 0.1 the vehicle hasn't left its cell, with
# 0.8 it has moved by one, with 0.1 by two.
#
# **Predict before you run.** The belief is the posterior above. What is it in cell 3 after the move? Ask from where one
# can get there.
#
# <details><summary>Answer</summary>
#
# From the cell before, by one: 0.8 · 0.26 = 0.21. From cell 3 itself, not moved: 0.1 · 0.26 = 0.03. From two cells
# before hardly anything. Together 0.24. Nothing needs to be normalised: what leaves one cell arrives in another.
#
# </details>
#
# With $P(d)$ for the probability of moving by $d$ cells, and $n - d$ counted round the ring:
#
# $$ b(n) \;\leftarrow\; \sum_d P(d)\; b(n - d) $$
#
# A sum of this form is a **convolution**.


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
print(f"cell 3: {moved_on[3]:.2f}   sum: {moved_on.sum():.2f}")

# %% [markdown]
# After the move the sensor says *pole* again. Two poles in neighbouring cells: that fits the pair at A best.

# %% jupyter={"source_hidden": true} alt="three rows of ten bars: after one reading 0.26 in cells 2, 3 and 7; after the move the same one cell to the right and blunter; after the second reading 0.55 in cell 3 and less than 0.2 elsewhere"
two_readings = update(P_POLE, moved_on)
probability_lines(
    {"after one reading": one_reading, "after the move": moved_on, "after the second reading": two_readings}
)
plt.show()

# %% [markdown]
# The middle row is the upper one, one cell to the right and blunter. In the lower row cell 3 has 0.55. Neither reading
# could tell the poles apart, but their order in time could. And the order of the two steps matters: a reading is about
# where the vehicle is *now*, so predict first.
#
# So **prediction carries what was seen there and then to here and now**.
#
# ## How sure is the filter?
#
# The rest is repetition. To see it work we need a vehicle that errs as the model says, so `trip` (folded here) draws one
# at random: that of the animation. The filter gets the readings alone.


# %% jupyter={"source_hidden": true}
def trip(steps, rng, poles=POLES, moved=MOVED, hit=0.8):
    """Return the places of a random trip, and whether the sensor says "pole" at each."""
    moves = rng.choice(3, size=steps, p=moved)
    places = (rng.integers(N_CELLS) + np.cumsum(moves)) % N_CELLS
    says_pole = rng.random(steps) < np.where(np.isin(places, poles), hit, 0.1)
    return places, says_pole


# %% tags=["filter"]
SENSOR = np.array([1 - P_POLE, P_POLE])  # rows "nothing", "pole"


def localise(says_pole, sensor=SENSOR, moved=MOVED):
    """Return the belief after each reading."""
    belief, history = nothing_known, []
    for says in says_pole:
        belief = update(sensor[int(says)], predict(belief, moved))
        history.append(belief)
    return np.array(history)


def entropy(belief):
    """Return the uncertainty of a belief in bits."""
    possible = belief[belief > 0]
    return -np.sum(possible * np.log2(possible))


# %% [markdown]
# The **entropy** $-\sum_n b(n) \log_2 b(n)$ counts uncertainty in bits: 0 if one cell has everything, 1 for two cells
# in balance, 3.3 for ten.
#
# **Predict before you run.** One of the two steps can never lower the entropy on this road. Which one? And is it true
# that the other can never raise it?
#
# <details><summary>Answer</summary>
#
# Prediction never lowers it: each new number is a mean of old ones, so peaks get lower and holes fill up. Update mostly
# lowers it, but not always: a reading that contradicts what you believed leaves you with two explanations in place of
# one. A surprise can make you less sure, and rightly so.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="above, the belief over 25 steps as a table of ten cells, with the true places as circles along its dark diagonal stripes; below, the entropy, which goes up with every prediction and mostly down with every update, between 1.0 and 3.3 bits, with triangles at the steps 8, 14 and 16 where an update raises it"
places, says_pole = trip(25, np.random.default_rng(2))
np.testing.assert_array_equal(places, TRIP)
np.testing.assert_array_equal(np.flatnonzero(says_pole), SAYS_POLE)
history = localise(says_pole)
priors = [predict(belief, MOVED) for belief in (nothing_known, *history[:-1])]
before, after = (np.array([entropy(belief) for belief in beliefs]) for beliefs in (priors, history))
raised = np.flatnonzero(after > before)
fig, axes = plt.subplots(2, 1, figsize=(7, 4.2), sharex=True, layout="constrained")
belief_history(history, ax=axes[0], truth=places).set(xlabel="")
fig.colorbar(axes[0].images[0], ax=axes, label="probability", shrink=0.46, anchor=(0, 1))
axes[1].plot(np.repeat(np.arange(25), 2) + np.tile([-0.25, 0.0], 25), np.stack([before, after], 1).ravel(), color="0.6")
axes[1].plot(np.arange(25) - 0.25, before, "o", color="#0072b2", markersize=4, label="after predict")
axes[1].plot(after, "s", color="#d55e00", markersize=4, label="after update")
axes[1].plot(raised, after[raised] + 0.35, "kv", label="surprise")
axes[1].set(xlabel="step", ylabel="entropy [bits]", ylim=(0, 4.2))
axes[1].legend(fontsize=9, ncols=3, frameon=False, loc="upper right")
plt.show()
np.testing.assert_array_equal(raised, [8, 14, 16])
assert (before[1:] >= after[:-1]).all()
assert not says_pole[raised].any()
assert all(priors[k].argmax() in POLES for k in raised)

# %% [markdown]
# Above, darker is surer, and circles are the truth. Below, each prediction (blue) raises the entropy, and most updates
# (orange) lower it. At the three triangles an update raises it: the filter expected a pole, and the sensor said
# *nothing*. (Play with the dials if you have a running kernel: at which sensor does the filter lose the vehicle?)


# %% jupyter={"source_hidden": true} tags=["nbval-ignore-output"]
def show(hit, slip):
    """Draw a trip of 40 steps, and what a filter believes that knows sensor and odometry."""
    moved, p_pole = np.array([slip / 2, 1 - slip, slip / 2]), np.where(np.isin(np.arange(N_CELLS), POLES), hit, 0.1)
    at, heard = trip(40, np.random.default_rng(6), moved=moved, hit=hit)
    beliefs = localise(heard, np.array([1 - p_pole, p_pole]), moved)
    right = 100 * np.mean(beliefs.argmax(axis=1) == at)
    belief_history(beliefs, truth=at).set_title(f"right in {right:.0f} % of the steps", fontsize="medium")
    plt.show()


sliders = {"hit": FloatSlider(value=0.8, min=0.1, max=0.99, step=0.01), "slip": FloatSlider(value=0.2, min=0, max=0.9)}
_ = interact(show, **sliders)

# %% [markdown]
# So a filter is never sure for good. Prediction takes away, in each step, some of what the readings gave.
#
# ## When may readings be multiplied?
#
# The vehicle stands still, and the sensor reads twice: *pole*, *nothing*. Which came first doesn't matter, because
# multiplication has no order. But why may we multiply at all? Because of an assumption: *given the place, the readings
# err independently*. If you knew the place, the first reading would tell nothing about the second.
#
# **Predict before you run.** A bug delivers the same reading, *pole*, twice. One reading gave the three cells with poles
# 0.77 together. What does the filter believe of them now?
#
# <details><summary>Answer</summary>
#
# It multiplies twice, in all by 0.64 beside a pole and by 0.01 elsewhere: three times 0.064 against seven times 0.001.
# So the three cells get 0.96. The filter is sure of something that it hasn't seen.
#
# </details>

# %% jupyter={"outputs_hidden": true}
twice = update(P_POLE, one_reading)
print(f"on the three cells with poles: once {one_reading[POLES].sum():.2f}, counted twice {twice[POLES].sum():.2f}")

# %% [markdown]
# Multiplication has one more danger. Suppose you are certain that the vehicle is in cell 5, where no pole is. All other
# cells have 0. The sensor says *pole* ten times. You still believe in cell 5, because zero times anything is zero. Had
# you given cell 7 one in a thousand, four readings would have turned you round.

# %%
nearly = np.zeros(N_CELLS)
nearly[[5, 7]] = 0.999, 0.001
for _ in range(4):
    nearly = update(P_POLE, nearly)
print(f"after four readings: cell 5 {nearly[5]:.2f}, cell 7 {nearly[7]:.2f}")
assert nearly[7] > 0.5

# %% [markdown]
# So **no zeros in a model, and let the prediction leak a little to everywhere**. Computers make zeros of their own,
# because the product of very many likelihoods is too small for a floating-point number. Normalise at each step, or add
# logarithms, as lecture 02 will.
#
# In short, readings may be multiplied if each brings its own error, and each counts once.
#
# ## What is it now, and what was it then?
#
# At step 3 of the trip the filter's best guess was wrong: it was one cell ahead. Can later readings correct that? Draw
# what depends on what. An arrow means: depends directly.

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a row of four places n0 to n3, an arrow from each to the next; below each place the shaded reading z, with an arrow from the place to it"
line = bayes_on_a_line()
line.draw(plt.subplots(figsize=(6.5, 2.2), layout="constrained")[1]).set_title("")
plt.show()
assert history[3].argmax() == 3 != places[3] == 2

# %% [markdown]
# Each place depends on the place before, each reading on its place. Readings are shaded, because we see them. (Such
# a model is a **hidden Markov model**.) What is $n_2$ *now*? The filter needs only its belief about $n_1$ and the
# reading $z_2$, because all that the past can tell, it tells through the place before. But what $n_1$ *was* is another
# question. The reading $z_2$ tells about it, too, against the arrows.
#
# How? Go back to the first two readings. After the first *pole*, each cell with a pole had 0.26. Then came another one.
#
# **Predict before you run.** For each of these cells: if the vehicle was there at the first reading, how probable was the
# second *pole*? Which cell wins in hindsight?
#
# <details><summary>Answer</summary>
#
# From cell 2 it stays beside a pole, moves to the next pole, or beyond it: 0.1 · 0.8 + 0.8 · 0.8 + 0.1 · 0.1 = 0.73.
# From the other two only staying keeps it beside a pole: 0.1 · 0.8 + 0.9 · 0.1 = 0.17. This is a likelihood
# like any other, so update with it: cell 2 rises to 0.55, and the other two fall to 0.13.
#
# </details>
#
# A belief that uses readings before *and* after is called **smoothed**. With $\beta_t(n)$ for the probability of all
# readings after step $t$ if the vehicle is in cell $n$, and $\beta = 1$ at the last step:
#
# $$ P(n_t = n \mid \text{all } z) \propto b_t(n)\, \beta_t(n), \qquad
# \beta_{t-1}(n) = \sum_{d} P(d)\; P(z_t \mid n + d)\; \beta_t(n + d) $$

# %% tags=["smooth"] jupyter={"outputs_hidden": true}
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
print(
    "cells 2, 3 and 7 at the first reading: filter", one_reading[POLES].round(2), " smoothed", by_hand[POLES].round(2)
)

# %% jupyter={"source_hidden": true}
stage = bayes_on_a_line(steps=25)  # exact inference on the graph; its vehicle doesn't move before the first reading
np.testing.assert_allclose(history, filtered(stage, says_pole), atol=1e-12)
np.testing.assert_allclose(smooth(history, says_pole), smoothed(stage, says_pole), atol=1e-12)

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two tables of belief over 25 steps of one trip with the true places as circles: the filter's is blurred at first and one cell off at several steps; the smoother's is sharper, above all in the first steps"
fig, axes = plt.subplots(1, 2, figsize=(9, 2.8), sharey=True, layout="constrained")
for ax, name, table in zip(axes, ("filter", "smoother"), (history, smooth(history, says_pole)), strict=True):
    right = np.sum(table.argmax(axis=1) == places)
    belief_history(table, ax, truth=places).set_title(f"{name}: right in {right} of 25 steps", fontsize=10)
    ax.label_outer()
fig.colorbar(axes[0].images[0], ax=axes, label="probability")
plt.show()
assert smooth(history, says_pole)[3].argmax() == places[3]
assert [np.sum(table.argmax(axis=1) == places) for table in (history, smooth(history, says_pole))] == [18, 24]

# %%
rng, right = np.random.default_rng(0), np.zeros(3)
for _ in range(400):
    places, heard = trip(30, rng)
    beliefs = localise(heard)
    rows = update(SENSOR[1], nothing_known), update(SENSOR[0], nothing_known)
    guesses = beliefs, smooth(beliefs, heard), np.where(heard[:, None], *rows)
    right += [np.mean(guess.argmax(axis=1) == places) / 400 for guess in guesses]
print("400 trips, right: filter {:.0%}, smoother {:.0%}, last reading alone {:.0%}".format(*right))
assert right[1] > right[0] + 0.1 > right[2] + 0.3

# %% [markdown]
# On this trip the smoother corrects step 3, and nearly all others. Over 400 random trips the filter names the right cell
# in 45 % of the steps and the smoother in 59 %. (A trivial rule that looks at the last reading alone is right in 17 %.)
# But the filter isn't worse. It is exact for its own question, and at the last step both are the same belief.
#
# So a vehicle that must act now asks the filter, and a map that is made after the drive asks the smoother.
#
# ## What if the place is known and the map isn't?
#
# So far the map was known and the place was not. A LIDAR on a vehicle with good odometry has the opposite problem. So
# ask, for **one cell** of the ground: is it FREE or OCCUPIED? Two states in place of ten, and the same two steps. Say
# that a beam returns from an occupied cell with 0.8 and from a free one with 0.05.
#
# Update is the same function. And predict? A cell doesn't move, but its *state* changes, because cars come and go. Say
# that from one scan to the next a free cell becomes occupied with 0.1, and an occupied one free with 0.2. These numbers
# form a **transition matrix** $M$, whose rows say *from* and columns say *to*, so each row sums to one. The prediction is
# $b M$. By hand, with FREE at 0.6: it becomes 0.6 · 0.9 + 0.4 · 0.2 = 0.62.

# %% jupyter={"source_hidden": true}
M = np.array([[0.9, 0.1], [0.2, 0.8]])
np.testing.assert_allclose(np.array([0.6, 0.4]) @ M, [0.62, 0.38])
np.testing.assert_allclose(one_reading @ MOVE, predict(one_reading, MOVED))  # the ring road was such a matrix, too

# %% [markdown]
# **Predict before you run.** You tuned $M$ for a LIDAR with 10 scans a second. The new one makes 20. You leave $M$ as it
# is. A car is seen for a second, and then hidden. What does the filter do wrong?
#
# <details><summary>Answer</summary>
#
# It applies $M$ twice as often. So it forgets the hidden car twice as fast.
#
# </details>
#
# The matrix belongs to a time step. What belongs to the world are **rates**. Say that a free cell becomes
# occupied $\alpha$ times a second, and an occupied one free $\gamma$ times. The belief $p$ in OCCUPIED gains
# $\alpha (1 - p)$ a second and loses $\gamma p$. Both balance at $p_\infty = \alpha / (\alpha + \gamma)$, and the
# difference to it decays:
#
# $$ p(t) = p_\infty + \left(p(0) - p_\infty\right) e^{-(\alpha + \gamma)\, t} $$


# %% tags=["transition-matrix"]
def transition(alpha, gamma, dt):
    """Return M for a time step of dt seconds: rows FREE and OCCUPIED, where p(0) is 0 and 1."""
    final, kept = alpha / (alpha + gamma), np.exp(-(alpha + gamma) * dt)
    occupied = final + (np.array([0, 1]) - final) * kept
    return np.stack([1 - occupied, occupied], axis=1)


def follow(scans_per_second, M, seconds=3):
    """Return P(OCCUPIED) of a cell with a return in each scan of the first second, and then out of sight."""
    belief, p = np.array([0.5, 0.5]), []
    for k in range(seconds * scans_per_second):
        belief = belief @ M
        if k < scans_per_second:
            belief = update(np.array([0.05, 0.8]), belief)  # P(return | FREE), P(return | OCCUPIED)
        p.append(belief[1])
    return p


tenth, twentieth = (transition(alpha=0.5, gamma=1.5, dt=dt) for dt in (0.1, 0.05))
np.testing.assert_allclose(twentieth @ twentieth, tenth)  # two half steps are one step

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="P(OCCUPIED) over three seconds: about 1 while the car is seen, then three falling curves; the right matrices for 10 and for 20 scans a second fall alike, and the old matrix at 20 scans a second falls twice as fast; all end near 0.25"
fig, ax = plt.subplots(figsize=(6.5, 2.8), layout="constrained")
curves = (("10 scans a second", 10, tenth, "o", "#0072b2"), ("20 scans, matrix for 20", 20, twentieth, ".", "black"),
          ("20 scans, matrix for 10", 20, tenth, "x", "#d55e00"))  # fmt: skip
ends = []
for label, rate, matrix, mark, colour in curves:
    p = follow(rate, matrix)
    ends.append(p[int(1.5 * rate) - 1])
    assert abs(p[-1] - 0.25) < 0.02
    ax.plot((np.arange(len(p)) + 1) / rate, p, mark, color=colour, markersize=5, label=label)
ax.axvspan(0, 1, color="tab:red", alpha=0.12)
ax.text(0.5, 0.1, "the car is seen", ha="center", fontsize=9)
ax.axhline(0.25, color="0.6", linewidth=1)
ax.set(xlabel="time [s]", ylabel="P(OCCUPIED)", ylim=(0, 1.02))
ax.legend(fontsize=9, frameon=False)
plt.show()
assert abs(ends[0] - ends[1]) < 0.02 < ends[1] - ends[2]

# %% [markdown]
# Here $\alpha$ = 0.5 and $\gamma$ = 1.5 a second. With the right matrix both LIDARs forget alike, and both end at
# $p_\infty$ = 0.25: what is believed of a cell of which nothing is known any more. (With more states the rates $R$ form a
# matrix, and $M = e^{R \Delta t}$. Lecture 04 has four.)
#
# So one cell of a map is filtered like a place on a road. Lecture 02 does it for thousands of cells at once.
#
# ## Where this breaks: sure and wrong
#
# A filter says how sure it is. Is it right to be? Over many trips, take the belief that it gives to its best guess, and
# see how often the vehicle is there. If the two agree, the filter is called **calibrated**. Now break one assumption at
# a time.


# %% jupyter={"source_hidden": true}
def claims_and_truth(sensor, poles=POLES):
    """Return the mean belief in the best guess, and how often the vehicle is there, over 400 trips at once."""
    rng = np.random.default_rng(0)
    places, heard = (np.array(rows) for rows in zip(*[trip(30, rng, poles=poles) for _ in range(400)], strict=True))
    beliefs, claimed, right = np.tile(nothing_known, (400, 1)), [], []
    for place, says in zip(places.T, heard.T, strict=True):
        product = sensor[says.astype(int)] * (beliefs @ MOVE)
        beliefs = product / product.sum(axis=1, keepdims=True)
        claimed.append(beliefs.max(axis=1))
        right.append(beliefs.argmax(axis=1) == place)
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
    ax.bar_label(ax.bar(at + shift, values, width=0.38, label=label, color=colour), fmt="%.2f", fontsize=9)
ax.set_xticks(at, measured)
ax.set(ylabel="probability", ylim=(0, 0.95))
ax.legend(ncols=2, fontsize=9, frameon=False)
plt.show()
(honest, is_honest), *broken = measured.values()
assert abs(honest - is_honest) < 0.02
assert all(claim > truth + 0.1 for claim, truth in broken)

# %% [markdown]
# The first pair agrees. In the other three the filter claims far more than it knows, and *nothing in its belief shows
# it*. Comparing with the truth does. Counting twice often comes in disguise: ten returns of one scan from the
# same bush share an error, and aren't ten witnesses. Lecture 02 meets them on a street.
#
# ## In five lines
#
# 1. A belief sums to one; a likelihood needn't. Posterior = prior times likelihood, divided by the sum.
# 2. Predict spreads, update mostly sharpens. Predict first, because a reading is about now.
# 3. Readings multiply if their errors are independent given the state. Each counts once, and zeros are for ever.
# 4. The filter says what is now, from what was seen until now. What was then is another question: smoothing.
# 5. One cell of a map is filtered in the same way. A transition matrix belongs to its time step. A wrong model makes a
#    filter sure and wrong, and the belief doesn't show it.
#
# ## Further reading and exercise
#
# - Labbe, *Kalman and Bayesian Filters in Python*: [the discrete Bayes
#   filter](https://github.com/rlabbe/Kalman-and-Bayesian-Filters-in-Python), by `filterpy`'s author.
# - Thrun, Burgard, Fox, *Probabilistic Robotics*, MIT Press 2005: localisation on a map.
# - Rabiner, *A tutorial on hidden Markov models*, Proceedings of the IEEE, 1989: filter and smoother.
# - Norris, *Markov Chains*, Cambridge 1997: rates, and the matrix of any time step.
#
# [Exercise 01](exercises/01_bayes.ipynb): a move on ice, a filter that waits for a few scans, a matrix from counts, and
# a map put together from your own functions. Next: lecture [01b](01b_graphical_models.ipynb), what a missing arrow
# promises. Later: [what to do when a belief has too many states](deeper/time_beliefs.ipynb).

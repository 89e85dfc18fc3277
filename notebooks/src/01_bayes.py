# %% [markdown]
# # 01 · Bayes' rule on a line: predict, update, repeat
#
# **In one sentence.** A belief is a row of numbers that sum to one, and a Bayes filter does two things to it, over
# and over: *predict* carries it to the next moment and forgets a little, and *update* multiplies it by what was seen.
#
# **You will be able to**
# - do both steps by hand, and in ten lines of code;
# - say when readings may be multiplied, and what a zero does;
# - test whether a filter is right to be so sure, with the truth and without it;
# - tell two questions apart: what is it now, and what was it then;
# - filter one cell of a map by the same two steps.
#
# **Prerequisites.** Lecture [00](00_tour.ipynb), its first stage; a row of numbers times a matrix.
#
# **Time.** 76 minutes, of which the computer needs a few seconds.
#
# **Paper.** Section 3.2, for a single cell: prediction by a transition matrix, update by a sensor model, estimate.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
from filterpy import discrete_bayes
from ipywidgets import FloatSlider, interact

from semgrid_edu import plotting
from worlds.lecture_01_line import bayes_on_a_line, filtered, smoothed
from worlds.lecture_01_lines import belief_history, places_on_ring, probability_lines, ring_road

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI

# %% [markdown]
# ## Where is the vehicle?
#
# A vehicle drives round a ring road of ten cells. Poles stand beside three of them: a pair at **A**, beside cells 2
# and 3, and a single one at **B**, beside cell 7. A sensor looks to the side and says *pole* or *nothing*. It errs: it
# says *pole* with probability 0.8 beside a pole, and with probability 0.1 elsewhere. The map is known. Where is the
# vehicle?
#
# Here is what a filter believes from reading to reading. A blue bar is the probability of a cell. The orange circle
# marks the vehicle, which the filter can't see.

# %% jupyter={"source_hidden": true}
POLES = [2, 3, 7]
N_CELLS = 10
P_POLE = np.where(np.isin(np.arange(N_CELLS), POLES), 0.8, 0.1)  # P("pole" | cell), for each cell
MOVED = np.array([0.1, 0.8, 0.1])  # P(the vehicle moves by 0, 1, 2 cells)


def trip(steps, rng, poles=POLES, moved=MOVED, hit=0.8):
    """Return the places of a random trip, and whether the sensor says "pole" at each."""
    moves = rng.choice(3, size=steps, p=moved)
    places = (rng.integers(N_CELLS) + np.cumsum(moves)) % N_CELLS
    says_pole = rng.random(steps) < np.where(np.isin(places, poles), hit, 0.1)
    return places, says_pole


def trips(steps, **world):
    """Return places and readings of 1000 random trips, both (steps, 1000)."""
    rows = zip(*(trip(steps, np.random.default_rng(seed), **world) for seed in range(1000)), strict=True)
    return [np.transpose(row) for row in rows]


places, says_pole = trip(25, np.random.default_rng(152))  # a typical one, as we will see


# %% jupyter={"source_hidden": true} alt="animation of ten cells in a circle with a bar at each; after three readings of pole the bars gather at A and follow the vehicle; after a false pole at step 4 they run ahead of it; at steps 10 and 11 two readings of pole bring them back"
def ring_frames():
    """Show the ring twice per step: after the prediction, and after the reading."""
    bars, vehicle, title = ring_road(POLES)
    around = places_on_ring()
    belief = np.full(N_CELLS, 1 / N_CELLS)
    for t, place in enumerate(places[:12]):
        vehicle.set_data(*0.84 * around[[place]].T)
        prior = discrete_bayes.predict(belief, offset=1, kernel=MOVED)
        belief = discrete_bayes.update(P_POLE if says_pole[t] else 1 - P_POLE, prior)
        said = "pole" if says_pole[t] else "nothing"
        for shown, words in ((prior, "predict"), (belief, f'sensor says "{said}"')):
            for bar, (x, y), b in zip(bars, around, shown, strict=True):
                bar.set_data([x, x * (1 + b)], [y, y * (1 + b)])
            title.set_text(f"step {t}: {words}")
            yield title.figure
            title.figure.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(ring_frames(), period=0.7, alt="a belief follows a vehicle round a ring road of ten cells")

# %% [markdown]
# At first all ten bars are alike. Three readings of *pole* in a row fit the pair at A best, so the bars gather there.
# Then two false *poles*, at steps 4 and 7, make the filter lose the vehicle. In the next round the pair at A brings it
# back. On the whole trip the highest bar is at the vehicle in 11 of 25 steps. That is typical: it is the median of a
# thousand such trips. Who guesses blindly is right in one step of ten.
#
# So the filter finds its place, loses it and finds it again, with a sensor that errs and can't tell one pole from
# another. How, the next two sections show.
#
# ## What does one reading tell?
#
# The **belief** $b(i)$ is the probability that the vehicle is in cell $i$. You know nothing yet, so it is 0.1 for each
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
# This is **Bayes' rule**. With $z$ for the reading, and the sum over all cells $j$:
#
# $$ P(i \mid z) = \frac{P(z \mid i)\; b(i)}{\sum_{j} P(z \mid j)\; b(j)} $$
#
# The belief $b$ before the reading is the **prior**, $P(z \mid i)$ the **likelihood**, the result the **posterior**:
# the new belief.


# %% tags=["update"] jupyter={"outputs_hidden": true}
def update(likelihood, prior):
    """Return the posterior: multiply cell by cell, then divide by the sum."""
    product = likelihood * prior
    return product / product.sum(axis=-1, keepdims=True)  # the last axis, so that it works for many trips at once


nothing_known = np.full(N_CELLS, 1 / N_CELLS)
one_reading = update(P_POLE, nothing_known)
np.testing.assert_allclose(one_reading, discrete_bayes.update(P_POLE, nothing_known))  # filterpy's function
print("cell 3: {:.2f}   cell 5: {:.2f}".format(*one_reading[[3, 5]]))

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="three rows of ten bars, triangles at the cells 2, 3 and 7: the prior is 0.10 everywhere; the likelihood of pole is 0.80 in cells 2, 3 and 7 and 0.10 elsewhere; the posterior is 0.26 in those three cells and 0.03 elsewhere"
probability_lines({"prior": nothing_known, "likelihood of 'pole'": P_POLE, "posterior": one_reading}, marked=POLES)
plt.show()

# %% [markdown]
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
# With $P(d)$ for the probability of moving by $d$ cells, and $i - d$ counted round the ring:
#
# $$ b(i) \;\leftarrow\; \sum_d P(d)\; b(i - d) $$
#
# A sum of this form is a **convolution**.


# %% tags=["predict"] jupyter={"outputs_hidden": true}
def predict(belief, moved):
    """Return the belief after a move: what has moved by d cells into cell i was in cell i - d."""
    return sum(p * np.roll(belief, d, axis=-1) for d, p in enumerate(moved))  # roll: each number d cells on


moved_on = predict(one_reading, MOVED)  # 0.1, 0.8, 0.1 for 0, 1, 2 cells
np.testing.assert_allclose(moved_on, discrete_bayes.predict(one_reading, offset=1, kernel=MOVED))
print(f"cell 3: {moved_on[3]:.2f}   sum: {moved_on.sum():.2f}")

# %% [markdown]
# After the move the sensor says *pole* again.

# %% jupyter={"source_hidden": true} alt="three rows of ten bars, triangles at the cells 2, 3 and 7: after one reading 0.26 in cells 2, 3 and 7; after the move the same one cell to the right and blunter; after the second reading 0.55 in cell 3 and less than 0.2 elsewhere"
two_readings = update(P_POLE, moved_on)
probability_lines(
    {"after one reading": one_reading, "after the move": moved_on, "after the second reading": two_readings},
    marked=POLES,
)
plt.show()

# %% [markdown]
# The middle row is the upper one, one cell to the right and blunter. In the lower row cell 3 has 0.55. Neither reading
# could tell the poles apart. Together they can, because one move lies between them, and only at A are two poles one
# move apart. The order of the two steps matters, too: a reading is about where the vehicle is *now*, so predict first.
#
# So **prediction carries what was seen there and then to here and now**.
#
# ## How sure is the filter?
#
# The rest is repetition. The filter gets the readings alone. The trips are random: `trip`, folded above, draws a
# vehicle and a sensor that err just as the filter assumes, and `trips` draws a thousand of them.


# %% tags=["filter"]
SENSOR = np.array([1 - P_POLE, P_POLE])  # rows "nothing", "pole"


def localise(says_pole, sensor=SENSOR, moved=MOVED, belief=nothing_known):
    """Return the belief after each reading."""
    history = []
    for says in says_pole:
        belief = update(sensor[says.astype(int)], predict(belief, moved))
        history.append(belief)
    return np.array(history)


def entropy(belief):
    """Return the uncertainty of a belief, without exact zeros, in bits."""
    return -np.sum(belief * np.log2(belief), axis=-1)


fleet = trips(25)  # places and readings, each (25 steps, 1000 trips)


# %% [markdown]
# The **entropy** $-\sum_i b(i) \log_2 b(i)$ counts uncertainty in bits: none if one cell has everything, one bit for
# two cells in balance, 3.3 bits for ten.
#
# **Predict before you run.** One of the two steps can never lower the entropy on this road. Which one? And is it true
# that the other can never raise it?
#
# <details><summary>Answer</summary>
#
# Prediction never lowers it, because each new number is a mean of old ones, so peaks get lower and holes fill up.
# Update mostly lowers it, but not always: a reading that contradicts what you believed leaves you with two
# explanations in place of one.
#
# </details>


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="above, the belief over 25 steps as a table of ten cells, with the true places as circles where the darkest cell is the true one, and as crosses where it isn't: right at the steps 0 to 3, 10 to 15 and 19; below, the entropy, which goes up with every prediction and mostly down with every update, between 1.0 and 3.3 bits, with triangles at the steps 4, 18 and 23 where an update raises it"
history = localise(says_pole)
priors = predict(np.stack([nothing_known, *history[:-1]]), MOVED)
before, after = entropy(priors), entropy(history)
raised = np.flatnonzero(after > before)
fig, axes = plt.subplots(2, 1, figsize=(7.6, 4.6), sharex=True, layout="constrained")
belief_history(history, ax=axes[0], truth=places).set(xlabel="")
axes[0].legend(fontsize=9, ncols=2, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1))
fig.colorbar(axes[0].images[0], ax=axes, label="probability", shrink=0.46, anchor=(0, 1))
axes[1].plot(np.repeat(np.arange(25), 2) + np.tile([-0.25, 0.0], 25), np.stack([before, after], 1).ravel(), color="0.6")
axes[1].plot(np.arange(25) - 0.25, before, "o", color="#0072b2", markersize=4, label="after predict")
axes[1].plot(after, "s", color="#d55e00", markersize=4, label="after update")
axes[1].plot(raised, after[raised] + 0.35, "kv", label="raised by an update")
axes[1].set(xlabel="step", ylabel="entropy [bits]", ylim=(0, 4.2))
axes[1].legend(fontsize=9, ncols=3, frameon=False, loc="upper right")
plt.show()
np.testing.assert_array_equal(raised, [4, 18, 23])
assert (before[1:] >= after[:-1]).all()
np.testing.assert_array_equal(says_pole[raised], [True, True, False])
np.testing.assert_array_equal(np.flatnonzero(history.argmax(axis=1) == places), [0, 1, 2, 3, *range(10, 16), 19])
# Without the two false poles the filter is wrong once in the steps 4 to 9; without those at A it doesn't come back.
for flipped, wrong_steps in (([4, 7], [6]), ([10, 11], range(4, 16))):
    other = localise(says_pole ^ np.isin(np.arange(25), flipped))
    np.testing.assert_array_equal(np.flatnonzero(other.argmax(axis=1)[:16] != places[:16]), wrong_steps)

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
at, heard = fleet
beliefs = localise(heard)
right = np.sum(beliefs.argmax(axis=-1) == at, axis=0)
priors = predict(beliefs[:-1], MOVED)
against = np.isin(priors.argmax(axis=-1), POLES) != heard[1:]
raises = entropy(beliefs[1:]) > entropy(priors) + 1e-12
print(f"1000 trips: the best guess is right in {np.median(right):.0f} of 25 steps (median)")
print(f"readings that raise the entropy: {against[raises].mean():.0%} speak against the likeliest cell,", end=" ")
print(f"{1 - heard[1:][raises].mean():.0%} are 'nothing'")
assert np.median(right) == right[152] == 11
assert against[raises].all()

# %% [markdown]
# Above, darker is surer. Below, each prediction (blue) raises the entropy, and most updates (orange) lower it. At the
# three triangles an update raises it. At the first two the sensor said *pole* where the filter expected none; at the
# third it was silent where the filter expected a pole. This is no accident of one trip: in all of the thousand trips,
# *every* reading that raised the entropy spoke against the cell that the filter thought likeliest. Seven in ten were
# silences. (Play with the dials if you have a running kernel: at which sensor does the filter lose the vehicle?)


# %% jupyter={"source_hidden": true} tags=["nbval-ignore-output"]
def show(hit, slip):
    """Draw a trip of 40 steps, and what a filter believes that knows sensor and odometry."""
    moved, p_pole = np.array([slip / 2, 1 - slip, slip / 2]), np.where(np.isin(np.arange(N_CELLS), POLES), hit, 0.1)
    truth, readings = trip(40, np.random.default_rng(6), moved=moved, hit=hit)
    table = localise(readings, np.array([1 - p_pole, p_pole]), moved)
    share = np.mean(table.argmax(axis=1) == truth)
    belief_history(table, truth=truth).set_title(f"right in {share:.0%} of the steps", fontsize="medium")
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
# **Predict before you run.** A bug delivers the same reading, *pole*, twice. One reading gave the three cells with
# poles 0.77 together. What does the filter believe of them now?
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
# Counting twice often comes in disguise. Ten returns of one scan from the same bush share an error, and aren't ten
# witnesses. Lecture 02 meets them on a street.
#
# So **readings may be multiplied if each brings its own error, and each counts once**.
#
# ## Is a zero for ever?
#
# Let the filter start certain and wrong: it gives everything to the cell opposite to the vehicle, and zero to all
# others. Zero times anything is zero, so no update can bring it back, whatever the sensor says. Can a prediction? Take
# a vehicle that always moves by exactly one cell and a filter that knows this, so that its prediction only carries the
# zeros along. Then let each prediction also give a millionth of the belief to all cells alike: it **leaks**.


# %%
def right_at_last(leak):
    """Return how often the best guess after 40 steps is right: certain and wrong at first, and nothing known at first."""
    at, heard = trips(40, moved=np.array([0, 1, 0]))
    opposite = np.eye(N_CELLS)[(at[0] + 5) % N_CELLS]  # one row for each of 1000 trips
    shares = []
    for belief in (opposite, nothing_known):
        for says in heard:
            prior = (1 - leak) * predict(belief, [0, 1, 0]) + leak / N_CELLS
            belief = update(SENSOR[says.astype(int)], prior)
        shares.append(np.mean(belief.argmax(axis=1) == at[-1]))
    return shares


for leak in (0, 1e-6, 1e-3):
    lost, open_minded = right_at_last(leak)
    print(
        f"leak {leak:g}: right after 40 steps, certain and wrong at first {lost:.0%}, nothing known {open_minded:.0%}"
    )

# %% jupyter={"source_hidden": true}
belief, n_returns = np.array([0.5, 0.5]), 0
while belief.min() > 0:  # one cell of a map, hit again and again: P(return | FREE) 0.05, P(return | OCCUPIED) 0.8
    belief, n_returns = update(np.array([0.05, 0.8]), belief), n_returns + 1
print("an exact zero after", n_returns, "returns, although the belief is normalised each time")
assert right_at_last(0)[0] == 0
assert right_at_last(1e-6)[0] > 0.8
assert n_returns == 269

# %% [markdown]
# Without a leak the filter never finds the vehicle. A millionth is enough for most trips, a thousandth for nearly all,
# and a filter that starts open-minded loses nothing by it.
#
# So **a zero is for ever unless the prediction leaks into it**. Beware: computers make zeros of their own. If one cell
# is hit 269 times, P(FREE) becomes too small for a floating-point number, and dividing by the sum doesn't bring it
# back. Let the prediction leak, or store the logarithm of the odds, as lecture 02 does.
#
# ## Where this breaks: sure and wrong
#
# A filter says how sure it is. Is it right to be? Take all steps at which it gives its best guess, the likeliest
# cell, about 0.7. If the guess is right in 70 % of them, and likewise for each other number, the filter is called
# **calibrated**. So sort the steps of the thousand trips by this belief, and count how often the guess is right. Then
# break one assumption at a time. One filter trusts its sensor too much: it thinks that the sensor errs in 1 % of the
# readings. Another has a shifted map: who made it began to count one cell too late, so each pole stands one cell further
# on than its map says.
#
# That test needs the truth, which no vehicle has on the road. But a vehicle has the next reading. *Before* each reading
# the filter can say how probable *pole* is: $\sum_i b(i)\, P(\text{pole} \mid i)$, with $b$ after the prediction. Among
# all steps with the same number, the sensor should say *pole* in just that share.


# %% tags=["claims"]
def claims(sensor, at, heard):
    """Return, for all steps: belief in the best guess, how far ahead of it the vehicle is, P("pole") before, heard."""
    beliefs = localise(heard, sensor)
    ahead = (at - beliefs.argmax(axis=-1)) % N_CELLS  # 0 where the best guess is right
    expected = predict(beliefs[:-1], MOVED) @ sensor[1]  # from the second reading on
    return [rows.ravel() for rows in (beliefs.max(axis=-1), ahead, expected, heard[1:])]


filters = {
    "all as assumed": claims(SENSOR, *fleet),
    "trusts its sensor too much": claims(np.where(SENSOR > 0.5, 0.99, 0.01), *fleet),  # for 0.8, 0.9 and 0.2, 0.1
    "has a shifted map": claims(SENSOR, *trips(25, poles=[3, 4, 8])),
}

# %% [markdown]
# **Predict before you run.** With the truth, both faults show. Which of the two does the test without the truth find?
# Think of the shifted map: where does its filter believe the vehicle?
#
# <details><summary>Answer</summary>
#
# It finds the sensor that is trusted too much: where that filter expects *pole* with 0.76, it hears *pole* in 49 % of
# the steps. The shifted map it can't find. The filter believes the vehicle one cell behind where it is, and seen from
# there each pole is where the map says. So it hears what it expects.
#
# </details>


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
def binned(claim, came_true):
    """Return the mean claim and the share that came true, for each tenth with at least 70 steps."""
    tenth = np.minimum((claim * 10).astype(int), 9)
    rows = [(claim[tenth == k].mean(), came_true[tenth == k].mean()) for k in range(10) if np.sum(tenth == k) >= 70]
    return np.transpose(rows)


def hears(rows):
    """Return the mean P("pole") beforehand where it was at least 0.4, and the share of "pole" there."""
    likely = rows[2] >= 0.4
    return rows[2][likely].mean(), rows[3][likely].mean()


for name, rows in (filters | {"has the pole at B moved": claims(SENSOR, *trips(25, poles=[2, 3, 8]))}).items():
    found, one_behind = (np.mean(rows[1] == ahead) for ahead in (0, 1))
    print("{:26}: expects {:.2f}, hears {:.2f}".format(name, *hears(rows)), end="; ")
    print(f"right in {found:.0%}, one cell behind in {one_behind:.0%}")
counted_twice, *_ = claims(SENSOR**2, *fleet)
assert abs(counted_twice.mean() - filters["trusts its sensor too much"][0].mean()) < 0.05

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two panels with a dashed diagonal; left, how often the best guess is right against the belief in it: the filter as assumed lies on the diagonal, too much trust far below, and the shifted map near zero; right, how often pole is heard against its probability beforehand: as assumed on the diagonal, too much trust far below at high and above at low values, and the shifted map on the diagonal"
fig, axes = plt.subplots(1, 2, figsize=(9, 4.1), layout="constrained")
curves = {}
for (name, rows), style in zip(filters.items(), ("o-", "s--", "^:"), strict=True):
    curves[name] = binned(rows[0], rows[1] == 0), binned(*rows[2:])
    for ax, curve in zip(axes, curves[name], strict=True):
        ax.plot(
            *curve, style, label=name, color={"o-": "black", "s--": "#d55e00", "^:": "#0072b2"}[style], markersize=6
        )
for ax, words in zip(axes, (("with the truth", "belief in the best guess", "the guess is right"),
                            ("without the truth", 'P("pole") before the reading', 'the sensor says "pole"')), strict=True):  # fmt: skip
    ax.plot([0, 1], [0, 1], "--", color="0.6", linewidth=1, zorder=0)
    ax.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", title=words[0], xlabel=words[1], ylabel=f"share where {words[2]}")
axes[0].legend(fontsize=9, frameon=False, loc="upper left")
plt.show()


# %% jupyter={"source_hidden": true}
(honest, heard_as_assumed), (too_sure, heard_too_sure), (shifted, heard_shifted) = curves.values()
for curve in (honest, heard_as_assumed, heard_shifted):
    assert abs(curve[0] - curve[1]).max() < 0.05
assert (too_sure[0] - too_sure[1])[2:].min() > 0.08
assert shifted[1].max() < 0.15
np.testing.assert_allclose(heard_too_sure[:, -2], [0.76, 0.49], atol=0.005)
np.testing.assert_allclose(shifted[:, -1], [0.83, 0.07], atol=0.005)

# %% [markdown]
# Left, the filter with the right model is on the diagonal, and both others claim more than they know. (Counting each
# reading twice does nearly the same as too much trust.) Where the filter with the shifted map claims 0.83, it is right
# in 7 % of the steps. And *nothing in its belief shows it*.
#
# Right, the test without the truth finds the sensor, and not the map. Is our explanation true? Then this filter must be
# one cell behind as often as the filter with the right map is right. It is: in 44 and 43 % of all steps. And if only
# the pole at B moves, the distances on the map are wrong, so the test should notice. It does, in six thousand readings:
# this filter expects *pole* with 0.47 and hears it in 42 %.
#
# So **compare what a filter expects with what it hears, over many readings: if they differ, the model is wrong; if
# they agree, the place may still be wrong**.
#
# ## What is it now, and what was it then?
#
# At step 7 of the trip the vehicle was in cell 9. The sensor said *pole* by mistake, and the filter believed in cell 7.
# Can later readings correct that? Draw what depends on what. An arrow means: depends directly.

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a row of four places n0 to n3, an arrow from each to the next; below each place the shaded reading z, with an arrow from the place to it"
line = bayes_on_a_line()
line.draw(plt.subplots(figsize=(6.5, 2.2), layout="constrained")[1]).set_title("")
plt.show()
assert (history[7].argmax(), places[7], says_pole[7]) == (7, 9, True)

# %% [markdown]
# The place at step $t$ is $n_t$, the reading there $z_t$. Each place depends on the place before, each reading on its
# place. Readings are shaded, because we see them. (Such a model is a **hidden Markov model**.) What is the place *now*?
# The filter needs only its belief about the place before, and the reading now, because all that the past can tell, it
# tells through the place before. But what the place before *was* is another question. The reading now tells about it,
# too, against the arrows.
#
# How? Go back to the first two readings. After the first *pole*, each cell with a pole had 0.26. Then came another one.
#
# **Predict before you run.** For each of these cells: if the vehicle was there at the first reading, how probable was
# the second *pole*? Which cell wins in hindsight?
#
# <details><summary>Answer</summary>
#
# From cell 2 it stays beside a pole, moves to the next pole, or beyond it: 0.1 · 0.8 + 0.8 · 0.8 + 0.1 · 0.1 = 0.73.
# From the other two only staying keeps it beside a pole: 0.1 · 0.8 + 0.9 · 0.1 = 0.17. This is a likelihood
# like any other, so update with it: cell 2 rises to 0.55, and the other two fall to 0.13.
#
# </details>
#
# A belief that uses readings before *and* after is called **smoothed**. Let $b_t$ be the filter's belief after step
# $t$, and $\beta_t(i)$ the probability of all readings after step $t$ if the vehicle is in cell $i$, with $\beta = 1$
# at the last step. Then:
#
# $$ P(n_t = i \mid \text{all } z) \propto b_t(i)\, \beta_t(i), \qquad
# \beta_{t-1}(i) = \sum_{d} P(d)\; P(z_t \mid i + d)\; \beta_t(i + d) $$
#
# The right one is the sum that you have just computed by hand, with what comes later as one more factor.


# %% tags=["smooth"] jupyter={"outputs_hidden": true}
def smooth(history, says_pole):
    """Return the belief in each place given all readings; `history` holds the filter's beliefs."""
    beta, beliefs = np.ones(N_CELLS), []
    for belief, says in zip(history[::-1], says_pole[::-1], strict=True):
        beliefs.append(update(beta, belief))
        explained = SENSOR[says.astype(int)] * beta
        beta = sum(p * np.roll(explained, -d, axis=-1) for d, p in enumerate(MOVED))  # what i + d has, to i
        beta = beta / beta.sum(axis=-1, keepdims=True)  # only ratios matter
    return np.array(beliefs[::-1])


by_hand = smooth([one_reading, two_readings], np.array([True, True]))[0]
print(
    "cells 2, 3 and 7 at the first reading: filter", one_reading[POLES].round(2), " smoothed", by_hand[POLES].round(2)
)

# %% jupyter={"source_hidden": true}
stage = bayes_on_a_line(steps=25)  # exact inference on the graph; its vehicle doesn't move before the first reading
np.testing.assert_allclose(history, filtered(stage, says_pole), atol=1e-12)
np.testing.assert_allclose(smooth(history, says_pole), smoothed(stage, says_pole), atol=1e-12)

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, two tables of belief over 25 steps of one trip: the filter is right at 11 steps, the smoother at 15, among them the steps 7 to 9; right, a histogram over 1000 trips of the number of steps right of 25: both are broad, the filter's around 11, the smoother's around 15"
later = smooth(history, says_pole)
fig, axes = plt.subplot_mosaic([["filter", "both"], ["smoother", "both"]], figsize=(9, 4.2), layout="constrained")
for name, table in (("filter", history), ("smoother", later)):
    count = np.sum(table.argmax(axis=1) == places)
    belief_history(table, axes[name], truth=places).set_title(
        f"{name}, this trip: right in {count} of 25 steps", fontsize=10
    )
axes["filter"].set(xlabel="")
of_all_trips = smooth(beliefs, heard).argmax(axis=-1)
of_smoother = np.sum(of_all_trips == at, axis=0)
bins = np.arange(-0.5, 26, 2)
axes["both"].hist(right, bins, color="0.75", label="filter")
axes["both"].hist(of_smoother, bins, histtype="step", color="#d55e00", linewidth=2.5, label="smoother")
axes["both"].set(xlabel="steps right of 25", ylabel="trips")
axes["both"].set_title("1000 trips", fontsize=10)
axes["both"].legend(fontsize=9, frameon=False, loc="upper left")
plt.show()

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
last_alone = np.array([update(likelihood, nothing_known) for likelihood in SENSOR])
blind = np.mean(last_alone[heard.astype(int)].argmax(axis=-1) == at)
print(
    f"right: filter {np.mean(right) / 25:.0%}, smoother {np.mean(of_smoother) / 25:.0%}, last reading alone {blind:.0%}"
)
print(f"right at most once: filter {np.mean(right < 2):.0%}, smoother {np.mean(of_smoother < 2):.0%}")
assert (later[7:10].argmax(axis=1) == places[7:10]).all()
assert (later[[3, 19]].argmax(axis=1) != places[[3, 19]]).all()
apart = np.abs((of_all_trips - at + 5) % N_CELLS - 5)[:, of_smoother < 2]
assert np.mean(apart >= 3) > 0.9  # the whole trip is somewhere else
assert np.median(of_smoother) == of_smoother[152] == 15

# %% [markdown]
# The smoother corrects this step and the next two, and three others; it spoils two. On average over all
# trips the filter is right in 43 % of the steps and the smoother in 56 %. (A trivial rule that looks at the last
# reading alone is right in 17 %.) But when a smoother errs, it may err all the way, because it puts the whole trip
# somewhere else: the histogram has a bump at zero. Nor is the filter wrong. It is exact for its own question, and at
# the last step both are the same belief.
#
# So a vehicle that must act now asks the filter, and a map that is made after the drive asks the smoother.
#
# ## What if the place is known and the map isn't?
#
# So far the map was known and the place was not. A LIDAR on a vehicle with good odometry has the opposite problem. So
# ask, for **one cell** of the ground: is it FREE or OCCUPIED? Two states in place of ten, and the same two steps. Say
# that a beam returns from an occupied cell with 0.8 and from a free one with 0.05.
#
# Update is the same function. And predict? A cell doesn't move, but its *state* changes, because cars come and go.
# Say that from one scan to the next something appears in a free cell with $a$ = 0.1, and vanishes from an occupied
# one with $v$ = 0.2. These numbers form a **transition matrix** $M$, whose rows say *from* and columns say *to*, so
# each row sums to one. The prediction is $b M$. By hand, with FREE at 0.6: it becomes 0.6 · 0.9 + 0.4 · 0.2 = 0.62.

# %% jupyter={"source_hidden": true}
M = np.array([[0.9, 0.1], [0.2, 0.8]])
np.testing.assert_allclose(np.array([0.6, 0.4]) @ M, [0.62, 0.38])
ten_by_ten = predict(np.eye(N_CELLS), MOVED)  # the ring road has such a matrix, too
np.testing.assert_allclose(one_reading @ ten_by_ten, predict(one_reading, MOVED))

# %% [markdown]
# What happens to a car that gets hidden? With $p$ for the belief in OCCUPIED, one prediction gives $(1 - p)\,a +
# p\,(1 - v) = a + (1 - a - v)\,p$. This leaves one belief unchanged, $p_\infty = a / (a + v)$: what is believed when
# nothing is known any more. And the difference to it shrinks by the same factor in each step, so after $m$
# predictions without a reading:
#
# $$ p_m = p_\infty + (p_0 - p_\infty)\,(1 - a - v)^m $$
#
# Here $p_\infty$ is one third, and 0.7 of the difference is left after each scan. The power $m$ needn't be whole:
# half a step leaves the square root of 0.7. So **a transition matrix belongs to its time step**. A LIDAR that is
# twice as fast, with the same $M$, would forget a hidden car twice as fast.


# %% jupyter={"source_hidden": true}
def follow(scans_per_second, M, seconds=2):
    """Return P(OCCUPIED) of a cell with a return in each scan of the first second, and then out of sight."""
    belief, p = np.array([0.5, 0.5]), []
    for t in range(seconds * scans_per_second):
        belief = belief @ M
        if t < scans_per_second:
            belief = update(np.array([0.05, 0.8]), belief)  # P(return | FREE), P(return | OCCUPIED)
        p.append(belief[1])
    return np.array(p)


kept = np.sqrt(0.7)
M_half = np.array([[1 - (1 - kept) / 3, (1 - kept) / 3], [(1 - kept) * 2 / 3, 1 - (1 - kept) * 2 / 3]])
np.testing.assert_allclose(M_half @ M_half, M)  # two half steps are one step
np.testing.assert_allclose(follow(10, M)[10:] - 1 / 3, (follow(10, M)[9] - 1 / 3) * 0.7 ** np.arange(1, 11))

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="P(OCCUPIED) over two seconds: about 1 while the car is seen for a second, then three falling curves; the right matrices for 10 and for 20 scans a second fall alike, and the old matrix at 20 scans a second falls twice as fast; all end near one third"
fig, ax = plt.subplots(figsize=(6.8, 3), layout="constrained")
curves = (("10 scans a second, its M", 10, M, "o", "#0072b2"), ("20 scans a second, its own matrix", 20, M_half, ".", "black"),
          ("20 scans a second, M of 10", 20, M, "x", "#d55e00"))  # fmt: skip
ends = []
for label, rate, matrix, mark, colour in curves:
    p = follow(rate, matrix)
    ends.append(p[int(1.3 * rate) - 1])
    assert abs(p[-1] - 1 / 3) < 0.03
    ax.plot((np.arange(len(p)) + 1) / rate, p, mark, color=colour, markersize=6, label=label)
ax.axvspan(0, 1, color="0.92", zorder=0)
ax.text(0.5, 0.12, "the car is seen", ha="center", fontsize=9)
ax.axhline(1 / 3, color="0.6", linewidth=1)
ax.text(0.02, 1 / 3 + 0.02, "$p_\\infty$", fontsize=10)
ax.set(xlabel="time [s]", ylabel="P(OCCUPIED)", ylim=(0, 1.05), xlim=(0, 2.03))
ax.legend(fontsize=9, frameon=False)
plt.show()
assert abs(ends[0] - ends[1]) < 0.02
assert ends[1] - ends[2] > 0.1

# %% [markdown]
# So one cell of a map is filtered like a place on a road. Lecture 02 does it for thousands of cells at once.
#
# ## In five lines
#
# 1. A belief sums to one; a likelihood needn't. Posterior = prior times likelihood, divided by the sum.
# 2. Predict forgets, update mostly sharpens. Predict first, because a reading is about now.
# 3. Readings multiply if their errors are independent given the state, and each counts once. A zero is for ever unless the
#    prediction leaks into it.
# 4. A wrong model makes a filter sure and wrong. What it expects to hear may show it, and may not.
# 5. What is now, the filter says; what was then, the smoother. One cell of a map is filtered in the same way, by a
#    transition matrix that belongs to its time step.
#
# ## Further reading and exercise
#
# - Labbe, *Kalman and Bayesian Filters in Python*: [the discrete Bayes
#   filter](https://github.com/rlabbe/Kalman-and-Bayesian-Filters-in-Python), by `filterpy`'s author.
# - Thrun, Burgard, Fox, *Probabilistic Robotics*, MIT Press 2005: localisation on a map.
# - Rabiner, *A tutorial on hidden Markov models*, Proceedings of the IEEE, 1989: filter and smoother.
#
# [Exercise 01](exercises/01_bayes.ipynb): a sensor that gets stuck, a move on ice, a filter that waits for a few
# scans, a matrix for any time step, and a map put together from your own functions. Next: lecture
# [01b](01b_graphical_models.ipynb), what a missing arrow promises. Later: [what to do when a belief has too many
# states](deeper/time_beliefs.ipynb).

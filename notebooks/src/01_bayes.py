# %% [markdown]
# # 01 · Bayes' rule on a line: predict, update, repeat
#
# **In one sentence.** A belief is a row of numbers that sum to one, and a Bayes filter does two things to it, over
# and over: *predict* spreads it, since the world moves on, and *update* multiplies it by what was seen.
#
# **You will be able to**
# - do both steps by hand, and in ten lines of code;
# - say what each of them does to uncertainty, in bits;
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
#
# ```
#            ┌──────────── repeat ────────────┐
# belief ── predict ──▶ prior ── update ──▶ posterior
#             ▲                    ▲
#       how things move     what was seen
# ```

# %% jupyter={"source_hidden": true}
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from filterpy import discrete_bayes
from ipywidgets import FloatSlider, interact
from scipy.special import logsumexp

from semgrid_edu import plotting
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import CmcdotParams, Evidence, FilterState, Particles, PlanarMotion, SensorModel, State
from semgrid_edu.occupancy import scan_evidence, track_drive, transition_matrix
from semgrid_edu.occupancy import update as update_grid

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI

# %% [markdown]
# ## A road with three poles
#
# A vehicle drives round a ring road of ten cells: after cell 9 comes cell 0 again. Poles stand beside cells 2, 3 and
# 7. A sensor looks to the side and says *pole* or *nothing*. It errs: it says *pole* with probability 0.8 beside a
# pole, and with probability 0.1 elsewhere. The map is known. Where is the vehicle?
#
# ```
# pole           |   |               |
# cell   0   1   2   3   4   5   6   7   8   9   (0 ...
# ```
#
# The **belief** $b_n$ is the probability that the vehicle is in cell $n$. You know nothing yet, so $b_n = 0.1$ for
# all ten. Now the sensor says *pole*.
#
# **Predict before you run.** What do you believe of cell 3 now, and of cell 5? There are only two different products:
# write them down, add up all ten, divide.
#
# <details><summary>Answer</summary>Beside a pole 0.1 · 0.8 = 0.08, three times; elsewhere 0.1 · 0.1 = 0.01, seven
# times. They sum to 0.31. So cell 3 gets 0.08 / 0.31 = 0.26 and cell 5 gets 0.01 / 0.31 = 0.03.</details>
#
# With $z$ for what the sensor says, this is Bayes' rule:
#
# $$ P(n \mid z) = \frac{P(z \mid n)\; b_n}{P(z)}, \qquad P(z) = \sum_{n'} P(z \mid n')\; b_{n'} $$
#
# $b_n$ before the reading is the **prior**, $P(z \mid n)$ the **likelihood**, the result the **posterior**: the new
# belief.

# %%
POLES = [2, 3, 7]
N_CELLS = 10
P_POLE = np.where(np.isin(np.arange(N_CELLS), POLES), 0.8, 0.1)  # P("pole" | cell), for each cell


# %% tags=["update"] jupyter={"outputs_hidden": true}
def update(likelihood, prior):
    """Return the posterior: multiply cell by cell, then divide by the sum."""
    product = [p * b for p, b in zip(likelihood, prior, strict=True)]
    return np.array(product) / sum(product)


nothing_known = np.full(N_CELLS, 1 / N_CELLS)
one_reading = update(P_POLE, nothing_known)
np.testing.assert_allclose(one_reading, discrete_bayes.update(P_POLE, nothing_known))
print("cell 3: {:.3f}   cell 5: {:.3f}".format(*one_reading[[3, 5]]))

# %% jupyter={"source_hidden": true}
plotting.probability_lines({"prior": nothing_known, "likelihood of 'pole'": P_POLE, "posterior": one_reading})
plt.show()

# %% [markdown]
# The assertion compares the ten lines with `filterpy`, a library for filters: its `discrete_bayes` has two functions,
# and you have just written the first.
#
# Look at the middle row: it doesn't sum to one, and needn't. A likelihood is not a belief. It answers ten *what if*
# questions: if the vehicle were here, how probable was it that the sensor says what it said? The sum below the
# fraction, $P(z) = 0.31$, is how probable that was altogether, before it was said. It only normalises, but keep an
# eye on it: when it is tiny, the filter is astonished.
#
# ## The vehicle drives on: predict
#
# The odometer says: one cell forward. Odometers err too: with probability 0.1 the vehicle hasn't left its cell, with
# 0.8 it has moved by one, with 0.1 by two. Known to be in cell 2, it would be in 2, 3, 4 with probabilities 0.1, 0.8,
# 0.1.
#
# **Predict before you run.** The belief has three peaks of 0.26, in cells 2, 3 and 7, and 0.03 elsewhere. What is it
# in cell 3 after the move? Ask from where one can get there: from 2, from 3 and from 1.
#
# <details><summary>Answer</summary>From 2 by one: 0.8 · 0.26 = 0.206. From 3, not moved: 0.1 · 0.26 = 0.026. From 1
# by two: 0.1 · 0.03 = 0.003. Together 0.24. Nothing needs to be normalised: what leaves one cell arrives in
# another.</details>
#
# With $m_d$ for the probability of moving by $d$ cells:
#
# $$ b'_n = \sum_d m_d\; b_{n-d} $$
#
# A sum of this form is a *convolution*, and $m$ is its kernel. On the ring road $n - d$ goes round.

# %% tags=["predict"] jupyter={"outputs_hidden": true}
MOVED = np.array([0.1, 0.8, 0.1])  # by 0, 1, 2 cells


def predict(belief, moved):
    """Return the belief after a move: for each cell, from where could the vehicle have come?"""
    after = np.zeros(len(belief))
    for n in range(len(belief)):
        for d, m in enumerate(moved):
            after[n] += m * belief[(n - d) % len(belief)]
    return after


moved_on = predict(one_reading, MOVED)
np.testing.assert_allclose(moved_on, discrete_bayes.predict(one_reading, offset=1, kernel=MOVED))
print(f"cell 3: {moved_on[3]:.3f}   sum: {moved_on.sum():.3f}")

# %% [markdown]
# In `filterpy` the kernel is centred: `offset=1` moves by one cell, and the kernel says how far off that may be.
#
# After the move the sensor says *pole* again. Two poles in neighbouring cells: that fits only one place on this road.

# %% jupyter={"source_hidden": true}
two_readings = update(P_POLE, moved_on)
plotting.probability_lines(
    {"after one reading": one_reading, "after the move": moved_on, "after the second reading": two_readings}
)
plt.show()

# %% [markdown]
# See how the middle row is the upper one, one cell to the right and blunter. In the lower row cell 3 has 0.55:
# neither reading could tell 2, 3 and 7 apart, their order in time could. **This is why a filter needs the
# prediction:** it carries what was seen there and then to here and now.
#
# ## Repeat, and count the bits
#
# That was all. The rest is repetition. To see it work we need a vehicle that really errs as the model says, so we
# draw one trip at random. The filter doesn't see the places, only the readings.


# %%
def trip(steps, rng, poles=POLES, moved=MOVED, hit=0.8):
    """Return the places of a random trip, and whether the sensor says "pole" at each."""
    moves = rng.choice(3, size=steps, p=moved)
    places = (rng.integers(N_CELLS) + np.cumsum(moves)) % N_CELLS
    says_pole = rng.random(steps) < np.where(np.isin(places, poles), hit, 0.1)
    return places, says_pole


def entropy(belief):
    """Return the uncertainty of a belief in bits; what is impossible adds nothing."""
    possible = belief[belief > 0]
    return -np.sum(possible * np.log2(possible))


# %% [markdown]
# The **entropy** $S = -\sum_n b_n \log_2 b_n$ counts uncertainty in bits: 0 when one cell has everything, 1 for two
# cells in balance, $\log_2 10 = 3.3$ for ten.
#
# **Predict before you run.** One of the two steps can never lower the entropy on this road. Which one? And is it true
# that the other can never raise it?
#
# <details><summary>Answer</summary>Prediction never lowers it: each new number is a mean of old ones, so peaks get
# lower and holes fill up. Update lowers it usually, but not always: a reading that contradicts what you believed
# leaves you with two explanations instead of one. A surprise makes you less sure, and rightly so. (Where a road ends
# at a wall, even prediction can lower the entropy: in time, everybody stands at the wall.)</details>

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

fig, axes = plt.subplots(2, 1, figsize=(7, 4.2), sharex=True, layout="constrained")
plotting.belief_history(np.array(history), ax=axes[0], truth=places).set(xlabel="")
axes[1].plot(np.repeat(np.arange(25), 2) + np.tile([-0.25, 0.0], 25), bits, "-", color="0.6")
axes[1].plot(np.arange(25) - 0.25, bits[::2], "o", color="#0072b2", markersize=4, label="after predict")
axes[1].plot(bits[1::2], "s", color="#d55e00", markersize=4, label="after update")
axes[1].set(xlabel="step", ylabel="entropy [bits]", ylim=(0, 3.4))
axes[1].legend(fontsize="small", ncols=2, frameon=False)
plt.show()
print("the favourite cell made one expect another reading at steps", surprises)
print("    of these the sensor says 'pole' at", [k for k in surprises if says_pole[k]])
raised = [k for k in range(25) if bits[2 * k + 1] > bits[2 * k]]
print("the update raised the entropy at steps", raised)
assert raised == [k for k in surprises if not says_pole[k]]
favourite = np.argmax(history, axis=1)
print("the favourite after steps 2 to 8:", favourite[2:9], "  the truth:", places[2:9])

# %% [markdown]
# Above, the bluer the surer, and circles are the truth. Below, the entropy goes up with every prediction (circles) and
# mostly down with every update (squares). At step 3 the sensor has said *pole* twice in a row. That fits the two
# neighbouring poles, so the filter takes the vehicle to be in cell 3. But it hasn't moved and is still in cell 2,
# beside the same pole. One step later it is in cell 3, and the filter is right. From then on it lives in the balance of
# the two steps, and nothing is ever *settled*: at step 7 it has lost the vehicle again.
#
# Six readings are surprises: not what the favourite cell made one expect. At three of them the sensor says *nothing*
# where a pole was expected, and these are the three updates that raise the entropy. At the other three it says *pole*
# where none was expected. Poles are rare, so such a reading leaves few cells, and the entropy falls all the same.
#
# *Mostly* down can be made exact. Two cells, one without a pole (belief 0.8), one with (0.2). Here *pole* is a surprise
# that raises the entropy:

# %%
prior, p_pole = np.array([0.8, 0.2]), np.array([0.1, 0.8])
p_says = [(1 - p_pole) @ prior, p_pole @ prior]  # P(z) of "nothing", of "pole"
after = [entropy(update(likelihood, prior)) for likelihood in (1 - p_pole, p_pole)]
print(f"before {entropy(prior):.2f} bits; after 'nothing' {after[0]:.2f}, after 'pole' {after[1]:.2f}")
print(f"on average, with P(z) = {p_says[0]:.2f} and {p_says[1]:.2f}: {np.dot(p_says, after):.2f}")
assert after[1] > entropy(prior) > np.dot(p_says, after)

# %% [markdown]
# One reading may confuse you; what a sensor says *on average* cannot. That holds for every sensor and every belief.
#
# ## In any order, but each once
#
# The vehicle stands still and the sensor reads twice: *pole*, *nothing*. Does it matter which came first?
# Multiplication says no. So evidence that belongs to one instant may come in any order, or all at once, as one
# product.

# %%
one_way = update(1 - P_POLE, update(P_POLE, nothing_known))
other_way = update(P_POLE, update(1 - P_POLE, nothing_known))
np.testing.assert_allclose(one_way, other_way)
np.testing.assert_allclose(one_way, update(P_POLE * (1 - P_POLE), nothing_known))

# %% [markdown]
# The product takes for granted that the two readings err *independently*: that, for a given place, the first tells
# nothing about the second.
#
# **Predict before you run.** A bug delivers the same reading, *pole*, twice. What does the filter believe of the
# three cells with poles: 0.26 each, as it should, or what else?
#
# <details><summary>Answer</summary>0.8² = 0.64 against 0.1² = 0.01, as if the sensor were that good: 0.064 three
# times, 0.001 seven times, sum 0.199. So 0.32 each: the poles have 96 % instead of 77 %. The filter is sure of
# something that it has not seen.</details>

# %% jupyter={"outputs_hidden": true}
twice = update(P_POLE, one_reading)
np.testing.assert_allclose(twice, update(P_POLE**2, nothing_known))
print(f"on the three cells with poles: once {one_reading[POLES].sum():.2f}, counted twice {twice[POLES].sum():.2f}")

# %% [markdown]
# Predict and update don't commute. A reading speaks of where the vehicle is *now*; used before the move is taken into
# account, it speaks of the wrong cells:

# %%
right = update(P_POLE, predict(one_reading, MOVED))
wrong = predict(update(P_POLE, one_reading), MOVED)
print(f"cell 3: predict, then update {right[3]:.2f};  update, then predict {wrong[3]:.2f}")

# %% [markdown]
# ## What a zero does
#
# **Predict before you run.** You are certain: the vehicle is in cell 5, $b_5 = 1$. There is no pole there, and the
# sensor says *pole* ten times. What do you believe now? What if you had started with 0.999 instead, and the rest on
# cell 7?
#
# <details><summary>Answer</summary>Still 1: the other nine cells have 0, and 0 times anything is 0. However absurd
# the readings, certainty can't be corrected. With 0.999 against 0.001 each reading multiplies the odds of cell 7 by
# 8, so 8⁴ = 4096 turns them round: four readings.</details>

# %% jupyter={"outputs_hidden": true}
certain, nearly = np.eye(N_CELLS)[5], np.zeros(N_CELLS)
nearly[[5, 7]] = 0.999, 0.001
for reading in range(1, 11):
    certain, nearly = update(P_POLE, certain), update(P_POLE, nearly)
    if reading in (3, 4, 10):
        print(f"{reading:2d} readings: certain {certain[5]:.3f}, nearly certain {nearly[5]:.3f} of cell 5")

# %% [markdown]
# And if the sensor's model holds a zero, *pole* is impossible in cell 5, the product is zero everywhere, and the
# result is 0/0. So: **no zeros in sensor models, and a prediction that leaks a little to everywhere.** The package
# refuses a sensor that never errs, and its update answers 0/0 with *nothing is known any more*.
#
# Computers make zeros of their own. A belief over a drive is a product of thousands of numbers, and floating-point
# numbers end at $10^{-308}$:

# %%
likelihoods = np.tile([[0.1], [0.2]], 500)  # two places, 500 readings; the second explains each of them twice as well
print("product:", likelihoods.prod(axis=1), "  sum of logarithms:", np.log(likelihoods).sum(axis=1).round(1))


def log_update(log_likelihood, log_prior):
    """Return the logarithm of the posterior: products become sums, and the division a difference."""
    log_product = log_likelihood + log_prior
    return log_product - logsumexp(log_product)


np.testing.assert_allclose(np.exp(log_update(np.log(P_POLE), np.log(moved_on))), two_readings)

# %% [markdown]
# A filter that normalises at each step is safe, since only ratios matter. Where products get long, or where one wants
# to add instead of multiply, one works with logarithms: lecture 02 builds a whole map of them.
#
# ## Turn the problem round
#
# So far the map was known and the place was not. A LIDAR on a vehicle with good odometry has the opposite problem:
# its place is known, the *map* isn't. So ask, for **one cell** of the ground: is it FREE or OCCUPIED? Two hypotheses
# instead of ten, and the same two steps.
#
# A beam that **passes** the cell has probability 0.7 if the cell is free, and 0.3 if it is occupied (bushes are
# porous). A beam that **comes back** from it has 0.05 if it is free (grazing rays) and 0.8 if it is occupied.
#
# **Predict before you run.** Start with 0.5. Two beams pass, then one comes back. What is P(OCCUPIED) after each?
# Here it is easier with odds: P(OCCUPIED) : P(FREE).
#
# <details><summary>Answer</summary>Odds 1, then 3/7 = 0.43, then 9/49 = 0.18; the return multiplies by 0.8/0.05 = 16:
# 2.94. As probabilities: 0.30, 0.16, 0.75. One return outweighs three passes.</details>
#
# (0.3 and 0.8 sum to more than one. They needn't fit together: of each pair only the ratio counts, so a pair may be
# scaled as you like.)

# %% jupyter={"outputs_hidden": true}
PASS, HIT = np.array([0.7, 0.3]), np.array([0.05, 0.8])  # P(z | FREE), P(z | OCCUPIED)
belief = np.array([0.5, 0.5])
for name, likelihood in (("pass", PASS), ("pass", PASS), ("return", HIT)):
    posterior = update(likelihood, belief)
    np.testing.assert_allclose(posterior, discrete_bayes.update(likelihood, belief))
    belief = posterior
    print(f"{name:<7} P(OCCUPIED) = {belief[1]:.2f}")

# %% [markdown]
# Not a line of the code had to change. And predict? A cell doesn't move, but its *state* does: cars come and go. Say
# that, from one scan to the next, a free cell becomes occupied with probability 0.1, and an occupied one free with
# 0.2:
#
# $$ b'_j = \sum_i b_i\, M_{ij}, \qquad M = \begin{pmatrix} 0.9 & 0.1 \\ 0.2 & 0.8 \end{pmatrix} $$
#
# $M_{ij}$ is the probability to go *from* $i$ *to* $j$, so **rows** sum to one, and the belief is a row that stands
# to the left. By hand: FREE 0.6, OCCUPIED 0.4 becomes FREE 0.6 · 0.9 + 0.4 · 0.2 = 0.62.


# %%
def predict_states(belief, M):
    """Return the belief after a transition, literally."""
    after = np.zeros(len(belief))
    for i, j in np.ndindex(M.shape):
        after[j] += belief[i] * M[i, j]
    return after


M = np.array([[0.9, 0.1], [0.2, 0.8]])
print(predict_states(np.array([0.6, 0.4]), M).round(2))

ring = np.array([predict(place, MOVED) for place in np.eye(N_CELLS)])  # row i: where a vehicle in cell i will be
np.testing.assert_allclose(predict_states(one_reading, ring), predict(one_reading, MOVED))

# %% [markdown]
# The last two lines say that the ring road was nothing else: a convolution is a transition matrix whose rows are one
# kernel, shifted. A matrix is more general: each state may have its own way to change.
#
# ## A matrix for any time step
#
# **Predict before you run.** You tuned $M$ for a LIDAR with 10 scans a second. The new one makes 20, and you leave
# $M$ as it is. What happens to the filter?
#
# <details><summary>Answer</summary>It forgets twice as fast: in each tenth of a second $M$ is applied twice. The
# matrix belongs to a time step. What belongs to the world are *rates*: how often, a second, does a free cell become
# occupied?</details>
#
# By hand: what stands in a cell leaves it at the rate of 1 a second. In 0.1 s a tenth of the belief has left, or so:
# do it in two steps of 0.05 s, and 0.95² = 0.9025 is left; in ten of 0.01 s, 0.99¹⁰ = 0.9044. The finer the cut, the
# nearer to $e^{-0.1} = 0.9048$, which is exact.
#
# Give the rates $R_{ij}$, from state $i$ to $j$, in 1/s. In a very short time $\epsilon$ the belief changes by
# $\epsilon\, b R$ (the diagonal of $R$ is what leaves: rows of $R$ sum to zero). Many short times make a time step
# $\Delta t$, in the code `dt`:
#
# $$ M(\Delta t) = \lim_{k \to \infty} \left(I + R\,\frac{\Delta t}{k}\right)^{k} = \exp(R\,\Delta t) $$
#
# The filter of this course has four states: FREE, STATIC and DYNAMIC (the two kinds of occupied), and UNKNOWN, for
# what nobody has seen, or not for long. For this page:

# %% tags=["transition-matrix"] jupyter={"outputs_hidden": true}
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

# %% jupyter={"source_hidden": true}
times = np.linspace(0, 10, 51)
fig, axes = plt.subplots(1, 2, figsize=(9, 2.4), sharey=True, layout="constrained")
for ax, state in zip(axes, (State.STATIC, State.DYNAMIC), strict=True):
    forgets = np.array([np.eye(4)[state] @ transition_matrix(params, t) for t in times])
    plotting.state_history(times, forgets.T, ax=ax).set_title(f"{state.name}, then out of sight")
axes[0].get_legend().remove()
axes[1].set_ylabel("")
plt.show()

# %% [markdown]
# A wall is remembered for a while; of a moving thing one can say little after a second: it leaves the cell, and what
# comes next nobody knows. Memory of a thing should last as long as the thing stays. That is what a matrix with four
# states can say and one with two can't.
#
# ## One cell of the drive
#
# Now the drive. Over its 20 frames we watch four spots on the ground, given by x and y in the first frame:

# %% jupyter={"source_hidden": true}
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
# (lecture 02 shows how). Where a scan says nothing of a cell, they are equal. One letter a scan: `#` for a return,
# `.` for a beam that passes, a blank for nothing.

# %%
for name, o, f in zip(SPOTS, occupied.T, free.T, strict=True):
    print(f"{name:<24}{''.join('#' if a > b else '.' if a < b else ' ' for a, b in zip(o, f, strict=True))}")

# %% [markdown]
# UNKNOWN needs one more rule. It means that nobody has looked, so a cell that a scan says anything of isn't UNKNOWN
# any more: its share goes to the other three as cells are found at **first sight**. Above we assumed FREE 0.85, STATIC
# 0.14, DYNAMIC 0.01.
#
# **Predict before you run.** For two seconds the house gives returns, the car for four scans. A return is as probable
# from a parked car as from one that moves: STATIC and DYNAMIC share P(z | occupied). So can the filter of one cell
# ever tell them apart? If so, what does it know that the likelihood doesn't say?
#
# <details><summary>Answer</summary>Bayes' rule multiplies STATIC and DYNAMIC by the same number, so it never changes
# their proportion. That proportion comes from what we assume. By our rates, a free cell becomes DYNAMIC ten times as
# often as STATIC, so what appears in a free cell is called DYNAMIC. At first sight STATIC is fourteen times as frequent
# as DYNAMIC, so the house, which is there from the first scan, is called STATIC at once.</details>

# %%
ONE_CELL = GridSpec(x_min=0, x_max=1, y_min=0, y_max=1, cell=1)


def step(belief, occupied, free, assumed=params, update=update):
    """Return the belief of one cell after a time step and a scan: predict, reveal, update."""
    prior = predict_states(belief, transition_matrix(assumed, dt=0.1))
    if occupied != free:
        prior = prior + prior[State.UNKNOWN] * np.array([*assumed.first_sight, -1])
    return update([free, occupied, occupied, free], prior)


def step_of_package(belief, occupied, free):
    """Return the same by the package's update, which reveals, too, and works on a grid: here on one of one cell."""
    predicted = (belief @ M).reshape(4, 1, 1)
    state = FilterState(predicted, Particles.none(), newborn=predicted[State.DYNAMIC])
    scan = Evidence(np.full((1, 1), occupied), np.full((1, 1), free))
    return update_grid(state, ONE_CELL, scan, params).probability[:, 0, 0]


# %% jupyter={"outputs_hidden": true}
history = np.empty((len(frames), len(SPOTS), 4))
belief = np.tile([0.0, 0.0, 0.0, 1.0], (len(SPOTS), 1))  # UNKNOWN
for k, spot in np.ndindex(history.shape[:2]):
    before, scan = belief[spot].copy(), (occupied[k, spot], free[k, spot])
    belief[spot] = history[k, spot] = step(before, *scan)
    np.testing.assert_allclose(belief[spot], step(before, *scan, update=discrete_bayes.update))
    np.testing.assert_allclose(belief[spot], step_of_package(before, *scan), atol=1e-6)
assert min(history[0, 0, State.FREE], history[0, 1, State.STATIC]) > 0.9  # road and house, first scan

times = [frame.time - frames[0].time for frame in frames]
fig, axes = plt.subplots(2, 2, figsize=(9, 4.6), sharex=True, sharey=True, layout="constrained")
for ax, name, cell in zip(axes.ravel(), SPOTS, history.transpose(1, 2, 0), strict=True):
    plotting.state_history(times, cell, ax=ax).set_title(name)
    ax.label_outer()
    if ax is not axes[0, 1]:
        ax.get_legend().remove()
plt.show()

# %% [markdown]
# Each picture is one cell over two seconds, each band as high as its state is probable. At its first scan the road is
# free and the house STATIC, both above 0.9. For the house that is the prior of first sight and no prediction: the rates
# have had no time to act. Below on the left the car is there within one scan and mostly DYNAMIC: the right
# answer, for the reason that you have predicted. It isn't ten to one, though. A little STATIC was left over from
# before, and nearly as much again has come in by way of UNKNOWN: what the prediction forgets of the free cell is shared
# out anew at each scan, and at first sight standing things are more frequent than moving ones. When the car has left,
# the cell needs three scans to believe it; remember that for the next lecture. On the right the belief fades while the
# car hides the cell, and is back when it is seen again.
#
# A few lines agree with `filterpy` and with the package to six digits. The package does this in thousands of cells at
# once.
#
# ### How much of this rests on one rate?
#
# On this page a free cell turns DYNAMIC at a rate of 0.2 a second: that is the number behind the word *ten times*. The
# package's default is 0.01. So change this one number, filter the car's cell again, and look at its last return. Then
# take all of the package's defaults. Last, take the same cell from the package's whole filter, with the same defaults.

# %%
car = list(SPOTS).index("a car drives through")
last = np.flatnonzero(occupied[:, car] > free[:, car])[-1]


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

# %%
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
assert whole_filter[State.DYNAMIC] > 0.9

# %% [markdown]
# The verdict on the car rests on that rate. At 0.1 a second the two are level. With the package's defaults the same
# returns say STATIC, 0.80 to 0.20. So prediction *can* tell moving from standing, but a single cell knows only what it
# was told: how often something moving appears out of nowhere. Why does the package take so small a rate, and still
# call this cell DYNAMIC (last row)? Because its cells aren't alone: the car comes from a neighbouring cell, which
# predicts it. Lectures 03 and 04 show how.
#
# ## Play with it
#
# Back to the ring road. Two sliders: how often the sensor says *pole* beside a pole, and how probable it is that the
# vehicle moves by less or more than one cell. When does the filter keep track? What is worse, a bad sensor or bad
# odometry? (Without a running kernel there are no sliders; the figure below them shows three settings.)


# %% tags=["nbval-ignore-output"]
def localise(says_pole, sensor, moved=MOVED):
    """Return the belief after each reading; `sensor` holds the likelihoods of "nothing" and of "pole"."""
    belief, history = nothing_known, []
    for says in says_pole:
        belief = update(sensor[int(says)], predict(belief, moved))
        history.append(belief)
    return np.array(history)


def show(hit, slip, ax=None):
    """Draw a trip of 40 steps, and what a filter believes that knows sensor and odometry; return places, favourites."""
    moved = np.array([slip / 2, 1 - slip, slip / 2])
    places, says_pole = trip(40, np.random.default_rng(6), moved=moved, hit=hit)
    p_pole = np.where(np.isin(np.arange(N_CELLS), POLES), hit, 0.1)
    history = localise(says_pole, [1 - p_pole, p_pole], moved)
    right = 100 * np.mean(history.argmax(axis=1) == places)
    ax = plotting.belief_history(history, ax, truth=places)
    ax.set_title(f"P(pole | pole) {hit:.2f}, slip {slip:.2f}: right in {right:.0f} %", fontsize="medium")
    return places, history.argmax(axis=1)


sliders = {"hit": FloatSlider(value=0.8, min=0.1, max=0.99, step=0.01), "slip": FloatSlider(value=0.2, min=0, max=0.9)}
_ = interact(lambda hit, slip: (show(hit, slip), plt.show())[1], **sliders)

# %%
fig, axes = plt.subplots(1, 3, figsize=(12, 2.7), sharey=True, layout="constrained")
trips = []
for ax, (hit, slip) in zip(axes, ((0.8, 0.2), (0.99, 0.02), (0.99, 0.6)), strict=True):
    trips.append(show(hit, slip, ax))
    ax.label_outer()
plt.show()
places, favourites = trips[1]
print("in the middle, steps 10 to 15: the vehicle is in", places[10:16], " the favourite is", favourites[10:16])

# %% [markdown]
# On the left the numbers of this page, in the middle a good sensor and good odometry: once the pair of poles has been
# seen, at step 5, the place is known. The one slip, at step 12, is noticed two steps later, when the filter expects the
# pole beside cell 2 and the sensor says *nothing*. On the right the same good sensor with bad odometry: most cells have
# no pole, and between poles only the odometer speaks. Now try the opposite, `hit` 0.5 and `slip` 0.02: where odometry
# is good, each reading helps for a long time. At `hit` 0.1 the sensor says *pole* as often here as there: it carries no
# information, and no filter can invent any.
#
# ## Where this breaks
#
# **Sure and wrong.** A filter says how sure it is, and that can be tested: over many trips, take the belief that it
# gives to its favourite cell, and see how often the vehicle is there. In an honest filter the two agree. Now break
# one assumption at a time.


# %%
def claims_and_truth(sensor, poles=POLES):
    """Return the mean belief in the favourite cell, and how often the vehicle is there, over 400 trips."""
    rng, claimed, right = np.random.default_rng(0), [], []
    for _ in range(400):
        places, says_pole = trip(30, rng, poles=poles)
        history = localise(says_pole, sensor)
        claimed.append(history.max(axis=1))
        right.append(history.argmax(axis=1) == places)
    return np.mean(claimed), np.mean(right)


SENSOR = np.array([1 - P_POLE, P_POLE])
BOASTS = np.where(SENSOR > 0.5, 0.99, 0.01)
measured = {
    "all as assumed": claims_and_truth(SENSOR),
    "sensor thought\nto err in 1 %": claims_and_truth(BOASTS),
    "each reading\ncounted twice": claims_and_truth(SENSOR**2),
    "a pole was moved\nfrom 7 to 8": claims_and_truth(SENSOR, poles=[2, 3, 8]),
}

# %%
fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
places = np.arange(len(measured))
for shift, label, colour, values in zip(
    (-0.2, 0.2), ("it claims", "it is right"), ("#0072b2", "0.6"), np.transpose(list(measured.values())), strict=True
):
    ax.bar_label(ax.bar(places + shift, values, width=0.38, label=label, color=colour), fmt="%.2f", fontsize="small")
ax.set_xticks(places, measured)
ax.set(ylabel="probability", ylim=(0, 0.95))
ax.legend(ncols=2, fontsize="small", frameon=False)
plt.show()
(honest, is_honest), *broken = measured.values()
assert abs(honest - is_honest) < 0.02
assert all(claim > truth + 0.1 for claim, truth in broken)

# %% [markdown]
# The first pair agrees. In the other three the filter claims far more than it knows, and nothing in its belief shows
# it: it looks as sharp as ever, or sharper. Counting twice is the most usual of the three, in disguise. Ten returns
# of one scan from the same bush, or the same bush in ten scans, are not ten independent witnesses. That is why the
# package's sensor model lets only the first `max_returns` returns of a cell count, and never believes that a sensor
# is nearly perfect.
#
# **A ghost.** The road has been free for two seconds. Now two grazing rays come back from it, and then beams pass
# again.

# %%
road = history[-1, list(SPOTS).index("road")]
hits = sensor.p_hit_occupied**2, sensor.p_hit_free**2
passes = sensor.p_pass_occupied, sensor.p_pass_free
for scan in (hits, *[passes] * 5):
    road = step(road, *scan)
    print(
        f"{'two returns' if scan is hits else 'pass':<12}FREE {road[State.FREE]:.2f}  DYNAMIC {road[State.DYNAMIC]:.2f}"
    )

# %% [markdown]
# For two scans something seems to stand on the road, and to move. The cell can't know better: that something turns up
# in free space *is* what the rates call moving. Its neighbours could tell it: a real car comes from somewhere, and is
# in the next cell a moment later. One cell, filtered by itself, has no velocity. That is the subject of lectures 03
# and 04; lecture [02](02_grids.ipynb) first puts thousands of such cells side by side.
#
# ## In five lines
#
# 1. A belief sums to one; a likelihood needn't. Posterior = prior times likelihood, divided by the sum.
# 2. Predict spreads, update sharpens on average; a surprise may blur. Predict first: a reading speaks of now.
# 3. Evidence of one instant may come in any order, but each piece once. Zeros can't be corrected.
# 4. States change by a matrix $M = \exp(R\,\Delta t)$: rates belong to the world, the matrix to a time step.
# 5. A grid cell is filtered like a place on a road. STATIC and DYNAMIC look alike to a scan: what tells them apart is
#    what we assume, the rates and what is found at first sight.
#
# ## Further reading
#
# - Labbe, *Kalman and Bayesian Filters in Python*, chapter 2: [the discrete Bayes
#   filter](https://github.com/rlabbe/Kalman-and-Bayesian-Filters-in-Python), by `filterpy`'s author.
# - Thrun, Burgard, Fox, *Probabilistic Robotics*, MIT Press 2005, chapters 2 and 8: the filter in general, and
#   localisation on a map.
# - Rabiner, *A tutorial on hidden Markov models*, Proceedings of the IEEE 77(2), 1989: the same recursion, called the
#   forward algorithm.
# - Norris, *Markov Chains*, Cambridge 1997, chapter 2: rates and $\exp(R\,\Delta t)$.
# - [Graphical models from nothing](deeper/graphical_models.ipynb), a companion to this course: the filter as one half
#   of message passing, and what a missing edge costs.
#
# ## Exercise
#
# [Exercise 01](exercises/01_bayes.ipynb): update, predict with and without a border, a whole trip, the half-life of a
# cell, and one question.

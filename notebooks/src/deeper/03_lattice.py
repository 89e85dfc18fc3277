# %% [markdown]
# # The lattice of velocities: how it moves, what it costs, where it errs
#
# **In one sentence.** A filter on a lattice of velocities is exact for what the lattice can say; changes of speed and
# distances of less than a cell have to be translated into its steps, and each finer step is paid for in every cell.
#
# **You will be able to**
# - show that BOF, in one cell and without motion, is the discrete Bayes filter of lecture 01;
# - derive the probability of a jump between velocities from an acceleration, and say where it fails;
# - say why whole cells and a remainder are better than interpolation;
# - say how memory grows with the lattice.
#
# **Prerequisites.** Lecture [03](../03_bof.ipynb).
#
# **Time.** 30 minutes, of which the computer needs less than one.

# %% jupyter={"source_hidden": true}
import sys

import matplotlib.pyplot as plt
import numpy as np
from filterpy.discrete_bayes import update as discrete_update

# %% jupyter={"source_hidden": true}
from semgrid_edu import plotting
from semgrid_edu.grid import GridSpec
from semgrid_edu.occupancy import BofParams, BofState, Evidence, State, VelocityLattice, WorldModel
from semgrid_edu.occupancy import bof_predict, bof_update, bof_velocity, scan_evidence
from semgrid_edu.occupancy import transition_matrix

sys.path.append("..")  # for worlds/, in the folder above
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
FREE, STATIC, DYNAMIC, UNKNOWN = State
NO_CHANGE = ((0.0,) * 4,) * 4
steady = WorldModel(rates=NO_CHANGE, stop_rate=0, max_acceleration=0, walls=None)  # things move, and that is all
lattice = VelocityLattice(max_speed=1, spacing=1)
coarse = VelocityLattice(max_speed=8, spacing=2)


def state_of(occupied, lattice):
    """Return a belief without UNKNOWN: what the velocities leave of 1 is FREE."""
    free = 1 - occupied.sum(axis=0)
    return BofState(free, 0 * free, occupied, lattice.velocities, np.zeros((len(lattice), 2)))


# %% [markdown]
# ## One cell, no motion: lecture 01 again
#
# One cell holds FREE 0.6 and STATIC 0.4. It sees five scans: hit, hit, passed, hit, passed. Nothing moves. The discrete
# Bayes filter of lecture 01 predicts by the transition matrix, $b \leftarrow b M$, and updates by Bayes' rule. BOF must
# do exactly that.

# %%
one_cell = GridSpec(x_min=0, x_max=1, y_min=0, y_max=1, cell=1)
rates = np.zeros((4, 4))
rates[FREE, STATIC], rates[STATIC, FREE] = 0.2, 0.5  # a second; nothing ever moves
params = BofParams(lattice, WorldModel(rates=tuple(map(tuple, rates))))
M = transition_matrix(params.world, dt=0.1)[:2, :2]
b = np.array([0.6, 0.4])
occupied = np.zeros((len(lattice), 1, 1), np.float32)
occupied[0] = 0.4
state = state_of(occupied, lattice)
for hit in (True, True, False, True, False):
    if_free, if_occupied = (0.05, 0.8) if hit else (0.7, 0.3)
    b = discrete_update(np.array([if_free, if_occupied]), b @ M)
    scan = Evidence(np.full((1, 1), if_occupied, np.float32), np.full((1, 1), if_free, np.float32))
    state = bof_update(bof_predict(state, one_cell, params, dt=0.1), one_cell, scan, params)
    np.testing.assert_allclose(state.probability[:2, 0, 0], b, atol=1e-5)
    print(f"{'hit' if hit else 'passed':<8} P(STATIC) = {b[1]:.3f}")

# %% [markdown]
# So BOF adds one thing to lecture 01's filter: probability that flows from one cell into the next.
#
# ## A little acceleration
#
# Things change their speed. Say that the acceleration along each axis lies between $-\alpha$ and $\alpha$ = 6 m/s², all
# values alike. In a tenth of a second the speed changes by up to 0.6 m/s: a variance of 0.6²/3 = 0.12 (m/s)². But on a
# lattice with a spacing of $\Delta v$ = 2 m/s nothing can get 0.6 m/s faster.
#
# **Predict before you run.** It can get 2 m/s faster, seldom, or 2 m/s slower, just as seldom. How seldom, for the same
# variance?
#
# <details><summary>Answer</summary>
#
# With probability $\eta$ up and $\eta$ down the variance is 2 $\eta$ · 2² = 8 $\eta$ = 0.12, so $\eta$ = 0.015. A rare jump takes the place of a
# small change at every step; over many steps the two have the same variance.
#
# </details>
#
# $$ 2 \eta\, (\Delta v)^2 = \frac{(\alpha\,\Delta t)^2}{3} \quad\Rightarrow\quad
#    \eta = \frac{(\alpha\,\Delta t)^2}{6\, (\Delta v)^2} $$


# %% tags=["bof-acceleration"] jupyter={"outputs_hidden": true}
def accelerate(joint, velocities, spacing, jump):
    """Return P(m = v), (V,), after a share `jump` of each moving bin has gone to each of its neighbours."""
    index = {tuple(v): k for k, v in enumerate(velocities.tolist())}
    changed = joint.copy()
    for k, (vx, vy) in enumerate(velocities.tolist()):
        for side in ((vx + spacing, vy), (vx - spacing, vy), (vx, vy + spacing), (vx, vy - spacing)):
            if (vx, vy) != (0, 0) and side != (0, 0) and side in index:
                changed[k] -= jump * joint[k]
                changed[index[side]] += jump * joint[k]
    return changed


at_4 = coarse.velocities.tolist().index([4, 0])
square = GridSpec(x_min=0, x_max=11, y_min=0, y_max=11, cell=1)
occupied = np.zeros((len(coarse), 11, 11), np.float32)
occupied[at_4, 5, 5] = 0.5
changed = accelerate(occupied[:, 5, 5], coarse.velocities, spacing=2, jump=(6 * 0.1) ** 2 / (6 * 2**2))
hurried = BofParams(coarse, WorldModel(rates=NO_CHANGE, stop_rate=0, max_acceleration=6))
predicted = bof_predict(state_of(occupied, coarse), square, hurried, dt=0.1)
np.testing.assert_allclose(predicted.occupied.sum(axis=(1, 2)), changed, atol=1e-6)
for v in ([4, 0], [6, 0], [2, 0], [4, 2], [4, -2]):
    print(v, f"{changed[coarse.velocities.tolist().index(v)]:.4f}")

# %% [markdown]
# These jumps leave out the velocity zero: how likely a standing thing is to start moving stands in the transition
# matrix.
#
# ## Less than a cell in a step
#
# In a tenth of a second something that does 1 m/s covers a fifth of a cell of half a metre.
#
# **Predict before you run.** (a) Round: where is the mass after 20 steps? (b) Interpolate: four fifths stay, one fifth
# goes on, at each step. How much of the mass is in the right cell after 20 steps?
#
# <details><summary>Answer</summary>
#
# (a) Where it was: 0.2 rounds to 0, twenty times. Everything slower than 2.5 m/s would stand. (b) It goes on in n of 20
# steps with the binomial probability for 1/5: in the right cell, n = 4, is 22 %. The rest is spread over the cells
# before and behind, an uncertainty that comes from the arithmetic alone.
#
# </details>

# %% jupyter={"outputs_hidden": true}
road = GridSpec(x_min=0, x_max=6, y_min=0, y_max=0.5, cell=0.5)


def whole_cells(v, dt, cell, remainder):
    """Return by how many whole cells a map shifts, and how far beyond them its mass is, metres."""
    way = remainder + v * dt
    n = round(way / cell)
    return n, way - n * cell


forward = lattice.velocities.tolist().index([1, 0])
occupied = np.zeros((len(lattice), *road.shape), np.float32)
occupied[forward, -3] = 1  # 1.25 m ahead
slow, nothing_else = state_of(occupied, lattice), BofParams(lattice, steady)
blurred, remainder, shifts = occupied[forward, :, 0].astype(float), 0.0, []
for _ in range(20):
    n, remainder = whole_cells(1.0, 0.1, 0.5, remainder)
    shifts.append(n)
    slow = bof_predict(slow, road, nothing_else, dt=0.1)
    assert np.isclose(slow.remainder[forward, 0], remainder)
    blurred = 0.8 * blurred + 0.2 * np.append(blurred[1:], 0)
print("cells shifted:", *shifts)
print(f"in the right cell: {slow.occupied[forward, 5, 0]:.2f}, by interpolation {blurred[5]:.2f}")
assert slow.occupied[forward, 5, 0] > 0.99

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="probability over places after two seconds: one dark bar at 3.25 m, the truth, and a row of red bars from 2 to 5 m that interpolation leaves"
x = road.centers()[:, 0, 0]
fig, ax = plt.subplots(figsize=(6, 2.6), layout="constrained")
ax.bar(x - 0.1, slow.occupied[forward, :, 0], width=0.2, color="0.2", label="whole cells, remainder kept")
ax.bar(x + 0.1, blurred, width=0.2, color="#c04000", label="interpolated")
ax.axvline(3.25, color="0.5", linestyle=":", label="truth")
ax.set(xlabel="x, forward [m]", ylabel="probability after 2 s")
ax.legend(frameon=False, fontsize="small")
plt.show()

# %% [markdown]
# With the remainder the whole bar is where it should be. The price: between its jumps the mass is up to half a cell
# off.
#
# ## What it costs
#
# Each velocity has its own map. The number of velocities grows with the *area* of the disc, so half the spacing takes
# four times the memory, and the time as well. On the paper's grid:

# %%
for fastest, spacing in ((16, 2), (16, 1), (25, 0.5)):
    n = len(VelocityLattice(fastest, spacing))
    print(f"up to {fastest} m/s, {spacing} m/s apart: {n:5d} velocities, {4e-6 * n * 355 * 155:6.0f} MB")

# %% [markdown]
# All of it is read and written ten times a second, and nearly all of it holds next to nothing, because few cells have
# something in them that moves.
#
# ## Where this breaks
#
# **A lattice brakes in jumps.** A box comes at 8 m/s and slows down by 4 m/s² until it stands.

# %%
lane = GridSpec(x_min=4, x_max=34, y_min=-2, y_max=2, cell=0.5)


def approach(speed_at, spacing, scans=26):
    """Let a box come at a speed that may change; return P(DYNAMIC) of its cells and the speed BOF gives them."""
    place = 30.2 - 0.1 * np.cumsum([0, *(speed_at(0.1 * k) for k in range(scans))])
    rng, params, told = np.random.default_rng(0), BofParams(VelocityLattice(8, spacing)), []
    state = BofState.nothing_known(lane, params.lattice)
    for x_box in place[:scans]:
        box = Box.around(x_box, 0, 2, 2, 1.5)
        evidence = scan_evidence(scan_boxes([box], noise=0.02, rng=rng), lane, params.world.sensor)
        state = bof_update(bof_predict(state, lane, params, dt=0.1), lane, evidence, params)
        cells = cells_in(box, lane, margin=0.5) & (state.occupied.sum(axis=0) > 0.5)
        dynamic, towards_us = state.probability[DYNAMIC, cells], -bof_velocity(state)[0][0, cells]
        told.append((dynamic.mean(), np.nansum(towards_us * dynamic) / dynamic.sum()))
    return np.array(told)


# %%
t = np.arange(26) / 10
true = np.maximum(8 - 4 * t, 0)
braked, steadily = approach(lambda t: max(8 - 4 * t, 0), spacing=2), approach(lambda t: 8, spacing=2)
sure = (braked[:, 0] > 0.5) & (t > 0.5) & (t < 2)
print(
    f"while it brakes: mean P(DYNAMIC) {braked[6:16, 0].mean():.2f}, at a steady speed {steadily[6:16, 0].mean():.2f}"
)
print(f"error of the speed while it brakes: {(braked[sure, 1] - true[sure]).mean():+.1f} m/s on average")
assert braked[6:16, 0].mean() < steadily[6:16, 0].mean()
assert (braked[sure, 1] - true[sure]).mean() > 0

# %% jupyter={"source_hidden": true} alt="left, the speed of a braking box: the filter's dots lie above the true line; right, P(DYNAMIC) of the braking box lies below that of a box with a steady speed"
fig, axes = plt.subplots(1, 2, figsize=(9, 2.8), layout="constrained")
axes[0].plot(t, true, color="#c04000", label="truth")
axes[0].plot(t, np.where(braked[:, 0] > 0.5, braked[:, 1], np.nan), "o", color="0.2", label="BOF, if DYNAMIC")
axes[0].set(xlabel="time [s]", ylabel="speed [m/s]")
axes[0].legend(frameon=False)
axes[1].plot(t, steadily[:, 0], color="0.7", label="at 8 m/s all the time")
axes[1].plot(t, braked[:, 0], "o-", color="0.2", label="braking")
axes[1].set(xlabel="time [s]", ylabel="P(DYNAMIC)", ylim=(0, 1.05))
axes[1].legend(frameon=False, fontsize="small")
plt.show()

# %% [markdown]
# While the box brakes, its true speed lies between two velocities of the lattice. The mass at the higher one runs ahead
# of the box and is contradicted by the scans. The lower one starts with the small share that has jumped there. So the
# filter's speed lags behind and is too high, and P(DYNAMIC) is lower on average than for a steady box. The particles
# of lecture 04 change their speed a little at every step.
#
# **One more limit.** Behind an obstacle mass flies on unseen, where no scan can contradict it; the transition matrix
# forgets it at a rate of 0.7 per second.
#
# ## In five lines
#
# 1. In one cell without motion BOF is the discrete Bayes filter of lecture 01; all that it adds is probability that
#    flows from one cell into the next.
# 2. A small change of speed becomes a rare jump to the next velocity, with the same variance per step:
#    0.015 up and 0.015 down, at 6 m/s² and a spacing of 2 m/s.
# 3. Less than a cell in a step: rounding stands still for ever, interpolation leaves 22 % in the right cell after 20
#    steps, whole cells and a remainder leave all of it there, up to half a cell off between the jumps.
# 4. Each velocity has its own map, so half the spacing takes four times the memory.
# 5. While a box brakes, the lattice believes it too fast, and less DYNAMIC than a box with a steady speed.
#
# ## Further reading
#
# - Danescu, Oniga, Nedevschi, *Modeling and tracking the driving environment with a particle-based occupancy grid*,
#   IEEE Transactions on Intelligent Transportation Systems 12(4), 2011: particles in place of the lattice.
# - Lecture [03](../03_bof.ipynb), and lecture [04](../04_cmcdot.ipynb) for particles.

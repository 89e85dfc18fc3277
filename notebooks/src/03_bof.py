# %% [markdown]
# # 03 · BOF: occupancy with velocity
#
# **In one sentence.** Ask of every cell not only whether something is in it but also which cell it would have come
# from, and the velocities of things follow from scans that never measured one.
#
# **You will be able to**
# - predict by antecedents, and update, a joint distribution over occupancy and velocity, by hand on a line;
# - say what happens when something arrives where something stands already, or comes out of something that stands;
# - read from the joint what a cell holds: free, standing, moving, how fast and how surely;
# - say what a lattice of velocities costs, and where it is blind.
#
# **Prerequisites.** Lectures 01 (Bayes' rule on a line) and 02 (evidence, the smear behind a moving car).
#
# **Time.** 120 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.2: the ancestor of its filter, the Bayesian occupancy filter (BOF) of Coué, Pradalier, Laugier,
# Fraichard and Bessière, IJRR 2006. The paper prints no equation for it; those below bear no number.

# %%
import time
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from filterpy.discrete_bayes import update as discrete_update
from ipywidgets import FloatSlider, ToggleButtons, interact

from semgrid_edu import plotting
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import Bof, BofParams, BofState, Evidence, LogOddsGrid, PlanarMotion, State
from semgrid_edu.occupancy import VelocityLattice, WorldModel, bof_predict, bof_predict_literal, bof_update
from semgrid_edu.occupancy import bof_velocity, scan_evidence, smear_area, transition_matrix
from semgrid_edu.graphical import eliminate
from semgrid_edu.stage_models.bof import bof_beliefs, expected_things
from semgrid_edu.stage_models.cells_in_a_row import Cell, CellsInARow
from semgrid_edu.stage_models.joint_row import row_evidence, row_model
from semgrid_edu.workshop.illustrations.boxes import Box, cells_in, scan_boxes
from semgrid_edu.occupancy.literal.bof import clear_wakes_literal, mass_that_left, strike_out
from semgrid_edu.occupancy.bof import origins

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
FREE, STATIC, DYNAMIC, UNKNOWN = State

# %% [markdown]
# ## Where did it come from?
#
# Six cells of a metre on a line, and one thing in cell 2. You know that it is there, and nothing of how it moves: it
# stands, or goes one cell a second to the left or to the right, a third each. So cell 2 holds three numbers: $P(O, v) =
# \tfrac13$ for $v = -1, 0, +1$. All other cells are free.
#
# **Predict before you run.** A second passes and nobody looks. Which cells may be occupied now, with which
# probability? And what do you know of the velocity of the thing in cell 3, *if* it is there?
#
# <details><summary>Answer</summary>Cells 1, 2 and 3, a third each. And if it is in cell 3, then it goes to the right,
# for sure: who stands would be in cell 2. Place and velocity, independent before, are tied to each other now.</details>
#
# Now you look. From cell 3 a beam comes back, as it does with probability 0.8 from an occupied cell and 0.05 from a
# free one. All others are passed by a beam: 0.3 if occupied, 0.7 if free (lecture 02).
#
# **Predict before you run.** How surely is cell 3 occupied now, and how fast is what is in it? And cell 1?
#
# <details><summary>Answer</summary>Cell 3: 1/3 · 0.8 = 0.267 against 2/3 · 0.05 = 0.033, so 0.89, and all of it goes to
# the right. Cell 1: 1/3 · 0.3 = 0.1 against 2/3 · 0.7 = 0.467, so 0.18. You have measured no velocity. Yet you know
# it, for only one velocity leads from where the thing was to where it is.</details>
#
# That is the whole idea. A cell $c$ that is occupied with velocity $v$ now was occupied with velocity $v$ in its
# **antecedent** $c - v\,\Delta t$ before. The prediction asks the antecedent; the update is Bayes' rule in each cell,
# in which a scan speaks of occupancy and never of velocity:
#
# $$ P(O_c, v) \leftarrow P(O_{c - v\,\Delta t},\, v), \qquad
#    P(O_c, v \mid z) = \frac{P(z \mid O)\, P(O_c, v)}{P(z \mid O) \sum_{v'} P(O_c, v') + P(z \mid F)\, P(F_c)} $$
#
# $O$ is occupied, $F$ free, $z$ what the scan says of the cell, $\Delta t$ the time step.

# %% tags=["bof-update"]
V = (-1, 0, 1)  # cells a second, which are metres a second here


def fly(joint):
    """Return P(O, v), (3, 6), a second later: ask each cell's antecedent."""
    flown = np.zeros_like(joint)
    for k, v in enumerate(V):
        for cell in range(6):
            if 0 <= cell - v < 6:
                flown[k, cell] = joint[k, cell - v]
    return flown


def look(joint, if_occupied, if_free):
    """Return P(O, v | z): Bayes' rule, cell by cell."""
    after = np.zeros_like(joint)
    for cell in range(6):
        occupied = joint[:, cell] * if_occupied[cell]
        free = (1 - joint[:, cell].sum()) * if_free[cell]
        after[:, cell] = occupied / (occupied.sum() + free)
    return after


# %%
def beams(hit):
    """Return P(z | occupied) and P(z | free) on the line: one cell is hit, the others are passed."""
    is_hit = np.arange(6) == hit
    return np.where(is_hit, 0.8, 0.3), np.where(is_hit, 0.05, 0.7)


start = np.zeros((3, 6))
start[:, 2] = 1 / 3
story = {"at first": start, "a second later": fly(start)}
story["cell 3 is hit"] = look(story["a second later"], *beams(hit=3))
story["a second later "] = fly(story["cell 3 is hit"])
story["cell 4 is hit"] = look(story["a second later "], *beams(hit=4))
for when in ("a second later", "cell 3 is hit"):
    print(f"{when:<16}" + "".join(f"cell {cell:<5}" for cell in range(6)))
    for v, row in zip(V, story[when], strict=True):
        print(f"   P(O, v = {v:2d})  " + "".join(f"{p:<10.3f}" for p in row))

# %% [markdown]
# The package does the same on any grid. Lay the line along x: row 0 is the farthest ahead, so the array runs the other
# way round, and going to the right on our line is going forward, *up* the map. Its smallest lattice has two more
# velocities, sideways, which stay empty.

# %%
line = GridSpec(x_min=0, x_max=6, y_min=0, y_max=1, cell=1)
lattice = VelocityLattice(max_speed=1, spacing=1)
on_line = [lattice.velocities.tolist().index([v, 0]) for v in V]
no_change = ((0.0,) * 4,) * 4
steady = WorldModel(rates=no_change, stop_rate=0, max_acceleration=0, clearing_time=0)  # things move, and that is all
nothing_else = BofParams(lattice, steady)


def as_state(joint):
    """Lay P(O, v) on the line, (3, 6), into the package's grid."""
    occupied = np.zeros((len(lattice), 6, 1), np.float32)
    occupied[on_line, :, 0] = joint[:, ::-1]
    free = 1 - occupied.sum(axis=0)
    return BofState(free, np.zeros_like(free), occupied, lattice.velocities, np.zeros((len(lattice), 2)))


def on_the_line(values):
    """Return values over the package's grid, (..., 6, 1), in the order of the line, (..., 6)."""
    return np.asarray(values)[..., ::-1, 0]


# %%
predicted = bof_predict(as_state(start), line, nothing_else, dt=1.0)
np.testing.assert_allclose(on_the_line(predicted.occupied[on_line]), fly(start), atol=1e-6)
scan = Evidence(*(beam[::-1, None].astype(np.float32) for beam in beams(hit=3)))
updated = bof_update(predicted, line, scan, nothing_else)
np.testing.assert_allclose(on_the_line(updated.occupied[on_line]), story["cell 3 is hit"], atol=1e-6)

# %%
fig, axes = plt.subplots(1, 5, figsize=(12.5, 2.2), layout="constrained", sharey=True)
for ax, (when, joint) in zip(axes, story.items(), strict=True):
    ax.imshow(joint, cmap="Blues", vmin=0, vmax=1, origin="lower")
    for (k, cell), p in np.ndenumerate(joint):
        if p > 0.005:
            ax.text(cell, k, f"{p:.2f}", ha="center", va="center", fontsize=8, color="white" if p > 0.6 else "black")
    ax.set(title=when, xlabel="cell [m]", yticks=range(3), yticklabels=["-1", "0", "+1"])
axes[0].set_ylabel("velocity [m/s]")
plt.show()

# %% [markdown]
# One row of a panel is one velocity; a row flies by itself, each at its own pace. Look at the second panel: what was
# one column has been sheared apart. The scan of the third panel picks a *column*, and with it a velocity. The next
# flight tests the claim: only +1 arrives in cell 4, where the next beam comes back.
#
# See also what BOF does *not* know. There was one thing; yet after the first scan the cells hold 0.176 + 0.176 + 0.889
# = 1.24 things. Each cell is judged by itself: finding the thing in cell 3 says nothing about cell 1. Only looking
# there does. When nobody can look there, this goes wrong: see the section "One thing, two places".

# %% [markdown]
# ## What arrives where something stands
#
# Cell 2 holds a standing thing with probability $b_S = 0.5$ (its belief in STATIC), else it is free. From cell 1
# something moving arrives with probability $a = 0.6$. Two opinions, taken as independent: write down the four pairs.
#
# | | stands here, 0.5 | free, 0.5 |
# |---|---|---|
# | **arrives**, 0.6 | 0.30 ✗ | 0.30 → DYNAMIC |
# | **does not**, 0.4 | 0.20 → STATIC | 0.20 → FREE |
#
# Two things can't be in one cell, so one pair is impossible. Strike it out and let the rest, 0.7, sum to one again.
#
# **Predict before you run.** What does the cell hold now? And when it was a fence, $b_S = 0.99$, and $a = 0.3$?
#
# <details><summary>Answer</summary>DYNAMIC 3/7, STATIC 2/7, FREE 2/7. The fence: DYNAMIC 0.3 · 0.01 = 0.003, STATIC 0.7
# · 0.99 = 0.693, FREE 0.007, divided by 0.703: still STATIC to 98.6 %. Without the rule it would be at 69 %, and after
# five such seconds at 17 %.</details>
#
# $$ P(O_c, v) \leftarrow \frac{(1 - b_S)\, P(O_{c - v\,\Delta t}, v)}{1 - a\,b_S} \ \ (v \ne 0), \qquad
#    P(O_c, 0) \leftarrow \frac{(1 - a)\, b_S}{1 - a\,b_S}, \qquad a = \sum_{v \ne 0} P(O_{c - v\,\Delta t}, v) $$


# %% tags=["bof-predict"]
def predict(joint):
    """Return P(O, v), (3, 6), a second later: fly, and let what arrives meet what stands."""
    flown = fly(joint)
    predicted = np.zeros_like(flown)
    for cell in range(6):
        static = flown[1, cell]
        arrives = flown[0, cell] + flown[2, cell]
        possible = 1 - arrives * static
        predicted[:, cell] = flown[:, cell] * (1 - static) / possible
        predicted[1, cell] = (1 - arrives) * static / possible
    return predicted


joint = np.zeros((3, 6))
joint[2, 1], joint[1, 2] = 0.6, 0.5
print(np.round(predict(joint)[:, 2], 3), "= 0, 2/7, 3/7")
rng = np.random.default_rng(0)
for _ in range(20):
    joint = 0.45 * rng.dirichlet(np.ones(3), size=6).T
    for package in (bof_predict, bof_predict_literal):
        got = package(as_state(joint), line, nothing_else, dt=1.0)
        np.testing.assert_allclose(on_the_line(got.occupied[on_line]), predict(joint), atol=1e-6)

# %% [markdown]
# `bof_predict_literal` is the same with two dimensions, any lattice and three things more, which come below: cells that
# change by themselves, things that accelerate, and a look back and ahead at where things came from and where they go.
# `bof_predict` shifts whole arrays.

# %%
a = np.linspace(0, 0.999, 200)
fig, ax = plt.subplots(figsize=(6, 3), layout="constrained")
for static, grey in ((0.5, "0.7"), (0.9, "0.4"), (0.99, "0.0")):
    ax.plot(a, (1 - a) * static / (1 - a * static), color=grey, label=f"$b_S$ = {static}")
ax.plot(a, (1 - a) * 0.99, "--", color="#c04000", label="$b_S$ = 0.99, nothing struck out")
ax.set(xlabel="probability $a$ that something arrives", ylabel="P(STATIC) afterwards")
ax.legend(frameon=False, fontsize="small")
plt.show()

# %% [markdown]
# The surer a thing stands, the longer it resists: of the black line little is lost before $a$ is nearly 1. The dashed
# line is what a fence would do that gives way to whatever claims to cross it. (In odds it is simple: those of STATIC
# are multiplied by $1 - a$.) The package lets $a$ be 0.999 at most: who is never quite certain can be contradicted.

# %% [markdown]
# ## What a cell says: free, standing, moving, how fast
#
# A cell holds 0.1 at −1 m/s, 0.2 at 0 and 0.3 at +1 m/s.
#
# **Predict before you run.** P(occupied)? P(DYNAMIC)? And of what moves in it: mean velocity, and its variance?
#
# <details><summary>Answer</summary>P(occupied) = 0.6, so FREE 0.4. What stands: STATIC 0.2. What moves: DYNAMIC 0.4.
# Given that something moves, −1 has a quarter and +1 three quarters: mean +0.5 m/s, variance 1 − 0.25 = 0.75 (m/s)². A
# cell that is free for sure has no velocity: not zero, which would mean that something stands there.</details>
#
# $$ P(\text{STATIC}) = P(O, 0), \qquad P(\text{DYNAMIC}) = \sum_{v \ne 0} P(O, v), \qquad
#    \bar v = \frac{\sum_{v \ne 0} v\, P(O, v)}{P(\text{DYNAMIC})}, \qquad
#    \Sigma = \frac{\sum_{v \ne 0} (v - \bar v)(v - \bar v)^T P(O, v)}{P(\text{DYNAMIC})} $$


# %% tags=["bof-marginals"]
def what_moves(joint):
    """Return mean and variance of the velocity of what moves in each cell of the line; NaN where nothing moves."""
    mean, variance = np.full((2, 6), np.nan)
    for cell in range(6):
        left, _, right = joint[:, cell]
        if left + right > 0:
            mean[cell] = (-1 * left + 1 * right) / (left + right)
            variance[cell] = ((-1 - mean[cell]) ** 2 * left + (1 - mean[cell]) ** 2 * right) / (left + right)
    return mean, variance


joint = np.zeros((3, 6))
joint[:, 0] = [0.1, 0.2, 0.3]
joint[:, 1] = [0.0, 0.9, 0.0]
joint[:, 2] = [0.3, 0.1, 0.1]
for ours, package in zip(what_moves(joint), bof_velocity(as_state(joint)), strict=True):
    along_x = package[0] if package.ndim == 3 else package[0, 0]
    np.testing.assert_allclose(ours, on_the_line(along_x), atol=1e-6)
free, static, dynamic, unknown = on_the_line(as_state(joint).probability)
print("cell      FREE  STATIC  DYNAMIC   velocity [m/s]")
for cell, (mean, variance) in enumerate(zip(*what_moves(joint), strict=True)):
    speed = "none" if np.isnan(mean) else f"{mean:+.2f} ± {variance**0.5:.2f}"
    print(f"{cell}      {free[cell]:6.2f}{static[cell]:8.2f}{dynamic[cell]:9.2f}   {speed}")

# %% [markdown]
# Cell 1 is occupied nearly for sure, and has no velocity either: what is in it stands. STATIC and DYNAMIC are no new
# states beside the velocities; they are the zero velocity and the rest of the lattice.
#
# ## One cell, no motion: lecture 01 again
#
# One cell that holds FREE 0.6 and STATIC 0.4, and five scans: hit, hit, passed, hit, passed. Nothing moves. The
# discrete Bayes filter of lecture 01 predicts by the transition matrix, $b \leftarrow b M$, and updates by Bayes' rule.
# BOF must do exactly that.

# %%
one_cell = GridSpec(x_min=0, x_max=1, y_min=0, y_max=1, cell=1)
rates = np.zeros((4, 4))
rates[FREE, STATIC], rates[STATIC, FREE] = 0.2, 0.5  # a second; nothing ever moves
params = BofParams(lattice, WorldModel(rates=tuple(map(tuple, rates))))
M = transition_matrix(params.world, dt=0.1)[:2, :2]
b = np.array([0.6, 0.4])
occupied = np.zeros((len(lattice), 1, 1), np.float32)
occupied[0] = 0.4
start = BofState.nothing_known(one_cell, lattice)
state = BofState(start.free + 0.6, start.unknown * 0, occupied, start.velocity, start.remainder)
for hit in (True, True, False, True, False):
    if_free, if_occupied = (0.05, 0.8) if hit else (0.7, 0.3)
    b = discrete_update(np.array([if_free, if_occupied]), b @ M)
    scan = Evidence(np.full((1, 1), if_occupied, np.float32), np.full((1, 1), if_free, np.float32))
    state = bof_update(bof_predict(state, one_cell, params, dt=0.1), one_cell, scan, params)
    np.testing.assert_allclose(state.probability[:2, 0, 0], b, atol=1e-5)
    print(f"{'hit' if hit else 'passed':<8} STATIC {b[1]:.3f}")

# %% [markdown]
# So all that is new is what cells tell each other. The matrix of the real filter also lets things start to move. They
# could go anywhere, so they get the lattice's *prior* over velocities.
#
# ## A little acceleration
#
# Things change their speed. Say by up to $\dot v$ = 6 m/s² along each axis, all values alike. In a tenth of a second
# that is up to 0.6 m/s: a variance of 0.6²/3 = 0.12 (m/s)². But on a lattice with a spacing of $\Delta v$ = 2 m/s
# nothing can get 0.6 m/s faster.
#
# **Predict before you run.** It can get 2 m/s faster, seldom, or 2 m/s slower, just as seldom. How seldom, for the same
# variance?
#
# <details><summary>Answer</summary>With probability q up and q down the variance is 2 q · 2² = 8 q = 0.12, so q =
# 0.015. Once in a while a jump, in place of a small change at every step; over many steps the two are alike.</details>
#
# $$ 2 q\, (\Delta v)^2 = \frac{(\dot v\,\Delta t)^2}{3} \quad\Rightarrow\quad
#    q = \frac{(\dot v\,\Delta t)^2}{6\, (\Delta v)^2} $$


# %% tags=["bof-acceleration"]
def accelerate(joint, velocities, spacing, q):
    """Return P(O, v), (V,), after a share q of each moving bin has gone to each of its neighbours."""
    index = {tuple(v): k for k, v in enumerate(velocities.tolist())}
    changed = joint.copy()
    for k, (vx, vy) in enumerate(velocities.tolist()):
        for side in ((vx + spacing, vy), (vx - spacing, vy), (vx, vy + spacing), (vx, vy - spacing)):
            if (vx, vy) != (0, 0) and side != (0, 0) and side in index:
                changed[k] -= q * joint[k]
                changed[index[side]] += q * joint[k]
    return changed


coarse = VelocityLattice(max_speed=8, spacing=2)
joint = np.zeros(len(coarse), np.float32)
joint[coarse.velocities.tolist().index([4, 0])] = 0.5
changed = accelerate(joint, coarse.velocities, spacing=2, q=(6 * 0.1) ** 2 / (6 * 2**2))
square = GridSpec(x_min=0, x_max=11, y_min=0, y_max=11, cell=1)
occupied = np.zeros((len(coarse), 11, 11), np.float32)
occupied[:, 5, 5] = joint
middle = BofState(1 - occupied.sum(axis=0), 0 * occupied[0], occupied, coarse.velocities, np.zeros((len(coarse), 2)))
hurried = WorldModel(rates=((0.0,) * 4,) * 4, stop_rate=0, max_acceleration=6)
package = bof_predict(middle, square, BofParams(coarse, hurried), dt=0.1)
np.testing.assert_allclose(package.occupied.sum(axis=(1, 2)), changed, atol=1e-6)
for v in ([4, 0], [6, 0], [2, 0], [4, 2], [4, -2]):
    print(v, f"{changed[coarse.velocities.tolist().index(v)]:.4f}")

# %% [markdown]
# Zero is left out: what stands doesn't set off by accelerating a little, it *starts*, and for that there is the matrix.
#
# ## Two dimensions
#
# On a map a velocity has two components, and the lattice is a disc of them: up to 8 m/s, 2 m/s apart, is a coarse one
# with 49. Watch two boxes cross: one comes towards you at 6 m/s, one goes to the left at 4 m/s; along the left stands a
# wall. Your LIDAR takes ten scans a second, with 2 cm of noise, and measures no velocity.

# %%
spec = GridSpec(x_min=0, x_max=30, y_min=-12, y_max=12, cell=0.5)
no_look_back = WorldModel(clearing_time=0)  # looking back comes after the drive
params = BofParams(coarse, no_look_back)
fig, ax = plt.subplots(figsize=(4.4, 3.6), layout="constrained")
vx, vy = coarse.velocities.T
dots = ax.scatter(vy, vx, c=coarse.prior, cmap="YlOrBr", s=60, edgecolors="0.5", linewidths=0.5)
fig.colorbar(dots, label="P(v | starts to move)")
ax.set(xlabel="velocity to the left [m/s]", ylabel="velocity forward [m/s]", aspect="equal")
ax.invert_xaxis()
plt.show()

# %% [markdown]
# Each dot is a velocity with its own map of mass. The colour is the prior of what starts to move: slow is more usual
# than fast, and zero, in the middle, is what stands.


# %%
def world(t):
    """Return the boxes after t seconds: a wall, one box that comes, one that crosses."""
    return [Box(4, 28, 9, 9.5, 2.5), Box.around(25 - 6 * t, 3, 2, 2, 1.5), Box.around(10, -8 + 4 * t, 1, 2, 1.5)]


def watch(boxes_at, spec, params, scans=21):
    """Return what BOF believes after each of ten scans a second, of a vehicle that stands."""
    rng = np.random.default_rng(0)
    state, states = BofState.nothing_known(spec, params.lattice), []
    for k in range(scans):
        points = scan_boxes(boxes_at(k * 0.1), noise=0.02, rng=rng)
        state = bof_predict(state, spec, params, dt=0.1)
        state = bof_update(state, spec, scan_evidence(points, spec, params.world.sensor), params)
        states.append(state)
    return states


states = watch(world, spec, params)
after = bof_predict_literal(states[9], spec, params, dt=0.1)
np.testing.assert_allclose(bof_predict(states[9], spec, params, dt=0.1).occupied, after.occupied, atol=1e-5)

# %% [markdown]
# The whole filter is the two lines in the middle of `watch`. The assertion compares one prediction of this very scene
# with the literal code, velocity by velocity, cell by cell.
#
# **Predict before you run.** In lecture 02 the log-odds grid left a smear behind a moving thing. Will BOF? What does it
# believe of a cell that a box, moving for sure, has just left, *before* it looks?
#
# <details><summary>Answer</summary>FREE. The mass has flown away with its velocity; what it leaves behind is free. The
# log-odds grid must see the cell to be free several times first. What remains of a smear comes from mass that BOF took
# for standing before it knew better.</details>

# %%
rng = np.random.default_rng(0)
binary = LogOddsGrid(spec)
for k in range(21):
    p_occupied = binary.step(scan_boxes(world(k * 0.1), noise=0.02, rng=rng), PlanarMotion(), dt=0.1)


def draw(ax, spec, state, legend):
    """Draw what BOF believes: the wheel's colours and arrows for what moves."""
    mean, _ = bof_velocity(state)
    plotting.velocity_wheel(spec, state.probability, mean, ax=ax, legend=legend)
    plotting.velocity(spec, state.probability, mean, ax)


fig, axes = plt.subplots(1, 3, figsize=(13, 4.6), layout="compressed", sharey=True)
plotting.grid_values(spec, p_occupied, "P(occupied)", ax=axes[0], vmin=0, vmax=1, cmap="Greys")
axes[0].set_title("log-odds grid after 2 s")
for ax, k in zip(axes[1:], (5, 20), strict=True):
    draw(ax, spec, states[k], legend=k == 20)
    ax.set_title(f"BOF after {k / 10} s")
plt.show()

# %% [markdown]
# Left, each box drags a black tail, 10 m and 2 m long. In the middle, after half a second, most of it is still dark:
# BOF has seen too little to tell. On the right both boxes have a colour and arrows, back and left, the wall is
# STATIC, and of the tails a few cells are left. The hue is the heading, by the wheel. How large is the smear, in
# square metres of cells that a box has left and that are still believed occupied?


# %%
def smear(which):
    """Return the smear of the log-odds grid and of BOF behind one of the boxes, square metres."""
    was = np.any([cells_in(world(k * 0.1)[which], spec) for k in range(21)], axis=0)
    left = was & ~cells_in(world(2.0)[which], spec, margin=0.5)
    return smear_area(p_occupied, left, spec), smear_area(states[-1].occupied.sum(axis=0), left, spec)


total = np.add(smear(1), smear(2))
print("smear [m²]   log-odds {:.1f}   BOF {:.1f}".format(*total))
assert total[1] < 0.25 * total[0]

# %% [markdown]
# One cell at the front of the box that comes, after half a second and after two seconds: what does it believe of the
# velocity of what is in it?

# %%
fig, axes = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained", sharey=True)
for ax, k, place in zip(axes, (5, 20), ((21.2, 3.2), (12.2, 3.2)), strict=True):
    (row,), (col,), _ = spec.cells(np.array([place]))
    joint = states[k].occupied[:, row, col]
    plotting.velocity_spread(coarse.velocities, joint, ax=ax)
    ax.set_title(f"after {k / 10} s: STATIC {joint[0]:.2f}, DYNAMIC {joint[1:].sum():.2f}")
plt.show()

# %% [markdown]
# A dot's area is the probability of a velocity, given that the cell is occupied; the cross is their mean, the ellipse
# two standard deviations. After half a second BOF knows *that* the box comes and not yet how fast, nor whether a little
# to the left or to the right. After two seconds nearly all sits in one dot, at 6 m/s: as if it had been measured.
#
# ## Less than a cell in a step
#
# In a tenth of a second something that does 1 m/s gets 0.1 m far: a fifth of a cell of half a metre. By how many whole
# cells do you shift its map?
#
# **Predict before you run.** (a) Round it: where is the mass after 20 steps? (b) Interpolate: four fifths stay, one
# fifth goes on, at each step. How much of the mass is in the right cell after 20 steps?
#
# <details><summary>Answer</summary>(a) Where it was: 0.2 rounds to 0, twenty times. Everything slower than 2.5 m/s
# would stand. (b) It goes on in k of 20 steps with the binomial probability for 1/5: in the right cell, k = 4, is 22 %.
# The rest is spread over two metres to and fro, and looks like uncertainty that nobody has.</details>
#
# BOF does neither. A whole map flies at one velocity, so the rest of the way is one number for it: keep that, the
# remainder $\rho$, beside, and shift by $n$ whole cells.
#
# $$ n = \operatorname{round}\!\left( \frac{\rho + v\,\Delta t}{\text{cell}} \right), \qquad
#    \rho \leftarrow \rho + v\,\Delta t - n\,\text{cell} $$

# %%
road = GridSpec(x_min=0, x_max=6, y_min=0, y_max=0.5, cell=0.5)


def whole_cells(v, dt, cell, remainder):
    """Return by how many whole cells a map shifts, and how far beyond them its mass is, metres."""
    way = remainder + v * dt
    n = round(way / cell)
    return n, way - n * cell


occupied = np.zeros((len(lattice), *road.shape), np.float32)
forward = on_line[2]  # 1 m/s
occupied[forward, -3] = 1  # 1.25 m ahead
slow = BofState(1 - occupied.sum(axis=0), occupied[0] * 0, occupied, lattice.velocities, np.zeros((len(lattice), 2)))
blurred, remainder, shifts = occupied[forward, :, 0].astype(float), 0.0, []
for _ in range(20):
    n, remainder = whole_cells(1.0, 0.1, 0.5, remainder)
    shifts.append(n)
    slow = bof_predict(slow, road, nothing_else, dt=0.1)
    assert np.isclose(slow.remainder[forward, 0], remainder)
    assert slow.occupied[forward, road.shape[0] - 3 - sum(shifts), 0] > 0.99
    blurred = 0.8 * blurred + 0.2 * np.append(blurred[1:], 0)
print("cells shifted:", *shifts)
print(f"in the right cell: {slow.occupied[forward, 5, 0]:.2f}, by interpolation {blurred[5]:.2f}")

# %%
x = road.centers()[:, 0, 0]
fig, ax = plt.subplots(figsize=(6, 2.6), layout="constrained")
ax.bar(x - 0.1, slow.occupied[forward, :, 0], width=0.2, color="0.2", label="whole cells, remainder kept")
ax.bar(x + 0.1, blurred, width=0.2, color="#c04000", label="interpolated")
ax.axvline(3.25, color="0.5", linestyle=":", label="truth")
ax.set(xlabel="x, forward [m]", ylabel="probability after 2 s")
ax.legend(frameon=False, fontsize="small")
plt.show()

# %% [markdown]
# The black bar is where it should be, whole; the red ones have flowed over two metres and more, and every further scan
# would have to push them together again. The price: between its jumps the mass is up to half a cell off.
#
# ## On the drive
#
# The same on the shipped drive: a street, a vehicle that moves at 8.5 m/s, scans of a whole turn. `Bof` is the two
# functions, plus a map that scrolls under the vehicle by whole cells. A lattice up to 16 m/s, 2 m/s apart,
# has 197 velocities.
#
# **Predict before you run.** A red car overtakes on the left. It touches cells that were free a moment ago at its
# front, and along its flank, cells that it filled a moment ago as well. Where will it get its colour first?

# %%
street, drive = GridSpec.compact(), sample_drive()


def follow_drive(world):
    """Return what BOF believes after each frame of the drive."""
    bof = Bof(street, BofParams(VelocityLattice(max_speed=16, spacing=2), world))
    beliefs, before = [], drive[0]
    for frame in drive:
        motion = PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
        beliefs.append(bof.step(frame.points_grid, motion, frame.time - before.time))
        before = frame
    return beliefs


beliefs = follow_drive(no_look_back)

fig, axes = plt.subplots(1, 2, figsize=(7, 5.4), layout="compressed", sharey=True)
for ax, k in zip(axes, (3, 19), strict=True):
    plotting.velocity_wheel(street, beliefs[k].probability, beliefs[k].velocity, ax=ax, legend=k == 19)
    plotting.velocity(street, beliefs[k].probability, beliefs[k].velocity, ax)
    ax.set_title(f"after {drive[k].time - drive[0].time:.1f} s")
plt.show()

# %% [markdown]
# <details><summary>Answer</summary>At its front, where it arrives. The cells behind could as well hold something that
# stands.</details>
#
# Look at the bottom: within a third of a second the overtaking car turns blue, the wheel's *ahead*, and its rear last.
# On the left, yellow, come oncoming cars; on the right two cyclists go our way, slow and dark. Houses and fences are
# STATIC though *we* drive past them, but for a stray arrow where something has just come into view: velocities are over
# ground. How fast is the car, and how fast does BOF say? The drive comes with its truth.

# %%
car = KITTI_14.index("car")
x, y = np.moveaxis(street.centers(), -1, 0)
places, told = [], []
for k in (10, 19):
    cells = (drive[k].labels.birdseye_on(street) == car) & (y > 1) & (y < 5) & (x < 16)
    middle = x[cells].mean()
    places.append(drive[k].T_world_from_lidar @ [middle, y[cells].mean(), 0, 1])
    for half in (cells & (x > middle), cells & (x < middle)):
        weight = np.where(half, beliefs[k].probability[DYNAMIC], 0)
        told.append(np.nansum(beliefs[k].velocity[0] * weight) / weight.sum())
true = np.linalg.norm(places[1] - places[0]) / (drive[19].time - drive[10].time)
print(f"the car's speed [m/s]   truth {true:4.0f}")
print("BOF after 1.0 s:   front half {:4.0f}   rear half {:4.0f}".format(*told[:2]))
print("BOF after 1.9 s:   front half {:4.0f}   rear half {:4.0f}".format(*told[2:]))

# %% [markdown]
# The heading is right, the front half is nearly right, and the rear half is too slow: as if the car grew longer. Hold
# that thought, and count the ghosts of lecture 02 again: road that is empty in truth and called occupied.

# %%
log_odds, before = LogOddsGrid(street), drive[0]
for frame in drive:
    motion = PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
    p_occupied = log_odds.step(frame.points_grid, motion, frame.time - before.time)
    before = frame
empty = drive[19].labels.birdseye_on(street) == KITTI_14.index("road")
bof_occupied = beliefs[19].probability[[STATIC, DYNAMIC]].sum(axis=0)
ghosts = [smear_area(p, empty, street) for p in (p_occupied, bof_occupied)]
streak = smear_area(bof_occupied, empty & (x > 16) & (x < 22) & (y > 0), street)
print("ghosts after 1.9 s [m²]   log-odds {:.1f}   BOF {:.1f}".format(*ghosts), end="")
print(f", of these 16 to 22 m ahead on the left {streak:.1f}")
assert ghosts[1] < 0.5 * ghosts[0]

# %% [markdown]
# Fewer by far, but not none. In the picture on the right you see nearly half of what is left: the dark stretch on the
# left, from 16 to 22 m ahead. The rear of the first oncoming car was believed to stand, and what it left behind lies in
# its shadow, where no beam takes it back. The second car is about to drive into that stretch. There something is
# believed to stand, so the rule that keeps fences will speak against the second car: a filter that is wrong of one
# thing is soon wrong of the next.
#
# ## One thing, two places: looking back
#
# By now BOF is sure that the first car moves. So it could know that nothing of that car still stands where it has
# been. Why doesn't it? Take the smallest world with this problem: six cells of half a metre in a row. In cell 1 is one
# thing, which either stands or drives to the right at 5 m/s, one cell in a tenth of a second, with probability 1/2
# each. From now on cell 1 lies in a shadow. The five scans that follow find a return in cell 2, then in cell 3, and so
# on up to cell 6, and pass all other cells that they see.
#
# **Predict before you run.** What does BOF say of cell 1 after the five scans? And somebody who compares the two
# stories, "it stands" and "it drives", as wholes?
#
# <details><summary>Answer</summary>BOF: still STATIC 0.5. No scan sees the cell, and cells are filtered one by one. But
# if the thing stands in cell 1, all five returns came from free cells. Each is 0.8 / 0.05 = 16 times as probable if it
# drives. So the odds are 16<sup>5</sup> to 1, a million to one, that it drives, and cell 1 is free.</details>
#
# Below, "x" is a return, "." a beam that passes, "?" a cell that no beam reaches. `joint` does what that somebody does:
# it sums over all histories of all six cells (by elimination: see the companion on
# [graphical models](deeper/graphical_models.ipynb)), of which there are far too many on a real grid.

# %% jupyter={"outputs_hidden": true}
shadow = CellsInARow(
    ({"static": 0.5, "right": 0.5}, {}, {}, {}, {}, {}),
    ("?x....", "??x...", "???x..", "????x.", "?????x"),
    clearing_time=0,
)


def joint(row, cell, step):
    """Return the exact distribution of one cell of a row, given the scans up to a step."""
    return eliminate(row_model(row, step), f"c{cell},{step}", row_evidence(row, step)).normalised().table


exact = np.array([joint(shadow, 1, step)[Cell.STATIC] for step in range(1, 6)])
plain = bof_beliefs(shadow)
print("P(STATIC) of cell 1, scan by scan: joint", *exact.round(4), "BOF", *plain[:, 0, Cell.STATIC].round(4))
print(f"BOF expects {expected_things(plain)[-1]:.2f} things in the row")

# %% [markdown]
# These are the 1.24 things from the first section again, now 1.5 of them: one thing is believed to be in two places.
# BOF keeps one distribution per cell, so it has forgotten that cell 1 and cell 6 tell of the same thing.
#
# It can't remember that for all pairs of cells, but it can look back. A thing that moves with velocity $v$ was at
# $c - v\,\tau$ a time $\tau$ ago, and when $\tau$ is long enough, it has left the place that it takes up there. How
# long is enough? In half a second a car of 4.5 m clears its own length at 9 m/s, and a pedestrian of half a metre at 1
# m/s. But on a map a thing shows in more cells than it fills, because it hardly ever lies between two borders just so:
# half a metre mostly lies across two cells of half a metre. Somebody who walks at 1 m/s has gone just one cell further
# after half a second, and is still in one of the two. So the rule is **half a second, and at least three cells**
# (`clearing_time` and `clearing_cells`): $\tau$ is 0.5 s, and for a slow thing the time that it needs for three cells.
# With cells of 0.5 m that concerns what is slower than 3 m/s; in our row half a second is five cells.
#
# So "something has gone from here" and "something stands here" exclude each other, like arriving and standing before.
# Strike the pair out, in cells that the scan doesn't see:
#
# $$ a^-_c = \sum_{v \ne 0} P(O_{c + v\,\tau}, v), \qquad
#    P(O_c, 0) \leftarrow \frac{(1 - a^-_c)\, b_S}{1 - a^-_c\, b_S}, \qquad b_S = P(O_c, 0) $$
#
# By hand, in cell 1 after the fifth scan: what is in cell 6 goes to the right with a probability of nearly 1, so $a^-$
# is cut to 0.999, and 0.5 becomes 0.001 · 0.5 / (1 - 0.4995) = 0.001. What STATIC loses, FREE gets.


# %% tags=["bof-wakes"]
def clear_wakes(joint, hidden, steps):
    """Return P(O, v), (3, K), after what moves has said that it left a place some steps ago: nothing stands there."""
    cleared = joint.copy()
    for cell in np.flatnonzero(hidden):
        left = 0
        for k, v in enumerate(V):
            if v != 0 and 0 <= cell + v * steps < joint.shape[1]:
                left += joint[k, cell + v * steps]
        a = min(left, 0.999)
        cleared[1, cell] = (1 - a) * joint[1, cell] / (1 - a * joint[1, cell])
    return cleared


# %% jupyter={"source_hidden": true}
at_end = plain[-1][:, [Cell.LEFT, Cell.STATIC, Cell.RIGHT]].T
cleared = clear_wakes(at_end, hidden=np.array(list("?????x")) == "?", steps=5)
five = shadow.params.lattice.velocities  # (0, 0), and 5 m/s forward, back, left and right
mass = np.zeros((len(five), 1, 6))
for k, v in enumerate(V):
    mass[five.tolist().index([0, -5 * v]), 0] = at_end[k]  # y points to the left
left = mass_that_left(mass, origins(five, shadow.spec, replace(shadow, clearing_time=0.5).params.world))
package = clear_wakes_literal(mass[0], left, np.array([[True] * 5 + [False]]))
np.testing.assert_allclose(cleared[1], package[0], atol=1e-12)
back = bof_beliefs(replace(shadow, clearing_time=0.5))
np.testing.assert_allclose(back[-1, 0, Cell.STATIC], cleared[1, 0], atol=1e-5)
errors = [abs(belief[-1, 0, Cell.STATIC] - exact[-1]) for belief in (plain, back)]
assert errors[0] > 0.499
assert errors[1] < 0.0011
print("P(STATIC) of cell 1 is wrong by {:.3f} without the rule and by {:.3f} with it".format(*errors))

# %% [markdown]
# So the rule brings BOF nearer to the exact answer, from an error of 0.5 to one of 0.001; but only with the fifth scan,
# half a second late. Joint inference is at 0.06 after the first.
#
# ### Where does it come from?
#
# The same look back helps at the other end of the flight. Drive past a long wall: with each scan a little more of it
# comes into view. BOF takes cells as independent, so each new cell that is hit is one more coincidence: in the package
# a cell that nobody has seen turns out to be STATIC with a probability of about 0.05, else it is almost surely FREE.
# But something that runs along the wall, just as fast as the wall comes into view, explains all of them at once. Take
# eight cells: the first four stand with probability 0.97, the last three are UNKNOWN. About cell 5 there is a little
# doubt: it stands with 0.95, and with 0.03 there is something in it that goes to the right.
#
# **Predict before you run.** Cell 6 comes into view, and is hit. With what probability is it DYNAMIC? And cell 7, hit
# by the next scan?
#
# <details><summary>Answer</summary>Cell 6: something arrived, 0.03 · 0.8 = 0.024; or the cell is STATIC, 0.97 · 0.05 ·
# 0.8 = 0.039; or free, 0.97 · 0.95 · 0.05 = 0.046. So DYNAMIC 0.024 / 0.109 = 0.22. With 0.22 in place of 0.03 you get
# 0.72 for cell 7, and 0.96 for cell 8: a phantom that nothing has ever been.</details>
#
# Joint inference isn't fooled: if something had run out of cell 5, no beam could come back from there any more. That is
# one thing in two places again. So look back when something arrives: does something stand where it was $\tau$ ago? By
# itself that isn't enough to doubt it. Somebody who sets off comes out of a place where something stood, and the front
# of a car comes out of its rear, which BOF takes for standing at first. But ahead of them the road is free. The side of
# a long bus comes out of its rear, too, but ahead of it is the front of the bus, which moves. A phantom goes on along
# its wall, and the wall ahead stands, or lies in the shadow still. So look ahead, too: is the place where it will be,
# $\tau$ from now, STATIC or UNKNOWN? The arrival is doubtful with probability
#
# $$ \sigma_v = P(O_{c - v\,\tau}, 0)\, \bigl(P(O_{c + v\,\tau}, 0) + P(U_{c + v\,\tau})\bigr) $$
#
# if its velocity is $v$; $P(U_c)$ is the probability that cell $c$ is UNKNOWN, and what lies outside the map counts as
# UNKNOWN. Of everything that arrives, $d = \sum_{v \ne 0} \sigma_v\, P(O_{c - v\,\Delta t}, v)$ is
# doubtful. In a cell that nobody has seen to be free, a doubtful arrival is struck out, because more likely it is a
# wall that goes on: on a real drive (KITTI 0013), of the cells first seen beside a standing one 70 % were occupied, of
# those without a standing neighbour about 2 %. Call $u$ the probability that nobody has seen the cell to be free: that
# it is UNKNOWN, or that something moving has left it in this very step. With the names of above:
#
# $$ P(O_c, v) \leftarrow \frac{(1 - b_S - \sigma_v\, u)\, P(O_{c - v\,\Delta t}, v)}{1 - a\, b_S - d\, u}
#    \ \ (v \ne 0) $$
#
# In a cell that has been seen to be free every arrival counts, doubtful or not.


# %% tags=["bof-origins"]
def arrive_in_doubt(arrives, doubt, static, unseen):
    """Return what is left of arrivals (V,) in one cell, each of which comes along a wall with probability `doubt`."""
    doubtful = (arrives * doubt).sum()
    possible = 1 - arrives.sum() * static - doubtful * unseen
    return arrives * (1 - static - doubt * unseen) / possible


arrives, doubt = np.array([0.02, 0.0, 0.01]), np.array([0.97, 0.0, 0.4])
_, sure, less = strike_out(0.2, arrives.sum(), 0.5, (arrives * doubt).sum())
np.testing.assert_allclose(arrive_in_doubt(arrives, doubt, 0.2, 0.5), arrives * (sure - doubt * less))
wall = CellsInARow(
    ({"static": 0.97},) * 4 + ({"static": 0.95, "right": 0.03},) + ({"unknown": 1.0},) * 3,
    ("xxxxxx??", "xxxxxxx?", "xxxxxxxx"),
    first_sight=(0.95, 0.05, 0),
)
newest = np.arange(3), np.arange(5, 8), Cell.RIGHT  # after scan 1 cell 6, after scan 2 cell 7, after scan 3 cell 8
phantom = bof_beliefs(replace(wall, clearing_time=0))[newest]
doubted = bof_beliefs(wall)[newest]
in_truth = [joint(wall, step + 5, step)[Cell.RIGHT] for step in (1, 2, 3)]
np.testing.assert_allclose(phantom, [0.22, 0.72, 0.96], atol=5e-3)
assert (abs(doubted - in_truth) < 0.01).all()
for name, values in (("BOF", phantom), ("BOF, looking back", doubted), ("joint", in_truth)):
    print(f"{name:<18} P(DYNAMIC) of the newest cell: " + "  ".join(f"{p:.4f}" for p in values))

# %% jupyter={"source_hidden": true} alt="P(STATIC) of a hidden cell and P(DYNAMIC) of a new cell, by scan"
fig, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
styles = {"BOF": ("o:", "#c04000"), "BOF, looking back": ("s-", "0.2"), "joint": ("x--", "tab:blue")}
in_shadow = [plain[:, 0, Cell.STATIC], back[:, 0, Cell.STATIC], exact]
for ax, curves in zip(axes, (in_shadow, [phantom, doubted, in_truth]), strict=True):
    for (name, (style, colour)), values in zip(styles.items(), curves, strict=True):
        ax.plot(np.arange(1, len(values) + 1), values, style, color=colour, label=name)
    ax.set(xlabel="scan", xticks=np.arange(1, len(values) + 1), ylim=(-0.04, 1.04))
axes[0].set(title="what a thing has left, in its shadow", ylabel="P(STATIC) of cell 1")
axes[1].set(title="a wall that comes into view", ylabel="P(DYNAMIC) of the newest cell")
axes[0].legend(frameon=False, fontsize="small")
plt.show()

# %% [markdown]
# Left, the line with squares drops to the exact answer at the fifth scan. Right, it stays with the exact answer near
# zero, while the dotted one takes the wall for something that runs. (Half a second ahead lies beyond the end of this
# short row, so that place counts as UNKNOWN.)
#
# **Where looking back goes wrong.** Joint inference weighs whole histories; the rules only presume one, that the thing
# has moved like this for a time $\tau$. Somebody who set off just now hasn't. Seven cells: in cell 1, hidden, stands
# something with 0.9, and in cell 5 something begins to move to the right, this very moment.

# %%
starter = CellsInARow(({"static": 0.9}, {}, {}, {}, {"right": 1.0}, {}, {}), ("?....x.", "?.....x"))
histories = [joint(starter, 1, 2)[Cell.STATIC], bof_beliefs(starter)[-1, 0, Cell.STATIC]]
np.testing.assert_allclose(histories, [0.9, 0.009], atol=1e-3)
print("P(STATIC) of cell 1: joint {:.3f}, BOF, looking back {:.3f}".format(*histories))

# %% [markdown]
# What stands is erased by something that has never been there, until a scan sees it again. Likewise somebody who sets
# off beside something that stands, towards places that nobody has seen, is doubted. That is why the rules act only
# where nobody has looked: the first in hidden cells, the second in cells that haven't been seen to be free.
#
# Back to the drive, now with the look back and ahead:

# %%
looking_back = follow_drive(WorldModel())  # clearing_time=0.5
occupied_now = looking_back[19].probability[[STATIC, DYNAMIC]].sum(axis=0)
stretch = (x > 16) & (x < 22) & (y > 0)
ghosts_now = [smear_area(occupied_now, where, street) for where in (empty, empty & stretch)]
print("ghosts after 1.9 s [m²]   BOF, looking back {:.1f}, of these in the stretch {:.1f}".format(*ghosts_now))
assert ghosts_now[0] < 0.5 * ghosts[1]
assert ghosts_now[1] < 0.1 * streak

# %% [markdown]
# In the stretch behind the first car less than one square metre is left in place of nine, and of all ghosts less than
# half. The price is the delay that you saw in the row: what a thing has left behind stays until the thing has been seen
# to move for a time $\tau$, half a second for these cars. The companion
# [phantoms on real streets](deeper/04_real_streets.ipynb) shows what the second rule costs.
#
# ## What it costs
#
# Each velocity has its own map. On the paper's grid, 355 x 155 cells, a number of four bytes a cell and velocity:
#
# **Predict before you run.** A lattice up to 16 m/s in steps of 2 m/s has 197 velocities; the package's default, in
# steps of 1 m/s, has 797. How many has one that tells a pedestrian's 1.4 m/s from standing, in steps of 0.5 m/s, and
# reaches 25 m/s, as fast as cars are? And how much memory is that?
#
# <details><summary>Answer</summary>About the area of the disc in steps: π · 50² ≈ 7850. Times 55,025 cells times 4
# bytes: 1.7 GB, and each step reads and writes all of it, ten times a second. Half the spacing is four times the
# work.</details>

# %%
assert max((belief.probability[DYNAMIC] > 0.1).mean() for belief in beliefs) < 0.05
cells = np.prod(GridSpec.paper().shape)
print("fastest  spacing  velocities   memory on the paper's grid")
for fastest, spacing in ((8, 2), (16, 2), (16, 1), (25, 1), (25, 0.5)):
    n = len(VelocityLattice(fastest, spacing))
    print(f"{fastest:4d} m/s {spacing:5.1f} m/s {n:8d} {4e-6 * n * cells:15.0f} MB")


# %% tags=["nbval-ignore-output"]
def seconds(grid, lattice):
    """Return the shortest time of twenty predictions, seconds."""
    params, took = BofParams(lattice), []
    state = BofState.nothing_known(grid, lattice)
    for _ in range(20):
        begun = time.perf_counter()
        bof_predict(state, grid, params, dt=0.1)
        took.append(time.perf_counter() - begun)
    return min(took)


print("velocities      cells      time of one prediction")
for fastest, spacing, cell in ((8, 2, 0.5), (16, 2, 0.5), (16, 1, 0.5), (16, 2, 1.0), (16, 2, 0.25)):
    lattice, grid = VelocityLattice(fastest, spacing), GridSpec(0, 71, -15.5, 15.5, cell)
    V, (H, W), took = len(lattice), grid.shape, seconds(grid, lattice)
    each = 1e9 * took / (V * H * W)
    print(f"{V:10d}  {H:4d} x {W:3d}  {1000 * took:6.1f} ms, {each:4.1f} ns for each of V x H x W numbers")

# %% [markdown]
# In the first three rows the grid stays and the lattice grows: from the first to the third, sixteen times as many
# velocities take ten to twenty times as long. The last two rows, beside the second, keep the lattice and change the
# cells. There the time grows less than in proportion, because each velocity costs a few calls, however small its map
# is. The larger the map, the nearer the time comes to growing with V x H x W.
#
# Nearly all of it is spent on flying zeros about: at no instant of the drive above does one cell in
# twenty hold something that moves with a probability of 0.1 or more. Lecture 04 puts the memory where the mass is:
# particles, each with a position and a velocity of its own, many where something moves and none elsewhere.
#
# ## Play with it
#
# One box comes towards you at a speed that you choose, and BOF has a lattice whose spacing you choose. What does it say
# after two seconds? Try 5 m/s with a spacing of 4, then of 1. (Without a running kernel there is no slider; the figure
# below it shows the whole range.)

# %%
lane = GridSpec(x_min=4, x_max=34, y_min=-2, y_max=2, cell=0.5)


def approach(speed_at, spacing, scans=21):
    """Let a box come at a speed that may change; return P(DYNAMIC) of its cells and the speed BOF gives them."""
    place = 30.2 - 0.1 * np.cumsum([0, *(speed_at(0.1 * k) for k in range(scans))])
    boxes = [Box.around(x_box, 0, 2, 2, 1.5) for x_box in place]
    told = []
    states = watch(lambda t: [boxes[round(10 * t)]], lane, BofParams(VelocityLattice(8, spacing)), scans)
    for box, state in zip(boxes, states, strict=False):
        cells = cells_in(box, lane, margin=0.5) & (state.occupied.sum(axis=0) > 0.5)
        dynamic, towards_us = state.probability[DYNAMIC, cells], -bof_velocity(state)[0][0, cells]
        told.append((dynamic.mean(), np.nansum(towards_us * dynamic) / dynamic.sum()))
    return np.array(told)


# %% tags=["nbval-ignore-output"]
def show(speed, spacing):
    """Show what BOF says of a box with this speed, over time."""
    dynamic, told = approach(lambda t: speed, spacing).T
    _, axes = plt.subplots(1, 2, figsize=(8, 2.4), layout="constrained")
    axes[0].plot(np.arange(21) / 10, dynamic, color="0.2")
    axes[0].set(xlabel="time [s]", ylabel="P(DYNAMIC)", ylim=(0, 1.05))
    axes[1].plot(np.arange(21) / 10, np.where(dynamic > 0.5, told, np.nan), color="0.2")
    axes[1].axhline(speed, color="#c04000", linestyle=":")
    axes[1].set(xlabel="time [s]", ylabel="speed, if DYNAMIC [m/s]", ylim=(0, 9))
    plt.show()


speeds = FloatSlider(value=5, min=0, max=8, step=0.5, description="speed [m/s]", continuous_update=False)
_ = interact(show, speed=speeds, spacing=ToggleButtons(options=[4, 2, 1], description="spacing"))
# %%
speeds = np.arange(0, 8.1, 0.5)
fig, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
for spacing, style, colour in ((4, "o:", "#c04000"), (2, "s-", "0.2")):
    dynamic, told = np.array([approach(lambda t, v=v: v, spacing)[-10:].mean(axis=0) for v in speeds]).T
    axes[0].plot(speeds, dynamic, style, color=colour, label=f"spacing {spacing} m/s")
    axes[1].plot(speeds, np.where(dynamic > 0.5, told, np.nan), style, color=colour)
    assert (dynamic[speeds <= spacing / 2 + 0.1] < 0.2).all()
    assert abs(dynamic[speeds == spacing] - 0.8) < 0.05
    assert spacing == 4 or np.abs(told - speeds)[dynamic > 0.5].max() < 0.5
axes[1].plot(speeds, speeds, color="0.7", linewidth=1, label="truth")
axes[0].set(xlabel="true speed [m/s]", ylabel="P(DYNAMIC), second second", ylim=(0, 1.05))
axes[1].set(xlabel="true speed [m/s]", ylabel="speed, if DYNAMIC [m/s]")
for ax in axes:
    ax.legend(frameon=False, fontsize="small")
plt.show()

# %% [markdown]
# Left: what is slower than half a spacing just stands. From there P(DYNAMIC) rises, and when the speed is a whole
# spacing it has reached 0.8. With a spacing of 4 m/s a pedestrian is furniture, and something at 3 m/s may as well
# stand as move. Right: the beginnings of a stair. With a spacing of 4 m/s, what
# does 4 to 6 m/s is said to do 4 to 5, and from there the line climbs steeply to the next velocity of the lattice. With
# 2 m/s it keeps to the truth, within half a metre a second.
#
# ## Where this breaks
#
# **A flank looks the same wherever it goes.** A bus 12 m long passes you at 8 m/s, which the lattice has exactly.
#
# **Predict before you run.** What does BOF say of its front, and what of the middle of its flank?
#
# <details><summary>Answer</summary>The front arrives in cells that were free: 8 m/s, and nothing else explains it. In
# the middle of the flank there was something before and there is something now. It may have come from 0.8 m behind, or
# have been there all the time: both antecedents lie in the bus. So all velocities along the flank explain every scan
# alike, the prior decides, and the prior says that most things stand. This is the *aperture problem*.</details>

# %%
road = GridSpec(x_min=0, x_max=30, y_min=-6, y_max=6, cell=0.5)
passing = watch(lambda t: [Box.around(30 - 8 * t, 3.5, 12, 2.5, 3)], road, BofParams(coarse))[-1]
free, static, dynamic, unknown = passing.probability
(col,) = np.flatnonzero(np.isclose(road.centers()[0, :, 1], 2.25))
flank = (static[:, col] + dynamic[:, col] > 0.5) & (np.abs(road.centers()[:, 0, 0] - 14) < 6.5)
fig, axes = plt.subplots(1, 2, figsize=(9, 4.2), layout="compressed", width_ratios=[1, 2])
draw(axes[0], road, passing, legend=False)
axes[1].plot(road.centers()[flank, 0, 0] - 8, dynamic[flank, col], "o", color="0.2")
assert dynamic[flank, col][-2] > 0.9
assert dynamic[flank, col][:3].max() < 0.1
axes[1].set(xlabel="behind the front of the bus [m]", ylabel="P(DYNAMIC), where it is occupied", ylim=(-0.05, 1.05))
plt.show()

# %% [markdown]
# Left: a yellow head with arrows, and behind it, black, the returns from its flank, as if somebody walked away from a
# wall. Right: the cells along that flank. The first metres move for sure; farther back the bus stands. It is the same
# bus, but BOF knows no buses: cells are independent of each other, so the front can't tell the flank. That is why the
# rear of the red car came out too slow. And it is why the wall stayed STATIC: if it slid along itself, you would see
# the same.
#
# **A lattice brakes in jerks.** A box comes at 8 m/s and slows down by 4 m/s² until it stands.

# %%
braked = approach(lambda t: max(8 - 4 * t, 0), spacing=2, scans=26)
t = np.arange(26) / 10
fig, axes = plt.subplots(1, 2, figsize=(9, 2.8), layout="constrained")
axes[0].plot(t, np.maximum(8 - 4 * t, 0), color="#c04000", label="truth")
axes[0].plot(t, np.where(braked[:, 0] > 0.5, braked[:, 1], np.nan), "o", color="0.2", label="BOF, if DYNAMIC")
axes[0].set(xlabel="time [s]", ylabel="speed [m/s]")
axes[0].legend(frameon=False)
axes[1].plot(t, approach(lambda t: 8, spacing=2, scans=26)[:, 0], color="0.7", label="at 8 m/s all the time")
axes[1].plot(t, braked[:, 0], "o-", color="0.2", label="braking")
axes[1].set(xlabel="time [s]", ylabel="P(DYNAMIC)", ylim=(0, 1.05))
axes[1].legend(frameon=False, fontsize="small")
plt.show()

# %% [markdown]
# When the box has slowed down by a bin, the mass of the old one overshoots, and the new one holds what little has
# jumped there by chance, in either direction. So the dots lie above the line, for BOF is late; and half-way through the
# braking it is far less sure that the box moves than of one that keeps its speed (right). Particles get each a little
# faster or slower at every step (lecture 04).
#
# **Two more**, for which you have all you need. *What nobody has seen before has no antecedent*: a car that comes out
# from behind another is believed to stand until it has arrived somewhere free. *Behind an obstacle* mass flies on
# unseen, and meets no scan that could contradict it; the matrix forgets it after a second or two.
#
# ## In five lines
#
# 1. What is in a cell now was in its antecedent before: each velocity of a lattice shifts its own map, by whole cells,
#    and keeps the remainder.
# 2. A scan measures no velocity. It picks places, and places pick velocities.
# 3. Where something arrives and something stands, strike the pair out: a fence stays a fence. What moves also says that
#    nothing stands where it was; cells filtered one by one don't notice that by themselves.
# 4. The zero velocity is STATIC, the others are DYNAMIC; mean and covariance come from them.
# 5. Memory and time grow with the *area* of the lattice; flanks, velocities between bins and braking fool it.
#
# ## Further reading
#
# - Coué, Pradalier, Laugier, Fraichard, Bessière, *Bayesian occupancy filtering for multitarget tracking: an automotive
#   application*, International Journal of Robotics Research 25(1), 2006: the filter.
# - Nègre, Rummelhard, Laugier, *Hybrid sampling Bayesian occupancy filter*, IEEE Intelligent Vehicles Symposium 2014:
#   what stands in the grid, what moves in particles; the step from here to lecture 04.
# - Danescu, Oniga, Nedevschi, *Modeling and tracking the driving environment with a particle-based occupancy grid*,
#   IEEE Transactions on Intelligent Transportation Systems 12(4), 2011: particles in place of the lattice.
#
# ## Exercise
#
# [Exercise 03](exercises/03_bof.ipynb): antecedents, one velocity's flight, a scan, mean and covariance, what arrives
# where something stands, and one question.

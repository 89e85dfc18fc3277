# %% [markdown]
# # 04 · CMCDOT: four states, particles, resampling
#
# **In one sentence.** Only what moves needs a velocity, so CMCDOT puts that part of its belief on particles and the rest
# into four numbers per cell; four small steps at each scan then tell most of what drives from what stands.
#
# **You will be able to**
# - do each of the paper's four steps by hand, and find it in the code;
# - derive what becomes of a cell in which something arrives;
# - explain why no scan by itself tells STATIC from DYNAMIC, and what does;
# - split the filter's error into a part that more particles remove and a part that they leave;
# - find out, by switching off one cause after the other, why a car that drives away seems to stand.
#
# **Prerequisites.** Lectures [01](01_bayes.ipynb) to [03](03_bof.ipynb): Bayes' rule on a line, what a scan says about
# a cell, occupancy with velocity.
#
# **Time.** 75 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.2, its four numbered steps. The filter is that of Rummelhard, Nègre, Laugier, *Conditional
# Monte Carlo Dense Occupancy Tracker*, ITSC 2015. The paper tells the steps in words; the formulas here are this
# project's reading of them.

# %% jupyter={"source_hidden": true}
from dataclasses import replace
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, SelectionSlider, interact

from semgrid_edu import fast, graphical, grid, occupancy, plotting
from semgrid_edu.datasets import samples
from semgrid_edu.occupancy import FilterState, PlanarMotion, State, predict, update
from worlds import lecture_03_bof, lecture_03_row, lecture_04_cmcdot, lecture_04_cmcdot_graph
from worlds import lecture_04_crossing, lecture_04_pictures

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
FREE, STATIC, DYNAMIC, UNKNOWN = State
drive, spec = samples.sample_drive(), grid.GridSpec.compact()
params = occupancy.CmcdotParams(sensor=fast.SensorModel())
frames = [drive[k] for k in range(len(drive))]

# %% [markdown]
# ## Why a third filter?
#
# The log-odds grid of lecture 02 can't say that anything moves. The BOF of lecture 03 can. Here are both on the sample
# drive, beside the filter of this lecture:


# %% jupyter={"source_hidden": true}
def filtered(tracker):
    """Give one filter all scans of the sample drive."""
    beliefs = []
    for before, now in pairwise([frames[0], *frames[:17]]):
        motion = PlanarMotion.from_poses(before.T_world_from_lidar, now.T_world_from_lidar)
        beliefs.append(tracker.step(now.points_grid, motion, now.time - before.time))
    return beliefs


lattice = occupancy.VelocityLattice(max_speed=16, spacing=2)
bof_params = occupancy.BofParams(lattice, occupancy.WorldModel(sensor=params.sensor))
by_log_odds = filtered(occupancy.LogOddsGrid(spec, occupancy.LogOddsParams(sensor=params.sensor)))
by_bof = filtered(occupancy.Bof(spec, bof_params))
by_cmcdot = filtered(fast.Cmcdot(spec, params))


# %% jupyter={"source_hidden": true} alt="animation of three maps of one street, seen from above: a car A overtakes us on the left and is blue in the two maps on the right, a car B comes towards us and is yellow there; in the left map B and the cars behind it leave a long dark trail C on the road, in the others it soon fades; D stands and is dark in all three"
plotting.animate(
    lecture_04_pictures.three_filters(spec, by_log_odds, by_bof, by_cmcdot), 0.4,
    alt="three filters on one street: A overtakes, B comes, C is left, D stands",
)  # fmt: skip

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
held = lecture_04_crossing.road_held(spec, frames[16], by_log_odds[16], by_bof[16], by_cmcdot[16])
for name, share in held.items():
    print(f"{name:<14} after 1.6 s holds {100 * share:2.0f} % of the free road in B's lane occupied")
other = filtered(fast.Cmcdot(spec, params, seed=1))
moves = [b[16].probability.argmax(axis=0) == DYNAMIC for b in (by_bof, by_cmcdot, other)]
alike = [100 * (a & b).sum() / (a | b).sum() for a, b in pairwise(moves)]
cells = np.prod(spec.shape)
kept = [cells * len(lattice) / 1e6, (4 * cells + 5 * params.n_particles) / 1e6]
print("of the cells that either of two filters calls DYNAMIC, both do:")
print(f"BOF and CMCDOT {alike[0]:.0f} %, CMCDOT and CMCDOT with other random numbers {alike[1]:.0f} %")
print("numbers kept: BOF {:.1f} million, CMCDOT {:.1f} million".format(*kept))
assert max(held["BOF"], held["CMCDOT"]) < 0.1 < 0.25 < held["log-odds grid"] < 0.35
assert 58 < alike[0] < 72 < 74 < alike[1] < 86
assert 1.7 < kept[0] < 1.8 < 1.7 * kept[1] + 0.1

# %% [markdown]
# **A** overtakes us, **B** is the first of three cars that come towards us, **D** is parked. **C** is the road that B
# has just left. The log-odds grid goes on holding it occupied. The two others have cleared it. Of the cells that either
# calls DYNAMIC, two thirds are DYNAMIC for both. Two runs of CMCDOT with other random numbers share four fifths. Why
# want another filter?
#
# Count on a line first. Six cells with five velocities each are thirty numbers. Something moves in *one* of the cells.
# Then most of the thirty numbers only repeat that nothing moves in the others.
#
# **Predict before you run.** The paper's grid has 355 x 155 cells. Velocities up to 25 m/s in any direction, 1 m/s
# apart, fill a disc of about $\pi \cdot 25^2$ points. How many numbers does BOF keep: a million, ten, a hundred?
#
# <details><summary>Answer</summary>
#
# About 55,000 cells times 1,960 velocities: more than a hundred million.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
cells = np.prod(grid.GridSpec.paper().shape)
velocities = len(occupancy.VelocityLattice(max_speed=25, spacing=1))
print(f"BOF:    {cells:,} cells x {velocities:,} velocities          = {cells * velocities / 1e6:5.1f} million numbers")
numbers = 4 * cells + 5 * params.n_particles
print(f"CMCDOT: {cells:,} cells x 4, and {params.n_particles:,} particles x 5 = {numbers / 1e6:5.1f} million")
assert numbers < 0.012 * cells * velocities

# %% [markdown]
# To save most of them, ask where the thing in a cell is a tenth of a second later:
#
# | state | what is in the cell | a moment later | carried by |
# |---|---|---|---|
# | FREE | nothing | still nothing, here | one number per cell |
# | STATIC | something that stands | still here | one number per cell |
# | DYNAMIC | something that moves | **elsewhere** | particles, and their sum in each cell |
# | UNKNOWN | nobody knows (any more) | still unknown, here | one number per cell |
#
# Only DYNAMIC leaves its cell, so only DYNAMIC needs velocities. A sample of them will do, spent where something may
# move. It consists of **particles**. Each has a place, a velocity and a weight $w$, which is the probability that it
# carries. The dynamic probability of a cell is the sum of the weights in it.
#
# We write $b_F, b_S, b_D, b_U$ for the belief of one cell. So a third filter is wanted because on the paper's grid it
# keeps a hundredth of BOF's numbers. There we don't compare what the two find. On the small grid of our drive, where we
# did, CMCDOT keeps 1.0 million numbers and BOF 1.7.
#
# ## What are the four steps?
#
# The paper names four steps. Beside each is the line of the package that takes it, and the function by hand that this
# lecture writes for it:
#
# | step of the paper | in its words | line of code | by hand |
# |---|---|---|---|
# | 1 prediction | previous states through a "transition matrix" | `predict` | `predict_line` |
# | 2 update | "assessed" by a "sensor model" | `update`, times the evidence | `update_cell` |
# | 3 estimate | "state distributions are computed" | `update`, divided by the sum | `update_cell` |
# | 4 resampling | "new particles" where something is new or moves | `resample` | `comb` |
#
# Before them the map has to follow our vehicle, by `move`. Here is one round of the filter for each scan. (`fast` has
# compiled copies of the package's functions, whose docstrings count `move` as step 1.)


# %%
def filter_drive(frames, rng):
    """Run the four steps over a drive, and yield what each of them returns."""
    state, pose = FilterState.unknown(spec), PlanarMotion()
    for last, now in pairwise([frames[0], *frames]):
        motion = PlanarMotion.from_poses(last.T_world_from_lidar, now.T_world_from_lidar)
        shift, pose = occupancy.planar_motion.scroll(pose.then(motion), spec.cell)
        evidence = fast.scan_evidence(now.points_grid, spec, params.sensor, pose)
        moved = fast.move(state, spec, shift)  # the map follows us
        predicted = fast.predict(moved, spec, params, now.time - last.time, rng, (motion.dx, 0.0))  # 1
        updated = fast.update(predicted, spec, evidence, params)  # 2 and 3
        state = fast.resample(updated, spec, params, rng)  # 4
        yield predicted, evidence, updated, state


*_, (predicted, evidence, updated, resampled) = filter_drive(frames[:17], np.random.default_rng(0))

# %% jupyter={"source_hidden": true}
same = by_cmcdot[16].probability.argmax(axis=0) == resampled.probability.argmax(axis=0)
assert same.mean() > 0.9

# %% [markdown]
# The package's `Cmcdot` is this loop on a larger map, with a second update for what it hands out. Watch the
# overtaking car A go through one round:

# %% jupyter={"source_hidden": true} alt="four small maps of the overtaking car A: after step 1, a pale orange L with blurred borders; the scan, a black L of hits, pink where beams passed and white where none came; after steps 2 and 3, a sharp orange L; after step 4, blue particles with the same outline"
fig, axes = plt.subplots(1, 4, figsize=(9.6, 3.9), layout="constrained", sharey=True)
lecture_04_pictures.draw_round(axes, spec, predicted, evidence, updated, resampled)
lecture_04_pictures.legend_of_round(fig)
plt.show()

# %% [markdown]
# - *Step 1.* The orange mass has flown ahead. It pales, because its particles don't agree about the velocity and
#   because every cell forgets a little.
# - *Steps 2 and 3.* The scan knows hit and passed, but not *moves*. The orange stays where there was a hit and goes
#   where beams passed.
# - *Step 4.* The same mass on new particles.
#
# Moving needs one trick. We drive 0.4 m per scan, and a post stands in cell 3 of a row of cells of one metre. If each
# new cell took a part of two old ones, the post would smear out a little more in every step. If it took the nearest
# old cell, 0.4 m would round to nothing and the map would never move. So the filter shifts by whole cells only and
# remembers what is left over:


# %% tags=["cmcdot-1"]
def shift_whole(b, cells, remainder):
    """Scroll a line by whole cells, and remember what is left over; what enters at the far end is 0."""
    k = round(cells + remainder)
    return np.concatenate([b[k:], np.zeros(k)]), cells + remainder - k


post, remainder = np.eye(6)[3], 0.0
for step in range(1, 6):
    post, remainder = shift_whole(post, 0.4, remainder)
    print(f"{0.4 * step:.1f} m driven: the post is in cell {post.argmax()}, remainder {remainder:+.1f} m")

# %% [markdown]
# The remainder is the vehicle's place *within* the map, and scans are entered there.
#
# So a round is: move the map, let time pass, look, and spend the particles anew. Now the paper's steps by hand.
#
# ## What if something arrives where something may stand?
#
# While $\Delta t$ passes without a scan, two things happen. First each cell forgets a little (the table left that out),
# by the transition matrix of lecture 01: what is FREE or STATIC slowly turns UNKNOWN, what is DYNAMIC faster, and
# a sliver turns DYNAMIC. That mass is **born**. (The matrix belongs to $\Delta t$: two steps of 0.05 s do what one of
# 0.1 s does.) Then the particles fly.
#
# Here is a line of cells of one metre. A tenth of a second passes. In cell 1 are two particles at 10 m/s and one at 2
# m/s, all of one weight. In cell 3 is another one at 10 m/s. In cell 4 there may be a fence:
#
# ```
# cell        0     1     2     3     4     5
# FREE        1    0.4    1    0.5   0.5    1
# STATIC      0     0     0     0    0.5    0
# DYNAMIC     0    0.6    0    0.5    0     0
# ```
#
# From cell 1, 0.4 flies on to the next cell and leaves FREE behind, because nothing stands where something has moved.
# The slow particle stays for now. But at the fence two opinions meet: "I stand here" and "I arrive". The graph shows
# how the two are tied:

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a graph of two time slices: a particle q before points to q now; the cell m before points to m now; both q point to their m; m before and q now point to an observed node, fits; m now points to the scan z"
stage = lecture_04_cmcdot_graph.cmcdot_stage()
labels = {name: label for name, label in stage.labels.items() if name in stage.model.names}
stage = replace(stage, cut=(), ghosts={}, labels=labels)
ax = stage.draw(plt.subplots(figsize=(5.6, 4.0), layout="constrained")[1])
ax.set_title("one thing and one cell, before and now", fontsize=10)
plt.show()
model = stage.model  # in code q0, q1: the thing before and now; m0, m1: the cell; one1: fits; z1: the scan
assert graphical.d_separated(model, "m0", "q1", given=["q0"])
assert not graphical.d_separated(model, "m0", "q1", given=["q0", "one1"])
assert graphical.d_separated(model, "z1", "q1", given=["m1", "one1"])

# %% [markdown]
# $q$ is the moving thing, with place and velocity; each particle $i$ is one guess of it. $m_k$ is the state of cell $k$,
# and $z_k$ what the scan says of it. The left column is before, at $t-1$, the right one now. The node *fits* is always
# observed: *nothing arrives where something stands*. If we know where the thing was, its arrival alone says nothing
# about the cell's old state. Together with *fits* it does: what arrives speaks against what stands.
#
# So do what lecture 03 did. Write down all pairs as products, strike out the impossible one, and scale what is left.
# Something arrives with probability $a$, and UNKNOWN goes like FREE:
#
# | | cell: FREE | cell: STATIC | cell: DYNAMIC |
# |---|---|---|---|
# | **arrives** | $a\, b_F$ → DYNAMIC | $a\, b_S$ ✗ | $a\, b_D$ → DYNAMIC |
# | **doesn't** | $(1 - a)\, b_F$ → FREE | $(1 - a)\, b_S$ → STATIC | $(1 - a)\, b_D$ → DYNAMIC |
#
# If nothing moves in the cell yet ($b_D = 0$), this is what the graph gives. The last column is an *assumption*. One
# thing can't arrive and be there already, but two parts of a car can. So the filter keeps this pair, and takes the two
# as independent.
#
# The first row gives $a\,(1 - b_S)$ to DYNAMIC, the second $(1 - a)\, b_D$, and $1 - a\, b_S$ is left in all:
#
# $$ b'_D = \frac{a\,(1 - b_S) + (1 - a)\, b_D}{1 - a\, b_S}, \qquad
#    b'_{F,S,U} = \frac{(1 - a)\, b_{F,S,U}}{1 - a\, b_S} $$
#
# **Predict before you run.** At the fence, $a = b_F = b_S = 1/2$. What is the cell afterwards? And a cell that was
# surely FREE, or STATIC with $b_S = 0.99$, if a particle arrives with $a = 0.9$?
#
# <details><summary>Answer</summary>
#
# Four pairs of a quarter, one of them impossible: one third each for DYNAMIC, FREE and STATIC. The free cell becomes
# DYNAMIC with 0.9, the surer fence with 0.009 / 0.109 = 0.08. It goes on standing when particles cross it.
#
# </details>

# %% [markdown]
# Here is all of step 1, for a line of cells of one metre. `b` holds four numbers per cell, `x`, `v` and `w` are the
# places, velocities and weights of the particles, and `M` is the transition matrix:


# %% tags=["cmcdot-2"]
def sums(w, x):
    """Add up the weights in each of the six cells."""
    return np.bincount(x.astype(int), w, minlength=6)


def predict_line(b, x, v, w, M, dt):
    """Step 1 of the paper: return the cells, and the particles' places and weights, after `dt`."""
    b = M.T @ b  # each cell forgets a little
    w = w * M[DYNAMIC, DYNAMIC]  # and so do the particles in it
    x_new = x + v * dt  # they fly
    here, there = x.astype(int), x_new.astype(int)
    leaves = w * (there != here)
    a = sums(leaves, x_new)  # what arrives in each cell
    b[DYNAMIC] -= sums(leaves, x)
    b[FREE] += sums(leaves, x)  # nothing stands where something has moved
    possible = 1 - a * b[STATIC]  # the table without its struck pair
    stays, arrives = (1 - a) / possible, (1 - b[STATIC]) / possible
    b *= stays
    b[DYNAMIC] += a * arrives
    return b, x_new, w * np.where(there != here, arrives[there], stays[there])


# %% jupyter={"outputs_hidden": true}
x, v, w = np.array([1.2, 1.5, 1.5, 3.4]), np.array([10, 10, 2, 10]), np.array([0.2, 0.2, 0.2, 0.5])
line, calm, before = lecture_04_crossing.on_a_line(x, v, w, fence=4)
after, x_new, w_new = predict_line(before.probability[:, ::-1, 0], x, v, w, M=np.eye(4), dt=0.1)
for state in (FREE, STATIC, DYNAMIC):
    print(f"{state.name:<8}", *(f"{p:5.2f}" for p in after[state]))

# %% jupyter={"source_hidden": true}
np.testing.assert_allclose(after[:3, 4], 1 / 3)
np.testing.assert_allclose(after[DYNAMIC, 1:3], [0.2, 0.4])
for b_s, expected in ((0, 0.9), (0.99, 0.0826)):
    one_x, one_v, one_w = np.array([3.4]), np.array([10]), np.array([0.9])
    cell = lecture_04_crossing.on_a_line(one_x, one_v, one_w, fence=4, b_s=b_s)[2]
    got = predict_line(cell.probability[:, ::-1, 0], one_x, one_v, one_w, np.eye(4), 0.1)[0][DYNAMIC, 4]
    np.testing.assert_allclose(got, expected, atol=1e-4)
rng = np.random.default_rng(0)
for _trial in range(20):  # the package's predict, with and without forgetting
    x, v, w = rng.uniform(0, 3, 8), rng.uniform(2, 20, 8), rng.uniform(0, 0.1, 8)
    line, calm, before = lecture_04_crossing.on_a_line(x, v, w, fence=4, b_s=rng.random())
    for world in (calm, replace(calm, rates=params.rates)):
        M = occupancy.steps.transition_matrix(world, 0.1)
        by_hand = predict_line(before.probability[:, ::-1, 0].copy(), x, v, w, M, 0.1)
        by_package = predict(before, line, world, 0.1, rng)
        np.testing.assert_allclose(by_hand[0], by_package.probability[:, ::-1, 0], atol=1e-5)
        np.testing.assert_allclose(by_hand[2], by_package.particles.weight, atol=1e-5)

# %% [markdown]
# The package's `predict` does the same in two dimensions, and adds three things. The velocity of each particle is
# scattered a little. A particle that hardly moves becomes STATIC, because no scan could tell the two apart. And near
# walls some arrivals are doubted; the paper's filter has no doubt, and we come to it at the end.
#
# So neither wins by rule. An arrival in free space is DYNAMIC, and a fence that is known to stand goes on standing.
#
# ## What does a scan change?
#
# A return comes back from one cell. If the cell is occupied, this is four times as probable as if it is free. Half of
# what is predicted for the cell is UNKNOWN. This isn't a kind of thing. It says that nobody knows, and now a scan
# looks. So first share it out among the others, in the proportions in which things are found at **first sight**, here
# 0.6, 0.3, 0.1. Then Bayes' rule:
#
# ```
#                       FREE   STATIC  DYNAMIC  UNKNOWN
# predicted              0.2     0.2     0.1      0.5
# shared out             0.5     0.35    0.15     0       each gets its part of 0.5
# times the evidence     0.10    0.28    0.12     0       0.2 if free, 0.8 if occupied
# divided by the sum     0.20    0.56    0.24     0       the sum is 0.5
# ```
#
# **Predict before you run.** Which row changes the ratio of STATIC to DYNAMIC? What is it after ten more such scans,
# if nothing happens between them?
#
# <details><summary>Answer</summary>
#
# Only *shared out*: two to one becomes seven to three. The evidence multiplies both by the same number, so the ratio
# stays. Only what happens *between* scans can change it.
#
# </details>


# %% tags=["cmcdot-3"] jupyter={"outputs_hidden": true}
def update_cell(b, occupied, free, first_sight):
    """Share UNKNOWN out, then Bayes' rule; what nothing explains is UNKNOWN."""
    b = np.array(b, dtype=float)
    if occupied != free:  # the scan says something
        b[:3] += b[UNKNOWN] * np.array(first_sight)
        b[UNKNOWN] = 0
    joint = b * [free, occupied, occupied, free]  # step 2 of the paper
    return joint / joint.sum() if joint.any() else np.array([0.0, 0, 0, 1])  # step 3


print("FREE, STATIC, DYNAMIC, UNKNOWN:", update_cell((0.2, 0.2, 0.1, 0.5), 0.8, 0.2, (0.6, 0.3, 0.1)).round(2))

# %% jupyter={"source_hidden": true}
one = grid.GridSpec(x_min=0, x_max=1, y_min=0, y_max=1, cell=1)
sight = occupancy.CmcdotParams(first_sight=(0.6, 0.3, 0.1))
for b, occupied, free in (((0.2, 0.2, 0.1, 0.5), 0.8, 0.2), ((0.2, 0.2, 0.1, 0.5), 0.3, 0.3), ((1, 0, 0, 0), 1, 0)):
    cell = FilterState(np.reshape(b, (4, 1, 1)).astype(float), occupancy.Particles.none(), np.full((1, 1), float(b[2])))
    seen = occupancy.Evidence(np.full((1, 1), occupied), np.full((1, 1), free))
    by_package = update(cell, one, seen, sight).probability[:, 0, 0]
    np.testing.assert_allclose(by_package, update_cell(b, occupied, free, sight.first_sight), atol=1e-6)

# %% [markdown]
# The particles take part with their weights. In the graph every path from $z_k$ to $q$ leads through $m_k$. So all
# particles of a cell are multiplied by one number, whatever their velocity.
#
# If no scan tells STATIC from DYNAMIC, what does? *First sight* is a guess: an occupied cell that nobody has seen before
# is STATIC rather than DYNAMIC, by fifteen to one. Then the particles fly. Where one *arrives* in a cell that is known to
# be FREE, $b_D$ rises. Where one *leaves*, or *stops*, $b_D$ falls.
#
# While we drive, a wall, a parked car and a car that comes at 8 m/s are scanned. "Nothing arrives": what leaves a cell
# is lost. Four rows begin with the opposite guess, fifteen to one for DYNAMIC:

# %% jupyter={"source_hidden": true}
print("cells called DYNAMIC [%], mean of eight seeds    wall  parked car  coming car")
table = {name: shares.mean(axis=0) for name, shares in lecture_04_crossing.arrivals().items()}
for name, (wall, parked, car) in table.items():
    print(f"{name:<47} {wall:5.0f} {parked:11.0f} {car:11.0f}")
usual, lost, guess, no_stop, only_leave, nothing = table.values()
assert usual[:2].max() < 2 < 75 < usual[2]
assert lost.max() < 1
assert guess[1] < 2 < 12 < guess[0] < 20 < 50 < no_stop[0] < 62
assert only_leave.max() < 6 < 20 < no_stop[1] < 30
assert nothing[:2].min() > 99

# %% [markdown]
# *Arrivals make the car DYNAMIC*: without them none of it is. *Leaving and stopping make the wall STATIC.* With the
# opposite guess, and nothing that flies or stops, the wall and the parked car stay DYNAMIC. If particles may leave, but
# not arrive or stop, both are nearly all STATIC. If they may arrive, too, half of the wall is DYNAMIC again, and stopping
# removes most of that. But this car comes through cells that we have seen FREE. Remember that for the last section.
#
# ## Which particles go on?
#
# Left alone, a few particles would soon carry nearly everything. So the filter draws new ones from the old, in
# proportion to their weights. By hand: weights 0.1, 0.6, 0.3; draw four. Lay the weights end to end, and over them a
# comb of four teeth, a quarter apart. The only random number is where the comb begins, as a part of the teeth's
# distance; say 0.2:
#
# ```
# 0   0.1                                0.7              1
# |-0-|-----------------1----------------|-------2--------|
#   ^             ^             ^              ^              -> 0, 1, 1, 2
# ```
#
# With $N$ teeth and $r$ for the random number, tooth $i$ is at
#
# $$ \text{tooth}_i = \frac{i + r}{N}, \qquad i = 0 \ldots N - 1. $$
#
# **Predict before you run.** Now $r = 0.5$. Which four? And how often *can* particle 1 be drawn, whatever $r$?
#
# <details><summary>Answer</summary>
#
# Particles 1, 1, 1, 2, and particle 0 dies out. Particle 1 expects 2.4 copies and gets two or three. Four independent
# draws could give any number, and the difference would be noise that no sensor has made.
#
# </details>


# %% tags=["cmcdot-4"] jupyter={"outputs_hidden": true}
def comb(weight, count, r):
    """Draw `count` indices: systematic resampling, literally."""
    drawn, n, end = [], 0, weight[0]
    for i in range(count):
        while end <= (i + r) / count * sum(weight):
            n += 1
            end += weight[n]
        drawn.append(n)
    return drawn


for r in (0.2, 0.5):
    drawn = comb([0.1, 0.6, 0.3], 4, r)
    np.testing.assert_array_equal(drawn, occupancy.state.systematic_resample(np.array([0.1, 0.6, 0.3]), 4, r))
    print(f"r = {r}: {drawn}")

# %% jupyter={"source_hidden": true}
changed = np.abs(resampled.probability - updated.probability).max()
heaviest = [s.particles.weight.max() / s.particles.weight.mean() for s in (updated, resampled)]
assert changed < 0.01
assert heaviest[0] > 5 * heaviest[1]
assert params.birth_share == 0.3

# %% [markdown]
# `resample` draws twice: old particles by weight, and, for three particles in ten, cells by newborn mass. A
# newborn particle gets any heading and a speed from a wide prior, and the next scans decide which of them flew to where
# something is. Then the weights in each cell are scaled so that they sum to $b_D$ again. So the draw changes which
# particles carry the belief, and hardly the belief itself.
#
# ## Do enough particles make it exact?
#
# Take four cells in a row, all FREE but cell 2. There something moves, to the left or to the right with one half each.
# A scan has a hit in cell 3, and beams pass the three others. So the thing is hardly in cell 1. But a filter that keeps
# each cell by itself only knows of cell 1 that a beam has passed there. Lecture 03 called
# this **assumed-density filtering**. More particles don't help, because they only sample what such a filter keeps:

# %% jupyter={"source_hidden": true}
row = ({}, {"left": 0.5, "right": 0.5}, {}, {})
world = lecture_03_row.CellsInARow(row, ("..x.", "...x"), lecture_04_cmcdot.FORGETTING)
left = lecture_03_row.Cell.LEFT
exact, bof = lecture_03_row.exact_beliefs(world)[0], lecture_03_bof.bof_beliefs(world)[0]
sampled = np.mean([lecture_04_cmcdot.particle_beliefs(world, 400, seed)[0] for seed in range(10)], axis=0)
for name, belief in (("exact", exact), ("BOF", bof), ("CMCDOT", sampled)):
    print(f"{name:<7} P(something that moves to the left is in cell 1) = {belief[0, left]:.2f}")
assert min(bof[0, left], sampled[0, left]) > 4 * exact[0, left]

# %% [markdown]
# What do particles add to it? Call **bias** the root mean square error of BOF to the exact answer. Call sampling error
# how far the particles scatter around BOF. If they do it without a preference, the squares add:
#
# $$ \text{error}^2 \approx \text{bias}^2 + \text{sampling}^2, \qquad \text{sampling} \propto N^{-1/2} $$
#
# The scatter of a mean of $N$ draws falls like $N^{-1/2}$: four times as many, half of it. For CMCDOT:

# %% jupyter={"source_hidden": true} alt="errors against the number of particles on logarithmic axes: the sampling error falls along a line of slope minus one half; the bias is a horizontal dashed line at 0.055; the error to the exact answer is on the curve of their sum; it is above the bias at 10 particles and on it from 160 on"
error = lecture_04_cmcdot.sampling_error(world, [10, 40, 160, 640], seeds=range(100))
lecture_04_pictures.draw_error(error)
plt.show()
assert np.abs(error.to_exact / np.hypot(error.bias, error.to_bof) - 1).max() < 0.04  # the squares add
assert -0.6 < error.slope < -0.4
print(f"bias {error.bias:.3f}; sampling error with 10 particles {error.to_bof[0]:.3f}, with 640 {error.to_bof[-1]:.3f}")

# %% [markdown]
# With ten particles the sampling error is half of the bias, and the error is above the bias. With 640 only the bias is
# left. So no: more particles bring CMCDOT to BOF, not to the truth.
#
# To sample only the motion and to sum the cells' states exactly is the idea of the **Rao-Blackwellised particle
# filter**, and the "conditional Monte Carlo" in the filter's name. One thing is missing altogether: no variable says
# which return comes from which car. To decide that is called **data association**. CMCDOT does without it.
#
# ## How many particles does a street need?
#
# There nobody knows the exact answer, so ask: is it found? A car comes towards us and a person
# crosses, between a wall and a parked car. We count how many of their cells are DYNAMIC, with 24 seeds for each number
# of particles.
#
# **Predict before you run.** Which of the two suffers more when you take particles away? Does a tenth of the particles
# find a tenth?
#
# <details><summary>Answer</summary>
#
# The person suffers more. And no: a tenth of the particles finds nearly as much of the car. With a hundredth the
# seed decides what is found of either.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, the street after 2 s in two runs with 3,000 particles: in both the front of the car is orange; the person is half orange in one and mostly dark in the other; right, dots for 24 seeds and their mean: of the car 42, 83, 92 per cent are DYNAMIC at 300, 3,000 and 30,000 particles, of the person 18, 50, 81; with 3,000 the dots of the person spread from 5 to 86"
luck = lecture_04_crossing.luck()
fig, axes = plt.subplots(1, 3, figsize=(9.6, 4.1), layout="constrained", width_ratios=(1, 1, 1.5))
for ax, seed in zip(axes, (0, 3), strict=False):
    lecture_04_pictures.draw_crossing(ax, 3000, seed=seed, legend=ax is axes[0])
lecture_04_pictures.draw_luck(axes[2], luck)
plt.show()

# %%
for number, found in luck.items():
    car, person = zip(found.mean(axis=0), found.std(axis=0, ddof=1), strict=True)
    print("{:6,} particles: car {:.0f} % ± {:2.0f}, person {:.0f} % ± {:2.0f}".format(number, *car, *person))
changed = lecture_04_crossing.luck_of_one_change()
for name, found in changed.items():
    print(f" 3,000 particles: {name:<26} {found.mean():.0f} % ± {found.std(ddof=1):2.0f}")

# %% jupyter={"source_hidden": true}
walker = luck[3000][:, 1]
large, running, beside_parked = changed.values()
for found in (large, running, beside_parked):
    assert found.mean() > walker.mean() + 3 * np.hypot(found.std(ddof=1), walker.std(ddof=1)) / 24**0.5
assert running.mean() > 90
assert max(running.std(), beside_parked.std()) < 10 < 15 < large.std() < walker.std()

# %% [markdown]
# (± is the standard deviation over the seeds.) The mean rises for both. With 3,000 particles most of the car is DYNAMIC
# in every run, but of the person it may be nearly all or nearly nothing. With 30,000 every run finds both.
#
# Why the person? It is small, it is slow, and the car takes more than half of the particles. The lower rows change
# one thing at a time. A walker four times as large across its way is found better. So is the same
# small person who runs at 3 m/s, and so is the walker when the car is parked and takes none. So with too few particles it
# is a matter of luck whether something small and slow is found beside something large that moves.
#
# So the smallest slow thing that you must not miss sets the number, on the busiest street.


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true, "outputs_hidden": true}
def show(particles, stop_speed):
    """Draw the street with your settings."""
    _, ax = plt.subplots(figsize=(4, 5), layout="compressed")
    lecture_04_pictures.draw_crossing(ax, particles, stop_speed)
    plt.show()


_ = interact(
    show,
    particles=SelectionSlider(options=[300, 1000, 3000, 10_000, 30_000], value=30_000),
    stop_speed=FloatSlider(value=0.4, min=0.1, max=3, step=0.1),
)

# %% [markdown]
# (The dials work with a running kernel. Below `stop_speed`, in m/s, particles soon count as standing. The person walks
# at 1.4: set 1.5, and it stands.)
#
# ## Where this breaks: a car that drives away
#
# Now ten scans of a real street, while we wait in a queue. In lane E two cars come towards us. F, the car
# ahead of us, rolls off. (At 1.8 s one of the two has passed us.)

# %% jupyter={"source_hidden": true} alt="two maps of a real street from above, with three frames: in lane E the cars are dark at 0.2 s and yellow, coming towards us, at 1.8 s; in frame F the car ahead of us is dark in both; in the frame to the right of us trees, walls and parked cars are dark in both"
real = [samples.real_drive()[k] for k in range(10)]
wide = lecture_04_crossing.WIDE
on_street = list(fast.track_drive(real, wide, params))
fig, axes = plt.subplots(1, 2, figsize=(9.6, 4.6), layout="compressed")
for ax, k in zip(axes, (1, 9), strict=True):
    lecture_04_pictures.draw_street(ax, wide, on_street[k], f"{real[k].time - real[0].time:.1f} s", legend=k == 9)
plt.show()

# %% jupyter={"source_hidden": true}
shares = lecture_04_crossing.dynamic_shares
assert shares(wide, real, on_street, "lane E")[0] == 0
assert shares(wide, real, on_street, "lane E")[6:].min() > 95
assert shares(wide, real, on_street, "right of us").max() < 3
assert abs(lecture_04_crossing.speed_ahead(real) - 2.4) < 0.1

# %% [markdown]
# At first the cars in lane E are STATIC. After about a second particles have arrived with them in cells that were seen
# FREE, and they are DYNAMIC. On the right hardly a cell ever is. But F, which rolls at 2.4 m/s,
# stays dark. Why?
#
# We see only F's rear. As it moves on, it arrives in cells that its own body has hidden, and that nobody has seen FREE.
# In such cells two parts of the filter speak against motion:
#
# - **First sight**: what turns up in a cell that nobody has seen is STATIC, by fifteen to
#   one.
# - **A rule that the paper doesn't have.** Real walls come into view piece by piece, and each new piece looks like
#   something that arrives. So `occupancy/walls.py` looks back along each particle's path. If something STATIC is where
#   it came from, and what is ahead isn't known to be free, its arrival in an unseen cell is doubted: it may be the next
#   piece of the wall. F was STATIC at first, and hides what is ahead of it. So the rule doubts F, too.
#
# Switch off each by itself, then both. In the control nothing is switched off, but the filter is told at the beginning
# that the cells of F and of its way are free. There only the last scans are of use, when F has left its first place.
#
# **Predict before you run.** Will F be found in the control, although both are at work?
#
# <details><summary>Answer</summary>
#
# Yes: both act only where UNKNOWN is left, or where something has just left the cell. There they find little to do.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="five curves over 1.8 s of how much of the car F is DYNAMIC: as it is, never above 12 per cent; without the rule, below 25 until 1.6 s, then 44; with even odds at first sight, 20 from 0.4 s on and 36 at the end; without both, and in the control, about 20 until 1 s and above 60 at the end"
away = lecture_04_crossing.drives_away()
fig, ax = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
lecture_04_pictures.draw_late(ax, [frame.time - real[0].time for frame in real], away)
plt.show()

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
borders = lecture_04_crossing.borders()
print("cells called DYNAMIC [%]      F, last scan   fences, walls, hedges, mean of 6 drives")
for name, shares in away.items():
    standing = f"{borders[name].mean():.0f}" if name in borders else "-"
    print(f"{name:<27} {shares[-1]:14.0f} {standing:>41}")
as_it_is, no_rule, even, both, known_free = away.values()
assert as_it_is.max() < 15
assert (even[1:5] > no_rule[1:5] + 5).all()
assert max(no_rule[-1], even[-1]) < 50 < 55 < min(both[-1], known_free[-1])
assert np.abs(no_rule - even)[5:].max() < 10  # about one cell
stands = {name: shares.mean() for name, shares in borders.items()}
assert stands["as it is"] < 1 < 3 < stands["without the rule"] < 4.5 < stands["even odds at first sight"] < 6 < 8
assert 8 < stands["both"] < 10

# %% [markdown]
# As it is, F is hardly found. Even odds help at once, without the rule F is found late, and either alone leaves more
# than half of F dark to the end. With both switches most of F is DYNAMIC, but a third stays dark,
# and we haven't looked for its cause. Which of them counts more can't be told here:
# F has about fifteen cells, and from 1 s on the two curves differ by about one cell. In the control F is found as well,
# although nothing is switched off. So the root is the way that F itself hides.
#
# Then why not use both switches? The right column counts fences, walls and hedges on six simulated drives. They
# stand, but with both switches 9 % of their cells seem to move. Without the rule alone, F is found several times as well
# at the end, and 4 % of the borders seem to move instead of 1 %. The package keeps
# the rule; its story is [phantoms on real streets](deeper/04_real_streets.ipynb). So one error is traded for another.
#
# ## In five lines
#
# 1. FREE, STATIC and UNKNOWN stay in their cell, one number each; only DYNAMIC leaves it, on particles.
# 2. Predict: let particles fly, and strike out an arrival where something stands. Update: share UNKNOWN out, then Bayes'
#    rule. Resample with one comb.
# 3. A scan keeps the ratio of STATIC to DYNAMIC. Arrivals in cells that were seen FREE make it DYNAMIC; leaving and
#    stopping make it STATIC.
# 4. More particles shrink the sampling error, like $N^{-1/2}$, and leave the bias. The smallest slow thing that you must
#    not miss sets their number.
# 5. A car that drives away into cells that it hides is called STATIC, by first sight together with the package's rule
#    against walls that seem to move. Without the two, fences seem to move.
#
# ## Further reading and exercise
#
# - [Time, factored and sampled beliefs](deeper/time_beliefs.ipynb): importance sampling and Rao-Blackwell.
# - [The filters, measured](deeper/04_filters_measured.ipynb): three filters on twenty simulated drives.
# - Rummelhard, Nègre, Laugier, *Conditional Monte Carlo Dense Occupancy Tracker*, ITSC 2015: the filter.
# - Doucet, de Freitas, Murphy, Russell, *Rao-Blackwellised particle filtering for dynamic Bayesian networks*, UAI 2000.
# - Nuss et al., *A random finite set approach for dynamic occupancy grid maps with real-time application*, IJRR 2018:
#   the same idea, derived from random finite sets.
# - Douc, Cappé, Moulines, *Comparison of resampling schemes for particle filtering*, ISPA 2005.
#
# [Exercise 04](exercises/04_cmcdot.ipynb): move and sum in cells, two arrivals at once, a scan that measures speed,
# another way to resample, and your own filter on a real street. Next: lecture [05](05_pixels.ipynb), from the grid to
# the pixel.

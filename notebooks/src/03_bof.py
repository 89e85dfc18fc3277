# %% [markdown]
# # 03 · BOF: occupancy with velocity
#
# **In one sentence.** Keep, for every cell, the probability of each velocity that it may be occupied with; then scans
# that measure no velocity tell velocities all the same, because only one of them leads from where a thing was to where
# it is.
#
# **You will be able to**
# - predict and update a joint belief in place and velocity, by hand, on a line;
# - say what happens when something arrives in a cell where something stands;
# - read from a cell whether it is free, stands or moves, and how fast;
# - say what a filter forgets that keeps each cell by itself;
# - say why a walker or a bus seems to stand, and test it by switching off the cause.
#
# **Prerequisites.** Lectures [01](01_bayes.ipynb) (Bayes' rule, transition matrix),
# [01b](01b_graphical_models.ipynb) (graphs, deleted edges, elimination) and [02](02_grids.ipynb) (what a beam says,
# ghosts behind moving cars).
#
# **Time.** 69 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.2: the ancestor of its filter, the Bayesian occupancy filter (**BOF**) of Coué and others.
# The paper prints no equation for it.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, interact

from semgrid_edu import fast, grid, occupancy, plotting
from semgrid_edu.datasets import samples
from semgrid_edu.graphical import eliminate
from semgrid_edu.labels import KITTI_14
from worlds import lecture_02_street, lecture_03_bof, lecture_03_row, lecture_03_scenes
from worlds.lecture_02_boxes import Box, cells_in, scan_boxes

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
FREE, STATIC, DYNAMIC, UNKNOWN = occupancy.State
defaults = occupancy.WorldModel()
assert defaults.first_sight == (0.952, 0.045, 0.003)

# %% [markdown]
# ## How can scans that measure no velocity tell velocities?
#
# The map of lecture 02 left ghosts behind moving cars, because a cell knew nothing but its own past. In this lecture a
# cell also asks its neighbours: *is something coming?* For that it needs velocities.
#
# Here is the whole idea. One thing is somewhere on a street. In the upper pictures each row is a velocity and each
# column a place; dark blue is probable, on a scale that is stretched so that small probabilities can be seen. The lower
# pictures sum over the velocities: P(occupied).

# %% jupyter={"source_hidden": true} alt="five panels of velocity against place: a column of nine equally probable velocities at one place; half a second later it is sheared into a slanted line; a return from one place picks three velocities; they are sheared; the next return leaves one, 2 m/s"
story = lecture_03_scenes.sheared()
assert story[-1][1][6].max() > 0.8  # at 2 m/s
assert round(story[-1][1].sum(), 1) == 1.2
lecture_03_scenes.draw_sheared(story)
plt.show()

# %% [markdown]
# At **A** we know the place within three cells and nothing of the velocity: the belief is a column. At **B** nobody has
# looked, but each row has moved at its own speed. The column is **sheared**: place and velocity, independent before,
# are now tied together. At **C** a beam comes back from one place (red mark). It says nothing about velocities. But it
# picks a column of the sheared belief, which holds only three velocities. Everywhere else a beam has passed, and a pass
# speaks for *free*. After **D** and **E** one velocity stands out, 2 m/s. (Add up the bars of E, though: they hold 1.2
# things, and there is one. We come back to that.)
#
# So scans tell velocities because motion ties velocity to place, and a scan tells places.
#
# ## Where did it come from?
#
# Now by hand. Take a row of six cells of one metre, numbered from zero. One thing is in cell 2. It stands, or it goes
# one cell a second to the left or to the right, with a third each. A second passes, and nobody looks. Then a beam comes
# back from cell 3, and beams pass all other cells. As in lecture 02, a return has probability 0.8 from an occupied cell
# and 0.05 from a free one, and a pass 0.3 and 0.7.
#
# **Predict before you run.** How surely are cells 3 and 1 occupied now?
#
# <details><summary>Answer</summary>
#
# Before the scan, cell 2 and its two neighbours are occupied with a third each. In cell 3 *occupied* weighs 0.8 times a
# third and *free* 0.05 times two thirds. So it is occupied with 0.8 / (0.8 + 0.1) = 0.89, and its velocity is to the
# right. For cell 1 it is 0.3 / (0.3 + 1.4) = 0.18.
#
# </details>
#
# There are two steps. **Predict** asks each cell where its content came from. **Update** is Bayes' rule. A thing with
# velocity $v$ that is in cell $k$ now was $v\,\Delta t$ cells behind, in the **antecedent** of cell $k$. (Here a cell
# has one metre and $\Delta t$ is one second.) Write $m_k^t$ for what cell $k$ holds at scan $t$, which is FREE or a
# velocity, and $z$ for the scan:
#
# $$ \begin{aligned} P(m_k^t = v) &= P(m_{k - v\,\Delta t}^{t-1} = v), \\
#    P(m_k^t = v \mid z) &= \frac{P(z \mid \text{occupied})\, P(m_k^t = v)}
#    {P(z \mid \text{occupied}) \sum_{v'} P(m_k^t = v') + P(z \mid \text{free})\, P(m_k^t = \text{FREE})}
#    \end{aligned} $$

# %% tags=["bof-update"]
V = (-1, 0, 1)  # cells a second


def fly(joint):
    """Return P(m = v), (3, 6), a second later: ask each cell's antecedent."""
    flown = np.zeros_like(joint)
    for row, v in enumerate(V):
        for cell in range(6):
            if 0 <= cell - v < 6:
                flown[row, cell] = joint[row, cell - v]
    return flown


def look(joint, if_occupied, if_free):
    """Return P(m = v | z): Bayes' rule, cell by cell."""
    occupied = joint * if_occupied
    free = (1 - joint.sum(axis=0)) * if_free
    return occupied / (occupied.sum(axis=0) + free)


# %% jupyter={"source_hidden": true}
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
assert round(story["cell 3 is hit"].sum(), 2) == 1.24
assert story["cell 4 is hit"][2, 4] > 0.95

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="five tables of probability over six cells and three velocities; the column of cell 2 is sheared over cells 1 to 3, then the return from cell 3 leaves 0.89 at velocity plus one there and 0.18 in cells 1 and 2"
fig, axes = plt.subplots(1, 5, figsize=(12.5, 2.2), layout="constrained", sharey=True)
for ax, (when, joint) in zip(axes, story.items(), strict=True):
    ax.imshow(joint, cmap="Blues", vmin=0, vmax=1, origin="lower")
    for (row, cell), p in np.ndenumerate(joint):
        if p > 0.005:
            ax.text(cell, row, f"{p:.2f}", ha="center", va="center", fontsize=9, color="white" if p > 0.6 else "black")
    ax.set(title=when, xlabel="cell [m]", yticks=range(3), yticklabels=["-1", "0", "+1"])
axes[0].set_ylabel("velocity [m/s]")
plt.show()

# %% [markdown]
# The thing goes to the right, and after two scans that is nearly certain. So a cell asks its antecedents first and its
# beam second.
#
# ## What if something arrives where something stands?
#
# A cell holds a standing thing with probability $s = 0.5$, else it is free. From its neighbour something arrives with
# probability $a = 0.6$. Both can't be true, because two solid things don't share a cell. Which one gives way? Take the
# two as independent, and write down the four pairs:
#
# | | stands here | free |
# |---|---|---|
# | **arrives** | 0.3 ✗ | 0.3 → moves |
# | **doesn't** | 0.2 → stands | 0.2 → free |
#
# One pair is impossible. **Strike it out**, and divide the rest by 0.7, so that it sums to one.
#
# **Predict before you run.** What does the cell hold now? And if a fence is there, $s = 0.99$, and something comes with
# $a = 0.3$?
#
# <details><summary>Answer</summary>
#
# It moves with 3/7, and stands or is free with 2/7 each. The fence stays, with 0.986, by the formula below. If the
# arrival simply won, the fence would be at 0.69.
#
# </details>
#
# $$ P(m_k = v) = \frac{(1 - s)\, a_v}{1 - a s} \ \ (v \ne 0), \qquad
#    P(m_k = 0) = \frac{(1 - a)\, s}{1 - a s}, \qquad a = \sum_{v \ne 0} a_v, $$
#
# where $a_v$ is what the antecedent of velocity $v$ sends. We add the arrivals, as if at most one could come. That is an
# assumption: two cells that know nothing of each other can promise more than one. Then we scale the sum to just below
# one. `predict` replaces `fly`: the first equation of the last section now only tells what the antecedents send.


# %% tags=["bof-predict"] jupyter={"outputs_hidden": true}
def predict(joint):
    """Return P(m = v), (3, 6), a second later: fly, and strike out what can't be true."""
    flown = fly(joint)
    stands, comes = flown[1], flown[[0, 2]]
    comes = comes / np.maximum(comes.sum(axis=0) / 0.999, 1)  # at most one thing arrives
    arrives = comes.sum(axis=0)
    backward, forward = (1 - stands) * comes
    return np.stack([backward, (1 - arrives) * stands, forward]) / (1 - arrives * stands)


two = np.zeros((3, 6))
two[2, 1], two[1, 2] = 0.6, 0.5
print("cell 2: velocity -1, 0, +1:", predict(two)[:, 2].round(3), "= 0, 2/7, 3/7")

# %% jupyter={"source_hidden": true}
line = grid.GridSpec(x_min=0, x_max=6, y_min=0, y_max=1, cell=1)
lattice = occupancy.VelocityLattice(max_speed=1, spacing=1)
on_line = [lattice.velocities.tolist().index([v, 0]) for v in V]  # two more, sideways, stay empty


def as_state(joint):
    """Lay P(m = v) on the line, (3, 6), into the package's grid, whose row 0 is the farthest ahead."""
    held = np.zeros((len(lattice), 6, 1), np.float32)
    held[on_line, :, 0] = joint[:, ::-1]
    free = 1 - held.sum(axis=0)
    return occupancy.BofState(free, np.zeros_like(free), held, lattice.velocities, np.zeros((len(lattice), 2)))


rng, toy = np.random.default_rng(0), occupancy.BofParams(lattice, lecture_03_scenes.STEADY)
crowded = np.zeros((3, 6))
crowded[2, 1], crowded[1, 2], crowded[0, 3] = 0.6, 0.5, 0.6  # more than one arrives in cell 2
assert fly(crowded)[[0, 2], 2].sum() > 1
for belief in (crowded, *(rng.dirichlet(np.ones(4), size=6).T[:3] for _ in range(5))):
    predicted = occupancy.bof_predict(as_state(belief), line, toy, dt=1.0)
    np.testing.assert_allclose(predicted.occupied[on_line, ::-1, 0], predict(belief), atol=1e-6)
    scan = occupancy.Evidence(*(beam[::-1, None].astype(np.float32) for beam in beams(hit=3)))
    seen = occupancy.bof_update(as_state(belief), line, scan, toy)
    np.testing.assert_allclose(seen.occupied[on_line, ::-1, 0], look(belief, *beams(hit=3)), atol=1e-6)

# %% [markdown]
# So neither wins: the pair is struck out, and whoever was surer keeps more. With `look`, this is the filter, as long as
# nothing starts, stops or is forgotten. A hidden cell checks that the package's `bof_predict` and `bof_update` then do
# the same, on random beliefs.
#
# ## How fast, and how surely?
#
# A cell holds a probability of 0.1 at −1 m/s, 0.2 at zero and 0.3 at +1 m/s. What is in it? The zero velocity is called
# **STATIC**, and all others together are **DYNAMIC**. So STATIC has 0.2, DYNAMIC 0.4, and FREE the rest. *Given that
# something moves*, backward has a quarter and forward three quarters: the mean is +0.5 m/s, and the variance is 0.75
# (m/s)², the mean square less the square of the mean. In general, with $D$ for P(DYNAMIC), the mean velocity and its
# covariance are
#
# $$ D = \sum_{v \ne 0} P(m_k = v), \qquad
#    \bar v = \frac{1}{D} \sum_{v \ne 0} v\, P(m_k = v), \qquad
#    \Sigma = \frac{1}{D} \sum_{v \ne 0} (v - \bar v)(v - \bar v)^T P(m_k = v) $$

# %% tags=["bof-marginals"] jupyter={"source_hidden": true}
cells = np.zeros((3, 6))
cells[:, 0] = [0.1, 0.2, 0.3]
cells[:, 1] = [0.0, 0.9, 0.0]
mean, covariance = occupancy.bof_velocity(as_state(cells))
np.testing.assert_allclose(mean[0, ::-1, 0][:2], [0.5, np.nan], atol=1e-6)  # what only stands has no velocity
np.testing.assert_allclose(covariance[0, 0, -1, 0], 0.75, atol=1e-6)

# %% [markdown]
# A cell in which nothing moves has *no* velocity. That isn't velocity zero, which would mean that something stands
# there. So each cell tells how surely it is free, stands or moves. If something may move in it, it also tells how fast.
#
# ## Does it still smear?
#
# On a street velocities have two components. They form a **lattice**, a disc of points: up to 8 m/s, 2 m/s apart, there
# are 49. Four more things happen on a street:
#
# - **First sight.** A cell that no beam has reached is UNKNOWN. At its first beam it is FREE, STATIC or DYNAMIC, and
#   before the beam speaks, STATIC is fifteen times as probable as DYNAMIC. Remember this number.
# - **Less than a cell.** All mass of one velocity moves together, by whole cells. Cells are half a metre wide here, so in
#   a tenth of a second 2 m/s is 0.4 of a cell. BOF adds this up: in five scans it moves this mass by two cells.
# - **Change.** By lecture 01's transition matrix things start, stop, appear, vanish and are forgotten (they become
#   UNKNOWN).
# - **Mixing.** A little mass goes from each velocity to its neighbours
#   ([the lattice of velocities](deeper/03_lattice.ipynb)).
#
# Two boxes move before a wall: one comes towards us, one crosses to the left. In lecture 02's map both leave a smear.
# `walls=None` switches off what the package adds to BOF for real streets
# ([phantoms on real streets](deeper/04_real_streets.ipynb)).

# %%
spec = grid.GridSpec(x_min=0, x_max=30, y_min=-12, y_max=12, cell=0.5)
paper = occupancy.WorldModel(walls=None)
params = occupancy.BofParams(occupancy.VelocityLattice(max_speed=8, spacing=2), paper)
binary = occupancy.LogOddsGrid(spec, occupancy.LogOddsParams(sensor=fast.SensorModel()))
belief = occupancy.BofState.nothing_known(spec, params.lattice)


def world(t):
    """Return the boxes after t seconds: a wall, one box that comes, one that crosses."""
    return [Box(4, 28, 9, 9.5, 2.5), Box.around(25 - 6 * t, 3, 2, 2, 1.5), Box.around(10, -8 + 4 * t, 1, 2, 1.5)]


rng, scans, maps, beliefs = np.random.default_rng(0), [], [], []
for t in range(21):
    points = scan_boxes(world(t / 10), rings=32, noise=0.02, rng=rng)
    scans.append(fast.scan_evidence(points, spec, paper.sensor))
    belief = occupancy.bof_predict(belief, spec, params, dt=0.1)
    belief = occupancy.bof_update(belief, spec, scans[-1], params)
    maps.append(binary.step(points, occupancy.PlanarMotion(), dt=0.1).copy())
    beliefs.append(belief)


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
def occupied_by(world_model):
    """Return P(occupied) after each scan, as BOF tells it under other assumptions."""
    states = lecture_03_scenes.watch(scans, spec, occupancy.BofParams(params.lattice, world_model))
    return [state.occupied.sum(axis=0) for state in states]


told = {
    "last scan alone": [scan.occupied / (scan.occupied + scan.free) for scan in scans],
    "lecture 02's map": maps,
    "BOF": [state.occupied.sum(axis=0) for state in beliefs],
    "BOF, if nothing can move": occupied_by(lecture_03_scenes.NOTHING_MOVES),
}
smear_and_found = lecture_03_scenes.smear_and_found
areas = {
    name: np.mean([smear_and_found(p[t], spec, world, t) for t in range(11, 21)], axis=0) for name, p in told.items()
}
print("mean of the last ten scans")
for name, (smear, found, there) in areas.items():
    print(f"{name:<28} smear {smear:4.1f} m², found {found:3.1f} m² of {there:3.1f}")
assert areas["BOF"][0] < 0.25 * areas["lecture 02's map"][0]
assert areas["BOF, if nothing can move"][0] > 0.7 * areas["lecture 02's map"][0]

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
coming = beliefs[-1].occupied[:, cells_in(world(2)[1], spec)]
coming = coming[:, coming.sum(axis=0) > 0.5]
at_6 = coming[params.lattice.velocities.tolist().index([-6, 0])] / coming.sum(axis=0)
print(
    f"{at_6.size} cells found of the box that comes, {(at_6 > 0.8).sum()} of them with P(its velocity | occupied) > 0.8"
)
assert (at_6 > 0.8).mean() > 0.6
wall = cells_in(world(0)[0], spec, margin=0.3)
assert max(state.probability[DYNAMIC, wall].max() for state in beliefs) < 0.5

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="four maps from above. Lecture 02's map after 2 s: both boxes drag dark tails. BOF at once: both boxes are dark. BOF after 0.5 s and after 2 s: they have the colours of their headings, yellow towards us and green to the left, are white inside and leave a short tail; the wall stays dark; red outlines show where the boxes are"
fig, axes = plt.subplots(1, 4, figsize=(12, 3.8), layout="compressed", sharey=True)
plotting.occupancy(spec, plotting.binary_states(maps[20]), ax=axes[0], legend=False)
axes[0].set_title("lecture 02's map, 2 s", fontsize=10)
for ax, t in zip(axes[1:], (0, 5, 20), strict=True):
    state = beliefs[t]
    plotting.velocity_wheel(spec, state.probability, occupancy.bof_velocity(state)[0], ax=ax, legend=t == 20)
    ax.set_title(f"BOF, {t / 10} s", fontsize=10)
    ax.set_ylabel("")
for ax, t in zip(axes, (20, 0, 5, 20), strict=True):
    ax.text(9, 14, "wall", rotation=90, color="white", ha="center", va="center", fontsize=9)
    lecture_03_scenes.outline(ax, world(t / 10)[1:])
plt.show()

# %% [markdown]
# The red outlines are the two boxes. What stays dark where they have been is smear. At the first scan BOF takes the
# boxes for STATIC, because first sight does. Then they take the colour of their heading, and the wall stays dark. (Pale
# grey is ground that no beam has confirmed for a while.) In most cells that BOF finds of the oncoming box, the true
# velocity is nearly sure.
#
# Most of the smear is gone, because mass that moves takes itself away. **Switch this cause off**: if nothing can move,
# most of the smear stays.
#
# But count a second error: what is missed. BOF finds less than half of the boxes, and lecture 02's map nearly all. Beams
# don't reach the inside of a box. Lecture 02's map calls it occupied because the front once was there: it is right by
# accident, for this is smear. In BOF the front moves on and leaves FREE behind (white). The last scan alone, the trivial
# rule, makes no smear and finds a third.
#
# ## What is a velocity worth on a real street?
#
# Back to the street of lecture 02, with its three lanes of ghosts. `Bof` is the two functions, and a map that scrolls
# with the vehicle.

# %%
compact, sensor = grid.GridSpec.compact(), fast.SensorModel()
drive = samples.real_drive()
street = [drive[t] for t in range(len(drive))]


def drive_through(world_model, max_speed=16):
    """Return what BOF believes at the end of the street."""
    lattice = occupancy.VelocityLattice(max_speed=max_speed, spacing=2)
    bof, before = occupancy.Bof(compact, occupancy.BofParams(lattice, world_model)), street[0]
    for frame in street:
        motion = occupancy.PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
        belief = bof.step(frame.points_grid, motion, frame.time - before.time)
        before = frame
    return belief


on_street = {"BOF": drive_through(paper)}

# %% jupyter={"source_hidden": true}
scenes = lecture_03_scenes
on_street["BOF, no change"] = drive_through(scenes.unchanging(paper))
on_street["BOF, nothing can move"] = drive_through(scenes.NOTHING_MOVES, max_speed=2)
on_street["BOF, neither"] = drive_through(scenes.unchanging(scenes.NOTHING_MOVES), max_speed=2)

# %% jupyter={"source_hidden": true}
truth, y = street[-1].labels.birdseye_on(compact), compact.centers()[..., 1]
road, thing = truth == lecture_02_street.ROAD, lecture_02_street.things(truth)
log_odds = lecture_02_street.add_up(street, compact, sensor)[-1]
told = {
    "last scan alone": lecture_02_street.alone(street[-1:], compact, sensor)[0],
    "lecture 02's map": log_odds,
    **{name: belief.probability[[STATIC, DYNAMIC]].sum(axis=0) for name, belief in on_street.items()},
}
ghosts, found = {}, {}
print(f"ghosts [m²]              all lanes    A    B    found of {thing.sum() * compact.cell**2:.0f} m²")
for name, occupied in told.items():
    lanes = [road & (y >= low) & (y < high) for low, high in ((-99, 99), (5.5, 13), (2, 5.5))]
    ghosts[name] = [occupancy.smear_area(occupied, lane, compact) for lane in lanes]
    found[name] = (thing & (occupied > 0.5)).sum() * compact.cell**2
    print("{:<25}     {:5.0f}{:5.0f}{:5.0f}".format(name, *ghosts[name]) + f"    {found[name]:5.0f}")
cars = truth == KITTI_14.index("car")
moves = on_street["BOF"].probability[DYNAMIC, cars & (y > 2) & (y < 5.5) & (told["BOF"] > 0.5)] > 0.5
print(f"of what BOF finds of the cars in lane B, {moves.mean():.0%} is DYNAMIC")
assert moves.mean() > 0.5
assert found["last scan alone"] < 0.5 * thing.sum() * compact.cell**2 < found["BOF"]
assert ghosts["BOF"][0] < 25 < ghosts["BOF, no change"][0] < 35 < 45 < ghosts["BOF, nothing can move"][0] < 52
assert abs(ghosts["BOF, neither"][0] - ghosts["lecture 02's map"][0]) < 2


# %% jupyter={"source_hidden": true} alt="two maps of a real street from above, with cars outlined in violet. On the left lecture 02's map with red ghosts in lanes A and B. On the right BOF: the oncoming cars of lane A are yellow; those of lane B are blue where they are found"
fig, axes = plt.subplots(1, 2, figsize=(7.6, 6.0), layout="compressed", sharey=True)
ghost = road & (log_odds > 0.5)
lecture_02_street.draw(compact, log_odds, axes[0], "lecture 02: ghosts in red", ghost)
end = on_street["BOF"]
plotting.velocity_wheel(compact, end.probability, end.velocity, ax=axes[1])
axes[1].set_title("BOF", fontsize=10)
axes[1].set_ylabel("")
for ax in axes:
    ax.contour(y, compact.centers()[..., 0], cars, levels=[0.5], colors="#c000c0", linewidths=1)
    ax.set(xlim=(14, -6), ylim=(0, 62))
    lecture_02_street.note(ax, {"A": ((10.5, 12.0), (12.8, 26.0)), "B": ((2.6, 33.0), (0.6, 25.5))})
plt.show()

# %% [markdown]
# Data: PandaSet by Hesai and Scale AI, CC BY 4.0. Violet outlines are the true cars. Those of lane A come towards us and
# turn yellow. In lane B they drive away, and most of what BOF finds of them is DYNAMIC (blue). BOF leaves less than a
# third of the ghosts. It finds a little less than lecture 02's map, and neither finds two thirds of what is there. The
# last scan alone has no ghosts and finds less than half.
#
# **Switch off each cause.** If nothing can move, more than twice as many ghosts stay. Without change (nothing is
# forgotten either) a few more stay than in BOF. With neither, BOF has as many ghosts as lecture 02's map.
#
# So velocities remove most of the ghosts, and change removes some by itself.
#
# ## Can one thing be in two places?
#
# One thing is in the first cell of a row. (The graph numbers cells from one.) It stands, or it drives one cell to the
# right, with one half each. Then a beam passes the first cell, and another one comes back from the second.

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a graph: what was in cell 1 before points to what cells 1 and 2 hold now, to cell 2 by a dashed arrow marked 1 to 1.24; each cell points to its shaded beam"
graph = lecture_03_bof.stands_or_drives()
graph.draw(plt.subplots(figsize=(5, 3.4), layout="constrained")[1])
plt.show()

# %% [markdown]
# (Shaded: what the beams tell. Beside the dashed arrow: how many things are believed in with it and without.) Both
# cells ask the *same* past. If the thing drove, the second cell is occupied **and** the first one is free. BOF gives
# each cell its own copy of the past, so that a step is just a shift of maps and a formula for each cell. It deletes the
# dashed arrow: the second cell still gets a half, but the two cells don't know of each other any more.
#
# **Predict before you run.** How surely is the first cell free, after both beams, if you compare the two stories as
# wholes? And cell by cell?
#
# <details><summary>Answer</summary>
#
# As wholes: it drove, 0.7 · 0.8 = 0.56, or it stands, 0.3 · 0.05 = 0.015. So it drove, and the first cell is free, with
# 0.97. Cell by cell, it hears only its own beam and is free with 0.70.
#
# </details>

# %% jupyter={"outputs_hidden": true}
given = {"z1,1": 0, "z2,1": 1}  # a pass, a return
exact = [eliminate(graph.model, cell, given).normalised().table[1] for cell in ("m1,1", "m2,1")]
alone = [0.5 * 0.3 / (0.5 * 0.3 + 0.5 * 0.7), 0.5 * 0.8 / (0.5 * 0.8 + 0.5 * 0.05)]
for name, p in (("both together", exact), ("cell by cell", alone)):
    print(f"{name:<14} P(occupied) of cell 1 {p[0]:.2f}, of cell 2 {p[1]:.2f}: {sum(p):.2f} things")
package = lecture_03_bof.bof_beliefs(lecture_03_bof.STANDING_OR_DRIVING)[0]
np.testing.assert_allclose(1 - package[:2, lecture_03_row.Cell.FREE], alone, atol=1e-9)

# %% [markdown]
# That is the price of this lecture: **there is one thing, and BOF believes in 1.24.** That the thing has been found in
# one cell says nothing to the other. A filter that replaces its joint belief by each cell's own distribution, as if the
# cells were independent, does **assumed-density filtering**. BOF does so after every predict, before it looks at the
# scan. That makes BOF possible, since the joint belief over a map of thousands of cells would fit into no computer. So
# yes: for BOF one thing can be in two places.
#
# ## Why does a walker stand?
#
# A person comes towards us at 1.4 m/s, as people walk. The lattice has 0 and 2 m/s, but nothing between.
#
# **Predict before you run.** Will the person be STATIC or DYNAMIC after four seconds? And somebody who hurries at 2 m/s?
#
# <details><summary>Answer</summary>
#
# The walker is STATIC. The one who hurries is DYNAMIC, because the lattice has this velocity.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="four bars of P(DYNAMIC) of a person, each with five dots. 1.4 m/s on a lattice 2 m/s apart: about 0.2. 1.4 m/s on a lattice that has it, and 2 m/s on the first lattice: about 0.9. 1 m/s on a lattice that has it: about 0.2"
walks = {
    "1.4 m/s,\nlattice 0, 2": (1.4, 2),
    "1.4 m/s,\nlattice 0, 1.4": (1.4, 1.4),
    "2 m/s,\nlattice 0, 2": (2.0, 2),
    "1 m/s,\nlattice 0, 1, 2": (1.0, 1),
}
fig, ax = plt.subplots(figsize=(7.0, 3.2), layout="constrained")
walked = {}
for place, (name, (speed, spacing)) in enumerate(walks.items()):
    starts = (15.0, 15.1, 15.2, 15.3, 15.4)
    last = [lecture_03_scenes.walker(speed, spacing, start=start)[-10:].mean() for start in starts]
    walked[name] = np.mean(last)
    ax.bar(place, walked[name], width=0.6, color="0.6")
    ax.plot(np.full(5, place), last, "o", color="black", markersize=4, markerfacecolor="white")
    ax.text(place + 0.33, walked[name], f"{walked[name]:.1f}", fontsize=10, va="center")
ax.set(ylabel="P(DYNAMIC), last second", ylim=(0, 1.05), xticks=range(4), xticklabels=walks)
ax.set_title("a person comes: mean of five starting points (dots)", fontsize=10)
plt.show()
gap, filled, hurries, strolls = walked.values()
assert max(gap, strolls) < 0.3 < 0.8 < min(filled, hurries)

# %% [markdown]
# The suspect is the gap in the lattice. **Switch it off**: give the lattice 1.4 m/s, or let the person hurry at 2 m/s,
# which the first lattice has. Both are DYNAMIC. So the walker seems to stand because the lattice lacks 1.4 m/s.
#
# But to have the velocity isn't always enough. The last bar is a person who strolls at 1 m/s, on a lattice with 1 m/s,
# and seems to stand. That has another cause, which we don't look for here.
#
# Why not always take a fine lattice? Because each velocity is a whole map, and their number grows with the
# *area* of the disc: half the spacing takes four times the memory, and nearly all of it would hold nothing. Lecture 04
# puts the memory where the mass is: into particles.
#
# ## Where this breaks: a bus that was there before
#
# A long bus comes and passes us at 8 m/s, which the lattice has exactly. Its flank is 2.25 m to our left, and our
# scanner has 1000 columns in its half circle, as KITTI's. Two filters get the same scans. The first has watched from
# the start. The second is switched on after 1.6 s, when the front of the bus is 11 m ahead of us.
#
# **Predict before you run.** Does the bus move for the second filter, one second later?
#
# <details><summary>Answer</summary>
#
# Most of it seems to stand, as panel B shows.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three maps along the flank of the bus, time to the right and place ahead upwards. A, watched from the start: orange, DYNAMIC, everywhere between front and rear. B, switched on at 1.6 s: dark, STATIC, where the bus was at that instant and some metres before it, orange only behind its front. C, as B with first sight reversed: orange"
reversed_odds = occupancy.WorldModel(first_sight=(0.952, 0.003, 0.045), walls=None)
passed = {
    "A   watched from the start": lecture_03_scenes.pass_by(0),
    "B   switched on at 1.6 s": lecture_03_scenes.pass_by(1.6),
    "C   as B, first sight reversed": lecture_03_scenes.pass_by(1.6, reversed_odds),
}
lecture_03_scenes.draw_flanks(passed)
plt.show()
x = lecture_03_scenes.BUS.centers()[::-1, 0, 0]
(_, watched), (times, switched_on), (_, reversed_sight) = passed.values()
for scan in range(4, len(times)):
    was_there = (x > 11.25) & (x < min(18, 36 - 8 * times[scan] - 0.25))  # covered at 1.6 s, and still
    assert watched[DYNAMIC, scan - len(times), was_there].min() > 0.5
    assert switched_on[STATIC, scan, was_there].min() > 0.95
    assert reversed_sight[DYNAMIC, scan, was_there].min() > 0.5

# %% [markdown]
# Each panel follows the cells along the flank. Time goes to the right, and up is ahead of us. The bus comes down between
# the violet lines. In A its flank is orange: DYNAMIC. In B each cell that the bus covered when the filter was switched on
# is dark: STATIC, as long as the bus covers it. **A is B with the cause switched off**: the scans, the cells and the
# assumptions are the same, but the filter of A saw the road empty before the bus came.
#
# Why does that matter? A cell that was empty and is full now has been entered. But in the middle of the bus a cell is
# full at each scan, and so is the cell that something would have come from. Standing and driving explain these scans
# equally well. This is the **aperture problem**: through a small window, here one cell, motion along an edge can't be
# seen. Then the filter's assumptions decide. They are for STATIC: it leads fifteen to one at first sight, and DYNAMIC has
# to share its part among 48 velocities. Reverse first sight, one to fifteen, and the same scans make the bus move (C).
# Even odds don't suffice: then the bus still seems to stand.
#
# (In B the dark even spreads by a few metres, to cells that the front enters later. In A and C, with nothing dark behind
# them, these cells stay DYNAMIC.)
#
# ## Could any filter see that the bus moves?
#
# Give the filter no such lead. A small bus fills the first three cells of a row. Each of them stands or drives one cell
# to the right at each scan, with *even* odds, and there is no other velocity. Two scans follow (`x` is a return, `.` a
# pass, `?` nothing seen). After both, the third cell is full in any case: it holds the front of a bus that stands, or the
# rear of one that drives. Which? Ask all cells together, with BOF's own assumptions, and ask BOF. Then hide the cells at
# the front, those at the rear, and both.

# %%
cells = ({"static": 0.5, "right": 0.5},) * 3 + ({},) * 3  # three of the bus, three free
scans_of = {
    "both ends seen": (".xxx..", "..xxx."),
    "front hidden": (".xx?..", "..x??."),
    "rear hidden": ("?xxx..", "??xxx."),
    "both hidden": ("?xx?..", "??x??."),
}
for name, seen in scans_of.items():
    bus = lecture_03_row.CellsInARow(cells, seen, clearing_time=0)  # 0: without the package's rules
    model, given = lecture_03_row.row_model(bus, 2), lecture_03_row.row_evidence(bus, 2)
    exact = eliminate(model, "m3,2", given).normalised().table[lecture_03_row.Cell.RIGHT]
    alone = lecture_03_bof.bof_beliefs(bus)[-1, 2, lecture_03_row.Cell.RIGHT]
    print(f"{name:<14}  P(cell 3 moves): all cells together {exact:.2f}, BOF {alone:.2f}")
    assert (exact > 0.9) == (name != "both hidden")
    assert 0.45 < alone < 0.5

# %% [markdown]
# So the scans do tell it, at the ends of the bus. In front free cells fill. Behind, full ones empty. One end is enough,
# but hide both, and nobody can tell.
#
# From the ends the news goes to the third cell through the joint belief: if the front has left its cell and the cell is
# full again, the next one has moved up, and so on. BOF's cells don't know of each other. So its third cell gets no news,
# and ends where it began, near one half.
#
# So a bus that was there before the filter seems to stand, because each cell by itself can't see it move.


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the flank of the bus over time, for one time at which the filter is switched on"
def show(switched_on):
    """Show the flank of the bus for the dial's setting."""
    _, ax = plt.subplots(figsize=(4.8, 3.4), layout="constrained")
    lecture_03_scenes.draw_flank(ax, *lecture_03_scenes.pass_by(switched_on), f"switched on at {switched_on:.1f} s")
    ax.set_ylabel("x, forward [m]")
    plt.show()


_ = interact(
    show,
    switched_on=FloatSlider(value=0.8, min=0, max=2, step=0.4, description="on at [s]", continuous_update=False),
)

# %% [markdown]
# (The dial works with a running kernel. The later you switch on, the nearer to us the dark begins. Why?)
#
# ## In five lines
#
# 1. What is in a cell now was in its antecedent before: each velocity of a lattice shifts its own map.
# 2. A scan measures no velocity. It picks places, and places pick velocities.
# 3. Where something arrives and something stands, strike the pair out, and neither wins.
# 4. BOF keeps each cell by itself. So one thing may be believed in two places: 1.24 things instead of one.
# 5. A cause is found by switching it off. A walker at 1.4 m/s seems to stand because the lattice has a gap there; a bus,
#    because it was there before the filter: in its middle each cell by itself sees no motion.
#
# ## Further reading and exercise
#
# - Coué, Pradalier, Laugier, Fraichard, Bessière, *Bayesian occupancy filtering for multitarget tracking: an automotive
#   application*, International Journal of Robotics Research, 2006: the filter.
# - Boyen, Koller, *Tractable inference for complex stochastic processes*, UAI 1998: assumed densities.
# - Nègre, Rummelhard, Laugier, *Hybrid sampling Bayesian occupancy filter*, IEEE Intelligent Vehicles Symposium 2014:
#   what stands in the grid, what moves in particles.
# - The companion [time beliefs](deeper/time_beliefs.ipynb): what BOF is among filters.
#
# [Exercise 03](exercises/03_bof.ipynb): one velocity's flight, a scanner that measures velocities, one thing followed
# exactly, and your own filter on both streets. Next: lecture [04](04_cmcdot.ipynb), particles.

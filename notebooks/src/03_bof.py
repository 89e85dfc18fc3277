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
# - find the causes, by switching them off, why a walker and half a bus seem to stand.
#
# **Prerequisites.** Lectures [01](01_bayes.ipynb) (Bayes' rule, transition matrix),
# [01b](01b_graphical_models.ipynb) (graphs, deleted edges, elimination) and [02](02_grids.ipynb) (what a beam says,
# ghosts behind moving cars).
#
# **Time.** 77 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.2: the ancestor of its filter, the Bayesian occupancy filter (**BOF**) of Coué and others.
# The paper prints no equation for it.

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, IntSlider, interact

from semgrid_edu import fast, grid, occupancy, plotting
from semgrid_edu.datasets import samples
from semgrid_edu.graphical import eliminate
from semgrid_edu.labels import KITTI_14
from semgrid_edu.plotting.moving import wheel_colours
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
# column a place; dark blue is probable. The lower pictures sum over the velocities: P(occupied).

# %% jupyter={"source_hidden": true} alt="five panels of velocity against place: a column of nine equally probable velocities at one place; half a second later it is sheared into a slanted line; a return from one place picks three velocities; they are sheared; the next return leaves one, 2 m/s"
story = lecture_03_scenes.sheared()
assert story[-1][1][6].max() > 0.8  # at 2 m/s
lecture_03_scenes.draw_sheared(story)
plt.show()

# %% [markdown]
# At **A** we know the place within three cells and nothing of the velocity: the belief is a column. At **B** nobody has
# looked, but each row has moved at its own speed. The column is **sheared**: place and velocity, independent before,
# are now tied together. At **C** a beam comes back from one place (red mark). It says nothing about velocities. But it
# picks a column of the sheared belief, which holds only three velocities. Everywhere else a beam has passed, so that
# all else weighs less. After **D** and **E** one velocity stands out, 2 m/s.
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
# The thing goes to the right, and after two scans that is nearly certain. (Add up the third table, though: it holds
# more than one thing. We come back to that.) So a cell asks its antecedents first and its beam second.
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
# are 49. Three more things happen on a street:
#
# - **First sight.** A cell that no beam has reached is UNKNOWN. At its first beam it is FREE, STATIC or DYNAMIC, and
#   before the beam speaks, STATIC is fifteen times as probable as DYNAMIC. Remember this number.
# - **Less than a cell.** All mass of one velocity moves together. In a tenth of a second 1 m/s is a fifth of a cell. So
#   BOF adds up these fifths, and at every fifth scan it moves this mass by one cell.
# - **Change.** By lecture 01's transition matrix things start, stop, vanish and are forgotten (they become UNKNOWN). And
#   a little mass goes from each velocity to its neighbours ([the lattice of velocities](deeper/03_lattice.ipynb)).
#
# Two boxes move before a wall: one comes towards us, one crosses to the left. In lecture 02's map both leave a smear.
# `walls=None` switches off what the package adds to BOF.

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
    "BOF and the package's rules": occupied_by(occupancy.WorldModel()),
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
(row,), (col,), _ = spec.cells(np.array([[12.2, 3.2]]))  # the front of the box that comes
front = beliefs[-1].occupied[:, row, col]
at_6 = front[params.lattice.velocities.tolist().index([-6, 0])] / front.sum()
wall = cells_in(world(0)[0], spec, margin=0.3)
print(f"front of the box that comes: P(6 m/s towards us | occupied) = {at_6:.2f}")
assert areas["BOF and the package's rules"][0] < 0.2 * areas["BOF"][0]
assert at_6 > 0.9
assert max(state.probability[DYNAMIC, wall].max() for state in beliefs) < 0.5

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="animation from above, two maps: in the map of lecture 02 on the left both boxes drag dark tails; in BOF on the right they take the colours of their headings, yellow towards us and green to the left, are white inside and leave a short tail; the wall stays dark; red outlines show where the boxes are"
fig, axes = plt.subplots(1, 2, figsize=(8.2, 4.2), layout="compressed")
plotting.occupancy(spec, plotting.binary_states(maps[0]), ax=axes[0], legend=False)
plotting.velocity_wheel(spec, beliefs[0].probability, occupancy.bof_velocity(beliefs[0])[0], ax=axes[1])
axes[1].set_ylabel("")
for ax in axes:
    ax.text(9, 14, "wall", rotation=90, color="white", ha="center", va="center", fontsize=9)
outlines = [lecture_03_scenes.outline(ax, world(0)[1:]) for ax in axes]


def crossing():
    """Draw both grids, scan by scan."""
    for t in range(0, 21, 5):
        state = beliefs[t]
        axes[0].images[-1].set_data(plotting.occupancy_colours(plotting.binary_states(maps[t])))
        axes[1].images[-1].set_data(wheel_colours(spec, state.probability, occupancy.bof_velocity(state)[0]))
        for outline in outlines:
            lecture_03_scenes.move_outline(outline, world(t / 10)[1:])
        axes[0].set_title(f"lecture 02's map, {t / 10:.1f} s")
        axes[1].set_title(f"BOF, {t / 10:.1f} s")
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(crossing(), 0.6, alt="two boxes cross; lecture 02's map smears them, BOF colours them by heading")

# %% [markdown]
# The red outlines are the two boxes. What stays dark where they have been is smear. In BOF the boxes are dark at first,
# because the first scans tell little. Then they take the colour of their heading, and the wall stays dark. (Pale grey is
# ground that no beam has confirmed for a while.) The front of the oncoming box has its true speed, nearly for sure.
#
# Most of the smear is gone, because mass that moves takes itself away. **Switch this cause off**: if nothing can move,
# most of the smear stays. The package takes away most of the rest. It adds a rule: what a moving thing held half a
# second ago is free now, even if no beam sees it.
#
# But count a second error: what is missed. BOF finds less than half of the boxes, and lecture 02's map nearly all. No
# beam reaches the inside of a box. Lecture 02's map has it from its smear, because the front was there before, and so has
# BOF if nothing can move. In BOF the front moves on and leaves FREE behind (white). The last scan alone, the trivial
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
on_street["BOF, nothing changes"] = drive_through(scenes.unchanging(paper))
on_street["BOF, nothing can move"] = drive_through(scenes.NOTHING_MOVES, max_speed=2)
on_street["BOF, neither"] = drive_through(scenes.unchanging(scenes.NOTHING_MOVES), max_speed=2)
on_street["BOF, package's rules"] = drive_through(occupancy.WorldModel())

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
print(f"ghosts [m²]              all lanes    A    B    C    found of {thing.sum() * compact.cell**2:.0f} m²")
for name, occupied in told.items():
    lanes = [road & (y >= low) & (y < high) for low, high in ((-99, 99), (5.5, 13), (2, 5.5), (-2, 2))]
    ghosts[name] = [occupancy.smear_area(occupied, lane, compact) for lane in lanes]
    found[name] = (thing & (occupied > 0.5)).sum() * compact.cell**2
    print("{:<25}     {:5.0f}{:5.0f}{:5.0f}{:5.0f}".format(name, *ghosts[name]) + f"    {found[name]:5.0f}")
for name in ("BOF", "BOF, package's rules"):
    cars = (truth == KITTI_14.index("car")) & (y > 2) & (y < 5.5) & (told[name] > 0.5)
    moves = (on_street[name].probability[DYNAMIC, cars] > 0.5).mean()
    print(f"{name}: {moves:.0%} of the cells of cars in lane B are DYNAMIC")
    assert moves > 0.5 if name == "BOF" else moves < 0.25
assert found["last scan alone"] < 0.5 * thing.sum() * compact.cell**2 < found["BOF"]
assert ghosts["BOF"][0] < 25 < ghosts["BOF, nothing changes"][0] < 35 < 45 < ghosts["BOF, nothing can move"][0] < 52
assert abs(ghosts["BOF, neither"][0] - ghosts["lecture 02's map"][0]) < 2


# %% jupyter={"source_hidden": true} alt="two maps of a real street from above. On the left lecture 02's map with red ghosts in lanes A and B. On the right BOF: in lane A on the left the oncoming cars are yellow; in lane B beside us the cars are blue; the car C ahead of us is partly dark; the wall W stays dark"
fig, axes = plt.subplots(1, 2, figsize=(7.6, 6.0), layout="compressed", sharey=True)
ghost = road & (log_odds > 0.5)
lecture_02_street.draw(compact, log_odds, axes[0], "lecture 02's map, ghosts in red", ghost)
end = on_street["BOF"]
plotting.velocity_wheel(compact, end.probability, end.velocity, ax=axes[1])
axes[1].set_title("BOF", fontsize=10)
axes[1].set_ylabel("")
for ax in axes:
    lecture_02_street.note(ax, {"A": ((8.5, 18.0), (13.5, 22.0)), "B": ((4.0, 26.0), (-0.5, 23.0)),
                                "C": ((0.3, 13.0), (4.5, 8.0)), "W": ((-7.8, 12.0), (-12.0, 14.5))})  # fmt: skip
plt.show()

# %% [markdown]
# Data: PandaSet by Hesai and Scale AI, CC BY 4.0. The cars of lane A come towards us and turn yellow. In lane B they
# drive away, and most of what BOF finds of them is DYNAMIC (blue). BOF leaves less than a third of the ghosts. It finds
# a little less than lecture 02's map, and neither finds two thirds of what is there. The last scan alone has no ghosts
# and finds less than half.
#
# **Switch off each cause.** If nothing can move, more than twice as many ghosts stay. If nothing changes (no transition
# matrix, so nothing is forgotten), a few more stay than in BOF. With neither, BOF has as many ghosts as lecture 02's map.
#
# The last row isn't in the paper. The package adds rules against walls that seem to move as we drive past
# ([phantoms on real streets](deeper/04_real_streets.ipynb)). Here they cost us lane B, where most cells of the cars seem
# to stand again.
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
# one cell says nothing to the other. A filter that keeps only each cell's own distribution after every step, as if the
# cells were independent, does **assumed-density filtering**. That makes BOF possible, since the joint belief over a map
# of thousands of cells would fit into no computer. So yes: for BOF one thing can be in two places. (On the line by hand
# it was in three. That its sum is 1.24, too, is chance.)
#
# ## Why does a walker stand?
#
# A person comes towards us at 1.4 m/s, as people walk. The lattice has 0 and 2 m/s, but nothing between.
#
# **Predict before you run.** Will the person be STATIC or DYNAMIC after four seconds? And if velocities are 1 m/s apart,
# so that the lattice has 1 and 2 m/s?
#
# <details><summary>Answer</summary>
#
# STATIC on the first lattice, DYNAMIC on the finer one, although it lacks 1.4 m/s as well.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="five bars of P(DYNAMIC) of a walker at 1.4 m/s, each with five dots. Velocities 2 m/s apart: low, and near one if nothing moving changes. Velocities 1 m/s apart: about 0.7, about 0.5 without mixing, about 0.85 if nothing moving changes"
no_mixing = occupancy.WorldModel(walls=None, max_acceleration=0)
walks = {
    "2 m/s apart": (2, paper),
    "2 m/s apart,\nchange off": (2, lecture_03_scenes.KEEPS_MOVING),
    "1 m/s apart": (1, paper),
    "1 m/s apart,\nmixing off": (1, no_mixing),
    "1 m/s apart,\nchange off": (1, lecture_03_scenes.KEEPS_MOVING),
}
fig, ax = plt.subplots(figsize=(8.6, 3.2), layout="constrained")
walked = {}
for place, (name, (spacing, world_model)) in enumerate(walks.items()):
    starts = (15.0, 15.1, 15.2, 15.3, 15.4)
    last = [lecture_03_scenes.walker(1.4, spacing, world_model, start)[-10:].mean() for start in starts]
    walked[name] = np.mean(last)
    ax.bar(place, walked[name], width=0.6, color="0.35" if spacing == 2 else "#e39a6a")
    ax.plot(np.full(5, place), last, "o", color="black", markersize=4, markerfacecolor="white")
    ax.text(place + 0.33, walked[name], f"{walked[name]:.1f}", fontsize=10, va="center")
ax.set(ylabel="P(DYNAMIC), last second", ylim=(0, 1.05), xticks=range(5), xticklabels=walks)
ax.set_title("walker at 1.4 m/s: mean of five starting points (dots)", fontsize=10)
plt.show()
assert walked["2 m/s apart"] < 0.3 < 0.65 < walked["1 m/s apart"] < 0.8
assert walked["1 m/s apart,\nmixing off"] < 0.6
assert min(walked["2 m/s apart,\nchange off"], walked["1 m/s apart,\nchange off"]) > 0.8

# %% [markdown]
# The finer lattice finds the person, but why? It has no 1.4 m/s. Mass goes to and fro between the velocities 1 and
# 2 m/s, so that on average it keeps up. **Switch this mixing off**, and the finer lattice is undecided.
#
# The other cause is **change**. A scan speaks for motion only when the person steps into another cell, every third or
# fourth scan. Meanwhile the transition matrix takes some DYNAMIC mass at each scan. **Switch it off** for what moves: now
# even the coarse lattice finds the person.
#
# So the person seems to stand only because both come together: the gap in the lattice, and change between two steps.
#
# Then why not always take a fine lattice? Because each velocity is a whole map, and their number grows with the
# *area* of the disc: half the spacing takes four times the memory, and nearly all of it would hold nothing. Lecture 04
# puts the memory where the mass is: into particles.
#
# ## Where this breaks: the flank of a bus
#
# A long bus comes and passes us at 8 m/s, which the lattice has exactly. Its flank is 2.25 m to our left, and our
# scanner has 300 columns in its half circle. In panel A each column is a cell along the flank and each row one instant,
# later ones higher. What the front of the bus reaches turns orange: DYNAMIC. But behind it, far from us, there are dark
# stripes, where the bus seems to stand. White between them is worse: there BOF calls the bus FREE. Why?

# %% jupyter={"source_hidden": true} alt="two maps of place against time along the flank of a bus. A, 300 columns: orange up to 11 m, behind that dark stripes between free ones. B, 1000 columns: orange everywhere"
even = occupancy.WorldModel(first_sight=(0.952, 0.024, 0.024), walls=None)
keeps = lecture_03_scenes.KEEPS_MOVING
runs = {
    "A   300 columns": (300, 0),
    "B   1000 columns": (1000, 0),
    "C   as B, switched on late": (1000, 1.6),
    "D   as C, even odds at first sight": (1000, 1.6, even),
    "A without change": (300, 0, keeps),
    "A without false passes": (300, 0, paper, "free"),
    "A without either": (300, 0, keeps, "free"),
    "A with all returns": (300, 0, paper, "hit"),
}
passed = {name: lecture_03_scenes.pass_by(*run) for name, run in runs.items()}
lecture_03_scenes.draw_flanks({name: passed[name] for name in list(runs)[:2]})
plt.show()

# %% [markdown]
# First look at the scanner.
#
# **Predict before you run.** Neighbouring columns are $\Delta\varphi$ = 0.0105 rad apart. How far apart do they
# hit the flank, 10 m ahead of us?
#
# <details><summary>Answer</summary>
#
# About half a metre, which is one cell. A beam in the direction $\varphi$ hits the flank at $x = y / \tan\varphi$,
# where $x$ is the distance ahead and $y$ the one to the side. Its derivative has the size $(x^2 + y^2)/y$, here 47 m
# per radian.
#
# </details>
#
# The gap on the flank is $\Delta\varphi\,(x^2 + y^2)/y$: it grows with the square of the distance. Beyond 10 m it is
# wider than a cell, and some cells are never hit. KITTI's scanner (panel B) has 1000 columns in the same half circle,
# and no stripes here. How do missing returns make BOF so wrong? Two suspects: change takes mass that no return confirms;
# and a beam through such a cell, to a point farther back, says that it is free (a false pass). **Switch off each.**

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
assert [round(float(np.sqrt(0.5 * 2.25 / np.radians(180 / n) - 2.25**2))) for n in (300, 1000)] == [10, 19]
x, flank = lecture_03_scenes.BUS.centers()[::-1, 0, 0], {}
print("flank at 13 to 18 m, in one scan:      FREE  STATIC DYNAMIC")
for name, (times, states) in passed.items():
    scan = int(np.argmin(abs(times - 2.2)))  # the bus covers 6.4 to 18.4 m
    flank[name] = states[:3, scan, (x > 13) & (x < 18)].mean(axis=1)
    print(f"{name:<35}" + "".join(f"{p:8.2f}" for p in flank[name]))
assert flank["A   300 columns"][DYNAMIC] < 0.01 < 0.95 < flank["B   1000 columns"][DYNAMIC]
assert flank["A without false passes"][DYNAMIC] < 0.2 < 0.25 < flank["A without change"][DYNAMIC] < 0.4
assert flank["A without either"][DYNAMIC] > 0.5
assert flank["A with all returns"][DYNAMIC] > 0.95
assert max(flank[name][DYNAMIC] for name in list(runs)[2:4]) < 0.01
for name in ("C   as B, switched on late", "D   as C, even odds at first sight"):
    for t, held in zip(passed[name][0][4:], passed[name][1][STATIC, 4:], strict=True):
        assert held[(x > 11.25) & (x < min(18, 36 - 8 * t - 0.25))].min() > 0.95  # covered at first, and still

# %% [markdown]
# Neither alone is the cause. Without both, more than half of the flank moves; with all returns, nearly all of it. So
# missing returns are the cause: mass in a cell that no beam hits is taken by change, or wiped out by a false pass.
#
# ## What decides where scans can't?
#
# Now take KITTI's scanner, and switch the filter on late, when the bus is already beside us. Panel C: every cell that
# the bus covers at this instant turns dark, and stays so as long as the bus covers it. In B the same cells, at the same
# time, are orange.
#
# What is different? In C nobody has seen these cells empty. Standing and driving both have an antecedent inside the
# bus, so both explain each scan of the cell equally well. This is the **aperture problem**: through a small window, here
# one cell, motion along an edge can't be seen. But then the cell should stay undecided. Who decides for STATIC?
#
# The first suspect is **first sight**, which is for STATIC, fifteen to one.
#
# **Predict before you run.** Panel D starts from even odds, one to one. What will the flank look like?
#
# <details><summary>Answer</summary>
#
# It turns dark all the same, after three scans. So in D there must be another cause.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two maps of place against time along the flank of the bus, the filter switched on when the bus is beside us; hatched before that. C: dark where the bus was at that instant and nearly five metres before it, orange only where its front came later. D, even odds at first sight: brown for a few scans, then as dark as C"
lecture_03_scenes.draw_flanks({name: passed[name] for name in list(runs)[2:4]})
plt.show()

# %% [markdown]
# (Brown is between STATIC and DYNAMIC.) In C the dark even grows towards us, by nearly five metres in a second.
#
# The second suspect is the **spread** over velocities. STATIC is one velocity. DYNAMIC shares its half among 48, and most
# of them lead sideways, out of the flank. Only a fifth of its mass moves along it.
#
# The third suspect is the **strike-out** in `predict`. In a cell that is surely occupied, what doesn't stand moves. So
# $1 - a$ is $s$, and $1 - s$ is $a$: our formula turns the odds $s : a$ into $s \cdot s : a \cdot a$. It squares them at
# every scan. Why? It takes "it stands here" and "it comes from next door" for two independent reports, but both tell of
# one bus. It is this lecture's price again: cells that don't know of each other count one report twice.
#
# **Switch each off.** To switch off the spread, let the filter know only zero and the velocity of the bus. To switch off
# the strike-out, use `fly` alone. Start from the odds of C and of D.

# %% jupyter={"source_hidden": true} alt="two panels of P(DYNAMIC | occupied) in the bus over one second. Spread off: the dashed lines without strike-out keep their level; with it, the start from 15:1 falls to zero and the one from 1:1 stays at one half. Spread on: the start from 1:1 drops at the first scan, to 0.2 without strike-out and to zero with it"
fig, axes = plt.subplots(1, 2, figsize=(8.6, 3.3), layout="constrained", sharey=True)
share = {}
for ax, spread in zip(axes, (False, True), strict=True):
    for odds, marker, colour in ((1, "o", "#c04000"), (15, "s", "0.05")):
        for strikes, line in ((True, "-"), (False, "--")):
            told = lecture_03_scenes.late(odds, spread, strikes)
            share[odds, spread, strikes] = told
            name = f"{'C' if odds == 15 else 'D'}, {odds} : 1, " + ("strike-out" if strikes else "fly alone")
            ax.plot(np.arange(len(told)), told, line, marker=marker, color=colour, markersize=5, label=name)
    ax.set_title("48 velocities: spread" if spread else "only the bus's velocity: no spread", fontsize=10)
    ax.set(xlabel="scans since it was switched on", ylim=(-0.02, 0.6))
axes[0].set_ylabel("P(DYNAMIC | occupied)")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9, frameon=False,
           title="first sight, STATIC : DYNAMIC", title_fontsize=9)  # fmt: skip
plt.show()
for (odds, spread, strikes), told in share.items():
    if not spread:  # fly alone keeps the odds, and so does the strike-out if they are even
        assert abs(told - told[0]).max() < 0.03 or (strikes and odds != 1)
    assert odds == 1 or told.max() < 0.07  # first sight alone is enough in C
    assert not spread or told[-1] < (0.02 if strikes else 0.2)

# %% [markdown]
# In C first sight alone is enough: STATIC leads in all four cases. In D (orange) nothing happens without the spread,
# with or without strike-out. The spread gives STATIC the lead, and the strike-out makes it certain.
#
# ## Could any filter see that the bus moves?
#
# Ask exact inference. A small bus fills three cells in a row. Each of them stands or drives, fifteen to one, as at first
# sight. Two scans follow, and each finds the bus one cell farther. Does its rear cell move? Then hide what happens at
# the front: there the scans tell nothing.

# %%
cells = ({"static": 15 / 16, "right": 1 / 16},) * 3 + ({},) * 3  # three of the bus, three free
for name, seen in {"front seen  ": (".xxx..", "..xxx."), "front hidden": (".xx???", "..x???")}.items():
    bus = lecture_03_row.CellsInARow(cells, seen, clearing_time=0)  # 0: without the package's rules
    model, given = lecture_03_row.row_model(bus, 2), lecture_03_row.row_evidence(bus, 2)
    exact = eliminate(model, "m3,2", given).normalised().table[lecture_03_row.Cell.RIGHT]
    alone = lecture_03_bof.bof_beliefs(bus)[-1, 2, lecture_03_row.Cell.RIGHT]
    print(f"{name}  P(the rear moves): all cells together {exact:.2f}, BOF {alone:.2f}")
    assert (exact > 0.9) == (name[6:] == "seen  ")
    assert alone < 0.01

# %% [markdown]
# So the scans do tell it, against odds of fifteen to one. They tell it at the front: a cell that was free is occupied
# now. What came there must have left the cell behind, and that cell is still occupied, so the next one has moved up, and
# so on to the rear. Hide the front, and exact inference knows no more than BOF.
#
# Such a conclusion goes from cell to cell through one joint belief, and BOF's cells don't know of each other.
#
# So a bus seems to stand where it was in view from the start, because BOF keeps each cell by itself.


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true} alt="the flank of the bus over time, for one number of columns and one time at which the filter is switched on"
def show(columns, switched_on):
    """Show the flank of the bus for the dials' setting."""
    _, ax = plt.subplots(figsize=(5.4, 3.4), layout="constrained")
    lecture_03_scenes.draw_flank(ax, *lecture_03_scenes.pass_by(columns, switched_on), f"{columns} columns")
    ax.set_ylabel("time [s]")
    plt.show()


_ = interact(
    show,
    columns=IntSlider(value=600, min=300, max=1000, step=100, continuous_update=False),
    switched_on=FloatSlider(value=0, min=0, max=2, step=0.4, description="on at [s]", continuous_update=False),
)

# %% [markdown]
# (The dials work with a running kernel. How many columns does the bus need at 15 m?)
#
# ## In five lines
#
# 1. What is in a cell now was in its antecedent before: each velocity of a lattice shifts its own map.
# 2. A scan measures no velocity. It picks places, and places pick velocities.
# 3. Where something arrives and something stands, strike the pair out, and neither wins.
# 4. BOF keeps each cell by itself. So one thing may be believed in two places: 1.24 things instead of one.
# 5. A cause is found by switching it off. A walker stands because of the lattice's gap together with change; a bus has
#    stripes where returns are missing; and where scans can't tell a cell apart, first sight or the spread decides.
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

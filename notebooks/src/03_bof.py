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
# **Prerequisites.** Lectures [01](01_bayes.ipynb) (Bayes' rule, transition matrix) and [02](02_grids.ipynb) (what a
# beam says, ghosts behind moving cars).
#
# **Time.** 75 minutes, of which the computer needs less than one.
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
# Here is the whole idea. One thing is somewhere on a street. In the upper picture each row is a velocity and each
# column a place; dark blue is probable. The lower picture sums over the velocities: P(occupied).

# %% jupyter={"source_hidden": true} alt="animation: a column of nine equally probable velocities at one place; half a second later it is sheared into a slanted line; a return from one place picks three velocities; the next return leaves one, 2 m/s"
story = lecture_03_scenes.sheared()
assert story[-1][1][6].max() > 0.8  # at 2 m/s
plotting.animate(
    lecture_03_scenes.sheared_frames(story), 1.5, alt="a column of velocities is sheared, and returns pick one velocity"
)

# %% [markdown]
# At **A** we know the place within three cells and nothing of the velocity: the belief is a column. At **B** nobody has
# looked, but each row has moved at its own speed. The column is **sheared**: place and velocity, independent before,
# are now tied together. At **C** a beam comes back from one place (red mark). It says nothing about velocities. But it
# picks a column of the sheared belief, and only three velocities are left there. After **D** and **E** one velocity
# stands out, 2 m/s.
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
# There are two steps. **Predict** asks each cell where its content came from. **Update** is Bayes' rule. What is in
# cell $k$ now with velocity $v$ was a way of $v\,\Delta t$ behind, in its **antecedent**. Write $m_k^t$ for what cell
# $k$ holds at scan $t$, which is FREE or a velocity, and $z$ for the scan:
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
# where $a_v$ is what the antecedent of velocity $v$ sends. The arrivals add, because at most one thing can come. Cells
# that don't know of each other may send more than one in all. Then the arrivals are scaled down to just below one.


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
# So neither wins: the pair is struck out, and whoever was surer keeps more. With `look`, this is the filter. A hidden
# cell checks that the package's `bof_predict` and `bof_update` do the same, on random beliefs.
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
# there. So a cell tells how surely it is free, stands or moves; how fast, and how surely so, only if something may move
# in it.
#
# ## Does it still smear?
#
# On a street velocities have two components. They form a **lattice**, a disc of points: up to 8 m/s, 2 m/s apart, there
# are 49. Three more things happen on a street:
#
# - **First sight.** A cell that no beam has reached is UNKNOWN. At its first beam it is FREE, STATIC or DYNAMIC, and
#   before the beam speaks, STATIC is fifteen times as probable as DYNAMIC. Remember this number.
# - **Less than a cell.** In a tenth of a second something at 1 m/s covers a fifth of a cell. Rounded to zero, it would
#   stand for ever. But a whole map flies at one velocity. So BOF keeps the **remainder** for each map, and shifts this
#   one by a cell at every fifth step.
# - **Change.** Things start and stop by lecture 01's transition matrix, and a little mass goes from each velocity to
#   its neighbours ([the lattice of velocities](deeper/03_lattice.ipynb)).
#
# Two boxes move before a wall: one comes towards us at 6 m/s, one crosses to the left. In lecture 02's map both leave a
# smear.

# %%
spec = grid.GridSpec(x_min=0, x_max=30, y_min=-12, y_max=12, cell=0.5)
params = occupancy.BofParams(occupancy.VelocityLattice(max_speed=8, spacing=2))
binary = occupancy.LogOddsGrid(spec, occupancy.LogOddsParams(sensor=fast.SensorModel()))
belief = occupancy.BofState.nothing_known(spec, params.lattice)


def world(t):
    """Return the boxes after t seconds: a wall, one box that comes, one that crosses."""
    return [Box(4, 28, 9, 9.5, 2.5), Box.around(25 - 6 * t, 3, 2, 2, 1.5), Box.around(10, -8 + 4 * t, 1, 2, 1.5)]


rng, maps, beliefs = np.random.default_rng(0), [], []
for k in range(21):
    points = scan_boxes(world(k / 10), rings=32, noise=0.02, rng=rng)
    belief = occupancy.bof_predict(belief, spec, params, dt=0.1)
    belief = occupancy.bof_update(belief, spec, fast.scan_evidence(points, spec, params.world.sensor), params)
    maps.append(binary.step(points, occupancy.PlanarMotion(), dt=0.1).copy())
    beliefs.append(belief)


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
def smear(k):
    """Return the area that the boxes have left by scan k and that still seems occupied, m²: lecture 02's map, BOF."""
    been = [np.any([cells_in(world(j / 10)[box], spec) for j in range(k + 1)], axis=0) for box in (1, 2)]
    left = [was & ~cells_in(world(k / 10)[box], spec, margin=0.5) for box, was in zip((1, 2), been, strict=True)]
    held = maps[k], beliefs[k].occupied.sum(axis=0)
    return [sum(occupancy.smear_area(p, was, spec) for was in left) for p in held]


smears = np.mean([smear(k) for k in range(11, 21)], axis=0)
(row,), (col,), _ = spec.cells(np.array([[12.2, 3.2]]))  # the front of the box that comes
front = beliefs[-1].occupied[:, row, col]
at_6 = front[params.lattice.velocities.tolist().index([-6, 0])] / front.sum()
wall = cells_in(world(0)[0], spec, margin=0.3)
print(f"smear, mean of the last ten scans: {smears[0]:.1f} m² in lecture 02's map, {smears[1]:.1f} m² in BOF")
print(f"front of the box that comes: P(6 m/s towards us | occupied) = {at_6:.2f}")
assert smears[1] < 0.1 * smears[0]
assert at_6 > 0.9
assert max(state.probability[DYNAMIC, wall].max() for state in beliefs) < 0.5

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="animation from above, two maps: in the map of lecture 02 on the left both boxes drag dark tails; in BOF on the right they take the colours of their headings, yellow towards us and green to the left, and leave hardly any tail; the wall stays dark; red outlines show where the boxes are"
fig, axes = plt.subplots(1, 2, figsize=(8.2, 4.2), layout="compressed")
plotting.occupancy(spec, plotting.binary_states(maps[0]), ax=axes[0], legend=False)
plotting.velocity_wheel(spec, beliefs[0].probability, occupancy.bof_velocity(beliefs[0])[0], ax=axes[1])
axes[1].set_ylabel("")
for ax in axes:
    ax.text(9, 14, "wall", rotation=90, color="white", ha="center", va="center", fontsize=9)
outlines = [lecture_03_scenes.outline(ax, world(0)[1:]) for ax in axes]


def crossing():
    """Draw both grids, scan by scan."""
    for k in range(0, 21, 5):
        state = beliefs[k]
        axes[0].images[-1].set_data(plotting.occupancy_colours(plotting.binary_states(maps[k])))
        axes[1].images[-1].set_data(wheel_colours(spec, state.probability, occupancy.bof_velocity(state)[0]))
        for outline in outlines:
            lecture_03_scenes.move_outline(outline, world(k / 10)[1:])
        axes[0].set_title(f"lecture 02's map, {k / 10:.1f} s")
        axes[1].set_title(f"BOF, {k / 10:.1f} s")
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(crossing(), 0.6, alt="two boxes cross; lecture 02's map smears them, BOF colours them by heading")

# %% [markdown]
# The red outlines are the two boxes. What stays dark where they have been is smear. (Free ground is grey on the left as
# long as lecture 02's map isn't sure of it.) In BOF the boxes are dark at first,
# because the first scans tell little. Then they take the colour of their heading, and the wall stays dark. The smear is
# nearly gone, because mass that moves takes itself away. And the front of the oncoming box has its true speed, nearly
# for sure.
#
# And the real street of lecture 02, with its three lanes of ghosts? `Bof` is the two functions, and a map that scrolls
# with the vehicle. (It also looks back half a second: where would this thing have been, and was that place occupied?
# See [phantoms on real streets](deeper/04_real_streets.ipynb).)

# %%
compact, sensor = grid.GridSpec.compact(), fast.SensorModel()
drive = samples.real_drive()
street = [drive[k] for k in range(len(drive))]
lattice = occupancy.VelocityLattice(max_speed=16, spacing=2)
bof = occupancy.Bof(compact, occupancy.BofParams(lattice, occupancy.WorldModel(sensor=sensor)))
on_street, before = [], street[0]
for frame in street:
    motion = occupancy.PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
    on_street.append(bof.step(frame.points_grid, motion, frame.time - before.time))
    before = frame

# %% jupyter={"source_hidden": true} alt="animation of a real street from above: in lane A on the far left oncoming cars turn yellow; in lane B beside us only parts of the cars turn blue; the car C ahead of us and the wall W stay dark"
fig, ax = plt.subplots(figsize=(4.6, 6.2), layout="constrained")
lecture_02_street.note(ax, {"A": ((8.5, 18.0), (13.5, 22.0)), "B": ((4.0, 26.0), (-0.5, 23.0)),
                            "C": ((0.3, 13.0), (4.5, 8.0)), "W": ((-7.8, 12.0), (-12.0, 14.5))})  # fmt: skip
plotting.animate_occupancy(
    compact, on_street[::3], [frame.time for frame in street[::3]], "a real street with oncoming cars in yellow", ax
)

# %% jupyter={"source_hidden": true}
truth = street[-1].labels.birdseye_on(compact)
y, p = compact.centers()[..., 1], on_street[-1].probability
held = p[STATIC] + p[DYNAMIC]
log_odds = lecture_02_street.add_up(street, compact, sensor)[-1]
for lane, right, far in (("A", 5.5, 13), ("B", 2, 5.5), ("C", -2, 2)):
    road = (truth == lecture_02_street.ROAD) & (y >= right) & (y < far)
    ghosts = [occupancy.smear_area(occupied, road, compact) for occupied in (log_odds, held)]
    print(f"lane {lane}: ghosts {ghosts[0]:2.0f} m² in lecture 02's map, {ghosts[1]:2.0f} m² in BOF")
rules = {
    "last scan alone": lecture_02_street.alone(street[-1:], compact, sensor)[0],
    "lecture 02's map": log_odds,
    "BOF": held,
}
thing = lecture_02_street.things(truth)
everywhere = {}
for name, occupied in rules.items():
    ghosts = occupancy.smear_area(occupied, truth == lecture_02_street.ROAD, compact)
    everywhere[name] = ghosts, (thing & (occupied > 0.5)).sum() * compact.cell**2
    print("everywhere, {:<16} ghosts {:2.0f} m², found {:3.0f} m² of things".format(name, *everywhere[name]))
assert everywhere["last scan alone"][1] < 0.77 * everywhere["lecture 02's map"][1]
assert everywhere["BOF"][1] > 0.9 * everywhere["lecture 02's map"][1]
assert everywhere["BOF"][0] < 0.4 * everywhere["lecture 02's map"][0]
cars = (truth == KITTI_14.index("car")) & (y > 2) & (y < 5.5) & (held > 0.5)
assert cars.sum() > 20
assert (p[DYNAMIC, cars] > 0.5).mean() < 0.25  # few cells of the cars in lane B

# %% [markdown]
# Data: PandaSet by Hesai and Scale AI, CC BY 4.0. The cars of lane A come towards us and turn yellow. Their ghosts are
# nearly gone. In lane B, where cars drive away, most cells of the cars stay dark, and most of the ghosts stay, too. The
# car at C rolls away and stays dark as well. Lecture 04 asks why. A trivial rule, trusting the last scan
# alone, has no ghosts, but it finds a quarter less of what is there. BOF finds nearly all that lecture 02's map finds.
#
# So BOF removes the smear of what it has recognised as moving, and only of that.
#
# ## Can one thing be in two places?
#
# One thing is in the first cell of a row. It stands, or it drives one cell to the right, with one half each. Then a beam
# passes the first cell, and another one comes back from the second.

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
# of thousands of cells would fit into no computer. So yes: for BOF one thing can be in two places.
#
# ## Why does a walker stand?
#
# A person comes towards us at 1.4 m/s, as people walk. The lattice has 0 and 2 m/s, but nothing between.
#
# **Predict before you run.** Will the person be STATIC or DYNAMIC after four seconds? And if velocities are 1 m/s
# apart? And a slower person, at 1.0 m/s, which this finer lattice has exactly?
#
# <details><summary>Answer</summary>
#
# STATIC on the first lattice. DYNAMIC on the finer one, but that takes more than two seconds. The slower person stays
# STATIC on both. So the gap in the lattice isn't the whole cause.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="P(DYNAMIC) of two walkers over four seconds. At 1.4 m/s it stays low only with velocities 2 m/s apart and the leak. At 1.0 m/s it becomes high only with velocities 1 m/s apart and without the leak"
fig, axes = plt.subplots(1, 2, figsize=(8.6, 3.1), layout="constrained", sharey=True)
for ax, speed in zip(axes, (1.4, 1.0), strict=True):
    for spacing, colour, marker in ((2, "0.15", "o"), (1, "#c04000", "s")):
        for leaks, line in ((True, "-"), (False, "--")):
            told = lecture_03_scenes.walker(speed, spacing, leaks)
            label = f"{spacing} m/s apart" + ("" if leaks else ", no leak")
            ax.plot(
                lecture_03_scenes.WALK, told, line, color=colour, marker=marker, markevery=5, markersize=5, label=label
            )
            causes = leaks + (spacing == 2)
            assert (np.mean(told[-10:]) > 0.7) == (causes == 0 or (causes == 1 and speed == 1.4))
            assert np.mean(told[-10:]) > 0.7 or np.mean(told[-10:]) < 0.3
    ax.set_title(f"walker at {speed} m/s", fontsize=10)
    ax.set(xlabel="time [s]", ylim=(0, 1.02))
leak = sum(defaults.rates[DYNAMIC]) + defaults.stop_rate * np.exp(-((1.0 / defaults.stop_speed) ** 2) / 2)
assert 0.08 < 1 - np.exp(-0.1 * leak) < 0.1  # of DYNAMIC at 1 m/s, from scan to scan
axes[0].set_ylabel("P(DYNAMIC) of the walker")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
plt.show()

# %% [markdown]
# Look at the solid lines first. For the faster person the finer lattice is enough, for the slower one it isn't. A scan
# speaks for motion only when the person steps into another cell, here about once in five scans. Meanwhile DYNAMIC
# **leaks**: by the transition matrix things stop or are forgotten, and slow things stop most. Each scan costs nearly a
# tenth of it.
#
# **Switch this cause off**, so that nothing stops and nothing is forgotten: the dashed lines. Now the finer lattice
# finds the slower person, and even the coarse one finds the faster. Only the slower person on the coarse lattice stays
# STATIC: there the gap is enough. (Cells half as wide, in which steps come twice as often, find the slower person in
# spite of the leak.)
#
# So a walker seems to stand because of the gap in the lattice, and because DYNAMIC leaks between two steps.
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
# stripes, where the bus seems to stand. Why?

# %% jupyter={"source_hidden": true} alt="two maps of place against time along the flank of a bus. A, 300 columns: orange up to 11 m, behind that dark stripes between free ones. B, 1000 columns: orange everywhere"
even = (0.952, 0.024, 0.024)
runs = {
    "A   300 columns": (300, 0),
    "B   1000 columns": (1000, 0),
    "C   as B, switched on late": (1000, 1.6),
    "D   as C, even odds at first sight": (1000, 1.6, even),
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
# The gap on the flank is $\Delta\varphi\,(x^2 + y^2)/y$: it grows with the square of the distance.
# Beyond 10 m the gap is wider than a cell. So some cells of the flank are never hit. Beams to the cells beyond pass
# through them, and they look free. Mass that moves must cross such cells, and is wiped out there. Mass that stands, in
# a cell that is hit, need not cross anything. So only standing survives.
#
# **Switch this cause off.** KITTI's scanner has 1000 columns in the same half circle, and its gap stays below a cell up
# to 19 m. In panel B the stripes are gone. So the scanner made them.

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
assert [round(float(np.sqrt(0.5 * 2.25 / np.radians(180 / n) - 2.25**2))) for n in (300, 1000)] == [10, 19]
x, moving = lecture_03_scenes.BUS.centers()[::-1, 0, 0], {}
for name, (times, states) in passed.items():
    k = int(np.argmin(abs(times - 2.2)))  # the bus covers 6.4 to 18.4 m
    moving[name[0]] = [states[DYNAMIC, k, (x > low) & (x < high)].mean() for low, high in ((7, 10), (13, 18))]
    print(f"{name:<35} P(DYNAMIC) at 7 to 10 m {moving[name[0]][0]:.2f}, at 13 to 18 m {moving[name[0]][1]:.2f}")
assert moving["A"][1] < 0.01 < 0.95 < min(moving["B"][1], moving["A"][0])
assert max(moving["C"][1], moving["D"][1]) < 0.01
for name in ("C   as B, switched on late", "D   as C, even odds at first sight"):
    for t, held in zip(passed[name][0][4:], passed[name][1][STATIC, 4:], strict=True):
        assert held[(x > 11.25) & (x < min(18, 36 - 8 * t - 0.25))].min() > 0.95  # covered at first, and still

# %% [markdown]
# ## What decides where scans can't?
#
# With KITTI's scanner, switch the filter on late, when the bus is already beside us. Panel C: every cell that the
# bus covers at this instant stays dark, as long as the bus covers it. In B the same cells, at the same time, are orange.
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
# It turns dark all the same, after three scans. So first sight isn't the only cause.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="two maps of place against time along the flank of the bus, the filter switched on when the bus is beside us; white before that. C: dark where the bus was at that instant and a few metres before it, orange only where its front came later. D, even odds at first sight: brown for a few scans, then as dark as C"
lecture_03_scenes.draw_flanks({name: passed[name] for name in list(runs)[2:]})
plt.show()

# %% [markdown]
# (Brown is between STATIC and DYNAMIC, and white is before the filter is switched on.)
#
# The second suspect is the **spread**. STATIC is one velocity. DYNAMIC shares its half among 48, most of which lead
# sideways, out of the flank. After a few scans about a fifth of it is left there.
#
# The third suspect is the **strike-out**. In a cell that is surely occupied, what doesn't stand moves. So $1 - a$ is
# $s$, and $1 - s$ is $a$: our formula turns the odds $s : a$ into $s \cdot s : a \cdot a$. It squares them at every
# scan, and after two scans 0.7 to 0.3 has become 0.97 to 0.03. Why? It takes "it stands here" and "it comes from next
# door" for two independent reports, but both tell of one bus. It is this lecture's price again: cells that don't know
# of each other count one report twice.
#
# **Switch each off.** To switch off the spread, let the filter know only zero and the velocity of the bus. To switch off
# the strike-out, use `fly` alone. Start from several odds.

# %% jupyter={"source_hidden": true} alt="two panels of P(DYNAMIC | occupied) in the bus over one second. Spread off: from 15:1, 1:1 and 2:3 the dashed lines without strike-out keep their level, with it the first falls to zero, the second stays, the third rises to one. Spread on: all lines drop at the first scan, those with strike-out to zero"
fig, axes = plt.subplots(1, 2, figsize=(8.6, 3.3), layout="constrained", sharey=True)
share = {}
for ax, spread in zip(axes, (False, True), strict=True):
    for odds, marker, colour in ((2 / 3, "^", "#c04000"), (1, "o", "0.45"), (15, "s", "0.05")):
        for strikes, line in ((True, "-"), (False, "--")):
            told = lecture_03_scenes.late(odds, spread, strikes)
            share[odds, spread, strikes] = told
            first = "2 : 3" if odds < 1 else f"{odds} : 1"
            name = f"{first}, " + ("strike-out" if strikes else "fly alone")
            ax.plot(np.arange(len(told)), told, line, marker=marker, color=colour, markersize=5, label=name)
    ax.set_title("48 velocities: spread" if spread else "only the bus's velocity: no spread", fontsize=10)
    ax.set(xlabel="scans since it was switched on", ylim=(-0.02, 1.02))
axes[0].set_ylabel("P(DYNAMIC | occupied)")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9, frameon=False,
           title="first sight, STATIC : DYNAMIC", title_fontsize=9)  # fmt: skip
plt.show()
for (odds, spread, strikes), told in share.items():
    if not spread:  # fly alone keeps the odds, the strike-out lets the leader win
        assert abs(told - told[0]).max() < 0.03 or (strikes and odds != 1)
    assert not strikes or spread or odds == 1 or (told[-1] > 0.95) == (odds < 1)
    assert not spread or told[-1] < (0.02 if strikes else 0.3)

# %% [markdown]
# On the left nothing spreads. With `fly` alone (dashed) each start keeps its odds: undecided stays undecided. With the
# strike-out, who leads at first wins, DYNAMIC as well as STATIC. On the right the spread hands STATIC the lead, even
# where DYNAMIC led at first, and the strike-out makes it certain. So the middle of the bus is dark because first sight
# *and* the spread each give STATIC the lead, and the strike-out turns any lead into certainty.
#
# In B one scan could tell, the one before the front arrived, when the cell was free. (In C the dark even spreads forward
# by some metres, because a cell that is taken for standing sends nothing ahead.)
#
# Could *any* filter see it? Ask exact inference. Each of three cells in a row, a small bus, stands or drives, seven to
# three. Two scans follow, and each finds the bus one cell further:

# %%
bus = lecture_03_row.CellsInARow(
    ({"static": 0.7, "right": 0.3},) * 3 + ({},) * 3, (".xxx..", "..xxx."), clearing_time=0
)
model, given = lecture_03_row.row_model(bus, 2), lecture_03_row.row_evidence(bus, 2)
exact = eliminate(model, "m3,2", given).normalised().table[lecture_03_row.Cell.RIGHT]
print(
    f"its rear moves: all cells together {exact:.3f}, BOF {lecture_03_bof.bof_beliefs(bus)[-1, 2, lecture_03_row.Cell.RIGHT]:.3f}"
)
assert exact > 0.99

# %% [markdown]
# So the scans do tell it. If the front has moved on and its place is still occupied, then the next cell has moved up,
# and so on to the rear. Such a conclusion goes from cell to cell, and BOF's cells don't know of each other.
#
# So half a bus seems to stand where columns leave gaps, and where it was in view from the start.


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
# 5. Things that move seem to stand where the lattice lacks their velocity, where DYNAMIC leaks, and where columns leave
#    gaps. Where scans can't tell, STATIC gets the lead, and the strike-out makes it certain.
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

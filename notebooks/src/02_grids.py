# %% [markdown]
# # 02 · Occupancy grids: when is it right to add?
#
# **In one sentence.** An occupancy grid adds up what each scan says about each cell; you build one from two cells, and
# find where adding goes wrong: behind whatever moves, around walls, and when two returns share one error.
#
# **You will be able to**
# - say what one beam tells about each cell that it meets;
# - update log-odds by hand, and count the prior once;
# - choose a clamp, and predict the smear behind a moving car;
# - test an explanation by switching off its cause.
#
# **Prerequisites.** Lecture [01](01_bayes.ipynb): Bayes' rule, and when two scans are independent. Logarithms.
#
# **Time.** 75 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.2, step 2, the sensor model; it builds on Moravec and Elfes (1985) and Elfes (1989).

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
from filterpy import discrete_bayes
from ipywidgets import FloatSlider, interact

from semgrid_edu import fast, grid, occupancy, plotting
from semgrid_edu.datasets import samples
from semgrid_edu.occupancy import log_odds, probability
from worlds import lecture_02_boxes, lecture_02_cell, lecture_02_street, lecture_02_thick_walls

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
draw, ROAD = lecture_02_street.draw, lecture_02_street.ROAD
sensor, spec = fast.SensorModel(), grid.GridSpec.compact()
drive = samples.real_drive()
street = [drive[k] for k in range(len(drive))]
truths = [frame.labels.birdseye_on(spec) for frame in street]
scans = lecture_02_street.alone(street, spec, sensor)
maps = lecture_02_street.add_up(street, spec, sensor)

# %% [markdown]
# ## Why does the map show cars that aren't there?
#
# Our vehicle waits in a real street. Ten times in two seconds its LIDAR measures the distance to whatever is around.
# The left map shows what each scan says by itself. The right map is an **occupancy grid**. It adds the scans up. Red
# marks **ghosts**: cells that the map calls occupied although at that moment they are empty road.

# %% jupyter={"source_hidden": true} alt="animation, a real street from above: left, single scans with hardly a red cell; right, the map of all scans, in which red streaks grow in three lanes, A on the far left, B in the middle and C straight ahead, while the wall W stays sharp"
LETTERS = {"A": ((8.5, 18.0), (13.5, 22.0)), "B": ((4.0, 26.0), (-0.5, 23.0)), "C": ((0.3, 13.0), (4.5, 8.0)),
           "W": ((-7.8, 12.0), (-12.0, 14.5))}  # fmt: skip


def remembered():
    """Draw single scans beside the map, one frame of the animation after the other."""
    fig, axes = plt.subplots(1, 2, figsize=(7.4, 4.9), layout="compressed")
    for k in range(len(street)):
        for ax, p, title in zip(axes, (scans[k], maps[k]), ("this scan alone", "all scans so far"), strict=True):
            ax.clear()
            ghost = (p > 0.5) & (truths[k] == ROAD)
            draw(spec, p, ax, f"{title}, {street[k].time:.1f} s", ghost, legend=ax is axes[1])
            ax.set(ylim=(0, 50))
        lecture_02_street.note(axes[1], LETTERS)
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(remembered(), period=0.4, alt="red streaks grow in three lanes of the map; single scans have none")

# %%
area = [occupancy.smear_area(p, truths[-1] == ROAD, spec) for p in (scans[-1], maps[-1])]
print(f"ghosts after 1.8 s: {area[0]:.0f} m² in the last scan alone, {area[1]:.0f} m² in the map")
assert area[1] > 70 > 2 > area[0]

# %% [markdown]
# There are ghosts in three lanes. In A cars come towards us. In B, the lane beside ours, cars drive away. In C the car
# ahead of us drives off. The wall at W stays sharp.
#
# A car covers about 8 m², so the map has invented nine cars. No single scan did that. The fault must be in how the
# map *adds*. To find it, we build such a map from its smallest parts.
#
# ## What does one beam say about a cell?
#
# Take two cells in a row. A beam passes the first and comes back from the second. Neither is certain: things
# fill a cell only in part, so a beam can pass an occupied cell. And a beam that an edge splits can
# come back from a free one. Here is how likely each event is:
#
# | what the beam did in the cell | if it is occupied | if it is free |
# |---|---|---|
# | it **passed** | 0.3 | 0.7 |
# | it **came back** | 0.8 | 0.05 |
# | it never got there | 1 | 1 |
#
# **Predict before you run.** Five cells of one metre, all with P(occupied) = 0.5. A beam comes back after 3.5 m. Where
# is each cell now?
#
# <details><summary>Answer</summary>
#
# The beam passed three cells: 0.3 / (0.3 + 0.7) = 0.30. It came back from the fourth, which goes to 0.94 in the same
# way. The fifth stays as it was, because both of its likelihoods are the same.
#
# </details>
#
# Bayes' rule divides by the sum of the two. So only their ratio matters. With $z$ for the scan:
#
# $$ \frac{P(z \mid \text{occupied})}{P(z \mid \text{free})} =
#    \begin{cases} 0.3 / 0.7 & \text{before the return} \\ 0.8 / 0.05 & \text{at the return} \\
#    1 & \text{behind it} \end{cases} $$


# %% tags=["sensor-model"] jupyter={"outputs_hidden": true}
def one_beam(length, n_cells):
    """Return P(z | occupied) and P(z | free) of cells of 1 m along a beam that comes back after `length` metres."""
    occupied, free = np.ones(n_cells), np.ones(n_cells)
    occupied[: int(length)], free[: int(length)] = sensor.p_pass_occupied, sensor.p_pass_free
    occupied[int(length)], free[int(length)] = sensor.p_hit_occupied, sensor.p_hit_free
    return occupied, free


occupied, free = one_beam(length=3.5, n_cells=5)
column = grid.GridSpec(x_min=0, x_max=5, y_min=-0.5, y_max=0.5, cell=1)
package = occupancy.scan_evidence(np.array([[3.5, 0.0, 1.0]]), column, sensor)  # one return, 1 m above the ground
np.testing.assert_allclose(occupied, package.occupied[::-1, 0])  # row 0 is the farthest ahead
np.testing.assert_allclose(free, package.free[::-1, 0])
print("P(occupied):", (0.5 * occupied / (0.5 * occupied + 0.5 * free)).round(2))

# %% [markdown]
# A real scan has tens of thousands of beams. Only a return from well above the ground counts as an **obstacle**. If one
# beam passes a cell and another comes back from it, the return counts. At most two returns of one scan count in a cell.
# How the ground is found is in the companion [ground and porous things](deeper/02_ground_and_porous.ipynb).

# %% jupyter={"source_hidden": true} alt="left, a beam through five cells, whose colours go from light for passed through dark for the return to grey behind it; right, the first scan of the street, with S in a grey shadow behind a car and W at a dark wall"
fig, (ax, street_ax) = plt.subplots(1, 2, figsize=(7.6, 4.6), layout="constrained", width_ratios=(1, 3))
p = (occupied / (occupied + free))[::-1, None]
ax.imshow(plotting.occupancy_colours(plotting.binary_states(p)), extent=(-0.5, 0.5, 0, 5), aspect="equal")
ax.annotate("", (0, 3.5), (0, 0), arrowprops={"arrowstyle": "->", "color": "tab:orange", "linewidth": 2.5})
for k, one in enumerate(p[::-1, 0]):
    ax.text(0.6, k + 0.5, f"{one:.2f}", va="center", fontsize=10)
ax.set(title="one beam", xticks=[], ylabel="x, forward [m]")
draw(spec, scans[0], street_ax, "one scan of the street")
street_ax.set(ylim=(0, 50))
lecture_02_street.note(street_ax, {"S": ((12, 19), (11, 27)), "W": ((-7.8, 12.0), (-12.0, 14.5))})
plt.show()

# %% [markdown]
# At S no beam arrives, because a car is in the way: the cells stay unknown. So one beam says *free* on its way,
# *occupied* at its end, and nothing behind.
#
# ## How do two scans add up?
#
# One cell, believed occupied with 0.5. A first beam comes back from it, and then a second one. For round numbers, say that a
# return is four times as likely if the cell is occupied. Count in **odds**, occupied to free. They go from 1 to 4 and
# then to 16, so P(occupied) is 16/17.
#
# Odds multiply, so their logarithms add. With $P$ for P(occupied), the **log-odds** $L$ are
#
# $$ L = \log\frac{P}{1 - P}, \qquad L_\text{new} = L_\text{old} + \log \frac{P(z \mid \text{occupied})}{P(z \mid
#    \text{free})}. $$
#
# $L = 0$ means "don't know", a positive $L$ means rather occupied. In the table above a return adds log 16 = 2.77 to a
# cell, and a pass adds log(0.3 / 0.7) = -0.85. **Remember these two numbers**: the rest of the lecture uses them.


# %% tags=["log-odds"]
def take_in(L, occupied, free, L_min=-np.inf, L_max=np.inf):
    """Return the log-odds of a cell after one scan, within limits."""
    L = L + np.log(occupied / free)
    return min(max(L, L_min), L_max)


L, belief = 0.0, np.array([0.5, 0.5])
for occupied, free in [(0.8, 0.05), (0.3, 0.7)]:  # a return, then a pass
    L = take_in(L, occupied, free)
    belief = discrete_bayes.update(likelihood=np.array([occupied, free]), prior=belief)  # lecture 01
print(f"L = {L:.2f}, P(occupied) = {probability(L):.3f}; by lecture 01's filter {belief[0]:.3f}")
np.testing.assert_allclose(probability(L), belief[0])

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a graph: one cell m, free or occupied, with solid arrows to two shaded scans z1 and z2, and a dashed arrow to the same cell later"
fork = lecture_02_cell.one_log_odds_cell(lecture_02_cell.read_scans("#."))
lecture_02_cell.only_later(fork).draw().set_title("the model in which adding is exact", fontsize=10)
plt.show()

# %% [markdown]
# Adding is Bayes' rule, without any error, in the model above (the box stands for many cells). It assumes two things.
# *Given the cell, the scans are independent*: nothing but $m$ joins $z_1$ and $z_2$. And *the cell stays what it
# is*: the grid deletes the dashed arrow to the cell later. Each assumption will fail.
#
# **And the prior?** It is the first $L$, and it counts once. Some sensor models return $P(\text{occupied} \mid z)$
# instead of two likelihoods. Such an **inverse sensor model** has the prior inside each answer, so you must subtract
# its log-odds, $L_0$, from each answer before you add.
#
# **Predict before you run.** In a car park P(occupied) = 0.2. An inverse model says 0.2 about a cell that it can't see.
# Somebody adds ten such answers and forgets to subtract. What does the map say now?
#
# <details><summary>Answer</summary>
#
# $L$ is eleven times log(0.2 / 0.8) = -1.39, that is -15. The map is certain that the cell is free, after ten scans
# that said nothing.
#
# </details>
#
# So log-odds add as long as each scan brings only what is new.
#
# ## Can a map change its mind?
#
# A car is parked for ten seconds. Each of 100 scans adds 2.77 to a cell, so $L$ = 277. Then the car leaves. Each pass
# takes 0.85 away, so the map needs more than 300 passes, half a minute, until it believes what it sees. The longer it
# was right, the longer it will be wrong.
#
# That happens because its model says that a cell never changes. The usual repair is a **clamp**: $L$ may not leave a
# range. The package keeps $P$ between 0.12 and 0.97, which is $L$ between -1.99 and 3.48.
#
# **Predict before you run.** How many passes does a clamped cell need, from 3.48 to below 0?
#
# <details><summary>Answer</summary>
#
# 3.48 / 0.85 = 4.1, so it survives four passes and is freed by the fifth.
#
# </details>


# %% jupyter={"source_hidden": true}
L_min, L_max = log_odds([0.12, 0.97])


def one_cell(highest=0.97, p_pass_occupied=0.3):
    """Return P(occupied) of a cell at 40 scans: free for a second, covered for half a second, free again."""
    L, p = 0.0, []
    for k in range(40):
        ratio = (0.8, 0.05) if 10 <= k < 15 else (p_pass_occupied, 1 - p_pass_occupied)
        L = take_in(L, *ratio, L_min, log_odds(highest))
        p.append(probability(L))
    return p


def draw_cell(ax, **dials):
    """Draw the history of the cell."""
    ax.axvspan(0.95, 1.45, color="tab:red", alpha=0.15, label="the car is there")
    ax.axhline(0.5, color="0.6", linewidth=1)
    ax.plot(np.arange(40) / 10, one_cell(**dials), ".-", color="black")
    ax.set(ylim=(0, 1.02), xlabel="time [s]", ylabel="P(occupied)")


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="P(occupied) of a cell over four seconds, three panels: with the clamp it falls below one half five passes after the car has left, without its upper limit after fifteen, and after eighteen where a beam often passes an occupied cell"
settings = {"with the clamp": {}, "no upper limit": {"highest": 1 - 1e-9}, "porous world": {"p_pass_occupied": 0.45}}
fig, axes = plt.subplots(1, 3, figsize=(10, 2.8), layout="constrained", sharey=True)
for ax, (name, dials) in zip(axes, settings.items(), strict=True):
    draw_cell(ax, **dials)
    ax.set_title(name, fontsize=10)
    ax.label_outer()
axes[0].legend(fontsize=8, loc="upper right")
plt.show()
cells = [one_cell(**dials) for dials in settings.values()]
assert [next(k for k in range(15, 40) if p[k] < 0.5) - 14 for p in cells] == [5, 15, 18]


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
def show(**dials):
    """Show the cell for the dials' setting."""
    _, ax = plt.subplots(figsize=(6, 2.8), layout="constrained")
    draw_cell(ax, **dials)
    ax.legend(fontsize=9)
    plt.show()


_ = interact(
    show,
    highest=FloatSlider(value=0.97, min=0.6, max=0.999, step=0.001, readout_format=".3f", description="clamp P"),
    p_pass_occupied=FloatSlider(value=0.3, min=0.05, max=0.48, step=0.01, description="P(pass|occ)"),
)

# %% [markdown]
# All three cells see the car at its first return. They differ in letting go. Without the upper limit the same cell needs
# three times as many passes. In a porous world, where a beam often passes an occupied cell, a pass is worth little, so the
# cell waits even longer. (The dials work with a running kernel. What does a very low clamp cost?)
#
# So a clamped map changes its mind at the fifth pass. But a pass it must have.
#
# ## Why does a moving car leave a smear?
#
# You stand still and scan ten times a second. One car drives away at 10 m/s, another comes towards you. Each covers a
# metre between two scans. Behind each of them are cells that it has left.
#
# **Predict before you run.** How long is the tail of each car after two seconds? For the second one, ask first whether
# a beam can pass there.
#
# <details><summary>Answer</summary>
#
# Beams pass the tail of the car that drives away. A cell survives four passes, so this tail grows to four metres and no
# further. The tail of the car that comes is hidden behind the car itself. No beam passes there, so nothing is taken back.
# The car has come 20 m and covers the last four of them itself. Its tail is 16 m long, and grows on.
#
# </details>
#
# With $v$ the speed and $\Delta t$ the time between scans, the tail that beams can see is
#
# $$ \text{tail} = v\, \Delta t \left( \left\lceil 3.48 / 0.85 \right\rceil - 1 \right) = 4\, v\, \Delta t. $$


# %%
def two_cars(t):
    """Return the car that drives away and the one that comes, after t seconds."""
    around = lecture_02_boxes.Box.around
    return around(10.2 + 10 * t, -3, 4, 2, 1.5), around(50.2 - 10 * t, 3, 4, 2, 1.5)


def forget(L, dt, tau):
    """Let log-odds fade towards 0, which is "don't know"."""
    return L * np.exp(-dt / tau)


toy = grid.GridSpec(x_min=0, x_max=60, y_min=-8, y_max=8, cell=0.5)
params = occupancy.LogOddsParams(sensor=sensor)
never = [np.zeros(toy.shape)]
fades = [np.zeros(toy.shape)]
for k in range(25):
    points = lecture_02_boxes.scan_boxes(list(two_cars(k / 10)), columns=600)
    scan = occupancy.scan_evidence(points, toy, sensor)
    never.append(occupancy.update_log_odds(never[-1], scan, params))
    fades.append(occupancy.update_log_odds(forget(fades[-1], dt=0.1, tau=0.5), scan, params))


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="animation of two cars seen from above: without forgetting, the car that drives away drags a short dark tail and the oncoming one a tail that grows without end; with forgetting, the second tail fades to grey"
def two_memories():
    """Draw the grid that never forgets beside the one that does."""
    fig, axes = plt.subplots(1, 2, figsize=(5.8, 5), layout="compressed")
    fig.supxlabel("light: free, dark: occupied, grey: unknown;\nred frames: where the cars are", fontsize=9)
    for k in range(0, 25, 4):
        for ax, L, title in zip(axes, (never[k + 1], fades[k + 1]), ("never forgets", "memory 0.5 s"), strict=True):
            ax.clear()
            draw(toy, probability(L), ax, f"{title}, {k / 10:.1f} s")
            for car in two_cars(k / 10):
                size = car.y_max - car.y_min, car.x_max - car.x_min
                ax.add_patch(plt.Rectangle((car.y_min, car.x_min), *size, fill=False, edgecolor="tab:red"))
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(two_memories(), period=0.6, alt="the tail of the oncoming car grows, and fades where the grid forgets")

# %% jupyter={"source_hidden": true}
x, (away, coming) = toy.centers()[..., 0], two_cars(2.0)
behind = lecture_02_boxes.cells_in(away._replace(x_min=0, x_max=away.x_min), toy) & (never[21] > 0)
beyond = lecture_02_boxes.cells_in(coming._replace(x_min=coming.x_max, x_max=60), toy) & (never[21] > 0)
tails = away.x_min - x[behind].min(), x[beyond].max() - coming.x_max
print(f"tail after 2.0 s: {tails[0]:.0f} m where beams pass, {tails[1]:.0f} m in the shadow")
np.testing.assert_allclose(tails[0], 4, atol=toy.cell / 2)
np.testing.assert_allclose(tails[1], 16, atol=toy.cell / 2)

# %% [markdown]
# (The tails are striped, because mostly one side of a car sends returns, and the car moves by two cells between scans.)
# The right map shows a remedy. Before each scan every cell **forgets** a little: its log-odds shrink towards "don't
# know", with a memory of $\tau$ seconds: $L \leftarrow L\, e^{-\Delta t / \tau}$.
#
# By hand, with $\tau$ = 0.5 s: after one second in the shadow, 3.48 has become 3.48 / $e^2$ = 0.47. One pass would now
# be enough. But without a pass $L$ stays positive, however small. So a smear has two causes: cells that wait for their
# fifth pass, and cells that no beam passes.
#
# ## Which cause makes the ghosts of the street?
#
# In each ghost cell of the street, count the passes since its last return. With none the cell is *hidden*, otherwise it
# *waits*. Is waiting for the clamp a cause? Switch it off: with an upper limit of P = 0.62 one pass frees a cell. If the
# explanation is right, the waiting ghosts go, and only those.

# %% jupyter={"source_hidden": true} alt="the street from above with its ghosts in two colours: dark red without a pass since the last return, orange with one to four passes; lane B is half dark red, lanes A and C are mostly orange"
ghost = (maps[-1] > 0.5) & (truths[-1] == ROAD)
passes = lecture_02_street.passes_since_return(scans)
fig, ax = plt.subplots(figsize=(5.8, 5.2), layout="compressed")
lecture_02_street.draw_ghosts(spec, maps[-1], ax, ghost & (passes <= 0), ghost & (passes > 0))
lecture_02_street.note(ax, {letter: LETTERS[letter] for letter in "ABC"})
plt.show()

# %%
y, cell_area = spec.centers()[..., 1], spec.cell**2
for lane, right, left in (("A", 5.5, 13), ("B", 2, 5.5), ("C", -2, 2)):
    here = ghost & (y >= right) & (y < left)
    hidden = (passes[here] <= 0).mean()
    print(
        f"lane {lane}: ghosts {here.sum() * cell_area:4.1f} m², {100 * hidden:2.0f} % without a pass since the last return"
    )
assert 0.3 < (passes[ghost] <= 0).mean() < 0.35

# %% [markdown]
# In B half of the ghosts are hidden: each car hides the road beyond it, where the next car drove. In A the cars come
# towards us, as in the toy, but beams reach the road behind most of them: four ghosts in five wait.
#
# Now the switch. Beside it stands the other remedy, forgetting, and two trivial rules: call everything free, and
# trust only the last scan.

# %%
thing = lecture_02_street.things(truths[-1])
low = lecture_02_street.add_up(street, spec, sensor, highest=0.62)[-1]
faded = lecture_02_street.add_up(street, spec, sensor, tau=0.5)[-1]
rules = {"always free": 0 * faded, "last scan alone": scans[-1], "all scans": maps[-1],
         "upper limit 0.62": low, "memory of 0.5 s": faded}  # fmt: skip
found = {}
print("m²                ghosts  hidden  waiting  things found")
for name, p in rules.items():
    red = (p > 0.5) & (truths[-1] == ROAD)
    kinds = red, red & (passes <= 0), red & (passes > 0), thing & (p > 0.5)
    found[name] = [cells.sum() * cell_area for cells in kinds]
    print(f"{name:<16} {found[name][0]:7.0f} {found[name][1]:7.0f} {found[name][2]:8.1f} {found[name][3]:9.0f}")
assert found["upper limit 0.62"][2] < 1 < 45 < found["all scans"][2]
assert all(23 < found[name][1] < 24 for name in ("all scans", "upper limit 0.62", "memory of 0.5 s"))
assert found["memory of 0.5 s"][2] < 0.4 * found["all scans"][2]
assert found["memory of 0.5 s"][3] > 0.98 * found["all scans"][3]

# %% [markdown]
# Adding finds a third more things than the last scan alone, and pays with ghosts. The low limit removes the waiting
# ghosts, keeps the hidden ones, and costs a few things. So two ghost cells in three wait for the clamp, and one in three
# is hidden.
#
# Forgetting frees waiting cells sooner. A cell that no beam passes fades towards "don't know" but never below it:
# 24 m² stay. In this model a cell is occupied or not, for ever, so **it can't say "moves"**. Lecture
# [03](03_bof.ipynb) draws the dashed arrow again and gives cells a velocity.
#
# ## Why do walls get thick?
#
# Nothing moves now. A wall is one cell thick. We scan it 20 times, with an error of half a cell in range and pose
# together. The package's grid then calls 2.5 cells occupied. Why?
#
# **The first suspect: one number per cell.** Take two cells, each occupied with probability 0.2. A sensor reports "at
# least one of you is occupied". It is never wrong.
# Only *both free* is ruled out, so each cell is at 0.20 / 0.36 = 0.56. A second report rules out the same map, so
# nothing changes.
#
# **Predict before you run.** A grid keeps 0.56 and 0.56 and forgets the rest. What does it make of the second report?
#
# <details><summary>Answer</summary>
#
# P(both free) is now 0.44², so each cell goes to 0.56 / (1 - 0.44²) = 0.69. The grid grows surer by hearing
# the same sentence again.
#
# </details>

# %% jupyter={"outputs_hidden": true}
p = 0.2
for report in (1, 2, 3):
    p = p / (1 - (1 - p) ** 2)  # two independent cells of p each, and not both free
    print(f"after report {report}: exact 0.56, cell by cell {p:.2f}")

# %% [markdown]
# What did the grid forget? After the report the cells are coupled: if you learn that the first is occupied, the second
# falls back to 0.2, because the first already explains the report. This is **explaining away**, and the report is
# a **collider** ([graphical models](01b_graphical_models.ipynb)). A plausible culprit. So switch it off: infer
# all $2^8$ maps of a row of eight cells together, and then cell by cell with the same beam.

# %% tags=["thick-walls"]
walls = lecture_02_thick_walls.thick_walls()  # 600 random sequences of 20 scans
thickness = {name: (beliefs > 0.5).sum(axis=1).mean() for name, beliefs in walls.items()}
print("cells occupied:", ", ".join(f"{name} {thickness[name]:.1f}" for name in ("exact", "cell by cell", "package")))
assert thickness["cell by cell"] - thickness["exact"] < 0.15 < 1 < thickness["package"] - thickness["cell by cell"]

# %% [markdown]
# The suspect is nearly innocent. Forgetting the coupling costs a tenth of a cell, and the package's grid is too thick by more
# than one. There are four more suspects.
#
# - **The range error.** A return that is too long falls into the cell behind the wall, one that is too short into the
#   cell before it. The grid takes each range as exact.
# - **Stray returns.** A free cell sends one now and then.
# - **The clamp.** A cell can't go below the lower limit of $L$, however many beams pass. One wrong return outweighs them all.
# - **The weak pass.** The beams of this world pass a free cell in 95 % of cases, but the grid calculates with 70. So it
#   needs more passes to outweigh one return.
#
# Switch off each of them alone, and then several together:

# %%
small, clean = lecture_02_thick_walls.thick_walls(noise=0.1), lecture_02_thick_walls.thick_walls(clutter=0)
both = lecture_02_thick_walls.thick_walls(noise=0.1, clutter=0)
switched = {"as it is": walls["package"], "range error 0.1": small["package"], "no clamp": walls["no clamp"],
            "no stray returns": clean["package"], "beam's passes": walls["beam's passes"],
            "no clamp, beam's passes": walls["neither"], "these, range error 0.1": small["neither"],
            "range error 0.1, no stray returns": both["package"]}  # fmt: skip
cells_wide = {name: (beliefs > 0.5).sum(axis=1).mean() for name, beliefs in switched.items()}
for name, width in cells_wide.items():
    print(f"{name:<34} {width:.1f} cells")
excess = [cells_wide["as it is"] - width for width in cells_wide.values()]
np.testing.assert_allclose(excess[1:5], [1.0, 0.6, 0.5, 0.4], atol=0.05)
assert max(list(cells_wide.values())[-2:]) < 1.1
# %% jupyter={"source_hidden": true} alt="four bar charts of P(occupied) in eight cells after 20 scans of a wall in cell 4; as it is, the cells before and behind the wall are high, too, 2.5 cells in all; with a small range error only the wall stays high, 1.5 cells; without the clamp the cell before it drops, 1.9 cells; with the beam's passes both drop a little, 2.1 cells"
fig, axes = plt.subplots(2, 2, figsize=(7.6, 4.4), layout="constrained", sharex=True, sharey=True)
for ax, name in zip(axes.flat, ("as it is", "range error 0.1", "no clamp", "beam's passes"), strict=True):
    ax.bar(range(8), switched[name].mean(axis=0), color=["0.6"] * 4 + ["#0072b2"] + ["0.6"] * 3)
    ax.axhline(0.5, color="tab:red", linestyle="--", linewidth=1)
    ax.set_title(f"{name}: {cells_wide[name]:.1f} cells", fontsize=10)
fig.supxlabel("cell; the wall is in cell 4 (blue)", fontsize=10)
fig.supylabel("mean P(occupied)", fontsize=10)
plt.show()

# %% [markdown]
# By size: the range error adds 1.0 cell, the clamp 0.6, stray returns 0.5, the weak pass 0.4. That is more than the
# whole excess, because a wrong return and a grid that can't outweigh it need each other. With a small range error the
# wall is thin once the stray returns go, or the clamp and the weak pass.
#
# So walls get thick because returns fall into wrong cells, and because the clamp and the weak pass let them win. One
# number per cell, the idea that makes a grid cheap, is hardly to blame.
#
# ## Where this breaks: what is a second return worth?
#
# Adding needs independent scans. But take two returns of *one* scan. Both are placed with the same pose. If it is wrong by a
# cell, both returns are a cell off.

# %% tags=["pose-graph"] jupyter={"source_hidden": true} alt="a graph: three cells point to the two reflections r1 and r2, each reflection to a shaded range, z1 and z2; one pose error e points to both ranges, to z2 by a dashed arrow"
lecture_02_thick_walls.drawn_without_price().draw().set_title("one scan, two returns, one pose error", fontsize=10)
plt.show()

# %% [markdown]
# $r$ says which cell reflects a beam. The pose error $e$ points to both ranges. Even if you know every cell, a first range that is too long makes it likely
# that the second is too long. The grid deletes the dashed arrow, so for it the second return is a new witness.
#
# **Predict before you run.** A cell has P(occupied) = 0.2, and the pose an error of one cell. A return says "here", and
# exact inference gives 0.40. A second return of the same scan says "here", too. Is the right answer now near 0.45,
# 0.6 or 0.95?
#
# <details><summary>Answer</summary>
#
# 0.46. The second return makes it less likely that the first was a stray one. It says nothing new about the pose.
#
# </details>

# %% jupyter={"outputs_hidden": true}
counted = lecture_02_thick_walls.count_rings()
for n in (1, 2):
    exact, own, added = counted.exact[n - 1], counted.independent[n - 1], counted.package[n - 1]
    print(f"{n} return(s): exact {exact:.2f}, the grid {added:.2f}; exact if each return had its own error {own:.2f}")
assert (counted.package[:2].round(2) == (0.8, 0.97)).all()
assert (counted.exact[:2].round(2) == (0.40, 0.46)).all()
exactly = lecture_02_thick_walls.count_rings(noise=0.1, rings=2)  # switched off: hardly any pose error
print("with a pose error of 0.1 cells: exact", exactly.exact.round(2), "the grid", exactly.package.round(2))
np.testing.assert_allclose(exactly.exact, exactly.package, atol=0.02)

# %% [markdown]
# That is the price of this lecture. **The second return is worth 0.40 → 0.46, and the grid counts 0.80 → 0.97.** Two
# causes make this gap. Switch off the *shared* error: if each return had an error of its own, the second would be worth
# 0.17 instead of 0.06. But the grid would still say too much. Switch off the error itself: now the grid is nearly
# right. So it is too sure already after the first return, because it takes each range as exact, and then it
# takes the second return of the same pose for a new witness.
#
# Does this matter on a drive? A map is **calibrated** if it is right as often as it says. On the sample drive, which is
# simulated, we know what is in each cell. Compare what two returns promise with a trivial rule: give every cell with a
# return the same number, namely how often such cells are occupied.

# %%
sample = samples.sample_drive()
frames = [sample[k] for k in range(0, len(sample), 2)]
claim = np.stack(lecture_02_street.alone(frames, spec, sensor))
truth = np.stack([frame.labels.birdseye_on(spec) for frame in frames])
there, known = lecture_02_street.things(truth), truth != lecture_02_street.VEGETATION  # grass and hedges look alike
twice, hit = (known & (claim > low) for low in (0.99, 0.5))
print(f"two returns promise {claim[twice].mean():.3f}, right in {there[twice].mean():.2f}")
print(f"trivial rule: every cell with a return {there[hit].mean():.2f}")
assert there[twice].mean() < 0.95

# %% [markdown]
# The map promises one error in 250 cells and makes nearly twenty times as many. The trivial rule, one number for all, is closer to the
# truth. How much of this comes from shared errors, the drive can't tell us.
#
# Two failures no number repairs. Glass and black paint send nothing back, so a black car is a hole of unknown. And
# free isn't safe: a cell is free as soon as beams pass it at *one* height, whatever is below them.
#
# ## In five lines
#
# 1. A beam says free on its way, occupied at its end, nothing behind. Only the ratio of two likelihoods counts.
# 2. Log-odds add when the scans are independent given the cell. The prior counts once.
# 3. A clamp lets the map change its mind: at the fifth pass. A smear is a cell that waits for it, or that no beam
#    passes.
# 4. Walls get thick because of ranges taken as exact, the clamp, stray returns and the weak pass, in this order: each
#    was switched off alone.
# 5. A second return with the same error is worth 0.06, not 0.17. The grid is too sure already after the first.
#
# ## Further reading and exercise
#
# - Moravec, Elfes, *High resolution maps from wide angle sonar*, ICRA 1985: the first occupancy grid.
# - Elfes, *Using occupancy grids for mobile robot perception and navigation*, Computer, 1989.
# - Thrun, *Learning occupancy grid maps with forward sensor models*, Autonomous Robots 15, 2003: all cells together.
# - Hornung, Wurm, Bennewitz, Stachniss, Burgard, *OctoMap*, Autonomous Robots 34, 2013: the clamp.
#
# [Exercise 02](exercises/02_grids.ipynb): three cells and one beam exactly, the prior that counts once, a clamp for a
# given smear, one beam through a grid; and a grid that you write yourself, on both streets. Next: lecture
# [03](03_bof.ipynb), occupancy with velocity.

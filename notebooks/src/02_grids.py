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
# **Prerequisites.** Lectures [01](01_bayes.ipynb), Bayes' rule, and [01b](01b_graphical_models.ipynb), how to read a
# graph. Logarithms.
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
# marks **ghosts**: cells that the map calls occupied although at that moment they are empty road. (Free is greyer on
# the left, because one scan alone is less sure.)

# %% jupyter={"source_hidden": true} alt="animation, a real street from above: left, single scans with hardly a red cell; right, the map of all scans, in which red streaks grow in three lanes, A on the far left, B in the middle and C straight ahead; pink cells, most of them beyond C, have no label"
LETTERS = {"A": ((8.5, 18.0), (13.5, 22.0)), "B": ((4.0, 26.0), (-0.5, 23.0)), "C": ((0.3, 13.0), (4.5, 8.0)),
           "W": ((-7.8, 12.0), (-12.0, 14.5))}  # fmt: skip


def remembered():
    """Draw single scans beside the map, one frame of the animation after the other."""
    fig, axes = plt.subplots(1, 2, figsize=(7.4, 4.9), layout="compressed")
    for k in np.roll(np.arange(len(street)), 1):  # the last one first, because it is what a page on paper shows
        for ax, p, title in zip(axes, (scans[k], maps[k]), ("this scan alone", "all scans so far"), strict=True):
            ax.clear()
            ghost = (p > 0.5) & (truths[k] == ROAD)
            unlabelled = lecture_02_street.unjudged(p, scans[k], truths[k])
            draw(spec, p, ax, f"{title}, {street[k].time:.1f} s", ghost, ax is axes[1], unlabelled)
        lecture_02_street.note(axes[1], LETTERS)
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(remembered(), period=0.4, alt="red streaks grow in three lanes of the map; single scans have none")

# %%
area = [occupancy.smear_area(p, truths[-1] == ROAD, spec) for p in (scans[-1], maps[-1])]
print(f"ghosts after 1.8 s: {area[0]:.2f} m² in the last scan alone, {area[1]:.0f} m² in the map")
x, y = np.moveaxis(spec.centers(), -1, 0)
W = (x > 8) & (x < 14) & (y > -9) & (y < -6.5)  # twelve rows of cells
thick = [(np.array(p)[..., W] > 0.5).sum(axis=-1).mean() / 12 for p in (scans, maps[-1])]
print(f"wall W: {thick[0]:.1f} cells thick in a scan, {thick[1]:.1f} in the map")
assert area[1] > 70 > 2 > area[0]

# %% [markdown]
# There are ghosts in three lanes. In A cars come towards us. In B, the lane beside ours, cars drive away. In C the car
# ahead of us drives off. The wall at W gets only a little thicker; we come back to that.
#
# A car covers about 8 m², so the map has invented at least nine cars. *At least*, because we can judge only cells with a
# label, and where no beam comes there is hardly a label. Pink cells are occupied in the map but not in the last scan, and
# have no label. They are smear or real things; we can't know which.
#
# No single scan did that. The fault must be in how the map *adds*. To find it, we build such a map from its smallest parts.
#
# ## What does one beam say about a cell?
#
# Take two cells in a row. A beam passes the first and comes back from the second. Neither is certain: things
# fill a cell only in part, so a beam can pass an occupied cell. And a beam that an edge splits can
# come back from a free one. Here is what our sensor model says about each event:
#
# | what the beam did in the cell | if it is occupied | if it is free |
# |---|---|---|
# | it **passed** | 0.3 | 0.7 |
# | it **came back** | 0.8 | 0.05 |
# | it never got there | 1 | 1 |
#
# No column adds up to 1, because each row is a separate question about a different event. Bayes' rule needs only the
# ratio in a row. But a pass counts little here, and that is a choice. It will cost us something at the
# walls.
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
# Bayes' rule divides by the sum of the two, so only their ratio matters. With $z$ for the scan:
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

# %% jupyter={"source_hidden": true} alt="left, a beam through five cells, whose colours go from light for passed through dark for the return to grey behind it; right, the first scan of the street, with S in a grey shadow behind a car"
fig, (ax, street_ax) = plt.subplots(1, 2, figsize=(7.6, 4.6), layout="constrained", width_ratios=(1, 3))
p = (occupied / (occupied + free))[::-1, None]
ax.imshow(plotting.occupancy_colours(plotting.binary_states(p)), extent=(-0.5, 0.5, 0, 5), aspect="equal")
ax.annotate("", (0, 3.5), (0, 0), arrowprops={"arrowstyle": "->", "color": "tab:orange", "linewidth": 2.5})
for k, one in enumerate(p[::-1, 0]):
    ax.text(0.6, k + 0.5, f"{one:.2f}", va="center", fontsize=10)
ax.set(title="one beam", xticks=[], ylabel="x, forward [m]")
draw(spec, scans[0], street_ax, "one scan of the street")
street_ax.set(ylim=(0, 50))
lecture_02_street.note(street_ax, {"S": ((12, 19), (11, 27))})
plt.show()

# %% [markdown]
# At S no beam arrives, because a car is in the way: the cells stay unknown. So one beam says *free* on its way,
# *occupied* at its end, and nothing behind.
#
# ## How do two scans add up?
#
# One cell, believed occupied with 0.5. A first beam comes back from it, and then a second one. For round numbers, say that a
# return is three times as likely if the cell is occupied. Count in **odds**, occupied to free. They go from 1 to 3 and
# then to 9, so P(occupied) is 9/10.
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

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a graph: one cell m, free or occupied, with arrows to two shaded scans z1 and z2, in a box that stands for many cells"
fork = lecture_02_cell.one_log_odds_cell(lecture_02_cell.read_scans("#."))
lecture_02_cell.as_the_grid(fork).draw().set_title("the model in which adding is exact", fontsize=10)
plt.show()

# %% [markdown]
# Adding is Bayes' rule, without any error, in the model above. It assumes three things, and each will fail.
#
# - *Given the cell, the scans are independent*: nothing but $m$ joins $z_1$ and $z_2$.
# - *The cell stays what it is.* There is one $m$ for all scans, so the grid has no node for the cell later and no table
#   of how a cell changes.
# - *Each cell has scans of its own.* This is hidden in the frame, which stands for many such cells side by side. But one beam crosses many of
#   them.
#
# **And the prior?** It is the first $L$, and it counts once. Some sensor models return $P(\text{occupied} \mid z)$
# instead of two likelihoods. Such an **inverse sensor model** has the prior inside each answer, so you must subtract
# its log-odds, $L_0$, from each answer before you add.
#
# Suppose that in a car park P(occupied) = 0.2. An inverse model says 0.2 about a cell that it can't see. Somebody adds ten
# such answers and forgets to subtract. The prior then counts eleven times, and the map is certain that the cell is
# free, after ten scans that said nothing.
#
# So log-odds add as long as each scan brings only what is new.
#
# ## Can a map change its mind?
#
# A car is parked for ten seconds. Each of 100 scans adds at least 2.77 to a cell, so $L$ reaches 277. Then the car leaves. Each pass
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
        ratio = (0.8, 0.05) if 10 <= k < 15 else (p_pass_occupied, 0.7)
        L = take_in(L, *ratio, L_min, log_odds(highest))
        p.append(probability(L))
    return p


def draw_cell(ax, **dials):
    """Draw the history of the cell."""
    ax.axvspan(0.95, 1.45, color="tab:red", alpha=0.15, label="the car is there")
    ax.axhline(0.5, color="0.6", linewidth=1)
    ax.plot(np.arange(40) / 10, one_cell(**dials), ".-", color="black")
    ax.set(ylim=(0, 1.02), xlabel="time [s]", ylabel="P(occupied)")


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="P(occupied) of a cell over four seconds, three panels: with the clamp it falls below one half five passes after the car has left, without its upper limit after fifteen, and after eight where a beam often passes an occupied cell"
settings = {
    "with the clamp": {},
    "no upper limit": {"highest": 1 - 1e-9},
    "a pass is worth less": {"p_pass_occupied": 0.45},
}
fig, axes = plt.subplots(1, 3, figsize=(10, 2.8), layout="constrained", sharey=True)
cells = [one_cell(**dials) for dials in settings.values()]
freed = [next(k for k in range(15, 40) if p[k] < 0.5) - 14 for p in cells]
for ax, (name, dials), n in zip(axes, settings.items(), freed, strict=True):
    draw_cell(ax, **dials)
    ax.set_title(f"{name}: {n} passes", fontsize=10)
    ax.label_outer()
axes[0].legend(fontsize=8, loc="upper right")
plt.show()
assert freed == [5, 15, 8]


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
# three times as many passes. On the right a beam often passes an occupied cell, so a pass is worth less: the cell
# is freed at the eighth pass. (The dials work with a running kernel. What a low clamp costs, you will see on the street.)
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
# Beams pass the tail of the car that drives away. The rear of this car is in each cell for one scan only. But two of its
# returns count there: -1.99 + 2 · 2.77 is above the clamp, so the cell is at 3.48. It survives four passes, and the car
# covers a metre from pass to pass. So this tail grows to four metres and no further. The tail of the car that comes is hidden behind the car itself. No beam passes there, so nothing is taken back.
# Only its front sends returns. It has marked 20 m of road, and the car covers the last four itself. Its tail is 16 m long,
# and grows as long as the car's shadow covers its lane.
#
# </details>


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
single = occupancy.LogOddsParams(sensor=fast.SensorModel(max_returns=1))
never, fades, ones = ([np.zeros(toy.shape)] for _ in range(3))
for k in range(43):
    points = lecture_02_boxes.scan_boxes(list(two_cars(k / 10)), columns=600)
    scan = occupancy.scan_evidence(points, toy, sensor)
    never.append(occupancy.update_log_odds(never[-1], scan, params))
    fades.append(occupancy.update_log_odds(forget(fades[-1], dt=0.1, tau=0.5), scan, params))
    one = occupancy.scan_evidence(points, toy, single.sensor)  # at most one return of a scan counts in a cell
    ones.append(occupancy.update_log_odds(ones[-1], one, single))


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="animation of two cars seen from above: without forgetting, the car that drives away drags a short dark tail, and the oncoming one a long tail that shrinks again when the car is near; with forgetting, the second tail fades to grey"
def two_memories():
    """Draw the grid that never forgets beside the one that does."""
    fig, axes = plt.subplots(1, 2, figsize=(5.8, 5), layout="compressed")
    fig.supxlabel("light: free, dark: occupied, grey: unknown;\nred frames: where the cars are", fontsize=9)
    for k in (30, 36, 42, 0, 6, 12, 18, 24):  # first what a page on paper shows
        for ax, L, title in zip(axes, (never[k + 1], fades[k + 1]), ("never forgets", "memory 0.5 s"), strict=True):
            ax.clear()
            draw(toy, probability(L), ax, f"{title}\n{k / 10:.1f} s")
            for car in two_cars(k / 10):
                size = car.y_max - car.y_min, car.x_max - car.x_min
                ax.add_patch(plt.Rectangle((car.y_min, car.x_min), *size, fill=False, edgecolor="tab:red"))
        yield fig
        fig.set_layout_engine("none")  # only the first frame is laid out


plotting.animate(
    two_memories(), period=0.6, alt="the tail of the oncoming car grows, then shrinks; where the grid forgets, it fades"
)


# %% jupyter={"source_hidden": true}
def tails(t, history=never):
    """Return how long the tails of the two cars are after t seconds, metres, and the area of the first, m²."""
    x, (away, coming), L = toy.centers()[..., 0], two_cars(t), history[round(10 * t) + 1]
    behind = lecture_02_boxes.cells_in(away._replace(x_min=0, x_max=away.x_min), toy) & (L > 0)
    beyond = lecture_02_boxes.cells_in(coming._replace(x_min=coming.x_max, x_max=60), toy) & (L > 0)
    return away.x_min - x[behind].min(), x[beyond].max() - coming.x_max, behind.sum() * toy.cell**2


for t in (2, 3, 4):
    print(f"tails after {t} s: {tails(t)[0]:.0f} m where beams pass, {tails(t)[1]:.0f} m behind the oncoming car")
print(f"area of the first tail after 2 s: {tails(2)[2]:.1f} m²; if one return counts, {tails(2, ones)[2]:.1f} m²")
np.testing.assert_allclose(tails(2)[:2], [4, 16], atol=toy.cell / 2)
np.testing.assert_allclose([tails(3)[1], tails(4)[1]], [25, 18], atol=toy.cell)

# %% [markdown]
# The last line switches off the second return. One return doesn't take a free cell to the clamp, so the first tail is
# nearly gone.
#
# The oncoming tail doesn't grow for ever. When the car is close, its shadow swings aside, and beams free the old lane:
# the tail shrinks. (The tails are striped, because mostly one side of a car sends returns, and the car
# moves by two cells between scans.)
#
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
# *waits*. Here, unlike in the toy, there are only five scans a second, so five passes take a whole second.

# %% jupyter={"source_hidden": true} alt="the street from above with its ghosts in two colours: dark red without a pass since the last return, orange with one to four passes, and pink the cells without a label; lane B is half dark red, lanes A and C are mostly orange, and beyond C and B nearly all is pink"
ghost = (maps[-1] > 0.5) & (truths[-1] == ROAD)
passes = lecture_02_street.passes_since_return(scans)
fig, ax = plt.subplots(figsize=(5.8, 5.2), layout="compressed")
unlabelled = lecture_02_street.unjudged(maps[-1], scans[-1], truths[-1])
lecture_02_street.draw_ghosts(spec, maps[-1], ax, ghost & (passes <= 0), ghost & (passes > 0), unlabelled)
lecture_02_street.note(ax, {letter: LETTERS[letter] for letter in "ABC"})
plt.show()

# %%
cell_area, unlabelled = spec.cell**2, unlabelled & (y >= -2) & (y < 13)
print("m²       ghosts: hidden  waiting   no label: hidden  waiting")
for lane, right, left in (("A", 5.5, 13), ("B", 2, 5.5), ("C", -2, 2), ("all", -2, 13)):
    here = (y >= right) & (y < left)
    kinds = [cells & here & side for cells in (ghost, unlabelled) for side in (passes <= 0, passes > 0)]
    found = [cells.sum() * cell_area for cells in kinds]
    print(f"lane {lane:<3} {found[0]:15.0f} {found[1]:8.0f} {found[2]:18.0f} {found[3]:8.0f}")
assert 23 < found[0] < 25 < 48 < found[1] < 51 < 64 < found[2] < 66

# %% [markdown]
# Of the ghosts, a third are hidden. But nearly all cells without a label are hidden, too. If those are smear, hidden cells
# are the larger part. So hiding makes between a third and two thirds of the smear. We can't know it better from these
# labels.
#
# Now switch off each cause alone. *Waiting*: with an upper limit of P = 0.62 one pass frees a cell. *Hiding*: from its
# last return on, each cell gets a pass in every scan. A cell at the limit is free after five. Beside them is the other remedy,
# forgetting, and two trivial rules: call everything free, and trust only the last scan.

# %%
thing = lecture_02_street.things(truths[-1])
low = lecture_02_street.add_up(street, spec, sensor, highest=0.62)[-1]
faded = lecture_02_street.add_up(street, spec, sensor, tau=0.5)[-1]
rules = {"always free": 0 * faded, "last scan alone": scans[-1], "all scans": maps[-1],
         "upper limit 0.62": low, "memory of 0.5 s": faded}  # fmt: skip
found = {}
print("m²                ghosts  hidden  waiting  no label  things found")
for name, p in rules.items():
    red, pink = (p > 0.5) & (truths[-1] == ROAD), (p > 0.5) & unlabelled
    kinds = red, red & (passes <= 0), red & (passes > 0), pink, thing & (p > 0.5)
    found[name] = [cells.sum() * cell_area for cells in kinds]
    print("{:<16} {:7.0f} {:7.0f} {:8.1f} {:9.0f} {:9.0f}".format(name, *found[name]))
since = np.argmax([p > 0.5 for p in scans[::-1]], axis=0)  # scans since the last return
left = [(cells & (since < 5)).sum() * cell_area for cells in (ghost, unlabelled)]
print(f"if nothing were hidden: {left[0]:.0f} m² of ghosts, {left[1]:.0f} m² without a label")
dark = [((p > 0.75) & (passes <= 0) & ghost).sum() * cell_area for p in (maps[-1], faded)]
print(f"hidden ghosts that are dark (P > 0.75): {dark[0]:.0f} m², with a memory of 0.5 s {dark[1]:.0f} m²")
assert 50 < (ghost & (since < 5)).sum() * cell_area < 55
assert found["upper limit 0.62"][2] < 1 < 45 < found["all scans"][2]
assert found["memory of 0.5 s"][4] > 0.98 * found["all scans"][4]

# %% [markdown]
# Both causes matter. If nothing were hidden, most ghosts would remain, but less than half of the cells without a label. If
# one pass were enough, only a third of the ghosts would remain, but nearly all cells without a label.
#
# The low limit removes nearly every waiting ghost. Its price is a few lost things. Adding itself finds a third more things
# than the last scan, but part of that is smear inside the moving cars.
#
# Forgetting frees waiting cells sooner. A hidden cell fades towards "don't know" but never below it, so it still
# counts as P > 0.5. But only about a third of them are still dark, instead of nearly all. In this model a cell is the
# same for ever, so **it can't say "was occupied, and the thing drove on"**. Lecture [03](03_bof.ipynb) gives a cell a
# state at each scan, and a velocity.
#
# ## Why do walls get thick?
#
# Nothing moves now. The wall at W grew from 1.2 cells in a scan to 1.5 in the map. Take a wall that we know: it is one cell
# thick. We scan it 20 times, with an error of half a cell in range and pose together. Of three cells, the wall's and its two
# neighbours, the package's grid then calls 2.1 occupied. Why?
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
# a **collider** ([graphical models](01b_graphical_models.ipynb)). So our first suspect is that the grid drops this link. We
# restore it and see: infer all $2^8$ maps of a row of eight cells together, and compare with cell by cell. Both know how
# large the range error is, which the package doesn't.

# %% tags=["thick-walls"]
walls = lecture_02_thick_walls.thick_walls()  # 600 random sequences of 20 scans
wide = lecture_02_thick_walls.thick_walls(noise=1.0)
for error, beliefs in ((0.5, walls), (1.0, wide)):
    thickness = {
        name: (beliefs[name][:, 3:6] > 0.5).sum(axis=1).mean() for name in ("exact", "cell by cell", "package")
    }
    print(
        f"error of {error} cells:",
        ", ".join(f"{name} {cells:.1f}" for name, cells in thickness.items()),
        "cells occupied",
    )
    assert (
        0
        < thickness["cell by cell"] - thickness["exact"]
        < 0.4
        < 0.9
        < thickness["package"] - thickness["cell by cell"]
    )

# %% [markdown]
# The suspect is nearly innocent. Forgetting the link costs a tenth of a cell here, and a third of a cell if the error is as
# large as a cell. The package's grid is too thick by far more. There are four more suspects.
#
# - **The range error.** A return that is too long falls into the cell behind the wall, one that is too short into the
#   cell before it. The grid takes each range as exact.
# - **No passes behind the wall.** A wrong return there stays, because the wall stops the beams that could take it back:
#   a pass it must have.
# - **The lower limit of the clamp.** However many beams have passed, one wrong return makes the cell occupied again, until
#   the next pass.
# - **The weak pass.** The beams of this world pass a free cell in 95 % of cases, but the grid calculates with 70. So it
#   needs more passes to outweigh one return.
#
# Switch off each of them alone. (For the second, each cell behind the wall gets a pass in every scan that has no return in
# it.)

# %%
small = lecture_02_thick_walls.thick_walls(noise=0.1)
switched = {"as it is": walls["package"], "range error 0.1": small["package"], "passes behind wall": walls["passes behind"],
            "no lower limit": walls["no lower limit"], "beam's own passes": walls["beam's passes"]}  # fmt: skip
share = {name: (beliefs > 0.5).mean(axis=0) for name, beliefs in switched.items()}
print("share of runs     before  wall  behind   cells in all")
for name, cells in share.items():
    print("{:<18} {:5.2f} {:5.2f} {:7.2f} {:10.1f}".format(name, *cells[3:6], cells[3:6].sum()))
excess = [share["as it is"][3:6].sum() - cells[3:6].sum() for cells in share.values()]
np.testing.assert_allclose(excess[1:], [1.0, 0.5, 0.3, 0.3], atol=0.06)
# %% jupyter={"source_hidden": true} alt="four bar charts of the share of runs in which each of eight cells is called occupied, with the wall in cell 4, and an outline of the shares as it is, where the cell behind the wall is occupied in most runs and the cell before it in a third; with a small range error only the wall is left; with passes behind the wall the cell behind falls to a quarter; without the lower limit or with the beam's own passes mostly the cell before the wall falls"
fig, axes = plt.subplots(2, 2, figsize=(7.6, 4.6), layout="constrained", sharex=True, sharey=True)
for ax, name in zip(axes.flat, list(share)[1:], strict=True):
    bars = ax.bar(range(8), share[name], color=["0.6"] * 4 + ["#0072b2", "#e69f00"] + ["0.6"] * 2)
    bars[5].set_hatch("//")
    outline = ax.bar(range(8), share["as it is"], fill=False, edgecolor="black", linewidth=1.2)
    ax.set_title(f"{name}: {share[name][3:6].sum():.1f} cells", fontsize=10)
axes[0, 0].legend([outline, bars[4], bars[5]], ["as it is", "wall", "behind it"], fontsize=8, loc="upper left")
fig.supxlabel("cell; the sensor is on the left", fontsize=10)
fig.supylabel("share of runs with P > 0.5", fontsize=10)
plt.show()

# %% [markdown]
# The wall grows mostly backwards, in cell 5. There the missing passes matter: with them, two thirds of that bar are gone.
# Cell 3, before the wall, has passes already. There the low limit lets wrong returns win, and the weak pass helps.
# Without the range error hardly anything is in a wrong cell. (The causes overlap, so their effects don't simply add up.
# The small bars farther away are speckle, not thickness, so the sums leave them out.)
#
# So a thick wall and the smear of a car have one cause in common: nothing takes a return back where no beam passes. One
# number per cell, the idea that makes a grid cheap, is hardly to blame at this error.
#
# ## Where this breaks: what is a second return worth?
#
# Adding needs independent scans. But take two returns of *one* scan. Both are placed with the same pose. If it is wrong by a
# cell, both returns are a cell off.

# %% tags=["pose-graph"] jupyter={"source_hidden": true} alt="a graph: three cells point to the two reflections r1 and r2, each reflection to a shaded range, z1 and z2; one pose error e has dashed arrows to both ranges"
lecture_02_thick_walls.drawn_without_price().draw().set_title(
    "one scan, two returns, one pose error; dashed: not in the grid", fontsize=10
)
plt.show()

# %% [markdown]
# Read it from above. The cells $m$ decide which of them reflects a beam: that is $r$. The range $z$ measures where that
# cell is, but it's wrong by the pose error $e$, which both ranges share. So even if you know every cell, a first range that is
# too long makes it likely that the second is too long. The grid has no $e$ at all (both arrows are dashed), so for it
# the second return is a new witness.
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
    print(f"{n} return(s): exact {counted.exact[n - 1]:.2f}, the grid {counted.package[n - 1]:.2f}")
assert (counted.exact[:2].round(2) == (0.40, 0.46)).all()
print("what the second return is worth, in log-odds")
for error in (1.0, 0.5, 0.1):
    two = lecture_02_thick_walls.count_rings(noise=error, rings=2)
    shared, own = (np.diff(log_odds(p))[0] for p in (two.exact, two.independent))
    print(f"pose error of {error} cells: {shared:.2f}; if each return had its own error, {own:.2f}")

# %% [markdown]
# With a pose error of one cell **the second return is worth 0.25 in log-odds, and the grid adds 2.77.** Two causes make
# this gap. Switch off the *sharing*: with errors of their own, the second return would be worth 0.70. Switch off the
# *error*: with hardly any, it is worth what the grid adds. So the number depends on the error.
#
# And on a drive? On the sample drive, which is simulated, we know what is in each cell. Take cells that one scan calls
# occupied, and compare those with one return and with two. (Vegetation is left out, because its label doesn't tell
# grass from hedges.)

# %%
sample = samples.sample_drive()
frames = [sample[k] for k in range(len(sample))]
claim = np.stack(lecture_02_street.alone(frames, spec, sensor))
truth = np.stack([frame.labels.birdseye_on(spec) for frame in frames])
there, known = lecture_02_street.things(truth), truth != lecture_02_street.VEGETATION
twice, once = known & (claim > 0.99), known & (claim > 0.5) & (claim <= 0.99)
far, table = np.digitize(np.hypot(x, y), [10, 20, 30, 40]), []
for band, name in enumerate(("0-10 m", "10-20 m", "20-30 m", "30-40 m", "40 m on")):
    one, two = there[once & (far == band)], there[twice & (far == band)]
    table.append((len(one), one.mean(), two.mean()))
    print(
        f"{name:<8} right: {one.mean():.2f} of {len(one):3} with one return, {two.mean():.2f} of {len(two):4} with two"
    )
n, one, two = np.array(table).T
crude = log_odds(there[twice].mean()) - log_odds(there[once].mean())
equal = log_odds(np.average(two, weights=n)) - log_odds(np.average(one, weights=n))
print(f"the second return is worth {abs(crude):.1f} for all cells together, {equal:.1f} at equal distance")
assert abs(crude) < 0.05 < 0.4 < equal < 0.6

# %% [markdown]
# Taken all together, the second return seems to be worth nothing. But cells with two returns are nearer, and within 20 m
# more cells are wrong. So hold the distance: weight the bands of both kinds alike. Now the second return is worth about a half.
# (In the nearest band it is the other way round, but few cells there have one return.) One short drive can't tell this
# number exactly. But it is far from 2.77.
#
# Two failures no number repairs. Glass and black paint send nothing back, so a black car is a hole of unknown. And
# free isn't safe: a cell is free as soon as beams pass it at *one* height, whatever is below them.
#
# ## In five lines
#
# 1. A beam says free on its way, occupied at its end, nothing behind. Only the ratio of two likelihoods counts.
# 2. Log-odds add when the scans are independent given the cell. The prior counts once.
# 3. A clamp lets the map change its mind: at the fifth pass. A smear waits for it, or no beam passes, or both.
# 4. Walls get thick because ranges are taken as exact. Behind the wall no beam takes a wrong return back; before it the
#    lower limit lets it win.
# 5. The grid adds 2.77 for a second return. In the toy, with a shared pose error of one cell, it is worth only 0.25; with
#    hardly any error the grid is right.
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

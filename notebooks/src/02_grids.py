# %% [markdown]
# # 02 · Occupancy grids: evidence, log-odds, and the smear behind a moving car
#
# **In one sentence.** Give every cell of a map the Bayes filter of lecture 01, let each beam of a LIDAR vote *free*
# on its way and *occupied* at its end, add the votes up as log-odds, and you have a map of what stands where; but not
# of what moves.
#
# **You will be able to**
# - say what one beam tells of every cell that it meets, in numbers;
# - turn a scan into evidence in two ways, and say why the fast one needs no loop over rays;
# - decide what an obstacle is where the ground isn't flat;
# - update a map of log-odds by hand, count the prior once, and choose a clamp;
# - predict how long a smear a moving car leaves, and which smear stays for ever.
#
# **Prerequisites.** Lecture 00 (the grid, Bayes' rule) and lecture 01 (predict, update). Logarithms.
#
# **Time.** 110 minutes, of which the computer needs less than one.
#
# **Paper.** Section 3.2, step 2, the sensor model; it builds on Moravec and Elfes (1985) and Elfes (1989).
#
# ```
# scan ── which returns are obstacles? ──▶ evidence P(z | cell) ── + ──▶ log-odds map ──▶ P(occupied)
#                                                                  ▲          │
#                                                                  └── moved ─┘
# ```

# %%
from dataclasses import replace
from time import process_time

import matplotlib.pyplot as plt
import numpy as np
from filterpy import discrete_bayes
from ipywidgets import FloatSlider, interact
from scipy import ndimage

from semgrid_edu import plotting
from semgrid_edu.datasets.samples import sample_drive
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.occupancy import (
    LogOddsGrid,
    LogOddsParams,
    PlanarMotion,
    SensorModel,
    log_odds,
    probability,
    scan_evidence,
    scan_evidence_literal,
    smear_area,
    update_log_odds,
)

# %%
from semgrid_edu.occupancy.evidence import Evidence
from semgrid_edu.occupancy.literal.evidence import walk_ray
from semgrid_edu.occupancy.literal.evidence import walk_sector
from semgrid_edu.occupancy.polar import beyond_reach
from semgrid_edu.workshop.illustrations.boxes import Box, cells_in, scan_boxes
from semgrid_edu.workshop.simulation.drive import SimulatedDrive
from semgrid_edu.workshop.simulation.named_streets import named_street
from semgrid_edu.workshop.simulation.things.materials import Kind
from semgrid_edu.workshop.simulation.street.plan import Wishes

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI


def draw(spec, p, ax, title, mark=None):
    """Draw P(occupied): free light, occupied dark, grey where nothing is known; marked cells red."""
    nothing = np.zeros_like(p)
    plotting.occupancy(spec, np.stack([1 - p, p, nothing, nothing]), ax=ax, legend=False).set_title(title)
    if mark is not None:
        red = np.ma.masked_where(~mark, np.ones(spec.shape))
        ax.imshow(red, extent=ax.images[0].get_extent(), cmap="autumn_r", vmin=0, vmax=1, interpolation="nearest")


sensor, spec, drive = SensorModel(), GridSpec.compact(), sample_drive()
frames = [drive[k] for k in range(len(drive))]

# %% [markdown]
# ## From one cell to a grid: a convenient lie
#
# Lecture 01 filtered one thing: where am I on this line? A map asks a question of each of its cells: occupied, or
# free? Take two cells side by side, `a` and `b`. In this town walls are long: both cells are wall with probability
# 0.4, neither with 0.4, only one of them with 0.1 each. A beam comes back from `a`: likely if `a` is occupied (0.8),
# unlikely if it is free (0.2).
#
# **Predict before you run.** Before the beam, each cell is occupied with probability 0.5. And after it? Of `a`; and
# of `b`, where no beam has been?
#
# <details><summary>Answer</summary>Multiply: both 0.4 · 0.8 = 0.32, only a 0.1 · 0.8 = 0.08, only b 0.1 · 0.2 = 0.02,
# neither 0.4 · 0.2 = 0.08. The sum is 0.5. So a is occupied with (0.32 + 0.08) / 0.5 = 0.8, and b with (0.32 + 0.02)
# / 0.5 = 0.68: the beam on a says something of b.</details>
#
# An occupancy grid doesn't keep the four joint probabilities. It keeps one number a cell and *assumes* that cells are
# independent, given the scans $z_1 \ldots z_t$. With $O_c$ for "cell $c$ is occupied":
#
# $$ P(O_a, O_b, \ldots \mid z_1 \ldots z_t) = \prod_c P(O_c \mid z_1 \ldots z_t) $$

# %%
joint = np.array([0.4, 0.1, 0.1, 0.4])  # both, only a, only b, neither
came_back = np.array([0.8, 0.8, 0.2, 0.2])
posterior = joint * came_back / (joint * came_back).sum()
np.testing.assert_allclose(posterior, discrete_bayes.update(likelihood=came_back, prior=joint))
print(f"jointly:      P(a) = {posterior[0] + posterior[1]:.2f}   P(b) = {posterior[0] + posterior[2]:.2f}")
print(f"cell by cell: P(a) = {0.5 * 0.8 / (0.5 * 0.8 + 0.5 * 0.2):.2f}   P(b) = 0.50")

# %% [markdown]
# The lie buys a lot: the course's grid has 142 x 62 = 8804 cells, so 8804 numbers instead of $2^{8804}$. How big a
# lie is it? On the sample drive, take the cells of which a scan says anything, and ask how many are hit: of all; and
# of those whose neighbour is hit.

# %%
hits = hits_of_pairs = known = pairs = 0
for frame in frames:
    scan = scan_evidence(frame.points_grid, spec, sensor)
    seen, hit = scan.occupied != scan.free, scan.occupied > scan.free
    both_seen = seen[:, 1:] & seen[:, :-1]
    known, hits = known + seen.sum(), hits + hit.sum()
    pairs += (both_seen & hit[:, :-1]).sum()
    hits_of_pairs += (both_seen & hit[:, :-1] & hit[:, 1:]).sum()
print(f"hit: {100 * hits / known:.0f} % of all cells, {100 * hits_of_pairs / pairs:.0f} % of those beside a hit one")

# %% [markdown]
# Independent cells would give the same number twice. Walls, fences and cars don't come in single cells, so the grid
# never fills the gap between two hits of one wall: it waits until a beam gets there. Keep the lie in mind; the
# section "Where this breaks" presents the bill.
#
# ## One beam over five cells
#
# Five cells of one metre in a row. A beam comes back after 3.5 m. What does it say of each?
#
# | cell | what happened | if occupied | if free |
# |---|---|---|---|
# | 0-1 m, 1-2 m, 2-3 m | the beam **passed** | 0.3: an object fills a cell in part, foliage is porous | 0.7 |
# | 3-4 m | it **came back** | 0.8 | 0.05: a grazing ray, a mixed pixel |
# | 4-5 m | it never got there | 1 | 1 |
#
# **Predict before you run.** All five cells start at P(occupied) = 0.5. Where are they after this beam?
#
# <details><summary>Answer</summary>Free, free, free, occupied, unseen: 0.3 / (0.3 + 0.7) = 0.30 for the first three,
# 0.8 / (0.8 + 0.05) = 0.94 for the fourth, and still 0.50 for the fifth, where both likelihoods are the
# same.</details>
#
# Only the ratio of the two matters, for Bayes' rule normalises. It is the whole sensor model:
#
# $$ \frac{P(z \mid \text{occupied})}{P(z \mid \text{free})} =
#    \begin{cases} 0.3 / 0.7 & \text{before the return} \\ 0.8 / 0.05 & \text{at the return} \\
#    1 & \text{behind it} \end{cases} $$


# %% tags=["sensor-model"]
def one_beam(length, n_cells, cell):
    """Return P(z | occupied) and P(z | free) of the cells along a beam that comes back after `length` metres."""
    occupied, free = np.ones(n_cells), np.ones(n_cells)
    for k in range(n_cells):
        if (k + 1) * cell <= length:
            occupied[k], free[k] = sensor.p_pass_occupied, sensor.p_pass_free
        elif k * cell <= length:
            occupied[k], free[k] = sensor.p_hit_occupied, sensor.p_hit_free
    return occupied, free


occupied, free = one_beam(length=3.5, n_cells=5, cell=1.0)
column = GridSpec(x_min=0, x_max=5, y_min=-0.5, y_max=0.5, cell=1)
package = scan_evidence_literal(np.array([[3.5, 0.0, 1.0]]), column, sensor)  # one return, 1 m above the ground
np.testing.assert_allclose(occupied, package.occupied[::-1, 0])  # row 0 is the farthest ahead
np.testing.assert_allclose(free, package.free[::-1, 0])
print("P(occupied):", (0.5 * occupied / (0.5 * occupied + 0.5 * free)).round(2))

# %% [markdown]
# Four rules of the package that five cells don't show. A cell that is passed by one beam and hit by another is hit:
# an object fills a cell in part. Two returns count twice, but not more, however many there are: neighbouring returns
# share their errors. A ground return frees its cell, unless it lies within 5 m behind an obstacle: then the beam may
# have come through under a car. And a beam that never comes back says *nothing*: it may have met black paint, glass
# or the sky.
#
# ### A beam across the grid
#
# A beam seldom runs along a column. Put the vehicle at a corner of four cells of 1 m and let a return come from 3.3 m
# ahead, 1.4 m to the left.
#
# **Predict before you run.** How many cells does the beam touch? Count lines, not cells.
#
# <details><summary>Answer</summary>It begins in one cell and enters another at each line that it crosses: the lines x
# = 1, 2, 3 and y = 1. So 1 + 4 = 5 cells.</details>
#
# The most literal way to find them takes steps of a millimetre. The package's `walk_ray` jumps from line to line
# instead.


# %%
def walk(spec, x, y):
    """List the cells between the origin and a point, nearest first, by steps of a millimetre."""
    cells, steps = [], int(1000 * np.hypot(x, y))
    for k in range(steps):
        along = (k + 0.5) / steps
        row = int((spec.x_max - along * x) / spec.cell)
        col = int((spec.y_max - along * y) / spec.cell)
        if (row, col) not in cells:
            cells.append((row, col))
    return cells


small = GridSpec(x_min=0, x_max=5, y_min=-2, y_max=3, cell=1)
touched = walk(small, 3.3, 1.4)
rows, cols, leaves_at = walk_ray(small, start=(0, 0), azimuth=np.arctan2(1.4, 3.3), length=np.hypot(3.3, 1.4))
np.testing.assert_array_equal(touched, np.stack([rows, cols], axis=1))
print(len(touched), "cells, left after", leaves_at.round(2), "m")

# %%
picture = np.full(small.shape, 0.5)
picture[rows[:-1], cols[:-1]] = 0.3
picture[rows[-1], cols[-1]] = 0.94
fig, ax = plt.subplots(figsize=(4, 4), layout="compressed")
draw(small, picture, ax, "light 0.30, grey 0.50, dark 0.94")
ax.plot([0, 1.4], [0, 3.3], "o-", color="tab:red", markersize=4)
crossings = leaves_at[:-1, None] * np.array([1.4, 3.3]) / np.hypot(3.3, 1.4)
ax.plot(*crossings.T, "x", color="tab:red")
ax.set(xticks=range(-2, 4), yticks=range(6))
ax.grid(color="0.7", linewidth=0.5)
plt.show()

# %% [markdown]
# The colours are P(occupied) after this one beam; crosses mark where it enters a new cell. In the cell at 2 to 3 m
# ahead and 0 to 1 m to the left it stays for 0.4 m only: passed all the same.
#
# ## A whole scan: walk every ray, or look every cell up
#
# A real scan has 120,000 returns. The literal twin walks one ray for each beam of 0.3 degrees. The fast one turns the
# question round: it doesn't ask a ray for its cells but **each cell for its beam**. In polar coordinates a scan is
# one number a beam, its *reach*: the range of its first obstacle, or of its last ground return when it has none. A
# cell is passed when it ends before the reach of its beam.
#
# By hand: a wall ahead, 10 m away. The cell centred at x = 9.25 m ends, with half a metre a side, at 9.5 m: passed.
# The one at 9.75 m ends at 10 m: passed, just so. The one at 10.25 m isn't.
#
# $$ \text{passed} \iff \sqrt{x^2 + y^2} + \tfrac12\,\text{cell} \le
#    \text{reach}\left(\operatorname{atan2}(y, x)\right) $$


# %%
def look_up(reach, spec):
    """Ask each cell for its beam: does the beam pass it from end to end?"""
    passed = np.zeros(spec.shape, bool)
    for row, col in np.ndindex(spec.shape):
        x, y = spec.centers()[row, col]
        beam = int((np.arctan2(y, x) + np.pi) / (2 * np.pi) * len(reach))
        passed[row, col] = np.hypot(x, y) + spec.cell / 2 <= reach[beam]
    return passed


street = [Box.around(14.2, 3.2, 4, 2, 1.5), Box(24.2, 24.7, -7, 7, 2.0)]  # a car, 14 m ahead on the left, and a wall
block = GridSpec(x_min=0, x_max=30, y_min=-10, y_max=10, cell=0.5)
points = scan_boxes(street, columns=600)
reach = sensor.scan(points).reach
passed = look_up(reach, block)
beyond = beyond_reach(reach, block.shape, block.x_max, block.y_max, block.cell, 0.0, 0.0, 0.0)
np.testing.assert_array_equal(passed, beyond <= -block.cell / 2)
print(f"{len(points)} returns, {np.count_nonzero(reach)} beams that see something, {passed.sum()} cells passed")

# %%
fast, literal = scan_evidence(points, block, sensor), scan_evidence_literal(points, block, sensor)
differ = (fast.occupied != literal.occupied) | (fast.free != literal.free)
p = fast.occupied / (fast.occupied + fast.free)
fig, axes = plt.subplots(1, 3, figsize=(10, 4), layout="constrained", width_ratios=(1.3, 1, 1))
beam_azimuth = (np.arange(sensor.beams) + 0.5) / sensor.beams * 360 - 180
axes[0].plot(beam_azimuth, reach, color="tab:red")
axes[0].set(xlim=(89, -89), xlabel="azimuth, to the left [degrees]", ylabel="reach [m]", title="one range a beam")
draw(block, p, axes[1], "looked up")
draw(block, p, axes[2], "red: the twins differ", mark=differ)
plt.show()

# %% [markdown]
# On the left, the same scan without a map: the car is the notch at 12 degrees, the wall the plateau around 0; where
# neither stands, the beams end at their last ground return. In the middle the shadows appear by themselves: behind
# car and wall the map stays grey. On the right, red: cells on the edge of what is seen, where the one twin asks
# whether a *cell* fits in its beam and the other whether a *ray* gets through the cell. Inside, they agree
# everywhere:


# %%
def edge_of(evidence):
    """Return the cells on either side of the border of what is seen, or hit."""
    square, edge = np.ones((3, 3)), np.zeros(evidence.free.shape, bool)
    for area in (evidence.occupied != evidence.free, evidence.occupied > evidence.free):
        edge |= ndimage.binary_dilation(area, square) & ~ndimage.binary_erosion(area, square)
    return edge


def differs(one, other):
    """Return the cells of which two say something else."""
    return (one.occupied != other.occupied) | (one.free != other.free)


assert not (differs(fast, literal) & ~edge_of(literal)).any()
share = differs(fast, literal).sum() / (literal.occupied != literal.free).sum()
print(f"the twins differ in {100 * share:.0f} % of the cells seen, all of them on an edge")

# %% [markdown]
# The same on the drive. **Predict before you run.** Here the reach of one beam and the next differ by metres, for far
# rings leave gaps, and 40 m ahead a cell is wider than two beams. Which twin calls more cells free?
#
# <details><summary>Answer</summary>The literal one: a cell is free as soon as any of the rays through it gets to its
# end. The fast one asks the one beam through the cell's centre. So it is the more careful twin.</details>

# %%
scan = frames[0].points_grid
fast, literal = scan_evidence(scan, spec, sensor), scan_evidence_literal(scan, spec, sensor)
np.testing.assert_array_equal(fast.occupied > fast.free, literal.occupied > literal.free)  # the same cells are hit
differ = differs(fast, literal)
near = spec.centers()[..., 0] < 20
for name, band in (("up to 20 m", near), ("beyond 20 m", ~near)):
    seen = band & (literal.occupied != literal.free)
    print(f"{name:<12} {100 * (differ & band).sum() / seen.sum():.0f} % of the cells seen differ")
assert (differ & (literal.free > literal.occupied)).sum() > 0.8 * differ.sum()

# %% [markdown]
# Both hit the same cells; where they differ, nine times in ten the literal twin says free and the fast one says
# nothing. And the time?

# %% tags=["nbval-ignore-output"]
seconds = {}
for twin, repeats in ((scan_evidence, 20), (scan_evidence_literal, 1)):
    start = process_time()
    for _ in range(repeats):
        twin(scan, spec, sensor)
    seconds[twin] = (process_time() - start) / repeats
print(f"walking takes {seconds[scan_evidence_literal] / seconds[scan_evidence]:.0f} times as long as looking up")

# %% [markdown]
# ## What is an obstacle?
#
# So far, a return was an obstacle when it came from more than 0.3 m above the ground. Which ground? Walk with one
# column of returns from a road up a grass bank, on which a person stands:
#
# | distance [m] | 4 | 6 | 7 | 8 | 9 | 10 | 11 | 11 | 11 | 12 |
# |---|---|---|---|---|---|---|---|---|---|---|
# | height z [m] | 0 | 0 | 0.25 | 0.5 | 0.75 | 1 | 1.3 | 1.9 | 2.4 | 1 |
#
# **Predict before you run.** Take the ground for flat, z = 0. Which returns are obstacles, 0.3 to 2.5 m high? What
# does the map then say of the cells from 9 to 12 m?
#
# <details><summary>Answer</summary>All from 8 m on: half the bank and the person alike. And because nothing is known
# behind the first obstacle, the beam ends at 8 m: the person is hit, but in a meadow of hits.</details>
#
# Now walk outward and carry the ground with you. From the last ground found, what lies $d$ metres farther on is
# ground as well if it isn't too much higher or lower: 0.1 m, which is most of a kerb, and a slope of 1 in 3 over a
# short way; 0.3 m and a gentle grade of 5 in 100 over a long one. By hand: from 6 to 7 m the first allows 0.1 + 1/3 =
# 0.43, the second 0.35; the step of 0.25 is within both, so it is ground. So are the next three, and the last, from
# 10 to 12 m. At 11 m the returns differ by 1.1 m, more than 0.3: something *stands* there, and it isn't asked. (Where
# ground was hidden for more than 10 m, $d$ counts as 10 m.) With the grid frame's height $z$ (in a probability, $z$ is
# what a scan says):
#
# $$ |z - z_\text{ground}| \le \min\left(0.1 + \tfrac13 d,\; 0.3 + 0.05\, d\right), \qquad d \le 10\ \text{m} $$


# %%
def walk_out(distance, z, params):
    """Note where the ground lies along one column of returns, from the vehicle outward."""
    ground_at, ground = [0.0], [0.0]
    bins = np.floor(distance / params.bin)
    for b in np.unique(bins):
        r, heights = distance[bins == b], z[bins == b]
        if np.ptp(heights) > params.rise:
            continue  # something stands there
        lowest = heights.argmin()
        d = min(r[lowest] - ground_at[-1], params.gap)
        if abs(heights[lowest] - ground[-1]) <= min(params.step + params.slope * d, params.rise + params.grade * d):
            ground_at.append(r[lowest])
            ground.append(heights[lowest])
    return ground_at, ground


distance = np.array([4.0, 6, 7, 8, 9, 10, 11, 11, 11, 12])
z = np.array([0.0, 0, 0.25, 0.5, 0.75, 1, 1.3, 1.9, 2.4, 1])
ground_at, ground = walk_out(distance, z, sensor.ground)
middles = (np.arange(sensor.ground.bins) + 0.5) * sensor.ground.bin
np.testing.assert_allclose(np.interp(middles, ground_at, ground), walk_sector(distance, z, sensor.ground))
print("ground at", *(f"{r:.0f}" for r in ground_at[1:]), "m")

# %%
height = z - np.interp(distance, ground_at, ground)
obstacle = height >= sensor.obstacle_min
fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
ax.plot(ground_at, ground, color="tab:green", label="ground, walked")
ax.axhline(sensor.obstacle_min, color="0.6", linestyle="--", label="flat ground + 0.3 m")
ax.plot(distance[~obstacle], z[~obstacle], "o", color="tab:green", label="ground return")
ax.plot(distance[obstacle], z[obstacle], "o", color="black", label="obstacle return")
ax.set(xlabel="distance [m]", ylabel="z [m]", xlim=(0, 12.5))
ax.legend(loc="upper left", fontsize="small")
plt.show()

# %% [markdown]
# Black is what stands more than 0.3 m above the green line: the person, and nothing else. Above the dashed line lie
# all points that the flat rule would take for obstacles.
#
# The package walks 360 sectors of one degree so, and takes in each the median of its neighbours' ground, since a car
# hides it in some. Here is a simulated street through a park, where the truth is known. Red: cells that are hit
# although nothing but grass is in them.


# %%
def park_street(seed):
    """Return a scan of a simulated street through a park, and where in it are bare grass, plants and road users."""
    drive = SimulatedDrive(seed, n_frames=20, wishes=Wishes(styles=("park", "park"), even=True))
    kinds, _ = drive.birdseye(0.0)
    fine = kinds.reshape(spec.shape[0], 5, spec.shape[1], 5)  # 0.1 m cells in cells of 0.5 m
    users = np.isin(fine, (Kind.CAR, Kind.PEDESTRIAN, Kind.BICYCLE)).any(axis=(1, 3))
    bare = (fine == Kind.GRASS).all(axis=(1, 3))
    return drive.scan(0).points_grid, bare, (fine == Kind.PLANT).any(axis=(1, 3)), users


def hit_by(scan, model):
    """Return P(occupied) after one scan, and the cells that are hit."""
    evidence = scan_evidence(scan, spec, model)
    return evidence.occupied / (evidence.occupied + evidence.free), evidence.occupied > evidence.free


scan, grass, _, _ = park_street(seed=0)
fig, axes = plt.subplots(1, 2, figsize=(8, 6), layout="compressed")
for ax, title, model in zip(axes, ("flat ground", "ground, walked"), (SensorModel(ground=None), sensor), strict=True):
    p, hit = hit_by(scan, model)
    draw(spec, p, ax, title, mark=hit & grass)
plt.show()

# %% tags=["nbval-ignore-output"]
print("cells hit, flat ground -> ground walked")
for seed in range(4):
    scan, *places = park_street(seed)
    _, flat_hit = hit_by(scan, SensorModel(ground=None))
    _, hit = hit_by(scan, sensor)
    counts = [f"{(flat_hit & cells).sum():3d} -> {(hit & cells).sum():3d}" for cells in places]
    print("park {}: bare grass {}, plants {}, road users {}".format(seed, *counts))
    assert (hit & places[0]).sum() < 0.6 * (flat_hit & places[0]).sum()

# %% [markdown]
# The flat rule puts a wall where a lawn rises, and hides what is behind it. The walk removes nearly nine tenths of it
# or more in three parks of four, and keeps the road users but for a cell or two. (The plants that go are none: the
# returns in those cells come from the grass below the crowns.) On a real KITTI drive, along a fence, more than a
# quarter of the cells that the flat rule called occupied were the grass before it. In the last park the walk loses
# its way: cars and a fence hide where the bank begins, and behind them the grass starts 0.8 m up, more than the walk
# allows.

# %% [markdown]
# ## Log-odds: multiplication becomes addition
#
# One cell, believed occupied with 0.5. Two beams come back from it, each 0.8 likely if occupied, 0.2 if free. Bayes'
# rule twice, in odds (occupied to free): 1 to 1, then 4 to 1, then 16 to 1. So P = 16/17 = 0.94. No normalising on
# the way: odds just multiply. Their logarithm just adds. With $P$ for P(occupied):
#
# $$ L = \log\frac{P}{1 - P}, \qquad P = \frac{1}{1 + e^{-L}}, \qquad
#    L_t = L_{t-1} + \log \frac{P(z_t \mid \text{occupied})}{P(z_t \mid \text{free})} $$
#
# By hand: log 4 = 1.39, so $L$ goes 0, 1.39, 2.77. (The literature writes a small l; in this course that is the
# LIDAR.) $L = 0$ is "don't know", positive is occupied, and $L$ and $-L$ are equally sure.


# %% tags=["log-odds"]
def take_in(L, occupied, free, L_min, L_max):
    """Return the log-odds of a cell after one scan, within limits."""
    L = L + np.log(occupied / free)
    return min(max(L, L_min), L_max)


params = LogOddsParams()
L_min, L_max = log_odds([params.lowest, params.highest])
one_hit = Evidence(occupied=np.full((1, 1), 0.8, np.float32), free=np.full((1, 1), 0.2, np.float32))
L, package, belief = 0.0, np.zeros((1, 1)), np.array([0.5, 0.5])
for _ in range(2):
    L = take_in(L, 0.8, 0.2, L_min, L_max)
    package = update_log_odds(package, one_hit, params)
    belief = discrete_bayes.update(likelihood=np.array([0.8, 0.2]), prior=belief)
    np.testing.assert_allclose(probability(L), [probability(package[0, 0]), belief[0]], rtol=1e-6)
    print(f"L = {L:.2f}, P(occupied) = {probability(L):.3f}")

# %% [markdown]
# Three ways, one number: the literal line, the package, and lecture 01's `filterpy`, which multiplies and normalises.
#
# ### The prior counts once
#
# Where is the prior? In the first $L$, and nowhere else: the scan brings *likelihoods*. Many sensor models bring
# $P(\text{occupied} \mid z)$ instead, an *inverse* model, and then each scan has the prior in it.
#
# **Predict before you run.** In a car park, P(occupied) = 0.2 before any scan. An inverse model answers 0.2 for a
# cell of which a scan says nothing. Add up the log-odds of ten such scans. Where is the cell?
#
# <details><summary>Answer</summary>At eleven times log(0.2 / 0.8) = -1.39, so L = -15 and P = 0.0000002. Ten times
# nothing, and the map is certain. Subtract the prior's log-odds from each scan's, and nothing stays
# nothing.</details>
#
# $$ L_t = L_{t-1} + \log\frac{P(\text{occupied} \mid z_t)}{P(\text{free} \mid z_t)} - L_0 $$

# %%
L_0 = log_odds(0.2)
silent = log_odds(0.2)  # what an inverse model answers when the scan says nothing
for scans in (0, 1, 2, 10):
    once, every_time = L_0 + scans * (silent - L_0), L_0 + scans * silent
    print(f"{scans:2d} silent scans: {probability(once):.3f}; prior in every scan: {probability(every_time):.7f}")

# %% [markdown]
# ### Never be too sure
#
# A cell of a parked car is hit by two returns at each of 100 scans, ten seconds: $L = 100 \cdot 2 \log 16 = 555$.
# Then the car drives off. A pass is worth log(0.3 / 0.7) = -0.85.
#
# **Predict before you run.** How many seconds does the map need to notice, at ten scans a second?
#
# <details><summary>Answer</summary>555 / 0.85 = 655 passes: more than a minute. The longer the map was right, the
# longer it stays wrong. With $L$ clamped at 3.48 it takes 3.48 / 0.85 = 4.1, so five passes: half a second.</details>
#
# The clamp is a confession: scans aren't independent and the world changes, so no number of scans makes a cell
# certain. The package keeps P within 0.12 and 0.97, as OctoMap does.

# %%
history = {"no clamp": (-np.inf, np.inf), "clamped at P = 0.12 and 0.97": (L_min, L_max)}
hit, passed = (0.8**2, 0.05**2), (0.3, 0.7)
fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
for name, limits in history.items():
    L = [0.0]
    for k in range(60):
        L.append(take_in(L[-1], *(hit if k < 5 else passed), *limits))
    ax.plot(np.arange(61) / 10, L, "." if np.isinf(limits).any() else ".-", label=name)
ax.axhline(0, color="0.6", linewidth=1)
ax.axvline(0.5, color="0.6", linestyle=":", label="the car leaves")
ax.set(xlabel="time [s]", ylabel="L of its cell")
ax.legend(fontsize="small")
plt.show()

# %% [markdown]
# Five scans of hits, and the blue cell needs 33 passes to cross zero again; the orange one five.
#
# ## On the drive
#
# Now every cell, and a vehicle that moves at 8.5 m/s. Before each scan the map must move under it, or the world smears.
# `LogOddsGrid` does that by whole cells, so that nothing blurs (lecture 04 says how).
#
# **Predict before you run.** Forget the motion and add up 20 scans in the vehicle's frame. What does a lamp post look
# like? And what of the road, which is free at every scan?
#
# <details><summary>Answer</summary>The post approaches by 16 m and is smeared into a dashed line; a road that is free
# everywhere stays free: where the world looks the same from everywhere, you don't notice that you move.</details>


# %%
def add_up(frames, moving=True, params=None):
    """Return the map of P(occupied) after each frame."""
    grid, before, maps = LogOddsGrid(spec, params), frames[0], []
    for frame in frames:
        motion = PlanarMotion.from_poses(before.T_world_from_lidar, frame.T_world_from_lidar)
        maps.append(grid.step(frame.points_grid, motion if moving else PlanarMotion(), dt=0.1))
        before = frame
    return maps


maps = add_up(frames)
fig, axes = plt.subplots(1, 3, figsize=(10, 6.3), layout="compressed")
draw(spec, maps[0], axes[0], "one scan")
draw(spec, add_up(frames, moving=False)[-1], axes[1], "20 scans, motion forgotten")
draw(spec, maps[-1], axes[2], "20 scans, motion known")
plt.show()
known = [100 * (np.abs(p - 0.5) > 0.1).mean() for p in (maps[0], maps[-1])]
print(f"cells with an opinion: {known[0]:.0f} % after one scan, {known[1]:.0f} % after twenty")

# %% [markdown]
# In the right picture the street is sharp: the plank fence on the right with the house behind it, the hedge on the
# far left, parked cars before it. What lay between the rings has filled up. But on the left, from 5 to 30 m,
# something long and black lies on the road.
#
# ## The smear
#
# Two cars of the toy world, both at 10 m/s: one drives away from you on the right, one comes towards you on the left.
# You stand still and scan them ten times a second.
#
# **Predict before you run.** How long a tail does each drag along? For the right one: it covers a metre between two
# scans, the clamp is at 3.48, a pass is worth -0.85. For the left one, think where its tail lies, seen from you.
#
# <details><summary>Answer</summary>A cell survives floor(3.48 / 0.85) = 4 passes, so the tail of the car that drives
# away grows to 4 m and no further. The oncoming car's tail lies behind it: in its shadow. No beam passes there, so
# nothing is ever taken back, and its tail grows by a metre a scan.</details>
#
# With $\Delta L = \log\left(P(z \mid \text{free}) / P(z \mid \text{occupied})\right)$, what a pass is worth:
#
# $$ \text{tail} = v\, \Delta t \left( \left\lceil L_\text{max} / \Delta L \right\rceil - 1 \right) $$


# %%
def passes_survived(highest):
    """Count the passes after which a cell that was at the clamp is still occupied."""
    survived, L = 0, log_odds(highest)
    while (L := L + np.log(sensor.p_pass_occupied / sensor.p_pass_free)) > 0:
        survived += 1
    return survived


def two_cars(t):
    """Return the car that drives away and the one that comes, after t seconds."""
    return Box.around(10.2 + 10 * t, -3, 4, 2, 1.5), Box.around(50.2 - 10 * t, 3, 4, 2, 1.5)


def tails(p, away, coming):
    """Measure, in metres, how far behind each car the last occupied cell of its lane lies."""
    x = toy.centers()[..., 0]
    left_by_away = x[(p > 0.5) & cells_in(away._replace(x_min=0, x_max=away.x_min), toy)]
    left_by_coming = x[(p > 0.5) & cells_in(coming._replace(x_min=coming.x_max, x_max=60), toy)]
    return away.x_min - left_by_away.min(initial=away.x_min), left_by_coming.max(initial=coming.x_max) - coming.x_max


# %%
def drive_by(highest, scans=25):
    """Return the toy world's map after each scan, and the tails of both cars."""
    grid, maps = LogOddsGrid(toy, LogOddsParams(highest=highest)), []
    for k in range(scans):
        maps.append(grid.step(scan_boxes(list(two_cars(k / 10)), columns=600), PlanarMotion(), dt=0.1))
    return maps, [tails(p, *two_cars(k / 10)) for k, p in enumerate(maps)]


toy = GridSpec(x_min=0, x_max=60, y_min=-8, y_max=8, cell=0.5)
toy_maps, toy_tails = drive_by(highest=0.97)
np.testing.assert_allclose(toy_tails[-1][0], passes_survived(0.97) * 10 * 0.1, atol=toy.cell / 2)
for k in (2, 8, 16, 24):
    away, coming = toy_tails[k]
    print(f"{k / 10:.1f} s: tail of the car that drives away {away:.1f} m, of the one that comes {coming:.1f} m")

# %%
fig, axes = plt.subplots(1, 4, figsize=(10, 5.2), layout="compressed", width_ratios=(1, 1, 1, 2))
for ax, k in zip(axes, (0, 8, 24), strict=False):
    draw(toy, toy_maps[k], ax, f"{k / 10:.1f} s")
    for car in two_cars(k / 10):
        size = car.y_max - car.y_min, car.x_max - car.x_min
        ax.add_patch(plt.Rectangle((car.y_min, car.x_min), *size, fill=False, edgecolor="tab:red"))
clamps = np.array([0.6, 0.8, 0.9, 0.97, 0.99, 0.999])
axes[3].plot(log_odds(clamps), [drive_by(c)[1][-10][0] for c in clamps], "o", color="black", label="measured")
fine = np.linspace(0.05, 7.5, 300)
axes[3].plot(fine, [passes_survived(p) for p in probability(fine)], color="0.6", label="by hand")
axes[3].set(xlabel="clamp, $L_\\mathrm{max}$", ylabel="tail of the car that drives away [m]")
axes[3].legend()
plt.show()

# %% [markdown]
# Red outlines: where the cars are. The stripes are a metre apart, one from each scan. The tail of the car on the
# right keeps its length; that on the left grows and stays. The clamp decides the first, not the second. (By hand, a
# cell was at the clamp when the car left it; a very high clamp takes more scans than the car gives it, so the last
# point lies a little lower.) Could you just lower the clamp? Then a single beam through a hedge makes a hole in it:
# exercise 02 asks what that costs.
#
# Back to the drive. Red, now, is every cell that the map calls occupied while, in truth, it is empty road:

# %%
road = KITTI_14.index("road")
on_road = [frame.labels.birdseye_on(spec) == road for frame in frames]
ghosts = [smear_area(p, truth, spec) for p, truth in zip(maps, on_road, strict=True)]
alone = [scan_evidence(frame.points_grid, spec, sensor) for frame in frames]
once = [smear_area(e.occupied / (e.occupied + e.free), truth, spec) for e, truth in zip(alone, on_road, strict=True)]
fig, axes = plt.subplots(1, 3, figsize=(10, 5.6), layout="compressed", width_ratios=(1, 1, 1.6))
for ax, k in zip(axes, (9, 19), strict=False):
    draw(spec, maps[k], ax, f"{frames[k].time:.1f} s", mark=(maps[k] > 0.5) & on_road[k])
times = [frame.time for frame in frames]
axes[2].plot(times, ghosts, "o-", color="tab:red", label="map of all scans")
axes[2].plot(times, once, "o-", color="0.5", label="each scan alone")
axes[2].set(xlabel="time [s]", ylabel="empty road that is called occupied [m²]", ylim=(0, None))
axes[2].legend()
plt.show()
print(f"after {times[-1]:.1f} s: {ghosts[-1]:.0f} m² of ghosts; in the last scan alone {once[-1]:.0f} m²")

# %% [markdown]
# The long red streak is that of the oncoming cars, each in the shadow of the one before. The car that overtakes us,
# on the left at the bottom, drags the tail that you expect: it does 14 m/s, so 14 · 0.1 · 4 = 5.6 m. The cyclists on
# the right have short ones. A single scan has next to no ghosts: it is the *memory* that lies. A car covers about 8
# m²: the map has invented seven.
#
# ### Forgetting
#
# If nothing is seen there, let the cell forget: before each scan its log-odds shrink by a factor, towards "don't
# know". By hand, with a memory of $\tau$ = 0.5 s: after a second in the shadow the clamp's 3.48 has become 3.48 /
# $e^2$ = 3.48 / 7.4 = 0.47, so P = 0.62. One pass would do now.
#
# $$ L \leftarrow L\, e^{-\Delta t / \tau} $$


# %%
def forget(L, dt, tau):
    """Let log-odds fade towards 0, which is "don't know"."""
    return L * np.exp(-dt / tau)


L = L_max
for _ in range(10):
    L = forget(L, dt=0.1, tau=0.5)
np.testing.assert_allclose(L, L_max * np.exp(-2))
L = np.zeros(toy.shape)
for k in range(25):
    seen = scan_evidence(scan_boxes(list(two_cars(k / 10)), columns=600), toy, sensor)
    L = update_log_odds(forget(L, dt=0.1, tau=0.5), seen, params)
fig, axes = plt.subplots(1, 2, figsize=(5.5, 5.6), layout="compressed")
draw(toy, toy_maps[-1], axes[0], "never forgets")
draw(toy, probability(L), axes[1], "forgets in 0.5 s")
plt.show()

# %% [markdown]
# The oncoming car's tail fades to grey, as it should: nobody has looked. But so fades the house that a lorry hides
# for two seconds. A binary grid has one dial for both, since it has no word for the difference: **it can't say
# "moves"**. A cell is occupied or free, for ever; a car is neither. Lecture 03 gives cells a velocity.
#
# ## Play with it
#
# One cell: free for a second, covered by a car for half a second, free again. Turn the dials. How soon does the map
# see the car, how soon does it let go? What does a lower clamp cost, what does a more porous world (larger P(pass |
# occupied)) do? (Without a running kernel there are no dials; the figure below shows three settings.)


# %%
def one_cell(highest, p_pass_occupied, p_hit_free):
    """Return P(occupied) of the cell at 40 scans."""
    L, p = 0.0, []
    for k in range(40):
        covered = 10 <= k < 15
        ratio = (sensor.p_hit_occupied, p_hit_free) if covered else (p_pass_occupied, 1 - p_pass_occupied)
        L = take_in(L, *ratio, log_odds(params.lowest), log_odds(highest))
        p.append(probability(L))
    return p


def draw_cell(ax, highest=0.97, p_pass_occupied=0.3, p_hit_free=0.05):
    """Draw the history of the cell."""
    ax.axvspan(0.95, 1.45, color="tab:red", alpha=0.15, label="the car is there")
    ax.axhline(0.5, color="0.6", linewidth=1)
    ax.plot(np.arange(40) / 10, one_cell(highest, p_pass_occupied, p_hit_free), ".-", color="black")
    ax.set(ylim=(0, 1), xlabel="time [s]", ylabel="P(occupied)")


# %% tags=["nbval-ignore-output"]
def show(highest, p_pass_occupied, p_hit_free):
    """Show the cell for the dials' setting."""
    _, ax = plt.subplots(figsize=(6, 2.8), layout="constrained")
    draw_cell(ax, highest, p_pass_occupied, p_hit_free)
    plt.show()


_ = interact(
    show,
    highest=FloatSlider(value=0.97, min=0.6, max=0.999, step=0.001, readout_format=".3f", description="clamp P"),
    p_pass_occupied=FloatSlider(value=0.3, min=0.05, max=0.48, step=0.01, description="P(pass|occ)"),
    p_hit_free=FloatSlider(value=0.05, min=0.01, max=0.6, step=0.01, description="P(hit|free)"),
)

# %%
settings = {
    "as in the package": {},
    "clamp at 0.999": {"highest": 0.999},
    "porous world, P(pass | occ) = 0.45": {"p_pass_occupied": 0.45},
}
fig, axes = plt.subplots(1, 3, figsize=(10, 2.8), layout="constrained", sharey=True)
for ax, (name, dials) in zip(axes, settings.items(), strict=True):
    draw_cell(ax, **dials)
    ax.set_title(name, fontsize="medium")
for ax in axes[1:]:
    ax.set_ylabel("")
plt.show()

# %% [markdown]
# In the red band the car is there. It is seen at its first hit in all three; what differs is the letting go: five
# passes, nine, eighteen. A porous world makes each pass weak evidence, and free space is learnt slowly too: look at
# the first second.
#
# ## Where this breaks
#
# **The bill for independence.** Take the cells that lie between two hit ones, left and right or before and behind,
# and weren't hit themselves. What does the grid believe of them after that scan, and in how many does something truly
# stand? (Grass and hedges have one class in the truth, so they are left out here and below.)

# %%
bare = [KITTI_14.index(name) for name in ("road", "sidewalk")]
truths = [frame.labels.birdseye_on(spec) for frame in frames]
believed, stands = [], []
for evidence, truth in zip(alone, truths, strict=True):
    p = evidence.occupied / (evidence.occupied + evidence.free)
    judged = truth != KITTI_14.index("vegetation")
    for P, J, T in ((p, judged, truth), (p.T, judged.T, truth.T)):
        gap = (P[:-2] > 0.5) & (P[2:] > 0.5) & (P[1:-1] <= 0.5) & J[1:-1]
        believed.append(P[1:-1][gap])
        stands.append(~np.isin(T[1:-1][gap], bare))
believed, stands = np.concatenate(believed), np.concatenate(stands)
right = f"occupied in {100 * stands.mean():.0f} % of cases"
print(f"{len(believed)} cells: believed occupied with {believed.mean():.2f}, {right}")

# %% [markdown]
# You would have known: whatever stands left and right of a gap usually stands in it. A grid of independent cells
# can't.
#
# **The map boasts.** A map that says 0.97 should be right in 97 of 100 such cells. Sort the cells of the last map by
# what they claim, and count.


# %%
def judged(values, k):
    """Keep the cells of frame k whose truth isn't vegetation."""
    return values[truths[k] != KITTI_14.index("vegetation")]


claimed, stands = judged(maps[-1], -1), judged(~np.isin(truths[-1], bare), -1)
ranges = [(0, 0.2), (0.2, 0.4), (0.6, 0.8), (0.8, 0.96), (0.96, 1)]
chosen = [(claimed >= low) & (claimed < high) for low, high in ranges]
x_claimed, x_true = ([values[cells].mean() for cells in chosen] for values in (claimed, stands))
fig, ax = plt.subplots(figsize=(4, 3.4), layout="constrained")
ax.plot([0, 1], [0, 1], color="0.6", label="as claimed")
ax.plot(x_claimed, x_true, "o-", color="black", label="on the drive")
ax.set(xlabel="P(occupied), as claimed", ylabel="share that is occupied", xlim=(0, 1), ylim=(0, 1), aspect="equal")
ax.legend()
plt.show()
hit = np.concatenate([judged(evidence.occupied > evidence.free, k) for k, evidence in enumerate(alone)])
stands = np.concatenate([judged(~np.isin(truth, bare), k) for k, truth in enumerate(truths)])
print(f"of cells that a single scan hits {100 * stands[hit].mean():.0f} % are occupied")
print(f"of cells that the map calls occupied with {x_claimed[-1]:.2f}, {100 * x_true[-1]:.0f} % are")

# %% [markdown]
# Single scans keep nearly what they promise. It is the sum that boasts, and most of it is the smear. The rule that
# adds scans up takes them for independent witnesses of a world that stands still, and they are neither: twenty scans
# of one edge of one car are one witness. The clamp and `max_returns` keep the boast within limits, no more: without
# them, two scans of a wall with ten returns a cell, several rings one above the other, would claim $16^{20}$ to 1.
#
# **Thin things flicker.** A wire of 3 cm and two posts. The vehicle drives towards them, and each scan meets them or
# misses.

# %%
lane = GridSpec(x_min=0, x_max=40, y_min=-8, y_max=8, cell=0.5)
fig, ax = plt.subplots(figsize=(7, 2.8), layout="constrained")
for width, colour in ((0.03, "tab:red"), (0.1, "tab:orange"), (0.3, "black")):
    grid, p = LogOddsGrid(lane), []
    for k in range(25):
        seen = scan_boxes([Box.around(30.3, 3.2, width, width, 2.4)], x=0.5 * k, columns=360)
        belief = grid.step(seen, PlanarMotion(0.5 if k else 0.0, 0.0, 0.0), dt=0.1)
        (row,), (col,), _ = lane.cells(np.array([[30.3 - 0.5 * k, 3.2]]))
        p.append(belief[row, col])
    ax.plot(30.3 - 0.5 * np.arange(25), p, ".-", color=colour, label=f"{100 * width:.0f} cm wide")
ax.axhline(0.5, color="0.6", linewidth=1)
ax.set(xlabel="distance ahead [m]", ylabel="P(occupied) of its cell", xlim=(31, 18), ylim=(0, 1))
ax.legend(fontsize="small")
plt.show()

# %% [markdown]
# From the clamp a cell survives four passes, just: met in every fifth scan it stays occupied; met less often, as the
# wire is, it is free for most of the time. The same goes for all that is porous. It doesn't matter how many beams of a
# scan get through, only whether one comes back: near by a bare hedge is solid, and far away, where a cell meets a beam
# or two, it is gone.

# %% [markdown]
# **A fence of wire mesh.** The table of the first beam takes each cell for one of two things: full, so that beams come
# back from it, or empty, so that they go on. It does so for every beam alike. Wire mesh is neither full nor empty: a
# part of the beams comes back, and the rest goes on to whatever stands behind. These shares were measured on a real
# KITTI drive (2011_09_26, 0013), which passes such a fence:
#
# | \|cos\| of the angle between the beam and the fence's normal | 0.95 | 0.82 | 0.65 | 0.48 | 0.35 |
# |---|---|---|---|---|---|
# | distance [m] | 8 | 9 | 12 | 17 | 25 |
# | share of the beams that come back [%] | 6-9 | 12-15 | 15-40 | about 50 | 65 |
#
# The share grows with the distance because a beam is a cone: farther away it is wider, and meets more wires. It also
# grows where the beam grazes the fence, because there the wires stand closer together as the beam sees them.
#
# **Predict before you run.** Suppose that every beam had its own vote, log 16 = 2.77 for a return and log(0.3 / 0.7) =
# -0.85 for a pass, and that the votes of one scan were added up. From which share of returns on would the map call a
# cell of the fence occupied? Which part of the fence above would it not see?
#
# <details><summary>Answer</summary>A share r of returns tips the balance when 2.77 r = 0.85 (1 - r), so r = 0.85 / 3.62
# = 0.23. The map would call the fence free up to 9 m, where at most 15 % come back: it would lose the fence just where
# the vehicle passes it.</details>
#
# In the package an obstacle return overrules all passes of the same scan (it is the first of the four rules that
# followed the beam over five cells), so that one return is enough. Now a simulated street with such a fence. Behind it
# stand hedges, one behind the other. They are porous too: a beam ends somewhere inside, on the real drive 0.2 m deep
# on average.

# %% jupyter={"outputs_hidden": true}
hit_vote, pass_vote = np.log(0.8 / 0.05), np.log(0.3 / 0.7)
tips = -pass_vote / (hit_vote - pass_vote)
print(f"the balance tips at {100 * tips:.0f} %")
for distance, share in ((8, 0.075), (9, 0.135), (12, 0.275), (17, 0.5), (25, 0.65)):  # the middle of each range
    votes = 10 * (share * hit_vote + (1 - share) * pass_vote)
    assert (votes > 0) == (share > tips)
    print(f"{distance:2d} m: ten beams sum to L = {votes:5.1f}, {'occupied' if votes > 0 else 'free'}")

# %% jupyter={"source_hidden": true} alt="fence and hedges seen from above: returns, and evidence of cells"
yard = named_street("mesh and hedge", seed=5, frames=8)
side, scan = GridSpec(x_min=0, x_max=20, y_min=-13, y_max=1, cell=0.2), yard.scan(0).points_grid
kinds = yard.birdseye(0.0)[0]
rows, cols, _ = GridSpec(x_min=0, x_max=71, y_min=-15.5, y_max=15.5, cell=0.1).cells(scan[:, :2])
above = scan[:, 2] > sensor.obstacle_min
fence = scan[ndimage.binary_dilation(kinds == Kind.FENCE, iterations=2)[rows, cols] & above]
hedge = scan[(kinds == Kind.PLANT)[rows, cols] & above & (scan[:, 1] < -7)]
evidence = scan_evidence(scan, side, sensor)
fig, axes = plt.subplots(1, 2, figsize=(9, 6), layout="compressed", sharey=True)
for x, y in hedge[::50, :2]:
    axes[0].plot([0, y], [0, x], color="0.8", linewidth=0.6)
axes[0].plot(fence[:, 1], fence[:, 0], ".", color="black", markersize=2, label="wire mesh (F)")
axes[0].plot(hedge[:, 1], hedge[:, 0], ".", color="tab:green", markersize=2, label="hedges (H)")
axes[0].set(aspect="equal", xlim=(1, -13), ylim=(0, 20), xlabel="y, left [m]", ylabel="x, forward [m]")
axes[0].set_title("one scan: returns, and some beams")
axes[0].legend(loc="upper left", fontsize="small", markerscale=4)
draw(side, evidence.occupied / (evidence.occupied + evidence.free), axes[1], "evidence of this scan")
for ax in axes:
    ax.text(-7.2, 17.5, "F", fontsize="large", color="tab:red", weight="bold")
    ax.text(-11.2, 9.7, "H", fontsize="large", color="tab:red", weight="bold")
plt.show()

# %% [markdown]
# Left, the grey lines are some of the beams that went through the mesh (F) and came back from a hedge (H). Right, the
# fence's cells are dark although most of the beams near by went through them. The rule has a price: the reach of a
# beam ends at its first obstacle, so that most of what lies between the fence and the hedges stays grey, although many
# beams crossed it. That is the careful side to err on.
#
# What does the log-odds grid make of it? Put eight scans, 0.7 s of driving, into one map, and compare it with the
# truth. Then take five streets along which only a porous hedge runs, and count the cells of the hedge that one scan
# passes and the next one hits. Count once more with the hedges made opaque.


# %% jupyter={"source_hidden": true}
def truly(kind, street):
    """Return the cells of `side` in which, at the first scan, something of a kind stands."""
    tenths = street.birdseye(0.0)[0][510:710, 145:285] == kind  # x from 20 to 0 m, y from 1 to -13 m
    return tenths.reshape(100, 2, 70, 2).any(axis=(1, 3))


def eight_scans(street):
    """Return the evidence of each scan in the cells of `side`, where the vehicle moves."""
    seen = [street.scan(k) for k in range(8)]
    poses = [PlanarMotion.from_poses(seen[0].T_world_from_lidar, frame.T_world_from_lidar) for frame in seen]
    return [scan_evidence(frame.points_grid, side, sensor, pose) for frame, pose in zip(seen, poses, strict=True)]


L = np.zeros(side.shape)
for evidence in eight_scans(yard):
    L = update_log_odds(L, evidence, params)
known = (L != 0) & truly(Kind.FENCE, yard)
print(f"wire mesh: {100 * (L > 0)[known].mean():.0f} % of {known.sum()} cells are occupied after eight scans")
assert (L > 0)[known].all()


# %% jupyter={"source_hidden": true}
def first_passed_then_hit(street):
    """Count the cells of a hedge that one scan passes and the next one hits, in eight scans."""
    ratios = np.array([(e.occupied / e.free)[truly(Kind.PLANT, street)] for e in eight_scans(street)])
    return np.count_nonzero((ratios[:-1] < 1) & (ratios[1:] > 1))


flips = []
for seed in range(5):
    street = named_street("hedge", seed, frames=8)
    porous = first_passed_then_hit(street)
    street.porous = replace(street.porous, opacity=1000 * street.porous.opacity)  # now no beam gets in
    flips.append((porous, first_passed_then_hit(street)))
    print("hedge {}: {:3d} cells first passed, then hit; opaque {:3d}".format(seed, *flips[-1]))
assert np.sum(flips, axis=0)[0] > 1.5 * np.sum(flips, axis=0)[1]

# %% [markdown]
# The fence stays in the map, in all of its cells that were seen. By votes, beam by beam, the real fence would lose its
# nearest part. So the assumption that a cell is full or empty is wrong for wire, but one rule keeps the harm small.
# What still fails is the edge of a hedge: one scan finds only beams that pass there, and the next one finds a return.
# Summed over these five streets, porous hedges do that 1.6 times as often as opaque ones, but on three of the five
# they don't. So most of it comes not from the twigs but from cells that the hedge fills in part. In the log-odds grid
# this does little harm, because one hit takes back three passes. A filter that asks where things came from suffers
# more, because something seems to turn up in a cell that was free: see lectures 03 and 04.
#
# More that no tuning of this grid repairs:
# - **Glass, water, black paint** send nothing back, or what stands in the mirror. A beam without a return says
#   nothing, so a black car is a hole of unknown; a beam through a window sees the room behind it and calls the pane
#   free.
# - **Free isn't safe.** A cell is free as soon as a beam passes it at *one* height. What is lower than the beam
#   there, or hangs above it, goes unseen: a kerb, a dog, the load of a lorry.
# - **The vehicle sees itself.** Returns from its own bonnet would be an obstacle that drives along for ever, and hide
#   what is behind it. The package drops them (`SensorModel.vehicle`), and with them whatever else is that near.
#
# ## In five lines
#
# 1. A beam says free on its way, occupied at its end, nothing behind: two likelihoods a cell, and only their ratio
#    counts.
# 2. Ask each cell for its beam instead of each beam for its cells; measure height from the ground that is there, not
#    from z = 0.
# 3. In log-odds Bayes' rule is a sum. Likelihoods bring no prior; an inverse model does, so subtract it each time.
# 4. Clamp: what can't be unlearnt in half a second is wrong for longer.
# 5. Whatever moves leaves a smear, 4 passes long where you see it, and without end where you don't: a binary grid
#    can't say "moves".
#
# ## Further reading
#
# - Moravec, Elfes, *High resolution maps from wide angle sonar*, ICRA 1985: the first occupancy grid.
# - Elfes, *Using occupancy grids for mobile robot perception and navigation*, Computer 22(6), 1989: Bayes' rule in
#   it.
# - Thrun, Burgard, Fox, *Probabilistic Robotics*, MIT Press 2005, chapter 9: inverse models, and maps without the
#   convenient lie.
# - Hornung, Wurm, Bennewitz, Stachniss, Burgard, *OctoMap*, Autonomous Robots 34, 2013: the clamp, in three
#   dimensions.
# - Himmelsbach, von Hundelshausen, Wuensche, *Fast segmentation of 3D point clouds for ground vehicles*, IV 2010:
#   walking out the ground.
# - Amanatides, Woo, *A fast voxel traversal algorithm for ray tracing*, Eurographics 1987: from line to line.
#
# ## Exercise
#
# [Exercise 02](exercises/02_grids.ipynb): log-odds, an update with a clamp, the prior that counts once, the length of
# a smear, one beam through a grid, and one question. Next: lecture 03, occupancy with velocity.

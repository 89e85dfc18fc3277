# %% [markdown]
# # 00 · The tour: from a LIDAR scan and an image to a semantic grid
#
# **In one sentence.** A LIDAR knows *where* something stands and a camera knows *what* it looks like; one map can say
# both, if we accept a chain of approximations whose price this course measures, edge by edge.
#
# **You will be able to**
# - name the five stages, what goes into each and what comes out, with shapes;
# - follow one cell of a real street through all of them, and do each step by hand on a toy case;
# - read the graph of the whole system: what depends on what, and which dependences are cut;
# - look up in the ledger what each cut costs.
#
# **Prerequisites.** Python with numpy; a matrix times a vector; conditional probability. No deep learning.
#
# **Time.** 65 minutes, of which the computer needs less than one.
#
# **Paper.** Erkent, Wolf, Laugier, *End-to-End Learning of Semantic Grid Estimation Deep Neural Network with
# Occupancy Grids*, Unmanned Systems 7(3), 2019. Sections 3 and 4 from far above; equations (1) and (2), Bayes' rule of
# section 3.2 and the metrics of section 4.2 by hand.
#
# ```
# LIDAR l ── Bayes filter ──▶ occupancy o ─────────────────┐
#                                                          ├─ fusion ──▶ semantic grid g ── CRF ──▶ refined g
# image i ── network ──▶ scores s ── eq. (1), (2) ──▶ planes p
# ```

# %% jupyter={"source_hidden": true}
import matplotlib.pyplot as plt
import numpy as np
import torch
from IPython.display import Markdown
from ipywidgets import IntSlider, interact
from scipy import ndimage

from semgrid_edu.frame import resize_image
from semgrid_edu import plotting
from semgrid_edu.camera import Camera, project
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.datasets.samples import real_drive, real_weights, sample_drive, sample_weights
from semgrid_edu.graphical import d_separated, why_dependent
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14
from semgrid_edu.metrics import class_accuracy, confusion_matrix, frequency_weighted_iou, pixel_accuracy, semantic_cells

# %% jupyter={"source_hidden": true}
from semgrid_edu.networks import load_net
from semgrid_edu.occupancy import CmcdotParams, Evidence, FilterState, Particles, State, update
from semgrid_edu.pipeline import Stages, run_pipeline
from semgrid_edu.planes import sample_planes_naive
from semgrid_edu.plotting.colours import STATE_COLOURS, STATE_NAMES, class_legend, colour_patches
from semgrid_edu.workshop.demo import cell_story
from worlds.lecture_00_cell_story import draw_cell_story
from worlds.lecture_00_equations import equation_table
from worlds.lecture_00_ledger import ledger, ledger_table, stage_table
from worlds.lecture_00_system import whole_system

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
spec = GridSpec.compact()
CAR, ROAD = KITTI_14.index("car"), KITTI_14.index("road")

# %% [markdown]
# ## The story of one cell
#
# Here is the whole course in one figure. The street is real: a street corner from PandaSet, a public data set; ten camera
# images and LIDAR scans in two seconds. We look at one cell of its map, half a metre wide, and ask: why does the map say *car* there?

# %% jupyter={"source_hidden": true} alt="at the top a street with a column of dots rising beside parked cars at the right; below, bars for the four states of the cell step by step and frame by frame, bars for what image and occupancy add to the score of car, by class and by plane, and the probability of car before and after the CRF"
street = real_drive()
net = load_net(real_weights(), street.camera)
real = list(run_pipeline(street, Stages.fast(net, keep_steps=True)))
now, CELL = real[-1], (81, 36)
story = cell_story(now, CELL, net, past=real[:-1])
fig = draw_cell_story(story, now.frame.image // 8 * 8)  # fewer colours: a smaller file
for letter, ax in zip("ABDFGCE", fig.axes, strict=True):
    ax.set_title(f"{letter}  {ax.get_title(loc='left')}", loc="left", fontsize="medium")
fig.supxlabel(street.credit, fontsize=8)
plt.show()

# %% jupyter={"source_hidden": true}
assert story.label == story.refined == story.truth == CAR
assert story.scan.verdict == "hit"
assert story.steps["shown"][State.STATIC] > 0.9
assert (story.history[State.STATIC, 1:] > 0.9).all()
assert story.messages.argmax() == CAR
assert story.before[CAR] > 0.99

# %% [markdown]
# Read it from A to G, one column after the other. You needn't understand any panel yet: the rest of this page explains
# them.
#
# - **A** The dots are points above the cell, one every 20 cm from the ground up, drawn where the camera sees them. The
#   lowest lies at the foot of parked cars, those above it on the cars, the upper ones on a tree behind them. So the image alone doesn't say what stands in this cell.
# - **B**, **C** What the filter believes of the cell: after each of its steps within this scan (B; *shown* is what it
#   passes on), and scan by scan (C). It is sure that something stands there: STATIC. No return says *what* it is.
# - **D**, **E**, **F** How much image and occupancy speak for *car* (violet) or for the runner-up, *vegetation* (orange;
#   the maps below have other colours): by kind of input, with the network's constants and the sum (D); the image's part by
#   the score's class (E, the six largest) and by height (F).
#   Each pixel has a score for every class, and the network may use each of them: a score for *road*, too, can
#   speak for *car*.
# - **G** What the CRF makes of it. The neighbours' push is in brackets: it is largest for *car*, which was nearly
#   certain before.
#
# A return says that something is there, but not what; a pixel says what, but not where. The system joins them in five
# stages.
#
# ## The map of the course is a graph
#
# What depends on what? A **graphical model** draws each unknown as a circle, and an arrow wherever one thing is
# computed from another or caused by it. Shaded circles are observed. Here is the whole system at toy size: one ray
# with two cells, near and far, at two instants.

# %% tags=["system-graph"] jupyter={"source_hidden": true} alt="two instants side by side: near and far cell point to image and LIDAR; image to scores to planes, LIDAR to occupancy, both to the semantic grid; solid arrows run from cells to the same cells later and from occupancy to occupancy; dashed violet lines with prices: image to occupancy .40 to .48, LIDAR to scores .53 to .68, semantic grid to semantic grid .62 to .72, three more without a price"
system = whole_system()
_, ax = plt.subplots(figsize=(9.5, 6.2), layout="constrained")
system.draw(ax, highlight=("g1",))
plt.show()

# %% [markdown]
# At the top is the world: what the cells hold ($m_t$, $m'_t$), which sensors see but we don't. Below is what the paper
# computes: there, information flows down to the map that we want ($g_t$, ringed), and from one instant to the next only
# inside $o$.
#
# **Dashed edges are missing.** An exact answer would use what they carry. The system cuts them so that every stage is
# small enough to compute at each scan. The numbers on a dashed edge are its **price** on this toy street, where the
# exact answer can be computed by summing over everything that may happen. (Three dashed edges have no number, because
# their price isn't measured on this street.) Prices here are mean surprise, $-\log P(\text{truth})$ in **nats**, the
# unit of the natural logarithm: first the exact answer's, then the system's. On the edge from $g_{t-1}$ to $g_t$ the
# class of the far cell gets .62 nats if the earlier image is used, and .72 if it is forgotten; in the geometric mean
# the truth then has the probability $e^{-.62} = .54$ or $e^{-.72} = .49$. Where a dashed line runs beside a solid
# arrow, only a part is cut: from $s_t$ to $p_t$ the scores do flow, but not the distance at which each thing was seen.
#
# **Predict before you run.** You know $o_t$ and $p_t$. Does the earlier map $g_{t-1}$ still tell you something about
# $g_t$, as the system computes it? And does the earlier image $i_{t-1}$ tell you something about the *world* $m_t$,
# given both scans and the present image? If so, along which path?
#
# <details><summary>Answer</summary>
#
# About $g_t$ nothing: it is computed from $o_t$ and $p_t$ alone, so once these are known every path to it is closed.
# About the world, yes, along $i_{t-1}$, $m_{t-1}$, $m_t$: a parked car that the camera recognised a moment ago is
# probably still there. The second answer is what the system gives away; the dashed edge from $g_{t-1}$ to $g_t$ would
# bring it back.
#
# </details>

# %% jupyter={"outputs_hidden": true}
print("g_t independent of g_(t-1), given o_t and p_t:", d_separated(system.model, "g1", "g0", given=("o1", "p1")))
print("in the code g1, g0 are g_t, g_(t-1), and near1, near0 are m_t, m_(t-1)")
print("an open path to the world:", " - ".join(why_dependent(system.model, "near1", "i0", given=("l0", "l1", "i1"))))
assert d_separated(system.model, "g1", "g0", given=("o1", "p1"))
assert not d_separated(system.model, "near1", "i0", given=("l0", "l1", "i1"))

# %% [markdown]
# `d_separated` reads independences off the graph, without any numbers; *d-separated* is the field's word for "every
# path between them is closed". The companion [graphical models](deeper/graphical_models.ipynb) introduces it from
# nothing; read it after lecture 01. Lectures show the graph of their stage like this, and add its cut edges to
# one ledger. You find it whole at the end of this page.
#
# | lecture | arrow | idea |
# |---|---|---|
# | **00** | all | you are here |
# | [01](01_bayes.ipynb) | | Bayes' rule on a line: predict, update, repeat |
# | [02](02_grids.ipynb) | $l \to o$ | occupancy grids: evidence, log-odds, and the smear behind a moving car |
# | [03](03_bof.ipynb) | $l \to o$ | BOF: occupancy with velocity |
# | [04](04_cmcdot.ipynb) | $l \to o$ | CMCDOT: four states, particles, resampling |
# | [05](05_pixels.ipynb), [06](06_planes.ipynb) | $s \to p$ | from grid to pixel, eq. (1); sampling that learns, eq. (2) |
# | [07](07_segmentation.ipynb) | $i \to s$ | three networks for segmentation |
# | [08](08_fusion.ipynb) | $(p, o) \to g$ | reduction, fusion, training end to end |
# | [09](09_truth.ipynb) | | where ground truth comes from, and how wrong it is |
# | [10](10_crf.ipynb), [11](11_fast_crf.ipynb) | $g \to g$ | the CRF by hand: equations (3) and (4); the fast CRF |
# | [12](12_experiments.ipynb) | all | the paper's experiments, every claim put to the test |
# | [13](13_real_drive.ipynb) | all | your own street |
# | [14](14_memory.ipynb) | $g_{t-1} \to g_t$ | memory for classes: a cut edge is put back |
#
# ### What the letters mean
#
# Most letters mean the same in all lectures; what stands below the table names the others. Come back to it; don't learn
# it by heart.
#
# | symbol | meaning | in code |
# |---|---|---|
# | $l$, $i$ | LIDAR points (N, 4): x, y, height, reflectance; image (3, h, w) | `frame.points`, `frame.image` |
# | $m_k^t$ | state of cell $k$ at scan $t$: FREE, STATIC, DYNAMIC, UNKNOWN (in 02 free or occupied; in the graphs of 05 to 09 what stands there: road or car) | `State` |
# | $n_t$ | place on the line, in 01; a plain $n$ elsewhere counts something | |
# | $z_t$ | the scan at $t$ (up to 04 also a plain $z$); $P(z_t \mid \cdot)$ is its evidence | `Evidence` |
# | $b$ | belief: a probability for each state | `probability[:, r, c]` |
# | $L$ | log-odds of a cell, $\log P / (1 - P)$ | `L` |
# | $R, M$ | rates of change, 1/s; transition matrix $M = e^{R \Delta t}$ | `rates`, `transition_matrix` |
# | $q$ | a particle, with place, velocity $v$ and weight $w$ | `Particles` |
# | $a$; $a_j$ | probability that something arrives (03, 04); from 05 on the label of a pixel, $a_j$ of pixel $j$ | `arrives` |
# | $e$ | an error that several readings share (01, 02) | |
# | $\tau$; $T_b$ | memory of a cell (02); the time that the filter looks back | |
# | $o$ | occupancy grid (4, H, W): the beliefs of all cells | `belief.probability` |
# | $s$, $p$ | scores of pixels (C, h, w); scores resampled on planes (C, D, H, W) | `scores`, `planes` |
# | $\delta_d$ | height of plane $d$ above the ground, metres | `heights` |
# | $g$; $Q$ | semantic grid (C, H, W): a probability for each class; its mean-field refinement | `grid`, `refined` |
# | $c$ | a class; $x_i$ is the class of cell $i$ in equations (3) and (4), of a pixel, a reading or a return in the graphs of 06, 07 and 09 | |
# | $x, y$; $X, Y, Z$; $u, v$ | grid: forward, left; camera: right, down, ahead; pixel: right, down | `pixels` |
# | $K$, $T$ | the camera's intrinsic matrix; rigid transform, read its name from right to left | `T_camera_from_grid` |
# | $\sigma$ | a standard deviation; its index says of what | |
#
# H x W are cells, h x w pixels, C = 14 classes, D = 20 planes, N points. ($v$ is a velocity in 01 to 04 and a pixel's
# row here and from 05 on; $w$ is a width, and in 04 and 14 a weight; $K$ and $T$ also count cells and scans, before
# 05. From 05 on $z$ without a time is a height. In 05 $R$ is a rotation and $t$ a shift, in 06 $k$ is a kernel, in 06
# and 07 $m$ below a sum counts columns, in 14 $z_t$ is what the camera says. In 10 $l$ is a label, $Z$ a sum over all
# labellings, $K$ a kernel, $p_i$ a part of a step; $k_{ij}$ and $a_l$ are prices, $w_1$ and $w_2$ weights. A letter that isn't in this table means
# something on its own page only.)
#
# ## A map with forward up
#
# Take a toy grid: 4 m ahead, 1 m to each side, cells of one metre. **Row 0 is the farthest ahead, column 0 the
# leftmost**, so the array looks like the map. x points forward (up the page), y to the left.
#
# **Predict before you run.** Where is the centre of cell (0, 0), in metres? And of cell (3, 1)?
#
# <details><summary>Answer</summary>
#
# (0, 0): x = 3.5 m ahead, y = 0.5 m to the left. (3, 1): x = 0.5 m, y = -0.5 m, so half a metre to the right. Rows
# count down from the top edge, x counts up from the vehicle.
#
# </details>

# %% jupyter={"outputs_hidden": true}
toy = GridSpec(x_min=0, x_max=4, y_min=-1, y_max=1, cell=1)
for row, col in ((0, 0), (3, 1)):
    x, y = toy.x_max - (row + 0.5) * toy.cell, toy.y_max - (col + 0.5) * toy.cell
    np.testing.assert_allclose((x, y), toy.centers()[row, col])
    print(f"cell ({row}, {col}): x = {x} m, y = {y} m")
print("the paper's grid has", GridSpec.paper().shape, "cells, the course's", spec.shape, "over the same 71 x 31 m")

# %% [markdown]
# The assertion is a habit of this course: what you compute in a notebook is compared with the package, which is what
# runs on the drive.
#
# ## Stage 1, $l \to o$: what stands where
#
# *Problem: the LIDAR gives points, and each may be wrong. How sure may a cell be?*
#
# One cell, seen before: you believe FREE 0.6, STATIC 0.3, DYNAMIC 0.1. Now one LIDAR return comes back from inside
# it. A return is likely from a thing in the cell (0.8, whether it stands or moves) and unlikely from free space (0.2: a
# ray that grazes the ground may come back from it, for instance).
#
# **Predict before you run.** Is the cell occupied now, and how sure are you? Multiply the three pairs before you open
# the answer.
#
# <details><summary>Answer</summary>
#
# 0.6 · 0.2 = 0.12, 0.3 · 0.8 = 0.24, 0.1 · 0.8 = 0.08. They sum to 0.44, so divide: FREE 0.27, STATIC 0.55,
# DYNAMIC 0.18. So it is occupied with 0.73, instead of 0.4 before. STATIC and DYNAMIC keep their proportion of 3 to 1:
# one scan can't tell whether a thing moves.
#
# </details>
#
# This is Bayes' rule; $m'$ runs over the four states (it isn't the far cell of the graph):
#
# $$ P(m \mid z_t) = \frac{P(z_t \mid m)\, P(m)}{\sum_{m'} P(z_t \mid m')\, P(m')} $$

# %% tags=["bayes"] jupyter={"outputs_hidden": true}
prior = np.array([0.6, 0.3, 0.1, 0.0])  # FREE, STATIC, DYNAMIC, UNKNOWN
product = prior * [0.2, 0.8, 0.8, 0.2]

one_cell = GridSpec(x_min=0, x_max=1, y_min=0, y_max=1, cell=1)
before = FilterState(prior.reshape(4, 1, 1).astype(np.float32), Particles.none(), np.full((1, 1), 0.1, np.float32))
hit = Evidence(occupied=np.full((1, 1), 0.8, np.float32), free=np.full((1, 1), 0.2, np.float32))
after = update(before, one_cell, hit, CmcdotParams()).probability[:, 0, 0]
np.testing.assert_allclose(after, product / product.sum(), atol=1e-6)
print({state.name: round(float(p), 2) for state, p in zip(State, after, strict=True)})

# %% [markdown]
# The paper's filter, **CMCDOT**, does this in every cell at each scan, and three things more: it moves the map
# with the vehicle, it predicts what may happen between two scans, and it carries what moves as particles with a
# velocity. On the real street it makes this of ten scans:

# %% jupyter={"source_hidden": true}
plotting.animate_occupancy(
    spec,
    [result.belief for result in real],
    [result.frame.time for result in real],
    "A map seen from above, over two seconds: free ground grows ahead, a row of parked cars stands on the right, "
    "cars drive towards us on the left, others drive off ahead and leave dark trails, and the rest stays grey, unknown",
)

# %% [markdown]
# The vehicle is at the bottom, in the middle. Light is FREE, dark STATIC, grey UNKNOWN: no beam has said anything
# about these cells, or not for some time, for instance because something stands in front of them. DYNAMIC cells have
# the colour of their velocity on the wheel; where no velocity is drawn, as in panels B and C, DYNAMIC is orange. Our
# cell lies in the row of parked cars on the right, and panel C says the same of it: STATIC with more than 90 % from
# the second scan on. Dark trails grow behind the cars that drive off ahead of us; lectures 02 to 04 explain where they
# come from.
#
# ## Stage 2, $i \to s$: what it looks like
#
# *Problem: no return says "car". A camera's pixels can.*
#
# A network, SegNet, gives every pixel 14 **scores**, one per class: the higher, the more the pixel looks like the
# class. Four words you will need:
#
# - a **convolution** slides one small table of weights over the image: each output is a weighted sum of the pixels
#   around it;
# - **pooling** keeps the largest value of each 2 x 2 block, so the network sees farther and less sharply;
# - a **skip** hands a sharper, earlier layer to a later one, to win back what pooling has lost;
# - a **soft-max** turns scores into probabilities: exponentiate, then divide by the sum.
#
# **Predict before you run.** Three scores: 2, 1, 0. Which probabilities does a soft-max make of them? What if you add
# 5 to all three?
#
# <details><summary>Answer</summary>
#
# $e^2 = 7.4$, $e^1 = 2.7$, $e^0 = 1$, with the sum 11.1: 0.67, 0.24, 0.09. Adding 5 multiplies all three by $e^5$,
# which cancels: the same.
#
# </details>

# %% jupyter={"outputs_hidden": true}
for scores in (np.array([2.0, 1, 0]), np.array([7.0, 6, 5])):
    print((np.exp(scores) / np.exp(scores).sum()).round(2))

# %% jupyter={"source_hidden": true} alt="the street coloured by the class of the highest score in each pixel, with the column of dots of our cell: road, cars, trees and houses have the colours of their classes; the sky is coloured partly as building, partly as vegetation and signage, and patches at a fence on the left as pedestrian"
small = resize_image(now.frame.image, now.scores.shape[1:]) // 8 * 8
fig, ax = plt.subplots(figsize=(8, 3), layout="constrained")
plotting.image_labels(small, now.scores.argmax(axis=0), KITTI_14, ax=ax)
shrink = small.shape[1] / now.frame.image.shape[1]
column = (story.pixels + 0.5) * shrink - 0.5
ax.plot(*column.T, "o", color="white", markeredgecolor="black", markersize=4)
plt.show()
labelled = resize_labels(now.frame.labels.image, now.scores.shape[1:])
assert 0.975 < (now.scores.argmax(axis=0) == labelled)[labelled < 255].mean() < 0.985
assert KITTI_14.index("sky") not in labelled

# %% [markdown]
# Each pixel has the colour of its highest score; the white dots are our cell's column of panel A. Of the pixels with a
# label 98 % have the right colour. But the network has learned from this very image, and where no label ever was it
# guesses: no LIDAR return comes back from the sky, so none of its pixels has a label, and it is coloured as *building*,
# *vegetation* or *signage*. The system doesn't use the colours. It passes on all 14 scores of each pixel, without a soft-max. (Each
# is the mean over three image networks, which last learned from labelled pixels. A network that the *map's* errors
# trained last, as in the paper, may make signals of its scores that no longer name what a pixel shows: lectures 07, 08.)
#
# ## Stage 3, $s \to p$: from pixels to places
#
# *Problem: a pixel is a direction, not a place. Which cell does it belong to?*
#
# Go the other way, which is safe: a place has one pixel. Take a camera with a focal length of 200 pixels whose axis
# meets the image at (160, 48). A point lies $X$ = 1.5 m to the right, $Y$ = 1 m below the camera, $Z$ = 10 m ahead.
#
# **Predict before you run.** Its pixel? And where does it go when the point is twice as far ahead?
#
# <details><summary>Answer</summary>
#
# u = 160 + 200 · 1.5 / 10 = 190 and v = 48 + 200 · 1 / 10 = 68. Twice as far: (175, 58), half-way to the axis.
# Everything far ahead gathers at (160, 48), the vanishing point of the road.
#
# </details>
#
# $$ \begin{pmatrix} u \\ v \\ 1 \end{pmatrix} = K \begin{pmatrix} X/Z \\ Y/Z \\ 1 \end{pmatrix}, \qquad
#    K = \begin{pmatrix} 200 & 0 & 160 \\ 0 & 200 & 48 \\ 0 & 0 & 1 \end{pmatrix} \qquad (1) $$

# %% tags=["eq-1"] jupyter={"outputs_hidden": true}
K = np.array([[200.0, 0, 160], [0, 200, 48], [0, 0, 1]])
for Z in (10, 20, 40):
    u, v, _ = K @ np.array([1.5 / Z, 1.0 / Z, 1.0])
    np.testing.assert_allclose(project(np.array([1.5, 1.0, Z]), Camera(K, np.eye(4), size=(96, 320)))[0], (u, v))
    print(f"Z = {Z:2d} m:  u = {u:6.2f}  v = {v:5.2f}")

# %% [markdown]
# The point rarely falls on the centre of a pixel. Say its column is 10.25 and its row 6.5. Then four pixels surround
# it, and **bilinear** interpolation weights each by how near it is: 0.75 or 0.25 from left to right, 0.5 and 0.5 from
# top to bottom. Their scores for *car* are
#
# | | column 10 | column 11 |
# |---|---|---|
# | row 6 | 4 | 0 |
# | row 7 | 2 | 8 |
#
# **Predict before you run.** Which score for *car* does the point get?
#
# <details><summary>Answer</summary>
#
# 0.75 · 0.5 · 4 + 0.25 · 0.5 · 0 + 0.75 · 0.5 · 2 + 0.25 · 0.5 · 8 = 1.5 + 0 + 0.75 + 1 = 3.25.
#
# </details>
#
# With $s_c(u', v')$ the score of class $c$ in pixel $(u', v')$, equation (2) says so for every pixel, although only
# four have a weight above zero:
#
# $$ p_c = \sum_{u', v'} s_c(u', v') \, \max(0, 1 - |u - u'|) \, \max(0, 1 - |v - v'|) \qquad (2) $$

# %% tags=["eq-2"] jupyter={"outputs_hidden": true}
scores = np.zeros((1, 12, 16))  # one class, 12 rows, 16 columns
scores[0, 6:8, 10:12] = [[4, 0], [2, 8]]
rows, columns = np.indices((12, 16))
weights = np.maximum(0, 1 - abs(10.25 - columns)) * np.maximum(0, 1 - abs(6.5 - rows))
score = (scores[0] * weights).sum()
print("score of the point:", score, "  pixels with a weight:", (weights > 0).sum())
point = np.array([10.25, 6.5]).reshape(1, 1, 1, 2)  # one plane of one cell
np.testing.assert_allclose(sample_planes_naive(scores, point, np.ones((1, 1, 1), bool)), score)

# %% [markdown]
# Now lay 20 horizontal planes over the grid, 20 cm apart, and let each point of each plane take its scores like this.
# No depth is needed, and none is used. To see what that does, let us carry something that we know to be right: the true
# labels of an image of a *simulated* street, in which each pixel's class is known.
#
# **Predict before you run.** What does the road look like on a plane 1 m above it? And on a plane at 2 m, if the camera
# hangs 1.66 m above the ground?
#
# <details><summary>Answer</summary>
#
# Only what really lies at a plane's height comes out in its place. The plane at 1 m lies between the road and the
# camera, so the road is pulled towards the vehicle and gets narrower. The plane at 2 m lies above the camera: rays to
# its points rise and never meet the road. A thing that stands is right on the planes that cut it, and on lower ones it
# is smeared away from the camera, like a shadow cast by a lamp in the camera's place.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three label maps of a simulated street, planes at 0, 1 and 2 metres: the road is broad on the first, narrow on the second and absent on the third; cars and houses are smeared away from the camera"
drive = sample_drive()
trained = load_net(sample_weights(), drive.camera)
image_labels = torch.from_numpy(resize_labels(drive[19].labels.image, now.scores.shape[1:]))
one_hot = torch.stack([image_labels == c for c in range(len(KITTI_14))]).float()
planes = trained.sampler(one_hot[None])[0].numpy()  # (C, D, H, W)
seen = (planes != 0).any(axis=0)
labels = np.where(seen, planes.argmax(axis=0), 255)
plotting.label_maps(spec, {f"plane at {0.2 * d:.0f} m": labels[d] for d in (0, 5, 10)}, KITTI_14)
plt.show()

# %% jupyter={"source_hidden": true}
on_road = [(labels[d] == ROAD).sum() / seen[d].sum() for d in (0, 5, 10)]
assert on_road[0] > on_road[1] > on_road[2] == 0
np.testing.assert_allclose(drive.camera.T_camera_from_grid[1, 3], 1.66, atol=0.01)
one_pixel = torch.zeros(1, 1, *now.scores.shape[1:])
one_pixel[..., 45, 160] = 1
assert (trained.sampler(one_pixel) > 0).any(dim=2).sum() > 50

# %% [markdown]
# White cells lie outside the picture. No single plane is right everywhere, and a pixel's scores can go into many cells
# along its ray (those of one pixel near the horizon into more than fifty): that is the dashed edge from $s_t$ to $p_t$
# in the graph. Which plane to believe where is for the next stage to find out.
#
# ## Stage 4, $(p, o) \to g$: one map
#
# *Problem: planes know what but not where, occupancy knows where but not what.*
#
# A **1x1 convolution** makes 16 numbers of the 20 x 14 scores of a cell: the same weighted sums in each cell, without a
# look at its neighbours. The four states of $o$ join them. A small network with pooling and skips then gives each cell
# a probability for each class, by a soft-max. Its score for a class is a sum of parts, and panels D to F show them:

# %% tags=["nbval-ignore-output"]
why = story.why
parts = {"image": why.planes.sum(), "occupancy": why.occupancy.sum(), "constants": why.rest}
print(f"{KITTI_14.names[story.label]} against {KITTI_14.names[story.rival]}, in our cell:")
for name, part in (parts | {"sum": why.score}).items():
    print(f"   {name:<10} {part:+.1f}")
np.testing.assert_allclose(sum(parts.values()), why.score, rtol=1e-6)
odds = now.grid[story.label, *CELL] / now.grid[story.rival, *CELL]
np.testing.assert_allclose(np.exp(why.score), odds, rtol=0.01)
assert min(parts.values()) > 0
assert KITTI_14.names[story.rival] == "vegetation"

# %% [markdown]
# Both sensors speak for *car*, and so do the constants, which come from the network's biases and from no sensor. The
# parts add up (before rounding) to the difference of the two scores, and by the soft-max $e^\text{difference}$ is the odds of
# *car* against the runner-up. (A part isn't what would change without this input; lecture 08 measures that.) The map on
# the left shows the most probable class of each cell:

# %% jupyter={"source_hidden": true} alt="two label maps of the real street: semantic grid, and labels, which have gaps; road in the middle, a row of parked cars, trees and a building on the right"
truth = grid_truth(now.frame.labels, now.belief.probability, spec)
plotting.label_maps(
    spec, {"semantic grid $g$": now.grid.argmax(axis=0), "labels; outside the view, states": truth}, KITTI_14
)
plt.show()

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
for name in ("road", "car", "vegetation", "building"):
    c, claimed = KITTI_14.index(name), now.grid.argmax(axis=0)
    cells = truth == c
    print(f"{name:<11} {cells.sum():5d} labelled cells, the map calls {100 * (claimed[cells] == c).mean():3.0f} % so")
    assert (claimed[cells] == c).mean() > 0.5

# %% [markdown]
# On the right, inside the camera's view, are labels that people gave to LIDAR returns; white cells have none. There the
# map guesses: the long *bicycle* straight ahead lies behind the white car, where no return came from. Where the
# camera doesn't see, both maps show only the filter's states, the last four of the 14 classes: *unknown-free*,
# *unknown-static*, *unknown-dynamic* and *unknown-unobserved*. Of each of the four classes that are printed, most
# labelled cells are right. But this network has learned from this very street, so the picture shows what the stages do,
# and not how well they would do on yours. For that we need other streets, and an honest score, in a moment.
#
# ## Stage 5: refinement by a CRF
#
# *Problem: each cell decided by itself, and a few cells look out of place.*
#
# Neighbours are usually alike. A **conditional random field** charges a price for two nearby cells with different
# labels, the more so when their occupancy is alike, and looks for a probable map under these prices.
#
# **Predict before you run.** Which cells change: big areas, or small things? What does that do to a pedestrian, one or
# two cells large?
#
# <details><summary>Answer</summary>
#
# Holes and crumbs in big areas are filled, and small things are in danger of being filled too. The paper finds pixel
# accuracy slightly up and class accuracy down.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three label maps: before the CRF, after it, and only the cells that changed, which are crumbs, borders, distant cars, a patch of sidewalk far ahead and most of a strip of it along the left edge"
before, after = now.grid.argmax(axis=0), now.refined.argmax(axis=0)
changed = np.where(after != before, after, 255)
plotting.label_maps(spec, {"before": before, "after": after, "what changed, and to what": changed}, KITTI_14)
plt.show()

# %% tags=["nbval-ignore-output"]
known = (truth < KITTI_14.n_semantic) & (after != before)
mended, spoiled = (after == truth)[known].sum(), (before == truth)[known].sum()
print(f"{known.sum()} labelled cells changed: {mended} became right, {spoiled} were right before")
assert (after != before).mean() < 0.1
assert spoiled > mended > 0

# %% [markdown]
# More than nine cells in ten keep their class, ours among them (panel G). The map looks tidier, and it has become
# worse: of the labelled cells that changed, more were right before than are right now. Look at the left edge: most
# of the strip of sidewalk has become road.
#
# ## How good is it?
#
# *Problem: one number for a map. Which?* Eight cells: seven of road, one car. A lazy map says *road* everywhere.
#
# **Predict before you run.** What share of the cells is right? What share of the road, what share of the car, and the
# mean of these two?
#
# <details><summary>Answer</summary>
#
# 7/8 of all cells: a **pixel accuracy** of 0.875. All of the road, none of the car: a **class accuracy** of 0.5. Only
# one of the two noticed.
#
# </details>

# %% tags=["accuracies", "fmiou"] jupyter={"outputs_hidden": true}
truth_row, lazy = np.array([ROAD] * 7 + [CAR]), np.full(8, ROAD)
right = truth_row == lazy
by_class = [right[truth_row == c].mean() for c in (ROAD, CAR)]
iou = [7 / 8, 0 / 1]  # right / (true or claimed): of road 7 of 8 cells, of car none of 1

counts = confusion_matrix(truth_row, lazy, n_classes=14)
np.testing.assert_allclose(right.mean(), pixel_accuracy(counts))
np.testing.assert_allclose(np.mean(by_class), class_accuracy(counts))
np.testing.assert_allclose(7 / 8 * iou[0] + 1 / 8 * iou[1], frequency_weighted_iou(counts))
print(f"pixel accuracy {right.mean():.3f}, class accuracy {np.mean(by_class):.3f}, FmIoU {7 / 8 * iou[0]:.3f}")

# %% [markdown]
# The third number, **FmIoU**, is the paper's frequency-weighted mean intersection over union: for each class the cells
# that are right, divided by all cells that truly are or are called so, weighted by how frequent the class is. Unlike
# the other two, it also charges a class for cells that it claims wrongly.
#
# Now an honest score. The project ships a second drive, through a *simulated* street: there every cell's truth is
# known, and a network that has never seen this street makes the map. Many cells can't be seen by the camera and count
# as *unknown*; the rows "semantic" leave them out.

# %% jupyter={"source_hidden": true}
simulated = list(run_pipeline(drive, trained))
truths = [grid_truth(r.frame.labels, r.belief.probability, spec) for r in simulated]


def drive_confusion(stage, cells=slice(None)):
    """Add up the confusion of a stage ("grid" or "refined") over the frames, for some cells."""
    maps = [getattr(result, stage).argmax(axis=0) for result in simulated]
    return sum(confusion_matrix(t[cells], m[cells], n_classes=14) for t, m in zip(truths, maps, strict=True))


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
print(f"{'per cent':<28}{'pixel acc.':>11}{'class acc.':>11}{'FmIoU':>8}")
for stage in ("grid", "refined"):
    whole = drive_confusion(stage)
    for cells, matrix in (("all cells", whole), ("semantic cells", semantic_cells(whole, KITTI_14))):
        numbers = [100 * f(matrix) for f in (pixel_accuracy, class_accuracy, frequency_weighted_iou)]
        print(f"{stage + ', ' + cells:<28}{numbers[0]:>11.0f}{numbers[1]:>11.0f}{numbers[2]:>8.0f}")
assert pixel_accuracy(drive_confusion("refined")) > pixel_accuracy(drive_confusion("grid"))
assert class_accuracy(drive_confusion("refined")) < class_accuracy(drive_confusion("grid"))

# %% [markdown]
# Over all cells the CRF lifts the pixel accuracy a little and costs class accuracy, as in the paper. The last digit may
# differ on your machine, the two assertions may not. One short drive says that the pipeline works, and little about other
# streets; lecture 12 gives such numbers intervals.
#
# ## Play with it
#
# Drag the slider through the simulated drive. Watch something that moves: when does the filter notice? (Without a
# running kernel there is no slider; the figure below it shows three instants.)


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
def draw(result, axes):
    """Draw one instant: occupancy with velocities, and the refined map."""
    plotting.occupancy(spec, result.belief.probability, ax=axes[0], legend=False)
    plotting.velocity(
        spec, result.belief.probability, result.belief.velocity, axes[0], result.belief.velocity_covariance
    )
    plotting.grid_labels(spec, result.refined.argmax(axis=0), KITTI_14, ax=axes[1], legend=False)
    axes[0].set_title(f"{result.frame.time:.1f} s: states")
    axes[1].set_title("refined classes")


def show(k):
    """Show frame k."""
    _, axes = plt.subplots(1, 2, figsize=(7, 6), layout="compressed")
    draw(simulated[k], axes)
    plt.show()


_ = interact(show, k=IntSlider(value=0, min=0, max=len(simulated) - 1, description="frame"))
# %% jupyter={"source_hidden": true} alt="three instants of the simulated drive, each as occupancy map and refined map: at first nothing is orange, later the cars that move are orange with arrows; legends of states and classes"
fig, axes = plt.subplots(1, 6, figsize=(15, 5.5), sharey=True, layout="compressed")
shown = [simulated[k] for k in (0, len(simulated) // 2, len(simulated) - 1)]
for pair, result in zip(axes.reshape(3, 2), shown, strict=True):
    draw(result, pair)
for ax in axes[1:]:
    ax.set_ylabel("")
fig.legend(handles=colour_patches(STATE_NAMES, STATE_COLOURS), loc="outside lower left", ncols=4, frameon=False)
class_legend(axes[-1], KITTI_14, np.stack([result.refined.argmax(axis=0) for result in shown]))
plt.show()

# %% [markdown]
# Of each pair, the left map shows the states (DYNAMIC is orange, with its velocity as an arrow) and the right one the
# refined classes.

# %% [markdown]
# ## Where this breaks
#
# Three failures on the simulated street, where we know the truth. None is repaired for this page.
#
# **What moves seems to stand, for a while.** In the last frame two cars come towards us on the left (arrows down), 7
# and 14 m ahead, one behind the other. Follow them back in time through the truth. In each frame, take the cells that a
# car fills and that the filter holds occupied: how much of them does it call DYNAMIC?


# %% jupyter={"source_hidden": true}
def follow(place):
    """Follow the car at `place`, metres, back from the last frame; return the beliefs (4, cells) on it, first to last.

    The second list holds the beliefs on the two metres of the lane that it drives into.
    """
    on_it, before_it = [], []
    for result in simulated[::-1]:
        cars, n_cars = ndimage.label(result.frame.labels.birdseye_on(spec) == CAR)
        centers = np.array([spec.centers()[cars == n].mean(axis=0) for n in range(1, n_cars + 1)])
        nearest = np.linalg.norm(centers - place, axis=1).argmin()
        place, cells = centers[nearest], cars == nearest + 1
        to_front = spec.centers()[cells][:, 0].min() - spec.centers()[..., 0]
        lane = (abs(spec.centers()[..., 1] - place[1]) < 0.8) & (to_front > 0) & (to_front < 2)
        on_it.append(result.belief.probability[:, cells])
        before_it.append(result.belief.probability[:, lane])
    return on_it[::-1], before_it[::-1]


def dynamic_share(belief):
    """Return the mean P(DYNAMIC) in the occupied cells."""
    occupied = belief[State.STATIC] + belief[State.DYNAMIC] > 0.5
    return belief[State.DYNAMIC, occupied].mean() if occupied.any() else np.nan


# %% jupyter={"source_hidden": true} alt="P(DYNAMIC) of two cars against time: both begin near zero; the nearer car passes one half after less than a second, the one behind it later"
times = np.array([r.frame.time for r in simulated]) - simulated[0].frame.time
followed = {ahead: follow((ahead, 7)) for ahead in (7, 14)}
moving = {ahead: np.array([dynamic_share(b) for b in on_it]) for ahead, (on_it, _) in followed.items()}
fig, ax = plt.subplots(figsize=(6, 2.6), layout="constrained")
for ahead, style in ((7, "o-"), (14, "s--")):
    ax.plot(times, moving[ahead], style, color="0.3", label=f"{ahead} m ahead")
ax.set(xlabel="time since the first scan [s]", ylabel="P(DYNAMIC) on the car", ylim=(0, 1))
ax.legend(title="in the last frame:")
plt.show()

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
first, second = (times[(moving[ahead] > 0.5).argmax()] for ahead in (7, 14))
print(f"P(DYNAMIC) passes one half after {first:.1f} s on the nearer car, after {second:.1f} s on the one behind it")
clear = [np.mean([b[State.FREE].mean() for b in before_it[:10]]) for _, before_it in followed.values()]
print("P(FREE) on the two metres in front of each, mean of the first second: {:.2f} and {:.2f}".format(*clear))
assert 0.5 < first < 1.1
assert second > 1.2 * first
assert clear[0] > 0.9 > 0.65 > clear[1]

# %% [markdown]
# The first scans show that *something* is there, and nothing says that it moves: STATIC is the better bet. The filter
# changes its mind only when the thing arrives where free space was seen before. For the first car that takes most of a
# second. For the second it takes longer. The likely reason is that the street in front of it is less surely free: the
# first car hides it, and then leaves a trail there that still looks occupied. Until then, a planner that trusts this
# map takes a moving car for a parked one. What the image shows might help; that is the dashed edge from $i_t$ to
# $o_t$.
#
# **Far away fewer cells are right.**

# %% jupyter={"source_hidden": true} alt="bars of the share of semantic cells that are right, by distance: high below 30 metres, lower from 30 to 45, lowest beyond"
ahead = spec.centers()[..., 0]
bands = {"0-15 m": (0, 15), "15-30 m": (15, 30), "30-45 m": (30, 45), "45-71 m": (45, 71)}
in_band = [(ahead >= near) & (ahead < far) for near, far in bands.values()]
shares = [100 * pixel_accuracy(semantic_cells(drive_confusion("refined", band), KITTI_14)) for band in in_band]
fig, ax = plt.subplots(figsize=(6, 2.6), layout="constrained")
ax.bar(list(bands), shares, color="0.4")
ax.set(xlabel="distance ahead", ylabel="semantic cells right [%]", ylim=(0, 100))
plt.show()

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
print("semantic cells right:", ", ".join(f"{share:.0f} % at {band}" for band, share in zip(bands, shares, strict=True)))
assert shares[0] > 75 > 65 > shares[3]
assert shares[1] > shares[2] > shares[3]
focal = drive.camera.K[1, 1] * simulated[0].scores.shape[1] / drive.camera.size[0]
high = {d: focal * drive.camera.T_camera_from_grid[1, 3] * spec.cell / d**2 for d in (15, 45)}
print("height of a cell in the network's image:", ", ".join(f"{h:.2f} pixels at {d} m" for d, h in high.items()))

# %% [markdown]
# Near the vehicle most semantic cells are right, beyond 45 m far fewer. At 45 m more than a dozen cells share one row
# of the network's pixels, and the rings that the LIDAR's beams draw on the ground lie metres apart.
#
# **Cars and pedestrians are missed.** Of all cells that truly hold a class, how many does the map call by this name?

# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
for name in ("road", "sidewalk", "car", "pedestrian", "bicycle"):
    c = KITTI_14.index(name)
    found = [drive_confusion(stage)[c, c] / drive_confusion(stage)[c].sum() for stage in ("grid", "refined")]
    print(f"{name:<11} {100 * found[0]:3.0f} % found; after the CRF {100 * found[1]:3.0f} %")
    assert (found[1] > found[0]) == (name == "road")

# %% [markdown]
# Of the road most cells are found, of cars and pedestrians fewer than half. The CRF finds a little more of the road and
# less of each of the four others. Lecture 10 counts which classes lose most.
#
# ## The ledger of cut edges
#
# Every stage can be read as inference in a model from which edges were cut to make it affordable. Here is what that
# costs, each on a toy world of its own lecture in which the exact answer can be computed. *What is asked* names a
# quantity; the last two columns give its exact value, and what the system says without the edge. (In the first row more
# is better: how often a place is named rightly. In the rows with a root mean square error or with nats, less is better. In the others
# only the exact value is right.) An edge has the names of its lecture's graph, and stands for all of its kind: `m2 -> a3`
# means every $m_i \to a_j$ with $i < j$, `m5 - m6` every pair of cells, `n1 <- n2` every step of the trip. (In the rows
# of 00, 0 is $t-1$ and 1 is $t$.)

# %% tags=["ledger"]
Markdown(ledger_table(ledger()))

# %% [markdown]
# Don't add the numbers up: they have different units, and each toy world was chosen to show its edge. Read the table as
# a list of questions about *your* street. One edge you can pay back yourself: `g0 -> g1`, by carrying the classes along
# from one semantic grid to the next (lecture [14](14_memory.ipynb)).
#
# ## The registers
#
# Every equation and numbered procedure of the paper, where it stands in the code, and which lecture derives it:

# %%
Markdown(equation_table())

# %% [markdown]
# And each stage as a graphical model: the function that builds it small enough for exact inference, the test that
# compares exact inference with what the package computes, and where its graph is drawn.

# %%
Markdown(stage_table())

# %% [markdown]
# ## In five lines
#
# 1. A map seen from above, forward up, is an array; row 0 is the farthest ahead.
# 2. A Bayes filter turns scans into four probabilities per cell: FREE, STATIC, DYNAMIC, UNKNOWN.
# 3. A network scores pixels; equation (1) tells each cell, at each of twenty heights, which pixel to ask, and equation
#    (2) reads the score there. No depth is used.
# 4. A second network fuses planes and occupancy into classes; a CRF tidies up, and pixel accuracy alone would flatter
#    a lazy map.
# 5. Each stage is inference in a model with some edges cut. The graph shows the cuts, and the ledger their price.
#
# What you can now do: take any cell of any map that this system makes and tell which stage said what about it. The
# page that `semgrid-edu demo --open` writes does it at a click.
#
# ## Further reading
#
# - The paper: [hal-02302533](https://hal.archives-ouvertes.fr/hal-02302533).
# - Elfes, *Using occupancy grids for mobile robot perception and navigation*, Computer 22(6), 1989: the idea of the
#   grid.
# - Rummelhard, Nègre, Laugier, *Conditional Monte Carlo Dense Occupancy Tracker*, ITSC 2015: the filter.
# - Badrinarayanan, Kendall, Cipolla, *SegNet*, PAMI 39(12), 2017: the image network.
# - Krähenbühl, Koltun, *Efficient inference in fully connected CRFs with Gaussian edge potentials*, NIPS 2011: the
#   refinement.
# - Koller, Friedman, *Probabilistic Graphical Models*, MIT Press 2009: the language of the graphs.
#
# ## Exercise
#
# [Exercise 00](exercises/00_tour.ipynb): from metres to cells, Bayes' rule in every cell, a point's pixel, three
# scores of a map, the price of a cut edge, and one question.

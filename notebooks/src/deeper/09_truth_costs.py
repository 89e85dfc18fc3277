# %% [markdown]
# # What wrong labels cost the network that learns from them
#
# **In one sentence.** A network can even out errors that its labels make at random, and learns those that they always
# make; and test labels with the same errors hide it.
#
# **You will be able to**
# - work out which errors of labels a network learns;
# - read from a graph why labels of one kind favour a network that learned from labels of that kind;
# - say for eight kinds of labels what learning from them costs.
#
# **Prerequisites.** Lectures [08](../08_fusion.ipynb) (the weighted loss) and [09](../09_truth.ipynb) (how labels are
# made); the intervals are those of lecture [12](../12_experiments.ipynb).
#
# **Time.** 15 minutes; the computer needs seconds, because the results are committed.

# %% jupyter={"source_hidden": true}
import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from semgrid_edu import plotting
from semgrid_edu.workshop.paper.truth_costs import LEARNED_FROM
from semgrid_edu.graphical import Factor, GraphicalModel, d_separated, draw, eliminate

sys.path.append("..")  # for worlds/, in the folder above
from worlds.lecture_12_pictures import forest_plot

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
result = json.loads(Path("../../docs/results/reduced/truth-costs.json").read_text(encoding="utf-8"))
rows = {row["truth"]: row for row in result["rows"]}

# %% [markdown]
# ## Errors that vary, and errors that don't
#
# A network doesn't copy its labels one by one. Take one cell of road, and ten training frames whose images look alike
# there. What does the network learn to say of such a cell?
#
# | its ten labels | how the errors come about | the network learns |
# |---|---|---|
# | 8 road, 2 car | in two of the frames a car that had passed left a streak | *road*: right, although a fifth of its labels is wrong |
# | 10 fence | the cell lies behind a fence, and returns that the camera doesn't see carry the fence's label | *fence*: as wrong as its labels |
#
# The cross-entropy of ten labels, $-\sum_c n_c \log p_c$, is lowest at the shares of the labels, $p_c = n_c / 10$. So the
# network says 0.8 and 0.2 in the first case, and the map shows the larger one. Errors that vary among frames that look
# alike are evened out. Errors that come with what the image shows are learned.

# %%
n = np.array([8, 2])
p = np.linspace(0.001, 0.999, 999)  # what the network may say for road
loss = -(n[0] * np.log(p) + n[1] * np.log(1 - p))
print(f"the loss is lowest at p(road) = {p[loss.argmin()]:.2f}")
assert np.isclose(p[loss.argmin()], 0.8, atol=1e-3)

# %% [markdown]
# ## Which labels may judge?
#
# Suppose that a network has learned an error of its labels. Would a test find out? That depends on the labels that it
# is tested with. Here is the graph. The **recipe** $r$ is the way in which labels are made. A training cell with the
# true class $m$ gets the label $y$, and from labels a network is trained; $w$ are its weights. In a test cell with the
# true class $m'$ it calls the class $c$. The test's label $y'$ is made by the same recipe.

# %% tags=["graph"] jupyter={"source_hidden": true} alt="a directed graph: the recipe r points to the training label y and to the test label y prime; m points to y, y to the weights w, w and m prime to the call c, m prime to y prime"
wrong = np.array([0.05, 0.8])  # P(a label is wrong | a good recipe, a bad one), in cells of a certain kind
label = np.array([[[1 - e, e], [e, 1 - e]] for e in wrong]).transpose(1, 0, 2)  # P(y | m, r)
copied = np.array([[0.9, 0.1], [0.1, 0.9]])  # P(w | y): the network mostly learns what it is told
call = np.array([[[0.9, 0.1], [0.1, 0.9]]] * 2)  # P(c | m', w): in cells that look alike it says what it learned
priors = {"r": [0.7, 0.3], "m": [0.99, 0.01], "m'": [0.99, 0.01]}
tables = {("m", "r", "y"): label, ("y", "w"): copied, ("m'", "w", "c"): call, ("m'", "r", "y'"): label}
graph = GraphicalModel(
    [Factor(names, table) for names, table in (priors | tables).items()],
    {names[-1]: names[:-1] for names in tables},
)
places = {"r": (2, 2), "m": (0, 1), "y": (1, 1), "w": (1, 0), "c": (2, -0.2), "m'": (3.6, 0), "y'": (3, 1)}
_, ax = plt.subplots(figsize=(7, 4.2), layout="constrained")
draw(graph, ax, observed=("m'",), positions=places, labels={"m'": "$m'$", "y'": "$y'$"})
plt.show()

# %%
assert not d_separated(graph, "c", "y'", given=("m'",))
assert d_separated(graph, "c", "y'", given=("m'", "r"))
both = eliminate(graph, ("c", "y'"), given={"m'": 0}).table  # class 0 is true; 1 is wrong
print(f"P(test label wrong) = {both[:, 1].sum() / both.sum():.2f}", end=", ")
print(f"given that the network is wrong too: {both[1, 1] / both[1].sum():.2f}")
bad = eliminate(graph, ("c", "y'"), given={"m'": 0, "r": 1}).table
print(f"a bad recipe: the test says that {np.trace(bad) / bad.sum():.2f} of the calls are right", end=", ")
print(f"and {bad[0].sum() / bad.sum():.2f} are")

# %% [markdown]
# Given the true class (shaded), the network's call and the test's label aren't independent: a path leads from $c$
# over $w$ and $y$ up to the recipe, and down to $y'$. Given the recipe as well, they are. In this toy three recipes
# in ten are bad; a bad one is wrong in 80 % of such cells, a good one in 5 %. So a test label is wrong with
# probability 0.28. But where the network is wrong, the test label is wrong with 0.48, and then the test counts the
# error as right. With a bad recipe the test says that 61 % of the calls are right; 31 % are. Labels of the recipe
# from which the network learned miss many of its errors. The truth finds them all, and labels of another recipe find
# those that the other recipe doesn't make.
#
# ## Eight kinds of labels, one network
#
# The simulator knows the truth, so we can let it judge. SegNet learned from the same 142 training frames, each time
# with other labels: those of our reading of the paper's recipe (*usual*); the true ones; those of one scan without clean-up,
# de-skewed, or only where the camera sees (*visible to camera*); and those of ten scans with moving things smeared,
# carved or carried (lecture 09). Image stages, three seeds and steps are the same. The networks were trained on a GPU,
# and each was scored on 110 test drives (`semgrid-edu reproduce truth-costs`).
#
# **Predict before you run.** By the true labels, the network that learned from true labels is the best of the eight, of
# course. Which place does it get if the *usual* labels judge?
#
# <details><summary>Answer</summary>
#
# The last but one. The usual labels have holes, cells called unknown although something is there. A network that fills
# one rightly is counted wrong.
#
# </details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
JUDGES = {"true": "true labels", "lidar": "usual labels"}
print("pixel accuracy over all cells, per cent, by the judge")
for truth in ("lidar", "true"):
    of_network = (rows[truth]["scores"][judge]["all"]["pixel accuracy"]["mean"] for judge in ("lidar", "true"))
    print(
        "learned from {:<18}{:.0%} by the usual labels, {:.0%} by the true ones".format(
            LEARNED_FROM[truth], *of_network
        )
    )

# %% jupyter={"outputs_hidden": true, "source_hidden": true} alt="differences of seven networks from the usual one, with intervals and seeds, by the true labels on the left and by the usual labels on the right; the network that learned from true labels is far above zero on the left and far below on the right"
_, *others = rows
fig, axes = plt.subplots(1, 2, figsize=(11, 3.8), layout="constrained")
for ax, (judge, name) in zip(axes, JUDGES.items(), strict=True):
    lost = {LEARNED_FROM[truth]: rows[truth]["differences"][judge]["all"]["pixel accuracy"] for truth in others}
    forest_plot(lost, ax, f"{name} judge: difference from the usual network [points]", reference=0)
axes[1].set_yticklabels([])
plt.show()

# %% [markdown]
# **The judge decides.** By the true labels the network that learned from them is 9 points above the usual one. By the usual
# labels it is 8 points below! A study with these labels alone would have thrown the true ones away.
#
# **Better labels bring less than half of their own gain.** Over the cells with a class the true labels are 38 points
# better than the usual ones, because they are right everywhere. The network that learned from them gains 15.

# %% jupyter={"source_hidden": true}
told = {
    (t, judge): 100 * rows[t]["differences"][judge]["all"]["pixel accuracy"]["mean"] for t in others for judge in JUDGES
}
assert [round(told["true", judge]) for judge in JUDGES] == [9, -8]
by_judge = {j: {t: row["scores"][j]["all"]["pixel accuracy"]["mean"] for t, row in rows.items()} for j in JUDGES}
assert max(rows, key=by_judge["true"].get) == sorted(rows, key=by_judge["lidar"].get)[1] == "true"
labels = {t: 100 * row["labels"]["semantic"]["pixel accuracy"]["mean"] for t, row in rows.items()}
gain = 100 * rows["true"]["differences"]["true"]["semantic"]["pixel accuracy"]["mean"]
print(f"labels better by {labels['true'] - labels['lidar']:.0f} points, network by {gain:.0f}")
assert (round(gain), round(labels["true"] - labels["lidar"])) == (15, 38)

# %% [markdown]
# ## Where this breaks
#
# It is one network of small size, 500 steps, on simulated streets. With few steps a network hasn't learned the errors of
# its labels by heart yet. The class weights were computed anew for each kind of labels, so a part of each difference may be
# theirs.
#
# ## In three lines
#
# 1. Errors that vary among frames that look alike are evened out; errors that come with what the image shows are
#    learned.
# 2. Test labels that were made like the training labels favour the network that learned from them: true labels brought
#    9 points by the true labels, and cost 8 by the usual ones.
# 3. Over cells with a class, true labels brought the network less than half of their own gain.
#
# ## Further reading
#
# - Rolnick, Veit, Belongie, Shavit, *Deep learning is robust to massive label noise*, 2017: errors that vary.
# - Northcutt, Athalye, Mueller, *Pervasive label errors in test sets destabilize machine learning benchmarks*, NeurIPS
#   2021: who may judge.
# - [The results](../../docs/results/reduced/truth-costs.md) with all metrics, classes and distances.

# %% [markdown]
# # Graphical models from nothing, on three variables
#
# **In one sentence.** A graphical model writes the probability of many variables as a product of small tables and
# draws it as a graph, and from the graph you can read what is independent of what, and what an answer will cost.
#
# **You will be able to**
# - multiply, sum out and slice tables with named axes, and get every probability from these three operations;
# - read from a graph with arrows which variables are independent, before and after something has been seen;
# - say what changes in a graph without arrows, and turn a graph with arrows into one;
# - choose an order of elimination and predict its largest table;
# - say what messages compute on a chain, and how loops and mean field make answers too sure;
# - look at a stage of the paper, name the edges that it leaves out, and say what each of them costs.
#
# **Prerequisites.** Conditional probability; Bayes' rule as in lecture [01](../01_bayes.ipynb); numpy.
#
# **Time.** 76 minutes, of which the computer needs a few seconds.

# %% jupyter={"source_hidden": true}
import sys
from functools import reduce

import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, interact
from scipy.special import softmax

from semgrid_edu import plotting
from semgrid_edu.graphical import Factor, GraphicalModel, d_separated, draw, eliminate, enumerate_marginals, in_rows
from semgrid_edu.graphical import max_product, mean_field_graph, min_fill_order, product, sum_product, why_dependent
from semgrid_edu.grid import GridSpec

# %% jupyter={"source_hidden": true}
sys.path.append("..")  # for worlds/, in the folder above
from worlds.lecture_00_system import whole_system
from worlds.lecture_01_line import bayes_on_a_line
from worlds.lecture_02_beam import beam_over_cells
from worlds.lecture_02_cell import one_cell, one_log_odds_cell, read_scans
from worlds.lecture_02_thick_walls import scan_with_pose_error
from worlds.lecture_03_bof import bof_stage
from worlds.lecture_04_cmcdot_graph import cmcdot_stage
from worlds.lecture_09_label import lidar_label_stage
from worlds.lecture_10_crf import crf_stage

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
FREE, OCCUPIED = 0, 1

# %% [markdown]
# ## Why this course needs graphs
#
# The paper's grid has 55,025 cells. If each is free or occupied, there are $2^{55025}$ possible maps, and a complete
# answer to "what does the world look like?" would be a probability for each of them. Nobody can store that. So every
# stage of the paper stores something smaller, such as one number per cell. It can do so only because it assumes that
# some things don't depend on others. Such assumptions are hard to see in code.
#
# A graph makes them visible. Each variable is a circle. Variables that depend on each other directly are linked, so
# each such assumption is **an edge that isn't there**. Here are three graphs of three variables each, which return
# throughout the course:

# %% jupyter={"source_hidden": true} alt="three graphs of three variables: a chain of arrows from before to now to after; arrows from two cells to one beam z; three cells in a row linked by black squares"
CHAIN = {"now": ("before",), "after": ("now",)}
COLLIDER = {"z": ("m1", "m2")}


def any_model(parents):
    """Return a model of a graph whose tables don't matter, because it is only drawn."""
    names = list(dict.fromkeys([name for child, above in parents.items() for name in (*above, child)]))
    tables = [np.full([2] * (1 + len(parents.get(name, ()))), 0.5) for name in names]
    return GraphicalModel([Factor((*parents.get(n, ()), n), t) for n, t in zip(names, tables, strict=True)], parents)


LINE = {"before": (0, 0), "now": (1.4, 0), "after": (2.8, 0)}
fig, axes = plt.subplots(1, 3, figsize=(9, 2), layout="constrained", width_ratios=(1.7, 1, 1.4))
draw(any_model(CHAIN), axes[0], positions=LINE)
draw(any_model(COLLIDER), axes[1], observed="z", positions=in_rows(["m1", "m2"], ["z"]))
row = [Factor(pair, np.ones((2, 2))) for pair in (("m1", "m2"), ("m2", "m3"))]
draw(GraphicalModel(row), axes[2], positions=in_rows(["m1", "m2", "m3"]))
for ax, title in zip(axes, ("one cell, three times", "two cells, one beam", "three neighbours"), strict=True):
    ax.set_title(title, fontsize=10)
plt.show()

# %% [markdown]
# - **Left**: one cell, asked three times. What it is *now* depends on what it was *before*. There is no arrow from
#   *before* to *after*: all that the past can tell about the future, it tells through the present.
# - **Middle**: a beam $z$ either comes back or doesn't, and that depends on the two cells $m_1$ and $m_2$ on its way.
#   It is shaded because we **observe** it. No edge links the cells, so we assume that, before any beam, one tells
#   nothing about the other.
# - **Right**: three cells side by side that tend to agree, because walls are long. None of them comes first, so there
#   are no arrows; the black squares are tables that reward agreement.
#
# With this page you can ask three questions of each stage of the paper. What are its variables and edges? So what is
# independent of what? And is the answer computed exactly, or are more edges cut on the way?
#
# ## A table with named axes
#
# Before we can draw graphs we need something to draw. Take one cell $m$ and one beam $z$. The cell is occupied with
# probability 0.1. The beam comes back from an occupied cell with probability 0.8, and from a free one with 0.05.
# Multiply, and you have the **joint distribution**, a number for each combination:
#
# | | no return | return |
# |---|---|---|
# | **free** | 0.9 · 0.95 = 0.855 | 0.9 · 0.05 = 0.045 |
# | **occupied** | 0.1 · 0.2 = 0.02 | 0.1 · 0.8 = 0.08 |
#
# **Predict before you run.** Answer with this table alone. How probable is a return? The beam does come back: how
# probable is it now that the cell is occupied?
#
# <details><summary>Answer</summary>Add the column "return": 0.045 + 0.08 = 0.125. Then keep only this column and divide
# by its sum: 0.08 / 0.125 = 0.64. The second answer is Bayes' rule. You needed no formula, only the table.</details>
#
# You have *multiplied* two tables. You have *summed out* the cell, which leaves the distribution of the beam alone, its
# **marginal**. And you have *sliced* the table: "given a return" strikes out all that didn't happen. What is left sums
# to 0.125, the probability of what was seen, so we **normalise**, that is, divide by the sum. These operations give
# every exact probability on this page. A table of non-negative numbers whose axes have names is called a **factor**. It
# need not sum to 1, so a slice is a factor too. In code it is a pair, names and table. We need the names because the
# order of the axes must not matter. To multiply, we give both tables the same axes in the same order, with an axis of
# length 1 where a table doesn't depend on a variable, and let numpy broadcast:


# %% tags=["factor"]
def spread(names, factor):
    """Return a factor's table with one axis for each of `names`, of length 1 where it doesn't depend on it."""
    own, table = factor
    table = table.transpose([own.index(name) for name in names if name in own])
    return table[tuple(slice(None) if name in own else None for name in names)]


def multiply(f, g):
    """Return the product: a table over the variables of both."""
    names = tuple(dict.fromkeys(f[0] + g[0]))  # each name once
    return names, spread(names, f) * spread(names, g)


def sum_out(f, name):
    """Return the factor without one of its variables."""
    return tuple(other for other in f[0] if other != name), f[1].sum(axis=f[0].index(name))


def given(f, name, state):
    """Return the slice at which a variable has a known state."""
    return tuple(other for other in f[0] if other != name), f[1].take(state, axis=f[0].index(name))


# %% jupyter={"outputs_hidden": true}
cell = ("m",), np.array([0.9, 0.1])  # FREE, OCCUPIED
beam = ("z", "m"), np.array([[0.95, 0.2], [0.05, 0.8]])  # rows: no return, return
joint = multiply(cell, beam)
returned = given(joint, "z", 1)
print("P(z) =", sum_out(joint, "m")[1].round(3), "  P(m | return) =", (returned[1] / returned[1].sum()).round(2))

package = Factor(*cell) * Factor(*beam)
assert package.names == joint[0] == ("m", "z")
np.testing.assert_allclose(package.table, joint[1])
np.testing.assert_allclose(package.sum("m").table, sum_out(joint, "m")[1])
np.testing.assert_allclose(package.given(z=1).normalised().table, returned[1] / returned[1].sum())

# %% [markdown]
# `beam` has its axes in the order (z, m), and nothing went wrong. The last four lines say that `Factor` of
# `semgrid_edu.graphical` does the same; from here on we use it, with `f * g`, `f.sum("m")`, `f.given(z=1)`. But how do
# we get a table for many variables without writing down all of it?
#
# ## Arrows: tell a story, one table at a time
#
# Two cells lie on the way of one beam. That makes eight combinations, and with twenty cells two million: too many to
# invent a number for each. It is easier to tell how the combinations come about. First there is the world: each cell
# is occupied with probability 0.2. Then comes the beam: it is reflected if at least one cell is occupied. The sensor
# is too coarse to say by which, so a return only says "at least one of you". A story like this is a **directed model**
# (or Bayesian network). Each variable $x_i$ gets one table: its distribution given the variables its arrows come from,
# its **parents**. Parents come first in the story, so arrows never run in a circle. The joint distribution is the
# product of these tables, $P(x_1, \ldots, x_n) = \prod_i P(x_i \mid \text{parents of } x_i)$.

# %%
cells = [Factor("m1", [0.8, 0.2]), Factor("m2", [0.8, 0.2])]
reflect = Factor(("m1", "m2", "z"), [[[1, 0], [0, 1]], [[0, 1], [0, 1]]])  # no return only if both are free
one_of_you = GraphicalModel([*cells, reflect], parents={"z": ("m1", "m2")})

# %% [markdown]
# By hand, before and after the return:
#
# | $m_1$ | $m_2$ | before | after "at least one of you" |
# |---|---|---|---|
# | occupied | free | 0.2 · 0.8 = 0.16 | 0.16 / 0.36 = 0.44 |
# | free | occupied | 0.8 · 0.2 = 0.16 | 0.44 |
# | occupied | occupied | 0.04 | 0.11 |
# | free | free | 0.64 | 0, because something reflected |
#
# **Predict before you run.** How probable is it after the return that $m_2$ is occupied? Then a second sensor reports
# that $m_1$ *is* occupied. Does the probability of $m_2$ go up, go down, or stay?
#
# <details><summary>Answer</summary>0.44 + 0.11 = 0.56. Given that cell 1 is occupied, only the first and the third row
# remain: 0.04 / (0.16 + 0.04) = 0.2. So it goes down, all the way to what it was before the beam (the prior), because
# cell 1 already explains the return. This is called <b>explaining away</b>.</details>

# %% jupyter={"outputs_hidden": true}
for seen in ({}, {"z": 1}, {"z": 1, "m1": OCCUPIED}, {"z": 1, "m1": FREE}):
    belief = enumerate_marginals(one_of_you, "m2", given=seen)
    seen = ", ".join(f"{name} = {state}" for name, state in seen.items()) or "nothing"
    print(f"given {seen:<13} P(m2 occupied) = {belief.normalised().table[OCCUPIED]:.2f}")

# %% [markdown]
# `enumerate_marginals` does what we did: it goes through all combinations and adds up. It leaves normalising to us,
# because the sum of what it returns is the probability of what was given.
#
# Before the return, the cells told nothing about each other. After it, each tells a lot
# about the other: if $m_1$ is free, $m_2$ must be occupied. *Seeing the beam has coupled the cells.* An occupancy
# grid, which keeps one number per cell, can't store that coupling; the last task of the exercise asks what follows.
#
# What does an arrow mean? Only how a table was written, "this one given that one". It need not mean a cause:
# $P(m)\,P(z \mid m)$ and $P(z)\,P(m \mid z)$ are the same joint table, once with the arrow from $m$ to $z$ and once
# the other way. We let arrows follow causes because then the tables are easy to write down.
#
# ## What is independent of what?
#
# If seeing a beam couples two cells, what else couples what? We can't check the numbers of every pair in a large
# model. But the graph alone tells, and three patterns of three variables are enough, because every longer path is made
# of them:

# %% jupyter={"source_hidden": true} alt="three patterns: a chain of one cell over time, before to now to after; a fork, one cell m with arrows to two beams; a collider, two cells with arrows to one beam"
FORK = {"z1": ("m",), "z2": ("m",)}
PATTERNS = {
    "chain": (CHAIN, ("before", "now", "after"), LINE),
    "fork": (FORK, ("z1", "m", "z2"), in_rows(["m"], ["z1", "z2"])),
    "collider": (COLLIDER, ("m1", "z", "m2"), in_rows(["m1", "m2"], ["z"])),
}
fig, axes = plt.subplots(1, 3, figsize=(9, 2), layout="constrained", width_ratios=(1.7, 1, 1))
for ax, (title, (parents, _, positions)) in zip(axes, PATTERNS.items(), strict=True):
    draw(any_model(parents), ax, positions=positions).set_title(title, fontsize=10)
plt.show()

# %% [markdown]
# The **fork** is new: one cell hit by two beams.
#
# **Predict before you run.** For each pattern: does one end tell something about the other end as long as you don't
# know the middle? And once you know the middle? That makes six answers, three of which you have met already.
#
# <details><summary>Answer</summary>Chain: yes, and no once <i>now</i> is known, because the past acts only through it.
# Fork: yes, since a first return makes the cell more likely occupied and thereby a second return more likely; and no
# once the cell is known, because the sensor's errors are independent. Collider: no, and <i>yes</i> once the beam is
# known, by explaining away. The collider is the other way round.</details>
#
# Let us check the six answers twice. `d_separated` looks at the graph alone. `dependence` looks at the numbers, for
# tables drawn at random: independent means that the joint probability is the product of the two single ones.


# %% jupyter={"source_hidden": true}
def with_random_tables(parents, rng):
    """Return a model of this graph, each variable with two states and a random table."""
    factors = []
    for name in any_model(parents).names:
        above = parents.get(name, ())
        p = rng.uniform(0.1, 0.9, size=[2] * len(above))
        factors.append(Factor((*above, name), np.stack([1 - p, p], axis=-1)))
    return GraphicalModel(factors, parents)


# %% tags=["d-separation"]
def dependence(model, a, b, known=()):
    """Return by how much P(a, b | known) differs from P(a | known) P(b | known), at most."""
    joint = enumerate_marginals(model, (a, b, *known)).table
    joint = joint / joint.sum(axis=(0, 1))  # for each state of what is known
    return abs(joint - joint.sum(axis=1, keepdims=True) * joint.sum(axis=0, keepdims=True)).max()


# %% jupyter={"source_hidden": true, "outputs_hidden": true}
rng = np.random.default_rng(0)
for title, (parents, (a, middle, b), _) in PATTERNS.items():
    for known in ((), (middle,)):
        model = with_random_tables(parents, rng)
        separated = d_separated(model, a, b, given=known)
        assert separated == (dependence(model, a, b, known) < 1e-12)
        print(f"{title:<9} {middle + (' known' if known else ' unknown'):<12} independent: {separated}")

# %% [markdown]
# The rule for larger graphs follows. A **path** goes from one variable to another
# along edges, with or against the arrows. It is *open* when each variable between its ends lets influence pass: the
# middle of a chain or a fork when it is *not* known, a collider when it *is* known. A collider also opens when only
# something further down its arrows is known, because that tells something about it too. Otherwise the path is
# *blocked*. If every path is blocked, the two variables are **d-separated** (d for directional), and then they are
# independent *whatever the numbers in the tables are*. The converse is weaker: an open path lets two variables depend
# on each other, but special numbers can still make them independent. So the promise is made by the edges that are
# missing.
#
# Try the rule on two larger graphs. Left: the cell over time, which a noisy scan sees at each step. Right: the two
# cells again, but now $r$ says which of them reflected, and we see only a noisy range $z$.

# %% jupyter={"source_hidden": true} alt="left, before, now and after in a row, each with an arrow down to its scan z1, z2, z3; right, cells m1 and m2 point to r, and r points to z"
HIDDEN_MARKOV = {"now": ("before",), "after": ("now",), "z1": ("before",), "z2": ("now",), "z3": ("after",)}
NOISY_RANGE = {"r": ("m1", "m2"), "z": ("r",)}
ROWS = in_rows(["before", None, "now", None, "after"], ["z1", None, "z2", None, "z3"])
fig, axes = plt.subplots(1, 2, figsize=(8, 2.6), layout="constrained")
draw(any_model(HIDDEN_MARKOV), axes[0], observed=("z1", "z2", "z3"), positions=ROWS)
draw(any_model(NOISY_RANGE), axes[1], observed="z", positions=in_rows(["m1", "m2"], ["r"], ["z"]))
plt.show()

# %% [markdown]
# **Predict before you run.** Left: all three scans are known. Are *before* and *after* independent? Right: the range
# $z$ is known. Are $m_1$ and $m_2$ independent?
#
# <details><summary>Answer</summary>Neither. A noisy scan doesn't tell for certain what the cell is now, so <i>now</i>
# isn't known and the chain stays open. And z lies below the collider r, so knowing it opens r.</details>

# %% jupyter={"outputs_hidden": true}
cell_in_time, beam_in_space = any_model(HIDDEN_MARKOV), any_model(NOISY_RANGE)  # with tables that don't matter
print("open path:", why_dependent(cell_in_time, "before", "after", given=("z1", "z2", "z3")))
print("open path:", why_dependent(cell_in_time, "before", "after", given=("now", "z1", "z3")))
print("open path:", why_dependent(beam_in_space, "m1", "m2", given="z"))

# %% [markdown]
# `why_dependent` returns an open path, or `None`. The second line is the **Markov property**: once the present is
# known, the past tells nothing more about the future. Because of it a Bayes filter may forget all old scans: its belief
# about *now* is all that they can still tell.
#
# The same question for any variable: what must you know so that nothing else tells more about it? Its parents, its
# children, and its children's other parents, because of explaining away. Together they are its **Markov blanket**:


# %% tags=["markov-blanket"]
def markov_blanket(parents, name):
    """Return the parents of a variable, its children, and the other parents of those."""
    children = [child for child, above in parents.items() if name in above]
    around = [*parents.get(name, ()), *children, *(above for child in children for above in parents[child])]
    return set(around) - {name}


for parents in (HIDDEN_MARKOV, NOISY_RANGE):
    for name in (names := any_model(parents).names):
        blanket = markov_blanket(parents, name)
        assert d_separated(any_model(parents), name, set(names) - blanket - {name}, given=blanket)
print("now:", sorted(markov_blanket(HIDDEN_MARKOV, "now")), "  m1:", sorted(markov_blanket(NOISY_RANGE, "m1")))

# %% [markdown]
# To change one variable we need only its blanket; mean field, below, rests on that.
#
# ## No arrows: neighbours that like to agree
#
# Not every dependence has a direction. Walls are long, so neighbouring cells tend to agree. Which of the two should
# get the arrow? Neither. So give each pair of neighbours a factor $\psi$ that is 3 when they agree and 1 when they
# don't. These numbers aren't probabilities of anything. We multiply them all and divide by whatever makes the sum 1:
# $P(m_1, m_2, m_3) = \psi(m_1, m_2)\, \psi(m_2, m_3) / Z$, where $Z = \sum \psi(m_1, m_2)\, \psi(m_2, m_3)$ over all maps.
#
# Such a model is called **undirected**, or a Markov random field, and $Z$ is its **partition function**. The paper's
# CRF (conditional random field) is one.
#
# **Predict before you run.** There are eight maps of three cells in a row. What is $Z$? And how probable is it that
# $m_1$ and $m_3$, which share no factor, agree?
#
# <details><summary>Answer</summary>All alike (2 maps): 3 · 3 = 9 each. One change (4 maps): 3 each. Two changes (2
# maps): 1 each. Z = 18 + 12 + 2 = 32. The ends agree when there is no change or two: (18 + 2) / 32 = 0.625.</details>

# %% jupyter={"outputs_hidden": true}
AGREE = np.array([[3, 1], [1, 3]])
row = GraphicalModel([Factor(("m1", "m2"), AGREE), Factor(("m2", "m3"), AGREE)])
ends = enumerate_marginals(row, ("m1", "m3"))
print(f"Z = {ends.table.sum():.0f}, the ends agree with probability {np.trace(ends.normalised().table):.3f}")
for known in ((), ("m2",)):
    print(f"m1 and m3 independent, given {known}: {d_separated(row, 'm1', 'm3', given=known)}")

# %% [markdown]
# Independence is simpler to read here: two variables are separated when every path between them passes through
# something known. There are no colliders. The price is $Z$, a sum over all maps. A directed model needs such a sum only
# once something has been seen.
#
# Can a directed model become an undirected one? Yes: its tables are factors, and we only forget that they are
# conditional. But the beam's table $P(z \mid m_1, m_2)$ contains both cells, so now they share a factor:

# %% jupyter={"source_hidden": true} alt="left, arrows from m1 and m2 to z; middle, the factor graph with one black square linked to m1, m2 and z and one square at each cell; right, three circles linked by lines, also m1 to m2"
fig, axes = plt.subplots(1, 3, figsize=(9, 2.6), layout="constrained")
PLACES = {"m1": (0, 0), "m2": (1.4, 0), "z": (0.7, -1.1)}
draw(one_of_you, axes[0], positions=PLACES)
draw(GraphicalModel(one_of_you.factors), axes[1], positions=PLACES | {"f(m1, m2, z)": (0.7, -0.35)})
draw(any_model(dict.fromkeys(PLACES, ())), axes[2], positions=PLACES)
for one, other in (("m1", "z"), ("m2", "z"), ("m1", "m2")):
    married = (one, other) == ("m1", "m2")
    style = {"color": "#d95f02", "linewidth": 3} if married else {"color": "black", "linewidth": 1}
    axes[2].plot(*zip(PLACES[one], PLACES[other], strict=True), zorder=-5, **style)
for ax, title in zip(axes, ("directed", "its factor graph", "its moral graph"), strict=True):
    ax.set_title(title, fontsize=10)
plt.show()

# %% jupyter={"source_hidden": true}
undirected = GraphicalModel(one_of_you.factors)
for graph in (one_of_you, undirected):
    print(f"directed: {graph.directed}   m1 and m2 independent: {d_separated(graph, 'm1', 'm2')}")

# %% [markdown]
# The middle picture is the **factor graph**: a black square for each table, linked to the variables in it. On the
# right, variables are linked when they share a table. The parents of $z$ are now linked too (thick line). They got
# married, so to speak, and this is called **moralisation**. The numbers are the same as before, but the graph promises
# less: it can no longer say that the cells are independent before the beam is seen. So keep the arrows while you ask
# about independence, and forget them when you compute. All that follows works on factors, wherever they come from.
#
# ## What an answer costs
#
# So far we summed over all combinations. For thirty cells that is a billion products, and each further cell doubles
# them. How can the same sum be cheaper? Take the chain: the cell was free or occupied with probability ½ each, and it
# changes by the matrix of lecture 01. To get $P(\text{after})$ we sum over *before* and *now*:
#
# $$ P(\text{after}) = \sum_{\text{now}} \sum_{\text{before}} P(\text{before})\, P(\text{now} \mid \text{before})\, P(\text{after} \mid \text{now})
# = \sum_{\text{now}} P(\text{after} \mid \text{now}) \underbrace{\sum_{\text{before}} P(\text{before})\, P(\text{now} \mid \text{before})}_{\text{a table over now alone}} $$
#
# The last factor doesn't contain *before*, so it can stand in front of that sum, just as $ab + ac = a(b + c)$. Now no
# table has more than two axes, however long the chain is. This is **variable elimination**: take one variable,
# multiply only the factors that contain it, sum it out, and go on with the next.


# %% tags=["elimination"]
def eliminate_literal(factors, order):
    """Sum out one variable after the other; return what is left, and the entries of each table on the way."""
    entries = []
    for name in order:
        together = reduce(Factor.__mul__, [f for f in factors if name in f.names])
        entries.append(together.table.size)
        factors = [f for f in factors if name not in f.names] + [together.sum(name)]
    return product(factors), entries


M = np.array([[0.9, 0.1], [0.2, 0.8]])  # from FREE, OCCUPIED to FREE, OCCUPIED
START = Factor("before", [0.5, 0.5])
chain = GraphicalModel([START, Factor(("before", "now"), M), Factor(("now", "after"), M)], CHAIN)
after, entries = eliminate_literal(chain.factors, order=["before", "now"])
np.testing.assert_allclose(after.table, START.table @ M @ M)
np.testing.assert_allclose(after.table, eliminate(chain, "after", order=["before", "now"]).table)
print("P(after) =", after.table.round(3), "  entries of the tables:", entries)

# %% [markdown]
# On the chain, elimination is the prediction of a Bayes filter: a vector times a matrix, once per step. Does the order
# matter? On the chain hardly: begin in the middle, and the first table has three axes instead of two. But suppose that
# the kind of street decides how full six cells are:

# %%
street = Factor("street", [0.5, 0.5])  # motorway, market place
six = [Factor(("street", f"m{k}"), [[0.95, 0.05], [0.7, 0.3]]) for k in range(1, 7)]
star = GraphicalModel([street, *six], parents={f"m{k}": ("street",) for k in range(1, 7)})

# %% jupyter={"source_hidden": true} alt="a circle named street with an arrow to each of the six cells m1 to m6 below it"
draw(star, positions=in_rows(["street"], [f"m{k}" for k in range(1, 7)]))
plt.show()

# %% [markdown]
# **Predict before you run.** We want $P(m_1)$. How large is the largest table if you eliminate *street* first? And if
# you eliminate $m_2, \ldots, m_6$ first, and *street* last?
#
# <details><summary>Answer</summary>Street first: all seven factors contain it, so their product has seven axes,
# 2<sup>7</sup> = 128 entries. Cells first: each cell is in one factor only, with two axes, so 4 entries,
# always.</details>

# %% jupyter={"outputs_hidden": true}
cells_only = [f"m{k}" for k in range(2, 7)]
for order in (["street", *cells_only], [*cells_only, "street"]):
    m1, entries = eliminate_literal(star.factors, order)
    np.testing.assert_allclose(m1.table, enumerate_marginals(star, "m1").table)
    print(f"{order[0]:<7} first: tables of {entries} entries")

# %% [markdown]
# The answer is the same, and the cost isn't. Eliminating *street* first couples all six cells, since each of them
# hints at the street and so at the others. You can see that on the graph: **eliminating a variable links all its
# neighbours**. A good order links few strangers, and `min_fill_order` always takes the variable that links the fewest.
#
# Is there always a good order? Take a square of neighbouring cells, $n \times n$, linked like our row:


# %% jupyter={"source_hidden": true}
def square(n):
    """Return n x n cells, each linked with its neighbours to the right and below."""
    below = [((r, c), (r + 1, c)) for r in range(n - 1) for c in range(n)]
    right = [((c, r), (c, r + 1)) for r in range(n - 1) for c in range(n)]
    return GraphicalModel(Factor([f"m{r},{c}" for r, c in pair], AGREE) for pair in below + right)


# %%
sides = np.arange(2, 11)
largest = [max(eliminate_literal(square(n).factors, min_fill_order(square(n)))[1]) for n in sides]
print(f"10 x 10 cells: {largest[-1]:,} entries instead of 2^100;   the paper's grid: {GridSpec.paper().shape} cells")

# %% jupyter={"source_hidden": true} alt="entries of the largest table on a logarithmic scale against the side of the square: all maps grow to 10 to the 30, elimination to about 16,000"
fig, ax = plt.subplots(figsize=(5.5, 2.8), layout="constrained")
ax.semilogy(sides, 2.0 ** (sides**2), "s--", color="0.4", label="all maps, $2^{n^2}$")
ax.semilogy(sides, largest, "o-", color="#0072b2", label="largest table of elimination")
ax.set(xlabel="side $n$ of the square [cells]", ylabel="entries")
ax.legend(frameon=False, fontsize=9)
plt.show()

# %% [markdown]
# Elimination handles 100 cells with a table of 16,384 entries instead of $2^{100}$ maps. But the table still grows
# exponentially, now with the *side* of the square instead of its area. One can prove that on a grid with shorter side
# $n$ every order meets a table of at least $n + 1$ axes (its *treewidth* is $n$). The paper's grid is 355 by 155
# cells, and $2^{156}$ entries fit nowhere. The paper's CRF links even every cell with every other. **That is why its
# answers are approximated**, and those on a chain need not be.
#
# ## Messages: all answers at once
#
# Elimination answers one question. A filter asks "what is the cell *now*?", but with hindsight we may also want to
# know what it was *before*. Must we start again for each question?
#
# Let our cell be scanned at each of the three times, by the beam from the beginning of this page: no return
# (likelihood 0.95 if free, 0.2 if occupied), then a return (0.05 and 0.8), then again no return. What has been seen is
# a slice of its table, so each scan enters as a factor of one variable.

# %% jupyter={"source_hidden": true} alt="factor graph of the chain before, now, after, with squares for the prior, the matrix M between two times and each scan; blue arrows above it run to the right and are labelled forward, orange arrows below run to the left and are labelled backward"
NOTHING, RETURN = np.array([0.95, 0.2]), np.array([0.05, 0.8])  # P(z | FREE), P(z | OCCUPIED)
TIMES = ("before", "now", "after")
scans = [Factor(name, seen) for name, seen in zip(TIMES, (NOTHING, RETURN, NOTHING), strict=True)]
scanned = GraphicalModel([*chain.factors, *scans])
fig, ax = plt.subplots(figsize=(7, 2.2), layout="constrained")
PLACES = in_rows(["before", None, None, "now", None, None, "after"])
PLACES |= {f"f({name})" + (" #2" if name == "before" else ""): (PLACES[name][0], -0.62) for name in TIMES}
tables = {"f(before)": "prior", "f(before, now)": "$M$", "f(now, after)": "$M$"}
draw(scanned, ax, positions=PLACES | {"f(before)": (-0.75, 0)}, equations=tables)
for name in TIMES:
    ax.text(PLACES[name][0] + 0.14, -0.62, "scan", va="center", fontsize=10)
for x in (1.5, 4.5):
    for y, shift, text, colour in ((0.4, 0.75, "forward", "#0072b2"), (-0.3, -0.75, "backward", "#d55e00")):
        style = {"arrowstyle": "->", "color": colour, "lw": 1.8}
        ax.annotate("", (x + shift, y), (x - shift, y), arrowprops=style)
        ax.text(x, y + np.sign(shift) * 0.18, text, ha="center", va="center", color=colour, fontsize=10)
ax.set_ylim(-0.9, 0.75)
plt.show()

# %% [markdown]
# Eliminate from the left (blue), and what arrives at *now* is a table that sums up everything to its left: a
# **message**. Eliminate from the right (orange), and another message sums up everything to its right. The belief of
# *now* is the product of both messages and of its own scan. Each message serves several questions, so one sweep in
# each direction gives *all* marginals. This is the **forward-backward algorithm**. Let $\overrightarrow{b}_t$ be the
# forward message into time $t$, $\overleftarrow{b}_t$ the backward one (lecture 01's $\beta_t$), and $\ell_t$ the
# likelihood of the scan. The first forward message is $P(\text{before})$; the last backward one is 1 everywhere,
# because no scan follows. Where two stand side by side, multiply entry by entry ($\propto$ means: then normalise):
#
# $$ \overrightarrow{b}_{t+1} = (\overrightarrow{b}_t\, \ell_t)\, M, \qquad \overleftarrow{b}_{t-1} = M\, (\ell_t\, \overleftarrow{b}_t), \qquad P(m_t \mid \text{all scans}) \propto \overrightarrow{b}_t\, \ell_t\, \overleftarrow{b}_t $$


# %% tags=["messages"]
def forward_backward(start, likelihoods, M):
    """Return P(m_t | scans up to t) and P(m_t | all scans), one row per scan."""
    forward, backward = [start], [np.ones(len(start))]
    for likelihood in likelihoods[:-1]:
        forward.append((forward[-1] * likelihood) @ M)
    for likelihood in likelihoods[:0:-1]:
        backward.insert(0, M @ (likelihood * backward[0]))
    filtered = np.array(forward) * likelihoods
    smoothed = filtered * backward
    return filtered / filtered.sum(axis=1, keepdims=True), smoothed / smoothed.sum(axis=1, keepdims=True)


# %% [markdown]
# **Predict before you run.** When the return arrives, the filter believes with probability 0.82 that the cell is
# occupied *now*. The third scan speaks against it. In hindsight, does the 0.82 rise or fall? And what happens to the
# belief about *before*, which was 0.17?
#
# <details><summary>Answer</summary>The 0.82 falls to 0.65: perhaps the return was a ghost. The 0.17 rises to 0.42: a
# return came right after, and what stands somewhere has mostly stood there before. For <i>after</i> nothing changes,
# since there is no later scan.</details>

# %% jupyter={"outputs_hidden": true}
filtered, smoothed = forward_backward(START.table, [NOTHING, RETURN, NOTHING], M)
print("P(occupied), filtered:", filtered[:, OCCUPIED].round(2), "  smoothed:", smoothed[:, OCCUPIED].round(2))

beliefs = sum_product(scanned)
np.testing.assert_allclose([beliefs.marginals[name] for name in TIMES], smoothed)
np.testing.assert_allclose(beliefs.messages["now", "f(now, after)"], filtered[1])
to_now = M @ beliefs.messages["after", "f(now, after)"]  # the general rule, from a factor to a variable
np.testing.assert_allclose(beliefs.messages["f(now, after)", "now"], to_now / to_now.sum())
assert beliefs.exact
print("most likely sequence:", {name: ("FREE", "OCCUPIED")[state] for name, state in max_product(scanned).items()})

# %% [markdown]
# Look at the second assertion. The message that *now* sends on to the right is the filter's belief, so **the Bayes
# filter of lecture 01 is the forward half of message passing**. A vehicle on the road can't have the other half,
# because the future hasn't been seen yet. With a recorded drive it can: that is called *smoothing*.
#
# On any factor graph there are two kinds of messages. A variable $x$ sends a factor $f$ the product of what all its
# *other* factors tell it; a factor sends a variable its table times what its other variables tell it, summed over those:
#
# $$ \mu_{x \to f}(x) = \prod_{h \neq f} \mu_{h \to x}(x), \qquad \mu_{f \to x}(x) = \sum_{y \neq x} f(x, y, \ldots) \prod_{y \neq x} \mu_{y \to f}(y) $$
#
# The forward step above is both in one: multiply by the scan, then sum over $M$'s first axis. A marginal is the
# product of all messages into its variable. `sum_product` sends these messages on any graph. As long as the factor
# graph is a tree, without loops, its answers are exact, because each message sums up one side of an edge and the two
# sides have nothing in common. With max in place of sum one finds the most likely sequence (`max_product`; on a chain,
# the Viterbi algorithm). Look at it again: free all three times, although the cell is occupied *now* with probability
# 0.65. That probability is shared by four sequences, and none of them alone beats the quiet one.
#
# ## When messages meet their own echo
#
# What happens when there is a loop? Close the row of three cells to a triangle, with the same factors. Only $m_1$ has
# been scanned, and the scan says: occupied with probability 0.8.


# %% jupyter={"source_hidden": true} alt="three cells in a triangle, each pair linked through a black square, and one more square at m1, its scan; orange arrows run round the triangle from m1 to m2 to m3 and back"
def triangle(pull, p_first):
    """Return three cells that like to agree, `pull` times as much as not; the first has been scanned."""
    pair = [[pull, 1], [1, pull]]
    sides = [Factor(names, pair) for names in (("m1", "m2"), ("m2", "m3"), ("m1", "m3"))]
    return GraphicalModel([Factor("m1", [1 - p_first, p_first]), *sides])


def p_occupied(marginals):
    """Return P(occupied) of m1 and m2."""
    return [round(float(marginals[name][OCCUPIED]), 2) for name in ("m1", "m2")]


CORNERS = {"m1": (0, 0), "m2": (1.9, 0), "m3": (0.95, 1.45)}
fig, ax = plt.subplots(figsize=(3.2, 2.4), layout="constrained")
draw(triangle(3, 0.8), ax, positions=CORNERS | {"f(m1)": (-0.6, 0)})
ax.text(-0.6, 0.2, "scan", ha="center", fontsize=10)
centre = np.mean(list(CORNERS.values()), axis=0)
for one, other in (("m1", "m2"), ("m2", "m3"), ("m3", "m1")):
    start, end = np.array([CORNERS[one], CORNERS[other]])
    outwards = 0.6 * ((start + end) / 2 - centre)
    ends = [start + share * (end - start) + outwards for share in (0.75, 0.25)]
    ax.annotate("", *ends, arrowprops={"arrowstyle": "->", "color": "#d55e00", "lw": 1.8})
ax.set(xlim=(-0.9, 2.5), ylim=(-0.6, 1.9))
plt.show()

# %% [markdown]
# **Predict before you run.** What is the exact probability of $m_1$: more than 0.8, less, or 0.8? And what will
# messages say that go round the triangle, $m_1$ to $m_2$ to $m_3$ to $m_1$?
#
# <details><summary>Answer</summary>Exactly 0.8. The neighbours haven't seen anything, so they can't add anything. But
# the messages come back: m1 hears from m3 that it is probably occupied, and takes for news what is the echo of its own
# opinion. It becomes too sure.</details>


# %% jupyter={"outputs_hidden": true}
model = triangle(pull=3, p_first=0.8)
exact = {name: eliminate(model, name).normalised().table for name in model.names}
loopy = sum_product(model)
assert (loopy.converged, loopy.exact) == (True, False)
print("m1, m2:  exact", p_occupied(exact), "  messages", p_occupied(loopy.marginals))

# %% [markdown]
# The messages have converged, and they are wrong: 0.85 instead of 0.80, because the same scan was counted again on its
# way round. This is called **loopy belief propagation**. A weaker coupling passes a fainter echo on; the next figure
# shows that (right, dashed).
#
# ## Mean field: pretend that nothing is coupled
#
# There is a second way to approximate, which the paper's CRF takes. Give up all edges, and look for the best
# distribution $Q$ of *independent* cells, $Q(m) = q_1(m_1)\, q_2(m_2)\, q_3(m_3)$. Best means closest to $P$ in the
# **Kullback-Leibler divergence** $\text{KL}(Q \,\|\, P) = \sum Q \log (Q / P)$, which is 0 only if both are equal. We
# can't compute it, since $P$ contains the unknown $Z$. But we can compute it up to the constant $\log Z$:
#
# $$ F(Q) = \sum_m Q(m) \log Q(m) - \sum_m Q(m) \log \prod \psi(m) = \text{KL}(Q \,\|\, P) - \log Z $$
#
# $F$ is called the **free energy**. Lower is better, and it never falls below $-\log Z$. Hold all cells but one, and
# the best $q$ of this cell follows: $\log q$ is the logarithm of what it has seen itself, plus the average of $\log
# \psi$ over what its neighbours believe, plus a constant. Do that cell by cell, again and again:


# %% tags=["mean-field"]
def mean_field_literal(pull, p_first, sweeps=200):
    """Return the q of three cells that pull at each other; start from what each has seen itself."""
    own = np.log([[1 - p_first, p_first], [0.5, 0.5], [0.5, 0.5]])
    q = softmax(own, axis=1)
    for _ in range(sweeps):
        for k in range(3):
            others = q.sum(axis=0) - q[k]
            q[k] = softmax(own[k] + np.log([[pull, 1], [1, pull]]) @ others)
    return q


q, package = mean_field_literal(pull=3, p_first=0.8), mean_field_graph(model, iterations=200)
np.testing.assert_allclose(q, [package.marginals[name] for name in model.names], atol=1e-8)
assert (np.diff(package.free_energy) <= 1e-12).all()
print("m1, m2:  exact", p_occupied(exact), "  mean field", p_occupied(package.marginals))

# %% [markdown]
# Mean field says 0.95 where 0.80 is right, which is worse than the messages: a cell doesn't know that its neighbours
# only repeat what they heard from it. What happens if nothing has been seen at all? Then free and occupied are alike,
# and every exact marginal is ½. The left picture shows $F$ when all three cells have the same $q$:

# %% jupyter={"source_hidden": true} alt="left, free energy against q for three strengths of coupling: one valley at one half for 2, flat for e, two valleys for 5; right, probability that m1 is occupied against the coupling: exact stays at 0.6, messages rise slowly to 0.75, mean field climbs steeply between 2 and 4 and ends near 1"
fig, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
p = np.linspace(0.005, 0.995, 199)
for pull, style in ((2, "-"), (np.e, "--"), (5, "-.")):
    entropy = p * np.log(p) + (1 - p) * np.log(1 - p)
    energy = 3 * entropy - 3 * (p**2 + (1 - p) ** 2) * np.log(pull)
    axes[0].plot(p, energy - energy[99], style, color="#d55e00", label=f"factor {pull:.2g}")
axes[0].set(xlabel="q(occupied) of all cells", ylabel="free energy, 0 at ½ [nats]", title="nothing has been seen")
axes[0].legend(fontsize=9, frameon=False)
pulls = np.geomspace(1, 8, 40)
curves = {
    "exact": [eliminate(triangle(w, 0.6), "m1").normalised().table[1] for w in pulls],
    "messages": [sum_product(triangle(w, 0.6), iterations=500).marginals["m1"][1] for w in pulls],
    "mean field": [mean_field_literal(w, 0.6)[0, 1] for w in pulls],
}
for (name, curve), style in zip(curves.items(), (("-", "black"), ("--", "#0072b2"), ("-.", "#d55e00")), strict=True):
    axes[1].plot(pulls, curve, style[0], color=style[1], label=name)
axes[1].set(
    xlabel="factor when two cells agree", ylabel="P($m_1$ occupied)", ylim=(0.5, 1), title="a scan of $m_1$ says 0.6"
)
axes[1].legend(fontsize=9, frameon=False)
plt.show()

# %% jupyter={"source_hidden": true}
nothing_seen = triangle(pull=3, p_first=0.5)
found = [mean_field_graph(nothing_seen, iterations=500, seed=seed).marginals["m1"][OCCUPIED] for seed in range(4)]
exact_half = eliminate(nothing_seen, "m1").normalised().table[OCCUPIED]
print(f"exact {exact_half:.2f}   mean field from four random starts {np.round(found, 2)}")
np.testing.assert_allclose(np.abs(np.subtract(found, 0.5)), 0.25, atol=1e-6)

# %% [markdown]
# Left: when agreement counts 2, there is one valley, at ½. Beyond a factor of $e = 2.72$ the valley splits in two, and
# mean field **picks a side**: with 3 it ends at 0.75 or at 0.25, depending on where it starts, although nothing was
# seen. Independent cells can't say "we agree, but I don't know on what". They can only lean to free together or to
# occupied together. Right: after a weak hint of 0.6, messages become too sure slowly, and mean field steeply, mostly
# between factors of 2 and 4.
#
# If all you want is one clean map, picking a side may be welcome. But on this triangle, with couplings that strong, mean
# field's numbers are no probabilities to rely on.
#
# ### Play with it
#
# Which coupling can you afford if mean field may be wrong by at most 0.05? Does it depend on how sure the scan of
# $m_1$ is? (Without a running kernel there are no sliders; the figure below them shows three settings.)
#
# <details><summary>Answer</summary>With a scan that says 0.6, 0.7 or 0.8, a factor of at most 1.8 or 1.9 (computed
# on the slider's steps). With 0.99 every factor up to 8, because nearly all is known already.</details>


# %% jupyter={"source_hidden": true}
def compare(agreement, scan, ax):
    """Draw P(occupied) of the three cells by the three methods."""
    model = triangle(agreement, scan)
    methods = {
        "exact": {name: eliminate(model, name).normalised().table for name in model.names},
        "messages": sum_product(model, iterations=500).marginals,
        "mean field": dict(zip(model.names, mean_field_literal(agreement, scan), strict=True)),
    }
    looks = (("0.3", ""), ("#0072b2", "//"), ("#d55e00", ".."))
    for k, (name, (colour, hatch)) in enumerate(zip(methods, looks, strict=True)):
        values = [methods[name][cell][OCCUPIED] for cell in model.names]
        style = {"color": colour, "hatch": hatch, "edgecolor": "white"}
        bars = ax.bar(np.arange(3) + 0.3 * (k - 1), values, width=0.28, label=name, **style)
        ax.bar_label(bars, fmt="%.2f", fontsize=8)
    ax.set_xticks(range(3), ["$m_1$ (scanned)", "$m_2$", "$m_3$"])
    ax.set(ylim=(0, 1.15), title=f"agreement counts {agreement:g}, scan says {scan:g}")
    ax.title.set_fontsize(10)


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
def show(agreement, scan):
    """Draw one setting."""
    compare(agreement, scan, plt.subplots(figsize=(5, 2.6), layout="constrained")[1])
    plt.show()


sliders = {
    "agreement": FloatSlider(value=3, min=1, max=8),
    "scan": FloatSlider(value=0.8, min=0.5, max=0.99, step=0.01),
}
_ = interact(show, **sliders)

# %% jupyter={"source_hidden": true} alt="bars of P(occupied) for three cells, three methods, three settings; with agreement 1.5 all nearly agree, with 3 and a scan of 0.8 the scanned cell gets 0.80 exactly, 0.85 by messages, 0.95 by mean field; with 3 and a scan of 0.6 mean field says 0.86"
fig, axes = plt.subplots(1, 3, figsize=(10, 2.8), sharey=True, layout="constrained")
for ax, (agreement, scan) in zip(axes, ((1.5, 0.8), (3, 0.8), (3, 0.6)), strict=True):
    compare(agreement, scan, ax)
axes[0].set_ylabel("P(occupied)")
fig.legend(*axes[0].get_legend_handles_labels(), ncols=3, loc="outside upper center", frameon=False, fontsize=9)
plt.show()

# %% [markdown]
# ## How to read the drawings of the lectures
#
# A drawing with 55,025 cells needs one more sign. A box around some nodes, a **plate**, means: all this is there many
# times, once for each index. What stands outside is shared by all copies, and arrows that cross the border go to each
# of them.

# %% jupyter={"source_hidden": true} alt="a cell m with an arrow to a shaded scan z inside a box labelled k = 1 to 55025; outside the box a node pitch with an arrow to z"
plate = any_model({"z": ("m", "pitch")})
draw(
    plate,
    observed="z",
    positions={"m": (0, 0), "z": (1.2, 0), "pitch": (2.9, 0)},
    labels={"m": "$m_k$", "z": "$z_k$"},
    plates={r"$k = 1 \ldots 55025$": ("m", "z")},
)
plt.show()

# %% [markdown]
# This one says: each cell has its own scan, and the vehicle's pitch, of which there is only one, disturbs all of them.
# Is $m_1$ independent of $m_2$ once all scans are known? No: both scans are colliders, so the path through the pitch
# is open. Leave the pitch out, and the cells fall apart into 55,025 problems of two variables each.
#
# Now you can read the graphs of the stages. A **dashed** edge is one that the real system leaves out, and the two numbers
# on it are its **price** on a toy world: first the exact answer, then the system's (mostly a
# probability; 1.24 counts things, and what starts from 0 is an error). Without numbers the price wasn't
# measured. A dashed circle is a node that the
# toy model leaves out. `StageGraph.cut` has a sentence for each dashed edge, and lecture [00](../00_tour.ipynb) shows
# the whole ledger.

# %% tags=["stages"] jupyter={"source_hidden": true} alt="four graphs with dashed edges: places on a line, .46 to .34 for later readings; one cell of the log-odds grid with three dashed edges without a price; one cell with four states, also three; a beam over eight cells, .34 to .57 between the fifth and the sixth"
PASSED = read_scans("#.")
STAGES = {
    "line": (bayes_on_a_line(), "01"),
    "cell": (one_log_odds_cell(PASSED), "02"),
    "chain": (one_cell(PASSED), "01 and 04"),
    "beam": (beam_over_cells(), "02"),
    "error": (scan_with_pose_error(), "02"),
    "BOF": (bof_stage(), "03"),
    "CMCDOT": (cmcdot_stage(), "04"),
    "label": (lidar_label_stage(), "09"),
    "CRF": (crf_stage(), "10"),
    "system": (whole_system(), "00"),
}


def show_stages(names, size):
    """Draw the graphs of some stages side by side, two in a row."""
    _, axes = plt.subplots(len(names) // 2, 2, figsize=size, layout="constrained")
    for ax, name in zip(np.ravel(axes), names, strict=True):
        stage, lecture = STAGES[name]
        stage.draw(ax).set_title(f"lecture{'s' * (len(lecture) > 2)} {lecture}: {stage.title}", fontsize=10)
    plt.show()


show_stages(("line", "cell", "chain", "beam"), (12, 6.6))

# %% jupyter={"source_hidden": true} alt="four graphs with dashed edges and prices: a pose error shared by two rings, .46 to .57; BOF, with 1 to 1.24, .43 to .30 and .67 to 1; CMCDOT, with .010 and .051 of error and .50 to .41; how a label arises, .10 to .012 for a shared calibration"
show_stages(("error", "BOF", "CMCDOT", "label"), (12, 8.5))

# %% jupyter={"source_hidden": true} alt="left, the CRF, nine cells on a circle, each pair linked, one edge dashed with .52 to .998; right, the whole system at two instants with six dashed edges, three of them priced: .40 to .48, .53 to .68, .62 to .72"
show_stages(("CRF", "system"), (13, 5.6))

# %% [markdown]
# Look at the CRF on the left. Its model keeps the edges of all pairs; mean field's answer has none of them. One dashed
# edge stands for all of these. Lectures 05 to 08 and 14 cut edges too, and draw graphs of their own. In *One cell,
# four states* a raised minus marks a state before its scan, after the prediction, and *seen?* says whether the scan
# looked at the cell at all.
#
# ## Where this breaks
#
# A graph is a set of assumptions, and inference on it is only as good as they are. What does it cost to forget an
# edge? Let five beams return from one cell. Mostly the sensor is as above, but with probability 0.2 there is dust, and
# then a beam returns with probability 0.8 whatever the cell holds. All beams of a scan fly through the same dust.

# %% tags=["missing-edge"]
RETURNS = np.array([[0.05, 0.8], [0.8, 0.8]])  # P(return | dust, m): rows clear and dusty, columns FREE and OCCUPIED


def dusty(n_beams):
    """Return a cell and its beams, which all fly through the same dust."""
    beams = [f"z{k}" for k in range(n_beams)]
    tables = [Factor(("dust", "m", z), np.stack([1 - RETURNS, RETURNS], axis=-1)) for z in beams]
    world = [Factor("dust", [0.8, 0.2]), Factor("m", [0.5, 0.5])]
    return GraphicalModel([*world, *tables], dict.fromkeys(beams, ("dust", "m")))


# %% [markdown]
# **Predict before you run.** Cut the edge: average over the dust *for each beam by itself*. Then P(return | free) =
# 0.8 · 0.05 + 0.2 · 0.8 = 0.2, against 0.8 if occupied. What are the odds of *occupied* after five returns, from even
# odds? And if you keep the edge: how can a free cell give five returns?
#
# <details><summary>Answer</summary>Cut: (0.8 / 0.2)<sup>5</sup> = 1024 to 1. With the edge: a free cell gives five
# returns if it is dusty, 0.2 · 0.8<sup>5</sup>, an occupied one gives them either way, 0.8<sup>5</sup>. That is 5 to
# 1, since clear air adds next to nothing, and it stays 5 to 1 however many more beams return.</details>

# %% jupyter={"source_hidden": true, "outputs_hidden": true}
kept, cut = [], []
for n_beams in range(1, 7):
    belief = eliminate(dusty(n_beams), "m", given={f"z{k}": 1 for k in range(n_beams)}).normalised()
    kept.append(belief.table[OCCUPIED])
    cut.append(4**n_beams / (4**n_beams + 1))
np.testing.assert_allclose(kept[0], cut[0])
print(f"P(occupied) after five returns: with the edge {kept[4]:.3f}, without {cut[4]:.3f}")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, a node dust outside a plate of N beams with an arrow to z, and a cell m outside with an arrow to z; right, P(occupied) against the number of returns: with the edge it levels off at 0.83, without it rises to 1"
fig, axes = plt.subplots(1, 2, figsize=(8.5, 2.6), layout="constrained", width_ratios=(1, 1.4))
places = {"dust": (0, 0), "m": (2.4, 0), "z": (1.2, -1)}
draw(
    any_model({"z": ("dust", "m")}),
    axes[0],
    observed="z",
    positions=places,
    plates={r"$n = 1 \ldots N$": ("z",)},
    labels={"z": "$z_n$"},
)
axes[1].plot(range(1, 7), kept, "ko-", label="the dust is shared")
axes[1].plot(range(1, 7), cut, "s--", color="#d55e00", label="dust for each beam by itself")
axes[1].set(xlabel="returns from the same cell", ylabel="P(occupied)", ylim=(0.75, 1.01))
axes[1].legend(fontsize=9, frameon=False)
plt.show()

# %% [markdown]
# With one return both agree. After five, the model without the edge gives the cell one chance in a thousand of being
# free, and the complete model one in six. Each further return makes this worse, because it counts as a new witness, and
# nothing in the numbers gives a warning. This is one reason why the package's sensor model counts only the first
# `max_returns` returns of a cell.
#
# Two more limits. Everything here is discrete and tiny; a continuous velocity needs another representation, such as a
# Gaussian or particles. And a graph tells what depends on what when you *look*. It tells what happens when somebody
# *interferes*, say cleans the sensor, only if its arrows really are causes.
#
# ## In five lines
#
# 1. A factor is a table with named axes. Multiply, sum out, slice and divide: that gives every probability.
# 2. Arrows: one table per variable given its parents. A collider opens when it or something below it is seen; chains
#    and forks close.
# 3. Without arrows: factors say what is plausible, $Z$ normalises, and what is known only ever separates.
# 4. Elimination costs as much as its largest table, and the order decides. On a chain two sweeps of messages give all
#    answers; the forward one is the Bayes filter.
# 5. Messages that run round a loop count evidence twice, mean field picks a side when couplings are strong, and a
#    forgotten edge makes even exact inference too sure.
#
# ## Further reading
#
# - Bishop, *Pattern Recognition and Machine Learning*, Springer 2006, chapter 8: the same material for continuous
#   variables too, and the best next step.
# - Koller and Friedman, *Probabilistic Graphical Models*, MIT Press 2009, chapters 3 and 4 (independence), 9
#   (elimination), 10 and 11 (messages, mean field): the reference, whose algorithms the package follows.
# - Kschischang, Frey and Loeliger, *Factor graphs and the sum-product algorithm*, IEEE Transactions on Information
#   Theory 47(2), 2001.
# - Rabiner, *A tutorial on hidden Markov models and selected applications in speech recognition*, Proceedings of the
#   IEEE 77(2), 1989: forward, backward, Viterbi.
#
# ## Exercise
#
# [Exercise: graphical models](../exercises/graphical_models.ipynb): tables with named axes, independence read off a
# graph, elimination with its price, filtering and smoothing, and one question.

# %% [markdown]
# # 01b · Graphical models: what a missing edge promises
#
# **In one sentence.** A graphical model writes the probability of many things as a product of small tables and draws
# it as a graph; in the graph you can read what tells something about what, and what an answer costs.
#
# **You will be able to**
# - multiply, sum out and slice tables, and get every probability from that;
# - read in a graph what is independent of what, before and after something has been seen;
# - say what changes when a graph has no arrows;
# - choose an order of summation, and say why the filter of lecture 01 is one half of message passing;
# - read the three kinds of graph of which this course is built.
#
# **Prerequisites.** Lecture [01](01_bayes.ipynb): predict, update, smoothing. Conditional probability; numpy.
#
# **Time.** 77 minutes, of which the computer needs a few seconds.
#
# **Paper.** Its parts as graphs: section 3.2 (a cell over time), section 3.5 (the CRF), figure 2 (the whole system).

# %% jupyter={"source_hidden": true}
from functools import reduce

import matplotlib.pyplot as plt
import numpy as np
from ipywidgets import FloatSlider, interact

from semgrid_edu import plotting
from semgrid_edu.graphical import Dashed, Factor, GraphicalModel, d_separated, draw, eliminate, enumerate_marginals
from semgrid_edu.graphical import in_rows, max_product, product, sum_product, why_dependent

# %% jupyter={"source_hidden": true}
plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
FREE, OCCUPIED = 0, 1


def any_model(parents):
    """Return a model with these parents and with tables of one half, because we only read its graph."""
    names = list(dict.fromkeys([name for child, above in parents.items() for name in (*above, child)]))
    tables = [np.full([2] * (1 + len(parents.get(name, ()))), 0.5) for name in names]
    return GraphicalModel([Factor((*parents.get(n, ()), n), t) for n, t in zip(names, tables, strict=True)], parents)


# %% [markdown]
# ## Does one thing tell about another?
#
# A beam comes back from a cell ahead. What does it tell about the same cell a second later? And about the cell beside
# it, which it never reached? We could answer if we knew how probable each map is. But the paper's grid has 55,025 cells.
# If each is free or occupied, there are $2^{55025}$ maps, and nobody can store a number for each.
#
# So each stage of the system stores something smaller, for example one number per cell. To go on from these numbers
# alone, it must assume that some things tell nothing about others. A graph shows such assumptions. Each unknown or
# reading is a circle. Two circles are linked if they depend on each other *directly*: by an arrow if one comes first and
# acts on the other, and by a black square if neither does. The square is a small table over the circles that it is
# linked to.

# %% jupyter={"source_hidden": true} alt="three graphs of three variables: a chain of arrows from before to now to after; arrows from two cells m1 and m2 to one beam z; three cells in a line, linked by black squares and without arrows"
CHAIN = {"now": ("before",), "after": ("now",)}
COLLIDER = {"z": ("m1", "m2")}
TIMELINE = {"before": (0, 0), "now": (1.4, 0), "after": (2.8, 0)}
AGREE = np.array([[3, 1], [1, 3]])
line = GraphicalModel([Factor(("m1", "m2"), AGREE), Factor(("m2", "m3"), AGREE)])
fig, axes = plt.subplots(1, 3, figsize=(9, 2), layout="constrained", width_ratios=(1.7, 1, 1.4))
draw(any_model(CHAIN), axes[0], positions=TIMELINE)
draw(any_model(COLLIDER), axes[1], positions=in_rows(["m1", "m2"], ["z"]))
draw(line, axes[2], positions=in_rows(["m1", "m2", "m3"]))
for ax, title in zip(axes, ("one cell, three times", "two cells, one beam", "three neighbours"), strict=True):
    ax.set_title(title, fontsize=10)
plt.show()

# %% [markdown]
# - **Left**: one cell at three times. There is no arrow from *before* to *after*, because all that the past can tell
#   about the future, it tells through the present.
# - **Middle**: two cells on the way of one beam $z$, which comes back or doesn't. No edge links the cells: as long as
#   we haven't seen the beam, one tells nothing about the other.
# - **Right**: three neighbours that tend to agree, because walls are long. None of them comes first, so there are no
#   arrows.
#
# So an edge says that two things may depend on each other directly. **An edge that isn't there is a promise**: there is
# something that you can know, and once you know it, the two are independent. On the left this is *now*, on the right
# $m_2$. In the middle you need nothing, but the promise ends when you see $z$.
#
# ## How do small tables make a large one?
#
# One cell $m$ is occupied with probability 0.1. A beam $z$ comes back from an occupied cell with probability 0.8, and
# from a free one with 0.05. Multiply, and you have a number for each combination, the **joint distribution**:
#
# | | no return | return |
# |---|---|---|
# | **free** | 0.9 · 0.95 = 0.855 | 0.9 · 0.05 = 0.045 |
# | **occupied** | 0.1 · 0.2 = 0.02 | 0.1 · 0.8 = 0.08 |
#
# How probable is a return? Add its column: 0.125. A return did come. How probable is *occupied* now? Keep this column
# only, and divide by its sum: 0.08 / 0.125 = 0.64. That is Bayes' rule.
#
# You *multiplied*, you *summed out* a variable, and you *sliced* at what is known. With the division at the end, these
# three give every probability in this course. A table of non-negative numbers whose axes have names is called a
# **factor**. It needn't sum to one.

# %% tags=["factor"]
cell = Factor("m", [0.9, 0.1])  # FREE, OCCUPIED
beam = Factor(("z", "m"), [[0.95, 0.2], [0.05, 0.8]])  # rows: no return, return
joint = cell * beam  # axes are matched by name, not by place
np.testing.assert_allclose(joint.table, cell.table[:, None] * beam.table.T)
print("P(z) =", joint.sum("m").table.round(3), "  P(m | return) =", joint.given(z=1).normalised().table.round(2))

# %% [markdown]
# For many variables nobody can invent such a table. It is easier to tell a story. First comes the world: two cells, each
# occupied with probability 0.2. Then comes the beam: it returns if at least one of them is occupied, and this time it
# never errs. Each variable has one table. It says how probable each state is for each combination of the variables that
# act on it directly, its **parents**. An arrow leads from each parent. The joint distribution is the product of the
# tables, $P(m_1)\,P(m_2)\,P(z \mid m_1, m_2)$. Such a model is called **directed**, or a Bayesian network.
#
# **Predict before you run.** The beam returns. How probable is it now that $m_2$ is occupied? Then another sensor
# reports that $m_1$ *is* occupied. Does the probability of $m_2$ go up, go down, or stay?
#
# <details><summary>Answer</summary>
#
# Before the beam: each of the two alone 0.2 · 0.8 = 0.16, both 0.04, none 0.64. The return rules out *none*, and 0.36
# is left. So $m_2$ has (0.16 + 0.04) / 0.36 = 0.56. If $m_1$ is occupied, only *$m_1$ alone* and *both* are left, and
# both has 0.04 / 0.20 = 0.2. So it goes down, to where it was before the beam, because $m_1$ already explains the
# return.
#
# </details>

# %% jupyter={"outputs_hidden": true}
cells = [Factor("m1", [0.8, 0.2]), Factor("m2", [0.8, 0.2])]
returns = Factor(("m1", "m2", "z"), [[[1, 0], [0, 1]], [[0, 1], [0, 1]]])  # no return only if both are free
one_of_you = GraphicalModel([*cells, returns], parents={"z": ("m1", "m2")})
for seen in ({}, {"z": 1}, {"z": 1, "m1": OCCUPIED}, {"z": 1, "m1": FREE}):
    belief = enumerate_marginals(one_of_you, "m2", given=seen).normalised().table[OCCUPIED]
    seen = ", ".join(f"{name} = {state}" for name, state in seen.items()) or "nothing"
    print(f"given {seen:<13} P(m2 occupied) = {belief:.2f}")

# %% [markdown]
# This is called **explaining away**: *seeing* the beam has coupled two cells that told nothing about each other.
#
# So small tables, multiplied along a story, make a large one. And what is seen can couple what was independent.
#
# ## What is independent of what?
#
# We can't check the numbers of every pair in a large model. But the graph alone tells us which pairs *can't* depend on
# each other. Every path is made of three patterns: the **chain** (before → now → after), the **fork** (a cell and two
# beams, $z_1 \leftarrow m \rightarrow z_2$) and the **collider** (two cells and a beam, $m_1 \rightarrow z \leftarrow
# m_2$).
#
# **Predict before you run.** For each pattern: can one end tell something about the other end, as long as you don't
# know the middle? And once you do know the middle?
#
# <details><summary>Answer</summary>
#
# Chain: yes; and no once *now* is known, because the past acts only through it. Fork: yes, since a first return makes
# *occupied* more probable, and so a second return; and no once the cell is known, because the beams err separately.
# Collider: no; and *yes* once the beam is known, by explaining away. It is the other way round.
#
# </details>

# %% tags=["d-separation"] jupyter={"outputs_hidden": true}
PATTERNS = {  # the parents of each variable; then one end, the middle, the other end
    "chain": ({"now": ("before",), "after": ("now",)}, ("before", "now", "after")),
    "fork": ({"z1": ("m",), "z2": ("m",)}, ("z1", "m", "z2")),
    "collider": ({"z": ("m1", "m2")}, ("m1", "z", "m2")),
}
for title, (parents, (one, middle, other)) in PATTERNS.items():
    answers = [d_separated(any_model(parents), one, other, given=known) for known in ((), middle)]
    print(f"{title:<9} independence promised: {answers[0]!s:<6} once {middle} is known: {answers[1]}")

# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="three patterns, each twice: above with an unknown middle, below with a known one, which is grey; the chain before, now, after and the fork from m to z1 and z2 are open above and blocked below; the collider from m1 and m2 to z is blocked above and open below"
SHAPES = TIMELINE, in_rows(["m"], ["z1", "z2"]), in_rows(["m1", "m2"], ["z"])
fig, axes = plt.subplots(2, 3, figsize=(9, 4.2), layout="constrained", width_ratios=(1.7, 1, 1))
for column, (title, (parents, (one, middle, other))) in enumerate(PATTERNS.items()):
    for ax, known in zip(axes[:, column], ((), (middle,)), strict=True):
        draw(any_model(parents), ax, observed=known, positions=SHAPES[column])
        answer = "blocked" if d_separated(any_model(parents), one, other, given=known) else "open"
        ax.set_title(f"{title}, {middle} {'known' if known else 'unknown'}: {answer}", fontsize=10)
plt.show()

# %% [markdown]
# Grey means known. `d_separated` looks at the graph and at no number, so `any_model` may fill all tables with one half.
# The rule for large graphs: follow every path from one variable to the other, with or against the arrows. A path is
# *blocked* if it has
# - the middle of a chain or a fork that *is* known, or
# - a collider that is *not* known, and nothing further down its arrows is known either.
#
# If every path is blocked, the two are **d-separated**, and then they are independent *whatever the numbers are*. If
# one path is open, the graph promises nothing: they may depend on each other. Here are two larger graphs. On the left a
# noisy scan sees the cell at each time. On the right $r$ says which of the cells reflected, and we see a noisy range
# $z$.

# %% jupyter={"source_hidden": true} alt="left, before, now and after in a row, each with an arrow down to its shaded scan z1, z2, z3; right, cells m1 and m2 point to r, and r points to the shaded z"
CELL_IN_TIME = {"now": ("before",), "after": ("now",), "z1": ("before",), "z2": ("now",), "z3": ("after",)}
NOISY_RANGE = {"r": ("m1", "m2"), "z": ("r",)}
ROWS = in_rows(["before", None, "now", None, "after"], ["z1", None, "z2", None, "z3"])
fig, axes = plt.subplots(1, 2, figsize=(8, 2.6), layout="constrained")
draw(any_model(CELL_IN_TIME), axes[0], observed=("z1", "z2", "z3"), positions=ROWS)
draw(any_model(NOISY_RANGE), axes[1], observed="z", positions=in_rows(["m1", "m2"], ["r"], ["z"]))
for ax, title in zip(axes, ("one cell, scanned three times", "two cells, one noisy range"), strict=True):
    ax.set_title(title, fontsize=10)
plt.show()

# %%
in_time, noisy_range = any_model(CELL_IN_TIME), any_model(NOISY_RANGE)
BLOCKED = "none, all are blocked"
print("open path:", why_dependent(in_time, "before", "after", given=("z1", "z2", "z3")))
print("open path:", why_dependent(in_time, "before", "after", given="now") or BLOCKED)
print("open path:", why_dependent(noisy_range, "m1", "m2", given="z"))

# %% [markdown]
# - A scan of *now* isn't *now*. It may be wrong, so the chain stays open.
# - If *now* is known, nothing is open. A filter never knows *now*, it only has a belief about it. But the promise holds
#   for either state of *now*. So the filter keeps two numbers, P(free) and P(occupied) now. They carry everything that
#   the old scans say about *after*, and it can delete the scans.
# - The range $z$ is below the collider $r$ and tells something about it. So $r$ is open.
#
# So the missing edges tell what is independent of what: known middles block, and known colliders open. Our first
# question has its answer, too: a beam tells about the same cell a second later, as long as *now* isn't known.
#
# ## What if nothing comes first?
#
# Neighbouring cells tend to agree, because walls are long. Which way should the arrows go? In a line it doesn't matter,
# as long as no two of them meet. But try a square of four cells, each linked with two. The arrows mustn't run in a
# circle, because then no cell would come first. So two of them meet in some cell (left):

# %% jupyter={"source_hidden": true} alt="two squares of the cells m1 to m4; left with arrows from m1 to m2 and m4, and from these two to m3, which is marked by a thick outline; right with black squares and without arrows"
SIDES = [("m1", "m2"), ("m2", "m3"), ("m4", "m3"), ("m1", "m4")]
ROUND = {"m1": (0, 0), "m2": (1.4, 0), "m3": (1.4, -1.4), "m4": (0, -1.4)}
with_arrows = any_model({"m2": ("m1",), "m4": ("m1",), "m3": ("m2", "m4")})
without_arrows = GraphicalModel([Factor(pair, AGREE) for pair in SIDES])
fig, axes = plt.subplots(1, 2, figsize=(6, 2.3), layout="constrained")
draw(with_arrows, axes[0], positions=ROUND, highlight="m3").set_title("two arrows meet in $m_3$", fontsize=10)
draw(without_arrows, axes[1], positions=ROUND).set_title("no arrows", fontsize=10)
plt.show()
DIAGONALS = (("m1", "m3"), ("m2", "m4")), (("m2", "m4"), ("m1", "m3"))
assert [d_separated(with_arrows, *pair, given=rest) for pair, rest in DIAGONALS] == [True, False]
assert all(d_separated(without_arrows, *pair, given=rest) for pair, rest in DIAGONALS)

# %% [markdown]
# Cell $m_3$ is a collider. When it is known, it links $m_2$ and $m_4$. Turn the arrows as you like, some pair of
# opposite cells is always linked in this way.
#
# So draw no arrows (right). Give each pair of neighbours a factor $\psi$ that is 3 if they agree and 1 if they don't.
# These numbers are no probabilities, they say what is more plausible. For three cells in a line, multiply them, and
# divide by whatever makes the sum one:
#
# $$ P(m_1, m_2, m_3) = \frac{\psi(m_1, m_2)\; \psi(m_2, m_3)}{Z}, \qquad
#    Z = \sum_{\text{all maps}} \psi(m_1, m_2)\; \psi(m_2, m_3) $$
#
# Such a model is called **undirected**, or a Markov random field, and $Z$ is its **partition function**. The paper's
# CRF (conditional random field) is one.
#
# **Predict before you run.** The three cells have eight maps. What is $Z$? And how probable is it that the two
# ends, which share no factor, agree?
#
# <details><summary>Answer</summary>
#
# All alike (2 maps): 3 · 3 = 9 each. One change (4 maps): 3 each. Two changes (2 maps): 1 each. So $Z$ = 18 + 12 + 2 =
# 32. The ends agree if there is no change or two: (18 + 2) / 32 = 0.625.
#
# </details>

# %% jupyter={"outputs_hidden": true}
ends = enumerate_marginals(line, ("m1", "m3"))
print(f"Z = {ends.table.sum():.0f}; the ends agree with probability {np.trace(ends.normalised().table):.3f}")
for known in ((), ("m2",)):
    print(f"m1 and m3: independence promised, given {known}: {d_separated(line, 'm1', 'm3', given=known)}")

# %% [markdown]
# Independence is simpler here: what is known always blocks. Once a cell's neighbours are known (its **Markov blanket**),
# nothing else tells about it. And a beam from one cell also tells about the cell beside it, which it never reached,
# because the model links them. The cost is $Z$, a sum over all maps.
#
# Can we forget the arrows of a directed model? Yes, its tables are factors like any others. Then it is drawn as a
# **factor graph**, with a black square for each table, linked to the variables in it. The numbers stay the same, but the
# drawing promises less: a square doesn't tell which variable is the child, so no collider can be seen. Keep the arrows
# as long as you ask about independence, and forget them when you compute.
#
# ## What does an answer cost?
#
# Thirty cells have a billion combinations. How can the same sum be cheaper? Take the chain, with lecture
# 01's matrix $M$ of a free or occupied cell, and P(*before*) one half. To get $P(\text{after})$ we sum over *before* and
# *now*. But one table doesn't contain *before*, and may move out of its sum, as in $ab + ac = a(b + c)$:
#
# $$ P(\text{after}) = \sum_{\text{now}} P(\text{after} \mid \text{now})
#    \underbrace{\sum_{\text{before}} P(\text{before})\; P(\text{now} \mid \text{before})}_{\text{a table over now alone}} $$
#
# No table has more than two axes, however long the chain is. This is **variable elimination**: take a variable,
# multiply only the factors that contain it, and sum it out. Then the next one.


# %% tags=["elimination"]
def sum_in_order(factors, order):
    """Sum out one variable after the other; return what is left, and the size of each table on the way."""
    sizes = []
    for name in order:
        together = reduce(Factor.__mul__, [f for f in factors if name in f.names])
        sizes.append(together.table.size)
        factors = [f for f in factors if name not in f.names] + [together.sum(name)]
    return product(factors), sizes


M = np.array([[0.9, 0.1], [0.2, 0.8]])  # from FREE, OCCUPIED to FREE, OCCUPIED
START = Factor("before", [0.5, 0.5])
chain = GraphicalModel([START, Factor(("before", "now"), M), Factor(("now", "after"), M)], CHAIN)
after, sizes = sum_in_order(chain.factors, order=["before", "now"])
np.testing.assert_allclose(after.table, eliminate(chain, "after").table)  # the package's
np.testing.assert_allclose(after.table, START.table @ M @ M)  # lecture 01's prediction, twice

# %% [markdown]
# So elimination on a chain is lecture 01's prediction: a vector times a matrix, once per step.
#
# Does the order matter? Let the kind of street decide how full six cells are. A beam has come back from each of them:

# %%
street = Factor("street", [0.5, 0.5])  # motorway, market place
six = [Factor(("street", f"m{k}"), [[0.95, 0.05], [0.7, 0.3]]) for k in range(1, 7)]
six_returns = [Factor(f"m{k}", [0.05, 0.8]) for k in range(1, 7)]

# %% [markdown]
# **Predict before you run.** We want $P(m_1 \mid \text{six returns})$. How many entries has the largest table if you
# sum out *street* first? And if you sum out the other five cells first, and *street* last?
#
# <details><summary>Answer</summary>
#
# Street first: seven tables contain it, and their product has seven axes, so 128 entries. Cells first:
# a cell is in two tables, its own and that of its return. Together they have two axes, so 4 entries each time.
#
# </details>

# %% jupyter={"outputs_hidden": true}
others = [f"m{k}" for k in range(2, 7)]
for order in (["street", *others], [*others, "street"]):
    m1, sizes = sum_in_order([street, *six, *six_returns], order)
    print(f"{order[0]:<7}first: P(m1 occupied) = {m1.normalised().table[OCCUPIED]:.2f}, largest table {max(sizes)}")

# %% [markdown]
# The answer is the same, and the cost isn't. **To sum a variable out is to link all its neighbours** (left and middle
# below): each cell hints at the street, and so at every other cell.


# %% jupyter={"source_hidden": true}
def square(n):
    """Return n x n cells, each linked with its neighbours to the right and below."""
    below = [((r, c), (r + 1, c)) for r in range(n - 1) for c in range(n)]
    right = [((c, r), (c, r + 1)) for r in range(n - 1) for c in range(n)]
    return GraphicalModel(Factor([f"m{r},{c}" for r, c in pair], AGREE) for pair in below + right)


for n in range(2, 11):
    assert max(sum_in_order(square(n).factors, [f"m{r},{c}" for r in range(n) for c in range(n)])[1]) == 2 ** (n + 1)

# %% jupyter={"source_hidden": true} alt="left, the street in the middle, linked to six cells around it, each with one more square for its return; middle, the street is gone, and one black square links all six cells; right, a square of four by four cells linked through black squares; five cells are gone, drawn dotted, and have left a square that is linked to the four cells after them; these and the fifth have thick outlines, and the first is marked with a cross"
fig, axes = plt.subplots(1, 3, figsize=(10.5, 3.5), layout="constrained")
around = {f"m{k}": 1.45 * np.array([np.cos(k * np.pi / 3), np.sin(k * np.pi / 3)]) for k in range(1, 7)}
PLACES = around | {f"f({name})": 1.38 * place for name, place in around.items()}
before_sum = GraphicalModel([street, *six, *six_returns])
draw(before_sum, axes[0], positions=PLACES | {"street": (0, 0), "f(street)": (0, 0.55)})
axes[0].set_title("a street and six cells", fontsize=10)
after_sum = GraphicalModel([product([street, *six]).sum("street"), *six_returns])
draw(after_sum, axes[1], positions=PLACES | {after_sum.labels[0]: (0, 0)})
axes[1].set_title("the street summed out", fontsize=10)
by_row = [f"m{r},{c}" for r in range(4) for c in range(4)]
left = by_row[5:]
untouched = [f for f in square(4).factors if set(f.names) <= set(left)]
rest = GraphicalModel([Factor(left[:4], np.ones([2] * 4)), *untouched])  # what the five cells leave behind links four
PLACES = {name: (int(name[3]), -int(name[1])) for name in by_row}
here = {name: PLACES[name] for name in left} | {f"f({', '.join(left[:4])})": (0.5, -0.5)}
gone = {name: PLACES[name] for name in by_row[:5]}
words = dict.fromkeys(by_row, "") | {left[0]: "×"}
draw(rest, axes[2], positions=here, labels=words, highlight=left[:5], ghosts=gone)
axes[2].set_title("five cells summed out, one table left", fontsize=10)
plt.show()

# %% [markdown]
# Is there always a cheap order? Take a square of cells, each with a table for every neighbour, and sum it out row by
# row. On the right five cells (dotted) are summed out, and have left one table that links the next four. The table for
# the cell marked × has five axes, the cells with thick outlines: one more than the square has cells on a side. No order
# does better: in an $n$ by $n$ square *every* order meets a table with at least $n$ + 1 axes. (A theorem, see Diestel
# below: $n$ is the square's *treewidth*. In a rectangle the shorter side counts.)
#
# The paper's grid is 155 by 355 cells. Linked like this, it would need a table of 2<sup>156</sup> entries. And the
# paper's CRF links *every* cell with every other, so already the first table has all 55,025 axes. With two states a
# cell, this is the $2^{55025}$ of the beginning.
#
# So elimination costs as much as its largest table. On a chain that is little. On a large grid no order helps, and
# **this is why the course needs approximations**.
#
# ## How do we get the answer for every time?
#
# Elimination answers one question. What was the cell *before*, *now* and *after*? Must we start again for each?
# The cell is scanned each time by the noisy beam of the first table: no return, a return, no return. A scan that has
# happened is a slice of its table, so it is a factor of one variable.

# %% jupyter={"source_hidden": true} alt="factor graph of the chain before, now, after, with squares for the prior, the matrix M between two times and the scan at each; blue arrows above it run to the right and say forward, orange arrows below run to the left and say backward"
NOTHING, RETURN = np.array([0.95, 0.2]), np.array([0.05, 0.8])  # P(z | FREE), P(z | OCCUPIED)
TIMES = ("before", "now", "after")
scans = [Factor(name, seen) for name, seen in zip(TIMES, (NOTHING, RETURN, NOTHING), strict=True)]
scanned = GraphicalModel([*chain.factors, *scans])
fig, ax = plt.subplots(figsize=(7, 2.2), layout="constrained")
PLACES = in_rows(["before", None, None, "now", None, None, "after"])
PLACES |= {f"f({name})" + (" #2" if name == "before" else ""): (PLACES[name][0], -0.62) for name in TIMES}
tables = {"f(before)": "prior", "f(before, now)": "$M$", "f(now, after)": "$M$"}
draw(scanned, ax, positions=PLACES | {"f(before)": (-0.75, 0)}, equations=tables)
for number, name in enumerate(TIMES, start=1):
    ax.text(PLACES[name][0] + 0.14, -0.62, rf"scan, $\lambda_{number}$", va="center", fontsize=10)
for x in (1.5, 4.5):
    for y, shift, text, colour in ((0.4, 0.75, "forward", "#0072b2"), (-0.3, -0.75, "backward", "#d55e00")):
        style = {"arrowstyle": "->", "color": colour, "lw": 1.8}
        ax.annotate("", (x + shift, y), (x - shift, y), arrowprops=style)
        ax.text(x, y + np.sign(shift) * 0.18, text, ha="center", va="center", color=colour, fontsize=10)
ax.set_ylim(-0.9, 0.75)
plt.show()

# %% [markdown]
# Sum out from the left (blue). What arrives at *now* is a table that holds all that the left side can tell. It is
# called a **message**. Another message comes from the right (orange). With $\lambda_1, \lambda_2, \lambda_3$ for the
# tables of the three scans (how probable each scan is if the cell is free, and if it is occupied), and products entry
# by entry:
#
# $$ P(\text{now} \mid \text{all scans}) \;\propto\; \underbrace{\bigl(P(\text{before})\, \lambda_1\bigr)\, M}_{\text{from the left}}
#    \;\cdot\; \underbrace{\lambda_2}_{\text{own scan}} \;\cdot\; \underbrace{M\, \lambda_3}_{\text{from the right}} $$
#
# **Predict before you run.** When the return arrives, the filter believes with 0.82 that the cell is occupied *now*.
# The third scan speaks against it. In hindsight, does this belief rise or fall? And the belief about *before*, which
# was 0.17?
#
# <details><summary>Answer</summary>
#
# The 0.82 falls to 0.65: perhaps the return was an error. The 0.17 rises to 0.42. The return alone would lift it to
# 0.52, because what is somewhere now was mostly there before. The third scan takes a part of this back.
#
# </details>

# %% tags=["messages"] jupyter={"outputs_hidden": true}
from_left = (START.table * NOTHING) @ M
from_right = M @ NOTHING
now = from_left * RETURN * from_right
before = START.table * NOTHING * (M @ (RETURN * from_right))  # the message from the right, passed on
filtered = from_left * RETURN
all_answers = sum_product(scanned)  # the package: every message once in each direction
np.testing.assert_allclose(all_answers.marginals["now"], now / now.sum())
np.testing.assert_allclose(all_answers.marginals["before"], before / before.sum())
print(f"now: filter {(filtered / filtered.sum())[OCCUPIED]:.2f}, all scans {(now / now.sum())[OCCUPIED]:.2f}")
two = START.table * NOTHING * (M @ RETURN)  # before, without the third scan
print(f"before: two scans {(two / two.sum())[OCCUPIED]:.2f}, all scans {(before / before.sum())[OCCUPIED]:.2f}")

# %% jupyter={"source_hidden": true}
first = START.table * NOTHING
assert np.isclose((first / first.sum())[OCCUPIED], 0.17, atol=0.005)
np.testing.assert_allclose(all_answers.messages["now", "f(now, after)"], filtered / filtered.sum())

# %% [markdown]
# Each message serves several questions, so one sweep in each direction gives the answer for *every single circle*. This
# is the **forward-backward algorithm**. Compare it with lecture 01: **the Bayes filter is the forward half of message
# passing.** The message from the right, $M \lambda_3$, is lecture 01's $\beta$, and all three factors together are its
# smoother. A **loop** is a way along the links that comes back to its start. On any graph without loops two sweeps are
# enough, because each message holds what is on one side of an edge, and the two sides have nothing in common.
#
# Circle by circle, the answers are now *free*, *occupied*, *free* (0.42, 0.65 and 0.30 for *occupied*). Is this also
# the most probable history?

# %%
histories = product(scanned.factors).normalised().ordered(*TIMES).table
best = tuple(max_product(scanned)[name] for name in TIMES)  # messages with a maximum in place of each sum
for text, history in (("circle by circle:", (FREE, OCCUPIED, FREE)), ("most probable:", best)):
    words = ", ".join("occupied" if state else "free" for state in history)
    print(f"{text:<18}{words:<22} P = {histories[history]:.2f}")

# %% jupyter={"source_hidden": true}
singles = [all_answers.marginals[name] for name in TIMES]
np.testing.assert_allclose([single[OCCUPIED] for single in singles], [0.42, 0.65, 0.30], atol=0.005)
assert tuple(int(single.argmax()) for single in singles) == (FREE, OCCUPIED, FREE)
assert histories[best] == histories.max()

# %% [markdown]
# No. *Free, occupied, free* changes twice, and $M$ makes a change improbable. The best single history says that the
# return was an error. Several histories with *now* occupied outweigh it together, so 0.65 is right as well. To get the
# best history, replace each sum by a maximum: the algorithm of **Viterbi**.
#
# So messages give the answer for every circle. Put side by side, these answers don't make an answer for all circles
# together, because the circles depend on each other.
#
# ## Which graphs does this course use?
#
# Three. You know the first: one cell over time, with a scan each time. Lecture 02 uses it once for each cell, and lets
# the cell stay what it is. In lectures 03 and 04 things move, so arrows come from *other* cells of the past. Here are
# the other two:

# %% tags=["stages"] jupyter={"source_hidden": true} alt="left, four cells at the corners of a square, each pair linked through a black square, and one more square at each cell; right, two columns, t-1 and t: the world w with an arrow to the next w, arrows from w to the readings l and i; l to o, o and i to g; l, o and the present i are grey, the earlier i and both g are white; o has an arrow to the next o, and a dashed arrow marked deleted leads from g to the next g"
fig, axes = plt.subplots(1, 2, figsize=(9.4, 3.2), layout="constrained", width_ratios=(1, 2.2))
CORNERS = {"x1": (0, 0), "x2": (1.8, 0), "x3": (1.8, -1.8), "x4": (0, -1.8)}
pairs = [(one, other) for one in CORNERS for other in CORNERS if one < other]
beside = {f"f({name})": (1.4 * x - 0.36, 1.3 * y + 0.3) for name, (x, y) in CORNERS.items()}
diagonals = {"f(x1, x3)": (0.6, -0.6), "f(x2, x4)": (1.2, -0.6)}
crf = GraphicalModel([*(Factor(name, [1, 2]) for name in CORNERS), *(Factor(pair, AGREE) for pair in pairs)])
draw(crf, axes[0], positions=CORNERS | diagonals | beside).set_title("the CRF, on four cells", fontsize=10)
COLUMN = {"w": 0, "l": -1.2, "i": 1.2, "o": -1.2, "g": 0}
DEPTH = {"w": 0, "l": -1, "i": -1, "o": -2.1, "g": -2.9}
SYSTEM, WHERE = {"w1": ("w0",), "o0": ("l0",), "o1": ("l1", "o0")}, {}
for t in (0, 1):
    SYSTEM |= {f"l{t}": (f"w{t}",), f"i{t}": (f"w{t}",), f"g{t}": (f"o{t}", f"i{t}")}
    WHERE |= {f"{name}{t}": (4.6 * t + (x if t else -x), DEPTH[name]) for name, x in COLUMN.items()}
system = any_model(SYSTEM)
draw(
    system,
    axes[1],
    observed=("l0", "l1", "i1", "o0", "o1"),
    positions=WHERE,
    labels={f"{name}{t}": f"${name}_{{{'t' if t else 't-1'}}}$" for name in COLUMN for t in (0, 1)},
    equations={"w1": "world", "l1": "LIDAR", "i1": "image", "o1": "occupancy", "g1": "semantic grid"},
    dashed=[Dashed(("g0", "g1"), "deleted")],
)
axes[1].set_title("the whole system", fontsize=10)
plt.show()

# %% [markdown]
# **The CRF**. Each circle is the class of a cell. It has a table of its own, what the network says of it, and one with
# every other cell that rewards agreement. There is no cheap order, so lecture 10 takes an approximation, *mean field*.
#
# **The whole system**. The world $w$ goes on from one instant to the next. LIDAR $l$ and image $i$ see it. From there
# on, an arrow means *is computed from*: the occupancy $o$ from the scans and the occupancy before, and the semantic grid
# $g$ from occupancy and image. So $w$ is the truth, and $g$ only the system's opinion of it. The system deletes one
# arrow, from $g$ to the next $g$.
#
# What does the system lose by it? Suppose that everything grey is known. Would the earlier image $i_{t-1}$ tell
# something more? It is white because we ask about it. Follow every path from $i_{t-1}$ to the present grid $g_t$, without
# the deleted arrow and with it. Then look for an open path to the present world $w_t$.

# %%
kept = any_model(SYSTEM | {"g1": ("o1", "i1", "g0")})  # the arrow is put back
known = ("l0", "l1", "o0", "o1", "i1")  # what is grey
print("earlier image and grid, arrow deleted:", why_dependent(system, "i0", "g1", given=known) or BLOCKED)
print("earlier image and grid, arrow kept:   ", why_dependent(kept, "i0", "g1", given=known))
print("earlier image and world:              ", why_dependent(system, "i0", "w1", given=known))

# %% [markdown]
# Without the arrow every path to $g_t$ is blocked: each leads through the occupancy or the present image, both known.
# With it, the path over $g_{t-1}$ is open. The path to the world is open because nobody knows $w_{t-1}$.
#
# So the earlier image may tell something about the present world, and without the arrow the grid can't hear it. How much
# this costs, no graph can say. Lecture 14 puts the arrow back and measures.
#
# ## Where this breaks: an echo
#
# Messages are exact as long as there is no loop. Close the line of three neighbours to a triangle. Only $m_1$ has been
# scanned, and the scan says: occupied with probability 0.8.
#
# **Predict before you run.** What is the exact probability of $m_1$: more than that, less, or just that? And what do
# messages say that go round the triangle?
#
# <details><summary>Answer</summary>
#
# Exactly 0.8. The table treats free and occupied alike, so the unscanned neighbours weigh both states of $m_1$ the
# same. But $m_1$ hears from $m_3$ that it is probably occupied, and takes for news what is the echo of its own opinion.
# It becomes too sure: 0.85.
#
# </details>


# %% jupyter={"outputs_hidden": true}
def neighbours(table, scan, closed=True):
    """Return three cells with one table a pair; the first is scanned. A line, or a triangle if `closed`."""
    pairs = [("m1", "m2"), ("m2", "m3"), ("m1", "m3")][: 3 if closed else 2]
    return GraphicalModel([Factor("m1", [1 - scan, scan]), *(Factor(pair, table) for pair in pairs)])


DIFFER = [[1, 3], [3, 1]]  # as if neighbours liked to differ
MORE_FREE = [[5, 1], [1, 3]]  # as AGREE, but two free neighbours are more plausible than two occupied ones
tried = {"line": (AGREE, False), "triangle": (AGREE, True), "differ": (DIFFER, True), "more free": (MORE_FREE, True)}
for name, (table, closed) in tried.items():
    model = neighbours(table, scan=0.8, closed=closed)
    exact, passed = eliminate(model, "m1").normalised().table, sum_product(model).marginals["m1"]
    print(f"{name:<11}P(m1 occupied): exact {exact[OCCUPIED]:.2f}, messages {passed[OCCUPIED]:.2f}")


# %% jupyter={"source_hidden": true}
def echo(scan, ax):
    """Draw P(m1 occupied) in the triangle against the strength of the tables: messages, and the exact answer."""
    pulls = np.linspace(1, 8, 15)
    agree = [neighbours([[pull, 1], [1, pull]], scan) for pull in pulls]
    differ = [neighbours([[1, pull], [pull, 1]], scan) for pull in pulls]
    for models, style, colour, label in (
        (agree, "o-", "#d55e00", "messages, neighbours agree"),
        (differ, "s--", "#0072b2", "messages, neighbours differ"),
    ):
        found = [sum_product(model, iterations=500).marginals["m1"][OCCUPIED] for model in models]
        ax.plot(pulls, found, style, color=colour, label=label)
    exact = [[eliminate(model, "m1").normalised().table[OCCUPIED] for model in models] for models in (agree, differ)]
    np.testing.assert_allclose(*exact)
    ax.plot(pulls, exact[0], "-", color="0.4", label="exact, both")
    ax.set(xlabel=r"the larger $\psi$ (the smaller is 1)", ylabel="P($m_1$ occupied)", ylim=(0.45, 1.02))
    ax.legend(fontsize=9, frameon=False, loc="lower left")


# %% jupyter={"source_hidden": true, "outputs_hidden": true} alt="left, three cells in a triangle of squares, the scan's square beside m1, and an orange arrow from each cell to the next one round the triangle; right, P(m1 occupied) against the factor of agreement: the exact answer stays at 0.8; messages rise to 0.95 if neighbours agree, and fall to 0.63 if they differ"
fig, axes = plt.subplots(1, 2, figsize=(7.6, 3), layout="constrained", width_ratios=(1, 1.4))
TRIANGLE = {"m1": (0, 0), "m2": (1.9, 0), "m3": (0.95, 1.45)}
draw(neighbours(AGREE, 0.8), axes[0], positions=TRIANGLE | {"f(m1)": (-0.6, 0)})
axes[0].text(-0.6, 0.2, "scan", ha="center", fontsize=10)
centre = np.mean(list(TRIANGLE.values()), axis=0)
for one, other in (("m1", "m2"), ("m2", "m3"), ("m3", "m1")):
    start, end = np.array([TRIANGLE[one], TRIANGLE[other]])
    outwards = 0.6 * ((start + end) / 2 - centre)
    ends = [start + share * (end - start) + outwards for share in (0.75, 0.25)]
    axes[0].annotate("", *ends, arrowprops={"arrowstyle": "->", "color": "#d55e00", "lw": 1.8})
axes[0].set(xlim=(-0.9, 2.5), ylim=(-0.6, 1.9))
echo(0.8, axes[1])
plt.show()


# %% tags=["nbval-ignore-output"] jupyter={"source_hidden": true}
def show(scan):
    """Draw one setting."""
    echo(scan, plt.subplots(figsize=(4.5, 2.8), layout="constrained")[1])
    plt.show()


_ = interact(show, scan=FloatSlider(value=0.8, min=0.5, max=0.99, step=0.01))

# %% [markdown]
# The arrows show the way of the echo; it goes round the other way, too. The loop is the cause: in the line, messages are
# exact. If neighbours like to *differ*, three steps turn the echo upside down, and $m_1$ becomes too unsure: 0.75.
# (The dial works with a running kernel.)
#
# The exact answer didn't move because these tables treat both states alike. A table that prefers *free* moves it (last
# line).
#
# No method repairs a wrong graph. If two beams share an error, and the graph has no circle for it, even exact inference
# is too sure. Lecture [02](02_grids.ipynb) shows that.
#
# ## In five lines
#
# 1. A factor is a table with named axes. Multiply, sum out, slice, divide: that gives every probability.
# 2. A missing edge promises that something can be known that makes the two independent. A known middle blocks a chain
#    or a fork. A collider opens when it, or something below it, is known.
# 3. Without arrows, factors say what is plausible, $Z$ makes the sum one, and what is known always blocks.
# 4. Elimination costs as much as its largest table, and the order decides. On a chain two sweeps of messages give
#    the answer for every circle; the forward one is the filter.
# 5. In a loop, messages hear their own echo. If neighbours like to agree, they become too sure.
#
# ## Further reading and exercise
#
# - Bishop, *Pattern Recognition and Machine Learning*, Springer 2006, chapter 8: the same material.
# - Koller, Friedman, *Probabilistic Graphical Models*, MIT Press 2009, the reference.
# - Kschischang, Frey, Loeliger, *Factor graphs and the sum-product algorithm*, IEEE Transactions on Information
#   Theory, 2001.
# - Diestel, *Graph Theory*, Springer, chapter 12: treewidth, and that of a square grid (an exercise there).
#
# [Exercise 01b](exercises/01b_graphical_models.ipynb). Next: lecture [02](02_grids.ipynb), thousands of cells side by
# side.

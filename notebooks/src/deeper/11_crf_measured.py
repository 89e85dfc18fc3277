# %% [markdown]
# # The CRF, measured: why damping is safe, and whether the CRF helps
#
# **In one sentence.** Damped updates never raise the free energy, because a penalty for moving lies above what the
# tangent leaves out; and whether the CRF helps depends on the score and on the labels that judge it.
#
# **You will be able to**
# - show in a picture why updating all cells at once can fail, and why damping repairs it;
# - read one table of gains, and say when the CRF helps.
#
# **Prerequisites.** Lectures [10](../10_crf.ipynb) and [11](../11_fast_crf.ipynb); for the table, intervals as in
# lecture [12](../12_experiments.ipynb).
#
# **Time.** 15 minutes; the computer needs seconds.

# %% jupyter={"source_hidden": true}
import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown
from scipy.special import rel_entr, xlogy

from semgrid_edu import plotting
from semgrid_edu.crf import CrfParams, gram_matrix

sys.path.append("..")  # for worlds/, in the folder above
from worlds.lecture_10_crf import all_free

plt.rcParams["figure.dpi"] = plotting.FIGURE_DPI
results = Path("../../docs/results")

# %% [markdown]
# ## Why do damped updates never make things worse?
#
# Take two cells of one state that pull each other, as in lecture 10. Cell 1 says road with 0.7, cell 2 says car with
# 0.7. Two different labels cost 4. Both cells move alike, so one number holds their state: $Q_1$(road) = $Q_2$(car).
# When all cells move at once, an update treats the pair term of the free energy $F$ as if it changed along its
# **tangent** at the present $Q$:

# %% tags=["tangent"] jupyter={"source_hidden": true}
t, start, price = np.linspace(0.02, 0.98, 193), 0.7, 4.0
side_by_side = CrfParams(w_bilateral=0, w_spatial=price * np.sqrt(np.e), sigma_gamma=1, normalization="none")
own = gram_matrix(all_free((1, 2)), side_by_side)[0, 0]
easy = 2 * (-t * np.log(0.7) - (1 - t) * np.log(0.3) + xlogy(t, t) + xlogy(1 - t, 1 - t))
tangent = price * ((1 - 2 * start * (1 - start)) + (4 * start - 2) * (t - start))
penalty = own * (rel_entr(t, start) + rel_entr(1 - t, 1 - start))
curves = {"free energy $F$": easy + price * (1 - 2 * t * (1 - t)), "pair term by its tangent": easy + tangent}
curves["tangent, and a penalty for moving"] = easy + tangent + penalty
true, dotted, dashed = curves.values()
here = np.interp(start, t, true)
assert true[dotted.argmin()] > here > true[dashed.argmin()]
assert (dashed >= true - 1e-9).all()
undamped = [start]
for _ in range(3):  # mean field of lecture 10, all cells at once
    undamped.append(1 / (1 + np.exp(-np.log(0.7 / 0.3) + price * (2 * undamped[-1] - 1))))
assert undamped[1] < 0.4 < 0.9 < undamped[2] > 0.5 > undamped[3]

# %% jupyter={"source_hidden": true} alt="free energy along a line of opposite opinions, with a tangent curve that dips below it and a damped curve that touches it and lies above it"
fig, ax = plt.subplots(figsize=(6, 3.6), layout="constrained")
looks = (("0.2", "-"), ("#d55e00", ":"), ("#0072b2", "--"))
for (name, curve), (colour, style) in zip(curves.items(), looks, strict=True):
    ax.plot(t, curve, style, color=colour, label=name)
    ax.plot(t[curve.argmin()], curve.min(), "o" if style != "-" else "", color=colour)
ax.plot(start, here, "k*", markersize=11, label="where we stand")
ax.set(xlabel="$Q_1$(road) = $Q_2$(car)", ylabel="free energy [nats]", ylim=(0.5, 4.5))
ax.legend(fontsize=9, frameon=False)
plt.show()

# %% [markdown]
# The true pair term bends upwards along this line, because both cells move. So the tangent (dotted) is below the true
# $F$ (solid). It promises a gain on the far side that isn't there: at the dotted curve's minimum, $F$ is higher than at
# the star. The two cells would jump across, and back again in the next update.
#
# The remedy is a penalty for moving, large enough that tangent and penalty together (dashed) are nowhere below $F$.
# At its minimum the dashed curve is lower than at the star. $F$ is lower still. So $F$ can't rise.
#
# How large must the penalty be? A sum of Gaussians has no negative eigenvalue. So the pair term bends upwards
# only as much as the prices of cells with themselves, $k_{ii}$, allow, and
# $k_{ii}/2 \cdot \text{KL}(Q_i' \,\|\, Q_i)$ is enough. The docstring of `damping` has the proof.
#
# ## Does the default CRF help?
#
# Lecture 10 answers for networks that learned from true labels, lecture 12 for networks that learned from labels made
# of LIDAR returns. Here the answers are side by side, as points gained over the network alone on 110 test frames. In
# brackets are 95 % intervals over drives, and over runs where there are several. A row can be read by itself: if its
# interval holds zero, the sign is open.

# %% jupyter={"source_hidden": true}
METRIC_NAMES = ("class accuracy", "pixel accuracy")
FILES = {"SegNet": "crf_search", "FCN": "crf_search_fcn", "DeepLab": "crf_search_deeplab"}


def kept(name):
    """Return a committed result."""
    return json.loads((results / f"{name}.json").read_text(encoding="utf-8"))


# %% jupyter={"source_hidden": true} tags=["crf-joined"]
reduced = json.loads((results / "reduced" / "table1.json").read_text(encoding="utf-8"))
by_network = {row["what"].partition(":")[0].removesuffix(" v2"): row["scores"] for row in reduced["differences"][:3]}
head = "| points gained by the default CRF | trained on | judged by | pixel accuracy | class accuracy |"
table, signs = [head, "|---|---|---|---|---|"], {}
for name, file in FILES.items():
    ways = {("true labels", "true labels"): kept(file)["test"]["gains"]["CRF"]}
    for judge, key in (("true labels", "true"), ("LIDAR labels", "lidar")):
        means = by_network[name][key]["all"]
        ways["LIDAR labels", judge] = {m: [means[m][k] for k in ("low", "mean", "high")] for m in METRIC_NAMES}
    for (trained, judge), gains in ways.items():
        pixel, mean = (np.round(100 * np.array(gains[m]), 2) + 0.0 for m in ("pixel accuracy", "class accuracy"))
        shown = ("{1:+.2f} ({0:+.2f} to {2:+.2f})".format(*points) for points in (pixel, mean))
        table.append(f"| {name} | {trained} | {judge} | {' | '.join(shown)} |")
        assert mean[2] < -1
        signs[name, trained, judge] = "rises" if pixel[0] > 0 else "falls" if pixel[2] < 0 else "open"
assert {signs[name, "LIDAR labels", "LIDAR labels"] for name in FILES} == {"rises"}
assert {signs[name, "true labels", "true labels"] for name in FILES} == {"open"}
assert {signs[name, "LIDAR labels", "true labels"] for name in FILES} == {"rises"}
Markdown("\n".join(table))

# %% [markdown]
# Class accuracy falls in every row, by more than a point. In pixel accuracy the networks that learned from LIDAR labels
# gain, by either judge. Those that learned from true labels gain almost nothing, and the sign is open. So *the CRF
# helps* is no statement without the score, the training and the judge.
#
# The rows differ in more than labels. The networks of the true labels are one training run each, longer than those of
# the LIDAR labels, which are five runs each.
#
# **Would other weights help?** 120 settings of the two weights and three widths were tried for each network on other
# drives, and the best for each score was judged on the test frames:

# %% jupyter={"source_hidden": true} tags=["crf-searched"]
lines = ["| points gained by a searched CRF | searched for | pixel accuracy | class accuracy |", "|---|---|---|---|"]
for name, file in FILES.items():
    for goal in METRIC_NAMES[::-1]:
        gains = kept(file)["test"]["gains"][f"calibrated, CRF for {goal}"]
        pixel, mean = (100 * gains[m][1] for m in METRIC_NAMES[::-1])
        lines.append(f"| {name} | {goal} | {pixel:+.1f} | {mean:+.1f} |")
        assert min(gains[m][0] for m in METRIC_NAMES) < 0
        if goal == "pixel accuracy":
            assert gains[goal][0] > 0 > gains["class accuracy"][2]
Markdown("\n".join(lines))

# %% [markdown]
# A CRF that gains pixel accuracy costs class accuracy. A CRF that doesn't cost class accuracy hardly does anything.
# So for these prices it is a trade.
#
# ## What this does not show
#
# All frames come from one simulator, and each network was searched for once. A network whose classes are better
# calibrated might gain more from its neighbours.
#
# ## Further reading
#
# - Krähenbühl, Koltun, *Parameter learning and convergent inference for dense random fields*, ICML 2013: the damping.
# - Wainwright, Jordan, *Graphical models, exponential families, and variational inference*, 2008, chapters 4 and 5.

"""What training on truth costs, as Markdown and as a picture (section 4)."""

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_edu.experiments.measured import shown
from semgrid_edu.experiments.reproduction.accuracy_tables import TRUTHS
from semgrid_edu.experiments.tables import markdown_table, per_cent
from semgrid_edu.metrics import METRICS
from semgrid_edu.plotting import forest_plot

LEARNED_FROM = {
    "lidar": "one scan (usual)",
    "true": "true labels",
    "no-cleanup": "one scan, no clean-up",
    "camera-mask": "one scan, visible to camera",
    "de-skewed": "one scan, de-skewed",
    "accumulated-smeared": "ten scans, movers smeared",
    "accumulated-carved": "ten scans, movers carved",
    "accumulated-carried": "ten scans, movers carried",
}
"""What the networks learn from, in words."""

PARTS = {
    "classes": "By class: intersection over union with the true labels, cells with a true semantic class",
    "distances": "By distance: share of the cells with a true semantic class that is right",
}
"""What is told class by class, and band by band."""


_MARKERS = "oXsD*v^<"


def truth_costs_markdown(result: dict) -> str:
    """Return what training on each kind of labels costs as Markdown.

    Parameters
    ----------
    result : dict
        From `truth_costs`.

    Returns
    -------
    str
    """
    rows = result["rows"]
    parts = [
        "SegNet, the same image stages, seeds and test frames; only the labels of the grids differ that it learns "
        f"from.\n\n## The labels, on the training frames, against the true ones\n\n{_labels(rows)}"
    ]
    for against, words in TRUTHS.items():
        for cells, which in (("all", "all cells"), ("semantic", "cells with a semantic class")):
            parts.append(
                f"## The networks, on the test frames, against {words}, {which}\n\n{_networks(rows, against, cells)}"
            )
    parts += [
        f"## {words}; differences of the networks in points\n\n{_parts(rows, part)}" for part, words in PARTS.items()
    ]
    return "\n\n".join(parts)


def _labels(rows: list[dict]) -> str:
    """Lay out how right the labels are."""
    lines = [["labels", "other than usual", "right, all cells", "right, cells with a semantic class"]]
    for row in rows:
        right = (shown(row["labels"][cells]["pixel accuracy"]) for cells in ("all", "semantic"))
        lines.append([LEARNED_FROM[row["truth"]], per_cent(row["changed"]), *right])
    return markdown_table(lines)


def _networks(rows: list[dict], against: str, cells: str) -> str:
    """Lay out the networks' scores, and their differences from the usual networks, points."""
    lines = [["learned from", *METRICS, *(f"{name}, difference" for name in METRICS)]]
    for row in rows:
        scores, differences = (row[part][against][cells] for part in ("scores", "differences"))
        line = [LEARNED_FROM[row["truth"]], *(shown(scores[name]) for name in METRICS)]
        lines.append(line + [shown(differences[name], 2) if row is not rows[0] else "" for name in METRICS])
    return markdown_table(lines)


def _parts(rows: list[dict], part: str) -> str:
    """Lay out one line per class or band: the usual labels and networks, and what the others change."""
    usual, *others = rows
    lines = [["", "usual labels", "usual networks", *(LEARNED_FROM[row["truth"]] for row in others)]]
    for name, found in usual[part].items():
        changes = (shown(row[part][name]["difference"]) for row in others)
        lines.append([name, shown(found["labels"]), shown(found["networks"]), *changes])
    return markdown_table(lines)


def truth_costs_picture(result: dict) -> Figure:
    """Draw the differences from the usual networks, and how right networks are beside the labels they learned from.

    Parameters
    ----------
    result : dict
        From `truth_costs`.

    Returns
    -------
    Figure
    """
    usual, *others = result["rows"]
    figure, axes = plt.subplots(1, 3, figsize=(19, 5), layout="constrained")
    for ax, cells, which in zip(axes, ("all", "semantic"), ("all cells", "cells with a semantic class"), strict=False):
        differences = {LEARNED_FROM[row["truth"]]: row["differences"]["true"][cells] for row in others}
        shown_ones = {name: found["pixel accuracy"] for name, found in differences.items()}
        forest_plot(shown_ones, ax, f"pixel accuracy, {which}: difference from usual, points", reference=0)
    axes[1].set_yticklabels([])
    _draw_against_labels(axes[2], [usual, *others])
    return figure


def _draw_against_labels(ax: Axes, rows: list[dict]) -> None:
    """Draw how right the networks are on the test frames against how right their labels were in training."""
    for row, marker in zip(rows, _MARKERS, strict=False):
        labels, networks = (
            100 * scores["semantic"]["pixel accuracy"]["mean"] for scores in (row["labels"], row["scores"]["true"])
        )
        ax.plot(labels, networks, marker, markersize=8, markeredgecolor="0.2", label=LEARNED_FROM[row["truth"]])
    ax.axline((50, 50), slope=1, color="0.4", linewidth=0.8, label="as right as the labels")
    ax.set(title="cells with a semantic class", xlabel="labels of the training frames right, per cent")
    ax.set_ylabel("networks right on the test frames, per cent")
    ax.grid(alpha=0.3)
    ax.legend(fontsize="small")

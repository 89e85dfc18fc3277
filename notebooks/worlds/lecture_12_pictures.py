"""Pictures of scores: forest plots, and Tables 1 to 3 beside the paper's values (sections 4.2 to 4.4)."""

import json
from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_edu.errors import ArgumentError
from semgrid_edu.metrics import METRICS
from semgrid_edu.plotting import confusion
from semgrid_edu.workshop.paper.published import NETWORKS
from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval, shown

RESULTS = Path(__file__).resolve().parents[2] / "docs" / "results"
"""The committed results of `semgrid-edu reproduce`."""

SCORE_COLOUR, SEED_COLOUR = "#1f4e79", "#d95f02"
"""The colours of interval and mean, and of single seeds."""
_SEED_DROP = 0.24
"""How far below the interval the seeds are drawn, rows."""


def kept(name: str, scale: str = "reduced") -> dict:
    """Return a committed result of `semgrid-edu reproduce`.

    Parameters
    ----------
    name : str
        Its name, such as "table1".
    scale : str
        Its folder.
    """
    return json.loads((RESULTS / scale / f"{name}.json").read_text(encoding="utf-8"))


def forest_plot(
    rows: Mapping[str, ScoreWithInterval],
    ax: Axes | None = None,
    label: str = "score [%]",
    reference: float | None = None,
) -> Axes:
    """Draw means with their confidence intervals, and below each the value of every seed.

    Parameters
    ----------
    rows : mapping of str to dict
        Scores from `score_with_interval` or differences from `compared` by name, from top to bottom.
    ax : Axes, optional
        Axes to draw into.
    label : str
        Label of the x axis, with the unit.
    reference : float, optional
        Where to draw a vertical line, a share as the scores are: 0 for differences.

    Raises
    ------
    ArgumentError
        When there is no row.

    Examples
    --------
    >>> rows = {name: score_with_interval(counts[name], pixel_accuracy) for name in counts}      # doctest: +SKIP
    >>> forest_plot(rows, label="pixel accuracy [%]")                                            # doctest: +SKIP
    """
    if not rows:
        raise ArgumentError("rows", "one or more", "none")
    ax = ax or plt.subplots(figsize=(8, 1.2 + 0.5 * len(rows)), layout="constrained")[1]
    if reference is not None:
        ax.axvline(100 * reference, color="0.5", linewidth=1, linestyle="--", zorder=0)
    draw_scores(ax, rows)
    for number, value in enumerate(rows.values()):
        ax.annotate(shown(value), (1.02, number), xycoords=("axes fraction", "data"), va="center", fontsize="small")
    ax.set(xlabel=label, ylim=(len(rows) - 0.4, -0.6))
    ax.tick_params(axis="y", length=0)
    ax.spines[["left", "right", "top"]].set_visible(False)
    legend = {"loc": "lower right", "bbox_to_anchor": (1, 1), "ncols": 3, "frameon": False, "fontsize": "small"}
    ax.legend(*legend_entries(ax), **legend)
    return ax


def draw_scores(ax: Axes, rows: Mapping[str, ScoreWithInterval], **style: object) -> None:
    """Draw scores line by line, each with its name on the vertical axis; `style` is that of the names.

    Parameters
    ----------
    ax : Axes
        The chart.
    rows : mapping of str to dict
        Scores from `score_with_interval` or differences from `compared` by name; the first at 0, the next at 1.
    **style
        Passed on to `Axes.set_yticks`.
    """
    for place, value in enumerate(rows.values()):
        draw_score(ax, place, value)
    ax.set_yticks(range(len(rows)), list(rows), **style)
    ax.grid(axis="x", alpha=0.3)


def draw_score(ax: Axes, place: float, value: ScoreWithInterval) -> None:
    """Draw one score as a line of a chart, per cent: interval, mean, and below them a circle for every seed.

    Parameters
    ----------
    ax : Axes
        The chart.
    place : float
        Where the line is on the vertical axis.
    value : dict
        From `score_with_interval` or `compared`.
    """
    if value["mean"] is None:
        return
    if value["low"] is not None:
        ends = [100 * value["low"], 100 * value["high"]]
        ax.plot(ends, [place, place], color=SCORE_COLOUR, linewidth=2.5, alpha=0.6, label="95 % interval")
    ax.plot(100 * value["mean"], place, "D", color=SCORE_COLOUR, markersize=6, label="mean")
    seeds = [100 * seed for seed in value["seeds"] if seed is not None]
    if len(seeds) > 1:
        places = [place + _SEED_DROP] * len(seeds)
        ax.plot(seeds, places, "o", color=SEED_COLOUR, markerfacecolor="none", markersize=5, label="one seed")


def legend_entries(ax: Axes) -> tuple[list[Artist], list[str]]:
    """Return the entries of a legend, each text once.

    Parameters
    ----------
    ax : Axes
        A chart on which many lines have the same label.
    """
    once = {text: drawn for drawn, text in zip(*ax.get_legend_handles_labels(), strict=True)}
    return list(once.values()), list(once)


PAPERS = "#c0392b"
"""The colour of the paper's values; their marker differs from ours too."""

UNITS = dict(zip(METRICS, ("per cent of all labelled cells", "per cent, mean of the classes", "per cent"), strict=True))
"""What the numbers of each metric are."""


def accuracy_picture(result: dict) -> Figure:
    """Draw Table 1 or 2: one panel per metric, one line per network, without and with the CRF.

    Parameters
    ----------
    result : dict
        From `accuracy_result`.
    """
    rows = {NETWORKS[row["network"]] + (" + CRF" if row["CRF"] else ""): row for row in result["rows"]}
    size = (11, 1.6 + 0.45 * len(rows))
    figure, axes = plt.subplots(1, len(METRICS), figsize=size, sharey=True, layout="constrained")
    for ax, metric in zip(axes, METRICS, strict=True):
        draw_scores(ax, {name: row["scores"]["lidar"]["all"][metric] for name, row in rows.items()})
        papers = [100 * (row["paper"][metric] or np.nan) for row in rows.values()]
        ax.plot(papers, range(len(rows)), "X", color=PAPERS, label="the paper's", zorder=3)
        ax.set(title=metric, xlabel=UNITS[metric])
    axes[0].invert_yaxis()
    figure.legend(*legend_entries(axes[0]), loc="outside lower center", ncols=4)
    return figure


def confusion_picture(result: dict) -> Figure:
    """Draw Table 3: our confusion matrix beside the paper's.

    Parameters
    ----------
    result : dict
        From `confusion_result`.
    """
    figure, axes = plt.subplots(1, 2, figsize=(13, 6.6), layout="constrained")
    for ax, whose, title in zip(axes, ("ours", "paper"), ("ours, mean over the seeds", "the paper's"), strict=True):
        shares = np.array(result[whose]["matrix"], dtype=np.float64)  # None becomes NaN
        confusion(np.nan_to_num(shares), result["classes"], ax)
        ax.set_title(title)
    return figure

"""Pictures of the tables: the paper's values beside ours, with intervals and every seed (section 4)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_edu.experiments.reproduction.paper import NETWORKS
from semgrid_edu.metrics import METRICS
from semgrid_edu.plotting import confusion, draw_score

PAPERS = "#c0392b"
"""The colour of the paper's values; their marker differs from ours too."""


def accuracy_picture(result: dict) -> Figure:
    """Draw Table 1 or 2: one panel per metric, one line per network, without and with the CRF.

    Parameters
    ----------
    result : dict
        Its "rows" are from `accuracy_rows`.

    Returns
    -------
    Figure
    """
    rows = result["rows"]
    names = [NETWORKS[row["network"]] + (" + CRF" if row["CRF"] else "") for row in rows]
    size = (11, 1.6 + 0.45 * len(rows))
    figure, axes = plt.subplots(1, len(METRICS), figsize=size, sharey=True, layout="constrained")
    for ax, metric in zip(axes, METRICS, strict=True):
        for place, row in enumerate(rows):
            draw_score(ax, place, row["scores"]["lidar"]["all"][metric])
            ax.plot(100 * row["paper"][metric], place, "X", color=PAPERS, label="the paper's", zorder=3)
        ax.set(title=metric, xlabel="per cent of all labelled cells" if metric != "FmIoU" else "per cent")
        ax.grid(axis="x", alpha=0.3)
    axes[0].set_yticks(range(len(rows)), names)
    axes[0].invert_yaxis()
    once = {text: drawn for drawn, text in zip(*axes[0].get_legend_handles_labels(), strict=True)}
    figure.legend(once.values(), once, loc="outside lower center", ncols=4)
    return figure


def confusion_picture(result: dict) -> Figure:
    """Draw Table 3: our confusion matrix beside the paper's.

    Parameters
    ----------
    result : dict
        From `confusion_result`.

    Returns
    -------
    Figure
    """
    figure, axes = plt.subplots(1, 2, figsize=(13, 6.6), layout="constrained")
    for ax, whose, title in zip(axes, ("ours", "paper"), ("ours, mean over the seeds", "the paper's"), strict=True):
        shares = np.array([[np.nan if share is None else share for share in row] for row in result[whose]["matrix"]])
        confusion(np.nan_to_num(shares), result["classes"], ax)
        ax.set_title(title)
    return figure


def ablations_picture(result: dict) -> Figure:
    """Draw the ablations: pixel accuracy of the variants, with wrong calibrations, by distance, and reliability.

    Parameters
    ----------
    result : dict
        From `ablations`.

    Returns
    -------
    Figure
    """
    figure, axes = plt.subplots(1, 4, figsize=(19, 6), layout="constrained")
    trained = [row for row in result["variants"] if row["what"] != "usual"] + result["frames"]
    for ax, rows, title in zip(
        axes, (trained, result["calibration"]), ("trained differently", "wrong calibration"), strict=False
    ):
        for place, row in enumerate(rows):
            draw_score(ax, place, row["differences"]["true"]["all"]["pixel accuracy"])
        ax.axvline(0, color="0.4", linewidth=0.8)
        ax.set_yticks(range(len(rows)), [row["what"] for row in rows])
        ax.set(title=title, xlabel="pixel accuracy: difference from usual, points")
    for place, row in enumerate(result["distance"]):
        draw_score(axes[2], place, row["pixel accuracy"])
    axes[2].set_yticks(range(len(result["distance"])), [row["what"] for row in result["distance"]])
    axes[2].set(title="by distance", xlabel="pixel accuracy, per cent of cells with a semantic class")
    for ax in axes[:3]:
        ax.invert_yaxis()
        ax.grid(axis="x", alpha=0.3)
    _draw_sureness(axes[3], result["sureness"])
    return figure


def _draw_sureness(ax: Axes, rows: list[dict]) -> None:
    """Draw the reliability diagram of each method, all seeds together."""
    ax.plot([0, 1], [0, 1], color="0.4", linewidth=0.8)
    for row, marker in zip(rows, "osD", strict=True):
        cells, confidence, accuracy = (
            np.array([diagram[name] for diagram in row["diagrams"]]) for name in ("cells", "confidence", "accuracy")
        )
        some = cells.sum(axis=0) > 0
        sure, right = ((cells * part).sum(axis=0)[some] / cells.sum(axis=0)[some] for part in (confidence, accuracy))
        ax.plot(sure, right, marker=marker, label=row["what"])
    ax.set(title="reliability", xlabel="how sure: mean probability", ylabel="how often right", xlim=(0, 1), ylim=(0, 1))
    ax.legend(loc="upper left")

"""Pictures of the tables, the paper's values beside ours with intervals and every seed; Figures 6 and 7 (section 4)."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14, SYNTHIA_10, LabelSet
from semgrid_edu.metrics import METRICS
from semgrid_edu.plotting import class_legend, confusion, grid_labels
from semgrid_edu.workshop.paper.forest import draw_scores, legend_entries
from semgrid_edu.workshop.paper.plans import FIGURES, figure_runs
from semgrid_edu.workshop.paper.published import NETWORKS
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.scales import scale_named
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table

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


TITLES = {"true": "true labels", "network": "SegNet"}
"""The titles of the grids that both figures show."""

_FIGURE_6 = (KITTI_14, {"truth": "labels made\nwith the LIDAR", **TITLES, "refined": "SegNet + CRF"})
PARTS: dict[str, tuple[LabelSet, dict[str, str]]] = dict(
    zip(FIGURES, (_FIGURE_6, _FIGURE_6, (SYNTHIA_10, TITLES)), strict=True)
)
"""The classes of each figure's part, and the titles of its grids from left to right."""


def figures_picture(result: dict, counted: RunCounts) -> Figure:
    """Draw the figures: one row per frame, the image and its grids.

    Parameters
    ----------
    result : dict
        From `shown_frames`, and the scale.
    counted : RunCounts
        What is known about the runs.
    """
    runs = dict(zip(FIGURES, figure_runs(scale_named(result["scale"]), result["seeds"]), strict=True))
    figure = plt.figure(figsize=(13, 8.5 * len(runs)), layout="constrained")
    for part, (name, run) in zip(figure.subfigures(len(runs), 1), runs.items(), strict=True):
        part.suptitle(name, x=0.02, ha="left")
        _draw(part, run.grids(counted), *PARTS[name])
    return figure


def _draw(part: SubFigure, grids: dict[str, NDArray], label_set: LabelSet, columns: dict[str, str]) -> None:
    """Draw the rows of one figure."""
    n_rows = len(grids["frame"])
    shape = grids["true"].shape[1:]
    spec = next(spec for spec in (GridSpec.compact(), GridSpec.paper()) if spec.shape == shape)
    axes = part.subplots(n_rows, 1 + len(columns), width_ratios=[2.2] + [1] * len(columns), squeeze=False)
    for row, line in enumerate(axes):
        line[0].imshow(grids["image"][row].transpose(1, 2, 0))
        line[0].set_axis_off()
        line[0].set_title(f"test frame {grids['frame'][row]}", fontsize="medium")
        for ax, (name, title) in zip(line[1:], columns.items(), strict=True):
            grid_labels(spec, grids[name][row], label_set, ax=ax, legend=False)
            ax.set_title(title if row == 0 else "", fontsize="medium")
            outer_left = ax is line[1]
            lowest = row == n_rows - 1  # only outer grids name their axes
            ax.tick_params(labelleft=outer_left, labelbottom=lowest)
            ax.set(xlabel=ax.get_xlabel() * lowest, ylabel=ax.get_ylabel() * outer_left)
    class_legend(axes[0, -1], label_set, grids["true"])


def figures_markdown(result: dict) -> str:
    """Return which frames the figures show, as Markdown.

    Parameters
    ----------
    result : dict
        From `shown_frames`.
    """
    rows = [[name, ", ".join(map(str, shown["frames"]))] for name, shown in result["figures"].items()]
    table = markdown_table([["", "test frames"], *rows])
    return f"Frames at fixed shares of the test split; nobody chose them.\n\n{table}"

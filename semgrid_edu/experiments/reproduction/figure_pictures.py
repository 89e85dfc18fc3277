"""Figures 6 and 7: a few test frames, their labels, and what the network makes of them (sections 4.2 and 4.4)."""

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from semgrid_edu.experiments.tables import markdown_table
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import KITTI_14, SYNTHIA_10, LabelSet
from semgrid_edu.plotting import class_legend, grid_labels
from semgrid_edu.storage.arrays import read_arrays

COLUMNS = {
    "Figure 6": {
        "truth": "labels made\nwith the LIDAR",
        "true": "true labels",
        "network": "SegNet",
        "refined": "SegNet + CRF",
    },
    "Figure 7": {"true": "true labels", "network": "SegNet"},
}
"""The grids of each figure, from left to right, and their titles."""

LABEL_SET_OF = {"Figure 6": KITTI_14, "Figure 7": SYNTHIA_10}
"""The classes of each figure."""


def figures_picture(result: dict, root: Path) -> Figure:
    """Draw both figures: one row per frame, the image and its grids.

    Parameters
    ----------
    result : dict
        From `shown_frames`.
    root : Path
        The folder of all runs.

    Returns
    -------
    Figure
    """
    figure = plt.figure(figsize=(13, 17), layout="constrained")
    parts = figure.subfigures(2, 1)
    for part, (name, shown) in zip(parts, result["figures"].items(), strict=True):
        part.suptitle(name, x=0.02, ha="left")
        _draw(part, read_arrays(root / shown["grids"]), COLUMNS[name], LABEL_SET_OF[name])
    return figure


def _draw(part: SubFigure, grids: dict[str, NDArray], columns: dict[str, str], label_set: LabelSet) -> None:
    """Draw the rows of one figure."""
    n_rows, spec = len(grids["frame"]), _spec_of(grids["true"].shape[1:])
    axes = part.subplots(n_rows, 1 + len(columns), width_ratios=[2.2] + [1] * len(columns), squeeze=False)
    for row, line in enumerate(axes):
        line[0].imshow(grids["image"][row].transpose(1, 2, 0))
        line[0].set_axis_off()
        line[0].set_title(f"test frame {grids['frame'][row]}", fontsize="medium")
        for ax, (name, title) in zip(line[1:], columns.items(), strict=True):
            grid_labels(spec, grids[name][row], label_set, ax=ax, legend=False)
            ax.set_title(title if row == 0 else "", fontsize="medium")
            _keep_outer_labels(ax, first=ax is line[1], last=row == n_rows - 1)
    class_legend(axes[0, -1], label_set, grids["true"])


def _keep_outer_labels(ax: Axes, first: bool, last: bool) -> None:
    """Name the axes of a grid where no other grid stands to its left, or below it."""
    if not first:
        ax.set_ylabel("")
        ax.tick_params(labelleft=False)
    if not last:
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False)


def _spec_of(shape: tuple[int, int]) -> GridSpec:
    """Return the grid that has this many cells."""
    return next(spec for spec in (GridSpec.compact(), GridSpec.paper()) if spec.shape == tuple(shape))


def figures_markdown(result: dict) -> str:
    """Return which frames the figures show, as Markdown.

    Parameters
    ----------
    result : dict
        From `shown_frames`.

    Returns
    -------
    str
    """
    rows = [[name, ", ".join(map(str, shown["frames"]))] for name, shown in result["figures"].items()]
    return "Frames at fixed shares of the test split; nobody chose them.\n\n" + markdown_table(
        [["", "test frames"], *rows]
    )

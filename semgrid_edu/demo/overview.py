"""One picture of one frame through every stage: the opening picture of README and page (paper, Fig. 2)."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.datasets.truth import grid_truth
from semgrid_edu.demo.rasters import scores_layer
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.plotting.images import draw_image
from semgrid_edu.plotting.legends import colour_patches
from semgrid_edu.storage.files import atomic_path

REACH = 50.0
"""Metres ahead that the picture shows: beyond, few cells are seen."""


def save_overview(result: FrameResult, spec: GridSpec, label_set: LabelSet, path: str | Path) -> None:
    """Draw image and grids of one frame side by side and save them as PNG.

    Parameters
    ----------
    result : FrameResult
    spec : GridSpec
    label_set : LabelSet
    path : path-like
    """
    with plt.rc_context({"font.size": 9, "axes.titlesize": 11, "axes.titlelocation": "left"}):
        figure = draw_overview(result, spec, label_set)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    plt.close(figure)


def draw_overview(result: FrameResult, spec: GridSpec, label_set: LabelSet) -> Figure:
    """Draw image and grids of one frame: (l, i), s, o, g, refined g and, where it is known, the truth."""
    maps = {"semantic grid g": result.grid.argmax(axis=0), "g refined by the CRF": result.refined.argmax(axis=0)}
    if result.frame.labels is not None:
        maps["truth"] = grid_truth(result.frame.labels, result.belief.probability, spec)
    figure = plt.figure(figsize=(13, 8.3), layout="constrained")
    photos, grids, legend = figure.subfigures(3, 1, height_ratios=(2.3, 5.4, 0.6))
    left, right = photos.subplots(1, 2)
    near, far = plotting.DEPTH_RANGE
    points = plotting.points_on_image(result.frame, left, size=2.0, colour_bar=False)
    points.set_title(f"LIDAR points l on the image i: near ones ({near:g} m) yellow, far ones ({far:g} m) blue")
    _draw_scores(right, result, label_set)
    first, *others = grids.subplots(1, 1 + len(maps), sharey=True)
    plotting.occupancy(spec, result.belief.probability, first, legend=False).set_title("occupancy grid o")
    plotting.velocity(spec, result.belief.probability, result.belief.velocity, first)
    for ax, (title, labels) in zip(others, maps.items(), strict=True):
        plotting.grid_labels(spec, labels, label_set, ax, legend=False).set(title=title, ylabel="")
    first.set_ylim(spec.x_min, min(spec.x_max, spec.x_min + REACH))
    _draw_legend(legend, np.unique(np.stack([*maps.values()])), label_set)
    return figure


def _draw_scores(ax: Axes, result: FrameResult, label_set: LabelSet) -> None:
    draw_image(result.frame.image, ax)
    height, width = result.frame.image.shape[:2]
    ax.imshow(scores_layer(result.scores, label_set), extent=(-0.5, width - 0.5, height - 0.5, -0.5))
    ax.set_title("image scores s, the best class of each pixel")


def _draw_legend(figure: Figure, classes: NDArray, label_set: LabelSet) -> None:
    """Name the states of the occupancy grid, then the classes that occur."""
    entries = [*zip(plotting.STATE_NAMES, plotting.STATE_COLOURS, strict=True)]
    entries += [(label_set.names[c], label_set.rgb[c]) for c in classes if c < len(label_set)]
    patches = colour_patches(*zip(*entries, strict=True))
    columns = -(-len(patches) // 2)
    figure.legend(handles=patches, ncols=columns, loc="center", frameon=False, columnspacing=1.3, handlelength=1.4)

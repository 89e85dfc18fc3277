"""One frame through every stage in one picture, such as the one that opens the README (paper, Fig. 2)."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.plotting.colours import colour_patches
from semgrid_edu.plotting.images import draw_image
from semgrid_edu.storage.files import atomic_path
from semgrid_edu.workshop.demo.comparison import Comparison
from semgrid_edu.workshop.demo.pictures import scores_layer

REACH = 50.0
"""How far ahead the picture shows the grids, metres: few cells are seen beyond."""


def save_overview(
    package: FrameResult,
    yours: FrameResult | None,
    spec: GridSpec,
    label_set: LabelSet,
    path: str | Path,
    comparison: Comparison | None = None,
) -> None:
    """Draw image and grids of one frame and save them as PNG.

    Parameters
    ----------
    package : FrameResult
        The frame's result with the package's own stages.
    yours : FrameResult or None
        Its result with a student's stages, to be shown beside it.
    spec : GridSpec
        The grid of both results.
    label_set : LabelSet
        The classes, for colours and names.
    path : path-like
        The file to write; its folder is made when missing.
    comparison : Comparison, optional
        Which stages are the student's; needed with `yours`.
    """
    with plt.rc_context({"font.size": 9, "axes.titlesize": 11, "axes.titlelocation": "left"}):
        figure = draw_overview(package, yours, spec, label_set, comparison)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    plt.close(figure)


def draw_overview(
    package: FrameResult,
    yours: FrameResult | None,
    spec: GridSpec,
    label_set: LabelSet,
    comparison: Comparison | None = None,
) -> Figure:
    """Draw image and grids of one frame: (l, i), s, o, g, refined g and, where it is known, the truth.

    In a comparison, each grid that the student's stages can change is followed, below it, by the student's own grid.
    Parameters are those of `save_overview`, without the path.

    Returns
    -------
    Figure
        A new figure of matplotlib.
    """
    maps = {"semantic grid g": package.grid.argmax(axis=0), "g refined by the CRF": package.refined.argmax(axis=0)}
    if package.frame.labels is not None:
        maps["truth"] = grid_truth(package.frame.labels, package.belief.probability, spec)
    rows = 1 if comparison is None else 2
    heights = 2.3, 5.4 * rows, 0.6
    figure = plt.figure(figsize=(13, sum(heights)), layout="constrained")
    photos, grids, legend = figure.subfigures(3, 1, height_ratios=heights)
    _draw_photos(photos, package, yours, label_set, comparison)
    axes = grids.subplots(rows, 1 + len(maps), sharey=True, squeeze=False)
    _draw_grids(axes[0], package, maps, spec, label_set)
    shown = [*maps.values()]
    if comparison is not None:
        shown += _draw_yours(axes[1], yours, spec, label_set, comparison)
    _draw_legend(legend, np.unique(np.stack(shown)), label_set)
    return figure


def _draw_photos(
    figure: SubFigure,
    package: FrameResult,
    yours: FrameResult | None,
    label_set: LabelSet,
    comparison: Comparison | None,
) -> None:
    """Draw LIDAR returns and scores on the image, and a student's scores as well."""
    both = comparison is not None and "scores" in comparison.changed
    left, right, *others = figure.subplots(1, 3 if both else 2)
    near, far = plotting.DEPTH_RANGE
    points = plotting.points_on_image(package.frame, left, size=2.0, colour_bar=False)
    colours = f"near ones ({near:g} m) yellow, far ones ({far:g} m) blue"
    points.set_title(f"LIDAR points l on the image i{chr(10) if both else ': '}{colours}")
    _draw_scores(right, package, label_set)
    for ax in others:
        _draw_scores(ax, yours, label_set)
        ax.set_title(f"image scores s\n{comparison.file}")


def _draw_scores(ax: Axes, result: FrameResult, label_set: LabelSet) -> None:
    draw_image(result.frame.image, ax)
    height, width = result.frame.image.shape[:2]
    ax.imshow(scores_layer(result.scores, label_set), extent=(-0.5, width - 0.5, height - 0.5, -0.5))
    ax.set_title("image scores s, the best class of each pixel")


def _draw_grids(
    axes: Sequence[Axes], result: FrameResult, maps: dict[str, NDArray], spec: GridSpec, label_set: LabelSet
) -> None:
    """Draw the occupancy grid, and maps of classes under their titles."""
    first, *others = axes
    plotting.occupancy(spec, result.belief.probability, first, legend=False).set_title("occupancy grid o")
    plotting.velocity(spec, result.belief.probability, result.belief.velocity, first)
    for ax, (title, labels) in zip(others, maps.items(), strict=False):
        plotting.grid_labels(spec, labels, label_set, ax, legend=False).set(title=title, ylabel="")
    first.set_ylim(spec.x_min, min(spec.x_max, spec.x_min + REACH))


def _draw_yours(
    axes: Sequence[Axes], yours: FrameResult, spec: GridSpec, label_set: LabelSet, comparison: Comparison
) -> list[NDArray]:
    """Draw a student's grids, except those that can't differ from the package's, and return the maps of classes."""
    maps = {"semantic grid g": yours.grid.argmax(axis=0), "refined g": yours.refined.argmax(axis=0)}
    _draw_grids(axes, yours, maps, spec, label_set)
    for ax, picture in zip(axes, ("occupancy", "grid", "refined", "truth"), strict=False):
        ax.set_visible(picture in comparison.changed)
        ax.set_title(f"{ax.get_title(loc='left')}\n{comparison.file}")
    leftmost = next(ax for ax in axes if ax.get_visible())
    leftmost.tick_params(labelleft=True)
    leftmost.set_ylabel(axes[0].get_ylabel())
    return [*maps.values()]


def _draw_legend(figure: Figure, classes: NDArray, label_set: LabelSet) -> None:
    """Name the states of the occupancy grid, then the classes that occur."""
    entries = [*zip(plotting.STATE_NAMES, plotting.STATE_COLOURS, strict=True)]
    entries += [(label_set.names[c], label_set.rgb[c]) for c in classes if c < len(label_set)]
    patches = colour_patches(*zip(*entries, strict=True))
    columns = -(-len(patches) // 2)
    figure.legend(handles=patches, ncols=columns, loc="center", frameon=False, columnspacing=1.3, handlelength=1.4)

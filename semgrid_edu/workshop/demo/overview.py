"""One frame through every stage in one picture, such as the one that opens the README (paper, Fig. 2)."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.datasets.grid_truth import grid_truth
from semgrid_edu.labels import LabelSet
from semgrid_edu.pipeline import FrameResult
from semgrid_edu.plotting.colours import colour_patches
from semgrid_edu.plotting.images import draw_image
from semgrid_edu.storage.files import atomic_path
from semgrid_edu.workshop.demo.pictures import scores_layer
from semgrid_edu.workshop.demo.record import Record

REACH = 50.0
"""How far ahead the picture shows the grids, metres: few cells are seen beyond."""

STYLE = {"font.size": 9, "axes.titlesize": 11, "axes.titlelocation": "left"}


def save_overview(record: Record, path: str | Path, words: str = "") -> None:
    """Draw image and grids of the frame in which most moves, and save them as PNG.

    Parameters
    ----------
    record : Record
        What was recorded of the drive. In a comparison, each grid that the student's stages can change is followed,
        below it, by the student's own grid.
    path : path-like
        The file to write; its folder is made when missing.
    words : str
        What stands below the picture: what to expect of it, and whose data it shows.
    """
    with plt.rc_context(STYLE):
        figure = _draw(record, wrap(words, 190))
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    plt.close(figure)


def _draw(record: Record, lines: list[str]) -> Figure:
    """Draw (l, i), s, o, g, refined g and, where it is known, the truth; below it some lines of text."""
    package, yours = record.liveliest
    maps = {"semantic grid g": package.grid.argmax(axis=0), "g refined by the CRF": package.refined.argmax(axis=0)}
    if package.remembered is not None:
        maps["g with memory"] = package.remembered.argmax(axis=0)
    if package.frame.labels is not None:
        maps["truth"] = grid_truth(package.frame.labels, package.belief.probability, record.spec)
    rows = 1 if yours is None else 2
    heights = [2.3, 5.4 * rows, 0.6, *[0.2 * len(lines) + 0.1] * bool(lines)]
    figure = plt.figure(figsize=(13, sum(heights)), layout="constrained")
    photos, grids, legend, *below = figure.subfigures(len(heights), 1, height_ratios=heights)
    for part in below:
        part.text(0.01, 0.5, "\n".join(lines), va="center", linespacing=1.3)
    _draw_photos(photos, record)
    axes = grids.subplots(rows, 1 + len(maps), sharey=True, squeeze=False)
    _draw_grids(axes[0], package, maps, record)
    shown = [*maps.values()]
    if yours is not None:
        shown += _draw_yours(axes[1], yours, record)
    _draw_legend(legend, np.unique(np.stack(shown)), record.label_set)
    return figure


def _draw_photos(figure: SubFigure, record: Record) -> None:
    """Draw LIDAR returns and scores on the image, and a student's scores as well."""
    package, yours = record.liveliest
    both = yours is not None and "scores" in record.comparison.changed
    left, right, *others = figure.subplots(1, 3 if both else 2)
    near, far = plotting.DEPTH_RANGE
    points = plotting.points_on_image(package.frame, left, size=2.0, colour_bar=False)
    colours = f"near ones ({near:g} m) yellow, far ones ({far:g} m) blue"
    points.set_title(f"LIDAR points l on the image i{chr(10) if both else ': '}{colours}")
    _draw_scores(right, package, record.label_set)
    for ax in others:
        _draw_scores(ax, yours, record.label_set)
        ax.set_title(f"image scores s\n{record.comparison.file}")


def _draw_scores(ax: Axes, result: FrameResult, label_set: LabelSet) -> None:
    draw_image(result.frame.image, ax)
    height, width = result.frame.image.shape[:2]
    ax.imshow(scores_layer(result.scores, label_set), extent=(-0.5, width - 0.5, height - 0.5, -0.5))
    ax.set_title("image scores s, the best class of each pixel")


def _draw_grids(axes: Sequence[Axes], result: FrameResult, maps: dict[str, NDArray], record: Record) -> None:
    """Draw the occupancy grid, and maps of classes under their titles."""
    (first, *others), spec = axes, record.spec
    plotting.occupancy(spec, result.belief.probability, first, legend=False).set_title("occupancy grid o")
    plotting.velocity(spec, result.belief.probability, result.belief.velocity, first)
    for ax, (title, labels) in zip(others, maps.items(), strict=False):
        plotting.grid_labels(spec, labels, record.label_set, ax, legend=False).set(title=title, ylabel="")
    first.set_ylim(spec.x_min, min(spec.x_max, spec.x_min + REACH))


def _draw_yours(axes: Sequence[Axes], yours: FrameResult, record: Record) -> list[NDArray]:
    """Draw a student's grids, except those that can't differ from the package's, and return the maps of classes."""
    maps = {"semantic grid g": yours.grid.argmax(axis=0), "refined g": yours.refined.argmax(axis=0)}
    if yours.remembered is not None:
        maps["g with memory"] = yours.remembered.argmax(axis=0)
    _draw_grids(axes, yours, maps, record)
    for ax, picture in zip(axes, ("occupancy", "grid", "refined", "remembered", "truth"), strict=False):
        ax.set_visible(picture in record.comparison.changed)
        ax.set_title(f"{ax.get_title(loc='left')}\n{record.comparison.file}")
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

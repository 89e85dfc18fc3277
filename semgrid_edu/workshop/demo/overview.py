"""One frame through every stage in one picture, as at the top of the README (paper, Fig. 2)."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import NamedTuple

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

MOST_IN_A_ROW = 6
"""Grids side by side; more begin a second row."""

STYLE = {"font.size": 9, "axes.titlesize": 11, "axes.titlelocation": "left"}


class GridPicture(NamedTuple):
    """A bird's-eye picture.

    Parameters
    ----------
    title : str
        Its title.
    result : FrameResult
        The result that it shows.
    labels : (H, W) int or None
        A map of classes; None for the occupancy grid.
    """

    title: str
    result: FrameResult
    labels: NDArray | None


def save_overview(record: Record, path: str | Path, words: str = "") -> None:
    """Draw image and grids of the frame in which most cells move, and save them as PNG.

    Parameters
    ----------
    record : Record
        What was recorded of the drive. In a comparison, the student's grids follow if they can differ.
    path : path-like
        The file to write; its folder is made when missing.
    words : str
        The text below the picture: what to expect of it, and whose data it shows.
    """
    with plt.rc_context(STYLE):
        figure = _draw(record, wrap(words, 190))
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110)
    plt.close(figure)


def _draw(record: Record, lines: list[str]) -> Figure:
    """Draw (l, i), s, o, g, refined g and, where it is known, the truth; a student's grids follow; then some lines."""
    package, yours = record.liveliest
    panels = _panels(package, record)
    if yours is not None:
        panels += _panels(yours, record, f"\n{record.comparison.file}", record.comparison.changed)
    rows = -(-len(panels) // MOST_IN_A_ROW)
    heights = [2.3, 5.4 * rows, 0.6, *[0.2 * len(lines) + 0.1] * bool(lines)]
    figure = plt.figure(figsize=(13, sum(heights)), layout="constrained")
    photos, grids, legend, *below = figure.subfigures(len(heights), 1, height_ratios=heights)
    for part in below:
        part.text(0.01, 0.5, "\n".join(lines), va="center", linespacing=1.3)
    _draw_photos(photos, record)
    axes = grids.subplots(rows, -(-len(panels) // rows), sharey=True, squeeze=False).ravel()
    for ax, panel in zip(axes, panels, strict=False):
        _draw_panel(ax, panel, record)
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    shown = [panel.labels for panel in panels if panel.labels is not None]
    _draw_legend(legend, np.unique(np.stack(shown)), record.label_set)
    return figure


def _panels(result: FrameResult, record: Record, whose: str = "", of: Sequence[str] | None = None) -> list[GridPicture]:
    """Return the grids of a result; with `of`, those among these pictures alone."""
    maps = {"grid": ("semantic grid g", result.grid), "refined": ("g refined by the CRF", result.refined)}
    if result.remembered is not None:
        maps["remembered"] = "g with memory", result.remembered
    panels = {"occupancy": GridPicture(f"occupancy grid o{whose}", result, None)}
    panels |= {name: GridPicture(f"{title}{whose}", result, g.argmax(axis=0)) for name, (title, g) in maps.items()}
    if result.frame.labels is not None and of is None:
        truth = grid_truth(result.frame.labels, result.belief.probability, record.spec)
        panels["truth"] = GridPicture("truth", result, truth)
    return [panel for name, panel in panels.items() if of is None or name in of]


def _draw_panel(ax: Axes, panel: GridPicture, record: Record) -> None:
    """Draw the occupancy grid with velocities, or a map of classes."""
    spec = record.spec
    belief = panel.result.belief
    if panel.labels is None:
        plotting.occupancy(spec, belief.probability, ax, legend=False)
        plotting.velocity(spec, belief.probability, belief.velocity, ax, belief.velocity_covariance)
    else:
        plotting.grid_labels(spec, panel.labels, record.label_set, ax, legend=False)
    ax.set_title(panel.title)
    ax.set_ylim(spec.x_min, min(spec.x_max, spec.x_min + REACH))
    if not ax.get_subplotspec().is_first_col():
        ax.set_ylabel("")


def _draw_photos(figure: SubFigure, record: Record) -> None:
    """Draw LIDAR returns and scores on the image, and a student's scores as well."""
    package, yours = record.liveliest
    both = yours is not None and "scores" in record.comparison.changed
    left, right, *others = figure.subplots(1, 3 if both else 2)
    near, far = plotting.DEPTH_RANGE
    points = plotting.points_on_image(package.frame, left, size=2.0)
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


def _draw_legend(figure: Figure, classes: NDArray, label_set: LabelSet) -> None:
    """Name the states of the occupancy grid, then the classes that occur."""
    entries = [*zip(plotting.STATE_NAMES, plotting.STATE_COLOURS, strict=True)]
    entries += [(label_set.names[c], label_set.rgb[c]) for c in classes if c < len(label_set)]
    patches = colour_patches(*zip(*entries, strict=True))
    columns = -(-len(patches) // 2)
    figure.legend(handles=patches, ncols=columns, loc="center", frameon=False, columnspacing=1.3, handlelength=1.4)

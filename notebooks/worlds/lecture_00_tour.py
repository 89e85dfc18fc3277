"""The figures of lecture 00: a street and its map, cells of one class, and the story of one cell (paper, Fig. 2)."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import ndimage

from semgrid_edu import plotting
from semgrid_edu.camera import project, transform_points
from semgrid_edu.frame import Frame
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.plotting.colours import STATE_COLOURS, STATE_NAMES, class_legend, colour_legend
from semgrid_edu.plotting.images import draw_image

NOTE = {"ha": "center", "va": "center", "fontsize": 10, "fontweight": "bold", "color": "black"} | {
    "bbox": {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "black", "linewidth": 0.8}
}
"""How a letter is written on a picture or a map."""


def pixels_of(frame: Frame, points: NDArray) -> NDArray[np.float64]:
    """Return the pixels of N points (x, y, z) of the grid frame, (N, 2): u and v, by eq. (1)."""
    return project(transform_points(frame.camera.T_camera_from_grid, np.asarray(points, float)), frame.camera)[0]


def picture_and_map(
    frame: Frame, spec: GridSpec, labels: NDArray, places: Mapping[str, tuple[float, float, float]]
) -> Figure:
    """Draw the camera image and the map of classes, with the same letters on both.

    Parameters
    ----------
    frame : Frame
        The frame, for its image and camera.
    spec : GridSpec
        The grid.
    labels : (H, W) int
        The map.
    places : mapping of str to (x, y, z)
        The place of each letter in the grid frame, metres.
    """
    fig = plt.figure(figsize=(10, 6.2), layout="constrained")
    axes = fig.subplot_mosaic([["map", "image"], ["map", "legend"]], width_ratios=[1, 2.6], height_ratios=[2, 1.3])
    draw_image(frame.image // 8 * 8, axes["image"]).set_title("what the camera sees", fontsize=10)
    plotting.grid_labels(spec, labels, KITTI_14, ax=axes["map"], legend=False).set_title("the map", fontsize=10)
    axes["legend"].axis("off")
    class_legend(axes["legend"], KITTI_14, labels, loc="upper left", bbox_to_anchor=(0, 1), ncols=3, fontsize=9)
    for letter, (x, y, z) in places.items():
        aside = {"xytext": (22 if y < 0 else -22, 14), "textcoords": "offset points"}
        axes["map"].annotate(letter, (y, x), arrowprops={"arrowstyle": "->"}, **aside, **NOTE)
        axes["image"].text(*pixels_of(frame, [(x, y, z)])[0], letter, **NOTE)
    return fig


def painted_over(scores: NDArray, c: int, around: int = 3) -> NDArray:
    """Give each pixel that is called class `c`, and those around it, the scores of the nearest other pixel.

    Parameters
    ----------
    scores : (C, h, w) float
        The image network's scores.
    c : int
        The class to paint over.
    around : int
        How far around these pixels, in pixels, is painted over as well.
    """
    hidden = ndimage.binary_dilation(scores.argmax(axis=0) == c, iterations=around)
    rows, columns = ndimage.distance_transform_edt(hidden, return_distances=False, return_indices=True)
    return scores[:, rows, columns]


def draw_called(ax: Axes, spec: GridSpec, called: NDArray, c: int, truth: NDArray) -> None:
    """Draw which cells are called class `c`: red without a label, black crosses with another, blue dots if right.

    Parameters
    ----------
    ax : matplotlib Axes
        Where to draw.
    spec : GridSpec
        The grid.
    called, truth : (H, W) int
        The class that the map gives to each cell, and its label; 255 without one.
    c : int
        The class.
    """
    labelled = truth < KITTI_14.n_semantic
    picture = np.full((*spec.shape, 3), 255, np.uint8)
    picture[labelled] = 215
    picture[(called == c) & ~labelled] = (200, 0, 50)
    plotting.grids.draw_map(spec, picture, ax)
    kinds = {"right": (truth == c, "o", "tab:blue"), "labelled otherwise": (labelled & (truth != c), "x", "black")}
    for name, (which, marker, colour) in kinds.items():
        x, y = spec.centers()[which & (called == c)].T
        ax.plot(y, x, marker, color=colour, markersize=4, label=name)
    ax.plot([], [], "s", color=(200 / 255, 0, 50 / 255), label="without a label")
    ax.plot([], [], "s", color="0.84", label="labelled, called otherwise")


def draw_story(
    frame: Frame,
    column: NDArray,
    states: NDArray,
    times: Sequence[float],
    answers: Mapping[str, NDArray],
) -> Figure:
    """Draw the story of a cell: its column in the image, its states scan by scan, and the classes it is given.

    Parameters
    ----------
    frame : Frame
        The last frame.
    column : (D, 3) float
        The points above the cell, in the grid frame.
    states : (4, T) float
        The probability of each state after each scan.
    times : sequence of float
        The times of the scans, seconds.
    answers : mapping of str to (C,) float
        The probability of each class, by what was used.
    """
    fig = plt.figure(figsize=(9, 6), layout="constrained")
    axes = fig.subplot_mosaic([["image", "image"], ["states", "answers"]], height_ratios=[1, 0.8])
    draw_image(frame.image // 8 * 8, axes["image"]).set_title("1  the points of the cell in the image", fontsize=10)
    axes["image"].plot(*pixels_of(frame, column).T, "o", color="white", markeredgecolor="#d81b60", markersize=4)
    rows = dict(zip([f"{time:.1f} s" for time in times], states.T, strict=True))
    _bars(axes["states"], rows, STATE_COLOURS)
    axes["states"].set_title("2  what the filter believes", fontsize=10)
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2), "fontsize": 9, "columnspacing": 1.0}
    colour_legend(axes["states"], STATE_NAMES, STATE_COLOURS, ncols=4, **place)
    _bars(axes["answers"], answers, KITTI_14.rgb)
    axes["answers"].set_title("3  what it is called", fontsize=10)
    for row, p in enumerate(answers.values()):
        axes["answers"].text(
            0.02, row, f"{KITTI_14.names[p.argmax()]} {p.max():.2f}", va="center", fontsize=9
        ).set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 1.5})
    best = np.where(np.max(list(answers.values()), axis=0) > 0.02, np.arange(len(KITTI_14)), IGNORE)
    class_legend(axes["answers"], KITTI_14, best, ncols=4, **place)
    return fig


def _bars(ax: Axes, rows: Mapping[str, NDArray], colours: Sequence[tuple[int, int, int]]) -> None:
    """Draw rows of probabilities as stacked bars, from top to bottom."""
    left = np.zeros(len(rows))
    for values, colour in zip(np.stack(list(rows.values()), axis=1), colours, strict=True):
        if values.max() < 0.005:
            continue  # too thin to be seen
        ax.barh(range(len(rows)), values, left=left, color=np.divide(colour, 255), edgecolor="0.5", linewidth=0.4)
        left = left + values
    ax.set_yticks(range(len(rows)), list(rows), fontsize=9)
    ax.set(xlim=(0, 1), ylim=(len(rows) - 0.5, -0.5))
    ax.set_xlabel("probability", fontsize=9)

"""The figure of lecture 09: where ground truth from LIDAR differs from the truth."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.plotting.colours import class_legend, colour_legend
from semgrid_edu.plotting.grids import draw_map, grid_labels

DIFFERENCES = {
    "no label in either": (240, 240, 240),
    "the same label": (186, 205, 186),
    "another label": (196, 0, 40),
    "seen, but not labelled": (60, 110, 200),
    "labelled, but not seen": (250, 196, 60),
}
"""What a cell can be in `truth_difference`, and its colour: what agrees is pale, and the three errors differ in
lightness too."""


def difference_kinds(truth: NDArray, labels: NDArray, n_semantic: int) -> NDArray[np.int64]:
    """Return how labels differ from the truth in each cell: numbers of `DIFFERENCES`, (H, W).

    Two different unknown classes don't count as a difference.

    Parameters
    ----------
    truth : (H, W) int
        From `grid_truth`: what stands in the cells that the camera sees, an unknown class elsewhere.
    labels : (H, W) int
        From `lidar_truth`.
    n_semantic : int
        Number of semantic classes, which come first.
    """
    seen = np.asarray(truth) < n_semantic
    labelled = np.asarray(labels) < n_semantic
    return np.select([seen & labelled & (truth == labels), seen & labelled, seen, labelled], [1, 2, 3, 4], default=0)


def truth_difference(spec: GridSpec, truth: NDArray, labels: NDArray, label_set: LabelSet) -> Figure:
    """Draw the truth, labels made from LIDAR, and where they differ, side by side.

    Parameters
    ----------
    spec : GridSpec
        The grid.
    truth : (H, W) int
        From `grid_truth`: what stands in the cells that the camera sees, an unknown class elsewhere.
    labels : (H, W) int
        From `lidar_truth`.
    label_set : LabelSet
        The classes, for colours and names.

    Raises
    ------
    ArgumentError
        When a map doesn't fit `spec`.
    """
    figure, axes = plt.subplots(1, 3, figsize=(12.5, 5.8), layout="compressed")
    grid_labels(spec, truth, label_set, axes[0], legend=False).set_title("truth")
    grid_labels(spec, labels, label_set, axes[1], legend=False).set_title("made from LIDAR and image labels")
    class_legend(axes[1], label_set, np.stack([truth, labels]))
    kinds = difference_kinds(truth, labels, label_set.n_semantic)
    colours = np.array(list(DIFFERENCES.values()), np.uint8)
    draw_map(spec, colours[kinds], axes[2]).set_title("difference")
    shares = np.bincount(kinds.ravel(), minlength=len(DIFFERENCES)) / kinds.size
    names = [f"{name} ({share:.1%})" for name, share in zip(DIFFERENCES, shares, strict=True)]
    colour_legend(axes[2], names, DIFFERENCES.values())
    return figure

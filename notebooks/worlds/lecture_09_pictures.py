"""Figures of lecture 09: where ground truth from LIDAR differs from the truth, and its errors by distance."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu.errors import ArgumentError
from semgrid_edu.grid import GridSpec
from semgrid_edu.labels import LabelSet
from semgrid_edu.plotting.colours import class_legend, colour_legend
from semgrid_edu.plotting.grids import draw_map, grid_labels
from worlds.lecture_09_counts import COUNTED, TruthCounts

DIFFERENCES = {
    "no label in either": (240, 240, 240),
    "the same label": (186, 205, 186),
    "another label": (196, 0, 40),
    "seen, but not labelled": (60, 110, 200),
    "labelled, but not seen": (250, 196, 60),
}
"""What a cell can be in `truth_difference`, and its colour: what agrees is pale, and the three errors differ in
lightness too."""
CHARTED = {
    "mistaken": "seen, another label",
    "missed": "seen, no label",
    "wrong": "labelled, but something\nelse is there",
}
"""The shares of `TruthCounts.shares` that `truth_errors` draws, and their titles."""
_MARKERS = "osD^vP*Xhp"


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
    seen, labelled = np.asarray(truth) < n_semantic, np.asarray(labels) < n_semantic
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


def truth_errors(counts: TruthCounts, edges: Sequence[float], label_set: LabelSet, least: int = 50) -> Figure:
    """Draw the errors of labels against distance, one line per class, one panel per kind of error.

    Parameters
    ----------
    counts : TruthCounts
        From `score_frame`, or from `counts_of`.
    edges : sequence of float
        Where the bands of distance begin and end, metres: `BAND_EDGES`.
    label_set : LabelSet
        The classes, for colours and names.
    least : int
        Number of cells below which a share isn't drawn: it would be chance.

    Raises
    ------
    ArgumentError
        When there are other bands than counts.
    """
    seen, labelled = (counts.cells[COUNTED.index(name)] for name in ("seen", "labelled"))
    if len(edges) != len(seen) + 1:
        raise ArgumentError("edges", f"{len(seen) + 1} distances", f"{len(edges)}")
    figure, axes = plt.subplots(1, len(CHARTED), figsize=(11, 4.2), sharex=True, sharey=True, layout="constrained")
    for ax, (share, title) in zip(axes, CHARTED.items(), strict=True):
        enough = (labelled if share == "wrong" else seen) >= least
        _class_lines(ax, np.where(enough, counts.shares()[share], np.nan), edges, label_set)
        ax.set(title=title, xlabel="distance from the LIDAR [m]", ylim=(0, 100))
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("share of cells [%]")
    handles = {text: line for ax in axes for line, text in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside right upper", fontsize="small")
    return figure


def _class_lines(ax: Axes, shares: NDArray, edges: Sequence[float], label_set: LabelSet) -> None:
    """Draw one line per class that has any share, (B, n_semantic), at the middle of each band."""
    middles = (np.array(edges[:-1]) + np.array(edges[1:])) / 2
    for c in np.flatnonzero(np.isfinite(shares).any(axis=0)):
        colour = np.array(label_set.rgb[c]) / 255
        style = {"color": colour, "marker": _MARKERS[c % len(_MARKERS)], "markeredgecolor": "0.2", "linewidth": 1.5}
        ax.plot(middles, 100 * shares[:, c], label=label_set.names[c], **style)


def policy_errors(result: Mapping, shares: Sequence[str] = ("mistaken", "missed", "wrong")) -> Figure:
    """Draw the errors of every policy of the laboratory as bars, over all classes and distances.

    Parameters
    ----------
    result : mapping
        From `truth_policies`, or from its JSON file.
    shares : sequence of str
        Which shares of `TruthCounts.shares` to draw, one panel each.
    """
    names, drives = list(result["sums"]), result["drives"].values()
    counts = TruthCounts(np.moveaxis([[drive[name] for name in names] for drive in drives], -1, 0))
    of_drives, whole = counts.shares(), counts.shares(axis=0)  # one row per drive; all drives together
    size = (4 + 2.6 * len(shares), 1.2 + 0.27 * len(names))
    figure, axes = plt.subplots(1, len(shares), figsize=size, sharey=True, layout="constrained", squeeze=False)
    for ax, share in zip(axes[0], shares, strict=True):
        low, high = np.nanquantile(of_drives[share], [0.25, 0.75], axis=0)
        ax.barh(names, 100 * whole[share], color="#8fa8c8", edgecolor="0.3", linewidth=0.5)
        ax.hlines(names, 100 * low, 100 * high, color="0.15", linewidth=1)
        ax.set(title=CHARTED.get(share, share), xlabel="share of cells [%]", xlim=(0, None))
        ax.grid(axis="x", alpha=0.3)
    axes[0, 0].invert_yaxis()
    text = f"bars: {len(drives)} drives together; lines: first to third quartile of single drives"
    figure.suptitle(text, fontsize="medium")
    return figure

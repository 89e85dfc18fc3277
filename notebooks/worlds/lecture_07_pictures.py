"""Pictures of lecture 07: posts in three ways, networks over several seeds, a sign, and what pretraining brings."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu import plotting
from semgrid_edu.datasets.frames import resize_labels
from semgrid_edu.frame import Frame, resize_image
from semgrid_edu.labels import IGNORE, KITTI_14
from semgrid_edu.plotting.images import draw_image
from worlds import lecture_07_pretrained as pretrained
from worlds.lecture_07_thin_pole import Way, apply_mechanism

SIZE = (96, 320)
"""Height and width of the images that the compact networks see."""

SIGNAGE = KITTI_14.index("signage")
"""The class of signs and poles."""

PEDESTRIAN = KITTI_14.index("pedestrian")
"""The class that the networks see too often."""

SIGN = (slice(10, 82), slice(196, 236))
"""Rows and columns of a sign and a lamp post in frame 14 of the drive."""


def small_frames(drive: Sequence[Frame], numbers: Iterable[int]) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return images (N, 96, 320, 3) and labels (N, 96, 320) of some frames.

    Parameters
    ----------
    drive : sequence of Frame
        A drive whose frames have labels.
    numbers : iterable of int
        Numbers of the frames.
    """
    frames = [drive[k] for k in numbers]
    labels = [resize_labels(frame.labels.image, SIZE) for frame in frames]
    return np.stack([resize_image(frame.image, SIZE) for frame in frames]), np.stack(labels)


def class_of_each_row(truths: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the most frequent class of each row of the images, (h,).

    Parameters
    ----------
    truths : (N, h, w) uint8
        Classes; 255 isn't counted.
    """
    rows = np.moveaxis(truths, 1, 0).reshape(truths.shape[1], -1)
    return np.array([np.bincount(row[row != IGNORE], minlength=1).argmax() for row in rows], np.uint8)


def widths_across(there: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return for each pixel that is there how many such pixels stand side by side in its row, and 0 elsewhere.

    Parameters
    ----------
    there : (..., w) bool
        Where something is.

    Examples
    --------
    >>> widths_across(np.array([[True, False, True, True]]))
    array([[1, 0, 2, 2]])
    """
    widths = np.zeros(there.shape, np.int64)
    for row, found in zip(there.reshape(-1, there.shape[-1]), widths.reshape(-1, there.shape[-1]), strict=True):
        ends = np.flatnonzero(np.diff(row, prepend=False, append=False))
        for start, end in zip(ends[::2], ends[1::2], strict=True):
            found[start:end] = end - start
    return widths


def draw_ways(posts: Mapping[int, int]) -> Figure:
    """Draw what indices, skips and atrous kernels make of bright posts.

    Parameters
    ----------
    posts : dict of int to int
        Each post's first column, and how many it has.
    """
    picture = np.zeros((16, 32))
    for column, width in posts.items():
        picture[2:14, column : column + width] = 1
    fig, axes = plt.subplots(2, 4, figsize=(9.2, 2.9), layout="constrained", sharex=True, height_ratios=(1, 0.8))
    ways = {
        "A: indices": "indices",
        "B: skips, finest 1/2": "half skips",
        "C: skips, finest 1/1": "skips",
        "D: atrous": "atrous",
    }
    for (above, below), (title, way) in zip(axes.T, ways.items(), strict=True):
        shown = apply_mechanism(picture, way)
        above.imshow(shown, cmap="magma", vmin=0, vmax=1)
        above.set_title(title, fontsize=10)
        above.set(yticks=[])
        below.stairs(shown.max(axis=0), np.arange(33) - 0.5, fill=True, color="0.3")
        for column, width in posts.items():
            below.axvspan(column - 0.5, column + width - 0.5, color="tab:orange", alpha=0.4, linewidth=0)
        below.set(ylim=(0, 1.05), xlabel="column", yticks=[0, 0.5, 1] if below is axes[1, 0] else [])
    axes[1, 0].set_ylabel("maximum\nof column")
    return fig


def draw_reached(reached: Mapping[Way, tuple[int, ...]], short: Mapping[Way, tuple[int, ...]], alone: float) -> Figure:
    """Draw each way's overlap: a bar for the mean, a dot for each seed, a diamond for the mean after a short training.

    Parameters
    ----------
    reached, short : dict of Way to tuple of int
        Overlaps by seed, per cent, after a long and a short training.
    alone : float
        What a single convolution reaches, per cent.
    """
    fig, ax = plt.subplots(figsize=(8.8, 3.5), layout="constrained")
    colours, hatches = {"pooling": "#9ecae1", "strides": "#fdae6b", "atrous": "#d9d9d9"}, {"strides": "//"}
    for k, (way, overlaps) in enumerate(reached.items()):
        mean = np.mean(overlaps)
        ax.bar(k, mean, color=colours[way.down], hatch=hatches.get(way.down), edgecolor="0.3", width=0.7)
        ax.plot(np.full(len(overlaps), k), overlaps, "o", color="black", markersize=3,
                label="five networks" if k == 0 else None)  # fmt: skip
        ax.plot(k, np.mean(short[way]), "D", color="white", markeredgecolor="black", markersize=6,
                label="mean after a quarter of the steps" if k == 0 else None)  # fmt: skip
        ax.text(
            k, 3, f"{mean:.0f}", ha="center", fontsize=10, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1}
        )
    for k in (1.5, 3.5, 5.5):  # between the pairs that differ in pooling and strides alone
        ax.axvline(k, color="0.7", linewidth=0.8)
    ax.axhline(alone, color="tab:red", linestyle="--", linewidth=1.2, label="a single convolution")
    ax.set_xticks(range(len(reached)), [f"{way.down}\n{way.up}" for way in reached], fontsize=9)
    ax.set(ylabel="overlap (IoU) [%]", ylim=(0, 103))
    fig.legend(loc="outside upper center", ncols=3, fontsize=9)
    return fig


def draw_signs(image: NDArray[np.uint8], truth: NDArray[np.uint8], classes: Mapping[str, NDArray[np.uint8]]) -> Figure:
    """Draw a sign and a lamp post, and what networks call them, with the outlines of the true classes.

    Parameters
    ----------
    image : (h, w, 3) uint8
        The image of frame 14.
    truth : (h, w) uint8
        Its labels.
    classes : dict of str to (h, w) uint8
        Each network's classes, by its name; at most three.
    """
    pictures = {"image": image[SIGN]} | {name: KITTI_14.colours(called[SIGN]) for name, called in classes.items()}
    fig, axes = plt.subplots(1, len(pictures), figsize=(1.9 * len(pictures), 4.4), layout="constrained")
    for ax, letter, (name, picture) in zip(axes, "ABCD"[: len(pictures)], pictures.items(), strict=True):
        draw_image(picture, ax=ax).set_title(f"{letter}: {name}", fontsize=10)
        for outlined, style in ((SIGNAGE, "solid"), (PEDESTRIAN, "dashed")):
            there = (truth[SIGN] == outlined).astype(float)
            ax.contour(there, levels=[0.5], colors="white", linewidths=2.4)
            ax.contour(there, levels=[0.5], colors="black", linewidths=1.2, linestyles=style)
    plotting.class_legend(axes[0], KITTI_14, np.stack([called[SIGN] for called in classes.values()]))
    legend = axes[0].get_legend()
    names = [text.get_text() for text in legend.get_texts()]
    legend.remove()
    fig.legend(legend.legend_handles, names, loc="outside lower center", ncols=len(pictures) + 1, fontsize=9)
    return fig


def draw_pretrained() -> Figure:
    """Draw pixel accuracy by what the encoder starts from, on other cameras and on the images it learned from."""
    fig, ax = plt.subplots(figsize=(6.8, 3.3), layout="constrained")
    for k, (colour, hatch, reached) in enumerate(
        zip(("#9ecae1", "#d9d9d9", "#fdae6b"), ("", "..", "//"), pretrained.REACHED.values(), strict=True)
    ):
        ax.bar(k, reached.others, color=colour, hatch=hatch, edgecolor="0.3", width=0.6)
        ends = [[reached.others - reached.low], [reached.high - reached.others]]
        ax.errorbar(k, reached.others, ends, color="black", capsize=6, linewidth=1.5,
                    label="other cameras, 95 % interval\nover six cameras" if k == 0 else None)  # fmt: skip
        ax.plot(k, reached.own, "D", color="white", markeredgecolor="black", markersize=8,
                label="the images learned from" if k == 0 else None)  # fmt: skip
        ax.text(k, 3, f"{reached.others}", ha="center", fontsize=10,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
        ax.text(k + 0.1, reached.own + 2, f"{reached.own}", fontsize=10)
    ax.axhline(pretrained.ROWS, color="tab:red", linestyle="--", linewidth=1.2, label="class of each row, no image")
    ax.set_xticks(range(3), pretrained.REACHED)
    ax.set(ylim=(0, 100), ylabel="pixel accuracy [%]")
    fig.legend(loc="outside right upper", fontsize=9)
    return fig


def draw_moves(image: NDArray[np.uint8], labels: NDArray[np.uint8], along: NDArray[np.bool_], columns: slice) -> Figure:
    """Draw a photograph, its labels, and in black those that don't move along.

    Parameters
    ----------
    image : (h, w, 3) uint8
        The photograph.
    labels : (h, n) uint8
        Labels of a wider strip.
    along : (h, n) bool
        Where the label moves along.
    columns : slice
        The strip's columns that show the photograph.
    """
    fig, axes = plt.subplots(3, 1, figsize=(6.4, 6.3), layout="constrained")
    draw_image(image, ax=axes[0]).set_title("A: the image", fontsize=10)
    draw_image(KITTI_14.colours(labels[:, columns]), ax=axes[1]).set_title("B: SegNet's labels", fontsize=10)
    draw_image(along[:, columns], ax=axes[2], cmap="gray", vmin=0, vmax=1)
    axes[2].set_title("C: labels that don't move along (black)", fontsize=10)
    plotting.class_legend(axes[1], KITTI_14, labels[:, columns])
    return fig

"""Pictures of lecture 07: a post in three ways, networks over several seeds, a sign, and what pretraining brings."""

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


def draw_ways(column: int, width: int) -> Figure:
    """Draw a bright post, and what indices, skips and atrous kernels make of it.

    Parameters
    ----------
    column, width : int
        The post's first column, and how many it has.
    """
    post = np.zeros((16, 24))
    post[2:14, column : column + width] = 1
    fig, axes = plt.subplots(2, 4, figsize=(8.4, 3.2), layout="constrained", sharex=True, height_ratios=(1, 0.8))
    ways = {"A: the post": None, "B: indices": "indices", "C: skips": "skips", "D: atrous": "atrous"}
    for (above, below), (title, way) in zip(axes.T, ways.items(), strict=True):
        picture = post if way is None else apply_mechanism(post, way)
        above.imshow(picture, cmap="magma", vmin=0, vmax=1)
        above.set_title(title, fontsize=10)
        above.set(yticks=[])
        below.bar(range(24), picture.max(axis=0), width=1, color="0.3")
        below.axvspan(column - 0.5, column + width - 0.5, color="tab:orange", alpha=0.4, linewidth=0)
        below.set(ylim=(0, 1.05), xlabel="column", yticks=[0, 0.5, 1] if below is axes[1, 0] else [])
    axes[1, 0].set_ylabel("brightness")
    return fig


def draw_reached(reached: Mapping[Way, tuple[int, ...]], one_layer: float) -> Figure:
    """Draw the overlap of each way's networks: a bar for the mean, a dot for each seed.

    Parameters
    ----------
    reached : dict of Way to tuple of int
        Overlaps by seed, per cent.
    one_layer : float
        What a single convolution reaches, per cent.
    """
    fig, ax = plt.subplots(figsize=(8.4, 3.3), layout="constrained")
    colours, hatches = {"pooling": "#9ecae1", "strides": "#fdae6b", "atrous": "#d9d9d9"}, {"strides": "//"}
    for k, (way, overlaps) in enumerate(reached.items()):
        mean = np.mean(overlaps)
        ax.bar(k, mean, color=colours[way.down], hatch=hatches.get(way.down), edgecolor="0.3", width=0.7)
        ax.plot(np.full(len(overlaps), k), overlaps, "o", color="black", markersize=3)
        ax.text(
            k, 3, f"{mean:.0f}", ha="center", fontsize=10, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1}
        )
    ax.axhline(one_layer, color="tab:red", linestyle="--", linewidth=1.2)
    ax.text(-0.48, one_layer - 8, "one convolution", ha="left", fontsize=9, color="tab:red",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
    ax.set_xticks(range(len(reached)), [f"{way.down}\n{way.up}" for way in reached], fontsize=9)
    ax.set(ylabel="overlap (IoU) [%]", ylim=(0, 100))
    return fig


def draw_signs(truth: NDArray[np.uint8], classes: Mapping[str, NDArray[np.uint8]]) -> Figure:
    """Draw the true labels of sign and lamp post beside what three networks call them.

    Parameters
    ----------
    truth : (h, w) uint8
        The labels of frame 14.
    classes : dict of str to (h, w) uint8
        Each network's classes, by its name.
    """
    pictures = {"truth": truth, **classes}
    fig, axes = plt.subplots(1, 4, figsize=(7.6, 4.4), layout="constrained")
    for ax, letter, (name, picture) in zip(axes, "ABCD", pictures.items(), strict=True):
        draw_image(KITTI_14.colours(picture[SIGN]), ax=ax).set_title(f"{letter}: {name}", fontsize=10)
    plotting.class_legend(axes[0], KITTI_14, np.stack([picture[SIGN] for picture in pictures.values()]))
    legend = axes[0].get_legend()
    names = [text.get_text() for text in legend.get_texts()]
    legend.remove()
    fig.legend(legend.legend_handles, names, loc="outside lower center", ncols=5, fontsize=9)
    return fig


def draw_pretrained() -> Figure:
    """Draw pixel accuracy by what the encoder starts from, for maps as they are and for normalised maps."""
    fig, axes = plt.subplots(1, 2, figsize=(8.2, 3.3), layout="constrained", sharey=True)
    names, colours = ("ImageNet", "ImageNet,\nshuffled", "fresh"), ("#9ecae1", "#d9d9d9", "#fdae6b")
    panels = {"A: maps as they are": pretrained.AS_IT_IS, "B: each map normalised": pretrained.NORMALISED}
    for ax, (title, reached) in zip(axes, panels.items(), strict=True):
        bars = ax.bar(names, reached, color=colours, hatch=("", "..", "//"), edgecolor="0.3", width=0.6)
        ax.bar_label(bars, fmt="%.0f", fontsize=10)
        ax.axhline(pretrained.ROWS, color="tab:red", linestyle="--", linewidth=1.2)
        ax.set_title(title, fontsize=10)
        ax.set(ylim=(0, 100))
    axes[0].text(-0.40, pretrained.ROWS - 7, "class of each row", fontsize=9, color="tab:red",
                 bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
    axes[0].set_ylabel("pixel accuracy on other cameras [%]")
    return fig

"""The story of one cell as a figure: its image column, states, parts of the score, and neighbours (paper, Fig. 2)."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_edu.plotting.colours import STATE_COLOURS, STATE_NAMES, colour_legend
from semgrid_edu.plotting.images import draw_image
from semgrid_edu.workshop.demo.stories import CellStory

FOR, AGAINST = "#6a1b9a", "#d9902f"
"""Colours of parts that raise the score of a class and of those that lower it."""


def draw_cell_story(story: CellStory, image: NDArray) -> Figure:
    """Draw the story of one cell.

    At the top is the image with the points of the planes above the cell. Below, from left to right: the four states
    after each step of the filter and over the last frames, the parts of the score by kind, by class and by plane, and
    the distribution before and after the CRF.

    Parameters
    ----------
    story : CellStory
        The story, from `cell_story`.
    image : (h, w, 3) uint8
        The frame's image, RGB.

    Returns
    -------
    Figure
        A new figure.
    """
    figure = plt.figure(figsize=(12, 8.4), layout="constrained")
    top, below = figure.subfigures(2, 1, height_ratios=[3, 5])
    _draw_column(story, image, top.subplots())
    panels = below.subplot_mosaic([["steps", "parts", "planes", "crf"], ["past", "classes", "planes", "crf"]])
    _draw_states(story, panels["steps"], panels["past"])
    _draw_parts(story, panels["parts"], panels["classes"], panels["planes"])
    _draw_crf(story, panels["crf"])
    x, y = story.xy
    truth = "unknown" if story.truth is None else story.names[story.truth]
    figure.suptitle(
        f"Cell {story.cell}, {x:.2f} m ahead, {abs(y):.2f} m to the {'right' if y < 0 else 'left'}: "
        f"{story.names[story.refined]} (truth: {truth}). This scan: {story.scan.verdict}"
    )
    return figure


def _draw_column(story: CellStory, image: NDArray, ax: Axes) -> None:
    """Mark the points of eq. (1) on the image; the lowest one is filled."""
    draw_image(image, ax)
    seen = story.pixels[story.visible]
    ax.scatter(*seen.T, s=14, facecolor="white", edgecolor="#d81b60", linewidth=1)
    ax.scatter(*seen[:1].T, s=30, color="#d81b60")
    ax.set_title("the planes' points above the cell, eq. (1)", loc="left", fontsize="medium")


def _draw_states(story: CellStory, steps: Axes, past: Axes) -> None:
    """Draw the four states as stacked bars: one bar per step, and one per frame."""
    _stack(steps, list(story.steps), np.stack(list(story.steps.values()), axis=1))
    _stack(past, [f"{time:.1f} s" for time in story.times], story.history)
    steps.set_title("states, step by step", loc="left", fontsize="medium")
    past.set_title("states of the place, scan by scan", loc="left", fontsize="medium")
    for ax in (steps, past):
        ax.set_xlabel("probability", fontsize="small")
    colour_legend(
        past, STATE_NAMES, STATE_COLOURS, loc="upper center", bbox_to_anchor=(0.5, -0.28), ncols=4, columnspacing=0.8
    )


def _stack(ax: Axes, names: Sequence[str], states: NDArray) -> None:
    left = np.zeros(len(names))
    for values, colour in zip(states, STATE_COLOURS, strict=True):
        ax.barh(range(len(names)), values, left=left, color=np.divide(colour, 255), edgecolor="0.5", linewidth=0.4)
        left = left + values
    ax.set_yticks(range(len(names)), names, fontsize="small")
    ax.set(xlim=(0, 1), ylim=(len(names) - 0.5, -0.5))


def _draw_parts(story: CellStory, kinds: Axes, classes: Axes, planes: Axes) -> None:
    """Draw why the cell got its class and not the rival."""
    why = story.why
    sums = [why.planes.sum(), why.occupancy.sum(), why.rest, why.score]
    _bars(kinds, ["image", "occupancy", "constants", "sum"], sums)
    largest = np.argsort(-np.abs(why.classes), kind="stable")[:6]
    _bars(classes, [story.names[c] for c in largest], why.classes[largest])
    _bars(planes, [f"{height:.1f} m" for height in story.heights[::-1]], why.planes[::-1])
    kinds.set_title(
        f"why {story.names[story.label]}\nand not {story.names[story.rival]}", loc="left", fontsize="medium"
    )
    classes.set_title("image, by class", loc="left", fontsize="medium")
    planes.set_title("image, by plane", loc="left", fontsize="medium")
    for ax in (kinds, classes, planes):
        ax.set_xlabel("part of the difference of scores", fontsize="small")


def _bars(ax: Axes, names: Sequence[str], values: Sequence[float]) -> None:
    ax.barh(range(len(names)), values, color=[FOR if value >= 0 else AGAINST for value in values])
    ax.axvline(0, color="0.4", linewidth=0.8)
    ax.set_yticks(range(len(names)), names, fontsize="small")
    ax.set_ylim(len(names) - 0.5, -0.5)


def _draw_crf(story: CellStory, ax: Axes) -> None:
    """Draw the probabilities of the classes that matter before and after the CRF, and what the neighbours add."""
    classes = np.argsort(-np.maximum(story.before, story.after), kind="stable")[:4]
    names = [f"{story.names[c]}\n(neighbours {story.messages[c]:+.1f})" for c in classes]
    ax.barh(np.arange(len(classes)) - 0.2, story.before[classes], 0.38, color="0.7", label="before")
    ax.barh(np.arange(len(classes)) + 0.2, story.after[classes], 0.38, color=FOR, label="after")
    ax.set_yticks(range(len(classes)), names, fontsize="small")
    ax.set(xlim=(0, 1), ylim=(len(classes) - 0.5, -0.5), xlabel="probability")
    ax.set_title("the CRF", loc="left", fontsize="medium")
    ax.legend(fontsize="small", frameon=False, loc="lower right")

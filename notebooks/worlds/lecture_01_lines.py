"""Figures of beliefs: bars on a line or a ring of cells, and over time (filtering by Bayes' rule, section 3.2)."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from semgrid_edu.plotting.colours import STATE_COLOURS, STATE_NAMES, colour_legend

TOP = 1.25
"""Upper end of an axis as a multiple of its largest number, so that there is room for the number itself."""

MAX_NUMBERS = 12
"""Largest number of cells with printed numbers: longer lines have no room for them."""


def probability_lines(
    lines: Mapping[str, NDArray], names: Sequence[str] | None = None, marked: Sequence[int] = ()
) -> Figure:
    """Draw several lines of cells below each other on one scale, such as prior, likelihood and posterior.

    Parameters
    ----------
    lines : mapping of str to (N,) float
        The numbers of each line, 0..1, by its title, from top to bottom.
    names : sequence of str, optional
        Names of the N cells; 0, 1, ... when left out.
    marked : sequence of int, optional
        Cells with a triangle below every line, and a darker bar, such as those with a pole.
    """
    size = (6, 0.5 + 1.3 * len(lines))
    top = TOP * (max(np.max(values, initial=0) for values in lines.values()) or 1)
    figure, axes = plt.subplots(len(lines), 1, figsize=size, sharex=True, layout="constrained", squeeze=False)
    for ax, (title, values) in zip(axes[:, 0], lines.items(), strict=True):
        _line(np.asarray(values), ax, title, names, marked)
        ax.set_ylim(0, top)
        ax.label_outer()
    return figure


def _line(values: NDArray, ax: Axes, title: str, names: Sequence[str] | None, marked: Sequence[int]) -> None:
    """Draw one number per cell, as bars from left to right."""
    colours = ["0.3" if cell in marked else "0.65" for cell in range(len(values))]
    bars = ax.bar(range(len(values)), values, width=0.8, color=colours)
    if len(values) <= MAX_NUMBERS:
        ax.bar_label(bars, [f"{value:.2f}" for value in values], fontsize="small")
    if len(marked):
        below = np.full(len(marked), -0.12)
        ax.plot(marked, below, "k^", markersize=7, transform=ax.get_xaxis_transform(), clip_on=False)
        ax.tick_params(axis="x", pad=11)
    ax.set_xticks(range(len(values)), [str(cell) for cell in range(len(values))] if names is None else names)
    ax.set_title(title, loc="left", fontsize="medium")
    ax.set(xlim=(-0.6, len(values) - 0.4), xlabel="cell" if names is None else "", ylabel="probability")


def places_on_ring(n_cells: int = 10) -> NDArray[np.float64]:
    """Return x and y of the cells of a ring road of radius 1, clockwise from the top, (N, 2)."""
    angles = 2 * np.pi * np.arange(n_cells) / n_cells
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


def ring_road(poles: Sequence[int]) -> tuple[list[Line2D], Line2D, Text]:
    """Draw a ring road of ten cells with a pair of poles, A, and a single one, B; the rest is empty.

    Returns
    -------
    bars : list of Line2D
        One for each cell; a bar from radius 1 to 1 + b has the length of the probability b.
    vehicle : Line2D
        A circle that fits round the number of a cell, at 0.84 of the radius.
    title : Text
        The title.
    """
    around = places_on_ring()
    ax = plt.subplots(figsize=(4.2, 4.0), layout="constrained")[1]
    for radius, style in ((1, "-"), (1.5, ":")):
        ax.add_patch(plt.Circle((0, 0), radius, fill=False, color="0.6", linestyle=style, zorder=0))
    ax.text(0, 1.52, "probability 1/2", ha="center", va="bottom", fontsize=9, color="0.3")
    bars = [ax.plot([], [], color="#0072b2", linewidth=16, solid_capstyle="butt")[0] for _ in around]
    for cell, (x, y) in enumerate(0.84 * around):
        ax.text(x, y, cell, ha="center", va="center", fontsize=11)
    (poles_drawn,) = ax.plot(*(0.58 * around[list(poles)].T), "k^", markersize=10)
    for letter, (x, y) in {"A": (0.32, 0.0), "B": (-0.32, -0.18)}.items():
        ax.text(x, y, letter, fontsize=14, fontweight="bold", ha="center", va="center")
    (vehicle,) = ax.plot([], [], "o", ms=20, mfc="none", color="#d55e00", mew=3)
    (key,) = ax.plot([], [], "o", ms=9, mfc="none", color="#d55e00", mew=2)
    (bar,) = ax.plot([], [], color="#0072b2", linewidth=8, solid_capstyle="butt")
    ax.legend([poles_drawn, key, bar], ["pole", "vehicle", "belief"], loc="lower left", fontsize=9, frameon=False)
    ax.set(xlim=(-1.85, 1.85), ylim=(-1.75, 1.75), aspect="equal")
    ax.set_axis_off()
    return bars, vehicle, ax.set_title(" ", fontsize=11)


def belief_history(belief: NDArray, ax: Axes | None = None, truth: NDArray | None = None) -> Axes:
    """Draw a belief over a line of cells, step by step: one column per step, darker where more probable.

    Parameters
    ----------
    belief : (T, N) float
        The belief at each step, one row per step; each row sums to 1.
    ax : Axes, optional
        Axes to draw into; a new figure with a colour bar when left out.
    truth : (T,) int, optional
        The true cell at each step: a circle where it is the likeliest, a cross where another one is.
    """
    if ax is None:
        ax = plt.subplots(figsize=(6, 2.6), layout="constrained")[1]
        ax.figure.colorbar(plt.cm.ScalarMappable(cmap="Blues"), ax=ax, label="probability")
    ax.imshow(np.transpose(belief), cmap="Blues", vmin=0, vmax=1, origin="lower", aspect="auto")
    if truth is not None:
        right = np.argmax(belief, axis=1) == truth
        for chosen, mark, name in (
            (right, "o", "vehicle, best guess right"),
            (~right, "x", "vehicle, best guess wrong"),
        ):
            where = np.flatnonzero(chosen)
            ax.plot(where, truth[where], mark, ms=5, mew=1.5, mfc="none", color="#d55e00", label=name)
    ax.set(xlabel="step", ylabel="cell")
    return ax


def state_history(times: NDArray, probability: NDArray, ax: Axes | None = None) -> Axes:
    """Draw the states of one cell over time as bands, each as high as its probability.

    Parameters
    ----------
    times : (T,) float
        Times of the steps, seconds, ascending, at least two.
    probability : (4, T) float
        Probabilities of FREE, STATIC, DYNAMIC and UNKNOWN, which sum to 1 at each time.
    ax : Axes, optional
        Axes to draw into.
    """
    ax = ax or plt.subplots(figsize=(6, 2.2), layout="constrained")[1]
    ax.stackplot(times, probability, colors=np.divide(STATE_COLOURS, 255), edgecolor="0.4", linewidth=0.5)
    ax.set(xlabel="time [s]", ylabel="probability", ylim=(0, 1), xlim=(times[0], times[-1]))
    return colour_legend(ax, STATE_NAMES, STATE_COLOURS)

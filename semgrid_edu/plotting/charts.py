"""Charts: confusion matrix (Table 3) and training loss (section 4.1)."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from semgrid_edu.errors import ArgumentError

SMOOTHING = 50
"""Window of the running mean, steps; a shorter stage uses all its steps."""


def confusion(matrix: NDArray, names: Sequence[str], ax: Axes | None = None) -> Axes:
    """Draw a confusion matrix like the paper's Table 3: rows are truth, columns prediction, in per cent of the row.

    Parameters
    ----------
    matrix : (n, n) int
        How often each true class (row) is predicted as each class (column); a class that never occurs has an empty row.
    names : sequence of str
        Names of the n classes.
    ax : Axes, optional
        Axes to draw into.

    Raises
    ------
    ArgumentError
        When the matrix doesn't have one row and one column per name.
    """
    if np.shape(matrix) != (len(names), len(names)):
        raise ArgumentError("matrix", f"shape {(len(names),) * 2}, one row per name", f"shape {np.shape(matrix)}")
    side = 2.2 + 0.42 * len(names)
    ax = ax or plt.subplots(figsize=(side, side), layout="constrained")[1]
    totals = np.sum(matrix, axis=1, keepdims=True)
    percent = np.divide(100.0 * np.asarray(matrix), totals, where=totals > 0, out=np.full(np.shape(matrix), np.nan))
    ax.imshow(percent, cmap="Blues", vmin=0, vmax=100)
    for (row, column), value in np.ndenumerate(percent):
        if value >= 0.5:
            colour = "white" if value > 55 else "black"
            ax.text(column, row, f"{value:.0f}", ha="center", va="center", color=colour, fontsize="small")
    ax.set_xticks(range(len(names)), names, rotation=50, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(names)), names)
    ax.set(xlabel="predicted", ylabel="truth [% of its row]")
    return ax


def training_curves(logs: Mapping[str, np.recarray]) -> Axes:
    """Draw the loss of training runs over steps: one point per step, and a line for the running mean.

    The losses of the two stages aren't comparable, one is over pixels and one over cells, so the line breaks between
    them. The learning rate, a half cosine in each stage, isn't drawn.

    Parameters
    ----------
    logs : mapping of str to recarray
        Logs from `read_log`, by their names in the legend.

    Raises
    ------
    ArgumentError
        When there is no training run, or a run has no step with a finite loss.
    """
    if not logs or not all(len(log.loss) for log in logs.values()):
        raise ArgumentError("logs", "at least one training run, each with at least one step", list(logs) or "none")
    for name, log in logs.items():
        if not np.any(np.isfinite(log.loss) & (log.loss > 0)):
            raise ArgumentError("logs", "a finite loss in each training run", f"none in {name}")
    ax = plt.subplots(figsize=(8, 4), layout="constrained")[1]
    for number, (name, log) in enumerate(logs.items()):
        _curve(ax, log, name, f"C{number}")
    for stage, begin in _stages(next(iter(logs.values()))):
        ax.annotate(f"{stage} stage", (begin, 0), (4, 4), ("data", "axes fraction"), "offset points", color="0.3")
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:e}"[0] in "2346" else "")
    ax.set_title(f"points: single steps; lines: running means of {SMOOTHING} steps", loc="left", fontsize="medium")
    ax.set(xlabel="step", ylabel="loss: weighted cross-entropy [nats]")
    ax.grid(alpha=0.3)
    ax.legend(loc="upper right")
    return ax


def _curve(ax: Axes, log: np.recarray, name: str, colour: str) -> None:
    """Draw one training run by stage, with a dotted line at the start of each stage."""
    ax.scatter(log.iteration, log.loss, s=3, color=colour, alpha=0.2, linewidth=0)
    for stage, begin in _stages(log):
        here = log.stage == stage
        smooth = uniform_filter1d(log.loss[here], min(SMOOTHING, here.sum()), mode="reflect")
        ax.plot(log.iteration[here], smooth, color=colour, linewidth=1.2, label=name if stage == log.stage[0] else None)
        ax.axvline(begin, color="0.5", linewidth=0.8, linestyle=":")


def _stages(log: np.recarray) -> list[tuple[str, int]]:
    """Return the stages of a training run and the first step of each."""
    return [(stage, log.iteration[log.stage == stage][0]) for stage in dict.fromkeys(log.stage.tolist())]

"""Forest plots: one row per method, with its mean, its confidence interval, and every seed (section 4.2)."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from semgrid_edu.errors import ArgumentError
from semgrid_edu.experiments.score_rows import ScoreRow

_SEED_DROP = 0.24
"""How far the seeds lie below the interval, rows."""


def forest_plot(
    rows: Sequence[ScoreRow],
    ax: Axes | None = None,
    label: str = "score [%]",
    scale: float = 100.0,
    reference: float | None = None,
) -> Axes:
    """Draw means with their confidence intervals, and below each the value of every seed.

    Parameters
    ----------
    rows : sequence of ScoreRow
        From `score_row` or `gain_row`, from top to bottom.
    ax : Axes, optional
        Axes to draw into.
    label : str
        Label of the x axis, with the unit.
    scale : float
        Factor of all numbers; 100 turns shares into per cent, and differences of shares into points.
    reference : float, optional
        Where to draw a vertical line, in the unit of the rows: 0 for differences.

    Returns
    -------
    Axes

    Raises
    ------
    ArgumentError
        When there is no row.

    Examples
    --------
    >>> rows = [score_row(name, matrices, pixel_accuracy) for name, matrices in methods.items()]  # doctest: +SKIP
    >>> forest_plot(rows, label="pixel accuracy [%]")                                             # doctest: +SKIP
    """
    if not rows:
        raise ArgumentError("rows", "one or more", "none")
    if ax is None:
        _, ax = plt.subplots(figsize=(8, 1.2 + 0.5 * len(rows)), layout="constrained")
    if reference is not None:
        ax.axvline(scale * reference, color="0.5", linewidth=1, linestyle="--", zorder=0)
    for number, row in enumerate(rows):
        _draw_row(ax, number, row, scale)
    ax.set_yticks(range(len(rows)), [row.name for row in rows])
    ax.set(xlabel=label, ylim=(len(rows) - 0.4, -0.6))
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x", alpha=0.3)
    ax.spines[["left", "right", "top"]].set_visible(False)
    once = {text: drawn for drawn, text in zip(*ax.get_legend_handles_labels(), strict=True)}
    ax.legend(once.values(), once, loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False, fontsize="small")
    return ax


def _draw_row(ax: Axes, number: int, row: ScoreRow, scale: float) -> None:
    """Draw interval and mean, the numbers beside the axes, and the seeds if there are two or more."""
    low, mean, high = (scale * value for value in row.interval)
    ax.plot([low, high], [number, number], color="#1f4e79", linewidth=2.5, label="confidence interval")
    ax.plot(mean, number, "D", color="#1f4e79", markersize=6, label="mean")
    if len(row.seeds) > 1:
        seeds, places = [scale * value for value in row.seeds], [number + _SEED_DROP] * len(row.seeds)
        ax.plot(seeds, places, "o", color="#d95f02", markerfacecolor="none", markersize=5, label="one seed")
    text = f"{mean:.1f} ({low:.1f} to {high:.1f})"
    ax.annotate(text, (1.02, number), xycoords=("axes fraction", "data"), va="center", fontsize="small")

"""Claims of the paper as forest plots that show each statement's limit and the claimed side (section 4)."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETLEFTBASE, CARETRIGHTBASE

from worlds.lecture_12_pictures import draw_score, legend_entries

MARKS = {True: "yes", False: "no", None: "?"}
"""What is written beside a statement: its interval confirms it, Holm's method rejects it, or neither."""

LABELS = {"lidar": "LIDAR", "true": "true"}
"""The labels that a network learned from or is judged by."""


def judged(reading: dict) -> list[dict]:
    """Return the statements of a claim that count for its verdict.

    Parameters
    ----------
    reading : dict
        One of a claim's "readings" in claims.json.
    """
    return [statement for statement in reading["statements"] if statement["judged"]]


def draw_statements(ax: Axes, statements: Sequence[dict]) -> None:
    """Draw statements line by line, each with its interval, its limit, and a mark: yes, no or ?.

    The limit is a short black line with an arrow to the claimed side.

    Parameters
    ----------
    ax : Axes
        The chart, per cent or points.
    statements : sequence of dict
        Statements from claims.json.
    """
    for place, one in enumerate(statements):
        draw_score(ax, place, one["value"])
        limit = 100 * one["limit"]
        ax.plot([limit, limit], [place - 0.42, place + 0.42], color="black", linewidth=1.2, label="limit")
        side = CARETRIGHTBASE if one["above"] else CARETLEFTBASE
        ax.plot(limit, place - 0.34, color="black", marker=side, markersize=6, linestyle="", label="claimed side")
        edge = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 9}
        ax.annotate(MARKS[one["holds"]], (1.02, place), **edge)
    names = [in_words(one["what"]) for one in statements]
    ax.set_yticks(range(len(names)), names, fontsize=9)
    ax.set_ylim(len(names) - 0.4, -0.7)
    ax.grid(axis="x", alpha=0.3)


def in_words(what: str) -> str:
    """Return a statement's text, plain and short.

    Parameters
    ----------
    what : str
        As in claims.json.
    """
    return what.replace(" called right", "").replace(" - ", " minus ")


def claim_picture(readings: Sequence[dict]) -> Figure:
    """Draw a claim, a panel for each of its readings.

    What all statements have in common after their colon is written below instead of in each row.

    Parameters
    ----------
    readings : sequence of dict
        Readings of one claim with the same statements.
    """
    ends = {one["what"].partition(": ")[2] for one in judged(readings[0])}
    common = ends.pop() if len(ends) == 1 else ""
    rows = len(judged(readings[0]))
    size = (2.4 + 2.3 * len(readings), 2 + 0.42 * len(judged(readings[0])))
    figure, axes = plt.subplots(
        1, len(readings), figsize=size, sharex=True, sharey=True, layout="constrained", squeeze=False
    )
    for ax, reading in zip(axes[0], readings, strict=True):
        draw_statements(ax, judged(reading))
        learned, by = (LABELS[reading[key]] for key in ("trained", "judged"))
        ax.set_title(f"learned from {learned}, judged\nby {by} labels:\n{reading['verdict']}", fontsize=9)
    if common:
        names = [in_words(one["what"].removesuffix(": " + common)) for one in judged(readings[0])]
        axes[0, 0].set_yticks(range(rows), names)
    for ax in axes[0]:
        ax.set_xlabel(f"{in_words(common)}\n[points]" if common else "difference [points]", fontsize=9)
    figure.legend(*legend_entries(axes[0, 0]), loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    return figure

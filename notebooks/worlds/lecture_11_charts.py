"""Charts of approximate inference in the CRF (section 3.5): its errors against time, and against the coupling."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

PANELS = {
    "total": "total error:\nagainst the exact kernel, converged",
    "kernel": "kernel error: against the exact kernel\nafter the same number of updates",
    "convergence": "convergence error:\nagainst the same kernel, converged",
}
"""The three errors of `crf_error`, and what each compares."""

_MARKERS = "osD^vP*X"

_FLOOR = 1e-7
"""Errors below this are rounding errors of single precision, and are drawn at it."""

_USUAL = 10
"""The package's default number of updates, whose points are drawn large."""


def error_against_time(result: Mapping, scene: str, of: str = "mean") -> Figure:
    """Draw time and error of each way of running mean field, in three panels that share their axes.

    A line is one way; its points are numbers of updates.

    Parameters
    ----------
    result : mapping
        From `crf_error`, or from its JSON file.
    scene : str
        One of the scenes of the result.
    of : str
        "mean" or "max" over the cells of the total variation, or "labels", the share of labels that differ.
    """
    figure, axes = plt.subplots(1, 3, figsize=(11, 4.4), sharex=True, sharey=True, layout="constrained")
    for ax, (error, title) in zip(axes, PANELS.items(), strict=True):
        for number, (way, found) in enumerate(result["scenes"][scene]["ways"].items()):
            values = np.maximum([one[of] for one in found[error]], _FLOOR)
            _points(ax, found["seconds"], values, way, number, result["iterations"])
        ax.set(xscale="log", yscale="log", xlabel="time [s]")
        ax.set_title(title, loc="left", fontsize="medium")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel({"labels": "share of labels that differ"}.get(of, f"{of} total variation of a cell"))
    shape = " x ".join(map(str, result["scenes"][scene]["shape"][1:]))
    counts = ", ".join(map(str, result["iterations"]))
    figure.suptitle(f"{scene}, {shape} cells; points: {counts} updates, large: {_USUAL}", fontsize="medium")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=8, fontsize="small")
    return figure


def _points(ax: Axes, x: Sequence[float], y: Sequence[float], name: str, number: int, counts: Sequence[int]) -> None:
    """Draw one way, with a large point at the usual number of updates."""
    style = {"color": f"C{number}", "marker": _MARKERS[number]}
    ax.plot(x, y, markersize=4, linewidth=1, label=name, **style)
    ax.scatter(*np.compress(np.equal(counts, _USUAL), [x, y], axis=1), s=70, edgecolor="black", zorder=3, **style)


def coupling_errors(result: Mapping) -> Figure:
    """Draw the errors of approximate inference on tiny grids against the coupling, one column per size.

    Lines are means over the random grids; in the upper row, bands reach from the first to the third quartile.

    Parameters
    ----------
    result : mapping
        From `crf_coupling`, or from its JSON file.
    """
    cases = result["cases"]
    couplings = result["couplings"]
    band = {"alpha": 0.1, "linewidth": 0}
    shape = {"figsize": (2.9 * len(cases), 5.6), "sharex": True, "sharey": "row", "squeeze": False}
    figure, axes = plt.subplots(2, len(cases), layout="constrained", **shape)
    ways = next(iter(cases.values()))["labels"]
    styles = {way: (f"C{number}", _MARKERS[number]) for number, way in enumerate(ways)}
    for column, (name, case) in zip(axes.T, cases.items(), strict=True):
        for ax, part in zip(column, ("variation", "labels"), strict=True):
            for way, errors in case[part].items():
                percent, colour, marker = 100 * np.asarray(errors), *styles[way]
                mean = percent.mean(axis=1)
                ax.plot(couplings, mean, color=colour, marker=marker, markersize=4, linewidth=1.2, label=way)
                if part == "variation":
                    ax.fill_between(couplings, *np.quantile(percent, (0.25, 0.75), axis=1), color=colour, **band)
            ax.grid(alpha=0.3)
        column[0].set_title(name, loc="left", fontsize="medium")
        column[1].set_xlabel("coupling $w_1$")
    axes[0, 0].set_ylabel("total variation from\nthe exact marginals [%]")
    axes[1, 0].set_ylabel("labels unlike the most\nlikely labelling [% of cells]")
    figure.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize="small")
    return figure

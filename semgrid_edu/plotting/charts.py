"""Charts of numbers: velocities (section 3.2), a confusion matrix (Table 3), training loss (4.1), inference (3.5)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from semgrid_edu.errors import ArgumentError
from semgrid_edu.plotting.colours import velocity_colours

if TYPE_CHECKING:  # training loads torch
    from semgrid_edu.training.log import TrainingLog

SMOOTHING = 50
"""Number of steps that a running mean is taken over; a stage with fewer steps takes all of them."""


def velocity_spread(velocity: NDArray, weight: NDArray, ax: Axes | None = None) -> Axes:
    """Draw a distribution over velocities, such as that of one cell's particles.

    Each velocity is a point, whose area is its weight. A cross marks the mean. The ellipse around it has half-axes of
    two standard deviations.

    Parameters
    ----------
    velocity : (N, 2) float
        Velocities forward and to the left, m/s.
    weight : (N,) float
        Their weights, not negative and not all zero; they need not sum to 1.
    ax : Axes, optional
        Axes to draw into.

    Raises
    ------
    ArgumentError
        When the shapes don't match, a velocity isn't finite, or the weights are negative, all zero or not finite.
    """
    velocity, weight = np.asarray(velocity, dtype=np.float64), np.asarray(weight, dtype=np.float64)
    if velocity.shape != (*weight.shape, 2) or weight.ndim != 1:
        raise ArgumentError("velocity", f"(N, 2) for weights of shape {weight.shape}", f"shape {velocity.shape}")
    if not (weight >= 0).all() or not 0 < weight.sum() < np.inf:
        raise ArgumentError("weight", "finite numbers >= 0, not all zero", weight)
    if not np.isfinite(velocity).all():
        raise ArgumentError("velocity", "finite numbers", velocity)
    ax = ax or plt.subplots(figsize=(4, 4), layout="constrained")[1]
    share = weight / weight.sum()
    area = 150 * min(1, 60 / len(share)) * share / share.max()
    ax.scatter(*velocity[:, ::-1].T, s=area, c=velocity_colours(velocity.T) / 255, alpha=0.7, linewidths=0)
    mean = share @ velocity
    away = velocity - mean
    velocity_ellipse(mean, np.einsum("n,ni,nj->ij", share, away, away), ax)
    ax.set(xlabel="velocity to the left [m/s]", ylabel="velocity forward [m/s]", aspect="equal")
    if not ax.xaxis_inverted():
        ax.invert_xaxis()
    return ax


def velocity_ellipse(mean: NDArray, covariance: NDArray, ax: Axes) -> Axes:
    """Mark a mean velocity with a cross, and its uncertainty with an ellipse of two standard deviations.

    Parameters
    ----------
    mean : (2,) float
        Mean velocity forward and to the left, m/s.
    covariance : (2, 2) float
        Covariance of the velocity forward and to the left, m^2/s^2.
    ax : Axes
        Axes from `velocity_spread`: velocity to the left across, forward up.

    Raises
    ------
    ArgumentError
        When `covariance` isn't symmetric and positive semi-definite.
    """
    covariance = np.asarray(covariance, dtype=np.float64)
    variance, axes = np.linalg.eigh(covariance) if covariance.shape == (2, 2) else ([np.nan], None)
    rounding = 1e-5 * (np.sum(np.square(mean)) + np.max(variance))  # E[v v^T] - mean mean^T in single precision
    if np.shape(mean) != (2,) or not np.all(np.array(variance) >= -rounding):
        raise ArgumentError("covariance", "(2, 2), symmetric, not negative, beside a mean (2,)", covariance)
    long, short = 4 * np.sqrt(np.maximum(variance[::-1], 0))
    angle = np.degrees(np.arctan2(axes[0, 1], axes[1, 1]))
    ax.add_patch(Ellipse((mean[1], mean[0]), long, short, angle=angle, fill=False, edgecolor="0.2", linewidth=1.2))
    ax.plot(mean[1], mean[0], "+", color="0.2", markersize=9)
    return ax


def confusion(matrix: NDArray, names: Sequence[str], ax: Axes | None = None) -> Axes:
    """Draw a confusion matrix as the paper's Table 3: row truth, column prediction, per cent of the row.

    Parameters
    ----------
    matrix : (n, n) int
        How often each true class (row) is called each class (column); a class without truth has an empty row.
    names : sequence of str
        Names of the n classes.
    ax : Axes, optional
        Axes to draw into.

    Raises
    ------
    ArgumentError
        When names and matrix differ in number.
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


def training_curves(logs: "TrainingLog | Mapping[str, TrainingLog]", ax: Axes | None = None) -> Axes:
    """Draw the loss of training runs over their steps: one point per step, and a line for the running mean.

    The two stages have losses of different things, pixels and cells, so the line breaks between them. The learning
    rate, which falls along half a cosine in each stage, isn't drawn.

    Parameters
    ----------
    logs : TrainingLog, or mapping of name to TrainingLog
        Logs from `read_log`, by the names that the legend shows.
    ax : Axes, optional
        Axes to draw into.

    Raises
    ------
    ArgumentError
        When there is no training run, or one has no step with a finite loss.
    """
    logs = logs if isinstance(logs, Mapping) else {"": logs}
    if not logs or not all(len(log.loss) for log in logs.values()):
        raise ArgumentError("logs", "at least one training run, each with at least one step", list(logs) or "none")
    for name, log in logs.items():
        if not np.any(np.isfinite(log.loss) & (log.loss > 0)):
            raise ArgumentError("logs", "a finite loss in each training run", f"none in {name or 'this one'}")
    ax = ax or plt.subplots(figsize=(8, 4), layout="constrained")[1]
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
    if any(logs):
        ax.legend(loc="upper right")
    return ax


def _curve(ax: Axes, log: "TrainingLog", name: str, colour: str) -> None:
    """Draw one training run, stage by stage, with a dotted line where a stage begins."""
    ax.scatter(log.iteration, log.loss, s=3, color=colour, alpha=0.2, linewidth=0)
    for stage, begin in _stages(log):
        here = log.stage == stage
        smooth = uniform_filter1d(log.loss[here], min(SMOOTHING, here.sum()), mode="reflect")
        ax.plot(log.iteration[here], smooth, color=colour, linewidth=1.2, label=name if stage == log.stage[0] else None)
        ax.axvline(begin, color="0.5", linewidth=0.8, linestyle=":")


def _stages(log: "TrainingLog") -> list[tuple[str, int]]:
    """Return the stages of a training run and the step with which each begins."""
    return [(stage, log.iteration[log.stage == stage][0]) for stage in dict.fromkeys(log.stage.tolist())]


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

    Raises
    ------
    ArgumentError
        When the result has no such scene.
    """
    if scene not in result["scenes"]:
        raise ArgumentError("scene", " or ".join(result["scenes"]), repr(scene))
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
    cases, couplings, band = result["cases"], result["couplings"], {"alpha": 0.1, "linewidth": 0}
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

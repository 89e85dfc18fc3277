"""Toys and pictures of lecture 12: plates, thirty intervals, one drive left out, a class that few drives have."""

from collections.abc import Callable, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from semgrid_edu.workshop.scoring.statistics import EstimatedMean
from worlds.lecture_12_pictures import RESULTS

HIT, MISS = "#1f4e79", "#c0392b"
"""The colours of intervals that contain the true value, and of those that don't; their marks differ, too."""

PLATES = (
    ((-0.8, -0.9), 2.0, 3.6, "seed $s = 1 \\ldots S$", (-0.72, 2.46)),
    ((-1.7, -1.1), 6.7, 1.9, "drive $v = 1 \\ldots V$", (2.9, -0.9)),
    ((-1.5, -0.7), 3.4, 1.3, "frame\n$f = 1 \\ldots F$", (-1.45, -0.05)),
)
"""Corner, width, height, text and its place of the three plates."""


def draw_plates(ax: Axes) -> None:
    """Draw the plates of seeds, drives and frames around the graph of a score.

    Parameters
    ----------
    ax : Axes
        The graph, with y at the origin.
    """
    for corner, width, height, text, place in PLATES:
        ax.add_patch(plt.Rectangle(corner, width, height, fill=False, edgecolor="0.2"))
        ax.text(*place, text, fontsize=9)
    ax.set(xlim=(-1.8, 5.1), ylim=(-1.2, 2.8))


def thirty(found: NDArray, ways: Sequence[str], truth: float = 0.75) -> None:
    """Draw the intervals of some experiments, a panel for each way of making them.

    Parameters
    ----------
    found : (E, W, 2) float
        Low and high of each experiment and way.
    ways : sequence of str
        What the intervals are made of.
    truth : float
        The true value.
    """
    size = (3.5 * len(ways), 3.6)
    _, axes = plt.subplots(1, len(ways), figsize=size, sharex=True, sharey=True, layout="constrained")
    for k, (ax, way) in enumerate(zip(axes, ways, strict=True)):
        for place, (low, high) in enumerate(100 * found[:, k]):
            colour, mark = (HIT, "o") if low <= 100 * truth <= high else (MISS, "x")
            ax.plot([low, high], [place, place], color=colour, linewidth=2)
            ax.plot((low + high) / 2, place, mark, color=colour, markersize=4)
        ax.axvline(100 * truth, color="0.4", linewidth=0.8)
        ax.set(title=f"over {way}", xlabel="score [%]", yticks=[])
    axes[0].set_ylabel(f"{len(found)} experiments")


def leaving_out(cells: Sequence[int]) -> None:
    """Draw drives of 100 cells once with all and once without each, and beside it the scores.

    Parameters
    ----------
    cells : sequence of int
        How many cells of each drive are called right.
    """
    _, (ax, beside) = plt.subplots(1, 2, figsize=(8.5, 2.6), layout="constrained")
    for row, out in enumerate((None, *range(len(cells)))):
        for v, right in enumerate(cells):
            left = v == out
            ax.add_patch(plt.Rectangle((v, -row), 0.9, 0.8, fc="white" if left else "#c6d7ea", ec="0.3"))
            ax.text(v + 0.45, 0.4 - row, "\u00d7" if left else right, ha="center", va="center", fontsize=9)
        name = "all" if out is None else f"without {'ABCD'[out]}"
        score = np.mean([right for v, right in enumerate(cells) if v != out])
        ax.text(-0.15, 0.4 - row, name, ha="right", va="center", fontsize=9)
        ax.text(4.1, 0.4 - row, f"{score:.1f} %", va="center", fontsize=9)
    for v, letter in enumerate("ABCD"):
        ax.text(v + 0.45, 1.05, letter, ha="center", fontsize=9)
    ax.set(xlim=(-2, 5.3), ylim=(-4.2, 1.5))
    ax.axis("off")
    own = np.array(cells)
    beside.plot((own.sum() - own) / (len(own) - 1), np.zeros(len(own)), "D", color=HIT)
    beside.plot(own, np.ones(len(own)), "o", color=HIT)
    beside.axvline(own.mean(), color="0.6", linestyle="--", linewidth=1)
    beside.set(yticks=(0, 1), yticklabels=("one left out", "each alone"), ylim=(-0.6, 1.6), xlabel="score [%]")


def balanced_or_not(baseline: str, seeds: int = 3) -> tuple[NDArray, NDArray, NDArray]:
    """Return counts by true labels of SegNet with and without a balanced loss, and of a baseline.

    Both networks learned on the same machine from the same seeds.

    Parameters
    ----------
    baseline : str
        Its name in table1.json.
    seeds : int
        Number of seeds; the first ones.

    Returns
    -------
    tuple of (S, V, C, C) int
        Confusion matrices by seed and drive.
    """
    ablations, table1 = (np.load(RESULTS / "reduced" / f"{name}_counts.npz") for name in ("ablations", "table1"))
    usual = "score-minikitti-segnet-lidar-500+500-seed{}-on-minikitti-test-lidar-crf/network"
    unbalanced = "score-minikitti-segnet-lidar-unbalanced-500+500-seed{}-on-minikitti-test-lidar/network"
    table = "baselines-minikitti-segnet-lidar-500-seed{}-on-minikitti-test-lidar/" + baseline
    of = ((ablations, usual), (ablations, unbalanced), (table1, table))
    return tuple(
        np.stack([counts[f"{name.format(seed)}, true labels, all distances"] for seed in range(seeds)])
        for counts, name in of
    )


def some_drives(rng: np.random.Generator, n: int, share: float) -> NDArray[np.int64]:
    """Return confusion matrices (n, 2, 2) of drives, of which only a share has the second class.

    Parameters
    ----------
    rng : Generator
        Random numbers.
    n : int
        Number of drives.
    share : float
        Probability that a drive has the second class.
    """
    cells = np.stack([np.full(n, 2000), 100 * (rng.random(n) < share)], axis=1)
    recall = 1 / (1 + np.exp(-np.array([1.5, 0.0]) - rng.normal(0, 0.8, (n, 2))))
    hits = rng.binomial(cells, recall)
    (a, b) = hits.T
    (x, y) = (cells - hits).T
    return np.array([[a, x], [y, b]]).transpose(2, 0, 1)


def tried(share: float, interval: Callable, metric: Callable, n: int = 20, trials: int = 200) -> NDArray[np.float64]:
    """Return for each experiment how many drives had the second class, whether the truth is inside, and the half-width.

    Parameters
    ----------
    share : float
        Probability that a drive has the second class.
    interval : callable
        Takes matrices (V, C, C) and a metric, returns low, score and high.
    metric : callable
        Takes a confusion matrix, such as `class_accuracy`.
    n : int
        Number of drives.
    trials : int
        Number of experiments.

    Returns
    -------
    (E, 3) float
        Number of drives with the second class; 1 if the interval contains the true score, else 0; how far it reaches to
        each side.
    """
    truth = metric(some_drives(np.random.default_rng(0), 100_000, 0.99).sum(axis=0))
    rng = np.random.default_rng(1)
    found = []
    for _ in range(trials):
        matrices = some_drives(rng, n, share)
        low, _, high = interval(matrices, metric)
        found.append((matrices[:, 1].any(axis=1).sum(), low <= truth <= high, (high - low) / 2))
    return np.array(found, dtype=np.float64)


def half_width(differences: Callable, counts: Sequence[NDArray], seeds: int = 1, drives: int = 1) -> float:
    """Return how far an interval would reach to each side, in points, with so many times as many seeds and drives.

    What a drive does to one seed alone is a part of what seeds contribute. This part shrinks with both.

    Parameters
    ----------
    differences : callable
        Takes the confusion matrix of each method, returns the score or the difference of two.
    counts : sequence of (S, V, C, C) int
        Confusion matrices of each method, by seed and drive.
    seeds, drives : int
        How many times as many.
    """
    n_seeds, n_drives = counts[0].shape[:2]
    totals = [matrices.sum(axis=1) for matrices in counts]
    scores = np.array([differences(*(total[s] for total in totals)) for s in range(n_seeds)])
    without = [total[:, None] - matrices for total, matrices in zip(totals, counts, strict=True)]
    left_out = [[differences(*(w[s, v] for w in without)) for v in range(n_drives)] for s in range(n_seeds)]
    parts = (n_drives - 1) * (scores[:, None] - np.array(left_out))
    of_both = parts.var(axis=0, ddof=1).sum() / (n_drives - 1) / n_seeds / n_drives
    of_seeds = scores.var(ddof=1) / n_seeds
    of_drives = max(parts.mean(axis=0).var(ddof=1) / n_drives - of_both, 0.0)
    shared = min(of_both, of_seeds)
    variances = (of_seeds - shared) / seeds + shared / (seeds * drives), of_drives / drives
    return 100 * EstimatedMean(0.0, variances, (n_seeds * seeds, n_drives * drives)).half_width(0.95)


def by_seed(experiment: str, network: str, labels: str, seeds: int) -> NDArray:
    """Return a network's kept counts (S, V, C, C) on the test drives, all distances.

    Parameters
    ----------
    experiment : str
        "table1" or "claims".
    network : str
        As in the names of the counts, such as "segnet-lidar".
    labels : str
        Judged by "lidar" or "true" labels.
    seeds : int
        Number of seeds; the first ones.
    """
    kept = np.load(RESULTS / "reduced" / f"{experiment}_counts.npz")
    scored = f"score-minikitti-{network}-500+500-seed"
    of = f"/network, {labels} labels, all distances"
    ends = [f"-on-minikitti-test-lidar{refined}{of}" for refined in ("-crf", "")]
    return np.stack(
        [kept[f"{scored}{seed}{end}"] for seed in range(seeds) for end in ends if f"{scored}{seed}{end}" in kept]
    )

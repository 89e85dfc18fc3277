"""How often 95 % intervals hold the true value of a made-up population: `python benchmarks/interval_coverage.py`.

The population is finite, 200 seeds and 800 drives, so its true value is known: the mean over all seeds of the score on
all drives. Each of 2000 trials draws 3 seeds and 20 drives of it. Beside `drive_interval` and `paired_interval` stands
what one would try first, the middle 95 % of scores of resampled seeds and drives.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.metrics import METRICS
from semgrid_edu.workshop.scoring.score_with_interval import markdown_table, per_cent
from semgrid_edu.workshop.scoring.statistics import Metric, drive_interval, paired_interval

SEEDS, DRIVES, TRIALS, RESAMPLES = 3, 20, 2000, 200

RATIOS = {
    "drives differ, seeds don't": (0.0, 0.4, 0.1),
    "seeds a little": (0.05, 0.4, 0.2),
    "seeds more": (0.15, 0.4, 0.2),
    "each seed its own drives": (0.1, 0.2, 0.4),
    "seeds more than drives": (0.4, 0.2, 0.1),
    "seeds alone": (0.4, 0.0, 0.0),
}
"""Standard deviations, on the logit scale, of seeds, of drives, and of what a seed does on one drive alone."""


def population(
    method: int, of_seeds: float, of_drives: float, of_both: float, rarest: float = 0.7
) -> NDArray[np.float64]:
    """Return the confusion matrices of 200 seeds of a method on 800 drives, (200, 800, 4, 4).

    All methods meet the same drives. These differ in size by a log-normal factor, and a share of them, `rarest`, has
    the rarest of four classes. The recall of a class varies on the logit scale, by the standard deviations of `RATIOS`;
    half of the variance of seeds and drives is common to all classes.
    """
    world = np.random.default_rng(1)
    own = np.random.default_rng([2, method])
    (n_seeds, n_drives, n) = (200, 800, 4)
    cells = np.array([3000, 1500, 400, 120]) * world.lognormal(0, 0.8, (n_drives, n))
    cells[:, 3] *= world.random(n_drives) > 1 - rarest
    logit = np.array([2.0, 1.2, 0.6, 0.0]) + 0.1 * method
    for rng, sd, size in ((own, of_seeds, (n_seeds, 1)), (world, of_drives, (1, n_drives))):
        for of_class in (1, n):
            logit = logit + sd * np.sqrt(0.5) * rng.normal(size=(*size, of_class))
    recall = 1 / (1 + np.exp(-logit - of_both * own.normal(size=(n_seeds, n_drives, n))))[..., None]
    wrong = np.array([[0, 0.6, 0.3, 0.1], [0.7, 0, 0.2, 0.1], [0.5, 0.4, 0, 0.1], [0.4, 0.3, 0.3, 0]])
    return cells[..., None] * (recall * np.eye(n) + (1 - recall) * wrong)


def coverage(interval: Callable, metric: Metric, *methods: NDArray, trials: int = TRIALS) -> float:
    """Return how often an interval of one method, or of two that are compared, holds the true value."""
    on_all_drives = zip(*(method.sum(axis=1) for method in methods), strict=True)
    truth = np.mean([np.subtract.reduce([metric(matrix) for matrix in of_seed]) for of_seed in on_all_drives])
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(trials):
        drawn = np.ix_(rng.integers(0, len(methods[0]), SEEDS), rng.integers(0, methods[0].shape[1], DRIVES))
        low, _, high = interval(*(method[drawn] for method in methods), metric)
        held += low <= truth <= high
    return held / trials


def resampled_interval(*arguments: NDArray | Metric) -> tuple[float, float, float]:
    """Return the middle 95 % of the mean score, or mean difference, of seeds and drives drawn with replacement."""
    *methods, metric = arguments
    rng = np.random.default_rng(0)
    values = []
    for _ in range(RESAMPLES):
        seeds = rng.integers(0, SEEDS, SEEDS)
        times = rng.multinomial(DRIVES, np.full(DRIVES, 1 / DRIVES))
        scores = [np.mean([metric(np.tensordot(times, method[s], 1)) for s in seeds]) for method in methods]
        values.append(np.subtract.reduce(scores))
    return np.quantile(values, 0.025), float(np.mean(values)), np.quantile(values, 0.975)


def main() -> None:
    """Print how often the intervals hold the truth, per cent, by what varies and by metric."""
    rows = [["what varies", *METRICS, *(f"{name}, paired" for name in METRICS), "resampled, paired"]]
    for name, ratio in RATIOS.items():
        a, b = (population(method, *ratio) for method in (0, 1))
        held = [coverage(drive_interval, metric, a) for metric in METRICS.values()]
        held += [coverage(paired_interval, metric, a, b) for metric in METRICS.values()]
        held.append(coverage(resampled_interval, METRICS["pixel accuracy"], a, b, trials=TRIALS // 10))
        rows.append([name, *map(per_cent, held)])
    print(markdown_table(rows))
    for rarest in (0.2, 0.1, 0.05):
        few = population(0, *RATIOS["seeds a little"], rarest)
        held = per_cent(coverage(drive_interval, METRICS["class accuracy"], few))
        print(f"a class in {rarest:.0%} of the drives: class accuracy {held}")


if __name__ == "__main__":
    main()

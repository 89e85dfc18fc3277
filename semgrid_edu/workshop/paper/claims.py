"""The paper's claims (`claims.toml`) as statements about numbers, each with its number (section 4).

By default, scores are those of Table 1's networks without the CRF. A claim may have several readings: by what networks
learned from, and by what they are scored against.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.metrics import METRICS, class_accuracy
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.other_runs import FRAME, OVERTURNED, STEP, UPRIGHT, p_not_saved, time_saved
from semgrid_edu.workshop.paper.published import NETWORKS
from semgrid_edu.workshop.paper.run_counts import RunCounts
from semgrid_edu.workshop.paper.score_runs import GEOMETRY, TRUE_GEOMETRY, WITH_CRF, CountingRun, ScoreRun, by_seed
from semgrid_edu.workshop.scoring.confusions import distance_band_names
from semgrid_edu.workshop.scoring.grids import NETWORK, OCCUPANCY_ALONE
from semgrid_edu.workshop.scoring.score_with_interval import ScoreWithInterval, compared, score_with_interval
from semgrid_edu.workshop.scoring.statistics import Metric, drive_estimate, paired_estimate

CLAIMS: dict[int, dict] = {int(number): row for number, row in table_beside(__file__).items()}
"""By number: the paper's own sentence ("quote"), what we read in it ("claim"), in words what must hold ("judged_by"),
by which labels ("readings"), for which "networks", and whether the paper states it as an "expectation"."""

MARGIN = 0.005
"""Half a point: by less than that, a score counts as unchanged in claim 8."""

CAR_MARGIN = 0.1
"""Ten points: by less than that, an overturned car is called car as an upright one is, in claim 6."""


class Statement(NamedTuple):
    """One number that a claim is about.

    Parameters
    ----------
    what : str
        What the number is.
    value : dict
        The number with its interval, as `score_with_interval` and `compared` return it.
    limit : float
        What it is compared with, in the same unit.
    above : bool
        Whether it is claimed to be above the limit; else below.
    p : float or None
        The one-sided p-value against the statement, see `EstimatedMean.p_value`; None where there is no interval.
    judged : bool
        Whether the claim needs it. What the claim doesn't need is shown beside it.
    """

    what: str
    value: ScoreWithInterval
    limit: float = 0.0
    above: bool = True
    p: float | None = None
    judged: bool = True

    @property
    def confirmed(self) -> bool:
        """Whether the whole interval is on the claimed side."""
        low = self.value["low"]
        high = self.value["high"]
        if low is None or high is None:
            return False
        return low > self.limit if self.above else high < self.limit


class Reading(NamedTuple):
    """One way to judge a claim.

    Parameters
    ----------
    runs : SimpleNamespace
        From `runs_of_claims`; they have ended.
    known : RunCounts
        What is known about them.
    trained, judged : str
        What networks learned from, and what they are scored against: "lidar" or "true".
    """

    runs: SimpleNamespace
    known: RunCounts
    trained: str = "lidar"
    judged: str = "lidar"

    def counted(self, some: Sequence[CountingRun], method: str = NETWORK, band: str | None = None) -> NDArray[np.int64]:
        """Return what runs counted against the labels that judge, by seed and drive.

        Parameters
        ----------
        some : sequence of S CountingRun
            One per seed.
        method, band
            As `FrameConfusions.of` takes them.
        """
        return by_seed(some, self.known, method, self.judged, band)

    @property
    def usual(self) -> list[ScoreRun]:
        """The usual network, SegNet, as it was trained for this reading."""
        return self.runs.usual if self.trained == "lidar" else self.runs.taught_true


def stated(
    what: str, metric: Metric, *counts: NDArray, limit: float = 0.0, above: bool = True, judged: bool = True
) -> Statement:
    """Return a statement about a score, or about the difference of two.

    Parameters
    ----------
    what : str
        What the number is.
    metric : callable
        Takes a confusion matrix (C, C), row: truth, and returns a number.
    *counts : (S, V, C, C) int
        One method by seed and drive, or two whose difference is meant.
    limit, above, judged
        As `Statement` takes them.
    """
    score, estimate = (compared, paired_estimate) if len(counts) == 2 else (score_with_interval, drive_estimate)
    value = score(*counts, metric)
    p = None if value["low"] is None else estimate(*counts, metric).p_value(limit, above)
    return Statement(what, value, limit, above, p, judged)


def _gains(
    pairs: Mapping[str, tuple[NDArray, NDArray]], metrics: Mapping[str, Metric] = METRICS, limit: float = 0.0
) -> list[Statement]:
    """Return for each pair of methods and each metric the statement that the first is better by more than a limit."""
    return [
        stated(f"{name}{what}", metric, *pair, limit=limit)
        for what, pair in pairs.items()
        for name, metric in metrics.items()
    ]


def _order_of_networks(one: Reading) -> list[Statement]:
    found = {name: one.counted(some) for name, some in one.runs.networks.items()}
    return _gains({f": {NETWORKS[a]} - {NETWORKS[b]}": (found[a], found[b]) for a, b in pairwise(NETWORKS)})


def _effect_of_crf(one: Reading) -> list[Statement]:
    networks = one.runs.networks if one.trained == "lidar" else {"segnet": one.runs.taught_true}
    return [found for name, some in networks.items() for found in _with_crf(NETWORKS[name], some, one)]


def _with_crf(name: str, some: Sequence[ScoreRun], one: Reading) -> list[Statement]:
    pair = one.counted(some, WITH_CRF), one.counted(some)
    return [
        stated(f"{name}, {metric}: with CRF - without", METRICS[metric], *pair, above=above)
        for metric, above in (("pixel accuracy", True), ("class accuracy", False))
    ]


def _errors_on_perfect_data(one: Reading) -> list[Statement]:
    found = one.counted(one.runs.perfect)
    road, car, lane, pole = map(SYNTHIA_10.index, ("road", "car", "lane", "pole"))
    numbers = {
        "share of errors on things that are called void": (called_void, 0.5),
        "road called right, above the mean class": (lambda m: called(m, road, road) - class_accuracy(m), 0),
        "car called right, above the mean class": (lambda m: called(m, car, car) - class_accuracy(m), 0),
        "lane called lane - road called lane": (lambda m: called(m, lane, lane) - called(m, road, lane), 0),
        "cells called pole over cells of poles": (lambda m: _share(m[:, pole].sum(), m[pole].sum()), 1),
    }
    return [stated(what, metric, found, limit=limit) for what, (metric, limit) in numbers.items()]


def called(matrix: NDArray, truth: int, name: int) -> float:
    """Return the share of a class's cells that are called so; NaN when there is no such cell.

    Parameters
    ----------
    matrix : (C, C) int
        A confusion matrix.
    truth, name : int
        The true class, and what it is called.

    Examples
    --------
    >>> called(np.array([[6, 2], [0, 0]]), truth=0, name=1)
    0.25
    """
    return _share(matrix[truth, name], matrix[truth].sum())


def called_void(matrix: NDArray) -> float:
    """Return, of the cells that aren't void and are called wrong, the share that is called void.

    Parameters
    ----------
    matrix : (10, 10) int
        A confusion matrix of SYNTHIA-10, one row per true class.
    """
    things = matrix[1:]
    return _share(things[:, SYNTHIA_10.index("void")].sum(), things.sum() - np.trace(matrix[1:, 1:]))


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole else np.nan


def _effect_of_distance(one: Reading) -> list[Statement]:
    bands = {band: one.counted(one.usual, band=band) for band in distance_band_names()}
    first, second, *others = bands.values()
    near = first + second
    middle = others[0] + others[1]
    far = sum(others[2:])
    every = range(KITTI_14.n_semantic)
    kinds = {"all": every, "standing": [c for c in every if KITTI_14.names[c] not in KITTI_14.flat]}
    pairs = {"0-20 m - 20-40 m": (near, middle), "20-40 m - beyond": (middle, far), "0-10 m - 10-20 m": (first, second)}
    return [
        stated(f"{what} classes called right: {name}", _right_of(classes), *pair, judged=name in list(pairs)[:2])
        for what, classes in kinds.items()
        for name, pair in pairs.items()
    ]


def _right_of(classes: Sequence[int]) -> Metric:
    """Return the metric "share of these classes' cells that are called right"."""
    return lambda matrix: _share(np.diag(matrix)[classes].sum(), matrix[classes].sum())


def _overturned_cars(one: Reading) -> list[Statement]:
    lying = one.counted(one.runs.overturned, OVERTURNED)
    blind = one.counted(one.runs.overturned_blind, OVERTURNED)
    upright = one.counted(one.runs.overturned, UPRIGHT)
    right = _right_of([KITTI_14.index("car")])
    return [
        stated("called car: overturned cars - upright ones", right, lying, upright, limit=-CAR_MARGIN),
        stated("overturned cars called car: with occupancy grid - without", right, lying, blind),
        stated("overturned cars called car", right, lying, limit=0.5, judged=False),
        stated("upright cars called car", right, upright, limit=0.5, judged=False),
    ]


def _road_and_sidewalk(one: Reading) -> list[Statement]:
    network = one.counted(one.usual)
    alone = one.counted(one.runs.baselines, OCCUPANCY_ALONE)
    shares = {"road": lambda matrix: _apart(matrix)[0], "sidewalk": lambda matrix: _apart(matrix)[1]}
    either = {f"{name} called {name}, of those called either": metric for name, metric in shares.items()}
    return [
        *(stated(what, metric, network, limit=0.5) for what, metric in either.items()),
        stated("mean of both: network - occupancy alone", lambda m: float(_apart(m).mean()), network, alone),
    ]


def _apart(matrix: NDArray) -> NDArray[np.float64]:
    """Return the shares of road and sidewalk that are called right, of their cells that are called either."""
    either = [KITTI_14.index("road"), KITTI_14.index("sidewalk")]
    some = matrix[np.ix_(either, either)]
    return np.diag(some) / np.maximum(some.sum(axis=1), 1)


def _effect_of_reduction(one: Reading) -> list[Statement]:
    pair = (one.counted(one.runs.usual_of_all_seeds), one.counted(one.runs.unreduced))
    times = one.runs.times[0]
    rounds = {"of a frame": times.rounds(one.known, FRAME), "of a training step": times.rounds(one.known, STEP)}
    saved = [Statement(f"share of the time {of} saved", time_saved(r), p=p_not_saved(r)) for of, r in rounds.items()]
    return [*_gains({": with reduction - without": pair}, limit=-MARGIN), *saved]


def _geometry_and_learning(one: Reading) -> list[Statement]:
    runs = one.runs
    network = one.counted(one.usual)
    off = one.counted(runs.usual_off)
    geometry = one.counted(runs.baselines, GEOMETRY)
    geometry_off = one.counted(runs.baselines_off, GEOMETRY)
    true_labels, dense = (one.counted(some, TRUE_GEOMETRY) for some in (runs.baselines, runs.baselines_dense))
    pairs = {
        ", geometry: true image labels - the network's": (true_labels, geometry),
        ", geometry: right calibration - wrong one": (geometry, geometry_off),
        ", geometry: depth of every pixel - the LIDAR's": (dense, true_labels),
        ", network - geometry": (network, geometry),
        ", wrong calibration: network - geometry": (off, geometry_off),
    }
    return _gains(pairs, {name: METRICS[name] for name in ("pixel accuracy", "class accuracy")})


def _beside(what: str, others: str) -> Callable[[Reading], list[Statement]]:
    """Return how the usual network is compared with other runs, in every metric."""
    return lambda one: _gains({what: (one.counted(one.usual), one.counted(getattr(one.runs, others)))})


STATEMENTS: dict[int, Callable[[Reading], list[Statement]]] = {
    1: _order_of_networks,
    2: _effect_of_crf,
    3: lambda one: _with_crf(NETWORKS["segnet"], one.runs.new_routes, one),
    4: _errors_on_perfect_data,
    5: _effect_of_distance,
    6: _overturned_cars,
    7: _road_and_sidewalk,
    8: _effect_of_reduction,
    9: _geometry_and_learning,
    10: _beside(": end to end - two stages", "two_stages"),
    11: _beside(": balanced - not", "unbalanced"),
    12: _beside(": 20 planes - one", "one_plane"),
}
"""By claim: a reading -> the claim's statements with their numbers."""

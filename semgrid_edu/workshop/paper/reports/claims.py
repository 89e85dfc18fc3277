"""What the paper's nine claims (`claims.toml`) say as statements about numbers, each with its number (section 4).

Unless a statement says otherwise, scores are those of the networks of Table 1 without the CRF, against labels made with
the LIDAR as in the paper.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.metrics import METRICS, class_accuracy
from semgrid_edu.storage.files import table_beside
from semgrid_edu.workshop.paper.reports.verdicts import Statement
from semgrid_edu.workshop.paper.runs.other_runs import OVERTURNED, time_saved
from semgrid_edu.workshop.paper.runs.paper import NETWORKS
from semgrid_edu.workshop.paper.runs.score_runs import GEOMETRY, TRUE_GEOMETRY, WITH_CRF, CountingRun, ScoreRun, by_seed
from semgrid_edu.workshop.scoring.grids import NETWORK, OCCUPANCY_ALONE
from semgrid_edu.workshop.scoring.score_with_interval import compared, score_with_interval
from semgrid_edu.workshop.scoring.statistics import Metric

CLAIMS: dict[int, dict[str, str]] = {int(number): texts for number, texts in table_beside(__file__).items()}
"""By number: what the paper says, in short ("claim"), and in words what must hold ("judged_by")."""

MARGIN = 0.005
"""Half a point: by less than that, a score counts as unchanged in claim 8."""


def _true(some: Sequence[CountingRun], root: Path, method: str = NETWORK) -> NDArray[np.int64]:
    """Return what was counted against the true labels."""
    return by_seed(some, root, method, "true")


def _gains(
    pairs: Mapping[str, tuple[NDArray, NDArray]], metrics: Mapping[str, Metric] = METRICS, limit: float = 0.0
) -> list[Statement]:
    """Return for each pair of methods and each metric the statement that the first is better by more than a limit."""
    return [
        Statement(f"{name}{what}", compared(a, b, metric), limit)
        for what, (a, b) in pairs.items()
        for name, metric in metrics.items()
    ]


def _order_of_networks(runs: SimpleNamespace, root: Path) -> list[Statement]:
    found = {name: by_seed(some, root, NETWORK, "lidar") for name, some in runs.networks.items()}
    return _gains({f": {NETWORKS[a]} - {NETWORKS[b]}": (found[a], found[b]) for a, b in pairwise(NETWORKS)})


def _effect_of_crf(runs: SimpleNamespace, root: Path) -> list[Statement]:
    return [one for name, some in runs.networks.items() for one in _with_crf(NETWORKS[name], some, root)]


def _with_crf(name: str, some: list[ScoreRun], root: Path) -> list[Statement]:
    with_crf, without = (by_seed(some, root, method, "lidar") for method in (WITH_CRF, NETWORK))
    return [
        Statement(f"{name}, {metric}: with CRF - without", compared(with_crf, without, METRICS[metric]), 0, above)
        for metric, above in (("pixel accuracy", True), ("class accuracy", False))
    ]


def _errors_on_perfect_data(runs: SimpleNamespace, root: Path) -> list[Statement]:
    found = _true(runs.perfect, root)
    road, car, lane, pole = map(SYNTHIA_10.index, ("road", "car", "lane", "pole"))
    numbers = {
        "share of errors on things that are called void": (called_void, 0.5),
        "road called right, above the mean class": (lambda m: called(m, road, road) - class_accuracy(m), 0),
        "car called right, above the mean class": (lambda m: called(m, car, car) - class_accuracy(m), 0),
        "lane called lane - road called lane": (lambda m: called(m, lane, lane) - called(m, road, lane), 0),
        "cells called pole over cells of poles": (lambda m: m[:, pole].sum() / m[pole].sum(), 1),
    }
    return [Statement(what, score_with_interval(found, metric), limit) for what, (metric, limit) in numbers.items()]


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


def _effect_of_distance(runs: SimpleNamespace, root: Path) -> list[Statement]:
    near, middle, far = (
        sum(by_seed(runs.usual, root, NETWORK, "true", band) for band in bands)
        for bands in (("0-10 m", "10-20 m"), ("20-30 m", "30-40 m"), ("40-50 m", "50-60 m", "beyond 60 m"))
    )
    every = range(KITTI_14.n_semantic)
    kinds = {"all": every, "standing": [c for c in every if KITTI_14.names[c] not in KITTI_14.flat]}
    return [
        Statement(f"{what} classes called right: {between}", compared(a, b, _right_of(classes)))
        for what, classes in kinds.items()
        for between, a, b in (("0-20 m - 20-40 m", near, middle), ("20-40 m - beyond", middle, far))
    ]


def _right_of(classes: Sequence[int]) -> Metric:
    """Return the metric "share of these classes' cells that are called right"."""
    return lambda matrix: _share(np.diag(matrix)[classes].sum(), matrix[classes].sum())


def _overturned_cars(runs: SimpleNamespace, root: Path) -> list[Statement]:
    with_grid, without = (by_seed(some, root, OVERTURNED, "true") for some in (runs.overturned, runs.overturned_blind))
    right = _right_of([KITTI_14.index("car")])
    return [
        Statement("overturned cars called car", score_with_interval(with_grid, right), 0.5),
        Statement("the same: with occupancy grid - without", compared(with_grid, without, right)),
    ]


def _road_and_sidewalk(runs: SimpleNamespace, root: Path) -> list[Statement]:
    network, alone = _true(runs.usual, root), _true(runs.baselines, root, OCCUPANCY_ALONE)
    shares = {"road": lambda matrix: _apart(matrix)[0], "sidewalk": lambda matrix: _apart(matrix)[1]}
    either = {f"{name} called {name}, of those called either": metric for name, metric in shares.items()}
    together = compared(network, alone, lambda matrix: float(_apart(matrix).mean()))
    return [
        *(Statement(what, score_with_interval(network, metric), 0.5) for what, metric in either.items()),
        Statement("mean of both: network - occupancy alone", together),
    ]


def _apart(matrix: NDArray) -> NDArray[np.float64]:
    """Return the shares of road and sidewalk that are called right, of their cells that are called either."""
    either = [KITTI_14.index("road"), KITTI_14.index("sidewalk")]
    some = matrix[np.ix_(either, either)]
    return np.diag(some) / np.maximum(some.sum(axis=1), 1)


def _effect_of_reduction(runs: SimpleNamespace, root: Path) -> list[Statement]:
    ours, whole = (by_seed(some, root, NETWORK, "lidar") for some in (runs.usual, runs.unreduced))
    costs = _gains({": with reduction - without": (ours, whole)}, limit=-MARGIN)
    return [*costs, Statement("share of the time saved", time_saved(runs.times[0].seconds_per_frame(root)))]


def _geometry_and_learning(runs: SimpleNamespace, root: Path) -> list[Statement]:
    network, off = _true(runs.usual, root), _true(runs.usual_off, root)
    geometry, geometry_off = _true(runs.baselines, root, GEOMETRY), _true(runs.baselines_off, root, GEOMETRY)
    pairs = {
        ", geometry: true image labels - the network's": (_true(runs.baselines, root, TRUE_GEOMETRY), geometry),
        ", geometry: right calibration - wrong one": (geometry, geometry_off),
        ", network - geometry": (network, geometry),
        ", wrong calibration: network - geometry": (off, geometry_off),
    }
    return _gains(pairs, {name: METRICS[name] for name in ("pixel accuracy", "class accuracy")})


STATEMENTS: dict[int, Callable[[SimpleNamespace, Path], list[Statement]]] = {
    1: _order_of_networks,
    2: _effect_of_crf,
    3: lambda runs, root: _with_crf(NETWORKS["segnet"], runs.new_routes, root),
    4: _errors_on_perfect_data,
    5: _effect_of_distance,
    6: _overturned_cars,
    7: _road_and_sidewalk,
    8: _effect_of_reduction,
    9: _geometry_and_learning,
}
"""By claim: (`runs_of_claims`, which have ended; folder of all runs) -> its statements with their numbers."""

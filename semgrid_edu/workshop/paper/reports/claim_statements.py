"""What the paper's nine claims say as statements about numbers, each with its number (section 4).

Unless a statement says otherwise, scores are those of the networks of Table 1 without the CRF, against labels made with
the LIDAR as in the paper.
"""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_edu.labels import KITTI_14, SYNTHIA_10
from semgrid_edu.metrics import METRICS, class_accuracy, pixel_accuracy
from semgrid_edu.workshop.paper.reports.verdicts import Statement
from semgrid_edu.workshop.paper.runs.claim_runs import ClaimRuns
from semgrid_edu.workshop.paper.runs.other_runs import OVERTURNED, time_saved
from semgrid_edu.workshop.paper.runs.paper import NETWORKS
from semgrid_edu.workshop.paper.runs.score_runs import (
    GEOMETRY,
    NETWORK,
    OCCUPANCY_ALONE,
    TRUE_GEOMETRY,
    WITH_CRF,
    ScoreRun,
    by_seed,
)
from semgrid_edu.workshop.scoring.score_with_interval import compared, score_with_interval

MARGIN = 0.005
"""Half a point: by less than that, a score counts as unchanged in claim 8."""


def order_of_networks(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 1.

    Parameters
    ----------
    runs : ClaimRuns
        The runs.
    root : Path
        The folder of all runs.

    Returns
    -------
    list of Statement
    """
    found = {name: by_seed(some, root, NETWORK, "lidar") for name, some in runs.networks.items()}
    return [
        Statement(f"{metric}: {NETWORKS[a]} - {NETWORKS[b]}", compared(found[a], found[b], METRICS[metric]))
        for a, b in pairwise(NETWORKS)
        for metric in METRICS
    ]


def effect_of_crf(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 2. Parameters and result are those of `order_of_networks`."""
    return [one for name, some in runs.networks.items() for one in _crf(NETWORKS[name], some, root)]


def _crf(name: str, some: list[ScoreRun], root: Path) -> list[Statement]:
    with_crf, without = (by_seed(some, root, method, "lidar") for method in (WITH_CRF, NETWORK))
    return [
        Statement(f"{name}, pixel accuracy: with CRF - without", compared(with_crf, without, pixel_accuracy)),
        Statement(f"{name}, class accuracy: with CRF - without", compared(with_crf, without, class_accuracy), 0, False),
    ]


def effect_on_new_routes(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 3. Parameters and result are those of `order_of_networks`."""
    return _crf(NETWORKS["segnet"], runs.new_routes, root)


def errors_on_perfect_data(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 4. Parameters and result are those of `order_of_networks`."""
    found = by_seed(runs.perfect, root, NETWORK, "true")
    classes = {name: SYNTHIA_10.index(name) for name in ("road", "car", "lane", "pole")}

    def above_mean(c: int) -> Callable[[NDArray], float]:
        return lambda matrix: called(matrix, c, c) - class_accuracy(matrix)

    road, car, lane, pole = classes.values()
    return [
        Statement("share of errors on things that are called void", score_with_interval(found, called_void), 0.5),
        Statement("road called right, above the mean class", score_with_interval(found, above_mean(road))),
        Statement("car called right, above the mean class", score_with_interval(found, above_mean(car))),
        Statement(
            "lane called lane - road called lane",
            score_with_interval(found, lambda m: called(m, lane, lane) - called(m, road, lane)),
        ),
        Statement(
            "cells called pole over cells of poles",
            score_with_interval(found, lambda m: m[:, pole].sum() / m[pole].sum()),
            1,
        ),
    ]


def called(matrix: NDArray, truth: int, name: int) -> float:
    """Return the share of a class's cells that are called so.

    Parameters
    ----------
    matrix : (C, C) int
        A confusion matrix.
    truth, name : int
        The true class, and what it is called.

    Returns
    -------
    float
        NaN when there is no such cell.

    Examples
    --------
    >>> called(np.array([[6, 2], [0, 0]]), truth=0, name=1)
    0.25
    """
    total = matrix[truth].sum()
    return float(matrix[truth, name] / total) if total else np.nan


def called_void(matrix: NDArray) -> float:
    """Return, of the cells that aren't void and are called wrong, the share that is called void.

    Parameters
    ----------
    matrix : (10, 10) int
        A confusion matrix of SYNTHIA-10, one row per true class.

    Returns
    -------
    float
        From 0 to 1; NaN when no such cell is called wrong.
    """
    things = matrix[1:]
    wrong = things.sum() - np.trace(matrix[1:, 1:])
    return float(things[:, SYNTHIA_10.index("void")].sum() / wrong) if wrong else np.nan


def effect_of_distance(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 5. Parameters and result are those of `order_of_networks`."""
    near, middle, far = (
        sum(by_seed(runs.usual, root, NETWORK, "true", band) for band in bands)
        for bands in (("0-10 m", "10-20 m"), ("20-30 m", "30-40 m"), ("40-50 m", "50-60 m", "beyond 60 m"))
    )
    standing = [c for c in range(KITTI_14.n_semantic) if KITTI_14.names[c] not in KITTI_14.flat]
    statements = []
    for what, kept in (("all", range(KITTI_14.n_semantic)), ("standing", standing)):
        for between, a, b in (("0-20 m - 20-40 m", near, middle), ("20-40 m - beyond", middle, far)):
            difference = compared(a, b, _right_of(kept))
            statements.append(Statement(f"{what} classes called right: {between}", difference))
    return statements


def _right_of(classes: range | list[int]) -> Callable[[NDArray], float]:
    """Return the metric "share of these classes' cells that are called right"."""

    def right(matrix: NDArray) -> float:
        total = matrix[list(classes)].sum()
        return float(np.diag(matrix)[list(classes)].sum() / total) if total else np.nan

    return right


def overturned_cars(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 6. Parameters and result are those of `order_of_networks`."""
    car = KITTI_14.index("car")
    with_grid, without = (by_seed(some, root, OVERTURNED, "true") for some in (runs.overturned, runs.overturned_blind))
    return [
        Statement("overturned cars called car", score_with_interval(with_grid, lambda m: called(m, car, car)), 0.5),
        Statement(
            "the same: with occupancy grid - without", compared(with_grid, without, lambda m: called(m, car, car))
        ),
    ]


def road_and_sidewalk(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 7. Parameters and result are those of `order_of_networks`."""
    network = by_seed(runs.usual, root, NETWORK, "true")
    alone = by_seed(runs.baselines, root, OCCUPANCY_ALONE, "true")
    return [
        Statement(
            "road called road, of those called either", score_with_interval(network, lambda m: _apart(m)[0]), 0.5
        ),
        Statement(
            "sidewalk called sidewalk, of those called either",
            score_with_interval(network, lambda m: _apart(m)[1]),
            0.5,
        ),
        Statement(
            "mean of both: network - occupancy alone", compared(network, alone, lambda m: float(_apart(m).mean()))
        ),
    ]


def _apart(matrix: NDArray) -> NDArray[np.float64]:
    """Return the shares of road and sidewalk that are called right, of their cells that are called either."""
    either = [KITTI_14.index("road"), KITTI_14.index("sidewalk")]
    some = matrix[np.ix_(either, either)]
    return np.diag(some) / np.maximum(some.sum(axis=1), 1)


def effect_of_reduction(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 8. Parameters and result are those of `order_of_networks`."""
    ours, whole = (by_seed(some, root, NETWORK, "lidar") for some in (runs.usual, runs.unreduced))
    costs = [
        Statement(f"{name}: with reduction - without", compared(ours, whole, metric), -MARGIN)
        for name, metric in METRICS.items()
    ]
    return [*costs, Statement("share of the time saved", time_saved(runs.times.seconds_per_frame(root)))]


def geometry_and_learning(runs: ClaimRuns, root: Path) -> list[Statement]:
    """Return the statements of claim 9. Parameters and result are those of `order_of_networks`."""
    network, off = (by_seed(some, root, NETWORK, "true") for some in (runs.usual, runs.usual_off))
    geometry, geometry_off = (by_seed(some, root, GEOMETRY, "true") for some in (runs.baselines, runs.baselines_off))
    true_labels = by_seed(runs.baselines, root, TRUE_GEOMETRY, "true")
    pairs = {
        "geometry: true image labels - the network's": (true_labels, geometry),
        "geometry: right calibration - wrong one": (geometry, geometry_off),
        "network - geometry": (network, geometry),
        "wrong calibration: network - geometry": (off, geometry_off),
    }
    return [
        Statement(f"{name}, {what}", compared(a, b, metric))
        for what, (a, b) in pairs.items()
        for name, metric in (("pixel accuracy", pixel_accuracy), ("class accuracy", class_accuracy))
    ]
